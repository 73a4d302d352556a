"""Plans as values: margins along slides, the file, the account."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from geometry import ell, rectangle
from regrasps import nut, plate, random_grasps

import regrasp_lp as rl
from regrasp_lp.friction import Cones
from regrasp_lp.planning.account import describe
from regrasp_lp.planning.along import least_margin_along
from regrasp_lp.planning.objective import Objective, ObjectiveLike
from regrasp_lp.torque import torque_functions


@cache
def plans() -> list[rl.Plan]:
    """Plans on several parts, with holes, per-edge friction and the chapter's sets."""
    found = []
    for number, (polygon, friction, options) in enumerate(
        (
            (rectangle(), 0.4, {}),
            (rl.Polygon(ell().vertices, name="bracket"), [0.2, 0.3, 0.4, 0.5, 0.6, 0.7], {}),
            (nut(), 0.3, {"sets": "chapter"}),
            (plate(), 0.3, {"hand": rl.Hand(5)}),
        )
    ):
        graph = rl.build_switching_graph(polygon, friction, **options)
        rng = np.random.default_rng(number)
        grasps = random_grasps(polygon, friction, rng, 6, 3)
        grasps += random_grasps(polygon, friction, rng, 2, 2)
        for aligning in ("slide", "regrip"):
            for start, goal in pairwise(grasps):
                try:
                    found.append(graph.plan(start, goal, aligning))
                except rl.NoPlanFound:
                    continue
    assert len(found) > 25
    assert any(grasp.support.center is not None for plan in found for grasp in plan.grasps)
    return found


# --- margins ------------------------------------------------------------------------------------


def test_least_margin_along_random_slides() -> None:
    """Never more than any sample, and hardly less than the least of many."""
    rng = np.random.default_rng(1)
    polygon = nut()
    cones = Cones.of(polygon, 0.5)
    times = np.linspace(0, 1, 2001)
    for edges in rng.integers(0, polygon.n_edges, (100, 3)):
        functions = torque_functions(cones, np.sort(edges)[None, :])
        f, g = rng.random((2, 3))
        least = least_margin_along(functions, f, g)
        if not functions.spans[0]:
            assert least == -np.inf
            continue
        sampled = rl.margin(
            polygon,
            friction=0.5,
            edges=np.tile(np.sort(edges), (len(times), 1)),
            fractions=f + times[:, None] * (g - f),
        )
        assert least <= sampled.min() + 1e-12
        assert least >= sampled.min() - 4.0 / len(times)


def test_margins_along_the_slides_of_plans() -> None:
    slides = 0
    for plan in plans():
        for i, step in enumerate(plan.steps):
            if not isinstance(step, rl.Slide):
                assert plan.slide_margins[i] == np.inf
                continue
            before, after = plan.grasps[i].grasp, plan.grasps[i + 1].grasp
            times = np.linspace(0, 1, 201)[:, None]
            sampled = rl.margin(
                plan.polygon,
                friction=plan.friction,
                edges=np.tile(before.edges, (len(times), 1)),
                fractions=before.fractions + times * (after.fractions - before.fractions),
            )
            assert 0 < plan.slide_margins[i] <= sampled.min() + 1e-12
            assert plan.slide_margins[i] == pytest.approx(sampled.min(), abs=0.02)
            slides += 1
        assert plan.margin == min([*plan.margins, *plan.slide_margins])
        assert plan.tolerance == min(grasp.tolerance for grasp in plan.grasps)
        assert plan.margin <= plan.chosen_margin
        assert plan.tolerance <= plan.chosen_tolerance
    assert slides > 15


def test_grasps_of_plans() -> None:
    for plan in plans():
        assert len(plan.grasps) == len(plan.steps) + 1
        for i, held in enumerate(plan.grasps):
            assert held.after_step == i
            assert set(held.support.fingers) <= set(held.contacts)
            assert list(held.contacts) == sorted(held.contacts)
            assert len(held.contacts) <= plan.hand.fingers
            assert held.tolerance == pytest.approx(
                rl.tolerance(plan.polygon, held.grasp, plan.friction), abs=1e-12
            )
        assert plan.grasps[0].contacts == dict(plan.start)
        assert set(plan.grasps[-1].contacts.values()) == set(plan.goal)
        assert plan.placements == sum(isinstance(step, rl.Place) for step in plan.steps)
        for (_, one), (_, other) in pairwise(plan.path):
            assert len(one) in (2, 3)
            assert len(other) in (2, 3)
        with pytest.raises(TypeError):
            plan.grasps[0].contacts[1] = None


# --- the file -----------------------------------------------------------------------------------


def test_document_has_exactly_the_entries_of_the_format() -> None:
    for plan in plans():
        document = json.loads(plan.to_json())
        assert list(document) == [
            "format",
            "version",
            "name",
            "polygon",
            "friction",
            "hand",
            "margin",
            "start",
            "goal",
            "steps",
            "grasps",
        ]
        assert (document["format"], document["version"]) == ("regrasp-plan", 1)
        assert document["name"] == plan.polygon.name
        assert set(document["polygon"]) == {"exterior", "holes"}
        rings = [document["polygon"]["exterior"], *document["polygon"]["holes"]]
        assert [len(ring) for ring in rings] == [len(ring) for ring in plan.polygon.rings]
        assert np.array_equal(np.concatenate(rings), plan.polygon.vertices)
        uniform = len(set(plan.friction.tolist())) == 1
        assert document["friction"] == plan.friction.tolist()[: 1 if uniform else None]
        assert document["hand"] == {"fingers": plan.hand.fingers}
        assert type(document["margin"]) is float
        assert document["margin"] == plan.margin
        for entry in document["start"]:
            assert list(entry) == ["finger", "edge", "fraction", "position"]
            check_place(plan.polygon, entry)
        for entry in document["goal"]:
            assert list(entry) == ["edge", "fraction", "position"]
            check_place(plan.polygon, entry)
        for step in document["steps"]:
            check_step(plan.polygon, step)
        for i, grasp in enumerate(document["grasps"]):
            keys = ["after_step", "margin", "tolerance", "set", "supporting"]
            assert list(grasp) in (keys, [*keys, "center"])
            assert ("center" in grasp) == (grasp["set"] == "parallel")
            assert grasp["after_step"] == i
            assert type(grasp["margin"]) is type(grasp["tolerance"]) is float
            assert all(type(finger) is int for finger in grasp["supporting"])


def check_place(polygon: rl.Polygon, entry: dict[str, object]) -> None:
    assert type(entry["edge"]) is int
    assert type(entry["fraction"]) is float
    assert type(entry["position"]) is float
    length = polygon.edge_lengths[entry["edge"]]
    assert entry["position"] == pytest.approx(entry["fraction"] * length)


def check_step(polygon: rl.Polygon, step: dict[str, object]) -> None:
    if step["action"] == "place":
        assert list(step) == ["action", "finger", "edge", "fraction", "position"]
        check_place(polygon, step)
    elif step["action"] == "release":
        assert list(step) == ["action", "finger"]
    else:
        assert list(step) == ["action", "moves"]
        assert step["action"] == "slide"
        for move in step["moves"]:
            assert list(move) == ["finger", "edge", "from", "to"]
            for end in (move["from"], move["to"]):
                assert list(end) == ["fraction", "position"]
                check_place(polygon, {"edge": move["edge"], **end})


def test_round_trip(tmp_path: Path) -> None:
    for number, plan in enumerate(plans()):
        path = tmp_path / f"{number}.json"
        text = plan.to_json(path)
        assert path.read_text(encoding="utf-8") == text
        again = rl.read_plan(path)
        assert again.to_json() == text
        assert again == plan
        assert hash(again) == hash(plan)
        assert again.polygon == plan.polygon
        assert again.steps == plan.steps
        assert again.supports == plan.supports
        assert again.margins == plan.margins
        assert again.slide_margins == plan.slide_margins
        assert again.path == plan.path
        assert (again.margin, again.tolerance) == (plan.margin, plan.tolerance)
        assert again.chosen_tolerance == plan.chosen_tolerance
        assert dict(again.start) == dict(plan.start)
        assert again.goal == plan.goal
        assert again.verify().ok
        assert rl.check_plan(path).ok
        assert rl.check_plan(str(path)).ok
        assert rl.check_plan(again).ok


def test_plans_differ_by_content() -> None:
    assert plans()[0] != plans()[1]
    assert plans()[0] != plans()[0].to_json()


def test_a_changed_plan_is_found_out(tmp_path: Path) -> None:
    plan = rl.plan_regrasp(rectangle(), [(0, 2.0), (2, 2.0)], [(1, 1.0), (3, 1.0)], 0.4)
    document = plan.to_document()
    document["steps"] = [s for s in document["steps"] if s["action"] != "place"]
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(document))
    report = rl.check_plan(path)
    assert not report.ok
    assert report.fault


@pytest.mark.parametrize("missing", ["grasps", "goal", "polygon", "hand", "start", "steps"])
def test_incomplete_files(tmp_path: Path, missing: str) -> None:
    document = plans()[0].to_document()
    del document[missing]
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(document))
    with pytest.raises(rl.FileFormatError, match=r"plan\.json"):
        rl.read_plan(path)


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("grasps", [{}]),
        ("grasps", 3),
        ("grasps", []),
        ("start", [{"edge": 99, "fraction": 0.5}]),
        ("start", [{"edge": 0, "fraction": 1.5}]),
        ("goal", [{"edge": 0}]),
        ("friction", [0.1, 0.2]),
        ("friction", [-1.0]),
        ("friction", []),
        ("hand", {"fingers": 2}),
        ("polygon", {"exterior": [[0, 0], [1, 1]], "holes": []}),
        ("steps", [{"action": "throw", "finger": 1}]),
        ("steps", [{"action": "release", "finger": 9}]),
        ("format", "regrasp-graph"),
        ("version", 2),
    ],
)
def test_files_that_make_no_sense(tmp_path: Path, entry: str, value: object) -> None:
    document = {**plans()[0].to_document(), entry: value}
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(document))
    with pytest.raises(rl.FileFormatError, match=r"plan\.json"):
        rl.read_plan(path)


def test_a_failed_write_leaves_the_old_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "plan.json"
    text = plans()[0].to_json(path)

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        plans()[1].to_json(path)
    assert path.read_text(encoding="utf-8") == text


# --- the account --------------------------------------------------------------------------------


def test_account_tells_every_step() -> None:
    for plan in plans():
        text = str(plan)
        column = " ".join(line[5:38].strip() for line in text.splitlines()[3:])
        rest = column
        for step in plan.steps:
            assert describe(step) in rest
            rest = rest.split(describe(step), 1)[1]
        assert f"{plan.placements} placement" in text
        assert f"margin {plan.margin:.4g}" in text
        assert (plan.polygon.name or "unnamed polygon") in text.splitlines()[0]
        assert text.splitlines()[-1].startswith("goal reached: edge ")
        assert max(map(len, text.splitlines()[3:-1])) <= 80
        assert repr(plan).startswith(f"<Plan {plan.polygon.name!r}: {len(plan.steps)} steps")


def test_account_says_how_good_the_plan_is() -> None:
    def line(objective: ObjectiveLike, bound: float | None) -> str:
        aim = Objective.of(objective)
        told = str(replace(plan, objective=aim, bound=bound)).splitlines()
        assert max(map(len, told)) < 80
        found = [i for i, text in enumerate(told) if text.startswith("objective")]
        return " ".join(told[i] for i in range(found[0], told.index(""))) if found else ""

    plan = next(plan for plan in plans() if np.isfinite(plan.chosen_margin) and plan.travel)
    margin, travel, count = plan.chosen_margin, plan.travel, plan.placements
    assert not line("margin", None)
    best = f"objective margin: {margin:.4g}, bound {margin:.4g}: no plan is better"
    assert line("margin", margin) == best
    assert line("margin", 2 * margin) == (
        f"objective margin: {margin:.4g}, bound {2 * margin:.4g}: no plan is better by more than "
        f"{margin:.4g}"
    )
    assert line("placements", count).endswith(f": {count}, bound {count}: no plan is better")
    assert replace(plan, objective=Objective.of("travel"), bound=-np.inf).gap == np.inf
    assert line("travel", -np.inf).endswith(": how good plans can be is not known")
    weights = {"margin": 0.5, "travel": 1, "tolerance": 2}
    cost = travel - 0.5 * margin - 2 * plan.chosen_tolerance
    assert line(weights, cost).startswith(
        f"objective -0.5 margin - 2 tolerance + 1 travel: {cost:.4g}, bound {cost:.4g}: no "
    )
    still = next(p for p in plans() if not np.isfinite(p.chosen_margin))
    told = str(replace(still, objective=Objective.of("margin"), bound=np.inf))
    assert "\nobjective margin: there was nothing to choose: no plan is better\n" in told


def test_describe() -> None:
    contact = rl.Contact(3, position=1.25, fraction=0.5)
    assert describe(rl.Place(2, contact)) == "place finger 2 on edge 3 at 1.25"
    assert describe(rl.Release(4)) == "release finger 4"
    assert describe(rl.Slide({1: contact})) == "slide finger 1 to edge 3 at 1.25"
    both = rl.Slide({2: contact, 1: contact})
    assert describe(both).startswith("slide fingers 1 to edge 3 at 1.25, 2 to ")


def test_slides_are_values() -> None:
    contact = rl.Contact(3, position=1.25, fraction=0.5)
    one, other = rl.Slide({2: contact, 1: contact}), rl.Slide({1: contact, 2: contact})
    assert one == other
    assert hash(one) == hash(other)
    with pytest.raises(TypeError):
        one.moves[1] = contact
