"""Polygons of fewer vertices, nowhere farther than a tolerance from the given one."""

from __future__ import annotations

from numbers import Real
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from regrasp_lp.errors import OptionError
from regrasp_lp.polygon import Polygon
from regrasp_lp.ring_checks import conflicts, nesting
from regrasp_lp.rings import doubled_area, exact_integers

__all__ = ["simplify"]

_Floats: TypeAlias = npt.NDArray[np.float64]
_Bools: TypeAlias = npt.NDArray[np.bool_]


def simplify(polygon: Polygon, tolerance: float) -> Polygon:
    """Return a polygon of some of the vertices, within a tolerance of all the others.

    Between two vertices that stay next to each other, every vertex that goes is at most
    `tolerance` from the new edge. So is then the whole chain it replaces, since all within the
    tolerance of a segment is convex; and the chain, which is connected and has the same ends, has
    a point over every point of the new edge. The Hausdorff distance between the old boundary and
    the new one is therefore at most the tolerance (up to rounding, 1e-15 of the polygon's size).

    Chains are split where they are farthest from their edge, after Douglas and Peucker, beginning
    with the first vertex of each ring, the one farthest from it, and the one farthest from these.
    Where edges of the result would meet, by an exact test, the chains that they stand for are
    split on, until nothing meets and every hole is in its place: at the latest when all vertices
    are back. The first vertex of each ring stays, and so does the order of edges; the result
    depends on nothing but the polygon and the tolerance.

    Parameters
    ----------
    polygon : Polygon
    tolerance : float
        In the polygon's unit; with 0 only vertices go that lie on the line of their neighbours.

    Returns
    -------
    Polygon
        Of the same name and as many holes.

    Raises
    ------
    OptionError
        If the tolerance is no length.

    Examples
    --------
    >>> notched = Polygon([(0, 0), (5, 0.1), (9, 0), (9, 6), (4, 6), (4, 5), (0, 6)])
    >>> simplify(notched, 0.2).vertices.tolist()
    [[0.0, 0.0], [9.0, 0.0], [9.0, 6.0], [4.0, 6.0], [4.0, 5.0], [0.0, 6.0]]
    """
    a_number = isinstance(tolerance, Real) and not isinstance(tolerance, bool)
    if not a_number or not 0 <= tolerance < np.inf:
        raise OptionError(f"the tolerance has to be a length, not {tolerance!r}")
    chains = _Chains(polygon)
    while True:
        # also after a repair: parts of a chain may be farther from their edges than it was
        while chains.split(chains.deviations() > tolerance):
            pass
        rings = chains.rings()
        wrong = chains.of_edges(conflicts(rings))
        if not wrong.any():
            if chains.in_place(rings):
                return Polygon(rings[0], rings[1:], polygon.name)
            deviations = chains.deviations()
            wrong = deviations == deviations.max()
        # of two edges that meet at least one stands for more than itself, and is split
        chains.split(wrong)


class _Chains:
    """The vertices of all rings, those that stay, and the chain after each of these."""

    def __init__(self, polygon: Polygon) -> None:
        self._polygon = polygon
        self._points = polygon.vertices
        sizes = [len(ring) for ring in polygon.rings]
        self._first = np.cumsum([0, *sizes[:-1]])
        self._ring = polygon.ring_of_edge
        self._kept: _Bools = np.zeros(len(self._points), dtype=bool)
        self._kept[self._first] = True
        for ring, first in zip(polygon.rings, self._first.tolist(), strict=True):
            self._kept[first + int(np.hypot(*(ring - ring[0]).T).argmax())] = True
        # a ring has at least three vertices: for a third one the widest of its two chains is split
        pairs = self.deviations().reshape(-1, 2)
        self.split((np.arange(2) == pairs.argmax(axis=1)[:, None]).reshape(-1))

    def rings(self) -> list[_Floats]:
        """The rings of the vertices that stay."""
        return [
            self._points[self._kept & (self._ring == r)] for r in range(len(self._polygon.rings))
        ]

    def _ends(self) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """First and last vertex of each chain, and the chain that each vertex is in."""
        starts = np.flatnonzero(self._kept)
        chain = np.cumsum(self._kept) - 1
        following = np.roll(starts, -1)
        # the last chain of a ring leads back to its first vertex
        last = np.append(self._ring[starts[1:]] != self._ring[starts[:-1]], True)
        following[last] = self._first
        return starts, following, chain

    def _distances(self) -> _Floats:
        """Distance of each vertex from the edge in the place of its chain; −1 if it stays."""
        starts, following, chain = self._ends()
        a = self._points[starts[chain]]
        edge = self._points[following[chain]] - a
        offset = self._points - a
        length = (edge * edge).sum(axis=1)
        share = np.clip((offset * edge).sum(axis=1) / np.where(length > 0, length, 1.0), 0, 1)
        away = offset - share[:, None] * edge
        return np.where(self._kept, -1.0, np.hypot(away[:, 0], away[:, 1]))

    def deviations(self) -> _Floats:
        """How far each chain is from its edge; −1 if it is this edge."""
        starts, _, _ = self._ends()
        farthest: _Floats = np.maximum.reduceat(self._distances(), starts)
        return farthest

    def split(self, which: _Bools) -> bool:
        """Keep the farthest vertex of some chains; say whether there was one."""
        starts, _, _ = self._ends()
        distances = self._distances()
        ends = [*starts[1:].tolist(), len(distances)]
        chosen = np.flatnonzero(which & (np.maximum.reduceat(distances, starts) >= 0)).tolist()
        for k in chosen:
            start = int(starts[k])
            self._kept[start + int(distances[start : ends[k]].argmax())] = True
        return bool(chosen)

    def of_edges(self, pairs: list[tuple[int, int]]) -> _Bools:
        """The chains that new edges, in pairs, stand for: chain k becomes edge k."""
        wrong: _Bools = np.zeros(int(self._kept.sum()), dtype=bool)
        wrong[[edge for pair in pairs for edge in pair]] = True
        return wrong

    def in_place(self, rings: list[_Floats]) -> bool:
        """Whether rings that do not meet run and are nested as those of the polygon."""
        areas = [doubled_area(exact_integers(ring)[0]) for ring in rings]
        if not all((area > 0) == (r == 0) and area != 0 for r, area in enumerate(areas)):
            return False
        return bool((nesting(rings) == nesting(self._polygon.rings)).all())
