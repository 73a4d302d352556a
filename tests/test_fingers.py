"""Limits of single fingers: sets, switches, plans and their check, against their plain meaning."""

from __future__ import annotations

import json
from functools import cache
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from test_verification import contact, document, place, release, slide

import regrasp_lp as rl
from regrasp_lp.cli import main
from regrasp_lp.contact import Contact
from regrasp_lp.planning.fingers import Fingers
from regrasp_lp.planning.path_lp import FINGERS_APART, Stage, build_path_problem
from regrasp_lp.planning.path_optimum import largest_tolerance
from regrasp_lp.planning.staying import choose_pieces
from regrasp_lp.planning.verification import verify_document
from regrasp_lp.switching_graph import SwitchingGraph

BRACKET = rl.Polygon([(0, 0), (60, 0), (60, 10), (10, 10), (10, 50), (0, 50)], name="bracket")
BLOCK = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], name="block")

HANDS = {
    "one finger keeps off an edge": rl.Hand(finger_reachable={1: {0: None}}),
    "two share a part of one": rl.Hand(finger_reachable={1: {0: (0, 40)}, 2: {0: (0, 40)}}),
    "all differ": rl.Hand(finger_reachable={1: {0: (5, 40)}, 2: {2: None}, 3: {4: None, 0: None}}),
    "with limits of all": rl.Hand(
        reachable={5: (10, 45)}, edge_clearance=1, finger_reachable={4: {5: (0, 30)}}
    ),
    "one does not slide": rl.Hand(only_place=[1]),
}


@cache
def graph_of(hand: rl.Hand, polygon: rl.Polygon = BRACKET, friction: float = 0.3) -> SwitchingGraph:
    return rl.build_switching_graph(polygon, friction, hand=hand)


def may_touch(hand: rl.Hand, finger: int, at: Contact, polygon: rl.Polygon = BRACKET) -> bool:
    """By the words of the limits."""
    length = float(polygon.edge_lengths[at.edge])
    assert at.position is not None
    clear = hand.edge_clearance <= at.position <= length - hand.edge_clearance
    own = dict(dict(hand.finger_reachable).get(finger, ()))  # type: ignore[arg-type, call-overload]
    return clear and all(
        at.edge not in named or any(a <= at.position <= b for a, b in named[at.edge])
        for named in (hand.intervals, own)
    )


def drawn(rng: np.random.Generator, m: int, count: int, polygon: rl.Polygon = BRACKET) -> list[Any]:
    """Random contacts in force closure."""
    edges = rng.integers(0, polygon.n_edges, (80 * count, m))
    fractions = rng.uniform(0.01, 0.99, edges.shape)
    held = rl.is_force_closure(polygon, friction=0.3, edges=edges, fractions=fractions)
    return [
        polygon.resolve(rl.Grasp.at_fractions(zip(e.tolist(), f.tolist(), strict=True)))
        for e, f in zip(edges[held][:count], fractions[held][:count], strict=True)
    ]


# --- sets and switches --------------------------------------------------------------------------


@pytest.mark.parametrize("name", HANDS)
def test_sets_hold_what_fingers_may_hold(name: str) -> None:
    """A grasp by named fingers is in a set of theirs iff each of them may be there."""
    hand, graph = HANDS[name], graph_of(HANDS[name])
    rng, seen = np.random.default_rng(5), [0, 0]
    for m in (2, 3):
        for grasp in drawn(rng, m, 60):
            by = rng.permutation(hand.fingers)[:m] + 1
            group = np.array([hand.group_of(int(finger)) for finger in by])
            allowed = all(may_touch(hand, int(k), at) for k, at in zip(by, grasp, strict=True))
            found = [i for i, some in graph.sets.holding(grasp, group) if len(some) == m]
            assert len(found) == allowed
            assert all(grasp in graph.sets[i] for i in found)
            seen[allowed] += 1
    assert min(seen) > 5 or not hand.finger_reachable


@pytest.mark.parametrize("name", HANDS)
def test_locate_tries_all_fingers(name: str) -> None:
    hand, graph = HANDS[name], graph_of(HANDS[name])
    for grasp in drawn(np.random.default_rng(6), 3, 25):
        every = {
            index
            for by in permutations(range(1, hand.fingers + 1), 3)
            if all(may_touch(hand, k, at) for k, at in zip(by, grasp, strict=True))
            for index, some in graph.sets.holding(grasp, np.array([hand.group_of(k) for k in by]))
            if len(some) == 3
        }
        whole = {i for i in graph.locate(grasp) if graph.sets.contacts[i] == 3}
        assert whole == every


@pytest.mark.parametrize("name", HANDS)
def test_switches_have_fingers_enough(name: str) -> None:
    """The fingers of both grasps of a switch are different fingers that may be there."""
    hand, graph = HANDS[name], graph_of(HANDS[name])
    fingers = Fingers(graph.sets, hand)
    rng = np.random.default_rng(7)
    for i in rng.choice(len(graph), 8):
        for j in graph.neighbors(int(i))[:3]:
            switch = graph.switch(int(i), j)
            assert switch is not None
            for way, (one, other) in zip(switch.handovers, switch.grasps, strict=True):
                groups = [fingers.groups(index).tolist() for index in (int(i), j)]
                for here, there in way.slots:
                    assert groups[0][here] == groups[1][there]
                    assert one[here] == other[there]
                kept = [g for n, g in enumerate(groups[1]) if n not in [t for _, t in way.slots]]
                needed = np.bincount([*groups[0], *kept], minlength=len(hand.groups))
                assert (needed <= [len(group) for group in hand.groups]).all()
                assert one in graph.sets[int(i)]
                assert other in graph.sets[j]
    every = range(1, hand.fingers + 1)
    assert fingers.free(every[1:]) == 1
    with pytest.raises(rl.HandError, match="none of them is free"):
        fingers.free(every)


@pytest.mark.parametrize("name", HANDS)
def test_no_switch_is_missed(name: str) -> None:
    """Two grasps that named fingers can hold at once, one after the other, are of adjacent sets."""
    hand, graph = HANDS[name], graph_of(HANDS[name])
    rng, found = np.random.default_rng(8), 0
    grasps = [grasp for m in (2, 3) for grasp in drawn(rng, m, 40)]
    for _ in range(400):
        one = grasps[rng.integers(len(grasps))]
        by = dict(zip(rng.permutation(hand.fingers) + 1, one, strict=False))
        kept = [k for k in by if rng.random() < 0.7]
        other = grasps[rng.integers(len(grasps))]
        free = [k for k in range(1, hand.fingers + 1) if k not in by]
        later = {k: by[k] for k in kept} | dict(zip(rng.permutation(free), other, strict=False))
        if not 2 <= len(later) <= 3 or len(set(later.values())) < len(later):
            continue
        second = BRACKET.resolve(rl.Grasp(later.values()))
        if not rl.is_force_closure(BRACKET, second, 0.3):
            continue
        if not all(may_touch(hand, int(k), c) for k, c in [*by.items(), *later.items()]):
            continue
        ends = []
        for at in (by, later):
            group = np.array([hand.group_of(int(k)) for k in at])
            whole = graph.sets.holding(BRACKET.resolve(rl.Grasp(at.values())), group)
            ends.append([i for i, some in whole if len(some) == len(at)])
        ((i,), (j,)) = ends
        assert i == j or graph.held(i, j) is not None
        found += i != j
    assert found > 5


def test_all_fingers_alike_are_a_limit_of_the_hand() -> None:
    reach = {0: (0, 40), 2: None}
    alike = graph_of(rl.Hand(finger_reachable=dict.fromkeys(range(1, 5), reach)))
    common = graph_of(rl.Hand(reachable=reach))
    assert alike.hand.groups == ((1, 2, 3, 4),)
    assert [s.edges for s in alike.sets] == [s.edges for s in common.sets]
    np.testing.assert_array_equal(alike.sets.margins, common.sets.margins)
    assert alike.n_switches == common.n_switches


def test_numbers_of_fingers_do_not_matter() -> None:
    reach = {1: {0: (5, 40)}, 2: {2: None}}
    one = graph_of(rl.Hand(finger_reachable=reach))
    other = graph_of(rl.Hand(finger_reachable={5 - k: limits for k, limits in reach.items()}))
    assert (len(one), one.n_switches) == (len(other), other.n_switches)
    np.testing.assert_allclose(sorted(one.sets.margins), sorted(other.sets.margins), atol=1e-9)


def test_fingers_on_one_edge_are_in_either_order() -> None:
    """Finger 1 may be on both sides of the others, which are two sets: it cannot pass them."""
    graph = graph_of(rl.Hand(only_place=[1]))
    cones, orders = graph.sets.cones, []
    for index in graph.sets.on_edges((0, 0, 2)):
        groups = cones.group[graph.sets.functions(index).edges[0]][:2].tolist()
        if groups == [0, 1]:
            first, second = graph.sets.witness(index).positions[:2]
            orders.append(bool(first < second))
    assert sorted(orders) == [False, True]


# --- plans --------------------------------------------------------------------------------------


def obeys(plan: rl.Plan, hand: rl.Hand) -> None:
    """What the limits say, step by step."""
    at = dict(plan.start)
    for finger, here in at.items():
        assert may_touch(hand, finger, here, plan.polygon)
    for step in plan.steps:
        match step:
            case rl.Place(finger, here):
                assert finger not in hand.only_slide
                at[finger] = here
            case rl.Release(finger):
                assert finger not in hand.only_slide
                del at[finger]
            case rl.Slide(moves):
                assert not set(moves) & set(hand.only_place)
                at |= moves
        assert all(may_touch(hand, k, c, plan.polygon) for k, c in at.items())
    report = plan.verify()
    assert report.ok, report.fault


MOVING = {
    **HANDS,
    "two do not slide": rl.Hand(only_place=[1, 2]),
    "five fingers": rl.Hand(5, finger_reachable={k: {1: None, 2: (0, 30)} for k in (1, 2)}),
    "none slides": rl.Hand(only_place=[1, 2, 3, 4]),
    "none of five slides": rl.Hand(5, only_place=range(1, 6)),
    "one only slides": rl.Hand(only_slide=[2]),
    "everything": rl.Hand(
        5, 70, 1, 2, {5: (5, 45)}, {1: {0: (0, 50)}, 2: {3: None}}, only_place=[3], only_slide=[5]
    ),
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=[pytest.mark.slow] * (n in ("everything", "five fingers")))
        for n in MOVING
    ],
)
def test_plans_obey(name: str) -> None:
    hand = MOVING[name]
    graph = graph_of(hand)
    rng, found = np.random.default_rng(9), 0
    grasps = [grasp for m in (2, 3) for grasp in drawn(rng, m, 5)]
    for one, other in zip(grasps, rng.permutation(np.arange(len(grasps))), strict=True):
        by = rng.permutation(hand.fingers)[: len(one)] + 1
        try:
            plan = graph.plan(rl.Grasp(one, by.tolist()), grasps[other])
        except (rl.HandError, rl.NoPlanFound, rl.SolverError):
            continue
        assert list(plan.start) == by.tolist()
        assert plan.bound is not None
        assert plan.placements >= plan.bound
        obeys(plan, hand)
        assert verify_document(json.loads(plan.to_json())).ok
        found += 1
    assert found >= (1 if hand.only_slide else 4)


def test_where_nothing_slides_hops_do_no_better() -> None:
    """Repositioning without sliding is what a hand does whose fingers only are placed."""
    free, tied = graph_of(rl.Hand()), graph_of(rl.Hand(only_place=range(1, 5)))
    assert len(free) == len(tied)
    start, goal = [(0, 30.0), (2, 30.0)], [(5, 20.0), (3, 20.0)]
    hops = free.plan(start, goal, aligning="regrip")
    plan = tied.plan(start, goal)
    obeys(plan, tied.hand)
    assert not any(isinstance(step, rl.Slide) for step in plan.steps)
    assert plan.placements <= hops.placements


def test_a_finger_comes_off_to_come_back_elsewhere() -> None:
    graph = graph_of(rl.Hand(only_place=range(1, 5)), BLOCK, 0.4)
    plan = graph.plan([(0, 1.0), (2, 4.5)], [(0, 5.0), (2, 1.5)])
    obeys(plan, graph.hand)
    assert plan.bound == 0
    assert plan.placements >= 2


def test_a_finger_that_only_slides_stays_from_start_to_goal() -> None:
    graph = graph_of(rl.Hand(only_slide=[1]), BLOCK, 0.4)
    start, goal = [(0, 1.0), (2, 4.5)], [(0, 5.0), (2, 1.5), (1, 1.0)]
    plan = graph.plan(start, goal)
    obeys(plan, graph.hand)
    assert plan.start[1].edge == 0
    with pytest.raises(rl.NoPlanFound):  # finger 1 is on edge 0 for good
        graph.plan(start, [(1, 1.5), (3, 1.5)])
    idle = graph.plan(rl.Grasp(start, fingers=[2, 3]), goal)
    assert all(1 not in held.contacts for held in idle.grasps)


def test_three_fingers_that_only_slide_keep_to_their_set() -> None:
    """More of them than a two-finger set has contacts."""
    graph = graph_of(rl.Hand(only_slide=[1, 2, 3]), BLOCK, 0.4)
    plan = graph.plan([(0, 1.0), (2, 4.5), (1, 1.0)], [(0, 5.0), (2, 1.5), (1, 1.5)])
    obeys(plan, graph.hand)
    assert all(isinstance(step, rl.Slide) for step in plan.steps)


def test_objectives_state_their_bounds() -> None:
    graph = graph_of(rl.Hand(finger_reachable={1: {0: None}}))
    start, goal = rl.Grasp([(0, 30.0), (2, 30.0)], fingers=[2, 1]), [(5, 20.0), (3, 20.0)]
    for objective in ("margin", "tolerance"):
        plan = graph.plan(start, goal, objective=objective)
        assert plan.bound is not None
        assert plan.value is not None
        assert plan.value <= plan.bound * (1 + 1e-9)
    assert graph.plan(start, goal, objective="travel").bound is None
    with pytest.raises(rl.HandError, match="limits of single fingers"):
        graph.plan(start, goal, aligning="regrip")
    with pytest.raises(rl.HandError, match="single fingers"):
        graph.path_set([0])


def test_regions_and_tolerance_end_where_the_finger_may_not_touch() -> None:
    graph = graph_of(rl.Hand(finger_reachable={1: {0: (28, 33)}}))
    plan = graph.plan([(0, 30.0), (2, 30.0)], [(0, 31.0), (2, 30.0)])
    assert plan.grasps[0].tolerance <= 2
    low, high = plan.regions()[0].intervals[1]
    assert low.position is not None
    assert high.position is not None
    assert 28 - 1e-9 <= low.position < high.position <= 33 + 1e-9
    assert plan.sensitivity().tolerance.least <= 2 + 1e-9


# --- the choice of pieces -----------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_pieces_are_nearly_the_best(seed: int) -> None:
    """One slide a set: the mixed-integer program against every choice of pieces, by scipy."""
    graph = graph_of(rl.Hand(only_place=range(1, 5)))
    rng = np.random.default_rng(seed)
    while True:
        i = int(rng.integers(len(graph)))
        j = int(rng.choice(graph.neighbors(i)))
        switch = graph.switch(i, j)
        assert switch is not None
        held = [switch.handovers[0].slots]
        ends = [graph.sets.families[f].witnesses[r] for f, r in map(graph.sets.place, (i, j))]
        stages = []
        for index in (i, j):
            parts = graph.sets.pieces(index)
            staying = tuple(range(parts.functions.m))
            stages.append(Stage(parts.functions, parts.pieces, limits=parts, staying=staying))
        ends[1] = ends[1].copy()
        for here, there in held[0]:
            ends[1][there] = ends[0][here]
        best = -np.inf
        for p, q in product(range(len(stages[0].pieces)), range(len(stages[1].pieces))):
            some = [
                Stage(
                    s.functions,
                    s.pieces[[n]],
                    limits=s.limits.take(np.array([n])),
                    staying=s.staying,
                )
                for s, n in zip(stages, (p, q), strict=True)
                if s.limits is not None
            ]
            problem = build_path_problem(some, held, ends[0], ends[1], apart=FINGERS_APART)
            if problem.n_variables:
                found = linprog(
                    np.append(np.zeros(problem.n_variables), -1.0),
                    np.column_stack((problem.rows.toarray(), problem.scales)),
                    problem.bounds,
                    bounds=[(0, 1)] * problem.n_variables + [(None, None)],
                )
                best = max(best, -found.fun if found.status == 0 else -np.inf)
        if best <= 1e-3:
            continue
        chosen = choose_pieces(stages, held, ends[0], ends[1], ())
        problem = build_path_problem(chosen, held, ends[0], ends[1])
        reached = problem.tolerance(largest_tolerance(problem, "clarabel"))
        assert reached >= 0.9 * best
        return


# --- verification -------------------------------------------------------------------------------


def regrasp(**limits: Any) -> dict[str, Any]:
    """On a 4 by 2 block: slide down-left, place on the right, and take the first finger off."""
    plan = document(
        start=[contact(0, 0.5), contact(2, 0.5)],
        steps=[
            slide((1, 0, 0.5, 0.25), (2, 2, 0.5, 0.75)),
            place(3, 0, 0.75),
            release(1),
            slide((3, 0, 0.75, 0.375)),
        ],
        goal=[contact(0, 0.375), contact(2, 0.75)],
        friction=(1.5,),
    )
    plan["hand"].update(limits)
    return plan


def of_finger(finger: int, edge: int, *intervals: list[float]) -> dict[str, Any]:
    return {"finger": finger, "reachable": [{"edge": edge, "intervals": list(intervals)}]}


@pytest.mark.parametrize(
    "limits",
    [
        {"finger_reachable": [of_finger(4, 0), of_finger(3, 2)]},
        {"finger_reachable": [of_finger(1, 0, [1.0, 2.0]), of_finger(3, 0, [1.5, 3.0])]},
        {"only_place": [4]},
        {"only_slide": [2, 4]},
    ],
)
def test_limits_that_hold(limits: dict[str, Any]) -> None:
    report = verify_document(regrasp(**limits))
    assert report.ok, report.fault


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        (
            {"finger_reachable": [of_finger(1, 0)]},
            "start: finger 1 at fraction 0.5 is on edge 0, which finger 1 may not touch "
            "(finger_reachable)",
        ),
        (
            {"finger_reachable": [of_finger(3, 0, [0.0, 2.5])]},
            "step 2 (place finger 3): finger 3 at fraction 0.75 is on a part of edge 0 that "
            "finger 3 may not touch (finger_reachable)",
        ),
        (
            {"finger_reachable": [of_finger(3, 0, [0.0, 2.0], [2.5, 4.0])]},
            "step 4 (slide finger 3): finger 3 on edge 0 at fraction 0.75 passes over a part of "
            "edge 0 that finger 3 may not touch (finger_reachable)",
        ),
        ({"only_place": [2]}, "step 1 (slide fingers 1, 2): finger 2 may not slide (only_place)"),
        (
            {"only_slide": [3]},
            "step 2 (place finger 3): finger 3 may not be placed or released (only_slide)",
        ),
        (
            {"only_slide": [1]},
            "step 3 (release finger 1): finger 1 may not be placed or released (only_slide)",
        ),
    ],
)
def test_faults(limits: dict[str, Any], expected: str) -> None:
    assert verify_document(regrasp(**limits)).fault == expected


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"finger_reachable": {"1": []}}, "hand.finger_reachable: expected a list"),
        ({"finger_reachable": [{"finger": 1}]}, r"finger_reachable\[0\].reachable is missing"),
        (
            {"finger_reachable": [of_finger(1, 0), of_finger(1, 2)]},
            r"hand.finger_reachable\[1\].finger: finger 1 is named twice",
        ),
        (
            {"finger_reachable": [of_finger(1, 0, [2.0, 1.0])]},
            r"hand.finger_reachable\[0\].reachable\[0\].intervals: expected 0 <= first <= last",
        ),
        ({"only_place": ["1"]}, r"hand.only_place\[0\]: expected an integer"),
        ({"only_slide": 1}, "hand.only_slide: expected a list"),
    ],
)
def test_documents_without_meaning(limits: dict[str, Any], message: str) -> None:
    with pytest.raises(rl.FileFormatError, match=message):
        verify_document(regrasp(**limits))


# --- values, files, command line ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"finger_reachable": 3}, "finger_reachable must be a mapping from fingers"),
        ({"finger_reachable": {5: {}}}, "finger_reachable names fingers from 1 to 4, not 5"),
        ({"finger_reachable": {1.0: {}}}, "names fingers from 1 to 4, not 1.0"),
        ({"finger_reachable": [(1, {}), (1, {})]}, "finger_reachable names a finger twice"),
        ({"finger_reachable": {1: {0: (2, 1)}}}, r"finger_reachable\[1\]: reachable\[0\] must be"),
        ({"only_place": [0]}, "only_place names fingers from 1 to 4, not 0"),
        ({"only_place": True}, "only_place names fingers from 1 to 4, not True"),
        ({"only_slide": "12"}, "only_slide names fingers from 1 to 4, not '12'"),
        ({"only_place": [1, 2], "only_slide": [2]}, "finger 2 is in only_place and in only_slide"),
    ],
)
def test_senseless_limits(limits: dict[str, Any], message: str) -> None:
    with pytest.raises(rl.HandError, match=message):
        rl.Hand(**limits)


def test_equal_limits_are_equal_hands() -> None:
    assert rl.Hand(finger_reachable={1: {}}) == rl.Hand() == rl.Hand(only_place=())
    assert rl.Hand(only_place=[2, 1, 2]) == rl.Hand(only_place=(1, 2)) != rl.Hand(only_place=[1])
    assert rl.Hand(finger_reachable={2: {0: [(1, 2), (2, 3)]}}) == rl.Hand(
        finger_reachable=[(2, {0: (1, 3)})]
    )
    assert [hand.coupled for hand in (rl.Hand(), rl.Hand(reachable={1: None}))] == [False, False]
    assert all(hand.coupled for hand in (*HANDS.values(), rl.Hand(max_span=3)))


reaches = st.dictionaries(
    st.integers(0, 5),
    st.none() | st.tuples(st.floats(0, 5), st.floats(6, 9)),
    max_size=2,
)


@settings(max_examples=50)
@given(
    st.dictionaries(st.integers(1, 4), reaches, max_size=3),
    st.sets(st.integers(1, 4), max_size=2),
)
def test_documents_give_the_hand_again(reach: Any, placed: set[int]) -> None:
    hand = rl.Hand(finger_reachable=reach, only_place=placed, only_slide={1, 2, 3, 4} - placed)
    again = rl.Hand.from_document(json.loads(json.dumps(hand.to_document())))
    assert again == hand
    assert hash(again) == hash(hand)
    assert eval(repr(hand), {"Hand": rl.Hand}) == hand
    assert sorted(finger for group in hand.groups for finger in group) == [1, 2, 3, 4]


@pytest.mark.parametrize("name", ["all differ", "one does not slide"])
def test_graph_files(name: str, tmp_path: Path) -> None:
    graph = graph_of(HANDS[name])
    graph.save(tmp_path / "graph.npz")
    again = rl.load_graph(tmp_path / "graph.npz")
    assert again.hand == graph.hand
    np.testing.assert_array_equal(again.sets.margins, graph.sets.margins)
    np.testing.assert_array_equal(again.sets.cones.group, graph.sets.cones.group)
    assert again.n_switches == graph.n_switches
    assert again.components() == graph.components()


def test_starts_name_their_fingers() -> None:
    hand = rl.Hand(finger_reachable={1: {0: None}})
    graph = graph_of(hand)
    goal = [(5, 20.0), (3, 20.0)]
    with pytest.raises(rl.HandError, match="where finger 1 may not touch: nowhere on this edge"):
        graph.plan([(0, 30.0), (2, 30.0)], goal)
    plan = graph.plan(rl.Grasp([(0, 30.0), (2, 30.0)], fingers=(3, 1)), goal)
    assert list(plan.start) == [3, 1]
    obeys(plan, hand)
    with pytest.raises(rl.HandError, match=r"fingers \[2, 5\], the hand has fingers 1 to 4"):
        graph.plan(rl.Grasp([(0, 30.0), (2, 30.0)], fingers=(2, 5)), goal)
    with pytest.raises(rl.ContactError, match="leave its fingers out"):
        graph.plan(goal, rl.Grasp(goal, fingers=(2, 3)))
    both = rl.Hand(finger_reachable={k: {0: None} for k in (1, 2, 3)})
    with pytest.raises(rl.HandError, match="no different fingers that may all touch there"):
        graph_of(both).plan(goal, [(0, 10.0), (0, 30.0), (2, 30.0)])


def test_fingers_of_grasps() -> None:
    grasp = rl.Grasp([(0, 1.0), (2, 2.0)], fingers=[3, 1])
    assert grasp.fingers == (3, 1)
    assert grasp == rl.Grasp([(0, 1.0), (2, 2.0)])
    assert BLOCK.resolve(grasp).fingers == rl.Grasp(grasp).fingers == (3, 1)
    assert eval(repr(grasp), {"Grasp": rl.Grasp}).fingers == (3, 1)
    for fingers in ([1], [1, 1], [0, 1], [1, 2.0], [True, 2]):
        with pytest.raises(rl.ContactError, match="2 different numbers from 1"):
            rl.Grasp([(0, 1.0), (2, 2.0)], fingers=fingers)  # type: ignore[arg-type]


def test_command_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "bracket.wkt"
    ring = ", ".join(f"{x} {y}" for x, y in [*BRACKET.vertices, BRACKET.vertices[0]])
    file.write_text(f"POLYGON (({ring}))")
    out = tmp_path / "plan.json"
    command = ["plan", str(file), "--friction", "0.3", "--json", str(out)]
    limits = ["--finger-avoids", "1:0,3", "--only-place", "2"]
    assert main([*command, *limits]) == 0
    told = capsys.readouterr().out
    document_ = json.loads(out.read_text())
    hand = rl.Hand.from_document(document_["hand"])
    assert hand == rl.Hand(finger_reachable={1: {0: None, 3: None}}, only_place=[2])
    start = next(line.split()[1] for line in told.splitlines() if "--start" in line)
    goal = next(line.split()[1] for line in told.splitlines() if "--goal" in line)
    assert main([*command, *limits, "--start", start, "--goal", goal]) == 0
    assert json.loads(out.read_text()) == document_
    capsys.readouterr()
    assert main([*command, "--only-slide", "4"]) == 0  # by the three others
    assert "place finger 4" not in capsys.readouterr().out
    assert main([*command, "--finger-avoids", "1"]) == 2
    assert main([*command, "--only-place", "x"]) == 2
    assert main([*command, "--only-place", "7"]) == 2
