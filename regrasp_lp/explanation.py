"""Why there is no plan, as an object and as text."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from regrasp_lp.connection import FrictionThreshold, Route
from regrasp_lp.contact import Grasp
from regrasp_lp.graph_options import GraphOptions
from regrasp_lp.nearest_switch import NearestSwitch
from regrasp_lp.planning.hand import Hand
from regrasp_lp.remedies import Remedy, contacts_text

_WIDTH, _INDENT = 79, 10


@dataclass(frozen=True)
class End:
    """Where in the graph the start or the goal is.

    Parameters
    ----------
    sets : tuple of int
        Numbers of the sets that contain it, or two of its contacts.
    components : tuple of (int, int)
        Number and size of each component that these are in.
    """

    sets: tuple[int, ...]
    components: tuple[tuple[int, int], ...]

    def __str__(self) -> str:
        if not self.sets:
            return "in none of the sets"
        inside = (f"component {number} ({count(size, 'set')})" for number, size in self.components)
        return f"in {' and '.join(inside)}"


@dataclass(frozen=True)
class MoreFingers:
    """Whether one more finger would do.

    Parameters
    ----------
    fingers : int
    route : Route or None
        The path of sets that a hand of so many fingers could take.
    """

    fingers: int
    route: Route | None

    def __str__(self) -> str:
        if self.route is None:
            return f"with {self.fingers} there is no plan either"
        return f"with {self.fingers} there is a plan{_placements(self.route)}"


@dataclass(frozen=True, eq=False)
class Explanation:
    """Why there is no plan, and what would help; `str` gives it as text.

    Of grasps that are not in force closure only `remedies` are told, and of a start or goal in
    no set neither a switch nor fingers.

    Parameters
    ----------
    start, goal : Grasp
        Resolved.
    options : GraphOptions
        Which sets and switches were considered.
    hand : Hand
    remedies : mapping of str to Remedy
        For "start" and "goal", if not in force closure: what would make them so.
    n_sets, n_components : int or None
        Of the graph; None if it was not built.
    ends : mapping of str to End
        Where in the graph "start" and "goal" are; empty if it was not built.
    route : Route or None
        If there is a plan after all: a path of sets with the fewest placements.
    nearest : NearestSwitch or None
        The missing switch that comes nearest to joining the components of start and goal; None if
        no two of their sets have the edges in common that would have to be held, and for a hand
        that limits the distances between its fingers.
    threshold : FrictionThreshold or None
        The friction at which start and goal are first joined.
    fingers : MoreFingers or None
        Whether one more finger would do.
    among_all : Route or None
        A path among all force-closure grasps, where only some sets or switches were considered;
        None also if there is none.
    standstill : str or None
        What fingers of the hand that only slide rule out; there are no `ends` then.
    without : mapping of str to Route or None, optional
        For each limit of the hand the path that a hand without it could take, if there is one;
        None for a hand without limits.
    """

    start: Grasp
    goal: Grasp
    options: GraphOptions
    hand: Hand
    remedies: Mapping[str, Remedy] = field(default_factory=dict)
    n_sets: int | None = None
    n_components: int | None = None
    ends: Mapping[str, End] = field(default_factory=dict)
    route: Route | None = None
    nearest: NearestSwitch | None = None
    threshold: FrictionThreshold | None = None
    fingers: MoreFingers | None = None
    among_all: Route | None = None
    standstill: str | None = None
    without: Mapping[str, Route | None] | None = None

    @property
    def plan_exists(self) -> bool:
        """Whether there is a plan after all."""
        return self.route is not None

    def __repr__(self) -> str:
        return f"<Explanation: {self._headline()}>"

    def __str__(self) -> str:
        entries: list[tuple[str, object]] = []
        for role, found in self.remedies.items():
            grasp = contacts_text(self.start if role == "start" else self.goal)
            entries.append((role, f"{grasp}: {found}"))
        if self.route is None and (self.ends or self.standstill):
            entries += self.ends.items()
            if self.ends and not self._in_no_set:
                entries.append(("switch", self._switch_text()))
            entries += [("friction", self.threshold)] if self.threshold else []
            entries += [("fingers", self.fingers)] if self.fingers else []
            entries += [("hand", self._hand_text(self.without))] if self.without else []
            entries += [("sets", self._sets_text())] if not self.options.everything else []
        head = textwrap.fill(self._headline(), _WIDTH)
        return "\n".join([head, *(_entry(label, text) for label, text in entries)])

    @property
    def _in_no_set(self) -> list[str]:
        return [role for role, end in self.ends.items() if not end.sets]

    def _headline(self) -> str:
        if self.route is not None:
            over = f" over {count(len(self.route.edges), 'grasp set')}" * bool(self.route.edges)
            return f"There is a plan by sliding{_placements(self.route)}{over}."
        if self.remedies:
            verb = "is" if len(self.remedies) == 1 else "are"
            return f"No plan: {_roles(self.remedies)} {verb} not in force closure."
        if self.standstill:
            return f"No plan: {self.standstill}."
        kind = f"{self.n_sets} {self.options.sets} sets"
        if self._in_no_set:
            verb = "is" if len(self._in_no_set) == 1 else "are"
            return f"No plan: {_roles(self._in_no_set)} {verb} in none of the {kind}."
        return (
            f"No plan: no switches lead from the start to the goal; the {kind} are in "
            f"{count(self.n_components or 0, 'component')}."
        )

    def _switch_text(self) -> str:
        near = self.nearest
        if self.hand.coupled:
            return "not looked for, as the hand has limits that tie its fingers to each other"
        if near is None:
            return "no two sets of theirs have the edges in common that would have to be held"
        one, other = (
            f"set {number} on edges {_edges(edges)}"
            for number, edges in zip((near.first, near.second), near.edges, strict=True)
        )
        among = count(near.pairs, "candidate")
        if near.searched < near.pairs:
            among = f"the first {near.searched} of {among}"
        rule = "; it is not the contact rule that keeps them apart" if near.margin > 0 else ""
        return (
            f"the nearest of {among} is from {one} to {other}, holding "
            f"{_edges(near.held)}, with a margin of {near.margin:.4g}: "
            f"{_positions(near.grasps[0])} and {_positions(near.grasps[1])}{rule}"
        )

    @staticmethod
    def _hand_text(without: Mapping[str, Route | None]) -> str:
        reliefs = [
            f"without {limit} there is a plan{_placements(found)}"
            for limit, found in without.items()
            if found is not None
        ]
        each = ", or without ".join(without)
        return ", ".join(reliefs) or f"without {each} there is no plan either"

    def _sets_text(self) -> str:
        if self.among_all is None:
            return "among all force-closure grasps there is no plan either"
        return f"among all force-closure grasps there is a plan{_placements(self.among_all)}"


def count(number: int, noun: str) -> str:
    """Return a number with its noun.

    Examples
    --------
    >>> count(1, "set"), count(3, "set")
    ('1 set', '3 sets')
    """
    return f"{number} {noun}{'s' * (number != 1)}"


def _placements(route: Route) -> str:
    return "" if route.placements is None else f" of {count(route.placements, 'placement')}"


def _roles(roles: Mapping[str, object] | Sequence[str]) -> str:
    return " and ".join(f"the {role}" for role in roles)


def _edges(edges: tuple[int, ...]) -> str:
    return "-".join(map(str, edges))


def _positions(grasp: Grasp) -> str:
    """The contacts in the form that the command line takes."""
    pairs = zip(grasp.edges.tolist(), grasp.positions.tolist(), strict=True)
    return ",".join(f"{edge}:{position:.6g}" for edge, position in pairs)


def _entry(label: str, text: object) -> str:
    """A label and its text, wrapped beside it."""
    return textwrap.fill(
        str(text),
        _WIDTH,
        initial_indent=f"{label:<{_INDENT}}",
        subsequent_indent=" " * _INDENT,
        break_on_hyphens=False,
        break_long_words=False,
    )
