"""What is measured in processes of its own, by name; little is imported here."""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from typing import Any

import regrasp_lp as rl
from bench.clocks import Memory, now
from bench.settings import MU, THETA, Pairs
from regrasp_lp.errors import NoPlanFound

REPEAT_BELOW = 5.0
"""Seconds: what takes longer is timed once."""


def growth(vertices: list[list[float]], sets: str, repeats: int) -> dict[str, Any]:
    """Peak memory of a first graph, then the time of as many, in this process."""
    polygon = rl.Polygon(vertices)
    tiny = rl.Polygon([(0, 0), (3, 0), (3, 2), (0, 2)])
    rl.build_switching_graph(tiny, MU, sets=sets)
    memory = Memory()
    started = now()
    graph = rl.build_switching_graph(polygon, MU, sets=sets)
    seconds = [now() - started]
    peak = memory.peak()
    result = {
        "n_sets": len(graph),
        "n_switches": graph.n_switches,
        "stored": type(graph.switches).__name__ == "StoredSwitches",
    }
    del graph
    while len(seconds) < repeats and seconds[0] < REPEAT_BELOW:
        started = now()
        rl.build_switching_graph(polygon, MU, sets=sets)
        seconds.append(now() - started)
    peer = _peer_seconds(polygon, repeats) if sets == "chapter" else None
    return {**result, "seconds": median(seconds), "peak": peak, "peer_seconds": peer}


def _peer_seconds(polygon: rl.Polygon, repeats: int) -> float:
    from bench.peer import interiors_meet, peer_graph

    peer_graph(polygon, THETA, meets=interiors_meet)
    seconds = []
    for _ in range(repeats):
        started = now()
        peer_graph(polygon, THETA, meets=interiors_meet)
        seconds.append(now() - started)
    return median(seconds)


def plan(exterior: Any, holes: Any, ends: list[Pairs], friction: float) -> dict[str, Any]:
    """Plan once between two grasps, after a tiny plan that imports what is needed."""
    polygon = rl.Polygon(exterior, holes)
    start, goal = (rl.Grasp.at_fractions([tuple(c) for c in end]) for end in ends)
    tiny = rl.Polygon([(0, 0), (3, 0), (3, 2), (0, 2)])
    rl.plan_regrasp(tiny, [(0, 1.5), (2, 1.5)], [(1, 1.0), (3, 1.0)], friction=0.5)
    memory = Memory()
    started = now()
    outcome, placements = "plan", 0
    try:
        placements = rl.plan_regrasp(polygon, start, goal, friction=friction).placements
    except NoPlanFound:
        outcome = "no plan exists"
    except rl.RegraspError as error:
        outcome = type(error).__name__
    seconds = now() - started
    return {
        "outcome": outcome,
        "seconds": seconds,
        "peak": memory.peak(),
        "placements": placements,
    }


JOBS: dict[str, Callable[..., dict[str, Any]]] = {"growth": growth, "plan": plan}
