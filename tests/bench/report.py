"""Tables as text and as Markdown, and the machine they were measured on."""

from __future__ import annotations

import os
import platform
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

_CPUINFO = Path("/proc/cpuinfo")


@dataclass(frozen=True)
class Table:
    """A title, headings, rows of cells, and lines below that say what it means.

    The first column stands to the left, the others, being numbers, to the right.
    """

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = field(default=())

    def text(self) -> str:
        """Aligned columns."""
        lines = [self.headings, *self.rows]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        aligned = [
            "  ".join(
                cell.rjust(width) if i else cell.ljust(width)
                for i, (cell, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        ]
        notes = [
            textwrap.fill(note, 110, initial_indent="  ", subsequent_indent="    ")
            for note in self.notes
        ]
        return "\n".join([self.title, "", *aligned, *notes, ""])

    def markdown(self) -> str:
        """A Markdown table under a heading."""
        rule = [":---", *("---:" for _ in self.headings[1:])]
        lines = [self.headings, rule, *self.rows]
        table = [f"| {' | '.join(line)} |" for line in lines]
        notes = [f"{note}\n" for note in self.notes]
        return "\n".join([f"### {self.title}", "", *table, "", *notes])


def machine() -> dict[str, str]:
    """What was measured on, without anything that names one machine."""
    import shapely

    names = ("numpy", "scipy", "clarabel", "highspy", "cvxpy", "shapely")
    return {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.machine()}",
        "Python": platform.python_version(),
        **{name: version(name) for name in names},
        "GEOS": ".".join(map(str, shapely.geos_version)),
    }


def _processor() -> str:
    if _CPUINFO.exists():
        for line in _CPUINFO.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return " ".join(line.split(":", 1)[1].split())
    return platform.processor() or platform.machine()


def ms(seconds: float) -> str:
    """Seconds as milliseconds, three digits."""
    return f"{1000 * seconds:.3g}" if seconds < 1 else f"{1000 * seconds:.0f}"


def met(value: float, target: float) -> str:
    """Whether a value is within its target, in words."""
    return f"met (<= {target:g})" if value <= target else f"missed (<= {target:g})"
