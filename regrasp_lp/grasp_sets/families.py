"""The torque functions of each kind of grasp set.

Complete sets, the chapter's two-finger sets and its concurrent sets are the circuits of their
combination. A parallel set with centre a has four functions ``(p_b - p_a) × d`` and
``(p_c - p_a) × d``, with d a boundary of the common cone.
"""

from __future__ import annotations

import numpy as np

from regrasp_lp.friction import Cones, FloatArray, IntArray, spanning
from regrasp_lp.grasp_sets.candidates import common_cone
from regrasp_lp.torque import TorqueFunctions


def parallel_functions(cones: Cones, edges: IntArray, centers: IntArray) -> TorqueFunctions:
    """Return the torque functions of the chapter's parallel sets.

    Parameters
    ----------
    cones : Cones
    edges : numpy.ndarray of int, shape (N, 3)
        Edges, all different.
    centers : numpy.ndarray of int, shape (N,)
        The centre edge, one of the three.

    Returns
    -------
    TorqueFunctions
        Four functions each: contact b with d_0 and d_1, then contact c with d_0 and d_1.

    Notes
    -----
    ``d`` need not be a boundary ray of the contacts that it acts at. Its scale is the length of
    the forces ``d`` and ``-d`` written in the boundary rays of their contacts.
    """
    n = len(edges)
    at_center = (edges == centers[:, None]).argmax(axis=1)
    sides = np.array([[1, 2], [0, 2], [0, 1]])[at_center]
    triples = np.column_stack((centers, np.take_along_axis(edges, sides, axis=1)))
    common = common_cone(cones, triples)
    slot = np.zeros((n, 4, 3), dtype=np.int8)
    ray = np.full((n, 4, 3), -1, dtype=np.int32)
    weight = np.zeros((n, 4, 3))
    scale = np.empty((n, 4))
    for column, (side, d) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        slot[:, column, 0], slot[:, column, 1] = sides[:, side], at_center
        ray[:, column, :2] = common.ray[:, d, None]
        weight[:, column, 0], weight[:, column, 1] = common.sign[:, d], -common.sign[:, d]
        of_side = _length_in_cone(cones, triples[:, 1 + side], common.ray[:, d], common.sign[:, d])
        of_center = _length_in_cone(cones, centers, common.ray[:, d], -common.sign[:, d])
        scale[:, column] = of_side + of_center
    return TorqueFunctions(cones, edges, spanning(cones, edges), slot, ray, weight, scale)


def _length_in_cone(cones: Cones, edges: IntArray, ray: IntArray, sign: IntArray) -> FloatArray:
    """Return α + β of the unit vector ``d = α e_0 + β e_1`` in the unit rays of a cone.

    ``α = (d × e_1) / (e_0 × e_1)`` and ``β = (e_0 × d) / (e_0 × e_1)``.
    """
    clockwise, counter = 2 * edges, 2 * edges + 1
    opening = cones.sine[clockwise, counter]
    along = cones.sine[ray, counter] + cones.sine[clockwise, ray]
    return np.asarray(sign * along / opening)
