"""Grasps along a path of sets: what each switch holds, which pieces lead through each set."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from regrasp_lp.errors import SolverError
from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.set_pieces import with_rows
from regrasp_lp.handovers import Handover, handovers
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.planning.aligning import PieceChains
from regrasp_lp.planning.fingers import Fingers
from regrasp_lp.planning.path_lp import Stage, build_path_problem
from regrasp_lp.planning.path_optimum import solve_path_problem
from regrasp_lp.planning.performance import Passage
from regrasp_lp.planning.staying import choose_pieces

if TYPE_CHECKING:
    from regrasp_lp.planning.planner import PlanningProblem


def passage_along(
    problem: PlanningProblem,
    path: tuple[int, ...],
    chosen: tuple[int, ...],
    start: FloatArray,
    goal: FloatArray,
    *,
    few: bool = False,
) -> Passage:
    """Return the grasps of largest least tolerance along a path of sets.

    Parameters
    ----------
    problem : PlanningProblem
    path : tuple of int
        The sets.
    chosen : tuple of int
        Which contacts of the start are those of the first set.
    start, goal : numpy.ndarray, shape (m,)
        Fractions of the first and the last grasp.
    few : bool
        Whether switches hold as few contacts as need be, not as many as can be.

    Returns
    -------
    Passage

    Raises
    ------
    SolverError
        If there are none, or none that a solver finds.
    """
    sets, hand = problem.sets, problem.hand
    switches = [_handover(problem, i, j, few) for i, j in pairwise(path)]
    held = tuple(switch.slots for switch in switches)
    couplings = [
        _coupling(problem, i, j, s) for (i, j), s in zip(pairwise(path), switches, strict=True)
    ]
    staying = [Fingers(sets, hand).staying(index) for index in path]
    if any(staying):
        every = [_whole_stage(problem, i, slots) for i, slots in zip(path, staying, strict=True)]
        stages = choose_pieces(every, held, start, goal, couplings)
    else:
        stages = _stages(problem, path, switches, start, goal)
    program = build_path_problem(stages, held, start, goal, couplings=couplings)
    grasps = solve_path_problem(program, problem.solver.name)
    return Passage(path, held, tuple(grasps), chosen, tuple(stages))


def _handover(problem: PlanningProblem, first: int, second: int, few: bool) -> Handover:
    """The best way to switch that holds as many contacts as possible, or as few."""
    others, held = problem.switches.neighbors(first)
    found = held[others == second]
    most = int(found[0]) if found.size else 0
    counts = [most]
    if few:
        contacts = problem.sets.contacts
        least = problem.hand.held(int(contacts[first]), int(contacts[second]))
        counts = list(range(least, most + 1))
    ways = (handovers(problem.sets, problem.solver, first, second, n) for n in counts)
    found = next((way[0] for way in ways if way), None)
    if found is None:
        raise SolverError(f"no grasps of the switch from set {first} to set {second} are found")
    return found


def _stages(
    problem: PlanningProblem,
    path: tuple[int, ...],
    switches: list[Handover],
    start: FloatArray,
    goal: FloatArray,
) -> list[Stage]:
    """The chain of pieces through each set, from where it is entered to where it is left."""
    arrivals = [start, *(switch.second for switch in switches)]
    leavings = [*(switch.first for switch in switches), goal]
    stages = []
    for index, f, g in zip(path, arrivals, leavings, strict=True):
        chains = PieceChains(problem.sets.pieces(index), problem.solver)
        pieces, _ = chains.chain(f, g)
        parts = chains.parts.take(np.array(pieces))
        limits = parts if problem.hand.coupled else None
        stages.append(Stage(chains.functions, parts.pieces, limits=limits))
    return stages


def _whole_stage(problem: PlanningProblem, index: int, staying: tuple[int, ...]) -> Stage:
    """All pieces of a set, with its contacts that do not slide."""
    parts = problem.sets.pieces(index)
    return Stage(parts.functions, parts.pieces, limits=parts, staying=staying)


def _coupling(
    problem: PlanningProblem, first: int, second: int, handover: Handover
) -> LinearSets | None:
    """What limits the distances between the fingers of both grasps of a switch."""
    found = problem.sets.coupled(first, second, handover.slots)
    if found is None or handover.way is None:
        return None
    rows, bounds = found.rows[[handover.way]], found.bounds[[handover.way]]
    n = rows.shape[2]
    none, box = np.zeros((1, 0, n)), np.zeros((1, n))
    names = tuple(f"x{i}" for i in range(n))
    free = LinearSets(names, none, none[:, :, 0], none[:, :, 0], box, box + 1.0)
    return with_rows(free, rows, bounds, "tolerance")
