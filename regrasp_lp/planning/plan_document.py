"""The content of a plan's file as typed values: what an independent verification needs of it.

Only ``fraction`` (the double it is) says where a contact is. ``position`` is for people and is not
read, and neither are ``margin`` and ``grasps``, which carry numbers that no verdict depends on.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, cast

from regrasp_lp.errors import FileFormatError

FORMAT = "regrasp-plan"
VERSION = 1
_GEOJSON = ("FeatureCollection", "Feature", "Polygon", "MultiPolygon", "GeometryCollection")

Place: TypeAlias = tuple[int, float]
"""An edge and a fraction of its length."""


ReachDocument: TypeAlias = Mapping[int, tuple[tuple[float, float], ...]]
"""Of some edges the intervals of positions that may be touched."""


@dataclass(frozen=True)
class PlaceStep:
    """A finger comes to a place; also how a contact of the start is said."""

    finger: int
    at: Place


@dataclass(frozen=True)
class ReleaseStep:
    """A finger leaves."""

    finger: int


@dataclass(frozen=True)
class Move:
    """One finger of a slide."""

    finger: int
    start: Place
    end: Place


@dataclass(frozen=True)
class SlideStep:
    """Fingers slide together, each at constant speed."""

    moves: tuple[Move, ...]


@dataclass(frozen=True)
class LimitsDocument:
    """What limits where the fingers of a hand may be; lengths in the unit of the object."""

    max_span: float | None
    edge_clearance: float
    fingertip_separation: float
    reachable: ReachDocument
    finger_reachable: Mapping[int, ReachDocument]
    only_place: frozenset[int]
    only_slide: frozenset[int]


@dataclass(frozen=True)
class PlanDocument:
    """What the verification reads of a plan."""

    exterior: list[tuple[float, float]]
    holes: list[list[tuple[float, float]]]
    friction: list[float]
    fingers: int
    limits: LimitsDocument
    start: tuple[PlaceStep, ...]
    goal: tuple[Place, ...]
    steps: tuple[PlaceStep | ReleaseStep | SlideStep, ...]


def parse_document(document: object) -> PlanDocument:
    """Turn a document into typed values; whether they make sense is not looked at here.

    Raises
    ------
    FileFormatError
        If it is no plan of this version, or an entry is missing or of a wrong type; the message
        names the place.
    """
    plan = _mapping(document, "the document")
    found = (plan.get("format"), plan.get("version"))
    if found[0] is None:
        what = "GeoJSON, which has objects" if plan.get("type") in _GEOJSON else "other JSON"
        raise FileFormatError(f'this is no plan, which has "format": "{FORMAT}", but {what}')
    if found[0] != FORMAT or found[1] != VERSION or isinstance(found[1], bool):
        raise FileFormatError(
            f"expected format {FORMAT!r} version {VERSION}, found format {found[0]!r} version "
            f"{found[1]!r}: this is no plan, or one written by another version of the package"
        )
    polygon = _mapping(_entry(plan, "polygon", ""), "polygon")
    holes = _sequence(polygon.get("holes", []), "polygon.holes")
    friction = _entry(plan, "friction", "")
    hand = _mapping(_entry(plan, "hand", ""), "hand")
    start = _sequence(_entry(plan, "start", ""), "start")
    goal = _sequence(_entry(plan, "goal", ""), "goal")
    steps = _sequence(_entry(plan, "steps", ""), "steps")
    return PlanDocument(
        exterior=_ring(_entry(polygon, "exterior", "polygon."), "polygon.exterior"),
        holes=[_ring(ring, f"polygon.holes[{i}]") for i, ring in enumerate(holes)],
        friction=[
            _number(value, f"friction[{i}]")
            for i, value in enumerate(_sequence(friction, "friction"))
        ],
        fingers=_integer(_entry(hand, "fingers", "hand."), "hand.fingers"),
        limits=_limits(hand),
        start=tuple(_start_contact(item, i) for i, item in enumerate(start)),
        goal=tuple(_contact(item, f"goal[{i}]") for i, item in enumerate(goal)),
        steps=tuple(_step(item, f"steps[{i}]") for i, item in enumerate(steps)),
    )


def read_plan_document(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the file of a plan; the result is what `verify_document` takes.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    dict

    Raises
    ------
    FileFormatError
        If the file cannot be read, is no JSON, no plan, of another version or incomplete.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        document = json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise FileFormatError(
            f"{path} is no JSON text ({error}); it may be damaged or only partly written"
        ) from error
    try:
        parse_document(document)
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {error}") from error
    return cast("dict[str, Any]", document)


def _limits(hand: Mapping[str, Any]) -> LimitsDocument:
    lengths = ("max_span", "edge_clearance", "fingertip_separation")
    fingers = ("finger_reachable", "only_place", "only_slide")
    unknown = sorted(set(hand) - {"fingers", *lengths, "reachable", *fingers})
    if unknown:  # a limit that is not checked must not pass for one that holds
        raise FileFormatError(f"hand.{unknown[0]}: no limit of a hand that this release knows")
    given = {name: _number(hand[name], f"hand.{name}") for name in lengths if name in hand}
    for name, value in given.items():
        if value < 0:
            raise FileFormatError(f"hand.{name}: expected a length, found {value!r}")
    by_finger: dict[int, ReachDocument] = {}
    where = "hand.finger_reachable"
    for i, item in enumerate(_sequence(hand.get("finger_reachable", []), where)):
        entry = _mapping(item, f"{where}[{i}]")
        finger = _integer(_entry(entry, "finger", f"{where}[{i}]."), f"{where}[{i}].finger")
        if finger in by_finger:
            raise FileFormatError(f"{where}[{i}].finger: finger {finger} is named twice")
        reach = _entry(entry, "reachable", f"{where}[{i}].")
        by_finger[finger] = _reach(reach, f"{where}[{i}].reachable")
    placed, slid = (
        frozenset(
            _integer(finger, f"hand.{name}[{i}]")
            for i, finger in enumerate(_sequence(hand.get(name, []), f"hand.{name}"))
        )
        for name in ("only_place", "only_slide")
    )
    return LimitsDocument(
        given.get("max_span"),
        given.get("edge_clearance", 0.0),
        given.get("fingertip_separation", 0.0),
        _reach(hand.get("reachable", []), "hand.reachable"),
        by_finger,
        placed,
        slid,
    )


def _reach(value: object, name: str) -> ReachDocument:
    reachable: dict[int, tuple[tuple[float, float], ...]] = {}
    for i, item in enumerate(_sequence(value, name)):
        where = f"{name}[{i}]"
        entry = _mapping(item, where)
        edge = _integer(_entry(entry, "edge", f"{where}."), f"{where}.edge")
        if edge in reachable:
            raise FileFormatError(f"{where}.edge: edge {edge} is named twice")
        intervals = _ring(_entry(entry, "intervals", f"{where}."), f"{where}.intervals")
        for first, last in intervals:
            if not 0 <= first <= last:
                raise FileFormatError(
                    f"{where}.intervals: expected 0 <= first <= last, found {[first, last]}"
                )
        reachable[edge] = tuple(intervals)
    return reachable


def _start_contact(value: object, index: int) -> PlaceStep:
    where = f"start[{index}]"
    item = _mapping(value, where)
    finger = _integer(item["finger"], f"{where}.finger") if "finger" in item else index + 1
    return PlaceStep(finger, _contact(item, where))


def _step(value: object, where: str) -> PlaceStep | ReleaseStep | SlideStep:
    item = _mapping(value, where)
    action = _entry(item, "action", f"{where}.")
    if action == "slide":
        moves = _sequence(_entry(item, "moves", f"{where}."), f"{where}.moves")
        if not moves:
            raise FileFormatError(f"{where}.moves: a slide moves at least one finger")
        return SlideStep(tuple(_move(move, f"{where}.moves[{i}]") for i, move in enumerate(moves)))
    if action not in ("place", "release"):
        raise FileFormatError(
            f"{where}.action: expected 'place', 'release' or 'slide', found {action!r}"
        )
    finger = _integer(_entry(item, "finger", f"{where}."), f"{where}.finger")
    return PlaceStep(finger, _contact(item, where)) if action == "place" else ReleaseStep(finger)


def _move(value: object, where: str) -> Move:
    item = _mapping(value, where)
    edge = _integer(_entry(item, "edge", f"{where}."), f"{where}.edge")

    def end(key: str) -> Place:
        # An end may name its edge again; the replay sees whether it is the same.
        place = {"edge": edge, **_mapping(_entry(item, key, f"{where}."), f"{where}.{key}")}
        return _contact(place, f"{where}.{key}")

    finger = _integer(_entry(item, "finger", f"{where}."), f"{where}.finger")
    return Move(finger, end("from"), end("to"))


def _contact(value: object, where: str) -> Place:
    item = _mapping(value, where)
    edge = _integer(_entry(item, "edge", f"{where}."), f"{where}.edge")
    return edge, _number(_entry(item, "fraction", f"{where}."), f"{where}.fraction")


def _ring(value: object, where: str) -> list[tuple[float, float]]:
    points = []
    for i, item in enumerate(_sequence(value, where)):
        pair = _sequence(item, f"{where}[{i}]")
        if len(pair) != 2:
            raise FileFormatError(f"{where}[{i}]: expected two coordinates, found {len(pair)}")
        points.append((_number(pair[0], f"{where}[{i}][0]"), _number(pair[1], f"{where}[{i}][1]")))
    return points


def _entry(item: Mapping[str, Any], key: str, prefix: str) -> object:
    if key not in item:
        raise FileFormatError(f"{prefix}{key} is missing")
    return item[key]


def _mapping(value: object, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise FileFormatError(f"{where}: expected an object, found {_shown(value)}")
    return value


def _sequence(value: object, where: str) -> Sequence[Any]:
    if not isinstance(value, Sequence) or isinstance(value, (str, bytes)):
        raise FileFormatError(f"{where}: expected a list, found {_shown(value)}")
    return value


def _integer(value: object, where: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise FileFormatError(f"{where}: expected an integer, found {_shown(value)}")
    return value


def _number(value: object, where: str) -> float:
    number = math.nan
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    if not math.isfinite(number):
        raise FileFormatError(f"{where}: expected a finite number, found {_shown(value)}")
    return number


def _shown(value: object) -> str:
    if isinstance(value, int):  # Python refuses to print the longest ones
        return f"an integer of {value.bit_length()} bits" if abs(value) > 1e18 else repr(value)
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
