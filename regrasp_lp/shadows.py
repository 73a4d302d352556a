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

from regrasp_lp.friction import UNIT_ROUNDOFF, BoolArray, FloatArray, IntArray
from regrasp_lp.torque import TorqueFunctions

GRID = np.linspace(0.0, 1.0, 3)
"""Positions of the first of two held contacts at which `Shadows.on_grid` looks."""

_QUOTIENT = 8 * UNIT_ROUNDOFF


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

    def limits(
        self, x: FloatArray | float = 0.0, *, inner: bool = True
    ) -> tuple[FloatArray, FloatArray]:
        """Return bounds of the interval (υ, δ) in which the last held contact may be.

        δ is ``max_j root_j`` of the functions with the others at 0, υ is ``min_k root_k`` of those
        with the others at 1.

        Parameters
        ----------
        x : numpy.ndarray, shape (R,), or float
            Position of the first of two held contacts; without effect on one held contact.
        inner : bool
            Whether what lies between the bounds is inside for certain (υ rounded up, δ down),
            or else what lies beyond them is outside for certain.

        Returns
        -------
        upsilon, delta : numpy.ndarray, shape (R,)
        """
        sign = 1.0 if inner else -1.0
        # twice the error of a value anywhere in the box, and of the quotient
        slack = (2 * sign) * self.errors
        moved = 0.0 if self.held == 1 else self.slopes[:, :, 0] * np.reshape(x, (-1, 1))
        slope = self.slopes[:, :, -1]
        rises = slope > 0
        below, above = self.low + moved + slack, self.high + moved - slack
        root = np.divide(-below, slope, out=np.where(below < 0, np.inf, -np.inf), where=rises)
        root = np.where(self.valid, root, -np.inf).max(axis=1)
        delta = root - _QUOTIENT * sign * np.abs(np.where(np.isfinite(root), root, 0.0))
        root = np.divide(-above, slope, out=np.where(above > 0, -np.inf, np.inf), where=rises)
        root = np.where(self.valid, root, np.inf).min(axis=1)
        upsilon = root + _QUOTIENT * sign * np.abs(np.where(np.isfinite(root), root, 0.0))
        return np.asarray(upsilon), np.asarray(delta)

    @cached_property
    def on_grid(self) -> tuple[FloatArray, FloatArray]:
        """Inner `limits` with the first of two held contacts on `GRID`, (R, 3) each."""
        columns = [self.limits(x) for x in (GRID if self.held > 1 else GRID[:1])]
        lower, upper = (np.stack(end, axis=1) for end in zip(*columns, strict=True))
        return lower, upper

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


def places_of(held: IntArray, edges: IntArray) -> IntArray:
    """Return which contacts of sets are held, on every edge the first ones; -1 for none.

    Parameters
    ----------
    held : numpy.ndarray of int, shape (N, h)
        Edges of held contacts, ascending; -1 for none.
    edges : numpy.ndarray of int, shape (N, m)
        Edges of the contacts of the sets.

    Returns
    -------
    numpy.ndarray of int, shape (N, h)

    Examples
    --------
    >>> places_of(np.array([[3, 3, -1], [3, 5, -1]]), np.array([[3, 3, 5], [3, 3, 5]])).tolist()
    [[0, 1, -1], [0, 2, -1]]
    """
    places = np.full(held.shape, -1)
    for column in range(held.shape[1]):
        edge = held[:, column]
        again = (held[:, :column] == edge[:, None]).sum(axis=1)
        first = (edges == edge[:, None]).argmax(axis=1)
        places[:, column] = np.where(edge >= 0, first + again, -1)
    return places


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
    columns = (low, high, slopes[:, :, list(slots)], functions.errors[rows], functions.valid[rows])
    return (
        np.full(len(rows), number, dtype=np.intp),
        rows,
        np.tile(np.array(slots, dtype=np.intp), (len(rows), 1)),
        *(_widened(column, width) for column in columns),
    )


def _widened(array: NDArray[np.generic], width: int) -> NDArray[np.generic]:
    """Columns of zeros at the end, up to a width (`numpy.pad` takes long over small arrays)."""
    if array.shape[1] == width:
        return array
    wide = np.zeros((len(array), width, *array.shape[2:]), dtype=array.dtype)
    wide[:, : array.shape[1]] = array
    return wide
