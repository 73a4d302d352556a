"""Margin linear programs, in stacks: several solvers behind one function.

A margin LP is ``max ε  s.t.  rows x + scales ε <= bounds, lower <= x <= upper``: always feasible
and, with a positive scale, always bounded. No solver is ever asked whether something is feasible,
and none is believed: an answer is its point and its multipliers, from which a lower and an upper
bound of the optimum are computed here (`margin_lp.enclose`). What is left open is tried in other
ways (`ladder`), down to rational numbers.
"""

from regrasp_lp.lp.margin_lp import GAP, MarginSolutions, maximise_margins
from regrasp_lp.lp.solver import Solver, get_solver

__all__ = ["GAP", "MarginSolutions", "Solver", "get_solver", "maximise_margins"]
