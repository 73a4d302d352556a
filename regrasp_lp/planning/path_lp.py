"""Contacts along a path: one linear program over a chain of convex pieces.

A path of grasp sets is a chain of *stages*, one a set. In each the hand slides from an arriving
grasp through the overlaps of pieces to a leaving grasp; across a switch the held contacts are
equal. All of these grasps are variables, but for the start and the goal. The least tolerance is
maximised; then, holding it, the travel ``Σ |u' - u|`` is minimised.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regrasp_lp.errors import SolverError
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.grasp_sets.pieces import piece_sets
from regrasp_lp.lp.solver import NAMES
from regrasp_lp.torque import TorqueFunctions

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

_LOG = logging.getLogger("regrasp_lp")

_KEEP = 1e-6
"""Part of the tolerance that may be given up for travel, against rounding."""

_SAME = 1e-6
"""Fractions closer than this along a stage are one."""


@dataclass(frozen=True, eq=False)
class Stage:
    """One set of a path: pieces to slide through, one after the other.

    Parameters
    ----------
    functions : TorqueFunctions
        Of the set.
    pieces : numpy.ndarray of int, shape (P, 3)
        Consecutive pieces (0, j, k), overlapping; there are P + 1 grasps, the first and the last
        in one piece, those between in two.
    """

    functions: TorqueFunctions
    pieces: IntArray


@dataclass(frozen=True, eq=False)
class PathProblem:
    """The path LP as arrays: ``A x + δ s <= b`` with ``0 <= x <= 1``, and travel ``|W x + w|``.

    Parameters
    ----------
    variables : list of numpy.ndarray of int
        Per stage, shape (P + 1, m): which variable a contact is, or -1 where it is given.
    given : list of numpy.ndarray, shape (P + 1, m)
        The given fractions, NaN elsewhere.
    rows, bounds, scales
        A, b and s, in the unit of the object's size.
    moves, offsets
        W and w.
    """

    variables: list[IntArray]
    given: list[FloatArray]
    rows: csr_matrix
    bounds: FloatArray
    scales: FloatArray
    moves: csr_matrix
    offsets: FloatArray

    def grasps(self, x: FloatArray) -> list[FloatArray]:
        """Return the fractions of all grasps, per stage, for values of the variables."""
        padded = np.append(x, np.nan)
        return [
            np.where(ids >= 0, padded[ids], given)
            for ids, given in zip(self.variables, self.given, strict=True)
        ]

    def tolerance(self, x: FloatArray) -> float:
        """Return the least tolerance that the rows leave at x, in the object's size."""
        return float(np.min((self.bounds - self.rows @ x) / self.scales, initial=np.inf))


def build_path_problem(
    stages: Sequence[Stage],
    held: Sequence[Sequence[tuple[int, int]]],
    start: FloatArray,
    goal: FloatArray,
) -> PathProblem:
    """Return the path LP of a chain of stages.

    Parameters
    ----------
    stages : sequence of Stage
    held : sequence of sequence of (int, int)
        Per switch the held contacts, as places in the two sets.
    start, goal : numpy.ndarray, shape (m,)
        Fractions of the first and the last grasp.

    Returns
    -------
    PathProblem
    """
    variables, given = _number(stages, held, start, goal)
    count = max((int(ids.max()) for ids in variables), default=-1) + 1
    size = stages[0].functions.cones.size
    builder = _Rows(count)
    travel = _Rows(count)
    for stage, ids, fixed in zip(stages, variables, given, strict=True):
        last = len(ids) - 1
        nodes = [(n, p) for n in range(last + 1) for p in (n - 1, n) if 0 <= p < last]
        nodes = [(n, p) for n, p in nodes if (ids[n] >= 0).all()]
        names = [f"f{i}" for i in range(ids.shape[1])]
        pieces = stage.pieces[[p for _, p in nodes]].reshape(-1, 3)
        sets = piece_sets(stage.functions, pieces, names, measure="tolerance", apart=2.0)
        for i, (node, _) in enumerate(nodes):
            used = sets.scales[i] > 0
            for row, bound, scale in zip(
                sets.rows[i][used], sets.bounds[i][used], sets.scales[i][used], strict=True
            ):
                builder.add(ids[node], row / size, bound / size, scale)
        lengths = stage.functions.lengths[0] / size
        for node in range(last):
            for slot, length in enumerate(lengths):
                pair = [node, node + 1]
                weight = length * np.array([-1.0, 1.0])
                known = np.where(ids[pair, slot] < 0, fixed[pair, slot], 0.0)
                travel.add(ids[pair, slot], weight, float(weight @ known), 1.0)
    return PathProblem(
        variables,
        given,
        builder.matrix(),
        np.array(builder.bounds),
        np.array(builder.scales),
        travel.matrix(),
        np.array(travel.bounds),
    )


def solve_path_problem(problem: PathProblem, solver: str) -> list[FloatArray]:
    """Return the grasps of a path: largest least tolerance, then least travel.

    Parameters
    ----------
    problem : PathProblem
    solver : {"clarabel", "highs"}
        For the tolerance. Travel is always minimised by HiGHS: a vertex has no tiny slides.

    Returns
    -------
    list of numpy.ndarray, shape (P + 1, m)
        Fractions of the grasps of each stage.

    Raises
    ------
    SolverError
        If both solvers failed.
    """
    import cvxpy as cp

    count = problem.rows.shape[1]
    if count == 0:
        return problem.grasps(np.zeros(0))
    x, delta = cp.Variable(count), cp.Variable()
    box = [x >= 0, x <= 1]
    inside = [problem.rows @ x + delta * problem.scales <= problem.bounds]
    _solve(cp.Problem(cp.Maximize(delta), inside + box), solver)
    best = np.clip(np.asarray(x.value), 0.0, 1.0)
    tolerance = problem.tolerance(best)
    kept = tolerance - _KEEP * abs(tolerance)
    inside = [problem.rows @ x <= problem.bounds - kept * problem.scales]
    travel = cp.Minimize(cp.norm1(problem.moves @ x + problem.offsets))
    _solve(cp.Problem(travel, inside + box), "highs")
    short = _merge(problem, np.clip(np.asarray(x.value), 0.0, 1.0))
    if problem.tolerance(short) >= tolerance - 1e-3 * abs(tolerance):
        best = short
    return problem.grasps(_merge(problem, best))


def _solve(problem: object, solver: str) -> None:
    """Solve by one solver, or by the other one where that fails."""
    import cvxpy as cp

    assert isinstance(problem, cp.Problem)
    failures = []
    for name in dict.fromkeys((solver, *NAMES)):
        options = {}
        if name == "highs":
            options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
        try:
            problem.solve(solver=cp.CLARABEL if name == "clarabel" else cp.HIGHS, **options)
        except (KeyboardInterrupt, SystemExit, GeneratorExit):
            raise
        except BaseException as error:  # a panic of a solver written in Rust is no Exception
            failures.append(f"{name} raised {type(error).__name__}: {error}")
            continue
        if problem.status == cp.OPTIMAL:
            if failures:
                _LOG.warning("path LP solved by %s: %s", name, "; ".join(failures))
            return
        failures.append(f"{name} stopped with status {problem.status!r}")
    raise SolverError(f"the path LP is open, neither yes nor no: {'; '.join(failures)}")


def _merge(problem: PathProblem, x: FloatArray) -> FloatArray:
    """Make fractions equal that follow each other along a stage and differ by rounding.

    From the goal backwards and then from the start forwards, so that whole runs become one.
    """
    x = x.copy()

    def follow(leader: int, follower: int, given: float) -> None:
        value = x[leader] if leader >= 0 else given
        if follower >= 0 and abs(value - x[follower]) <= _SAME:
            x[follower] = value

    runs = [
        (ids[node, slot], ids[node + 1, slot], given[node, slot], given[node + 1, slot])
        for ids, given in zip(problem.variables, problem.given, strict=True)
        for node in range(len(ids) - 1)
        for slot in range(ids.shape[1])
    ]
    for now, after, _, fixed in reversed(runs):
        follow(after, now, fixed)
    for now, after, fixed, _ in runs:
        follow(now, after, fixed)
    return x


def _number(
    stages: Sequence[Stage],
    held: Sequence[Sequence[tuple[int, int]]],
    start: FloatArray,
    goal: FloatArray,
) -> tuple[list[IntArray], list[FloatArray]]:
    """Number the variables; held contacts are one variable on both sides of a switch."""
    variables: list[IntArray] = []
    given: list[FloatArray] = []
    count = 0
    for t, stage in enumerate(stages):
        shape = (len(stage.pieces) + 1, stage.functions.m)
        ids = np.full(shape, -2)
        fixed = np.full(shape, np.nan)
        if t == 0:
            ids[0], fixed[0] = -1, start
        else:
            for here, there in held[t - 1]:
                ids[0, there] = variables[-1][-1, here]
        if t == len(stages) - 1:
            ids[-1], fixed[-1] = -1, goal
        new = ids == -2
        ids[new] = count + np.arange(new.sum())
        count += int(new.sum())
        variables.append(ids)
        given.append(fixed)
    return variables, given


class _Rows:
    """Collects sparse rows; columns of -1 are left out."""

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self.bounds: list[float] = []
        self.scales: list[float] = []
        self._row: list[int] = []
        self._column: list[int] = []
        self._value: list[float] = []

    def add(self, columns: IntArray, values: FloatArray, bound: float, scale: float) -> None:
        """Add one row."""
        for column, value in zip(columns.tolist(), values.tolist(), strict=True):
            if column >= 0 and value != 0:
                self._row.append(len(self.bounds))
                self._column.append(column)
                self._value.append(value)
        self.bounds.append(bound)
        self.scales.append(scale)

    def matrix(self) -> csr_matrix:
        """Return all rows."""
        from scipy import sparse

        return sparse.csr_matrix(
            (self._value, (self._row, self._column)), shape=(len(self.bounds), self.columns)
        )
