"""Contacts along a path: one linear program over a chain of convex pieces.

A path of grasp sets is a chain of *stages*, one a set. In each the hand slides from an arriving
grasp through the overlaps of pieces to a leaving grasp; across a switch the held contacts are
equal. All of these grasps are variables, but for the start and the goal. The least tolerance (or
margin) is maximised, then, if asked for, the second least and so on; then, holding them, the travel
``Σ |u' - u|`` is minimised.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from regrasp_lp.errors import SolverError
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.grasp_sets.pieces import Measure, piece_sets
from regrasp_lp.grasp_sets.set_pieces import SetPieces
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.torque import TorqueFunctions

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

_SAME = 1e-12
"""Fractions that differ by no more are equal."""

FINGERS_APART = 2.0
"""As `apart` of `piece_sets`: no two fingers meet, even if each is off by its tolerance."""


@dataclass(frozen=True, eq=False)
class Stage:
    """One set of a path: pieces to slide through, one after the other.

    Parameters
    ----------
    functions : TorqueFunctions
        Of the set.
    pieces : numpy.ndarray of int, shape (P, 3)
        Consecutive pieces (0, j, k), overlapping; there are P + 1 grasps, the first and the last
        in one piece, those between in two. If there are none there is one grasp.
    entry, exit : LinearSets, optional
        Where the first slide may end and the last one may begin, instead of the first and the last
        piece, over "f0" to "f2": for slides from a given grasp and to one.
    limits : SetPieces, optional
        The same pieces with rows of limits of the hand, if there are any.
    staying : tuple of int
        The contacts that do not slide: in all grasps of the stage they are the same.
    """

    functions: TorqueFunctions
    pieces: IntArray
    entry: LinearSets | None = None
    exit: LinearSets | None = None
    limits: SetPieces | None = None
    staying: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class PathProblem:
    """The path LP as arrays: ``A x + δ s <= b`` with ``0 <= x <= 1``, and travel ``|W x + w|``.

    Parameters
    ----------
    variables : list of numpy.ndarray of int
        Per stage, shape (P + 1, m): which variable a contact is, or -1 where it is given.
    given : list of numpy.ndarray, shape (P + 1, m)
        The given fractions, NaN elsewhere.
    rows, bounds, scales
        A, b and s, in the unit of the object's size; ``s = 0`` for rows that hold anyway.
    owners : numpy.ndarray of int, shape (R,)
        The grasp that a row is of, numbered through all stages.
    moves, offsets
        W and w.
    """

    variables: list[IntArray]
    given: list[FloatArray]
    rows: csr_matrix
    bounds: FloatArray
    scales: FloatArray
    owners: IntArray
    moves: csr_matrix
    offsets: FloatArray

    @property
    def n_variables(self) -> int:
        """Number of variables."""
        return int(self.rows.shape[1])

    def grasps(self, x: FloatArray) -> list[FloatArray]:
        """Return the fractions of all grasps, per stage, for values of the variables."""
        padded = np.append(x, np.nan)
        return [
            np.where(ids >= 0, padded[ids], given)
            for ids, given in zip(self.variables, self.given, strict=True)
        ]

    def tolerance(self, x: FloatArray) -> float:
        """Return the least tolerance or margin that the rows leave at x, in the object's size."""
        free = self.scales > 0
        slack = self.bounds - self.rows @ x
        return float(np.min(slack[free] / self.scales[free], initial=np.inf))

    def travel(self, x: FloatArray) -> float:
        """Return the travel at x, in the object's size."""
        return float(np.abs(self.moves @ x + self.offsets).sum())


def build_path_problem(
    stages: Sequence[Stage],
    held: Sequence[Sequence[tuple[int, int]]],
    start: FloatArray | None,
    goal: FloatArray | None,
    measure: Measure = "tolerance",
    apart: float = FINGERS_APART,
    couplings: Sequence[LinearSets | None] = (),
) -> PathProblem:
    """Return the path LP of a chain of stages.

    Parameters
    ----------
    stages : sequence of Stage
    held : sequence of sequence of (int, int)
        Per switch the held contacts, as places in the two sets.
    start, goal : numpy.ndarray, shape (m,), or None
        Fractions of the first and the last grasp; None if they are to be chosen, too.
    measure : {"tolerance", "margin"}
        What rows are scaled for.
    apart : float
        As for `piece_sets`.
    couplings : sequence of LinearSets or None, optional
        Per switch what limits the distances of the fingers of both grasps, as a stack of one over
        the contacts of the first set and then those of the second that are not held.

    Returns
    -------
    PathProblem
    """
    variables, given = number_variables(stages, held, start, goal)
    count = max((int(ids.max(initial=-1)) for ids in variables), default=-1) + 1
    size = stages[0].functions.cones.size
    builder, travel = SparseRows(count), SparseRows(count)
    owners: list[int] = []
    first = 0
    for t, (stage, ids, fixed) in enumerate(zip(stages, variables, given, strict=True)):
        cells = stage_cells(stage, measure, apart)
        known = np.where(ids < 0, fixed, 0.0)
        last = len(ids) - 1
        for node in range(last + 1):
            if (ids[node] < 0).all():
                continue
            # A slide that begins or ends at a given grasp has a cell of its own there.
            for cell in [cells[p] for p in (node - 1, node) if 0 <= p < last]:
                used = np.flatnonzero(cell.rows[0].any(axis=1))
                for r in used.tolist():
                    row, bound = cell.rows[0, r], cell.bounds[0, r]
                    at = float(row @ known[node])
                    builder.add(ids[node], row / size, (bound - at) / size, cell.scales[0, r])
                    owners.append(first + node)
        if t:
            # Around a corner, fingers that leave and fingers that come may meet.
            columns = np.concatenate((variables[t - 1][-1], ids[0]))
            values = np.concatenate((given[t - 1][-1], fixed[0]))
            coupling = couplings[t - 1] if couplings else None
            rows = switch_rows(stages[t - 1], stage, held[t - 1], coupling, apart)
            for row, bound, scale in rows:
                at = float(row @ np.where(columns < 0, values, 0.0))
                if (columns[row != 0] >= 0).any():
                    builder.add(columns, row / size, (bound - at) / size, scale)
                    owners.append(first)
        first += last + 1
        lengths = stage.functions.lengths[0] / size
        for node in range(last):
            for slot, length in enumerate(lengths.tolist()):
                pair = [node, node + 1]
                weight = length * np.array([-1.0, 1.0])
                travel.add(ids[pair, slot], weight, float(weight @ known[pair, slot]), 1.0)
    return PathProblem(
        variables,
        given,
        builder.matrix(),
        np.array(builder.bounds),
        np.array(builder.scales),
        np.array(owners, dtype=np.intp),
        travel.matrix(),
        np.array(travel.bounds),
    )


def switch_rows(
    stage: Stage,
    after: Stage,
    held: Sequence[tuple[int, int]],
    coupling: LinearSets | None,
    apart: float,
) -> list[tuple[FloatArray, float, float]]:
    """Return rows, bounds and scales over the fractions of both grasps of a switch.

    Parameters
    ----------
    stage, after : Stage
    held : sequence of (int, int)
    coupling : LinearSets or None
    apart : float
        As for `build_path_problem`.
    """
    rows = [(*row, apart) for row in round_corners(stage, after, held)]
    return rows + _coupled(coupling, stage, held)


def round_corners(
    stage: Stage, after: Stage, held: Sequence[tuple[int, int]]
) -> list[tuple[FloatArray, float]]:
    """Rows and bounds that keep contacts that leave from ones that come round a vertex.

    Over the fractions of both sets: ``u - u' <= l`` where the edge of u' follows that of u.
    """
    cones, m = stage.functions.cones, stage.functions.m
    edges = np.concatenate((stage.functions.edges[0], after.functions.edges[0]))
    leaving = [n for n in range(m) if n not in [here for here, _ in held]]
    coming = [n for n in range(m, len(edges)) if n - m not in [there for _, there in held]]
    found = []
    for one, other in [*product(leaving, coming), *product(coming, leaving)]:
        if (cones.ends[edges[one]] == cones.starts[edges[other]]).all():
            row = np.zeros(len(edges))
            row[one], row[other] = cones.lengths[edges[one]], -cones.lengths[edges[other]]
            found.append((row, float(cones.lengths[edges[one]])))
    return found


def _coupled(
    coupling: LinearSets | None, stage: Stage, held: Sequence[tuple[int, int]]
) -> list[tuple[FloatArray, float, float]]:
    """Rows, bounds and scales of a coupling over all contacts of both sets."""
    if coupling is None:
        return []
    m, n = stage.functions.m, len(coupling.names)
    there = [slot for _, slot in held]
    coming = [slot for slot in range(n - m + len(held)) if slot not in there]
    columns = [*range(m), *(m + slot for slot in coming)]
    found = []
    for row, bound, scale in zip(
        coupling.rows[0], coupling.bounds[0], coupling.scales[0], strict=True
    ):
        wide = np.zeros(n + len(held))
        wide[columns] = row
        found.append((wide, float(bound), float(scale)))
    return found


def stage_cells(stage: Stage, measure: Measure, apart: float) -> list[LinearSets]:
    """Return the convex set of each slide of a stage, as a stack of one."""
    names = [f"f{i}" for i in range(stage.functions.m)]
    if stage.limits is not None:
        cells = list(stage.limits.linear(names, measure=measure, apart=apart))
    else:
        cells = list(piece_sets(stage.functions, stage.pieces, names, measure=measure, apart=apart))
    if stage.entry is not None:
        cells[0] = stage.entry
    if stage.exit is not None:
        cells[-1] = stage.exit
    return cells


def number_variables(
    stages: Sequence[Stage],
    held: Sequence[Sequence[tuple[int, int]]],
    start: FloatArray | None,
    goal: FloatArray | None,
) -> tuple[list[IntArray], list[FloatArray]]:
    """Number the variables of a path, as `PathProblem` has them.

    Held contacts are one variable on both sides of a switch, and so are in all grasps of a stage
    the contacts that do not slide.

    Raises
    ------
    SolverError
        If one that does not slide is to end elsewhere than where it begins.
    """
    variables: list[IntArray] = []
    given: list[FloatArray] = []
    count = 0
    for t, stage in enumerate(stages):
        shape = (len(stage.pieces) + 1, stage.functions.m)
        ids = np.full(shape, -2)
        fixed = np.full(shape, np.nan)
        if t == 0 and start is not None:
            ids[0], fixed[0] = -1, start
        for here, there in held[t - 1] if t else ():
            ids[0, there] = variables[-1][-1, here]
            fixed[0, there] = given[-1][-1, here]
        new = ids == -2
        new[1:, list(stage.staying)] = False
        ids[new] = count + np.arange(new.sum())
        count += int(new.sum())
        for slot in stage.staying:
            ids[1:, slot], fixed[1:, slot] = ids[0, slot], fixed[0, slot]
        variables.append(ids)
        given.append(fixed)
    if goal is not None:
        here = given[-1][-1]
        if (np.abs(here - goal) > _SAME).any():  # given at the start, but for those that are free
            raise SolverError("a finger that does not slide is to end elsewhere than it began")
        # A stage of one grasp has it in common with the ones before, as far as it is held.
        for variable, fraction in zip(variables[-1][-1].tolist(), goal.tolist(), strict=True):
            for ids, fixed in zip(variables, given, strict=True):
                same = (ids == variable) & (variable >= 0)
                ids[same], fixed[same] = -1, fraction
        variables[-1][-1], given[-1][-1] = -1, goal
        left = np.unique(np.concatenate([ids.ravel() for ids in variables]))
        renumbered = dict(zip(left[left >= 0].tolist(), range(len(left)), strict=False))
        for ids in variables:
            ids[ids >= 0] = [renumbered[v] for v in ids[ids >= 0].tolist()]
    return variables, given


class SparseRows:
    """Collects rows ``a x + δ s <= b`` of a sparse matrix; columns of -1 are left out.

    Parameters
    ----------
    columns : int
        How many there are.
    """

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self.bounds: list[float] = []
        self.scales: list[float] = []
        self._row: list[int] = []
        self._column: list[int] = []
        self._value: list[float] = []

    def add(self, columns: IntArray, values: FloatArray, bound: float, scale: float) -> None:
        """Add one row."""
        for column, value in zip(columns.tolist(), values.tolist(), strict=True):
            if column >= 0 and value != 0:
                self._row.append(len(self.bounds))
                self._column.append(column)
                self._value.append(value)
        self.bounds.append(bound)
        self.scales.append(scale)

    def matrix(self) -> csr_matrix:
        """Return all rows."""
        from scipy import sparse

        return sparse.csr_matrix(
            (self._value, (self._row, self._column)), shape=(len(self.bounds), self.columns)
        )
