"""Circuits: minimal positive dependencies ``Σ w_t d_t = 0`` of directions in the plane.

Three directions form one iff each two turn the same way round, two iff they are exactly opposite.
By Cramer the weights of three are the cross products of the other two.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.friction import BoolArray, Cones, FloatArray, IntArray, ObjectArray, SignArray


def circuits(turn: SignArray, opposite: BoolArray) -> IntArray:
    """Return the minimal positive dependencies of k directions in the plane.

    Parameters
    ----------
    turn : numpy.ndarray of int, shape (N, k, k)
        Sign of the cross product of every two directions.
    opposite : numpy.ndarray of bool, shape (N, k, k)
        Whether two directions are opposite.

    Returns
    -------
    numpy.ndarray of int, shape (N, J, 3)
        The members of each circuit; two of them and -1, or -1 throughout where there are fewer
        than J circuits.
    """
    k = turn.shape[1]
    triples = np.array(list(combinations(range(k), 3)), dtype=np.intp).reshape(-1, 3)
    pairs = np.array(list(combinations(range(k), 2)), dtype=np.intp)
    a, b, c = triples.T
    first = turn[:, a, b]
    three = (first != 0) & (turn[:, b, c] == first) & (turn[:, c, a] == first)
    circuit = np.concatenate((three, opposite[:, pairs[:, 0], pairs[:, 1]]), axis=1)
    members = np.concatenate((triples, np.pad(pairs, ((0, 0), (0, 1)), constant_values=-1)))
    width = int(circuit.sum(axis=1).max(initial=1))
    chosen = np.argsort(~circuit, axis=1, kind="stable")[:, :width]
    found = np.take_along_axis(circuit, chosen, axis=1)
    return np.where(found[..., None], members[chosen], -1)


def circuit_weights(cones: Cones, ray: IntArray) -> FloatArray:
    """Return the weights of circuits on rays of length 1: the sine of the other two, or 1 and 1.

    Parameters
    ----------
    cones : Cones
    ray : numpy.ndarray of int, shape (..., 3)
        Numbers of rays; -1 for none. Which of the two ways a ray is passed does not matter.

    Returns
    -------
    numpy.ndarray, shape (..., 3)
        0 for none.
    """
    a, b, c = ray[..., 0], ray[..., 1], ray[..., 2]
    three = np.stack((cones.sine[b, c], cones.sine[c, a], cones.sine[a, b]), axis=-1)
    two = np.broadcast_to([1.0, 1.0, 0.0], three.shape)
    weight = np.where((c >= 0)[..., None], np.abs(three), two)
    return np.where((a >= 0)[..., None], weight, 0.0)


def exact_weights(cones: Cones, ray: IntArray, weight: FloatArray) -> ObjectArray:
    """Return integers proportional to the weights of functions on `cones.exact_rays`.

    Parameters
    ----------
    cones : Cones
    ray : numpy.ndarray of int, shape (K, 3)
    weight : numpy.ndarray, shape (K, 3)
        Only the signs are read, and only where both forces act along one ray.

    Returns
    -------
    numpy.ndarray of object (int), shape (K, 3)
    """
    e1, e2, e3 = (cones.exact_rays[ray[:, t]] for t in range(3))
    turns = np.stack((cross(e2, e3), cross(e3, e1), cross(e1, e2)), axis=1)
    result = np.where(turns[:, 2:] < 0, -turns, turns)
    two = ray[:, 2] < 0
    along = two & (ray[:, 0] == ray[:, 1])
    opposite = np.stack((-_dot(e1, e2), _dot(e1, e1), 0 * e1[:, 0]), axis=1)
    signs = np.sign(weight).astype(int).astype(object)
    return np.where(along[:, None], signs, np.where(two[:, None], opposite, result))


def cross(p: NDArray[Any], q: NDArray[Any]) -> NDArray[Any]:
    """Return ``p × q`` of vectors in the plane, shape (..., 2), of floats or of integers."""
    result: NDArray[Any] = p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]
    return result


def _dot(p: NDArray[Any], q: NDArray[Any]) -> NDArray[Any]:
    result: NDArray[Any] = p[..., 0] * q[..., 0] + p[..., 1] * q[..., 1]
    return result
