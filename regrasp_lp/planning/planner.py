"""From two grasps to a verified plan."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import islice, pairwise

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.errors import HandError, NoPlanFound, SolverError
from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.grasp_sets.set_pieces import with_rows
from regrasp_lp.handovers import Handover, handovers
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import Solver
from regrasp_lp.planning.aligning import PieceChains
from regrasp_lp.planning.alternatives import PATIENCE, distinct, in_order, merged, remembered
from regrasp_lp.planning.bottleneck import Route
from regrasp_lp.planning.costs import Budget
from regrasp_lp.planning.ends import supports
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.levels import PieceRows
from regrasp_lp.planning.moves import KnownMoves
from regrasp_lp.planning.objective import PLACEMENTS, Objective
from regrasp_lp.planning.path_lp import Stage, build_path_problem
from regrasp_lp.planning.path_optimum import solve_path_problem
from regrasp_lp.planning.performance import Passage, perform
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.route_lp import Terminal
from regrasp_lp.planning.search import PathSearch
from regrasp_lp.planning.shortest import shortest_route
from regrasp_lp.planning.steering import FREE, Steering
from regrasp_lp.planning.widest import Widest, WidestProblem
from regrasp_lp.planning.widest_routes import WidestRoutes
from regrasp_lp.switches import Switches
from regrasp_lp.torque import torque_functions

_LOG = logging.getLogger("regrasp_lp")

_MANY, _FEW = 3000, 400
"""How many programs a search for the least cost may take, fewer if only placements can fall."""

_THIN = 1e-9
"""Margin of a set, in the object's size, up to which it may be too thin for a solver."""

Choices = dict[int, tuple[int, ...]]
"""The sets that contain a grasp, and which of its contacts are theirs."""


@dataclass(frozen=True, eq=False)
class PlanningProblem:
    """What a plan is searched in: the sets of an object, their switches, a hand.

    Parameters
    ----------
    sets : GraspSets
    switches : Switches
    hand : Hand
    friction : numpy.ndarray, shape (n_edges,)
    solver : Solver
    """

    sets: GraspSets
    switches: Switches
    hand: Hand
    friction: FloatArray
    solver: Solver

    @cached_property
    def _margin_rows(self) -> PieceRows:
        return PieceRows(self.sets.sources, "margin")

    @cached_property
    def _tolerance_rows(self) -> PieceRows:
        return PieceRows(self.sets.sources, "tolerance")

    def plan(
        self,
        start: Grasp,
        goal: Grasp,
        aligning: str,
        objective: Objective,
        steering: Steering = FREE,
    ) -> Plan | None:
        """Return the best verified plan between two checked grasps, or None if no path joins them.

        Raises
        ------
        NoPlanFound
            If aligning by repositioning lacks a free finger.
        SolverError
            If the plan found does not pass its own exact check.
        """
        return next(self.plans(start, goal, aligning, objective, steering), None)

    def plans(
        self,
        start: Grasp,
        goal: Grasp,
        aligning: str,
        objective: Objective,
        steering: Steering = FREE,
    ) -> Iterator[Plan]:
        """Yield verified plans along different paths of sets, the best first; raises as `plan`."""
        if aligning == "regrip" and self.hand.spaced:
            raise HandError(
                "aligning by repositioning is not for a hand with max_span or "
                'fingertip_separation: use aligning="slide"'
            )
        if set(start) == set(goal):
            return iter([self._nothing_to_do(start, goal, objective)])
        if objective.name in ("margin", "tolerance"):
            return distinct(self._widest(start, goal, aligning, objective, steering))
        if objective.name == "placements":
            return distinct(self._fewest(start, goal, aligning, steering))
        return distinct(iter(self._cheapest(start, goal, aligning, objective, steering)))

    def _nothing_to_do(self, start: Grasp, goal: Grasp, objective: Objective) -> Plan:
        index, chosen = self.sets.holding(start)[0]
        passage = Passage((index,), (), (self._fractions(index, start, chosen)[None],), chosen)
        plan = perform(self, passage, start, goal, "slide")
        return replace(plan, objective=objective, bound=objective.value(plan))

    def _fewest(
        self, start: Grasp, goal: Grasp, aligning: str, steering: Steering
    ) -> Iterator[Plan]:
        """The plans with the fewest placements."""
        sources, targets = ends = dict(self._choices(start)), dict(self._choices(goal))
        search = PathSearch(
            self.sets.contacts,
            self.sets.margins,
            remembered(self.switches),
            self.hand,
            dict.fromkeys(sources, 0),
            {i: len(goal) - len(chosen) for i, chosen in targets.items()},
            self._given((start, sources), (goal, targets)),
            steering.through,
            steering.weigh,
        )
        if search.first is None:
            return
        searches = [search]
        if aligning == "regrip":
            # In two-finger sets more fingers are free, so that aligning there takes fewer.
            margins = np.where(self.sets.contacts == 3, -np.inf, self.sets.margins)
            searches.append(replace(search, margins=margins))
        thin = self.sets.margins <= _THIN * self.sets.polygon.diameter
        make = partial(self._along, start=start, goal=goal, ends=ends, aligning=aligning)
        bound = None if steering.weigh else float(search.first[0][1])
        for plan in merged(in_order(each, make, thin) for each in searches):
            yield replace(plan, objective=PLACEMENTS, bound=bound)

    def _along(
        self,
        path: tuple[int, ...],
        start: Grasp,
        goal: Grasp,
        ends: tuple[Choices, Choices],
        aligning: str,
    ) -> Plan:
        """The verified plan along a path of sets."""
        first, last = ends[0][path[0]], ends[1][path[-1]]
        here = self._fractions(path[0], start, first)
        there = self._fractions(path[-1], goal, last)
        switches = [self._handover(i, j) for i, j in pairwise(path)]
        stages = self._stages(path, switches, here, there)
        held = tuple(switch.slots for switch in switches)
        couplings = [
            self._coupling(i, j, s) for (i, j), s in zip(pairwise(path), switches, strict=True)
        ]
        problem = build_path_problem(stages, held, here, there, couplings=couplings)
        grasps = solve_path_problem(problem, self.solver.name)
        passage = Passage(path, held, tuple(grasps), first, tuple(stages))
        return perform(self, passage, start, goal, aligning)

    def _widest(
        self, start: Grasp, goal: Grasp, aligning: str, objective: Objective, steering: Steering
    ) -> Iterator[Plan]:
        """The plans with the largest least margin or tolerance, by pieces cut at a level."""
        rows = self._margin_rows if objective.name == "margin" else self._tolerance_rows
        moves = KnownMoves(rows, remembered(self.switches), self.hand)
        first, last = (supports(rows, self.sets, grasp) for grasp in (start, goal))
        search = WidestProblem(rows, moves, self.hand, self.solver, first, last)
        routes = WidestRoutes(search, steering.through)
        found = replace(routes.best, bound=self._bound(routes.best, start, goal, objective))
        if self.hand.spaced:
            # Routes do not know of limits between fingers: these are bounds only.
            found = replace(found, route=None)
        grasps = [] if found.route is None else search.grasps(found.route)
        best = self.along_route(found, grasps, start, goal, aligning, objective, steering)
        if best is None:
            return
        yield best
        if self.hand.spaced:
            return
        failed = 0
        for found in islice(routes.in_order(), 1, None):
            assert found.route is not None
            try:
                grasps = search.grasps(found.route)
                plan = self._on_route(found.route, grasps, start, goal, aligning)
            except (SolverError, NoPlanFound):
                failed += 1
                if failed == PATIENCE:
                    return
                continue
            failed = 0
            yield replace(plan, objective=objective, bound=best.bound)

    def _bound(self, found: Widest, start: Grasp, goal: Grasp, objective: Objective) -> float:
        """The bound of a search, for margins as grasps have them.

        The functions of a parallel set are the chapter's, with margins below those of its grasps;
        so the bound is that of the same search with all functions of its edges.
        """
        families = self.sets.families
        if all(family.kind != "parallel" for family in families) or np.isinf(found.bound):
            return found.bound
        every = [torque_functions(f.functions.cones, f.functions.edges) for f in families]
        rows = PieceRows(every, "margin" if objective.name == "margin" else "tolerance")
        moves = KnownMoves(rows, remembered(self.switches), self.hand)
        first, last = (supports(rows, self.sets, grasp) for grasp in (start, goal))
        return WidestProblem(rows, moves, self.hand, self.solver, first, last).solve().bound

    def _cheapest(
        self, start: Grasp, goal: Grasp, aligning: str, objective: Objective, steering: Steering
    ) -> list[Plan]:
        """Plans of little travel or cost, the best of those that were found first.

        The one along the best route; and those with the fewest placements, by sliding and by
        repositioning, which takes no travel at all.
        """
        if self.hand.spaced:
            fewest = islice(self._fewest(start, goal, aligning, steering), 1)
            return [replace(plan, objective=objective, bound=None) for plan in fewest]
        starts = [replace(end, placed=0) for end in self._terminals(start)]
        plans: list[Plan] = []
        failures: list[SolverError | NoPlanFound] = []
        for how in dict.fromkeys((aligning, "regrip" if objective.name == "travel" else aligning)):
            with _noting(failures):
                plans += islice(self._fewest(start, goal, how, steering), 1)
        best = min((objective.value(plan) for plan in plans), default=np.inf)
        found, bound = None, 0.0 if objective.name == "travel" else -np.inf
        with _noting(failures):  # there may be no route within the budget
            found = shortest_route(
                self.sets,
                remembered(self.switches),
                self.hand,
                starts,
                self._terminals(goal),
                objective,
                budget=Budget(_FEW if best == bound else _MANY),
                allowed=steering.through,
            )
        bound = bound if found is None else max(bound, found.bound)
        if found is not None and aligning == "slide":
            chosen = self.sets.holding(start)[found.route.origin][1]
            passage = Passage(found.path, found.held, tuple(found.grasps), chosen)
            with _noting(failures):
                plans.append(perform(self, passage, start, goal, aligning))
        if not plans:
            if failures:  # neither a plan nor the proof that there is none
                raise failures[0]
            return []
        rounding = _THIN * self.sets.polygon.diameter
        plans.sort(key=lambda p: (np.round(objective.value(p) / rounding), p.placements))
        best = objective.value(plans[0])
        bound = best if best - bound <= rounding else bound
        return [replace(plan, objective=objective, bound=bound) for plan in plans]

    def _terminals(self, grasp: Grasp) -> list[Terminal]:
        """The sets that hold a given grasp, and how many of its contacts each leaves out."""
        return [
            Terminal(i, self._fractions(i, grasp, chosen), len(grasp) - len(chosen))
            for i, chosen in self.sets.holding(grasp)
        ]

    def along_route(
        self,
        found: Widest,
        grasps: list[FloatArray],
        start: Grasp,
        goal: Grasp,
        aligning: str,
        objective: Objective,
        steering: Steering = FREE,
    ) -> Plan | None:
        """Return the verified plan along a route, or that with the fewest placements if better.

        Parameters
        ----------
        found : Widest
        grasps : list of numpy.ndarray
            Of each leg of its route; none if there is no route.
        start, goal : Grasp
        aligning : {"slide", "regrip"}
        objective : Objective
        steering : Steering

        Returns
        -------
        Plan or None
            None if no path of sets joins the two grasps.
        """
        plans = []
        if found.route is not None:
            # Within rounding of its bound, or not without sliding: another plan may do.
            with _noting([]):
                plans.append(self._on_route(found.route, grasps, start, goal, aligning))
        if not plans or objective.gap(objective.value(plans[0]), found.bound) > 0:
            plans += islice(self._fewest(start, goal, aligning, steering), 1)
        if not plans:
            return None
        best = max(plans, key=objective.value)
        return replace(best, objective=objective, bound=max(found.bound, objective.value(best)))

    def _on_route(
        self, route: Route, grasps: list[FloatArray], start: Grasp, goal: Grasp, aligning: str
    ) -> Plan:
        """The verified plan along a route."""
        path = tuple(leg.index for leg in route.legs)
        stages = tuple(leg.stage(self.sets.functions(leg.index)) for leg in route.legs)
        passage = Passage(path, route.held, tuple(grasps), route.start.contacts, stages)
        return perform(self, passage, start, goal, aligning)

    def _fractions(self, index: int, grasp: Grasp, chosen: tuple[int, ...]) -> FloatArray:
        """The contacts of a given grasp that a set holds, as fractions of what can be touched."""
        return self.sets.fractions(index, grasp.fractions[list(chosen)])

    def _choices(self, grasp: Grasp) -> list[tuple[int, tuple[int, ...]]]:
        """Sets that contain the grasp or two of its contacts; of each the first choice."""
        choices: Choices = {}
        for index, chosen in self.sets.holding(grasp):
            choices.setdefault(index, chosen)
        return sorted(choices.items())

    def _given(self, *ends: tuple[Grasp, Choices]) -> dict[int, float]:
        """Margin of the given contacts in each set that holds the start or the goal."""
        margins: dict[int, float] = {}
        for grasp, choices in ends:
            for index, chosen in choices.items():
                functions = self.sets.functions(index).whole
                margin = float(functions.margins(grasp.fractions[list(chosen)])[0])
                margins[index] = min(margin, margins.get(index, margin))
        return margins

    def _handover(self, first: int, second: int) -> Handover:
        """The best way to switch that holds as many contacts as possible."""
        others, held = self.switches.neighbors(first)
        found = held[others == second]
        count = int(found[0]) if found.size else 0
        return handovers(self.sets, self.solver, first, second, count)[0]

    def _stages(
        self, path: tuple[int, ...], switches: list[Handover], start: FloatArray, goal: FloatArray
    ) -> list[Stage]:
        """The chain of pieces through each set, from where it is entered to where it is left."""
        arrivals = [start, *(switch.second for switch in switches)]
        leavings = [*(switch.first for switch in switches), goal]
        stages = []
        for index, f, g in zip(path, arrivals, leavings, strict=True):
            chains = PieceChains(self.sets.pieces(index), self.solver)
            pieces, _ = chains.chain(f, g)
            parts = chains.parts.take(np.array(pieces))
            limits = parts if self.hand.spaced else None
            stages.append(Stage(chains.functions, parts.pieces, limits=limits))
        return stages

    def _coupling(self, first: int, second: int, handover: Handover) -> LinearSets | None:
        """What limits the distances between the fingers of both grasps of a switch."""
        found = self.sets.coupled(first, second, handover.slots)
        if found is None or handover.way is None:
            return None
        rows, bounds = found.rows[[handover.way]], found.bounds[[handover.way]]
        n = rows.shape[2]
        none, box = np.zeros((1, 0, n)), np.zeros((1, n))
        names = tuple(f"x{i}" for i in range(n))
        free = LinearSets(names, none, none[:, :, 0], none[:, :, 0], box, box + 1.0)
        return with_rows(free, rows, bounds, "tolerance")


@contextmanager
def _noting(failures: list[SolverError | NoPlanFound]) -> Iterator[None]:
    """Keep what goes wrong with one plan where another may do; a solver's failure is logged."""
    try:
        yield
    except SolverError as failure:
        _LOG.warning("one plan is left out: %s", failure)
        failures.append(failure)
    except NoPlanFound as refusal:
        failures.append(refusal)
