"""Grasp sets in contact space, and their projections (Figs. 3.8 and 3.9)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator, StrMethodFormatter
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.collection import GraspSet
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.frame import Drawing, OwnFigure, check_drawable
from regrasp_lp.plotting.regions import body, faces_of, shadows, side, sides
from regrasp_lp.polytopes import corners

_FLATTEST = 0.55  # least ratio of two sides of a box in space, on the paper
_STEPS = (1, 2, 2.5, 5, 10)  # of ticks


@dataclass(frozen=True, eq=False, repr=False)
class SubpolytopeArtists(Drawing):
    """What `plot_subpolytopes` drew.

    Parameters
    ----------
    polytopes : mapping of int to Poly3DCollection
        Those of K0 to K5 that have an interior, by number: a face each, of positions.
    box : Line3DCollection
    """

    polytopes: Mapping[int, Poly3DCollection]
    box: Line3DCollection


@dataclass(frozen=True, eq=False, repr=False)
class ContactSpaceArtists(Drawing):
    """What `plot_contact_space` drew; in space or, for two contacts, in the plane.

    Parameters
    ----------
    never_up : Poly3DCollection or PathPatch or None
        The convex body where no torque function is positive, at the near corner.
    never_down : Poly3DCollection or PathPatch or None
        The convex body where none is negative, at the far corner.
    between : Poly3DCollection or PathPatch
        The set: in space its faces on the sides of the box.
    """

    never_up: Poly3DCollection | PathPatch | None
    never_down: Poly3DCollection | PathPatch | None
    between: Poly3DCollection | PathPatch


@dataclass(frozen=True, eq=False, repr=False)
class ProjectionArtists(Drawing):
    """What `plot_projections` drew; None is what is empty.

    Parameters
    ----------
    first, second : matplotlib.patches.PathPatch or None
        The two projections.
    common : matplotlib.patches.PathPatch or None
        Where both sets can be held.
    """

    first: PathPatch | None
    second: PathPatch | None
    common: PathPatch | None


def plot_subpolytopes(
    grasp_set: GraspSet, ax: Axes3D | None = None, *, key: bool = True
) -> SubpolytopeArtists:
    """Draw the six convex sub-polytopes of a parallel set in contact space (Fig. 3.8a).

    K0 and K1 have the contacts that are not on the centre edge in different outer regions; in K2
    and K4 the first one, in K3 and K5 the second one is in the common cone, behind (K2, K3) or
    ahead. They overlap; their union is the set.

    Parameters
    ----------
    grasp_set : GraspSet
        A parallel set.
    ax : mpl_toolkits.mplot3d.axes3d.Axes3D, optional
        By default new axes of a new figure.
    key : bool, optional
        Whether to say what the colours mean.

    Returns
    -------
    SubpolytopeArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    OptionError
        If the set is not parallel, or the axes have no depth.
    """
    check_drawable(grasp_set)
    if grasp_set.subpolytopes is None:
        raise OptionError(
            f"sub-polytopes are those of a parallel set, this one is {grasp_set.kind}: "
            "plot_contact_space draws any set"
        )
    ax = _space(ax, grasp_set)
    box = _draw_box(ax, grasp_set)
    lengths = grasp_set.torque.lengths[0]
    drawn, keys = {}, []
    for k, points in enumerate(corners(grasp_set.subpolytopes)):
        color = palette.SIX[k]
        if len(points):
            drawn[k] = _draw_faces(ax, faces_of(points, lengths), color, 0.2)
            keys.append(_key(color, f"K{k}", 0.35))
        else:
            keys.append(Patch(facecolor="none", edgecolor=palette.GREY, label=f"K{k}: empty"))
    if key:
        _write_key(ax, keys, 3)
    return SubpolytopeArtists(ax, MappingProxyType(drawn), box)


def plot_contact_space(
    grasp_set: GraspSet, ax: Axes | None = None, *, key: bool = True
) -> ContactSpaceArtists:
    """Draw a grasp set in contact space, between the two convex bodies that bound it.

    Every torque function grows with every position. Where none is positive, at the near corner,
    the fingers cannot turn the object one way; where none is negative, at the far corner, not the
    other way. The set is the rest of the box of positions. Of two contacts on one edge the half
    of the box is drawn in which they are in order.

    Parameters
    ----------
    grasp_set : GraspSet
        Of any kind: two fingers are drawn in the plane, three in space.
    ax : matplotlib.axes.Axes, optional
        For three fingers an ``Axes3D``. By default new axes of a new figure.
    key : bool, optional
        Whether to say what the colours mean.

    Returns
    -------
    ContactSpaceArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    OptionError
        If the axes have depth for two fingers, or none for three.
    """
    check_drawable(grasp_set)
    lengths = grasp_set.torque.lengths[0]
    bodies = [body(grasp_set, sign) for sign in (1, -1)]
    colors = palette.BLUE, palette.VERMILLION
    keys = [
        _key(colors[0], "no torque function is positive", 0.4),
        _key(colors[1], "no torque function is negative", 0.4),
        _key(palette.SET, "between them: the grasp set", 0.6),
    ]
    drawn: list[Any]
    if len(lengths) == 2:
        ax = _plane(ax, _positions(grasp_set.edges), lengths)
        between = [p * lengths for p in side(grasp_set, [0, 1], 0.0).polygons()]
        shapes = [[points] if len(points) else [] for points in bodies]
        drawn = [_draw_polygons(ax, s, c, 0.4) for s, c in zip(shapes, colors, strict=True)]
        drawn.append(_draw_polygons(ax, between, palette.SET, 0.6))
    else:
        ax = _space(ax, grasp_set)
        _draw_box(ax, grasp_set)
        drawn = [
            _draw_faces(ax, faces_of(points, lengths), color, 0.4) if len(points) else None
            for points, color in zip(bodies, colors, strict=True)
        ]
        drawn.append(_draw_faces(ax, sides(grasp_set), palette.SET, 0.25))
    if key:
        _write_key(ax, [sign for sign, artist in zip(keys, drawn, strict=True) if artist], 1)
    return ContactSpaceArtists(ax, *drawn)


def plot_projections(
    first: GraspSet,
    second: GraspSet,
    on: int | Sequence[int],
    ax: Axes | None = None,
    *,
    key: bool = True,
) -> ProjectionArtists:
    """Draw where the contacts that two sets hold in common can be (Figs. 3.8c, 3.8d and 3.9b).

    A projection is the part of contact space, over the held positions alone, in which some
    positions of the other contacts complete a grasp of the set. Where the two overlap the hand can
    hold these contacts while the others change over. The chapter unites the projections of convex
    pieces; here each is drawn at once, exactly.

    Parameters
    ----------
    first, second : GraspSet
        Two sets of one object, of any kinds.
    on : int or sequence of int
        The edge, or the two edges, of the held contacts. One edge gives intervals, drawn one below
        the other; where it has two contacts of a set, either may be the held one.
    ax : matplotlib.axes.Axes, optional
        By default new axes of a new figure.
    key : bool, optional
        Whether to say what the colours mean.

    Returns
    -------
    ProjectionArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    OptionError
        If a set has no contacts on these edges, their number is not 1 or 2, the sets are not of
        one object, or the axes have depth.
    """
    check_drawable(first)
    check_drawable(second)
    held = np.atleast_1d(on).tolist()
    if len(held) not in (1, 2):
        raise OptionError(f"projections are drawn on 1 or 2 held edges, got {len(held)}: {held}")
    if first.polygon != second.polygon:
        raise OptionError("the two sets are of different objects: they have no edges in common")
    each = [shadows(grasp_set, held) for grasp_set in (first, second)]
    both = [one & other for one, other in product(*each)]
    lengths = np.array([first.torque.cones.lengths[edge] for edge in held])
    shapes = [[p for region in found for p in region.polygons()] for found in (*each, both)]
    if len(held) == 1:
        ax, lengths = _draw_rows(ax, held[0], lengths[0]), np.append(lengths, 1.0)
        shapes = [[p * [1, 0.6] + [0, k + 0.2] for p in s] for k, s in enumerate(shapes)]
    else:
        ax = _plane(ax, _positions(held), lengths)
    looks = ((palette.BLUE, 0.25, ""), (palette.ORANGE, 0.3, ""), (palette.INK, 0.12, "///"))
    drawn = [
        _draw_polygons(ax, [p * lengths for p in polygons], color, alpha, hatch)
        for polygons, (color, alpha, hatch) in zip(shapes, looks, strict=True)
    ]
    common = "both can be held" if drawn[2] else "no position is common to both"
    texts = (f"first: {_title(first)}", f"second: {_title(second)}", common)
    keys = [
        _key(color, text, alpha, hatch)
        for (color, alpha, hatch), text in zip(looks, texts, strict=True)
    ]
    if key:
        _write_key(ax, keys, 1)
    return ProjectionArtists(ax, *drawn)


# --- axes and artists ---------------------------------------------------------------------------


def _positions(edges: Sequence[int]) -> list[str]:
    """Labels of axes: a second contact on an edge is called so."""
    return [
        f"second position on edge {edge}" if edge in edges[:i] else f"position on edge {edge}"
        for i, edge in enumerate(edges)
    ]


def _title(grasp_set: GraspSet) -> str:
    center = "" if grasp_set.center is None else f", centre {grasp_set.center}"
    edges = ", ".join(map(str, grasp_set.edges))
    return f"{palette.KIND_NAMES[grasp_set.kind]} set on edges {edges}{center}"


def _plane(ax: Axes | None, names: Sequence[str], lengths: FloatArray) -> Axes:
    """Axes in the plane with a box of positions."""
    if ax is None:
        width, height = 4.2 * np.maximum(lengths / lengths.max(), 0.3)
        left, right, bottom, top = 0.8, 0.35, 0.6, 0.75
        size = np.array([max(width + left + right, 4.4), height + bottom + top])
        figure = OwnFigure((size[0], size[1]), dpi=110)
        box = (left / size[0], bottom / size[1], width / size[0], height / size[1])
        ax = figure.add_axes(box)
    if isinstance(ax, Axes3D):
        raise OptionError("this picture is in the plane: give axes without depth, not an Axes3D")
    ax.set(xlim=(0, lengths[0]), ylim=(0, lengths[1]))
    ax.set_xlabel(names[0], fontsize=9)
    ax.set_ylabel(names[1], fontsize=9)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(6, steps=_STEPS))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.tick_params(labelsize=7, length=2.5, width=0.6)
    return ax


def _draw_rows(ax: Axes | None, edge: int, length: float) -> Axes:
    """Axes with a row for either set and one for both, the first one on top."""
    ax = _plane(ax, [*_positions([edge]), ""], np.array([1.0, 0.3]))
    ax.set(xlim=(0, length), ylim=(3, 0))
    ax.set_yticks([0.5, 1.5, 2.5], ["first", "second", "both"], fontsize=8)
    return ax


def _space(ax: Axes | None, grasp_set: GraspSet) -> Axes3D:
    """Axes in space with the box of positions of a set."""
    if ax is None:
        figure = OwnFigure((5.4, 5.2), dpi=110)
        ax = figure.add_axes((-0.03, 0.0, 1.0, 0.97), projection="3d")
    if not isinstance(ax, Axes3D):
        raise OptionError('this picture is in space: give an Axes3D, made by projection="3d"')
    lengths = grasp_set.torque.lengths[0]
    ax.set(xlim=(0, lengths[0]), ylim=(0, lengths[1]), zlim=(0, lengths[2]))
    for axis, text in zip((ax.xaxis, ax.yaxis, ax.zaxis), _positions(grasp_set.edges), strict=True):
        axis.set_label_text(text, fontsize=9)
        axis.set_major_locator(
            MaxNLocator(4, steps=_STEPS, prune="lower" if axis is ax.yaxis else None)
        )
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_pane_color((1, 1, 1, 0))
    ax.grid(False)
    ax.tick_params(labelsize=7, pad=0)
    aspect = np.maximum(lengths / lengths.max(), _FLATTEST)
    zoom = min(0.83, 0.55 * float(np.linalg.norm(aspect)) / aspect[2])  # the label of x stays below
    ax.set_box_aspect(aspect, zoom=zoom)
    ax.view_init(elev=22, azim=-52)
    return ax


def _draw_box(ax: Axes3D, grasp_set: GraspSet) -> Line3DCollection:
    """The edges of the box of positions."""
    ends = np.array(list(product((0.0, 1.0), repeat=3)))
    one, other = np.nonzero(np.triu(np.abs(ends[:, None] - ends).sum(axis=2) == 1))
    segments = np.stack((ends[one], ends[other]), axis=1) * grasp_set.torque.lengths[0]
    box = Line3DCollection(segments, colors=palette.GREY, linewidths=0.6)
    ax.add_collection3d(box)
    return box


def _draw_faces(ax: Axes3D, faces: list[FloatArray], color: str, alpha: float) -> Poly3DCollection:
    # all with as many corners: matplotlib pads them with memory as it finds it, and reckons with it
    most = max(map(len, faces), default=0)
    padded = [np.concatenate((face, face[-1:].repeat(most - len(face), axis=0))) for face in faces]
    drawn = Poly3DCollection(
        padded, facecolors=[(color, alpha)], edgecolors=[(color, 0.9)], linewidths=0.7
    )
    ax.add_collection3d(drawn)
    return drawn


def _draw_polygons(
    ax: Axes, polygons: Iterable[FloatArray], color: str, alpha: float, hatch: str = ""
) -> PathPatch | None:
    """Draw polygons as one patch; none if there are none."""
    paths = [Path(np.vstack((p, p[:1])), closed=True) for p in polygons]
    if not paths:
        return None
    patch = PathPatch(
        Path.make_compound_path(*paths),
        facecolor=(color, alpha),
        edgecolor=color,
        linewidth=1.0,
        hatch=hatch,
    )
    ax.add_patch(patch)
    return patch


def _key(color: str, text: str, alpha: float, hatch: str = "") -> Patch:
    return Patch(facecolor=(color, alpha), edgecolor=color, label=text, hatch=hatch)


def _write_key(ax: Axes, keys: list[Patch], columns: int) -> None:
    """Write what the colours mean, over the axes."""
    style: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.02)}
    if isinstance(ax, Axes3D):  # these leave room at the top
        style = {"loc": "upper left", "bbox_to_anchor": (0.05, 1.0)}
    ax.legend(handles=keys, ncols=columns, fontsize=8, frameon=False, borderaxespad=0, **style)
