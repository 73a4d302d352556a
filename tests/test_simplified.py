"""Polygons of fewer vertices: within the tolerance, simple, of the same shape."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from conftest import star_polygon
from hypothesis import given
from hypothesis import strategies as st

import regrasp_lp as rl


def chains(polygon: rl.Polygon, simpler: rl.Polygon) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each edge of the simpler polygon, its ends and the vertices it stands for, all in order.

    Fails unless each ring of the one is, vertex by vertex, a part of that of the other, and begins
    with the same.
    """
    found = []
    assert len(simpler.rings) == len(polygon.rings)
    for ring, fewer in zip(polygon.rings, simpler.rings, strict=True):
        assert (ring[0] == fewer[0]).all()
        index = {tuple(point): k for k, point in enumerate(ring.tolist())}
        places = [index[tuple(point)] for point in fewer.tolist()]
        assert places == sorted(places)
        for a, b in zip(places, [*places[1:], len(ring)], strict=True):
            found.append((ring[[a, b % len(ring)]], ring[a:b]))
    return found


def check(polygon: rl.Polygon, tolerance: float) -> rl.Polygon:
    """Every law of `Polygon.simplified`."""
    simpler = polygon.simplified(tolerance)
    assert simpler.name == polygon.name
    slack = 1e-14 * float(np.abs(polygon.bounds).max())
    for ends, between in chains(polygon, simpler):
        line = shapely.LineString(ends)
        assert shapely.distance(line, shapely.points(between)).max() <= tolerance + slack
    assert simpler == polygon.simplified(tolerance)
    return simpler


@given(st.integers(4, 40), st.integers(0, 10**6), st.floats(0, 1))
def test_random_stars(n: int, seed: int, tolerance: float) -> None:
    polygon = star_polygon(n, seed)
    simpler = check(polygon, tolerance)
    boundary, other = (shapely.LinearRing(p.exterior) for p in (polygon, simpler))
    distance = shapely.hausdorff_distance(boundary, other, densify=0.05)
    assert distance <= tolerance + 1e-12


def test_the_corpus(corpus: list[rl.Polygon]) -> None:
    kept = np.zeros(2, dtype=int)
    for polygon in corpus[::6]:
        for share in (1e-3, 0.03, 0.3):
            simpler = check(polygon, share * polygon.diameter)
            kept += simpler.n_edges, polygon.n_edges
    assert kept[0] < kept[1] / 2


def test_smooth_outlines_lose_most_vertices() -> None:
    t = 2 * np.pi * np.arange(1000) / 1000
    circle = rl.Polygon(np.stack([np.cos(t), np.sin(t)], axis=1))
    simpler = check(circle, 1e-3)
    # as few as chords of that height have, within the factor of two of always halving
    fewest = math.pi / math.acos(1 - 1e-3)
    assert fewest <= simpler.n_edges <= 2 * fewest


def test_no_tolerance_removes_only_what_lies_on_a_line() -> None:
    wedge = rl.Polygon([(0, 0), (1, 0), (4, 0), (4, 1), (4, 3), (2, 1.5)])
    assert check(wedge, 0).vertices.tolist() == [[0, 0], [4, 0], [4, 3]]
    star = star_polygon(20, 3)
    assert check(star, 0).n_edges == 20


def test_three_vertices_stay_whatever_the_tolerance(corpus: list[rl.Polygon]) -> None:
    for polygon in corpus[::25]:
        assert all(len(ring) >= 3 for ring in check(polygon, 1e6).rings)


def test_edges_that_would_cross_keep_their_vertices() -> None:
    # a thin hook around a spike: each alone would be cut through by the other
    teeth = [(k, 0.9 * (k % 2)) for k in range(11)]
    gap = 0.05
    upper = [(x, y + gap) for x, y in reversed(teeth)]
    zigzag = rl.Polygon([*teeth, (12, 0), (12, 5), (-2, 5), (-2, 0)])
    assert check(zigzag, 1.0).n_edges < zigzag.n_edges
    band = rl.Polygon([*teeth, *upper])
    assert check(band, 0.3).n_edges > 4
    slit = rl.Polygon([(-2, -3), (12, -3), (12, 3), (-2, 3)], [[*teeth, *upper]])
    check(slit, 0.6)


def test_holes_stay_where_they_are() -> None:
    # without the hole the bay would be filled
    bay = [(0, 0), (10, 0), (10, 4), (6, 4), (5, 5), (4, 4), (0, 4)]
    hole = [(4.8, 4.2), (5, 4.6), (5.2, 4.2)]
    assert check(rl.Polygon(bay), 1.5).n_edges == 4
    holed = check(rl.Polygon(bay, [hole]), 1.5)
    assert (holed.vertices == [5, 5]).all(axis=1).any()


@pytest.mark.parametrize("tolerance", [-1, math.nan, math.inf, "1", True, None])
def test_bad_tolerances(tolerance: object) -> None:
    with pytest.raises(rl.OptionError, match="the tolerance has to be a length"):
        rl.Polygon([(0, 0), (1, 0), (0, 1)]).simplified(tolerance)  # type: ignore[arg-type]
