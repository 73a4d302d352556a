"""Double-sided cones and sub-polytopes: the chapter's own forms against the torque functions."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from fourier_motzkin import Row, box, row, solvable
from geometry import (
    GENERAL,
    LATTICE,
    cross,
    exact_point,
    exact_ray,
    lattice_star,
    regular,
    staircase,
    star,
)

import regrasp_lp as rl
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.candidates import concurrent_candidates, parallel_candidates
from regrasp_lp.grasp_sets.collection import GraspSet
from regrasp_lp.grasp_sets.double_cones import contact_pieces, sided_pieces
from regrasp_lp.grasp_sets.families import parallel_functions
from regrasp_lp.grasp_sets.parallel import common_cone_rays, outer_regions
from regrasp_lp.grasp_sets.sweeps import sides_of
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver, maximise_margins
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import torque_functions

NAMES = ("a", "b", "c")
CLARABEL, HIGHS = get_solver("clarabel"), get_solver("highs")


def spread_friction(n: int, seed: int, most: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(1, most + 1, n) / 16


def repeated(sets: LinearSets, index: int, count: int) -> LinearSets:
    return sets.take(np.full(count, index))


# --- double-sided cones -------------------------------------------------------------------------

CONCURRENT = {
    "star 9": (star(9, 1), 0.2),
    "star 7": (star(7, 0), 0.3),
    "regular 7": (regular(7), 0.1),
    "far away": (Polygon(star(9, 1).vertices + np.array([300.0, -200.0])), 0.2),
    "lattice star": (lattice_star(10, 2), 0.25),
    "hexagon": (LATTICE["hexagon"], 0.25),
    "triangle": (LATTICE["triangle"], 0.375),
    "diamond, per edge": (LATTICE["hexagon"], spread_friction(8, 1, 8)),
    "star 9, per edge": (star(9, 1), spread_friction(9, 0, 8)),
}


def concurrent(name: str) -> tuple[Cones, np.ndarray]:
    polygon, friction = CONCURRENT[name]
    cones = Cones.of(polygon, friction)
    edges = concurrent_candidates(cones)
    assert len(edges) >= 1
    return cones, edges[:: max(1, len(edges) // 25)]


@pytest.mark.parametrize("name", CONCURRENT)
def test_eliminated_pieces_cover_the_set(name: str) -> None:
    """Over all sides: a contact set is in a piece iff ``min M < 0 < max M``."""
    cones, edges = concurrent(name)
    pieces = contact_pieces(cones, edges, NAMES)
    assert pieces.rows.shape[0] == 8 * len(edges)
    assert pieces.rows.shape[1] <= 8
    functions = torque_functions(cones, edges)
    rng = np.random.default_rng(0)
    both = np.zeros(2, dtype=int)
    for k in range(40):
        f = rng.random(edges.shape) if k % 2 else rng.integers(0, 5, edges.shape) / 4
        margins = pieces.margins(f.repeat(8, axis=0)).reshape(-1, 8)
        inside = functions.contain(f)
        # (where two contacts coincide, a grasp is on the boundaries of pieces only)
        sure = np.abs(margins).min(axis=1) > 1e-9 * cones.size
        np.testing.assert_array_equal(margins.max(axis=1)[sure] > 0, inside[sure])
        # the interiors of two pieces may overlap, but every one of them is in the set
        both += np.bincount(inside[sure], minlength=2)
        own = functions.margins(f)
        assert (margins.max(axis=1) <= np.maximum(own, 0) + 1e-9 * cones.size).all()
    assert both.min() > 0


@pytest.mark.parametrize("name", CONCURRENT)
def test_the_best_focus_point_has_the_eliminated_margin(name: str) -> None:
    cones, edges = concurrent(name)
    sided, eliminated = sided_pieces(cones, edges, NAMES), contact_pieces(cones, edges, NAMES)
    assert sided.names == (*NAMES, "x", "y")
    rng = np.random.default_rng(1)
    positive = 0
    for number in range(0, len(edges), max(1, len(edges) // 6)):
        for _ in range(6):
            f = rng.random(3)
            these = np.arange(8 * number, 8 * number + 8)
            fixed = sided.take(these).restrict(dict(zip(NAMES, f.tolist(), strict=True)))
            of_q = maximise_margins(fixed, HIGHS)
            of_u = eliminated.take(these).margins(f)
            tolerance = 1e-7 * cones.size
            assert (of_q.margins <= of_u + tolerance).all()
            inside = of_u > tolerance
            np.testing.assert_allclose(of_q.margins[inside], of_u[inside], atol=tolerance)
            positive += inside.sum()
            at = np.column_stack((np.tile(f, (8, 1)), of_q.points))
            np.testing.assert_allclose(sided.take(these).margins(at), of_q.margins, atol=tolerance)
    assert positive > 3


@pytest.mark.parametrize("name", CONCURRENT)
def test_pieces_are_equally_wide_in_both_forms(name: str) -> None:
    cones, edges = concurrent(name)
    edges = edges[:12]
    tolerance = 1e-6 * cones.size
    widths = [
        maximise_margins(make(cones, edges, NAMES), solver).margins
        for make, solver in product((sided_pieces, contact_pieces), (CLARABEL, HIGHS))
    ]
    existing = widths[-1] > tolerance
    assert existing.any()
    for other in widths[:-1]:
        np.testing.assert_allclose(other[existing], widths[-1][existing], atol=tolerance)
        assert (other[~existing] <= tolerance).all()
    functions = torque_functions(cones, edges)
    best = widths[-1].reshape(-1, 8).max(axis=1)
    exists = functions.exists()
    assert (best[~exists] <= tolerance).all()
    assert (best[exists] > -tolerance).all()


def exact_sided_rows(cones: Cones, edges: list[int], sides: tuple[int, ...]) -> list[Row]:
    """``s (q - p(f)) × e_1 > 0`` and ``e_0 × s (q - p(f)) > 0`` over (f_a, f_b, f_c, x, y)."""
    rows = []
    for i, (edge, side) in enumerate(zip(edges, sides, strict=True)):
        a, b = exact_point(cones, edge, Fraction(0)), exact_point(cones, edge, Fraction(1))
        t = b[0] - a[0], b[1] - a[1]
        for ray, s in ((2 * edge, side), (2 * edge + 1, -side)):
            d = exact_ray(cones, ray)
            # s (q - a - f t) × d < 0
            slopes = [Fraction(0)] * 3
            slopes[i] = -s * cross(t, d)
            rows.append(row([-s * cross(a, d), *slopes, s * d[1], -s * d[0]], strict=True))
    return rows


@pytest.mark.parametrize("name", ["lattice star", "hexagon", "triangle", "diamond, per edge"])
def test_elimination_by_fourier_and_motzkin(name: str) -> None:
    """Exact: q eliminated at rational contacts, and pieces that exist at all."""
    cones, edges = concurrent(name)
    edges = edges[:6]
    pieces = contact_pieces(cones, edges, NAMES)
    widths = maximise_margins(pieces, HIGHS).margins
    rng = np.random.default_rng(2)
    for number, triple in enumerate(edges.tolist()):
        functions = torque_functions(cones, np.array([triple]))
        at = rng.integers(0, 5, (6, 3)) / 4
        held = np.zeros(len(at), dtype=bool)
        for side, choice in enumerate(sides_of(3).tolist()):
            rows = exact_sided_rows(cones, triple, tuple(1 - 2 * c for c in choice))
            everywhere = [((*r[:4], 0, 0), s) for r, s in box(3)]
            exists = solvable([*rows, *everywhere])
            if abs(widths[8 * number + side]) > 1e-9:
                assert exists == (widths[8 * number + side] > 0)
            for k, f in enumerate(at):
                fixed = [
                    row(
                        [
                            r[0] + sum(c * Fraction(v) for c, v in zip(r[1:4], f, strict=True)),
                            *r[4:],
                        ],
                        strict=s,
                    )
                    for r, s in rows
                ]
                sees = solvable(fixed)
                margin = pieces.take(np.array([8 * number + side])).margins(f[None])[0]
                if abs(margin) > 1e-9:
                    assert sees == (margin > 0)
                held[k] |= sees
        contained = functions.take(np.zeros(len(at), dtype=int)).contain(at)
        # at exact zeros too, but not where two contacts coincide: their cones meet in one point
        points = [
            [exact_point(cones, e, Fraction(v)) for e, v in zip(triple, f, strict=True)] for f in at
        ]
        apart = np.array([len(set(p)) == 3 for p in points])
        np.testing.assert_array_equal(held[apart], contained[apart])
        assert not held[~apart].any()


def test_double_cones_of_a_set() -> None:
    polygon, friction = CONCURRENT["star 9"]
    seen = 0
    for grasp_set in rl.build_switching_graph(polygon, friction, sets="chapter").sets:
        if grasp_set.kind != "concurrent":
            assert grasp_set.double_cones is None
            continue
        pieces = grasp_set.double_cones
        assert pieces.names == (*grasp_set.names, "x", "y")
        assert 1 <= len(pieces) <= 8
        assert len(pieces) == len(grasp_set.focus_cell)
        best = maximise_margins(pieces, HIGHS)
        assert (best.margins > 0).all()
        assert (np.diff(best.margins) <= 1e-7).all()
        np.testing.assert_allclose(
            pieces.upper[:, :3], grasp_set.torque.lengths.repeat(len(pieces), 0)
        )
        for point, margin in zip(best.points, best.margins, strict=True):
            fractions = np.clip(point[:3] / grasp_set.torque.lengths[0], 0, 1)
            assert grasp_set.torque.contain(fractions[None])[0]
            # every boundary line of a cone is that far from q; the grasp's own margin is no less
            assert grasp_set.torque.margins(fractions[None])[0] >= margin - 1e-7
            assert grasp_set.focus_cell.margins(point[3:]).max() > 0
        assert best.margins[0] == pytest.approx(max(best.margins), abs=1e-7)
        seen += 1
    assert seen > 5


# --- sub-polytopes ------------------------------------------------------------------------------

PARALLEL = {
    "star 13": (star(13, 0), 0.6),
    "star 11": (star(11, 1), 0.3),
    "lattice star": (lattice_star(10, 2), 0.5),
    "comb": (LATTICE["comb"], 0.25),
    "ell": (LATTICE["ell"], 0.75),
    "collinear": (LATTICE["collinear"], 0.5),
    "frame": (LATTICE["frame"], 0.5),
    "staircase": (staircase(2, 4), 1.0),
    "rough": (star(13, 3), 1.5),
    "far away": (Polygon(LATTICE["comb"].vertices + np.array([1000.0, -500.0])), 0.25),
    "per edge": (star(11, 1), spread_friction(11, 5, 20)),
}


def parallel_sets(name: str, count: int = 10) -> list[GraspSet]:
    polygon, friction = PARALLEL[name]
    graph = rl.build_switching_graph(polygon, friction, sets="chapter")
    found = [s for s in graph.sets if s.kind == "parallel"]
    assert found
    return found[:: max(1, len(found) // count)]


@pytest.mark.parametrize("name", PARALLEL)
def test_subpolytopes_cover_the_set(name: str) -> None:
    """Closed, they hold every grasp of it; open, nothing else. The pieces cover it, too."""
    rng = np.random.default_rng(0)
    counts = np.zeros(6, dtype=int)
    both = np.zeros(2, dtype=int)
    for grasp_set in parallel_sets(name):
        six, pieces, torque = grasp_set.subpolytopes, grasp_set.pieces, grasp_set.torque
        assert len(six) == 6
        assert six.names == grasp_set.names
        assert len(pieces) <= 12
        tolerance = 1e-9 * grasp_set.polygon.diameter
        fractions = np.concatenate((rng.random((60, 3)), rng.integers(0, 5, (20, 3)) / 4))
        for f in fractions:
            u = f * torque.lengths[0]
            own = torque.margins(f[None])[0]
            inside = torque.contain(f[None])[0]
            of_six = six.margins(u)
            assert (of_six[of_six > tolerance] > 0).all()
            if (of_six > tolerance).any():
                assert inside
            if inside:
                assert of_six.max() >= -tolerance
            assert of_six.max() <= max(own, 0) / torque.scale.min() * torque.scale.max() + tolerance
            best = pieces.margins(u).max()
            if own > tolerance:
                assert best == pytest.approx(own, abs=tolerance)
            elif own < -tolerance:
                assert best < 0
            counts += of_six > tolerance
            both += [not inside, inside]
    assert both.min() > 0
    assert (counts > 0).sum() >= 2


def test_all_six_subpolytopes_occur() -> None:
    counts = np.zeros(6, dtype=int)
    for name in PARALLEL:
        for grasp_set in parallel_sets(name, 20):
            counts += maximise_margins(grasp_set.subpolytopes, HIGHS).margins > 1e-6
    assert (counts > 0).all(), counts


@pytest.mark.parametrize("name", PARALLEL)
def test_contacts_in_one_outer_region_are_no_grasp(name: str) -> None:
    """Proposition 3.8, from points and the two regions, and both ways."""
    rng = np.random.default_rng(3)
    both = np.zeros(2, dtype=int)
    for grasp_set in parallel_sets(name):
        polygon, center = grasp_set.polygon, grasp_set.center
        tolerance = 1e-9 * polygon.diameter
        slot = grasp_set.edges.index(center)
        others = [i for i in range(3) if i != slot]
        for f in np.concatenate((rng.random((20, 3)), rng.integers(0, 3, (10, 3)) / 2)):
            u = f * grasp_set.torque.lengths[0]
            regions = grasp_set.outer_regions(float(u[slot]))
            assert len(regions) == 2
            edges = np.array(grasp_set.edges)
            p = polygon.points(edges[None], f[None])[0]
            depths = np.stack([regions.margins(p[i]) for i in others])  # contact, side
            if np.abs(depths).min() < tolerance:
                continue
            same = (depths > 0).all(axis=0)
            assert not same.all()
            held = grasp_set.torque.contain(f[None])[0]
            assert held == (not same.any())
            both += [not held, held]
    assert both.min() > 0


@pytest.mark.parametrize("name", PARALLEL)
def test_edges_in_one_outer_region_of_the_union_volume_have_no_set(name: str) -> None:
    """Proposition 3.9, for all candidates: open sets, closed outer regions."""
    polygon, friction = PARALLEL[name]
    cones = Cones.of(polygon, friction)
    edges, centers = parallel_candidates(cones)
    exists = parallel_functions(cones, edges, centers).exists()
    decided = 0
    for triple, center, answer in zip(edges.tolist(), centers.tolist(), exists, strict=True):
        others = [e for e in triple if e != center]
        regions = outer_regions(cones, center, others, np.array([0.0, 1.0]))
        ends = np.concatenate((polygon.edge_starts[others], polygon.edge_ends[others]))
        depths = np.stack([regions.margins(p) for p in ends]).min(axis=0)  # per side
        if np.abs(depths).min() < 1e-9 * polygon.diameter:
            continue
        assert answer == (depths < 0).all()
        decided += 1
    assert decided > 0


def test_outer_regions_of_a_set_are_those_of_its_union_volume() -> None:
    for grasp_set in parallel_sets("comb"):
        union = grasp_set.outer_regions()
        cones = grasp_set.torque.cones
        length = float(cones.lengths[grasp_set.center])
        parts = [grasp_set.outer_regions(u) for u in np.linspace(0, length, 9)]
        points = np.random.default_rng(0).uniform(-3, 8, (40, 2))
        for point in points:
            every = np.stack([part.margins(point) for part in parts])
            np.testing.assert_allclose(union.margins(point), every.min(axis=0), atol=1e-12)
        for position in (-1e-9, length + 1e-9, float("nan")):
            with pytest.raises(OptionError, match="not on the centre edge"):
                grasp_set.outer_regions(position)
        assert grasp_set.outer_regions(0.0).names == ("x", "y")


def test_only_parallel_sets_have_a_common_cone() -> None:
    graph = rl.build_switching_graph(star(9, 1), 0.3, sets="chapter")
    for grasp_set in graph.sets:
        if grasp_set.kind == "parallel":
            continue
        assert grasp_set.common_cone is None
        assert grasp_set.subpolytopes is None
        with pytest.raises(OptionError, match=grasp_set.kind):
            grasp_set.outer_regions()
    complete = rl.build_switching_graph(star(7, 0), 0.3)
    for grasp_set in complete.sets:
        if grasp_set.kind == "three_finger":
            assert grasp_set.focus_cell is None
            assert grasp_set.double_cones is None
            with pytest.raises(OptionError, match="no focus cell"):
                grasp_set.independent_regions((0, 0))


@pytest.mark.parametrize("name", PARALLEL)
def test_common_cones_lie_in_all_three(name: str) -> None:
    """Exact directions of the edges' cones, to rounding; and nothing wider does."""
    polygon, friction = PARALLEL[name]
    cones = Cones.of(polygon, friction)
    edges, centers = parallel_candidates(cones)
    for triple, center in zip(edges.tolist()[::3], centers.tolist()[::3], strict=True):
        others = [e for e in triple if e != center]
        right, left = common_cone_rays(cones, center, others)
        np.testing.assert_allclose(np.hypot(*np.stack((right, left), axis=1)), 1, rtol=1e-14)
        assert right[0] * left[1] - right[1] * left[0] > 0

        def depth(d: np.ndarray, center: int = center, triple: list[int] = triple) -> float:
            turns = []
            for e in triple:
                s = -1 if e == center else 1
                (ax, ay), (bx, by) = s * cones.unit_rays[2 * e : 2 * e + 2]
                turns += [ax * d[1] - ay * d[0], d[0] * by - d[1] * bx]
            return min(turns)

        assert depth(right) == pytest.approx(0, abs=1e-14)
        assert depth(left) == pytest.approx(0, abs=1e-14)
        assert depth(right + left) > 0
        assert depth(right + 1e-6 * np.array([right[1], -right[0]])) < 0
        assert depth(left + 1e-6 * np.array([-left[1], left[0]])) < 0


def test_the_six_end_at_walls_inside_the_set() -> None:
    """Design, section 6: on the way from K0 or K1 into a neighbour their margins fall to 0."""
    walls = 0
    for name in ("star 13", "comb", "lattice star"):
        for grasp_set in parallel_sets(name):
            six, lengths = grasp_set.subpolytopes, grasp_set.torque.lengths[0]
            best = maximise_margins(six, HIGHS)
            for outer, inner in product((0, 1), (2, 3, 4, 5)):
                if min(best.margins[[outer, inner]]) < 1e-3:
                    continue
                one, other = best.points[outer], best.points[inner]
                low, high = 0.0, 1.0
                for _ in range(60):
                    middle = (low + high) / 2
                    at = one + middle * (other - one)
                    low, high = (middle, high) if six.margins(at)[outer] > 0 else (low, middle)
                at = one + low * (other - one)
                own = grasp_set.torque.margins(np.clip(at / lengths, 0, 1)[None])[0]
                if own > 1e-3 and abs(six.margins(at).max()) < 1e-9:
                    walls += 1
                    assert grasp_set.pieces.margins(at).max() == pytest.approx(own, abs=1e-9)
    assert walls > 5


def test_parallel_pieces_are_wider_than_the_six() -> None:
    for grasp_set in parallel_sets("star 13"):
        six = maximise_margins(grasp_set.subpolytopes, HIGHS)
        assert len(grasp_set.pieces) <= 12
        assert grasp_set.margin >= six.margins.max() - 1e-8
        for k in (2, 3, 4, 5):
            if six.margins[k] > 1e-8:
                at = six.points[k]
                assert grasp_set.pieces.margins(at).max() >= six.margins[k] - 1e-8


@pytest.mark.parametrize("name", ["needle", "thin", "nearly_parallel", "regular6"])
@pytest.mark.parametrize("mu", [0.01, 0.4, 0.57])
def test_odd_shapes(name: str, mu: float) -> None:
    """Everything can be asked of every set."""
    graph = rl.build_switching_graph(GENERAL[name], mu, sets="chapter")
    for grasp_set in graph.sets:
        for form in ("focus_cell", "double_cones", "subpolytopes"):
            found = getattr(grasp_set, form)
            assert found is None or len(found) >= 1


def test_outer_regions_refuse_what_is_no_position() -> None:
    polygon = LATTICE["ell"]
    sets = rl.build_switching_graph(polygon, 0.2, sets="chapter").sets
    parallel = next(s for s in sets if s.kind == "parallel")
    for position in ("a", -0.1, 1e9, float("nan")):
        with pytest.raises(rl.OptionError, match="is not on the centre edge"):
            parallel.outer_regions(position)
