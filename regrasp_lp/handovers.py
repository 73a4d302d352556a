"""Every way to switch between two grasp sets: which contacts are held, from where to where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regrasp_lp.completion import complete
from regrasp_lp.contact import Grasp
from regrasp_lp.contact_rule import meet_held
from regrasp_lp.couplings import best_couplings
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.grasp_sets.pieces import BARELY_APART
from regrasp_lp.joins import best_joins
from regrasp_lp.lp import GAP, Solver
from regrasp_lp.shadows import Shadows, places_of, shadows


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
        which a thousandth of it may be given up).
    first, second : numpy.ndarray, shape (m,)
        Fractions of such grasps, equal in the held contacts.
    way : int, optional
        Which of the sets that `GraspSets.coupled` returns contains them, if the hand limits the
        distance between fingers.
    """

    slots: tuple[tuple[int, int], ...]
    margin: float
    first: FloatArray
    second: FloatArray
    way: int | None = None

    @property
    def held(self) -> int:
        """Number of held contacts."""
        return len(self.slots)


@dataclass(frozen=True, eq=False)
class Switch:
    """All ways in which a hand can switch between two grasp sets.

    Parameters
    ----------
    first, second : int
        Numbers of the sets.
    edges : tuple of tuple of int
        Edges of the held contacts, one entry for each feasible choice, in the order of `handovers`.
    grasps : tuple of (Grasp, Grasp)
        For each choice the two grasps with the largest margin; equal in the held contacts.
    handovers : tuple of Handover
        The choices; most held contacts first, then largest margin.
    """

    first: int
    second: int
    edges: tuple[tuple[int, ...], ...]
    grasps: tuple[tuple[Grasp, Grasp], ...]
    handovers: tuple[Handover, ...]

    def __repr__(self) -> str:
        ways = ", ".join(str(edges) for edges in self.edges)
        return f"<Switch {self.first} to {self.second}: hold {ways}; margin {self.margin:.4g}>"

    @property
    def held(self) -> int:
        """The largest number of contacts that can be held."""
        return self.handovers[0].held

    @property
    def margin(self) -> float:
        """The largest margin over all choices."""
        return max(handover.margin for handover in self.handovers)

    @property
    def witnesses(self) -> tuple[Grasp, Grasp]:
        """The two grasps of the choice with the largest margin."""
        best = max(range(len(self.handovers)), key=lambda i: self.handovers[i].margin)
        return self.grasps[best]


def every_handover(
    sets: GraspSets,
    solver: Solver,
    first: int,
    second: int,
    held: tuple[int, int],
    min_margin: float = 0.0,
) -> Switch:
    """Return all ways to switch between two adjacent sets.

    Parameters
    ----------
    sets : GraspSets
    solver : Solver
    first, second : int
        Numbers of the two sets.
    held : (int, int)
        The least and the largest number of contacts to hold.
    min_margin : float
        Ways of larger margin only, unless there is none.
    """
    least, most = held
    every = [
        handover
        for number in range(most, least - 1, -1)
        for handover in handovers(sets, solver, first, second, number)
    ]
    found = [h for h in every if h.margin > min_margin] or every[:1]
    edges = sets[first].edges
    return Switch(
        first,
        second,
        tuple(tuple(edges[here] for here, _ in h.slots) for h in found),
        tuple((sets.grasp(first, h.first), sets.grasp(second, h.second)) for h in found),
        tuple(found),
    )


def witnesses(
    sets: GraspSets, first: int, second: int, held: tuple[IntArray, FloatArray] | None
) -> tuple[Grasp, Grasp]:
    """Return two grasps, one in each set, that are equal in the contacts that a switch can hold.

    Parameters
    ----------
    sets : GraspSets
    first, second : int
        Numbers of the two sets.
    held : (numpy.ndarray of int, numpy.ndarray) or None
        Which contacts of the set with the smaller number are held and where (`Switches.witness`).
    """
    low, high = sorted((first, second))
    slots, points = held or (np.zeros(0, dtype=np.int8), np.zeros(0))
    edges = sets.functions(low).edges[0, slots]
    grasps = {}
    for index in (low, high):
        functions = sets.functions(index)
        there = places_of(edges[None, :], functions.edges)
        fractions = complete(functions, there, points[None, :])
        grasps[index] = sets.grasp(index, fractions[0])
    return grasps[first], grasps[second]


def handovers(
    sets: GraspSets, solver: Solver, first: int, second: int, held: int
) -> list[Handover]:
    """Return every feasible way to switch between two sets that holds so many contacts.

    Parameters
    ----------
    sets : GraspSets
    solver : Solver
        Finds margins and witnesses; what is feasible is decided exactly.
    first, second : int
        Numbers of the two sets.
    held : int
        0 to 3.

    Returns
    -------
    list of Handover
        The largest margin first.
        A switch that exists only within rounding may have a margin that is not
        positive, and grasps that only nearly hold.
    """
    if held == 0 and sets.spacing is None:
        margin = float(min(sets.margins[first], sets.margins[second]))
        return [Handover((), margin, _witness(sets, first), _witness(sets, second))]
    one, other = (_projections(sets, index, held) for index in (first, second))
    if not (len(one) and len(other)):
        return []
    i, j = np.nonzero((one.edges[:, None, :] == other.edges[None, :, :]).all(axis=2))
    one, other = one.take(i), other.take(j)
    if sets.spacing is not None:
        return _spaced(sets, solver, one, other)
    joins = best_joins(one, other, solver, apart=BARELY_APART)
    feasible = meet_held(one, other, solver=solver).exist
    if feasible.any() and not np.isfinite(joins.margins[feasible]).any():
        # It exists, but within rounding: the nearest grasps are the best that can be said.
        least = -GAP * sets.sources[0].cones.size
        joins = best_joins(one, other, solver, apart=BARELY_APART, least=least)
    found = [
        Handover(
            tuple(zip(one.slots[n].tolist(), other.slots[n].tolist(), strict=True)),
            float(joins.margins[n]),
            joins.first[n, : one.sources[one.source[n]].m],
            joins.second[n, : other.sources[other.source[n]].m],
        )
        for n in np.flatnonzero(feasible & np.isfinite(joins.margins))
    ]
    found.sort(key=lambda h: (-h.margin, h.slots))
    # What exists is decided without regard to the order of two contacts on one edge; a choice of
    # slots that exists in the other order only has a negative margin here.
    return [h for h in found if h.margin > 0] or found[:1]


def _spaced(sets: GraspSets, solver: Solver, one: Shadows, other: Shadows) -> list[Handover]:
    """The same for a hand that limits the distance between fingers."""
    best = best_couplings(sets, one, other, solver)
    found = [
        Handover(
            tuple(zip(one.slots[n].tolist(), other.slots[n].tolist(), strict=True)),
            float(best.margins[n]),
            best.first[n, : one.sources[one.source[n]].m],
            best.second[n, : other.sources[other.source[n]].m],
            int(best.choices[n]),
        )
        for n in np.flatnonzero(best.margins > 0)
    ]
    return sorted(found, key=lambda h: (-h.margin, h.slots))


def _projections(sets: GraspSets, index: int, held: int) -> Shadows:
    family, row = sets.place(index)
    none: IntArray = np.zeros(0, dtype=np.intp)
    rows = [np.array([row]) if f == family else none for f in range(len(sets.families))]
    return shadows(sets.sources, held, rows, ordered=True)


def _witness(sets: GraspSets, index: int) -> FloatArray:
    family, row = sets.place(index)
    witness: FloatArray = sets.families[family].witnesses[row]
    return witness
