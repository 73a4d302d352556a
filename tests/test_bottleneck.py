"""What a search at a level rests on: what a given grasp sees, and the path LP of a route."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from conftest import covering
from geometry import ell, rectangle, unit_square, you
from regrasps import random_grasps
from routes import Functions, Oracle, all_sets, widest_problem
from scipy.optimize import linprog

import regrasp_lp as rl
from regrasp_lp.planning.along import least_margin_along, least_tolerance_along
from regrasp_lp.planning.ends import supports
from regrasp_lp.planning.levels import PieceRows
from regrasp_lp.planning.moves import KnownMoves
from regrasp_lp.planning.path_lp import PathProblem, Stage, build_path_problem
from regrasp_lp.planning.path_optimum import largest_tolerance, solve_path_problem
from regrasp_lp.switches import StoredSwitches
from regrasp_lp.torque import TorqueFunctions

MEASURES = ("margin", "tolerance")


def triangle() -> rl.Polygon:
    return rl.Polygon([(0, 0), (4, 0), (1, 3)], name="triangle")


SUBJECTS = {
    "triangle": (triangle, 0.6),
    "rectangle": (rectangle, 0.3),
    "ell": (ell, 0.15),
    "square": (unit_square, 0.6),
    "you": (you, 0.3),
}


# --- what is seen -------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "measure"), covering(SUBJECTS, MEASURES))
def test_a_point_is_seen_iff_the_slide_there_stays_at_the_level(name: str, measure: str) -> None:
    make, friction = SUBJECTS[name]
    polygon = make()
    graph = rl.build_switching_graph(polygon, friction)
    rows = PieceRows(graph.sets.sources, measure)
    along = least_margin_along if measure == "margin" else least_tolerance_along
    rng = np.random.default_rng(4)
    seen_points = hidden_points = 0
    grasps = random_grasps(polygon, friction, rng, 6, 3, at_vertices=0.3)
    for grasp in grasps + random_grasps(polygon, friction, rng, 3, 2, at_vertices=0.3):
        for support in supports(rows, graph.sets, polygon.resolve(grasp), 4):
            functions = graph.sets.functions(support.index)
            m = functions.m
            margins = functions.margins if measure == "margin" else functions.tolerances
            assert support.level == pytest.approx(margins(support.fractions)[0], abs=1e-9)
            cells = support.visible
            ends = rng.random((60, m))
            near = np.clip(support.fractions + 0.1 * rng.standard_normal((60, m)), 0, 1)
            for end in np.concatenate((ends, near, support.fractions[None])):
                least = along(functions, support.fractions, end)
                slack = (cells.bounds - cells.rows @ end).min(axis=1)
                inside = ((end >= cells.lower - 1e-12) & (end <= cells.upper + 1e-12)).all(axis=1)
                seen = bool((inside & (slack >= -1e-9)).any())
                clearly = bool((inside & (slack >= 1e-9)).any())
                assert not clearly or least >= support.level - 1e-8
                assert seen or least < support.level + 1e-8
                seen_points += clearly
                hidden_points += not seen
    assert seen_points > 50
    assert hidden_points > 50


@pytest.mark.parametrize("name", ["triangle", "ell", "you"])
def test_the_least_along_a_slide_is_that_of_dense_sampling(name: str) -> None:
    make, friction = SUBJECTS[name]
    graph = rl.build_switching_graph(make(), friction)
    rng = np.random.default_rng(6)
    times = np.linspace(0, 1, 201)[:, None]
    for index in rng.integers(len(graph), size=6).tolist():
        functions = graph.sets.functions(index)
        f, g = rng.random((2, functions.m))
        many = functions.take(np.zeros(len(times), dtype=int))
        points = f + times * (g - f)
        step = float(functions.lengths.sum()) / (len(times) - 1)
        for exact, sampled in (
            (least_margin_along(functions, f, g), many.margins(points).min()),
            (least_tolerance_along(functions, f, g), many.tolerances(points).min()),
        ):
            assert sampled - step <= exact <= sampled + 1e-12


@pytest.mark.parametrize("name", ["rectangle", "ell", "you"])
def test_landings_are_the_best_of_all_pieces_that_are_seen(name: str) -> None:
    """Against programs of scipy over the oracle's own functions, best first."""
    make, friction = SUBJECTS[name]
    polygon = make()
    graph = rl.build_switching_graph(polygon, friction)
    rows = PieceRows(graph.sets.sources, "margin")
    oracle = Oracle(all_sets(polygon, friction), 4, "margin")
    rng = np.random.default_rng(7)
    landed = 0
    for grasp in random_grasps(polygon, friction, rng, 3, 3):
        resolved = polygon.resolve(grasp)
        given = {tuple(oracle.sets[i].edges): (i, u) for i, u, _ in oracle.supports(resolved)}
        for support in supports(rows, graph.sets, resolved, 4):
            index, u = given[graph.sets[support.index].edges]
            f = oracle.sets[index]
            level = f.level(u, "margin")
            expected = max(oracle.landing(f, u, level, p) for p in oracle.pieces[index])
            assert max(expected, level) == pytest.approx(support.widest, rel=1e-6)
            landed += expected > level
    assert landed


@pytest.mark.parametrize("measure", MEASURES)
def test_no_way_away_from_a_grasp_is_wider_than_its_cap(measure: str) -> None:
    """The cap looks at the best sets first and stops: it is the largest of all."""
    polygon = you()
    graph = rl.build_switching_graph(polygon, 0.3)
    assert isinstance(graph.switches, StoredSwitches)
    rows = PieceRows(graph.sets.sources, measure)
    moves = KnownMoves(rows, graph.switches, graph.hand)
    rng = np.random.default_rng(8)
    wider = 0
    for contacts in (2, 3):
        for grasp in random_grasps(polygon, 0.3, rng, 5, contacts, at_vertices=0.2):
            for support in supports(rows, graph.sets, polygon.resolve(grasp), 4):
                onward = [support.onward(choices).max() for choices in moves.of(support.index)]
                assert support.cap(moves) == max(support.widest, *onward)
                wider += max(onward) > support.widest
    assert wider


# --- the path LP of a route ---------------------------------------------------------------------


def random_route(
    oracle: Oracle, rng: np.random.Generator, length: int
) -> list[tuple[tuple[int, int, int], tuple[tuple[int, int], ...] | None]]:
    """Pieces one after the other, each by an overlap (None) or by a switch with held contacts."""
    every = [p for of_set in oracle.pieces for p in of_set]
    piece = every[rng.integers(len(every))]
    route: list[tuple[tuple[int, int, int], tuple[tuple[int, int], ...] | None]] = [(piece, None)]
    while len(route) < length:
        other = every[rng.integers(len(every))]
        slots = None
        if other[0] != piece[0]:
            held = oracle.need(piece[0], other[0])
            ways = list(oracle.choices(piece[0], other[0], held))
            if not ways:
                continue
            slots = ways[rng.integers(len(ways))]
        width = oracle.overlap(piece, other) if slots is None else oracle.join(piece, other, slots)
        if width > 0:
            route.append((other, slots))
            piece = other
    return route


@pytest.mark.parametrize(("name", "measure"), covering(["rectangle", "ell", "you"], MEASURES))
def test_a_path_is_as_wide_as_its_narrowest_overlap(name: str, measure: str) -> None:
    """Convexity of the pieces attains it: the optimum of the whole path LP is the least width."""
    make, friction = SUBJECTS[name]
    polygon = make()
    graph = rl.build_switching_graph(polygon, friction)
    sets = {graph.sets[i].edges: graph.sets.functions(i) for i in range(len(graph))}
    oracle = Oracle(all_sets(polygon, friction), 4, measure)
    rng = np.random.default_rng(8)
    for _ in range(4):
        route = random_route(oracle, rng, int(rng.integers(2, 6)))
        widths = [oracle.width(piece) for piece, _ in route]
        stages: list[list[tuple[int, int, int]]] = [[route[0][0]]]
        held = []
        for (before, _), (piece, slots) in pairwise(route):
            if slots is None:
                stages[-1].append(piece)
                widths.append(oracle.overlap(before, piece))
            else:
                stages.append([piece])
                held.append(slots)
                widths.append(oracle.join(before, piece, slots))
        functions = [sets[oracle.sets[stage[0][0]].edges] for stage in stages]
        columns = [
            matching(oracle.sets[s[0][0]], f) for s, f in zip(stages, functions, strict=True)
        ]
        problem = build_path_problem(
            [
                Stage(f, np.array([(0, c[j], c[k]) for _, j, k in s]))
                for s, f, c in zip(stages, functions, columns, strict=True)
            ],
            held,
            None,
            None,
            measure,
            apart=1e-6,
        )
        best = problem.tolerance(largest_tolerance(problem, "clarabel")) * graph.sets.cones.size
        assert best == pytest.approx(min(widths), rel=2e-6)
        assert best == pytest.approx(by_linprog(problem) * graph.sets.cones.size, rel=1e-6)


def matching(mine: Functions, theirs: TorqueFunctions) -> dict[int, int]:
    """Which of the package's functions each of the oracle's is: by their numbers."""
    table = np.column_stack((mine.offsets, mine.slopes * mine.lengths))
    other = np.column_stack((theirs.offsets[0], theirs.slopes[0]))
    far = np.abs(table[:, None] - other[None]).sum(axis=2) + 1e9 * ~theirs.valid[0]
    assert (far.min(axis=1) < 1e-9).all()
    assert len(table) == theirs.valid.sum()
    return dict(enumerate(far.argmin(axis=1).tolist()))


def by_linprog(problem: PathProblem) -> float:
    """The largest least tolerance of a path, by scipy."""
    matrix = np.column_stack((problem.rows.toarray(), problem.scales))
    cost = np.append(np.zeros(problem.n_variables), -1.0)
    box = [(0.0, 1.0)] * problem.n_variables + [(None, None)]
    found = linprog(cost, matrix, problem.bounds, bounds=box)
    assert found.status == 0
    return float(-found.fun)


# --- leximin ------------------------------------------------------------------------------------


def leximin_by_linprog(problem: PathProblem) -> np.ndarray:
    """Sorted tolerances per grasp, each in turn as large as it can be.

    In every round a grasp is fixed iff its own largest tolerance, while no other falls below the
    round's level, is that level: one program for each grasp, no multipliers.
    """
    rows, scales = problem.rows.toarray(), problem.scales
    owners = problem.owners
    n = problem.n_variables
    fixed: dict[int, float] = {}
    left = sorted(set(owners[scales > 0].tolist()))
    box = [(0.0, 1.0)] * n + [(None, None)]
    cost = np.append(np.zeros(n), -1.0)

    def largest(raised: list[int], floor: dict[int, float]) -> float:
        """Raise the least of some grasps; others keep at least what the floor says."""
        column = np.where(np.isin(owners, raised), scales, 0.0)
        keep = np.array([floor.get(owner, 0.0) for owner in owners.tolist()]) * scales
        bounds = problem.bounds - np.where(column > 0, 0.0, keep)
        found = linprog(cost, np.column_stack((rows, column)), bounds, bounds=box)
        assert found.status == 0, found.message
        return float(-found.fun)

    while left:
        level = largest(left, {g: v - 1e-9 for g, v in fixed.items()})
        floor = {g: v - 1e-9 for g, v in {**fixed, **dict.fromkeys(left, level)}.items()}
        stuck = [g for g in left if largest([g], floor) <= level + 1e-7]
        assert stuck
        fixed |= dict.fromkeys(stuck, level)
        left = [g for g in left if g not in stuck]
    return np.sort(list(fixed.values()))


def tolerances(problem: PathProblem, grasps: list[np.ndarray]) -> np.ndarray:
    """What the rows leave to each grasp, sorted."""
    x = np.zeros(problem.n_variables)
    for ids, fractions in zip(problem.variables, grasps, strict=True):
        x[ids[ids >= 0]] = fractions[ids >= 0]
    slack = problem.bounds - problem.rows @ x
    free = problem.scales > 0
    owners = problem.owners[free]
    left = slack[free] / problem.scales[free]
    return np.sort([left[owners == owner].min() for owner in np.unique(owners)])


@pytest.mark.parametrize(("name", "measure"), covering(["triangle", "ell", "you"], MEASURES))
def test_leximin_raises_every_grasp_as_far_as_it_goes(name: str, measure: str) -> None:
    make, friction = SUBJECTS[name]
    polygon = make()
    graph = rl.build_switching_graph(polygon, friction, rl.Hand(3 if name == "ell" else 4))
    rng = np.random.default_rng(9)
    grasps = [polygon.resolve(g) for g in random_grasps(polygon, friction, rng, 5, 3)]
    longest = compared = 0
    for start, goal in product(grasps[:2], grasps[2:]):
        search = widest_problem(graph, start, goal, measure)
        found = search.solve()
        if found.route is None or not np.isfinite(found.level):
            continue
        problem = search.path_problem(found.route)
        if not (problem.scales > 0).any():
            continue
        chosen = tolerances(problem, solve_path_problem(problem, "clarabel", leximin=True))
        expected = leximin_by_linprog(problem)
        # Where only two fingers must not meet there is no need for more than the object's size.
        chosen, expected = np.minimum(chosen, 1), np.minimum(expected, 1)
        assert chosen == pytest.approx(expected, abs=3e-6)
        plain = tolerances(problem, solve_path_problem(problem, "clarabel"))
        assert tuple(chosen + 3e-6) >= tuple(plain)
        compared += 1
        longest = max(longest, len(chosen))
    assert compared
    assert longest >= 2
