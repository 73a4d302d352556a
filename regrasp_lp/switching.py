"""Can a hand switch between two grasp sets while it holds some contacts? Decided exactly.

**One held contact.** A projection on one contact is an open interval (υ, δ); two of them and the
edge [0, 1] must have a point in common.

**Two held contacts.** At a given position x of the first, the second may be in an open interval
(υ, δ): δ the least over both sets of ``max_j root_j(x)``, υ the greatest of ``min_k root_k(x)``.
δ is convex in x for each set and υ concave, so the x where the δ of one is at or below the υ of the
other, or some δ at or below 0, or some υ at or above 1, are at most six *bad intervals*. The switch
exists iff they do not cover [0, 1] (``docs/theory.md``).

A yes is proved by a point at which all signs are beyond their rounding errors, a no by bad
intervals that cover [0, 1] although they were made smaller by the rounding errors. What is left
is decided in rational numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import UNIT_ROUNDOFF, BoolArray, FloatArray, IntArray
from regrasp_lp.shadows import GRID, Shadows

_CHUNK = 50_000

Interval = tuple[Fraction, Fraction]
ExactShadow = tuple[list[list[Fraction]], list[list[Fraction]]]

REASONS = ("d0<=u1", "d1<=u0", "d0<=0", "u0>=1", "d1<=0", "u1>=1")
"""Why a position of the held contacts is bad, in the order in which bad intervals are listed: δ
and υ of the first set (0) and of the second one (1)."""


@dataclass(frozen=True, eq=False)
class Meeting:
    """Whether aligned projections have a common point, and which.

    Parameters
    ----------
    exist : numpy.ndarray of bool, shape (P,)
    points : numpy.ndarray, shape (P, h)
        Fractions of the held contacts at such a point; NaN where there is none. Where no double
        is inside, the nearest ones.
    exactly : numpy.ndarray of bool, shape (P,)
        Which were left open by floating point, and decided in rational numbers.
    """

    exist: BoolArray
    points: FloatArray
    exactly: BoolArray

    @classmethod
    def unknown(cls, count: int, held: int) -> Meeting:
        """Return arrays to be filled in: no pair has a common point."""
        none = np.zeros(count, dtype=bool)
        return cls(none, np.full((count, held), np.nan), none.copy())

    def write(self, rows: IntArray, found: Meeting) -> None:
        """Fill in some of the pairs."""
        self.exist[rows], self.points[rows] = found.exist, found.points
        self.exactly[rows] = found.exactly


def meet(
    first: Shadows, second: Shadows, i: IntArray | None = None, j: IntArray | None = None
) -> Meeting:
    """Decide whether projections on the same held contacts have a common point, exactly.

    Parameters
    ----------
    first, second : Shadows
        Pair n is ``first[i[n]]`` and ``second[j[n]]``, held on the same edges in the same order;
        one or two held contacts.
    i, j : numpy.ndarray of int, shape (P,), optional
        All in order by default: the two are aligned.

    Returns
    -------
    Meeting

    Raises
    ------
    OptionError
        If more contacts are held: see `contact_rule.meet_held`.
    """
    i = np.arange(len(first)) if i is None else i
    j = np.arange(len(second)) if j is None else j
    if first.held > 2 and len(i) > 0:
        raise OptionError(f"{first.held} held contacts: decide by `contact_rule.meet_held`")
    result = Meeting.unknown(len(i), first.held)
    decide = _one_held if first.held == 1 else _two_held
    for start in range(0, len(i), _CHUNK):
        rows = np.arange(start, min(start + _CHUNK, len(i)))
        open_ = rows[_seen(first, second, i[rows], j[rows], rows, result)]
        if open_.size:
            result.write(open_, decide(first.take(i[open_]), second.take(j[open_])))
    return result


def certainly_apart(first: Shadows, second: Shadows, i: IntArray, j: IntArray) -> BoolArray:
    """Whether projections have no common point for certain, in floating point alone, (P,).

    Unlike `meet` it asks only the arrays of the projections, not the sets behind them, so that
    these arrays may have been shifted.

    Parameters
    ----------
    first, second : Shadows
    i, j : numpy.ndarray of int, shape (P,)
        As for `meet`.
    """
    apart = np.zeros(len(i), dtype=bool)
    for start in range(0, len(i), _CHUNK):
        rows = np.arange(start, min(start + _CHUNK, len(i)))
        unknown = Meeting.unknown(len(i), first.held)
        open_ = rows[_seen(first, second, i[rows], j[rows], rows, unknown)]
        pair = first.take(i[open_]), second.take(j[open_])
        if first.held == 1:
            apart[open_] = certain_reasons(*pair).any(axis=1)
        elif open_.size:
            apart[open_] = _bad_between_positions(*pair)
            left = np.flatnonzero(~apart[open_])
            apart[open_[left]] = _covered(bad_intervals((pair[0].take(left), pair[1].take(left))))
    return apart


def _seen(
    first: Shadows, second: Shadows, i: IntArray, j: IntArray, rows: IntArray, result: Meeting
) -> IntArray:
    """Write the pairs that meet at a few positions of the first contact; return the others."""
    (low, high), (other_low, other_high) = first.on_grid, second.on_grid
    low, high = np.maximum(low[i], other_low[j]), np.minimum(high[i], other_high[j])
    width = np.minimum(high, 1.0) - np.maximum(low, 0.0)
    every, best = np.arange(len(i)), width.argmax(axis=1)
    yes, middle = _between(low[every, best], high[every, best])
    result.exist[rows] = yes
    points = np.stack((GRID[best], middle), axis=1)[:, -first.held :]
    result.points[rows[yes]] = points[yes]
    return np.flatnonzero(~yes)


def _between(low: FloatArray, high: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Whether there is a double between bounds and in [0, 1], and one: a proof."""
    low, high = np.clip(low, 0.0, 2.0), np.clip(high, -1.0, 1.0)
    middle = (low + high) / 2
    return (low < middle) & (middle < high), middle


def _one_held(first: Shadows, second: Shadows) -> Meeting:
    """Pairs whose intervals do not meet for certain; in rational numbers if not even that."""
    result = Meeting.unknown(len(first), 1)
    certain = certain_reasons(first, second).any(axis=1)
    for n in np.flatnonzero(~certain).tolist():
        _write_exact(result, n, exact_one_held(first.exact(n), second.exact(n)))
    return result


def certain_reasons(first: Shadows, second: Shadows, x: FloatArray | float = 0.0) -> BoolArray:
    """Return which of `REASONS` certainly keep aligned projections apart, (P, 6).

    Parameters
    ----------
    first, second : Shadows
        On one held contact, or on two with the first one at x.
    x : numpy.ndarray, shape (P,), or float
    """
    (u0, d0), (u1, d1) = (s.limits(x, inner=False) for s in (first, second))
    # Some t from -1 to 2 has δ <= t <= υ: so far from the edge the bounds of errors still hold.
    orders = [np.maximum(d, -1.0) <= np.minimum(u, 2.0) for d, u in ((d0, u1), (d1, u0))]
    return np.stack((*orders, d0 <= 0, u0 >= 1, d1 <= 0, u1 >= 1), axis=1)


def _two_held(first: Shadows, second: Shadows) -> Meeting:
    result = Meeting.unknown(len(first), 2)
    open_ = np.flatnonzero(~_bad_between_positions(first, second))
    if open_.size:
        result.write(open_, _by_intervals(first.take(open_), second.take(open_)))
    return result


def _bad_between_positions(first: Shadows, second: Shadows) -> BoolArray:
    """Whether between any two neighbours of `GRID` one reason holds at both, hence in between."""
    at = [certain_reasons(first, second, x) for x in GRID]
    between = [(here & there).any(axis=1) for here, there in pairwise(at)]
    return np.asarray(np.logical_and.reduce(between))


def _by_intervals(first: Shadows, second: Shadows) -> Meeting:
    """Bad intervals that leave a gap or not; in rational numbers if that does not decide."""
    result = Meeting.unknown(len(first), 2)
    bad = bad_intervals((first, second))
    covered = _covered(bad)
    for x in _gaps(bad):
        rest = np.flatnonzero(~covered & ~result.exist)
        (low, high), (other_low, other_high) = (
            s.take(rest).limits(x[rest]) for s in (first, second)
        )
        yes, middle = _between(np.maximum(low, other_low), np.minimum(high, other_high))
        result.exist[rest] = yes
        result.points[rest[yes]] = np.stack((x[rest], middle), axis=1)[yes]
    for n in np.flatnonzero(~covered & ~result.exist).tolist():
        _write_exact(result, n, exact_two_held(first.exact(n), second.exact(n)))
    return result


def _write_exact(result: Meeting, n: int, point: tuple[Fraction, ...] | None) -> None:
    result.exactly[n] = True
    result.exist[n] = point is not None
    if point is not None:
        result.points[n] = [float(x) for x in point]


def bad_intervals(both: tuple[Shadows, Shadows]) -> tuple[FloatArray, FloatArray]:
    """Return the bad intervals of x, shape (P, 6) each end; empty ones have their ends exchanged.

    Every inequality is made stricter by its rounding error, so that what is called bad is bad.

    Parameters
    ----------
    both : tuple of two Shadows
        Aligned, on two held contacts.

    Returns
    -------
    lower, upper : numpy.ndarray, shape (P, 6)
        One column for each of `REASONS`.
    """
    first, second = both
    ends = [_root_order(first, second), _root_order(second, first)]
    for s in both:
        a, b = s.slopes[:, :, 0], s.slopes[:, :, 1]
        error = 4 * s.errors
        ends.append(_half_lines(s.low - error, a, s.valid))  # δ <= 0
        ends.append(_half_lines(-(s.high + b) - error, -a, s.valid))  # υ >= 1
    lower, upper = (np.stack(end, axis=1) for end in zip(*ends, strict=True))
    return np.maximum(lower, 0.0), np.minimum(upper, 1.0)


def _root_order(s: Shadows, t: Shadows) -> tuple[FloatArray, FloatArray]:
    """Where δ of s is at or below υ of t: all their roots in that order.

    ``root_j <= root_k`` is ``(l_j + a_j x) b_k >= (h_k + a_k x) b_j``; where a function does not
    depend on the second contact it is ``l_j + a_j x >= 0``, or ``h_k + a_k x <= 0``.
    """
    low, a_j, b_j = (v[:, :, None] for v in (s.low, s.slopes[:, :, 0], s.slopes[:, :, 1]))
    high, a_k, b_k = (v[:, None, :] for v in (t.high, t.slopes[:, :, 0], t.slopes[:, :, 1]))
    e_j, e_k = s.errors[:, :, None], t.errors[:, None, :]
    size_j, size_k = np.abs(low) + a_j + b_j, np.abs(high) + a_k + b_k
    error = 2 * (e_j * size_k + e_k * size_j) + 16 * UNIT_ROUNDOFF * size_j * size_k
    constant = low * b_k - high * b_j - error
    slope = a_j * b_k - a_k * b_j
    depend = (b_j > 0) & (b_k > 0) & s.valid[:, :, None] & t.valid[:, None, :]
    flat = (len(s), low.shape[1] * high.shape[2])
    pairs = _half_lines(constant.reshape(flat), slope.reshape(flat), depend.reshape(flat))
    fixed_j = s.valid & (s.slopes[:, :, 1] == 0)
    fixed_k = t.valid & (t.slopes[:, :, 1] == 0)
    left = _half_lines(s.low - 4 * s.errors, s.slopes[:, :, 0], fixed_j)
    right = _half_lines(-t.high - 4 * t.errors, -t.slopes[:, :, 0], fixed_k)
    lower = np.maximum(np.maximum(pairs[0], left[0]), right[0])
    return lower, np.minimum(np.minimum(pairs[1], left[1]), right[1])


def _half_lines(
    constant: FloatArray, slope: FloatArray, valid: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """The interval of x in which ``constant + slope x >= 0`` for all valid columns."""
    end = np.divide(-constant, slope, out=np.zeros(slope.shape), where=slope != 0)
    slack = 4 * UNIT_ROUNDOFF * np.abs(end)
    lower = np.where(valid & (slope > 0), end + slack, -np.inf).max(axis=1)
    upper = np.where(valid & (slope < 0), end - slack, np.inf).min(axis=1)
    never = (valid & (slope == 0) & (constant < 0)).any(axis=1)
    return np.where(never, np.inf, lower), np.where(never, -np.inf, upper)


def _covered(intervals: tuple[FloatArray, FloatArray]) -> BoolArray:
    """Whether closed intervals cover [0, 1], row by row."""
    order = np.argsort(intervals[0], axis=1)
    lower, upper = (np.take_along_axis(end, order, axis=1) for end in intervals)
    reached = np.zeros(len(lower))
    for i in range(lower.shape[1]):
        joins = (lower[:, i] <= reached) & (upper[:, i] >= lower[:, i])
        reached = np.where(joins, np.maximum(reached, upper[:, i]), reached)
    return np.asarray(reached >= 1)


def _gaps(intervals: tuple[FloatArray, FloatArray]) -> list[FloatArray]:
    """Positions that are in no interval if any is: 0, 1 and the middles between ends."""
    n = len(intervals[0])
    lower, upper = intervals
    real = lower <= upper
    inside = np.concatenate((np.where(real, lower, 0.0), np.where(real, upper, 1.0)), axis=1)
    ends = np.concatenate((np.zeros((n, 1)), inside, np.ones((n, 1))), axis=1)
    ends = np.sort(np.clip(ends, 0.0, 1.0), axis=1)
    middles = (ends[:, 1:] + ends[:, :-1]) / 2
    points = np.concatenate((ends[:, :1], ends[:, -1:], middles), axis=1)
    bad = ((lower[:, None] <= points[:, :, None]) & (points[:, :, None] <= upper[:, None])).any(2)
    # One candidate per gap: the widest first, so that one or two tries are the rule.
    width = np.concatenate((np.zeros((n, 2)), np.diff(ends, axis=1)), axis=1)
    order = np.argsort(np.where(bad, np.inf, -width), axis=1, kind="stable")
    points = np.take_along_axis(points, order, axis=1)
    return [points[:, i] for i in range(3)]


def exact_one_held(*both: ExactShadow) -> tuple[Fraction] | None:
    """Return the middle of the interval in which one contact can be held, None if empty."""
    delta = min(_exact_delta(below) for below, _ in both)
    upsilon = max(_exact_upsilon(above) for _, above in both)
    if upsilon < delta and upsilon < 1 and delta > 0:
        return ((max(upsilon, Fraction(0)) + min(delta, Fraction(1))) / 2,)
    return None


def exact_one_held_reason(first: ExactShadow, second: ExactShadow) -> str | None:
    """Return one of `REASONS` that keeps projections on one contact apart, if there is any."""
    d0, d1 = (_exact_delta(below) for below, _ in (first, second))
    u0, u1 = (_exact_upsilon(above) for _, above in (first, second))
    # Where some function is constant a bound stands for an infinite one; then one of the last
    # four holds, which are looked at first.
    holds = (d0 <= u1, d1 <= u0, d0 <= 0, u0 >= 1, d1 <= 0, u1 >= 1)
    reasons = [why for why, true in zip(REASONS, holds, strict=True) if true]
    return reasons[-1] if reasons else None


_ALWAYS, _NEVER = Fraction(2), Fraction(-1)  # beyond the edge [0, 1] on either side


def _exact_delta(below: list[list[Fraction]]) -> Fraction:
    """Greatest root of the functions of D, in one contact."""
    return max((_ALWAYS if c < 0 else _NEVER) if a == 0 else -c / a for c, a in below)


def _exact_upsilon(above: list[list[Fraction]]) -> Fraction:
    """Least root of the functions of U, in one contact."""
    return min((_NEVER if c > 0 else _ALWAYS) if a == 0 else -c / a for c, a in above)


def exact_two_held(*both: ExactShadow) -> tuple[Fraction, Fraction] | None:
    """Return a position of two held contacts that both sets allow, None if there is none."""
    bad = [interval for interval in exact_bad_intervals(*both) if interval is not None]
    ends = sorted({Fraction(0), Fraction(1), *(end for interval in bad for end in interval)})
    points = [(p + q) / 2 for p, q in pairwise(ends)] + [Fraction(0), Fraction(1)]
    for x in points:
        if not any(low <= x <= high for low, high in bad):
            y = exact_one_held(*(_slice(shadow, x) for shadow in both))
            if y is not None:
                return x, *y
    return None


def _slice(shadow: ExactShadow, x: Fraction) -> ExactShadow:
    """The projection on the second held contact, with the first at x."""
    below, above = ([[c + a * x, b] for c, a, b in functions] for functions in shadow)
    return below, above


def exact_bad_intervals(*both: ExactShadow) -> list[Interval | None]:
    """Return the bad intervals of x in rational numbers, one for each of `REASONS`."""
    whole = [tuple(_in_integers(functions) for functions in shadow) for shadow in both]
    intervals = []
    for (below, _), (_, above) in (whole, whole[::-1]):
        conditions = [(c, a) for c, a, b in below if b == 0]
        conditions += [(-c, -a) for c, a, b in above if b == 0]
        conditions += [
            (c * b_k - c_k * b, a * b_k - a_k * b)
            for c, a, b in below
            if b > 0
            for c_k, a_k, b_k in above
            if b_k > 0
        ]
        intervals.append(_exact_half_lines(conditions))
    for below, above in whole:
        intervals.append(_exact_half_lines((c, a) for c, a, _ in below))
        intervals.append(_exact_half_lines((-(c + b), -a) for c, a, b in above))
    return intervals


def _in_integers(functions: list[list[Fraction]]) -> list[list[int]]:
    """Functions times positive numbers that make them integral: signs and roots stay."""
    units = [math.lcm(*(v.denominator for v in function)) for function in functions]
    return [
        [v.numerator * (unit // v.denominator) for v in function]
        for function, unit in zip(functions, units, strict=True)
    ]


def _exact_half_lines(conditions: Iterable[tuple[int, int]]) -> Interval | None:
    """The part of [0, 1] where ``constant + slope x >= 0`` throughout; None if empty."""
    lower, upper = Fraction(0), Fraction(1)
    for constant, slope in conditions:
        if slope > 0:
            lower = max(lower, Fraction(-constant, slope))
        elif slope < 0:
            upper = min(upper, Fraction(-constant, slope))
        elif constant < 0:
            return None
        if lower > upper:
            return None
    return lower, upper
