"""Asking a graph for plans: the question is checked, and answered by plans or a reason for none."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from regrasp_lp.contact import Grasp
from regrasp_lp.errors import NoPlanFound, OptionError
from regrasp_lp.planning.nearby import plan_on_demand
from regrasp_lp.planning.objective import Objective, ObjectiveLike
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.planner import PlanningProblem
from regrasp_lp.planning.requests import GraspLike, check_aligning, checked_grasp
from regrasp_lp.planning.steering import Avoid, Steering, Weight
from regrasp_lp.refusals import question, refusal

if TYPE_CHECKING:
    from regrasp_lp.switching_graph import SwitchingGraph


def plans_in(
    graph: SwitchingGraph,
    problem: PlanningProblem,
    start: GraspLike,
    goal: GraspLike,
    aligning: str,
    objective: ObjectiveLike,
    weight: Weight | None = None,
    avoid_edges: Avoid = (),
    avoid_sets: Avoid = (),
    *,
    nearby: bool = False,
) -> Iterator[Plan]:
    """Yield verified plans in a graph, the best first; each is made when it is asked for.

    Parameters
    ----------
    graph : SwitchingGraph
    problem : PlanningProblem
        Of the graph.
    start, goal, aligning, objective, weight, avoid_edges, avoid_sets
        As for `SwitchingGraph.plan`.
    nearby : bool
        Only the best plan is wanted, and may be found without the graph if nothing steers.

    Raises
    ------
    NoPlanFound
        If there is none at all; and what else `SwitchingGraph.plan` raises.
    """
    check_aligning(aligning)
    aim = Objective.of(objective)
    steering = Steering.of(graph.sets, aim, weight, avoid_edges, avoid_sets)
    first, last = (
        checked_grasp(graph.polygon, grasp, graph.friction, graph.hand, role)
        for role, grasp in (("start", start), ("goal", goal))
    )
    if not (graph.locate(first) and graph.locate(last)):
        raise refusal(graph, first, last)
    found = None
    try:
        if nearby and steering.free:
            where = graph.polygon, graph.sets.cones, problem.solver
            found = plan_on_demand(*where, first, last, aligning, aim)
        if found is not None:
            yield found
            return
        for found in problem.plans(first, last, aligning, aim, steering):
            yield found
    except NoPlanFound as answer:
        raise answer.about(question(graph, first, last)) from None
    if found is None:
        raise _steered_away(graph, first, last, steering) or refusal(graph, first, last)


def check_count(k: int, objective: ObjectiveLike) -> None:
    """Raise OptionError unless so many plans can be asked for."""
    if isinstance(k, bool) or not isinstance(k, int) or k < 1:
        raise OptionError(f"k must be a number of plans, 1 or more, got {k!r}")
    name = Objective.of(objective).name
    if k > 1 and name not in ("placements", "margin", "tolerance"):
        raise OptionError(
            f'alternatives are found for objective="placements", "margin" or "tolerance", not for '
            f"{name!r}: ask for k=1, or for one of these"
        )


def _steered_away(
    graph: SwitchingGraph, start: Grasp, goal: Grasp, steering: Steering
) -> NoPlanFound | None:
    """The answer if there is a plan, but for what steers."""
    here, there = set(graph.locate(start)), set(graph.locate(goal))
    joined = any(component & here and component & there for component in graph.components())
    if steering.free or not joined:
        return None
    return NoPlanFound(
        "no plan is left: start and goal are joined only by way of grasp sets or switches that "
        "avoid_edges, avoid_sets or weight rule out: allow some of them"
    )
