"""How much friction grasps need."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Unpack, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regrasp_lp.friction import BoolArray, FloatArray
from regrasp_lp.polygon import Polygon
from regrasp_lp.quality.grasps import GraspLike, Grasps, Places, measure
from regrasp_lp.quality.hulls import triples
from regrasp_lp.wrenches import closure_from_signs, decide

_LOWEST, _HIGHEST = -30, 12  # powers of two between which floating point looks for the factor
_LEAST_POWER, _MOST_POWER = -1000, 300  # and between which rational numbers do
_ROUNDING = 1e-14  # of determinants of wrenches of length around 1
_HALVINGS = 31  # of the interval from a power of two to the next


@overload
def required_friction(polygon: Polygon, grasp: GraspLike, friction: ArrayLike = 1.0) -> float: ...


@overload
def required_friction(
    polygon: Polygon,
    grasp: None = None,
    friction: ArrayLike = 1.0,
    *,
    edges: ArrayLike,
    **places: Unpack[Places],
) -> FloatArray: ...


def required_friction(
    polygon: Polygon,
    grasp: GraspLike | None = None,
    friction: ArrayLike = 1.0,
    *,
    edges: ArrayLike | None = None,
    positions: ArrayLike | None = None,
    fractions: ArrayLike | None = None,
) -> float | FloatArray:
    """Return the least factor of the friction at which grasps are in force closure.

    ``inf {κ : the contacts are in force closure under κ μ}``; with the μ of 1 that is the default
    it is the required friction coefficient itself. The cones grow with κ, so that force closure is
    monotone and bisection finds the threshold.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp or iterable of (edge, position), optional
        One grasp; leave it out for a batch.
    friction : float or sequence of float, optional
        μ, one value or one per edge.
    edges, positions, fractions : array_like, shape (N, m), optional
        A batch: the edges, and either positions along them or fractions of their lengths.

    Returns
    -------
    float or numpy.ndarray, shape (N,)
        A pure number, the less the better, to a billionth of it: below 1 iff the grasp is in force
        closure under `friction` (but for rounding), 0 if any friction will do, inf if none will
        (or none below 2^300 times `friction`).

    See Also
    --------
    regrasp_lp.least_friction : Of one grasp, decided in rational numbers.

    Examples
    --------
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    >>> round(required_friction(square, [(0, 0.5), (2, 0.25)]), 8)
    0.25
    >>> required_friction(square, edges=[(0, 2), (0, 0)], fractions=[(0.5, 0.5), (0.2, 0.7)])
    array([ 0., inf])
    """
    return measure(_factors, polygon, grasp, friction, edges, positions, fractions)


def _factors(grasps: Grasps) -> FloatArray:
    bare = _BareWrenches.of(grasps)
    low, high = np.full(len(grasps), _LOWEST), np.full(len(grasps), _HIGHEST)
    while (high - low).max(initial=0) > 1:  # the power of two, by its exponent
        middle = (low + high) // 2
        held = bare.closed(2.0**middle)
        low, high = np.where(held, low, middle), np.where(held, middle, high)
    below, above = 2.0**low, 2.0**high
    for _ in range(_HALVINGS):
        between = (below + above) / 2
        held = bare.closed(between)
        below, above = np.where(held, below, between), np.where(held, between, above)
    at_all = bare.closed_by_any()
    factors = np.where(at_all, above, np.inf)
    beyond = np.flatnonzero(at_all & ((low == _LOWEST) | (high == _HIGHEST)))
    factors[beyond] = _by_rationals(grasps, beyond)
    return factors


@dataclass(frozen=True, eq=False)
class _BareWrenches:
    """Contacts of N grasps, from which wrenches under any friction are made; arrays (m, N).

    Parameters
    ----------
    x, y : numpy.ndarray
        The contacts, from the centroid, in diameters of the object.
    normal, tangent : tuple of numpy.ndarray
        Both coordinates of the unit vectors.
    friction : numpy.ndarray
    """

    x: FloatArray
    y: FloatArray
    normal: tuple[FloatArray, FloatArray]
    tangent: tuple[FloatArray, FloatArray]
    friction: FloatArray

    @classmethod
    def of(cls, grasps: Grasps) -> _BareWrenches:
        x, y = _by_contact(grasps.points / grasps.polygon.diameter)
        normal, tangent = _by_contact(grasps.normals), _by_contact(grasps.tangents)
        return cls(x, y, normal, tangent, np.ascontiguousarray(grasps.friction.T))

    def closed(self, factors: FloatArray) -> BoolArray:
        """Whether grasps are in force closure under a factor of friction each, but for rounding.

        By the signs of determinants of wrenches (`regrasp_lp.wrenches`). That of the two rays of a
        contact with a third one is the torque of the third about that contact, times their cross
        product: said so, it is accurate for cones as narrow as one likes.
        """
        slide = (factors * self.friction)[:, None] * np.array([[1.0], [-1.0]])
        length = 1 + np.abs(slide)
        x, y = self.x.repeat(2, axis=0), self.y.repeat(2, axis=0)
        ex, ey = (
            ((n[:, None] + slide * t[:, None]) / length).reshape(x.shape)
            for n, t in zip(self.normal, self.tangent, strict=True)
        )
        value = _determinants(x, y, ex, ey)
        i, j, k = triples(len(x)).T
        same = np.flatnonzero((i // 2 == j // 2) | (j // 2 == k // 2))
        here, there = j[same], np.where(i[same] // 2 == j[same] // 2, k[same], i[same])
        value[same] = (x[there] - x[here]) * ey[there] - (y[there] - y[here]) * ex[there]
        return closure_from_signs(len(x), value > _ROUNDING, value < -_ROUNDING)

    def closed_by_any(self) -> BoolArray:
        """Whether any friction will do: that of cones that are half-planes (`least_friction`)."""
        x, y = self.x.repeat(3, axis=0), self.y.repeat(3, axis=0)
        ex, ey = (
            np.stack((n, t, -t), axis=1).reshape(x.shape)
            for n, t in zip(self.normal, self.tangent, strict=True)
        )
        value = _determinants(x, y, ex, ey)
        return closure_from_signs(len(x), value > _ROUNDING, value < -_ROUNDING)


def _determinants(x: FloatArray, y: FloatArray, ex: FloatArray, ey: FloatArray) -> FloatArray:
    """Determinants of the wrenches of every three forces ``e`` at points, arrays (rays, N)."""
    torque = x * ey - y * ex
    i, j, k = triples(len(x)).T
    return np.asarray(
        torque[i] * (ex[j] * ey[k] - ey[j] * ex[k])
        - torque[j] * (ex[i] * ey[k] - ey[i] * ex[k])
        + torque[k] * (ex[i] * ey[j] - ey[i] * ex[j])
    )


def _by_rationals(grasps: Grasps, rows: NDArray[np.intp]) -> FloatArray:
    """Factors that are smaller, or larger, than floating point can tell: by the exact test."""
    mu = grasps.cones.friction

    def held(factor: float, chosen: NDArray[np.intp]) -> BoolArray:
        scaled = np.maximum(factor * mu, math.ulp(0.0))
        edges = np.asarray(grasps.edges[chosen], dtype=np.intp)
        return decide(grasps.polygon, scaled, edges, grasps.fractions[chosen])

    factors = np.zeros(len(rows))
    if not rows.size:
        return factors
    for n in np.flatnonzero(~held(0.0, rows)):
        row = rows[[n]]
        low, high = _LEAST_POWER, _MOST_POWER
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if held(2.0**middle, row)[0] else (middle, high)
        below, above = 2.0**low, 2.0**high if high < _MOST_POWER else math.inf
        while above < math.inf and above > below * (1 + 1e-9):
            between = (below + above) / 2
            below, above = (below, between) if held(between, row)[0] else (between, above)
        factors[n] = above
    return factors


def _by_contact(vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both coordinates of vectors (N, m, 2), each of shape (m, N)."""
    x, y = np.ascontiguousarray(vectors.transpose(2, 1, 0))
    return x, y
