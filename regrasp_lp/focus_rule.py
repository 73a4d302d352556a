"""The chapter's rule for switching: the interiors of two focus cells meet.

For a hand of four fingers two concurrent sets with two common edges are adjacent, and a concurrent
and a two-finger set with at least one, iff some point q is inside both focus cells (sections
3.3.2.1 and 3.3.2.2): held fingers stay in their regions of q. All other pairs follow the contact
rule. Contacts may be held also where the two grasps have no focus point in common, so that the
edges of this rule are a subset of those of the contact rule.

On a common edge the two sides of a double-sided cone have no interior point in common. So two
concurrent sets over (a, b, c) and (a, b, d) are adjacent iff four regions, one to an edge, meet;
and so are a concurrent and a two-finger set, whose narrower cone lies in that of the common edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regrasp_lp.friction import BoolArray, Cones, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.grasp_sets.focus import two_finger_sweeps
from regrasp_lp.grasp_sets.sweeps import Sweeps, sides_of
from regrasp_lp.lp import Solver, maximise_margins
from regrasp_lp.shadows import Shadows

CONCURRENT = "concurrent"
TWO_FINGER = "two_finger"

_CHUNK = 2000  # pairs of sets whose LPs are stated at once


@dataclass(frozen=True, eq=False)
class FocusRule:
    """Decides which pairs of concurrent and two-finger sets have focus cells that meet.

    Parameters
    ----------
    cones : Cones
    kinds : tuple of str
        Kind of the sets of each source of the projections.
    pairs : numpy.ndarray of int, shape (N, 2)
        Edges of the two-finger sets.
    """

    cones: Cones
    kinds: tuple[str, ...]
    pairs: IntArray

    @classmethod
    def of(cls, sets: GraspSets) -> FocusRule:
        """Return the rule for the chapter's sets of an object."""
        kinds = tuple(family.kind for family in sets.families)
        functions = sets.sources[kinds.index(TWO_FINGER)]
        return cls(functions.cones, kinds, functions.edges)

    @cached_property
    def _sweeps(self) -> Sweeps:
        """The regions of the friction cones, then those of the two-finger sets."""
        return Sweeps.of_cones(self.cones).join(two_finger_sweeps(self.cones, self.pairs))

    def applies(self, first: Shadows, second: Shadows) -> BoolArray:
        """Whether pairs of sets are subject to this rule, shape (P,).

        One of them is concurrent, the other concurrent or a two-finger set.
        """
        concurrent = np.array([kind == CONCURRENT for kind in self.kinds])
        planar = np.array([kind in (CONCURRENT, TWO_FINGER) for kind in self.kinds])
        one, other = first.source, second.source
        either = concurrent[one] | concurrent[other]
        return np.asarray(either & planar[one] & planar[other])

    def decide(self, first: Shadows, second: Shadows, solver: Solver | None = None) -> BoolArray:
        """Whether the interiors of the focus cells of aligned pairs meet.

        Parameters
        ----------
        first, second : Shadows
            Pairs to which the rule applies, held on common edges: two of two concurrent sets, at
            least one of a concurrent and a two-finger set.
        solver : Solver, optional
            Decides by margin LPs in the plane, to the accuracy of these; by default the decision
            is exact.

        Returns
        -------
        numpy.ndarray of bool, shape (P,)
        """
        found = np.zeros(len(first), dtype=bool)
        for rows, regions in self._questions(first, second):
            if solver is None:
                found[rows] = self._sweeps.any_meet(regions)
                continue
            for part in np.array_split(np.arange(len(rows)), len(rows) // _CHUNK + 1):
                found[rows[part]] = self._any_meet_by_lp(regions[part], solver)
        return found

    def _any_meet_by_lp(self, regions: IntArray, solver: Solver) -> BoolArray:
        """Whether some choice of regions has an intersection of positive margin, by LP."""
        k, c, r = regions.shape
        solutions = maximise_margins(self._sweeps.linear_sets(regions.reshape(k * c, r)), solver)
        return np.asarray(solutions.positive.reshape(k, c).any(axis=1))

    def _questions(self, first: Shadows, second: Shadows) -> list[tuple[IntArray, IntArray]]:
        """Rows of pairs, and the choices of four regions of which one has to meet."""
        names = np.array(self.kinds)
        concurrent = names[first.source] == CONCURRENT, names[second.source] == CONCURRENT
        cases = (
            (concurrent[0] & concurrent[1], self._of_triples, first, second),
            (concurrent[0] & ~concurrent[1], self._of_triple_and_pair, first, second),
            (~concurrent[0] & concurrent[1], self._of_triple_and_pair, second, first),
        )
        return [
            (rows := np.flatnonzero(case), regions(one.take(rows), other.take(rows)))
            for case, regions, one, other in cases
            if case.any()
        ]

    def _of_triples(self, first: Shadows, second: Shadows) -> IntArray:
        edges = np.column_stack((first.edges, _free_edges(first), _free_edges(second)))
        return 2 * edges[:, None, :] + sides_of(4)

    def _of_triple_and_pair(self, triple: Shadows, pair: Shadows) -> IntArray:
        """The regions of the pair on one side or the other, those of the triple on any.

        With one held contact there are two other edges of the triple, with two there is one: it
        then stands twice, on sides that have to be equal to meet.
        """
        free = _free_edges(triple)
        free = free[:, [0, -1]]
        sides = sides_of(3)
        of_pair = 4 * pair.row[:, None, None] + np.array([0, 2]) + sides[:, :1]
        return np.concatenate(
            (2 * free[:, None, :] + sides[:, 1:], 2 * self.cones.n_edges + of_pair), axis=2
        )


def _free_edges(shadows: Shadows) -> IntArray:
    """Edges of the contacts that are not held, shape (P, m - h)."""
    edges = np.zeros((len(shadows), 3), dtype=np.intp)
    for number, functions in enumerate(shadows.sources):
        mine = shadows.source == number
        edges[mine, : functions.m] = functions.edges[shadows.row[mine]]
    kept = np.ones(edges.shape, dtype=bool)
    np.put_along_axis(kept, shadows.slots, False, axis=1)
    return edges[kept].reshape(len(shadows), 3 - shadows.held)
