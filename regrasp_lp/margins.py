"""The best margin of every piece of every grasp set, in closed form.

On the piece (j, k), ``{M_j < 0 < M_k}``, the margin LP is

    max ε   s.t.   M_j/s_j + ε <= 0 <= M_k/s_k - ε ,   0 <= f <= 1 .

It has two rows, so one multiplier y in [0, 1] solves it: with ``M_k/s_k = α + a·f`` and
``M_j/s_j = β + b·f``,

    ε* = min over y of  y α - (1 - y) β + Σ_i max(0, y a_i - (1 - y) b_i) ,

convex and piecewise linear in y, with its breakpoints at ``y_i = b_i / (a_i + b_i)``. The least
value over 0, 1 and the breakpoints is the optimum: all pieces of all sets at once. The multiplier
y tells where the optimum is attained, too: a contact is at 1 where ``y a_i > (1 - y) b_i``, at 0
where it is less, and those in between are where both rows are tight.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.torque import TorqueFunctions

_CHUNK = 20_000
_TIED = 1e-12  # of the slopes: contacts that make the same difference, but for rounding


def largest_margins(
    alpha: FloatArray,
    a: FloatArray,
    beta: FloatArray,
    b: FloatArray,
    ends: FloatArray | None = None,
) -> FloatArray:
    """Return ``max ε  s.t.  β + b·f + ε <= 0 <= α + a·f - ε,  0 <= f <= 1``, of many at once.

    For tolerances the box shrinks, too, ``ε e_i <= f_i <= 1 - ε e_i``: then the multiplier y bounds
    ε by the value above over ``1 + Σ_i e_i |y a_i - (1 - y) b_i|``, a quotient of piecewise linear
    functions of y, which is least at a breakpoint as well.

    Parameters
    ----------
    alpha, beta : numpy.ndarray, shape (...)
    a, b : numpy.ndarray, shape (..., m)
        Not negative.
    ends : numpy.ndarray, shape (..., m), optional
        ``e``: 1 over the length of the edge; 0 where an end does not count.

    Returns
    -------
    numpy.ndarray, shape (...)

    Examples
    --------
    >>> line = np.array(-1.0), np.array([3.0]), np.array(-1.0), np.array([1.0])
    >>> float(largest_margins(*line)), float(largest_margins(*line, ends=np.array([0.5])))
    (0.5, 0.5)
    """
    m = a.shape[-1]

    def value(y: FloatArray | float) -> FloatArray:
        total, rate = y * alpha - (1 - y) * beta, np.asarray(1.0)
        for i in range(m):
            lift = y * a[..., i] - (1 - y) * b[..., i]
            total = total + np.maximum(0.0, lift)
            if ends is not None:
                rate = rate + ends[..., i] * np.abs(lift)
        return np.asarray(total if ends is None else total / rate)

    best = np.minimum(value(0.0), value(1.0))
    for i in range(m):
        both = a[..., i] + b[..., i]
        y = np.divide(b[..., i], both, out=np.zeros(both.shape), where=both > 0)
        best = np.minimum(best, value(y))
    if ends is not None:
        half = np.divide(0.5, ends, out=np.full(ends.shape, np.inf), where=ends > 0)
        best = np.minimum(best, half.min(axis=-1))
    return np.asarray(best)


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
    best = largest_margins(
        functions.offsets[:, None, :],
        functions.slopes[:, None, :, :],
        functions.offsets[:, :, None],
        functions.slopes[:, :, None, :],
    )
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


def best_points(functions: TorqueFunctions, pieces: IntArray) -> FloatArray:
    """Return where the margin on one piece of every set is largest.

    Parameters
    ----------
    functions : TorqueFunctions
    pieces : numpy.ndarray of int, shape (N, 2)
        The functions j and k.

    Returns
    -------
    numpy.ndarray, shape (N, m)
        Fractions. Contacts that make no difference are in the middle of their edges, those that
        make the same difference at the same fraction, those that only have to be beyond some
        place half-way between that and the end.
    """
    every = np.arange(len(functions))
    j, k = pieces.T
    return optimal_points(
        functions.offsets[every, k],
        functions.slopes[every, k],
        functions.offsets[every, j],
        functions.slopes[every, j],
    )


def optimal_points(alpha: FloatArray, a: FloatArray, beta: FloatArray, b: FloatArray) -> FloatArray:
    """Return where the optima of `largest_margins` are attained, as `best_points` chooses them.

    Parameters
    ----------
    alpha, beta : numpy.ndarray, shape (N,)
    a, b : numpy.ndarray, shape (N, m)

    Returns
    -------
    numpy.ndarray, shape (N, m)
    """
    every = np.arange(len(alpha))
    both = a + b
    moves = both > 0
    ends = np.divide(b, both, out=np.zeros(b.shape), where=moves)
    y = np.pad(ends, ((0, 0), (2, 0)))
    y[:, 1] = 1.0
    lift = y[:, :, None] * a[:, None, :] - (1 - y[:, :, None]) * b[:, None, :]
    value = y * alpha[:, None] - (1 - y) * beta[:, None] + np.maximum(lift, 0.0).sum(axis=2)
    best = value.argmin(axis=1)
    lift = lift[every, best]
    tied = moves & (np.abs(lift) <= _TIED * both)
    fractions = np.where(moves, (lift > 0).astype(float), 0.5)
    rest = np.where(tied, 0.0, fractions)
    above, below = alpha + (a * rest).sum(axis=1), beta + (b * rest).sum(axis=1)
    slope = np.where(tied, both, 0.0).sum(axis=1)

    def shared(excess: FloatArray) -> FloatArray:
        ratio = np.divide(excess, slope, out=np.zeros(len(every)), where=slope > 0)
        return np.asarray(np.clip(ratio, 0.0, 1.0))

    margin = value[every, best]
    # Both rows tight; or only that of j, then k leaves a part of the edges; or only that of k.
    place = np.select(
        (best == 0, best == 1),
        ((shared(margin - above) + 1) / 2, shared(-margin - below) / 2),
        shared(-above - below),
    )
    return np.where(tied, place[:, None], fractions)


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
