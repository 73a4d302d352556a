"""Margin LPs with the prices of their bounds: how much the optimum changes when one is moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from regrasp_lp.errors import SolverError
from regrasp_lp.linear_sets import FloatArray, LinearSets
from regrasp_lp.lp.exact_solver import ExactSolver
from regrasp_lp.lp.highs_solver import HighsSolver
from regrasp_lp.lp.linear_program import minimise
from regrasp_lp.lp.margin_lp import GAP, maximise_margins


@dataclass(frozen=True, eq=False)
class PricedOptimum:
    """The optimum of one margin LP, and prices that prove it.

    Parameters
    ----------
    margin : float
    point : numpy.ndarray, shape (n,)
    rows : numpy.ndarray, shape (R,)
        Multipliers ``y >= 0`` with ``scales · y = 1``: d(margin)/d(bound).
    lower, upper : numpy.ndarray, shape (n,)
        Of the box: d(margin)/d(-lower) and d(margin)/d(upper), not negative.

    Notes
    -----
    The optimum is a concave function of all bounds, and these are one of its supergradients: a
    change of bounds never raises it by more than they say, and where it is smooth they are its
    derivatives.
    """

    margin: float
    point: FloatArray
    rows: FloatArray
    lower: FloatArray
    upper: FloatArray


def priced_optimum(sets: LinearSets) -> PricedOptimum:
    """Solve one margin LP, with prices.

    Parameters
    ----------
    sets : LinearSets
        One set, its box and rows of magnitude around 1.

    Returns
    -------
    PricedOptimum

    Raises
    ------
    SolverError
        If they are not complementary: a row, or a side of the box, has a price and is not tight at
        the best point, so that the prices prove nothing.

    Examples
    --------
    >>> rows, bounds = np.array([[[1.0], [-1.0]]]), np.array([[0.5, 0.0]])
    >>> box = np.zeros((1, 1)), np.ones((1, 1))
    >>> found = priced_optimum(LinearSets(("x",), rows, np.ones((1, 2)), bounds, *box))
    >>> round(found.margin, 9), found.rows.round(9).tolist()
    (0.25, [0.5, 0.5])
    """
    solution = maximise_margins(sets, HighsSolver())
    margin, point = float(solution.margins[0]), solution.points[0]
    losses = []
    for multipliers in (_multipliers, _exact_multipliers):
        prices = multipliers(sets)
        gradient = prices @ sets.rows[0]
        to_lower, to_upper = np.maximum(gradient, 0.0), np.maximum(-gradient, 0.0)
        left = sets.bounds[0] - sets.rows[0] @ point - sets.scales[0] * margin
        terms = (
            prices * left,
            to_lower * (point - sets.lower[0]),
            to_upper * (sets.upper[0] - point),
        )
        losses.append(float(np.concatenate(terms).max()))
        if losses[-1] <= GAP * float(solution.units[0]):
            return PricedOptimum(margin, point, prices, to_lower, to_upper)
    raise SolverError(
        "the multipliers of a margin LP do not fit its optimum, neither those of HiGHS nor those "
        f"in rational numbers (a price times a slack of {losses[0]:.1e} and {losses[1]:.1e}): its "
        "best point is within the solver's accuracy of others"
    )


def _exact_multipliers(sets: LinearSets) -> FloatArray:
    """Those of the simplex method in rational numbers, rounded."""
    _, found = ExactSolver().solve(sets, thorough=False)
    return np.asarray(found[0] / (found[0] @ sets.scales[0]))


def _multipliers(sets: LinearSets) -> FloatArray:
    """Those of the rows, as ``max ε`` has them when ε is a variable within wide bounds."""
    rows, scales, bounds = sets.rows[0], sets.scales[0], sets.bounds[0]
    lower, upper = sets.lower[0], sets.upper[0]
    far = (np.abs(bounds) + np.abs(rows) @ np.maximum(np.abs(lower), np.abs(upper))).max()
    reach = 2 * (1 + far) / scales[scales > 0].min()
    found = minimise(
        np.append(np.zeros(len(lower)), -1.0),
        csr_matrix(np.column_stack((rows, scales))),
        bounds,
        np.append(lower, -reach),
        np.append(upper, reach),
    )
    assert found is not None  # ε may be as small as it likes
    return np.asarray(found.multipliers / (found.multipliers @ scales))
