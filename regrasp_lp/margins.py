"""The best margin of every piece of every grasp set, in closed form.

On the piece (j, k), ``{M_j < 0 < M_k}``, the margin LP is

    max ε   s.t.   M_j/s_j + ε <= 0 <= M_k/s_k - ε ,   0 <= f <= 1 .

It has two rows, so one multiplier y in [0, 1] solves it: with ``M_k/s_k = α + a·f`` and
``M_j/s_j = β + b·f``,

    ε* = min over y of  y α - (1 - y) β + Σ_i max(0, y a_i - (1 - y) b_i) ,

convex and piecewise linear in y, with its breakpoints at ``y_i = b_i / (a_i + b_i)``. The least
value over 0, 1 and the breakpoints is the optimum: all pieces of all sets at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.torque import TorqueFunctions

_CHUNK = 20_000


def piece_margins(functions: TorqueFunctions) -> FloatArray:
    """Return the largest margin on every piece (j, k) of every set.

    Parameters
    ----------
    functions : TorqueFunctions
        N combinations, J functions each.

    Returns
    -------
    numpy.ndarray, shape (N, J, J)
        Entry (j, k): the optimum ε* of the piece ``{M_j < 0 < M_k}``, a signed length; -inf for
        j = k, for padding and where the rays do not span.
    """
    alpha, a = functions.offsets[:, None, :], functions.slopes[:, None, :, :]
    beta, b = functions.offsets[:, :, None], functions.slopes[:, :, None, :]

    def value(y: FloatArray | float) -> FloatArray:
        total = y * alpha - (1 - y) * beta
        for i in range(functions.m):
            total = total + np.maximum(0.0, y * a[..., i] - (1 - y) * b[..., i])
        return np.asarray(total)

    best = np.minimum(value(0.0), value(1.0))
    for i in range(functions.m):
        both = a[..., i] + b[..., i]
        y = np.divide(b[..., i], both, out=np.zeros(both.shape), where=both > 0)
        best = np.minimum(best, value(y))
    j = functions.valid.shape[1]
    pairs = functions.valid[:, :, None] & functions.valid[:, None, :] & ~np.eye(j, dtype=bool)
    return np.where(pairs & functions.spans[:, None, None], best, -np.inf)


def best_pieces(functions: TorqueFunctions) -> tuple[FloatArray, IntArray]:
    """Return the largest margin of every set, and the piece that attains it.

    Parameters
    ----------
    functions : TorqueFunctions

    Returns
    -------
    margins : numpy.ndarray, shape (N,)
    pieces : numpy.ndarray of int, shape (N, 2)
        The functions j and k of the best piece; the first among equals.
    """
    margins, pieces = [], []
    for first in range(0, len(functions), _CHUNK):
        part = functions.take(np.arange(first, min(first + _CHUNK, len(functions))))
        of_pieces = piece_margins(part)
        n, j = of_pieces.shape[:2]
        flat = of_pieces.reshape(n, -1)
        chosen = flat.argmax(axis=1)
        margins.append(flat[np.arange(n), chosen])
        pieces.append(np.stack((chosen // j, chosen % j), axis=1))
    if not margins:
        return np.zeros(0), np.zeros((0, 2), dtype=np.intp)
    return np.concatenate(margins), np.concatenate(pieces).astype(np.intp)


def existing_pieces(functions: TorqueFunctions) -> NDArray[np.intp]:
    """Return all pieces with a positive margin as rows (set, j, k), best first within a set.

    Parameters
    ----------
    functions : TorqueFunctions

    Returns
    -------
    numpy.ndarray of int, shape (P, 3)
    """
    of_pieces = piece_margins(functions)
    row, j, k = np.nonzero(of_pieces > 0)
    order = np.lexsort((k, j, -of_pieces[row, j, k], row))
    return np.stack((row, j, k), axis=1)[order].astype(np.intp)
