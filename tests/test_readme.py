"""The examples of the README run, one after the other, and print what it says."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from conftest import REPOSITORY

TEXT = (REPOSITORY / "README.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```python\n(.*?)```\n(?:\n```\n(.*?)```\n)?", TEXT, re.DOTALL)
"""Each with what it prints, if that is shown."""


def alike(one: str, other: str) -> bool:
    """Whether two texts have the same words, and numbers that are equal to 1 %."""
    words, others = (re.split(r"[\s:,]+", text.strip()) for text in (one, other))
    return len(words) == len(others) and all(map(same, words, others))


def same(word: str, other: str) -> bool:
    try:
        return math.isclose(float(word), float(other), rel_tol=0.01, abs_tol=1e-3)
    except ValueError:
        return word == other


def test_examples_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    (tmp_path / "models").symlink_to(REPOSITORY / "models")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "readme"}
    shown = 0
    for code, expected in EXAMPLES:
        exec(compile(code, code.splitlines()[0], "exec"), names)
        printed = capsys.readouterr().out
        assert not expected or alike(printed, expected), printed
        shown += bool(expected)
    assert len(EXAMPLES) > 10
    assert shown >= 2


@pytest.mark.parametrize("path", [REPOSITORY / "README.md", *(REPOSITORY / "docs").glob("*.md")])
def test_links_lead_somewhere(path: Path) -> None:
    """To files that are there, and to headings of them."""
    links = re.findall(r"\]\(([^)\s]+)\)", path.read_text(encoding="utf-8"))
    for link in links:
        if "://" in link:
            continue
        file, _, anchor = link.partition("#")
        target = (path.parent / file) if file else path
        assert target.exists(), link
        if anchor:
            headings = re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), re.MULTILINE)
            anchors = [re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings]
            assert anchor in anchors, link
