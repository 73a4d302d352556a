"""Several plans for one question: their order, what steers them, and that nothing is changed."""

from __future__ import annotations

import json
import pickle
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import combinations, islice, pairwise, permutations, product
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from conftest import covering
from geometry import ell, rectangle, right_triangle, star, unit_square
from regrasps import directed, random_grasps, tee

import regrasp_lp as rl
from regrasp_lp import build
from regrasp_lp.cli import main
from regrasp_lp.planning import alternatives
from regrasp_lp.planning.bottleneck import Route
from regrasp_lp.planning.branches import END, Branch
from regrasp_lp.planning.ends import supports
from regrasp_lp.planning.levels import PieceRows
from regrasp_lp.planning.moves import KnownMoves
from regrasp_lp.planning.widest import WidestProblem
from regrasp_lp.planning.widest_routes import WidestRoutes, _Ways, path_of
from regrasp_lp.switches import SwitchesOnDemand

POLYGONS = {
    "square": (unit_square(), 0.6),
    "rectangle": (rectangle(), 0.3),
    "triangle": (right_triangle(), 0.6),
    "ell": (ell(), 0.3),
    "tee": (tee(), 0.4),
    "star": (star(6, 2), 0.35),
    "star 12": (star(12, 1), 0.3),
}
OBJECTIVES = ("placements", "margin", "tolerance")


@cache
def graph_of(name: str, fingers: int = 4, sets: str = "complete") -> rl.SwitchingGraph:
    polygon, friction = POLYGONS[name]
    return rl.build_switching_graph(polygon, friction, rl.Hand(fingers), sets)


@cache
def questions(name: str, count: int = 3) -> list[tuple[rl.Grasp, rl.Grasp]]:
    """Pairs of grasps, of three and of two contacts."""
    polygon, friction = POLYGONS[name]
    rng = np.random.default_rng(5)
    three = random_grasps(polygon, friction, rng, 2 * count, 3)
    two = random_grasps(polygon, friction, rng, count, 2) or three
    grasps = [polygon.resolve(g) for g in (*three, *two)]
    chosen = [rng.choice(len(grasps), 2, replace=False) for _ in range(count)]
    return [(grasps[i], grasps[j]) for i, j in chosen]


def assert_ordered(plans: list[rl.Plan]) -> None:
    values = [plan.value for plan in plans]
    sign = -1 if plans[0].objective.maximised else 1
    for one, other in pairwise(values):
        assert sign * one <= sign * other + 1e-6 * max(abs(one), abs(other), 1e-3) or one == other


# --- several plans ------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "objective"), covering(["rectangle", "star 12"], OBJECTIVES))
def test_plans_are_verified_different_and_in_order(name: str, objective: str) -> None:
    graph = graph_of(name)
    for start, goal in questions(name)[:1]:
        plans = graph.plans(start, goal, 5, objective=objective)
        best = graph.plan(start, goal, objective=objective)
        assert plans[0] == best
        assert len(plans) == 5
        assert all(plan.verify().ok for plan in plans)
        assert_ordered(plans)
        assert {plan.bound for plan in plans} == {best.bound}
        assert {plan.objective for plan in plans} == {best.objective}
        for one, other in combinations(plans, 2):
            assert not same_steps(one, other)
        for k in (1, 3):
            assert graph.plans(start, goal, k, objective=objective) == plans[:k]


def same_steps(one: rl.Plan, other: rl.Plan) -> bool:
    """Whether two plans are equal but for rounding."""
    if [type(s) for s in one.steps] != [type(s) for s in other.steps]:
        return False
    return all(
        here.contacts.keys() == there.contacts.keys()
        and all(
            here.contacts[f].edge == there.contacts[f].edge
            and abs(here.contacts[f].fraction - there.contacts[f].fraction) < 1e-7
            for f in here.contacts
        )
        for here, there in zip(one.grasps, other.grasps, strict=True)
    )


@pytest.mark.parametrize("name", ["tee", "star"])
def test_repositioning_comes_in_order_of_its_paths(name: str) -> None:
    graph = graph_of(name)
    for start, goal in questions(name)[:2]:
        plans = graph.plans(start, goal, 3, "regrip")
        assert plans[0] == graph.plan(start, goal, "regrip")
        assert graph.plans(start, goal, 1, "regrip") == plans[:1]
        for plan in plans:
            assert plan.verify().ok
            assert plan.bound is not None
            assert plan.bound <= plan.placements
            assert not any(isinstance(step, rl.Slide) for step in plan.steps)


def test_nothing_to_do_is_one_plan() -> None:
    graph = graph_of("rectangle")
    start, _ = questions("rectangle")[0]
    for objective in OBJECTIVES:
        (plan,) = graph.plans(start, start, 3, objective=objective)
        assert plan.steps == ()


def test_fewer_plans_than_asked_for() -> None:
    """Each way through a small graph once: as many plans as there are paths, or fewer."""
    graph = graph_of("triangle", 3)
    start, goal = questions("triangle")[0]
    plans = graph.plans(start, goal, 500)
    assert 1 < len(plans) < 500
    ends = [graph.locate(grasp) for grasp in (start, goal)]
    known = graph.to_networkx()
    every = sum(len(list(nx.all_simple_paths(known, s, t))) for s, t in product(*ends) if s != t)
    assert len(plans) <= every + len(set(ends[0]) & set(ends[1]))


@pytest.mark.parametrize("k", [0, -1, 2.0, True, "3", None])
def test_numbers_of_plans_without_meaning(k: object) -> None:
    start, goal = questions("rectangle")[0]
    with pytest.raises(rl.OptionError, match="k must be a number of plans"):
        graph_of("rectangle").plans(start, goal, k)  # type: ignore[arg-type]


def test_objectives_without_alternatives() -> None:
    start, goal = questions("rectangle")[0]
    with pytest.raises(rl.OptionError, match="not for 'travel'"):
        graph_of("rectangle").plans(start, goal, 2, objective="travel")


def test_paths_that_lead_to_no_plan_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = graph_of("tee")
    start, goal = questions("tee")[0]
    plans = graph.plans(start, goal, 6)
    failing = plans[0], plans[2]
    perform = rl.planning.planner.perform  # type: ignore[attr-defined]

    def fail(*arguments: object) -> rl.Plan:
        plan = perform(*arguments)
        if any(same_steps(plan, other) for other in failing):
            raise rl.SolverError("within rounding")
        return plan

    monkeypatch.setattr("regrasp_lp.planning.planner.perform", fail)
    left = graph.plans(start, goal, 4)
    assert left == [plans[1], *plans[3:]]
    assert {plan.bound for plan in left} == {plans[0].bound}
    monkeypatch.setattr(alternatives, "PATIENCE", 1)
    with pytest.raises(rl.SolverError, match="within rounding"):
        graph.plan(start, goal)


# --- the largest margins ------------------------------------------------------------------------


def routes_of(
    graph: rl.SwitchingGraph, start: rl.Grasp, goal: rl.Grasp, measure: str = "margin"
) -> WidestRoutes:
    problem = graph._problem
    rows = PieceRows(graph.sets.sources, measure)  # type: ignore[arg-type]
    moves = KnownMoves(rows, graph.switches, graph.hand)
    first, last = (supports(rows, graph.sets, grasp, 4) for grasp in (start, goal))
    return WidestRoutes(WidestProblem(rows, moves, graph.hand, problem.solver, first, last))


def route(found: object) -> Route:
    assert isinstance(found.route, Route)  # type: ignore[attr-defined]
    return found.route  # type: ignore[attr-defined,no-any-return]


TINY = [("rectangle", 3, "complete"), ("ell", 4, "chapter"), ("triangle", 3, "complete")]


@pytest.mark.parametrize(("name", "fingers", "sets"), TINY)
def test_every_path_has_its_route(name: str, fingers: int, sets: str) -> None:
    """All simple paths of sets are among the routes: each can be gone with some margin."""
    graph = graph_of(name, fingers, sets)
    known = graph.to_networkx()
    for index, other in ((0, len(graph) - 1), (1, 2)):
        start, goal = graph.sets[index].witness, graph.sets[other].witness
        ends = [graph.locate(grasp) for grasp in (start, goal)]
        if not all(ends):
            continue
        every = {
            tuple(path)
            for s, t in product(*ends)
            for path in ([[s]] if s == t else nx.all_simple_paths(known, s, t))
        }
        found = [*routes_of(graph, start, goal).in_order()]
        paths = [path_of(route(one)) for one in found]
        assert len(set(paths)) == len(paths)
        assert {path for path in paths if len(set(path)) == len(path)} == every
        levels = [one.level for one in found]
        assert levels == sorted(levels, reverse=True)


def test_every_path_from_poor_grasps_has_its_route() -> None:
    """Grasps below the level are left by a first switch and come to by a last one."""
    graph, tried = graph_of("ell", 3), 0
    polygon, friction = POLYGONS["ell"]
    known = graph.to_networkx()
    grasps = random_grasps(polygon, friction, np.random.default_rng(3), 40, 3)
    grasps.sort(key=lambda grasp: rl.margin(polygon, grasp, friction))
    for start, goal in combinations(map(polygon.resolve, grasps[:5]), 2):
        ends = [
            [index for index, some in graph.sets.holding(grasp) if len(some) == len(grasp)]
            for grasp in (start, goal)
        ]
        every = [p for s, t in product(*ends) if s != t for p in nx.all_simple_paths(known, s, t)]
        found = [*islice(routes_of(graph, start, goal).in_order(), 40)]
        paths = [path_of(route(one)) for one in found if len(set(path_of(route(one)))) > 1]
        assert len(set(paths)) == len(paths)
        assert {path for path in paths if len(set(path)) == len(path)} <= set(map(tuple, every))
        if len(found) < 40:
            assert set(map(tuple, every)) <= set(paths)
        tried += len(every) > 1
    assert tried > 1


def test_the_way_back_is_the_way_onward() -> None:
    """What a class allows from a set onward it allows back from the goals, and nothing else."""
    sets = range(4)
    prefixes = [p for n in range(4) for p in permutations(sets, n)]
    closed = [frozenset(c) for n in range(2) for c in combinations((*sets, END), n)]
    throughs = [None, np.array([True, False, True, False])]
    for prefix, shut, through in product(prefixes, closed, throughs):
        branch = Branch(prefix, shut)
        starts, goals = [0, 1], [1, 2, 3]
        ways = _Ways(branch, through, np.array(starts), np.array(goals))
        for goal, one in product(goals, sets):
            if not branch.ends(goal) or one == goal:
                continue
            allowed = branch.follows(one, goal)
            if through is not None:  # what may not be passed through is first or last, not both
                allowed &= bool(through[one]) or one in starts
                allowed &= bool(through[goal]) or goal not in starts
            assert ways.back(goal, np.array([one])).tolist() == [allowed]
            assert ways.onward(one, np.array([goal])).tolist() == [allowed]


@pytest.mark.parametrize(
    ("name", "sets", "measure"),
    [
        ("star 12", "complete", "margin"),
        ("ell", "chapter", "tolerance"),
        pytest.param("star 12", "complete", "tolerance", marks=pytest.mark.slow),
        pytest.param("ell", "chapter", "margin", marks=pytest.mark.slow),
    ],
)
def test_no_other_path_is_better(name: str, sets: str, measure: str) -> None:
    """Avoid one set of each of the paths so far: what is left is no better than the next one."""
    graph = graph_of(name, 4, sets)
    size, compared = graph.polygon.diameter, 0
    for start, goal in islice(far_apart(graph), 2):
        routes = routes_of(graph, start, goal, measure)
        found = list(islice(routes.in_order(), 4))
        ends = {*graph.locate(start), *graph.locate(goal)}
        for count in range(1, len(found)):
            inner = [set(path_of(route(one))) - ends for one in found[:count]]
            for hit in islice({frozenset(some) for some in product(*inner)}, 4):
                through = np.ones(len(graph), dtype=bool)
                through[list(hit)] = False
                best = WidestRoutes(routes.problem, through).best
                compared += 1
                assert best.level <= found[count].level + 1e-6 * size
                assert best.route is None or not hit & set(path_of(best.route))
    assert compared > 3


def far_apart(graph: rl.SwitchingGraph) -> Iterator[tuple[rl.Grasp, rl.Grasp]]:
    """Grasps that are joined, but only by way of other sets than those that hold them."""
    known = graph.to_networkx()
    rng = np.random.default_rng(2)
    for i, j in rng.integers(len(graph), size=(300, 2)).tolist():
        start, goal = graph.sets[i].witness, graph.sets[j].witness
        ends = graph.locate(start), graph.locate(goal)
        pairs = list(product(*ends))
        near = any(s == t or known.has_edge(s, t) for s, t in pairs)
        if pairs and not near and nx.has_path(known, *pairs[0]):
            yield start, goal


@pytest.mark.parametrize("objective", ["tolerance"])
def test_values_are_those_of_the_plans(objective: str) -> None:
    graph = graph_of("tee")
    for start, goal in questions("tee")[:2]:
        routes = islice(routes_of(graph, start, goal, objective).in_order(), 8)
        levels = sorted((one.level for one in routes), reverse=True)
        for plan in graph.plans(start, goal, 3, objective=objective):
            close = np.isclose(levels, plan.value, rtol=1e-5) | (np.array(levels) == plan.value)
            assert close.any()


# --- what steers --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "objective"), covering(["rectangle", "tee", "star 12"], OBJECTIVES)
)
def test_avoiding_edges_is_planning_without_them(name: str, objective: str) -> None:
    """As with a hand that may not touch them, of which a graph of its own is built."""
    polygon, friction = POLYGONS[name]
    graph, compared = graph_of(name), 0
    for start, goal in questions(name)[:2]:
        used = {c.edge for c in (*start, *goal)}
        for edge in sorted(set(range(polygon.n_edges)) - used)[:2]:
            hand = rl.Hand(4, reachable={edge: None})
            other = rl.build_switching_graph(polygon, friction, hand)
            try:
                expected = other.plan(start, goal, objective=objective)
            except rl.NoPlanFound:
                with pytest.raises(rl.NoPlanFound, match="avoid_edges"):
                    graph.plan(start, goal, objective=objective, avoid_edges=[edge])
                continue
            plan = graph.plan(start, goal, objective=objective, avoid_edges=[edge])
            compared += 1
            assert plan.bound == pytest.approx(expected.bound, rel=1e-6)
            assert plan.gap == 0
            assert all(c.edge != edge for held in plan.grasps for c in held.contacts.values())
            if objective == "placements":
                assert plan.path == expected.path
    assert compared > 0


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_avoided_sets_are_only_first_or_last(objective: str) -> None:
    graph = graph_of("tee")
    for start, goal in questions("tee")[:2]:
        ends = {*graph.locate(start), *graph.locate(goal)}
        free = graph.plan(start, goal, objective=objective)
        avoided = {i for label in free.path[1:-1] for i in graph.sets.on_edges(label[1])} | ends
        try:
            plans = graph.plans(start, goal, 3, objective=objective, avoid_sets=avoided)
        except rl.NoPlanFound as error:
            assert "rule out" in str(error)
            continue
        for plan in plans:
            assert plan.verify().ok
            inner = {i for label in plan.path[1:-1] for i in graph.sets.on_edges(label[1])}
            assert not inner & (avoided - ends)
        assert_ordered([free, *plans])


def test_nothing_avoided_is_the_plan_itself() -> None:
    graph = graph_of("rectangle")
    start, goal = questions("rectangle")[0]
    for objective in OBJECTIVES:
        plan = graph.plan(start, goal, objective=objective)
        assert graph.plan(start, goal, objective=objective, avoid_edges=(), avoid_sets=[]) == plan
        unused = {
            i
            for i in range(len(graph))
            if graph.sets[i].edges not in dict.fromkeys(edges for _, edges in plan.path)
        }
        kept = graph.plan(start, goal, objective=objective, avoid_sets=unused)
        assert kept.value == pytest.approx(plan.value, rel=1e-6)


def test_everything_avoided() -> None:
    graph = graph_of("square")
    start = graph.polygon.resolve(rl.Grasp([(0, 0.5), (2, 0.5)]))
    goal = graph.polygon.resolve(rl.Grasp([(0, 0.3), (1, 0.3), (2, 0.6)]))
    plan = graph.plan(start, goal, avoid_edges=range(4))
    assert plan.verify().ok
    assert len(plan.path) <= 2
    graph = graph_of("star 12")
    start, goal = next(far_apart(graph))
    with pytest.raises(rl.NoPlanFound, match="avoid_edges, avoid_sets or weight rule out"):
        graph.plan(start, goal, weight=lambda u, v, data: None)
    with pytest.raises(rl.NoPlanFound, match="avoid_edges, avoid_sets or weight rule out"):
        graph.plans(start, goal, 3, "regrip", avoid_sets=range(len(graph)))


def test_weights_choose_the_path() -> None:
    """Against networkx: sets that touch an edge are worth avoiding, but may be needed."""
    graph = graph_of("tee")
    costs = directed(graph)

    def weight(u: int, v: int, data: dict[str, object]) -> float:
        edges = data["edges"]
        assert isinstance(edges, tuple)
        return 1 + 5 * (2 in edges)

    for u, v in costs.edges:
        costs.edges[u, v]["weight"] = weight(u, v, costs.nodes[v])
    for start, goal in questions("tee"):
        plan = graph.plan(start, goal, weight=weight)
        assert plan.verify().ok
        assert (plan.bound, plan.gap) == (None, None)
        best = min(
            nx.shortest_path_length(costs, s, t, weight="weight")
            for s, t in product(graph.locate(start), graph.locate(goal))
        )
        plans = graph.plans(start, goal, 3, weight=weight)
        assert plans[0] == plan
        path = [graph.sets.on_edges(edges)[0] for _, edges in plan.path]
        assert nx.path_weight(costs, path, "weight") == best


def test_a_weight_hides_switches() -> None:
    graph = graph_of("star 12")
    start, goal = next(far_apart(graph))
    plan = graph.plan(start, goal)
    hidden = {i for _, edges in plan.path[1:-1] for i in graph.sets.on_edges(edges)}
    ends = {*graph.locate(start), *graph.locate(goal)}
    hidden -= ends
    assert hidden
    round_ = graph.plan(start, goal, weight=lambda u, v, data: None if v in hidden else 1)
    used = {i for _, edges in round_.path for i in graph.sets.on_edges(edges)}
    assert not used & hidden


@pytest.mark.parametrize("objective", ["margin", {"placements": 1, "margin": 1}])
def test_a_weight_is_no_second_objective(objective: object) -> None:
    start, goal = questions("tee")[0]
    with pytest.raises(rl.OptionError, match="means nothing with"):
        graph_of("tee").plan(start, goal, objective=objective, weight=lambda u, v, data: 1)  # type: ignore[arg-type]


def test_steered_without_a_graph() -> None:
    polygon, friction = POLYGONS["star 12"]
    graph = graph_of("star 12")
    start, goal = questions("star 12")[0]
    used = {c.edge for c in (*start, *goal)}
    edge = min(set(range(12)) - used)
    asked = {"weight": lambda u, v, data: 3 - data["held"], "avoid_edges": {edge}}
    plan = rl.plan_regrasp(polygon, start, goal, friction, **asked)
    assert plan == graph.plan(start, goal, **asked)
    with pytest.raises(rl.OptionError, match="edges 0 to 11"):
        rl.plan_regrasp(polygon, start, goal, friction, avoid_edges=[12])


# --- the graph ----------------------------------------------------------------------------------


def arrays_of(graph: rl.SwitchingGraph) -> list[bytes]:
    return [array.tobytes() for array in graph._arrays()]


def test_questions_do_not_change_the_graph() -> None:
    """Asked one after the other, or at once by several threads: the answers are the same."""
    polygon, friction = POLYGONS["tee"]
    graph = rl.build_switching_graph(polygon, friction)
    copy, before = pickle.loads(pickle.dumps(graph)), arrays_of(graph)

    def ask(number: int) -> list[rl.Plan]:
        start, goal = questions("tee")[number % 3]
        kind = number // 3
        if kind < 3:
            return graph.plans(start, goal, 2, objective=OBJECTIVES[kind])
        if kind == 3:
            return graph.plans(start, goal, 2, weight=lambda u, v, data: u + v)
        return graph.plans(start, goal, 2, avoid_sets=[number])

    with ThreadPoolExecutor(4) as pool:
        at_once = list(pool.map(ask, range(0, 15, 2)))
    assert arrays_of(graph) == before
    assert graph == copy
    assert [ask(number) for number in range(0, 15, 2)] == at_once
    assert arrays_of(graph) == before


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_switches_found_on_demand(monkeypatch: pytest.MonkeyPatch, objective: str) -> None:
    polygon, friction = POLYGONS["ell"]
    stored = graph_of("ell")
    monkeypatch.setattr(build, "STORE_LIMIT", 1)
    graph = rl.build_switching_graph(polygon, friction)
    assert isinstance(graph.switches, SwitchesOnDemand)
    for start, goal in questions("ell")[:1]:
        plans = graph.plans(start, goal, 3, objective=objective)
        expected = stored.plans(start, goal, 3, objective=objective)
        values = [plan.value for plan in plans]
        assert values == pytest.approx([plan.value for plan in expected], rel=1e-6)
        assert all(plan.verify().ok for plan in plans)
        edge = min(set(range(6)) - {c.edge for c in (*start, *goal)})
        asked = {"objective": objective, "avoid_edges": [edge]}
        assert graph.plan(start, goal, **asked).value == pytest.approx(
            stored.plan(start, goal, **asked).value, rel=1e-6
        )
        if objective == "placements":
            by_weight = [g.plan(start, goal, weight=lambda u, v, _: v) for g in (graph, stored)]
            assert by_weight[0].path == by_weight[1].path


# --- the command line ---------------------------------------------------------------------------


def test_alternatives_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    polygon = rl.Polygon(tee().vertices, name="tee")
    file = tmp_path / "tee.geojson"
    points = [*polygon.vertices.tolist(), polygon.vertices[0].tolist()]
    feature = {
        "type": "Feature",
        "properties": {"name": "tee"},
        "geometry": {"type": "Polygon", "coordinates": [points]},
    }
    file.write_text(json.dumps(feature))
    start, goal = "0:1,4:3,3:1", "7:1,1:2"
    common = ["plan", str(file), "--friction", "0.6", "--start", start, "--goal", goal]
    out = tmp_path / "plan.json"
    assert main([*common, "--alternatives", "3", "--json", str(out)]) == 0
    printed = capsys.readouterr().out
    graph = rl.build_switching_graph(polygon, 0.6)
    grasps = [
        rl.Grasp([tuple(map(int, c.split(":"))) for c in g.split(",")]) for g in (start, goal)
    ]
    plans = graph.plans(*grasps, 3)
    assert str(plans[0]) in printed
    table = printed[printed.index("3 plans, the best:") :].splitlines()
    for number, (plan, row) in enumerate(zip(plans, table[2:], strict=False), 1):
        name = out if number == 1 else out.with_stem(f"plan-{number}")
        assert rl.read_plan(name) == plan
        assert row.split()[:2] == [str(number), str(plan.placements)]
        assert row.endswith(" > ".join(",".join(map(str, edges)) for _, edges in plan.path))
    assert main([*common, "--alternatives", "0"]) == 2
    assert "write 1 or more" in capsys.readouterr().err
