"""The margin LP, and the check of what a solver says of it."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.errors import OptionError, SolverError
from regrasp_lp.linear_sets import FloatArray, LinearSets
from regrasp_lp.lp.ladder import Account, Tried, attempts
from regrasp_lp.lp.solver import Solver

GAP = 1e-8
"""Largest accepted gap between the two bounds of a margin, relative to the rows' magnitude."""

_ROUNDING = 1e-10
"""Of their magnitude: by how much a point may break rows that have no margin."""

_STACK = 4000

_LOG = logging.getLogger("regrasp_lp")


@dataclass(frozen=True, eq=False)
class MarginSolutions:
    """Solutions of B margin LPs.

    Parameters
    ----------
    points : numpy.ndarray, shape (B, n)
        A best point, inside the box.
    margins : numpy.ndarray, shape (B,)
        Its margin, computed from the rows: a lower bound of the largest.
    bounds : numpy.ndarray, shape (B,)
        An upper bound of the largest margin, from the multipliers by weak duality.
    units : numpy.ndarray, shape (B,)
        What the gap is relative to: magnitude of the rows over the box, over their least scale if
        below 1.
    """

    points: FloatArray
    margins: FloatArray
    bounds: FloatArray
    units: FloatArray

    @property
    def solved(self) -> NDArray[np.bool_]:
        """Where the two bounds agree to `GAP`."""
        return np.asarray(self.gaps <= GAP)

    @property
    def gaps(self) -> FloatArray:
        """Distance of the two bounds, relative to `units`; inf where one is missing."""
        with np.errstate(invalid="ignore", over="ignore"):
            # Bounds that are the wrong way round by more than rounding prove nothing.
            gaps = np.abs(self.bounds - self.margins) / self.units
        return np.where(np.isnan(gaps), np.inf, gaps)

    @property
    def positive(self) -> NDArray[np.bool_]:
        """Where the largest margin is positive beyond what the gap leaves open."""
        return self.margins > GAP * self.units


def maximise_margins(
    sets: LinearSets, solver: Solver, progress: Callable[[int], None] | None = None
) -> MarginSolutions:
    """Solve the margin LP of every set of a stack.

    What the solver leaves with a gap above `GAP`, or fails on, is tried again: one by one, another
    way, by the other solver, and in rational numbers. A warning of the logger ``regrasp_lp`` says
    how many, and what solved them.

    Parameters
    ----------
    sets : LinearSets
        At least one row of each has a positive scale; rows of scale 0 leave a point of the box.
    solver : Solver
    progress : callable, optional
        Called with the number of LPs done, now and then.

    Returns
    -------
    MarginSolutions

    Raises
    ------
    OptionError
        If a number is not finite, a box is empty, or no row of a set has a positive scale.
    SolverError
        If some LP is still open; the message says what was tried, on how many, and the worst gap.

    Examples
    --------
    The largest ε with ``x + ε <= 2`` and ``1 - x + ε <= 0`` in the box from 0 to 4.

    >>> from regrasp_lp.lp.solver import get_solver
    >>> sets = LinearSets(
    ...     ("x",), np.array([[[1.0], [-1.0]]]), np.ones((1, 2)), np.array([[2.0, -1.0]]),
    ...     np.zeros((1, 1)), np.full((1, 1), 4.0))
    >>> found = maximise_margins(sets, get_solver("highs"))
    >>> found.margins.round(6).tolist(), found.points.round(6).tolist()
    ([0.5], [[1.5]])
    """
    _check(sets)
    parts = []
    for first in range(0, len(sets), _STACK):
        part = sets.take(np.arange(first, min(first + _STACK, len(sets))))
        parts.append(_solve_stack(part, solver))
        if progress is not None:
            progress(first + len(part))
    if not parts:
        empty = np.zeros(0)
        return MarginSolutions(np.zeros(sets.lower.shape), empty, empty, empty)
    fields = ("points", "margins", "bounds", "units")
    return MarginSolutions(*(np.concatenate([getattr(p, f) for p in parts]) for f in fields))


def _check(sets: LinearSets) -> None:
    """Raise OptionError where a margin LP is none."""
    if not (np.isfinite(sets.lower).all() and np.isfinite(sets.upper).all()):
        raise OptionError("a margin LP needs a bounded box: set lower and upper")
    finite = np.isfinite(sets.bounds) & np.isfinite(sets.rows).all(axis=2)
    conditions = (
        (finite.all(axis=1), "a number that is not finite"),
        ((sets.lower <= sets.upper).all(axis=1), "an empty box, lower > upper"),
        ((np.isfinite(sets.scales) & (sets.scales >= 0)).all(axis=1), "a scale that is not >= 0"),
        ((sets.scales > 0).any(axis=1), "no row of positive scale, so that no margin is largest"),
    )
    for good, fault in conditions:
        if not good.all():
            raise OptionError(f"margin LP {int(np.argmin(good))} of {len(sets)} has {fault}")


def _solve_stack(sets: LinearSets, solver: Solver) -> MarginSolutions:
    scaled, units = _scaled(sets)
    width = sets.upper - sets.lower
    account = Account(len(sets))
    solution, open_ = None, np.arange(len(sets))
    for attempt in attempts(solver):
        faults: Counter[str] = Counter()
        points, multipliers = attempt.ask(scaled.take(open_), faults)
        with np.errstate(all="ignore"):
            points = sets.lower[open_] + width[open_] * points
        found = enclose(sets.take(open_), points, multipliers, units[open_])
        solution = found if solution is None else _merge(solution, found, open_)
        left = open_[~solution.solved[open_]]
        worst = float(solution.gaps[left].max(initial=0.0))
        account.tried.append(Tried(attempt.label, len(open_), len(left), worst, faults))
        open_ = left
        if not open_.size:
            break
    if open_.size:
        raise SolverError(account.failed(GAP))
    if len(account.tried) > 1:
        _LOG.warning("%s", account.retried())
    assert solution is not None  # there is a first attempt
    return solution


def _scaled(sets: LinearSets) -> tuple[LinearSets, FloatArray]:
    """The sets in the unit box, with rows of magnitude 1, and the units of the gaps."""
    boxed = sets.in_unit_box()  # solvers have absolute tolerances
    units = np.maximum(
        np.abs(boxed.rows).max(axis=(1, 2), initial=0.0),
        np.abs(boxed.bounds).max(axis=1, initial=0.0),
    )
    units = np.where(units > 0, units, 1.0)
    scaled = replace(
        boxed, rows=boxed.rows / units[:, None, None], bounds=boxed.bounds / units[:, None]
    )
    # A rounding error in a row of small scale is a large one in the margin.
    least = np.where(sets.scales > 0, sets.scales, 1.0).min(axis=1, initial=1.0)
    return scaled, units / least


def _merge(
    solution: MarginSolutions, found: MarginSolutions, rows: NDArray[np.intp]
) -> MarginSolutions:
    """The better point and the better bound of two attempts at some of the LPs: both hold."""
    points, margins = solution.points.copy(), solution.margins.copy()
    bounds = solution.bounds.copy()
    better = rows[found.margins > margins[rows]]
    points[better] = found.points[found.margins > solution.margins[rows]]
    margins[better] = found.margins[found.margins > solution.margins[rows]]
    bounds[rows] = np.minimum(bounds[rows], found.bounds)
    return MarginSolutions(points, margins, bounds, solution.units)


def _rounded(sets: LinearSets) -> LinearSets:
    """The sets with rows of scale 0 moved out by a rounding: a vertex lies on them."""
    reach = (
        np.abs(sets.rows).sum(axis=2)
        * np.maximum(np.abs(sets.lower), np.abs(sets.upper)).max(axis=1, initial=0.0)[:, None]
    )
    rounding = _ROUNDING * np.maximum(reach, np.abs(sets.bounds))
    return replace(sets, bounds=sets.bounds + np.where(sets.scales > 0, 0.0, rounding))


def enclose(
    sets: LinearSets, points: FloatArray, multipliers: FloatArray, units: FloatArray
) -> MarginSolutions:
    """Turn a point and multipliers, however rough, into bounds of the largest margin.

    The point, moved into the box, has a margin. For multipliers ``y >= 0`` scaled to
    ``scales · y = 1`` and any x in the box, ``ε <= y · bounds - (rowsᵀ y) · x``; the largest value
    of the right side over the box is an upper bound, whatever the solver meant.

    Parameters
    ----------
    sets : LinearSets
    points : numpy.ndarray, shape (B, n)
    multipliers : numpy.ndarray, shape (B, R)
    units : numpy.ndarray, shape (B,)

    Returns
    -------
    MarginSolutions
        With bounds (-inf, inf) where the solver returned NaN.
    """
    finite = np.concatenate((np.isfinite(points), np.isfinite(multipliers)), axis=1)
    failed: NDArray[np.bool_] = ~np.all(finite, axis=1)
    middle = (sets.lower + sets.upper) / 2
    points = np.clip(np.where(failed[:, None], middle, points), sets.lower, sets.upper)
    y = np.maximum(np.where(failed[:, None], 1.0, multipliers), 0.0)
    with np.errstate(
        all="ignore"
    ):  # of garbage anything may overflow: what is no number is no bound
        y = y / y.max(axis=1, keepdims=True, initial=np.finfo(float).tiny)
        total = (y * sets.scales).sum(axis=1)
        y = y / total[:, None]
        gradient = np.einsum("br,brn->bn", y, sets.rows)
        over_box = np.maximum(-gradient * sets.lower, -gradient * sets.upper).sum(axis=1)
        bounds = (y * sets.bounds).sum(axis=1) + over_box
        margins = np.where(failed, -np.inf, _rounded(sets).margins(points))
    good = (total > 0) & ~failed & np.isfinite(bounds)
    return MarginSolutions(points, margins, np.where(good, bounds, np.inf), units)
