"""Docstrings as they are meant: what autodoc and napoleon read otherwise than we write it."""

from __future__ import annotations

import re

from sphinx.application import Sphinx
from sphinx.ext.napoleon.docstring import NumpyDocstring
from sphinx.util.inspect import TypeAliasForwardRef

_ARRAY_LIKE = re.compile(r"(?:[\w.]+\.)?_Buffer \| .*?complex \| bytes \| str\](?! \| _Nested)")


def whole(docstring: NumpyDocstring) -> tuple[str, list[str]]:
    """Return a property's type, none, and its text: a colon in the first line ends no type."""
    lines = [docstring._lines.next(), *docstring._dedent(docstring._consume_to_end())]
    return "", NumpyDocstring(lines, docstring._config).lines()


def signature(
    app: Sphinx,
    what: str,
    name: str,
    of: object,
    options: object,
    arguments: str | None,
    returned: str | None,
) -> tuple[str | None, str | None]:
    """Return the two halves of a signature with `ArrayLike` instead of what it stands for."""

    def named(half: str | None) -> str | None:
        return half and _ARRAY_LIKE.sub("ArrayLike", half)

    return named(arguments), named(returned)


def setup(app: Sphinx) -> dict[str, bool]:
    """Read docstrings so."""
    NumpyDocstring._consume_inline_attribute = whole
    TypeAliasForwardRef.__repr__ = lambda self: self.name
    app.connect("autodoc-process-signature", signature)
    return {"parallel_read_safe": True}
