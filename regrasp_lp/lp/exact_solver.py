"""The simplex method in rational numbers: slow, certain, the last resort."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.linear_sets import FloatArray, LinearSets

ObjectArray = NDArray[np.object_]

_TIGHTER = Fraction(1, 2**40)


@dataclass(frozen=True)
class ExactSolver:
    """Margin LPs by the simplex method in rational numbers, one after the other.

    It works on the dual

        min  y · bounds + z · (upper - lower)   s.t.   rowsᵀ y + z - t = 0 ,  scales · y = 1

    over ``y, z, t >= 0`` (bounds are those of ``x - lower``), of which a first basis can be
    written down: one row of positive scale. By the rule of Bland it cannot cycle, so it ends, and
    nothing is ever rounded but the answer. Rows of scale 0 are made stricter by 2⁻⁴⁰ of their
    magnitude if that leaves something, for a rounded point must not violate them at all.
    """

    name: str = "exact"

    def solve(self, sets: LinearSets, *, thorough: bool) -> tuple[FloatArray, FloatArray]:
        """Return points and row multipliers; NaN where there is no optimum."""
        b, r, n = sets.rows.shape
        points, multipliers = np.full((b, n), np.nan), np.full((b, r), np.nan)
        for i in range(b):
            found = _solve_one(sets[i], _TIGHTER) or _solve_one(sets[i], Fraction(0))
            if found is not None:
                points[i], multipliers[i] = found
        return points, multipliers


def _solve_one(sets: LinearSets, stricter: Fraction) -> tuple[ObjectArray, ObjectArray] | None:
    """The point and the multipliers of the optimum; None if there is none."""
    rows, scales = _fractions(sets.rows[0]), _fractions(sets.scales[0])
    lower, upper = _fractions(sets.lower[0]), _fractions(sets.upper[0])
    bounds = _fractions(sets.bounds[0]) - rows.dot(lower)
    size = abs(rows).sum(axis=1) + abs(bounds)
    unscaled = np.flatnonzero(sets.scales[0] == 0)
    bounds[unscaled] = bounds[unscaled] - stricter * size[unscaled]
    if not (sets.scales[0] > 0).any() or (upper < lower).any():
        return None
    found = exact_optimum(rows, scales, bounds, upper - lower)
    return None if found is None else (lower + found[0], found[1])


def exact_optimum(
    rows: ObjectArray, scales: ObjectArray, bounds: ObjectArray, upper: ObjectArray
) -> tuple[ObjectArray, ObjectArray] | None:
    """Solve ``max ε  s.t.  rows x + scales ε <= bounds, 0 <= x <= upper`` in rational numbers.

    Parameters
    ----------
    rows : numpy.ndarray of object (Fraction), shape (R, n)
    scales, bounds : numpy.ndarray of object (Fraction), shape (R,)
        At least one scale is positive.
    upper : numpy.ndarray of object (Fraction), shape (n,)

    Returns
    -------
    point, multipliers : numpy.ndarray of object (Fraction), shapes (n,) and (R,)
        Or None if rows of scale 0 contradict each other.

    Examples
    --------
    >>> rows, ones = np.array([[Fraction(1)], [Fraction(-1)]]), np.array([Fraction(1)] * 2)
    >>> exact_optimum(rows, ones, np.array([Fraction(1), Fraction(0)]), ones[:1])[0]
    array([Fraction(1, 2)], dtype=object)
    """
    r, n = rows.shape
    start = int(np.flatnonzero(scales > 0)[0])
    costs = np.concatenate((bounds, upper, _fractions(np.zeros(n + 1))))
    table = _first_table(rows, scales, start)
    basis = np.array([r + i if table[i, r + i] == 1 else r + n + i for i in range(n)])
    basis = np.append(basis, start)
    reduced = costs - costs[basis].dot(table)
    while (entering := np.flatnonzero(reduced[:-1] < 0)).size:
        column = int(entering[0])
        limits = np.flatnonzero(table[:, column] > 0)
        if not limits.size:
            return None  # without a lower bound: rows of scale 0 contradict each other
        ratios = table[limits, -1] / table[limits, column]
        tied = limits[ratios == ratios.min()]
        row = int(tied[basis[tied].argmin()])
        table[row] = table[row] / table[row, column]
        for other in np.flatnonzero(table[:, column]):
            if other != row:
                table[other] = table[other] - table[other, column] * table[row]
        reduced = reduced - reduced[column] * table[row]
        basis[row] = column
    multipliers = _fractions(np.zeros(r + 2 * n))
    multipliers[basis] = table[:, -1]
    # The reduced cost of t is the multiplier of its row, a coordinate of the point.
    return reduced[r + n : r + 2 * n], multipliers[:r]


def _first_table(rows: ObjectArray, scales: ObjectArray, start: int) -> ObjectArray:
    """The table over (y, z, t) and the right side, with the basis of y at `start` and z or t."""
    r, n = rows.shape
    table = _fractions(np.zeros((n + 1, r + 2 * n + 1)))
    table[:n, :r], table[n, :r], table[n, -1] = rows.T, scales, Fraction(1)
    every = np.arange(n)
    table[every, r + every], table[every, r + n + every] = Fraction(1), Fraction(-1)
    table[n] = table[n] / scales[start]
    for i in range(n):
        table[i] = table[i] - rows[start, i] * table[n]
        if table[i, -1] < 0:
            table[i] = -table[i]
    return table


def _fractions(values: FloatArray) -> ObjectArray:
    """The doubles as the rationals they are."""
    result: ObjectArray = np.empty(values.shape, dtype=object)
    result.ravel()[:] = [Fraction(float(v)) for v in values.ravel()]
    return result
