"""Pictures: what is drawn, where the labels are, and that files come out."""

from __future__ import annotations

import importlib
import itertools
import subprocess
import sys
from collections.abc import Mapping
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from conftest import REPOSITORY
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

from regrasp_lp import read_polygons, sample_grasps
from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import ContactError, FrictionError, MissingExtraError, OptionError
from regrasp_lp.friction import per_edge_friction
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.plan import Plan, Support
from regrasp_lp.planning.steps import Place, Release, Slide, Step
from regrasp_lp.plotting import plot_grasp, plot_plan, plot_polygon
from regrasp_lp.plotting.filmstrip import _letter
from regrasp_lp.plotting.frame import OwnFigure
from regrasp_lp.plotting.placement import Label, Paper, Search, place
from regrasp_lp.polygon import Polygon

PLATE = Polygon([(0, 0), (60, 0), (60, 30), (0, 30)], name="plate")
BRACKET = Polygon([(0, 0), (80, 0), (80, 20), (20, 20), (20, 100), (0, 100)], name="bracket")
WINDOW = Polygon(
    [(0, 0), (10, 0), (10, 8), (0, 8)], holes=[[(3, 3), (3, 5), (7, 5), (7, 3)]], name="window"
)


def ring(n: int, radius: float = 1.0, center: tuple[float, float] = (0.0, 0.0)) -> Polygon:
    angles = np.linspace(0, 2 * np.pi, n, endpoint=False)
    wavy = radius * (1 + 0.25 * np.cos(5 * angles))
    points = np.stack([wavy * np.cos(angles), wavy * np.sin(angles)], axis=1)
    return Polygon(points + center, name=f"ring_{n}")


def at(edge: int, fraction: float) -> Contact:
    return Contact.at_fraction(edge, fraction)


def make_plan(
    polygon: Polygon,
    start: Mapping[int, Contact],
    steps: list[tuple[Step, Support]],
    first: Support,
) -> Plan:
    """Build a plan of given steps; nothing says that it would hold the object."""

    def resolved(step: Step) -> Step:
        match step:
            case Place(finger, contact):
                return Place(finger, polygon.resolve_contact(contact))
            case Slide(moves):
                return Slide({k: polygon.resolve_contact(c) for k, c in moves.items()})
        return step

    return Plan(
        polygon,
        per_edge_friction(0.3, polygon.n_edges),
        Hand(4),
        {k: polygon.resolve_contact(c) for k, c in start.items()},
        Grasp(start.values()),
        tuple(resolved(step) for step, _ in steps),
        (first, *(support for _, support in steps)),
    )


TWO, THREE = Support("two_finger", (1, 2)), Support("three_finger", (2, 3, 4))


@pytest.fixture(scope="module")
def plan() -> Plan:
    """Return a plan with steps of every kind."""
    return make_plan(
        PLATE,
        {1: at(0, 0.5), 2: at(2, 0.5)},
        [
            (Place(3, at(0, 0.1)), TWO),
            (Place(4, at(2, 0.1)), TWO),
            (Release(1), THREE),
            (Slide({2: at(2, 0.75)}), THREE),
            (Slide({2: at(2, 0.9), 3: at(0, 0.15)}), THREE),
        ],
        TWO,
    )


def rendered(figure: Figure) -> object:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return canvas.get_renderer()


def boxes(artists: object, renderer: object) -> np.ndarray:
    """Return x0, y0, x1, y1 of artists, in pixels."""
    return np.array([artist.get_window_extent(renderer).extents for artist in artists])


def overlaps(extents: np.ndarray) -> list[tuple[int, int]]:
    return [
        (i, k)
        for i, k in itertools.combinations(range(len(extents)), 2)
        if (
            np.maximum(extents[i, :2], extents[k, :2]) < np.minimum(extents[i, 2:], extents[k, 2:])
        ).all()
    ]


def ink(box: np.ndarray) -> np.ndarray:
    """Take the room for descenders, which digits have not, off the boxes of texts."""
    height = box[:, 3] - box[:, 1]
    return box + np.stack([0 * height, 0.2 * height, 0 * height, -0.1 * height], axis=1)


def assert_within(figure: Figure, extents: np.ndarray) -> None:
    width, height = figure.bbox.size
    assert (extents[:, :2] >= 0).all()
    assert (extents[:, 2] <= width).all()
    assert (extents[:, 3] <= height).all()


class TestPolygon:
    def test_holes_are_holes(self):
        artists = plot_polygon(WINDOW)
        path = artists.fill.get_path()
        assert (path.codes == 1).sum() == 2  # two rings, each started by a MOVETO
        figure = artists.figure
        rendered(figure)
        pixels = np.asarray(figure.canvas.buffer_rgba())
        colors = [
            tuple(pixels[pixels.shape[0] - 1 - int(y), int(x), :3])
            for x, y in artists.ax.transData.transform([(1.5, 1.5), (5, 4.2)])
        ]
        assert colors == [(0xEF, 0xEF, 0xEC), (255, 255, 255)]

    @pytest.mark.parametrize("n", [3, 8, 24, 40, 60])
    def test_every_edge_is_numbered_without_overlap(self, n):
        artists = plot_polygon(ring(n))
        assert sorted(artists.numbers) == list(range(n))
        assert all(text.get_text() == str(edge) for edge, text in artists.numbers.items())
        renderer = rendered(artists.figure)
        extents = boxes(artists.numbers.values(), renderer)
        assert_within(artists.figure, extents)
        assert overlaps(ink(extents)) == []

    def test_numbers_are_off_the_material_and_near_their_edges(self):
        artists = plot_polygon(BRACKET)
        renderer = rendered(artists.figure)
        centers = boxes(artists.numbers.values(), renderer).reshape(-1, 2, 2).mean(axis=1)
        xy = artists.ax.transData.inverted().transform(centers)
        away = ((xy - BRACKET.points(np.arange(6), 0.5)) * BRACKET.normals).sum(axis=1)
        assert (away < 0).all()
        assert (away > -5).all()
        assert artists.leaders == {}

    def test_numbers_in_a_bore_are_in_line(self):
        turns = -np.arange(12) * np.pi / 6
        bore = 25 + 7 * np.stack((np.cos(turns), np.sin(turns)), axis=1)
        plate = Polygon([(0, 0), (80, 0), (80, 80), (0, 80)], holes=[bore])
        artists = plot_polygon(plate)
        assert len(artists.numbers) == 16
        assert artists.leaders == {}

    def test_crowded_numbers_are_left_out_or_led_to(self):
        artists = plot_polygon(ring(250))
        assert 100 < len(artists.numbers) < 250
        extents = boxes(artists.numbers.values(), rendered(artists.figure))
        assert overlaps(ink(extents)) == []
        crowd = plot_polygon(ring(60, 1.0), Figure(figsize=(4, 4)).add_subplot())
        assert crowd.leaders
        assert set(crowd.leaders) <= set(crowd.numbers)

    def test_first_vertex_is_marked(self):
        artists = plot_polygon(BRACKET)
        assert artists.first_vertex.get_xydata().tolist() == [[0.0, 0.0]]
        plain = plot_polygon(BRACKET, edge_numbers=False)
        assert (plain.first_vertex, plain.numbers, plain.leaders) == (None, {}, {})

    @pytest.mark.parametrize("scale", [1e-60, 0.1, 1.0, 1e8, 1e60])
    def test_any_scale(self, scale):
        artists = plot_polygon(Polygon(BRACKET.exterior * scale))
        extents = boxes(artists.numbers.values(), rendered(artists.figure))
        assert len(extents) == 6
        assert_within(artists.figure, extents)
        expected = boxes(plot_polygon(Polygon(BRACKET.exterior)).numbers.values(), None)
        assert extents == pytest.approx(expected, abs=0.5)

    def test_far_from_the_origin(self):
        artists = plot_polygon(ring(9, 0.1, (1e6, -1e6)))
        assert_within(artists.figure, boxes(artists.numbers.values(), rendered(artists.figure)))

    def test_equal_aspect_and_nothing_cropped(self):
        artists = plot_polygon(Polygon([(0, 0), (400, 0), (400, 3)], name="sliver $x"))
        renderer = rendered(artists.figure)
        unit = artists.ax.transData.transform([(0, 0), (1, 0), (0, 1)])
        assert unit[1, 0] - unit[0, 0] == pytest.approx(unit[2, 1] - unit[0, 1])
        tight = artists.figure.get_tightbbox(renderer).extents
        assert (tight[:2] >= 0).all()
        assert (tight[2:] <= artists.figure.get_size_inches()).all()

    def test_given_axes(self):
        figure = Figure(layout="constrained")
        ax = figure.subplots(1, 2)[1]
        ax.invert_yaxis()
        artists = plot_polygon(BRACKET, ax)
        assert artists.ax is ax
        assert artists.figure is figure
        assert ax.yaxis_inverted()
        assert artists._repr_png_() is None
        extents = boxes(artists.numbers.values(), rendered(figure))
        assert overlaps(ink(extents)) == []
        inner = ax.get_window_extent().extents
        assert (extents[:, :2] >= inner[:2]).all()
        assert (extents[:, 2:] <= inner[2:]).all()

    def test_subfigure(self):
        left, _ = Figure(figsize=(8, 4), layout="constrained").subfigures(1, 2)
        assert len(plot_polygon(PLATE, left.add_subplot()).numbers) == 4

    def test_new_figure_shows_itself(self):
        artists = plot_polygon(PLATE)
        assert isinstance(artists.figure, OwnFigure)
        assert artists._repr_png_().startswith(b"\x89PNG")

    def test_method(self):
        assert sorted(PLATE.plot().numbers) == [0, 1, 2, 3]


class TestGrasp:
    def test_one_of_everything_per_finger(self):
        grasp = Grasp.at_fractions([(5, 0.5), (3, 0.6), (0, 0.8)])
        artists = plot_grasp(BRACKET, grasp, 0.3)
        assert list(artists.fingers) == list(artists.cones) == [1, 2, 3]
        assert artists.line is None
        assert not artists.released
        assert not artists.arrows
        for k, finger in artists.fingers.items():
            assert finger.number.get_text() == str(k)
            assert finger.contact.get_xydata()[0] == pytest.approx(BRACKET.point(grasp[k - 1]))
            assert finger.leader.get_xydata()[0] == pytest.approx(BRACKET.point(grasp[k - 1]))

    def test_circle_sits_at_the_end_of_its_leader_off_the_object(self):
        artists = plot_grasp(BRACKET, Grasp.at_fractions([(5, 0.5), (2, 0.6), (0, 0.8)]), 0.3)
        renderer = rendered(artists.figure)
        for finger in artists.fingers.values():
            center = finger.circle.get_window_extent(renderer).get_points().mean(axis=0)
            end = artists.ax.transData.transform(finger.leader.get_xydata()[1])
            assert center == pytest.approx(end, abs=1.0)
            assert not artists.polygon.fill.get_path().contains_point(finger.leader.get_xydata()[1])

    def test_cone_has_the_angle_of_friction_and_stays_in_the_object(self):
        artists = plot_grasp(PLATE, Grasp.at_fractions([(0, 0.5), (2, 0.2), (2, 0.8)]), 0.5)
        corners = artists.cones[1].get_xy()
        assert corners[0] == pytest.approx([30, 0])
        first, last = corners[1] - corners[0], corners[-2] - corners[0]
        assert first[0] / first[1] == pytest.approx(0.5)
        assert last[0] / last[1] == pytest.approx(-0.5)
        assert 0 <= corners[:, 1].min() < corners[:, 1].max() == pytest.approx(30)

    def test_common_cone_of_a_parallel_grasp(self):
        trapezium = Polygon([(0, 0), (60, 0), (58, 30), (2, 28)])
        grasp = Grasp.at_fractions([(0, 0.5), (2, 0.2), (2, 0.8)])
        cones = plot_grasp(trapezium, grasp, 0.3, center=0).cones

        def directions(finger: int) -> np.ndarray:
            corners = cones[finger].get_xy()[:-1]
            rays = corners[[1, -1]] - corners[0]
            return rays / np.hypot(*rays.T)[:, None]

        assert directions(1) == pytest.approx(-directions(2))
        assert directions(2) == pytest.approx(directions(3))
        whole = plot_grasp(trapezium, grasp, 0.3).cones[1].get_xy()
        assert np.ptp(cones[1].get_xy()[1:-1, 0]) < np.ptp(whole[1:-1, 0])

    def test_whole_cones_where_there_is_no_common_one(self):
        grasp = Grasp.at_fractions([(0, 0.5), (1, 0.2), (3, 0.8)])
        cones = plot_grasp(PLATE, grasp, 0.1, center=0).cones
        whole = plot_grasp(PLATE, grasp, 0.1).cones
        assert cones[1].get_xy() == pytest.approx(whole[1].get_xy())

    def test_line_of_two_fingers(self):
        artists = plot_grasp(PLATE, {4: at(0, 0.25), 2: at(2, 0.5)}, 0.3)
        assert list(artists.fingers) == [2, 4]
        assert artists.line.get_xydata().tolist() == [[30, 30], [15, 0]]
        assert artists.line.get_linestyle() == "--"
        assert not artists.cones

    def test_without_cones(self):
        artists = plot_grasp(PLATE, [(0, 5.0), (2, 5.0)], 0.3, cones=False)
        assert artists.line is None
        assert not artists.cones

    def test_roles_look_different(self):
        contacts = {k: at(k - 1, 0.5) for k in (1, 2, 3, 4)}
        artists = plot_grasp(
            PLATE, contacts, 0.3, support=(1, 2), highlight=[3], released={5: at(0, 0.1)}
        )
        looks = [
            (finger.circle.get_markerfacecolor(), finger.circle.get_markeredgecolor())
            for finger in (*artists.fingers.values(), *artists.released.values())
        ]
        assert looks[0] == looks[1]
        assert len(set(looks)) == 4

    @pytest.mark.parametrize("inverted", [False, True])
    def test_labels_of_close_fingers_are_apart(self, inverted):
        ax = Figure(figsize=(5, 4)).add_subplot()
        if inverted:
            ax.invert_yaxis()
            ax.invert_xaxis()
        notched = Polygon([(0, 0), (0.1, 0), (0.1, 0.07), (0.05, 0.03), (0, 0.07)])
        places = [(0, 0.5), (0, 0.52), (0, 0.5), (2, 1), (3, 0), (1, 1), (2, 0), (2, 0.95)]
        artists = plot_grasp(notched, Grasp.at_fractions(places), 0.3, ax, edge_numbers=True)
        renderer = rendered(artists.figure)
        circles = boxes([f.circle for f in artists.fingers.values()], renderer)
        numbers = ink(boxes(artists.polygon.numbers.values(), renderer))
        assert len(circles) == 8
        assert len(numbers) == 5
        assert overlaps(np.concatenate([circles, numbers])) == []
        assert_within(artists.figure, circles)

    def test_finger_in_a_small_hole(self):
        size = 0.2
        hole = [(4, 4), (4, 4 + size), (4 + size, 4 + size), (4 + size, 4)]
        sheet = Polygon([(0, 0), (10, 0), (10, 8), (0, 8)], holes=[hole])
        artists = plot_grasp(sheet, Grasp.at_fractions([(4, 0.5), (6, 0.5)]), 0.3)
        circles = boxes([f.circle for f in artists.fingers.values()], rendered(artists.figure))
        assert overlaps(circles) == []
        hole_box = artists.ax.transData.transform([hole[0], hole[2]]).ravel()
        assert overlaps(np.stack([circles[0], hole_box])) == []

    @pytest.mark.parametrize("name", ["gusset", "hex_nut_m20", "letter_A", "letter_B"])
    def test_fingers_come_from_where_there_is_no_material(self, name):
        files = ("machine_parts", "letters")
        models = [p for f in files for p in read_polygons(REPOSITORY / "models" / f"{f}.geojson")]
        polygon = next(p for p in models if p.name == name)
        material = shapely.Polygon(polygon.rings[0], polygon.rings[1:])
        edges, fractions = sample_grasps(polygon, 0.3, 8, seed=1)
        for row in zip(edges.tolist(), fractions.tolist(), strict=True):
            artists = plot_grasp(polygon, Grasp.at_fractions(zip(*row, strict=True)), 0.3)
            circles = boxes([f.circle for f in artists.fingers.values()], rendered(artists.figure))
            assert overlaps(circles) == []
            to_paper = artists.ax.transData.transform
            for edge, finger in zip(row[0], artists.fingers.values(), strict=True):
                contact, circle = finger.leader.get_xydata()
                assert (circle - contact) @ polygon.normals[edge] < 0
                # near its contact, unless the hole is full
                if np.hypot(*(to_paper(circle) - to_paper(contact))) < 40:
                    assert not material.contains(shapely.Point(circle))

    def test_one_finger_in_a_bore_stays_there(self):
        turns = -np.arange(12) * np.pi / 6
        bore = 30 + 3 * np.stack((np.cos(turns), np.sin(turns)), axis=1)
        plate = Polygon([(0, 0), (60, 0), (60, 60), (0, 60)], holes=[bore])
        for edge in range(4, 16):
            places = [(edge, 0.3), (0, 0.5), (2, 0.5)]
            circle = plot_grasp(plate, Grasp.at_fractions(places), 0.3).fingers[1].leader
            assert np.hypot(*(circle.get_xydata()[1] - (30, 30))) < 3

    def test_arrows(self):
        now = {1: at(0, 0.2), 2: at(2, 0.5), 3: at(2, 0.9)}
        before = {1: at(0, 0.8), 2: at(2, 0.5 - 1e-9), 3: at(2, 0.9)}
        artists = plot_grasp(PLATE, now, 0.3, slid_from=before)
        assert list(artists.arrows) == [1, 2]  # finger 3 has not moved
        tail, head = artists.arrows[1]._posA_posB
        assert tail == pytest.approx((48, 0))
        assert head == pytest.approx((12, 0))
        tail, head = artists.arrows[2]._posA_posB
        pixels = artists.ax.transData.transform([tail, head])
        length = np.hypot(*(pixels[1] - pixels[0])) * 72 / artists.figure.dpi
        assert length == pytest.approx(11)
        assert head[0] < tail[0]  # edge 2 runs to the left
        beside = artists.arrows[1].get_window_extent(rendered(artists.figure))
        assert beside.y1 <= artists.ax.transData.transform((0, 0))[1]

    def test_refusals(self):
        grasp = Grasp.at_fractions([(0, 0.5), (2, 0.5)])
        with pytest.raises(OptionError, match=r"support names finger 3.*: 1, 2 do"):
            plot_grasp(PLATE, grasp, 0.3, support=(1, 3))
        with pytest.raises(OptionError, match="highlight names finger 9"):
            plot_grasp(PLATE, grasp, 0.3, highlight=(9,))
        with pytest.raises(OptionError, match="slid_from names finger 5"):
            plot_grasp(PLATE, grasp, 0.3, slid_from={5: at(0, 0.0)})
        with pytest.raises(ContactError):
            plot_grasp(PLATE, [(7, 0.5)], 0.3)
        with pytest.raises(FrictionError):
            plot_grasp(PLATE, grasp, -1.0)


class TestPlan:
    def test_a_panel_for_the_start_and_each_step(self, plan):
        figure = plot_plan(plan)
        assert len(figure.axes) == 6
        words = [text.get_text() for text in figure.texts]
        assert words[:2] == ["plate", "5 steps, 2 placements, margin -7.184"]
        assert words[2::3] == ["(a)", "(b)", "(c)", "(d)", "(e)", "(f)"]
        assert words[3::3] == [
            "start",
            "place 3 on edge 0",
            "place 4 on edge 2",
            "release 1",
            "slide 2",
            "slide 2, 3: goal",
        ]
        assert words[4] == "held by 1, 2: margin 4.31"
        assert words[16].startswith("held by 2, 3, 4: margin ")
        assert "on the way" in words[16]

    def test_what_is_drawn_in_each_panel(self, plan):
        counts = [
            (len(ax.texts), sum(isinstance(p, FancyArrowPatch) for p in ax.patches), dashed(ax))
            for ax in plot_plan(plan).axes
        ]
        # fingers and ghosts, arrows, lines of two-finger grasps
        assert counts == [(2, 0, 1), (3, 0, 1), (4, 0, 1), (4, 0, 0), (3, 1, 0), (3, 2, 0)]

    def test_ghost_after_a_release_only(self, plan):
        hollow = [
            sum(line.get_markeredgecolor() == "#8A8A8A" for line in ax.lines) // 2
            for ax in plot_plan(plan).axes
        ]
        assert hollow == [0, 0, 0, 1, 0, 0]

    def test_moved_fingers_stand_out(self, plan):
        moved = [
            [t.get_text() for t in ax.texts if highlighted(ax, t)] for ax in plot_plan(plan).axes
        ]
        assert moved == [[], ["3"], ["4"], [], ["2"], ["2", "3"]]

    def test_all_labels_are_in_the_figure_and_apart(self, plan):
        figure = plot_plan(plan)
        renderer = rendered(figure)
        extents = boxes(figure.texts, renderer)
        assert_within(figure, extents)
        assert overlaps(extents) == []
        for ax in figure.axes:
            circles = boxes([line for line in ax.lines if line.get_markersize() > 10], renderer)
            assert_within(figure, circles)
            assert overlaps(circles) == []
        tight = figure.get_tightbbox(renderer).extents
        assert (tight[:2] >= 0).all()
        assert (tight[2:] <= figure.get_size_inches()).all()

    @pytest.mark.parametrize(
        ("polygon", "steps"),
        [
            (Polygon([(0, 0), (400, 0), (400, 12), (0, 12)], name="bar"), 6),
            (Polygon([(0, 0), (12, 0), (12, 400), (0, 400)], name="column"), 21),
            (Polygon([(0, 0), (1e8, 0), (1e8, 1e8)], name="a very long name " * 8), 0),
            (ring(150, 0.1), 1),
        ],
    )
    def test_shapes_and_numbers_of_panels(self, polygon, steps):
        script = [Slide({1: at(0, 0.3 + 0.01 * i)}) for i in range(steps)]
        made = make_plan(
            polygon,
            {1: at(0, 0.5), 2: at(2, 0.5)},
            [(step, TWO) for step in script],
            TWO,
        )
        figure = plot_plan(made)
        assert len(figure.axes) == steps + 1
        assert figure.get_size_inches()[0] <= 12
        renderer = rendered(figure)
        texts = boxes(figure.texts, renderer)
        assert_within(figure, texts)
        assert overlaps(texts) == []
        (legend,) = figure.legends
        key = boxes([legend], renderer)
        assert_within(figure, key)
        axes = boxes(figure.axes, renderer)
        assert overlaps(np.concatenate([axes, texts])) == []
        assert key[0, 3] <= axes[:, 1].min()

    def test_long_titles_are_made_smaller(self):
        many = {k: at(k % 4, 0.05 * k) for k in range(1, 19)}
        slide = Slide({k: at(c.edge, 0.5 * c.fraction) for k, c in many.items()})
        figure = plot_plan(make_plan(PLATE, many, [(slide, TWO)], TWO), columns=1)
        texts = boxes(figure.texts, rendered(figure))
        assert_within(figure, texts)
        assert figure.texts[-2].get_fontsize() < figure.texts[-5].get_fontsize()

    def test_key_has_what_occurs(self, plan):
        def key(plan: Plan) -> list[str]:
            return [text.get_text() for text in plot_plan(plan).legends[0].get_texts()]

        assert key(plan) == [
            "supports the object",
            "only touches",
            "just moved",
            "just released",
            "friction cone",
            "two-finger grasp",
        ]
        alone = make_plan(PLATE, {1: at(0, 0.5), 2: at(2, 0.5)}, [], TWO)
        assert key(alone) == ["supports the object", "two-finger grasp", "where it may be"]

    def test_parallel_support_has_common_cones(self):
        trapezium = Polygon([(0, 0), (60, 0), (58, 30), (2, 28)])
        start = {1: at(0, 0.5), 2: at(2, 0.2), 3: at(2, 0.8)}
        support = Support("parallel", (1, 2, 3), 0)
        (ax,) = plot_plan(make_plan(trapezium, start, [], support)).axes
        widths = {round(np.ptp(angles_of(patch)), 6) for patch in ax.patches[2:]}
        assert len(widths) == 1
        assert widths.pop() < 2 * np.arctan(0.3) - 1e-3

    def test_columns(self, plan):
        def lefts(figure: Figure) -> int:
            return len({round(ax.get_position().x0, 6) for ax in figure.axes})

        assert lefts(plot_plan(plan)) == 3
        assert lefts(plot_plan(plan, columns=2)) == 2
        assert lefts(plot_plan(plan, columns=np.int64(50))) == 6
        for columns in (0, 1.5, "many"):
            with pytest.raises(OptionError, match="columns must be"):
                plot_plan(plan, columns=columns)

    def test_files(self, plan, tmp_path):
        figure = plan.plot()
        for suffix in ("png", "svg", "pdf"):
            figure.savefig(tmp_path / f"plan.{suffix}")
            assert (tmp_path / f"plan.{suffix}").stat().st_size > 5000
        assert (tmp_path / "plan.pdf").read_bytes().startswith(b"%PDF")
        assert ElementTree.parse(tmp_path / "plan.svg").getroot().tag.endswith("svg")

    def test_dpi_and_notebooks(self, plan):
        small, large = plot_plan(plan, dpi=50), plot_plan(plan, dpi=100)
        assert small.get_size_inches() == pytest.approx(large.get_size_inches())
        assert len(small._repr_png_()) < len(large._repr_png_())

    def test_deterministic(self, plan):
        assert plot_plan(plan)._repr_png_() == plot_plan(plan)._repr_png_()


def dashed(ax: object) -> int:
    return sum(line.get_linestyle() == "--" for line in ax.lines)


def highlighted(ax: object, text: object) -> bool:
    """Whether the circle around a text is of the colour for what has moved."""
    here = text.get_transform().transform(text.get_position())
    for line in ax.lines:
        there = line.get_transform().transform(line.get_xydata()[0])
        if line.get_markersize() > 10 and np.allclose(here, there):
            return line.get_markerfacecolor() == "#D55E00"
    raise AssertionError


def angles_of(wedge: object) -> np.ndarray:
    rays = wedge.get_xy()[1:-1] - wedge.get_xy()[0]
    return np.unwrap(np.arctan2(rays[:, 1], rays[:, 0]))


def test_letters():
    assert [_letter(i) for i in (0, 25, 26, 27, 51, 52)] == [
        "(a)",
        "(z)",
        "(aa)",
        "(ab)",
        "(az)",
        "(ba)",
    ]


class TestPlacement:
    paper = Paper(
        np.array([[20.0, 20], [80, 20], [80, 80], [20, 80]]),
        np.array([[80.0, 20], [80, 80], [20, 80], [20, 20]]),
        np.array([100.0, 100.0]),
    )

    def test_covers_and_distances(self):
        points = np.array([[50.0, 50], [10, 50], [90, 90]])
        assert self.paper.covers(points).tolist() == [True, False, False]
        assert self.paper.distances(points) == pytest.approx([30, 10, np.hypot(10, 10)])

    def test_limit_leaves_out_what_has_no_place(self):
        label = Label(np.array([50.0, 20]), np.array([0.0, -1]), np.array([4.0, 4]), np.zeros(2))
        search = Search(2.0, (0.0,), (0.0,), limit=1000.0)
        first, second = place(self.paper, [label, label], search, avoid=np.zeros((0, 2)))
        assert first.center == pytest.approx([50, 14])
        assert second is None
        (other,) = place(self.paper, [label], search, avoid=np.zeros((0, 2)), taken=[first])
        assert other is None

    def test_sweeps_mend_a_greedy_choice(self):
        # the first label takes the only place of the second, and gives way in the next sweep
        half, none = np.array([4.0, 4.0]), np.zeros(2)
        wide = Label(np.array([50.0, 20]), np.array([0.0, -1]), half, np.array([20.0, 0]))
        fixed = Label(np.array([50.0, 20]), np.array([0.0, -1]), half, none)
        search = Search(2.0, (0.0,), (0.0,), shifts=(0.0, 1.0), sweeps=2)
        first, second = place(self.paper, [wide, fixed], search, avoid=np.zeros((0, 2)))
        assert second.center == pytest.approx([50, 14])
        assert first.center == pytest.approx([70, 14])


class TestMatplotlib:
    def test_missing(self, monkeypatch):
        for name in [name for name in sys.modules if name.startswith("regrasp_lp.plotting")]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setitem(sys.modules, "matplotlib", None)
        with pytest.raises(MissingExtraError, match=r"needs matplotlib.*regrasp_lp\[plot\]"):
            importlib.import_module("regrasp_lp.plotting")
        with pytest.raises(MissingExtraError):
            PLATE.plot()

    def test_neither_loaded_early_nor_pyplot_at_all(self):
        code = (
            "import sys, regrasp_lp, regrasp_lp.polygon as p\n"
            "assert 'matplotlib' not in sys.modules\n"
            "p.Polygon([(0, 0), (4, 0), (4, 3)]).plot()\n"
            "assert 'matplotlib' in sys.modules and 'matplotlib.pyplot' not in sys.modules\n"
        )
        subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
