"""Where on the paper to write labels: beside their points, off the object and off each other.

Everything is in points from the lower left corner of the axes. Each label has a few dozen
candidate places around its anchor, each with a cost; labels are placed one after the other at the
cheapest place left and, if that is asked for, placed anew in turn once the others are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from regrasp_lp.friction import BoolArray, FloatArray

CLASH = 1000.0
"""Cost from which on a label covers another one or is not wholly on the axes."""
CROSSING = 300.0
"""Cost of a leader through another leader or another label, or of a label on a contact."""

_ON_OBJECT = 250.0  # a label wholly on the material; a leader wholly across it costs the same
_ACROSS = 180.0  # a label across the boundary, which hides it
_PER_POINT = 1.0  # each point farther away
_PER_RADIAN = 9.0  # turning away from the outward direction
_PER_SHIFT = 12.0  # shifting the anchor by its whole reach
_GRID = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), axis=-1).reshape(-1, 2)


@dataclass(frozen=True, eq=False)
class Paper:
    """The object on the paper.

    Parameters
    ----------
    starts, ends : numpy.ndarray, shape (n, 2)
        The edges of all rings, in points.
    size : numpy.ndarray, shape (2,)
        Width and height of the axes, in points.
    """

    starts: FloatArray
    ends: FloatArray
    size: FloatArray

    def covers(self, points: FloatArray) -> BoolArray:
        """Whether points (..., 2) are on the material: rays to the right cross it oddly often."""
        x, y = points[..., 0, None], points[..., 1, None]
        (ax, ay), (bx, by) = self.starts.T, self.ends.T
        spans = (ay > y) != (by > y)
        rise = np.where(by == ay, 1.0, by - ay)
        odd: BoolArray = (spans & (x < ax + (y - ay) * (bx - ax) / rise)).sum(axis=-1) % 2 == 1
        return odd

    def distances(self, points: FloatArray) -> FloatArray:
        """Return the distances of points (..., 2) from the boundary."""
        vectors = self.ends - self.starts
        squares = np.maximum((vectors**2).sum(axis=1), 1e-12)
        from_start = points[..., None, :] - self.starts
        f = np.clip((from_start * vectors).sum(axis=-1) / squares, 0.0, 1.0)
        offsets = from_start - f[..., None] * vectors
        nearest: FloatArray = np.sqrt((offsets**2).sum(axis=-1).min(axis=-1))
        return nearest


@dataclass(frozen=True, eq=False)
class Label:
    """A label to be placed.

    Parameters
    ----------
    anchor : numpy.ndarray, shape (2,)
        The point that it names.
    outward : numpy.ndarray, shape (2,)
        Unit vector away from the material.
    half : numpy.ndarray, shape (2,)
        Half of its width and half of its height.
    reach : numpy.ndarray, shape (2,)
        The anchor may be shifted by parts of this vector, either way.
    """

    anchor: FloatArray
    outward: FloatArray
    half: FloatArray
    reach: FloatArray


@dataclass(frozen=True, eq=False)
class Placed:
    """A label in its place: the point it names, its centre, half of its size, what it costs."""

    anchor: FloatArray
    center: FloatArray
    half: FloatArray
    cost: float = 0.0


@dataclass(frozen=True)
class Search:
    """Which places to try.

    Parameters
    ----------
    gap : float
        From the anchor to the label at the nearest place.
    farther : tuple of float
        Further distances to try.
    degrees : tuple of float
        Angles to the outward direction to try.
    shifts : tuple of float
        Parts of a label's reach by which to shift the anchor.
    sweeps : int
        How often labels are placed anew once the others are.
    limit : float
        A label whose cheapest place costs as much is left out.
    """

    gap: float
    farther: tuple[float, ...]
    degrees: tuple[float, ...]
    shifts: tuple[float, ...] = (0.0,)
    sweeps: int = 0
    limit: float = np.inf

    def candidates(self, label: Label) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return anchors and centres, each (c, 2), and what each place costs by itself, (c,)."""
        grids = np.meshgrid(self.farther, np.radians(self.degrees), self.shifts, indexing="ij")
        away, turn, shift = (grid.ravel() for grid in grids)
        c, s = np.cos(turn), np.sin(turn)
        ox, oy = label.outward
        direction = np.stack([c * ox - s * oy, s * ox + c * oy], axis=1)
        distance = self.gap + away + np.hypot(*(direction * label.half).T)
        anchors = label.anchor + shift[:, None] * label.reach
        cost = _PER_POINT * away + _PER_RADIAN * np.abs(turn) + _PER_SHIFT * np.abs(shift)
        return anchors, anchors + direction * distance[:, None], cost


def place(
    paper: Paper,
    labels: Sequence[Label],
    search: Search,
    *,
    avoid: FloatArray,
    taken: Sequence[Placed] = (),
) -> list[Placed | None]:
    """Place labels, the first ones first.

    Parameters
    ----------
    paper : Paper
    labels : sequence of Label
    search : Search
    avoid : numpy.ndarray, shape (a, 2)
        Points that no label should cover.
    taken : sequence of Placed
        Labels that have their place already.

    Returns
    -------
    list of Placed or None
        None for labels left out.
    """
    tried = []
    for label in labels:
        anchors, centers, costs = search.candidates(label)
        tried.append((anchors, centers, costs + _alone(paper, label, anchors, centers, avoid)))
    placed: list[Placed | None] = [*taken, *[None] * len(labels)]
    # the same as arrays (anchor, centre, half), so that only near ones need a closer look
    table = np.full((len(placed), 3, 2), np.nan)
    for i, known in enumerate(taken):
        table[i] = known.anchor, known.center, known.half
    for sweep in range(search.sweeps + 1):
        worst = 0.0
        for i, (label, (anchors, centers, costs)) in enumerate(
            zip(labels, tried, strict=True), start=len(taken)
        ):
            table[i] = np.nan
            cost = costs + _among(label, anchors, centers, table)
            best = int(cost.argmin())
            worst = max(worst, float(cost[best]))
            placed[i] = None
            if cost[best] < search.limit:
                placed[i] = Placed(anchors[best], centers[best], label.half, float(cost[best]))
                table[i] = anchors[best], centers[best], label.half
        if sweep and worst < CROSSING:
            break
    return placed[len(taken) :]


def _alone(
    paper: Paper, label: Label, anchors: FloatArray, centers: FloatArray, avoid: FloatArray
) -> FloatArray:
    """Cost of the places of a label by the border, the object and the points to avoid."""
    outside: BoolArray = (centers < label.half) | (centers > paper.size - label.half)
    cost = 2 * CLASH * outside.any(axis=1)
    samples = centers[:, None] + 0.95 * label.half * _GRID
    on_object = paper.covers(samples).mean(axis=1)
    across = paper.distances(centers) < 0.9 * label.half.min()
    cost = cost + _ON_OBJECT * (0.6 * (on_object > 0) + 0.4 * on_object) + _ACROSS * across
    along = np.linspace(0.08, 0.9, 9)[:, None]
    leaders = anchors[:, None] + along * (centers - anchors)[:, None]
    cost = cost + _ON_OBJECT * paper.covers(leaders).mean(axis=1)
    if len(avoid):
        covered = _within(avoid, centers[:, None], label.half + 2.0)
        cost = cost + CROSSING * covered.any(axis=1)
    return np.asarray(cost)


def _among(label: Label, anchors: FloatArray, centers: FloatArray, table: FloatArray) -> FloatArray:
    """Cost of the places of a label by those in the table (k, 3, 2); NaN where there is none."""
    reach = np.abs(centers - label.anchor).max() + np.abs(anchors - label.anchor).max()
    length = np.abs(table[:, 1] - table[:, 0]).max(axis=1) + table[:, 2].max(axis=1)
    away = np.abs(table[:, 1] - label.anchor).max(axis=1)
    near = table[away < reach + length + label.half.max() + 2.0]
    if not len(near):
        return np.zeros(len(centers))
    named, theirs, halves = near[:, 0], near[:, 1], near[:, 2]
    apart = np.abs(centers[:, None] - theirs) - label.half - halves - 1.5
    gap: FloatArray = apart.max(axis=2)
    cost = CLASH * np.where(gap < 0, 1 - 0.02 * gap, 0.0).sum(axis=1)
    along = np.linspace(0.1, 0.9, 9)[:, None]
    my_leaders = anchors[:, None] + along * (centers - anchors)[:, None]
    their_leaders = (named[:, None] + along * (theirs - named)[:, None]).reshape(-1, 2)
    through = _within(my_leaders[:, :, None], theirs, halves).any(axis=(1, 2))
    under = _within(their_leaders, centers[:, None], label.half + 1.0).any(axis=1)
    crossed = _cross(anchors[:, None], centers[:, None], named, theirs).any(axis=1)
    return np.asarray(cost + CROSSING * (through | under) + CROSSING * crossed)


def _within(points: FloatArray, centers: FloatArray, halves: FloatArray) -> BoolArray:
    """Whether points are in boxes about centres; all (..., 2), broadcast."""
    return np.asarray((np.abs(points - centers) < halves).all(axis=-1))


def _cross(p: FloatArray, q: FloatArray, a: FloatArray, b: FloatArray) -> BoolArray:
    """Whether segments from p to q cross those from a to b; all (..., 2), broadcast."""

    def side(u: FloatArray, v: FloatArray, w: FloatArray) -> FloatArray:
        e, f = v - u, w - u
        return np.asarray(e[..., 0] * f[..., 1] - e[..., 1] * f[..., 0])

    apart = side(p, q, a) * side(p, q, b) < 0
    crossing: BoolArray = apart & (side(a, b, p) * side(a, b, q) < 0)
    return crossing
