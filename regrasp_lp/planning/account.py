"""A plan told in words."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING, get_args

from regrasp_lp.contact import Contact
from regrasp_lp.grasp_sets.pieces import Measure
from regrasp_lp.planning.limits import Moments, limit_in_words, moments_in_words
from regrasp_lp.planning.plan_program import tight_limits
from regrasp_lp.planning.steps import Place, Release, Slide, Step

if TYPE_CHECKING:
    from regrasp_lp.planning.plan import Plan

_ROUNDING = 1e-9
"""Part of an object's size below which a margin means nothing in practice."""

_STEP_WIDTH = 33
"""Of the column of steps, for an account of less than 80 columns."""

_WIDTH = 78

_MOST_LIMITS = 2
"""Named of each kind; `Plan.sensitivity` names them all."""


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
    title = (
        f"Regrasp of {name}: {_count(len(plan.steps), 'step')}, "
        f"{_count(plan.placements, 'placement')}, {plan.hand.fingers} fingers"
    )
    return "\n".join([title, *head(plan), "", *_table(plan), "", *end(plan)])


def head(plan: Plan) -> list[str]:
    """Return what a plan amounts to, in lines: those of its account after the first one."""
    return [
        f"least margin {plan.margin:.4g}, least tolerance {plan.tolerance:.4g}",
        *_chosen(plan),
        *_objective(plan),
        *_warning(plan),
    ]


def end(plan: Plan) -> list[str]:
    """Return what limits a plan, and its goal, in lines: the last ones of its account."""
    goal = ", ".join(_at(contact) for contact in plan.goal)
    return [*_limits(plan), f"goal reached: {goal}"]


def _table(plan: Plan) -> list[str]:
    """A line for each step, or more where its words are long."""
    texts = ["start: " + ", ".join(f"{k} on {_at(c)}" for k, c in plan.start.items())]
    texts += [describe(step) for step in plan.steps]
    lines = [_row("", "step", "held by", "margin", "tolerance", "on the way")]
    for i, (text, grasp) in enumerate(zip(texts, plan.grasps, strict=True)):
        along = plan.slide_margins[i - 1] if i else float("inf")
        fingers = ",".join(str(finger) for finger in grasp.support.fingers)
        first, *rest = wrap(text, _STEP_WIDTH)
        way = f"{along:.4g}" if along < grasp.margin else ""
        sizes = f"{grasp.margin:.4g}", f"{grasp.tolerance:.4g}"
        lines.append(_row(str(i), first, fingers, *sizes, way))
        lines += [_row("", line) for line in rest]
    return lines


def _chosen(plan: Plan) -> list[str]:
    """What the planner could choose: start and goal are given, and may be worse."""
    if plan.chosen_margin == float("inf"):
        return []
    margin, tolerance = f"{plan.chosen_margin:.4g}", f"{plan.chosen_tolerance:.4g}"
    return [f"without start and goal, which are given: {margin} and {tolerance}"]


def _objective(plan: Plan) -> list[str]:
    """What the plan is best in, and how much better another one can be."""
    if plan.gap is None:
        return []
    what, *more = (f"{weight:.4g} {name}" for name, weight in plan.objective.signed)
    if plan.objective.name != "weighted":
        what = plan.objective.name
    what += "".join(f" - {term[1:]}" if term[0] == "-" else f" + {term}" for term in more)
    best = f"objective {what}: {plan.value:.4g}, bound {plan.bound:.4g}"
    if plan.objective.maximised and plan.value == float("inf"):
        best = f"objective {what}: there was nothing to choose"
    better = f"no plan is better by more than {plan.gap:.4g}" if plan.gap else "no plan is better"
    if plan.gap == float("inf"):
        better = "how good plans can be is not known"
    return wrap(f"{best}: {better}", _WIDTH, subsequent_indent="  ", break_on_hyphens=False)


def _warning(plan: Plan) -> list[str]:
    if plan.margin > _ROUNDING * plan.polygon.diameter:
        return []
    return ["warning: within rounding of losing force closure; see where the margin is least"]


def _limits(plan: Plan) -> list[str]:
    """What the least margin and the least tolerance come from."""
    if plan.margin == -float("inf"):  # cones that cannot balance each other
        return []
    lines = []
    for measure in get_args(Measure):
        when: dict[str, Moments] = {}
        for limit in tight_limits(plan, measure)[1]:
            words = limit_in_words(limit)
            when[words] = when.get(words, ()) + limit.moments
        parts = [f"{moments_in_words(moments)}: {words}" for words, moments in when.items()]
        more = [f"and {len(parts) - _MOST_LIMITS} more"] if len(parts) > _MOST_LIMITS else []
        text = f"least {measure} {'; '.join(parts[:_MOST_LIMITS] + more)}"
        lines += wrap(text, _WIDTH, subsequent_indent="  ", break_on_hyphens=False)
    return lines


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _row(
    number: str,
    step: str,
    fingers: str = "",
    margin: str = "",
    tolerance: str = "",
    way: str = "",
) -> str:
    sizes = f"{margin:>9} {tolerance:>9} {way:>10}"
    return f"{number:>3}  {step:<{_STEP_WIDTH}}  {fingers:<8} {sizes}".rstrip()


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
