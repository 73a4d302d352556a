"""The contact rule: whether two sets can hold contacts in common, and where.

With one or two held contacts and no margin asked for, intervals decide (`switching`). With three,
or a margin, margin LPs on joined pieces do: their two bounds first, the same LPs in rational
numbers where these do not tell.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from regrasp_lp.exact_margins import is_larger, piece_rows, scaled_functions
from regrasp_lp.friction import IntArray, ObjectArray
from regrasp_lp.joins import best_joins, possible_joins
from regrasp_lp.lp import Solver
from regrasp_lp.lp.exact_solver import exact_optimum
from regrasp_lp.shadows import Shadows
from regrasp_lp.switching import Meeting, meet

_ROUNDING = 1e-12
"""Of the size of the object: more than the rounding error of a margin."""


def meet_held(
    first: Shadows,
    second: Shadows,
    i: IntArray | None = None,
    j: IntArray | None = None,
    *,
    solver: Solver,
    min_margin: float = 0.0,
) -> Meeting:
    """Decide whether pairs of projections have a common point: as `meet`, for one to three.

    Parameters
    ----------
    first, second : Shadows
    i, j : numpy.ndarray of int, shape (P,), optional
        As for `meet`.
    solver : Solver
    min_margin : float
        Only common points at which both grasps have a larger margin count.

    Returns
    -------
    Meeting
    """
    i = np.arange(len(first)) if i is None else i
    j = np.arange(len(second)) if j is None else j
    if min_margin == 0 and first.held < 3:
        return meet(first, second, i, j)
    result = Meeting.unknown(len(i), first.held)
    possible = np.arange(len(i))
    if first.held < 3:
        possible = np.flatnonzero(meet(first, second, i, j).exist)
    result.write(
        possible, meet_by_lp(first.take(i[possible]), second.take(j[possible]), solver, min_margin)
    )
    return result


def meet_by_lp(
    first: Shadows, second: Shadows, solver: Solver, min_margin: float = 0.0, *, exact: bool = True
) -> Meeting:
    """Decide by margin LPs whether aligned projections have a common point.

    Parameters
    ----------
    first, second : Shadows
    solver : Solver
    min_margin : float
    exact : bool
        Whether what is within the accuracy of the solver is decided in rational numbers, or else
        is a no.

    Returns
    -------
    Meeting
    """
    size = first.sources[0].cones.size if len(first) else 0.0
    joins = best_joins(
        first, second, solver, enough=min_margin, least=-_ROUNDING * size if exact else 0.0
    )
    found = Meeting(
        joins.exist & (joins.margins > min_margin),
        np.take_along_axis(joins.first, first.slots, axis=1),
        np.zeros(len(first), dtype=bool),
    )
    if exact:
        # Both bounds hold but for rounding, however far apart the solver may have left them.
        least = min_margin - _ROUNDING * size
        found.exist[:] = joins.margins > min_margin + _ROUNDING * size
        for n in np.flatnonzero(~found.exist & (joins.bounds >= least)).tolist():
            row = np.array([n])
            pair = first.take(row), second.take(row)
            joined = possible_joins(*pair, solver, least)
            optima = joined_optima(*pair, joined)
            best = next((s for s in optima if is_larger(s.margin, min_margin)), None)
            found.exactly[n], found.exist[n] = True, best is not None
            if best is not None:
                found.points[n] = [float(best.point[slot]) for slot in pair[0].slots[0]]
    found.points[~found.exist] = np.nan
    return found


class JoinOptimum(NamedTuple):
    """The optimum of the margin LP of two joined pieces, in rational numbers."""

    margin: Fraction
    point: tuple[Fraction, ...]


def joined_optima(
    first: Shadows, second: Shadows, pieces: IntArray | None = None
) -> Iterator[JoinOptimum]:
    """Yield the optimum of joins of a piece of one set and a piece of another, exactly.

    Parameters
    ----------
    first, second : Shadows
        One projection each. The coordinates of a solution are the contacts of the first set, then
        those of the second that are not held.
    pieces : numpy.ndarray of int, shape (K, 4), optional
        The functions j, k of the first set and j, k of the second one; all by default.
    """
    one, other = (s.sources[s.source[0]] for s in (first, second))
    places = list(range(one.m, one.m + other.m))
    for here, there in zip(first.slots[0], second.slots[0], strict=True):
        places[there] = int(here)
    order = sorted({*range(one.m), *places})
    columns = list(range(one.m)), [order.index(p) for p in places]
    functions = []
    for shadow, source, where in zip((first, second), (one, other), columns, strict=True):
        constants, slopes = scaled_functions(source, int(shadow.row[0]))
        functions.append((constants, [_spread(slope, where, len(order)) for slope in slopes]))
    if pieces is None:
        of_sets = [permutations(range(len(constants)), 2) for constants, _ in functions]
        pieces = np.array([[*p, *q] for p, q in product(*of_sets)])
    for j, k, j2, k2 in pieces.tolist():
        rows, bounds = piece_rows(*functions[0], j, k)
        more, limits = piece_rows(*functions[1], j2, k2)
        yield _optimum(np.array(rows + more), np.array(bounds + limits))


def _optimum(rows: ObjectArray, bounds: ObjectArray) -> JoinOptimum:
    r, n = rows.shape
    one = np.array([Fraction(1)] * max(r, n))
    found = exact_optimum(rows, one[:r], bounds, one[:n])
    assert found is not None  # every row has a scale
    return JoinOptimum((bounds - rows.dot(found[0])).min(), tuple(found[0]))


def _spread(slope: list[Fraction], where: list[int], n: int) -> list[Fraction]:
    """Slopes in the contacts of a set as slopes in all n coordinates."""
    wide = [Fraction(0)] * n
    for value, place in zip(slope, where, strict=True):
        wide[place] = value
    return wide
