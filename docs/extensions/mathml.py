"""Formulas as MathML, written when the site is built: no script, no font, nothing to fetch."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx


def translated(formula: str, as_block: bool = False) -> str:
    """Return the MathML of a formula in LaTeX; docutils knows no three dots but low ones."""
    mathml: str = tex2mathml(formula.replace(r"\dots", r"\ldots"), as_block=as_block)
    return mathml


def inline(self: Any, node: nodes.math) -> None:
    """Write a formula in a line of text."""
    self.body.append(translated(node.astext()))
    raise nodes.SkipNode


def display(self: Any, node: nodes.math_block) -> None:
    """Write a formula on a line of its own, which may be wider than the page."""
    formula = translated(node.astext(), as_block=True)
    self.body.append(f'<div class="formula">{formula}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register both for HTML; what cannot be translated fails the build."""
    app.add_html_math_renderer("mathml", (inline, None), (display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
