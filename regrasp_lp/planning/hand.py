"""The hand: how many fingers it has, and what limits where they may be."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.errors import HandError
from regrasp_lp.planning.touching import (
    ByFinger,
    Intervals,
    Reach,
    ReachableLike,
    finger_numbers,
    finite_number,
    intervals_by_edge,
    reach_by_finger,
    reach_entries,
    reach_from,
    shared_intervals,
)


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
    finger_reachable : mapping of int to such a mapping, optional
        The same of single fingers, in addition to `reachable`. Kept as a tuple of (finger, what
        `reachable` is kept as).
    only_place : iterable of int
        Fingers that do not slide: while they touch, they stay where they are.
    only_slide : iterable of int
        Fingers that are neither placed nor released: those that touch at the start slide along
        their edge and are always among the fingers that support the object; the others are idle.

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
    >>> Hand(finger_reachable={1: {0: None}, 2: {0: None}}, only_place=[4]).groups
    ((1, 2), (3,), (4,))
    """

    fingers: int = 4
    max_span: float | None = None
    edge_clearance: float = 0.0
    fingertip_separation: float = 0.0
    reachable: ReachableLike = None
    finger_reachable: ByFinger = ()
    only_place: Iterable[int] = ()
    only_slide: Iterable[int] = ()

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
            "reachable": intervals_by_edge(self.reachable),
            "finger_reachable": reach_by_finger(self.finger_reachable, fingers),
            "only_place": finger_numbers("only_place", self.only_place, fingers),
            "only_slide": finger_numbers("only_slide", self.only_slide, fingers),
        }
        for name, value in normal.items():
            object.__setattr__(self, name, value)
        for finger in self._placed:
            if finger in self._slid:
                raise HandError(
                    f"finger {finger} is in only_place and in only_slide: it could not move at all"
                )

    @property
    def _reach_of_fingers(self) -> tuple[tuple[int, Reach], ...]:
        return self.finger_reachable  # type: ignore[return-value]  # as kept by __post_init__

    @property
    def _placed(self) -> tuple[int, ...]:
        return self.only_place  # type: ignore[return-value]

    @property
    def _slid(self) -> tuple[int, ...]:
        return self.only_slide  # type: ignore[return-value]

    @property
    def intervals(self) -> dict[int, Intervals]:
        """The positions that any finger may touch, of the edges that `reachable` names."""
        return dict(self.reachable or ())

    def intervals_of(self, finger: int) -> dict[int, Intervals]:
        """Return the positions that a finger may touch, of the edges that are named for it.

        Those of `reachable` that it may touch, too.
        """
        common = self.intervals
        for edge, own in dict(self._reach_of_fingers).get(finger, ()):
            common[edge] = shared_intervals(common[edge], own) if edge in common else own
        return common

    @property
    def limited(self) -> bool:
        """Whether anything but the number of fingers limits the hand."""
        return self != Hand(self.fingers)

    @property
    def spaced(self) -> bool:
        """Whether there are limits to the distance between two fingers."""
        return self.max_span is not None or self.fingertip_separation > 0

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """The fingers, those with the same limits together; groups by their first fingers."""
        reach = dict(self._reach_of_fingers)
        found: dict[object, list[int]] = {}
        for finger in range(1, self.fingers + 1):
            limits = reach.get(finger), finger in self._placed, finger in self._slid
            found.setdefault(limits, []).append(finger)
        return tuple(map(tuple, found.values()))

    def group_of(self, finger: int) -> int:
        """Return the number of the group of a finger."""
        return next(n for n, group in enumerate(self.groups) if finger in group)

    def placed_only(self, group: int) -> bool:
        """Whether the fingers of a group do not slide."""
        return self.groups[group][0] in self._placed

    def slid_only(self, group: int) -> bool:
        """Whether the fingers of a group are neither placed nor released."""
        return self.groups[group][0] in self._slid

    @property
    def coupled(self) -> bool:
        """Whether limits tie fingers or grasps to each other, and do not only shorten edges.

        Distances between fingers, fingers with limits of their own, fingers that do not slide or
        that are not placed.
        """
        return self.spaced or len(self.groups) > 1 or bool(self._placed or self._slid)

    @property
    def adjacent(self) -> NDArray[np.bool_]:
        """``adjacent[n, m]``: whether all grasps of so many contacts are, shape (4, 4).

        There is none to hold, and no limit that ties the fingers of the two.
        """
        return np.asarray((self.needs == 0) & (not self.coupled))

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
            document["reachable"] = reach_entries(self.intervals.items())
        if "finger_reachable" in document:
            document["finger_reachable"] = [
                {"finger": finger, "reachable": reach_entries(reach)}
                for finger, reach in self._reach_of_fingers
            ]
        for name in ("only_place", "only_slide"):
            if name in document:
                document[name] = list(document[name])
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
            values["reachable"] = reach_from(values["reachable"])
        if "finger_reachable" in values:
            values["finger_reachable"] = [
                (entry["finger"], reach_from(entry["reachable"]))
                for entry in values["finger_reachable"]
            ]
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
    number = finite_number(value)
    if number is None or number < 0 or (name == "max_span" and number == 0):
        least = "larger than 0" if name == "max_span" else "of at least 0"
        raise HandError(f"{name} must be a finite length {least}, got {value!r}")
    return number
