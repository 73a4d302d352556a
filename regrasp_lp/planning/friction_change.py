"""A plan under other friction: its margin, how fast that changes, the least friction that holds.

Contacts and steps stay as they are; the friction of all edges is multiplied by one factor. The
margin is continuous in the factor and made of smooth parts, with kinks where another grasp, or
another torque function, becomes the one that limits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.errors import FrictionError, NotForceClosureError
from regrasp_lp.friction import Cones, FloatArray, IntArray, per_edge_friction
from regrasp_lp.planning.along import least_margin_along
from regrasp_lp.planning.verification import Report, verify_document
from regrasp_lp.torque import torque_functions

if TYPE_CHECKING:
    from regrasp_lp.planning.plan import Plan

_STEPS = 2.0 ** -np.arange(8.0, 25.0)
"""Changes of the factor that slopes are taken from."""

_ACCURACY = 1e-9
"""Distance of the two ends of the least friction, relative."""


@dataclass(frozen=True)
class Slope:
    """How fast the margin changes with the factor of friction, to one side of the plan's.

    Parameters
    ----------
    value : float
        d(margin)/d(factor) at factor 1, a length: a friction higher by one percent changes the
        margin by a hundredth of it.
    error : float
        Estimate of its error: by how much the two best of a sequence of differences disagree.
    """

    value: float
    error: float


@dataclass(frozen=True)
class LeastFriction:
    """Between which two factors of its friction a plan ceases to hold; both checked exactly.

    Parameters
    ----------
    holds : float
        The plan passes its exact check with all friction times this factor, hence with any more.
    fails : float
        It does not with this factor, hence with any less, and the two differ by 1e-9 of their
        size. 0 if the plan holds under any friction that there is.
    fault : str or None
        What goes wrong there: the fault of the check.
    """

    holds: float
    fails: float
    fault: str | None


def margins_at(
    plan: Plan, factors: ArrayLike | None = None, *, friction: ArrayLike | None = None
) -> FloatArray:
    """Return the margin of a plan under other friction, the contacts as they are.

    Parameters
    ----------
    plan : Plan
    factors : array_like, optional
        Of any shape; all friction is multiplied by each.
    friction : array_like, shape (n_edges,) or (K, n_edges), optional
        μ of each edge, instead of factors.

    Returns
    -------
    numpy.ndarray
        In the object's unit, of the shape of `factors`, or of that of `friction` without the edges:
        the least margin of all held grasps and along all slides, of the supporting fingers.

    Raises
    ------
    FrictionError
        If some friction is none, or neither or both are given.
    """
    if (factors is None) == (friction is None):
        raise FrictionError("pass either factors of the plan's friction or friction=, not both")
    if friction is None:
        factor = np.asarray(factors, dtype=np.float64)
        every = factor[..., None] * plan.friction
    else:
        every = np.asarray(friction, dtype=np.float64)
        if every.ndim == 0 or every.shape[-1] != plan.polygon.n_edges:
            raise FrictionError(
                f"friction must have one value for each of {plan.polygon.n_edges} edges in its "
                f"last axis, got shape {every.shape}"
            )
    held = _Held.of(plan)
    rows = every.reshape(-1, plan.polygon.n_edges)
    return np.array([held.margin(row) for row in rows]).reshape(every.shape[:-1])


def slopes(plan: Plan) -> tuple[Slope, Slope]:
    """Return how fast the margin changes where friction decreases, and where it increases.

    One-sided differences of the margin over changes of the factor from 2⁻⁸ down to 2⁻²⁴, each two
    combined so that the curvature drops out; of these that which differs least from the next. The
    two slopes are the same where the margin has no kink.

    Parameters
    ----------
    plan : Plan

    Returns
    -------
    below, above : Slope
    """
    held = _Held.of(plan)
    margin = held.margin(plan.friction)
    found = []
    for side in (-1.0, 1.0):
        values = np.array([held.margin((1 + side * h) * plan.friction) for h in _STEPS])
        with np.errstate(invalid="ignore"):  # the margin may be -inf on one side
            quotients = (values - margin) / (side * _STEPS)
            combined = 2 * quotients[1:] - quotients[:-1]
            changes = np.abs(np.diff(combined))
        changes[np.isnan(changes)] = np.inf
        best = int(changes.argmin())
        found.append(Slope(float(combined[best + 1]), float(changes[best])))
    return found[0], found[1]


def least_friction_of(plan: Plan) -> LeastFriction:
    """Return the least factor of all friction under which a plan still holds, by bisection.

    The exact check of the whole plan decides, with all touching fingers and every instant of every
    slide. Friction cones grow with friction, so what holds under some holds under more.

    Parameters
    ----------
    plan : Plan

    Returns
    -------
    LeastFriction

    Raises
    ------
    NotForceClosureError
        If the plan does not pass its check as it is.
    """
    document = plan.to_document()
    found = _checked(document, plan, 1.0)
    if not found.ok:
        raise NotForceClosureError(
            f"the plan does not hold as it is, so there is no least friction: {found.fault}"
        )
    holds, fails, fault = 1.0, 0.0, None
    while fault is None:
        fails = holds * holds / 2 if holds < 1 else 0.5
        try:
            per_edge_friction(fails * plan.friction, plan.polygon.n_edges)
        except FrictionError:  # less is no friction
            return LeastFriction(holds, 0.0, None)
        report = _checked(document, plan, fails)
        holds, fault = (fails, None) if report.ok else (holds, report.fault)
    while holds - fails > _ACCURACY * holds:
        middle = np.sqrt(holds * fails) if fails < holds / 4 else (holds + fails) / 2
        report = _checked(document, plan, float(middle))
        if report.ok:
            holds = float(middle)
        else:
            fails, fault = float(middle), report.fault
    return LeastFriction(holds, fails, fault)


def _checked(document: Mapping[str, Any], plan: Plan, factor: float) -> Report:
    friction = (factor * plan.friction).tolist()
    return verify_document({**document, "friction": friction})


@dataclass(frozen=True, eq=False)
class _Held:
    """What supports the object in a plan, each grasp and each slide once.

    Parameters
    ----------
    plan : Plan
    used : numpy.ndarray of int, shape (U,)
        The edges that support it; the rest of an object may be large.
    rest : dict of int to (numpy.ndarray, numpy.ndarray)
        For each number of contacts m the grasps: places of their edges in `used`, and fractions,
        both (N, m).
    slides : list of (numpy.ndarray, numpy.ndarray, numpy.ndarray)
        Places of the edges, and fractions at both ends.
    """

    plan: Plan
    used: IntArray
    rest: Mapping[int, tuple[IntArray, FloatArray]]
    slides: list[tuple[IntArray, FloatArray, FloatArray]]

    @classmethod
    def of(cls, plan: Plan) -> _Held:
        grasps = {(tuple(g.grasp.edges), tuple(g.grasp.fractions)) for g in plan.grasps}
        used = np.unique([edge for edges, _ in grasps for edge in edges])
        rest = {}
        for m in sorted({len(edges) for edges, _ in grasps}):
            of_m = sorted(grasp for grasp in grasps if len(grasp[0]) == m)
            places = np.searchsorted(used, [edges for edges, _ in of_m])
            rest[m] = places, np.array([fractions for _, fractions in of_m])
        slides = [
            (np.searchsorted(used, slide[0].edges[0]), slide[1], slide[2])
            for slide in plan.slides
            if slide is not None
        ]
        return cls(plan, used, rest, slides)

    def margin(self, friction: FloatArray) -> float:
        """Return the least margin under a friction, shape (n_edges,)."""
        whole = Cones.of(self.plan.polygon, friction)
        cones = whole.touching(self.used, np.zeros(len(self.used)), np.ones(len(self.used)))
        least = [
            float(torque_functions(cones, edges).margins(fractions).min())
            for edges, fractions in self.rest.values()
        ]
        least += [
            least_margin_along(torque_functions(cones, edges[None]), f, g)
            for edges, f, g in self.slides
        ]
        return min(least)
