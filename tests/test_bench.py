"""The benchmark: its peer is right, its clocks add up, and its command runs."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("shapely")

from bench import clocks, command, growth, queries, where
from bench.clocks import Memory, in_own_process
from bench.one_by_one import pairs_to_decide
from bench.peer import PeerGraph, interiors_meet, peer_graph
from bench.peer_parallel import extreme_points_by_qhull
from bench.ratio import Meeting, require_same_sets
from bench.report import Table, machine
from bench.settings import MU, THETA
from bench.subjects import models, random_grasps
from geometry import comb, ell, rectangle, regular, star
from reference import Key, ReferenceGraph, reference_graph

import regrasp_lp as rl
from regrasp_lp.planning.bottleneck import Search

SMALL = {
    "rectangle": rectangle(),
    "ell": ell(),
    "comb": comb(2),
    "hexagon": regular(6),
    "star 7": star(7, 1),
    "star 11": star(11, 2),
    "star_15": models()["star_15"],
    "concave_15": models()["concave_15"],
}


def keys_of(peer: PeerGraph) -> list[Key]:
    parallel = zip(peer.parallel.tolist(), peer.centers.tolist(), strict=True)
    return [
        *(("two_finger", tuple(e), -1) for e in peer.two_finger.tolist()),
        *(("concurrent", tuple(e), -1) for e in peer.concurrent.tolist()),
        *(("parallel", tuple(e), center) for e, center in parallel),
    ]


def named_pairs(peer: PeerGraph) -> set[frozenset[Key]]:
    """All adjacent pairs by name; two-finger pairs are all adjacent, and not listed by it."""
    keys, n = keys_of(peer), len(peer.two_finger)
    listed = {frozenset((keys[i], keys[j])) for i, j in peer.pairs.tolist()}
    assert len(listed) == len(peer.pairs), "no pair comes twice"
    return listed | {frozenset((keys[i], keys[j])) for i in range(n) for j in range(i)}


# --- the peer -----------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=SMALL)
def both(request: pytest.FixtureRequest) -> tuple[rl.Polygon, PeerGraph, ReferenceGraph]:
    polygon = SMALL[request.param]
    return polygon, peer_graph(polygon, THETA), reference_graph(polygon, MU)


def test_the_peer_has_the_sets_of_the_reference(
    both: tuple[rl.Polygon, PeerGraph, ReferenceGraph],
) -> None:
    _, peer, reference = both
    assert sorted(keys_of(peer)) == sorted(reference.vertices)


def test_the_peer_has_the_edges_of_the_reference_but_for_cells_that_touch(
    both: tuple[rl.Polygon, PeerGraph, ReferenceGraph],
) -> None:
    _, peer, reference = both
    mine, theirs = named_pairs(peer), reference.named()
    assert peer.n_edges == len(mine)
    assert theirs <= mine
    assert len(mine - theirs) <= 0.05 * len(mine) + 2


def test_with_interiors_the_peer_has_the_edges_of_the_reference(
    both: tuple[rl.Polygon, PeerGraph, ReferenceGraph],
) -> None:
    polygon, _, reference = both
    assert named_pairs(peer_graph(polygon, THETA, meets=interiors_meet)) == reference.named()


def test_sub_polytopes_by_qhull_are_the_same(
    both: tuple[rl.Polygon, PeerGraph, ReferenceGraph],
) -> None:
    polygon, peer, reference = both
    other = peer_graph(polygon, THETA, extreme_points_by_qhull)
    assert keys_of(other) == keys_of(peer)
    assert reference.named() <= named_pairs(other) <= named_pairs(peer)


def test_other_sets_are_noticed() -> None:
    polygon = SMALL["star 11"]
    graph = rl.build_switching_graph(polygon, MU, sets="chapter")
    peer = peer_graph(polygon, THETA)
    require_same_sets(graph, peer)
    for kind in ("two_finger", "concurrent"):
        one_less = dataclasses.replace(peer, **{kind: getattr(peer, kind)[1:]})
        with pytest.raises(ValueError, match=kind):
            require_same_sets(graph, one_less)


def test_pairs_to_decide_are_all_that_can_be_joined() -> None:
    graph = rl.build_switching_graph(SMALL["star_15"], MU, sets="chapter")
    asked = {frozenset(pair) for pair in pairs_to_decide(graph).tolist()}
    two_finger = set(range(len(graph.sets.families[0])))
    joined = {frozenset((i, j)) for i in range(len(graph)) for j in graph.neighbors(i)}
    assert {pair for pair in joined if not pair <= two_finger} <= asked
    edges = [frozenset(grasp_set.edges) for grasp_set in graph.sets]
    for i, j in map(sorted, asked):
        held = len(edges[i]) + len(edges[j]) - 4
        assert len(edges[i] & edges[j]) >= held


# --- clocks and tables --------------------------------------------------------------------------


def build_small() -> rl.SwitchingGraph:
    return rl.build_switching_graph(SMALL["star_15"], MU, sets="chapter")


def test_parts_of_the_time_add_up() -> None:
    build_small()
    seconds, total = where.parts_of(build_small)
    assert tuple(seconds) == where.PARTS
    assert min(seconds.values()) >= 0
    assert min(seconds[part] for part in ("candidates", "functions", "presolve", "graph")) > 0
    assert sum(seconds.values()) == pytest.approx(total, rel=1e-2, abs=1e-4)


def test_timing_changes_nothing_for_good() -> None:
    before = [vars(owner)[name] for owner, name in map(place, where.ENTRIES)]
    aliases = rl.build_switching_graph, sys.modules["regrasp_lp.build"].build_family
    plain = build_small()
    clock = where.Clock("graph")
    with where.timed_entries(clock, where.ENTRIES):
        assert build_small() == plain
        assert [vars(owner)[name] for owner, name in map(place, where.ENTRIES)] != before
    assert [vars(owner)[name] for owner, name in map(place, where.ENTRIES)] == before
    assert (rl.build_switching_graph, sys.modules["regrasp_lp.build"].build_family) == aliases


def place(entry: str) -> tuple[object, str]:
    module, _, path = entry.partition(":")
    return where._found(module, path)


def test_all_entries_are_parts() -> None:
    assert set(where.ENTRIES.values()) | {"graph"} == set(where.PARTS)


@pytest.mark.parametrize("entry", ["torque:no_such_function", "no_such_module:f", "torque:A.b"])
def test_an_entry_that_is_gone_is_said(entry: str) -> None:
    entries = {"build:build_switching_graph": "sets", entry: "sets"}
    before = rl.build_switching_graph
    with pytest.raises(LookupError, match=r"where\.py"):
        where.parts_of(build_small, entries, ("sets", "rest"))
    assert rl.build_switching_graph is before


def test_time_is_charged_to_the_innermost_entry(monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = iter(range(100))
    monkeypatch.setattr(where, "now", lambda: float(next(ticks)))
    clock = where.Clock("rest")
    inner = clock.timed(lambda: None, "inner")
    clock.timed(lambda: (inner(), inner()), "outer")()
    # a tick between any two changes: rest, outer, inner, outer, inner, outer
    assert clock.seconds == {"rest": 1, "outer": 3, "inner": 2}


def test_calls_take_turns() -> None:
    calls: list[str] = []
    times = clocks.alternating((lambda: calls.append("a"), lambda: calls.append("b")), 3)
    assert calls == ["a", "b"] * 4
    assert [len(column) for column in times] == [3, 3]


def test_peak_memory_is_that_of_what_is_alive_at_once() -> None:
    memory = Memory()
    for _ in range(3):
        array = np.ones(2**23)  # 64 MiB
        del array
    assert 60 <= memory.peak() <= 80


def test_failing_jobs_say_why() -> None:
    with pytest.raises(RuntimeError, match="PolygonError"):
        in_own_process("growth", vertices=[[0, 0], [1, 1]], sets="chapter", repeats=1)


def test_exponent_of_a_power() -> None:
    sizes = [15, 40, 100]
    assert growth.exponent(sizes, [0.5 * n**3 for n in sizes]) == pytest.approx(3)


def test_ratios_are_round_by_round() -> None:
    meeting = Meeting("a", 4, "chapter", (1, 2), (1, 2), [1.0, 4.0], [2.0, 2.0], [], [], [])
    assert meeting.ratios == [0.5, 2.0]
    assert meeting.target < dataclasses.replace(meeting, sets="complete").target


def test_columns_stand_below_each_other() -> None:
    table = Table("Title", ["name", "ms"], [["a", "1"], ["long name", "100"]], ["A note."])
    assert table.text() == "Title\n\nname        ms\na            1\nlong name  100\n  A note.\n"
    lines = table.markdown().splitlines()
    assert lines[2:6] == ["| name | ms |", "| :--- | ---: |", "| a | 1 |", "| long name | 100 |"]


def test_the_machine_is_not_named() -> None:
    import platform

    said = " ".join(machine().values())
    assert platform.node() not in said
    assert str(Path.home()) not in said


def test_random_grasps_are_held() -> None:
    polygon = SMALL["star_15"]
    grasps = random_grasps(polygon, MU, 6, np.random.default_rng(0))
    assert sorted(len(grasp) for grasp in grasps) == [2, 2, 2, 3, 3, 3]
    assert all(rl.is_force_closure(polygon, grasp, MU) for grasp in grasps)


# --- queries ------------------------------------------------------------------------------------


def test_queries_on_a_graph() -> None:
    polygon = SMALL["star_15"]
    graph = rl.build_switching_graph(polygon, MU)
    pairs = queries.pairs_of(polygon, MU, 4)
    assert pairs == queries.pairs_of(polygon, MU, 4), "the same in every run"
    found = queries.on_graph(graph, pairs, "margin")
    assert len(found) == len(pairs) == 4
    for query, (start, goal) in zip(found, pairs, strict=True):
        plan = graph.plan(start, goal, objective="margin")
        assert (query.value, query.bound, query.gap) == (plan.value, plan.bound, plan.gap)
        assert query.fewest == graph.plan(start, goal).chosen_margin <= query.value
        assert (query.levels == 0) == np.isinf(query.value), "without a choice nothing is searched"
        assert query.seconds > 0
    assert any(query.levels for query in found)


def test_searches_are_counted_inside_only() -> None:
    plain = Search.run
    with queries.counted_levels() as levels:
        assert Search.run is not plain
    assert Search.run is plain
    assert levels == []


def test_queries_without_an_answer() -> None:
    def refused() -> rl.Plan:
        raise rl.NoPlanFound("none")

    assert queries.ask(refused, 4, "margin") is None


def test_what_is_said_of_queries() -> None:
    best = queries.Query(4, 0.1, 2.0, 2.0, 0.0, 3, 2.0)
    open_ = dataclasses.replace(best, seconds=0.3, value=1.5, gap=0.5, levels=5)
    direct = dataclasses.replace(best, seconds=0.2, value=np.inf, bound=np.inf, levels=0)
    assert [query.worse for query in (best, open_, direct)] == [False, True, False]
    assert [query.short for query in (best, open_, direct)] == [0, 0.25, 0]
    assert dataclasses.replace(open_, gap=np.inf, bound=np.inf).short == 1
    cells = queries._cells([best, open_, direct])
    assert cells == ["3", "1", "200", "280", "300", "66.7 %", "25 %", "8, 5"]
    assert len(cells) == len(queries._HEADINGS)


# --- the command --------------------------------------------------------------------------------


def test_a_part_runs_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["where", "--quick", "--repeats", "1", "--cpu", "--output", str(tmp_path)]
    assert command.main(arguments) == 0
    written = (tmp_path / "benchmarks.md").read_text(encoding="utf-8")
    titles = [line[4:] for line in written.splitlines() if line.startswith("### ")]
    printed = capsys.readouterr().out
    assert titles
    assert all(title in printed for title in titles)


@pytest.mark.slow
def test_every_part_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    arguments = ["--quick", "--repeats", "1", "--cpu", "--output", str(tmp_path)]
    assert command.main(arguments) == 0
    printed = capsys.readouterr().out
    written = (tmp_path / "benchmarks.md").read_text(encoding="utf-8")
    titles = [line[4:] for line in written.splitlines() if line.startswith("### ")]
    assert len(titles) == 12
    assert all(title in printed for title in titles)
    pictures = sorted((tmp_path / "images").glob("*.png"))
    assert [picture.name for picture in pictures] == ["benchmark_growth.png", "benchmark_ratio.png"]
    assert all(f"images/{picture.name}" in written for picture in pictures)
    assert clocks._chosen == "wall"


def test_unknown_parts_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        command.main(["speed"])
    assert stopped.value.code == 2
    assert "there is no part 'speed': choose from ratio" in capsys.readouterr().err
