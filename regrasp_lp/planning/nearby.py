"""Planning without listing all grasp sets: sets are made where a search gets to.

For a hand of four fingers and complete sets. The fewest placements are found from both ends
(`on_demand`). For the largest margin or tolerance a graph over some of the edges is searched, those
of the best neighbours of start and goal among them. The bound is one for all edges: how good a
grasp next to the start or the goal can be, or, just above the best plan, the proof that a search
from one of them over all edges gets nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.contact_rule import meet_held
from regrasp_lp.friction import Cones, FloatArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.grasp_sets.pieces import Measure
from regrasp_lp.grasp_sets.vertices import build_family, kinds_of
from regrasp_lp.lp import Solver
from regrasp_lp.planning.bottleneck import Search
from regrasp_lp.planning.ends import Support, supports
from regrasp_lp.planning.growing import GrowingMoves
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.levels import Cut, PieceRows
from regrasp_lp.planning.objective import PLACEMENTS, Objective
from regrasp_lp.planning.on_demand import path_on_demand, problem_on_demand, problem_over
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.planner import PlanningProblem
from regrasp_lp.planning.widest import WidestProblem
from regrasp_lp.polygon import Polygon
from regrasp_lp.switches import StoredSwitches, SwitchRule
from regrasp_lp.torque import torque_functions

_WHOLE = 64
"""Up to so many edges all of them are taken."""

_SOME = (24, 52)
"""Otherwise so many, one number after the other."""

_PATIENCE = 25
"""How many parts of cut sets a search over all edges may visit."""

_ABOVE = 1e-6
"""A level above that of a plan by this part is out of reach, if the plan is the best."""


def plan_on_demand(
    polygon: Polygon,
    cones: Cones,
    solver: Solver,
    start: Grasp,
    goal: Grasp,
    aligning: str,
    objective: Objective,
) -> Plan | None:
    """Return the best plan between two grasps without listing all grasp sets, or None.

    Parameters
    ----------
    polygon : Polygon
    cones : Cones
        Of whole edges.
    solver : Solver
    start, goal : Grasp
        Resolved.
    aligning : {"slide", "regrip"}
    objective : Objective

    Returns
    -------
    Plan or None
        None if no path joins the two grasps.
    """
    if objective.name in ("margin", "tolerance") and set(start) != set(goal):
        return _widest(polygon, cones, solver, start, goal, aligning, objective)
    problem = problem_on_demand(polygon, cones, solver, start, goal, all_pairs=aligning == "regrip")
    plan = None if problem is None else problem.plan(start, goal, aligning, objective)
    if plan is None or objective.name == "placements" or set(start) == set(goal):
        return plan
    return replace(plan, bound=_least_cost(polygon, cones, solver, start, goal, objective))


def _least_cost(
    polygon: Polygon,
    cones: Cones,
    solver: Solver,
    start: Grasp,
    goal: Grasp,
    objective: Objective,
) -> float:
    """A bound of the cost of any plan: the fewest placements, no travel, the best grasps."""
    if objective.name == "travel":
        return 0.0
    problem = problem_on_demand(polygon, cones, solver, start, goal)
    fewest = None if problem is None else problem.plan(start, goal, "slide", PLACEMENTS)
    best = {"placements": 0.0 if fewest is None else float(fewest.placements), "travel": 0.0}
    for measure in ("margin", "tolerance"):
        weighed = measure in dict(objective.weights)
        around = Surroundings(polygon, cones, solver, start, goal, measure)
        best[measure] = around.cap if weighed else 0.0
    return objective.cost(best)


def _widest(
    polygon: Polygon,
    cones: Cones,
    solver: Solver,
    start: Grasp,
    goal: Grasp,
    aligning: str,
    objective: Objective,
) -> Plan | None:
    """A plan with a large least margin or tolerance, and a bound of any plan's."""
    path = path_on_demand(cones, np.sort(start.edges), np.sort(goal.edges))
    if path is None:
        return None
    n = cones.n_edges
    if n <= _WHOLE:
        return problem_on(polygon, cones, np.arange(n), solver).plan(
            start, goal, aligning, objective
        )
    measure: Measure = "margin" if objective.name == "margin" else "tolerance"
    around = Surroundings(polygon, cones, solver, start, goal, measure)
    if around.direct:
        edges = np.unique((*start.edges.tolist(), *goal.edges.tolist()))
        plan = problem_on(polygon, cones, edges, solver).plan(start, goal, aligning, objective)
        if plan is not None and plan.gap == 0:
            return plan
    first = {*start.edges.tolist(), *goal.edges.tolist(), *(e for edges in path for e in edges)}
    # Good next to both, or to one of them; and long edges are where grasps are good anyway.
    ranked = (around.promise.sum(axis=0), *around.promise, cones.lengths)
    orders = [np.argsort(-values, kind="stable") for values in ranked]
    wanted = list(dict.fromkeys([*first, *np.stack(orders, axis=1).ravel().tolist()]))
    best: Plan | None = None
    for count in _SOME:
        edges = np.sort(np.array(wanted[: max(count, len(first))]))
        plan = problem_on(polygon, cones, edges, solver).plan(start, goal, aligning, objective)
        if plan is None:
            continue
        plan = replace(plan, bound=max(around.cap, objective.value(plan)))
        if best is None or objective.value(plan) > objective.value(best):
            best = plan
        if best.gap == 0:
            return best
    if best is not None:
        above = objective.value(best) * (1 + _ABOVE)
        if around.out_of_reach(above):
            best = replace(best, bound=above)
    return best


def problem_on(polygon: Polygon, cones: Cones, edges: IntArray, solver: Solver) -> PlanningProblem:
    """Return the planning problem of a hand of four fingers and all complete sets on some edges.

    Parameters
    ----------
    polygon : Polygon
    cones : Cones
        Of whole edges.
    edges : numpy.ndarray of int
        Ascending.
    solver : Solver
    """
    part = cones.touching(edges, np.zeros(len(edges)), np.ones(len(edges)))
    families = tuple(build_family(part, kind, solver) for kind in kinds_of("complete"))
    sets, hand = GraspSets(polygon, families), Hand(4)
    rule = SwitchRule(sets.sources, hand, partial(meet_held, solver=solver))
    switches = StoredSwitches.of_pairs(len(sets), rule.pairs())
    return PlanningProblem(sets, switches, hand, cones.friction, solver)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What is next to start and goal on all edges of an object.

    Parameters
    ----------
    polygon : Polygon
    cones : Cones
    solver : Solver
    start, goal : Grasp
        Resolved.
    measure : {"margin", "tolerance"}
    """

    polygon: Polygon
    cones: Cones
    solver: Solver
    start: Grasp
    goal: Grasp
    measure: Measure

    @cached_property
    def _problem(self) -> tuple[PieceRows, list[list[Support]]]:
        ends = {*_held_by(self.cones, self.start), *_held_by(self.cones, self.goal)}
        sets = problem_over(self.polygon, self.cones, self.solver, ends).sets
        rows = PieceRows(sets.sources, self.measure)
        return rows, [supports(rows, sets, grasp, 4) for grasp in (self.start, self.goal)]

    @cached_property
    def _moves(self) -> GrowingMoves:
        return GrowingMoves(self._problem[0], self.cones)

    @property
    def direct(self) -> bool:
        """Whether there is a way on which no grasp is chosen."""
        rows, (first, last) = self._problem
        problem = WidestProblem(rows, self._moves, Hand(4), self.solver, first, last)
        return bool(problem.directs())

    @cached_property
    def cap(self) -> float:
        """A level that no way away from the start, or to the goal, exceeds."""
        return min(max(s.cap(self._moves) for s in ends) for ends in self._problem[1])

    @cached_property
    def promise(self) -> FloatArray:
        """For each edge the largest level, up to `cap`, of a neighbour on it, shape (2, n).

        Of neighbours of the start, and of the goal; 0 if there is none.
        """
        rows, ends = self._problem
        promise = np.zeros((2, self.cones.n_edges))
        for side, sources in zip(promise, ends, strict=True):
            for support in sources:
                for contacts in self._moves.of(support.index):
                    levels = support.onward(contacts, 0.0).max(axis=(1, 2), initial=0.0)
                    for column in rows.edges[contacts.others].T:
                        there = column >= 0
                        np.maximum.at(side, column[there], levels[there])
        return np.minimum(promise, self.cap)

    def out_of_reach(self, level: float) -> bool:
        """Whether a search from the start or the goal proves that no route reaches a level."""
        rows, (starts, goals) = self._problem
        for one, other in ((starts, goals), (goals, starts)):
            search = Search(Cut(rows, level, self.solver), self._moves, one, other, _PATIENCE)
            if search.run() is None and search.exhausted:
                return True
        return False


def _held_by(cones: Cones, grasp: Grasp) -> list[tuple[int, ...]]:
    """The edges of the sets that contain a grasp, or two of its contacts."""
    order = np.lexsort((grasp.fractions, grasp.edges))
    found = []
    for count in range(2, len(grasp) + 1):
        for chosen in combinations(order.tolist(), count):
            functions = torque_functions(cones, grasp.edges[list(chosen)][None, :])
            if functions.contain(grasp.fractions[list(chosen)][None, :])[0]:
                found.append(tuple(grasp.edges[list(chosen)].tolist()))
    return found
