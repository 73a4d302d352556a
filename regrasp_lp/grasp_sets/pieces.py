"""Convex pieces ``{M_j < 0 < M_k}`` of grasp sets as linear sets."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Literal

import numpy as np

from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.torque import TorqueFunctions

Measure = Literal["margin", "tolerance"]

BARELY_APART = 1e-3
"""For `piece_sets(apart=…)`: contacts that do not coincide, at next to no cost in margin."""


def piece_sets(
    functions: TorqueFunctions,
    pieces: IntArray,
    names: Sequence[str],
    *,
    measure: Measure = "margin",
    apart: float = 0.0,
) -> LinearSets:
    """Return pieces as linear sets over the fractions of their contacts.

    The rows are ``M_j/s_j + ε <= 0`` and ``-M_k/s_k + ε <= 0`` in the box [0, 1]^m: the margin of
    a point of the linear set is a lower bound of the margin of the grasp.

    Parameters
    ----------
    functions : TorqueFunctions
    pieces : numpy.ndarray of int, shape (P, 3)
        Combination, j and k of each piece.
    names : sequence of str
        Names of the m coordinates.
    measure : {"margin", "tolerance"}
        With "tolerance" the rows are scaled by ``w`` instead of ``s``, and ``u_i >= ε``,
        ``u_i <= l_i - ε`` are rows too.
    apart : float
        If positive, any two contacts that could meet are this many ε apart, measured along the
        boundary: two on one edge, which then keep their order, or on edges with a common vertex.
        A row per pair of contacts, void where they cannot meet.

    Returns
    -------
    LinearSets
        P sets with coordinates in [0, 1] and rows in the unit of length.
    """
    row, j, k = pieces.T
    count, m = len(pieces), functions.m
    rows = np.stack((functions.slopes[row, j], -functions.slopes[row, k]), axis=1)
    bounds = np.stack((-functions.offsets[row, j], functions.offsets[row, k]), axis=1)
    scales = np.ones((count, 2))
    lengths = functions.lengths[row]
    if measure == "tolerance":
        scales = np.stack((functions.rates[row, j], functions.rates[row, k]), axis=1)
        ends = np.eye(m) * lengths[:, None, :]
        rows = np.concatenate((rows, -ends, ends), axis=1)
        bounds = np.concatenate((bounds, np.zeros((count, m)), lengths), axis=1)
        scales = np.concatenate((scales, np.ones((count, 2 * m))), axis=1)
    if apart > 0:
        away, least = _apart(functions, row)
        void = (away == 0).all(axis=2)
        rows = np.concatenate((rows, away), axis=1)
        bounds = np.concatenate((bounds, least), axis=1)
        scales = np.concatenate((scales, np.where(void, 0.0, apart)), axis=1)
    return LinearSets(tuple(names), rows, scales, bounds, np.zeros((count, m)), np.ones((count, m)))


def _apart(functions: TorqueFunctions, row: IntArray) -> tuple[FloatArray, FloatArray]:
    """Rows and bounds of ``u_i - u_j <= 0`` on one edge, ``u_i - u_j <= l_i`` round a vertex.

    For every pair i < j of contacts: j follows i on its edge or around the end of it, or i
    follows j around the end of that one.
    """
    starts, ends = functions.cones.starts, functions.cones.ends
    edges, lengths = functions.edges[row], functions.lengths[row]
    pairs = list(combinations(range(functions.m), 2))
    rows = np.zeros((len(row), len(pairs), functions.m))
    bounds = np.tile(lengths.max(axis=1)[:, None], len(pairs))
    for n, (i, j) in enumerate(pairs):
        same = edges[:, i] == edges[:, j]
        for one, other in ((i, j), (j, i)):
            meet = (ends[edges[:, one]] == starts[edges[:, other]]).all(axis=1)
            meet |= same & (one < other)
            rows[meet, n, one] = lengths[meet, one]
            rows[meet, n, other] = -lengths[meet, other]
            bounds[meet, n] = np.where(same, 0.0, lengths[:, one])[meet]
    return rows, bounds


def order_rows(edges: Sequence[int]) -> FloatArray:
    """Return rows of ``u_i - u_{i+1} <= 0``, one where two contacts are on one edge.

    Parameters
    ----------
    edges : sequence of int
        Ascending.

    Returns
    -------
    numpy.ndarray, shape (K, m)

    Examples
    --------
    >>> order_rows((3, 3, 5)).tolist()
    [[1.0, -1.0, 0.0]]
    """
    steps = np.eye(len(edges))[:-1] - np.eye(len(edges))[1:]
    return np.asarray(steps[np.equal(edges[1:], edges[:-1])])


def in_positions(
    sets: LinearSets, lengths: FloatArray, starts: FloatArray | None = None
) -> LinearSets:
    """Return linear sets over fractions as sets over positions ``u = u_0 + f l``.

    Parameters
    ----------
    sets : LinearSets
    lengths : numpy.ndarray, shape (n,)
        Length of the edge, or segment of an edge, of each coordinate.
    starts : numpy.ndarray, shape (n,), optional
        The position ``u_0`` at which it starts; 0 by default.

    Returns
    -------
    LinearSets
    """
    scaled = LinearSets(
        sets.names,
        sets.rows / lengths,
        sets.scales,
        sets.bounds,
        sets.lower * lengths,
        sets.upper * lengths,
    )
    if starts is None or not starts.any():
        return scaled
    return scaled.translate(dict(zip(sets.names, starts.tolist(), strict=True)))
