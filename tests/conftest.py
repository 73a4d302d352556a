"""Fixtures and polygons that several test modules use."""

from __future__ import annotations

import os
from collections.abc import Iterable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from regrasp_lp.files import read_polygons
from regrasp_lp.polygon import Polygon

REPOSITORY = Path(__file__).resolve().parent.parent

# a busy machine is no reason to fail, and a failure has to come back when the test is run again
settings.register_profile("regrasp_lp", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("regrasp_lp")


def star_polygon(n: int, seed: int, name: str = "") -> Polygon:
    """Return a random star-shaped polygon of n edges, radii between 0.35 and 1."""
    rng = np.random.default_rng(seed)
    # one angle a sector, within limits that keep every gap below a half turn
    spread = min(0.45, n / 4 - 0.55)
    angles = 2 * np.pi * (np.arange(n) + rng.uniform(-spread, spread, n)) / n
    radii = rng.uniform(0.35, 1.0, n)
    points = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    return Polygon(points, name=name or f"star_{n}_{seed}")


def covering(first: Iterable[object], *others: Iterable[object], least: int = 1) -> list[object]:
    """Return all combinations for `pytest.mark.parametrize`, most of them marked slow.

    Each of the first values is in `least` that are not, and each combination of the others in one.
    """
    mine, theirs = list(first), list(product(*others))
    count = max(len(mine), len(theirs))
    quick = {
        (n % len(mine), (n + step * (len(theirs) // least)) % len(theirs))
        for step in range(least)
        for n in range(count)
    }
    return [
        pytest.param(one, *rest, marks=[] if (i, j) in quick else pytest.mark.slow)
        for (i, one), (j, rest) in product(enumerate(mine), enumerate(theirs))
    ]


@pytest.fixture(scope="session")
def corpus_folder() -> Path:
    """Folder of the polygon corpus: $REGRASP_LP_CORPUS, or ../shared/corpus from the root."""
    default = REPOSITORY.parent / "shared" / "corpus"
    folder = Path(os.environ.get("REGRASP_LP_CORPUS", default))
    if not any(folder.glob("*.geojson")):
        pytest.skip(
            f"polygon corpus not tested: no GeoJSON files in {folder}; set REGRASP_LP_CORPUS to "
            f"the folder that holds them"
        )
    return folder


@pytest.fixture(scope="session")
def corpus(corpus_folder: Path) -> list[Polygon]:
    """All polygons of the corpus, in the order of the file names."""
    return [p for file in sorted(corpus_folder.glob("*.geojson")) for p in read_polygons(file)]


@pytest.fixture(scope="session")
def workpieces() -> dict[str, Polygon]:
    """The hand-designed parts of models/workpieces.geojson, by name."""
    return {p.name: p for p in read_polygons(REPOSITORY / "models" / "workpieces.geojson")}


@pytest.fixture(scope="session")
def stars() -> dict[str, Polygon]:
    """The random polygons of models/stars.geojson, by name."""
    return {p.name: p for p in read_polygons(REPOSITORY / "models" / "stars.geojson")}
