"""Solvers that fail: each failure is put in, the answers stay right, and the report says so."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache
from typing import Any

import clarabel
import highspy
import numpy as np
import pytest
from geometry import LATTICE, star
from hypothesis import given, settings
from hypothesis import strategies as st
from test_lp import SOLVERS, by_linprog, random_sets

import regrasp_lp as rl
from regrasp_lp.errors import SolverError
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import clarabel_solver, ladder, margin_lp, maximise_margins
from regrasp_lp.lp.clarabel_solver import ClarabelSolver
from regrasp_lp.lp.exact_solver import ExactSolver
from regrasp_lp.lp.highs_solver import HighsSolver
from regrasp_lp.lp.ladder import attempts, balance
from regrasp_lp.lp.margin_lp import enclose
from regrasp_lp.lp.solver import get_solver

Answer = tuple[np.ndarray, np.ndarray]


class Panic(BaseException):
    """As `pyo3_runtime.PanicException`, which is no `Exception` either."""


def points_of_nan(points: np.ndarray, multipliers: np.ndarray) -> Answer:
    return np.full(points.shape, np.nan), multipliers


def infinite_multipliers(points: np.ndarray, multipliers: np.ndarray) -> Answer:
    return points, np.full(multipliers.shape, np.inf)


def garbage(points: np.ndarray, multipliers: np.ndarray) -> Answer:
    rng = np.random.default_rng(0)
    return rng.normal(size=points.shape), rng.normal(size=multipliers.shape)


def negated(points: np.ndarray, multipliers: np.ndarray) -> Answer:
    return points, -multipliers


def enormous(points: np.ndarray, multipliers: np.ndarray) -> Answer:
    return 1e308 * (points - 2), np.full(multipliers.shape, 1.7e308)


def transposed(points: np.ndarray, multipliers: np.ndarray) -> Answer:
    return points.T, multipliers[:, :-1]


def nothing(points: np.ndarray, multipliers: np.ndarray) -> Any:
    return None


def raising(error: BaseException) -> Callable[[np.ndarray, np.ndarray], Answer]:
    def broken(points: np.ndarray, multipliers: np.ndarray) -> Answer:
        raise error

    return broken


FAILURES = {
    "points of NaN": (points_of_nan, None),
    "infinite multipliers": (infinite_multipliers, None),
    "garbage": (garbage, None),
    "negated multipliers": (negated, None),
    "enormous numbers": (enormous, None),
    "wrong shape": (transposed, "ValueError: answer of shapes"),
    "no arrays": (nothing, "TypeError: "),
    "exception": (raising(RuntimeError("basis lost")), "RuntimeError: basis lost"),
    "numerical error": (raising(ArithmeticError("pivot 0")), "ArithmeticError: pivot 0"),
    "no memory": (raising(MemoryError("1 TiB")), "MemoryError: 1 TiB"),
    "panic": (raising(Panic("called unwrap on None")), "Panic: called unwrap on None"),
}


@dataclass
class Stub:
    """HiGHS with a failure put in, where `fails` says so; remembers how it was asked."""

    how: Callable[[np.ndarray, np.ndarray], Answer]
    fails: Callable[[LinearSets, bool], bool]
    name: str = "stub"
    asked: list[tuple[int, bool]] = field(default_factory=list)

    def solve(self, sets: LinearSets, *, thorough: bool) -> Answer:
        self.asked.append((len(sets), thorough))
        answer = HighsSolver().solve(sets, thorough=False)
        return self.how(*answer) if self.fails(sets, thorough) else answer


def reports(caplog: pytest.LogCaptureFixture) -> list[str]:
    assert {r.name for r in caplog.records} <= {"regrasp_lp"}
    assert {r.levelno for r in caplog.records} <= {logging.WARNING}
    return [r.getMessage() for r in caplog.records]


def check_answers(sets: LinearSets, found: Any) -> None:
    assert found.solved.all()
    np.testing.assert_allclose(found.margins, by_linprog(sets), atol=1e-8)
    np.testing.assert_array_equal(found.margins, sets.margins(found.points))


# --- one rung after the other --------------------------------------------------------------------


def test_a_sound_solver_is_asked_once_and_nothing_is_reported(
    caplog: pytest.LogCaptureFixture,
) -> None:
    stub = Stub(garbage, lambda sets, thorough: False)
    check_answers(random_sets(2, 12), maximise_margins(random_sets(2, 12), stub))
    assert stub.asked == [(12, False)]
    assert reports(caplog) == []


@pytest.mark.parametrize("how", FAILURES)
def test_a_stack_that_fails_as_a_whole_is_split(how: str, caplog: pytest.LogCaptureFixture) -> None:
    sets, (broken, reason) = random_sets(2, 12), FAILURES[how]
    stub = Stub(broken, lambda sets, thorough: len(sets) > 1)
    check_answers(sets, maximise_margins(sets, stub))
    assert stub.asked[0] == (12, False)
    assert set(stub.asked[1:]) == {(1, False)}
    (report,) = reports(caplog)
    assert "of 12 margin LPs open after the first attempt" in report
    assert "by stub one by one" in report
    assert (reason or "solved") in report


@pytest.mark.parametrize("how", ["exception", "panic", "points of NaN", "no memory"])
def test_one_bad_program_does_not_spoil_the_others(
    how: str, caplog: pytest.LogCaptureFixture
) -> None:
    sets, (broken, reason) = random_sets(3, 9), FAILURES[how]
    poison = replace(sets, bounds=sets.bounds.copy())
    poison.bounds[4, :] = 7.0

    def fails(asked: LinearSets, thorough: bool) -> bool:
        return bool((np.ptp(asked.bounds, axis=1) == 0).any())

    stub = Stub(broken, fails)
    check_answers(poison, maximise_margins(poison, stub))
    assert stub.asked == [(9, False), *[(1, False)] * 9, (1, True)]
    (report,) = reports(caplog)
    assert "9 of 9 margin LPs open" in report
    assert "solved 8 by stub one by one, 1 by clarabel" in report
    assert (reason or "") in report


@pytest.mark.parametrize("how", FAILURES)
def test_what_fails_one_by_one_is_asked_for_thoroughly(
    how: str, caplog: pytest.LogCaptureFixture
) -> None:
    sets = random_sets(2, 6)
    stub = Stub(FAILURES[how][0], lambda sets, thorough: not thorough)
    check_answers(sets, maximise_margins(sets, stub))
    assert (1, True) in stub.asked
    (report,) = reports(caplog)
    assert "by stub thoroughly" in report


@pytest.mark.parametrize("how", FAILURES)
@pytest.mark.parametrize("name", SOLVERS)
def test_what_one_solver_cannot_do_the_other_does(
    how: str, name: str, caplog: pytest.LogCaptureFixture
) -> None:
    sets = random_sets(2, 6)
    stub = Stub(FAILURES[how][0], lambda sets, thorough: True, name)
    check_answers(sets, maximise_margins(sets, stub))
    assert {(6, False), (1, False), (1, True)} == set(stub.asked)
    (report,) = reports(caplog)
    other = SOLVERS[1 - SOLVERS.index(name)]
    assert report.startswith(f"{name}: ")
    assert f"by {other}" in report


@pytest.mark.parametrize("how", FAILURES)
def test_what_no_solver_can_do_is_done_in_rational_numbers(
    how: str, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    sets = random_sets(2, 6)

    def broken(name: str) -> Stub:
        return Stub(FAILURES[how][0], lambda sets, thorough: True, name)

    monkeypatch.setattr(ladder, "get_solver", broken)
    check_answers(sets, maximise_margins(sets, broken("clarabel")))
    (report,) = reports(caplog)
    assert "by exact simplex" in report


@pytest.mark.parametrize("how", FAILURES)
def test_where_everything_fails_the_error_names_all_that_was_tried(
    how: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    broken, reason = FAILURES[how]
    monkeypatch.setattr(
        ladder, "get_solver", lambda name: Stub(broken, lambda sets, thorough: True, name)
    )
    monkeypatch.setattr(
        ExactSolver, "solve", lambda self, sets, *, thorough: raising(OSError("no"))(None, None)
    )
    stub = Stub(broken, lambda sets, thorough: True)
    with pytest.raises(SolverError) as error:
        maximise_margins(random_sets(2, 6), stub)
    message = str(error.value)
    assert "margin LPs open" in message
    assert "this is neither yes nor no" in message
    for label in ("stub", "stub one by one", "stub thoroughly", "clarabel", "clarabel thoroughly"):
        assert f"{label} left " in message
    for label in ("highs", "highs thoroughly", "exact simplex"):
        assert f"{label} left " in message
    assert message.count("worst gap") == 8
    assert (reason or "OSError: no") in message
    assert "OSError: no" in message
    assert reports(caplog) == []


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit, GeneratorExit])
def test_being_stopped_is_no_failure(stop: type[BaseException]) -> None:
    stub = Stub(raising(stop()), lambda sets, thorough: True)
    with pytest.raises(stop):
        maximise_margins(random_sets(2, 6), stub)
    assert stub.asked == [(6, False)]


def test_half_answers_of_two_attempts_make_a_whole_one() -> None:
    """A good point without a bound, then a good bound without its point."""
    sets = random_sets(2, 6)

    def half(sets: LinearSets, thorough: bool) -> bool:
        return True

    stub = Stub(garbage, half)

    def broken(points: np.ndarray, multipliers: np.ndarray) -> Answer:
        first = len(stub.asked) == 1
        middle, ones = np.full(points.shape, 0.5), np.ones(multipliers.shape)
        return (points, ones) if first else (middle, multipliers)

    stub.how = broken
    check_answers(sets, maximise_margins(sets, stub))
    assert set(stub.asked[1:]) == {(1, False)}


def test_stacks_report_each_on_their_own(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("regrasp_lp.lp.margin_lp._STACK", 10)
    sets = random_sets(3, 25)
    stub = Stub(points_of_nan, lambda sets, thorough: len(sets) == 5)
    check_answers(sets, maximise_margins(sets, stub))
    assert reports(caplog) == [
        "stub: 5 of 5 margin LPs open after the first attempt; solved 5 by stub one by one"
    ]


def test_the_ladder_ends_and_asks_each_solver_once_each_way() -> None:
    for name in SOLVERS:
        every = list(attempts(get_solver(name)))
        assert len({a.label for a in every}) == len(every) == 6
        assert every[0].label == name
        assert not any(a.one_by_one for a in every[:1])
        assert all(a.one_by_one for a in every[1:])
        assert every[-1].label == "exact simplex"


# --- real failures of the real solvers -----------------------------------------------------------


@pytest.mark.parametrize(
    "solver",
    [
        ClarabelSolver(max_iterations=1),
        ClarabelSolver(max_iterations=4),
        ClarabelSolver(tolerance=1e-2),
        HighsSolver(max_iterations=0),
        HighsSolver(max_iterations=1),
    ],
    ids=repr,
)
def test_iteration_limits_and_loose_tolerances(
    solver: Any, caplog: pytest.LogCaptureFixture
) -> None:
    sets = random_sets(7, 20)
    check_answers(sets, maximise_margins(sets, solver))
    (report,) = reports(caplog)
    assert report.startswith(f"{solver.name}: ")


def test_a_time_limit_is_neither_yes_nor_no(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = clarabel.DefaultSettings

    def hasty() -> Any:
        limited = original()
        limited.time_limit = 1e-12
        return limited

    monkeypatch.setattr(clarabel, "DefaultSettings", hasty)
    sets = random_sets(8, 20)
    raw = ClarabelSolver().solve(sets, thorough=False)
    assert not enclose(sets, *raw, np.ones(20)).solved.any()
    check_answers(sets, maximise_margins(sets, ClarabelSolver()))
    (report,) = reports(caplog)
    assert "clarabel: 20 of 20 margin LPs open" in report
    assert "solved 20 by highs" in report
    with monkeypatch.context() as patch:
        patch.setattr(ladder, "NAMES", ("clarabel",))
        patch.setattr(ExactSolver, "solve", lambda self, sets, *, thorough: 1 // 0)
        with pytest.raises(SolverError, match="20 of 20 margin LPs open .*neither yes nor no"):
            maximise_margins(sets, ClarabelSolver())


def test_a_panic_in_the_real_solver(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Row numbers beyond the last row: Clarabel's Rust panics, which is no `Exception`."""
    original = clarabel_solver._block_diagonal

    def damaged(sets: LinearSets) -> Any:
        matrix = original(sets)
        matrix.indices = matrix.indices + 1000
        return matrix

    monkeypatch.setattr(clarabel_solver, "_block_diagonal", damaged)
    sets = random_sets(8, 5)
    check_answers(sets, maximise_margins(sets, ClarabelSolver()))
    (report,) = reports(caplog)
    assert "[PanicException: index out of bounds" in report
    assert "solved 5 by highs" in report


def test_a_status_of_clarabel_that_lies() -> None:
    """Of limits that are no numbers it says "solved": its answer is no bound of anything."""
    sets = random_sets(8, 5)
    sets.bounds[2, 1] = np.nan
    raw = ClarabelSolver().solve(sets, thorough=False)
    assert not enclose(sets, *raw, np.ones(5)).solved[2]


class Lying(highspy.Highs):
    """Says that all is well and optimal, without having looked."""

    def run(self) -> Any:
        return highspy.HighsStatus.kOk

    def getModelStatus(self) -> Any:
        return highspy.HighsModelStatus.kOptimal

    def getSolution(self) -> Any:
        solution = highspy.HighsSolution()
        solution.value_valid = solution.dual_valid = True
        solution.col_value = [0.25] * self.getNumCol()
        solution.row_dual = [-1.0] * self.getNumRow()
        return solution


def test_a_status_that_lies(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(highspy, "Highs", Lying)
    sets = random_sets(9, 8)
    check_answers(sets, maximise_margins(sets, HighsSolver()))
    (report,) = reports(caplog)
    assert report.startswith("highs: 8 of 8 margin LPs open")
    assert "solved 8 by clarabel" in report


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("options", [{"presolve": False}, {"min_margin": 0.01}])
def test_a_graph_built_by_a_failing_solver_is_the_same(
    name: str,
    options: dict[str, Any],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    polygon = star(6, 3)
    sound = rl.build_switching_graph(polygon, 0.3, solver=name, **options)
    assert reports(caplog) == []
    solvers = {"clarabel": ClarabelSolver, "highs": HighsSolver}
    original, calls = solvers[name].solve, []

    def unsteady(self: Any, sets: LinearSets, *, thorough: bool) -> Answer:
        calls.append(len(sets))
        if len(calls) % 2:
            raise Panic("every other time")
        return original(self, sets, thorough=thorough)

    monkeypatch.setattr(solvers[name], "solve", unsteady)
    other = rl.build_switching_graph(polygon, 0.3, solver=name, **options)
    assert len(reports(caplog)) > 0
    assert [s.edges for s in other.sets] == [s.edges for s in sound.sets]
    np.testing.assert_allclose(other.sets.margins, sound.sets.margins, atol=1e-9)
    assert [other.neighbors(i) for i in range(len(other))] == [
        sound.neighbors(i) for i in range(len(sound))
    ]


# --- the last resort -----------------------------------------------------------------------------


def test_the_exact_optimum_of_a_known_program() -> None:
    """``x, y > 0``, ``3 x + y < 1`` with scales 1, 1, 2: ε = 1/6 at (1/6, 1/6)."""
    sets = LinearSets(
        ("x", "y"),
        np.array([[[-1.0, 0.0], [0.0, -1.0], [3.0, 1.0]]]),
        np.array([[1.0, 1.0, 2.0]]),
        np.array([[0.0, 0.0, 1.0]]),
        -np.ones((1, 2)),
        np.ones((1, 2)),
    )
    points, multipliers = ExactSolver().solve(sets, thorough=False)
    np.testing.assert_array_equal(points, [[float(Fraction(1, 6))] * 2])
    np.testing.assert_array_equal(multipliers[0] * 6, [3.0, 1.0, 1.0])


small = st.integers(-3, 3).map(float)


@st.composite
def degenerate_sets(draw: st.DrawFn) -> LinearSets:
    """Small integers: ties, parallel and repeated rows, flat boxes and rows of scale 0."""
    n, r = draw(st.integers(1, 4)), draw(st.integers(1, 6))
    rows = draw(st.lists(small, min_size=n * r, max_size=n * r))
    bounds = draw(st.lists(small, min_size=r, max_size=r))
    scales = [1.0, *draw(st.lists(st.integers(1, 2).map(float), min_size=r - 1, max_size=r - 1))]
    lower = draw(st.lists(small, min_size=n, max_size=n))
    width = draw(st.lists(st.integers(0, 3).map(float), min_size=n, max_size=n))
    free = draw(st.integers(0, 2))  # rows of scale 0, void or satisfied at the lower corner
    extra = np.array(draw(st.lists(small, min_size=n * free, max_size=n * free))).reshape(free, n)
    return LinearSets(
        tuple(f"x{i}" for i in range(n)),
        np.concatenate((np.array(rows).reshape(1, r, n), extra[None]), axis=1),
        np.concatenate((np.array([scales]), np.zeros((1, free))), axis=1),
        np.concatenate((np.array([bounds]), (extra @ np.array(lower))[None]), axis=1),
        np.array([lower]),
        np.array([lower]) + np.array([width]),
    )


@settings(max_examples=150)
@given(degenerate_sets())
def test_the_exact_solver_finds_the_optimum_of_degenerate_programs(sets: LinearSets) -> None:
    points, multipliers = ExactSolver().solve(sets, thorough=False)
    found = enclose(sets, points, multipliers, np.ones(1))
    assert found.gaps.max() < 1e-10
    np.testing.assert_allclose(found.margins, by_linprog(sets), atol=1e-8)


@settings(max_examples=60)
@given(degenerate_sets())
def test_all_solvers_agree_on_degenerate_programs(sets: LinearSets) -> None:
    found = [maximise_margins(sets, get_solver(name)).margins for name in SOLVERS]
    found.append(maximise_margins(sets, ExactSolver()).margins)
    np.testing.assert_allclose(found, np.broadcast_to(found[0], (3, 1)), atol=1e-7)


def test_the_exact_solver_says_where_there_is_no_optimum() -> None:
    sets = random_sets(0, 1)
    contradiction = replace(sets, scales=sets.scales.copy(), bounds=sets.bounds.copy())
    contradiction.rows[0, :2] = 0.0
    contradiction.scales[0, 0], contradiction.bounds[0, 0] = 0.0, -1.0
    for case in (
        contradiction,
        replace(sets, scales=0 * sets.scales),
        replace(sets, lower=sets.upper + 1),
    ):
        points, multipliers = ExactSolver().solve(case, thorough=False)
        assert np.isnan(points).all()
        assert np.isnan(multipliers).all()
    points, multipliers = ExactSolver().solve(random_sets(0, 0), thorough=False)
    assert (points.shape, multipliers.shape) == ((0, 3), (0, 5))


# --- extreme inputs ------------------------------------------------------------------------------


def powers(seed: int, *shape: int) -> np.ndarray:
    return 10.0 ** np.random.default_rng(seed).integers(-12, 13, shape)


@cache
def extreme(case: str) -> LinearSets:
    sets, factor = random_sets(1, 60), powers(0, 60, 5)
    flat = sets.upper.copy()
    flat[:, 0] = sets.lower[:, 0]
    scales = sets.scales.copy()
    scales[:, 1:] = 0.0
    return {
        "rows of magnitudes 1e-12 to 1e12": replace(
            sets,
            rows=sets.rows * factor[:, :, None],
            scales=sets.scales * factor,
            bounds=sets.bounds * factor,
        ),
        "such rows, all of scale 1": replace(
            sets, rows=sets.rows * factor[:, :, None], bounds=sets.bounds * factor
        ),
        "scales of 1e-12 to 1e12": replace(sets, scales=sets.scales * factor),
        "boxes of widths 1e-12 to 1e12": replace(sets, upper=sets.upper * powers(1, 60, 3)),
        "boxes of no width": replace(sets, upper=sets.lower.copy()),
        "boxes of no width in one direction": replace(sets, upper=flat),
        "all rows but one of scale 0": replace(sets, scales=scales, bounds=np.abs(sets.bounds)),
        "repeated rows": replace(
            sets,
            rows=sets.rows[:, [0, 0, 0, 1, 1]],
            scales=sets.scales[:, [0, 0, 0, 1, 1]],
            bounds=sets.bounds[:, [0, 0, 0, 1, 1]],
        ),
    }[case]


EXTREME = [
    "rows of magnitudes 1e-12 to 1e12",
    "such rows, all of scale 1",
    "scales of 1e-12 to 1e12",
    "boxes of widths 1e-12 to 1e12",
    "boxes of no width",
    "boxes of no width in one direction",
    "all rows but one of scale 0",
    "repeated rows",
]


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("case", EXTREME)
def test_extreme_programs_are_closed_and_agree_with_rational_numbers(case: str, name: str) -> None:
    sets = extreme(case)
    found = maximise_margins(sets, get_solver(name))
    assert found.solved.all()
    assert np.isfinite(found.margins).all()
    exact = enclose(sets, *ExactSolver().solve(sets, thorough=False), found.units)
    assert (found.margins <= exact.bounds + 1e-12 * found.units).all()
    assert (exact.margins <= found.bounds + 1e-12 * found.units).all()
    # both are below 2 GAP of the optimum, so that they decide alike but for so small margins
    differ = found.positive != exact.positive
    assert (np.abs(exact.margins[differ]) <= 2e-8 * found.units[differ]).all()


@pytest.mark.parametrize("case", EXTREME)
def test_balancing_changes_neither_points_nor_multipliers(case: str) -> None:
    sets, _ = margin_lp._scaled(extreme(case))
    balanced, factors = balance(sets)
    assert np.abs(balanced.rows).max() <= 1 + 1e-15
    assert np.abs(balanced.scales).max() <= 1 + 1e-15
    points, multipliers = ExactSolver().solve(balanced, thorough=False)
    found = enclose(sets, points, multipliers * factors, np.ones(len(sets)))
    exact = enclose(sets, *ExactSolver().solve(sets, thorough=False), np.ones(len(sets)))
    np.testing.assert_allclose(found.bounds, exact.bounds, rtol=1e-9, atol=1e-12)


def test_every_piece_of_the_lattice_polygons_in_rational_numbers() -> None:
    """The exact solver on the programs of the package: the same margins as the closed form."""
    from regrasp_lp.friction import Cones
    from regrasp_lp.grasp_sets.pieces import piece_sets
    from regrasp_lp.grasp_sets.vertices import candidate_functions
    from regrasp_lp.margins import existing_pieces, piece_margins

    for name in ("square", "hexagon", "comb"):
        cones = Cones.of(LATTICE[name], 1.0)
        functions, _ = candidate_functions(cones, "three_finger")
        functions = functions.take(functions.exists())
        pieces = existing_pieces(functions)[:40]
        sets = piece_sets(functions, pieces, "abc")
        found = enclose(sets, *ExactSolver().solve(sets, thorough=False), np.ones(len(sets)))
        assert found.gaps.max() < 1e-13 * cones.size
        expected = piece_margins(functions)[tuple(pieces.T)]
        np.testing.assert_allclose(found.margins, expected, atol=1e-13 * cones.size)
