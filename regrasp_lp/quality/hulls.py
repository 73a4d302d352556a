"""Hulls of contact wrenches in space, of many grasps at once, by the planes that may bound them.

A force with unit normal component along boundary ray k of contact i, ``e = n_i ± μ_i t_i``, has the
*primitive wrench* ``w = (e, (p_i - c) × e / ρ)``: c is the centroid, and the torque scale ρ, a
length, turns torques into forces. Two hulls are known, of the wrenches that contacts can exert

- ``"sum"`` (L1): with normal forces that sum to 1, the convex hull of the primitive wrenches;
- ``"each"`` (L∞): with normal forces of at most 1 each, the Minkowski sum of the triangles
  ``(0, w_i⁺, w_i⁻)``.

A hull K is known by its support function ``h(y) = max_{x in K} y·x``. The origin is at distance
``min h(y)`` over unit y from the boundary, negative outside (then the distance to K, by duality),
and that minimum is attained at the normal of a face. Each normal is a cross product of two edge
directions, so all that may be are listed. Those that are none do no harm: ``h(y)`` is never below
the minimum. No face has to be recognised.
"""

from __future__ import annotations

from itertools import combinations
from numbers import Real
from typing import Literal, get_args

import numpy as np

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.polygon import Polygon
from regrasp_lp.quality.grasps import Grasps

Forces = Literal["sum", "each"]
"""What is bounded by 1: the sum of the normal forces, or each of them."""

TorqueScale = Literal["gyration", "distance"] | float
"""The length by which torques are divided, or which one of the object it is."""

_FLAT = 1e-12
"""Directions whose cross product is shorter than this part of theirs have none."""


def scale_of(polygon: Polygon, scale: TorqueScale = "gyration") -> float:
    """Return the length ρ by which torques about the centroid are divided.

    Parameters
    ----------
    polygon : Polygon
    scale : {"gyration", "distance"} or float
        The radius of gyration of the object's area about its centroid, ``ρ² = ∫ |x - c|² dA / A``:
        then forces and torques are scaled as an impulse moves a body of even thickness. Or the
        largest distance of the boundary from the centroid: then no unit force has a torque larger
        than 1. Or a length.

    Returns
    -------
    float
        In the polygon's unit.

    Raises
    ------
    OptionError
        If the scale is none of these, or not positive and finite.

    Examples
    --------
    >>> square = Polygon([(0, 0), (6, 0), (6, 6), (0, 6)])
    >>> [round(scale_of(square, scale), 6) for scale in ("gyration", "distance", 2)]
    [2.44949, 4.242641, 2.0]
    """
    if isinstance(scale, str):
        size = polygon.diameter  # so that squares neither overflow nor vanish
        starts = (polygon.edge_starts - polygon.centroid) / size
        ends = (polygon.edge_ends - polygon.centroid) / size
        if scale == "distance":
            return size * float(np.hypot(starts[:, 0], starts[:, 1]).max())
        if scale == "gyration":
            turn = starts[:, 0] * ends[:, 1] - starts[:, 1] * ends[:, 0]
            squares = (starts**2 + starts * ends + ends**2).sum(axis=1)
            return size * float(np.sqrt((turn * squares).sum() / (6 * turn.sum())))
    elif isinstance(scale, Real) and not isinstance(scale, bool) and 0 < scale < np.inf:
        return float(scale)
    raise OptionError(
        f'torque_scale must be "gyration", "distance" or a positive length, got {scale!r}'
    )


def check_forces(forces: object) -> None:
    """Raise OptionError if `forces` is no bound on forces."""
    if forces not in get_args(Forces):
        raise OptionError(
            'forces must be "sum" (normal forces of 1 in all) or "each" (of at most 1 each), '
            f"got {forces!r}"
        )


def wrenches_of(grasps: Grasps, scale: float) -> FloatArray:
    """Return the primitive wrenches of grasps, contact by contact, shape (N, 2 m, 3)."""
    slide = grasps.friction[..., None] * np.array([1.0, -1.0])
    force = grasps.normals[:, :, None] + slide[..., None] * grasps.tangents[:, :, None]
    arm = grasps.points[:, :, None] / scale
    torque = arm[..., 0] * force[..., 1] - arm[..., 1] * force[..., 0]
    both = np.concatenate((force, torque[..., None]), axis=3)
    return np.asarray(both.reshape(len(grasps), 2 * grasps.m, 3))


# --- distances and loads ------------------------------------------------------------------------


def distances(wrenches: FloatArray, forces: Forces) -> FloatArray:
    """Return how far inside a hull the origin is; negative outside.

    Parameters
    ----------
    wrenches : numpy.ndarray, shape (N, 2 m, 3)
        The primitive wrenches.
    forces : {"sum", "each"}
        The hull of ``"each"`` has the origin in it, so that the distance is never negative.

    Returns
    -------
    numpy.ndarray, shape (N,)
        ``min over unit y of h(y)``: distance to the boundary, or minus that to the hull.
    """
    directions = _normals(wrenches, forces)
    least = _least(wrenches, *_supports(wrenches, directions, forces), directions)
    if forces == "each":
        return np.maximum(least, 0.0)
    # outside a corner or an edge may be nearest
    first, second = np.array(list(combinations(range(wrenches.shape[1]), 2))).T
    start, along = wrenches[:, first], wrenches[:, second] - wrenches[:, first]
    square = (along**2).sum(axis=2)
    part = np.divide(-_dot(start, along), square, out=np.zeros(square.shape), where=square > 0)
    towards = -np.concatenate((wrenches, start + part[..., None] * along), axis=1)
    heights = (towards @ wrenches.transpose(0, 2, 1)).max(axis=2)
    return np.minimum(least, _least(wrenches, heights, heights, towards))


def enlarged_supports(wrenches: FloatArray, moves: FloatArray, forces: Forces) -> FloatArray:
    """Return what distances of the origin are at most if the torques of contacts change.

    Parameters
    ----------
    wrenches : numpy.ndarray, shape (N, 2 m, 3)
    moves : numpy.ndarray, shape (N, m)
        By how much the torques of both wrenches of each contact may change, up or down.
    forces : {"sum", "each"}

    Returns
    -------
    numpy.ndarray, shape (N,)
    """
    directions = _normals(wrenches, forces)
    along = directions @ wrenches.transpose(0, 2, 1)
    more = np.abs(directions[..., 2:]) * moves[:, None, :]
    both = []
    for sign in (1.0, -1.0):
        of_contacts = (sign * along).reshape(*along.shape[:2], -1, 2).max(axis=3) + more
        both.append(
            of_contacts.max(axis=2) if forces == "sum" else np.maximum(of_contacts, 0.0).sum(axis=2)
        )
    return _least(wrenches, both[0], both[1], directions)


def load_factors(wrenches: FloatArray, load: FloatArray, forces: Forces) -> FloatArray:
    """Return the largest λ such that the contacts can balance ``λ`` times a load.

    ``-λ load`` is in the hull of 0 and the wrenches iff ``λ (-load)·y <= h(y)`` for all normals y
    of its faces.

    Parameters
    ----------
    wrenches : numpy.ndarray, shape (N, 2 m, 3)
    load : numpy.ndarray, shape (3,)
        Not 0.
    forces : {"sum", "each"}

    Returns
    -------
    numpy.ndarray, shape (N,)
        Not negative.
    """
    directions = _normals(wrenches, forces)
    if forces == "sum":  # here the origin is a corner, or inside
        one, other = np.array(list(combinations(range(wrenches.shape[1]), 2))).T
        through = np.cross(wrenches[:, one], wrenches[:, other])
        directions = np.concatenate((directions, through), axis=1)
    size = _size(wrenches)
    factors = _least_ratio(wrenches, directions, load, forces)
    flat = np.flatnonzero(np.linalg.norm(_volumes_of_bases(wrenches), axis=1) <= _FLAT * size**3)
    if flat.size:  # a hull in a plane has edges in it
        within = _normals_in_plane(wrenches[flat])
        factors[flat] = np.minimum(
            factors[flat], _least_ratio(wrenches[flat], within, load, forces)
        )
    return factors


def _least_ratio(
    wrenches: FloatArray, directions: FloatArray, load: FloatArray, forces: Forces
) -> FloatArray:
    """The least ``h(y) / (-load)·y`` over directions, both ways, with a positive denominator."""
    towards = directions @ -load
    lengths = np.linalg.norm(directions, axis=2)
    known = lengths > _FLAT * _size(wrenches)[:, None] ** 2
    least = np.full(len(wrenches), np.inf)
    supports = _supports(wrenches, directions, forces)
    for sign, support in zip((1.0, -1.0), supports, strict=True):
        rounding = _FLAT * lengths * _size(wrenches)[:, None]
        height = np.where(support > rounding, support, 0.0)
        limits = known & (sign * towards > _FLAT * lengths * np.linalg.norm(load))
        ratio = np.divide(height, sign * towards, out=np.full(height.shape, np.inf), where=limits)
        least = np.minimum(least, ratio.min(axis=1))
    return least


# --- directions and supports --------------------------------------------------------------------


def _normals(wrenches: FloatArray, forces: Forces) -> FloatArray:
    """Return all normals, up to sign, that faces of a hull may have, shape (N, C, 3).

    Of points these are the normals of the planes through three of them; of a sum of triangles
    those of the triangles, and of every edge of one with every edge of another.
    """
    if forces == "sum":
        a, b, c = (wrenches[:, k] for k in triples(wrenches.shape[1]).T)
        return np.cross(b - a, c - a)
    sides = _sides(wrenches)
    m = sides.shape[1]
    found = [np.cross(sides[:, :, 0], sides[:, :, 1])]
    for i, j in combinations(range(m), 2):
        crossed = np.cross(sides[:, i, :, None], sides[:, j, None, :])
        found.append(crossed.reshape(len(wrenches), -1, 3))
    return np.concatenate(found, axis=1)


def _sides(wrenches: FloatArray) -> FloatArray:
    """The sides of the triangle ``(0, w⁺, w⁻)`` of each contact, shape (N, m, 3, 3)."""
    one, other = wrenches[:, 0::2], wrenches[:, 1::2]
    return np.stack((one, other, one - other), axis=2)


def _normals_in_plane(wrenches: FloatArray) -> FloatArray:
    """Directions across every edge of hulls that are in a plane, shape (N, C, 3)."""
    first, second = np.array(list(combinations(range(wrenches.shape[1]), 2))).T
    edges = np.concatenate((wrenches, wrenches[:, first] - wrenches[:, second]), axis=1)
    unit = _size(wrenches)[:, None, None]
    across = np.cross(edges[:, :, None], unit[..., None] * np.eye(3))
    return np.asarray(across.reshape(len(wrenches), -1, 3))


def _supports(
    wrenches: FloatArray, directions: FloatArray, forces: Forces
) -> tuple[FloatArray, FloatArray]:
    """Return ``h(y)`` and ``h(-y)`` of directions y, each of shape (N, C)."""
    along = directions @ wrenches.transpose(0, 2, 1)
    if forces == "sum":
        return along.max(axis=2), -along.min(axis=2)
    of_contacts = along.reshape(*along.shape[:2], -1, 2)
    most, least = of_contacts.max(axis=3), of_contacts.min(axis=3)
    return np.maximum(most, 0.0).sum(axis=2), -np.minimum(least, 0.0).sum(axis=2)


def _least(
    wrenches: FloatArray, one: FloatArray, other: FloatArray, directions: FloatArray
) -> FloatArray:
    """The least of supports along directions and against them, per length of these."""
    lengths, size = np.linalg.norm(directions, axis=2), _size(wrenches)[:, None]
    known = lengths > _FLAT * size * np.minimum(size, 1.0)
    support = np.minimum(one, other)
    heights = np.divide(support, lengths, out=np.full(lengths.shape, np.inf), where=known)
    return np.asarray(heights.min(axis=1))


def _volumes_of_bases(wrenches: FloatArray) -> FloatArray:
    """The determinants of every three wrenches, shape (N, T)."""
    a, b, c = (wrenches[:, k] for k in triples(wrenches.shape[1]).T)
    return _dot(np.cross(a, b), c)


def triples(count: int) -> IntArray:
    """Return every three of so many numbers, ascending, shape (T, 3)."""
    return np.array(list(combinations(range(count), 3)), dtype=np.intp).reshape(-1, 3)


def _size(wrenches: FloatArray) -> FloatArray:
    """The largest coordinate of the wrenches of each grasp."""
    return np.asarray(np.abs(wrenches).max(axis=(1, 2)))


def _dot(p: FloatArray, q: FloatArray) -> FloatArray:
    return np.asarray((p * q).sum(axis=-1))
