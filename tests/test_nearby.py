"""The largest margin on large objects, from some of the edges: against the graph of all of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from bench.subjects import random_grasps
from conftest import covering, star_polygon

import regrasp_lp as rl
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.pieces import Measure
from regrasp_lp.lp import get_solver
from regrasp_lp.planning import nearby
from regrasp_lp.planning.ends import supports
from regrasp_lp.planning.levels import PieceRows
from regrasp_lp.planning.moves import KnownMoves
from regrasp_lp.planning.nearby import Surroundings
from regrasp_lp.switches import StoredSwitches

FRICTION = 0.3
EQUAL = 1e-6
MEASURES: tuple[Measure, ...] = ("margin", "tolerance")


def pairs(polygon: rl.Polygon, count: int) -> Iterator[tuple[rl.Grasp, rl.Grasp]]:
    grasps = random_grasps(polygon, FRICTION, 2 * count, np.random.default_rng(polygon.n_edges))
    for start, goal in zip(grasps[::2], grasps[1::2], strict=True):
        yield polygon.resolve(start), polygon.resolve(goal)


def surroundings(
    polygon: rl.Polygon, start: rl.Grasp, goal: rl.Grasp, measure: Measure
) -> Surroundings:
    cones = Cones.of(polygon, FRICTION)
    return Surroundings(polygon, cones, get_solver("clarabel"), start, goal, measure)


@pytest.mark.parametrize(("n", "measure"), covering([21, 24], MEASURES))
def test_some_edges_against_all(n: int, measure: Measure, monkeypatch: pytest.MonkeyPatch) -> None:
    """The plan is no better than the best, the bound no worse; a gap of 0 is one."""
    monkeypatch.setattr(nearby, "_WHOLE", 8)
    monkeypatch.setattr(nearby, "_SOME", (8, 12))
    polygon = star_polygon(n, seed=2)
    graph = rl.build_switching_graph(polygon, FRICTION)
    proved = chosen = 0
    for start, goal in pairs(polygon, 12):
        optimum = graph.plan(start, goal, objective=measure)
        assert optimum.gap == 0
        plan = rl.plan_regrasp(polygon, start, goal, FRICTION, objective=measure)
        assert plan.verify().ok
        assert plan.bound is not None
        assert plan.value <= optimum.value * (1 + EQUAL)
        assert plan.bound >= optimum.value * (1 - EQUAL)
        assert np.isinf(plan.value) == np.isinf(optimum.value)
        chosen += bool(np.isfinite(plan.value))
        proved += plan.gap == 0
    assert chosen >= 3
    assert proved >= 3


@pytest.mark.parametrize("measure", MEASURES)
def test_what_is_next_to_start_and_goal(measure: Measure) -> None:
    """The cap and the promise of edges, against all sets and switches of the graph.

    Sets of two contacts may be left out between the given grasps: adding one to them costs nothing.
    """
    polygon = star_polygon(14, seed=1)
    graph = rl.build_switching_graph(polygon, FRICTION)
    assert isinstance(graph.switches, StoredSwitches)
    rows = PieceRows(graph.sets.sources, measure)
    moves = KnownMoves(rows, graph.switches, graph.hand)
    for start, goal in pairs(polygon, 5):
        around = surroundings(polygon, start, goal, measure)
        caps, promise = [], np.zeros((2, polygon.n_edges))
        for side, grasp in zip(promise, (start, goal), strict=True):
            best = 0.0
            for support in supports(rows, graph.sets, grasp, 4):
                best = max(best, support.widest)
                for contacts in moves.of(support.index):
                    levels = support.onward(contacts).max(axis=(1, 2))
                    best = max(best, float(levels.max()))
                    for other, level in zip(contacts.others, levels, strict=True):
                        edges = [edge for edge in rows.edges[other].tolist() if edge >= 0]
                        side[edges] = np.maximum(side[edges], level)
            caps.append(best)
        assert around.cap == pytest.approx(min(caps), rel=1e-9)
        # All others hold one contact more than two, so that they are among the neighbours, too.
        found = around.promise
        assert (found <= np.minimum(promise, min(caps)) * (1 + 1e-9)).all()
        assert found.max(axis=1) == pytest.approx(np.minimum(promise, min(caps)).max(axis=1))


def test_only_what_is_above_the_best_plan_is_out_of_reach() -> None:
    polygon = star_polygon(14, seed=3)
    graph = rl.build_switching_graph(polygon, FRICTION)
    decided = 0
    for start, goal in pairs(polygon, 6):
        optimum = graph.plan(start, goal, objective="margin").value
        around = surroundings(polygon, start, goal, "margin")
        assert around.direct == np.isinf(optimum)
        if np.isfinite(optimum):
            decided += 1
            assert not around.out_of_reach(optimum * (1 - EQUAL))
            assert around.out_of_reach(around.cap * (1 + EQUAL))
    assert decided
