"""Routes at a level: the fewest placements over grasps whose margin is not below it.

The search runs over parts of cut sets (`levels`): inside a part fingers slide, between parts they
switch (`moves`). So a route exists iff one exists in this graph, and its contacts are one path LP.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from regrasp_lp.friction import BoolArray, IntArray
from regrasp_lp.grasp_sets.set_pieces import without_void_rows
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver, maximise_margins
from regrasp_lp.planning.ends import Support
from regrasp_lp.planning.levels import Cut, Part
from regrasp_lp.planning.moves import FAR, Contacts, Moves, Reached, Slots, joined, reach
from regrasp_lp.planning.path_lp import Stage
from regrasp_lp.torque import TorqueFunctions

Node = tuple[int, int]
"""A set and its part."""


@dataclass(frozen=True, eq=False)
class Leg:
    """One set of a route.

    Parameters
    ----------
    index : int
        The set.
    pieces : tuple of (int, int)
        Functions j and k of the pieces to slide through.
    entry, exit : LinearSets, optional
        What the first slide from a given grasp, or the last one to one, needs besides.
    """

    index: int
    pieces: tuple[tuple[int, int], ...]
    entry: LinearSets | None = None
    exit: LinearSets | None = None

    def stage(self, functions: TorqueFunctions) -> Stage:
        """Return it as a stage of the path LP, given the functions of the set."""
        pieces = np.array([(0, j, k) for j, k in self.pieces], dtype=np.intp).reshape(-1, 3)
        return Stage(functions, pieces, self.entry, self.exit)


@dataclass(frozen=True, eq=False)
class Route:
    """A chain of convex sets from a given grasp to another one.

    Parameters
    ----------
    legs : tuple of Leg
    held : tuple of tuple of (int, int)
        Per switch the held contacts.
    start, goal : Support
    placements : int
    """

    legs: tuple[Leg, ...]
    held: tuple[Slots, ...]
    start: Support
    goal: Support
    placements: int


@dataclass(frozen=True, eq=False)
class _Gate:
    """A way from a given grasp to pieces at the level; for a goal the same way back."""

    support: Support
    index: int
    pieces: IntArray  # (P, 2): to each of these
    cost: int
    slots: Slots | None = None  # of a switch
    visible: LinearSets | None = None  # of a slide

    def places(self, part: Part) -> list[int]:
        """Its pieces as places in the set's part, one for each label."""
        places = [place for place in map(part.number, map(tuple, self.pieces)) if place >= 0]
        return list({int(part.labels[place]): place for place in places[::-1]}.values())


@dataclass(frozen=True, eq=False)
class _Step:
    """How a part was reached: from which other one, out of which piece, into which."""

    before: Node | None
    gate: _Gate | None
    out: int
    into: int
    slots: Slots


@dataclass(frozen=True, eq=False)
class _End:
    """The end of a route, through a gate of the goal."""

    node: Node
    gate: _Gate
    out: int  # the piece, as its place in the part


class _Queue:
    """What to look at next: the least placements first, then what is certain, then the farthest."""

    def __init__(self, to_go: Callable[[IntArray], IntArray]) -> None:
        self.items: list[tuple[int, bool, int, int, _Gate | _Arrival | _End]] = []
        self._to_go = to_go
        self._number = 0

    def push(self, g: int, index: int, item: _Gate | _Arrival) -> None:
        """Put a way to a set that takes g placements, if any leads on to the goal."""
        left = int(self._to_go(np.array([index]))[0])
        if left < FAR:
            later = isinstance(item, _Arrival) and item.later
            self._put(g + left, later, -g, item)

    def end(self, g: int, item: _End) -> None:
        """Put a route of g placements."""
        self._put(g, False, -g, item)

    def _put(self, f: int, later: bool, order: int, item: _Gate | _Arrival | _End) -> None:
        self._number += 1
        heapq.heappush(self.items, (f, later, order, self._number, item))

    def pop(self) -> tuple[int, _Gate | _Arrival | _End]:
        """Return the next item and its placements so far."""
        _, _, negative, _, item = heapq.heappop(self.items)
        return -negative, item


@dataclass(eq=False)
class Search:
    """One search at one level.

    Parameters
    ----------
    cut : Cut
    moves : Moves
    starts, goals : sequence of Support
    patience : int
        Give up after so many parts.
    back : Moves, optional
        The switches from the goals backwards, if they are others than `moves`.
    """

    cut: Cut
    moves: Moves
    starts: Sequence[Support]
    goals: Sequence[Support]
    patience: int = 1200
    back: Moves | None = None
    reached: dict[Node, _Step] = field(default_factory=dict)
    exhausted: bool = False
    visited: int = 0
    programs: int = 0
    _full: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))  # all parts reached

    def run(self) -> Route | None:
        """Return the route with the fewest placements, or None; `exhausted` tells if it is none."""
        exits: dict[int, list[_Gate]] = {}
        for gate in gates(self.cut, self.back or self.moves, self.goals, arriving=True):
            exits.setdefault(gate.index, []).append(gate)
        if not exits:
            self.exhausted = True
            return None
        queue = _Queue(self.moves.to_go(self.cut, self.goals))
        for gate in gates(self.cut, self.moves, self.starts, arriving=False):
            queue.push(gate.cost, gate.index, gate)
        while queue.items:
            g, item = queue.pop()
            if isinstance(item, _End):
                return self._route(item, g)
            for node, step in self._entered(g, item, queue):
                if node in self.reached:
                    continue
                self._reach(node, step)
                self.visited += 1
                if self.visited > self.patience:
                    return None
                part = self.cut.part(node[0])
                for gate in exits.get(node[0], ()):
                    for place in gate.places(part):
                        if part.labels[place] == node[1]:
                            queue.end(g + gate.cost, _End(node, gate, place))
                for arrival in self._arrivals(node):
                    queue.push(g + arrival.cost, arrival.other, arrival)
        self.exhausted = True
        return None

    def _reach(self, node: Node, step: _Step) -> None:
        """Note how a part was reached, and whether it was the last one of its set."""
        self.reached[node] = step
        index = node[0]
        if all((index, label) in self.reached for label in range(self.cut.part(index).count)):
            more = len(self.cut.rows) - len(self._full)  # a search may add sets
            self._full = np.pad(self._full, (0, more)) if more else self._full
            self._full[index] = True

    def _entered(
        self, g: int, item: _Gate | _Arrival, queue: _Queue
    ) -> Iterator[tuple[Node, _Step]]:
        """The parts that a way leads to; what only programs can tell is put back for later."""
        index = item.index if isinstance(item, _Gate) else item.other
        if index < len(self._full) and self._full[index]:
            return
        found: Iterable[tuple[int, _Step]]
        if isinstance(item, _Gate):
            places = item.places(self.cut.part(index))
            found = [(into, _Step(None, item, -1, into, ())) for into in places]
        elif item.later:
            found = item.decided(self)
        else:
            found = list(item.certain(self))
            if item.open(self, found):
                queue.push(g, index, replace(item, later=True))
        labels = self.cut.part(index).labels
        for into, step in found:
            yield (index, int(labels[into])), step

    def _arrivals(self, node: Node) -> Iterator[_Arrival]:
        """Switches from a part, one for each neighbour and number of held contacts."""
        index, label = node
        for contacts in self.moves.of(index):
            of_use = self.cut.any_alive(contacts.others)
            known = np.flatnonzero(contacts.others < len(self._full))
            of_use[known] &= ~self._full[contacts.others[known]]
            contacts = contacts.take(of_use)
            if not len(contacts.others):
                continue
            found = reach(self.cut, index, label, contacts)
            order = np.argsort(contacts.others, kind="stable")
            bounds = np.flatnonzero(np.diff(contacts.others[order], prepend=-1))
            for rows in np.split(order, bounds[1:]):
                other = int(contacts.others[rows[0]])
                cost = int((self.cut.rows.edges[other] >= 0).sum()) - contacts.held
                yield _Arrival(node, other, cost, found, rows)

    def _route(self, end: _End, placements: int) -> Route:
        """The route that ends through a gate."""
        node, gate = end.node, end.gate
        part = self.cut.part
        legs: list[Leg] = []
        held: list[Slots] = []
        out = end.out
        goal = gate.support
        exit_: LinearSets | None = None
        if gate.slots is not None:
            legs.append(Leg(goal.index, ()))
            held.append(gate.slots)
        elif gate.visible is not None:
            exit_ = gate.visible
        current: Node | None = node
        while current is not None:
            step = self.reached[current]
            chain = part(current[0]).chain(step.into, out)
            pieces = tuple((int(j), int(k)) for j, k in part(current[0]).pieces[chain])
            entry = None
            if exit_ is not None:
                pieces = (*pieces, pieces[-1])
            first = step.gate
            if first is not None and first.visible is not None:
                pieces, entry = (pieces[0], *pieces), first.visible
            legs.append(Leg(current[0], pieces, entry, exit_))
            exit_ = None
            if first is not None:
                if first.slots is not None:
                    legs.append(Leg(first.support.index, ()))
                    held.append(first.slots)
                start = first.support
            else:
                held.append(step.slots)
            current, out = step.before, step.out
        return Route(tuple(legs[::-1]), tuple(held[::-1]), start, goal, placements)


@dataclass(frozen=True, eq=False)
class _Arrival:
    """A switch from a part to a set, by some choices of held contacts."""

    node: Node
    other: int
    cost: int
    found: Reached
    rows: IntArray
    later: bool = False  # what is certain is done

    def _slots(self, row: int) -> Slots:
        contacts = self.found.contacts
        here, there = contacts.here[row].tolist(), contacts.there[row].tolist()
        return tuple(zip(here, there, strict=True))

    def certain(self, search: Search) -> Iterator[tuple[int, _Step]]:
        """The parts that are reached for certain, each by one of its pieces."""
        part = search.cut.part(self.other)
        seen = set()
        for row in self.rows.tolist():
            if self.found.origin[row] < 0:
                continue
            j, k = part.pieces.T
            for into in np.flatnonzero(self.found.pieces[row][j, k]).tolist():
                if part.labels[into] not in seen:
                    seen.add(part.labels[into])
                    out = int(self.found.origin[row])
                    yield into, _Step(self.node, None, out, into, self._slots(row))

    def open(self, search: Search, found: Iterable[tuple[int, _Step]]) -> bool:
        """Whether some part of the set is not reached yet, once the certain ones are."""
        part = search.cut.part(self.other)
        certain = {part.labels[into] for into, _ in found}
        return any(
            (self.other, label) not in search.reached and label not in certain
            for label in range(part.count)
        )

    def decided(self, search: Search) -> Iterator[tuple[int, _Step]]:
        """The parts that programs say are reached."""
        part = search.cut.part(self.other)
        choices = [self._slots(row) for row in self.rows.tolist()]
        for label in range(part.count):
            if (self.other, label) in search.reached:
                continue
            search.programs += 1
            found = joined(search.cut, *self.node, self.other, label, choices)
            if found is not None:
                out, into, slots = found
                yield into, _Step(self.node, None, out, into, slots)


def gates(
    cut: Cut, moves: Moves, supports: Sequence[Support], *, arriving: bool
) -> Iterator[_Gate]:
    """Yield the ways from given grasps to pieces at the level.

    Parameters
    ----------
    cut : Cut
    moves : Moves
    supports : sequence of Support
    arriving : bool
        Whether these are goals, and the ways are gone backwards.
    """
    for support in supports:
        inside = support.inside(cut.least)
        if inside:
            yield _Gate(support, support.index, np.array(inside), 0)
            continue
        part = cut.part(support.index)
        seen: set[int] = set()
        for landing in support.landings(cut.least):
            place = part.number(landing.piece)
            if place >= 0 and int(part.labels[place]) not in seen:
                seen.add(int(part.labels[place]))
                pieces = np.array([landing.piece])
                yield _Gate(support, support.index, pieces, 0, visible=landing.visible)
            if len(seen) == part.count:
                break
        for contacts in support.ways(moves):
            found = _given(cut, contacts, support)
            for row in np.flatnonzero(found.any(axis=(1, 2))).tolist():
                other = int(contacts.others[row])
                size = len(support.edges) if arriving else int(cut.rows.contacts[other])
                here, there = contacts.here[row].tolist(), contacts.there[row].tolist()
                slots: Slots = tuple(
                    zip(there, here, strict=True) if arriving else zip(here, there, strict=True)
                )
                # Their parts are asked for when a search gets there: most never are.
                pieces, cost = np.argwhere(found[row]), size - contacts.held
                yield _Gate(support, other, pieces, cost, slots=slots)


def _given(cut: Cut, contacts: Contacts, support: Support) -> BoolArray:
    """Which pieces of neighbours a given grasp can be switched to; by programs if not plain."""
    found: BoolArray = support.onward(contacts, cut.least) >= cut.least
    if contacts.held == 0:
        return found
    for row in np.flatnonzero(found.any(axis=(1, 2)) & ~cut.rows.plain(contacts.others)).tolist():
        pieces = np.argwhere(found[row])
        names = [f"f{i}" for i in range(3)]
        values = support.fractions[contacts.here[row]].tolist()
        cell = cut.rows.cell(int(contacts.others[row]), pieces, names)
        slots = contacts.there[row].tolist()
        at = {f"f{slot}": value for slot, value in zip(slots, values, strict=True)}
        left = cell.restrict(at)
        # Two given contacts may be in the wrong order, and then nothing is left.
        none = ((~left.rows.any(axis=2)) & (left.bounds < 0) & (left.scales == 0)).any(axis=1)
        rest = np.flatnonzero(~none)
        margins = np.full(len(pieces), -np.inf)
        margins[rest] = maximise_margins(
            without_void_rows(left.take(rest)), get_solver("highs")
        ).margins
        no = pieces[margins < cut.least]
        found[row, no[:, 0], no[:, 1]] = False
    return found
