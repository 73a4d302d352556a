"""Clarabel: an interior-point method that takes many LPs stacked block-diagonally at once."""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
from scipy import sparse

from regrasp_lp.linear_sets import FloatArray, LinearSets


@dataclass(frozen=True)
class ClarabelSolver:
    """Margin LPs by Clarabel, thousands in one call.

    Parameters
    ----------
    tolerance : float
        Relative and absolute gap and feasibility asked for.
    max_iterations : int
        Of one call.
    """

    tolerance: float = 1e-11
    max_iterations: int = 100
    name: str = "clarabel"

    def solve(self, sets: LinearSets, *, thorough: bool) -> tuple[FloatArray, FloatArray]:
        """Return points and row multipliers.

        Thorough means with shorter steps and without regularising pivots or rescaling rows.
        """
        b, r, n = sets.rows.shape
        height = r + 2 * n
        objective = np.tile(np.append(np.zeros(n), -1.0), b)
        limits = np.concatenate((sets.bounds, sets.upper, -sets.lower), axis=1).ravel()
        solution = clarabel.DefaultSolver(
            sparse.csc_matrix((b * (n + 1), b * (n + 1))),
            objective,
            _block_diagonal(sets),
            limits,
            [clarabel.NonnegativeConeT(b * height)],
            self._settings(thorough=thorough),
        ).solve()
        points = np.array(solution.x).reshape(b, n + 1)[:, :n]
        multipliers = np.array(solution.z).reshape(b, height)[:, :r]
        return points, multipliers

    def _settings(self, *, thorough: bool) -> clarabel.DefaultSettings:
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = self.tolerance
        settings.max_iter = self.max_iterations
        if thorough:
            settings.max_step_fraction = 0.9
            settings.equilibrate_enable = False
            settings.static_regularization_constant = 1e-12
        return settings


def _block_diagonal(sets: LinearSets) -> sparse.csc_matrix:
    """Rows, then ``x <= upper``, then ``-x <= -lower``, over (x, ε), a block each set."""
    b, r, n = sets.rows.shape
    height = r + 2 * n
    of_x = np.empty((b, n, r + 2))
    of_x[:, :, :r] = sets.rows.transpose(0, 2, 1)
    of_x[:, :, r], of_x[:, :, r + 1] = 1.0, -1.0
    where_x = np.empty((n, r + 2), dtype=np.int64)
    where_x[:, :r] = np.arange(r)
    where_x[:, r], where_x[:, r + 1] = r + np.arange(n), r + n + np.arange(n)
    data = np.concatenate((of_x.reshape(b, -1), sets.scales), axis=1)
    where = np.concatenate((where_x.ravel(), np.arange(r)))
    indices = where + height * np.arange(b)[:, None]
    sizes = np.tile(np.append(np.full(n, r + 2), r), b)
    pointers = np.concatenate(([0], np.cumsum(sizes)))
    return sparse.csc_matrix(
        (data.ravel(), indices.ravel(), pointers), shape=(b * height, b * (n + 1))
    )
