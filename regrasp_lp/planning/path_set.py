"""A path of grasp sets as a convex set: all contacts along it, to be chosen from freely.

What a path of sets allows is a union of convex sets, one for each way of taking it: which contacts
every switch holds, and the pieces in which every set is entered and left (`path_choices`). A
`PathSet` is one of them. cvxpy is how a user adds constraints and an objective of his own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from regrasp_lp.errors import NotForceClosureError, OptionError
from regrasp_lp.friction import FloatArray
from regrasp_lp.planning.execution import Execution
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.hit_and_run import sample_uniformly
from regrasp_lp.planning.path_model import OFF, PathModel
from regrasp_lp.planning.path_optimum import merged
from regrasp_lp.planning.plan import Plan


@dataclass(frozen=True, eq=False)
class PathSet(PathModel):
    """A convex set of contact choices along a path of grasp sets.

    Made by `SwitchingGraph.path_set` and `path_sets`. The grasps along the path are numbered from
    0, its *steps*: in each set of the path one with which it is entered and one with which it is
    left, and between them one in every overlap of pieces that is slid through (``print`` lists
    them). ``u[2,5]`` is the position of the contact on edge 5 in step 2, in the object's unit from
    the start of the edge; ``u[2,5']`` that of a second contact there. A contact held across a
    switch is the same variable in both steps; those of a given start or goal are constants.

    Parameters
    ----------
    steps : PathSteps
        The way through the path that this is, and its rows as arrays.
    solver : Solver
        Of this package's own linear programs.
    hand : Hand
    friction : numpy.ndarray, shape (n_edges,)

    Notes
    -----
    The variables have values that `solve` sets, as cvxpy has it; all else never changes.

    Examples
    --------
    From a grip across the long arm of a bracket to one across its short side: the finger on edge 5
    is to be placed at least 0.3 from the start of the edge and no more than 1.5 from the one on
    edge 4, and the fingers are to slide as little as possible.

    >>> import cvxpy as cp
    >>> import regrasp_lp as rl
    >>> part = rl.Polygon([(0, 0), (6, 0), (6, 1), (1, 1), (1, 5), (0, 5)], name="bracket")
    >>> graph = rl.build_switching_graph(part, friction=0.4)
    >>> nodes = [graph.sets.on_edges(edges)[0] for edges in ([0, 4], [0, 4, 5], [3, 5])]
    >>> path = graph.path_set(nodes, start=[(0, 0.5), (4, 0.5)], goal=[(3, 2.5), (5, 1.5)])
    >>> print(path)
    <PathSet through sets 1, 16, 3: 7 variables, margin up to 0.1857>
      step 0 in set 1, two_finger: u[0,0] = 0.5, u[0,4] = 0.5
      step 1 in set 1, two_finger: u[1,0], u[1,4]
      step 2 in set 16, three_finger: u[1,0], u[1,4], u[2,5]
      step 3 in set 16, three_finger: u[3,0], u[3,4], u[3,5]
      step 4 in set 3, two_finger: u[4,3], u[3,5]
      step 5 in set 3, two_finger: u[5,3] = 2.5, u[5,5] = 1.5
    >>> _, on_4, on_5 = path.points(2)
    >>> own = [path.variables["u[2,5]"] >= 0.3, cp.norm(on_5 - on_4) <= 1.5]
    >>> round(path.solve(cp.Minimize(path.travel), own, margin=0.1), 4)
    0.0858
    >>> plan = path.to_plan()
    >>> plan.placements, plan.verify().ok
    (2, True)
    """

    hand: Hand
    friction: FloatArray

    @property
    def nodes(self) -> tuple[int, ...]:
        """The numbers of the sets of the path."""
        return self.steps.nodes

    @property
    def placements(self) -> int:
        """Contacts placed at the switches; fewer if a finger happens to be where one is wanted."""
        return self.steps.choice.placements

    def alternatives(self) -> Iterator[PathSet]:
        """Yield the other convex sets of the same path, best first (see `path_sets`)."""
        return (
            replace(self, steps=replace(self.steps, choice=choice))
            for choice in self.steps.choices
            if choice != self.steps.choice
        )

    def __repr__(self) -> str:
        return (
            f"<PathSet through sets {', '.join(map(str, self.nodes))}: {len(self.names)} "
            f"variables, margin up to {self.largest_margin:.4g}>"
        )

    def __str__(self) -> str:
        lines = [repr(self)]
        for step, labels in enumerate(self.steps.labels):
            index = self.nodes[self.steps.place(step)]
            known = zip(labels, self.steps.ids[step].tolist(), self.steps.given(step), strict=True)
            words = [
                self.steps.names[variable] if variable >= 0 else f"{label} = {value:.6g}"
                for label, variable, value in known
            ]
            kind = self.steps.sets[index].kind
            lines.append(f"  step {step} in set {index}, {kind}: {', '.join(words)}")
        return "\n".join(lines)

    def sample(self, n: int, seed: int | None = None, margin: float = 0.0) -> FloatArray:
        """Return positions uniformly distributed over the set, by hit and run.

        Samples are independent; how long each walks is said, and why that is enough, in
        `hit_and_run`.

        Parameters
        ----------
        n : int
        seed : int, optional
            For the same samples again.
        margin : float, optional
            Only positions of a larger margin than this.

        Returns
        -------
        numpy.ndarray, shape (n, n_variables)
            Each of a margin above `margin`.

        Raises
        ------
        SolverError
            If there are none, or the set is thinner than the accuracy of the solver.
        """
        region = replace(self.region, bounds=self.region.bounds - margin * self.region.scales)
        return sample_uniformly(region, n, np.random.default_rng(seed), self.solver)

    def to_plan(self, values: npt.ArrayLike | None = None) -> Plan:
        """Return the plan of positions, checked exactly; inside the sets its fingers slide.

        Positions off their edge by a solver's accuracy are moved onto it, and a finger that would
        slide by less than a millionth of an edge stays.

        Parameters
        ----------
        values : array_like, shape (n_variables,), optional
            By default those of the variables.

        Returns
        -------
        Plan

        Raises
        ------
        NotForceClosureError
            If the positions are not inside the set, or not beyond rounding; it says where and by
            how much.
        """
        positions = self._positions(values)
        if positions.ndim != 1:
            raise OptionError(f"a plan needs one array of values, got shape {positions.shape}")
        lower, upper = self.region.lower[0], self.region.upper[0]
        near = np.clip(positions, lower - OFF * self._size, upper + OFF * self._size) == positions
        inside = np.clip(positions, lower, upper) if near.all() else positions
        if not self.contains(inside):
            raise NotForceClosureError(
                f"these values are not inside the path set: {self.steps.border(inside)}"
            )
        fractions = self.steps.fractions(inside)
        smooth = merged(self.steps.problem, fractions)
        if self.contains(self.steps.positions(smooth)):
            fractions = smooth
        plan = self._plan(self.steps.problem.grasps(fractions))
        report = plan.verify()
        if not report.ok:
            raise NotForceClosureError(
                f"these values are within rounding of the border, {self.steps.border(inside)}: "
                f"{report.fault}"
            )
        return plan

    def _plan(self, grasps: Sequence[FloatArray]) -> Plan:
        """The steps of fingers that take given grasps of each set, not yet checked."""
        steps, sets = self.steps, self.steps.sets
        given = [c for end in (steps.start, steps.goal) if end is not None for c in end.grasp]
        first, last = (
            sets.grasp(node, fractions, given)
            for node, fractions in ((self.nodes[0], grasps[0][0]), (self.nodes[-1], grasps[-1][-1]))
        )
        start, chosen = first, tuple(range(len(first)))
        if steps.start is not None:
            start, chosen = steps.start.grasp, steps.start.chosen
        goal = last if steps.goal is None else steps.goal.grasp
        fingers = {i + 1: contact for i, contact in enumerate(start)}
        run = Execution(sets, self.hand, fingers, [i + 1 for i in chosen], self.nodes[0], given)
        run.along(self.nodes, steps.choice.held, grasps, goal)
        done = tuple(run.steps), tuple(run.supports)
        return Plan(sets.polygon, self.friction, self.hand, fingers, goal, *done)
