"""Focus cells: the same grasps as the torque functions, and regions that keep their promise."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from geometry import (
    GENERAL,
    LATTICE,
    cross,
    exact_point,
    exact_ray,
    lattice_star,
    minus,
    regular,
    sign,
    staircase,
    star,
)
from hypothesis import given, settings
from hypothesis import strategies as st

import regrasp_lp as rl
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.candidates import concurrent_candidates, two_finger_candidates
from regrasp_lp.grasp_sets.collection import GraspSet
from regrasp_lp.grasp_sets.focus import (
    cell_pieces,
    focus_cell,
    independent_regions,
    two_finger_sweeps,
)
from regrasp_lp.grasp_sets.sweeps import Sweeps
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver, maximise_margins
from regrasp_lp.polygon import Polygon
from regrasp_lp.polytopes import corners
from regrasp_lp.torque import torque_functions

HIGHS = get_solver("highs")
CORNERS = {m: list(product((0, 1), repeat=m)) for m in (2, 3)}
SHAPES = {
    **LATTICE,
    **GENERAL,
    "star 12": star(12, 3),
    "regular 12": regular(12),
    "lattice star 10": lattice_star(10, 2),
    "staircase 5": staircase(2, 5),
}


def spread_friction(n: int, seed: int, least: int = 1, most: int = 12) -> np.ndarray:
    """A coefficient per edge in sixteenths."""
    return np.random.default_rng(seed).integers(least, most + 1, n) / 16


def candidates(cones: Cones, m: int) -> np.ndarray:
    return concurrent_candidates(cones) if m == 3 else two_finger_candidates(cones)


def cell_exists(cones: Cones, edges: np.ndarray) -> np.ndarray:
    """Whether the focus cells of candidates have an interior, exactly."""
    of_pairs = edges.shape[1] == 2
    sweeps = two_finger_sweeps(cones, edges) if of_pairs else Sweeps.of_cones(cones)
    return sweeps.any_meet(cell_pieces(edges))


# --- the theorem: a cell has an interior iff the set exists -------------------------------------


@pytest.mark.parametrize("name", SHAPES)
def test_cells_exist_with_their_sets(name: str) -> None:
    polygon = SHAPES[name]
    n = polygon.n_edges
    for m, frictions in (
        (3, [0.01, 0.125, 0.2, 0.25, 0.4, 0.5, 0.57, spread_friction(n, 0)]),
        (2, [0.01, 0.2, 0.5, 1.0, 2.0, 30.0, spread_friction(n, 1, 1, 40)]),
    ):
        for friction in frictions:
            cones = Cones.of(polygon, friction)
            edges = candidates(cones, m)
            expected = torque_functions(cones, edges).exists()
            np.testing.assert_array_equal(cell_exists(cones, edges), expected)


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), of_friction=st.integers(0, 10**6), m=st.sampled_from([2, 3]))
def test_cells_of_random_lattice_polygons(seed: int, of_friction: int, m: int) -> None:
    n = 5 + seed % 8
    polygon = lattice_star(n, seed, 4)
    most = 9 if m == 3 else 40
    cones = Cones.of(polygon, spread_friction(n, of_friction, 1, most))
    edges = candidates(cones, m)
    expected = torque_functions(cones, edges).exists()
    np.testing.assert_array_equal(cell_exists(cones, edges), expected)


def test_both_answers_and_the_limit_between_them_occur() -> None:
    """Candidates on lattices whose closed cell is not empty although the open one is."""
    counts = np.zeros(2, dtype=int)
    marginal = 0
    for polygon, mu, m in product(
        [*(lattice_star(12, k) for k in range(12)), *(staircase(k, 7) for k in range(12))],
        [0.25, 0.5, 1.0],
        [2, 3],
    ):
        cones = Cones.of(polygon, mu)
        functions = torque_functions(cones, candidates(cones, m))
        exists = cell_exists(cones, functions.edges)
        np.testing.assert_array_equal(exists, functions.exists())
        counts += np.bincount(exists, minlength=2)
        low = functions.certain_values(np.zeros(m))
        high = functions.certain_values(np.ones(m))
        least = np.where(functions.valid, low, np.inf).min(axis=1, initial=np.inf)
        most = np.where(functions.valid, high, -np.inf).max(axis=1, initial=-np.inf)
        marginal += np.count_nonzero(~exists & (least <= 0) & (most >= 0))
    assert counts.min() > 100
    assert marginal > 10, marginal


@pytest.mark.parametrize("m", [2, 3])
def test_sides_of_two_contacts_are_opposite(m: int) -> None:
    """Edges that do not cross: at most one of the two pieces of a pair, up to eight of a triple."""
    cones = Cones.of(star(12, 3), 0.3)
    edges = candidates(cones, m)
    edges = edges[torque_functions(cones, edges).exists()]
    most = 0
    for row in edges:
        cell = focus_cell(cones, row)
        most = max(most, len(cell))
        assert len(cell) >= 1
        assert cell.names == ("x", "y")
        widths = maximise_margins(cell, HIGHS).margins
        assert (np.diff(widths) <= 1e-9).all()
        assert (widths > 0).all()
    assert most == 1 if m == 2 else most > 2


# --- points of a cell ---------------------------------------------------------------------------


def sets_with_cells(polygon: Polygon, friction: object) -> list[GraspSet]:
    graph = rl.build_switching_graph(polygon, friction, sets="chapter", switching="focus")
    return [s for s in graph.sets if s.kind != "parallel"]


def points_inside(cell: LinearSets, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points of pieces that are wider than rounding, not too near to their boundaries."""
    size = np.abs(cell.bounds).max()
    found = []
    for piece in cell:
        polygon = corners(piece)[0]
        if len(polygon) < 3:
            continue
        weights = rng.dirichlet(np.ones(len(polygon)), 4 * count)
        points = weights @ polygon
        keep = [q for q in points if piece.margins(q[None])[0] > 1e-6 * size]
        found += keep[:count]
    return np.array(found).reshape(-1, 2)


CASES = [
    ("star 12", 0.2),
    ("star 12", 0.5),
    ("star9", 0.05),
    ("regular7", 0.3),
    ("hexagon", 0.25),
    ("lattice star 10", 0.125),
    ("rectangle", 2.0),
    ("ell", 0.75),
    ("frame", 0.5),
    ("regular 12", 0.01),
    ("star 12", "per edge"),
    ("lattice star 10", "per edge"),
]


@pytest.mark.parametrize(("name", "mu"), CASES)
def test_contacts_in_the_regions_of_a_point_are_grasps(name: str, mu: float | str) -> None:
    polygon = SHAPES[name]
    friction = spread_friction(polygon.n_edges, 2) if isinstance(mu, str) else mu
    rng = np.random.default_rng(0)
    seen = 0
    for grasp_set in sets_with_cells(polygon, friction)[::3]:
        lengths = polygon.edge_lengths[list(grasp_set.edges)]
        for q in points_inside(grasp_set.focus_cell, 2, rng):
            regions = grasp_set.independent_regions(q)
            assert regions.shape == (len(grasp_set.edges), 2)
            assert (regions >= 0).all()
            assert (regions <= lengths[:, None]).all()
            assert (regions[:, 1] > regions[:, 0]).all()
            ends = regions + np.array([1, -1]) * 1e-9 * np.diff(regions, axis=1)
            at = np.concatenate(
                (
                    np.stack([ends[range(len(ends)), c] for c in CORNERS[len(ends)]]),
                    rng.uniform(ends[:, 0], ends[:, 1], (4, len(ends))),
                )
            )
            fractions = at / lengths
            edges = np.tile(grasp_set.edges, (len(at), 1))
            assert rl.is_force_closure(
                polygon, friction=friction, edges=edges, fractions=fractions
            ).all()
            inner = ends / lengths[:, None]
            assert grasp_set.torque.independent(inner[None, :, 0], inner[None, :, 1])[0]
            seen += 1
    assert seen > 3


@pytest.mark.parametrize(("name", "mu"), CASES)
def test_every_grasp_of_a_set_sees_a_common_point(name: str, mu: float | str) -> None:
    """Grasps within rounding of the boundary of their set left aside."""
    polygon = SHAPES[name]
    friction = spread_friction(polygon.n_edges, 2) if isinstance(mu, str) else mu
    rng = np.random.default_rng(1)
    size = polygon.diameter
    seen = 0
    for grasp_set in sets_with_cells(polygon, friction)[::2]:
        m, lengths = len(grasp_set.edges), grasp_set.torque.lengths[0]
        fractions = np.concatenate((rng.random((6, m)), rng.integers(0, 5, (6, m)) / 4))
        many = grasp_set.torque.take(np.zeros(len(fractions), dtype=int))
        good = many.contain(fractions) & (many.margins(fractions) > 1e-7 * size)
        for f in fractions[good]:
            q = focus_point(grasp_set, f * lengths)
            assert grasp_set.focus_cell.margins(q).max() > 0
            regions = grasp_set.independent_regions(q)
            assert (regions[:, 0] <= f * lengths + 1e-9 * size).all()
            assert (regions[:, 1] >= f * lengths - 1e-9 * size).all()
            seen += 1
    assert seen > 5


def focus_point(grasp_set: GraspSet, positions: np.ndarray) -> np.ndarray:
    """The point that is deepest in the double-sided cones, or between two contacts."""
    if len(positions) == 2:
        polygon = grasp_set.polygon
        edges = list(grasp_set.edges)
        t = (polygon.edge_ends - polygon.edge_starts)[edges] / polygon.edge_lengths[edges, None]
        return np.asarray((polygon.edge_starts[edges] + positions[:, None] * t).mean(axis=0))
    at = dict(zip(grasp_set.names, positions.tolist(), strict=True))
    best = maximise_margins(grasp_set.double_cones.restrict(at), HIGHS)
    assert best.margins.max() > 0
    return np.asarray(best.points[best.margins.argmax()])


@pytest.mark.parametrize(("name", "mu"), CASES)
def test_two_finger_grasps_point_along_the_common_cone(name: str, mu: float | str) -> None:
    """``s (p_b - p_a)`` in ``C_a ∩ -C_b`` for the side s of the piece, from exact rays."""
    polygon = SHAPES[name]
    friction = spread_friction(polygon.n_edges, 2) if isinstance(mu, str) else mu
    cones = Cones.of(polygon, friction)
    edges = two_finger_candidates(cones)
    rng = np.random.default_rng(3)
    for row in edges[:: max(1, len(edges) // 15)]:
        exists = torque_functions(cones, row[None]).exists()[0]
        pieces = cell_pieces(row[None])[0]
        sides = two_finger_sweeps(cones, row[None]).meet(pieces)
        assert sides.sum() == exists
        for f, g in rng.integers(0, 9, (12, 2)) / 8:
            p, q = (
                exact_point(cones, int(e), Fraction(v)) for e, v in zip(row, (f, g), strict=True)
            )
            turns = [
                (
                    sign(cross(exact_ray(cones, 2 * e), v)),
                    sign(cross(v, exact_ray(cones, 2 * e + 1))),
                )
                for e, v in ((int(row[0]), minus(q, p)), (int(row[1]), minus(p, q)))
            ]
            held = torque_functions(cones, row[None]).contain(np.array([[f, g]]))[0]
            same = [all(t == s for pair in turns for t in pair) for s in (1, -1)]
            assert held == any(same)
            if held:
                assert sides[same.index(True)]


# --- what the chapter's literal cell would hold -------------------------------------------------


def literal_regions(cones: Cones, pair: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Where the whole double-sided cone ``±(C_a ∩ -C_b)`` at q meets the two edges."""
    return np.asarray(
        independent_regions(cones, pair, EVERYWHERE, q) / cones.lengths[pair][:, None]
    )


EVERYWHERE = LinearSets(
    ("x", "y"),
    np.array([[[1.0, 0.0]]]),
    np.ones((1, 1)),
    np.full((1, 1), 1e9),
    np.full((1, 2), -1e9),
    np.full((1, 2), 1e9),
)


def test_the_literal_two_finger_cell_holds_points_without_a_grasp() -> None:
    """Section 3.3.1.2 draws the double cone on both edges: both contacts may be on one side of q.

    Two sides of a rectangle that are not opposite within the common cone have no grasp, but far
    above both there are points that see either.
    """
    polygon, friction = LATTICE["collinear"], 0.2
    cones, pair = Cones.of(polygon, friction), np.array([0, 4])
    assert pair.tolist() in two_finger_candidates(cones).tolist()
    sweeps = two_finger_sweeps(cones, pair[None])
    assert not cell_exists(cones, pair[None])[0]
    assert not sweeps.meet(np.array([[0, 2], [1, 3]])).any()  # on opposite sides of q
    assert sweeps.meet(np.array([[0, 3], [1, 2]])).all()  # on the same side
    regions = literal_regions(cones, pair, np.array([1.9, 6.0]))
    assert (regions[:, 1] - regions[:, 0] > 0.1).all()
    f = np.random.default_rng(0).uniform(regions[:, 0], regions[:, 1], (50, 2))
    held = rl.is_force_closure(
        polygon, friction=friction, edges=np.tile(pair, (50, 1)), fractions=f
    )
    assert not held.any()


# --- invariances --------------------------------------------------------------------------------

MOVES = {
    "translation": (lambda v: v + 1024.0, 1.0),
    "far translation": (lambda v: v + 2.0**30, 1.0),
    "smaller": (lambda v: v * 2.0**-10, 2.0**-10),
    "tiny": (lambda v: v * 2.0**-30, 2.0**-30),
    "huge": (lambda v: v * 2.0**30, 2.0**30),
}


@pytest.mark.parametrize("move", MOVES)
def test_cells_move_with_the_object(move: str) -> None:
    vertices = np.round(star(9, 1).vertices * 2**10) / 2**10
    transform, scale = MOVES[move]
    originals = sets_with_cells(Polygon(vertices), 0.3)
    moved = sets_with_cells(Polygon(transform(vertices)), 0.3)
    assert [s.edges for s in moved] == [s.edges for s in originals]
    for one, other in zip(originals, moved, strict=True):
        assert len(one.focus_cell) == len(other.focus_cell)
        widest = maximise_margins(one.focus_cell, HIGHS)
        q = transform(widest.points)
        again = other.focus_cell.margins(q) / scale
        np.testing.assert_allclose(again, widest.margins, atol=1e-5)
        np.testing.assert_allclose(
            other.independent_regions(q[0]) / scale,
            one.independent_regions(widest.points[0]),
            atol=1e-5,
        )


@pytest.mark.parametrize("mu", [1.0, 3.0])
def test_cells_far_longer_than_wide(mu: float) -> None:
    """An object of aspect ratio 1e6 has cells of 1e6 and more."""
    for grasp_set in sets_with_cells(GENERAL["needle"], mu):
        assert len(grasp_set.focus_cell) == 1


def test_points_that_are_none() -> None:
    grasp_set = sets_with_cells(star(9, 1), 0.3)[0]
    for point in ((0.0,), (0.0, np.nan), (0.0, np.inf), (0.0, 0.0, 0.0), ((0.0, 0.0),)):
        with pytest.raises(rl.errors.OptionError, match="pair of coordinates"):
            grasp_set.independent_regions(point)
    with pytest.raises(rl.errors.OptionError, match="not inside the focus cell"):
        grasp_set.independent_regions((1e6, 1e6))
    for point in ("here", ("a", "b"), None):
        with pytest.raises(rl.errors.OptionError):
            grasp_set.independent_regions(point)
