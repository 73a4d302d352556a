"""A hand with one of its limits less, to find out which of them is to blame."""

from __future__ import annotations

from dataclasses import fields, replace

from regrasp_lp.planning.hand import Hand


def relaxations(hand: Hand) -> dict[str, Hand]:
    """Return hands that lack one limit each, by what messages call it.

    Parameters
    ----------
    hand : Hand

    Returns
    -------
    dict of str to Hand
        Empty if the hand has no limits.

    Examples
    --------
    >>> relaxations(Hand(5, max_span=3, only_place=[1]))
    {'max_span=3': Hand(fingers=5, only_place=(1,)), 'only_place': Hand(fingers=5, max_span=3.0)}
    """
    plain = Hand(hand.fingers)
    found: dict[str, Hand] = {}
    for field in fields(hand):
        value, free = getattr(hand, field.name), getattr(plain, field.name)
        if value != free:
            size = f"={value:g}" if isinstance(value, float) else ""
            found[field.name + size] = replace(hand, **{field.name: free})
    return found
