"""Concurrent sets by sides: three double-sided cones meet in a focus point.

Contact i sees the focus point q on side ``s_i = ±1`` iff ``s_i (q - p_i(u_i))`` is in its cone:
two rows, linear in q and u. Each of the eight choices of sides is a convex piece of the set in the
five coordinates (u, q), and the set is the union of their projections on u (Propositions 3.4 and
3.6), but for grasps of which two contacts coincide at a corner of the object: their cones may meet
in that corner only.

Projecting leaves q out: with the boundary rays, signed by their sides, as normals of half-planes of
q, the half-planes have a common point iff each circuit of them has ``Σ λ_k h_k(u) <= 0``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from regrasp_lp.circuits import circuit_weights, circuits, cross
from regrasp_lp.friction import Cones, FloatArray, IntArray
from regrasp_lp.grasp_sets.focus import cell_pieces, in_object
from regrasp_lp.grasp_sets.sweeps import Sweeps, sides_of
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver, maximise_margins


def sided_pieces(cones: Cones, edges: IntArray, names: Sequence[str]) -> LinearSets:
    """Return the pieces of concurrent sets over their contacts and the focus point.

    The rows are ``(q - p_i) × d > 0`` for the two boundary rays, ``d = s e`` of the
    counter-clockwise and ``d = -s e`` of the clockwise one. The margin of a point is the least
    distance of q to a boundary line of the cones at the contacts.

    Parameters
    ----------
    cones : Cones
    edges : numpy.ndarray of int, shape (N, 3)
        Edges whose normals θ-positively span the plane.
    names : sequence of str
        Names of the three contact coordinates, which are fractions.

    Returns
    -------
    LinearSets
        8 N sets over `names`, "x" and "y", the eight choices of `sides_of` to a combination.
    """
    slot, ray, sign = _signed_rays(edges)
    d, at, along = _moments(cones, edges, slot, ray, sign)
    rows = np.zeros((len(ray), 6, 5))
    rows[:, np.arange(6), slot] = along
    rows[:, :, 3], rows[:, :, 4] = -d[..., 1], d[..., 0]
    plane = Sweeps.of_cones(cones).linear_sets(cell_pieces(edges).reshape(-1, 3))
    box = np.zeros((len(ray), 3)), np.ones((len(ray), 3))
    sets = LinearSets(
        (*names, "x", "y"),
        rows,
        np.ones(at.shape),
        -at,
        np.concatenate((box[0], plane.lower), axis=1),
        np.concatenate((box[1], plane.upper), axis=1),
    )
    return in_object(cones, sets)


def double_cones(cones: Cones, edges: IntArray, names: Sequence[str]) -> LinearSets:
    """Return the pieces of one concurrent set by `sided_pieces` that exist, the widest first.

    Parameters
    ----------
    cones : Cones
    edges : numpy.ndarray of int, shape (3,)
    names : sequence of str

    Returns
    -------
    LinearSets
        Over the fractions `names`, "x" and "y".
    """
    edges = edges[None]
    widths = maximise_margins(contact_pieces(cones, edges, names), get_solver("highs")).margins
    order = np.argsort(-widths, kind="stable")
    exist = Sweeps.of_cones(cones).meet(cell_pieces(edges)[0])
    return sided_pieces(cones, edges, names).take(order[exist[order]])


def contact_pieces(cones: Cones, edges: IntArray, names: Sequence[str]) -> LinearSets:
    """Return the same pieces with the focus point eliminated.

    Parameters
    ----------
    cones, edges, names
        As for `sided_pieces`.

    Returns
    -------
    LinearSets
        8 N sets over `names`: a row for each circuit of the six signed rays, at most eight, scaled
        so that the largest margin of a piece is that of `sided_pieces`.
    """
    slot, ray, sign = _signed_rays(edges)
    signs = sign[:, :, None] * sign[:, None, :]
    one, other = ray[:, :, None], ray[:, None, :]
    turn = (signs * cones.cross_sign[one, other]).astype(np.int8)
    # parallel rays point the same way or are opposite, also once they are signed
    parallel = (cones.cross_sign[one, other] == 0) & ~np.eye(6, dtype=bool)
    member = circuits(turn, parallel & (cones.opposite[one, other] == (signs > 0)))
    _, at, along = _moments(cones, edges, slot, ray, sign)
    everyone = np.arange(len(ray))[:, None, None]
    weight = circuit_weights(cones, np.where(member >= 0, ray[everyone, member], -1))
    used = member[:, :, 0] >= 0
    weight = weight / np.where(used, weight.sum(axis=2), 1.0)[..., None]
    rows = np.zeros((*member.shape[:2], 3))
    for i in range(3):
        rows[:, :, i] = (weight * np.where(slot[member] == i, along[everyone, member], 0)).sum(2)
    bounds = -(weight * at[everyone, member]).sum(axis=2)
    box = np.zeros((len(ray), 3)), np.ones((len(ray), 3))
    return LinearSets(tuple(names), rows, used.astype(np.float64), bounds, *box)


def _signed_rays(edges: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Contact (6,), number and sign (8 N, 6) of the rays d of all choices of sides."""
    slot = np.repeat(np.arange(3), 2)
    rays = (2 * edges[:, :, None] + np.array([0, 1])).reshape(-1, 6)
    of_side = (1 - 2 * sides_of(3))[:, slot] * np.tile([-1, 1], 3)
    return slot, rays.repeat(8, axis=0), np.tile(of_side, (len(edges), 1))


def _moments(
    cones: Cones, edges: IntArray, slot: IntArray, ray: IntArray, sign: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit vectors d (8 N, 6, 2), and ``p × d`` at the start and along the edge (8 N, 6)."""
    d = cones.unit_rays[ray] * sign[..., None]
    edge = edges.repeat(8, axis=0)[:, slot]
    return d, cross(cones.local_starts[edge], d), cross(cones.vectors[edge], d)
