"""Pictures of focus cells, switches at a focus point and common cones: what is drawn is true."""

from __future__ import annotations

import math
from functools import cache

import matplotlib
import numpy as np
import pytest
from conftest import REPOSITORY
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.path import Path

import regrasp_lp as rl
from regrasp_lp.plotting import (
    palette,
    plot_common_cone,
    plot_cones_at_one_point,
    plot_focus_cell,
    plot_focus_switch,
    plot_union_volume,
)
from regrasp_lp.plotting.frame import OwnFigure

TEN_DEGREES = math.tan(math.radians(10))
NAMES = ("two_hole_plate", "hex_nut", "star_15", "star_25", "wedge")


@cache
def graph_of(name: str, friction: float = TEN_DEGREES) -> rl.SwitchingGraph:
    file = "stars" if name.startswith("star") else "workpieces"
    objects = {p.name: p for p in rl.read_polygons(REPOSITORY / "models" / f"{file}.geojson")}
    return rl.build_switching_graph(objects[name], friction, sets="chapter", switching="focus")


def some(name: str, kind: str, count: int = 6) -> list[rl.GraspSet]:
    """Sets of a kind, from the least margin to the largest."""
    sets = graph_of(name).sets
    of_kind = np.flatnonzero(kinds_of(name) == kind)
    found = of_kind[np.argsort(sets.margins[of_kind], kind="stable")]
    chosen = np.linspace(0, len(found) - 1, min(count, len(found))).round().astype(int)
    return [sets[int(i)] for i in found[chosen]]


@cache
def kinds_of(name: str) -> np.ndarray:
    sets = graph_of(name).sets
    return np.repeat([family.kind for family in sets.families], np.diff(sets.offsets))


@cache
def planar() -> list[rl.GraspSet]:
    return [s for name in NAMES for kind in ("concurrent", "two_finger") for s in some(name, kind)]


@cache
def parallel() -> list[rl.GraspSet]:
    return [s for name in NAMES for s in some(name, "parallel", 4)]


# Each is drawn once, and looked at by several tests.
drawn_cell = cache(plot_focus_cell)
drawn_cone = cache(plot_common_cone)


@cache
def drawn_switch(name: str, first: int, second: int) -> object:
    return plot_focus_switch(graph_of(name), first, second)


def positions(polygon: rl.Polygon, edge: int, line: object) -> np.ndarray:
    """Return where the points of a drawn line are along their edge, on which they are."""
    from_start = line.get_xydata() - polygon.edge_starts[edge]
    assert from_start @ polygon.normals[edge] == pytest.approx(0, abs=1e-9 * polygon.diameter)
    return from_start @ polygon.tangents[edge]


def covers(patch: object, points: np.ndarray) -> np.ndarray:
    """Whether some ring of a path has a point inside, of each point."""
    rings = [Path(ring) for ring in patch.get_path().to_polygons()]
    inside = [ring.contains_points(np.atleast_2d(points)) for ring in rings]
    return np.any(inside, axis=0).reshape(np.shape(points)[:-1])


def corners(patch: object) -> np.ndarray:
    return np.concatenate(patch.get_path().to_polygons())


def in_view(artists: object, xy: np.ndarray) -> bool:
    x, y = artists.ax.get_xlim(), artists.ax.get_ylim()
    low, high = np.min([x, y], axis=1), np.max([x, y], axis=1)
    return bool(((xy >= low) & (xy <= high)).all())


def grasp_at(polygon: rl.Polygon, at: dict[int, float]) -> rl.Grasp:
    return polygon.resolve(rl.Grasp([(edge, float(u)) for edge, u in at.items()]))


class TestFocusCell:
    @pytest.mark.parametrize("grasp_set", planar(), ids=repr)
    def test_laws(self, grasp_set):
        artists, polygon = drawn_cell(grasp_set), grasp_set.polygon
        (point,) = artists.point.get_xydata()
        assert covers(artists.cell, point)
        assert list(artists.regions) == list(artists.cones) == list(grasp_set.edges)
        assert list(artists.scene.edges) == list(artists.scene.numbers) == list(grasp_set.edges)
        drawn = [positions(polygon, e, line) for e, line in artists.regions.items()]
        assert np.array(drawn) == pytest.approx(
            grasp_set.independent_regions(point), abs=1e-9 * polygon.diameter
        )
        assert in_view(artists, point)
        for line in (*artists.regions.values(), *artists.scene.edges.values()):
            assert in_view(artists, line.get_xydata())
        for cone in artists.cones.values():
            assert in_view(artists, cone.get_xy())
            assert cone.get_xy()[0] == pytest.approx(point)

    @pytest.mark.parametrize("grasp_set", planar(), ids=repr)
    def test_any_contacts_in_the_regions_are_a_grasp(self, grasp_set):
        polygon, rng = grasp_set.polygon, np.random.default_rng(7)
        regions = drawn_cell(grasp_set).regions
        friction = grasp_set.torque.cones.friction
        for _ in range(5):
            parts = rng.uniform(0.01, 0.99, len(regions))
            at = {
                edge: first + part * (last - first)
                for part, (edge, line) in zip(parts, regions.items(), strict=True)
                for first, last in [positions(polygon, edge, line)]
            }
            assert rl.is_force_closure(polygon, grasp_at(polygon, at), friction)

    @pytest.mark.parametrize("grasp_set", planar(), ids=repr)
    def test_the_drawn_cell_is_the_cell(self, grasp_set):
        artists, rng = drawn_cell(grasp_set), np.random.default_rng(3)
        cell = grasp_set.focus_cell
        low, high = artists.scene.window.reshape(2, 2)
        inside = [(corners(artists.cell).min(axis=0), corners(artists.cell).max(axis=0))]
        for first, last in [(low, high), *inside]:
            points = rng.uniform(first, last, (40, 2))
            margins = np.array([cell.margins(np.tile(point, (len(cell), 1))) for point in points])
            clear = np.abs(margins).min(axis=1) > 1e-6 * grasp_set.polygon.diameter
            assert clear.any()
            assert (covers(artists.cell, points) == (margins > 0).any(axis=1))[clear].all()

    @pytest.mark.parametrize("grasp_set", planar(), ids=repr)
    def test_cones_reach_over_their_regions(self, grasp_set):
        artists = drawn_cell(grasp_set)
        for edge, line in artists.regions.items():
            pie = Path(artists.cones[edge].get_xy())
            first, last = line.get_xydata()
            for part in (0.02, 0.5, 0.98):
                assert pie.contains_point(first + part * (last - first))

    def test_a_given_point(self):
        (grasp_set,) = graph_of("wedge").sets
        for point in ([30.0, 10.0], (10, 20)):
            artists = plot_focus_cell(grasp_set, point)
            assert artists.point.get_xydata().tolist() == [list(map(float, point))]
        assert len(artists.cell.get_path().to_polygons()) == len(grasp_set.focus_cell) == 4

    def test_the_literal_cell_has_more_but_no_grasp_there(self):
        (grasp_set, *_) = some("two_hole_plate", "two_finger", 1)
        assert plot_focus_cell(grasp_set).literal is None
        artists = plot_focus_cell(grasp_set, literal=True)
        for ring in artists.literal.get_path().to_polygons():
            center = ring[:-1].mean(axis=0)
            assert not covers(artists.cell, center)
            with pytest.raises(rl.OptionError, match="not inside"):
                grasp_set.independent_regions(center)
        assert len(artists.literal.get_path().to_polygons()) == 2

    def test_the_view_is_not_much_larger_than_the_object(self):
        for grasp_set in planar()[::3]:
            artists = plot_focus_cell(grasp_set, key=False)
            low, high = artists.scene.window.reshape(2, 2)
            assert (high - low).max() < 4 * grasp_set.polygon.diameter

    def test_refusals(self):
        (triangle,) = graph_of("wedge").sets
        with pytest.raises(rl.OptionError, match=r"a parallel set has no focus cell.*chapter"):
            plot_focus_cell(some("hex_nut", "parallel", 1)[0])
        complete = rl.build_switching_graph(triangle.polygon, 0.3).sets
        with pytest.raises(rl.OptionError, match="a three_finger set has no focus cell"):
            plot_focus_cell(next(s for s in complete if s.kind == "three_finger"))
        with pytest.raises(rl.OptionError, match="not inside the focus cell of edges 0, 1, 2"):
            plot_focus_cell(triangle, (1e3, 0.0))
        with pytest.raises(rl.OptionError, match="pair of coordinates"):
            plot_focus_cell(triangle, [1.0, 2.0, 3.0])
        with pytest.raises(rl.OptionError, match="literal=True is for two-finger sets"):
            plot_focus_cell(triangle, literal=True)


def switches(name: str, kinds: tuple[str, str], count: int = 4) -> list[tuple[str, int, int]]:
    graph, named = graph_of(name), kinds_of(name)
    pairs = [
        (name, i, j)
        for i in range(len(graph))
        if named[i] == kinds[0]
        for j in graph.neighbors(i)
        if named[j] == kinds[1]
    ]
    chosen = np.linspace(0, len(pairs) - 1, count).round().astype(int)
    return [pairs[i] for i in chosen]


PAIRS = [
    *switches("hex_nut", ("concurrent", "concurrent")),
    *switches("star_15", ("concurrent", "concurrent")),
    *switches("star_25", ("concurrent", "two_finger")),
    *switches("two_hole_plate", ("two_finger", "concurrent")),
]


class TestFocusSwitch:
    @pytest.mark.parametrize(("name", "first", "second"), PAIRS)
    def test_laws(self, name, first, second):
        graph = graph_of(name)
        artists, polygon = drawn_switch(name, first, second), graph.polygon
        (point,) = artists.point.get_xydata()
        sets = graph.sets[first], graph.sets[second]
        for patch in (*artists.cells, artists.intersection):
            assert covers(patch, point)
        before, after = (set(s.edges) for s in sets)
        assert set(artists.held) == before & after
        assert set(artists.leaving) == before - after
        assert set(artists.coming) == after - before
        every = {**artists.held, **artists.leaving, **artists.coming}
        at = {e: positions(polygon, e, line).item() for e, line in every.items()}
        for s in sets:
            for edge, region in zip(s.edges, s.independent_regions(point), strict=True):
                assert region[0] < at[edge] < region[1]
            grasp = grasp_at(polygon, {e: at[e] for e in s.edges})
            assert grasp in s
            assert rl.is_force_closure(polygon, grasp, graph.friction)
        for edge, line in artists.regions.items():
            low, high = positions(polygon, edge, line)
            assert low < at[edge] < high

    @pytest.mark.parametrize(("name", "first", "second"), PAIRS)
    def test_any_contacts_in_the_regions_are_grasps_of_both(self, name, first, second):
        graph, rng = graph_of(name), np.random.default_rng(11)
        polygon, regions = graph.polygon, drawn_switch(name, first, second).regions
        for _ in range(5):
            ends = {e: positions(polygon, e, line) for e, line in regions.items()}
            at = {e: rng.uniform(0.99 * a + 0.01 * b, b) for e, (a, b) in ends.items()}
            for s in (graph.sets[first], graph.sets[second]):
                grasp = grasp_at(polygon, {e: at[e] for e in s.edges})
                assert rl.is_force_closure(polygon, grasp, graph.friction)

    @pytest.mark.parametrize(("name", "first", "second"), PAIRS)
    def test_the_intersection_is_that_of_the_cells(self, name, first, second):
        artists, rng = drawn_switch(name, first, second), np.random.default_rng(5)
        drawn = corners(artists.intersection)
        points = rng.uniform(drawn.min(axis=0), drawn.max(axis=0), (60, 2))
        both = np.all([covers(cell, points) for cell in artists.cells], axis=0)
        assert (covers(artists.intersection, points) == both).all()

    def test_key_has_what_occurs(self):
        def words(name: str, first: int, second: int) -> list[str]:
            key = plot_focus_switch(graph_of(name), first, second).scene.key
            return [text.get_text() for text in key.get_texts()]

        name, first, second = PAIRS[0]
        edges = [", ".join(map(str, graph_of(name).sets[i].edges)) for i in (first, second)]
        assert words(name, first, second) == [
            f"focus cell of {edges[0]}",
            f"focus cell of {edges[1]}",
            "both cells",
            "focus point",
            "contact region",
            "held",
            "leaves",
            "comes",
        ]

    def test_refusals(self):
        graph = graph_of("star_25")
        kinds = kinds_of("star_25").tolist()
        one = kinds.index("concurrent")
        two = [i for i, kind in enumerate(kinds) if kind == "two_finger"]
        with pytest.raises(rl.OptionError, match="a parallel set has no focus cell"):
            plot_focus_switch(graph, one, kinds.index("parallel"))
        with pytest.raises(rl.OptionError, match="they are one and the same"):
            plot_focus_switch(graph, one, one)
        with pytest.raises(rl.OptionError, match="one of them has to be concurrent"):
            plot_focus_switch(graph, two[0], two[1])
        apart = next(
            i
            for i, s in enumerate(graph.sets)
            if s.kind == "concurrent" and not set(s.edges) & set(graph.sets[one].edges)
        )
        with pytest.raises(rl.OptionError, match=r"on 2 common edges, and these have 0"):
            plot_focus_switch(graph, one, apart)
        with pytest.raises(IndexError):
            plot_focus_switch(graph, one, len(graph))

    def test_cells_that_do_not_meet(self):
        graph = graph_of("star_25")
        sets = list(graph.sets)
        found = next(
            (i, j)
            for i, s in enumerate(sets)
            for j, t in enumerate(sets)
            if s.kind == t.kind == "concurrent"
            and len(set(s.edges) & set(t.edges)) == 2
            and graph.held(i, j) is None
        )
        with pytest.raises(rl.OptionError, match="do not meet"):
            plot_focus_switch(graph, *found)


def torque_side(apex: np.ndarray, rays: np.ndarray, point: np.ndarray) -> bool:
    """Whether a point is in a double-sided cone, within rounding."""
    x, y = point - apex
    turns = [(d[0] * y - d[1] * x) / max(np.hypot(x, y), 1e-300) for d in rays]
    return bool(turns[0] * turns[1] <= 1e-9)


class TestCommonCone:
    @pytest.mark.parametrize("grasp_set", parallel(), ids=repr)
    def test_laws(self, grasp_set):
        artists, polygon = drawn_cone(grasp_set), grasp_set.polygon
        at = {e: dot.get_xydata()[0] for e, dot in artists.contacts.items()}
        for contact in grasp_set.witness:
            assert at[contact.edge] == pytest.approx(polygon.point(contact))
        center = at[grasp_set.center]
        others = [e for e in grasp_set.edges if e != grasp_set.center]
        assert artists.segment.get_xydata() == pytest.approx(np.array([at[e] for e in others]))
        for point in (*artists.inside.get_xydata(), artists.crossing.get_xydata()[0]):
            assert torque_side(center, grasp_set.common_cone, point)
        for cone in artists.common:
            assert cone.get_xy()[0] == pytest.approx(center)
        assert list(artists.cones) == others

    @pytest.mark.parametrize("grasp_set", parallel(), ids=repr)
    def test_forces_are_parallel_and_in_the_friction_cones(self, grasp_set):
        artists = drawn_cone(grasp_set)
        cones = grasp_set.torque.cones
        for edge, line in artists.forces.items():
            first, last = line.get_xydata()
            direction = (last - first) / np.hypot(*(last - first))
            assert (first + last) / 2 == pytest.approx(artists.contacts[edge].get_xydata()[0])
            turns = [d[0] * direction[1] - d[1] * direction[0] for d in cones.unit_rays[2 * edge :]]
            assert turns[0] * turns[1] < 0

    @pytest.mark.parametrize("grasp_set", parallel(), ids=repr)
    def test_outer_regions_and_cone_are_all_there_is(self, grasp_set):
        artists, rng = drawn_cone(grasp_set), np.random.default_rng(1)
        center = artists.contacts[grasp_set.center].get_xydata()[0]
        for point in rng.uniform(*artists.scene.window.reshape(2, 2), (40, 2)):
            within = torque_side(center, grasp_set.common_cone, point)
            assert sum(covers(region, point) for region in artists.outer) == (not within)

    def test_another_grasp_of_the_set(self):
        (grasp_set,) = some("hex_nut", "parallel", 1)
        moved = np.clip(grasp_set.witness.fractions, 0.05, 0.95)
        pairs = zip(grasp_set.witness.edges.tolist(), moved.tolist(), strict=True)
        grasp = rl.Grasp.at_fractions(pairs)
        assert grasp in grasp_set
        artists = plot_common_cone(grasp_set, grasp)
        for contact in grasp:
            drawn = artists.contacts[contact.edge].get_xydata()[0]
            assert drawn == pytest.approx(grasp_set.polygon.point(contact))

    def test_the_centre_contact_in_the_middle_of_the_segment(self):
        channel = rl.Polygon(
            [(0, 0), (6, 0), (6, 1), (1, 1), (1, 2), (6, 2), (6, 3), (0, 3)], name="channel"
        )
        graph = rl.build_switching_graph(channel, 0.2, sets="chapter")
        (grasp_set,) = (graph.sets[i] for i in graph.sets.on_edges((0, 2, 4)))
        grasp = rl.Grasp([(0, 3.0), (2, 3.0), (4, 2.0)])
        artists = plot_common_cone(grasp_set, grasp)
        assert artists.crossing.get_xydata().tolist() != [[3.0, 1.0]]
        for line in artists.forces.values():
            assert np.ptp(line.get_xydata()[:, 0]) == pytest.approx(0)
            assert np.ptp(line.get_xydata()[:, 1]) > 0

    def test_contacts_on_one_line(self):
        """The segment meets the cone in the centre contact only; forces have a direction still."""
        quadrilateral = rl.Polygon([(100, 103), (98, 101), (97, 99), (97, 98)])
        graph = rl.build_switching_graph(quadrilateral, [1, 0.25, 0.25, 2], sets="chapter")
        for grasp_set in graph.sets:
            if grasp_set.kind == "parallel":
                for line in plot_common_cone(grasp_set).forces.values():
                    assert np.isfinite(line.get_xydata()).all()

    def test_refusals(self):
        (grasp_set,), (triangle,) = some("hex_nut", "parallel", 1), graph_of("wedge").sets
        for plot in (plot_common_cone, plot_union_volume, plot_cones_at_one_point):
            with pytest.raises(rl.OptionError, match=r"parallel set; this one is concurrent"):
                plot(triangle)
        with pytest.raises(rl.OptionError, match="the grasp is not in the parallel set on edges"):
            plot_common_cone(grasp_set, rl.Grasp([(0, 0.1), (1, 0.1), (2, 0.1)]))


class TestUnionVolume:
    @pytest.mark.parametrize("grasp_set", parallel(), ids=repr)
    def test_it_is_the_union_of_the_cones(self, grasp_set):
        artists, rng = plot_union_volume(grasp_set), np.random.default_rng(2)
        ends = grasp_set.polygon.points(grasp_set.center, np.linspace(0, 1, 400))
        for point in rng.uniform(*artists.scene.window.reshape(2, 2), (30, 2)):
            within = any(torque_side(p, grasp_set.common_cone, point) for p in ends)
            outer = sum(covers(region, point) for region in artists.outer)
            assert covers(artists.volume, point) == (not outer)
            assert outer <= 1
            assert not (within and outer)


class TestConesAtOnePoint:
    @pytest.mark.parametrize("grasp_set", parallel(), ids=repr)
    def test_the_common_cone_is_in_all_of_them(self, grasp_set):
        artists = plot_cones_at_one_point(grasp_set)
        assert set(artists.cones) == set(artists.labels) == set(grasp_set.edges)
        middle = 0.9 * artists.common[0].get_xy()[1:-1].mean(axis=0)
        for edge, cone in artists.cones.items():
            assert Path(cone.get_xy()).contains_point(middle)
            inverted = edge == grasp_set.center
            assert (cone.get_linestyle() == palette.DASHES) == inverted
            assert artists.labels[edge].get_text() == ("$-" if inverted else "$") + f"C_{{{edge}}}$"


def pictures(ax: object, key: bool = True) -> dict[str, object]:
    """Draw every picture on given axes."""
    graph, options = graph_of("hex_nut"), ({} if key else {"key": False})
    name, first, second = PAIRS[0]
    (cell,), (pair,) = some(name, "concurrent", 1), some(name, "two_finger", 1)
    (grasp_set,) = some(name, "parallel", 1)
    return {
        "cell": lambda: plot_focus_cell(cell, None, ax, **options),
        "literal": lambda: plot_focus_cell(pair, None, ax, literal=True, **options),
        "switch": lambda: plot_focus_switch(graph, first, second, ax, **options),
        "cone": lambda: plot_common_cone(grasp_set, None, ax, **options),
        "volume": lambda: plot_union_volume(grasp_set, ax, **options),
        "point": lambda: plot_cones_at_one_point(grasp_set, ax),
    }


ALL = sorted(pictures(None))


class TestAxes:
    @pytest.mark.parametrize("name", ALL)
    def test_given_axes_and_nothing_else(self, name):
        figure = Figure(figsize=(7, 4), layout="constrained")
        other, ax = figure.subplots(1, 2)
        ax.invert_yaxis()
        before = dict(matplotlib.rcParams), other.get_xlim(), other.get_ylim()
        artists = pictures(ax)[name]()
        assert artists.ax is ax
        assert artists.figure is figure
        assert ax.yaxis_inverted()
        assert artists._repr_png_() is None
        assert (dict(matplotlib.rcParams), other.get_xlim(), other.get_ylim()) == before
        assert not other.lines
        assert not other.patches
        assert figure.axes == [other, ax]
        assert not figure.legends

    @pytest.mark.parametrize("name", ALL)
    def test_new_axes_show_themselves_whole(self, name):
        artists = pictures(None)[name]()
        assert isinstance(artists.figure, OwnFigure)
        assert artists._repr_png_().startswith(b"\x89PNG")
        tight = artists.figure.get_tightbbox(FigureCanvasAgg(artists.figure).get_renderer())
        assert (tight.extents[:2] >= 0).all()
        assert (tight.extents[2:] <= artists.figure.get_size_inches()).all()
        unit = artists.ax.transData.transform([(0, 0), (1, 0), (0, 1)])
        assert unit[1, 0] - unit[0, 0] == pytest.approx(unit[2, 1] - unit[0, 1])

    @pytest.mark.parametrize("name", [name for name in ALL if name != "point"])
    def test_the_key_is_off_the_object_and_can_be_left_out(self, name):
        artists = pictures(None)[name]()
        renderer = FigureCanvasAgg(artists.figure).get_renderer()
        key = artists.scene.key.get_window_extent(renderer)
        object_ = artists.scene.polygon.outline.get_window_extent(renderer)
        numbers = [t.get_window_extent(renderer) for t in artists.scene.numbers.values()]
        assert not any(key.overlaps(box) for box in (object_, *numbers))
        frame = artists.ax.get_window_extent(renderer)
        assert frame.x0 <= key.x0
        assert key.x1 <= frame.x1
        assert pictures(None, key=False)[name]().scene.key is None

    def test_numbers_stand_beside_their_edges(self):
        for grasp_set in planar():
            artists = drawn_cell(grasp_set)
            scale = np.abs(np.diff(artists.ax.transData.transform([(0, 0), (1, 0)])[:, 0])).item()
            for edge, text in artists.scene.numbers.items():
                anchor = np.asarray(text.get_position())
                (start, end), polygon = artists.scene.edges[edge].get_xydata(), grasp_set.polygon
                assert abs((anchor - start) @ polygon.normals[edge]) * scale < 1e-6
                assert text.get_text() == str(edge)
                assert np.hypot(*(anchor - (start + end) / 2)) <= polygon.edge_lengths[edge] / 2

    @pytest.mark.parametrize("scale", [1e-12, 1e-6, 1.0, 1e6])
    def test_any_scale(self, scale):
        triangle = rl.Polygon(np.array([(0, 0), (5, 0), (3, 4)]) * scale)
        (grasp_set,) = rl.build_switching_graph(triangle, 0.2, sets="chapter").sets
        drawn = plot_focus_cell(grasp_set)
        assert len(drawn.cell.get_path().to_polygons()) == len(grasp_set.focus_cell)
        assert in_view(drawn, drawn.point.get_xydata()[0])
