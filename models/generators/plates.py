"""Plates, links, nuts and washers, in millimetres: what has holes or slots."""

from __future__ import annotations

import math

from generators.geometry import Part, Ring, arc, belt, moved, polar, regular, repeated


def plates() -> list[Part]:
    """Return flat plates with holes and slots."""
    flange_holes = [regular(8, 7, x, y, turn=22.5) for x, y in regular(4, 42.5, turn=45)]
    slotted: Ring = [(0, 0), (120, 0), (120, 40), (0, 40)]
    slots = [moved(belt(5, 4.5, 4.5, 30), x, 20) for x in (15, 75)]
    motor = repeated([(21.15, -17.15), (21.15, 17.15)], 4)
    screws = [regular(8, 1.6, x, y, turn=22.5) for x in (-15.5, 15.5) for y in (-15.5, 15.5)]
    return [
        Part(
            "flange",
            [regular(24, 57.5), regular(16, 17.25), *flange_holes],
            "pipe flange DN 25, 115 across, four 14 mm holes on a circle of 85; circles as 24-gon, "
            "16-gon and octagons",
        ),
        Part("slotted_plate", [slotted, *slots], "plate 120 x 40, two slots 9 wide and 39 long"),
        Part(
            "motor_plate",
            [motor, regular(16, 11), *screws],
            "face of a NEMA 17 motor, 42.3 square, hole of 22, four screw holes 31 apart",
        ),
    ]


def links() -> list[Part]:
    """Return machine elements that turn about their bores."""
    triangle = repeated(arc(4, 12, -60, 60, x=40), 3)
    return [
        Part(
            "link",
            [belt(8, 20, 12, 80), regular(16, 10), regular(12, 5, x=80)],
            "link, bores of 20 and 10 at a distance of 80, rims of 40 and 24",
        ),
        Part("chain_plate", _chain_plate(), "plate of a roller chain, pitch 25.4, 21 high"),
        Part(
            "rocker",
            [triangle, *(regular(12, 6, x, y) for x, y in regular(3, 40)), regular(12, 10)],
            "triangular rocker, three bores of 12 on a circle of 80 about a bore of 20",
        ),
        Part(
            "cam",
            [belt(10, 25, 12, 22), keyed_bore(12, 16, 5, 2.3)],
            "plate cam, base circle of 50, lift 9, bore of 16 with a keyway 5 wide",
        ),
        Part(
            "geneva_wheel",
            [_geneva_wheel(), regular(12, 4, turn=15)],
            "Geneva wheel of four slots 6 wide, 60 across, for a crank of 30",
        ),
    ]


def nuts_and_washers() -> list[Part]:
    """Return nuts, washers and rings."""
    square_nut = regular(4, 17 / math.sqrt(2), turn=45)
    square_washer = regular(4, 40 / math.sqrt(2), turn=45)
    bottom = math.degrees(math.asin(6.5 / 20))
    c_washer = [*arc(20, 20, bottom, 360 - bottom), *arc(8, 6.5, 270, 90)]
    snap_ring = [*arc(20, 13, 20, 340), *arc(16, 9.25, 340, 20)]
    return [
        Part("hex_nut_m8", _hex_nut(13, 6.8), "M8 nut, 13 across flats, bore of 6.8"),
        Part("hex_nut_m20", _hex_nut(30, 17.5), "M20 nut, 30 across flats, bore of 17.5"),
        Part(
            "square_nut",
            [square_nut, regular(12, 4.25, turn=15)],
            "M10 square nut, 17 across flats, bore of 8.5 as a 12-gon",
        ),
        Part(
            "washer_m8",
            [regular(16, 8), regular(12, 4.2)],
            "M8 washer, 16 across as a 16-gon, hole of 8.4 as a 12-gon",
        ),
        Part(
            "washer_m12",
            [regular(24, 12), regular(16, 6.5)],
            "M12 washer, 24 across as a 24-gon, hole of 13 as a 16-gon",
        ),
        Part(
            "square_washer",
            [square_washer, regular(12, 7, turn=15)],
            "washer for timber 40 x 40, hole of 14 as a 12-gon",
        ),
        Part("c_washer", [c_washer], "open washer, 40 across, slot 13 wide"),
        Part("snap_ring", [snap_ring], "snap ring, 26 across, 18.5 inside, gap of 40 degrees"),
    ]


def keyed_bore(n: int, diameter: float, width: float, depth: float) -> Ring:
    """Return a bore, its round part of n edges, with a keyway upward."""
    radius = diameter / 2
    half = math.degrees(math.asin(width / diameter))
    top = radius + depth
    return [*arc(n, radius, 90 + half, 450 - half), (width / 2, top), (-width / 2, top)]


def _hex_nut(across_flats: float, bore: float) -> list[Ring]:
    return [regular(6, across_flats / math.sqrt(3)), regular(12, bore / 2, turn=15)]


def _chain_plate() -> list[Ring]:
    """Return two discs joined by a waist whose arcs go over into theirs."""
    pitch, rim, waist, bore = 25.4, 10.5, 6.5, 4.15
    x = pitch / 2
    # an arc about (x, waist + r) touches both rims: x² + (waist + r)² = (rim + r)²
    r = (x**2 + waist**2 - rim**2) / (2 * (rim - waist))
    touch = math.degrees(math.atan2(waist + r, x))
    half = [*arc(8, rim, touch, 360 - touch), *arc(4, r, 180 - touch, touch, x, -waist - r)[1:-1]]
    return [
        [*half, *moved(half, x=pitch, turn=180)],
        regular(12, bore),
        regular(12, bore, x=pitch),
    ]


def _geneva_wheel() -> Ring:
    """Return the wheel about the origin, a slot to the right."""
    crank, pin, lock = 30.0, 3.0, 24.0
    distance = crank * math.sqrt(2)
    half_slot = math.degrees(math.asin(pin / crank))
    slot = arc(4, pin, 270, 90, x=distance - crank)
    # the disc that locks the wheel stands in the direction of 45 degrees; the ends of its arc
    # are on the rim of the wheel
    x = (crank**2 + distance**2 - lock**2) / (2 * distance)
    end = math.degrees(math.acos((x - distance) / lock))
    locking = moved(arc(6, lock, 360 - end, end, x=distance), turn=45)
    return repeated([polar(crank, -half_slot), *slot, polar(crank, half_slot), *locking], 4)
