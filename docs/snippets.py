"""The examples of a page: read, run one after the other, compared with what it says they print.

The tests run those of all pages; `gallery.py` keeps the pictures that they draw.
"""

from __future__ import annotations

import contextlib
import io
import math
import re
from dataclasses import dataclass
from pathlib import Path

_EXAMPLE = re.compile(r"```python\n(.*?)```\n(?:\n```\n(.*?)```\n)?", re.DOTALL)
_BETWEEN_WORDS = re.compile(r"[\s:,]+")


@dataclass(frozen=True)
class Example:
    """A block of Python on a page.

    Parameters
    ----------
    code : str
    shown : str
        What the page says it prints; empty if it does not say.
    """

    code: str
    shown: str


def examples(page: Path) -> list[Example]:
    """Return the examples of a page, in order."""
    found = _EXAMPLE.findall(page.read_text(encoding="utf-8"))
    return [Example(code, shown) for code, shown in found]


def run(page: Path) -> list[tuple[Example, str]]:
    """Run the examples of a page, in one namespace, and return each with what it printed."""
    names: dict[str, object] = {"__name__": "page"}
    ran = []
    for example in examples(page):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(example.code, f"{page.name}: {example.code[:40]!r}", "exec"), names)
        ran.append((example, printed.getvalue()))
    return ran


def alike(shown: str, printed: str) -> bool:
    """Whether two texts have the same words in every line.

    Numbers are equal to 1 %, and ``...`` is to any word. A paragraph that is broken at spaces, for
    numbers may be a digit longer elsewhere, is one line: the following lines are indented.
    """
    one, other = (re.sub(r"\n +(?=\S)", " ", text.strip()).split("\n") for text in (shown, printed))
    return len(one) == len(other) and all(map(_alike, one, other))


def _alike(shown: str, printed: str) -> bool:
    words, others = (_BETWEEN_WORDS.split(text.strip()) for text in (shown, printed))
    return len(words) == len(others) and all(map(_same, words, others))


def _same(word: str, other: str) -> bool:
    if word == "...":
        return True
    try:
        return math.isclose(float(word), float(other), rel_tol=0.01, abs_tol=1e-3)
    except ValueError:
        return word == other
