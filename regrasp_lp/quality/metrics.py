"""The metrics by name: what a set is searched for, and maps are drawn of."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.polygon import Polygon
from regrasp_lp.quality.focus import focus_distance
from regrasp_lp.quality.friction_needed import required_friction
from regrasp_lp.quality.stability import margin, tolerance
from regrasp_lp.quality.wrenches import epsilon, hull_volume, load_factor, squeezing_force


@dataclass(frozen=True, eq=False)
class Metric:
    """A measure of grasps with the options it is called with.

    Parameters
    ----------
    name : str
    function : callable
        As all functions of `regrasp_lp.quality` that take a grasp.
    less_is_better : bool
    unit : str
        Of its values, for people: "length", "force" or "" of a pure number.
    options : mapping of str to object
        Named arguments of the function.
    """

    name: str
    function: Callable[..., Any]
    less_is_better: bool = False
    unit: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)

    def values(
        self, polygon: Polygon, friction: FloatArray, edges: IntArray, fractions: FloatArray
    ) -> FloatArray:
        """Return the values of grasps on one combination of edges.

        Parameters
        ----------
        polygon : Polygon
        friction : numpy.ndarray, shape (n_edges,)
        edges : numpy.ndarray of int, shape (m,)
        fractions : numpy.ndarray, shape (N, m)

        Returns
        -------
        numpy.ndarray, shape (N,)
        """
        every = np.broadcast_to(edges, fractions.shape)
        given = {"friction": friction, "edges": every, "fractions": fractions}
        return np.asarray(self.function(polygon, **given, **self.options))

    def goodness(self, values: FloatArray) -> FloatArray:
        """Return values such that the more is the better, whatever the metric."""
        return -values if self.less_is_better else values


_GIVEN = ("polygon", "grasp", "friction", "edges", "positions", "fractions")
"""Arguments that say which grasps; the others of a metric are its options."""

_METRICS = (
    Metric("margin", margin, unit="length"),
    Metric("tolerance", tolerance, unit="length"),
    Metric("epsilon", epsilon),
    Metric("hull_volume", hull_volume),
    Metric("load_factor", load_factor, unit="1/force"),
    Metric("required_friction", required_friction, less_is_better=True),
    Metric("squeezing_force", squeezing_force, less_is_better=True, unit="force"),
    Metric("focus_distance", focus_distance, less_is_better=True, unit="length"),
)


def metric_of(metric: str | Callable[..., Any], options: Mapping[str, Any]) -> Metric:
    """Return a metric by its name, or by its function.

    Parameters
    ----------
    metric : str or callable
        A name or function of this package, or a function of yours that is called in the same way
        (``f(polygon, friction=…, edges=…, fractions=…)``): the more the better, then.
    options : mapping of str to object
        Named arguments for it.

    Raises
    ------
    OptionError
        If there is none of that name, or it has no such argument.
    """
    for known in _METRICS:
        if metric in (known.name, known.function):
            _check_options(known, options)
            return replace(known, options=options)
    if callable(metric):
        return Metric(getattr(metric, "__name__", "metric"), metric, options=options)
    names = ", ".join(f'"{known.name}"' for known in _METRICS)
    raise OptionError(f"metric must be a function or one of {names}, got {metric!r}")


def _check_options(metric: Metric, options: Mapping[str, Any]) -> None:
    """Refuse arguments that a metric of ours does not have, or that the caller gives it."""
    parameters = inspect.signature(metric.function).parameters
    listed = [name for name in parameters if name not in _GIVEN]
    for name in options:
        if name not in listed:
            offered = f"its options are {', '.join(listed)}" if listed else "it has no options"
            raise OptionError(f"the metric {metric.name} has no option {name!r}: {offered}")
