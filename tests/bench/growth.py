"""Time and peak memory against the number of edges, beside the size of the output."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import regrasp_lp as rl
from bench.clocks import in_own_process
from bench.report import Table, met

UPPER = 60
"""Sizes from here on count for the exponents: below, fixed costs rule."""
TARGET = 0.2
MEMORY_AT = 100
MEMORY_TARGET = 1024.0


@dataclass(frozen=True)
class Growth:
    """What one process measured on one polygon."""

    n_edges: int
    sets: str
    n_sets: int
    n_switches: int
    stored: bool
    seconds: float
    peak: float  # MiB
    peer_seconds: float | None

    @property
    def output(self) -> int:
        """Vertices and edges of the graph."""
        return self.n_sets + self.n_switches


def measure(polygons: list[rl.Polygon], sets: str, repeats: int) -> list[Growth]:
    """Build the graphs of polygons, each in a process of its own."""
    found = []
    for polygon in polygons:
        job = in_own_process(
            "growth",
            vertices=polygon.vertices.tolist(),
            sets=sets,
            repeats=repeats,
        )
        found.append(Growth(polygon.n_edges, sets, **job))
    return found


def exponent(sizes: list[int], values: list[float]) -> float:
    """The slope of a least-squares line through the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def exponents(grown: list[Growth], upper: int = UPPER) -> dict[str, float] | None:
    """Exponents of seconds, peak memory and output over the upper sizes that are stored.

    None of fewer than two sizes.
    """
    rows = [g for g in grown if g.n_edges >= upper and g.stored]
    if len(rows) < 2:
        return None
    sizes = [g.n_edges for g in rows]
    return {
        "seconds": exponent(sizes, [g.seconds for g in rows]),
        "memory": exponent(sizes, [max(g.peak, 0.1) for g in rows]),
        "output": exponent(sizes, [float(g.output) for g in rows]),
    }


def table(grown: list[Growth], upper: int = UPPER) -> Table:
    """A line for each size, and the exponents below."""
    rows = [
        [
            str(g.n_edges),
            str(g.n_sets),
            str(g.n_switches),
            "stored" if g.stored else "on demand",
            f"{g.seconds:.3f}",
            f"{g.peak:.0f}",
            "" if g.peer_seconds is None else f"{g.peer_seconds:.3f}",
        ]
        for g in grown
    ]
    headings = ["edges", "sets", "switches", "", "seconds", "peak MiB", "peer, s"]
    notes = []
    found = exponents(grown, upper)
    if found is not None:
        notes.append(
            f"Exponents from {upper} edges on, of stored graphs: output {found['output']:.2f}; "
            + "; ".join(
                f"{name} {found[name]:.2f}, {found[name] - found['output']:+.2f}: "
                + met(found[name] - found["output"], TARGET)
                for name in ("seconds", "memory")
            )
            + "."
        )
    for g in grown:
        if g.n_edges == MEMORY_AT:
            notes.append(f"{MEMORY_AT} edges: {g.peak:.0f} MiB, {met(g.peak, MEMORY_TARGET)}.")
    notes.append("Peak memory of a fresh process, above what it had after imports.")
    return Table(f"Growth, {grown[0].sets} sets, star-shaped polygons", headings, rows, notes)
