"""Existing grasp sets against solvers, focus cells drawn with shapely, and random grasps."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
import shapely
from conftest import covering
from fourier_motzkin import box, row, solvable
from geometry import (
    GENERAL,
    LATTICE,
    comb,
    cross,
    exact_point,
    exact_ray,
    lattice_star,
    minus,
    needle,
    rectangle,
    regular,
    staircase,
    star,
    unit_square,
    with_collinear_runs,
)

from regrasp_lp.errors import OptionError
from regrasp_lp.force_closure import is_force_closure
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.candidates import (
    common_cone,
    concurrent_candidates,
    parallel_candidates,
    two_finger_candidates,
)
from regrasp_lp.grasp_sets.families import parallel_functions
from regrasp_lp.grasp_sets.pieces import in_positions, piece_sets
from regrasp_lp.grasp_sets.vertices import Family, build_family, candidate_functions, kinds_of
from regrasp_lp.lp import get_solver
from regrasp_lp.margins import best_pieces
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import torque_functions

KINDS = ["two_finger", "three_finger", "concurrent", "parallel"]
SHAPES = {
    "star": (star(8, 0), 0.25),
    "rough star": (star(8, 1), 0.9),
    "very rough star": (star(7, 2), 2.0),
    "comb": (comb(2), 0.5),
    "rectangle": (rectangle(), 0.5),
    "square": (unit_square(), 1.0),
    "regular": (regular(7), 0.3),
    "collinear": (with_collinear_runs(), 0.5),
    "frame": (LATTICE["frame"], 0.25),
    "lattice star": (lattice_star(9, 4), 0.2),
    "staircase": (staircase(2, 4), 1.0),
    "per edge": (star(7, 4), (0.125, 2.0, 0.25, 0.5, 1.0, 0.125, 0.5)),
    "thin": (GENERAL["thin"], 0.4),
}
CLARABEL, HIGHS = get_solver("clarabel"), get_solver("highs")


def cones_of(name: str) -> Cones:
    return Cones.of(*SHAPES[name])


# --- deciders -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "kind"), covering(SHAPES, KINDS))
def test_presolve_and_both_solvers_agree(name: str, kind: str) -> None:
    cones = cones_of(name)
    families = [
        build_family(cones, kind, solver, presolve=presolve)
        for solver, presolve in product((CLARABEL, HIGHS), (True, False))
    ]
    reference = families[0]
    for family in families[1:]:
        np.testing.assert_array_equal(family.functions.edges, reference.functions.edges)
        np.testing.assert_array_equal(family.centers, reference.centers)
        np.testing.assert_allclose(
            family.margins, reference.margins, rtol=1e-9, atol=1e-9 * cones.size
        )
        assert family.n_candidates == reference.n_candidates
    closed_form, _ = best_pieces(reference.functions)
    np.testing.assert_allclose(reference.margins, closed_form, rtol=1e-9, atol=1e-9 * cones.size)


def assert_witnesses(polygon: Polygon, friction: float | tuple, family: Family) -> None:
    """In force closure exactly, with the margin that the family states, contacts all apart."""
    edges, at = family.functions.edges, family.witnesses
    assert ((at >= 0) & (at <= 1)).all()
    assert is_force_closure(polygon, friction=friction, edges=edges, fractions=at).all()
    size = polygon.diameter
    # A contact that would meet another one at a corner is moved by 1e-6 of its edge.
    assert (family.functions.margins(at) >= family.margins - 1e-6 * size).all()
    own = torque_functions(family.functions.cones, edges).margins(at)
    assert (own >= family.margins - 1e-6 * size).all()
    assert (own > -1e-15 * size).all()  # in force closure, though rounding may say 0
    for one in range(edges.shape[1] - 1):
        same = edges[:, one] == edges[:, one + 1]
        assert (at[same, one] < at[same, one + 1]).all()
    points = polygon.points(edges, at)
    for one in range(edges.shape[1]):
        for other in range(one):
            gap = np.abs(points[:, one] - points[:, other]).max(axis=1)
            assert (gap[family.margins > 1e-12 * size] > 0).all()  # else nothing can be moved


@pytest.mark.parametrize(("name", "kind", "presolve"), covering(SHAPES, KINDS, [True, False]))
def test_witnesses_are_grasps(name: str, kind: str, presolve: bool) -> None:
    polygon, friction = SHAPES[name]
    for solver in (CLARABEL, HIGHS):
        family = build_family(cones_of(name), kind, solver, presolve=presolve)
        assert_witnesses(polygon, friction, family)


def test_sets_smaller_than_the_accuracy_of_a_solver_still_have_a_witness() -> None:
    """At μ = 1 the right angle of the needle's tip holds next to nothing (margin 2e-13 of it)."""
    polygon = needle()
    family = build_family(Cones.of(polygon, 1.0), "two_finger", CLARABEL)
    assert len(family) == 2
    assert is_force_closure(
        polygon, friction=1.0, edges=family.functions.edges, fractions=family.witnesses
    ).all()
    assert family.margins.min() < 1e-9
    # What a solver alone can tell from nothing is one of the two.
    assert len(build_family(Cones.of(polygon, 1.0), "two_finger", CLARABEL, presolve=False)) == 1


@pytest.mark.parametrize("polygon", [GENERAL["nearly_parallel"], regular(12)], ids=repr)
@pytest.mark.parametrize("kind", KINDS)
def test_witnesses_of_sets_as_thin_as_rounding(polygon: Polygon, kind: str) -> None:
    cones = Cones.of(polygon, 1.0)
    for solver in (CLARABEL, HIGHS):
        assert_witnesses(polygon, 1.0, build_family(cones, kind, solver))


def test_two_contacts_on_one_edge() -> None:
    """They must not coincide, however the best piece would have them."""
    polygon = rectangle()
    family = build_family(Cones.of(polygon, 0.5), "three_finger", CLARABEL)
    repeated = (np.diff(family.functions.edges, axis=1) == 0).any(axis=1)
    assert repeated.sum() == 4  # (0, 0, 2), (0, 2, 2), (1, 1, 3), (1, 3, 3)
    assert_witnesses(polygon, 0.5, family)


# --- geometry drawn independently ---------------------------------------------------------------


def sweep(cones: Cones, edge: int, first: np.ndarray, second: np.ndarray) -> shapely.Geometry:
    """An edge moved along all directions of a cone, up to a hundred sizes of the object."""
    far = 100 * cones.size
    ends = [cones.starts[edge], cones.ends[edge]]
    points = [p + far * d for p in ends for d in (0 * first, first, second)]
    return shapely.MultiPoint(points).convex_hull


def unit(vector: tuple[Fraction, Fraction]) -> np.ndarray:
    value = np.array([float(v) for v in vector])
    return value / np.hypot(*value)


@pytest.mark.parametrize(
    ("polygon", "mu"),
    [(star(9, 1), 0.15), (star(11, 2), 0.3), (lattice_star(9, 4), 0.2), (regular(9), 0.1)],
)
def test_concurrent_sets_are_those_with_a_focus_cell(polygon: Polygon, mu: float) -> None:
    cones = Cones.of(polygon, mu)
    rays = [unit(exact_ray(cones, r)) for r in range(2 * polygon.n_edges)]
    both_sides = [
        shapely.union(
            sweep(cones, e, rays[2 * e], rays[2 * e + 1]),
            sweep(cones, e, -rays[2 * e], -rays[2 * e + 1]),
        )
        for e in range(polygon.n_edges)
    ]
    functions, _ = candidate_functions(cones, "concurrent")
    exists = functions.exists()
    margins, _ = best_pieces(functions)
    decided = np.abs(margins) > 1e-6 * cones.size
    assert exists.any()
    assert decided.sum() > 0.9 * len(decided)
    for edges, answer in zip(
        functions.edges[decided].tolist(), exists[decided].tolist(), strict=True
    ):
        a, b, c = (both_sides[e] for e in edges)
        assert (a & b & c).area > 1e-12 * cones.size**2 if answer else (a & b & c).area < 1e-9


@pytest.mark.parametrize(
    ("polygon", "mu"),
    [(star(13, 1), 0.3), (star(12, 0), 0.5), (star(13, 3), 0.6), (lattice_star(9, 4), 1.0)],
)
def test_two_finger_sets_are_those_with_a_focus_cell(polygon: Polygon, mu: float) -> None:
    cones = Cones.of(polygon, mu)
    functions, _ = candidate_functions(cones, "two_finger")
    exists = functions.exists()
    margins, _ = best_pieces(functions)
    answers = []
    for (a, b), answer, margin in zip(
        functions.edges.tolist(), exists.tolist(), margins.tolist(), strict=True
    ):
        if abs(margin) < 1e-6 * cones.size:
            continue
        boundaries = []
        for end in (0, 1):  # the boundaries of C_a ∩ -C_b
            mine, other = exact_ray(cones, 2 * a + end), exact_ray(cones, 2 * b + end)
            other = (-other[0], -other[1])
            turn = cross(mine, other)
            inner = other if (turn > 0) == (end == 0) else mine
            boundaries.append(unit(inner if turn != 0 else mine))
        d, e = boundaries
        cells = [sweep(cones, a, s * d, s * e) & sweep(cones, b, -s * d, -s * e) for s in (1, -1)]
        assert (max(cell.area for cell in cells) > 1e-12 * cones.size**2) == answer
        assert min(cell.area for cell in cells) < 1e-9 * cones.size**2
        answers.append(answer)
    assert set(answers) == {True, False}


def boundary_forces(cones: Cones, edges: list[int], center: int) -> list[tuple]:
    """The two boundaries of the common cone, exactly."""
    others = [e for e in edges if e != center]
    common = common_cone(cones, np.array([[center, *others]]))
    return [
        tuple(int(common.sign[0, i]) * v for v in exact_ray(cones, int(common.ray[0, i])))
        for i in (0, 1)
    ]


@pytest.mark.parametrize(
    ("polygon", "mu"),
    [(star(13, 0), 0.6), (star(11, 1), 0.6), (lattice_star(9, 4), 0.9), (star(13, 3), 1.5)],
)
def test_parallel_sets_follow_the_outer_regions(polygon: Polygon, mu: float) -> None:
    """Proposition 3.9, at all ends of the edges: not all points of E_b and E_c lie on one side of
    the common cones of all points of E_a. And the same by the six sub-polytopes 3.2 to 3.7.
    """
    cones = Cones.of(polygon, mu)
    edges, centers = parallel_candidates(cones)
    exists = parallel_functions(cones, edges, centers).exists()
    answers = []
    for triple, center, answer in zip(
        edges.tolist(), centers.tolist(), exists.tolist(), strict=True
    ):
        forces = boundary_forces(cones, triple, center)
        ends = {e: [exact_point(cones, e, Fraction(f)) for f in (0, 1)] for e in triple}
        sides = [e for e in triple if e != center]
        turns = [
            cross(minus(p, q), d)
            for e in sides
            for p in ends[e]
            for q in ends[center]
            for d in forces
        ]
        assert answer == (min(turns) < 0 < max(turns))
        answers.append(answer)
    assert set(answers) == {True, False}
    chosen = np.random.default_rng(0).permutation(len(edges))[:40]
    for n in chosen:
        assert exists[n] == any_sub_polytope(cones, edges[n].tolist(), int(centers[n]))


def any_sub_polytope(cones: Cones, edges: list[int], center: int) -> bool:
    """Whether one of K0 to K5 has an interior, in coordinates (u_a, u_b, u_c)."""
    d0, d1 = boundary_forces(cones, edges, center)
    a = [exact_point(cones, center, Fraction(f)) for f in (0, 1)]

    def linear(e: int, place: int, d: tuple) -> list[Fraction]:
        """``(p_e - p_a) × d`` as constant and slopes."""
        p = [exact_point(cones, e, Fraction(f)) for f in (0, 1)]
        values = [cross(minus(p[0], a[0]), d), -cross(minus(a[1], a[0]), d), 0, 0]
        values[place] = cross(minus(p[1], p[0]), d)
        return values

    b, c = (e for e in edges if e != center)
    b0, b1, c0, c1 = (linear(e, i, d) for e, i in ((b, 2), (c, 3)) for d in (d0, d1))
    minus_of = {id(v): [-x for x in v] for v in (b0, b1, c0, c1)}

    def left(v: list) -> tuple:
        return row(minus_of[id(v)], strict=True)

    def right(v: list) -> tuple:
        return row(v, strict=True)

    polytopes = [
        [left(b0), left(b1), right(c0), right(c1)],
        [right(b0), right(b1), left(c0), left(c1)],
        [left(b0), right(b1)],
        [left(c0), right(c1)],
        [right(b0), left(b1)],
        [right(c0), left(c1)],
    ]
    return any(solvable(rows + box(3)) for rows in polytopes)


# --- completeness -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
def test_every_grasp_in_force_closure_is_in_a_set(name: str) -> None:
    polygon, friction = SHAPES[name]
    rng = np.random.default_rng(5)
    for kind, m in (("two_finger", 2), ("three_finger", 3)):
        family = build_family(cones_of(name), kind, CLARABEL)
        index = {tuple(e): i for i, e in enumerate(family.functions.edges.tolist())}
        edges = np.sort(rng.integers(0, polygon.n_edges, (3000, m)), axis=1)
        at = rng.random(edges.shape)
        at[::3] = rng.integers(0, 9, at[::3].shape) / 8
        held = is_force_closure(polygon, friction=friction, edges=edges, fractions=at)
        assert held.any()
        rows = np.array([index[tuple(e)] for e in edges[held].tolist()])
        assert family.functions.take(rows).contain(at[held]).all()
        margins = family.functions.take(rows).margins(at[held])
        assert (margins <= family.margins[rows] + 1e-9 * polygon.diameter).all()


@pytest.mark.parametrize("name", ["star", "rough star", "comb", "lattice star", "per edge"])
def test_the_chapters_sets_are_parts_of_the_complete_ones(name: str) -> None:
    cones = cones_of(name)
    triples = build_family(cones, "three_finger", CLARABEL)
    pairs = build_family(cones, "two_finger", CLARABEL)
    complete = dict(
        zip(map(tuple, triples.functions.edges.tolist()), triples.margins.tolist(), strict=True)
    )
    for kind in ("concurrent", "parallel"):
        family = build_family(cones, kind, CLARABEL)
        for edges, margin in zip(family.functions.edges.tolist(), family.margins, strict=True):
            assert margin <= complete[tuple(edges)] + 1e-9 * cones.size
            if kind == "concurrent":
                assert margin == pytest.approx(complete[tuple(edges)], abs=1e-8 * cones.size)
    assert len(pairs.functions) <= len(two_finger_candidates(cones)) == pairs.n_candidates


def test_candidates_are_counted() -> None:
    cones = cones_of("star")
    assert build_family(cones, "concurrent", CLARABEL).n_candidates == len(
        concurrent_candidates(cones)
    )
    assert (build_family(cones, "concurrent", CLARABEL).centers == -1).all()
    parallel = build_family(cones, "parallel", CLARABEL)
    assert (parallel.functions.edges == parallel.centers[:, None]).any(axis=1).all()


# --- options ------------------------------------------------------------------------------------


@pytest.mark.parametrize("presolve", [True, False])
def test_min_margin_keeps_the_larger_margins(presolve: bool) -> None:
    cones = cones_of("rough star")
    everything = build_family(cones, "three_finger", CLARABEL, presolve=presolve)
    limit = float(np.median(everything.margins))
    some = build_family(cones, "three_finger", CLARABEL, presolve=presolve, min_margin=limit)
    kept = everything.margins > limit
    assert 0 < kept.sum() < len(kept)
    np.testing.assert_array_equal(some.functions.edges, everything.functions.edges[kept])
    np.testing.assert_array_equal(some.margins, everything.margins[kept])
    np.testing.assert_array_equal(some.witnesses, everything.witnesses[kept])
    assert len(build_family(cones, "three_finger", CLARABEL, min_margin=1e9)) == 0


def test_progress_is_told() -> None:
    told = []
    build_family(
        cones_of("star"),
        "three_finger",
        CLARABEL,
        progress=lambda what, done, total: told.append((what, done, total)),
    )
    assert told
    what, done, total = told[-1]
    assert what == "three_finger margins"
    assert done == total > 0


def test_no_candidates_is_an_empty_family() -> None:
    cones = Cones.of(rectangle(), 0.5)
    for presolve in (True, False):
        family = build_family(cones, "concurrent", HIGHS, presolve=presolve)
        assert len(family) == family.n_candidates == 0
        assert family.witnesses.shape == (0, 3)


def test_kinds() -> None:
    assert kinds_of("complete") == ("two_finger", "three_finger")
    assert kinds_of("chapter") == ("two_finger", "concurrent", "parallel")
    with pytest.raises(OptionError, match="'all'"):
        kinds_of("all")


# --- pieces as linear sets ----------------------------------------------------------------------


@pytest.mark.parametrize("m", [2, 3])
def test_margins_of_pieces_are_lower_bounds_that_the_best_piece_attains(m: int) -> None:
    cones = cones_of("per edge")
    functions, _ = candidate_functions(cones, "two_finger" if m == 2 else "three_finger")
    functions = functions.take(functions.exists())
    rng = np.random.default_rng(0)
    at = rng.random(functions.edges.shape)
    names = [f"f{i}" for i in range(m)]
    rows = np.argwhere(functions.valid[:, :, None] & functions.valid[:, None, :])
    for measure, own in (
        ("margin", functions.margins(at)),
        ("tolerance", functions.tolerances(at)),
    ):
        of_pieces = piece_sets(functions, rows, names, measure=measure).margins(at[rows[:, 0]])
        best = np.full(len(functions), -np.inf)
        np.maximum.at(best, rows[:, 0], of_pieces)
        np.testing.assert_allclose(best, own, atol=1e-12)


def test_apart_keeps_the_order_on_an_edge() -> None:
    functions = torque_functions(
        Cones.of(rectangle(4, 2), 0.5), np.array([[0, 0, 2], [0, 2, 2], [0, 1, 2]])
    )
    pieces_ = np.array([[0, 0, 1], [1, 0, 1], [2, 0, 1]])
    together = piece_sets(functions, pieces_, ["a", "b", "c"])
    apart = piece_sets(functions, pieces_, ["a", "b", "c"], apart=2.0)
    at = np.array([[0.5, 0.75, 0.4], [0.5, 0.25, 0.5], [0.9, 0.1, 0.5]])
    limits = np.array([(0.75 - 0.5) * 4 / 2, (0.5 - 0.25) * 4 / 2, np.inf])
    np.testing.assert_allclose(apart.margins(at), np.minimum(together.margins(at), limits))
    swapped = at[:, [1, 0, 2]]
    assert apart.margins(swapped)[0] <= -0.5
    assert apart.margins(at[:, [0, 2, 1]])[1] <= -0.5
    np.testing.assert_array_equal(apart.margins(swapped)[2], together.margins(swapped)[2])


def test_positions_instead_of_fractions() -> None:
    functions = torque_functions(Cones.of(rectangle(4, 2), 0.5), np.array([[0, 1, 2]]))
    sets = piece_sets(functions, np.array([[0, 0, 1]]), ["a", "b", "c"], measure="tolerance")
    lengths = functions.lengths[0]
    assert lengths.tolist() == [4, 2, 4]
    at = np.array([[0.25, 0.5, 0.625]])
    moved = in_positions(sets, lengths)
    np.testing.assert_allclose(moved.margins(at * lengths), sets.margins(at))
    np.testing.assert_array_equal(moved.upper[0], lengths)
    assert moved.names == sets.names
