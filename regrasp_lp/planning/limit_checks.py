"""A hand's limits in the verification of a plan: decided exactly, from the plan's file alone.

Limits are lengths, and the length of an edge is a square root: squares are compared, in rational
numbers. Shares nothing with the planner.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from regrasp_lp.planning.plan_document import (
    LimitsDocument,
    Place,
    PlaceStep,
    ReachDocument,
    ReleaseStep,
    SlideStep,
)
from regrasp_lp.polygon import Polygon

Point = tuple[Fraction, Fraction]


@dataclass(frozen=True)
class LimitChecks:
    """What a hand's limits say of contacts, of slides and of pairs of fingers.

    Every check returns what is wrong, as the end of a sentence, or None.

    Parameters
    ----------
    polygon : Polygon
    limits : LimitsDocument
    """

    polygon: Polygon
    limits: LimitsDocument

    def at(self, place: Place, finger: int | None = None) -> str | None:
        """Check a contact (on an edge of the object, with a fraction in [0, 1]) of a finger."""
        return self.along(place, place, finger)

    def along(self, start: Place, end: Place, finger: int | None = None) -> str | None:
        """Check a slide of a finger along an edge; None stands for any finger."""
        edge, (low, high) = start[0], sorted((Fraction(start[1]), Fraction(end[1])))
        square, clear = self._square(edge), Fraction(self.limits.edge_clearance) ** 2
        if low**2 * square < clear or (1 - high) ** 2 * square < clear:
            return (
                f"is nearer than edge_clearance = {self.limits.edge_clearance!r} of the hand to an "
                f"end of edge {edge}"
            )
        for who, name, reach in (
            ("the hand", "reachable", self.limits.reachable),
            (f"finger {finger}", "finger_reachable", self._reach_of(finger)),
        ):
            outside = self._outside(reach.get(edge), edge, low, high)
            if outside is not None:
                return f"{outside} {who} may not touch ({name})"
        return None

    def _reach_of(self, finger: int | None) -> ReachDocument:
        return {} if finger is None else self.limits.finger_reachable.get(finger, {})

    def _outside(
        self,
        intervals: tuple[tuple[float, float], ...] | None,
        edge: int,
        low: Fraction,
        high: Fraction,
    ) -> str | None:
        """What is wrong with a part of an edge of which some intervals may be touched."""
        if intervals is None:
            return None
        if not intervals:
            return f"is on edge {edge}, which"
        square = self._square(edge)

        def within(first: Fraction, last: Fraction) -> bool:
            return any(
                first**2 * square >= Fraction(a) ** 2 and last**2 * square <= Fraction(b) ** 2
                for a, b in intervals
            )

        if within(low, high):
            return None
        if low != high and within(low, low) and within(high, high):
            return f"passes over a part of edge {edge} that"
        return f"is on a part of edge {edge} that"

    def done_by(self, step: PlaceStep | ReleaseStep | SlideStep) -> str | None:
        """Check that the fingers of a step may do it: some do not slide, others only do."""
        if isinstance(step, SlideStep):
            fingers, never = [move.finger for move in step.moves], self.limits.only_place
            text = "may not slide (only_place)"
        else:
            fingers, never = [step.finger], self.limits.only_slide
            text = "may not be placed or released (only_slide)"
        return next((f"finger {finger} {text}" for finger in fingers if finger in never), None)

    def apart(self, vector: Point) -> str | None:
        """Check the vector from one touching finger to another."""
        square = vector[0] ** 2 + vector[1] ** 2
        span, separation = self.limits.max_span, self.limits.fingertip_separation
        distance = f"are {float(square) ** 0.5:.9g} apart"
        if span is not None and square > Fraction(span) ** 2:
            return f"{distance}, more than max_span = {span!r} of the hand"
        if square < Fraction(separation) ** 2:
            return f"{distance}, less than fingertip_separation = {separation!r} of the hand"
        return None

    def nearest(self, before: Point, after: Point) -> Fraction:
        """Return when two fingers that slide at constant speed are nearest to each other."""
        (x, y), (u, v) = before, (after[0] - before[0], after[1] - before[1])
        speed = u * u + v * v
        return min(max(-(x * u + y * v) / speed, Fraction(0)), Fraction(1)) if speed else speed

    def _square(self, edge: int) -> Fraction:
        """The square of the length of an edge."""
        ends = self.polygon.edge_starts[edge].tolist(), self.polygon.edge_ends[edge].tolist()
        (ax, ay), (bx, by) = ends
        return (Fraction(bx) - Fraction(ax)) ** 2 + (Fraction(by) - Fraction(ay)) ** 2
