"""The object as the peer sees it: edges, normals, cones by angles; and pairs of equal labels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.polygon import Polygon

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Bools = NDArray[np.bool_]
Geometries = NDArray[np.object_]


@dataclass(frozen=True)
class Outline:
    """Edges with unit directions, angles of their inner normals, friction cones' boundary rays."""

    starts: Floats
    ends: Floats
    lengths: Floats
    along: Floats
    angles: Floats
    theta: float
    size: float

    @classmethod
    def of(cls, polygon: Polygon, theta: float) -> Outline:
        low = polygon.edge_starts.min(axis=0)
        starts, ends = polygon.edge_starts - low, polygon.edge_ends - low
        lengths = np.hypot(*(ends - starts).T)
        along = (ends - starts) / lengths[:, None]
        angles = np.arctan2(along[:, 0], -along[:, 1]) % (2 * np.pi)
        return cls(starts, ends, lengths, along, angles, theta, float(starts.max()))

    @property
    def n(self) -> int:
        return len(self.starts)

    def ahead(self, one: Ints, other: Ints) -> Floats:
        """By how much the normal of `other` is ahead of that of `one`, from 0 to 2π."""
        return np.asarray((self.angles[other] - self.angles[one]) % (2 * np.pi))


def direction(angle: Floats) -> Floats:
    return np.stack((np.cos(angle), np.sin(angle)), axis=-1)


def cross(p: Floats, q: Floats) -> Floats:
    return np.asarray(p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0])


def runs(starts: Ints, counts: Ints) -> Ints:
    """``start, start + 1, …`` of `counts` numbers each, one after the other."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if ends.size else 0
    return np.arange(total) + (starts - ends + counts).repeat(counts)


def common_cone(outline: Outline, centers: Ints, sides: Ints) -> tuple[Floats, Floats]:
    """Boundary rays of ``−C_a ∩ C_b ∩ …`` of centres a, shape (N,), and others, shape (N, k)."""
    turned = outline.ahead(centers[:, None], sides) - np.pi
    right = np.maximum(turned.max(axis=1), 0.0) - outline.theta
    left = np.minimum(turned.min(axis=1), 0.0) + outline.theta
    opposite = outline.angles[centers] + np.pi
    return direction(opposite + right), direction(opposite + left)


def groups(labels: Ints) -> tuple[Ints, Ints]:
    """All pairs of places with equal labels, the first before the second."""
    order = np.argsort(labels, kind="stable")
    ranked = labels[order]
    later = np.searchsorted(ranked, ranked, side="right") - np.arange(len(labels)) - 1
    first = np.arange(len(labels)).repeat(later)
    return order[first], order[runs(np.arange(len(labels)) + 1, later)]


def edge_pairs(edges: Ints, n: int) -> tuple[Ints, Ints]:
    """Labels of the edge pairs of triples, by the contact left out, and whose each of them is."""
    labels = np.stack([edges[:, p] * n + edges[:, q] for p, q in ((1, 2), (0, 2), (0, 1))], axis=1)
    return labels.ravel(), np.arange(len(edges)).repeat(3)
