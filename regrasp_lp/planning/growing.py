"""Switches between complete sets that are made when a search asks for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from regrasp_lp.friction import Cones, IntArray, spanning
from regrasp_lp.grasp_sets.candidates import two_finger_candidates
from regrasp_lp.planning.levels import Cut, PieceRows
from regrasp_lp.planning.moves import Contacts, Goal, common_contacts
from regrasp_lp.torque import torque_functions

_CHUNK = 100_000


@dataclass(eq=False)
class GrowingMoves:
    """Switches between complete sets of a hand of four fingers, made when they are asked for.

    Whatever contains a force-closure grasp is in force closure, with no smaller margin: so between
    the given grasps three-finger sets are enough, and switches that hold two contacts. The same is
    true of tolerances where all contacts keep away from the ends of their edges; given ones need
    not, so that from these there are switches to two-finger sets, too.

    Parameters
    ----------
    rows : PieceRows
        At first of the sets that hold the given grasps; only of these also switches that hold
        fewer contacts are made.
    cones : Cones
    """

    rows: PieceRows
    cones: Cones
    _numbers: dict[int, int] = field(default_factory=dict)
    _known: dict[int, list[Contacts]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._given = len(self.rows)
        for index, edges in enumerate(self.rows.edges):
            self._numbers[int(self._keys(edges[None, :])[0])] = index

    def of(self, index: int) -> list[Contacts]:
        """Return the choices of held contacts from one set, by their number, most first."""
        if index not in self._known:
            two = self.rows.contacts[index] == 2
            found = self._from_two(index) if two else self._from_three(index)
            self._known[index] = [c for c in found or [self._thirds(index)] if len(c.others)]
        return self._known[index]

    def _thirds(self, index: int) -> Contacts:
        """Switches to three-finger sets that hold two contacts."""
        edges = self.rows.edges[index]
        edges = edges[edges >= 0]
        every = np.arange(self.cones.n_edges)
        pairs = {(int(a), int(b)) for a, b in combinations(edges, 2)}
        triples = [
            np.column_stack((np.tile(pair, (len(every), 1)), every)) for pair in sorted(pairs)
        ]
        others = self._sets(np.concatenate(triples))
        return common_contacts(self.rows.edges, self.rows.edges[index], others, 2)

    def _from_two(self, index: int) -> list[Contacts]:
        """Switches from two contacts that hold the object alone, given or not."""
        if index >= self._given:
            return []
        n = self.cones.n_edges
        edges = self.rows.edges[index, :2]
        one, other = np.triu_indices(n)
        triples = [np.column_stack((np.full(len(one), edge), one, other)) for edge in edges]
        pairs = self._sets(two_finger_candidates(self.cones))
        others = np.concatenate((self._sets(np.concatenate(triples)), pairs))
        single = common_contacts(self.rows.edges, self.rows.edges[index], others, 1)
        return [self._thirds(index), single, Contacts.free(pairs)]

    def _from_three(self, index: int) -> list[Contacts]:
        """Switches from three given contacts of which some may be near the ends of their edges."""
        if index >= self._given or self.rows.measure == "margin":
            return []
        pairs = self._sets(two_finger_candidates(self.cones))
        return [
            self._thirds(index),
            common_contacts(self.rows.edges, self.rows.edges[index], pairs, 1),
        ]

    def _sets(self, combinations: IntArray) -> IntArray:
        """The numbers of those of some combinations that exist; new ones are added."""
        rows = np.sort(combinations, axis=1)
        keys, first_of = np.unique(self._keys(rows), return_index=True)
        rows = rows[first_of]
        new = np.array([key not in self._numbers for key in keys.tolist()], dtype=bool)
        for first in range(0, int(new.sum()), _CHUNK):
            part = rows[new][first : first + _CHUNK]
            functions = torque_functions(self.cones, part[spanning(self.cones, part)])
            functions = functions.take(np.flatnonzero(functions.exists()))
            self._numbers.update(dict.fromkeys(keys[new][first : first + _CHUNK].tolist(), -1))
            added = self.rows.append(functions)
            self._numbers.update(
                zip(self._keys(functions.edges).tolist(), added.tolist(), strict=True)
            )
        numbers = np.array([self._numbers[key] for key in keys.tolist()], dtype=np.intp)
        return numbers[numbers >= 0]

    def _keys(self, edges: IntArray) -> IntArray:
        """A number for each combination of two or three edges (-1 beyond), all different."""
        padded = np.full((len(edges), 3), -1, dtype=np.int64)
        padded[:, : edges.shape[1]] = edges
        n = self.cones.n_edges + 1
        return np.asarray(((padded[:, 0] + 1) * n + padded[:, 1] + 1) * n + padded[:, 2] + 1)

    def to_go(self, cut: Cut, goals: Sequence[Goal]) -> Callable[[IntArray], IntArray]:
        """Return a lower bound of the placements from sets to a goal: nothing is known but 0."""
        return np.zeros_like
