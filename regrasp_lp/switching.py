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

from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise

import numpy as np

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import UNIT_ROUNDOFF, BoolArray, FloatArray
from regrasp_lp.shadows import Shadows

_CHUNK = 50_000
_GRID = np.linspace(0.0, 1.0, 9)


def can_switch(first: Shadows, second: Shadows) -> BoolArray:
    """Whether projections on the same held contacts have a common point, exactly.

    Parameters
    ----------
    first, second : Shadows
        Aligned: pair i is ``first[i]`` and ``second[i]``, held on the same edges in the same
        order; one or two held contacts.

    Returns
    -------
    numpy.ndarray of bool, shape (P,)

    Raises
    ------
    OptionError
        If more contacts are held: there is no closed form, only a margin LP.
    """
    if first.held > 2 and len(first) > 0:
        raise OptionError(f"{first.held} held contacts: decide by `handovers.decide_held`")
    decide = _one_held if first.held == 1 else _two_held
    parts = [
        decide(*(s.take(np.arange(i, min(i + _CHUNK, len(first)))) for s in (first, second)))
        for i in range(0, len(first), _CHUNK)
    ]
    return np.concatenate(parts) if parts else np.zeros(0, dtype=bool)


def _one_held(first: Shadows, second: Shadows) -> BoolArray:
    """Intervals with error bounds on both sides; exact where they do not decide."""
    inner, outer = (
        (
            np.maximum(*(_upsilon(s, sign) for s in (first, second))),
            np.minimum(*(_delta(s, sign) for s in (first, second))),
        )
        for sign in (1.0, -1.0)
    )
    yes, possible = ((u < d) & (u < 1) & (d > 0) for u, d in (inner, outer))
    for i in np.flatnonzero(possible & ~yes).tolist():
        yes[i] = _exact_one_held(first.exact(i), second.exact(i))
    return np.asarray(yes)


def _delta(shadow: Shadows, sign: float) -> FloatArray:
    """Lower (sign 1) or upper (sign -1) bound of δ: the greatest root of the functions of D."""
    a = shadow.slopes[:, :, 0]
    value = -(shadow.low + 2 * sign * shadow.errors)
    root = np.divide(value, a, out=np.where(value > 0, np.inf, -np.inf), where=a > 0)
    root = root - sign * 8 * UNIT_ROUNDOFF * np.where(np.isfinite(root), np.abs(root), 0.0)
    return np.asarray(np.where(shadow.valid, root, -np.inf).max(axis=1))


def _upsilon(shadow: Shadows, sign: float) -> FloatArray:
    """Upper (sign 1) or lower (sign -1) bound of υ: the least root of the functions of U."""
    a = shadow.slopes[:, :, 0]
    value = -(shadow.high - 2 * sign * shadow.errors)
    root = np.divide(value, a, out=np.where(value < 0, -np.inf, np.inf), where=a > 0)
    root = root + sign * 8 * UNIT_ROUNDOFF * np.where(np.isfinite(root), np.abs(root), 0.0)
    return np.asarray(np.where(shadow.valid, root, np.inf).min(axis=1))


def _two_held(first: Shadows, second: Shadows) -> BoolArray:
    both = (first, second)
    n = len(first)
    # A few positions of the first held contact, and the middle for the second, prove most.
    gap, y = np.full((n, len(_GRID)), -np.inf), np.zeros((n, len(_GRID)))
    for column, x in enumerate(_GRID):
        low, high = _allowed(both, np.full(n, x))
        gap[:, column], y[:, column] = high - low, (low + high) / 2
    best, every = gap.argmax(axis=1), np.arange(n)
    yes = _proves(both, _GRID[best], y[every, best])
    open_ = np.flatnonzero(~yes)
    if not open_.size:
        return yes
    both = (first.take(open_), second.take(open_))
    bad = _bad_intervals(both)
    covered = _covered(bad)
    found = np.zeros(len(open_), dtype=bool)
    for x in _gaps(_bad_intervals(both, tighten=False)):
        rest = np.flatnonzero(~covered & ~found)
        here = (both[0].take(rest), both[1].take(rest))
        low, high = _allowed(here, x[rest])
        found[rest] = _proves(here, x[rest], (low + high) / 2)
    for i in np.flatnonzero(~covered & ~found).tolist():
        found[i] = _exact_two_held(both[0].exact(i), both[1].exact(i))
    yes[open_] = found
    return yes


def _allowed(both: tuple[Shadows, Shadows], x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The allowed interval of the second held contact at position x of the first, in [0, 1]."""
    low, high = np.zeros(len(x)), np.ones(len(x))
    for shadow in both:
        a, b = shadow.slopes[:, :, 0], shadow.slopes[:, :, 1]
        below = -(shadow.low + a * x[:, None])
        root = np.divide(below, b, out=np.where(below > 0, np.inf, -np.inf), where=b > 0)
        high = np.minimum(high, np.where(shadow.valid, root, -np.inf).max(axis=1))
        above = -(shadow.high + a * x[:, None])
        root = np.divide(above, b, out=np.where(above < 0, -np.inf, np.inf), where=b > 0)
        low = np.maximum(low, np.where(shadow.valid, root, np.inf).min(axis=1))
    return np.maximum(low, -1.0), np.minimum(np.maximum(high, -1.0), 2.0)


def _proves(both: tuple[Shadows, Shadows], x: FloatArray, y: FloatArray) -> BoolArray:
    """Whether the point (x, y) is in both projections, beyond rounding."""
    x, y = np.clip(x, 0, 1), np.clip(y, 0, 1)
    result = np.ones(len(x), dtype=bool)
    for shadow in both:
        moved = shadow.slopes[:, :, 0] * x[:, None] + shadow.slopes[:, :, 1] * y[:, None]
        below = shadow.low + moved + shadow.errors < 0
        above = shadow.high + moved - shadow.errors > 0
        result &= (shadow.valid & below).any(axis=1) & (shadow.valid & above).any(axis=1)
    return result


def _bad_intervals(
    both: tuple[Shadows, Shadows], tighten: bool = True
) -> tuple[FloatArray, FloatArray]:
    """The bad intervals of x, shape (P, 6) each end; empty ones have their ends exchanged.

    With `tighten`, every inequality is made stricter by its rounding error, so that what is
    called bad is bad.
    """
    factor = 1.0 if tighten else 0.0
    first, second = both
    ends = [_root_order(first, second, factor), _root_order(second, first, factor)]
    for s in both:
        a, b = s.slopes[:, :, 0], s.slopes[:, :, 1]
        error = 4 * factor * s.errors
        ends.append(_half_lines(s.low - error, a, s.valid))  # δ <= 0
        ends.append(_half_lines(-(s.high + b) - error, -a, s.valid))  # υ >= 1
    lower, upper = (np.stack(end, axis=1) for end in zip(*ends, strict=True))
    return np.maximum(lower, 0.0), np.minimum(upper, 1.0)


def _root_order(s: Shadows, t: Shadows, factor: float) -> tuple[FloatArray, FloatArray]:
    """Where δ of s is at or below υ of t: all their roots in that order.

    ``root_j <= root_k`` is ``(l_j + a_j x) b_k >= (h_k + a_k x) b_j``; where a function does not
    depend on the second contact it is ``l_j + a_j x >= 0``, or ``h_k + a_k x <= 0``.
    """
    low, a_j, b_j = (v[:, :, None] for v in (s.low, s.slopes[:, :, 0], s.slopes[:, :, 1]))
    high, a_k, b_k = (v[:, None, :] for v in (t.high, t.slopes[:, :, 0], t.slopes[:, :, 1]))
    e_j, e_k = s.errors[:, :, None], t.errors[:, None, :]
    size_j, size_k = np.abs(low) + a_j + b_j, np.abs(high) + a_k + b_k
    error = 2 * (e_j * size_k + e_k * size_j) + 16 * UNIT_ROUNDOFF * size_j * size_k
    constant = low * b_k - high * b_j - factor * error
    slope = a_j * b_k - a_k * b_j
    depend = (b_j > 0) & (b_k > 0) & s.valid[:, :, None] & t.valid[:, None, :]
    n = len(s)
    pairs = _half_lines(constant.reshape(n, -1), slope.reshape(n, -1), depend.reshape(n, -1))
    fixed_j = s.valid & (s.slopes[:, :, 1] == 0)
    fixed_k = t.valid & (t.slopes[:, :, 1] == 0)
    error_j, error_k = 4 * factor * s.errors, 4 * factor * t.errors
    left = _half_lines(s.low - error_j, s.slopes[:, :, 0], fixed_j)
    right = _half_lines(-t.high - error_k, -t.slopes[:, :, 0], fixed_k)
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


ExactShadow = tuple[list[list[Fraction]], list[list[Fraction]]]


def _exact_one_held(*both: ExactShadow) -> bool:
    always, never = Fraction(2), Fraction(-1)
    delta = min(
        max((always if c < 0 else never) if a == 0 else -c / a for c, a in below)
        for below, _ in both
    )
    upsilon = max(
        min((-always if c > 0 else always) if a == 0 else -c / a for c, a in above)
        for _, above in both
    )
    return upsilon < delta and upsilon < 1 and delta > 0


def _exact_two_held(*both: ExactShadow) -> bool:
    """Whether the bad intervals, in rational numbers, leave a point of [0, 1] free."""
    intervals = []
    for (below, above), (_, other_above) in (both, both[::-1]):
        intervals.append(_exact_half_lines((c, a) for c, a, _ in below))
        intervals.append(_exact_half_lines((-(c + b), -a) for c, a, b in above))
        conditions = [(c, a) for c, a, b in below if b == 0]
        conditions += [(-c, -a) for c, a, b in other_above if b == 0]
        conditions += [
            (c * b_k - c_k * b, a * b_k - a_k * b)
            for c, a, b in below
            if b > 0
            for c_k, a_k, b_k in other_above
            if b_k > 0
        ]
        intervals.append(_exact_half_lines(conditions))
    bad = [interval for interval in intervals if interval is not None]
    ends = sorted({Fraction(0), Fraction(1), *(end for interval in bad for end in interval)})
    points = [Fraction(0), Fraction(1)]
    points += [(p + q) / 2 for p, q in pairwise(ends)]
    return any(not any(low <= x <= high for low, high in bad) for x in points)


def _exact_half_lines(
    conditions: Iterable[tuple[Fraction, Fraction]],
) -> tuple[Fraction, Fraction] | None:
    """The part of [0, 1] where ``constant + slope x >= 0`` throughout; None if empty."""
    lower, upper = Fraction(0), Fraction(1)
    for constant, slope in conditions:
        if slope > 0:
            lower = max(lower, -constant / slope)
        elif slope < 0:
            upper = min(upper, -constant / slope)
        elif constant < 0:
            return None
        if lower > upper:
            return None
    return lower, upper
