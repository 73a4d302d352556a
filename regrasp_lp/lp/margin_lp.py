"""The margin LP, the check of what a solver says of it, and the choice of a solver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.errors import OptionError, SolverError
from regrasp_lp.linear_sets import FloatArray, LinearSets

GAP = 1e-8
"""Largest accepted gap between the two bounds of a margin, relative to the rows' magnitude."""

_STACK = 4000


class Solver(Protocol):
    """A linear programming code, as a value.

    `solve` returns for a stack of B sets in the unit box, with rows of magnitude 1, a point (B, n)
    and multipliers (B, R) of the rows, as good as it could; how good they are is found out by the
    caller. `thorough` asks for another, slower way.
    """

    @property
    def name(self) -> str:
        """Its name in the public interface."""

    def solve(self, sets: LinearSets, *, thorough: bool) -> tuple[FloatArray, FloatArray]:
        """Return points (B, n) and row multipliers (B, R); NaN where the solver failed."""


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
        with np.errstate(invalid="ignore"):
            return np.asarray(self.bounds - self.margins <= GAP * self.units)

    @property
    def positive(self) -> NDArray[np.bool_]:
        """Where the largest margin is positive beyond what the gap leaves open."""
        return self.margins > GAP * self.units


def get_solver(name: str) -> Solver:
    """Return a solver by its public name, "clarabel" or "highs".

    Raises
    ------
    OptionError
        If there is no such solver.
    """
    if name == "clarabel":
        from regrasp_lp.lp.clarabel_solver import ClarabelSolver

        return ClarabelSolver()
    if name == "highs":
        from regrasp_lp.lp.highs_solver import HighsSolver

        return HighsSolver()
    raise OptionError(f'solver must be "clarabel" or "highs", got {name!r}')


def maximise_margins(
    sets: LinearSets, solver: Solver, progress: Callable[[int], None] | None = None
) -> MarginSolutions:
    """Solve the margin LP of every set of a stack.

    What the solver leaves with a gap above `GAP` is tried again thoroughly.

    Parameters
    ----------
    sets : LinearSets
        At least one row of each has a positive scale.
    solver : Solver
    progress : callable, optional
        Called with the number of LPs done, now and then.

    Returns
    -------
    MarginSolutions

    Raises
    ------
    OptionError
        If a box is not bounded.
    SolverError
        If some LP is still open; the message says how many, and the worst gap.
    """
    if not (np.isfinite(sets.lower).all() and np.isfinite(sets.upper).all()):
        raise OptionError("a margin LP needs a bounded box: set lower and upper")
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


def _solve_stack(sets: LinearSets, solver: Solver) -> MarginSolutions:
    width = sets.upper - sets.lower
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
    units = units / least

    def solve(rows: NDArray[np.intp], *, thorough: bool) -> MarginSolutions:
        points, multipliers = solver.solve(scaled.take(rows), thorough=thorough)
        points = sets.lower[rows] + width[rows] * points
        return enclose(sets.take(rows), points, multipliers, units[rows])

    solution = solve(np.arange(len(sets)), thorough=False)
    open_ = np.flatnonzero(~solution.solved)
    if not open_.size:
        return solution
    again = solve(open_, thorough=True)
    if not again.solved.all():
        gap = np.nanmax(np.where(again.solved, 0, (again.bounds - again.margins) / again.units))
        raise SolverError(
            f"{solver.name} left {np.count_nonzero(~again.solved)} of {len(sets)} margin LPs open "
            f"(worst relative gap {gap:.1e}, accepted {GAP:.0e}): this is neither yes nor no; "
            "try the other solver"
        )
    merged = {}
    for field in ("points", "margins", "bounds"):
        merged[field] = getattr(solution, field).copy()
        merged[field][open_] = getattr(again, field)
    return MarginSolutions(merged["points"], merged["margins"], merged["bounds"], units)


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
    total = (y * sets.scales).sum(axis=1)
    ok = total > 0
    y = y / np.where(ok, total, 1.0)[:, None]
    gradient = np.einsum("br,brn->bn", y, sets.rows)
    over_box = np.maximum(-gradient * sets.lower, -gradient * sets.upper).sum(axis=1)
    bounds = np.where(ok & ~failed, (y * sets.bounds).sum(axis=1) + over_box, np.inf)
    margins = np.where(failed, -np.inf, sets.margins(points))
    return MarginSolutions(points, margins, bounds, units)
