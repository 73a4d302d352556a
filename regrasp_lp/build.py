"""Building switching graphs, and planning without building one."""

from __future__ import annotations

import time
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.contact_rule import meet_by_lp, meet_held
from regrasp_lp.couplings import coupled_rule
from regrasp_lp.errors import HandError, NoPlanFound, OptionError
from regrasp_lp.focus_rule import FocusRule
from regrasp_lp.friction import Cones, IntArray
from regrasp_lp.graph_options import GraphOptions
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.grasp_sets.spaced import spaced_family
from regrasp_lp.grasp_sets.vertices import Progress, build_family, kinds_of
from regrasp_lp.lp import Solver, get_solver
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.nearby import plan_on_demand
from regrasp_lp.planning.objective import Objective, ObjectiveLike
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.reach import hand_cones, spacing_of
from regrasp_lp.planning.requests import GraspLike, check_aligning, checked_grasp
from regrasp_lp.planning.steering import Weight, checked_numbers
from regrasp_lp.polygon import Polygon
from regrasp_lp.shadows import Shadows
from regrasp_lp.switches import (
    STORE_LIMIT,
    StoredSwitches,
    Switches,
    SwitchesOnDemand,
    SwitchRule,
)
from regrasp_lp.switching import Meeting
from regrasp_lp.switching_graph import SwitchingGraph

_SMALL = 20
"""Up to so many edges the whole graph is found as fast as a path without it."""


def build_switching_graph(
    polygon: Polygon,
    friction: ArrayLike,
    hand: Hand | None = None,
    sets: str = "complete",
    switching: str = "contact",
    min_margin: float = 0.0,
    solver: str = "clarabel",
    presolve: bool = True,
    progress: Progress | None = None,
) -> SwitchingGraph:
    """Compute all grasp sets of an object and the switches between them.

    Parameters
    ----------
    polygon : Polygon
    friction : float or sequence of float
        μ, one value or one per edge.
    hand : Hand, optional
        Four fingers without limits by default.
    sets : {"complete", "chapter"}
        All force-closure grasps of 2 and 3 contacts, or the chapter's two-finger, concurrent and
        parallel sets.
    switching : {"contact", "focus"}
        Two sets are adjacent iff the same contacts can be held. The chapter's rule, "focus", asks
        of concurrent and two-finger sets that the interiors of their focus cells meet: its edges
        are a subset. It is for the chapter's sets and hand (four fingers).
    min_margin : float
        Drop sets and switches whose best margin is not larger, in the object's unit. That of a
        switch is the margin of its grasps, also under the focus rule.
    solver : {"clarabel", "highs"}
    presolve : bool
        Decide by signs of torque functions and intervals (exact), and solve the margin LPs of sets
        in closed form; if False, leave everything to the solver.
    progress : callable, optional
        Called as ``progress(what, done, total)`` now and then.

    Returns
    -------
    SwitchingGraph

    Raises
    ------
    FrictionError, OptionError
        If an argument has no meaning.
    HandError
        If `hand` is no hand, or the focus rule is asked for with other than four fingers.
    SolverError
        If a solver left an LP open.

    Examples
    --------
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)], name="square")
    >>> graph = build_switching_graph(square, friction=0.5)
    >>> len(graph.sets), len(graph.components())
    (10, 1)
    """
    hand = check_options(hand, sets, switching, min_margin, solver)
    options = GraphOptions(sets, switching, float(min_margin), solver, presolve)
    seconds, started = {}, time.perf_counter()
    grasp_sets = find_sets(polygon, friction, hand, options, progress)
    seconds["sets"] = time.perf_counter() - started

    started = time.perf_counter()
    rule = switch_rule(
        grasp_sets, hand, get_solver(solver), switching, presolve=presolve, min_margin=min_margin
    )
    switches: Switches
    if rule.n_pairs > STORE_LIMIT:
        switches = SwitchesOnDemand(rule)
    else:
        switches = StoredSwitches.of_pairs(len(grasp_sets), rule.pairs(progress))
    seconds["switches"] = time.perf_counter() - started
    mu = grasp_sets.cones.whole.friction
    return SwitchingGraph(grasp_sets, switches, mu, hand, options, seconds)


def find_sets(
    polygon: Polygon,
    friction: ArrayLike,
    hand: Hand,
    options: GraphOptions,
    progress: Progress | None = None,
) -> GraspSets:
    """Return the grasp sets of an object for a hand, without the switches between them.

    Parameters
    ----------
    polygon, friction, hand, progress
        As for `build_switching_graph`.
    options : GraphOptions

    Returns
    -------
    GraspSets
    """
    solver, least = get_solver(options.solver), options.min_margin
    cones = hand_cones(polygon, friction, hand)
    families = tuple(
        build_family(
            cones, kind, solver, presolve=options.presolve, min_margin=least, progress=progress
        )
        for kind in kinds_of(options.sets)
    )
    spacing = spacing_of(cones, hand)
    if spacing is not None:
        families = tuple(
            spaced_family(family, spacing, solver, min_margin=least) for family in families
        )
    return GraspSets(polygon, families, spacing)


def check_options(
    hand: Hand | None, sets: str, switching: str, min_margin: float, solver: str
) -> Hand:
    """Return the hand; raise OptionError or HandError if an option means nothing for any object."""
    kinds_of(sets)
    if solver not in ("clarabel", "highs"):  # these are not loaded where work is only handed out
        get_solver(solver)
    hand = _checked_hand(hand)
    check_switching(switching, sets, hand)
    if not (np.isfinite(min_margin) and min_margin >= 0):
        raise OptionError(f"min_margin must be a finite length >= 0, got {min_margin!r}")
    return hand


def _checked_hand(hand: Hand | None) -> Hand:
    if hand is None:
        return Hand()
    if not isinstance(hand, Hand):
        raise HandError(f"hand must be a Hand, got {hand!r}: use Hand(fingers=k)")
    return hand


def check_switching(switching: str, sets: str, hand: Hand) -> None:
    """Raise OptionError or HandError if the switching rule is not defined for sets or hand."""
    if switching not in ("contact", "focus"):
        raise OptionError(f'switching must be "contact" or "focus", got {switching!r}')
    if switching == "focus" and sets != "chapter":
        raise OptionError(
            f'switching="focus" is defined for the chapter\'s sets, not for sets={sets!r}: '
            'use sets="chapter", or switching="contact"'
        )
    if switching == "focus" and hand != Hand(4):
        which = "a hand with limits" if hand.fingers == 4 else str(hand.fingers)
        raise HandError(
            f'switching="focus" is defined for four fingers, not for {which}: '
            'use Hand(4), or switching="contact"'
        )


def switch_rule(
    sets: GraspSets,
    hand: Hand,
    solver: Solver,
    switching: str = "contact",
    *,
    presolve: bool = True,
    min_margin: float = 0.0,
) -> SwitchRule:
    """Return the contact rule or the focus rule, decided exactly or by margin LPs."""

    def contact(
        first: Shadows, second: Shadows, i: IntArray | None = None, j: IntArray | None = None
    ) -> Meeting:
        if presolve:
            return meet_held(first, second, i, j, solver=solver, min_margin=min_margin)
        aligned = (first if i is None else first.take(i), second if j is None else second.take(j))
        return meet_by_lp(*aligned, solver, min_margin, exact=False)

    if sets.spacing is not None:
        return SwitchRule(sets.sources, hand, coupled_rule(sets, solver, min_margin=min_margin))
    if switching == "contact":
        return SwitchRule(sets.sources, hand, contact)
    focus = FocusRule.of(sets)

    def either(first: Shadows, second: Shadows, i: IntArray, j: IntArray) -> Meeting:
        planar = focus.applies(first.take(i), second.take(j))
        rows = np.flatnonzero(planar)
        cells = focus.decide(
            first.take(i[rows]), second.take(j[rows]), None if presolve else solver
        )
        # A switch by focus is one by contacts, whose margin and witness are the ones that count.
        rows = np.concatenate((rows[cells], np.flatnonzero(~planar)))
        result = Meeting.unknown(len(i), first.held)
        result.write(rows, contact(first, second, i[rows], j[rows]))
        return result

    return SwitchRule(sets.sources, hand, either)


def plan_regrasp(
    polygon: Polygon,
    start: GraspLike,
    goal: GraspLike,
    friction: ArrayLike,
    hand: Hand | None = None,
    sets: str = "complete",
    aligning: str = "slide",
    objective: ObjectiveLike = "placements",
    weight: Weight | None = None,
    avoid_edges: Iterable[int] = (),
) -> Plan:
    """Return the best verified plan from one grasp to another.

    With complete sets and four fingers only the neighbourhoods of start and goal are looked at, so
    that objects with hundreds of edges take little longer than small ones; otherwise, for objects
    so small that it takes no longer, to explain why there is no plan, and with `weight` or
    `avoid_edges`, the whole graph is built.

    Parameters
    ----------
    polygon : Polygon
    start, goal : Grasp or iterable of (edge, position)
    friction, hand, sets
        As for `build_switching_graph`.
    aligning, objective, weight, avoid_edges
        As for `SwitchingGraph.plan`; the numbers of sets are those of `build_switching_graph`.

    Returns
    -------
    Plan

    Raises
    ------
    NoPlanFound, NotForceClosureError, ContactError, HandError, OptionError, SolverError
        As for `SwitchingGraph.plan`.

    Examples
    --------
    >>> block = Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], name="block")
    >>> plan = plan_regrasp(block, [(0, 3), (2, 3)], [(1, 1.5), (3, 1.5)], friction=0.4)
    >>> [type(step).__name__ for step in plan.steps]
    ['Place', 'Place', 'Release', 'Release']
    """
    check_aligning(aligning)
    aim = Objective.of(objective)
    hand = _checked_hand(hand)
    cones = Cones.of(polygon, friction)
    first, last = (
        checked_grasp(polygon, grasp, cones.friction, hand, role)
        for role, grasp in (("start", start), ("goal", goal))
    )
    avoid = checked_numbers("avoid_edges", avoid_edges, polygon.n_edges, "the polygon has edges")
    large = polygon.n_edges > _SMALL and weight is None and not avoid
    if large and "three_finger" in kinds_of(sets) and hand == Hand(4):
        asked = {"polygon": polygon, "start": first, "goal": last, "friction": friction}
        solver = get_solver("clarabel")
        try:
            plan = plan_on_demand(polygon, cones, solver, first, last, aligning, aim)
        except NoPlanFound as answer:
            raise answer.about(asked) from None
        if plan is not None:
            return plan
    graph = build_switching_graph(polygon, friction, hand, sets)
    return graph.plan(start, goal, aligning, objective, weight, avoid)
