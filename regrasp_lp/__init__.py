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
    "read_plan",
    "read_polygons",
    "tolerance",
]
