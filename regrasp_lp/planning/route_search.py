"""Best first through the beginnings of routes: always the one whose completion may be cheapest.

A *beginning* is a route up to where it arrives in its last set. Its program bounds what it costs so
far, `ToGo` what is still to come. What has no program yet has the bound of what it came from.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from regrasp_lp.errors import SolverError
from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.route_lp import Contacts, Route, RoutePrograms, Slots
from regrasp_lp.switches import StoredSwitches, Switches


@dataclass(frozen=True, eq=False)
class Ground:
    """What routes run through.

    Parameters
    ----------
    sets : GraspSets
    switches : Switches
    hand : Hand
    allowed : numpy.ndarray of bool, shape (N,)
        Sets that a route may pass through.
    """

    sets: GraspSets
    switches: Switches
    hand: Hand
    allowed: BoolArray

    def beside(self, index: int) -> tuple[IntArray, IntArray]:
        """Return the sets that a switch may lead to, once for each number of held contacts."""
        contacts, n = self.sets.contacts, int(self.sets.contacts[index])
        needs = self.hand.needs[n, contacts]
        others, most = self.switches.neighbors(index)
        # Fingers of one set can be placed anew, too; where none has to be held every set will do.
        others = np.append(others, index).astype(np.intp)
        most = np.append(most, n - 1).astype(np.intp)
        found = [np.flatnonzero((needs == 0) & self.allowed)]
        for held in (1, 2, 3):
            fits = (needs[others] <= held) & (held <= most) & self.allowed[others]
            found.append(others[fits])
        return np.concatenate(found), np.arange(4).repeat([len(part) for part in found])

    def matchings(self, first: int, second: int, held: int) -> Iterator[Slots]:
        """Yield which contacts a switch may hold, two on one edge in their order."""
        one, other = self.edges_of(first), self.edges_of(second)
        for here in combinations(range(len(one)), held):
            for there in combinations(range(len(other)), held):
                if all(one[i] == other[j] for i, j in zip(here, there, strict=True)):
                    yield tuple(zip(here, there, strict=True))

    def edges_of(self, index: int) -> list[int]:
        """Return the edges of a set."""
        family, row = self.sets.place(index)
        edges: list[int] = self.sets.families[family].functions.edges[row].tolist()
        return edges

    @cached_property
    def links(self) -> tuple[IntArray, IntArray, IntArray] | None:
        """All switches as sets, other sets and the most contacts held; None if found on demand."""
        if not isinstance(self.switches, StoredSwitches):
            return None
        starts = self.switches.starts
        one = np.arange(len(starts) - 1).repeat(np.diff(starts))
        return one, self.switches.others.astype(np.intp), self.switches.held.astype(np.intp)

    def least_cost(self, values: FloatArray, weight: float, *, onwards: bool) -> FloatArray:
        """Return the least of ``value + weight · placements`` over all ways from each set.

        Parameters
        ----------
        values : numpy.ndarray, shape (N,)
            Where a way ends; inf where it may not.
        weight : float
        onwards : bool
            Whether ways lead from the set to where they end, or from there to the set.

        Returns
        -------
        numpy.ndarray, shape (N,)
            With switches found on demand, 0 placements are counted.
        """
        if self.links is None:
            return np.full(len(values), values.min())
        one, other, held = self.links
        contacts = self.sets.contacts
        step = weight * (contacts[other if onwards else one] - held)
        least = np.where(self.allowed, values, np.inf)
        while True:
            before = least.copy()
            np.minimum.at(least, one, step + before[other])
            for n, m in np.argwhere(self.hand.needs[2:, 2:] == 0) + 2:
                ends = before[contacts == m]
                free = weight * (m if onwards else n) + ends.min(initial=np.inf)
                least[contacts == n] = np.minimum(least[contacts == n], free)
            least[~self.allowed] = np.inf
            if (least == before).all():
                return least

    def widest(self, levels: FloatArray, goals: IntArray) -> FloatArray:
        """Return the best least level of sets on the way from each set to a goal, itself left out.

        Parameters
        ----------
        levels : numpy.ndarray, shape (N,)
        goals : numpy.ndarray of int
            Where a way may end; what is given there does not count.

        Returns
        -------
        numpy.ndarray, shape (N,)
            inf in goals, and beside them; everywhere with switches found on demand.
        """
        if self.links is None:
            return np.full(len(levels), np.inf)
        one, other, _ = self.links
        contacts = self.sets.contacts
        best = np.full(len(levels), -np.inf)
        best[goals] = np.inf
        while True:
            before = best.copy()
            through = np.where(self.allowed, np.minimum(levels, before), -np.inf)
            through[goals] = np.inf
            np.maximum.at(best, one, through[other])
            for n, m in np.argwhere(self.hand.needs[2:, 2:] == 0) + 2:
                ends = through[contacts == m].max(initial=-np.inf)
                best[contacts == n] = np.maximum(best[contacts == n], ends)
            if (best == before).all():
                return best


@dataclass(frozen=True, eq=False)
class ToGo:
    """Lower bounds of what is still to come, per set that a beginning arrives in.

    Parameters
    ----------
    cost : numpy.ndarray, shape (N,)
        With placements weighted; inf where nothing leads on.
    placements : numpy.ndarray, shape (N,)
        Fewest placements, for ties.
    """

    cost: FloatArray
    placements: FloatArray


@dataclass(frozen=True, eq=False)
class Beginning:
    """A beginning of a route, or a whole one.

    Parameters
    ----------
    route : Route
    placed : int
        Placements so far.
    bound : float
        What the route costs so far, at least.
    unpaid : frozenset of int
        The sets since the last placement: to come back to one of them leads nowhere.
    contacts : Contacts, optional
        Once its program is solved.
    """

    route: Route
    placed: int
    bound: float
    unpaid: frozenset[int]
    contacts: Contacts | None = None


@dataclass(frozen=True, eq=False)
class Fan:
    """All ways to extend a beginning by one set, the cheapest first, made one by one.

    Parameters
    ----------
    beginning : Beginning
    sets, held : numpy.ndarray of int, shape (K,)
    cost : numpy.ndarray, shape (K,)
        Bound of the cost of a completion.
    placements : numpy.ndarray, shape (K,)
        Of a completion, at least.
    """

    beginning: Beginning
    sets: IntArray
    held: IntArray
    cost: FloatArray
    placements: FloatArray

    def rest(self) -> Fan:
        """Return all ways but the first."""
        return Fan(self.beginning, self.sets[1:], self.held[1:], self.cost[1:], self.placements[1:])


@dataclass(eq=False)
class RouteSearch:
    """The beginnings that are open, and the search among them.

    Parameters
    ----------
    ground : Ground
    programs : RoutePrograms
    weight : float
        Of a placement.
    to_go : ToGo
    resolution : float
        Costs that differ by less are equal: fewer placements decide.
    backwards : bool
        Whether routes are built from the goal; a switch then places what it releases.
    """

    ground: Ground
    programs: RoutePrograms
    weight: float
    to_go: ToGo
    resolution: float
    backwards: bool = False
    solved: int = 0
    lost: float = np.inf  # least bound of what no solver decided
    limit: tuple[float, float] = (np.inf, np.inf)  # cost and placements that are known already
    extended: list[Beginning] = field(default_factory=list)
    _queue: list[tuple[float, float, int, int, float, Beginning | Fan]] = field(
        default_factory=list
    )
    _pushed: int = 0
    _reach: dict[int, float] = field(default_factory=dict)

    def begin(self) -> None:
        """Add the beginnings of one set, with a first slide and without."""
        for origin, start in enumerate(self.programs.starts):
            for still in (False, True):
                self.add(Route((start.index,), still=still, origin=origin), start.placed)

    def add(self, route: Route, placed: int) -> None:
        """Add a beginning, or a whole route of which only the contacts are open."""
        cost = self.weight * placed
        self._push(Beginning(route, placed, cost - self._best_levels, frozenset(route.path)))

    @property
    def _best_levels(self) -> float:
        """What the largest margin and tolerance are worth."""
        return float(self.programs.weights[1:] @ self.programs.most)

    @property
    def bound(self) -> float:
        """What no completion of what is open costs less than."""
        costs = [
            entry[5].cost.min() if isinstance(entry[5], Fan) else entry[4] for entry in self._queue
        ]
        return float(min([*costs, self.lost]))

    @property
    def done(self) -> bool:
        """Whether nothing open can be better than what is known already."""
        return not self._queue or self._queue[0][:2] >= self._rank(*self.limit)

    def open(self) -> list[tuple[Beginning | Fan, float]]:
        """Return what is open, with the bounds of its completions."""
        return [(entry[5], entry[4]) for entry in self._queue]

    def step(self) -> Beginning | None:
        """Look at the most promising beginning; return it if it is a whole route, solved."""
        *_, cost, item = heapq.heappop(self._queue)
        if isinstance(item, Fan):
            self._unfold(item)
            return None
        if item.contacts is None and len(item.route.path) + item.route.ended > 1:
            solved = self._solve(item, cost)
            if solved is None:
                return None
            item = solved
            if self._rank_of(item) > self._rank(cost, self._placements(item)):
                self._push(item)
                return None
        if item.contacts is not None and item.contacts.broken is not None:
            grasp, choice, rows = item.contacts.broken
            for row in rows:
                route = item.route.choosing(grasp, choice, row)
                self._push(replace(item, route=route, contacts=None))
            return None
        if item.route.ended:
            return item
        self._extend(item)
        return None

    def _solve(self, item: Beginning, cost: float) -> Beginning | None:
        self.solved += 1
        try:
            contacts = self.programs.solve(item.route)
        except SolverError:
            self.lost = min(self.lost, cost)
            return None
        if contacts is None:
            return None
        bound = max(item.bound, self.weight * item.placed + contacts.bound)
        return replace(item, contacts=contacts, bound=bound)

    def _extend(self, item: Beginning) -> None:
        """Open what can follow a beginning that breaks nothing: the end, and other sets."""
        route, index = item.route, item.route.path[-1]
        if self._is_reached(item):
            return
        self.extended.append(item)
        # Without any slide there is nothing to end.
        for aim, placed in self._aims(index) if route.held or not route.still else ():
            bound = item.bound + self.weight * placed
            ended = replace(route, aim=aim)
            self._push(Beginning(ended, item.placed + placed, bound, item.unpaid))
        sets, held = self.ground.beside(index)
        contacts = self.ground.sets.contacts
        paid = (contacts[index] if self.backwards else contacts[sets]) - held
        cost = item.bound + self.weight * paid + self.to_go.cost[sets]
        placements = item.placed + paid + self.to_go.placements[sets]
        again = (paid == 0) & np.isin(sets, list(item.unpaid))
        ranks = np.round(np.minimum(cost, 1e300) / self.resolution)
        kept = np.flatnonzero(np.isfinite(cost) & ~again & (cost <= self.limit[0]))
        order = kept[np.lexsort((placements[kept], ranks[kept]))]
        if order.size:
            fan = Fan(item, sets[order], held[order], cost[order], placements[order])
            self._push_fan(fan)

    def _aims(self, index: int) -> list[tuple[int, int]]:
        """The goals that a set holds, and the placements after it."""
        goals = () if self.backwards else self.programs.goals
        return [(aim, goal.placed) for aim, goal in enumerate(goals) if goal.index == index]

    def _is_reached(self, item: Beginning) -> bool:
        """Whether its last set was reached before, any grasp of it included, at no higher cost."""
        if self.programs.weights[1:].any():
            return False
        route, contacts = item.route, item.contacts
        index = route.path[-1]
        if item.bound > self._reach.get(index, np.inf) + self.resolution:
            return True
        cost = self.weight * item.placed + (0.0 if contacts is None else contacts.value)
        if not route.held or route.held[-1]:  # otherwise any grasp of the set may be placed
            f = (
                self.programs.starts[route.origin].fractions
                if contacts is None
                else contacts.grasps[-1]
            )
            far = np.maximum(f, 1 - f) @ self.programs.set_rows(index).lengths
            cost += float(self.programs.weights[0] * far)
        if route.held or not route.still:
            self._reach[index] = min(cost, self._reach.get(index, np.inf))
        return False

    def _unfold(self, fan: Fan) -> None:
        item, index, held = fan.beginning, int(fan.sets[0]), int(fan.held[0])
        first = item.route.path[-1]
        paid = int(self.ground.sets.contacts[first if self.backwards else index]) - held
        unpaid = item.unpaid | {index} if paid == 0 else frozenset((index,))
        for slots in self.ground.matchings(first, index, held):
            route = item.route.switched(index, slots)
            bound = item.bound + self.weight * paid
            self._push(Beginning(route, item.placed + paid, bound, unpaid))
            # The goal itself may arrive: it is given, and need not be as good as what is chosen.
            for aim, placed in self._aims(index):
                ended = replace(route, aim=aim, rest=True)
                more = bound + self.weight * placed
                self._push(Beginning(ended, item.placed + paid + placed, more, unpaid))
        if len(fan.sets) > 1:
            self._push_fan(fan.rest())

    def _placements(self, item: Beginning) -> float:
        if item.route.ended:
            return item.placed
        return item.placed + float(self.to_go.placements[item.route.path[-1]])

    def _cost(self, item: Beginning) -> float:
        if item.route.ended:
            return item.bound
        return item.bound + float(self.to_go.cost[item.route.path[-1]])

    def _rank(self, cost: float, placements: float) -> tuple[float, float]:
        return (round(cost / self.resolution) if np.isfinite(cost) else np.inf), placements

    def _rank_of(self, item: Beginning) -> tuple[float, float]:
        return self._rank(self._cost(item), self._placements(item))

    def _push(self, item: Beginning) -> None:
        cost = self._cost(item)
        if cost <= self.limit[0] and np.isfinite(cost):
            route = item.route
            depth = 2 * len(route.path) + route.ended
            self._add(self._rank_of(item), depth, len(route.choices), cost, item)

    def _push_fan(self, fan: Fan) -> None:
        rank = self._rank(float(fan.cost[0]), float(fan.placements[0]))
        depth = 2 * len(fan.beginning.route.path) + 1
        self._add(rank, depth, 0, float(fan.cost[0]), fan)

    def _add(
        self,
        rank: tuple[float, float],
        depth: int,
        choices: int,
        cost: float,
        item: Beginning | Fan,
    ) -> None:
        # Among equals the deepest first: it may soon be a whole route.
        self._pushed += 1
        entry = (*rank, -100 * depth - choices, self._pushed, cost, item)
        heapq.heappush(self._queue, entry)
