"""Contact wrenches: their determinants, in floating point with a bound and in integers.

A contact at ``p = a + f T`` of the edge from ``a`` along ``T = b - a`` presses with the two
boundary rays ``e = rot90(T) ± μ T`` of its friction cone, and each ray has the wrench
``w = (e, p × e)``. The contacts are in *force closure* iff their wrenches positively span R³.

**The test.** Wrenches that span R³ positively span it iff no ``y ≠ 0`` has ``y·w_k >= 0`` for all
k. The cone of such y is pointed, because the wrenches span, so if it has a point besides 0 it has
an extreme ray, which is tight at two linearly independent wrenches: ``y = ±(w_i × w_j)``. Hence
the contacts are in force closure iff some determinant ``det(w_i, w_j, w_k)`` is not zero and for
every pair (i, j) the determinants over all k have both signs or (dependent pair) are all zero.
Only signs of 3 × 3 determinants are needed, and these are polynomials in the input numbers.

**Signs.** Vertices, fractions and μ are the doubles they are, read as rationals. All determinants
are first evaluated in floating point with a proved error bound (`float_determinants`); a grasp
whose verdict depends on a sign that the bound leaves open is evaluated again in integers
(`exact_determinants`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.polygon import Polygon

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]
ObjectArray = NDArray[np.object_]


def decide(polygon: Polygon, mu: FloatArray, edges: IntArray, fractions: FloatArray) -> BoolArray:
    """Decide force closure of a chunk of grasps: in floating point, then in integers.

    Parameters
    ----------
    polygon : Polygon
    mu : numpy.ndarray, shape (n_edges,)
    edges, fractions : numpy.ndarray, shape (N, m)
        Valid edges, and fractions in [0, 1]. All determinants are held at once: keep N small.

    Returns
    -------
    numpy.ndarray of bool, shape (N,)
    """
    n_rays = 2 * edges.shape[1]
    if n_rays < 4:  # one contact pushes into a half-plane only
        return np.zeros(len(edges), dtype=np.bool_)
    with np.errstate(under="ignore"):
        determinants, bound = float_determinants(polygon, mu, edges, fractions)
    positive, negative = determinants > bound, determinants < -bound
    has_positive, has_negative = signs_per_pair(n_rays, positive, negative)
    both = has_positive & has_negative
    yes: BoolArray = np.logical_and.reduce(both)
    # A pair refutes force closure if all its signs are known and only one of them occurs.
    known = positive | negative
    known_pairs = known[_layout(n_rays).members].all(axis=1)
    no = (known_pairs & ~both).any(axis=0)
    open_rows = np.flatnonzero(~(yes | no))
    if open_rows.size:
        yes[open_rows] = decide_exactly(polygon, mu, edges[open_rows], fractions[open_rows])
    return yes


def decide_exactly(
    polygon: Polygon, mu: FloatArray | None, edges: IntArray, fractions: FloatArray
) -> BoolArray:
    """Decide force closure in integers only; ``mu = None`` stands for the limit μ → ∞."""
    determinants = exact_determinants(polygon, mu, edges, fractions)
    n_rays = (3 if mu is None else 2) * edges.shape[1]
    positive = (determinants > 0).astype(np.bool_)
    negative = (determinants < 0).astype(np.bool_)
    return closure_from_signs(n_rays, positive, negative)


@dataclass(frozen=True)
class _Layout:
    """Which pairs and triples there are among r rays, and which triples contain a pair.

    Attributes
    ----------
    first, second : index of the rays of each pair (i < j).
    rays : three arrays, the rays i < j < k of each triple.
    opposite : three arrays, the pairs (j, k), (i, k), (i, j) of each triple.
    members, flipped : arrays of shape (pairs, r − 2); ``det(w_i, w_j, w_k)`` of a pair (i, j) and
        the other rays k: the triple, and whether its sign is turned round by the order of rays.
    """

    first: IntArray
    second: IntArray
    rays: tuple[IntArray, IntArray, IntArray]
    opposite: tuple[IntArray, IntArray, IntArray]
    members: IntArray
    flipped: BoolArray


@lru_cache(maxsize=16)
def _layout(n_rays: int) -> _Layout:
    pairs = list(combinations(range(n_rays), 2))
    pair_number = {pair: number for number, pair in enumerate(pairs)}
    triples = list(combinations(range(n_rays), 3))
    triple_number = {triple: number for number, triple in enumerate(triples)}

    def of_pair(i: int, j: int) -> Iterator[tuple[int, bool]]:
        for k in range(n_rays):
            if k not in (i, j):
                a, b, c = sorted((i, j, k))
                yield triple_number[a, b, c], i < k < j

    table = [list(of_pair(i, j)) for i, j in pairs]

    def column(values: Iterable[int]) -> IntArray:
        return np.array(list(values), dtype=np.intp)

    return _Layout(
        first=column(i for i, _ in pairs),
        second=column(j for _, j in pairs),
        rays=(
            column(i for i, _, _ in triples),
            column(j for _, j, _ in triples),
            column(k for _, _, k in triples),
        ),
        opposite=(
            column(pair_number[j, k] for _, j, k in triples),
            column(pair_number[i, k] for i, _, k in triples),
            column(pair_number[i, j] for i, j, _ in triples),
        ),
        members=np.array([[t for t, _ in row] for row in table], dtype=np.intp),
        flipped=np.array([[flip for _, flip in row] for row in table], dtype=np.bool_),
    )


def _determinants(ex: NDArray[Any], ey: NDArray[Any], torque: NDArray[Any]) -> NDArray[Any]:
    """Return det(w_i, w_j, w_k) of all rays i < j < k; (rays, N) -> (triples, N), any dtype."""
    layout = _layout(len(ex))
    first, second = layout.first, layout.second
    cross = ex[first] * ey[second] - ey[first] * ex[second]
    i, j, k = layout.rays
    jk, ik, ij = layout.opposite
    value: NDArray[Any] = torque[i] * cross[jk] - torque[j] * cross[ik] + torque[k] * cross[ij]
    return value


def signs_per_pair(
    n_rays: int, positive: BoolArray, negative: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Tell for each pair of rays whether its determinants have a positive, a negative one."""
    layout = _layout(n_rays)
    both = np.concatenate([positive, negative])
    n_triples = len(positive)
    up = layout.members + n_triples * layout.flipped
    down = layout.members + n_triples * ~layout.flipped
    return np.logical_or.reduce(both[up], axis=1), np.logical_or.reduce(both[down], axis=1)


def closure_from_signs(n_rays: int, positive: BoolArray, negative: BoolArray) -> BoolArray:
    """Decide force closure from the signs of all determinants of contact wrenches.

    Parameters
    ----------
    n_rays : int
        Number of rays r >= 3 (two per contact).
    positive, negative : numpy.ndarray of bool, shape (triples, N)
        Whether ``det(w_i, w_j, w_k)`` is > 0, < 0, for the triples i < j < k of rays in
        lexicographic order.

    Returns
    -------
    numpy.ndarray of bool, shape (N,)
    """
    has_positive, has_negative = signs_per_pair(n_rays, positive, negative)
    # A pair whose determinants are all zero is dependent, as soon as the rank is 3.
    rank_three = has_positive.any(axis=0) | has_negative.any(axis=0)
    closed: BoolArray = rank_three & (has_positive == has_negative).all(axis=0)
    return closed


def float_determinants(
    polygon: Polygon, mu: FloatArray, edges: IntArray, fractions: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return all determinants of contact wrenches, and a bound on their errors.

    Rays are scaled by powers of two (exact, and no sign changes): coordinates so that the largest
    is in [1/2, 1), each T so that its larger component is, each ray by the power of two next
    above 1 + μ. Torques are taken about the start of the first contact's edge.

    Proof of the bound, u = 2⁻⁵³ the unit roundoff. A value computed by +, −, × from leaves is the
    exact polynomial with each monomial multiplied by a product of factors (1 + δ), |δ| <= u, one
    for each rounding that the monomial passes. If no monomial passes more than K, the error is at
    most ((1 + u)^K − 1) P, where P is the polynomial with all leaves and signs made positive.
    Leaves: f, μ, ``T = b − a`` and ``d = a − o``, the last two with 1 rounding each. Then
    ``e = rot90(T) ± μ T`` passes 3, ``p = d + f T`` passes 3, ``p × e`` 8, ``e × e'`` 8, their
    product 17 and the sum of three products 19: K = 19, (1 + u)^19 − 1 < 20 u. With the scaling,
    the vector of absolute values of a ray has a length <= √2 (components of T at most 1, and
    (1 + μ)/2^k <= 1), and that of p at most R, the largest |d|₁ + |T|₁ of the contacts; so
    each of the three products is at most R √2³ and P <= 3 · 2.83 R < 8.5 R. The error is below
    20 u · 8.5 R = 170 u R; 256 u R = 2⁻⁴⁵ R leaves room for rounding in R itself. An underflow
    adds at most 2⁻¹⁰⁷⁴ per operation, times factors whose product is below 2¹²: all together far
    less than 1e-300. Coordinates that the scaling itself would round (a range beyond 2¹⁰⁰⁰) get
    an infinite bound.

    Returns
    -------
    determinants : numpy.ndarray, shape (triples, N)
    bound : numpy.ndarray, shape (N,)
    """
    n_grasps, m = edges.shape
    starts, ends = polygon.edge_starts, polygon.edge_ends
    exponent = int(np.frexp(np.abs(starts).max())[1])
    used, index = np.unique(edges, return_inverse=True)
    index = index.reshape(n_grasps, m).T
    start, end = np.ldexp(starts[used], -exponent), np.ldexp(ends[used], -exponent)
    lossless = np.array_equal(np.ldexp(start, exponent), starts[used]) and np.array_equal(
        np.ldexp(end, exponent), ends[used]
    )
    along = end - start
    unit = np.ldexp(along, -np.frexp(np.abs(along).max(axis=1))[1][:, None])
    shift = -np.frexp(1.0 + mu[used])[1][:, None]
    normal = np.ldexp(np.stack([-unit[:, 1], unit[:, 0]], axis=1), shift)
    tangent = np.ldexp(mu[used, None], shift) * unit
    rays = np.stack([normal + tangent, normal - tangent])  # (2, used, 2)

    ex, ey = rays[:, index, 0], rays[:, index, 1]  # (2, m, N)
    offset = start[index] - start[index[0]]  # (m, N, 2)
    reach = np.abs(offset).sum(axis=2) + np.abs(along).sum(axis=1)[index]
    point = offset + fractions.T[:, :, None] * along[index]
    torque = point[..., 0] * ey - point[..., 1] * ex
    shape = (2 * m, n_grasps)
    determinants = _determinants(ex.reshape(shape), ey.reshape(shape), torque.reshape(shape))
    bound = 2.0**-45 * reach.max(axis=0) + 1e-300
    return determinants, bound if lossless else np.full(n_grasps, np.inf)


def exact_determinants(
    polygon: Polygon, friction: FloatArray | None, edges: IntArray, fractions: FloatArray
) -> ObjectArray:
    """Return the determinants of all triples of contact wrenches as Python integers.

    Parameters
    ----------
    polygon : Polygon
    friction : numpy.ndarray, shape (n_edges,), or None
        μ of each edge; None stands for the limit μ → ∞ (three rays ``T``, ``-T``, ``rot90(T)``
        per contact).
    edges, fractions : numpy.ndarray, shape (N, m)

    Returns
    -------
    numpy.ndarray of object, shape (triples, N)
        Multiples of ``det(w_i, w_j, w_k)`` for the rays i < j < k in lexicographic order. Ray r of
        m contacts is ray ``r // m`` of contact ``r % m``. The factors are positive and depend on
        the edges of the contacts and on the whole call only: rows with the same edges are scaled
        alike, which makes differences of rows meaningful.
    """
    n_grasps, m = edges.shape
    used, index = np.unique(edges, return_inverse=True)
    index = index.reshape(n_grasps, m).T
    corners, _ = _scaled_integers(
        np.concatenate([polygon.edge_starts[used], polygon.edge_ends[used]])
    )
    # About the start of an edge, so that numbers stay small far from the origin.
    corners = corners - corners[0]
    start, along = corners[: len(used)], corners[len(used) :] - corners[: len(used)]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    if friction is None:
        rays = np.stack([along, -along, normal])
    else:
        ratios = [float(value).as_integer_ratio() for value in friction[used]]
        above = np.array([[p] for p, _ in ratios], dtype=object)
        below = np.array([[q] for _, q in ratios], dtype=object)
        rays = np.stack([normal * below + along * above, normal * below - along * above])
    numerators, unit = _scaled_integers(fractions.T)
    point = unit * start[index] + numerators[:, :, None] * along[index]
    ex, ey = rays[:, index, 0], rays[:, index, 1]
    torque = point[..., 0] * ey - point[..., 1] * ex
    shape = (len(rays) * m, n_grasps)
    return _determinants(ex.reshape(shape), ey.reshape(shape), torque.reshape(shape))


def _scaled_integers(values: FloatArray) -> tuple[ObjectArray, int]:
    """Return integers n and a power of two s with ``values == n / s`` exactly."""
    ratios = [value.as_integer_ratio() for value in values.ravel().tolist()]
    scale = max((q for _, q in ratios), default=1)  # all are powers of two
    integers = np.empty(len(ratios), dtype=object)
    integers[:] = [p * (scale // q) for p, q in ratios]
    return integers.reshape(values.shape), scale
