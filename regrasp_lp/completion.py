"""Whole grasps from held contacts: the contacts that are free, one after the other.

With the other free contacts at 0 for D and at 1 for U, a free contact may be anywhere in an open
interval, and then the next one is looked at (``docs/theory.md``, Corollary 4).
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

import numpy as np

from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.torque import TorqueFunctions


def complete(functions: TorqueFunctions, slots: IntArray, points: FloatArray) -> FloatArray:
    """Return grasps with given held contacts, one of each combination.

    Parameters
    ----------
    functions : TorqueFunctions
        N combinations of m contacts.
    slots : numpy.ndarray of int, shape (N, h)
        Which contacts are held; -1 for none.
    points : numpy.ndarray, shape (N, h)
        Their fractions; any number where there is no contact.

    Returns
    -------
    numpy.ndarray, shape (N, m)
        Strictly inside the grasp set, if the held contacts allow it and some doubles are; this
        can be told by `TorqueFunctions.contain`.
    """
    n, m = functions.edges.shape
    every = np.arange(n)
    fractions, known = np.zeros((n, m)), np.zeros((n, m + 1), dtype=bool)
    for slot, point in zip(slots.T, points.T, strict=True):
        fractions[every, slot] = np.where(slot >= 0, point, fractions[every, slot])
        known[every, slot] = True  # -1 writes to the column beyond
    known = known[:, :m]
    for c in range(m):
        moved = np.einsum("njm,nm->nj", functions.slopes, np.where(known, fractions, 0.0))
        others = ~known
        others[:, c] = False
        rises = np.einsum("njm,nm->nj", functions.slopes, others.astype(float))
        low, high = _interval(functions, functions.offsets + moved, rises, c)
        free = ~known[:, c]
        fractions[free, c] = ((low + high) / 2)[free]
        known[:, c] = True
    outside = np.flatnonzero(~functions.contain(fractions))
    for row in outside.tolist():
        held = zip(slots[row].tolist(), points[row].tolist(), strict=True)
        exact = complete_exactly(functions, row, {s: Fraction(p) for s, p in held if s >= 0})
        if exact is not None:
            fractions[row] = [float(f) for f in exact]
    return fractions


def _interval(
    functions: TorqueFunctions, below: FloatArray, rises: FloatArray, c: int
) -> tuple[FloatArray, FloatArray]:
    """Where contact c may be: functions `below` with the other free ones at 0, + rises at 1."""
    slope = functions.slopes[:, :, c]
    above = below + rises
    root = np.divide(-below, slope, out=np.where(below < 0, 2.0, -1.0), where=slope > 0)
    delta = np.where(functions.valid, root, -1.0).max(axis=1)
    root = np.divide(-above, slope, out=np.where(above > 0, -1.0, 2.0), where=slope > 0)
    upsilon = np.where(functions.valid, root, 2.0).min(axis=1)
    return np.clip(upsilon, 0.0, 1.0), np.clip(delta, 0.0, 1.0)


def complete_exactly(
    functions: TorqueFunctions, row: int, held: Mapping[int, Fraction]
) -> list[Fraction] | None:
    """Return a grasp of one combination with given held contacts, in rational numbers.

    Parameters
    ----------
    functions : TorqueFunctions
    row : int
    held : mapping of int to Fraction
        Fractions by contact.

    Returns
    -------
    list of Fraction or None
        None if there is none.
    """
    constants, slopes = functions.exact_coefficients(row)
    fractions = dict(held)
    zero, one = Fraction(0), Fraction(1)
    for c in range(functions.m):
        if c in fractions:
            continue
        others = [i for i in range(functions.m) if i not in fractions and i != c]
        low, high = Fraction(2), Fraction(-1)
        for constant, slope in zip(constants, slopes, strict=True):
            below = constant + sum(slope[i] * f for i, f in fractions.items())
            above = below + sum(slope[i] for i in others)
            if slope[c]:
                high, low = max(high, -below / slope[c]), min(low, -above / slope[c])
            else:
                high = Fraction(2) if below < 0 else high
                low = Fraction(-1) if above > 0 else low
        if not (low < high and low < one and high > zero):
            return None
        fractions[c] = (max(low, zero) + min(high, one)) / 2
    grasp = [fractions[c] for c in range(functions.m)]
    values = [
        constant + sum(s * f for s, f in zip(slope, grasp, strict=True))
        for constant, slope in zip(constants, slopes, strict=True)
    ]
    return grasp if min(values) < 0 < max(values) else None
