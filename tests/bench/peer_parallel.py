"""Parallel sets of the peer: six sub-polytopes, their projections, and where these meet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import HalfspaceIntersection

from bench.peer_outline import (
    Bools,
    Floats,
    Geometries,
    Ints,
    Outline,
    common_cone,
    cross,
    edge_pairs,
    groups,
    runs,
)

# Signs of (b0, b1, c0, c1) in K0 to K5 (equations 3.2 to 3.7); 0 where a row is not asked for.
SIX = np.array(
    [
        [1, 1, -1, -1],
        [-1, -1, 1, 1],
        [1, -1, 0, 0],
        [0, 0, 1, -1],
        [-1, 1, 0, 0],
        [0, 0, -1, 1],
    ]
)


@dataclass(frozen=True)
class Parallel:
    """Parallel sets: edges ascending, centres, and projections along the contacts.

    ``flat[i, k]`` is the set without its contact k, over the positions of the other two in the
    order of their edges; ``low[i, k]`` and ``high[i, k]`` the range of contact k.
    """

    edges: Ints
    centers: Ints
    flat: Geometries
    low: Floats
    high: Floats


def parallel_candidates(outline: Outline) -> tuple[Ints, Ints]:
    """Triples (a; b, c), b < c, whose common cone has an interior: centres, and other edges."""
    width = 2 * outline.theta
    b, c = np.triu_indices(outline.n, 1)
    alike = np.abs((outline.ahead(b, c) + np.pi) % (2 * np.pi) - np.pi) < width
    b, c = b[alike], c[alike]
    every = np.arange(outline.n)
    opposed = np.abs(outline.ahead(every[:, None], every) - np.pi) < width
    a, row = np.nonzero(opposed[:, b] & opposed[:, c])
    return a, np.stack((b[row], c[row]), axis=1)


def parallel_sets(outline: Outline, polytopes: Polytopes) -> Parallel:
    centers, sides = parallel_candidates(outline)
    rays = common_cone(outline, centers, sides)
    at_start, at_end = (
        np.stack([root(outline, centers, sides[:, k], d, u) for k in (0, 1) for d in rays], axis=1)
        for u in (np.zeros(len(centers)), outline.lengths[centers])
    )
    lengths = outline.lengths[np.column_stack((centers, sides))]
    # Proposition 3.9: b and c are not all of them on one and the same side.
    exists = (at_start > 0).any(axis=1) & (at_end < lengths[:, [1, 1, 2, 2]]).any(axis=1)
    row, _, points = polytopes(Walls(lengths[exists], at_start[exists], at_end[exists]))
    return projected(np.column_stack((centers, sides))[exists], row, points)


def root(outline: Outline, a: Ints, i: Ints, d: Floats, u_a: Floats) -> Floats:
    """The u_i at which ``d × (x_i − x_a) = 0``: it is on the left of a with smaller u_i."""
    at_a = outline.starts[a] + u_a[:, None] * outline.along[a]
    return np.asarray(cross(at_a - outline.starts[i], d) / cross(outline.along[i], d))


@dataclass(frozen=True)
class Walls:
    """What bounds K0 to K5 of N sets: edge lengths (a, b, c), and four walls.

    The walls are the roots in u_b with d_0 and d_1, then those in u_c, as they are for u_a at its
    start and at its end, shape (N, 4).
    """

    lengths: Floats
    at_start: Floats
    at_end: Floats


Meets = Callable[[Geometries, Geometries], Bools]
"""Whether regions meet, pair by pair."""

Polytopes = Callable[[Walls], tuple[Ints, Ints, Floats]]
"""Row, number (0 to 5) and extreme points (P, V, 3), some of them repeated, of P sub-polytopes."""


def extreme_points(walls: Walls) -> tuple[Ints, Ints, Floats]:
    """The extreme points of K0 to K5, by where their bounds bend.

    For a given u_a the others are independent: each in an interval between 0, its length and its
    two roots. Extreme points are ends of these intervals, where u_a is at an end or one bends.
    """
    at_start, slope = walls.at_start, walls.at_end - walls.at_start
    n = len(at_start)
    full = walls.lengths[:, [1, 1, 2, 2]]
    apart, turn = at_start[:, ::2] - at_start[:, 1::2], slope[:, 1::2] - slope[:, ::2]
    # Parallel edges have parallel roots.
    crossing = np.divide(apart, turn, out=np.zeros(apart.shape), where=turn != 0)
    ends = np.broadcast_to([0.0, 1.0], (n, 2))
    bends = np.concatenate((-at_start / slope, (full - at_start) / slope, crossing, ends), axis=1)
    x = np.clip(bends, 0.0, 1.0)
    roots = at_start[:, :, None] + slope[:, :, None] * x[:, None, :]
    low = np.zeros((n, 6, 2, x.shape[1]))
    high = np.broadcast_to(walls.lengths[:, None, 1:, None], low.shape).copy()
    for k, column in np.argwhere(SIX > 0):
        np.minimum(high[:, k, column // 2], roots[:, column], out=high[:, k, column // 2])
    for k, column in np.argwhere(SIX < 0):
        np.maximum(low[:, k, column // 2], roots[:, column], out=low[:, k, column // 2])
    # At a bend an interval may be one point: rounding must not lose it.
    slack = 1e-12 * full.max(axis=1, initial=0.0)[:, None, None, None]
    exists = (high - low > -slack).all(axis=2)
    row, piece = np.nonzero(exists.any(axis=2))
    # What does not exist is replaced by what does: the hull is the same.
    here = exists[row, piece]
    pick = np.where(here, np.arange(x.shape[1]), here.argmax(axis=1)[:, None])
    u_a = np.take_along_axis((x * walls.lengths[:, :1])[row], pick, axis=1)
    lo, hi = (np.take_along_axis(v[row, piece], pick[:, None], axis=2) for v in (low, high))
    points = [np.stack((u_a, b[:, 0], c[:, 1]), axis=2) for b in (lo, hi) for c in (lo, hi)]
    return row, piece, np.concatenate(points, axis=1)


def extreme_points_by_qhull(walls: Walls) -> tuple[Ints, Ints, Floats]:
    """The same by scipy's half-space intersection, one polytope after the other.

    Qhull asks for a point inside: the middle of `extreme_points` is given, for a linear program
    for each would take several times longer than all the rest.
    """
    row, piece, guide = extreme_points(walls)
    middle = guide.mean(axis=1)
    lengths = walls.lengths[row]
    # Half-spaces (normal, offset): the box, then a wall each, u_i − root <= 0 on the left of it.
    halves = np.zeros((len(row), 10, 4))
    halves[:, :3, :3], halves[:, 3:6, :3] = -np.eye(3), np.eye(3)
    halves[:, 3:6, 3] = -lengths
    halves[:, [6, 7, 8, 9], [1, 1, 2, 2]] = 1.0
    halves[:, 6:, 0] = -(walls.at_end - walls.at_start)[row] / lengths[:, :1]
    halves[:, 6:, 3] = -walls.at_start[row]
    halves[:, 6:] *= SIX[piece][:, :, None]
    inside = np.einsum("phi,pi->ph", halves[:, :, :3], middle) + halves[:, :, 3]
    asked = halves.any(axis=2)
    solid = np.where(asked, inside, -np.inf).max(axis=1) < -1e-9 * walls.lengths.max(initial=0.0)
    found = [
        HalfspaceIntersection(halves[i][asked[i]], middle[i]).intersections
        for i in np.flatnonzero(solid).tolist()
    ]
    most = max(map(len, found), default=1)
    padded = [np.concatenate((p, p[:1].repeat(most - len(p), axis=0))) for p in found]
    return row[solid], piece[solid], np.array(padded).reshape(-1, most, 3)


def projected(edges: Ints, row: Ints, points: Floats) -> Parallel:
    """The convex hulls of projected extreme points, united, with edges in ascending order.

    `edges` are (a, b, c) of each set; polytope i belongs to set ``row[i]``.
    """
    order = np.argsort(edges, axis=1)
    points = np.take_along_axis(points, order[row][:, None, :], axis=2)
    flat = np.empty(edges.shape, dtype=object)
    low, high = np.full(edges.shape, np.inf), np.full(edges.shape, -np.inf)
    for k, kept in enumerate(([1, 2], [0, 2], [0, 1])):
        hulls = shapely.convex_hull(shapely.linestrings(points[:, :, kept]))
        flat[:, k] = united_rows(len(edges), row, hulls)
        np.minimum.at(low[:, k], row, points[:, :, k].min(axis=1))
        np.maximum.at(high[:, k], row, points[:, :, k].max(axis=1))
    return Parallel(np.take_along_axis(edges, order, axis=1), edges[:, 0], flat, low, high)


def united_rows(n: int, row: Ints, hulls: Geometries) -> Geometries:
    """The union of the polygons of each of n rows; `row` ascends."""
    flat = shapely.get_dimensions(hulls) == 2
    row, hulls = row[flat], hulls[flat]
    table = np.full((n, 6), None, dtype=object)
    rank = np.arange(len(row)) - np.searchsorted(row, row)
    table[row, rank] = hulls
    return np.asarray(shapely.union_all(table, axis=1))


def two_finger_spans(outline: Outline, pairs: Ints) -> tuple[Floats, Floats]:
    """The ranges of both contacts of two-finger sets, lower and upper ends (N, 2)."""
    a, b = pairs.T
    rays = common_cone(outline, a, pairs[:, [1]])
    at_start, at_end = (
        np.stack([root(outline, a, b, d, u) for d in rays], axis=1)
        for u in (np.zeros(len(a)), outline.lengths[a])
    )
    # K2 and K4: x_b in the cone of x_a, on one side or on the other. There is no third contact.
    walls = Walls(outline.lengths[pairs[:, [0, 1, 1]]], np.tile(at_start, 2), np.tile(at_end, 2))
    row, piece, points = extreme_points(walls)
    of_b = np.isin(piece, (2, 4))
    row, points = row[of_b], points[of_b, :, :2]
    low, high = np.full(pairs.shape, np.inf), np.full(pairs.shape, -np.inf)
    np.minimum.at(low, row, points.min(axis=1))
    np.maximum.at(high, row, points.max(axis=1))
    return low, high


# --- switches (3.3.2.3, 3.3.2.4) ---------------------------------------------------------------


def parallel_pairs(sets: Parallel, n: int, meets: Meets) -> Ints:
    """Pairs of parallel sets whose projections on two common edges meet."""
    labels, owner = edge_pairs(sets.edges, n)
    flat = sets.flat.ravel()
    shapely.prepare(flat)
    i, j = groups(labels)
    met = meets(flat[i], flat[j])
    return np.stack((owner[i[met]], owner[j[met]]), axis=1)


def mixed_pairs(pairs: Ints, spans: tuple[Floats, Floats], sets: Parallel, n: int) -> Ints:
    """Two-finger and parallel sets whose ranges on a common edge overlap."""
    order = np.argsort(pairs.ravel(), kind="stable")
    ranked, low, high = pairs.ravel()[order], spans[0].ravel()[order], spans[1].ravel()[order]
    edges = sets.edges.ravel()
    first = np.searchsorted(ranked, edges)
    counts = np.searchsorted(ranked, edges, side="right") - first
    there = np.arange(len(edges)).repeat(counts)
    here = runs(first, counts)
    overlap = np.maximum(low[here], sets.low.ravel()[there]) < np.minimum(
        high[here], sets.high.ravel()[there]
    )
    here, there = order[here[overlap]] // 2, there[overlap] // 3
    count = max(len(sets.edges), 1)
    key = np.unique(here * count + there)
    return np.stack((key // count, key % count), axis=1)
