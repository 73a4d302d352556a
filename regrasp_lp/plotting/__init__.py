"""Pictures of objects, grasps and plans (needs the extra "plot").

Nothing here touches the global state of matplotlib: every function draws on the axes that it is
given, or makes a figure of its own.
"""

from __future__ import annotations

from regrasp_lp.errors import MissingExtraError

try:
    import matplotlib  # noqa: F401  (only to say what is missing before the modules below need it)
except ModuleNotFoundError as error:
    raise MissingExtraError("matplotlib", "plot", "drawing") from error

from regrasp_lp.plotting.animation import plan_gif
from regrasp_lp.plotting.contact_space import (
    ContactSpaceArtists,
    ProjectionArtists,
    SubpolytopeArtists,
    plot_contact_space,
    plot_projections,
    plot_subpolytopes,
)
from regrasp_lp.plotting.filmstrip import plot_plan
from regrasp_lp.plotting.focus_cells import FocusCellArtists, plot_focus_cell
from regrasp_lp.plotting.focus_switch import FocusSwitchArtists, plot_focus_switch
from regrasp_lp.plotting.frame import Drawing
from regrasp_lp.plotting.friction_cones import ConesArtists, plot_cones_at_one_point
from regrasp_lp.plotting.graph import GraphArtists, plot_graph
from regrasp_lp.plotting.grasps import GraspArtists, plot_grasp
from regrasp_lp.plotting.normals import CandidateArtists, Window, plot_candidates
from regrasp_lp.plotting.outline import PolygonArtists, plot_polygon
from regrasp_lp.plotting.parallel_sets import (
    CommonConeArtists,
    UnionVolumeArtists,
    plot_common_cone,
    plot_union_volume,
)
from regrasp_lp.plotting.quality import QualityMapArtists, plot_quality_map
from regrasp_lp.plotting.sets import plot_grasp_set

__all__ = [
    "CandidateArtists",
    "CommonConeArtists",
    "ConesArtists",
    "ContactSpaceArtists",
    "Drawing",
    "FocusCellArtists",
    "FocusSwitchArtists",
    "GraphArtists",
    "GraspArtists",
    "PolygonArtists",
    "ProjectionArtists",
    "QualityMapArtists",
    "SubpolytopeArtists",
    "UnionVolumeArtists",
    "Window",
    "plan_gif",
    "plot_candidates",
    "plot_common_cone",
    "plot_cones_at_one_point",
    "plot_contact_space",
    "plot_focus_cell",
    "plot_focus_switch",
    "plot_graph",
    "plot_grasp",
    "plot_grasp_set",
    "plot_plan",
    "plot_polygon",
    "plot_projections",
    "plot_quality_map",
    "plot_subpolytopes",
    "plot_union_volume",
]
