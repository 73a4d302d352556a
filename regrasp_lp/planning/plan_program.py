"""The linear program of a plan's own steps: what limits its margin, and at which prices.

A finger that stays somewhere, from one move of it to the next, is one variable, unless it is there
at the start or in the goal. Each held grasp gives two rows, of the functions M_k and M_j that
attain its margin. So does each slide, at both ends, if it is inside one piece as far as that
matters; else the functions that are greatest on parts of it, at both ends of these. Fingers on
one edge keep their order. Then

    max ε   s.t.   M_k - s_k ε >= 0 >= M_j + s_j ε   (all moments),   0 <= u <= l ,

is the best that moving the chosen contacts can do as long as the same functions count. Its
multipliers are prices: by how much the best margin changes per shift of a row. Where a hand may
not touch all of an edge the box is what it may touch; limits to the distance between two of its
fingers are no rows here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from regrasp_lp.contact import Contact
from regrasp_lp.errors import NotForceClosureError
from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.pieces import Measure
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.planning.along import crossings, least_along
from regrasp_lp.planning.limits import ConeLimit, EndLimit, Limit, Limits, Line, MeetLimit
from regrasp_lp.planning.regions import touchable_part
from regrasp_lp.planning.steps import Place, Slide
from regrasp_lp.torque import TorqueFunctions

if TYPE_CHECKING:
    from regrasp_lp.planning.plan import Plan, Support

_EQUAL = 1e-9
"""Part of the object's size by which slacks count as none; prices below it are none."""


def limits_of(plan: Plan, measure: Measure = "margin") -> Limits:
    """Return what limits the margin, or the tolerance, of a plan.

    Parameters
    ----------
    plan : Plan
    measure : {"margin", "tolerance"}
        For the tolerance rows are scaled by w instead of s, and ``u >= δ``, ``u <= l - δ`` are
        rows for every supporting finger.

    Returns
    -------
    Limits

    Raises
    ------
    NotForceClosureError
        If the supporting fingers' friction cones cannot balance each other somewhere.
    SolverError
        If the multipliers do not prove the optimum.
    """
    program = PlanProgram.of(plan, measure)
    least, tight = program.tight()
    values = program.values()
    chosen = min((values[i] for i in program.moving if program.rows[i].scale > 0), default=np.inf)
    best, priced = (np.inf, []) if chosen == np.inf else program.solve()
    return Limits(measure, least, tight, chosen, best, tuple(priced))


def tight_limits(plan: Plan, measure: Measure = "margin") -> tuple[float, tuple[Limit, ...]]:
    """Return the least margin, or tolerance, of a plan, and what attains it; nothing is solved."""
    return PlanProgram.of(plan, measure).tight()


# --- the program --------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Stay:
    """A finger at one place, from one move of it to the next, and after which steps."""

    finger: int
    contact: Contact
    given: bool
    after: tuple[int, ...]


@dataclass(frozen=True)
class _Row:
    """``constant + Σ coefficient · f - scale ε >= 0`` over the fractions of stays; lengths."""

    coefficients: Mapping[int, float]
    constant: float
    scale: float
    limit: Limit


def _stays(plan: Plan) -> tuple[list[_Stay], list[dict[int, int]]]:
    """The stays, and which one each touching finger is in at the start and after each step."""
    contacts: list[tuple[int, Contact]] = []
    after: list[list[int]] = []
    where: list[dict[int, int]] = []
    for i, grasp in enumerate(plan.grasps):
        step = plan.steps[i - 1] if i else None
        now: dict[int, int] = {}
        for finger, contact in grasp.contacts.items():
            kept = where[-1].get(finger) if where else None
            moved = (isinstance(step, Slide) and finger in step.moves) or (
                isinstance(step, Place) and finger == step.finger
            )
            if kept is None or moved:
                kept = len(contacts)
                contacts.append((finger, contact))
                after.append([])
            after[kept].append(i)
            now[finger] = kept
        where.append(now)
    given = {*where[0].values(), *where[-1].values()}
    stays = [
        _Stay(finger, contact, number in given, tuple(steps))
        for number, ((finger, contact), steps) in enumerate(zip(contacts, after, strict=True))
    ]
    return stays, where


@dataclass(frozen=True, eq=False)
class PlanProgram:
    """The linear program of a plan, over the fractions of its stays."""

    plan: Plan
    measure: Measure
    stays: list[_Stay]
    where: list[dict[int, int]]
    rows: list[_Row] = field(default_factory=list)
    _known: dict[object, int] = field(default_factory=dict)

    @classmethod
    def of(cls, plan: Plan, measure: Measure) -> PlanProgram:
        """Return the program with all its rows."""
        program = cls(plan, measure, *_stays(plan))
        for i, grasp in enumerate(plan.grasps):
            program._add_rest(i, grasp.support)
            program._add_order(i)
        for i, slide in enumerate(plan.slides):
            if slide is not None:
                program._add_slide(i, plan.supports[i], *slide)
        return program

    # --- rows

    def _add(self, row: _Row) -> None:
        """Add a row; one that is there already holds at more moments."""
        used = {stay: value for stay, value in row.coefficients.items() if value != 0}
        key = (tuple(sorted(used.items())), row.constant, row.scale)
        known = self._known.setdefault(key, len(self.rows))
        if known == len(self.rows):
            self.rows.append(replace(row, coefficients=used))
        else:
            old = self.rows[known]
            moments = tuple(sorted({*old.limit.moments, *row.limit.moments}))
            self.rows[known] = replace(old, limit=replace(old.limit, moments=moments))

    def _add_cone(
        self,
        functions: TorqueFunctions,
        column: int,
        sign: int,
        support: Support,
        parts: list[tuple[float, dict[int, int]]],
        moment: tuple[int, bool],
    ) -> None:
        """A function that has to keep its sign at a place between those of some moments."""
        coefficients: dict[int, float] = {}
        for weight, where in parts:
            for finger, slope in zip(support.fingers, functions.slopes[0, column], strict=True):
                stay = where[finger]
                coefficients[stay] = coefficients.get(stay, 0.0) + sign * weight * float(slope)
        lines = []
        for t in range(3):
            ray, slot = int(functions.ray[0, column, t]), int(functions.slot[0, column, t])
            if ray >= 0:
                side = "counter-clockwise" if ray % 2 else "clockwise"
                share = float(functions.weight[0, column, t] / functions.scale[0, column])
                edge = int(functions.edges[0, slot])
                lines.append(Line(support.fingers[slot], edge, side, share))
        scale = 1.0 if self.measure == "margin" else float(functions.rates[0, column])
        constant = sign * float(functions.offsets[0, column])
        self._add(_Row(coefficients, constant, scale, ConeLimit((moment,), sign, tuple(lines))))

    def _heights(self, functions: TorqueFunctions, f: FloatArray) -> FloatArray:
        """Values of the functions over their scales, NaN for padding."""
        values = functions.certain_values(f)[0]
        if self.measure == "tolerance":
            values = values / functions.rates[0]
        return np.where(functions.valid[0], values, np.nan)

    def _add_rest(self, i: int, support: Support) -> None:
        """The two rows of a held grasp, and those of the ends of edges."""
        functions, f = self.plan.torques(self.plan.grasps[i].contacts, support)
        if not functions.spans[0]:
            raise NotForceClosureError(
                f"after step {i} the friction cones of fingers "
                f"{', '.join(map(str, support.fingers))} cannot balance each other: "
                "plan.verify() tells what is wrong with the plan"
            )
        where = self.where[i]
        for sign in (1, -1):
            column = int(np.nanargmax(sign * self._heights(functions, f)))
            self._add_cone(functions, column, sign, support, [(1.0, where)], (i, False))
        if self.measure == "tolerance":
            limited = self.plan.touchable is not self.plan.touchable.whole
            for finger in where if limited else support.fingers:
                edge, (low, high) = (
                    self.stays[where[finger]].contact.edge,
                    self._part(where[finger]),
                )
                length = float(self.plan.polygon.edge_lengths[edge])
                for name, end, slope in (("start", -low, length), ("end", high, -length)):
                    limit = EndLimit(((i, False),), finger, edge, name)
                    self._add(_Row({where[finger]: slope}, end * length, 1.0, limit))

    def _add_slide(
        self, i: int, support: Support, functions: TorqueFunctions, f: FloatArray, g: FloatArray
    ) -> None:
        """Of each sign one function at both ends, or each that is greatest, where it is."""
        size, places = self.plan.cones.size, (self.where[i], self.where[i + 1])
        numbers = np.flatnonzero(functions.valid[0])
        for sign in (1, -1):
            start, end = (sign * self._heights(functions, x)[numbers] for x in (f, g))
            lowest = np.minimum(start, end)
            t = np.array([0.0, 1.0])
            columns = np.array([lowest.argmax()])
            if lowest.max() < least_along(start, end) - _EQUAL * size:
                t = np.unique(np.concatenate((t, crossings(start, end))))
                middles = (t[:-1] + t[1:]) / 2
                columns = (np.outer(start, 1 - middles) + np.outer(end, middles)).argmax(axis=0)
            for column, ends in zip(numbers[columns].tolist(), pairwise(t.tolist()), strict=True):
                for time in ends:
                    parts = [(1 - time, places[0]), (time, places[1])]
                    self._add_cone(functions, column, sign, support, parts, (i + 1, True))

    def _add_order(self, i: int) -> None:
        """Fingers on one edge do not pass each other."""
        ordered = sorted(
            self.where[i].items(),
            key=lambda item: (self.stays[item[1]].contact.edge, self._fraction(item[1])),
        )
        for (one, here), (other, there) in pairwise(ordered):
            edge = self.stays[here].contact.edge
            if edge == self.stays[there].contact.edge:
                length = float(self.plan.polygon.edge_lengths[edge])
                limit = MeetLimit(((i, False),), (one, other), edge)
                self._add(_Row({here: -length, there: length}, 0.0, 0.0, limit))

    # --- values and prices

    def _fraction(self, stay: int) -> float:
        fraction = self.stays[stay].contact.fraction
        assert fraction is not None  # contacts of plans are resolved
        return fraction

    def _part(self, stay: int) -> tuple[float, float]:
        """From which to which fraction of its edge a finger may be."""
        return touchable_part(self.plan, self.stays[stay].finger, self.stays[stay].contact)

    @property
    def free(self) -> list[int]:
        """The stays that could be elsewhere."""
        return [number for number, stay in enumerate(self.stays) if not stay.given]

    @property
    def moving(self) -> list[int]:
        """The rows that depend on these."""
        return [
            number
            for number, row in enumerate(self.rows)
            if any(not self.stays[stay].given for stay in row.coefficients)
        ]

    def values(self) -> list[float]:
        """What each row leaves in the plan as it is, per scale; inf where that is 0."""
        left = [
            row.constant + sum(v * self._fraction(s) for s, v in row.coefficients.items())
            for row in self.rows
        ]
        pairs = zip(left, self.rows, strict=True)
        return [value / row.scale if row.scale > 0 else np.inf for value, row in pairs]

    def tight(self) -> tuple[float, tuple[Limit, ...]]:
        """The least of these, and what attains it."""
        values = self.values()
        least = min(values)
        reach = least + _EQUAL * self.plan.cones.size
        pairs = zip(values, self.rows, strict=True)
        return least, tuple(row.limit for value, row in pairs if value <= reach)

    def sets(self) -> LinearSets:
        """The rows that depend on what is free as a linear set, in the object's size."""
        column = {stay: n for n, stay in enumerate(self.free)}
        moving, size = self.moving, self.plan.cones.size
        rows, bounds = np.zeros((1, len(moving), len(column))), np.zeros((1, len(moving)))
        for r, number in enumerate(moving):
            bounds[0, r] = self.rows[number].constant / size
            for stay, value in self.rows[number].coefficients.items():
                if stay in column:
                    rows[0, r, column[stay]] = -value / size
                else:
                    bounds[0, r] += value * self._fraction(stay) / size
        scales = np.array([[self.rows[number].scale for number in moving]])
        names = tuple(f"f{stay}" for stay in column)
        lower, upper = np.array([self._part(stay) for stay in column]).reshape(1, -1, 2).T
        return LinearSets(names, rows, scales, bounds, lower.T, upper.T)

    def solve(self) -> tuple[float, list[Limit]]:
        """The optimum, and the rows and ends of edges that have a price there."""
        from regrasp_lp.lp.prices import priced_optimum  # solvers are not needed for `tight`

        optimum, size = priced_optimum(self.sets()), self.plan.cones.size
        found = [
            replace(self.rows[number].limit, price=float(price))
            for number, price in zip(self.moving, optimum.rows, strict=True)
        ]
        for n, stay in enumerate(self.stays[number] for number in self.free):
            moments = tuple((i, False) for i in stay.after)
            unit = size / float(self.plan.polygon.edge_lengths[stay.contact.edge])
            for name, price in (("start", optimum.lower[n]), ("end", optimum.upper[n])):
                limit = EndLimit(moments, stay.finger, stay.contact.edge, name, float(price) * unit)
                found.append(limit)
        found = [limit for limit in found if limit.price > _EQUAL]
        return optimum.margin * size, sorted(found, key=lambda limit: -limit.price)
