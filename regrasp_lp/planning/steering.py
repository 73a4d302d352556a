"""What steers a search without another graph: weights of switches, and grasp sets to avoid."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import BoolArray, FloatArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.planning.objective import Objective

Weight: TypeAlias = Callable[[int, int, Mapping[str, Any]], float | None]
"""The weight of the switch from one set to another, or None to hide it."""

Avoid: TypeAlias = Iterable[int]
"""Numbers of edges, or of sets."""


@dataclass(frozen=True, eq=False)
class Steering:
    """What steers a search in the sets of one object.

    Parameters
    ----------
    through : numpy.ndarray of bool, shape (N,), optional
        The sets that a plan may pass through; all of them by default.
    weigh : SwitchWeights, optional
        What a plan has as little of as can be, instead of placements.
    """

    through: BoolArray | None = None
    weigh: SwitchWeights | None = None

    @classmethod
    def of(
        cls,
        sets: GraspSets,
        objective: Objective,
        weight: Weight | None = None,
        avoid_edges: Avoid = (),
        avoid_sets: Avoid = (),
    ) -> Steering:
        """Return what a user asks for.

        Parameters
        ----------
        sets : GraspSets
        objective : Objective
        weight : callable, optional
        avoid_edges, avoid_sets : iterable of int

        Raises
        ------
        OptionError
            If there is no such edge or set, or a weight that is no function or has no meaning with
            the objective.
        """
        if weight is not None and not callable(weight):
            raise OptionError(
                f"weight must be a function of (u, v, data) or None, got {weight!r}; weights of "
                "objectives are given as objective={name: weight}"
            )
        if weight is not None and objective.name != "placements":
            raise OptionError(
                'weight takes the place of objective="placements" and means nothing with '
                f"objective={objective.name!r}: leave one of them out"
            )
        edges = checked_numbers(
            "avoid_edges", avoid_edges, sets.polygon.n_edges, "the polygon has edges"
        )
        others = checked_numbers("avoid_sets", avoid_sets, len(sets), "the graph has sets")
        weigh = None if weight is None else SwitchWeights(sets, weight)
        if not edges and not others:
            return cls(None, weigh)
        through = ~np.concatenate(
            [np.isin(sets.cones.edge[f.edges], edges).any(axis=1) for f in sets.sources]
        )
        through[others] = False
        return cls(through, weigh)

    @property
    def free(self) -> bool:
        """Whether there is nothing that steers."""
        return self.through is None and self.weigh is None


FREE = Steering()
"""Nothing steers."""


@dataclass(frozen=True, eq=False)
class SwitchWeights:
    """The weights that a function of a user's gives to switches, each asked for once.

    Parameters
    ----------
    sets : GraspSets
    weight : callable
        Of (u, v, data), with the attributes of set v and of the switch as
        `SwitchingGraph.to_networkx` has them: ``held``, ``kind``, ``edges``, ``center``,
        ``margin``.
    """

    sets: GraspSets
    weight: Weight
    _known: dict[int, FloatArray] = field(default_factory=dict)

    def __call__(self, index: int, others: IntArray, held: IntArray) -> FloatArray:
        """Return the weights of the switches from a set to all others, inf for hidden ones.

        Parameters
        ----------
        index : int
        others, held : numpy.ndarray of int, shape (K,)
            All sets that can be switched to, and the largest number of contacts held.

        Raises
        ------
        OptionError
            If a weight is no number >= 0.
        """
        if index not in self._known:
            pairs = zip(others.tolist(), held.tolist(), strict=True)
            self._known[index] = np.array([self._checked(index, v, h) for v, h in pairs])
        return self._known[index]

    def _checked(self, u: int, v: int, held: int) -> float:
        given = self.weight(u, v, {"held": held, **self._attributes[v]})
        if given is None:
            return math.inf
        real = isinstance(given, numbers.Real) and not isinstance(given, (bool, np.bool_))
        value = float(given) if real else math.nan
        if not (math.isfinite(value) and value >= 0):
            here, there = (self._attributes[i]["edges"] for i in (u, v))
            raise OptionError(
                f"the weight of the switch from set {u} (edges {here}) to set {v} (edges {there}) "
                f"must be a number >= 0, or None to hide the switch, got {given!r}"
            )
        return value

    @cached_property
    def _attributes(self) -> list[dict[str, Any]]:
        found = []
        edge = self.sets.cones.edge
        for family in self.sets.families:
            rows = zip(
                edge[family.functions.edges].tolist(),
                family.centers.tolist(),
                family.margins.tolist(),
                strict=True,
            )
            found += [
                {
                    "kind": family.kind,
                    "edges": tuple(edges),
                    "center": None if center < 0 else int(edge[center]),
                    "margin": margin,
                }
                for edges, center, margin in rows
            ]
        return found


def checked_numbers(name: str, given: Avoid, count: int, what: str) -> list[int]:
    """Return numbers of edges or sets; raise OptionError if one of them is none."""
    if not isinstance(given, Iterable) or isinstance(given, str):
        raise OptionError(f"{name} must be numbers, got {given!r}")
    found = []
    for number in given:
        whole = isinstance(number, numbers.Integral) and not isinstance(number, bool)
        if not whole or not 0 <= number < count:
            raise OptionError(f"{name} has {number!r}, but {what} 0 to {count - 1}")
        found.append(int(number))
    return found
