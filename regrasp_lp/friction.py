"""Friction cones of the edges of a polygon, and exact answers about their boundary rays.

Edge ``i`` runs along ``T = b - a``; with ``rot90(x, y) = (-y, x)`` its cone is bounded by

    e = rot90(T) ± μ T        (+: the clockwise ray, −: the counter-clockwise one),

unnormalised, so that every ray is rational in the coordinates and μ. All that the rest of the
package asks about directions is the *sign* of a cross product of two rays: `directions` decides it
exactly.

A hand may not be able to touch all of an edge. What can be touched are *segments* of edges, and all
that is said of edges holds for these: they are shorter edges, with exactly the same directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regrasp_lp.contact import FRACTION_SNAP
from regrasp_lp.directions import UNIT_ROUNDOFF as UNIT_ROUNDOFF
from regrasp_lp.directions import Directions
from regrasp_lp.errors import FrictionError, PolygonError
from regrasp_lp.polygon import Polygon

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.integer[Any]]
BoolArray = NDArray[np.bool_]
ObjectArray = NDArray[np.object_]
SignArray = NDArray[np.int8]

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
    """The friction cones of all edges of one object, or of segments of them, as arrays.

    Ray ``2 i`` is the clockwise boundary of the cone of edge ``i``, ray ``2 i + 1`` the
    counter-clockwise one. Of `touching` an "edge" is a segment of an edge of the object.

    Parameters
    ----------
    starts, ends : numpy.ndarray, shape (n, 2)
        First and last point of each edge, in the unit of the object; of a segment the nearest
        doubles.
    friction : numpy.ndarray, shape (n,)
        μ of each edge.
    edge : numpy.ndarray of int, shape (n,)
        The edge of the object that each is a segment of.
    lower, upper : numpy.ndarray, shape (n,)
        The fractions of that edge at which it starts and ends: 0 and 1 of a whole edge.
    group : numpy.ndarray of int, shape (n,)
        Which fingers may touch it: 0 unless these differ (`Hand.groups`).
    whole_edges : Cones, optional
        Those of all edges of the object, if these are of segments.

    Notes
    -----
    Torques are taken about the lower left corner of the bounding box, so that they do not depend
    on where the object lies.
    """

    starts: FloatArray
    ends: FloatArray
    friction: FloatArray
    edge: IntArray
    lower: FloatArray
    upper: FloatArray
    group: IntArray
    whole_edges: Cones | None = None

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
        n = polygon.n_edges
        return cls(
            polygon.edge_starts,
            polygon.edge_ends,
            per_edge_friction(friction, n),
            np.arange(n),
            np.zeros(n),
            np.ones(n),
            np.zeros(n, dtype=np.intp),
        )

    def touching(
        self,
        edge: IntArray,
        lower: FloatArray,
        upper: FloatArray,
        group: IntArray | None = None,
    ) -> Cones:
        """Return the cones of segments of these edges, all that fingers may touch.

        Parameters
        ----------
        edge : numpy.ndarray of int, shape (S,)
            Ascending.
        lower, upper : numpy.ndarray, shape (S,)
            Fractions of the edge, lower < upper, read as the rationals they are. Segments of one
            edge and group ascend and have no point in common.
        group : numpy.ndarray of int, shape (S,), optional
            Which fingers may touch each; all by default.

        Returns
        -------
        Cones
        """
        vectors = self.vectors[edge]
        starts = self.starts[edge] + lower[:, None] * vectors
        ends = self.starts[edge] + upper[:, None] * vectors
        ends = np.where(upper[:, None] == 1, self.ends[edge], ends)
        if group is None:
            group = np.zeros(len(edge), dtype=np.intp)
        return Cones(starts, ends, self.friction[edge], edge, lower, upper, group, self)

    @property
    def whole(self) -> Cones:
        """The cones of the whole edges: of all that `edge`, `lower` and `upper` refer to."""
        return self if self.whole_edges is None else self.whole_edges

    @property
    def n_edges(self) -> int:
        """Number of edges, or segments."""
        return len(self.starts)

    @cached_property
    def vectors(self) -> FloatArray:
        """Vector of each edge, shape (n, 2)."""
        if self.whole_edges is None:
            return self.ends - self.starts
        return (self.upper - self.lower)[:, None] * self.whole.vectors[self.edge]

    @cached_property
    def lengths(self) -> FloatArray:
        """Length of each edge, shape (n,)."""
        return np.hypot(self.vectors[:, 0], self.vectors[:, 1])

    @cached_property
    def local_starts(self) -> FloatArray:
        """First point of each edge, from the lower left corner of the bounding box."""
        if self.whole_edges is None:
            return np.asarray(self.starts - self.corner)
        whole = self.whole
        moved = self.lower[:, None] * whole.vectors[self.edge]
        return np.asarray(whole.local_starts[self.edge] + moved)

    @cached_property
    def local_ends(self) -> FloatArray:
        """Last point of each edge, from there."""
        if self.whole_edges is None:
            return np.asarray(self.ends - self.corner)
        return self.local_starts + self.vectors

    @cached_property
    def corner(self) -> FloatArray:
        """The lower left corner of the bounding box of the object."""
        return np.asarray(self.whole.starts.min(axis=0))

    @cached_property
    def reach(self) -> FloatArray:
        """How far points of each (whole) edge may be from that corner, shape (n,)."""
        whole = self.whole
        reach = np.hypot(whole.local_starts[:, 0], whole.local_starts[:, 1]) + whole.lengths
        return np.asarray(reach[self.edge])

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box: the object's own unit of length."""
        extent = self.whole.starts.max(axis=0) - self.corner
        return float(np.hypot(extent[0], extent[1]))

    @cached_property
    def _exact(self) -> tuple[ObjectArray, ObjectArray, int]:
        if self.whole_edges is None:
            both, unit = as_integers(np.stack((self.starts, self.ends)))
            return both[0], both[1] - both[0], unit
        starts, vectors, unit = self.whole._exact
        (lower, upper), parts = as_integers(np.stack((self.lower, self.upper)))
        vectors = vectors[self.edge]
        starts = parts * starts[self.edge] + lower[:, None] * vectors
        return starts, (upper - lower)[:, None] * vectors, unit * parts

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
        return self._directions(np.ones(slide.shape), slide)

    @cached_property
    def lines(self) -> Directions:
        """Three directions an edge: its two boundary rays, and the edge itself."""
        ones, zeros = np.ones(self.n_edges), np.zeros(self.n_edges)
        across = np.stack((ones, ones, zeros), axis=1)
        along = np.stack((self.friction, -self.friction, ones), axis=1)
        return self._directions(across, along)

    def _directions(self, across: FloatArray, along: FloatArray) -> Directions:
        """Directions to whole edges: those to their segments are the same, bit for bit."""
        whole = self.whole
        vectors, exact = whole.vectors[self.edge], whole.exact_vectors[self.edge]
        return Directions(vectors, exact, whole.exact_unit, across, along)

    def places(
        self, edges: IntArray, fractions: FloatArray, group: IntArray | None = None
    ) -> tuple[IntArray, FloatArray]:
        """Return on which segments places on edges of the object are, decided exactly.

        Parameters
        ----------
        edges, fractions : numpy.ndarray, shape (K,)
        group : numpy.ndarray of int, shape (K,), optional
            Which fingers are there; any by default.

        Returns
        -------
        segments : numpy.ndarray of int, shape (K,)
            -1 for none.
        fractions : numpy.ndarray, shape (K,)
            Of the edges; places that are off a segment by no more than `FRACTION_SNAP` are now at
            its end.
        """
        near = np.clip(fractions[:, None], self.lower, self.upper)
        here = edges[:, None] == self.edge
        if group is not None:
            here &= group[:, None] == self.group
        off = np.where(here, np.abs(near - fractions[:, None]), np.inf)
        if not self.n_edges:
            return np.full(len(edges), -1), fractions
        every, segments = np.arange(len(edges)), off.argmin(axis=1)
        on = off[every, segments] <= FRACTION_SNAP
        return np.where(on, segments, -1), np.where(on, near[every, segments], fractions)

    def within(self, segments: IntArray, fractions: FloatArray) -> FloatArray:
        """Return fractions of edges as fractions of segments of them, to the nearest double."""
        lower, upper = self.lower[segments], self.upper[segments]
        return np.asarray(np.clip((fractions - lower) / (upper - lower), 0.0, 1.0))

    def along(self, segments: IntArray, fractions: FloatArray) -> FloatArray:
        """Return fractions of segments as fractions of their edges, never beyond their ends."""
        lower, upper = self.lower[segments], self.upper[segments]
        inside = np.clip(lower + fractions * (upper - lower), lower, upper)
        return np.asarray(np.where(fractions == 1, upper, inside))

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
