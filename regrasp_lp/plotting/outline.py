"""The object: filled, outlined, its edges numbered."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.textpath import TextPath

from regrasp_lp.friction import FloatArray
from regrasp_lp.plotting.frame import Drawing, Frame, fit, own_axes, shifted
from regrasp_lp.plotting.palette import (
    GREY,
    INK,
    LEADER_LAYER,
    MATERIAL,
    OBJECT_LAYER,
    OUTLINE_LAYER,
    TEXT_LAYER,
)
from regrasp_lp.plotting.placement import CROSSING, Label, Paper, Placed, Search, place
from regrasp_lp.polygon import Polygon

_LEADER_FROM = 4.5  # a number farther than this from its edge is joined to it, in points
_MANY = 60  # with more edges than this, fewer places and only one size of numbers are tried
_BESIDE = (0, 20, -20, 40, -40, 60, -60)
_CLEAR = 0.8 * CROSSING
_OF_FEW = Search(2.5, (0, 4, 8, 13, 19, 26), _BESIDE, (0, 0.5, -0.5, 1, -1), limit=_CLEAR)
_OF_MANY = Search(2.5, (0, 4, 9), (0, 25, -25), (0, 1, -1), limit=_CLEAR)
_SIZES = ((24, 6.0, 9.0), (60, 7.5, 8.0), (150, 9.5, 7.0), (10**9, 12.0, 6.0))
"""Up to how many edges; the longer side of the axes in inches; the size of the numbers."""


@dataclass(frozen=True, eq=False, repr=False)
class PolygonArtists(Drawing):
    """What `plot_polygon` drew.

    Parameters
    ----------
    fill, outline : matplotlib.patches.PathPatch
        One compound path each: holes are holes.
    first_vertex : matplotlib.lines.Line2D or None
        Marks where edge 0 starts, if edges are numbered.
    numbers : mapping of int to matplotlib.text.Text
        The number of each edge that has one.
    leaders : mapping of int to matplotlib.lines.Line2D
        From the middle of an edge to its number, where that is not next to it.
    """

    fill: PathPatch
    outline: PathPatch
    first_vertex: Line2D | None
    numbers: Mapping[int, Text]
    leaders: Mapping[int, Line2D]


def plot_polygon(
    polygon: Polygon, ax: Axes | None = None, *, edge_numbers: bool = True
) -> PolygonArtists:
    """Draw an object and number its edges.

    The number of an edge stands beside it, near its middle, on the side away from the material;
    where there is no room it stands farther away, joined to the edge by a thin line. Numbers are
    placed from the longest edge to the shortest, and up to 60 are made smaller, to 70 %, if that
    finds room for more, or for more beside their edges. One for which no clear place is left is
    not written: those of its neighbours tell it. A small circle marks where edge 0 starts; edges
    are numbered counter-clockwise from there, then those of the holes, clockwise.

    Parameters
    ----------
    polygon : Polygon
    ax : matplotlib.axes.Axes, optional
        Its limits and aspect are set. By default new axes of a new figure, larger for more edges.
    edge_numbers : bool, optional
        Whether to number the edges.

    Returns
    -------
    PolygonArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Examples
    --------
    >>> artists = plot_polygon(Polygon([(0, 0), (4, 0), (4, 3)]))
    >>> sorted(artists.numbers)
    [0, 1, 2]
    >>> artists.figure.savefig("wedge.pdf")  # doctest: +SKIP
    """
    if ax is None:
        ax = own_axes(polygon.bounds, _size(polygon)[0])
        ax.set_title(polygon.name, fontsize=9, loc="left", parse_math=False)
    frame = fit(ax, polygon.bounds)
    drawn = PolygonArtists(ax, *_draw_material(ax, polygon), None, {}, {})
    return number_edges(drawn, polygon, frame) if edge_numbers else drawn


def number_edges(
    drawn: PolygonArtists,
    polygon: Polygon,
    frame: Frame,
    taken: Sequence[Placed] = (),
) -> PolygonArtists:
    """Write the numbers of the edges where `taken` leaves room, and mark where edge 0 starts."""
    x, y = polygon.exterior[0]
    style: dict[str, Any] = {"marker": "o", "markersize": 4.0, "markerfacecolor": "white"}
    first = Line2D([x], [y], color=INK, markeredgewidth=0.8, zorder=LEADER_LAYER, **style)
    drawn.ax.add_line(first)
    font, places = _place_numbers(polygon, frame, taken)
    numbers: dict[int, Text] = {}
    leaders: dict[int, Line2D] = {}
    for edge, placed in places.items():
        numbers[edge], leader = _draw_number(drawn.ax, frame, edge, placed, font)
        if leader is not None:
            leaders[edge] = leader
    return replace(
        drawn,
        first_vertex=first,
        numbers=MappingProxyType(numbers),
        leaders=MappingProxyType(leaders),
    )


def paper_of(polygon: Polygon, frame: Frame) -> Paper:
    """Return where the object lies on the paper."""
    starts, ends = frame.points(polygon.edge_starts), frame.points(polygon.edge_ends)
    return Paper(starts, ends, frame.size)


def text_half(text: str, size: float, weight: str = "normal") -> FloatArray:
    """Return half of the width and half of the height of the ink of digits, in points."""
    return size * _half_of_digits(len(text), weight)


@lru_cache
def _half_of_digits(count: int, weight: str) -> FloatArray:
    ink = TextPath((0, 0), "0" * count, size=100, prop=FontProperties(weight=weight)).get_extents()
    half = np.array([ink.width, ink.height]) / 200
    half.setflags(write=False)
    return half


def _draw_material(ax: Axes, polygon: Polygon) -> tuple[PathPatch, PathPatch]:
    """Fill and outline as two patches, so that cones fit in between."""
    rings = [Path(np.vstack([ring, ring[:1]]), closed=True) for ring in polygon.rings]
    path = Path.make_compound_path(*rings)
    fill = PathPatch(path, facecolor=MATERIAL, edgecolor="none", zorder=OBJECT_LAYER)
    style = {"facecolor": "none", "edgecolor": INK, "linewidth": 1.0, "joinstyle": "round"}
    outline = PathPatch(path, zorder=OUTLINE_LAYER, **style)
    ax.add_patch(fill)
    ax.add_patch(outline)
    return fill, outline


def _size(polygon: Polygon) -> tuple[float, float]:
    """Longer side of the axes in inches, and size of the numbers in points."""
    return next(row[1:] for row in _SIZES if polygon.n_edges <= row[0])


def _place_numbers(
    polygon: Polygon, frame: Frame, taken: Sequence[Placed]
) -> tuple[float, dict[int, Placed]]:
    """Size of the numbers and the places of those that find one, the longest edges first."""
    few = polygon.n_edges <= _MANY
    paper, nominal = paper_of(polygon, frame), _size(polygon)[1]
    outward = -frame.directions(polygon.normals)
    middles, reach = (paper.starts + paper.ends) / 2, 0.3 * (paper.ends - paper.starts)
    order = np.argsort(-polygon.edge_lengths, kind="stable").tolist()
    search, corner = _OF_FEW if few else _OF_MANY, frame.points(polygon.exterior[:1])
    chosen: tuple[float, dict[int, Placed]] = nominal, {}
    most = 0, 0
    for font in (nominal, 0.85 * nominal, 0.7 * nominal) if few else (nominal,):
        labels = [Label(middles[i], outward[i], text_half(str(i), font), reach[i]) for i in order]
        placed = place(paper, labels, search, avoid=corner, taken=taken)
        found = {i: p for i, p in zip(order, placed, strict=True) if p is not None}
        beside = sum(_leader_length(p)[1] < _LEADER_FROM for p in found.values())
        if (len(found), beside) > most:
            most = len(found), beside
            chosen = font, dict(sorted(found.items()))
        if beside == polygon.n_edges:
            break
    return chosen


def _leader_length(placed: Placed) -> tuple[float, float]:
    """Part of the way to a number that is within its box, and the length of the rest."""
    offset = placed.center - placed.anchor
    inside = float(np.min(placed.half / np.maximum(np.abs(offset), 1e-9)))
    return inside, (1 - inside) * float(np.hypot(*offset))


def _draw_number(
    ax: Axes, frame: Frame, edge: int, placed: Placed, font: float
) -> tuple[Text, Line2D | None]:
    x, y = at = frame.coordinates(placed.anchor)
    offset = placed.center - placed.anchor
    style: dict[str, Any] = {"ha": "center", "va": "center_baseline", "fontsize": font}
    text = ax.text(
        x, y, str(edge), transform=shifted(ax, offset), color=INK, zorder=TEXT_LAYER, **style
    )
    inside, length = _leader_length(placed)
    if length < _LEADER_FROM:
        return text, None
    to = at + frame.lengths(offset * (1 - inside - 1.0 / float(np.hypot(*offset))))
    leader = Line2D([x, to[0]], [y, to[1]], color=GREY, linewidth=0.5, zorder=LEADER_LAYER)
    ax.add_line(leader)
    return text, leader
