"""What a plan is to be best in, and how good one is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regrasp_lp.errors import OptionError

if TYPE_CHECKING:
    from regrasp_lp.planning.plan import Plan

ObjectiveLike = str | Mapping[str, float]

NAMES = ("placements", "margin", "tolerance", "travel")

_MORE = ("margin", "tolerance")
"""Of these, more is better."""

_EQUAL = 1e-6
"""A value and a bound that differ by a smaller part are equal: programs are no more accurate."""


@dataclass(frozen=True)
class Objective:
    """One of the four objectives, or a weighted combination.

    Parameters
    ----------
    weights : tuple of (str, float)
        For a single objective its name and 1. A combination is a cost: weights times placements
        and travel, less weights times margin and tolerance.
    """

    weights: tuple[tuple[str, float], ...] = (("placements", 1.0),)

    @classmethod
    def of(cls, objective: ObjectiveLike | Objective) -> Objective:
        """Return an objective by its name, or from weights by name.

        Raises
        ------
        OptionError
            If a name is unknown or a weight is no number >= 0, or all are 0.

        Examples
        --------
        >>> Objective.of("margin").name
        'margin'
        >>> Objective.of({"placements": 1, "travel": 0.5}).weights
        (('placements', 1.0), ('travel', 0.5))
        """
        if isinstance(objective, Objective):
            return objective
        given = {objective: 1.0} if isinstance(objective, str) else objective
        if not isinstance(given, Mapping):
            raise OptionError(
                f"objective must be one of {_list(NAMES)} or weights by name, got {objective!r}"
            )
        for name, weight in given.items():
            if name not in NAMES:
                raise OptionError(f"objective must be one of {_list(NAMES)}, got {name!r}")
            number = isinstance(weight, (int, float, np.number)) and not isinstance(weight, bool)
            if not number or not (np.isfinite(weight) and weight >= 0):
                raise OptionError(
                    f"the weight of {name!r} must be a number >= 0, got {weight!r}: margin and "
                    "tolerance count as gains, placements and travel as costs"
                )
        weights = tuple((name, float(given[name])) for name in NAMES if given.get(name))
        if not weights:
            raise OptionError("all weights of the objective are 0: make one of them positive")
        return cls(weights)

    @property
    def name(self) -> str:
        """Its name, or "weighted"."""
        return self.weights[0][0] if len(self.weights) == 1 else "weighted"

    @property
    def signed(self) -> tuple[tuple[str, float], ...]:
        """The weights in a cost: more margin and tolerance make it less."""
        return tuple((name, -w if name in _MORE else w) for name, w in self.weights)

    @property
    def maximised(self) -> bool:
        """Whether more is better, and the bound an upper one."""
        return self.name in _MORE

    def value(self, plan: Plan) -> float:
        """Return how good a plan is: the quantity itself, or the cost of a combination."""
        quantities = {
            "placements": float(plan.placements),
            "margin": plan.chosen_margin,
            "tolerance": plan.chosen_tolerance,
            "travel": plan.travel,
        }
        if len(self.weights) == 1:
            return quantities[self.weights[0][0]]
        if not np.isfinite(plan.chosen_margin):  # nothing was chosen: what was given counts
            quantities.update(margin=plan.margin, tolerance=plan.tolerance)
        return self.cost(quantities)

    def cost(self, quantities: Mapping[str, float]) -> float:
        """Return the cost of a combination."""
        return sum(weight * quantities[name] for name, weight in self.signed)

    def gap(self, value: float, bound: float) -> float:
        """Return how far a value can be from the best one, at most; 0 within rounding."""
        if value == bound:  # both may be infinite
            return 0.0
        gap = float(bound - value if self.maximised else value - bound)
        if not np.isfinite(gap):
            return max(gap, 0.0)
        return 0.0 if gap <= _EQUAL * max(abs(value), abs(bound)) else gap


PLACEMENTS = Objective()
"""The fewest placements."""


def _list(names: tuple[str, ...]) -> str:
    return ", ".join(f'"{name}"' for name in names)
