"""The polygons that are measured, and random grasps of them."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import numpy as np
from conftest import REPOSITORY, star_polygon

import regrasp_lp as rl

_EXTRA_SEEDS = (1, 2)
_DRAWN = 20_000  # grasps at a time


@cache
def models() -> dict[str, rl.Polygon]:
    """The random polygons of ``models/``, by name."""
    files = ("stars", "even_stars", "concave")
    return {
        polygon.name: polygon
        for file in files
        for polygon in rl.read_polygons(REPOSITORY / "models" / f"{file}.geojson")
    }


def for_ratio(quick: bool) -> list[rl.Polygon]:
    """The polygons on which the peer is met: of 40 and of 100 edges."""
    if quick:
        return [models()["star_15"], models()["concave_15"]]
    found = []
    for n in (40, 100):
        found.append(models()[f"star_{n}"])
        found += [star_polygon(n, seed) for seed in _EXTRA_SEEDS]
        found.append(models()[f"concave_{n}"])
    return found


def for_growth(quick: bool) -> list[rl.Polygon]:
    """Star-shaped polygons of one family, from 15 to 200 edges."""
    sizes = (8, 12) if quick else (15, 25, 40, 60, 80, 100, 140, 200)
    return [star_polygon(n, seed=0) for n in sizes]


def small_objects(quick: bool) -> list[rl.Polygon]:
    """Objects of 8 to 40 edges, on which the whole graph is soon built."""
    if quick:
        return [star_polygon(8, seed=0)]
    names = ("concave_15", "concave_25", "concave_40", "star_15", "star_25", "star_40")
    parts = rl.read_polygons(REPOSITORY / "models" / "workpieces.geojson")
    return [
        star_polygon(8, seed=0),
        *(part for part in parts if 8 <= part.n_edges <= 40),
        *(models()[name] for name in names),
    ]


def large_outlines(quick: bool, least: int = 291) -> list[rl.Polygon]:
    """A generated star of 400 edges, and outlines of so many to 400 edges of the corpus if any."""
    if quick:
        return [star_polygon(20, seed=0)]
    return [star_polygon(400, seed=0), *corpus(least, 400)]


def corpus(least: int, most: int) -> list[rl.Polygon]:
    """The outlines of so many edges of the corpus, by their number of edges; none without it.

    The corpus is in the folder that REGRASP_LP_CORPUS names, by default ``../shared/corpus``.
    """
    default = REPOSITORY.parent / "shared" / "corpus"
    folder = Path(os.environ.get("REGRASP_LP_CORPUS", default))
    found = [
        polygon
        for file in sorted(folder.glob("*.geojson"))
        for polygon in rl.read_polygons(file)
        if least <= polygon.n_edges <= most
    ]
    return sorted(found, key=lambda polygon: polygon.n_edges)


def graphs_to_ask(quick: bool) -> list[rl.Polygon]:
    """Objects whose graphs are built and then asked: two of 40 edges."""
    names = ("star_15",) if quick else ("star_40", "concave_40")
    return [models()[name] for name in names]


def small_outlines(quick: bool) -> list[rl.Polygon]:
    """The outlines of the corpus of up to 64 edges; our own workpieces if there is none."""
    parts = rl.read_polygons(REPOSITORY / "models" / "workpieces.geojson")
    if quick:
        return [part for part in parts if part.n_edges <= 8][:3]
    return corpus(3, 64) or [part for part in parts if part.n_edges <= 64]


def random_grasps(
    polygon: rl.Polygon, friction: float, count: int, rng: np.random.Generator
) -> list[rl.Grasp]:
    """Random grasps in force closure: half of two contacts and half of three, as far as found.

    Edges are drawn by their lengths and positions evenly, until there are enough.
    """
    weights = polygon.edge_lengths / polygon.edge_lengths.sum()
    found = []
    for m, wanted in ((2, count // 2), (3, count - count // 2)):
        kept: list[rl.Grasp] = []
        for _ in range(200):
            if len(kept) >= wanted:
                break
            edges = np.sort(rng.choice(polygon.n_edges, size=(_DRAWN, m), p=weights), axis=1)
            fractions = rng.uniform(0.02, 0.98, (_DRAWN, m))
            held = rl.is_force_closure(polygon, edges=edges, fractions=fractions, friction=friction)
            held &= (np.diff(edges, axis=1) > 0).all(axis=1)
            for row in np.flatnonzero(held)[: wanted - len(kept)]:
                pairs = zip(edges[row].tolist(), fractions[row].tolist(), strict=True)
                kept.append(rl.Grasp.at_fractions(list(pairs)))
        found += kept
    if len(found) < 2:
        raise ValueError(f"{polygon.name}: no two random grasps in force closure were found")
    return [found[i] for i in rng.permutation(len(found))]
