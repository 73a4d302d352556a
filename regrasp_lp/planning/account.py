"""A plan told in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regrasp_lp.contact import Contact
from regrasp_lp.planning.steps import Place, Release, Slide, Step

if TYPE_CHECKING:
    from regrasp_lp.planning.plan import HeldGrasp, Plan

_KINDS = {
    "two_finger": "two-finger",
    "three_finger": "three-finger",
    "concurrent": "concurrent",
    "parallel": "parallel",
}


def account(plan: Plan) -> str:
    """Return a readable account of a plan, a line for each step.

    Parameters
    ----------
    plan : Plan

    Returns
    -------
    str
    """
    name = plan.polygon.name or "unnamed polygon"
    head = [
        f"Regrasp of {name}: {len(plan.steps)} steps, {plan.placements} placements, "
        f"{plan.hand.fingers} fingers",
        f"margin {plan.margin:.4g}, tolerance {plan.tolerance:.4g}"
        + (
            f" (where the planner chose: margin {plan.chosen_margin:.4g}, "
            f"tolerance {plan.chosen_tolerance:.4g})"
            if plan.chosen_margin < float("inf")
            else ""
        ),
        "",
    ]
    texts = ["start: " + ", ".join(f"{k} on {_at(c)}" for k, c in plan.start.items())]
    texts += [describe(step) for step in plan.steps]
    width = max(len(text) for text in texts) + 2
    lines = []
    for i, (text, grasp) in enumerate(zip(texts, plan.grasps, strict=True)):
        least = plan.slide_margins[i - 1] if i else float("inf")
        lines.append(f"{i:>3}  {text:<{width}} {_held(grasp, least)}")
    goal = ", ".join(_at(contact) for contact in plan.goal)
    return "\n".join([*head, *lines, "", f"goal reached: {goal}"])


def describe(step: Step) -> str:
    """Return one step in words.

    Examples
    --------
    >>> describe(Release(2))
    'release finger 2'
    """
    match step:
        case Place(finger, contact):
            return f"place finger {finger} on {_at(contact)}"
        case Release(finger):
            return f"release finger {finger}"
        case Slide(moves):
            parts = [f"{finger} to {_at(to)}" for finger, to in moves.items()]
            return f"slide finger{'s' if len(parts) > 1 else ''} " + ", ".join(parts)


def _at(contact: Contact) -> str:
    return f"edge {contact.edge} at {contact.position:.4g}"


def _held(grasp: HeldGrasp, along: float) -> str:
    fingers = ",".join(str(finger) for finger in grasp.support.fingers)
    text = f"{_KINDS[grasp.support.kind]} {fingers}: margin {grasp.margin:.4g}"
    return text + (f", {along:.4g} on the way" if along < grasp.margin else "")
