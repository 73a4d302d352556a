"""Paths of grasp sets as convex sets: what is in them, in which order, and what users do there."""

from __future__ import annotations

from functools import cache
from itertools import islice, pairwise, product

import cvxpy as cp
import numpy as np
import pytest
from conftest import star_polygon
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.optimize import linprog

import regrasp_lp as rl
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver
from regrasp_lp.planning.hit_and_run import sample_uniformly
from regrasp_lp.planning.layers import Crossing, best_first
from regrasp_lp.planning.path_choices import SetPieces
from regrasp_lp.planning.path_optimum import largest_tolerance
from regrasp_lp.planning.path_set import PathSet
from regrasp_lp.switching_graph import SwitchingGraph

POLYGONS = {
    "block": rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], name="block"),
    "bracket": rl.Polygon([(0, 0), (6, 0), (6, 1), (1, 1), (1, 5), (0, 5)], name="bracket"),
    "star": star_polygon(12, 4, "star"),
}


@cache
def graph_of(name: str, fingers: int = 4) -> SwitchingGraph:
    return rl.build_switching_graph(POLYGONS[name], 0.4, hand=rl.Hand(fingers))


def on_edges(graph: SwitchingGraph, *edges: tuple[int, ...]) -> list[int]:
    return [graph.sets.on_edges(e)[0] for e in edges]


def random_path(graph: SwitchingGraph, length: int, seed: int) -> list[int]:
    rng = np.random.default_rng(seed)
    path = [int(rng.integers(len(graph)))]
    while len(path) < length:
        path.append(int(rng.choice(graph.neighbors(path[-1]))))
    return path


# --- the order of paths through layers ----------------------------------------------------------

_width = st.sampled_from([-np.inf, 0.5, 1.0, 1.0 + 1e-12, 2.0, np.inf])


@st.composite
def layers(draw: st.DrawFn) -> tuple[np.ndarray, list[Crossing], np.ndarray]:
    sizes = draw(st.lists(st.integers(1, 3), min_size=1, max_size=4))
    ends = [np.array(draw(st.lists(_width, min_size=n, max_size=n))) for n in (sizes[0], sizes[-1])]
    crossings = []
    for p, q in pairwise(sizes):
        ways = draw(st.integers(1, 2))
        widths = draw(st.lists(_width, min_size=ways * p * q, max_size=ways * p * q))
        placements = draw(st.lists(st.integers(0, 2), min_size=ways, max_size=ways))
        crossings.append(
            Crossing(((),) * ways, np.array(placements), np.array(widths).reshape(ways, p, q))
        )
    return ends[0], crossings, ends[1]


def passed(first, crossings, last, elements, ways) -> tuple[int, tuple[float, ...]]:  # type: ignore[no-untyped-def]
    """Placements and widths, ascending, of one path."""
    widths = [first[elements[0]], last[elements[-1]]]
    placements = 0
    for n, (crossing, way) in enumerate(zip(crossings, ways, strict=True)):
        widths.append(crossing.widths[way, elements[n], elements[n + 1]])
        placements += int(crossing.placements[way])
    return placements, tuple(sorted(np.round(widths, 9)))


@given(layers())
def test_paths_through_layers_come_best_first_and_all(case) -> None:  # type: ignore[no-untyped-def]
    first, crossings, last = case
    sizes = [len(first), *(c.widths.shape[2] for c in crossings)]
    every = []
    for elements in product(*(range(n) for n in sizes)):
        for ways in product(*(range(len(c.placements)) for c in crossings)):
            placements, widths = passed(first, crossings, last, elements, ways)
            if widths[0] > 0:
                every.append((placements, [-w for w in widths], elements, ways))
    found = list(best_first(first, crossings, last, 1e-9))
    assert sorted(found) == sorted((elements, ways) for *_, elements, ways in every)
    costs = [passed(first, crossings, last, *path) for path in found]
    order = [(placements, [-w for w in widths]) for placements, widths in costs]
    assert order == sorted(order)


@pytest.mark.parametrize("name", POLYGONS)
def test_chains_are_the_widest(name: str) -> None:
    graph = graph_of(name)
    for index in range(0, len(graph), max(1, len(graph) // 8)):
        stage = SetPieces(graph.sets.functions(index), get_solver("clarabel"))
        overlaps, count = stage.overlaps, len(stage.pieces)
        assert (overlaps == overlaps.T).all()
        assert (np.diag(overlaps) > 0).all()
        for p, q in product(range(count), repeat=2):
            chain = stage.chain(p, q)
            least = min((overlaps[a, b] for a, b in pairwise(chain)), default=np.inf)
            assert (chain[0], chain[-1]) == (p, q)
            assert len(set(chain)) == len(chain)
            assert least == stage.widths[p, q] > 0
            # above that width no chain joins them
            wider = np.linalg.matrix_power((overlaps > least) | np.eye(count, dtype=bool), count)
            assert p == q or not wider[p, q]


# --- what is in a path set ----------------------------------------------------------------------


def paths(name: str) -> list[PathSet]:
    graph = graph_of(name)
    return [graph.path_set(random_path(graph, n, n + seed)) for n in (1, 2, 4) for seed in (0, 10)]


@pytest.mark.parametrize("name", POLYGONS)
def test_the_largest_margin_is_that_of_the_path_lp(name: str) -> None:
    for path in paths(name):
        size = path.steps.sets.cones.size
        problem = path.steps.problem
        direct = problem.tolerance(largest_tolerance(problem, "clarabel")) * size
        by_cvxpy = cp.Problem(cp.Maximize(path.margin), path.constraints).solve(solver=cp.CLARABEL)
        region = path.region
        rows = np.column_stack((region.rows[0], region.scales[0]))
        box = [*zip(region.lower[0], region.upper[0], strict=True), (None, None)]
        cost = np.append(np.zeros(len(path.names)), -1.0)
        by_scipy = -linprog(cost, rows, region.bounds[0], bounds=box).fun
        for found in (direct, by_cvxpy, by_scipy, path.solve(), path.margin_of()):
            assert found == pytest.approx(path.largest_margin, abs=1e-7 * size)


def test_order_and_repetition_of_constraints_change_nothing() -> None:
    for path in paths("bracket"):
        again = path.constraints_at(0.01)
        own = [*reversed(again), *again]
        objective = cp.Minimize(path.travel + path.positions(0)[0])
        assert path.solve(objective, own, margin=0.01) == pytest.approx(
            path.solve(objective, margin=0.01), abs=1e-6
        )


def held_choices(
    graph: SwitchingGraph, path: list[int], rng: np.random.Generator
) -> list[tuple[np.ndarray, np.ndarray]] | None:
    """A random arriving and leaving grasp in each set, equal in enough contacts, or None."""
    found: list[tuple[np.ndarray, np.ndarray]] = []
    for t, index in enumerate(path):
        functions = graph.sets.functions(index)
        arriving, leaving = rng.random((2, functions.m))
        if t:
            before = graph.sets.functions(path[t - 1]).edges[0].tolist()
            needed = graph.hand.held(len(before), functions.m)
            free = list(range(functions.m))
            for here in rng.permutation(len(before)).tolist():
                same = [n for n in free if functions.edges[0, n] == before[here]]
                if same and needed:
                    free.remove(same[0])
                    arriving[same[0]] = found[-1][1][here]
                    needed -= 1
            if needed:
                return None
        for fractions in (arriving, leaving):
            edges = functions.edges[0]
            order = np.lexsort((fractions, edges))
            if (order != np.arange(len(edges))).any() or not functions.contain(fractions[None])[0]:
                return None
        found.append((arriving, leaving))
    return found


def holds(path: PathSet, grasps: list[tuple[np.ndarray, np.ndarray]]) -> bool:
    """Whether arriving and leaving grasps are in a path set, those between them as they are."""
    values = np.full(len(path.names), np.nan)
    for place, ends in enumerate(grasps):
        steps = np.flatnonzero(path.steps.of_set == place)
        lengths = path.steps.sets.polygon.edge_lengths[list(path.edges(int(steps[0])))]
        for step, fractions in zip((steps[0], steps[-1]), ends, strict=True):
            for variable, position in zip(path.steps.ids[step], fractions * lengths, strict=True):
                if not np.isnan(values[variable]) and abs(values[variable] - position) > 1e-12:
                    return False  # these grasps do not hold what the path set holds
                values[variable] = position
    return bool(path.contains(np.where(np.isnan(values), path.values, values)))


@pytest.mark.parametrize(
    ("name", "edges"),
    [
        ("block", [(0, 2), (0, 1, 2)]),
        ("block", [(0, 1, 2)]),
        ("block", [(0, 2), (0, 0, 2)]),
        pytest.param("bracket", [(0, 4), (0, 4, 5), (3, 5)], marks=pytest.mark.slow),
    ],
)
def test_alternatives_cover_all_choices(name: str, edges: list[tuple[int, ...]]) -> None:
    graph = graph_of(name)
    path = on_edges(graph, *edges)
    every = list(graph.path_sets(path))
    for one in every:
        one.solve()
    rng = np.random.default_rng(5)
    drawn = (held_choices(graph, path, rng) for _ in range(20_000))
    tested = 0
    for grasps in islice((g for g in drawn if g is not None), 15):
        assert any(holds(one, grasps) for one in every)
        tested += 1
    assert tested >= 10


def test_alternatives_come_in_order_and_once() -> None:
    graph = graph_of("block")
    path = on_edges(graph, (0, 2), (0, 1, 2), (1, 3))
    best = graph.path_set(path)
    every = list(graph.path_sets(path))
    keys = [(one.placements, -round(one.largest_margin, 5)) for one in every]
    assert keys == sorted(keys)
    assert len({one.steps.choice for one in every}) == len(every)
    assert len({one.placements for one in every}) > 1  # ways that hold fewer contacts, too
    assert [a.steps.choice for a in best.alternatives()] == [a.steps.choice for a in every[1:]]
    assert best.steps.choice == every[0].steps.choice
    for one in every:
        assert one.placements == sum(
            len(one.edges(step)) - len(held)
            for held, step in zip(
                one.steps.choice.held, np.flatnonzero(np.diff(one.steps.of_set)) + 1, strict=True
            )
        )


def test_margins_are_those_of_switches() -> None:
    graph = graph_of("bracket")
    for one, other in [(1, 16), (16, 3), (0, 12), (4, 9)]:
        switch = graph.switch(one, other)
        assert switch is not None
        # free ends are no worse than the pieces they are in, so the switch decides
        best = max(h.margin for h in switch.handovers if h.held == switch.held)
        assert graph.path_set([one, other]).largest_margin == pytest.approx(best, abs=1e-6)


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_units(scale: float) -> None:
    part = POLYGONS["bracket"]
    larger = rl.build_switching_graph(rl.Polygon(part.vertices * scale), 0.4)
    graph = graph_of("bracket")
    nodes = on_edges(graph, (0, 4), (0, 4, 5), (3, 5))
    one, other = graph.path_set(nodes), larger.path_set(nodes)
    assert other.steps.choice.held == one.steps.choice.held
    assert other.largest_margin == pytest.approx(scale * one.largest_margin, rel=1e-6)
    assert other.sample(50, seed=2) == pytest.approx(scale * one.sample(50, seed=2), rel=1e-4)
    assert other.solve(cp.Minimize(other.travel), margin=scale * 0.1) <= 1e-5 * scale


# --- names, expressions -------------------------------------------------------------------------


def test_variables_are_named_by_step_and_contact() -> None:
    graph = graph_of("bracket")
    nodes = on_edges(graph, (0, 4), (0, 4, 5), (3, 5))
    path = graph.path_set(nodes, goal=[(3, 2.5), (5, 1.5)])
    held = path.variables
    assert path.n_steps == 6
    assert [path.edges(step) for step in range(6)] == [(0, 4)] * 2 + [(0, 4, 5)] * 2 + [(3, 5)] * 2
    assert held["u[1,0]"] is held["u[2,0]"]
    assert held["u[1,4]"] is held["u[2,4]"]
    assert held["u[0,0]"] is not held["u[1,0]"]
    assert held["u[3,5]"] is held["u[4,5]"]
    assert held["u[5,5]"].value == pytest.approx(1.5)
    assert all(held[name].name() == name for name in path.names)
    assert set(path.names) == {v.name() for v in held.values() if isinstance(v, cp.Variable)}
    assert "step 2 in set 16, three_finger: u[1,0], u[1,4], u[2,5]" in str(path)
    assert "u[5,3] = 2.5, u[5,5] = 1.5" in str(path)


def test_two_contacts_on_one_edge_have_two_names() -> None:
    graph = graph_of("block")
    path = graph.path_set(on_edges(graph, (0, 0, 2)))
    assert path.names == ("u[0,0]", "u[0,0']", "u[0,2]", "u[1,0]", "u[1,0']", "u[1,2]")
    for values in path.sample(200, seed=1):
        assert values[0] < values[1]
        assert values[3] < values[4]


@pytest.mark.parametrize("name", POLYGONS)
def test_points_and_travel_are_those_of_the_plan(name: str) -> None:
    graph = graph_of(name)
    for path in paths(name):
        path.solve(cp.Minimize(path.travel + 0.1 * cp.sum(path.positions(0))))
        for step in range(path.n_steps):
            contacts = zip(path.edges(step), path.positions(step).value, strict=True)
            expected = [graph.polygon.point((int(e), float(u))) for e, u in contacts]
            assert path.points(step).value == pytest.approx(np.array(expected), abs=1e-9)
            assert path.points(step).is_affine()
        way = 0.0
        for step in range(1, path.n_steps):
            if path.steps.place(step) == path.steps.place(step - 1):
                here, there = (path.positions(s).value for s in (step - 1, step))
                way += float(np.abs(here - there).sum())
        assert path.travel.value == pytest.approx(way, abs=1e-9)
        assert path.travel.is_convex()


# --- solving ------------------------------------------------------------------------------------


def bracket_path() -> PathSet:
    graph = graph_of("bracket")
    nodes = on_edges(graph, (0, 4), (0, 4, 5), (3, 5))
    return graph.path_set(nodes, start=[(0, 0.5), (4, 0.5)], goal=[(3, 2.5), (5, 1.5)])


def test_own_constraints_and_objective() -> None:
    path = bracket_path()
    _, on_4, on_5 = path.points(2)
    own = [path.variables["u[2,5]"] >= 0.3, cp.norm(on_5 - on_4) <= 1.5]
    # the finger on edge 5 is nearest to its place when on the circle around the one on edge 4
    found = path.solve(cp.Minimize(path.travel), own, margin=0.1)
    assert found == pytest.approx(1.5 - np.sqrt(1.5**2 - 0.5**2), abs=1e-5)
    assert path.margin_of() >= 0.1 - 1e-6
    plan = path.to_plan()
    assert plan.verify().ok
    assert plan.placements == path.placements == 2
    assert set(plan.goal.edges.tolist()) == {3, 5}
    assert [c.position for c in plan.start.values()] == [0.5, 0.5]
    three = next(grasp for grasp in plan.grasps if len(grasp.contacts) == 3)
    points = {c.edge: plan.polygon.point(c) for c in three.contacts.values()}
    assert np.linalg.norm(points[4] - points[5]) == pytest.approx(1.5, abs=1e-5)


def test_half_of_the_largest_margin_is_kept() -> None:
    path = bracket_path()
    path.solve(cp.Minimize(path.travel))
    assert path.margin_of() >= path.largest_margin / 2 - 1e-6
    assert path.margin.value == path.margin_of()
    own = [path.variables["u[3,5]"] <= 1.4]
    best = path.solve(constraints=own)
    assert 0 < best <= path.largest_margin + 1e-7
    path.solve(cp.Maximize(path.variables["u[3,5]"]), own)
    assert path.margin_of() >= best / 2 - 1e-6
    assert path.variables["u[3,5]"].value <= 1.4 + 1e-6


def test_the_margin_may_be_part_of_an_objective() -> None:
    path = bracket_path()
    value = path.solve(cp.Maximize(path.margin - 1e-4 * path.travel))
    assert path.margin_of() == pytest.approx(path.largest_margin, abs=1e-3)
    assert value <= path.largest_margin
    with pytest.raises(
        rl.NoPlanFound, match=r"margin of 9.*largest margin that they leave is 0\.18"
    ):
        path.solve(margin=9)


def test_why_there_is_nothing() -> None:
    path = bracket_path()
    u = path.variables["u[2,5]"]
    with pytest.raises(rl.NoPlanFound, match="contradict each other"):
        path.solve(constraints=[u >= 2, u <= 1])
    with pytest.raises(rl.NoPlanFound, match=r"largest margin that they leave is -\d"):
        path.solve(constraints=[path.variables["u[1,0]"] >= 5.9, path.variables["u[1,4]"] <= 0.1])
    with pytest.raises(rl.OptionError, match="Minimize or Maximize"):
        path.solve(path.travel)
    for margin in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(rl.OptionError, match="above 0"):
            path.solve(margin=margin)
    whole = cp.Variable(integer=True)
    with pytest.raises(rl.SolverError, match="CLARABEL cannot solve"):
        path.solve(cp.Minimize(path.travel), [path.variables["u[2,5]"] == whole])
    with pytest.raises(rl.SolverError, match="unbounded"):
        path.solve(cp.Minimize(cp.Variable()))
    with pytest.raises(rl.OptionError, match="no step 6: there are 6"):
        path.points(6)


def test_an_answer_that_misses_a_constraint_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    path = bracket_path()
    own = [path.variables["u[2,5]"] <= 1.0]
    original = cp.Problem.solve

    def solve(self: cp.Problem, **options: object) -> object:
        value = original(self, **options)
        for variable in self.variables():
            if variable.name() == "u[2,5]":
                variable.value = 1.1
        return value

    monkeypatch.setattr(cp.Problem, "solve", solve)
    with pytest.raises(rl.SolverError, match="violates a constraint by 0.1"):
        path.solve(constraints=own)


# --- plans --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", POLYGONS)
@pytest.mark.parametrize("fingers", [3, 4, 5])
def test_samples_are_plans(name: str, fingers: int) -> None:
    graph = graph_of(name, fingers)
    for length in (1, 3):
        path = graph.path_set(random_path(graph, length, length))
        for values in path.sample(4, seed=1):
            plan = path.to_plan(values)
            assert plan.verify().ok
            assert plan.placements == path.placements
            assert path.contains(values)
            assert plan.margin >= path.margin_of(values) - 1e-9
            for step, contacts in ((0, plan.grasps[0]), (path.n_steps - 1, plan.grasps[-1])):
                found = sorted(c.edge for c in contacts.contacts.values())
                assert tuple(found) == path.edges(step)


@pytest.mark.slow
@pytest.mark.parametrize("n", [9, 17, 25])
@pytest.mark.parametrize("friction", [0.15, 0.5, 1.2])
def test_random_paths_are_plans(n: int, friction: float) -> None:
    graph = rl.build_switching_graph(star_polygon(n, 3), friction)
    for seed in range(12):
        path = graph.path_set(random_path(graph, 2 + seed % 4, seed))
        # solvers stop at a gap of 1e-8 over the least scale of a row, that of contacts that meet
        assert path.solve() == pytest.approx(path.largest_margin, abs=1e-5)
        assert path.to_plan().verify().ok
        path.solve(cp.Minimize(path.travel))
        assert path.to_plan().verify().ok
        for values in path.sample(2, seed=1):
            assert path.to_plan(values).verify().ok
        other = next(path.alternatives())
        assert path.placements <= other.placements
        if path.placements == other.placements:
            assert path.largest_margin >= other.largest_margin - 1e-6
        other.solve(cp.Minimize(other.travel))
        assert other.to_plan().verify().ok


def test_ends_of_three_contacts_of_which_two_are_the_set() -> None:
    graph = graph_of("block")
    nodes = on_edges(graph, (0, 2), (0, 1, 2), (1, 3))
    start, goal = [(2, 3.0), (0, 3.0), (1, 1.0)], [(1, 1.5), (3, 1.5), (0, 1.0)]
    path = graph.path_set(nodes, start=start, goal=goal)
    path.solve()
    plan = path.to_plan()
    assert plan.verify().ok
    assert len(plan.start) == len(plan.goal) == 3
    assert plan.grasps[-1].contacts.keys() >= {1}


def test_one_set_with_nothing_to_choose() -> None:
    graph = graph_of("block")
    path = graph.path_set(on_edges(graph, (0, 2)), [(0, 3.0), (2, 3.0)], [(0, 2.5), (2, 3.25)])
    assert path.names == ()
    assert path.solve() == path.largest_margin == path.margin_of([]) == np.inf
    assert path.solve(cp.Minimize(path.travel)) == pytest.approx(0.75)
    assert path.constraints == []
    assert path.sample(3).shape == (3, 0)
    plan = path.to_plan()
    assert plan.verify().ok
    assert len(plan.steps) == 1


def test_values_outside_say_by_how_much() -> None:
    path = bracket_path()
    with pytest.raises(rl.OptionError, match=r"u\[1,0\] has no value yet: call solve"):
        path.to_plan()
    path.solve()
    inside = path.values
    assert path.contains(inside)
    several = np.array([inside, inside])
    several[1, 0] = 5.5
    assert path.contains(several).tolist() == [True, False]
    assert path.margin_of(several)[0] == path.margin_of(inside) > 0 > path.margin_of(several)[1]
    with pytest.raises(
        rl.NotForceClosureError, match=r"step 1, with u\[1,0\], .* beyond the border"
    ):
        path.to_plan(several[1])
    several[1, 0] = 7.0
    with pytest.raises(rl.NotForceClosureError, match=r"u\[1,0\] = 7 is 1 off its edge"):
        path.to_plan(several[1])
    for wrong, message in (
        (inside[1:], "shape"),
        (several, "one array"),
        ("far", "numbers"),
        (np.full(len(inside), np.nan), "finite"),
    ):
        with pytest.raises(rl.OptionError, match=message):
            path.to_plan(wrong)


def test_values_on_the_border_are_no_plan() -> None:
    graph = graph_of("block")
    path = graph.path_set(on_edges(graph, (0, 2)))
    # at a friction of 0.4 the contacts of the 3 high block may be 1.2 apart along it, not more
    assert path.to_plan([3.0, 3.0 - 1.1999, 3.0, 3.0]).verify().ok
    with pytest.raises(rl.NotForceClosureError, match=r"step 0, .* is .* beyond the border"):
        path.to_plan([3.0, 3.0 - 1.2 - 1e-9, 3.0, 3.0])
    refused, place = 0, 3.0 - 1.2
    for _ in range(12):  # doubles around the border: a plan that is valid, or none
        try:
            assert path.to_plan([3.0, place, 3.0, 3.0]).verify().ok
        except rl.NotForceClosureError as error:
            assert "the border" in str(error)
            refused += 1
        place = np.nextafter(place, 3.0 if refused else 0.0)
    assert 0 < refused < 12


def test_fingers_do_not_meet_round_a_corner() -> None:
    graph = graph_of("block", 5)
    nodes = on_edges(graph, (0, 1, 2), (0, 2))
    # finger 2 on edge 1 is still on the corner when one is placed there on edge 0
    at = {"u[0,0]": 2.0, "u[0,1]": 0.0, "u[0,2]": 4.0, "u[1,0]": 2.0, "u[1,1]": 0.0, "u[1,2]": 4.0}
    at |= {"u[2,0]": 6.0, "u[2,2]": 0.0, "u[3,0]": 6.0, "u[3,2]": 0.0}
    off = np.array(list(at.values()))
    off[4] = 1e-6
    loose = (p for p in graph.path_sets(nodes) if p.steps.choice.held == ((),))
    path = next(p for p in loose if p.names == tuple(at) and p.contains(off))
    assert path.to_plan(off).verify().ok
    with pytest.raises(rl.NotForceClosureError, match="is 0 from the border"):
        path.to_plan(list(at.values()))


def test_a_hand_that_keeps_away_from_the_ends() -> None:
    hand = rl.Hand(4, edge_clearance=0.4)
    graph = rl.build_switching_graph(POLYGONS["block"], 0.4, hand=hand)
    path = graph.path_set(on_edges(graph, (0, 2), (0, 1, 2)), start=[(0, 3.0), (2, 3.0)])
    lengths = {edge: graph.polygon.edge_lengths[edge] for edge in range(4)}
    for values in path.sample(20, seed=3):
        for name, position in zip(path.names, values, strict=True):
            edge = int(name.split(",")[1].rstrip("]'"))
            assert 0.4 <= position <= lengths[edge] - 0.4
        assert path.to_plan(values).verify().ok
    spaced = rl.build_switching_graph(POLYGONS["block"], 0.4, hand=rl.Hand(4, max_span=4.0))
    with pytest.raises(rl.HandError, match="state them as constraints"):
        spaced.path_set([0])


# --- samples ------------------------------------------------------------------------------------


def simplex(dimension: int, thin: float) -> LinearSets:
    """``x_0 / thin + x_1 + ... < 1`` in the positive quadrant."""
    rows = np.ones((1, 1, dimension))
    rows[0, 0, 0] = 1 / thin
    box = np.zeros((1, dimension)), np.ones((1, dimension))
    names = tuple(f"x{i}" for i in range(dimension))
    return LinearSets(names, rows, np.ones((1, 1)), np.ones((1, 1)), *box)


@pytest.mark.parametrize("dimension", [1, 2, 4, 6])
@pytest.mark.parametrize("thin", [1.0, 1e-6])
def test_samples_of_a_simplex_are_uniform(dimension: int, thin: float) -> None:
    sets = simplex(dimension, thin)
    points = sample_uniformly(sets, 1500, np.random.default_rng(7), get_solver("highs"))
    assert (sets.take(np.zeros(1500, dtype=int)).margins(points) > 0).all()
    points[:, 0] /= thin
    sides = np.column_stack((points, 1 - points.sum(axis=1)))
    # of n + 1 barycentric coordinates each is beyond t with probability (1 - t)^n
    for side in sides.T:
        assert stats.kstest(1 - (1 - side) ** dimension, "uniform").pvalue > 1e-3
    # and of two together, no matter how the others lie
    share = sides[:, 0] / (sides[:, 0] + sides[:, -1])
    assert stats.kstest(share, "uniform").pvalue > 1e-3
    # samples do not remember each other
    assert abs(np.corrcoef(sides[:-1, 0], sides[1:, 0])[0, 1]) < 0.1


def test_blocks_are_independent() -> None:
    box = LinearSets(
        ("x", "y"),
        np.zeros((1, 0, 2)),
        np.zeros((1, 0)),
        np.zeros((1, 0)),
        np.array([[-1.0, 5.0]]),
        np.array([[1.0, 5.5]]),
    )
    points = sample_uniformly(box, 4000, np.random.default_rng(11), get_solver("highs"))
    cells = np.histogram2d(*points.T, bins=5, range=[[-1, 1], [5, 5.5]])[0]
    assert stats.chisquare(cells.ravel()).pvalue > 1e-3


def test_samples_of_a_path_set_are_those_of_rejection() -> None:
    graph = graph_of("block")
    path = graph.path_set(on_edges(graph, (0, 2), (0, 1, 2)), start=[(0, 3.0), (2, 3.0)])
    region, rng = path.region, np.random.default_rng(3)
    drawn = rng.uniform(region.lower[0], region.upper[0], (400_000, len(path.names)))
    drawn = drawn[path.contains(drawn)]
    samples = path.sample(1500, seed=4)
    assert len(drawn) > 1000
    assert (path.margin_of(samples) > 0).all()
    weights = rng.standard_normal((4, len(path.names)))
    for direction in (*np.eye(len(path.names)), *weights):
        assert stats.ks_2samp(drawn @ direction, samples @ direction).pvalue > 1e-3


def test_samples_at_a_level_and_by_seed() -> None:
    path = bracket_path()
    level = 0.9 * path.largest_margin
    samples = path.sample(100, seed=1, margin=level)
    assert (path.margin_of(samples) > level).all()
    assert (path.sample(100, seed=1, margin=level) == samples).all()
    assert (path.sample(100, seed=2, margin=level) != samples).all()
    assert path.sample(0).shape == (0, len(path.names))
    with pytest.raises(rl.SolverError, match="set to sample is empty"):
        path.sample(10, margin=1.01 * path.largest_margin)
    for n in (-1, 2.5, True):
        with pytest.raises(rl.OptionError, match="number of samples"):
            path.sample(n)  # type: ignore[arg-type]


# --- what is no path ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        ([], "the path is empty"),
        ([99], "no grasp set 99: there are 26"),
        ([-1], "no grasp set -1"),
        ([1.5], "numbers of sets, not of 1.5"),
        ([True], "not of True"),
        ([1, 16, 19], r"sets 16 and 19 .* not adjacent: .* \(0, 4, 5\) and \(1, 3, 5\)"),
        ([1, 1], "sets 1 and 1 .* not adjacent"),
    ],
)
def test_paths_that_are_none(nodes: list[int], message: str) -> None:
    graph = graph_of("bracket")
    for ask in (graph.path_set, graph.path_sets):
        with pytest.raises(rl.OptionError, match=message):
            ask(nodes)


def test_ends_that_are_elsewhere() -> None:
    graph = graph_of("bracket")
    grasp = [(0, 0.5), (4, 0.5)]
    with pytest.raises(
        rl.ContactError, match=r"start is not in set 16 .* first .* it is in sets 1"
    ):
        graph.path_set([16, 3], start=grasp)
    with pytest.raises(rl.ContactError, match=r"goal is not in set 3 .* last of the path"):
        graph.path_set([16, 3], goal=grasp)
    with pytest.raises(rl.NotForceClosureError, match="start"):
        graph.path_set([1], start=[(0, 5.5), (4, 0.5)])
