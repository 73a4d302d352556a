"""The peer: the chapter's switching graph on GEOS, as fast as shapely 2 and numpy make it.

Nothing of `regrasp_lp` is used but the polygon: no torque functions, no linear programs. What is
computed is the chapter's, section by section: candidates from windows of the normals, focus cells
as intersections of swept double-sided cones, parallel sets from the extreme points of their six
sub-polytopes and the convex hulls of their projections, switches where cells or projections meet.
It gives vertices and edges; margins, witnesses and exactness it does not have.

What is in its favour: every step runs on arrays (no Python loop over sets or pairs), cells of edge
pairs are shared by their triples, predicates run on prepared geometries, existence of parallel sets
is by signs (Proposition 3.9), and the extreme points of sub-polytopes are enumerated in closed form
rather than by a hull code. Two-finger pairs, all adjacent, are counted and not listed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from bench.peer_outline import (
    Bools,
    Floats,
    Geometries,
    Ints,
    Outline,
    common_cone,
    direction,
    edge_pairs,
    groups,
    runs,
)
from bench.peer_parallel import (
    Meets,
    Polytopes,
    extreme_points,
    mixed_pairs,
    parallel_pairs,
    parallel_sets,
    two_finger_spans,
)
from regrasp_lp.polygon import Polygon

REACH = 1e3
"""Cones are cut off at so many sizes of the object: cells farther away are lost."""
SLIVER = 1e-12
"""Of the size of the object squared: a cell of less area is no cell."""


@dataclass(frozen=True)
class PeerGraph:
    """Edges of the sets of each kind, and adjacent pairs as rows (i, j) through all sets.

    Sets are numbered two-finger, concurrent, parallel. Pairs of two-finger sets, all adjacent, are
    not listed.
    """

    two_finger: Ints
    concurrent: Ints
    parallel: Ints
    centers: Ints
    pairs: Ints

    @property
    def n_sets(self) -> int:
        return len(self.two_finger) + len(self.concurrent) + len(self.parallel)

    @property
    def n_edges(self) -> int:
        n = len(self.two_finger)
        return len(self.pairs) + n * (n - 1) // 2


def interiors_meet(one: Geometries, other: Geometries) -> Bools:
    """Whether regions have more than boundary points in common: right, and slower by far."""
    return np.asarray(shapely.relate_pattern(one, other, "T********"))


def peer_graph(
    polygon: Polygon,
    theta: float,
    polytopes: Polytopes = extreme_points,
    meets: Meets = shapely.intersects,
) -> PeerGraph:
    """Compute the chapter's graph: its sets, its focus rule, a hand of four fingers.

    `theta` is the half-angle of all friction cones, below 45°; `polytopes` finds the extreme points
    of the sub-polytopes; `meets` tells whether two regions, the first of them prepared, do. By
    default it is the fastest predicate, which takes regions that only touch for adjacent ones;
    `interiors_meet` is the chapter's condition.
    """
    outline = Outline.of(polygon, theta)
    two_finger, pair_cells = two_finger_sets(outline)
    concurrent, triple_cells = concurrent_sets(outline)
    parallel = parallel_sets(outline, polytopes)
    cells = np.concatenate((pair_cells, triple_cells))
    shapely.prepare(cells)
    first = len(two_finger)
    second = first + len(concurrent)
    pairs = [
        meeting(cells, sharing_two(concurrent, outline.n) + first, meets),
        meeting(
            cells, sharing_one(two_finger, concurrent, outline.n) + np.array([0, first]), meets
        ),
        parallel_pairs(parallel, outline.n, meets) + second,
        mixed_pairs(two_finger, two_finger_spans(outline, two_finger), parallel, outline.n)
        + np.array([0, second]),
    ]
    return PeerGraph(
        two_finger, concurrent, parallel.edges, parallel.centers, np.concatenate(pairs)
    )


# --- concurrent and two-finger sets (3.3.1.1, 3.3.1.2, 3.3.4.1, 3.3.4.2) --------------------------


def concurrent_sets(outline: Outline) -> tuple[Ints, Geometries]:
    """Triples whose focus cell has an area, edges ascending, and their cells."""
    triples = concurrent_candidates(outline)
    swept = double_sweeps(outline)
    shapely.prepare(swept)
    key, which = np.unique(triples[:, 0] * outline.n + triples[:, 1], return_inverse=True)
    both = shapely.intersection(swept[key // outline.n], swept[key % outline.n])
    met = np.flatnonzero(shapely.intersects(swept[triples[:, 2]], both[which]))
    triples, which = triples[met], which[met]
    cells = shapely.intersection(both[which], swept[triples[:, 2]])
    real = shapely.area(cells) > SLIVER * outline.size**2
    return triples[real], cells[real]


def concurrent_candidates(outline: Outline) -> Ints:
    """Triples whose normals θ-positively span: each is ahead of the last by less than π − 2θ."""
    n, most = outline.n, np.pi - 2 * outline.theta
    i, j = np.triu_indices(n, 1)
    # In the order of edges i < j < k the normals turn one way or the other.
    found = []
    for one, other in ((i, j), (j, i)):
        step = outline.ahead(one, other)
        near = step < most
        low, high = i[near], j[near]
        pair = np.arange(len(low)).repeat(n - 1 - high)
        k = runs(high + 1, n - 1 - high)
        second = outline.ahead(other[near][pair], k)
        third = 2 * np.pi - step[near][pair] - second
        good = (second < most) & (third < most) & (third > 0)
        found.append(np.stack((low[pair], high[pair], k), axis=1)[good])
    triples = np.concatenate(found)
    return triples[np.lexsort(triples.T[::-1])]


def double_sweeps(outline: Outline) -> Geometries:
    """The union of all double-sided cones of an edge: one polygon of six corners each."""
    far = REACH * outline.size
    right = far * direction(outline.angles - outline.theta)
    left = far * direction(outline.angles + outline.theta)
    a, b = outline.starts, outline.ends
    corners = np.stack((a, a - right, b - left, b, b + right, a + left), axis=1)
    return np.asarray(shapely.polygons(corners))


def two_finger_sets(outline: Outline) -> tuple[Ints, Geometries]:
    """Pairs of opposed edges whose cell has an area, and their cells on opposite sides."""
    i, j = np.triu_indices(outline.n, 1)
    opposed = np.abs(outline.ahead(i, j) - np.pi) < 2 * outline.theta
    pairs = np.stack((i, j), axis=1)[opposed]
    right, left = common_cone(outline, pairs[:, 1], pairs[:, [0]])
    inner = [sweep(outline, pairs[:, k], s * right, s * left) for k, s in ((0, 1), (1, -1))]
    outer = [sweep(outline, pairs[:, k], -s * left, -s * right) for k, s in ((0, 1), (1, -1))]
    squeezed, expanded = shapely.intersection(*inner), shapely.intersection(*outer)
    areas = np.stack((shapely.area(squeezed), shapely.area(expanded)))
    # Edges do not cross: one of the two sides is empty.
    cells = np.where(areas[0] >= areas[1], squeezed, expanded)
    real = areas.max(axis=0) > SLIVER * outline.size**2
    return pairs[real], cells[real]


def sweep(outline: Outline, edges: Ints, first: Floats, last: Floats) -> Geometries:
    """The region between two rays, from the end of an edge and from its start."""
    a, b = outline.starts[edges], outline.ends[edges]
    far = REACH * outline.size
    return np.asarray(shapely.polygons(np.stack((a, b, b + far * first, a + far * last), axis=1)))


# --- switches (3.3.4.4) ---------------------------------------------------------------------------


def sharing_two(triples: Ints, n: int) -> Ints:
    """Pairs of triples with two common edges."""
    labels, owner = edge_pairs(triples, n)
    i, j = groups(labels)
    return np.stack((owner[i], owner[j]), axis=1)


def sharing_one(pairs: Ints, triples: Ints, n: int) -> Ints:
    """Two-finger sets and triples with a common edge or two."""
    order = np.argsort(pairs.ravel(), kind="stable")
    ranked = pairs.ravel()[order]
    first = np.searchsorted(ranked, triples.ravel())
    counts = np.searchsorted(ranked, triples.ravel(), side="right") - first
    triple = np.arange(triples.size).repeat(counts) // 3
    pair = order[runs(first, counts)] // 2
    key = np.unique(pair * max(len(triples), 1) + triple)
    return np.stack((key // max(len(triples), 1), key % max(len(triples), 1)), axis=1)


def meeting(cells: Geometries, pairs: Ints, meets: Meets) -> Ints:
    """Those pairs whose cells meet."""
    return pairs[meets(cells[pairs[:, 0]], cells[pairs[:, 1]])]
