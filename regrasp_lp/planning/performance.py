"""From grasps along a path of sets to the verified steps of numbered fingers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import NoPlanFound, SolverError
from regrasp_lp.friction import FloatArray
from regrasp_lp.planning.aligning import middles
from regrasp_lp.planning.execution import Execution
from regrasp_lp.planning.hops import Stop, fewest_hops
from regrasp_lp.planning.path_lp import Stage
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.reach import start_fingers
from regrasp_lp.planning.regrip import regrip_moves

if TYPE_CHECKING:
    from regrasp_lp.planning.planner import PlanningProblem


@dataclass(frozen=True, eq=False)
class Passage:
    """Grasps along a path of sets, with straight slides between those of one set.

    Parameters
    ----------
    path : tuple of int
        The sets.
    held : tuple of tuple of (int, int)
        Per switch the held contacts, as places in the two sets.
    grasps : tuple of numpy.ndarray, shape (N, m)
        Per set the fractions of its grasps, from arriving to leaving.
    chosen : tuple of int
        Which contacts of the start are those of the first set, in its order.
    stages : tuple of Stage
        The pieces of the slides; only for aligning by repositioning.
    touching : (bool, bool)
        Whether all of the start touches until the first switch is made, and all of the goal when
        the last one is.
    """

    path: tuple[int, ...]
    held: tuple[tuple[tuple[int, int], ...], ...]
    grasps: tuple[FloatArray, ...]
    chosen: tuple[int, ...]
    stages: tuple[Stage, ...] = ()
    touching: tuple[bool, bool] = (False, False)


def perform(
    problem: PlanningProblem, passage: Passage, start: Grasp, goal: Grasp, aligning: str
) -> Plan:
    """Return the verified plan that goes along a passage.

    Parameters
    ----------
    problem : PlanningProblem
    passage : Passage
    start, goal : Grasp
        Resolved.
    aligning : {"slide", "regrip"}

    Raises
    ------
    NoPlanFound
        If aligning by repositioning lacks a free finger.
    SolverError
        If the plan does not pass its own exact check.
    """
    names = start_fingers(start)
    fingers = dict(zip(names, start, strict=True))
    mine = [names[i] for i in passage.chosen]
    given = (*start, *goal)
    run = Execution(problem.sets, problem.hand, fingers, mine, passage.path[0], given)
    if set(start) == set(goal):
        pass
    elif aligning == "regrip":
        for stop in _stops(problem, passage, start, goal):
            run.hop(stop)
    else:
        run.along(passage.path, passage.held, passage.grasps, goal, passage.touching)
    return _verified(problem, run, fingers, goal)


def _verified(
    problem: PlanningProblem, run: Execution, start: dict[int, Contact], goal: Grasp
) -> Plan:
    steps, supports = tuple(run.steps), tuple(run.supports)
    polygon = problem.sets.polygon
    plan = Plan(polygon, problem.friction, problem.hand, start, goal, steps, supports)
    report = plan.verify()
    if not report.ok:
        raise SolverError(
            f"the plan found does not pass its exact check ({report.fault}); its least "
            f"tolerance of {plan.chosen_tolerance:.1e} is within the solver's accuracy"
        )
    return plan


def _stops(problem: PlanningProblem, passage: Passage, start: Grasp, goal: Grasp) -> Sequence[Stop]:
    """The grasps to hop over where fingers are only placed and released."""
    sets = problem.sets
    stops: list[Stop] = []
    refusal = None
    for index, stage, nodes in zip(passage.path, passage.stages, passage.grasps, strict=True):
        way = [nodes[0]]
        try:
            middle = middles(stage.functions, stage.pieces, problem.solver)
            for slot, fraction in regrip_moves(stage.functions, list(nodes), middle):
                way.append(way[-1].copy())
                way[-1][slot] = fraction
        except NoPlanFound as error:  # it may be possible to hop over this set
            way, refusal = list(nodes), error
        for fractions in way:
            contacts = sets.grasp(index, fractions, (*start, *goal)).contacts
            stops.append(Stop(index, contacts, contacts))
    stops.insert(0, Stop(passage.path[0], start.contacts, stops[0].support))
    stops.append(Stop(passage.path[-1], goal.contacts, stops[-1].support))
    chosen = fewest_hops(sets.polygon, problem.hand, stops)
    if chosen is None:
        raise refusal or NoPlanFound(
            "aligning by repositioning needs a free finger, but all "
            f"{problem.hand.fingers} hold the object on the way through the sets on edges "
            f"{[sets[i].edges for i in passage.path]}: use "
            'aligning="slide", or a hand with one more finger'
        )
    return [stops[i] for i in chosen[1:]]
