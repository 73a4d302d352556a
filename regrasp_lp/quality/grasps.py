"""Many grasps as arrays, and the one way in which all measures are called.

A measure is a function of `Grasps`. In public it takes a polygon and either one grasp or arrays of
N grasps, and returns a float or an array of N: `measure` leads from the one to the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import ContactError, FrictionError
from regrasp_lp.force_closure import resolve_batch
from regrasp_lp.friction import BoolArray, Cones, FloatArray, IntArray
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import TorqueFunctions, torque_functions

_CHUNK = 2000

_LEAST = float(np.finfo(np.float64).smallest_subnormal)

GraspLike = Grasp | Iterable[Contact | tuple[int, float]]


class Places(TypedDict, total=False):
    """Where on their edges the contacts of a batch are: one of the two."""

    positions: ArrayLike | None
    fractions: ArrayLike | None


@dataclass(frozen=True, eq=False)
class Grasps:
    """N grasps of m contacts each on one object.

    Parameters
    ----------
    polygon : Polygon
    cones : Cones
        Of all edges of the object.
    edges : numpy.ndarray of int, shape (N, m)
    fractions : numpy.ndarray, shape (N, m)
        In [0, 1].
    """

    polygon: Polygon
    cones: Cones
    edges: IntArray
    fractions: FloatArray

    def __len__(self) -> int:
        return len(self.edges)

    @property
    def m(self) -> int:
        """Number of contacts."""
        return int(self.edges.shape[1])

    @cached_property
    def functions(self) -> TorqueFunctions:
        """The torque functions of the contacts."""
        return torque_functions(self.cones, self.edges)

    @cached_property
    def spans(self) -> BoolArray:
        """Whether the boundary rays of the cones positively span the plane, exactly."""
        return self.functions.spans

    @cached_property
    def closed(self) -> BoolArray:
        """Whether the contacts are in force closure, exactly, shape (N,)."""
        return self.functions.contain(self.fractions)

    @cached_property
    def points(self) -> FloatArray:
        """The contacts, from the centroid of the object, shape (N, m, 2)."""
        cones = self.cones
        starts = cones.local_starts - (self.polygon.centroid - cones.corner)
        return np.asarray(
            starts[self.edges] + self.fractions[..., None] * cones.vectors[self.edges]
        )

    @property
    def normals(self) -> FloatArray:
        """Unit normals into the material at the contacts, shape (N, m, 2)."""
        return self.polygon.normals[self.edges]

    @property
    def tangents(self) -> FloatArray:
        """Unit tangents at the contacts, shape (N, m, 2)."""
        return self.polygon.tangents[self.edges]

    @property
    def friction(self) -> FloatArray:
        """Friction coefficients at the contacts, shape (N, m)."""
        return np.asarray(self.cones.friction[self.edges])

    def signed(self, values: FloatArray) -> FloatArray:
        """Return values that are positive iff the grasp is in force closure.

        Where rounding has put a value on the wrong side of 0 it becomes the double nearest to it
        on the right side; it is -inf where the rays do not span.
        """
        right = np.where(self.closed, np.maximum(values, _LEAST), np.minimum(values, 0.0))
        return np.where(self.spans, right, -np.inf)


def measure(
    of: Callable[[Grasps], FloatArray],
    polygon: Polygon,
    grasp: GraspLike | None,
    friction: ArrayLike | None,
    edges: ArrayLike | None,
    positions: ArrayLike | None,
    fractions: ArrayLike | None,
) -> float | FloatArray:
    """Return what a measure says of one grasp, or of many.

    Parameters
    ----------
    of : callable
        The measure.
    polygon : Polygon
    grasp : Grasp or iterable of (edge, position), or None
        None for a batch.
    friction : float or sequence of float
    edges, positions, fractions : array_like, shape (N, m), or None
        None for one grasp.

    Returns
    -------
    float or numpy.ndarray, shape (N,)

    Raises
    ------
    ContactError
        If a contact is on no edge or off its edge, or the arguments do not fit together.
    FrictionError
        If `friction` is missing or not positive and finite.
    """
    if friction is None:
        raise FrictionError("friction is missing: pass one positive number or one per edge")
    cones = Cones.of(polygon, friction)
    if grasp is not None:
        if edges is not None or positions is not None or fractions is not None:
            raise ContactError("pass either a grasp or arrays (edges=..., positions=...), not both")
        resolved = polygon.resolve(grasp)
        one = Grasps(polygon, cones, resolved.edges[None, :], resolved.fractions[None, :])
        return float(of(one)[0])
    edge_array, fraction_array = resolve_batch(polygon, edges, positions, fractions)
    return in_chunks(of, Grasps(polygon, cones, edge_array, fraction_array))


def in_chunks(of: Callable[[Grasps], FloatArray], grasps: Grasps) -> FloatArray:
    """Return a measure of many grasps, so many at a time that memory does not matter."""
    parts = []
    for first in range(0, len(grasps), _CHUNK):
        part = slice(first, first + _CHUNK)
        parts.append(
            of(Grasps(grasps.polygon, grasps.cones, grasps.edges[part], grasps.fractions[part]))
        )
    return np.concatenate(parts) if parts else np.zeros(0)
