"""Directions, circuits and swept regions against rational numbers and Fourier-Motzkin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from fourier_motzkin import Row, row, solvable
from geometry import (
    GENERAL,
    LATTICE,
    cross,
    dot,
    exact_point,
    exact_ray,
    lattice_star,
    nearly_parallel,
    star,
    with_hole,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from regrasp_lp.circuits import circuits
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.candidates import two_finger_candidates
from regrasp_lp.grasp_sets.focus import in_object, two_finger_sweeps
from regrasp_lp.grasp_sets.sweeps import Sweeps, sides_of
from regrasp_lp.lp import get_solver, maximise_margins
from regrasp_lp.polygon import Polygon

HIGHS = get_solver("highs")
SHAPES = {**LATTICE, **GENERAL}
EIGHTHS = tuple(n / 8 for n in (1, 2, 3, 4, 6, 8, 10, 16))


def spread_friction(n: int, seed: int) -> np.ndarray:
    """A coefficient per edge, on a small grid: parallel rays of different cones are common."""
    return np.random.default_rng(seed).choice(EIGHTHS, n)


# --- directions ---------------------------------------------------------------------------------


def exact_line(cones: Cones, line: int) -> tuple[Fraction, Fraction]:
    """Direction ``3 i + j`` of ``cones.lines``: two rays and the edge."""
    edge, which = divmod(line, 3)
    if which < 2:
        return exact_ray(cones, 2 * edge + which)
    a, b = exact_point(cones, edge, Fraction(0)), exact_point(cones, edge, Fraction(1))
    return b[0] - a[0], b[1] - a[1]


def assert_crosses_are_exact(cones: Cones) -> None:
    lines = [exact_line(cones, k) for k in range(3 * cones.n_edges)]
    stated, values = cones.lines.cross_sign, cones.lines.cross
    for (i, p), (j, q) in combinations(enumerate(lines), 2):
        true = cross(p, q)
        assert stated[i, j] == -stated[j, i] == (true > 0) - (true < 0)
        assert abs(Fraction(float(values[i, j])) - true) <= Fraction(1, 10**10) * abs(true)
        assert values[j, i] == -values[i, j]
    assert not stated.diagonal().any()
    for i, (p, e) in enumerate(zip(lines, cones.lines.exact, strict=True)):
        e = tuple(Fraction(v) for v in e)
        assert cross(p, e) == 0
        assert dot(p, e) > 0
        error = cones.lines.values[i] - [float(v) for v in p]
        assert np.abs(error).max() <= 1e-14 * cones.lines.lengths[i]


@pytest.mark.parametrize("mu", [0.2, 1.0, "per edge"])
@pytest.mark.parametrize("name", SHAPES)
def test_cross_products_of_lines(name: str, mu: float | str) -> None:
    polygon = SHAPES[name]
    friction = spread_friction(polygon.n_edges, 1) if isinstance(mu, str) else mu
    assert_crosses_are_exact(Cones.of(polygon, friction))


@pytest.mark.parametrize("mu", [1e-100, 1e-9, 1e6, 1.0, np.nextafter(1.0, 2)])
@pytest.mark.parametrize(
    "polygon",
    [
        nearly_parallel(),
        LATTICE["hexagon"],
        LATTICE["rectangle"],
        Polygon(LATTICE["hexagon"].vertices * 2.0**-300),
        Polygon(LATTICE["hexagon"].vertices * 2.0**300),
        Polygon([(0, 0), (1, 0), (1 + 2.0**-40, 2.0**-40), (0.5, 1)]),
    ],
    ids=["nearly parallel", "45 degrees", "rectangle", "tiny", "huge", "short edge"],
)
def test_cross_products_at_the_limits(polygon: Polygon, mu: float) -> None:
    cones = Cones.of(polygon, mu)
    lines = [exact_line(cones, k) for k in range(3 * cones.n_edges)]
    true = np.array([[(c > 0) - (c < 0) for c in (cross(p, q) for q in lines)] for p in lines])
    np.testing.assert_array_equal(cones.lines.cross_sign, true)


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), of_friction=st.integers(0, 10**6))
def test_cross_products_of_random_lattice_polygons(seed: int, of_friction: int) -> None:
    polygon = lattice_star(6, seed, 3)
    assert_crosses_are_exact(Cones.of(polygon, spread_friction(6, of_friction)))


def test_rays_are_the_same_in_both_numberings() -> None:
    cones = Cones.of(star(9, 2), spread_friction(9, 3))
    rays = np.arange(18)
    lines = 3 * (rays // 2) + rays % 2
    for name in ("values", "units", "lengths", "exact"):
        np.testing.assert_array_equal(
            getattr(cones.boundary, name), getattr(cones.lines, name)[lines]
        )
    np.testing.assert_array_equal(cones.cross, cones.lines.cross[np.ix_(lines, lines)])
    np.testing.assert_array_equal(cones.sine, cones.lines.sine[np.ix_(lines, lines)])
    np.testing.assert_allclose(np.hypot(*cones.lines.units.T), 1, rtol=1e-15)


# --- circuits -----------------------------------------------------------------------------------


def minimal_dependencies(directions: Sequence[tuple[int, int]]) -> set[frozenset[int]]:
    """Minimal subsets with ``Σ w d = 0``, w > 0, by elimination: nothing about turns."""
    found: list[frozenset[int]] = []
    for size in (2, 3):
        for chosen in combinations(range(len(directions)), size):
            if any(old <= set(chosen) for old in found):
                continue
            unit = [[0] * size for _ in range(size)]
            for i in range(size):
                unit[i][i] = -1
            rows = [row([0, *u], strict=True) for u in unit]
            for axis in (0, 1):
                values = [directions[c][axis] for c in chosen]
                rows += [row([0, *(s * v for v in values)], strict=False) for s in (1, -1)]
            if solvable(rows):
                found.append(frozenset(chosen))
    return set(found)


@settings(max_examples=40)
@given(
    st.lists(
        st.lists(
            st.tuples(st.integers(-2, 2), st.integers(-2, 2)).filter(any), min_size=6, max_size=6
        ),
        min_size=1,
        max_size=4,
    )
)
def test_circuits_are_the_minimal_dependencies(stacks: list[list[tuple[int, int]]]) -> None:
    d = np.array(stacks)
    turn = np.sign(d[:, :, None, 0] * d[:, None, :, 1] - d[:, :, None, 1] * d[:, None, :, 0])
    opposite = (turn == 0) & (np.einsum("nix,njx->nij", d, d) < 0)
    members = circuits(turn.astype(np.int8), opposite)
    for directions, stated in zip(stacks, members.tolist(), strict=True):
        got = [frozenset(m for m in circuit if m >= 0) for circuit in stated if max(circuit) >= 0]
        assert len(got) == len(set(got))
        assert set(got) == minimal_dependencies(directions)
        for circuit in stated:
            assert circuit == sorted(circuit, key=lambda m: (m < 0, m))
    assert members.shape[1] == max(1, *(len(minimal_dependencies(s)) for s in stacks))


def test_no_circuit_is_a_row_of_nothing() -> None:
    none = np.zeros((2, 3, 3), dtype=np.int8)
    np.testing.assert_array_equal(circuits(none, none.astype(bool)), np.full((2, 1, 3), -1))


# --- regions: an oracle in q and the contacts themselves ----------------------------------------


@cache
def seen_by_some_contact(cones: Cones, edge: int, side: int, rays: tuple) -> tuple:
    """Rows over ``(x, y, f)``: q is in the cone of side ``side`` at fraction f of the edge."""
    a, b = exact_point(cones, edge, Fraction(0)), exact_point(cones, edge, Fraction(1))
    t = b[0] - a[0], b[1] - a[1]
    rows = []
    for d, s in zip(rays, (-side, side), strict=True):
        # s (q - a - f t) × d > 0
        rows.append([s * cross(a, d), -s * d[1], s * d[0], s * cross(t, d)])
    return tuple(rows)


def region_rows(cones: Cones, region: int, place: int, n: int, *, strict: bool) -> list[Row]:
    """Rows over (x, y, f_0 … f_{n-1}) of region number `region` of `Sweeps.of_cones`."""
    edge, side = region // 2, 1 - 2 * (region % 2)
    rays = exact_ray(cones, 2 * edge), exact_ray(cones, 2 * edge + 1)
    return _placed(seen_by_some_contact(cones, edge, side, rays), place, n, strict)


def _placed(rows: Sequence[Sequence[Fraction]], place: int, n: int, strict: bool) -> list[Row]:
    result = []
    for constant, x, y, f in rows:
        wide = [constant, x, y, *([0] * n)]
        wide[3 + place] = f
        result.append(row(wide, strict=strict))
    unit = [0] * (3 + n)
    unit[3 + place] = 1
    low, high = [-v for v in unit], list(unit)
    high[0] = -1
    return [*result, row(low, strict=False), row(high, strict=False)]


def eliminated(cones: Cones, regions: Sequence[int], *, strict: bool = True) -> bool:
    n = len(regions)
    rows = [
        r
        for place, region in enumerate(regions)
        for r in region_rows(cones, int(region), place, n, strict=strict)
    ]
    return solvable(rows)


CASES = [
    *((polygon, mu) for polygon in LATTICE.values() for mu in (0.25, 0.5, 1.0, 2.0)),
    *((polygon, "per edge") for polygon in LATTICE.values()),
    *((polygon, mu) for polygon in GENERAL.values() for mu in (0.2, 0.9)),
]


@pytest.mark.parametrize("r", [2, 3, 4])
def test_meeting_regions_have_a_point_by_elimination(r: int) -> None:
    """Open sets; many of the lattice's closed ones touch along a line or in a point only."""
    rng = np.random.default_rng(r)
    answers, touching = [], 0
    for polygon, mu in CASES:
        friction = spread_friction(polygon.n_edges, r) if isinstance(mu, str) else mu
        cones = Cones.of(polygon, friction)
        sweeps = Sweeps.of_cones(cones)
        chosen = rng.integers(0, len(sweeps), ({2: 14, 3: 8, 4: 3}[r], r))
        for regions, stated in zip(chosen, sweeps.meet(chosen).tolist(), strict=True):
            assert stated == eliminated(cones, regions), (polygon, friction, regions)
            answers.append(stated)
            if not stated and r < 4 and len(answers) % 3 == 0:
                touching += eliminated(cones, regions, strict=False)
    assert 0.1 < np.mean(answers) < 0.9
    if r < 4:
        assert touching > 10


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), of_friction=st.integers(0, 10**6))
def test_three_regions_of_random_lattice_polygons(seed: int, of_friction: int) -> None:
    polygon = lattice_star(6, seed, 3)
    cones = Cones.of(polygon, spread_friction(6, of_friction))
    sweeps = Sweeps.of_cones(cones)
    chosen = np.random.default_rng(seed).integers(0, len(sweeps), (8, 3))
    stated = sweeps.meet(chosen).tolist()
    assert stated == [eliminated(cones, regions) for regions in chosen]


def two_finger_rows(cones: Cones, pair: Sequence[int], end: int, side: int) -> list[list[Fraction]]:
    """Rows over ``(x, y, f)``: the contact at an end sees q through ``C_a ∩ -C_b`` or its negative.

    ``E_a ⊕ s C`` for end 0, ``E_b ⊕ -s C`` for end 1.
    """
    rows: list[list[Fraction]] = []
    for other, edge in enumerate(pair):
        sign = side if other == end else -side
        rays = exact_ray(cones, 2 * edge), exact_ray(cones, 2 * edge + 1)
        rows += seen_by_some_contact(cones, pair[end], sign, rays)
    return rows


def pair_meets_elsewhere(cones: Cones, pair: Sequence[int], side: int, third: int) -> bool:
    """Whether the cell of a pair on one side and a region of a friction cone meet."""
    rows = [
        r for end in (0, 1) for r in _placed(two_finger_rows(cones, pair, end, side), end, 3, True)
    ]
    return solvable(rows + region_rows(cones, third, 2, 3, strict=True))


@pytest.mark.parametrize("mu", [0.25, 0.5, 1.0, 2.0, "per edge"])
def test_regions_of_narrower_cones(mu: float | str) -> None:
    answers = []
    rng = np.random.default_rng(3)
    for polygon in LATTICE.values():
        friction = spread_friction(polygon.n_edges, 5) if isinstance(mu, str) else mu
        cones = Cones.of(polygon, friction)
        pairs = two_finger_candidates(cones)
        if not len(pairs):
            continue
        both = Sweeps.of_cones(cones).join(two_finger_sweeps(cones, pairs))
        assert len(both) == 2 * cones.n_edges + 4 * len(pairs)
        for number in rng.integers(0, len(pairs), 3).tolist():
            for k, side in enumerate((1, -1)):
                third = int(rng.integers(0, 2 * cones.n_edges))
                first = 2 * cones.n_edges + 4 * number + k
                stated = both.meet(np.array([[first, first + 2, third]]))[0]
                assert stated == pair_meets_elsewhere(cones, pairs[number].tolist(), side, third)
                answers.append(stated)
    assert set(answers) == {True, False}


def test_a_region_is_what_the_contacts_of_its_edge_see() -> None:
    """Signed distances of the three lines against the cone at the best of all contacts."""
    for polygon, mu in ((star(7, 0), 0.3), (LATTICE["ell"], 1.0), (star(5, 2), 3.0)):
        cones = Cones.of(polygon, mu)
        sweeps = Sweeps.of_cones(cones)
        points = np.random.default_rng(0).uniform(-3, 5, (300, 2))
        sets = in_object(cones, sweeps.linear_sets(np.arange(len(sweeps))[:, None]))
        at = np.linspace(0, 1, 2001)
        for region in range(len(sweeps)):
            edge, side = region // 2, 1 - 2 * (region % 2)
            p = cones.starts[edge] + at[:, None] * cones.vectors[edge]
            x, y = (side * (points[:, None, :] - p)).transpose(2, 0, 1)
            (ax, ay), (bx, by) = cones.unit_rays[2 * edge : 2 * edge + 2]
            seen = np.minimum(ax * y - ay * x, x * by - y * bx).max(axis=1)
            slack = sets.bounds[region] - points @ sets.rows[region].T
            inside = slack.min(axis=1)
            sure = np.abs(inside) > 0.01
            assert (inside[sure] > 0).any()
            np.testing.assert_array_equal(inside[sure] > 0, seen[sure] > 0)


def test_rows_of_linear_sets_are_distances_to_the_lines() -> None:
    cones = Cones.of(with_hole(), 0.5)
    sweeps = Sweeps.of_cones(cones)
    sets = sweeps.linear_sets(np.array([[0, 4, 9], [1, 5, 14]]))
    assert sets.names == ("x", "y")
    assert sets.rows.shape == (2, 9, 2)
    np.testing.assert_allclose(np.hypot(*np.moveaxis(sets.rows, 2, 0)), 1)
    # region 0 is above edge 0, y = 0: its third line
    assert sets.rows[0, 2] @ [0.0, 1.0] == -1
    assert sets.bounds[0, 2] == 0


@pytest.mark.parametrize("mu", [0.2, 1.0])
def test_boxes_hold_all_of_a_bounded_set(mu: float) -> None:
    """The largest margin is the same in a larger box, where it does not grow with the box."""
    for polygon in (star(9, 1), LATTICE["hexagon"], Polygon(star(9, 1).vertices + 100)):
        cones = Cones.of(polygon, mu)
        sweeps = Sweeps.of_cones(cones)
        chosen = np.random.default_rng(0).integers(0, len(sweeps), (200, 3))
        sets = sweeps.linear_sets(chosen[sweeps.meet(chosen)])
        size = cones.size
        given_, large, larger = (
            maximise_margins(
                replace(sets, lower=sets.lower - grown, upper=sets.upper + grown), HIGHS
            ).margins
            for grown in (0, 10 * size, 1000 * size)
        )
        bounded = np.isclose(large, larger, rtol=1e-6)
        assert bounded.sum() > 10
        np.testing.assert_allclose(given_[bounded], larger[bounded], rtol=1e-6)


# --- laws ---------------------------------------------------------------------------------------


def some_regions(n: int, r: int, count: int = 400, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 2 * n, (count, r))


def meets(polygon: Polygon, friction: object, regions: np.ndarray) -> np.ndarray:
    return Sweeps.of_cones(Cones.of(polygon, friction)).meet(regions)


@pytest.mark.parametrize("name", SHAPES)
def test_order_and_repetition_change_nothing(name: str) -> None:
    polygon = SHAPES[name]
    friction = spread_friction(polygon.n_edges, 2)
    three = some_regions(polygon.n_edges, 3, 150)
    expected = meets(polygon, friction, three)
    for order in ((0, 1, 2), (1, 2, 0), (2, 1, 0)):
        np.testing.assert_array_equal(meets(polygon, friction, three[:, order]), expected)
        repeated = np.column_stack((three[:, order], three[:, order[0]]))
        np.testing.assert_array_equal(meets(polygon, friction, repeated), expected)
    pair = three[:, :2]
    twice = meets(polygon, friction, pair[:, [0, 1, 1]])
    np.testing.assert_array_equal(twice, meets(polygon, friction, pair))
    assert meets(polygon, friction, three[:, [0, 0, 0]]).all()
    both_sides = np.column_stack((2 * (three[:, 0] // 2), 2 * (three[:, 0] // 2) + 1))
    assert not meets(polygon, friction, both_sides).any()
    every_two = [meets(polygon, friction, three[:, [i, j]]) for i, j in ((0, 1), (1, 2), (0, 2))]
    assert not (expected & ~np.logical_and.reduce(every_two)).any()


@pytest.mark.parametrize("name", ["ell", "hexagon", "collinear", "frame", "lattice_star"])
@pytest.mark.parametrize(
    "move",
    [
        lambda v: v + np.array([1024.0, -512.0]),
        lambda v: v + 2.0**40,
        lambda v: v * 2.0**-300,
        lambda v: v * 2.0**30,
        lambda v: np.stack([-v[:, 1], v[:, 0]], axis=1),
    ],
    ids=["translation", "far translation", "tiny", "larger", "quarter turn"],
)
def test_moving_and_scaling_the_object_changes_nothing(name: str, move) -> None:
    polygon = LATTICE[name]
    rings = [move(np.array(ring)) for ring in polygon.rings]
    moved = Polygon(rings[0], holes=rings[1:])
    friction = spread_friction(polygon.n_edges, 2)
    for r in (2, 3, 4):
        regions = some_regions(polygon.n_edges, r, 300, r)
        expected = meets(polygon, friction, regions)
        assert r > 3 or expected.any()
        np.testing.assert_array_equal(meets(moved, friction, regions), expected)


def test_mirrored_objects_have_mirrored_answers() -> None:
    for polygon in (LATTICE["ell"], LATTICE["hexagon"], lattice_star(8, 5)):
        n = polygon.n_edges
        mirrored = Polygon((polygon.vertices * [-1, 1])[::-1])
        renamed = np.array([(n - 2 - e) % n for e in range(n)])
        starts = mirrored.edge_starts[renamed] * [-1, 1]
        np.testing.assert_array_equal(starts, polygon.edge_ends)
        friction = spread_friction(n, 4)
        other = np.empty(n)
        other[renamed] = friction
        regions = some_regions(n, 3)
        again = 2 * renamed[regions // 2] + regions % 2
        np.testing.assert_array_equal(
            meets(polygon, friction, regions), meets(mirrored, other, again)
        )


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), fewer=st.integers(0, 10**6))
def test_more_friction_and_fewer_regions_leave_more_open(seed: int, fewer: int) -> None:
    polygon = lattice_star(7, seed)
    friction = spread_friction(7, fewer)
    regions = some_regions(7, 4, 100, seed)
    less = meets(polygon, friction, regions)
    assert not (less & ~meets(polygon, friction * 1.5, regions)).any()
    assert not (less & ~meets(polygon, friction, regions[:, :3])).any()


def test_any_meet_is_any_of_the_choices() -> None:
    for polygon, mu in ((star(9, 1), 0.2), (LATTICE["ell"], 0.25)):
        sweeps = Sweeps.of_cones(Cones.of(polygon, mu))
        edges = np.random.default_rng(1).integers(0, polygon.n_edges, (300, 3))
        regions = 2 * edges[:, None, :] + sides_of(3)
        single = np.stack([sweeps.meet(regions[:, c]) for c in range(8)], axis=1)
        answers = sweeps.any_meet(regions)
        np.testing.assert_array_equal(answers, single.any(axis=1))
        assert answers.any()
        assert sweeps.any_meet(regions[:0]).shape == (0,)


@pytest.mark.parametrize("mu", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("r", [2, 3, 4])
def test_margins_have_the_sign_of_the_exact_answer(mu: float, r: int) -> None:
    cones = Cones.of(star(9, 1), mu)
    sweeps = Sweeps.of_cones(cones)
    regions = some_regions(9, r, 250, r)
    answers = sweeps.meet(regions)
    assert answers.any()
    for solver in ("clarabel", "highs"):
        margins = maximise_margins(sweeps.linear_sets(regions), get_solver(solver)).margins
        sure = np.abs(margins) > 1e-7
        np.testing.assert_array_equal(margins[sure] > 0, answers[sure])
        assert sure.mean() > 0.7


def test_regions_that_touch_do_not_meet() -> None:
    """At μ = 1 what two sides of a square see outside of them touches along the diagonal."""
    square = LATTICE["square"]
    corners = np.array([[1, 3], [3, 5], [5, 7], [7, 1]])
    for mu, expected in ((1.0, False), (np.nextafter(1.0, 2), True), (np.nextafter(1.0, 0), False)):
        sweeps = Sweeps.of_cones(Cones.of(square, mu))
        np.testing.assert_array_equal(sweeps.meet(corners), expected)
        assert sweeps.meet(np.array([[0, 2, 4, 6]]))[0]
        # edge 0 seen from above and from below: the line y = 0
        assert not sweeps.meet(np.array([[0, 1]]))[0]
