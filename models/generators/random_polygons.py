"""Random polygons of given numbers of edges: star-shaped or not, or rectilinear."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from generators.geometry import Part, Ring, point

Floats = npt.NDArray[np.float64]

SEED = 1
EVEN_SEED = 75
CONCAVE_SEED = 39
STAR_EDGES = (15, 25, 40)
EVEN_STAR_EDGES = (20, 30, 35, 100)
CONCAVE_EDGES = (15, 20, 25, 30, 35, 40, 100)
RECTILINEAR_EDGES = (12, 24, 40)


def stars() -> list[Part]:
    """Return one star of each size in `STAR_EDGES`."""
    rng = np.random.default_rng(SEED)
    note = f"random star-shaped polygon, seed {SEED}, coordinates rounded to 6 decimals"
    return [Part(f"star_{n}", [_star(n, rng)], note) for n in STAR_EDGES]


def even_stars() -> list[Part]:
    """Return one star without needles of each size in `EVEN_STAR_EDGES`."""
    rng = np.random.default_rng(EVEN_SEED)
    note = f"random star-shaped polygon without needles, seed {EVEN_SEED}"
    return [Part(f"star_{n}", [_even_star(n, rng)], note) for n in EVEN_STAR_EDGES]


def _star(n: int, rng: np.random.Generator) -> Ring:
    """Return n vertices around the origin at random sorted angles, radii in [0.35, 1]."""
    angles = np.sort(rng.uniform(0.0, 2 * np.pi, n))
    return _around(angles, rng.uniform(0.35, 1.0, n))


def _even_star(n: int, rng: np.random.Generator) -> Ring:
    """Return n vertices around the origin, one in each nth of a turn, so that none is a needle.

    They are on a curve of three lobes or inside it, by a share of their radius that is at most
    twice the angle between two of them.
    """
    step = 2 * np.pi / n
    angles = step * (np.arange(n) + rng.uniform(-0.25, 0.25, n))
    lobes = 0.75 + 0.25 * np.cos(3 * angles)
    return _around(angles, lobes * (1 - rng.uniform(0.0, min(0.6, 2 * step), n)))


def _around(angles: Floats, radii: Floats) -> Ring:
    points = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    return [point(x, y) for x, y in points.tolist()]


def concave() -> list[Part]:
    """Return one polygon of each size in `CONCAVE_EDGES`; none is star-shaped."""
    rng = np.random.default_rng(CONCAVE_SEED)
    note = f"random polygon that is not star-shaped, seed {CONCAVE_SEED}, grown corner by corner"
    return [Part(f"concave_{n}", [_grown(n, rng)], note) for n in CONCAVE_EDGES]


def _grown(n: int, rng: np.random.Generator) -> Ring:
    """Return a polygon grown from a triangle by pulling new corners out of its edges, or in.

    Long edges are more likely to get a corner, and each gets it where there is room.
    """
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (0.5, 0.9)])
    while len(corners) < n:
        edges = np.roll(corners, -1, axis=0) - corners
        lengths = np.hypot(*edges.T)
        k = rng.choice(len(corners), p=lengths / lengths.sum())
        across = np.array([-edges[k, 1], edges[k, 0]]) * rng.choice([-1, 1])
        pulled = corners[k] + rng.uniform(0.2, 0.8) * edges[k] + rng.uniform(0.3, 1.0) * across
        grown = np.insert(corners, k + 1, pulled, axis=0)
        if _is_roomy(grown, 0.2):
            corners = grown
    corners -= (corners.min(axis=0) + corners.max(axis=0)) / 2
    return [point(x, y) for x, y in (corners / np.abs(corners).max()).tolist()]


def random_rectilinear() -> list[Part]:
    """Return one polygon with horizontal and vertical edges of each size."""
    rng = np.random.default_rng(SEED)
    note = f"random rectilinear polygon, seed {SEED}, integer coordinates"
    return [Part(f"rectilinear_{n}", [_battered(n, rng)], note) for n in RECTILINEAR_EDGES]


def _battered(n: int, rng: np.random.Generator) -> Ring:
    """Return a square of side 12 with bumps and dents, in which others may be; 4 corners each."""
    corners = np.array([(0, 0), (12, 0), (12, 12), (0, 12)])
    while len(corners) < n:
        k = rng.integers(len(corners))
        start, end = corners[k], corners[(k + 1) % len(corners)]
        length = np.abs(end - start).sum()
        if length < 3:
            continue
        along = (end - start) // length
        across = np.array([-along[1], along[0]]) * rng.choice([-4, -3, -2, -1, 1, 2, 3, 4])
        first, last = np.sort(rng.choice(np.arange(1, length), 2, replace=False))[:, None] * along
        bump = start + np.array([first, first + across, last + across, last])
        battered = np.insert(corners, k + 1, bump, axis=0)
        if _is_roomy(battered, 1):
            corners = battered
    return [(x, y) for x, y in corners.tolist()]


def _is_roomy(corners: Floats, room: float) -> bool:
    """Whether no edges cross and all corners are that far from the edges that they do not end."""
    n = np.arange(len(corners))
    edges = np.roll(corners, -1, axis=0) - corners
    # corner i as seen from the start of edge j
    x, y = np.moveaxis(corners[:, None] - corners, -1, 0)
    nearest = np.clip((x * edges[:, 0] + y * edges[:, 1]) / (edges**2).sum(axis=1), 0, 1)
    distances = np.hypot(x - nearest * edges[:, 0], y - nearest * edges[:, 1])
    distances[n, n] = distances[n, n - 1] = np.inf
    left = edges[:, 0] * y - edges[:, 1] * x > 0
    apart = left != np.roll(left, -1, axis=0)  # the ends of edge i, by the line through edge j
    apart[n, n] = apart[n, n - 1] = apart[n - 1, n] = False
    return bool(distances.min() >= room and not (apart & apart.T).any())
