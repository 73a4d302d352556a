"""Wrenches, keys and a hook, in millimetres."""

from __future__ import annotations

import math

from generators.geometry import Part, Ring, arc, belt, moved, point, regular


def wrenches() -> list[Part]:
    """Return open-end wrenches of metric sizes, their jaws turned by 15 degrees."""
    double = [*_head(13, 8), *moved(_head(17, 8), x=-160, turn=180)]
    return [
        Part("wrench_10", [_wrench(10, 105)], "open-end wrench, 10 across flats, 105 long"),
        Part("wrench_13", [_wrench(13, 130)], "open-end wrench, 13 across flats, 130 long"),
        Part("wrench_19", [_wrench(19, 170)], "open-end wrench, 19 across flats, 170 long"),
        Part(
            "wrench_13_17",
            [double],
            "double open-end wrench, 13 and 17 across flats, heads 160 apart",
        ),
    ]


def keys() -> list[Part]:
    """Return keys for doors, shafts and screws."""
    chord = math.degrees(math.asin(1.5 / 8))
    woodruff = arc(8, 8, 180 + chord, 360 - chord)
    return [
        Part("door_key", _door_key(), "warded door key, 88 long, bow of 30 with an eye of 18"),
        Part("cylinder_key", _cylinder_key(), "key of a cylinder lock, 53 long, five cuts"),
        Part("feather_key", [belt(6, 4, 4, 32)], "feather key 8 wide, 40 long, round ends"),
        Part("woodruff_key", [woodruff], "woodruff key, segment 6.5 high of a disc of 16"),
        Part("allen_key_4", [_allen_key(4, 74, 29)], "Allen key 4, arms 74 and 29"),
        Part("allen_key_6", [_allen_key(6, 96, 38)], "Allen key 6, arms 96 and 38"),
    ]


def hooks() -> list[Part]:
    """Return a hook."""
    hook = [
        *arc(10, 22, 180, 375),
        *arc(8, 12, 375, 180),
        *arc(8, 10, -60, 240, -17, 52),
    ]
    return [
        Part("hook", [hook, regular(12, 5, -17, 52)], "hook of flat bar 10 wide, 24 inside, eye")
    ]


def _head(size: float, width: float) -> Ring:
    """Return the head of a wrench about the origin, from handle to handle.

    The handle, of that width, is to the left. The jaw has parallel sides and holds a nut at two
    flats and the corner between two others.
    """
    radius = 1.1 * size
    neck = math.degrees(math.asin(width / 2 / radius))
    mouth = math.degrees(math.asin(size / 2 / radius))
    x, y = size / math.sqrt(12), size / 2
    jaw = moved([(-x, -y), (-2 * x, 0), (-x, y)], turn=15)
    return [
        *arc(6, radius, neck - 180, 15 - mouth),
        *jaw,
        *arc(6, radius, 15 + mouth, 180 - neck),
    ]


def _wrench(size: float, length: float) -> Ring:
    """Return a wrench whose handle ends in a half circle."""
    width = 0.6 * size
    head = _head(size, width)
    end = max(x for x, _ in head) - length + width / 2
    return [*head, *arc(4, width / 2, 90, 270, x=end)]


def _door_key() -> list[Ring]:
    """Return a key about the centre of its bow, with a collar and a bit that has two cuts."""
    neck = math.degrees(math.asin(3 / 15))
    shank: Ring = [
        (18, -3), (18, -5), (21, -5), (21, -3), (52, -3), (52, -18), (57, -18), (57, -11),
        (60, -11), (60, -18), (68, -18), (68, -12), (64, -12), (64, -9), (68, -9), (68, -3),
        (73, -3), (73, 3), (21, 3), (21, 5), (18, 5), (18, 3),
    ]  # fmt: skip
    return [[*arc(16, 15, neck, 360 - neck), *shank], regular(16, 9)]


def _cylinder_key() -> list[Ring]:
    """Return a key about the centre of its bow, its cuts from the tip to the bow."""
    neck = math.degrees(math.asin(4 / 12.5))
    blade: Ring = [(37.5, -4), (40.5, -1), (37.5, 2)]
    for k, height in enumerate((1.5, 3, 0.5, 2, 1)):
        x = 35 - 4.5 * k
        blade += [(x + 0.6, height), (x - 0.6, height), (x - 2.25, 3.5)]
    blade[-1] = (14.5, 4)
    return [[*arc(14, 12.5, neck, 360 - neck), *blade], regular(8, 3, -5.5, turn=22.5)]


def _allen_key(size: float, long: float, short: float) -> Ring:
    """Return a bent bar, its bend of radius `size` on the inside."""
    r = 2 * size
    return [
        point(long, 0),
        point(long, size),
        *arc(4, size, 270, 180, r, r),
        point(size, short),
        point(0, short),
        *arc(6, r, 180, 270, r, r),
    ]
