"""Why no start and goal can be chosen on an object, and what would help."""

from __future__ import annotations

from regrasp_lp.build import build_switching_graph, find_sets
from regrasp_lp.connection import first_friction
from regrasp_lp.contact import Grasp
from regrasp_lp.errors import NoPlanFound
from regrasp_lp.friction import FloatArray
from regrasp_lp.planning.fingers import Fingers
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.relaxations import relaxations
from regrasp_lp.switching_graph import Progress, SwitchingGraph

_MOST_EDGES = 60
"""Of objects on which the friction that joins sets is looked for, for seconds of work."""


def no_choice(graph: SwitchingGraph, progress: Progress | None = None) -> NoPlanFound:
    """Return the answer that there are no two grasps far apart to choose.

    Parameters
    ----------
    graph : SwitchingGraph
        In which no two sets that a hand can pass through from anywhere are joined.
    progress : callable, optional

    Returns
    -------
    NoPlanFound
        Says whether there is no set, or none joined to another one, whether a limit of the hand
        is to blame, and else which friction would do.
    """
    if not len(graph):
        return NoPlanFound(f"no plan exists: {_no_set(graph)}")
    if graph.hand.only_slide:
        return NoPlanFound(_only_sliding(graph))
    return NoPlanFound(_not_joined(graph, progress))


def _no_set(graph: SwitchingGraph) -> str:
    polygon, hand, options = graph.polygon, graph.hand, graph.options
    kind = "" if options.sets == "complete" else f"{options.sets} "
    head = f"{polygon.name or 'the object'} has no {kind}grasp set at this friction"

    def count(hand: Hand) -> int:
        return len(find_sets(polygon, graph.friction, hand, options))

    more = 'try a larger friction, or sets="complete"' if kind else "try a larger friction"
    if not hand.limited:
        return f"{head}: {more}"
    without = count(Hand(hand.fingers))
    if not without:
        return f"{head}, with or without the limits of the hand: {more}"
    blamed = [
        f"{n} without {limit}" for limit, less in relaxations(hand).items() if (n := count(less))
    ]
    would = ", ".join(blamed) if blamed else f"{without} without all of these, none with one less"
    return f"{head} within the limits of the hand: there would be {would}"


def _only_sliding(graph: SwitchingGraph) -> str:
    """Fingers that only slide are idle unless they touch at the start, and none is given."""
    hand = graph.hand
    passable = Fingers(graph.sets, hand).passable(Grasp([]))
    assert passable is not None  # as some fingers only slide
    head = "no start can be chosen: fingers that only slide (only_slide) hold from a given start on"
    if hand.fingers == len(tuple(hand.only_slide)):
        return f"{head}, and there are no others: give a start"
    left = "no two grasp sets are joined" if passable.any() else "there is no grasp set"
    return f"{head}; with the others alone {left}: give a start"


def _not_joined(graph: SwitchingGraph, progress: Progress | None) -> str:
    hand, number = graph.hand, len(graph)
    kind = "" if graph.options.sets == "complete" else f"{graph.options.sets} "
    head = f"there is only one {kind}grasp set at this friction, joined to no other"
    if number > 1:
        head = f"no two of the {number} {kind}grasp sets at this friction are joined"
    blamed = [limit for limit, less in relaxations(hand).items() if _joined(graph, hand=less)]
    if blamed:
        help_ = f"some would be without {', or without '.join(blamed)}"
    elif graph.polygon.n_edges > _MOST_EDGES:
        help_ = "they may be at a larger friction"
    else:
        found = first_friction(
            graph.friction,
            lambda friction: _joined(graph, friction),
            graph.options.everything,
            progress,
        )
        help_ = f"two sets are {found}"
    return (
        f"no start and goal can be chosen: {head}, but {help_}; or give a start and a goal in the "
        "same set"
    )


def _joined(
    graph: SwitchingGraph, friction: FloatArray | None = None, hand: Hand | None = None
) -> bool:
    """Whether any two sets are joined at another friction, or by another hand."""
    options = graph.options
    built = build_switching_graph(
        graph.polygon,
        graph.friction if friction is None else friction,
        graph.hand if hand is None else hand,
        options.sets,
        options.switching,
        options.min_margin,
        options.solver,
        options.presolve,
    )
    return built.n_switches > 0
