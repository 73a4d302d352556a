"""Torque functions: the one structure under all grasp sets.

Balanced forces at m contacts, ``Σ w_t e_t = 0`` with weights ``w_t > 0`` on rays ``e_t``, produce
a torque that is linear in the contact positions and does not decrease in any of them:

    M(u) = Σ w_t p_t(u) × e_t ,      ∂M/∂u_i >= 0 .

Over all *circuits* (minimal positive dependencies) of the boundary rays of the friction cones, the
contacts are in force closure iff the rays positively span the plane and
``min_j M_j(u) < 0 < max_j M_j(u)``: the theorem that carries the package, proved in
``docs/theory.md``. Everything here is stacked: a row is a combination of edges, a column one of
its functions.

Positions are *fractions* ``f = u / l`` in [0, 1], of edges or of the segments of them that fingers
may touch (`Cones.touching`). Values are divided by ``s = Σ w_t |e_t|`` and so
are lengths: by how much all boundary lines may be shifted before the sign changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.circuits import circuit_weights, circuits, cross, exact_weights
from regrasp_lp.friction import (
    UNIT_ROUNDOFF,
    BoolArray,
    Cones,
    FloatArray,
    IntArray,
    ObjectArray,
    as_integers,
    rays_of,
    spanning,
)

ACCURATE = 1e-9
"""Relative accuracy of margins."""

_ROUNDINGS = 64 * UNIT_ROUNDOFF


@dataclass(frozen=True, eq=False)
class TorqueFunctions:
    """Torque functions of N combinations of m edges, J to a combination (padded).

    A function has three forces, or two: then ``ray`` ends in -1. Its two forces either act along
    two opposite rays, or along one and the same ray, forward at one contact and back at the other
    (negative weight). In padding all of ``ray`` is -1.

    Parameters
    ----------
    cones : Cones
        The friction cones of the object.
    edges : numpy.ndarray of int, shape (N, m)
        Edge of each contact; an edge may occur twice.
    spans : numpy.ndarray of bool, shape (N,)
        Whether the boundary rays positively span the plane.
    slot, ray : numpy.ndarray of int, shape (N, J, 3)
        Force t of a function acts at contact ``slot`` along ray number ``ray``.
    weight : numpy.ndarray, shape (N, J, 3)
        Its weight on the ray scaled to length 1.
    scale : numpy.ndarray, shape (N, J)
        ``s``: the length of all forces, written in the boundary rays of their contacts; 1 in
        padding.
    """

    cones: Cones
    edges: IntArray
    spans: BoolArray
    slot: NDArray[np.int8]
    ray: NDArray[np.int32]
    weight: FloatArray
    scale: FloatArray

    def __len__(self) -> int:
        return len(self.edges)

    @property
    def m(self) -> int:
        """Number of contacts."""
        return int(self.edges.shape[1])

    @cached_property
    def valid(self) -> BoolArray:
        """Which columns are functions rather than padding, shape (N, J)."""
        return self.ray[:, :, 0] >= 0

    @cached_property
    def lengths(self) -> FloatArray:
        """Length of the edge of each contact, shape (N, m)."""
        return self.cones.lengths[self.edges]

    @property
    def first_positions(self) -> FloatArray:
        """Where on its whole edge the segment of each contact starts, a length, shape (N, m)."""
        cones = self.cones
        return np.asarray((cones.lower * cones.whole.lengths[cones.edge])[self.edges])

    @property
    def whole(self) -> TorqueFunctions:
        """The same functions of fractions of whole edges, where these are of segments of them."""
        cones = self.cones
        if cones.whole is cones:
            return self
        ray = np.where(self.ray >= 0, 2 * cones.edge[self.ray // 2] + self.ray % 2, -1)
        terms = self.spans, self.slot, ray.astype(np.int32), self.weight, self.scale
        return TorqueFunctions(cones.whole, cones.edge[self.edges], *terms)

    @cached_property
    def _terms(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        cones, rows = self.cones, np.arange(len(self))[:, None]
        offset, magnitude = np.zeros(self.valid.shape), np.zeros(self.valid.shape)
        slopes = np.zeros((*self.valid.shape, self.m))
        for t in range(3):
            ray, slot = self.ray[:, :, t], self.slot[:, :, t]
            edge = self.edges[rows, slot]
            weight = np.where(ray >= 0, self.weight[:, :, t], 0.0) / self.scale
            force = cones.unit_rays[ray] * weight[..., None]
            offset += cross(cones.local_starts[edge], force)
            turn = cross(cones.vectors[edge], force)
            for i in range(self.m):
                slopes[:, :, i] += np.where(slot == i, turn, 0.0)
            magnitude += np.where(ray >= 0, cones.reach[edge], 0.0)
        return offset, np.maximum(slopes, 0.0), _ROUNDINGS * magnitude / self.scale

    @property
    def offsets(self) -> FloatArray:
        """``M(0) / s``, lengths, shape (N, J); 0 in padding."""
        return self._terms[0]

    @property
    def slopes(self) -> FloatArray:
        """``∂M/∂f_i / s >= 0``, lengths, shape (N, J, m); 0 in padding."""
        return self._terms[1]

    @property
    def errors(self) -> FloatArray:
        """Bound of the rounding error of a value anywhere in the box, shape (N, J).

        On rays of length 1 a weight is a sine, off by less than 16 roundings, and a torque is off
        by less than 16 roundings of ``|p|``; 64 roundings of ``Σ |p|`` are more than both together
        with the sums. A bound is absolute: it is large where ``s`` is small.
        """
        return self._terms[2]

    @cached_property
    def rates(self) -> FloatArray:
        """``w / s = Σ_i ∂M/∂u_i / s``, a pure number, shape (N, J); 1 in padding."""
        rates: FloatArray = (self.slopes / self.lengths[:, None, :]).sum(axis=2)
        return np.where(self.valid, rates, 1.0)

    def take(self, rows: IntArray | BoolArray) -> TorqueFunctions:
        """Return the functions of some of the combinations."""
        kept = self.ray[rows]
        width = int((kept[:, :, 0] >= 0).sum(axis=1).max(initial=1))
        taken = TorqueFunctions(
            self.cones,
            self.edges[rows],
            self.spans[rows],
            self.slot[rows][:, :width],
            kept[:, :width],
            self.weight[rows][:, :width],
            self.scale[rows][:, :width],
        )
        if "_terms" in vars(self):  # what is known already
            vars(taken)["_terms"] = tuple(term[rows][:, :width] for term in self._terms)
        return taken

    def values(self, fractions: FloatArray) -> FloatArray:
        """Return ``M(f) / s`` of every function.

        Parameters
        ----------
        fractions : numpy.ndarray, shape (N, m) or (m,)

        Returns
        -------
        numpy.ndarray, shape (N, J)
            Lengths; 0 in padding.
        """
        f = np.broadcast_to(fractions, self.edges.shape)
        return np.asarray(self.offsets + np.einsum("njm,nm->nj", self.slopes, f))

    def certain_values(self, fractions: FloatArray) -> FloatArray:
        """Return `values`, those near 0 taken from rationals: no wrong sign, each good to 1e-9."""
        f = np.broadcast_to(np.asarray(fractions, dtype=np.float64), self.edges.shape)
        values = self.values(f)
        rows, columns = np.nonzero(self.valid & (ACCURATE * np.abs(values) <= self.errors))
        if rows.size:
            numerators, unit = as_integers(f[rows])
            constant, slopes = self._exact_coefficients(rows, columns)
            totals = unit * constant + (slopes * numerators).sum(axis=1)
            # Exact functions are scaled by a factor of their own, which any slope reveals.
            known = self.slopes[rows, columns].argmax(axis=1)
            every = np.arange(len(rows))
            parts = [
                float(Fraction(int(total), int(unit * slope)))
                for total, slope in zip(totals, slopes[every, known], strict=True)
            ]
            values[rows, columns] = np.array(parts) * self.slopes[rows, columns, known]
        return values

    def margins(self, fractions: FloatArray) -> FloatArray:
        """Return the margin of one grasp on each combination.

        The margin is ``min(max_k M_k/s_k, max_j -M_j/s_j)``: the largest ε such that every
        boundary line of every cone may be shifted by ε, each on its own, without losing force
        closure. It is signed, in the unit of the object, and -inf where the rays do not span.

        Parameters
        ----------
        fractions : numpy.ndarray, shape (N, m)

        Returns
        -------
        numpy.ndarray, shape (N,)
        """
        return self._least(self.certain_values(fractions))

    def tolerances(self, fractions: FloatArray) -> FloatArray:
        """Return the tolerance of one grasp on each combination.

        The tolerance is the largest δ such that every contact may be anywhere within ±δ on its
        edge: ``min(max_k M_k/w_k, max_j -M_j/w_j, u_i, l_i - u_i)``. Signed, in the unit of the
        object, -inf where the rays do not span.

        Parameters
        ----------
        fractions : numpy.ndarray, shape (N, m)

        Returns
        -------
        numpy.ndarray, shape (N,)
        """
        f = np.broadcast_to(fractions, self.edges.shape)
        to_ends = (np.minimum(f, 1 - f) * self.lengths).min(axis=1)
        return np.asarray(np.minimum(self._least(self.certain_values(f) / self.rates), to_ends))

    def _least(self, values: FloatArray) -> FloatArray:
        up = np.where(self.valid, values, -np.inf).max(axis=1, initial=-np.inf)
        down = np.where(self.valid, -values, -np.inf).max(axis=1, initial=-np.inf)
        return np.where(self.spans, np.minimum(up, down), -np.inf)

    def exists(self) -> BoolArray:
        """Whether the grasp set of each combination is non-empty, exactly, shape (N,).

        It is iff the rays span and ``min_j M_j(0) < 0 < max_k M_k(l)``: signs at two corners.
        """
        low, high = np.zeros(self.edges.shape), np.ones(self.edges.shape)
        return self.spans & self.any_negative(low) & self.any_positive(high)

    def contain(self, fractions: FloatArray) -> BoolArray:
        """Whether a grasp on each combination is in force closure, exactly, shape (N,)."""
        f = np.broadcast_to(np.asarray(fractions, dtype=np.float64), self.edges.shape)
        return self.spans & self.any_negative(f) & self.any_positive(f)

    def independent(self, lower: FloatArray, upper: FloatArray) -> BoolArray:
        """Whether boxes of contact positions are independent contact regions, exactly.

        The contacts may be anywhere in the box, each on its own, iff ``max_k M_k(lower) > 0`` and
        ``min_j M_j(upper) < 0``, by monotonicity.

        Parameters
        ----------
        lower, upper : numpy.ndarray, shape (N, m)
            Fractions of the two extreme corners.

        Returns
        -------
        numpy.ndarray of bool, shape (N,)
        """
        return self.spans & self.any_positive(lower) & self.any_negative(upper)

    def any_positive(self, fractions: FloatArray) -> BoolArray:
        """Whether ``max_k M_k(f) > 0``, exactly, shape (N,)."""
        return self._any_sign(1, fractions)

    def any_negative(self, fractions: FloatArray) -> BoolArray:
        """Whether ``min_j M_j(f) < 0``, exactly, shape (N,)."""
        return self._any_sign(-1, fractions)

    def _any_sign(self, sign: int, fractions: FloatArray) -> BoolArray:
        f = np.broadcast_to(np.asarray(fractions, dtype=np.float64), self.edges.shape)
        value = sign * self.values(f)
        sure: BoolArray = np.any(self.valid & (value > self.errors), axis=1)
        open_ = self.valid & (np.abs(value) <= self.errors) & ~sure[:, None]
        rows, columns = np.nonzero(open_)
        if rows.size:
            exact = sign * self.exact_signs(rows, columns, f[rows])
            np.logical_or.at(sure, rows, exact > 0)
        return sure

    def exact_signs(
        self, rows: IntArray, columns: IntArray, fractions: FloatArray
    ) -> NDArray[np.int8]:
        """Return the exact sign of chosen functions at given positions, in integers.

        Parameters
        ----------
        rows, columns : numpy.ndarray of int, shape (K,)
            Combination and function.
        fractions : numpy.ndarray, shape (K, m)
            Positions; the doubles are read as the rationals they are.

        Returns
        -------
        numpy.ndarray of int8, shape (K,)
        """
        numerators, unit = as_integers(fractions)
        constant, slopes = self._exact_coefficients(rows, columns)
        total = unit * constant + (slopes * numerators).sum(axis=1)
        return np.array([(v > 0) - (v < 0) for v in total], dtype=np.int8)

    def exact_coefficients(self, row: int) -> tuple[list[Fraction], list[list[Fraction]]]:
        """Return ``M(0)`` and ``∂M/∂f`` of the functions of one combination, as rationals.

        Each function is exact up to a positive factor of its own.
        """
        columns = np.flatnonzero(self.valid[row])
        constant, slopes = self._exact_coefficients(np.full(len(columns), row), columns)
        return [Fraction(c) for c in constant], [[Fraction(v) for v in s] for s in slopes]

    def _exact_coefficients(
        self, rows: IntArray, columns: IntArray
    ) -> tuple[ObjectArray, ObjectArray]:
        """Integers, up to a positive factor per function: shapes (K,) and (K, m)."""
        ray = self.ray[rows, columns]
        weights = exact_weights(self.cones, ray, self.weight[rows, columns])
        constant: ObjectArray = np.full(len(rows), 0, dtype=object)
        slopes: ObjectArray = np.full((len(rows), self.m), 0, dtype=object)
        for t in range(3):
            slot = self.slot[rows, columns, t]
            edge = self.edges[rows, slot]
            force = weights[:, t, None] * self.cones.exact_rays[ray[:, t]]
            constant = constant + cross(self.cones.exact_starts[edge], force)
            slopes[np.arange(len(rows)), slot] += cross(self.cones.exact_vectors[edge], force)
        return constant, slopes


def torque_functions(cones: Cones, edges: IntArray) -> TorqueFunctions:
    """Return the torque functions of all circuits of combinations of edges.

    A circuit is three rays each two of which turn the same way round, or two exactly opposite
    ones. By Cramer the weights of three rays are the cross products of the other two.

    Parameters
    ----------
    cones : Cones
    edges : numpy.ndarray of int, shape (N, m)
        Edge of each contact, m >= 1.

    Returns
    -------
    TorqueFunctions
        Two contacts have at most two circuits, three at most eight.

    Examples
    --------
    Opposite sides of a square, held where they face each other: one function is positive, the
    other negative, so that the contacts are in force closure.

    >>> from regrasp_lp.polygon import Polygon
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    >>> functions = torque_functions(Cones.of(square, 0.5), np.array([[0, 2]]))
    >>> functions.values(np.array([[0.5, 0.5]])).round(3).tolist()
    [[0.224, -0.224]]
    """
    edges = np.asarray(edges, dtype=np.intp)
    rays = rays_of(edges)
    one, other = rays[:, :, None], rays[:, None, :]
    member = circuits(cones.cross_sign[one, other], cones.opposite[one, other])
    valid = member[:, :, 0] >= 0
    ray = np.where(member >= 0, rays[np.arange(len(rays))[:, None, None], member], -1)
    weight = circuit_weights(cones, ray)
    scale = np.where(valid, weight.sum(axis=2), 1.0)
    return TorqueFunctions(
        cones,
        edges,
        spanning(cones, edges),
        np.maximum(member // 2, 0).astype(np.int8),
        ray.astype(np.int32),
        weight,
        scale,
    )
