"""The polygons of models/: as the script writes them, and what they claim to be."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY
from scipy.optimize import linprog

from regrasp_lp import Polygon, read_polygons

MODELS = REPOSITORY / "models"
FILES = sorted(MODELS.glob("*.geojson"))
POLYGONS = [polygon for file in FILES for polygon in read_polygons(file)]
BY_NAME = {polygon.name: polygon for polygon in POLYGONS}
RANDOM = {name: p for name, p in BY_NAME.items() if re.fullmatch(r"(star|concave)_\d+", name)}
GEARS = {name: p for name, p in BY_NAME.items() if name.startswith("gear_")}


def kernel_radius(polygon: Polygon) -> float:
    """Radius of the largest disc that is on the inner side of all edges; negative if none is."""
    offsets = np.einsum("ij,ij->i", polygon.normals, polygon.edge_starts)
    rows = np.column_stack([-polygon.normals, np.ones(polygon.n_edges)])
    result = linprog([0, 0, -1], A_ub=rows, b_ub=-offsets, bounds=(None, None))
    assert result.success
    return -result.fun


def test_files_are_what_the_script_writes(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    command = [sys.executable, str(MODELS / "generate.py"), str(tmp_path)]
    subprocess.run(command, check=True, cwd=tmp_path)
    written = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    assert written == {file.name: file.read_bytes() for file in FILES}


def test_there_are_many_under_unique_names() -> None:
    assert len(POLYGONS) >= 60
    names = [
        feature["properties"]["name"]
        for file in FILES
        for feature in json.loads(file.read_text(encoding="utf-8"))["features"]
    ]
    assert len(set(names)) == len(names)
    assert set(names) == set(BY_NAME)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_features_say_what_they_are(file: Path) -> None:
    for feature in json.loads(file.read_text(encoding="utf-8"))["features"]:
        assert set(feature["properties"]) == {"name", "units", "note"}
        assert feature["properties"]["units"] in ("mm", "arbitrary")
        assert feature["properties"]["note"]


def test_the_readme_counts_them() -> None:
    text = (MODELS / "README.md").read_text(encoding="utf-8")
    assert f"{len(POLYGONS)} outlines" in text
    rows = re.findall(r"^\| `(\S+)` \| (\d+) \|.* (\d+) to (\d+) \|$", text, flags=re.MULTILINE)
    counted = []
    for file in FILES:
        edges = [polygon.n_edges for polygon in read_polygons(file)]
        counted.append((file.name, *map(str, (len(edges), min(edges), max(edges)))))
    assert sorted(rows) == counted


@pytest.mark.parametrize("polygon", POLYGONS, ids=lambda polygon: polygon.name)
def test_rings_are_clean(polygon: Polygon) -> None:
    # outline counter-clockwise, holes clockwise: nothing had to be turned round
    assert polygon.input_edge.tolist() == list(range(polygon.n_edges))
    assert polygon.edge_lengths.min() > 3e-3 * np.hypot(*np.ptp(polygon.vertices, axis=0))
    before, after = polygon.tangents, polygon.tangents[polygon.next_edge]
    turns = np.arctan2(
        before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1)
    )
    assert np.degrees(np.abs(turns).min()) > 1


def test_random_polygons_come_in_all_sizes() -> None:
    sizes = (15, 20, 25, 30, 35, 40, 100)
    assert set(RANDOM) == {f"{kind}_{n}" for kind in ("star", "concave") for n in sizes}


@pytest.mark.parametrize("name", RANDOM)
def test_random_polygons_are_what_their_names_say(name: str) -> None:
    kind, edges = name.split("_")
    assert RANDOM[name].n_edges == int(edges)
    radius = kernel_radius(RANDOM[name])
    assert radius > 0.01 if kind == "star" else radius < -0.01


@pytest.mark.parametrize("name", GEARS)
def test_gears_are_involute(name: str) -> None:
    module, teeth = map(int, re.fullmatch(r"gear_m(\d+)_z(\d+)", name).groups())
    pitch_radius = module * teeth / 2
    x, y = GEARS[name].exterior.T
    radii = np.hypot(x, y)
    assert radii.max() == pytest.approx(pitch_radius + module, abs=1e-5)
    assert radii.min() == pytest.approx(pitch_radius - 1.25 * module, abs=1e-5)
    tips = radii > radii.max() - 1e-5
    assert np.count_nonzero(tips) == 2 * teeth

    # half the angle of a tooth on each circle from the base circle outward
    base_radius = pitch_radius * np.cos(np.radians(20))
    flanks = radii > base_radius - 1e-5
    angle = np.arccos(np.minimum(base_radius / radii[flanks], 1))
    involute = np.tan(np.radians(20)) - np.radians(20) - (np.tan(angle) - angle)
    spacing = 2 * np.pi / teeth
    off_centre = np.arctan2(y, x)[flanks] / spacing
    off_centre = np.abs(off_centre - np.round(off_centre)) * spacing
    assert off_centre == pytest.approx(spacing / 4 + involute, abs=1e-5)


def test_workpieces_have_their_dimensions() -> None:
    def size(name: str) -> list[float]:
        return np.ptp(BY_NAME[name].exterior, axis=0).round(3).tolist()

    assert size("door_key")[0] == 88
    assert size("cylinder_key")[0] == 53
    assert size("feather_key") == [40, 8]
    assert size("allen_key_6") == [96, 38]
    assert size("i_beam") == [46, 80]
    assert size("slotted_profile") == [20, 20]
    assert size("hex_nut_m8")[1] == 13
    assert [size(f"wrench_{n}")[0] for n in (10, 13, 19)] == [105, 130, 170]
