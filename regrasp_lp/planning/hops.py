"""Repositioning without detours: the fewest placements over grasps that are known to hold.

A hand that keeps its fingers where they are until new ones are placed may go from a grasp to any
later one if it can touch both at once. So a sequence of grasps, each a small step from the one
before, is a supply of grasps to hop over.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from regrasp_lp.contact import Contact
from regrasp_lp.friction import BoolArray, IntArray
from regrasp_lp.planning.hand import Hand
from regrasp_lp.polygon import Polygon


@dataclass(frozen=True)
class Stop:
    """A grasp on the way.

    Parameters
    ----------
    index : int
        The grasp set that holds the object.
    contacts : tuple of Contact
        All that touch; resolved.
    support : tuple of Contact
        Those of the set, in its order.
    """

    index: int
    contacts: tuple[Contact, ...]
    support: tuple[Contact, ...]


def fewest_hops(polygon: Polygon, hand: Hand, stops: Sequence[Stop]) -> list[int] | None:
    """Return which stops to make, from the first to the last, with the fewest placements.

    A hop from grasp S to a later one T places ``|T| - |S ∩ T|`` fingers, and needs
    ``|S ∪ T| <= k`` fingers with no two at one point.

    Parameters
    ----------
    polygon : Polygon
    hand : Hand
    stops : sequence of Stop

    Returns
    -------
    list of int or None
        Numbers of stops; None if no hops lead from the first to the last.
    """
    size = np.array([len(stop.contacts) for stop in stops])
    contact = _labels(stops, lambda c: (c.edge, c.fraction))
    point = _labels(stops, lambda c: polygon.point(c).tobytes())
    placements = np.full(len(stops), np.iinfo(np.int64).max)
    before = np.full(len(stops), -1)
    placements[0] = 0
    for i in range(len(stops) - 1):
        if i and before[i] < 0:
            continue
        common = _shared(contact[i], contact[i + 1 :])
        possible = size[i] + size[i + 1 :] - common <= hand.fingers
        possible &= _shared(point[i], point[i + 1 :]) == common
        cost = placements[i] + size[i + 1 :] - common
        better: BoolArray = possible & (cost < placements[i + 1 :])
        placements[i + 1 :][better] = cost[better]
        before[i + 1 :][better] = i
    if len(stops) > 1 and before[-1] < 0:
        return None
    path = [len(stops) - 1]
    while path[-1] > 0:
        path.append(int(before[path[-1]]))
    return path[::-1]


def _labels(stops: Sequence[Stop], key: Callable[[Contact], Hashable]) -> IntArray:
    """Numbers of the contacts of each stop, equal where their keys are; -1 beyond."""
    numbers: dict[Hashable, int] = {}
    labels = np.full((len(stops), max(len(stop.contacts) for stop in stops)), -1)
    for i, stop in enumerate(stops):
        for j, contact in enumerate(stop.contacts):
            labels[i, j] = numbers.setdefault(key(contact), len(numbers))
    return labels


def _shared(one: IntArray, others: IntArray) -> IntArray:
    """How many labels of a stop each of the others has too."""
    same = (one[:, None] == others[:, None, :]) & (one[:, None] >= 0)
    return np.asarray(same.sum(axis=(1, 2)))
