"""The route with the largest least margin (or tolerance), and the proof that none has a larger.

Any motion whose grasps keep a level is a route through sets cut at it, and the other way round
(`levels`, `bottleneck`): so a search that ends without a route proves that the level is out of
reach, and a route's path LP attains a level. The least level out of reach and the largest one
attained meet at the optimum: no branching, no integers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np

from regrasp_lp.friction import FloatArray
from regrasp_lp.lp import Solver
from regrasp_lp.planning.along import least_margin_along, least_tolerance_along
from regrasp_lp.planning.bottleneck import Leg, Route, Search
from regrasp_lp.planning.ends import Support
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.levels import ACCURACY, Cut, PieceRows
from regrasp_lp.planning.moves import Moves
from regrasp_lp.planning.path_lp import PathProblem, build_path_problem
from regrasp_lp.planning.path_optimum import largest_tolerance, solve_path_problem

_NEARLY_TOGETHER = 1e-6
"""As `apart` of `piece_sets`: no two fingers at one point, at next to no cost."""

_ACCURATE = 1e-7
"""Of the optimum: levels that differ by less are not told apart."""

_PATIENT = 3
"""How many searches may be given up before the best so far is taken, with a gap."""

_LEAST = 1e-6
"""Of the object's size: levels below are not searched for, and the optimum is only bounded."""


@dataclass(frozen=True, eq=False)
class Widest:
    """The best route that was found, and how good any route can be.

    Parameters
    ----------
    route : Route or None
        None if none was found.
    level : float
        The least margin or tolerance of what is chosen on it; inf if nothing is.
    bound : float
        No route has a larger one.
    searches : int
        How many levels were searched.
    """

    route: Route | None
    level: float
    bound: float
    searches: int


@dataclass(frozen=True, eq=False)
class WidestProblem:
    """What the best route is searched in.

    Parameters
    ----------
    rows : PieceRows
        Of margins or of tolerances.
    moves : Moves
    hand : Hand
    solver : Solver
    starts, goals : sequence of Support
        The sets that hold the given grasps.
    patience : int
        How many parts of cut sets one search may visit.
    back : Moves, optional
        The switches from the goals backwards, if they are others than `moves`.
    limit : float
        Levels above are known to be out of reach.
    """

    rows: PieceRows
    moves: Moves
    hand: Hand
    solver: Solver
    starts: Sequence[Support]
    goals: Sequence[Support]
    patience: int = 1200
    back: Moves | None = None
    limit: float = np.inf
    _cuts: dict[float, Cut] = field(default_factory=dict)

    def solve(self) -> Widest:
        """Return the best route: the largest level first, then the fewest placements."""
        return self.direct(self.directs()) or self.searched()

    def direct(self, routes: Sequence[Route]) -> Widest | None:
        """Return the one with the fewest placements of routes on which no grasp is chosen."""
        if not routes:
            return None
        return Widest(min(routes, key=lambda route: route.placements), np.inf, np.inf, 0)

    @cached_property
    def cap(self) -> float:
        """A level that no way away from the start exceeds, or none to the goal."""
        ends = (self.starts, self.moves), (self.goals, self.back or self.moves)
        return min(max(s.cap(moves) for s in supports) for supports, moves in ends)

    def searched(self) -> Widest:
        """Return the best route on which grasps are chosen."""
        bound = min(self.cap, self.limit)
        accuracy = self._accuracy(bound)
        best: Route | None = None
        level, given_up, searches = 0.0, 0, 0
        # At the bound itself, where most optima are; then in the middle of what is left (or where
        # a part of start or goal is the limit), and just above the best level so far, in turns.
        trial = bound
        while bound - level > accuracy and bound > _LEAST * self.rows.cones.size:
            search = self.search(trial)
            route = search.run()
            searches += 1
            if route is not None:
                best, level = route, max(self._attained(route), trial)
            elif search.exhausted:
                bound = min(bound, trial)
                accuracy = self._accuracy(bound)
            else:
                given_up += 1
            if given_up == _PATIENT:
                break
            middle = self._middle(level + accuracy, bound - accuracy)
            trial = middle if searches % 2 else min(level + accuracy, bound)
            if given_up:  # neither yes nor no: a lower level may be easier
                trial = (level + trial) / 2
        return Widest(best, level if best is not None else -np.inf, max(bound, level), searches)

    def _middle(self, low: float, high: float) -> float:
        """The middle of two levels, or the nearest to it at which a way over a part of an end ends."""
        middle = (low + high) / 2
        limits = [s.limit for s in (*self.starts, *self.goals) if low < s.limit < high]
        return min(limits, key=lambda limit: abs(limit - middle), default=middle)

    def _accuracy(self, bound: float) -> float:
        """How near to each other levels are told apart."""
        return max(2 * ACCURACY * self.rows.cones.size, _ACCURATE * bound)

    def search(self, level: float) -> Search:
        """Return the search of a route at a level."""
        if level not in self._cuts:
            self._cuts[level] = Cut(self.rows, level, self.solver)
        cut = self._cuts[level]
        return Search(cut, self.moves, self.starts, self.goals, self.patience, self.back)

    def _attained(self, route: Route) -> float:
        problem = self.path_problem(route)
        x = largest_tolerance(problem, self.solver.name)
        ends = (route.start, route.legs[0].pieces[:1]), (route.goal, route.legs[-1].pieces[-1:])
        chosen = [end.level_in(piece) for end, pieces in ends for piece in pieces if end.chosen]
        return min(problem.tolerance(x) * self.rows.cones.size, *chosen, np.inf)

    def path_problem(self, route: Route) -> PathProblem:
        """Return the path LP of a route."""
        stages = [leg.stage(self.rows.functions(leg.index)) for leg in route.legs]
        ends = route.start.fractions, route.goal.fractions
        return build_path_problem(
            stages, route.held, *ends, self.rows.measure, apart=_NEARLY_TOGETHER
        )

    def grasps(self, route: Route) -> list[FloatArray]:
        """Return the best grasps along a route, per leg: leximin, then least travel."""
        return solve_path_problem(self.path_problem(route), self.solver.name, leximin=True)

    def loosened(self) -> WidestProblem:
        """Return the problem in which parts of start and goal do not count that need not.

        While all contacts of the start touch, a part of it may hold the object until what comes
        next is placed; and the same backwards from the goal. Of complete sets there is one for the
        whole, which can then be switched as well; among others there may be none.
        """
        starts = _loosened(self.starts, self.moves, self.hand)
        goals = _loosened(self.goals, self.back or self.moves, self.hand)
        if not any(old != new for old, new in zip((*self.starts, *self.goals), (*starts, *goals), strict=True)):
            return self
        return replace(self, starts=starts, goals=goals)

    def directs(self) -> list[Route]:
        """Return the ways from start to goal on which no grasp is chosen."""
        return [
            route
            for start, goal in product(self.starts, self.goals)
            if not (start.chosen or goal.chosen)
            for route in (self._one_slide(start, goal), self._one_switch(start, goal))
            if route is not None
        ]

    def _one_slide(self, start: Support, goal: Support) -> Route | None:
        """One slide that never falls below the smaller of the two given grasps."""
        if start.index != goal.index:
            return None
        functions = self.rows.functions(start.index)
        along = least_margin_along if self.rows.measure == "margin" else least_tolerance_along
        least = along(functions, start.fractions, goal.fractions)
        if least < min(start.level, goal.level) - ACCURACY * self.rows.cones.size:
            return None
        # Any piece will do: there is nothing to choose.
        leg = Leg(start.index, tuple(start.inside(-np.inf)[:1]))
        return Route((leg,), (), start, goal, goal.others)

    def _one_switch(self, start: Support, goal: Support) -> Route | None:
        """One switch that holds what start and goal have in common."""
        mine = [(e, f) for e, f in zip(*_places(start), strict=True)]
        theirs = [(e, f) for e, f in zip(*_places(goal), strict=True)]
        held = tuple((mine.index(c), n) for n, c in enumerate(theirs) if c in mine)
        if len(mine) + len(theirs) - len(held) > self.hand.fingers:
            return None
        legs = Leg(start.index, ()), Leg(goal.index, ())
        return Route(legs, (held,), start, goal, len(theirs) - len(held) + goal.others)


def _loosened(ends: Sequence[Support], moves: Moves, hand: Hand) -> list[Support]:
    """The supports of start or goal; those count for nothing that can do what the whole cannot."""
    whole = [c.others for s in ends if not s.chosen for c in moves.of(s.index)]
    reached = np.concatenate((*whole, np.zeros(0, dtype=np.intp)))
    found = []
    for support in ends:
        free = False
        for contacts in moves.of(support.index) if support.chosen else ():
            contacts_there = support.rows.contacts[contacts.others]
            touching = len(support.fractions) + contacts_there - contacts.held
            beside = touching <= hand.fingers  # other contacts of the given grasp may be theirs
            free |= not np.isin(contacts.others[beside], reached).all()
        found.append(replace(support, chosen=False) if free else support)
    return found


def _places(support: Support) -> tuple[list[int], list[float]]:
    edges = support.rows.edges[support.index]
    return edges[edges >= 0].tolist(), support.fractions.tolist()
