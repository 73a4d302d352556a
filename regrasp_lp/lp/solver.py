"""What a linear programming code is to this package, and the choice of one."""

from __future__ import annotations

from typing import Protocol

from regrasp_lp.errors import OptionError
from regrasp_lp.linear_sets import FloatArray, LinearSets

NAMES = ("clarabel", "highs")


class Solver(Protocol):
    """A linear programming code, as a value.

    `solve` returns for a stack of B sets in the unit box, with rows of magnitude 1, a point (B, n)
    and multipliers (B, R) of the rows, as good as it could; how good they are is found out by the
    caller. `thorough` asks for another, slower way. It may fail in any way: what it raises is
    caught, and what it left open is asked for again.
    """

    @property
    def name(self) -> str:
        """Its name in the public interface."""

    def solve(self, sets: LinearSets, *, thorough: bool) -> tuple[FloatArray, FloatArray]:
        """Return points (B, n) and row multipliers (B, R); NaN where the solver failed."""


def get_solver(name: str) -> Solver:
    """Return a solver by its public name, "clarabel" or "highs".

    Raises
    ------
    OptionError
        If there is no such solver.
    """
    if name == "clarabel":
        from regrasp_lp.lp.clarabel_solver import ClarabelSolver

        return ClarabelSolver()
    if name == "highs":
        from regrasp_lp.lp.highs_solver import HighsSolver

        return HighsSolver()
    raise OptionError(f'solver must be "clarabel" or "highs", got {name!r}')
