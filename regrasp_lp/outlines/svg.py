"""SVG drawings: the outlines of their shapes and paths (needs the extra "svg").

Path data and lists of transformations are read by `svgpathtools`; groups, symbols and their uses,
view boxes, units and basic shapes are followed here, since no maintained library does all of it
and says which element, in which line, it did not understand.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from regrasp_lp.errors import FileFormatError, MissingExtraError, OptionError
from regrasp_lp.outlines.drawing import Expansion, Piece, Reading
from regrasp_lp.outlines.svg_elements import Element, parse_elements, short
from regrasp_lp.outlines.svg_shapes import SHAPES, Viewport, numbers_in

__all__ = ["read_svg"]

_Floats: TypeAlias = npt.NDArray[np.float64]

_NOT_DRAWN = (
    *("defs", "symbol", "title", "desc", "metadata", "style", "script", "view", "set"),
    *("linearGradient", "radialGradient", "pattern", "clipPath", "mask", "marker", "filter"),
    *("animate", "animateMotion", "animateTransform"),
)
"""Elements that show nothing where they stand, beside those of other namespaces."""
_GROUPS = ("g", "a", "switch", "svg")
_DEEPEST = 64
"""Uses within uses; more of them contain themselves."""
_IDENTITY = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def read_svg(data: bytes, reading: Reading) -> list[Piece]:
    """Return the pieces of outlines that an SVG file draws; as there, the y axis points down.

    Raises
    ------
    MissingExtraError
        If svgpathtools is not installed.
    FileFormatError
        If the file is damaged, or holds an element that is no outline; the message names it.
    OptionError
        If no group has a name asked for.
    """
    try:
        import svgpathtools  # noqa: F401  (only to say what is missing before any work)
    except ModuleNotFoundError as error:
        raise MissingExtraError("svgpathtools", "svg", "reading SVG files") from error
    with np.errstate(all="ignore"):  # what is not finite is refused with its name later
        return _Walk(parse_elements(data), reading).pieces()


@dataclass(frozen=True)
class _State:
    """What elements inherit."""

    matrix: _Floats
    viewport: Viewport
    wanted: bool
    visible: bool = True
    filled: bool = True
    rule: str = "nonzero"
    depth: int = 0


class _Walk:
    """Goes through the tree of elements, uses included."""

    def __init__(self, root: Element, reading: Reading) -> None:
        self._root, self._reading = root, reading
        elements = list(root.everything())
        self._by_id = {e.attributes["id"]: e for e in reversed(elements) if "id" in e.attributes}
        self._ignored = {kind.casefold() for kind in reading.ignore}
        self._others: list[Element] = []
        self._expansion = Expansion()
        self._compounds = 0
        self._layers = {
            name for e in elements if e.tag in _GROUPS for name in _names(e) if e is not root
        }
        for name in reading.layers or ():
            if name not in self._layers:
                listed = ", ".join(map(repr, sorted(self._layers))) or "no named group at all"
                raise OptionError(f"there is no group named {name!r}; there are {listed}")
        sheet = " ".join(e.text for e in elements if e.tag == "style")
        found = re.search(r"(?<![\w-])(display|clip-path|mask|transform|fill-rule)\s*:", sheet)
        if found:
            raise FileFormatError(
                f"its style sheet sets {found[1]!r}: style sheets are not read; write it as an "
                "attribute of the elements"
            )
        self._fills_in_sheet = re.search(r"(?<![\w-])fill\s*:", sheet) is not None

    def pieces(self) -> list[Piece]:
        root = self._root
        whole = Viewport(None, None)
        box = _view_box(root)
        if box is not None:
            whole = Viewport(box[2], box[3])
        elif "width" in root.attributes and "height" in root.attributes:
            whole = Viewport(*(root.length(name, None) for name in ("width", "height")))
        wanted = self._reading.layers is None
        found = list(self._inside(root, self._inherited(root, _State(_IDENTITY, whole, wanted))))
        if self._others:
            kinds = sorted({element.tag for element in self._others})
            raise FileFormatError(
                f"{self._others[0]} is no outline: leave such elements out with "
                f"ignore=[{', '.join(repr(kind) for kind in kinds)}], turn them into paths, or "
                "name the groups to read with layers=[...]"
            )
        return found

    def _inside(self, element: Element, state: _State) -> Iterator[Piece]:
        for child in element.children:
            yield from self._walk(child, state)

    def _inherited(self, element: Element, state: _State) -> _State:
        """Apply an element's own attributes."""
        attributes = element.attributes
        for name in ("clip-path", "mask"):
            if attributes.get(name, "none") != "none":
                raise FileFormatError(f"{element} has a {name}: apply it to the shapes first")
        layers = self._reading.layers or ()
        named = element.tag in _GROUPS and any(name in layers for name in _names(element))
        fill = attributes.get("fill", "inherit")
        rule = attributes.get("fill-rule", "inherit")
        seen = attributes.get("visibility", "inherit")
        return replace(
            state,
            matrix=_after(state.matrix, _transform(element)),
            wanted=state.wanted or named,
            visible=state.visible if seen == "inherit" else seen == "visible",
            filled=state.filled if fill == "inherit" else fill not in ("none", "transparent"),
            rule=state.rule if rule == "inherit" else rule,
        )

    def _walk(self, element: Element, state: _State) -> Iterator[Piece]:
        self._expansion.add(element)
        tag = element.tag
        if not tag or tag in _NOT_DRAWN or tag.casefold() in self._ignored:
            return
        if element.attributes.get("display", "inline") == "none":
            return
        state = self._inherited(element, state)
        if tag == "use":
            yield from self._use(element, state)
        elif tag == "svg":
            yield from self._inside(element, _in_view(element, element, state))
        elif tag in _GROUPS:
            yield from self._inside(element, state)
        elif state.wanted and state.visible:
            if tag not in SHAPES:
                self._others.append(element)
                return
            yield from self._shape(element, state)

    def _use(self, use: Element, state: _State) -> Iterator[Piece]:
        target = self._by_id.get(use.reference or "")
        if target is None:
            href = use.attributes.get("href", "")
            raise FileFormatError(f"{use} refers to {href!r}, which is not in the file")
        if state.depth >= _DEEPEST:
            raise FileFormatError(f"{use} contains itself")
        width, height = state.viewport.width, state.viewport.height
        shift = np.array([[1.0, 0.0, use.length("x", width)], [0.0, 1.0, use.length("y", height)]])
        state = replace(state, matrix=_after(state.matrix, shift), depth=state.depth + 1)
        if target.tag == "symbol":
            inner = self._inherited(target, state)
            yield from self._inside(target, _in_view(target, use, inner))
        elif target.tag == "svg":
            yield from self._inside(target, _in_view(target, use, self._inherited(target, state)))
        else:
            yield from self._walk(target, state)

    def _shape(self, element: Element, state: _State) -> Iterator[Piece]:
        compound = None
        if state.filled and state.rule == "nonzero" and element.tag == "path":
            if (
                self._fills_in_sheet
                and len(re.findall("[Mm]", element.attributes.get("d", ""))) > 1
            ):
                raise FileFormatError(
                    f"{element} has several parts, and a style sheet, which is not read, may say "
                    "whether it is filled: write fill and fill-rule as its attributes"
                )
            self._compounds += 1
            compound = self._compounds
        for curves, closed in SHAPES[element.tag](element, state.viewport):
            moved = tuple(curve.transformed(state.matrix) for curve in curves)
            if abs(float(np.linalg.det(state.matrix[:, :2]))) == 0:
                raise FileFormatError(f"{element} is scaled to nothing")
            yield Piece(str(element), element.name, moved, closed, compound)


def _names(element: Element) -> list[str]:
    return [element.attributes[key] for key in ("id", "label") if key in element.attributes]


# --- coordinates --------------------------------------------------------------------------------


def _after(outer: _Floats, inner: _Floats) -> _Floats:
    """The affine map that does the inner first; matrices (A | b)."""
    linear = outer[:, :2] @ inner[:, :2]
    return np.column_stack([linear, outer[:, :2] @ inner[:, 2] + outer[:, 2]])


def _transform(element: Element) -> _Floats:
    from svgpathtools.parser import parse_transform

    try:
        matrix: _Floats = parse_transform(element.attributes.get("transform"), strict=True)
    except ValueError as error:
        raise FileFormatError(f"{element}: its transform cannot be read: {error}") from error
    return matrix[:2]


def _view_box(element: Element) -> tuple[float, ...] | None:
    text = element.attributes.get("viewBox")
    if text is None:
        return None
    numbers = tuple(numbers_in(text, element, "viewBox"))
    if len(numbers) != 4 or not (numbers[2] > 0 and numbers[3] > 0):
        raise FileFormatError(f"{element}: viewBox={short(text)} is not x y width height")
    return numbers


def _in_view(element: Element, sized: Element, state: _State) -> _State:
    """Go into a nested svg or a symbol: fit its view box to the size that it, or its use, has."""
    width, height = state.viewport.width, state.viewport.height
    shift = (0.0, 0.0)
    if element is sized:
        shift = (element.length("x", width), element.length("y", height))
    shifted = _after(state.matrix, np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]]]))
    box = _view_box(element)
    known = [sized if name in sized.attributes else element for name in ("width", "height")]
    if box is None:
        if any(
            name not in e.attributes for e, name in zip(known, ("width", "height"), strict=True)
        ):
            return replace(state, matrix=shifted)
        size = (known[0].length("width", width), known[1].length("height", height))
        return replace(state, matrix=shifted, viewport=Viewport(*size))
    w, h = known[0].length("width", width, "100%"), known[1].length("height", height, "100%")
    scales = [w / box[2], h / box[3]]
    slack = (0.0, 0.0)
    words = element.attributes.get("preserveAspectRatio", "xMidYMid meet").split() or ["xMidYMid"]
    if words[0] != "none":
        scales = [(max if words[1:] == ["slice"] else min)(scales)] * 2
        share = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}
        match = re.fullmatch(r"x(Min|Mid|Max)Y(Min|Mid|Max)", words[0])
        if match is None:
            raise FileFormatError(
                f"{element}: preserveAspectRatio={short(' '.join(words))} is unknown"
            )
        slack = (
            (w - scales[0] * box[2]) * share[match[1]],
            (h - scales[1] * box[3]) * share[match[2]],
        )
    fit = np.array(
        [
            [scales[0], 0.0, slack[0] - scales[0] * box[0]],
            [0.0, scales[1], slack[1] - scales[1] * box[1]],
        ]
    )
    return replace(state, matrix=_after(shifted, fit), viewport=Viewport(box[2], box[3]))
