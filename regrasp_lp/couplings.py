"""Switches of a hand that limits the distance between fingers: margin LPs on coupled pieces.

While it switches the hand touches both grasps at once, so that rows couple the contacts which only
one of them has with those that only the other one has. A piece of the one set, a piece of the other
and a choice of these rows, joined on the held contacts, are one margin LP; the switch exists if one
of them has a positive margin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from regrasp_lp.completion import complete
from regrasp_lp.contact_rule import meet_held
from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.grasp_sets.pieces import BARELY_APART
from regrasp_lp.grasp_sets.set_pieces import (
    SetPieces,
    with_rows,
    without_functions,
    without_void_rows,
)
from regrasp_lp.grasp_sets.spacing import Alternatives, Spacing, admits
from regrasp_lp.grasp_sets.vertices import Family
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import GAP, Solver, maximise_margins
from regrasp_lp.shadows import Shadows
from regrasp_lp.switching import Meeting

_POSITIVE = 1e-12
"""Of the size of the object: a margin that is more than rounding."""

_ROUND = 6
_FIRST = 7 * _ROUND  # candidates of a switch, in three rounds, before others are looked at closer
_MOST_JOINS = 500_000
_CHUNK = 2000


@dataclass(frozen=True, eq=False)
class Couplings:
    """The best way to do each of P switches.

    Parameters
    ----------
    margins : numpy.ndarray, shape (P,)
        Largest margin over all joins; -inf if there is none.
    choices : numpy.ndarray of int, shape (P,)
        Which of the `Alternatives` that couple the two grasps holds; -1 if there is none.
    first, second : numpy.ndarray, shape (P, 3)
        Fractions of the two grasps (NaN beyond their number of contacts).
    """

    margins: FloatArray
    choices: IntArray
    first: FloatArray
    second: FloatArray


def best_couplings(
    sets: GraspSets, first: Shadows, second: Shadows, solver: Solver, *, enough: float = np.inf
) -> Couplings:
    """Maximise the margin of switches over all coupled pieces.

    Parameters
    ----------
    sets : GraspSets
        With limits to distances.
    first, second : Shadows
        Aligned: switch n is from ``first[n]`` to ``second[n]``, held on the same edges.
    solver : Solver
    enough : float
        No better way is looked for once there is one with a margin larger than this.

    Returns
    -------
    Couplings
    """
    n = len(first)
    found = Couplings(
        np.full(n, -np.inf), np.full(n, -1), np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    )
    key = np.column_stack((first.source, first.slots, second.source, second.slots))
    kinds, group = np.unique(key, axis=0, return_inverse=True)
    for number in range(len(kinds)):
        rows = np.flatnonzero(group.ravel() == number)
        one, other = first.take(rows), second.take(rows)
        ways = [_coupled(sets, one, other, n) for n in range(len(rows))]
        _Group(sets, one, other, ways).solve(rows, found, solver, enough)
    return found


def _coupled(sets: GraspSets, first: Shadows, second: Shadows, n: int) -> Alternatives:
    index = [int(sets.offsets[s.source[n]] + s.row[n]) for s in (first, second)]
    slots = zip(first.slots[n].tolist(), second.slots[n].tolist(), strict=True)
    ways = sets.coupled(index[0], index[1], list(slots))
    assert ways is not None  # there are limits
    return ways


def _ranks(switches: IntArray) -> IntArray:
    """Place of each candidate among those of its switch, which follow each other."""
    return np.arange(len(switches)) - np.searchsorted(switches, switches)


@dataclass(frozen=True, eq=False)
class _Group:
    """Switches that hold the same slots of sets of the same families."""

    sets: GraspSets
    first: Shadows
    second: Shadows
    ways: list[Alternatives]

    def _families(self) -> tuple[Family, Family]:
        families = self.sets.families
        return families[self.first.source[0]], families[self.second.source[0]]

    def _names(self) -> tuple[list[str], list[str]]:
        """Names of the contacts of both sets: those that occur in both are held."""
        mine, theirs = (
            [f"{letter}{i}" for i in range(family.functions.m)]
            for letter, family in zip("fg", self._families(), strict=True)
        )
        for here, there in zip(self.first.slots[0], self.second.slots[0], strict=True):
            theirs[there] = mine[here]
        return mine, theirs

    def solve(self, index: IntArray, found: Couplings, solver: Solver, enough: float) -> None:
        """Write the best joins to places `index`, a bounded number of candidates at a time."""
        counts = self._counts()
        total = np.cumsum(counts) // _MOST_JOINS
        for part in np.split(np.arange(len(counts)), np.flatnonzero(np.diff(total)) + 1):
            if part.size:
                self._solve(part, index, found, solver, enough)

    def _ranges(self) -> list[tuple[IntArray, IntArray]]:
        """Where the pieces of the sets are, in the stacks of their families."""
        return [
            (
                np.searchsorted(_pieces(family).pieces[:, 0], shadow.row),
                np.searchsorted(_pieces(family).pieces[:, 0], shadow.row + 1),
            )
            for family, shadow in zip(self._families(), (self.first, self.second), strict=True)
        ]

    def _counts(self) -> IntArray:
        (low, high), (other_low, other_high) = self._ranges()
        of_ways = np.array([len(way) for way in self.ways])
        return np.asarray((high - low) * (other_high - other_low) * of_ways)

    def _candidates(self, part: IntArray) -> tuple[IntArray, FloatArray]:
        """Rows (switch, piece, other piece, way), the most promising of each switch first."""
        ranges, margins = self._ranges(), [_pieces(f).margins for f in self._families()]
        rows, bounds = [np.zeros((0, 4), dtype=np.intp)], [np.zeros(0)]
        for n in part.tolist():
            mine, theirs = (np.arange(low[n], high[n]) for low, high in ranges)
            p, q, way = np.meshgrid(mine, theirs, np.arange(len(self.ways[n])), indexing="ij")
            each = np.stack((np.full(p.size, n), p.ravel(), q.ravel(), way.ravel()), axis=1)
            bound = np.minimum(margins[0][each[:, 1]], margins[1][each[:, 2]])
            order = np.argsort(-bound, kind="stable")
            rows.append(each[order])
            bounds.append(bound[order])
        return np.concatenate(rows), np.concatenate(bounds)

    def _joined(self, rows: IntArray, keep: tuple[bool, bool] = (True, True)) -> LinearSets:
        """The joins of candidates; without the torque functions of one side or of both."""
        one, other = (
            _pieces(family).take(rows[:, column]).linear(names, apart=BARELY_APART)
            for column, family, names in zip((1, 2), self._families(), self._names(), strict=True)
        )
        one, other = (
            sets if kept else without_functions(sets)
            for sets, kept in zip((one, other), keep, strict=True)
        )
        mine, theirs = self._names()
        both = one.join(other, on=[name for name in theirs if name in mine])
        width = max((self.ways[n].bounds.shape[1] for n in rows[:, 0].tolist()), default=0)
        more, bounds = np.zeros((len(rows), width, len(both.names))), np.zeros((len(rows), width))
        for place, (n, way) in enumerate(rows[:, [0, 3]].tolist()):
            used = self.ways[n].bounds.shape[1]
            more[place, :used] = self.ways[n].rows[way]
            bounds[place, :used] = self.ways[n].bounds[way]
        return without_void_rows(with_rows(both, more, bounds))

    def _solve(
        self, part: IntArray, index: IntArray, found: Couplings, solver: Solver, enough: float
    ) -> None:
        rows, bound = self._candidates(part)
        least = _POSITIVE * self.sets.cones.size
        rank, low, size = _ranks(rows[:, 0]), 0, _ROUND
        while low <= rank.max(initial=-1):
            best = found.margins[index[rows[:, 0]]]
            open_ = (best <= max(enough, least)) & (bound > np.maximum(best, least))
            now = np.flatnonzero((rank >= low) & (rank < low + size) & open_)
            low, size = low + size, 2 * size
            if now.size:
                self._write(rows[now], index, found, solver)
            if low == _FIRST:  # what is left is worth a closer look
                left = open_ & (rank >= low)
                rows, bound = self._bounded(rows[left], bound[left], solver)
                rank, low, size = _ranks(rows[:, 0]), 0, _FIRST + 1

    def _bounded(
        self, rows: IntArray, bound: FloatArray, solver: Solver
    ) -> tuple[IntArray, FloatArray]:
        """The candidates that are possible, with better bounds, the most promising ones first.

        Bounds are the margins of parts of their programs: of the limits alone, then also of the
        functions of one set. Many candidates have these parts in common.
        """
        size = self.sets.cones.size
        of_first, of_second = (_pieces(family).choice for family in self._families())
        for keep in ((False, False), (True, False), (False, True)):
            choices = of_first[rows[:, 1]], of_second[rows[:, 2]]
            parts = [
                rows[:, column] if kept else choice
                for column, choice, kept in zip((1, 2), choices, keep, strict=True)
            ]
            key = np.column_stack((rows[:, 0], *parts, rows[:, 3]))
            _, first, which = np.unique(key, axis=0, return_index=True, return_inverse=True)
            if len(first) > len(rows) // 2:
                continue
            sets = self._joined(rows[first], keep)
            margins = np.full(len(first), np.inf)
            some = np.flatnonzero(sets.scales.any(axis=1))
            margins[some] = maximise_margins(sets.take(some), solver).bounds
            bound = np.minimum(bound, margins[which.ravel()])
            rows, bound = rows[bound > GAP * size], bound[bound > GAP * size]
        order = np.lexsort((-bound, rows[:, 0]))
        return rows[order], bound[order]

    def _write(self, rows: IntArray, index: IntArray, found: Couplings, solver: Solver) -> None:
        sets = self._joined(rows)
        solution = maximise_margins(sets, solver)
        order = np.lexsort((-solution.margins, rows[:, 0]))
        switches, first = np.unique(rows[order, 0], return_index=True)
        best, place = order[first], index[switches]
        better = solution.margins[best] > found.margins[place]
        best, place = best[better], place[better]
        found.margins[place], found.choices[place] = solution.margins[best], rows[best, 3]
        for fractions, names in zip((found.first, found.second), self._names(), strict=True):
            columns = [sets.names.index(name) for name in names]
            fractions[place, : len(names)] = solution.points[best][:, columns]


def coupled_rule(
    sets: GraspSets, solver: Solver, *, min_margin: float = 0.0
) -> Callable[[Shadows, Shadows, IntArray, IntArray], Meeting]:
    """Return the contact rule under limits to distances, for a `SwitchRule`.

    What the contact rule without limits refuses does not exist; what is left is accepted by a
    grasp in each set, held contacts in common, if these are found to be within the limits, and
    else decided by margin LPs.

    Parameters
    ----------
    sets : GraspSets
        With limits to distances.
    solver : Solver
    min_margin : float
        Only switches with a larger margin count.
    """
    least = max(min_margin, _POSITIVE * sets.cones.size)

    def decide(first: Shadows, second: Shadows, i: IntArray, j: IntArray) -> Meeting:
        result = Meeting.unknown(len(i), first.held)
        if first.held:
            result.write(np.arange(len(i)), meet_held(first, second, i, j, solver=solver))
        else:
            result.exist[:] = True
        result.exist[_disjoint(sets, first.take(i), second.take(j))] = False
        result.exist[_too_many(sets, first.take(i), second.take(j))] = False
        for start in range(0, len(i), _CHUNK):
            rows = start + np.flatnonzero(result.exist[start : start + _CHUNK])
            one, other = first.take(i[rows]), second.take(j[rows])
            if min_margin == 0:
                seen = _seen(sets, one, other, result.points[rows])
                left = np.flatnonzero(~seen)
                rows, one, other = rows[left], one.take(left), other.take(left)
            found = best_couplings(sets, one, other, solver, enough=min_margin)
            result.exist[rows] = found.margins > least
            result.points[rows] = np.take_along_axis(found.first, one.slots, axis=1)
        result.points[~result.exist] = np.nan
        return result

    return decide


def _disjoint(sets: GraspSets, first: Shadows, second: Shadows) -> BoolArray:
    """Whether all contacts are held between two groups of pieces of one and the same combination.

    They are different sets because no two of their pieces overlap.
    """
    result = first.source == second.source
    for number, family in enumerate(sets.families):
        mine = np.flatnonzero(result & (first.source == number))
        one, other = first.row[mine], second.row[mine]
        same = (family.functions.edges[one] == family.functions.edges[other]).all(axis=1)
        same &= family.centers[one] == family.centers[other]
        result[mine] = same & (first.held == family.functions.m)
    return np.asarray(result)


def _too_many(sets: GraspSets, first: Shadows, second: Shadows) -> BoolArray:
    """Whether switches need more fingers than the hand has of those that may touch there."""
    spacing = sets.spacing
    assert spacing is not None
    n = len(spacing.sizes)
    if n < 2:
        return np.zeros(len(first), dtype=bool)
    needed = -_per_group(spacing, first.edges)
    for shadow in (first, second):
        for number, family in enumerate(sets.families):
            mine = np.flatnonzero(shadow.source == number)
            needed[mine] += _per_group(spacing, family.functions.edges[shadow.row[mine]])
    return np.asarray((needed > spacing.sizes).any(axis=1))


def _per_group(spacing: Spacing, segments: IntArray) -> IntArray:
    """How many of some contacts are of each group of fingers, shape (N, groups)."""
    group = spacing.cones.group[segments]
    return np.stack([(group == g).sum(axis=1) for g in range(len(spacing.sizes))], axis=1)


def _seen(sets: GraspSets, first: Shadows, second: Shadows, points: FloatArray) -> BoolArray:
    """Whether completed grasps are in both sets and together within the limits."""
    spacing = sets.spacing
    assert spacing is not None
    places, inside = np.full((len(first), 6, 2), np.nan), np.ones(len(first), dtype=bool)
    for number, shadow in enumerate((first, second)):
        for source, family in enumerate(sets.families):
            mine = np.flatnonzero(shadow.source == source)
            if not mine.size:
                continue
            functions = family.functions.take(shadow.row[mine])
            fractions = complete(functions, shadow.slots[mine], points[mine])
            inside[mine] &= _in_pieces(family, shadow.row[mine], fractions)
            at = _points(spacing, functions.edges, fractions)
            if number:
                np.put_along_axis(at, shadow.slots[mine][:, :, None], np.nan, axis=1)
            places[mine, 3 * number : 3 * number + functions.m] = at
    return np.asarray(inside & admits(spacing, places))


def _points(spacing: Spacing, edges: IntArray, fractions: FloatArray) -> FloatArray:
    cones = spacing.cones
    return np.asarray(cones.local_starts[edges] + fractions[..., None] * cones.vectors[edges])


def _in_pieces(family: Family, rows: IntArray, fractions: FloatArray) -> BoolArray:
    """Whether grasps are in the pieces of sets, by floating point."""
    pieces = _pieces(family)
    low, high = (np.searchsorted(pieces.pieces[:, 0], rows + n) for n in (0, 1))
    counts = high - low
    grasp = np.arange(len(rows)).repeat(counts)
    first = low - (np.cumsum(counts) - counts)
    number = np.arange(len(grasp)) + first.repeat(counts)
    names = [f"f{i}" for i in range(family.functions.m)]
    inside = pieces.take(number).linear(names, apart=BARELY_APART).margins(fractions[grasp]) > 0
    result = np.zeros(len(rows), dtype=bool)
    np.logical_or.at(result, grasp, inside)
    return result


def _pieces(family: Family) -> SetPieces:
    pieces = family.pieces
    assert pieces is not None  # there are limits
    return pieces
