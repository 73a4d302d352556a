"""Three friction cones at one point, and the common cone (Fig. 3.4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon as Wedge
from matplotlib.text import Text

from regrasp_lp.grasp_sets.collection import GraspSet
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.frame import Drawing, fit, own_axes
from regrasp_lp.plotting.grasps import pie
from regrasp_lp.plotting.parallel_sets import common_cone_of, draw_double_cone
from regrasp_lp.plotting.scene import CONE, around

_INVERTED: dict[str, Any] = {"linestyle": palette.DASHES, "edgecolor": palette.INK}
_RADII = (1.0, 1.35, 1.7)  # of the cones at one point
_OUTLINE: dict[str, Any] = {"facecolor": "none", "edgecolor": palette.INK, "linewidth": 1.1}


@dataclass(frozen=True, eq=False, repr=False)
class ConesArtists(Drawing):
    """What `plot_cones_at_one_point` drew.

    Parameters
    ----------
    cones : mapping of int to matplotlib.patches.Polygon
        The friction cone of each edge, that of the centre edge inverted.
    labels : mapping of int to matplotlib.text.Text
        Their names.
    common : tuple of matplotlib.patches.Polygon
        The two sides of the common cone.
    """

    cones: Mapping[int, Wedge]
    labels: Mapping[int, Text]
    common: tuple[Wedge, Wedge]


def plot_cones_at_one_point(grasp_set: GraspSet, ax: Axes | None = None) -> ConesArtists:
    """Draw three friction cones at one point, and the common cone (chapter, Fig. 3.4b and c).

    The cone of the centre edge is inverted and dashed. The common cone is filled on both sides;
    the radii of the cones only tell them apart.

    Parameters
    ----------
    grasp_set : GraspSet
        A parallel set.
    ax : matplotlib.axes.Axes, optional
        Its limits and aspect are set. By default new axes of a new figure. Ticks are taken off, as
        the radii mean nothing.

    Returns
    -------
    ConesArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    OptionError
        If this is no parallel set.
    """
    center, common = common_cone_of(grasp_set)
    unit_rays, origin = grasp_set.torque.cones.unit_rays, np.zeros(2)
    cones, labels = {}, {}
    inverted_last = sorted(grasp_set.edges, key=lambda edge: edge == center)
    for edge, radius in zip(inverted_last, _RADII, strict=True):
        sign, style = (-1, _INVERTED) if edge == center else (1, {})
        rays = sign * unit_rays[[2 * edge, 2 * edge + 1]]
        cones[edge] = pie(origin, rays, radius, **{**CONE, **_OUTLINE, **style})
    shown = around(*(cone.get_xy() for cone in cones.values()), -common)
    if ax is None:
        ax = own_axes(shown, 4.5)
    ax.set_axis_off()
    fit(ax, shown)
    double = draw_double_cone(ax, origin, common, 1.0)
    for edge, cone in cones.items():
        ax.add_patch(cone)
        labels[edge] = _name_cone(ax, edge, cone, inverted=edge == center)
    return ConesArtists(ax, MappingProxyType(cones), MappingProxyType(labels), double)


def _name_cone(ax: Axes, edge: int, cone: Wedge, *, inverted: bool) -> Text:
    """Write the name of a cone in the middle of its rim."""
    rim = cone.get_xy()[1:-1]  # from the apex to the apex
    x, y = rim[len(rim) // 2]
    return ax.text(
        x,
        y,
        rf"$-C_{{{edge}}}$" if inverted else rf"$C_{{{edge}}}$",
        ha="center",
        va="center",
        fontsize=10,
        color=palette.INK,
        zorder=palette.TEXT_LAYER,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5},
    )
