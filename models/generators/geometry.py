"""Points and rings, and the text of a file of them. Angles are in degrees, counter-clockwise."""

from __future__ import annotations

import json
import math
from typing import Any, NamedTuple, TypeAlias

Point: TypeAlias = tuple[float, float]
Ring: TypeAlias = list[Point]

DIGITS = 6


class Part(NamedTuple):
    """A polygon: what it is called, its rings (the outline first), what it is."""

    name: str
    rings: list[Ring]
    note: str


def point(x: float, y: float) -> Point:
    """Return a rounded point, without negative zeros."""
    return round(x, DIGITS) + 0.0, round(y, DIGITS) + 0.0


def polar(radius: float, angle: float, x: float = 0.0, y: float = 0.0) -> Point:
    """Return the point at a distance from (x, y) in a direction."""
    a = math.radians(angle)
    return point(x + radius * math.cos(a), y + radius * math.sin(a))


def arc(n: int, radius: float, start: float, end: float, x: float = 0.0, y: float = 0.0) -> Ring:
    """Return the n + 1 points that divide an arc into n; clockwise if `end` is below `start`."""
    return [polar(radius, start + (end - start) * k / n, x, y) for k in range(n + 1)]


def regular(n: int, radius: float, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> Ring:
    """Return a regular n-gon, counter-clockwise; `turn` is the angle of its first corner."""
    return arc(n, radius, turn, turn + 360, x, y)[:-1]


def belt(n: int, radius: float, other_radius: float, distance: float) -> Ring:
    """Return the outline around a disc at the origin and one at (distance, 0), n edges each."""
    turn = math.degrees(math.acos((radius - other_radius) / distance))
    return [
        *arc(n, other_radius, -turn, turn, x=distance),
        *arc(n, radius, turn, 360 - turn),
    ]


def moved(ring: Ring, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> Ring:
    """Return a ring turned about the origin, then shifted."""
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    return [point(x + c * px - s * py, y + s * px + c * py) for px, py in ring]


def repeated(ring: Ring, n: int) -> Ring:
    """Return a ring made of n copies of a piece of it, turned about the origin."""
    return [corner for k in range(n) for corner in moved(ring, turn=360 * k / n)]


def feature(part: Part, units: str) -> dict[str, Any]:
    """Return a GeoJSON feature, its rings closed, the outline counter-clockwise."""
    oriented = [part.rings[0], *(hole[::-1] for hole in part.rings[1:])]
    return {
        "type": "Feature",
        "properties": {"name": part.name, "units": units, "note": part.note},
        "geometry": {"type": "Polygon", "coordinates": [[*ring, ring[0]] for ring in oriented]},
    }


def collection(features: list[dict[str, Any]]) -> str:
    """Return the text of a FeatureCollection, one feature a line."""
    lines = ",\n".join(json.dumps(f) for f in features)
    return f'{{"type": "FeatureCollection", "features": [\n{lines}\n]}}\n'
