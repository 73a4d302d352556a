"""Shapes in arbitrary units: regular, rectilinear and needle-like ones."""

from __future__ import annotations

from generators.geometry import Part, Ring, polar, regular, repeated

REGULAR_CORNERS = (3, 4, 5, 6, 7, 8, 9, 12, 16, 24)


def regular_polygons() -> list[Part]:
    """Return regular polygons with corners on the unit circle, resting on an edge."""
    return [
        Part(
            f"regular_{n}",
            [regular(n, 1, turn=180 / n - 90)],
            f"regular {n}-gon in the unit circle",
        )
        for n in REGULAR_CORNERS
    ]


def rectilinear() -> list[Part]:
    """Return polygons with horizontal and vertical edges only."""
    plus = repeated([(1, -1), (4, -1), (4, 1)], 4)
    stairs: Ring = [(0, 0), (8, 0)]
    for k in range(8):
        stairs += [(8 - k, k + 1), (7 - k, k + 1)]
    comb: Ring = [(0, 0), (13, 0), (13, 6)]
    for x in range(12, 0, -2):
        comb += [(x, 6), (x, 2), (x - 1, 2), (x - 1, 6)]
    comb.append((0, 6))
    spiral: Ring = [
        (0, 0), (9, 0), (9, 9), (2, 9), (2, 3), (6, 3), (6, 6), (4, 6), (4, 5), (5, 5), (5, 4),
        (3, 4), (3, 8), (8, 8), (8, 1), (1, 1), (1, 9), (0, 9),
    ]  # fmt: skip
    meander: Ring = [
        (0, 0), (7, 0), (7, 4), (1, 4), (1, 6), (7, 6), (7, 7), (0, 7), (0, 3), (6, 3), (6, 1),
        (0, 1),
    ]  # fmt: skip
    return [
        Part("plus", [plus], "plus sign, arms 2 wide and 3 long"),
        Part("staircase", [stairs], "eight steps of 1 x 1"),
        Part("comb", [comb], "comb of seven teeth, 1 wide and 4 long"),
        Part("spiral", [spiral], "spiral, 1 wide"),
        Part("meander", [meander], "meander, 1 wide"),
    ]


def needles() -> list[Part]:
    """Return thin polygons, with sharp corners and edges that are nearly parallel."""
    saw: Ring = [(0, 0), (20, 0)]
    for x in range(20, 0, -2):
        saw += [(x, 1), (x - 2, 4)]
    thorn: Ring = [(0, 0), (10, 0), (10, 10), (6, 10), (5, 60), (4, 10), (0, 10)]
    spikes = repeated([polar(0.08, -22.5), (1, 0)], 8)
    return [
        Part("needle", [[(0, 0), (100, 0), (50, 1)]], "flat isosceles triangle, 100 x 1"),
        Part("splinter", [[(0, 0), (100, 0), (100, 2)]], "right-angled triangle, legs 100 and 2"),
        Part(
            "lath",
            [[(0, 0), (100, 0), (100, 2.1), (0, 2)]],
            "quadrilateral 100 long, 2 and 2.1 wide at its ends",
        ),
        Part("kite", [[(0, 0), (10, -2), (100, 0), (10, 2)]], "kite 100 long, 4 wide"),
        Part("thorn", [thorn], "spike 2 wide and 50 long on a square of 10"),
        Part("thin_star", [spikes], "eight spikes of length 1, corners between them at 0.08"),
        Part("saw", [saw], "saw of ten teeth, 2 wide and 3 high"),
    ]
