"""The convex pieces that a grasp set consists of: of torque functions, and of a hand's limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.grasp_sets.pieces import Measure, piece_sets
from regrasp_lp.grasp_sets.spacing import ROUNDINGS
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.torque import TorqueFunctions

_SCALES: dict[Measure, float] = {"margin": 0.1, "tolerance": 2.0}
"""Of rows that limit the distance of two contacts: either may be off by the tolerance; a tenth of
the margin is kept from them (with a smaller part, programs without a solution are hard to tell)."""


@dataclass(frozen=True, eq=False)
class SetPieces:
    """P convex pieces ``{M_j < 0 < M_k}`` of one grasp set or several, with rows of limits.

    Parameters
    ----------
    functions : TorqueFunctions
    pieces : numpy.ndarray of int, shape (P, 3)
        Combination, j and k of each piece.
    rows : numpy.ndarray, shape (P, R, m)
        Over the fractions of the contacts; R = 0 if nothing but the box limits them.
    bounds : numpy.ndarray, shape (P, R)
    margins : numpy.ndarray, shape (P,)
        Largest margin on each piece.
    """

    functions: TorqueFunctions
    pieces: IntArray
    rows: FloatArray
    bounds: FloatArray
    margins: FloatArray

    def __len__(self) -> int:
        return len(self.pieces)

    @cached_property
    def choice(self) -> IntArray:
        """Number of the choice of limits of each piece: equal of one combination where rows are."""
        flat = self.rows.reshape(len(self), self.rows.shape[1] * self.rows.shape[2])
        key = np.column_stack((self.pieces[:, 0], flat))
        choice: IntArray = np.unique(key, axis=0, return_inverse=True)[1].ravel()
        return choice

    def take(self, chosen: IntArray) -> SetPieces:
        """Return some of the pieces."""
        return SetPieces(
            self.functions,
            self.pieces[chosen],
            self.rows[chosen],
            self.bounds[chosen],
            self.margins[chosen],
        )

    def linear(
        self, names: Sequence[str], *, measure: Measure = "margin", apart: float = 0.0
    ) -> LinearSets:
        """Return the pieces as linear sets, as `piece_sets`.

        Rows of limits are scaled, too: with "tolerance" any two contacts may be off by the
        tolerance each; with "margin" they keep a tenth of it from the limits.

        Parameters
        ----------
        names : sequence of str
        measure : {"margin", "tolerance"}
        apart : float

        Returns
        -------
        LinearSets
        """
        sets = piece_sets(self.functions, self.pieces, names, measure=measure, apart=apart)
        return with_rows(sets, self.rows, self.bounds, measure)

    def contain(self, fractions: FloatArray) -> BoolArray:
        """Whether pieces contain a grasp strictly; signs of torque functions are decided exactly.

        Parameters
        ----------
        fractions : numpy.ndarray, shape (m,) or (P, m)
            Fractions of whole edges; the combination of all pieces is the same one.

        Returns
        -------
        numpy.ndarray of bool, shape (P,)
        """
        row, j, k = self.pieces.T
        at = np.broadcast_to(fractions, (len(row), self.functions.m))
        every, values = np.arange(len(row)), self.functions.whole.take(row).certain_values(at)
        inside = (values[every, j] < 0) & (values[every, k] > 0)
        cones = self.functions.cones
        within = cones.within(self.functions.edges[row].ravel(), at.ravel()).reshape(at.shape)
        excess = np.einsum("prm,pm->pr", self.rows, within) - self.bounds
        limits = (excess <= ROUNDINGS * cones.size).all(axis=1)
        return np.asarray(inside & limits)


def with_rows(
    sets: LinearSets, rows: FloatArray, bounds: FloatArray, measure: Measure = "margin"
) -> LinearSets:
    """Return sets with rows of limits added.

    Parameters
    ----------
    sets : LinearSets
    rows : numpy.ndarray, shape (B, R, n)
    bounds : numpy.ndarray, shape (B, R)
    measure : {"margin", "tolerance"}

    Returns
    -------
    LinearSets
    """
    if not rows.shape[1]:
        return sets
    scales = np.where(rows.any(axis=2), _SCALES[measure], 0.0)
    return LinearSets(
        sets.names,
        np.concatenate((sets.rows, rows), axis=1),
        np.concatenate((sets.scales, scales), axis=1),
        np.concatenate((sets.bounds, bounds), axis=1),
        sets.lower,
        sets.upper,
    )


def without_functions(sets: LinearSets) -> LinearSets:
    """Return pieces without their torque functions, whose rows become void: limits alone."""
    rows, scales, bounds = sets.rows.copy(), sets.scales.copy(), sets.bounds.copy()
    rows[:, :2], scales[:, :2], bounds[:, :2] = 0.0, 0.0, 1.0
    return replace(sets, rows=rows, scales=scales, bounds=bounds)


def without_void_rows(sets: LinearSets) -> LinearSets:
    """Return the same sets with as few rows as the one with most has: solvers work on all rows."""
    void = ~sets.rows.any(axis=2)
    order = np.argsort(void, axis=1, kind="stable")[:, : int((~void).sum(axis=1).max(initial=0))]
    return replace(
        sets,
        rows=np.take_along_axis(sets.rows, order[..., None], axis=1),
        scales=np.take_along_axis(sets.scales, order, axis=1),
        bounds=np.take_along_axis(sets.bounds, order, axis=1),
    )
