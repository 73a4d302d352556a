"""Blocks, brackets and sections, in millimetres: what is sawn, bent and rolled."""

from __future__ import annotations

import math

from generators.geometry import Part, Ring, moved, regular, repeated


def first_parts() -> list[Part]:
    """Return the parts that tests and the README speak of."""
    rectangle: Ring = [(0, 0), (60, 0), (60, 30), (0, 30)]
    l_bracket: Ring = [(0, 0), (80, 0), (80, 20), (20, 20), (20, 60), (0, 60)]
    t_block: Ring = [(25, 0), (45, 0), (45, 40), (70, 40), (70, 60), (0, 60), (0, 40), (25, 40)]
    u_channel: Ring = [(0, 0), (50, 0), (50, 40), (44, 40), (44, 6), (6, 6), (6, 40), (0, 40)]
    plate: Ring = [(0, 0), (100, 0), (100, 50), (0, 50)]
    push_t: Ring = [
        (45, 0), (75, 0), (75, 90), (120, 90), (120, 120), (0, 120), (0, 90), (45, 90)
    ]  # fmt: skip
    wedge: Ring = [(0, 0), (40, 0), (40, 30)]
    holes = [regular(16, 8, x, 25) for x in (25, 75)]
    # 18 mm across flats is 18 / sqrt(3) from the centre to a corner
    nut = [regular(6, 18 / math.sqrt(3)), regular(12, 5.2, turn=15)]
    return [
        Part("rectangle", [rectangle], "bar stock, 60 x 30"),
        Part("l_bracket", [l_bracket], "angle bracket, legs 80 and 60, 20 wide"),
        Part("t_block", [t_block], "T block, head 70 x 20 on a stem 20 x 40"),
        Part("u_channel", [u_channel], "U channel 50 x 40, wall 6"),
        Part("two_hole_plate", [plate, *holes], "plate 100 x 50, two 16 mm holes as 16-gons"),
        Part(
            "hex_nut",
            nut,
            "M12 nut, 18 across flats, bore of 10.4 (before threading) as a 12-gon",
        ),
        Part(
            "push_t",
            [push_t],
            "the T of the Push-T benchmark: bar 120 x 30 on a stem 30 x 90",
        ),
        Part("wedge", [wedge], "right-angled wedge, sides 40, 30 and 50"),
    ]


def blocks() -> list[Part]:
    """Return solid blocks."""
    l_block: Ring = [(0, 0), (60, 0), (60, 25), (25, 25), (25, 60), (0, 60)]
    u_block: Ring = [(0, 0), (60, 0), (60, 40), (40, 40), (40, 15), (20, 15), (20, 40), (0, 40)]
    h_block: Ring = [
        (0, 0), (20, 0), (20, 20), (40, 20), (40, 0), (60, 0),
        (60, 60), (40, 60), (40, 40), (20, 40), (20, 60), (0, 60),
    ]  # fmt: skip
    v_block: Ring = [
        (0, 0), (70, 0), (70, 50), (55, 50), (37, 32), (37, 26), (33, 26), (33, 32), (15, 50),
        (0, 50),
    ]  # fmt: skip
    cross: Ring = repeated([(10, -10), (30, -10), (30, 10)], 4)
    arrow: Ring = [(0, -8), (50, -8), (50, -20), (80, 0), (50, 20), (50, 8), (0, 8)]
    house: Ring = [(0, 0), (50, 0), (50, 35), (25, 60), (0, 35)]
    return [
        Part("l_block", [l_block], "L block 60 x 60, legs 25 wide"),
        Part("u_block", [u_block], "U block 60 x 40, slot 20 wide and 25 deep"),
        Part("h_block", [h_block], "H block 60 x 60, two slots 20 wide and 20 deep"),
        Part("v_block", [v_block], "V block 70 x 50, right-angled groove with a relief 4 wide"),
        Part("cross", [cross], "Greek cross 60 x 60, arms 20 wide"),
        Part("arrow", [arrow], "arrow 80 long, head 30 x 40 on a shaft 16 wide"),
        Part("house", [house], "house 50 wide, 35 to the eaves, 60 to the ridge"),
    ]


def brackets() -> list[Part]:
    """Return what joins two parts at an angle."""
    z_bracket: Ring = [(0, 0), (35, 0), (35, 35), (60, 35), (60, 40), (30, 40), (30, 5), (0, 5)]
    hat_bracket: Ring = [
        (0, 0), (24, 0), (24, 26), (56, 26), (56, 0), (80, 0),
        (80, 4), (60, 4), (60, 30), (20, 30), (20, 4), (0, 4),
    ]  # fmt: skip
    gusset: Ring = [(10, 0), (80, 0), (80, 12), (12, 80), (0, 80), (0, 10)]
    corner: Ring = [(0, 0), (100, 0), (100, 20), (20, 20), (20, 100), (0, 100)]
    screws = [(40, 10), (85, 10), (10, 40), (10, 85)]
    return [
        Part("z_bracket", [z_bracket], "Z bracket, flanges 35 and 30, 40 high, of 5 mm sheet"),
        Part("hat_bracket", [hat_bracket], "hat bracket 80 x 30, of 4 mm sheet"),
        Part(
            "gusset",
            [gusset, regular(12, 7, 25, 25)],
            "gusset plate with legs of 80, corner cut off for the weld, 14 mm hole as a 12-gon",
        ),
        Part(
            "corner_brace",
            [corner, *(regular(8, 3, x, y, turn=22.5) for x, y in screws)],
            "flat corner brace 100 x 100, 20 wide, four 6 mm holes as octagons",
        ),
    ]


def sections() -> list[Part]:
    """Return cross sections of rolled and extruded bars, and of slides."""
    angle: Ring = [(0, 0), (50, 0), (50, 5), (5, 5), (5, 50), (0, 50)]
    channel: Ring = [(0, 0), (45, 0), (45, 8), (6, 8), (6, 72), (45, 72), (45, 80), (0, 80)]
    flare = 12 / math.sqrt(3)  # what a flank of 60 degrees and 12 high widens by
    tongue: Ring = [
        (0, 0), (60, 0), (60, 20), (45, 20), (45 + flare, 32), (15 - flare, 32), (15, 20), (0, 20)
    ]  # fmt: skip
    groove: Ring = [
        (0, 0), (70, 0), (70, 35), (50, 35), (50 + flare, 23), (20 - flare, 23), (20, 35), (0, 35)
    ]  # fmt: skip
    t_slot: Ring = [
        (0, 0), (60, 0), (60, 45), (37, 45), (37, 31), (41.5, 31), (41.5, 22),
        (18.5, 22), (18.5, 31), (23, 31), (23, 45), (0, 45),
    ]  # fmt: skip
    profile: Ring = [
        (-10, -10), (-3, -10), (-3, -8.5), (-5.5, -8.5), (-5.5, -7), (-2.7, -4.2),
        (2.7, -4.2), (5.5, -7), (5.5, -8.5), (3, -8.5), (3, -10),
    ]  # fmt: skip
    return [
        Part("angle_section", [angle], "equal angle 50 x 50 x 5, without its fillets"),
        Part("channel_section", [channel], "channel 80 x 45, web 6, flanges 8"),
        Part("i_beam", [_beam(80, 46, 3.8, 5.2)], "section of a beam IPE 80, without its fillets"),
        Part("h_beam", [_beam(100, 100, 6, 10)], "section of a beam HEB 100, without its fillets"),
        Part("dovetail_tongue", [moved(tongue)], "slide 60 x 32, dovetail of 60 degrees"),
        Part("dovetail_groove", [moved(groove)], "block 70 x 35, dovetail groove of 60 degrees"),
        Part("t_slot_block", [t_slot], "block 60 x 45, T slot 14 wide, 23 at its foot"),
        Part(
            "slotted_profile",
            [repeated(profile, 4), regular(12, 2.1, turn=15)],
            "aluminium profile 20 x 20, four slots 6 wide, bore of 4.2 as a 12-gon",
        ),
    ]


def _beam(height: float, width: float, web: float, flange: float) -> Ring:
    """Return the section of an I beam with parallel flanges, about the origin."""
    x, y, w, f = width / 2, height / 2, web / 2, height / 2 - flange
    right: Ring = [(x, -y), (x, -f), (w, -f), (w, f), (x, f), (x, y)]
    return moved([*right, *((-px, -py) for px, py in right)])
