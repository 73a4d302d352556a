"""Search of a path of grasp sets with the fewest placements, or the least weight."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise, product

import numpy as np

from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.planning.branches import EVERYTHING, Best, Branch, best_first
from regrasp_lp.planning.hand import Hand
from regrasp_lp.switches import StoredSwitches, Switches

_UNREACHED = np.iinfo(np.int64).max
_FAR = 1 << 30

Weigh = Callable[[int, IntArray, IntArray], FloatArray]
"""From a set, others and the held contacts to the weights of the switches; inf hides one."""

Label = tuple[float, int, float]
"""Weight, placements and less the least margin of a path: the smaller, the better."""


def fewest_placements(
    contacts: IntArray,
    margins: FloatArray,
    switches: Switches,
    hand: Hand,
    sources: Mapping[int, int],
    targets: Mapping[int, int],
    given: Mapping[int, float] | None = None,
) -> list[int] | None:
    """Return a path of sets with the fewest placements, or None if there is none.

    Parameters
    ----------
    contacts, margins, switches, hand, sources, targets, given
        As for `PathSearch`.

    Returns
    -------
    list of int or None
    """
    search = PathSearch(contacts, margins, switches, hand, sources, targets, given or {})
    return None if search.first is None else list(search.first[1])


def placements_from(
    contacts: IntArray,
    margins: FloatArray,
    switches: Switches,
    hand: Hand,
    sources: Mapping[int, int],
    most: int | None = None,
) -> IntArray:
    """Return the fewest placements with which each set is reached, -1 for sets that are not.

    Parameters
    ----------
    contacts, margins, switches, hand, sources
        As for `PathSearch`.
    most : int, optional
        Look at the neighbours of so many sets only, the nearest ones: farther sets may then need
        fewer placements than returned, or be reached after all.

    Returns
    -------
    numpy.ndarray of int, shape (N,)
    """
    search = PathSearch(contacts, margins, switches, hand, sources)
    placements = search.settle(EVERYTHING, most=most).placements
    return np.where(placements == _UNREACHED, -1, placements)[: len(contacts)]


@dataclass(frozen=True, eq=False)
class PathSearch:
    """What paths of sets are searched in.

    A switch from S to T places ``n_T - held`` fingers. The best path has the least sum of weights,
    if there are any; of these the fewest placements; of these the largest least set margin; then
    the sets with smaller numbers are looked at first. Dijkstra's algorithm on such labels, which
    order the same after any common extension.

    Parameters
    ----------
    contacts : numpy.ndarray of int, shape (N,)
        Number of contacts of each set.
    margins : numpy.ndarray, shape (N,)
        Sets with -inf are left out.
    switches : Switches
    hand : Hand
    sources, targets : mapping of int to int
        Sets where a path may begin and end, with the placements needed before and after.
    given : mapping of int to float
        Margin of the given grasp in a source or target, which no choice of contacts can raise.
    through : numpy.ndarray of bool, shape (N,), optional
        The sets that a path may pass through; the others it may only begin or end with.
    weigh : callable, optional
        Weights of switches.
    """

    contacts: IntArray
    margins: FloatArray
    switches: Switches
    hand: Hand
    sources: Mapping[int, int]
    targets: Mapping[int, int] = field(default_factory=dict)
    given: Mapping[int, float] = field(default_factory=dict)
    through: BoolArray | None = None
    weigh: Weigh | None = None

    def paths(self) -> Iterator[Best[None]]:
        """Yield all paths that pass through no set twice, the best one first."""

        def solve(branch: Branch, known: Best[None] | None) -> Best[None] | None:
            found = self.first if known is None else self.best(branch)
            return None if found is None else Best(*found)

        return best_first(solve)

    @cached_property
    def first(self) -> tuple[Label, tuple[int, ...]] | None:
        """The best path of all and its label, or None if there is none."""
        return self.best()

    def best(self, branch: Branch = EVERYTHING) -> tuple[Label, tuple[int, ...]] | None:
        """Return the best path of a class and its label, or None if there is none."""
        n = len(self.contacts)
        if not any(branch.ends(index) for index in self.targets):
            return None
        front = self.settle(branch)
        if front.before[n] < 0:
            return None
        path, node = [], int(front.before[n])
        while node >= 0:
            path.append(int(self._set_of[node]))
            node = int(front.before[node])
        label = float(front.weights[n]), int(front.placements[n]), -float(front.least[n])
        return label, (*branch.prefix[:-1], *path[::-1])

    def settle(self, branch: Branch, most: int | None = None) -> _Front:
        """Return how the sets are reached by paths of a class.

        Entry N stands for the end of a path, entries beyond it for sets that a path may only end
        with. The search stops once the end is reached, or once the neighbours of `most` sets have
        been looked at.
        """
        n = len(self.contacts)
        to_go = None if branch == EVERYTHING else self._to_go
        front = _Front.of(len(self._set_of), self.weigh is not None, to_go)
        entry = self._entry.copy()
        entry[list(branch.prefix)] = -1
        self._begin(front, branch)
        looked_at = 0
        while looked_at != most:
            node = front.pop()
            if node is None or node == n:
                break
            looked_at += 1
            index = int(self._set_of[node])
            label = front.label(node)
            if index in self.targets and branch.ends(index):
                front.reach(node, n, self._ended(label, index))
            if node > n:
                continue
            others, placements, weights = self._leaving(index)
            to = entry[others]
            if branch.prefix and index == branch.prefix[-1]:
                to[np.isin(others, list(branch.closed))] = -1
            least = np.minimum(front.least[node], self.margins[others])
            along = None if weights is None else label[0] + weights
            front.relax(node, to, label[1] + placements, least, along)
        return front

    def _begin(self, front: _Front, branch: Branch) -> None:
        """Reach the sources, or the last set of a prefix."""
        if branch.prefix:
            last = branch.prefix[-1]
            node = int(self._entry[last]) if len(branch.prefix) > 1 else last
            front.reach(-1, node, self.label(branch.prefix))
            return
        for index, cost in sorted(self.sources.items()):
            if branch.starts(index):
                least = min(float(self.margins[index]), self.given.get(index, np.inf))
                front.reach(-1, index, (0.0, cost, -least))

    def _ended(self, label: Label, index: int) -> Label:
        """The label of a path to a target, once it ends there."""
        weight, placements, negative = label
        least = min(-negative, self.given.get(index, np.inf))
        return weight, placements + self.targets[index], -least

    def label(self, path: Sequence[int]) -> Label:
        """Return the label of a path that need not be at its end yet."""
        first = path[0]
        weight, placements = 0.0, self.sources[first]
        least = min(float(self.margins[first]), self.given.get(first, np.inf))
        for one, other in pairwise(path):
            others, cost, weights = self._leaving(one)
            at = int(np.flatnonzero(others == other)[0])
            weight += 0.0 if weights is None else float(weights[at])
            placements += int(cost[at])
            least = min(least, float(self.margins[other]))
        return weight, placements, -least

    def _leaving(self, index: int) -> tuple[IntArray, IntArray, FloatArray | None]:
        """All sets that a set can be switched to, with the placements and the weight of it."""
        others, held = self.switches.neighbors(index)
        mine = int(self.contacts[index])
        free = [all_ for m, all_ in self._of_size.items() if self.hand.adjacent[mine, m]]
        if free:
            listed = np.zeros(len(self.contacts), dtype=bool)
            listed[others], listed[index] = True, True
            more = np.concatenate(free)
            more = more[~listed[more]]
            others = np.concatenate((others, more))
            held = np.concatenate((held, np.zeros(len(more), dtype=held.dtype)))
        weights = None if self.weigh is None else self.weigh(index, others, held)
        return others, self.contacts[others] - held, weights

    @cached_property
    def _of_size(self) -> dict[int, IntArray]:
        return {m: np.flatnonzero(self.contacts == m) for m in (2, 3)}

    @cached_property
    def _last(self) -> IntArray:
        """Sets that a path may only end with, each of them a node of its own."""
        if self.through is None:
            return np.zeros(0, dtype=np.intp)
        return np.array(sorted(i for i in self.targets if not self.through[i]), dtype=np.intp)

    @cached_property
    def _set_of(self) -> IntArray:
        """The set of each node; -1 for the end."""
        return np.concatenate((np.arange(len(self.contacts)), [-1], self._last))

    @cached_property
    def _entry(self) -> IntArray:
        """The node that a path comes to by a switch to each set; -1 if it may not."""
        n = len(self.contacts)
        entry = np.arange(n)
        if self.through is not None:
            entry[~self.through] = -1
            entry[self._last] = n + 1 + np.arange(len(self._last))
        return entry

    @cached_property
    def _to_go(self) -> tuple[IntArray, FloatArray] | None:
        """Of each node the fewest placements to the end, and the largest least margin with them.

        None where they cannot be had for less than the search that they would save.
        """
        if self.weigh is not None or not isinstance(self.switches, StoredSwitches):
            return None
        n = len(self.contacts)
        alive = self.margins > -np.inf
        least = self.margins.copy()
        ends = np.full(n, _FAR)
        for index, cost in self.targets.items():
            ends[index] = cost
            least[index] = min(least[index], self.given.get(index, np.inf))
        through = alive if self.through is None else alive & self.through
        placements, margins = _backwards(self, ends, least, through)
        shut = np.array([0]), np.array([np.inf])
        return (
            np.concatenate((placements, shut[0], ends[self._last])),
            np.concatenate((margins, shut[1], least[self._last])),
        )


@dataclass(eq=False)
class _Front:
    """The best labels so far, and the nodes whose neighbours are still to be looked at."""

    weights: FloatArray
    placements: IntArray
    least: FloatArray
    before: IntArray
    weighted: bool
    to_go: tuple[IntArray, FloatArray] | None
    queue: list[tuple[float, int, float, int, int, float]] = field(default_factory=list)

    @classmethod
    def of(cls, n: int, weighted: bool, to_go: tuple[IntArray, FloatArray] | None) -> _Front:
        weights = np.full(n, np.inf if weighted else 0.0)
        placements, least, before = np.full(n, _UNREACHED), np.full(n, -np.inf), np.full(n, -1)
        return cls(weights, placements, least, before, weighted, to_go)

    def label(self, node: int) -> Label:
        return float(self.weights[node]), int(self.placements[node]), -float(self.least[node])

    def reach(self, node: int, to: int, label: Label) -> None:
        """Take one way over a node if it is better."""
        weight, placements, negative = label
        weights = np.array([weight]) if self.weighted else None
        self.relax(node, np.array([to]), np.array([placements]), np.array([-negative]), weights)

    def relax(
        self,
        node: int,
        to: IntArray,
        placements: IntArray,
        least: FloatArray,
        weights: FloatArray | None,
    ) -> None:
        """Take what is better on the ways over a node; to node -1 there is none."""
        old = self.placements[to]
        better = (placements < old) | ((placements == old) & (least > self.least[to]))
        if weights is not None:
            before = self.weights[to]
            better = (weights < before) | ((weights == before) & (weights < np.inf) & better)
        rows = np.flatnonzero(better & (least > -np.inf) & (to >= 0))
        if not rows.size:
            return
        to, placements, least = to[rows], placements[rows], least[rows]
        self.placements[to], self.least[to], self.before[to] = placements, least, node
        if weights is not None:
            self.weights[to] = weights[rows]
        first, second = placements, least
        if self.to_go is not None:
            first = placements + self.to_go[0][to]
            second = np.minimum(least, self.to_go[1][to])
        # Of equally good ones the farthest: it is next to the end.
        parts = self.weights[to], first, -second, -placements, to, least
        for item in zip(*(part.tolist() for part in parts), strict=True):
            if item[1] < _FAR:
                heapq.heappush(self.queue, item)

    def pop(self) -> int | None:
        """Return the node that is next, None if there is none."""
        while self.queue:
            weight, _, _, negative, node, least = heapq.heappop(self.queue)
            if (weight, -negative, -least) == self.label(node):
                return node
        return None


def _backwards(
    search: PathSearch, ends: IntArray, least: FloatArray, through: BoolArray
) -> tuple[IntArray, FloatArray]:
    """The fewest placements from each set to an end, and the largest least margin with them."""
    switches, contacts = search.switches, search.contacts
    assert isinstance(switches, StoredSwitches)
    rows = np.flatnonzero(np.diff(switches.starts))
    starts, others = switches.starts[rows], switches.others
    cost = contacts[others] - switches.held
    free = [(m, k) for m, k in product((2, 3), (2, 3)) if search.hand.adjacent[m, k]]
    go = ends
    while True:
        into, new = np.where(through, go, ends), go.copy()
        if rows.size:
            new[rows] = np.minimum(go[rows], np.minimum.reduceat(into[others] + cost, starts))
        for m, k in free:
            here, best = contacts == m, int(into[contacts == k].min(initial=_FAR))
            new[here] = np.minimum(new[here], best + k)
        if (new == go).all():
            break
        go = new
    tight = into[others] + cost == go.repeat(np.diff(switches.starts))
    last = np.where(ends < _FAR, least, -np.inf)
    width = np.where(go == ends, last, -np.inf)
    while True:
        onward, wider = np.where(through, width, last), width.copy()
        if rows.size:
            along = np.where(tight, onward[others], -np.inf)
            wider[rows] = np.maximum(width[rows], np.maximum.reduceat(along, starts))
        for m, k in free:
            for level in np.unique(go[contacts == m]).tolist():
                here = (contacts == m) & (go == level)
                there = (contacts == k) & (into == level - k)
                wider[here] = np.maximum(wider[here], onward[there].max(initial=-np.inf))
        wider = np.minimum(wider, search.margins)
        if (wider == width).all():
            return np.minimum(go, _FAR), width
        width = wider
