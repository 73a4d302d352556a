"""Volumes of hulls of contact wrenches, of many grasps at once.

Which triangles are faces of the convex hull of points, and which parallelograms are faces of a
sum of two triangles, is read off points that are moved a little, each in a direction of its own:
then no four of them are in a plane, and each face is found once. Volumes are those of the points as
they are. Where points are nearly in a plane another triangulation than theirs may be measured: what
that makes is a billionth of the size of the hull. Forces and torques are moved each in proportion
to themselves, so that nothing depends on how torques are scaled.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from regrasp_lp.friction import FloatArray
from regrasp_lp.quality.hulls import triples

_APART = 1e-9
"""Of the largest of each of their coordinates: by how much points are moved."""

_SIDES = ((0, 1, 2), (0, 2, 1), (1, 2, 0))
"""The two ends of each side of a triangle, and the corner that is not on it."""


def hull_volumes(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the volume of the convex hull of points, and that which it lacks to the origin.

    Parameters
    ----------
    points : numpy.ndarray, shape (N, r, 3)

    Returns
    -------
    volumes : numpy.ndarray, shape (N,)
    lacking : numpy.ndarray, shape (N,)
        By how much the volume grows if the origin is added to the points.
    """
    moved, corners = _moved(points), triples(points.shape[1])
    a, b, c = (moved[:, k] for k in corners.T)
    normals = np.cross(b - a, c - a)
    above = normals @ moved.transpose(0, 2, 1) - (normals * a).sum(axis=2)[..., None]
    own = np.zeros((len(corners), points.shape[1]), dtype=bool)
    own[np.arange(len(corners))[:, None], corners] = True
    outward = (np.where(own, -1.0, above) < 0).all(axis=2)
    inward = (np.where(own, 1.0, above) > 0).all(axis=2)
    a, b, c = (points[:, k] for k in corners.T)
    spanned = (np.cross(a, b) * c).sum(axis=2) / 6
    of_faces = np.where(outward, spanned, 0.0) - np.where(inward, spanned, 0.0)
    return of_faces.sum(axis=1), -np.minimum(of_faces, 0.0).sum(axis=1)


def sum_volumes(points: FloatArray) -> FloatArray:
    """Return the volume of the Minkowski sum of triangles ``(0, w⁺, w⁻)``.

    It is the sum of mixed volumes: of a triangle taken twice with another one, its area times the
    width of the other one across it; and of every three different ones.

    Parameters
    ----------
    points : numpy.ndarray, shape (N, 2 m, 3)
        The corners of the m triangles, two by two, without the origin.

    Returns
    -------
    numpy.ndarray, shape (N,)
    """
    total = np.zeros(len(points))
    across = np.cross(points[:, 0::2], points[:, 1::2])
    along = (across @ points.transpose(0, 2, 1)).reshape(len(points), across.shape[1], -1, 2)
    widths = np.maximum(along.max(axis=3), 0.0) - np.minimum(along.min(axis=3), 0.0)
    for i in range(across.shape[1]):
        total += np.delete(widths[:, i], i, axis=1).sum(axis=1) / 2
    shape = (len(points), -1, 3, 3)
    triangles = np.pad(points.reshape(len(points), -1, 2, 3), ((0, 0), (0, 0), (1, 0), (0, 0)))
    moved = _moved(triangles.reshape(len(points), -1, 3)).reshape(shape)
    for i, j, k in combinations(range(across.shape[1]), 3):
        total += _mixed(triangles[:, i], triangles[:, [j, k]], moved[:, [j, k]])
    return total


def _mixed(one: FloatArray, others: FloatArray, moved: FloatArray) -> FloatArray:
    """Six times the mixed volume of a triangle with two others.

    ``Σ h(d × d')`` over the parallelograms of sides d, d' that bound the sum of the two others: h
    is the support function of the first triangle, d × d' points outwards.
    """
    total = np.zeros(len(one))
    for a, b, far in _SIDES:
        for c, d, farther in _SIDES:
            seen = np.cross(moved[:, 0, b] - moved[:, 0, a], moved[:, 1, d] - moved[:, 1, c])
            below = ((moved[:, 0, far] - moved[:, 0, a]) * seen).sum(axis=1)
            lower = ((moved[:, 1, farther] - moved[:, 1, c]) * seen).sum(axis=1)
            normal = np.cross(others[:, 0, b] - others[:, 0, a], others[:, 1, d] - others[:, 1, c])
            height = (one * normal[:, None]).sum(axis=2)
            total += np.where((below < 0) & (lower < 0), height.max(axis=1), 0.0)
            total -= np.where((below > 0) & (lower > 0), height.min(axis=1), 0.0)
    return total


def _moved(points: FloatArray) -> FloatArray:
    """The points, each moved a little along a direction of its own."""
    ways = np.cos(np.outer(np.arange(1, points.shape[1] + 1), np.sqrt([2.0, 3.0, 5.0])))
    return np.asarray(points + _APART * np.abs(points).max(axis=1, keepdims=True) * ways)
