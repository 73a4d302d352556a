"""The examples of the README run and print what it says; links of all pages lead somewhere."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest
from conftest import REPOSITORY

from regrasp_lp.cli import main

README = REPOSITORY / "README.md"
PAGES = [README, *sorted((REPOSITORY / "docs").rglob("*.md"))]


def test_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    monkeypatch.syspath_prepend(REPOSITORY / "docs")
    snippets = import_module("snippets")
    (tmp_path / "models").symlink_to(REPOSITORY / "models")
    monkeypatch.chdir(tmp_path)
    ran = snippets.run(README)
    for example, printed in ran:
        assert not example.shown or snippets.alike(example.shown, printed), printed
    assert len(ran) > 4
    assert sum(bool(example.shown) for example, _ in ran) >= 2


def test_the_first_command_prints_what_the_readme_shows(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Line after line, but for what ``...`` stands for."""
    pytest.importorskip("matplotlib").use("Agg")
    monkeypatch.syspath_prepend(REPOSITORY / "docs")
    monkeypatch.chdir(REPOSITORY)
    assert main(import_module("gallery").first_command()) == 0
    printed = iter(capsys.readouterr().out.splitlines())
    text = README.read_text(encoding="utf-8")
    found = re.search(r"main-command -->\n```bash\n.*?```\n.*?```\n(.*?)```", text, re.DOTALL)
    assert found is not None
    shown = found[1].splitlines()
    assert len(shown) > 8
    for line in shown:
        assert line == "..." or line in printed, line


@pytest.mark.parametrize("path", PAGES, ids=lambda page: page.relative_to(REPOSITORY).as_posix())
def test_links_lead_somewhere(path: Path) -> None:
    """To files that are there, and to headings of them."""
    text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    links = re.findall(r"\]\(([^)\s]+)\)", text)
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
