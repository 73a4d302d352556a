"""Margin LPs: bounds that hold whatever a solver says, two solvers, odd scales."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from geometry import rectangle, star
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.candidates import complete_candidates
from regrasp_lp.grasp_sets.pieces import piece_sets
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver, margin_lp, maximise_margins
from regrasp_lp.lp.margin_lp import GAP, MarginSolutions, enclose
from regrasp_lp.margins import existing_pieces
from regrasp_lp.torque import torque_functions

SOLVERS = ["clarabel", "highs"]


def random_sets(seed: int, count: int, rows: int = 5, n: int = 3) -> LinearSets:
    rng = np.random.default_rng(seed)
    return LinearSets(
        tuple(f"x{i}" for i in range(n)),
        rng.normal(size=(count, rows, n)),
        rng.uniform(0.2, 2.0, (count, rows)),
        rng.normal(size=(count, rows)),
        np.zeros((count, n)),
        rng.uniform(0.5, 1.5, (count, n)),
    )


def by_linprog(sets: LinearSets) -> np.ndarray:
    values = []
    for one in sets:
        n = len(one.names)
        result = linprog(
            np.append(np.zeros(n), -1.0),
            A_ub=np.column_stack((one.rows[0], one.scales[0])),
            b_ub=one.bounds[0],
            bounds=[*zip(one.lower[0], one.upper[0], strict=True), (None, None)],
        )
        values.append(-result.fun)
    return np.array(values)


@pytest.mark.parametrize("solver", SOLVERS)
def test_optimum_is_that_of_another_program(solver: str) -> None:
    sets = random_sets(0, 60)
    found = maximise_margins(sets, get_solver(solver))
    expected = by_linprog(sets)
    np.testing.assert_allclose(found.margins, expected, atol=1e-8)
    assert found.solved.all()
    assert (found.margins <= found.bounds + 1e-12).all()
    np.testing.assert_array_equal(found.margins, sets.margins(found.points))
    assert {True, False} == set((expected > 0).tolist())


@pytest.mark.parametrize("solver", SOLVERS)
def test_thoroughly_gives_the_same(solver: str) -> None:
    sets = random_sets(1, 20)
    units = np.ones(20)
    for thorough in (False, True):
        found = enclose(sets, *get_solver(solver).solve(sets, thorough=thorough), units)
        assert found.solved.all()
        np.testing.assert_allclose(found.margins, by_linprog(sets), atol=1e-7)


def test_a_set_of_known_margin() -> None:
    """``x, y > 0`` and ``x + y < 1``, each row of scale 1: the incentre of another metric."""
    sets = LinearSets(
        ("x", "y"),
        np.array([[[-1.0, 0.0], [0.0, -1.0], [1.0, 1.0]]]),
        np.ones((1, 3)),
        np.array([[0.0, 0.0, 1.0]]),
        -np.ones((1, 2)),
        np.ones((1, 2)),
    )
    for solver in SOLVERS:
        found = maximise_margins(sets, get_solver(solver))
        assert found.margins[0] == pytest.approx(1 / 3)
        np.testing.assert_allclose(found.points[0], [1 / 3, 1 / 3])


@settings(max_examples=80)
@given(st.integers(0, 10**6))
def test_bounds_hold_for_any_point_and_any_multipliers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sets = random_sets(seed, 4)
    points = rng.normal(scale=5, size=sets.lower.shape)
    multipliers = rng.normal(size=sets.bounds.shape) * rng.integers(0, 2, sets.bounds.shape)
    found = enclose(sets, points, multipliers, np.ones(4))
    optimum = by_linprog(sets)
    assert (found.margins <= optimum + 1e-8).all()
    assert (optimum <= found.bounds + 1e-8).all()
    assert ((found.points >= sets.lower) & (found.points <= sets.upper)).all()
    np.testing.assert_array_equal(found.margins, sets.margins(found.points))


def test_failures_of_a_solver_bound_nothing() -> None:
    sets = random_sets(0, 3)
    points, multipliers = np.zeros((3, 3)), np.ones((3, 5))
    points[0, 1] = np.nan
    multipliers[1, 2] = np.inf
    multipliers[2] = -1.0  # none is positive: no bound follows
    found = enclose(sets, points, multipliers, np.ones(3))
    assert np.isneginf(found.margins[:2]).all()
    assert np.isposinf(found.bounds).all()
    assert not found.solved.any()
    assert not found.positive[:2].any()
    assert np.isfinite(found.points).all()


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from([1e-300, 1e-30, 1e30, 1e300, 1.7e308]))
def test_bounds_hold_for_multipliers_of_any_size(seed: int, size: float) -> None:
    """Sums of them overflow or vanish: then there is no bound, and never a wrong one."""
    rng = np.random.default_rng(seed)
    sets = random_sets(seed, 4)
    multipliers = rng.uniform(0.1, 1, sets.bounds.shape)
    found = enclose(sets, sets.lower, size * multipliers, np.ones(4))
    reference = enclose(sets, sets.lower, multipliers, np.ones(4))
    np.testing.assert_allclose(found.bounds, reference.bounds, rtol=1e-12)
    multipliers[:, 0] *= size
    found = enclose(sets, sets.lower, multipliers, np.ones(4))
    assert (by_linprog(sets) <= found.bounds + 1e-8).all()


def test_bounds_the_wrong_way_round_prove_nothing() -> None:
    wrong = MarginSolutions(np.zeros((2, 1)), np.ones(2), np.array([1 - 1e-12, 0.5]), np.ones(2))
    assert wrong.solved.tolist() == [True, False]
    missing = MarginSolutions(
        np.zeros((3, 1)),
        np.array([-np.inf, 0.0, -np.inf]),
        np.array([0.0, np.inf, np.inf]),
        np.ones(3),
    )
    assert np.isposinf(missing.gaps).all()


@pytest.mark.parametrize("solver", SOLVERS)
def test_empty_stacks(solver: str) -> None:
    found = maximise_margins(random_sets(0, 0), get_solver(solver))
    assert found.points.shape == (0, 3)
    assert found.margins.shape == found.bounds.shape == found.solved.shape == (0,)


@pytest.mark.parametrize("solver", SOLVERS)
def test_stacks_are_solved_in_parts(solver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    sets = random_sets(3, 25)
    expected = maximise_margins(sets, get_solver(solver))
    monkeypatch.setattr(margin_lp, "_STACK", 10)
    told: list[int] = []
    found = maximise_margins(sets, get_solver(solver), told.append)
    assert told == [10, 20, 25]
    np.testing.assert_allclose(found.margins, expected.margins, atol=1e-9)
    np.testing.assert_array_equal(found.units, expected.units)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("factor", [1e-9, 1e-4, 1e9])
def test_the_unit_of_the_rows_does_not_matter(solver: str, factor: float) -> None:
    """As a polygon in nanometres or in megametres gives it: rows and bounds, not scales."""
    sets = random_sets(4, 30)
    reference = maximise_margins(sets, get_solver(solver))
    scaled = replace(sets, rows=sets.rows * factor, bounds=sets.bounds * factor)
    found = maximise_margins(scaled, get_solver(solver))
    np.testing.assert_allclose(found.margins / factor, reference.margins, atol=1e-8)
    np.testing.assert_array_equal(found.positive, reference.positive)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_stack_of_very_different_scales(solver: str) -> None:
    sets = random_sets(5, 30)
    factor = 10.0 ** np.random.default_rng(0).integers(-9, 10, 30)
    mixed = replace(
        sets, rows=sets.rows * factor[:, None, None], bounds=sets.bounds * factor[:, None]
    )
    found = maximise_margins(mixed, get_solver(solver))
    np.testing.assert_allclose(found.margins / factor, by_linprog(sets), atol=1e-7)


@pytest.mark.parametrize("solver", SOLVERS)
def test_marginal_sets_are_not_positive(solver: str) -> None:
    """Best margin exactly 0: two bands that touch, and cells 1e-12 apart or overlapping 1e-6."""
    rows = np.array([[[1.0, 0.0], [-1.0, 0.0]]]).repeat(4, axis=0)
    gap = np.array([0.0, 1e-12, 0.1, -1e-6])
    bounds = np.stack((np.full(4, 0.5), -0.5 - gap), axis=1)
    sets = LinearSets(("x", "y"), rows, np.ones((4, 2)), bounds, np.zeros((4, 2)), np.ones((4, 2)))
    found = maximise_margins(sets, get_solver(solver))
    np.testing.assert_allclose(found.margins, -gap / 2, atol=1e-9)
    assert found.positive.tolist() == [False, False, False, True]


@pytest.mark.parametrize("solver", SOLVERS)
def test_rows_of_zeros_and_flat_boxes(solver: str) -> None:
    sets = random_sets(6, 8)
    sets.rows[:, 0] = 0.0
    flat = replace(sets, upper=sets.lower.copy())
    found = maximise_margins(flat, get_solver(solver))
    np.testing.assert_allclose(found.margins, flat.margins(flat.lower), atol=1e-9)
    nothing = replace(sets, rows=0 * sets.rows, bounds=0 * sets.bounds)
    found = maximise_margins(nothing, get_solver(solver))
    np.testing.assert_allclose(found.margins, 0.0, atol=1e-9)
    assert not found.positive.any()


def test_solvers_agree_on_pieces_of_grasp_sets() -> None:
    for polygon, mu in ((star(9, 3), 0.5), (rectangle(), 1.0), (rectangle(1e-9, 2e-9), 0.5)):
        functions = torque_functions(
            Cones.of(polygon, mu), complete_candidates(Cones.of(polygon, mu), 3)
        )
        pieces = existing_pieces(functions)[:200]
        for measure in ("margin", "tolerance"):
            sets = piece_sets(functions, pieces, "abc", measure=measure, apart=2.0)
            one, other = (maximise_margins(sets, get_solver(s)) for s in SOLVERS)
            size = polygon.diameter
            np.testing.assert_allclose(one.margins, other.margins, atol=1e-8 * size)
            assert (one.margins <= other.bounds + 1e-12 * size).all()


def test_solvers_by_name() -> None:
    assert [get_solver(name).name for name in SOLVERS] == SOLVERS
    with pytest.raises(OptionError, match='"clarabel" or "highs", got \'cplex\''):
        get_solver("cplex")


def test_solved_and_positive_are_relative_to_the_unit() -> None:
    units = np.array([1.0, 1e3])
    found = MarginSolutions(
        np.zeros((2, 1)), np.full(2, 2 * GAP), np.full(2, 2 * GAP + 1.5e-8), units
    )
    assert found.solved.tolist() == [False, True]
    assert found.positive.tolist() == [True, False]


def test_unbounded_boxes_are_refused() -> None:
    sets = random_sets(0, 2)
    far = np.full(sets.lower.shape, np.inf)
    with pytest.raises(OptionError, match="bounded box"):
        maximise_margins(replace(sets, upper=far), get_solver("highs"))


def test_what_is_no_margin_program_is_refused() -> None:
    sets = random_sets(0, 3)
    wrong = np.zeros((3, 5))
    wrong[1, 2] = np.nan
    rows = sets.rows.copy()
    rows[2, 0, 0] = np.inf
    cases = (
        (replace(sets, bounds=sets.bounds + wrong), "margin LP 1 of 3 has a number that is not f"),
        (replace(sets, rows=rows), "margin LP 2 of 3 has a number that is not finite"),
        (replace(sets, lower=sets.upper + 1), "margin LP 0 of 3 has an empty box"),
        (replace(sets, scales=sets.scales - 1), "a scale that is not >= 0"),
        (replace(sets, scales=sets.scales + wrong), "margin LP 1 of 3 has a scale that is not"),
        (replace(sets, scales=0 * sets.scales), "no row of positive scale"),
    )
    for case, message in cases:
        with pytest.raises(OptionError, match=message):
            maximise_margins(case, get_solver("highs"))


@pytest.mark.parametrize("name", SOLVERS)
def test_the_unit_of_a_coordinate_does_not_matter(name: str) -> None:
    sets = random_sets(1, 20)
    margins = maximise_margins(sets, get_solver(name)).margins
    for unit in (1e-12, 1e12):
        scaled = replace(
            sets, rows=sets.rows / unit, lower=sets.lower * unit, upper=sets.upper * unit
        )
        found = maximise_margins(scaled, get_solver(name)).margins
        np.testing.assert_allclose(found, margins, atol=1e-7)
