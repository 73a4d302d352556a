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
from scipy import sparse
from scipy.sparse.linalg import eigsh

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.frame import Drawing, Frame, OwnFigure

if TYPE_CHECKING:
    from regrasp_lp.switching_graph import SwitchingGraph

_MOST_IMPLICIT = 300  # pairs of sets that need to hold nothing are drawn up to this number
_MOST_SWITCHES = 60_000  # drawn at most
_RASTER = 5_000  # with more switches than this they are pixels, also in vector files
_FORCED = 4_000  # larger components are laid out by eigenvectors alone
_ROUND = 6  # components up to this size start from a circle
_EFFORT = 120_000  # sets times steps of the layout by forces
_BETWEEN = 0.035  # room over a row of squares for their sizes, in widths of all
_NAMED_FROM = 0.08  # squares from this part of the width on have their size written over them


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
    components = [np.array(sorted(c), dtype=np.intp) for c in graph.components()]
    listed, implicit = _listed(graph), _implicit(graph)
    squares = _squares([len(c) for c in components])
    positions = np.zeros((len(graph), 2))
    for members, square in zip(components, squares, strict=True):
        unit = _in_unit_square(members, listed, _joined_to_all(graph))
        positions[members] = square[:2] + square[2] * (0.07 + 0.86 * unit)
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


def _listed(graph: SwitchingGraph) -> IntArray:
    """The pairs of sets that have to hold contacts in common and can, shape (K, 2)."""
    adjacent, contacts = graph.hand.adjacent, graph.sets.contacts
    chunks = [np.zeros((0, 2), dtype=np.intp)]
    for pairs in graph.switches.pairs():
        i, j = pairs.first, pairs.second
        holds = ~adjacent[contacts[i], contacts[j]]
        chunks.append(np.unique(np.stack((i[holds], j[holds]), axis=1), axis=0))
    return np.asarray(np.unique(np.concatenate(chunks), axis=0))


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


def _joined_to_all(graph: SwitchingGraph) -> BoolArray:
    """Which sets are adjacent to all of some number of contacts, shape (N,)."""
    adjacent, contacts = graph.hand.adjacent, graph.sets.contacts
    return np.asarray(adjacent[contacts][:, np.unique(contacts)].any(axis=1))


# --- layout -------------------------------------------------------------------------------------


def _squares(sizes: Sequence[int]) -> FloatArray:
    """Squares of components, largest first, in rows: left, bottom and side of each."""
    sides = np.sqrt(np.array(sizes, dtype=np.float64))
    width = max(sides.max(initial=0.0), np.sqrt(1.25 * np.sum(sizes)))
    squares, x, y = np.zeros((len(sizes), 3)), 0.0, 0.0
    for k, side in enumerate(sides):
        if x > 0 and x + side > 1.001 * width:
            x, y = 0.0, y - (_BETWEEN * width if side >= _NAMED_FROM * width else 0.0)
        if x == 0:
            y -= side  # of a row the first square is the largest
        squares[k] = x, y, side
        x += side
    return squares


def _in_unit_square(members: IntArray, listed: IntArray, hubs: BoolArray) -> FloatArray:
    """Positions of one component from 0 to 1; sets adjacent to all others are joined to a hub."""
    n = len(members)
    if n == 1:
        return np.full((1, 2), 0.5)
    local = np.full(len(hubs), -1)
    local[members] = np.arange(n)
    pairs = local[listed]
    pairs = pairs[pairs[:, 0] >= 0]
    joined = np.flatnonzero(hubs[members])
    pairs = np.concatenate((pairs, np.stack((joined, np.full(len(joined), n)), axis=1)))
    n_points = n + bool(len(joined))
    ones = np.ones(len(pairs))
    half = sparse.csr_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(n_points, n_points))
    adjacency = sparse.csr_array(half + half.T)
    x = _by_eigenvectors(adjacency)
    if n_points <= _FORCED:
        x = _by_forces(adjacency, x)
    x = x[:n] - np.median(x[:n], axis=0)
    far = np.maximum(np.hypot(*x.T), 1e-12)[:, None]
    x = x / far * np.log1p(far / np.median(far))  # what is far out is drawn in
    extent = np.ptp(x, axis=0)
    return np.asarray(0.5 + (x - x.min(axis=0) - extent / 2) / np.maximum(extent, extent.max() / 2))


def _by_eigenvectors(adjacency: sparse.csr_array) -> FloatArray:
    """Positions about 0 of size 1 by the second and third eigenvector of the random walk."""
    n = adjacency.shape[0]
    random = np.random.default_rng(0)
    if n <= _ROUND:
        turn = 2 * np.pi * np.arange(n) / n
        return np.stack((np.cos(turn), np.sin(turn)), axis=1)
    root = np.sqrt(adjacency.sum(axis=1))
    walk = sparse.csr_array(adjacency / root[:, None] / root[None, :])
    _, vectors = eigsh(walk, k=3, which="LA", v0=random.normal(size=n), tol=1e-2)
    x = vectors[:, [1, 0]] / root[:, None]
    ranks = x.argsort(axis=0, kind="stable").argsort(axis=0) / n - 0.5
    return np.asarray(x / np.abs(x).max(axis=0) + ranks + 0.01 * random.normal(size=x.shape))


def _by_forces(adjacency: sparse.csr_array, start: FloatArray) -> FloatArray:
    """Fruchterman and Reingold's layout: neighbours attract, all repel, steps get shorter."""
    n, x = len(start), np.ascontiguousarray(start.T, dtype=np.float32)
    i, j = sparse.coo_array(adjacency).coords
    spacing = np.float32(1 / np.sqrt(n))
    steps = int(np.clip(_EFFORT / n, 50, 200))
    for length in np.linspace(0.1, 0.0, steps, endpoint=False, dtype=np.float32):
        push, across = (np.subtract.outer(along, along) for along in x)
        push *= push
        push += np.square(across, out=across)
        np.divide(spacing**2, np.maximum(push, 1e-4 * spacing**2, out=push), out=push)
        # einsum and no matrix product, whose threads are slow on a busy machine
        force = push.sum(axis=1) * x - np.stack([np.einsum("ij,j->i", push, v) for v in x])
        pull = x[:, i] - x[:, j]
        pull *= np.hypot(*pull) / spacing
        force -= np.stack([np.bincount(i, along, minlength=n) for along in pull])
        x += force * (length / np.maximum(np.hypot(*force), 1e-12))
    return np.asarray(x.T, dtype=np.float64)


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
    over = _BETWEEN * width if len(squares) > 1 else 0.0
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
    least = _NAMED_FROM * float(np.ptp(ax.get_xlim()))
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
