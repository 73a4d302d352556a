"""Paths along which fingers that do not slide are taken off where they have to come back elsewhere.

Such a finger of the start, on a segment where the goal has a contact at another place, cannot be
held all the way. A path *clears* it if it passes through a set without a contact on that segment,
and after that it may come again. Sets are searched together with what has been cleared so far, as
layers of a graph: N sets and C such contacts have N 2^C nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.planning.fingers import Fingers
from regrasp_lp.planning.search import PathSearch, Weigh
from regrasp_lp.switches import Switches, SwitchPairs


def clearing_search(search: PathSearch, fingers: Fingers, start: Grasp, goal: Grasp) -> PathSearch:
    """Return a search whose paths clear the contacts of the start that cannot stay.

    Parameters
    ----------
    search : PathSearch
        Of sets.
    fingers : Fingers
    start, goal : Grasp
        Resolved.

    Returns
    -------
    PathSearch
        Of nodes: node n stands for set ``n % N``. The given one if there are no such contacts.

    Notes
    -----
    A switch that takes the finger off and puts another one on the same segment at once, in both of
    its sets, is not seen: a search that finds no path does not prove that there is none.
    """
    group = fingers.of_start(start)
    stuck = [
        i
        for i, contact in enumerate(start)
        if contact not in goal.contacts and fingers.hand.placed_only(int(group[i]))
    ]
    if not stuck:
        return search
    segments, _ = fingers.sets.cones.places(start.edges, start.fractions, group)
    without = np.concatenate(
        [
            (family.functions.edges[:, :, None] != segments[stuck]).all(axis=1)
            for family in fingers.sets.families
        ]
    )
    clears = without @ (1 << np.arange(len(stuck)))
    n, layers = len(clears), 1 << len(stuck)

    def tiled(margins: Mapping[int, float]) -> dict[int, float]:
        return {layer * n + i: value for i, value in margins.items() for layer in range(layers)}

    return replace(
        search,
        contacts=np.tile(search.contacts, layers),
        margins=np.tile(search.margins, layers),
        switches=_Layers(search.switches, clears),
        sources={int(clears[i]) * n + i: cost for i, cost in search.sources.items()},
        # Layers are reached through sets that clear; at the end all have to be cleared.
        targets={(layers - 1) * n + i: cost for i, cost in search.targets.items()},
        given=tiled(search.given),
        through=None if search.through is None else np.tile(search.through, layers),
        weigh=None if search.weigh is None else _weigher(search.weigh, n),
    )


def _weigher(weigh: Weigh, n: int) -> Weigh:
    def of_nodes(index: int, others: IntArray, held: IntArray) -> FloatArray:
        return weigh(index % n, others % n, held)

    return of_nodes


@dataclass(frozen=True, eq=False)
class _Layers:
    """Switches between nodes: sets, and which contacts have been cleared.

    Parameters
    ----------
    switches : Switches
    clears : numpy.ndarray of int, shape (N,)
        Of each set the contacts that it clears, as bits.
    """

    switches: Switches
    clears: IntArray

    def neighbors(self, index: int) -> tuple[IntArray, IntArray]:
        """As of the switches."""
        n = len(self.clears)
        layer, own = divmod(index, n)
        others, held = self.switches.neighbors(own)
        return (layer | self.clears[others]) * n + others, held

    def witness(self, i: int, j: int) -> tuple[IntArray, FloatArray] | None:
        """As of the switches."""
        return self.switches.witness(i % len(self.clears), j % len(self.clears))

    def pairs(self) -> Iterator[SwitchPairs]:
        """As of the switches: every pair of sets once."""
        return self.switches.pairs()
