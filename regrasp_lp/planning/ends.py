"""Start and goal of a search at a level: how a hand gets away from a grasp that is given.

A given grasp cannot be better than it is. So a slide away from it counts only where it falls below
the grasp it comes from: its other end is *visible* from there, that is, the straight slide stays
at the margin of the given grasp. To rest on a part of it, its other contacts released or not yet
placed, is a choice like any other: a switch to the set of that part.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp.linear_program import minimise
from regrasp_lp.planning.levels import ACCURACY, PieceRows
from regrasp_lp.planning.moves import Contacts, Moves, common_contacts
from regrasp_lp.torque import TorqueFunctions, torque_functions

_NAMES = ["f0", "f1", "f2"]

_ROUND = 4
"""So many linear programs are solved at a time."""

_FIRST = 64
"""So many neighbours are looked at first, then twice as many each time."""


@dataclass(frozen=True, eq=False)
class Support:
    """A grasp set that holds a given grasp.

    Parameters
    ----------
    rows : PieceRows
    index : int
        Number of the set.
    contacts : tuple of int
        The contacts of the given grasp in the order of the set.
    fractions : numpy.ndarray, shape (m,)
    """

    rows: PieceRows
    index: int
    contacts: tuple[int, ...]
    fractions: FloatArray
    _found: list[Landing] = field(default_factory=list)

    @cached_property
    def values(self) -> FloatArray:
        """Scaled values of the functions at the given contacts, shape (J,)."""
        m = len(self.fractions)
        return np.asarray(
            self.rows.offsets[self.index] + self.rows.slopes[self.index, :, :m] @ self.fractions
        )

    @cached_property
    def level(self) -> float:
        """Margin or tolerance of the given contacts."""
        valid = self.rows.valid[self.index]
        level = min(self.values[valid].max(), (-self.values[valid]).max())
        if self.rows.measure == "tolerance":
            lengths = self.rows.lengths[self.index, : len(self.fractions)]
            to_ends = np.minimum(self.fractions, 1 - self.fractions) * lengths
            level = min(level, float(to_ends.min()))
        return float(level)

    @property
    def part(self) -> Support:
        """What holds the object."""
        return self

    @property
    def edges(self) -> IntArray:
        """The edges of the contacts, shape (m,)."""
        edges = self.rows.edges[self.index]
        return np.asarray(edges[edges >= 0])

    @property
    def functions(self) -> TorqueFunctions:
        """The torque functions of these edges."""
        return self.rows.functions(self.index)

    def ways(self, moves: Moves) -> Iterable[Contacts]:
        """Return the switches that hold contacts of the given grasp, by their number."""
        return moves.of(self.index)

    def level_in(self, piece: tuple[int, int]) -> float:
        """Return what a piece leaves of the level of the given contacts."""
        j, k = piece
        return min(self.level, float(-self.values[j]), float(self.values[k]))

    def inside(self, least: float) -> list[tuple[int, int]]:
        """Return the pieces in which the given grasp itself reaches a level."""
        if self.level < least:
            return []
        valid = self.rows.valid[self.index]
        down = np.flatnonzero(valid & (-self.values >= least)).tolist()
        up = np.flatnonzero(valid & (self.values >= least)).tolist()
        return [(j, k) for j in down for k in up if j != k]

    @cached_property
    def visible(self) -> LinearSets:
        """Where a straight slide from here never falls below `level`, as convex sets over f.

        Such a slide avoids the convex set where all ``M_k`` are below the level. With x the given
        grasp and y the other end, the functions that are not below it at x suffice at y; or two
        together: k above it at x, l below it, and the combination of both that is 0 at x is not
        negative at y. By Helly's theorem on the line no more than two are needed.
        """
        m = len(self.fractions)
        valid = np.flatnonzero(self.rows.valid[self.index])
        parts = []
        for sign in (1.0, -1.0):
            constants = sign * self.rows.offsets[self.index, valid] - self.level
            slopes = sign * self.rows.slopes[self.index, valid, :m]
            parts.append(_seen(constants, slopes, self.fractions, self._rounding))
        rows, bounds = [], []
        for c, s in parts[0]:
            for d, t in parts[1]:
                rows.append(np.stack((-s, -t)))
                bounds.append(np.array([c, d]))
        count = len(rows)
        ends = self.level if self.rows.measure == "tolerance" else 0.0
        lower = np.maximum(ends, 0.0) / self.rows.lengths[self.index, :m]
        return LinearSets(
            tuple(_NAMES[:m]),
            np.array(rows),
            np.zeros((count, 2)),
            np.array(bounds),
            np.tile(np.minimum(lower, self.fractions), (count, 1)),
            np.tile(np.maximum(1 - lower, self.fractions), (count, 1)),
        )

    @property
    def _rounding(self) -> float:
        return ACCURACY * self.rows.cones.size

    @cached_property
    def _candidates(self) -> tuple[IntArray, IntArray, FloatArray]:
        """Pieces and visible sets that may meet above `level`, and upper bounds, best first."""
        best = self.rows.levels(np.array([self.index]))[0]
        j, k = np.nonzero(best > self.level)
        order = np.argsort(-best[j, k], kind="stable")
        pieces = np.column_stack((j, k))[order]
        count = len(self.visible)
        return (
            pieces.repeat(count, axis=0),
            np.tile(np.arange(count), len(pieces)),
            best[j, k][order].repeat(count),
        )

    def landings(self, least: float) -> Iterator[Landing]:
        """Yield slides away from here that reach a level, those of large margin first."""
        pieces, cells, bounds = self._candidates
        done = 0
        while True:
            while done < len(self._found):
                if self._found[done].level >= least:
                    yield self._found[done]
                done += 1
            if done == len(pieces) or bounds[done] < least:
                return
            for number in range(done, min(done + _ROUND, len(pieces))):
                seen = self.visible[int(cells[number])]
                level = self._level(pieces[number], seen)
                j, k = pieces[number].tolist()
                self._found.append(Landing((j, k), level, seen))

    def _level(self, piece: IntArray, seen: LinearSets) -> float:
        """The largest level on a piece where it is seen from here; -inf if it is not.

        By the simplex method: what is seen may be flat.
        """
        from scipy import sparse

        size = self.rows.cones.size
        cell = self.rows.cell(self.index, piece[None, :], _NAMES).join(seen, on=seen.names)
        n = len(cell.names)
        rows = np.column_stack((cell.rows[0] / size, cell.scales[0]))
        found = minimise(
            np.append(np.zeros(n), -1.0),
            sparse.csr_matrix(rows),
            cell.bounds[0] / size,
            np.append(cell.lower[0], -1.0),
            np.append(cell.upper[0], 1.0),
        )
        return -np.inf if found is None else -found.value * size

    def onward(self, contacts: Contacts, least: float = -np.inf) -> FloatArray:
        """Return the largest level of pieces of neighbours with the held contacts as given here.

        Parameters
        ----------
        contacts : Contacts
            From this set.
        least : float
            If 0 or more, lower ones may be -inf, which takes less time.

        Returns
        -------
        numpy.ndarray, shape (K, J, J)
            An upper bound where a set is not plain.
        """
        if contacts.held == 0:
            return self.rows.levels(contacts.others, least)
        values = self.fractions[contacts.here]
        return self.rows.completed(contacts.others, contacts.there, values, least)

    def cap(self, moves: Moves) -> float:
        """Return a level that no way from here exceeds; if all sets are plain, the largest."""
        best = self.widest
        for contacts in self.ways(moves):
            bounds = self.rows.best[contacts.others]
            # Those of sets with better grasps first, until no other set has any.
            order = np.argsort(-bounds, kind="stable")
            done, count = 0, _FIRST
            while done < len(order) and bounds[order[done]] > best:
                some = contacts.take(order[done : done + count])
                best = max(best, float(self.onward(some, max(best, 0.0)).max(initial=-np.inf)))
                done, count = done + count, 2 * count
        return best

    @cached_property
    def widest(self) -> float:
        """The largest level at which a slide away from here can end, or `level` if it is larger."""
        best, bounds = self.level, self._candidates[2]
        for number, landing in enumerate(self.landings(self.level)):
            best = max(best, landing.level)
            if number + 1 < len(bounds) and bounds[number + 1] <= best:
                break
        return best


@dataclass(frozen=True, eq=False)
class Touching(Support):
    """All of a given grasp, while a set holds the object that has only some of its contacts.

    That set does not count: fingers are placed around the given grasp, or it is placed, before
    anything is released. A set that holds all of it does as much, but of the chapter's there may be
    none.

    Parameters
    ----------
    by : Support
        What holds the object meanwhile.
    segments : numpy.ndarray of int, shape (m,)
        The edges of all contacts, ascending.
    fingers : int
        Of the hand.
    """

    by: Support = field(kw_only=True)
    segments: IntArray = field(kw_only=True)
    fingers: int = field(kw_only=True)

    @property
    def part(self) -> Support:
        """What holds the object."""
        return self.by

    @property
    def edges(self) -> IntArray:
        """The edges of all contacts."""
        return self.segments

    @cached_property
    def functions(self) -> TorqueFunctions:
        """The torque functions of all contacts."""
        return torque_functions(self.rows.cones, self.segments[None])

    def inside(self, least: float) -> list[tuple[int, int]]:
        """Return no pieces: its contacts are not in one set."""
        return []

    def landings(self, least: float) -> Iterator[Landing]:
        """Return no slides."""
        return iter(())

    @property
    def widest(self) -> float:
        """No slide leads away."""
        return -np.inf

    def ways(self, moves: Moves) -> Iterable[Contacts]:
        """Yield the switches that can be made while all contacts touch, by their number."""
        found = [contacts.others for contacts in moves.of(self.index)]
        others = np.unique(np.concatenate((*found, np.zeros(0, dtype=np.intp))))
        needed = len(self.segments) + self.rows.contacts[others] - self.fingers
        for held in range(len(self.segments), 0, -1):
            yield common_contacts(self.rows.edges, self.segments, others[needed <= held], held)
        yield Contacts.free(others[needed <= 0])


@dataclass(frozen=True, eq=False)
class Landing:
    """Where a slide away from a given grasp may end.

    Parameters
    ----------
    piece : (int, int)
        The functions j and k of the piece in which the grasp there is.
    level : float
        The largest margin or tolerance that it can have.
    visible : LinearSets
        A stack of one: what the slide needs.
    """

    piece: tuple[int, int]
    level: float
    visible: LinearSets


def supports(
    rows: PieceRows, sets: GraspSets, grasp: Grasp, fingers: int, *, every: bool = True
) -> list[Support]:
    """Return what holds a given grasp.

    Parameters
    ----------
    rows : PieceRows
        Of these sets.
    sets : GraspSets
    grasp : Grasp
        Resolved.
    fingers : int
        Of the hand.
    every : bool
        Whether there is a set for every grasp. Then those of parts of a grasp are not needed: what
        a part can be switched to while all of the grasp touches, all of it can, too.
    """
    segments, fractions = sets.cones.places(grasp.edges, grasp.fractions)
    order = np.lexsort((fractions, segments))
    ends = segments[order], sets.cones.within(segments, fractions)[order]
    whole, touching = [], []
    for index, some in sets.holding(grasp):
        f = sets.fractions(index, grasp.fractions[list(some)])
        support = Support(rows, index, some, f)
        if len(some) == len(grasp):
            whole.append(support)
            continue
        contacts = tuple(order.tolist())
        touching.append(
            Touching(rows, index, contacts, ends[1], by=support, segments=ends[0], fingers=fingers)
        )
    return whole if whole and every else [*whole, *touching]


def _seen(
    constants: FloatArray, slopes: FloatArray, x: FloatArray, rounding: float
) -> list[tuple[float, FloatArray]]:
    """Functions that are not negative where some function is not, all the way from x."""
    values = constants + slopes @ x
    up = np.flatnonzero(values >= -rounding)
    found = [(float(constants[k]), slopes[k]) for k in up.tolist()]
    for k in up[values[up] > rounding].tolist():
        for other in np.flatnonzero(values < -rounding).tolist():
            a, b = -values[other], values[k]
            a, b = a / (a + b), b / (a + b)
            constant = a * constants[k] + b * constants[other]
            found.append((float(constant), a * slopes[k] + b * slopes[other]))
    # The given grasp itself is seen, whatever the rounding.
    return [(c + max(0.0, rounding - (c + float(s @ x))), s) for c, s in found]
