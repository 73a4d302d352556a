"""What is seen of a cone from its apex: the same as segments that stay in the object."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from conftest import REPOSITORY
from matplotlib.path import Path

from regrasp_lp import Polygon, read_polygons
from regrasp_lp.friction import Cones
from regrasp_lp.plotting.sight import visible_part

SQUARE = Polygon([(0, 0), (4, 0), (4, 4), (0, 4)])
HOLED = Polygon(SQUARE.exterior, holes=[[(1, 1), (1, 3), (3, 3), (3, 1)]])


@pytest.fixture(scope="module")
def models() -> dict[str, Polygon]:
    files = ("machine_parts", "letters", "stars")
    found = [read_polygons(REPOSITORY / "models" / f"{name}.geojson") for name in files]
    return {polygon.name: polygon for polygons in found for polygon in polygons}


def cone(polygon: Polygon, edge: int, friction: float) -> np.ndarray:
    return Cones.of(polygon, friction).unit_rays[[2 * edge, 2 * edge + 1]]


@pytest.mark.parametrize("which", ["gusset", "letter_A", "letter_B", "star_15", "gear_m1_z16"])
def test_seen_is_what_a_segment_in_the_object_reaches(which, models):
    polygon = models[which]
    area = shapely.Polygon(polygon.rings[0], polygon.rings[1:])
    size, rng = polygon.diameter, np.random.default_rng(4)
    low, high = polygon.bounds[:2], polygon.bounds[2:]
    for edge in rng.choice(polygon.n_edges, min(polygon.n_edges, 12), replace=False).tolist():
        apex = polygon.points(edge, rng.uniform(0.05, 0.95))
        friction = float(rng.uniform(0.1, 1.5))
        right, left = rays = cone(polygon, edge, friction)
        ring = visible_part(polygon, apex, rays)
        points = np.concatenate(
            (
                rng.uniform(low, high, (300, 2)),
                apex + rng.uniform(0, 0.2 * size, (100, 1)) * rng.uniform(0, 1, (100, 2)) @ rays,
            )
        )
        offset = points - apex
        turned = [r[0] * offset[:, 1] - r[1] * offset[:, 0] for r in (right, left)]
        in_cone = (turned[0] > 0) & (turned[1] < 0)
        lines = shapely.linestrings(np.stack((apex + 1e-9 * offset, points), axis=1))
        expected = in_cone & shapely.covers(area.buffer(1e-7 * size), lines)
        seen = Path(np.vstack((ring, apex))).contains_points(points)
        unsure = shapely.distance(shapely.points(points), shapely.LinearRing(ring)) < 1e-6 * size
        assert (seen | unsure == expected | unsure).all()
        assert seen.any()
        assert area.buffer(1e-7 * size).covers(shapely.Polygon(ring))


def test_behind_a_hole_there_is_nothing():
    ring = visible_part(HOLED, np.array([2.0, 0.0]), cone(HOLED, 0, 0.5))
    assert ring[:, 1].max() == pytest.approx(1.0)
    beside = visible_part(HOLED, np.array([0.5, 0.0]), cone(HOLED, 0, 0.1))
    assert beside[:, 1].max() == pytest.approx(4.0)


def test_a_cone_past_a_corner_of_the_hole():
    ring = visible_part(HOLED, np.array([0.5, 0.0]), cone(HOLED, 0, 0.9))
    expected = [(0.5, 0), (1.4, 1), (1, 1), (1, 3), (7 / 6, 4), (0, 4), (0, 5 / 9)]
    assert shapely.Polygon(ring).symmetric_difference(shapely.Polygon(expected)).area < 1e-9


def test_at_a_vertex():
    inside = visible_part(SQUARE, np.array([0.0, 0.0]), cone(SQUARE, 0, 0.5))
    assert inside[-1].tolist() == [0, 0]  # half of the cone is beside the square
    assert shapely.Polygon(inside).area == pytest.approx(4.0)
    wedge = Polygon([(0, 0), (4, 0), (8, 4)])
    outside = visible_part(wedge, np.array([4.0, 0.0]), cone(wedge, 0, 0.2))
    assert shapely.Polygon(outside).area > 0
    nothing = visible_part(wedge, np.array([0.0, 0.0]), cone(wedge, 0, 0.2))
    assert (nothing == 0).all()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_scales(scale):
    apex = np.array([0.7, 0.0])
    whole = visible_part(HOLED, apex, cone(HOLED, 0, 0.6))
    scaled = Polygon(HOLED.exterior * scale, holes=[h * scale for h in HOLED.holes])
    seen = visible_part(scaled, apex * scale, cone(scaled, 0, 0.6))
    assert seen == pytest.approx(whole * scale, abs=1e-8 * scale)
