"""Margin LPs in rational numbers: the last word where bounds in floating point leave a question.

The dual of none of the solvers is needed: an active-set simplex method with Bland's rule, which
never cycles, on problems of a handful of variables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

Vector = list[Fraction]


@dataclass(frozen=True)
class ExactSolution:
    """The optimum of a margin LP.

    Parameters
    ----------
    margin : Fraction
    point : tuple of Fraction
    """

    margin: Fraction
    point: tuple[Fraction, ...]


def exact_margin(rows: Sequence[Sequence[Fraction]], bounds: Sequence[Fraction]) -> ExactSolution:
    """Solve ``max ε  s.t.  rows x + ε <= bounds, 0 <= x <= 1`` exactly.

    Parameters
    ----------
    rows : sequence of sequence of Fraction
        R >= 1 rows over n coordinates, already divided by their scales.
    bounds : sequence of Fraction

    Returns
    -------
    ExactSolution

    Notes
    -----
    At ``x = 0`` with the least bound for ε, n + 1 constraints are tight and independent. From
    there on, a constraint with a negative multiplier is left along the edge that keeps the others
    tight, up to the first constraint in the way; among several the first is taken (Bland).

    Examples
    --------
    >>> half = exact_margin([[Fraction(1)], [Fraction(-1)]], [Fraction(1), Fraction(0)])
    >>> half.margin, half.point
    (Fraction(1, 2), (Fraction(1, 2),))
    """
    n = len(rows[0])
    zero, one = Fraction(0), Fraction(1)
    unit = [[one if i == j else zero for i in range(n)] for j in range(n)]
    left = [[*row, one] for row in rows]
    left += [[-v for v in e] + [zero] for e in unit] + [[*e, zero] for e in unit]
    right = [*bounds, *[zero] * n, *[one] * n]
    least = min(range(len(rows)), key=lambda r: bounds[r])
    tight = [least, *range(len(rows), len(rows) + n)]
    point = [*[zero] * n, bounds[least]]
    gain = [*[zero] * n, one]
    while True:
        active = [left[r] for r in tight]
        multipliers = _solve([list(column) for column in zip(*active, strict=True)], gain)
        leaving = min((t for t, y in zip(tight, multipliers, strict=True) if y < 0), default=None)
        if leaving is None:
            return ExactSolution(point[-1], tuple(point[:-1]))
        along = _solve(active, [-one if t == leaving else zero for t in tight])
        steps = [
            ((right[r] - _dot(left[r], point)) / rise, r)
            for r in range(len(left))
            if r not in tight and (rise := _dot(left[r], along)) > 0
        ]
        step, entering = min(steps)
        point = [p + step * d for p, d in zip(point, along, strict=True)]
        tight[tight.index(leaving)] = entering


def _dot(p: Vector, q: Vector) -> Fraction:
    return sum((a * b for a, b in zip(p, q, strict=True)), Fraction(0))


def _solve(matrix: list[Vector], right: Vector) -> Vector:
    """Solve a regular square system by elimination."""
    system = [[*row, b] for row, b in zip(matrix, right, strict=True)]
    n = len(system)
    for i in range(n):
        pivot = next(r for r in range(i, n) if system[r][i])
        system[i], system[pivot] = system[pivot], system[i]
        head = system[i] = [v / system[i][i] for v in system[i]]
        for r in range(n):
            if r != i and system[r][i]:
                factor = system[r][i]
                system[r] = [v - factor * h for v, h in zip(system[r], head, strict=True)]
    return [row[n] for row in system]
