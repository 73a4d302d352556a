"""Quality over sets: largest regions, best grasps, maps and where forces meet."""

from __future__ import annotations

from itertools import combinations_with_replacement, product
from typing import Any

import numpy as np
import pytest
from conftest import star_polygon
from geometry import rectangle, unit_square
from matplotlib.path import Path as MplPath
from regrasps import PARTS, random_grasps
from scipy.optimize import linprog

import regrasp_lp as rl
from regrasp_lp import quality
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.double_cones import double_cones
from regrasp_lp.quality.best_grasps import inside
from regrasp_lp.torque import torque_functions

LINEAR = ("margin", "tolerance")
SEARCHED = (
    "epsilon",
    "hull_volume",
    "load_factor",
    "required_friction",
    "squeezing_force",
    "focus_distance",
)


@pytest.fixture(scope="module")
def chapter() -> rl.SwitchingGraph:
    return rl.build_switching_graph(star_polygon(12, 3), 0.2, sets="chapter")


@pytest.fixture(scope="module")
def ell() -> rl.SwitchingGraph:
    return rl.build_switching_graph(PARTS["ell"](), 0.4)


# --- largest independent contact regions --------------------------------------------------------


@pytest.mark.parametrize("name", ["square", "ell", "tee", "star 8", "nut"])
@pytest.mark.parametrize("contacts", [2, 3])
def test_no_grasp_on_a_grid_has_larger_regions(name: str, contacts: int) -> None:
    """Widths are twice the tolerance; it changes by no more than contacts move."""
    polygon, mu, steps = PARTS[name](), 0.4, 18 // contacts
    found = quality.largest_regions(polygon, mu, contacts=contacts)
    assert found is not None
    assert -1e-12 <= found.gap <= 1e-8 * polygon.diameter
    assert found.width == found.widths.min()
    at = (np.arange(steps) + 0.5) / steps
    grid = np.stack(np.meshgrid(*[at] * contacts), axis=-1).reshape(-1, contacts)
    best = -np.inf
    for edges in combinations_with_replacement(range(polygon.n_edges), contacts):
        if len(set(edges)) < contacts:
            continue  # there regions must not overlap: below
        every = np.broadcast_to(edges, grid.shape)
        tolerances = quality.tolerance(polygon, friction=mu, edges=every, fractions=grid)
        best = max(best, 2 * tolerances.max())
    assert best <= found.bound + 1e-9
    if len(set(found.grasp.edges.tolist())) == contacts:
        coarse = polygon.edge_lengths[found.grasp.edges].max() / steps
        assert found.width <= best + coarse + 1e-9


@pytest.mark.parametrize("widths", ["least", "total"])
@pytest.mark.parametrize("name", ["ell", "comb", "star 12", "plate"])
def test_contacts_anywhere_in_the_regions_are_in_force_closure(name: str, widths: str) -> None:
    polygon = PARTS[name]()
    found = quality.largest_regions(polygon, 0.4, widths=widths)
    assert found is not None
    edges, regions = found.grasp.edges, found.regions
    places = np.array(list(product(*regions)))
    rng = np.random.default_rng(1)
    inner = regions[:, 0] + rng.random((50, len(edges))) * found.widths
    positions = np.clip(np.vstack((places, inner)), 0, polygon.edge_lengths[edges])
    # ends in positions are those in fractions but for rounding
    positions += 1e-9 * (found.grasp.positions - positions)
    every = np.broadcast_to(edges, positions.shape)
    closed = rl.is_force_closure(polygon, friction=0.4, edges=every, positions=positions)
    assert closed.all()
    for i, j in product(range(len(edges)), repeat=2):
        if i < j and edges[i] == edges[j]:
            assert regions[i, 1] <= regions[j, 0]


@pytest.mark.parametrize("widths", ["least", "total"])
def test_largest_regions_are_those_of_every_program(widths: str) -> None:
    """All pieces of all sets, one program each, by another solver."""
    for polygon, mu in ((rectangle(5, 3), 0.3), (star_polygon(5, 1), 0.5)):
        cones = Cones.of(polygon, mu)
        best = 0.0
        for contacts in (2, 3):
            for edges in combinations_with_replacement(range(polygon.n_edges), contacts):
                best = max(best, widest_of(cones, edges, widths))
        found = quality.largest_regions(polygon, mu, widths=widths)
        assert found is not None
        assert found.width == pytest.approx(best, rel=1e-7)


def widest_of(cones: Cones, edges: tuple[int, ...], widths: str) -> float:
    """The best box on one combination, from the corners' positions u and v and the width."""
    functions, m = torque_functions(cones, np.array([edges])), len(edges)
    if not functions.exists()[0]:
        return 0.0
    lengths, slopes = functions.lengths[0], functions.slopes[0] / functions.lengths[0]
    best = 0.0
    columns = np.flatnonzero(functions.valid[0])
    for j, k in product(columns, columns):
        rows = [np.r_[-slopes[k], np.zeros(m), 0], np.r_[np.zeros(m), slopes[j], 0]]
        bounds = [functions.offsets[0, k], -functions.offsets[0, j]]
        for i in range(m):
            row = np.zeros(2 * m + 1)
            row[[i, m + i, -1]] = 1, -1, 1 if widths == "least" else 0
            rows.append(row)
            bounds.append(0)
            if i + 1 < m and edges[i] == edges[i + 1]:
                row = np.zeros(2 * m + 1)
                row[[m + i, i + 1]] = 1, -1
                rows.append(row)
                bounds.append(0)
        if widths == "total":
            rows.append(np.r_[np.ones(m), -np.ones(m), 1])
            bounds.append(0)
        limits = [(0, length) for length in (*lengths, *lengths)] + [(0, None)]
        cost = np.r_[np.zeros(2 * m), -1]
        program = linprog(cost, A_ub=np.array(rows), b_ub=bounds, bounds=limits)
        best = max(best, 0.0 if program.fun is None else -program.fun)
    return best


def test_no_focus_point_gives_larger_regions(chapter: rl.SwitchingGraph) -> None:
    """Ponce and Faverjon: regions of one set that all see one point through their cones."""
    polygon = chapter.polygon
    seen = 0
    for grasp_set in [s for s in chapter.sets if s.kind == "concurrent"][::7]:
        ours = quality.largest_regions(polygon, 0.2, edges=grasp_set.edges)
        assert ours is not None
        lengths = polygon.edge_lengths[list(grasp_set.edges)]
        theirs = 0.0
        pieces = double_cones(chapter.sets[0].torque.cones.whole, np.array(grasp_set.edges), "abc")
        for rows, bounds in zip(pieces.rows, pieces.bounds, strict=True):
            # the cones see q from both ends of every region: rows over (first, q) and (last, q)
            first = np.hstack((rows[:, :3], np.zeros((len(rows), 3)), rows[:, 3:]))
            last = np.hstack((np.zeros((len(rows), 3)), rows[:, :3], rows[:, 3:]))
            widths = np.hstack((np.diag(lengths), -np.diag(lengths), np.zeros((3, 2))))
            table = np.vstack((first, last, widths))
            column = np.r_[np.zeros(2 * len(rows)), np.ones(3)]
            limits = [(0, 1)] * 6 + [(None, None)] * 2 + [(0, None)]
            program = linprog(
                np.r_[np.zeros(8), -1],
                A_ub=np.column_stack((table, column)),
                b_ub=np.r_[bounds, bounds, np.zeros(3)],
                bounds=limits,
            )
            theirs = max(theirs, 0.0 if program.fun is None else -program.fun)
        assert ours.bound >= theirs - 1e-9
        seen += theirs > 0
    assert seen > 2


def test_regions_by_hand() -> None:
    """Edges 3 apart, μ = 1/2: two regions may be wide by 1.5 in all, whatever they share."""
    block = rectangle(8, 3)
    facing = quality.largest_regions(block, 0.5, edges=[0, 2])
    assert facing is not None
    assert facing.width == pytest.approx(1.5)
    total = quality.largest_regions(block, 0.5, edges=[2, 0], widths="total")
    assert total is not None
    assert total.width == pytest.approx(3.0)
    best = quality.largest_regions(block, 0.5, contacts=2)
    assert best is not None
    assert (best.grasp.edges.tolist(), round(best.width, 9)) == ([1, 3], 3.0)
    more = quality.largest_regions(block, 0.5)
    assert more is not None
    assert more.width >= best.width
    triangle = rl.Polygon([(0, 0), (1, 0), (0.5, 0.1)])
    assert quality.largest_regions(triangle, 0.01, contacts=2) is None
    assert quality.largest_regions(block, 0.5, edges=[0, 0]) is None


def test_wrong_arguments_of_largest_regions() -> None:
    square = unit_square()
    with pytest.raises(rl.OptionError, match="contacts must be"):
        quality.largest_regions(square, 0.5, contacts=4)
    with pytest.raises(rl.OptionError, match="widths must be"):
        quality.largest_regions(square, 0.5, widths="most")
    with pytest.raises(rl.OptionError, match="2 or 3 contacts"):
        quality.largest_regions(square, 0.5, edges=[1])
    for edges in (5, "12"):
        with pytest.raises(rl.OptionError, match="edges has to be a list of two or three edges"):
            quality.largest_regions(square, 0.5, edges=edges)
    with pytest.raises(rl.ContactError):
        quality.largest_regions(square, 0.5, edges=[1, 9])


# --- where forces meet --------------------------------------------------------------------------


@pytest.mark.parametrize("mu", [0.2, 0.6, 1.5])
def test_focus_points_are_the_nearest(mu: float) -> None:
    """Random points through which forces balance: none is nearer, some are about as near."""
    polygon, rng = PARTS["ell"](), np.random.default_rng(2)
    cones = Cones.of(polygon, mu)
    near = 0
    grasps = list(random_grasps(polygon, mu, rng, 8, 3))
    for grasp in grasps:
        resolved = polygon.resolve(grasp)
        distance = quality.focus_distance(polygon, grasp, mu)
        contacts = polygon.points(resolved.edges, resolved.fractions) - polygon.centroid
        size = polygon.diameter
        angles, radii = rng.uniform(0, 2 * np.pi, 8_000), rng.random(8_000)
        reach = distance + radii**2 * 0.1 * size
        reach[:2_000] = distance * radii[:2_000]
        points = reach[:, None] * np.stack((np.cos(angles), np.sin(angles)), axis=1)
        good = balanced_through(points, contacts, cones.unit_rays.reshape(-1, 2, 2)[resolved.edges])
        assert not good[reach < distance - 1e-9].any()
        near += bool(good[reach < distance + 0.05 * size].any())
    assert near >= len(grasps) - 2  # but where the nearest is on a thin part


def balanced_through(points: np.ndarray, contacts: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Whether forces in the cones that go through points balance, by the null space."""
    towards = contacts - points[:, None]
    _, _, basis = np.linalg.svd(towards.transpose(0, 2, 1))
    forces = basis[:, 2, :, None] * towards
    found = np.zeros(len(points), dtype=bool)
    for sign in (1, -1):
        solved = np.linalg.solve(rays.transpose(0, 2, 1)[None], sign * forces[..., None])[..., 0]
        found |= (solved >= 0).all(axis=(1, 2))
    return found


def test_focus_of_two_is_their_line() -> None:
    polygon, rng = PARTS["tee"](), np.random.default_rng(3)
    for grasp in random_grasps(polygon, 0.5, rng, 20, 2):
        resolved = polygon.resolve(grasp)
        p, q = polygon.points(resolved.edges, resolved.fractions)
        arm, along = polygon.centroid - p, q - p
        off = abs(arm[0] * along[1] - arm[1] * along[0]) / np.hypot(*along)
        assert quality.focus_distance(polygon, grasp, 0.5) == pytest.approx(off, abs=1e-12)


def test_focus_points_are_in_the_focus_cell(chapter: rl.SwitchingGraph) -> None:
    """The cell is that of all grasps of a set: its distance is a lower bound."""
    polygon, rng = chapter.polygon, np.random.default_rng(4)
    for grasp_set in [s for s in chapter.sets if s.kind == "concurrent"][::9]:
        distance = quality.focus_distance(polygon, grasp_set.witness, 0.2)
        cell = grasp_set.focus_cell
        ways = rng.normal(size=(500, 2))
        ways /= np.hypot(*ways.T)[:, None]
        around = polygon.centroid + ways * distance * (1 + 1e-6)
        margins = [cell.margins(np.tile(p, (len(cell), 1))).max() for p in around]
        assert max(margins) > -0.05 * polygon.diameter


# --- the best of a set --------------------------------------------------------------------------


@pytest.mark.parametrize("metric", LINEAR)
def test_best_is_proved_and_not_beaten(
    metric: str, ell: rl.SwitchingGraph, chapter: rl.SwitchingGraph
) -> None:
    rng = np.random.default_rng(5)
    kinds = set()
    for graph, mu in ((ell, 0.4), (chapter, 0.2)):
        for grasp_set in graph.sets[:: max(1, len(graph.sets) // 12)]:
            kinds.add(grasp_set.kind)
            found = quality.best(grasp_set, metric)
            assert found.proved
            assert found.bound - found.value <= 1e-7 * graph.polygon.diameter
            assert found.value >= getattr(rl, metric)(graph.polygon, grasp_set.witness, mu) - 1e-9
            if metric == "margin" and grasp_set.kind != "parallel":
                assert found.value == pytest.approx(grasp_set.margin, rel=1e-7)
            edges = np.tile(grasp_set.edges, (400, 1))
            fractions = rng.random(edges.shape)
            given = {"friction": mu, "edges": edges, "fractions": fractions}
            values = getattr(rl, metric)(graph.polygon, **given)
            held = inside(grasp_set, fractions)
            assert (values[held] <= found.bound + 1e-9).all()
    assert kinds >= {"two_finger", "three_finger", "concurrent", "parallel"}


def test_best_heeds_the_limits_of_a_hand() -> None:
    """The best of all grasps within reach, which is not the best of all."""
    hand = rl.Hand(max_span=3.2, edge_clearance=0.2, reachable={0: (0.5, 2.0)})
    polygon = PARTS["ell"]()
    limited = rl.build_switching_graph(polygon, 0.4, hand=hand)
    rng = np.random.default_rng(6)
    for grasp_set in limited.sets[:: max(1, len(limited.sets) // 8)]:
        for metric in LINEAR:
            found = quality.best(grasp_set, metric)
            grasp = polygon.resolve(found.grasp)
            points = polygon.points(grasp.edges, grasp.fractions)
            apart = np.hypot(*(points[:, None] - points[None]).T)
            assert apart.max() <= 3.2 * (1 + 1e-9)
            lengths = polygon.edge_lengths[grasp.edges]
            assert (grasp.positions >= 0.2 - 1e-9).all()
            assert (grasp.positions <= lengths - 0.2 + 1e-9).all()
            fractions = rng.random((300, len(lengths)))
            edges = np.tile(grasp_set.edges, (300, 1))
            given = {"friction": 0.4, "edges": edges, "fractions": fractions}
            values = getattr(rl, metric)(polygon, **given)
            held = inside(grasp_set, fractions)
            assert (values[held] <= found.bound + 1e-9).all()


@pytest.mark.parametrize("metric", SEARCHED)
def test_search_is_not_beaten_by_chance(metric: str, ell: rl.SwitchingGraph) -> None:
    rng = np.random.default_rng(7)
    for grasp_set in (ell.sets[0], ell.sets[-1]):
        found = quality.best(grasp_set, metric)
        assert (found.bound is None) == (metric != "epsilon")
        assert found.grasp in grasp_set
        assert found.value == getattr(quality, metric)(ell.polygon, found.grasp, 0.4)
        assert quality.best(grasp_set, getattr(quality, metric)).value == found.value
        edges = np.tile(grasp_set.edges, (600, 1))
        given = {"friction": 0.4, "edges": edges, "fractions": rng.random(edges.shape)}
        values = getattr(quality, metric)(ell.polygon, **given)
        closed = rl.is_force_closure(ell.polygon, **given)
        if metric in ("required_friction", "squeezing_force", "focus_distance"):
            assert (values[closed] >= found.value - 1e-6).all()
        else:
            assert (values[closed] <= found.value + 1e-6).all()


@pytest.mark.parametrize("forces", ["sum", "each"])
def test_epsilon_of_a_set_is_bounded(forces: str, ell: rl.SwitchingGraph) -> None:
    """By all grasps at random, and by the closed form where forces alone limit it."""
    rng, mu = np.random.default_rng(8), 0.4
    for grasp_set in (ell.sets[0], ell.sets[-1]):
        found = quality.best(grasp_set, "epsilon", forces=forces)
        edges = np.tile(grasp_set.edges, (2000, 1))
        given = {"friction": mu, "edges": edges, "fractions": rng.random(edges.shape)}
        values = quality.epsilon(ell.polygon, forces=forces, **given)
        assert values.max() <= found.bound
        assert found.value <= found.bound <= 1.25 * found.value
    block = rl.build_switching_graph(rectangle(8, 3), 0.3)
    long = next(s for s in block.sets if s.edges == (1, 3, 3))
    held = quality.best(long, "epsilon", torque_scale=0.5)
    assert held.value == pytest.approx(0.3)  # no force sideways is larger than μ
    assert held.proved


def places_of(grasp: rl.Grasp) -> dict[str, np.ndarray]:
    return {"edges": grasp.edges[None], "fractions": grasp.fractions[None]}


def test_metrics_by_name_function_or_of_ones_own(ell: rl.SwitchingGraph) -> None:
    grasp_set = ell.sets[0]

    def near_the_start(polygon, *, friction, edges, fractions):
        return -np.asarray(fractions).sum(axis=1)

    found = quality.best(grasp_set, near_the_start)
    assert found.metric == "near_the_start"
    assert found.value == near_the_start(ell.polygon, friction=0.4, **places_of(found.grasp))[0]
    for name in ("margin", "tolerance", "epsilon"):
        near_the_start.__name__ = name
        same = quality.best(grasp_set, near_the_start)
        assert (same.value, same.bound) == (found.value, None)  # theirs, not ours of this name
    with pytest.raises(rl.OptionError, match='"margin", "tolerance"'):
        quality.best(grasp_set, "beauty")
    with pytest.raises(rl.OptionError, match="forces"):
        quality.best(grasp_set, "epsilon", forces="all")
    with pytest.raises(rl.OptionError, match="margin has no option 'bogus': it has no options"):
        quality.best(grasp_set, "margin", bogus=1)
    with pytest.raises(rl.OptionError, match="its options are forces, torque_scale"):
        quality.best(grasp_set, quality.epsilon, friction=0.3)


# --- maps ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("metric", [*LINEAR, *SEARCHED])
def test_maps_over_contacts(metric: str, ell: rl.SwitchingGraph) -> None:
    pair = next(s for s in ell.sets if s.kind == "two_finger")
    triple = next(s for s in ell.sets if s.kind == "three_finger")
    for grasp_set in (pair, triple):
        found = quality.quality_map(grasp_set, metric, samples=13)
        assert found.values.shape == (len(found.y), len(found.x)) == found.within.shape
        row, column = len(found.y) // 3, len(found.x) // 2
        grasp = found.grasp(row, column)
        at = dict(zip(grasp_set.names, grasp.positions.tolist(), strict=True))
        assert at[found.names[0]] == pytest.approx(found.x[column])
        assert at[found.names[1]] == pytest.approx(found.y[row])
        assert all(at[name] == pytest.approx(value) for name, value in found.fixed.items())
        value = getattr(quality, metric)(ell.polygon, grasp, 0.4)
        assert found.values[row, column] == pytest.approx(value, rel=1e-9)
        for i, j in product(range(0, len(found.y), 3), range(0, len(found.x), 3)):
            at = found.grasp(i, j)
            ordered = len(set(at.edges)) == len(at) or at.positions[0] <= at.positions[1]
            if np.abs(rl.margin(ell.polygon, at, 0.4)) > 1e-9:
                assert found.within[i, j] == (ordered and at in grasp_set)
        if found.best is not None:
            seen = found.values[found.within]
            least = metric in ("required_friction", "squeezing_force", "focus_distance")
            assert found.values[found.best] == pytest.approx(seen.min() if least else seen.max())


def test_maps_over_focus_cells(chapter: rl.SwitchingGraph) -> None:
    seen = set()
    for grasp_set in chapter.sets[:: len(chapter.sets) // 30]:
        if grasp_set.focus_cell is None:
            continue
        found = quality.quality_map(grasp_set, "margin", over="focus", samples=12)
        assert (np.isnan(found.values) == ~found.within).all()
        assert (found.values[found.within] > 0).all()
        for row, column in np.argwhere(found.within)[::7]:
            point = found.x[column], found.y[row]
            middles = grasp_set.independent_regions(point).mean(axis=1)
            assert np.allclose(found.grasp(row, column).positions, middles, atol=1e-9)
            seen.add(grasp_set.kind)
    assert seen == {"concurrent", "two_finger"}


def test_maps_are_frozen_and_drawn(ell: rl.SwitchingGraph, chapter: rl.SwitchingGraph) -> None:
    concurrent = next(s for s in chapter.sets if s.kind == "concurrent")
    for found in (
        quality.quality_map(ell.sets[0], "epsilon", samples=15),
        quality.quality_map(ell.sets[0], "required_friction", samples=15),
        quality.quality_map(concurrent, "margin", over="focus", samples=25),
    ):
        with pytest.raises(ValueError, match="read-only"):
            found.values[0, 0] = 1.0
        drawn = found.plot()
        assert_coloured_where_it_is_sampled(found, drawn)
        row, column = found.best
        assert drawn.best.get_xydata().tolist() == [[found.x[column], found.y[row]]]
        assert found.metric.name in drawn.scale.ax.get_ylabel()
        width, height = drawn.figure.get_size_inches()
        box = drawn.figure.get_tightbbox(drawn.figure.canvas.get_renderer())
        assert (box.min >= -0.01).all()
        assert box.max[0] <= width + 0.01
        assert box.max[1] <= height + 0.01
        assert drawn._repr_png_()[:4] == b"\x89PNG"


def assert_coloured_where_it_is_sampled(found: quality.QualityMap, drawn: Any) -> None:
    """Samples of the set in their colours; of a focus cell up to its boundary, and no farther."""
    shown = drawn.mesh.get_array()
    assert (shown[found.within] == found.values[found.within]).all()
    if found.over == "contacts":
        assert drawn.cell is None
        assert (np.ma.getmaskarray(shown) == ~found.within).all()
        return
    assert not np.ma.getmaskarray(shown).any()
    assert not found.within.all()
    points = np.stack(np.meshgrid(found.x, found.y), axis=-1).reshape(-1, 2)
    rings = drawn.cell.get_path().to_polygons()
    cell = np.any([MplPath(ring).contains_points(points) for ring in rings], axis=0)
    # samples on the boundary itself may be either
    assert (cell != found.within.ravel()).mean() < 0.05
    for artist in (drawn.mesh, drawn.levels):
        path, transform = artist.get_clip_path().get_transformed_path_and_affine()
        ends = drawn.cell.get_transform().transform_path(drawn.cell.get_path())
        assert transform.transform_path(path).vertices == pytest.approx(ends.vertices)
    edges = ", ".join(map(str, found.grasp_set.edges))
    assert drawn.ax.get_title("left") == f"margin over the focus cell of edges {edges}"


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_metrics_that_are_not_finite(value: float, ell: rl.SwitchingGraph) -> None:
    """The best is a grasp of the set still, and never one of which nothing is known."""

    def beside(polygon, *, friction, edges, fractions):
        return np.where(fractions[:, 0] < 0.5, value, fractions[:, 0])

    grasp_set = ell.sets[0]
    found = quality.best(grasp_set, beside)
    assert found.grasp in grasp_set
    row, column = quality.quality_map(grasp_set, beside, samples=9).best
    best = quality.quality_map(grasp_set, beside, samples=9).grasp(row, column)
    for grasp in (found.grasp, best):
        assert (grasp.fractions[0] < 0.5) == (value == np.inf)


def test_maps_of_a_section(ell: rl.SwitchingGraph) -> None:
    triple = next(s for s in ell.sets if s.kind == "three_finger" and len(set(s.edges)) == 3)
    first, *others = triple.names
    found = quality.quality_map(triple, samples=9, fixed={first: 0.5})
    assert found.names == tuple(others)
    assert dict(found.fixed) == {first: 0.5}


def test_wrong_arguments_of_maps(ell: rl.SwitchingGraph, chapter: rl.SwitchingGraph) -> None:
    triple = next(s for s in ell.sets if s.kind == "three_finger")
    with pytest.raises(rl.OptionError, match="no focus cell"):
        quality.quality_map(triple, over="focus")
    with pytest.raises(rl.OptionError, match="over must be"):
        quality.quality_map(triple, over="edges")
    with pytest.raises(rl.OptionError, match="samples must be"):
        quality.quality_map(triple, samples=1)
    with pytest.raises(rl.OptionError, match="fixed has to name 1"):
        quality.quality_map(triple, fixed={})
    with pytest.raises(rl.OptionError, match="is not on its edge"):
        quality.quality_map(triple, fixed={triple.names[0]: -1.0})
    concurrent = next(s for s in chapter.sets if s.kind == "concurrent")
    with pytest.raises(rl.OptionError, match="nothing to fix"):
        quality.quality_map(concurrent, over="focus", fixed={"x": 1.0})
