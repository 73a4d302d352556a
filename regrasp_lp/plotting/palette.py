"""Colours and sizes of all pictures; lengths in points (1/72 inch).

The colours are those of Okabe and Ito (*Color universal design*, 2008), told apart with any kind
of colour blindness; what a colour says is also said by a line style or a shape, for print.
"""

from __future__ import annotations

from typing import Any

INK = "#262626"
GREY = "#8A8A8A"
MATERIAL = "#EFEFEC"
BLUE = "#0072B2"  # fingers that touch
VERMILLION = "#D55E00"  # what has just moved
SKY = "#56B4E9"  # friction cones
GREEN = "#00795A"  # line of a two-finger grasp: bluish green, darkened to show on white
ORANGE = "#E69F00"  # a focus cell; an outer region; where a finger may be
PURPLE = "#CC79A7"  # a second one
PALE_YELLOW = "#F7F09A"  # where two focus cells meet
SET = "#009E73"  # a grasp set in contact space: bluish green
SIX = (BLUE, ORANGE, SET, VERMILLION, PURPLE, SKY)  # for things without a meaning of their own

KIND_COLORS = {
    "two_finger": VERMILLION,
    "concurrent": BLUE,
    "parallel": SET,
    "three_finger": BLUE,
}
KIND_MARKERS = {"two_finger": "^", "concurrent": "o", "parallel": "s", "three_finger": "o"}
KIND_NAMES = {kind: kind.replace("_", "-") for kind in KIND_COLORS}

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
