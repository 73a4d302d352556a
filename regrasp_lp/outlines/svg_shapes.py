"""The shapes and paths of SVG as curves, in the coordinates of their element."""

from __future__ import annotations

import cmath
import math
import re
import warnings
from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from regrasp_lp.errors import FileFormatError
from regrasp_lp.outlines.curves import Bezier, Curve, EllipticArc, polyline
from regrasp_lp.outlines.svg_elements import Element, short

__all__ = ["SHAPES", "Viewport", "elliptic_arc", "numbers_in"]

_Floats: TypeAlias = npt.NDArray[np.float64]

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"


_THINNEST = 1e-100
"""Least radius of an arc, relative to its chord: with less, lengths run out of range."""


class Viewport(NamedTuple):
    """What percentages refer to; None where nothing says it."""

    width: float | None
    height: float | None

    @property
    def diagonal(self) -> float | None:
        """What percentages of a radius refer to, sqrt((w² + h²) / 2)."""
        if self.width is None or self.height is None:
            return None
        return math.hypot(self.width, self.height) / math.sqrt(2)


def numbers_in(text: str, element: Element, name: str) -> list[float]:
    """Numbers separated by white space and commas."""
    found = [float(number) for number in re.findall(_NUMBER, text)]
    if re.sub(_NUMBER, "", text).strip(" \t\r\n\f\v,") or not all(map(math.isfinite, found)):
        raise FileFormatError(f"{element}: {name}={short(text)} is no list of numbers")
    return found


_Read: TypeAlias = Iterator[tuple[list[Curve], bool]]
"""Subpaths: curves in the coordinates of the element, and whether a segment closes them."""


def _ellipse(element: Element, view: Viewport) -> _Read:
    center = np.array([element.length("cx", view.width), element.length("cy", view.height)])
    if element.tag == "circle":
        rx = ry = element.length("r", view.diagonal)
    else:
        rx, ry = _radii(element, view)
    if rx > 0 and ry > 0:
        u, v = np.array([rx, 0.0]), np.array([0.0, ry])
        yield [EllipticArc(center, u, v, 0.0, 2 * math.pi)], True


def _radii(element: Element, view: Viewport) -> tuple[float, float]:
    """Both radii; one that is not given is as large as the other."""
    given = {n for n in ("rx", "ry") if element.attributes.get(n, "auto").strip() != "auto"}
    rx = element.length("rx", view.width) if "rx" in given else None
    ry = element.length("ry", view.height) if "ry" in given else rx
    return (rx if rx is not None else ry or 0.0), ry or 0.0


def _rectangle(element: Element, view: Viewport) -> _Read:
    x, y = element.length("x", view.width), element.length("y", view.height)
    w, h = element.length("width", view.width), element.length("height", view.height)
    if not (w > 0 and h > 0):
        return
    rx, ry = (min(r, side / 2) for r, side in zip(_radii(element, view), (w, h), strict=True))
    corners = np.array([(x + w, y), (x + w, y + h), (x, y + h), (x, y)])
    if rx <= 0 or ry <= 0:
        yield polyline(corners), True
        return
    curves: list[Curve] = []
    inward = np.array([(-rx, ry), (-rx, -ry), (rx, -ry), (rx, ry)])
    last = corners[3] + (rx, 0.0)
    for k, (corner, into) in enumerate(zip(corners, inward, strict=True)):
        first, then = corner + into * (k % 2 == 0, k % 2), corner + into * (k % 2, k % 2 == 0)
        axes = np.array([rx, 0.0]), np.array([0.0, ry])
        ends = np.stack([first, then])
        if (last != first).any():
            curves.append(Bezier(np.stack([last, first])))
        curves.append(EllipticArc(corner + into, *axes, (k - 1) * math.pi / 2, math.pi / 2, ends))
        last = then
    yield curves, True


def _line(element: Element, view: Viewport) -> _Read:
    points = [
        [element.length(f"x{k}", view.width), element.length(f"y{k}", view.height)] for k in (1, 2)
    ]
    yield polyline(points), False


def _polygon(element: Element, view: Viewport) -> _Read:
    numbers = numbers_in(element.attributes.get("points", ""), element, "points")
    if len(numbers) % 2:
        raise FileFormatError(f"{element} has an odd number of coordinates in its points")
    if len(numbers) > 2:
        yield polyline(np.array(numbers).reshape(-1, 2)), element.tag == "polygon"


def _path(element: Element, view: Viewport) -> _Read:
    """Subpaths of path data: split where one begins, after a Z or with an M."""
    from svgpathtools import parse_path

    data = element.attributes.get("d", "").strip()
    if data == "none":
        return
    if not re.fullmatch(r"[MmZzLlHhVvCcSsQqTtAa\d.,eE+\-\s]*", data) or data[:1] not in (
        "",
        "M",
        "m",
    ):
        raise FileFormatError(f"{element}: its path data {short(data)} cannot be read")
    start = 0j
    for move, rest, close in re.findall(r"([Mm]?)([^MmZz]*)([Zz]?)", data):
        if not (move or rest.strip(" \t\r\n,")):
            continue
        # h0 shows where the subpath ends, should it be only a move
        piece = f"{move or 'm0,0'}{rest} h0"
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # arcs of no radius are segments, as SVG says
                segments = list(parse_path(piece, current_pos=start))
            curves = [_segment(segment) for segment in segments[:-1]]
        except (ValueError, IndexError, AssertionError, ArithmeticError) as error:
            reason = str(error) or "an arc ends where it starts"
            raise FileFormatError(
                f"{element}: its path data {short(move + rest + close)} cannot be read: {reason}"
            ) from error
        start = segments[0].start if close else segments[-1].end
        if curves:
            yield curves, bool(close)


def _segment(segment: Any) -> Curve:
    """A segment of svgpathtools, whose points are complex numbers."""
    if hasattr(segment, "bpoints"):
        return Bezier(np.array([(p.real, p.imag) for p in segment.bpoints()]))
    across = abs(segment.end - segment.start)
    radii = segment.radius.real, segment.radius.imag
    if not (min(radii) > _THINNEST * across and cmath.isfinite(segment.radius)):
        raise ValueError("the radii of an arc are too small for the distance of its ends")
    return elliptic_arc(
        segment.start,
        segment.radius,
        math.radians(segment.rotation),
        segment.large_arc,
        segment.sweep,
        segment.end,
    )


def elliptic_arc(
    start: complex, radius: complex, rotation: float, large: bool, sweep: bool, end: complex
) -> EllipticArc:
    """Return the arc of SVG's path command A, by its centre.

    In coordinates in which the ellipse is the unit circle, a is half the chord, from its middle to
    the start; the centre is off the middle by sqrt(1 − |a|²), at a right angle. Radii that are too
    small, |a| > 1, are enlarged to |a| = 1. (svgpathtools has the centre only to a ten-thousandth
    of the radius where the arc is nearly a half circle.)

    Parameters
    ----------
    start, end : complex
    radius : complex
        Both radii, rx + i ry, positive.
    rotation : float
        Angle of the first axis in radians.
    large, sweep : bool
        Whether the arc is more than half a turn, and whether its angle grows.

    Examples
    --------
    >>> arc = elliptic_arc(0j, 1 + 1j, 0.0, False, True, 1 + 1j)
    >>> arc.center.round(12).tolist(), round(arc.sweep, 6)
    ([0.0, 1.0], 1.570796)
    """
    turn = cmath.exp(1j * rotation)
    half = (start - end) / 2 / turn
    a = complex(half.real / radius.real, half.imag / radius.imag)
    if (size := abs(a)) > 1:
        radius, a, size = radius * size, a / size, 1.0
    side = 1 if large != sweep else -1
    off = side * math.sqrt((1 - size) * (1 + size)) / size * -1j * a
    first, last = cmath.phase(a - off), cmath.phase((-a - off) / (a - off))
    if sweep != (last > 0):
        last += 2 * math.pi if sweep else -2 * math.pi
    middle = (start + end) / 2 + complex(off.real * radius.real, off.imag * radius.imag) * turn
    along, across = radius.real * turn, radius.imag * turn * 1j
    center, u, v = (np.array([z.real, z.imag]) for z in (middle, along, across))
    ends = np.array([(p.real, p.imag) for p in (start, end)])
    return EllipticArc(center, u, v, first, last, ends)


SHAPES = {
    "path": _path,
    "rect": _rectangle,
    "circle": _ellipse,
    "ellipse": _ellipse,
    "line": _line,
    "polyline": _polygon,
    "polygon": _polygon,
}
