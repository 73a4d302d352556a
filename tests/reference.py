"""The chapter's switching graph by plane geometry, independent of the library.

Of a polygon it reads where the edges start and end, and nothing else of `regrasp_lp`: cones, focus
cells, polytopes, projections and overlaps are made here, in whole numbers, from the doubles read as
the rational numbers they are. No torque functions, no linear programs, no solvers.

- Cells of two-finger and concurrent sets are unions of convex polygons ``E + s C``, intersected.
- Parallel sets are unions of the six sub-polytopes K0 to K5 (equations 3.1 to 3.7), in fractions of
  the edges; Fourier and Motzkin's elimination projects them on the contacts that are held.
- A set exists iff its cell, or one of its polytopes, has an interior.
- Focus rule: concurrent and two-finger sets are adjacent iff the interiors of their cells meet;
  pairs with a parallel set iff the interiors of their projections meet. Contact rule: projections
  for all, those of a concurrent set being where its double-sided cones meet in some point q.
- Where polygons overlap by more than `BAND`, or are farther apart, GEOS decides; an exact
  separating axis test decides the rest.

Everything here is open: a convex set is told by its corners, but only its interior counts. So
nothing is kept of a set that is clipped unless an interior is left, and no threshold is needed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from itertools import combinations, permutations, product
from math import gcd
from typing import TypeVar

import numpy as np
import shapely

from regrasp_lp.polygon import Polygon

Vector = tuple[int, int]
Point = tuple[int, int, int]
"""``(x, y, w)``: the point (x/w, y/w), or the direction (x, y) if w is 0; never w < 0."""
Row = tuple[int, int, int]
"""``(a, b, c)``: the open half-plane ``a x + b y + c w > 0``."""
Cone = tuple[Vector, Vector]
"""The boundary rays of a cone narrower than half a turn, the right (clockwise) one first."""
Interval = tuple[Fraction, Fraction]
Key = tuple[str, tuple[int, ...], int]
"""Kind, ascending edges, centre (−1 if there is none)."""
Pairs = list[tuple[int, int]]

Ints = TypeVar("Ints", bound=tuple[int, ...])

UNITS = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
BAND = 1e-9
"""Areas and distances of less, for an object of size 1 or an edge of length 1, need exactness."""
FAR = 100.0
"""Cells that reach beyond so many sizes of the object are compared exactly: rounding grows."""
CHUNK = 50_000
"""Pairs that are compared at a time."""


# --- convex sets in whole numbers ---------------------------------------------------------------


def cross(p: Vector, q: Vector) -> int:
    return p[0] * q[1] - p[1] * q[0]


def lowest(values: Ints) -> Ints:
    """The same ray in the smallest whole numbers."""
    common = gcd(*values)
    return tuple(v // common for v in values) if common > 1 else values


def value(row: Row, point: Point) -> int:
    return row[0] * point[0] + row[1] * point[1] + row[2] * point[2]


def row_through(p: Point, q: Point) -> Row:
    """What is on the left on the way from p to q."""
    return lowest((p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]))


def clip(points: Sequence[Point], row: Row) -> list[Point]:
    """The part of a convex polygon in a half-plane; empty if nothing has an interior.

    Directions among the points make the polygon unbounded. It is a convex cone in (x, y, w), so
    one rule clips all: what is inside meets the half-plane iff one of the points does.
    """
    values = [value(row, p) for p in points]
    if max(values) <= 0:
        return []
    kept: list[Point] = []
    following = zip([*points[1:], points[0]], [*values[1:], values[0]], strict=True)
    for p, f, (q, g) in zip(points, values, following, strict=True):
        if f >= 0:
            kept.append(p)
        if (f > 0 and g < 0) or (f < 0 and g > 0):
            f, g = abs(f), abs(g)
            kept.append(lowest((p[0] * g + q[0] * f, p[1] * g + q[1] * f, p[2] * g + q[2] * f)))
    return kept


def clip_all(points: Sequence[Point], rows: Iterable[Row]) -> list[Point]:
    found = list(points)
    for row in rows:
        found = clip(found, row)
        if not found:
            break
    return found


def intersect_cones(first: Cone, second: Cone) -> Cone | None:
    """The common cone, None if it has no interior."""
    right, left = first
    (rx, ry), (lx, ly) = second
    for nx, ny in ((-ry, rx), (ly, -lx)):  # left of the right ray, right of the left one
        f, g = nx * right[0] + ny * right[1], nx * left[0] + ny * left[1]
        if f <= 0 and g <= 0:
            return None
        if f < 0 or g < 0:
            f_, g_ = abs(f), abs(g)
            middle = lowest((right[0] * g_ + left[0] * f_, right[1] * g_ + left[1] * f_))
            right, left = (middle, left) if f < 0 else (right, middle)
    return right, left


def opposite(cone: Cone) -> Cone:
    (rx, ry), (lx, ly) = cone
    return (-rx, -ry), (-lx, -ly)


class Piece:
    """A convex polygon, bounded, with an interior; counter-clockwise."""

    def __init__(self, points: Sequence[Point]) -> None:
        self.points = tuple(points)

    @cached_property
    def rows(self) -> list[Row]:
        following = [*self.points[1:], self.points[0]]
        return [row_through(p, q) for p, q in zip(self.points, following, strict=True)]

    def meets(self, other: Piece) -> bool:
        """Whether the interiors have a point in common: no side of either separates them."""
        return not any(
            all(value(row, p) <= 0 for p in q.points)
            for one, q in ((self, other), (other, self))
            for row in one.rows
        )

    def interval(self, axis: int) -> Interval:
        values = [Fraction(p[axis], p[2]) for p in self.points]
        return min(values), max(values)

    def drawn(self, size: int) -> shapely.Polygon:
        """Rounded once, in units of `size`."""
        return shapely.Polygon([(x / (w * size), y / (w * size)) for x, y, w in self.points])


Region = list[Piece]
"""A union; no pieces if it is empty."""


def meet(first: Region, second: Region) -> bool:
    """Whether the interiors of two unions meet, exactly."""
    return any(p.meets(q) for p, q in product(first, second))


def overlapping(regions: Sequence[Region], pairs: Pairs, size: int, exact: bool) -> list[bool]:
    """Whether the interiors of two regions meet, pair by pair; `exact` decides all without GEOS."""
    if exact:
        return [meet(regions[i], regions[j]) for i, j in pairs]
    drawn = np.array([shapely.union_all([p.drawn(size) for p in r]) for r in regions])
    near = np.array([np.abs(shapely.bounds(d)).max() < FAR for d in drawn], dtype=bool)
    shapely.prepare(drawn)
    result = []
    for start in range(0, len(pairs), CHUNK):
        these = pairs[start : start + CHUNK]
        i, j = np.array(these).T
        one, other = drawn[i], drawn[j]
        apart = ~shapely.dwithin(one, other, BAND)
        areas = np.zeros(len(these))
        areas[~apart] = shapely.area(shapely.intersection(one[~apart], other[~apart]))
        yes = areas > BAND
        unclear = ~(yes | apart) | ~near[i] | ~near[j]
        for k in np.flatnonzero(unclear).tolist():
            yes[k] = meet(regions[these[k][0]], regions[these[k][1]])
        result += yes.tolist()
    return result


# --- the object ---------------------------------------------------------------------------------


def whole_numbers(polygon: Polygon) -> tuple[list[Vector], list[Vector]]:
    """Starts and ends of the edges, exactly, in a common unit; the first corner is the origin."""
    points = [
        [tuple(Fraction(v) for v in p) for p in array.tolist()]
        for array in (polygon.edge_starts, polygon.edge_ends)
    ]
    x, y = points[0][0]
    moved = [[(px - x, py - y) for px, py in array] for array in points]
    unit = max(v.denominator for p in moved[0] for v in p)  # all of them are powers of two
    common = gcd(*(int(v * unit) for p in moved[0] for v in p))
    starts, ends = (
        [(int(px * unit) // common, int(py * unit) // common) for px, py in array]
        for array in moved
    )
    return starts, ends


class Scene:
    """Edges, cones and the convex sets made of them, in whole numbers of a common unit."""

    def __init__(self, polygon: Polygon, friction: float | Sequence[float]) -> None:
        self.n = polygon.n_edges
        self.starts, self.ends = whole_numbers(polygon)
        self.size = max(abs(v) for p in self.starts for v in p)
        values = [friction] * self.n if isinstance(friction, int | float) else list(friction)
        if len(values) != self.n or not all(mu > 0 for mu in values):
            raise ValueError("friction has to be positive: one value, or one per edge")
        self.tangents = [
            (q[0] - p[0], q[1] - p[1]) for p, q in zip(self.starts, self.ends, strict=True)
        ]
        self.cones: list[Cone] = []
        for (tx, ty), mu in zip(self.tangents, values, strict=True):
            m, one = float(mu).as_integer_ratio()
            right = lowest((-one * ty + m * tx, one * tx + m * ty))
            left = lowest((-one * ty - m * tx, one * tx - m * ty))
            self.cones.append((right, left))
        self.sweep = cache(self._sweep)
        self.side = cache(self._side)
        self.pair_cells = cache(self._pair_cells)
        self.same_side = cache(self._same_side)

    def _sweep(self, edge: int, cone: Cone, side: int) -> tuple[list[Point], list[Row]]:
        """``E + side C`` for a cone C inside that of the edge: corners and rows."""
        (rx, ry), (lx, ly) = cone
        a, b = (*self.starts[edge], 1), (*self.ends[edge], 1)
        if side > 0:
            points: list[Point] = [a, b, (rx, ry, 0), (lx, ly, 0)]
        else:
            points = [b, a, (-rx, -ry, 0), (-lx, -ly, 0)]
        # the line at infinity, from one ray to the other, bounds nothing
        rows = [row_through(points[k], points[(k + 1) % 4]) for k in (0, 1, 3)]
        return points, rows

    # --- two-finger and concurrent sets ---------------------------------------------------------

    def two_finger_cell(self, a: int, b: int) -> Region | None:
        """The cell of two edges on opposite sides, None if the normals are not opposed."""
        cone = intersect_cones(self.cones[a], opposite(self.cones[b]))
        if cone is None:
            return None
        cell = []
        for side in (1, -1):
            points, _ = self.sweep(a, cone, side)
            _, rows = self.sweep(b, opposite(cone), side)
            cell += _pieces(clip_all(points, rows))
        return cell

    def _side(self, edge: int, side: int) -> tuple[list[Point], list[Row]]:
        """The points on one side of an edge that lie in a double-sided cone of it."""
        return self._sweep(edge, self.cones[edge], side)

    def _pair_cells(self, a: int, b: int) -> list[list[Point]]:
        cells = [
            clip_all(self.side(a, s)[0], self.side(b, t)[1]) for s, t in product((1, -1), repeat=2)
        ]
        return [cell for cell in cells if cell]

    def spans(self, a: int, b: int, c: int) -> bool:
        """Whether the normals θ-positively span the plane in this order."""
        return self._turns(a, b) and self._turns(b, c) and self._turns(c, a)

    def _turns(self, a: int, b: int) -> bool:
        return all(cross(d, e) > 0 for d, e in product(self.cones[a], self.cones[b]))

    def concurrent_cell(self, a: int, b: int, c: int) -> Region:
        cell = []
        for pair, side in product(self.pair_cells(a, b), (1, -1)):
            cell += _pieces(clip_all(pair, self.side(c, side)[1]))
        return cell

    def concurrent_projections(self, a: int, b: int, c: int) -> list[Region]:
        """All its grasps, without the contact on a, on b, on c."""
        sides = [
            signs
            for signs in product((1, -1), repeat=3)
            if clip_all(
                self.side(a, signs[0])[0], self.side(b, signs[1])[1] + self.side(c, signs[2])[1]
            )
        ]
        edges = (a, b, c)
        regions = []
        for i in range(3):
            j, k = (place for place in range(3) if place != i)
            region: Region = []
            for signs in sides:
                # of (q, u_j, u_k): q is in the cones at both contacts, and in a cone of edge i
                rows: list[tuple[int, ...]] = [
                    (h, m, n, 0, 0) for m, n, h in self.side(edges[i], signs[i])[1]
                ]
                for place, e in enumerate((edges[j], edges[k])):
                    rows += self._cone_rows(e, signs[edges.index(e)], place)
                region += in_square(eliminated(eliminated(rows, 1), 1))
            regions.append(region)
        return regions

    def _cone_rows(self, edge: int, side: int, place: int) -> list[tuple[int, ...]]:
        """Where q is in a cone of the contact u_place: rows of (q, u_0, u_1)."""
        (x, y), t = self.starts[edge], self.tangents[edge]
        (rx, ry), (lx, ly) = self.cones[edge]
        rows = []
        for m, n in ((-ry, rx), (ly, -lx)):
            row = [-(m * x + n * y), m, n, 0, 0]
            row[3 + place] = -(m * t[0] + n * t[1])
            rows.append(tuple(side * v for v in row))
        return rows

    # --- parallel sets --------------------------------------------------------------------------

    def _same_side(self, a: int, b: int) -> Cone | None:
        return intersect_cones(opposite(self.cones[a]), self.cones[b])

    def common_cone(self, center: int, b: int, c: int) -> Cone | None:
        """``−C_a ∩ C_b ∩ C_c``, None if it has no interior."""
        cone = self.same_side(center, b)
        return cone and intersect_cones(cone, self.cones[c])

    def projections(self, edges: tuple[int, ...], center: int, cone: Cone) -> list[Region]:
        """The union of K0 to K5 seen along each axis: without u_0, without u_1, without u_2."""
        at = edges.index(center)
        sides = [i for i in range(3) if i != at]
        # b0 says L(n_0, x_b), its negative R(n_0, x_b), and so on
        (b0, b1), (c0, c1) = ([self._left_of(edges, at, i, d) for d in cone] for i in sides)
        polytopes = [
            [b0, b1, negative(c0), negative(c1)],
            [negative(b0), negative(b1), c0, c1],
            [b0, negative(b1)],
            [c0, negative(c1)],
            [negative(b0), b1],
            [negative(c0), c1],
        ]
        box = [(0, *e) for e in UNITS] + [(1, *(-v for v in e)) for e in UNITS]
        return [
            [piece for rows in polytopes for piece in in_square(eliminated([*rows, *box], axis))]
            for axis in (1, 2, 3)
        ]

    def _left_of(self, edges: tuple[int, ...], at: int, i: int, d: Vector) -> tuple[int, ...]:
        """``d × (x_i − x_a)`` over the fractions u: constant, then three slopes."""
        (ax, ay), (bx, by) = self.starts[edges[at]], self.starts[edges[i]]
        row = [cross(d, (bx - ax, by - ay)), 0, 0, 0]
        row[1 + at] = -cross(d, self.tangents[edges[at]])
        row[1 + i] = cross(d, self.tangents[edges[i]])
        return lowest(tuple(row))

    def two_finger_intervals(self, a: int, b: int) -> dict[int, list[Interval]]:
        """Where on each of the two edges a finger of a two-finger grasp can be, in fractions."""
        cone = intersect_cones(self.cones[a], opposite(self.cones[b]))
        assert cone is not None
        (ax, ay), (bx, by) = self.starts[a], self.starts[b]
        right, left = (
            (cross(d, (bx - ax, by - ay)), -cross(d, self.tangents[a]), cross(d, self.tangents[b]))
            for d in cone
        )
        found = in_square([right, negative(left)]) + in_square([negative(right), left])
        return {e: [piece.interval(i) for piece in found] for i, e in enumerate((a, b))}


def negative(row: Ints) -> Ints:
    return tuple(-v for v in row)


def _pieces(points: list[Point]) -> Region:
    return [Piece(points)] if points else []


def eliminated(rows: Iterable[tuple[int, ...]], at: int) -> list[tuple[int, ...]]:
    """Rows ``constant, slopes`` without variable `at` (1, 2, ...), by Fourier and Motzkin.

    They hold exactly where some value of it satisfies all rows, strictly.
    """
    lower: list[tuple[int, tuple[int, ...]]] = []
    upper: list[tuple[int, tuple[int, ...]]] = []
    found = set()
    for row in rows:
        slope, rest = row[at], row[:at] + row[at + 1 :]
        if slope == 0:
            found.add(rest)
        else:
            (lower if slope > 0 else upper).append((abs(slope), rest))
    for (f, low), (g, high) in product(lower, upper):
        found.add(lowest(tuple(p * g + q * f for p, q in zip(low, high, strict=True))))
    return sorted(found)


def in_square(rows: Iterable[tuple[int, ...]]) -> Region:
    """The part of the unit square where rows ``constant, slope, slope`` hold."""
    square: list[Point] = [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    return _pieces(clip_all(square, ((p, q, c) for c, p, q in rows)))


def outermost(intervals: Iterable[Interval]) -> list[Interval]:
    """Without those that lie in another one."""
    kept: list[Interval] = []
    for low, high in sorted(set(intervals), key=lambda i: (i[0], -i[1])):
        if not kept or high > kept[-1][1]:
            kept.append((low, high))
    return kept


def intervals_meet(first: Sequence[Interval], second: Sequence[Interval]) -> bool:
    return any(max(p, r) < min(q, s) for (p, q), (r, s) in product(first, second))


# --- the graph ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class ReferenceGraph:
    """Vertices by name, and all adjacent pairs of their numbers (ascending)."""

    vertices: list[Key]
    pairs: list[tuple[int, int]]

    @property
    def counts(self) -> dict[str, int]:
        """Vertices per kind."""
        kinds = [kind for kind, _, _ in self.vertices]
        return {kind: kinds.count(kind) for kind in ("two_finger", "concurrent", "parallel")}

    @property
    def n_components(self) -> int:
        parent = list(range(len(self.vertices)))

        def root(i: int) -> int:
            while parent[i] != i:
                parent[i] = parent[parent[i]]
                i = parent[i]
            return i

        for i, j in self.pairs:
            parent[root(i)] = root(j)
        return sum(parent[i] == i for i in range(len(parent)))

    def named(self) -> set[frozenset[Key]]:
        """The adjacent pairs by name."""
        return {frozenset((self.vertices[i], self.vertices[j])) for i, j in self.pairs}


def sharing(keys: Sequence[Key], first: str, second: str, n_common: int) -> Pairs:
    """All pairs i < j of vertices of these kinds with so many common edges or more."""
    groups: dict[tuple[int, ...], list[int]] = defaultdict(list)
    for i, (kind, edges, _) in enumerate(keys):
        if kind in (first, second):
            for common in combinations(edges, n_common):
                groups[common].append(i)
    found = {
        (i, j)
        for group in groups.values()
        for i, j in combinations(group, 2)
        if {keys[i][0], keys[j][0]} == {first, second}
    }
    return sorted(found)


def two_finger_and_concurrent(scene: Scene) -> dict[Key, Region]:
    """Focus cells that have an interior."""
    cells: dict[Key, Region] = {}
    for a, b in combinations(range(scene.n), 2):
        cell = scene.two_finger_cell(a, b)
        if cell:
            cells["two_finger", (a, b), -1] = cell
    for a, b, c in combinations(range(scene.n), 3):
        if scene.spans(a, b, c) or scene.spans(a, c, b):
            cell = scene.concurrent_cell(a, b, c)
            if cell:
                cells["concurrent", (a, b, c), -1] = cell
    return cells


def parallel_sets(scene: Scene) -> dict[Key, list[Region]]:
    """Projections along the three axes, of sets that have an interior."""
    found: dict[Key, list[Region]] = {}
    for center, b, c in permutations(range(scene.n), 3):
        if b < c and (cone := scene.common_cone(center, b, c)) is not None:
            edges = tuple(sorted((center, b, c)))
            regions = scene.projections(edges, center, cone)
            if regions[0]:
                found["parallel", edges, center] = regions
    return dict(sorted(found.items()))


def reference_graph(
    polygon: Polygon,
    friction: float | Sequence[float],
    switching: str = "focus",
    *,
    exact: bool = False,
) -> ReferenceGraph:
    """Compute the chapter's switching graph for a hand of four fingers.

    Concurrent and parallel sets are never adjacent: no two edges can belong to both.

    Parameters
    ----------
    switching : {"focus", "contact"}
    exact : bool
        Decide every pair in whole numbers, without GEOS.
    """
    if switching not in ("focus", "contact"):
        raise ValueError(f"no such rule: {switching}")
    scene = Scene(polygon, friction)
    cells = two_finger_and_concurrent(scene)
    seen = parallel_sets(scene)
    keys = [*cells, *seen]
    two_finger = [key for key in keys if key[0] == "two_finger"]
    found: Pairs = list(combinations(range(len(two_finger)), 2))
    if switching == "focus":
        asked = sharing(keys, "concurrent", "concurrent", 2)
        asked += sharing(keys, "two_finger", "concurrent", 1)
        met = overlapping(list(cells.values()), asked, scene.size, exact)
        found += [pair for pair, answer in zip(asked, met, strict=True) if answer]
    else:
        seen |= {key: scene.concurrent_projections(*key[1]) for key in cells if len(key[1]) == 3}
    found += with_two_held(keys, seen, exact)
    found += with_one_held(
        keys, {key: scene.two_finger_intervals(*key[1]) for key in two_finger}, seen
    )
    return ReferenceGraph(keys, sorted(found))


def with_two_held(keys: list[Key], seen: dict[Key, list[Region]], exact: bool) -> Pairs:
    """Pairs of one kind whose projections on two common edges overlap."""
    regions = [region for projections in seen.values() for region in projections]
    first = {key: 3 * i for i, key in enumerate(seen)}
    asked, of = [], []
    for kind in sorted({kind for kind, _, _ in seen}):
        for i, j in sharing(keys, kind, kind, 2):
            mine, theirs = keys[i][1], keys[j][1]
            for axis, other in product(range(3), repeat=2):
                if mine[:axis] + mine[axis + 1 :] == theirs[:other] + theirs[other + 1 :]:
                    asked.append((first[keys[i]] + axis, first[keys[j]] + other))
                    of.append((i, j))
    met = overlapping(regions, asked, 1, exact)
    return sorted({pair for pair, answer in zip(of, met, strict=True) if answer})


def with_one_held(
    keys: list[Key],
    two_finger: dict[Key, dict[int, list[Interval]]],
    seen: dict[Key, list[Region]],
) -> Pairs:
    """Pairs with a two-finger set whose projections on one common edge overlap."""
    places = dict(two_finger)
    for key, (without_first, _, without_last) in seen.items():
        shown = [(without_last, 0), (without_last, 1), (without_first, 1)]
        places[key] = {
            e: outermost(piece.interval(axis) for piece in region)
            for e, (region, axis) in zip(key[1], shown, strict=True)
        }
    return [
        (i, j)
        for kind in {kind for kind, _, _ in seen}
        for i, j in sharing(keys, "two_finger", kind, 1)
        for mine, theirs in [(places[keys[i]], places[keys[j]])]
        if any(intervals_meet(mine[e], theirs[e]) for e in mine.keys() & theirs.keys())
    ]
