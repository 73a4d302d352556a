"""Summaries of several switching graphs in one table: as text, CSV or Markdown.

The columns are those of the chapter's tables 3.1 and 3.2: name and edges of the object; for each
kind of grasp sets how many there are, of how many candidates, and in how many components; how many
there are of all kinds combined, in how many components, joined by how many switches; and the
seconds that the construction took. Kinds that a graph was not asked for are left empty.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby

from regrasp_lp.summary import Summary

__all__ = ["csv_table", "markdown_table", "text_table"]

_COMBINED = "combined"
_SHORT = {"candidates": "cand.", "components": "comp."}


def text_table(summaries: Sequence[Summary]) -> str:
    """Return a table of aligned columns, under a header of two lines.

    Parameters
    ----------
    summaries : sequence of Summary
        One for each row.

    Returns
    -------
    str
        Lines that end with a newline; "cand." are candidates and "comp." components.

    Examples
    --------
    >>> from regrasp_lp.summary import KindCounts
    >>> kinds = {"two_finger": KindCounts(candidates=4, sets=2, components=1)}
    >>> block = Summary("block", 4, kinds, 2, 1, [2], {"sets": 0.25, "switches": 0.5})
    >>> print(text_table([block]), end="")
                   --- two-finger ---   ------ combined -----
    name   edges   sets  cand.  comp.   sets  comp.  switches   seconds
    block      4      2      4      1      2      1         1     0.750
    """
    blocks: list[list[str]] = []
    for group, columns in groupby(_columns(summaries), key=lambda column: column.group):
        aligned = [column.aligned() for column in columns]
        rows = ["  ".join(cells) for cells in zip(*aligned, strict=True)]
        width = len(rows[0])
        title = f" {_words(group)} ".center(width, "-") if group else " " * width
        blocks.append([title, *rows])
    return "".join("   ".join(line).rstrip() + "\n" for line in zip(*blocks, strict=True))


def csv_table(summaries: Sequence[Summary]) -> str:
    r"""Return a table as comma-separated values, under one line of headings.

    Parameters
    ----------
    summaries : sequence of Summary
        One for each row.

    Returns
    -------
    str
        Lines that end with a newline. The headings of kinds are ``two_finger_sets``,
        ``two_finger_candidates``, ``two_finger_components`` and so on.

    Examples
    --------
    >>> csv_table([Summary("block, small", 4, {}, 2, 1, [2], {"sets": 0.25})])
    'name,edges,sets,components,switches,seconds\n"block, small",4,2,1,1,0.250\n'
    """
    columns = _columns(summaries)
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([column.key for column in columns])
    writer.writerows(zip(*(column.cells for column in columns), strict=True))
    return file.getvalue()


def markdown_table(summaries: Sequence[Summary]) -> str:
    r"""Return a table for Markdown documents, with its numbers to the right.

    Parameters
    ----------
    summaries : sequence of Summary
        One for each row.

    Returns
    -------
    str
        Lines that end with a newline.

    Examples
    --------
    >>> print(markdown_table([Summary("a|b", 4, {}, 2, 1, [2], {"sets": 0.25})]), end="")
    | name | edges | combined sets | combined components | combined switches | seconds |
    | :--- | ---: | ---: | ---: | ---: | ---: |
    | a\|b | 4 | 2 | 1 | 1 | 0.250 |
    """
    columns = _columns(summaries)
    lines = [
        [_words(f"{column.group} {column.title}".strip()) for column in columns],
        [":---" if column.is_text else "---:" for column in columns],
        *zip(*(map(_escaped, column.cells) for column in columns), strict=True),
    ]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


@dataclass(frozen=True)
class _Column:
    group: str  # a kind of sets or _COMBINED; empty if the column stands alone
    title: str
    cells: list[str]

    @property
    def is_text(self) -> bool:
        return self.title == "name"

    @property
    def key(self) -> str:
        """Its name among all columns."""
        return self.title if self.group in ("", _COMBINED) else f"{self.group}_{self.title}"

    def aligned(self) -> list[str]:
        """Its short title and its cells, all of one width."""
        cells = [_SHORT.get(self.title, self.title), *self.cells]
        width = max(map(len, cells))
        return [cell.ljust(width) if self.is_text else cell.rjust(width) for cell in cells]


def _columns(summaries: Sequence[Summary]) -> list[_Column]:
    def column(group: str, title: str, cell: Callable[[Summary], object]) -> _Column:
        return _Column(group, title, [str(cell(summary)) for summary in summaries])

    def of_kind(kind: str, title: str) -> _Column:
        return column(
            kind, title, lambda s: getattr(s.kinds[kind], title) if kind in s.kinds else ""
        )

    kinds = dict.fromkeys(kind for summary in summaries for kind in summary.kinds)
    return [
        column("", "name", lambda s: " ".join(s.name.split())),
        column("", "edges", lambda s: s.n_edges),
        *(of_kind(kind, title) for kind in kinds for title in ("sets", "candidates", "components")),
        column(_COMBINED, "sets", lambda s: s.n_sets),
        column(_COMBINED, "components", lambda s: len(s.components)),
        column(_COMBINED, "switches", lambda s: s.n_switches),
        column("", "seconds", lambda s: f"{sum(s.seconds.values()):.3f}"),
    ]


def _words(heading: str) -> str:
    return heading.replace("_", "-")


def _escaped(cell: str) -> str:
    return cell.replace("\\", "\\\\").replace("|", "\\|")
