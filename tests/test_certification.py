"""Certificates: what a graph says is proved again, what it says wrongly is found."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY, covering
from geometry import comb, lattice_star, rectangle, regular, staircase, star, unit_square

import regrasp_lp as rl
from regrasp_lp.certificates import save_certificates
from regrasp_lp.check_certificates import Rejected, check
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.grasp_sets.vertices import Family
from regrasp_lp.shadows import places_of
from regrasp_lp.switches import StoredSwitches

CASES = {
    "square": (unit_square(), 1.0),
    "rectangle": (rectangle(), 1.0),
    "comb, touching": (comb(2), 0.5),
    "staircase, touching": (staircase(1, 4), 0.5),
    "hexagon": (regular(6), 1.0),
    "12-gon": (regular(12), 0.25),
    "lattice star": (lattice_star(8, 3), 1.0),
    "star": (star(9, 3), 0.3),
    "rough star": (star(7, 0), 2.0),
    "friction per edge": (star(8, 2), (0.125, 2.0, 0.25, 0.5, 1.0, 0.125, 0.5, 0.75)),
}


@cache
def graph_of(case: str, sets: str = "complete", fingers: int = 4) -> rl.SwitchingGraph:
    polygon, friction = CASES[case]
    return rl.build_switching_graph(polygon, friction, rl.Hand(fingers), sets)


@pytest.mark.parametrize(
    ("case", "of"),
    covering(CASES, [("complete", 4), ("chapter", 4), ("complete", 5), ("chapter", 3)]),
)
def test_every_graph_is_certified_and_its_file_accepted(
    case: str, of: tuple[str, int], tmp_path: Path
) -> None:
    graph = graph_of(case, *of)
    report = rl.certify(graph)
    assert report.ok, str(report)
    assert sum(tally.yes for tally in report.sets.values()) == len(graph)
    candidates = {kind: counts.candidates for kind, counts in graph.summary().kinds.items()}
    assert {kind: tally.decided for kind, tally in report.sets.items()} == candidates
    graph.save_certificates(tmp_path / "proof")
    checked = check(tmp_path / "proof")
    assert sum(sets for sets, _ in checked.kinds.values()) == len(graph)
    assert checked.yes == sum(tally.yes for tally in report.switches.values())
    assert checked.no == sum(tally.decided - tally.yes for tally in report.switches.values())
    listed = {(p.first[n], p.second[n]) for p in graph.switches.pairs() for n in range(len(p))}
    assert checked.switches == len(listed)


def turned(polygon: rl.Polygon, angle: float) -> rl.Polygon:
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return rl.Polygon(polygon.vertices @ turn)


@pytest.mark.parametrize(
    ("angle", "sets"), covering([0.05, 0.31, 0.45, 0.84, 0.97, 1.5], ["complete", "chapter"])
)
def test_sets_too_thin_for_doubles_are_proved(angle: float, sets: str, tmp_path: Path) -> None:
    """Edges at 45° under μ = 1, but for rounding: some sets have no grasp in doubles."""
    graph = rl.build_switching_graph(turned(rectangle(), angle), 1.0, sets=sets)
    report = rl.certify(graph)
    assert report.ok, str(report)
    graph.save_certificates(tmp_path / "proof")
    assert '"/' not in (text := (tmp_path / "proof").read_text())
    assert check(tmp_path / "proof").switches > 0
    assert ("/" in text) == (report.witnesses.yes < report.witnesses.decided)


def test_critical_shapes_need_exact_arithmetic() -> None:
    """Else these tests would pass without it."""
    report = rl.certify(graph_of("lattice star"))
    assert sum(tally.exactly for tally in report.switches.values()) > 0
    assert sum(tally.exactly for tally in report.sets.values()) > 0


def with_sets(graph: rl.SwitchingGraph, keep: np.ndarray) -> rl.SwitchingGraph:
    """The graph with some of its three-finger sets, and the switches that the rule gives these."""
    pairs, triples = graph.sets.families
    fewer = Family(
        triples.kind,
        triples.functions.take(keep),
        triples.centers[keep],
        triples.margins[keep],
        triples.witnesses[keep],
        triples.n_candidates,
    )
    sets = GraspSets(graph.polygon, (pairs, fewer))
    from regrasp_lp.build import switch_rule
    from regrasp_lp.lp import get_solver

    rule = switch_rule(sets, graph.hand, get_solver("clarabel"))
    return replace(graph, sets=sets, switches=StoredSwitches.of_pairs(len(sets), rule.pairs()))


def test_a_missing_set_is_found(tmp_path: Path) -> None:
    graph = graph_of("star")
    triples = graph.sets.families[1]
    fewer = with_sets(graph, np.arange(1, len(triples)))
    report = rl.certify(fewer)
    edges = triples.functions.edges[0].tolist()
    assert report.faults == (f"the three_finger set on edges {edges} is missing",)
    with pytest.raises(rl.SolverError, match="nothing is written"):
        save_certificates(fewer, tmp_path / "proof")
    assert not (tmp_path / "proof").exists()


def test_a_set_that_is_listed_twice_or_does_not_exist_is_found() -> None:
    graph = graph_of("star")
    twice = with_sets(graph, np.arange(len(graph.sets.families[1])).repeat(2)[:-1])
    assert any("listed twice" in fault for fault in rl.certify(twice).faults)
    slippery = rl.build_switching_graph(graph.polygon, 0.05)
    rough = replace(
        graph, sets=GraspSets(graph.polygon, (graph.sets.families[0], slippery.sets.families[1]))
    )
    assert not rl.certify(rough).ok


def without_pair(graph: rl.SwitchingGraph, number: int) -> rl.SwitchingGraph:
    (pairs,) = graph.switches.pairs()
    kept = pairs.take(np.delete(np.arange(len(pairs)), number))
    return replace(graph, switches=StoredSwitches.of_pairs(len(graph), kept))


def test_a_missing_switch_is_found() -> None:
    graph = graph_of("star")
    (pairs,) = graph.switches.pairs()
    for number in (0, len(pairs) // 2, len(pairs) - 1):
        i, j, held = pairs.first[number], pairs.second[number], pairs.held[number]
        faults = rl.certify(without_pair(graph, number)).faults
        assert faults == (f"sets {i} and {j} can hold {held} contacts: the switch is missing",)


def test_a_switch_that_does_not_exist_is_found() -> None:
    graph = graph_of("star")
    (pairs,) = graph.switches.pairs()
    listed = set(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True))
    wrong = next(
        n
        for n in range(len(pairs))
        if (pairs.first[n], pairs.second[n] + 1) not in listed and pairs.second[n] + 1 < len(graph)
    )
    second = pairs.second.copy()
    second[wrong] += 1
    stored = StoredSwitches.of_pairs(len(graph), replace(pairs, second=second).largest())
    report = rl.certify(replace(graph, switches=stored))
    assert any("there is no switch" in fault for fault in report.faults)
    assert any("the switch is missing" in fault for fault in report.faults)


def test_a_wrong_number_of_held_contacts_and_a_witness_outside_are_found() -> None:
    graph = graph_of("star")
    assert isinstance(graph.switches, StoredSwitches)
    points = graph.switches.points.copy()
    points[3] = np.where(np.isnan(points[3]), np.nan, 1.0 - np.round(points[3]))
    report = rl.certify(replace(graph, switches=replace(graph.switches, points=points)))
    assert any("witness of the switch" in fault for fault in report.faults)
    family = graph.sets.families[1]
    outside = np.where(np.arange(len(family))[:, None] == 2, 0.0, family.witnesses)
    sets = GraspSets(graph.polygon, (graph.sets.families[0], replace(family, witnesses=outside)))
    faults = rl.certify(replace(graph, sets=sets)).faults
    edges = family.functions.edges[2].tolist()
    assert faults == (f"the witness of the three_finger set on edges {edges} is outside",)


def test_a_wrong_margin_is_found() -> None:
    graph = graph_of("star")
    pairs, triples = graph.sets.families
    margins = triples.margins.copy()
    margins[4] *= 1 + 1e-8
    sets = GraspSets(graph.polygon, (pairs, replace(triples, margins=margins)))
    faults = rl.certify(replace(graph, sets=sets)).faults
    assert len(faults) == 1
    assert f"edges {triples.functions.edges[4].tolist()} is {triples.margins[4]:.9g}" in faults[0]


def test_what_is_no_graph_is_refused() -> None:
    with pytest.raises(rl.OptionError, match="takes a SwitchingGraph, not a Polygon"):
        rl.certify(unit_square())


def test_other_rules_and_margins_have_no_certificates(tmp_path: Path) -> None:
    polygon, friction = CASES["star"]
    focus = rl.build_switching_graph(polygon, friction, sets="chapter", switching="focus")
    margin = rl.build_switching_graph(polygon, friction, min_margin=0.01)
    for graph, match in ((focus, 'switching="contact"'), (margin, "min_margin=0")):
        with pytest.raises(rl.OptionError, match=match):
            rl.certify(graph)
        with pytest.raises(rl.OptionError, match=match):
            graph.save_certificates(tmp_path / "proof")


@pytest.mark.parametrize("sets", ["complete", "chapter"])
def test_graphs_decided_by_programs_are_certified_too(sets: str) -> None:
    polygon, friction = CASES["star"]
    graph = rl.build_switching_graph(polygon, friction, sets=sets, presolve=False, solver="highs")
    assert rl.certify(graph).ok


@pytest.mark.parametrize("case", ["star", "comb, touching"])
def test_switches_found_on_demand_are_proved_alike(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    polygon, friction = CASES[case]
    graph_of(case).save_certificates(tmp_path / "stored")
    monkeypatch.setattr("regrasp_lp.build.STORE_LIMIT", 0)
    graph = rl.build_switching_graph(polygon, friction)
    assert not isinstance(graph.switches, StoredSwitches)
    assert rl.certify(graph).ok
    graph.save_certificates(tmp_path / "demanded")
    assert (tmp_path / "stored").read_bytes() == (tmp_path / "demanded").read_bytes()


def test_corrupted_files_are_rejected(tmp_path: Path) -> None:
    graph = graph_of("star")
    path = tmp_path / "proof"
    graph.save_certificates(path)
    content = path.read_bytes()
    rng = np.random.default_rng(0)
    for place in rng.integers(0, len(content), 60).tolist():
        path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        with pytest.raises(Rejected):
            check(path)
    for lines in (3, 100):
        path.write_bytes(b"".join(content.splitlines(keepends=True)[:-lines]))
        with pytest.raises(Rejected):
            check(path)


def test_the_checker_runs_alone(tmp_path: Path) -> None:
    path = tmp_path / "square.proof"
    graph_of("square").save_certificates(path)
    script = REPOSITORY / "regrasp_lp" / "check_certificates.py"
    done = subprocess.run(
        [sys.executable, "-I", script, path], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "accepted" in done.stdout
    header = json.loads(path.read_text().splitlines()[0])
    assert header["format"] == "regrasp-certificates"


@pytest.mark.slow
@pytest.mark.parametrize("sets", ["chapter", "complete"])
@pytest.mark.parametrize("friction", [0.1, float(np.tan(np.radians(10))), 0.5, 1.0])
def test_all_models_are_proved(sets: str, friction: float, tmp_path: Path) -> None:
    for file in sorted((REPOSITORY / "models").glob("*.geojson")):
        for polygon in rl.read_polygons(file):
            if polygon.n_edges <= 20:
                graph = rl.build_switching_graph(polygon, friction, sets=sets)
                graph.save_certificates(tmp_path / "proof")
                assert check(tmp_path / "proof").switches >= 0


def test_held_contacts_are_the_first_ones_on_their_edges() -> None:
    held = np.array([[1, -1, -1], [1, 1, -1], [1, 2, -1], [2, -1, -1]])
    edges = np.array([[1, 1, 2]] * 4)
    np.testing.assert_array_equal(
        places_of(held, edges), [[0, -1, -1], [0, 1, -1], [0, 2, -1], [2, -1, -1]]
    )
