"""Write the polygons of this folder: a GeoJSON file for each function of `FILES`.

    python models/generate.py [FOLDER]

The files go to the folder of this script if no other is given. The polygons themselves are in
the modules of `generators/`; seeds make the random ones reproducible.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, TypeAlias

from generators import blocks, gears, plates, random_polygons, tools
from generators import letters as characters
from generators import shapes as outlines
from generators.geometry import collection, feature

Features: TypeAlias = list[dict[str, Any]]

HERE = Path(__file__).parent


def workpieces() -> Features:
    """Return the parts that tests and the README speak of."""
    return [feature(part, "mm") for part in blocks.first_parts()]


def machine_parts() -> Features:
    """Return more parts as one finds them in a workshop."""
    kinds = [
        blocks.blocks,
        blocks.brackets,
        blocks.sections,
        plates.plates,
        plates.links,
        plates.nuts_and_washers,
        gears.gears,
        tools.wrenches,
        tools.keys,
        tools.hooks,
    ]
    return [feature(part, "mm") for kind in kinds for part in kind()]


def letters() -> Features:
    """Return letters and digits of a font."""
    return [feature(part, "mm") for part in characters.letters()]


def stars() -> Features:
    """Return star-shaped polygons with corners in random directions."""
    return [feature(part, "arbitrary") for part in random_polygons.stars()]


def even_stars() -> Features:
    """Return star-shaped polygons with corners in directions that are evenly spread."""
    return [feature(part, "arbitrary") for part in random_polygons.even_stars()]


def concave() -> Features:
    """Return polygons that are not star-shaped."""
    return [feature(part, "arbitrary") for part in random_polygons.concave()]


def shapes() -> Features:
    """Return regular, rectilinear and needle-like polygons."""
    kinds = [
        outlines.regular_polygons,
        outlines.rectilinear,
        random_polygons.random_rectilinear,
        outlines.needles,
    ]
    return [feature(part, "arbitrary") for kind in kinds for part in kind()]


FILES = (workpieces, machine_parts, letters, stars, even_stars, concave, shapes)


def main(folder: Path = HERE) -> None:
    """Write all files.

    Parameters
    ----------
    folder : Path, optional
        Where to; the folder of this script if not given.
    """
    for polygons in FILES:
        file = folder / f"{polygons.__name__}.geojson"
        file.write_text(collection(polygons()), encoding="utf-8")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
