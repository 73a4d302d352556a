"""Polygons for tests: random ones by seed, lattice ones with exact degeneracies, odd shapes."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from regrasp_lp.friction import Cones
from regrasp_lp.polygon import Polygon

Exact = tuple[Fraction, Fraction]


def star(n: int, seed: int) -> Polygon:
    """Star-shaped about the origin, one vertex a sector, radii between 0.35 and 1."""
    rng = np.random.default_rng([n, seed])
    angles = 2 * np.pi * (np.arange(n) + rng.uniform(-0.15, 0.15, n)) / n
    radii = rng.uniform(0.35, 1.0, n)
    return Polygon(np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1))


def regular(n: int) -> Polygon:
    angles = 2 * np.pi * (np.arange(n) + 0.5) / n
    return Polygon(np.stack([np.cos(angles), np.sin(angles)], axis=1))


def rectangle(width: float = 4, height: float = 2) -> Polygon:
    return Polygon([(0, 0), (width, 0), (width, height), (0, height)])


def unit_square() -> Polygon:
    return rectangle(1, 1)


def right_triangle() -> Polygon:
    return Polygon([(0, 0), (4, 0), (0, 4)])


def ell() -> Polygon:
    return Polygon([(0, 0), (4, 0), (4, 2), (2, 2), (2, 4), (0, 4)])


def you() -> Polygon:
    return Polygon([(0, 0), (6, 0), (6, 4), (4, 4), (4, 2), (2, 2), (2, 4), (0, 4)])


def comb(teeth: int = 3) -> Polygon:
    points = [(0, 0), (2 * teeth, 0)]
    for t in range(teeth - 1, -1, -1):
        points += [(2 * t + 2, 3), (2 * t + 1, 3), (2 * t + 1, 1), (2 * t, 1)]
    return Polygon(points)


def diamond() -> Polygon:
    return Polygon([(2, 0), (4, 2), (2, 4), (0, 2)])


def hexagon() -> Polygon:
    """Integer coordinates, three pairs of opposite edges, four of them at 45 degrees."""
    return Polygon([(1, 0), (3, 0), (4, 1), (4, 3), (3, 4), (1, 4), (0, 3), (0, 1)])


def needle() -> Polygon:
    return Polygon([(0, 0), (1000, 0), (1000, 0.001)])


def thin() -> Polygon:
    """A quadrilateral of aspect ratio 1e6 with nearly parallel long sides."""
    return Polygon([(0, 0), (1, 0), (1, 1e-6), (0.25, 1.5e-6)])


def with_collinear_runs() -> Polygon:
    """A rectangle two sides of which are cut into collinear edges."""
    return Polygon([(0, 0), (1, 0), (3, 0), (4, 0), (4, 2), (2, 2), (0, 2)])


def with_hole() -> Polygon:
    return Polygon(
        [(0, 0), (4, 0), (4, 4), (0, 4)], holes=[[(1, 1), (1, 2), (2, 2), (2, 1)]], name="frame"
    )


def nearly_parallel() -> Polygon:
    """Opposite sides off parallel by one unit in the last place of a coordinate."""
    return Polygon([(0, 0), (1, 0), (np.nextafter(1.0, 2), 1), (0, np.nextafter(1.0, 0))])


def staircase(seed: int, steps: int = 4) -> Polygon:
    """Rectilinear with small integer coordinates: a skyline of random heights."""
    rng = np.random.default_rng(seed)
    heights = [int(rng.integers(1, 4))]
    while len(heights) < steps:
        height = int(rng.integers(1, 5))
        if height != heights[-1]:
            heights.append(height)
    points = [(0, 0), (steps, 0)]
    for x in range(steps - 1, -1, -1):
        points += [(x + 1, heights[x]), (x, heights[x])]
    return Polygon(points)


def lattice_star(n: int, seed: int, size: int = 4) -> Polygon:
    """Vertices on a small integer grid, in angular order: parallel edges are common."""
    rng = np.random.default_rng([7, n, seed])
    grid = [(x, y) for x in range(-size, size + 1) for y in range(-size, size + 1) if x or y]
    while True:
        chosen = [grid[i] for i in rng.choice(len(grid), n, replace=False)]
        angles = [np.arctan2(y, x) for x, y in chosen]
        order = np.argsort(angles)
        gaps = np.diff([*np.array(angles)[order], np.array(angles)[order[0]] + 2 * np.pi])
        if gaps.min() > 1e-9 and gaps.max() < np.pi - 1e-9:
            return Polygon([chosen[i] for i in order])


LATTICE = {
    "square": unit_square(),
    "rectangle": rectangle(),
    "triangle": right_triangle(),
    "diamond": diamond(),
    "hexagon": hexagon(),
    "ell": ell(),
    "you": you(),
    "comb": comb(2),
    "collinear": with_collinear_runs(),
    "frame": with_hole(),
    "staircase": staircase(1, 3),
    "lattice_star": lattice_star(6, 1),
}
"""Integer coordinates: exact zeros, parallel and collinear edges, equal normals."""

GENERAL = {
    "star7": star(7, 0),
    "star9": star(9, 1),
    "regular5": regular(5),
    "regular6": regular(6),
    "regular7": regular(7),
    "needle": needle(),
    "thin": thin(),
    "nearly_parallel": nearly_parallel(),
}


def exact_ray(cones: Cones, ray: int) -> Exact:
    """The boundary ray ``rot90(T) ± μ T`` from the doubles, in rational numbers."""
    a, b = cones.starts[ray // 2].tolist(), cones.ends[ray // 2].tolist()
    tx, ty = (Fraction(q) - Fraction(p) for p, q in zip(a, b, strict=True))
    mu = Fraction(float(cones.friction[ray // 2])) * (1 if ray % 2 == 0 else -1)
    return -ty + mu * tx, tx + mu * ty


def exact_point(cones: Cones, edge: int, fraction: Fraction) -> Exact:
    """The point of an edge at a rational fraction of it."""
    a, b = cones.starts[edge].tolist(), cones.ends[edge].tolist()
    x, y = (Fraction(p) + fraction * (Fraction(q) - Fraction(p)) for p, q in zip(a, b, strict=True))
    return x, y


def cross(p: Exact, q: Exact) -> Fraction:
    return p[0] * q[1] - p[1] * q[0]


def dot(p: Exact, q: Exact) -> Fraction:
    return p[0] * q[0] + p[1] * q[1]


def minus(p: Exact, q: Exact) -> Exact:
    return p[0] - q[0], p[1] - q[1]


def sign(value: Fraction | int) -> int:
    return (value > 0) - (value < 0)
