"""Focus cells: grasp sets as regions of the plane (chapter, sections 3.3.1.1 and 3.3.1.2).

A point q of the focus cell of a set defines an *independent contact region* on each edge: the
contacts that see q through their double-sided cones. Any choice of contacts inside the regions of
q is a grasp (at their ends it may be marginal).

The cell of a concurrent set is the union of ``W_a ∩ W_b ∩ W_c`` over the eight choices of a side,
``W_i = E_i ⊕ ±C_i``. The cell of a two-finger set has the narrower cone ``C = C_a ∩ -C_b`` and the
contacts on opposite sides of q, ``(E_a ⊕ s C) ∩ (E_b ⊕ -s C)``: built from whole double-sided
cones, as the chapter does, pairs without a grasp would have a cell too.
"""

from __future__ import annotations

import numpy as np

from regrasp_lp.circuits import cross
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import Cones, FloatArray, IntArray
from regrasp_lp.grasp_sets.candidates import common_cone
from regrasp_lp.grasp_sets.sweeps import Sweeps, sides_of
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver, maximise_margins


def two_finger_sweeps(cones: Cones, pairs: IntArray) -> Sweeps:
    """Return the regions of pairs (a, b): ``E_a ⊕ s C`` and ``E_b ⊕ -s C``.

    Parameters
    ----------
    cones : Cones
    pairs : numpy.ndarray of int, shape (N, 2)
        Edges with opposed normals, as `two_finger_candidates` returns them.

    Returns
    -------
    Sweeps
        Four a pair: region ``4 n + 2 e + k`` is that of end e on side ``s = (-1)^k``.
    """
    rays, signs = _two_finger_cone(cones, pairs)
    return Sweeps.of_rays(cones, pairs.ravel(), rays.repeat(2, axis=0), signs.reshape(-1, 2))


def cell_pieces(edges: IntArray) -> IntArray:
    """Return the regions whose intersections are the pieces of each focus cell.

    Parameters
    ----------
    edges : numpy.ndarray of int, shape (N, m)

    Returns
    -------
    numpy.ndarray of int, shape (N, P, m)
        For m = 3, P = 8 choices of a side in ``Sweeps.of_cones``; for m = 2, P = 2 in
        `two_finger_sweeps` of these pairs.
    """
    if edges.shape[1] == 3:
        return np.asarray(2 * edges[:, None, :] + sides_of(3))
    return np.asarray(4 * np.arange(len(edges))[:, None, None] + np.array([[0, 2], [1, 3]]))


def focus_cell(cones: Cones, edges: IntArray) -> LinearSets:
    """Return the pieces of one focus cell that have an interior, the widest first.

    Parameters
    ----------
    cones : Cones
    edges : numpy.ndarray of int, shape (m,)

    Returns
    -------
    LinearSets
        Over "x" and "y"; the margin of a point is its distance to the boundary of the piece.
    """
    sweeps, pieces = _sweeps(cones, edges[None]), cell_pieces(edges[None])[0]
    sets = sweeps.linear_sets(pieces[sweeps.meet(pieces)])
    margins = maximise_margins(sets, get_solver("highs")).margins
    return in_object(cones, sets.take(np.argsort(-margins, kind="stable")))


def in_object(cones: Cones, sets: LinearSets) -> LinearSets:
    """Return sets over "x" and "y" from the lower left corner in the object's coordinates."""
    x, y = cones.corner.tolist()
    return sets.translate({"x": x, "y": y})


def independent_regions(
    cones: Cones, edges: IntArray, cell: LinearSets, point: FloatArray
) -> FloatArray:
    """Return the independent contact regions at a point inside a focus cell.

    On the edge ``a + u t`` the contacts that see q through a cone with boundaries d are those
    between ``u = (q - a) × d / t × d`` of the two: one formula for both sides.

    Parameters
    ----------
    cones : Cones
    edges : numpy.ndarray of int, shape (m,)
    cell : LinearSets
        Their `focus_cell`.
    point : numpy.ndarray, shape (2,)

    Returns
    -------
    numpy.ndarray, shape (m, 2)
        First and last position on each edge.

    Raises
    ------
    OptionError
        If the point is not inside the focus cell.
    """
    if not (cell.margins(np.tile(point, (len(cell), 1))) > 0).any():
        names = ", ".join(map(str, edges.tolist()))
        raise OptionError(
            f"({point[0]:g}, {point[1]:g}) is not inside the focus cell of edges {names}"
        )
    if len(edges) == 3:
        rays = np.stack((2 * edges, 2 * edges + 1), axis=1)
    else:
        rays = _two_finger_cone(cones, edges[None])[0].repeat(2, axis=0)
    d = cones.unit_rays[rays]
    t = (cones.vectors / cones.lengths[:, None])[edges][:, None, :]
    from_start = (point - cones.starts[edges])[:, None, :]
    at = np.sort(cross(from_start, d) / cross(t, d), axis=1)
    return np.asarray(np.clip(at, 0.0, cones.lengths[edges][:, None]))


def _sweeps(cones: Cones, edges: IntArray) -> Sweeps:
    return Sweeps.of_cones(cones) if edges.shape[1] == 3 else two_finger_sweeps(cones, edges)


def _two_finger_cone(cones: Cones, pairs: IntArray) -> tuple[IntArray, IntArray]:
    """Rays along the boundaries of C, shape (N, 2), and their signs at either end, (N, 2, 2)."""
    common = common_cone(cones, pairs[:, [1, 0, 0]])
    return common.ray, np.stack((common.sign, -common.sign), axis=1)
