"""Why there is no plan: every claim against another way to find out."""

from __future__ import annotations

import pickle
from functools import cache
from itertools import pairwise, permutations

import networkx as nx
import numpy as np
import pytest
from geometry import comb, rectangle, star, unit_square
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from polygons import CRITICAL, FRICTIONS, rectilinears, stars, tangles
from regrasps import random_grasps, tee
from scipy.optimize import linprog

import regrasp_lp as rl
from regrasp_lp.connection import Regrasp, Route, friction_threshold, route
from regrasp_lp.explanation import MoreFingers, count
from regrasp_lp.friction import Cones, per_edge_friction
from regrasp_lp.graph_options import GraphOptions
from regrasp_lp.joins import best_joins
from regrasp_lp.lp import get_solver
from regrasp_lp.nearest_switch import nearest_switch
from regrasp_lp.planning.on_demand import matches
from regrasp_lp.planning.reach import within_reach
from regrasp_lp.planning.relaxations import relaxations
from regrasp_lp.planning.stuck import stuck
from regrasp_lp.remedies import Remedy, remedy, upwards
from regrasp_lp.shadows import shadows
from regrasp_lp.switches import SwitchesOnDemand
from regrasp_lp.switching import certainly_apart, meet
from regrasp_lp.torque import torque_functions

APART = [(7, 2, 0.03), (8, 12, 0.03), (9, 15, 0.06)]
"""Stars and frictions at which complete sets and four fingers leave two components."""


@cache
def two_components(n: int, seed: int, friction: float) -> tuple[rl.SwitchingGraph, list[rl.Grasp]]:
    graph = rl.build_switching_graph(star(n, seed), friction)
    return graph, [graph.sets[min(c)].witness for c in graph.components()[:2]]


@cache
def explained(n: int, seed: int, friction: float) -> rl.Explanation:
    graph, (start, goal) = two_components(n, seed, friction)
    return graph.explain(start, goal)


def joined_in(graph: rl.SwitchingGraph, start: rl.Grasp, goal: rl.Grasp) -> bool:
    """Whether there is a plan, and whether networkx agrees."""
    where = [set(graph.locate(grasp)) for grasp in (start, goal)]
    joined = any(
        c & where[0] and c & where[1] for c in nx.connected_components(graph.to_networkx())
    )
    try:
        assert graph.plan(start, goal).placements >= 0
    except rl.NoPlanFound:
        assert not joined
        return False
    assert joined
    return True


# --- grasps that are not in force closure -------------------------------------------------------


def remedy_of(polygon: rl.Polygon, grasp: rl.Grasp, friction: float) -> Remedy:
    return remedy(polygon, grasp, per_edge_friction(friction, polygon.n_edges))


@st.composite
def not_closed(draw: st.DrawFn) -> tuple[rl.Polygon, rl.Grasp, float]:
    """A grasp of 2 or 3 contacts that is not in force closure."""
    polygon = draw(st.one_of(stars(), tangles(), rectilinears()))
    friction = draw(st.sampled_from((*FRICTIONS, *CRITICAL)))
    contacts = draw(st.integers(2, 3))
    edge = st.integers(0, polygon.n_edges - 1)
    fraction = st.one_of(st.sampled_from((0.0, 0.25, 0.5, 1.0)), st.floats(0.01, 0.99))
    pairs = draw(st.lists(st.tuples(edge, fraction), min_size=contacts, max_size=contacts))
    grasp = polygon.resolve(rl.Grasp.at_fractions(pairs))
    assume(not rl.is_force_closure(polygon, grasp, friction))
    return polygon, grasp, friction


@settings(max_examples=60, deadline=None)
@given(not_closed())
def test_the_move_of_one_contact_is_the_shortest(case: tuple[rl.Polygon, rl.Grasp, float]) -> None:
    """Against a scan of all positions of each contact, some beside the thresholds."""
    polygon, grasp, friction = case
    move = remedy_of(polygon, grasp, friction).move
    shortest = np.inf
    for contact in range(len(grasp)):
        length = float(polygon.edge_lengths[grasp.edges[contact]])
        scan = np.linspace(0, 1, 201)
        if move is not None and move.contact == contact:
            ends = np.array(move.interval) / length
            beside = np.concatenate([end + np.array([-1e-6, 1e-6]) for end in ends])
            scan = np.concatenate((scan, beside[(beside >= 0) & (beside <= 1)]))
        fractions = np.tile(grasp.fractions, (len(scan), 1))
        fractions[:, contact] = scan
        edges = np.tile(grasp.edges, (len(scan), 1))
        closed = rl.is_force_closure(polygon, friction=friction, edges=edges, fractions=fractions)
        far = np.abs(scan - grasp.fractions[contact]) * length
        shortest = min(shortest, float(far[closed].min(initial=np.inf)))
        if move is not None and move.contact == contact:
            low, high = (end / length for end in move.interval)
            assert closed[(scan > low + 1e-9) & (scan < high - 1e-9)].all()
            assert not closed[(scan < low - 1e-9) | (scan > high + 1e-9)].any()
    if move is None:
        assert shortest == np.inf
    else:
        assert shortest >= move.distance - 1e-9 * polygon.diameter


@settings(max_examples=60, deadline=None)
@given(not_closed())
def test_what_is_suggested_is_in_force_closure(case: tuple[rl.Polygon, rl.Grasp, float]) -> None:
    polygon, grasp, friction = case
    found = remedy_of(polygon, grasp, friction)
    assert found.friction == rl.least_friction(polygon, grasp)
    for suggestion in (found.move, found.together):
        if suggestion is None or suggestion.grasp is None:
            continue
        moved = suggestion.grasp
        assert rl.is_force_closure(polygon, moved, friction)
        assert len({tuple(polygon.point(c)) for c in moved}) == len(moved)
        by = np.abs(moved.positions - grasp.positions)
        assert by.max() >= suggestion.distance * (1 - 1e-9)
        if suggestion is found.move:
            assert np.flatnonzero(by).tolist() == [found.move.contact]
            # as printed it is a grasp, too
            contact = moved[found.move.contact]
            printed = f"{contact.position:.12g}"
            assert f"(to {printed}, say)" in str(found)
            typed = [(contact.edge, float(printed)) if c is contact else c for c in moved]
            assert rl.is_force_closure(polygon, typed, friction)
    if found.move is not None:
        assert found.together is not None
        assert found.together.distance <= found.move.distance * (1 + 1e-9)


@settings(max_examples=40, deadline=None)
@given(not_closed())
def test_the_common_bound_is_the_least(case: tuple[rl.Polygon, rl.Grasp, float]) -> None:
    """Against linear programs over all pieces: least t with a grasp of the piece within t."""
    polygon, grasp, friction = case
    found = remedy_of(polygon, grasp, friction).together
    functions = torque_functions(Cones.of(polygon, friction), grasp.edges[None, :])
    least = np.inf
    m, lengths = len(grasp), functions.lengths[0]
    columns = np.flatnonzero(functions.valid[0]) if functions.spans[0] else []
    offsets, slopes = functions.offsets[0], functions.slopes[0] / lengths
    for j, k in permutations(columns, 2):
        eye, one = np.eye(m), np.ones((m, 1))
        near = np.block([[eye, -one], [-eye, -one]])
        rows = np.vstack((np.append(slopes[j], 0), np.append(-slopes[k], 0), near))
        bounds = np.concatenate(([-offsets[j], offsets[k]], grasp.positions, -grasp.positions))
        solved = linprog(
            np.append(np.zeros(m), 1.0),
            rows,
            bounds,
            bounds=[*((0, length) for length in lengths), (0, None)],
        )
        if solved.status == 0:
            least = min(least, solved.fun)
    if found is None:
        # at most grasps that are not in force closure, but touch the closure of a piece
        assert not functions.exists()[0]
    else:
        assert found.distance == pytest.approx(least, abs=1e-6 * polygon.diameter)


@settings(max_examples=30, deadline=None)
@given(not_closed(), st.lists(st.floats(0.05, 0.9), min_size=6, max_size=6))
def test_moves_stay_within_the_limits_of_a_hand(
    case: tuple[rl.Polygon, rl.Grasp, float], parts: list[float]
) -> None:
    """Against a scan of what the hand may touch of the edge of each contact."""
    polygon, grasp, friction = case
    ends: dict[int, tuple[float, float]] = {}
    for contact, below, above in zip(grasp, parts[::2], parts[1::2], strict=False):
        assert contact.position is not None
        length = float(polygon.edge_lengths[contact.edge])
        here = max(contact.position - below * length, 0.0), contact.position + above * length
        known = ends.get(contact.edge, here)
        ends[contact.edge] = min(here[0], known[0]), max(here[1], known[1], 1e-3 * length)
    hand = rl.Hand(max(4, len(grasp)), reachable=ends)
    mu = per_edge_friction(friction, polygon.n_edges)
    found, free = remedy(polygon, grasp, mu, hand), remedy(polygon, grasp, mu)
    assert found.friction == free.friction
    moves = [(s, f) for s, f in ((found.move, free.move), (found.together, free.together)) if s]
    for move, other in moves:
        assert other is not None
        assert move.distance >= other.distance * (1 - 1e-9)
        if move.grasp is not None:
            assert within_reach(polygon, hand, move.grasp, "grasp") == move.grasp
            assert rl.is_force_closure(polygon, move.grasp, friction)
    shortest = np.inf
    for contact in range(len(grasp)):
        edge = int(grasp.edges[contact])
        first, last = (min(end, float(polygon.edge_lengths[edge])) for end in ends[edge])
        positions = np.tile(grasp.positions, (101, 1))
        positions[:, contact] = np.linspace(first, last, 101)
        edges = np.tile(grasp.edges, (101, 1))
        closed = rl.is_force_closure(polygon, friction=friction, edges=edges, positions=positions)
        far = np.abs(positions[:, contact] - grasp.positions[contact])
        shortest = min(shortest, float(far[closed].min(initial=np.inf)))
    if found.move is None:
        assert shortest == np.inf
    else:
        assert shortest >= found.move.distance - 1e-9 * polygon.diameter


def test_moves_within_limits_by_hand() -> None:
    """Opposite contacts of a square, of which one is kept from where it should go."""
    square, mu = unit_square(), np.full(4, 0.25)
    grasp = square.resolve([(0, 0.5), (2, 0.125)])
    held = remedy(square, grasp, mu, rl.Hand(reachable={0: (0.4, 0.6), 2: (0.0, 0.2)}))
    assert held.move is None
    assert held.together is not None
    assert held.together.distance == pytest.approx(0.0625)
    nowhere = remedy(square, grasp, mu, rl.Hand(reachable={0: (0.4, 0.52), 2: (0.0, 0.15)}))
    assert (nowhere.move, nowhere.together) == (None, None)
    assert str(nowhere).endswith("no slide within the limits of the hand does it")
    with pytest.raises(rl.NotForceClosureError, match="no slide within the limits"):
        rl.plan_regrasp(square, grasp, grasp, 0.25, nowhere.hand)
    assert "no slide" in str(rl.explain(square, grasp, grasp, 0.25, nowhere.hand))
    with pytest.raises(rl.HandError, match="may not touch"):
        remedy(square, grasp, mu, rl.Hand(reachable={0: None}))


def test_moves_keep_the_distances_between_fingers() -> None:
    """Above each other by hand: within 0.1 of each other at this friction."""
    bar, mu = rl.Polygon([(0, 0), (1, 0), (1, 0.1), (0, 0.1)]), np.ones(4)
    grasp = bar.resolve([(0, 0.3), (0, 0.46), (2, 0.34)])
    free = remedy(bar, grasp, mu).move
    assert free is not None
    assert (free.contact, free.distance) == (1, pytest.approx(0.1))
    # Two of them would come too near to each other, and beyond that too far from the third.
    hand = rl.Hand(max_span=0.4, fingertip_separation=0.156)
    found = remedy(bar, grasp, mu, hand).move
    assert found is not None
    assert found.grasp is not None
    assert (found.contact, found.distance) == (0, pytest.approx(0.26))
    assert within_reach(bar, hand, found.grasp, "grasp") == found.grasp
    pair = bar.resolve([(0, 0.3), (2, 0.5)])
    found_not = remedy(bar, pair, mu, hand)
    assert str(found_not).endswith(
        "none was found that keeps the distances between the fingers of the hand"
    )
    assert "none" not in str(remedy(bar, pair, mu, rl.Hand(max_span=0.4)))


def test_moves_of_a_square() -> None:
    """By hand: opposite contacts hold iff their offset is less than μ."""
    square = unit_square()
    found = remedy_of(square, square.resolve([(0, 0.5), (2, 0.125)]), 0.25)
    assert found.friction == pytest.approx(0.375)
    assert found.move is not None
    assert found.together is not None
    assert (found.move.contact, found.move.distance) == (0, 0.125)
    assert found.move.interval == (0.625, 1.0)
    assert found.move.forward
    assert found.together.distance == pytest.approx(0.0625)


def test_a_marginal_grasp_needs_only_a_touch() -> None:
    square = unit_square()
    found = remedy_of(square, square.resolve([(0, 0.25), (2, 0.5)]), 0.25)
    assert found.move is not None
    assert found.move.distance == 0
    assert "ever so little" in str(found)
    assert found.together is not None
    assert found.together.distance == 0


def test_where_no_single_contact_suffices() -> None:
    """Two contacts that face each other only where neither can go alone."""
    grasp = tee().resolve(rl.Grasp.at_fractions([(1, 0.375), (5, 0.75)]))
    found = remedy_of(tee(), grasp, 0.1)
    assert found.move is None
    assert found.together is not None
    assert found.together.distance == pytest.approx(1.475)
    assert "or with every contact moved by 1.475 or a little more" in str(found)
    with pytest.raises(rl.NotForceClosureError, match="every contact moved by 1.475"):
        rl.plan_regrasp(tee(), grasp, grasp, 0.1)


def test_no_remedy_at_all() -> None:
    square = unit_square()
    found = remedy_of(square, square.resolve([(0, 0.25), (0, 0.75)]), 0.5)
    assert found.friction is None
    assert found.move is None
    assert found.together is None
    assert str(found).endswith("take other edges")
    corner = remedy_of(square, square.resolve([(0, 0.5), (1, 0.5)]), 0.5)
    assert corner.friction == pytest.approx(1)
    assert "no move along these edges does it" in str(corner)


def test_numbers_are_rounded_up() -> None:
    assert upwards(0.5) == "0.5"
    assert upwards(1 / 3) == "0.333334"
    assert float(upwards(1.23456789e-9)) > 1.23456789e-9
    assert float(upwards(12345678.0)) >= 12345678.0


# --- the nearest switch -------------------------------------------------------------------------


def brute_force_margin(graph: rl.SwitchingGraph, one: set[int], other: set[int]) -> float:
    """The largest margin of all joined pieces of all pairs, without any bisection."""
    sets, solver, best = graph.sets, get_solver("clarabel"), -np.inf
    for i in one:
        for j in other:
            held = graph.hand.held(int(sets.contacts[i]), int(sets.contacts[j]))
            assert held > 0
            rows = []
            for index in (i, j):
                family, row = sets.place(index)
                rows.append([np.array([row] if f == family else [], dtype=np.intp) for f in (0, 1)])
            first, second = (shadows(sets.sources, held, r, ordered=True) for r in rows)
            for a in range(len(first)):
                for b in range(len(second)):
                    if first.edges[a].tolist() == second.edges[b].tolist():
                        pair = first.take(np.array([a])), second.take(np.array([b]))
                        found = best_joins(*pair, solver, least=-np.inf)
                        best = max(best, float(found.margins[0]))
    return best


@pytest.mark.parametrize(
    ("n", "seed", "friction"),
    [*APART[:2], pytest.param(*APART[2], marks=pytest.mark.slow)],
)
def test_the_nearest_switch(n: int, seed: int, friction: float) -> None:
    graph, _ = two_components(n, seed, friction)
    one, other = graph.components()
    found = nearest_switch(graph.sets, graph.hand, get_solver("clarabel"), one, other)
    assert found is not None
    size = graph.polygon.diameter
    assert found.margin == pytest.approx(brute_force_margin(graph, one, other), abs=3e-8 * size)
    assert found.margin < 0
    assert found.first in one
    assert found.second in other
    assert found.searched == found.pairs
    margins = [rl.margin(graph.polygon, grasp, friction) for grasp in found.grasps]
    assert min(margins) == pytest.approx(found.margin, abs=1e-9 * size)
    places = [{(c.edge, c.fraction) for c in grasp} for grasp in found.grasps]
    assert {edge for edge, _ in places[0] & places[1]} == set(found.held)
    back = nearest_switch(graph.sets, graph.hand, get_solver("clarabel"), other, one)
    assert back is not None
    assert back.margin == pytest.approx(found.margin, abs=3e-8 * size)


@pytest.mark.parametrize("fingers", [3, 4, 5])
def test_the_nearest_of_sets_that_are_not_adjacent(fingers: int) -> None:
    """Of single sets, so that one or two contacts have to be held."""
    graph = rl.build_switching_graph(comb(2), 0.05, rl.Hand(fingers))
    solver, size, negative = get_solver("clarabel"), graph.polygon.diameter, 0
    for i in range(0, len(graph), 9):
        missing = {*range(len(graph))} - {i, *graph.neighbors(i)}
        chosen = {
            j
            for j in missing
            if len({*graph.sets[i].edges} & {*graph.sets[j].edges})
            >= graph.hand.held(len(graph.sets[i].edges), len(graph.sets[j].edges))
        }
        chosen = set(sorted(chosen)[:3])
        found = nearest_switch(graph.sets, graph.hand, solver, {i}, chosen)
        if found is not None:
            negative += found.margin < 0
            expected = brute_force_margin(graph, {i}, chosen)
            assert found.margin == pytest.approx(min(expected, 0), abs=3e-8 * size)
            assert found.second in chosen
            margins = [rl.margin(graph.polygon, grasp, 0.05) for grasp in found.grasps]
            assert min(margins) == pytest.approx(found.margin, abs=1e-8 * size)
    assert negative or fingers == 3


def test_among_adjacent_sets_the_best_switch_is_found() -> None:
    """As where other rules than that of contacts leave switches out."""
    graph = rl.build_switching_graph(star(8, 3), 0.1)
    one, other = {0, 1, 2}, {*range(10, 14)}
    found = nearest_switch(graph.sets, graph.hand, get_solver("clarabel"), one, other)
    assert found is not None
    margins = [s.margin for i in one for j in other if (s := graph.switch(i, j)) is not None]
    assert found.margin == pytest.approx(max(margins), rel=2e-3)


@pytest.mark.parametrize("held", [1, 2])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_apart_for_certain_does_not_meet(seed: int, held: int) -> None:
    """Of all pairs of projections, unshifted: what floating point leaves open is seldom."""
    polygon = (tee, lambda: comb(2), lambda: star(12, 1))[seed]()
    graph = rl.build_switching_graph(polygon, 0.05)
    stack = shadows(graph.sets.sources, held)
    i, j = matches(stack.edges, stack.edges)
    apart = certainly_apart(stack, stack, i, j)
    exist = meet(stack, stack, i, j).exist
    assert not (apart & exist).any()
    assert (~apart & ~exist).sum() <= 0.01 * len(i)
    assert 0 < apart.sum() < len(i)


@pytest.mark.parametrize(("n", "seed", "friction"), APART)
def test_no_pair_of_grasps_comes_nearer(n: int, seed: int, friction: float) -> None:
    """Random grasps that share two contacts, of sets of the two components."""
    graph, _ = two_components(n, seed, friction)
    found = explained(n, seed, friction).nearest
    assert found is not None
    rng = np.random.default_rng(0)
    one, other = ([graph.sets[i].edges for i in c] for c in graph.components())
    for a in one:
        for b in other:
            shared = [edge for edge in a if edge in b]
            if len(a) + len(b) - 4 > len(shared):
                continue
            places = {edge: rng.random(400) for edge in {*a, *b}}
            margins = []
            for edges in (a, b):
                own = {edge: places[edge] if edge in shared else rng.random(400) for edge in edges}
                fractions = np.column_stack([own[edge] for edge in edges])
                every = np.tile(edges, (400, 1))
                margins.append(
                    rl.margin(graph.polygon, friction=friction, edges=every, fractions=fractions)
                )
            assert np.minimum(*margins).max() <= found.margin


def test_a_hand_with_limits() -> None:
    """Whose contacts are on parts of edges."""
    polygon = star(9, 15)
    middles = {e: [(0.1 * u, 0.45 * u), (0.55 * u, 0.9 * u)] for e, u in lengths_of(polygon)}
    hand = rl.Hand(4, reachable=middles)
    graph = rl.build_switching_graph(polygon, 0.06, hand)
    start, goal = (graph.sets[min(c)].witness for c in graph.components()[:2])
    found = graph.explain(start, goal)
    assert found.nearest is not None
    for grasp, edges in zip(found.nearest.grasps, found.nearest.edges, strict=True):
        assert tuple(sorted(grasp.edges.tolist())) == edges
        assert {*found.nearest.held} <= {*edges}
        for contact in grasp:
            f = contact.fraction
            assert f is not None
            assert 0.1 - 1e-9 <= f <= 0.45 + 1e-9 or 0.55 - 1e-9 <= f <= 0.9 + 1e-9
    margins = [rl.margin(polygon, grasp, 0.06) for grasp in found.nearest.grasps]
    assert min(margins) == pytest.approx(found.nearest.margin, abs=1e-9 * polygon.diameter)
    assert found.threshold is not None
    ends = [(found.threshold.below, False)]
    ends += [(found.threshold.above, True)] if found.threshold.above else []
    for factor, joined in ends:
        other = rl.build_switching_graph(polygon, 0.06 * factor, hand)
        assert joined_in(other, start, goal) is joined
    assert str(found) == str(rl.explain(polygon, start, goal, 0.06, hand))


def test_distances_between_fingers_are_not_looked_at() -> None:
    hand = rl.Hand(3, max_span=4.5)
    graph = rl.build_switching_graph(rectangle(), 0.1, hand)
    found = graph.explain([(0, 2.0), (2, 2.0)], [(1, 1.0), (3, 1.0)])
    assert found.nearest is None
    assert "not looked for" in str(found)


SQUEEZED = [(0, 2.0), (2, 2.0)]
ACROSS = [(1, 1.0), (3, 1.0)]


@pytest.mark.parametrize("fingers", [3, 4])
@pytest.mark.parametrize("sliding", [[1], [2], [1, 2], [3], [1, 3], [1, 2, 3]])
def test_fingers_that_only_slide_are_part_of_the_answer(
    fingers: int, sliding: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An explanation says that there is a plan iff one is found, with so many placements."""
    for slow in ("friction_threshold", "_more_fingers"):
        monkeypatch.setattr(f"regrasp_lp.why_not.{slow}", lambda *_: None)
    hand = rl.Hand(fingers, only_slide=sliding)
    graph = rl.build_switching_graph(rectangle(), 0.4, hand)
    three = [(0, 1.0), (0, 3.0), (2, 2.0)]
    for goal in (ACROSS, three, [(2, 1.9), (0, 1.9)], [(0, 2.0), (1, 1.0), (3, 1.0)]):
        try:
            placed = graph.plan(SQUEEZED, goal).placements
        except rl.NoPlanFound as answer:
            found = graph.explain(SQUEEZED, goal)
            assert not found.plan_exists
            assert "of 1 components" not in answer.explanation
            assert "only_slide" in answer.explanation
            assert answer.explanation == f"no plan exists: {found.standstill}"
            less = found.without
            assert less is not None
            assert list(less) == ["only_slide"]
            other = rl.build_switching_graph(rectangle(), 0.4, rl.Hand(fingers))
            relieved = less["only_slide"]
            try:
                free = other.plan(SQUEEZED, goal).placements
            except rl.NoPlanFound:
                assert relieved is None
            else:
                assert relieved is not None
                assert relieved.placements == free
        else:
            question = Regrasp(
                rectangle(),
                *(rectangle().resolve(g) for g in (SQUEEZED, goal)),
                graph.friction,
                hand,
                graph.options,
            )
            way = route(question, graph)
            assert way is not None
            assert way.placements == placed


def test_what_fingers_that_only_slide_rule_out() -> None:
    def reason(goal: list[tuple[int, float]], *sliding: int) -> str | None:
        return stuck(rl.Hand(4, only_slide=sliding), rl.Grasp(SQUEEZED), rl.Grasp(goal))

    assert reason(ACROSS) is None
    assert reason(ACROSS, 3, 4) is None
    assert "finger 1 only slides (only_slide): it stays on edge 0" in str(reason(ACROSS, 1, 2))
    assert "finger 2 only slides" in str(reason([(0, 1.0), (0, 2.0)], 1, 2))
    both = [(0, 2.0), (1, 1.0), (3, 1.0)]
    assert reason(both, 1) is None
    assert "2 contacts to which no finger slides, and 1 finger may" in str(reason(both, 1, 3, 4))
    assert "it stays on edge 2" in str(reason(both, 1, 2, 3, 4))
    more = [(0, 2.0), (2, 2.0), (3, 1.0)]
    assert "1 contact to which no finger slides, and no fingers" in str(reason(more, 1, 2, 3, 4))
    hand = rl.Hand(4, only_slide=[1, 2, 3, 4])
    with pytest.raises(rl.NoPlanFound, match="no fingers may be placed"):
        rl.plan_regrasp(rectangle(), SQUEEZED, [(0, 1.0), (0, 3.0), (2, 2.0)], 0.4, hand)


def test_limits_of_a_hand_that_keep_it_from_a_plan() -> None:
    hand = rl.Hand(3, max_span=40, only_place=[1])
    assert relaxations(hand) == {
        "max_span=40": rl.Hand(3, only_place=[1]),
        "only_place": rl.Hand(3, max_span=40),
    }
    assert relaxations(rl.Hand(5)) == {}
    found = rl.explain(rectangle(), SQUEEZED, ACROSS, 0.4, hand)
    assert found.without == {"max_span=40": None, "only_place": None}
    text = " ".join(str(found).split())
    assert "hand without max_span=40, or without only_place there is no plan either" in text
    assert "\nhand" not in str(rl.explain(rectangle(), SQUEEZED, ACROSS, 0.4, rl.Hand(3)))


def lengths_of(polygon: rl.Polygon) -> list[tuple[int, float]]:
    return list(enumerate(polygon.edge_lengths.tolist()))


def test_limits_of_the_search_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    graph, (start, goal) = two_components(9, 15, 0.06)
    monkeypatch.setattr("regrasp_lp.nearest_switch._MOST_PAIRS", 2)
    monkeypatch.setattr("regrasp_lp.connection._SECONDS", -1.0)
    found = graph.explain(start, goal)
    assert found.nearest is not None
    assert (found.nearest.searched, found.nearest.pairs) == (2, 6)
    complete = explained(9, 15, 0.06).nearest
    assert complete is not None
    assert found.nearest.margin <= complete.margin
    assert found.threshold is not None
    assert found.threshold.ended
    assert (found.threshold.below, found.threshold.above) == (1, None)
    text = " ".join(str(found).split())
    assert "the nearest of the first 2 of 6 candidates" in text
    assert "the search was ended" in text


def test_no_edges_in_common() -> None:
    graph = rl.build_switching_graph(rectangle(), 0.1, rl.Hand(3))
    found = graph.explain([(0, 2.0), (2, 2.0)], [(1, 1.0), (3, 1.0)])
    assert found.nearest is None
    assert "no two sets of theirs have the edges in common" in " ".join(str(found).split())


# --- the friction that joins --------------------------------------------------------------------


@pytest.mark.parametrize(("n", "seed", "friction"), APART)
def test_the_threshold_of_friction(n: int, seed: int, friction: float) -> None:
    """Against graphs at frictions below and above it, and at its two ends."""
    graph, (start, goal) = two_components(n, seed, friction)
    found = explained(n, seed, friction).threshold
    assert found is not None
    assert found.above is not None
    assert found.monotone
    assert found.uniform
    assert not found.ended
    assert 1 < found.above / found.below <= 1.001
    below = [*np.geomspace(1, found.below, 3), found.below]
    above = np.geomspace(found.above, 4 * found.above, 3)
    for factors, joined in ((below, False), (above, True)):
        for factor in factors:
            other = rl.build_switching_graph(graph.polygon, friction * factor)
            assert joined_in(other, start, goal) is joined


def test_friction_per_edge_is_scaled_as_a_whole() -> None:
    polygon, friction = star(8, 12), np.where(np.arange(8) % 2, 0.03, 0.0301)
    graph = rl.build_switching_graph(polygon, friction)
    one, other = graph.components()[:2]
    start, goal = graph.sets[min(one)].witness, graph.sets[min(other)].witness
    found = graph.explain(start, goal)
    assert found.threshold is not None
    assert found.threshold.above is not None
    assert "times the given one" in str(found)
    for factor, joined in ((found.threshold.below, False), (found.threshold.above, True)):
        other_graph = rl.build_switching_graph(polygon, friction * factor)
        assert joined_in(other_graph, start, goal) is joined


def test_the_threshold_on_demand_is_that_of_the_graph() -> None:
    """Above 20 edges no graph is built to try a friction."""
    polygon = notched_star()
    friction = 0.02
    graph = rl.build_switching_graph(polygon, friction)
    components = graph.components()
    assert len(components) > 1
    start, goal = (graph.sets[min(c)].witness for c in components[:2])
    explanation = rl.explain(polygon, start, goal, friction)
    found = explanation.threshold
    assert found is not None
    assert found.above is not None
    for factor, joined in ((found.below, False), (found.above, True)):
        assert (
            joined_in(rl.build_switching_graph(polygon, friction * factor), start, goal) is joined
        )
    assert explanation.n_components == len(components)


def notched_star() -> rl.Polygon:
    """A star of few grasps, each of whose long edges is cut in three."""
    vertices = star(8, 12).vertices
    points = []
    for a, b in zip(vertices, np.roll(vertices, -1, axis=0), strict=True):
        points += [a, a + (b - a) * 0.25, a + (b - a) * 0.75]
    return rl.Polygon(points)


def test_a_scan_says_that_it_is_one() -> None:
    graph = rl.build_switching_graph(rectangle(), 0.1, rl.Hand(3), sets="chapter")
    found = graph.explain(graph.sets[0].witness, graph.sets[1].witness)
    assert found.threshold is not None
    assert not found.threshold.monotone
    assert "scanned at" in " ".join(str(found).split())
    for factor in found.threshold.tried:
        friction = 0.1 * factor
        other = rl.build_switching_graph(rectangle(), friction, rl.Hand(3), sets="chapter")
        joined = joined_in(other, found.start, found.goal)
        assert joined is (found.threshold.above is not None and factor >= found.threshold.above)


def test_no_friction_joins() -> None:
    """Three fingers around the teeth of a comb cannot let go, whatever the friction."""
    polygon = comb(2)
    graph = rl.build_switching_graph(polygon, 3.0, rl.Hand(3))
    around = next(grasp_set for grasp_set in graph.sets if grasp_set.edges == (2, 5, 8))
    found = graph.explain(around.witness, graph.sets[0].witness)
    assert found.threshold is not None
    assert (found.threshold.above, found.threshold.most) == (None, 4)
    assert found.threshold.below == 4
    assert "not even joined at a friction of 12" in str(found)
    assert not joined_in(
        rl.build_switching_graph(polygon, 12.0, rl.Hand(3)), found.start, found.goal
    )


# --- one more finger ----------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "seed", "friction"), APART)
def test_one_more_finger(n: int, seed: int, friction: float) -> None:
    graph, (start, goal) = two_components(n, seed, friction)
    found = explained(n, seed, friction).fingers
    assert found is not None
    assert found.fingers == 5
    five = rl.build_switching_graph(graph.polygon, friction, rl.Hand(5))
    assert (found.route is not None) is joined_in(five, start, goal)
    if found.route is not None:
        assert found.route.placements == five.plan(start, goal).placements


def test_on_large_objects_placements_are_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """With five fingers all sets are adjacent to two-finger sets, where there are any."""
    start, goal = (rectangle().resolve(g) for g in ([(0, 2.0), (2, 2.0)], [(1, 1.0), (3, 1.0)]))
    friction = per_edge_friction(0.3, 4)
    question = Regrasp(rectangle(), start, goal, friction, rl.Hand(5), GraphOptions())
    counted = route(question)
    assert counted is not None
    assert counted.placements == 2
    monkeypatch.setattr("regrasp_lp.connection._LARGE", 3)
    assert route(question) == Route((), None)
    assert str(MoreFingers(5, route(question))) == "with 5 there is a plan"
    graph, (start, goal) = two_components(8, 12, 0.03)  # it has no two-finger sets
    assert {len(grasp_set.edges) for grasp_set in graph.sets} == {3}
    assert str(graph.explain(start, goal).fingers) == str(explained(8, 12, 0.03).fingers)


def test_a_fourth_finger() -> None:
    graph = rl.build_switching_graph(star(7, 1), 0.15, rl.Hand(3))
    components = graph.components()[:4]
    starts = [graph.sets[min(c)].witness for c in components]
    four = rl.build_switching_graph(star(7, 1), 0.15)
    for start, goal in pairwise(starts):
        found = graph.explain(start, goal)
        assert not found.plan_exists
        assert found.fingers is not None
        assert (found.fingers.route is not None) is joined_in(four, start, goal)
        if found.fingers.route is not None:
            assert found.fingers.route.placements == four.plan(start, goal).placements


# --- plans that exist ---------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.1, 0.4, 1.0])
def test_a_plan_that_exists(friction: float) -> None:
    polygon = star(8, 3)
    graph = rl.build_switching_graph(polygon, friction)
    grasps = [
        grasp
        for m in (2, 3)
        for grasp in random_grasps(polygon, friction, np.random.default_rng(m), 3, m)
    ]
    for start, goal in pairwise(grasps):
        try:
            plan = graph.plan(start, goal)
        except rl.NoPlanFound as answer:
            assert not answer.explain().plan_exists
            continue
        found = graph.explain(start, goal)
        assert found.route is not None
        assert found.route.placements == plan.placements
        assert str(found).startswith("There is a plan by sliding of")


def test_the_same_grasp_needs_nothing() -> None:
    found = rl.explain(rectangle(), [(0, 2.0), (2, 2.0)], [(2, 2.0), (0, 2.0)], 0.3)
    assert found.route is not None
    assert (found.route.placements, found.route.edges) == (0, ())
    assert str(found) == "There is a plan by sliding of 0 placements."


def test_on_large_outlines_no_graph_is_built(workpieces: dict[str, rl.Polygon]) -> None:
    polygon = max(workpieces.values(), key=lambda p: p.n_edges)
    assert polygon.n_edges > 20
    start, goal = (
        random_grasps(polygon, 0.5, np.random.default_rng(seed), 1, 2)[0] for seed in (0, 1)
    )
    found = rl.explain(polygon, start, goal, 0.5)
    assert found.plan_exists
    assert found.n_sets is None
    assert found.route is not None
    assert found.route.placements == rl.plan_regrasp(polygon, start, goal, 0.5).placements


def test_switches_found_on_demand(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of graphs too large to store them."""
    stored, (start, goal) = two_components(7, 2, 0.03)
    monkeypatch.setattr("regrasp_lp.build.STORE_LIMIT", 0)
    graph = rl.build_switching_graph(stored.polygon, 0.03)
    assert isinstance(graph.switches, SwitchesOnDemand)
    found, expected = graph.explain(start, goal), explained(7, 2, 0.03)
    assert found.ends == expected.ends
    assert found.nearest is not None
    assert expected.nearest is not None
    assert found.nearest.margin == expected.nearest.margin
    assert str(found.threshold) == str(expected.threshold)
    assert found.fingers is not None
    assert found.fingers.route is not None
    assert str(graph.explain(start, start)) == "There is a plan by sliding of 0 placements."
    inside = max(graph.components()[0])
    assert graph.explain(start, graph.sets[inside].witness).plan_exists


# --- starts and goals in no set, and other sets -------------------------------------------------


def test_a_start_in_no_set_of_the_chapter() -> None:
    polygon = star(5, 1)
    graph = rl.build_switching_graph(polygon, 0.7, sets="chapter")
    others = random_grasps(polygon, 0.7, np.random.default_rng(0), 200, 3)
    missing = next(grasp for grasp in others if not graph.locate(grasp))
    inside = next(grasp for grasp in others if graph.locate(grasp))
    found = graph.explain(missing, inside)
    assert not found.plan_exists
    assert found.ends["start"].sets == ()
    assert found.nearest is None
    assert found.fingers is None
    assert found.among_all is not None
    plan = rl.plan_regrasp(polygon, missing, inside, 0.7)
    assert found.among_all.placements == plan.placements
    assert str(found).startswith("No plan: the start is in none of the")
    assert f"there is a plan of {count(plan.placements, 'placement')}" in str(found)


def test_a_grasp_below_the_least_margin() -> None:
    graph = rl.build_switching_graph(rectangle(), 0.4, min_margin=0.5)
    found = graph.explain([(0, 2.0), (2, 2.0)], [(1, 1.0), (3, 1.0)])
    assert found.ends["start"].sets == ()
    assert found.among_all is not None
    assert found.threshold is not None
    assert not found.threshold.monotone


def test_the_focus_rule_may_miss_what_can_be_held() -> None:
    """A pair of components of the focus rule that a switch by contacts joins."""
    for seed in range(40):
        polygon = star(9, seed)
        focus = rl.build_switching_graph(polygon, 0.15, sets="chapter", switching="focus")
        contact = rl.build_switching_graph(polygon, 0.15, sets="chapter")
        if len(focus.components()) > len(contact.components()):
            break
    else:
        pytest.fail("no example")
    label = {i: n for n, c in enumerate(focus.components()) for i in c}
    i, j = next(
        (i, j) for i in range(len(contact)) for j in contact.neighbors(i) if label[i] != label[j]
    )
    components = focus.components()
    found = nearest_switch(
        focus.sets, focus.hand, get_solver("clarabel"), components[label[i]], components[label[j]]
    )
    assert found is not None
    switch = contact.switch(found.first, found.second)
    assert switch is not None
    assert found.margin == pytest.approx(switch.margin, rel=1e-2)


# --- what is said, and how it travels -----------------------------------------------------------


def test_the_text() -> None:
    found = explained(7, 2, 0.03)
    text = str(found)
    assert max(map(len, text.splitlines())) < 80
    labels = [line[:10].rstrip() for line in text.splitlines()[2:] if line[0] != " "]
    assert labels == ["start", "goal", "switch", "friction", "fingers"]
    assert "\n" not in repr(found)
    assert repr(found).startswith("<Explanation: No plan")
    assert found.n_components == 2
    assert [end.components[0][1] for end in found.ends.values()] == [10, 2]


def test_grasps_that_are_not_in_force_closure() -> None:
    found = rl.explain(rectangle(), [(0, 0.5), (2, 0.5)], [(1, 1.0), (3, 1.0)], 0.1)
    assert list(found.remedies) == ["start"]
    assert not found.plan_exists
    assert str(found.remedies["start"]) in " ".join(str(found).split())
    graph = rl.build_switching_graph(rectangle(), 0.1)
    assert str(graph.explain([(0, 0.5), (2, 0.5)], [(1, 1.0), (3, 1.0)])) == str(found)
    both = rl.explain(rectangle(), [(0, 0.5), (2, 0.5)], [(1, 0.0), (3, 0.5)], 0.01)
    assert list(both.remedies) == ["start", "goal"]


def test_the_answer_explains_itself() -> None:
    graph, (start, goal) = two_components(9, 15, 0.06)
    with pytest.raises(rl.NoPlanFound) as caught:
        graph.plan(start, goal)
    told: list[str] = []
    text = str(caught.value.explain(lambda what, done, total: told.append(what)))
    assert text == str(explained(9, 15, 0.06))
    assert any("friction" in what for what in told)
    copied = pickle.loads(pickle.dumps(caught.value))
    assert copied.explanation == caught.value.explanation == str(copied)
    assert str(copied.explain()) == text
    assert len(pickle.dumps(caught.value)) < 5000


def test_plans_without_a_graph_explain_themselves() -> None:
    graph, (start, goal) = two_components(8, 12, 0.03)
    with pytest.raises(rl.NoPlanFound) as caught:
        rl.plan_regrasp(graph.polygon, start, goal, 0.03)
    assert str(caught.value.explain()) == str(explained(8, 12, 0.03))


def test_a_refusal_to_regrip_has_a_plan_by_sliding() -> None:
    start, goal = [(0, 1.0), (0, 3.0), (2, 2.5)], [(0, 0.5), (0, 2.5), (2, 1.5)]
    with pytest.raises(rl.NoPlanFound, match="needs a free finger") as caught:
        rl.build_switching_graph(rectangle(), 0.05, rl.Hand(3)).plan(start, goal, "regrip")
    assert caught.value.explain().plan_exists


def test_large_objects_explain_a_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    """A refusal on the way of `plan_regrasp` without a graph is about its question, too."""

    def refuse(*_: object) -> None:
        raise rl.NoPlanFound("needs a free finger")

    monkeypatch.setattr("regrasp_lp.build._SMALL", 3)
    monkeypatch.setattr("regrasp_lp.build.plan_on_demand", refuse)
    with pytest.raises(rl.NoPlanFound, match="needs a free finger") as caught:
        rl.plan_regrasp(rectangle(), [(0, 2.0), (2, 2.0)], [(1, 1.0), (3, 1.0)], 0.3)
    assert caught.value.explain().plan_exists


def test_an_answer_to_no_question() -> None:
    with pytest.raises(rl.OptionError, match=r"nothing more can be said.*regrasp_lp\.explain"):
        rl.NoPlanFound("no way").explain()


def test_bad_arguments_are_refused() -> None:
    good = [(0, 2.0), (2, 2.0)]
    with pytest.raises(rl.ContactError, match="the start must have 2 or 3"):
        rl.explain(rectangle(), [(0, 1.0)], good, 0.3)
    with pytest.raises(rl.OptionError, match="sets must be"):
        rl.explain(rectangle(), good, good, 0.3, sets="some")
    with pytest.raises(rl.FrictionError):
        rl.explain(rectangle(), good, good, -1)


def test_largest_frictions() -> None:
    """There is no friction above 1e6 to try."""
    question = Regrasp(
        rectangle(),
        rectangle().resolve([(0, 2.0), (2, 2.0)]),
        rectangle().resolve([(1, 1.0), (3, 1.0)]),
        np.full(4, 1e6),
        rl.Hand(),
        GraphOptions(),
    )
    assert route(question) is not None
    found = friction_threshold(question)
    assert (found.above, found.tried) == (None, (1.0,))
