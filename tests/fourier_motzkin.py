"""Whether strict and weak linear inequalities have a solution, in integers.

Fourier and Motzkin's elimination: exact, slow, and as simple as can be. An oracle for everything
that is decided by corners, roots and intervals.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import permutations, product
from math import gcd, lcm

Row = tuple[tuple[int, ...], bool]
"""``(c, a_1, ..., a_n), strict``: ``c + a · x < 0``, or ``<= 0`` if not strict."""


def row(values: Iterable[Fraction | int], *, strict: bool) -> Row:
    """The inequality ``c + a · x < 0`` (or ``<=``), scaled to coprime integers."""
    fractions = [Fraction(v) for v in values]
    unit = lcm(*(v.denominator for v in fractions))
    return _reduced([v.numerator * (unit // v.denominator) for v in fractions]), strict


def _reduced(integers: Sequence[int]) -> tuple[int, ...]:
    common = gcd(*integers)
    return tuple(v // common for v in integers) if common > 1 else tuple(integers)


def box(n: int) -> list[Row]:
    """``0 <= x_i <= 1`` for n coordinates."""
    rows: list[Row] = []
    for i in range(n):
        unit = [0] * (n + 1)
        unit[i + 1] = 1
        rows.append((tuple(-v for v in unit), False))
        rows.append(((-1, *unit[1:]), False))
    return rows


def solvable(rows: Iterable[Row]) -> bool:
    """Whether some x satisfies all inequalities."""
    rows = set(rows)
    n = len(next(iter(rows))[0]) - 1
    for _ in range(n):
        upper = [r for r in rows if r[0][-1] > 0]
        lower = [r for r in rows if r[0][-1] < 0]
        rows = {(r[:-1], strict) for r, strict in rows if r[-1] == 0}
        for (up, up_strict), (low, low_strict) in product(upper, lower):
            merged = [-low[-1] * p + up[-1] * q for p, q in zip(up[:-1], low[:-1], strict=True)]
            rows.add((_reduced(merged), up_strict or low_strict))
        if any(not any(r[1:]) and (r[0] > 0 or (strict and r[0] == 0)) for r, strict in rows):
            return False
    return True


Functions = Sequence[Sequence[Fraction | int]]
"""``[c, a_1, ..., a_n]`` each."""


def piece_rows(functions: Functions, j: int, k: int) -> list[Row]:
    """The rows of ``M_j < 0 < M_k``."""
    return [row(functions[j], strict=True), row([-v for v in functions[k]], strict=True)]


def pieces(functions: Functions) -> list[list[Row]]:
    """The rows of every non-empty piece, the box not among them."""
    n = len(functions[0]) - 1 if functions else 0
    all_rows = [piece_rows(functions, j, k) for j, k in permutations(range(len(functions)), 2)]
    return [rows for rows in all_rows if solvable(rows + box(n))]


def intersect(first: list[list[Row]], second: list[list[Row]], n: int) -> bool:
    """Whether some piece of `first` and some piece of `second` have a point in common."""
    return any(solvable(p + q + box(n)) for p, q in product(first, second))


def widen(functions: Functions, places: Sequence[int], n: int) -> list[list[Fraction | int]]:
    """The same functions over n coordinates, coordinate i at place ``places[i]``."""
    result = []
    for constant, *slopes in functions:
        wide: list[Fraction | int] = [constant, *([0] * n)]
        for place, slope in zip(places, slopes, strict=True):
            wide[place + 1] = slope
        result.append(wide)
    return result
