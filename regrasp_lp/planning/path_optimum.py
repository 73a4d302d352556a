"""The best contacts along a path: the least tolerance or margin, then the next, then travel."""

from __future__ import annotations

import logging

import numpy as np

from regrasp_lp.errors import SolverError
from regrasp_lp.friction import FloatArray
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver, maximise_margins
from regrasp_lp.lp.linear_program import minimise
from regrasp_lp.planning.path_lp import PathProblem

_LOG = logging.getLogger("regrasp_lp")

_KEEP = 1e-7
"""Part of a tolerance or margin that may be given up for the next aim, against rounding."""

_ROUNDING = 1e-10
"""By how much the simplex method may break a row, in the object's size."""

_PRICE = 1e-9
"""Multipliers of rows that limit the least tolerance are larger; they add up to 1."""

_SAME = 1e-6
"""Fractions closer than this along a stage are one."""


def solve_path_problem(
    problem: PathProblem, solver: str, *, leximin: bool = False
) -> list[FloatArray]:
    """Return the grasps of a path: largest least tolerance (then the next ...), least travel.

    Parameters
    ----------
    problem : PathProblem
    solver : {"clarabel", "highs"}
        For the least tolerance. What follows is solved by HiGHS: a vertex has no tiny slides.
    leximin : bool
        Whether, once the least tolerance is as large as it can be, the second least is made so,
        and so on, before travel counts.

    Returns
    -------
    list of numpy.ndarray, shape (P + 1, m)
        Fractions of the grasps of each stage.

    Raises
    ------
    SolverError
        If all ways to solve it failed.
    """
    if problem.n_variables == 0:
        return problem.grasps(np.zeros(0))
    best = largest_tolerance(problem, solver)
    tolerance = problem.tolerance(best)
    levels = np.where(problem.scales > 0, tolerance, 0.0)
    if leximin and np.isfinite(tolerance):
        levels = _leximin(problem, tolerance)
    try:
        short = _shortest(problem, levels - _KEEP * np.abs(levels))
    except SolverError as error:
        _LOG.warning("travel is not minimised: %s", error)
        short = None
    found = [] if short is None else [merged(problem, short), short]
    enough = (levels - 4 * _KEEP * np.abs(levels)) * problem.scales
    for x in (*found, merged(problem, best)):
        if (problem.bounds - problem.rows @ x >= enough - _ROUNDING).all():
            return problem.grasps(x)
    return problem.grasps(best)


def largest_tolerance(problem: PathProblem, solver: str) -> FloatArray:
    """Return variables that maximise the least tolerance: the path LP is a margin LP.

    Raises
    ------
    SolverError
        If all ways to solve it failed.
    """
    n = problem.n_variables
    if not (problem.scales > 0).any():
        return np.full(n, 0.5)
    names = tuple(f"x{i}" for i in range(n))
    one = LinearSets(
        names,
        problem.rows.toarray()[None],
        problem.scales[None],
        problem.bounds[None],
        np.zeros((1, n)),
        np.ones((1, n)),
    )
    points: FloatArray = maximise_margins(one, get_solver(solver)).points[0]
    return points


def _leximin(problem: PathProblem, tolerance: float) -> FloatArray:
    """The tolerance that each row leaves when the least is largest, then the second least, ...

    A grasp whose rows have a price, once the least is as large as it can be, cannot have more: its
    tolerance is fixed, and that of the others raised further.
    """
    from scipy import sparse

    open_ = problem.scales > 0
    levels = np.where(open_, tolerance, 0.0)
    cost = np.append(np.zeros(problem.n_variables), -1.0)
    lower = np.append(np.zeros(problem.n_variables), min(tolerance, 0.0) - 1.0)
    upper = np.append(np.ones(problem.n_variables), 1.0)
    while open_.any():
        column = np.where(open_, problem.scales, 0.0)
        last = sparse.csr_matrix(column[:, None])
        rows = sparse.csr_matrix(sparse.hstack([problem.rows, last]))
        kept = levels - _KEEP * np.abs(levels)
        bounds = problem.bounds - np.where(open_, 0.0, kept * problem.scales)
        found = minimise(cost, rows, bounds, lower, upper)
        if found is None:  # what is kept is feasible, but for rounding
            break
        levels[open_] = max(float(found.point[-1]), tolerance)
        price = found.multipliers * column
        fixed = open_ & np.isin(problem.owners, problem.owners[price > _PRICE])
        if not fixed.any():
            break
        open_ &= ~fixed
    return levels


def _shortest(problem: PathProblem, levels: FloatArray) -> FloatArray | None:
    """Variables of least travel that keep the tolerance of each row; None if rounding forbids."""
    from scipy import sparse

    n, moves = problem.n_variables, problem.moves.shape[0]
    eye = sparse.csr_matrix(sparse.identity(moves))
    none = sparse.csr_matrix((len(problem.bounds), moves))
    blocks = [
        sparse.hstack([problem.rows, none]),
        sparse.hstack([problem.moves, -eye]),
        sparse.hstack([-problem.moves, -eye]),
    ]
    rows = sparse.csr_matrix(sparse.vstack(blocks))
    bounds = np.concatenate(
        (problem.bounds - levels * problem.scales, -problem.offsets, problem.offsets)
    )
    cost = np.concatenate((np.zeros(n), np.ones(moves)))
    upper = np.concatenate((np.ones(n), np.full(moves, 4.0)))
    found = minimise(cost, rows, bounds, np.zeros(n + moves), upper)
    return None if found is None else found.point[:n]


def merged(problem: PathProblem, x: FloatArray) -> FloatArray:
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
