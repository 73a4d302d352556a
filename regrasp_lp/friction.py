"""Friction cones of the edges of a polygon, and exact answers about their boundary rays.

Edge ``i`` runs along ``T = b - a``; with ``rot90(x, y) = (-y, x)`` its cone is bounded by

    e = rot90(T) ± μ T        (+: the clockwise ray, −: the counter-clockwise one),

unnormalised, so that every ray is rational in the coordinates and μ. All that the rest of the
package asks about directions is the *sign* of a cross product of two rays: these are decided
exactly, by a floating-point filter and integers for what the filter leaves open.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regrasp_lp.errors import FrictionError, PolygonError
from regrasp_lp.polygon import Polygon

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.integer[Any]]
BoolArray = NDArray[np.bool_]
ObjectArray = NDArray[np.object_]
SignArray = NDArray[np.int8]

UNIT_ROUNDOFF = 2.0**-53
_NEARLY_PARALLEL = 1e-5
_LEAST_FRICTION, _MOST_FRICTION = 1e-100, 1e6


def per_edge_friction(friction: ArrayLike, n_edges: int) -> FloatArray:
    """Return the friction coefficient of each edge as a read-only array.

    Parameters
    ----------
    friction : float or sequence of float
        μ > 0, one value for all edges or one per edge.
    n_edges : int
        Number of edges of the object.

    Returns
    -------
    numpy.ndarray, shape (n_edges,)

    Raises
    ------
    FrictionError
        If a value is not a number from 1e-100 to 1e6, or their number is neither 1 nor `n_edges`.

    Examples
    --------
    >>> per_edge_friction(0.2, 3)
    array([0.2, 0.2, 0.2])
    """
    try:
        mu = np.array(friction, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise FrictionError(
            f"friction must be a number or a sequence of numbers, got {friction!r}"
        ) from error
    if mu.ndim > 1 or (mu.ndim == 1 and mu.size not in (1, n_edges)):
        raise FrictionError(
            f"friction must be one value or one per edge ({n_edges}), got shape {mu.shape}"
        )
    good = np.isfinite(mu) & (mu >= _LEAST_FRICTION) & (mu <= _MOST_FRICTION)
    if not good.all():
        if mu.ndim == 0:
            raise FrictionError(
                f"friction must be a positive finite number from {_LEAST_FRICTION:g} to "
                f"{_MOST_FRICTION:g}, got {mu}"
            )
        edge = int(np.argmin(good))
        raise FrictionError(
            f"friction must be positive and finite, from {_LEAST_FRICTION:g} to "
            f"{_MOST_FRICTION:g}: got {mu[edge]} at edge {edge}"
        )
    mu = np.broadcast_to(mu, (n_edges,)).copy()
    mu.setflags(write=False)
    return mu


@dataclass(frozen=True, eq=False)
class Directions:
    """k directions ``α rot90(T) + β T`` to each edge vector T, and how they turn to each other.

    Direction ``k i + j`` is the j-th one of edge i.

    Parameters
    ----------
    vectors : numpy.ndarray, shape (n, 2)
        Vector T of each edge.
    exact_vectors : numpy.ndarray of object (int), shape (n, 2)
        The same as integers: ``vectors = exact_vectors / unit``, before any rounding.
    unit : int
    across : numpy.ndarray, shape (n, k)
        α, which is 0 or 1.
    along : numpy.ndarray, shape (n, k)
        β.
    """

    vectors: FloatArray
    exact_vectors: ObjectArray
    unit: int
    across: FloatArray
    along: FloatArray

    @cached_property
    def values(self) -> FloatArray:
        """The directions, shape (n k, 2)."""
        x, y = self.vectors.T
        normal = np.stack((-y, x), axis=1)
        across, along = self.across[:, :, None], self.along[:, :, None]
        of_edges = across * normal[:, None, :] + along * self.vectors[:, None, :]
        return np.asarray(of_edges.reshape(-1, 2))

    @cached_property
    def lengths(self) -> FloatArray:
        """Their lengths, shape (n k,)."""
        return np.hypot(self.values[:, 0], self.values[:, 1])

    @cached_property
    def units(self) -> FloatArray:
        """The directions scaled to length 1, shape (n k, 2)."""
        return self.values / self.lengths[:, None]

    @cached_property
    def _integers(self) -> tuple[ObjectArray, ObjectArray]:
        beta = [Fraction(float(b)) for b in self.along.ravel()]
        p = np.array([b.numerator for b in beta], dtype=object).reshape(*self.along.shape, 1)
        q = np.array([b.denominator for b in beta], dtype=object).reshape(*self.along.shape, 1)
        alpha = self.across.astype(int).astype(object)[:, :, None]
        x, y = self.exact_vectors.T
        normal = np.stack((-y, x), axis=1)[:, None, :]
        exact = q * alpha * normal + p * self.exact_vectors[:, None, :]
        return exact.reshape(-1, 2), (self.unit * q).ravel()

    @property
    def exact(self) -> ObjectArray:
        """Each direction times a positive number that makes it integral, shape (n k, 2)."""
        return self._integers[0]

    @cached_property
    def _crosses(self) -> tuple[FloatArray, SignArray]:
        """Cross products of all pairs, and their exact signs.

        With ``c = T1 × T2`` and ``d = T1 · T2`` the cross product of two directions is
        ``c (α1 α2 + β1 β2) + d (β1 α2 − α1 β2)``. Each of the two terms carries at most eight
        roundings, each relative to the sum of the magnitudes of its products, so 16 unit
        roundoffs of these magnitudes bound the error. Where every product has a factor 0, it is 0.
        Values of nearly parallel directions are taken from integers, so that all have a
        relative accuracy of 1e-9 or better; their signs are too, for a value may be smaller than
        any double.
        """
        x, y = self.vectors.T
        xy, yx = np.outer(x, y), np.outer(y, x)
        xx, yy = np.outer(x, x), np.outer(y, y)
        alpha, beta = self.across.ravel(), self.along.ravel()
        k = self.along.shape[1]

        def of_edges(each: FloatArray) -> FloatArray:
            return each.repeat(k, axis=0).repeat(k, axis=1)

        aa, bb = np.outer(alpha, alpha), np.outer(beta, beta)
        difference = np.outer(beta, alpha) - np.outer(alpha, beta)
        value = of_edges(xy - yx) * (aa + bb) + difference * of_edges(xx + yy)
        bound = of_edges(np.abs(xy) + np.abs(yx)) * (aa + np.abs(bb))
        bound += np.abs(difference) * of_edges(np.abs(xx) + np.abs(yy))
        bound *= 16 * UNIT_ROUNDOFF
        inaccurate = np.maximum(bound, _NEARLY_PARALLEL * np.outer(self.lengths, self.lengths))
        sx, sy = np.abs(np.sign(x)), np.abs(np.sign(y))
        crossing = of_edges(np.outer(sx, sy) + np.outer(sy, sx))
        aligned = of_edges(np.outer(sx, sx) + np.outer(sy, sy))
        open_ = (np.abs(value) <= inaccurate) & (
            (crossing > 0) | ((difference != 0) & (aligned > 0))
        )
        first, second = np.nonzero(np.triu(open_, 1))
        if first.size:
            e1, e2 = self.exact[first], self.exact[second]
            exact = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
            factor = self._integers[1][first] * self._integers[1][second]
            accurate = np.array([c / f for c, f in zip(exact, factor, strict=True)], dtype=float)
            value[first, second] = accurate
            value[second, first] = -accurate
        np.fill_diagonal(value, 0.0)
        sign = np.sign(value).astype(np.int8)
        if first.size:
            sign[first, second] = [(c > 0) - (c < 0) for c in exact]
            sign[second, first] = -sign[first, second]
        return value, sign

    @property
    def cross(self) -> FloatArray:
        """``d_r × d_s`` of all pairs, to a relative accuracy of 1e-9 or better, (n k, n k)."""
        return self._crosses[0]

    @property
    def cross_sign(self) -> SignArray:
        """Exact sign of ``d_r × d_s``, shape (n k, n k)."""
        return self._crosses[1]

    @cached_property
    def sine(self) -> FloatArray:
        """Sine of the angle from direction r to direction s, shape (n k, n k)."""
        return self.cross / np.outer(self.lengths, self.lengths)


@dataclass(frozen=True, eq=False)
class Cones:
    """The friction cones of all edges of one object, as arrays.

    Ray ``2 i`` is the clockwise boundary of the cone of edge ``i``, ray ``2 i + 1`` the
    counter-clockwise one.

    Parameters
    ----------
    starts, ends : numpy.ndarray, shape (n, 2)
        First and last point of each edge, in the unit of the object.
    friction : numpy.ndarray, shape (n,)
        μ of each edge.

    Notes
    -----
    Torques are taken about the lower left corner of the bounding box, so that they do not depend
    on where the object lies.
    """

    starts: FloatArray
    ends: FloatArray
    friction: FloatArray

    @classmethod
    def of(cls, polygon: Polygon, friction: ArrayLike) -> Cones:
        """Return the cones of the edges of `polygon` under `friction`.

        Raises
        ------
        PolygonError
            If `polygon` is not a `Polygon`.
        FrictionError
            As `per_edge_friction`.
        """
        if not isinstance(polygon, Polygon):
            raise PolygonError(f"expected a Polygon, got {type(polygon).__name__}: Polygon(points)")
        return cls(
            polygon.edge_starts,
            polygon.edge_ends,
            per_edge_friction(friction, polygon.n_edges),
        )

    @property
    def n_edges(self) -> int:
        """Number of edges."""
        return len(self.starts)

    @cached_property
    def vectors(self) -> FloatArray:
        """Vector of each edge, shape (n, 2)."""
        return self.ends - self.starts

    @cached_property
    def lengths(self) -> FloatArray:
        """Length of each edge, shape (n,)."""
        return np.hypot(self.vectors[:, 0], self.vectors[:, 1])

    @cached_property
    def local_starts(self) -> FloatArray:
        """First point of each edge, from the lower left corner of the bounding box."""
        return np.asarray(self.starts - self.starts.min(axis=0))

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box: the object's own unit of length."""
        extent = self.starts.max(axis=0) - self.starts.min(axis=0)
        return float(np.hypot(extent[0], extent[1]))

    @cached_property
    def _exact(self) -> tuple[ObjectArray, ObjectArray, int]:
        both, unit = as_integers(np.stack((self.starts, self.ends)))
        return both[0], both[1] - both[0], unit

    @property
    def exact_starts(self) -> ObjectArray:
        """`starts` as integers, in a unit that makes them so, shape (n, 2)."""
        return self._exact[0]

    @property
    def exact_vectors(self) -> ObjectArray:
        """`vectors` as integers, in the unit of `exact_starts`, shape (n, 2)."""
        return self._exact[1]

    @property
    def exact_unit(self) -> int:
        """How many of the units of `exact_starts` make one unit of the object."""
        return self._exact[2]

    @cached_property
    def boundary(self) -> Directions:
        """The boundary rays ``rot90(T) ± μ T`` as directions."""
        slide = np.stack((self.friction, -self.friction), axis=1)
        return Directions(self.vectors, *self._exact[1:], np.ones(slide.shape), slide)

    @cached_property
    def lines(self) -> Directions:
        """Three directions an edge: its two boundary rays, and the edge itself."""
        ones, zeros = np.ones(self.n_edges), np.zeros(self.n_edges)
        across = np.stack((ones, ones, zeros), axis=1)
        along = np.stack((self.friction, -self.friction, ones), axis=1)
        return Directions(self.vectors, *self._exact[1:], across, along)

    @property
    def rays(self) -> FloatArray:
        """Boundary rays ``rot90(T) ± μ T``, shape (2 n, 2)."""
        return self.boundary.values

    @property
    def unit_rays(self) -> FloatArray:
        """The rays scaled to length 1, shape (2 n, 2)."""
        return self.boundary.units

    @property
    def exact_rays(self) -> ObjectArray:
        """Each ray times a positive number that makes it integral, shape (2 n, 2)."""
        return self.boundary.exact

    @property
    def cross(self) -> FloatArray:
        """``e_r × e_s`` of all pairs of rays, relatively accurate to 1e-9, shape (2 n, 2 n)."""
        return self.boundary.cross

    @property
    def cross_sign(self) -> SignArray:
        """Exact sign of ``e_r × e_s``, shape (2 n, 2 n)."""
        return self.boundary.cross_sign

    @property
    def sine(self) -> FloatArray:
        """Sine of the angle from ray r to ray s, shape (2 n, 2 n)."""
        return self.boundary.sine

    @cached_property
    def opposite(self) -> BoolArray:
        """Whether two rays are exactly opposite, shape (2 n, 2 n)."""
        result: BoolArray = (self.cross_sign == 0) & (self.rays @ self.rays.T < 0)
        return result


def spanning(cones: Cones, edges: IntArray) -> BoolArray:
    """Whether the boundary rays of the contacts positively span the plane, exactly.

    They do not iff some ``y ≠ 0`` has ``y · e >= 0`` for all of them; the cone of such ``y`` is
    pointed and has an extreme one, perpendicular to a ray: so it suffices that no ray has all
    others on one closed side.

    Parameters
    ----------
    cones : Cones
    edges : numpy.ndarray of int, shape (N, m)
        Edge of each contact.

    Returns
    -------
    numpy.ndarray of bool, shape (N,)
    """
    rays = rays_of(edges)
    result = np.ones(len(edges), dtype=bool)
    for k in range(rays.shape[1]):
        signs = cones.cross_sign[rays[:, k, None], rays]
        result &= (signs > 0).any(axis=1) & (signs < 0).any(axis=1)
    return result


def rays_of(edges: IntArray) -> IntArray:
    """Return the numbers of the rays of contacts on `edges`, shape (N, 2 m), contact by contact."""
    return np.stack((2 * edges, 2 * edges + 1), axis=-1).reshape(len(edges), 2 * edges.shape[1])


def as_integers(values: FloatArray) -> tuple[ObjectArray, int]:
    """Write doubles as integers over one common power of two: ``values = integers / unit``."""
    fractions = [Fraction(float(v)) for v in values.ravel()]
    unit = max((f.denominator for f in fractions), default=1)
    integers = np.empty(len(fractions), dtype=object)
    integers[:] = [f.numerator * (unit // f.denominator) for f in fractions]
    return integers.reshape(values.shape), unit
