"""Plans: verified, replayed by other means, and of the fewest placements."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from conftest import covering
from geometry import ell, rectangle, star, unit_square
from regrasps import PARTS, Replay, directed, nut, optimal_placements, random_grasps

import regrasp_lp as rl
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.verification import Report

FRICTIONS = (0.1, 0.3, 0.5, 1.0, 1.5)


def assert_sound(plan: rl.Plan, graph: rl.SwitchingGraph, instants: int = 3) -> None:
    """The plan passes its own check and an independent replay, and says no wrong numbers."""
    report = plan.verify()
    assert report.ok, report.fault
    document = plan.to_document()
    replay = Replay(document, instants)
    assert replay.placements == plan.placements
    assert document["friction"] in (graph.friction.tolist(), graph.friction[:1].tolist())
    for held in plan.grasps:
        margin = rl.margin(graph.polygon, held.grasp, graph.friction)
        assert held.margin == pytest.approx(margin, abs=1e-12)
        assert held.margin > -1e-12


def friction_of(number: int, polygon: rl.Polygon) -> float | np.ndarray:
    if number % 3 == 2:
        return np.random.default_rng(number).uniform(0.1, 1.5, polygon.n_edges)
    return FRICTIONS[number % len(FRICTIONS)]


def attempts(
    polygon: rl.Polygon, number: int, pairs: int, *, sets: str, fingers: int, aligning: str
) -> Iterator[tuple[rl.SwitchingGraph, rl.Grasp, rl.Grasp, rl.Plan | rl.NoPlanFound]]:
    """Plans between random grasps, or why there is none."""
    friction = friction_of(number, polygon)
    graph = rl.build_switching_graph(polygon, friction, rl.Hand(fingers), sets)
    rng = np.random.default_rng(number)
    grasps = random_grasps(polygon, friction, rng, pairs, 3, at_vertices=0.3)
    grasps += random_grasps(polygon, friction, rng, max(1, pairs // 2), 2, at_vertices=0.3)
    for _ in range(pairs if grasps else 0):
        start, goal = (grasps[i] for i in rng.integers(len(grasps), size=2))
        try:
            yield graph, start, goal, graph.plan(start, goal, aligning)
        except rl.NoPlanFound as error:
            yield graph, start, goal, error


def check_attempts(
    polygon: rl.Polygon, number: int, pairs: int, *, sets: str, fingers: int, aligning: str
) -> int:
    """Check all plans; return how many there were."""
    plans, costs = 0, None
    for graph, start, goal, outcome in attempts(
        polygon, number, pairs, sets=sets, fingers=fingers, aligning=aligning
    ):
        costs = directed(graph) if costs is None else costs
        best = optimal_placements(graph, start, goal, costs)
        if isinstance(outcome, rl.NoPlanFound):
            if best is not None:
                assert aligning == "regrip"
                assert 'aligning="slide"' in outcome.explanation
            continue
        assert best is not None
        if aligning == "slide":
            assert outcome.placements == best
        elif sets == "complete":
            assert outcome.placements >= best
        else:
            # A contact that is in no set of the chapter's may be kept for the goal.
            new = {(c.edge, c.fraction) for c in outcome.goal}
            new -= {(c.edge, c.fraction) for c in outcome.start.values()}
            assert outcome.placements >= len(new)
        assert_sound(outcome, graph)
        plans += 1
    return plans


KINDS = [
    ("complete", 4, "slide"),
    ("complete", 4, "regrip"),
    ("chapter", 4, "slide"),
    ("complete", 3, "slide"),
    ("complete", 5, "regrip"),
    ("chapter", 6, "slide"),
    ("chapter", 3, "regrip"),
]


@pytest.mark.parametrize(("name", "kind"), covering(PARTS, KINDS, least=3))
def test_random_plans(name: str, kind: tuple[str, int, str]) -> None:
    sets, fingers, aligning = kind
    number = 7 * list(PARTS).index(name) + KINDS.index(kind)
    check_attempts(PARTS[name](), number, 4, sets=sets, fingers=fingers, aligning=aligning)


def test_random_plans_are_many() -> None:
    """The tests above do not pass for want of plans: on most parts nearly all exist."""
    found = check_attempts(rectangle(), 3, 10, sets="complete", fingers=4, aligning="slide")
    assert found == 10
    assert check_attempts(ell(), 1, 6, sets="complete", fingers=4, aligning="regrip") == 6


@pytest.mark.slow
@pytest.mark.parametrize("edges", [20, 30, 40])
@pytest.mark.parametrize("aligning", ["slide", "regrip"])
def test_random_plans_on_large_stars(edges: int, aligning: str) -> None:
    for number, fingers in ((0, 4), (3, 4)):
        polygon = star(edges, number)
        assert check_attempts(
            polygon, number, 20, sets="complete", fingers=fingers, aligning=aligning
        )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_many_random_plans(seed: int) -> None:
    for number, name in enumerate(PARTS):
        for fingers in (3, 4, 5, 6):
            for sets in ("complete", "chapter"):
                for aligning in ("slide", "regrip"):
                    check_attempts(
                        PARTS[name](),
                        100 * seed + number,
                        6,
                        sets=sets,
                        fingers=fingers,
                        aligning=aligning,
                    )


CORPUS = (
    ("tool_icons", 30),
    ("glyphs", 60),
    ("simplified", 40),
    ("laser_cut_parts", 60),
    ("pushing", 60),
    ("countries", 40),
)


@pytest.mark.parametrize(("file", "most"), CORPUS)
def test_plans_on_real_outlines(corpus_folder, file: str, most: int) -> None:
    polygons = rl.read_polygons(corpus_folder / f"{file}.geojson")
    polygon = max((p for p in polygons if p.n_edges <= most), key=lambda p: p.n_edges)
    rng = np.random.default_rng(0)
    grasps = random_grasps(polygon, 0.4, rng, 6, 3)
    for start, goal in zip(grasps[::2], grasps[1::2], strict=False):
        plan = rl.plan_regrasp(polygon, start, goal, 0.4)
        assert plan.verify().ok
        Replay(plan.to_document(), 2)


@pytest.mark.slow
def test_plans_on_the_corpus(corpus: list[rl.Polygon]) -> None:
    plans = 0
    for number, polygon in enumerate(p for p in corpus if p.n_edges <= 60):
        friction = FRICTIONS[number % len(FRICTIONS)]
        rng = np.random.default_rng(number)
        grasps = random_grasps(polygon, friction, rng, 4, 3) or [None]
        for start, goal in combinations(grasps, 2):
            aligning = ("slide", "regrip")[plans % 2]
            try:
                plan = rl.plan_regrasp(polygon, start, goal, friction, aligning=aligning)
            except rl.NoPlanFound:
                continue
            assert plan.verify().ok
            plans += 1
    assert plans > 100


# --- planning without the whole graph -----------------------------------------------------------


@pytest.mark.parametrize(("name", "aligning"), covering(PARTS, ["slide", "regrip"]))
def test_planning_without_the_graph_needs_no_more_placements(name: str, aligning: str) -> None:
    polygon = PARTS[name]()
    for number, pairs in ((1, 3), (2, 3)):
        for graph, start, goal, outcome in attempts(
            polygon, number, pairs, sets="complete", fingers=4, aligning="slide"
        ):
            if isinstance(outcome, rl.NoPlanFound):
                with pytest.raises(rl.NoPlanFound, match=re.escape(outcome.explanation)):
                    rl.plan_regrasp(polygon, start, goal, graph.friction, aligning=aligning)
                continue
            plan = rl.plan_regrasp(polygon, start, goal, graph.friction, aligning=aligning)
            assert plan.verify().ok
            if aligning == "slide":
                assert plan.placements == outcome.placements
                assert_sound(plan, graph)


@pytest.mark.parametrize(
    "options", [{"hand": rl.Hand(3)}, {"hand": rl.Hand(5)}, {"sets": "chapter"}]
)
def test_planning_with_other_hands_and_sets(options: dict[str, object]) -> None:
    start, goal = [(0, 2.0), (2, 2.0)], [(0, 1.0), (1, 1.0), (2, 2.5)]
    plan = rl.plan_regrasp(rectangle(), start, goal, 0.4, **options)
    graph = rl.build_switching_graph(rectangle(), 0.4, **options)
    assert plan.to_json() == graph.plan(start, goal).to_json()


def test_the_same_plan_again() -> None:
    grasps = random_grasps(nut(), 0.3, np.random.default_rng(4), 4, 3)
    for start, goal in combinations(grasps, 2):
        one, other = (
            rl.build_switching_graph(nut(), 0.3).plan(start, goal).to_json() for _ in range(2)
        )
        assert one == other
        assert (
            rl.plan_regrasp(nut(), start, goal, 0.3).to_json()
            == rl.plan_regrasp(nut(), start, goal, 0.3).to_json()
        )


@pytest.mark.parametrize("solver", ["clarabel", "highs"])
def test_both_solvers_plan(solver: str) -> None:
    graph = rl.build_switching_graph(ell(), 0.4, solver=solver)
    other = rl.build_switching_graph(ell(), 0.4)
    for start, goal in combinations(random_grasps(ell(), 0.4, np.random.default_rng(1), 4, 3), 2):
        plan = graph.plan(start, goal)
        assert_sound(plan, graph)
        assert plan.placements == other.plan(start, goal).placements


# --- special starts and goals -------------------------------------------------------------------


@cache
def block_graph(fingers: int = 4, sets: str = "complete") -> rl.SwitchingGraph:
    return rl.build_switching_graph(rectangle(), 0.4, rl.Hand(fingers), sets)


@pytest.mark.parametrize("aligning", ["slide", "regrip"])
@pytest.mark.parametrize(
    "grasp", [[(0, 2.0), (2, 2.0)], [(0, 1.0), (0, 3.0), (2, 2.0)], [(0, 2.0), (1, 1.0), (2, 2.0)]]
)
def test_start_is_goal(grasp: list[tuple[int, float]], aligning: str) -> None:
    plan = block_graph().plan(grasp, grasp[::-1], aligning)
    assert plan.steps == ()
    assert plan.placements == 0
    assert plan.chosen_margin == plan.chosen_tolerance == np.inf
    assert plan.margin == pytest.approx(rl.margin(rectangle(), grasp, 0.4))
    assert plan.tolerance == pytest.approx(rl.tolerance(rectangle(), grasp, 0.4))
    assert_sound(plan, block_graph())


def test_a_goal_in_the_same_set_is_slid_to() -> None:
    start, goal = [(0, 2.0), (2, 2.0)], [(2, 1.5), (0, 2.75)]
    plan = block_graph().plan(start, goal)
    assert all(isinstance(step, rl.Slide) for step in plan.steps)
    assert plan.placements == 0
    assert_sound(plan, block_graph())


def test_regripping_in_the_same_set() -> None:
    start, goal = [(0, 2.0), (2, 2.0)], [(2, 1.5), (0, 2.75)]
    plan = block_graph().plan(start, goal, "regrip")
    kinds = [type(step) for step in plan.steps]
    assert kinds == [rl.Place, rl.Place, rl.Release, rl.Release]
    assert_sound(plan, block_graph())
    plan = block_graph(fingers=3).plan(start, goal, "regrip")
    kinds = [type(step) for step in plan.steps]
    assert kinds == [rl.Place, rl.Release] * (len(kinds) // 2)
    assert_sound(plan, block_graph(fingers=3))


def test_regripping_from_the_border_takes_few_moves() -> None:
    """Along the border of a set each move could be tiny; the way leads through its middle."""
    graph = rl.build_switching_graph(rectangle(), 0.5)
    off = 1.0 - 1e-9
    start, goal = [(0, 0.0), (2, 3.0 + 1e-9)], [(0, 4.0 - off), (2, 1.0 - off + 1e-9)]
    assert rl.margin(rectangle(), start, 0.5) < 1e-8
    assert rl.margin(rectangle(), goal, 0.5) > 0
    plan = graph.plan(start, goal, "regrip")
    assert plan.placements < 100
    assert plan.verify().ok
    start, goal = ([(0, 0.25 + x), (2, 3.75 - x - 1.0 + 1e-9)] for x in (0.0, 2.0))
    assert 0 < rl.margin(rectangle(), start, 0.5) < 1e-8
    assert 0 < rl.margin(rectangle(), goal, 0.5) < 1e-8
    plan = graph.plan(start, goal, "regrip")
    assert plan.placements < 150
    assert plan.verify().ok


def test_regripping_a_sliver_is_refused() -> None:
    """Fingers on a needle could only take steps of its thickness."""
    needle = rl.Polygon([(0, 0), (1, 0), (1, 1e-6), (0, 1e-6)])
    graph = rl.build_switching_graph(needle, 0.5)
    start, goal = [(0, 0.1), (2, 0.9)], [(0, 0.9), (2, 0.1)]
    assert graph.plan(start, goal, "regrip").placements == 2  # with both free fingers at once
    graph = rl.build_switching_graph(needle, 0.5, rl.Hand(3))
    with pytest.raises(rl.NoPlanFound, match=r'more than 1000 placements.*aligning="slide"'):
        graph.plan(start, goal, "regrip")
    assert graph.plan(start, goal).verify().ok


def test_regripping_around_a_corner() -> None:
    """No finger is placed on a vertex where one on the next edge still is."""
    graph = rl.build_switching_graph(unit_square(), 1.5)
    start = rl.Grasp.at_fractions([(0, 0.5), (1, 0.0), (2, 0.5)])
    goal = rl.Grasp.at_fractions([(0, 1.0), (1, 0.5), (2, 0.25)])
    for one, other in ((start, goal), (goal, start)):
        assert_sound(graph.plan(one, other, "regrip"), graph)
        assert_sound(graph.plan(one, other, "slide"), graph)


def test_a_pair_of_three_contacts_may_hold_the_start() -> None:
    start, goal = [(0, 2.0), (1, 1.0), (2, 2.0)], [(0, 1.75), (2, 2.25)]
    plan = block_graph().plan(start, goal)
    assert plan.placements == 0
    assert rl.Release(2) in plan.steps
    assert_sound(plan, block_graph())
    back = block_graph().plan(goal, start)
    assert back.placements == 1
    assert_sound(back, block_graph())


def test_a_three_contact_goal_is_completed_at_last() -> None:
    """The goal's two-finger grasp comes first; its third contact may be anywhere."""
    plan = block_graph(3).plan([(0, 2.0), (2, 2.0)], [(0, 1.0), (1, 0.25), (2, 3.0)])
    assert isinstance(plan.steps[-1], rl.Place)
    assert plan.placements == 1
    assert_sound(plan, block_graph(3))


@pytest.mark.parametrize("aligning", ["slide", "regrip"])
def test_contacts_at_vertices(aligning: str) -> None:
    graph = rl.build_switching_graph(unit_square(), 1.5)
    start = rl.Grasp.at_fractions([(0, 0.0), (2, 0.0)])
    goals = [[(1, 0.0), (3, 0.0)], [(0, 1.0), (2, 1.0)], [(0, 0.0), (1, 1.0), (3, 0.5)]]
    for goal in goals:
        plan = graph.plan(start, rl.Grasp.at_fractions(goal), aligning)
        assert_sound(plan, graph)


@pytest.mark.parametrize("aligning", ["slide", "regrip"])
def test_two_contacts_on_one_edge_keep_their_order(aligning: str) -> None:
    start, goal = [(0, 0.5), (0, 2.5), (2, 2.0)], [(0, 3.5), (0, 1.0), (2, 1.5)]
    plan = block_graph().plan(start, goal, aligning)
    assert_sound(plan, block_graph(), instants=6)
    if aligning == "slide":
        assert plan.placements == 0
        last = plan.grasps[-1].contacts
        assert last[1].position < last[2].position


def test_per_edge_friction() -> None:
    friction = [0.4, 0.05, 0.4, 0.05]
    start, goal = [(0, 2.0), (2, 2.0)], [(0, 1.0), (1, 1.0), (2, 3.2)]
    plan = rl.plan_regrasp(rectangle(), start, goal, friction)
    assert plan.to_document()["friction"] == friction
    assert_sound(plan, rl.build_switching_graph(rectangle(), friction))


# --- no plan ------------------------------------------------------------------------------------


def test_regripping_needs_a_free_finger() -> None:
    start, goal = [(0, 1.0), (0, 3.0), (2, 2.0)], [(0, 0.5), (0, 2.5), (2, 1.5)]
    with pytest.raises(rl.NoPlanFound, match=r'needs a free finger.*all 3.*aligning="slide"') as e:
        rl.build_switching_graph(rectangle(), 0.05, rl.Hand(3)).plan(
            [(0, 1.0), (0, 3.0), (2, 2.5)], [(0, 0.5), (0, 2.5), (2, 1.5)], "regrip"
        )
    assert "one more finger" in e.value.explanation
    assert block_graph().plan(start, goal, "regrip").verify().ok


def components_example() -> tuple[rl.SwitchingGraph, rl.Grasp, rl.Grasp]:
    graph = rl.build_switching_graph(rectangle(), 0.1, rl.Hand(3), sets="chapter")
    first, second = graph.components()[:2]
    return graph, graph.sets[min(first)].witness, graph.sets[min(second)].witness


def test_no_plan_between_components() -> None:
    graph, start, goal = components_example()
    with pytest.raises(rl.NoPlanFound, match="no plan exists among these sets") as error:
        graph.plan(start, goal)
    text = error.value.explanation
    assert str(error.value) == text
    for role, number in (("start", 0), ("goal", 1)):
        size = len(graph.components()[number])
        assert f"the {role} is in component {number} ({size} sets)" in text
    assert f"of {len(graph.components())} components" in text
    with pytest.raises(rl.NoPlanFound, match=re.escape(text)):
        rl.plan_regrasp(rectangle(), start, goal, 0.1, rl.Hand(3), "chapter")


def test_a_grasp_in_no_set_of_the_chapter() -> None:
    """At high friction the chapter has no concurrent grasps."""
    graph = rl.build_switching_graph(star(5, 1), 0.7, sets="chapter")
    others = random_grasps(star(5, 1), 0.7, np.random.default_rng(0), 200, 3)
    missing = next(grasp for grasp in others if not graph.locate(grasp))
    inside = next(grasp for grasp in others if graph.locate(grasp))
    for role, pair in (("start", (missing, inside)), ("goal", (inside, missing))):
        with pytest.raises(rl.NoPlanFound, match=f"the {role} is in none.*use sets=.complete."):
            graph.plan(*pair)
    assert rl.plan_regrasp(star(5, 1), missing, inside, 0.7).verify().ok


def test_a_grasp_below_the_least_margin() -> None:
    graph = rl.build_switching_graph(rectangle(), 0.4, min_margin=0.5)
    inside = [(1, 1.0), (3, 1.0)]
    with pytest.raises(rl.NoPlanFound, match=r"the start is in none.*a margin above 0\.5"):
        graph.plan([(0, 2.0), (2, 2.0)], inside)
    assert graph.plan(inside, inside).steps == ()


# --- starts and goals that cannot be held -------------------------------------------------------

GOOD = [(0, 2.0), (2, 2.0)]


def plans(start: object, goal: object, friction: object = 0.4) -> list[object]:
    """Both ways to plan, to be called."""
    return [
        lambda: block_graph().plan(start, goal),
        lambda: rl.plan_regrasp(rectangle(), start, goal, friction),
    ]


@pytest.mark.parametrize("role", ["start", "goal"])
@pytest.mark.parametrize("way", [0, 1])
@pytest.mark.parametrize(
    ("bad", "error", "message"),
    [
        ([(7, 1.0), (2, 2.0)], rl.ContactError, "edge 7"),
        ([(0, 4.5), (2, 2.0)], rl.ContactError, "4.5"),
        ([(0, -0.5), (2, 2.0)], rl.ContactError, "-0.5"),
        ([(0, 2.0)], rl.ContactError, "2 or 3 contacts, got 1"),
        ([], rl.ContactError, "2 or 3 contacts, got 0"),
        ([(0, 1.0), (0, 2.0), (1, 1.0), (2, 2.0)], rl.ContactError, "2 or 3 contacts, got 4"),
        ([(0, 2.0), (0, 2.0), (2, 2.0)], rl.ContactError, "two contacts at one point"),
        ([(0, 4.0), (1, 0.0), (2, 2.0)], rl.ContactError, "one point.*edge 0 at 4 and edge 1 at 0"),
        ([(3, 2.0), (0, 0.0), (2, 2.0)], rl.ContactError, "one point"),
        ([(0, 1.0), (1, 1.0)], rl.NotForceClosureError, "not in force closure"),
        ([(0, 1.0), (2, 1.0)], rl.NotForceClosureError, "a friction of 1"),
        ([(0, 1.0), (0, 2.0)], rl.NotForceClosureError, "no friction makes it so"),
        ("grasp", rl.ContactError, "pair"),
        (None, rl.ContactError, "iterable"),
    ],
)
def test_what_cannot_be_held(
    role: str, way: int, bad: object, error: type[Exception], message: str
) -> None:
    pair = (bad, GOOD) if role == "start" else (GOOD, bad)
    with pytest.raises(error, match=role) as caught:
        plans(*pair)[way]()
    assert re.search(message, str(caught.value))


def test_the_least_friction_named_is_enough() -> None:
    rng = np.random.default_rng(6)
    named = 0
    for grasp in random_grasps(ell(), 1.5, rng, 12, 3) + random_grasps(ell(), 1.5, rng, 4, 2):
        if rl.is_force_closure(ell(), grasp, 0.2):
            continue
        with pytest.raises(rl.NotForceClosureError) as caught:
            rl.plan_regrasp(ell(), grasp, grasp, 0.2)
        (text,) = re.findall(r"a friction of ([0-9.e+-]+) on all edges", str(caught.value))
        assert rl.is_force_closure(ell(), grasp, float(text))
        assert rl.plan_regrasp(ell(), grasp, grasp, float(text)).steps == ()
        assert not rl.is_force_closure(ell(), grasp, float(text) * (1 - 1e-4))
        named += 1
    assert named >= 5


@pytest.mark.parametrize("friction", [0, -0.3, float("nan"), float("inf"), [0.4] * 3, None, "x"])
def test_wrong_friction(friction: object) -> None:
    with pytest.raises(rl.FrictionError):
        rl.plan_regrasp(rectangle(), GOOD, GOOD, friction)


def test_wrong_aligning() -> None:
    for call in (
        lambda: block_graph().plan(GOOD, GOOD, "jump"),
        lambda: rl.plan_regrasp(rectangle(), GOOD, GOOD, 0.4, aligning="jump"),
    ):
        with pytest.raises(rl.OptionError, match=r"slide.*regrip.*'jump'"):
            call()
    with pytest.raises(rl.OptionError, match=r"complete.*chapter"):
        rl.plan_regrasp(rectangle(), GOOD, GOOD, 0.4, sets="some")


def test_a_plan_that_fails_its_check_is_not_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    report = Report(ok=False, fault="step 1: dropped", grasps_checked=1, slides_checked=0)
    monkeypatch.setattr(Plan, "verify", lambda self: report)
    with pytest.raises(rl.SolverError, match=r"does not pass its exact check \(step 1: dropped\)"):
        block_graph().plan(GOOD, [(1, 1.0), (3, 1.0)])


def test_a_hand_of_two_is_none() -> None:
    with pytest.raises(rl.HandError, match="at least 3 fingers"):
        rl.plan_regrasp(rectangle(), GOOD, GOOD, 0.4, rl.Hand(2))
    for build in (rl.plan_regrasp, rl.build_switching_graph):
        grasps = (GOOD, GOOD) if build is rl.plan_regrasp else ()
        with pytest.raises(rl.HandError, match=r"hand must be a Hand, got 4"):
            build(rectangle(), *grasps, 0.4, 4)


def test_plans_are_plans() -> None:
    assert isinstance(block_graph().plan(GOOD, GOOD), Plan)


def test_a_switch_of_which_no_grasps_are_found_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("regrasp_lp.planning.set_path.handovers", lambda *_: [])
    with pytest.raises(rl.SolverError, match=r"no grasps of the switch from set \d+ to set \d+"):
        rl.plan_regrasp(rectangle(8, 3), [(0, 4.0), (2, 4.0)], [(1, 1.5), (3, 1.5)], 0.4)
