"""Sensitivity of a plan: what limits it, what friction does to it, how far fingers may be off."""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import TextWrapper
from typing import TYPE_CHECKING

from regrasp_lp.planning.friction_change import LeastFriction, Slope, least_friction_of, slopes
from regrasp_lp.planning.limits import Limits, limit_in_words, moments_in_words
from regrasp_lp.planning.plan_program import limits_of
from regrasp_lp.planning.regions import Region, regions

if TYPE_CHECKING:
    from regrasp_lp.planning.plan import Plan

_TEXT = TextWrapper(width=78, subsequent_indent="  ", break_on_hyphens=False)
_CELL = TextWrapper(width=67, break_on_hyphens=False)


@dataclass(frozen=True)
class Sensitivity:
    """What a plan's margin and tolerance depend on; printed, an account of it.

    Parameters
    ----------
    name : str
        Of the object.
    margin, tolerance : Limits
        Which grasps, boundary lines of friction cones and ends of edges limit them, with prices.
    friction : tuple of float
        μ of the edges that support the object, least and greatest.
    slope_below, slope_above : Slope
        How fast the margin changes where all friction decreases, and where it increases. They
        differ where the margin has a kink.
    least_friction : LeastFriction
        The factor down to which all friction may fall, the contacts as they are.
    regions : tuple of Region
        How far each finger may be off, step by step.
    spaced : bool
        Whether the hand limits distances between fingers: prices do not know of that.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], name="block")
    >>> plan = rl.plan_regrasp(block, [(0, 3), (2, 3)], [(1, 1), (3, 2)], friction=0.4)
    >>> found = plan.sensitivity()
    >>> round(found.margin.least, 4), len(found.regions)
    (0.5571, 5)
    >>> found.margin.tight[0].lines[0]
    Line(finger=1, edge=0, side='clockwise', share=0.5)
    """

    name: str
    margin: Limits
    tolerance: Limits
    friction: tuple[float, float]
    slope_below: Slope
    slope_above: Slope
    least_friction: LeastFriction
    regions: tuple[Region, ...]
    spaced: bool = False

    def __str__(self) -> str:
        parts = [
            [f"What limits the regrasp of {self.name or 'unnamed polygon'}"],
            _limits(self.margin),
            _limits(self.tolerance),
            self._friction(),
            _regions(self.regions),
        ]
        if self.spaced:
            parts.insert(3, ["(without the hand's limits to distances between fingers)"])
        return "\n\n".join("\n".join(part) for part in parts)

    def _friction(self) -> list[str]:
        below, above = -self.slope_below.value / 100, self.slope_above.value / 100
        least, (low, high) = self.least_friction, self.friction
        text = (
            f"with 1 % less friction the margin changes by {below:+.4g}, with 1 % more by "
            f"{above:+.4g}; "
        )
        if least.fault is None:
            return _TEXT.wrap(text + "the plan holds under any friction")
        mu = f"{least.holds * low:.6g}"
        if high > low:
            mu += f" to {least.holds * high:.6g}"
        text += (
            f"the plan holds down to {least.holds:.6g} of its friction, that is {mu}. "
            f"Below: {least.fault}"
        )
        return _TEXT.wrap(text)


def sensitivity_of(plan: Plan) -> Sensitivity:
    """Return what the margin and the tolerance of a plan depend on.

    Parameters
    ----------
    plan : Plan

    Returns
    -------
    Sensitivity

    Raises
    ------
    NotForceClosureError
        If the plan does not hold the object as it is.
    SolverError
        If prices cannot be proved.
    """
    used = {contact.edge for held in plan.grasps for contact in held.grasp}
    friction = plan.friction[sorted(used)]
    least = least_friction_of(plan)  # first of all: it tells what is wrong with a faulty plan
    return Sensitivity(
        plan.polygon.name,
        limits_of(plan, "margin"),
        limits_of(plan, "tolerance"),
        (float(friction.min()), float(friction.max())),
        *slopes(plan),
        least,
        regions(plan),
        plan.hand.spaced,
    )


def _limits(limits: Limits) -> list[str]:
    """The least margin or tolerance, where it is, and the table of prices."""
    moments = tuple(moment for limit in limits.tight for moment in limit.moments)
    text = f"{limits.measure} {limits.least:.4g}: {moments_in_words(moments)}"
    head = _TEXT.wrap(text)
    if not limits.limits:
        return [*head, "nothing was chosen: start and goal are given"]
    head += _TEXT.wrap(
        f"without what is given {limits.chosen:.4g}; other choices along the same pieces reach "
        f"{limits.best:.4g}, which these limit (price: growth per shift of a line or an end)"
    )
    for limit in limits.limits:
        text = f"{moments_in_words(limit.moments)}: {limit_in_words(limit)}"
        first, *rest = _CELL.wrap(text)
        head += [f"{limit.price:>9.4g}  {first}", *(" " * 11 + line for line in rest)]
    return head


def _regions(found: tuple[Region, ...]) -> list[str]:
    """A line for each finger of each region; each may be off on its own."""
    lines = [
        "how far each finger may be off on its own: alike (+-), or back and ahead",
        f"{'step':<12}{'finger':>6}{'edge':>6}{'at':>11}{'+-':>11}{'back':>11}{'ahead':>11}",
    ]
    for region in found:
        step = f"to {region.step}" if region.on_the_way else str(region.step)
        tolerance = f"{region.tolerance:.4g}"
        rows = zip(region.fingers, region.grasp, region.widths.tolist(), strict=True)
        for finger, contact, (back, ahead) in rows:
            at = "on the way" if region.on_the_way else f"{contact.position:.4g}"
            lines.append(
                f"{step:<12}{finger:>6}{contact.edge:>6}{at:>11}{tolerance:>11}"
                f"{back:>11.4g}{ahead:>11.4g}"
            )
            step = ""
    return lines
