"""Certificates of tiny objects, written from docs/formats.md with rational numbers only.

Nothing of the package is used, and nothing of the checker: grasps of a *yes* are found by
elimination (Fourier and Motzkin) with substitution back, the intervals of a *no* by intersecting
half-lines. Slow, and as simple as can be.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import combinations, combinations_with_replacement, permutations, product
from typing import Any

Vector = tuple[Fraction, Fraction]
Function = tuple[Fraction, ...]
Row = tuple[tuple[Fraction, ...], bool]
Key = tuple[str, tuple[int, ...], "int | None"]

WHYS = ("d0<=u1", "d1<=u0", "d0<=0", "d1<=0", "u0>=1", "u1>=1")


def cross(u: Vector, v: Vector) -> Fraction:
    return u[0] * v[1] - u[1] * v[0]


class Object:
    """Edges and rays of an object as the second line of a file describes it."""

    def __init__(self, description: dict[str, Any]) -> None:
        self.description = description
        self.sets: str = description["sets"]
        self.fingers: int = description["fingers"]
        self.a: list[Vector] = []
        self.t: list[Vector] = []
        for ring in [description["exterior"], *description["holes"]]:
            points = [(Fraction(x), Fraction(y)) for x, y in ring]
            for a, b in zip(points, [*points[1:], points[0]], strict=True):
                self.a.append(a)
                self.t.append((b[0] - a[0], b[1] - a[1]))
        self.rays: list[tuple[Vector, Vector]] = []
        for (x, y), value in zip(self.t, description["friction"], strict=True):
            mu = Fraction(value)
            self.rays.append(((-y + mu * x, x + mu * y), (-y - mu * x, x - mu * y)))

    @property
    def n(self) -> int:
        return len(self.a)

    def positively_spans(self, edges: Iterable[int]) -> bool:
        rays = [e for i in edges for e in self.rays[i]]
        for x, y in rays:
            for normal in ((-y, x), (y, -x)):
                if all(normal[0] * e[0] + normal[1] * e[1] >= 0 for e in rays):
                    return False
        return True

    def cone(self, centre: int, others: Iterable[int]) -> list[Vector]:
        """Two boundary directions of the common cone, or none; by clipping."""
        cone = [(-x, -y) for x, y in self.rays[centre]]
        for e in others:
            low, high = self.rays[e]
            for side in (lambda d, low=low: cross(low, d), lambda d, high=high: cross(d, high)):
                one, other = side(cone[0]), side(cone[1])
                if one <= 0 and other <= 0:
                    return []
                if one < 0 or other < 0:
                    # the direction where the side's line crosses the cone
                    cut = tuple(abs(other) * p + abs(one) * q for p, q in zip(*cone, strict=True))
                    cone[0 if one < 0 else 1] = (cut[0], cut[1])
        return cone

    def candidates(self) -> Iterator[Key]:
        for pair in combinations(range(self.n), 2):
            if self.positively_spans(pair):
                yield "two_finger", pair, None
        if self.sets == "complete":
            for triple in combinations_with_replacement(range(self.n), 3):
                if self.positively_spans(triple):
                    yield "three_finger", triple, None
            return
        for triple in combinations(range(self.n), 3):
            for a, b, c in permutations(triple):
                steps = ((a, b), (b, c), (c, a))
                if a == triple[0] and all(
                    cross(d, e) > 0 for i, j in steps for d in self.rays[i] for e in self.rays[j]
                ):
                    yield "concurrent", triple, None
            for o in triple:
                if self.cone(o, [e for e in triple if e != o]):
                    yield "parallel", triple, o

    def functions(self, key: Key) -> list[Function]:
        kind, edges, centre = key
        found = []
        if kind == "parallel":
            assert centre is not None
            others = [e for e in edges if e != centre]
            for d in self.cone(centre, others):
                for other in others:
                    values = [Fraction(0)] * 4
                    for e, sign in ((other, 1), (centre, -1)):
                        values[0] += sign * cross(self.a[e], d)
                        values[1 + edges.index(e)] = sign * cross(self.t[e], d)
                    found.append(tuple(values))
            return found
        rays = [(i, self.a[e], self.t[e], r) for i, e in enumerate(edges) for r in self.rays[e]]
        for chosen in (*combinations(rays, 2), *combinations(rays, 3)):
            vectors = [r for *_, r in chosen]
            if len(chosen) == 2:
                (x, y), (z, w) = vectors
                if cross(*vectors) != 0 or x * z + y * w >= 0:
                    continue
                weights = [abs(z) + abs(w), abs(x) + abs(y)]
            else:
                weights = [
                    cross(vectors[1], vectors[2]),
                    cross(vectors[2], vectors[0]),
                    cross(vectors[0], vectors[1]),
                ]
                if max(weights) < 0:
                    weights = [-w for w in weights]
                if min(weights) <= 0:
                    continue
            values = [Fraction(0)] * (len(edges) + 1)
            for weight, (i, a, t, ray) in zip(weights, chosen, strict=True):
                values[0] += weight * cross(a, ray)
                values[1 + i] += weight * cross(t, ray)
            found.append(tuple(values))
        return found


# --- points by elimination ------------------------------------------------------------------------


def solve(rows: Sequence[Row]) -> list[Fraction] | None:
    """A solution of ``c + a · x < 0`` (True) or ``<= 0``, None if there is none."""
    n = len(rows[0][0]) - 1
    if n == 0:
        return [] if all(r[0] < 0 or (r[0] == 0 and not strict) for r, strict in rows) else None
    upper = [(r, s) for r, s in rows if r[-1] > 0]
    lower = [(r, s) for r, s in rows if r[-1] < 0]
    rest = [(r[:-1], s) for r, s in rows if r[-1] == 0]
    for (up, s), (low, t) in product(upper, lower):
        merged = [u / up[-1] + v / -low[-1] for u, v in zip(up, low, strict=True)]
        rest.append((tuple(merged[:-1]), s or t))
    x = solve(list(dict.fromkeys(rest)))
    if x is None:
        return None

    def bound(row: tuple[Fraction, ...]) -> Fraction:
        return -(row[0] + sum(a * b for a, b in zip(row[1:-1], x, strict=True))) / row[-1]

    # strictly between the bounds, unless a weak bound of each side leaves one value only
    return [*x, (max(bound(r) for r, _ in lower) + min(bound(r) for r, _ in upper)) / 2]


def common_grasps(
    sets: tuple[list[Function], list[Function]], slots: tuple[list[int], list[int]]
) -> tuple[list[Fraction], list[Fraction]] | None:
    """Two grasps that share the held contacts, None if there are none."""
    m, n = (len(functions[0]) - 1 for functions in sets)
    columns = list(range(m, m + n))
    for here, there in zip(*slots, strict=True):
        columns[there] = here
    used = sorted({*range(m), *columns})

    def widened(function: Function, own: Sequence[int], sign: int) -> Row:
        values = dict.fromkeys(used, Fraction(0))
        for column, slope in zip(own, function[1:], strict=True):
            values[column] = sign * slope
        return (sign * function[0], *values.values()), True

    box: list[Row] = []
    for i in range(len(used)):
        unit = [Fraction(int(i == j)) for j in range(len(used))]
        box += [((Fraction(0), *(-u for u in unit)), False), ((Fraction(-1), *unit), False)]
    for (j, k), (p, q) in product(permutations(sets[0], 2), permutations(sets[1], 2)):
        rows = [widened(j, range(m), 1), widened(k, range(m), -1)]
        rows += [widened(p, columns, 1), widened(q, columns, -1)]
        found = solve(rows + box)
        if found is not None:
            return found[:m], [found[used.index(c)] for c in columns]
    return None


# --- proofs of no ---------------------------------------------------------------------------------


def projected(functions: list[Function], slots: list[int], end: int) -> list[Function]:
    free = [i for i in range(len(functions[0]) - 1) if i not in slots]
    return [
        (f[0] + end * sum(f[1 + i] for i in free), *(f[1 + i] for i in slots)) for f in functions
    ]


def conditions(why: str, shadows: list[list[list[Function]]]) -> Iterator[tuple[Fraction, ...]]:
    """Linear functions of x that are all >= 0 where a reason holds; two held contacts."""
    if why in ("d0<=0", "d1<=0"):
        for c, x, _ in shadows[int(why[1])][0]:
            yield c, x
    elif why in ("u0>=1", "u1>=1"):
        for c, x, y in shadows[int(why[1])][1]:
            yield -c - y, -x
    else:
        lows, highs = shadows[int(why[1])][0], shadows[int(why[5])][1]
        for c, x, y in lows:
            if y == 0:
                yield c, x
        for c, x, y in highs:
            if y == 0:
                yield -c, -x
        for (c, x, y), (d, w, z) in product(lows, highs):
            if y and z:  # -(c + x X) / y <= -(d + w X) / z
                yield c / y - d / z, x / y - w / z


def interval(rows: Iterable[tuple[Fraction, ...]]) -> tuple[Fraction, Fraction] | None:
    low, high = Fraction(0), Fraction(1)
    for c, x in rows:
        if x > 0:
            low = max(low, -c / x)
        elif x < 0:
            high = min(high, -c / x)
        elif c < 0:
            return None
    return (low, high) if low <= high else None


def proof_of_no(
    sets: tuple[list[Function], list[Function]], slots: tuple[list[int], list[int]]
) -> list[list[Any]] | None:
    h = len(slots[0])
    if h == 3:
        return None
    shadows = [[projected(f, s, end) for end in (0, 1)] for f, s in zip(sets, slots, strict=True)]
    if h == 1:  # the same with an x that nothing depends on
        shadows = [[[(c, Fraction(0), y) for c, y in f] for f in pair] for pair in shadows]
    found = {why: interval(conditions(why, shadows)) for why in WHYS}
    if h == 1:
        return [[next(why for why, span in found.items() if span)]]
    cover: list[list[Any]] = []
    reached = Fraction(0)
    while not cover or reached < 1:
        spans = [(s[1], s[0], w) for w, s in found.items() if s and s[0] <= reached]
        high, low, why = max(spans)
        assert high > reached or not cover, "the intervals do not cover [0, 1]"
        cover.append([why, number(low), number(high)])
        reached = high
    return cover


# --- files ----------------------------------------------------------------------------------------


def number(value: Fraction) -> float | str:
    """A rational number as a double where it is one."""
    return (
        float(value)
        if Fraction(float(value)) == value
        else f"{value.numerator}/{value.denominator}"
    )


def held_slots(edges: Sequence[int], held: Sequence[int]) -> list[int]:
    found: list[int] = []
    for e in held:
        found.append(next(i for i, f in enumerate(edges) if f == e and i not in found))
    return found


def description(
    exterior: Sequence[Sequence[float]],
    friction: float | Sequence[float],
    *,
    sets: str = "complete",
    fingers: int = 4,
    holes: Sequence[Sequence[Sequence[float]]] = (),
    name: str = "tiny",
) -> dict[str, Any]:
    n = sum(map(len, [exterior, *holes]))
    return {
        "name": name,
        "exterior": [list(p) for p in exterior],
        "holes": [[list(p) for p in ring] for ring in holes],
        "friction": [friction] * n if isinstance(friction, (int, float)) else list(friction),
        "fingers": fingers,
        "sets": sets,
    }


def records(thing: Object) -> Iterator[list[Any]]:
    """All records of an object."""
    sets: list[tuple[tuple[int, ...], list[Function]]] = []
    for key in thing.candidates():
        kind, edges, centre = key
        functions = thing.functions(key)
        grasp = common_grasps((functions, functions), (list(range(len(edges))),) * 2)
        if grasp is not None:
            sets.append((edges, functions))
            yield ["set", kind, list(edges), centre, [number(f) for f in grasp[0]]]
        elif all(f[0] >= 0 for f in functions):
            yield ["empty", kind, list(edges), centre, "start"]
        else:
            assert all(sum(f) <= 0 for f in functions)
            yield ["empty", kind, list(edges), centre, "end"]
    for (i, (one, f)), (j, (other, g)) in combinations(enumerate(sets), 2):
        least = max(1, len(one) + len(other) - thing.fingers)
        for h in range(least, min(len(one), len(other)) + 1):
            for held in dict.fromkeys(combinations(one, h)):
                if any(held.count(e) > other.count(e) for e in held):
                    continue
                slots = held_slots(one, held), held_slots(other, held)
                grasps = common_grasps((f, g), slots)
                if grasps is None:
                    yield ["no", i, j, list(held), proof_of_no((f, g), slots)]
                else:
                    values = [[number(v) for v in grasp] for grasp in grasps]
                    yield ["yes", i, j, list(held), *values]


def text(lines: Iterable[Any]) -> bytes:
    """A file with these values after the first line, whose hash is right."""
    rest = "".join(json.dumps(line) + "\n" for line in lines).encode()
    return first_line(rest) + rest


def first_line(rest: bytes) -> bytes:
    digest = hashlib.sha256(rest).hexdigest()
    header = {"format": "regrasp-certificates", "version": 1, "sha256": digest}
    return json.dumps(header).encode() + b"\n"
