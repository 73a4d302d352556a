"""Ours against the peer: whole graphs, in alternating pairs of one process."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from statistics import median

import numpy as np

import regrasp_lp as rl
from bench.clocks import alternating
from bench.peer import PeerGraph, interiors_meet, peer_graph
from bench.peer_parallel import extreme_points_by_qhull
from bench.report import Table, met, ms
from bench.settings import MU, THETA

CHAPTER_TARGET, COMPLETE_TARGET = 0.5, 1.5
COMPLETE_UP_TO = 40
"""Edges up to which the complete graph is built too."""


@dataclass(frozen=True)
class Meeting:
    """Seconds of every round on one polygon, for the same kind of graph."""

    name: str
    n_edges: int
    sets: str
    counts: tuple[int, int]  # our sets and switches
    peer_counts: tuple[int, int]
    ours: list[float]
    peer: list[float]
    focus: list[float]  # ours by the chapter's rule, which only its own sets have
    touching_peer: list[float]  # cells that only touch meet too
    qhull_peer: list[float]  # sub-polytopes by scipy's half-space intersection

    @property
    def ratios(self) -> list[float]:
        """Ours by the peer's, round by round."""
        return [a / b for a, b in zip(self.ours, self.peer, strict=True)]

    @property
    def target(self) -> float:
        """The largest median ratio asked for."""
        return CHAPTER_TARGET if self.sets == "chapter" else COMPLETE_TARGET


def meet(polygon: rl.Polygon, repeats: int) -> list[Meeting]:
    """Time our graphs of a polygon and the peer's."""
    kinds = ["chapter"] + ["complete"] * (polygon.n_edges <= COMPLETE_UP_TO)
    peer = peer_graph(polygon, THETA, meets=interiors_meet)
    found = []
    for sets in kinds:
        build = partial(rl.build_switching_graph, polygon, MU, sets=sets, switching="contact")
        graph = build()
        if sets == "chapter":
            require_same_sets(graph, peer)
        calls = (
            build,
            partial(peer_graph, polygon, THETA, meets=interiors_meet),
            partial(rl.build_switching_graph, polygon, MU, sets="chapter", switching="focus"),
            partial(peer_graph, polygon, THETA),
            partial(peer_graph, polygon, THETA, extreme_points_by_qhull, interiors_meet),
        )
        times = alternating(calls, repeats)
        counts = len(graph), graph.n_switches
        theirs_count = peer.n_sets, peer.n_edges
        found.append(Meeting(polygon.name, polygon.n_edges, sets, counts, theirs_count, *times))
    return found


def require_same_sets(graph: rl.SwitchingGraph, peer: PeerGraph) -> None:
    """Raise ValueError unless both have the same vertices: else times mean nothing."""
    theirs = {
        "two_finger": peer.two_finger,
        "concurrent": peer.concurrent,
        "parallel": np.column_stack((peer.parallel, peer.centers)),
    }
    for family in graph.sets.families:
        edges = family.functions.edges
        mine = np.column_stack((edges, family.centers)) if family.kind == "parallel" else edges
        if set(map(tuple, mine.tolist())) != set(map(tuple, theirs[family.kind].tolist())):
            raise ValueError(
                f"{graph.polygon.name}: {len(mine)} {family.kind} sets of ours are not the "
                f"peer's {len(theirs[family.kind])}"
            )


def table(meetings: list[Meeting]) -> Table:
    """One line for each polygon and kind of graph."""
    rows = [
        [
            f"{m.name} {m.sets}",
            str(m.n_edges),
            "{} + {}".format(*m.counts),
            "{} + {}".format(*m.peer_counts),
            ms(median(m.ours)),
            ms(median(m.peer)),
            f"{median(m.ratios):.2f}",
            f"{min(m.ratios):.2f} to {max(m.ratios):.2f}",
            met(median(m.ratios), m.target),
            ms(median(m.focus)),
            ms(median(m.touching_peer)),
            f"{median(m.ours) / median(m.touching_peer):.2f}",
            ms(median(m.qhull_peer)),
        ]
        for m in meetings
    ]
    headings = [
        "polygon, our sets",
        "edges",
        "our sets + switches",
        "the peer's",
        "ours, ms",
        "peer, ms",
        "ratio",
        "all rounds",
        "target",
        "ours by focus, ms",
        "touching, ms",
        "ratio",
        "qhull, ms",
    ]
    notes = [
        "Ours: contact rule, every vertex with margin and witness, every edge with a witness, "
        "all decided exactly.",
        "The peer: the chapter's sets and focus rule, by cells whose interiors meet, in "
        "floating-point geometry (cells that meet within rounding may count), without margins and "
        "witnesses. Ours by focus: the chapter's rule, decided exactly, beside the contact rule.",
        "Touching: the peer by the fastest predicate of GEOS, for which cells that only touch "
        "meet: its graph has too many switches. Qhull: the peer with sub-polytopes by scipy's "
        "half-space intersection, to the letter of the chapter.",
    ]
    return Table("Against the chapter's method on GEOS (θ = 10°)", headings, rows, notes)
