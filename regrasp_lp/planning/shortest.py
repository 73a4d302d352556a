"""The cheapest route by placements, travel, margin and tolerance, with a proved lower bound.

Routes are searched best first (`route_search`). What a beginning of a route costs is a linear
program (`route_lp`), whose multipliers bound it from below; what is still to come is bounded by the
fewest placements from its last set and by what the ends of routes cost, which the same search finds
backwards from the goal before. The search is done when no beginning is cheaper than the best whole
route. It may be broken off at any time: the cheapest beginning is a bound all along.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from regrasp_lp.errors import HandError, OptionError, SolverError
from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.planning.costs import Budget, Shortest
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.objective import Objective
from regrasp_lp.planning.route_lp import Contacts, Route, RoutePrograms, Terminal
from regrasp_lp.planning.route_search import Beginning, Fan, Ground, RouteSearch, ToGo
from regrasp_lp.planning.search import fewest_placements
from regrasp_lp.planning.set_rows import most_levels
from regrasp_lp.planning.shortest_slide import shortest_slide
from regrasp_lp.switches import Switches

FLOOR = 1e-4
"""Margin that chosen grasps keep by default, in the object's size."""

_SAME = 1e-7
"""Costs that differ by less, relative to the largest weight, are equal."""

_LENGTHS = ("travel", "margin", "tolerance")

_FIRST, _BACKWARDS = 0.1, 0.2
"""Parts of the budget spent before ends of routes are searched, and on these."""

_SOME = 0.5
"""Part of the budget that may be spent before any route is known."""


def shortest_route(
    sets: GraspSets,
    switches: Switches,
    hand: Hand,
    starts: Sequence[Terminal],
    goals: Sequence[Terminal],
    objective: Objective,
    *,
    budget: Budget | None = None,
    floor: float | None = None,
    allowed: BoolArray | None = None,
) -> Shortest | None:
    """Return the cheapest route from a start to a goal, as far as the budget goes.

    Ties are broken by fewer placements. With travel alone repositioning fingers costs nothing, so
    that the least travel is often 0, at the price of more placements.

    Parameters
    ----------
    sets : GraspSets
    switches : Switches
    hand : Hand
    starts, goals : sequence of Terminal
        All sets that hold the start, or the goal, or some of its contacts.
    objective : Objective
        Its cost is searched for: of single margins and tolerances what they are worth, negative.
    budget : Budget, optional
        3000 programs by default.
    floor : float, optional
        Margin that every chosen grasp keeps, in the object's unit; by default 1e-4 of the object's
        size. The least travel is attained at the border of force closure, if anywhere.
    allowed : numpy.ndarray of bool, shape (N,), optional
        Sets that a route may pass through; all by default.

    Returns
    -------
    Shortest or None
        None if there is no route at this floor.

    Raises
    ------
    HandError
        If the hand has limits to the distance of two fingers or of single fingers, which slides
        here do not know.
    SolverError
        If the budget was used up before any route was found.
    """
    if hand.coupled:
        raise HandError(
            "routes of least cost are not searched with max_span, fingertip_separation or limits "
            "of single fingers: leave them out, or choose another objective"
        )
    task = _Task.of(sets, switches, hand, starts, goals, objective, floor, allowed)
    clock = _Clock(budget or Budget())
    best = _first_found(task, clock)
    # Often that is all, or nearly: the ends of routes are searched if it is not.
    for part in (2 * _FIRST, 1.0):
        search = task.search(task.placements() if part < 1 else task.ends(clock))
        search.begin()
        best, closed = _run(task, search, clock, best, part)
        if search.done:
            break
    if best is None:
        if search.done and math.isinf(search.lost):
            return None
        raise SolverError(
            f"{clock.programs} linear programs were solved and no route found yet, nor that there "
            "is none: give the search a larger budget"
        )
    bound = min(best.cost, closed, search.bound)
    best = _settled(task, best)
    return replace(best, bound=min(best.cost, bound), programs=clock.programs)


class _Clock:
    """Counts programs and time."""

    def __init__(self, budget: Budget) -> None:
        self._budget, self._begun = budget, time.monotonic()
        self.programs = 0

    def out(self, part: float = 1.0) -> bool:
        """Whether a part of the budget is used up."""
        spent = time.monotonic() - self._begun
        return self.programs >= part * self._budget.programs or spent >= part * self._budget.seconds


@dataclass(frozen=True, eq=False)
class _Task:
    """What is asked for, in the object's size."""

    ground: Ground
    weight: float  # of a placement
    programs: RoutePrograms
    resolution: float

    @classmethod
    def of(
        cls,
        sets: GraspSets,
        switches: Switches,
        hand: Hand,
        starts: Sequence[Terminal],
        goals: Sequence[Terminal],
        objective: Objective,
        floor: float | None,
        allowed: BoolArray | None,
    ) -> _Task:
        size = sets.sources[0].cones.size
        floor = FLOOR * size if floor is None else floor
        if not floor > 0:
            raise OptionError(f"floor must be a positive margin, got {floor!r}")
        passed = sets.margins > floor if allowed is None else allowed & (sets.margins > floor)
        passed[[terminal.index for terminal in (*starts, *goals)]] = True
        weights = dict(objective.weights)
        scaled = size * np.array([weights.get(name, 0.0) for name in _LENGTHS])
        least = np.array([floor / size, 0.0])
        most = np.array([sets.margins.max(), sets.sources[0].cones.lengths.max() / 2]) / size
        most = np.where(scaled[1:] > 0, np.maximum(most, least), least)
        ground = Ground(sets, switches, hand, passed)
        onwards = None
        if scaled[1:].any():
            parts = zip(sets.sources, np.split(sets.margins, sets.offsets[1:-1]), strict=True)
            levels = np.concatenate([most_levels(*part) for part in parts]) / size
            goal = np.array([terminal.index for terminal in goals])
            onwards = np.stack([ground.widest(level, goal) for level in levels.T], axis=1)
        programs = RoutePrograms(
            sets, tuple(starts), tuple(goals), scaled, least, most, onwards=onwards
        )
        weight = weights.get("placements", 0.0)
        return cls(ground, weight, programs, _SAME * max(weight, *scaled.tolist()))

    def cost(self, placements: int, travel: float, levels: FloatArray) -> float:
        """Return what a route costs; travel, margin and tolerance in the object's unit."""
        size = self.ground.sets.sources[0].cones.size
        worth = np.minimum(levels / size, self.programs.most)
        lengths = self.programs.weights @ np.array([travel / size, *-worth])
        return float(self.weight * placements + lengths)

    def without_levels(self) -> _Task:
        """Return the same task without margins and tolerances."""
        old = self.programs
        programs = replace(old, weights=old.weights * [1, 0, 0], most=old.least, onwards=None)
        return replace(self, programs=programs)

    def search(self, to_go: ToGo, ground: Ground | None = None) -> RouteSearch:
        """Return a search for whole routes."""
        programs, ground = self.programs, ground or self.ground
        return RouteSearch(ground, programs, self.weight, to_go, self.resolution)

    def placements(self) -> ToGo:
        """Return bounds of what is to come: the fewest placements."""
        ends = np.full(len(self.ground.sets), np.inf)
        for goal in self.programs.goals:
            ends[goal.index] = min(ends[goal.index], goal.placed)
        placements = self.ground.least_cost(ends, 1.0, onwards=True)
        cost = np.full(len(ends), np.inf)
        reached = np.isfinite(placements)
        cost[reached] = self.weight * placements[reached]
        return ToGo(cost, placements)

    def ends(self, clock: _Clock) -> ToGo:
        """Return better ones, from a search backwards from the goal."""
        placements = self.placements()
        old, ground, weight = self.programs, self.ground, self.weight
        if old.weights[0] == 0:
            return placements
        begins = np.full(len(ground.sets), np.inf)
        begins[[start.index for start in old.starts]] = 0.0
        from_start = (ground.least_cost(begins, w, onwards=False) for w in (weight, 1.0))
        alone = np.array([old.weights[0], 0.0, 0.0])
        # A start below the floor is given: it may leave its set.
        least = np.minimum(old.least, [_least_margin(ground.sets, old.starts), 0.0])
        programs = RoutePrograms(ground.sets, old.goals, old.starts, alone, least, least)
        back = RouteSearch(
            ground, programs, weight, ToGo(*from_start), self.resolution, backwards=True
        )
        back.begin()
        while not (back.done or clock.out(2 * _FIRST + _BACKWARDS)):
            before = back.solved
            back.step()
            clock.programs += back.solved - before
        return ToGo(_completed(back, ground, weight), placements.placements)


def _least_margin(sets: GraspSets, terminals: Sequence[Terminal]) -> float:
    """The least margin of given contacts in their sets, in the object's size."""
    margins = [float(sets.functions(t.index).margins(t.fractions)[0]) for t in terminals]
    return max(min(margins), 0.0) / sets.sources[0].cones.size


def _completed(back: RouteSearch, ground: Ground, weight: float) -> FloatArray:
    """What it costs to complete a route from each set, at least.

    A completion ends as one that is open in the search backwards, with any sets before it, or is
    itself one that was extended there.
    """
    values = np.full(len(ground.sets), np.inf)
    for item, cost in back.open():
        if isinstance(item, Fan):
            own = item.cost - back.to_go.cost[item.sets]
            np.minimum.at(values, item.sets, own)
        else:
            last = item.route.path[-1]
            values[last] = min(values[last], cost - back.to_go.cost[last])
    if back.lost < np.inf:  # nothing is known beyond placements
        values = np.minimum(values, back.lost)
    least = ground.least_cost(values, weight, onwards=True)
    for done in back.extended:
        last = done.route.path[-1]
        least[last] = min(least[last], done.bound)
    return least


def _first_found(task: _Task, clock: _Clock) -> Shortest | None:
    """A route to begin with: of the fewest placements, or the best one without margins."""
    best = _along_fewest(task, clock)
    travel, *levels = task.programs.weights.tolist()
    if not (any(levels) and (task.weight or travel)):
        return best
    plain = task.without_levels()
    search = plain.search(plain.placements())
    search.begin()
    found = _run(plain, search, clock, None, _FIRST)[0]
    if found is None:
        return best
    search = task.search(ToGo(*np.zeros((2, len(task.ground.sets)))))
    search.add(replace(found.route, choices=()), found.placements)
    return _run(task, search, clock, best, 1.5 * _FIRST)[0]


def _along_fewest(task: _Task, clock: _Clock) -> Shortest | None:
    """The best contacts along a path with the fewest placements, if some keep the floor."""
    ground, programs = task.ground, task.programs
    sets = ground.sets
    after: dict[int, int] = {}
    for goal in programs.goals:
        after[goal.index] = min(goal.placed, after.get(goal.index, goal.placed))
    path = fewest_placements(
        sets.contacts,
        np.where(ground.allowed, sets.margins, -np.inf),
        ground.switches,
        ground.hand,
        dict.fromkeys((start.index for start in programs.starts), 0),
        after,
    )
    if path is None:
        return None
    lane = _Lane(sets, ground.switches, ground.hand, ground.allowed, tuple(path))
    search = task.search(ToGo(*np.zeros((2, len(sets)))), lane)
    search.begin()
    return _run(task, search, clock, None, _FIRST / 2)[0]


@dataclass(frozen=True, eq=False)
class _Lane(Ground):
    """A single path of sets."""

    path: tuple[int, ...]

    def beside(self, index: int) -> tuple[IntArray, IntArray]:
        """Return the next set with each number of held contacts."""
        others, held = super().beside(index)
        after = dict(pairwise(self.path))
        kept = others == after.get(index, -1)
        return others[kept], held[kept]


def _run(
    task: _Task, search: RouteSearch, clock: _Clock, best: Shortest | None, part: float = 1.0
) -> tuple[Shortest | None, float]:
    """Search on; return the best route, and the least bound of those that were looked at."""
    closed = np.inf
    if best is not None:
        search.limit = best.cost, best.placements
    while not (search.done or clock.out(part if best else max(part, _SOME))):
        before = search.solved
        found = search.step()
        clock.programs += search.solved - before
        if found is None:
            continue
        closed = min(closed, found.bound)
        route = _realised(task, found)
        if best is None or (route.cost, route.placements) < (best.cost, best.placements):
            best = route
            search.limit = best.cost, best.placements
    return best, closed


def _realised(task: _Task, found: Beginning) -> Shortest:
    """A whole route with its slides."""
    assert found.contacts is not None  # it is whole, and so solved
    return _with_slides(task, found.route, found.placed, found.contacts)


def _with_slides(task: _Task, route: Route, placed: int, contacts: Contacts) -> Shortest:
    sets = task.ground.sets
    size = sets.sources[0].cones.size
    ends = [end.most for end in task.programs.ends(route)]
    grasps, travel, levels = [], 0.0, size * np.min(ends, axis=0)
    for t, index in enumerate(route.path):
        functions = sets.functions(index)
        f, g = contacts.grasps[2 * t : 2 * t + 2]
        way = shortest_slide(functions, f, g, float(contacts.levels[0]) * size)
        way = way[:1] if (f == g).all() else way
        grasps.append(way)
        travel += float((np.abs(np.diff(way, axis=0)) @ functions.lengths[0]).sum())
        given = [way[0]] * (t == 0) + [way[-1]] * (t == len(route.path) - 1)
        for grasp in way:
            if not any(grasp is end or (grasp == end).all() for end in given):
                here = functions.margins(grasp)[0], functions.tolerances(grasp)[0]
                levels = np.minimum(levels, here)
    cost = task.cost(placed, travel, levels)
    margin, tolerance = levels.tolist()
    return Shortest(route, grasps, placed, travel, margin, tolerance, cost, -np.inf, 0)


def _settled(task: _Task, best: Shortest) -> Shortest:
    """The same route at the same cost, with the largest tolerance or, if it is free, less travel.

    As far as one program goes: of what its sets leave open it takes what is satisfied best now.
    """
    old, cones = task.programs, task.ground.sets.sources[0].cones
    levels = np.minimum((best.margin, best.tolerance), old.most * cones.size) / cones.size
    least = np.where(old.weights[1:] > 0, levels - _SAME * np.abs(levels), old.least)
    least = np.maximum(least, old.least)
    most = np.array([least[0], max(least[1], float(cones.lengths.max()) / (2 * cones.size))])
    travels = old.weights[0] > 0
    aims = np.array([0.0, 0.0, 1.0]) if travels else np.array([1.0, 0.0, 0.0])
    programs = RoutePrograms(old.sets, old.starts, old.goals, aims, least, most)
    grasps = [grasp for nodes in best.grasps for grasp in (nodes[0], nodes[-1])]
    travel = best.travel / cones.size if travels else np.inf
    try:
        contacts = programs.settled(best.route, grasps, travel)
    except SolverError:  # what was found is good enough
        return best
    if contacts is None:
        return best
    found = _with_slides(task, best.route, best.placements, contacts)
    dearer = found.cost - best.cost > task.resolution
    better = found.tolerance > best.tolerance if travels else found.travel < best.travel
    return found if better and not dearer else best
