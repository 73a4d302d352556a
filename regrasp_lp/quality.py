"""How good a grasp is: margin and tolerance, for one grasp or for many."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import ContactError, FrictionError
from regrasp_lp.force_closure import resolve_batch
from regrasp_lp.friction import Cones, FloatArray
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import TorqueFunctions, torque_functions

_CHUNK = 20_000

GraspLike = Grasp | Iterable[Contact | tuple[int, float]]


@overload
def margin(polygon: Polygon, grasp: GraspLike, friction: ArrayLike) -> float: ...


@overload
def margin(
    polygon: Polygon,
    grasp: None = None,
    friction: ArrayLike | None = None,
    *,
    edges: ArrayLike,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
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
    return _measure(TorqueFunctions.margins, polygon, grasp, friction, edges, positions, fractions)


@overload
def tolerance(polygon: Polygon, grasp: GraspLike, friction: ArrayLike) -> float: ...


@overload
def tolerance(
    polygon: Polygon,
    grasp: None = None,
    friction: ArrayLike | None = None,
    *,
    edges: ArrayLike,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
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
    independently: ``min(max_k M_k/w_k, max_j -M_j/w_j, u_i, l_i - u_i)``.

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
        In the polygon's unit, signed; -inf where the boundary rays do not span the plane.

    Examples
    --------
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    >>> round(tolerance(square, [(0, 0.5), (2, 0.5)], friction=0.5), 6)
    0.25
    """
    return _measure(
        TorqueFunctions.tolerances, polygon, grasp, friction, edges, positions, fractions
    )


def _measure(
    of: Callable[[TorqueFunctions, FloatArray], FloatArray],
    polygon: Polygon,
    grasp: GraspLike | None,
    friction: ArrayLike | None,
    edges: ArrayLike | None,
    positions: ArrayLike | None,
    fractions: ArrayLike | None,
) -> float | FloatArray:
    if friction is None:
        raise FrictionError("friction is missing: pass one positive number or one per edge")
    cones = Cones.of(polygon, friction)
    if grasp is not None:
        if edges is not None or positions is not None or fractions is not None:
            raise ContactError("pass either a grasp or arrays (edges=..., positions=...), not both")
        resolved = polygon.resolve(grasp)
        functions = torque_functions(cones, resolved.edges[None, :])
        return float(of(functions, resolved.fractions[None, :])[0])
    edge_array, fraction_array = resolve_batch(polygon, edges, positions, fractions)
    parts = [
        of(torque_functions(cones, edge_array[i : i + _CHUNK]), fraction_array[i : i + _CHUNK])
        for i in range(0, len(edge_array), _CHUNK)
    ]
    return np.concatenate(parts) if parts else np.zeros(0)
