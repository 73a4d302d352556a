"""Random force-closure grasps and switches, and which of them a graph knows.

The work behind `regrasp_lp.completeness.coverage`, which see.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.force_closure import is_force_closure
from regrasp_lp.friction import BoolArray, FloatArray
from regrasp_lp.grasp_sets.candidates import runs
from regrasp_lp.membership import KnownSets
from regrasp_lp.planning.hand import Hand
from regrasp_lp.random_grasps import RandomGrasps
from regrasp_lp.wrenches import IntArray

_EXAMPLES = 10
_BATCH = 512, 32_768
_CLASSES = (  # name, contacts, whether two are on one edge, part of what is left
    ("2 contacts", 2, False, 4),
    ("3, two on one edge", 3, True, 3),
    ("3 on different edges", 3, False, 1),
)


@dataclass(frozen=True)
class Samples:
    """Force-closure grasps: edges and fractions, shape (K, m), and whether each was found."""

    edges: IntArray
    fractions: FloatArray
    found: BoolArray

    @classmethod
    def joined(cls, contacts: int, parts: list[tuple[IntArray, FloatArray, BoolArray]]) -> Samples:
        """Join parts, of which there may be none."""
        none = np.zeros((0, contacts))
        parts = [(none.astype(np.intp), none, np.zeros(0, dtype=bool)), *parts]
        return cls(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def grasp(self, row: int) -> Grasp:
        """Return one of them."""
        return grasp_of(self.edges[row], self.fractions[row])


@dataclass
class Measurement:
    """Draws, tests and looks up, and keeps what came of it.

    Parameters
    ----------
    known : KnownSets
    random : RandomGrasps
    rng : numpy.random.Generator
    most : int
        Draws after which a class of grasps or switches has to do with what was found.

    Attributes
    ----------
    draws, false_members : int
        Contacts drawn, and members of a set among them that are not in force closure.
    wrong : list of Grasp
        The first few of these.
    grasps : dict of str to Samples
        Found: strictly inside a set over exactly these edges.
    switches : dict of str to (int, int)
        Found, and of how many.
    missed_switches : list of (Grasp, Grasp)
        The first few that are not found.
    """

    known: KnownSets
    random: RandomGrasps
    rng: np.random.Generator
    most: int
    draws: int = 0
    false_members: int = 0
    wrong: list[Grasp] = field(default_factory=list)
    grasps: dict[str, Samples] = field(default_factory=dict)
    switches: dict[str, tuple[int, int]] = field(default_factory=dict)
    missed_switches: list[tuple[Grasp, Grasp]] = field(default_factory=list)

    def _batches(self, quota: int) -> Iterator[int]:
        """Sizes of batches of draws, until there are as many as allowed."""
        size, drawn = int(np.clip(4 * quota, *_BATCH)), 0
        while quota and drawn < self.most:
            yield min(size, self.most - drawn)
            drawn += size

    def _holds(self, edges: IntArray, fractions: FloatArray) -> BoolArray:
        polygon, mu = self.random.polygon, self.random.friction
        return is_force_closure(polygon, friction=mu, edges=edges, fractions=fractions)

    def _members(self, edges: IntArray, fractions: FloatArray) -> BoolArray:
        """Whether contacts are in a set over exactly their edges."""
        member = np.zeros(len(edges), dtype=bool)
        member[self.known.over(edges).holding(edges, fractions)[0]] = True
        return member

    # --- grasps ---------------------------------------------------------------------------------

    def sample_grasps(self, samples: int) -> None:
        """Draw grasps of every class, and look up all that is drawn.

        Parameters
        ----------
        samples : int
            How many force-closure grasps there shall be; what one class lacks is left to the next.
        """
        left = samples
        for label, contacts, twice, part in _CLASSES:
            self.grasps[label] = self._draw_grasps(left // part, contacts, twice)
            left -= len(self.grasps[label].edges)

    def _draw_grasps(self, quota: int, contacts: int, twice: bool) -> Samples:
        parts, wanting = [], quota
        for count in self._batches(quota):
            edges, fractions = self.random.draw(self.rng, count, contacts, twice=twice)
            holds, member = self._holds(edges, fractions), self._members(edges, fractions)
            self.draws += len(edges)
            wrong = np.flatnonzero(member & ~holds)
            self.false_members += len(wrong)
            room = max(0, _EXAMPLES - len(self.wrong))
            self.wrong += [grasp_of(edges[i], fractions[i]) for i in wrong[:room]]
            first = np.flatnonzero(holds)[:wanting]
            parts.append((edges[first], fractions[first], member[first]))
            wanting -= len(first)
            if not wanting:
                break
        return Samples.joined(contacts, parts)

    def found_of(self, label: str) -> tuple[int, int]:
        """Return how many grasps of a class were found, and of how many."""
        found = self.grasps[label].found
        return int(np.count_nonzero(found)), len(found)

    def located_of(self, label: str) -> tuple[int, int]:
        """Return how many grasps of a class are in a set with all or two of their contacts."""
        samples = self.grasps[label]
        inside = samples.found.copy()
        rest = np.flatnonzero(~inside)
        for pair in combinations(range(samples.edges.shape[1]), 2) if rest.size else ():
            columns = np.ix_(rest, np.array(pair))
            inside[rest] |= self._members(samples.edges[columns], samples.fractions[columns])
        return int(np.count_nonzero(inside)), len(inside)

    @property
    def n_combinations(self) -> int:
        """On how many different combinations of edges there are grasps."""
        ascending = [np.sort(samples.edges, axis=1) for samples in self.grasps.values()]
        return sum(len(np.unique(edges, axis=0)) for edges in ascending)

    @property
    def missed(self) -> list[Grasp]:
        """The first few grasps that were not found, of all classes."""
        return [
            samples.grasp(row)
            for samples in self.grasps.values()
            for row in np.flatnonzero(~samples.found)[:_EXAMPLES].tolist()
        ]

    # --- switches -------------------------------------------------------------------------------

    def sample_switches(self, samples: int, hand: Hand) -> None:
        """Draw switches of every kind that a hand can do while it holds contacts.

        Parameters
        ----------
        samples : int
            How many there shall be; what one kind lacks is left to the next.
        hand : Hand
        """
        cases = [
            (m, n, held)
            for m, n in ((2, 2), (2, 3), (3, 3))
            for held in range(max(1, hand.held(m, n)), m + 1)
            if held < n
        ]
        left = samples
        for number, (m, n, held) in enumerate(cases):
            quota = left // (len(cases) - number)
            first, second = self._draw_switches(quota, m, n, held)
            found = self._look_up(first, second, held)
            for row in np.flatnonzero(~found)[:_EXAMPLES].tolist():
                self.missed_switches.append((first.grasp(row), second.grasp(row)))
            left -= len(found)
            counts = int(np.count_nonzero(found)), len(found)
            self.switches[f"{m} to {n} contacts, {held} held"] = counts

    def _draw_switches(self, quota: int, m: int, n: int, held: int) -> tuple[Samples, Samples]:
        """Draw pairs of grasps whose first `held` contacts are the same."""
        pool = Samples.joined(
            m,
            [
                (samples.edges, samples.fractions, samples.found)
                for samples in self.grasps.values()
                if samples.edges.shape[1] == m
            ],
        )
        parts, others, wanting = [], [], quota
        for count in self._batches(quota) if len(pool.edges) else ():
            chosen = self.rng.integers(0, len(pool.edges), count)
            order = self.rng.random((count, m)).argsort(axis=1)
            edges = np.take_along_axis(pool.edges[chosen], order, axis=1)
            fractions = np.take_along_axis(pool.fractions[chosen], order, axis=1)
            new_edges, new_fractions, kept = self.random.extend(
                self.rng, edges[:, :held], fractions[:, :held], n
            )
            edges, fractions, found = edges[kept], fractions[kept], pool.found[chosen[kept]]
            good = self._holds(new_edges, new_fractions)
            if m == n:
                good &= (np.sort(edges, axis=1) != np.sort(new_edges, axis=1)).any(axis=1)
            first = np.flatnonzero(good)[:wanting]
            parts.append((edges[first], fractions[first], found[first]))
            new_edges, new_fractions = new_edges[first], new_fractions[first]
            others.append((new_edges, new_fractions, self._members(new_edges, new_fractions)))
            wanting -= len(first)
            if not wanting:
                break
        return Samples.joined(m, parts), Samples.joined(n, others)

    def _look_up(self, first: Samples, second: Samples, held: int) -> BoolArray:
        """Whether pairs of grasps are in sets that are adjacent, holding the first contacts."""
        found = np.zeros(len(first.edges), dtype=bool)
        if not len(found):
            return found
        table = self.known.over(first.edges, second.edges)
        row, one = table.holding(first.edges, first.fractions)
        other_row, other = table.holding(second.edges, second.fractions)
        # Chapter sets overlap: all sets of one grasp with all sets of the other.
        low, high = (np.searchsorted(other_row, row, side) for side in ("left", "right"))
        row, one = row.repeat(high - low), one.repeat(high - low)
        other = other[runs(low, high - low)]
        found[row[self.known.adjacent(table, one, other, first.edges[row, :held])]] = True
        return found


def grasp_of(edges: IntArray, fractions: FloatArray) -> Grasp:
    """Return one grasp, shape (m,) each."""
    return Grasp.at_fractions(zip(edges.tolist(), fractions.tolist(), strict=True))
