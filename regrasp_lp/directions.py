"""Directions relative to edges, and exact answers about how they turn to each other.

The *sign* of a cross product of two directions is decided exactly, by a floating-point filter and
integers for what the filter leaves open.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ObjectArray = NDArray[np.object_]
SignArray = NDArray[np.int8]

UNIT_ROUNDOFF = 2.0**-53
_NEARLY_PARALLEL = 1e-5


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
