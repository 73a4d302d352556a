"""Check certificates of switching graphs: a script that runs alone.

``python regrasp_lp/check_certificates.py FILE [FILE ...]`` accepts or rejects files of the format
`regrasp-certificates` (docs/formats.md). It needs Python 3.11 and nothing else, imports nothing of
the package and shares no code with it. All decisions are made in integers or rational numbers.

What an accepted file proves, about a simple polygon with friction on every edge:

* which sets of grasps exist. The checker lists all combinations of edges itself (`candidates`) and
  wants each of them proved to have a grasp, or to have none;
* which pairs of these sets can hold which contacts in common. It lists all pairs and all held
  edges itself (`required`) and wants each of them proved possible, or impossible.

All of it rests on two facts (docs/theory.md, sections 2 and 3). First, contacts whose boundary
rays positively span the plane are in force closure iff some torque function is negative and some
is positive: for the kinds of sets here that is ``min M < 0 < max M``. Secondly, torque functions
are linear and none decreases when a contact moves forward on its edge. So where none is negative
with a contact at fraction 0, none is negative wherever on its edge the contact is, and where none
is positive with it at fraction 1, none is positive: the proofs of *no* need nothing else.

Exit status: 0 if all files are accepted, 1 if one is rejected, 2 if one cannot be read.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import json
import math
import re
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import chain, combinations, combinations_with_replacement, pairwise, permutations
from operator import mul
from pathlib import Path
from typing import Any, NoReturn, TypeVar

__all__ = ["Rejected", "Report", "check", "main"]

Vector = tuple[int, int]
Edges = tuple[int, ...]
Key = tuple[str, Edges, int | None]
"""A candidate: kind, edges, centre edge or None."""
Function = tuple[int, ...]
"""``(M_0, s_1, ..., s_m)``: the torque ``M_0 + s_1 f_1 + ... + s_m f_m`` at fractions f."""
Switch = tuple[int, int, Edges]
"""Sets I < J and the edges of the contacts that they hold."""
Shadow = tuple[list[Function], list[Function]]
"""Functions of the held contacts, see `shadow`."""
Tell = Callable[[int, int], None]

T = TypeVar("T")

KINDS = {
    "complete": ("two_finger", "three_finger"),
    "chapter": ("two_finger", "concurrent", "parallel"),
}


class Rejected(ValueError):
    """A file that proves less than it should, or is none of the format; the text says where."""


@dataclass(frozen=True)
class Report:
    """What an accepted file is about.

    Attributes
    ----------
    name : str
        Of the polygon.
    edges : int
        Number of edges of the polygon.
    friction : tuple of float
        The least and the largest μ.
    fingers : int
        Of the hand.
    sets : {"complete", "chapter"}
    kinds : dict of str to tuple of int
        Number of sets and number of candidates of each kind.
    yes, no : int
        Number of records: ways to switch that are possible, and that are not.
    switches : int
        Number of pairs of sets with at least one *yes*.
    seconds : float
        How long the check took.
    """

    name: str
    edges: int
    friction: tuple[float, float]
    fingers: int
    sets: str
    kinds: dict[str, tuple[int, int]]
    yes: int
    no: int
    switches: int
    seconds: float = field(compare=False)

    def __str__(self) -> str:
        low, high = self.friction
        friction = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        kinds = ", ".join(f"{kind} {n} of {every}" for kind, (n, every) in self.kinds.items())
        return (
            f"accepted: {_shown(self.name)}, {self.edges} edges, friction {friction}, "
            f"{self.fingers} fingers, {self.sets} sets\n"
            f"  sets of candidates: {kinds}\n"
            f"  pairs decided: {self.yes} yes, {self.no} no; {self.switches} switches that hold "
            f"something (what need not is not proved); {self.seconds:.2f} s"
        )


# --- values ---------------------------------------------------------------------------------------


def demand(condition: bool, message: str) -> None:
    """Reject the file unless a condition holds."""
    if not condition:
        raise Rejected(message)


def _refuse(constant: str) -> NoReturn:
    raise Rejected(f"{constant} is no number")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    demand(len(found) == len(pairs), "a key occurs twice")
    return found


_DECODER = json.JSONDecoder(parse_constant=_refuse, object_pairs_hook=_unique)
_RATIO = re.compile(r"(-?[0-9]+)/([0-9]+)")


def json_value(line: bytes) -> Any:
    """Read a line; JSON alone, so neither NaN nor a key twice."""
    try:
        return _DECODER.decode(line.decode("utf-8"))
    except Rejected:
        raise
    except ValueError as error:  # not UTF-8, not JSON, an integer of thousands of digits
        raise Rejected(f"no JSON value in UTF-8: {error}") from None


def double(value: object, what: str) -> float:
    """Read a JSON number, which is a finite double; `true` is none, and a string is none."""
    # the type itself, since bool is a subclass of int
    if type(value) not in (int, float):
        raise Rejected(f"{what} is {_shown(value)}, no number")
    try:
        number = float(value)  # type: ignore[arg-type]
    except OverflowError:
        number = math.inf
    demand(math.isfinite(number), f"{what} is beyond the range of a double")
    return number


def fraction(value: object, what: str) -> Fraction:
    """Read a fraction in [0, 1]: a JSON number, or the string "p/q" for any rational number."""
    if isinstance(value, str):
        match = _RATIO.fullmatch(value)
        try:
            number = Fraction(int(match[1]), int(match[2])) if match else Fraction(-1)
        except (ValueError, ZeroDivisionError):  # more digits than Python converts; q = 0
            number = Fraction(-1)
    else:
        number = Fraction(double(value, what))
    # numerators and denominators: comparing Fractions takes longer
    if not 0 <= number.numerator <= number.denominator:
        raise Rejected(f'{what} is {_shown(value)}, no number or "p/q" in [0, 1]')
    return number


def fractions(values: object, count: int, what: str) -> tuple[Fraction, ...]:
    """Read the fractions of the contacts of one grasp."""
    if not isinstance(values, list) or len(values) != count:
        raise Rejected(f"{what} is {_shown(values)}, no list of {count} fractions")
    return tuple(fraction(value, what) for value in values)


def integer(value: object, what: str) -> int:
    """Read an integer, written as one."""
    if type(value) is not int:
        raise Rejected(f"{what} is {_shown(value)}, no integer")
    return value


def edge_list(value: object, what: str) -> Edges:
    """Read numbers of edges; whether they fit is decided by those who ask for them."""
    if not isinstance(value, list):
        raise Rejected(f"{what} is {_shown(value)}, no list of edges")
    return tuple(integer(edge, f"an edge of {what}") for edge in value)


def _shown(value: object, most: int = 72) -> str:
    """A value (or bytes of the file) as messages show it: printable ASCII, and not too long."""
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else repr(value)
    text = "".join(c if " " <= c <= "~" else ascii(c)[1:-1] for c in text[: most + 1])
    return text if len(text) <= most else f"{text[: most - 3]}..."


# --- the object -----------------------------------------------------------------------------------


def cross(u: Vector, v: Vector) -> int:
    """Return the planar cross product, positive if v is to the left of u."""
    return u[0] * v[1] - u[1] * v[0]


def turn(a: Vector, b: Vector, c: Vector) -> int:
    """Return twice the signed area of a triangle: positive if c is left of the line ab."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


class Body:
    """The polygon, its friction cones and the hand, in integers.

    All coordinates are multiplied by one power of two that makes integers of them, and the rays of
    an edge with μ = p/q are ``q N + p T`` (number 2e) and ``q N - p T`` (number 2e + 1), for the
    edge e along T with the inward normal N. Positive factors change the sign of no torque.
    """

    def __init__(self, value: object) -> None:
        keys = {"name", "exterior", "holes", "friction", "fingers", "sets"}
        if not isinstance(value, dict) or value.keys() != keys:
            raise Rejected(f"the object should have the keys {', '.join(sorted(keys))}")
        self.name, self.sets, holes = value["name"], value["sets"], value["holes"]
        demand(isinstance(self.name, str), "the name is no string")
        demand(
            isinstance(self.sets, str) and self.sets in KINDS,
            f'sets is {_shown(self.sets)}, neither "complete" nor "chapter"',
        )
        self.fingers = integer(value["fingers"], "fingers")
        demand(self.fingers >= 2, f"a hand of {self.fingers} fingers grasps nothing")
        demand(isinstance(holes, list), f"holes is {_shown(holes)}, no list of rings")
        points = [_points(value["exterior"], "the outline")]
        points += [_points(ring, f"hole {r}") for r, ring in enumerate(holes)]
        # denominators of doubles are powers of two, so the largest is a multiple of all
        unit = max(c.denominator for ring in points for point in ring for c in point)
        rings = [[(int(x * unit), int(y * unit)) for x, y in ring] for ring in points]
        edges = check_rings(rings)
        self.n = len(edges)
        self.starts = [a for a, _ in edges]
        self.tangents = [(b[0] - a[0], b[1] - a[1]) for a, b in edges]
        self.friction = _frictions(value["friction"], self.n)
        self.rays: list[Vector] = []
        for (x, y), number in zip(self.tangents, self.friction, strict=True):
            p, q = number.as_integer_ratio()
            self.rays += [(-q * y + p * x, q * x + p * y), (-q * y - p * x, q * x - p * y)]
        self.cross = [[cross(d, e) for e in self.rays] for d in self.rays]
        # sets of rays as the bits of an integer: those to the left of a ray, and to the right
        self.left = [sum(1 << s for s, c in enumerate(row) if c > 0) for row in self.cross]
        self.right = [sum(1 << s for s, c in enumerate(row) if c < 0) for row in self.cross]


def _points(ring: object, where: str) -> list[tuple[Fraction, Fraction]]:
    if not isinstance(ring, list) or len(ring) < 3:
        raise Rejected(f"{where} is {_shown(ring)}, no list of at least 3 points")
    found = []
    for point in ring:
        if not isinstance(point, list) or len(point) != 2:
            raise Rejected(f"a point of {where} is {_shown(point)}, no list [x, y]")
        x, y = (Fraction(double(c, f"a coordinate of {where}")) for c in point)
        found.append((x, y))
    return found


def _frictions(values: object, n: int) -> list[float]:
    if not isinstance(values, list) or len(values) != n:
        raise Rejected(f"friction is {_shown(values)}, no list of {n} numbers, one for each edge")
    found = [double(value, "a friction") for value in values]
    demand(min(found) > 0, f"a friction is {min(found):g}; the theory needs μ > 0")
    return found


def check_rings(rings: Sequence[Sequence[Vector]]) -> list[tuple[Vector, Vector]]:
    """Check that an outline and holes bound a simple polygon, and return its edges.

    That a set is *one* vertex of the graph rests on it: on crossing edges a set could fall apart.
    The decisions in the file would be right without.
    """
    edges: list[tuple[Vector, Vector]] = []
    after: list[int] = []  # the next edge of the ring
    for r, ring in enumerate(rings):
        after += [*range(len(edges) + 1, len(edges) + len(ring)), len(edges)]
        edges += zip(ring, [*ring[1:], ring[0]], strict=True)
        area = sum(cross(a, b) for a, b in edges[-len(ring) :])
        demand(area > 0 if r == 0 else area < 0, f"ring {r} has no area or turns the wrong way")
    for e, (a, b) in enumerate(edges):
        demand(a != b, f"edge {e} has no length")
        # an edge and the next one have more than a vertex in common iff the path turns back
        c = edges[after[e]][1]
        back = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0
        demand(not back or turn(a, b, c) != 0, f"edge {after[e]} folds back onto edge {e}")
    for e, f in combinations(range(len(edges)), 2):
        if after[e] != f and after[f] != e and meet(*edges[e], *edges[f]):
            raise Rejected(f"edges {e} and {f} meet")
    for r, ring in enumerate(rings[1:], start=1):
        # no edges meet, so one point of a hole decides for the whole hole
        for s, other in enumerate(rings):
            if s != r and inside(ring[0], other) != (s == 0):
                raise Rejected(f"hole {r - 1} is not inside the outline, or inside another hole")
    return edges


def meet(a: Vector, b: Vector, c: Vector, d: Vector) -> bool:
    """Whether the closed segments ab and cd have a common point.

    They do iff their bounding boxes meet and neither has both its ends strictly on one side of
    the other's line. (On one line the boxes decide. Otherwise the lines cross in a point, which
    the second condition puts on both segments.)
    """
    for axis in (0, 1):
        low, high = sorted((a[axis], b[axis]))
        if max(c[axis], d[axis]) < low or min(c[axis], d[axis]) > high:
            return False
    return turn(a, b, c) * turn(a, b, d) <= 0 and turn(c, d, a) * turn(c, d, b) <= 0


def inside(p: Vector, ring: Sequence[Vector]) -> bool:
    """Whether a point off a ring is inside: a ray to its right crosses an odd number of edges."""
    odd = False
    for a, b in pairwise([*ring, ring[0]]):
        upward = b[1] > a[1]
        if (a[1] > p[1]) != (b[1] > p[1]) and (turn(a, b, p) > 0) == upward:
            odd = not odd
    return odd


# --- candidates -----------------------------------------------------------------------------------


def candidates(body: Body) -> Iterator[Key]:
    """Yield every combination of edges that the file has to decide."""
    every = range(body.n)
    for pair in combinations(every, 2):
        if spans(body, pair):
            yield "two_finger", pair, None
    if body.sets == "complete":
        for triple in combinations_with_replacement(every, 3):
            if spans(body, triple):
                yield "three_finger", triple, None
        return
    after = [{b for b in every if turns_left(body, a, b)} for a in every]
    for a, b, c in combinations(every, 3):
        one, other = b in after[a] and c in after[b], c in after[a] and b in after[c]
        if (one and a in after[c]) or (other and a in after[b]):
            yield "concurrent", (a, b, c), None
    for o in every:
        # the common cone of three edges is part of that of the centre and each other one
        near = [s for s in every if s != o and common_cone(body, o, (s,))]
        for s, t in combinations(near, 2):
            if common_cone(body, o, (s, t)):
                a, b, c = sorted((o, s, t))
                yield "parallel", (a, b, c), o


def spans(body: Body, edges: Iterable[int]) -> bool:
    """Whether the boundary rays of edges positively span the plane.

    They do iff every ray has rays strictly on both of its sides. *If not* spanning, some y ≠ 0 has
    ``y · e >= 0`` for all rays e. Rays of one edge are independent, so these y form a pointed cone,
    and on a boundary of it y is orthogonal to a ray: ``y = ± rot90(e_j)`` up to a factor. As
    ``rot90(e_j) · e_k = e_j × e_k``, no ray is strictly to the right (or left) of ray j.
    Conversely such a ray j gives such a y. A ray exactly opposite to j is on neither side, as it
    should be: two opposite rays and others on one side only do not span.
    """
    rays = [r for e in edges for r in (2 * e, 2 * e + 1)]
    mask = 0
    for r in rays:
        mask |= 1 << r
    return all(body.left[r] & mask and body.right[r] & mask for r in rays)


def turns_left(body: Body, a: int, b: int) -> bool:
    """Whether every boundary ray of edge a and every one of edge b have a positive product."""
    both = 3 << 2 * b
    return body.left[2 * a] & body.left[2 * a + 1] & both == both


def common_cone(body: Body, centre: int, others: Iterable[int]) -> tuple[Vector, Vector] | None:
    """Boundary directions of ``-C_o ∩ C_s ∩ ...``, None if it has no interior.

    ``N - μ T`` is to the left of ``N + μ T`` (their product is ``2 μ T × N > 0``), so the cone
    from ray 2e to ray 2e + 1 consists of the v with ``e_2e × v >= 0`` and ``v × e_2e+1 >= 0``, and
    it is less than a half-plane. Boundary directions of an intersection of such cones are among
    the boundaries of the cones: those that lie in all cones. There is an interior iff two of these
    are not parallel.
    """
    (x, y), (z, w) = body.rays[2 * centre], body.rays[2 * centre + 1]
    cones = [((-x, -y), (-z, -w)), *((body.rays[2 * e], body.rays[2 * e + 1]) for e in others)]
    within = [
        d
        for d in chain.from_iterable(cones)
        if all(cross(low, d) >= 0 and cross(d, high) >= 0 for low, high in cones)
    ]
    if not within:
        return None
    first = next(d for d in within if all(cross(d, e) >= 0 for e in within))
    last = next(d for d in within if all(cross(e, d) >= 0 for e in within))
    return (first, last) if cross(first, last) > 0 else None


# --- torque functions -----------------------------------------------------------------------------


def torque_functions(body: Body, key: Key) -> list[Function]:
    """Return the torque functions of a candidate, each of them once.

    Each is the torque ``Σ p_i × F_i`` of forces F that are balanced (or opposite), at contacts
    ``p_i = a_i + f_i T_i``. No slope ``T_i × F_i`` is negative, as ``F_i`` is in the cone of i.
    """
    _, edges, centre = key
    found: dict[Function, None] = {}
    for forces in circuits(body, edges) if centre is None else centred(body, edges, centre):
        values = [0] * (len(edges) + 1)
        for i, force in forces:
            values[0] += cross(body.starts[edges[i]], force)
            values[1 + i] += cross(body.tangents[edges[i]], force)
        found[tuple(values)] = None
    return list(found)


def circuits(body: Body, edges: Edges) -> Iterator[list[tuple[int, Vector]]]:
    """Yield the minimal balanced forces along boundary rays, and the contacts where they act.

    Two exactly opposite rays balance by their lengths (here the sums of the absolute coordinates,
    which are in the same ratio). Three rays balance with the coefficients
    ``(e_2 × e_3, e_3 × e_1, e_1 × e_2)``; that all are positive, up to one sign, makes it a
    circuit. By Lemma 1 of the theory there are no others.
    """
    rays = [(i, r) for i, e in enumerate(edges) for r in (2 * e, 2 * e + 1)]
    for (i, r), (j, s) in combinations(rays, 2):
        (x, y), (z, w) = body.rays[r], body.rays[s]
        if body.cross[r][s] == 0 and x * z + y * w < 0:
            c, d = abs(z) + abs(w), abs(x) + abs(y)
            yield [(i, (c * x, c * y)), (j, (d * z, d * w))]
    for (i, r), (j, s), (k, t) in combinations(rays, 3):
        products = body.cross[s][t], body.cross[t][r], body.cross[r][s]
        if min(products) > 0 or max(products) < 0:
            forces = []
            for contact, ray, product in zip((i, j, k), (r, s, t), products, strict=True):
                c, (x, y) = abs(product), body.rays[ray]
                forces.append((contact, (c * x, c * y)))
            yield forces


def centred(body: Body, edges: Edges, centre: int) -> Iterator[list[tuple[int, Vector]]]:
    """Yield a force d at another contact and -d at the centre, d on the common cone's boundary."""
    others = [e for e in edges if e != centre]
    for x, y in common_cone(body, centre, others) or ():
        for other in others:
            yield [(edges.index(other), (x, y)), (edges.index(centre), (-x, -y))]


# --- records of sets ------------------------------------------------------------------------------


@dataclass(eq=False)
class GraspSet:
    """A proved set, the line that proves it, and its shadows, kept for the next pair."""

    line: int
    kind: str
    edges: Edges
    functions: list[Function]
    shadows: dict[Edges, Shadow] = field(default_factory=dict)


def read_key(record: Sequence[Any], expected: dict[Key, int]) -> Key:
    """Read KIND, EDGES and CENTER of a record about a candidate that is still undecided."""
    demand(len(record) == 5, "a record about a candidate has 5 entries")
    _, kind, edges, centre, _ = record
    demand(isinstance(kind, str), "KIND is no string")
    key = (kind, edge_list(edges, "EDGES"), None if centre is None else integer(centre, "CENTER"))
    demand(key in expected, "there is no such candidate (or its edges are not ascending)")
    demand(expected[key] == 0, f"decided before, in line {expected[key]}")
    return key


def check_grasp(functions: list[Function], grasp: tuple[Fraction, ...], what: str) -> None:
    """Check that some function is negative and some positive at the fractions of a grasp."""
    unit = math.lcm(*(f.denominator for f in grasp))
    point = (unit, *(f.numerator * (unit // f.denominator) for f in grasp))
    torques = [sum(map(mul, function, point)) for function in functions]
    demand(min(torques) < 0, f"no torque function is negative at {what}")
    demand(max(torques) > 0, f"no torque function is positive at {what}")


def check_empty(functions: list[Function], corner: object) -> None:
    """Check that there is no grasp: no function can be negative, or none can be positive.

    All contacts at fraction 0 is where every function is least, as none decreases; all at 1
    is where every function is largest.
    """
    demand(all(slope >= 0 for f in functions for slope in f[1:]), "a torque function decreases")
    if corner == "start":
        least = min(function[0] for function in functions)
        demand(least >= 0, "a torque function is negative with all contacts at fraction 0")
    elif corner == "end":
        largest = max(sum(function) for function in functions)
        demand(largest <= 0, "a torque function is positive with all contacts at fraction 1")
    else:
        raise Rejected(f'the proof is {_shown(corner)}, neither "start" nor "end"')


# --- records of switches --------------------------------------------------------------------------


def held_slots(edges: Edges, held: Edges) -> Edges | None:
    """Return which contacts of a set are held: the first ones on each edge; None if not part."""
    found, start = [], 0
    for edge in held:
        if edge not in edges[start:]:
            return None
        found.append(edges.index(edge, start))
        start = found[-1] + 1
    return tuple(found)


def shadow(grasp_set: GraspSet, slots: Edges) -> Shadow:
    """Return a set as seen by its held contacts: functions of their fractions alone.

    The first list has the free contacts at fraction 0, where torques are least: held contacts can
    be completed so that some torque is negative iff one of these functions is. The second list has
    them at 1: some torque can be made positive iff one of these is. A grasp needs both, and the
    proofs of *no* use no more than that.
    """
    if slots not in grasp_set.shadows:
        low: dict[Function, None] = {}
        high: dict[Function, None] = {}
        for function in grasp_set.functions:
            slopes = tuple(function[1 + s] for s in slots)
            low[function[0], *slopes] = None
            high[sum(function) - sum(slopes), *slopes] = None
        grasp_set.shadows[slots] = list(low), list(high)
    return grasp_set.shadows[slots]


def read_switch(
    record: Sequence[Any], sets: Sequence[GraspSet], fingers: int
) -> tuple[Switch, Edges, Edges]:
    """Read I, J and HELD, and find the held contacts in both sets."""
    i, j = integer(record[1], "I"), integer(record[2], "J")
    demand(0 <= i < j < len(sets), f"should be about two sets I < J of the {len(sets)} sets")
    held = edge_list(record[3], "HELD")
    one, other = sets[i].edges, sets[j].edges
    slots = held_slots(one, held), held_slots(other, held)
    if slots[0] is None or slots[1] is None:
        raise Rejected(f"HELD is not, in ascending order, part of both {one} and {other}")
    needed = max(1, len(one) + len(other) - fingers)
    demand(len(held) >= needed, f"the sets have to hold at least {needed} contacts")
    return (i, j, held), slots[0], slots[1]


def check_yes(
    record: Sequence[Any], sets: tuple[GraspSet, GraspSet], slots: tuple[Edges, Edges]
) -> None:
    """Check two grasps that have the held contacts in common."""
    demand(len(record) == 6, "a yes has 6 entries")
    grasps = []
    for name, grasp_set, values in zip("IJ", sets, record[4:], strict=True):
        grasp = fractions(values, len(grasp_set.edges), f"FRACTIONS_{name}")
        check_grasp(grasp_set.functions, grasp, f"FRACTIONS_{name}")
        grasps.append(grasp)
    for a, b in zip(*slots, strict=True):
        if grasps[0][a] != grasps[1][b]:
            raise Rejected(f"the fractions of the contact held on edge {sets[0].edges[a]} differ")


def check_no(record: Sequence[Any], shadows: tuple[Shadow, Shadow], h: int) -> None:
    """Check that no contacts on the held edges can be completed to grasps of both sets."""
    demand(len(record) == 5, "a no has 5 entries")
    proof = record[4]
    if h == 3:
        demand(proof is None, "the proof for three held contacts is null")
        demand(not have_common_point(*shadows), "the two sets have grasps in common")
    elif not isinstance(proof, list) or not all(isinstance(entry, list) for entry in proof):
        raise Rejected(f"the proof is {_shown(proof)}, no list of lists")
    elif h == 1:
        demand(len(proof) == 1 == len(proof[0]), "the proof for one held contact is [[WHY]]")
        demand(holds(proof[0][0], shadows, None), "WHY does not hold")
    else:
        check_cover([check_interval(entry, shadows) for entry in proof])


def check_interval(entry: list[Any], shadows: tuple[Shadow, Shadow]) -> tuple[Fraction, Fraction]:
    """Check ``[WHY, LOW, HIGH]`` at both ends, and return these.

    Every WHY describes a convex set of x (see `holds`), so it is true between the ends as well.
    """
    demand(len(entry) == 3, "an entry of the proof is not [WHY, LOW, HIGH]")
    low, high = fraction(entry[1], "LOW"), fraction(entry[2], "HIGH")
    demand(low <= high, "LOW is more than HIGH")
    for x in (low, high):
        if not holds(entry[0], shadows, x):
            raise Rejected(f"{entry[0]} does not hold at {float(x):.9g}")
    return low, high


def check_cover(intervals: list[tuple[Fraction, Fraction]]) -> None:
    """Check that closed intervals cover [0, 1]."""
    reached = Fraction(0)
    for low, high in [*sorted(intervals), (Fraction(1), Fraction(1))]:
        # before the first interval even 0 is uncovered, but then low > 0 or there is none
        if low > reached:
            gap = f"({float(reached):.9g}, {float(low):.9g})"
            raise Rejected(f"the intervals leave {gap} uncovered")
        reached = max(reached, high)


def holds(why: object, shadows: tuple[Shadow, Shadow], x: Fraction | None) -> bool:
    """Whether a reason excludes every y in [0, 1], for the first held contact at x (or only one).

    For given x, let P be the functions of y that remain of the first list of a set's shadow, and
    Q those of the second. None decreases. So a grasp needs ``y < d``, d the largest root of P, and
    ``y > u``, u the least root of Q (with ±∞ for functions that do not depend on y).

    * ``d <= 0``: no P is negative at y = 0.
    * ``u >= 1``: no Q is positive at y = 1.
    * ``d <= u``, of different sets: at some real t no P of the one is negative and no Q of the
      other positive. A y below t has no Q positive, one from t on no P negative.

    In terms of (x, t) these are linear inequalities, joined by *and*: convex sets, and so are
    their projections on x.
    """
    match why:
        case "d0<=0" | "d1<=0":
            lows = on_line(shadows[why == "d1<=0"][0], x)
            return all(value >= 0 for value, _ in lows)
        case "u0>=1" | "u1>=1":
            highs = on_line(shadows[why == "u1>=1"][1], x)
            return all(value + slope <= 0 for value, slope in highs)
        case "d0<=u1" | "d1<=u0":
            one = why == "d1<=u0"
            return separated(on_line(shadows[one][0], x), on_line(shadows[not one][1], x))
    raise Rejected(f"{_shown(why)} is no reason that the format knows")


def on_line(functions: list[Function], x: Fraction | None) -> list[tuple[int, int]]:
    """Value at y = 0 and slope in y, for fixed x = p/q all multiplied by q > 0."""
    if x is None:
        return [(value, slope) for value, slope in functions]
    p, q = x.numerator, x.denominator
    return [(value * q + a * p, slope * q) for value, a, slope in functions]


def separated(lows: list[tuple[int, int]], highs: list[tuple[int, int]]) -> bool:
    """Whether some real t has all of `lows` >= 0 and all of `highs` <= 0.

    Roots ``-value / slope`` are compared as fractions of integers with positive denominators.
    """
    after: tuple[int, int] | None = None  # t has to be at or after the largest root of lows
    for value, slope in lows:
        if slope == 0:
            if value < 0:
                return False
        elif after is None or -value * after[1] > after[0] * slope:
            after = -value, slope
    before: tuple[int, int] | None = None  # and at or before the least root of highs
    for value, slope in highs:
        if slope == 0:
            if value > 0:
                return False
        elif before is None or -value * before[1] < before[0] * slope:
            before = -value, slope
    return after is None or before is None or after[0] * before[1] <= before[0] * after[1]


def have_common_point(one: Shadow, other: Shadow) -> bool:
    """Whether two sets on the same contacts have a grasp in common, by elimination.

    They do iff ``M_j < 0 < M_k`` for some functions of the one and ``M_j' < 0 < M_k'`` for some of
    the other, within the box. (With no contact free, both lists of a shadow are the same.)
    """
    m = len(one[0][0]) - 1
    units = [tuple(int(i == axis) for i in range(m)) for axis in range(m)]
    box = {((0, *(-u for u in unit)), False) for unit in units}  # -f <= 0
    box |= {((-1, *unit), False) for unit in units}  # f - 1 <= 0
    for j, k in permutations(one[0], 2):
        for p, q in permutations(other[0], 2):
            rows = {(j, True), (p, True), *((tuple(-v for v in f), True) for f in (k, q))}
            if solvable(box | rows):
                return True
    return False


def solvable(rows: set[tuple[Function, bool]]) -> bool:
    """Whether inequalities ``c + Σ a_i x_i < 0`` (marked True) or ``<= 0`` have a solution.

    Fourier and Motzkin: the last x exists iff each lower bound of it is below each upper bound,
    strictly if one of the two is strict; then it is gone.
    """
    while len(next(iter(rows))[0]) > 1:
        upper = [row for row in rows if row[0][-1] > 0]
        lower = [row for row in rows if row[0][-1] < 0]
        rows = {(row[:-1], strict) for row, strict in rows if row[-1] == 0}
        for up, sharp in upper:
            for down, strict in lower:
                merged = tuple(up[-1] * b - down[-1] * a for a, b in zip(up, down, strict=True))
                rows.add((merged[:-1], sharp or strict))
        if not rows:
            return True
    return all(c < 0 or (c == 0 and not strict) for (c,), strict in rows)


def required(sets: Sequence[GraspSet], fingers: int) -> Iterator[Switch]:
    """Yield every pair of sets I < J with every list of held edges that the file has to decide."""
    groups: dict[Edges, list[int]] = {}
    for i, grasp_set in enumerate(sets):
        edges = grasp_set.edges
        # edges are ascending, so every combination is; equal ones are one list
        for h in range(1, len(edges) + 1):
            for held in dict.fromkeys(combinations(edges, h)):
                groups.setdefault(held, []).append(i)
    for held, members in groups.items():
        for i, j in combinations(members, 2):
            if len(held) >= len(sets[i].edges) + len(sets[j].edges) - fingers:
                yield i, j, held


# --- files ----------------------------------------------------------------------------------------

_FIRST = re.compile(
    rb'\{"format": "regrasp-certificates", "version": 1, "sha256": "([0-9a-f]{64})"\}\n'
)


class Checker:
    """What has been proved so far of one file."""

    def __init__(self, body: Body) -> None:
        self.body = body
        self.candidates = dict.fromkeys(candidates(body), 0)
        """The line that decides each candidate, 0 if none has."""
        self.sets: list[GraspSet] = []
        self.decided: dict[Switch, int] = {}
        """The line that decides each pair of sets and held edges."""
        self.possible: list[Switch] = []
        self.kept: list[tuple[int, bytes]] = []
        """Records that came before the sets which they are about."""

    def read(self, number: int, line: bytes, last: bool = False) -> None:
        """Check one record; if `last`, there will be no more sets."""
        record = json_value(line)
        if not isinstance(record, list) or not record or not isinstance(record[0], str):
            raise Rejected("no record, a list that begins with a word")
        word = record[0]
        if word in ("set", "empty"):
            self._candidate(number, record)
        elif word in ("yes", "no"):
            demand(len(record) > 4, "a yes has 6 entries, a no has 5")
            if not last and integer(record[2], "J") >= len(self.sets):
                self.kept.append((number, line))
            else:
                self._switch(number, record)
        else:
            raise Rejected("a record begins with set, empty, yes or no")

    def _candidate(self, number: int, record: list[Any]) -> None:
        key = read_key(record, self.candidates)
        functions = torque_functions(self.body, key)
        if record[0] == "set":
            grasp = fractions(record[4], len(key[1]), "FRACTIONS")
            check_grasp(functions, grasp, "FRACTIONS")
            self.sets.append(GraspSet(number, key[0], key[1], functions))
        else:
            check_empty(functions, record[4])
        self.candidates[key] = number

    def _switch(self, number: int, record: list[Any]) -> None:
        switch, *slots = read_switch(record, self.sets, self.body.fingers)
        if switch in self.decided:
            raise Rejected(f"decided before, in line {self.decided[switch]}")
        i, j, held = switch
        pair = self.sets[i], self.sets[j]
        if record[0] == "yes":
            check_yes(record, pair, (slots[0], slots[1]))
            self.possible.append(switch)
        else:
            shadows = shadow(pair[0], slots[0]), shadow(pair[1], slots[1])
            check_no(record, shadows, len(held))
        self.decided[switch] = number

    def check_complete(self) -> None:
        """Check that nothing has been left out."""
        for (kind, edges, centre), number in self.candidates.items():
            if not number:
                where = "" if centre is None else f" with centre {centre}"
                raise Rejected(f"nothing is said of the candidate {kind} {list(edges)}{where}")
        for i, j, held in required(self.sets, self.body.fingers):
            if (i, j, held) not in self.decided:
                one, other = self.sets[i], self.sets[j]
                raise Rejected(
                    f"nothing is said of the sets {i} and {j} (lines {one.line} and {other.line}) "
                    f"with contacts held on {list(held)}"
                )

    def report(self, seconds: float) -> Report:
        """Return what has been proved."""
        found = Counter(grasp_set.kind for grasp_set in self.sets)
        every = Counter(kind for kind, _, _ in self.candidates)
        return Report(
            self.body.name,
            self.body.n,
            (min(self.body.friction), max(self.body.friction)),
            self.body.fingers,
            self.body.sets,
            {kind: (found[kind], every[kind]) for kind in KINDS[self.body.sets]},
            len(self.possible),
            len(self.decided) - len(self.possible),
            len({(i, j) for i, j, _ in self.possible}),
            seconds,
        )


def check(path: str | Path, tell: Tell | None = None) -> Report:
    """Check a file of certificates.

    Parameters
    ----------
    path : str or Path
    tell : callable, optional
        Is told now and then how many lines of how many are done.

    Returns
    -------
    Report

    Raises
    ------
    Rejected
        If anything in the file is wrong or missing.
    OSError
        If the file cannot be read.
    """
    began = time.perf_counter()
    data = Path(path).read_bytes()
    first = _FIRST.match(data)
    if first is None:
        raise Rejected("line 1: should be exactly as in docs/formats.md, in version 1")
    found = hashlib.sha256(memoryview(data)[first.end() :]).hexdigest()
    if found != first[1].decode():
        raise Rejected(f"line 1: the SHA-256 of the other lines is {found}: the file was changed")
    lines = enumerate(io.BytesIO(data), start=1)
    next(lines)
    number, line = next(lines, (2, b""))
    checker = located(number, line, lambda: Checker(Body(json_value(line))))
    total = data.count(b"\n")
    for number, line in lines:
        located(number, line, lambda: checker.read(number, line))  # noqa: B023  called at once
        if tell is not None and number % 1000 == 0:
            tell(number, total)
    for number, line in checker.kept:
        located(number, line, lambda: checker.read(number, line, last=True))  # noqa: B023
    checker.check_complete()
    return checker.report(time.perf_counter() - began)


def located(number: int, line: bytes, step: Callable[[], T]) -> T:
    """Do a step; if it rejects the line that it is about, say which line that is."""
    try:
        return step()
    except Rejected as fault:
        raise Rejected(f"line {number}: {_shown(line.strip())}: {fault}") from None
    except RecursionError:
        raise Rejected(f"line {number}: {_shown(line.strip())}: nested too deeply") from None


def is_certificates(path: str | Path) -> bool:
    """Whether a file begins as one of certificates does, right or wrong."""
    with Path(path).open("rb") as file:
        return b"regrasp-certificates" in file.read(100).partition(b"\n")[0]


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the files named on the command line; print a verdict on each.

    Parameters
    ----------
    arguments : sequence of str, optional
        In place of those of the command line.

    Returns
    -------
    int
        0 if all files are accepted, 1 if one is rejected, else 2: one cannot be read.
    """
    parser = argparse.ArgumentParser(description="Check certificates of switching graphs.")
    parser.add_argument("files", nargs="+", metavar="FILE", help="format regrasp-certificates")
    parser.add_argument("--quiet", action="store_true", help="print rejections only")
    given = parser.parse_args(arguments)
    verdicts = {_verdict(file, given.quiet) for file in given.files}
    return 1 if 1 in verdicts else max(verdicts)


def _verdict(file: str, quiet: bool) -> int:
    """Check one file and print what came of it."""
    name = _shown(file.encode("utf-8", "replace"), 4096)

    def tell(done: int, total: int) -> None:
        print(f"\r{name}: line {done} of {total}", end="\r", file=sys.stderr, flush=True)

    try:
        report = check(file, tell if sys.stderr.isatty() and not quiet else None)
    except Rejected as fault:
        print(f"{name}: rejected: {fault}")
        return 1
    except OSError as error:
        print(f"{name}: cannot be read: {error.strerror}", file=sys.stderr)
        return 2
    if not quiet:
        print(f"{name}: {report}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
