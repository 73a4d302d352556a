"""The switching graph: grasp sets as points, switches as lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.lines import Line2D
from matplotlib.text import Text

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.graph_layout import BETWEEN, NAMED_FROM, lay_out
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.frame import Drawing, Frame, OwnFigure

if TYPE_CHECKING:
    from regrasp_lp.switching_graph import SwitchingGraph

_MOST_IMPLICIT = 300  # pairs of sets that need to hold nothing are drawn up to this number
_MOST_SWITCHES = 60_000  # drawn at most
_RASTER = 5_000  # with more switches than this they are pixels, also in vector files


@dataclass(frozen=True, eq=False, repr=False)
class GraphArtists(Drawing):
    """What `plot_graph` drew.

    Parameters
    ----------
    positions : numpy.ndarray, shape (N, 2)
        Where each grasp set stands.
    vertices : mapping of str to matplotlib.collections.PathCollection
        The sets of each kind, in their order.
    switches : matplotlib.collections.LineCollection
    drawn, left_out : int
        How many switches are drawn, and how many are not.
    sizes : tuple of matplotlib.text.Text
        The number of sets over each component, if there are several.
    """

    positions: FloatArray
    vertices: Mapping[str, PathCollection]
    switches: LineCollection
    drawn: int
    left_out: int
    sizes: tuple[Text, ...]


def plot_graph(
    graph: SwitchingGraph, ax: Axes | None = None, *, color: str = "kind", key: bool = True
) -> GraphArtists:
    """Draw a switching graph.

    Every component has a square of its own, its area proportional to the number of sets, the
    largest first; inside, sets that can switch attract each other and all repel each other. The
    shape of a mark tells the kind of the set. The layout is the same every time.

    Pairs of sets that need to hold no contacts in common are all adjacent (with four fingers the
    two-finger sets). If they are more than 300 their lines are left out, and the key says so;
    they count for the components and attract each other all the same. Of more than 60,000
    other switches every second, third ... one is drawn.

    Parameters
    ----------
    graph : SwitchingGraph
    ax : matplotlib.axes.Axes, optional
        By default new axes of a new figure, larger for more sets.
    color : {"kind", "component"}, optional
        What the colour of a mark tells; components beyond the sixth are grey.
    key : bool, optional
        Whether to say what marks mean, and how many sets and switches there are.

    Returns
    -------
    GraphArtists
        With ``ax`` and ``figure``; a notebook shows it if the figure is new.

    Raises
    ------
    OptionError
        If `color` is neither.
    """
    if color not in ("kind", "component"):
        raise OptionError(f'color must be "kind" or "component", got {color!r}')
    layout, implicit = lay_out(graph), _implicit(graph)
    components, squares, positions = layout.components, layout.squares, layout.positions
    listed = layout.listed
    shown = np.concatenate((listed[:: -(-len(listed) // _MOST_SWITCHES) or 1], implicit))
    ax = _axes(ax, len(graph), squares)
    lines = _draw_switches(ax, positions[shown])
    colors = _colors(graph, components, color)
    vertices = _draw_sets(ax, graph, positions, colors, squares)
    sizes = _write_sizes(ax, components, squares)
    left_out = graph.n_switches - len(shown)
    if key:
        _write_key(ax, graph, components, color, left_out)
    return GraphArtists(
        ax, positions, MappingProxyType(vertices), lines, len(shown), left_out, sizes
    )


# --- switches -----------------------------------------------------------------------------------


def _implicit(graph: SwitchingGraph) -> IntArray:
    """The pairs that need to hold nothing, shape (K, 2); none if they are too many to draw."""
    adjacent, contacts = graph.hand.adjacent, graph.sets.contacts
    of = {m: np.flatnonzero(contacts == m) for m in (2, 3)}
    free = [(n, m) for n, m in ((2, 2), (2, 3), (3, 3)) if adjacent[n, m]]
    count = sum(
        len(of[n]) * (len(of[m]) - 1) // 2 if n == m else len(of[n]) * len(of[m]) for n, m in free
    )
    if count > _MOST_IMPLICIT:
        return np.zeros((0, 2), dtype=np.intp)
    pairs = [(i, j) for n, m in free for i in of[n] for j in of[m] if n < m or i < j]
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


# --- drawing ------------------------------------------------------------------------------------


def _axes(ax: Axes | None, n: int, squares: FloatArray) -> Axes:
    """Axes without frame that show all squares, larger for more sets."""
    width = (squares[:, 0] + squares[:, 2]).max(initial=1.0)
    height = -squares[:, 1].min(initial=-1.0)
    if ax is None:
        longest = float(np.clip(2.0 + 1.0 * np.log2(max(n, 8) / 2), 4.0, 9.0))
        across, down = longest * np.array([width, height]) / max(width, height)
        across, down, head = max(across, 4.2), max(down, 1.0), 0.95
        figure = OwnFigure((across, down + head), dpi=110)
        ax = figure.add_axes((0.02, 0.01, 0.96, down / (down + head)))
    over = BETWEEN * width if len(squares) > 1 else 0.0
    ax.set(xlim=(0, width), ylim=(-height, over), aspect="equal", anchor="NW")
    ax.set_axis_off()
    return ax


def _draw_switches(ax: Axes, segments: FloatArray) -> LineCollection:
    count = max(len(segments), 1)
    lines = LineCollection(
        list(segments),
        colors=[(palette.INK, float(np.clip(7 / np.sqrt(count), 0.04, 0.4)))],
        linewidths=0.5,
        zorder=1.0,
        rasterized=count > _RASTER,
    )
    ax.add_collection(lines, autolim=False)
    return lines


def _colors(graph: SwitchingGraph, components: Sequence[IntArray], color: str) -> list[str]:
    """The colour of each set."""
    if color == "kind":
        return [palette.KIND_COLORS[kind] for kind in graph.sets.kinds]
    colors = [""] * len(graph)
    for number, members in enumerate(components):
        for index in members:
            colors[index] = _component_color(number)
    return colors


def _component_color(number: int) -> str:
    return palette.SIX[number] if number < len(palette.SIX) else palette.GREY


def _draw_sets(
    ax: Axes, graph: SwitchingGraph, positions: FloatArray, colors: list[str], squares: FloatArray
) -> dict[str, PathCollection]:
    """Draw the sets of each kind, the rarest on top, as large as there is room."""
    area = float(np.prod(Frame.of(ax).size)) * (squares[:, 2] ** 2).sum()
    area /= max(np.ptp(ax.get_xlim()) * np.ptp(ax.get_ylim()) * max(len(graph), 1), 1e-12)
    size = float(np.clip(0.35 * np.sqrt(area), 2.2, 8.0))
    kinds = np.array(graph.sets.kinds)
    names, counts = np.unique(kinds, return_counts=True)
    drawn = {}
    for rank, k in enumerate(np.argsort(-counts, kind="stable")):
        chosen = np.flatnonzero(kinds == names[k])
        drawn[str(names[k])] = ax.scatter(
            positions[chosen, 0],
            positions[chosen, 1],
            s=size**2,
            c=[colors[i] for i in chosen],
            marker=palette.KIND_MARKERS[names[k]],
            linewidths=0.3,
            edgecolors="white",
            zorder=2.0 + rank,
        )
    return drawn


def _write_sizes(ax: Axes, components: Sequence[IntArray], squares: FloatArray) -> tuple[Text, ...]:
    """Write the number of sets over each square that is wide enough, if there are several."""
    if len(components) < 2:
        return ()
    least = NAMED_FROM * float(np.ptp(ax.get_xlim()))
    return tuple(
        ax.text(
            x, y + side, _counted(len(members), "set"), fontsize=7, color=palette.INK, va="bottom"
        )
        for members, (x, y, side) in zip(components, squares, strict=True)
        if side >= least
    )


def _write_key(
    ax: Axes, graph: SwitchingGraph, components: Sequence[IntArray], color: str, left_out: int
) -> None:
    """Write the counts, and what shapes and colours mean, over the axes."""
    style: dict[str, Any] = {"linestyle": "none", "markersize": 6, "markeredgewidth": 0}
    keys = []
    for family in (family for family in graph.sets.families if len(family)):
        face = palette.KIND_COLORS[family.kind] if color == "kind" else palette.GREY
        text = f"{len(family)} {palette.KIND_NAMES[family.kind]}"
        marker = palette.KIND_MARKERS[family.kind]
        keys.append(Line2D([], [], color=face, marker=marker, label=text, **style))
    if color == "component":
        for number, members in enumerate(components[: len(palette.SIX)]):
            face, text = _component_color(number), f"component of {len(members)}"
            keys.append(Line2D([], [], color=face, marker="D", label=text, **style))
        more = len(components) - len(palette.SIX)
        if more > 0:
            text = f"{more} more"
            keys.append(Line2D([], [], color=palette.GREY, marker="D", label=text, **style))
    counts = {"set": len(graph), "switch": graph.n_switches, "component": len(components)}
    title = ", ".join(_counted(count, word) for word, count in counts.items())
    if left_out:
        title += f"\n({_counted(left_out, 'switch')} not drawn)"
    place: dict[str, Any] = {"bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
    ax.legend(handles=keys, title=title, ncols=3, **palette.KEY_OVER_AXES, **place)


def _counted(count: int, word: str) -> str:
    plural = "es" if word.endswith("ch") else "s"
    return f"{count:,} {word}{plural if count != 1 else ''}"
