"""Convex pieces ``{M_j < 0 < M_k}`` of grasp sets as linear sets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from regrasp_lp.friction import IntArray
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.torque import TorqueFunctions

Measure = Literal["margin", "tolerance"]


def piece_sets(
    functions: TorqueFunctions,
    pieces: IntArray,
    names: Sequence[str],
    *,
    measure: Measure = "margin",
    apart: bool = False,
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
    apart : bool
        Whether two contacts on one edge are kept in order and apart: a row
        ``u_{i+1} - u_i >= 2 ε``, for all pieces (void where the edges differ).

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
    if apart:
        edges = functions.edges[row]
        order = np.zeros((count, m - 1, m))
        for i in range(m - 1):
            same = edges[:, i] == edges[:, i + 1]
            order[:, i, i] = np.where(same, lengths[:, i], 0.0)
            order[:, i, i + 1] = -order[:, i, i]
        void = (order == 0).all(axis=2)
        rows = np.concatenate((rows, order), axis=1)
        bounds = np.concatenate((bounds, np.where(void, lengths.max(axis=1)[:, None], 0)), axis=1)
        scales = np.concatenate((scales, np.where(void, 0.0, 2.0)), axis=1)
    return LinearSets(tuple(names), rows, scales, bounds, np.zeros((count, m)), np.ones((count, m)))


def in_positions(sets: LinearSets, lengths: Sequence[float]) -> LinearSets:
    """Return linear sets over fractions as sets over positions ``u = f l``.

    Parameters
    ----------
    sets : LinearSets
    lengths : sequence of float
        Length of the edge of each coordinate.

    Returns
    -------
    LinearSets
    """
    scale = np.asarray(lengths, dtype=np.float64)
    return LinearSets(
        sets.names,
        sets.rows / scale,
        sets.scales,
        sets.bounds,
        sets.lower * scale,
        sets.upper * scale,
    )
