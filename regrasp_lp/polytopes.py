"""Corners of bounded linear sets, for pictures and for projections."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection

from regrasp_lp.errors import OptionError
from regrasp_lp.linear_sets import FloatArray, LinearSets
from regrasp_lp.lp import get_solver, maximise_margins

_FLAT = 1e-9
"""Sets thinner than this part of their box have no corners."""


def corners(sets: LinearSets) -> list[FloatArray]:
    """Return the corners of each set of a stack, without regard to margins.

    Parameters
    ----------
    sets : LinearSets
        Over two or three coordinates, in boxes that are bounded.

    Returns
    -------
    list of numpy.ndarray, shape (K, n)
        In the plane counter-clockwise. Empty where the set has no interior.

    Raises
    ------
    OptionError
        If a box is not bounded.

    Examples
    --------
    >>> half = LinearSets(("x", "y"), np.array([[[1.0, 1.0]]]), np.ones((1, 1)), np.ones((1, 1)),
    ...                   np.zeros((1, 2)), np.ones((1, 2)))
    >>> corners(half)[0].round(6).tolist()
    [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    """
    if not len(sets):
        return []
    if not (np.isfinite(sets.lower).all() and np.isfinite(sets.upper).all()):
        raise OptionError("corners are those of sets in a bounded box: join them with one")
    unit = sets.upper - sets.lower
    halfspaces = _halfspaces(sets.in_unit_box())
    void = np.abs(halfspaces.rows).max(axis=2) == 0
    empty = (unit <= 0).any(axis=1) | (void & (halfspaces.bounds < 0)).any(axis=1)
    found = [np.zeros((0, len(sets.names)))] * len(sets)
    kept = np.flatnonzero(~empty)
    solutions = maximise_margins(halfspaces.take(kept), get_solver("highs"))
    for k, margin, inside in zip(kept, solutions.margins, solutions.points, strict=True):
        if margin > _FLAT:
            rows = np.column_stack((halfspaces.rows[k], -halfspaces.bounds[k]))[~void[k]]
            points = _apart(HalfspaceIntersection(rows, inside).intersections)
            hull = ConvexHull(points)
            found[k] = np.clip(points[_first(hull)], 0.0, 1.0) * unit[k] + sets.lower[k]
    return found


def _halfspaces(sets: LinearSets) -> LinearSets:
    """Rows of length 1, and those of the unit box among them."""
    b, n = sets.lower.shape
    length = np.linalg.norm(sets.rows, axis=2)
    length = np.where(length > 0, length, 1.0)
    box = np.tile(np.concatenate((np.eye(n), -np.eye(n))), (b, 1, 1))
    limits = np.tile(np.concatenate((np.ones(n), np.zeros(n))), (b, 1))
    rows = np.concatenate((sets.rows / length[..., None], box), axis=1)
    scales = np.where(np.abs(rows).max(axis=2) > 0, 1.0, 0.0)
    bounds = np.concatenate((sets.bounds / length, limits), axis=1)
    return LinearSets(sets.names, rows, scales, bounds, sets.lower, sets.upper)


def _apart(points: FloatArray) -> FloatArray:
    """The points but those that rounding alone tells from an earlier one."""
    near = np.abs(points[:, None] - points[None, :]).max(axis=2) < _FLAT
    return np.asarray(points[~np.tril(near, -1).any(axis=1)])


def _first(hull: ConvexHull) -> NDArray[np.intp]:
    """The corners of a hull; of a polygon counter-clockwise from its leftmost corner."""
    order = np.asarray(hull.vertices, dtype=np.intp)
    if hull.points.shape[1] > 2:
        return order
    return np.roll(order, -int(np.lexsort(hull.points[order].round(9).T[::-1])[0]))
