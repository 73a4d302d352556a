"""The route with the largest least margin (or tolerance), and the proof that none has a larger.

Any motion whose grasps keep a level is a route through sets cut at it, and the other way round
(`levels`, `bottleneck`): so a search that ends without a route proves that the level is out of
reach, and a route's path LP attains a level. The least level out of reach and the largest one
attained meet at the optimum: no branching, no integers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
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
        # At the bound itself, where most optima are; then where a part of start or goal may be the
        # limit, in the middle of what is left, and just above the best level so far, in turns.
        trial = bound
        while bound - level > accuracy and bound > _LEAST * self.rows.cones.size:
            search = self.search(trial)
            route = search.run()
            searches += 1
            hoped = -np.inf
            if route is not None:
                attained, hoped = self._attained(route)
                best, level = route, max(attained, trial)
            elif search.exhausted:
                bound = min(bound, trial)
                accuracy = self._accuracy(bound)
            else:
                given_up += 1
            if given_up == _PATIENT:
                break
            middle = (level + bound) / 2
            trial = middle if searches % 2 else min(level + accuracy, bound)
            trial = hoped if level + accuracy < hoped < bound else trial
            if given_up:  # neither yes nor no: a lower level may be easier
                trial = (level + trial) / 2
        return Widest(best, level if best is not None else -np.inf, max(bound, level), searches)

    def _accuracy(self, bound: float) -> float:
        """How near to each other levels are told apart."""
        return max(2 * ACCURACY * self.rows.cones.size, _ACCURATE * bound)

    def search(self, level: float) -> Search:
        """Return the search of a route at a level."""
        if level not in self._cuts:
            self._cuts[level] = Cut(self.rows, level, self.solver)
        cut = self._cuts[level]
        return Search(cut, self.moves, self.starts, self.goals, self.patience, self.back)

    def _attained(self, route: Route) -> tuple[float, float]:
        """The level of a route, and the one that others through the same sets may have.

        A part of start or goal has no variables, and so no rows in the path LP. It is in one piece,
        which may leave less of its own level than another one.
        """
        problem = self.path_problem(route)
        x = largest_tolerance(problem, self.solver.name)
        attained = hoped = problem.tolerance(x) * self.rows.cones.size
        for part, piece in self._parts(route, problem):
            attained, hoped = min(attained, part.level_in(piece)), min(hoped, part.level)
        return attained, hoped

    def _parts(
        self, route: Route, problem: PathProblem
    ) -> Iterator[tuple[Support, tuple[int, int]]]:
        """Yield grasps on the way all of whose contacts are given, and the piece of each."""
        last = len(route.legs) - 1
        for t, leg in enumerate(route.legs):
            ids, given = problem.variables[t], problem.given[t]
            for node in range(len(ids) if leg.pieces else 0):
                end = (t, node) in ((0, 0), (last, len(leg.pieces)))
                if not end and (ids[node] < 0).all():
                    piece = leg.pieces[min(node, len(leg.pieces) - 1)]
                    yield Support(self.rows, leg.index, (), given[node]), piece

    def path_problem(self, route: Route) -> PathProblem:
        """Return the path LP of a route."""
        functions = [self.rows.functions(leg.index) for leg in route.legs]
        functions[0], functions[-1] = route.start.functions, route.goal.functions
        stages = [leg.stage(own) for leg, own in zip(route.legs, functions, strict=True)]
        ends = route.start.fractions, route.goal.fractions
        return build_path_problem(
            stages, route.held, *ends, self.rows.measure, apart=_NEARLY_TOGETHER
        )

    def grasps(self, route: Route) -> list[FloatArray]:
        """Return the best grasps along a route, per leg: leximin, then least travel."""
        return solve_path_problem(self.path_problem(route), self.solver.name, leximin=True)

    def directs(self) -> list[Route]:
        """Return the ways from start to goal on which no grasp is chosen."""
        return [
            route
            for start, goal in product(self.starts, self.goals)
            for route in (self._one_slide(start, goal), self._one_switch(start, goal))
            if route is not None
        ]

    def _one_slide(self, start: Support, goal: Support) -> Route | None:
        """One slide that never falls below the smaller of the two given grasps."""
        touching = start.part is not start or goal.part is not goal
        if start.index != goal.index or touching:
            return None
        functions = self.rows.functions(start.index)
        along = least_margin_along if self.rows.measure == "margin" else least_tolerance_along
        least = along(functions, start.fractions, goal.fractions)
        if least < min(start.level, goal.level) - ACCURACY * self.rows.cones.size:
            return None
        # Any piece will do: there is nothing to choose.
        leg = Leg(start.index, tuple(start.inside(-np.inf)[:1]))
        return Route((leg,), (), start, goal, 0)

    def _one_switch(self, start: Support, goal: Support) -> Route | None:
        """One switch that holds what start and goal have in common."""
        mine, theirs = (
            list(zip(end.edges.tolist(), end.fractions.tolist(), strict=True))
            for end in (start, goal)
        )
        held = tuple((mine.index(c), n) for n, c in enumerate(theirs) if c in mine)
        if len(mine) + len(theirs) - len(held) > self.hand.fingers:
            return None
        legs = Leg(start.index, ()), Leg(goal.index, ())
        return Route(legs, (held,), start, goal, len(theirs) - len(held))
