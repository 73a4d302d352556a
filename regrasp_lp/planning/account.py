"""A plan told in words."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING

from regrasp_lp.contact import Contact
from regrasp_lp.planning.steps import Place, Release, Slide, Step

if TYPE_CHECKING:
    from regrasp_lp.planning.plan import Plan

_ROUNDING = 1e-9
"""Part of an object's size below which a margin means nothing in practice."""

_STEP_WIDTH = 41
"""Of the column of steps, for an account of less than 80 columns."""


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
        f"Regrasp of {name}: {_count(len(plan.steps), 'step')}, "
        f"{_count(plan.placements, 'placement')}, {plan.hand.fingers} fingers",
        f"least margin {plan.margin:.4g}, least tolerance {plan.tolerance:.4g}",
        *_chosen(plan),
        *_warning(plan),
        "",
    ]
    texts = ["start: " + ", ".join(f"{k} on {_at(c)}" for k, c in plan.start.items())]
    texts += [describe(step) for step in plan.steps]
    lines = [_row("", "step", "held by", "margin", "on the way")]
    for i, (text, grasp) in enumerate(zip(texts, plan.grasps, strict=True)):
        along = plan.slide_margins[i - 1] if i else float("inf")
        fingers = ",".join(str(finger) for finger in grasp.support.fingers)
        first, *rest = wrap(text, _STEP_WIDTH)
        way = f"{along:.4g}" if along < grasp.margin else ""
        lines.append(_row(str(i), first, fingers, f"{grasp.margin:.4g}", way))
        lines += [_row("", line) for line in rest]
    goal = ", ".join(_at(contact) for contact in plan.goal)
    return "\n".join([*head, *lines, "", f"goal reached: {goal}"])


def _chosen(plan: Plan) -> list[str]:
    """What the planner could choose: start and goal are given, and may be worse."""
    if plan.chosen_margin == float("inf"):
        return []
    margin, tolerance = f"{plan.chosen_margin:.4g}", f"{plan.chosen_tolerance:.4g}"
    return [f"without start and goal, which are given: {margin} and {tolerance}"]


def _warning(plan: Plan) -> list[str]:
    if plan.margin > _ROUNDING * plan.polygon.diameter:
        return []
    return ["warning: within rounding of losing force closure; see where the margin is least"]


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _row(number: str, step: str, fingers: str = "", margin: str = "", way: str = "") -> str:
    return f"{number:>3}  {step:<{_STEP_WIDTH}}  {fingers:<9} {margin:>9}  {way:>10}".rstrip()


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
