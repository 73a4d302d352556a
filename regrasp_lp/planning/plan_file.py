"""The file of a plan: written, read, checked.

The format is complete enough to check a plan with no code of ours; `fraction` decides, `position`
is for people.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import FileFormatError, RegraspError
from regrasp_lp.friction import per_edge_friction
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.plan import HeldGrasp, Plan, Support
from regrasp_lp.planning.steps import Place, Release, Slide, Step
from regrasp_lp.planning.verification import Report, read_plan_document, verify_document
from regrasp_lp.polygon import Polygon

FORMAT, VERSION = "regrasp-plan", 1


def document_of(plan: Plan) -> dict[str, Any]:
    """Return a plan in the form of its file, as plain dicts, lists and numbers."""
    before_each = [grasp.contacts for grasp in plan.grasps]
    uniform = bool((plan.friction == plan.friction[0]).all())
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": plan.polygon.name,
        "polygon": {
            "exterior": plan.polygon.exterior.tolist(),
            "holes": [ring.tolist() for ring in plan.polygon.holes],
        },
        "friction": plan.friction[:1].tolist() if uniform else plan.friction.tolist(),
        "hand": plan.hand.to_document(),
        "margin": plan.margin,
        "start": [{"finger": k, **_place(c)} for k, c in plan.start.items()],
        "goal": [_place(contact) for contact in plan.goal],
        "steps": [
            _step(step, before) for step, before in zip(plan.steps, before_each, strict=False)
        ],
        "grasps": [_held(grasp) for grasp in plan.grasps],
    }


def read_plan(path: str | Path) -> Plan:
    """Read a plan from the file that `Plan.to_json` wrote.

    Reading does not verify the plan: `Plan.verify` or `check_plan` do.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    Plan

    Raises
    ------
    FileFormatError
        If the file is damaged, of another format or another version.

    Examples
    --------
    >>> import tempfile
    >>> from regrasp_lp import plan_regrasp
    >>> block = Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], name="block")
    >>> plan = plan_regrasp(block, [(0, 3), (2, 3)], [(1, 1.5), (3, 1.5)], friction=0.4)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = plan.to_json(Path(folder) / "plan.json")
    ...     read_plan(Path(folder) / "plan.json") == plan
    True
    """
    document = read_plan_document(path)
    try:
        plan = plan_from_document(document)
        _ = plan.grasps  # steps that no hand can do, or that the list of grasps does not fit
    except (KeyError, TypeError, IndexError, ValueError, RegraspError) as error:
        raise FileFormatError(f"{path}: not a complete plan: {error!r}") from error
    return plan


def plan_from_document(document: Mapping[str, Any]) -> Plan:
    """Return the plan that a document of the plan's format describes."""
    rings = document["polygon"]
    polygon = Polygon(rings["exterior"], rings.get("holes", ()), document.get("name", ""))
    mu = document["friction"]
    friction = per_edge_friction(mu[0] if len(mu) == 1 else mu, polygon.n_edges)

    def contact(entry: Mapping[str, Any]) -> Contact:
        return polygon.resolve_contact(Contact.at_fraction(entry["edge"], entry["fraction"]))

    def step(entry: Mapping[str, Any]) -> Step:
        match entry["action"]:
            case "place":
                return Place(entry["finger"], contact(entry))
            case "release":
                return Release(entry["finger"])
            case _:
                moves = {
                    m["finger"]: contact({"edge": m["edge"], **m["to"]}) for m in entry["moves"]
                }
                return Slide(moves)

    start = {c.get("finger", i): contact(c) for i, c in enumerate(document["start"], start=1)}
    return Plan(
        polygon,
        friction,
        Hand.from_document(document["hand"]),
        start,
        Grasp([contact(c) for c in document["goal"]]),
        tuple(step(entry) for entry in document["steps"]),
        tuple(
            Support(entry["set"], tuple(entry["supporting"]), entry.get("center"))
            for entry in document["grasps"]
        ),
    )


def check_plan(plan: Plan | str | Path) -> Report:
    """Verify a plan, or the plan in a file, exactly and by means of its own.

    Parameters
    ----------
    plan : Plan or path-like

    Returns
    -------
    Report

    Examples
    --------
    >>> from regrasp_lp import plan_regrasp
    >>> block = Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], name="block")
    >>> plan = plan_regrasp(block, [(0, 3), (2, 3)], [(1, 1.5), (3, 1.5)], friction=0.4)
    >>> print(check_plan(plan))
    The plan is valid: 5 grasps and 0 slides checked, exactly.
    """
    document = plan.to_document() if isinstance(plan, Plan) else read_plan_document(plan)
    return verify_document(document)


def _place(contact: Contact) -> dict[str, Any]:
    return {"edge": contact.edge, "fraction": contact.fraction, "position": contact.position}


def _step(step: Step, before: Mapping[int, Contact]) -> dict[str, Any]:
    match step:
        case Place(finger, contact):
            return {"action": "place", "finger": finger, **_place(contact)}
        case Release(finger):
            return {"action": "release", "finger": finger}
        case Slide(moves):
            return {
                "action": "slide",
                "moves": [
                    {
                        "finger": finger,
                        "edge": to.edge,
                        "from": {
                            "fraction": before[finger].fraction,
                            "position": before[finger].position,
                        },
                        "to": {"fraction": to.fraction, "position": to.position},
                    }
                    for finger, to in moves.items()
                ],
            }


def _held(grasp: HeldGrasp) -> dict[str, Any]:
    entry = {
        "after_step": grasp.after_step,
        "margin": grasp.margin,
        "tolerance": grasp.tolerance,
        "set": grasp.support.kind,
        "supporting": list(grasp.support.fingers),
    }
    if grasp.support.center is not None:
        entry["center"] = grasp.support.center
    return entry
