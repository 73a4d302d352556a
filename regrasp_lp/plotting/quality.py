"""Maps of grasp quality: over the focus cell on the object, or over a section of contact space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colorbar import Colorbar
from matplotlib.contour import QuadContourSet
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.ticker import MaxNLocator
from scipy.ndimage import distance_transform_edt

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.frame import POINTS_PER_INCH, Drawing, Frame, OwnFigure
from regrasp_lp.plotting.scene import (
    DOT,
    EDGE,
    Sign,
    around,
    draw_dot,
    draw_sets,
    set_scene,
    within,
)
from regrasp_lp.quality.maps import QualityMap

_BAR, _BAR_GAP, _BAR_ROOM = 0.14, 0.12, 0.85  # of the scale beside the axes, in inches
_COLORS = "cividis"  # read alike with any kind of colour blindness, and in grey
_LEVELS = 7
_OUTSIDE: dict[str, Any] = {"facecolor": palette.MATERIAL, "hatch": "///", "edgecolor": "#CFCFCA"}
_LINES: dict[str, Any] = {"colors": "white", "linewidths": 0.6, "alpha": 0.8}
_CELL: dict[str, Any] = {"facecolor": "none", "edgecolor": "none"}
_BEST: dict[str, Any] = {"markerfacecolor": "white", "marker": "*", "markersize": 12.0}

MaskedValues: TypeAlias = "np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]"


@dataclass(frozen=True, eq=False, repr=False)
class QualityMapArtists(Drawing):
    """What `plot_quality_map` drew.

    Parameters
    ----------
    mesh : matplotlib.collections.QuadMesh
        A cell for each sample within the set; over a focus cell all samples are coloured, those
        beyond the cell as the nearest one within, so that the colours end where the cell does.
    levels : matplotlib.contour.QuadContourSet or None
        Lines of equal values; None where the values are all alike.
    best : matplotlib.lines.Line2D
        The best of the samples.
    scale : matplotlib.colorbar.Colorbar
    cell : matplotlib.patches.PathPatch or None
        The focus cell, as far as it was sampled, which ends mesh and levels; None over contacts.
    """

    mesh: QuadMesh
    levels: QuadContourSet | None
    best: Line2D
    scale: Colorbar
    cell: PathPatch | None = None


def plot_quality_map(found: QualityMap, ax: Axes | None = None) -> QualityMapArtists:
    """Draw a map of grasp quality.

    Samples within the set are coloured, the brighter the better, with lines of equal values; what
    is hatched is no grasp of the set. A star marks the best sample. Over a focus cell the map is
    drawn on the object, with the edges of the set, and ends where the cell does, which may be
    beyond the object. The title says what is mapped.

    Parameters
    ----------
    found : QualityMap
    ax : matplotlib.axes.Axes, optional
        Its limits are set; the scale is drawn beside it. By default new axes of a new figure.

    Returns
    -------
    QualityMapArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    OptionError
        If no sample is in the set, so that there is nothing to draw.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> block = rl.Polygon([(0, 0), (8, 0), (8, 3), (0, 3)])
    >>> pair = rl.build_switching_graph(block, friction=0.5).sets[0]
    >>> rl.quality.quality_map(pair, "margin", samples=33).plot().ax.get_xlabel()
    'position on edge 0'
    """
    if found.best is None:
        raise OptionError(
            f"none of {found.values.size} samples is in the set: ask for more with samples=..., or "
            "fix another position"
        )
    seen = np.ma.masked_where(~found.within | ~np.isfinite(found.values), found.values)
    cell = None
    if found.over == "focus":
        ax, cell = _on_object(found, ax)
        seen = _extended(found, seen)
    else:
        ax = _in_contact_space(found, ax)
    colors = _COLORS + "_r" * found.metric.less_is_better
    layer = palette.CELL_LAYER
    mesh = ax.pcolormesh(
        found.x, found.y, seen, cmap=colors, shading="nearest", zorder=layer, rasterized=True
    )
    levels = None
    if seen.max() > seen.min():
        ticks = np.asarray(MaxNLocator(_LEVELS).tick_values(seen.min(), seen.max()))
        inner = ticks[(ticks > seen.min()) & (ticks < seen.max())]
        if len(inner):
            levels = ax.contour(found.x, found.y, seen, inner, zorder=layer + 0.1, **_LINES)
    for artist in (mesh, levels) if cell is not None else ():
        if artist is not None:
            artist.set_clip_path(cell)
    best = draw_dot(ax, _best_of(found), **_BEST)
    return QualityMapArtists(ax, mesh, levels, best, _draw_scale(ax, found, mesh), cell)


def _best_of(found: QualityMap) -> FloatArray:
    assert found.best is not None
    row, column = found.best
    return np.array([found.x[column], found.y[row]])


def _extended(found: QualityMap, seen: MaskedValues) -> MaskedValues:
    """Values with those that are masked replaced by the nearest one that is not."""
    masked = np.ma.getmaskarray(seen)
    if masked.all():
        return seen
    steps = [float(at[1] - at[0]) for at in (found.y, found.x)]
    nearest = distance_transform_edt(masked, steps, return_distances=False, return_indices=True)
    return np.ma.masked_array(found.values[tuple(nearest)], mask=False)


def _on_object(found: QualityMap, ax: Axes | None) -> tuple[Axes, PathPatch]:
    """Axes with the object and the edges of the set, and the focus cell as far as it is sampled."""
    polygon = found.grasp_set.polygon
    view = around(polygon.bounds, np.stack((found.x[[0, -1]], found.y[[0, -1]]), axis=1))
    signs: list[Sign] = [
        Line2D([], [], **EDGE, label="edge of the set"),
        Line2D([], [], **{**DOT, **_BEST}, label="best sample"),
    ]
    avoid = [_best_of(found)]
    scene = set_scene(polygon, found.grasp_set.edges, view, ax, signs, avoid=avoid)
    if ax is None:
        _make_room(scene.ax)
    edges = ", ".join(map(str, found.grasp_set.edges))
    title = f"{found.metric.name} over the focus cell of edges {edges}"
    scene.ax.set_title(title, fontsize=9, loc="left", parse_math=False)
    cell = found.grasp_set.focus_cell
    assert cell is not None
    window = np.array([found.x[0], found.y[0], found.x[-1], found.y[-1]])
    return scene.ax, draw_sets(scene, within(cell, window), **_CELL)


def _in_contact_space(found: QualityMap, ax: Axes | None) -> Axes:
    """Axes over two positions, hatched where no sample is."""
    sides = np.array([found.x[-1], found.y[-1]])
    if ax is None:
        ax = _own_plane(sides)
    ax.set(xlim=(0, sides[0]), ylim=(0, sides[1]))
    edges, names = found.grasp_set.edges, found.grasp_set.names
    labels = [_position(edges, names.index(name)) for name in found.names]
    ax.set_xlabel(labels[0], fontsize=9)
    ax.set_ylabel(labels[1], fontsize=9)
    ax.tick_params(labelsize=7, length=2.5, width=0.6)
    ax.patch.set(**_OUTSIDE)
    fixed = ", ".join(f"{name} = {at:.4g}" for name, at in found.fixed.items())
    title = ", ".join(part for part in (found.grasp_set.polygon.name, fixed) if part)
    ax.set_title(title, fontsize=9, loc="left", parse_math=False)
    return ax


def _own_plane(sides: FloatArray) -> Axes:
    """New axes for a box of positions, with room for a scale on the right."""
    width, height = 4.2 * np.maximum(sides / sides.max(), 0.3)
    left, right, bottom, top = 0.65, _BAR_ROOM + 0.15, 0.55, 0.35
    size = width + left + right, height + bottom + top
    figure = OwnFigure(size, dpi=110)
    box = left / size[0], bottom / size[1], width / size[0], height / size[1]
    return figure.add_axes(box)


def _position(edges: tuple[int, ...], slot: int) -> str:
    second = "second " * (edges[slot] in edges[:slot])
    return f"{second}position on edge {edges[slot]}"


def _make_room(ax: Axes) -> None:
    """Widen the figure of new axes for a scale on the right of them."""
    figure = ax.figure
    assert isinstance(figure, OwnFigure)
    width, height = figure.get_size_inches()
    box = ax.get_position(original=True)
    narrower = width / (width + _BAR_ROOM)
    figure.set_size_inches(width + _BAR_ROOM, height)
    ax.set_position((box.x0 * narrower, box.y0, box.width * narrower, box.height))


def _draw_scale(ax: Axes, found: QualityMap, mesh: QuadMesh) -> Colorbar:
    """Draw what the colours mean, on the right of the axes."""
    frame = Frame.of(ax).size / POINTS_PER_INCH
    place = (1 + _BAR_GAP / frame[0], 0.0, _BAR / frame[0], 1.0)
    scale = ax.figure.colorbar(mesh, cax=ax.inset_axes(place))
    metric = found.metric
    unit = f" ({metric.unit})" * bool(metric.unit)
    options = "".join(f", {name} {value}" for name, value in metric.options.items())
    better = "less is better" if metric.less_is_better else "more is better"
    scale.set_label(f"{metric.name}{unit}{options}: {better}", fontsize=8, parse_math=False)
    scale.ax.tick_params(labelsize=7, length=2.5, width=0.6)
    scale.outline.set_linewidth(0.6)
    return scale
