"""What pictures of sets in the plane share: the view, the edges of a set, the regions, the key."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.patches import Polygon as Wedge
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.grasp_sets.focus import in_object
from regrasp_lp.grasp_sets.sweeps import Sweeps
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.frame import (
    POINTS_PER_INCH,
    Drawing,
    Frame,
    draw_line,
    fit,
    own_axes,
    shifted,
)
from regrasp_lp.plotting.outline import PolygonArtists, paper_of, plot_polygon, text_half
from regrasp_lp.plotting.placement import Label, Search, place
from regrasp_lp.polygon import Polygon
from regrasp_lp.polytopes import corners

Sign = Line2D | Patch

_LONGEST = 6.0  # side of new axes, in inches
_MARGIN = 22.0  # around what is shown, in points
_NUMBER, _HALO = 9.0, 1.5
_SEARCH = Search(2.5, (0, 4, 9, 15), (0, 25, -25, 50, -50), (0, 0.5, -0.5, 1, -1), sweeps=1)
_KEY: dict[str, Any] = {
    "fontsize": 7.5,
    "handlelength": 1.8,
    "columnspacing": 1.4,
    "borderaxespad": 0.3,
    "facecolor": "white",
    "edgecolor": "none",
    "framealpha": 0.9,
}
CONE: dict[str, Any] = {
    "facecolor": (palette.SKY, 0.3),
    "edgecolor": palette.SKY,
    "linewidth": 0.7,
    "zorder": palette.CONE_LAYER,
}
REGION: dict[str, Any] = {
    "color": palette.BLUE,
    "linewidth": 4.5,
    "solid_capstyle": "round",
    "zorder": palette.REGION_LAYER,
}
EDGE: dict[str, Any] = {
    "color": palette.INK,
    "linewidth": 2.2,
    "solid_capstyle": "round",
    "zorder": palette.EDGE_LAYER,
}
DOT: dict[str, Any] = {
    "marker": "o",
    "markersize": 7.0,
    "markerfacecolor": palette.BLUE,
    "markeredgecolor": palette.INK,
    "markeredgewidth": 1.0,
    "linestyle": "none",
    "zorder": palette.CONTACT_LAYER,
}


@dataclass(frozen=True, eq=False, repr=False)
class Scene(Drawing):
    """An object with some of its edges emphasised, and the key.

    Parameters
    ----------
    polygon : PolygonArtists
        The object.
    edges : mapping of int to matplotlib.lines.Line2D
        The emphasised edges.
    numbers : mapping of int to matplotlib.text.Text
        Their numbers.
    key : matplotlib.legend.Legend or None
        What the colours mean.
    """

    polygon: PolygonArtists
    edges: Mapping[int, Line2D]
    numbers: Mapping[int, Text]
    key: Legend | None

    @property
    def window(self) -> FloatArray:
        """What the axes show and a little around it: min x, min y, max x, max y."""
        x, y = np.sort(self.ax.get_xlim()), np.sort(self.ax.get_ylim())
        low, high = np.stack((x, y), axis=1)
        return np.concatenate((low - 0.02 * (high - low), high + 0.02 * (high - low)))


def set_scene(
    polygon: Polygon,
    edges: Collection[int],
    bounds: FloatArray,
    ax: Axes | None,
    signs: Sequence[Sign],
    *,
    avoid: Sequence[FloatArray] = (),
) -> Scene:
    """Draw an object and the edges of a set, with limits that show `bounds` and leave room.

    Parameters
    ----------
    polygon : Polygon
    edges : collection of int
        Edges to emphasise and to number.
    bounds : numpy.ndarray, shape (4,)
        min x, min y, max x, max y.
    ax : matplotlib.axes.Axes or None
        None for new axes.
    signs : sequence of matplotlib.lines.Line2D or matplotlib.patches.Patch
        What the key shows, at the lower side of the axes; no key if there are none.
    avoid : sequence of numpy.ndarray, shape (2,)
        Points that no number should cover.

    Returns
    -------
    Scene
    """
    if ax is None:
        room = np.array([0.0, 0.1 * (bounds[2:] - bounds[:2]).max() if signs else 0.0])
        ax = own_axes(np.concatenate((bounds[:2] - room, bounds[2:])), _LONGEST)
    drawn = plot_polygon(polygon, ax, edge_numbers=False)
    key = _draw_key(ax, signs) if signs else None
    frame = _fit_above(ax, bounds, key)
    ends = np.stack((polygon.edge_starts, polygon.edge_ends), axis=1)
    lines = {edge: draw_line(ax, ends[edge], **EDGE) for edge in edges}
    numbers = _number(ax, polygon, frame, list(edges), frame.points(np.reshape(avoid, (-1, 2))))
    return Scene(ax, drawn, MappingProxyType(lines), MappingProxyType(numbers), key)


def around(*points: FloatArray) -> FloatArray:
    """Return the bounds of points, each array (..., 2) or bounds (4,)."""
    every = np.concatenate([np.reshape(p, (-1, 2)) for p in points])
    return np.concatenate((every.min(axis=0), every.max(axis=0)))


def grown(bounds: FloatArray, length: float) -> FloatArray:
    """Return bounds moved outwards by a length."""
    return np.concatenate((bounds[:2] - length, bounds[2:] + length))


# --- sets in the plane --------------------------------------------------------------------------


def meeting(first: LinearSets, second: LinearSets) -> LinearSets:
    """Return the intersections of each set over "x" and "y" with each of others.

    Those with boxes apart are left out; others may be empty as well.
    """
    one = np.arange(len(first)).repeat(len(second))
    other = np.tile(np.arange(len(second)), len(first))
    sets = first.take(one).join(second.take(other), on=["x", "y"])
    return sets.take(np.flatnonzero((sets.lower < sets.upper).all(axis=1)))


def within(sets: LinearSets, window: FloatArray) -> LinearSets:
    """Return what of sets over "x" and "y" is in a window, whose sides count for margins."""
    low, high = window[None, :2], window[None, 2:]
    rows = np.concatenate((np.eye(2), -np.eye(2)))[None]
    bounds = np.concatenate((high, -low), axis=1)
    return meeting(sets, LinearSets(("x", "y"), rows, np.ones((1, 4)), bounds, low, high))


def swept(sweeps: Sweeps, regions: IntArray) -> LinearSets:
    """Return intersections of regions, rows (K, r) of their numbers, in the object's coordinates.

    They have no box: some are not bounded.
    """
    sets = in_object(sweeps.cones, sweeps.linear_sets(regions))
    everywhere = np.full_like(sets.lower, np.inf)
    return replace(sets, lower=-everywhere, upper=everywhere)


def draw_sets(scene: Scene, sets: LinearSets, **style: Any) -> PathPatch:
    """Draw the union of sets over "x" and "y", as far as the axes show it, as one path."""
    rings = [ring for ring in corners(within(sets, scene.window)) if len(ring)]
    closed = [Path(np.vstack([ring, ring[:1]]), closed=True) for ring in rings]
    path = Path.make_compound_path(*closed) if closed else Path(np.zeros((0, 2)))
    patch = PathPatch(path, **{"zorder": palette.CELL_LAYER, "joinstyle": "round", **style})
    scene.ax.add_patch(patch)
    return patch


def draw_cones(scene: Scene, cones: Mapping[int, Wedge]) -> Mapping[int, Wedge]:
    """Add cones to the axes, and return them."""
    for cone in cones.values():
        scene.ax.add_patch(cone)
    return MappingProxyType(cones)


# --- marks on edges -----------------------------------------------------------------------------


def draw_regions(
    scene: Scene, polygon: Polygon, regions: Mapping[int, FloatArray]
) -> Mapping[int, Line2D]:
    """Mark parts of edges, each between a first and a last position."""
    marks = {}
    for edge, region in regions.items():
        ends = polygon.points(edge, region / polygon.edge_lengths[edge])
        marks[edge] = draw_line(scene.ax, ends, **REGION)
    return MappingProxyType(marks)


def draw_dot(ax: Axes, at: FloatArray, **style: Any) -> Line2D:
    """Draw a point with a ring around it."""
    return draw_line(ax, at[None], **{**DOT, **style})


def _number(
    ax: Axes, polygon: Polygon, frame: Frame, edges: list[int], avoid: FloatArray
) -> dict[int, Text]:
    """Write the numbers of edges beside them, on the side away from the material."""
    paper, outward = paper_of(polygon, frame), -frame.directions(polygon.normals)
    middles, reach = (paper.starts + paper.ends) / 2, 0.35 * (paper.ends - paper.starts)
    halves = [_HALO + text_half(str(i), _NUMBER, "bold") for i in edges]
    labels = [
        Label(middles[i], outward[i], half, reach[i]) for i, half in zip(edges, halves, strict=True)
    ]
    places = place(paper, labels, _SEARCH, avoid=avoid)
    numbers = {}
    for edge, placed in zip(edges, places, strict=True):
        assert placed is not None  # the search has no limit
        x, y = frame.coordinates(placed.anchor)
        numbers[edge] = ax.text(
            x,
            y,
            str(edge),
            transform=shifted(ax, placed.center - placed.anchor),
            ha="center",
            va="center_baseline",
            fontsize=_NUMBER,
            fontweight="bold",
            color=palette.INK,
            zorder=palette.TEXT_LAYER,
            path_effects=[withStroke(linewidth=2 * _HALO, foreground="white")],
        )
    return numbers


# --- key ----------------------------------------------------------------------------------------


def _draw_key(ax: Axes, signs: Sequence[Sign]) -> Legend:
    """Draw the key in as many columns as fit."""
    width = Frame.of(ax).size[0]
    for columns in range(len(signs), 0, -1):
        key = ax.legend(handles=list(signs), loc="lower center", ncols=columns, **_KEY)
        if _size_of(key)[0] <= width:
            break
    key.set_zorder(palette.TEXT_LAYER + 1)
    return key


def _size_of(key: Legend) -> FloatArray:
    """Width and height of a key in points."""
    dpi = key.figure.dpi
    box = key.get_window_extent(RendererAgg(1, 1, dpi))
    return np.array([box.width, box.height]) * (POINTS_PER_INCH / dpi)


def _fit_above(ax: Axes, bounds: FloatArray, key: Legend | None) -> Frame:
    """Set limits that show bounds above the key."""
    size = Frame.of(ax).size
    taken = 0.0 if key is None else float(min(_size_of(key)[1], 0.4 * size[1]))
    room = size - 2 * np.minimum(_MARGIN, size / 4) - [0.0, taken]
    below = taken * float(((bounds[2:] - bounds[:2]) / room).max())
    reserve = [0, 0, 0, below] if ax.yaxis_inverted() else [0, -below, 0, 0]
    return fit(ax, bounds + reserve, _MARGIN)
