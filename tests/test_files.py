from __future__ import annotations

import json
import os
import stat
from pathlib import Path
from typing import Any

import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from regrasp_lp.errors import FileFormatError
from regrasp_lp.files import read_polygons, write_atomically
from regrasp_lp.polygon import Polygon
from regrasp_lp.wkt import parse_wkt

RING = [[0, 0], [4, 0], [4, 3], [0, 0]]
BIG = [[0, 0], [9, 0], [9, 9], [0, 9], [0, 0]]
HOLE = [[2, 1], [3, 2], [3, 1], [2, 1]]
BOW = [[0, 0], [2, 2], [2, 0], [0, 2], [0, 0]]
TRIANGLE = {"type": "Polygon", "coordinates": [RING]}
PAIR = {"type": "MultiPolygon", "coordinates": [[RING], [BIG, HOLE]]}


def feature(geometry: Any, properties: Any = None, **more: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": geometry, **more}


def collection(*features: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features)}


@pytest.fixture
def part(tmp_path: Path) -> Path:
    return tmp_path / "part.dat"  # an ending that says nothing: the content has to


def read(part: Path, content: Any) -> list[Polygon]:
    part.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return read_polygons(part)


# --- what cannot be read ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is empty"),
        (" \n\t", "is empty"),
        ("hello", "neither GeoJSON"),
        ("0 0, 1 0, 0 1", "neither GeoJSON"),
        ('"POLYGON"', "neither GeoJSON"),
        ("{", "no valid JSON at line 1, column 2"),
        ('{"type": "Polygon",\n "coordinates": [[[0 0]]]}', "no valid JSON at line 2"),
        ('{"type": ' + "9" * 5000 + "}", "cannot be read"),
        ('{"a": ' * 200_000 + "1" + "}" * 200_000, "nested too deeply"),
        ("GEOMETRYCOLLECTION (" * 5000, "nested too deeply"),
        ("[]", "GeoJSON is no JSON object with a 'type'"),
        ("{}", "GeoJSON is no JSON object with a 'type'"),
        ({"type": 3}, "GeoJSON is no JSON object with a 'type'"),
        ({"type": "Topology", "objects": {}}, "is a Topology"),
        ({"type": "Polygon"}, "'coordinates' is no list"),
        ({"type": "Polygon", "coordinates": []}, "has no rings"),
        ({"type": "MultiPolygon", "coordinates": []}, "holds no polygon"),
        ({"type": "MultiPolygon", "coordinates": [3]}, "polygon 0 is no list"),
        ({"type": "MultiPolygon", "coordinates": [[]]}, "has no rings"),
        ({"type": "GeometryCollection", "geometries": 3}, "'geometries' is no list"),
        ({"type": "GeometryCollection", "geometries": [3]}, "no JSON object with a 'type'"),
        ({"type": "Point", "coordinates": [0, 0]}, "the geometry is a Point; only Polygon and"),
        ({"type": "FeatureCollection"}, "no list 'features'"),
        (collection(), "holds no polygon"),
        (collection(feature(TRIANGLE), 7), "feature 1 is no JSON object"),
        (collection(feature(None, {"name": "x"})), r"feature 0 \('x'\): its geometry is no JSON"),
        (collection(feature(TRIANGLE, [])), "feature 0: its properties are no JSON object"),
        (
            collection(
                feature(TRIANGLE), feature({"type": "LineString", "coordinates": RING}, id=5)
            ),
            r"feature 1 \('5'\) is a LineString",
        ),
        (
            collection(
                feature(TRIANGLE),
                feature({"type": "Polygon", "coordinates": [BOW]}, {"name": "bow"}),
            ),
            r"feature 1 \('bow'\): polygon 'bow': edge 0 of the outline, .* crosses edge 2",
        ),
        (
            feature({"type": "MultiPolygon", "coordinates": [[RING], [BOW]]}, {"name": "bow"}),
            r"the feature \('bow'\): polygon 'bow_1': edge 0 .* crosses",
        ),
        ({"type": "Polygon", "coordinates": [[[0, 0, 1], [1, 0, 1], [0, 1, 1]]]}, "3 coordinates"),
        ({"type": "Polygon", "coordinates": [[["0", 0], [1, 0], [0, 1]]]}, "no number: '0'"),
        ({"type": "Polygon", "coordinates": RING}, "point 0 is 0"),
        ('{"type": "Polygon", "coordinates": [[[0, 0], [NaN, 0], [0, 1]]]}', "not finite"),
        ('{"type": "Polygon", "coordinates": [[[0, 0], [1e999, 0], [0, 1]]]}', "not finite"),
        ("POLYGON EMPTY", "expected '[(]': a polygon that is not empty, found 'EMPTY'"),
        ("POLYGON Z EMPTY", "found 'EMPTY'"),
        ("MULTIPOLYGON EMPTY", "found 'EMPTY'"),
        ("POLYGON ()", r"line 1, column 10: expected '\(', found '\)'"),
        ("POLYGON ((0 0, 1 0, 0 1)", "line 1, column 25: expected ',' or '[)]', found the end"),
        ("POLYGON ((0 0, 1 0, 0 1,))", "expected a number, found '[)]'"),
        ("POLYGON ((0 0,\n 1 nan, 0 1))", "line 2, column 4: expected a number, found 'nan'"),
        ("POLYGON ((0 0, 1 0x3, 0 1))", "expected a number, found '0x3'"),
        ("POLYGON ((0 0, 1 0, 0 1)) 7", "expected POLYGON, MULTIPOLYGON .*, found '7'"),
        ("POINT (0 0)", "expected POLYGON, MULTIPOLYGON or GEOMETRYCOLLECTION, found 'POINT'"),
        ("POLYGON Z ((0 0 1, 1 0 1, 0 1 1))", "geometry 0: .* point 0 has 3 coordinates"),
        ("POLYGON ((0 0, 1 0, 0 1))\nPOLYGON ((0 0, 1 0))", "geometry 1: .* has 2 points"),
    ],
)
def test_bad_content_is_refused_naming_the_file(part: Path, content: Any, message: str) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        read(part, content)
    assert str(caught.value).startswith(f"{part}: ")


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"nowhere\.geojson: cannot be read: No such file"):
        read_polygons(tmp_path / "nowhere.geojson")


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="cannot be read"):
        read_polygons(tmp_path)


def test_what_is_no_text_is_refused(part: Path) -> None:
    part.write_bytes(b"POLYGON \xff\xfe")
    with pytest.raises(FileFormatError, match=r"no text in UTF-8 \(byte 8\)"):
        read_polygons(part)


@given(st.text(alphabet="POLYGNMUTIpolyg(), 01.-e+Z{}[]:\"'\n", max_size=40))
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_noise_is_refused_and_never_crashes(part: Path, text: str) -> None:
    with pytest.raises(FileFormatError):
        read(part, "POLYGON " + text)
    with pytest.raises(FileFormatError):
        read(part, '{"type":' + text)


# --- what is read -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "names"),
    [
        (TRIANGLE, ["part_0"]),
        (feature(TRIANGLE), ["part_0"]),
        (feature(TRIANGLE, {"name": "wedge"}, id="w7"), ["wedge"]),
        (feature(TRIANGLE, {"name": " "}, id="w7"), ["w7"]),
        (feature(TRIANGLE, {"name": True}, id=12), ["12"]),
        (feature(TRIANGLE, {"name": 3}), ["3"]),
        (PAIR, ["part_0_0", "part_0_1"]),
        (feature(PAIR, {"name": "pair"}), ["pair_0", "pair_1"]),
        (feature({"type": "MultiPolygon", "coordinates": [[RING]]}, {"name": "one"}), ["one"]),
        (
            {"type": "GeometryCollection", "geometries": [TRIANGLE, PAIR]},
            ["part_0_0", "part_0_1", "part_0_2"],
        ),
        (
            collection(feature(TRIANGLE), feature(TRIANGLE, {"name": "a"}), TRIANGLE),
            ["part_0", "a", "part_2"],
        ),
        (
            collection(*(feature(TRIANGLE, {"name": n}) for n in ("a", "a", "a_2", "a"))),
            ["a", "a_2", "a_2_2", "a_3"],
        ),
        ("POLYGON((0 0,4 0,4 3,0 0))", ["part_0"]),
        ("\ufeffPOLYGON((0 0,4 0,4 3,0 0))", ["part_0"]),
        ("\n polygon ((0 0, 4. +.0e3, 4 3E0))\n", ["part_0"]),
        ("SRID=4326;POLYGON ((0 0, 4 0, 4 3, 0 0))", ["part_0"]),
        ("POLYGON ((0 0,4 0,4 3))\nMULTIPOLYGON (((0 0,4 0,4 3)))", ["part_0", "part_1"]),
        ("MULTIPOLYGON(((0 0,4 0,4 3)),((9 9,8 9,8 8)))", ["part_0_0", "part_0_1"]),
        ("GEOMETRYCOLLECTION (POLYGON ((0 0, 4 0, 4 3)))", ["part_0"]),
    ],
)
def test_names(part: Path, content: Any, names: list[str]) -> None:
    polygons = read(part, content)
    assert [polygon.name for polygon in polygons] == names
    assert polygons[0] == Polygon([(0, 0), (4, 0), (4, 3)], name=names[0])


def test_holes_are_read(part: Path) -> None:
    expected = Polygon(BIG, [HOLE], "part_0")
    assert read(part, {"type": "Polygon", "coordinates": [BIG, HOLE]}) == [expected]
    solid = shapely.Polygon(BIG, [HOLE])
    assert read(part, shapely.to_wkt(solid)) == [expected]
    assert read(part, shapely.to_geojson(solid)) == [expected]


coordinates = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=6))
def test_wkt_numbers_are_read_exactly(points: list[tuple[float, float]]) -> None:
    text = ", ".join(f"{x!r} {y!r}" for x, y in points)
    assert parse_wkt(f"POLYGON (({text}))") == [[[points]]]


def test_the_corpus_is_the_same_in_wkt(part: Path, corpus: list[Polygon]) -> None:
    def wkt(polygon: Polygon) -> str:
        rings = [", ".join(f"{x!r} {y!r}" for x, y in ring.tolist()) for ring in polygon.rings]
        return f"POLYGON (({'), ('.join(rings)}))"

    for polygon, again in zip(corpus, read(part, "\n".join(map(wkt, corpus))), strict=True):
        assert Polygon(again.exterior, again.holes, polygon.name) == polygon


# --- the models ---------------------------------------------------------------------------------


def test_workpieces_have_their_dimensions(workpieces: dict[str, Polygon]) -> None:
    assert {name: polygon.n_edges for name, polygon in workpieces.items()} == {
        "rectangle": 4,
        "l_bracket": 6,
        "t_block": 8,
        "u_channel": 8,
        "two_hole_plate": 4 + 2 * 16,
        "hex_nut": 6 + 12,
        "push_t": 8,
        "wedge": 3,
    }
    assert workpieces["rectangle"].area == 60 * 30
    assert workpieces["push_t"].area == 120 * 30 + 30 * 90
    nut = workpieces["hex_nut"]
    assert nut.bounds[3] - nut.bounds[1] == pytest.approx(18, abs=1e-5)  # across flats
    for polygon in workpieces.values():
        assert polygon.input_edge.tolist() == list(range(polygon.n_edges))


def test_stars_have_exactly_the_edges_of_their_names(stars: dict[str, Polygon]) -> None:
    assert [polygon.n_edges for polygon in stars.values()] == [15, 25, 40]
    assert list(stars) == ["star_15", "star_25", "star_40"]


# --- writing ------------------------------------------------------------------------------------


def test_writing_replaces_the_text(tmp_path: Path) -> None:
    file = tmp_path / "plan.json"
    for text in ("first\n", "", "µ ≥ 0.2\r\n"):
        write_atomically(file, text)
        assert file.read_bytes() == text.encode()
    assert os.listdir(tmp_path) == ["plan.json"]


def test_a_failure_keeps_the_old_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "plan.json"
    write_atomically(file, "old")

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_atomically(file, "new")
    with pytest.raises(UnicodeEncodeError):
        write_atomically(file, "\ud800")
    assert file.read_text() == "old"
    assert os.listdir(tmp_path) == ["plan.json"]


def test_a_missing_folder_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write_atomically(tmp_path / "no" / "plan.json", "text")


def test_links_and_permissions_stay(tmp_path: Path) -> None:
    file, link = tmp_path / "plan.json", tmp_path / "link.json"
    write_atomically(file, "old")
    file.chmod(0o640)
    link.symlink_to(file)
    write_atomically(link, "new")
    assert link.is_symlink()
    assert file.read_text() == "new"
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
