"""The shortest slide between two grasps of one set: as long as if nothing were in the way.

A grasp set is the intersection of a down-set D, where some torque function is negative, and an
up-set U, where one is positive, which cover the box of its contacts (``docs/theory.md``). Let some
contacts go up on the way from f to g, and the others down. Moving only the former keeps the grasp
in U, moving only the latter keeps it in D; near the boundary of one of the two sets the grasp is
well inside the other. So the two groups can take turns all the way, no contact ever turns round,
and the length is ``Σ |g_i - f_i|``.

With s and τ from 0 to 1 for the two groups, the best turns follow the curve on which the largest
and the least torque function balance, ``max_k M_k + min_j M_j = 0``: for each s it leaves the
largest margin, and it rises in s.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from regrasp_lp.friction import FloatArray
from regrasp_lp.planning.along import least_margin_along
from regrasp_lp.torque import TorqueFunctions

_SAME = 1e-9
"""Parts of a slide that are shorter are none."""

_UPRIGHT = 1e-7
"""Least rate at which a function falls in τ, as part of the largest."""

_KEEP = 1 - 1e-6
"""Part of the least margin that is kept where bends are left out: all of it but rounding."""


def shortest_slide(
    functions: TorqueFunctions, f: FloatArray, g: FloatArray, enough: float = np.inf
) -> FloatArray:
    """Return the grasps at the ends and bends of a shortest way between two grasps of a set.

    Parameters
    ----------
    functions : TorqueFunctions
        Of one set.
    f, g : numpy.ndarray, shape (m,)
        Fractions; two contacts on one edge in order.
    enough : float
        Margin above which a way with fewer bends is preferred to a larger one.

    Returns
    -------
    numpy.ndarray, shape (N, m)
        From f to g, straight slides between them, at most as many bends as torque functions
        cross. All contacts that go up do so at one pace, and all that go down.

    Examples
    --------
    >>> from regrasp_lp.friction import Cones
    >>> from regrasp_lp.polygon import Polygon
    >>> from regrasp_lp.torque import torque_functions
    >>> cones = Cones.of(Polygon([(0, 0), (4, 0), (4, 1), (0, 1)]), 0.2)
    >>> pair = torque_functions(cones, np.array([[0, 2]]))
    >>> shortest_slide(pair, np.array([0.2, 0.8]), np.array([0.7, 0.3])).tolist()
    [[0.2, 0.8], [0.7, 0.3]]
    """
    ends = float(min(functions.margins(f)[0], functions.margins(g)[0]))
    straight = np.stack((f, g))
    enough = min(enough, ends)
    if (f == g).all() or least_margin_along(functions, f, g) >= _KEEP * enough:
        return straight
    up, down = np.maximum(g - f, 0.0), np.minimum(g - f, 0.0)
    places = _balanced(functions, f, up, down)
    way = np.clip(f + places[:, :1] * up + places[:, 1:] * down, 0.0, 1.0)
    way[0], way[-1] = f, g
    least = min(least_margin_along(functions, a, b) for a, b in pairwise(way))
    return _with_fewer_bends(functions, way, _KEEP * min(enough, least))


def _with_fewer_bends(functions: TorqueFunctions, way: FloatArray, enough: float) -> FloatArray:
    """Leave out bends as long as the margin along the way stays above `enough`."""
    kept, here = [0], 0
    while here < len(way) - 1:
        here = next(
            (
                there
                for there in range(len(way) - 1, here + 1, -1)
                if least_margin_along(functions, way[here], way[there]) >= enough
            ),
            here + 1,
        )
        kept.append(here)
    return way[kept]


def _balanced(
    functions: TorqueFunctions, f: FloatArray, up: FloatArray, down: FloatArray
) -> FloatArray:
    """The balanced curve in the square of s and τ, from (0, 0) to (1, 1), shape (N, 2)."""
    valid = functions.valid[0]
    value = functions.values(f)[0][valid]
    rise, fall = functions.slopes[0, valid] @ up, -(functions.slopes[0, valid] @ down)
    constant, slope, drop = (v[:, None] + v for v in (value, rise, fall))
    # Where nothing falls in τ the curve is upright: nearly so is near enough.
    drop = np.maximum(drop, _UPRIGHT * (float(drop.max()) or 1.0))
    constant, slope = constant / drop, slope / drop

    def height(s: FloatArray) -> FloatArray:
        # M_j + M_k falls in τ, so the root of max_k min_j (M_j + M_k) is that of the roots.
        roots = constant[:, :, None] + slope[:, :, None] * s
        return np.asarray(np.clip(roots.min(axis=0).max(axis=0), 0.0, 1.0))

    s = _breakpoints(constant.ravel(), slope.ravel())
    places = [(0.0, 0.0), *zip(s.tolist(), height(s).tolist(), strict=True), (1.0, 1.0)]
    kept: list[tuple[float, float]] = []
    for place in places:
        while len(kept) > 1 and _in_line(kept[-2], kept[-1], place):
            kept.pop()
        if not kept or max(place[0] - kept[-1][0], place[1] - kept[-1][1]) > _SAME:
            kept.append(place)
    kept[-1] = (1.0, 1.0)
    return np.array(kept)


def _breakpoints(constant: FloatArray, slope: FloatArray) -> FloatArray:
    """Where lines ``constant + slope s`` cross each other, 0 or 1; between s = 0 and 1."""
    lines = np.unique(np.stack((constant, slope), axis=1), axis=0)
    constant, slope = np.concatenate((lines, [[0.0, 0.0], [1.0, 0.0]])).T
    one, other = np.triu_indices(len(constant), 1)
    rate = slope[one] - slope[other]
    crossing = np.divide(
        constant[other] - constant[one], rate, out=np.full(len(rate), -1.0), where=rate != 0
    )
    inside = crossing[(crossing > 0) & (crossing < 1)]
    return np.unique(np.concatenate(([0.0], inside, [1.0])))


def _in_line(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    return abs(turn) <= _SAME * _SAME + _SAME * max(c[0] - a[0], c[1] - a[1]) ** 2
