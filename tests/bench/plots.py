"""Pictures of the measurements, in the colours of the package's own."""

from __future__ import annotations

from pathlib import Path
from statistics import median

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bench.growth import Growth
from bench.ratio import Meeting
from regrasp_lp.plotting import palette

_DPI = 110


def draw_growth(grown: dict[str, list[Growth]], path: Path) -> None:
    """Seconds and peak memory against edges, on logarithmic axes, beside the output."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    time, memory = figure.subplots(1, 2)
    styles = {"chapter": (palette.BLUE, "o"), "complete": (palette.VERMILLION, "s")}
    for sets, rows in grown.items():
        color, marker = styles[sets]
        sizes = [g.n_edges for g in rows]
        time.plot(sizes, [g.seconds for g in rows], color=color, marker=marker, label=f"{sets}")
        memory.plot(sizes, [max(g.peak, 0.1) for g in rows], color=color, marker=marker, label=sets)
        stored = [g for g in rows if g.stored]
        for axes, values in (
            (time, [g.seconds for g in stored]),
            (memory, [g.peak for g in stored]),
        ):
            _draw_output(axes, stored, values, color, sets)
    peer = [g for g in grown.get("chapter", []) if g.peer_seconds is not None]
    if peer:
        time.plot(
            [g.n_edges for g in peer],
            [g.peer_seconds or 0.0 for g in peer],
            color=palette.GREY,
            marker="^",
            label="peer on GEOS (chapter)",
        )
    for axes, title in ((time, "seconds"), (memory, "peak memory, MiB")):
        axes.set(xscale="log", yscale="log", xlabel="edges", title=title)
        ticks = sorted({g.n_edges for rows in grown.values() for g in rows})
        axes.set_xticks(ticks, [str(n) for n in ticks])
        axes.minorticks_off()
        axes.grid(color=palette.MATERIAL)
        axes.spines[["top", "right"]].set_visible(False)
    time.legend(frameon=False, fontsize=8)
    memory.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=_DPI)


def _draw_output(
    axes: Axes, rows: list[Growth], values: list[float], color: str, sets: str
) -> None:
    """The size of the output, scaled to the last value: parallel lines grow alike."""
    if not rows:
        return
    scale = values[-1] / max(rows[-1].output, 1)
    axes.plot(
        [g.n_edges for g in rows],
        [scale * g.output for g in rows],
        color=color,
        linestyle=palette.DASHES,
        linewidth=1.0,
        label=f"output of {sets}, scaled",
    )


def draw_ratio(meetings: list[Meeting], path: Path) -> None:
    """The ratio of each round, and their medians, for each polygon and kind of graph."""
    figure = Figure(figsize=(7.5, 1.2 + 0.32 * len(meetings)), layout="constrained")
    axes = figure.subplots()
    for row, meeting in enumerate(meetings):
        color = palette.BLUE if meeting.sets == "chapter" else palette.VERMILLION
        ratios = meeting.ratios
        axes.plot(ratios, np.full(len(ratios), row), ".", color=palette.GREY, markersize=5)
        axes.plot(median(ratios), row, "o", color=color, markersize=8)
        axes.plot([meeting.target] * 2, [row - 0.35, row + 0.35], color=palette.INK, linewidth=1.2)
    names = [f"{m.name}, {m.sets} ({m.n_edges} edges)" for m in meetings]
    axes.set_yticks(range(len(meetings)), names)
    axes.invert_yaxis()
    axes.set_xscale("log")
    ticks = [0.1, 0.2, 0.5, 1, 2, 5, 10]
    axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
    axes.minorticks_off()
    axes.set_xlabel("our time divided by the peer's; rounds, median, and the target as a line")
    axes.grid(axis="x", color=palette.MATERIAL)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=_DPI)
