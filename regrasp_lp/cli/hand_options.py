"""Options for the hand: how many fingers it has, and what limits where they may be."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from regrasp_lp.cli import values
from regrasp_lp.planning.hand import Hand

_LENGTHS = (
    ("--max-span", None, "largest distance between two touching fingers"),
    ("--edge-clearance", 0.0, "distance that fingers keep from the ends of an edge"),
    ("--fingertip-separation", 0.0, "smallest distance between two touching fingers"),
)

_MOVES = (
    ("--only-place", "may not slide"),
    ("--only-slide", "may not be placed or released"),
)


def add_hand(group: Any) -> None:
    """Add the options to a group of a parser."""
    group.add_argument(
        "--fingers",
        type=values.fingers,
        default=4,
        metavar="K",
        help="fingers of the hand, 3 or more (default: 4)",
    )
    for option, default, what in _LENGTHS:
        group.add_argument(
            option,
            type=values.length,
            default=default,
            metavar="LENGTH",
            help=f"{what}, in the object's unit (default: no limit)",
        )
    group.add_argument(
        "--avoid-edges",
        type=values.edge_numbers,
        default=[],
        metavar="EDGES",
        help="edges that may not be touched: their numbers, separated by commas",
    )
    group.add_argument(
        "--finger-avoids",
        type=values.finger_edges,
        action="append",
        default=[],
        metavar="F:EDGES",
        help="edges that one finger may not touch, as in 1:3,4; may be given for several fingers",
    )
    for option, what in _MOVES:
        group.add_argument(
            option,
            type=values.finger_numbers,
            default=[],
            metavar="FINGERS",
            help=f"fingers that {what}: their numbers, separated by commas",
        )


def hand_of(options: Namespace) -> Hand:
    """Return the hand that is asked for.

    Raises
    ------
    HandError
        If its limits make no sense.
    """
    return Hand(
        options.fingers,
        options.max_span,
        options.edge_clearance,
        options.fingertip_separation,
        dict.fromkeys(options.avoid_edges),
        [(finger, dict.fromkeys(edges)) for finger, edges in options.finger_avoids],
        options.only_place,
        options.only_slide,
    )
