"""Measures by the wrenches that contacts can exert: ε, volume, and what a load needs.

A wrench is ``(f_x, f_y, τ)``, its torque about the centroid of the object. How forces are bounded,
and by which length torques are divided, is said in `regrasp_lp.quality.hulls`.
"""

from __future__ import annotations

from typing import Unpack, overload

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray
from regrasp_lp.polygon import Polygon
from regrasp_lp.quality.grasps import GraspLike, Grasps, Places, measure
from regrasp_lp.quality.hulls import (
    Forces,
    TorqueScale,
    check_forces,
    distances,
    load_factors,
    scale_of,
    wrenches_of,
)
from regrasp_lp.quality.volumes import hull_volumes, sum_volumes

WEIGHT = (0.0, -1.0, 0.0)
"""A load of 1 downwards through the centroid."""


@overload
def epsilon(
    polygon: Polygon,
    grasp: GraspLike,
    friction: ArrayLike,
    *,
    forces: Forces = "sum",
    torque_scale: TorqueScale = "gyration",
) -> float: ...


@overload
def epsilon(
    polygon: Polygon,
    grasp: None = None,
    friction: ArrayLike | None = None,
    *,
    forces: Forces = "sum",
    torque_scale: TorqueScale = "gyration",
    edges: ArrayLike,
    **places: Unpack[Places],
) -> FloatArray: ...


def epsilon(
    polygon: Polygon,
    grasp: GraspLike | None = None,
    friction: ArrayLike | None = None,
    *,
    forces: Forces = "sum",
    torque_scale: TorqueScale = "gyration",
    edges: ArrayLike | None = None,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
) -> float | FloatArray:
    """Return Ferrari and Canny's ε of a grasp, or of many.

    The radius of the largest ball about the origin in the hull of the wrenches that the contacts
    can exert: the least wrench that breaks the grasp, in the worst direction, per normal force.
    Signed: ``min h(y)`` over unit y, h the support function of the hull. Outside force closure it
    is, for both bounds, minus the distance from the origin to the convex hull of the primitive
    wrenches.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp or iterable of (edge, position), optional
        One grasp; leave it out for a batch.
    friction : float or sequence of float
        μ, one value or one per edge. Required.
    forces : {"sum", "each"}
        Normal forces of 1 in all (L1), or of at most 1 each (L∞).
    torque_scale : {"gyration", "distance"} or float
        The length by which torques are divided: see `regrasp_lp.quality.torque_scale`.
    edges, positions, fractions : array_like, shape (N, m), optional
        A batch: the edges, and either positions along them or fractions of their lengths.

    Returns
    -------
    float or numpy.ndarray, shape (N,)
        A pure number (wrench per normal force), at most ``sqrt(1 + μ²)`` for ``"sum"``: positive
        iff in force closure, -inf where the boundary rays do not positively span the plane.

    Raises
    ------
    ContactError, FrictionError
        As `regrasp_lp.margin`.
    OptionError
        If `forces` or `torque_scale` is none of those.

    Notes
    -----
    C. Ferrari and J. Canny, *Planning optimal grasps*, ICRA 1992. Their unit forces have a normal
    component of 1, as here. The hull of ``"each"`` is the Minkowski sum of the contacts' triangles
    with the origin, since a contact need not press: then no grasp in force closure is missed.
    By how much contacts may be moved is bounded by it: with ``"sum"``, ε falls by no more than
    ``d / ρ`` if contacts move by up to d on their edges.

    Examples
    --------
    >>> square = Polygon([(0, 0), (2, 0), (2, 2), (0, 2)])
    >>> round(epsilon(square, [(0, 1.0), (2, 1.0)], friction=0.5, torque_scale=1.0), 6)
    0.333333
    """
    check_forces(forces)
    scale = scale_of(polygon, torque_scale)

    def of(grasps: Grasps) -> FloatArray:
        wrenches = wrenches_of(grasps, scale)
        values = distances(wrenches, "sum")
        if forces == "each":
            values = np.where(grasps.closed, distances(wrenches, "each"), values)
        return grasps.signed(values)

    return measure(of, polygon, grasp, friction, edges, positions, fractions)


@overload
def hull_volume(
    polygon: Polygon,
    grasp: GraspLike,
    friction: ArrayLike,
    *,
    forces: Forces = "sum",
    torque_scale: TorqueScale = "gyration",
) -> float: ...


@overload
def hull_volume(
    polygon: Polygon,
    grasp: None = None,
    friction: ArrayLike | None = None,
    *,
    forces: Forces = "sum",
    torque_scale: TorqueScale = "gyration",
    edges: ArrayLike,
    **places: Unpack[Places],
) -> FloatArray: ...


def hull_volume(
    polygon: Polygon,
    grasp: GraspLike | None = None,
    friction: ArrayLike | None = None,
    *,
    forces: Forces = "sum",
    torque_scale: TorqueScale = "gyration",
    edges: ArrayLike | None = None,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
) -> float | FloatArray:
    """Return the volume of the wrenches that a grasp, or many, can exert.

    An average over all directions where `epsilon` is the worst. Signed: outside force closure it
    is minus the volume by which the convex hull of the primitive wrenches would grow to contain the
    origin. Other than ε it jumps at the boundary of force closure, where the hull is not small.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp or iterable of (edge, position), optional
        One grasp; leave it out for a batch.
    friction : float or sequence of float
        μ, one value or one per edge. Required.
    forces : {"sum", "each"}
        Normal forces of 1 in all (L1), or of at most 1 each (L∞).
    torque_scale : {"gyration", "distance"} or float
        The length by which torques are divided: see `regrasp_lp.quality.torque_scale`.
    edges, positions, fractions : array_like, shape (N, m), optional
        A batch: the edges, and either positions along them or fractions of their lengths.

    Returns
    -------
    float or numpy.ndarray, shape (N,)
        A pure number (wrench cubed, per normal force cubed): positive iff in force closure, -inf
        where the boundary rays do not positively span the plane.

    Raises
    ------
    ContactError, FrictionError
        As `regrasp_lp.margin`.
    OptionError
        If `forces` or `torque_scale` is none of those.

    Notes
    -----
    A. Miller and P. Allen, *Examples of 3D grasp quality computations*, ICRA 1999. With
    ``"each"`` the volume is a sum of mixed volumes of the contacts' triangles. Unlike ε it only
    changes by a factor if torques are scaled otherwise.

    Examples
    --------
    >>> square = Polygon([(0, 0), (2, 0), (2, 2), (0, 2)])
    >>> round(hull_volume(square, [(0, 1.0), (2, 1.0)], friction=0.5, torque_scale=1.0), 6)
    0.666667
    """
    check_forces(forces)
    scale = scale_of(polygon, torque_scale)

    def of(grasps: Grasps) -> FloatArray:
        wrenches = wrenches_of(grasps, scale)
        volumes, lacking = hull_volumes(wrenches)
        if forces == "each":
            volumes = sum_volumes(wrenches)
        return grasps.signed(np.where(grasps.closed, volumes, -lacking))

    return measure(of, polygon, grasp, friction, edges, positions, fractions)


@overload
def load_factor(
    polygon: Polygon,
    grasp: GraspLike,
    friction: ArrayLike,
    *,
    load: ArrayLike = WEIGHT,
    forces: Forces = "sum",
) -> float: ...


@overload
def load_factor(
    polygon: Polygon,
    grasp: None = None,
    friction: ArrayLike | None = None,
    *,
    load: ArrayLike = WEIGHT,
    forces: Forces = "sum",
    edges: ArrayLike,
    **places: Unpack[Places],
) -> FloatArray: ...


def load_factor(
    polygon: Polygon,
    grasp: GraspLike | None = None,
    friction: ArrayLike | None = None,
    *,
    load: ArrayLike = WEIGHT,
    forces: Forces = "sum",
    edges: ArrayLike | None = None,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
) -> float | FloatArray:
    """Return how much of a load a grasp, or many, can resist.

    The largest λ such that the contacts can balance λ times the load: the linear program ``max λ``
    subject to ``Σ a_k w_k = -λ load``, ``a >= 0`` and the bound on normal forces, solved by the
    faces of the hull.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp or iterable of (edge, position), optional
        One grasp; leave it out for a batch.
    friction : float or sequence of float
        μ, one value or one per edge. Required.
    load : array_like, shape (3,), optional
        ``(f_x, f_y, τ)`` on the object, the torque about its centroid, counter-clockwise; by
        default a weight of 1 downwards.
    forces : {"sum", "each"}
        Normal forces of 1 in all (L1), or of at most 1 each (L∞).
    edges, positions, fractions : array_like, shape (N, m), optional
        A batch: the edges, and either positions along them or fractions of their lengths.

    Returns
    -------
    float or numpy.ndarray, shape (N,)
        Never negative; in loads per normal force, the more the better. It is positive for every
        load iff the grasp is in force closure, but contacts that are not may carry one load or
        another, as a table does: this is no test of force closure. 0 where they cannot carry it.

    Raises
    ------
    ContactError, FrictionError
        As `regrasp_lp.margin`.
    OptionError
        If `forces` is none of those, or `load` not three finite numbers, or 0.

    Notes
    -----
    Wrenches that are in the plane of a face but for rounding (1e-12) count as in it.

    Examples
    --------
    Two fingers beside a square, one cone below another load:

    >>> square = Polygon([(0, 0), (2, 0), (2, 2), (0, 2)])
    >>> round(load_factor(square, [(1, 1.0), (3, 1.0)], friction=0.5), 6)
    0.5
    >>> round(load_factor(square, [(1, 1.0), (3, 1.0)], friction=0.5, forces="each"), 6)
    1.0
    >>> round(load_factor(square, [(0, 0.5), (0, 1.5)], friction=0.5), 6)
    1.0
    """
    check_forces(forces)
    of_load = _load_of(load, polygon)

    def of(grasps: Grasps) -> FloatArray:
        return load_factors(wrenches_of(grasps, polygon.diameter), of_load, forces)

    return measure(of, polygon, grasp, friction, edges, positions, fractions)


@overload
def squeezing_force(
    polygon: Polygon,
    grasp: GraspLike,
    friction: ArrayLike,
    *,
    load: ArrayLike = WEIGHT,
    forces: Forces = "sum",
) -> float: ...


@overload
def squeezing_force(
    polygon: Polygon,
    grasp: None = None,
    friction: ArrayLike | None = None,
    *,
    load: ArrayLike = WEIGHT,
    forces: Forces = "sum",
    edges: ArrayLike,
    **places: Unpack[Places],
) -> FloatArray: ...


def squeezing_force(
    polygon: Polygon,
    grasp: GraspLike | None = None,
    friction: ArrayLike | None = None,
    *,
    load: ArrayLike = WEIGHT,
    forces: Forces = "sum",
    edges: ArrayLike | None = None,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
) -> float | FloatArray:
    """Return with how much normal force a grasp, or many, can hold a load.

    The least sum of the normal forces, or the least that the largest of them can be, such that the
    contacts balance the load: 1 over `load_factor`.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp or iterable of (edge, position), optional
        One grasp; leave it out for a batch.
    friction : float or sequence of float
        μ, one value or one per edge. Required.
    load : array_like, shape (3,), optional
        ``(f_x, f_y, τ)`` on the object, the torque about its centroid, counter-clockwise; by
        default a weight of 1 downwards.
    forces : {"sum", "each"}
        Whether the sum of the normal forces counts, or the largest one.
    edges, positions, fractions : array_like, shape (N, m), optional
        A batch: the edges, and either positions along them or fractions of their lengths.

    Returns
    -------
    float or numpy.ndarray, shape (N,)
        In the unit of the load's force, the less the better: finite for every load iff the grasp is
        in force closure, inf where no forces balance this one.

    Raises
    ------
    ContactError, FrictionError
        As `regrasp_lp.margin`.
    OptionError
        If `forces` is none of those, or `load` not three finite numbers, or 0.

    Examples
    --------
    >>> square = Polygon([(0, 0), (2, 0), (2, 2), (0, 2)])
    >>> round(squeezing_force(square, [(1, 1.0), (3, 1.0)], friction=0.5, load=(0, -10, 0)), 6)
    20.0
    """
    check_forces(forces)
    of_load = _load_of(load, polygon)

    def of(grasps: Grasps) -> FloatArray:
        factors = load_factors(wrenches_of(grasps, polygon.diameter), of_load, forces)
        inverse = np.divide(1.0, factors, out=np.full(factors.shape, np.inf), where=factors > 0)
        return np.asarray(inverse)

    return measure(of, polygon, grasp, friction, edges, positions, fractions)


def _load_of(load: ArrayLike, polygon: Polygon) -> FloatArray:
    """A load with its torque divided by the diameter of the object, as the wrenches have it."""
    try:
        given = np.array(load, dtype=np.float64)
    except (TypeError, ValueError):
        given = np.zeros(0)
    if given.shape != (3,) or not np.isfinite(given).all() or not given.any():
        raise OptionError(
            f"a load is three finite numbers (f_x, f_y, torque), not all 0, got {load!r}"
        )
    return np.asarray(given / [1.0, 1.0, polygon.diameter])
