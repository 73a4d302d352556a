"""Parallel sets: the common cone, its outer regions, the union volume (Figs. 3.5 and 3.13)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.patches import Polygon as Wedge

from regrasp_lp.circuits import cross
from regrasp_lp.contact import Grasp
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.candidates import common_cone
from regrasp_lp.grasp_sets.collection import GraspSet
from regrasp_lp.grasp_sets.sweeps import Sweeps
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.frame import Drawing, check_drawable, draw_line
from regrasp_lp.plotting.grasps import FORCE, pie
from regrasp_lp.plotting.scene import (
    CONE,
    DOT,
    EDGE,
    Scene,
    Sign,
    draw_cones,
    draw_dot,
    draw_sets,
    grown,
    set_scene,
    swept,
)

_AROUND = 0.12  # part of the diameter to show around the object
_SMALL = 0.3  # radius of the cones at the outer contacts, in diameters of the object
_LEFT: dict[str, Any] = {
    "facecolor": (palette.ORANGE, 0.22),
    "edgecolor": (palette.ORANGE, 0.5),
    "linewidth": 0.0,
    "hatch": "/",
}
_RIGHT: dict[str, Any] = {
    "facecolor": (palette.PURPLE, 0.22),
    "edgecolor": (palette.PURPLE, 0.5),
    "linewidth": 0.0,
    "hatch": "\\",
}
_CENTER: dict[str, Any] = {"marker": "s", "markersize": 7.5}
_CROSSING: dict[str, Any] = {"marker": "D", "markersize": 5.5, "markerfacecolor": "white"}
_SEGMENT: dict[str, Any] = {"color": palette.INK, "linewidth": 1.1, "zorder": palette.LINE_LAYER}
_INSIDE: dict[str, Any] = {"color": palette.VERMILLION, "linewidth": 2.6}
_CENTER_EDGE: dict[str, Any] = {**EDGE, "color": palette.BLUE, "linewidth": 4.0}


@dataclass(frozen=True, eq=False, repr=False)
class CommonConeArtists(Drawing):
    """What `plot_common_cone` drew.

    Parameters
    ----------
    scene : Scene
        The object, the three edges and the key.
    contacts : mapping of int to matplotlib.lines.Line2D
        The contact on each edge.
    outer : tuple of matplotlib.patches.PathPatch
        The left and the right outer region.
    common : tuple of matplotlib.patches.Polygon
        The two sides of the common cone at the centre contact.
    cones : mapping of int to matplotlib.patches.Polygon
        The common cone at the two other contacts.
    segment, inside : matplotlib.lines.Line2D
        Between these contacts; the part of it in the common cone.
    crossing : matplotlib.lines.Line2D
        A point on that part.
    forces : mapping of int to matplotlib.lines.Line2D
        Parallel lines through the contacts, that of the centre through the point.
    """

    scene: Scene
    contacts: Mapping[int, Line2D]
    outer: tuple[PathPatch, PathPatch]
    common: tuple[Wedge, Wedge]
    cones: Mapping[int, Wedge]
    segment: Line2D
    inside: Line2D
    crossing: Line2D
    forces: Mapping[int, Line2D]


@dataclass(frozen=True, eq=False, repr=False)
class UnionVolumeArtists(Drawing):
    """What `plot_union_volume` drew.

    Parameters
    ----------
    scene : Scene
        The object, the three edges and the key.
    volume : matplotlib.patches.PathPatch
        The common cones at all points of the centre edge.
    outer : tuple of matplotlib.patches.PathPatch
        The left and the right outer region.
    """

    scene: Scene
    volume: PathPatch
    outer: tuple[PathPatch, PathPatch]


def plot_common_cone(
    grasp_set: GraspSet, grasp: Grasp | None = None, ax: Axes | None = None, *, key: bool = True
) -> CommonConeArtists:
    """Draw why three contacts can hold the object with parallel forces (chapter, Fig. 3.5).

    The common cone, drawn at the centre contact on both sides, leaves two outer regions. Where the
    segment between the other contacts is in the cone, any point of it tells a direction of forces
    that is in all three cones; if it meets the cone in the centre contact alone, all directions in
    the cone will do.

    Parameters
    ----------
    grasp_set : GraspSet
        A parallel set.
    grasp : Grasp, optional
        A grasp in the set; by default its witness.
    ax : matplotlib.axes.Axes, optional
        Its limits and aspect are set. By default new axes of a new figure.
    key : bool, optional
        Whether to say what the colours mean.

    Returns
    -------
    CommonConeArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    OptionError
        If this is no parallel set, or the grasp is not in it.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> bar = rl.Polygon([(0, 0), (9, 0), (9, 2), (5, 2), (5, 1), (4, 1), (4, 2), (0, 2)])
    >>> graph = rl.build_switching_graph(bar, 0.2, sets="chapter")
    >>> sorted(plot_common_cone(graph.sets[-1]).contacts) == list(graph.sets[-1].edges)
    True
    """
    check_drawable(grasp_set)
    center, rays = common_cone_of(grasp_set)
    grasp = grasp_set.witness if grasp is None else grasp
    if grasp not in grasp_set:
        raise OptionError(f"the grasp is not in the parallel set on edges {grasp_set.edges}")
    polygon = grasp_set.polygon
    resolved = polygon.resolve(grasp)
    at = {c.edge: polygon.point(c) for c in resolved}
    b, c = (edge for edge in grasp_set.edges if edge != center)
    part = _part_in_cone(at[center], rays, at[b], at[c])
    crossing = part.mean(axis=0)
    signs, avoid = _cone_signs() if key else [], [crossing, *at.values()]
    scene = set_scene(polygon, grasp_set.edges, _view(grasp_set), ax, signs, avoid=avoid)
    far = 2 * float(np.hypot(*(scene.window[2:] - scene.window[:2])))
    outer = {edge: pie(at[edge], rays, _SMALL * polygon.diameter, **CONE) for edge in (b, c)}
    position = next(contact.position for contact in resolved if contact.edge == center)
    return CommonConeArtists(
        scene.ax,
        scene,
        _dots(scene, at, center),
        _draw_outer(scene, grasp_set.outer_regions(position)),
        draw_double_cone(scene.ax, at[center], rays, far),
        draw_cones(scene, outer),
        draw_line(scene.ax, np.stack((at[b], at[c])), **_SEGMENT),
        draw_line(scene.ax, part, **{**_SEGMENT, **_INSIDE}),
        draw_dot(scene.ax, crossing, **_CROSSING),
        _forces(scene.ax, at, far * _direction(crossing - at[center], rays)),
    )


def plot_union_volume(
    grasp_set: GraspSet, ax: Axes | None = None, *, key: bool = True
) -> UnionVolumeArtists:
    """Draw the common cones at all points of the centre edge (chapter, Fig. 3.13).

    Three edges have a parallel grasp iff the two others are not in the same one of the two outer
    regions of this union volume.

    Parameters
    ----------
    grasp_set : GraspSet
        A parallel set.
    ax : matplotlib.axes.Axes, optional
        Its limits and aspect are set. By default new axes of a new figure.
    key : bool, optional
        Whether to say what the colours mean.

    Returns
    -------
    UnionVolumeArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    OptionError
        If this is no parallel set.
    """
    check_drawable(grasp_set)
    center, _ = common_cone_of(grasp_set)
    signs = _volume_signs() if key else []
    scene = set_scene(grasp_set.polygon, grasp_set.edges, _view(grasp_set), ax, signs)
    scene.edges[center].set(**_CENTER_EDGE)
    return UnionVolumeArtists(
        scene.ax,
        scene,
        draw_sets(scene, _union_volume(grasp_set, center), **CONE),
        _draw_outer(scene, grasp_set.outer_regions()),
    )


# --- geometry -----------------------------------------------------------------------------------


def common_cone_of(grasp_set: GraspSet) -> tuple[int, FloatArray]:
    """Return the centre edge and the boundaries of the common cone; OptionError if none."""
    if grasp_set.center is None or grasp_set.common_cone is None:
        raise OptionError(
            f"a common cone is that of a parallel set; this one is {grasp_set.kind} "
            '(parallel sets are among those of sets="chapter")'
        )
    return grasp_set.center, grasp_set.common_cone


def _view(grasp_set: GraspSet) -> FloatArray:
    polygon = grasp_set.polygon
    return grown(polygon.bounds, _AROUND * polygon.diameter)


def _part_in_cone(apex: FloatArray, rays: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return the ends of the longest part of a segment in a double-sided cone, shape (2, 2).

    The apex is in no part but as an end.
    """
    start, along = b - apex, c - b
    change = cross(along, rays)
    crossings = -cross(start, rays) / np.where(change == 0, np.nan, change)
    cuts = np.array([0.0, *np.sort(crossings[(crossings > 0) & (crossings < 1)]), 1.0])
    middles = start + (cuts[:-1] + cuts[1:])[:, None] / 2 * along
    inside = cross(rays[0], middles) * cross(middles, rays[1]) > 0
    best = int(np.where(inside, np.diff(cuts), -1.0).argmax())
    return np.asarray(b + cuts[best : best + 2, None] * along)


def _direction(toward: FloatArray, rays: FloatArray) -> FloatArray:
    """Return a unit vector in a double-sided cone: along `toward`, or in the middle of the cone.

    The middle is for three contacts on one line, which meets the cone in its apex alone.
    """
    if cross(rays[0], toward) * cross(toward, rays[1]) <= 0:
        toward = rays.sum(axis=0)
    return np.asarray(toward / np.hypot(*toward))


def _union_volume(grasp_set: GraspSet, center: int) -> LinearSets:
    """Return the common cones at all points of the centre edge, one set for each side of it."""
    cones = grasp_set.torque.cones
    others = [edge for edge in grasp_set.edges if edge != center]
    common = common_cone(cones, np.array([[center, *others]]))
    sweeps = Sweeps.of_rays(cones, np.array([center]), common.ray, -common.sign)
    return swept(sweeps, np.array([[0], [1]]))


# --- drawing ------------------------------------------------------------------------------------


def draw_double_cone(
    ax: Axes, apex: FloatArray, rays: FloatArray, radius: float
) -> tuple[Wedge, Wedge]:
    """Draw both sides of the common cone."""
    sides = pie(apex, rays, radius, **CONE), pie(apex, -rays, radius, **CONE)
    for side in sides:
        ax.add_patch(side)
    return sides


def _draw_outer(scene: Scene, regions: LinearSets) -> tuple[PathPatch, PathPatch]:
    return draw_sets(scene, regions[0], **_LEFT), draw_sets(scene, regions[1], **_RIGHT)


def _dots(scene: Scene, at: Mapping[int, FloatArray], center: int) -> Mapping[int, Line2D]:
    return MappingProxyType(
        {e: draw_dot(scene.ax, p, **(_CENTER if e == center else {})) for e, p in at.items()}
    )


def _forces(ax: Axes, at: Mapping[int, FloatArray], reach: FloatArray) -> Mapping[int, Line2D]:
    """Draw parallel lines through the contacts, as far as `reach` to both sides."""
    ends = np.stack((-reach, reach))
    return MappingProxyType({e: draw_line(ax, p + ends, **FORCE) for e, p in at.items()})


# --- keys ---------------------------------------------------------------------------------------


def _cone_signs() -> list[Sign]:
    return [
        Line2D([], [], **EDGE, label="edge of the set"),
        Line2D([], [], **{**DOT, **_CENTER}, label="centre contact"),
        Line2D([], [], **DOT, label="outer contact"),
        Patch(**CONE, label="common cone"),
        Patch(**_LEFT, label="outer region"),
        Patch(**_RIGHT, label="other outer region"),
        Line2D([], [], **{**_SEGMENT, **_INSIDE}, label="segment within the cone"),
        Line2D([], [], **FORCE, label="parallel forces"),
    ]


def _volume_signs() -> list[Sign]:
    return [
        Line2D([], [], **_CENTER_EDGE, label="centre edge"),
        Line2D([], [], **EDGE, label="outer edge"),
        Patch(**CONE, label="union volume"),
        Patch(**_LEFT, label="outer region"),
        Patch(**_RIGHT, label="other outer region"),
    ]
