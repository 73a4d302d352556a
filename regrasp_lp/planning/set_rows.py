"""What the grasps of one set satisfy, as rows: some all of them, some one of several.

A grasp has a margin of ε iff *some* torque function is -ε or below *and* some is ε or above, and
likewise for its tolerance. Each of the two is a choice among rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.pieces import BARELY_APART, piece_sets
from regrasp_lp.torque import TorqueFunctions


@dataclass(frozen=True, eq=False)
class Choice:
    """Rows one of which has to hold: ``rows f + x <= bounds``, x the margin or the tolerance.

    Parameters
    ----------
    rows : numpy.ndarray, shape (A, m)
    bounds : numpy.ndarray, shape (A,)
        In the object's size, as the rows.
    column : int
        0 for the margin, 1 for the tolerance.
    """

    rows: FloatArray
    bounds: FloatArray
    column: int

    def slack(self, fractions: FloatArray) -> FloatArray:
        """Return the margin or tolerance that each row leaves at a grasp, shape (A,)."""
        return np.asarray(self.bounds - self.rows @ fractions)

    def needed(self, least: float, most: float) -> Choice | None:
        """Leave out rows that another one replaces; None if one holds everywhere.

        Parameters
        ----------
        least, most : float
            Between which x is.
        """
        worst = self.bounds - np.maximum(self.rows, 0.0).sum(axis=1)
        if (worst >= most).any():
            return None
        best = self.bounds - np.minimum(self.rows, 0.0).sum(axis=1)
        gain = self.rows[:, None, :] - self.rows
        gain = self.bounds - self.bounds[:, None] + np.minimum(gain, 0.0).sum(axis=2)
        replaced = (gain >= 0) & ((gain.T < 0) | np.tri(len(gain), k=-1, dtype=bool))
        kept = (best >= least) & ~replaced.any(axis=1)
        return Choice(self.rows[kept], self.bounds[kept], self.column)


@dataclass(frozen=True, eq=False)
class SetRows:
    """What the grasps of one set satisfy: rows that all hold, and choices among rows.

    `most` bounds their margin and tolerance; everything is in the object's size.
    """

    most: FloatArray
    lengths: FloatArray
    rows: FloatArray
    bounds: FloatArray
    to_ends: FloatArray
    choices: tuple[Choice, ...]


def most_levels(functions: TorqueFunctions, margins: FloatArray) -> FloatArray:
    """Return what margin and tolerance in sets are at most, given their margins, shape (N, 2).

    A tolerance is no more than the margin over the least rate of a function, and than half an edge.
    """
    slowest = np.where(functions.valid, functions.rates, np.inf).min(axis=1, initial=np.inf)
    tolerances = np.divide(margins, slowest, out=np.full(len(margins), np.inf), where=slowest > 0)
    return np.stack((margins, np.minimum(tolerances, functions.lengths.min(axis=1) / 2)), axis=1)


def set_rows(
    functions: TorqueFunctions,
    margin: float,
    columns: tuple[int, ...],
    least: FloatArray,
    most: FloatArray,
) -> SetRows:
    """Return the rows of one set.

    Parameters
    ----------
    functions : TorqueFunctions
    margin : float
        The largest of the set, in the object's unit.
    columns : tuple of int
        0 for rows of the margin, 1 for those of the tolerance.
    least, most : numpy.ndarray, shape (2,)
        Between which margin and tolerance are, in the object's size.

    Returns
    -------
    SetRows
    """
    size, m = functions.cones.size, functions.m
    lengths = functions.lengths[0] / size
    valid = functions.valid[0]
    choices = []
    for column in columns:
        scale = size * (functions.rates[0, valid] if column else np.ones(int(valid.sum())))
        slopes = functions.slopes[0, valid] / scale[:, None]
        offsets = functions.offsets[0, valid] / scale
        for choice in (Choice(slopes, -offsets, column), Choice(-slopes, offsets, column)):
            needed = choice.needed(float(least[column]), float(most[column]))
            choices += [] if needed is None else [needed]
    # Any piece has the rows that keep its contacts apart.
    names = [f"f{i}" for i in range(m)]
    one = piece_sets(functions, np.zeros((1, 3), dtype=np.intp), names, apart=BARELY_APART)
    kept = one.rows[0, 2:].any(axis=1)
    rows = one.rows[0, 2:][kept] / size
    bounds = one.bounds[0, 2:][kept] / size - BARELY_APART * least[0]
    to_ends = lengths if len(columns) > 1 else np.zeros(0)
    mine = most_levels(functions, np.array([margin]))[0] / size
    return SetRows(np.minimum(most, mine), lengths, rows, bounds, to_ends, tuple(choices))
