"""Whether two grasps are joined by a path of sets, and what it takes: friction, fingers, sets.

With complete sets, by the contact rule and without a least margin, what is joined stays joined as
friction grows: the cones only grow, so that every grasp that is in force closure remains so, and
with it every set and every switch of a path. The friction from which on two grasps are joined is
then a threshold, found by bisection. The chapter's kinds of grasp need cones that are not too wide,
and the margin of a grasp may fall as its cones grow; there a grid of frictions is scanned.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Set
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from regrasp_lp.build import build_switching_graph
from regrasp_lp.contact import Grasp
from regrasp_lp.friction import Cones, FloatArray
from regrasp_lp.graph_options import GraphOptions
from regrasp_lp.grasp_sets.candidates import two_finger_candidates
from regrasp_lp.planning.fingers import Fingers
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.on_demand import path_on_demand
from regrasp_lp.planning.search import fewest_placements
from regrasp_lp.polygon import Polygon
from regrasp_lp.switches import SwitchesOnDemand
from regrasp_lp.switching_graph import Progress, SwitchingGraph
from regrasp_lp.torque import torque_functions

_SMALL = 20
"""Up to so many edges the whole graph is found as fast as a path without it."""

_LARGE = 60
"""Above so many edges placements are not counted where all sets are joined for a simple reason."""

_WIDEST = 10.0
"""Friction up to which it is tried: cones of 84 degrees on either side."""

_LEAST_RANGE = 4.0
"""At least up to so many times the given friction."""

_LARGEST = 1e6
"""No friction is larger (`per_edge_friction`)."""

_ACCURACY = 1e-3
"""Relative distance of the two ends of a threshold."""

_GRID = 2**0.25
"""Ratio of neighbouring frictions of a scan."""

_SECONDS = 20.0
"""No further friction is tried after so long."""


@dataclass(frozen=True, eq=False)
class Regrasp:
    """What a plan is asked for: from where to where, on what, by which hand, among which sets.

    Parameters
    ----------
    polygon : Polygon
    start, goal : Grasp
        Resolved; in force closure, of 2 or 3 contacts.
    friction : numpy.ndarray, shape (n_edges,)
    hand : Hand
    options : GraphOptions
    """

    polygon: Polygon
    start: Grasp
    goal: Grasp
    friction: FloatArray
    hand: Hand
    options: GraphOptions

    @property
    def monotone(self) -> bool:
        """Whether more friction never parts what is joined."""
        return self.options.everything

    @property
    def on_demand(self) -> bool:
        """Whether a path can be found without listing all sets, and faster."""
        return self.monotone and self.hand == Hand(4) and self.polygon.n_edges > _SMALL

    def with_all_sets(self) -> Regrasp:
        """Return the same among all force-closure grasps and the switches between them."""
        options = replace(self.options, sets="complete", switching="contact", min_margin=0.0)
        return replace(self, options=options)

    def graph(self, progress: Progress | None = None) -> SwitchingGraph:
        """Build the whole graph."""
        options = self.options
        return build_switching_graph(
            self.polygon,
            self.friction,
            self.hand,
            options.sets,
            options.switching,
            options.min_margin,
            options.solver,
            options.presolve,
            progress,
        )


@dataclass(frozen=True)
class Route:
    """A path of grasp sets with the fewest placements.

    Parameters
    ----------
    edges : tuple of tuple of int
        Edges of the sets; none if start and goal are the same contacts, or if `placements` is None.
    placements : int or None
        How many placements it takes; None if these were not counted.
    """

    edges: tuple[tuple[int, ...], ...]
    placements: int | None


def route(question: Regrasp, graph: SwitchingGraph | None = None) -> Route | None:
    """Return a path of sets from start to goal, or None if nothing joins them.

    Parameters
    ----------
    question : Regrasp
    graph : SwitchingGraph, optional
        Its graph, if that is there already.

    Returns
    -------
    Route or None
        With the fewest placements by sliding, unless counting these would take long.
    """
    if set(question.start) == set(question.goal):
        return Route((), 0)
    if question.on_demand and (graph is None or isinstance(graph.switches, SwitchesOnDemand)):
        cones = Cones.of(question.polygon, question.friction)
        ends = np.sort(question.start.edges), np.sort(question.goal.edges)
        path = path_on_demand(cones, *ends)
        if path is None:
            return None
        # Two contacts are held across every switch of such a path.
        return Route(tuple(path), sum(len(edges) - 2 for edges in path[1:]))
    if graph is None and _plainly_joined(question):
        return Route((), None)
    return _route_in(question.graph() if graph is None else graph, question.start, question.goal)


def _plainly_joined(question: Regrasp) -> bool:
    """Whether so many fingers reach a two-finger set from anywhere, on a large object.

    Counting placements would take a graph that has several times the switches of one for four.
    """
    hand, polygon = question.hand, question.polygon
    if hand.limited or hand.needs[2, 2:].any() or not question.monotone:
        return False
    if polygon.n_edges <= _LARGE:
        return False
    cones = Cones.of(polygon, question.friction)
    return bool(torque_functions(cones, two_finger_candidates(cones)).exists().any())


def _route_in(graph: SwitchingGraph, start: Grasp, goal: Grasp) -> Route | None:
    sets, hand, fingers = graph.sets, graph.hand, Fingers(graph.sets, graph.hand)
    passable = fingers.passable(start)
    margins = sets.margins if passable is None else np.where(passable, sets.margins, -np.inf)
    sources = {i: 0 for i, _ in fingers.starts(start) if margins[i] > -np.inf}
    targets = {
        i: len(goal) - len(chosen) for i, chosen in fingers.goals(goal) if margins[i] > -np.inf
    }
    if not sources or not targets:
        return None
    if isinstance(graph.switches, SwitchesOnDemand) and passable is None:
        return Route((), None) if _joined_in(graph, sources.keys(), targets.keys()) else None
    path = fewest_placements(sets.contacts, margins, graph.switches, hand, sources, targets)
    if path is None:
        return None
    held = (graph.held(i, j) or 0 for i, j in pairwise(path))
    contacts = sets.contacts[path]
    placed = int(contacts[1:].sum()) - sum(held) + targets[path[-1]]
    return Route(tuple(sets[i].edges for i in path), placed)


def _joined_in(graph: SwitchingGraph, sources: Set[int], targets: Set[int]) -> bool:
    """Whether a path leads from one of the sources to one of the targets."""
    free = graph.hand.adjacent[2, 2:]
    if free.all() and (graph.sets.contacts == 2).any():
        return True  # two-finger sets are adjacent to all sets
    return any(c & sources and c & targets for c in graph.components())


@dataclass(frozen=True, eq=False)
class FrictionThreshold:
    """From which friction on start and goal are joined.

    Frictions are given as factors of the friction that was asked for, on all edges alike.

    Parameters
    ----------
    friction : numpy.ndarray, shape (n_edges,)
        What was asked for.
    below : float
        The largest factor, of those tried below `above`, at which they are not joined.
    above : float or None
        The least factor, of those tried, at which they are; None if there is none. It is within a
        thousandth of `below`, unless time ended the search.
    most : float
        Factor up to which it was to be tried.
    ended : bool
        Whether time ended the search.
    monotone : bool
        Whether it is proved that below `below` they are not joined, nor parted again above
        `above`. Otherwise only at the factors `tried`.
    tried : tuple of float
        All factors at which it was decided, ascending.
    """

    friction: FloatArray
    below: float
    above: float | None
    most: float
    ended: bool
    monotone: bool
    tried: tuple[float, ...]

    @property
    def uniform(self) -> bool:
        """Whether friction is the same on all edges."""
        return bool((self.friction == self.friction[0]).all())

    def __str__(self) -> str:
        tried = len(self.tried)
        scan = (
            ""
            if self.monotone
            else f" (scanned at {tried} values from {self._text(1.0)} to "
            f"{self._text(self.tried[-1])}: as friction grows, these sets may be parted again)"
        )
        if self.ended:
            scan += f" (the search was ended after {_SECONDS:g} seconds)"
        if self.above is None:
            return f"not even joined at a friction of {self._text(self.below)}{scan}"
        since = "joined from" if self.monotone else "first joined at"
        return (
            f"{since} a friction of {self._text(self.above)}, not yet at "
            f"{self._text(self.below)}{scan}"
        )

    def _text(self, factor: float) -> str:
        if self.uniform:
            return f"{factor * self.friction[0]:.6g}"
        return f"{factor:.6g} times the given one"


def friction_threshold(question: Regrasp, progress: Progress | None = None) -> FrictionThreshold:
    """Return the friction at which start and goal, which are not joined, first are.

    Parameters
    ----------
    question : Regrasp
    progress : callable, optional
        Told which friction is being tried.

    Returns
    -------
    FrictionThreshold
    """

    def joined(friction: FloatArray) -> bool:
        return route(replace(question, friction=friction)) is not None

    return first_friction(question.friction, joined, question.monotone, progress)


def first_friction(
    friction: FloatArray,
    joined: Callable[[FloatArray], bool],
    monotone: bool,
    progress: Progress | None = None,
) -> FrictionThreshold:
    """Return the friction at which something is first joined.

    Parameters
    ----------
    friction : numpy.ndarray, shape (n_edges,)
        At which it is not.
    joined : callable
        Decides at another one.
    monotone : bool
        Whether what is joined stays so as friction grows.
    progress : callable, optional
        Told which friction is being tried.

    Returns
    -------
    FrictionThreshold
    """
    highest = float(friction.max())
    most = min(max(_WIDEST / highest, _LEAST_RANGE), _LARGEST / highest)
    trial = _Trial(friction, joined, progress)
    grid: Iterator[float] = iter(())  # there may be no friction that is larger
    if most > 1:
        grid = _doubling(most) if monotone else _steps(most)
    below, above = 1.0, None
    for factor in grid:
        if trial.ended:
            break
        if trial.joined(factor):
            above = factor
            break
        below = factor
    while above is not None and above > below * (1 + _ACCURACY) and not trial.ended:
        middle = math.sqrt(below * above)
        below, above = (below, middle) if trial.joined(middle) else (middle, above)
    close = above is not None and above <= below * (1 + _ACCURACY)
    ended = trial.ended and not close and not (above is None and below == most)
    return FrictionThreshold(
        friction,
        below,
        above,
        most,
        ended,
        monotone,
        (1.0, *sorted(trial.tried)),
    )


@dataclass(frozen=True, eq=False)
class _Trial:
    """Decides at one friction after the other, and notes at which."""

    friction: FloatArray
    decide: Callable[[FloatArray], bool]
    progress: Progress | None
    tried: list[float] = field(default_factory=list)
    started: float = field(default_factory=time.monotonic)

    @property
    def ended(self) -> bool:
        """Whether time is up."""
        return time.monotonic() - self.started > _SECONDS

    def joined(self, factor: float) -> bool:
        if self.progress is not None:
            self.progress(f"trying {factor:.4g} times the friction", 0, 0)
        self.tried.append(factor)
        return self.decide(np.minimum(self.friction * factor, _LARGEST))


def _doubling(most: float) -> Iterator[float]:
    """2, 4, … and `most`: a step costs more than all before it, as sets grow in number."""
    factor = 2.0
    while factor < most:
        yield factor
        factor *= 2
    yield most


def _steps(most: float) -> Iterator[float]:
    """Powers of the ratio of the grid, and `most`."""
    count = math.ceil(math.log(most) / math.log(_GRID))
    yield from (_GRID**n for n in range(1, count))
    yield most
