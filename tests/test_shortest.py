"""Routes of least cost against integer programs for every route, and bounds against other plans."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import combinations, pairwise, permutations

import numpy as np
import pytest
from conftest import covering
from geometry import comb, ell, rectangle, right_triangle, star, unit_square
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from polygons import FRICTIONS, stars, tangles
from regrasps import random_grasps, tee
from scipy.optimize import Bounds, LinearConstraint, milp

import regrasp_lp as rl
from regrasp_lp.contact_rule import meet_held
from regrasp_lp.friction import Cones
from regrasp_lp.lp import get_solver
from regrasp_lp.planning.along import least_margin_along
from regrasp_lp.planning.costs import Budget, Shortest
from regrasp_lp.planning.execution import Execution
from regrasp_lp.planning.objective import Objective
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.route_lp import Route, RoutePrograms, Terminal
from regrasp_lp.planning.set_rows import Choice
from regrasp_lp.planning.shortest import FLOOR, shortest_route
from regrasp_lp.planning.shortest_slide import shortest_slide
from regrasp_lp.switches import SwitchesOnDemand, SwitchRule
from regrasp_lp.torque import TorqueFunctions, torque_functions

POLYGONS = {
    "rectangle": (rectangle(), 0.4),
    "square": (unit_square(), 0.6),
    "triangle": (right_triangle(), 0.6),
    "ell": (ell(), 0.4),
    "tee": (tee(), 0.4),
    "comb": (comb(2), 0.5),
    "star": (star(8, 3), 0.4),
}


@cache
def graph_of(name: str, fingers: int = 4, sets: str = "complete") -> rl.SwitchingGraph:
    polygon, friction = POLYGONS[name]
    return rl.build_switching_graph(polygon, friction, rl.Hand(fingers), sets)


def terminals(graph: rl.SwitchingGraph, grasp: rl.Grasp, *, goal: bool) -> list[Terminal]:
    """The sets that hold a grasp; of complete ones those that hold a part are a choice."""
    found, size = [], graph.sets.cones.size
    for index, chosen in graph.sets.holding(graph.polygon.resolve(grasp)):
        left, most = len(grasp) - len(chosen), (np.inf, np.inf)
        part = rl.Grasp([grasp.contacts[i] for i in chosen])
        if left and graph.options.sets == "complete":
            own = (rl.margin, rl.tolerance)
            margin, tolerance = (float(f(graph.polygon, part, graph.friction)) for f in own)
            most = margin / size, tolerance / size
        fractions = grasp.fractions[list(chosen)]
        found.append(Terminal(index, fractions, left if goal else 0, most))
    return found


def shortest(
    graph: rl.SwitchingGraph,
    start: rl.Grasp,
    goal: rl.Grasp,
    objective: str | dict[str, float],
    budget: Budget | None = None,
    floor: float | None = None,
) -> Shortest | None:
    return shortest_route(
        graph.sets,
        graph.switches,
        graph.hand,
        terminals(graph, start, goal=False),
        terminals(graph, goal, goal=True),
        Objective.of(objective),
        budget=budget,
        floor=floor,
    )


def pairs_of(name: str, count: int, seed: int = 3) -> list[tuple[rl.Grasp, rl.Grasp]]:
    polygon, friction = POLYGONS[name]
    rng = np.random.default_rng(seed)
    three = random_grasps(polygon, friction, rng, count + 1, 3)
    two = random_grasps(polygon, friction, rng, count + 1, 2)
    grasps = [polygon.resolve(grasp) for pair in zip(three, two, strict=True) for grasp in pair]
    grasps = [grasps[i] for i in rng.permutation(len(grasps))]
    return list(pairwise(grasps))[:count]


def plan_of(graph: rl.SwitchingGraph, found: Shortest, start: rl.Grasp, goal: rl.Grasp) -> rl.Plan:
    """The plan of numbered fingers along a route."""
    index, chosen = graph.sets.holding(start)[found.route.origin]
    assert index == found.path[0]
    fingers = {i + 1: contact for i, contact in enumerate(start)}
    run = Execution(graph.sets, graph.hand, fingers, [i + 1 for i in chosen], index)
    run.release_others()
    for t, (set_, nodes) in enumerate(zip(found.path, found.grasps, strict=True)):
        if t:
            run.switch(set_, found.held[t - 1], nodes[0])
        for node in nodes[1:]:
            run.slide(node)
    run.place_others(goal)
    steps, supports = tuple(run.steps), tuple(run.supports)
    friction = np.broadcast_to(graph.friction, (graph.polygon.n_edges,))
    return Plan(graph.polygon, friction, graph.hand, fingers, goal, steps, supports)


def travel_of(plan: rl.Plan) -> float:
    lengths = plan.polygon.edge_lengths
    total = 0.0
    for before, step in zip(plan.grasps, plan.steps, strict=False):
        if isinstance(step, rl.Slide):
            for finger, contact in step.moves.items():
                by = abs(contact.fraction - before.contacts[finger].fraction)
                total += float(lengths[contact.edge]) * by
    return total


# --- slides -------------------------------------------------------------------------------------


def check_slide(functions: TorqueFunctions, f: np.ndarray, g: np.ndarray) -> int:
    """A shortest slide is as long as if nothing were in the way, and holds at every instant."""
    way = shortest_slide(functions, f, g)
    lengths = functions.lengths[0]
    assert (way[0] == f).all()
    assert (way[-1] == g).all()
    length = float((np.abs(np.diff(way, axis=0)) @ lengths).sum())
    assert length == pytest.approx(float(np.abs(g - f) @ lengths), rel=1e-9, abs=1e-12)
    up = np.sign(g - f)
    assert (np.diff(way, axis=0) * up >= -1e-15).all()
    for one, other in pairwise(way):
        assert least_margin_along(functions, one, other) > 0
    for i in range(functions.m - 1):
        if functions.edges[0, i] == functions.edges[0, i + 1]:
            assert (way[:, i] < way[:, i + 1]).all()
    return len(way)


def grasps_in(functions: TorqueFunctions, rng: np.random.Generator, count: int) -> np.ndarray:
    points = rng.random((40 * count, functions.m))
    for i in range(functions.m - 1):
        if functions.edges[0, i] == functions.edges[0, i + 1]:
            points[:, i : i + 2].sort(axis=1)
    margins = np.array([float(functions.margins(p)[0]) for p in points])
    return points[margins > 1e-6 * functions.cones.size][:count]


@pytest.mark.parametrize("name", ["rectangle", "triangle", "ell", "tee", "comb", "star"])
def test_shortest_slides_of_every_set(name: str) -> None:
    graph = graph_of(name)
    rng = np.random.default_rng(5)
    bent = 0
    for index in range(len(graph)):
        functions = graph.sets.functions(index)
        points = grasps_in(functions, rng, 6)
        for f, g in pairwise(points):
            bent += check_slide(functions, f, g) > 2
    assert bent or name in ("rectangle", "triangle")


@pytest.mark.parametrize("sets", ["concurrent", "parallel"])
def test_shortest_slides_of_the_chapters_sets(sets: str) -> None:
    graph = rl.build_switching_graph(star(12, 1), 0.3, sets="chapter")
    rng = np.random.default_rng(2)
    checked = 0
    for index, grasp_set in enumerate(graph.sets):
        if grasp_set.kind == sets:
            for f, g in pairwise(grasps_in(graph.sets.functions(index), rng, 4)):
                check_slide(graph.sets.functions(index), f, g)
                checked += 1
    assert checked > 20


@settings(max_examples=60, deadline=None)
@given(st.one_of(stars(), tangles()), st.sampled_from(FRICTIONS), st.integers(0, 2**16))
def test_shortest_slides_on_any_polygon(polygon: rl.Polygon, friction: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cones = Cones.of(polygon, friction)
    done = 0
    for _ in range(12):
        edges = np.sort(rng.integers(0, polygon.n_edges, (1, int(rng.integers(2, 4)))), axis=1)
        if len(set(edges[0].tolist())) == 1:
            continue
        functions = torque_functions(cones, edges)
        if functions.spans[0] and functions.valid[0].any():
            for f, g in pairwise(grasps_in(functions, rng, 4)):
                check_slide(functions, f, g)
                done += 1
    assume(done)


# --- rows ---------------------------------------------------------------------------------------


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_rows_left_out_are_not_needed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.integers(0, 4, (6, 2)).astype(float) / 4
    choice = Choice(rows, rng.integers(-2, 4, 6).astype(float) / 4, 0)
    needed = choice.needed(0.0, 0.5)
    for f in rng.random((200, 2)):
        best = choice.slack(f).max()
        if needed is None:
            assert best >= 0.5
        elif best >= 0:
            assert needed.slack(f).max(initial=-np.inf) == pytest.approx(best)
        else:
            assert needed.slack(f).max(initial=-np.inf) <= best + 1e-12


# --- one route by an integer program ------------------------------------------------------------


@dataclass
class Sum:
    """Rows over growing columns, for an integer program."""

    rows: list[dict[int, float]]
    bounds: list[float]
    cost: dict[int, float]
    limits: list[tuple[float, float]]
    whole: list[bool]

    def column(self, low: float, high: float, whole: bool = False) -> int:
        self.limits.append((low, high))
        self.whole.append(whole)
        return len(self.limits) - 1

    def row(self, entries: dict[int, float], bound: float) -> None:
        self.rows.append(entries)
        self.bounds.append(bound)

    def solve(self) -> float | None:
        matrix = np.zeros((len(self.rows), len(self.limits)))
        for row, entries in zip(matrix, self.rows, strict=True):
            for column, value in entries.items():
                row[column] += value
        cost = np.zeros(len(self.limits))
        for column, value in self.cost.items():
            cost[column] += value
        result = milp(
            cost,
            constraints=LinearConstraint(matrix, -np.inf, np.array(self.bounds)),
            bounds=Bounds(*np.array(self.limits).T),
            integrality=np.array(self.whole, dtype=int),
            options={"mip_rel_gap": 0.0},
        )
        assert result.status in (0, 2), result.message
        return None if result.status == 2 else float(result.fun)


def route_optimum(
    graph: rl.SwitchingGraph,
    path: list[int],
    held: list[tuple[tuple[int, int], ...]],
    ends: tuple[Terminal, Terminal],
    weights: dict[str, float],
    given: tuple[bool, bool],
) -> float | None:
    """The least cost of one route without placements, in positions; None if it does not exist.

    Which functions are negative and positive are binary variables. `given` tells whether the start
    leaves the first set, and the goal arrives in the last one, without a slide.
    """
    size = graph.sets.sources[0].cones.size
    caps = float(graph.sets.margins.max()), float(graph.polygon.edge_lengths.max()) / 2
    program = Sum([], [], {}, [], [])
    margin = program.column(FLOOR * size, max(caps[0], FLOOR * size))
    tolerance = program.column(0.0, caps[1])
    for end in ends:
        for column, most in zip((margin, tolerance), end.most, strict=True):
            if np.isfinite(most):
                program.row({column: 1.0}, most * size)
    program.cost[margin] = -weights.get("margin", 0.0)
    program.cost[tolerance] = -weights.get("tolerance", 0.0)
    before: list[int] = []
    for t, index in enumerate(path):
        functions = graph.sets.functions(index)
        lengths = functions.lengths[0]
        columns: list[list[int]] = []
        for side, fixed in enumerate((t == 0, t == len(path) - 1)):
            terminal = ends[side]
            if fixed:
                at = lengths * terminal.fractions
                columns.append([program.column(u, u) for u in at.tolist()])
            else:
                columns.append([program.column(0.0, u) for u in lengths.tolist()])
        if t:
            for here, there in held[t - 1]:
                program.row({before[here]: 1.0, columns[0][there]: -1.0}, 0.0)
                program.row({before[here]: -1.0, columns[0][there]: 1.0}, 0.0)
        for i, (x, y) in enumerate(zip(*columns, strict=True)):
            slide = program.column(0.0, float(lengths[i]))
            program.cost[slide] = weights.get("travel", 0.0)
            program.row({y: 1.0, x: -1.0, slide: -1.0}, 0.0)
            program.row({x: 1.0, y: -1.0, slide: -1.0}, 0.0)
            if len(path) > 1 and ((t == 0 and given[0]) or (t == len(path) - 1 and given[1])):
                program.row({slide: 1.0}, 0.0)
        for side, grasp in enumerate(columns):
            first, last = t == 0, t == len(path) - 1
            if (first and (side == 0 or given[0])) or (last and (side == 1 or given[1])):
                continue
            member(program, functions, grasp, margin, tolerance, weights)
        before = columns[1]
    return program.solve()


def member(
    program: Sum,
    functions: TorqueFunctions,
    grasp: list[int],
    margin: int,
    tolerance: int,
    weights: dict[str, float],
) -> None:
    """A grasp is in its set, its margin and tolerance no less than the columns."""
    lengths, valid = functions.lengths[0], np.flatnonzero(functions.valid[0])
    scales = [(margin, np.ones(len(valid)))]
    if weights.get("tolerance"):
        scales.append((tolerance, functions.rates[0, valid]))
        for column, length in zip(grasp, lengths.tolist(), strict=True):
            program.row({column: -1.0, tolerance: 1.0}, 0.0)
            program.row({column: 1.0, tolerance: 1.0}, length)
    for level, scale in scales:
        for sign in (1.0, -1.0):
            chosen = [program.column(0, 1, whole=True) for _ in valid]
            program.row(dict.fromkeys(chosen, -1.0), -1.0)
            for column, j, s in zip(chosen, valid, scale, strict=True):
                slopes = functions.slopes[0, j] / lengths / s
                offset = functions.offsets[0, j] / s
                large = 3 * (abs(offset) + float(functions.slopes[0, j].sum() / s)) + 20.0
                entries = {u: sign * float(w) for u, w in zip(grasp, slopes, strict=True)}
                program.row({**entries, level: 1.0, column: large}, large - sign * offset)
    edges = functions.edges[0].tolist()
    for i in range(len(edges) - 1):
        if edges[i] == edges[i + 1]:
            program.row({grasp[i]: 1.0, grasp[i + 1]: -1.0}, 0.0)


def all_routes(
    graph: rl.SwitchingGraph, start: Terminal, goals: list[Terminal], most: int
) -> Iterator[tuple[list[int], list[tuple[tuple[int, int], ...]], Terminal, int]]:
    """Every route with at most so many placements, from edges alone."""
    edges = [graph.sets[i].edges for i in range(len(graph))]

    def extend(
        path: list[int], held: list[tuple[tuple[int, int], ...]], placed: int, unpaid: set[int]
    ) -> Iterator[tuple[list[int], list[tuple[tuple[int, int], ...]], Terminal, int]]:
        here = path[-1]
        for goal in goals:
            if goal.index == here and placed + goal.placed <= most:
                yield path, held, goal, placed + goal.placed
        for there in range(len(edges)):
            n, m = len(edges[here]), len(edges[there])
            for count in range(max(0, n + m - graph.hand.fingers), min(n, m) + 1):
                cost = m - count
                if placed + cost > most or (cost == 0 and there in unpaid):
                    continue
                for slots in matchings(edges[here], edges[there], count):
                    after = unpaid | {there} if cost == 0 else {there}
                    yield from extend([*path, there], [*held, slots], placed + cost, after)

    yield from extend([start.index], [], 0, {start.index})


def matchings(
    one: tuple[int, ...], other: tuple[int, ...], count: int
) -> Iterator[tuple[tuple[int, int], ...]]:
    """Pairs of contacts on the same edges; two on one edge in their order."""
    for here in combinations(range(len(one)), count):
        for there in permutations(range(len(other)), count):
            pairs = tuple(zip(here, there, strict=True))
            ordered = all(b < d for (a, b), (c, d) in combinations(pairs, 2) if one[a] == one[c])
            if ordered and all(one[i] == other[j] for i, j in pairs):
                yield pairs


def brute_force(
    graph: rl.SwitchingGraph,
    start: rl.Grasp,
    goal: rl.Grasp,
    weights: dict[str, float],
    known: float,
    most: int,
) -> tuple[float, int]:
    """The least cost over all routes with so many placements, and how many were solved."""
    worth = sum(
        weights.get(name, 0.0) * cap
        for name, cap in (
            ("margin", float(graph.sets.margins.max())),
            ("tolerance", float(graph.polygon.edge_lengths.max()) / 2),
        )
    )
    best, solved = np.inf, 0
    goals = terminals(graph, goal, goal=True)
    for origin in terminals(graph, start, goal=False):
        for path, held, aim, placed in all_routes(graph, origin, goals, most):
            price = weights.get("placements", 0.0) * placed
            if price - worth >= min(best, known + 1e-6):
                continue
            for given_ in ((False, False), (True, False), (False, True), (True, True)):
                if len(path) == 1 and any(given_):
                    continue
                value = route_optimum(graph, path, held, (origin, aim), weights, given_)
                solved += 1
                if value is not None:
                    best = min(best, value + price)
    return best, solved


def check_against_brute_force(
    name: str, fingers: int, weights: dict[str, float], pair: int, most: int = 2
) -> int:
    """Our cost is the least of all routes with no more placements; how many were solved."""
    graph = graph_of(name, fingers)
    start, goal = pairs_of(name, 4)[pair]
    found = shortest(graph, start, goal, weights)
    assert found is not None
    assert found.placements <= most
    best, solved = brute_force(graph, start, goal, weights, found.cost, found.placements)
    assert found.cost == pytest.approx(best, abs=1e-6)
    assert found.bound <= best + 1e-6
    assert solved > 0
    return solved


TRAVEL = {"placements": 1.0, "travel": 1.0}


@pytest.mark.parametrize(
    ("name", "fingers", "pair", "weights"),
    [
        ("rectangle", 4, 0, TRAVEL),
        ("rectangle", 4, 3, TRAVEL),
        ("square", 4, 1, TRAVEL),
        ("square", 4, 2, TRAVEL),
        ("triangle", 4, 0, TRAVEL),
        ("triangle", 4, 1, TRAVEL),
        ("triangle", 4, 3, TRAVEL),
        ("ell", 3, 1, TRAVEL),
        ("ell", 4, 0, TRAVEL),
        ("rectangle", 4, 0, {**TRAVEL, "margin": 0.5}),
        ("rectangle", 4, 3, {**TRAVEL, "margin": 0.5}),
        ("square", 4, 1, {**TRAVEL, "tolerance": 0.5}),
        ("triangle", 4, 0, {"placements": 1.0, "margin": 1.0, "tolerance": 1.0}),
    ],
)
def test_no_route_is_cheaper(name: str, fingers: int, pair: int, weights: dict[str, float]) -> None:
    check_against_brute_force(name, fingers, weights, pair)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "pair", "weights"),
    [
        ("triangle", 2, TRAVEL),
        ("triangle", 3, {"placements": 1.0, "margin": 1.0, "tolerance": 1.0}),
        ("ell", 1, TRAVEL),
    ],
)
def test_no_route_is_cheaper_among_many(name: str, pair: int, weights: dict[str, float]) -> None:
    check_against_brute_force(name, 4, weights, pair)


def test_the_program_of_a_route_is_its_integer_program() -> None:
    """Random routes, whether they are good or not, with all weights."""
    graph = graph_of("ell")
    rng = np.random.default_rng(4)
    size = graph.sets.sources[0].cones.size
    weights = {"travel": 1.0, "margin": 0.7, "tolerance": 0.9}
    least = np.array([FLOOR, 0.0])
    most = np.array([graph.sets.margins.max(), graph.polygon.edge_lengths.max() / 2]) / size
    compared = 0
    for start, goal in pairs_of("ell", 4, seed=9):
        origins, aims = terminals(graph, start, goal=False), terminals(graph, goal, goal=True)
        programs = RoutePrograms(
            graph.sets, tuple(origins), tuple(aims), size * np.array([1, 0.7, 0.9]), least, most
        )
        routes = [
            (o, route)
            for o in range(len(origins))
            for route in all_routes(graph, origins[o], aims, 2)
        ]
        for number in rng.permutation(len(routes))[:6]:
            origin, (path, held, aim, _) = routes[number]
            expected = route_optimum(
                graph, path, held, (origins[origin], aim), weights, (False, False)
            )
            route = Route(tuple(path), tuple(held), origin=origin, aim=aims.index(aim))
            assert best_of(programs, route) == pytest.approx(
                np.inf if expected is None else expected, abs=1e-6
            )
            compared += expected is not None
    assert compared > 5


def best_of(programs: RoutePrograms, route: Route) -> float:
    """The least value of a route over all choices of rows, depth first."""
    best, pending = np.inf, [route]
    while pending:
        contacts = programs.solve(this := pending.pop())
        if contacts is None or contacts.bound > best:
            continue
        assert contacts.bound <= contacts.value + 1e-9
        if contacts.broken is None:
            best = min(best, contacts.value)
            continue
        grasp, choice, rows = contacts.broken
        pending += [this.choosing(grasp, choice, row) for row in reversed(rows)]
    return best


# --- bounds, plans, and what is odd -------------------------------------------------------------


@pytest.mark.parametrize(
    ("of", "objective"),
    covering(
        [("rectangle", 4), ("ell", 4), ("tee", 4), ("star", 4), ("comb", 3)],
        ["travel", {"placements": 0.5, "travel": 1.0}],
    ),
)
def test_plans_are_verified_and_no_other_plan_is_below_the_bound(
    of: tuple[str, int], objective: str | dict[str, float]
) -> None:
    name, fingers = of
    graph = graph_of(name, fingers)
    price = 0.0 if isinstance(objective, str) else objective["placements"]
    size = graph.sets.sources[0].cones.size
    solved = 0
    for start, goal in pairs_of(name, 3, seed=7):
        found = shortest(graph, start, goal, objective, Budget(200))
        if found is None:
            with pytest.raises(rl.NoPlanFound):
                graph.plan(start, goal)
            continue
        solved += 1
        plan = plan_of(graph, found, start, goal)
        assert plan.verify().ok, plan.verify().fault
        assert plan.placements == found.placements
        assert travel_of(plan) == pytest.approx(found.travel, abs=1e-9 * size)
        assert found.cost == pytest.approx(price * plan.placements + travel_of(plan), abs=1e-9)
        assert plan.chosen_margin >= min(found.margin, FLOOR * size) * (1 - 1e-6)
        assert found.gap >= 0
        for aligning in ("slide", "regrip"):
            try:
                other = graph.plan(start, goal, aligning)
            except rl.NoPlanFound:
                continue
            if other.chosen_margin >= FLOOR * size:
                assert found.bound <= price * other.placements + travel_of(other) + 1e-7 * size
    assert solved >= 2


def test_no_row_of_a_set_may_be_as_good_as_is_asked_for() -> None:
    graph = graph_of("ell")
    found = None
    for start, goal in pairs_of("ell", 8):
        found = shortest(graph, start, goal, TRAVEL)
        if found is not None and len(found.path) > 2:
            break
    assert found is not None
    ends = (terminals(graph, start, goal=False), terminals(graph, goal, goal=True))
    asked = np.array([0.0, 1e3])
    most = 2 * asked
    programs = RoutePrograms(graph.sets, *map(tuple, ends), np.array([1.0, 0, 1]), asked, most)
    grasps = [grasp for nodes in found.grasps for grasp in (nodes[0], nodes[-1])]
    assert any(not len(c.bounds) for i in found.path for c in programs.set_rows(i).choices)
    assert programs.settled(found.route, grasps, np.inf) is None


def test_more_programs_never_contradict_fewer() -> None:
    graph = graph_of("ell", 3)
    start, goal = pairs_of("ell", 8, seed=3)[0]
    for objective in ("travel", {"placements": 0.2, "travel": 1.0, "margin": 1.0}):
        found = []
        for programs in (30, 100, 300):
            try:
                one = shortest(graph, start, goal, objective, Budget(programs))
            except rl.SolverError:
                continue
            assert one is not None
            assert one.programs <= programs + 1
            found.append(one)
        assert len(found) >= 2
        assert max(one.bound for one in found) <= min(one.cost for one in found) + 1e-9


def test_ties_are_broken_by_placements() -> None:
    """Where no travel is needed the route has the fewest placements that do without."""
    checked = 0
    for name, fingers in (("ell", 4), ("square", 4)):
        graph = graph_of(name, fingers)
        for start, goal in pairs_of(name, 6):
            found = shortest(graph, start, goal, "travel", Budget(500))
            if found is None or found.travel > 1e-9 or not 0 < found.placements <= 2:
                continue
            fewer = found.placements - 1
            best, _ = brute_force(graph, start, goal, {"travel": 1.0}, 1e-5, fewer)
            assert best > 1e-7
            checked += 1
    assert checked > 1


def test_nothing_to_do_and_nothing_possible() -> None:
    graph = graph_of("rectangle")
    grasp = graph.polygon.resolve(rl.Grasp([(0, 2.0), (2, 2.0)]))
    found = shortest(graph, grasp, grasp, "travel")
    assert found is not None
    assert (found.path, found.placements, found.travel, found.cost) == (found.path[:1], 0, 0.0, 0.0)
    assert found.gap == 0
    assert np.isinf(found.margin)
    apart = graph_of("rectangle", 3)
    goal = graph.polygon.resolve(rl.Grasp([(1, 1.0), (3, 1.0)]))
    assert shortest(apart, grasp, goal, "travel") is None


def test_the_budget_and_the_floor() -> None:
    graph = graph_of("ell")
    start, goal = pairs_of("ell", 4)[3]
    with pytest.raises(rl.SolverError, match="larger budget"):
        shortest(graph, start, goal, "travel", Budget(0))
    with pytest.raises(rl.OptionError, match="floor"):
        shortest(graph, start, goal, "travel", floor=0.0)
    assert shortest(graph_of("ell", 3), *pairs_of("ell", 8)[6], TRAVEL, floor=100.0) is None
    costs = []
    for floor in (1e-5, 0.05, 0.2):
        found = shortest(graph, start, goal, {"placements": 2.0, "travel": 1.0}, floor=floor)
        assert found is not None
        assert found.gap <= 1e-6
        assert found.margin >= floor * (1 - 1e-6)
        costs.append(found.cost)
    assert costs == sorted(costs)


def test_hands_that_keep_fingers_apart_are_refused() -> None:
    graph = graph_of("rectangle")
    start, goal = pairs_of("rectangle", 1)[0]
    hand = rl.Hand(4, fingertip_separation=0.1)
    with pytest.raises(rl.HandError, match="another objective"):
        shortest_route(
            graph.sets,
            graph.switches,
            hand,
            terminals(graph, start, goal=False),
            terminals(graph, goal, goal=True),
            Objective.of("travel"),
        )


def test_the_same_again() -> None:
    graph = graph_of("tee")
    start, goal = pairs_of("tee", 1)[0]
    one, other = (shortest(graph, start, goal, TRAVEL) for _ in range(2))
    assert one is not None
    assert other is not None
    assert one.route == other.route
    assert all((a == b).all() for a, b in zip(one.grasps, other.grasps, strict=True))
    assert replace(one, grasps=[]).bound == other.bound


def test_sets_may_be_closed() -> None:
    graph = graph_of("ell")
    start, goal = pairs_of("ell", 4)[3]
    found = shortest(graph, start, goal, TRAVEL, Budget(300))
    assert found is not None
    ends = {t.index for g in (start, goal) for t in terminals(graph, g, goal=True)}
    inner = [index for index in found.path if index not in ends]
    allowed = np.ones(len(graph), dtype=bool)
    allowed[inner] = False
    again = shortest_route(
        graph.sets,
        graph.switches,
        graph.hand,
        terminals(graph, start, goal=False),
        terminals(graph, goal, goal=True),
        Objective.of(TRAVEL),
        budget=Budget(300),
        allowed=allowed,
    )
    assert again is None or not set(inner) & set(again.path)
    assert again is None or again.cost >= found.bound - 1e-9


def test_switches_found_on_demand_give_the_same() -> None:
    """Without the fewest placements from each set as a bound."""
    graph = graph_of("square")
    rule = SwitchRule(
        graph.sets.sources, graph.hand, partial(meet_held, solver=get_solver("highs"))
    )
    compared = 0
    for start, goal in pairs_of("square", 3):
        stored = shortest(graph, start, goal, TRAVEL)
        found = shortest_route(
            graph.sets,
            SwitchesOnDemand(rule),
            graph.hand,
            terminals(graph, start, goal=False),
            terminals(graph, goal, goal=True),
            Objective.of(TRAVEL),
        )
        assert stored is not None
        assert found is not None
        assert found.cost == pytest.approx(stored.cost, abs=1e-6)
        compared += stored.gap < 1e-6
    assert compared
