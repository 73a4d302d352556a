"""Write the pictures of the documentation, and its live pages, to docs/images and docs/static.

    python docs/gallery.py [FOLDER]

Needs the extras "plot", "dxf" and "svg". A picture of a page is what the page's own examples save
under its name; those of the theory are in `theory_figures`, and the plan at the top of the README
is that of its first command.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import sys
import tempfile
from pathlib import Path

import matplotlib
import snippets
from theory_figures import FIGURES

from regrasp_lp.cli import main as command

DOCS = Path(__file__).resolve().parent
FIRST = re.compile(r"<!-- main-command -->\n```bash\n[^`]*regrasp-lp (plan .*?) --json")
SHOWN = re.compile(r"\]\((?:\.\./)?(images|static)/([\w-]+\.(?:png|gif|html))\)")


def drawn_by(page: Path) -> dict[str, str]:
    """Return what a page shows and its own examples save: names of files, and their folders."""
    code = "".join(example.code for example in snippets.examples(page))
    shown = SHOWN.findall(page.read_text(encoding="utf-8"))
    return {name: folder for folder, name in shown if f'"{name}"' in code}


def draw(page: Path, target: Path) -> None:
    """Run the examples of a page and keep its pictures."""
    with tempfile.TemporaryDirectory() as scratch:
        os.symlink(DOCS.parent / "models", Path(scratch) / "models")
        os.chdir(scratch)
        snippets.run(page)
        for name, folder in drawn_by(page).items():
            shutil.copy(name, target / folder / name)
        os.chdir(DOCS)


def first_command() -> list[str]:
    """Return the arguments of the README's first command, but for the files that it writes."""
    found = FIRST.search((DOCS.parent / "README.md").read_text(encoding="utf-8"))
    assert found is not None, "the README has no first command"
    return shlex.split(found[1])


def main(target: Path = DOCS) -> None:
    """Write all pictures to the folders `images` and `static` of a folder."""
    target = target.resolve()
    matplotlib.use("Agg")
    matplotlib.rcParams["savefig.dpi"] = 110
    for page in sorted(DOCS.rglob("*.md")):
        if drawn_by(page):
            draw(page, target)
    os.chdir(DOCS.parent)
    images = target / "images"
    command(
        [*first_command(), "--plot", str(images / "plan.png"), "--gif", str(images / "plan.gif")]
    )
    for name, figure in FIGURES.items():
        figure().savefig(images / f"{name}.png")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
