"""HiGHS: a simplex method, one LP at a time, for exact vertices of small problems."""

from __future__ import annotations

from dataclasses import dataclass

import highspy
import numpy as np

from regrasp_lp.linear_sets import FloatArray, LinearSets


@dataclass(frozen=True)
class HighsSolver:
    """Margin LPs by the dual simplex method of HiGHS, one after the other.

    Parameters
    ----------
    tolerance : float
        Primal and dual feasibility asked for (HiGHS takes no less than 1e-10).
    max_iterations : int
        Of one LP.
    """

    tolerance: float = 1e-10
    max_iterations: int = 10_000
    name: str = "highs"

    def solve(self, sets: LinearSets, *, thorough: bool) -> tuple[FloatArray, FloatArray]:
        """Return points and row multipliers; thorough means the interior-point method."""
        highs = self._highs(thorough=thorough)
        b, r, n = sets.rows.shape
        points, multipliers = np.full((b, n), np.nan), np.full((b, r), np.nan)
        lp = highspy.HighsLp()
        lp.num_col_, lp.num_row_ = n + 1, r
        lp.col_cost_ = np.append(np.zeros(n), -1.0)
        lp.row_lower_ = np.full(r, -highspy.kHighsInf)
        lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
        lp.a_matrix_.start_ = np.arange(0, r * (n + 1) + 1, r, dtype=np.int32)
        lp.a_matrix_.index_ = np.tile(np.arange(r, dtype=np.int32), n + 1)
        for i in range(b):
            columns = np.concatenate((sets.rows[i], sets.scales[i][:, None]), axis=1)
            lp.a_matrix_.value_ = columns.T.ravel()
            lp.row_upper_ = sets.bounds[i]
            lp.col_lower_ = np.append(sets.lower[i], -highspy.kHighsInf)
            lp.col_upper_ = np.append(sets.upper[i], highspy.kHighsInf)
            highs.passModel(lp)
            highs.run()
            # Whatever the status is: the answer is checked, and a status is not believed.
            solution = highs.getSolution()
            if solution.value_valid and solution.dual_valid:
                points[i] = solution.col_value[:n]
                multipliers[i] = -np.array(solution.row_dual)
        return points, multipliers

    def _highs(self, *, thorough: bool) -> highspy.Highs:
        highs = highspy.Highs()
        highs.setOptionValue("output_flag", False)
        highs.setOptionValue("presolve", "off")
        highs.setOptionValue("primal_feasibility_tolerance", self.tolerance)
        highs.setOptionValue("dual_feasibility_tolerance", self.tolerance)
        highs.setOptionValue("simplex_iteration_limit", self.max_iterations)
        highs.setOptionValue("ipm_iteration_limit", self.max_iterations)
        if thorough:
            highs.setOptionValue("solver", "ipm")
        return highs
