"""Letters and digits of DejaVu Sans, the font that matplotlib brings along."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.font_manager import FontProperties
from matplotlib.path import Path as Outline
from matplotlib.textpath import TextPath

from generators.geometry import Part, Point, Ring, point

Floats = npt.NDArray[np.float64]

CHARACTERS = "ABDEGHKLMNRSTUVXYZ03458"
FONT = Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")
UNITS = 2048
"""Font units in an em."""
SCALE = 50 / 1493
"""Millimetres in a font unit: capitals are 1493 units high."""
CHORDS = 2
"""Straight segments that take the place of one of the font's curves."""


def letters() -> list[Part]:
    """Return the characters, in millimetres."""
    return [
        Part(
            f"{'digit' if character.isdigit() else 'letter'}_{character}",
            rings(character),
            f"{character} of DejaVu Sans, capitals 50 high, curves as {CHORDS} chords each; "
            "licence in README.md",
        )
        for character in CHARACTERS
    ]


def rings(character: str) -> list[Ring]:
    """Return the outline of a character and its holes, all counter-clockwise."""
    outline = TextPath((0, 0), character, size=UNITS, prop=FontProperties(fname=FONT))
    found: list[Ring] = []
    for corners, code in outline.iter_segments(simplify=False):
        # the font's own coordinates, in which a middle between two points is half an integer
        ends = np.round(2 * corners.reshape(-1, 2)) / 2 * SCALE
        if code == Outline.MOVETO:
            found.append([point(*ends[0])])
        elif code == Outline.LINETO:
            found[-1].append(point(*ends[0]))
        elif code == Outline.CURVE3:
            found[-1] += _chords(found[-1][-1], *ends)
    found = [ring[:-1] if ring[0] == ring[-1] else ring for ring in found]
    return sorted((ring if _area(ring) > 0 else ring[::-1] for ring in found), key=_area)[::-1]


def _chords(start: Point, control: Floats, end: Floats) -> Ring:
    """Return points of a quadratic Bézier curve, all but the first."""
    t = np.linspace(0, 1, CHORDS + 1)[1:, None]
    curve = (1 - t) ** 2 * np.array(start) + 2 * t * (1 - t) * control + t**2 * end
    return [point(*p) for p in curve.tolist()]


def _area(ring: Ring) -> float:
    """Twice the area: positive if the ring is counter-clockwise."""
    x, y = np.transpose(ring)
    return float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
