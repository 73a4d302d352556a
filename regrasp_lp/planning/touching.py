"""What fingers may touch, as users give it and as it is kept: intervals of edges, by finger."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

import numpy as np

from regrasp_lp.errors import HandError

Intervals: TypeAlias = tuple[tuple[float, float], ...]
"""Positions along an edge, ascending, with no point in common."""

ReachableLike: TypeAlias = Mapping[int, Any] | Iterable[tuple[int, Any]] | None

Reach: TypeAlias = tuple[tuple[int, Intervals], ...]
"""What may be touched, in the form in which it is kept: edges that are named, ascending."""

ByFinger: TypeAlias = Mapping[int, ReachableLike] | Iterable[tuple[int, ReachableLike]]


def finite_number(value: object) -> float | None:
    """Return a value as a float, or None if it is no finite number."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        return None
    number = float(value)
    return number + 0.0 if math.isfinite(number) else None


def intervals_by_edge(reachable: ReachableLike) -> tuple[tuple[int, Intervals], ...] | None:
    """Return what may be touched in the form in which it is kept; None if nothing is said.

    Raises
    ------
    HandError
        If it is no such thing.
    """
    if reachable is None:
        return None
    try:
        entries = list(reachable.items() if isinstance(reachable, Mapping) else reachable)
        pairs = [(edge, intervals) for edge, intervals in entries]
    except (TypeError, ValueError) as error:
        raise HandError(
            "reachable must be a mapping from edges to the positions that may be touched, as in "
            f"{{0: (0.2, 1.0), 3: None}}, got {reachable!r}"
        ) from error
    found: dict[int, Intervals] = {}
    for edge, intervals in pairs:
        if isinstance(edge, (bool, np.bool_)) or not isinstance(edge, numbers.Integral) or edge < 0:
            raise HandError(f"reachable names edges by their numbers, from 0, not {edge!r}")
        if int(edge) in found:
            raise HandError(f"reachable names edge {edge} twice: give all its intervals at once")
        found[int(edge)] = _intervals(int(edge), intervals)
    return tuple(sorted(found.items())) or None


def reach_by_finger(value: object, fingers: int) -> tuple[tuple[int, Reach], ...]:
    """Return what single fingers may touch in the form in which it is kept.

    Raises
    ------
    HandError
        If it is no such thing; the message says of which finger.
    """
    try:
        entries = list(value.items() if isinstance(value, Mapping) else value)  # type: ignore[call-overload]
        pairs = [(finger, reach) for finger, reach in entries]
    except (TypeError, ValueError) as error:
        raise HandError(
            "finger_reachable must be a mapping from fingers to what `reachable` takes, as in "
            f"{{1: {{0: (0.2, 1.0), 3: None}}}}, got {value!r}"
        ) from error
    numbers_ = finger_numbers("finger_reachable", [finger for finger, _ in pairs], fingers)
    if len(numbers_) < len(pairs):
        raise HandError("finger_reachable names a finger twice: give all its edges at once")
    found = {}
    for finger, reach in pairs:
        try:
            kept = intervals_by_edge(reach)
        except HandError as error:
            raise HandError(f"finger_reachable[{finger}]: {error}") from error
        if kept is not None:
            found[int(finger)] = kept
    return tuple(sorted(found.items()))


def finger_numbers(name: str, value: Any, fingers: int) -> tuple[int, ...]:
    """Return different fingers of a hand, ascending; raise HandError if it has one of them not."""
    entries = list(value) if isinstance(value, Iterable) and not isinstance(value, str) else [value]
    found: set[int] = set()
    for finger in entries:
        whole = isinstance(finger, (int, np.integer)) and not isinstance(finger, bool)
        if not whole or finger not in range(1, fingers + 1):
            raise HandError(f"{name} names fingers from 1 to {fingers}, not {finger!r}")
        found.add(int(finger))
    return tuple(sorted(found))


def shared_intervals(one: Intervals, other: Intervals) -> Intervals:
    """Return what lies in both of two unions of intervals, but for single points."""
    shared = [(max(a, c), min(b, d)) for a, b in one for c, d in other]
    return tuple(sorted((low, high) for low, high in shared if low < high))


def united_intervals(intervals: Iterable[tuple[float, float]]) -> Intervals:
    """Return intervals in order; those that overlap or touch become one."""
    united: list[tuple[float, float]] = []
    for low, high in sorted(intervals):
        if united and low <= united[-1][1]:
            united[-1] = (united[-1][0], max(high, united[-1][1]))
        else:
            united.append((low, high))
    return tuple(united)


def reach_entries(reach: Iterable[tuple[int, Intervals]]) -> list[dict[str, Any]]:
    """Return what may be touched as files have it."""
    return [
        {"edge": edge, "intervals": [list(interval) for interval in intervals]}
        for edge, intervals in reach
    ]


def reach_from(entries: Iterable[Mapping[str, Any]]) -> list[tuple[int, Any]]:
    """Return what `reach_entries` described."""
    return [(entry["edge"], entry["intervals"]) for entry in entries]


def _intervals(edge: int, value: object) -> Intervals:
    """One interval, several or none."""
    if value is None:
        return ()
    entries = list(value) if isinstance(value, Iterable) else [value]
    if len(entries) == 2 and all(finite_number(entry) is not None for entry in entries):
        entries = [entries]
    return united_intervals(_interval(edge, entry) for entry in entries)


def _interval(edge: int, entry: object) -> tuple[float, float]:
    ends = list(entry) if isinstance(entry, Iterable) else []
    if len(ends) == 2:
        low, high = finite_number(ends[0]), finite_number(ends[1])
        if low is not None and high is not None and 0 <= low < high:
            return low, high
    raise HandError(
        f"reachable[{edge}] must be None, an interval of positions (first, last) with "
        f"0 <= first < last, or several of them; got {entry!r}"
    )
