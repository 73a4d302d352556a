"""Every decision behind a switching graph, made once more and compared with what the graph says.

Candidates are taken from all combinations of edges, not from windows of sorted normals; existence
and switches are decided by signs and intervals, in floating point with a bound first and in
integers or rational numbers where that leaves something open.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from regrasp_lp.completion import complete
from regrasp_lp.contact_rule import meet_held
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import BoolArray, Cones, FloatArray, IntArray, spanning
from regrasp_lp.grasp_sets.candidates import common_cone, complete_candidates
from regrasp_lp.grasp_sets.families import parallel_functions
from regrasp_lp.lp import get_solver
from regrasp_lp.shadows import Shadows
from regrasp_lp.switches import SwitchPairs, SwitchRule
from regrasp_lp.switching import Meeting
from regrasp_lp.switching_graph import SwitchingGraph
from regrasp_lp.torque import TorqueFunctions, torque_functions

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
        Witnesses of sets and of switches: whether they are inside.
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
        for what, tally in [*rows, ("witnesses", self.witnesses)]:
            lines.append(
                f"  {what:<18}{tally.decided:>9} decided, {tally.yes:>9} yes, "
                f"{tally.exactly:>6} exactly"
            )
        return "\n".join([*lines, *(f"  fault: {fault}" for fault in self.faults)])


def certify(graph: SwitchingGraph) -> Certification:
    """Make every decision behind a graph once more, exactly, and compare.

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
        If the graph was built with another rule or a margin.

    Examples
    --------
    >>> from regrasp_lp import Polygon, build_switching_graph
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)], name="square")
    >>> report = certify(build_switching_graph(square, friction=0.5))
    >>> report.ok, report.sets["three_finger"].yes
    (True, 8)
    """
    check_provable(graph.options.switching, graph.options.min_margin)
    return _Comparison(graph).report()


def check_provable(switching: str, min_margin: float) -> None:
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


class Existence(NamedTuple):
    """Whether candidates of one kind have grasps.

    Parameters
    ----------
    functions : TorqueFunctions
    centers : numpy.ndarray of int, shape (N,)
    no_start, no_end : numpy.ndarray of bool, shape (N,)
        Whether no function is negative with all contacts at 0, none positive with all at 1.
    exactly : numpy.ndarray of bool, shape (N,)
        Whether integers were needed.
    """

    functions: TorqueFunctions
    centers: IntArray
    no_start: BoolArray
    no_end: BoolArray
    exactly: BoolArray

    @property
    def exist(self) -> BoolArray:
        """Whether neither keeps the set from existing."""
        return ~(self.no_start | self.no_end)


def existence(cones: Cones, kind: str) -> Existence:
    """Decide the existence of every candidate of one kind, from all combinations of edges.

    Parameters
    ----------
    cones : Cones
    kind : str

    Returns
    -------
    Existence
    """
    edges, centers = _every_candidate(cones, kind)
    if kind == "parallel":
        functions = parallel_functions(cones, edges, centers)
    else:
        functions = torque_functions(cones, edges)
    low, high = np.zeros(edges.shape), np.ones(edges.shape)
    exactly = _is_open(functions, low, -1) | _is_open(functions, high, 1)
    return Existence(
        functions,
        centers,
        ~functions.any_negative(low),
        ~functions.any_positive(high),
        exactly,
    )


def _is_open(functions: TorqueFunctions, fractions: FloatArray, sign: int) -> BoolArray:
    """Whether floating point leaves open if some function has a sign."""
    value = np.where(functions.valid, sign * functions.values(fractions), -np.inf)
    sure = (value > functions.errors).any(axis=1)
    return np.asarray(~sure & (value >= -functions.errors).any(axis=1))


def _every_candidate(cones: Cones, kind: str) -> tuple[IntArray, IntArray]:
    """Edges and centres of all candidates of one kind, in the order of the graph's sets."""
    n = cones.n_edges
    if kind == "three_finger":
        edges = complete_candidates(cones, 3)
    elif kind == "two_finger":
        pairs = np.stack(np.triu_indices(n, 1), axis=1)
        edges = pairs[spanning(cones, pairs)]
    elif kind == "concurrent":
        edges = np.concatenate([t[_concurrent(cones, t)] for t in _triples(n)])
    else:
        found = [_parallel(cones, t) for t in _triples(n)]
        rows = np.concatenate(found)
        return rows[:, :3], rows[:, 3]
    return edges, np.full(len(edges), -1)


def _triples(n: int) -> Iterator[IntArray]:
    """All triples of different edges, in chunks."""
    first, second = np.triu_indices(n, 1)
    step = max(1, _CHUNK // n)
    for start in range(0, len(first), step):
        a, b = first[start : start + step, None], second[start : start + step, None]
        c = np.arange(n)[None, :]
        one, other, third = np.broadcast_arrays(a, b, c)
        yield np.stack((one, other, third), axis=-1)[third > other]


def _concurrent(cones: Cones, triples: IntArray) -> BoolArray:
    """Whether in one cyclic order all rays of each edge are ahead of all of the one before."""
    result = np.zeros(len(triples), dtype=bool)
    for order in ((0, 1, 2), (0, 2, 1)):
        ahead = np.ones(len(triples), dtype=bool)
        for i in range(3):
            one, other = triples[:, order[i]], triples[:, order[(i + 1) % 3]]
            for side in (0, 1):
                for other_side in (0, 1):
                    ahead &= cones.cross_sign[2 * one + side, 2 * other + other_side] > 0
        result |= ahead
    return result


def _parallel(cones: Cones, triples: IntArray) -> IntArray:
    """Rows (a, b, c, centre) of the triples and centres whose common cone has an interior."""
    rows = []
    for i in range(3):
        order = [i, *(k for k in range(3) if k != i)]
        kept = triples[common_cone(cones, triples[:, order]).exists]
        rows.append(np.column_stack((kept, kept[:, i])))
    every = np.concatenate(rows)
    return every[np.lexsort(every.T[::-1])]


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
        for key in [listed[i] for i in np.flatnonzero(~inside)]:
            self.faults.append(f"the witness of the {kind} set on edges {_named(key)} is outside")
        self.witnesses += Tally(len(inside), int(inside.sum()))
        decided = len(found.exist)
        return Tally(decided, int(found.exist.sum()), int(found.exactly.sum()))

    def _switches(self) -> dict[int, Tally]:
        tallies: dict[int, Tally] = {}
        rule, parts = contact_rule_of(self.graph), []
        for stack, first, second, i, j in rule.questions():
            found = rule.decide(stack, stack, first, second)
            held, yes = stack.held, np.flatnonzero(found.exist)
            tally = Tally(len(i), len(yes), int(found.exactly.sum()))
            tallies[held] = tallies.get(held, Tally()) + tally
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
                for row in rows[~inside].tolist():
                    what = f"sets {pairs.first[row]} and {pairs.second[row]}"
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


def places_of(held: IntArray, edges: IntArray) -> IntArray:
    """Return which contacts of sets are held, on every edge the first ones; -1 for none.

    Parameters
    ----------
    held : numpy.ndarray of int, shape (N, h)
        Edges of held contacts, ascending; -1 for none.
    edges : numpy.ndarray of int, shape (N, m)
        Edges of the contacts of the sets.

    Returns
    -------
    numpy.ndarray of int, shape (N, h)

    Examples
    --------
    >>> places_of(np.array([[3, 3, -1], [3, 5, -1]]), np.array([[3, 3, 5], [3, 3, 5]])).tolist()
    [[0, 1, -1], [0, 2, -1]]
    """
    places = np.full(held.shape, -1)
    for column in range(held.shape[1]):
        edge = held[:, column]
        again = (held[:, :column] == edge[:, None]).sum(axis=1)
        first = (edges == edge[:, None]).argmax(axis=1)
        places[:, column] = np.where(edge >= 0, first + again, -1)
    return places


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
