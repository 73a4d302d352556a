"""The switching graph: its sets and switches against networkx, exact tests and bare LPs."""

from __future__ import annotations

from itertools import combinations

import networkx as nx
import numpy as np
import pytest
from conftest import covering
from geometry import GENERAL, LATTICE, ell, rectangle, regular, star, unit_square
from regrasps import PARTS, random_grasps

import regrasp_lp as rl
from regrasp_lp import build, handovers
from regrasp_lp.switches import StoredSwitches, SwitchesOnDemand

SMALL = {
    "square": (unit_square(), 0.5),
    "rectangle": (rectangle(), 0.4),
    "ell": (ell(), 0.3),
    "regular 6": (regular(6), 0.25),
    "star 8": (star(8, 3), 0.2),
    "nut": (PARTS["nut"](), 0.2),
}


def graph_of(name: str, fingers: int = 4, **options: object) -> rl.SwitchingGraph:
    polygon, friction = SMALL[name]
    return rl.build_switching_graph(polygon, friction, rl.Hand(fingers), **options)


def spread_friction(polygon: rl.Polygon, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.1, 1.5, polygon.n_edges)


def pairs_of(graph: rl.SwitchingGraph) -> dict[tuple[int, int], int]:
    return {(i, j): held for i, j, held in graph.to_networkx().edges(data="held")}


CASES = [
    (name, k, sets)
    for name in SMALL
    for k in (3, 4, 5, 6)
    for sets in ("complete", "chapter")
    if name != "nut" or k < 5
]


@pytest.mark.parametrize(("name", "fingers", "sets"), CASES)
def test_networkx_agrees(name: str, fingers: int, sets: str) -> None:
    graph = graph_of(name, fingers, sets=sets)
    explicit = graph.to_networkx()
    assert list(explicit.nodes) == list(range(len(graph)))
    assert graph.n_switches == explicit.number_of_edges()
    components = sorted(nx.connected_components(explicit), key=lambda c: (-len(c), min(c)))
    assert graph.components() == components
    for kind, counts in graph.summary().kinds.items():
        alone = explicit.subgraph(i for i, of in explicit.nodes(data="kind") if of == kind)
        assert counts.sets == len(alone)
        assert counts.components == nx.number_connected_components(alone)
    for i in explicit.nodes:
        assert graph.neighbors(i) == sorted(explicit[i])
    for i, data in explicit.nodes(data=True):
        found = graph.sets[i]
        assert data == {
            "kind": found.kind,
            "edges": found.edges,
            "center": found.center,
            "margin": found.margin,
        }


@pytest.mark.parametrize(("name", "fingers", "sets"), CASES)
def test_adjacency_is_symmetric_and_held_as_counted(name: str, fingers: int, sets: str) -> None:
    graph = graph_of(name, fingers, sets=sets)
    neighbors = [graph.neighbors(i) for i in range(len(graph))]
    for i, found in enumerate(neighbors):
        assert found == sorted(set(found) - {i})
        assert all(i in neighbors[j] for j in found)
    contacts = graph.sets.contacts
    for (i, j), held in pairs_of(graph).items():
        need = graph.hand.held(int(contacts[i]), int(contacts[j]))
        assert need <= held <= min(contacts[i], contacts[j])
        assert graph.held(i, j) == graph.held(j, i) == held
        common = list(graph.sets[j].edges)
        shared = [common.remove(e) for e in graph.sets[i].edges if e in common]
        assert held <= len(shared)


@pytest.mark.parametrize(
    ("of", "sets"), covering([("square", 4), ("ell", 3), ("star 8", 4)], ["complete", "chapter"])
)
def test_every_switch_has_its_witnesses(of: tuple[str, int], sets: str) -> None:
    graph = graph_of(*of, sets=sets)
    polygon, friction = graph.polygon, graph.friction
    rng = np.random.default_rng(0)
    pairs = list(combinations(range(len(graph)), 2))
    for k in rng.permutation(len(pairs))[:150]:
        i, j = pairs[k]
        switch = graph.switch(i, j)
        assert (switch is None) == (j not in graph.neighbors(i))
        if switch is None:
            continue
        assert (switch.first, switch.second) == (i, j)
        assert switch.held == graph.held(i, j)
        assert switch.margin == max(h.margin for h in switch.handovers)
        need = graph.hand.held(*(len(graph.sets[n].edges) for n in (i, j)))
        assert [h.held for h in switch.handovers] == sorted(
            (h.held for h in switch.handovers), reverse=True
        )
        for handover, edges, grasps in zip(
            switch.handovers, switch.edges, switch.grasps, strict=True
        ):
            assert handover.held == len(edges) >= need
            margins = []
            for number, grasp in zip((i, j), grasps, strict=True):
                assert tuple(grasp.edges.tolist()) == graph.sets[number].edges
                assert rl.is_force_closure(polygon, grasp, friction)
                assert grasp in graph.sets[number]
                margins.append(rl.margin(polygon, grasp, friction))
            for slot, (here, there) in enumerate(handover.slots):
                assert grasps[0][here] == grasps[1][there]
                assert grasps[0][here].edge == edges[slot]
            # the margin of a parallel set and of a piece are lower bounds of the grasp's
            assert min(margins) >= handover.margin - 1e-9
            if sets == "complete" and handover.held == 0:
                assert min(margins) == pytest.approx(handover.margin, abs=1e-7)
        best = switch.witnesses
        assert min(rl.margin(polygon, grasp, friction) for grasp in best) >= switch.margin - 1e-9
        back = graph.switch(j, i)
        assert back is not None
        assert back.margin == pytest.approx(switch.margin, abs=1e-7)
        assert len(back.handovers) == len(switch.handovers)


def test_no_set_switches_to_itself() -> None:
    graph = graph_of("square")
    assert graph.switch(3, 3) is None
    assert graph.held(3, 3) is None


def test_margin_of_a_switch_is_that_of_its_witnesses_at_best() -> None:
    """No sampled pair of grasps with the same held contacts has a larger margin."""
    graph = graph_of("rectangle")
    polygon, friction = graph.polygon, graph.friction
    rng = np.random.default_rng(5)
    seen = 0
    for i, j in combinations(range(len(graph)), 2):
        switch = graph.switch(i, j)
        if switch is None or switch.held == 0:
            continue
        for handover in switch.handovers:
            fractions = [rng.random((2000, len(f))) for f in (handover.first, handover.second)]
            for here, there in handover.slots:
                fractions[1][:, there] = fractions[0][:, here]
            least = np.full(2000, np.inf)
            for n, f in zip((i, j), fractions, strict=True):
                edges = np.tile(graph.sets[n].edges, (2000, 1))
                margins = rl.margin(polygon, friction=friction, edges=edges, fractions=f)
                # slots are places along an edge: contacts out of order are another choice
                again = edges[:, 1:] == edges[:, :-1]
                ordered = ~(again & (f[:, 1:] < f[:, :-1])).any(axis=1)
                least = np.minimum(least, np.where(ordered, margins, -np.inf))
            # keeping contacts apart may cost a thousandth
            assert least.max() <= handover.margin * (1 + 2e-3)
            seen += 1
    assert seen > 20


# --- sets and the grasps in them ----------------------------------------------------------------


@pytest.mark.parametrize("name", [*LATTICE, "star7", "regular5", "thin", "nearly_parallel"])
def test_locate_is_complete(name: str) -> None:
    """Every grasp in force closure is in a set, alone or with two of its three contacts."""
    polygon = {**LATTICE, **GENERAL}[name]
    rng = np.random.default_rng(len(name))
    for friction in (0.125, 0.5, 1.5, spread_friction(polygon, 1)):
        graph = rl.build_switching_graph(polygon, friction)
        for contacts in (2, 3):
            for grasp in random_grasps(polygon, friction, rng, 12, contacts, at_vertices=0.5):
                found = graph.locate(grasp)
                assert found == tuple(sorted(set(found)))
                edges = tuple(sorted(grasp.edges.tolist()))
                exactly = [i for i in found if graph.sets[i].edges == edges]
                assert len(exactly) == 1
                assert grasp in graph.sets[exactly[0]]
                pairs = {
                    tuple(sorted((one.edge, other.edge)))
                    for one, other in combinations(grasp, 2)
                    if contacts == 3 and rl.is_force_closure(polygon, [one, other], friction)
                }
                assert {graph.sets[i].edges for i in found} == {edges} | pairs


@pytest.mark.parametrize("name", ["square", "ell", "nut", "star 8"])
def test_locate_finds_nothing_that_is_not_there(name: str) -> None:
    polygon, friction = SMALL[name]
    rng = np.random.default_rng(2)
    for sets in ("complete", "chapter"):
        graph = rl.build_switching_graph(polygon, friction, sets=sets)
        edges = rng.integers(0, polygon.n_edges, (400, 3))
        fractions = rng.random(edges.shape)
        closed = rl.is_force_closure(polygon, friction=friction, edges=edges, fractions=fractions)
        for row in range(len(edges)):
            grasp = rl.Grasp.at_fractions(zip(edges[row].tolist(), fractions[row], strict=True))
            found = graph.locate(grasp)
            if sets == "complete":
                assert bool(found) == closed[row]
            elif found:
                assert closed[row]


def test_a_grasp_on_the_border_is_in_no_set() -> None:
    graph = rl.build_switching_graph(unit_square(), 0.25)
    assert graph.locate([(0, 0.5), (2, 0.25)]) == ()
    assert len(graph.locate([(0, 0.5), (2, 0.375)])) == 1


def test_sets_are_a_sequence() -> None:
    graph = graph_of("square")
    assert len(graph) == len(graph.sets) == len(list(graph.sets)) == 10
    assert [s.edges for s in graph.sets[1:3]] == [graph.sets[1].edges, graph.sets[2].edges]
    assert graph.sets[-1].edges == graph.sets[9].edges
    assert graph.sets.kinds == tuple(s.kind for s in graph.sets)
    for bad in (10, -11):
        with pytest.raises(IndexError, match="there are 10, numbered from 0"):
            graph.sets[bad]
    for call in (graph.neighbors, lambda i: graph.switch(0, i), lambda i: graph.held(i, 0)):
        with pytest.raises(IndexError, match="no grasp set 10"):
            call(10)


@pytest.mark.parametrize("sets", ["complete", "chapter"])
@pytest.mark.parametrize("name", SMALL)
def test_each_set_has_a_witness_with_its_margin(name: str, sets: str) -> None:
    graph = graph_of(name, sets=sets)
    for found in graph.sets:
        assert found.witness in found
        assert found.edges == tuple(sorted(found.edges))
        margin = rl.margin(graph.polygon, found.witness, graph.friction)
        # contacts that meet at a corner are moved apart by a millionth
        assert margin >= found.margin - 1e-6
        if found.kind != "parallel":
            assert margin == pytest.approx(found.margin, abs=1e-6)
        assert (found.center is not None) == (found.kind == "parallel")
        if found.center is not None:
            assert found.center in found.edges
        assert len(found.pieces) >= 1
        best = found.pieces[0].margins(found.witness.positions[None, :])
        assert found.kind == "parallel" or best[0] <= margin + 1e-9
        assert found.kind in repr(found)
        assert str(found.edges) in repr(found)


def test_a_set_holds_only_grasps() -> None:
    found = graph_of("square").sets[0]
    assert "grasp" not in found
    assert rl.Grasp([(0, 0.5), (1, 0.5), (2, 0.5)]) not in found


# --- other ways to the same graph ---------------------------------------------------------------


def assert_same(graph: rl.SwitchingGraph, other: rl.SwitchingGraph, accuracy: float) -> None:
    assert [(s.kind, s.edges, s.center) for s in graph.sets] == [
        (s.kind, s.edges, s.center) for s in other.sets
    ]
    assert np.allclose(graph.sets.margins, other.sets.margins, rtol=0, atol=accuracy)
    assert pairs_of(graph) == pairs_of(other)
    assert graph.components() == other.components()


WITHOUT_PRESOLVE = [
    ("rectangle", "complete", (3, 4, 5, 6), "clarabel"),
    ("rectangle", "chapter", (3, 4, 5, 6), "highs"),
    ("ell", "complete", (4,), "clarabel"),
    ("ell", "chapter", (3, 5), "highs"),
    ("regular 6", "chapter", (3, 4, 5, 6), "clarabel"),
    ("regular 6", "complete", (4,), "clarabel"),
    ("star 8", "chapter", (4,), "highs"),
    ("star 8", "chapter", (4,), "clarabel"),
]


@pytest.mark.parametrize(("name", "sets", "fingers", "solver"), WITHOUT_PRESOLVE)
def test_linear_programs_alone_find_the_same(
    name: str, sets: str, fingers: tuple[int, ...], solver: str
) -> None:
    for k in fingers:
        graph = graph_of(name, k, sets=sets, solver=solver)
        bare = graph_of(name, k, sets=sets, solver=solver, presolve=False)
        assert not bare.options.presolve
        assert_same(graph, bare, 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["clarabel", "highs"])
@pytest.mark.parametrize("sets", ["complete", "chapter"])
@pytest.mark.parametrize("name", ["ell", "regular 6", "star 8", "star 10"])
def test_linear_programs_alone_find_the_same_everywhere(name: str, sets: str, solver: str) -> None:
    polygon, friction = {**SMALL, "star 10": (star(10, 2), 0.3)}[name]
    for k in (3, 4, 5, 6):
        graph, bare = (
            rl.build_switching_graph(
                polygon, friction, rl.Hand(k), sets, solver=solver, presolve=presolve
            )
            for presolve in (True, False)
        )
        assert_same(graph, bare, 1e-8)


@pytest.mark.parametrize("sets", ["complete", "chapter"])
@pytest.mark.parametrize("fingers", [3, 4, 5, 6])
@pytest.mark.parametrize("name", ["ell", "star 8"])
def test_solvers_agree(name: str, fingers: int, sets: str) -> None:
    by_clarabel, by_highs = (
        graph_of(name, fingers, sets=sets, solver=solver) for solver in ("clarabel", "highs")
    )
    assert_same(by_clarabel, by_highs, 1e-8)


@pytest.mark.parametrize(
    ("of", "sets"),
    covering([("square", 3), ("ell", 4), ("star 8", 5), ("nut", 4)], ["complete", "chapter"]),
)
def test_switches_on_demand_are_the_stored_ones(
    of: tuple[str, int], sets: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = graph_of(*of, sets=sets)
    monkeypatch.setattr(build, "STORE_LIMIT", -1)
    demanded = graph_of(*of, sets=sets)
    assert isinstance(stored.switches, StoredSwitches)
    assert isinstance(demanded.switches, SwitchesOnDemand)
    assert_same(stored, demanded, 0.0)
    assert stored.n_switches == demanded.n_switches
    assert stored.summary().kinds == demanded.summary().kinds
    for i in range(len(stored)):
        assert stored.neighbors(i) == demanded.neighbors(i)
        for one, other in zip(
            stored.switches.neighbors(i), demanded.switches.neighbors(i), strict=True
        ):
            assert one.tolist() == other.tolist()
    rng = np.random.default_rng(3)
    grasps = random_grasps(stored.polygon, stored.friction, rng, 4, 3)
    for start, goal in combinations(grasps, 2):
        if not (stored.locate(start) and stored.locate(goal)):
            continue
        assert outcome(demanded, start, goal) == outcome(stored, start, goal)


def outcome(graph: rl.SwitchingGraph, start: rl.Grasp, goal: rl.Grasp) -> int | str:
    """Placements of a plan, or why there is none."""
    try:
        plan = graph.plan(start, goal)
    except rl.NoPlanFound as error:
        return error.explanation
    assert plan.verify().ok
    return plan.placements


def test_counting_switches_on_demand_counts_pairs_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pair that can hold one contact and two comes twice from the rule."""
    monkeypatch.setattr(build, "STORE_LIMIT", 0)
    graph = graph_of("rectangle", 5)
    assert graph.n_switches == graph.to_networkx().number_of_edges()


# --- options ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "share", "sets"),
    [
        ("rectangle", 0.6, "complete"),
        ("rectangle", 0.6, "chapter"),
        ("ell", 0.45, "complete"),
        ("ell", 0.45, "chapter"),
        ("star 8", 0.2, "chapter"),
    ],
)
def test_min_margin_keeps_exactly_the_larger_ones(name: str, share: float, sets: str) -> None:
    graph = graph_of(name, sets=sets)
    least = share * float(graph.sets.margins.max())
    cut = graph_of(name, sets=sets, min_margin=least)
    kept = [i for i in range(len(graph)) if graph.sets[i].margin > least]
    assert 0 < len(kept) < len(graph)
    assert [(s.edges, s.kind, s.center, s.margin) for s in cut.sets] == [
        (s.edges, s.kind, s.center, s.margin) for s in (graph.sets[i] for i in kept)
    ]
    expected = {}
    for one, other in combinations(range(len(kept)), 2):
        switch = graph.switch(kept[one], kept[other])
        held = [h.held for h in switch.handovers if h.margin > least] if switch else []
        if held:
            expected[one, other] = max(held)
    assert pairs_of(cut) == expected
    for i, j in list(expected)[::7]:
        switch = cut.switch(i, j)
        assert switch is not None
        assert all(handover.margin > least for handover in switch.handovers)


def test_a_large_min_margin_leaves_nothing() -> None:
    graph = graph_of("square", min_margin=10.0)
    assert len(graph) == 0
    assert graph.components() == []
    assert graph.n_switches == 0
    assert graph.locate([(0, 0.5), (2, 0.5)]) == ()
    assert "components  0" in str(graph.summary())
    with pytest.raises(rl.NoPlanFound, match="with a margin above 10"):
        graph.plan([(0, 0.5), (2, 0.5)], [(1, 0.5), (3, 0.5)])


def test_no_sets_at_all() -> None:
    """A triangle at low friction cannot be held with two fingers, nor by the chapter's kinds."""
    triangle = rl.Polygon([(0, 0), (1, 0), (0, 1)])
    graph = rl.build_switching_graph(triangle, 2.0, sets="chapter")
    assert graph.n_switches == graph.to_networkx().number_of_edges()
    nothing = rl.build_switching_graph(triangle, 1e-9, min_margin=0.9)
    assert list(nothing.sets) == []
    assert nothing.to_networkx().number_of_nodes() == 0


def test_summary() -> None:
    polygon = rl.Polygon(rectangle().vertices, name="block")
    graph = rl.build_switching_graph(polygon, 0.4, sets="chapter")
    summary = graph.summary()
    text = str(summary)
    assert text.startswith("block: 4 edges\n")
    assert list(summary.kinds) == ["two_finger", "concurrent", "parallel"]
    for kind in (*summary.kinds, "all"):
        (line,) = [line for line in text.splitlines() if line.split()[:1] == [kind]]
        *_, sets, components = map(int, line.split()[1:])
        if kind == "all":
            assert (sets, components) == (len(graph), len(graph.components()))
        else:
            assert sets == sum(s.kind == kind for s in graph.sets)
            assert components == summary.kinds[kind].components
    assert f"switches    {graph.n_switches}\n" in text
    assert f"components  {len(graph.components())} (sizes " in text
    assert set(summary.seconds) == set(graph.seconds) == {"sets", "switches"}
    assert all(seconds >= 0 for seconds in summary.seconds.values())
    assert summary.n_sets == sum(counts.sets for counts in summary.kinds.values())
    for counts in summary.kinds.values():
        assert counts.candidates >= counts.sets >= counts.components
    unnamed = rl.build_switching_graph(rectangle(), 0.4).summary()
    assert str(unnamed).startswith("unnamed polygon: 4 edges")


def test_summary_of_many_components_is_cut() -> None:
    from regrasp_lp.summary import Summary

    text = str(Summary("x", 5, {}, 9, 0, [1] * 9, {"sets": 0.0}))
    assert "components  9 (sizes 1, 1, 1, 1, 1, 1, 1, 1, …)" in text


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"sets": "all"}, rl.OptionError, "sets must be .*complete.*chapter.*'all'"),
        ({"sets": None}, rl.OptionError, "sets must be"),
        ({"switching": "nearest"}, rl.OptionError, "switching must be .*contact.*'nearest'"),
        ({"solver": "glpk"}, rl.OptionError, "solver must be .*clarabel.*highs.*'glpk'"),
        ({"min_margin": -0.1}, rl.OptionError, "min_margin .*-0.1"),
        ({"min_margin": float("nan")}, rl.OptionError, "min_margin .*nan"),
        ({"min_margin": float("inf")}, rl.OptionError, "min_margin .*inf"),
        ({"friction": 0.0}, rl.FrictionError, "0"),
        ({"friction": -1.0}, rl.FrictionError, "-1"),
        ({"friction": float("nan")}, rl.FrictionError, "nan"),
        ({"friction": [0.5, 0.5, 0.5]}, rl.FrictionError, "3"),
        ({"friction": None}, rl.FrictionError, "None|number"),
        ({"friction": "rough"}, rl.FrictionError, "rough"),
    ],
)
def test_wrong_options(options: dict[str, object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        rl.build_switching_graph(unit_square(), **{"friction": 0.5, **options})


@pytest.mark.parametrize("fingers", [2, 0, -4, True, 2.5, "4", None])
def test_wrong_hands(fingers: object) -> None:
    with pytest.raises(rl.HandError, match=r"finger"):
        rl.Hand(fingers)


def test_hands() -> None:
    assert rl.Hand() == rl.Hand(4) == rl.Hand(np.int64(4))
    assert type(rl.Hand(np.int64(4)).fingers) is int
    held = [[rl.Hand(k).held(n, m) for n, m in ((2, 2), (2, 3), (3, 3))] for k in (3, 4, 5, 6)]
    assert held == [[1, 2, 3], [0, 1, 2], [0, 0, 1], [0, 0, 0]]


def test_progress_is_told() -> None:
    told: list[tuple[str, int, int]] = []
    rl.build_switching_graph(ell(), 0.5, progress=lambda *what: told.append(what))
    assert {what for what, _, _ in told} >= {"two_finger margins", "three_finger margins"}
    assert all(0 <= done <= total for _, done, total in told)
    assert "switches" in {what for what, _, _ in told}


def test_graphs_compare_by_content() -> None:
    graph = graph_of("square")
    assert graph == graph_of("square")
    assert graph != graph_of("square", 5)
    assert graph != graph_of("square", solver="highs")
    assert graph != graph_of("rectangle")
    assert graph != "square"
    with pytest.raises(TypeError, match="unhashable"):
        hash(graph)
    assert "10 complete sets" in repr(graph)


def test_handovers_hold_what_is_asked() -> None:
    graph = graph_of("square")
    solver = graph._solver
    pairs = [(i, j) for (i, j), held in pairs_of(graph).items() if held == 2]
    i, j = pairs[0]
    for held in (1, 2):
        found = handovers.handovers(graph.sets, solver, i, j, held)
        assert found
        assert all(h.held == held for h in found)
        assert [h.margin for h in found] == sorted((h.margin for h in found), reverse=True)
    assert handovers.handovers(graph.sets, solver, i, j, 0)[0].slots == ()


@pytest.mark.parametrize("angle", [0.05, 0.3])
def test_switches_within_rounding_are_described(angle: float) -> None:
    """A turned rectangle at μ = 1: whether adjacent sides can be squeezed is a matter of 1e-17."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    polygon = rl.Polygon(np.array([(0, 0), (3, 0), (3, 1), (0, 1)]) @ turn)
    graph = rl.build_switching_graph(polygon, 1.0)
    thin = [i for i in range(len(graph)) if abs(graph.sets[i].margin) < 1e-12]
    assert thin
    described = 0
    for i in thin:
        for j in graph.neighbors(i):
            switch = graph.switch(i, j)
            assert switch is not None
            assert switch.handovers
            assert abs(switch.margin) < 1e-7  # no better than the thin set
            described += 1
    assert described > 0
