"""How good ε can be at best over boxes of contacts: branch and bound.

A contact that moves by d on its edge changes the torques of its two wrenches by the same ``d / ρ``:
the tangent of an edge has a cross product of 1 with a force of unit normal component. So over a box
of contacts, for every direction y, ``y·w`` is at most what it is in the middle and ``|y_τ| d / ρ``
more, and ε at most the support so enlarged. The directions tried are the normals of the hull in the
middle; any would give a bound. Where ε is limited by forces alone, ``y_τ = 0``, it is ε itself.
"""

from __future__ import annotations

import numpy as np

from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.collection import GraspSet
from regrasp_lp.quality.grasps import Grasps
from regrasp_lp.quality.hulls import Forces, TorqueScale, enlarged_supports, scale_of, wrenches_of

_ENOUGH = 1e-3  # of ε: boxes whose bound is above it by less are not divided
_MOST = 24_000  # boxes in all
_AT_ONCE = 2_000


def epsilon_bound(
    grasp_set: GraspSet, value: float, forces: Forces, torque_scale: TorqueScale
) -> float:
    """Return what the ε of no grasp of a set exceeds.

    Parameters
    ----------
    grasp_set : GraspSet
    value : float
        The ε of a grasp of the set.
    forces : {"sum", "each"}
    torque_scale : {"gyration", "distance"} or float

    Returns
    -------
    float
        At least `value`; more by a thousandth where the boxes that may be tried suffice for that.
        Else by some percent, or by whatever the boxes left are long: much, of very long edges.
    """
    scale = scale_of(grasp_set.polygon, torque_scale)
    m = len(grasp_set.edges)
    lengths = grasp_set.torque.lengths[0] / scale
    enough = value + _ENOUGH * abs(value)
    middles, halves = np.full((1, m), 0.5), np.full((1, m), 0.5)
    bounds, tried = np.full(1, np.inf), 0
    while tried < _MOST and bounds[0] > enough:
        some = slice(0, _AT_ONCE)
        parts, narrower = _divided(middles[some], halves[some], lengths)
        found = _bounds(grasp_set, scale, forces, parts, narrower * lengths)
        tried += len(parts)
        middles = np.concatenate((parts, middles[_AT_ONCE:]))
        halves = np.concatenate((narrower, halves[_AT_ONCE:]))
        # a part is no better than the whole
        bounds = np.concatenate((np.minimum(found, bounds[some].repeat(2)), bounds[_AT_ONCE:]))
        order = np.argsort(-bounds, kind="stable")
        middles, halves, bounds = middles[order], halves[order], bounds[order]
    return max(value, float(bounds[0]))


def _divided(
    middles: FloatArray, halves: FloatArray, lengths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Each box cut in two across its longest side."""
    longest = (halves * lengths).argmax(axis=1)
    cut = np.eye(halves.shape[1])[longest] / 2
    narrower = halves * (1 - cut)
    steps = np.stack((-halves * cut, halves * cut), axis=1)
    parts = (middles[:, None] + steps).reshape(-1, halves.shape[1])
    return parts, narrower.repeat(2, axis=0)


def _bounds(
    grasp_set: GraspSet, scale: float, forces: Forces, middles: FloatArray, moves: FloatArray
) -> FloatArray:
    """Bounds of ε over boxes, by their middles and how far contacts move from there."""
    cones, segments = grasp_set.torque.cones, grasp_set.torque.edges[0]
    edges = np.broadcast_to(np.array(grasp_set.edges), middles.shape)
    grasps = Grasps(grasp_set.polygon, cones.whole, edges, cones.along(segments, middles))
    return enlarged_supports(wrenches_of(grasps, scale), moves, forces)
