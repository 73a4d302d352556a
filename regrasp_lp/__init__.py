"""Regrasp planning for planar polygonal objects by linear programs.

A hand holds a polygon with two or three fingers and changes its grip without ever dropping it.
Every set of force-closure grasps is a union of convex sets given by linear constraints; the
switching graph joins sets between which the hand can switch; a plan is a path in it, with contacts
chosen by a linear program and checked exactly.

Examples
--------
>>> import regrasp_lp as rl
>>> polygon = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], name="block")
>>> plan = rl.plan_regrasp(
...     polygon, [(0, 3.0), (2, 3.0)], [(1, 1.5), (3, 1.5)], friction=0.4)
>>> plan.placements, plan.verify().ok
(2, True)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from regrasp_lp import quality
    from regrasp_lp.build import build_switching_graph, plan_regrasp
    from regrasp_lp.certification import Certification, certify
    from regrasp_lp.completeness import Coverage, coverage
    from regrasp_lp.contact import Contact, Grasp
    from regrasp_lp.errors import (
        ContactError,
        FileFormatError,
        FrictionError,
        HandError,
        MissingExtraError,
        NoPlanFound,
        NotForceClosureError,
        OptionError,
        PolygonError,
        RegraspError,
        SolverError,
    )
    from regrasp_lp.explanation import Explanation
    from regrasp_lp.files import read_polygons
    from regrasp_lp.force_closure import is_force_closure, least_friction
    from regrasp_lp.graph_file import load_graph
    from regrasp_lp.grasp_samples import sample_grasps
    from regrasp_lp.grasp_sets.collection import GraspSet
    from regrasp_lp.many import Built, build_switching_graphs
    from regrasp_lp.planning.hand import Hand
    from regrasp_lp.planning.path_set import PathSet
    from regrasp_lp.planning.plan import Plan
    from regrasp_lp.planning.plan_file import check_plan, read_plan
    from regrasp_lp.planning.sensitivity import Sensitivity
    from regrasp_lp.planning.steps import Place, Release, Slide
    from regrasp_lp.polygon import Polygon
    from regrasp_lp.quality import margin, tolerance
    from regrasp_lp.switching_graph import SwitchingGraph
    from regrasp_lp.why_not import explain

__version__ = "0.1.0"

__all__ = [
    "Built",
    "Certification",
    "Contact",
    "ContactError",
    "Coverage",
    "Explanation",
    "FileFormatError",
    "FrictionError",
    "Grasp",
    "GraspSet",
    "Hand",
    "HandError",
    "MissingExtraError",
    "NoPlanFound",
    "NotForceClosureError",
    "OptionError",
    "PathSet",
    "Place",
    "Plan",
    "Polygon",
    "PolygonError",
    "RegraspError",
    "Release",
    "Sensitivity",
    "Slide",
    "SolverError",
    "SwitchingGraph",
    "build_switching_graph",
    "build_switching_graphs",
    "certify",
    "check_plan",
    "coverage",
    "explain",
    "is_force_closure",
    "least_friction",
    "load_graph",
    "margin",
    "plan_regrasp",
    "quality",
    "read_plan",
    "read_polygons",
    "sample_grasps",
    "tolerance",
]

_MODULES = {
    "build": "build_switching_graph plan_regrasp",
    "certification": "Certification certify",
    "completeness": "Coverage coverage",
    "contact": "Contact Grasp",
    "errors": "ContactError FileFormatError FrictionError HandError MissingExtraError NoPlanFound "
    "NotForceClosureError OptionError PolygonError RegraspError SolverError",
    "explanation": "Explanation",
    "files": "read_polygons",
    "force_closure": "is_force_closure least_friction",
    "graph_file": "load_graph",
    "grasp_samples": "sample_grasps",
    "grasp_sets.collection": "GraspSet",
    "many": "Built build_switching_graphs",
    "planning.hand": "Hand",
    "planning.path_set": "PathSet",
    "planning.plan": "Plan",
    "planning.plan_file": "check_plan read_plan",
    "planning.sensitivity": "Sensitivity",
    "planning.steps": "Place Release Slide",
    "polygon": "Polygon",
    "quality": "margin tolerance",
    "switching_graph": "SwitchingGraph",
    "why_not": "explain",
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names.split()}
"""Where each public name is defined. It is imported from there when it is first asked for."""


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(f"regrasp_lp.{_HOMES[name]}"), name)
    if name == "quality":
        return import_module("regrasp_lp.quality")
    raise AttributeError(f"module 'regrasp_lp' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
