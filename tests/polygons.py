"""Random polygons of several families, and what may be done to a polygon without changing it.

Everything is drawn as small integers, so that exact degeneracies are common (equal angles,
collinear edges, opposite rays, lines through one point) and shrunk examples are readable. All
coordinates are dyadic with few bits: they may be moved far without rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from regrasp_lp.errors import PolygonError
from regrasp_lp.polygon import Polygon

Points = list[tuple[float, float]]

CRITICAL = (0.5, 1.0, 2.0, 0.75, 0.25)
"""Dyadic friction coefficients, at which cones of lattice polygons have common boundaries."""

FRICTIONS = (0.02, 0.1, 0.3, 0.7, 1.5, 3.0, *CRITICAL)


def checked(points: Points) -> Polygon:
    """The polygon, or another draw if it is none."""
    try:
        return Polygon(points)
    except PolygonError:
        assume(False)
        raise


# --- families -----------------------------------------------------------------------------------

_coordinate = st.integers(-4, 4)
_point = st.tuples(_coordinate, _coordinate)


@st.composite
def stars(draw: st.DrawFn) -> Polygon:
    """Star-shaped about the origin: lattice points in angular order."""
    chosen = draw(st.lists(_point.filter(any), min_size=3, max_size=8, unique=True))
    angles = {p: float(np.arctan2(p[1], p[0])) for p in chosen}
    nearest: dict[float, tuple[int, int]] = {}
    for p in chosen:  # one point in each direction
        nearest.setdefault(angles[p], p)
    assume(len(nearest) >= 3)
    return checked([nearest[angle] for angle in sorted(nearest)])


@st.composite
def tangles(draw: st.DrawFn) -> Polygon:
    """A tour of lattice points, untangled by 2-opt: concave, and seldom star-shaped."""
    points = draw(st.lists(_point, min_size=4, max_size=8, unique=True))
    for _ in range(60):
        crossing = next(
            (
                (i, j)
                for i, j in combinations(range(len(points)), 2)
                if _cross(*points[i], *points[i + 1], *points[j], *points[(j + 1) % len(points)])
            ),
            None,
        )
        if crossing is None:
            break
        i, j = crossing
        points[i + 1 : j + 1] = points[i + 1 : j + 1][::-1]
    return checked([(float(x), float(y)) for x, y in points])


def _cross(ax: int, ay: int, bx: int, by: int, cx: int, cy: int, dx: int, dy: int) -> bool:
    """Whether two segments cross in their insides."""

    def left(px: int, py: int, qx: int, qy: int, rx: int, ry: int) -> int:
        return int(np.sign((qx - px) * (ry - py) - (qy - py) * (rx - px)))

    return (
        left(ax, ay, bx, by, cx, cy) * left(ax, ay, bx, by, dx, dy) < 0
        and left(cx, cy, dx, dy, ax, ay) * left(cx, cy, dx, dy, bx, by) < 0
    )


@st.composite
def rectilinears(draw: st.DrawFn) -> Polygon:
    """A skyline above and one below; equal heights beside each other make collinear runs."""
    width = draw(st.integers(1, 3))
    top = draw(st.lists(st.integers(1, 3), min_size=width, max_size=width))
    bottom = draw(st.lists(st.integers(-2, 0), min_size=width, max_size=width))
    steps = draw(st.lists(st.integers(1, 2), min_size=width, max_size=width))
    x = [0, *np.cumsum(steps).tolist()]
    points: Points = []
    for i in range(width):
        points += [(x[i], bottom[i]), (x[i + 1], bottom[i])]
    for i in reversed(range(width)):
        points += [(x[i + 1], top[i]), (x[i], top[i])]
    return checked(_without_repetitions(points))


def _without_repetitions(points: Points) -> Points:
    return [p for i, p in enumerate(points) if p != points[i - 1]]


@st.composite
def regulars(draw: st.DrawFn) -> Polygon:
    """Regular polygons, rounded to multiples of 2⁻²⁰."""
    n, turn = draw(st.integers(3, 9)), draw(st.sampled_from([0.0, 0.5, 0.125]))
    return regular(n, turn)


def regular(n: int, turn: float = 0.5) -> Polygon:
    angles = 2 * np.pi * (np.arange(n) + turn) / n
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return checked([(float(x), float(y)) for x, y in np.round(points * 2.0**20) / 2.0**20])


@st.composite
def needles(draw: st.DrawFn) -> Polygon:
    """Triangles and quadrilaterals of aspect ratio up to a million."""
    length = 2.0 ** draw(st.integers(4, 20))
    up, down = draw(st.integers(0, 3)), draw(st.integers(0, 3))
    return checked(_without_repetitions([(0, 0), (length / 2, -down), (length, 0), (length, up)]))


@st.composite
def combs(draw: st.DrawFn) -> Polygon:
    """Two teeth of drawn lengths, some of them slanted."""
    depth = draw(st.lists(st.integers(2, 4), min_size=2, max_size=2))
    slant = draw(st.sampled_from([0.0, 0.25, -0.25]))
    points: Points = [(0, 0), (4, 0)]
    for tooth in (1, 0):
        x = 2.0 * tooth
        points += [(x + 2, depth[tooth]), (x + 1 + slant, depth[tooth]), (x + 1, 1), (x, 1)]
    return checked([*points[:-1], (0, 1)])


@st.composite
def with_runs(draw: st.DrawFn) -> Polygon:
    """Any of the others with edges cut in two: collinear runs."""
    polygon = draw(st.one_of(stars(), rectilinears(), needles()))
    cut = draw(st.sets(st.integers(0, polygon.n_edges - 1), min_size=1, max_size=3))
    points: Points = []
    for i, (a, b) in enumerate(zip(polygon.edge_starts, polygon.edge_ends, strict=True)):
        points.append((float(a[0]), float(a[1])))
        if i in cut:
            middle = (a + b) / 2
            points.append((float(middle[0]), float(middle[1])))
    return checked(points)


@st.composite
def nearly_parallel(draw: st.DrawFn) -> Polygon:
    """Any of the others with corners moved by 2⁻²⁰: edges nearly parallel, nearly collinear."""
    polygon = draw(st.one_of(rectilinears(), with_runs(), tangles(), combs()))
    nudges = draw(
        st.lists(
            st.tuples(st.integers(0, polygon.n_edges - 1), st.integers(-1, 1), st.integers(-1, 1)),
            min_size=1,
            max_size=3,
        )
    )
    points = polygon.vertices.copy()
    for corner, x, y in nudges:
        points[corner] += np.array([x, y]) * 2.0**-20
    return checked([(float(x), float(y)) for x, y in points])


FAMILIES = {
    "stars": stars(),
    "tangles": tangles(),
    "rectilinears": rectilinears(),
    "regulars": regulars(),
    "needles": needles(),
    "combs": combs(),
    "with_runs": with_runs(),
    "nearly_parallel": nearly_parallel(),
}


@st.composite
def frictions(draw: st.DrawFn, n_edges: int) -> float | list[float]:
    """One coefficient, or one per edge."""
    one = draw(st.sampled_from(FRICTIONS))
    if draw(st.booleans()):
        return one
    return draw(st.lists(st.sampled_from((one, *FRICTIONS)), min_size=n_edges, max_size=n_edges))


# --- what changes nothing -----------------------------------------------------------------------


@dataclass(frozen=True)
class Moved:
    """A polygon that is another one, moved.

    `edge` is the new number of each edge, `turned` says that positions run the other way round,
    and `scale` is what lengths are multiplied with.
    """

    polygon: Polygon
    edge: np.ndarray
    turned: bool = False
    scale: float = 1.0

    def friction(self, friction: float | list[float]) -> float | list[float]:
        if not isinstance(friction, list):
            return friction
        moved = [0.0] * len(friction)
        for old, new in enumerate(self.edge.tolist()):
            moved[new] = friction[old]
        return moved


def moved(
    polygon: Polygon,
    matrix: tuple[tuple[float, float], tuple[float, float]] = ((1, 0), (0, 1)),
    shift: tuple[float, float] = (0, 0),
    first: int = 0,
    turn_rings: bool = False,
) -> Moved:
    """Return the polygon under ``x -> matrix x + shift``, its rings begun at another vertex.

    Edges are found again by their end points, which must be moved exactly.
    """
    a = np.array(matrix, dtype=np.float64)

    def image(points: np.ndarray) -> np.ndarray:
        there = (
            np.stack(
                [
                    a[0, 0] * points[:, 0] + a[0, 1] * points[:, 1] + shift[0],
                    a[1, 0] * points[:, 0] + a[1, 1] * points[:, 1] + shift[1],
                ],
                axis=1,
            )
            + 0.0
        )  # no negative zeros
        back = np.linalg.inv(a) @ (there - np.array(shift)).T
        np.testing.assert_array_equal(back.T + 0.0, points)
        return there

    rings = [np.roll(image(ring), -first, axis=0) for ring in polygon.rings]
    if turn_rings:
        rings = [ring[::-1] for ring in rings]
    holes = rings[1:][first:] + rings[1:][:first] if first < len(rings) - 1 else rings[1:]
    result = Polygon(rings[0], holes=holes, name=polygon.name)
    ends = zip(result.edge_starts.tolist(), result.edge_ends.tolist(), strict=True)
    place = {(tuple(p), tuple(q)): number for number, (p, q) in enumerate(ends)}
    determinant = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
    starts, stops = image(polygon.edge_starts).tolist(), image(polygon.edge_ends).tolist()
    if determinant < 0:
        starts, stops = stops, starts
    edge = [place[tuple(p), tuple(q)] for p, q in zip(starts, stops, strict=True)]
    assert sorted(edge) == list(range(polygon.n_edges))
    scale = float(np.sqrt(abs(determinant)))
    return Moved(result, np.array(edge), bool(determinant < 0), scale)
