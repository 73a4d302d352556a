"""Toothed parts, in millimetres."""

from __future__ import annotations

import math

from generators.geometry import Part, Ring, moved, polar, regular, repeated
from generators.plates import keyed_bore

PRESSURE_ANGLE = math.radians(20)
FLANK_POINTS = 3


def gears() -> list[Part]:
    """Return involute gears, a rack and a ratchet wheel."""
    return [
        Part(
            "gear_m1_z16",
            [gear(1, 16), regular(12, 2.5, turn=15)],
            "involute gear, module 1, 16 teeth, bore of 5 as a 12-gon",
        ),
        Part(
            "gear_m2_z12",
            [gear(2, 12), regular(12, 4, turn=15)],
            "involute gear, module 2, 12 teeth, bore of 8 as a 12-gon",
        ),
        Part(
            "gear_m2_z17",
            [gear(2, 17), keyed_bore(12, 12, 4, 1.8)],
            "involute gear, module 2, 17 teeth, bore of 12 with a keyway 4 wide",
        ),
        Part(
            "gear_m2_z24",
            [gear(2, 24), keyed_bore(16, 16, 5, 2.3)],
            "involute gear, module 2, 24 teeth, bore of 16 with a keyway 5 wide",
        ),
        Part("rack_m2", [rack(2, 8)], "rack, module 2, 8 teeth, 10 from its back to the roots"),
        Part(
            "ratchet_wheel",
            [repeated([(20, 0), polar(25, 0)], 16), regular(12, 5, turn=15)],
            "ratchet wheel of 16 teeth, 50 across, 40 at the roots, bore of 10 as a 12-gon",
        ),
    ]


def gear(module: float, teeth: int) -> Ring:
    """Return a spur gear with a pressure angle of 20 degrees and no profile shift.

    Addendum and dedendum are 1 and 1.25 modules. A flank is an involute of the base circle,
    through `FLANK_POINTS` of its points; below the base circle, which has to be outside the root
    circle (that is so for at most 41 teeth), it is radial, without undercut or fillet.
    """
    pitch = module * teeth / 2
    base, tip, root = pitch * math.cos(PRESSURE_ANGLE), pitch + module, pitch - 1.25 * module
    # the point of the involute that has been unrolled by t is at base * sqrt(1 + t²) and, from
    # where it begins, in the direction t - atan(t); half a tooth is a quarter of a pitch there
    longest = math.sqrt((tip / base) ** 2 - 1)
    start = math.pi / (2 * teeth) + math.tan(PRESSURE_ANGLE) - PRESSURE_ANGLE
    flank = [(root, start)]
    for k in range(FLANK_POINTS):
        t = longest * k / (FLANK_POINTS - 1)
        flank.append((base * math.hypot(1, t), start - t + math.atan(t)))
    tooth = [polar(radius, -math.degrees(angle)) for radius, angle in flank]
    return repeated([*tooth, *((x, -y) for x, y in reversed(tooth))], teeth)


def rack(module: float, teeth: int) -> Ring:
    """Return a rack with straight flanks of 20 degrees, half a gap at either end."""
    pitch, depth, back = math.pi * module, 2.25 * module, 10.0
    slope = math.tan(PRESSURE_ANGLE)
    foot = pitch / 4 + 1.25 * module * slope
    head = pitch / 4 - module * slope
    tooth = [(foot, back), (head, back + depth), (-head, back + depth), (-foot, back)]
    centres = [pitch * (k + 0.5) for k in reversed(range(teeth))]
    length = pitch * teeth
    top = [corner for x in centres for corner in moved(tooth, x)]
    return moved([(0, 0), (length, 0), (length, back), *top, (0, back)])
