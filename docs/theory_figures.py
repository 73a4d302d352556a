"""The figures of the theory, drawn from the library's own torque functions and sets.

Each function returns a figure; `gallery.py` writes them. The objects are a T, held at both sides of
its foot and at the top, a gusset plate, and a nut.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from numpy.typing import NDArray

import regrasp_lp as rl
from regrasp_lp import plotting
from regrasp_lp.plotting import palette
from regrasp_lp.shadows import shadows

FloatArray = NDArray[np.float64]

MODELS = Path(__file__).resolve().parent.parent / "models"
NEVER_UP, NEVER_DOWN, SET = palette.BLUE, palette.VERMILLION, palette.SET


@cache
def graph(file: str, name: str, friction: float) -> rl.SwitchingGraph:
    """Return the switching graph of a polygon of `models`."""
    polygons = rl.read_polygons(MODELS / f"{file}.geojson")
    return rl.build_switching_graph(next(p for p in polygons if p.name == name), friction)


def tee() -> rl.GraspSet:
    """Return the set of the T that most figures show."""
    sets = graph("workpieces", "t_block", 0.4).sets
    return sets[sets.on_edges((1, 4, 7))[0]]


def plate(edges: tuple[int, ...]) -> rl.GraspSet:
    """Return a set of the gusset plate."""
    sets = graph("machine_parts", "gusset", 0.15).sets
    return sets[sets.on_edges(edges)[0]]


def nut(edges: tuple[int, ...]) -> rl.GraspSet:
    """Return a set of the hexagonal nut."""
    sets = graph("workpieces", "hex_nut", 0.15).sets
    return sets[sets.on_edges(edges)[0]]


def torques(grasp_set: rl.GraspSet, fractions: FloatArray) -> FloatArray:
    """Return the torque functions of a set at points (N, 3), as lengths, shape (N, J)."""
    functions = grasp_set.torque
    rows = functions.take(np.zeros(len(fractions), dtype=np.intp))
    return rows.values(fractions)[:, functions.valid[0]]


def section(
    grasp_set: rl.GraspSet, low: float, high: float, steps: int = 301
) -> tuple[FloatArray, FloatArray]:
    """Return the least torque function, and the largest, over the first two positions.

    The third finger is at the fraction `low` of its edge for the least, `high` for the largest:
    with one value a section of contact space, with 0 and 1 a projection.

    Returns
    -------
    least, most : numpy.ndarray, shape (steps, steps)
    """
    along = np.linspace(0, 1, steps)
    first, second = np.meshgrid(along, along)
    least, most = (
        torques(grasp_set, np.stack((first, second, np.full_like(first, at)), -1).reshape(-1, 3))
        for at in (low, high)
    )
    return least.min(axis=1).reshape(steps, -1), most.max(axis=1).reshape(steps, -1)


def own(columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure of its own with axes side by side."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(np.atleast_1d(figure.subplots(1, columns)))


def plane(ax: Axes, grasp_set: rl.GraspSet, title: str) -> tuple[float, ...]:
    """Make axes those of the first two positions of a set; return left, right, bottom, top."""
    lengths, edges = grasp_set.torque.lengths[0], grasp_set.edges
    ax.set_aspect("equal")
    ax.set_xlim(0, lengths[0])
    ax.set_ylim(0, lengths[1])
    ax.set_xlabel(f"position on edge {edges[0]}")
    ax.set_ylabel(f"position on edge {edges[1]}")
    ax.set_title(title, fontsize=10)
    return 0.0, float(lengths[0]), 0.0, float(lengths[1])


def fill(ax: Axes, values: FloatArray, extent: tuple[float, ...], color: str, alpha: float) -> None:
    """Fill where values are positive, and draw the border."""
    x, y = (np.linspace(*extent[2 * i : 2 * i + 2], n) for i, n in enumerate(values.shape[::-1]))
    ax.contourf(x, y, values, [0, np.inf], colors=[color], alpha=alpha)
    ax.contour(x, y, values, [0], colors=[color], linewidths=1.4)


def torque_functions() -> Figure:
    """Draw the torque functions along the diagonal of contact space, and the witness on it."""
    figure, (left, right) = own(2, 9.6, 4.0)
    grasp_set = tee()
    along = np.linspace(0, 1, 201)
    found = torques(grasp_set, np.repeat(along[:, None], 3, axis=1))
    least, most = found.min(axis=1), found.max(axis=1)
    holds = along[(least < 0) & (most > 0)]
    witness = (holds[0] + holds[-1]) / 2
    right.axvspan(holds[0], holds[-1], color=SET, alpha=0.18)
    right.plot(along, found, color=palette.GREY, linewidth=0.9)
    right.plot(along, most, color=NEVER_DOWN, linewidth=2.2, label="the largest")
    right.plot(along, least, color=NEVER_UP, linewidth=2.2, linestyle="--", label="the least")
    right.axhline(0, color=palette.INK, linewidth=0.8)
    right.axvline(witness, color=palette.INK, linewidth=0.8, linestyle=":")
    right.annotate(
        "witness", (witness, found.min()), (3, 2), textcoords="offset points", fontsize=9
    )
    right.set_xlim(0, 1)
    right.set_xlabel("fraction of every edge")
    right.set_ylabel("torque / s, a length")
    right.set_title("all torque functions along the diagonal", fontsize=10)
    right.legend(frameon=False, fontsize=9, loc="upper left")
    grasp = rl.Grasp.at_fractions([(edge, witness) for edge in grasp_set.edges])
    plotting.plot_grasp(grasp_set.polygon, grasp, 0.4, ax=left)
    left.set_axis_off()
    left.set_title("the witness: a grasp on the diagonal", fontsize=10)
    return figure


def cover() -> Figure:
    """Draw D, U and the set between their complements, in a section of contact space."""
    figure, axes = own(3, 8.6, 4.6)
    grasp_set = tee()
    least, most = section(grasp_set, 0.5, 0.5)
    for ax, title, values, color in (
        (axes[0], "D: some function is negative", -least, NEVER_UP),
        (axes[1], "U: some function is positive", most, NEVER_DOWN),
        (axes[2], "S = D ∩ U: the grasp set", np.minimum(-least, most), SET),
    ):
        fill(ax, values, plane(ax, grasp_set, title), color, 0.35)
    for ax in axes[1:]:
        ax.set_ylabel("")
    figure.suptitle(f"the finger on edge {grasp_set.edges[2]} in the middle of it", fontsize=9)
    return figure


def projection() -> Figure:
    """Draw a set in contact space, and its projection on two of its three positions."""
    figure = Figure(figsize=(10.5, 4.6))
    FigureCanvasAgg(figure)
    space = figure.add_axes((0.0, 0.02, 0.5, 0.96), projection="3d")
    flat = figure.add_axes((0.6, 0.14, 0.36, 0.74))
    grasp_set = plate((0, 2, 4))
    plotting.plot_contact_space(grasp_set, ax=space)
    extent = plane(flat, grasp_set, f"some place on edge {grasp_set.edges[2]} completes these")
    least, most = section(grasp_set, 0.0, 1.0)
    fill(flat, np.minimum(-least, most), extent, SET, 0.35)
    return figure


def limits(
    grasp_set: rl.GraspSet, held: tuple[int, int], x: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return υ and δ of a set over positions of the first held contact, as fractions."""
    found = shadows([grasp_set.torque], 2)
    (index,) = (i for i in range(len(found)) if tuple(found.edges[i]) == held)
    pairs = [found.take(np.array([index])).limits(float(value)) for value in x]
    upsilon, delta = (np.array([pair[end][0] for pair in pairs]) for end in (0, 1))
    return upsilon, delta


def switching() -> Figure:
    """Draw which positions of two held contacts two sets allow, and the bad intervals."""
    figure, (ax,) = own(1, 8.6, 4.4)
    both = nut((0, 2, 15)), nut((0, 2, 16))
    x = np.linspace(0, 1, 801)
    extent = plane(ax, both[0], "two held contacts: where each set allows the second")
    width, height = extent[1], extent[3]
    bounds = [limits(grasp_set, (0, 2), x) for grasp_set in both]
    looks = ((NEVER_UP, "-", both[0].edges), (NEVER_DOWN, "--", both[1].edges))
    for (upsilon, delta), (color, style, edges) in zip(bounds, looks, strict=True):
        low, high = np.clip(upsilon, 0, 1) * height, np.clip(delta, 0, 1) * height
        ax.fill_between(
            x * width,
            low,
            high,
            where=high > low,
            facecolor=to_rgba(color, 0.15),
            edgecolor=color,
            linestyle=style,
            linewidth=1.8,
            label=f"between υ and δ of the set on {edges}",
        )
    lowest = np.maximum(*(np.clip(pair[0], 0, 1) for pair in bounds))
    highest = np.minimum(*(np.clip(pair[1], 0, 1) for pair in bounds))
    good = highest > lowest
    ax.fill_between(
        x * width,
        lowest * height,
        highest * height,
        where=good,
        color=SET,
        alpha=0.5,
        label="allowed by both: the switch exists",
    )
    ax.plot(
        x * width,
        np.where(good, np.nan, 0),
        color=palette.INK,
        linewidth=6,
        solid_capstyle="butt",
        label="bad intervals",
    )
    ax.legend(fontsize=8.5, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def levels() -> Figure:
    """Draw a section of a set cut at levels of the margin: it falls apart."""
    figure, axes = own(3, 8.6, 4.6)
    least, most = section(tee(), 0.5, 0.5)
    margin = np.minimum(-least, most)
    for ax, part in zip(axes, (0.0, 0.35, 0.7), strict=True):
        level = part * float(margin.max())
        extent = plane(ax, tee(), f"margin at least {level:.1f}")
        fill(ax, margin, extent, SET, 0.15)
        fill(ax, margin - level, extent, SET, 0.5)
    for ax in axes[1:]:
        ax.set_ylabel("")
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "theory_torque_functions": torque_functions,
    "theory_cover": cover,
    "theory_projection": projection,
    "theory_switching": switching,
    "theory_levels": levels,
}
"""All figures by the names of their files."""
