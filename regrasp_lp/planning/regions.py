"""Independent contact regions along a plan: how far each finger may be off, step by step.

No torque function decreases when a contact moves forward along its edge. So a box of positions
``[u⁻, u⁺]`` is held wherever the contacts are in it, each on its own, iff ``max_k M_k(u⁻) > 0`` and
``min_j M_j(u⁺) < 0``: its lower corner has to do with the ups alone, its upper one with the downs.
The largest cube around a grasp is its tolerance. From there on the sides grow further: all at one
pace, each until it is at an end of its edge or stops the others, and is left there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from regrasp_lp.contact import FRACTION_SNAP, Contact, Grasp
from regrasp_lp.errors import NotForceClosureError
from regrasp_lp.friction import BoolArray, FloatArray
from regrasp_lp.planning.along import instants, least_along
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import TorqueFunctions

if TYPE_CHECKING:
    from regrasp_lp.planning.plan import Plan

_HALVINGS = 52
"""Of an interval, to the accuracy of doubles."""

_BLOCKED = 1e-9
"""Part of the object's size: what could grow by no more does not grow."""

_STEP_BACK = 2.0**-46
"""Part of a width to give up, then twice as much, and so on, until the exact check agrees."""


@dataclass(frozen=True)
class Box:
    """Intervals along edges, one for each supporting finger.

    Parameters
    ----------
    lower, upper : Grasp
        The first and the last contact of each interval, in the order of the fingers.
    """

    lower: Grasp
    upper: Grasp


@dataclass(frozen=True)
class Region:
    """Where the supporting fingers may be at some moment of a plan, each on its own.

    Parameters
    ----------
    step : int
        The grasp after this step (0 is the start), or the slide that is this step.
    fingers : tuple of int
        The supporting fingers.
    grasp : Grasp
        Where they are; of a slide, where it ends.
    tolerance : float
        The largest δ by which every contact may be off to either side, in the object's unit; of a
        slide the least on the way.
    box : Box
        An independent contact region, exactly, and maximal: no side of it can be moved out by more
        than 1e-9 of the object's size. It is the cube of the tolerance grown as evenly as possible
        within what the hand may touch; of the gap to another finger on the same edge, and of what
        the hand's limits leave of the distance between two fingers, each has half.
    before : Box or None
        Of a slide: the region where it begins; it moves at constant speed to `box`, and wherever
        the contacts are in it at an instant, the object is held. None for a grasp at rest.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])
    >>> plan = rl.plan_regrasp(block, [(0, 3), (2, 3)], [(1, 1.5), (3, 1.5)], friction=0.4)
    >>> start = plan.regions()[0]
    >>> start.fingers, start.widths.round(6).tolist()
    ((1, 2), [[0.6, 0.6], [0.6, 0.6]])
    """

    step: int
    fingers: tuple[int, ...]
    grasp: Grasp
    tolerance: float
    box: Box
    before: Box | None = None

    @property
    def on_the_way(self) -> bool:
        """Whether it is the region of a slide."""
        return self.before is not None

    @property
    def intervals(self) -> dict[int, tuple[Contact, Contact]]:
        """The first and the last contact of each finger; of a slide, where it ends."""
        ends = zip(self.box.lower, self.box.upper, strict=True)
        return dict(zip(self.fingers, ends, strict=True))

    @property
    def widths(self) -> FloatArray:
        """How far each contact may be off backwards and forwards along its edge, shape (m, 2)."""
        at = self.grasp.positions
        back, ahead = at - self.box.lower.positions, self.box.upper.positions - at
        return np.asarray(np.stack((back, ahead), axis=1))


def regions(plan: Plan, *, slides: bool = True) -> tuple[Region, ...]:
    """Return the independent contact regions of a plan, in the order of time.

    Parameters
    ----------
    plan : Plan
    slides : bool, optional
        Whether those of slides are wanted, too.

    Returns
    -------
    tuple of Region
        One for the start, one for each slide, one after each step.

    Raises
    ------
    NotForceClosureError
        If the supporting fingers alone do not hold the object somewhere.
    """
    found = []
    for i, grasp in enumerate(plan.grasps):
        slide = plan.slides[i - 1] if slides and i else None
        if slide is not None:
            before, tolerance = plan.grasps[i - 1], plan.slide_tolerances[i - 1]
            fingers, ends = before.support.fingers, (before.contacts, grasp.contacts)
            found.append(_region(plan, slide[0], i, fingers, tolerance, *ends))
        functions, _ = plan.torques(grasp.contacts, grasp.support)
        fingers, tolerance = grasp.support.fingers, grasp.tolerance
        found.append(_region(plan, functions, i, fingers, tolerance, grasp.contacts))
    return tuple(found)


# --- one region ---------------------------------------------------------------------------------


def _region(
    plan: Plan,
    functions: TorqueFunctions,
    step: int,
    fingers: tuple[int, ...],
    tolerance: float,
    *ends: Mapping[int, Contact],
) -> Region:
    """The region around contacts at rest, or around those at both ends of a slide."""
    polygon = plan.polygon
    centers = np.array([Grasp([c[k] for k in fingers]).fractions for c in ends])
    passed = instants(polygon, ends[0], ends[-1])
    rooms = np.min([_rooms(plan, contacts, fingers) for contacts in passed], axis=0)
    corners = [_Corner(functions, centers, side) for side in (-1, 1)]
    lower, upper = (c.fractions(c.widest(r)) for c, r in zip(corners, rooms, strict=True))
    if lower is None or upper is None:
        raise NotForceClosureError(
            f"{'on the way of' if len(ends) > 1 else 'after'} step {step} fingers "
            f"{', '.join(map(str, fingers))} alone do not hold the object, so that they must not "
            "be off at all: plan.verify() tells whether the others help"
        )
    boxes = [
        Box(_grasp(polygon, functions, low), _grasp(polygon, functions, high))
        for low, high in zip(lower, upper, strict=True)
    ]
    grasp = Grasp([ends[-1][k] for k in fingers])
    before = boxes[0] if len(ends) > 1 else None
    return Region(step, fingers, grasp, tolerance, boxes[-1], before)


def _grasp(polygon: Polygon, functions: TorqueFunctions, fractions: FloatArray) -> Grasp:
    pairs = zip(functions.edges[0].tolist(), fractions.tolist(), strict=True)
    return polygon.resolve(Grasp.at_fractions(pairs))


def touchable_part(plan: Plan, finger: int, contact: Contact) -> tuple[float, float]:
    """Return from which to which fraction of its edge a finger may be, without leaving it.

    0 and 1 unless the hand has limits. A contact beyond them has no room.
    """
    assert contact.fraction is not None  # contacts of plans are resolved
    cones, f = plan.touchable, contact.fraction
    here = (cones.edge == contact.edge) & (cones.lower <= f) & (f <= cones.upper)
    if cones.whole is not cones:
        here &= cones.group == plan.hand.group_of(finger)
    part = np.flatnonzero(here)
    return (float(cones.lower[part[0]]), float(cones.upper[part[0]])) if part.size else (f, f)


def _rooms(plan: Plan, contacts: Mapping[int, Contact], fingers: tuple[int, ...]) -> FloatArray:
    """Lengths backwards and forwards to the end of what may be touched, shape (2, m).

    Of the gap to another finger on the edge, and of what the hand's limits leave of a distance
    between two fingers, each has half.
    """
    rooms, positions = {}, {}
    for finger, contact in contacts.items():
        (f,), length = Grasp([contact]).fractions, plan.polygon.edge_lengths[contact.edge]
        low, high = touchable_part(plan, finger, contact)
        rooms[finger] = np.array([f - low, high - f]) * length
        positions[finger] = f * length
    separation, span = plan.hand.fingertip_separation, plan.hand.max_span
    for one, other in combinations(contacts, 2):
        if contacts[one].edge == contacts[other].edge:
            first, second = sorted((one, other), key=positions.__getitem__)
            half = (positions[second] - positions[first]) / 2
            rooms[first][1] = min(rooms[first][1], half)
            rooms[second][0] = min(rooms[second][0], half)
        x, y = plan.polygon.point(contacts[one]) - plan.polygon.point(contacts[other])
        apart = float(np.hypot(x, y))
        most = apart - separation if separation > 0 else np.inf
        most = max(0.0, min(most, np.inf if span is None else span - apart)) / 2
        for finger in (one, other):
            rooms[finger] = np.minimum(rooms[finger], most)
    return np.asarray([rooms[k] for k in fingers]).T


class _Corner:
    """One extreme corner of boxes around contacts at rest, or around both ends of a slide.

    Parameters
    ----------
    functions : TorqueFunctions
        Of one combination.
    centers : numpy.ndarray, shape (1, m) or (2, m)
        Fractions at rest, or at both ends of a slide.
    side : {-1, 1}
        -1 for the lower corner, where some function has to be positive; 1 for the upper one.
    """

    def __init__(self, functions: TorqueFunctions, centers: FloatArray, side: int) -> None:
        valid = functions.valid[0]
        self._functions, self._centers, self._side = functions, centers, side
        self._values = np.array([-side * functions.certain_values(c)[0][valid] for c in centers])
        self._rates = functions.slopes[0][valid] / functions.lengths[0]

    def _holds(self, widths: FloatArray) -> bool:
        """Whether some function has the sign that it needs at this corner all along, in floats."""
        if not self._functions.spans[0]:
            return False
        values = self._values - self._rates @ widths
        return least_along(values[0], values[-1]) > 0

    def widest(self, rooms: FloatArray) -> FloatArray:
        """Return the widths of a maximal box, as even as possible, in lengths, shape (m,)."""
        widths, growing = np.zeros(len(rooms)), rooms > 0
        for _ in range(2 * len(rooms)):  # each or every other round brings one to its end
            widths = self._grown(widths, rooms, growing)
            able = np.array([self._grows(widths, rooms, i) for i in range(len(rooms))])
            if not able.any():
                break
            # Where each alone can go on but not all together, the first one does.
            first = np.arange(len(rooms)) == able.argmax()
            growing = first if (able == growing).all() else able
        return widths

    def _grown(self, widths: FloatArray, rooms: FloatArray, growing: BoolArray) -> FloatArray:
        """The growing widths all brought to the highest level that there is."""
        if not growing.any():  # all fingers are at an end
            return widths

        def at(level: float) -> FloatArray:
            return np.where(growing, np.clip(level, widths, rooms), widths)

        low, high = float(widths[growing].min()), float(rooms[growing].max())
        if self._holds(at(high)):
            return at(high)
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if self._holds(at(middle)) else (low, middle)
        # A little is kept, or rounding would block those that make no difference any more.
        return at(low - _BLOCKED * self._functions.cones.size / 4)

    def _grows(self, widths: FloatArray, rooms: FloatArray, i: int) -> bool:
        """Whether one width could be larger by more than `_BLOCKED`."""
        more = widths.copy()
        more[i] += _BLOCKED * self._functions.cones.size
        return bool(more[i] < rooms[i]) and self._holds(more)

    def fractions(self, widths: FloatArray) -> FloatArray | None:
        """Return the corner at the centres, (1, m) or (2, m), moved back until it is certain.

        None if not even the centres are.
        """
        part = 0.0
        while part <= 1.0:
            at = self._centers + self._side * (1 - part) * widths / self._functions.lengths[0]
            at = np.where(at <= FRACTION_SNAP, 0.0, np.where(at >= 1 - FRACTION_SNAP, 1.0, at))
            if self._certain(at):
                return at
            part = max(2 * part, _STEP_BACK)
        return None

    def _certain(self, at: FloatArray) -> bool:
        """Whether some function has the sign that it needs at each instant, in integers.

        A function has it before or after one instant, always or never: the first kind has to
        reach farther than where the second begins.
        """
        if not self._functions.spans[0]:
            return False
        constants, slopes = self._functions.exact_coefficients(0)
        ends = [[Fraction(f) for f in row] for row in (at[0].tolist(), at[-1].tolist())]
        until, since = Fraction(0), Fraction(1)
        for constant, slope in zip(constants, slopes, strict=True):
            first, last = (
                -self._side * (constant + sum(a * f for a, f in zip(slope, end, strict=True)))
                for end in ends
            )
            if first > 0 and last > 0:
                return True
            if first > 0:
                until = max(until, first / (first - last))
            elif last > 0:
                since = min(since, first / (first - last))
        return until > since
