"""DXF and SVG drawings as polygons: what is read, what is refused, and how it is said."""

from __future__ import annotations

import itertools
import math
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from ezdxf.layouts import Modelspace
from ezdxf.math import closed_uniform_bspline
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

import regrasp_lp as rl
from regrasp_lp.outlines.curves import polyline
from regrasp_lp.outlines.drawing import Piece, Reading, outlines

FINE = 1e-4

Draw = Callable[[Modelspace], object]


@pytest.fixture
def dxf(tmp_path: Path) -> Callable[..., Path]:
    """Write a DXF file that a function draws."""

    def write(draw: Draw, version: str = "R2010", form: str = "asc") -> Path:
        document = ezdxf.new(version)
        draw(document.modelspace())
        path = tmp_path / "part.dxf"
        document.saveas(path, fmt=form)
        return path

    return write


@pytest.fixture
def svg(tmp_path: Path) -> Callable[..., Path]:
    """Write an SVG file with some content."""

    def write(content: str, attributes: str = "") -> Path:
        path = tmp_path / "part.svg"
        space = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
        path.write_text(f"<svg {space} {attributes}>\n{content}\n</svg>", encoding="utf-8")
        return path

    return write


def areas(path: Path, **options: object) -> list[float]:
    return [polygon.area for polygon in rl.read_polygons(path, flattening=FINE, **options)]


def fault(path: Path, **options: object) -> str:
    with pytest.raises((rl.FileFormatError, rl.OptionError)) as caught:
        rl.read_polygons(path, **options)
    assert str(caught.value).startswith(f"{path}: ")
    return str(caught.value).removeprefix(f"{path}: ")


def corners(polygon: rl.Polygon) -> set[tuple[float, float]]:
    return {tuple(point) for point in polygon.vertices.round(9).tolist()}


# --- joining and nesting --------------------------------------------------------------------------


def piece(
    points: list, closed: bool = False, compound: int | None = None, name: str = "x"
) -> Piece:
    return Piece(name, name, tuple(polyline(points)), closed, compound)


def square(size: float, turn: int = 1) -> list:
    ring = [(-size, -size), (size, -size), (size, size), (-size, size)]
    return ring[::turn]


@given(st.permutations(range(6)), st.lists(st.booleans(), min_size=6, max_size=6))
def test_pieces_in_any_order_and_direction_join_to_the_same_ring(
    order: list[int], turned: list[bool]
) -> None:
    ring = [(0, 0), (3, 0), (4, 2), (3, 3), (1, 4), (-1, 2)]
    sides = [[ring[k], ring[(k + 1) % 6]] for k in range(6)]
    pieces = [piece(sides[k][::-1] if turned[k] else sides[k]) for k in order]
    ((_, _, (found,)),) = outlines(pieces, Reading())
    assert sorted(map(tuple, found.tolist())) == sorted(ring)
    expected = rl.Polygon(ring)
    assert rl.Polygon(found).area == expected.area


@given(st.permutations(range(4)))
def test_rings_nest_by_the_even_odd_rule(order: list[int]) -> None:
    sizes = [4, 3, 2, 1]
    found = outlines([piece(square(sizes[k]), True, name=str(sizes[k])) for k in order], Reading())
    parts = {outline.name: [float(np.abs(r).max()) for r in outline.rings] for outline in found}
    assert parts == {"4": [4, 3], "2": [2, 1]}
    assert [o.name for o in found] == [str(s) for s in (sizes[k] for k in order) if s in (2, 4)]


def test_the_nonzero_rule_within_one_path() -> None:
    same = [piece(square(3), True, 1), piece(square(1), True, 1)]
    ((_, _, rings),) = outlines(same, Reading())
    assert len(rings) == 1
    opposite = [piece(square(3), True, 1), piece(square(1, -1), True, 1)]
    ((_, _, rings),) = outlines(opposite, Reading())
    assert len(rings) == 2
    # a hole, and in it a ring that only closes it again
    three = [piece(square(3), True, 1), piece(square(2, -1), True, 1), piece(square(1), True, 1)]
    assert [len(o.rings) for o in outlines(three, Reading())] == [2, 1]
    # another element is not counted
    other = [piece(square(3), True, 1), piece(square(1), True, 2)]
    ((_, _, rings),) = outlines(other, Reading())
    assert len(rings) == 2


def test_gaps_are_joined_up_to_the_tolerance() -> None:
    sides = [[(0, 0), (4, 0)], [(4, 0.01), (4, 3)], [(4, 3), (0, 0)]]
    with pytest.raises(rl.FileFormatError, match=r"0\.01 from \(4, 0\.01\), the nearest open end"):
        outlines([piece(side) for side in sides], Reading())
    ((_, _, (ring,)),) = outlines([piece(side) for side in sides], Reading(joining=0.02))
    assert len(ring) == 3
    for side in sides:
        for point in side:
            assert np.hypot(*(ring - point).T).min() <= 0.02


def test_branches_and_crossings_are_named() -> None:
    sides = [[(0, 0), (4, 0)], [(4, 0), (4, 3)], [(4, 3), (0, 0)], [(4, 0), (9, 9)]]
    with pytest.raises(
        rl.FileFormatError, match=r"3 ends meet at \(4, 0\): side 0; side 1; side 3"
    ):
        outlines([piece(s, name=f"side {k}") for k, s in enumerate(sides)], Reading())
    shifted = [(x + 1, y) for x, y in square(1)]
    crossing = [piece(square(1), True, name="one"), piece(shifted, True, name="two")]
    with pytest.raises(rl.PolygonError, match="one meets two at"):
        outlines(crossing, Reading())
    corner = [(x + 1.5, y + 1) for x, y in square(1)]
    for first, other, turned in itertools.product((square(1), square(-1)), (corner,), (1, -1)):
        rings = [piece(first, True, name="one"), piece(other[::turned], True, name="two")]
        with pytest.raises(rl.PolygonError) as caught:
            outlines(rings, Reading())
        met = re.search(r"one meets two at \((\S+), (\S+)\):", str(caught.value))
        assert met
        assert tuple(map(float, met.groups())) in {(0.5, 1.0), (1.0, 0.0)}
    twice = [piece(square(1), True, name="one"), piece(square(1), True, name="two")]
    with pytest.raises(rl.PolygonError, match="one meets two"):
        outlines(twice, Reading())
    bow = [piece([(0, 0), (2, 2), (2, 0), (0, 2)], True, name="bow")]
    with pytest.raises(rl.PolygonError, match=r"bow: edge 0 .* crosses edge 2|bow: .* crosses"):
        outlines(bow, Reading())
    with pytest.raises(rl.FileFormatError, match="flat encloses nothing"):
        outlines([piece([(0, 0), (2, 0)], True, name="flat")], Reading())


# --- DXF ----------------------------------------------------------------------------------------


def test_every_kind_of_curve(dxf: Callable[..., Path]) -> None:
    ring = [(60, 0), (62, 0), (62, 2), (60, 2)]

    def draw(space: Modelspace) -> None:
        space.add_circle((0, 0), 1)
        space.add_ellipse((10, 0), (3, 1, 0), 0.5)
        space.add_lwpolyline([(20, 0, 1), (22, 0, 1)], format="xyb", close=True)
        space.add_polyline2d([(30, 0), (34, 0), (30, 3)], close=True)
        space.add_polyline3d([(40, 0, 7), (44, 0, 7), (40, 3, 7)], close=True)
        space.add_arc((50, 0), 2, -90, 90)
        space.add_line((50, 2), (50, -2))
        space.add_spline().apply_construction_tool(closed_uniform_bspline(ring, order=4))
        space.add_rational_spline(
            [(71, 0), (71, 1), (70, 1), (69, 1), (69, 0), (69, -1), (70, -1), (71, -1), (71, 0)],
            [1, *[math.sqrt(0.5), 1] * 4],
            degree=2,
            knots=[0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4],
        )

    found = areas(dxf(draw))
    expected = [math.pi, math.pi * 5, math.pi, 6, 6, math.pi * 2]
    assert found[:6] == pytest.approx(expected, abs=4e-3)
    around = BSpline(np.arange(11), np.array([*ring, *ring[:3]], dtype=float), 3)
    x, y = around(np.linspace(3, 7, 4001)).T
    assert found[6] == pytest.approx(float(x[:-1] @ np.diff(y) - y[:-1] @ np.diff(x)) / 2, abs=1e-3)
    assert found[7] == pytest.approx(math.pi, abs=2e-3)


def test_vertices_of_circles_lie_on_them(dxf: Callable[..., Path]) -> None:
    path = dxf(lambda space: space.add_circle((3, 4), 2))
    for flattening in (0.3, 0.01, 1e-4):
        (polygon,) = rl.read_polygons(path, flattening=flattening)
        assert np.hypot(*(polygon.vertices - [3, 4]).T) == pytest.approx(2)
        middles = polygon.points(np.arange(polygon.n_edges), 0.5)
        assert 2 - np.hypot(*(middles - [3, 4]).T).min() <= flattening
    (default,) = rl.read_polygons(path)
    assert default.n_edges == math.ceil(math.pi / math.acos(1 - 1e-3 * math.hypot(4, 4) / 2))


def test_blocks_are_placed_turned_scaled_mirrored_and_repeated(dxf: Callable[..., Path]) -> None:
    def draw(space: Modelspace) -> None:
        inner = space.doc.blocks.new("INNER", base_point=(1, 1))
        inner.add_lwpolyline([(1, 1), (3, 1), (1, 2)], close=True)
        outer = space.doc.blocks.new("OUTER")
        outer.add_blockref("INNER", (2, 0), {"xscale": 2, "yscale": 3, "rotation": 90})
        space.add_blockref("OUTER", (10, 20), {"xscale": -1})
        grid = space.doc.blocks.new("DOT")
        grid.add_circle((0, 0), 0.5)
        attributes = {"row_count": 2, "column_count": 3, "row_spacing": 4, "column_spacing": 5}
        space.add_blockref("DOT", (100, 0), attributes)

    first, *dots = rl.read_polygons(dxf(draw))
    # (dx, dy) of the triangle goes to (-3 dy, 2 dx), moves by (2, 0), is mirrored, moves again
    assert corners(first) == {(8, 20), (8, 24), (11, 20)}
    centers = {tuple(np.round(dot.centroid, 6).tolist()) for dot in dots}
    assert centers == {(100 + 5 * i, 4 * j) for i in range(3) for j in range(2)}


def test_entities_seen_from_below(dxf: Callable[..., Path]) -> None:
    below = {"extrusion": (0, 0, -1)}

    def draw(space: Modelspace) -> None:
        space.add_lwpolyline(
            [(0, 0, 0.5), (4, 0, 0), (0, 3, 0)], "xyb", close=True, dxfattribs=below
        )
        space.add_circle((20, 0), 1, dxfattribs=below)

    bulged, circle = rl.read_polygons(dxf(draw), flattening=FINE)
    assert {(0, 0), (-4, 0), (0, 3)} <= corners(bulged)
    # outwards by the bulge, a half, times half of the chord
    assert bulged.bounds[1] == pytest.approx(-1, abs=FINE)
    assert circle.centroid == pytest.approx([-20, 0])
    tilted = dxf(lambda space: space.add_circle((0, 0), 1, dxfattribs={"extrusion": (0, 1, 1)}))
    assert "tilted out of the xy plane" in fault(tilted)
    rising = dxf(lambda space: space.add_line((0, 0, 0), (1, 0, 1)))
    assert "rises out of the xy plane" in fault(rising)


def test_what_is_no_outline_is_named(dxf: Callable[..., Path]) -> None:
    def draw(space: Modelspace) -> None:
        space.doc.layers.add("NOTES")
        space.doc.layers.add("HIDDEN").off()
        space.add_circle((0, 0), 1, {"layer": "NOTES"})
        space.add_text("a", dxfattribs={"layer": "NOTES"})
        space.add_circle((5, 0), 1)
        space.add_point((1, 1), {"layer": "HIDDEN"})
        space.add_point((1, 1))
        space.add_point((2, 1))

    path = dxf(draw)
    message = fault(path)
    assert message.startswith("TEXT (handle ")
    assert "layer 'NOTES') is no outline (in all: 2 POINT, 1 TEXT): leave such" in message
    assert 'ignore=["POINT", "TEXT"]' in message
    both = rl.read_polygons(path, ignore=["point", "Text"])
    assert [polygon.name for polygon in both] == ["NOTES", "part_1"]
    assert len(rl.read_polygons(path, layers="notes", ignore="TEXT")) == 1
    assert "POINT" in fault(path, layers=["HIDDEN"])
    assert "no layer 'CUT'; the layers are '0'" in fault(path, layers=["CUT"])


@pytest.mark.parametrize("version", ["R12", "R2010"])
def test_layers_in_no_table_are_layers(dxf: Callable[..., Path], version: str) -> None:
    def draw(space: Modelspace) -> None:
        block = space.doc.blocks.new("B")
        block.add_circle((9, 0), 2, {"layer": "Inner"})
        space.add_blockref("B", (0, 0))
        space.add_circle((0, 0), 1, {"layer": "Cut"})

    path = dxf(draw, version)
    assert all(name not in ezdxf.readfile(path).layers for name in ("Cut", "Inner"))
    for layer, size in (("cut", math.pi), ("INNER", 4 * math.pi)):
        assert areas(path, layers=[layer]) == pytest.approx([size], rel=1e-3)
    assert "no layer 'cat'; the layers are '0', 'Cut', 'Inner'" in fault(path, layers=["cat"])


def test_layer_0_of_blocks_is_that_of_the_insert(dxf: Callable[..., Path]) -> None:
    def draw(space: Modelspace) -> None:
        block = space.doc.blocks.new("B")
        block.add_circle((0, 0), 1)
        block.add_circle((5, 0), 1, {"layer": "OWN"})
        space.doc.layers.add("CUT")
        space.doc.layers.add("OWN")
        space.add_blockref("B", (0, 0), {"layer": "CUT"})

    path = dxf(draw)
    assert [polygon.name for polygon in rl.read_polygons(path)] == ["CUT", "OWN"]
    (cut,) = rl.read_polygons(path, layers=["CUT"])
    assert cut.centroid == pytest.approx([0, 0], abs=1e-9)


def test_damaged_dxf(dxf: Callable[..., Path], tmp_path: Path) -> None:
    def cyclic(space: Modelspace) -> None:
        block = space.doc.blocks.new("LOOP")
        block.add_blockref("LOOP", (1, 0))
        space.add_blockref("LOOP", (0, 0))

    assert "'LOOP' contains itself" in fault(dxf(cyclic))
    assert "refers to block 'GONE'" in fault(dxf(lambda space: space.add_blockref("GONE", (0, 0))))
    zero = dxf(lambda space: space.add_lwpolyline([(0, 0), (1, 0), (0, 1)]))
    assert "LWPOLYLINE (handle" in fault(zero)
    assert "is open: it ends at (0, 0), 1 from (0, 1)" in fault(zero)
    assert fault(dxf(lambda space: None)) == "holds no polygon"
    path = tmp_path / "torn.dxf"
    path.write_text("  0\nSECTION\n  2\nENTITIES\n  0\nCIRCLE\n 10\nx\n")
    assert fault(path).startswith("is DXF that cannot be read")


def test_old_and_binary_files(dxf: Callable[..., Path]) -> None:
    def draw(space: Modelspace) -> None:
        space.add_polyline2d([(0, 0, 0), (4, 0, 1), (4, 2, 0)], format="xyb", close=True)

    for version, form in (("R12", "asc"), ("R2018", "asc"), ("R2000", "bin")):
        assert areas(dxf(draw, version, form)) == pytest.approx([4 + math.pi / 2], abs=1e-3)


# --- SVG ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "area"),
    [
        ('<rect x="1" y="2" width="6" height="4"/>', 24),
        ('<rect width="6" height="4" rx="1"/>', 24 - 4 + math.pi),
        ('<rect width="6" height="4" rx="2" ry="1"/>', 24 - 8 + 2 * math.pi),
        ('<rect width="6" height="4" rx="9" ry="1"/>', 24 - 12 + 3 * math.pi),
        ('<circle cx="3" r="2"/>', 4 * math.pi),
        ('<ellipse rx="3" ry="2"/>', 6 * math.pi),
        ('<polygon points="0,0 4,0 4,3"/>', 6),
        ('<polyline points="0 0 4 0 4 3 0 0"/>', 6),
        ('<line x2="4"/><line x1="4" x2="4" y2="3"/><polyline points="4,3 0,0"/>', 6),
        ('<path d="M0,0H4V3z"/>', 6),
        ('<path d="m1 1h4v3z m10 0 l4 0 0 3 z"/>', [6, 6]),
        ('<path d="M0 0h4v3z l-4,0 0,-3z"/>', None),
        ('<path d="M0 0 C 0 4 4 4 4 0 Z"/>', 9.6),
        ('<path d="M0 0 Q 2 6 4 0 z"/>', 8),
        ('<path d="M0 0 Q 1 3 2 0 T 4 0 V 9 H 0 z"/>', 36),
        ('<path d="M0 0 A 2 2 0 0 1 4 0 Z"/>', 2 * math.pi),
        ('<path d="M0 0 A 2 2 0 1 1 2 2 Z"/>', 3 * math.pi + 2),
        ('<path d="M0,0a2 2 0 0 1 4 0 0 0 0 0 1 0 2z"/>', 2 * math.pi + 4),
        (
            '<g transform="translate(3,1) rotate(30) scale(2 3)"><rect width="2" height="1"/></g>',
            12,
        ),
        ('<rect width="4" height="3" transform="skewX(30)"/>', 12),
        ('<rect width="1in" height="25.4mm"/>', 96 * 96),
        ('<rect width="10%" height="50%"/>', 10 * 25),
        ('<path d="M0 0h9v9h-9z M1 1h3v3h-3z"/>', 81),
        ('<path d="M0 0h9v9h-9z M1 1h3v3h-3z" fill-rule="evenodd"/>', 72),
        ('<path d="M0 0h9v9h-9z M1 1v3h3v-3z"/>', 72),
        ('<path d="M0 0h9v9h-9z M1 1h3v3h-3z" style="fill:none;stroke:red"/>', 72),
        ('<rect width="9" height="9"/><circle cx="4" cy="4" r="1"/>', 81 - math.pi),
        ('<g display="none"><text>a</text></g><circle r="1"/>', math.pi),
        ('<circle r="0"/><rect width="5"/><circle r="1"/>', math.pi),
    ],
)
def test_shapes_and_paths(
    svg: Callable[..., Path], content: str, area: float | list | None
) -> None:
    path = svg(content, 'viewBox="0 0 100 50"')
    if area is None:
        with pytest.raises(rl.FileFormatError, match=r"<path> \(line 2\)"):
            rl.read_polygons(path)
        return
    expected = area if isinstance(area, list) else [area]
    found = rl.read_polygons(path, flattening=1e-4, joining=1e-9)
    assert [polygon.area for polygon in found] == pytest.approx(expected, abs=5e-3)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('<path d="M10 5 h4 v3"/>', "it ends at (10, 5), 5 from (14, 8)"),
        ('<path d="M0 5h1M0 5h2M0 5h3"/>', "3 ends meet at (0, 5)"),
        ('<rect y="30" width="9" height="9"/><rect y="34" x="4" width="9" height="9"/>', "(9, 34)"),
        ('<path d="M0 0L2 2 2 0 0 2z" transform="translate(0 40)"/>', "(0, 40) to (2, 42), cross"),
    ],
)
def test_coordinates_in_messages_are_those_of_the_file(
    svg: Callable[..., Path], content: str, words: str
) -> None:
    message = fault(svg(content))
    assert words in message
    assert message.endswith("(coordinates as in the file: y points down)")
    assert "y points" not in fault(svg('<path d="M0 0h3z"/>'))


def test_the_y_axis_is_turned_up_and_units_stay(svg: Callable[..., Path]) -> None:
    path = svg('<polygon id="a" points="1,2 5,2 1,7"/>', 'width="100mm" viewBox="0 0 10 10"')
    (polygon,) = rl.read_polygons(path)
    assert corners(polygon) == {(1, -2), (5, -2), (1, -7)}
    assert polygon.name == "a"


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ('<defs><path id="t" d="M0 0h1v1z"/></defs><use href="#t" x="5" y="2"/>', (5, -2)),
        (
            '<defs><path id="t" d="M0 0h1v1z"/></defs>'
            '<use xlink:href="#t" x="1" transform="translate(4 2)"/>',
            (5, -2),
        ),
        (
            '<symbol id="t" viewBox="2 2 4 4"><path d="M2 2h1v1z"/></symbol>'
            '<use href="#t" x="5" y="2" width="4" height="4"/>',
            (5, -2),
        ),
        (
            '<symbol id="t" viewBox="2 2 4 4"><path d="M2 2h1v1z"/></symbol>'
            '<use href="#t" x="5" y="2" width="4" height="8"/>',
            (5, -4),
        ),
        (
            '<svg x="5" y="2" width="4" height="8" viewBox="0 0 4 4" '
            'preserveAspectRatio="xMinYMax"><path d="M0 0h1v1z"/></svg>',
            (5, -6),
        ),
        ('<svg x="5" y="2"><g><path d="M0 0h1v1z"/></g></svg>', (5, -2)),
    ],
)
def test_uses_symbols_and_nested_views(
    svg: Callable[..., Path], content: str, expected: tuple
) -> None:
    (polygon,) = rl.read_polygons(svg(content, 'viewBox="0 0 100 100"'))
    x, y = expected
    assert corners(polygon) == {(x, y), (x + 1, y), (x + 1, y - 1)}


def test_preserve_aspect_ratio_none_and_slice(svg: Callable[..., Path]) -> None:
    for words, factors in (("none", (2, 3)), ("xMidYMid slice", (3, 3)), ("xMinYMin", (2, 2))):
        nested = f'<svg width="8" height="12" viewBox="0 0 4 4" preserveAspectRatio="{words}">'
        (polygon,) = rl.read_polygons(svg(f'{nested}<path d="M1 1h1v1z"/></svg>'))
        assert np.ptp(polygon.vertices, axis=0) == pytest.approx(factors)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<text>a</text>", "<text> (line 2) is no outline"),
        ('<g id="n"><image id="i"/></g>', "<image> (id 'i', line 2) is no outline"),
        ('<use href="#gone"/>', "<use> (line 2) refers to '#gone', which is not in the file"),
        ('<g id="g"><use href="#g"/></g>', "<use> (line 2) contains itself"),
        ('<path d="M0 0 L 1"/>', "cannot be read"),
        ('<path d="L 1 1"/>', "<path> (line 2): its path data 'L 1 1' cannot be read"),
        ('<path d="M0 0 X 1 1"/>', "cannot be read"),
        ('<path d="M0 0 h4 v3"/>', "<path> (line 2) is open: it ends at (0, 0), 5 from (4, 3)"),
        ('<rect width="1em" height="2"/>', "width='1em' is no length"),
        ('<rect width="nan" height="2"/>', "width='nan' is no length"),
        ('<polygon points="0 0 1"/>', "odd number of coordinates"),
        ('<polygon points="0 0 1 x"/>', "no list of numbers"),
        ('<polygon id="p" points="0 0 2 2 2 0 0 2"/>', "<polygon> (id 'p', line 2): edge 0"),
        ('<circle r="1" transform="turn(3)"/>', "its transform cannot be read"),
        ('<circle r="1" transform="scale(0)"/>', "scaled to nothing"),
        ('<circle r="1" clip-path="url(#c)"/>', "has a clip-path: apply it"),
        ("<style>.a { display: none }</style>", "its style sheet sets 'display'"),
        ("<style>.a{fill:none}</style><path d='M0 0h1v1zM5 0h1v1z'/>", "has several parts"),
        ('<svg viewBox="1 2 3"/>', "viewBox='1 2 3' is not x y width height"),
        ("<g", "is XML that cannot be read"),
        ("", "holds no polygon"),
    ],
)
def test_what_is_not_understood_is_named(
    svg: Callable[..., Path], content: str, message: str
) -> None:
    assert message in fault(svg(content))


def test_groups_as_layers_and_kinds_to_ignore(svg: Callable[..., Path]) -> None:
    inkscape = 'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
    path = svg(
        '<g inkscape:label="cut"><g><circle id="disc" r="1"/></g></g>\n'
        '<g id="notes"><text>a</text><circle cx="9" r="1"/></g>',
        inkscape,
    )
    assert [p.name for p in rl.read_polygons(path, layers=["cut"])] == ["disc"]
    assert len(rl.read_polygons(path, ignore=["text"])) == 2
    assert "<text> (line 3)" in fault(path, layers=["notes"])
    assert "no group named 'x'; there are 'cut', 'notes'" in fault(path, layers=["x"])


@given(st.integers(0, 10**6))
def test_relative_path_data_are_the_absolute_ones(seed: int) -> None:
    """Hypothesis draws paths; both forms give the same pieces."""
    from regrasp_lp.outlines.svg import read_svg

    rng = np.random.default_rng(seed)
    absolute, relative, here = ["M 3 4"], ["m 3 4"], np.array([3.0, 4.0])
    for kind in rng.choice(list("LHVCSQT"), 6):
        count = {"L": 1, "H": 1, "V": 1, "C": 3, "S": 2, "Q": 2, "T": 1}[kind]
        steps = rng.integers(-9, 9, (count, 2)).astype(float)
        axis = {"H": [0], "V": [1]}.get(kind, [0, 1])
        there = here + steps
        absolute.append(kind + " ".join(str(x) for x in there[:, axis].ravel()))
        relative.append(kind.lower() + " ".join(str(x) for x in steps[:, axis].ravel()))
        here[axis] = there[-1, axis]
    head = '<svg xmlns="http://www.w3.org/2000/svg"><path d="'
    pieces = [
        read_svg(f'{head}{"".join(data)}z"/></svg>'.encode(), Reading())
        for data in (absolute, relative)
    ]
    flat = [[curve.flattened(0.1) for one in found for curve in one.curves] for found in pieces]
    assert len(flat[0]) == 6
    for one, other in zip(*flat, strict=True):
        assert one == pytest.approx(other)


# --- options ------------------------------------------------------------------------------------


def test_options_are_checked(svg: Callable[..., Path], tmp_path: Path) -> None:
    path = svg('<circle r="1"/>')
    for options, words in (
        ({"flattening": 0}, "flattening=0 would need edges without end"),
        ({"flattening": -1.0}, "flattening has to be a length"),
        ({"flattening": True}, "flattening has to be a length"),
        ({"joining": math.nan}, "joining has to be a length"),
        ({"ignore": [3]}, "ignore has to be a list of names"),
    ):
        with pytest.raises(rl.OptionError, match=words):
            rl.read_polygons(path, **options)
    text = tmp_path / "p.wkt"
    text.write_text("POLYGON ((0 0, 4 0, 4 3, 0 0))")
    assert "is no drawing: layers=... and ignore=... are for DXF" in fault(text, layers=["a"])
    assert len(rl.read_polygons(text, flattening=0.1, joining=0)) == 1


@pytest.mark.parametrize(
    ("name", "package", "data"),
    [
        ("a.dxf", "ezdxf", "  0\nSECTION\n  0\nEOF\n"),
        ("a.svg", "svgpathtools", "<svg xmlns='http://www.w3.org/2000/svg'/>"),
    ],
)
def test_missing_extras_are_named(tmp_path: Path, name: str, package: str, data: str) -> None:
    (tmp_path / name).write_text(data)
    code = (
        f"import sys; sys.modules[{package!r}] = None\n"
        "import regrasp_lp as rl\n"
        f"try: rl.read_polygons({str(tmp_path / name)!r})\n"
        "except rl.MissingExtraError as error: print(error)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert f'pip install "regrasp_lp[{name[2:]}]"' in run.stdout


def test_the_command_line_reads_drawings(
    svg: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    from regrasp_lp.cli import main

    path = svg('<g id="cut"><circle id="disc" r="10"/></g><text>a</text>')
    assert main(["show", str(path), "--list"]) == 2
    assert "<text> (line 2) is no outline" in capsys.readouterr().err
    arguments = ["show", str(path), "--list", "--layer", "cut", "--flattening", "1"]
    assert main(arguments) == 0
    coarse = len(capsys.readouterr().out.splitlines())
    assert main([*arguments[:-2], "--ignore", "text", "--flattening", "0.01"]) == 0
    assert len(capsys.readouterr().out.splitlines()) > coarse
