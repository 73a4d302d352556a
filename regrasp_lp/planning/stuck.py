"""Goals that fingers which only slide rule out, whatever the friction and the sets."""

from __future__ import annotations

from collections import Counter

from regrasp_lp.contact import Grasp
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.reach import start_fingers


def sliding_only(hand: Hand, start: Grasp) -> dict[int, int]:
    """Return the edges of the fingers that touch at the start and only slide, by finger."""
    pairs = zip(start_fingers(start), start.edges.tolist(), strict=True)
    return {finger: edge for finger, edge in pairs if finger in set(hand.only_slide)}


def stuck(hand: Hand, start: Grasp, goal: Grasp) -> str | None:
    """Return why no plan can lead to a goal, for fingers that only slide; None if one may.

    Such a finger stays on its edge from the start on, and has to be on a contact of the goal in
    the end; the other contacts of the goal are for the other fingers.

    Parameters
    ----------
    hand : Hand
    start, goal : Grasp

    Returns
    -------
    str or None

    Examples
    --------
    >>> stuck(Hand(only_slide=[1]), Grasp([(0, 3), (2, 3)]), Grasp([(1, 2), (2, 4)]))
    'finger 1 only slides (only_slide): it stays on edge 0, where the goal has no contact for it'
    """
    contacts = Counter(goal.edges.tolist())
    sliding = sliding_only(hand, start)
    for finger, edge in sliding.items():
        if not contacts[edge]:
            return (
                f"finger {finger} only slides (only_slide): it stays on edge {edge}, where the "
                "goal has no contact for it"
            )
        contacts[edge] -= 1
    others, rest = hand.fingers - len(tuple(hand.only_slide)), contacts.total()
    if rest > others:
        return (
            f"the goal has {rest} contact{'s' * (rest > 1)} to which no finger slides, and "
            f"{others or 'no'} finger{'s' * (others != 1)} may be placed (only_slide)"
        )
    return None
