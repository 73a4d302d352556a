"""Pictures of contact space, of candidates and of the switching graph: what is drawn is so."""

from __future__ import annotations

import math
from itertools import combinations, pairwise

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.path import Path
from mpl_toolkits.mplot3d import proj3d
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import ConvexHull

import regrasp_lp as rl
from regrasp_lp.errors import FrictionError, OptionError
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.candidates import (
    concurrent_candidates,
    parallel_candidates,
    two_finger_candidates,
)
from regrasp_lp.plotting import (
    plot_candidates,
    plot_contact_space,
    plot_graph,
    plot_projections,
    plot_subpolytopes,
)
from regrasp_lp.plotting.regions import body, faces_of, side
from regrasp_lp.polygon import Polygon
from regrasp_lp.polytopes import corners
from regrasp_lp.switching_graph import SwitchingGraph

MU = math.tan(math.radians(10))
NEAR = 1e-6  # points closer to a boundary than this are on neither side


@pytest.fixture(scope="module")
def chapter(stars: dict[str, Polygon]) -> SwitchingGraph:
    return rl.build_switching_graph(stars["star_25"], MU, sets="chapter")


@pytest.fixture(scope="module")
def bracket(workpieces: dict[str, Polygon]) -> SwitchingGraph:
    """Complete sets, also of two contacts on one edge."""
    return rl.build_switching_graph(workpieces["l_bracket"], 0.3)


@pytest.fixture(scope="module")
def sets(chapter: SwitchingGraph, bracket: SwitchingGraph) -> list[rl.GraspSet]:
    """Return some sets of every kind."""
    found: dict[object, list[rl.GraspSet]] = {}
    for grasp_set in (*chapter.sets, *bracket.sets):
        twice = len(set(grasp_set.edges)) < len(grasp_set.edges)
        found.setdefault((grasp_set.kind, twice, grasp_set.polygon.name), []).append(grasp_set)
    return [grasp_set for group in found.values() for grasp_set in group[:: len(group) // 5 or 1]]


def parallel_sets(graph: SwitchingGraph) -> list[rl.GraspSet]:
    return [s for s in graph.sets if s.kind == "parallel"]


def rendered(figure: Figure) -> object:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return canvas.get_renderer()


def assert_nothing_cropped(figure: Figure) -> None:
    tight = figure.get_tightbbox(rendered(figure)).extents
    assert (tight[:2] >= -0.01).all()
    assert (tight[2:] <= figure.get_size_inches() + 0.01).all()


def slack(points: np.ndarray, of: np.ndarray) -> np.ndarray:
    """How far points are outside the convex hull of others; everywhere if there is none."""
    if not len(of):
        return np.full(len(points), np.inf)
    equations = ConvexHull(of).equations
    return (points @ equations[:, :-1].T + equations[:, -1]).max(axis=1)


def drawn_corners(collection: Poly3DCollection) -> np.ndarray:
    """The distinct corners of the faces on the paper, after a drawing."""
    vertices = np.concatenate([path.vertices for path in collection.get_paths()])
    return np.unique(vertices.round(9), axis=0)


def on_paper(ax: object, points: np.ndarray) -> np.ndarray:
    x, y, _ = proj3d.proj_transform(*points.T, ax.get_proj())
    return np.unique(np.stack((x, y), axis=1).round(9), axis=0)


def inside(patch: object, points: np.ndarray) -> np.ndarray:
    """Whether points are in one of the closed parts of a patch, or of none."""
    found = np.zeros(len(points), dtype=bool)
    if patch is not None:
        for polygon in patch.get_path().to_polygons(closed_only=False):
            found |= Path(polygon).contains_points(points)
    return found


class TestSubpolytopes:
    def test_union_is_the_set(self, chapter):
        rng = np.random.default_rng(1)
        for grasp_set in parallel_sets(chapter)[::5]:
            artists = plot_subpolytopes(grasp_set)
            lengths = grasp_set.torque.lengths[0]
            fractions = rng.random((300, 3))
            found = np.zeros(300, dtype=bool)
            unsure = np.zeros(300, dtype=bool)
            for k, points in enumerate(corners(grasp_set.subpolytopes)):
                assert (k in artists.polytopes) == (len(points) > 0)
                outside = slack(fractions, points / lengths)
                found |= outside < 0
                unsure |= np.abs(outside) < NEAR
            expected = np.array([grasp_set.torque.contain(f)[0] for f in fractions])
            assert (found == expected)[~unsure].all()

    def test_faces_are_drawn_where_the_corners_are(self, chapter):
        grasp_set = parallel_sets(chapter)[0]
        artists = plot_subpolytopes(grasp_set)
        rendered(artists.figure)
        every = corners(grasp_set.subpolytopes)
        assert artists.polytopes
        for k, collection in artists.polytopes.items():
            assert (every[k] >= 0).all()
            assert (every[k] <= grasp_set.torque.lengths[0]).all()
            expected = on_paper(artists.ax, every[k])
            assert drawn_corners(collection) == pytest.approx(expected, abs=1e-6)

    def test_nothing_cropped(self, chapter):
        for grasp_set in parallel_sets(chapter)[::10]:
            assert_nothing_cropped(plot_subpolytopes(grasp_set).figure)

    def test_faces_are_whole(self):
        cube = np.array(np.meshgrid([0, 1], [0, 5], [0, 0.1])).reshape(3, -1).T.astype(float)
        faces = faces_of(cube, np.array([1, 5, 0.1]))
        assert len(faces) == 6
        assert all(len(face) == 4 for face in faces)
        edges = [np.abs(np.diff(f, axis=0)).astype(bool).sum(axis=1) for f in faces]
        assert np.unique(edges).tolist() == [1]  # along the sides, not across the faces

    def test_refusals(self, chapter):
        with pytest.raises(OptionError, match="two_finger"):
            plot_subpolytopes(chapter.sets[0])
        with pytest.raises(OptionError, match="Axes3D"):
            plot_subpolytopes(parallel_sets(chapter)[0], Figure().add_subplot())


class TestContactSpace:
    def test_set_is_between_the_bodies(self, sets):
        rng = np.random.default_rng(2)
        for grasp_set in sets:
            lengths, m = grasp_set.torque.lengths[0], len(grasp_set.edges)
            fractions = rng.random((200, m))
            for i, (one, other) in enumerate(pairwise(grasp_set.edges)):
                if one == other:
                    fractions[:, i : i + 2].sort(axis=1)
            near, far = (
                slack(fractions, points / lengths if len(points) else points)
                for points in (body(grasp_set, 1), body(grasp_set, -1))
            )
            unsure = (np.abs(near) < NEAR) | (np.abs(far) < NEAR)
            expected = np.array([grasp_set.torque.contain(f)[0] for f in fractions])
            assert ((near > 0) & (far > 0) == expected)[~unsure].all()
            artists = plot_contact_space(grasp_set)
            assert (artists.never_up is None) == np.isinf(near).all()
            assert (artists.never_down is None) == np.isinf(far).all()

    def test_sides_of_the_box(self, sets):
        rng = np.random.default_rng(3)
        for grasp_set in (s for s in sets if len(s.edges) == 3):
            for i, end in ((0, 0.0), (1, 1.0), (2, 0.0), (2, 1.0)):
                shown = [k for k in range(3) if k != i]
                fractions = np.insert(rng.random((60, 2)), i, end, axis=1)
                polygons = [Path(p) for p in side(grasp_set, shown, end).polygons()]
                found = [any(p.contains_point(f[shown]) for p in polygons) for f in fractions]
                ordered = [
                    all(
                        a != b or f[k] < f[k + 1]
                        for k, (a, b) in enumerate(pairwise(grasp_set.edges))
                    )
                    for f in fractions
                ]
                expected = [grasp_set.torque.contain(f)[0] for f in fractions]
                assert found == (np.array(expected) & ordered).tolist()

    def test_bodies_and_set_are_drawn_within_the_box(self, sets):
        for grasp_set in (s for s in sets if len(s.edges) == 3):
            artists = plot_contact_space(grasp_set)
            rendered(artists.figure)
            for collection, sign in ((artists.never_up, 1), (artists.never_down, -1)):
                if collection is not None:
                    points = body(grasp_set, sign)
                    assert (points >= 0).all()
                    assert (points <= grasp_set.torque.lengths[0]).all()
                    expected = on_paper(artists.ax, points)
                    assert drawn_corners(collection) == pytest.approx(expected, abs=1e-6)

    def test_two_fingers_in_the_plane(self, sets):
        rng = np.random.default_rng(4)
        for grasp_set in (s for s in sets if len(s.edges) == 2):
            artists = plot_contact_space(grasp_set)
            fractions = rng.random((200, 2))
            points = fractions * grasp_set.torque.lengths[0]
            expected = np.array([grasp_set.torque.contain(f)[0] for f in fractions])
            assert (inside(artists.between, points) == expected).all()
            others = inside(artists.never_up, points) | inside(artists.never_down, points)
            assert (others == ~expected).all()
            assert_nothing_cropped(artists.figure)

    def test_nothing_cropped(self, sets):
        for grasp_set in sets[::6]:
            assert_nothing_cropped(plot_contact_space(grasp_set).figure)

    def test_given_axes(self, sets):
        figure = Figure(figsize=(10, 5))
        flat, deep = figure.add_subplot(121), figure.add_subplot(122, projection="3d")
        two = next(s for s in sets if len(s.edges) == 2)
        three = next(s for s in sets if len(s.edges) == 3)
        assert plot_contact_space(two, flat).ax is flat
        assert plot_contact_space(three, deep).ax is deep
        assert plot_contact_space(three, deep)._repr_png_() is None
        with pytest.raises(OptionError, match="Axes3D"):
            plot_contact_space(two, deep)
        with pytest.raises(OptionError, match="Axes3D"):
            plot_contact_space(three, flat)


class TestProjections:
    @pytest.mark.parametrize("which", ["chapter", "bracket"])
    def test_unions_of_hulls_of_projected_corners(self, which, sets, request):
        """The chapter's way to project gives the same regions."""
        graph = request.getfixturevalue(which)
        rng = np.random.default_rng(5)
        for index in rng.choice(len(graph), 12, replace=False):
            grasp_set = graph.sets[int(index)]
            m, edges = len(grasp_set.edges), grasp_set.edges
            if m == 2 or len(set(edges)) < m:
                continue
            shown = sorted(rng.choice(m, 2, replace=False).tolist())
            on = [edges[i] for i in shown]
            artists = plot_projections(grasp_set, grasp_set, on)
            points = rng.random((150, 2)) * grasp_set.torque.lengths[0][shown]
            hulls = [c[:, shown] for c in corners(grasp_set.pieces) if len(c)]
            outside = np.array([slack(points, hull) for hull in hulls])
            sure = (np.abs(outside) > NEAR).all(axis=0)
            expected = (outside < 0).any(axis=0)
            for patch in (artists.first, artists.second, artists.common):
                assert (inside(patch, points) == expected)[sure].all()

    @pytest.mark.parametrize("which", ["chapter", "bracket"])
    def test_common_positions_are_where_the_graph_has_a_switch(self, which, request):
        graph = request.getfixturevalue(which)
        rng = np.random.default_rng(6)
        answers = []
        contacts = graph.sets.contacts
        while len(answers) < 30:
            i, j = rng.choice(len(graph), 2, replace=False).tolist()
            first, second = graph.sets[i], graph.sets[j]
            need = graph.hand.held(int(contacts[i]), int(contacts[j]))
            shared = sorted(set(first.edges) & set(second.edges))
            if not need or len(shared) < need:
                continue
            switch = graph.switch(i, j)
            held = [tuple(sorted(edges)) for edges in switch.edges] if switch else []
            for on in combinations(shared, need):
                artists = plot_projections(first, second, on)
                assert (artists.common is not None) == (on in held)
                answers.append(artists.common is None)
        if which == "chapter":
            assert {True, False} <= set(answers)

    def test_common_is_what_both_have(self, chapter):
        sets = parallel_sets(chapter)
        rng = np.random.default_rng(7)
        pairs = [
            (a, b, sorted(set(a.edges) & set(b.edges)))
            for a, b in combinations(sets, 2)
            if len(set(a.edges) & set(b.edges)) == 2
        ]
        for first, second, on in pairs[::25]:
            artists = plot_projections(first, second, on)
            points = rng.random((200, 2)) * chapter.polygon.edge_lengths[on]
            both = inside(artists.first, points) & inside(artists.second, points)
            assert (inside(artists.common, points) == both).all()

    def test_one_held_edge_gives_intervals(self, chapter):
        parallel = parallel_sets(chapter)
        for second in (s for s in chapter.sets if s.kind == "two_finger"):
            for first in parallel[::7]:
                for edge in set(first.edges) & set(second.edges):
                    artists = plot_projections(first, second, edge)
                    slot = first.edges.index(edge)
                    ends = np.concatenate([c[:, slot] for c in corners(first.pieces) if len(c)])
                    x = artists.first.get_path().vertices[:, 0]
                    assert [x.min(), x.max()] == pytest.approx([ends.min(), ends.max()])
                    rows = [
                        patch.get_path().vertices[:, 1]
                        for patch in (artists.first, artists.second, artists.common)
                        if patch is not None
                    ]
                    assert all(a.max() < b.min() for a, b in pairwise(rows))

    def test_a_contact_of_two_on_one_edge(self, bracket):
        twice = next(s for s in bracket.sets if len(set(s.edges)) < len(s.edges))
        edge = next(e for e in twice.edges if twice.edges.count(e) == 2)
        artists = plot_projections(twice, twice, [edge, edge])
        rng = np.random.default_rng(8)
        points = rng.random((200, 2)) * bracket.polygon.edge_lengths[edge]
        assert (inside(artists.first, points) == inside(artists.first, points[:, ::-1])).all()
        assert_nothing_cropped(artists.figure)

    def test_axes(self, chapter):
        first, second = parallel_sets(chapter)[:2]
        figure = Figure()
        ax = figure.add_subplot()
        on = sorted(set(first.edges) & set(second.edges))
        assert plot_projections(first, second, on, ax).ax is ax
        assert str(on[0]) in ax.get_xlabel()
        assert str(on[1]) in ax.get_ylabel()
        assert_nothing_cropped(plot_projections(first, second, on).figure)
        assert_nothing_cropped(plot_projections(first, second, on[:1]).figure)
        with pytest.raises(OptionError, match="Axes3D"):
            plot_projections(first, second, on, figure.add_subplot(projection="3d"))

    def test_refusals(self, chapter, bracket):
        first, second = parallel_sets(chapter)[:2]
        other = next(e for e in range(25) if e not in first.edges)
        with pytest.raises(OptionError, match=f"held edges .*{other}"):
            plot_projections(first, second, other)
        for on in ((), first.edges):
            with pytest.raises(OptionError, match="1 or 2"):
                plot_projections(first, second, on)
        with pytest.raises(OptionError, match="different objects"):
            plot_projections(first, bracket.sets[0], 0)


def completing(cones: Cones, kind: str, chosen: tuple[int, ...]) -> set[int]:
    """The edges that come next in a candidate, written out."""
    if kind == "parallel":
        rows, centers = parallel_candidates(cones)
        found = [(set(r) - {c}, c) for r, c in zip(rows.tolist(), centers.tolist(), strict=True)]
        if not chosen:
            return {edge for outer, c in found for edge in (*outer, c)}
        fits = [(outer, c) for outer, c in found if set(chosen) <= outer]
        if len(chosen) == 2:
            return {c for _, c in fits}
        return {edge for outer, _ in fits for edge in outer - set(chosen)}
    rows = {"two_finger": two_finger_candidates, "concurrent": concurrent_candidates}[kind](cones)
    fits = [set(row) for row in rows.tolist() if set(chosen) <= set(row)]
    return {edge for row in fits for edge in row - set(chosen)}


class TestCandidates:
    @pytest.mark.parametrize("kind", ["two_finger", "concurrent", "parallel"])
    @pytest.mark.parametrize("friction", ["uniform", "high", "mixed"])
    def test_marked_are_the_candidates(self, kind, friction, stars):
        polygon = stars["star_15"]
        rng = np.random.default_rng(9)
        mu = {"uniform": MU, "high": 0.8, "mixed": rng.uniform(0.05, 0.7, 15)}[friction]
        cones = Cones.of(polygon, mu)
        last = 1 if kind == "two_finger" else 2
        every = [(), *((e,) for e in range(15)), *combinations(range(15), 2)][:: 2 + 2 * last]
        for chosen in (c for c in every if len(c) <= last):
            artists = plot_candidates(polygon, mu, kind, chosen)
            assert artists.chosen == chosen
            assert set(artists.candidates) == completing(cones, kind, chosen)
            assert sorted(artists.arrows) == sorted(artists.numbers) == list(range(15))
            colors = {edge: line.get_color() for edge, line in artists.arrows.items()}
            marked = {colors[edge] for edge in artists.candidates}
            assert len(marked) == bool(artists.candidates)
            assert {e for e, color in colors.items() if color in marked} == set(artists.candidates)
            in_window = {
                edge
                for edge, arcs in artists.windows.items()
                if any(arc.holds(angle_of(polygon, edge)) for arc in arcs)
            }
            if len(chosen) == last:
                assert in_window == set(artists.candidates)
            elif chosen:
                assert in_window >= set(artists.candidates)

    def test_normals_point_where_they_do(self, workpieces):
        polygon = workpieces["l_bracket"]
        artists = plot_candidates(polygon, 0.3, "two_finger")
        for edge, line in artists.arrows.items():
            assert line.get_xydata()[1] == pytest.approx(polygon.normals[edge])
        assert not artists.windows
        assert not artists.sectors

    def test_one_window_for_one_friction_and_the_extremes_of_several(self, stars):
        polygon = stars["star_15"]
        assert len(plot_candidates(polygon, 0.3, "two_finger", [0]).sectors) == 1
        assert len(plot_candidates(polygon, 0.3, "concurrent", [0]).sectors) == 2
        mu = np.linspace(0.1, 0.5, 15)
        narrow, wide = plot_candidates(polygon, mu, "two_finger", [0]).sectors
        assert wide.theta1 < narrow.theta1 < narrow.theta2 < wide.theta2

    @pytest.mark.parametrize("name", ["star_40", "two_hole_plate", "rectangle"])
    def test_numbers_do_not_overlap(self, name, stars, workpieces):
        polygon = (stars | workpieces)[name]
        artists = plot_candidates(polygon, 0.3, "concurrent", [0])
        assert len(artists.numbers) == polygon.n_edges
        renderer = rendered(artists.figure)
        boxes = [text.get_window_extent(renderer).extents for text in artists.numbers.values()]
        for a, b in combinations(np.array(boxes), 2):
            shared = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])
            assert shared.min() < 4.0  # rooms for descenders, which digits have not
        assert_nothing_cropped(artists.figure)

    def test_given_axes(self, workpieces):
        ax = Figure().add_subplot()
        assert plot_candidates(workpieces["wedge"], 0.3, "concurrent", ax=ax).ax is ax

    def test_refusals(self, workpieces):
        wedge = workpieces["wedge"]
        with pytest.raises(OptionError, match="three_finger"):
            plot_candidates(wedge, 0.3, "three_finger")
        with pytest.raises(OptionError, match="at most 1"):
            plot_candidates(wedge, 0.3, "two_finger", [0, 1])
        for chosen in ([3], [-1], [1, 1]):
            with pytest.raises(OptionError, match="from 0 to 2"):
                plot_candidates(wedge, 0.3, "concurrent", chosen)
        with pytest.raises(FrictionError):
            plot_candidates(wedge, -1, "concurrent")


def angle_of(polygon: Polygon, edge: int) -> float:
    x, y = polygon.normals[edge]
    return math.atan2(y, x)


class TestGraph:
    def test_everything_is_drawn(self, chapter):
        artists = plot_graph(chapter)
        kinds = np.array(chapter.sets.kinds)
        for kind, drawn in artists.vertices.items():
            assert np.asarray(drawn.get_offsets()) == pytest.approx(
                artists.positions[kinds == kind]
            )
        assert sum(len(d.get_offsets()) for d in artists.vertices.values()) == len(chapter)
        assert artists.drawn == chapter.n_switches == len(artists.switches.get_segments())
        assert artists.left_out == 0
        graph = chapter.to_networkx()
        ends = {tuple(np.round(p, 9)): i for i, p in enumerate(artists.positions)}
        for a, b in artists.switches.get_segments():
            assert graph.has_edge(ends[tuple(np.round(a, 9))], ends[tuple(np.round(b, 9))])
        assert_nothing_cropped(artists.figure)

    def test_layout_is_the_same_every_time(self, chapter):
        assert (plot_graph(chapter).positions == plot_graph(chapter).positions).all()

    def test_components_have_places_of_their_own(self, stars):
        graph = rl.build_switching_graph(stars["star_15"], 0.1, hand=rl.Hand(3))
        components = graph.components()
        assert len(components) > 5
        artists = plot_graph(graph, color="component")
        xy = artists.positions
        boxes = [(xy[list(c)].min(axis=0), xy[list(c)].max(axis=0)) for c in components]
        for (low, high), (other_low, other_high) in combinations(boxes, 2):
            assert ((high < other_low) | (other_high < low)).any()
        x, y = artists.ax.get_xlim(), artists.ax.get_ylim()
        assert ((xy >= [x[0], y[0]]) & (xy <= [x[1], y[1]])).all()
        assert len(artists.sizes) <= len(components)

    def test_implicit_pairs_are_left_out_beyond_some_number(self, stars):
        graph = rl.build_switching_graph(stars["star_15"], 0.9)
        two = int((graph.sets.contacts == 2).sum())
        artists = plot_graph(graph)
        assert artists.left_out == two * (two - 1) // 2 > 300
        assert artists.drawn + artists.left_out == graph.n_switches
        assert "not drawn" in artists.ax.get_legend().get_title().get_text()

    @pytest.mark.parametrize("fingers", [3, 4, 5, 6])
    def test_any_hand(self, fingers, workpieces):
        graph = rl.build_switching_graph(workpieces["rectangle"], 0.3, hand=rl.Hand(fingers))
        artists = plot_graph(graph)
        assert artists.drawn + artists.left_out == graph.n_switches
        assert np.isfinite(artists.positions).all()

    def test_small_ones(self, workpieces):
        wedge = workpieces["wedge"]
        assert plot_graph(rl.build_switching_graph(wedge, 0.3)).drawn == 0
        empty = plot_graph(rl.build_switching_graph(wedge, 0.3, min_margin=1e9))
        assert len(empty.positions) == 0
        assert not empty.vertices
        assert_nothing_cropped(empty.figure)

    def test_given_axes_and_refusals(self, bracket):
        ax = Figure().add_subplot()
        assert plot_graph(bracket, ax).ax is ax
        with pytest.raises(OptionError, match="component"):
            plot_graph(bracket, color="margin")


def test_keys_can_be_left_out(chapter: SwitchingGraph) -> None:
    first, second = parallel_sets(chapter)[:2]
    on = [next(iter(set(first.edges) & set(second.edges)), first.edges[0])]
    second = second if on[0] in second.edges else first
    for key in (True, False):
        for artists in (
            plot_subpolytopes(first, key=key),
            plot_contact_space(first, key=key),
            plot_projections(first, second, on, key=key),
            plot_candidates(chapter.polygon, MU, "concurrent", key=key),
            plot_graph(chapter, key=key),
        ):
            assert (artists.ax.get_legend() is not None) == key
            assert repr(artists).startswith(f"<{type(artists).__name__} on <Axes")


def test_sets_of_a_limited_hand_are_not_drawn() -> None:
    polygon = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])
    for hand in (rl.Hand(edge_clearance=0.1), rl.Hand(max_span=6.0)):
        grasp_set = rl.build_switching_graph(polygon, 0.4, hand).sets[-1]
        with pytest.raises(rl.OptionError, match="hands without limits"):
            plot_contact_space(grasp_set)
