"""Graph files: the same graph again, or a named fault."""

from __future__ import annotations

import io
import json
import os
from pathlib import Path

import numpy as np
import pytest
from geometry import ell, rectangle, star, unit_square
from regrasps import nut, plate

import regrasp_lp as rl
from regrasp_lp import build, files
from regrasp_lp.switches import StoredSwitches, SwitchesOnDemand

GRAPHS = {
    "block": lambda: rl.build_switching_graph(rectangle(), 0.4),
    "chapter, highs, 5 fingers": lambda: rl.build_switching_graph(
        star(9, 1), 0.2, rl.Hand(5), "chapter", solver="highs"
    ),
    "hole": lambda: rl.build_switching_graph(nut(), 0.2, sets="chapter"),
    "two holes": lambda: rl.build_switching_graph(plate(), 0.15),
    "friction per edge": lambda: rl.build_switching_graph(ell(), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]),
    "least margin": lambda: rl.build_switching_graph(ell(), 0.5, min_margin=0.2),
    "no presolve": lambda: rl.build_switching_graph(rectangle(), 0.3, presolve=False),
    "no sets": lambda: rl.build_switching_graph(unit_square(), 0.5, min_margin=9.0),
    "name": lambda: rl.build_switching_graph(rl.Polygon(ell().vertices, name='größe "1"\n'), 0.5),
}


def assert_equal(graph: rl.SwitchingGraph, other: rl.SwitchingGraph) -> None:
    assert graph == other
    assert graph.polygon == other.polygon
    assert graph.polygon.name == other.polygon.name
    assert graph.friction.tolist() == other.friction.tolist()
    assert graph.hand == other.hand
    assert graph.options == other.options
    assert graph.seconds == other.seconds
    assert str(graph.summary()) == str(other.summary())
    assert repr(list(graph.sets)) == repr(list(other.sets))
    for one, again in zip(graph.sets, other.sets, strict=True):
        assert one.witness == again.witness
    assert graph.to_networkx().edges == other.to_networkx().edges


@pytest.mark.parametrize("name", GRAPHS)
def test_round_trip(name: str, tmp_path: Path) -> None:
    graph = GRAPHS[name]()
    graph.save(tmp_path / "graph.npz")
    again = rl.load_graph(tmp_path / "graph.npz")
    assert isinstance(again.switches, StoredSwitches)
    assert_equal(graph, again)


def test_round_trip_on_demand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "STORE_LIMIT", 0)
    for number, graph in enumerate(
        (
            rl.build_switching_graph(rectangle(), 0.4),
            rl.build_switching_graph(ell(), 0.4, rl.Hand(3), "chapter"),
            rl.build_switching_graph(unit_square(), 0.4, min_margin=0.2),
        )
    ):
        path = tmp_path / f"graph {number}"
        graph.save(str(path))
        again = rl.load_graph(str(path))
        assert isinstance(again.switches, SwitchesOnDemand)
        assert_equal(graph, again)


def test_a_loaded_graph_plans(tmp_path: Path) -> None:
    graph = rl.build_switching_graph(nut(), 0.3)
    graph.save(tmp_path / "g")
    start, goal = graph.sets[3].witness, graph.sets[len(graph) - 2].witness
    plan = rl.load_graph(tmp_path / "g").plan(start, goal)
    assert plan.verify().ok
    assert plan.to_json() == graph.plan(start, goal).to_json()


# --- files that are no graphs -------------------------------------------------------------------


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "block.graph"
    rl.build_switching_graph(unit_square(), 0.4).save(path)
    return path


def assert_refused(path: Path, message: str = "") -> None:
    with pytest.raises(rl.FileFormatError) as error:
        rl.load_graph(path)
    assert str(path) in str(error.value)
    assert message in str(error.value)


def rewrite(path: Path, **changes: object) -> None:
    """Save the arrays of a graph again with some of them changed; None leaves one out."""
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for name, value in changes.items():
        name = name.replace("__", ".")
        if value is None:
            del arrays[name]
        elif isinstance(value, dict):
            header = {**json.loads(arrays["header"].tobytes()), **value}
            arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
        else:
            arrays[name] = value(arrays[name]) if callable(value) else value
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    path.write_bytes(buffer.getvalue())


def test_rewriting_alone_does_no_harm(saved: Path) -> None:
    graph = rl.load_graph(saved)
    rewrite(saved)
    assert_equal(graph, rl.load_graph(saved))


def test_truncated(saved: Path) -> None:
    content = saved.read_bytes()
    for size in (*range(0, len(content), 97), len(content) - 1):
        saved.write_bytes(content[:size])
        assert_refused(saved)


def test_flipped_bits(saved: Path) -> None:
    """A flipped bit is noticed, or is in a part of the archive that says nothing."""
    graph, content = rl.load_graph(saved), saved.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for place in rng.integers(0, len(content), 400).tolist():
        damaged = bytearray(content)
        damaged[place] ^= 1 << int(rng.integers(8))
        saved.write_bytes(damaged)
        again = load_or_none(saved)
        if again is None:
            refused += 1
        else:
            assert_equal(graph, again)
    assert refused > 200


@pytest.mark.slow
def test_every_flipped_bit(saved: Path) -> None:
    graph, content = rl.load_graph(saved), saved.read_bytes()
    for place in range(8 * len(content)):
        damaged = bytearray(content)
        damaged[place // 8] ^= 1 << (place % 8)
        saved.write_bytes(damaged)
        again = load_or_none(saved)
        assert again is None or graph == again


def load_or_none(path: Path) -> rl.SwitchingGraph | None:
    try:
        return rl.load_graph(path)
    except rl.FileFormatError:
        return None


def test_other_versions_and_formats(saved: Path) -> None:
    rewrite(saved, header={"version": 1})
    assert_refused(saved, "version 1")
    rewrite(saved, header={"version": 2, "format": "regrasp-plan"})
    assert_refused(saved, "not a graph file")


def test_other_files(tmp_path: Path) -> None:
    path = tmp_path / "other"
    assert_refused(path, "cannot be read")
    assert_refused(tmp_path, "cannot be read")
    for content in (b"", b"hello\n", b"\x00" * 100, b"PK\x03\x04", b"PK\x05\x06" + b"\x00" * 18):
        path.write_bytes(content)
        assert_refused(path)
    path.write_text('{"format": "regrasp-plan", "version": 1}')
    assert_refused(path)
    np.savez(path.with_suffix(".npz"), a=np.zeros(3))
    assert_refused(path.with_suffix(".npz"), "not a graph file")
    np.save(path.with_suffix(".npy"), np.zeros(3))
    assert_refused(path.with_suffix(".npy"))
    for header in (b"{", b"[]", b"7", b'"regrasp-graph"', b"\xff\xfe", b"{}"):
        np.savez(path.with_suffix(".npz"), header=np.frombuffer(header, dtype=np.uint8))
        assert_refused(path.with_suffix(".npz"))
    np.savez(path.with_suffix(".npz"), header=np.array([{"format": 1}], dtype=object))
    assert_refused(path.with_suffix(".npz"))


@pytest.mark.parametrize(
    "changes",
    [
        {"friction": None},
        {"friction": np.zeros(4)},
        {"friction": np.ones(3)},
        {"vertices": np.zeros((4, 2))},
        {"vertices": np.zeros((4, 3))},
        {"vertices": np.full((4, 2), np.nan)},
        {"ring_sizes": np.array([2, 2])},
        {"two_finger__edges": lambda a: a + 3},
        {"two_finger__edges": lambda a: -a - 1},
        {"two_finger__edges": lambda a: a[:, :1]},
        {"two_finger__edges": lambda a: a + 0.5},
        {"three_finger__margins": lambda a: a[:-1]},
        {"three_finger__witnesses": lambda a: a[:, :2]},
        {"three_finger__witnesses": lambda a: a + 2.0},
        {"three_finger__witnesses": lambda a: a * np.nan},
        {"three_finger__margins": None},
        {"switches__starts": lambda a: a[:-1]},
        {"switches__starts": lambda a: a[::-1]},
        {"switches__starts": lambda a: a + 1},
        {"switches__others": lambda a: a + 100},
        {"switches__others": lambda a: a[:-1]},
        {"switches__held": lambda a: a[:-1]},
        {"switches__held": lambda a: a + 3},
        {"switches__held": None},
        {"switches__starts": None, "switches__others": None, "switches__held": None},
        {"two_finger__more": np.zeros(3)},
        {"header": {"stored": False}},
        {"header": {"options": {}}},
        {"header": {"options": 3}},
        {"header": {"candidates": [1]}},
        {"header": {"candidates": ["a", "b"]}},
        {"header": {"hand": {"fingers": 2}}},
        {"header": {"hand": 4}},
        {"header": {"name": 3}},
        {"header": {"seconds": None}},
    ],
)
def test_damaged_content(saved: Path, changes: dict[str, object]) -> None:
    rewrite(saved, **changes)
    assert_refused(saved)


def test_other_options_are_refused(saved: Path) -> None:
    options = {
        "sets": "complete",
        "switching": "contact",
        "min_margin": 0.0,
        "solver": "clarabel",
        "presolve": True,
    }
    rewrite(saved, header={"options": options})
    rl.load_graph(saved)
    for name, value in (("sets", "all"), ("solver", "glpk")):
        rewrite(saved, header={"options": {**options, name: value}})
        assert_refused(saved)


def test_a_failed_write_leaves_the_old_file(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    graph, content = rl.load_graph(saved), saved.read_bytes()

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    monkeypatch.setattr(files.os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        rl.build_switching_graph(rectangle(), 0.4).save(saved)
    assert saved.read_bytes() == content
    assert [p.name for p in saved.parent.iterdir()] == [saved.name]
    assert_equal(graph, rl.load_graph(saved))


def test_saving_into_no_folder(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nowhere"):
        rl.build_switching_graph(unit_square(), 0.4).save(tmp_path / "nowhere" / "graph")
