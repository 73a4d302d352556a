"""Plans along the best paths of sets, one after the other: each is made when it is asked for."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from regrasp_lp.errors import NoPlanFound, SolverError
from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.search import PathSearch
from regrasp_lp.planning.steps import Place, Release, Slide
from regrasp_lp.switches import StoredSwitches, Switches, SwitchPairs

PATIENCE = 8
"""So many paths in a row that lead to no plan, and no more are tried."""

_SAME = 1e-6
"""Fractions of edges that differ by less are equal: programs are no more accurate."""

_MOST_SAME = 24

Kind = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True, eq=False)
class Alternative:
    """A plan and what it goes along.

    Parameters
    ----------
    weight : float
        Sum of the weights of its switches.
    path : tuple of int
        Its sets.
    plan : Plan
    """

    weight: float
    path: tuple[int, ...]
    plan: Plan


def in_order(
    search: PathSearch, plan_along: Callable[[tuple[int, ...]], Plan], thin: BoolArray
) -> Iterator[Alternative]:
    """Yield plans along the paths of a search, the best path first.

    Paths that lead to no plan, within rounding, are left out. After one that leads through a thin
    set the others go round such sets.

    Parameters
    ----------
    search : PathSearch
    plan_along : callable
        Makes the plan along a path of sets.
    thin : numpy.ndarray of bool, shape (N,)
        Sets within rounding of being none.

    Raises
    ------
    NoPlanFound, SolverError
        If there are paths, but the first ones lead to no plan.
    """
    seen: set[tuple[int, ...]] = set()
    failure: NoPlanFound | SolverError | None = None
    found, failed = False, 0
    wide = replace(search, margins=np.where(thin, -np.inf, search.margins))
    paths, widened = search.paths(), False
    while failed < PATIENCE and (best := next(paths, None)) is not None:
        path = best.path or ()
        if path in seen:
            continue
        seen.add(path)
        try:
            plan = plan_along(path)
        except (NoPlanFound, SolverError) as error:
            failure, failed = failure or error, failed + 1
            if isinstance(error, SolverError) and not widened and thin[list(path)].any():
                paths, widened = wide.paths(), True
            continue
        found, failed = True, 0
        yield Alternative(float(best.key[0]), path, plan)
    if failure is not None and not found:
        raise failure


def merged(runs: Iterable[Iterator[Alternative]]) -> Iterator[Plan]:
    """Yield the plans of several runs, each path once: always the better of the next ones.

    Raises
    ------
    NoPlanFound
        As the first run does, if no run has a plan.
    """
    heads, refusals = [], []
    for run in runs:
        try:
            heads.append(chain([next(run)], run))
        except StopIteration:
            continue
        except NoPlanFound as refusal:
            refusals.append(refusal)
    if refusals and not heads:
        raise refusals[0]
    seen = set()
    for found in heapq.merge(*heads, key=lambda a: (a.weight, a.plan.placements)):
        if found.path not in seen:
            seen.add(found.path)
            yield found.plan


def distinct(plans: Iterable[Plan]) -> Iterator[Plan]:
    """Yield plans with other steps than those before: on one way several sets may hold the object.

    Ends after many of the same steps, one after the other.
    """
    known: list[tuple[Kind, FloatArray]] = []
    same = 0
    for plan in plans:
        kind, fractions = _steps(plan)
        if any(k == kind and np.abs(f - fractions).max(initial=0.0) < _SAME for k, f in known):
            same += 1
            if same == _MOST_SAME:
                return
            continue
        same = 0
        known.append((kind, fractions))
        yield plan


def _steps(plan: Plan) -> tuple[Kind, FloatArray]:
    """What is done with which fingers on which edges; and where."""
    kind, fractions = [], []
    for step in plan.steps:
        match step:
            case Place(finger, contact):
                contacts = {finger: contact}
            case Release(finger):
                contacts = {}
                kind.append(("released", finger, 0))
            case Slide(moves):
                contacts = dict(moves)
        kind += [(type(step).__name__, finger, c.edge) for finger, c in contacts.items()]
        fractions += [c.fraction for c in contacts.values()]
    return tuple(kind), np.array(fractions, dtype=float)


@dataclass(frozen=True, eq=False)
class _Remembered:
    """Switches that are found on demand, each set's once."""

    switches: Switches
    _known: dict[int, tuple[IntArray, IntArray]] = field(default_factory=dict)

    def neighbors(self, index: int) -> tuple[IntArray, IntArray]:
        """As of the switches."""
        if index not in self._known:
            self._known[index] = self.switches.neighbors(index)
        return self._known[index]

    def witness(self, i: int, j: int) -> tuple[IntArray, FloatArray] | None:
        """As of the switches."""
        return self.switches.witness(i, j)

    def pairs(self) -> Iterator[SwitchPairs]:
        """As of the switches."""
        return self.switches.pairs()


def remembered(switches: Switches) -> Switches:
    """Return switches that know their neighbours, for many questions in one search."""
    return switches if isinstance(switches, StoredSwitches) else _Remembered(switches)
