"""Focus cells, and the regions that a focus point defines (Figs. 3.2 and 3.3).

A picture shows the object and as much of the cells as lies within one diameter of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.patches import Polygon as Wedge
from numpy.typing import ArrayLike

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.collection import GraspSet
from regrasp_lp.grasp_sets.focus import two_finger_sweeps
from regrasp_lp.grasp_sets.parallel import common_cone_rays
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver, maximise_margins
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.frame import Drawing, check_drawable
from regrasp_lp.plotting.grasps import pie
from regrasp_lp.plotting.scene import (
    CONE,
    DOT,
    EDGE,
    REGION,
    Scene,
    Sign,
    around,
    draw_cones,
    draw_dot,
    draw_regions,
    draw_sets,
    grown,
    set_scene,
    swept,
    within,
)
from regrasp_lp.polygon import Polygon
from regrasp_lp.polytopes import corners

_BESIDE = 0.15  # part of the diameter around a cell that its literal form may fill
_PAST = 0.03  # part of the diameter by which a cone reaches past its region
CELL: dict[str, Any] = {
    "facecolor": (palette.ORANGE, 0.4),
    "edgecolor": palette.ORANGE,
    "linewidth": 0.9,
}
_LITERAL: dict[str, Any] = {
    "facecolor": "none",
    "edgecolor": palette.GREY,
    "linewidth": 0.8,
    "linestyle": palette.DASHES,
    "hatch": "///",
    "zorder": palette.CELL_LAYER - 0.1,
}
FOCUS: dict[str, Any] = {"markerfacecolor": "white", "marker": "D", "markersize": 5.5}


@dataclass(frozen=True, eq=False, repr=False)
class FocusCellArtists(Drawing):
    """What `plot_focus_cell` drew.

    Parameters
    ----------
    scene : Scene
        The object, the edges of the set and the key.
    cell : matplotlib.patches.PathPatch
        The focus cell, one path over all of its pieces.
    literal : matplotlib.patches.PathPatch or None
        What the cell of double-sided cones has in addition.
    point : matplotlib.lines.Line2D
        The focus point.
    cones : mapping of int to matplotlib.patches.Polygon
        From the focus point towards each edge.
    regions : mapping of int to matplotlib.lines.Line2D
        The independent contact region on each edge.
    """

    scene: Scene
    cell: PathPatch
    literal: PathPatch | None
    point: Line2D
    cones: Mapping[int, Wedge]
    regions: Mapping[int, Line2D]


def plot_focus_cell(
    grasp_set: GraspSet,
    point: ArrayLike | None = None,
    ax: Axes | None = None,
    *,
    literal: bool = False,
    key: bool = True,
) -> FocusCellArtists:
    """Draw a focus cell, and what a focus point in it defines (chapter, Figs. 3.2 and 3.3).

    Cones at the focus point, inverted towards the edges, cut the independent contact regions out
    of these: whole friction cones of a concurrent set, the common cone of the two contacts, on
    both sides, of a two-finger set.

    Parameters
    ----------
    grasp_set : GraspSet
        A concurrent or a two-finger set.
    point : array_like, shape (2,), optional
        A point inside the cell; by default the centre of its widest piece near the object.
    ax : matplotlib.axes.Axes, optional
        Its limits and aspect are set. By default new axes of a new figure.
    literal : bool, optional
        Of a two-finger set, also show what its cell has in addition if it is built as the chapter
        says, from both sides of the cone on both edges: points whose regions may hold no grasp.
    key : bool, optional
        Whether to say what the colours mean.

    Returns
    -------
    FocusCellArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    OptionError
        If the set has no focus cell, the point is not inside it, or `literal` is asked for of a
        concurrent set.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> triangle = rl.Polygon([(0, 0), (5, 0), (3, 4)])
    >>> graph = rl.build_switching_graph(triangle, 0.2, sets="chapter")
    >>> sorted(plot_focus_cell(graph.sets[0]).regions)
    [0, 1, 2]
    """
    check_drawable(grasp_set)
    cell, polygon = cell_of(grasp_set), grasp_set.polygon
    if literal and len(grasp_set.edges) != 2:
        raise OptionError(f"literal=True is for two-finger sets; this one is {grasp_set.kind}")
    point = focus_point(polygon, cell) if point is None else point
    if point is None:
        raise OptionError(f"the focus cell of edges {grasp_set.edges} is too thin to be drawn")
    regions = dict(zip(grasp_set.edges, grasp_set.independent_regions(point), strict=True))
    at = np.asarray(point, dtype=np.float64)
    cones = cones_at(polygon, rays_of(grasp_set), at, regions)
    view = around(polygon.bounds, near_object(polygon, cell), *rims(cones))
    view = grown(view, _BESIDE * polygon.diameter) if literal else view
    signs = _signs_of_cell(grasp_set, literal) if key else []
    scene = set_scene(polygon, grasp_set.edges, view, ax, signs, avoid=[at])
    return FocusCellArtists(
        scene.ax,
        scene,
        draw_sets(scene, cell, **CELL),
        _draw_literal(scene, grasp_set) if literal else None,
        draw_dot(scene.ax, at, **FOCUS),
        draw_cones(scene, cones),
        draw_regions(scene, polygon, regions),
    )


# --- cells and points ---------------------------------------------------------------------------


def cell_of(grasp_set: GraspSet) -> LinearSets:
    """Return the focus cell of a set; OptionError if it has none."""
    if grasp_set.focus_cell is None:
        raise OptionError(
            f"a {grasp_set.kind} set has no focus cell: a concurrent or two-finger does "
            '(sets="chapter")'
        )
    return grasp_set.focus_cell


def near_object(polygon: Polygon, cell: LinearSets) -> FloatArray:
    """Return the corners of what is shown of a cell, shape (n, 2)."""
    rings = corners(within(cell, _reach(polygon)))
    return np.concatenate([np.zeros((0, 2)), *rings])


def focus_point(polygon: Polygon, sets: LinearSets) -> FloatArray | None:
    """Return the centre of the widest set within one diameter of the object, or else of any.

    None if they have no interior, as far as rounding lets one tell.
    """
    origin, unit = polygon.bounds[:2], polygon.diameter
    for some in (within(sets, _reach(polygon)), sets):
        if len(some):
            solutions = maximise_margins(_measured(some, origin, unit), get_solver("highs"))
            best = int(solutions.margins.argmax())
            if solutions.positive[best]:
                return np.asarray(origin + unit * solutions.points[best])
    return None


def _measured(sets: LinearSets, origin: FloatArray, unit: float) -> LinearSets:
    """Return sets in another unit, from another origin, in which their LPs are of order 1."""
    return replace(
        sets,
        bounds=(sets.bounds - sets.rows @ origin) / unit,
        lower=(sets.lower - origin) / unit,
        upper=(sets.upper - origin) / unit,
    )


def _reach(polygon: Polygon) -> FloatArray:
    return grown(polygon.bounds, polygon.diameter)


# --- drawing ------------------------------------------------------------------------------------


def _draw_literal(scene: Scene, grasp_set: GraspSet) -> PathPatch:
    """Draw where the two edges' regions of one and the same side meet, which may be unbounded."""
    cones = grasp_set.torque.cones
    sweeps = two_finger_sweeps(cones, np.array([grasp_set.edges]))
    return draw_sets(scene, swept(sweeps, np.array([[0, 3], [1, 2]])), **_LITERAL)


def rays_of(grasp_set: GraspSet) -> dict[int, FloatArray]:
    """Return the boundaries, into the material, of the cone through which each edge sees it."""
    cones, edges = grasp_set.torque.cones, grasp_set.edges
    if len(edges) == 3:
        return {edge: cones.unit_rays[[2 * edge, 2 * edge + 1]] for edge in edges}
    a, b = edges
    common = common_cone_rays(cones, b, [a, a])
    return {a: common, b: -common}


def cones_at(
    polygon: Polygon,
    rays: Mapping[int, FloatArray],
    point: FloatArray,
    regions: Mapping[int, FloatArray],
) -> Mapping[int, Wedge]:
    """Return cones at the focus point, as far as a little past the regions that they cut."""
    cones = {}
    for edge, region in regions.items():
        ends = polygon.points(edge, region / polygon.edge_lengths[edge])
        side = np.sign((point - polygon.edge_starts[edge]) @ polygon.normals[edge])
        radius = float(np.hypot(*(ends - point).T).max()) + _PAST * polygon.diameter
        cones[edge] = pie(point, -side * rays[edge], radius, **CONE)
    return cones


def rims(cones: Mapping[int, Wedge]) -> list[FloatArray]:
    """Return the corners of cones, for the view to show them."""
    return [cone.get_xy() for cone in cones.values()]


# --- keys ---------------------------------------------------------------------------------------


def _signs_of_cell(grasp_set: GraspSet, literal: bool) -> list[Sign]:
    two = len(grasp_set.edges) == 2
    signs: list[Sign] = [
        Line2D([], [], **EDGE, label="edge of the set"),
        Patch(**CELL, label="focus cell"),
        Line2D([], [], **{**DOT, **FOCUS}, label="focus point"),
        Patch(**CONE, label="common cone" if two else "inverted friction cone"),
        Line2D([], [], **REGION, label="independent contact region"),
    ]
    return signs + [Patch(**_LITERAL, label="added by double-sided cones")] * literal
