"""The directive ``command-help``: a command's options, from the parser that reads them."""

from __future__ import annotations

import re
from typing import Any

from commands import described, parsers
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class CommandHelp(SphinxDirective):
    """A command's description, usage, options and examples."""

    required_arguments = 0
    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return what the page shows."""
        parser = parsers()[self.arguments[0] if self.arguments else ""]
        shown: list[nodes.Node] = []
        for paragraph in (parser.description or "").split("\n\n"):
            shown.append(nodes.paragraph("", "", *_words(paragraph.replace("\n", " "))))
        for title, rows in described(parser):
            shown.append(nodes.rubric("", title))
            shown.append(_list(rows))
        epilog = parser.epilog or ""
        shown.append(nodes.literal_block(epilog, epilog, language="text"))
        return shown


_LITERAL = re.compile(r"`([^`]+)`|(?<![\w-])(--[a-z][\w-]*)")


def _words(text: str) -> list[nodes.Node]:
    """Return a help text with its options and commands as code."""
    pieces: list[nodes.Node] = []
    at = 0
    for found in _LITERAL.finditer(text):
        pieces.append(nodes.Text(text[at : found.start()]))
        pieces.append(nodes.literal("", found[1] or found[2]))
        at = found.end()
    return [*pieces, nodes.Text(text[at:])]


def _list(rows: list[tuple[str, str]]) -> nodes.definition_list:
    listed = nodes.definition_list(classes=["options"])
    for written, explained in rows:
        term = nodes.term("", "", nodes.literal("", written))
        text = nodes.definition("", nodes.paragraph("", "", *_words(explained)))
        listed += nodes.definition_list_item("", term, text)
    return listed


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
