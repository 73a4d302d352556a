"""Corners of linear sets against every choice of rows, in rational numbers."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, pairwise, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from regrasp_lp.errors import OptionError
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.polytopes import corners

Rows = list[tuple[tuple[int, ...], int]]


def sets_of(
    rows: Rows, lower: tuple[float, ...], upper: tuple[float, ...], scale: float = 1.0
) -> LinearSets:
    n = len(lower)
    return LinearSets(
        tuple("xyz"[:n]),
        np.array([r for r, _ in rows], dtype=float).reshape(1, len(rows), n),
        np.ones((1, len(rows))),
        scale * np.array([[b for _, b in rows]], dtype=float).reshape(1, len(rows)),
        scale * np.array([lower], dtype=float),
        scale * np.array([upper], dtype=float),
    )


def with_box(rows: Rows, lower: tuple[int, ...], upper: tuple[int, ...]) -> Rows:
    n = len(lower)
    unit = [tuple(int(i == j) for j in range(n)) for i in range(n)]
    return [
        *rows,
        *((e, u) for e, u in zip(unit, upper, strict=True)),
        *((tuple(-v for v in e), -low) for e, low in zip(unit, lower, strict=True)),
    ]


def determinant(m: list[list[Fraction]]) -> Fraction:
    total = Fraction(0)
    for order in permutations(range(len(m))):
        inversions = sum(a > b for a, b in combinations(order, 2))
        product = Fraction(-1 if inversions % 2 else 1)
        for i, j in enumerate(order):
            product *= m[i][j]
        total += product
    return total


def vertices_of(rows: Rows, n: int) -> set[tuple[Fraction, ...]]:
    """Solutions of n rows as equations (Cramer) that satisfy all others."""
    found = set()
    for chosen in combinations(rows, n):
        matrix = [[Fraction(v) for v in r] for r, _ in chosen]
        det = determinant(matrix)
        if det == 0:
            continue
        point = []
        for i in range(n):
            swapped = [
                [*m[:i], Fraction(b), *m[i + 1 :]] for m, (_, b) in zip(matrix, chosen, strict=True)
            ]
            point.append(determinant(swapped) / det)
        if all(sum(a * x for a, x in zip(r, point, strict=True)) <= b for r, b in rows):
            found.add(tuple(point))
    return found


def has_interior(points: set[tuple[Fraction, ...]], n: int) -> bool:
    """Whether some n + 1 of the points are not in a hyperplane."""
    if len(points) <= n:
        return False
    first, *others = sorted(points)
    vectors = [[a - b for a, b in zip(p, first, strict=True)] for p in others]
    return any(determinant(list(chosen)) != 0 for chosen in combinations(vectors, n))


def assert_same_points(found: np.ndarray, expected: set[tuple[Fraction, ...]]) -> None:
    """One found point to an expected one."""
    exact = np.array([[float(v) for v in p] for p in sorted(expected)])
    gaps = np.abs(found[:, None, :] - exact[None, :, :]).max(axis=2)
    assert gaps.min(axis=1).max() < 1e-9, "a point that is no corner"
    assert gaps.min(axis=0).max() < 1e-9, "a corner is missing"
    assert len(found) == len(exact), f"{len(found)} points for {len(exact)} corners"


def assert_counter_clockwise(points: np.ndarray) -> None:
    assert area(points) > 0
    following = np.roll(points, -1, axis=0)
    ahead = np.roll(points, -2, axis=0)
    first, second = following - points, ahead - following
    assert (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] > -1e-12).all()


def area(points: np.ndarray) -> float:
    x, y = points.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def rows_over(n: int) -> st.SearchStrategy[Rows]:
    coefficient = st.integers(-3, 3)
    row = st.tuples(st.tuples(*[coefficient] * n), st.integers(0, 6))
    return st.lists(row.filter(lambda r: any(r[0])), max_size=5)


@settings(max_examples=100)
@given(rows_over(2))
def test_corners_in_the_plane(rows: Rows) -> None:
    lower, upper = (-1, -1), (2, 3)
    expected = vertices_of(with_box(rows, lower, upper), 2)
    (found,) = corners(sets_of(rows, lower, upper))
    if not has_interior(expected, 2):
        assert found.shape == (0, 2)
        return
    assert_same_points(found, expected)
    assert_counter_clockwise(found)


@settings(max_examples=50)
@given(rows_over(3))
def test_corners_in_space(rows: Rows) -> None:
    lower, upper = (-1, 0, -2), (1, 2, 1)
    expected = vertices_of(with_box(rows, lower, upper), 3)
    (found,) = corners(sets_of(rows, lower, upper))
    if not has_interior(expected, 3):
        assert found.shape == (0, 3)
        return
    assert_same_points(found, expected)


CUBE = ((0, 0, 0), (1, 1, 1))
KNOWN = {
    "cube": ([], 8, 1.0),
    "corner of the cube": ([((1, 1, 1), 1)], 4, 1 / 6),
    "cube without a corner": ([((1, 1, 1), 2)], 7, 5 / 6),
    "prism": ([((1, 1, 0), 1)], 6, 1 / 2),
    "pyramid": ([((-2, 0, 1), 0), ((2, 0, 1), 2), ((0, -2, 1), 0), ((0, 2, 1), 2)], 5, 1 / 3),
    "slab of the cube": ([((1, 1, 1), 2), ((-1, -1, -1), -1)], 6, 2 / 3),
    "face given twice": ([((1, 1, 1), 1), ((2, 2, 2), 2), ((1, 0, 0), 1)], 4, 1 / 6),
    "rows through a corner": ([((1, 2, 0), 3), ((2, 1, 0), 3), ((1, 1, 1), 3)], 8, 1.0),
}


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("name", KNOWN)
def test_volumes(name: str, scale: float) -> None:
    rows, count, volume = KNOWN[name]
    (found,) = corners(sets_of(rows, *CUBE, scale))
    assert len(found) == count
    assert ConvexHull(found / scale).volume == pytest.approx(volume, rel=1e-9)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_scale_in_the_plane(scale: float) -> None:
    rows: Rows = [((1, 1), 5), ((-1, 2), 4), ((3, -1), 6)]
    (unit,) = corners(sets_of(rows, (0, 0), (3, 3)))
    (found,) = corners(sets_of(rows, (0, 0), (3, 3), scale))
    np.testing.assert_allclose(found, unit * scale, rtol=0, atol=1e-12 * scale)


def test_far_from_the_origin_and_in_a_long_box() -> None:
    for at, box in ((1e6, (1.0, 1.0)), (-1e5, (1e4, 1.0)), (0.0, (1e-3, 1e3))):
        lower = np.full(2, at)
        half = LinearSets(
            ("x", "y"),
            1 / np.array([[box]]),
            np.ones((1, 1)),
            np.array([[1 + (lower / box).sum()]]),
            lower[None],
            (lower + box)[None],
        )
        (found,) = corners(half)
        triangle = lower + np.array([[0, 0], [box[0], 0], [0, box[1]]])
        order = np.lexsort(triangle.T)
        np.testing.assert_allclose(
            found[np.lexsort(np.round(found, 6).T)], triangle[order], atol=1e-9 * max(1, abs(at))
        )


@pytest.mark.parametrize(
    ("rows", "lower", "upper"),
    [
        ([((1, 1), 0)], (0, 0), (1, 1)),  # a point
        ([((1, 0), 0)], (0, 0), (1, 1)),  # a side
        ([((1, 1), 1), ((-1, -1), -1)], (0, 0), (1, 1)),  # a segment
        ([((1, 1), -1)], (0, 0), (1, 1)),  # nothing
        ([((1, 0), 1), ((-1, 0), -2)], (0, 0), (3, 1)),  # nothing between two lines
        ([((1, 1, 1), 0)], *CUBE),
        ([((1, 1, 0), 1), ((-1, -1, 0), -1)], *CUBE),  # a rectangle in space
    ],
)
def test_what_has_no_interior_has_no_corners(rows: Rows, lower: tuple, upper: tuple) -> None:
    (found,) = corners(sets_of(rows, lower, upper))
    assert found.shape == (0, len(lower))


@pytest.mark.parametrize("n", [2, 3])
def test_a_flat_box_has_no_corners(n: int) -> None:
    (found,) = corners(sets_of([], (0,) * n, (1,) * (n - 1) + (0,)))
    assert found.shape == (0, n)


def test_a_row_of_nothing_that_nothing_satisfies() -> None:
    """As `LinearSets.restrict` leaves it where all coordinates of a row are fixed."""
    rows: Rows = [((0, 0), -1), ((1, 1), 1)]
    (found,) = corners(sets_of(rows, (0, 0), (1, 1)))
    assert found.shape == (0, 2)


def test_a_row_of_nothing_that_everything_satisfies() -> None:
    for bound in (0, 1):
        (found,) = corners(sets_of([((0, 0), bound), ((1, 1), 1)], (0, 0), (1, 1)))
        assert_same_points(found, {(Fraction(a), Fraction(b)) for a, b in ((0, 0), (1, 0), (0, 1))})


def test_stacks_keep_their_order() -> None:
    triangle, empty = (
        sets_of([((1, 1), 1)], (0, 0), (1, 1)),
        sets_of([((1, 1), -1)], (0, 0), (1, 1)),
    )
    stack = LinearSets(
        triangle.names,
        *(
            np.concatenate((getattr(triangle, f), getattr(empty, f), getattr(triangle, f)))
            for f in ("rows", "scales", "bounds", "lower", "upper")
        ),
    )
    assert [len(c) for c in corners(stack)] == [3, 0, 3]
    assert corners(stack.take(np.array([], dtype=int))) == []


def test_margins_and_scales_do_not_matter() -> None:
    one = sets_of([((1, 1), 1), ((3, -1), 2)], (0, 0), (1, 1))
    other = LinearSets(one.names, one.rows, one.scales * 0, one.bounds, one.lower, one.upper)
    np.testing.assert_array_equal(corners(one)[0], corners(other)[0])
    thick = LinearSets(one.names, one.rows * 8, one.scales, one.bounds * 8, one.lower, one.upper)
    np.testing.assert_allclose(corners(one)[0], corners(thick)[0], atol=1e-12)


def test_thin_sets_lose_their_corners_only_below_the_stated_width() -> None:
    for width, count in ((1e-6, 4), (1e-8, 4), (1e-12, 0)):
        strip = sets_of([], (0, 0), (1, 1))
        strip = LinearSets(
            strip.names,
            np.array([[[1.0, -1.0], [-1.0, 1.0], [1.0, 0.0], [-1.0, 0.0]]]),
            np.ones((1, 4)),
            np.array([[width, width, 0.75, -0.25]]),
            strip.lower,
            strip.upper,
        )
        (found,) = corners(strip)
        assert len(found) == count
        if count:
            assert_counter_clockwise(found)
            assert area(found) == pytest.approx(2 * width * 0.5, rel=1e-6)


def test_a_long_chain_of_sides() -> None:
    angles = 2 * np.pi * np.arange(64) / 64
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    disc = LinearSets(
        ("x", "y"),
        normals[None],
        np.ones((1, 64)),
        np.ones((1, 64)),
        np.full((1, 2), -2.0),
        np.full((1, 2), 2.0),
    )
    (found,) = corners(disc)
    assert len(found) == 64
    assert_counter_clockwise(found)
    turned = np.unwrap(np.arctan2(found[:, 1], found[:, 0]))
    assert all(b > a for a, b in pairwise(turned.tolist()))
    assert area(found) == pytest.approx(64 * np.tan(np.pi / 64))


@pytest.mark.parametrize("shift", [0.0, 1.0, 1024.0])
def test_many_lines_through_one_corner(shift: float) -> None:
    """As in a focus cell: the cones of two edges with a common vertex all start there."""
    rng = np.random.default_rng(0)
    for count in range(2, 7):
        for _ in range(10):
            angles = rng.uniform(0.1, np.pi / 2 - 0.1, count)
            normals = -np.stack([np.cos(angles), np.sin(angles)], axis=1)
            apex = np.array([shift + 1 / 3, shift + 0.1])
            wedge = LinearSets(
                ("x", "y"),
                normals[None],
                np.ones((1, count)),
                (normals @ apex)[None],
                apex[None] - 0.1,
                apex[None] + 2.0,
            )
            (found,) = corners(wedge)
            gaps = np.hypot(*(found - np.roll(found, 1, axis=0)).T)
            assert gaps.min() > 1e-9
            assert len(found) == 6


def test_unbounded_sets_are_refused() -> None:
    far = np.full((1, 2), np.inf)
    half = LinearSets(("x", "y"), np.ones((1, 1, 2)), np.ones((1, 1)), np.ones((1, 1)), -far, far)
    with pytest.raises(OptionError, match="bounded box"):
        corners(half)
