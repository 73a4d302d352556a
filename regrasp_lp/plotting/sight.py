"""How far one sees from a contact: the part of a cone from its apex to where material ends."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from regrasp_lp.circuits import cross
from regrasp_lp.friction import FloatArray
from regrasp_lp.polygon import Polygon

_NEAR = 1e-9  # of the object's diameter: corners are as good as one, an edge is at the apex itself


def visible_part(polygon: Polygon, apex: FloatArray, rays: FloatArray) -> FloatArray:
    """Return the part of a cone that is seen from its apex through material.

    Each direction of the cone counts from the apex, on the boundary, to where it first leaves the
    object: what lies behind a hole or a notch is left out. The directions to vertices cut the
    cone into sectors in each of which one edge is seen.

    Parameters
    ----------
    polygon : Polygon
    apex : numpy.ndarray, shape (2,)
        A contact.
    rays : numpy.ndarray, shape (2, 2)
        The clockwise and the counter-clockwise boundary of the cone, less than a half turn apart.

    Returns
    -------
    numpy.ndarray, shape (K, 2)
        The corners, counter-clockwise from the apex. Where a sector leads out of the object at
        once, at a vertex, they return to the apex.

    Examples
    --------
    >>> square = Polygon([(0, 0), (2, 0), (2, 2), (0, 2)])
    >>> cone = np.array([(0.5, 1.0), (-0.5, 1.0)])
    >>> print(visible_part(square, np.array([1.0, 0.0]), cone))
    [[1. 0.]
     [2. 2.]
     [0. 2.]]
    """
    starts, ends = polygon.edge_starts - apex, polygon.edge_ends - apex
    vertices = starts[(cross(rays[0], starts) > 0) & (cross(starts, rays[1]) > 0)]
    ahead = _units(rays).sum(axis=0)
    # all less than a quarter turn from the middle: the tangents are in the order of the angles
    order = np.argsort(cross(ahead, vertices) / (vertices @ ahead), kind="stable")
    directions = _units(np.vstack([rays[:1], vertices[order], rays[1:]]))
    near = _NEAR * polygon.diameter
    seen = _seen_edges(starts, ends, directions, near)
    ring = [np.zeros(2)]
    for edge, first, last in zip(seen, directions[:-1], directions[1:], strict=True):
        if edge is None:
            ring.append(np.zeros(2))
        else:
            ring += [_met(starts[edge], ends[edge], ray) for ray in (first, last)]
    kept = [ring[0], *(q for p, q in pairwise(ring) if np.abs(p - q).max() > near)]
    return np.asarray(apex + np.array(kept))


def _units(vectors: FloatArray) -> FloatArray:
    """Return vectors (n, 2) with a length of 1."""
    return np.asarray(vectors / np.hypot(*vectors.T)[:, None])


def _seen_edges(
    starts: FloatArray, ends: FloatArray, directions: FloatArray, near: float
) -> list[int | None]:
    """The edge seen from 0 between each direction and the next; None if that is no material."""
    middles = _units(directions[:-1] + directions[1:])[:, None]
    left, right = cross(middles, starts), cross(middles, ends)
    with np.errstate(divide="ignore", invalid="ignore"):
        distances = cross(starts, ends) / cross(middles, ends - starts)
    met = (left * right < 0) & (distances > near)
    nearest = np.where(met, distances, np.inf).argmin(axis=1).tolist()
    # from within material one meets its boundary an odd number of times
    inside = (met.sum(axis=1) % 2 == 1).tolist()
    return [edge if odd else None for edge, odd in zip(nearest, inside, strict=True)]


def _met(start: FloatArray, end: FloatArray, direction: FloatArray) -> FloatArray:
    """Where a ray from 0 meets a segment; its end, if rounding says that it passes by."""
    across = float(cross(direction, end - start))
    part = float(np.clip(-cross(direction, start) / across, 0.0, 1.0)) if across else 0.0
    return np.asarray(start + part * (end - start))
