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
    def rays(self) -> FloatArray:
        """Boundary rays ``rot90(T) ± μ T``, shape (2 n, 2)."""
        x, y = self.vectors.T
        normal = np.stack((-y, x), axis=1)
        sliding = self.friction[:, None] * self.vectors
        return np.stack((normal + sliding, normal - sliding), axis=1).reshape(-1, 2)

    @cached_property
    def ray_lengths(self) -> FloatArray:
        """Length of each ray, shape (2 n,)."""
        return np.hypot(self.rays[:, 0], self.rays[:, 1])

    @cached_property
    def _exact(self) -> tuple[ObjectArray, ObjectArray, ObjectArray, ObjectArray]:
        both, unit = as_integers(np.stack((self.starts, self.ends)))
        start, vector = both[0], both[1] - both[0]
        mu = [Fraction(float(m)) for m in self.friction]
        p = np.array([m.numerator for m in mu], dtype=object)[:, None]
        q = np.array([m.denominator for m in mu], dtype=object)[:, None]
        normal = np.stack((-vector[:, 1], vector[:, 0]), axis=1)
        rays = np.stack((q * normal + p * vector, q * normal - p * vector), axis=1)
        return start, vector, rays.reshape(-1, 2), (unit * q[:, 0]).repeat(2)

    @property
    def exact_starts(self) -> ObjectArray:
        """`starts` as integers, in a unit that makes them so, shape (n, 2)."""
        return self._exact[0]

    @property
    def exact_vectors(self) -> ObjectArray:
        """`vectors` as integers, in the unit of `exact_starts`, shape (n, 2)."""
        return self._exact[1]

    @property
    def exact_rays(self) -> ObjectArray:
        """Each ray times a positive number that makes it integral, shape (2 n, 2)."""
        return self._exact[2]

    @cached_property
    def _crosses(self) -> tuple[FloatArray, NDArray[np.int8]]:
        """Cross products of all pairs of rays, and their exact signs.

        With ``c = T1 × T2``, ``d = T1 · T2`` and ``s = ±1`` for the two sides,
        ``e1 × e2 = c (1 + s1 s2 μ1 μ2) + (s1 μ1 − s2 μ2) d``. Each of the two terms carries at most
        eight roundings, each relative to the sum of the magnitudes of its products, so 16 unit
        roundoffs of these magnitudes bound the error. Where every product has a factor 0, it is 0.
        Values of nearly parallel rays are taken from integers, so that they too have full relative
        accuracy; their signs are too, for a value may be smaller than any double.
        """
        x, y = self.vectors.T
        xy, yx = np.outer(x, y), np.outer(y, x)
        xx, yy = np.outer(x, x), np.outer(y, y)
        slide = np.stack((self.friction, -self.friction), axis=1).ravel()  # s μ of each ray

        def of_rays(of_edges: FloatArray) -> FloatArray:
            return of_edges.repeat(2, axis=0).repeat(2, axis=1)

        product = np.outer(slide, slide)
        difference = slide[:, None] - slide[None, :]
        value = of_rays(xy - yx) * (1 + product) + difference * of_rays(xx + yy)
        bound = of_rays(np.abs(xy) + np.abs(yx)) * (1 + np.abs(product))
        bound += np.abs(difference) * of_rays(np.abs(xx) + np.abs(yy))
        bound *= 16 * UNIT_ROUNDOFF
        lengths = self.ray_lengths
        inaccurate = np.maximum(bound, _NEARLY_PARALLEL * np.outer(lengths, lengths))
        sx, sy = np.abs(np.sign(x)), np.abs(np.sign(y))
        crossing = of_rays(np.outer(sx, sy) + np.outer(sy, sx))
        along = of_rays(np.outer(sx, sx) + np.outer(sy, sy))
        open_ = (np.abs(value) <= inaccurate) & ((crossing > 0) | ((difference != 0) & (along > 0)))
        first, second = np.nonzero(np.triu(open_, 1))
        if first.size:
            e1, e2 = self.exact_rays[first], self.exact_rays[second]
            exact = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
            factor = self._exact[3][first] * self._exact[3][second]
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
        """``e_r × e_s`` of all pairs of rays, to full relative accuracy, shape (2 n, 2 n)."""
        return self._crosses[0]

    @property
    def cross_sign(self) -> NDArray[np.int8]:
        """Exact sign of ``e_r × e_s``, shape (2 n, 2 n)."""
        return self._crosses[1]

    @cached_property
    def unit_rays(self) -> FloatArray:
        """The rays scaled to length 1, shape (2 n, 2)."""
        return self.rays / self.ray_lengths[:, None]

    @cached_property
    def sine(self) -> FloatArray:
        """Sine of the angle from ray r to ray s, shape (2 n, 2 n)."""
        return self.cross / np.outer(self.ray_lengths, self.ray_lengths)

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
