"""Combinations of edges that may have a grasp set, as arrays.

The complete candidates are all pairs and triples. Those of the chapter come from the normals
sorted by angle (sections 3.3.4.1 to 3.3.4.3): each chosen normal leaves a window for the next. The
windows are opened a little, so that rounding loses nothing, and what they let in is then decided
by exact signs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.friction import BoolArray, Cones, FloatArray, IntArray, spanning

_SLACK = 1e-9
_CHUNK = 200_000


def complete_candidates(cones: Cones, m: int) -> IntArray:
    """Return all combinations of m edges whose boundary rays span the plane.

    An edge may occur twice (three times never spans). Edges ascend within a row and rows ascend.

    Parameters
    ----------
    cones : Cones
    m : int
        2 or 3.

    Returns
    -------
    numpy.ndarray of int, shape (N, m)
    """
    n = cones.n_edges
    first, second = np.triu_indices(n)
    if m == 2:
        pairs = np.stack((first, second), axis=1)
        return pairs[spanning(cones, pairs)]
    kept: list[IntArray] = [np.zeros((0, m), dtype=np.intp)]
    step = max(1, _CHUNK // max(n, 1))
    for start in range(0, len(first), step):
        a, b = first[start : start + step], second[start : start + step]
        counts = n - b
        triples = np.stack((a.repeat(counts), b.repeat(counts), runs(b, counts)), axis=1)
        kept.append(triples[spanning(cones, triples)])
    return np.concatenate(kept)


def two_finger_candidates(cones: Cones) -> IntArray:
    """Return all pairs of edges with ``C_a ∩ -C_b`` of non-empty interior (3.3.4.2).

    Their normals are opposed within θ_a + θ_b, and their rays span the plane.

    Parameters
    ----------
    cones : Cones

    Returns
    -------
    numpy.ndarray of int, shape (N, 2)
        Edges ascend within a row and rows ascend.
    """
    circle = _NormalCircle(cones)
    width = circle.theta + circle.widest
    first, second = circle.windows(np.arange(cones.n_edges), np.pi - width, np.pi + width)
    pairs = np.stack((first, second), axis=1)[first < second]
    return _sorted_rows(pairs[spanning(cones, pairs)])


def concurrent_candidates(cones: Cones) -> IntArray:
    """Return all triples of edges whose normals θ-positively span the plane (3.3.4.1).

    In cyclic order, every boundary ray of one cone and every one of the next have a positive cross
    product: each normal follows the one before by less than ``π - θ - θ'``.

    Parameters
    ----------
    cones : Cones

    Returns
    -------
    numpy.ndarray of int, shape (N, 3)
        Edges ascend within a row and rows ascend.
    """
    circle = _NormalCircle(cones)
    least = circle.theta.min(initial=np.pi / 2)
    widest = np.pi - circle.theta - least
    i, j = circle.windows(np.arange(cones.n_edges), circle.theta + least, widest)
    i, j = i[i < j], j[i < j]
    # The third normal follows the second, and is followed by the first, in the same way.
    behind = 2 * np.pi - widest[i] - np.mod(circle.angle[j] - circle.angle[i], 2 * np.pi)
    pair, k = circle.windows(j, np.maximum(behind, circle.theta[j] + least), widest[j])
    triples = np.stack((i[pair], j[pair], k), axis=1)[i[pair] < k]
    follows = np.ones(len(triples), dtype=bool)
    for one, other in ((0, 1), (1, 2), (2, 0)):
        for side in (0, 1):
            for other_side in (0, 1):
                rays = 2 * triples[:, one] + side, 2 * triples[:, other] + other_side
                follows &= cones.cross_sign[rays] > 0
    return _sorted_rows(np.sort(triples[follows], axis=1))


def parallel_candidates(cones: Cones) -> tuple[IntArray, IntArray]:
    """Return all (a; b, c) with ``-C_a ∩ C_b ∩ C_c`` of non-empty interior (3.3.4.3).

    The normals of b and c differ by less than θ_b + θ_c (the chapter's window of θ is too narrow),
    and each is opposed to that of the centre a within the sum of their half-angles.

    Parameters
    ----------
    cones : Cones

    Returns
    -------
    edges : numpy.ndarray of int, shape (N, 3)
        Edges ascend within a row and rows ascend.
    centers : numpy.ndarray of int, shape (N,)
        The centre edge a. For μ > 1 a triple can have several.
    """
    circle = _NormalCircle(cones)
    width = circle.theta + circle.widest
    b, c = circle.windows(np.arange(cones.n_edges), -width, width)
    b, c = b[b < c], c[b < c]
    pair, a = circle.windows(b, np.pi - width[b], np.pi + width[b])
    triples = np.stack((a, b[pair], c[pair]), axis=1)
    # of segments, too, all three have to be on different edges
    edge = cones.edge[triples]
    triples = triples[(edge != edge[:, [1, 2, 0]]).all(axis=1)]
    triples = triples[common_cone(cones, triples).exists]
    rows = _sorted_rows(np.column_stack((np.sort(triples, axis=1), triples[:, 0])))
    return rows[:, :3], rows[:, 3]


@dataclass(frozen=True, eq=False)
class CommonCones:
    """Common cones ``C = -C_a ∩ C_b ∩ C_c`` of N triples with centre a (section 3.3.1.3).

    Parameters
    ----------
    exists : numpy.ndarray of bool, shape (N,)
        Whether the interior is non-empty, exactly.
    ray : numpy.ndarray of int, shape (N, 2)
        Number of the ray along the clockwise and the counter-clockwise boundary.
    sign : numpy.ndarray of int, shape (N, 2)
        -1 where the boundary runs against that ray.
    """

    exists: BoolArray
    ray: IntArray
    sign: IntArray

    def boundaries(self, cones: Cones) -> FloatArray:
        """Return unit vectors along both boundaries, shape (N, 2, 2)."""
        return np.asarray(cones.unit_rays[self.ray] * self.sign[..., None])


def common_cone(cones: Cones, triples: IntArray) -> CommonCones:
    """Return the common cones of triples (a, b, c) with centre a, by exact signs.

    Each of the three cones is an arc of less than π. Their intersection starts at the clockwise
    end of one of them that lies in all, and stops at the first counter-clockwise end.

    Parameters
    ----------
    cones : Cones
    triples : numpy.ndarray of int, shape (N, 3)
        The centre first.

    Returns
    -------
    CommonCones
    """
    sign = np.array([-1, 1, 1])
    starts, ends = 2 * triples, 2 * triples + 1
    signs = np.outer(sign, sign)

    def turn(r: IntArray, s: IntArray) -> NDArray[np.int8]:
        """Signs of the cross products of boundary r_i with s_j, shape (N, 3, 3)."""
        return np.asarray(signs * cones.cross_sign[r[:, :, None], s[:, None, :]], dtype=np.int8)

    opposed = cones.opposite[starts[:, :, None], starts[:, None, :]]
    same = (turn(starts, starts) == 0) & (opposed == (signs < 0))
    within = (turn(starts, starts) < 0) & (turn(starts, ends) > 0)
    first = (same | within).all(axis=2)
    last = (turn(ends, ends) >= 0).all(axis=2)
    chosen = np.stack((first.argmax(axis=1), last.argmax(axis=1)), axis=1)
    ray = np.take_along_axis(triples, chosen, axis=1) * 2 + np.array([0, 1])
    return CommonCones(first.any(axis=1), ray, sign[chosen])


class _NormalCircle:
    """The normals of all edges on the circle, sorted by angle."""

    def __init__(self, cones: Cones) -> None:
        x, y = cones.vectors.T
        self.angle: FloatArray = np.mod(np.arctan2(x, -y), 2 * np.pi)
        self.theta: FloatArray = np.arctan(cones.friction)
        self.widest = self.theta.max(initial=0.0)
        self._order = np.argsort(self.angle, kind="stable")
        once = self.angle[self._order]
        self._around = np.concatenate((once - 2 * np.pi, once, once + 2 * np.pi))

    def windows(
        self, edges: IntArray, least: FloatArray, most: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return all (row, edge) whose normal is ahead of that of ``edges[row]`` by a window.

        `least` and `most` are angles from -π to 2π, one per row of `edges`. Where `edges` are all
        edges in order, a row is an edge.
        """
        origin = self.angle[edges]
        first = np.searchsorted(self._around, origin + least - _SLACK)
        last = np.searchsorted(self._around, origin + most + _SLACK)
        counts = np.maximum(last - first, 0)
        rows = np.arange(len(edges)).repeat(counts)
        return rows, self._order[runs(first, counts) % len(self.angle)]


def runs(starts: IntArray, counts: IntArray) -> IntArray:
    """Concatenate ``start, start + 1, …`` of `counts` numbers each.

    Examples
    --------
    >>> runs(np.array([5, 0]), np.array([2, 3])).tolist()
    [5, 6, 0, 1, 2]
    """
    ends = np.cumsum(counts)
    total = int(ends[-1]) if ends.size else 0
    return np.arange(total) + (starts - ends + counts).repeat(counts)


def _sorted_rows(rows: IntArray) -> IntArray:
    return rows[np.lexsort(rows.T[::-1])]
