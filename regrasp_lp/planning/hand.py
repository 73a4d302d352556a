"""The hand: how many fingers it has, and what limits where they may be."""

from __future__ import annotations

import math
import numbers
import operator
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.errors import HandError

Intervals: TypeAlias = tuple[tuple[float, float], ...]
"""Positions along an edge, ascending, with no point in common."""

ReachableLike: TypeAlias = Mapping[int, Any] | Iterable[tuple[int, Any]] | None


@dataclass(frozen=True, repr=False)
class Hand:
    """A hand of free-flying point fingers, numbered 1 to `fingers`, and its limits.

    Limits hold for all fingers that touch, at every instant, whether they support the object or
    not: a plan is checked for them exactly. By default there are none.

    Parameters
    ----------
    fingers : int
        k >= 3. The chapter's hand has four (section 3.3).
    max_span : float, optional
        Largest distance between any two touching fingers, in the object's unit.
    edge_clearance : float
        Distance that touching fingers keep from both ends of their edge.
    fingertip_separation : float
        Smallest distance between any two touching fingers.
    reachable : mapping of int to None, (first, last) or a sequence of these, optional
        Of some edges the positions that may be touched, ends included: None or nothing for an edge
        that may not be touched. What is beyond the end of an edge is cut off. Edges that are not
        named may be touched everywhere. Kept as a tuple of (edge, intervals).

    Raises
    ------
    HandError
        If a value makes no sense.

    Examples
    --------
    >>> Hand().held(3, 3), Hand(fingers=5).held(3, 3), Hand().held(2, 2)
    (2, 1, 0)
    >>> Hand(edge_clearance=2.5, reachable={3: None, 0: (5, 20)})
    Hand(fingers=4, edge_clearance=2.5, reachable=((0, ((5.0, 20.0),)), (3, ())))
    """

    fingers: int = 4
    max_span: float | None = None
    edge_clearance: float = 0.0
    fingertip_separation: float = 0.0
    reachable: ReachableLike = None

    def __post_init__(self) -> None:
        try:
            fingers = operator.index(self.fingers)
        except TypeError as error:
            raise HandError(f"fingers must be an integer, got {self.fingers!r}") from error
        if isinstance(self.fingers, bool) or fingers < 3:
            raise HandError(
                f"a hand needs at least 3 fingers to regrasp, got {self.fingers!r}: "
                "use Hand(fingers=k) with k >= 3"
            )
        span = None if self.max_span is None else _length("max_span", self.max_span)
        separation = _length("fingertip_separation", self.fingertip_separation)
        if span is not None and span <= separation:
            raise HandError(
                f"max_span = {span:g} must be larger than fingertip_separation = {separation:g}: "
                "no two fingers could touch at once"
            )
        normal = {
            "fingers": fingers,
            "max_span": span,
            "edge_clearance": _length("edge_clearance", self.edge_clearance),
            "fingertip_separation": separation,
            "reachable": _intervals_by_edge(self.reachable),
        }
        for name, value in normal.items():
            object.__setattr__(self, name, value)

    @property
    def intervals(self) -> dict[int, Intervals]:
        """The positions that may be touched, of the edges that `reachable` names."""
        return dict(self.reachable or ())

    @property
    def limited(self) -> bool:
        """Whether anything but the number of fingers limits the hand."""
        return self != Hand(self.fingers)

    @property
    def spaced(self) -> bool:
        """Whether there are limits to the distance between two fingers."""
        return self.max_span is not None or self.fingertip_separation > 0

    @property
    def adjacent(self) -> NDArray[np.bool_]:
        """``adjacent[n, m]``: whether all grasps of so many contacts are, shape (4, 4).

        There is none to hold, and no limit to the distance between the fingers of the two.
        """
        return np.asarray((self.needs == 0) & (not self.spaced))

    def held(self, contacts: int, others: int) -> int:
        """Return how many contacts two grasps must share for a switch between them.

        ``max(0, n_S + n_T - k)``: while it switches, the hand touches both grasps at once.
        """
        return max(0, contacts + others - self.fingers)

    @property
    def needs(self) -> NDArray[np.intp]:
        """``needs[n, m]``: the same for grasps of up to three contacts, shape (4, 4)."""
        touching = np.add.outer(np.arange(4), np.arange(4))
        return np.asarray(np.maximum(0, touching - self.fingers))

    def to_document(self) -> dict[str, Any]:
        """Return the hand as files have it: plain values, limits only where there are some."""
        document: dict[str, Any] = {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if field.name == "fingers" or getattr(self, field.name) != field.default
        }
        if "reachable" in document:
            document["reachable"] = [
                {"edge": edge, "intervals": [list(interval) for interval in intervals]}
                for edge, intervals in self.intervals.items()
            ]
        return document

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Hand:
        """Return the hand that `to_document` described.

        Raises
        ------
        KeyError, TypeError, HandError
            If it is no such description.
        """
        unknown = sorted(set(document) - {field.name for field in fields(cls)})
        if unknown:
            raise HandError(f"a hand has no {', '.join(unknown)}")
        values = {"fingers": document["fingers"], **document}
        if "reachable" in values:
            entries = values["reachable"]
            values["reachable"] = [(entry["edge"], entry["intervals"]) for entry in entries]
        return cls(**values)

    def __repr__(self) -> str:
        shown = [
            f"{field.name}={getattr(self, field.name)!r}"
            for field in fields(self)
            if field.name == "fingers" or getattr(self, field.name) != field.default
        ]
        return f"Hand({', '.join(shown)})"


def _length(name: str, value: object) -> float:
    """A finite length >= 0; `max_span` has to be more."""
    number = _number(value)
    if number is None or number < 0 or (name == "max_span" and number == 0):
        least = "larger than 0" if name == "max_span" else "of at least 0"
        raise HandError(f"{name} must be a finite length {least}, got {value!r}")
    return number


def _number(value: object) -> float | None:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        return None
    number = float(value)
    return number + 0.0 if math.isfinite(number) else None


def _intervals_by_edge(reachable: ReachableLike) -> tuple[tuple[int, Intervals], ...] | None:
    """What may be touched in the form in which it is kept; None if nothing is said."""
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


def _intervals(edge: int, value: object) -> Intervals:
    """One interval, several or none; those that overlap or touch become one."""
    if value is None:
        return ()
    entries = list(value) if isinstance(value, Iterable) else [value]
    if len(entries) == 2 and all(_number(entry) is not None for entry in entries):
        entries = [entries]
    merged: list[tuple[float, float]] = []
    for low, high in sorted(_interval(edge, entry) for entry in entries):
        if merged and low <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(high, merged[-1][1]))
        else:
            merged.append((low, high))
    return tuple(merged)


def _interval(edge: int, entry: object) -> tuple[float, float]:
    ends = list(entry) if isinstance(entry, Iterable) else []
    if len(ends) == 2:
        low, high = _number(ends[0]), _number(ends[1])
        if low is not None and high is not None and 0 <= low < high:
            return low, high
    raise HandError(
        f"reachable[{edge}] must be None, an interval of positions (first, last) with "
        f"0 <= first < last, or several of them; got {entry!r}"
    )
