"""Tells why there is no plan from one grasp to another: what is nearest, and what would help."""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import ArrayLike

from regrasp_lp.build import check_options
from regrasp_lp.connection import Regrasp, Route, friction_threshold, route
from regrasp_lp.contact import Grasp
from regrasp_lp.errors import NotForceClosureError
from regrasp_lp.explanation import End, Explanation, MoreFingers
from regrasp_lp.friction import FloatArray, per_edge_friction
from regrasp_lp.graph_options import GraphOptions
from regrasp_lp.lp import get_solver
from regrasp_lp.nearest_switch import NearestSwitch, nearest_switch
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.relaxations import relaxations
from regrasp_lp.planning.requests import GraspLike, checked_grasp
from regrasp_lp.planning.stuck import stuck
from regrasp_lp.polygon import Polygon
from regrasp_lp.refusals import standstill
from regrasp_lp.remedies import Remedy, remedy
from regrasp_lp.switching_graph import Progress, SwitchingGraph


def explain(
    polygon: Polygon,
    start: GraspLike,
    goal: GraspLike,
    friction: ArrayLike,
    hand: Hand | None = None,
    sets: str = "complete",
    switching: str = "contact",
    min_margin: float = 0.0,
    progress: Progress | None = None,
) -> Explanation:
    """Tell why there is no plan from one grasp to another, and what would help.

    Parameters
    ----------
    polygon : Polygon
    start, goal : Grasp or iterable of (edge, position)
        Of 2 or 3 contacts; they need not be in force closure.
    friction, hand, sets, switching, min_margin, progress
        As for `build_switching_graph`.

    Returns
    -------
    Explanation
        Also if there is a plan: it says so.

    Raises
    ------
    ContactError, FrictionError, HandError, OptionError
        If an argument has no meaning.
    SolverError
        If a solver left an LP open.

    Examples
    --------
    A triangle with little friction can be held by all three edges only, by three fingers that
    nothing can relieve:

    >>> wedge = Polygon([(0, 0), (4, 0), (1, 3)])
    >>> found = explain(wedge, [(0, 2), (2, 1.5)], [(0, 1.5), (1, 2), (2, 1.5)], friction=0.05)
    >>> print(found.remedies["start"].friction is None, found.plan_exists)
    False False
    """
    hand = check_options(hand, sets, switching, min_margin, "clarabel")
    options = GraphOptions(sets, switching, float(min_margin))
    mu = per_edge_friction(friction, polygon.n_edges)
    ends, remedies = _checked(polygon, {"start": start, "goal": goal}, mu, hand)
    if remedies:
        return Explanation(ends["start"], ends["goal"], options, hand, remedies)
    question = Regrasp(polygon, ends["start"], ends["goal"], mu, hand, options)
    if question.on_demand and (found := route(question)) is not None:
        return Explanation(question.start, question.goal, options, hand, route=found)
    return _explained(question, question.graph(progress), progress)


def explain_in(
    graph: SwitchingGraph, start: GraspLike, goal: GraspLike, progress: Progress | None = None
) -> Explanation:
    """Tell why a graph has no plan from one grasp to another; as `explain`, which see.

    Parameters
    ----------
    graph : SwitchingGraph
    start, goal : Grasp or iterable of (edge, position)
    progress : callable, optional
    """
    polygon, mu, hand, options = graph.polygon, graph.friction, graph.hand, graph.options
    ends, remedies = _checked(polygon, {"start": start, "goal": goal}, mu, hand)
    if remedies:
        return Explanation(ends["start"], ends["goal"], options, hand, remedies)
    question = Regrasp(polygon, ends["start"], ends["goal"], mu, hand, options)
    return _explained(question, graph, progress)


def _checked(
    polygon: Polygon, grasps: dict[str, GraspLike], friction: FloatArray, hand: Hand
) -> tuple[dict[str, Grasp], dict[str, Remedy]]:
    """Both grasps, resolved, and remedies for those that are not in force closure."""
    ends: dict[str, Grasp] = {}
    remedies: dict[str, Remedy] = {}
    for role, grasp in grasps.items():
        try:
            ends[role] = checked_grasp(polygon, grasp, friction, hand, role)
        except NotForceClosureError:
            ends[role] = polygon.resolve(grasp)
            remedies[role] = remedy(polygon, ends[role], friction, hand)
    return ends, remedies


def _explained(question: Regrasp, graph: SwitchingGraph, progress: Progress | None) -> Explanation:
    start, goal, options, hand = question.start, question.goal, question.options, question.hand
    found = route(question, graph)
    if found is not None:
        return Explanation(start, goal, options, hand, n_sets=len(graph), route=found)
    ends = {"start": _end(graph, start), "goal": _end(graph, goal)}
    located = all(end.sets for end in ends.values())
    reason = standstill(graph, start, goal) if located else None
    # what fingers that only slide rule out at all friction cannot change
    never = stuck(hand, start, goal) is not None
    if progress is not None and located:
        progress("looking for the nearest switch", 0, 0)
    return Explanation(
        start,
        goal,
        options,
        hand,
        n_sets=len(graph),
        n_components=len(graph.components()),
        ends={} if reason else ends,
        nearest=_nearest(graph, ends) if located and not hand.coupled else None,
        threshold=None if never else friction_threshold(question, progress),
        fingers=_more_fingers(question) if located else None,
        standstill=reason,
        without=_without(question) if hand.limited else None,
        among_all=None if options.everything else route(question.with_all_sets()),
    )


def _without(question: Regrasp) -> dict[str, Route | None]:
    """The path that a hand without one of its limits could take, for each of them."""
    relaxed = relaxations(question.hand)
    return {limit: route(replace(question, hand=hand)) for limit, hand in relaxed.items()}


def _end(graph: SwitchingGraph, grasp: Grasp) -> End:
    found = graph.locate(grasp)
    inside = (
        (number, len(component))
        for number, component in enumerate(graph.components())
        if component & set(found)
    )
    return End(found, tuple(inside))


def _nearest(graph: SwitchingGraph, ends: dict[str, End]) -> NearestSwitch | None:
    components = graph.components()
    sides = [set().union(*(components[n] for n, _ in end.components)) for end in ends.values()]
    return nearest_switch(graph.sets, graph.hand, get_solver(graph.options.solver), *sides)


def _more_fingers(question: Regrasp) -> MoreFingers:
    """One more finger; the focus rule is for four, so that the contact rule stands in for it."""
    hand = replace(question.hand, fingers=question.hand.fingers + 1)
    options = replace(question.options, switching="contact")
    return MoreFingers(hand.fingers, route(replace(question, hand=hand, options=options)))
