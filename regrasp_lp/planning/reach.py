"""Where on an object the fingers of a hand may be: the segments of its edges that they can touch.

A limit is a length and the length of an edge a square root, so that the place of a limit on an edge
need not be a double. Segments end at the last doubles that are within the limits, exactly: a
fraction that is a double is within the limits iff it is on a segment.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from fractions import Fraction
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.contact import FRACTION_SNAP, Contact, Grasp
from regrasp_lp.errors import HandError
from regrasp_lp.friction import UNIT_ROUNDOFF, Cones
from regrasp_lp.grasp_sets.spacing import Spacing
from regrasp_lp.planning.hand import Hand
from regrasp_lp.polygon import Polygon

_LEAST = 2 * FRACTION_SNAP
"""Contacts nearer than this to the end of an edge, or to another limit, may snap to it."""

_ROUNDINGS = 16 * UNIT_ROUNDOFF


def hand_cones(polygon: Polygon, friction: ArrayLike, hand: Hand) -> Cones:
    """Return the friction cones of all that the fingers of a hand may touch.

    Parameters
    ----------
    polygon : Polygon
    friction : float or sequence of float
        μ, one value or one per edge.
    hand : Hand

    Returns
    -------
    Cones
        ``Cones.of(polygon, friction)`` if the hand may touch all of every edge. What is no longer
        than 2e-12 of an edge is left out.

    Raises
    ------
    PolygonError, FrictionError
        As `Cones.of`.
    HandError
        If the hand's `reachable` names an edge that the polygon does not have.
    """
    cones = Cones.of(polygon, friction)
    if not (hand.edge_clearance or hand.reachable):
        return cones
    for edge in hand.intervals:
        if edge >= polygon.n_edges:
            raise HandError(
                f"reachable names edge {edge}; {polygon.name or 'the polygon'} has edges 0 to "
                f"{polygon.n_edges - 1}"
            )
    segments = [
        (edge, lower, upper)
        for edge in range(polygon.n_edges)
        for lower, upper in _on_edge(cones, edge, hand)
    ]
    number = np.array([edge for edge, _, _ in segments], dtype=np.intp)
    ends = np.array([ends for _, *ends in segments], dtype=np.float64).reshape(-1, 2)
    whole = len(segments) == polygon.n_edges and bool((ends == [0.0, 1.0]).all())
    return cones if whole else cones.touching(number, ends[:, 0], ends[:, 1])


def spacing_of(cones: Cones, hand: Hand) -> Spacing | None:
    """Return a hand's limits to the distance between fingers, if there are any."""
    if not hand.spaced:
        return None
    return Spacing(cones, hand.max_span, hand.fingertip_separation)


def within_reach(polygon: Polygon, hand: Hand, grasp: Grasp, role: str) -> Grasp:
    """Return a grasp with contacts that are within rounding of a limit of the hand moved onto it.

    Parameters
    ----------
    polygon : Polygon
    hand : Hand
    grasp : Grasp
        Resolved.
    role : str
        "start" or "goal", for messages.

    Returns
    -------
    Grasp
        Resolved.

    Raises
    ------
    HandError
        If a contact is where the hand may not touch, or two of them are too far apart or too near;
        the message says which, and what the limit is. Both are decided exactly.
    """
    cones = hand_cones(polygon, 1.0, hand)
    segments, fractions = cones.places(grasp.edges, grasp.fractions)
    for contact, segment in zip(grasp, segments.tolist(), strict=True):
        if segment < 0:
            raise HandError(
                f"the {role} has a contact on edge {contact.edge} at {contact.position:.6g}, where "
                f"the hand may not touch: {_allowed(cones, hand, contact)}"
            )
    pairs = zip(grasp.edges.tolist(), fractions.tolist(), strict=True)
    found = polygon.resolve(Grasp.at_fractions(pairs))
    for one, other in combinations(found, 2):
        fault = _distance_fault(cones, hand, one, other)
        if fault is not None:
            raise HandError(
                f"the {role} has contacts on edge {one.edge} at {one.position:.6g} and on edge "
                f"{other.edge} at {other.position:.6g}, {fault} of the hand"
            )
    return found


def _distance_fault(cones: Cones, hand: Hand, one: Contact, other: Contact) -> str | None:
    """What is wrong with the distance of two contacts, exactly."""
    points = [_point(cones, contact) for contact in (one, other)]
    square = sum(((p - q) ** 2 for p, q in zip(*points, strict=True)), Fraction(0))
    distance = f"{math.sqrt(square):.6g} apart"
    if hand.max_span is not None and square > Fraction(hand.max_span) ** 2:
        return f"{distance}, more than max_span={hand.max_span:g}"
    if square < Fraction(hand.fingertip_separation) ** 2:
        return f"{distance}, less than fingertip_separation={hand.fingertip_separation:g}"
    return None


def _point(cones: Cones, contact: Contact) -> list[Fraction]:
    whole, f = cones.whole, Fraction(contact.fraction or 0.0)
    start, vector = whole.exact_starts[contact.edge], whole.exact_vectors[contact.edge]
    return [(int(a) + f * int(v)) / whole.exact_unit for a, v in zip(start, vector, strict=True)]


def room(cones: Cones, hand: Hand, contacts: Iterable[Contact]) -> float:
    """Return how far fingers may be off their places on their edges within the hand's limits.

    Parameters
    ----------
    cones : Cones
        `hand_cones` of the object.
    hand : Hand
    contacts : iterable of Contact
        Where they are (resolved).

    Returns
    -------
    float
        In the object's unit; of a distance between two fingers half of what is left. Negative
        beyond a limit, inf without limits.
    """
    touching = list(contacts)
    least = math.inf
    if cones.whole is not cones:
        for contact in touching:
            assert contact.fraction is not None  # resolved
            here = cones.edge == contact.edge
            within = np.minimum(contact.fraction - cones.lower, cones.upper - contact.fraction)
            inside = float(within[here].max(initial=-math.inf))
            least = min(least, inside * float(cones.whole.lengths[contact.edge]))
    for one, other in combinations(touching, 2):
        points = zip(_point(cones, one), _point(cones, other), strict=True)
        distance = math.sqrt(sum((p - q) ** 2 for p, q in points))
        if hand.max_span is not None:
            least = min(least, (hand.max_span - distance) / 2)
        if hand.fingertip_separation > 0:
            least = min(least, (distance - hand.fingertip_separation) / 2)
    return least


def _allowed(cones: Cones, hand: Hand, contact: Contact) -> str:
    """Where on the edge of a contact a hand may touch, and why not elsewhere."""
    limits = [f"edge_clearance={hand.edge_clearance:g}"] if hand.edge_clearance else []
    limits += ["reachable"] if contact.edge in hand.intervals else []
    here = np.flatnonzero(cones.edge == contact.edge)
    length = cones.whole.lengths[contact.edge]
    parts = [
        f"from {low * length:.6g} to {high * length:.6g}"
        for low, high in zip(cones.lower[here], cones.upper[here], strict=True)
    ]
    where = " and ".join(parts) if parts else "nowhere"
    return f"{where} on this edge ({' and '.join(limits)} of the hand)"


def _on_edge(cones: Cones, edge: int, hand: Hand) -> list[tuple[float, float]]:
    """First and last fractions, as doubles, of the segments of one edge."""
    vector = [Fraction(int(v), cones.exact_unit) for v in cones.exact_vectors[edge]]
    square = vector[0] ** 2 + vector[1] ** 2
    length = float(cones.lengths[edge])

    def first(position: float) -> float:
        """The least double within ``f l >= position``."""
        least = Fraction(position) ** 2
        return _least_double(position / length, lambda f: f**2 * square >= least)

    def last(position: float) -> float:
        """The largest double within ``f l <= position``."""
        most = Fraction(position) ** 2
        return _before(_least_double(position / length, lambda f: f**2 * square > most))

    clear = Fraction(hand.edge_clearance) ** 2
    near_end = 1 - hand.edge_clearance / length
    kept = _before(_least_double(near_end, lambda f: (1 - f) ** 2 * square < clear))
    segments = []
    for low, high in hand.intervals.get(edge, ((0.0, math.inf),)):
        lower = first(max(low, hand.edge_clearance))
        upper = kept if high > 2 * length else min(kept, last(high))
        lower = lower if lower == 0 else max(lower, _LEAST)
        upper = upper if upper == 1 else min(upper, 1 - _LEAST)
        if upper - lower > _LEAST:
            segments.append((lower, upper))
    return segments


def _least_double(near: float, holds: Callable[[Fraction], bool]) -> float:
    """The least double in [0, 1] at which a condition holds that then holds for all larger ones.

    `near` is no farther from it than a few roundings of 1; 2 if the condition holds nowhere.
    """
    around = np.clip(np.array([near - _ROUNDINGS, near + _ROUNDINGS]), 0.0, 1.0)
    if holds(Fraction(float(around[0]))):
        return float(around[0])
    if not holds(Fraction(float(around[1]))):
        return 2.0
    low, high = around.view(np.int64).tolist()  # doubles from 0 on are in the order of their bits
    while high - low > 1:
        middle = (low + high) // 2
        if holds(Fraction(_double(middle))):
            high = middle
        else:
            low = middle
    return _double(high)


def _double(bits: int) -> float:
    return float(np.array([bits], dtype=np.int64).view(np.float64)[0])


def _before(fraction: float) -> float:
    """The next smaller double; -1 before 0, and 1 before what is nowhere in [0, 1]."""
    if fraction > 1:
        return 1.0
    return -1.0 if fraction == 0 else math.nextafter(fraction, -1.0)
