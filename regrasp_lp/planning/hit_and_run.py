"""Uniform samples of a bounded convex set given by linear rows: hit and run.

From a point inside, a step goes along a random direction to a uniformly random point of the chord
that the set cuts out of it; the uniform distribution is the one that stays. Each sample is the end
of a walk of its own from the analytic centre, so that samples are independent of each other, and
what is left of the beginning is the same for all.

Two things make short walks enough. Coordinates that no row ties together are walked in *blocks*,
each on its own at the same time: it is the dimension of the largest block that counts, and a path
of grasp sets has blocks of few contacts. And directions are drawn from the Dikin ellipsoid at the
centre, in whose metric a block with r rows holds a ball of radius 1 and lies in one of radius r:
thin sets are no harder than round ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regrasp_lp.errors import OptionError, SolverError
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import Solver, maximise_margins

_NEWTON = 100
"""Most Newton steps to the centre; about ten are taken."""

_PULL = 1e-9
"""By this part a sample that rounding has put on the border is moved to the centre."""


def sample_uniformly(
    sets: LinearSets, n: int, rng: np.random.Generator, solver: Solver, walk: int | None = None
) -> FloatArray:
    """Return points uniformly distributed on a convex set, all strictly inside.

    Parameters
    ----------
    sets : LinearSets
        A stack of one, its box bounded.
    n : int
        Number of points.
    rng : numpy.random.Generator
    solver : Solver
        Finds the first point.
    walk : int, optional
        Steps of each walk; by default ``30 + 10 d²`` for the largest block of d coordinates.

    Returns
    -------
    numpy.ndarray, shape (n, dimension)

    Raises
    ------
    OptionError
        If n is no number of points.
    SolverError
        If the set is empty, or thinner than the accuracy of the solver.

    Examples
    --------
    >>> from regrasp_lp.lp import get_solver
    >>> square = LinearSets(("x", "y"), np.zeros((1, 1, 2)), np.zeros((1, 1)), np.ones((1, 1)),
    ...                     np.zeros((1, 2)), np.ones((1, 2)))
    >>> points = sample_uniformly(square, 2000, np.random.default_rng(1), get_solver("highs"))
    >>> bool(abs(points.mean(axis=0) - 0.5).max() < 0.02)
    True
    """
    if isinstance(n, bool) or not isinstance(n, (int, np.integer)) or n < 0:
        raise OptionError(f"the number of samples has to be an integer, 0 or more, not {n!r}")
    width = (sets.upper - sets.lower)[0]
    if not width.size:
        return np.zeros((n, 0))
    rows, bounds = _all_rows(sets.in_unit_box())
    centre = _analytic_centre(rows, bounds, _inside(rows, bounds, solver))
    blocks = _Blocks.of(rows)
    steps = 30 + 10 * blocks.largest**2 if walk is None else walk
    points = blocks.walk(centre, bounds, n, steps, rng)
    while (outside := (points @ rows.T >= bounds).any(axis=1)).any():
        points[outside] += _PULL * (centre - points[outside])
    return np.asarray(sets.lower[0] + width * points)


def _all_rows(sets: LinearSets) -> tuple[FloatArray, FloatArray]:
    """Rows and those of the unit box, of length 1; rows without coordinates left out."""
    one = np.eye(len(sets.names))
    rows = np.concatenate((sets.rows[0], one, -one))
    bounds = np.concatenate((sets.bounds[0], np.ones(len(one)), np.zeros(len(one))))
    length = np.linalg.norm(rows, axis=1)
    if (bounds[length == 0] < 0).any():
        raise SolverError("the set to sample is empty: a row without coordinates is violated")
    some = length > 0
    return rows[some] / length[some, None], bounds[some] / length[some]


def _inside(rows: FloatArray, bounds: FloatArray, solver: Solver) -> FloatArray:
    """The centre of a largest ball: a point that all rows leave room."""
    n = rows.shape[1]
    ball = LinearSets(
        tuple(f"x{i}" for i in range(n)),
        rows[None],
        np.ones((1, len(rows))),
        bounds[None],
        np.zeros((1, n)),
        np.ones((1, n)),
    )
    found = maximise_margins(ball, solver)
    if not found.positive[0]:
        raise SolverError(
            f"the set to sample is empty, or thinner than the accuracy of {solver.name}: the "
            f"largest ball in it has radius {found.margins[0]:.1e} of the box"
        )
    return np.asarray(found.points[0])


def _analytic_centre(rows: FloatArray, bounds: FloatArray, x: FloatArray) -> FloatArray:
    """The point of largest product of distances to all rows, by damped Newton steps."""
    for _ in range(_NEWTON):
        inverse = 1 / (bounds - rows @ x)
        gradient = rows.T @ inverse
        step = -np.linalg.solve((rows * inverse[:, None] ** 2).T @ rows, gradient)
        decrement = np.sqrt(max(0.0, -float(gradient @ step)))
        x = x + step / (1 + decrement)
        if decrement < 1e-6:
            break
    return x


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Rows sorted by the block of coordinates they are on.

    Parameters
    ----------
    rows : numpy.ndarray, shape (R, n)
    order : numpy.ndarray of int, shape (R,)
        Which rows they were.
    of_row, of_coordinate : numpy.ndarray of int, shapes (R,) and (n,)
        Number of the block.
    """

    rows: FloatArray
    order: IntArray
    of_row: IntArray
    of_coordinate: IntArray

    @classmethod
    def of(cls, rows: FloatArray) -> _Blocks:
        """Return the blocks: coordinates that rows tie together, directly or not."""
        from scipy.sparse import csgraph, csr_matrix

        tied = csr_matrix(np.abs(rows).T @ np.abs(rows))
        _, of_coordinate = csgraph.connected_components(tied, directed=False)
        of_row = of_coordinate[(rows != 0).argmax(axis=1)]
        order = np.argsort(of_row, kind="stable")
        return cls(rows[order], order, of_row[order], of_coordinate)

    @property
    def largest(self) -> int:
        """Number of coordinates of the largest block."""
        return int(np.bincount(self.of_coordinate).max())

    def walk(
        self, centre: FloatArray, bounds: FloatArray, n: int, steps: int, rng: np.random.Generator
    ) -> FloatArray:
        """Return the ends of n walks from the centre, shape (n, dimension)."""
        slack = np.tile(bounds[self.order] - self.rows @ centre, (n, 1))
        points = np.tile(centre, (n, 1))
        scaled = self.rows / slack[0][:, None] if n else self.rows
        # Directions of the Dikin ellipsoid; its matrix is block-diagonal like the rows.
        spread = np.linalg.inv(np.linalg.cholesky(scaled.T @ scaled))
        first = np.flatnonzero(np.diff(self.of_row, prepend=-1))
        for _ in range(steps if n else 0):
            direction = rng.standard_normal(points.shape) @ spread
            rates = direction @ self.rows.T
            reach = np.divide(slack, rates, out=np.full(slack.shape, np.inf), where=rates != 0)
            forward = np.minimum.reduceat(np.where(rates > 0, reach, np.inf), first, axis=1)
            backward = np.maximum.reduceat(np.where(rates < 0, reach, -np.inf), first, axis=1)
            to = backward + rng.random(forward.shape) * (forward - backward)
            points += to[:, self.of_coordinate] * direction
            slack -= to[:, self.of_row] * rates
            np.maximum(slack, 0.0, out=slack)  # what rounding takes away
        return points
