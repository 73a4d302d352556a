"""Plans between random grasps: how long a query takes, and how often the best plan is proved."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps

import numpy as np

import regrasp_lp as rl
from bench.clocks import now
from bench.planning import FRICTION
from bench.report import Table, met
from bench.settings import MU
from bench.subjects import random_grasps
from regrasp_lp.errors import NoPlanFound
from regrasp_lp.planning.bottleneck import Search
from regrasp_lp.planning.objective import Objective

OBJECTIVES = ("placements", "margin", "tolerance", "travel")
TARGETS = {"placements": 0.050, "margin": 0.250}
"""Seconds, of medians on a graph that is built."""

DIRECT_TARGET = 3.0
SHARE_TARGET = 0.99
SIZES = (15, 25, 40, 64)
"""Outlines of the corpus stand together up to so many edges."""

_EQUAL = 1e-6

Pair = tuple[rl.Grasp, rl.Grasp]


@dataclass(frozen=True)
class Query:
    """One answer; `fewest` is the value of the plan with the fewest placements, if asked for.

    Value, bound and gap are those of the objective. The bound is infinite if nothing is chosen on
    the way from start to goal. `levels` counts the levels that were searched for the margin.
    """

    n_edges: int
    seconds: float
    value: float
    bound: float
    gap: float
    levels: int = 0
    fewest: float = -np.inf

    @property
    def worse(self) -> bool:
        """Whether the plan with the fewest placements has a larger margin."""
        return self.value < self.fewest - _EQUAL * abs(self.fewest)

    @property
    def short(self) -> float:
        """The gap as a part of the value or the bound, whichever is larger."""
        if not np.isfinite(self.gap):
            return 1.0
        return self.gap / max(abs(self.value), abs(self.bound)) if self.gap else 0.0


def pairs_of(polygon: rl.Polygon, friction: float, count: int) -> list[Pair]:
    """So many random starts and goals, the same in every run; none if grasps are hard to find."""
    rng = np.random.default_rng(polygon.n_edges)
    try:
        grasps = random_grasps(polygon, friction, 2 * count, rng)
    except ValueError:
        return []
    return list(zip(grasps[::2], grasps[1::2], strict=False))


@contextmanager
def counted_levels() -> Iterator[list[float]]:
    """Note the level of each search for a route, while inside."""
    levels: list[float] = []
    plain = Search.run

    @wraps(plain)
    def run(self: Search) -> object:
        levels.append(self.cut.level)
        return plain(self)

    Search.run = run  # type: ignore[assignment, method-assign]
    try:
        yield levels
    finally:
        Search.run = plain  # type: ignore[method-assign]


def ask(plan: Callable[[], rl.Plan], n_edges: int, objective: str) -> Query | None:
    """Time a query; None if no path joins the two grasps."""
    with counted_levels() as levels:
        started = now()
        try:
            found = plan()
        except NoPlanFound:
            return None
        seconds = now() - started
    value = Objective.of(objective).value(found)
    bound = np.inf if found.bound is None else found.bound
    gap = np.inf if found.gap is None else found.gap
    return Query(n_edges, seconds, value, bound, gap, len(levels))


def on_graph(graph: rl.SwitchingGraph, pairs: Sequence[Pair], objective: str) -> list[Query]:
    """Plan between all pairs in a graph; for margins compare with the fewest placements, too."""
    n_edges, found = graph.polygon.n_edges, []
    for start, goal in pairs:
        query = ask(lambda: graph.plan(start, goal, objective=objective), n_edges, objective)  # noqa: B023
        if query is None:
            continue
        if objective == "margin":
            fewest = graph.plan(start, goal).chosen_margin
            query = Query(**{**vars(query), "fewest": fewest})
        found.append(query)
    return found


def built_table(polygons: Sequence[rl.Polygon], count: int) -> Table:
    """Queries on graphs that are built: a line for each graph and objective."""
    rows, slowest = [], dict.fromkeys(TARGETS, 0.0)
    for polygon in polygons:
        graph = rl.build_switching_graph(polygon, MU)
        pairs = pairs_of(polygon, MU, count)
        on_graph(graph, pairs[:1], "margin")  # what is made at the first query
        for objective in OBJECTIVES:
            found = on_graph(graph, pairs, objective)
            rows.append([f"{polygon.name}, {len(graph.sets)} sets", objective, *_cells(found)])
            if objective in slowest:
                middle = _seconds(found)[0]
                slowest[objective] = max(slowest[objective], middle)
    headings = ["graph", "objective", *_HEADINGS]
    notes = [
        "θ = 10°, complete sets, four fingers; random pairs of grasps in force closure. Levels: "
        "how many were searched for the margin, in all and at most in a query.",
        "Nothing chosen: one slide or one switch leads from start to goal, none is better.",
        *(
            f"Median for {name}, the slower graph: {1000 * slowest[name]:.0f} ms, "
            f"{met(1000 * slowest[name], 1000 * target)}."
            for name, target in TARGETS.items()
        ),
    ]
    return Table("Queries on a built graph", headings, rows, notes)


def direct_table(polygons: Sequence[rl.Polygon], count: int) -> Table:
    """The largest margin on large outlines without the graph: a line for each outline."""
    rows, every = [], []
    for polygon in polygons:
        found = []
        for start, goal in pairs_of(polygon, FRICTION, count):

            def plan() -> rl.Plan:
                return rl.plan_regrasp(polygon, start, goal, FRICTION, objective="margin")  # noqa: B023

            query = ask(plan, polygon.n_edges, "margin")
            if query is not None:
                found.append(query)
        if found:
            rows.append([polygon.name, str(polygon.n_edges), *_cells(found)])
            every += found
    most = max((q.seconds for q in every), default=0.0)
    notes = [f"μ = {FRICTION:g}, `plan_regrasp`. Most seconds {met(most, DIRECT_TARGET)}."]
    if every:
        rows.append(["all", "", *_cells(every)])
    headings = ["outline", "edges", *_HEADINGS]
    return Table("The largest margin without the graph", headings, rows, notes)


def corpus_table(polygons: Sequence[rl.Polygon], count: int) -> Table:
    """How often the largest margin is proved on small outlines, in groups of like size."""
    found: list[Query] = []
    for polygon in polygons:
        pairs = pairs_of(polygon, FRICTION, count)
        if pairs:
            found += on_graph(rl.build_switching_graph(polygon, FRICTION), pairs, "margin")
    rows, least = [], 0
    for most in SIZES:
        group = [query for query in found if least < query.n_edges <= most]
        if group:
            rows.append([f"{least + 1} to {most}", _worse(group), *_cells(group)])
        least = most
    if found:
        rows.append(["all", _worse(found), *_cells(found)])
    share = float(np.mean([query.gap == 0 for query in found])) if found else 0.0
    said = "met" if share >= SHARE_TARGET else "missed"
    notes = [
        f"μ = {FRICTION:g}, complete sets; {len(polygons)} outlines of up to {SIZES[-1]} edges, "
        f"those of the corpus if there is one. Gap 0 in {100 * share:.1f} % of the queries: "
        f"{said} (>= {100 * SHARE_TARGET:g} %).",
        "Worse: queries for which the plan with the fewest placements has the larger margin.",
    ]
    headings = ["edges", "worse", *_HEADINGS]
    return Table("The largest margin on the corpus", headings, rows, notes)


_HEADINGS = (
    "queries",
    "nothing chosen",
    "median ms",
    "90 % ms",
    "most ms",
    "gap 0",
    "largest gap",
    "levels",
)


def _cells(found: Sequence[Query]) -> list[str]:
    """What `_HEADINGS` says."""
    levels = [query.levels for query in found]
    return [
        str(len(found)),
        str(sum(bool(np.isinf(query.value)) for query in found)),
        *(f"{1000 * seconds:.0f}" for seconds in _seconds(found)),
        f"{100 * float(np.mean([query.gap == 0 for query in found])):.1f} %",
        f"{100 * max(query.short for query in found):.2g} %",
        f"{sum(levels)}, {max(levels)}",
    ]


def _seconds(found: Sequence[Query]) -> list[float]:
    """The median, that which nine of ten stay below, and the most."""
    return np.percentile([query.seconds for query in found], [50, 90, 100]).tolist()


def _worse(found: Sequence[Query]) -> str:
    return str(sum(query.worse for query in found))
