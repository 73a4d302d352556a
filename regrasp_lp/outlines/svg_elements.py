"""SVG files as a tree of elements that know their line, and what their attributes say."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from regrasp_lp.errors import FileFormatError

__all__ = ["Element", "looks_like_svg", "parse_elements", "short"]

_NAMESPACE = "http://www.w3.org/2000/svg"
_XLINK = "http://www.w3.org/1999/xlink"
_INKSCAPE = "http://www.inkscape.org/namespaces/inkscape"
_LENGTH = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)\s*(%|[a-zA-Z]*)")
_UNITS = {"": 1, "px": 1, "pt": 4 / 3, "pc": 16, "in": 96, "cm": 96 / 2.54, "mm": 96 / 25.4}
"""CSS units in user units; there are 96 to the inch."""
_LONGEST_ENTITY = 200
"""Entities that stand for more characters, or for other entities, can blow up a small file."""
_STYLED = ("display", "visibility", "fill", "fill-rule", "clip-path", "mask", "transform", "d")


@dataclass
class Element:
    """An element: its tag without the namespace ("" if it is not SVG's), attributes, children.

    Properties of the attribute `style` count as attributes, which they override.
    """

    tag: str
    line: int
    attributes: dict[str, str]
    children: list[Element] = field(default_factory=list)
    words: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        name = f"id {self.name!r}, " if self.name else ""
        return f"<{self.tag}> ({name}line {self.line})"

    @property
    def name(self) -> str | None:
        """What the drawing calls the element: its label in Inkscape, or its id."""
        return self.attributes.get("label") or self.attributes.get("id") or None

    @property
    def text(self) -> str:
        """What is written in the element itself."""
        return "".join(self.words)

    @property
    def reference(self) -> str | None:
        """The id that a `use` refers to."""
        href = self.attributes.get("href", "").strip()
        return href[1:] if href.startswith("#") else None

    def length(self, name: str, whole: float | None, default: str = "0") -> float:
        """Return a length in user units; `whole` is what 100% are, None where nothing says it.

        Raises
        ------
        FileFormatError
            If it is no length, or in a unit that depends on fonts or windows.
        """
        text = self.attributes.get(name, default)
        match = _LENGTH.fullmatch(text.strip())
        if match is not None and math.isfinite(float(match[1])):
            number, unit = float(match[1]), match[2]
            if unit in _UNITS:
                return number * _UNITS[unit]
            if unit == "%" and whole is not None:
                return number / 100 * whole
        raise FileFormatError(
            f"{self}: {name}={short(text)} is no length in px, pt, pc, in, cm or mm"
        )

    def everything(self) -> Iterator[Element]:
        """Yield the element and all that is in it."""
        yield self
        for child in self.children:
            yield from child.everything()


def short(text: str) -> str:
    """Quote a text in a message, the beginning of a long one."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


def looks_like_svg(data: bytes) -> bool:
    """Whether a file begins as XML does, and SVG's root element comes soon.

    Examples
    --------
    >>> looks_like_svg(b'<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg"/>')
    True
    """
    # Files in UTF-16, which XML may be in, have a zero byte beside each of these
    start = (
        data[:65536].replace(b"\0", b"").removeprefix(b"\xef\xbb\xbf").lstrip(b"\xff\xfe \t\r\n")
    )
    return start.startswith(b"<") and re.search(rb"<([\w.-]+:)?svg[\s>/]", start) is not None


def parse_elements(data: bytes) -> Element:
    """Return the root element of an SVG file.

    Raises
    ------
    FileFormatError
        If it is no well-formed XML, or its root is no SVG element.
    """
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    top = Element("", 0, {})
    stack = [top]

    def start(qualified: str, given: dict[str, str]) -> None:
        space, _, tag = qualified.rpartition(" ")
        attributes = dict(_attributes(given))
        ours = space in (_NAMESPACE, "")
        element = Element(tag if ours else "", parser.CurrentLineNumber, attributes)
        stack[-1].children.append(element)
        stack.append(element)

    def text(characters: str) -> None:
        stack[-1].words.append(characters)

    def entity(name: str, parameter: bool, value: str | None, *_: object) -> None:
        # Illustrator declares short names of namespaces, which do no harm
        if parameter or value is None or "&" in value or len(value) > _LONGEST_ENTITY:
            raise FileFormatError(
                f"declares the entity {short(name)} in line {parser.CurrentLineNumber}, which is "
                "long, refers to others or is not in the file: save it as plain SVG"
            )

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: stack.pop()
    parser.CharacterDataHandler = text
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise FileFormatError(f"is XML that cannot be read: {error}") from error
    (root,) = top.children
    if root.tag != "svg":
        raise FileFormatError(f"is XML, but its root element, in line {root.line}, is no <svg>")
    return root


def _attributes(given: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Attributes without their namespaces, and after them the properties in `style`."""
    for qualified, value in given.items():
        space, _, name = qualified.rpartition(" ")
        if space in ("", _NAMESPACE, _XLINK) or (space, name) == (_INKSCAPE, "label"):
            yield name, value
    for declaration in given.get("style", "").split(";"):
        name, colon, value = declaration.partition(":")
        if colon and name.strip() in _STYLED:
            yield name.strip(), value.replace("!important", "").strip()
