"""How long the cheapest route is looked for, and what was found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regrasp_lp.friction import FloatArray
from regrasp_lp.planning.route_lp import Route, Slots


@dataclass(frozen=True)
class Budget:
    """When a search is broken off.

    Parameters
    ----------
    programs : int
        Linear programs solved, about 1 ms each.
    seconds : float
    """

    programs: int = 3000
    seconds: float = np.inf


@dataclass(frozen=True, eq=False)
class Shortest:
    """The cheapest route found, and how much cheaper another one may be.

    Parameters
    ----------
    route : Route
        Its grasp sets, what is held between them, and which start and goal it joins.
    grasps : list of numpy.ndarray, shape (N, m)
        Per set the fractions at the ends and bends of its slides.
    placements : int
        With what the goal needs beyond its last set.
    travel : float
        In the object's unit, as margin and tolerance.
    margin, tolerance : float
        The least of the grasps that were chosen, bends and parts of the start and the goal
        included; inf if none was.
    cost, bound : float
        No route whose chosen grasps keep the floor costs less than the bound.
    programs : int
        Number of linear programs solved.
    """

    route: Route
    grasps: list[FloatArray]
    placements: int
    travel: float
    margin: float
    tolerance: float
    cost: float
    bound: float
    programs: int

    @property
    def path(self) -> tuple[int, ...]:
        """Its grasp sets; twice the same in a row means that some fingers are placed anew there."""
        return self.route.path

    @property
    def held(self) -> tuple[Slots, ...]:
        """Per switch, by places in the set before and in the set after it."""
        return self.route.held

    @property
    def gap(self) -> float:
        """How far from the cheapest the route may be, >= 0."""
        return self.cost - self.bound
