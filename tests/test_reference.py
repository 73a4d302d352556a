"""The geometric reference itself: GEOS against whole numbers, cases by hand, symmetries."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
import shapely
from conftest import covering
from geometry import (
    GENERAL,
    LATTICE,
    comb,
    hexagon,
    lattice_star,
    rectangle,
    regular,
    staircase,
    star,
    unit_square,
    with_hole,
    you,
)
from reference import (
    BAND,
    Key,
    Piece,
    ReferenceGraph,
    Scene,
    clip,
    clip_all,
    eliminated,
    intersect_cones,
    outermost,
    parallel_sets,
    reference_graph,
    two_finger_and_concurrent,
)

import regrasp_lp as rl

TAN_10 = math.tan(math.radians(10))
SHAPES = {**LATTICE, **GENERAL, "star 11": star(11, 2), "lattice star 9": lattice_star(9, 4)}
PER_EDGE = (0.125, 0.25, 0.3, 0.5, 1.0, 1.7)


def friction_of(polygon: rl.Polygon, mu: float | str) -> float | list[float]:
    """One value, or one for each edge."""
    if not isinstance(mu, str):
        return mu
    rng = np.random.default_rng(polygon.n_edges)
    return [float(v) for v in rng.choice(PER_EDGE, polygon.n_edges)]


# --- convex sets in whole numbers ---------------------------------------------------------------

SQUARE = [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]


def area(points: list[tuple[int, int, int]]) -> Fraction:
    corners = [(Fraction(x, w), Fraction(y, w)) for x, y, w in points]
    following = [*corners[1:], *corners[:1]]
    return (
        sum(
            (p[0] * q[1] - p[1] * q[0] for p, q in zip(corners, following, strict=True)), Fraction()
        )
        / 2
    )


def test_clip() -> None:
    assert area(clip(SQUARE, (-2, 0, 1))) == Fraction(1, 2)  # x < 1/2
    assert area(clip(SQUARE, (-1, -1, 1))) == Fraction(1, 2)  # x + y < 1, through two corners
    assert clip(SQUARE, (1, 0, 0)) == SQUARE  # x > 0
    assert clip(SQUARE, (-1, 0, 0)) == []  # x < 0 meets the boundary only
    assert clip(SQUARE, (0, 0, 0)) == []  # 0 > 0
    quadrant = [(0, 0, 1), (1, 0, 0), (0, 1, 0)]
    assert area(clip(quadrant, (-1, -1, 2))) == 2  # x + y < 2, of what is unbounded


def test_clip_like_shapely() -> None:
    rng = np.random.default_rng(0)
    drawn = shapely.Polygon([p[:2] for p in SQUARE])
    for _ in range(200):
        rows = [tuple(int(v) for v in row) for row in rng.integers(-9, 10, (4, 3))]
        expected = drawn
        for a, b, c in rows:
            if a == b == 0:
                expected = expected if c > 0 else shapely.Polygon()
                continue
            n = np.array([a, b]) / np.hypot(a, b)
            foot, along = -c * n / np.hypot(a, b), 99 * np.array([-n[1], n[0]])
            corners = [foot + along, foot - along, foot - along + 99 * n, foot + along + 99 * n]
            expected &= shapely.Polygon(corners)
        assert float(area(clip_all(SQUARE, rows))) == pytest.approx(expected.area, abs=1e-9)


def test_pieces_that_only_touch_do_not_meet() -> None:
    left, right = Piece(clip(SQUARE, (-2, 0, 1))), Piece(clip(SQUARE, (2, 0, -1)))
    assert not left.meets(right)
    assert not right.meets(left)
    assert left.meets(Piece(SQUARE))
    assert left.meets(left)
    # by less than any double between 0 and 1 could tell
    tiny = 2**200
    assert left.meets(Piece(clip(SQUARE, (2 * tiny, 0, 1 - tiny))))
    assert not left.meets(Piece([(1, 1, 1), (2, 1, 1), (2, 2, 1), (1, 2, 1)]))


def test_cones() -> None:
    first = ((1, 0), (0, 1))
    assert intersect_cones(first, ((1, 1), (-1, 1))) == ((1, 1), (0, 1))
    assert intersect_cones(((1, 1), (-1, 1)), first) == ((1, 1), (0, 1))
    assert intersect_cones(first, ((2, 1), (1, 2))) == ((2, 1), (1, 2))
    assert intersect_cones(first, ((0, 1), (-1, 0))) is None  # one common ray
    assert intersect_cones(first, ((-1, 0), (0, -1))) is None
    wide = ((9, 1), (-9, 1))
    assert intersect_cones(wide, ((-9, -1), (9, -1))) is None
    assert intersect_cones(wide, ((9, -2), (-9, 3))) == ((9, 1), (-3, 1))


def test_elimination() -> None:
    """0 < x < y < 1 - z leaves 0 < y < 1 - z, and that leaves 0 < 1 - z."""
    rows = [(0, 1, 0, 0), (0, -1, 1, 0), (1, 0, -1, -1)]
    left = eliminated(rows, 1)
    assert left == [(0, 1, 0), (1, -1, -1)]
    assert eliminated(left, 1) == [(1, -1)]


def test_outermost() -> None:
    half, whole = (Fraction(0), Fraction(1, 2)), (Fraction(0), Fraction(1))
    right = (Fraction(1, 2), Fraction(3, 2))
    assert outermost([half, whole, half, right]) == [whole, right]


# --- whole graphs -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "mu", "switching"),
    covering(SHAPES, [TAN_10, 0.5, 1.0, "per edge"], ["focus", "contact"], least=2),
)
def test_geos_and_whole_numbers_agree(name: str, mu: float | str, switching: str) -> None:
    polygon = SHAPES[name]
    friction = friction_of(polygon, mu)
    graph = reference_graph(polygon, friction, switching)
    assert graph == reference_graph(polygon, friction, switching, exact=True)


@pytest.mark.parametrize(
    ("name", "mu", "switching"),
    covering(SHAPES, [0.1, 0.3, 0.57, 2.0, "per edge"], ["focus", "contact"], least=2),
)
def test_the_library_finds_the_same_graph(name: str, mu: float | str, switching: str) -> None:
    polygon = SHAPES[name]
    friction = friction_of(polygon, mu)
    graph = rl.build_switching_graph(polygon, friction, sets="chapter", switching=switching)
    reference = reference_graph(polygon, friction, switching)
    keys = [(s.kind, tuple(s.edges), -1 if s.center is None else s.center) for s in graph.sets]
    assert sorted(keys) == sorted(reference.vertices)
    pairs = {frozenset((keys[i], keys[j])) for i in range(len(graph)) for j in graph.neighbors(i)}
    assert pairs == reference.named()
    assert graph.n_switches == len(reference.pairs)
    assert len(graph.components()) == reference.n_components


@pytest.mark.parametrize("polygon", [star(13, 1), lattice_star(9, 4), with_hole()], ids=repr)
def test_the_focus_rule_is_part_of_the_contact_rule(polygon: rl.Polygon) -> None:
    focus, contact = (reference_graph(polygon, 0.2, rule) for rule in ("focus", "contact"))
    assert focus.vertices == contact.vertices
    assert focus.named() <= contact.named()


@pytest.mark.parametrize("polygon", [star(13, 0), staircase(2, 4), lattice_star(9, 4)], ids=repr)
@pytest.mark.parametrize("mu", [0.3, 0.9, 1.5])
def test_parallel_sets_are_those_of_proposition_3_9(polygon: rl.Polygon, mu: float) -> None:
    """The edges b and c are not both in one outer region of all the common cones on a."""
    scene = Scene(polygon, mu)
    found = parallel_sets(scene)
    expected = set()
    for triple in combinations(range(polygon.n_edges), 3):
        for center in triple:
            b, c = (e for e in triple if e != center)
            cone = scene.common_cone(center, b, c)
            if cone is None:
                continue
            turns = [
                d[0] * (q[1] - p[1]) - d[1] * (q[0] - p[0])
                for d in cone
                for e in (b, c)
                for q in (scene.starts[e], scene.ends[e])
                for p in (scene.starts[center], scene.ends[center])
            ]
            if min(turns) < 0 < max(turns):
                expected.add(("parallel", triple, center))
    assert set(found) == expected
    assert expected


# --- by hand ------------------------------------------------------------------------------------


def graph_at_ten_degrees(polygon: rl.Polygon, switching: str = "focus") -> ReferenceGraph:
    return reference_graph(polygon, TAN_10, switching)


@pytest.mark.parametrize("polygon", [unit_square(), rectangle()], ids=["square", "rectangle"])
def test_square_and_rectangle(polygon: rl.Polygon) -> None:
    """Two pairs of opposite edges; four normals at right angles do not span with three cones."""
    graph = graph_at_ten_degrees(polygon)
    assert graph.vertices == [("two_finger", (0, 2), -1), ("two_finger", (1, 3), -1)]
    assert graph.pairs == [(0, 1)]
    assert graph.n_components == 1


def test_cell_of_two_opposite_edges() -> None:
    """Of a 4 by 2 rectangle at μ = 1/4: between the long edges, and a tip beyond each.

    One edge moved along the cones is 4 + 2 y/4 wide at distance y, the other moved against them
    4 + 2 (2 - y)/4 wide; both together, on the same middle, the narrower of the two.
    """
    cell = Scene(rectangle(), 0.25).two_finger_cell(0, 2)
    assert cell is not None
    assert len(cell) == 1
    corners = {(Fraction(x, w), Fraction(y, w)) for x, y, w in cell[0].points}
    scale = Fraction(1, 2)  # whole numbers: the rectangle's common factor is taken out
    assert corners == {
        (x * scale, y * scale)
        for x, y in [
            (Fraction(0), Fraction(0)),
            (Fraction(4), Fraction(0)),
            (Fraction(17, 4), Fraction(1)),
            (Fraction(4), Fraction(2)),
            (Fraction(0), Fraction(2)),
            (Fraction(-1, 4), Fraction(1)),
        ]
    }


def test_regular_triangle() -> None:
    """Normals 120 degrees apart: one concurrent set below 30 degrees, none from there on."""
    concurrent: Key = ("concurrent", (0, 1, 2), -1)
    assert graph_at_ten_degrees(regular(3)).vertices == [concurrent]
    below, above = math.tan(math.radians(29.99)), math.tan(math.radians(30.01))
    assert reference_graph(regular(3), below).vertices == [concurrent]
    # the pairs, 60 degrees off opposition, are two-finger sets from 30 degrees on
    assert {k[0] for k in reference_graph(regular(3), above).vertices} == {"two_finger"}


def test_regular_hexagon() -> None:
    """Three pairs of opposite edges, two triples 120 degrees apart, no three nearly parallel.

    The triples share no two edges. All cells hold the middle, and each pair shares an edge with
    each triple: 3 + 0 + 6 switches, by either rule.
    """
    for switching in ("focus", "contact"):
        graph = graph_at_ten_degrees(regular(6), switching)
        assert graph.counts == {"two_finger": 3, "concurrent": 2, "parallel": 0}
        assert len(graph.pairs) == 9
        assert graph.n_components == 1


def test_lattice_octagon() -> None:
    """Normals 45 degrees apart: pairs of opposites, and triples with gaps of 135, 135, 90 only."""
    graph = graph_at_ten_degrees(hexagon())
    assert graph.counts == {"two_finger": 4, "concurrent": 8, "parallel": 0}


def test_u_channel() -> None:
    """Rectilinear: no concurrent sets, and pairs of opposite normals that see enough of each other.

    Edges: 0 bottom, 1 right, 2 and 6 tops, 3 and 5 inner sides, 4 inner bottom, 7 left. All
    opposed pairs but the tops', which have only the bottom, and the inner sides', each of which
    opposes the outer side of its leg and the other inner side; and left with right.
    """
    graph = graph_at_ten_degrees(you())
    two_finger = {k[1] for k in graph.vertices if k[0] == "two_finger"}
    assert two_finger == {(0, 2), (0, 4), (0, 6), (1, 3), (1, 7), (3, 5), (5, 7)}
    assert graph.counts["concurrent"] == 0
    # the bottom between two of the three above it; each other side between two opposed to it
    parallel = {k[1:] for k in graph.vertices if k[0] == "parallel"}
    assert {((0, 2, 4), 0), ((0, 2, 6), 0), ((0, 4, 6), 0)} <= parallel
    assert all(
        len({tuple(np.sign(you().normals[e].round(9))) for e in edges}) == 2
        for edges, _ in parallel
    )


def test_sets_that_only_touch() -> None:
    """Steps of one: at μ = 1 cones of 45 degrees end in corners, where nothing overlaps.

    The square's two-finger cells of neighbouring edges (normals 90 degrees apart, cones that
    touch in one ray) do not exist, and become sets with the next double above 1.
    """
    assert reference_graph(unit_square(), 1.0).counts["two_finger"] == 2
    assert reference_graph(unit_square(), math.nextafter(1.0, 2)).counts["two_finger"] == 6


def test_friction_is_checked() -> None:
    for friction in (0.0, [0.1] * 3, -1.0):
        with pytest.raises(ValueError, match="positive"):
            Scene(unit_square(), friction)


# --- symmetries ---------------------------------------------------------------------------------


def renamed(graph: ReferenceGraph, number: list[int]) -> tuple[set[Key], set[frozenset[Key]]]:
    def name(key: Key) -> Key:
        kind, edges, center = key
        return kind, tuple(sorted(number[e] for e in edges)), number[center] if center >= 0 else -1

    return {name(k) for k in graph.vertices}, {frozenset(map(name, p)) for p in graph.named()}


SYMMETRIC = [star(12, 5), lattice_star(9, 4), comb(2), regular(7), staircase(1, 3)]


@pytest.mark.parametrize("polygon", SYMMETRIC, ids=repr)
@pytest.mark.parametrize("switching", ["focus", "contact"])
def test_another_first_vertex(polygon: rl.Polygon, switching: str) -> None:
    n = polygon.n_edges
    for turn in (1, n // 2):
        turned = rl.Polygon(np.roll(polygon.exterior, -turn, axis=0))
        expected = renamed(graph_at_ten_degrees(polygon, switching), list(range(n)))
        number = [(e + turn) % n for e in range(n)]
        assert renamed(graph_at_ten_degrees(turned, switching), number) == expected


@pytest.mark.parametrize("polygon", SYMMETRIC, ids=repr)
@pytest.mark.parametrize("switching", ["focus", "contact"])
def test_mirror(polygon: rl.Polygon, switching: str) -> None:
    mirrored = rl.Polygon(polygon.exterior * [-1, 1])
    number = mirrored.input_edge.tolist()
    expected = renamed(graph_at_ten_degrees(polygon, switching), list(range(polygon.n_edges)))
    assert renamed(graph_at_ten_degrees(mirrored, switching), number) == expected


@pytest.mark.parametrize("polygon", SYMMETRIC, ids=repr)
def test_turned_by_a_quarter_moved_and_doubled(polygon: rl.Polygon) -> None:
    """Exactly, in doubles: coordinates are exchanged, doubled, and moved where that is exact."""
    x, y = polygon.exterior.T
    moved = rl.Polygon(np.stack([-2 * y, 2 * x], axis=1))
    assert graph_at_ten_degrees(moved) == graph_at_ten_degrees(polygon)


def test_cells_are_larger_than_the_band() -> None:
    """GEOS has something to decide: most cells of a random object are far from the band."""
    polygon = star(13, 1)
    scene = Scene(polygon, TAN_10)
    cells = two_finger_and_concurrent(scene)
    areas = [sum(p.drawn(scene.size).area for p in cell) for cell in cells.values()]
    assert np.mean(np.array(areas) > 1000 * BAND) > 0.9
