"""Write workpieces.geojson and stars.geojson beside this script.

    python models/generate.py

Workpieces are parts as one finds them in a workshop, in millimetres. Stars are random
star-shaped polygons of as many edges as the test objects in the literature on regrasp planning
have; the seed makes them reproducible.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

Ring: TypeAlias = list[tuple[float, float]]

SEED = 1
STAR_EDGES = (15, 25, 40)


def regular(n: int, radius: float, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> Ring:
    """Return a regular n-gon, counter-clockwise; `turn` is the angle of its first corner."""
    angles = [turn + 2 * math.pi * k / n for k in range(n)]
    return [
        (round(x + radius * math.cos(a), 6) + 0.0, round(y + radius * math.sin(a), 6) + 0.0)
        for a in angles
    ]


def feature(name: str, rings: list[Ring], units: str, note: str) -> dict[str, Any]:
    """Return a GeoJSON feature, its rings closed, the outline counter-clockwise."""
    oriented = [rings[0], *(hole[::-1] for hole in rings[1:])]
    return {
        "type": "Feature",
        "properties": {"name": name, "units": units, "note": note},
        "geometry": {"type": "Polygon", "coordinates": [[*ring, ring[0]] for ring in oriented]},
    }


def workpieces() -> list[dict[str, Any]]:
    """Return the hand-designed parts."""
    rectangle: Ring = [(0, 0), (60, 0), (60, 30), (0, 30)]
    l_bracket: Ring = [(0, 0), (80, 0), (80, 20), (20, 20), (20, 60), (0, 60)]
    t_block: Ring = [(25, 0), (45, 0), (45, 40), (70, 40), (70, 60), (0, 60), (0, 40), (25, 40)]
    u_channel: Ring = [(0, 0), (50, 0), (50, 40), (44, 40), (44, 6), (6, 6), (6, 40), (0, 40)]
    plate: Ring = [(0, 0), (100, 0), (100, 50), (0, 50)]
    push_t: Ring = [
        (45, 0), (75, 0), (75, 90), (120, 90), (120, 120), (0, 120), (0, 90), (45, 90)
    ]  # fmt: skip
    wedge: Ring = [(0, 0), (40, 0), (40, 30)]
    holes = [regular(16, 8, x, 25) for x in (25, 75)]
    # 18 mm across flats is 18 / sqrt(3) from the centre to a corner
    nut = [regular(6, 18 / math.sqrt(3)), regular(12, 5.2, turn=math.pi / 12)]
    parts: list[tuple[str, list[Ring], str]] = [
        ("rectangle", [rectangle], "bar stock, 60 x 30"),
        ("l_bracket", [l_bracket], "angle bracket, legs 80 and 60, 20 wide"),
        ("t_block", [t_block], "T block, head 70 x 20 on a stem 20 x 40"),
        ("u_channel", [u_channel], "U channel 50 x 40, wall 6"),
        ("two_hole_plate", [plate, *holes], "plate 100 x 50, two 16 mm holes as 16-gons"),
        ("hex_nut", nut, "M12 nut, 18 across flats, bore of 10.4 (before threading) as a 12-gon"),
        ("push_t", [push_t], "the T of the Push-T benchmark: bar 120 x 30 on a stem 30 x 90"),
        ("wedge", [wedge], "right-angled wedge, sides 40, 30 and 50"),
    ]
    return [feature(name, rings, "mm", note) for name, rings, note in parts]


def star(n: int, rng: np.random.Generator) -> Ring:
    """Return n vertices around the origin at random sorted angles, radii in [0.35, 1]."""
    angles = np.sort(rng.uniform(0.0, 2 * np.pi, n))
    radii = rng.uniform(0.35, 1.0, n)
    points = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    return [(x, y) for x, y in np.round(points, 6).tolist()]


def stars() -> list[dict[str, Any]]:
    """Return one star of each size in `STAR_EDGES`."""
    rng = np.random.default_rng(SEED)
    note = f"random star-shaped polygon, seed {SEED}, coordinates rounded to 6 decimals"
    return [feature(f"star_{n}", [star(n, rng)], "arbitrary", note) for n in STAR_EDGES]


def collection(features: list[dict[str, Any]]) -> str:
    """Return the text of a FeatureCollection, one feature a line."""
    lines = ",\n".join(json.dumps(f) for f in features)
    return f'{{"type": "FeatureCollection", "features": [\n{lines}\n]}}\n'


def main() -> None:
    """Write both files."""
    folder = Path(__file__).parent
    (folder / "workpieces.geojson").write_text(collection(workpieces()), encoding="utf-8")
    (folder / "stars.geojson").write_text(collection(stars()), encoding="utf-8")


if __name__ == "__main__":
    main()
