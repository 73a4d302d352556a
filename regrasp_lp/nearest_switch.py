"""The switch that comes nearest to joining two parts of a switching graph.

At ε < 0 the theory of switching holds as it does at 0: with every torque function shifted by |ε|,
D and U only grow, and still cover the box, since no ``M/s`` is at least |ε| and at most ε at once.
So whether the margin of a switch is larger than ε <= 0 is told by the same projections and
intervals with shifted constants (`switching`), and the largest margin over all pairs is found by
bisecting ε for all of them at once: a pair that is apart at ε is out as soon as another one is
not. The margin LP of the pair that is left gives its margin and its two grasps.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.contact_rule import meet_held
from regrasp_lp.friction import BoolArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.joins import best_joins
from regrasp_lp.lp import GAP, Solver
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.on_demand import matches
from regrasp_lp.shadows import Shadows, shadows
from regrasp_lp.switching import certainly_apart

_MOST_PAIRS = 2_000_000
"""Pairs of projections looked at, of any number of held contacts."""

_MOST_PROGRAMS = 200
"""Pairs whose margin LPs are solved where bisection cannot choose among them."""

_PART = 4096
"""Pairs that tell a first bound for all."""

_ACCURATE = 1e-9
"""Of the object's size: margins that bisection does not tell apart."""


@dataclass(frozen=True, eq=False)
class NearestSwitch:
    """The pair of sets of two parts of a graph that a hand comes nearest to switching between.

    Parameters
    ----------
    first, second : int
        Numbers of the sets.
    edges : tuple of tuple of int
        Edges of the two sets.
    held : tuple of int
        Edges of the contacts that would be held.
    margin : float
        The largest margin that both grasps can have at once, equal in the held contacts; in the
        object's unit. Not positive, unless the switch is missing because of another rule (the
        focus rule, a least margin).
    grasps : tuple of two Grasp
        Grasps that attain it; with a negative margin they are not both in force closure.
    pairs : int
        How many choices of contacts, of pairs of sets, have the edges in common that would have to
        be held.
    searched : int
        Among so many of them, the first ones, this is the nearest.
    """

    first: int
    second: int
    edges: tuple[tuple[int, ...], tuple[int, ...]]
    held: tuple[int, ...]
    margin: float
    grasps: tuple[Grasp, Grasp]
    pairs: int
    searched: int


def nearest_switch(
    sets: GraspSets, hand: Hand, solver: Solver, sources: Iterable[int], targets: Iterable[int]
) -> NearestSwitch | None:
    """Return the switch with the largest margin between two parts of a graph.

    By the contact rule: of the contacts that the hand has to hold, whatever else keeps the sets
    from being adjacent.

    Parameters
    ----------
    sets : GraspSets
    hand : Hand
    solver : Solver
    sources, targets : iterable of int
        Numbers of the sets of either part; no set is in both.

    Returns
    -------
    NearestSwitch or None
        None if no two of the sets have the edges in common.
    """
    found = []
    sides = [_rows(sets, side) for side in (sources, targets)]
    for held in (1, 2, 3):
        one, other = (shadows(sets.sources, held, rows) for rows in sides)
        i, j = matches(one.edges, other.edges)
        contacts = (_contacts(s)[rows] for s, rows in ((one, i), (other, j)))
        needed = np.flatnonzero(hand.needs[tuple(contacts)] == held)
        if needed.size:
            found.append(_Pairs(sets, one, other, i[needed], j[needed]).nearest(solver))
    if not found:
        return None
    best = max(found, key=lambda switch: switch.margin)
    pairs, searched = (sum(getattr(s, name) for s in found) for name in ("pairs", "searched"))
    return replace(best, pairs=pairs, searched=searched)


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Pairs of projections on the same edges: ``one[i[n]]`` and ``other[j[n]]``."""

    sets: GraspSets
    one: Shadows
    other: Shadows
    i: IntArray
    j: IntArray

    @property
    def size(self) -> float:
        return self.sets.polygon.diameter

    def nearest(self, solver: Solver) -> NearestSwitch:
        """The best of the first pairs, by bisection and margin LPs."""
        chosen, least, searched = self._promising(solver)
        first, second = self.one.take(self.i[chosen]), self.other.take(self.j[chosen])
        joins = best_joins(first, second, solver, least=least - 2 * GAP * self.size)
        best = int(joins.margins.argmax())
        margin = float(joins.margins[best])
        one, other = self._numbers(first)[best], self._numbers(second)[best]
        edges = self.sets[one].edges
        return NearestSwitch(
            one,
            other,
            (edges, self.sets[other].edges),
            tuple(edges[slot] for slot in first.slots[best].tolist()),
            margin if least >= 0 else min(margin, 0.0),
            (self.sets.grasp(one, joins.first[best]), self.sets.grasp(other, joins.second[best])),
            len(self.i),
            searched,
        )

    def _promising(self, solver: Solver) -> tuple[IntArray, float, int]:
        """Pairs among which the best one is, a bound of its margin, and how many were searched."""
        every: IntArray = np.arange(min(len(self.i), _MOST_PAIRS))
        meeting = meet_held(self.one, self.other, self.i[every], self.j[every], solver=solver).exist
        if not meeting.any() and self.one.held < 3:
            left, least = self._left_by_bisection(every)
            return left[:1], least, len(every)
        # Above 0, and where three contacts are held, only programs tell.
        least = 0.0 if meeting.any() else -np.inf
        open_ = self._most_promising(every[meeting] if meeting.any() else every)
        searched = len(every) if len(open_) <= _MOST_PROGRAMS else _MOST_PROGRAMS
        return open_[:_MOST_PROGRAMS], least, searched

    def _numbers(self, projections: Shadows) -> list[int]:
        numbers: list[int] = (self.sets.offsets[projections.source] + projections.row).tolist()
        return numbers

    def _most_promising(self, chosen: IntArray) -> IntArray:
        """Pairs in the order of the smaller margin of their two sets."""
        bounds = [
            self.sets.margins[self.sets.offsets[s.source] + s.row][rows[chosen]]
            for s, rows in ((self.one, self.i), (self.other, self.j))
        ]
        return chosen[np.argsort(-np.minimum(*bounds), kind="stable")]

    def _left_by_bisection(self, chosen: IntArray) -> tuple[IntArray, float]:
        """The pairs, and the bound, that bisection leaves between the object's size and 0."""
        step = -(-len(chosen) // _PART)
        low = self._bisect(chosen[::step], -self.size, 1e-3)[1]
        left = chosen[self._possible(chosen, low)]
        return self._bisect(left, low, _ACCURATE)

    def _bisect(self, chosen: IntArray, low: float, accuracy: float) -> tuple[IntArray, float]:
        """Pairs that are possible at a bound, none of them at one that is a little larger."""
        high = 0.0
        while high - low > accuracy * self.size:
            middle = (low + high) / 2
            possible = self._possible(chosen, middle)
            if possible.any():
                low, chosen = middle, chosen[possible]
            else:
                high = middle
        return chosen, low

    def _possible(self, chosen: IntArray, bound: float) -> BoolArray:
        """Which pairs may have a margin larger than a bound <= 0."""
        one, other = (_shifted(s, bound) for s in (self.one, self.other))
        return np.asarray(~certainly_apart(one, other, self.i[chosen], self.j[chosen]))


def _shifted(projections: Shadows, bound: float) -> Shadows:
    """Projections of what has a margin larger than a bound <= 0, as arrays only."""
    return replace(projections, low=projections.low + bound, high=projections.high - bound)


def _rows(sets: GraspSets, indices: Iterable[int]) -> list[IntArray]:
    """The rows of sets in each family."""
    chosen = np.array(sorted(indices), dtype=np.intp)
    family = np.searchsorted(sets.offsets, chosen, side="right") - 1
    return [chosen[family == f] - sets.offsets[f] for f in range(len(sets.families))]


def _contacts(projections: Shadows) -> IntArray:
    """Number of contacts of each projected set."""
    return np.array([f.m for f in projections.sources], dtype=np.intp)[projections.source]
