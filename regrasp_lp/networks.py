"""A switching graph as a `networkx` graph."""

from __future__ import annotations

from typing import TYPE_CHECKING

import networkx as nx

if TYPE_CHECKING:
    from regrasp_lp.switching_graph import SwitchingGraph


def networkx_graph(graph: SwitchingGraph) -> nx.Graph[int]:
    """Return a graph with all its edges explicit (`SwitchingGraph.to_networkx`)."""
    result: nx.Graph[int] = nx.Graph(name=graph.polygon.name)
    for index, grasp_set in enumerate(graph.sets):
        result.add_node(
            index,
            kind=grasp_set.kind,
            edges=grasp_set.edges,
            center=grasp_set.center,
            margin=grasp_set.margin,
        )
    for index in range(len(graph)):
        others, held = graph.switches.neighbors(index)
        listed = dict(zip(others.tolist(), held.tolist(), strict=True))
        result.add_edges_from(
            (index, other, {"held": listed.get(other, 0)})
            for other in graph.neighbors(index)
            if other > index
        )
    return result
