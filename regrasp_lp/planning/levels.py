"""Grasp sets cut at a level: the grasps whose margin (or tolerance) is not below it.

On a piece (j, k) these are a convex set again, ``M_j/s_j <= -ε`` and ``M_k/s_k >= ε``, and for a
tolerance the box shrinks to ``ε <= u <= l - ε``. A set is the union of its cut pieces, and may fall
apart: its *parts* are the connected groups of cut pieces. Two rows over a box are decided in closed
form (`margins.largest_margins`); what needs more rows is first tried at points at hand, and then
left to margin LPs.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from regrasp_lp.friction import BoolArray, Cones, FloatArray, IntArray
from regrasp_lp.grasp_sets.pieces import Measure, piece_sets
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import Solver, maximise_margins
from regrasp_lp.margins import largest_margins, optimal_points
from regrasp_lp.torque import TorqueFunctions

ACCURACY = 1e-9
"""Of the size of the object: margins that differ by less are equal."""

_WIDTH = 8
"""Most functions of three contacts."""

_CHUNK = 20_000

_ORDERED = 1e-9
"""Of the object's size: by how much two contacts on one edge may be out of order, for rounding."""


class PieceRows:
    """The functions of grasp sets as padded arrays, scaled for margins or for tolerances.

    Sets may be added: these have numbers from the present count on.

    Parameters
    ----------
    sources : iterable of TorqueFunctions
    measure : {"margin", "tolerance"}
    """

    def __init__(self, sources: Iterable[TorqueFunctions], measure: Measure) -> None:
        self.measure = measure
        self._sources: list[TorqueFunctions] = []
        self._starts: list[int] = []
        self._count = 0
        none = np.zeros(0)
        self._table = {
            "offsets": none.reshape(0, _WIDTH),
            "slopes": none.reshape(0, _WIDTH, 3),
            "valid": none.reshape(0, _WIDTH).astype(bool),
            "lengths": none.reshape(0, 3),
            "edges": none.reshape(0, 3).astype(np.intp),
            "best": none,
        }
        for functions in sources:
            self.append(functions)

    def __len__(self) -> int:
        return self._count

    def append(self, functions: TorqueFunctions) -> IntArray:
        """Add sets; return their numbers."""
        n, m = functions.edges.shape
        rows = np.arange(self._count, self._count + n)
        self._sources.append(functions)
        self._starts.append(self._count)
        self._reserve(self._count + n)
        self._count += n
        table, columns = self._table, slice(functions.valid.shape[1])
        scale = functions.rates if self.measure == "tolerance" else np.ones(functions.valid.shape)
        table["offsets"][rows, columns] = functions.offsets / scale
        table["slopes"][rows, columns, :m] = functions.slopes / scale[:, :, None]
        table["valid"][rows, columns] = functions.valid & functions.spans[:, None]
        table["lengths"][rows, :m] = functions.lengths
        table["edges"][rows, :m] = functions.edges
        for first in range(0, n, _CHUNK):
            part = rows[first : first + _CHUNK]
            table["best"][part] = self.levels(part, 0.0).max(axis=(1, 2), initial=-np.inf)
        return rows

    def _reserve(self, count: int) -> None:
        """Make room, in steps that double it."""
        have = len(self._table["best"])
        if count <= have:
            return
        more = max(count, 2 * have) - have
        empty = {"lengths": np.inf, "edges": -1}
        for name, array in self._table.items():
            new = np.full((more, *array.shape[1:]), empty.get(name, 0), dtype=array.dtype)
            self._table[name] = np.concatenate((array, new))

    def functions(self, index: int) -> TorqueFunctions:
        """Return the torque functions of one set, as a stack of one."""
        source = bisect_right(self._starts, index) - 1
        return self._sources[source].take(np.array([index - self._starts[source]]))

    def combination(self, index: int) -> tuple[int, ...]:
        """Return the edges of one set."""
        edges = self.edges[index]
        return tuple(edges[edges >= 0].tolist())

    @property
    def cones(self) -> Cones:
        """The friction cones that all sets are on."""
        return self._sources[0].cones

    @property
    def offsets(self) -> FloatArray:
        """``M(0)`` over its scale, shape (N, J)."""
        return self._table["offsets"][: self._count]

    @property
    def slopes(self) -> FloatArray:
        """``∂M/∂f`` over its scale, shape (N, J, 3)."""
        return self._table["slopes"][: self._count]

    @property
    def valid(self) -> BoolArray:
        """Which columns are functions, shape (N, J)."""
        return self._table["valid"][: self._count]

    @property
    def lengths(self) -> FloatArray:
        """Lengths of the edges, shape (N, 3); inf beyond the contacts of a set."""
        return self._table["lengths"][: self._count]

    @property
    def edges(self) -> IntArray:
        """Edges of the contacts, shape (N, 3); -1 beyond."""
        return self._table["edges"][: self._count]

    @property
    def best(self) -> FloatArray:
        """The largest margin or tolerance of each set, shape (N,); an upper bound if not plain."""
        return self._table["best"][: self._count]

    @property
    def contacts(self) -> IntArray:
        """Number of contacts of each set, shape (N,)."""
        return np.asarray((self.edges >= 0).sum(axis=1))

    def plain(self, rows: IntArray) -> BoolArray:
        """Return which sets have pieces with no other rows than their two functions."""
        edges = self.edges[rows]
        repeated = (edges[:, 1:] == edges[:, :-1]) & (edges[:, 1:] >= 0)
        return np.asarray(~repeated.any(axis=1), dtype=bool)

    def levels(self, rows: IntArray, least: float = -np.inf) -> FloatArray:
        """Return the largest margin or tolerance on each piece (j, k) of sets; -inf for none.

        Parameters
        ----------
        rows : numpy.ndarray of int, shape (K,)
        least : float
            If 0 or more, lower ones may be -inf, too, which takes less time.

        Returns
        -------
        numpy.ndarray, shape (K, J, J)
            An upper bound where a set is not plain.
        """
        ends = 1.0 / self.lengths[rows] if self.measure == "tolerance" else None
        return self._pairs(rows, self.offsets[rows], self.slopes[rows], ends, least)

    def completed(
        self, rows: IntArray, slots: IntArray, values: FloatArray, least: float = -np.inf
    ) -> FloatArray:
        """Return the same with some contacts given.

        Parameters
        ----------
        rows : numpy.ndarray of int, shape (K,)
            Numbers of sets.
        slots : numpy.ndarray of int, shape (K, h)
            Which of their contacts are given.
        values : numpy.ndarray, shape (K, h)
            Fractions.
        least : float
            As for `levels`.

        Returns
        -------
        numpy.ndarray, shape (K, J, J)
        """
        every = np.arange(len(rows))[:, None]
        given = np.zeros((len(rows), 3))
        given[every, slots] = values
        slopes = self.slopes[rows]
        offsets = self.offsets[rows] + np.einsum("njm,nm->nj", slopes, given)
        slopes[every, :, slots] = 0.0
        if self.measure == "margin":
            return self._pairs(rows, offsets, slopes, None, least)
        ends = 1.0 / self.lengths[rows]
        ends[every, slots] = 0.0
        lengths = self.lengths[rows[:, None], slots]
        room = (np.minimum(values, 1 - values) * lengths).min(axis=1, initial=np.inf)
        best = self._pairs(rows, offsets, slopes, ends, least)
        return np.asarray(np.minimum(best, room[:, None, None]))

    def _pairs(
        self,
        rows: IntArray,
        offsets: FloatArray,
        slopes: FloatArray,
        ends: FloatArray | None,
        least: float,
    ) -> FloatArray:
        # On a piece (j, k) no more is possible than -M_j at 0, or M_k at the other ends: most
        # pieces are left out by that.
        valid = self.valid[rows]
        down = valid & (-offsets >= least)
        up = valid & (offsets + slopes.sum(axis=2) >= least)
        possible = down[:, :, None] & up[:, None, :] & ~np.eye(_WIDTH, dtype=bool)
        n, j, k = np.nonzero(possible)
        best = np.full(possible.shape, -np.inf)
        best[n, j, k] = largest_margins(
            offsets[n, k],
            slopes[n, k],
            offsets[n, j],
            slopes[n, j],
            None if ends is None else ends[n],
        )
        return best

    def cell(self, index: int, pieces: IntArray, names: list[str]) -> LinearSets:
        """Return pieces (P, 2) of a set as linear sets over fractions."""
        rows = np.column_stack((np.zeros(len(pieces), dtype=np.intp), pieces))
        functions = self.functions(index)
        cell = piece_sets(
            functions, rows, names[: functions.m], measure=self.measure, apart=_ORDERED
        )
        # Rows of order: as a small scale they would make any gap of a margin LP acceptable.
        order = cell.scales == _ORDERED
        bounds = cell.bounds + np.where(order, _ORDERED * self.cones.size, 0.0)
        return replace(cell, scales=np.where(order, 0.0, cell.scales), bounds=bounds)


@dataclass(frozen=True, eq=False)
class Cut:
    """All grasp sets cut at a level.

    Parameters
    ----------
    rows : PieceRows
    level : float
        In the unit of the object.
    solver : Solver
    """

    rows: PieceRows
    level: float
    solver: Solver
    _known: dict[int, Part] = field(default_factory=dict)

    @property
    def least(self) -> float:
        """What an optimum must reach to count, given the accuracy of optima."""
        return self.level - ACCURACY * self.rows.cones.size

    def alive(self, rows: IntArray) -> BoolArray:
        """Return which pieces (j, k) of sets are not empty, (K, J, J); may be if not plain."""
        return np.asarray(self.rows.levels(rows, self.least) >= self.least)

    def any_alive(self, rows: IntArray) -> BoolArray:
        """Return which sets have a piece that is not empty (may be, if not plain), shape (K,)."""
        return np.asarray(self.rows.best[rows] >= self.least)

    def part(self, index: int) -> Part:
        """Return the cut pieces of one set and how they hang together."""
        if index not in self._known:
            self._known[index] = Part.of(self, index)
        return self._known[index]

    def best_points(self, index: int, pieces: IntArray) -> FloatArray:
        """Return a best grasp of each of some pieces (P, 2) of a plain set, shape (P, 3)."""
        ends = self.level if self.rows.measure == "tolerance" else 0.0
        lower = ends / self.rows.lengths[index]
        width = 1.0 - 2 * lower
        slopes = self.rows.slopes[index]
        offsets = self.rows.offsets[index] + slopes @ lower
        slopes = slopes * width
        j, k = pieces.T
        at = optimal_points(offsets[k], slopes[k], offsets[j], slopes[j])
        return np.asarray(lower + width * at)


@dataclass(frozen=True, eq=False)
class Part:
    """The cut pieces of one set, and which of them hang together.

    Parameters
    ----------
    pieces : numpy.ndarray of int, shape (P, 2)
        The functions j and k of those that are not empty.
    points : numpy.ndarray, shape (P, 3)
        A best grasp of each.
    labels : numpy.ndarray of int, shape (P,)
        Equal for pieces of one part.
    adjacent : numpy.ndarray of bool, shape (P, P)
        Pieces known to overlap; enough to connect each part.
    """

    pieces: IntArray
    points: FloatArray
    labels: IntArray
    adjacent: BoolArray

    @classmethod
    def of(cls, cut: Cut, index: int) -> Part:
        """Return the parts of set `index`."""
        row = np.array([index])
        pieces = np.argwhere(cut.alive(row)[0])
        if cut.rows.plain(row)[0]:
            points = cut.best_points(index, pieces)
        else:
            names = ["f0", "f1", "f2"]
            found = maximise_margins(cut.rows.cell(index, pieces, names), cut.solver)
            reached = found.margins >= cut.least
            pieces, points = pieces[reached], found.points[reached]
            points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
        adjacent = _sharing(cut, index, pieces, points)
        labels = _labels(adjacent)
        if labels.max(initial=0) > 0:
            adjacent |= _overlapping(cut, index, pieces, labels)
            labels = _labels(adjacent)
        return cls(pieces, points, labels, adjacent)

    @property
    def count(self) -> int:
        """How many parts there are."""
        return int(self.labels.max(initial=-1)) + 1

    def chain(self, first: int, last: int) -> list[int]:
        """Return overlapping pieces of one part from piece `first` to piece `last`."""
        before = {first: first}
        queue = [first]
        for piece in queue:
            if piece == last:
                break
            for other in np.flatnonzero(self.adjacent[piece]).tolist():
                if other not in before:
                    before[other] = piece
                    queue.append(other)
        path = [last]
        while path[-1] != first:
            path.append(before[path[-1]])
        return path[::-1]

    def number(self, piece: tuple[int, int]) -> int:
        """Return the place of a piece (j, k), -1 if it is empty at the level."""
        found = np.flatnonzero((self.pieces == piece).all(axis=1))
        return int(found[0]) if found.size else -1


def _sharing(cut: Cut, index: int, pieces: IntArray, points: FloatArray) -> BoolArray:
    """Which pieces have one of the points, or the middle of two of them, in common."""
    middles = (points[:, None, :] + points[None, :, :]) / 2
    tried = np.concatenate((points, middles[np.triu_indices(len(points), 1)]))
    values = cut.rows.offsets[index] + tried @ cut.rows.slopes[index].T
    j, k = pieces.T
    inside = (-values[:, j] >= cut.least) & (values[:, k] >= cut.least)
    return np.asarray(inside.T.astype(float) @ inside > 0)


def _labels(adjacent: BoolArray) -> IntArray:
    """Number of the connected component of each piece."""
    labels = np.arange(len(adjacent))
    while True:
        least = np.where(adjacent, labels[None, :], len(labels)).min(axis=1, initial=len(labels))
        new = np.minimum(labels, least)
        if (new == labels).all():
            return np.unique(labels, return_inverse=True)[1].astype(np.intp)
        labels = new


def _overlapping(cut: Cut, index: int, pieces: IntArray, labels: IntArray) -> BoolArray:
    """Which pieces of different parts overlap after all, by margin LPs."""
    result = np.zeros((len(pieces), len(pieces)), dtype=bool)
    one, other = np.nonzero(np.triu(labels[:, None] != labels[None, :], 1))
    names = ["f0", "f1", "f2"]
    first, second = (cut.rows.cell(index, pieces[p], names) for p in (one, other))
    found = maximise_margins(first.join(second, on=first.names), cut.solver)
    yes = found.margins >= cut.least
    result[one[yes], other[yes]] = result[other[yes], one[yes]] = True
    return result
