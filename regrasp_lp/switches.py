"""Switching edges between all pairs of grasp sets, stored or found on demand.

Two sets over n_S and n_T contacts are adjacent iff a hand of k fingers can hold
``max(0, n_S + n_T - k)`` contacts in common (the contact rule). Holding more saves placements, so
every size up to ``min(n_S, n_T)`` is tried; the largest feasible one is kept for each pair.
Where nothing needs to be held all pairs are adjacent: these edges are never stored.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.grasp_sets.candidates import runs
from regrasp_lp.planning.hand import Hand
from regrasp_lp.shadows import Shadows, shadows
from regrasp_lp.switching import Meeting
from regrasp_lp.torque import TorqueFunctions

STORE_LIMIT = 8_000_000
"""Up to so many pairs of sets with common edges the switches are stored, above found on demand."""

SWITCH_ARRAYS = ("starts", "others", "held", "slots", "points")
"""What `StoredSwitches` consists of."""

_CHUNK = 200_000

Decide = Callable[[Shadows, Shadows, IntArray, IntArray], Meeting]
Tell = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class SwitchPairs:
    """Pairs of sets that can hold contacts in common, each with a witness.

    Parameters
    ----------
    first, second : numpy.ndarray of int, shape (K,)
        Numbers of the two sets, i < j.
    held : numpy.ndarray of int, shape (K,)
        A number of contacts that the pair can hold.
    slots : numpy.ndarray of int, shape (K, 3)
        Which contacts of the first set these are; -1 beyond `held`.
    points : numpy.ndarray, shape (K, 3)
        Where they are held: fractions of their edges, NaN beyond `held`.
    """

    first: IntArray
    second: IntArray
    held: IntArray
    slots: IntArray
    points: FloatArray

    def __len__(self) -> int:
        return len(self.first)

    @classmethod
    def join(cls, parts: Iterable[SwitchPairs]) -> SwitchPairs:
        """Return the pairs of several stacks, one after the other."""
        none = np.zeros(0, dtype=np.intp)
        slots, points = none.reshape(0, 3).astype(np.int8), np.zeros((0, 3))
        every = (cls(none, none, none, slots, points), *parts)
        names = ("first", "second", "held", "slots", "points")
        return cls(*(np.concatenate([getattr(part, name) for part in every]) for name in names))

    def take(self, rows: IntArray) -> SwitchPairs:
        """Return some of the pairs."""
        return SwitchPairs(
            self.first[rows],
            self.second[rows],
            self.held[rows],
            self.slots[rows],
            self.points[rows],
        )

    def largest(self) -> SwitchPairs:
        """Return each pair once, sorted, with the largest number of held contacts."""
        n = int(self.second.max(initial=0)) + 1
        order = np.argsort(-self.held, kind="stable")
        key = (self.first.astype(np.int64) * n + self.second)[order]
        return self.take(order[np.unique(key, return_index=True)[1]])


class Switches(Protocol):
    """Pairs of N grasp sets that can hold contacts in common."""

    def neighbors(self, index: int) -> tuple[IntArray, IntArray]:
        """Return the sets that share at least one held contact with a set, and how many."""

    def witness(self, i: int, j: int) -> tuple[IntArray, FloatArray] | None:
        """Return which contacts of set i < j a switch holds and where, or None if it holds none."""

    def pairs(self) -> Iterator[SwitchPairs]:
        """Yield pairs i < j in chunks; a pair may come again, with another number of contacts."""


@dataclass(frozen=True, eq=False)
class SwitchRule:
    """Which contacts a switch between two sets may hold, and whether it exists.

    Parameters
    ----------
    sources : tuple of TorqueFunctions
        The stacks of sets; set numbers run through them.
    hand : Hand
    decide : callable
        Whether pairs of projections have a common point, and which: `contact_rule.meet_held`, say.
    """

    sources: tuple[TorqueFunctions, ...]
    hand: Hand
    decide: Decide

    @cached_property
    def offsets(self) -> IntArray:
        """Number of the first set of each source."""
        return np.cumsum([0, *(len(f) for f in self.sources)])[:-1]

    @cached_property
    def contacts(self) -> IntArray:
        """Number of contacts of each set, shape (N,)."""
        return np.concatenate([np.full(len(f), f.m, dtype=np.intp) for f in self.sources])

    @cached_property
    def _levels(self) -> tuple[_Level, ...]:
        """The projections on 1, 2 and 3 contacts, grouped by edges; those that can matter.

        Where two grasps need to have nothing in common they are adjacent, unless the hand limits
        the distance between their fingers: then that is a question, too. So is which of two
        contacts on one edge is held, for they are then in order.
        """
        return tuple(
            _Level.of(shadows(self.sources, held, ordered=self.hand.coupled), self)
            for held in range(0 if self.hand.coupled else 1, 4)
            if any(
                held <= min(f.m, g.m) and held >= self.hand.needs[f.m, g.m]
                for f in self.sources
                for g in self.sources
            )
        )

    @property
    def n_pairs(self) -> int:
        """Number of pairs to decide: with common edges, over all numbers of held contacts."""
        return sum(level.n_pairs for level in self._levels)

    def chunks(self, tell: Tell | None = None) -> Iterator[SwitchPairs]:
        """Yield pairs that can hold contacts in common; a pair may come again."""
        done, total = 0, self.n_pairs
        for level in self._levels:
            for first, second in level.all_pairs():
                found = self._feasible(level, first, second)
                done += len(first)
                if tell is not None:
                    tell("switches", done, total)
                yield found

    def pairs(self, tell: Tell | None = None) -> SwitchPairs:
        """Return all pairs that can hold contacts in common, each once and sorted."""
        return SwitchPairs.join(self.chunks(tell)).largest()

    def of_set(self, index: int) -> SwitchPairs:
        """Return the pairs of one set with those it can hold contacts in common with."""
        levels = self._levels
        return SwitchPairs.join(self._feasible(v, *v.pairs_of(index)) for v in levels).largest()

    def questions(self) -> Iterator[tuple[Shadows, IntArray, IntArray, IntArray, IntArray]]:
        """Yield all that is decided, in chunks: projections of pairs of sets.

        Yields
        ------
        stack : Shadows
        first, second : numpy.ndarray of int, shape (P,)
            Pair n asks whether ``stack[first[n]]`` and ``stack[second[n]]`` meet.
        i, j : numpy.ndarray of int, shape (P,)
            Numbers of their sets, i < j.
        """
        for level in self._levels:
            for first, second in level.all_pairs():
                yield (level.shadows, *self._asked(level, first, second))

    def _asked(
        self, level: _Level, first: IntArray, second: IntArray
    ) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        """The pairs of projections that matter, that of the lower set first, and their sets."""
        i, j = level.owner[first], level.owner[second]
        useful = level.shadows.held >= self.hand.needs[self.contacts[i], self.contacts[j]]
        rows = np.flatnonzero(useful & (i != j))
        first, second, i, j = first[rows], second[rows], i[rows], j[rows]
        turned = i > j
        first, second = np.where(turned, second, first), np.where(turned, first, second)
        return first, second, np.minimum(i, j), np.maximum(i, j)

    def _feasible(self, level: _Level, first: IntArray, second: IntArray) -> SwitchPairs:
        """The feasible ones among pairs of projections."""
        stack, held = level.shadows, level.shadows.held
        first, second, i, j = self._asked(level, first, second)
        found = self.decide(stack, stack, first, second)
        yes = np.flatnonzero(found.exist)
        pad = ((0, 0), (0, 3 - held))
        return SwitchPairs(
            i[yes],
            j[yes],
            np.full(len(yes), held),
            np.pad(stack.slots[first[yes]].astype(np.int8), pad, constant_values=-1),
            np.pad(found.points[yes], pad, constant_values=np.nan),
        )


@dataclass(frozen=True, eq=False)
class _Level:
    """Projections on a number of contacts, sorted by the edges of these."""

    shadows: Shadows
    owner: IntArray  # number of the set
    starts: IntArray  # of the groups
    sizes: IntArray
    group: IntArray  # of each projection
    later: IntArray  # how many projections after it, in its group, each is paired with

    @classmethod
    def of(cls, stack: Shadows, rule: SwitchRule) -> _Level:
        # Within a group two-finger sets come first: pairs for which so few held contacts do not
        # suffice are then at its end, and are left out.
        owner = rule.offsets[stack.source] + stack.row
        contacts = rule.contacts[owner]
        order = np.lexsort((contacts, *stack.edges.T[::-1]))
        stack, owner, contacts = stack.take(order), owner[order], contacts[order]
        new = np.ones(len(stack), dtype=bool)
        new[1:] = (stack.edges[1:] != stack.edges[:-1]).any(axis=1)
        starts = np.flatnonzero(new)
        sizes = np.diff(np.append(starts, len(stack)))
        group = np.cumsum(new) - 1
        rank = np.arange(len(stack)) - starts[group]
        pairs = np.add.reduceat(contacts == 2, starts) if len(starts) else starts
        suffices = rule.hand.needs <= stack.held
        last = np.where(
            suffices[contacts, 3], sizes[group], np.where(suffices[contacts, 2], pairs[group], 0)
        )
        return cls(stack, owner, starts, sizes, group, np.maximum(last - rank - 1, 0))

    @property
    def n_pairs(self) -> int:
        return int(self.later.sum())

    def all_pairs(self) -> Sequence[tuple[IntArray, IntArray]]:
        """All pairs within the groups, in chunks."""
        chunk = np.cumsum(self.later) // _CHUNK
        bounds = np.append(np.flatnonzero(np.diff(chunk, prepend=-1)), len(chunk))
        chunks = []
        for low, high in pairwise(bounds.tolist()):
            counts = self.later[low:high]
            first = np.arange(low, high).repeat(counts)
            chunks.append((first, runs(np.arange(low, high) + 1, counts)))
        return chunks

    def pairs_of(self, index: int) -> tuple[IntArray, IntArray]:
        """All pairs of a projection of one set with another one in its group."""
        mine = np.flatnonzero(self.owner == index)
        groups = self.group[mine]
        second = [np.arange(self.starts[g], self.starts[g] + self.sizes[g]) for g in groups]
        first = mine.repeat(self.sizes[groups])
        return first, np.concatenate(second) if second else np.zeros(0, dtype=np.intp)


@dataclass(frozen=True, eq=False)
class StoredSwitches:
    """All switches with held contacts, in compressed rows.

    Parameters
    ----------
    starts : numpy.ndarray of int, shape (N + 1,)
    others, held : numpy.ndarray of int, shape (2 E,)
        Neighbours of set i: ``others[starts[i]:starts[i + 1]]``, ascending, with the largest
        number of contacts that can be held.
    slots : numpy.ndarray of int, shape (E, h)
        For each pair i < j, in the order of the rows, which contacts of set i are held; h is the
        largest number of all, -1 stands for none.
    points : numpy.ndarray, shape (E, h)
        Where: fractions of their edges, NaN for none.
    """

    starts: IntArray
    others: IntArray
    held: IntArray
    slots: IntArray
    points: FloatArray

    @classmethod
    def of_pairs(cls, n: int, pairs: SwitchPairs) -> StoredSwitches:
        """Store sorted pairs i < j of n sets, each seen from both sides."""
        one = np.concatenate((pairs.first, pairs.second))
        other = np.concatenate((pairs.second, pairs.first))
        order = np.argsort(one.astype(np.int64) * n + other, kind="stable")
        starts = np.searchsorted(one[order], np.arange(n + 1))
        both = np.concatenate((pairs.held, pairs.held))[order]
        width = int(pairs.held.max(initial=1))
        return cls(
            starts,
            other[order].astype(np.int32),
            both.astype(np.int8),
            pairs.slots[:, :width],
            pairs.points[:, :width],
        )

    @cached_property
    def _rows(self) -> IntArray:
        """The set whose neighbour each entry of `others` is."""
        return np.arange(len(self.starts) - 1).repeat(np.diff(self.starts))

    @cached_property
    def _before(self) -> IntArray:
        """How many pairs i < j there are before each entry of `others`."""
        return np.concatenate(([0], np.cumsum(self._rows < self.others)))

    def neighbors(self, index: int) -> tuple[IntArray, IntArray]:
        """Return the sets that share at least one held contact with a set, and how many."""
        row = slice(self.starts[index], self.starts[index + 1])
        return self.others[row], self.held[row]

    def witness(self, i: int, j: int) -> tuple[IntArray, FloatArray] | None:
        """Return which contacts of set i < j a switch holds and where, or None if it holds none."""
        row = self.others[self.starts[i] : self.starts[i + 1]]
        place = int(np.searchsorted(row, j))
        if place == len(row) or row[place] != j:
            return None
        entry = self.starts[i] + place
        held, number = self.held[entry], self._before[entry]
        return self.slots[number, :held], self.points[number, :held]

    def pairs(self) -> Iterator[SwitchPairs]:
        """Yield all pairs i < j, in chunks."""
        once = np.flatnonzero(self._rows < self.others)
        pad = ((0, 0), (0, 3 - self.slots.shape[1]))
        yield SwitchPairs(
            self._rows[once],
            self.others[once],
            self.held[once],
            np.pad(self.slots, pad, constant_values=-1),
            np.pad(self.points, pad, constant_values=np.nan),
        )


@dataclass(frozen=True, eq=False)
class SwitchesOnDemand:
    """Switches of a graph too large to store, found set by set.

    Parameters
    ----------
    rule : SwitchRule
    """

    rule: SwitchRule

    def neighbors(self, index: int) -> tuple[IntArray, IntArray]:
        """Return the sets that share at least one held contact with a set, and how many."""
        found = self.rule.of_set(index)
        others = np.where(found.first == index, found.second, found.first)
        order = np.argsort(others)
        return others[order], found.held[order]

    def witness(self, i: int, j: int) -> tuple[IntArray, FloatArray] | None:
        """Return which contacts of set i < j a switch holds and where, or None if it holds none."""
        found = self.rule.of_set(i)
        row = np.flatnonzero((found.first == i) & (found.second == j))
        if not row.size:
            return None
        held = int(found.held[row[0]])
        return found.slots[row[0], :held], found.points[row[0], :held]

    def pairs(self) -> Iterator[SwitchPairs]:
        """Yield pairs i < j in chunks; a pair may come again, with another number of contacts."""
        return self.rule.chunks()
