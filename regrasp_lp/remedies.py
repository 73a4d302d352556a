"""What would make a grasp force closure: more friction, one contact moved, or all a little.

On the torque functions of its edges a grasp u is in force closure iff it is in D, where some
function is negative, and in U, where some function is positive: D is a down-set, U an up-set, and
together they cover the box of all positions (``docs/theory.md``, section 4).

**One contact.** With the others in place D and U leave it the open interval (υ, δ), δ the largest
root of a function in its position and υ the least. It has to go beyond the nearer end of it.

**All contacts, each by at most t.** These grasps are the box from ``u - t`` to ``u + t``, clamped
to the edges. It has a grasp in force closure iff its lower corner is in D and its upper corner is
in U (Corollary 2, whose proof needs no more than a box that is not thin: some grasp of the box is
in D iff the lower corner is, in U iff the upper one is, and the parts of the diagonal that are in
D and in U overlap where neither is empty, because D and U cover it. The one point that they may
leave out has a contact at the end of its edge and another at the start of its own; only a corner
of a box is like that, and never the lower or the upper corner). Each function falls, or rises,
piecewise linearly in t there, with a bend where a contact reaches the end of its edge, so that
the least t is the larger one of the least root over the functions for D and of that for U.

**A limited hand.** Contacts slide along what the hand may touch of their edges: along segments, for
which all of this holds as for edges. What its limits to the distances between fingers leave is no
box: they are checked of the grasps that are suggested.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import ROUND_CEILING, Context
from fractions import Fraction

import numpy as np

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import ContactError, HandError
from regrasp_lp.force_closure import is_force_closure, least_friction
from regrasp_lp.friction import FloatArray
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.reach import hand_cones, within_reach
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import TorqueFunctions, torque_functions

_UPWARDS = Context(prec=6, rounding=ROUND_CEILING)
"""Six digits of a length or a friction that do suffice."""

_BEYOND = (1e-3, 1e-2, 1e-1, 1.0)
"""How far beyond a threshold, relatively, a grasp is looked for; farther if doubles ask for it."""

_DIGITS = (4, 6, 9, 12)
"""Of the positions of a grasp that is suggested: as few as keep it in force closure."""


@dataclass(frozen=True)
class ContactMove:
    """The move of one contact along its edge that makes a grasp force closure.

    Parameters
    ----------
    contact : int
        Which contact of the grasp.
    before : Contact
        Where it is.
    distance : float
        It has to move by more than this, in the object's unit (0: any move will do).
    interval : tuple of float
        The positions between which it makes the grasp force closure; an end of the edge, or of
        what the hand may touch of it, belongs to them.
    grasp : Grasp or None
        The grasp with this contact a little beyond the threshold, in force closure and within the
        limits of the hand exactly; None if no double was found in the interval.
    """

    contact: int
    before: Contact
    distance: float
    interval: tuple[float, float]
    grasp: Grasp | None

    @property
    def forward(self) -> bool:
        """Whether it moves towards the end of its edge."""
        assert self.before.position is not None  # resolved
        return sum(self.interval) / 2 > self.before.position  # all of it is on one side

    def __str__(self) -> str:
        way = "forward" if self.forward else "back"
        far = f"by more than {self.distance:.6g}" if self.distance > 0 else "ever so little"
        text = f"the contact on edge {self.before.edge} moved {way} {far}"
        if self.grasp is None:
            return text
        return f"{text} (to {_place(self.grasp[self.contact])}, say)"


@dataclass(frozen=True)
class CommonMove:
    """The least bound on the moves of all contacts that makes a grasp force closure.

    Parameters
    ----------
    distance : float
        Every contact moves by no more than just above this, in the object's unit. With no larger
        moves than this there is no force closure.
    grasp : Grasp or None
        A grasp a little farther away, in force closure and within the limits of the hand exactly;
        None if no double was found.
    """

    distance: float
    grasp: Grasp | None

    def __str__(self) -> str:
        text = f"every contact moved by {self.distance:.6g} or a little more"
        return text if self.grasp is None else f"{text} (to {contacts_text(self.grasp)}, say)"


@dataclass(frozen=True)
class Remedy:
    """What would make a grasp force closure, each on its own; `str` says it in one line.

    Parameters
    ----------
    grasp : Grasp
        Resolved; not in force closure.
    friction : float or None
        The least friction on all edges (`least_friction`); None if none will do.
    move : ContactMove or None
        The shortest move of one contact at the given friction; None if no single one suffices.
    together : CommonMove or None
        The least bound on the moves of all contacts; None if no grasp on these edges is in force
        closure at the given friction.
    hand : Hand
        Contacts move along what it may touch of their edges, from where they are.
    """

    grasp: Grasp
    friction: float | None
    move: ContactMove | None
    together: CommonMove | None
    hand: Hand = field(default_factory=Hand)

    def __str__(self) -> str:
        limited = self.hand.limited
        along = "slide within the limits of the hand" if limited else "move along these edges"
        move = self.move or self.together
        if self.friction is None:
            but = "no friction makes it so, but at this friction it would be"
            none = f"no friction makes it so, and at this friction no {along}: take other "
            none += "places" if limited else "edges"
        else:
            but = f"it would be at a friction of {upwards(self.friction)} on all edges or more"
            none, but = f"{but}; no {along} does it", f"{but}, or"
        if move is None:
            return none
        apart = "; none was found that keeps the distances between the fingers of the hand"
        return f"{but} with {move}{apart if self.hand.spaced and move.grasp is None else ''}"


def upwards(value: float) -> str:
    """Return six digits of a number, rounded up.

    Examples
    --------
    >>> upwards(0.25), upwards(1 / 3)
    ('0.25', '0.333334')
    """
    rounded = _UPWARDS.create_decimal(value).normalize()
    return f"{rounded:f}" if 1e-4 <= value < 1e6 else f"{rounded:g}"


def contacts_text(grasp: Grasp) -> str:
    """Return the contacts of a resolved grasp as words, in its order."""
    return ", ".join(f"edge {c.edge} at {_place(c)}" for c in grasp)


def _place(contact: Contact) -> str:
    """The position, which has been rounded to so many digits if it was chosen here."""
    return f"{contact.position:.12g}"


def remedy(
    polygon: Polygon, grasp: Grasp, friction: FloatArray, hand: Hand | None = None
) -> Remedy:
    """Return what would make a grasp force closure.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp
        Resolved, of any number of contacts on at least two edges; not in force closure.
    friction : numpy.ndarray, shape (n_edges,)
    hand : Hand, optional
        One without limits by default.

    Returns
    -------
    Remedy

    Raises
    ------
    HandError
        If the hand may not touch where the contacts are.

    Examples
    --------
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    >>> grasp = square.resolve([(0, 0.5), (2, 0.125)])
    >>> found = remedy(square, grasp, np.full(4, 0.25))
    >>> round(found.friction, 8), found.move.contact, found.move.distance
    (0.375, 0, 0.125)
    >>> remedy(square, grasp, np.full(4, 0.25), Hand(reachable={0: (0.4, 0.6)})).move.contact
    1
    """
    slides = _Slides.of(polygon, grasp, friction, hand or Hand())
    moves = [move for contact in range(len(grasp)) if (move := slides.of_one(contact)) is not None]
    return Remedy(
        grasp,
        least_friction(polygon, grasp),
        min(moves, key=slides.preference, default=None),
        slides.of_all(),
        slides.hand,
    )


@dataclass(frozen=True, eq=False)
class _Slides:
    """A grasp, and the segments of edges along which its contacts may slide.

    Parameters
    ----------
    starts : numpy.ndarray, shape (m,)
        Positions at which the segments start.
    functions : TorqueFunctions
        Of the segments.
    fractions : numpy.ndarray, shape (m,)
        Of the segments.
    """

    polygon: Polygon
    grasp: Grasp
    friction: FloatArray
    hand: Hand
    starts: FloatArray
    functions: TorqueFunctions
    fractions: FloatArray

    @classmethod
    def of(cls, polygon: Polygon, grasp: Grasp, friction: FloatArray, hand: Hand) -> _Slides:
        held = within_reach(polygon, hand, grasp, "grasp") if hand.limited else grasp
        cones = hand_cones(polygon, friction, hand)
        named = held.fingers or grasp.fingers
        group = None if named is None else np.array([hand.group_of(k) for k in named])
        segments, fractions = cones.places(held.edges, held.fractions, group)
        starts = cones.lower[segments] * cones.whole.lengths[grasp.edges]
        functions = torque_functions(cones, segments[None, :])
        within = cones.within(segments, fractions)
        return cls(polygon, grasp, friction, hand, starts, functions, within)

    def preference(self, move: ContactMove) -> tuple[bool, float]:
        """The shortest move comes first, but for those that fingers too near or far rule out."""
        return self.hand.spaced and move.grasp is None, move.distance

    def of_one(self, contact: int) -> ContactMove | None:
        """The move of one contact into the interval (υ, δ) that the others leave it, if any."""
        interval = _interval(self.functions, self.fractions, contact)
        if interval is None:
            return None
        low, high = (min(max(end, Fraction(0)), Fraction(1)) for end in interval)
        here = Fraction(float(self.fractions[contact]))
        near, far = (low, high) if here <= low else (high, low)
        start, length = float(self.starts[contact]), float(self.functions.lengths[0, contact])
        found, positions = None, self.grasp.positions.copy()
        for beyond in _BEYOND:
            part = min(Fraction(beyond), abs(far - near) / 2)
            to = near + (part if far > near else -part)
            positions[contact] = start + float(to) * length
            bound = float(abs(near - here) + 2 * part) * length
            found = self._rounded(positions, bound)
            if found is not None:
                break
        return ContactMove(
            contact,
            self.grasp[contact],
            float(abs(near - here)) * length,
            (start + float(low) * length, start + float(high) * length),
            found,
        )

    def of_all(self) -> CommonMove | None:
        """The least common bound, and a grasp a little beyond it."""
        functions = self.functions
        if not functions.exists()[0]:
            return None
        least = common_bound(functions, self.fractions)
        for beyond in _BEYOND:
            bound = least * (1 + beyond) + beyond * self.polygon.diameter / 10
            for fractions in _on_diagonal(functions, self.fractions, bound):
                moved = self._rounded(self.starts + fractions * functions.lengths[0], bound)
                if moved is not None:
                    return CommonMove(least, moved)
        return CommonMove(least, None)

    def _rounded(self, positions: FloatArray, bound: float) -> Grasp | None:
        """The grasp at positions of few digits, in force closure exactly, no two at one point.

        None if it is not even so at twelve digits, or has moved farther than `bound`.
        """
        for digits in _DIGITS:
            rounded = [float(f"{u:.{digits}g}") for u in positions.tolist()]
            moves = zip(self.grasp, positions.tolist(), rounded, strict=True)
            contacts = [c if u == c.position else Contact(c.edge, r) for c, u, r in moves]
            try:
                moved = self.polygon.resolve(Grasp(contacts))
                if self.hand.limited:
                    moved = within_reach(self.polygon, self.hand, moved, "grasp")
            except (ContactError, HandError):  # rounded off the end of its edge, or out of reach
                continue
            near = np.abs(moved.positions - self.grasp.positions).max() <= bound
            apart = near and _distinct(self.polygon, moved)
            if apart and is_force_closure(self.polygon, moved, self.friction):
                return moved
        return None


def _distinct(polygon: Polygon, grasp: Grasp) -> bool:
    points = polygon.points(grasp.edges, grasp.fractions).tolist()
    return len({tuple(point) for point in points}) == len(grasp)


# --- of torque functions ------------------------------------------------------------------------


def _interval(
    functions: TorqueFunctions, fractions: FloatArray, contact: int
) -> tuple[Fraction, Fraction] | None:
    """(υ, δ) of one contact, others fixed, if it has a point in [0, 1]; -1 and 2 for no bound."""
    if not functions.spans[0]:
        return None
    places = [Fraction(f) for f in fractions.tolist()]
    low, high = Fraction(2), Fraction(-1)
    for constant, slopes in zip(*functions.exact_coefficients(0), strict=True):
        others = [
            s * f for i, (s, f) in enumerate(zip(slopes, places, strict=True)) if i != contact
        ]
        value, slope = constant + sum(others), slopes[contact]
        if slope:
            low, high = min(low, -value / slope), max(high, -value / slope)
        elif value > 0:
            low = Fraction(-1)
        elif value < 0:
            high = Fraction(2)
    return (low, high) if low < high and low < 1 and high > 0 else None


def common_bound(functions: TorqueFunctions, fractions: FloatArray) -> float:
    """Return the least t such that moves of at most t, and a little more, give force closure.

    Parameters
    ----------
    functions : TorqueFunctions
        One combination, on which some grasp is in force closure.
    fractions : numpy.ndarray, shape (m,)
        A grasp.

    Returns
    -------
    float
        In the object's unit; 0 for a grasp in the closure of the set.
    """
    lengths, valid = functions.lengths[0], functions.valid[0]
    values = functions.certain_values(fractions)[0][valid]
    rates = functions.slopes[0][valid] / lengths
    back = [_first_root(v, r, fractions * lengths) for v, r in zip(values, rates, strict=True)]
    forth = [
        _first_root(-v, r, (1 - fractions) * lengths) for v, r in zip(values, rates, strict=True)
    ]
    return float(max(min(back), min(forth)))


def _first_root(excess: float, rates: FloatArray, room: FloatArray) -> float:
    """The least t >= 0 beyond which ``Σ rates_i min(t, room_i) > excess``, at most all the room."""
    if excess < 0:
        return 0.0
    bends = np.concatenate(([0.0], np.sort(room)))
    gains = (rates * np.minimum(bends[:, None], room)).sum(axis=1)
    n = int(np.searchsorted(gains, excess, side="right"))
    if n == len(gains):  # never; the least over all functions is not larger for it
        return float(bends[-1])
    part = (excess - gains[n - 1]) / (gains[n] - gains[n - 1])
    return float(bends[n - 1] + part * (bends[n] - bends[n - 1]))


def _on_diagonal(
    functions: TorqueFunctions, fractions: FloatArray, bound: float
) -> Iterator[FloatArray]:
    """Grasps on the diagonal of the box of moves by `bound`, between the ends of D and of U."""
    by = bound / functions.lengths[0]
    low, high = np.maximum(fractions - by, 0.0), np.minimum(fractions + by, 1.0)
    valid = functions.valid[0]
    first, last = (functions.certain_values(corner)[0][valid] for corner in (low, high))
    rise = last - first
    never = np.where(first < 0, np.inf, -np.inf)
    delta = np.divide(-first, rise, out=never, where=rise > 0).max()
    never = np.where(first > 0, -np.inf, np.inf)
    upsilon = np.divide(-first, rise, out=never, where=rise > 0).min()
    begin, end = max(upsilon, 0.0), min(delta, 1.0)
    for part in (0.5, 0.3, 0.7):
        at = begin + part * (end - begin)
        yield np.clip(low + at * (high - low), 0.0, 1.0)
