"""Metrics over a grasp set, sampled: over its focus cell, or over a section of contact space."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from regrasp_lp.circuits import cross
from regrasp_lp.contact import Grasp
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import BoolArray, FloatArray
from regrasp_lp.grasp_sets.collection import GraspSet
from regrasp_lp.grasp_sets.parallel import common_cone_rays
from regrasp_lp.quality.best_grasps import inside, values_of
from regrasp_lp.quality.metrics import Metric, metric_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from regrasp_lp.plotting.quality import QualityMapArtists

Over = Literal["contacts", "focus"]

_EQUAL = 1e-9  # of a value: samples that differ by less are as good
_BESIDE = 0.25  # of its diameter: how far around the object a focus cell is sampled


@dataclass(frozen=True, eq=False)
class QualityMap:
    """A metric, sampled over two coordinates.

    Parameters
    ----------
    grasp_set : GraspSet
    metric : Metric
    over : {"contacts", "focus"}
    names : tuple of str
        The two coordinates: positions as "u4", or "x" and "y".
    x, y : numpy.ndarray, shape (A,) and (B,)
        Samples of either coordinate, in the object's unit.
    values : numpy.ndarray, shape (B, A)
        The metric, also of grasps that are not in force closure; NaN where a focus point is not in
        the focus cell, so that it has no grasp.
    within : numpy.ndarray of bool, shape (B, A)
        Whether the grasp is in the set.
    fractions : numpy.ndarray, shape (B, A, m)
        The grasps.
    fixed : mapping of str to float
        The positions that are the same everywhere.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])
    >>> pair = rl.build_switching_graph(block, friction=0.4).sets[0]
    >>> found = rl.quality.quality_map(pair, "margin", samples=5)
    >>> found.names, found.values.shape, int(found.within.sum()), found.best
    (('u0', 'u2'), (5, 5), 5, (2, 2))
    >>> found.grasp(2, 2)
    Grasp.at_fractions([(0, 0.5), (2, 0.5)])
    """

    grasp_set: GraspSet
    metric: Metric
    over: Over
    names: tuple[str, str]
    x: FloatArray
    y: FloatArray
    values: FloatArray
    within: BoolArray
    fractions: FloatArray
    fixed: Mapping[str, float]

    def __post_init__(self) -> None:
        for array in (self.x, self.y, self.values, self.within, self.fractions):
            array.setflags(write=False)
        object.__setattr__(self, "fixed", MappingProxyType(dict(self.fixed)))

    def grasp(self, row: int, column: int) -> Grasp:
        """Return the grasp at ``y[row]`` and ``x[column]``."""
        pairs = zip(self.grasp_set.edges, self.fractions[row, column].tolist(), strict=True)
        return self.grasp_set.polygon.resolve(Grasp.at_fractions(pairs))

    @property
    def best(self) -> tuple[int, int] | None:
        """Row and column of the best sample within the set; None if no sample is in it.

        Of samples that are as good, the one nearest to the middle of them. It is the best of the
        samples: `regrasp_lp.quality.best` looks for the best of the set.
        """
        if not self.within.any():
            return None
        known = self.within & ~np.isnan(self.values)
        good = np.where(known, self.metric.goodness(self.values), -np.inf)
        most = float(good.max())
        slack = _EQUAL * abs(most) if np.isfinite(most) else 0.0
        equal = np.argwhere(self.within & (good >= most - slack))
        away = equal - equal.mean(axis=0)
        row, column = equal[(away**2).sum(axis=1).argmin()].tolist()
        return row, column

    def plot(self, ax: Axes | None = None) -> QualityMapArtists:
        """Draw the map; see `regrasp_lp.plotting.plot_quality_map`."""
        from regrasp_lp.plotting import plot_quality_map

        return plot_quality_map(self, ax)

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.values.shape[::-1]))
        return f"<QualityMap: {self.metric.name} over {self.names[0]}, {self.names[1]}, {shape}>"


def quality_map(
    grasp_set: GraspSet,
    metric: str | Callable[..., Any] = "margin",
    *,
    over: Over = "contacts",
    samples: int = 100,
    fixed: Mapping[str, float] | None = None,
    **options: Any,
) -> QualityMap:
    """Return a metric sampled over a grasp set.

    Parameters
    ----------
    grasp_set : GraspSet
    metric : str or callable
        The name of a metric, or its function: as `regrasp_lp.quality.best`.
    over : {"contacts", "focus"}
        The positions of two contacts, that of a third one fixed. Or the focus cell of one of the
        chapter's concurrent or two-finger sets, each point standing for the grasp with contacts in
        the middle of the independent contact regions that it defines (as much of the cell as is
        near the object).
    samples : int
        Along the longer side of what is sampled; at least two.
    fixed : mapping of str to float, optional
        Of three contacts the name of one (`GraspSet.names`) and its position; by default the last
        one, where it is in the set's witness.
    **options
        Named arguments of the metric, as ``forces="each"``.

    Returns
    -------
    QualityMap
        Frozen; ``plot()`` draws it.

    Raises
    ------
    OptionError
        If an option is none of these, or the set has no focus cell.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> block = rl.Polygon([(0, 0), (8, 0), (8, 3), (0, 3)])
    >>> pair = rl.build_switching_graph(block, friction=0.5).sets[0]
    >>> found = rl.quality.quality_map(pair, "epsilon", samples=33)
    >>> found, found.grasp(*found.best).edges.tolist()
    (<QualityMap: epsilon over u0, u2, 33 x 33>, [0, 2])
    """
    chosen = metric_of(metric, options)
    if isinstance(samples, bool) or not isinstance(samples, (int, np.integer)) or samples < 2:
        raise OptionError(f"samples must be an integer of at least 2, got {samples!r}")
    if over == "contacts":
        return _over_contacts(grasp_set, chosen, int(samples), fixed)
    if over != "focus":
        raise OptionError(f'over must be "contacts" or "focus", got {over!r}')
    if fixed is not None:
        raise OptionError('fixed is for over="contacts": a focus point leaves nothing to fix')
    return _over_focus(grasp_set, chosen, int(samples))


# --- contact space ------------------------------------------------------------------------------


def _over_contacts(
    grasp_set: GraspSet, metric: Metric, samples: int, fixed: Mapping[str, float] | None
) -> QualityMap:
    names = grasp_set.names
    lengths = grasp_set.torque.cones.whole.lengths[list(grasp_set.edges)]
    at = _fixed(grasp_set, lengths, fixed)
    shown = [i for i, name in enumerate(names) if name not in at]
    sides = lengths[shown]
    counts = np.maximum(2, np.round(samples * sides / sides.max())).astype(int)
    x, y = (np.linspace(0.0, side, n) for side, n in zip(sides, counts, strict=True))
    fractions = np.zeros((len(y), len(x), len(names)))
    for i, name in enumerate(names):
        fractions[..., i] = at.get(name, 0.0) / lengths[i]
    fractions[..., shown[0]] = np.linspace(0.0, 1.0, len(x))
    fractions[..., shown[1]] = np.linspace(0.0, 1.0, len(y))[:, None]
    flat = fractions.reshape(-1, len(names))
    values = values_of(grasp_set, metric, flat).reshape(fractions.shape[:2])
    within = inside(grasp_set, flat).reshape(fractions.shape[:2])
    axes = names[shown[0]], names[shown[1]]
    return QualityMap(grasp_set, metric, "contacts", axes, x, y, values, within, fractions, at)


def _fixed(
    grasp_set: GraspSet, lengths: FloatArray, fixed: Mapping[str, float] | None
) -> dict[str, float]:
    """The position of the contact that is fixed, if there are three."""
    names = grasp_set.names
    spare = len(names) - 2
    if fixed is None:
        fixed = dict(zip(names[2:], grasp_set.witness.positions[2:].tolist(), strict=True))
    if len(fixed) != spare or not set(fixed) <= set(names):
        raise OptionError(
            f"fixed has to name {spare} of the contacts {', '.join(names)}, got {list(fixed)}"
        )
    for name, position in fixed.items():
        length = float(lengths[names.index(name)])
        if not isinstance(position, (int, float, np.number)) or not 0 <= position <= length:
            raise OptionError(f"{name} = {position!r} is not on its edge, from 0 to {length:g}")
    return {name: float(position) for name, position in fixed.items()}


# --- focus cells --------------------------------------------------------------------------------


def _over_focus(grasp_set: GraspSet, metric: Metric, samples: int) -> QualityMap:
    cell, cones = grasp_set.focus_cell, grasp_set.torque.cones
    if cell is None:
        raise OptionError(
            f"a {grasp_set.kind} set has no focus cell: a concurrent or two-finger does "
            '(sets="chapter"); over="contacts" maps any set'
        )
    if grasp_set.limited is not None or cones.whole is not cones:
        raise OptionError('focus cells are mapped for hands without limits: use over="contacts"')
    low, high = _window(grasp_set)
    counts = np.maximum(2, np.round(samples * (high - low) / (high - low).max())).astype(int)
    x, y = (np.linspace(low[i], high[i], counts[i]) for i in (0, 1))
    points = np.stack(np.meshgrid(x, y), axis=-1)
    flat = points.reshape(-1, 2)
    within = np.zeros(len(flat), dtype=bool)
    for piece in range(len(cell)):
        within |= cell.take(np.full(len(flat), piece)).margins(flat) > 0
    fractions = _middles(grasp_set, flat)
    values = np.full(len(flat), np.nan)
    if within.any():
        values[within] = values_of(grasp_set, metric, fractions[within])
    shape = points.shape[:2]
    grid = values.reshape(shape), within.reshape(shape), fractions.reshape(*shape, -1)
    return QualityMap(grasp_set, metric, "focus", ("x", "y"), x, y, *grid, {})


def _window(grasp_set: GraspSet) -> tuple[FloatArray, FloatArray]:
    """The lower left and upper right corner of what is near the object of a focus cell."""
    polygon, cell = grasp_set.polygon, grasp_set.focus_cell
    assert cell is not None
    around = _BESIDE * polygon.diameter
    low, high = polygon.bounds[:2] - around, polygon.bounds[2:] + around
    from regrasp_lp.polytopes import corners  # brings scipy's hulls

    points = np.concatenate([np.zeros((0, 2)), *corners(cell)])
    if len(points):
        low, high = np.maximum(low, points.min(axis=0)), np.minimum(high, points.max(axis=0))
    if not (low < high).all():
        raise OptionError(
            f"the focus cell of edges {grasp_set.edges} is too thin, or too far from the object, "
            'to be sampled: use over="contacts"'
        )
    return low, high


def _middles(grasp_set: GraspSet, points: FloatArray) -> FloatArray:
    """Fractions of the middles of the independent contact regions at points, shape (N, m).

    As `regrasp_lp.grasp_sets.focus.independent_regions`, of many points.
    """
    cones, edges = grasp_set.torque.cones, np.array(grasp_set.edges)
    if len(edges) == 3:
        d = cones.unit_rays[np.stack((2 * edges, 2 * edges + 1), axis=1)]
    else:
        d = np.stack([common_cone_rays(cones, int(edges[1]), [int(edges[0])] * 2)] * 2)
    t = cones.vectors[edges][:, None, :]
    from_start = (points[:, None] - cones.starts[edges])[:, :, None, :]
    ends = np.clip(cross(from_start, d) / cross(t, d), 0.0, 1.0)
    return np.asarray(ends.mean(axis=2))
