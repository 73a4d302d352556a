"""Plans of fingers that do not slide: pieces for all sets of a path are chosen at once.

While fingers may slide, a set is entered and left anywhere, and pieces lead from here to there. A
finger that does not slide ties together all sets that it holds, from its placing to its release:
where it is best placed depends on all of their pieces. A mixed-integer program chooses these: one
binary variable for every piece in every slide, rows that hold if it is chosen, and the least
tolerance is maximised. It only has to be good: the path LP that follows finds the best contacts in
these pieces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from regrasp_lp.errors import SolverError
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.planning.path_lp import (
    FINGERS_APART,
    SparseRows,
    Stage,
    number_variables,
    stage_cells,
    switch_rows,
)

_MOST_SLIDES = 3
"""In one set, from one piece to another: the program grows with their number."""

_SECONDS = 5.0
_GAP = 0.05
"""Part of the best tolerance that may be missed."""

_POSITIVE = 1e-9
"""Of the object's size: a tolerance that is more than rounding."""


def choose_pieces(
    stages: Sequence[Stage],
    held: Sequence[Sequence[tuple[int, int]]],
    start: FloatArray,
    goal: FloatArray,
    couplings: Sequence[LinearSets | None],
) -> list[Stage]:
    """Return the stages of a path with pieces that contacts which do not slide can pass.

    Parameters
    ----------
    stages : sequence of Stage
        With all pieces of their sets, as `limits`, and their contacts that do not slide.
    held, start, goal, couplings
        As for `build_path_problem`.

    Returns
    -------
    list of Stage

    Raises
    ------
    SolverError
        If none are found: there are none, but for paths of more than three slides in one set, or
        the time limit was reached.
    """
    for slides in range(1, _MOST_SLIDES + 1):
        chosen = _Choice(stages, slides, held, start, goal).solve(couplings)
        if chosen is not None:
            return [
                replace(s, pieces=s.pieces[some], limits=s.limits and s.limits.take(np.array(some)))
                for s, some in zip(stages, map(_without_repeats, chosen), strict=True)
            ]
    raise SolverError(
        "no pieces of the sets on edges "
        f"{[s.functions.cones.edge[s.functions.edges[0]].tolist() for s in stages]} are found that "
        "fingers which do not slide (only_place) can pass"
    )


def _without_repeats(pieces: list[int]) -> list[int]:
    return [p for n, p in enumerate(pieces) if n == 0 or p != pieces[n - 1]]


class _Choice:
    """The program that chooses pieces, with so many slides in every set.

    Its columns: the contacts as in the path LP, the least tolerance δ, and for every slide of every
    stage whether it is in each of the pieces. A row that a piece asks for is relaxed by as much as
    it can be broken where the piece is not chosen.
    """

    def __init__(
        self,
        stages: Sequence[Stage],
        slides: int,
        held: Sequence[Sequence[tuple[int, int]]],
        start: FloatArray,
        goal: FloatArray,
    ) -> None:
        self._stages, self._slides, self._held = stages, slides, held
        frame = [replace(s, pieces=s.pieces[:1].repeat(slides, axis=0)) for s in stages]
        self._ids, self._given = number_variables(frame, held, start, goal)
        self._size = stages[0].functions.cones.size
        self._margin = max(int(ids.max(initial=-1)) for ids in self._ids) + 1
        counts = [len(stage.pieces) for stage in stages]
        self._first = self._margin + 1 + slides * (np.cumsum(counts) - counts)
        self._rows = SparseRows(self._margin + 1 + slides * sum(counts))

    def _column(self, stage: int, slide: int, piece: int) -> int:
        return int(self._first[stage]) + slide * len(self._stages[stage].pieces) + piece

    def _add(
        self,
        ids: IntArray,
        given: FloatArray,
        row: FloatArray,
        bound: float,
        scale: float,
        chosen: int = -1,
    ) -> None:
        """A row over contacts, which holds anyway or if a piece is chosen."""
        bound -= float(row @ np.where(ids < 0, given, 0.0))
        row, bound = np.where(ids < 0, 0.0, row) / self._size, bound / self._size
        most = max(float(np.maximum(row, 0.0).sum()) + scale - bound, 0.0) if chosen >= 0 else 0.0
        columns = np.append(ids, [self._margin, chosen])
        self._rows.add(columns, np.append(row, [scale, most]), bound + most, 0.0)

    def solve(self, couplings: Sequence[LinearSets | None]) -> list[list[int]] | None:
        """Return the pieces of each stage's slides; None if none are found."""
        from scipy import sparse
        from scipy.optimize import Bounds, LinearConstraint, milp

        self._add_pieces()
        self._add_switches(couplings)
        n = self._rows.columns
        limits = LinearConstraint(self._rows.matrix(), ub=np.array(self._rows.bounds))
        slides = [
            [self._column(t, slide, p) for p in range(len(stage.pieces))]
            for t, stage in enumerate(self._stages)
            for slide in range(self._slides)
        ]
        which = np.repeat(np.arange(len(slides)), [len(columns) for columns in slides])
        one = sparse.csr_matrix(
            (np.ones(len(which)), (which, np.concatenate(slides))), shape=(len(slides), n)
        )
        found = milp(
            -(np.arange(n) == self._margin).astype(float),
            integrality=(np.arange(n) > self._margin).astype(int),
            bounds=Bounds(0.0, 1.0),
            constraints=[limits, LinearConstraint(one, 1.0, 1.0)],
            options={"time_limit": _SECONDS, "mip_rel_gap": _GAP},
        )
        if found.x is None or found.x[self._margin] <= _POSITIVE:
            return None
        picked = [int(np.argmax(found.x[columns])) for columns in slides]
        return [picked[t : t + self._slides] for t in range(0, len(picked), self._slides)]

    def _add_pieces(self) -> None:
        for t, stage in enumerate(self._stages):
            for p, cell in enumerate(stage_cells(stage, "tolerance", FINGERS_APART)):
                used = np.flatnonzero(cell.rows[0].any(axis=1)).tolist()
                for slide, r in product(range(self._slides), used):
                    for node in (slide, slide + 1):
                        self._add(
                            self._ids[t][node],
                            self._given[t][node],
                            cell.rows[0, r],
                            float(cell.bounds[0, r]),
                            float(cell.scales[0, r]),
                            self._column(t, slide, p),
                        )

    def _add_switches(self, couplings: Sequence[LinearSets | None]) -> None:
        for t in range(1, len(self._stages)):
            ids = np.concatenate((self._ids[t - 1][-1], self._ids[t][0]))
            given = np.concatenate((self._given[t - 1][-1], self._given[t][0]))
            stage, after = self._stages[t - 1 : t + 1]
            limits = couplings[t - 1] if couplings else None
            for row, bound, scale in switch_rows(
                stage, after, self._held[t - 1], limits, FINGERS_APART
            ):
                if (ids[row != 0] >= 0).any():
                    self._add(ids, given, row, bound, scale)
