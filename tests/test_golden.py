"""Counts of sets, switches and components, as confirmed by `golden` and written in golden.json."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry import lattice_star, rectangle, star
from golden import (
    GOLDEN,
    MODELS,
    MODES,
    MOST_EDGES,
    MU,
    Counts,
    Sampler,
    counts_of,
    counts_of_reference,
    differences,
    key_of,
    library_graph,
    polygons_of,
    read_golden,
)
from reference import ReferenceGraph, reference_graph

import regrasp_lp as rl

MODEL_POLYGONS = {p.name: p for p in polygons_of(MODELS)}
FEW = ("star_15", "l_bracket", "hex_nut", "wedge")
"""Models that the normal suite confirms again; the rest is slow."""


@pytest.fixture(scope="module")
def golden() -> dict[str, dict[str, Counts]]:
    return read_golden()


def entry_of(golden: dict[str, dict[str, Counts]], polygon: rl.Polygon) -> dict[str, Counts]:
    key = key_of(polygon)
    assert key in golden, f"{key} has no golden numbers: run python tests/golden.py --missing"
    return golden[key]


def assert_library(polygon: rl.Polygon, golden: dict[str, dict[str, Counts]]) -> None:
    for mode in MODES:
        assert counts_of(library_graph(polygon, mode)) == entry_of(golden, polygon)[mode], mode


def assert_reference(polygon: rl.Polygon, golden: dict[str, dict[str, Counts]]) -> None:
    for mode in MODES[:2]:
        reference = reference_graph(polygon, MU, mode.split("/")[1])
        assert counts_of_reference(reference) == entry_of(golden, polygon)[mode], mode


# --- the file -----------------------------------------------------------------------------------


def test_the_file_says_what_it_should(golden: dict[str, dict[str, Counts]]) -> None:
    assert json.loads(GOLDEN.read_text())["theta_degrees"] == 10
    for key, entry in golden.items():
        assert tuple(entry) == MODES
        focus, contact, complete = entry.values()
        kinds = ("two_finger", "concurrent", "parallel")
        assert [focus[k] for k in kinds] == [contact[k] for k in kinds], key
        assert focus["switches"] <= contact["switches"], key
        assert focus["components"] >= contact["components"], key
        assert complete["two_finger"] == contact["two_finger"], key
        assert complete["three_finger"] >= contact["concurrent"], key


def test_every_model_has_an_entry(golden: dict[str, dict[str, Counts]]) -> None:
    for polygon in MODEL_POLYGONS.values():
        entry_of(golden, polygon)


def test_keys_tell_coordinates_and_names_apart() -> None:
    square = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]
    hole = [(1.0, 1.0), (1.0, 2.0), (2.0, 2.0)]
    polygons = [
        rl.Polygon(square, name="a"),
        rl.Polygon(square, name="b"),
        rl.Polygon(square, holes=[hole], name="a"),
        rl.Polygon([*square[:3], (0.0, np.nextafter(4.0, 5))], name="a"),
    ]
    assert len({key_of(p) for p in polygons}) == 4
    assert key_of(polygons[0]) == key_of(rl.Polygon([*square, square[0]], name="a"))


# --- a few, always ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*FEW, "u_channel", "star_25", "star_40"])
def test_library(name: str, golden: dict[str, dict[str, Counts]]) -> None:
    assert_library(MODEL_POLYGONS[name], golden)


@pytest.mark.parametrize("name", FEW)
def test_reference(name: str, golden: dict[str, dict[str, Counts]]) -> None:
    assert_reference(MODEL_POLYGONS[name], golden)


@pytest.mark.parametrize("name", FEW)
@pytest.mark.parametrize("mode", MODES[1:])
def test_sampling(name: str, mode: str) -> None:
    sampler = Sampler(library_graph(MODEL_POLYGONS[name], mode), grasps=20_000, seed=1)
    assert sampler.refutations() == []


# --- sampling and comparing find what is wrong --------------------------------------------------


@pytest.mark.parametrize("mode", MODES[1:])
def test_a_missing_switch_is_found(mode: str) -> None:
    graph = library_graph(star(9, 1), mode)
    sampler = Sampler(graph, grasps=100_000)
    sampler.adjacent = {i: set() for i in range(len(graph))}  # as if the graph had none
    found = {tuple(sorted(pair)) for pair in _pairs(graph)}
    three = {i for i, s in enumerate(graph.sets) if len(s.edges) == 3 and s.kind != "parallel"}
    to_find = {pair for pair in found if three & set(pair) and not _parallel(graph, pair)}
    refutations = sampler.refutations()
    assert any("not in the graph" in one for one in refutations)
    assert sampler.confirmed <= to_find
    assert len(sampler.confirmed) > 0.5 * len(to_find)


def _pairs(graph: rl.SwitchingGraph) -> set[tuple[int, int]]:
    return {(i, j) for i in range(len(graph)) for j in graph.neighbors(i) if i < j}


def _parallel(graph: rl.SwitchingGraph, pair: tuple[int, int]) -> bool:
    return any(graph.sets[i].kind == "parallel" for i in pair)


def test_a_missing_set_is_found() -> None:
    graph = library_graph(star(9, 1), "complete/contact")
    sampler = Sampler(graph, grasps=100_000)
    gone = graph.sets[len(graph) - 1].edges
    del sampler.index[tuple(gone)]
    assert any("in no set" in one and str(list(gone)) in one for one in sampler.missing_sets())


def test_wrong_switches_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = library_graph(rectangle(), "complete/contact")
    sampler = Sampler(graph, grasps=1000)
    assert list(sampler.wrong_switches()) == []
    monkeypatch.setattr(type(graph), "switch", lambda self, i, j: None)
    assert any("no switch" in one for one in sampler.wrong_switches())


def test_differences_are_told() -> None:
    polygon = lattice_star(9, 4)
    graph = library_graph(polygon, "chapter/focus")
    reference = reference_graph(polygon, MU)
    assert differences(graph, reference) == []
    without_one = ReferenceGraph(reference.vertices, reference.pairs[:-1])
    assert any(one.startswith("switch") for one in differences(graph, without_one))
    assert any(one.startswith("counts") for one in differences(graph, without_one))


# --- all of them --------------------------------------------------------------------------------


@pytest.mark.slow
def test_library_on_all_models(golden: dict[str, dict[str, Counts]]) -> None:
    for polygon in MODEL_POLYGONS.values():
        assert_library(polygon, golden)
        assert_reference(polygon, golden)


@pytest.mark.slow
def test_library_on_the_corpus(
    corpus: list[rl.Polygon], golden: dict[str, dict[str, Counts]]
) -> None:
    for polygon in corpus:
        if polygon.n_edges <= MOST_EDGES:
            assert_library(polygon, golden)


@pytest.mark.slow
def test_reference_on_the_corpus(
    corpus: list[rl.Polygon], golden: dict[str, dict[str, Counts]]
) -> None:
    for polygon in corpus:
        if polygon.n_edges <= MOST_EDGES:
            assert_reference(polygon, golden)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES[1:])
def test_sampling_on_the_corpus(corpus: list[rl.Polygon], mode: str) -> None:
    for polygon in corpus:
        if polygon.n_edges <= MOST_EDGES:
            sampler = Sampler(library_graph(polygon, mode), grasps=100_000, seed=2)
            assert sampler.refutations() == [], polygon.name


def test_every_corpus_polygon_has_an_entry(
    corpus_folder: Path, golden: dict[str, dict[str, Any]]
) -> None:
    for polygon in polygons_of(corpus_folder):
        entry_of(golden, polygon)
