"""From two grasps to a verified plan."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from decimal import ROUND_CEILING, Context
from itertools import combinations, pairwise

import numpy as np

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import (
    ContactError,
    HandError,
    NoPlanFound,
    NotForceClosureError,
    OptionError,
    SolverError,
)
from regrasp_lp.force_closure import is_force_closure, least_friction
from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.handovers import Handover, handovers
from regrasp_lp.lp import Solver
from regrasp_lp.planning.aligning import PieceChains, middles
from regrasp_lp.planning.execution import Execution
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.hops import Stop, fewest_hops
from regrasp_lp.planning.path_lp import Stage, build_path_problem, solve_path_problem
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.regrip import regrip_moves
from regrasp_lp.planning.search import fewest_placements
from regrasp_lp.polygon import Polygon
from regrasp_lp.switches import Switches

_UPWARDS = Context(prec=6, rounding=ROUND_CEILING)
"""Six digits of a friction that do hold."""

_THIN = 1e-9
"""Margin of a set, in the object's size, up to which it may be too thin for a solver."""

Choices = dict[int, tuple[int, ...]]
"""The sets that contain a grasp, and which of its contacts are theirs."""

GraspLike = Grasp | Iterable[Contact | tuple[int, float]]


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

    def plan(self, start: Grasp, goal: Grasp, aligning: str) -> Plan | None:
        """Return a verified plan between two checked grasps, or None if no path joins them.

        Raises
        ------
        NoPlanFound
            If aligning by repositioning lacks a free finger.
        SolverError
            If the plan found does not pass its own exact check.
        """
        ends = dict(self._choices(start)), dict(self._choices(goal))
        if set(start) == set(goal):
            index, chosen = next(iter(ends[0].items()))
            fingers = {i + 1: contact for i, contact in enumerate(start)}
            run = Execution(self.sets, self.hand, fingers, [i + 1 for i in chosen], index)
            return self._verified(run, fingers, goal)
        attempts: list[FloatArray] = [self.sets.margins]
        if aligning == "regrip":
            # In two-finger sets more fingers are free, so that aligning there takes fewer.
            attempts.append(np.where(self.sets.contacts == 3, -np.inf, self.sets.margins))
        plans, refusals = [], []
        for margins in attempts:
            try:
                plan = self._attempt(start, goal, ends, margins, aligning)
            except NoPlanFound as refusal:
                refusals.append(refusal)
                continue
            plans += [] if plan is None else [plan]
        if refusals and not plans:
            raise refusals[0]
        return min(plans, key=lambda plan: plan.placements, default=None)

    def _attempt(
        self,
        start: Grasp,
        goal: Grasp,
        ends: tuple[Choices, Choices],
        margins: FloatArray,
        aligning: str,
    ) -> Plan | None:
        """The plan along the best path of the sets whose margin here is above -inf."""
        path = self._path(start, goal, ends, margins)
        if path is None:
            return None
        try:
            return self._along(path, start, goal, ends, aligning)
        except SolverError:
            # Around sets that are within rounding there may be a way with more placements.
            thin = self.sets.margins <= _THIN * self.sets.polygon.diameter
            path = self._path(start, goal, ends, np.where(thin, -np.inf, margins))
            if path is None:
                raise
        return self._along(path, start, goal, ends, aligning)

    def _path(
        self, start: Grasp, goal: Grasp, ends: tuple[Choices, Choices], margins: FloatArray
    ) -> list[int] | None:
        sources, targets = ends
        return fewest_placements(
            self.sets.contacts,
            margins,
            self.switches,
            self.hand,
            dict.fromkeys(sources, 0),
            {i: len(goal) - len(chosen) for i, chosen in targets.items()},
            self._given((start, sources), (goal, targets)),
        )

    def _along(
        self,
        path: list[int],
        start: Grasp,
        goal: Grasp,
        ends: tuple[Choices, Choices],
        aligning: str,
    ) -> Plan:
        """The verified plan along a path of sets."""
        first, last = ends[0][path[0]], ends[1][path[-1]]
        here, there = start.fractions[list(first)], goal.fractions[list(last)]
        switches = [self._handover(i, j) for i, j in pairwise(path)]
        stages = self._stages(path, switches, here, there)
        held = [switch.slots for switch in switches]
        grasps = solve_path_problem(build_path_problem(stages, held, here, there), self.solver.name)
        fingers = {i + 1: contact for i, contact in enumerate(start)}
        run = Execution(self.sets, self.hand, fingers, [i + 1 for i in first], path[0])
        if aligning == "regrip":
            for stop in self._stops(path, stages, grasps, start, goal):
                run.hop(stop)
        else:
            run.release_others()
            for t, (index, nodes) in enumerate(zip(path, grasps, strict=True)):
                if t:
                    run.switch(index, held[t - 1], nodes[0])
                for node in nodes[1:]:
                    run.slide(node)
            run.place_others(goal)
        return self._verified(run, fingers, goal)

    def _verified(self, run: Execution, start: dict[int, Contact], goal: Grasp) -> Plan:
        steps, supports = tuple(run.steps), tuple(run.supports)
        plan = Plan(self.sets.polygon, self.friction, self.hand, start, goal, steps, supports)
        report = plan.verify()
        if not report.ok:
            raise SolverError(
                f"the plan found does not pass its exact check ({report.fault}); its least "
                f"tolerance of {plan.chosen_tolerance:.1e} is within the solver's accuracy"
            )
        return plan

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
                functions = self.sets.functions(index)
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
        self, path: list[int], switches: list[Handover], start: FloatArray, goal: FloatArray
    ) -> list[Stage]:
        """The chain of pieces through each set, from where it is entered to where it is left."""
        arrivals = [start, *(switch.second for switch in switches)]
        leavings = [*(switch.first for switch in switches), goal]
        stages = []
        for index, f, g in zip(path, arrivals, leavings, strict=True):
            chains = PieceChains(self.sets.functions(index), self.solver)
            pieces, _ = chains.chain(f, g)
            stages.append(Stage(chains.functions, chains.pieces[pieces]))
        return stages

    def _stops(
        self,
        path: list[int],
        stages: list[Stage],
        grasps: list[FloatArray],
        start: Grasp,
        goal: Grasp,
    ) -> list[Stop]:
        """The grasps to hop over where fingers are only placed and released."""
        stops, refusal = [], None
        for index, stage, nodes in zip(path, stages, grasps, strict=True):
            way = [nodes[0]]
            try:
                middle = middles(stage.functions, stage.pieces, self.solver)
                for slot, fraction in regrip_moves(stage.functions, list(nodes), middle):
                    way.append(way[-1].copy())
                    way[-1][slot] = fraction
            except NoPlanFound as error:  # it may be possible to hop over this set
                way, refusal = list(nodes), error
            for fractions in way:
                contacts = self.sets.grasp(index, fractions).contacts
                stops.append(Stop(index, contacts, contacts))
        stops.insert(0, Stop(path[0], start.contacts, stops[0].support))
        stops.append(Stop(path[-1], goal.contacts, stops[-1].support))
        chosen = fewest_hops(self.sets.polygon, self.hand, stops)
        if chosen is None:
            raise refusal or NoPlanFound(
                "aligning by repositioning needs a free finger, but all "
                f"{self.hand.fingers} hold the object on the way through the sets on edges "
                f"{[self.sets[i].edges for i in path]}: use "
                'aligning="slide", or a hand with one more finger'
            )
        return [stops[i] for i in chosen[1:]]


def check_aligning(aligning: str) -> None:
    """Raise OptionError unless `aligning` is "slide" or "regrip"."""
    if aligning not in ("slide", "regrip"):
        raise OptionError(f'aligning must be "slide" or "regrip", got {aligning!r}')


def checked_grasp(
    polygon: Polygon, grasp: GraspLike, friction: FloatArray, hand: Hand, role: str
) -> Grasp:
    """Return a start or goal, resolved, after checking that a plan can be asked for it.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp or iterable of (edge, position)
    friction : numpy.ndarray, shape (n_edges,)
    hand : Hand
    role : str
        "start" or "goal", for messages.

    Returns
    -------
    Grasp

    Raises
    ------
    ContactError
        If it has not 2 or 3 contacts, or two of them are one point.
    HandError
        If the hand has too few fingers.
    NotForceClosureError
        If it is not in force closure; the message says at which friction it would be.
    """
    try:
        resolved = polygon.resolve(grasp)
    except ContactError as error:
        raise ContactError(f"{role}: {error}") from error
    if len(resolved) not in (2, 3):
        raise ContactError(f"the {role} must have 2 or 3 contacts, got {len(resolved)}")
    if len(resolved) > hand.fingers:
        raise HandError(f"the {role} needs {len(resolved)} fingers, the hand has {hand.fingers}")
    for one, other in combinations(resolved, 2):
        if _same_point(polygon, one, other):
            raise ContactError(
                f"the {role} has two contacts at one point: {_text(one)} and {_text(other)}; "
                "move one of them"
            )
    if not is_force_closure(polygon, resolved, friction):
        raise NotForceClosureError(_not_closed(polygon, resolved, role))
    # Equal fractions are equal contacts, however their positions were rounded.
    pairs = zip(resolved.edges.tolist(), resolved.fractions.tolist(), strict=True)
    return polygon.resolve(Grasp.at_fractions(pairs))


def _same_point(polygon: Polygon, one: Contact, other: Contact) -> bool:
    if one.edge == other.edge:
        return one.fraction == other.fraction
    # Edges of a simple polygon meet in their ends only, where points are exact.
    return bool((polygon.point(one) == polygon.point(other)).all())


def _text(contact: Contact) -> str:
    return f"edge {contact.edge} at {contact.position:.6g}"


def _not_closed(polygon: Polygon, grasp: Grasp, role: str) -> str:
    contacts = ", ".join(_text(contact) for contact in grasp)
    least = least_friction(polygon, grasp)
    remedy = (
        "no friction makes it so: move its contacts"
        if least is None
        else f"it would be at a friction of {_UPWARDS.create_decimal(least)} on all edges or more"
    )
    return f"the {role} ({contacts}) is not in force closure: {remedy}"
