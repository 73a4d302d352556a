"""Where the forces of a grasp meet, and how far that is from the centroid.

Balanced forces at three contacts act along lines that meet in a point q (or are parallel): a
*focus point*. With ``v_i = p_i - q`` and ``λ_1 = v_2 × v_3``, ``λ_2 = v_3 × v_1``,
``λ_3 = v_1 × v_2`` there is one dependency, ``Σ λ_i v_i = 0``: forces through q balance iff they
are ``f_i = σ λ_i v_i``, with σ = 1 or -1. So q is a focus point iff for one σ every ``σ λ_i v_i``
is in the cone of its contact: of the double-sided cones (chapter, Proposition 3.4) that is the part
in which forces balance; all of it if the normals θ-positively span the plane. λ_i is linear in q, 0
on the line through the two other contacts. So focus points are unions of polygons with sides on
nine lines: two boundaries of each cone, and three through two contacts. The nearest to the centroid
is the centroid itself, its foot on one of these lines, or a point where two of them meet. Of two
contacts the forces share one line.
"""

from __future__ import annotations

from itertools import combinations
from typing import Unpack, overload

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.circuits import cross
from regrasp_lp.errors import ContactError
from regrasp_lp.friction import BoolArray, FloatArray
from regrasp_lp.polygon import Polygon
from regrasp_lp.quality.grasps import GraspLike, Grasps, Places, measure

_ROUNDING = 1e-11  # of the distance of a point, in diameters of the object


@overload
def focus_distance(polygon: Polygon, grasp: GraspLike, friction: ArrayLike) -> float: ...


@overload
def focus_distance(
    polygon: Polygon,
    grasp: None = None,
    friction: ArrayLike | None = None,
    *,
    edges: ArrayLike,
    **places: Unpack[Places],
) -> FloatArray: ...


def focus_distance(
    polygon: Polygon,
    grasp: GraspLike | None = None,
    friction: ArrayLike | None = None,
    *,
    edges: ArrayLike | None = None,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
) -> float | FloatArray:
    """Return how far the forces of a grasp, or of many, pass the centroid.

    The least distance from the centroid to a point in which the lines of balanced contact forces
    meet: of three contacts the nearest focus point, of two the nearest point of the line through
    them. The nearer, the less do weight and inertia load the grasp with a torque.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp or iterable of (edge, position), optional
        One grasp of two or three contacts; leave it out for a batch.
    friction : float or sequence of float
        μ, one value or one per edge. Required.
    edges, positions, fractions : array_like, shape (N, m), optional
        A batch: the edges, and either positions along them or fractions of their lengths.

    Returns
    -------
    float or numpy.ndarray, shape (N,)
        In the polygon's unit, not negative, the less the better; inf iff the grasp is not in force
        closure.

    Raises
    ------
    ContactError, FrictionError
        As `regrasp_lp.margin`, and if there are not two or three contacts.

    Notes
    -----
    J. Ponce and B. Faverjon, *On computing three-finger force-closure grasps of polygonal objects*,
    IEEE Transactions on Robotics and Automation, 1995. Focus points are those of the contacts as
    they are; those of a whole grasp set are its focus cell (`GraspSet.focus_cell`).

    Examples
    --------
    >>> square = Polygon([(0, 0), (2, 0), (2, 2), (0, 2)])
    >>> focus_distance(square, [(0, 1.5), (2, 0.5)], friction=0.5)
    0.5
    >>> focus_distance(square, [(0, 1.0), (1, 1.5), (3, 0.5)], friction=0.5)
    0.0
    """
    return measure(_distances, polygon, grasp, friction, edges, positions, fractions)


def _distances(grasps: Grasps) -> FloatArray:
    if grasps.m not in (2, 3):
        raise ContactError(f"forces meet in a point for 2 or 3 contacts, there are {grasps.m}")
    if grasps.m == 2:
        first, second = grasps.points.transpose(1, 0, 2)
        along = second - first
        apart = np.hypot(along[:, 0], along[:, 1])
        off = np.abs(cross(first, along))
        found = np.divide(off, apart, out=np.zeros(len(grasps)), where=apart > 0)
    else:
        found = _of_three(grasps)
    return np.where(grasps.closed, found, np.inf)


def _of_three(grasps: Grasps) -> FloatArray:
    """The distance of the nearest focus point of three contacts."""
    unit = grasps.polygon.diameter
    contacts = grasps.points / unit
    rays = _cone_rays(grasps)
    through, along = _lines(contacts, rays)
    points, on = _candidates(through, along)
    with np.errstate(all="ignore"):
        distances = np.hypot(points[..., 0], points[..., 1])
        offsets = cross(along[:, None], points[:, :, None] - through[:, None])
        rounding = _ROUNDING * (1 + distances)[..., None]
        sides = np.where(on | (np.abs(offsets) <= rounding), 0.0, np.sign(offsets))
    good = np.isfinite(distances) & _meets(sides)
    at_contacts = np.hypot(contacts[..., 0], contacts[..., 1])
    nearest = np.where(good, distances, np.inf).min(axis=1)
    held = _meets_at_contact(contacts, rays)
    return np.asarray(unit * np.minimum(nearest, np.where(held, at_contacts, np.inf).min(axis=1)))


def _cone_rays(grasps: Grasps) -> FloatArray:
    """Unit vectors along the clockwise and the other boundary of each cone, shape (N, 3, 2, 2)."""
    numbers = 2 * grasps.edges[..., None] + np.array([0, 1])
    return np.asarray(grasps.cones.unit_rays[numbers])


def _lines(contacts: FloatArray, rays: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A point and a unit vector of nine lines, each of shape (N, 9, 2).

    Two of each cone, then for each contact the one through the next two.
    """
    first, second = contacts[:, [1, 2, 0]], contacts[:, [2, 0, 1]]
    between = second - first
    length = np.hypot(between[..., 0], between[..., 1])[..., None]
    unit = np.divide(between, length, out=np.zeros(between.shape), where=length > 0)
    shape = (len(contacts), 6, 2)
    through = np.concatenate((contacts.repeat(2, axis=1), first), axis=1)
    return through, np.concatenate((rays.reshape(shape), unit), axis=1)


def _candidates(through: FloatArray, along: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Points that may be nearest to the origin, (N, C, 2), and which lines each is on, (C, 9).

    The origin, its foot on each line, and where two lines meet that have no contact in common.
    """
    contacts_of = [{0}, {0}, {1}, {1}, {2}, {2}, {1, 2}, {2, 0}, {0, 1}]
    pairs = [(i, j) for i, j in combinations(range(9), 2) if not contacts_of[i] & contacts_of[j]]
    one, other = np.array(pairs).T
    feet = through - (through * along).sum(axis=2, keepdims=True) * along
    with np.errstate(all="ignore"):
        part = cross(through[:, other] - through[:, one], along[:, other]) / cross(
            along[:, one], along[:, other]
        )
        meeting = through[:, one] + part[..., None] * along[:, one]
    points = np.concatenate((np.zeros((len(through), 1, 2)), feet, meeting), axis=1)
    on = np.zeros((points.shape[1], 9), dtype=bool)
    on[1 + np.arange(9), np.arange(9)] = True
    on[10 + np.arange(len(pairs)), one] = True
    on[10 + np.arange(len(pairs)), other] = True
    return points, on


def _meets(sides: FloatArray) -> BoolArray:
    """Whether points are focus points, by their sides of the nine lines, shape (N, C).

    ``q - p`` is in the cone if q is on the left of the clockwise boundary and on the right of the
    other one; then the force that goes through q points to it.
    """
    right, left, across = sides[..., 0:6:2], sides[..., 1:6:2], sides[..., 6:]
    ahead, behind = (right >= 0) & (left <= 0), (right <= 0) & (left >= 0)
    # λ_i v_i = -λ_i (q - p_i), and λ_i has the sign of the side of the line of the two others
    found = np.zeros(sides.shape[:2], dtype=bool)
    for sign in (1, -1):
        weights = sign * across
        found |= ((ahead & (weights <= 0)) | (behind & (weights >= 0))).all(axis=2)
    return found


def _meets_at_contact(contacts: FloatArray, rays: FloatArray) -> BoolArray:
    """Whether balanced forces meet in a contact, whose own force may have any direction.

    The forces of the two others go along the lines to it; some sum of theirs has to be opposite to
    a force in its cone. Shape (N, 3).
    """
    found = np.zeros(contacts.shape[:2], dtype=bool)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        first, second = contacts[:, i] - contacts[:, j], contacts[:, i] - contacts[:, k]
        own = rays[:, i]
        for a in (first, -first):
            for b in (second, -second):
                possible = _within(a, rays[:, j]) & _within(b, rays[:, k])
                opposite = _within(-a, own) | _within(-b, own)
                pair = np.stack((a, b), axis=1)
                pair = np.where((cross(a, b) < 0)[:, None, None], pair[:, ::-1], pair)
                for ray in (own[:, 0], own[:, 1]):
                    opposite |= _within(-ray, pair)
                found[:, i] |= possible & opposite
    return found


def _within(vectors: FloatArray, cone: FloatArray) -> BoolArray:
    """Whether vectors are between two, clockwise first, less than half a turn apart."""
    right, left = cross(cone[:, 0], vectors), cross(vectors, cone[:, 1])
    return np.asarray((right >= -_ROUNDING) & (left >= -_ROUNDING))
