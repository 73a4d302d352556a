"""Plane curves of drawings, and chains of chords that stay within a given distance of them.

A curve K and the chain L of chords that is put in its place have a Hausdorff distance of at most
the tolerance: no point of K is farther from L, and no point of L from K. It is enough to see that
of each part of the curve between two vertices of the chain no point is farther from its chord:
such a part is connected and has the chord's ends, so that every point of the chord is the foot of
the perpendicular from one of its points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from regrasp_lp.errors import FileFormatError

__all__ = [
    "MOST_POINTS",
    "Bezier",
    "Curve",
    "EllipticArc",
    "b_spline",
    "bulge",
    "check_number",
    "polyline",
]

_Floats: TypeAlias = npt.NDArray[np.float64]

MOST_POINTS = 100_000
"""Most points of a drawing: the tests of its rings compare all pairs of edges."""

_WIDEST = math.pi / 2
"""Largest angle of an arc that one chord may stand for, however large the tolerance."""
_HALVINGS = 40
"""How often a rational curve is halved at most; by then it is shorter than rounding."""


@dataclass(frozen=True, eq=False)
class Bezier:
    """A Bézier curve of any degree, rational if it has weights; of degree 1 it is a segment.

    Parameters
    ----------
    points : numpy.ndarray
        Control points, shape (degree + 1, 2).
    weights : numpy.ndarray, optional
        Their weights, positive, shape (degree + 1,).
    """

    points: _Floats
    weights: _Floats | None = None

    @property
    def bounds(self) -> _Floats:
        """A box that holds the curve, that of its control points: (min x, min y, max x, max y)."""
        return np.concatenate([self.points.min(axis=0), self.points.max(axis=0)])

    def transformed(self, matrix: _Floats) -> Bezier:
        """Return the curve's image under an affine map x -> A x + b, with matrix (A | b)."""
        return Bezier(self.points @ matrix[:, :2].T + matrix[:, 2], self.weights)

    def flattened(self, tolerance: float) -> _Floats:
        """Return points on the curve, in order, both ends among them; array (n, 2).

        A polynomial curve of degree d is cut into n equal parts of its parameter. Between two of
        its points a curve C leaves the chord by at most h² max |C″| / 8 for a part of length h =
        1/n, and |C″| is at most d (d − 1) max |P_i − 2 P_{i+1} + P_{i+2}|, so that
        n = ceil(sqrt(d (d − 1) max |ΔΔP| / (8 tolerance))) is enough. A rational curve is halved
        until all control points of each part are within the tolerance of its chord: so is then
        their convex hull, which holds that part of the curve.

        Examples
        --------
        >>> Bezier(np.array([[0.0, 0.0], [1.0, 2.0], [2.0, 0.0]])).flattened(0.25).tolist()
        [[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]]
        """
        degree = len(self.points) - 1
        if self.weights is not None and np.ptp(self.weights) > 0:
            homogeneous = np.column_stack([self.points * self.weights[:, None], self.weights])
            inner = _halved(homogeneous, tolerance)[:-1]
            return np.concatenate([self.points[:1], inner, self.points[-1:]])
        bend = np.diff(self.points, 2, axis=0)
        most = float(np.hypot(bend[:, 0], bend[:, 1]).max(initial=0.0))
        n = _parts(math.sqrt(degree * (degree - 1) * most / tolerance / 8), tolerance)
        level = np.broadcast_to(self.points, (n - 1, *self.points.shape))
        t = (np.arange(1, n) / n)[:, None, None]
        for _ in range(degree):
            level = (1 - t) * level[:, :-1] + t * level[:, 1:]
        return np.concatenate([self.points[:1], level[:, 0], self.points[-1:]])


@dataclass(frozen=True, eq=False)
class EllipticArc:
    """The arc c + u cos t + v sin t, for t from a start through a sweep.

    Parameters
    ----------
    center, u, v : numpy.ndarray
        Centre and two conjugate half-diameters, shape (2,) each.
    start, sweep : float
        Angles in radians; the sweep is signed, and 2π in size for a whole ellipse.
    ends : numpy.ndarray, optional
        First and last point, shape (2, 2), where they are known better than by cosines.
    """

    center: _Floats
    u: _Floats
    v: _Floats
    start: float
    sweep: float
    ends: _Floats | None = None

    @property
    def bounds(self) -> _Floats:
        """The box of the whole ellipse: (min x, min y, max x, max y)."""
        half = np.hypot(self.u, self.v)
        return np.concatenate([self.center - half, self.center + half])

    def transformed(self, matrix: _Floats) -> EllipticArc:
        """Return the arc's image under an affine map x -> A x + b, with matrix (A | b)."""
        linear, shift = matrix[:, :2], matrix[:, 2]
        ends = None if self.ends is None else self.ends @ linear.T + shift
        return EllipticArc(
            linear @ self.center + shift,
            linear @ self.u,
            linear @ self.v,
            self.start,
            self.sweep,
            ends,
        )

    def flattened(self, tolerance: float) -> _Floats:
        """Return points on the arc, in order, both ends among them; array (n, 2).

        The angle is cut into equal parts. A chord of angle Δ of the unit circle has the height
        (sagitta) 1 − cos(Δ/2), and the linear map (u v) stretches it by at most its larger
        singular value σ: by σ (1 − cos(Δ/2)), which Δ = 2 acos(1 − tolerance/σ) makes equal to
        the tolerance. For a circle σ is the radius. No chord stands for more than a quarter turn.

        Examples
        --------
        >>> circle = EllipticArc(np.zeros(2), np.array([2.0, 0]), np.array([0, 2.0]), 0, 2 * np.pi)
        >>> len(circle.flattened(0.01)) - 1, round(2 * (1 - float(np.cos(np.pi / 32))), 5)
        (32, 0.00963)
        """
        stretch = float(np.linalg.norm(np.stack([self.u, self.v]), ord=2))
        # half the angle from its sine: 1 - cos loses all digits where the tolerance is small
        ratio = min(tolerance / stretch, 1.0) if stretch > 0 else 1.0
        widest = max(min(4 * math.asin(math.sqrt(ratio / 2)), _WIDEST), 1e-150)
        n = _parts(abs(self.sweep) / widest * (1 - 1e-12), tolerance)
        t = self.start + self.sweep * np.arange(n + 1) / n
        points: _Floats = self.center + np.outer(np.cos(t), self.u) + np.outer(np.sin(t), self.v)
        if self.ends is not None:
            points[[0, -1]] = self.ends
        elif abs(self.sweep) >= 2 * math.pi:
            points[-1] = points[0]
        return points


Curve: TypeAlias = Bezier | EllipticArc


def polyline(points: npt.ArrayLike) -> list[Curve]:
    """Return the segments between consecutive points, array_like (n, 2)."""
    vertices = np.asarray(points, dtype=np.float64)
    return [Bezier(vertices[k : k + 2]) for k in range(len(vertices) - 1)]


def bulge(start: _Floats, end: _Floats, value: float) -> Curve:
    """Return the arc of a DXF polyline: its bulge is the tangent of a quarter of its angle.

    Positive for an arc that runs counter-clockwise, 0 for a segment.

    Examples
    --------
    >>> half = bulge(np.array([0.0, 0.0]), np.array([2.0, 0.0]), 1.0)
    >>> half.flattened(0.5).round(12).tolist()
    [[0.0, 0.0], [1.0, -1.0], [2.0, 0.0]]
    """
    if value == 0 or (start == end).all():
        return Bezier(np.stack([start, end]))
    chord = end - start
    left = np.array([-chord[1], chord[0]])
    center = (start + end) / 2 + left * (1 - value * value) / (4 * value)
    arm = start - center
    turned = np.array([-arm[1], arm[0]])
    return EllipticArc(center, arm, turned, 0.0, 4 * math.atan(value), np.stack([start, end]))


def b_spline(
    knots: npt.ArrayLike, points: npt.ArrayLike, weights: npt.ArrayLike | None, degree: int
) -> list[Curve]:
    """Return the Bézier curves that a B-spline consists of, one for each span of its knots.

    Control point j of the span [a, b] is the blossom, the symmetric multi-affine form of the
    spline, of degree − j times a and j times b; de Boor's scheme evaluates it, with another
    argument in each round. Rational splines are treated in homogeneous coordinates.

    Parameters
    ----------
    knots : array_like of shape (n + degree + 1,)
        Non-decreasing.
    points : array_like of shape (n, 2)
    weights : array_like of shape (n,), optional
        Positive.
    degree : int

    Examples
    --------
    >>> (curve,) = b_spline([0, 0, 0, 1, 1, 1], [(0, 0), (1, 2), (2, 0)], None, 2)
    >>> curve.points.tolist()
    [[0.0, 0.0], [1.0, 2.0], [2.0, 0.0]]
    """
    t, controls = np.asarray(knots, dtype=np.float64), np.asarray(points, dtype=np.float64)
    weight = np.ones(len(controls)) if weights is None else np.asarray(weights, dtype=np.float64)
    homogeneous = np.column_stack([controls * weight[:, None], weight])
    curves: list[Curve] = []
    for k in range(degree, len(controls)):
        if t[k] >= t[k + 1]:
            continue
        parts = np.stack(
            [
                _blossom(t, homogeneous, k, [t[k]] * (degree - j) + [t[k + 1]] * j)
                for j in range(degree + 1)
            ]
        )
        plain = parts[:, :2] / parts[:, 2:]
        curves.append(Bezier(plain, None if weights is None else parts[:, 2]))
    return curves


def _blossom(t: _Floats, controls: _Floats, k: int, arguments: list[float]) -> _Floats:
    """De Boor's scheme on the span from knot k, with one argument a round."""
    degree = len(arguments)
    level = controls[k - degree : k + 1].copy()
    for r, x in enumerate(arguments, start=1):
        for i in range(degree, r - 1, -1):
            low, high = t[i + k - degree], t[i + k + 1 - r]
            share = (x - low) / (high - low)
            level[i] = (1 - share) * level[i - 1] + share * level[i]
    point: _Floats = level[degree]
    return point


def check_number(n: float, tolerance: float) -> None:
    """Refuse a number of points that nothing could be done with.

    Raises
    ------
    FileFormatError
        If it is more than `MOST_POINTS`, or no number.
    """
    if not n <= MOST_POINTS:
        raise FileFormatError(
            f"has too many curves or points: more than {MOST_POINTS:,} edges would be needed to "
            f"stay within {tolerance:.3g} of them; allow a larger distance (flattening=...), or "
            "read a part of the drawing (layers=[...])"
        )


def _parts(least: float, tolerance: float) -> int:
    """How many parts a curve is cut into."""
    check_number(least, tolerance)
    return max(1, math.ceil(least))


def _halved(homogeneous: _Floats, tolerance: float) -> _Floats:
    """Ends of the flat parts of a rational curve but for its start, array (n, 2).

    All parts that are not flat yet are halved at once; ends are sorted by the parameter at last.
    """
    parts, lasts = homogeneous[None], np.ones(1)
    found, places, n = [], [], 0
    for halving in range(_HALVINGS + 1):
        points = parts[..., :2] / parts[..., 2:]
        flat = (_off_chord(points) <= tolerance) | (halving == _HALVINGS)
        found.append(points[flat, -1])
        places.append(lasts[flat])
        n += int(flat.sum())
        check_number(n + len(parts) - int(flat.sum()), tolerance)
        level = parts[~flat]
        first, last = [level[:, 0]], [level[:, -1]]
        while level.shape[1] > 1:
            level = (level[:, :-1] + level[:, 1:]) / 2
            first.append(level[:, 0])
            last.append(level[:, -1])
        ends = lasts[~flat]
        parts = np.concatenate([np.stack(first, axis=1), np.stack(last[::-1], axis=1)])
        lasts = np.concatenate([ends - 0.5 ** (halving + 1), ends])
    return np.concatenate(found)[np.argsort(np.concatenate(places))]


def _off_chord(points: _Floats) -> _Floats:
    """Largest distance of points from the segment between the first and the last; (..., n, 2)."""
    off = points - points[..., :1, :]
    chord = off[..., -1:, :]
    length = (chord * chord).sum(axis=-1)
    along = (off * chord).sum(axis=-1)
    shares = np.clip(np.divide(along, length, out=np.zeros_like(along), where=length > 0), 0, 1)
    off = off - shares[..., None] * chord
    largest: _Floats = np.hypot(off[..., 0], off[..., 1]).max(axis=-1)
    return largest
