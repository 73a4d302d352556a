"""Switches at a level: from a part of one cut set to the cut pieces of its neighbours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations, product
from typing import Protocol

import numpy as np

from regrasp_lp.friction import BoolArray, IntArray
from regrasp_lp.lp import maximise_margins
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.levels import Cut, PieceRows
from regrasp_lp.switches import StoredSwitches, Switches

_ROUND = 24

FAR = 1 << 30
"""Placements to go from where there is no way."""

Slots = tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class Contacts:
    """Ways in which switches from one set may hold contacts.

    Parameters
    ----------
    others : numpy.ndarray of int, shape (K,)
        The set switched to; one entry for each choice of held contacts.
    here, there : numpy.ndarray of int, shape (K, h)
        Places of the held contacts in the two sets.
    """

    others: IntArray
    here: IntArray
    there: IntArray

    @property
    def held(self) -> int:
        """Number of held contacts."""
        return int(self.here.shape[1])

    @classmethod
    def free(cls, others: IntArray) -> Contacts:
        """Return switches that hold nothing."""
        none = np.zeros((len(others), 0), dtype=np.intp)
        return cls(others, none, none)

    def take(self, rows: IntArray | BoolArray) -> Contacts:
        """Return some of the choices."""
        return Contacts(self.others[rows], self.here[rows], self.there[rows])


class Moves(Protocol):
    """The switches of an object, as a search sees them."""

    def of(self, index: int) -> list[Contacts]:
        """Return the choices of held contacts from one set, by their number, most first."""

    def to_go(self, cut: Cut, goals: Sequence[Goal]) -> Callable[[IntArray], IntArray]:
        """Return a lower bound of the placements from sets to a goal; `FAR` if there is no way."""


class Goal(Protocol):
    """A set in which a search may end."""

    @property
    def index(self) -> int:
        """Its number."""


@dataclass(frozen=True, eq=False)
class KnownMoves:
    """Switches of a graph.

    A set is its own neighbour: holding all contacts but one is a way to reposition one.

    Parameters
    ----------
    rows : PieceRows
    switches : Switches
    hand : Hand
    """

    rows: PieceRows
    switches: Switches
    hand: Hand
    _known: dict[int, list[Contacts]] = field(default_factory=dict)

    def of(self, index: int) -> list[Contacts]:
        """Return the choices of held contacts from one set, by their number, most first."""
        if index not in self._known:
            self._known[index] = [c for c in self._choices(index) if len(c.others)]
        return self._known[index]

    def _choices(self, index: int) -> list[Contacts]:
        contacts, edges = self.rows.contacts, self.rows.edges
        mine = int(contacts[index])
        others, most = self.switches.neighbors(index)
        others, most = np.append(others, index), np.append(most, mine - 1)
        found = []
        for held in range(mine, 0, -1):
            possible = (most >= held) & (self.hand.needs[mine, contacts[others]] <= held)
            chosen = others[possible].astype(np.intp)
            found.append(common_contacts(edges, edges[index], chosen, held))
        free = np.flatnonzero(self.hand.needs[mine, contacts] == 0)
        return [*found, Contacts.free(free)]

    def to_go(self, cut: Cut, goals: Sequence[Goal]) -> Callable[[IntArray], IntArray]:
        """Return a lower bound of the placements from sets to a goal; `FAR` if there is no way.

        The fewest placements in the graph of the sets that are not empty at the level.
        """
        alive = cut.any_alive(np.arange(len(self.rows)))
        go = np.full(len(alive), FAR)
        for goal in goals:
            go[goal.index] = 0
        if isinstance(self.switches, StoredSwitches):
            go = self._placements(alive, go)
        else:
            go = np.where(alive, 0, go)
        return lambda rows: go[rows]

    def _placements(self, alive: BoolArray, go: IntArray) -> IntArray:
        switches, contacts = self.switches, self.rows.contacts
        assert isinstance(switches, StoredSwitches)
        rows = np.arange(len(go)).repeat(np.diff(switches.starts))
        cost = contacts[switches.others] - switches.held
        while True:
            before = go.copy()
            np.minimum.at(go, rows, before[switches.others] + cost)
            for m, other in product((2, 3), (2, 3)):
                there = contacts == other
                if self.hand.needs[m, other] == 0 and there.any():
                    here = contacts == m
                    go[here] = np.minimum(go[here], before[there].min() + other)
            go = np.minimum(np.where(alive, go, before), FAR)
            if (go == before).all():
                return go


def common_contacts(edges: IntArray, mine: IntArray, others: IntArray, held: int) -> Contacts:
    """Return all choices of so many contacts on equal edges of a set and others.

    Parameters
    ----------
    edges : numpy.ndarray of int, shape (N, 3)
        Edges of the contacts of all sets, -1 beyond.
    mine : numpy.ndarray of int, shape (m,)
        The edges of the set, -1 beyond.
    others : numpy.ndarray of int, shape (K,)
        The set itself may be one: of two contacts on one edge either can be held in place of both.
    held : int
        At least 1.
    """
    mine = mine[mine >= 0]
    equal = edges[others][:, None, :] == mine[:, None]
    rows, here_, there_ = [], [], []
    for here in combinations(range(len(mine)), held):
        for there in combinations(range(3), held):
            same = np.flatnonzero(equal[:, here, there].all(axis=1))
            if same.size:
                rows.append(others[same])
                here_.append(np.broadcast_to(here, (len(same), held)))
                there_.append(np.broadcast_to(there, (len(same), held)))
    if not rows:
        return Contacts(others[:0].astype(np.intp), *np.zeros((2, 0, held), dtype=np.intp))
    return Contacts(
        np.concatenate(rows).astype(np.intp),
        np.concatenate(here_).astype(np.intp),
        np.concatenate(there_).astype(np.intp),
    )


@dataclass(frozen=True, eq=False)
class Reached:
    """Pieces of neighbours that are reached from a part of a set.

    Parameters
    ----------
    contacts : Contacts
        The choices that were looked at.
    pieces : numpy.ndarray of bool, shape (K, J, J)
        Pieces reached for certain.
    origin : numpy.ndarray of int, shape (K,)
        A piece of the part from which one of them is, as its place in the part; -1 for none.
    """

    contacts: Contacts
    pieces: BoolArray
    origin: IntArray


def reach(cut: Cut, index: int, label: int, contacts: Contacts) -> Reached:
    """Return pieces of neighbours that certainly have a common point with a part of a set.

    Tried are the best grasps of the pieces of the part; what they do not reach may be reached
    from others (`joined`).

    Parameters
    ----------
    cut : Cut
    index, label : int
        The set and its part.
    contacts : Contacts
        From this set.
    """
    part = cut.part(index)
    mine = np.flatnonzero(part.labels == label)
    count = len(contacts.others)
    if contacts.held == 0:
        return Reached(contacts, cut.alive(contacts.others), np.full(count, mine[0]))
    pieces = np.zeros((count, *[cut.rows.offsets.shape[1]] * 2), dtype=bool)
    origin = np.full(count, -1)
    left = np.flatnonzero(cut.any_alive(contacts.others) & cut.rows.plain(contacts.others))
    for piece in mine.tolist():
        if not left.size:
            break
        values = part.points[piece][contacts.here[left]]
        there = contacts.there[left]
        levels = cut.rows.completed(contacts.others[left], there, values, cut.least)
        found = levels >= cut.least
        yes = found.any(axis=(1, 2))
        pieces[left[yes]], origin[left[yes]] = found[yes], piece
        left = left[~yes]
    return Reached(contacts, pieces, origin)


def joined(
    cut: Cut, index: int, label: int, other: int, target: int, choices: list[Slots]
) -> tuple[int, int, Slots] | None:
    """Decide by margin LPs whether a part of a set can be switched to a part of another.

    Parameters
    ----------
    cut : Cut
    index, label : int
        The set and its part.
    other, target : int
        The other set and its part.
    choices : list of tuple of (int, int)
        Held contacts, as places in the two sets.

    Returns
    -------
    (int, int, slots) or None
        The pieces of the two parts, as places in them, and the held contacts.
    """
    one, two = cut.part(index), cut.part(other)
    first = np.flatnonzero(one.labels == label)
    second = np.flatnonzero(two.labels == target)
    p, q = (a.ravel() for a in np.meshgrid(first, second, indexing="ij"))
    names = [f"f{i}" for i in range(3)]
    for slots in choices:
        theirs = [f"g{i}" for i in range(3)]
        for here, there in slots:
            theirs[there] = names[here]
        on = [theirs[there] for _, there in slots]
        for start in range(0, len(p), _ROUND):
            now = slice(start, start + _ROUND)
            left = cut.rows.cell(index, one.pieces[p[now]], names)
            right = cut.rows.cell(other, two.pieces[q[now]], theirs)
            found = maximise_margins(left.join(right, on=on), cut.solver).margins
            best = int(found.argmax())
            if found[best] >= cut.least:
                return int(p[now][best]), int(q[now][best]), slots
    return None
