"""Vertices of the switching graph: the existing grasp sets, each with margin and witness."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import permutations

import numpy as np

from regrasp_lp.completion import complete_exactly
from regrasp_lp.errors import OptionError
from regrasp_lp.exact_margins import certain_margins, exceeds
from regrasp_lp.friction import BoolArray, Cones, FloatArray, IntArray
from regrasp_lp.grasp_sets.candidates import (
    complete_candidates,
    concurrent_candidates,
    parallel_candidates,
    two_finger_candidates,
)
from regrasp_lp.grasp_sets.families import parallel_functions
from regrasp_lp.grasp_sets.pieces import piece_sets
from regrasp_lp.grasp_sets.set_pieces import SetPieces
from regrasp_lp.lp import GAP, MarginSolutions, Solver, maximise_margins
from regrasp_lp.margins import best_pieces, best_points, existing_pieces, piece_margins
from regrasp_lp.torque import TorqueFunctions, torque_functions

Progress = Callable[[str, int, int], None]

_APART = 1e-6  # of an edge: contacts of a witness are not closer than half of it


@dataclass(frozen=True, eq=False)
class Family:
    """All existing grasp sets of one kind, stacked.

    Parameters
    ----------
    kind : str
        "two_finger", "three_finger", "concurrent" or "parallel".
    functions : TorqueFunctions
        One combination a set.
    centers : numpy.ndarray of int, shape (N,)
        Centre edge of parallel sets; -1 elsewhere.
    margins : numpy.ndarray, shape (N,)
        Largest margin of a grasp in the set, in the object's unit.
    witnesses : numpy.ndarray, shape (N, m)
        Fractions of a grasp strictly inside that attains it, to the accuracy of the solver.
    n_candidates : int
        Number of combinations that were considered.
    pieces : SetPieces, optional
        The convex pieces of the sets, ascending by set, if limits of the hand cut them; by default
        all pieces of the functions.
    """

    kind: str
    functions: TorqueFunctions
    centers: IntArray
    margins: FloatArray
    witnesses: FloatArray
    n_candidates: int
    pieces: SetPieces | None = None

    def __len__(self) -> int:
        return len(self.functions)

    def pieces_of(self, row: int) -> SetPieces:
        """Return the convex pieces of one set, best first, over a stack of its functions alone."""
        functions = self.functions.take(np.array([row]))
        if self.pieces is None:
            pieces = existing_pieces(functions)
            margins = piece_margins(functions)[tuple(pieces.T)]
            rows, bounds = np.zeros((len(pieces), 0, functions.m)), np.zeros((len(pieces), 0))
            return SetPieces(functions, pieces, rows, bounds, margins)
        low, high = np.searchsorted(self.pieces.pieces[:, 0], [row, row + 1])
        mine = self.pieces.take(np.arange(low, high))
        alone = mine.pieces.copy()
        alone[:, 0] = 0
        return replace(mine, functions=functions, pieces=alone)


def candidate_functions(cones: Cones, kind: str) -> tuple[TorqueFunctions, IntArray]:
    """Return the torque functions and centres of all candidates of one kind."""
    if kind == "parallel":
        edges, centers = parallel_candidates(cones)
        return parallel_functions(cones, edges, centers), centers
    if kind == "concurrent":
        edges = concurrent_candidates(cones)
    elif kind == "three_finger":
        edges = complete_candidates(cones, 3)
    else:
        edges = two_finger_candidates(cones)
    return torque_functions(cones, edges), np.full(len(edges), -1)


def kinds_of(sets: str) -> tuple[str, ...]:
    """Return the kinds of grasp sets that `sets` ("complete" or "chapter") consists of.

    Raises
    ------
    OptionError
        If there is no such choice.
    """
    if sets == "complete":
        return "two_finger", "three_finger"
    if sets == "chapter":
        return "two_finger", "concurrent", "parallel"
    raise OptionError(f'sets must be "complete" or "chapter", got {sets!r}')


def build_family(
    cones: Cones,
    kind: str,
    solver: Solver,
    *,
    presolve: bool = True,
    min_margin: float = 0.0,
    progress: Progress | None = None,
) -> Family:
    """Return all existing grasp sets of one kind.

    With `presolve` the signs of torque functions at two corners decide which sets exist, and the
    margin LPs are solved in closed form, primal and dual: that both agree proves the optimum, and
    what did not agree would be left to the solver. Without it the solver maximises the margin of
    every piece of every candidate.

    Parameters
    ----------
    cones : Cones
    kind : str
    solver : Solver
    presolve : bool
    min_margin : float
        Sets whose margin is not larger are dropped.
    progress : callable, optional
        Called with what is being done, how many LPs are done, and how many there are.

    Returns
    -------
    Family

    Raises
    ------
    SolverError
        If the solver leaves an LP open.
    """
    functions, centers = candidate_functions(cones, kind)
    return solve_family(
        kind,
        functions,
        centers,
        solver,
        presolve=presolve,
        min_margin=min_margin,
        progress=progress,
    )


def solve_family(
    kind: str,
    functions: TorqueFunctions,
    centers: IntArray,
    solver: Solver,
    *,
    presolve: bool = True,
    min_margin: float = 0.0,
    progress: Progress | None = None,
) -> Family:
    """Return the existing sets among given candidates; as `build_family`, which see."""
    n_candidates = len(functions)
    kept = np.flatnonzero(functions.exists() if presolve else functions.spans)
    functions, centers = functions.take(kept), centers[kept]

    def tell(done: int, total: int) -> None:
        if progress is not None:
            progress(f"{kind} margins", done, total)

    if presolve:
        margins, witnesses = _in_closed_form(functions, solver)
        exists = exceeds(functions, margins, min_margin) if min_margin > 0 else functions.spans
        tell(len(functions), len(functions))
    else:
        margins, witnesses, positive = _by_programs(functions, solver, tell)
        exists = positive & (margins > min_margin)
    witnesses = _off_corners(functions, _inside(functions, _spread(functions, witnesses)))
    kept = np.flatnonzero(exists)
    return Family(
        kind, functions.take(kept), centers[kept], margins[kept], witnesses[kept], n_candidates
    )


def _in_closed_form(functions: TorqueFunctions, solver: Solver) -> tuple[FloatArray, FloatArray]:
    """Margins of existing sets and grasps that attain them; by the solver where they do not."""
    closed, pieces = best_pieces(functions)
    witnesses = best_points(functions, pieces)
    values, every = functions.values(witnesses), np.arange(len(functions))
    attained = np.minimum(values[every, pieces[:, 1]], -values[every, pieces[:, 0]])
    # The closed form is the optimum of the dual, so that a point that attains it is optimal.
    short = np.flatnonzero(attained < closed - GAP * functions.cones.size)
    margins = certain_margins(functions, closed, pieces)
    if short.size:
        margins[short], witnesses[short], _ = _by_programs(functions.take(short), solver)
    return margins, witnesses


def _by_programs(
    functions: TorqueFunctions, solver: Solver, tell: Callable[[int, int], None] | None = None
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Margins, grasps that attain them and whether they are positive, by LPs on all pieces."""
    chosen = _all_pieces(functions)
    names = [f"f{i}" for i in range(functions.m)]
    solutions = maximise_margins(
        piece_sets(functions, chosen, names),
        solver,
        None if tell is None else lambda done: tell(done, len(chosen)),
    )
    return _best_of_each(len(functions), functions.m, chosen, solutions)


def _all_pieces(functions: TorqueFunctions) -> IntArray:
    valid = functions.valid
    different = ~np.eye(valid.shape[1], dtype=bool)
    return np.argwhere(valid[:, :, None] & valid[:, None, :] & different)


def _best_of_each(
    n: int, m: int, pieces: IntArray, solutions: MarginSolutions
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """The best solution among the pieces of each set: margin, point and whether positive."""
    margins, points = np.full(n, -np.inf), np.full((n, m), 0.5)
    positive = np.zeros(n, dtype=bool)
    order = np.lexsort((-solutions.margins, pieces[:, 0]))
    rows, first = np.unique(pieces[order, 0], return_index=True)
    best = order[first]
    margins[rows], points[rows] = solutions.margins[best], solutions.points[best]
    positive[rows] = solutions.positive[best]
    return margins, points, positive


def _spread(functions: TorqueFunctions, witnesses: FloatArray) -> FloatArray:
    """Order two contacts on one edge, and move them apart where they coincide.

    Where they coincide the grasp is that of two contacts. Its best functions have all their
    forces on the edge at either contact, so that moving the first back and the second forth
    takes nothing from the margin.
    """
    witnesses = witnesses.copy()
    for i in range(functions.m - 1):
        same = functions.edges[:, i] == functions.edges[:, i + 1]
        pair = np.sort(witnesses[same, i : i + 2], axis=1)
        close = pair[:, 1] - pair[:, 0] < _APART
        pair[close] = [0.0, 1.0]
        witnesses[same, i : i + 2] = pair
    return witnesses


def _inside(functions: TorqueFunctions, witnesses: FloatArray) -> FloatArray:
    """Replace witnesses that are not strictly inside, exactly, by one on the diagonal or another.

    These are of sets thinner than the solver's accuracy. A set thinner than the doubles may keep
    a witness that is not inside: it exists, but no grasp in it can be written down.
    """
    witnesses = np.where(witnesses < 1e-12, 0.0, np.where(witnesses > 1 - 1e-12, 1.0, witnesses))
    for row in np.flatnonzero(~functions.contain(witnesses)).tolist():
        witnesses[row] = _diagonal_middle(functions, row)
    for row in np.flatnonzero(~functions.contain(witnesses)).tolist():
        exact = complete_exactly(functions, row, {})
        if exact is not None:
            witnesses[row] = [float(f) for f in exact]
    return _spread(functions, witnesses)


def _diagonal_middle(functions: TorqueFunctions, row: int) -> float:
    """The middle of the part of the diagonal from 0 to l that is in a set, in rationals."""
    lines = [(c, sum(slopes)) for c, slopes in zip(*functions.exact_coefficients(row), strict=True)]
    roots = [-constant / rise for constant, rise in lines]
    return float((max(min(roots), Fraction(0)) + min(max(roots), Fraction(1))) / 2)


def _off_corners(functions: TorqueFunctions, witnesses: FloatArray) -> FloatArray:
    """Move one of two contacts that meet at a corner of the object along its edge.

    No function rises by more than its slope, so that a step of half the margin over the largest
    slope stays inside.
    """
    cones, edges, moved = functions.cones, functions.edges, witnesses.copy()
    for i, j in permutations(range(functions.m), 2):
        corner = (cones.ends[edges[:, i]] == cones.starts[edges[:, j]]).all(axis=1)
        meet = np.flatnonzero(corner & ((1 - moved[:, i]) + moved[:, j] < _APART / 2))
        if not meet.size:
            continue
        here = functions.take(meet)
        rise = here.slopes[:, :, j].max(axis=1, initial=0.0)
        margins = here.margins(moved[meet])
        free = np.divide(margins, 2 * rise, out=np.ones(len(rise)), where=rise > 0)
        step = moved[meet]
        step[:, j] += np.clip(free, 0.0, _APART / 2)
        moved[meet] = np.where(here.contain(step)[:, None], step, moved[meet])
    return moved
