"""From grasps along a path to the steps of numbered fingers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.planning.fingers import Fingers
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.hops import Stop
from regrasp_lp.planning.plan import Support
from regrasp_lp.planning.steps import Place, Release, Slide, Step


class Execution:
    """Keeps track of the fingers while steps are written down.

    Parameters
    ----------
    sets : GraspSets
    hand : Hand
    start : dict of int to Contact
        The touching fingers.
    fingers : sequence of int
        The finger of each contact of the first set, in the set's order.
    index : int
        The first set.
    given : iterable of Contact, optional
        Start and goal, to be hit exactly (see `GraspSets.grasp`).
    """

    def __init__(
        self,
        sets: GraspSets,
        hand: Hand,
        start: dict[int, Contact],
        fingers: Sequence[int],
        index: int,
        given: Iterable[Contact] = (),
    ) -> None:
        self._sets, self._given = sets, tuple(given)
        self._of_hand = Fingers(sets, hand)
        self._touching = dict(start)
        self._fingers = list(fingers)
        self._index = index
        self.steps: list[Step] = []
        self.supports: list[Support] = [self._support()]

    def _support(self) -> Support:
        grasp_set = self._sets[self._index]
        return Support(grasp_set.kind, tuple(sorted(self._fingers)), grasp_set.center)

    def _do(self, step: Step) -> None:
        match step:
            case Place(finger, contact):
                self._touching[finger] = contact
            case Release(finger):
                del self._touching[finger]
            case Slide(moves):
                self._touching.update(moves)
        self.steps.append(step)
        self.supports.append(self._support())

    def release_others(self) -> None:
        """Release every finger that is not part of the current set's grasp."""
        for finger in sorted(set(self._touching) - set(self._fingers)):
            self._do(Release(finger))

    def slide(self, fractions: FloatArray) -> None:
        """Slide to another grasp of the current set."""
        moves = {}
        grasp = self._sets.grasp(self._index, fractions, self._given)
        for slot, contact in enumerate(grasp):
            if contact != self._touching[self._fingers[slot]]:
                moves[self._fingers[slot]] = contact
        if moves:
            self._do(Slide(moves))

    def hop(self, stop: Stop) -> None:
        """Go to another grasp: place its contacts that do not touch, then release the others."""
        placed = {contact: finger for finger, contact in self._touching.items()}
        new = [contact for contact in stop.contacts if contact not in placed]
        leaving = sorted(k for k, contact in self._touching.items() if contact not in stop.contacts)
        for contact in new:
            placed[contact] = self._of_hand.free(self._touching)
            if contact == new[-1] and not leaving:
                self._arrive(stop, placed)
            self._do(Place(placed[contact], contact))
        self._arrive(stop, placed)
        for finger in leaving:
            self._do(Release(finger))

    def _arrive(self, stop: Stop, placed: dict[Contact, int]) -> None:
        self._index, self._fingers = stop.index, [placed[contact] for contact in stop.support]

    def switch(
        self,
        index: int,
        held: Sequence[tuple[int, int]],
        fractions: FloatArray,
        goal: Grasp | None = None,
    ) -> None:
        """Switch to another set: place its contacts that are not held, then release the others.

        With a goal its other contacts are placed, too, before anything is released.
        """
        grasp = self._sets.grasp(index, fractions, self._given)
        groups = self._of_hand.groups(index).tolist()
        fingers = [0] * len(grasp)
        for here, there in held:
            fingers[there] = self._fingers[here]
        for finger in self._touching:  # a finger that happens to be where one is wanted stays
            where = [n for n, c in enumerate(grasp) if c == self._touching[finger]]
            if where and fingers[where[0]] == 0 and finger not in fingers:
                fingers[where[0]] = finger
        new = [slot for slot, finger in enumerate(fingers) if finger == 0]
        kept = set(goal or ())
        leaving = sorted(
            finger
            for finger, contact in self._touching.items()
            if finger not in fingers and contact not in kept
        )
        for slot in new:
            fingers[slot] = self._of_hand.free(self._touching, groups[slot])
            if slot == new[-1] and not leaving:
                self._fingers, self._index = fingers, index
            self._do(Place(fingers[slot], grasp[slot]))
        if goal is not None:
            self.place_others(goal)
        self._fingers, self._index = fingers, index
        for finger in leaving:
            self._do(Release(finger))

    def along(
        self,
        path: Sequence[int],
        held: Sequence[Sequence[tuple[int, int]]],
        grasps: Sequence[Sequence[FloatArray] | FloatArray],
        goal: Grasp,
        touching: tuple[bool, bool] = (False, False),
    ) -> None:
        """Slide and switch through grasps of a path of sets, to a goal that the last one holds.

        Parameters
        ----------
        path : sequence of int
            The sets; the first is the current one.
        held : sequence of sequence of (int, int)
            Per switch the held contacts.
        grasps : sequence of sequence of numpy.ndarray
            Per set the fractions of its grasps, from arriving to leaving.
        goal : Grasp
        touching : (bool, bool)
            See `Passage`.
        """
        if not touching[0]:
            self.release_others()
        for t, (index, nodes) in enumerate(zip(path, grasps, strict=True)):
            if t:
                last = touching[1] and t == len(path) - 1
                self.switch(index, held[t - 1], nodes[0], goal if last else None)
            for node in nodes[1:]:
                self.slide(node)
        self.place_others(goal)

    def place_others(self, goal: Grasp) -> None:
        """Place the contacts of the goal that are not part of the last set's grasp."""
        there = set(self._touching.values())
        some = [i for i, contact in enumerate(goal) if contact in there]
        groups = self._of_hand.groups(self._index)
        for contact, group in self._of_hand.placed(goal, some, groups) or ():
            self._do(Place(self._of_hand.free(self._touching, group), contact))
