"""What is tried, one after the other, until every margin LP of a stack is closed.

A solver may stop early, return nonsense, raise an exception or panic. None of that is an answer:
what it leaves open is asked for again, one LP at a time, another way, of the other solver, and
last in rational numbers. An `Account` keeps what was tried and what came of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from regrasp_lp.linear_sets import FloatArray, LinearSets
from regrasp_lp.lp.solver import NAMES, Solver, get_solver


@dataclass(frozen=True)
class Attempt:
    """One way of asking a solver.

    Parameters
    ----------
    label : str
        What it is called in reports.
    solver : Solver
    thorough : bool
        Whether the solver is to take its slower way.
    one_by_one : bool
        One LP at a time, so that a bad one cannot spoil the answers to the others.
    balanced : bool
        With rows and margin scaled to magnitude 1.
    """

    label: str
    solver: Solver
    thorough: bool = False
    one_by_one: bool = True
    balanced: bool = True

    def ask(self, sets: LinearSets, faults: Counter[str]) -> tuple[FloatArray, FloatArray]:
        """Return points and multipliers; NaN where there are none, and why in `faults`.

        Parameters
        ----------
        sets : LinearSets
            In the unit box, with rows of magnitude 1.
        faults : Counter
            Counts what was raised.
        """
        factors = np.ones(sets.bounds.shape)
        if self.balanced:
            sets, factors = balance(sets)
        whole = np.arange(len(sets))
        parts = np.split(whole, len(sets)) if self.one_by_one else [whole]
        answers = [self._guarded(sets.take(p), faults) for p in parts if p.size]
        points, multipliers = (np.concatenate(a) for a in zip(*answers, strict=True))
        with np.errstate(all="ignore"):
            return points, multipliers * factors

    def _guarded(self, sets: LinearSets, faults: Counter[str]) -> tuple[FloatArray, FloatArray]:
        try:
            found = self.solver.solve(sets, thorough=self.thorough)
            points, multipliers = (np.asarray(a, dtype=np.float64) for a in found)
            if (points.shape, multipliers.shape) != (sets.lower.shape, sets.bounds.shape):
                raise ValueError(f"answer of shapes {points.shape} and {multipliers.shape}")
        except (KeyboardInterrupt, SystemExit, GeneratorExit):
            raise
        except BaseException as error:  # a panic of a solver written in Rust is no Exception
            faults[f"{type(error).__name__}: {error}"] += 1
            return np.full(sets.lower.shape, np.nan), np.full(sets.bounds.shape, np.nan)
        return points, multipliers


def attempts(solver: Solver) -> Iterator[Attempt]:
    """Yield what to try: the stack, then each LP on its own, in ever slower ways."""
    name = solver.name
    yield Attempt(name, solver, one_by_one=False, balanced=False)
    yield Attempt(f"{name} one by one", solver, balanced=False)
    yield Attempt(f"{name} thoroughly", solver, thorough=True)
    for other in NAMES:
        if other != name:
            yield Attempt(other, get_solver(other))
            yield Attempt(f"{other} thoroughly", get_solver(other), thorough=True)
    from regrasp_lp.lp.exact_solver import ExactSolver

    yield Attempt("exact simplex", ExactSolver(), balanced=False)


def balance(sets: LinearSets) -> tuple[LinearSets, FloatArray]:
    """Return the same LPs with rows, and the margin, scaled to magnitude 1.

    Parameters
    ----------
    sets : LinearSets

    Returns
    -------
    sets : LinearSets
        Of the same best points; margins are those of the given sets times a factor a set.
    factors : numpy.ndarray, shape (B, R)
        Multipliers of these rows times the factors are multipliers of the given rows.
    """
    unit = sets.scales.max(axis=1, initial=0.0)
    scales = sets.scales / np.where(unit > 0, unit, 1.0)[:, None]
    size = np.abs(sets.rows).max(axis=2, initial=0.0)
    size = np.maximum(np.maximum(size, np.abs(sets.bounds)), scales)
    factors = 1 / np.where(size > 0, size, 1.0)
    balanced = replace(
        sets,
        rows=sets.rows * factors[:, :, None],
        bounds=sets.bounds * factors,
        scales=scales * factors,
    )
    return balanced, factors


class Tried(NamedTuple):
    """An attempt, how many LPs it was asked, how many it left open, and by how much at worst."""

    label: str
    asked: int
    left: int
    gap: float
    faults: Counter[str]


@dataclass
class Account:
    """What was tried on a stack of LPs.

    Parameters
    ----------
    total : int
        Number of LPs in the stack.
    tried : list of Tried
        In order.
    """

    total: int
    tried: list[Tried] = field(default_factory=list)

    def retried(self) -> str:
        """Return one sentence on how what the first attempt left open was closed."""
        first = self.tried[0]
        closed = ", ".join(
            f"{t.asked - t.left:,} by {t.label}" for t in self.tried[1:] if t.left < t.asked
        )
        return (
            f"{first.label}: {first.left:,} of {self.total:,} margin LPs open after the first "
            f"attempt{_reasons(first.faults)}; solved {closed}"
        )

    def failed(self, accepted: float) -> str:
        """Return the text of an error: all that was tried, and what is left."""
        last = self.tried[-1]
        steps = "; ".join(
            f"{t.label} left {t.left:,} of {t.asked:,} (worst gap {t.gap:.1e}){_reasons(t.faults)}"
            for t in self.tried
        )
        return (
            f"{self.tried[0].label} left {last.left:,} of {self.total:,} margin LPs open "
            f"(accepted relative gap {accepted:.0e}), and so did every other way: this is neither "
            f"yes nor no; report it with the object. Tried: {steps}"
        )


def _reasons(faults: Counter[str]) -> str:
    """What was raised, how often, the most frequent first; long texts are cut."""
    if not faults:
        return ""
    texts = [
        f"{text[:200]}" + (f" ({count:,} times)" if count > 1 else "")
        for text, count in faults.most_common(3)
    ]
    return f" [{'; '.join(texts)}]"
