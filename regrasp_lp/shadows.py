"""Projections of grasp sets on the contacts that a switch holds.

Some positions of the other contacts complete held positions x iff

    min_j M_j(x, 0) < 0 < max_k M_k(x, l) ,

torque functions again, with one constant for D (the others at their starts) and one for U (the
others at their ends). A stack of them is all that deciding switches needs (`switching`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.torque import TorqueFunctions


@dataclass(frozen=True, eq=False)
class Shadows:
    """R projections of grasp sets on h held contacts each, with J functions (padded).

    Parameters
    ----------
    sources : tuple of TorqueFunctions
        The stacks of sets that are projected.
    source, row : numpy.ndarray of int, shape (R,)
        Which set: ``sources[source]``, combination ``row``.
    slots : numpy.ndarray of int, shape (R, h)
        Which of its contacts are held.
    low, high : numpy.ndarray, shape (R, J)
        ``M / s`` with the held contacts at 0 and the others at 0 (low) or 1 (high).
    slopes : numpy.ndarray, shape (R, J, h)
    errors : numpy.ndarray, shape (R, J)
        Bound of the rounding error of any value.
    valid : numpy.ndarray of bool, shape (R, J)
    """

    sources: tuple[TorqueFunctions, ...]
    source: IntArray
    row: IntArray
    slots: IntArray
    low: FloatArray
    high: FloatArray
    slopes: FloatArray
    errors: FloatArray
    valid: BoolArray

    def __len__(self) -> int:
        return len(self.row)

    @property
    def held(self) -> int:
        """Number of held contacts."""
        return int(self.slots.shape[1])

    @cached_property
    def edges(self) -> IntArray:
        """Edges of the held contacts, shape (R, h)."""
        edges = np.zeros(self.slots.shape, dtype=np.intp)
        for number, functions in enumerate(self.sources):
            mine = self.source == number
            edges[mine] = np.take_along_axis(functions.edges[self.row[mine]], self.slots[mine], 1)
        return edges

    def take(self, rows: IntArray) -> Shadows:
        """Return some of the projections (repetitions allowed)."""
        return Shadows(
            self.sources,
            self.source[rows],
            self.row[rows],
            self.slots[rows],
            self.low[rows],
            self.high[rows],
            self.slopes[rows],
            self.errors[rows],
            self.valid[rows],
        )

    def exact(self, index: int) -> tuple[list[list[Fraction]], list[list[Fraction]]]:
        """Return one projection in rational numbers.

        Returns
        -------
        below, above : list of [constant, slope, ...]
            Per function, with the other contacts at 0 and at 1; each up to a positive factor.
        """
        functions = self.sources[self.source[index]]
        held = self.slots[index]
        constant, slopes = functions.exact_coefficients(int(self.row[index]))
        others = [i for i in range(functions.m) if i not in held]
        below = [[c, *(s[i] for i in held)] for c, s in zip(constant, slopes, strict=True)]
        above = [
            [c + sum(s[i] for i in others), *(s[i] for i in held)]
            for c, s in zip(constant, slopes, strict=True)
        ]
        return below, above


def shadows(
    sources: Sequence[TorqueFunctions],
    held: int,
    rows: Sequence[IntArray] | None = None,
    *,
    ordered: bool = False,
) -> Shadows:
    """Return the projections of sets on every choice of held contacts.

    Two contacts on one edge are interchangeable: choices that differ by exchanging them are one,
    unless the contacts are `ordered` along the edge.

    Parameters
    ----------
    sources : sequence of TorqueFunctions
    held : int
        How many contacts are held, at least 1. Sets with fewer contacts have no projection.
    rows : sequence of numpy.ndarray of int, optional
        Which sets of each source; all of them by default.
    ordered : bool
        Whether to return both choices of one of two contacts on one edge.

    Returns
    -------
    Shadows
        Held contacts in ascending order of their edges.
    """
    width = max((f.valid.shape[1] for f in sources), default=1)
    parts = []
    for number, functions in enumerate(sources):
        chosen = np.arange(len(functions)) if rows is None else rows[number]
        for slots in combinations(range(functions.m), held):
            edges = functions.edges[chosen]
            again = np.zeros(len(chosen), dtype=bool)
            for slot in slots:
                if slot > 0 and slot - 1 not in slots and not ordered:
                    again |= edges[:, slot] == edges[:, slot - 1]
            parts.append(_project(functions, number, chosen[~again], slots, width))
    arrays = [np.concatenate(columns) for columns in zip(*parts, strict=True)]
    return Shadows(tuple(sources), *arrays)


def _project(
    functions: TorqueFunctions,
    number: int,
    rows: IntArray,
    slots: tuple[int, ...],
    width: int,
) -> tuple[NDArray[np.generic], ...]:
    others = [i for i in range(functions.m) if i not in slots]
    slopes = functions.slopes[rows]
    low = functions.offsets[rows]
    high = low + slopes[:, :, others].sum(axis=2)
    pad = ((0, 0), (0, width - low.shape[1]))
    return (
        np.full(len(rows), number, dtype=np.intp),
        rows,
        np.tile(np.array(slots, dtype=np.intp), (len(rows), 1)),
        np.pad(low, pad),
        np.pad(high, pad),
        np.pad(slopes[:, :, list(slots)], (*pad, (0, 0))),
        np.pad(functions.errors[rows], pad),
        np.pad(functions.valid[rows], pad),
    )
