"""A hand's limits in the verification of a plan: decided exactly, from the plan's file alone.

Limits are lengths, and the length of an edge is a square root: squares are compared, in rational
numbers. Shares nothing with the planner.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from regrasp_lp.planning.plan_document import LimitsDocument, Place
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

    def at(self, place: Place) -> str | None:
        """Check a contact (on an edge of the object, with a fraction in [0, 1])."""
        return self.along(place, place)

    def along(self, start: Place, end: Place) -> str | None:
        """Check a slide along an edge."""
        edge, (low, high) = start[0], sorted((Fraction(start[1]), Fraction(end[1])))
        square, clear = self._square(edge), Fraction(self.limits.edge_clearance) ** 2
        if low**2 * square < clear or (1 - high) ** 2 * square < clear:
            return (
                f"is nearer than edge_clearance = {self.limits.edge_clearance!r} of the hand to an "
                f"end of edge {edge}"
            )
        intervals = self.limits.reachable.get(edge)
        if intervals is None:
            return None
        for first, last in intervals:
            if low**2 * square >= Fraction(first) ** 2 and high**2 * square <= Fraction(last) ** 2:
                return None
        if not intervals:
            return f"is on edge {edge}, which the hand may not touch (reachable)"
        if start != end and self.at(start) is None and self.at(end) is None:
            return f"passes over a part of edge {edge} that the hand may not touch (reachable)"
        return f"is on a part of edge {edge} that the hand may not touch (reachable)"

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
