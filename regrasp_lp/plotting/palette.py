"""Colours and sizes of all pictures; lengths in points (1/72 inch)."""

from __future__ import annotations

from typing import Any

from regrasp_lp.colors import (
    BLUE,
    GREEN,
    GREY,
    INK,
    KIND_COLORS,
    KIND_MARKERS,
    KIND_NAMES,
    MATERIAL,
    ORANGE,
    PALE_YELLOW,
    PURPLE,
    SET,
    SKY,
    VERMILLION,
)

__all__ = [
    "BLUE",
    "GREEN",
    "GREY",
    "INK",
    "KIND_COLORS",
    "KIND_MARKERS",
    "KIND_NAMES",
    "MATERIAL",
    "ORANGE",
    "PALE_YELLOW",
    "PURPLE",
    "SET",
    "SKY",
    "VERMILLION",
]

SIX = (BLUE, ORANGE, SET, VERMILLION, PURPLE, SKY)  # for things without a meaning of their own

DASHES = (0, (4, 2.5))  # of the line of a two-finger grasp, in line widths

KEY_OVER_AXES: dict[str, Any] = {  # with a title; where exactly is told to each
    "loc": "lower left",
    "alignment": "left",
    "fontsize": 8,
    "title_fontsize": 9,
    "frameon": False,
}

FINGER_RADIUS = 7.0
FINGER_FONT = 8.5
FINGER_GAP = 7.0  # from the contact to the circle of its finger
MARGIN = 30.0  # room around the object for fingers and numbers

OBJECT_LAYER, CONE_LAYER, OUTLINE_LAYER, LINE_LAYER = 1.0, 1.5, 2.0, 3.0
CELL_LAYER, BAND_LAYER, EDGE_LAYER, REGION_LAYER = 1.2, 1.8, 2.2, 2.6
ARROW_LAYER, LEADER_LAYER, CONTACT_LAYER, FINGER_LAYER, TEXT_LAYER = 4.0, 5.0, 6.0, 7.0, 8.0
