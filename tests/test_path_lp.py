"""The path LP against linprog on the same chain, written from the exact torque functions."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from conftest import covering
from geometry import comb, ell, rectangle, star
from regrasps import nut, random_grasps, tee
from scipy.optimize import linprog

import regrasp_lp as rl
from regrasp_lp.planning import path_lp, path_optimum, set_path
from regrasp_lp.planning.path_lp import PathProblem, Stage


@dataclass
class Chain:
    """What a plan's contacts were chosen from, and what was chosen."""

    stages: list[Stage]
    held: list[list[tuple[int, int]]]
    start: np.ndarray
    goal: np.ndarray
    problem: PathProblem
    grasps: list[np.ndarray]


def plan_with_chain(
    graph: rl.SwitchingGraph, start: rl.Grasp, goal: rl.Grasp, monkeypatch: pytest.MonkeyPatch
) -> tuple[rl.Plan, Chain]:
    seen: dict[str, Any] = {}

    def build(stages: Any, held: Any, f: Any, g: Any, couplings: Any) -> PathProblem:
        seen.update(stages=list(stages), held=[list(h) for h in held], start=f, goal=g)
        seen["problem"] = path_lp.build_path_problem(stages, held, f, g, couplings=couplings)
        return seen["problem"]

    def solve(problem: PathProblem, solver: str) -> Any:
        seen["grasps"] = path_optimum.solve_path_problem(problem, solver)
        return seen["grasps"]

    with monkeypatch.context() as patch:
        patch.setattr(set_path, "build_path_problem", build)
        patch.setattr(set_path, "solve_path_problem", solve)
        plan = graph.plan(start, goal)
    return plan, Chain(**seen)


def independent_optimum(chain: Chain) -> float:
    """The largest least tolerance of all grasps that are not given, by linprog; inf if none.

    The functions come as rationals up to a factor: dividing by their slopes over the lengths
    leaves ``M / w``.
    """
    index: dict[tuple[int, int, int], int] = {}
    for t, stage in enumerate(chain.stages):
        for node in range(len(stage.pieces) + 1):
            for slot in range(stage.functions.m):
                index[t, node, slot] = len(index)
    rows, bounds, equal, values = [], [], [], []

    def row(entries: dict[int, float], delta: float, bound: float) -> None:
        new = np.zeros(len(index) + 1)
        for column, value in entries.items():
            new[column] += value
        new[-1] = delta
        rows.append(new)
        bounds.append(bound)

    last = len(chain.stages) - 1
    free = 0
    for t, stage in enumerate(chain.stages):
        functions, m = stage.functions, stage.functions.m
        lengths = functions.lengths[0]
        constant, slopes = functions.exact_coefficients(0)
        final = len(stage.pieces)
        for node in range(final + 1):
            columns = [index[t, node, slot] for slot in range(m)]
            if (t, node) == (0, 0) or (t, node) == (last, final):
                at = chain.start if (t, node) == (0, 0) else chain.goal
                for column, value in zip(columns, at, strict=True):
                    equal.append((column, value))
                continue
            free += 1
            for piece in {max(node - 1, 0), min(node, final - 1)}:
                _, j, k = stage.pieces[piece]
                for number, sign in ((j, 1.0), (k, -1.0)):
                    weight = float(
                        sum(
                            s / length
                            for s, length in zip(map(float, slopes[number]), lengths, strict=True)
                        )
                    )
                    row(
                        {
                            column: sign * float(s) / weight
                            for column, s in zip(columns, slopes[number], strict=True)
                        },
                        1.0,
                        -sign * float(constant[number]) / weight,
                    )
            for column, length in zip(columns, lengths, strict=True):
                row({column: -length}, 1.0, 0.0)
                row({column: length}, 1.0, length)
            for slot in range(m - 1):
                if functions.edges[0, slot] == functions.edges[0, slot + 1]:
                    entries = {columns[slot]: lengths[slot], columns[slot + 1]: -lengths[slot]}
                    row(entries, 2.0, 0.0)
    if not free:
        return np.inf
    for t, slots in enumerate(chain.held):
        final = len(chain.stages[t].pieces)
        for here, there in slots:
            values.append((index[t, final, here], index[t + 1, 0, there]))
    matrix = np.zeros((len(equal) + len(values), len(index) + 1))
    right = np.zeros(len(matrix))
    for number, (column, value) in enumerate(equal):
        matrix[number, column], right[number] = 1.0, value
    for number, (one, other) in enumerate(values, start=len(equal)):
        matrix[number, one], matrix[number, other] = 1.0, -1.0
    result = linprog(
        np.append(np.zeros(len(index)), -1.0),
        A_ub=np.array(rows),
        b_ub=np.array(bounds),
        A_eq=matrix,
        b_eq=right,
        bounds=[(0, 1)] * len(index) + [(None, None)],
    )
    assert result.status == 0
    return float(result.x[-1])


CASES = {
    "rectangle": (rectangle(), 0.4, 4, "complete"),
    "rectangle, 3 fingers": (rectangle(), 0.4, 3, "complete"),
    "ell": (ell(), 0.3, 4, "complete"),
    "ell, chapter": (ell(), 0.5, 4, "chapter"),
    "tee, 5 fingers": (tee(), 0.3, 5, "complete"),
    "nut": (nut(), 0.2, 4, "complete"),
    "nut, chapter": (nut(), 0.2, 4, "chapter"),
    "comb, 3 fingers": (comb(2), 0.5, 3, "complete"),
    "star": (star(12, 1), 0.3, 4, "complete"),
}


def chains(
    name: str, monkeypatch: pytest.MonkeyPatch, solver: str = "clarabel"
) -> list[tuple[rl.SwitchingGraph, rl.Plan, Chain]]:
    polygon, friction, fingers, sets = CASES[name]
    graph = rl.build_switching_graph(polygon, friction, rl.Hand(fingers), sets, solver=solver)
    grasps = random_grasps(polygon, friction, np.random.default_rng(8), 8, 3)
    grasps += random_grasps(polygon, friction, np.random.default_rng(9), 2, 2)
    found = []
    for start, goal in [*pairwise(grasps), (grasps[-1], grasps[0])]:
        try:
            found.append((graph, *plan_with_chain(graph, start, goal, monkeypatch)))
        except rl.NoPlanFound:
            continue
    return found


@pytest.mark.parametrize(("name", "solver"), covering(CASES, ["clarabel", "highs"]))
def test_no_tolerance_is_larger(name: str, solver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = chains(name, monkeypatch, solver)
    assert found
    chosen = 0
    for graph, plan, chain in found:
        best = independent_optimum(chain)
        # What remains of the start, or is there of the goal, is not for the program to choose.
        ends = set(plan.start.values()), set(plan.goal)
        parts = [g.tolerance for g in plan.grasps if any(set(g.grasp) < end for end in ends)]
        part = min(parts, default=np.inf)
        if best == np.inf:
            assert plan.chosen_tolerance >= part
            continue
        assert best > 0
        size = chain.stages[0].functions.cones.size
        x = solution(chain)
        reached = chain.problem.tolerance(x) * size
        # a thousandth may be given for fewer and shorter slides
        assert best * (1 - 2e-3) <= reached <= best * (1 + 1e-6)
        # a piece's tolerance is a lower bound of the grasp's
        assert plan.chosen_tolerance >= min(reached, part) * (1 - 1e-9)
        assert plan.margin <= plan.chosen_margin
        assert graph.options.solver == solver
        chosen += 1
    assert chosen


def solution(chain: Chain) -> np.ndarray:
    """The values of the variables, from the grasps."""
    x = np.zeros(chain.problem.rows.shape[1])
    for ids, grasps in zip(chain.problem.variables, chain.grasps, strict=True):
        x[ids[ids >= 0]] = grasps[ids >= 0]
    return x


@pytest.mark.parametrize("name", CASES)
def test_held_contacts_are_equal_and_ends_are_given(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for _, plan, chain in chains(name, monkeypatch):
        assert chain.grasps[0][0].tolist() == chain.start.tolist()
        assert chain.grasps[-1][-1].tolist() == chain.goal.tolist()
        for slots, one, other in zip(chain.held, chain.grasps, chain.grasps[1:], strict=False):
            for here, there in slots:
                assert one[-1, here] == other[0, there]
        for stage, grasps in zip(chain.stages, chain.grasps, strict=True):
            assert len(grasps) == len(stage.pieces) + 1
            assert ((grasps >= 0) & (grasps <= 1)).all()
            assert all(stage.functions.contain(f[None, :])[0] for f in grasps)
        for one, other in pairwise(plan.grasps):
            for finger in set(one.contacts) & set(other.contacts):
                step = plan.steps[one.after_step]
                if not isinstance(step, rl.Slide) or finger not in step.moves:
                    assert one.contacts[finger] == other.contacts[finger]


def test_no_feasible_sample_is_better(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    for _, plan, chain in chains("ell", monkeypatch):
        count = chain.problem.rows.shape[1]
        if not count:
            continue
        x = solution(chain)
        reached = chain.problem.tolerance(x)
        near = np.clip(x + rng.normal(scale=0.05, size=(300, count)), 0, 1)
        for sample in [*near, *rng.random((300, count))]:
            assert chain.problem.tolerance(sample) <= reached * (1 + 2e-3)
        assert plan.chosen_tolerance > 0


def test_travel_is_least_among_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the tolerance fixed no way is shorter, by linprog on the problem's own rows."""
    for _, _, chain in chains("rectangle", monkeypatch):
        problem = chain.problem
        count, moves = problem.rows.shape[1], problem.moves.shape[0]
        if not count:
            continue
        x = solution(chain)
        kept = problem.tolerance(x) * (1 - 1e-6)
        rows = problem.rows.toarray()
        travel = problem.moves.toarray()
        result = linprog(
            np.append(np.zeros(count), np.ones(moves)),
            A_ub=np.block(
                [
                    [rows, np.zeros((len(rows), moves))],
                    [travel, -np.eye(moves)],
                    [-travel, -np.eye(moves)],
                ]
            ),
            b_ub=np.concatenate(
                (problem.bounds - kept * problem.scales, -problem.offsets, problem.offsets)
            ),
            bounds=[(0, 1)] * count + [(0, None)] * moves,
        )
        length = np.abs(problem.moves @ x + problem.offsets).sum()
        assert length <= result.fun + 1e-4
