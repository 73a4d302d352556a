"""The contacts of one way through a path of sets as a cvxpy model.

The rows are those of the planner's own path LP; here they only get variables with names, and a
user's constraints and objective beside them. What a solver answers is checked.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from regrasp_lp.errors import NoPlanFound, OptionError, SolverError
from regrasp_lp.friction import FloatArray
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import Solver
from regrasp_lp.planning.path_optimum import largest_tolerance
from regrasp_lp.planning.path_steps import PathSteps

if TYPE_CHECKING:
    import cvxpy as cp

OFF = 1e-6
"""What a solver may miss a constraint by, in the object's size, before its answer is refused."""


@dataclass(frozen=True, eq=False)
class PathModel:
    """Positions of contacts along a path as cvxpy variables, with what holds them.

    Parameters
    ----------
    steps : PathSteps
    solver : Solver
        Of this package's own linear programs.

    Examples
    --------
    Its constraints, with variables and an objective of one's own:

    >>> import cvxpy as cp
    >>> import regrasp_lp as rl
    >>> block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])
    >>> graph = rl.build_switching_graph(block, friction=0.4)
    >>> path = graph.path_set([0, 1], start=[(0, 3), (2, 3)])
    >>> path.names
    ('u[1,0]', 'u[1,2]', 'u[2,1]', 'u[2,3]', 'u[3,1]', 'u[3,3]')
    >>> slant = path.variables["u[2,1]"] + path.variables["u[2,3]"] - 3
    >>> most = cp.Problem(cp.Maximize(slant), path.constraints_at(0.2))
    >>> round(float(most.solve()), 3)
    1.969
    """

    steps: PathSteps
    solver: Solver

    @property
    def n_steps(self) -> int:
        """Number of grasps along the path."""
        return len(self.steps.ids)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free positions, in the order of all arrays of them."""
        return self.steps.names

    @property
    def region(self) -> LinearSets:
        """The set as linear rows over `names`, for use without cvxpy (a stack of one)."""
        return self.steps.region

    @property
    def largest_margin(self) -> float:
        """The largest margin that all grasps that are free to choose can have at once; or inf."""
        return self.steps.choice.margin

    def edges(self, step: int) -> tuple[int, ...]:
        """Return the edges of the contacts of a step, ascending, as `positions` has them."""
        return self.steps.grasp_set(step).edges

    @cached_property
    def _free(self) -> list[cp.Variable]:
        import cvxpy as cp

        return [cp.Variable(name=name) for name in self.names]

    @cached_property
    def variables(self) -> Mapping[str, cp.Expression]:
        """Position of every contact of every step, by name: a variable, or a constant if given."""
        import cvxpy as cp

        found: dict[str, cp.Expression] = {}
        for step, labels in enumerate(self.steps.labels):
            values = self.steps.given(step).tolist()
            ids = self.steps.ids[step].tolist()
            for label, variable, value in zip(labels, ids, values, strict=True):
                found[label] = self._free[variable] if variable >= 0 else cp.Constant(value)
        return MappingProxyType(found)

    @cached_property
    def margin(self) -> cp.Variable:
        """The least margin of all grasps that are free to choose, as a variable to maximise."""
        import cvxpy as cp

        return cp.Variable(name="margin")

    @property
    def constraints(self) -> list[cp.Constraint]:
        """All constraints, at the level of the variable `margin`."""
        return self.constraints_at(self.margin)

    def constraints_at(self, margin: float | cp.Expression) -> list[cp.Constraint]:
        """Return all constraints at a level of the margin.

        Parameters
        ----------
        margin : float or cvxpy.Expression
            A number above 0, a parameter or a variable, in the object's unit: ``rows u + margin
            scales <= bounds`` of `region`, and ends of edges.
        """
        import cvxpy as cp

        if not self._free:
            return []
        region, u = self.region, cp.hstack(self._free)
        rows = region.rows[0] @ u + region.scales[0] * margin <= region.bounds[0]
        return [rows, u >= region.lower[0], u <= region.upper[0]]

    def positions(self, step: int) -> cp.Expression:
        """Return the positions of a step's contacts, shape (m,), in the order of `edges`."""
        import cvxpy as cp

        self.steps.place(step)
        return cp.hstack([self.variables[label] for label in self.steps.labels[step]])

    def points(self, step: int) -> cp.Expression:
        """Return the contact points of a step in the plane, affine, shape (m, 2)."""
        import cvxpy as cp

        polygon, edges = self.steps.sets.polygon, list(self.edges(step))
        along = cp.diag(self.positions(step)) @ polygon.tangents[edges]
        return polygon.edge_starts[edges] + along

    @property
    def travel(self) -> cp.Expression:
        """The way that all fingers slide together, ``Σ |u' - u|``, convex."""
        import cvxpy as cp

        if not self._free:
            return cp.Constant(float(np.abs(self.steps.moves[1]).sum()))
        rows, offsets = self.steps.moves
        return cp.norm1(rows @ cp.hstack(self._free) + offsets)

    def solve(
        self,
        objective: cp.Minimize | cp.Maximize | None = None,
        constraints: Iterable[cp.Constraint] = (),
        margin: float | None = None,
        solver: str = "CLARABEL",
    ) -> float:
        """Choose positions, under own constraints and by an own objective; sets the variables.

        Parameters
        ----------
        objective : cvxpy.Minimize or cvxpy.Maximize, optional
            Over `variables`, `positions`, `points`, `travel`, `margin` and what else a user has;
            by default the margin is maximised.
        constraints : iterable of cvxpy.Constraint, optional
            Added to those of the set.
        margin : float, optional
            Least margin to keep; by default half of the largest that the constraints allow. At 0
            the contacts of an optimum would lie on the border, where nothing is held.
        solver : str, optional
            cvxpy's name of one that can solve what was added.

        Returns
        -------
        float
            The optimal value, as the solver has it. That the positions keep the margin and satisfy
            the constraints is checked here.

        Raises
        ------
        OptionError
            If the objective is none, or the margin is not above 0.
        NoPlanFound
            If the constraints leave nothing; the explanation says which margin they do leave.
        SolverError
            If the solver stopped early, or its answer did not pass the check.
        """
        import cvxpy as cp

        extra = list(constraints)
        if objective is not None and not isinstance(objective, (cp.Minimize, cp.Maximize)):
            raise OptionError(f"an objective is a cvxpy.Minimize or Maximize, got {objective!r}")
        if margin is not None and not 0 < margin < np.inf:
            raise OptionError(f"the margin to keep has to be above 0, got {margin!r}")
        if extra:
            self._run(cp.Maximize(self.margin), [*self.constraints, *extra], solver)
        else:
            self._widen()
        best = float(self.margin_of())
        if not best > 0 or (margin is not None and best < margin - OFF * self._size):
            wanted = "a positive margin" if margin is None else f"a margin of {margin:g}"
            raise NoPlanFound(
                f"no contacts of this path set with {wanted} satisfy the constraints: the largest "
                f"margin that they leave is {best:.4g}, without them {self.largest_margin:.4g}"
            )
        if objective is None:
            return best
        level = best / 2 if margin is None else min(margin, (1 - OFF) * best)
        kept = [] if not self._free else [*self.constraints, self.margin >= level]
        value = self._run(objective, [*kept, *extra], solver)
        if self.margin_of() < max(level / 2, level - OFF * self._size):
            raise SolverError(
                f"{solver} was to keep a margin of {level:.3g}, its answer has one of "
                f"{self.margin_of():.3g}: try another solver"
            )
        return value

    def _run(
        self,
        objective: cp.Minimize | cp.Maximize,
        constraints: list[cp.Constraint],
        solver: str,
    ) -> float:
        """Solve a problem, whatever the solver says of itself: its answer is checked."""
        import cvxpy as cp

        problem = cp.Problem(objective, constraints)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # that it may be inaccurate
                problem.solve(solver=solver)
        except cp.SolverError as error:
            raise SolverError(f"{solver} cannot solve this problem: {error}") from error
        none = problem.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE)
        if none and objective.args[0] is self.margin:
            raise NoPlanFound(
                f"the constraints contradict each other, or the ends of the edges: {solver} says "
                f"{problem.status}, whatever the margin"
            )
        if problem.value is None or any(v.value is None for v in self._free):
            raise SolverError(f"{solver} has no answer: it says {problem.status}")
        self._assign(np.array([float(v.value) for v in self._free]))
        broken = max((float(np.max(c.violation())) for c in constraints), default=0.0)
        if not broken <= OFF * max(1.0, self._size):
            raise SolverError(
                f"{solver} says {problem.status}, but its answer violates a constraint by "
                f"{broken:.2g}: try another solver"
            )
        return float(problem.value)

    def _widen(self) -> None:
        """Set the variables to positions of largest margin, by the planner's own program."""
        problem = self.steps.problem
        if problem.n_variables:
            self._assign(self.steps.positions(largest_tolerance(problem, self.solver.name)))

    def _assign(self, positions: FloatArray) -> None:
        """Set the variables, moved onto their edges, which solvers miss by their accuracy."""
        inside = np.clip(positions, self.region.lower[0], self.region.upper[0])
        for variable, value in zip(self._free, inside.tolist(), strict=True):
            variable.value = value
        if self._free:
            self.margin.value = self.margin_of()

    @property
    def _size(self) -> float:
        return float(self.steps.sets.cones.size)

    # --- positions as numbers -------------------------------------------------------------------

    @property
    def values(self) -> FloatArray:
        """The current values of the variables, in the order of `names`.

        Raises
        ------
        OptionError
            If they have none.
        """
        missing = [name for name, v in zip(self.names, self._free, strict=True) if v.value is None]
        if missing:
            raise OptionError(f"{missing[0]} has no value yet: call solve(), or pass values")
        return np.array([float(v.value) for v in self._free])

    def _positions(self, values: npt.ArrayLike | None) -> FloatArray:
        if values is None:
            return self.values
        try:
            found = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise OptionError(f"values have to be numbers, got {values!r}") from None
        if found.ndim not in (1, 2) or found.shape[-1] != len(self.names):
            raise OptionError(
                f"values have shape {found.shape}; {len(self.names)} variables need "
                f"({len(self.names)},) or (n, {len(self.names)}), in the order of `names`"
            )
        if not np.isfinite(found).all():
            raise OptionError("values have to be finite numbers; some are not")
        return found

    def margin_of(self, values: npt.ArrayLike | None = None) -> Any:
        """Return the margin of positions: the least of all grasps that are free to choose.

        By the pieces of this set; what the grasps have as they are may be larger.

        Parameters
        ----------
        values : array_like, shape (n_variables,) or (n, n_variables), optional
            By default those of the variables.

        Returns
        -------
        float, or numpy.ndarray of shape (n,)
            In the object's unit; not above 0 outside the set, -inf off the edges, inf if there
            is nothing to choose.
        """
        positions = self._positions(values)
        several = np.atleast_2d(positions)
        region = self.region.take(np.zeros(len(several), dtype=np.intp))
        margins = region.margins(several)
        return margins if positions.ndim == 2 else float(margins[0])

    def contains(self, values: npt.ArrayLike | None = None) -> Any:
        """Return whether positions are strictly inside: whether their margin is above 0.

        Parameters
        ----------
        values : array_like, shape (n_variables,) or (n, n_variables), optional

        Returns
        -------
        bool, or numpy.ndarray of bool, shape (n,)
        """
        return self.margin_of(values) > 0
