"""Margins where floating point does not tell them well enough: of thin sets, and in comparisons.

Scales ``s`` are sums of lengths of rays, square roots of integers. They are taken to a relative
accuracy of 2⁻¹⁶⁰, everything else in rational numbers: two margins that agree to 40 digits count
as equal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from regrasp_lp.circuits import exact_weights
from regrasp_lp.friction import BoolArray, Cones, FloatArray, IntArray
from regrasp_lp.margins import piece_margins
from regrasp_lp.torque import ACCURATE, TorqueFunctions

_BITS = 160
EQUAL = Fraction(1, 10**40)
"""Margins that differ by no more of their magnitude are the same margin."""


def certain_margins(
    functions: TorqueFunctions, margins: FloatArray, pieces: IntArray
) -> FloatArray:
    """Return the largest margins of sets, those of thin ones taken from rationals.

    Parameters
    ----------
    functions : TorqueFunctions
    margins : numpy.ndarray, shape (N,)
    pieces : numpy.ndarray of int, shape (N, 2)
        Both from `margins.best_pieces`.

    Returns
    -------
    numpy.ndarray, shape (N,)
        Good to 1e-9 of each margin.
    """
    result = margins.copy()
    errors = np.take_along_axis(functions.errors, pieces, axis=1).sum(axis=1)
    rough = functions.spans & (ACCURATE * np.abs(margins) < errors)
    for row in np.flatnonzero(rough).tolist():
        result[row] = float(largest_margin(functions, row))
    return result


def exceeds(functions: TorqueFunctions, margins: FloatArray, least: float) -> BoolArray:
    """Whether the largest margins of sets are larger than `least`, by enclosures.

    Parameters
    ----------
    functions : TorqueFunctions
    margins : numpy.ndarray, shape (N,)
        From `certain_margins`.
    least : float
        What is equal to it, to 40 digits, is not larger.

    Returns
    -------
    numpy.ndarray of bool, shape (N,)
    """
    larger: BoolArray = margins > least
    open_ = functions.spans & (np.abs(margins - least) <= _errors(functions))
    for row in np.flatnonzero(open_).tolist():
        larger[row] = is_larger(largest_margin(functions, row), least)
    return larger


def is_larger(margin: Fraction, least: float) -> bool:
    """Whether a margin is larger than a double, and not the same to 40 digits."""
    return margin - Fraction(least) > EQUAL * max(abs(margin), Fraction(abs(least)))


def _errors(functions: TorqueFunctions) -> FloatArray:
    """Bound of the errors of margins: of both functions of any piece."""
    return np.asarray(2 * functions.errors.max(axis=1, initial=0.0))


def largest_margin(functions: TorqueFunctions, row: int) -> Fraction:
    """Return the largest margin of a grasp in one set, to 40 digits.

    Parameters
    ----------
    functions : TorqueFunctions
    row : int

    Returns
    -------
    Fraction
    """
    one = functions.take(np.array([row]))
    of_pieces = piece_margins(one)[0]
    near = np.argwhere(of_pieces >= of_pieces.max() - 2 * _errors(one)[0])
    constants, slopes = scaled_functions(functions, row)
    return max(_piece_margin(constants, slopes, j, k) for j, k in near.tolist())


def _piece_margin(
    constants: Sequence[Fraction], slopes: Sequence[Sequence[Fraction]], j: int, k: int
) -> Fraction:
    """The closed form of `margins` for one piece, in integers over one denominator."""
    numbers = [constants[k], constants[j], *slopes[k], *slopes[j]]
    unit = math.lcm(*(v.denominator for v in numbers))
    alpha, beta, *rises = (v.numerator * (unit // v.denominator) for v in numbers)
    pairs = list(zip(rises[: len(slopes[k])], rises[len(slopes[k]) :], strict=True))

    def value(p: int, q: int) -> Fraction:
        """At y = p / q."""
        r = q - p
        return Fraction(p * alpha - r * beta + sum(max(0, p * a - r * b) for a, b in pairs), q)

    breakpoints = [(b, a + b) for a, b in pairs if a + b]
    return min(value(p, q) for p, q in [(0, 1), (1, 1), *breakpoints]) / unit


def piece_rows(
    constants: Sequence[Fraction], slopes: Sequence[Sequence[Fraction]], j: int, k: int
) -> tuple[list[list[Fraction]], list[Fraction]]:
    """Return rows and bounds of the piece ``{M_j < 0 < M_k}``, with scales of 1."""
    rows = [list(slopes[j]), [-slope for slope in slopes[k]]]
    return rows, [-constants[j], constants[k]]


def scaled_functions(
    functions: TorqueFunctions, row: int
) -> tuple[list[Fraction], list[list[Fraction]]]:
    """Return ``M(0) / s`` and ``∂M/∂f / s`` of one combination, as rationals.

    Parameters
    ----------
    functions : TorqueFunctions
    row : int

    Returns
    -------
    constants : list of Fraction
        Lengths in the unit of the object.
    slopes : list of list of Fraction
        One for each contact.
    """
    constants, slopes = functions.exact_coefficients(row)
    unit = functions.cones.exact_unit
    scales = [unit * scale for scale in _scales(functions, row)]
    return (
        [c / s for c, s in zip(constants, scales, strict=True)],
        [[v / s for v in slope] for slope, s in zip(slopes, scales, strict=True)],
    )


def _scales(functions: TorqueFunctions, row: int) -> list[Fraction]:
    """``s`` of the functions of one combination, in the units of `exact_coefficients`."""
    cones, edges = functions.cones, functions.edges[row]
    columns = np.flatnonzero(functions.valid[row])
    rays, weights = functions.ray[row, columns], functions.weight[row, columns]
    exact = exact_weights(cones, rays, weights)
    scales = []
    for column, ray, weight in zip(columns, rays.tolist(), exact.tolist(), strict=True):
        if ray[2] < 0 and ray[0] == ray[1]:  # forward at one contact, back at the other
            pairs = zip(functions.slot[row, column], weight[:2], strict=False)
            scales.append(sum(_length_in_cone(cones, edges[i], ray[0], w) for i, w in pairs))
        else:
            pairs = zip(weight, ray, strict=True)
            scales.append(sum(w * _length(cones, r) for w, r in pairs if r >= 0))
    return [Fraction(scale) for scale in scales]


def _length_in_cone(cones: Cones, edge: int, ray: int, sign: int) -> Fraction:
    """Length of ± a ray written in the boundary rays of the cone of an edge."""
    rays = cones.exact_rays
    (x, y), first, second = sign * rays[ray], rays[2 * edge], rays[2 * edge + 1]
    opening = first[0] * second[1] - first[1] * second[0]
    of_first, of_second = x * second[1] - y * second[0], first[0] * y - first[1] * x
    total = of_first * _length(cones, 2 * edge) + of_second * _length(cones, 2 * edge + 1)
    return Fraction(total / opening)


def _length(cones: Cones, ray: int) -> Fraction:
    x, y = cones.exact_rays[ray]
    square = x * x + y * y
    shift = max(0, _BITS - square.bit_length() // 2)
    return Fraction(math.isqrt(square << 2 * shift), 1 << shift)
