"""The exact test that rings bound a simple polygon.

Every decision is exact for the doubles given: comparisons of coordinates are, and signs of
orientations are computed in floating point with a proved error bound first, then in integers
where the bound leaves the sign open. Edges in messages are numbered as given: ring by ring from
0, edge i of a ring running from its point i to the next one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from regrasp_lp.errors import PolygonError
from regrasp_lp.rings import Point, doubled_area, exact_integers, format_point

__all__ = [
    "MAX_EXTENT",
    "MIN_EXTENT",
    "check_rings",
    "conflicts",
    "first_conflict",
    "nesting",
]

MIN_EXTENT = 1e-100
"""Least width and height of a ring: below, products of lengths run out of the double range."""
MAX_EXTENT = 1e100
"""Largest absolute coordinate, for the same reason."""

_FILTER = 4.0 * 2.0**-53
"""Shewchuk's bound on the relative error of an orientation, (3 + 16u)u, rounded up."""
_BLOCK = 1 << 20
"""Edge pairs compared at once; bounds the memory for outlines of thousands of edges."""
_ROWS = 128
"""Consecutive edges whose common box leaves out most others: they are near to each other."""

_Floats: TypeAlias = npt.NDArray[np.float64]


def check_rings(rings: Sequence[_Floats], label: str) -> None:
    """Check that an outline and holes, in any orientation, bound a simple polygon. Exact.

    Parameters
    ----------
    rings
        The outline, then the holes: arrays (n, 2), unclosed, finite.
    label
        What messages call the polygon.

    Raises
    ------
    PolygonError
        At the first of: coordinates out of range, an edge of no length, a repeated point, no
        area, two edges of a ring or of two rings that meet, a hole outside the outline or
        inside another hole.

    Examples
    --------
    >>> check_rings([np.array([[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]])], "polygon")
    Traceback (most recent call last):
    ...
    regrasp_lp.errors.PolygonError: polygon: edge 0 of the outline, (0, 0) to (2, 2), crosses \
edge 2 of the outline, (2, 0) to (0, 2): rings may not meet themselves or each other
    """
    edges = _Edges(rings, label)
    for r, ring in enumerate(rings):
        _check_ring(ring, int(edges.first[r]), f"{label}: {_ring_name(r)}")
    edges.check_spikes()
    for i, j in edges.meeting_candidates():
        edges.check_pair(i, j)
    if len(rings) > 1:
        edges.check_nesting()


def conflicts(rings: Sequence[_Floats]) -> list[tuple[int, int]]:
    """Return the pairs of edges that share more than the vertex between neighbours. Exact.

    Examples
    --------
    >>> conflicts([np.array([[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]])])
    [(0, 2)]
    """
    return list(_Edges(rings, "").conflicts())


def first_conflict(rings: Sequence[_Floats]) -> tuple[int, int] | None:
    """Return the first of the `conflicts`, which may be very many, or None."""
    return next(_Edges(rings, "").conflicts(), None)


def nesting(rings: Sequence[_Floats]) -> npt.NDArray[np.bool_]:
    """Return which rings lie in which, given that no edges meet: entry (r, s), r inside s. Exact.

    Examples
    --------
    >>> square = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]])
    >>> nesting([square, square / 4 + 1]).tolist()
    [[False, False], [True, False]]
    """
    return _Edges(rings, "").inside()


def _ring_name(r: int) -> str:
    return "the outline" if r == 0 else f"hole {r - 1}"


def _check_ring(ring: _Floats, first: int, where: str) -> None:
    """Everything that one ring's points decide alone."""
    if np.abs(ring).max() > MAX_EXTENT:
        k = int(np.abs(ring).max(axis=1).argmax())
        raise PolygonError(
            f"{where} reaches {format_point(ring[k])} (point {k}); coordinates may not exceed "
            f"{MAX_EXTENT:g}: use another unit of length"
        )
    n = len(ring)
    same = (ring == np.roll(ring, -1, axis=0)).all(axis=1)
    if same.any():
        k = int(same.argmax())
        raise PolygonError(
            f"{where}: edge {first + k} has no length, points {k} and {(k + 1) % n} are both "
            f"{format_point(ring[k])}: remove one of them"
        )
    seen: dict[tuple[float, float], int] = {}
    for k, point in enumerate(map(tuple, ring.tolist())):
        if point in seen:
            raise PolygonError(
                f"{where} touches itself where edges {first + seen[point]} and {first + k} "
                f"start: points {seen[point]} and {k} are both {format_point(ring[k])}"
            )
        seen[point] = k
    integers, _ = exact_integers(ring)
    if doubled_area(integers) == 0 and not any(
        _turn(integers[0], integers[1], point) for point in integers[2:]
    ):
        raise PolygonError(f"{where} has no area: all its points lie on one line")
    extents = np.ptp(ring, axis=0)
    if extents.min() < MIN_EXTENT:
        raise PolygonError(
            f"{where} is only {extents[0]:g} by {extents[1]:g} in size; at least "
            f"{MIN_EXTENT:g} is needed: use another unit of length"
        )


class _Edges:
    """The edges of all rings, numbered as given, with the tests on pairs of them."""

    def __init__(self, rings: Sequence[_Floats], label: str) -> None:
        sizes = [len(ring) for ring in rings]
        self.label = label
        self.first = np.cumsum([0, *sizes[:-1]])
        self.ring = np.repeat(np.arange(len(rings)), sizes)
        self.start = np.concatenate(list(rings))
        self.end = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
        self.low = np.minimum(self.start, self.end)
        self.high = np.maximum(self.start, self.end)
        self.following = np.concatenate(
            [
                first + np.roll(np.arange(n), -1)
                for first, n in zip(self.first.tolist(), sizes, strict=True)
            ]
        )
        self._integers: list[Point] | None = None

    def exact(self, i: int) -> tuple[Point, Point]:
        """Start and end of edge i over one denominator, computed for all when first needed."""
        if self._integers is None:
            self._integers, _ = exact_integers(self.start)
        return self._integers[i], self._integers[int(self.following[i])]

    def name(self, i: int) -> str:
        """Return the edge as messages call it."""
        return (
            f"edge {i} of {_ring_name(int(self.ring[i]))}, "
            f"{format_point(self.start[i])} to {format_point(self.end[i])},"
        )

    def spikes(self) -> Iterator[tuple[int, int]]:
        """Consecutive edges share more than their vertex iff the second folds back exactly."""
        after = self.end[self.following]
        for i in np.flatnonzero(_turn_signs(self.start, self.end, after) == 0).tolist():
            j = int(self.following[i])
            (a, b), (_, c) = self.exact(i), self.exact(j)
            if _turn(a, b, c) == 0 and (
                (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0
            ):
                yield i, j

    def conflicts(self) -> Iterator[tuple[int, int]]:
        """Pairs of edges that share more than the vertex between neighbours."""
        yield from self.spikes()
        yield from (pair for pair in self.meeting_candidates() if self.meet(*pair))

    def check_spikes(self) -> None:
        """Refuse an edge that folds back onto the one before."""
        for i, j in self.spikes():
            raise PolygonError(
                f"{self.label}: {self.name(j)} folds back onto {self.name(i)[:-1]}: "
                f"remove the spike at {format_point(self.end[i])}"
            )

    def meeting_candidates(self) -> Iterator[tuple[int, int]]:
        """Pairs i < j of edges, not neighbours, that floats do not prove apart."""
        n = len(self.start)
        rows = max(1, min(_ROWS, _BLOCK // n))
        for top in range(0, n, rows):
            block = np.arange(top, min(top + rows, n))[:, None]
            low, high = self.low[block].min(axis=0), self.high[block].max(axis=0)
            by_box = (self.low[top:] <= high) & (low <= self.high[top:])
            others = top + np.flatnonzero(by_box.all(axis=1))
            near = others > block
            for axis in (0, 1):
                near &= self.low[block, axis] <= self.high[others, axis]
                near &= self.low[others, axis] <= self.high[block, axis]
            i, j = np.nonzero(near)
            i, j = i + top, others[j]
            apart = (self.following[i] == j) | (self.following[j] == i)
            for e, f in ((i, j), (j, i)):
                a, b = self.start[e], self.end[e]
                signs = _turn_signs(a, b, self.start[f]) * _turn_signs(a, b, self.end[f])
                apart |= signs > 0
            yield from zip(i[~apart].tolist(), j[~apart].tolist(), strict=True)

    def meet(self, i: int, j: int) -> str | None:
        """How two edges with overlapping bounding boxes meet, if they have a point in common."""
        (a, b), (c, d) = self.exact(i), self.exact(j)
        ends_j = [_turn(a, b, c), _turn(a, b, d)]
        ends_i = [_turn(c, d, a), _turn(c, d, b)]
        if min(ends_j) > 0 or max(ends_j) < 0 or min(ends_i) > 0 or max(ends_i) < 0:
            return None
        if any(ends_i) and any(ends_j):
            return "crosses" if all(ends_i) and all(ends_j) else "touches"
        # on one line: they share one point if the ranges meet at their ends only
        shared = np.minimum(self.high[i], self.high[j]) > np.maximum(self.low[i], self.low[j])
        return "overlaps" if shared.any() else "touches"

    def check_pair(self, i: int, j: int) -> None:
        """Refuse two edges with overlapping bounding boxes that have a point in common."""
        if how := self.meet(i, j):
            raise PolygonError(
                f"{self.label}: {self.name(i)} {how} {self.name(j)[:-1]}: "
                f"rings may not meet themselves or each other"
            )

    def inside(self) -> npt.NDArray[np.bool_]:
        """Which rings are inside which others, given that no edges meet: one row for each ring.

        One point a ring decides: it is inside a ring iff a ray to the right crosses an odd
        number of the ring's edges.
        """
        rows = max(1, _BLOCK // len(self.start))
        blocks = np.split(np.arange(len(self.first)), range(rows, len(self.first), rows))
        return np.concatenate([self._inside(block) for block in blocks])

    def _inside(self, rings: npt.NDArray[np.intp]) -> npt.NDArray[np.bool_]:
        """The rows of some rings."""
        p = self.start[self.first[rings], None, :]
        upward = self.start[:, 1] < self.end[:, 1]
        crossed = (self.start[:, 1] > p[..., 1]) != (self.end[:, 1] > p[..., 1])
        crossed &= self.ring != rings[:, None]
        sign = _turn_signs(self.start, self.end, p)
        for r, i in zip(*(k.tolist() for k in np.nonzero(crossed & (sign == 0))), strict=True):
            point, _ = self.exact(int(self.first[rings[r]]))
            sign[r, i] = 1 if _turn(*self.exact(i), point) > 0 else -1
        crossed &= (sign > 0) == upward
        inside: npt.NDArray[np.bool_] = (
            np.add.reduceat(crossed, self.first, axis=1, dtype=np.intp) % 2 == 1
        )
        return inside

    def check_nesting(self) -> None:
        """Refuse holes outside the outline or inside another hole, given that no edges meet."""
        for h, row in enumerate(self.inside()[1:]):
            at = format_point(self.start[self.first[h + 1]])
            if not row[0]:
                raise PolygonError(
                    f"{self.label}: hole {h} lies outside the outline, with its point {at}"
                )
            if row[1:].any():
                raise PolygonError(
                    f"{self.label}: hole {h} lies inside hole {int(row[1:].argmax())}, with its "
                    f"point {at}: holes may not be nested"
                )


def _turn(a: Point, b: Point, c: Point) -> int:
    """Twice the signed area of the triangle abc: positive if c is left of the line a to b."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _turn_signs(a: _Floats, b: _Floats, c: _Floats) -> npt.NDArray[np.int8]:
    """Signs of `_turn` for stacked points (..., 2) where floats prove them, 0 where they do not."""
    left = (a[..., 0] - c[..., 0]) * (b[..., 1] - c[..., 1])
    right = (a[..., 1] - c[..., 1]) * (b[..., 0] - c[..., 0])
    turn = left - right
    # the last term covers products that underflow
    bound = _FILTER * (np.abs(left) + np.abs(right)) + np.finfo(np.float64).tiny
    return np.where(np.abs(turn) > bound, np.sign(turn), 0.0).astype(np.int8)
