"""Force closure by the primal definition, in fractions: an oracle that shares no code.

Wrenches positively span R³ iff they span it and the negative of each one is a combination, with
no negative coefficient, of a basis chosen among them (Carathéodory, filled up to a basis).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations

from regrasp_lp.polygon import Polygon

Wrench = tuple[Fraction, Fraction, Fraction]


def exact_point(polygon: Polygon, edge: int, fraction: Fraction) -> tuple[Fraction, Fraction]:
    ax, ay = (Fraction(v) for v in polygon.edge_starts[edge].tolist())
    bx, by = (Fraction(v) for v in polygon.edge_ends[edge].tolist())
    return ax + fraction * (bx - ax), ay + fraction * (by - ay)


def contact_wrenches(
    polygon: Polygon, mu: float, contacts: Sequence[tuple[int, float | Fraction]]
) -> list[Wrench]:
    wrenches = []
    for edge, value in contacts:
        x, y = exact_point(polygon, edge, Fraction(value))
        x0, y0 = exact_point(polygon, edge, Fraction(0))
        x1, y1 = exact_point(polygon, edge, Fraction(1))
        tx, ty = x1 - x0, y1 - y0
        for signed_mu in (Fraction(mu), -Fraction(mu)):
            ex, ey = -ty + signed_mu * tx, tx + signed_mu * ty
            wrenches.append((ex, ey, x * ey - y * ex))
    return wrenches


def det(a: Wrench, b: Wrench, c: Wrench) -> Fraction:
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def positively_spans(wrenches: Sequence[Wrench]) -> bool:
    bases = [
        (a, b, c, value) for a, b, c in combinations(wrenches, 3) if (value := det(a, b, c)) != 0
    ]

    def has_negative(w: Wrench) -> bool:
        return any(
            det(w, b, c) * value <= 0 and det(a, w, c) * value <= 0 and det(a, b, w) * value <= 0
            for a, b, c, value in bases
        )

    return bool(bases) and all(has_negative(w) for w in wrenches)


def closed(polygon: Polygon, mu: float, contacts: Sequence[tuple[int, float | Fraction]]) -> bool:
    return positively_spans(contact_wrenches(polygon, mu, contacts))
