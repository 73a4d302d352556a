"""The pages of the documentation: their examples run and print what they say; nothing is left out.

Sphinx builds the site in `.ci/run`, with warnings as errors; here is what it does not see.
"""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest
from conftest import REPOSITORY

import regrasp_lp as rl
from regrasp_lp.cli.arguments import build_parser

DOCS = REPOSITORY / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md"))
REFERENCE = "\n".join(p.read_text(encoding="utf-8") for p in (DOCS / "reference").glob("*.md"))


def load(monkeypatch: pytest.MonkeyPatch, name: str, folder: Path = DOCS) -> ModuleType:
    """Import a module of the documentation."""
    monkeypatch.syspath_prepend(folder)
    return import_module(name)


def named(path: Path) -> str:
    return path.relative_to(DOCS).as_posix()


@pytest.mark.parametrize(
    "page", [p for p in PAGES if "```python\n" in p.read_text(encoding="utf-8")], ids=named
)
def test_examples_run_and_print_what_the_page_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    snippets = load(monkeypatch, "snippets")
    (tmp_path / "models").symlink_to(REPOSITORY / "models")
    monkeypatch.chdir(tmp_path)
    for example, printed in snippets.run(page):
        assert snippets.alike(example.shown, printed), f"{example.code}\nprints\n{printed}"
    # pictures that the page shows and its examples draw are there under these names
    for name, folder in load(monkeypatch, "gallery").drawn_by(page).items():
        assert (tmp_path / name).exists(), name
        if name.endswith(".html"):
            kept, new = (program_of(path / name) for path in (DOCS / folder, tmp_path))
            assert kept == new, f"docs/{folder}/{name} is old: run python docs/gallery.py"


def program_of(page: Path) -> list[str]:
    """Styles and scripts of a page for a browser, without its data, whose last digits may vary."""
    text = page.read_text(encoding="utf-8")
    parts = re.findall(r"<(?:style|script)(?![^>]*json)[^>]*>(.*?)</(?:style|script)>", text, re.S)
    assert len(parts) >= 2
    return parts


def test_what_is_printed_is_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    alike = load(monkeypatch, "snippets").alike
    assert alike("margin 5.857, 3 sets", "margin 5.8574, 3\n sets\n")
    assert alike("seconds ...", "seconds 0.3")
    assert not alike("margin 5.857", "margin 5.7")
    assert not alike("3 sets", "3 pieces")
    assert not alike("", "3 sets")


@pytest.mark.parametrize("name", ["torque_functions", "cover", "projection", "switching", "levels"])
def test_figures_of_the_theory_are_drawn(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    figures = load(monkeypatch, "theory_figures").FIGURES
    figure = figures[f"theory_{name}"]()
    figure.draw_without_rendering()
    assert all(axes.has_data() for axes in figure.axes)
    assert set(figures) == set(re.findall(r"images/(theory_\w+)\.png", read("theory.md")))


def read(page: str) -> str:
    return (DOCS / page).read_text(encoding="utf-8")


def documented(module: str) -> set[str]:
    """Names that the reference documents, of a module or of what it has taken over."""
    return set(re.findall(rf"auto(?:class|function|exception):: {module}\.(\w+)$", REFERENCE, re.M))


@pytest.mark.parametrize("name", ["", ".plotting", ".quality", ".viewer"])
def test_every_public_name_is_in_the_reference(name: str) -> None:
    if name == ".plotting":
        pytest.importorskip("matplotlib")
    module = import_module(f"regrasp_lp{name}")
    modules = {entry for entry in module.__all__ if inspect.ismodule(getattr(module, entry))}
    taken_over = documented("regrasp_lp") if name else set()
    missing = set(module.__all__) - documented(module.__name__) - taken_over - modules
    assert missing == set(), f"enter them in a page of docs/reference: {sorted(missing)}"


def test_what_is_documented_exists() -> None:
    pytest.importorskip("matplotlib")
    found = re.findall(r"auto(?:class|function|exception):: (regrasp_lp[\w.]*)$", REFERENCE, re.M)
    assert len(found) > len(rl.__all__)
    assert len(set(found)) == len(found)
    for path in found:
        owner, _, name = path.rpartition(".")
        assert inspect.getdoc(getattr(import_module(owner), name)), path


def test_the_reference_of_the_command_line_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every command has its section, and every option of it is in what the directive writes."""
    found = load(monkeypatch, "commands")
    page = read("reference/cli.md")
    parsers = found.parsers()
    assert set(re.findall(r"^## (\w+)$", page, re.MULTILINE)) == set(parsers) - {""}
    assert re.findall(r"\{command-help\} ?(\w*)", page) == ["", *(n for n in parsers if n)]
    for name, parser in parsers.items():
        written = " ".join(term for _, rows in found.described(parser) for term, _ in rows)
        for action in parser._actions:
            for option in action.option_strings:
                assert option in ("-h", "--help") or option in written, (name, option)


def test_commands_on_pages_are_understood() -> None:
    """Each ``regrasp-lp`` line of a shell block, or of the README, has a command that exists."""
    parser = build_parser()
    known = {choice for action in parser._actions if action.choices for choice in action.choices}
    for page in [*PAGES, REPOSITORY / "README.md"]:
        for command in re.findall(r"^regrasp-lp (\w+)", page.read_text(encoding="utf-8"), re.M):
            assert command in known, (page, command)


def test_the_site_asks_nothing_of_the_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """Formulas are written as MathML, and every one of them is understood."""
    pytest.importorskip("sphinx", reason="no extra docs; building the site tests the same")
    mathml = load(monkeypatch, "mathml", DOCS / "extensions")
    formulas = re.findall(r"\$\$(.+?)\$\$|\$([^$\n]+)\$", read("theory.md"), re.DOTALL)
    assert len(formulas) > 100
    for block, line in formulas:
        assert mathml.translated(block or line).startswith("<math")
    conf = read("conf.py")
    assert "mathjax" not in conf
    assert "http" not in conf + read("static/site.css")
