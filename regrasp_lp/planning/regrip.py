"""Aligning by repositioning: free fingers take over contacts one by one (section 3.3.3)."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from regrasp_lp.errors import NoPlanFound, SolverError
from regrasp_lp.friction import FloatArray
from regrasp_lp.torque import TorqueFunctions

_MOST_HALVINGS = 60

_MOST_MOVES = 1000

_SHARE = 0.1
"""Part of the margin at the ends of a way that the grasps in between keep."""


def regrip_moves(
    functions: TorqueFunctions, way: list[FloatArray], centers: FloatArray
) -> list[tuple[int, float]]:
    """Return single contact moves that lead along a way within a grasp set.

    Between any two grasps all orders of the contacts are tried; each move places a free finger
    and then releases the old one, so that only the grasps between the moves matter. Where no
    order keeps a tenth of the margin at the ends the way leads through the middle of the piece: on
    the way from there to a grasp at the border of the set the room only shrinks in proportion, so
    that halving it needs few moves. A contact is never put where another one is.

    Parameters
    ----------
    functions : TorqueFunctions
        Of one set.
    way : list of numpy.ndarray, shape (m,)
        Grasps (fractions) joined by straight slides inside convex pieces of the set.
    centers : numpy.ndarray, shape (len(way) - 1, m)
        A grasp well inside each of these pieces.

    Returns
    -------
    list of (int, float)
        Which contact moves, and its new fraction.

    Raises
    ------
    NoPlanFound
        If the set is so thin that thousands of moves would be needed.
    SolverError
        If even the shortest step loses force closure, which takes a way at the limit of rounding.
    """
    if len(way) > 2:
        whole = _in_some_order(functions, way[0], way[-1])
        if whole is not None:
            return whole
    moves: list[tuple[int, float]] = []
    for f, g, center in zip(way[:-1], way[1:], centers, strict=True):
        direct = _in_some_order(functions, f, g)
        if direct is not None:
            moves += direct
        else:
            moves += _by_halving(functions, f, center) + _by_halving(functions, center, g)
    return moves


def _by_halving(
    functions: TorqueFunctions, f: FloatArray, g: FloatArray
) -> list[tuple[int, float]]:
    moves: list[tuple[int, float]] = []
    pending = [(f, g, _MOST_HALVINGS)]
    while pending:
        if len(moves) + len(pending) > _MOST_MOVES:
            raise NoPlanFound(
                f"aligning by repositioning on edges {functions.edges[0].tolist()} would take "
                f"more than {_MOST_MOVES} placements, so thin is the set of grasps there: use "
                'aligning="slide"'
            )
        f, g, halvings = pending.pop(0)
        step = _in_some_order(functions, f, g)
        if step is not None:
            moves += step
        elif halvings > 0:
            middle = (f + g) / 2
            pending[:0] = [(f, middle, halvings - 1), (middle, g, halvings - 1)]
        else:
            raise SolverError(
                f"no regrip on edges {functions.edges[0].tolist()} between fractions "
                f"{f.tolist()} and {g.tolist()}, however close: the grasps between them are "
                "within rounding of losing force closure"
            )
    return moves


def _in_some_order(
    functions: TorqueFunctions, f: FloatArray, g: FloatArray
) -> list[tuple[int, float]] | None:
    """Moves from f to g, each contact once at most, or None if no order is possible."""
    moving = np.flatnonzero(f != g).tolist()
    enough = _SHARE * min(functions.margins(f)[0], functions.margins(g)[0])
    best, moves = -np.inf, None
    for order in permutations(moving):
        now, least = f.copy(), np.inf
        for slot in order:
            now[slot] = g[slot]
            margin = functions.margins(now)[0] if _apart(functions, now) else -np.inf
            least = min(least, float(margin))
        if least > max(best, 0.0) and least >= enough:
            best, moves = least, [(slot, float(g[slot])) for slot in order]
    return [] if not moving else moves


def _apart(functions: TorqueFunctions, fractions: FloatArray) -> bool:
    """Whether no two contacts are one point: a place on an edge, or a vertex two edges share."""
    cones = functions.cones
    points = set()
    for edge, f in zip(functions.edges[0].tolist(), fractions.tolist(), strict=True):
        vertex = cones.starts[edge] if f == 0 else cones.ends[edge] if f == 1 else None
        points.add((edge, f) if vertex is None else tuple(vertex.tolist()))
    return len(points) == functions.m
