"""Texts that fit a terminal."""

from __future__ import annotations

import re
import shutil
import sys
import textwrap
from collections.abc import Sequence


def fitted(text: str, columns: int | None = None) -> str:
    """Return an account with its lines broken if they are too long for the terminal.

    A step's line has two columns, which several spaces part; the second one goes below the first.
    If one line is too long all steps are broken, so that they look alike.

    Parameters
    ----------
    text : str
    columns : int, optional
        By default those of the terminal, or no limit where the output goes elsewhere.

    Examples
    --------
    >>> print(fitted("  1  place finger 4 on edge 2 at 0.5   margin 0.1", columns=40))
      1  place finger 4 on edge 2 at 0.5
           margin 0.1
    """
    if columns is None:
        terminal = sys.stdout is not None and sys.stdout.isatty()
        columns = shutil.get_terminal_size().columns if terminal else None
    lines = text.splitlines()
    if columns is None or max(map(len, lines), default=0) <= columns:
        return text
    broken: list[str] = []
    for line in lines:
        parts = re.fullmatch(r"(\s*\d+  )(\S.*?)\s{2,}(\S.*)", line)
        if parts is None:
            broken += _wrapped(line, columns, "", "  ") or [""]
            continue
        number, step, held = parts.groups()
        under = " " * (len(number) + 2)
        broken += _wrapped(step, columns, number, under)
        broken += _wrapped(held, columns, under, under)
    return "\n".join(broken)


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of equally many cells as lines; the last column to the left, others right.

    Examples
    --------
    >>> print(table([("edge", "length", ""), ("0", "12.5", "hole 1")]))
    edge  length
       0    12.5  hole 1
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(
            [*(cell.rjust(width) for cell, width in zip(row[:-1], widths, strict=False)), row[-1]]
        ).rstrip()
        for row in rows
    )


def _wrapped(text: str, columns: int, first: str, under: str) -> list[str]:
    return textwrap.wrap(
        text,
        max(columns, 20),
        initial_indent=first,
        subsequent_indent=under,
        break_long_words=False,
        break_on_hyphens=False,
    )
