"""Force closure of given contacts, decided exactly from their contact wrenches.

The answer is exact, also on the boundary of the set of force-closure grasps (which itself is no
force closure): the numbers given are read as the rationals they are, and what floating point
leaves open is decided in integers. How is said in `regrasp_lp.wrenches`.

Nothing here uses torque functions, so that each can be tested against the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.contact import FRACTION_SNAP, Contact, Grasp
from regrasp_lp.errors import ContactError, FrictionError
from regrasp_lp.friction import per_edge_friction
from regrasp_lp.polygon import Polygon
from regrasp_lp.wrenches import BoolArray, FloatArray, IntArray, decide, decide_exactly

__all__ = ["is_force_closure", "least_friction"]


_CHUNK_ENTRIES = 1 << 16  # determinants held at a time: small enough for the processor's cache


@overload
def is_force_closure(
    polygon: Polygon,
    grasp: Grasp | Iterable[Contact | tuple[int, float]],
    friction: ArrayLike,
) -> bool: ...


@overload
def is_force_closure(
    polygon: Polygon,
    grasp: None = None,
    friction: ArrayLike | None = None,
    *,
    edges: ArrayLike,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
) -> BoolArray: ...


def is_force_closure(
    polygon: Polygon,
    grasp: Grasp | Iterable[Contact | tuple[int, float]] | None = None,
    friction: ArrayLike | None = None,
    *,
    edges: ArrayLike | None = None,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
) -> bool | BoolArray:
    """Tell whether contacts are in force closure: exactly, for one grasp or for many.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp or iterable of Contact or (edge, position), optional
        One grasp of any number of contacts. Leave it out for a batch.
    friction : float or sequence of float
        μ > 0, one value or one per edge. Required.
    edges : array_like of int, shape (N, m), optional
        A batch of N grasps of m contacts each: the edges.
    positions : array_like of float, shape (N, m), optional
        Distances along the edges, in the polygon's unit.
    fractions : array_like of float, shape (N, m), optional
        The same as fractions of the edge lengths; give either `positions` or `fractions`.

    Returns
    -------
    bool or numpy.ndarray of bool, shape (N,)

    Raises
    ------
    ContactError
        If a contact is on no edge or off its edge, or the arrays do not fit together.
    FrictionError
        If `friction` is missing or not positive and finite.

    Notes
    -----
    Contacts may coincide: they are wrenches like any other. At a vertex of the polygon the cone
    of the named edge counts.

    Examples
    --------
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    >>> is_force_closure(square, [(0, 0.5), (2, 0.5)], friction=0.2)
    True

    At the very friction where the line through both contacts is a boundary of the cones there is
    no force closure yet:

    >>> is_force_closure(square, [(0, 0.5), (2, 0.25)], friction=0.25)
    False
    >>> is_force_closure(
    ...     square, friction=0.25, edges=[(0, 2), (0, 2)], fractions=[(0.5, 0.25), (0.5, 0.375)]
    ... )
    array([False,  True])
    """
    if friction is None:
        raise FrictionError("friction is missing: pass one positive number or one per edge")
    mu = per_edge_friction(friction, polygon.n_edges)
    if grasp is not None:
        if edges is not None or positions is not None or fractions is not None:
            raise ContactError("pass either a grasp or arrays (edges=..., positions=...), not both")
        resolved = polygon.resolve(grasp)
        return bool(decide(polygon, mu, resolved.edges[None], resolved.fractions[None])[0])
    edge_array, fraction_array = resolve_batch(polygon, edges, positions, fractions)
    verdict = np.empty(len(edge_array), dtype=np.bool_)
    n_rays = 2 * edge_array.shape[1]
    rows = max(1, _CHUNK_ENTRIES // max(1, math.comb(n_rays, 3)))
    for first in range(0, len(verdict), rows):
        chunk = slice(first, first + rows)
        verdict[chunk] = decide(polygon, mu, edge_array[chunk], fraction_array[chunk])
    return verdict


def least_friction(
    polygon: Polygon, grasp: Grasp | Iterable[Contact | tuple[int, float]]
) -> float | None:
    """Return the least uniform friction at which a grasp is in force closure.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp or iterable of Contact or (edge, position)

    Returns
    -------
    float or None
        A μ at which the grasp is in force closure while it is not at ``μ / (1 + 1e-9)``;
        0.0 if every positive double will do; None if no friction does (or none below 2^1023).

    Notes
    -----
    The cones grow with μ, so that the exact test is monotone and bisection finds the threshold.

    Whether any friction will do is decided exactly too. The wrench cones W(μ) grow with μ; let W
    be their union, a convex cone. If W = R³, four vectors that positively span R³ lie in one
    W(μ), so this μ gives force closure; the converse is plain. A convex set is all of R³ iff its
    closure is, and the closure of W is generated by closed half-planes of forces at the contacts,
    that is by the rays ``T``, ``-T`` and ``rot90(T)`` of each: the same test with three rays per
    contact instead of two. In the same way 0.0 is returned iff the smallest positive double
    passes the test.

    Examples
    --------
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    >>> round(least_friction(square, [(0, 0.5), (2, 0.25)]), 8)
    0.25
    >>> least_friction(square, [(0, 0.5), (2, 0.5)])
    0.0
    >>> least_friction(square, [(0, 0.25), (0, 0.75)]) is None
    True
    """
    resolved = polygon.resolve(grasp)
    edges, fractions = resolved.edges[None], resolved.fractions[None]

    def holds(mu: float) -> bool:
        return bool(decide(polygon, np.full(polygon.n_edges, mu), edges, fractions)[0])

    if edges.size < 2 or not decide_exactly(polygon, None, edges, fractions)[0]:
        return None
    if holds(math.ulp(0.0)):
        return 0.0
    # First the power of two, by bisecting its exponent, then the value.
    low, high = -1074, 1024
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(2.0**middle) else (middle, high)
    if high == 1024:
        return None  # the threshold exceeds every power of two that is a double
    below, above = 2.0**low, 2.0**high
    while above > below * (1 + 1e-9) and below < (middle_mu := below + (above - below) / 2) < above:
        below, above = (below, middle_mu) if holds(middle_mu) else (middle_mu, above)
    return above


def resolve_batch(
    polygon: Polygon,
    edges: ArrayLike | None,
    positions: ArrayLike | None,
    fractions: ArrayLike | None,
) -> tuple[IntArray, FloatArray]:
    """Return the edges and fractions of a batch, both of shape (N, m), validated."""
    if edges is None or (positions is None) == (fractions is None):
        raise ContactError(
            "a batch of grasps needs edges=(N, m) and either positions=(N, m) or fractions=(N, m)"
        )
    edge_array = np.asarray(edges)
    given = np.asarray(positions if fractions is None else fractions, dtype=np.float64)
    if edge_array.ndim != 2 or given.shape != edge_array.shape:
        raise ContactError(
            "edges and positions (or fractions) must both have the shape (N, m), got "
            f"{edge_array.shape} and {given.shape}"
        )
    if edge_array.size and not np.issubdtype(edge_array.dtype, np.integer):
        raise ContactError(f"edges must be integers, got an array of {edge_array.dtype}")
    edge_array = edge_array.astype(np.intp)
    unknown = (edge_array < 0) | (edge_array >= polygon.n_edges)
    if unknown.any():
        row, column = np.argwhere(unknown)[0]
        raise ContactError(
            f"grasp {row}, contact {column}: there is no edge {edge_array[row, column]}; "
            f"the polygon has edges 0 to {polygon.n_edges - 1}"
        )
    value = given / polygon.edge_lengths[edge_array] if fractions is None else given
    at_start, at_end = np.abs(value) <= FRACTION_SNAP, np.abs(value - 1) <= FRACTION_SNAP
    off = ~(at_start | at_end | ((value > 0) & (value < 1)))  # also true for nan
    if off.any():
        row, column = np.argwhere(off)[0]
        edge = edge_array[row, column]
        raise ContactError(
            f"grasp {row}, contact {column}: {given[row, column]} is not on edge {edge}, "
            + (
                f"where positions run from 0 to {polygon.edge_lengths[edge]}"
                if fractions is None
                else "where fractions run from 0 to 1"
            )
        )
    return edge_array, np.where(at_start, 0.0, np.where(at_end, 1.0, value))
