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

from regrasp_lp.plotting.filmstrip import plot_plan
from regrasp_lp.plotting.grasps import GraspArtists, plot_grasp
from regrasp_lp.plotting.outline import PolygonArtists, plot_polygon

__all__ = ["GraspArtists", "PolygonArtists", "plot_grasp", "plot_plan", "plot_polygon"]
