"""Aligning: from one grasp of a set to another through overlapping convex pieces.

Inside a piece fingers slide straight, and the margin of the piece never falls below the smaller
of its ends. A grasp set is connected, so any two of its grasps are joined by a chain of pieces
each of which overlaps the next; the chain whose least overlap is largest is taken.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from regrasp_lp.errors import SolverError
from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.grasp_sets.pieces import BARELY_APART, piece_sets
from regrasp_lp.grasp_sets.set_pieces import SetPieces
from regrasp_lp.lp import Solver, maximise_margins
from regrasp_lp.torque import TorqueFunctions

_NAMES = ("f0", "f1", "f2")

_ROUNDING = 1e-9
"""Of the object's size: by how much a grasp may be beyond a limit of the hand."""


@dataclass(frozen=True, eq=False)
class PieceChains:
    """The pieces of one grasp set and how they overlap.

    Parameters
    ----------
    parts : SetPieces
        Of one set, best first.
    solver : Solver
        Maximises the margin in the overlaps.
    """

    parts: SetPieces
    solver: Solver

    @property
    def functions(self) -> TorqueFunctions:
        """The torque functions of the set."""
        return self.parts.functions

    @property
    def pieces(self) -> IntArray:
        """The pieces as rows (0, j, k), best first, shape (P, 3)."""
        return self.parts.pieces

    @cached_property
    def overlaps(self) -> tuple[FloatArray, FloatArray]:
        """Largest margin in the overlap of two pieces, and where: shapes (P, P) and (P, P, m)."""
        count, m = len(self.pieces), self.functions.m
        sets = self.parts.linear(_NAMES[:m], apart=BARELY_APART)
        one, other = np.triu_indices(count, 1)
        solution = maximise_margins(
            sets.take(one).join(sets.take(other), on=_NAMES[:m]), self.solver
        )
        margins, points = np.full((count, count), -np.inf), np.zeros((count, count, m))
        margins[one, other] = margins[other, one] = solution.margins
        points[one, other] = points[other, one] = solution.points
        return margins, points

    def containing(self, fractions: FloatArray) -> IntArray:
        """Return which pieces contain a grasp, exactly; the best first."""
        _, j, k = self.pieces.T
        values = self.functions.values(fractions)[0]
        order = np.argsort(-np.minimum(-values[j], values[k]), kind="stable")
        rows = np.zeros(len(j), dtype=np.intp)
        place = np.broadcast_to(fractions, (len(j), self.functions.m))
        below = self.functions.exact_signs(rows, j, place) < 0
        above = self.functions.exact_signs(rows, k, place) > 0
        excess = np.einsum("prm,pm->pr", self.parts.rows, place) - self.parts.bounds
        near = (excess <= _ROUNDING * self.functions.cones.size).all(axis=1)
        inside: BoolArray = below & above & near
        return order[inside[order]]

    def chain(self, f: FloatArray, g: FloatArray) -> tuple[list[int], list[FloatArray]]:
        """Return pieces that lead from one grasp to another.

        Parameters
        ----------
        f, g : numpy.ndarray, shape (m,)
            Fractions of two grasps of the set; two contacts on one edge in order.

        Returns
        -------
        pieces : list of int
            Rows of `pieces`; f is in the first, g in the last.
        points : list of numpy.ndarray
            A point in each overlap of consecutive pieces, one fewer than pieces.

        Raises
        ------
        SolverError
            If no chain of overlaps beyond the solver's accuracy joins them.
        """
        start, end = self.containing(f), self.containing(g)
        common = np.intersect1d(start, end)
        if common.size:
            _, j, k = self.pieces[common].T
            ends = [self.functions.values(x)[0] for x in (f, g)]
            worst = np.min([np.minimum(-v[j], v[k]) for v in ends], axis=0)
            return [int(common[worst.argmax()])], []
        margins, points = self.overlaps
        pieces = _widest_path(margins, start, end)
        if pieces is None:
            raise SolverError(
                f"no overlap of pieces beyond the accuracy of {self.solver.name} joins two grasps "
                f"on edges {self.functions.edges[0].tolist()}, which are connected: the set is "
                "thinner than rounding: leave such sets out (min_margin), or change the friction "
                "a little"
            )
        return pieces, [points[a, b] for a, b in pairwise(pieces)]


def middles(functions: TorqueFunctions, pieces: IntArray, solver: Solver) -> FloatArray:
    """Return a grasp of largest tolerance of each of some pieces of one set, shape (P, m)."""
    sets = piece_sets(functions, pieces, _NAMES[: functions.m], measure="tolerance", apart=2.0)
    return maximise_margins(sets, solver).points


def _widest_path(width: FloatArray, start: IntArray, end: IntArray) -> list[int] | None:
    """The path whose least width is largest, and the shortest of these; None if all are <= 0."""
    best = {int(i): (-np.inf, 0) for i in start}
    before = {int(i): -1 for i in start}
    queue = [(-np.inf, 0, int(i)) for i in start]
    heapq.heapify(queue)
    while queue:
        negative, steps, node = heapq.heappop(queue)
        if (negative, steps) > best[node]:
            continue
        if node in end:
            path = [node]
            while before[path[-1]] >= 0:
                path.append(before[path[-1]])
            return path[::-1]
        for other in np.flatnonzero(width[node] > 0).tolist():
            label = (max(negative, -float(width[node, other])), steps + 1)
            if other not in best or label < best[other]:
                best[other], before[other] = label, node
                heapq.heappush(queue, (*label, other))
    return None
