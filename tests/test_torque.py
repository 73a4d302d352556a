"""The theorem of the torque functions against exact wrenches, and what follows from it."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import combinations_with_replacement, permutations, product

import numpy as np
import pytest
from fourier_motzkin import box, pieces, solvable
from geometry import (
    GENERAL,
    LATTICE,
    cross,
    exact_point,
    exact_ray,
    lattice_star,
    nearly_parallel,
    needle,
    rectangle,
    regular,
    sign,
    staircase,
    star,
    thin,
    unit_square,
    with_hole,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from wrench_oracle import closed

from regrasp_lp.force_closure import is_force_closure
from regrasp_lp.friction import Cones, as_integers, spanning
from regrasp_lp.grasp_sets.candidates import complete_candidates, parallel_candidates
from regrasp_lp.grasp_sets.families import parallel_functions
from regrasp_lp.margins import existing_pieces
from regrasp_lp.polygon import Grasp, Polygon
from regrasp_lp.torque import TorqueFunctions, torque_functions
from regrasp_lp.wrenches import closure_from_signs

SHAPES = {**LATTICE, **GENERAL}
FRICTIONS = [0.25, 0.5, 1.0, 2.0]
QUARTERS = np.arange(5) / 4


def contact_sets(
    polygon: Polygon, m: int, count: int, seed: int, fractions: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng([seed, m, polygon.n_edges])
    edges = rng.integers(0, polygon.n_edges, (count, m))
    if fractions is None:
        return edges, rng.random((count, m))
    return edges, rng.choice(fractions, (count, m))


def combinations_of(polygon: Polygon, m: int) -> np.ndarray:
    """All combinations of m edges, repeated or not, spanning or not."""
    return np.array(list(combinations_with_replacement(range(polygon.n_edges), m)))


# --- the theorem --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("m", [1, 2, 3, 4])
def test_force_closure_is_torque_of_both_signs(name: str, m: int) -> None:
    polygon = SHAPES[name]
    for number, mu in enumerate(FRICTIONS):
        for fractions in (QUARTERS, None):
            edges, at = contact_sets(polygon, m, 250, number, fractions)
            functions = torque_functions(Cones.of(polygon, mu), edges)
            expected = is_force_closure(polygon, friction=mu, edges=edges, fractions=at)
            np.testing.assert_array_equal(functions.contain(at), expected)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("m", [2, 3, 4])
def test_force_closure_is_torque_of_both_signs_for_many(name: str, m: int) -> None:
    polygon = SHAPES[name]
    rng = np.random.default_rng(m)
    for number in range(8):
        mu = rng.choice([0.125, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0], polygon.n_edges)
        for fractions in (QUARTERS, None):
            edges, at = contact_sets(polygon, m, 5000, number, fractions)
            functions = torque_functions(Cones.of(polygon, mu), edges)
            expected = is_force_closure(polygon, friction=mu, edges=edges, fractions=at)
            np.testing.assert_array_equal(functions.contain(at), expected)


def test_the_theorem_has_both_answers_and_meets_exact_zeros() -> None:
    """The samples of the test above are no trivial ones."""
    answers, zeros = [], 0
    for polygon in LATTICE.values():
        for mu in FRICTIONS:
            edges, at = contact_sets(polygon, 3, 250, 0, QUARTERS)
            functions = torque_functions(Cones.of(polygon, mu), edges)
            answers.append(functions.contain(at))
            rows, columns = np.nonzero(functions.valid)
            zeros += (functions.exact_signs(rows, columns, at[rows]) == 0).sum()
    assert 0.1 < np.concatenate(answers).mean() < 0.9
    assert zeros > 1000


@settings(max_examples=150)
@given(
    st.sampled_from([*LATTICE]),
    st.lists(st.sampled_from([0.25, 0.5, 0.75, 1.0, 2.0, 4.0]), min_size=10, max_size=10),
    st.lists(
        st.tuples(st.integers(0, 99), st.integers(0, 8).map(lambda k: k / 8)),
        min_size=2,
        max_size=4,
    ),
)
def test_the_theorem_with_friction_per_edge(
    name: str, friction: list[float], contacts: list[tuple[int, float]]
) -> None:
    polygon = LATTICE[name]
    mu = [friction[i % len(friction)] for i in range(polygon.n_edges)]
    edges = np.array([[edge % polygon.n_edges for edge, _ in contacts]])
    at = np.array([[f for _, f in contacts]])
    functions = torque_functions(Cones.of(polygon, mu), edges)
    expected = is_force_closure(polygon, friction=mu, edges=edges, fractions=at)
    assert functions.contain(at)[0] == expected[0]


def test_the_order_of_contacts_does_not_matter() -> None:
    polygon = LATTICE["ell"]
    edges, at = contact_sets(polygon, 3, 200, 5, QUARTERS)
    reference = torque_functions(Cones.of(polygon, 0.5), edges)
    for order in permutations(range(3)):
        functions = torque_functions(Cones.of(polygon, 0.5), edges[:, order])
        np.testing.assert_array_equal(functions.contain(at[:, order]), reference.contain(at))
        np.testing.assert_array_equal(functions.exists(), reference.exists())
        np.testing.assert_allclose(
            functions.margins(at[:, order]), reference.margins(at), atol=1e-13
        )


# --- the functions ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize(("m", "most"), [(1, 0), (2, 2), (3, 8)])
def test_number_of_circuits(name: str, m: int, most: int) -> None:
    polygon = SHAPES[name]
    for mu in (*FRICTIONS, 1e3):
        functions = torque_functions(Cones.of(polygon, mu), combinations_of(polygon, m)[:400])
        assert functions.valid.sum(axis=1).max() <= most


def exact_functions(
    functions: TorqueFunctions, row: int
) -> list[tuple[tuple[int, ...], list[Fraction], list[Fraction]]]:
    """Circuits of a combination from scratch: (rays, weights, [M(0), slopes...]) each."""
    cones, edges = functions.cones, functions.edges[row].tolist()
    m = len(edges)
    rays = [exact_ray(cones, 2 * edge + side) for edge in edges for side in (0, 1)]
    found = []
    for size in (2, 3):
        for chosen in permutations(range(2 * m), size):
            if list(chosen) != sorted(chosen):
                continue
            e = [rays[r] for r in chosen]
            if size == 2:
                if cross(e[0], e[1]) != 0 or e[0][0] * e[1][0] + e[0][1] * e[1][1] >= 0:
                    continue
                norm = [abs(v[0]) + abs(v[1]) for v in e]
                weights = [norm[1], norm[0]]
            else:
                turns = [cross(e[1], e[2]), cross(e[2], e[0]), cross(e[0], e[1])]
                if len({sign(t) for t in turns}) != 1 or turns[0] == 0:
                    continue
                weights = [abs(t) for t in turns]
            assert sum(w * v[0] for w, v in zip(weights, e, strict=True)) == 0
            assert sum(w * v[1] for w, v in zip(weights, e, strict=True)) == 0
            coefficients = [Fraction(0)] * (m + 1)
            for r, weight in zip(chosen, weights, strict=True):
                start = exact_point(cones, edges[r // 2], Fraction(0))
                end = exact_point(cones, edges[r // 2], Fraction(1))
                coefficients[0] += weight * cross(start, rays[r])
                coefficients[r // 2 + 1] += weight * (cross(end, rays[r]) - cross(start, rays[r]))
            found.append((tuple(2 * edges[r // 2] + r % 2 for r in chosen), weights, coefficients))
    return found


def proportional(first: list[Fraction], second: list[Fraction]) -> bool:
    """Whether two vectors are the same up to a positive factor."""
    pivot = next((i for i, v in enumerate(first) if v != 0), None)
    if pivot is None:
        return not any(second)
    if second[pivot] * first[pivot] <= 0:
        return False
    factor = second[pivot] / first[pivot]
    return all(factor * p == q for p, q in zip(first, second, strict=True))


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("m", [2, 3])
def test_functions_are_those_of_all_circuits_in_rational_numbers(name: str, m: int) -> None:
    polygon = SHAPES[name]
    rng = np.random.default_rng(1)
    for friction in (1.0, rng.choice([0.25, 0.5, 1.0, 1.5], polygon.n_edges)):
        edges, _ = contact_sets(polygon, m, 25, 3)
        functions = torque_functions(Cones.of(polygon, friction), edges)
        for row in range(len(functions)):
            expected = exact_functions(functions, row)
            constants, slopes = functions.exact_coefficients(row)
            found = [[c, *s] for c, s in zip(constants, slopes, strict=True)]
            rays = [
                tuple(int(r) for r in ray if r >= 0)
                for ray in functions.ray[row][functions.valid[row]]
            ]
            assert len(found) == len(expected)
            left = [(chosen, exact) for chosen, _, exact in expected]
            for chosen, coefficients in zip(rays, found, strict=True):
                match = [
                    entry
                    for entry in left
                    if entry[0] == chosen and proportional(entry[1], coefficients)
                ]
                assert match
                left.remove(match[0])


@pytest.mark.parametrize("name", SHAPES)
def test_functions_do_not_decrease(name: str) -> None:
    polygon = SHAPES[name]
    cones = Cones.of(polygon, 0.75)
    functions = torque_functions(cones, combinations_of(polygon, 3)[:200])
    assert (functions.slopes >= 0).all()
    strictly = 0
    for row in range(0, len(functions), max(1, len(functions) // 30)):
        for slopes in functions.exact_coefficients(row)[1]:
            assert all(s >= 0 for s in slopes)
            strictly += any(s > 0 for s in slopes)
    assert strictly > 0


def precise_root(value: Fraction) -> Fraction:
    """A square root to 60 decimal places."""
    unit = 10**120
    return Fraction(math.isqrt(value.numerator * unit * value.denominator), 10**60) / (
        value.denominator
    )


@pytest.mark.parametrize(
    "polygon",
    [
        star(9, 1),
        thin(),
        needle(),
        nearly_parallel(),
        rectangle(),
        regular(7),
        Polygon(star(8, 3).vertices + np.array([1e6, -3e6])),
        Polygon(star(8, 3).vertices * 1e-9),
        Polygon(star(8, 3).vertices * np.array([1.0, 1e-4])),
    ],
    ids=repr,
)
@pytest.mark.parametrize("mu", [1e-3, 0.3, 1.0, 7.3, 1e5])
def test_rounding_errors_are_within_their_bounds(polygon: Polygon, mu: float) -> None:
    """Values against ``M / Σ w |e|`` in rational numbers (roots to 60 places)."""
    cones = Cones.of(polygon, mu)
    edges, at = contact_sets(polygon, 3, 12, 7)
    functions = torque_functions(cones, edges)
    values = functions.values(at)
    compared = 0
    for row in range(len(functions)):
        exact = {}
        for rays, weights, coefficients in exact_functions(functions, row):
            scale = sum(
                w * precise_root(sum(v * v for v in exact_ray(cones, r)))
                for w, r in zip(weights, rays, strict=True)
            )
            value = coefficients[0] + sum(
                a * Fraction(f) for a, f in zip(coefficients[1:], at[row].tolist(), strict=True)
            )
            exact.setdefault(rays, []).append(value / scale)
        for column in np.flatnonzero(functions.valid[row]):
            rays = tuple(int(r) for r in functions.ray[row, column] if r >= 0)
            off = min(abs(v - Fraction(values[row, column])) for v in exact[rays])
            assert off <= functions.errors[row, column]
            compared += 1
    assert compared >= 8
    assert (functions.errors[functions.valid] > 0).all()


def test_exact_signs_follow_the_doubles() -> None:
    """At the root of a function and one unit in the last place beside it."""
    functions = torque_functions(Cones.of(rectangle(), 0.5), np.array([[0, 2]]))
    rows, columns = np.zeros(2, dtype=int), np.arange(2)
    above, below = np.nextafter(0.5, 1), np.nextafter(0.5, 0)
    # (f_0, f_2) = (3/4, 1/2): the line through both contacts is a boundary of the cones
    signs = {
        f: functions.exact_signs(rows, columns, np.array([[f, 0.5]] * 2)).tolist()
        for f in (0.75, np.nextafter(0.75, 1), np.nextafter(0.75, 0), 0.25)
    }
    assert sorted(signs[0.75]) == [0, 1]
    assert sorted(signs[np.nextafter(0.75, 1)]) == [1, 1]
    assert sorted(signs[np.nextafter(0.75, 0)]) == [-1, 1]
    assert sorted(signs[0.25]) == [-1, 0]
    assert functions.contain(np.array([[0.5, above]]))[0]
    assert functions.contain(np.array([[0.5, below]]))[0]
    assert not functions.contain(np.array([[0.75, 0.5]]))[0]


# --- sets: existence, cover, connectedness ------------------------------------------------------


def test_unit_square_with_opposite_rays_has_exactly_these_sets() -> None:
    """Rays at 45 degrees: without two opposite sides they leave a half-plane closed."""
    polygon = unit_square()
    cones = Cones.of(polygon, 1.0)
    pairs, triples = combinations_of(polygon, 2), combinations_of(polygon, 3)
    for edges, expected in (
        (pairs, [[0, 2], [1, 3]]),
        (
            triples,
            [
                [0, 0, 2],
                [0, 1, 2],
                [0, 2, 2],
                [0, 2, 3],
                [0, 1, 3],
                [1, 1, 3],
                [1, 2, 3],
                [1, 3, 3],
            ],
        ),
    ):
        functions = torque_functions(cones, edges)
        assert edges[functions.exists()].tolist() == sorted(expected)
    functions = torque_functions(cones, triples)
    low, high = np.zeros(triples.shape), np.ones(triples.shape)
    by_corners = functions.any_negative(low) & functions.any_positive(high)
    assert by_corners.sum() == 20 - 4  # not even (a, a, a)
    assert (by_corners & ~functions.spans).sum() == 8


@pytest.mark.parametrize("name", SHAPES)
def test_existence_against_samples_and_elimination(name: str) -> None:
    """Some sampled grasp is in force closure: it exists; elimination agrees on both answers."""
    polygon = SHAPES[name]
    rng = np.random.default_rng(0)
    for mu in (0.25, 1.0):
        cones = Cones.of(polygon, mu)
        for m, steps in ((2, 9), (3, 5)):
            edges = combinations_of(polygon, m)
            edges = edges[np.sort(rng.permutation(len(edges))[:60])]
            functions = torque_functions(cones, edges)
            exists = functions.exists()
            grid = np.array(list(product(np.linspace(0, 1, steps), repeat=m)))
            inside = is_force_closure(
                polygon,
                friction=mu,
                edges=edges.repeat(len(grid), axis=0),
                fractions=np.tile(grid, (len(edges), 1)),
            ).reshape(len(edges), -1)
            assert not (inside.any(axis=1) & ~exists).any()
            for row in range(len(edges)):
                constants, slopes = functions.exact_coefficients(row)
                exact = [[c, *s] for c, s in zip(constants, slopes, strict=True)]
                assert exists[row] == (bool(functions.spans[row]) and bool(pieces(exact)))


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("m", [2, 3])
def test_the_two_halves_cover_the_box_where_contacts_do_not_coincide(name: str, m: int) -> None:
    polygon = SHAPES[name]
    for mu in FRICTIONS:
        edges, at = contact_sets(polygon, m, 600, 11, QUARTERS)
        functions = torque_functions(Cones.of(polygon, mu), edges)
        neither = functions.spans & ~functions.any_negative(at) & ~functions.any_positive(at)
        for row in np.flatnonzero(neither):
            points = [
                exact_point(functions.cones, e, Fraction(f))
                for e, f in zip(edges[row].tolist(), at[row].tolist(), strict=True)
            ]
            assert len(set(points)) < m


def test_where_contacts_coincide_neither_half_need_hold() -> None:
    """Both contacts of an acute corner at its tip: all torques vanish."""
    functions = torque_functions(Cones.of(needle(), 1.0), np.array([[0, 2]]))
    at = np.array([[0.0, 1.0]])
    assert functions.spans[0]
    assert not functions.any_negative(at)[0]
    assert not functions.any_positive(at)[0]


@pytest.mark.parametrize("name", ["ell", "comb", "frame", "hexagon", "lattice_star", "star7"])
def test_sets_are_connected(name: str) -> None:
    """Pieces are convex and open: a set is connected iff the graph of their overlaps is."""
    polygon = SHAPES[name]
    rng = np.random.default_rng(2)
    for mu in (0.25, 1.0):
        cones = Cones.of(polygon, mu)
        functions = torque_functions(cones, complete_candidates(cones, 3))
        exists = np.flatnonzero(functions.exists())
        for row in rng.permutation(exists)[:6]:
            constants, slopes = functions.exact_coefficients(row)
            parts = pieces([[c, *s] for c, s in zip(constants, slopes, strict=True)])
            reached, open_ = {0}, [0]
            while open_:
                one = open_.pop()
                for other in set(range(len(parts))) - reached:
                    if solvable(parts[one] + parts[other] + box(3)):
                        reached.add(other)
                        open_.append(other)
            assert len(reached) == len(parts) > 0


# --- independent regions ------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("m", [2, 3])
def test_independent_regions_are_those_with_closed_corners(name: str, m: int) -> None:
    polygon = SHAPES[name]
    cones = Cones.of(polygon, 0.75)
    candidates = complete_candidates(cones, m)
    rng = np.random.default_rng(m)
    edges = candidates[rng.integers(0, len(candidates), 200)]
    ends = np.sort(rng.integers(0, 9, (2, 200, m)) / 8, axis=0)
    # Small boxes about the middle are often independent, wide ones are not.
    ends[:, ::2] = np.clip(np.stack((0.5 - ends[0, ::2] / 4, 0.5 + ends[1, ::2] / 8)), 0, 1)
    lower, upper = ends
    functions = torque_functions(cones, edges)
    independent = functions.independent(lower, upper)
    corners = np.ones(len(edges), dtype=bool)
    for upper_ones in product([False, True], repeat=m):
        at = np.where(upper_ones, upper, lower)
        corners &= is_force_closure(polygon, friction=0.75, edges=edges, fractions=at)
    np.testing.assert_array_equal(independent, corners)
    for _ in range(20):
        at = lower + rng.random(lower.shape) * (upper - lower)
        inside = is_force_closure(polygon, friction=0.75, edges=edges, fractions=at)
        assert inside[independent].all()


def test_boxes_up_to_the_boundary_are_independent_and_no_others() -> None:
    """Across a height of 2 the cones reach 1 at μ = 1/2: |4 (f_0 + f_2 - 1)| < 1."""
    functions = torque_functions(Cones.of(rectangle(4, 2), 0.5), np.array([[0, 2]]))
    inside, beside = np.nextafter(0.375, 1), np.nextafter(0.625, 0)
    for lower, upper, expected in (
        (0.4, 0.6, True),
        (inside, beside, True),
        (0.375, 0.5, False),
        (0.5, 0.625, False),
        (0.25, 0.75, False),
    ):
        box_of = np.full((1, 2), lower), np.full((1, 2), upper)
        assert functions.independent(*box_of)[0] == expected


# --- margins and tolerances ---------------------------------------------------------------------


def wrenches(cones: Cones, edges: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Unit wrenches of the boundary rays, shape (2 m, 3)."""
    points = cones.local_starts[edges] + at[:, None] * cones.vectors[edges]
    rays = cones.unit_rays[np.stack((2 * edges, 2 * edges + 1), axis=1)].reshape(-1, 2)
    points = points.repeat(2, axis=0)
    torque = points[:, 0] * rays[:, 1] - points[:, 1] * rays[:, 0]
    return np.column_stack((rays, torque))


def close(w: np.ndarray) -> bool:
    """Force closure of wrenches in floating point, zeros cut off."""
    n = len(w)
    index = [(i, j, k) for i in range(n) for j in range(i + 1, n) for k in range(j + 1, n)]
    i, j, k = np.array(index).T
    determinants = np.einsum("ni,ni->n", w[i], np.cross(w[j], w[k]))[:, None]
    return bool(closure_from_signs(n, determinants > 1e-13, determinants < -1e-13)[0])


@pytest.mark.parametrize("name", ["star7", "regular5", "ell", "frame"])
@pytest.mark.parametrize("m", [2, 3])
def test_margin_is_by_how_much_every_boundary_line_may_be_shifted(name: str, m: int) -> None:
    polygon, mu = SHAPES[name], 0.6
    cones = Cones.of(polygon, mu)
    candidates = complete_candidates(cones, m)
    rng = np.random.default_rng(m)
    edges = candidates[rng.integers(0, len(candidates), 400)]
    at = rng.random(edges.shape)
    functions = torque_functions(cones, edges)
    margins = functions.margins(at)
    inside = is_force_closure(polygon, friction=mu, edges=edges, fractions=at)
    np.testing.assert_array_equal(margins > 0, inside)
    chosen = np.flatnonzero(margins > 1e-3)[:8]
    assert chosen.size >= 2
    for row in chosen:
        w = wrenches(cones, edges[row], at[row])
        shifts = np.array(list(product([-1.0, 1.0], repeat=2 * m))) * margins[row]
        for shift in shifts:
            assert close(w + np.outer(shift * 0.999, [0, 0, 1]))
        assert not all(close(w + np.outer(shift * 1.001, [0, 0, 1])) for shift in shifts)


@pytest.mark.parametrize("name", ["star7", "regular5", "ell", "frame", "triangle"])
@pytest.mark.parametrize("m", [2, 3])
def test_tolerance_is_how_far_every_contact_may_be_off(name: str, m: int) -> None:
    polygon, mu = SHAPES[name], 0.6
    cones = Cones.of(polygon, mu)
    candidates = complete_candidates(cones, m)
    rng = np.random.default_rng(m)
    edges = candidates[rng.integers(0, len(candidates), 300)]
    at = rng.uniform(0.1, 0.9, edges.shape)
    functions = torque_functions(cones, edges)
    tolerances = functions.tolerances(at)
    rows = np.flatnonzero(tolerances > 1e-3)
    assert rows.size > 5
    lengths = polygon.edge_lengths[edges[rows]]
    signs = np.array(list(product([-1.0, 1.0], repeat=m)))

    def corners(factor: float) -> np.ndarray:
        """Fractions of all displaced grasps, shape (rows, 2^m, m)."""
        reach = factor * tolerances[rows, None] / lengths
        return at[rows, None, :] + signs * reach[:, None, :]

    def hold(fractions: np.ndarray) -> np.ndarray:
        on_edge = ((fractions >= 0) & (fractions <= 1)).all(axis=2).ravel()
        flat = np.clip(fractions.reshape(-1, m), 0, 1)
        all_edges = edges[rows].repeat(len(signs), axis=0)
        held = is_force_closure(polygon, friction=mu, edges=all_edges, fractions=flat)
        return (held & on_edge).reshape(len(rows), -1).all(axis=1)

    assert hold(corners(1 - 1e-6)).all()
    assert not hold(corners(1 + 1e-6)).any()


def test_tolerance_is_a_multiple_of_the_margin_under_uniform_friction() -> None:
    polygon, mu = star(9, 1), 0.8
    cones = Cones.of(polygon, mu)
    edges = complete_candidates(cones, 3)
    at = np.random.default_rng(3).random(edges.shape)
    functions = torque_functions(cones, edges)
    ends = (np.minimum(at, 1 - at) * functions.lengths).min(axis=1)
    np.testing.assert_allclose(
        functions.tolerances(at),
        np.minimum(functions.margins(at) * np.sqrt(1 + mu**2), ends),
        atol=1e-12,
    )


def test_without_spanning_margins_are_minus_infinity() -> None:
    functions = torque_functions(Cones.of(unit_square(), 1.0), np.array([[0, 1], [0, 2]]))
    middle = np.full((2, 2), 0.5)
    assert functions.spans.tolist() == [False, True]
    assert functions.margins(middle)[0] == functions.tolerances(middle)[0] == -np.inf
    # 45-degree rays from (1/2, 0) and (1/2, 1): each line is 1/2 · √2 / 2 ... from the other two
    assert functions.margins(middle)[1] == pytest.approx(math.sqrt(2) / 4)
    assert functions.tolerances(middle)[1] == pytest.approx(0.5)


# --- invariances --------------------------------------------------------------------------------


def dyadic_star(n: int, seed: int) -> np.ndarray:
    return np.round(star(n, seed).vertices * 2**12) / 2**12


SHAPES_TO_MOVE = [dyadic_star(8, 0), with_hole().exterior, staircase(3, 3).exterior]


@pytest.mark.parametrize("vertices", SHAPES_TO_MOVE, ids=["star", "square", "staircase"])
@pytest.mark.parametrize(
    ("move", "factor"),
    [
        (lambda v: v + np.array([1024.0, -512.0]), 1.0),
        (lambda v: v * 2.0**-30, 2.0**-30),
        (lambda v: v * 2.0**20, 2.0**20),
        (lambda v: np.stack([-v[:, 1], v[:, 0]], axis=1), 1.0),
    ],
    ids=["translation", "smaller", "larger", "quarter turn"],
)
def test_moving_and_scaling_the_object_changes_nothing(vertices, move, factor) -> None:
    polygon, moved = Polygon(vertices), Polygon(move(np.array(vertices)))
    edges = combinations_of(polygon, 3)
    at = np.random.default_rng(0).choice(QUARTERS, edges.shape)
    one = torque_functions(Cones.of(polygon, 0.5), edges)
    other = torque_functions(Cones.of(moved, 0.5), edges)
    np.testing.assert_array_equal(one.spans, other.spans)
    np.testing.assert_array_equal(one.ray, other.ray)
    np.testing.assert_array_equal(one.exists(), other.exists())
    np.testing.assert_array_equal(one.contain(at), other.contain(at))
    size = one.cones.size
    for measure in ("margins", "tolerances"):
        np.testing.assert_allclose(
            getattr(one, measure)(at), getattr(other, measure)(at) / factor, atol=1e-13 * size
        )


def test_a_relabelled_start_vertex_renames_the_edges() -> None:
    vertices = dyadic_star(8, 0)
    polygon, rolled = Polygon(vertices), Polygon(np.roll(vertices, -3, axis=0))
    edges = combinations_of(polygon, 3)
    at = np.random.default_rng(0).random(edges.shape)
    one = torque_functions(Cones.of(polygon, 0.5), edges)
    other = torque_functions(Cones.of(rolled, 0.5), (edges - 3) % 8)
    np.testing.assert_array_equal(one.contain(at), other.contain(at))
    np.testing.assert_allclose(one.margins(at), other.margins(at), atol=1e-14)
    np.testing.assert_allclose(one.tolerances(at), other.tolerances(at), atol=1e-14)


# --- stacks -------------------------------------------------------------------------------------


def test_a_part_of_a_stack_has_the_same_values() -> None:
    polygon = star(7, 0)
    edges = combinations_of(polygon, 3)
    functions = torque_functions(Cones.of(polygon, 0.5), edges)
    at = np.random.default_rng(0).random(edges.shape)
    few = np.argsort(functions.valid.sum(axis=1))[:20]
    part = functions.take(few)
    assert part.valid.shape[1] < functions.valid.shape[1]
    np.testing.assert_array_equal(part.margins(at[few]), functions.margins(at)[few])
    np.testing.assert_array_equal(part.contain(at[few]), functions.contain(at)[few])
    np.testing.assert_array_equal(
        functions.take(functions.exists()).edges, edges[functions.exists()]
    )
    single = torque_functions(Cones.of(polygon, 0.5), edges[few[-1:]])
    assert single.margins(at[few[-1:]])[0] == pytest.approx(part.margins(at[few])[-1], abs=1e-15)


def test_an_empty_stack() -> None:
    functions = torque_functions(Cones.of(rectangle(), 0.5), np.zeros((0, 3), dtype=int))
    assert len(functions) == 0
    assert functions.m == 3
    for result in (
        functions.exists(),
        functions.contain(np.zeros((0, 3))),
        functions.margins(np.zeros((0, 3))),
        functions.tolerances(np.zeros((0, 3))),
    ):
        assert result.shape == (0,)
    assert as_integers(np.zeros(0))[0].shape == (0,)
    assert existing_pieces(functions).shape == (0, 3)


# --- the functions of parallel sets -------------------------------------------------------------


@pytest.mark.parametrize("name", ["comb", "ell", "frame", "star9", "hexagon", "collinear"])
def test_parallel_functions_in_rational_numbers(name: str) -> None:
    """``(p_b - p_a) × d`` with d a boundary of the common cone, from exact rays."""
    polygon = SHAPES[name]
    cones = Cones.of(polygon, 0.75)
    edges, centers = parallel_candidates(cones)
    functions = parallel_functions(cones, edges, centers)
    assert len(functions) > 0
    assert functions.valid.all()
    at = np.random.default_rng(0).random(edges.shape)
    values = functions.values(at)
    for row in range(0, len(functions), max(1, len(functions) // 12)):
        center = edges[row].tolist().index(centers[row])
        sides = [i for i in range(3) if i != center]
        d_of = [common_boundary(cones, edges[row], center, end) for end in (0, 1)]
        constants, slopes = functions.exact_coefficients(row)
        exact = [[c, *s] for c, s in zip(constants, slopes, strict=True)]
        for column, (side, d) in enumerate((s, d) for s in sides for d in d_of):
            expected = [Fraction(0)] * 4
            for contact, force in ((side, 1), (center, -1)):
                start = exact_point(cones, int(edges[row, contact]), Fraction(0))
                end = exact_point(cones, int(edges[row, contact]), Fraction(1))
                expected[0] += force * cross(start, d)
                expected[contact + 1] += force * (cross(end, d) - cross(start, d))
            assert proportional(expected, exact[column])
            value = expected[0] + sum(
                a * Fraction(f) for a, f in zip(expected[1:], at[row].tolist(), strict=True)
            )
            assert sign(value) == np.sign(values[row, column])


def common_boundary(
    cones: Cones, edges: np.ndarray, center: int, end: int
) -> tuple[Fraction, Fraction]:
    """The clockwise (0) or counter-clockwise (1) boundary of ``-C_a ∩ C_b ∩ C_c``."""
    arcs = []
    for slot, edge in enumerate(edges.tolist()):
        s = -1 if slot == center else 1
        arcs.append([tuple(s * v for v in exact_ray(cones, 2 * edge + side)) for side in (0, 1)])
    for arc in arcs:
        d = arc[end]
        if all(cross(other[0], d) >= 0 and cross(d, other[1]) >= 0 for other in arcs):
            return d
    raise AssertionError("the common cone is empty")


@pytest.mark.parametrize("mu", [0.3, 0.75, 2.0])
def test_parallel_sets_are_part_of_the_complete_ones(mu: float) -> None:
    """And their margins are lower bounds of the grasps' own."""
    polygon = lattice_star(10, 1)
    cones = Cones.of(polygon, mu)
    edges, centers = parallel_candidates(cones)
    functions = parallel_functions(cones, edges, centers)
    rng = np.random.default_rng(1)
    seen = 0
    for _ in range(40):
        at = rng.choice(np.arange(9) / 8, edges.shape)
        inside = functions.contain(at)
        held = is_force_closure(polygon, friction=mu, edges=edges, fractions=at)
        assert held[inside].all()
        grasps = torque_functions(cones, edges)
        positive = functions.margins(at) > 0
        own = grasps.margins(at)
        assert (functions.margins(at)[positive] <= own[positive] + 1e-12).all()
        seen += inside.sum()
    assert seen > 0


def test_the_oracles_agree_with_each_other() -> None:
    polygon = LATTICE["ell"]
    edges, at = contact_sets(polygon, 3, 40, 1, QUARTERS)
    verdict = is_force_closure(polygon, friction=0.5, edges=edges, fractions=at)
    for e, f, answer in zip(edges.tolist(), at.tolist(), verdict, strict=True):
        assert closed(polygon, 0.5, list(zip(e, f, strict=True))) == answer
        assert is_force_closure(
            polygon, Grasp.at_fractions(list(zip(e, f, strict=True))), friction=0.5
        ) == bool(answer)
    assert spanning(Cones.of(polygon, 0.5), edges).any()
