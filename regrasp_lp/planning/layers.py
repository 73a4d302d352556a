"""Paths through layers by placements and widths, all of them, best first.

The layers of a path of grasp sets are the pieces in which its sets are entered and left; a width is
a margin.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from regrasp_lp.friction import FloatArray, IntArray

Slots = tuple[tuple[int, int], ...]
"""Held contacts, as places in the two sets of a switch."""

Cost = tuple[int, tuple[float, ...]]
"""Placements, then the negated widths, the least width first: smaller is better."""


@dataclass(frozen=True, eq=False)
class Crossing:
    """All ways from the elements of one layer to those of the next.

    Parameters
    ----------
    slots : tuple of Slots
        Of each way.
    placements : numpy.ndarray of int, shape (C,)
    widths : numpy.ndarray, shape (C, P, Q)
        Margin of each; -inf where there is none.
    """

    slots: tuple[Slots, ...]
    placements: IntArray
    widths: FloatArray


def best_first(
    first: FloatArray, crossings: Sequence[Crossing], last: FloatArray, unit: float
) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Yield all paths through layers, best first.

    Paths are compared by the sum of their placements, then by their widths: the least, the second
    least, and so on. How two ways compare does not change if both are continued alike. So a pass
    backwards finds the best completion from everywhere, and a search led by it goes nowhere else.

    Parameters
    ----------
    first, last : numpy.ndarray
        Widths of the elements of the first and the last layer; -inf of those that are not there.
    crossings : sequence of Crossing
        Between consecutive layers.
    unit : float
        Widths are compared rounded to multiples of it.

    Yields
    ------
    elements : tuple of int
        One a layer.
    ways : tuple of int
        One a crossing.
    """
    costs = [_costs(crossing.widths, unit) for crossing in crossings]
    to_go = [_ends(last, unit)]
    for crossing, cost in zip(reversed(crossings), reversed(costs), strict=True):
        to_go.append(_before(crossing.placements, cost, to_go[-1]))
    to_go.reverse()
    # An entry: cost with the best completion, the path so far, cost of it.
    queue: list[tuple[Cost, tuple[int, ...], tuple[int, ...], Cost]] = [
        (_sum(cost, to_go[0][element]), (element,), (), cost)
        for element, cost in _ends(first, unit).items()
        if element in to_go[0]
    ]
    heapq.heapify(queue)
    while queue:
        _, elements, ways, spent = heapq.heappop(queue)
        depth = len(ways)
        if depth == len(crossings):
            yield elements, ways
            continue
        here = costs[depth][:, elements[-1]]
        for way, placements in enumerate(crossings[depth].placements.tolist()):
            for other, completion in to_go[depth + 1].items():
                if here[way, other] < np.inf:
                    now = _sum(spent, (placements, (float(here[way, other]),)))
                    path = (*elements, other), (*ways, way)
                    heapq.heappush(queue, (_sum(now, completion), *path, now))


def _costs(widths: FloatArray, unit: float) -> FloatArray:
    """Widths as costs to compare: rounded, negative, inf where there is no way."""
    return np.where(widths > 0, -np.maximum(np.round(widths / unit), 1.0), np.inf)


def _ends(widths: FloatArray, unit: float) -> dict[int, Cost]:
    costs = _costs(widths, unit)
    return {n: (0, (float(costs[n]),)) for n in np.flatnonzero(costs < np.inf).tolist()}


def _before(placements: IntArray, costs: FloatArray, later: dict[int, Cost]) -> dict[int, Cost]:
    """The best completion of each element of a layer, from those of the next."""
    others = sorted(later)
    if not others:
        return {}
    total = placements[:, None, None] + np.array([later[n][0] for n in others])
    worst = np.maximum(costs[:, :, others], np.array([later[n][1][0] for n in others]))
    found: dict[int, Cost] = {}
    for element in range(costs.shape[1]):
        least = np.where(worst[:, element] < np.inf, total[:, 0], np.inf)
        level = np.where(least == least.min(), worst[:, element], np.inf)
        if level.min() < np.inf:
            # Only what ties so far has to be compared further.
            found[element] = min(
                _sum(
                    (int(placements[way]), (float(costs[way, element, others[n]]),)),
                    later[others[n]],
                )
                for way, n in np.argwhere(level == level.min()).tolist()
            )
    return found


def _sum(one: Cost, other: Cost) -> Cost:
    return one[0] + other[0], tuple(sorted(one[1] + other[1], reverse=True))
