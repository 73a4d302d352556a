"""Where the sets of a switching graph stand in its pictures.

Every component has a square of its own, its area proportional to the number of sets, the largest
first; inside, sets that can switch attract each other and all repel each other. The layout is the
same every time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from regrasp_lp.friction import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from regrasp_lp.switching_graph import SwitchingGraph

BETWEEN = 0.035
"""Room over a row of squares for their sizes, in widths of all."""

NAMED_FROM = 0.08
"""Squares from this part of the width on have their size written over them."""

_FORCED = 4_000  # larger components are laid out by eigenvectors alone
_ROUND = 6  # components up to this size start from a circle
_EFFORT = 120_000  # sets times steps of the layout by forces


@dataclass(frozen=True, eq=False)
class GraphLayout:
    """Components, their squares, and the places of sets.

    Parameters
    ----------
    components : tuple of numpy.ndarray of int
        The sets of each, largest first.
    squares : numpy.ndarray, shape (K, 3)
        Left, bottom and side of the square of each; the first row begins at (0, 0), below it.
    positions : numpy.ndarray, shape (N, 2)
        Where each grasp set stands.
    listed : numpy.ndarray of int, shape (L, 2)
        The pairs of sets that have to hold contacts in common and can.
    """

    components: tuple[IntArray, ...]
    squares: FloatArray
    positions: FloatArray
    listed: IntArray


def lay_out(graph: SwitchingGraph) -> GraphLayout:
    """Return where the sets of a graph stand.

    Parameters
    ----------
    graph : SwitchingGraph

    Returns
    -------
    GraphLayout
    """
    components = tuple(np.array(sorted(c), dtype=np.intp) for c in graph.components())
    listed, hubs = listed_switches(graph), _joined_to_all(graph)
    squares = _squares([len(c) for c in components])
    positions = np.zeros((len(graph), 2))
    for members, square in zip(components, squares, strict=True):
        unit = _in_unit_square(members, listed, hubs)
        positions[members] = square[:2] + square[2] * (0.07 + 0.86 * unit)
    return GraphLayout(components, squares, positions, listed)


def listed_switches(graph: SwitchingGraph) -> IntArray:
    """Return the pairs of sets that have to hold contacts in common and can, shape (K, 2)."""
    adjacent, contacts = graph.hand.adjacent, graph.sets.contacts
    chunks = [np.zeros((0, 2), dtype=np.intp)]
    for pairs in graph.switches.pairs():
        i, j = pairs.first, pairs.second
        holds = ~adjacent[contacts[i], contacts[j]]
        chunks.append(np.unique(np.stack((i[holds], j[holds]), axis=1), axis=0))
    return np.asarray(np.unique(np.concatenate(chunks), axis=0))


def _joined_to_all(graph: SwitchingGraph) -> BoolArray:
    """Which sets are adjacent to all of some number of contacts, shape (N,)."""
    adjacent, contacts = graph.hand.adjacent, graph.sets.contacts
    return np.asarray(adjacent[contacts][:, np.unique(contacts)].any(axis=1))


def _squares(sizes: Sequence[int]) -> FloatArray:
    """Squares of components, largest first, in rows: left, bottom and side of each."""
    sides = np.sqrt(np.array(sizes, dtype=np.float64))
    width = max(sides.max(initial=0.0), np.sqrt(1.25 * np.sum(sizes)))
    squares, x, y = np.zeros((len(sizes), 3)), 0.0, 0.0
    for k, side in enumerate(sides):
        if x > 0 and x + side > 1.001 * width:
            x, y = 0.0, y - (BETWEEN * width if side >= NAMED_FROM * width else 0.0)
        if x == 0:
            y -= side  # of a row the first square is the largest
        squares[k] = x, y, side
        x += side
    return squares


def _in_unit_square(members: IntArray, listed: IntArray, hubs: BoolArray) -> FloatArray:
    """Positions of one component from 0 to 1; sets adjacent to all others are joined to a hub."""
    n = len(members)
    if n == 1:
        return np.full((1, 2), 0.5)
    local = np.full(len(hubs), -1)
    local[members] = np.arange(n)
    pairs = local[listed]
    pairs = pairs[pairs[:, 0] >= 0]
    joined = np.flatnonzero(hubs[members])
    pairs = np.concatenate((pairs, np.stack((joined, np.full(len(joined), n)), axis=1)))
    n_points = n + bool(len(joined))
    ones = np.ones(len(pairs))
    half = sparse.csr_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(n_points, n_points))
    adjacency = sparse.csr_array(half + half.T)
    x = _by_eigenvectors(adjacency)
    if n_points <= _FORCED:
        x = _by_forces(adjacency, x)
    x = x[:n] - np.median(x[:n], axis=0)
    far = np.maximum(np.hypot(*x.T), 1e-12)[:, None]
    x = x / far * np.log1p(far / np.median(far))  # what is far out is drawn in
    extent = np.ptp(x, axis=0)
    return np.asarray(0.5 + (x - x.min(axis=0) - extent / 2) / np.maximum(extent, extent.max() / 2))


def _by_eigenvectors(adjacency: sparse.csr_array) -> FloatArray:
    """Positions about 0 of size 1 by the second and third eigenvector of the random walk."""
    n = adjacency.shape[0]
    random = np.random.default_rng(0)
    if n <= _ROUND:
        turn = 2 * np.pi * np.arange(n) / n
        return np.stack((np.cos(turn), np.sin(turn)), axis=1)
    root = np.sqrt(adjacency.sum(axis=1))
    walk = sparse.csr_array(adjacency / root[:, None] / root[None, :])
    _, vectors = eigsh(walk, k=3, which="LA", v0=random.normal(size=n), tol=1e-2)
    x = vectors[:, [1, 0]] / root[:, None]
    ranks = x.argsort(axis=0, kind="stable").argsort(axis=0) / n - 0.5
    return np.asarray(x / np.abs(x).max(axis=0) + ranks + 0.01 * random.normal(size=x.shape))


def _by_forces(adjacency: sparse.csr_array, start: FloatArray) -> FloatArray:
    """Fruchterman and Reingold's layout: neighbours attract, all repel, steps get shorter."""
    n, x = len(start), np.ascontiguousarray(start.T, dtype=np.float32)
    i, j = sparse.coo_array(adjacency).coords
    spacing = np.float32(1 / np.sqrt(n))
    steps = int(np.clip(_EFFORT / n, 50, 200))
    for length in np.linspace(0.1, 0.0, steps, endpoint=False, dtype=np.float32):
        push, across = (np.subtract.outer(along, along) for along in x)
        push *= push
        push += np.square(across, out=across)
        np.divide(spacing**2, np.maximum(push, 1e-4 * spacing**2, out=push), out=push)
        # einsum and no matrix product, whose threads are slow on a busy machine
        force = push.sum(axis=1) * x - np.stack([np.einsum("ij,j->i", push, v) for v in x])
        pull = x[:, i] - x[:, j]
        pull *= np.hypot(*pull) / spacing
        force -= np.stack([np.bincount(i, along, minlength=n) for along in pull])
        x += force * (length / np.maximum(np.hypot(*force), 1e-12))
    return np.asarray(x.T, dtype=np.float64)
