"""DXF drawings: the outlines in their model space (needs the extra "dxf").

Lines, polylines with bulges, arcs, circles, ellipses, splines and inserted blocks are read by
`ezdxf`; each becomes curves in the plane, in the unit of the drawing.
"""

from __future__ import annotations

import logging
import math
import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from regrasp_lp.errors import FileFormatError, MissingExtraError, OptionError
from regrasp_lp.outlines.curves import Curve, EllipticArc, b_spline, bulge, polyline
from regrasp_lp.outlines.drawing import Expansion, Piece, Reading

if TYPE_CHECKING:
    from ezdxf.document import Drawing

__all__ = ["looks_like_dxf", "read_dxf"]

_Floats: TypeAlias = npt.NDArray[np.float64]

_BINARY = b"AutoCAD Binary DXF"
_IDENTITY = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_MIRRORED = np.array([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""What the plane of an entity that is seen from below looks like from above (DXF's OCS)."""
_FLAT = 1e-9
"""Largest difference of heights and tilt of what lies in a plane, relative to its size."""
_DEEPEST = 64
"""Blocks within blocks; more of them contain themselves."""
_DAMAGE = (
    *(ArithmeticError, AssertionError, AttributeError, LookupError, RuntimeError, TypeError),
    *(ValueError, StopIteration, struct.error),
)
"""What ezdxf raises on damaged files, beside its own errors; it trusts what it reads."""


def looks_like_dxf(data: bytes) -> bool:
    r"""Whether a file begins as DXF does: with a section, after comments, or as binary DXF.

    Examples
    --------
    >>> looks_like_dxf(b"  0\nSECTION\n"), looks_like_dxf(b"POLYGON ((0 0, 1 0, 0 1, 0 0))")
    (True, False)
    """
    if data.startswith(_BINARY):
        return True
    lines = [line.strip() for line in data.removeprefix(b"\xef\xbb\xbf")[:4096].splitlines()]
    while lines[:1] == [b"999"]:
        del lines[:2]
    return lines[:2] == [b"0", b"SECTION"]


def read_dxf(path: Path, reading: Reading) -> list[Piece]:
    """Return the pieces of outlines in the model space of a DXF file.

    Raises
    ------
    MissingExtraError
        If ezdxf is not installed.
    FileFormatError
        If the file is damaged, or holds an entity that is no outline; the message names it.
    OptionError
        If there is no layer of a name asked for.
    """
    try:
        from ezdxf.filemanagement import readfile
        from ezdxf.lldxf.const import DXFError
    except ModuleNotFoundError as error:
        raise MissingExtraError("ezdxf", "dxf", "reading DXF files") from error
    with _quiet(), np.errstate(all="ignore"):  # what is not finite is refused by name later
        try:
            document = readfile(path)
            space = document.modelspace()
        except (DXFError, OSError, *_DAMAGE) as error:
            raise FileFormatError(
                f"is DXF that cannot be read: {_reason(error)} (a CAD program may mend it, and "
                "save it anew)"
            ) from error
        try:
            return _Walk(document, reading).pieces(space)
        except DXFError as error:
            raise FileFormatError(f"is DXF of damaged structure: {_reason(error)}") from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Let ezdxf's log go to nowhere but the handlers that somebody has set up."""
    log, handler = logging.getLogger("ezdxf"), logging.NullHandler()
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


@contextmanager
def _named(where: str) -> Iterator[None]:
    """Say of which entity ezdxf could make nothing."""
    try:
        yield
    except (FileFormatError, OptionError, RecursionError):
        raise
    except _DAMAGE as error:
        raise FileFormatError(f"{where} is damaged: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    """What an error says, with its kind where that says more."""
    return f"{error}" if " " in f"{error}" else f"{type(error).__name__} {error}".rstrip()


class _Place(NamedTuple):
    """Where the entities of a block are put, and on which layer those on layer 0 are."""

    matrix: _Floats
    layer: str
    trail: tuple[str, ...]


class _Walk:
    """Goes through the model space, blocks within blocks."""

    def __init__(self, document: Drawing, reading: Reading) -> None:
        self._document = document
        self._layers = None if reading.layers is None else {n.casefold() for n in reading.layers}
        self._ignored = {kind.upper() for kind in reading.ignore}
        self._others: Counter[str] = Counter()
        self._first_other = ""
        self._expansion = Expansion()
        known = {} if reading.layers is None else _layers(document)
        for name in reading.layers or ():
            if name.casefold() not in known:
                listed = ", ".join(map(repr, known.values()))
                raise OptionError(f"there is no layer {name!r}; the layers are {listed}")

    def pieces(self, space: Iterable[Any]) -> list[Piece]:
        found = list(self._walk(space, _Place(_IDENTITY, "0", ())))
        if self._others:
            listed = ", ".join(f"{n} {kind}" for kind, n in sorted(self._others.items()))
            kinds = ", ".join(f'"{kind}"' for kind in sorted(self._others))
            raise FileFormatError(
                f"{self._first_other} is no outline (in all: {listed}): leave such entities out "
                f"with ignore=[{kinds}], or name the layers to read with layers=[...]"
            )
        return found

    def _walk(self, entities: Iterable[Any], place: _Place) -> Iterator[Piece]:
        for entity in entities:
            with _named(f"{entity.dxftype()} (handle {entity.dxf.get('handle')})"):
                layer = str(_common(entity, "layer", "0"))
            layer = place.layer if layer == "0" else layer
            self._expansion.add(_words(entity, layer, place.trail))
            if entity.dxftype() == "INSERT":
                yield from self._insert(entity, place._replace(layer=layer))
            elif self._wanted(entity, layer):
                piece = self._piece(entity, layer, place)
                if piece is not None:
                    yield piece

    def _wanted(self, entity: Any, layer: str) -> bool:
        """Whether an entity is read: on a layer asked for, or shown on any, and not ignored."""
        if entity.dxftype() in self._ignored:
            return False
        if self._layers is not None:
            return layer.casefold() in self._layers
        if _common(entity, "invisible", 0):
            return False
        if layer not in self._document.layers:
            return True
        entry = self._document.layers.get(layer)
        return not (entry.is_off() or entry.is_frozen())

    def _insert(self, insert: Any, place: _Place) -> Iterator[Piece]:
        if "INSERT" in self._ignored:
            return
        where = _words(insert, place.layer, place.trail)
        with _named(where):
            _require(insert, "name", "insert")
            name, block = str(insert.dxf.name), insert.block()
        if block is None or block.block.is_xref:
            raise FileFormatError(f"{where} refers to block {name!r}, which is not in the file")
        if len(place.trail) >= _DEEPEST:
            raise FileFormatError(f"{where}: block {name!r} contains itself")
        for attribute in insert.attribs:
            if self._wanted(attribute, place.layer):
                self._note(attribute, place.layer, place.trail)
        self._expansion.add(where, insert.mcount)
        for single in insert.multi_insert() if insert.mcount > 1 else [insert]:
            with _named(where):
                matrix = _planar(single.matrix44(), where)
            inner = _Place(_after(place.matrix, matrix), place.layer, (*place.trail, name))
            yield from self._walk(block, inner)

    def _note(self, entity: Any, layer: str, trail: tuple[str, ...]) -> None:
        """Remember an entity that is no outline."""
        self._first_other = self._first_other or _words(entity, layer, trail)
        self._others[entity.dxftype()] += 1

    def _piece(self, entity: Any, layer: str, place: _Place) -> Piece | None:
        if entity.dxftype() not in _READERS:
            self._note(entity, layer, place.trail)
            return None
        where = _words(entity, layer, place.trail)
        with _named(where):
            curves, closed = _READERS[entity.dxftype()](entity, where)
            turned = _after(place.matrix, _own_plane(entity, where))
        if abs(float(np.linalg.det(turned[:, :2]))) == 0:
            raise FileFormatError(f"{where}: its block is inserted with a scale of 0")
        moved = tuple(curve.transformed(turned) for curve in curves)
        return Piece(where, None if layer == "0" else layer, moved, closed)


def _common(entity: Any, name: str, default: Any) -> Any:
    """What all entities may say, also those of a kind that ezdxf does not know."""
    if entity.dxf.is_supported(name):
        return entity.dxf.get(name, default)
    return entity.graphic_properties().get(name, default)


def _layers(document: Drawing) -> dict[str, str]:
    """The layers of the table and those that entities are on: names, by the same in lower case.

    Programs need not write a table; layers that are not in it have the standard properties.
    """
    listed = [str(layer.dxf.name) for layer in document.layers]
    used = {str(e.dxf.layer) for e in document.entitydb.values() if e.dxf.hasattr("layer")}
    return {name.casefold(): name for name in [*sorted(used), *listed]}


def _words(entity: Any, layer: str, trail: tuple[str, ...]) -> str:
    handle = entity.dxf.get("handle")
    block = f" of block {trail[-1]!r}" if trail else ""
    named = f"handle {handle}, " if handle else ""
    return f"{entity.dxftype()} ({named}layer {layer!r}){block}"


def _after(outer: _Floats, inner: _Floats) -> _Floats:
    """The affine map that does the inner first; matrices (A | b)."""
    linear = outer[:, :2] @ inner[:, :2]
    return np.column_stack([linear, outer[:, :2] @ inner[:, 2] + outer[:, 2]])


def _planar(matrix: Any, where: str) -> _Floats:
    """What a map of space does to the plane z = 0, which it has to keep level."""
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    origin, x, y = (np.array(matrix.transform(point).xyz) for point in points)
    columns = np.column_stack([x - origin, y - origin])
    if np.abs(columns[2]).max() > _FLAT * np.abs(columns).max():
        raise FileFormatError(f"{where} is tilted out of the xy plane; draw outlines in the plane")
    return np.column_stack([columns[:2], origin[:2]])


def _own_plane(entity: Any, where: str) -> _Floats:
    """From the coordinates that an entity is given in to those of the drawing."""
    if entity.dxftype() not in _IN_OWN_PLANE or getattr(entity, "is_3d_polyline", False):
        return _IDENTITY
    x, y, z = entity.dxf.get("extrusion", (0.0, 0.0, 1.0))
    if math.hypot(x, y) > _FLAT * abs(z):
        raise FileFormatError(f"{where} is tilted out of the xy plane; draw outlines in the plane")
    return _IDENTITY if z > 0 else _MIRRORED


def _level(points: Iterable[Any], where: str) -> _Floats:
    """The x and y of points of one height."""
    array = np.array([tuple(point) for point in points], dtype=np.float64).reshape(-1, 3)
    if len(array) and np.ptp(array[:, 2]) > _FLAT * np.ptp(array, axis=0).max():
        raise FileFormatError(f"{where} rises out of the xy plane; draw outlines in the plane")
    return array[:, :2]


# --- entities -----------------------------------------------------------------------------------

_Read: TypeAlias = tuple[list[Curve], bool]
"""Curves in the plane of the entity, and whether a segment closes them."""


def _require(entity: Any, *names: str) -> None:
    """Refuse an entity that does not say what ezdxf would put a standard value for."""
    for name in names:
        if not entity.dxf.hasattr(name):
            raise ValueError(f"it has no {name.replace('_', ' ')}")


def _line(entity: Any, where: str) -> _Read:
    _require(entity, "start", "end")
    return polyline(_level([entity.dxf.start, entity.dxf.end], where)), False


def _lwpolyline(entity: Any, where: str) -> _Read:
    rows = np.array(entity.get_points("xyb"), dtype=np.float64).reshape(-1, 3)
    return _bulged(rows[:, :2], rows[:, 2], bool(entity.closed))


def _polyline(entity: Any, where: str) -> _Read:
    if not (entity.is_2d_polyline or entity.is_3d_polyline):
        raise FileFormatError(f"{where} is a mesh, no outline")
    # of smoothed polylines the vertices that only control the curve are left out
    vertices = [v for v in entity.vertices if not v.dxf.flags & 16]
    points = _level([v.dxf.location for v in vertices], where)
    bulges = np.array([v.dxf.get("bulge", 0.0) for v in vertices], dtype=np.float64)
    return _bulged(points, bulges, bool(entity.is_closed))


def _bulged(points: _Floats, bulges: _Floats, closed: bool) -> _Read:
    if closed and len(points):
        points = np.concatenate([points, points[:1]])
    pairs = zip(points[:-1], points[1:], bulges.tolist(), strict=False)
    return [bulge(start, end, value) for start, end, value in pairs], closed


def _circle(entity: Any, where: str) -> _Read:
    first, last = 0.0, 2 * math.pi
    _require(entity, "center", "radius")
    if entity.dxftype() == "ARC":
        _require(entity, "start_angle", "end_angle")
        first, last = math.radians(entity.dxf.start_angle), math.radians(entity.dxf.end_angle)
    radius = float(entity.dxf.radius)
    center = np.array(tuple(entity.dxf.center)[:2], dtype=np.float64)
    axes = np.array([radius, 0.0]), np.array([0.0, radius])
    return _turn(center, *axes, first, last)


def _ellipse(entity: Any, where: str) -> _Read:
    _require(entity, "center", "major_axis", "ratio")
    tool = entity.construction_tool()
    axes = _level([(0, 0, 0), tool.major_axis, tool.minor_axis], where)
    center = np.array(tuple(tool.center)[:2], dtype=np.float64)
    return _turn(center, axes[1], axes[2], tool.start_param, tool.end_param)


def _turn(center: _Floats, u: _Floats, v: _Floats, first: float, last: float) -> _Read:
    """An arc counter-clockwise in its plane; angles that are equal but for turns are a whole."""
    sweep = (last - first) % (2 * math.pi)
    if not math.isfinite(sweep):
        raise ValueError("its angles are no numbers")
    if min(sweep, 2 * math.pi - sweep) < 1e-9:
        sweep = 2 * math.pi
    if not (u.any() or v.any()):
        return [], False
    return [EllipticArc(center, u, v, first, sweep)], sweep == 2 * math.pi


def _spline(entity: Any, where: str) -> _Read:
    tool = entity.construction_tool()
    controls = _level(tool.control_points, where)
    weights = np.array(tool.weights(), dtype=np.float64)
    knots = tool.knots()
    if len(weights) and not (weights > 0).all():
        raise FileFormatError(f"{where} has weights that are not positive")
    rational = weights if len(weights) and np.ptp(weights) > 0 else None
    return b_spline(knots, controls, rational, tool.degree), bool(entity.closed)


_READERS = {
    "LINE": _line,
    "LWPOLYLINE": _lwpolyline,
    "POLYLINE": _polyline,
    "ARC": _circle,
    "CIRCLE": _circle,
    "ELLIPSE": _ellipse,
    "SPLINE": _spline,
}
_IN_OWN_PLANE = ("LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE")
"""Entities whose coordinates are in their own plane, which their extrusion gives."""
