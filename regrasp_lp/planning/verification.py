"""Verification of a plan from its file alone: exact, and with no code of the planner.

The document (the format is in the documentation of files) is replayed step by step in rational
arithmetic. Before and after each step, and at every instant of each slide, all touching fingers
together have to be in force closure, which is decided from the contact wrenches
(`regrasp_lp.wrenches`); the planner decides by torque functions instead.

**Slides.** In a slide from t = 0 to t = 1 the fractions are linear in t. The force of a boundary
ray does not depend on t and its torque is linear in it, so that each 3 × 3 determinant of contact
wrenches is *linear* in t: ``(1 − t) d(0) + t d(1)``. All signs, and with them force closure, are
therefore constant between consecutive roots of the determinants. Force closure is an open
condition (wrenches that positively span R³ still do when moved a little), so the instants without
it form a closed set and, if there are any between two roots, these roots are among them: testing
t = 0, t = 1 and each root decides all instants, and finds the first at which it is lost.

Positions are not looked at: the fraction decides.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.errors import FileFormatError
from regrasp_lp.friction import per_edge_friction
from regrasp_lp.planning.limit_checks import LimitChecks
from regrasp_lp.planning.plan_document import (
    Place,
    PlaceStep,
    PlanDocument,
    ReleaseStep,
    SlideStep,
    parse_document,
    read_plan_document,
)
from regrasp_lp.polygon import Polygon
from regrasp_lp.wrenches import closure_from_signs, exact_determinants

__all__ = ["Report", "read_plan_document", "verify_document"]

Point = tuple[Fraction, Fraction]


@dataclass(frozen=True)
class Report:
    """What the verification of a plan found.

    Attributes
    ----------
    ok : bool
        Whether the plan is valid; also the truth value of the report.
    fault : str or None
        The first fault, with the step (counted from 1) and the fingers.
    grasps_checked : int
        Number of resting grasps found in force closure: at the start and after each step.
    slides_checked : int
        Number of slides found in force closure throughout.
    """

    ok: bool
    fault: str | None
    grasps_checked: int
    slides_checked: int

    def __bool__(self) -> bool:
        return self.ok

    def __str__(self) -> str:
        checked = (
            f"{self.grasps_checked} grasp{'s' * (self.grasps_checked != 1)} and "
            f"{self.slides_checked} slide{'s' * (self.slides_checked != 1)} checked"
        )
        if self.ok:
            return f"The plan is valid: {checked}, exactly."
        return f"The plan is not valid: {self.fault} ({checked} before.)"


def verify_document(document: Mapping[str, Any]) -> Report:
    """Verify a plan given as the content of its file.

    Parameters
    ----------
    document : mapping
        A ``regrasp-plan`` document of version 1.

    Returns
    -------
    Report
        Valid, or the first fault: no force closure (at rest or at an instant of a slide), placing
        a touching finger, releasing or sliding a free one, a slide that does not start where the
        finger is or that changes edges, a contact off its edge, two fingers at one point (also
        where two edges meet), fingers that pass each other, fingers that the hand does not have,
        at any time a contact or two fingers beyond a limit of the hand, a goal that is not reached
        exactly.

    Raises
    ------
    FileFormatError
        If the document is no plan of this version, or an entry is missing or of a wrong type; the
        message names the place.
    PolygonError, FrictionError
        If the polygon or the friction is none.

    Examples
    --------
    >>> plan = {
    ...     "format": "regrasp-plan", "version": 1, "friction": [0.5], "hand": {"fingers": 4},
    ...     "polygon": {"exterior": [[0, 0], [4, 0], [4, 2], [0, 2]], "holes": []},
    ...     "start": [{"edge": 0, "fraction": 0.5}, {"edge": 2, "fraction": 0.5}],
    ...     "goal": [{"edge": 0, "fraction": 0.25}, {"edge": 2, "fraction": 0.5}],
    ...     "steps": [{"action": "slide", "moves": [
    ...         {"finger": 1, "edge": 0, "from": {"fraction": 0.5}, "to": {"fraction": 0.25}}]}],
    ... }
    >>> print(verify_document(plan))
    The plan is not valid: step 1 (slide finger 1): force closure is lost at slide time t = 1, with finger 1 on edge 0 at fraction 0.25, finger 2 on edge 2 at fraction 0.5 (1 grasp and 0 slides checked before.)
    >>> plan["friction"] = [0.75]
    >>> verify_document(plan).ok
    True
    """  # noqa: E501 - the message is one line
    replay = _Replay(parse_document(document))
    try:
        replay.run()
    except _Fault as fault:
        return Report(False, str(fault), replay.grasps_checked, replay.slides_checked)
    return Report(True, None, replay.grasps_checked, replay.slides_checked)


class _Fault(Exception):
    """The first fault of a plan; ends the replay, and becomes part of the report."""


@dataclass
class _Replay:
    """Carries out the steps of a plan; `held` is where each touching finger is."""

    plan: PlanDocument
    held: dict[int, Place] = field(default_factory=dict)
    grasps_checked: int = 0
    slides_checked: int = 0

    def __post_init__(self) -> None:
        self.polygon = _polygon(self.plan)
        self.friction = per_edge_friction(self.plan.friction, self.polygon.n_edges)
        self.limits = LimitChecks(self.polygon, self.plan.limits)

    def run(self) -> None:
        plan = self.plan
        if len(plan.start) > plan.fingers:
            raise _Fault(
                f"start: {len(plan.start)} contacts, more than the hand has fingers "
                f"({plan.fingers})"
            )
        for contact in plan.start:
            self._place("start", contact)
        self._check_rest("start")
        for number, step in enumerate(plan.steps, 1):
            where = f"step {number} ({_title(step)})"
            fault = self.limits.done_by(step)
            if fault is not None:
                raise _Fault(f"{where}: {fault}")
            if isinstance(step, PlaceStep):
                self._place(where, step)
            elif isinstance(step, ReleaseStep):
                self._release(where, step)
            else:
                self._slide(where, step)
            self._check_rest(where)
        self._check_goal()

    def _place(self, where: str, step: PlaceStep) -> None:
        self._check_finger(where, step.finger)
        if step.finger in self.held:
            raise _Fault(f"{where}: {self._named(step.finger)} touches already")
        self._check_place(where, step.finger, step.at)
        point = self._point(step.at)
        for other, place in self.held.items():
            if self._point(place) == point:
                raise _Fault(
                    f"{where}: finger {step.finger} would be at the same point as "
                    f"{self._named(other)}"
                )
        self.held[step.finger] = step.at

    def _release(self, where: str, step: ReleaseStep) -> None:
        self._check_finger(where, step.finger)
        if step.finger not in self.held:
            raise _Fault(f"{where}: finger {step.finger} is free already")
        del self.held[step.finger]

    def _slide(self, where: str, step: SlideStep) -> None:
        after = dict(self.held)
        moved: set[int] = set()
        for move in step.moves:
            self._check_finger(where, move.finger)
            if move.finger in moved:
                raise _Fault(f"{where}: finger {move.finger} is moved twice in one slide")
            moved.add(move.finger)
            if move.finger not in self.held:
                raise _Fault(f"{where}: finger {move.finger} is free and cannot slide")
            if move.start[0] != self.held[move.finger][0] or move.end[0] != move.start[0]:
                raise _Fault(
                    f"{where}: {self._named(move.finger)} is to slide from edge {move.start[0]} to "
                    f"edge {move.end[0]}; a slide stays on the edge where the finger is"
                )
            if move.start[1] != self.held[move.finger][1]:
                raise _Fault(
                    f"{where}: {self._named(move.finger)} is to slide from fraction "
                    f"{move.start[1]!r}, where it is not"
                )
            self._check_place(where, move.finger, move.end)
            fault = self.limits.along(move.start, move.end, move.finger)
            if fault is not None:
                raise _Fault(f"{where}: {self._named(move.finger)} {fault}")
            after[move.finger] = move.end
        for pair in combinations(sorted(after), 2):
            self._check_meeting(where, pair, after)
        self._check_closure_along(where, after)
        self.held = after
        self.slides_checked += 1

    def _check_meeting(self, where: str, pair: tuple[int, int], after: dict[int, Place]) -> None:
        """Two points move at constant speed: the vector between them runs along a segment."""
        first, second = pair
        before, later = (
            _difference(self._point(places[first]), self._point(places[second]))
            for places in (self.held, after)
        )
        nearest = self.limits.nearest(before, later)
        # They are farthest from each other before or after the slide, when they rest.
        fault = self.limits.apart(_between(before, later, nearest))
        if fault is not None:
            raise _Fault(
                f"{where}: fingers {first} and {second} {fault}, at slide time {_time(nearest)}"
            )
        (x0, y0), (x1, y1) = before, later
        dot = x0 * x1 + y0 * y1
        if x0 * y1 != y0 * x1 or dot > 0:
            return
        time = (x0 * x0 + y0 * y0) / (x0 * x0 + y0 * y0 - dot)
        same_edge = after[first][0] == after[second][0]
        what = "pass each other" if same_edge and time < 1 else "come to one point"
        raise _Fault(
            f"{where}: fingers {first} and {second} {what} at slide time {_time(time)}, on "
            + (f"edge {after[first][0]}" if same_edge else "two edges that meet there")
        )

    def _check_closure_along(self, where: str, after: dict[int, Place]) -> None:
        fingers = sorted(after)
        edges = np.array([after[finger][0] for finger in fingers], dtype=np.intp)
        ends = np.array(
            [[places[finger][1] for finger in fingers] for places in (self.held, after)]
        )
        determinants = exact_determinants(
            self.polygon, self.friction, np.stack([edges, edges]), ends
        )
        lost = first_loss(2 * len(fingers), determinants)
        if lost is not None:
            places = [
                (finger, after[finger][0], float((1 - lost) * Fraction(a) + lost * Fraction(b)))
                for finger, a, b in zip(fingers, *ends.tolist(), strict=True)
            ]
            raise _Fault(
                f"{where}: force closure is lost at slide time {_time(lost)}, with "
                + ", ".join(_contact_text(*place) for place in places)
            )

    def _check_rest(self, where: str) -> None:
        for first, second in combinations(sorted(self.held), 2):
            points = self._point(self.held[first]), self._point(self.held[second])
            fault = self.limits.apart(_difference(*points))
            if fault is not None:
                raise _Fault(f"{where}: fingers {first} and {second} {fault}")
        contacts = ", ".join(self._named(finger) for finger in sorted(self.held)) or "no finger"
        if len(self.held) > 1:
            places = list(self.held.values())
            determinants = exact_determinants(
                self.polygon,
                self.friction,
                np.array([[edge for edge, _ in places]], dtype=np.intp),
                np.array([[fraction for _, fraction in places]]),
            )
            signs = _signs(determinants)
            if closure_from_signs(2 * len(places), signs > 0, signs < 0)[0]:
                self.grasps_checked += 1
                return
        raise _Fault(f"{where}: no force closure with {contacts}")

    def _check_goal(self) -> None:
        for place in self.plan.goal:
            self._check_place("goal", None, place)
        goal, reached = Counter(self.plan.goal), Counter(self.held.values())
        if goal == reached:
            return
        missing = [f"edge {edge} at fraction {fraction!r}" for edge, fraction in goal - reached]
        extra = [self._named(f) for f in sorted(self.held) if self.held[f] not in goal]
        faults = [f"no finger on {text}" for text in missing]
        faults += [f"{text} is not in the goal" for text in extra]
        raise _Fault(f"after the last step the goal is not reached: {', '.join(faults)}")

    def _check_finger(self, where: str, finger: int) -> None:
        if not 1 <= finger <= self.plan.fingers:
            raise _Fault(
                f"{where}: there is no finger {finger}; the hand has fingers 1 to "
                f"{self.plan.fingers}"
            )

    def _check_place(self, where: str, finger: int | None, place: Place) -> None:
        edge, fraction = place
        who = "a contact" if finger is None else f"finger {finger}"
        if not 0 <= edge < self.polygon.n_edges:
            raise _Fault(
                f"{where}: {who} on edge {edge}, but the polygon has edges 0 to "
                f"{self.polygon.n_edges - 1}"
            )
        if not 0 <= fraction <= 1:
            raise _Fault(f"{where}: {who} off edge {edge}: fraction {fraction!r} is not in [0, 1]")
        fault = self.limits.at(place, finger)
        if fault is not None:
            raise _Fault(f"{where}: {who} at fraction {fraction!r} {fault}")

    def _point(self, place: Place) -> Point:
        edge, fraction = place[0], Fraction(place[1])
        ax, ay = (Fraction(value) for value in self.polygon.edge_starts[edge].tolist())
        bx, by = (Fraction(value) for value in self.polygon.edge_ends[edge].tolist())
        return ax + fraction * (bx - ax), ay + fraction * (by - ay)

    def _named(self, finger: int) -> str:
        return _contact_text(finger, *self.held[finger])


def first_loss(n_rays: int, determinants: NDArray[np.object_]) -> Fraction | None:
    """Return the first instant of a slide without force closure.

    Parameters
    ----------
    n_rays : int
        Number of boundary rays, two per contact.
    determinants : numpy.ndarray of int, shape (triples, 2)
        The determinants of contact wrenches at t = 0 and t = 1, as `exact_determinants` gives
        them; between they are linear.

    Returns
    -------
    fractions.Fraction or None
        The least t in [0, 1] at which there is no force closure; None if there is no such t.
    """
    ends = _signs(determinants)
    changing = np.flatnonzero(ends[:, 0] * ends[:, 1] < 0)
    root_of = {
        t: Fraction(a, a - b) for t, (a, b) in zip(changing, determinants[changing], strict=True)
    }
    roots = sorted(set(root_of.values()))
    column = {root: number for number, root in enumerate(roots, 1)}
    # One column for t = 0, for each root and for t = 1. Signs that do not change keep the one
    # of an end that is not zero.
    signs = np.repeat((ends[:, :1] + ends[:, 1:]).clip(-1, 1), len(roots) + 2, axis=1)
    for t, root in root_of.items():
        signs[t, : column[root]] = ends[t, 0]
        signs[t, column[root]] = 0
        signs[t, column[root] + 1 :] = ends[t, 1]
    signs[:, 0], signs[:, -1] = ends[:, 0], ends[:, 1]
    lost = np.flatnonzero(~closure_from_signs(n_rays, signs > 0, signs < 0))
    return [Fraction(0), *roots, Fraction(1)][lost[0]] if lost.size else None


def _polygon(plan: PlanDocument) -> Polygon:
    """Return the polygon, whose edges have to be numbered as in the file."""
    polygon = Polygon(plan.exterior, plan.holes)
    given = [plan.exterior, *plan.holes]
    stored = [[(x, y) for x, y in ring.tolist()] for ring in polygon.rings]
    for number, (ring, kept) in enumerate(zip(given, stored, strict=True)):
        if ring != kept:
            name = "exterior" if number == 0 else f"holes[{number - 1}]"
            raise FileFormatError(
                f"polygon.{name}: rings have to be as the package stores them (outline "
                "counter-clockwise, holes clockwise, without repeating the first point); "
                "otherwise the numbers of the edges have no meaning"
            )
    return polygon


def _signs(determinants: NDArray[np.object_]) -> NDArray[np.int8]:
    positive, negative = determinants > 0, determinants < 0
    return positive.astype(np.int8) - negative.astype(np.int8)


def _difference(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1]


def _between(a: Point, b: Point, time: Fraction) -> Point:
    return a[0] + time * (b[0] - a[0]), a[1] + time * (b[1] - a[1])


def _title(step: PlaceStep | ReleaseStep | SlideStep) -> str:
    if isinstance(step, PlaceStep):
        return f"place finger {step.finger}"
    if isinstance(step, ReleaseStep):
        return f"release finger {step.finger}"
    fingers = [str(move.finger) for move in step.moves]
    return f"slide finger{'s' * (len(fingers) > 1)} {', '.join(fingers)}"


def _contact_text(finger: int, edge: int, fraction: float) -> str:
    return f"finger {finger} on edge {edge} at fraction {fraction!r}"


def _time(time: Fraction) -> str:
    return f"t = {float(time):.9g}"
