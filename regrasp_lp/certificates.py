"""The proof of every decision behind a switching graph, as a file (``docs/formats.md``).

A set is proved by a grasp in it, its absence by a corner of the box; a switch by two grasps, its
absence by bad intervals that cover an edge. Numbers are doubles, read as the rationals they are,
where these do, and fractions of integers where they do not.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import repeat
from pathlib import Path

import numpy as np

from regrasp_lp.certification import certify, contact_rule_of
from regrasp_lp.completion import complete, complete_exactly
from regrasp_lp.contact_rule import joined_optima
from regrasp_lp.errors import SolverError
from regrasp_lp.existence import existence
from regrasp_lp.files import write_atomically
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.shadows import Shadows
from regrasp_lp.switching import (
    REASONS,
    bad_intervals,
    certain_reasons,
    exact_bad_intervals,
    exact_one_held,
    exact_one_held_reason,
    exact_two_held,
)
from regrasp_lp.switching_graph import SwitchingGraph
from regrasp_lp.torque import TorqueFunctions

FORMAT, VERSION = "regrasp-certificates", 1

Record = list[object]
Number = float | str
Bad = tuple[str, Fraction, Fraction]
"""A bad interval: why, from where, to where."""


def save_certificates(graph: SwitchingGraph, path: str | Path) -> None:
    """Write the proof of every decision behind a graph to one file, whole or not at all.

    Parameters
    ----------
    graph : SwitchingGraph
        Under the contact rule, with ``min_margin=0``.
    path : path-like

    Raises
    ------
    OptionError
        If the graph was built with another rule or a margin.
    SolverError
        If the graph says what is not so: there is no proof of that (`certify` lists it).

    Examples
    --------
    >>> import tempfile
    >>> import regrasp_lp as rl
    >>> from regrasp_lp.check_certificates import check
    >>> block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])
    >>> graph = rl.build_switching_graph(block, friction=0.4)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_certificates(graph, f"{folder}/block.proof")
    ...     report = check(f"{folder}/block.proof")
    >>> report.kinds, report.yes, report.no
    ({'two_finger': (2, 2), 'three_finger': (8, 8)}, 44, 0)
    """
    report = certify(graph)
    if not report.ok:
        raise SolverError(
            f"{graph.polygon.name}: nothing is written, for the graph is not right in all it says "
            f"({report.faults[0]}): see certify(graph), and build it again"
        )
    lines = [json.dumps(_header(graph)), *map(_line, _records(graph))]
    body = "".join(line + "\n" for line in lines).encode()
    first = {"format": FORMAT, "version": VERSION, "sha256": hashlib.sha256(body).hexdigest()}
    write_atomically(path, json.dumps(first).encode() + b"\n" + body)


def _header(graph: SwitchingGraph) -> dict[str, object]:
    exterior, *holes = [ring.tolist() for ring in graph.polygon.rings]
    return {
        "name": graph.polygon.name,
        "exterior": exterior,
        "holes": holes,
        "friction": graph.friction.tolist(),
        "fingers": graph.hand.fingers,
        "sets": graph.options.sets,
    }


def _line(record: Record) -> str:
    return json.dumps(record, separators=(",", ":"))


def _records(graph: SwitchingGraph) -> Iterator[Record]:
    for family in graph.sets.families:
        yield from _sets(family.kind, graph)
    rule = contact_rule_of(graph)
    for stack, first, second, i, j in rule.questions():
        found = rule.decide(stack, stack, first, second)
        yes, no = np.flatnonzero(found.exist), np.flatnonzero(~found.exist)
        yield from _yes(stack, first[yes], second[yes], i[yes], j[yes], found.points[yes])
        yield from _no(stack, first[no], second[no], i[no], j[no])


def _sets(kind: str, graph: SwitchingGraph) -> Iterator[Record]:
    family = next(f for f in graph.sets.families if f.kind == kind)
    functions = family.functions
    grasps = _grasps(functions, family.witnesses, [{} for _ in range(len(functions))])
    named = zip(functions.edges.tolist(), family.centers.tolist(), grasps, strict=True)
    for edges, center, grasp in named:
        yield ["set", kind, edges, _center(center), grasp]
    found = existence(functions.cones, kind)
    for row in np.flatnonzero(~found.exist).tolist():
        why = "start" if found.no_start[row] else "end"
        edges = found.functions.edges[row].tolist()
        yield ["empty", kind, edges, _center(found.centers[row]), why]


def _center(center: int) -> int | None:
    return int(center) if center >= 0 else None


def _grasps(
    functions: TorqueFunctions, grasps: FloatArray, held: Sequence[Mapping[int, Fraction]]
) -> list[list[Number]]:
    """Grasps as numbers: those that are not inside are found anew from what is held, exactly."""
    result: list[list[Number]] = grasps.tolist()
    for row in np.flatnonzero(~functions.contain(grasps)).tolist():
        exact = complete_exactly(functions, row, held[row])
        if exact is None:
            raise AssertionError(f"no grasp on edges {functions.edges[row]} where there is one")
        result[row] = [_number(f) for f in exact]
    return result


def _number(value: Fraction) -> Number:
    """A double where it is one, or else "p/q"."""
    return float(value) if Fraction(float(value)) == value else f"{value}"


def _yes(
    stack: Shadows,
    first: IntArray,
    second: IntArray,
    i: IntArray,
    j: IntArray,
    points: FloatArray,
) -> Iterator[Record]:
    exact = _exact_points(stack, first, second, points)
    held = stack.edges[first].tolist()
    both = [_completions(stack, index, points, exact) for index in (first, second)]
    for row in zip(i.tolist(), j.tolist(), held, *both, strict=True):
        yield ["yes", *row]


def _exact_points(
    stack: Shadows, first: IntArray, second: IntArray, points: FloatArray
) -> dict[int, tuple[Fraction, ...]]:
    """Held positions in rational numbers of the pairs that do not meet at the doubles found."""
    outside = np.zeros(len(points), dtype=bool)
    for index in (first, second):
        for source, functions in enumerate(stack.sources):
            rows = np.flatnonzero(stack.source[index] == source)
            taken = functions.take(stack.row[index[rows]])
            grasps = complete(taken, stack.slots[index[rows]], points[rows])
            outside[rows] |= ~taken.contain(grasps)
    return {
        n: _meeting_point(stack, int(first[n]), int(second[n]))
        for n in np.flatnonzero(outside).tolist()
    }


def _meeting_point(stack: Shadows, first: int, second: int) -> tuple[Fraction, ...]:
    """A point that two projections have in common, in rational numbers."""
    point: tuple[Fraction, ...] | None = None
    if stack.held == 1:
        point = exact_one_held(stack.exact(first), stack.exact(second))
    elif stack.held == 2:
        point = exact_two_held(stack.exact(first), stack.exact(second))
    else:
        one, other = (stack.take(np.array([n])) for n in (first, second))
        best = max(joined_optima(one, other), key=lambda solution: solution.margin)
        point = best.point
    if point is None:
        raise AssertionError("no point in common where there is one")
    return point


def _completions(
    stack: Shadows, index: IntArray, points: FloatArray, exact: Mapping[int, tuple[Fraction, ...]]
) -> list[list[Number]]:
    """Grasps of the sets of projections with given held positions, as numbers."""
    result: list[list[Number]] = [[] for _ in index]
    for source, functions in enumerate(stack.sources):
        rows = np.flatnonzero(stack.source[index] == source)
        taken = functions.take(stack.row[index[rows]])
        slots = stack.slots[index[rows]]
        grasps = complete(taken, slots, points[rows])
        grasps[[n for n, row in enumerate(rows.tolist()) if row in exact]] = np.nan
        held = [
            dict(zip(s, exact.get(row, map(Fraction, p)), strict=True))
            for row, s, p in zip(rows.tolist(), slots.tolist(), points[rows].tolist(), strict=True)
        ]
        for row, grasp in zip(rows.tolist(), _grasps(taken, grasps, held), strict=True):
            result[row] = grasp
    return result


def _no(
    stack: Shadows, first: IntArray, second: IntArray, i: IntArray, j: IntArray
) -> Iterator[Record]:
    proofs = (_one_held, _two_held, _three_held)[stack.held - 1](stack, first, second)
    held = stack.edges[first].tolist()
    for row in zip(i.tolist(), j.tolist(), held, proofs, strict=True):
        yield ["no", *row]


def _one_held(stack: Shadows, first: IntArray, second: IntArray) -> Iterator[object]:
    reasons = certain_reasons(stack.take(first), stack.take(second))
    for n, certain in enumerate(reasons):
        if certain.any():
            yield [[REASONS[int(certain.argmax())]]]
        else:
            yield [[exact_one_held_reason(stack.exact(int(first[n])), stack.exact(int(second[n])))]]


def _two_held(stack: Shadows, first: IntArray, second: IntArray) -> Iterator[object]:
    both = (stack.take(first), stack.take(second))
    for n, (lower, upper) in enumerate(zip(*bad_intervals(both), strict=True)):
        found = [
            (REASONS[r], Fraction(low), Fraction(high))
            for r, (low, high) in enumerate(zip(lower.tolist(), upper.tolist(), strict=True))
            if low <= high
        ]
        if not _cover(found):
            exact = exact_bad_intervals(stack.exact(int(first[n])), stack.exact(int(second[n])))
            named = zip(REASONS, exact, strict=True)
            found = [(why, *interval) for why, interval in named if interval is not None]
        yield [[why, _number(low), _number(high)] for why, low, high in _needed(found)]


def _three_held(stack: Shadows, first: IntArray, second: IntArray) -> Iterator[object]:
    return repeat(None, len(first))


def _needed(intervals: Sequence[Bad]) -> list[Bad]:
    """A few of the intervals that cover [0, 1], from left to right."""
    reached = Fraction(0)
    chosen: list[Bad] = []
    while reached < 1 or not chosen:
        best = max((b for b in intervals if b[1] <= reached), key=lambda b: b[2])
        if best[2] <= reached and chosen:
            raise AssertionError("the bad intervals do not cover the edge")
        chosen.append(best)
        reached = best[2]
    return chosen


def _cover(intervals: Sequence[Bad]) -> bool:
    reached = Fraction(0)
    for _, low, high in sorted(intervals, key=lambda b: b[1]):
        if low <= reached:
            reached = max(reached, high)
    return reached >= 1 and any(low <= 0 for _, low, _ in intervals)
