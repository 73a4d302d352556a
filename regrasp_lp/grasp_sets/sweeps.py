"""Regions ``E ⊕ s C``: what a cone sweeps along an edge, on one of its two sides.

A focus point q sees a contact p on edge E through the double-sided cone C iff ``s (q - p)`` is in
C for a side ``s = ±1``. The q that see some contact of the edge fill the convex region ``E ⊕ s C``
with three boundary lines: two along the boundaries of the cone through one end of the edge each,
and the line of the edge itself (chapter, section 3.3.1.1). Focus cells are intersections of such
regions; whether these have an interior is decided here, exactly, by Helly's theorem:

    open convex sets in the plane have a common point iff every three of them have.

Applied to regions and then to their half-planes, it leaves three lines at a time: half-planes
``(q - p_k) × d_k > 0`` whose directions are balanced, ``Σ λ_k d_k = 0`` with λ > 0, have a common
point iff ``Σ λ_k p_k × d_k < 0``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from typing import TypeAlias

import numpy as np

from regrasp_lp.circuits import cross
from regrasp_lp.friction import (
    UNIT_ROUNDOFF,
    BoolArray,
    Cones,
    FloatArray,
    IntArray,
    ObjectArray,
    SignArray,
)
from regrasp_lp.linear_sets import LinearSets

_ROUNDINGS = 64 * UNIT_ROUNDOFF
_OTHERS = ((1, 2), (2, 0), (0, 1))  # than line 0, 1 and 2
_NEARLY = 1e-6  # a corner of a set, as far as rounding lets one tell

LineChoice: TypeAlias = tuple[tuple[int, int], ...]
"""Some lines of some regions: (region, line) each."""

_PAIRS = tuple(combinations(range(3), 2))
_OF_TWO: tuple[LineChoice, ...] = (
    *(((0, i), (0, j), (1, k)) for i, j in _PAIRS for k in range(3)),
    *(((0, k), (1, i), (1, j)) for i, j in _PAIRS for k in range(3)),
    *(((0, i), (1, j)) for i, j in product(range(3), repeat=2)),
)
_OF_THREE: tuple[LineChoice, ...] = tuple(
    ((0, i), (1, j), (2, k)) for i, j, k in product(range(3), repeat=3)
)


@dataclass(frozen=True, eq=False)
class Sweeps:
    """R regions, each the points q with ``(q - p) × d > 0`` for three lines (p, d).

    Parameters
    ----------
    cones : Cones
    line : numpy.ndarray of int, shape (R, 3)
        Number of the direction of each line in ``cones.lines``.
    sign : numpy.ndarray of int, shape (R, 3)
        -1 where d runs against that direction.
    point : numpy.ndarray of int, shape (R, 3)
        A point p of each line: the start of edge i is number i, its end number n + i.
    """

    cones: Cones
    line: IntArray
    sign: IntArray
    point: IntArray

    @classmethod
    def of_cones(cls, cones: Cones) -> Sweeps:
        """Return the regions of the friction cones of all edges.

        Region ``2 i`` is ``E_i ⊕ C_i``, region ``2 i + 1`` is ``E_i ⊕ -C_i``.
        """
        edges = np.arange(cones.n_edges)
        rays = np.stack((2 * edges, 2 * edges + 1), axis=1)
        return cls.of_rays(cones, edges, rays, np.ones_like(rays))

    @classmethod
    def of_rays(cls, cones: Cones, edges: IntArray, rays: IntArray, signs: IntArray) -> Sweeps:
        """Return the regions of narrower cones, two to a row: side +1, then side -1.

        Parameters
        ----------
        cones : Cones
        edges : numpy.ndarray of int, shape (N,)
        rays, signs : numpy.ndarray of int, shape (N, 2)
            Clockwise and counter-clockwise boundary of a cone within the friction cone of the
            edge: numbers of rays, and -1 where the boundary runs against its ray.
        """
        n = cones.n_edges
        clockwise, counter = (3 * (rays // 2) + rays % 2).T
        line = np.stack((counter, clockwise, 3 * edges + 2), axis=1)
        sign = np.stack((signs[:, 1], -signs[:, 0], -np.ones_like(edges)), axis=1)
        ahead = np.stack((edges, edges + n, edges), axis=1)
        behind = np.stack((edges + n, edges, edges), axis=1)
        return cls(
            cones,
            line.repeat(2, axis=0),
            np.stack((sign, -sign), axis=1).reshape(-1, 3),
            np.stack((ahead, behind), axis=1).reshape(-1, 3),
        )

    def __len__(self) -> int:
        return len(self.line)

    def join(self, other: Sweeps) -> Sweeps:
        """Return these regions, then those of another stack."""
        pairs = ((self.line, other.line), (self.sign, other.sign), (self.point, other.point))
        return Sweeps(self.cones, *(np.concatenate(pair) for pair in pairs))

    def linear_sets(self, regions: IntArray) -> LinearSets:
        """Return intersections of regions as linear sets over "x" and "y".

        The margin of a point is its least distance to a boundary line. The box contains all of a
        bounded set.

        Parameters
        ----------
        regions : numpy.ndarray of int, shape (K, r)

        Returns
        -------
        LinearSets
            K sets of 3 r rows; coordinates are from the lower left corner of the object.
        """
        lines = (3 * regions[..., None] + np.arange(3)).reshape(len(regions), -1)
        d, p = self._directions[lines], self._points[lines]
        rows = np.stack((-d[..., 1], d[..., 0]), axis=-1)
        bounds = np.einsum("krx,krx->kr", rows, p)
        box = _box(rows, bounds, self.cones.size)
        return LinearSets(("x", "y"), rows, np.ones(bounds.shape), bounds, *box)

    def any_meet(self, regions: IntArray) -> BoolArray:
        """Whether some choice of regions has an interior point in common, exactly.

        Parameters
        ----------
        regions : numpy.ndarray of int, shape (K, C, r)
            C choices of r >= 2 regions for each of K questions.

        Returns
        -------
        numpy.ndarray of bool, shape (K,)
        """
        k, c, r = regions.shape
        return np.asarray(self.meet(regions.reshape(k * c, r)).reshape(k, c).any(axis=1))

    def meet(self, regions: IntArray) -> BoolArray:
        """Whether intersections of regions have an interior, exactly.

        Parameters
        ----------
        regions : numpy.ndarray of int, shape (K, r)
            Numbers of r >= 2 regions each.

        Returns
        -------
        numpy.ndarray of bool, shape (K,)
        """
        possible = np.ones(len(regions), dtype=bool)
        for count, choices in ((2, _OF_TWO), (3, _OF_THREE)):
            for columns in combinations(range(regions.shape[1]), count):
                rows = np.flatnonzero(possible)
                each, index = _distinct(np.sort(regions[rows][:, columns], axis=1), len(self))
                possible[rows] = self._possible(each, choices)[index]
        return possible

    def _possible(self, regions: IntArray, choices: Sequence[LineChoice]) -> BoolArray:
        """Which regions none of the choices of their lines keeps from meeting."""
        left = np.arange(len(regions))
        for choice in choices:
            if not left.size:
                break
            of_region, number = np.array(choice).T
            left = left[~self._closed(3 * regions[left][:, of_region] + number)]
        possible = np.zeros(len(regions), dtype=bool)
        possible[left] = True
        return possible

    def _closed(self, lines: IntArray) -> BoolArray:
        """Whether two or three half-planes are balanced and have no common interior point."""
        line, sign = self.line.ravel()[lines], self.sign.ravel()[lines]
        turns = [
            sign[:, i] * sign[:, j] * self.cones.lines.cross_sign[line[:, i], line[:, j]]
            for i, j in (((0, 1),) if lines.shape[1] == 2 else _OTHERS)
        ]
        if lines.shape[1] == 2:
            d = self._directions[lines]
            circuit = (turns[0] == 0) & (np.einsum("kx,kx->k", d[:, 0], d[:, 1]) < 0)
        else:
            circuit = (turns[0] != 0) & (turns[1] == turns[0]) & (turns[2] == turns[0])
        rows = np.flatnonzero(circuit)
        closed = np.zeros(len(lines), dtype=bool)
        closed[rows] = self._total_sign(lines[rows]) >= 0
        return closed

    def _total_sign(self, lines: IntArray) -> SignArray:
        """Exact sign of ``Σ λ p × d`` over balanced lines, shape (K,)."""
        line, sign = self.line.ravel()[lines], self.sign.ravel()[lines]
        weights = np.ones(lines.shape)
        if lines.shape[1] == 3:
            sines = [self.cones.lines.sine[line[:, i], line[:, j]] for i, j in _OTHERS]
            weights = np.abs(np.stack(sines, axis=1))
        points = self._points[lines]
        total = (weights * cross(points, self._directions[lines])).sum(axis=1)
        error = _ROUNDINGS * np.hypot(points[..., 0], points[..., 1]).sum(axis=1)
        result: SignArray = np.sign(total).astype(np.int8)
        open_ = np.flatnonzero(np.abs(total) <= error)
        if open_.size:
            point = self.point.ravel()[lines[open_]]
            result[open_] = self._exact_sign(line[open_], sign[open_], point)
        return result

    def _exact_sign(self, line: IntArray, sign: IntArray, point: IntArray) -> SignArray:
        """The same in integers."""
        d = self.cones.lines.exact[line] * sign.astype(object)[..., None]
        if line.shape[1] == 2:
            weights = [-(d[:, 0] * d[:, 1]).sum(axis=1), (d[:, 0] * d[:, 0]).sum(axis=1)]
        else:
            weights = [np.abs(cross(d[:, i], d[:, j])) for i, j in _OTHERS]
        moments = cross(self._exact_points[point], d)
        total = sum(weight * moments[:, k] for k, weight in enumerate(weights))
        signs = [(t > 0) - (t < 0) for t in np.asarray(total)]
        return np.array(signs, dtype=np.int8)

    @cached_property
    def _directions(self) -> FloatArray:
        """Unit vector d of each line, shape (3 R, 2)."""
        return np.asarray(self.cones.lines.units[self.line.ravel()] * self.sign.ravel()[:, None])

    @cached_property
    def _points(self) -> FloatArray:
        """Point p of each line, from the lower left corner of the object, shape (3 R, 2)."""
        every = np.concatenate((self.cones.local_starts, self.cones.local_ends))
        return np.asarray(every[self.point.ravel()])

    @cached_property
    def _exact_points(self) -> ObjectArray:
        starts = self.cones.exact_starts
        return np.concatenate((starts, starts + self.cones.exact_vectors))


def _distinct(rows: IntArray, base: int) -> tuple[IntArray, IntArray]:
    """Distinct rows of numbers below `base`, and which of them each row is."""
    key = np.zeros(len(rows), dtype=np.int64)
    for column in rows.T:
        key = key * base + column
    _, first, index = np.unique(key, return_index=True, return_inverse=True)
    return rows[first], index


def _box(rows: FloatArray, bounds: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
    """A box around all corners of each set, and some more; any box where there is no corner."""
    i, j = np.array(list(combinations(range(rows.shape[1]), 2))).T
    det = rows[:, i, 0] * rows[:, j, 1] - rows[:, i, 1] * rows[:, j, 0]
    x = bounds[:, i] * rows[:, j, 1] - rows[:, i, 1] * bounds[:, j]
    y = rows[:, i, 0] * bounds[:, j] - bounds[:, i] * rows[:, j, 0]
    parallel = np.abs(det) <= UNIT_ROUNDOFF
    at = np.stack((x, y), axis=2) / np.where(parallel, 1.0, det)[..., None]
    excess = np.einsum("kpx,krx->kpr", at, rows) - bounds[:, None, :]
    allowed = _NEARLY * (size + np.abs(at).max(axis=2))
    corner = ~parallel & (excess.max(axis=2) <= allowed)
    lower = np.where(corner[..., None], at, np.inf).min(axis=1)
    upper = np.where(corner[..., None], at, -np.inf).max(axis=1)
    any_corner = corner.any(axis=1)[:, None]
    return np.where(any_corner, lower, 0.0) - size, np.where(any_corner, upper, size) + size


def sides_of(contacts: int) -> IntArray:
    """Return all choices of a side per contact, as 0 (+1) and 1 (-1), shape (2^m, m).

    Examples
    --------
    >>> sides_of(2).tolist()
    [[0, 0], [0, 1], [1, 0], [1, 1]]
    """
    return np.array(list(product((0, 1), repeat=contacts)))
