"""The search for fewest placements against networkx on every pair of sets of small graphs."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from geometry import ell, rectangle, right_triangle, star, unit_square
from regrasps import directed

import regrasp_lp as rl
from regrasp_lp.planning.search import fewest_placements, placements_from

CASES = [
    (name, k, sets)
    for name in ("square", "triangle", "rectangle")
    for k in (3, 4, 5, 6)
    for sets in ("complete", "chapter")
] + [("ell", 3, "chapter"), ("ell", 4, "complete"), ("star", 4, "chapter"), ("star", 3, "complete")]

POLYGONS = {
    "square": (unit_square(), 0.5),
    "triangle": (right_triangle(), 0.6),
    "rectangle": (rectangle(), 0.3),
    "ell": (ell(), 0.3),
    "star": (star(6, 2), 0.35),
}


@cache
def graph_of(name: str, fingers: int, sets: str) -> rl.SwitchingGraph:
    polygon, friction = POLYGONS[name]
    return rl.build_switching_graph(polygon, friction, rl.Hand(fingers), sets)


def search(
    graph: rl.SwitchingGraph,
    sources: dict[int, int],
    targets: dict[int, int],
    given: dict[int, float] | None = None,
) -> list[int] | None:
    return fewest_placements(
        graph.sets.contacts, graph.sets.margins, graph.switches, graph.hand, sources, targets, given
    )


def cost_of(costs: nx.DiGraph, path: list[int]) -> int:
    return sum(costs[s][t]["cost"] for s, t in pairwise(path))


def least_of(graph: rl.SwitchingGraph, path: list[int]) -> float:
    return float(graph.sets.margins[path].min())


def distances(costs: nx.DiGraph) -> dict[int, dict[int, int]]:
    return dict(nx.all_pairs_dijkstra_path_length(costs, weight="cost"))


@pytest.mark.parametrize(("name", "fingers", "sets"), CASES)
def test_fewest_placements_and_largest_least_margin(name: str, fingers: int, sets: str) -> None:
    """For all pairs; the best margin by cutting the graph at every margin in turn."""
    graph = graph_of(name, fingers, sets)
    costs = directed(graph)
    fewest = distances(costs)
    margins = graph.sets.margins
    best: dict[tuple[int, int], float] = {}
    for level in sorted(set(margins.tolist())):
        kept = costs.subgraph(np.flatnonzero(margins >= level).tolist())
        for s, reached in distances(kept).items():
            for t, length in reached.items():
                if length == fewest[s][t]:
                    best[s, t] = level
    for s in range(len(graph)):
        for t in range(len(graph)):
            path = search(graph, {s: 0}, {t: 0})
            if t not in fewest[s]:
                assert path is None
                continue
            assert path is not None
            assert (path[0], path[-1]) == (s, t)
            assert len(set(path)) == len(path)
            assert cost_of(costs, path) == fewest[s][t]
            assert least_of(graph, path) == best[s, t]


def test_all_shortest_paths_are_no_better() -> None:
    """The tie rule once more, by listing every shortest path."""
    for name, k, sets in (("square", 4, "complete"), ("rectangle", 3, "complete")):
        graph = graph_of(name, k, sets)
        costs = directed(graph)
        for s in range(len(graph)):
            for t in range(len(graph)):
                if s == t or not nx.has_path(costs, s, t):
                    continue
                path = search(graph, {s: 0}, {t: 0})
                assert path is not None
                every = nx.all_shortest_paths(costs, s, t, weight="cost")
                assert least_of(graph, path) == max(least_of(graph, other) for other in every)


@pytest.mark.parametrize(("name", "fingers", "sets"), CASES)
def test_placements_from_some_sets(name: str, fingers: int, sets: str) -> None:
    graph = graph_of(name, fingers, sets)
    costs = directed(graph)
    costs.add_node("start")
    sources = {0: 1, len(graph) - 1: 0}
    for index, cost in sources.items():
        costs.add_edge("start", index, cost=cost)
    expected = nx.single_source_dijkstra_path_length(costs, "start", weight="cost")
    found = placements_from(
        graph.sets.contacts, graph.sets.margins, graph.switches, graph.hand, sources
    )
    assert found.tolist() == [expected.get(i, -1) for i in range(len(graph))]


@pytest.mark.parametrize("fingers", [3, 4, 5])
def test_several_sources_and_targets_with_costs(fingers: int) -> None:
    graph = graph_of("rectangle", fingers, "complete")
    rng = np.random.default_rng(fingers)
    plain = directed(graph)
    for _ in range(60):
        chosen = rng.choice(len(graph), 4, replace=True).tolist()
        sources = {i: int(rng.integers(2)) for i in chosen[:2]}
        targets = {i: int(rng.integers(3)) for i in chosen[2:]}
        costs = plain.copy()
        costs.add_nodes_from(("start", "goal"))
        for index, cost in sources.items():
            costs.add_edge("start", index, cost=cost)
        for index, cost in targets.items():
            costs.add_edge(index, "goal", cost=cost)
        path = search(graph, sources, targets)
        if not nx.has_path(costs, "start", "goal"):
            assert path is None
            continue
        assert path is not None
        total = sources[path[0]] + cost_of(plain, path) + targets[path[-1]]
        assert total == nx.shortest_path_length(costs, "start", "goal", weight="cost")


def test_given_margins_cap_ties() -> None:
    """What the start leaves of the margin makes no path better than another one."""
    graph = graph_of("rectangle", 4, "complete")
    costs, fewest = directed(graph), distances(directed(graph))
    rng = np.random.default_rng(0)
    for _ in range(40):
        s, other, t = rng.choice(len(graph), 3, replace=False).tolist()
        given = {s: 1e-3, other: float(graph.sets.margins[other]) / 2}
        path = search(graph, {s: 0, other: 0}, {t: 0}, given)
        assert path is not None
        assert cost_of(costs, path) == min(fewest[s][t], fewest[other][t])
        if fewest[s][t] == fewest[other][t]:
            assert path[0] == other


def test_nothing_to_search() -> None:
    graph = graph_of("square", 4, "complete")
    assert search(graph, {}, {0: 0}) is None
    assert search(graph, {0: 0}, {}) is None
    assert search(graph, {3: 0}, {3: 2}) == [3]


def test_the_same_path_again() -> None:
    graph = graph_of("square", 4, "complete")
    again = rl.build_switching_graph(*POLYGONS["square"])
    for s in range(len(graph)):
        for t in range(len(graph)):
            assert search(graph, {s: 0}, {t: 0}) == search(again, {s: 0}, {t: 0})
