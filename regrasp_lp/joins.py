"""Margin LPs on joined pieces: the best way to switch between two grasp sets.

A switch from S to T that holds some contacts is a point of a piece of S joined, on the held
contacts, with a piece of T. The margin of the switch is the largest over all pairs of pieces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.grasp_sets.pieces import piece_sets
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import Solver, maximise_margins
from regrasp_lp.lp.margin_lp import GAP
from regrasp_lp.margins import piece_margins
from regrasp_lp.shadows import Shadows
from regrasp_lp.torque import TorqueFunctions

_ROUND = 6


@dataclass(frozen=True, eq=False)
class Joins:
    """The best join of P pairs of sets.

    Parameters
    ----------
    margins : numpy.ndarray, shape (P,)
        Largest margin over all pairs of pieces; -inf if no two pieces can be joined.
    exist : numpy.ndarray of bool, shape (P,)
        Whether it is positive beyond the accuracy of the solver.
    first, second : numpy.ndarray, shape (P, 3)
        Fractions of the two grasps (NaN beyond their number of contacts).
    first_piece, second_piece : numpy.ndarray of int, shape (P, 2)
        The pieces (j, k) that are joined.
    """

    margins: FloatArray
    exist: BoolArray
    first: FloatArray
    second: FloatArray
    first_piece: IntArray
    second_piece: IntArray


def best_joins(first: Shadows, second: Shadows, solver: Solver, *, apart: bool = False) -> Joins:
    """Maximise the margin over all joined pieces of pairs of sets.

    Parameters
    ----------
    first, second : Shadows
        Aligned: pair i is ``first[i]`` and ``second[i]``, held on the same edges.
    solver : Solver
    apart : bool
        Whether two contacts on one edge are to be kept in their order, and apart.

    Returns
    -------
    Joins
    """
    n = len(first)
    joins = Joins(
        np.full(n, -np.inf),
        np.zeros(n, dtype=bool),
        np.full((n, 3), np.nan),
        np.full((n, 3), np.nan),
        np.full((n, 2), -1, dtype=np.intp),
        np.full((n, 2), -1, dtype=np.intp),
    )
    key = np.column_stack((first.source, first.slots, second.source, second.slots))
    kinds, group = np.unique(key, axis=0, return_inverse=True)
    for number in range(len(kinds)):
        rows = np.flatnonzero(group.ravel() == number)
        _Group(first.take(rows), second.take(rows), solver, apart).solve(rows, joins)
    return joins


class _Group:
    """Pairs that hold the same slots of sets from the same two stacks."""

    def __init__(self, first: Shadows, second: Shadows, solver: Solver, apart: bool) -> None:
        self.solver, self.apart = solver, apart
        self.functions = tuple(s.sources[s.source[0]].take(s.row) for s in (first, second))
        self.slots = first.slots[0], second.slots[0]

    def candidates(self) -> tuple[IntArray, FloatArray]:
        """All (pair, j, k, j', k') with existing pieces, and the smaller of their margins.

        Sorted by pair, the most promising first.
        """
        margins = [piece_margins(f) for f in self.functions]
        n, width = len(self.functions[0]), margins[1].shape[1]
        pair, j, k = np.nonzero(margins[0] > 0)
        other, j2, k2 = np.nonzero(margins[1] > 0)
        counts = np.bincount(other, minlength=n)
        starts = np.cumsum(counts) - counts
        each = counts[pair]
        index = np.arange(each.sum()) - (np.cumsum(each) - each).repeat(each)
        index += starts[pair].repeat(each)
        rows = np.column_stack([v.repeat(each) for v in (pair, j, k)] + [j2[index], k2[index]])
        bound = np.minimum(margins[0][pair, j, k].repeat(each), margins[1][other, j2, k2][index])
        del width
        order = np.lexsort((-bound, rows[:, 0]))
        return rows[order], bound[order]

    def joined(self, rows: IntArray) -> LinearSets:
        """The joined pieces of candidates as linear sets."""
        names = ["x0", "x1", "x2"][: self.functions[0].m]
        others = ["y0", "y1", "y2"][: self.functions[1].m]
        held = []
        for one, other in zip(*self.slots, strict=True):
            others[other] = names[one]
            held.append(names[one])
        one = _pieces(self.functions[0], rows[:, [0, 1, 2]], names, self.apart)
        return one.join(_pieces(self.functions[1], rows[:, [0, 3, 4]], others, self.apart), held)

    def solve(self, index: IntArray, joins: Joins) -> None:
        """Write the best joins of the pairs to places `index` of `joins`.

        In rounds of a few candidates a pair: a pair is done when none of those left can be
        better, its pieces' own margins being bounds.
        """
        rows, bound = self.candidates()
        start = np.searchsorted(rows[:, 0], np.arange(len(index)))
        rank = np.arange(len(rows)) - start[rows[:, 0]]
        names = [f"x{i}" for i in range(self.functions[0].m)]
        others = [f"y{i}" for i in range(self.functions[1].m)]
        for one, other in zip(*self.slots, strict=True):
            others[other] = names[one]
        for step in range(int(rank.max(initial=-1)) // _ROUND + 1):
            now = np.flatnonzero(rank // _ROUND == step)
            now = now[bound[now] > joins.margins[index[rows[now, 0]]]]
            if not now.size:
                continue
            sets = self.joined(rows[now])
            solution = maximise_margins(sets, self.solver)
            order = np.lexsort((-solution.margins, rows[now, 0]))
            pairs, first = np.unique(rows[now][order, 0], return_index=True)
            best = order[first]
            better = solution.margins[best] > joins.margins[index[pairs]]
            pairs, best = pairs[better], best[better]
            place = index[pairs]
            joins.margins[place] = solution.margins[best]
            joins.exist[place] = solution.margins[best] > GAP * solution.units[best]
            columns = [sets.names.index(name) for name in names]
            joins.first[place, : len(names)] = solution.points[best][:, columns]
            columns = [sets.names.index(name) for name in others]
            joins.second[place, : len(others)] = solution.points[best][:, columns]
            joins.first_piece[place] = rows[now][best][:, 1:3]
            joins.second_piece[place] = rows[now][best][:, 3:5]


def _pieces(
    functions: TorqueFunctions, pieces: IntArray, names: list[str], apart: bool
) -> LinearSets:
    return piece_sets(functions, pieces, names, apart=apart)
