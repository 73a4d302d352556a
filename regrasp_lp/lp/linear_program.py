"""General linear programs, one at a time, by HiGHS: ``min c·x``, and how good the answer is.

For programs whose objective is no margin, as travel. As everywhere the status is not believed: the
point is judged by how far it breaks a row, and the multipliers give a lower bound of the optimum.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regrasp_lp.errors import SolverError
from regrasp_lp.linear_sets import FloatArray

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

_TOLERANCE = 1e-10

_ACCEPTED = 1e-7
"""Largest violation of a row, and gap between value and bound, relative to their magnitude."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """The minimum of a linear program.

    Parameters
    ----------
    point : numpy.ndarray, shape (n,)
        Inside the box.
    value : float
        ``c · x`` there.
    bound : float
        A lower bound of the optimum, from the multipliers by weak duality.
    multipliers : numpy.ndarray, shape (R,)
        Of the rows, not negative: by how much the optimum falls per unit of a bound.
    """

    point: FloatArray
    value: float
    bound: float
    multipliers: FloatArray


def minimise(
    cost: FloatArray, rows: csr_matrix, bounds: FloatArray, lower: FloatArray, upper: FloatArray
) -> Minimum | None:
    """Minimise ``cost · x`` subject to ``rows x <= bounds`` and ``lower <= x <= upper``.

    Parameters
    ----------
    cost : numpy.ndarray, shape (n,)
    rows : scipy.sparse.csr_matrix, shape (R, n)
        Of magnitude around 1.
    bounds : numpy.ndarray, shape (R,)
    lower, upper : numpy.ndarray, shape (n,)
        Finite.

    Returns
    -------
    Minimum or None
        None if multipliers prove that no point of the box satisfies the rows.

    Raises
    ------
    SolverError
        If neither the simplex nor the interior-point method gives an answer that passes the check.

    Examples
    --------
    >>> from scipy.sparse import csr_matrix
    >>> found = minimise(np.array([1.0, 1.0]), csr_matrix([[-1.0, -2.0]]), np.array([-2.0]),
    ...                  np.zeros(2), np.ones(2))
    >>> found.point.tolist(), found.value, found.bound
    ([0.0, 1.0], 1.0, 1.0)
    """
    faults = []
    for method in ("simplex", "ipm"):
        point, multipliers, ray, status = _run(cost, rows, bounds, lower, upper, method)
        if ray is not None and _is_empty(ray, rows, bounds, lower, upper):
            return None
        point = np.clip(point, lower, upper)
        if not (np.isfinite(point).all() and np.isfinite(multipliers).all()):
            faults.append(f"{method}: {status}, no numbers")
            continue
        broken = float(np.max(rows @ point - bounds, initial=0.0))
        value = float(cost @ point)
        bound = _dual_bound(cost, np.maximum(multipliers, 0.0), rows, bounds, lower, upper)
        unit = 1.0 + float(np.abs(cost).sum())
        if broken <= _ACCEPTED and value - bound <= _ACCEPTED * unit:
            return Minimum(point, value, min(value, bound), np.maximum(multipliers, 0.0))
        faults.append(f"{method}: {status}, rows broken by {broken:.1e}, gap {value - bound:.1e}")
    raise SolverError(f"a linear program is open, neither yes nor no: {'; '.join(faults)}")


def _dual_bound(
    cost: FloatArray,
    y: FloatArray,
    rows: csr_matrix,
    bounds: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> float:
    """``min over the box of c·x + y·(rows x - bounds)``, which no feasible point is below."""
    reduced = cost + rows.T @ y
    return float(np.minimum(reduced * lower, reduced * upper).sum() - y @ bounds)


def _is_empty(
    ray: FloatArray, rows: csr_matrix, bounds: FloatArray, lower: FloatArray, upper: FloatArray
) -> bool:
    """Whether multipliers prove that there is no point: ``min over the box`` is above 0."""
    y = np.maximum(ray, 0.0)
    scale = float(y.max(initial=0.0))
    if not (np.isfinite(scale) and scale > 0):
        return False
    y = y / scale
    none = np.zeros(len(lower))
    magnitude = 1.0 + float(np.abs(bounds) @ y)
    return _dual_bound(none, y, rows, bounds, lower, upper) > 1e-12 * magnitude


def _run(
    cost: FloatArray,
    rows: csr_matrix,
    bounds: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    method: str,
) -> tuple[FloatArray, FloatArray, FloatArray | None, str]:
    """Point, multipliers, a ray of multipliers if the program has no point, and the status."""
    import highspy

    highs = highspy.Highs()
    for option, setting in (
        ("output_flag", False),
        ("presolve", "off"),
        ("solver", method),
        ("primal_feasibility_tolerance", _TOLERANCE),
        ("dual_feasibility_tolerance", _TOLERANCE),
    ):
        highs.setOptionValue(option, setting)
    lp = highspy.HighsLp()
    lp.num_row_, lp.num_col_ = rows.shape
    lp.col_cost_, lp.col_lower_, lp.col_upper_ = cost, lower, upper
    lp.row_lower_, lp.row_upper_ = np.full(len(bounds), -highspy.kHighsInf), bounds
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    lp.a_matrix_.start_ = rows.indptr.astype(np.int32)
    lp.a_matrix_.index_ = rows.indices.astype(np.int32)
    lp.a_matrix_.value_ = rows.data
    highs.passModel(lp)
    highs.run()
    solution, status = highs.getSolution(), highs.modelStatusToString(highs.getModelStatus())
    nothing = np.full(lp.num_col_, np.nan), np.full(lp.num_row_, np.nan)
    point = np.array(solution.col_value) if solution.value_valid else nothing[0]
    multipliers = -np.array(solution.row_dual) if solution.dual_valid else nothing[1]
    ray = None
    if highs.getModelStatus() == highspy.HighsModelStatus.kInfeasible:
        _, found, values = highs.getDualRay()
        ray = np.abs(np.array(values)) if found and values is not None else None
    return point, multipliers, ray, status
