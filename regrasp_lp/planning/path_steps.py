"""The contacts along one way through a path of sets: their names, and their set as linear rows.

The grasps along the way are numbered from 0, its *steps*: in each set one with which it is entered
and one with which it is left, and between them one in every overlap of pieces that is slid through.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSet, GraspSets
from regrasp_lp.grasp_sets.pieces import BARELY_APART
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.planning.path_choices import Choice, PathChoices
from regrasp_lp.planning.path_lp import PathProblem, build_path_problem


@dataclass(frozen=True, eq=False)
class GivenEnd:
    """A start or a goal that is given.

    Parameters
    ----------
    grasp : Grasp
        Resolved, of two or three contacts.
    chosen : tuple of int
        Which of them are the contacts of the first or the last set, in its order.
    """

    grasp: Grasp
    chosen: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class PathSteps:
    """The steps of one way through a path, and its set over positions in the object's unit.

    Parameters
    ----------
    sets : GraspSets
    nodes : tuple of int
        The sets of the path.
    choices : PathChoices
        All ways of taking it.
    choice : Choice
        The way that this is.
    start, goal : GivenEnd or None
        None if it is free to choose.
    """

    sets: GraspSets
    nodes: tuple[int, ...]
    choices: PathChoices
    choice: Choice
    start: GivenEnd | None
    goal: GivenEnd | None

    @cached_property
    def problem(self) -> PathProblem:
        """The planner's path LP, over fractions, its rows scaled for the margin."""
        stages = [
            stage.stage(chain)
            for stage, chain in zip(self.choices.stages, self.choice.chains, strict=True)
        ]
        start, goal = (
            None
            if end is None
            else self.sets.fractions(node, end.grasp.fractions[list(end.chosen)])
            for node, end in ((self.nodes[0], self.start), (self.nodes[-1], self.goal))
        )
        return build_path_problem(
            stages, self.choice.held, start, goal, measure="margin", apart=BARELY_APART
        )

    @cached_property
    def ids(self) -> tuple[IntArray, ...]:
        """Of each step, which variable each contact is, or -1 where it is given."""
        return tuple(row for stage in self.problem.variables for row in stage)

    @cached_property
    def of_set(self) -> IntArray:
        """Of each step, the place of its set in the path."""
        return np.repeat(np.arange(len(self.nodes)), [len(v) for v in self.problem.variables])

    def place(self, step: int) -> int:
        """Return the place in the path of the set of a step.

        Raises
        ------
        OptionError
            If there is no such step.
        """
        if isinstance(step, bool) or not 0 <= step < len(self.ids):
            raise OptionError(f"no step {step!r}: there are {len(self.ids)}, numbered from 0")
        return int(self.of_set[step])

    def grasp_set(self, step: int) -> GraspSet:
        """Return the set of a step."""
        return self.sets[self.nodes[self.place(step)]]

    @cached_property
    def labels(self) -> tuple[tuple[str, ...], ...]:
        """Of each step, the names of its contacts."""
        return tuple(
            tuple(f"u[{step},{name[1:]}]" for name in self.sets[self.nodes[place]].names)
            for step, place in enumerate(self.of_set.tolist())
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of each variable, the first of its names."""
        found: dict[int, str] = {}
        for ids, labels in zip(self.ids, self.labels, strict=True):
            for variable, label in zip(ids.tolist(), labels, strict=True):
                if variable >= 0:
                    found.setdefault(variable, label)
        return tuple(found[i] for i in range(len(found)))

    @cached_property
    def _edges(self) -> list[tuple[FloatArray, FloatArray]]:
        """Of each set, where what can be touched of the edges begins, and how long that is."""
        found, cones = [], self.sets.cones
        for node in self.nodes:
            segments = self.sets.functions(node).edges[0]
            whole = self.sets.polygon.edge_lengths[cones.edge[segments]]
            lower, upper = cones.lower[segments], cones.upper[segments]
            found.append((lower * whole, (upper - lower) * whole))
        return found

    @cached_property
    def _box(self) -> tuple[FloatArray, FloatArray]:
        """The first position and the length of each variable, shape (n,) each."""
        first, length = np.zeros((2, self.problem.n_variables))
        for ids, place in zip(self.ids, self.of_set.tolist(), strict=True):
            for values, of_edges in zip((first, length), self._edges[place], strict=True):
                values[ids[ids >= 0]] = of_edges[ids >= 0]
        return first, length

    @cached_property
    def region(self) -> LinearSets:
        """The convex set of all positions, a stack of one over `names`; rows are lengths."""
        (first, length), problem = self._box, self.problem
        size = self.sets.cones.size
        rows = size * problem.rows.toarray() / length
        return LinearSets(
            self.names,
            rows[None],
            problem.scales[None],
            (size * problem.bounds + rows @ first)[None],
            first[None],
            (first + length)[None],
        )

    @cached_property
    def moves(self) -> tuple[FloatArray, FloatArray]:
        """W and w of the travel ``Σ |W u + w|`` in the unit of the object."""
        (first, length), size = self._box, self.sets.cones.size
        rows = size * self.problem.moves.toarray() / length
        return rows, size * self.problem.offsets - rows @ first

    def fractions(self, positions: FloatArray) -> FloatArray:
        """Return the variables of the path LP at positions, which are moved into the box."""
        first, length = self._box
        return np.asarray(np.clip((positions - first) / length, 0.0, 1.0))

    def positions(self, fractions: FloatArray) -> FloatArray:
        """Return positions at the variables of the path LP, never beyond the ends of the box."""
        first, length = self._box
        return np.asarray(np.clip(first + length * fractions, first, first + length))

    def given(self, step: int) -> FloatArray:
        """Return the positions of the given contacts of a step; NaN where they are free."""
        first, length = self._edges[self.place(step)]
        fractions = np.concatenate(self.problem.given, axis=None)
        start = sum(len(ids) for ids in self.ids[:step])
        return np.asarray(first + length * fractions[start : start + len(self.ids[step])])

    def border(self, positions: FloatArray) -> str:
        """Return in words what is nearest to its border, or farthest beyond, and by how much."""
        region = self.region
        slack = region.bounds[0] - region.rows[0] @ positions
        outside = np.maximum(region.lower[0] - positions, positions - region.upper[0])
        if outside.max(initial=-np.inf) > 0:
            n = int(outside.argmax())
            return f"{self.names[n]} = {positions[n]:.6g} is {outside[n]:.3g} off its edge"
        scales = region.scales[0]
        margins = np.where(scales > 0, slack / np.where(scales > 0, scales, 1.0), slack)
        row = int(margins.argmin())
        step = int(self.problem.owners[row])
        where = f"step {step}, with {', '.join(self.labels[step])},"
        if margins[row] < 0:
            return f"{where} is {-margins[row]:.3g} beyond the border"
        return f"{where} is {margins[row]:.3g} from the border"
