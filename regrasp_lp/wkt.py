"""Polygons as well-known text (WKT): a reader for POLYGON, MULTIPOLYGON and collections of them.

Small enough that reading text files needs no geometry library.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple, TypeAlias, TypeVar

from regrasp_lp.errors import FileFormatError

__all__ = ["looks_like_wkt", "parse_wkt"]

Ring: TypeAlias = list[tuple[float, ...]]
_Item = TypeVar("_Item")

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_TOKEN = re.compile(rf"\s*(?:(?P<number>{_NUMBER})(?![\w.])|(?P<word>[A-Za-z]+)|(?P<sign>[(),]))")
_HEAD = re.compile(
    r"\s*(SRID\s*=\s*\d+\s*;\s*)?[A-Za-z]+(\s*\(|\s+(Z|M|ZM|EMPTY)\b)", re.IGNORECASE
)
_SRID = re.compile(r"\s*SRID\s*=\s*\d+\s*;", re.IGNORECASE)


def looks_like_wkt(text: str) -> bool:
    """Whether the text begins as WKT does: a word, then a parenthesis, Z, M or EMPTY.

    Examples
    --------
    >>> looks_like_wkt("Polygon ((0 0, 1 0, 0 1, 0 0))"), looks_like_wkt("0 0, 1 0")
    (True, False)
    """
    return _HEAD.match(text) is not None


def parse_wkt(text: str) -> list[list[list[Ring]]]:
    """Return the geometries in the text: for each its polygons, for each of them its rings.

    Several geometries may follow one another, separated by white space. Points have as many
    coordinates as the text gives them; `Polygon` refuses all but two.

    Raises
    ------
    FileFormatError
        Where the text is no WKT of polygons; the message says at which line and column.

    Examples
    --------
    >>> parse_wkt("POLYGON ((0 0, 1 0, 0 1, 0 0))")
    [[[[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.0, 0.0)]]]]
    >>> parse_wkt("POLYGON ((0 0, 1 x))")
    Traceback (most recent call last):
    ...
    regrasp_lp.errors.FileFormatError: line 1, column 18: expected a number, found 'x'
    """
    reader = _Reader(text)
    geometries = []
    while not reader.at_end():
        geometries.append(reader.geometry())
    return geometries


class _Token(NamedTuple):
    kind: str | None
    text: str
    start: int
    end: int


class _Reader:
    """A recursive-descent reader, one token ahead."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.place = 0

    def peek(self) -> _Token:
        match = _TOKEN.match(self.text, self.place)
        if match is not None:
            kind = match.lastgroup
            return _Token(kind, match[kind or 0], match.end() - len(match[kind or 0]), match.end())
        start = len(self.text) - len(self.text[self.place :].lstrip())
        found = re.match(r"[^\s(),]*", self.text[start:])
        return _Token(None, found[0] if found else "", start, start)

    def fail(self, expected: str, token: _Token) -> FileFormatError:
        before = self.text[: token.start]
        line, column = before.count("\n") + 1, token.start - (before.rfind("\n") + 1) + 1
        found = repr(token.text) if token.text else "the end"
        return FileFormatError(f"line {line}, column {column}: expected {expected}, found {found}")

    def at_end(self) -> bool:
        return not self.text[self.place :].strip()

    def sign(self, allowed: str) -> str:
        token = self.peek()
        if token.kind != "sign" or token.text not in allowed:
            raise self.fail(" or ".join(f"'{sign}'" for sign in allowed), token)
        self.place = token.end
        return token.text

    def word(self) -> str:
        """Take the next token if it is a word, in upper case; else an empty string."""
        token = self.peek()
        if token.kind != "word":
            return ""
        self.place = token.end
        return token.text.upper()

    def listed(self, read: Callable[[], _Item]) -> list[_Item]:
        """Read items between parentheses, separated by commas."""
        self.sign("(")
        items = [read()]
        while self.sign(",)") == ",":
            items.append(read())
        return items

    def geometry(self) -> list[list[Ring]]:
        """Read one geometry: its polygons."""
        srid = _SRID.match(self.text, self.place)
        self.place = srid.end() if srid else self.place
        token = self.peek()
        kind = self.word()
        if kind not in ("POLYGON", "MULTIPOLYGON", "GEOMETRYCOLLECTION"):
            raise self.fail("POLYGON, MULTIPOLYGON or GEOMETRYCOLLECTION", token)
        token = self.peek()
        word = self.word()
        if word in ("Z", "M", "ZM"):  # the points show it; they are refused with a clearer word
            token = self.peek()
            word = self.word()
        if word:
            raise self.fail("'(': a polygon that is not empty", token)
        if kind == "POLYGON":
            return [self.polygon()]
        if kind == "MULTIPOLYGON":
            return self.listed(self.polygon)
        return [polygon for part in self.listed(self.geometry) for polygon in part]

    def polygon(self) -> list[Ring]:
        return self.listed(self.ring)

    def ring(self) -> Ring:
        return self.listed(self.point)

    def point(self) -> tuple[float, ...]:
        coordinates = []
        token = self.peek()
        while token.kind == "number":
            coordinates.append(float(token.text))
            self.place = token.end
            token = self.peek()
        if not coordinates or token.kind != "sign":
            raise self.fail("a number", token)
        return tuple(coordinates)
