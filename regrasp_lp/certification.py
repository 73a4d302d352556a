"""Every decision behind a switching graph, made once more and compared with what the graph says.

Candidates are taken from all combinations of edges, not from windows of sorted normals; existence
and switches are decided by signs and intervals, in floating point with a bound first and in
integers or rational numbers where that leaves something open.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from regrasp_lp.completion import complete, complete_exactly
from regrasp_lp.contact_rule import meet_held
from regrasp_lp.errors import OptionError
from regrasp_lp.exact_margins import certain_margins
from regrasp_lp.existence import existence
from regrasp_lp.friction import IntArray
from regrasp_lp.grasp_sets.vertices import Family
from regrasp_lp.lp import GAP, get_solver
from regrasp_lp.margins import best_pieces
from regrasp_lp.planning.hand import Hand
from regrasp_lp.shadows import Shadows, places_of
from regrasp_lp.switches import SwitchPairs, SwitchRule
from regrasp_lp.switching import Meeting
from regrasp_lp.switching_graph import SwitchingGraph
from regrasp_lp.torque import ACCURATE, TorqueFunctions

_CHUNK = 200_000
_SHOWN = 20


@dataclass(frozen=True)
class Tally:
    """How many decisions of one kind there were.

    Parameters
    ----------
    decided : int
    yes : int
        How many of them with a yes.
    exactly : int
        How many of them left open by floating point, and decided in integers or rationals.
    """

    decided: int = 0
    yes: int = 0
    exactly: int = 0

    def __add__(self, other: Tally) -> Tally:
        return Tally(
            self.decided + other.decided, self.yes + other.yes, self.exactly + other.exactly
        )


@dataclass(frozen=True)
class Certification:
    """What `certify` found.

    Parameters
    ----------
    name : str
        Of the object.
    sets : dict of str to Tally
        By kind, the existence of every candidate.
    switches : dict of int to Tally
        By number of held contacts, every pair of sets and every choice of held contacts.
    witnesses : Tally
        Witnesses of sets and of switches: whether they are inside. Where no double is, in sets
        and switches that exist within rounding only, that is no fault.
    faults : tuple of str
        What in the graph is not so, and which witnesses are not inside; the first ones.
    """

    name: str
    sets: dict[str, Tally]
    switches: dict[int, Tally]
    witnesses: Tally
    faults: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether the graph says what was found."""
        return not self.faults

    def __str__(self) -> str:
        lines = [f"{self.name or 'the graph'}: {'certified' if self.ok else 'FAULTS'}"]
        rows = [(f"{kind} sets", tally) for kind, tally in self.sets.items()]
        rows += [(f"switches, {held} held", tally) for held, tally in self.switches.items()]
        for what, tally in rows:
            if tally.decided:
                lines.append(
                    f"  {what:<18}{tally.decided:>9} decided, {tally.yes:>9} yes, "
                    f"{tally.exactly:>6} needed integers"
                )
        seen = self.witnesses
        lines.append(f"  {'witnesses':<18}{seen.decided:>9} tested,  {seen.yes:>9} inside")
        return "\n".join([*lines, *(f"  fault: {fault}" for fault in self.faults)])


def certify(graph: SwitchingGraph) -> Certification:
    """Make every decision behind a graph once more, exactly, and compare; margins of sets, too.

    Parameters
    ----------
    graph : SwitchingGraph
        Under the contact rule, with ``min_margin=0``.

    Returns
    -------
    Certification

    Raises
    ------
    OptionError
        If the graph was built with another rule, a margin or a hand with limits, or is none.

    Examples
    --------
    >>> from regrasp_lp import Polygon, build_switching_graph
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)], name="square")
    >>> report = certify(build_switching_graph(square, friction=0.5))
    >>> report.ok, report.sets["three_finger"].yes
    (True, 8)
    """
    if not isinstance(graph, SwitchingGraph):
        raise OptionError(f"certify takes a SwitchingGraph, not a {type(graph).__name__}")
    check_provable(graph.options.switching, graph.options.min_margin, graph.hand)
    return _Comparison(graph).report()


def check_provable(switching: str, min_margin: float, hand: Hand) -> None:
    """Raise OptionError if there are no certificates for graphs with such options."""
    if switching != "contact":
        raise OptionError(
            f'certificates are for switching="contact", not for switching="{switching}": '
            "build the graph with the contact rule"
        )
    if min_margin != 0:
        raise OptionError(
            f"certificates are for min_margin=0, not for min_margin={min_margin:g}: build the "
            "graph without a margin"
        )
    if hand.limited:
        raise OptionError("certificates are not for a hand with limits: use Hand(fingers=k)")


def contact_rule_of(graph: SwitchingGraph) -> SwitchRule:
    """Return the contact rule over the sets of a graph, decided exactly."""
    solver = get_solver(graph.options.solver)

    def decide(first: Shadows, second: Shadows, i: IntArray, j: IntArray) -> Meeting:
        return meet_held(first, second, i, j, solver=solver)

    return SwitchRule(graph.sets.sources, graph.hand, decide)


@dataclass
class _Comparison:
    graph: SwitchingGraph
    faults: list[str] = field(default_factory=list)
    witnesses: Tally = field(default_factory=Tally)
    within_rounding: set[tuple[int, int]] = field(default_factory=set)

    def report(self) -> Certification:
        graph = self.graph
        sets = {family.kind: self._sets(family.kind) for family in graph.sets.families}
        switches = self._switches()
        shown = self.faults[:_SHOWN]
        if len(self.faults) > _SHOWN:
            shown.append(f"and {len(self.faults) - _SHOWN} more")
        return Certification(graph.polygon.name, sets, switches, self.witnesses, tuple(shown))

    def _sets(self, kind: str) -> Tally:
        family = next(f for f in self.graph.sets.families if f.kind == kind)
        found = existence(family.functions.cones, kind)
        expected = {
            (*edges, center)
            for edges, center in zip(
                found.functions.edges[found.exist].tolist(),
                found.centers[found.exist].tolist(),
                strict=True,
            )
        }
        listed = [
            (*edges, center)
            for edges, center in zip(
                family.functions.edges.tolist(), family.centers.tolist(), strict=True
            )
        ]
        for key in sorted(expected - set(listed)):
            self.faults.append(f"the {kind} set on edges {_named(key)} is missing")
        for key in sorted(set(listed) - expected):
            self.faults.append(f"there is no {kind} set on edges {_named(key)}")
        if len(listed) != len(set(listed)):
            self.faults.append(f"a {kind} set is listed twice")
        inside = family.functions.contain(family.witnesses)
        for row in np.flatnonzero(~inside).tolist():
            if _has_a_double(family.functions, row):
                where = f"the {kind} set on edges {_named(listed[row])}"
                self.faults.append(f"the witness of {where} is outside")
        self.witnesses += Tally(len(inside), int(inside.sum()))
        self._margins(family, listed)
        decided = len(found.exist)
        return Tally(decided, int(found.exist.sum()), int(found.exactly.sum()))

    def _margins(self, family: Family, listed: list[tuple[int, ...]]) -> None:
        functions = family.functions
        margins = certain_margins(functions, *best_pieces(functions))
        # those of a graph decided by programs are as good as the solver
        slack = 0.0 if self.graph.options.presolve else GAP * functions.cones.size
        wrong = np.abs(family.margins - margins) > ACCURATE * np.abs(margins) + slack
        for row in np.flatnonzero(wrong).tolist():
            self.faults.append(
                f"the margin of the {family.kind} set on edges {_named(listed[row])} is "
                f"{margins[row]:.9g}, not {family.margins[row]:.9g}"
            )

    def _switches(self) -> dict[int, Tally]:
        tallies: dict[int, Tally] = {}
        rule, parts = contact_rule_of(self.graph), []
        for stack, first, second, i, j in rule.questions():
            found = rule.decide(stack, stack, first, second)
            held, yes = stack.held, np.flatnonzero(found.exist)
            tally = Tally(len(i), len(yes), int(found.exactly.sum()))
            tallies[held] = tallies.get(held, Tally()) + tally
            exactly = np.flatnonzero(found.exactly)
            self.within_rounding |= set(zip(i[exactly].tolist(), j[exactly].tolist(), strict=True))
            parts.append(_keys(len(self.graph), i[yes], j[yes], held))
        expected = _largest(np.concatenate([np.zeros((0, 2), dtype=np.int64), *parts]))
        listed = []
        for pairs in self.graph.switches.pairs():
            listed.append(_keys(len(self.graph), pairs.first, pairs.second, pairs.held))
            self._switch_witnesses(pairs)
        stored = _largest(np.concatenate([np.zeros((0, 2), dtype=np.int64), *listed]))
        self._compare_switches(expected, stored)
        return tallies

    def _compare_switches(self, expected: IntArray, stored: IntArray) -> None:
        n = len(self.graph)
        there, known = (dict(rows.tolist()) for rows in (stored, expected))
        for key in sorted(known.keys() | there.keys()):
            held, said = known.get(key), there.get(key)
            if held == said:
                continue
            what = f"sets {key // n} and {key % n}"
            if said is None:
                self.faults.append(f"{what} can hold {held} contacts: the switch is missing")
            elif held is None:
                self.faults.append(f"{what} can hold no contacts in common: there is no switch")
            else:
                self.faults.append(f"{what} can hold {held} contacts, not {said}")

    def _switch_witnesses(self, pairs: SwitchPairs) -> None:
        for here, sets in ((0, pairs.first), (1, pairs.second)):
            for source, functions in enumerate(self.graph.sets.sources):
                offset = self.graph.sets.offsets[source]
                rows = np.flatnonzero((sets >= offset) & (sets < offset + len(functions)))
                taken = functions.take(sets[rows] - offset)
                slots = pairs.slots[rows] if here == 0 else self._places(pairs, rows, taken.edges)
                inside = taken.contain(complete(taken, slots, pairs.points[rows]))
                self.witnesses += Tally(len(rows), int(inside.sum()))
                for n in np.flatnonzero(~inside).tolist():
                    pair = int(pairs.first[rows[n]]), int(pairs.second[rows[n]])
                    held = zip(slots[n].tolist(), pairs.points[rows[n]].tolist(), strict=True)
                    fractions = {s: Fraction(p) for s, p in held if s >= 0}
                    # A switch, or what completes it, may be too thin for doubles.
                    if pair in self.within_rounding or complete_exactly(taken, n, fractions):
                        continue
                    what = "sets {} and {}".format(*pair)
                    self.faults.append(f"the witness of the switch between {what} is outside")

    def _places(self, pairs: SwitchPairs, rows: IntArray, edges: IntArray) -> IntArray:
        """Which contacts of the second sets are held: on every edge the first ones."""
        held = np.full((len(rows), 3), -1)
        for source, functions in enumerate(self.graph.sets.sources):
            offset = self.graph.sets.offsets[source]
            first = pairs.first[rows]
            mine = (first >= offset) & (first < offset + len(functions))
            wide = np.pad(functions.edges, ((0, 0), (0, 4 - functions.m)), constant_values=-1)
            wide[:, 3] = -1  # of slot -1
            of_first = wide[first[mine] - offset]
            held[mine] = np.take_along_axis(of_first, pairs.slots[rows[mine]].astype(np.intp), 1)
        return places_of(held, edges)


def _has_a_double(functions: TorqueFunctions, row: int) -> bool:
    """Whether the middle of a set, rounded, is inside: some sets are too thin for doubles."""
    exact = complete_exactly(functions, row, {})
    if exact is None:
        return True
    rounded = np.array([[float(f) for f in exact]])
    return bool(functions.take(np.array([row])).contain(rounded)[0])


def _keys(n: int, i: IntArray, j: IntArray, held: IntArray | int) -> IntArray:
    """Rows (key of a pair of sets, held)."""
    key = i.astype(np.int64) * n + j
    return np.stack((key, np.broadcast_to(held, key.shape)), axis=1)


def _largest(rows: IntArray) -> IntArray:
    """Each key once, with the largest number."""
    rows = rows[np.lexsort((-rows[:, 1], rows[:, 0]))]
    return rows[np.unique(rows[:, 0], return_index=True)[1]]


def _named(key: tuple[int, ...]) -> str:
    edges, center = list(key[:-1]), key[-1]
    return f"{edges}" + (f" with centre {center}" if center >= 0 else "")
