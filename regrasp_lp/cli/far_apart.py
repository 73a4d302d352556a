"""Two grasps that are far apart in a switching graph, for who wants to see a plan."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from regrasp_lp.cli.no_choice import no_choice
from regrasp_lp.cli.values import grasp, grasp_text
from regrasp_lp.contact import Grasp
from regrasp_lp.errors import ContactError
from regrasp_lp.friction import IntArray
from regrasp_lp.planning.fingers import Fingers
from regrasp_lp.planning.search import placements_from
from regrasp_lp.quality import margin
from regrasp_lp.switches import SwitchesOnDemand
from regrasp_lp.switching_graph import Progress, SwitchingGraph

_NOTHING = Grasp([])
_LOOK_AT = 300
"""Sets whose neighbours are looked at where switches are found on demand, for a second's work."""


def far_apart(
    graph: SwitchingGraph,
    start: Grasp | None = None,
    goal: Grasp | None = None,
    progress: Progress | None = None,
) -> tuple[Grasp, Grasp]:
    """Return a start and a goal between which a plan needs many placements.

    What is given is kept. Otherwise they are good grasps of two sets: in the largest component
    the set farthest from its first one, and the set farthest from that. Of equally far sets the
    one with the largest margin is taken (to a millionth of the object's diameter), then the first.
    In graphs too large to store it is a far set, though not always the farthest.

    Parameters
    ----------
    graph : SwitchingGraph
    start, goal : Grasp, optional
        Checked grasps that are in the graph.
    progress : callable, optional
        Told what is done to find out why there are none.

    Returns
    -------
    start, goal : Grasp
        Chosen ones are at positions of few digits; `grasp_text` gives them exactly.

    Raises
    ------
    NoPlanFound
        If there are no two sets to choose from; the message says why, and what would help.
    """
    if start is not None and goal is not None:
        return start, goal
    if start is not None:
        sources = [index for index, _ in Fingers(graph.sets, graph.hand).starts(start)]
        return start, chosen_grasp(graph, _farthest(graph, sources, start))
    if goal is not None:
        # The way back places as many fingers, but for those that the two ends differ by.
        fewer = graph.sets.contacts
        return _held(graph, _farthest(graph, graph.locate(goal), fewer=fewer)), goal
    if not len(graph):
        raise no_choice(graph, progress)
    first = _farthest(graph, [_beginning(graph)])
    second = _farthest(graph, [first])
    if first == second:
        raise no_choice(graph, progress)
    return _held(graph, first), chosen_grasp(graph, second)


def _held(graph: SwitchingGraph, index: int) -> Grasp:
    """A good grasp of a set as a start: where fingers differ, with fingers that may be there."""
    found = chosen_grasp(graph, index)
    if len(graph.hand.groups) == 1:
        return found
    resolved = graph.polygon.resolve(found)
    groups = Fingers(graph.sets, graph.hand)
    free = [list(group) for group in graph.hand.groups]
    order = next(
        chosen
        for number, chosen in graph.sets.holding(resolved)
        if number == index and len(chosen) == len(resolved)
    )
    fingers = [free[group].pop(0) for group in groups.groups(index).tolist()]
    by_contact = dict(zip(order, fingers, strict=True))
    return Grasp(found.contacts, [by_contact[i] for i in range(len(found))])


def _beginning(graph: SwitchingGraph) -> int:
    """Return a set from which to look for a far one."""
    if isinstance(graph.switches, SwitchesOnDemand):
        return int(graph.sets.margins.argmax())  # to find the components would take long
    passable = Fingers(graph.sets, graph.hand).passable(_NOTHING)
    first = graph.components()[0]
    return min(first if passable is None else first & set(np.flatnonzero(passable)) or first)


def _farthest(
    graph: SwitchingGraph,
    sources: Iterable[int],
    start: Grasp = _NOTHING,
    fewer: IntArray | None = None,
) -> int:
    """Return the set that needs most placements from the sources, less `fewer` of each set.

    Fingers that only slide stay on the edges where they are at the start.
    """
    sets = graph.sets
    most = _LOOK_AT if isinstance(graph.switches, SwitchesOnDemand) else None
    passable = Fingers(sets, graph.hand).passable(start)
    margins = sets.margins if passable is None else np.where(passable, sets.margins, -np.inf)
    found = placements_from(
        sets.contacts, margins, graph.switches, graph.hand, dict.fromkeys(sources, 0), most
    )
    reached = np.flatnonzero((found >= 0) & (margins > -np.inf))
    if not reached.size:
        raise no_choice(graph)
    far = found[reached] if fewer is None else (found - fewer)[reached]
    margins = np.round(margins[reached] / graph.polygon.diameter, 6)
    return int(reached[np.lexsort((reached, -margins, -far))[0]])


def chosen_grasp(graph: SwitchingGraph, index: int) -> Grasp:
    """Return a good grasp of a set, at positions of few digits.

    The best grasp is often at the ends of edges, where no error of place is tolerated: it is
    moved off them if that keeps most of its margin.

    Parameters
    ----------
    graph : SwitchingGraph
    index : int

    Returns
    -------
    Grasp
        Strictly inside the set, with 90 % of its margin or more; not resolved.
    """
    polygon = graph.polygon
    best = graph.sets.witness(index)
    largest = margin(polygon, best, graph.friction)
    for inset, kept in ((0.1, 0.9), (0.01, 0.9), (0.0, 0.999)):
        fractions = best.fractions.clip(inset, 1 - inset)
        pairs = list(zip(best.edges.tolist(), fractions.tolist(), strict=True))
        moved = polygon.resolve(Grasp.at_fractions(pairs))
        for digits in (4, 8, 12):
            try:
                rounded = grasp(grasp_text(moved, digits))
                enough = margin(polygon, rounded, graph.friction) >= kept * largest
                if enough and index in graph.locate(rounded):
                    return rounded
            except ContactError:  # rounded off the end of its edge
                continue
    return grasp(grasp_text(best))
