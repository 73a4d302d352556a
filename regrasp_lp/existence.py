"""Which candidates have grasps, from all combinations of edges: no windows of sorted normals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from regrasp_lp.friction import BoolArray, Cones, FloatArray, IntArray, spanning
from regrasp_lp.grasp_sets.candidates import common_cone, complete_candidates
from regrasp_lp.grasp_sets.families import parallel_functions
from regrasp_lp.torque import TorqueFunctions, torque_functions

_CHUNK = 200_000


class Existence(NamedTuple):
    """Whether candidates of one kind have grasps.

    Parameters
    ----------
    functions : TorqueFunctions
    centers : numpy.ndarray of int, shape (N,)
    no_start, no_end : numpy.ndarray of bool, shape (N,)
        Whether no function is negative with all contacts at 0, none positive with all at 1.
    exactly : numpy.ndarray of bool, shape (N,)
        Whether integers were needed.
    """

    functions: TorqueFunctions
    centers: IntArray
    no_start: BoolArray
    no_end: BoolArray
    exactly: BoolArray

    @property
    def exist(self) -> BoolArray:
        """Whether neither keeps the set from existing."""
        return ~(self.no_start | self.no_end)


def existence(cones: Cones, kind: str) -> Existence:
    """Decide the existence of every candidate of one kind, from all combinations of edges.

    Parameters
    ----------
    cones : Cones
    kind : str

    Returns
    -------
    Existence
    """
    edges, centers = _every_candidate(cones, kind)
    if kind == "parallel":
        functions = parallel_functions(cones, edges, centers)
    else:
        functions = torque_functions(cones, edges)
    low, high = np.zeros(edges.shape), np.ones(edges.shape)
    exactly = _is_open(functions, low, -1) | _is_open(functions, high, 1)
    return Existence(
        functions,
        centers,
        ~functions.any_negative(low),
        ~functions.any_positive(high),
        exactly,
    )


def _is_open(functions: TorqueFunctions, fractions: FloatArray, sign: int) -> BoolArray:
    """Whether floating point leaves open if some function has a sign."""
    value = np.where(functions.valid, sign * functions.values(fractions), -np.inf)
    sure = (value > functions.errors).any(axis=1)
    return np.asarray(~sure & (value >= -functions.errors).any(axis=1))


def _every_candidate(cones: Cones, kind: str) -> tuple[IntArray, IntArray]:
    """Edges and centres of all candidates of one kind, in the order of the graph's sets."""
    n = cones.n_edges
    if kind == "three_finger":
        edges = complete_candidates(cones, 3)
    elif kind == "two_finger":
        pairs = np.stack(np.triu_indices(n, 1), axis=1)
        edges = pairs[spanning(cones, pairs)]
    elif kind == "concurrent":
        edges = np.concatenate([t[_concurrent(cones, t)] for t in _triples(n)])
    else:
        found = [_parallel(cones, t) for t in _triples(n)]
        rows = np.concatenate(found)
        return rows[:, :3], rows[:, 3]
    return edges, np.full(len(edges), -1)


def _triples(n: int) -> Iterator[IntArray]:
    """All triples of different edges, in chunks."""
    first, second = np.triu_indices(n, 1)
    step = max(1, _CHUNK // n)
    for start in range(0, len(first), step):
        a, b = first[start : start + step, None], second[start : start + step, None]
        c = np.arange(n)[None, :]
        one, other, third = np.broadcast_arrays(a, b, c)
        yield np.stack((one, other, third), axis=-1)[third > other]


def _concurrent(cones: Cones, triples: IntArray) -> BoolArray:
    """Whether in one cyclic order all rays of each edge are ahead of all of the one before."""
    result = np.zeros(len(triples), dtype=bool)
    for order in ((0, 1, 2), (0, 2, 1)):
        ahead = np.ones(len(triples), dtype=bool)
        for i in range(3):
            one, other = triples[:, order[i]], triples[:, order[(i + 1) % 3]]
            for side in (0, 1):
                for other_side in (0, 1):
                    ahead &= cones.cross_sign[2 * one + side, 2 * other + other_side] > 0
        result |= ahead
    return result


def _parallel(cones: Cones, triples: IntArray) -> IntArray:
    """Rows (a, b, c, centre) of the triples and centres whose common cone has an interior."""
    rows = []
    for i in range(3):
        order = [i, *(k for k in range(3) if k != i)]
        kept = triples[common_cone(cones, triples[:, order]).exists]
        rows.append(np.column_stack((kept, kept[:, i])))
    every = np.concatenate(rows)
    return every[np.lexsort(every.T[::-1])]
