"""Measures by the torque functions: margin and tolerance."""

from __future__ import annotations

from typing import Unpack, overload

from numpy.typing import ArrayLike

from regrasp_lp.friction import FloatArray
from regrasp_lp.polygon import Polygon
from regrasp_lp.quality.grasps import GraspLike, Places, measure


@overload
def margin(polygon: Polygon, grasp: GraspLike, friction: ArrayLike) -> float: ...


@overload
def margin(
    polygon: Polygon,
    grasp: None = None,
    friction: ArrayLike | None = None,
    *,
    edges: ArrayLike,
    **places: Unpack[Places],
) -> FloatArray: ...


def margin(
    polygon: Polygon,
    grasp: GraspLike | None = None,
    friction: ArrayLike | None = None,
    *,
    edges: ArrayLike | None = None,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
) -> float | FloatArray:
    """Return the margin of a grasp, or of many.

    The largest ε such that every boundary line of every friction cone may be shifted by ε, each
    on its own, without losing force closure: ``min(max_k M_k/s_k, max_j -M_j/s_j)`` over the
    torque functions of the contacts.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp or iterable of (edge, position), optional
        One grasp; leave it out for a batch.
    friction : float or sequence of float
        μ, one value or one per edge. Required.
    edges, positions, fractions : array_like, shape (N, m), optional
        A batch: the edges, and either positions along them or fractions of their lengths.

    Returns
    -------
    float or numpy.ndarray, shape (N,)
        In the polygon's unit; positive iff in force closure, -inf where the boundary rays of the
        cones do not positively span the plane.

    Examples
    --------
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    >>> round(margin(square, [(0, 0.5), (2, 0.5)], friction=0.5), 6)
    0.223607
    """
    return measure(
        lambda grasps: grasps.functions.margins(grasps.fractions),
        polygon,
        grasp,
        friction,
        edges,
        positions,
        fractions,
    )


@overload
def tolerance(polygon: Polygon, grasp: GraspLike, friction: ArrayLike) -> float: ...


@overload
def tolerance(
    polygon: Polygon,
    grasp: None = None,
    friction: ArrayLike | None = None,
    *,
    edges: ArrayLike,
    **places: Unpack[Places],
) -> FloatArray: ...


def tolerance(
    polygon: Polygon,
    grasp: GraspLike | None = None,
    friction: ArrayLike | None = None,
    *,
    edges: ArrayLike | None = None,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
) -> float | FloatArray:
    """Return the tolerance of a grasp, or of many.

    The largest δ such that every contact may be anywhere within ±δ of its place on its edge,
    independently: ``min(max_k M_k/w_k, max_j -M_j/w_j, u_i, l_i - u_i)``. Half the width of the
    largest equal independent contact regions around the contacts.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp or iterable of (edge, position), optional
        One grasp; leave it out for a batch.
    friction : float or sequence of float
        μ, one value or one per edge. Required.
    edges, positions, fractions : array_like, shape (N, m), optional
        A batch: the edges, and either positions along them or fractions of their lengths.

    Returns
    -------
    float or numpy.ndarray, shape (N,)
        In the polygon's unit, signed; -inf where the boundary rays do not span the plane. It is 0
        where a contact is at an end of its edge, and positive iff the grasp is in force closure
        where none is.

    Examples
    --------
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    >>> round(tolerance(square, [(0, 0.5), (2, 0.5)], friction=0.5), 6)
    0.25
    """
    return measure(
        lambda grasps: grasps.functions.tolerances(grasps.fractions),
        polygon,
        grasp,
        friction,
        edges,
        positions,
        fractions,
    )
