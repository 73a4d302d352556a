"""Where on an object the fingers of a hand may be: the segments of its edges that they can touch.

A limit is a length and the length of an edge a square root, so that the place of a limit on an edge
need not be a double. Segments end at the last doubles that are within the limits, exactly: a
fraction that is a double is within the limits iff it is on a segment.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.contact import FRACTION_SNAP, Contact, Grasp
from regrasp_lp.errors import HandError
from regrasp_lp.friction import UNIT_ROUNDOFF, Cones
from regrasp_lp.grasp_sets.spacing import Spacing, assignments
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.touching import Intervals, united_intervals
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
        If `reachable` or `finger_reachable` names an edge that the polygon does not have.
    """
    cones = Cones.of(polygon, friction)
    if not (hand.edge_clearance or hand.reachable or hand.finger_reachable or hand.coupled):
        return cones
    reach = [hand.intervals_of(group[0]) for group in hand.groups]
    named = max((edge for intervals in reach for edge in intervals), default=-1)
    if named >= polygon.n_edges:
        where = "reachable" if named in hand.intervals else "finger_reachable"
        raise HandError(
            f"{where} names edge {named}; {polygon.name or 'the polygon'} has edges 0 to "
            f"{polygon.n_edges - 1}"
        )
    segments = sorted(
        (edge, *ends, group)
        for edge in range(polygon.n_edges)
        for group, intervals in enumerate(reach)
        for ends in _on_edge(cones, edge, intervals, hand.edge_clearance)
    )
    edges, lower, upper, groups = np.array(segments, dtype=np.float64).reshape(-1, 4).T
    whole = len(segments) == polygon.n_edges and bool((upper - lower == 1).all())
    if whole:
        return cones
    return cones.touching(edges.astype(np.intp), lower, upper, groups.astype(np.intp))


def spacing_of(cones: Cones, hand: Hand) -> Spacing | None:
    """Return a hand's limits that tie fingers to each other, if there are any."""
    if not hand.coupled:
        return None
    sizes = tuple(len(group) for group in hand.groups)
    return Spacing(cones, hand.max_span, hand.fingertip_separation, sizes)


def within_reach(polygon: Polygon, hand: Hand, grasp: Grasp, role: str) -> Grasp:
    """Return a grasp with contacts that are within rounding of a limit of the hand moved onto it.

    Parameters
    ----------
    polygon : Polygon
    hand : Hand
    grasp : Grasp
        Resolved.
    role : str
        "start", which is held by certain fingers, or "goal"; for messages, too.

    Returns
    -------
    Grasp
        Resolved.

    Raises
    ------
    HandError
        If a contact is where the hand may not touch, or two of them are too far apart or too near;
        the message says which, and what the limit is. Both are decided exactly. Also if the hand
        has no different fingers for all of the contacts.
    """
    cones = hand_cones(polygon, 1.0, hand)
    fingers = start_fingers(grasp) if role == "start" else None
    group = None if fingers is None else np.array([hand.group_of(finger) for finger in fingers])
    segments, fractions = cones.places(grasp.edges, grasp.fractions, group)
    for n, (contact, segment) in enumerate(zip(grasp, segments.tolist(), strict=True)):
        if segment < 0:
            finger = None if fingers is None else fingers[n]
            raise HandError(
                f"the {role} has a contact on edge {contact.edge} at {contact.position:.6g}, where "
                f"{_allowed(cones, hand, contact, finger)}"
            )
    if not assignments(cones, [len(g) for g in hand.groups], grasp.edges, fractions, group):
        raise HandError(
            f"the {role} has contacts on edges {grasp.edges.tolist()}, for which the hand has no "
            "different fingers that may all touch there (finger_reachable)"
        )
    pairs = zip(grasp.edges.tolist(), fractions.tolist(), strict=True)
    found = polygon.resolve(Grasp.at_fractions(pairs, fingers))
    for one, other in combinations(found, 2):
        fault = _distance_fault(cones, hand, one, other)
        if fault is not None:
            raise HandError(
                f"the {role} has contacts on edge {one.edge} at {one.position:.6g} and on edge "
                f"{other.edge} at {other.position:.6g}, {fault} of the hand"
            )
    return found


def start_fingers(start: Grasp) -> tuple[int, ...]:
    """Return the finger of each contact of a start."""
    return start.fingers or tuple(range(1, len(start) + 1))


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


def room(cones: Cones, hand: Hand, contacts: Mapping[int, Contact]) -> float:
    """Return how far fingers may be off their places on their edges within the hand's limits.

    Parameters
    ----------
    cones : Cones
        `hand_cones` of the object.
    hand : Hand
    contacts : mapping of int to Contact
        Where which fingers are (resolved).

    Returns
    -------
    float
        In the object's unit; of a distance between two fingers half of what is left. Negative
        beyond a limit, inf without limits.
    """
    least = math.inf
    if cones.whole is not cones:
        for finger, contact in contacts.items():
            assert contact.fraction is not None  # resolved
            here = (cones.edge == contact.edge) & (cones.group == hand.group_of(finger))
            within = np.minimum(contact.fraction - cones.lower, cones.upper - contact.fraction)
            inside = float(within[here].max(initial=-math.inf))
            least = min(least, inside * float(cones.whole.lengths[contact.edge]))
    for one, other in combinations(contacts.values(), 2):
        points = zip(_point(cones, one), _point(cones, other), strict=True)
        distance = math.sqrt(sum((p - q) ** 2 for p, q in points))
        if hand.max_span is not None:
            least = min(least, (hand.max_span - distance) / 2)
        if hand.fingertip_separation > 0:
            least = min(least, (distance - hand.fingertip_separation) / 2)
    return least


def _allowed(cones: Cones, hand: Hand, contact: Contact, finger: int | None) -> str:
    """Where on the edge of a contact a hand (a finger of it) may touch, and why not elsewhere."""
    edge, common = contact.edge, hand.intervals
    here = cones.edge == edge
    who, fingers = "the hand", list(range(1, hand.fingers + 1))
    if finger is not None and len(hand.groups) > 1:
        who, fingers = f"finger {finger}", [finger]
        here &= cones.group == hand.group_of(finger)
    limits = [f"edge_clearance={hand.edge_clearance:g}"] if hand.edge_clearance else []
    limits += ["reachable"] if edge in common else []
    own = any(hand.intervals_of(k).get(edge) != common.get(edge) for k in fingers)
    limits += ["finger_reachable"] if own else []
    length = cones.whole.lengths[edge]
    ends = zip(cones.lower[here].tolist(), cones.upper[here].tolist(), strict=True)
    parts = [
        f"from {low * length:.6g} to {high * length:.6g}" for low, high in united_intervals(ends)
    ]
    where = " and ".join(parts) if parts else "nowhere"
    return f"{who} may not touch: {where} on this edge ({' and '.join(limits)} of the hand)"


def _on_edge(
    cones: Cones, edge: int, intervals: Mapping[int, Intervals], clearance: float
) -> list[tuple[float, float]]:
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

    clear = Fraction(clearance) ** 2
    near_end = 1 - clearance / length
    kept = _before(_least_double(near_end, lambda f: (1 - f) ** 2 * square < clear))
    segments = []
    for low, high in intervals.get(edge, ((0.0, math.inf),)):
        lower = first(max(low, clearance))
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
