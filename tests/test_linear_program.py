"""General linear programs, against scipy and against their own proofs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.sparse import csr_matrix

from regrasp_lp.errors import SolverError
from regrasp_lp.lp import linear_program
from regrasp_lp.lp.linear_program import Minimum, minimise

_whole = st.integers(-3, 3)


@st.composite
def programs(draw: st.DrawFn) -> tuple[np.ndarray, ...]:
    """Cost, rows, bounds and box: small integers, so that ties and flat sets are common."""
    n, r = draw(st.integers(1, 4)), draw(st.integers(0, 6))

    def array(*shape: int) -> np.ndarray:
        count = int(np.prod(shape))
        values = draw(st.lists(_whole, min_size=count, max_size=count))
        return np.array(values, dtype=float).reshape(shape)

    lower = array(n)
    return array(n), array(r, n), array(r), lower, lower + np.abs(array(n))


def scipy_value(cost, rows, bounds, lower, upper) -> float | None:
    box = list(zip(lower, upper, strict=True))
    found = linprog(cost, rows if len(rows) else None, bounds if len(rows) else None, bounds=box)
    assert found.status in (0, 2)
    return None if found.status == 2 else float(found.fun)


@settings(max_examples=300, deadline=None)
@given(programs())
def test_the_optimum_is_scipys_and_its_two_bounds_meet(program) -> None:
    cost, rows, bounds, lower, upper = program
    expected = scipy_value(*program)
    found = minimise(cost, csr_matrix(rows), bounds, lower, upper)
    if expected is None:
        assert found is None
        return
    assert found is not None
    assert found.value == pytest.approx(expected, abs=1e-6)
    assert found.bound <= found.value
    assert found.bound == pytest.approx(expected, abs=1e-6)
    assert ((found.point >= lower) & (found.point <= upper)).all()
    assert (rows @ found.point <= bounds + 1e-7).all()
    assert (found.multipliers >= 0).all()


@settings(max_examples=100, deadline=None)
@given(programs(), st.integers(0, 5))
def test_multipliers_are_prices(program, row) -> None:
    """No smaller bound makes the optimum fall faster than the multipliers say."""
    cost, rows, bounds, lower, upper = program
    found = minimise(cost, csr_matrix(rows), bounds, lower, upper)
    if found is None or row >= len(bounds):
        return
    for change in (-0.5, 0.5):
        moved = bounds.copy()
        moved[row] += change
        after = scipy_value(cost, rows, moved, lower, upper)
        if after is not None:
            assert after >= found.value - found.multipliers[row] * change - 1e-6


def test_an_infeasible_program_is_proved_so() -> None:
    rows, box = csr_matrix([[1.0, 1.0], [-1.0, -1.0]]), (np.zeros(2), np.ones(2))
    assert minimise(np.ones(2), rows, np.array([0.5, -0.5 - 1e-6]), *box) is None
    just = minimise(np.ones(2), rows, np.array([0.5, -0.5]), *box)
    assert just is not None
    assert just.value == pytest.approx(0.5, abs=1e-9)


def test_a_program_without_rows_is_solved_by_its_box() -> None:
    none = csr_matrix((0, 3))
    found = minimise(np.array([1.0, -1.0, 0.0]), none, np.zeros(0), -np.ones(3), np.ones(3))
    assert found is not None
    assert (found.value, found.bound) == (-2.0, -2.0)


Answer = tuple[np.ndarray, np.ndarray, np.ndarray | None, str]


@pytest.mark.parametrize(
    ("answer", "fault"),
    [
        ((np.full(1, np.nan), np.full(1, np.nan), None, "Unknown"), "simplex: Unknown, no numbers"),
        ((np.zeros(1), np.zeros(1), None, "Optimal"), "rows broken by 5.0e-01"),
        ((np.ones(1), np.zeros(1), None, "Optimal"), "gap 1.0e+00"),
        # A ray that proves nothing is no proof, whatever the status says.
        ((np.full(1, np.nan), np.zeros(1), np.zeros(1), "Infeasible"), "ipm: Infeasible"),
        ((np.full(1, np.nan), np.zeros(1), np.ones(1), "Infeasible"), "simplex: Infeasible"),
    ],
)
def test_no_status_is_believed(monkeypatch: pytest.MonkeyPatch, answer: Answer, fault: str) -> None:
    """``min x`` with ``x >= 1/2``: wrong answers are refused, with what is wrong."""
    monkeypatch.setattr(linear_program, "_run", lambda *_: answer)
    program = np.ones(1), csr_matrix([[-1.0]]), np.array([-0.5]), np.zeros(1), np.ones(1)
    with pytest.raises(SolverError, match="neither yes nor no") as error:
        minimise(*program)
    assert fault in str(error.value)


def test_the_second_method_answers_where_the_first_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    run = linear_program._run
    asked = []

    def failing(*arguments) -> Answer:
        asked.append(arguments[-1])
        point, *rest = run(*arguments)
        return (point - 1 if len(asked) == 1 else point, *rest)

    monkeypatch.setattr(linear_program, "_run", failing)
    program = np.ones(1), csr_matrix([[-1.0]]), np.array([-0.5]), np.zeros(1), np.ones(1)
    found = minimise(*program)
    assert asked == ["simplex", "ipm"]
    assert isinstance(found, Minimum)
    assert found.value == pytest.approx(0.5, abs=1e-6)
