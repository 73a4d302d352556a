"""Parallel sets in the chapter's form (section 3.3.1.3).

Three contacts can hold the object with parallel forces iff their *common cone*
``C = -C_a ∩ C_b ∩ C_c`` has an interior and, drawn at the contact of the centre edge a on both
sides, it does not leave the two other contacts in one and the same of the two *outer regions* to
its left and to its right (Propositions 3.8 and 3.9). In contact space that is the union of six
convex polytopes K0 to K5.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from regrasp_lp.friction import Cones, FloatArray
from regrasp_lp.grasp_sets.candidates import common_cone
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.torque import TorqueFunctions

_LEFT, _RIGHT = -1.0, 1.0
# Contact (0 is b, 1 is c), margin of the common cone (0 right, 1 left), and on which side of it.
_SUBPOLYTOPES = (
    ((0, 1, _LEFT), (0, 0, _LEFT), (1, 1, _RIGHT), (1, 0, _RIGHT)),
    ((0, 1, _RIGHT), (0, 0, _RIGHT), (1, 1, _LEFT), (1, 0, _LEFT)),
    ((0, 1, _LEFT), (0, 0, _RIGHT)),
    ((1, 1, _LEFT), (1, 0, _RIGHT)),
    ((0, 1, _RIGHT), (0, 0, _LEFT)),
    ((1, 1, _RIGHT), (1, 0, _LEFT)),
)


def common_cone_rays(cones: Cones, center: int, others: Sequence[int]) -> FloatArray:
    """Return the boundaries of the common cone of three edges, as unit vectors.

    Parameters
    ----------
    cones : Cones
    center : int
        Centre edge a: the cone there is the opposite one.
    others : sequence of int
        Edges b and c.

    Returns
    -------
    numpy.ndarray, shape (2, 2)
        The clockwise (right) and the counter-clockwise (left) boundary.
    """
    common = common_cone(cones, np.array([[center, *others]]))
    return np.asarray(common.boundaries(cones)[0])


def outer_regions(cones: Cones, center: int, others: Sequence[int], span: FloatArray) -> LinearSets:
    """Return the outer regions of the common cones drawn at contacts of the centre edge.

    Parameters
    ----------
    cones : Cones
    center : int
        Centre edge a.
    others : sequence of int
        Edges b and c.
    span : numpy.ndarray, shape (2,)
        First and last fraction of the edge a at which a cone is drawn: twice the same for the
        regions at one contact (Fig. 3.5), 0 and 1 for those of the union volume (Fig. 3.13).

    Returns
    -------
    LinearSets
        Two sets over "x" and "y", the left one and the right one, unbounded; the margin of a point
        is its distance to the cones.
    """
    right, left = common_cone_rays(cones, center, others)
    ends = cones.starts[center] + np.outer(span, cones.vectors[center])
    rows, bounds = np.empty((2, 4, 2)), np.empty((2, 4))
    for k, side in enumerate((_LEFT, _RIGHT)):  # to the left of a line along d: d × (x - p) > 0
        normals = -side * np.array([[d[1], -d[0]] for d in (right, left)])
        rows[k] = normals.repeat(2, axis=0)
        bounds[k] = (normals @ ends.T).ravel()
    everywhere = np.full((2, 2), np.inf)
    return LinearSets(("x", "y"), rows, np.ones((2, 4)), bounds, -everywhere, everywhere)


def subpolytopes(functions: TorqueFunctions, names: Sequence[str]) -> LinearSets:
    """Return the six sub-polytopes of one parallel set, equations (3.1) to (3.7).

    A contact b is to the left of the line along a margin d of the common cone at the centre a iff
    the torque function ``(p_b - p_a) × d`` is negative.

    Parameters
    ----------
    functions : TorqueFunctions
        Those of one parallel set, as `parallel_functions` returns them.
    names : sequence of str
        Names of the three contact coordinates, which are fractions.

    Returns
    -------
    LinearSets
        K0 to K5, closed, four rows each (of K2 to K5 two are void). K0 and K1 end at walls inside
        the set, where their margins fall to 0 but those of the grasps do not.
    """
    rows, bounds, scales = np.zeros((6, 4, 3)), np.zeros((6, 4)), np.zeros((6, 4))
    for k, conditions in enumerate(_SUBPOLYTOPES):
        for row, (contact, margin, side) in enumerate(conditions):
            column = 2 * contact + margin
            rows[k, row] = -side * functions.slopes[0, column]
            bounds[k, row] = side * functions.offsets[0, column]
            scales[k, row] = 1.0
    return LinearSets(tuple(names), rows, scales, bounds, np.zeros((6, 3)), np.ones((6, 3)))
