"""Friction cones: rays, exact signs and positive spanning, against rational numbers."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from fourier_motzkin import row, solvable
from geometry import (
    GENERAL,
    LATTICE,
    cross,
    dot,
    exact_ray,
    lattice_star,
    nearly_parallel,
    rectangle,
    regular,
    sign,
    star,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from regrasp_lp.errors import FrictionError
from regrasp_lp.friction import Cones, as_integers, per_edge_friction, rays_of, spanning
from regrasp_lp.polygon import Polygon

SHAPES = {**LATTICE, **GENERAL}


def assert_exact(cones: Cones) -> None:
    rays = [exact_ray(cones, r) for r in range(2 * cones.n_edges)]
    for r, e in enumerate(rays):
        for s, f in enumerate(rays):
            exact = cross(e, f)
            assert cones.cross_sign[r, s] == sign(exact)
            assert cones.opposite[r, s] == (exact == 0 and dot(e, f) < 0)
            value = Fraction(float(cones.cross[r, s]))
            smallest = Fraction(5e-324)
            assert abs(value - exact) <= max(abs(exact) * Fraction(1, 10**12), smallest)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("mu", [1e-3, 0.25, 1.0, 1.75, 1e4, None])
def test_cross_products_and_their_signs_are_those_of_the_rationals(name: str, mu: float) -> None:
    polygon = SHAPES[name]
    friction = [0.25, 1.0, 0.5, 2.0, 0.1] * polygon.n_edges
    assert_exact(Cones.of(polygon, friction[: polygon.n_edges] if mu is None else mu))


def test_nearly_parallel_rays_have_accurate_crosses() -> None:
    """Edges of length 1 whose directions differ by 1e-9 and less: the products cancel."""
    for step in (1e-6, 1e-9, 1e-12, 1e-15):
        points = [(0.1, 0.2), (1.1, 0.5), (1.3 + step, 1.7), (0.3, 1.4)]
        assert_exact(Cones.of(Polygon(points), 0.7))
        assert_exact(Cones.of(Polygon(points), [0.7, 0.4, 0.7 + step, 0.4 - step]))


@settings(max_examples=40)
@given(st.integers(4, 9), st.integers(0, 10**6), st.lists(st.sampled_from([0.25, 0.5, 1, 2, 4])))
def test_cross_products_on_lattice_stars(n: int, seed: int, mu: list[float]) -> None:
    friction = [*mu, *([1.0] * n)][:n]
    assert_exact(Cones.of(lattice_star(n, seed), friction))


@settings(max_examples=40)
@given(st.integers(0, 3), st.integers(0, 1), st.integers(-3, 3), st.sampled_from([0.5, 1.0, 3.0]))
def test_rays_that_differ_by_units_in_the_last_place(
    vertex: int, axis: int, steps: int, mu: float
) -> None:
    points = rectangle(1.0, 3.0).vertices.copy()
    for _ in range(abs(steps)):
        points[vertex, axis] = np.nextafter(points[vertex, axis], np.sign(steps) * np.inf)
    assert_exact(Cones.of(Polygon(points), mu))


@pytest.mark.parametrize("size", [1.0, 0.1, 1e-100])
@pytest.mark.parametrize("mu", [1e-3, 0.5, 1.0])
def test_signs_of_crosses_smaller_than_any_double(size: float, mu: float) -> None:
    points = rectangle(3 * size, size).vertices.copy()
    points[0, 1] = 5e-324
    cones = Cones.of(Polygon(points), mu)
    assert_exact(cones)
    # tilted by next to nothing, the lower side is not parallel to the upper one
    assert cones.cross_sign[0, 4] == cones.cross_sign[1, 5] != 0


def test_a_rectangle_at_friction_one_has_opposite_rays() -> None:
    """Each ray is opposite to one of the side across and to one of a neighbour."""
    assert Cones.of(rectangle(), 1.0).opposite.sum(axis=1).tolist() == [2] * 8
    assert Cones.of(rectangle(), 0.5).opposite.sum(axis=1).tolist() == [1] * 8
    # tilted by a rounding error, some are not
    assert Cones.of(nearly_parallel(), 1.0).opposite.sum() < 16


def test_rays_are_the_boundaries_of_cones_about_the_inward_normal() -> None:
    polygon, mu = star(8, 1), 0.4
    cones = Cones.of(polygon, mu)
    for edge in range(polygon.n_edges):
        clockwise, counter = cones.unit_rays[2 * edge : 2 * edge + 2]
        normal = polygon.normals[edge]
        for ray in (clockwise, counter):
            assert math.acos(ray @ normal) == pytest.approx(math.atan(mu))
        assert clockwise[0] * counter[1] - clockwise[1] * counter[0] > 0
    np.testing.assert_allclose(cones.sine, -cones.sine.T)
    np.testing.assert_allclose(np.hypot(*cones.unit_rays.T), 1.0)
    np.testing.assert_allclose(cones.lengths, polygon.edge_lengths)
    assert cones.size == pytest.approx(polygon.diameter)
    assert cones.local_starts.min(axis=0).tolist() == [0, 0]


def test_exact_rays_are_positive_multiples_of_the_rays() -> None:
    cones = Cones.of(star(7, 3), 0.3)
    for r, (x, y) in enumerate(cones.exact_rays):
        exact = exact_ray(cones, r)
        assert cross((Fraction(x), Fraction(y)), exact) == 0
        assert dot((Fraction(x), Fraction(y)), exact) > 0
    ends = cones.exact_starts + cones.exact_vectors
    np.testing.assert_array_equal(ends, np.roll(cones.exact_starts, -1, axis=0))


def spans(cones: Cones, edges: list[int]) -> bool:
    """No y ≠ 0 has y · e >= 0 for all rays, by elimination."""
    rays = [exact_ray(cones, 2 * e + side) for e in edges for side in (0, 1)]
    half_planes = [row([0, -x, -y], strict=False) for x, y in rays]
    return not any(
        solvable([*half_planes, row([0, *y], strict=True)])
        for y in ((1, 0), (-1, 0), (0, 1), (0, -1))
    )


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("m", [1, 2, 3, 4])
def test_spanning_against_elimination(name: str, m: int) -> None:
    polygon = SHAPES[name]
    rng = np.random.default_rng(m)
    for mu in (0.5, 1.0, rng.choice([0.25, 1.0, 3.0], polygon.n_edges)):
        cones = Cones.of(polygon, mu)
        edges = rng.integers(0, polygon.n_edges, (20, m))
        assert spanning(cones, edges).tolist() == [spans(cones, e) for e in edges.tolist()]


def test_spanning_has_both_answers_at_the_boundary() -> None:
    edges = np.array([[0, 1], [0, 2], [2, 3], [1, 3]])
    assert spanning(Cones.of(rectangle(), 1.0), edges).tolist() == [False, True, False, True]
    above = Cones.of(rectangle(), float(np.nextafter(1.0, 2)))
    assert spanning(above, edges).tolist() == [True, True, True, True]
    assert spanning(above, np.zeros((0, 2), dtype=int)).shape == (0,)
    assert rays_of(np.array([[3, 0]])).tolist() == [[6, 7, 0, 1]]


def test_friction_per_edge() -> None:
    np.testing.assert_array_equal(per_edge_friction(0.2, 3), [0.2] * 3)
    np.testing.assert_array_equal(per_edge_friction([0.2], 3), [0.2] * 3)
    given_ = np.array([0.1, 0.2, 0.3])
    result = per_edge_friction(given_, 3)
    given_[0] = 9
    np.testing.assert_array_equal(result, [0.1, 0.2, 0.3])
    assert not result.flags.writeable
    assert per_edge_friction(np.float32(0.5), 2).dtype == np.float64
    assert per_edge_friction(1, 2).tolist() == [1.0, 1.0]


@pytest.mark.parametrize(
    ("friction", "message"),
    [
        (0.0, "positive finite number"),
        (-0.5, "positive finite number"),
        (math.inf, "positive finite number"),
        (math.nan, "positive finite number"),
        (2e6, "to 1e\\+06"),
        (1e-101, "from 1e-100"),
        ([0.1, 0.0, 0.2], "got 0.0 at edge 1"),
        ([0.1, 0.2, math.nan], "got nan at edge 2"),
        ([0.1, 0.2], r"one per edge \(3\), got shape \(2,\)"),
        ([[0.1, 0.2, 0.3]], r"got shape \(1, 3\)"),
        ([], r"got shape \(0,\)"),
        ("slippery", "must be a number"),
        (None, "must be"),
        ([0.1, [0.2], 0.3], "must be a number"),
        ({"mu": 1}, "must be a number"),
    ],
)
def test_bad_friction(friction: object, message: str) -> None:
    with pytest.raises(FrictionError, match=message):
        per_edge_friction(friction, 3)


def test_doubles_as_integers() -> None:
    values = np.array([[0.5, -0.75], [3.0, 1e-3]])
    integers, unit = as_integers(values)
    assert unit & (unit - 1) == 0
    for value, integer in zip(values.ravel().tolist(), integers.ravel(), strict=True):
        assert Fraction(integer, unit) == Fraction(value)
    assert as_integers(np.array([2.0]))[1] == 1


def test_a_regular_polygon_far_from_the_origin() -> None:
    assert_exact(Cones.of(Polygon(regular(6).vertices + np.array([1e8, -1e8])), 0.577))
