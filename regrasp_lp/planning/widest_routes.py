"""The routes with the largest least margins (or tolerances) in order, no path of sets twice.

Each class of paths (`branches`) is a problem of its own, with the same cut sets and fewer ways. Its
best route is first searched at the level of the route that it was split from, which is often
reached again; only if nothing else reaches that level is the best level of the class searched for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from regrasp_lp.friction import BoolArray, IntArray
from regrasp_lp.planning.bottleneck import Route
from regrasp_lp.planning.branches import EVERYTHING, Best, Branch, best_first
from regrasp_lp.planning.levels import Cut
from regrasp_lp.planning.moves import Contacts, Goal, Moves
from regrasp_lp.planning.widest import Widest, WidestProblem

Allow = Callable[[int, IntArray], BoolArray]


def path_of(route: Route) -> tuple[int, ...]:
    """Return the sets of a route, without immediate repetitions."""
    return tuple(index for index, _ in groupby(leg.index for leg in route.legs))


@dataclass(frozen=True, eq=False)
class WidestRoutes:
    """The best routes of a problem.

    Parameters
    ----------
    problem : WidestProblem
    through : numpy.ndarray of bool, shape (N,), optional
        The sets that a route may pass through; the others it may only begin or end with.
    """

    problem: WidestProblem
    through: BoolArray | None = None
    _to_go: dict[float, Callable[[IntArray], IntArray]] = field(default_factory=dict)

    @cached_property
    def best(self) -> Widest:
        """The best route of all, and the bound of all."""
        if self.through is None:
            return self.problem.solve()
        part = self._part(EVERYTHING)
        return part.direct(self._directs(EVERYTHING)) or part.searched()

    def in_order(self) -> Iterator[Widest]:
        """Yield the best routes, the best one first: by level, then by placements.

        Equal levels are told apart as far as `WidestProblem.solve` does. Routes that return to a
        set that they have left are among them only if no other route of their class is as good.
        """
        for best in best_first(self._solve):
            if best.value is not None:
                yield best.value

    def _solve(self, branch: Branch, known: Best[Widest] | None) -> Best[Widest] | None:
        if known is None:
            return _best(self.best)
        part = self._part(branch)
        if not part.starts or not part.goals:
            return None
        level = -known.key[0]
        if known.path is not None:
            direct = part.direct(self._directs(branch))
            if direct is not None:
                return _best(direct)
            if part.cap < level:
                return Best((-part.cap, 0))
            if level < np.inf:
                route = part.search(level).run()
                if route is None:
                    return Best((-level, np.inf))
                return _best(Widest(route, level, level, 1))
        return _best(replace(part, limit=level).searched())

    def _directs(self, branch: Branch) -> list[Route]:
        return [route for route in self._all_directs if branch.holds(path_of(route))]

    @cached_property
    def _all_directs(self) -> list[Route]:
        return self.problem.directs()

    def _part(self, branch: Branch) -> WidestProblem:
        """The problem of one class."""
        problem = self.problem
        starts = [s for s in problem.starts if branch.starts(s.index)]
        goals = [s for s in problem.goals if branch.ends(s.index)]
        may = _Ways(
            branch,
            self.through,
            np.array([s.index for s in problem.starts]),
            np.array([s.index for s in problem.goals]),
        )
        onward, back = (
            _FewerMoves(problem.moves, allow, problem.goals, self._to_go)
            for allow in (may.onward, may.back)
        )
        return replace(problem, moves=onward, back=back, starts=starts, goals=goals)


def _best(found: Widest) -> Best[Widest] | None:
    if found.route is None:
        return None
    return Best((-found.level, found.route.placements), path_of(found.route), found)


@dataclass(frozen=True, eq=False)
class _Ways:
    """Which sets follow each other on the paths of a class."""

    branch: Branch
    through: BoolArray | None
    starts: IntArray
    goals: IntArray

    def onward(self, one: int, others: IntArray) -> BoolArray:
        """Whether a path may go from one set to others."""
        prefix = self.branch.prefix
        allowed = ~np.isin(others, prefix)
        if one in prefix[:-1]:
            allowed = others == prefix[prefix.index(one) + 1]
        elif prefix and one == prefix[-1]:
            allowed &= ~np.isin(others, list(self.branch.closed))
        if self.through is not None:
            ends = self.goals[~np.isin(self.goals, self.starts)]
            allowed &= self.through[others] | np.isin(others, ends)
            allowed &= bool(self.through[one]) or one in self.starts
        return np.asarray(allowed | (others == one))

    def back(self, one: int, others: IntArray) -> BoolArray:
        """Whether a path may come to one set, a goal, from others."""
        prefix = self.branch.prefix
        allowed = ~np.isin(others, prefix[:-1])
        if one in prefix:
            before = prefix[max(prefix.index(one) - 1, 0)]
            allowed = others == before
        elif prefix and one in self.branch.closed:
            allowed &= others != prefix[-1]
        if self.through is not None:
            allowed &= self.through[others] | np.isin(others, self.starts)
            allowed &= bool(self.through[one]) or one not in self.starts
        return np.asarray(allowed | (others == one))


@dataclass(frozen=True, eq=False)
class _FewerMoves:
    """Some of the switches of an object."""

    moves: Moves
    allow: Allow
    goals: Sequence[Goal]
    bounds: dict[float, Callable[[IntArray], IntArray]]

    def of(self, index: int) -> list[Contacts]:
        """Return the choices of held contacts from one set, by their number, most first."""
        found = [c.take(self.allow(index, c.others)) for c in self.moves.of(index)]
        return [c for c in found if len(c.others)]

    def to_go(self, cut: Cut, goals: Sequence[Goal]) -> Callable[[IntArray], IntArray]:
        """Return a lower bound of the placements to a goal: that with all switches and goals."""
        if cut.level not in self.bounds:
            self.bounds[cut.level] = self.moves.to_go(cut, self.goals)
        return self.bounds[cut.level]
