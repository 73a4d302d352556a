"""How Sphinx builds the site: ``python -m sphinx -W docs FOLDER``.

Nothing is fetched, neither now nor by who reads it: formulas become MathML here, the theme brings
no fonts, and figures are files of this folder, drawn by ``gallery.py``.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

from sphinx.application import Sphinx

import regrasp_lp

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE / "extensions")]

# Sphinx takes pages of its own folder only; links between notebooks have to stay in it
shutil.rmtree(HERE / "notebooks", ignore_errors=True)
shutil.copytree(HERE.parent / "notebooks", HERE / "notebooks", ignore=shutil.ignore_patterns(".*"))
for notebook in (HERE / "notebooks").glob("*.ipynb"):
    text = notebook.read_text(encoding="utf-8")
    notebook.write_text(text.replace("](../docs/", "](../"), encoding="utf-8")

project = "regrasp_lp"
author = "The regrasp_lp maintainers"
copyright = "2026, the regrasp_lp maintainers"
version = release = regrasp_lp.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "command_help",
    "docstrings",
    "mathml",
]
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}
exclude_patterns = ["images", "extensions", "static"]
highlight_language = "text"
pygments_style = "friendly"
pygments_dark_style = "github-dark"

nb_execution_mode = "off"  # they hold what they print; the tests run them
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
suppress_warnings = ["myst.header"]  # benchmarks.md is written for reading in the repository, too

default_role = "py:obj"  # `name` in a docstring: a link where there is something to link to
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_type_aliases = {
    name: name
    for name in ("ArrayLike", "FloatArray", "IntArray", "BoolArray", "GraspLike", "ObjectiveLike")
}
autodoc_use_type_comments = False
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
napoleon_use_admonition_for_notes = False

html_math_renderer = "mathml"
smartquotes = False  # commands are pasted
html_theme = "furo"
html_title = f"regrasp_lp {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {
        "color-brand-primary": "#00619a",
        "color-brand-content": "#00619a",
        "color-brand-visited": "#5c4a8a",
    },
    "dark_css_variables": {
        "color-brand-primary": "#7cc4ee",
        "color-brand-content": "#7cc4ee",
        "color-brand-visited": "#b9a6e6",
    },
}


def setup(app: Sphinx) -> None:
    """Links to notebooks, which lead out of this folder where pages are read in the repository."""

    def inside(app: Sphinx, page: str, source: list[str]) -> None:
        source[0] = re.sub(r"\]\(\.\./((?:\.\./)*notebooks/)", r"](\1", source[0])

    app.connect("source-read", inside)
