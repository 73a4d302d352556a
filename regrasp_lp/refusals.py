"""What a graph says when it has no plan: shortly at once, in full when asked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.errors import NoPlanFound
from regrasp_lp.planning.fingers import Fingers
from regrasp_lp.planning.stuck import sliding_only, stuck

if TYPE_CHECKING:
    from regrasp_lp.switching_graph import SwitchingGraph

_HEAD = "no plan exists among these sets: "


def refusal(graph: SwitchingGraph, start: Grasp, goal: Grasp) -> NoPlanFound:
    """Return the answer that no path leads from the start to the goal.

    Parameters
    ----------
    graph : SwitchingGraph
    start, goal : Grasp
        Resolved, in force closure.

    Returns
    -------
    NoPlanFound
        Says which of the two is in no set, or what fingers that only slide rule out, or else the
        components that they are in.
    """
    grasps = {"start": start, "goal": goal}
    asked = question(graph, start, goal)
    for role, grasp in grasps.items():
        if not graph.locate(grasp):
            return NoPlanFound(in_no_set(graph, role), asked)
    if reason := standstill(graph, start, goal):
        return NoPlanFound(f"no plan exists: {reason}", asked)
    found = Fingers(graph.sets, graph.hand)
    inside = {"start": found.starts(start), "goal": found.goals(goal)}
    places = ", ".join(
        _component_text(graph, role, {index for index, _ in sets}) for role, sets in inside.items()
    )
    number = len(graph.components())
    return NoPlanFound(f"{_HEAD}{places}, of {number} component{'s' * (number != 1)}", asked)


def standstill(graph: SwitchingGraph, start: Grasp, goal: Grasp) -> str | None:
    """Return what keeps start and goal apart if fingers only slide; None if all may be placed.

    Parameters
    ----------
    graph : SwitchingGraph
        In which no path leads from the start to the goal.
    start, goal : Grasp
        Resolved.
    """
    passable = Fingers(graph.sets, graph.hand).passable(start)
    if passable is None:
        return None
    if reason := stuck(graph.hand, start, goal):
        return reason
    sliding = sliding_only(graph.hand, start)
    stay = ", ".join(f"finger {finger} on edge {edge}" for finger, edge in sliding.items())
    stay = f"stay on their edges ({stay})" if stay else "are idle, as none touches at the start"
    number = np.count_nonzero(passable)
    return (
        f"fingers that only slide (only_slide) {stay}, and the {number} of the {len(graph)} "
        f"{graph.options.sets} sets that go with that do not lead from the start to the goal"
    )


def question(graph: SwitchingGraph, start: Grasp, goal: Grasp) -> Mapping[str, Any]:
    """Return what `explain` has to be asked about a plan in a graph: nothing large is kept."""
    return {
        "polygon": graph.polygon,
        "start": start,
        "goal": goal,
        "friction": graph.friction,
        "hand": graph.hand,
        "sets": graph.options.sets,
        "switching": graph.options.switching,
        "min_margin": graph.options.min_margin,
    }


def in_no_set(graph: SwitchingGraph, role: str) -> str:
    """Return the answer that the start, or the goal, is in no set of a graph, and why.

    Parameters
    ----------
    graph : SwitchingGraph
    role : str
        "start" or "goal".
    """
    where = f"{_HEAD}the {role} is in none of the {len(graph)} {graph.options.sets} sets"
    if graph.options.min_margin:
        return f"{where} with a margin above {graph.options.min_margin:g}"
    if graph.options.sets != "complete":
        return f'{where}, which do not cover all force-closure grasps: use sets="complete"'
    return (
        f"{where}, which stop a little short of the hand's limits: relax these, or move the {role}"
    )


def _component_text(graph: SwitchingGraph, role: str, found: set[int]) -> str:
    inside = [
        f"component {number} ({len(component)} sets)"
        for number, component in enumerate(graph.components())
        if component & found
    ]
    if not inside:
        return f"the {role} is in no set from which the fingers that are left may come to it"
    return f"the {role} is in {' and '.join(inside)}"
