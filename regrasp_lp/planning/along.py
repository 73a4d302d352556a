"""Along slides: margins, least at an end or where two functions cross, and nearest approaches."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from regrasp_lp.contact import Contact
from regrasp_lp.friction import FloatArray
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import TorqueFunctions


def least_margin_along(functions: TorqueFunctions, f: FloatArray, g: FloatArray) -> float:
    """Return the least margin along the straight slide from fractions f to g.

    Parameters
    ----------
    functions : TorqueFunctions
        Of one combination.
    f, g : numpy.ndarray, shape (m,)

    Returns
    -------
    float
    """
    if not functions.spans[0]:
        return -np.inf
    start, end = (functions.certain_values(x)[0][functions.valid[0]] for x in (f, g))
    return min(least_along(start, end), least_along(-start, -end))


def least_tolerance_along(functions: TorqueFunctions, f: FloatArray, g: FloatArray) -> float:
    """Return the least tolerance along the straight slide from fractions f to g.

    Parameters
    ----------
    functions : TorqueFunctions
        Of one combination.
    f, g : numpy.ndarray, shape (m,)

    Returns
    -------
    float
    """
    if not functions.spans[0]:
        return -np.inf
    valid, rates = functions.valid[0], functions.rates[0]
    start, end = ((functions.certain_values(x)[0] / rates)[valid] for x in (f, g))
    to_ends = min(float((np.minimum(x, 1 - x) * functions.lengths[0]).min()) for x in (f, g))
    return min(least_along(start, end), least_along(-start, -end), to_ends)


def least_along(start: FloatArray, end: FloatArray) -> float:
    """Return the least, from t = 0 to 1, of the greatest of functions that are linear in t.

    That is convex and piecewise linear, so it is least at an end or where two functions cross.

    Parameters
    ----------
    start, end : numpy.ndarray, shape (J,)
        Values at t = 0 and at t = 1.

    Returns
    -------
    float

    Examples
    --------
    >>> least_along(np.array([1.0, 0.0]), np.array([0.0, 1.0]))
    0.5
    """
    change = end - start
    t = np.append(0.0, crossings(start, end))
    values = np.column_stack((start[:, None] + change[:, None] * t, end))
    return float(values.max(axis=0).min())


def crossings(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return all t between 0 and 1 at which two of the functions cross."""
    change = end - start
    apart = change[:, None] - change[None, :]
    t = np.divide(
        start[None, :] - start[:, None], apart, out=np.zeros(apart.shape), where=apart != 0
    )
    return np.asarray(t[(t > 0) & (t < 1)])


def instants(
    polygon: Polygon, before: Mapping[int, Contact], after: Mapping[int, Contact]
) -> list[Mapping[int, Contact]]:
    """Return where fingers are at both ends of a slide and wherever two of them are nearest.

    Parameters
    ----------
    polygon : Polygon
    before, after : mapping of int to Contact
        Of the same fingers, on the same edges, resolved.

    Returns
    -------
    list of mapping of int to Contact
        The two given ones first.
    """
    fractions = {k: (_fraction(before[k]), _fraction(after[k])) for k in before}
    found = [before, after]
    for one, other in combinations(before, 2):
        apart, later = (polygon.point(x[one]) - polygon.point(x[other]) for x in (before, after))
        change = later - apart
        square = float(change @ change)
        t = -float(apart @ change) / square if square > 0 else 0.0
        if 0 < t < 1:
            at = {k: f + t * (g - f) for k, (f, g) in fractions.items()}
            between = {k: Contact.at_fraction(before[k].edge, f) for k, f in at.items()}
            found.append({k: polygon.resolve_contact(c) for k, c in between.items()})
    return found


def _fraction(contact: Contact) -> float:
    assert contact.fraction is not None  # contacts of plans are resolved
    return contact.fraction
