"""How far apart fingers may be and have to be, as rows over where they touch.

The vector from one contact to another, ``x = p_a - p_b``, is linear in their places. That it is no
longer than a span D is said by the polygon of 24 sides inscribed in the disc: rows
``n · x <= D cos(π/24)``, so that vectors shorter than D by 0.9 % are never excluded. That it is no
shorter than a separation d is not convex; it holds if ``n · x >= d`` for one of 16 directions n,
and vectors longer than d by 2 % satisfy one of these: a choice of directions, one for every two
fingers that could come too near, gives convex sets again. On one edge both are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from regrasp_lp.friction import BoolArray, Cones, FloatArray, IntArray

SPAN_SIDES, SEPARATION_SIDES = 24, 16
SPAN_ERROR = float(1 - np.cos(np.pi / SPAN_SIDES))
"""Vectors shorter than the largest span by this part of it satisfy its rows."""
SEPARATION_ERROR = float(1 / np.cos(np.pi / SEPARATION_SIDES) - 1)
"""Vectors longer than the least separation by this part of it satisfy a choice of its rows."""

ROUNDINGS = 2e-9
"""Of the size of the object: what rows keep from the limits, so that rounding breaks none."""

_MOST_CHOICES = 512
_NONE = np.zeros((0, 3))


@dataclass(frozen=True)
class PairRows:
    """What limits two contacts on given segments, as rows ``a f + b g <= c``.

    Parameters
    ----------
    always : numpy.ndarray, shape (R, 3)
        Rows (a, b, c) that have to hold.
    choices : numpy.ndarray, shape (C, 3)
        Rows of which one has to hold; none if C = 0.
    possible : bool
        Whether the contacts can be near and far enough at all.
    """

    always: FloatArray
    choices: FloatArray
    possible: bool = True


@dataclass(frozen=True)
class Alternatives:
    """C convex sets, each R rows (padded with void ones), of which a point has to be in one.

    Parameters
    ----------
    rows : numpy.ndarray, shape (C, R, n)
    bounds : numpy.ndarray, shape (C, R)
    """

    rows: FloatArray
    bounds: FloatArray

    def __len__(self) -> int:
        return len(self.bounds)

    @property
    def void(self) -> bool:
        """Whether nothing is limited."""
        return self.bounds.shape == (1, 0)


@dataclass(frozen=True, eq=False)
class Spacing:
    """Limits to the distances between the fingers of a hand, on one object.

    Parameters
    ----------
    cones : Cones
        Of all that fingers may touch; contacts are fractions of its edges (or segments).
    max_span : float or None
        Largest distance, if there is one.
    separation : float
        Smallest distance.
    sizes : tuple of int, optional
        How many fingers there are of each group of `cones`, if they differ.
    """

    cones: Cones
    max_span: float | None
    separation: float
    sizes: tuple[int, ...] = ()
    _known: dict[tuple[int, int], PairRows] = field(default_factory=dict, repr=False)

    def alternatives(
        self, segments: IntArray, pairs: Sequence[tuple[int, int]], *, ordered: bool = False
    ) -> Alternatives:
        """Return the limits of some pairs of contacts as convex sets of which one has to hold.

        Parameters
        ----------
        segments : numpy.ndarray of int, shape (n,)
            Edges (or segments) of the contacts.
        pairs : sequence of (int, int)
            Which two contacts are limited.
        ordered : bool
            Whether two contacts on one segment are in order, the first one first.

        Returns
        -------
        Alternatives
            Over the fractions of the n contacts; one without rows if nothing is limited, none if
            two contacts can never be near or far enough, or there are not so many fingers.
        """
        n = len(segments)
        if not self._enough(segments):
            return Alternatives(np.zeros((0, 0, n)), np.zeros((0, 0)))
        always: list[tuple[FloatArray, float]] = []
        choices: list[list[tuple[FloatArray, float]]] = []
        for i, j in pairs:
            found = self.between(int(segments[i]), int(segments[j]))
            if not found.possible:
                return Alternatives(np.zeros((0, 0, n)), np.zeros((0, 0)))
            always += [_wide(row, i, j, n) for row in found.always]
            rows = found.choices
            if ordered and segments[i] == segments[j]:
                rows = rows[:1]  # the one in which the first contact comes first
            if len(rows):
                choices.append([_wide(row, i, j, n) for row in rows])
        while np.prod([len(c) for c in choices], dtype=float) > _MOST_CHOICES:
            longest = max(choices, key=len)  # fewer directions: still convex parts of what may be
            longest[:] = longest[::2]
        every = [[*always, *chosen] for chosen in product(*choices)]
        return Alternatives(
            np.array([[row for row, _ in rows] for rows in every]).reshape(len(every), -1, n),
            np.array([[bound for _, bound in rows] for rows in every]).reshape(len(every), -1),
        )

    def _enough(self, segments: IntArray) -> bool:
        """Whether there are different fingers for contacts on segments."""
        if len(self.sizes) < 2:
            return True
        needed = np.bincount(self.cones.group[segments], minlength=len(self.sizes))
        return bool((needed <= self.sizes).all())

    def between(self, first: int, second: int) -> PairRows:
        """Return the limits of two contacts on given segments."""
        key = first, second
        if key not in self._known:
            self._known[key] = self._between(first, second)
        return self._known[key]

    def _between(self, first: int, second: int) -> PairRows:
        cones, slack = self.cones, ROUNDINGS * self.cones.size
        a, b = cones.vectors[first], cones.vectors[second]
        start = cones.local_starts[first] - cones.local_starts[second]
        corners = start + np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) @ np.stack((a, -b))
        distances = np.hypot(*corners.T)
        always = choices = _NONE
        one_line = cones.edge[first] == cones.edge[second]
        if self.max_span is not None and distances.max() > self.max_span - slack:
            reach = self.max_span * (1.0 if one_line else 1 - SPAN_ERROR) - slack
            normals = _directions(a, 2 if one_line else SPAN_SIDES)
            along = normals @ corners.T
            if along.min(axis=1).max() > reach:
                return PairRows(_NONE, _NONE, possible=False)
            normals = normals[along.max(axis=1) > reach]
            always = np.column_stack((normals @ a, -normals @ b, reach - normals @ start))
        # Fingers that may reach different parts of one edge have to pass each other nowhere.
        passing = one_line and cones.group[first] != cones.group[second]
        least = self.separation + slack
        if (self.separation > 0 or passing) and self._nearest(first, second, start) < least:
            normals = -_directions(a, 2 if one_line else SEPARATION_SIDES)
            normals = normals[(normals @ corners.T).max(axis=1) >= least]
            rows = np.column_stack((-normals @ a, normals @ b, normals @ start - least))
            if not len(rows):
                return PairRows(_NONE, _NONE, possible=False)
            choices = rows[_undominated(rows)]
        return PairRows(always, choices)

    def _nearest(self, first: int, second: int, start: FloatArray) -> float:
        """Distance of two segments: of different edges they meet in their ends at most."""
        cones = self.cones
        if cones.edge[first] == cones.edge[second]:
            apart = max(cones.lower[[first, second]]) - min(cones.upper[[first, second]])
            return max(0.0, float(apart * cones.whole.lengths[cones.edge[first]]))
        a, b = cones.vectors[first], cones.vectors[second]
        return min(
            _to_segment(start, b),  # the start of the first from the second, and its end
            _to_segment(start + a, b),
            _to_segment(-start, a),
            _to_segment(b - start, a),
        )


def assignments(
    cones: Cones,
    sizes: Sequence[int],
    edges: IntArray,
    fractions: FloatArray,
    group: IntArray | None = None,
) -> list[tuple[IntArray, FloatArray]]:
    """Return all ways to touch places on edges with different fingers.

    Parameters
    ----------
    cones : Cones
        Of all that fingers may touch.
    sizes : sequence of int
        How many fingers there are of each group; none if they do not differ.
    edges, fractions : numpy.ndarray, shape (K,)
    group : numpy.ndarray of int, shape (K,), optional
        Which fingers are there; any by default.

    Returns
    -------
    list of (numpy.ndarray of int, numpy.ndarray)
        The segments, and the fractions of the edges as `Cones.places` returns them.
    """
    found = []
    every = product(range(len(sizes) or 1), repeat=len(edges)) if group is None else [group]
    for chosen in every:
        groups = np.asarray(chosen, dtype=np.intp)
        if sizes and (np.bincount(groups, minlength=len(sizes)) > sizes).any():
            continue
        segments, near = cones.places(edges, fractions, groups)
        if (segments >= 0).all():
            found.append((segments, near))
    return found


def admits(spacing: Spacing, points: FloatArray) -> BoolArray:
    """Whether all distances between points are within the limits, and so far that rows say it, too.

    Parameters
    ----------
    spacing : Spacing
    points : numpy.ndarray, shape (N, k, 2)
        NaN for points that are not there.

    Returns
    -------
    numpy.ndarray of bool, shape (N,)
    """
    result = np.ones(len(points), dtype=bool)
    slack = 2 * ROUNDINGS * spacing.cones.size
    for i in range(points.shape[1]):
        for j in range(i):
            distance = np.hypot(*np.moveaxis(points[:, i] - points[:, j], -1, 0))
            if spacing.max_span is not None:
                result &= ~(distance > spacing.max_span * (1 - SPAN_ERROR) - slack)
            if spacing.separation > 0 or spacing.sizes:
                least = spacing.separation * (1 + SEPARATION_ERROR) + slack
                result &= ~(distance < least)
    return result


def _directions(vector: FloatArray, count: int) -> FloatArray:
    """Unit vectors all around, the first one along a vector, shape (count, 2)."""
    angle = np.arctan2(vector[1], vector[0]) + 2 * np.pi * np.arange(count) / count
    return np.stack((np.cos(angle), np.sin(angle)), axis=1)


def _wide(row: FloatArray, i: int, j: int, n: int) -> tuple[FloatArray, float]:
    wide = np.zeros(n)
    wide[i], wide[j] = row[0], row[1]
    return wide, float(row[2])


def _undominated(rows: FloatArray) -> list[int]:
    """Which half-planes of the unit square are not part of another one (the first of equals)."""
    inside = [_vertices(row) for row in rows]
    slack = 1e-12 * np.abs(rows).max()
    within = np.array(
        [[(v @ row[:2] <= row[2] + slack).all() for row in rows] for v in inside]
    )  # [k, l]: half-plane k is part of half-plane l
    kept = []
    for k in range(len(rows)):
        larger = [m for m in np.flatnonzero(within[k]).tolist() if m != k]
        if not any(m < k or not within[m, k] for m in larger):
            kept.append(k)
    return kept


def _vertices(row: FloatArray) -> FloatArray:
    """Vertices of the part of the unit square with ``a f + b g <= c``, shape (V, 2)."""
    a, b, c = row.tolist()
    found = [(f, g) for f in (0.0, 1.0) for g in (0.0, 1.0) if a * f + b * g <= c]
    for fixed in (0.0, 1.0):
        if b and 0 <= (c - a * fixed) / b <= 1:
            found.append((fixed, (c - a * fixed) / b))
        if a and 0 <= (c - b * fixed) / a <= 1:
            found.append(((c - b * fixed) / a, fixed))
    return np.array(found).reshape(-1, 2)


def _to_segment(point: FloatArray, vector: FloatArray) -> float:
    """Distance of a point from the segment from the origin to a vector."""
    along = float(np.clip(point @ vector / (vector @ vector), 0.0, 1.0))
    return float(np.hypot(*(point - along * vector)))
