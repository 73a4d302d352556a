from __future__ import annotations

import copy
import dataclasses
import itertools
import math
import pickle
import re
import subprocess
import sys
import time
import types
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import shapely
from conftest import star_polygon
from hypothesis import assume, given
from hypothesis import strategies as st

from regrasp_lp.errors import ContactError, PolygonError
from regrasp_lp.polygon import Contact, Grasp, Polygon
from regrasp_lp.ring_checks import _Edges, check_rings

SQUARE = [(0, 0), (10, 0), (10, 10), (0, 10)]
HOLE = [(2, 2), (4, 2), (4, 4), (2, 4)]

# --- degenerate input ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("exterior", "message"),
    [
        ([], "the outline has 0 points"),
        ([(0, 0)], "the outline has 1 point:"),
        ([(0, 0), (1, 0)], "the outline has 2 points"),
        ([(0, 0), (1, 0), (0, 0)], "the outline has 2 points"),
        ([(0, 0), (1, 0), (math.nan, 1)], r"not finite: point 2 is \(nan, 1\)"),
        ([(0, 0), (1, math.inf), (0, 1)], r"not finite: point 1 is \(1, inf\)"),
        (np.array([[0, 0], [-np.inf, 0], [0, 1]]), "not finite: point 1"),
        ([(0, 0), (1, 0), (1, 0), (0, 1)], r"edge 1 has no length, points 1 and 2 are both \(1, 0"),
        ([(0, 0), (1, 0), (0, 1), (0, 0), (0, 0)], "edge 3 has no length, points 3 and 0"),
        ([(0, 0), (2, 2), (2, 0), (0, 2)], "edge 0 of the outline, .* crosses edge 2 of the out"),
        ([(0, 0), (4, 0), (2, 0)], "no area"),
        ([(0, 0), (1, 1), (3, 3), (2, 2)], "no area"),
        ([(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)], "edge 0 of the outline, .* touches edge 2"),
        ([(0, 0), (2, 2), (4, 0), (4, 4), (2, 2), (0, 4)], "touches itself where edges 1 and 4"),
        ([(0, 0), (4, 0), (4, 4), (4, 2), (0, 2)], r"edge 2 .* folds back onto edge 1 .*\(4, 4\)"),
        ([(4, 4), (4, 2), (0, 2), (0, 0), (4, 0)], r"edge 0 .* folds back onto edge 4 .*\(4, 4\)"),
        ([(0, 0), (6, 0), (6, -5), (9, -5), (9, 0), (3, 0), (0, 5)], "edge 0 .* overlaps edge 4"),
        ([(0, 0), (6, 6), (6, 1), (9, 4), (9, 9), (3, 3), (0, 5)], "edge 0 .* overlaps edge 4"),
        ([(0, 0), (1e101, 0), (0, 1)], "coordinates may not exceed 1e[+]100"),
        ([(0, 0), (1e-101, 0), (0, 1e-101)], "is only 1e-101 by 1e-101 in size"),
        ([(0, 0), (1, 0), (0, 1e-200)], "is only 1 by 1e-200 in size"),
        ("POLYGON ((0 0))", "sequence of points"),
        (b"abc", "sequence of points"),
        ({"x": 1}, "sequence of points"),
        ({(0, 0), (1, 0), (0, 1)}, "sequence of points"),
        (None, "sequence of points"),
        (7, "sequence of points"),
        ([1, 2, 3], "point 0 is 1"),
        (["ab", "cd", "ef"], "point 0 is 'ab'"),
        ([{0, 1}, {1, 2}, {2, 0}], "point 0 is {0, 1}"),
        ([("0", "0"), ("1", "0"), ("0", "1")], "coordinate of point 0 is no number: '0'"),
        ([(0, 0), (True, False), (1, 1)], "coordinate of point 1 is no number: True"),
        ([(0, 0), (None, 0), (1, 1)], "coordinate of point 1 is no number: None"),
        ([(0, 0), (1j, 0), (1, 1)], "coordinate of point 1 is no number"),
        ([(0, 0), (10**400, 0), (1, 1)], "coordinate of point 1 is too large"),
        ([(0, 0), (1, 0), (1, 1, 1)], "point 2 has 3 coordinates"),
        ([(0, 0), (1,), (1, 1)], "point 1 has 1 coordinates"),
        (np.zeros((3, 3)), r"its shape is \(3, 3\)"),
        (np.zeros(6), r"its shape is \(6,\)"),
        (np.zeros((3, 2), dtype=bool), "not of bool"),
        (np.zeros((3, 2), dtype=complex), "not of complex128"),
        (np.array([["0", "0"], ["1", "0"], ["0", "1"]]), "not of <U1"),
        (np.array([[0, 0], [None, 0], [0, 1]], dtype=object), "coordinate of point 1 is no number"),
        (shapely.Polygon(), "Polygon given is empty"),
        (shapely.Polygon([(0, 0, 1), (1, 0, 1), (0, 1, 1)]), "point 0 has 3 coordinates"),
        (shapely.MultiPolygon([shapely.box(0, 0, 1, 1)]), "got a MultiPolygon"),
        (shapely.Point(1, 2), "got a Point"),
    ],
)
def test_degenerate_outline_is_refused(exterior: Any, message: str) -> None:
    with pytest.raises(PolygonError, match=message) as caught:
        Polygon(exterior, name="part 7")
    assert str(caught.value).startswith("polygon 'part 7': ")


def shifted(ring: Sequence[tuple[float, float]], x: float, y: float) -> list[tuple[float, float]]:
    return [(a + x, b + y) for a, b in ring]


@pytest.mark.parametrize(
    ("holes", "message"),
    [
        ([shifted(HOLE, 20, 0)], "hole 0 lies outside the outline"),
        ([HOLE, shifted(HOLE, -20, 3)], "hole 1 lies outside the outline"),
        ([[(-1, -1), (11, -1), (11, 11), (-1, 11)]], "hole 0 lies outside the outline"),
        ([shifted(HOLE, 7, 0)], "edge 1 of the outline, .* crosses edge 4 of hole 0"),
        ([shifted(HOLE, 6, 0)], "edge 1 of the outline, .* touches edge 4 of hole 0"),
        ([shifted(HOLE, 6, 0)[1:]], "edge 1 of the outline, .* overlaps edge 4 of hole 0"),
        ([[(0, 0), (4, 2), (2, 4)]], "edge 0 of the outline, .* touches edge 4 of hole 0"),
        ([[(3, 0), (4, 2), (2, 4)]], "edge 0 of the outline, .* touches edge 4 of hole 0"),
        ([SQUARE], "edge 0 of the outline, .* overlaps edge 4 of hole 0"),
        ([HOLE, shifted(HOLE, 1, 1)], "edge 5 of hole 0, .* crosses edge 8 of hole 1"),
        ([HOLE, shifted(HOLE, 2, 2)], "edge 5 of hole 0, .* touches edge 8 of hole 1"),
        ([HOLE, [(4, 5), (4, 3), (6, 3)]], "edge 5 of hole 0, .* overlaps edge 8 of hole 1"),
        ([HOLE, HOLE], "edge 4 of hole 0, .* overlaps edge 8 of hole 1"),
        ([HOLE, [(2.5, 2.5), (3, 2.5), (3, 3)]], "hole 1 lies inside hole 0"),
        ([[(2.5, 2.5), (3, 2.5), (3, 3)], HOLE], "hole 0 lies inside hole 1"),
        ([HOLE, [(5, 5), (6, 5)]], "hole 1 has 2 points"),
        ([HOLE, [(5, 5), (6, 5), (7, 5)]], "hole 1 has no area"),
        ([[(2, 2), (4, 2), (4, 2), (4, 4)]], "hole 0: edge 5 has no length, points 1 and 2"),
        ([[(2, 2), (4, 4), (4, 2), (2, 4)]], "edge 4 of hole 0, .* crosses edge 6 of hole 0"),
        (HOLE, r"a single hole is written \[ring\]"),
        (np.array(HOLE), r"a single hole is written \[ring\]"),
        ("hole", "holes has to be a list of rings"),
        (None, "holes has to be a list of rings"),
        ({"a": HOLE}, "holes has to be a list of rings"),
        ([None], "hole 0 has to be a sequence of points"),
        ([[]], "hole 0 has 0 points"),
    ],
)
def test_degenerate_holes_are_refused(holes: Any, message: str) -> None:
    with pytest.raises(PolygonError, match=message):
        Polygon(SQUARE, holes)


def test_shapely_polygon_brings_its_own_holes() -> None:
    with pytest.raises(PolygonError, match="leave the argument holes empty"):
        Polygon(shapely.box(0, 0, 10, 10), [HOLE])


def test_name_has_to_be_a_string() -> None:
    with pytest.raises(PolygonError, match="name of a polygon"):
        Polygon(SQUARE, name=7)  # type: ignore[arg-type]


def test_limits_of_size_are_accepted() -> None:
    assert Polygon([(0, 0), (1e-100, 0), (0, 1e-100)]).area == pytest.approx(5e-201)
    huge = Polygon([(0, 0), (1e100, 0), (0, 1e100)])
    assert huge.area == pytest.approx(5e199)
    assert np.isfinite(huge.tangents).all()


def test_edges_of_subnormal_length_have_unit_tangents() -> None:
    polygon = Polygon([(0, 0), (1, 0), (1, 1), (5e-324, 5e-324)])
    assert np.allclose(np.linalg.norm(polygon.tangents, axis=1), 1, atol=1e-15)
    assert np.allclose(polygon.tangents[3], -math.sqrt(0.5))


# --- exactness ----------------------------------------------------------------------------------


def test_one_unit_in_the_last_place_decides() -> None:
    """A notch whose tip is above, on and below the base by the least possible amount."""
    tip = 0.1 + 0.2  # on the line y = x, far from representable sums

    def notch(y: float) -> list[tuple[float, float]]:
        return [(0, 0), (1, 1), (0.9, 2), (tip, y), (-1, 2)]

    Polygon(notch(np.nextafter(tip, 1)))
    with pytest.raises(PolygonError, match="touches"):
        Polygon(notch(tip))
    with pytest.raises(PolygonError, match="crosses"):
        Polygon(notch(np.nextafter(tip, 0)))


def test_a_spike_is_told_from_a_needle() -> None:
    Polygon([(0, 0), (3, 1), (1.5, np.nextafter(0.5, 1)), (0, 5)])
    with pytest.raises(PolygonError, match="folds back"):
        Polygon([(0, 0), (3, 1), (1.5, 0.5), (0, 5)])


def test_the_float_filter_never_trusts_a_wrong_sign() -> None:
    """Tips of a notch within two units in the last place of an edge: floats get some wrong."""
    rng = np.random.default_rng(0)
    wrong = 0
    for _ in range(500):
        a = rng.uniform(0, 1, 2)
        b = a + rng.uniform(5, 30, 2)
        tip = a + rng.uniform(0.2, 0.8) * (b - a)
        tip += rng.integers(-2, 3, 2) * np.spacing(tip)
        naive = (a[0] - tip[0]) * (b[1] - tip[1]) - (a[1] - tip[1]) * (b[0] - tip[0])
        (ax, ay), (bx, by), (tx, ty) = (map(Fraction, point.tolist()) for point in (a, b, tip))
        exact = (ax - tx) * (by - ty) - (ay - ty) * (bx - tx)
        wrong += (naive > 0 and exact <= 0) or (naive < 0 and exact >= 0)
        assert accepts([a, b, (b[0], 99), tip, (a[0], 99)]) == (exact > 0)
    assert wrong > 0, "floats alone would do: this tests nothing"


def test_a_hole_beside_an_edge_is_inside_or_outside_exactly() -> None:
    outline = [(0, 0), (3, 1), (0, 5)]
    Polygon(outline, [[(1.5, np.nextafter(0.5, 1)), (1.5, 1), (1.2, 1)]])
    with pytest.raises(PolygonError, match="hole 0 lies outside the outline"):
        Polygon(outline, [[(1.5, np.nextafter(0.5, 0)), (1.5, -1), (1.2, -1)]])


def test_orientation_of_slivers_is_exact() -> None:
    y = 1 / 3
    for up in (math.inf, -math.inf):
        sliver = Polygon([(y, y), (1.1, 1.1), (0.7, np.nextafter(0.7, up))])
        assert sliver.area > 0
        assert sliver.input_edge.tolist() == ([0, 1, 2] if up > 0 else [2, 1, 0])


def brute_force_is_simple(rings: Sequence[Sequence[tuple[float, float]]]) -> bool:
    """Simplicity of rings by solving for intersections in rationals; nesting is not looked at."""
    edges: list[tuple[int, int, int]] = []
    points = [[(Fraction(x), Fraction(y)) for x, y in ring] for ring in rings]
    for r, ring in enumerate(points):
        edges += [(r, k, len(ring)) for k in range(len(ring))]

    def ends(e: tuple[int, int, int]) -> list[tuple[Fraction, Fraction]]:
        r, k, n = e
        return [points[r][k], points[r][(k + 1) % n]]

    for e in edges:
        if ends(e)[0] == ends(e)[1]:
            return False
    for e, f in itertools.combinations(edges, 2):
        (a, b), (c, d) = ends(e), ends(f)
        u, v, w = ((q[0] - p[0], q[1] - p[1]) for p, q in ((a, b), (c, d), (a, c)))
        following = e[0] == f[0] and (f[1] - e[1]) % e[2] == 1
        before = e[0] == f[0] and (e[1] - f[1]) % e[2] == 1
        det = u[0] * v[1] - u[1] * v[0]
        if det != 0:
            s = (w[0] * v[1] - w[1] * v[0]) / det
            t = (w[0] * u[1] - w[1] * u[0]) / det
            if 0 <= s <= 1 and 0 <= t <= 1 and not following and not before:
                return False
        elif u[0] * w[1] == u[1] * w[0]:
            length = u[0] ** 2 + u[1] ** 2
            at = sorted((u[0] * (p[0] - a[0]) + u[1] * (p[1] - a[1])) / length for p in (c, d))
            low, high = max(at[0], Fraction(0)), min(at[1], Fraction(1))
            if low < high or (low == high and not following and not before):
                return False
    return True


def accepts(exterior: Any, holes: Any = ()) -> bool:
    try:
        Polygon(exterior, holes)
    except PolygonError:
        return False
    return True


def shapely_accepts(exterior: Any, holes: Any = ()) -> bool:
    """Simple in the strict sense: shapely lets rings touch at a point and points repeat."""
    rings = [shapely.LinearRing(ring) for ring in (exterior, *holes)]
    return bool(
        shapely.Polygon(exterior, holes).is_valid
        and all(ring.is_simple for ring in rings)
        and not any(a.intersects(b) for a, b in itertools.combinations(rings, 2))
        and not any(p == q for ring in (exterior, *holes) for p, q in itertools.pairwise(ring))
    )


def grid(size: int) -> st.SearchStrategy[tuple[int, int]]:
    return st.tuples(st.integers(0, size), st.integers(0, size))


@given(st.lists(grid(4), min_size=3, max_size=8))
def test_acceptance_is_shapelys_on_small_grids(ring: list[tuple[int, int]]) -> None:
    assume(ring[0] != ring[-1])
    assert accepts(ring) == shapely_accepts(ring) == brute_force_is_simple([ring])


def test_acceptance_is_shapelys_on_all_quadrilaterals_of_a_grid() -> None:
    """Nothing left to chance: collinear, spiked, crossing, reversed, repeated."""
    cells = list(itertools.product(range(3), range(3)))
    accepted = 0
    for ring in itertools.product([(0, 0), (1, 1), (1, 0)], cells, cells, cells):
        if ring[0] != ring[-1]:
            expected = shapely_accepts(ring)
            accepted += expected
            assert accepts(ring) == expected, ring
    assert accepted > 300


@given(st.data())
def test_acceptance_is_shapelys_with_holes(data: st.DataObject) -> None:
    outline = [(0, 0), (9, 0), (9, 9), (6, 9), (5, 4), (4, 9), (0, 9)]
    triangles = st.lists(grid(9), min_size=3, max_size=4, unique=True)
    holes = data.draw(st.lists(triangles, min_size=1, max_size=3))
    assert accepts(outline, holes) == shapely_accepts(outline, holes)


@given(st.integers(0, 10**6), st.integers(4, 9), st.data())
def test_acceptance_is_exact_one_ulp_around_touching(
    seed: int, n: int, data: st.DataObject
) -> None:
    """Put a vertex on an edge as well as doubles can, or one unit beside, and compare."""
    ring = [(float(x), float(y)) for x, y in star_polygon(n, seed).exterior]
    k = data.draw(st.integers(0, n - 1))
    i = data.draw(st.integers(0, n - 1))
    f = data.draw(st.sampled_from([0.0, 0.25, 1 / 3, 0.5, 0.9]))
    (ax, ay), (bx, by) = ring[i], ring[(i + 1) % n]
    y = ay + f * (by - ay)
    ring[k] = (
        ax + f * (bx - ax),
        data.draw(st.sampled_from([y, np.nextafter(y, 9), np.nextafter(y, -9)])),
    )
    assume(ring[0] != ring[-1])
    assert accepts(ring) == brute_force_is_simple([ring])


@given(st.integers(0, 10**6), st.integers(3, 40), st.integers(0, 1), st.integers(0, 39))
def test_stars_are_accepted_whichever_way_they_are_given(
    seed: int, n: int, reverse: int, turn: int
) -> None:
    ring = np.roll(star_polygon(n, seed).exterior, turn, axis=0)[:: 1 - 2 * reverse]
    assert accepts(ring)
    assert accepts(np.concatenate([ring, ring[:1]]))


def test_swapping_two_vertices_of_a_convex_polygon_is_always_refused() -> None:
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for i, j in itertools.combinations(range(12), 2):
        swapped = ring.copy()
        swapped[[i, j]] = ring[[j, i]]
        with pytest.raises(PolygonError, match="crosses"):
            Polygon(swapped)


def test_many_edges_validate_fast() -> None:
    """Also the hard way: a comb turned by 45 degrees, whose bounding boxes overlap throughout."""
    star = star_polygon(400, 1).exterior
    x = np.arange(200)
    comb = np.stack([np.repeat(x, 2), np.tile([0, 150, 150, 0], 100)], axis=1)
    comb = np.concatenate([comb, [[199, -1], [0, -1]]]) @ np.array([[1, 1], [-1, 1]])
    for ring in (star, comb):
        seconds = []
        for _ in range(5):
            start = time.perf_counter()
            Polygon(ring)
            seconds.append(time.perf_counter() - start)
        assert min(seconds) < 0.1


def test_the_float_filter_decides_nearly_everything(corpus: list[Polygon]) -> None:
    """Exact arithmetic on all pairs would be far too slow; it is left a handful."""
    left = sum(len(list(_Edges(p.rings, "").meeting_candidates())) for p in corpus)
    assert left < 1000


def test_edge_pairs_are_found_in_every_block(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("regrasp_lp.ring_checks._BLOCK", 7)
    ring = star_polygon(9, 4).exterior.copy()
    check_rings([ring], "polygon")
    ring[[2, 7]] = ring[[7, 2]]
    with pytest.raises(PolygonError, match="crosses"):
        check_rings([ring], "polygon")


# --- what is stored -----------------------------------------------------------------------------


def test_clockwise_outline_and_counter_clockwise_hole_are_reversed() -> None:
    polygon = Polygon(SQUARE[::-1], [HOLE, shifted(HOLE, 4, 4)[::-1]])
    assert polygon.exterior.tolist() == [[0, 10], [0, 0], [10, 0], [10, 10]]
    assert polygon.holes[0].tolist() == [[2, 2], [2, 4], [4, 4], [4, 2]]
    assert polygon.holes[1].tolist() == [[6, 8], [8, 8], [8, 6], [6, 6]]
    assert polygon.input_edge.tolist() == [3, 2, 1, 0, 7, 6, 5, 4, 8, 9, 10, 11]
    assert polygon.next_edge.tolist() == [1, 2, 3, 0, 5, 6, 7, 4, 9, 10, 11, 8]
    assert polygon.ring_of_edge.tolist() == [0] * 4 + [1] * 4 + [2] * 4


@given(st.integers(0, 10**6), st.integers(3, 12), st.integers(0, 11), st.booleans())
def test_input_edges_are_the_same_segments(seed: int, n: int, turn: int, reverse: bool) -> None:
    outline = np.roll(star_polygon(n, seed).exterior, turn, axis=0)
    hole = 0.01 * star_polygon(n, seed + 1).exterior
    given_rings = [ring[::-1] if reverse else ring for ring in (outline, hole)]
    polygon = Polygon(given_rings[0], [given_rings[1]])
    starts = np.concatenate(given_rings)
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in given_rings])
    for r, ring in enumerate(polygon.rings):
        assert (ring[0] == given_rings[r][0]).all()
    for i, k in enumerate(polygon.input_edge.tolist()):
        segment = {tuple(starts[k]), tuple(ends[k])}
        assert segment == {tuple(polygon.edge_starts[i]), tuple(polygon.edge_ends[i])}
    assert sorted(polygon.input_edge.tolist()) == list(range(2 * n))
    assert (polygon.edge_ends == polygon.edge_starts[polygon.next_edge]).all()
    # turning back what is stored changes nothing
    again = Polygon(polygon.exterior, polygon.holes)
    assert again == polygon
    assert again.input_edge.tolist() == list(range(2 * n))


def test_derived_quantities_of_a_wedge() -> None:
    wedge = Polygon([(0, 0), (4, 0), (4, 3)], name="wedge")
    assert wedge.n_edges == 3
    assert wedge.edge_lengths.tolist() == [4, 3, 5]
    assert wedge.edge_vectors.tolist() == [[4, 0], [0, 3], [-4, -3]]
    assert np.allclose(wedge.tangents, [[1, 0], [0, 1], [-0.8, -0.6]])
    assert np.allclose(wedge.normals, [[0, 1], [-1, 0], [0.6, -0.8]])
    assert wedge.bounds.tolist() == [0, 0, 4, 3]
    assert wedge.diameter == 5
    assert wedge.area == 6
    assert np.allclose(wedge.centroid, [8 / 3, 1])
    assert wedge.holes == ()
    assert wedge.edge_starts.tolist() == wedge.vertices.tolist() == wedge.exterior.tolist()


def test_normals_point_inward(corpus: list[Polygon]) -> None:
    for polygon in corpus:
        solid = shapely.Polygon(polygon.exterior, polygon.holes)
        step = 1e-9 * polygon.diameter
        inside = polygon.points(np.arange(polygon.n_edges), 0.5) + step * polygon.normals
        long_enough = polygon.edge_lengths > 1e3 * step
        assert shapely.contains_xy(solid, *inside[long_enough].T).all(), polygon.name


def test_area_and_centroid_are_shapelys(corpus: list[Polygon]) -> None:
    for polygon in corpus:
        solid = shapely.Polygon(polygon.exterior, polygon.holes)
        assert polygon.area == pytest.approx(solid.area, rel=1e-9)
        centre = [solid.centroid.x, solid.centroid.y]
        assert np.allclose(polygon.centroid, centre, rtol=0, atol=1e-9 * polygon.diameter)
        assert polygon.bounds.tolist() == list(solid.bounds)


def test_area_far_from_the_origin_is_exact() -> None:
    offset = 2.0**40
    polygon = Polygon(shifted([(0, 0), (3, 0), (3, 3)], offset, offset))
    assert polygon.area == 4.5
    assert polygon.centroid.tolist() == [offset + 2, offset + 1]


def test_corpus_is_accepted_whole(corpus: list[Polygon]) -> None:
    assert len(corpus) == 195
    assert len({polygon.name for polygon in corpus}) == 195
    assert sum(bool(polygon.holes) for polygon in corpus) == 33
    assert {min(p.n_edges for p in corpus), max(p.n_edges for p in corpus)} == {3, 396}
    for polygon in corpus:  # the corpus is oriented as we store polygons
        assert polygon.input_edge.tolist() == list(range(polygon.n_edges))


def test_corpus_with_a_vertex_put_on_another_edge_is_refused(corpus: list[Polygon]) -> None:
    rng = np.random.default_rng(5)
    for polygon in corpus:
        outline = polygon.exterior.copy()
        n = len(outline)
        if n < 5:
            continue
        k = int(rng.integers(n))
        outline[k] = outline[(k + 2) % n]
        with pytest.raises(PolygonError):
            Polygon(outline, polygon.holes)


@pytest.mark.parametrize(
    "make",
    [
        list,
        tuple,
        iter,
        np.array,
        lambda ring: np.array(ring, dtype=np.float32),
        lambda ring: np.array(ring, dtype=object),
        lambda ring: [list(p) for p in ring],
        lambda ring: [np.array(p) for p in ring],
        lambda ring: [(Fraction(x), np.int8(y)) for x, y in ring],
        lambda ring: [*ring, ring[0]],
        lambda ring: np.array([*ring, ring[0]]),
        lambda ring: shapely.LinearRing(ring),
        lambda ring: shapely.LinearRing(ring).coords,
        lambda ring: [(-0.0 if x == 0 else x, y) for x, y in ring],
    ],
)
def test_every_way_to_give_a_ring_makes_the_same_polygon(make: Any) -> None:
    polygon = Polygon(make(SQUARE), [make(HOLE)], "plate")
    assert polygon == Polygon(SQUARE, [HOLE], "plate")
    assert hash(polygon) == hash(Polygon(SQUARE, [HOLE], "plate"))


def test_shapely_polygons_are_taken_whole() -> None:
    assert Polygon(shapely.Polygon(SQUARE, [HOLE]), name="x") == Polygon(SQUARE, [HOLE], "x")


def test_shapely_is_not_imported() -> None:
    code = "import sys, regrasp_lp.files as f; assert 'shapely' not in sys.modules, 'imported'"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_polygons_differ_by_coordinates_and_name() -> None:
    polygon = Polygon(SQUARE)
    assert polygon != Polygon(SQUARE, name="named")
    assert polygon != Polygon(SQUARE, [HOLE])
    assert polygon != Polygon([*SQUARE[1:], SQUARE[0]])
    assert polygon != SQUARE
    assert len({polygon, Polygon(SQUARE)}) == 1


def test_polygons_are_frozen() -> None:
    source = np.array(SQUARE, dtype=float)
    polygon = Polygon(source, [HOLE])
    source[0] = 99
    assert polygon.vertices[0].tolist() == [0, 0]
    with pytest.raises(dataclasses.FrozenInstanceError):
        polygon.name = "other"  # type: ignore[misc]
    for other in (polygon, pickle.loads(pickle.dumps(polygon)), copy.deepcopy(polygon)):
        assert other == polygon
        arrays = [getattr(other, f.name) for f in dataclasses.fields(other)]
        arrays = [a for a in arrays if isinstance(a, np.ndarray)]
        arrays += [*other.rings, other.bounds, other.centroid]
        assert len(arrays) == 14
        for array in arrays:
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1


def test_repr_is_short() -> None:
    assert repr(Polygon(SQUARE)) == "<Polygon: 4 edges>"
    assert repr(Polygon(SQUARE, [HOLE], "plate")) == "<Polygon 'plate': 8 edges, 1 hole>"
    two = Polygon(SQUARE, [HOLE, shifted(HOLE, 4, 4)])
    assert repr(two) == "<Polygon: 12 edges, 2 holes>"


def test_plot_delegates(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = types.ModuleType("regrasp_lp.plotting")
    fake.plot_polygon = lambda polygon, ax: (polygon, ax)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "regrasp_lp.plotting", fake)
    polygon = Polygon(SQUARE)
    assert polygon.plot("axes") == (polygon, "axes")


# --- points and contacts ------------------------------------------------------------------------


def test_points_meet_both_ends_exactly(corpus: list[Polygon]) -> None:
    for polygon in corpus:
        edges = np.arange(polygon.n_edges)
        assert (polygon.points(edges, 0) == polygon.edge_starts).all()
        assert (polygon.points(edges, 1.0) == polygon.edge_ends).all()


@given(st.integers(0, 10**6), st.floats(0, 1))
def test_points_are_the_rational_ones_rounded(seed: int, f: float) -> None:
    polygon = star_polygon(5, seed)
    for edge, point in enumerate(polygon.points(np.arange(5), f)):
        for a, b, x in zip(polygon.edge_starts[edge], polygon.edge_ends[edge], point, strict=True):
            exact = Fraction(a) + Fraction(f) * (Fraction(b) - Fraction(a))
            assert abs(Fraction(x) - exact) <= 4e-16


def test_points_broadcast() -> None:
    polygon = Polygon(SQUARE)
    assert polygon.points(0, 0.5).shape == (2,)
    assert polygon.points([], []).shape == (0, 2)
    assert polygon.points([[0], [1]], [0.1, 0.2, 0.3]).shape == (2, 3, 2)
    assert polygon.points([[0], [1]], [0.1, 0.2, 0.3])[1, 2].tolist() == [10, 3]
    assert polygon.point(Contact(0, 2.0)).tolist() == [2, 0]
    assert polygon.point((1, 10)).tolist() == [10, 10]
    assert polygon.points(0, 1 + 1e-13).tolist() == [10, 0]


@pytest.mark.parametrize(
    ("edges", "fractions", "message"),
    [
        ([0, 4], 0.5, "no edge 4 on the polygon: its 4 edges are numbered 0 to 3"),
        ([-1], 0.5, "no edge -1"),
        ([0.0], 0.5, "edges are integers"),
        ([True], 0.5, "edges are integers"),
        (0, 1.1, "not 1.1"),
        (0, [0.5, -1e-11], "not -1e-11"),
        (0, math.nan, "not nan"),
    ],
)
def test_points_off_the_polygon_are_refused(edges: Any, fractions: Any, message: str) -> None:
    with pytest.raises(ContactError, match=message):
        Polygon(SQUARE).points(edges, fractions)


def test_resolve_fills_in_both_places() -> None:
    wedge = Polygon([(0, 0), (4, 0), (4, 3)], name="wedge")
    grasp = wedge.resolve(Grasp([(0, 1.0), Contact.at_fraction(1, 0.5), Contact(2, 99.0, 0.1)]))
    assert grasp.fractions.tolist() == [0.25, 0.5, 0.1]
    assert grasp.positions.tolist() == [1.0, 1.5, 0.5]
    assert wedge.resolve(grasp) == grasp
    assert wedge.resolve([(0, 1.0)]) == Grasp([Contact(0, 1.0, 0.25)])


@pytest.mark.parametrize("position", [-1e-12, -0.0, 0.0, 4e-12, 4.0, 4 + 3e-12, 4 - 3e-12])
def test_positions_near_an_end_snap_to_it(position: float) -> None:
    wedge = Polygon([(0, 0), (4, 0), (4, 3)])
    contact = wedge.resolve_contact(Contact(0, position * (1 - 1e-3 * (position < 1))))
    assert contact.fraction == round(position / 4)
    assert contact.position == 4 * round(position / 4)


@pytest.mark.parametrize("position", [4.1, 4 + 5e-12, -5e-12, -1, 1e300])
def test_positions_off_the_edge_say_its_length(position: float) -> None:
    wedge = Polygon([(0, 0), (4, 0), (4, 3)], name="wedge")
    message = f"position {re.escape(repr(float(position)))} is not on edge 0 of polygon 'wedge': "
    with pytest.raises(ContactError, match=message + r"the edge is 4\.0 long"):
        wedge.resolve(Grasp([(0, position)]))


def test_contacts_on_no_edge_are_refused() -> None:
    with pytest.raises(ContactError, match="no edge 3 on polygon 'w': its 3 edges"):
        Polygon([(0, 0), (4, 0), (4, 3)], name="w").resolve(Grasp([(3, 0.5)]))


@pytest.mark.parametrize("pair", [(True, 0.5), (0, True), (0.0, 0.5), (0, math.nan), ("0", 0.5)])
def test_resolve_refuses_what_is_no_contact(pair: Any) -> None:
    with pytest.raises(ContactError):
        Polygon(SQUARE).resolve([pair])


@given(st.integers(0, 10**6), st.integers(3, 20), st.floats(0, 1))
def test_positions_and_fractions_round_trip(seed: int, n: int, f: float) -> None:
    polygon = star_polygon(n, seed)
    by_fraction = polygon.resolve(Grasp.at_fractions([(n - 1, f)]))
    by_position = polygon.resolve(Grasp([(n - 1, float(by_fraction.positions[0]))]))
    assert by_position.fractions[0] == pytest.approx(by_fraction.fractions[0], abs=1e-12)


# --- snapping -----------------------------------------------------------------------------------


def test_snapping_undoes_points(corpus: list[Polygon]) -> None:
    rng = np.random.default_rng(3)
    for polygon in corpus:
        edges = rng.integers(polygon.n_edges, size=20)
        fractions = rng.uniform(0.01, 0.99, 20)
        tolerance = 1e-12 * float(np.abs(polygon.bounds).max())
        grasp = polygon.snap(polygon.points(edges, fractions), tolerance)
        length = polygon.edge_lengths[edges]
        clear = length > 1e-6 * polygon.diameter
        assert (grasp.edges == edges)[clear].all(), polygon.name
        error = np.abs(grasp.fractions - fractions) * length
        assert error[clear].max() <= 1e-9 * polygon.diameter


def test_a_vertex_snaps_to_the_lower_edge(corpus: list[Polygon]) -> None:
    for polygon in corpus:
        if polygon.edge_lengths.min() < 1e-9 * polygon.diameter:
            continue
        grasp = polygon.snap(polygon.vertices)
        before = np.argsort(polygon.next_edge)  # the edge that ends where edge i starts
        own = np.arange(polygon.n_edges)
        assert (grasp.edges == np.minimum(own, before)).all()
        assert (grasp.fractions == (before < own)).all()


def test_snapping_is_to_the_nearest_point() -> None:
    polygon = Polygon(SQUARE, [HOLE], "plate")
    rng = np.random.default_rng(8)
    boundary = shapely.Polygon(SQUARE, [HOLE]).boundary
    points = rng.uniform(-3, 13, (50, 2))
    grasp = polygon.snap(points, tolerance=20)
    for point, contact in zip(points, grasp, strict=True):
        distance = float(np.linalg.norm(polygon.point(contact) - point))
        assert distance == pytest.approx(boundary.distance(shapely.Point(point)), abs=1e-12)


def test_far_points_are_refused_saying_how_far() -> None:
    polygon = Polygon(SQUARE, name="plate")
    message = r"point 1, \(10.5, 3\), is 0.5 from .* 'plate' \(nearest is edge 1\).* 1e-06"
    with pytest.raises(ContactError, match=message):
        polygon.snap([(5, 0), (10.5, 3)])
    assert polygon.snap([(10.5, 3)], tolerance=0.5) == polygon.resolve(Grasp([(1, 3)]))


@pytest.mark.parametrize(
    "points", ["abc", [1, 2], [(1, 2, 3)], [(1, 2), (1,)], [(True, False)], [(math.nan, 0)], None]
)
def test_snapping_what_is_no_point_is_refused(points: Any) -> None:
    with pytest.raises(ContactError, match="points to snap"):
        Polygon(SQUARE).snap(points)


@pytest.mark.parametrize("tolerance", [-1.0, math.nan, math.inf, True, "1", None])
def test_a_bad_tolerance_is_refused(tolerance: Any) -> None:
    with pytest.raises(ContactError, match="tolerance"):
        Polygon(SQUARE).snap([(5, 0)], tolerance)
