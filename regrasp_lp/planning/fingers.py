"""Which finger does what: limits of single fingers along a path of grasp sets.

Contacts of a set are of *groups* of fingers with the same limits (`Hand.groups`): they say which
fingers may come to them. A finger that does not slide has one place from when it touches to when it
leaves, so that its contacts are one variable of the path LP.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import HandError
from regrasp_lp.friction import BoolArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.grasp_sets.spacing import assignments
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.reach import start_fingers


@dataclass(frozen=True, eq=False)
class Fingers:
    """The fingers of a hand on one object.

    Parameters
    ----------
    sets : GraspSets
    hand : Hand
    """

    sets: GraspSets
    hand: Hand

    def groups(self, index: int) -> IntArray:
        """Return the group of each contact of a set, shape (m,)."""
        return np.asarray(self.sets.cones.group[self.sets.functions(index).edges[0]])

    def of_start(self, start: Grasp) -> IntArray:
        """Return the group of the finger at each contact of the start."""
        return np.array([self.hand.group_of(k) for k in start_fingers(start)], dtype=np.intp)

    def starts(self, start: Grasp) -> list[tuple[int, tuple[int, ...]]]:
        """Return the sets that hold the start, as `GraspSets.holding`."""
        return self.sets.holding(start, self.of_start(start))

    def goals(self, goal: Grasp) -> list[tuple[int, tuple[int, ...]]]:
        """Return the sets that hold the goal, with fingers left for its other contacts."""
        found = self.sets.holding(goal)
        if len(self.hand.groups) == 1 and not self.hand.only_slide:
            return found
        return [
            (i, some) for i, some in found if self.placed(goal, some, self.groups(i)) is not None
        ]

    def placed(
        self, goal: Grasp, some: Iterable[int], used: IntArray
    ) -> list[tuple[Contact, int]] | None:
        """Return the contacts of a goal that are not there yet, each with a group that may come.

        Parameters
        ----------
        goal : Grasp
        some : iterable of int
            The contacts that are there.
        used : numpy.ndarray of int
            The groups of the touching fingers.

        Returns
        -------
        list of (Contact, int) or None
            None if no such fingers are left.
        """
        rest = [i for i in range(len(goal)) if i not in set(some)]
        if not rest:
            return []
        groups = self.hand.groups
        free = np.array([0 if self.hand.slid_only(n) else len(g) for n, g in enumerate(groups)])
        free = np.maximum(free - np.bincount(used, minlength=len(groups)), 0)
        ways = assignments(self.sets.cones, free.tolist(), goal.edges[rest], goal.fractions[rest])
        if not ways:
            return None
        group = self.sets.cones.group[ways[0][0]]
        return [(goal.contacts[i], int(g)) for i, g in zip(rest, group, strict=True)]

    def staying(self, index: int) -> tuple[int, ...]:
        """Return which contacts of a set do not slide."""
        return tuple(n for n, g in enumerate(self.groups(index)) if self.hand.placed_only(int(g)))

    def passable(self, start: Grasp) -> BoolArray | None:
        """Return the sets of which all fingers that only slide are part, and no idle one is.

        Those that touch at the start stay on their edges; the others never touch.

        Returns
        -------
        numpy.ndarray of bool, shape (N,), or None
            None if all fingers may be placed.
        """
        slid = [n for n in range(len(self.hand.groups)) if self.hand.slid_only(n)]
        if not slid:
            return None
        group, cones = self.of_start(start), self.sets.cones
        segments, _ = cones.places(start.edges, start.fractions, group)
        needed = sorted(segments[np.isin(group, slid)].tolist())
        parts = []
        for family in self.sets.families:
            edges = family.functions.edges
            of_slid = np.isin(cones.group[edges], slid)
            same = of_slid.sum(axis=1) == len(needed)
            if len(needed) <= family.functions.m:
                mine = np.sort(np.where(of_slid, edges, np.iinfo(np.intp).max), axis=1)
                same &= (mine[:, : len(needed)] == needed).all(axis=1)
            parts.append(same)
        return np.concatenate(parts)

    def free(self, touching: Iterable[int], group: int | None = None) -> int:
        """Return the first finger that does not touch, of one group or of any.

        Raises
        ------
        HandError
            If all of them touch.
        """
        busy = set(touching)
        among: Sequence[int] = range(1, self.hand.fingers + 1)
        if group is not None:
            among = self.hand.groups[group]
        for finger in among:
            if finger not in busy:
                return finger
        raise HandError(
            f"all of fingers {', '.join(map(str, among))} touch the object: none of them is free "
            "to be placed; give the hand more fingers"
        )
