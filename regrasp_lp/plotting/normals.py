"""How candidates come from the normals on the unit circle (Figs. 3.11 and 3.12)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Wedge
from matplotlib.text import Text

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import Cones, FloatArray
from regrasp_lp.grasp_sets.candidates import (
    concurrent_candidates,
    parallel_candidates,
    two_finger_candidates,
)
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.frame import Drawing, Frame, OwnFigure
from regrasp_lp.plotting.outline import text_half
from regrasp_lp.polygon import Polygon

_MOST_CHOSEN = {"two_finger": 1, "concurrent": 2, "parallel": 2}
_RADIUS = 0.72  # of the circle, in halves of the axes
_SHADE = 0.3
_GAP, _RING = 4.5, 11.0  # from the circle to a number, and from ring to ring of numbers, in points
_RINGS, _STEPS = 4, 9  # how many rings, and how many places to either side, are tried


@dataclass(frozen=True)
class Window:
    """An arc of the circle, counter-clockwise from `first` to `last`, in radians."""

    first: float
    last: float

    @property
    def middle(self) -> float:
        """The angle half-way, which does not depend on the friction of the edge to come."""
        return (self.first + self.last) / 2

    def holds(self, angle: float) -> bool:
        """Whether an angle is strictly inside."""
        return 0 < (angle - self.first) % (2 * np.pi) < self.last - self.first


@dataclass(frozen=True, eq=False, repr=False)
class CandidateArtists(Drawing):
    """What `plot_candidates` drew.

    Parameters
    ----------
    chosen : tuple of int
        The chosen edges.
    candidates : tuple of int
        The edges marked as next ones.
    windows : mapping of int to tuple of Window
        For every edge that may be next the arcs in which its normal has to be, given its friction.
    sectors : tuple of matplotlib.patches.Wedge
        The narrowest of these arcs and, where they differ, the widest.
    arrows : mapping of int to matplotlib.lines.Line2D
        The normal of each edge.
    numbers : mapping of int to matplotlib.text.Text
        The number of each edge.
    """

    chosen: tuple[int, ...]
    candidates: tuple[int, ...]
    windows: Mapping[int, tuple[Window, ...]]
    sectors: tuple[Wedge, ...]
    arrows: Mapping[int, Line2D]
    numbers: Mapping[int, Text]


def plot_candidates(
    polygon: Polygon,
    friction: npt.ArrayLike,
    kind: str,
    edges: Sequence[int] = (),
    ax: Axes | None = None,
    *,
    key: bool = True,
) -> CandidateArtists:
    """Draw the normals of all edges on the circle, and which of them may come next.

    Every normal points from the centre of the circle to a dot with the number of its edge. Chosen
    edges are squares; shaded is the window that they leave for the next normal. Dots are filled
    for the edges with which the chosen ones are in a candidate of
    `regrasp_lp.grasp_sets.candidates`. Where one more edge remains to be chosen after the next,
    a normal may lie in the window although nothing completes it.

    * Two-finger (Fig. 3.12a): the second normal is opposed within ``θ_a + θ_b``.
    * Concurrent (Fig. 3.11): the next normal is ahead or behind (regions A and B) by more than
      ``θ_a + θ_b`` and less than ``π - θ_a - θ_b``; the third one, in region C, by as much of both.
    * Parallel (Fig. 3.12c): the second normal is within ``θ_b + θ_c`` of the first one; the third
      one, of the centre edge, is opposed to what their cones have in common within ``θ_a``.

    Where friction differs from edge to edge so does the window: the widest one is shaded lightly,
    the narrowest one darkly. A dot is judged by its own.

    Parameters
    ----------
    polygon : Polygon
    friction : float or sequence of float
        μ, one value or one per edge.
    kind : {"two_finger", "concurrent", "parallel"}
    edges : sequence of int, optional
        Chosen edges: one, or of three also two (of a parallel candidate those that are not the
        centre). Without, filled dots are the edges that are in any candidate.
    ax : matplotlib.axes.Axes, optional
        By default new axes of a new figure.
    key : bool, optional
        Whether to say what the colours mean.

    Returns
    -------
    CandidateArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    FrictionError
        If friction is none.
    OptionError
        If there is no such kind, or the chosen edges are too many, equal or not on the object.

    Examples
    --------
    >>> square = Polygon([(0, 0), (2, 0), (2, 2), (0, 2)])
    >>> plot_candidates(square, 0.3, "two_finger", [0]).candidates
    (2,)
    """
    cones = Cones.of(polygon, friction)
    chosen = _checked(kind, edges, cones.n_edges)
    angles, theta = _angles(cones), np.arctan(cones.friction)
    windows = {
        edge: _windows(kind, angles, theta, chosen, edge)
        for edge in range(cones.n_edges)
        if chosen and edge not in chosen
    }
    candidates, count = _next_edges(cones, kind, chosen)
    ax = _axes(ax, cones.n_edges)
    sectors = _draw_sectors(ax, kind, windows)
    ax.add_patch(Circle((0, 0), 1.0, facecolor="none", edgecolor=palette.GREY, linewidth=0.8))
    looks = [
        _CHOSEN if i in chosen else _NEXT if i in candidates else _OTHER
        for i in range(cones.n_edges)
    ]
    arrows = {i: _draw_normal(ax, angles[i], looks[i]) for i in range(cones.n_edges)}
    numbers = _draw_numbers(ax, angles, looks)
    if key:
        words = f"{count} {palette.KIND_NAMES[kind]} candidate" + "s" * (count != 1)
        _write_key(ax, chosen, bool(sectors), words)
    return CandidateArtists(
        ax,
        chosen,
        candidates,
        MappingProxyType(windows),
        sectors,
        MappingProxyType(arrows),
        MappingProxyType(numbers),
    )


def _checked(kind: str, edges: Sequence[int], n: int) -> tuple[int, ...]:
    if kind not in _MOST_CHOSEN:
        names = ", ".join(map(repr, _MOST_CHOSEN))
        raise OptionError(f"kind must be one of {names}, got {kind!r}: others come from no windows")
    chosen = tuple(int(edge) for edge in edges)
    if len(chosen) > _MOST_CHOSEN[kind]:
        raise OptionError(
            f"of a {kind} candidate at most {_MOST_CHOSEN[kind]} edges are chosen before the last "
            f"one, got {len(chosen)}: {chosen}"
        )
    if len(set(chosen)) < len(chosen) or not all(0 <= edge < n for edge in chosen):
        raise OptionError(f"chosen edges must be different ones from 0 to {n - 1}, got {chosen}")
    return chosen


# --- windows ------------------------------------------------------------------------------------


def _angles(cones: Cones) -> FloatArray:
    """Angles of the normals to the x-axis."""
    x, y = cones.vectors.T
    return np.asarray(np.arctan2(x, -y))


def _windows(
    kind: str, angles: FloatArray, theta: FloatArray, chosen: tuple[int, ...], edge: int
) -> tuple[Window, ...]:
    """The arcs in which the normal of one edge may come next."""
    a, own = angles[chosen[0]], theta[edge]
    t = theta[chosen[0]] + own
    if len(chosen) == 1:
        arcs = {
            "two_finger": [(a + np.pi - t, a + np.pi + t)],
            "concurrent": [(a + t, a + np.pi - t), (a - np.pi + t, a - t)],
            "parallel": [(a - t, a + t)],
        }[kind]
    else:
        # the second normal relative to the first, from -π to π, so that one comes first
        turn = (angles[chosen[1]] - a + np.pi) % (2 * np.pi) - np.pi
        b, other = a + turn, theta[chosen[1]]
        if kind == "parallel":
            low = max(a - theta[chosen[0]], b - other) - own
            high = min(a + theta[chosen[0]], b + other) + own
            arcs = [(low + np.pi, high + np.pi)] if high - low > 2 * own else []
        else:
            (one, s), (two, r) = sorted([(a, theta[chosen[0]]), (b, other)])
            apart = s + r < two - one < np.pi - s - r
            arcs = [(one + np.pi + s + own, two + np.pi - r - own)] if apart else []
    return tuple(Window(float(low), float(high)) for low, high in arcs if low < high)


def _next_edges(cones: Cones, kind: str, chosen: tuple[int, ...]) -> tuple[tuple[int, ...], int]:
    """The edges that come next in a candidate with the chosen ones, and how many there are."""
    if kind == "parallel":
        rows, centers = parallel_candidates(cones)
        others = rows[rows != centers[:, None]].reshape(-1, 2)
    else:
        rows = (two_finger_candidates if kind == "two_finger" else concurrent_candidates)(cones)
        others = rows
    fits = np.ones(len(rows), dtype=bool)
    for edge in chosen:
        fits &= (others == edge).any(axis=1)
    found = (others if len(chosen) == 1 else rows)[fits]
    return tuple(sorted(set(found.ravel().tolist()) - set(chosen))), int(fits.sum())


# --- drawing ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Look:
    """How a normal is drawn; sizes in points."""

    color: str
    face: str
    marker: str
    size: float
    width: float
    weight: str
    layer: float


_CHOSEN = _Look(palette.BLUE, palette.BLUE, "s", 6.5, 2.0, "bold", 4.0)
_NEXT = _Look(palette.VERMILLION, palette.VERMILLION, "o", 5.0, 1.0, "bold", 3.0)
_OTHER = _Look(palette.GREY, "white", "o", 4.0, 0.5, "normal", 2.0)


def _axes(ax: Axes | None, n: int) -> Axes:
    """Square axes without frame, larger for more edges."""
    if ax is None:
        side = float(np.clip(3.6 + 0.03 * n, 4.2, 8.0))
        figure = OwnFigure((side, side + 0.75), dpi=110)
        ax = figure.add_axes((0.0, 0.0, 1.0, side / (side + 0.75)))
    limit = 1 / _RADIUS
    ax.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")
    ax.set_axis_off()
    return ax


def _draw_sectors(
    ax: Axes, kind: str, windows: Mapping[int, tuple[Window, ...]]
) -> tuple[Wedge, ...]:
    """Shade the widest and the narrowest window, and name the regions of the chapter."""
    different = [arcs for arcs in dict.fromkeys(windows.values()) if arcs]
    widths = [sum(arc.last - arc.first for arc in arcs) for arcs in different]
    order = np.argsort(widths, kind="stable").tolist()
    ends = dict.fromkeys(different[k] for k in order[:1] + order[-1:])
    style: dict[str, Any] = {"edgecolor": palette.SKY, "linewidth": 0.5, "zorder": 1.0}
    sectors = []
    for arc in (arc for arcs in ends for arc in arcs):
        first, last = np.degrees([arc.first, arc.last])
        sector = Wedge((0, 0), 1.0, first, last, facecolor=(palette.SKY, _SHADE), **style)
        ax.add_patch(sector)
        sectors.append(sector)
    for arcs in different[:1] if kind == "concurrent" else ():
        for name, arc in zip("AB" if len(arcs) == 2 else "C", arcs, strict=True):
            x, y = 0.5 * np.cos(arc.middle), 0.5 * np.sin(arc.middle)
            style = {"ha": "center", "va": "center", "fontsize": 13, "zorder": 5.0}
            backing = {"boxstyle": "circle", "facecolor": ("white", 0.8), "edgecolor": "none"}
            ax.text(x, y, name, color=palette.BLUE, bbox=backing, **style)
    return tuple(sectors)


def _draw_normal(ax: Axes, angle: float, look: _Look) -> Line2D:
    """The normal as a line from the centre to its mark on the circle."""
    ends = [0, np.cos(angle)], [0, np.sin(angle)]
    (arrow,) = ax.plot(*ends, markevery=[1], zorder=look.layer, **_style(look))
    return arrow


def _draw_numbers(ax: Axes, angles: FloatArray, looks: list[_Look]) -> dict[int, Text]:
    """Write the numbers of the edges around the circle, the marked ones first.

    Each stands at the place nearest to its normal that is left; where none is, it is left out.
    """
    unit = float(Frame.of(ax).scale.min())
    size = 8.0 if len(angles) <= 60 else 6.5
    taken = np.full((len(angles), 4), np.nan)
    ring, step = (g.ravel() for g in np.mgrid[0:_RINGS, -_STEPS : _STEPS + 1])
    nearest = np.argsort(1.2 * ring + np.abs(step), kind="stable")
    ring, step = ring[nearest], step[nearest]
    numbers = {}
    for edge in sorted(range(len(angles)), key=lambda i: -looks[i].layer):
        half = text_half(str(edge), size, looks[edge].weight) + 1.0
        toward = np.abs([np.cos(angles[edge]), np.sin(angles[edge])])
        radius = unit + _GAP + float(toward @ half) + _RING * ring
        turned = angles[edge] + step * size / radius
        centers = radius[:, None] * np.stack((np.cos(turned), np.sin(turned)), axis=1)
        apart = np.abs(centers[:, None] - taken[:, :2]) - half - taken[:, 2:]
        clear = ~(apart < 0).all(axis=2).any(axis=1)
        if not clear.any():
            continue
        place = centers[clear.argmax()]
        taken[edge] = *place, *half
        numbers[edge] = _write_number(ax, edge, angles[edge], place / unit, looks[edge], size)
    return numbers


def _write_number(
    ax: Axes, edge: int, angle: float, place: FloatArray, look: _Look, size: float
) -> Text:
    color = palette.INK if look is _OTHER else look.color
    dot = np.array([np.cos(angle), np.sin(angle)])
    ax.plot(*np.stack((dot, place), axis=1), color=palette.GREY, linewidth=0.3, zorder=0.5)
    style: dict[str, Any] = {"ha": "center", "va": "center_baseline", "zorder": 6.0}
    style["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 0.3}
    x, y = place
    return ax.text(x, y, str(edge), color=color, fontsize=size, fontweight=look.weight, **style)


def _write_key(ax: Axes, chosen: tuple[int, ...], window: bool, count: str) -> None:
    """Write how many candidates there are and what the marks mean, over the axes."""
    named = " and ".join(map(str, chosen))
    title = f"{count} with {named}" if chosen else count
    together = ("", " with it", " with them")[len(chosen)]
    labels = [(_NEXT, f"in a candidate{together}"), (_OTHER, "in none")]
    if chosen:
        labels.insert(0, (_CHOSEN, "chosen"))
    keys: list[Line2D | Patch] = [
        Line2D([], [], label=label, **_style(look)) for look, label in labels
    ]
    if window:
        keys.append(Patch(facecolor=(palette.SKY, _SHADE), edgecolor=palette.SKY, label="window"))
    place: dict[str, Any] = {"bbox_to_anchor": (0.02, 0.98), "borderaxespad": 0}
    ax.legend(handles=keys, title=title, ncols=2, **palette.KEY_OVER_AXES, **place)


def _style(look: _Look) -> dict[str, Any]:
    return {
        "color": look.color,
        "linewidth": look.width,
        "marker": look.marker,
        "markersize": look.size,
        "markerfacecolor": look.face,
    }
