"""Switching at one focus point (Fig. 3.7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.patches import Polygon as Wedge

from regrasp_lp.errors import OptionError
from regrasp_lp.grasp_sets.collection import GraspSet
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.focus_cells import (
    CELL,
    FOCUS,
    cell_of,
    cones_at,
    focus_point,
    near_object,
    rays_of,
    rims,
)
from regrasp_lp.plotting.frame import Drawing
from regrasp_lp.plotting.scene import (
    DOT,
    REGION,
    Scene,
    Sign,
    around,
    draw_cones,
    draw_dot,
    draw_regions,
    draw_sets,
    meeting,
    set_scene,
)

if TYPE_CHECKING:
    from regrasp_lp.switching_graph import SwitchingGraph

_OTHER_CELL: dict[str, Any] = {
    "facecolor": (palette.PURPLE, 0.35),
    "edgecolor": palette.PURPLE,
    "linewidth": 0.9,
    "linestyle": palette.DASHES,
}
_BOTH: dict[str, Any] = {
    "facecolor": palette.PALE_YELLOW,
    "edgecolor": palette.INK,
    "linewidth": 0.9,
    "zorder": palette.CELL_LAYER + 0.1,
}
_HELD: dict[str, Any] = {}
_LEAVING: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": palette.GREY}
_COMING: dict[str, Any] = {"markerfacecolor": palette.VERMILLION, "marker": "s"}


@dataclass(frozen=True, eq=False, repr=False)
class FocusSwitchArtists(Drawing):
    """What `plot_focus_switch` drew.

    Parameters
    ----------
    scene : Scene
        The object, the edges of both sets and the key.
    cells : tuple of matplotlib.patches.PathPatch
        The two focus cells.
    intersection : matplotlib.patches.PathPatch
        Where they meet.
    point : matplotlib.lines.Line2D
        The focus point.
    cones, regions : mapping of int to artist
        From the focus point towards each edge; the contact region there.
    held, leaving, coming : mapping of int to matplotlib.lines.Line2D
        Contacts on the edges of both sets, of the first only, of the second only.
    """

    scene: Scene
    cells: tuple[PathPatch, PathPatch]
    intersection: PathPatch
    point: Line2D
    cones: Mapping[int, Wedge]
    regions: Mapping[int, Line2D]
    held: Mapping[int, Line2D]
    leaving: Mapping[int, Line2D]
    coming: Mapping[int, Line2D]


def plot_focus_switch(
    graph: SwitchingGraph, first: int, second: int, ax: Axes | None = None, *, key: bool = True
) -> FocusSwitchArtists:
    """Draw how a hand switches between two grasp sets at one focus point (chapter, Fig. 3.7).

    The focus point is the centre of the widest piece of the intersection of the two cells near the
    object. The contacts are the centres of its contact regions; a region on a common edge is that
    of both sets.

    Parameters
    ----------
    graph : SwitchingGraph
    first, second : int
        Numbers of a set that the hand leaves and of one to which it comes: concurrent ones with
        two common edges, or a concurrent and a two-finger set with at least one, for four fingers.
    ax : matplotlib.axes.Axes, optional
        Its limits and aspect are set. By default new axes of a new figure.
    key : bool, optional
        Whether to say what the colours mean.

    Returns
    -------
    FocusSwitchArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    OptionError
        If a set has no focus cell, they have too few edges in common, or the cells do not meet (or
        too little to be drawn).
    IndexError
        If there is no such set.
    """
    sets = graph.sets[first], graph.sets[second]
    cells = cell_of(sets[0]), cell_of(sets[1])
    _check_pair(graph, first, second)
    polygon, both = graph.polygon, meeting(*cells)
    at = focus_point(polygon, both)
    if at is None:
        raise OptionError(
            f"the focus cells of sets {first} and {second} do not meet, or too little to be drawn"
        )
    # of a two-finger set the cone, and so the region on a common edge, is within the other
    narrow_last = sorted(sets, key=lambda s: -len(s.edges))
    regions = {
        edge: region
        for s in narrow_last
        for edge, region in zip(s.edges, s.independent_regions(at), strict=True)
    }
    rays = {edge: pair for s in narrow_last for edge, pair in rays_of(s).items()}
    cones = cones_at(polygon, rays, at, regions)
    contacts = {
        e: polygon.points(e, r.mean() / polygon.edge_lengths[e]) for e, r in regions.items()
    }
    view = around(polygon.bounds, *(near_object(polygon, cell) for cell in cells), *rims(cones))
    signs = _signs_of_switch(sets) if key else []
    scene = set_scene(polygon, tuple(regions), view, ax, signs, avoid=[at, *contacts.values()])
    held, leaving, coming = (
        MappingProxyType({e: draw_dot(scene.ax, contacts[e], **style) for e in edges})
        for edges, style in zip(_roles(sets), (_HELD, _LEAVING, _COMING), strict=True)
    )
    return FocusSwitchArtists(
        scene.ax,
        scene,
        (draw_sets(scene, cells[0], **CELL), draw_sets(scene, cells[1], **_OTHER_CELL)),
        draw_sets(scene, both, **_BOTH),
        draw_dot(scene.ax, at, **FOCUS),
        draw_cones(scene, cones),
        draw_regions(scene, polygon, regions),
        held,
        leaving,
        coming,
    )


def _check_pair(graph: SwitchingGraph, first: int, second: int) -> None:
    """Refuse pairs of sets that do not switch by holding contacts at a focus point."""
    edges = [set(graph.sets[i].edges) for i in (first, second)]
    common, need = len(edges[0] & edges[1]), graph.hand.held(len(edges[0]), len(edges[1]))
    if first == second:
        reason = "they are one and the same"
    elif max(map(len, edges)) == 2:
        reason = "one of them has to be concurrent"
    elif common < need:
        reason = (
            f"a hand of {graph.hand.fingers} fingers has to hold contacts on {need} common edges, "
            f"and these have {common}"
        )
    else:
        return
    raise OptionError(f"no switch at a focus point between sets {first} and {second}: {reason}")


def _roles(sets: Sequence[GraspSet]) -> tuple[list[int], list[int], list[int]]:
    """Return the edges of both sets, of the first only and of the second only."""
    before, after = sets[0].edges, sets[1].edges
    return (
        [edge for edge in before if edge in after],
        [edge for edge in before if edge not in after],
        [edge for edge in after if edge not in before],
    )


def _signs_of_switch(sets: Sequence[GraspSet]) -> list[Sign]:
    first, second = (", ".join(map(str, s.edges)) for s in sets)
    held, leaving, coming = _roles(sets)
    dots = ((held, _HELD, "held"), (leaving, _LEAVING, "leaves"), (coming, _COMING, "comes"))
    return [
        Patch(**CELL, label=f"focus cell of {first}"),
        Patch(**_OTHER_CELL, label=f"focus cell of {second}"),
        Patch(**_BOTH, label="both cells"),
        Line2D([], [], **{**DOT, **FOCUS}, label="focus point"),
        Line2D([], [], **REGION, label="contact region"),
        *(Line2D([], [], **{**DOT, **style}, label=word) for edges, style, word in dots if edges),
    ]
