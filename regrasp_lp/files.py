"""Files: polygons in (GeoJSON, WKT, DXF or SVG, told apart by content), text out.

Writers replace a file in one step, so that no reader ever sees half of one.
"""

from __future__ import annotations

import errno
import json
import os
import re
import secrets
import shutil
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from regrasp_lp.errors import FileFormatError, OptionError, PolygonError
from regrasp_lp.outlines.drawing import Piece, Reading, outlines
from regrasp_lp.outlines.dxf import looks_like_dxf, read_dxf
from regrasp_lp.outlines.svg import read_svg
from regrasp_lp.outlines.svg_elements import looks_like_svg
from regrasp_lp.polygon import Polygon
from regrasp_lp.wkt import looks_like_wkt, parse_wkt

__all__ = ["read_polygons", "write_atomically"]

_POINT = re.compile(r"\(-?[\d.]+(e[+-]\d+)?, -?[\d.]+(e[+-]\d+)?\)")
"""A point as messages have it."""


class _Feature(NamedTuple):
    """One feature of a file: what it is called, and the rings of each of its polygons."""

    where: str
    name: str | None
    parts: list[list[Any]]


def read_polygons(
    path: str | os.PathLike[str],
    *,
    flattening: float | None = None,
    joining: float | None = None,
    layers: Iterable[str] | None = None,
    ignore: Iterable[str] = (),
) -> list[Polygon]:
    """Return the polygons of a GeoJSON, WKT, DXF or SVG file, in the order of the file.

    GeoJSON may be a FeatureCollection, a Feature or a bare geometry; WKT one geometry or
    several after one another. Geometries are Polygon, MultiPolygon or GeometryCollection of
    these. The content decides which format it is, not the name of the file.

    DXF needs the extra ``dxf``, SVG the extra ``svg``. Of a drawing closed curves are read, and
    open ones that join end to end; a ring inside another one is a hole. Coordinates stay in the
    unit of the drawing (of an SVG file its user unit), and the y axis of SVG, which points down,
    is turned up. Rings are nowhere farther than `flattening` + `joining` from the curves, nor
    these from them.

    Names come from a feature's ``properties.name``, else its ``id``, else the stem of the file
    with the index of the feature, ``part_0``; in DXF from the layer of the outline, if it is not
    layer 0; in SVG from the id or Inkscape's label of the element. Polygons of a feature with
    several of them get its name with ``_0``, ``_1``...; a name that occurs again gets ``_2``,
    ``_3``...

    Parameters
    ----------
    path : str or path-like
    flattening : float, optional
        Largest distance between a curve and the chords in its place, in the unit of the drawing;
        by default a thousandth of the diagonal of the drawing's bounding box.
    joining : float, optional
        Ends of curves that are not farther apart are joined; by default a millionth of it.
    layers : iterable of str, optional
        Read what is on these layers of a DXF drawing, or in groups of an SVG drawing with these
        ids or labels; by default all that is shown.
    ignore : iterable of str, optional
        Types of DXF entities (``"TEXT"``) or tags of SVG elements (``"text"``) to leave out; a
        drawing with others than outlines is refused, unless they are named here.

    Raises
    ------
    FileFormatError
        If the file cannot be read, is of another format, holds no polygon or anything that is
        no valid polygon; the message names the file and the feature, entity or element.
    MissingExtraError
        If the extra that the format needs is not installed.
    OptionError
        If an option has a value that makes no sense, there is no layer of that name, or layers
        or kinds of entities are given for a format that has none.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "parts.txt"
    ...     write_atomically(file, "POLYGON ((0 0, 4 0, 4 3, 0 0))")
    ...     read_polygons(file)
    [<Polygon 'parts_0': 3 edges>]
    """
    path = Path(path)
    reading = Reading.of(flattening, joining, layers, ignore)
    try:
        polygons = _build(_read_features(path, reading), path.stem)
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read: {error.strerror or error}") from error
    except RecursionError as error:
        raise FileFormatError(f"{path}: is nested too deeply to be read") from error
    except (FileFormatError, OptionError) as error:
        raise type(error)(f"{path}: {error}") from error.__cause__
    if not polygons:
        raise FileFormatError(f"{path}: holds no polygon")
    return polygons


def write_atomically(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a file in one step; text in UTF-8, with newlines as they are.

    The content goes to a temporary file in the same folder, which then takes the place of `path`:
    whatever happens on the way, `path` holds either what it did before or all of the content.
    A symbolic link stays one, and an existing file keeps its permissions.

    Parameters
    ----------
    path : str or path-like
    content : str or bytes

    Raises
    ------
    OSError
        If the folder cannot be written to.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "note.txt"
    ...     write_atomically(file, "held")
    ...     file.read_text()
    'held'
    """
    target = Path(os.path.realpath(path))
    if not target.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "there is no such folder", str(target.parent))
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(8)}.tmp")
    try:
        with open(temporary, "xb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        if target.exists():
            shutil.copymode(target, temporary)
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def _read_features(path: Path, reading: Reading) -> list[_Feature]:
    data = path.read_bytes()
    if looks_like_dxf(data):
        return _drawn(read_dxf(path, reading), reading)
    if looks_like_svg(data):
        return _upright(read_svg(data, reading), reading)
    if reading.layers is not None or reading.ignore:
        raise OptionError("is no drawing: layers=... and ignore=... are for DXF and SVG")
    try:
        return _features(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise FileFormatError(f"is no text in UTF-8 (byte {error.start})") from error


def _drawn(pieces: list[Piece], reading: Reading) -> list[_Feature]:
    try:
        found = outlines(pieces, reading)
    except PolygonError as error:
        raise FileFormatError(str(error)) from error
    return [_Feature(outline.entity, outline.name, [outline.rings]) for outline in found]


def _upright(pieces: list[Piece], reading: Reading) -> list[_Feature]:
    """What is drawn with the y axis down, turned up; messages have the coordinates of the file."""
    try:
        found = _drawn(pieces, reading)
    except FileFormatError as error:
        down = " (coordinates as in the file: y points down)" * bool(_POINT.search(str(error)))
        raise FileFormatError(f"{error}{down}") from error
    up = np.array([1.0, -1.0])
    return [
        one._replace(parts=[[ring * up for ring in part] for part in one.parts]) for one in found
    ]


def _features(text: str) -> list[_Feature]:
    start = text.lstrip()[:1]
    if start in ("{", "["):
        return list(_geojson_features(_parse_json(text)))
    if looks_like_wkt(text):
        geometries: list[list[list[Any]]] = [list(parts) for parts in parse_wkt(text)]
        return [_Feature(f"geometry {k}", None, parts) for k, parts in enumerate(geometries)]
    if not start:
        raise FileFormatError("is empty")
    raise FileFormatError(
        "is neither GeoJSON (which begins with '{') nor WKT (POLYGON...), DXF (0, SECTION) or SVG"
    )


def _build(features: list[_Feature], stem: str) -> list[Polygon]:
    polygons: list[Polygon] = []
    taken: set[str] = set()
    for k, feature in enumerate(features):
        base = feature.name or f"{stem}_{k}"
        for part, rings in enumerate(feature.parts):
            name = _unused(base if len(feature.parts) == 1 else f"{base}_{part}", taken)
            taken.add(name)
            if not rings:
                raise FileFormatError(f"{feature.where}: polygon {name!r} has no rings")
            try:
                polygons.append(Polygon(rings[0], rings[1:], name))
            except PolygonError as error:
                raise FileFormatError(f"{feature.where}: {error}") from error
    return polygons


def _unused(name: str, taken: set[str]) -> str:
    """Return the name, or the first of name_2, name_3... that is not taken."""
    candidate, k = name, 2
    while candidate in taken:
        candidate, k = f"{name}_{k}", k + 1
    return candidate


# --- GeoJSON ------------------------------------------------------------------------------------


def _parse_json(text: str) -> object:
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise FileFormatError(
            f"is no valid JSON at line {error.lineno}, column {error.colno}: {error.msg}"
        ) from error
    except ValueError as error:  # an integer of more digits than Python reads
        raise FileFormatError(f"is JSON that cannot be read: {error}") from error


def _geojson_features(document: object) -> Iterator[_Feature]:
    kind = _type_of(document, "GeoJSON")
    if kind != "FeatureCollection":
        where = "the feature" if kind == "Feature" else "the geometry"
        yield _geojson_feature(document, where)
        return
    assert isinstance(document, Mapping)
    features = document.get("features")
    if not isinstance(features, list):
        raise FileFormatError("the FeatureCollection has no list 'features'")
    for k, feature in enumerate(features):
        yield _geojson_feature(feature, f"feature {k}")


def _geojson_feature(document: object, where: str) -> _Feature:
    """Read a Feature or a bare geometry."""
    if _type_of(document, where) != "Feature":
        return _Feature(where, None, _parts(document, where))
    assert isinstance(document, Mapping)
    properties = document.get("properties")
    if properties is None:
        properties = {}
    if not isinstance(properties, Mapping):
        raise FileFormatError(f"{where}: its properties are no JSON object")
    name = _text(properties.get("name")) or _text(document.get("id"))
    if name:
        where = f"{where} ({name!r})"
    return _Feature(where, name, _parts(document.get("geometry"), where))


def _parts(geometry: object, where: str) -> list[list[Any]]:
    """Rings of each polygon of a geometry; their points are checked by `Polygon`."""
    kind = _type_of(geometry, f"{where}: its geometry")
    assert isinstance(geometry, Mapping)
    if kind == "GeometryCollection":
        members = _list(geometry.get("geometries"), f"{where}: 'geometries'")
        return [part for member in members for part in _parts(member, where)]
    if kind not in ("Polygon", "MultiPolygon"):
        raise FileFormatError(f"{where} is a {kind}; only Polygon and MultiPolygon can be read")
    coordinates = _list(geometry.get("coordinates"), f"{where}: 'coordinates'")
    if kind == "Polygon":
        return [coordinates]
    return [_list(part, f"{where}: polygon {k}") for k, part in enumerate(coordinates)]


def _type_of(document: object, what: str) -> str:
    kind = document.get("type") if isinstance(document, Mapping) else None
    if not isinstance(kind, str):
        raise FileFormatError(f"{what} is no JSON object with a 'type'")
    return kind


def _list(value: object, what: str) -> list[Any]:
    if not isinstance(value, list):
        raise FileFormatError(f"{what} is no list")
    return value


def _text(value: object) -> str | None:
    """Return a name from a JSON value: a string or number that says something, else None."""
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        return None
    return str(value).strip() or None
