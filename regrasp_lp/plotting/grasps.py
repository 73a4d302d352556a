"""A grasp: numbered fingers, friction cones, the line of a two-finger grasp."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from matplotlib.patches import Polygon as Wedge

from regrasp_lp.circuits import cross
from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import Cones, FloatArray
from regrasp_lp.grasp_sets.candidates import common_cone
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.fingers import (
    RELEASED,
    FingerArtists,
    draw_finger,
    place_fingers,
    point_of,
    style_of,
)
from regrasp_lp.plotting.frame import Drawing, Frame, draw_line, shifted
from regrasp_lp.plotting.outline import PolygonArtists, number_edges, plot_polygon
from regrasp_lp.plotting.sight import visible_part
from regrasp_lp.polygon import Polygon

Contacts: TypeAlias = Mapping[int, Contact] | Grasp | Iterable[Contact | tuple[int, float]]

_ARROW_SHIFT = 4.5  # points from an edge to the arrow of a slide along it
_ARROW_LEAST = 11.0  # length of the shortest arrow, in points
FORCE: dict[str, Any] = {
    "color": palette.GREEN,
    "linestyle": palette.DASHES,
    "linewidth": 1.4,
    "zorder": palette.LINE_LAYER,
}
_CONE: dict[str, Any] = {
    "facecolor": (palette.SKY, 0.22),
    "edgecolor": (palette.SKY, 0.9),
    "linewidth": 0.6,
    "zorder": palette.CONE_LAYER,
}
BAND: dict[str, Any] = {
    "color": palette.ORANGE,
    "linewidth": 4.0,
    "solid_capstyle": "butt",
    "zorder": palette.BAND_LAYER,
}
COMMON_CONE: dict[str, Any] = {
    **_CONE,
    "facecolor": (palette.PURPLE, 0.35),
    "edgecolor": (palette.PURPLE, 1.0),
}


@dataclass(frozen=True, eq=False, repr=False)
class GraspArtists(Drawing):
    """What `plot_grasp` drew.

    Parameters
    ----------
    polygon : PolygonArtists
        The object.
    fingers, released : mapping of int to FingerArtists
        The touching fingers, and the ghosts of released ones.
    cones : mapping of int to matplotlib.patches.Polygon
        Friction cone of each supporting finger of three or more, as far as material goes.
    line : matplotlib.lines.Line2D or None
        Joins the contacts of two supporting fingers.
    arrows : mapping of int to matplotlib.patches.FancyArrowPatch
        From where a finger was to where it has slid.
    bands : mapping of int to matplotlib.lines.Line2D
        Where fingers may be.
    """

    polygon: PolygonArtists
    fingers: Mapping[int, FingerArtists]
    released: Mapping[int, FingerArtists]
    cones: Mapping[int, Wedge]
    line: Line2D | None
    arrows: Mapping[int, FancyArrowPatch]
    bands: Mapping[int, Line2D]


def plot_grasp(
    polygon: Polygon,
    contacts: Contacts,
    friction: npt.ArrayLike,
    ax: Axes | None = None,
    *,
    cones: bool = True,
    support: Collection[int] | None = None,
    center: int | None = None,
    highlight: Collection[int] = (),
    released: Mapping[int, Contact] | None = None,
    slid_from: Mapping[int, Contact] | None = None,
    regions: Mapping[int, tuple[Contact, Contact]] | None = None,
    edge_numbers: bool = False,
) -> GraspArtists:
    """Draw an object and the fingers that touch it.

    A finger is a numbered circle beside the object, joined to a dot at its contact: blue if it
    supports the object, white if it only touches, vermillion with a dark ring if highlighted, grey
    and hollow if just released. Three or more supporting fingers are drawn with their friction
    cones, or with their common cone, in another colour, from the contact to where each direction
    first leaves the object; two are joined by a dashed line.

    Parameters
    ----------
    polygon : Polygon
    contacts : mapping of int to Contact, or Grasp
        Where each finger is; the contacts of a grasp are those of fingers 1, 2, ...
    friction : float or sequence of float
        μ, one value or one per edge.
    ax : matplotlib.axes.Axes, optional
        Its limits and aspect are set. By default new axes of a new figure.
    cones : bool, optional
        Whether to draw cones, or the line of two fingers.
    support : collection of int, optional
        The fingers that hold the object; all by default.
    center : int, optional
        Centre edge of a parallel grasp: then the cones are the common cone of all contacts.
    highlight : collection of int, optional
        Fingers to stand out.
    released : mapping of int to Contact, optional
        Where released fingers were.
    slid_from : mapping of int to Contact, optional
        Where fingers were before they slid to where they are: drawn as arrows beside the edge,
        at least 11 points long.
    regions : mapping of int to (Contact, Contact), optional
        First and last place where fingers may be, on their edges: drawn as bands.
    edge_numbers : bool, optional
        Whether to number the edges.

    Returns
    -------
    GraspArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    ContactError, FrictionError
        If a contact is not on the object, or friction is none.
    OptionError
        If `support`, `highlight`, `slid_from` or `regions` name a finger that does not touch.

    Examples
    --------
    >>> square = Polygon([(0, 0), (2, 0), (2, 2), (0, 2)])
    >>> artists = plot_grasp(square, Grasp([(0, 1.0), (2, 1.0)]), friction=0.3)
    >>> sorted(artists.fingers), artists.line is not None
    ([1, 2], True)
    """
    friction_cones = Cones.of(polygon, friction)
    now, gone = _resolved(polygon, contacts), _resolved(polygon, released or {})
    before = _resolved(polygon, slid_from or {})
    holding = tuple(now) if support is None else tuple(sorted(support))
    for what, named in (
        ("support", holding),
        ("highlight", highlight),
        ("slid_from", before),
        ("regions", regions or {}),
    ):
        _check_touching(what, named, now)
    drawn = plot_polygon(polygon, ax, edge_numbers=False)
    frame = Frame.of(drawn.ax)
    supporting = {k: now[k] for k in holding if cones}
    wedges, line = _draw_support(drawn, polygon, friction_cones, supporting, center)
    bands = {
        k: draw_line(drawn.ax, np.stack([point_of(polygon, end) for end in ends]), **BAND)
        for k, ends in (regions or {}).items()
    }
    moves = ((k, _draw_arrow(drawn.ax, polygon, frame, before[k], now[k])) for k in before)
    arrows = {k: arrow for k, arrow in moves if arrow is not None}
    avoid = [point_of(polygon, c) for c in (*now.values(), *gone.values(), *before.values())]
    if line is not None:
        avoid += _points_along(line)
    placed = place_fingers(polygon, frame, [*now.values(), *gone.values()], avoid)
    styles = [style_of(k, holding, highlight) for k in now] + [RELEASED] * len(gone)
    fingers = [
        draw_finger(drawn.ax, frame, finger, at, style)
        for finger, at, style in zip((*now, *gone), placed, styles, strict=True)
    ]
    if edge_numbers:
        drawn = number_edges(drawn, polygon, frame, placed)
    return GraspArtists(
        drawn.ax,
        drawn,
        MappingProxyType(dict(zip(now, fingers, strict=False))),
        MappingProxyType(dict(zip(gone, fingers[len(now) :], strict=True))),
        MappingProxyType(wedges),
        line,
        MappingProxyType(arrows),
        MappingProxyType(bands),
    )


def _resolved(polygon: Polygon, contacts: Contacts) -> dict[int, Contact]:
    if not isinstance(contacts, Mapping):
        contacts = dict(enumerate(Grasp(contacts), start=1))
    return {k: polygon.resolve_contact(contacts[k]) for k in sorted(contacts)}


def _check_touching(what: str, fingers: Collection[int], touching: Mapping[int, Contact]) -> None:
    for finger in fingers:
        if finger not in touching:
            names = ", ".join(map(str, touching))
            raise OptionError(f"{what} names finger {finger!r}, which does not touch: {names} do")


# --- what holds the object ----------------------------------------------------------------------


def _cone_rays(
    cones: Cones, holding: Mapping[int, Contact], center: int | None
) -> tuple[dict[int, FloatArray], dict[str, Any]]:
    """Clockwise and counter-clockwise boundary of each finger's cone, and how it looks."""
    edges = {k: c.edge for k, c in holding.items()}
    others = [edge for edge in edges.values() if edge != center]
    if len(edges) == 3 and len(others) == 2:
        common = common_cone(cones, np.array([[center, *others]]))
        if common.exists[0]:
            rays = common.boundaries(cones)[0]
            of_edges = {k: -rays if edge == center else rays for k, edge in edges.items()}
            return of_edges, COMMON_CONE
    return {k: cones.unit_rays[[2 * edge, 2 * edge + 1]] for k, edge in edges.items()}, _CONE


def _draw_support(
    drawn: PolygonArtists,
    polygon: Polygon,
    cones: Cones,
    holding: Mapping[int, Contact],
    center: int | None,
) -> tuple[dict[int, Wedge], Line2D | None]:
    """Draw the line of two fingers, or the cones of any other number, as far as material goes."""
    if len(holding) == 2:
        ends = np.stack([point_of(polygon, contact) for contact in holding.values()])
        return {}, draw_line(drawn.ax, ends, **FORCE)
    rays, style = _cone_rays(cones, holding, center)
    wedges = {
        k: Wedge(visible_part(polygon, point_of(polygon, c), rays[k]), closed=True, **style)
        for k, c in holding.items()
    }
    for wedge in wedges.values():
        drawn.ax.add_patch(wedge)
    return wedges, None


def pie(apex: FloatArray, rays: FloatArray, radius: float, **style: Any) -> Wedge:
    """Return a cone as a pie.

    Parameters
    ----------
    apex : numpy.ndarray, shape (2,)
    rays : numpy.ndarray, shape (2, 2)
        Its clockwise and its counter-clockwise boundary, less than a half turn apart.
    radius : float
    **style
        Its looks.
    """
    first, turn = np.arctan2(rays[0, 1], rays[0, 0]), np.arctan2(cross(*rays), rays[0] @ rays[1])
    angles = first + np.linspace(0, turn, 33)
    rim = apex + radius * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    return Wedge(np.vstack((apex, rim)), closed=True, **style)


def _points_along(line: Line2D) -> list[FloatArray]:
    """Return points on a line, close to each other, for labels to avoid."""
    first, last = np.asarray(line.get_xydata(), dtype=np.float64)
    return list(first + np.linspace(0, 1, 40)[:, None] * (last - first))


def _draw_arrow(
    ax: Axes, polygon: Polygon, frame: Frame, old: Contact, new: Contact
) -> FancyArrowPatch | None:
    """Draw the arrow of a slide, beside its edge; none if the finger stays where it is."""
    to = point_of(polygon, new)
    assert old.fraction is not None
    assert new.fraction is not None
    if old.fraction == new.fraction:
        return None
    along = frame.directions(polygon.tangents[new.edge]) * np.sign(new.fraction - old.fraction)
    length = float(np.hypot(*(frame.points(to) - frame.points(point_of(polygon, old)))))
    tail = to - frame.lengths(along * max(length, _ARROW_LEAST))
    shift = -_ARROW_SHIFT * frame.directions(polygon.normals[new.edge])
    arrow = FancyArrowPatch(
        (tail[0], tail[1]),
        (to[0], to[1]),
        transform=shifted(ax, shift),
        arrowstyle="-|>",
        mutation_scale=8,
        shrinkA=0,
        shrinkB=0,
        linewidth=1.3,
        color=palette.VERMILLION,
        zorder=palette.ARROW_LAYER,
    )
    ax.add_patch(arrow)
    return arrow
