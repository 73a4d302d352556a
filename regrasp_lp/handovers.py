"""Every way to switch between two grasp sets: which contacts are held, from where to where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.joins import Joins, best_joins
from regrasp_lp.lp import Solver
from regrasp_lp.shadows import Shadows, shadows
from regrasp_lp.switching import can_switch

_APART = 1e-6
"""Contacts on one edge are kept apart by at least this part of it."""


@dataclass(frozen=True, eq=False)
class Handover:
    """One way to switch from one set to another, with the best grasps for it.

    Parameters
    ----------
    slots : tuple of (int, int)
        Each held contact as its place in the first and in the second set; contacts of a set are
        in ascending order of their edges, two on one edge in their order along it.
    margin : float
        The largest margin that both grasps can have at once, their contacts not coinciding (for
        which a ten-thousandth of it may be given up).
    first, second : numpy.ndarray, shape (m,)
        Fractions of such grasps, equal in the held contacts.
    """

    slots: tuple[tuple[int, int], ...]
    margin: float
    first: FloatArray
    second: FloatArray

    @property
    def held(self) -> int:
        """Number of held contacts."""
        return len(self.slots)


def handovers(
    sets: GraspSets, solver: Solver, first: int, second: int, held: int
) -> list[Handover]:
    """Return every feasible way to switch between two sets that holds so many contacts.

    Parameters
    ----------
    sets : GraspSets
    solver : Solver
        Finds margins and witnesses; what is feasible is decided exactly (with three held
        contacts: by the margin LP).
    first, second : int
        Numbers of the two sets.
    held : int
        0 to 3.

    Returns
    -------
    list of Handover
        The largest margin first.
    """
    if held == 0:
        margin = float(min(sets.margins[first], sets.margins[second]))
        return [Handover((), margin, *(_witness(sets, i) for i in (first, second)))]
    one, other = (_projections(sets, index, held) for index in (first, second))
    if not (len(one) and len(other)):
        return []
    i, j = np.nonzero((one.edges[:, None, :] == other.edges[None, :, :]).all(axis=2))
    one, other = one.take(i), other.take(j)
    feasible = np.flatnonzero(decide_held(one, other, solver))
    if not feasible.size:
        return []
    one, other = one.take(feasible), other.take(feasible)
    found = _solved(one, other, best_joins(one, other, solver, apart=True))
    edges = [sets.sources[s.source[0]].edges[s.row[0]] for s in (one, other)]
    if any((e[1:] == e[:-1]).any() for e in edges):
        # Keeping contacts apart takes from the margin, though their distance is no part of it.
        free = _solved(one, other, best_joins(one, other, solver))
        found += [better for h in free if (better := _in_order(h, *edges)) is not None]
    best: dict[tuple[tuple[int, int], ...], Handover] = {}
    for handover in sorted(found, key=lambda h: (-h.margin, h.slots)):
        best.setdefault(handover.slots, handover)
    ways = list(best.values())
    # A choice of slots may exist in the other order only: then its margin here is negative.
    return [h for h in ways if h.margin > 0] or ways[:1]


def _solved(one: Shadows, other: Shadows, joins: Joins) -> list[Handover]:
    return [
        Handover(
            tuple(zip(one.slots[n].tolist(), other.slots[n].tolist(), strict=True)),
            float(joins.margins[n]),
            joins.first[n, : one.sources[one.source[n]].m],
            joins.second[n, : other.sources[other.source[n]].m],
        )
        for n in np.flatnonzero(np.isfinite(joins.margins))
    ]


def _in_order(handover: Handover, edges: IntArray, others: IntArray) -> Handover | None:
    """The same grasps with two contacts on one edge in their order and apart, if that costs nothing.

    Where two contacts coincide the grasp is that of two contacts: functions that attain its margin
    act at only one of them, so that the other one, unless it is held, may as well go to the end
    of the edge.
    """
    grasps = []
    places = []
    for side, (of, fractions) in enumerate(((edges, handover.first), (others, handover.second))):
        f = fractions.copy()
        held = {slots[side] for slots in handover.slots}
        for i in np.flatnonzero((of[1:] == of[:-1]) & (np.abs(np.diff(f)) < _APART)).tolist():
            free = [slot for slot in (i, i + 1) if slot not in held]
            if not free:
                return None
            f[free[0]] = 0.0 if f[i + 1] > 0.5 else 1.0
            if len(free) == 2:
                f[free[1]] = 1.0 - f[free[0]]
        order = np.lexsort((f, of))
        grasps.append(f[order])
        places.append(np.argsort(order).tolist())
    slots = tuple(sorted((places[0][here], places[1][there]) for here, there in handover.slots))
    return Handover(slots, handover.margin, grasps[0], grasps[1])


def decide_held(first: Shadows, second: Shadows, solver: Solver) -> BoolArray:
    """Whether aligned projections have a common point: exactly, or by LP if three are held."""
    if first.held < 3:
        return can_switch(first, second)
    return best_joins(first, second, solver).exist


def _projections(sets: GraspSets, index: int, held: int) -> Shadows:
    family, row = sets.place(index)
    none: IntArray = np.zeros(0, dtype=np.intp)
    rows = [np.array([row]) if f == family else none for f in range(len(sets.families))]
    return shadows(sets.sources, held, rows, ordered=True)


def _witness(sets: GraspSets, index: int) -> FloatArray:
    family, row = sets.place(index)
    witness: FloatArray = sets.families[family].witnesses[row]
    return witness
