"""Limits to the distance between fingers: rows, connected groups of pieces, coupled switches."""

from __future__ import annotations

import json
from functools import cache
from itertools import combinations, combinations_with_replacement, product
from pathlib import Path

import numpy as np
import pytest
from geometry import rectangle, star
from hypothesis import given, settings
from hypothesis import strategies as st
from polygons import stars
from scipy.optimize import linprog

import regrasp_lp as rl
from regrasp_lp.grasp_sets.set_pieces import SetPieces
from regrasp_lp.grasp_sets.spacing import SEPARATION_ERROR, SPAN_ERROR, Spacing, admits
from regrasp_lp.handovers import handovers
from regrasp_lp.lp import get_solver
from regrasp_lp.planning.reach import hand_cones, room, within_reach
from regrasp_lp.planning.verification import verify_document

BRACKET = rl.Polygon([(0, 0), (60, 0), (60, 10), (10, 10), (10, 50), (0, 50)], name="bracket")
STRIP = rl.Polygon([(0, 0), (8, 0), (8, 1), (0, 1)], name="strip")
HIGHS = get_solver("highs")


# --- rows ---------------------------------------------------------------------------------------


def test_errors() -> None:
    assert pytest.approx(1 - np.cos(np.pi / 24)) == SPAN_ERROR
    assert 0 < SPAN_ERROR < 1e-2
    assert 0 < SEPARATION_ERROR < 2e-2


def distances(spacing: Spacing, s: int, t: int, f: np.ndarray, g: np.ndarray) -> np.ndarray:
    cones = spacing.cones
    one = cones.starts[s] + f[:, None] * cones.vectors[s]
    return np.hypot(*(one - cones.starts[t] - g[:, None] * cones.vectors[t]).T)


@given(stars(), st.floats(0.1, 1.2), st.floats(0.01, 0.9), st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_rows_are_inner_approximations_of_known_accuracy(
    polygon: rl.Polygon, span: float, separation: float, seed: int
) -> None:
    most = span * polygon.diameter
    least = separation * most
    spacing = Spacing(hand_cones(polygon, 0.5, rl.Hand()), most, least)
    rng = np.random.default_rng(seed)
    slack = 1e-8 * polygon.diameter
    for s, t in product(range(polygon.n_edges), repeat=2):
        f, g = (np.append(rng.random(200), ends) for ends in ([0, 0, 1, 1], [0, 1, 0, 1]))
        apart = distances(spacing, s, t, f, g)
        found = spacing.between(s, t)
        if not found.possible:
            assert ((apart > most * (1 - SPAN_ERROR) - slack) | (apart < least + slack)).all() or (
                (apart > most * (1 - SPAN_ERROR) - slack).all() or (apart < least + slack).all()
            )
            continue
        a, b, c = found.always.T
        near = (np.outer(f, a) + np.outer(g, b) <= c).all(axis=1)
        assert (apart[near] <= most).all()
        assert near[apart <= most * (1 - SPAN_ERROR) - slack].all()
        if len(found.choices):
            a, b, c = found.choices.T
            far = (np.outer(f, a) + np.outer(g, b) <= c).any(axis=1)
            assert (apart[far] >= least).all()
            assert far[apart >= least * (1 + SEPARATION_ERROR) + slack].all()
        else:
            assert (apart >= least).all()


def test_on_one_edge_both_limits_are_exact() -> None:
    spacing = Spacing(hand_cones(rectangle(8, 4), 0.5, rl.Hand()), 5.0, 2.0)
    found = spacing.between(0, 0)
    assert len(found.always) == len(found.choices) == 2
    np.testing.assert_allclose(np.sort(found.always[:, 2]), [5, 5], atol=1e-7)
    np.testing.assert_allclose(np.sort(found.choices[:, 2]), [-2, -2], atol=1e-7)
    ways = spacing.alternatives(np.array([0, 0]), [(0, 1)], ordered=True)
    assert len(ways) == 1
    assert (ways.rows[0] @ [0.1, 0.4] <= ways.bounds[0]).all()
    assert not (ways.rows[0] @ [0.4, 0.1] <= ways.bounds[0]).all()
    assert len(spacing.alternatives(np.array([0, 0]), [(0, 1)])) == 2
    segments = hand_cones(rectangle(8, 4), 0.5, rl.Hand(reachable={0: [(0, 3), (4, 8)]}))
    between = Spacing(segments, 5.0, 2.0).between(0, 1)
    assert len(between.always) == len(between.choices) == 1


def test_what_needs_no_rows_has_none_and_what_cannot_be_is_not_possible() -> None:
    cones = hand_cones(STRIP, 0.5, rl.Hand())
    assert Spacing(cones, 9.0, 0.0).alternatives(np.array([0, 1, 2]), [(0, 1), (1, 2)]).void
    assert Spacing(cones, None, 0.9).alternatives(np.array([0, 2]), [(0, 1)]).void
    assert not Spacing(cones, 7.5, 0.0).between(1, 3).possible
    assert not Spacing(cones, None, 1.5).between(1, 1).possible
    assert len(Spacing(cones, 7.5, 0.0).alternatives(np.array([1, 3]), [(0, 1)])) == 0


def test_admits() -> None:
    spacing = Spacing(hand_cones(STRIP, 0.5, rl.Hand()), 5.0, 1.0)
    points = np.array([[0, 0], [2, 0], [4.9, 0]])
    assert admits(spacing, points[None]).tolist() == [True]
    assert not admits(spacing, np.append(points, [[0.5, 0.5]], axis=0)[None])[0]
    assert not admits(spacing, np.append(points, [[6, 0]], axis=0)[None])[0]
    assert admits(spacing, np.append(points, [[np.nan, np.nan]], axis=0)[None])[0]


# --- sets, against brute force --------------------------------------------------------------------


def within(polygon: rl.Polygon, hand: rl.Hand, grasp: rl.Grasp, slack: float = 0.0) -> bool:
    """Whether all distances are within the limits, or (slack 1) what the rows cover of them."""
    points = [polygon.point(contact) for contact in grasp]
    lengths = [float(np.hypot(*(p - q))) for p, q in combinations(points, 2)]
    most = (hand.max_span or np.inf) * (1 - slack * SPAN_ERROR) - slack * 1e-7
    least = hand.fingertip_separation * (1 + slack * SEPARATION_ERROR) + slack * 1e-7
    return all(least <= length <= most for length in lengths)


CASES = {
    "span": (BRACKET, 0.3, rl.Hand(max_span=30)),
    "separation": (rectangle(8, 4), 0.4, rl.Hand(fingertip_separation=2)),
    "both": (rectangle(8, 4), 0.7, rl.Hand(max_span=6, fingertip_separation=1)),
    "strip": (STRIP, 1.5, rl.Hand(max_span=4, fingertip_separation=1.25)),
    "with edges": (BRACKET, 0.3, rl.Hand(4, 35, 3, 8, {0: [(5, 20), (30, 50)], 3: None})),
}


@cache
def graph_of(polygon: rl.Polygon, friction: float, hand: rl.Hand) -> rl.SwitchingGraph:
    """Built once for all tests."""
    return rl.build_switching_graph(polygon, friction, hand)


@pytest.mark.parametrize("name", CASES)
def test_sets_against_a_grid(name: str) -> None:
    polygon, friction, hand = CASES[name]
    graph = graph_of(polygon, friction, hand)
    cones = hand_cones(polygon, friction, hand)
    inside = beyond = 0
    for m, count in ((2, 17), (3, 7)):
        for edges in combinations_with_replacement(range(polygon.n_edges), m):
            grid = np.linspace(0.01, 0.99, count)
            places = [f for f in product(grid, repeat=m) if m == 2 or list(f) == sorted(f)]
            closed = rl.is_force_closure(
                polygon, friction=friction, edges=[edges] * len(places), fractions=places
            )
            for fractions in np.array(places)[closed].tolist():
                grasp = rl.Grasp.at_fractions(zip(edges, fractions, strict=True))
                if len(set(grasp)) < m or (cones.places(grasp.edges, grasp.fractions)[0] < 0).any():
                    continue
                found = [i for i in graph.locate(grasp) if graph.sets.contacts[i] == m]
                assert len(found) <= 1
                if found:
                    assert within(polygon, hand, grasp)
                    assert grasp in graph.sets[found[0]]
                elif within(polygon, hand, grasp, 1.0):
                    pytest.fail(f"{grasp} is in no set")
                inside, beyond = inside + len(found), beyond + (not found)
    assert inside > 20
    assert beyond > 20


@pytest.mark.parametrize("name", CASES)
def test_witnesses_and_pieces(name: str) -> None:
    polygon, friction, hand = CASES[name]
    graph = graph_of(polygon, friction, hand)
    for index, grasp_set in enumerate(graph.sets):
        witness = grasp_set.witness
        assert witness in grasp_set
        assert within(polygon, hand, witness)
        assert grasp_set.margin > 0
        assert rl.margin(polygon, witness, friction) >= grasp_set.margin - 1e-6 * polygon.diameter
        pieces = graph.sets.pieces(index)
        assert pieces.pieces[:, 0].max() == 0
        assert (np.diff(pieces.margins) <= 1e-12).all()
        assert pieces.margins[0] == pytest.approx(grasp_set.margin, abs=1e-9)
        assert grasp_set.pieces.margins(witness.positions).max() > 0


def overlap(pieces: SetPieces, one: int, other: int) -> bool:
    """Whether two pieces overlap, by another solver."""
    sets = pieces.linear([f"f{i}" for i in range(pieces.functions.m)])
    both = sets.take(np.array([one])).join(sets.take(np.array([other])), on=sets.names)
    used = both.rows[0].any(axis=1)
    rows = np.column_stack((both.rows[0], np.ones(len(used))))[used]
    bounds = [(0, 1)] * pieces.functions.m + [(None, None)]
    cost = np.append(np.zeros(pieces.functions.m), -1.0)
    return bool(linprog(cost, rows, both.bounds[0][used], bounds=bounds).fun < -1e-9)


@pytest.mark.parametrize("name", ["both", "strip"])
def test_sets_are_connected_groups_of_pieces(name: str) -> None:
    polygon, friction, hand = CASES[name]
    graph = graph_of(polygon, friction, hand)
    seen: dict[tuple[int, ...], list[SetPieces]] = {}
    for index, grasp_set in enumerate(graph.sets):
        if len(grasp_set.edges) == 3 and 1 not in grasp_set.edges:
            continue  # enough are left
        pieces = graph.sets.pieces(index)
        left, reached = set(range(1, len(pieces))), {0}
        pending = [0]
        while pending:
            one = pending.pop()
            new = {other for other in left if overlap(pieces, one, other)}
            left, pending, reached = left - new, [*pending, *new], reached | new
        assert not left
        seen.setdefault(grasp_set.edges, []).append(pieces)
    for groups in seen.values():
        for one, other in combinations(groups, 2):
            rows = [np.concatenate((getattr(one, a), getattr(other, a))) for a in _FIELDS]
            both = SetPieces(one.functions, *rows)
            pairs = product(range(len(one)), range(len(one), len(both)))
            assert not any(overlap(both, p, q) for p, q in pairs)


_FIELDS = ("pieces", "rows", "bounds", "margins")


def test_a_combination_may_have_several_sets() -> None:
    """A strip as wide as fingers are far apart: one finger is ahead of the other, or behind it."""
    graph = graph_of(STRIP, 2.0, rl.Hand(fingertip_separation=1.5))
    pairs = [s for s in graph.sets if s.edges == (0, 2)]
    assert len(pairs) == 2
    ahead, behind = ([(0, x), (2, 8 - y)] for x, y in ((3.0, 4.5), (4.5, 3.0)))
    where = [set(graph.locate(grasp)) for grasp in (ahead, behind)]
    assert where[0]
    assert where[1]
    assert where[0].isdisjoint(where[1])
    assert graph.locate([(0, 4.0), (2, 4.0)]) == ()
    assert sum(s.edges == (0, 2) for s in rl.build_switching_graph(STRIP, 2.0).sets) == 1


def test_straight_ways_inside_lead_to_the_same_set() -> None:
    polygon, friction, hand = CASES["both"]
    graph = graph_of(polygon, friction, hand)
    rng, compared = np.random.default_rng(3), 0
    t = np.linspace(0, 1, 40)
    for grasp_set in [s for s in graph.sets if len(s.edges) == 3][:8]:
        ends = [(rng.random(3), rng.random(3)) for _ in range(20)]
        for f, g in ends:
            numbers = []
            for x in f + t[:, None] * (g - f):
                grasp = rl.Grasp.at_fractions(zip(grasp_set.edges, x.tolist(), strict=True))
                numbers.append([i for i in graph.locate(grasp) if graph.sets.contacts[i] == 3])
            if all(numbers):
                compared += 1
                assert len({n[0] for n in numbers}) == 1
    assert compared > 5


# --- switches -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [n if n == "span" else pytest.param(n, marks=pytest.mark.slow) for n in CASES],
)
def test_every_switch_has_grasps_that_prove_it(name: str) -> None:
    polygon, friction, hand = CASES[name]
    graph = graph_of(polygon, friction, hand)
    links = list(graph.to_networkx().edges(data="held"))
    assert len(links) == graph.n_switches > 3
    for i, j, held in links[:: max(1, len(links) // 12)]:
        need = hand.held(int(graph.sets.contacts[i]), int(graph.sets.contacts[j]))
        assert held >= need
        switch = graph.switch(i, j)
        assert switch is not None
        for one, other in switch.grasps:
            assert len(set(one) & set(other)) >= need
            assert one in graph.sets[i]
            assert other in graph.sets[j]
            assert within(polygon, hand, rl.Grasp({*one, *other}))
        first, second = graph.witness(i, j) or pytest.fail("no witness")
        assert within(polygon, hand, rl.Grasp({*first, *second}))


@pytest.mark.parametrize("name", ["span", "strip"])
def test_switches_against_a_grid(name: str) -> None:
    """Grasps of the grid that may touch at once are in adjacent sets."""
    polygon, friction, hand = CASES[name]
    graph = graph_of(polygon, friction, hand)
    grid = np.linspace(0.02, 0.98, 9).tolist()
    inside: dict[int, list[rl.Grasp]] = {}
    for index, grasp_set in enumerate(graph.sets):
        for fractions in product(grid, repeat=len(grasp_set.edges)):
            grasp = rl.Grasp.at_fractions(zip(grasp_set.edges, fractions, strict=True))
            if len(set(grasp)) == len(grasp) and within(polygon, hand, grasp, 1.0):
                inside.setdefault(index, []).extend([grasp] if grasp in grasp_set else [])
    points = {
        c: polygon.point(c) for e in range(4) for f in grid for c in [rl.Contact.at_fraction(e, f)]
    }
    points |= {c: polygon.point(c) for grasps in inside.values() for g in grasps for c in g}
    rng, seen = np.random.default_rng(0), 0
    most = (hand.max_span or np.inf) * (1 - SPAN_ERROR) - 1e-7
    least = hand.fingertip_separation * (1 + SEPARATION_ERROR) + 1e-7
    for i, j in combinations(inside, 2):
        need = hand.held(int(graph.sets.contacts[i]), int(graph.sets.contacts[j]))
        for _ in range(200):
            one = inside[i][rng.integers(len(inside[i]))] if inside[i] else None
            other = inside[j][rng.integers(len(inside[j]))] if inside[j] else None
            if one is None or other is None:
                break
            common = set(one) & set(other)
            apart = [
                float(np.hypot(*(points[p] - points[q])))
                for p, q in combinations({*one, *other}, 2)
            ]
            if len(common) >= need and all(least <= d <= most for d in apart):
                assert graph.held(i, j) is not None
                assert graph.held(i, j) >= len(common)
                seen += 1
                break
    assert seen > 5


def test_handovers_name_the_way_that_they_satisfy() -> None:
    polygon, friction, hand = CASES["strip"]
    graph = graph_of(polygon, friction, hand)
    checked = 0
    for i, j, held in list(graph.to_networkx().edges(data="held"))[::7]:
        for handover in handovers(graph.sets, HIGHS, i, j, held):
            ways = graph.sets.coupled(i, j, handover.slots)
            assert ways is not None
            assert handover.way is not None
            theirs = [
                n for n in range(len(handover.second)) if n not in dict(handover.slots).values()
            ]
            x = np.concatenate((handover.first, handover.second[theirs]))
            assert (ways.rows[handover.way] @ x <= ways.bounds[handover.way] + 1e-9).all()
            for here, there in handover.slots:
                assert handover.first[here] == handover.second[there]
            checked += 1
    assert checked > 5


def test_without_limits_nothing_is_coupled() -> None:
    graph = rl.build_switching_graph(STRIP, 2.0)
    assert graph.sets.coupled(0, 1, ()) is None
    pieces = graph.sets.pieces(0)
    assert pieces.rows.shape[1] == 0
    assert pieces.linear(["f0", "f1"]).rows.shape[1] == 2


# --- laws ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("polygon", "friction"), [(BRACKET, 0.3), (rectangle(), 1.0), (star(7, 1), 0.4)]
)
@pytest.mark.parametrize("fingers", [3, 4, 5])
def test_vacuous_limits(polygon: rl.Polygon, friction: float, fingers: int) -> None:
    free = rl.build_switching_graph(polygon, friction, rl.Hand(fingers))
    far = rl.Hand(fingers, 2 * polygon.diameter)
    limited = rl.build_switching_graph(polygon, friction, far)
    assert [(s.kind, s.edges) for s in limited.sets] == [(s.kind, s.edges) for s in free.sets]
    np.testing.assert_allclose(limited.sets.margins, free.sets.margins)
    assert limited.n_switches == free.n_switches
    assert limited.components() == free.components()
    mine, theirs = limited.to_networkx(), free.to_networkx()
    assert set(mine.edges) == set(theirs.edges)
    for i in range(len(free)):
        assert limited.neighbors(i) == free.neighbors(i)


@pytest.mark.slow
@given(stars(), st.sampled_from([0.3, 0.7, 1.0]), st.floats(0.3, 0.9), st.floats(0.3, 0.9))
@settings(max_examples=8)
def test_tighter_limits_leave_less(
    polygon: rl.Polygon, friction: float, one: float, other: float
) -> None:
    tight, loose = sorted((one, other))
    if loose - tight < 0.03:  # less than what the approximations differ by
        loose = min(1.2, tight + 0.05)
    graphs = [
        rl.build_switching_graph(polygon, friction, rl.Hand(max_span=part * polygon.diameter))
        for part in (tight, loose)
    ]
    for grasp_set in graphs[0].sets:
        assert graphs[1].locate(grasp_set.witness)
    edges = [
        {tuple(sorted((g.sets[i].edges, g.sets[j].edges))) for i, j in g.to_networkx().edges}
        for g in graphs
    ]
    assert edges[0] <= edges[1]


def test_units_do_not_matter() -> None:
    hand = rl.Hand(max_span=30, fingertip_separation=8)
    small = rl.Polygon(BRACKET.vertices / 1024)
    again = rl.Hand(max_span=30 / 1024, fingertip_separation=8 / 1024)
    one, other = (rl.build_switching_graph(p, 0.3, h) for p, h in ((BRACKET, hand), (small, again)))
    assert [s.edges for s in one.sets] == [s.edges for s in other.sets]
    np.testing.assert_allclose(one.sets.margins, 1024 * other.sets.margins, rtol=1e-6)
    assert set(one.to_networkx().edges) == set(other.to_networkx().edges)


def test_chapter_sets_and_margins_and_programs() -> None:
    hand = rl.Hand(max_span=30)
    for options in ({"sets": "chapter"}, {"min_margin": 2.0}, {"presolve": False}):
        free = rl.build_switching_graph(BRACKET, 0.3, **options)
        graph = rl.build_switching_graph(BRACKET, 0.3, hand, **options)
        assert 0 < len(graph) < len(free)
        assert all(within(BRACKET, hand, s.witness) for s in graph.sets)
        assert (graph.sets.margins > options.get("min_margin", 0.0)).all()


def test_nothing_is_near_enough() -> None:
    graph = rl.build_switching_graph(BRACKET, 0.3, rl.Hand(max_span=2))
    assert len(graph) == graph.n_switches == 0
    assert graph.components() == []


# --- start and goal, files ------------------------------------------------------------------------


def test_starts_beyond_the_limits_are_refused() -> None:
    def refusal(hand: rl.Hand) -> str:
        with pytest.raises(rl.HandError) as caught:
            within_reach(STRIP, hand, STRIP.resolve([(0, 3.0), (2, 5.0), (1, 0.5)]), "start")
        return str(caught.value)

    assert refusal(rl.Hand(max_span=4)) == (
        "the start has contacts on edge 0 at 3 and on edge 1 at 0.5, 5.02494 apart, more than "
        "max_span=4 of the hand"
    )
    assert refusal(rl.Hand(fingertip_separation=1.5)) == (
        "the start has contacts on edge 0 at 3 and on edge 2 at 5, 1 apart, less than "
        "fingertip_separation=1.5 of the hand"
    )
    exact = rl.Hand(max_span=float(np.hypot(5, 0.5)) + 1e-15, fingertip_separation=1.0)
    grasp = STRIP.resolve([(0, 3.0), (2, 5.0), (1, 0.5)])
    assert within_reach(STRIP, exact, grasp, "start") == grasp


def test_room() -> None:
    hand = rl.Hand(max_span=6, fingertip_separation=0.5)
    at = {1: STRIP.resolve_contact((0, 3.0)), 2: STRIP.resolve_contact((2, 5.0))}
    cones = hand_cones(STRIP, 0.5, hand)
    assert room(cones, hand, at) == 0.25
    assert room(cones, hand, {**at, 3: STRIP.resolve_contact((1, 0.0))}) == 0.25
    assert room(cones, rl.Hand(max_span=1), at) == 0.0
    assert room(cones, rl.Hand(fingertip_separation=2), at) == -0.5


def test_graph_files(tmp_path: Path) -> None:
    for polygon, friction, hand in (CASES["span"], CASES["strip"]):
        graph = graph_of(polygon, friction, hand)
        graph.save(tmp_path / "graph.npz")
        again = rl.load_graph(tmp_path / "graph.npz")
        assert again == graph
        assert again.neighbors(0) == graph.neighbors(0)
        assert repr(again.switch(0, 1)) == repr(graph.switch(0, 1))
        for index in range(len(graph)):
            for name in _FIELDS:
                np.testing.assert_array_equal(
                    getattr(again.sets.pieces(index), name), getattr(graph.sets.pieces(index), name)
                )


@pytest.mark.parametrize("damage", ["missing", "row", "function", "number"])
def test_damaged_graph_files(damage: str, tmp_path: Path) -> None:
    polygon, friction, hand = CASES["strip"]
    graph_of(polygon, friction, hand).save(tmp_path / "graph.npz")
    with np.load(tmp_path / "graph.npz") as archive:
        arrays = {name: archive[name].copy() for name in archive.files}
    assert json.loads(arrays["header"].tobytes())["version"] == 3
    if damage == "missing":
        del arrays["three_finger.piece_rows"]
    elif damage == "row":
        arrays["three_finger.piece_pieces"][-1, 0] += 1
    elif damage == "function":
        arrays["three_finger.piece_pieces"][0, 1] = 99
    else:
        arrays["two_finger.piece_bounds"] = np.full_like(arrays["two_finger.piece_bounds"], np.nan)
    np.savez_compressed(tmp_path / "graph.npz", **arrays)
    with pytest.raises(rl.FileFormatError, match="damaged"):
        rl.load_graph(tmp_path / "graph.npz")


# --- plans --------------------------------------------------------------------------------------


def test_plans_keep_the_distances_at_every_step() -> None:
    hand = rl.Hand(4, 50.0, 1.0, 5.0)
    graph = rl.build_switching_graph(BRACKET, 0.3, hand)
    rng = np.random.default_rng(0)
    for i, j in [(3, 4), (3, 6), *rng.integers(0, len(graph), (10, 2)).tolist()]:
        plan = graph.plan(graph.sets[i].witness, graph.sets[j].witness)
        assert plan.verify().ok
        for held in plan.grasps:
            assert within(BRACKET, hand, rl.Grasp(held.contacts.values()))
        document = plan.to_document()
        document["hand"]["max_span"] = 9.0
        assert "more than max_span = 9.0" in (verify_document(document).fault or "")
