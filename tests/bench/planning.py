"""Plans without building the graph: large outlines, and small ones against the whole graph."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np

import regrasp_lp as rl
from bench.clocks import alternating, in_own_process
from bench.report import Table, met
from bench.settings import Pairs
from bench.subjects import random_grasps
from regrasp_lp.errors import NoPlanFound

FRICTION = 0.3
SECONDS_TARGET, MEMORY_TARGET = 1.0, 300.0
RATIO_TARGET = 1.0
TIMEOUT = 600.0


@dataclass(frozen=True)
class Planned:
    """One plan in a process of its own; `outcome` is "plan", or what came instead."""

    name: str
    n_edges: int
    start: Pairs
    goal: Pairs
    outcome: str
    seconds: float
    peak: float  # MiB
    placements: int


def measure_large(polygons: list[rl.Polygon], pairs: int) -> list[Planned]:
    """Plan between random grasps of large outlines, a fresh process for each plan."""
    found = []
    for polygon in polygons:
        rng = np.random.default_rng(polygon.n_edges)
        grasps = random_grasps(polygon, FRICTION, 2 * pairs, rng)
        for start, goal in zip(grasps[::2], grasps[1::2], strict=False):
            ends = _fractions(start), _fractions(goal)
            try:
                result = in_own_process(
                    "plan", TIMEOUT, **_rings(polygon), ends=ends, friction=FRICTION
                )
            except subprocess.TimeoutExpired:
                result = {"outcome": "timeout", "seconds": TIMEOUT, "peak": np.nan, "placements": 0}
            found.append(Planned(polygon.name, polygon.n_edges, *ends, **result))
    return found


def _fractions(grasp: rl.Grasp) -> Pairs:
    return list(zip(grasp.edges.tolist(), grasp.fractions.tolist(), strict=True))


def _rings(polygon: rl.Polygon) -> dict[str, Any]:
    """The rings of a polygon as JSON has them."""
    return {"exterior": polygon.exterior.tolist(), "holes": [h.tolist() for h in polygon.holes]}


def large_table(planned: list[Planned]) -> Table:
    """One line for each outline, the misses in full below."""
    rows = []
    for name in dict.fromkeys(p.name for p in planned):
        mine = [p for p in planned if p.name == name]
        good = [p for p in mine if p.outcome == "plan"]
        seconds = [p.seconds for p in good] or [np.nan]
        peaks = [p.peak for p in good] or [np.nan]
        rows.append(
            [
                name,
                str(mine[0].n_edges),
                f"{len(good)} of {len(mine)}",
                f"{median(seconds):.2f}",
                f"{max(seconds):.2f}",
                f"{max(peaks):.0f}",
                str(sum(p.seconds > SECONDS_TARGET for p in good)),
            ]
        )
    headings = ["outline", "edges", "plans", "median s", "most s", "most MiB", "above 1 s"]
    good = [p for p in planned if p.outcome == "plan"]
    notes = [
        f"μ = {FRICTION:g}, random pairs of force-closure grasps, a fresh process for each plan, "
        "imports and a tiny plan not counted.",
        f"Most seconds {met(max((p.seconds for p in good), default=0.0), SECONDS_TARGET)}, "
        f"most MiB {met(max((p.peak for p in good), default=0.0), MEMORY_TARGET)}.",
    ]
    for p in planned:
        if p.outcome != "plan" or p.seconds > SECONDS_TARGET or p.peak > MEMORY_TARGET:
            ends = " to ".join(
                ", ".join(f"{e}:{f:.6f}" for e, f in end) for end in (p.start, p.goal)
            )
            notes.append(f"{p.name}, {ends}: {p.outcome}, {p.seconds:.2f} s, {p.peak:.0f} MiB")
    return Table("Planning without the graph", headings, rows, notes)


def measure_small(polygons: list[rl.Polygon], pairs: int, repeats: int) -> Table:
    """`plan_regrasp` against building the whole graph and planning in it, in alternating pairs."""
    rows, worst = [], 0.0
    for polygon in polygons:
        rng = np.random.default_rng(polygon.n_edges)
        grasps = random_grasps(polygon, FRICTION, 2 * pairs, rng)
        ratios, direct, whole = [], [], []
        for start, goal in zip(grasps[::2], grasps[1::2], strict=False):

            def without() -> object:
                return rl.plan_regrasp(polygon, start, goal, FRICTION)  # noqa: B023

            def through() -> object:
                return rl.build_switching_graph(polygon, FRICTION).plan(start, goal)  # noqa: B023

            try:
                through()
            except NoPlanFound:
                continue
            times = alternating((without, through), repeats)
            ratios.append(median(a / b for a, b in zip(*times, strict=True)))
            direct.append(median(times[0]))
            whole.append(median(times[1]))
        if ratios:
            worst = max(worst, *ratios)
            rows.append(
                [
                    polygon.name,
                    str(polygon.n_edges),
                    str(len(ratios)),
                    f"{1000 * median(direct):.0f}",
                    f"{1000 * median(whole):.0f}",
                    f"{median(ratios):.2f}",
                    f"{max(ratios):.2f}",
                ]
            )
    headings = ["object", "edges", "plans", "direct, ms", "graph, ms", "ratio", "worst"]
    notes = [f"Worst of all {worst:.2f}: {met(worst, RATIO_TARGET)}. Medians of rounds per plan."]
    return Table("Planning directly against building the graph first", headings, rows, notes)
