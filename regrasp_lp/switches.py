"""Switching edges between all pairs of grasp sets, stored or found on demand.

Two sets over n_S and n_T contacts are adjacent iff a hand of k fingers can hold
``max(0, n_S + n_T - k)`` contacts in common (the contact rule). Holding more saves placements, so
every size up to ``min(n_S, n_T)`` is tried; the largest feasible one is kept for each pair.
Where nothing needs to be held all pairs are adjacent: these edges are never stored.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from regrasp_lp.friction import BoolArray, IntArray
from regrasp_lp.grasp_sets.candidates import runs
from regrasp_lp.planning.hand import Hand
from regrasp_lp.shadows import Shadows, shadows
from regrasp_lp.torque import TorqueFunctions

STORE_LIMIT = 8_000_000
"""Up to so many pairs of sets with common edges the switches are stored, above found on demand."""

_CHUNK = 200_000

Decide = Callable[[Shadows, Shadows], BoolArray]
Tell = Callable[[str, int, int], None]


class Switches(Protocol):
    """Pairs of N grasp sets that can hold contacts in common."""

    def neighbors(self, index: int) -> tuple[IntArray, IntArray]:
        """Return the sets that share at least one held contact with a set, and how many."""

    def pairs(self) -> Iterator[tuple[IntArray, IntArray, IntArray]]:
        """Yield pairs i < j and a number of contacts they can hold, in chunks."""


@dataclass(frozen=True, eq=False)
class SwitchRule:
    """Which contacts a switch between two sets may hold, and whether it exists.

    Parameters
    ----------
    sources : tuple of TorqueFunctions
        The stacks of sets; set numbers run through them.
    hand : Hand
    decide : callable
        Whether aligned projections have a common point; `handovers.decide_held`, say.
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
        """The projections on 1, 2 and 3 contacts, grouped by edges; those that can matter."""
        return tuple(
            _Level.of(shadows(self.sources, held), self)
            for held in (1, 2, 3)
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

    def chunks(self, tell: Tell | None = None) -> Iterator[tuple[IntArray, IntArray, IntArray]]:
        """Yield pairs i < j and a number of contacts they can hold; a pair may come again."""
        done, total = 0, self.n_pairs
        for level in self._levels:
            for first, second in level.all_pairs():
                rows = self._feasible(level, first, second)
                done += len(first)
                if tell is not None:
                    tell("switches", done, total)
                yield rows[:, 0], rows[:, 1], rows[:, 2]

    def pairs(self, tell: Tell | None = None) -> tuple[IntArray, IntArray, IntArray]:
        """Return all pairs that can hold contacts in common: i < j and the largest number."""
        chunks = [np.stack(chunk, axis=1) for chunk in self.chunks(tell)]
        return self._largest(np.concatenate([np.zeros((0, 3), dtype=np.intp), *chunks]))

    def of_set(self, index: int) -> tuple[IntArray, IntArray]:
        """Return the sets that can hold contacts in common with one, and how many."""
        found = [
            self._feasible(level, *level.pairs_of(index), ordered=False) for level in self._levels
        ]
        none = np.zeros((0, 3), dtype=np.intp)
        _, others, held = self._largest(np.concatenate([none, *found]))
        return others, held

    def _feasible(
        self, level: _Level, first: IntArray, second: IntArray, ordered: bool = True
    ) -> IntArray:
        """Rows (i, j, held) of the feasible ones among pairs of projections."""
        i, j = level.owner[first], level.owner[second]
        held = level.shadows.held
        useful = (i != j) & (held >= self.hand.needs[self.contacts[i], self.contacts[j]])
        first, second, i, j = first[useful], second[useful], i[useful], j[useful]
        yes = self.decide(level.shadows.take(first), level.shadows.take(second))
        i, j = i[yes], j[yes]
        if ordered:
            i, j = np.minimum(i, j), np.maximum(i, j)
        return np.stack((i, j, np.full(len(i), held)), axis=1)

    @staticmethod
    def _largest(rows: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        rows = rows[np.lexsort((-rows[:, 2], rows[:, 1], rows[:, 0]))]
        new = np.ones(len(rows), dtype=bool)
        new[1:] = (rows[1:, :2] != rows[:-1, :2]).any(axis=1)
        rows = rows[new]
        return rows[:, 0], rows[:, 1], rows[:, 2]


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
    others, held : numpy.ndarray of int
        Neighbours of set i: ``others[starts[i]:starts[i + 1]]``, ascending, with the largest
        number of contacts that can be held.
    """

    starts: IntArray
    others: IntArray
    held: IntArray

    @classmethod
    def of_pairs(cls, n: int, first: IntArray, second: IntArray, held: IntArray) -> StoredSwitches:
        """Store pairs i < j, each seen from both sides."""
        one = np.concatenate((first, second))
        other = np.concatenate((second, first))
        order = np.lexsort((other, one))
        starts = np.searchsorted(one[order], np.arange(n + 1))
        both = np.concatenate((held, held))[order]
        return cls(starts, other[order].astype(np.int32), both.astype(np.int8))

    def neighbors(self, index: int) -> tuple[IntArray, IntArray]:
        """Return the sets that share at least one held contact with a set, and how many."""
        row = slice(self.starts[index], self.starts[index + 1])
        return self.others[row], self.held[row]

    def pairs(self) -> Iterator[tuple[IntArray, IntArray, IntArray]]:
        """Yield all pairs i < j and how many contacts they can hold, in chunks."""
        one = np.arange(len(self.starts) - 1).repeat(np.diff(self.starts))
        once = one < self.others
        yield one[once], self.others[once], self.held[once]


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
        return self.rule.of_set(index)

    def pairs(self) -> Iterator[tuple[IntArray, IntArray, IntArray]]:
        """Yield pairs i < j and a number of contacts they can hold, in chunks."""
        return self.rule.chunks()
