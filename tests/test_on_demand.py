"""Planning without listing all sets first: the same number of placements, on any object."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from conftest import covering
from geometry import star

import regrasp_lp as rl
from regrasp_lp.friction import Cones
from regrasp_lp.planning.on_demand import path_on_demand
from regrasp_lp.planning.search import fewest_placements


def two_grasps(polygon: rl.Polygon, friction: float, seed: int) -> tuple[rl.Grasp, rl.Grasp]:
    """Two random grasps of three contacts in force closure."""
    rng = np.random.default_rng(seed)
    found: list[rl.Grasp] = []
    while len(found) < 2:
        edges = rng.integers(polygon.n_edges, size=(2000, 3))
        fractions = rng.uniform(size=(2000, 3))
        closed = rl.is_force_closure(polygon, friction=friction, edges=edges, fractions=fractions)
        for row in np.flatnonzero(closed):
            pairs = zip(edges[row].tolist(), fractions[row].tolist(), strict=True)
            found.append(rl.Grasp.at_fractions(pairs))
    return found[0], found[1]


def cost(graph: rl.SwitchingGraph, path: list[int]) -> int:
    held = [graph.held(i, j) for i, j in pairwise(path)]
    assert None not in held
    contacts = graph.sets.contacts
    return sum(int(contacts[j]) - int(h or 0) for j, h in zip(path[1:], held, strict=True))


@pytest.mark.parametrize(("n", "friction"), covering([5, 9, 16], [0.12, 0.3, 0.8, 1.5]))
def test_as_few_placements_as_in_the_whole_graph(n: int, friction: float) -> None:
    polygon = star(n, seed=n)
    graph = rl.build_switching_graph(polygon, friction)
    cones = Cones.of(polygon, friction)
    rng = np.random.default_rng(n)
    joined = 0
    for i, j in rng.integers(len(graph), size=(40, 2)).tolist():
        start, goal = (np.array(graph.sets[k].edges) for k in (i, j))
        found = path_on_demand(cones, start, goal)
        best = fewest_placements(
            graph.sets.contacts, graph.sets.margins, graph.switches, graph.hand, {i: 0}, {j: 0}
        )
        assert (found is None) == (best is None)
        if found is None or best is None:
            continue
        joined += 1
        numbers = [graph.sets.on_edges(edges)[0] for edges in found]
        assert numbers[0] == i
        assert numbers[-1] == j
        assert cost(graph, numbers) == cost(graph, best)
    assert joined > 0


def test_parts(workpieces: dict[str, rl.Polygon]) -> None:
    for polygon in workpieces.values():
        start, goal = two_grasps(polygon, 0.6, seed=1)
        plan = rl.plan_regrasp(polygon, start, goal, friction=0.6)
        graph = rl.build_switching_graph(polygon, 0.6)
        assert plan.verify().ok
        assert plan.placements == graph.plan(start, goal).placements


def test_a_triple_that_no_switch_leaves() -> None:
    """A nearly frictionless triangle has one set, and no plan leads out of it."""
    triangle = rl.Polygon([(0, 0), (4, 0), (1, 3)])
    cones = Cones.of(triangle, 0.05)
    graph = rl.build_switching_graph(triangle, 0.05)
    assert [s.edges for s in graph.sets] == [(0, 1, 2)]
    assert path_on_demand(cones, np.array([0, 1, 2]), np.array([0, 1, 2])) == [(0, 1, 2)]


@pytest.mark.parametrize(("n", "seed", "friction"), [(7, 2, 0.03), (8, 12, 0.03), (9, 15, 0.06)])
def test_no_path_between_two_components(n: int, seed: int, friction: float) -> None:
    polygon = star(n, seed)
    graph = rl.build_switching_graph(polygon, friction)
    components = graph.components()
    assert len(components) == 2
    i, j = min(components[0]), min(components[1])
    edges = [np.array(graph.sets[k].edges) for k in (i, j)]
    assert path_on_demand(Cones.of(polygon, friction), *edges) is None
    with pytest.raises(rl.NoPlanFound, match=r"component 0 .* component 1"):
        rl.plan_regrasp(polygon, graph.sets[i].witness, graph.sets[j].witness, friction)


def test_large_outlines(corpus: list[rl.Polygon]) -> None:
    largest = sorted(corpus, key=lambda polygon: -polygon.n_edges)[:3]
    for polygon in largest:
        for friction in (0.15, 0.5):
            start, goal = two_grasps(polygon, friction, seed=0)
            plan = rl.plan_regrasp(polygon, start, goal, friction)
            assert plan.verify().ok
            assert plan.chosen_tolerance > 0
