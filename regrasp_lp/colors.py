"""Colours of all pictures and pages.

They are those of Okabe and Ito (*Color universal design*, 2008), told apart with any kind of colour
blindness; what a colour says is also said by a line style or a shape, for print.
"""

from __future__ import annotations

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

KIND_COLORS = {
    "two_finger": VERMILLION,
    "concurrent": BLUE,
    "parallel": SET,
    "three_finger": BLUE,
}
KIND_MARKERS = {"two_finger": "^", "concurrent": "o", "parallel": "s", "three_finger": "o"}
KIND_NAMES = {kind: kind.replace("_", "-") for kind in KIND_COLORS}
