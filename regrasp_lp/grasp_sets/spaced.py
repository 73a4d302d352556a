"""Grasp sets under limits to the distances between fingers: connected groups of convex pieces.

With such limits a combination of edges has no longer one connected set: its pieces are cut by rows,
each is asked by its margin LP whether it exists, and those that overlap, by a margin LP again, form
a set. Every set is proved by a grasp in it; that there is none is as certain as the solver.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.grasp_sets.pieces import BARELY_APART
from regrasp_lp.grasp_sets.set_pieces import SetPieces, without_void_rows
from regrasp_lp.grasp_sets.spacing import Alternatives, Spacing
from regrasp_lp.grasp_sets.vertices import Family
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import Solver, maximise_margins
from regrasp_lp.margins import best_points, existing_pieces, piece_margins
from regrasp_lp.torque import TorqueFunctions

_POSITIVE = 1e-12
"""Of the size of the object: a margin that is more than rounding."""

_AT_END = 1e-12  # of a segment: a contact at its end but for rounding
_AT_A_TIME = 32


def spaced_family(
    family: Family, spacing: Spacing, solver: Solver, *, min_margin: float = 0.0
) -> Family:
    """Return the sets that a family consists of under limits to distances.

    Parameters
    ----------
    family : Family
        Without these limits.
    spacing : Spacing
    solver : Solver
    min_margin : float
        Sets whose margin is not larger are dropped.

    Returns
    -------
    Family
        With `pieces`; a combination of edges may occur several times.

    Raises
    ------
    SolverError
        If the solver leaves an LP open.
    """
    pieces, limited = _cut(family, spacing)
    wide = pieces.rows.any(axis=2).sum(axis=1)
    sets = pieces.linear(_names(family), apart=BARELY_APART)
    points = _best_points(pieces)
    # Limits that leave the optimum without them where it is do not change it.
    cut = sets.margins(points) < pieces.margins - _POSITIVE * spacing.cones.size
    rows = np.flatnonzero(cut & limited[pieces.pieces[:, 0]])
    margins = pieces.margins.copy()
    for count in np.unique(wide[rows]).tolist():
        some = rows[wide[rows] == count]
        solution = maximise_margins(without_void_rows(sets.take(some)), solver)
        margins[some], points[some] = solution.margins, solution.points
    points = np.where(points < _AT_END, 0.0, np.where(points > 1 - _AT_END, 1.0, points))
    asked = np.flatnonzero(limited[pieces.pieces[:, 0]])
    alive = np.ones(len(pieces), dtype=bool)
    alive[asked] = margins[asked] > _POSITIVE * spacing.cones.size
    alive[asked] &= _inside(pieces.take(asked), points[asked])
    kept = np.flatnonzero(alive)
    pieces, sets = replace(pieces, margins=margins).take(kept), sets.take(kept)
    group = _groups(pieces, sets, points[kept], limited, solver)
    return _family(family, pieces, points[kept], group, limited, min_margin)


def _names(family: Family) -> list[str]:
    return [f"f{i}" for i in range(family.functions.m)]


def _cut(family: Family, spacing: Spacing) -> tuple[SetPieces, BoolArray]:
    """All pieces times all choices of rows, by set, and which sets are limited at all."""
    functions = family.functions
    pairs = list(combinations(range(functions.m), 2))
    every = [spacing.alternatives(edges, pairs, ordered=True) for edges in functions.edges]
    whole = existing_pieces(functions)
    row, j, k = whole.T
    below, above = _needed(functions)
    whole = whole[below[row, j] & above[row, k]]
    choices = np.array([len(every[row]) for row in whole[:, 0].tolist()], dtype=np.intp)
    pieces = whole.repeat(choices, axis=0)
    number = np.arange(len(pieces)) - (np.cumsum(choices) - choices).repeat(choices)
    rows, bounds = _padded(every, pieces[:, 0], number, functions.m)
    of_pieces = piece_margins(functions)[tuple(pieces.T)] if len(pieces) else np.zeros(0)
    limited = np.array([not alternatives.void for alternatives in every], dtype=bool)
    return SetPieces(functions, pieces, rows, bounds, of_pieces), limited


def _needed(functions: TorqueFunctions) -> tuple[BoolArray, BoolArray]:
    """Which functions M are needed as the negative one of a piece, which as the positive one.

    M is not if another one is below it wherever M < 0 (above it wherever M > 0), in margins: pieces
    of M are then part of pieces of the other, and so are their parts at any margin.
    """
    constants, slopes = functions.offsets, functions.slopes
    below = _undominated(constants, slopes, functions.valid)
    # seen from the far corner, M is negated
    return below, _undominated(-constants - slopes.sum(axis=2), slopes, functions.valid)


def _undominated(constants: FloatArray, slopes: FloatArray, valid: BoolArray) -> BoolArray:
    """Functions ``c + b · f`` which no other one is below wherever they are negative, (N, J).

    The largest difference to another function there has one row and a box: its one multiplier y
    is 0 or makes the rise of a contact count nothing.
    """
    c, b = constants[:, :, None], slopes[:, :, None, :]
    rise = slopes[:, None, :, :] - b
    multipliers = np.divide(rise, b, out=np.zeros(rise.shape), where=b > 0)
    most = np.full(rise.shape[:3], np.inf)
    for i in range(-1, rise.shape[3]):
        y = np.maximum(multipliers[..., i], 0.0) if i >= 0 else np.zeros(rise.shape[:3])
        most = np.minimum(most, -c * y + np.maximum(rise - y[..., None] * b, 0.0).sum(axis=3))
    most += constants[:, None, :] - c
    under = (most <= 0) & valid[:, None, :] & valid[:, :, None]
    each = np.arange(valid.shape[1])
    under &= (each[:, None] > each) | ~np.swapaxes(under, 1, 2)  # of equals the first one is kept
    under[:, each, each] = False
    return np.asarray(valid & ~under.any(axis=2))


def _best_points(pieces: SetPieces) -> FloatArray:
    """Where the margin of each piece is largest without limits."""
    row, j, k = pieces.pieces.T
    taken = pieces.functions.take(row)
    points = best_points(taken, np.stack((j, k), axis=1))
    for i in range(taken.m - 1):  # of two contacts on one segment the first one comes first
        same = taken.edges[:, i] == taken.edges[:, i + 1]
        points[same, i : i + 2] = np.sort(points[same, i : i + 2], axis=1)
    return points


def _padded(
    every: list[Alternatives], which: IntArray, number: IntArray, n: int
) -> tuple[FloatArray, FloatArray]:
    """The rows of chosen alternatives, with void ones for those that have fewer than others."""
    width = max((alternatives.bounds.shape[1] for alternatives in every), default=0)
    rows, bounds = np.zeros((len(which), width, n)), np.zeros((len(which), width))
    for place, (w, c) in enumerate(zip(which.tolist(), number.tolist(), strict=True)):
        found = every[w].bounds[c]
        rows[place, : len(found)], bounds[place, : len(found)] = every[w].rows[c], found
    return rows, bounds


def _inside(pieces: SetPieces, points: FloatArray) -> BoolArray:
    """Whether the nearest doubles along whole edges are in the pieces, exactly."""
    cones, segments = pieces.functions.cones, pieces.functions.edges[pieces.pieces[:, 0]]
    return pieces.contain(cones.along(segments.ravel(), points.ravel()).reshape(points.shape))


def _groups(
    pieces: SetPieces, sets: LinearSets, points: FloatArray, limited: BoolArray, solver: Solver
) -> IntArray:
    """Number of the connected group of each piece; a set without limits is one group."""
    from scipy import sparse
    from scipy.sparse import csgraph

    row = pieces.pieces[:, 0]
    links = [np.zeros((0, 2), dtype=np.intp)]
    for low, high in _ranges(row):
        mine = np.arange(low, high)
        if limited[row[low]]:
            links.append(low + np.argwhere(_common(pieces.take(mine), points[mine])))
        else:
            links.append(np.column_stack((mine[:-1], mine[1:])))

    def united(pairs: IntArray) -> IntArray:
        graph = sparse.coo_matrix(
            (np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(row), len(row))
        )
        return np.asarray(csgraph.connected_components(graph, directed=False)[1])

    known = np.concatenate(links)
    group, done, count = united(known), np.zeros((0, 2), dtype=np.intp), _AT_A_TIME
    apart = _LimitsApart(pieces, sets, solver)
    while True:  # a few of the pairs that would join two groups at a time: most need no more
        asked = _between_groups(pieces, group, done, count)
        if not len(asked):
            return group
        possible = asked[~apart.of(asked)]
        overlaps = sets.take(possible[:, 0]).join(sets.take(possible[:, 1]), on=sets.names)
        margins = maximise_margins(without_void_rows(overlaps), solver).margins
        found = possible[margins > _POSITIVE * pieces.functions.cones.size]
        known, done = np.concatenate((known, found)), np.concatenate((done, asked))
        group, count = united(known), 4 * count


class _LimitsApart:
    """Tells pieces whose limits alone, without torque functions, have no point in common."""

    def __init__(self, pieces: SetPieces, sets: LinearSets, solver: Solver) -> None:
        _, first = np.unique(pieces.choice, return_index=True)
        self._choice, self._solver = pieces.choice, solver
        self._limits = replace(
            sets, rows=sets.rows[:, 2:], scales=sets.scales[:, 2:], bounds=sets.bounds[:, 2:]
        ).take(first)
        self._known: dict[tuple[int, int], bool] = {}

    def of(self, asked: IntArray) -> BoolArray:
        """Whether pairs of pieces are kept apart so, shape (K,)."""
        pairs = np.sort(self._choice[asked], axis=1)
        new = [p for p in dict.fromkeys(map(tuple, pairs.tolist())) if p not in self._known]
        rows = np.array(new, dtype=np.intp).reshape(-1, 2)
        both = self._limits.take(rows[:, 0]).join(
            self._limits.take(rows[:, 1]), on=self._limits.names
        )
        both = replace(both, scales=np.where(both.rows.any(axis=2), 1.0, 0.0))
        some = both.scales.any(axis=1)
        margins = np.full(len(rows), np.inf)
        margins[some] = maximise_margins(both.take(np.flatnonzero(some)), self._solver).bounds
        self._known.update(zip(new, (margins <= 0).tolist(), strict=True))
        return np.array([self._known[p] for p in map(tuple, pairs.tolist())], dtype=bool)


def _ranges(row: IntArray) -> list[tuple[int, int]]:
    """Where the pieces of each combination begin and end."""
    ends = np.flatnonzero(np.diff(row, prepend=-1, append=-1)).tolist()
    return list(pairwise(ends))


def _common(pieces: SetPieces, points: FloatArray) -> BoolArray:
    """Whether points are in pieces of one combination, by floating point, (points, pieces)."""
    row, j, k = pieces.pieces.T
    functions = pieces.functions
    values = functions.offsets[row[0]] + points @ functions.slopes[row[0]].T
    within = (values[:, j] < 0) & (values[:, k] > 0)
    _, first = np.unique(pieces.choice, return_index=True)
    excess = np.einsum("crm,pm->pcr", pieces.rows[first], points) - pieces.bounds[first]
    return np.asarray(within & (excess <= 0).all(axis=2)[:, pieces.choice])


def _between_groups(
    pieces: SetPieces, group: IntArray, done: IntArray, most: int
) -> NDArray[np.intp]:
    """Pairs of pieces of a combination in different groups: a few not asked for yet, the best."""
    n = len(group)
    asked = done[:, 0] * n + done[:, 1]
    found = [np.zeros((0, 2), dtype=np.intp)]
    for low, high in _ranges(pieces.pieces[:, 0]):
        if len(np.unique(group[low:high])) == 1:
            continue
        one, other = low + np.array(np.triu_indices(high - low, 1))
        new = (group[one] != group[other]) & ~np.isin(one * n + other, asked)
        one, other = one[new], other[new]
        best = np.argsort(-np.minimum(pieces.margins[one], pieces.margins[other]), kind="stable")
        found.append(np.column_stack((one, other))[best[:most]])
    return np.concatenate(found)


def _family(
    family: Family,
    pieces: SetPieces,
    points: FloatArray,
    group: IntArray,
    limited: BoolArray,
    min_margin: float,
) -> Family:
    """One set for each group: those of a combination in the order of their margins."""
    row = pieces.pieces[:, 0]
    order = np.lexsort((-pieces.margins, group, row))  # groups are within a combination
    _, first = np.unique(group[order], return_index=True)
    best = order[first]
    best = best[pieces.margins[best] > min_margin]
    best = best[np.lexsort((-pieces.margins[best], row[best]))]
    number = np.full(int(group.max(initial=-1)) + 1, -1)
    number[group[best]] = np.arange(len(best))
    of_piece = number[group]
    kept = order[of_piece[order] >= 0]
    kept = kept[np.argsort(of_piece[kept], kind="stable")]
    functions = family.functions.take(row[best])
    witnesses = np.where(limited[row[best], None], points[best], family.witnesses[row[best]])
    renumbered = np.column_stack((of_piece[kept], pieces.pieces[kept, 1:]))
    return Family(
        family.kind,
        functions,
        family.centers[row[best]],
        np.where(limited[row[best]], pieces.margins[best], family.margins[row[best]]),
        witnesses,
        family.n_candidates,
        SetPieces(
            functions, renumbered, pieces.rows[kept], pieces.bounds[kept], pieces.margins[kept]
        ),
    )
