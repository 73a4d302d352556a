"""From two grasps to a verified plan."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import islice

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.errors import HandError, NoPlanFound, SolverError
from regrasp_lp.friction import BoolArray, FloatArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.lp import Solver
from regrasp_lp.planning.alternatives import (
    PATIENCE,
    Alternative,
    distinct,
    in_order,
    merged,
    remembered,
)
from regrasp_lp.planning.bottleneck import Route
from regrasp_lp.planning.clearing import clearing_search
from regrasp_lp.planning.costs import Budget
from regrasp_lp.planning.ends import Support, supports
from regrasp_lp.planning.fingers import Fingers
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.levels import PieceRows
from regrasp_lp.planning.moves import KnownMoves
from regrasp_lp.planning.objective import PLACEMENTS, Objective
from regrasp_lp.planning.performance import Passage, perform
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.route_lp import Terminal
from regrasp_lp.planning.search import PathSearch
from regrasp_lp.planning.set_path import passage_along
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
        if aligning == "regrip" and self.hand.coupled:
            raise HandError(
                "aligning by repositioning is not for a hand with max_span, fingertip_separation "
                'or limits of single fingers: use aligning="slide"'
            )
        if set(start) == set(goal):
            return iter([self._nothing_to_do(start, goal, objective)])
        if objective.name in ("margin", "tolerance"):
            return distinct(self._widest(start, goal, aligning, objective, steering))
        if objective.name == "placements":
            return distinct(self._fewest(start, goal, aligning, steering))
        return distinct(iter(self._cheapest(start, goal, aligning, objective, steering)))

    def _nothing_to_do(self, start: Grasp, goal: Grasp, objective: Objective) -> Plan:
        index, chosen = Fingers(self.sets, self.hand).starts(start)[0]
        passage = Passage((index,), (), (self._fractions(index, start, chosen)[None],), chosen)
        plan = perform(self, passage, start, goal, "slide")
        return replace(plan, objective=objective, bound=objective.value(plan))

    def _fewest(
        self, start: Grasp, goal: Grasp, aligning: str, steering: Steering
    ) -> Iterator[Plan]:
        """The plans with the fewest placements."""
        fingers = Fingers(self.sets, self.hand)
        passable, through = fingers.passable(start), steering.through
        if passable is not None:
            through = passable if through is None else through & passable
        sources, targets = ends = (
            _first_choices(fingers.starts(start), passable),
            _first_choices(fingers.goals(goal), passable),
        )
        search = PathSearch(
            self.sets.contacts,
            self.sets.margins,
            remembered(self.switches),
            self.hand,
            dict.fromkeys(sources, 0),
            {i: len(goal) - len(chosen) for i, chosen in targets.items()},
            self._given((start, sources), (goal, targets)),
            through,
            steering.weigh,
        )
        if search.first is None:
            return
        searches = [search]
        if aligning == "regrip":
            # In two-finger sets more fingers are free, so that aligning there takes fewer.
            margins = np.where(self.sets.contacts == 3, -np.inf, self.sets.margins)
            searches.append(replace(search, margins=margins))
        make = partial(self._along, start=start, goal=goal, ends=ends, aligning=aligning)
        runs = [self._in_order(each, make) for each in searches]
        if self.hand.only_place:
            clearing = clearing_search(search, fingers, start, goal)
            runs = [self._clearing(clearing, make)]
        bound = None if steering.weigh else float(search.first[0][1])
        for plan in merged(runs):
            yield replace(plan, objective=PLACEMENTS, bound=bound)

    def _in_order(
        self, search: PathSearch, make: Callable[[tuple[int, ...]], Plan]
    ) -> Iterator[Alternative]:
        thin = search.margins <= _THIN * self.sets.polygon.diameter
        return in_order(search, make, thin)

    def _clearing(self, search: PathSearch, make: Callable[..., Plan]) -> Iterator[Alternative]:
        """Plans of fingers that do not slide; where they tie too much together, holding less."""
        if search.first is None:
            raise SolverError(
                "no path of sets is found along which the fingers that do not slide (only_place) "
                "come off where they are and back elsewhere; this does not prove that there is none"
            )
        try:
            yield from self._in_order(search, make)
        except SolverError as failure:
            _LOG.info("fewer contacts are held, because %s", failure)
            yield from self._in_order(search, partial(make, few=True))

    def _along(
        self,
        path: tuple[int, ...],
        start: Grasp,
        goal: Grasp,
        ends: tuple[Choices, Choices],
        aligning: str,
        few: bool = False,
    ) -> Plan:
        """The verified plan along a path of sets, or of nodes that stand for sets."""
        path = tuple(node % len(self.sets) for node in path)
        first, last = ends[0][path[0]], ends[1][path[-1]]
        here = self._fractions(path[0], start, first)
        there = self._fractions(path[-1], goal, last)
        passage = passage_along(self, path, first, here, there, few=few)
        return perform(self, passage, start, goal, aligning)

    def _widest(
        self, start: Grasp, goal: Grasp, aligning: str, objective: Objective, steering: Steering
    ) -> Iterator[Plan]:
        """The plans with the largest least margin or tolerance, by pieces cut at a level."""
        rows = self._margin_rows if objective.name == "margin" else self._tolerance_rows
        moves = KnownMoves(rows, remembered(self.switches), self.hand)
        first, last = (self._supports(rows, grasp) for grasp in (start, goal))
        search = WidestProblem(rows, moves, self.hand, self.solver, first, last)
        routes = WidestRoutes(search, steering.through)
        found = replace(routes.best, bound=self._bound(routes.best, search, start, goal))
        if self.hand.coupled:
            # Routes do not know of limits between fingers: these are bounds only.
            found = replace(found, route=None)
        grasps = [] if found.route is None else search.grasps(found.route)
        best = self.along_route(found, grasps, start, goal, aligning, objective, steering)
        if best is None:
            return
        yield best
        if self.hand.coupled:
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

    def _bound(self, found: Widest, search: WidestProblem, start: Grasp, goal: Grasp) -> float:
        """The bound of a search, for margins as grasps have them.

        The functions of a parallel set are the chapter's, with margins below those of its grasps;
        so the bound is that of the same search with all functions of its edges.
        """
        families = self.sets.families
        if self._chapters and len(self.hand.groups) > 1:
            return np.inf  # which finger is where while all of the start touches is not known
        if all(family.kind != "parallel" for family in families) or np.isinf(found.bound):
            return found.bound
        every = [torque_functions(f.functions.cones, f.functions.edges) for f in families]
        rows = PieceRows(every, search.rows.measure)
        moves = KnownMoves(rows, remembered(self.switches), self.hand)
        first, last = (self._supports(rows, grasp) for grasp in (start, goal))
        search = WidestProblem(rows, moves, self.hand, self.solver, first, last)
        return search.solve().bound

    def _supports(self, rows: PieceRows, grasp: Grasp) -> list[Support]:
        return supports(rows, self.sets, grasp, self.hand.fingers, every=not self._chapters)

    @property
    def _chapters(self) -> bool:
        """Whether the sets are the chapter's, which do not hold all grasps."""
        return any(family.kind in ("concurrent", "parallel") for family in self.sets.families)

    def _cheapest(
        self, start: Grasp, goal: Grasp, aligning: str, objective: Objective, steering: Steering
    ) -> list[Plan]:
        """Plans of little travel or cost, the best of those that were found first.

        The one along the best route; and those with the fewest placements, by sliding and by
        repositioning, which takes no travel at all.
        """
        if self.hand.coupled:
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
        found = []
        for i, some in self.sets.holding(grasp):
            f, left = self._fractions(i, grasp, some), len(grasp) - len(some)
            end = Terminal(i, f, left)
            if left and not self._chapters:  # these may hold while all of the grasp touches
                functions, size = self.sets.functions(i), self.sets.cones.size
                levels = float(functions.margins(f)[0]), float(functions.tolerances(f)[0])
                end = replace(end, most=(levels[0] / size, levels[1] / size))
            found.append(end)
        return found

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
        held, grasps = list(route.held), list(grasps)
        first, last = route.start.part, route.goal.part
        touching = first is not route.start, last is not route.goal
        for n, part in ((0, first), (-1, last)):
            if touching[n]:  # fingers are known by where they are
                held[n], grasps[n] = (), part.fractions[None]
        passage = Passage(path, tuple(held), tuple(grasps), first.contacts, stages, touching)
        return perform(self, passage, start, goal, aligning)

    def _fractions(self, index: int, grasp: Grasp, chosen: tuple[int, ...]) -> FloatArray:
        """The contacts of a given grasp that a set holds, as fractions of what can be touched."""
        return self.sets.fractions(index, grasp.fractions[list(chosen)])

    def _given(self, *ends: tuple[Grasp, Choices]) -> dict[int, float]:
        """Margin of the given contacts in each set that holds the start or the goal."""
        margins: dict[int, float] = {}
        for grasp, choices in ends:
            for index, chosen in choices.items():
                functions = self.sets.functions(index).whole
                margin = float(functions.margins(grasp.fractions[list(chosen)])[0])
                margins[index] = min(margin, margins.get(index, margin))
        return margins


def _first_choices(held: list[tuple[int, tuple[int, ...]]], passable: BoolArray | None) -> Choices:
    """Sets that hold a grasp or some of its contacts; of each the first choice of these."""
    choices: Choices = {}
    for index, chosen in held:
        if passable is None or passable[index]:
            choices.setdefault(index, chosen)
    return choices


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
