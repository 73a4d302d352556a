"""Margin LPs on joined pieces: the best way to switch between two grasp sets.

A switch from S to T that holds some contacts is a point of a piece of S joined, on the held
contacts, with a piece of T. The margin of the switch is the largest over all pairs of pieces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.grasp_sets.candidates import runs
from regrasp_lp.grasp_sets.pieces import piece_sets
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import Solver, maximise_margins
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
    bounds : numpy.ndarray, shape (P,)
        Upper bounds of these margins, from the multipliers of the programs and from `least`; none
        where the search ended with `enough`.
    exist : numpy.ndarray of bool, shape (P,)
        Whether the margin is positive beyond the accuracy of the solver.
    first, second : numpy.ndarray, shape (P, 3)
        Fractions of the two grasps (NaN beyond their number of contacts).
    """

    margins: FloatArray
    bounds: FloatArray
    exist: BoolArray
    first: FloatArray
    second: FloatArray


def best_joins(
    first: Shadows,
    second: Shadows,
    solver: Solver,
    *,
    apart: float = 0.0,
    enough: float = np.inf,
    least: float = 0.0,
) -> Joins:
    """Maximise the margin over all joined pieces of pairs of sets.

    Parameters
    ----------
    first, second : Shadows
        Aligned: pair i is ``first[i]`` and ``second[i]``, held on the same edges.
    solver : Solver
    apart : float
        As for `piece_sets`: keeps contacts of a grasp that could meet apart, and in order.
    enough : float
        No better join is looked for once one exists whose margin is larger than this.
    least : float
        Only pieces whose own margin is larger are joined; below 0 for sets within rounding.

    Returns
    -------
    Joins
    """
    n = len(first)
    joins = Joins(
        np.full(n, -np.inf),
        np.full(n, least),
        np.zeros(n, dtype=bool),
        np.full((n, 3), np.nan),
        np.full((n, 3), np.nan),
    )
    key = np.column_stack((first.source, first.slots, second.source, second.slots))
    kinds, group = np.unique(key, axis=0, return_inverse=True)
    for number in range(len(kinds)):
        rows = np.flatnonzero(group.ravel() == number)
        group_ = _Group.of(first.take(rows), second.take(rows), apart, least)
        _solve_group(group_, rows, joins, solver, enough)
    return joins


def possible_joins(first: Shadows, second: Shadows, solver: Solver, least: float) -> IntArray:
    """Return the joins of pieces of one pair of sets whose margin may be `least` or more.

    Parameters
    ----------
    first, second : Shadows
        One projection each.
    solver : Solver
        Its multipliers give an upper bound for each join.
    least : float

    Returns
    -------
    numpy.ndarray of int, shape (K, 4)
        The functions j, k of the first set and j, k of the second one; most promising first.
    """
    group = _Group.of(first, second, 0.0, least)
    rows, bound = group.candidates()
    rows = rows[bound >= least]
    if not rows.size:
        return rows[:, 1:]
    solution = maximise_margins(group.joined(rows), solver)
    order = np.argsort(-solution.margins, kind="stable")
    return rows[order[solution.bounds[order] >= least], 1:]


@dataclass(frozen=True, eq=False)
class _Group:
    """Aligned pairs of sets that hold the same slots: `names` that occur in both are held."""

    functions: tuple[TorqueFunctions, TorqueFunctions]
    names: tuple[list[str], list[str]]
    apart: float
    least: float

    @classmethod
    def of(cls, first: Shadows, second: Shadows, apart: float, least: float) -> _Group:
        one, other = (s.sources[s.source[0]].take(s.row) for s in (first, second))
        names = [f"f{i}" for i in range(one.m)], [f"g{i}" for i in range(other.m)]
        for here, there in zip(first.slots[0], second.slots[0], strict=True):
            names[1][there] = names[0][here]
        return cls((one, other), names, apart, least)

    def candidates(self) -> tuple[IntArray, FloatArray]:
        """All (pair, j, k, j', k') with existing pieces, and the smaller of their margins.

        Sorted by pair, the most promising first.
        """
        margins = [piece_margins(functions) for functions in self.functions]
        pair, j, k = np.nonzero(margins[0] > self.least)
        other, j2, k2 = np.nonzero(margins[1] > self.least)
        counts = np.bincount(other, minlength=len(self.functions[0]))
        each = counts[pair]
        mine = np.arange(len(pair)).repeat(each)
        theirs = runs((np.cumsum(counts) - counts)[pair], each)
        rows = np.column_stack((pair[mine], j[mine], k[mine], j2[theirs], k2[theirs]))
        bound = np.minimum(margins[0][pair, j, k][mine], margins[1][other, j2, k2][theirs])
        order = np.lexsort((-bound, rows[:, 0]))
        return rows[order], bound[order]

    def joined(self, rows: IntArray) -> LinearSets:
        """The joined pieces of candidates as linear sets."""
        one, other = (
            piece_sets(functions, rows[:, columns], names, apart=self.apart)
            for functions, names, columns in zip(
                self.functions, self.names, ([0, 1, 2], [0, 3, 4]), strict=True
            )
        )
        return one.join(other, on=[name for name in self.names[1] if name in self.names[0]])


def _solve_group(
    group: _Group, index: IntArray, joins: Joins, solver: Solver, enough: float
) -> None:
    """Write the best joins of a group's pairs to places `index` of `joins`.

    In rounds of a few candidates a pair: a pair is done when none of those left can be better,
    the margins of its pieces being bounds.
    """
    rows, bound = group.candidates()
    rank = np.arange(len(rows)) - np.searchsorted(rows[:, 0], rows[:, 0])
    for step in range(int(rank.max(initial=-1)) // _ROUND + 1):
        now = np.flatnonzero(rank // _ROUND == step)
        place = index[rows[now, 0]]
        done = joins.exist[place] & (joins.margins[place] > enough)
        now = now[(bound[now] > joins.margins[place]) & ~done]
        if not now.size:
            continue
        sets = group.joined(rows[now])
        solution = maximise_margins(sets, solver)
        order = np.lexsort((-solution.margins, rows[now, 0]))
        pairs, first = np.unique(rows[now][order, 0], return_index=True)
        best, place = order[first], index[pairs]
        np.maximum.at(joins.bounds, index[rows[now, 0]], solution.bounds)
        better = solution.margins[best] > joins.margins[place]
        best, place = best[better], place[better]
        joins.margins[place] = solution.margins[best]
        joins.exist[place] = solution.positive[best]
        for fractions, names in zip((joins.first, joins.second), group.names, strict=True):
            columns = [sets.names.index(name) for name in names]
            fractions[place, : len(names)] = solution.points[best][:, columns]
