"""Clarabel: an interior-point method that takes many LPs stacked block-diagonally at once."""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
from scipy import sparse

from regrasp_lp.linear_sets import FloatArray, LinearSets
from regrasp_lp.lp.highs_solver import HighsSolver


@dataclass(frozen=True)
class ClarabelSolver:
    """Margin LPs by Clarabel, thousands in one call.

    Parameters
    ----------
    tolerance : float
        Relative and absolute gap and feasibility asked for.
    """

    tolerance: float = 1e-11
    name: str = "clarabel"

    def solve(self, sets: LinearSets, *, thorough: bool) -> tuple[FloatArray, FloatArray]:
        """Return points and row multipliers; thorough means by HiGHS, a vertex each."""
        if thorough:
            return HighsSolver().solve(sets, thorough=False)
        return self._solve_stacked(sets)

    def _solve_stacked(self, sets: LinearSets) -> tuple[FloatArray, FloatArray]:
        b, r, n = sets.rows.shape
        height = r + 2 * n
        objective = np.tile(np.append(np.zeros(n), -1.0), b)
        limits = np.concatenate((sets.bounds, sets.upper, -sets.lower), axis=1).ravel()
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = self.tolerance
        settings.max_iter = 100
        solution = clarabel.DefaultSolver(
            sparse.csc_matrix((b * (n + 1), b * (n + 1))),
            objective,
            _block_diagonal(sets),
            limits,
            [clarabel.NonnegativeConeT(b * height)],
            settings,
        ).solve()
        points = np.array(solution.x).reshape(b, n + 1)[:, :n]
        multipliers = np.array(solution.z).reshape(b, height)[:, :r]
        return points, multipliers


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
