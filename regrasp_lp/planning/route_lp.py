"""The cheapest contacts along a route, or along the beginning of one: a linear program.

Inside a grasp set the shortest slide is as long as if nothing were in the way (`shortest_slide`),
so a route has two grasps a set, the arriving and the leaving one, and its travel is the sum of
``|y_i - x_i|`` over these. Each of them has to be in its set: *some* function at -ε or below *and*
some at ε or above. Such a choice among rows is left open until the optimum breaks it: without it
the program is a relaxation, so that its bound holds for all choices together.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import csr_matrix

from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.lp.linear_program import minimise
from regrasp_lp.planning.set_rows import SetRows, set_rows

MET = 1e-8
"""By how much of the object's size a chosen row may be broken."""

Slots = tuple[tuple[int, int], ...]
"""Held contacts as places in the one set and in the other."""

_Slide = tuple[int, int, float, float]
"""Variables at both ends (-1: given), the way between what is given, length of the edge."""


@dataclass(frozen=True, eq=False)
class Terminal:
    """A set that holds the start or the goal, or some of its contacts.

    Parameters
    ----------
    index : int
    fractions : numpy.ndarray, shape (m,)
        Of the set's contacts, in its order.
    placed : int
        Of a goal, how many of its contacts are placed when the set has its own.
    most : (float, float)
        Margin and tolerance of these contacts, in the object's size, where they are only some of
        the start or the goal: to rest on them is a choice. inf where they are given.
    """

    index: int
    fractions: FloatArray
    placed: int = 0
    most: tuple[float, float] = (np.inf, np.inf)


@dataclass(frozen=True)
class Route:
    """A beginning of a route, or a whole one.

    Parameters
    ----------
    path : tuple of int
        Grasp sets; twice the same in a row means that some of its fingers are placed anew.
    held : tuple of Slots
        Per switch, by places in the set before and in the set after it.
    choices : tuple of (int, int, int)
        A grasp (2 t arrives in set t, 2 t + 1 leaves it), one of the choices that its set leaves
        (`set_rows.Choice`), and the row chosen.
    still : bool
        Whether the start itself leaves the first set, without a slide.
    rest : bool
        Whether the goal itself arrives in the last set.
    origin : int
        Which of the starts it comes from.
    aim : int
        Which of the goals is reached; -1 if the last grasp only arrives in the last set.
    """

    path: tuple[int, ...]
    held: tuple[Slots, ...] = ()
    choices: tuple[tuple[int, int, int], ...] = ()
    still: bool = False
    rest: bool = False
    origin: int = 0
    aim: int = -1

    @property
    def ended(self) -> bool:
        """Whether a goal is reached."""
        return self.aim >= 0

    def switched(self, index: int, held: Slots) -> Route:
        """Return the route one set longer."""
        return replace(self, path=(*self.path, index), held=(*self.held, held))

    def choosing(self, grasp: int, choice: int, row: int) -> Route:
        """Return the route with one more row."""
        return replace(self, choices=(*self.choices, (grasp, choice, row)))


@dataclass(frozen=True, eq=False)
class Contacts:
    """The best contacts of a route under the choices made so far.

    Parameters
    ----------
    grasps : list of numpy.ndarray, shape (m,)
        Fractions, arriving and leaving in turn, those of the start and the goal included.
    value, bound : float
        The cost without placements, and what no choice of contacts is below.
    levels : numpy.ndarray, shape (2,)
        Margin and tolerance in the object's size.
    broken : tuple of (int, int, list of int), optional
        A grasp and a choice none of whose rows holds, and the rows, the nearest first.
    """

    grasps: list[FloatArray]
    value: float
    bound: float
    levels: FloatArray
    broken: tuple[int, int, list[int]] | None


@dataclass(frozen=True, eq=False)
class RoutePrograms:
    """The programs of all routes under one objective.

    Parameters
    ----------
    sets : GraspSets
    starts, goals : tuple of Terminal
    weights : numpy.ndarray, shape (3,)
        Of travel, margin and tolerance, all in the object's size.
    least, most : numpy.ndarray, shape (2,)
        Bounds of margin and tolerance; most = least where there is nothing to gain.
    onwards : numpy.ndarray, shape (N, 2), optional
        What margin and tolerance are at most on any way on from each set.
    """

    sets: GraspSets
    starts: tuple[Terminal, ...]
    goals: tuple[Terminal, ...]
    weights: FloatArray
    least: FloatArray
    most: FloatArray
    onwards: FloatArray | None = None
    _known: dict[int, SetRows] = field(default_factory=dict, init=False, repr=False)

    def set_rows(self, index: int) -> SetRows:
        """Return what the grasps of a set satisfy."""
        if index not in self._known:
            columns = (0, 1) if self.most[1] > self.least[1] else (0,)
            margin = float(self.sets.margins[index])
            functions = self.sets.functions(index)
            self._known[index] = set_rows(functions, margin, columns, self.least, self.most)
        return self._known[index]

    def ends(self, route: Route) -> tuple[Terminal, ...]:
        """Return the start and, once it is reached, the goal of a route."""
        start = self.starts[route.origin]
        return (start, self.goals[route.aim]) if route.ended else (start,)

    def solve(self, route: Route) -> Contacts | None:
        """Return the best contacts, or None if multipliers prove that there are none.

        Raises
        ------
        SolverError
            If the program stays open.
        """
        layout = _Layout.of(self, route)
        return None if layout is None else layout.solve()

    def settled(self, route: Route, grasps: list[FloatArray], travel: float) -> Contacts | None:
        """Return the best contacts near known ones.

        Of all choices the rows are taken that the known grasps satisfy best.

        Parameters
        ----------
        route : Route
            Whole.
        grasps : list of numpy.ndarray, shape (m,)
            Arriving and leaving in turn.
        travel : float
            In the object's size, not to be exceeded.

        Returns
        -------
        Contacts or None
            None where rounding forbids it, or where a set has no grasp as good as `least`.
        """
        layout = _Layout.of(self, replace(route, choices=()))
        if layout is None:
            return None
        for grasp in layout.free:
            for number, choice in enumerate(self.set_rows(route.path[grasp // 2]).choices):
                slack = choice.slack(grasps[grasp])
                if not slack.size:
                    return None
                route = layout.route.choosing(grasp, number, int(slack.argmax()))
                layout = replace(layout, route=route)
        return layout.solve(travel)


@dataclass(frozen=True, eq=False)
class _Layout:
    """Which variable each contact of a route is, or which fraction it has."""

    programs: RoutePrograms
    route: Route
    ids: list[IntArray]  # per grasp; -1 where it is given
    given: list[FloatArray]
    free: list[int]  # grasps that have to be in their set
    count: int

    @classmethod
    def of(cls, programs: RoutePrograms, route: Route) -> _Layout | None:
        """Number the contacts; None if given ones that are held would have to move."""
        ids: list[IntArray] = []
        given: list[FloatArray] = []
        free: list[int] = []
        count, last = 0, len(route.path) - 1
        for t, index in enumerate(route.path):
            m = len(programs.set_rows(index).lengths)
            for side in (0, 1) if t < last or route.ended else (0,):
                grasp, fixed = np.full(m, -1), np.full(m, np.nan)
                new = np.ones(m, dtype=bool)
                if (t, side) == (0, 0) or (t == 0 and route.still):
                    fixed, new = programs.starts[route.origin].fractions, ~new
                elif (t, side) == (last, 1):
                    fixed, new = programs.goals[route.aim].fractions, ~new
                else:
                    free.append(2 * t + side)
                    for here, there in route.held[t - 1] if side == 0 else ():
                        grasp[there], fixed[there] = ids[-1][here], given[-1][here]
                        new[there] = False
                grasp[new] = count + np.arange(new.sum())
                count += int(new.sum())
                ids.append(grasp)
                given.append(fixed)
        layout = cls(programs, route, ids, given, free, count)
        return layout._at_rest() if route.rest else layout

    def _at_rest(self) -> _Layout | None:
        """The same with the goal arriving in the last set."""
        goal, arriving = self.given[-1], len(self.ids) - 2
        ids, given = self.ids, self.given
        for slot, value in enumerate(goal.tolist()):
            variable = ids[arriving][slot]
            if variable < 0 and given[arriving][slot] != value:
                return None
            for one, fixed in zip(ids, given, strict=True):
                same = (one == variable) & (variable >= 0)
                one[same], fixed[same] = -1, value
        return replace(self, free=[g for g in self.free if g != arriving])

    def solve(self, travel: float = np.inf) -> Contacts | None:
        """As `RoutePrograms.solve`, with no more than some travel."""
        weights, n = self.programs.weights, self.count
        slides, length = self._slides()
        rows, limits = self._matrix(slides)
        if np.isfinite(travel):
            rows = np.vstack((rows, np.append(np.zeros(n + 2), np.ones(len(slides)))))
            limits = np.append(limits, travel - length)
        cost = np.concatenate((np.zeros(n), -weights[1:], np.full(len(slides), weights[0])))
        longest = max((scale for *_, scale in slides), default=0.0)
        lower = np.concatenate((np.zeros(n), self.programs.least, np.zeros(len(slides))))
        upper = np.concatenate((np.ones(n), self._most(), np.full(len(slides), longest)))
        if (upper < lower).any():
            return None
        found = minimise(cost, csr_matrix(rows), limits, lower, upper)
        if found is None:
            return None
        padded = np.append(found.point[:n], np.nan)
        grasps = [np.where(i >= 0, padded[i], f) for i, f in zip(self.ids, self.given, strict=True)]
        levels = found.point[n : n + 2]
        constant = float(weights[0]) * length
        broken = self._broken(grasps, levels)
        return Contacts(grasps, found.value + constant, found.bound + constant, levels, broken)

    def _matrix(self, slides: list[_Slide]) -> tuple[FloatArray, FloatArray]:
        """Rows over the contacts, margin, tolerance and the lengths of the slides."""
        n = self.count
        blocks = [block for grasp in self.free for block in self._rows(grasp)]
        height = sum(len(bounds) for _, _, bounds, _ in blocks) + 2 * len(slides)
        rows, limits = np.zeros((height, n + 2 + len(slides))), np.zeros(height)
        row = 0
        for columns, matrix, bounds, level in blocks:
            part = slice(row, row + len(bounds))
            rows[part, columns] = matrix
            if level >= 0:
                rows[part, n + level] = 1.0
            limits[part] = bounds
            row += len(bounds)
        for number, (start, end, offset, scale) in enumerate(slides):
            for sign in (1.0, -1.0):
                for variable, way in ((start, -sign), (end, sign)):
                    if variable >= 0:
                        rows[row, variable] = way * scale
                rows[row, n + 2 + number] = -1.0
                limits[row] = -sign * offset
                row += 1
        return rows, limits

    def _most(self) -> FloatArray:
        """What margin and tolerance are at most, in these sets and on the way on."""
        route, onwards = self.route, self.programs.onwards
        bounds = [self.programs.most, *(self._set(grasp).most for grasp in self.free)]
        bounds += [np.array(end.most) for end in self.programs.ends(route)]
        if not route.ended and onwards is not None:
            bounds.append(onwards[route.path[-1]])
        return np.asarray(np.min(bounds, axis=0))

    def _set(self, grasp: int) -> SetRows:
        return self.programs.set_rows(self.route.path[grasp // 2])

    def _rows(self, grasp: int) -> list[tuple[IntArray, FloatArray, FloatArray, int]]:
        """Columns, matrix, bounds and level of the rows that a grasp has to satisfy."""
        of_set, ids, given = self._set(grasp), self.ids[grasp], self.given[grasp]
        free = ids >= 0
        known = np.where(free, 0.0, given)
        parts = [(of_set.rows, of_set.bounds, -1)] if len(of_set.rows) else []
        for g, choice, row in self.route.choices:
            if g == grasp:
                chosen = of_set.choices[choice]
                parts.append((chosen.rows[[row]], chosen.bounds[[row]], chosen.column))
        if len(of_set.to_ends):
            ends = np.diag(of_set.to_ends)
            parts.append((-ends, np.zeros(len(ends)), 1))
            parts.append((ends, of_set.to_ends, 1))
        return [(ids[free], a[:, free], b - a @ known, level) for a, b, level in parts]

    def _slides(self) -> tuple[list[_Slide], float]:
        """The contacts that may slide, and the way of those whose ends are given."""
        slides, length = [], 0.0
        for t, index in enumerate(self.route.path):
            if 2 * t + 1 >= len(self.ids):
                break
            lengths = self.programs.set_rows(index).lengths.tolist()
            sides = [(self.ids[g].tolist(), self.given[g].tolist()) for g in (2 * t, 2 * t + 1)]
            for slot, scale in enumerate(lengths):
                (start, f), (end, g) = ((ids[slot], at[slot]) for ids, at in sides)
                offset = scale * ((0.0 if end >= 0 else g) - (0.0 if start >= 0 else f))
                if start < 0 and end < 0:
                    length += abs(offset)
                else:
                    slides.append((start, end, offset, scale))
        return slides, length

    def _broken(
        self, grasps: list[FloatArray], levels: FloatArray
    ) -> tuple[int, int, list[int]] | None:
        """The choice that is broken most."""
        worst, found = MET, None
        made = {choice[:2] for choice in self.route.choices}
        for grasp in self.free:
            for number, choice in enumerate(self._set(grasp).choices):
                if (grasp, number) in made:
                    continue
                slack = choice.slack(grasps[grasp]) - levels[choice.column]
                if -slack.max(initial=-np.inf) > worst:
                    worst = -float(slack.max(initial=-np.inf))
                    found = grasp, number, np.argsort(-slack, kind="stable").tolist()
        return found
