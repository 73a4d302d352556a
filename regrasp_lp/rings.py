"""Rings of points: reading them from what users have, their exact coordinates, their direction."""

from __future__ import annotations

import itertools
import numbers
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from regrasp_lp.errors import PolygonError

__all__ = [
    "HasGeoInterface",
    "Point",
    "RingLike",
    "doubled_area",
    "exact_integers",
    "format_point",
    "orient_rings",
    "read_rings",
]

_Floats: TypeAlias = npt.NDArray[np.float64]
_Ints: TypeAlias = npt.NDArray[np.intp]
Point: TypeAlias = tuple[int, int]
"""A point in integers over a common denominator."""


class HasGeoInterface(Protocol):
    """An object of a geometry library, such as a shapely polygon."""

    @property
    def __geo_interface__(self) -> Mapping[str, Any]: ...


RingLike: TypeAlias = npt.ArrayLike | HasGeoInterface
"""Points of a ring: an array of shape (n, 2) or a sequence of pairs."""


# --- reading ------------------------------------------------------------------------------------


def read_rings(exterior: object, holes: object, label: str) -> list[_Floats]:
    """Return the rings as float arrays of shape (n, 2), unclosed, in the order given.

    Parameters
    ----------
    exterior
        Sequence or array of points, or an object with a ``__geo_interface__`` of type Polygon.
    holes
        Iterable of the former, empty in the latter case.
    label
        What messages call the polygon.

    Raises
    ------
    PolygonError
        If anything is of the wrong type or shape, not finite, or has fewer than 3 points.

    Examples
    --------
    >>> read_rings([(0, 0), (1, 0), (0, 1), (0, 0)], [], "polygon")
    [array([[0., 0.],
           [1., 0.],
           [0., 1.]])]
    """
    if isinstance(holes, (str, bytes, Mapping)) or not isinstance(holes, Iterable):
        raise PolygonError(f"{label}: holes has to be a list of rings, not {_short(holes)}")
    hole_list = list(holes)
    geometry = getattr(exterior, "__geo_interface__", None)
    if isinstance(geometry, Mapping) and geometry.get("type") != "LinearRing":
        if geometry.get("type") != "Polygon":
            raise PolygonError(
                f"{label}: expected points or one Polygon, got a {geometry.get('type')}; "
                f"make one Polygon of each of its parts"
            )
        if hole_list:
            raise PolygonError(
                f"{label}: a {type(exterior).__name__} object brings its own holes; "
                f"leave the argument holes empty"
            )
        coordinates = list(geometry.get("coordinates", ()))
        if not coordinates:
            raise PolygonError(f"{label}: the {type(exterior).__name__} given is empty")
        exterior, hole_list = coordinates[0], coordinates[1:]
    rings = [_read_ring(exterior, f"{label}: the outline")]
    if hole_list and _is_point(hole_list[0]):
        raise PolygonError(
            f"{label}: holes has to be a list of rings; a single hole is written [ring]"
        )
    rings += [_read_ring(hole, f"{label}: hole {k}") for k, hole in enumerate(hole_list)]
    return rings


def _read_ring(points: object, where: str) -> _Floats:
    geometry = getattr(points, "__geo_interface__", None)
    if isinstance(geometry, Mapping):
        points = geometry.get("coordinates", ())
    if isinstance(points, np.ndarray) and points.dtype.kind != "O":
        ring = _read_array(points, where)
    else:
        ring = _read_sequence(points, where)
    if not np.isfinite(ring).all():
        k = int(np.flatnonzero(~np.isfinite(ring).all(axis=1))[0])
        raise PolygonError(
            f"{where} has a point that is not finite: point {k} is {format_point(ring[k])}"
        )
    if len(ring) > 1 and (ring[0] == ring[-1]).all():
        ring = ring[:-1]
    if len(ring) < 3:
        raise PolygonError(
            f"{where} has {len(ring)} point{'s' * (len(ring) != 1)}: at least 3 different ones "
            f"are needed (a repeated last point does not count)"
        )
    return ring + 0.0  # a private copy, without negative zeros


def _read_array(points: npt.NDArray[Any], where: str) -> _Floats:
    if points.dtype.kind not in "fiu":
        raise PolygonError(f"{where} has to be an array of real numbers, not of {points.dtype}")
    if points.ndim != 2 or points.shape[1] != 2:
        raise PolygonError(
            f"{where} has to be an array of shape (n, 2), one point (x, y) a row; "
            f"its shape is {points.shape}"
        )
    return points.astype(np.float64)


def _read_sequence(points: object, where: str) -> _Floats:
    unordered = (str, bytes, Mapping, set, frozenset)
    if isinstance(points, unordered) or not isinstance(points, Iterable):
        raise PolygonError(f"{where} has to be a sequence of points (x, y), not {_short(points)}")
    ring = [_read_point(point, k, where) for k, point in enumerate(points)]
    return np.array(ring, dtype=np.float64).reshape(-1, 2)


def _read_point(point: object, k: int, where: str) -> list[float]:
    if isinstance(point, (str, bytes, Mapping, set, frozenset)) or not isinstance(point, Iterable):
        raise PolygonError(f"{where} has to consist of pairs (x, y); point {k} is {_short(point)}")
    entries = list(point)
    if len(entries) != 2:
        raise PolygonError(
            f"{where} has to consist of pairs (x, y); point {k} has {len(entries)} coordinates: "
            f"{_short(point)}"
        )
    for value in entries:
        if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
            raise PolygonError(f"{where}: a coordinate of point {k} is no number: {_short(value)}")
    try:
        return [float(value) for value in entries]
    except OverflowError:
        raise PolygonError(
            f"{where}: a coordinate of point {k} is too large: use another unit of length"
        ) from None


def _is_point(value: object) -> bool:
    """Whether a would-be ring is in fact one point, as in holes=[(0, 0), (1, 0), (0, 1)]."""
    if isinstance(value, np.ndarray):
        return value.ndim == 1 and value.dtype.kind in "fiu"
    return (
        isinstance(value, Sequence)
        and len(value) > 0
        and all(isinstance(entry, numbers.Real) for entry in value)
    )


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def format_point(point: _Floats) -> str:
    """Return a point as messages show it, with 12 digits."""
    return f"({point[0]:.12g}, {point[1]:.12g})"


# --- exact ------------------------------------------------------------------------------


def exact_integers(points: _Floats) -> tuple[list[Point], int]:
    """Return the points as integers over one common denominator, a power of two.

    Examples
    --------
    >>> exact_integers(np.array([[0.5, 3.0], [-0.25, 0.0]]))
    ([(2, 12), (-1, 0)], 4)
    """
    ratios = [value.as_integer_ratio() for value in points.ravel().tolist()]
    scale = max(denominator for _, denominator in ratios)
    scaled = [numerator * (scale // denominator) for numerator, denominator in ratios]
    return list(zip(scaled[::2], scaled[1::2], strict=True)), scale


def doubled_area(ring: Sequence[Point]) -> int:
    """Return twice the signed area of a ring, positive if it runs counter-clockwise.

    Examples
    --------
    >>> doubled_area([(0, 0), (3, 0), (0, 2)])
    6
    """
    following = itertools.chain(ring[1:], ring[:1])
    return sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(ring, following, strict=True))


def orient_rings(given: Sequence[_Floats]) -> tuple[list[_Floats], _Ints]:
    """Return the rings, the outline counter-clockwise, holes clockwise, and their edges' origins.

    A ring that runs the wrong way is reversed keeping its first vertex. Entry i of the second
    array is the edge of the input, numbered ring by ring, that edge i came from.

    Examples
    --------
    >>> rings, origins = orient_rings([np.array([[0.0, 0.0], [0.0, 3.0], [4.0, 0.0]])])
    >>> rings[0].tolist(), origins
    ([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]], array([2, 1, 0]))
    """
    rings, numbers, first = [], [], 0
    for r, ring in enumerate(given):
        origin = np.arange(len(ring))
        if (doubled_area(exact_integers(ring)[0]) > 0) != (r == 0):
            ring = np.roll(ring[::-1], 1, axis=0)
            origin = origin[::-1]
        rings.append(ring)
        numbers.append(first + origin)
        first += len(ring)
    return rings, np.concatenate(numbers)
