"""Margins to nine digits, comparisons of margins, and the programs in rational numbers."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, permutations

import numpy as np
import pytest
from geometry import comb, lattice_star, star
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

import regrasp_lp as rl
from regrasp_lp.contact_rule import joined_optima, meet_by_lp, meet_held
from regrasp_lp.exact_margins import (
    certain_margins,
    exceeds,
    largest_margin,
    piece_rows,
    scaled_functions,
)
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.vertices import candidate_functions
from regrasp_lp.lp import get_solver
from regrasp_lp.lp.exact_solver import exact_optimum
from regrasp_lp.margins import best_pieces, best_points
from regrasp_lp.shadows import shadows
from regrasp_lp.torque import TorqueFunctions

SOLVER = get_solver("clarabel")


def existing(cones: Cones, kind: str) -> TorqueFunctions:
    functions, _ = candidate_functions(cones, kind)
    return functions.take(functions.exists())


def sliver(overlap: float, mu: float) -> rl.Polygon:
    """Two parallel edges at distance 1 that see each other within the cones by `overlap` only."""
    return rl.Polygon([(0, 0), (1, 0), (2 + mu, 1), (1 + mu - overlap, 1)], name="sliver")


def largest(rows: list[list[Fraction]], bounds: list[Fraction]) -> Fraction:
    """The largest margin in the unit box, by the program in rationals."""
    matrix, right = np.array(rows), np.array(bounds)
    ones = np.array([Fraction(1)] * max(matrix.shape))
    point, _ = exact_optimum(matrix, ones[: len(rows)], right, ones[: matrix.shape[1]])
    assert all(0 <= x <= 1 for x in point)
    return (right - matrix.dot(point)).min()


# --- the program ----------------------------------------------------------------------------------

numbers = st.integers(-6, 6).map(Fraction)


@given(
    st.integers(1, 4).flatmap(
        lambda n: st.lists(
            st.tuples(st.lists(numbers, min_size=n, max_size=n), numbers), min_size=1, max_size=5
        )
    )
)
def test_the_program_in_rationals_equals_scipy(lines: list) -> None:
    rows, bounds = [row for row, _ in lines], [bound for _, bound in lines]
    n = len(rows[0])
    matrix = np.column_stack((np.array(rows, dtype=float), np.ones(len(rows))))
    box = [(0, 1)] * n + [(None, None)]
    found = linprog([0.0] * n + [-1.0], matrix, np.array(bounds, dtype=float), bounds=box)
    assert found.x[-1] == pytest.approx(float(largest(rows, bounds)), abs=1e-9)


# --- margins of sets ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["two_finger", "three_finger", "concurrent", "parallel"])
@pytest.mark.parametrize("friction", [0.25, 1.5])
def test_margins_in_rationals_equal_the_closed_form(kind: str, friction: float) -> None:
    functions = existing(Cones.of(star(9, 4), friction), kind)
    closed, _ = best_pieces(functions)
    exact = [float(largest_margin(functions, row)) for row in range(min(len(functions), 60))]
    np.testing.assert_allclose(closed[:60], exact, rtol=1e-12, atol=1e-14)
    for row in range(0, len(exact), 17):
        constants, slopes = scaled_functions(functions, row)
        pieces = permutations(range(len(constants)), 2)
        programs = [largest(*piece_rows(constants, slopes, j, k)) for j, k in pieces]
        assert max(programs) == largest_margin(functions, row)


@pytest.mark.parametrize("kind", ["two_finger", "three_finger", "concurrent", "parallel"])
@pytest.mark.parametrize(
    ("polygon", "friction"),
    [(comb(3), 0.5), (lattice_star(10, 2), 1.0), (star(9, 4), 1.5), (sliver(2.0**-30, 0.7), 0.7)],
)
def test_best_points_attain_the_margins(kind: str, polygon: rl.Polygon, friction: float) -> None:
    """What attains the optimum of the dual is optimal; what leaves room is not at the end of it."""
    functions = existing(Cones.of(polygon, friction), kind)
    closed, pieces = best_pieces(functions)
    points = best_points(functions, pieces)
    assert ((points >= 0) & (points <= 1)).all()
    every = np.arange(len(functions))
    values = functions.values(points)
    attained = np.minimum(values[every, pieces[:, 1]], -values[every, pieces[:, 0]])
    np.testing.assert_allclose(attained, closed, atol=1e-14 * functions.cones.size, rtol=0)
    for i in range(functions.m):
        for end in (0.0, 1.0):
            # to the opposite end: if nothing is lost there, the contact need not have been here
            moved = points.copy()
            moved[:, i] = 1 - end
            there = functions.values(moved)
            free = np.minimum(there[every, pieces[:, 1]], -there[every, pieces[:, 0]]) >= closed
            assert not (free & (points[:, i] == end)).any()


def test_scaled_functions_are_those_of_the_stack() -> None:
    for kind in ("three_finger", "parallel"):
        functions = existing(Cones.of(star(8, 2), 1.25), kind)
        for row in range(0, len(functions), 7):
            columns = np.flatnonzero(functions.valid[row])
            constants, slopes = scaled_functions(functions, row)
            at_one = [float(c + sum(s)) for c, s in zip(constants, slopes, strict=True)]
            np.testing.assert_allclose(
                np.array(slopes, dtype=float), functions.slopes[row, columns]
            )
            np.testing.assert_allclose(
                at_one, functions.values(np.ones(functions.m))[row, columns], atol=1e-12
            )


@pytest.mark.parametrize("exponent", [-3, -20, -30, -40, -48])
def test_thin_sets_have_margins_good_to_nine_digits(exponent: int) -> None:
    """The torque about the boundary ray d = (μ, 1) is the overlap, its scale 2 √(1 + μ²)."""
    overlap, mu = 2.0**exponent, 0.75
    graph = rl.build_switching_graph(sliver(overlap, mu), mu)
    thin = next(s for s in graph.sets if s.edges == (0, 2))
    assert thin.margin == pytest.approx(overlap / 2.5, rel=1e-12)


def test_floating_point_alone_is_not_good_enough() -> None:
    functions = existing(Cones.of(sliver(2.0**-48, 0.7), 0.7), "two_finger")
    closed, pieces = best_pieces(functions)
    row = functions.edges.tolist().index([0, 2])
    certain = certain_margins(functions, closed, pieces)[row]
    assert abs(closed[row] - certain) > 1e-9 * certain


def test_a_margin_equal_to_the_least_is_not_larger() -> None:
    """With μ = 3/4 rays have rational lengths: this margin is exactly 1/8."""
    polygon = sliver(0.3125, 0.75)
    for least, kept in ((0.125, False), (np.nextafter(0.125, 0), True), (0.13, False)):
        graph = rl.build_switching_graph(polygon, 0.75, min_margin=float(least))
        assert ((0, 2) in [s.edges for s in graph.sets]) == kept
    functions = existing(Cones.of(polygon, 0.75), "two_finger")
    row = functions.edges.tolist().index([0, 2])
    assert largest_margin(functions, row) == Fraction(1, 8)
    off = np.full(len(functions), 0.125)
    off[row] = np.nextafter(0.125, 1)  # as rounding might have it
    assert not exceeds(functions, off, 0.125)[row]


# --- switches -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("polygon", "friction"), [(comb(2), 0.75), (lattice_star(6, 3), 0.75)])
def test_margins_of_switches_are_compared_exactly(polygon: rl.Polygon, friction: float) -> None:
    kinds = [existing(Cones.of(polygon, friction), k) for k in ("two_finger", "three_finger")]
    stack = shadows(kinds, 1)
    pairs = [
        (i, j)
        for i, j in combinations(range(len(stack)), 2)
        if stack.edges[i] == stack.edges[j] and stack.source[i] < stack.source[j]
    ][::9][:6]
    for i, j in pairs:
        first, second = stack.take(np.array([i])), stack.take(np.array([j]))
        best = max(solution.margin for solution in joined_optima(first, second))
        joined = meet_held(first, second, solver=SOLVER).exist[0]
        assert joined == (best > 0)
        if best <= 0:
            continue
        near = float(best)
        for least in (near, float(np.nextafter(near, 0)), float(np.nextafter(near, 1)), near / 2):
            found = meet_held(first, second, solver=SOLVER, min_margin=least)
            larger = best - Fraction(least) > Fraction(1, 10**40) * best
            assert found.exist[0] == larger
            assert np.isnan(found.points[0]).any() != larger
        assert meet_held(first, second, solver=SOLVER, min_margin=near).exactly[0]


def test_three_held_contacts_with_a_margin_of_zero_are_decided_exactly() -> None:
    """A set and itself, mirrored in the axis of an edge: their closures touch where M = 0."""
    functions = existing(Cones.of(star(7, 0), 2.0), "parallel")
    stack = shadows((functions,), 3)
    pairs = [
        (i, j)
        for i, j in combinations(range(len(stack)), 2)
        if (stack.edges[i] == stack.edges[j]).all()
    ]
    assert pairs
    first, second = (stack.take(np.array(side)) for side in zip(*pairs, strict=True))
    exact = [
        max(s.margin for s in joined_optima(first.take(n), second.take(n))) > 0
        for n in np.arange(len(pairs))[:15, None]
    ]
    found = meet_by_lp(first, second, SOLVER)
    np.testing.assert_array_equal(found.exist[:15], exact)
    for n in np.flatnonzero(found.exist):
        for side in (first, second):
            assert functions.take(side.row[[n]]).contain(found.points[n])[0]
