"""Which convex pieces a path of grasp sets can be taken through, best first.

A path of sets leaves open which contacts each switch holds, and, since sets are unions of convex
pieces, in which piece each set is entered and in which it is left; between the two the fingers
slide through the widest chain of overlapping pieces. Every such *choice* is one convex set of
contacts, and together they are all that the path allows.

The grasps of a choice are tied together in pairs only, across the switches. So its largest margin
is the smallest of margins that are known from small linear programs: of the joins of two pieces
at the switches, and of the overlaps within the sets.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, permutations

import numpy as np

from regrasp_lp.errors import SolverError
from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.grasp_sets.pieces import BARELY_APART, piece_sets
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import Solver, maximise_margins
from regrasp_lp.margins import existing_pieces
from regrasp_lp.planning.layers import Crossing, Slots, best_first
from regrasp_lp.planning.path_lp import Stage, round_corners
from regrasp_lp.torque import TorqueFunctions

_EQUAL = 1e-7
"""Margins this close, in the object's size, are equal when choices are compared."""


@dataclass(frozen=True)
class Choice:
    """One way of taking a path of grasp sets.

    Parameters
    ----------
    placements : int
        Contacts placed at its switches.
    margin : float
        The largest margin that all of its grasps that are free to choose can have at once.
    chains : tuple of tuple of int
        Of each set the pieces to slide through, as numbers in its list.
    held : tuple of Slots
        Of each switch.
    """

    placements: int
    margin: float
    chains: tuple[tuple[int, ...], ...]
    held: tuple[Slots, ...]


@dataclass(frozen=True, eq=False)
class SetPieces:
    """The pieces of one set of a path, and how wide the ways between them are.

    Parameters
    ----------
    functions : TorqueFunctions
        Of one set.
    solver : Solver
    """

    functions: TorqueFunctions
    solver: Solver

    @cached_property
    def pieces(self) -> IntArray:
        """Pieces as rows (0, j, k), best first, shape (P, 3).

        Those that are wider than the accuracy of the solver, contacts on one edge in their order.
        """
        pieces = existing_pieces(self.functions)
        return pieces[maximise_margins(self._rows(pieces), self.solver).positive]

    def _rows(self, pieces: IntArray, name: str = "f") -> LinearSets:
        names = [f"{name}{i}" for i in range(self.functions.m)]
        sets = piece_sets(self.functions, pieces, names, apart=BARELY_APART)
        some = sets.rows.any(axis=(0, 2))  # not for pairs of contacts that cannot meet
        return replace(
            sets, rows=sets.rows[:, some], scales=sets.scales[:, some], bounds=sets.bounds[:, some]
        )

    @cached_property
    def overlaps(self) -> FloatArray:
        """Largest margin in the overlap of two pieces, of one with itself its own, shape (P, P).

        -inf where it is not positive beyond the accuracy of the solver.
        """
        sets = self._rows(self.pieces)
        one, other = np.triu_indices(len(self.pieces))
        both = sets.take(one).join(sets.take(other), on=sets.names)
        found = maximise_margins(both, self.solver)
        widths = np.empty((len(self.pieces), len(self.pieces)))
        widths[one, other] = widths[other, one] = np.where(found.positive, found.margins, -np.inf)
        return widths

    def stage(self, chain: Sequence[int] = ()) -> Stage:
        """Return the stage of a path LP that slides through a chain of pieces."""
        return Stage(self.functions, self.pieces[list(chain)])

    def containing(self, fractions: FloatArray) -> BoolArray:
        """Return which pieces contain a grasp, exactly, shape (P,).

        Parameters
        ----------
        fractions : numpy.ndarray, shape (m,)
        """
        row, j, k = self.pieces.T
        places = np.broadcast_to(fractions, (len(row), self.functions.m))
        below = self.functions.exact_signs(row, j, places) < 0
        return below & (self.functions.exact_signs(row, k, places) > 0)

    @cached_property
    def widths(self) -> FloatArray:
        """The least overlap along the widest chain between two pieces, shape (P, P).

        inf from a piece to itself, where no overlap is passed.
        """
        widths = self.overlaps.copy()
        np.fill_diagonal(widths, np.inf)
        for r in range(len(widths)):
            widths = np.maximum(widths, np.minimum(widths[:, r, None], widths[None, r, :]))
        return widths

    def chain(self, first: int, last: int) -> tuple[int, ...]:
        """Return the widest chain of pieces from one to another, with as few pieces as that takes.

        Parameters
        ----------
        first, last : int
            Numbers of pieces with a positive width between them.
        """
        wide = self.overlaps >= self.widths[first, last]
        before, queue = {first: first}, [first]
        while last not in before:
            piece = queue.pop(0)
            for other in np.flatnonzero(wide[piece]).tolist():
                if other not in before:
                    before[other] = piece
                    queue.append(other)
        way = [last]
        while way[-1] != first:
            way.append(before[way[-1]])
        return tuple(reversed(way))

    def joins(self, other: SetPieces, slots: Slots) -> FloatArray:
        """Return the largest margin of two grasps, one in a piece of each set, that share contacts.

        Contacts of the one that are not of the other keep apart where they could meet at a vertex.

        Parameters
        ----------
        other : SetPieces
        slots : Slots
            The shared contacts.

        Returns
        -------
        numpy.ndarray, shape (P, Q)
            -inf where it is not positive beyond the accuracy of the solver.
        """
        corners = round_corners(self.stage(), other.stage(), slots)
        if not slots and not corners:
            return np.minimum.outer(np.diag(self.overlaps), np.diag(other.overlaps))
        mine, theirs = self._rows(self.pieces), other._rows(other.pieces, "g")
        names = list(theirs.names)
        for here, there in slots:
            names[there] = mine.names[here]
        shape = len(mine), len(theirs)
        one, two = (n.ravel() for n in np.indices(shape))
        both = mine.take(one).join(
            theirs.rename(names).take(two), on=[mine.names[here] for here, _ in slots]
        )
        both = _with_rows(both, (*mine.names, *names), corners)
        found = maximise_margins(both, self.solver)
        return np.where(found.positive, found.margins, -np.inf).reshape(shape)

    def slots(self, other: SetPieces, held: int) -> list[Slots]:
        """Return every way to hold so many contacts in common: same edges, same order along them.

        Parameters
        ----------
        other : SetPieces
        held : int
        """
        here, there = self.functions.edges[0], other.functions.edges[0]
        found = []
        for one in combinations(range(len(here)), held):
            for two in permutations(range(len(there)), held):
                pairs = tuple(zip(one, two, strict=True))
                crossed = any(
                    here[a] == here[c] and b > d for (a, b), (c, d) in combinations(pairs, 2)
                )
                if all(here[a] == there[b] for a, b in pairs) and not crossed:
                    found.append(pairs)
        return found


def _with_rows(
    sets: LinearSets, names: Sequence[str], corners: Sequence[tuple[FloatArray, float]]
) -> LinearSets:
    """Add rows over these names, to be kept by next to nothing."""
    b, r, n = len(sets), len(corners), len(sets.names)
    rows = np.zeros((b, r, n))
    for name, column in zip(names, np.array([row for row, _ in corners]).T, strict=False):
        rows[:, :, sets.names.index(name)] += column
    bounds = np.tile([bound for _, bound in corners], (b, 1)).reshape(b, r)
    return replace(
        sets,
        rows=np.concatenate((sets.rows, rows), axis=1),
        scales=np.concatenate((sets.scales, np.full((b, r), BARELY_APART)), axis=1),
        bounds=np.concatenate((sets.bounds, bounds), axis=1),
    )


@dataclass(frozen=True, eq=False)
class PathChoices:
    """All choices along a path of sets.

    Parameters
    ----------
    stages : tuple of SetPieces
    held : tuple of (int, int)
        Of each switch the most contacts that can be held, and the least that the hand has to.
    first, last : numpy.ndarray, shape (P,)
        Margin of the first and the last grasp in each piece of the first and the last set: inf if
        it is given and in the piece, -inf if it is given and is not.
    """

    stages: tuple[SetPieces, ...]
    held: tuple[tuple[int, int], ...]
    first: FloatArray
    last: FloatArray

    def __iter__(self) -> Iterator[Choice]:
        """Yield all choices: fewest placements first, of those the largest least margin first.

        Then the second least margin decides, and so on; the margins are those of the two ends, the
        widest chain within each set and the join at each switch, equal if they differ by no more
        than 1e-7 of the object's size. Ways to switch that hold fewer contacts than possible are
        not looked at before all others have been asked for.

        Raises
        ------
        SolverError
            If a switch exists within rounding only, or a given start or goal is held within
            rounding only.
        """
        least = -1
        for choice in self._ordered(most=True):
            least = choice.placements
            yield choice
        if least < 0:
            raise SolverError(
                "no chain of overlapping pieces wider than the accuracy of "
                f"{self.stages[0].solver.name} joins the start and the goal: a set on the way is "
                "thinner than rounding, or one of them too near to its border"
            )
        if any(most > needed for most, needed in self.held):
            for choice in self._ordered(most=False):
                if choice.placements > least:
                    yield choice

    def _ordered(self, *, most: bool) -> Iterator[Choice]:
        crossings: list[Crossing] = []
        for t, stage in enumerate(self.stages):
            if t:
                crossings.append(self._switch(t - 1, most=most))
            crossings.append(Crossing(((),), np.zeros(1, dtype=np.intp), stage.widths[None]))
        unit = _EQUAL * self.stages[0].functions.cones.size
        for elements, ways in best_first(self.first, crossings, self.last, unit):
            passed = [
                float(crossing.widths[way, elements[n], elements[n + 1]])
                for n, (crossing, way) in enumerate(zip(crossings, ways, strict=True))
            ]
            ends = float(self.first[elements[0]]), float(self.last[elements[-1]])
            yield Choice(
                sum(int(c.placements[way]) for c, way in zip(crossings, ways, strict=True)),
                min(*ends, *passed),
                tuple(
                    stage.chain(*elements[2 * t : 2 * t + 2]) for t, stage in enumerate(self.stages)
                ),
                tuple(crossings[n].slots[ways[n]] for n in range(1, len(crossings), 2)),
            )

    def _switch(self, t: int, *, most: bool) -> Crossing:
        """The ways of a switch: those that hold as many contacts as possible, or all."""
        one, other = self.stages[t : t + 2]
        high, low = self.held[t]
        found = []
        for held in range(high, (high if most else low) - 1, -1):
            for slots in one.slots(other, held):
                if (t, slots) not in self._joins:
                    self._joins[t, slots] = one.joins(other, slots)
                if (self._joins[t, slots] > 0).any():
                    found.append((slots, other.functions.m - held, self._joins[t, slots]))
        if not found:
            raise SolverError(
                f"switch {t} of the path, from edges {one.functions.edges[0].tolist()} to "
                f"{other.functions.edges[0].tolist()}, exists within rounding only: its margin is "
                f"within the accuracy of {one.solver.name}; leave it out (min_margin), or change "
                "the friction a little"
            )
        slots_, placements, widths = zip(*found, strict=True)
        return Crossing(slots_, np.array(placements), np.array(widths))

    @cached_property
    def _joins(self) -> dict[tuple[int, Slots], FloatArray]:
        """Joins known so far, by switch and held contacts."""
        return {}
