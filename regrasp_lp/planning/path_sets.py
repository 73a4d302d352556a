"""All convex sets of contact choices along a path of grasp sets, best first."""

from __future__ import annotations

import numbers
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise

import numpy as np

from regrasp_lp.errors import ContactError, HandError, OptionError
from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.planning.path_choices import PathChoices, SetPieces
from regrasp_lp.planning.path_set import PathSet
from regrasp_lp.planning.path_steps import GivenEnd, PathSteps
from regrasp_lp.planning.planner import PlanningProblem
from regrasp_lp.planning.requests import GraspLike, checked_grasp

Held = Callable[[int, int], int | None]
"""How many contacts a switch between two sets can hold; None if there is no switch."""


def path_sets(
    problem: PlanningProblem,
    held: Held,
    nodes: Iterable[int],
    start: GraspLike | None,
    goal: GraspLike | None,
) -> Iterator[PathSet]:
    """Yield the convex sets of contact choices along a path, best first.

    Parameters
    ----------
    problem : PlanningProblem
    held : callable
        Tells how many contacts a switch can hold.
    nodes : iterable of int
        The path, at least one set.
    start, goal : Grasp or iterable of (edge, position), or None
        None if it is free to choose.

    Returns
    -------
    iterator of PathSet
        In the order of `PathChoices`. What is wrong with the path is said at once.

    Raises
    ------
    OptionError
        If the path is empty, has no such set, or two that follow each other are not adjacent.
    NotForceClosureError, ContactError, HandError
        If start or goal is not a grasp that can be held, or not in the first or the last set.
    HandError
        If the hand limits distances between fingertips, or single fingers.
    SolverError
        If a switch exists within rounding only.
    """
    sets, hand, solver = problem.sets, problem.hand, problem.solver
    if hand.coupled:
        raise HandError(
            "path sets do not know limits between fingertips (max_span, fingertip_separation) or "
            "of single fingers: build the graph for a hand without them and state them as "
            "constraints on points()"
        )
    path = _checked(sets, nodes)
    switches = []
    for one, other in pairwise(path):
        most = held(one, other)
        if most is None:
            raise OptionError(
                f"sets {one} and {other} of the path are not adjacent: a hand of {hand.fingers} "
                f"fingers cannot switch between edges {sets[one].edges} and {sets[other].edges}"
            )
        switches.append((most, int(hand.held(*(int(sets.contacts[i]) for i in (one, other))))))
    roles = (("start", path[0], start), ("goal", path[-1], goal))
    first, last = (_end(problem, node, grasp, role) for role, node, grasp in roles)
    stages = {i: SetPieces(sets.functions(i), solver) for i in path}
    choices = PathChoices(
        tuple(stages[i] for i in path),
        tuple(switches),
        _widths(sets, path[0], stages[path[0]], first),
        _widths(sets, path[-1], stages[path[-1]], last),
    )
    return (
        PathSet(PathSteps(sets, path, choices, choice, first, last), solver, hand, problem.friction)
        for choice in choices
    )


def _checked(sets: GraspSets, nodes: Iterable[int]) -> tuple[int, ...]:
    path = tuple(nodes)
    if not path:
        raise OptionError("the path is empty: give the number of at least one set")
    for node in path:
        if isinstance(node, bool) or not isinstance(node, numbers.Integral):
            raise OptionError(f"a path is made of numbers of sets, not of {node!r}")
        if not 0 <= node < len(sets):
            raise OptionError(f"no grasp set {node}: there are {len(sets)}, numbered from 0")
    return tuple(int(node) for node in path)


def _end(
    problem: PlanningProblem, node: int, given: GraspLike | None, role: str
) -> GivenEnd | None:
    """The end with those of its contacts that are the set's; the first choice if several are."""
    if given is None:
        return None
    sets = problem.sets
    grasp = checked_grasp(sets.polygon, given, problem.friction, problem.hand, role)
    found = sets.holding(grasp)
    chosen = next((chosen for index, chosen in found if index == node), None)
    if chosen is None:
        others = sorted({index for index, _ in found})
        place = "first" if role == "start" else "last"
        raise ContactError(
            f"the {role} is not in set {node} on edges {sets[node].edges}, the {place} of the "
            f"path: it is in {'sets ' + ', '.join(map(str, others)) if others else 'no set'}"
        )
    return GivenEnd(grasp, chosen)


def _widths(sets: GraspSets, node: int, pieces: SetPieces, end: GivenEnd | None) -> FloatArray:
    """Margin of the first or the last grasp in each piece; of a given one whether it is inside."""
    if end is None:
        return np.diag(pieces.overlaps).copy()
    fractions = sets.fractions(node, end.grasp.fractions[list(end.chosen)])
    return np.where(pieces.containing(fractions), np.inf, -np.inf)
