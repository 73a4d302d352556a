"""Random contacts that are often in force closure, drawn without any knowledge of grasp sets.

Contacts on random edges at random places almost never hold an object whose friction is low. Draws
are aimed here, by geometry that shares nothing with torque functions, so that a measurement which
uses them can see what those would miss. A *mixed* draw is one of three, chosen by lot:

* *plain*: every contact anywhere on any edge, some of them at vertices and simple fractions, where
  the boundaries of grasp sets are;
* *swept*: the last contact runs along its edge, or all contacts run along a diagonal of their box.
  Every 3 × 3 determinant of contact wrenches is affine in the positions, so force closure changes
  only at their roots; one of the intervals between roots is chosen, however short it is, and a
  place in it;
* *focused*: a line of force within the friction cone of the first contact, and on it a point q,
  or, where two contacts are given, a crossing of two such lines. Others are put where q is in
  their double-sided cones, on one of the edges that allow it; a single other one where the line
  itself meets an edge.

Every combination of edges and every place has a positive density under the first alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regrasp_lp.contact import FRACTION_SNAP
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import BoolArray, FloatArray
from regrasp_lp.polygon import Polygon
from regrasp_lp.wrenches import IntArray, float_determinants

_PLAIN, _SWEPT = 0.25, 0.65  # by lot: plain below the first, swept below the second
_COARSE = 0.15  # of the draws have simple fractions
_ENTRIES = 1 << 21  # pairs of a point and an edge held at a time
_SHORTEST = 4 * FRACTION_SNAP  # of an interval between roots


@dataclass(frozen=True, eq=False)
class RandomGrasps:
    """Draws of random contacts on an object.

    Parameters
    ----------
    polygon : Polygon
    friction : numpy.ndarray, shape (n_edges,)
        μ of each edge.
    proposal : {"mixed", "uniform"}
        How contacts are drawn: as this module says, or every contact on any edge and at any
        fraction of it with equal probability.

    Raises
    ------
    OptionError
        If there is no such proposal.
    """

    polygon: Polygon
    friction: FloatArray
    proposal: str = "mixed"

    def __post_init__(self) -> None:
        if self.proposal not in ("mixed", "uniform"):
            raise OptionError(f'proposal must be "mixed" or "uniform", got {self.proposal!r}')

    def draw(
        self, rng: np.random.Generator, count: int, contacts: int, *, twice: bool = False
    ) -> tuple[IntArray, FloatArray]:
        """Return contacts on different edges, or two of three on one and the same edge.

        Parameters
        ----------
        rng : numpy.random.Generator
        count : int
            Number of draws N.
        contacts : int
            2 or 3.
        twice : bool
            Whether two of three contacts are on one edge.

        Returns
        -------
        edges : numpy.ndarray of int, shape (M, contacts)
            M <= N: draws with coinciding contacts, and the few that are not of the class, are
            dropped.
        fractions : numpy.ndarray, shape (M, contacts)
        """
        n = self.polygon.n_edges
        edges = rng.integers(0, n, (count, contacts))
        # the k-th is one of those that are left, so that all are different and equally likely
        edges[:, 1] = (edges[:, 0] + 1 + rng.integers(0, n - 1, count)) % n
        if twice:
            edges[:, 2] = np.where(rng.random(count) < 0.5, edges[:, 0], edges[:, 1])
        elif contacts == 3:
            low, high = np.sort(edges[:, :2], axis=1).T
            third = rng.integers(0, n - 2, count)
            third += third >= low
            edges[:, 2] = third + (third >= high)
        edges = rng.permuted(edges, axis=1)
        edges, fractions = self._fill(rng, edges, np.zeros((count, 0)), repeats=twice)
        steps = np.diff(np.sort(edges, axis=1), axis=1) > 0
        of_class = steps.sum(axis=1) == (1 if twice else contacts - 1)
        kept = of_class & self._different(edges, fractions)
        return edges[kept], fractions[kept]

    def extend(
        self, rng: np.random.Generator, edges: IntArray, fractions: FloatArray, contacts: int
    ) -> tuple[IntArray, FloatArray, BoolArray]:
        """Return given contacts with others drawn anew, on any edges.

        Parameters
        ----------
        rng : numpy.random.Generator
        edges, fractions : numpy.ndarray, shape (N, h)
            The contacts that are kept, h >= 1.
        contacts : int
            How many there shall be, at least h.

        Returns
        -------
        edges, fractions : numpy.ndarray, shape (M, contacts)
            The given ones first. Draws with coinciding contacts are dropped.
        kept : numpy.ndarray of bool, shape (N,)
            Which these are not.
        """
        more = rng.integers(0, self.polygon.n_edges, (len(edges), contacts - edges.shape[1]))
        edges, fractions = self._fill(rng, np.column_stack((edges, more)), fractions, repeats=None)
        kept = self._different(edges, fractions)
        return edges[kept], fractions[kept], kept

    # --- the three ways -------------------------------------------------------------------------

    def _fill(
        self,
        rng: np.random.Generator,
        edges: IntArray,
        given: FloatArray,
        repeats: bool | None,
    ) -> tuple[IntArray, FloatArray]:
        """Choose fractions, and for focused draws other edges; `given` are those of the first.

        `repeats` tells whether three contacts shall be on two edges (None: as it comes).
        """
        count, contacts = edges.shape
        fractions = rng.random(edges.shape)
        if self.proposal == "mixed":
            coarse = rng.random(count) < _COARSE
            fractions[coarse] = np.round(4 * fractions[coarse]) / 4
        fractions[:, : given.shape[1]] = given
        if self.proposal == "mixed" and given.shape[1] < contacts:
            lot = rng.random(count)
            swept = np.flatnonzero((lot >= _PLAIN) & (lot < _SWEPT))
            fractions[swept] = self._swept(rng, edges[swept], fractions[swept], given.shape[1])
            aimed, step = np.flatnonzero(lot >= _SWEPT), max(1, _ENTRIES // self.polygon.n_edges)
            for start in range(0, len(aimed), step):
                rows = aimed[start : start + step]
                if contacts == 2:
                    self._aim_along(rng, edges, fractions, rows)
                else:
                    self._aim_through(rng, edges, fractions, rows, given.shape[1], repeats)
        low, high = fractions <= FRACTION_SNAP, fractions >= 1 - FRACTION_SNAP
        return edges, np.where(low, 0.0, np.where(high, 1.0, fractions))

    def _swept(
        self, rng: np.random.Generator, edges: IntArray, fractions: FloatArray, given: int
    ) -> FloatArray:
        """Contacts in some interval between roots of determinants on a line through contact space.

        The line is that of the last contact alone or, half of the time, a diagonal of the box of
        all that are not given.
        """
        if not len(edges):
            return fractions
        first, last = fractions.copy(), fractions.copy()
        first[:, -1], last[:, -1] = 0.0, 1.0
        diagonal = rng.random(len(edges)) < 0.5
        corner = rng.integers(0, 2, fractions.shape).astype(np.float64)
        first[diagonal, given:] = corner[diagonal, given:]
        last[diagonal, given:] = 1 - corner[diagonal, given:]
        values, others = (
            float_determinants(self.polygon, self.friction, edges, end)[0] for end in (first, last)
        )
        crosses = np.sign(values) * np.sign(others) < 0
        roots = np.divide(values, values - others, out=np.ones(values.shape), where=crosses)
        stops = np.concatenate((np.zeros((1, len(edges))), roots, np.ones((1, len(edges)))))
        stops.sort(axis=0)
        widths = np.diff(stops, axis=0)
        chosen = np.where(widths > _SHORTEST, rng.random(widths.shape), -1.0).argmax(axis=0)
        every = np.arange(len(edges))
        place = stops[chosen, every] + rng.random(len(edges)) * widths[chosen, every]
        return np.asarray(first + np.clip(place, 0.0, 1.0)[:, None] * (last - first))

    def _aim_along(
        self, rng: np.random.Generator, edges: IntArray, fractions: FloatArray, rows: IntArray
    ) -> None:
        """Put the second of two contacts where a line of force of the first meets an edge."""
        points, along = self._lines_of_force(rng, edges[rows, 0], fractions[rows, 0])
        starts, ends = (v[None, :, :] - points[:, None, :] for v in self._corners)
        side, other_side = (
            along[:, None, 0] * v[..., 1] - along[:, None, 1] * v[..., 0] for v in (starts, ends)
        )
        meets = np.sign(side) * np.sign(other_side) < 0
        meets[np.arange(len(rows)), edges[rows, 0]] = False
        chosen, found = _any_of(rng, meets)
        every = np.arange(len(rows))
        one, other = side[every, chosen], other_side[every, chosen]
        place = np.divide(one, one - other, out=np.zeros(len(rows)), where=found)
        edges[rows[found], 1], fractions[rows[found], 1] = chosen[found], place[found]

    def _aim_through(
        self,
        rng: np.random.Generator,
        edges: IntArray,
        fractions: FloatArray,
        rows: IntArray,
        given: int,
        repeats: bool | None,
    ) -> None:
        """Put contacts where a point q on lines of force is in their double-sided cones."""
        points, along = self._lines_of_force(rng, edges[rows, 0], fractions[rows, 0])
        if given >= 2:
            others, across = self._lines_of_force(rng, edges[rows, 1], fractions[rows, 1])
            apart = others - points
            turn = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
            top = apart[:, 0] * across[:, 1] - apart[:, 1] * across[:, 0]
            distance = np.divide(top, turn, out=np.full(len(rows), np.inf), where=turn != 0)
            distance = np.clip(distance, -1e6 * self._size, 1e6 * self._size)
        else:
            # heavy tails: forces that are nearly parallel meet far away
            distance = self._size * np.tan(np.pi * (rng.random(len(rows)) - 0.5)) / 2
        low, high = self._regions(points + distance[:, None] * along)
        every, possible = np.arange(len(rows)), high > low
        for column in range(max(given, 1), edges.shape[1]):
            if repeats and column == 2:
                back = rng.integers(0, 2, len(rows))
                chosen, found = edges[rows, back], np.ones(len(rows), dtype=bool)
            else:
                free = possible.copy()
                if repeats is not None:
                    for before in range(column):
                        free[every, edges[rows, before]] = False
                chosen, found = _any_of(rng, free)
            one, other = low[every, chosen], high[every, chosen]
            found &= other > one
            place = one + rng.random(len(rows)) * (other - one)
            edges[rows[found], column] = chosen[found]
            fractions[rows[found], column] = place[found]

    # --- geometry -------------------------------------------------------------------------------

    @cached_property
    def _corners(self) -> tuple[FloatArray, FloatArray]:
        """First and last points of the edges, from the lower left corner of the object."""
        origin = self.polygon.edge_starts.min(axis=0)
        return self.polygon.edge_starts - origin, self.polygon.edge_ends - origin

    @cached_property
    def _size(self) -> float:
        return float(np.hypot(*self._corners[0].max(axis=0)))

    @cached_property
    def _tangents(self) -> FloatArray:
        starts, ends = self._corners
        return np.asarray((ends - starts) / np.hypot(*(ends - starts).T)[:, None])

    def _lines_of_force(
        self, rng: np.random.Generator, edges: IntArray, fractions: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Contact points, and a unit vector within the friction cone of each."""
        starts, ends = (v[edges] for v in self._corners)
        angles = np.arctan(self.friction[edges]) * rng.uniform(-1, 1, len(edges))
        x, y = self._tangents[edges].T
        normals, tangents = np.stack((-y, x), axis=1), np.stack((x, y), axis=1)
        along = np.cos(angles)[:, None] * normals + np.sin(angles)[:, None] * tangents
        return starts + fractions[:, None] * (ends - starts), along

    def _regions(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Fractions between which contacts see each point within their double-sided cones.

        On the edge from a along t with normal n these are ``(t ∓ μ n) · (q - a)``, shape (N, n).
        """
        starts, ends = self._corners
        lengths = np.hypot(*(ends - starts).T)
        t = self._tangents
        along = points @ t.T - (starts * t).sum(axis=1)
        height = points @ np.stack((-t[:, 1], t[:, 0])) - (
            starts[:, 1] * t[:, 0] - starts[:, 0] * t[:, 1]
        )
        reach = self.friction * np.abs(height)
        low, high = (along - reach) / lengths, (along + reach) / lengths
        return np.clip(low, 0.0, 1.0), np.clip(high, 0.0, 1.0)

    def _different(self, edges: IntArray, fractions: FloatArray) -> BoolArray:
        """Whether no two contacts are at one point (two edges share points at vertices only)."""
        starts, ends = self.polygon.edge_starts[edges], self.polygon.edge_ends[edges]
        f = fractions[..., None]
        points = np.where(f == 1, ends, np.where(f == 0, starts, starts + f * (ends - starts)))
        kept = np.ones(len(edges), dtype=bool)
        for i in range(edges.shape[1]):
            for j in range(i):
                kept &= (points[:, i] != points[:, j]).any(axis=1)
        return kept


def _any_of(rng: np.random.Generator, allowed: BoolArray) -> tuple[IntArray, BoolArray]:
    """Choose one allowed column of each row, and tell whether there is any."""
    lots = np.where(allowed, rng.random(allowed.shape), -1.0)
    chosen = lots.argmax(axis=1)
    return chosen, allowed[np.arange(len(allowed)), chosen]
