"""What a graph says when it has no plan: shortly at once, in full when asked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from regrasp_lp.contact import Grasp
from regrasp_lp.errors import NoPlanFound

if TYPE_CHECKING:
    from regrasp_lp.switching_graph import SwitchingGraph


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
        Says which of the two is in no set, or else the components that they are in.
    """
    grasps = {"start": start, "goal": goal}
    head = "no plan exists among these sets: "
    asked = question(graph, start, goal)
    for role, grasp in grasps.items():
        if not graph.locate(grasp):
            where = f"the {role} is in none of the {len(graph)} {graph.options.sets} sets"
            return NoPlanFound(head + where + _why_in_no_set(graph), asked)
    places = ", ".join(_component_text(graph, role, grasp) for role, grasp in grasps.items())
    return NoPlanFound(f"{head}{places}, of {len(graph.components())} components", asked)


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


def _why_in_no_set(graph: SwitchingGraph) -> str:
    if graph.options.min_margin:
        return f" with a margin above {graph.options.min_margin:g}"
    return ', which do not cover all force-closure grasps: use sets="complete"'


def _component_text(graph: SwitchingGraph, role: str, grasp: Grasp) -> str:
    found = set(graph.locate(grasp))
    inside = [
        f"component {number} ({len(component)} sets)"
        for number, component in enumerate(graph.components())
        if component & found
    ]
    return f"the {role} is in {' and '.join(inside)}"
