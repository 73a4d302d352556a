"""What a grasp set is in contact space and in its projections: all between two convex bodies.

A grasp set is ``{min_j M_j < 0 < max_k M_k}``, and no torque function decreases along a coordinate:
the positions where no function is negative are a convex body at the far corner of the box, those
where none is positive one at the near corner, and the set is all that is between the two. The same
holds on every side of the box and in every projection. In the plane these are exactly the polygons
between an upper and a lower broken line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import TypeAlias

import numpy as np
from scipy.spatial import ConvexHull

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import BoolArray, FloatArray
from regrasp_lp.grasp_sets.collection import GraspSet
from regrasp_lp.grasp_sets.pieces import in_positions, order_rows
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.polytopes import corners

Rows: TypeAlias = FloatArray
"""Shape (K, 3): torque functions ``c + a x + b y`` with b >= 0, x and y from 0 to 1."""

_THIN = 1e-9  # what is thinner than this part of the box is not drawn
_COPLANAR = 1e-5  # of triangles in a box of unit sides


def body(grasp_set: GraspSet, sign: int) -> FloatArray:
    """Return the corners of the body, over positions, in which no torque function has a sign.

    Parameters
    ----------
    grasp_set : GraspSet
    sign : {1, -1}
        1 for the body at the near corner, -1 for that at the far corner.

    Returns
    -------
    numpy.ndarray, shape (K, m)
        As `corners`; empty where there is no such body.
    """
    torque, order = grasp_set.torque, order_rows(grasp_set.edges)
    rows = np.concatenate((sign * torque.slopes[0], order))[None]
    bounds = np.append(-sign * torque.offsets[0], np.zeros(len(order)))[None]
    box = np.zeros((1, torque.m)), np.ones((1, torque.m))
    sets = LinearSets(grasp_set.names, rows, np.ones(bounds.shape), bounds, *box)
    return corners(in_positions(sets, torque.lengths[0]))[0]


@dataclass(frozen=True, eq=False)
class Region:
    """Points of the unit square with ``max M > 0`` for each group `up`, ``min M < 0`` for `down`.

    Over x each group bounds y by a broken line. Between two x at which no two lines cross and none
    starts or ends, the same two lines bound the region.
    """

    up: tuple[Rows, ...]
    down: tuple[Rows, ...]

    def __and__(self, other: Region) -> Region:
        return Region(self.up + other.up, self.down + other.down)

    def polygons(self) -> list[FloatArray]:
        """Return its parts, counter-clockwise, each of shape (K, 2)."""
        x = self._cuts()
        at = np.stack((x[:-1], (x[:-1] + x[1:]) / 2, x[1:]), axis=1)
        low = _extreme([_extreme(_heights(r, at), -1) for r in self.up] + [0.0 * at], 1)
        high = _extreme([_extreme(_heights(r, at), 1) for r in self.down] + [0.0 * at + 1], -1)
        found: list[list[FloatArray]] = []
        previous = np.full(2, np.nan)  # least and greatest y at the right end of the slab before
        for k in np.flatnonzero(high[:, 1] - low[:, 1] > _THIN):
            lower = np.stack((at[k, ::2], low[k, ::2]), axis=1)
            upper = np.stack((at[k, ::2], high[k, ::2]), axis=1)
            joined = max(previous[0], low[k, 0]) < min(previous[1], high[k, 0])
            if not (joined and found and found[-1][0][-1, 0] == at[k, 0]):
                found.append([np.zeros((0, 2)), np.zeros((0, 2))])
            found[-1] = [np.concatenate(p) for p in zip(found[-1], (lower, upper), strict=True)]
            previous = np.array([low[k, 2], high[k, 2]])
        return [np.concatenate((lower, upper[::-1])) for lower, upper in found]

    def _cuts(self) -> FloatArray:
        """All x, from 0 to 1, where two of the lines cross or one is upright."""
        c, a, b = np.concatenate((*self.up, *self.down, [[0, 0, 1], [-1, 0, 1]])).T
        flat = _is_flat(c, a, b)
        p, q = -a[~flat] / b[~flat], -c[~flat] / b[~flat]
        with np.errstate(divide="ignore", invalid="ignore"):
            crossings = np.subtract.outer(q, q) / -np.subtract.outer(p, p)
            upright = -c[flat] / a[flat]
        x = np.concatenate((crossings.ravel(), upright))
        x = np.unique(np.append(x[(x > 0) & (x < 1)], [0.0, 1.0]))
        return np.append(x[:-1][np.diff(x) > _THIN], 1.0)


def _is_flat(c: FloatArray, a: FloatArray, b: FloatArray) -> BoolArray:
    """Whether functions ``c + a x + b y`` do not depend on y."""
    return b <= _THIN * np.maximum(np.abs(c), np.abs(a))


def _heights(rows: Rows, at: FloatArray) -> list[FloatArray]:
    """The y from which on each function is positive, at x (S, 3); where any or no y is, ±inf."""
    c, a, b = rows.T[:, :, None, None]
    value, flat = c + a * at, _is_flat(c, a, b)
    always = np.where(value[:, :, 1:2] > 0, -np.inf, np.inf)
    return list(np.where(flat, always, -value / np.where(flat, 1.0, b)))


def _extreme(lines: list[FloatArray], sign: int) -> FloatArray:
    """For each of S slabs the line (S, 3) that is greatest (1) or least (-1) in its middle."""
    stack = np.stack(lines)
    chosen = (sign * stack[:, :, 1]).argmax(axis=0)
    return np.asarray(stack[chosen, np.arange(len(chosen))])


def _rows(grasp_set: GraspSet, shown: Sequence[int], at: float) -> Rows:
    """The torque functions over one or two contacts, the others at one fraction of their edges."""
    torque = grasp_set.torque
    slopes = torque.slopes[0][torque.valid[0]]
    rest = [i for i in range(torque.m) if i not in shown]
    rows = np.zeros((len(slopes), 3))
    rows[:, 0] = torque.offsets[0][torque.valid[0]] + at * slopes[:, rest].sum(axis=1)
    rows[:, 1 : 1 + len(shown)] = slopes[:, shown]
    return rows


def shadows(grasp_set: GraspSet, held: Sequence[int]) -> list[Region]:
    """Return the projections of a set on held edges, over fractions, one for each way to match.

    Raises
    ------
    OptionError
        If the set has no contacts on these edges.
    """
    slots = permutations(range(grasp_set.torque.m), len(held))
    found = [
        Region((_rows(grasp_set, shown, 1.0),), (_rows(grasp_set, shown, 0.0),))
        for shown in slots
        if [grasp_set.edges[i] for i in shown] == list(held)
    ]
    if not found:
        raise OptionError(f"{grasp_set!r} has no contacts on the held edges {held}")
    return found


def side(grasp_set: GraspSet, shown: Sequence[int], at: float) -> Region:
    """Return a set over the fractions of two contacts, a third one at one end of its edge."""
    rows = _rows(grasp_set, shown, at)
    region = Region((rows,), (rows,))
    for step in order_rows(grasp_set.edges):
        a, b = step[list(shown)]
        row = np.array([[at * (step.sum() - a - b), a, b]])  # negative where in order
        region &= Region((), (row,)) if b >= 0 else Region((-row,), ())
    return region


def sides(grasp_set: GraspSet) -> list[FloatArray]:
    """Return the faces of a set of three contacts on the sides of the box, over positions."""
    faces = []
    for i, end in product(range(3), (0.0, 1.0)):
        shown = [k for k in range(3) if k != i]
        for polygon in side(grasp_set, shown, end).polygons():
            faces.append(np.insert(polygon, i, end, axis=1) * grasp_set.torque.lengths[0])
    return faces


def faces_of(points: FloatArray, lengths: FloatArray) -> list[FloatArray]:
    """Return the faces of the convex hull of points in space, each as a polygon.

    Parameters
    ----------
    points : numpy.ndarray, shape (K, 3)
    lengths : numpy.ndarray, shape (3,)
        Sides of a box about them: the unit of each coordinate.
    """
    hull = ConvexHull(points / lengths)
    left, faces = np.ones(len(hull.simplices), dtype=bool), []
    while left.any():
        plane = hull.equations[left.argmax()]
        on = left & (np.abs(hull.equations - plane) < _COPLANAR).all(axis=1)
        left &= ~on
        on_plane = hull.points[np.unique(hull.simplices[on])]
        spokes = on_plane - on_plane.mean(axis=0)
        across = np.cross(plane[:3], spokes[0])
        order = np.argsort(np.arctan2(spokes @ across, spokes @ spokes[0]))
        faces.append(on_plane[order] * lengths)
    return faces
