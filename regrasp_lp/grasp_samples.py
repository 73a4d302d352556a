"""Random force-closure grasps, to study what grasps of an object are like."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.errors import OptionError
from regrasp_lp.force_closure import is_force_closure
from regrasp_lp.friction import FloatArray, per_edge_friction
from regrasp_lp.polygon import Polygon
from regrasp_lp.random_grasps import RandomGrasps
from regrasp_lp.wrenches import IntArray

_BATCH = 256, 32_768  # draws at a time, least and most
_DRAWS_EACH = 1000


def sample_grasps(
    polygon: Polygon,
    friction: ArrayLike,
    count: int,
    *,
    contacts: int = 3,
    seed: int = 0,
    proposal: str = "uniform",
    max_draws: int | None = None,
) -> tuple[IntArray, FloatArray]:
    """Return random force-closure grasps, as arrays that all functions of batches take.

    Contacts are drawn on different edges until enough of them hold the object, exactly.

    Parameters
    ----------
    polygon : Polygon
    friction : float or sequence of float
        μ, one value or one per edge.
    count : int
        How many grasps K.
    contacts : int
        Of each grasp m: 2 or 3.
    seed : int
        The same seed gives the same grasps.
    proposal : {"uniform", "mixed"}
        With "uniform" all sets of edges, and all places on an edge, are equally likely: the grasps
        are spread evenly over what is in force closure of contact space, measured in fractions of
        edges (a set of short edges gets as many as one of long edges). "mixed" aims
        (`regrasp_lp.random_grasps`), and finds grasps under low friction sooner.
    max_draws : int, optional
        Draws after which fewer grasps will do, by default 1000 times `count`.

    Returns
    -------
    edges : numpy.ndarray of int, shape (K, m)
    fractions : numpy.ndarray, shape (K, m)
        Of the edge lengths. K is less than `count` only if `max_draws` did not suffice.

    Raises
    ------
    FrictionError, OptionError
        If an argument has no meaning.

    Examples
    --------
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    >>> edges, fractions = sample_grasps(square, friction=0.3, count=500)
    >>> bool(is_force_closure(square, friction=0.3, edges=edges, fractions=fractions).all())
    True
    >>> edges.shape
    (500, 3)
    """
    most = _DRAWS_EACH * count if max_draws is None else max_draws
    for name, value in (("count", count), ("max_draws", most)):
        if not isinstance(value, (int, np.integer)) or value < 1:
            raise OptionError(f"{name} must be a whole number of at least 1, got {value!r}")
    if contacts not in (2, 3):
        raise OptionError(f"contacts must be 2 or 3, got {contacts!r}")
    mu = per_edge_friction(friction, polygon.n_edges)
    draws, rng = RandomGrasps(polygon, mu, proposal), np.random.default_rng(seed)
    size = int(np.clip(4 * count, *_BATCH))
    found = [(np.zeros((0, contacts), dtype=np.intp), np.zeros((0, contacts)))]
    drawn = held = 0
    while held < count and drawn < most:
        edges, fractions = draws.draw(rng, min(size, most - drawn), contacts)
        holds = is_force_closure(polygon, friction=mu, edges=edges, fractions=fractions)
        found.append((edges[holds], fractions[holds]))
        drawn, held = drawn + size, held + int(holds.sum())
    all_edges, all_fractions = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    return all_edges[:count], all_fractions[:count]
