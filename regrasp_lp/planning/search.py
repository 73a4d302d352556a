"""Search of a path of grasp sets with the fewest placements."""

from __future__ import annotations

import heapq
from collections.abc import Mapping

import numpy as np

from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.planning.hand import Hand
from regrasp_lp.switches import Switches

_UNREACHED = np.iinfo(np.int64).max


def fewest_placements(
    contacts: IntArray,
    margins: FloatArray,
    switches: Switches,
    hand: Hand,
    sources: Mapping[int, int],
    targets: Mapping[int, int],
    given: Mapping[int, float] | None = None,
) -> list[int] | None:
    """Return a path of sets with the fewest placements, or None if there is none.

    A switch from S to T places ``n_T - held`` fingers. Among paths with equally many placements
    one whose least set margin is largest is taken, then the one with the smaller set numbers:
    Dijkstra's algorithm on labels (placements, -least margin), which order the same after any
    common extension.

    Parameters
    ----------
    contacts : numpy.ndarray of int, shape (N,)
        Number of contacts of each set.
    margins : numpy.ndarray, shape (N,)
        Sets with -inf are left out.
    switches : Switches
    hand : Hand
    sources, targets : mapping of int to int
        Sets where a path may begin and end, with the placements needed before and after.
    given : mapping of int to float, optional
        Margin of the given grasp in a source or target, which no choice of contacts can raise.

    Returns
    -------
    list of int or None
    """
    _, before = _settle(contacts, margins, switches, hand, sources, targets, given or {})
    return _trace(before, len(contacts))


def placements_from(
    contacts: IntArray,
    margins: FloatArray,
    switches: Switches,
    hand: Hand,
    sources: Mapping[int, int],
    most: int | None = None,
) -> IntArray:
    """Return the fewest placements with which each set is reached, -1 for sets that are not.

    Parameters
    ----------
    contacts, margins, switches, hand, sources
        As for `fewest_placements`.
    most : int, optional
        Look at the neighbours of so many sets only, the nearest ones: farther sets may then need
        fewer placements than returned, or be reached after all.

    Returns
    -------
    numpy.ndarray of int, shape (N,)
    """
    placements, _ = _settle(contacts, margins, switches, hand, sources, {}, {}, most)
    return np.where(placements == _UNREACHED, -1, placements)[:-1]


def _settle(
    contacts: IntArray,
    margins: FloatArray,
    switches: Switches,
    hand: Hand,
    sources: Mapping[int, int],
    targets: Mapping[int, int],
    given: Mapping[int, float],
    most: int | None = None,
) -> tuple[IntArray, IntArray]:
    """Placements needed to reach each set, and the set before it on the way (-1: none).

    Entry N stands for the end of a path. The search stops once it is reached, or once the
    neighbours of `most` sets have been looked at.
    """
    n = len(contacts)
    placements = np.full(n + 1, _UNREACHED)
    least = np.full(n + 1, -np.inf)
    before = np.full(n + 1, -1)
    of_size = {m: np.flatnonzero(contacts == m) for m in (2, 3)}
    queue: list[tuple[int, float, int]] = []

    def relax(node: int, others: IntArray, cost: IntArray, margin: FloatArray) -> None:
        better = (cost < placements[others]) | (
            (cost == placements[others]) & (margin > least[others])
        )
        better &= margin > -np.inf
        others, cost, margin = others[better], cost[better], margin[better]
        placements[others], least[others], before[others] = cost, margin, node
        for item in zip(cost.tolist(), (-margin).tolist(), others.tolist(), strict=True):
            heapq.heappush(queue, item)

    for index, cost in sorted(sources.items()):
        limit = given.get(index, np.inf)
        relax(-1, np.array([index]), np.array([cost]), np.minimum(margins[[index]], limit))
    looked_at = 0
    while queue and looked_at != most:
        cost, negative, node = heapq.heappop(queue)
        if (cost, -negative) != (placements[node], least[node]):
            continue
        if node == n:
            break
        looked_at += 1
        reached = least[node]
        if node in targets:
            end = min(reached, given.get(node, np.inf))
            relax(node, np.array([n]), np.array([cost + targets[node]]), np.array([end]))
        others, held = switches.neighbors(node)
        relax(node, others, cost + contacts[others] - held, np.minimum(reached, margins[others]))
        for m, all_ in of_size.items():
            if hand.held(int(contacts[node]), m) == 0:
                others = all_[all_ != node]
                free = np.full(len(others), cost + m)
                relax(node, others, free, np.minimum(reached, margins[others]))
    return placements, before


def _trace(before: IntArray, end: int) -> list[int] | None:
    path, node = [], int(before[end])
    while node >= 0:
        path.append(node)
        node = int(before[node])
    return path[::-1] or None
