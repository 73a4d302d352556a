"""The best grasp of a set, for each metric: by linear programs, or by search.

Margin and tolerance are the least of linear functions on every piece of a set, so that their best
is that of a few linear programs, with a bound. The other metrics are neither linear nor concave:
they are searched for, from a lattice of grasps to ever smaller steps about the best ones. What a
search has found is a grasp of that value, and nothing says that there is no better one; but for ε,
of which branch and bound tells how much better one could be.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.friction import BoolArray, FloatArray
from regrasp_lp.grasp_sets.collection import GraspSet
from regrasp_lp.grasp_sets.pieces import Measure, piece_sets
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver, maximise_margins
from regrasp_lp.margins import existing_pieces
from regrasp_lp.quality.epsilon_bounds import epsilon_bound
from regrasp_lp.quality.metrics import Metric, metric_of
from regrasp_lp.quality.stability import margin, tolerance
from regrasp_lp.quality.wrenches import epsilon
from regrasp_lp.torque import torque_functions

_LATTICE = {2: 48, 3: 16}  # points along each edge at the start of a search
_KEPT = 16  # of the best ones, about which it goes on
_AROUND = 40  # tries about each
_ROUNDS = 40
_NARROWER = 0.8  # from one round to the next
_PROVED = 1e-6
_ROUNDING = 1e-9  # of the size of the object


@dataclass(frozen=True, eq=False)
class BestGrasp:
    """The best grasp of a set, and how good it is.

    Parameters
    ----------
    grasp : Grasp
    metric : str
    value : float
        Of the metric, evaluated at the grasp.
    bound : float or None
        No grasp of the set has a better value: by the multipliers of the programs or, of ε, by
        branch and bound; None if the grasp has been searched for, which proves nothing.
    """

    grasp: Grasp
    metric: str
    value: float
    bound: float | None

    @property
    def proved(self) -> bool:
        """Whether the grasp is the best of its set, but for a millionth of its value."""
        return self.bound is not None and self.bound - self.value <= _PROVED * abs(self.value)

    def __repr__(self) -> str:
        bound = "searched" if self.bound is None else f"at most {self.bound:.6g}"
        return f"<BestGrasp: {self.metric} {self.value:.6g}, {bound}>"


def best(
    grasp_set: GraspSet, metric: str | Callable[..., Any] = "margin", **options: Any
) -> BestGrasp:
    """Return the best grasp of a set by a metric.

    Parameters
    ----------
    grasp_set : GraspSet
    metric : str or callable
        The name of a metric, or its function; of a function that this package does not know the
        largest value is the best.
    **options
        Named arguments of the metric, as ``forces="each"``.

    Returns
    -------
    BestGrasp
        Proved for "margin" and "tolerance", by linear programs. For all others found by a search,
        the same one whenever it is repeated, which may miss the best; that of "epsilon" comes
        with a bound (where ε is limited by torques some percent above it; far above it where edges
        are thousands of times longer than the object is thick).

    Raises
    ------
    OptionError
        If there is no such metric.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> block = rl.Polygon([(0, 0), (8, 0), (8, 3), (0, 3)])
    >>> pair = rl.build_switching_graph(block, friction=0.5).sets[1]
    >>> pair.edges, rl.quality.best(pair, "tolerance").proved
    ((1, 3), True)
    >>> found = rl.quality.best(pair, rl.quality.epsilon, torque_scale=2.0)
    >>> round(found.value, 3), round(found.bound, 2)
    (0.408, 0.41)
    """
    chosen = metric_of(metric, options)
    # by function, not by name: one of the user's may have the same name
    if chosen.function in (margin, tolerance) and not options:
        measure: Measure = "margin" if chosen.function is margin else "tolerance"
        return _by_programs(grasp_set, chosen, measure)
    found = _by_search(grasp_set, chosen)
    if chosen.function is not epsilon:
        return found
    forces, scale = options.get("forces", "sum"), options.get("torque_scale", "gyration")
    return replace(found, bound=epsilon_bound(grasp_set, found.value, forces, scale))


def values_of(grasp_set: GraspSet, metric: Metric, fractions: FloatArray) -> FloatArray:
    """Return the values of grasps on the edges of a set, at fractions (N, m) of whole edges."""
    friction = grasp_set.torque.cones.whole.friction
    edges = np.array(grasp_set.edges, dtype=np.intp)
    return metric.values(grasp_set.polygon, friction, edges, fractions)


def inside(grasp_set: GraspSet, fractions: FloatArray) -> BoolArray:
    """Whether grasps on the edges of a set are in it, but for rounding, shape (N,).

    Parameters
    ----------
    grasp_set : GraspSet
    fractions : numpy.ndarray, shape (N, m)
        Of whole edges.
    """
    pieces = grasp_set.pieces
    lengths = grasp_set.torque.cones.whole.lengths[list(grasp_set.edges)]
    positions = fractions * lengths
    found = np.zeros(len(positions), dtype=bool)
    for piece in range(len(pieces)):
        one = pieces.take(np.full(len(positions), piece))
        found |= one.margins(positions) > 0
    return found


# --- linear programs ----------------------------------------------------------------------------


def _by_programs(grasp_set: GraspSet, metric: Metric, measure: Measure) -> BestGrasp:
    """The best of all pieces, by their programs; the witness of the set where it is as good."""
    programs = _programs(grasp_set, measure)
    found = maximise_margins(programs, get_solver("highs"))
    witness = grasp_set.witness.fractions
    grasps = np.vstack((witness, _of_edges(grasp_set, found.points)))
    values = values_of(grasp_set, metric, grasps)
    size = grasp_set.torque.cones.size
    best = 0 if values[0] >= values.max() - _ROUNDING * size else int(values.argmax())
    bound = max(float(found.bounds.max()), float(values[best]))
    return BestGrasp(_grasp(grasp_set, grasps[best]), metric.name, float(values[best]), bound)


def _programs(grasp_set: GraspSet, measure: Measure) -> LinearSets:
    """One program for each piece, over the fractions of the segments that can be touched.

    The functions of the chapter's parallel sets say what is in the set, not how good it is: there
    every piece is joined with every two functions of the contacts.
    """
    functions, limited = grasp_set.torque, grasp_set.limited
    pieces = existing_pieces(functions) if limited is None else limited.pieces
    within = piece_sets(functions, pieces, grasp_set.names)
    limits = _hard(within if limited is None else limited.linear(grasp_set.names))
    if grasp_set.kind == "parallel":
        functions = torque_functions(functions.cones, functions.edges)
        own = existing_pieces(functions)
        chosen = np.arange(len(limits)).repeat(len(own))
        limits, pieces = limits.take(chosen), np.tile(own, (len(limits), 1))
    sets = piece_sets(functions, pieces, grasp_set.names, measure=measure)
    if measure == "tolerance":  # to the ends of whole edges, also where segments are shorter
        m, first = functions.m, functions.first_positions[0]
        whole = functions.cones.whole.lengths[list(grasp_set.edges)]
        sets.bounds[:, 2 : 2 + m] = first
        sets.bounds[:, 2 + m : 2 + 2 * m] = whole - first
    return sets.join(limits, on=grasp_set.names)


def _hard(sets: LinearSets) -> LinearSets:
    """Sets whose rows hold as they are, whatever the margin."""
    return replace(sets, scales=np.zeros(sets.scales.shape))


# --- search -------------------------------------------------------------------------------------


def _by_search(grasp_set: GraspSet, metric: Metric) -> BestGrasp:
    """A lattice of grasps and the witness, then ever smaller steps about the best ones."""
    m = len(grasp_set.edges)
    steps = (np.arange(_LATTICE[m]) + 0.5) / _LATTICE[m]
    lattice = np.stack(np.meshgrid(*[steps] * m, indexing="ij"), axis=-1).reshape(-1, m)
    cones, segments = grasp_set.torque.cones, grasp_set.torque.edges[0]
    witness = cones.within(segments, grasp_set.witness.fractions)
    tried = np.vstack((witness, lattice))
    good = _goodness(grasp_set, metric, tried)
    random = np.random.default_rng(0)  # of its own: the same grasp whenever this is repeated
    reach = 1.0 / _LATTICE[m]
    for _ in range(_ROUNDS):
        if metric.less_is_better and good.max() == 0:
            break  # no such metric is negative
        kept = np.argsort(-good, kind="stable")[:_KEPT]
        steps = reach * random.uniform(-1, 1, (len(kept), _AROUND, m))
        around = np.clip(tried[kept][:, None] + steps, 0.0, 1.0).reshape(-1, m)
        tried = np.vstack((tried[kept], around))
        good = np.concatenate((good[kept], _goodness(grasp_set, metric, around)))
        reach *= _NARROWER
    best = int(good.argmax())
    fractions = _of_edges(grasp_set, tried[[best]])
    value = float(values_of(grasp_set, metric, fractions)[0])
    return BestGrasp(_grasp(grasp_set, fractions[0]), metric.name, value, None)


def _goodness(grasp_set: GraspSet, metric: Metric, fractions: FloatArray) -> FloatArray:
    """How good grasps are, at fractions of segments; -inf outside the set, and for NaN."""
    of_edges = _of_edges(grasp_set, fractions)
    good = metric.goodness(values_of(grasp_set, metric, of_edges))
    return np.where(inside(grasp_set, of_edges) & ~np.isnan(good), good, -np.inf)


def _of_edges(grasp_set: GraspSet, fractions: FloatArray) -> FloatArray:
    """Fractions of segments, shape (N, m), as fractions of their edges."""
    return grasp_set.torque.cones.along(grasp_set.torque.edges[0], fractions)


def _grasp(grasp_set: GraspSet, fractions: FloatArray) -> Grasp:
    pairs = zip(grasp_set.edges, fractions.tolist(), strict=True)
    return grasp_set.polygon.resolve(Grasp.at_fractions(pairs))
