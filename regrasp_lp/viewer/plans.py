"""A plan to step through: what is held at each moment, and what happens in between.

Everything between two moments is linear in time, contacts and regions and torque functions alike,
so that two ends say all: the page draws every instant of a slide as it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from regrasp_lp.colors import KIND_NAMES
from regrasp_lp.contact import Contact
from regrasp_lp.grasp_sets.candidates import common_cone
from regrasp_lp.planning.account import describe, end, head
from regrasp_lp.planning.regions import Region, regions, touchable_part
from regrasp_lp.planning.steps import Place, Release, Slide
from regrasp_lp.viewer.page import build_page, finite, object_of, save_page

if TYPE_CHECKING:
    from regrasp_lp.planning.plan import HeldGrasp, Plan

Span = tuple[float, float]
"""A first and a last fraction of an edge."""

Rays = tuple[tuple[float, float], tuple[float, float]]
"""The clockwise and the counter-clockwise boundary of a cone, unit vectors."""


@dataclass(frozen=True)
class Moment:
    """What is drawn between two steps.

    Parameters
    ----------
    contacts : mapping of int to (int, float)
        Edge and fraction of each touching finger.
    support : tuple of int
        The fingers that hold the object, in the order of their set.
    kind : str
        Of the set, as people read it.
    margin, tolerance : float or None
        None for what is not finite.
    parallel : bool
        Whether the fingers hold by a common cone.
    rays : mapping of int to pair of vectors
        The common cone as the contact of each finger sees it, of two fingers and of parallel
        grasps.
    regions : mapping of int to (float, float)
        Where each supporting finger may be, as fractions of its edge.
    reach : mapping of int to (float, float)
        What the hand may touch of the edge of each touching finger, if not all of it.
    """

    contacts: Mapping[int, tuple[int, float]]
    support: tuple[int, ...]
    kind: str
    margin: float | None
    tolerance: float | None
    parallel: bool
    rays: Mapping[int, Rays]
    regions: Mapping[int, Span]
    reach: Mapping[int, Span]


@dataclass(frozen=True)
class Transition:
    """What happens between two moments.

    Parameters
    ----------
    action : {"place", "release", "slide"}
    fingers : tuple of int
        Those that move.
    text : str
        The step in words.
    margin, tolerance : float or None
        The least on the way, of a slide; None for other steps or what is not finite.
    values : pair of tuples of float, optional
        Of a slide: the torque functions of the supporting fingers where it begins and ends, as
        lengths. Linear in between: the margin at an instant is ``min(max v, -min v)``.
    rates : tuple of float, optional
        ``w / s`` of each: with ``v / w`` for v the same is the tolerance but for ends and limits.
    regions : mapping of int to pair of (float, float)
        Where each supporting finger may be at the beginning and at the end of a slide.
    """

    action: str
    fingers: tuple[int, ...]
    text: str
    margin: float | None = None
    tolerance: float | None = None
    values: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    rates: tuple[float, ...] | None = None
    regions: Mapping[int, tuple[Span, Span]] | None = None


def plan_page(plan: Plan, path: str | Path | None = None) -> str:
    """Return a plan as a page, and write it if there is a path.

    Parameters
    ----------
    plan : Plan
    path : path-like, optional
        Written whole or not at all.

    Returns
    -------
    str
        HTML with all that it needs.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], name="block")
    >>> plan = rl.plan_regrasp(block, [(0, 3), (2, 3)], [(1, 1.5), (3, 1.5)], friction=0.4)
    >>> page = plan_page(plan)                    # or plan.to_html("block.html")
    >>> page[:15], "<title>Regrasp of block</title>" in page
    ('<!doctype html>', True)
    """
    document = plan_document(plan)
    page = build_page("plan", document["title"], document, {"account": str(plan)})
    return save_page(page, path)


def plan_document(plan: Plan) -> dict[str, Any]:
    """Return what the page of a plan draws, as plain dicts, lists and numbers.

    Parameters
    ----------
    plan : Plan

    Returns
    -------
    dict
        ``object``, ``moments`` (`Moment`, the start and one after each step), ``transitions``
        (`Transition`, one a step), and what the plan amounts to.
    """
    # A plan that does not hold has none; its margins say so.
    found = regions(plan) if plan.margin > 0 else ()
    at_rest = {region.step: region for region in found if not region.on_the_way}
    moving = {region.step: region for region in found if region.on_the_way}
    name = plan.polygon.name or "unnamed polygon"
    return {
        "title": f"Regrasp of {name}",
        "object": object_of(plan.polygon, plan.friction.tolist()),
        "fingers": plan.hand.fingers,
        "span": plan.hand.max_span,
        "separation": plan.hand.fingertip_separation,
        "placements": plan.placements,
        "margin": finite(plan.margin),
        "tolerance": finite(plan.tolerance),
        "chosen": _chosen(plan),
        # of the account; its table is what the page is about
        "head": head(plan),
        "end": "\n".join(end(plan)),
        "moments": [asdict(_moment(plan, grasp, at_rest)) for grasp in plan.grasps],
        "transitions": [asdict(_transition(plan, i, moving)) for i in range(len(plan.steps))],
    }


def _chosen(plan: Plan) -> dict[str, float | None] | None:
    """The least margin and tolerance without start and goal; None if nothing was chosen."""
    if plan.chosen_margin == float("inf"):
        return None
    return {"margin": finite(plan.chosen_margin), "tolerance": finite(plan.chosen_tolerance)}


def _moment(plan: Plan, grasp: HeldGrasp, found: Mapping[int, Region]) -> Moment:
    region = found.get(grasp.after_step)
    intervals = {} if region is None else region.intervals
    support, limited = grasp.support, plan.touchable.whole is not plan.touchable
    return Moment(
        {k: (contact.edge, _fraction(contact)) for k, contact in grasp.contacts.items()},
        support.fingers,
        KIND_NAMES[support.kind],
        finite(grasp.margin),
        finite(grasp.tolerance),
        support.center is not None,
        _common_rays(plan, grasp),
        {k: (_fraction(low), _fraction(high)) for k, (low, high) in intervals.items()},
        {k: touchable_part(plan, k, c) for k, c in grasp.contacts.items()} if limited else {},
    )


def _transition(plan: Plan, index: int, found: Mapping[int, Region]) -> Transition:
    step = plan.steps[index]
    text = describe(step)
    match step:
        case Place(finger):
            return Transition("place", (finger,), text)
        case Release(finger):
            return Transition("release", (finger,), text)
        case Slide(moves):
            slide = plan.slides[index]
            assert slide is not None
            functions, *ends = slide
            first, last = (functions.certain_values(f)[0][functions.valid[0]] for f in ends)
            spans = bool(functions.spans[0])
            region = found.get(index + 1)
            return Transition(
                "slide",
                tuple(moves),
                text,
                finite(plan.slide_margins[index]),
                finite(plan.slide_tolerances[index]),
                (tuple(first.tolist()), tuple(last.tolist())) if spans else None,
                tuple(functions.rates[0][functions.valid[0]].tolist()) if spans else None,
                None if region is None else _moving(region),
            )


def _moving(region: Region) -> dict[int, tuple[Span, Span]]:
    """Where fingers may be at both ends of a slide."""
    assert region.before is not None
    ends = [zip(box.lower, box.upper, strict=True) for box in (region.before, region.box)]
    first, last = ([(_fraction(a), _fraction(b)) for a, b in end] for end in ends)
    return dict(zip(region.fingers, zip(first, last, strict=True), strict=True))


def _common_rays(plan: Plan, grasp: HeldGrasp) -> dict[int, Rays]:
    """The common cone as each of two contacts, or of a parallel grasp, sees it."""
    fingers, center = grasp.support.fingers, grasp.support.center
    edges = [grasp.contacts[finger].edge for finger in fingers]
    if center is None and len(edges) != 2:
        return {}
    middle = edges[0] if center is None else center
    others = [edge for edge in edges if edge != middle]
    common = common_cone(plan.cones, np.array([[middle, others[0], others[-1]]]))
    if not common.exists[0]:
        return {}
    first, last = common.boundaries(plan.cones)[0]
    seen = {k: -1.0 if edge == middle else 1.0 for k, edge in zip(fingers, edges, strict=True)}
    return {
        k: ((s * float(first[0]), s * float(first[1])), (s * float(last[0]), s * float(last[1])))
        for k, s in seen.items()
    }


def _fraction(contact: Contact) -> float:
    assert contact.fraction is not None  # contacts of plans are resolved
    return contact.fraction
