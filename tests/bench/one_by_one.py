"""The same decisions with one LP a time: scipy's `linprog`, and a cvxpy problem each.

A check is the margin LP of one piece: of the best piece of a candidate (does this set exist?), or
of the best pieces of two sets joined on the contacts they could hold (can the hand switch?). Which
piece to ask for is given for free, and building the arrays is not counted.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from statistics import median

import numpy as np
from scipy.optimize import linprog

import regrasp_lp as rl
from bench.clocks import seconds_of
from bench.peer import sharing_one, sharing_two
from bench.report import Table
from bench.settings import MU
from bench.where import parts_of
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.pieces import piece_sets
from regrasp_lp.grasp_sets.vertices import candidate_functions
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.margins import best_pieces

Solve = Callable[[LinearSets], float]
ACCURACY = 1e-6
"""Of the object's diameter: margins of the solvers and ours may differ by so much."""


def by_linprog(one: LinearSets) -> float:
    """The largest margin of one set, by `scipy.optimize.linprog`."""
    n = len(one.names)
    result = linprog(
        np.append(np.zeros(n), -1.0),
        A_ub=np.column_stack((one.rows[0], one.scales[0])),
        b_ub=one.bounds[0],
        bounds=[*zip(one.lower[0], one.upper[0], strict=True), (None, None)],
    )
    if not result.success:
        raise RuntimeError(f"linprog: {result.message}")
    return float(-result.fun)


def by_cvxpy(one: LinearSets) -> float:
    """The same, by a cvxpy problem of its own."""
    import cvxpy as cp

    x, margin = cp.Variable(len(one.names)), cp.Variable()
    rows = one.rows[0] @ x + one.scales[0] * margin <= one.bounds[0]
    box = [one.lower[0] <= x, x <= one.upper[0]]
    problem = cp.Problem(cp.Maximize(margin), [rows, *box])
    return float(problem.solve(solver=cp.CLARABEL))


SOLVERS: dict[str, Solve] = {"scipy linprog": by_linprog, "cvxpy": by_cvxpy}


def sampled_sets(
    polygon: rl.Polygon, graph: rl.SwitchingGraph, count: int, rng: np.random.Generator
) -> tuple[list[LinearSets], list[float]]:
    """LPs of random candidates of all kinds, and the margins that the graph has for them.

    A candidate that is no set of the graph has none: its margin is 0 at most, said as NaN.
    """
    cones = Cones.of(polygon, MU)
    checks, known = [], []
    for family in graph.sets.families:
        functions, centers = candidate_functions(cones, family.kind)
        margins = {
            (*edges, center): margin
            for edges, center, margin in zip(
                family.functions.edges.tolist(),
                family.centers.tolist(),
                family.margins,
                strict=True,
            )
        }
        share = min(len(functions), -(-count * family.n_candidates // n_candidates(graph)))
        for i in rng.choice(len(functions), size=share, replace=False).tolist():
            one = functions.take(np.array([i]))
            if not one.spans[0]:
                continue
            piece = np.column_stack(([0], best_pieces(one)[1]))
            checks.append(piece_sets(one, piece, [f"u{e}" for e in one.edges[0]]))
            key = (*one.edges[0].tolist(), int(centers[i]))
            known.append(float(margins.get(key, np.nan)))
    return checks, known


def n_candidates(graph: rl.SwitchingGraph) -> int:
    """Number of candidates of all kinds."""
    return sum(family.n_candidates for family in graph.sets.families)


def pairs_to_decide(graph: rl.SwitchingGraph) -> np.ndarray:
    """All pairs of sets with as many common edges as four fingers have to hold, as rows."""
    n = graph.polygon.n_edges
    edges = [family.functions.edges for family in graph.sets.families]
    offsets = np.cumsum([0, *map(len, edges)])
    found = []
    for k in range(1, len(edges)):
        found.append(sharing_two(edges[k], n) + offsets[k])
        found.append(sharing_one(edges[0], edges[k], n) + np.array([0, offsets[k]]))
    return np.concatenate(found)


def sampled_switches(
    graph: rl.SwitchingGraph, count: int, rng: np.random.Generator
) -> tuple[list[LinearSets], list[bool]]:
    """LPs of random pairs of sets with common edges, and whether the graph joins them."""
    pairs = pairs_to_decide(graph)
    checks, known = [], []
    for i, j in pairs[rng.choice(len(pairs), size=min(count, len(pairs)), replace=False)].tolist():
        one, other = (_best_piece(graph, k) for k in (i, j))
        checks.append(one.join(other, on=[name for name in one.names if name in other.names]))
        known.append(j in graph.neighbors(i))
    return checks, known


def _best_piece(graph: rl.SwitchingGraph, index: int) -> LinearSets:
    family, row = graph.sets.place(index)
    one = graph.sets.sources[family].take(np.array([row]))
    piece = np.column_stack(([0], best_pieces(one)[1]))
    return piece_sets(one, piece, [f"u{e}" for e in one.edges[0]])


def measure(polygon: rl.Polygon, count: int, repeats: int) -> Table:
    """Time `count` checks of each sort with either solver, and ours, per check.

    Raises
    ------
    ValueError
        If a solver contradicts the graph.
    """
    rng = np.random.default_rng(0)
    graph = rl.build_switching_graph(polygon, MU, sets="chapter")
    sets, margins = sampled_sets(polygon, graph, count, rng)
    switches, joined = sampled_switches(graph, count, rng)
    slack = ACCURACY * polygon.diameter
    seconds = {}
    for name, solve in SOLVERS.items():
        solve(sets[0])  # what is imported late is not to be counted
        for what, checks in (("sets", sets), ("switches", switches)):
            found: list[float] = []
            seconds[name, what] = seconds_of(lambda: found.extend(map(solve, checks)))  # noqa: B023
            for value, expected in zip(found, margins if what == "sets" else joined, strict=True):
                if what == "switches":
                    wrong = value > slack and not expected
                else:
                    wrong = value > slack if np.isnan(expected) else abs(value - expected) > slack
                if wrong:
                    raise ValueError(f"{name} finds {value:g} where the graph has {expected}")
    # What builds the sets is one function; all the rest is for the switches.
    entries = {"grasp_sets.vertices:build_family": "sets"}
    build = partial(rl.build_switching_graph, polygon, MU, sets="chapter")
    runs = [parts_of(build, entries, ("sets", "switches"))[0] for _ in range(repeats)]
    total = {"sets": n_candidates(graph), "switches": len(pairs_to_decide(graph))}
    rows = []
    for what, checks in (("sets", sets), ("switches", switches)):
        ours = median(run[what] for run in runs) / total[what]
        rows.append(
            [
                what,
                str(len(checks)),
                *(f"{1000 * seconds[name, what] / len(checks):.3f}" for name in SOLVERS),
                str(total[what]),
                f"{1000 * ours:.4f}",
                *(f"{seconds[name, what] / len(checks) / ours:.0f}" for name in SOLVERS),
            ]
        )
    headings = ["decisions", "sample", *(f"{name}, ms" for name in SOLVERS)]
    headings += ["all of them", "ours, ms", *(f"{name} / ours" for name in SOLVERS)]
    notes = [
        "Milliseconds per check. One LP each, of the best piece (or of the two best, joined), "
        "which is given; ours is the time of the whole graph over all its decisions, with "
        "margins, witnesses and storing."
    ]
    title = f"One LP at a time, on samples ({polygon.name}, chapter's sets)"
    return Table(title, headings, rows, notes)
