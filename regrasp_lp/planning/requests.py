"""What may be asked for: start and goal of a plan, and how fingers move inside a set."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import ContactError, HandError, NotForceClosureError, OptionError
from regrasp_lp.force_closure import is_force_closure
from regrasp_lp.friction import FloatArray
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.reach import within_reach
from regrasp_lp.polygon import Polygon
from regrasp_lp.remedies import remedy

GraspLike = Grasp | Iterable[Contact | tuple[int, float]]


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
        If the hand has too few fingers, or may not touch there.
    NotForceClosureError
        If it is not in force closure; the message says which friction or move makes it so.
    """
    try:
        resolved = polygon.resolve(grasp)
    except ContactError as error:
        raise ContactError(f"{role}: {error}") from error
    if len(resolved) not in (2, 3):
        raise ContactError(f"the {role} must have 2 or 3 contacts, got {len(resolved)}")
    if len(resolved) > hand.fingers:
        raise HandError(f"the {role} needs {len(resolved)} fingers, the hand has {hand.fingers}")
    _check_fingers(resolved, hand, role)
    for one, other in combinations(resolved, 2):
        if _same_point(polygon, one, other):
            raise ContactError(
                f"the {role} has two contacts at one point: {_text(one)} and {_text(other)}; "
                "move one of them"
            )
    # Equal fractions are equal contacts, however their positions were rounded.
    pairs = zip(resolved.edges.tolist(), resolved.fractions.tolist(), strict=True)
    same = polygon.resolve(Grasp.at_fractions(pairs, resolved.fingers))
    if hand.limited:
        resolved = same = within_reach(polygon, hand, same, role)
    if not is_force_closure(polygon, same, friction):
        raise NotForceClosureError(_not_closed(polygon, resolved, friction, hand, role))
    return same


def _check_fingers(grasp: Grasp, hand: Hand, role: str) -> None:
    if grasp.fingers is None:
        return
    if role == "goal":
        raise ContactError(
            "the goal is a set of contacts, whichever fingers are there: leave its fingers out"
        )
    if max(grasp.fingers) > hand.fingers:
        raise HandError(
            f"the {role} is held by fingers {list(grasp.fingers)}, the hand has fingers 1 to "
            f"{hand.fingers}"
        )


def _same_point(polygon: Polygon, one: Contact, other: Contact) -> bool:
    if one.edge == other.edge:
        return one.fraction == other.fraction
    # Edges of a simple polygon meet in their ends only, where points are exact.
    return bool((polygon.point(one) == polygon.point(other)).all())


def _text(contact: Contact) -> str:
    return f"edge {contact.edge} at {contact.position:.6g}"


def _not_closed(polygon: Polygon, grasp: Grasp, friction: FloatArray, hand: Hand, role: str) -> str:
    contacts = ", ".join(_text(contact) for contact in grasp)
    found = remedy(polygon, grasp, friction, hand)
    return f"the {role} ({contacts}) is not in force closure: {found}"
