"""A path with the fewest placements, without listing all grasp sets first.

For complete sets and a hand of four fingers switches that hold two contacts suffice: whatever
contains a force-closure grasp is in force closure, so that a switch from (a, b) to (c, d), say, is
no shorter than the one over (a, b, c) and (a, c, d) with the same contacts, and a passage through a
two-finger set no shorter than one between the triples around it. So the search runs over triples,
by numbers of switches, from both ends at once. It stops as soon as the two sides meet: in a set,
across a switch, or across a set in between; such sets share an edge pair with either side, and
are listed from these pairs.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.contact_rule import meet_held
from regrasp_lp.friction import Cones, FloatArray, IntArray, spanning
from regrasp_lp.grasp_sets.candidates import runs, two_finger_candidates
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.grasp_sets.vertices import solve_family
from regrasp_lp.lp import Solver
from regrasp_lp.margins import best_pieces
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.planner import PlanningProblem
from regrasp_lp.polygon import Polygon
from regrasp_lp.shadows import shadows
from regrasp_lp.switches import StoredSwitches, SwitchRule
from regrasp_lp.switching import meet
from regrasp_lp.torque import TorqueFunctions, torque_functions

_CHUNK = 200_000


def problem_on_demand(
    polygon: Polygon,
    cones: Cones,
    solver: Solver,
    start: Grasp,
    goal: Grasp,
    *,
    all_pairs: bool = False,
) -> PlanningProblem | None:
    """Return the planning problem that consists of the sets along one best path.

    Parameters
    ----------
    polygon : Polygon
    cones : Cones
    solver : Solver
    start, goal : Grasp
        Resolved grasps of 2 or 3 contacts in force closure.
    all_pairs : bool
        Add all two-finger sets: fingers that only reposition may do best to stay in these.

    Returns
    -------
    PlanningProblem or None
        For a hand of four fingers and complete sets; None if no path joins the two grasps.
    """
    path = path_on_demand(cones, np.sort(start.edges), np.sort(goal.edges))
    if path is None:
        return None
    return problem_over(polygon, cones, solver, path, all_pairs=all_pairs)


def problem_over(
    polygon: Polygon,
    cones: Cones,
    solver: Solver,
    combinations: Iterable[tuple[int, ...]],
    *,
    all_pairs: bool = False,
) -> PlanningProblem:
    """Return the planning problem of a hand of four fingers over some complete sets.

    Parameters
    ----------
    polygon : Polygon
    cones : Cones
    solver : Solver
    combinations : iterable of tuple of int
        Edges of the sets, ascending; all of them exist.
    all_pairs : bool
        Add all two-finger sets.
    """
    wanted = set(combinations)
    families = []
    for m, kind in ((2, "two_finger"), (3, "three_finger")):
        rows = sorted(edges for edges in wanted if len(edges) == m)
        edges = np.array(rows, dtype=np.intp).reshape(-1, m)
        if m == 2 and all_pairs:
            edges = np.unique(np.concatenate((edges, two_finger_candidates(cones))), axis=0)
        functions = torque_functions(cones, edges)
        families.append(solve_family(kind, functions, np.full(len(edges), -1), solver))
    sets = GraspSets(polygon, tuple(families))
    hand = Hand(4)
    switch_rule = SwitchRule(sets.sources, hand, partial(meet_held, solver=solver))
    switches = StoredSwitches.of_pairs(len(sets), switch_rule.pairs())
    return PlanningProblem(sets, switches, hand, cones.friction, solver)


def path_on_demand(cones: Cones, start: IntArray, goal: IntArray) -> list[tuple[int, ...]] | None:
    """Return the edges of the sets along a path with the fewest placements, or None.

    Among such paths over triples one whose least set margin is largest.

    Parameters
    ----------
    cones : Cones
    start, goal : numpy.ndarray of int, shape (2,) or (3,)
        Edges of the first and the last set, ascending; both sets exist.

    Returns
    -------
    list of tuple of int or None
    """
    if start.tolist() == goal.tolist():
        return [tuple(start.tolist())]
    ahead, back = _Side.at(cones, start), _Side.at(cones, goal)
    while len(ahead.frontier) and len(back.frontier):
        middle = _meet(cones, ahead, back)
        if middle is not None:
            return [*ahead.trace(middle[0])[::-1], *middle[1], *back.trace(middle[2])]
        side = min((ahead, back), key=lambda s: len(s.frontier))
        side.expand(cones)
        same = _common(cones, ahead, back)
        if same is not None:
            return [*ahead.trace(same[0])[::-1], *back.trace(same[1])[1:]]
    return None


@dataclass
class _Side:
    """Sets reached from one end, in levels by number of switches."""

    levels: list[TorqueFunctions]
    reached: list[FloatArray]  # the largest least margin of a path to each set
    parents: list[IntArray]
    seen: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @classmethod
    def at(cls, cones: Cones, edges: IntArray) -> _Side:
        functions = torque_functions(cones, edges[None, :])
        side = cls([functions], [best_pieces(functions)[0]], [np.array([-1])])
        side.seen = _keys(cones, functions.edges)
        return side

    @property
    def frontier(self) -> TorqueFunctions:
        return self.levels[-1]

    def expand(self, cones: Cones) -> None:
        """Add the level of all new sets that are adjacent to the frontier."""
        pairs = np.unique(shadows((self.frontier,), 2).edges, axis=0)
        n = cones.n_edges
        found = []
        step = max(1, _CHUNK // n)
        for first in range(0, len(pairs), step):
            part = pairs[first : first + step]
            triples = np.column_stack((part.repeat(n, axis=0), np.tile(np.arange(n), len(part))))
            found.append(_keys(cones, np.sort(triples, axis=1)))
        keys = np.setdiff1d(np.unique(np.concatenate(found)), self.seen)
        candidates = _existing(cones, _triples(cones, keys))
        parent, child = _adjacent(self.frontier, candidates)
        margins = best_pieces(candidates)[0]
        best, parents = _best_parent(self.reached[-1], parent, child, len(candidates))
        new = np.flatnonzero(parents >= 0)
        self.levels.append(candidates.take(new))
        self.reached.append(np.minimum(best, margins)[new])
        self.parents.append(parents[new])
        self.seen = np.union1d(self.seen, _keys(cones, self.frontier.edges))

    def trace(self, index: int) -> list[tuple[int, ...]]:
        """The sets from one of the frontier back to the end of this side."""
        path = []
        for functions, parents in zip(self.levels[::-1], self.parents[::-1], strict=True):
            path.append(tuple(functions.edges[index].tolist()))
            index = int(parents[index])
        return path


def _common(cones: Cones, ahead: _Side, back: _Side) -> tuple[int, int] | None:
    """The best set that is in both frontiers."""
    if ahead.frontier.m != back.frontier.m:
        return None
    mine, theirs = (_keys(cones, side.frontier.edges) for side in (ahead, back))
    _, i, j = np.intersect1d(mine, theirs, return_indices=True)
    if not i.size:
        return None
    best = int(np.minimum(ahead.reached[-1][i], back.reached[-1][j]).argmax())
    return int(i[best]), int(j[best])


def _meet(cones: Cones, ahead: _Side, back: _Side) -> tuple[int, list[tuple[int, ...]], int] | None:
    """Where the two frontiers meet: across a switch, or else across one set in between."""
    i, j = _adjacent(ahead.frontier, back.frontier)
    if i.size:
        best = int(np.minimum(ahead.reached[-1][i], back.reached[-1][j]).argmax())
        return int(i[best]), [], int(j[best])
    between = _existing(cones, _between(cones, ahead.frontier, back.frontier))
    sides = []
    for side in (ahead, back):
        parent, child = _adjacent(side.frontier, between)
        sides.append(_best_parent(side.reached[-1], parent, child, len(between)))
    (one, first), (other, second) = sides
    both = np.flatnonzero((first >= 0) & (second >= 0))
    if not both.size:
        return None
    least = np.minimum(np.minimum(one, other), best_pieces(between)[0])
    best = int(both[least[both].argmax()])
    return int(first[best]), [tuple(between.edges[best].tolist())], int(second[best])


def _between(cones: Cones, one: TorqueFunctions, other: TorqueFunctions) -> IntArray:
    """All triples with two edges of a set of either side."""
    sides = []
    for functions in (one, other):
        pairs = np.unique(shadows((functions,), 2).edges, axis=0)
        both = np.unique(np.concatenate((pairs, pairs[:, ::-1])), axis=0)
        sides.append(both)
    first, second = matches(sides[0][:, :1], sides[1][:, :1])
    triples = np.column_stack((sides[0][first], sides[1][second, 1]))
    return _triples(cones, np.unique(_keys(cones, np.sort(triples, axis=1))))


def _adjacent(one: TorqueFunctions, other: TorqueFunctions) -> tuple[IntArray, IntArray]:
    """All pairs of sets of two stacks between which a switch can hold two contacts."""
    first, second = (shadows((functions,), 2) for functions in (one, other))
    i, j = matches(first.edges, second.edges)
    # A two-finger set and itself are no pair; a set is never in both stacks otherwise.
    if one.m == other.m == 2:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    yes = meet(first, second, i, j).exist
    return first.row[i[yes]], second.row[j[yes]]


def matches(one: IntArray, other: IntArray) -> tuple[IntArray, IntArray]:
    """Return all pairs of equal rows of two arrays."""
    _, label = np.unique(np.concatenate((one, other)), axis=0, return_inverse=True)
    mine, theirs = label.ravel()[: len(one)], label.ravel()[len(one) :]
    order = np.argsort(theirs, kind="stable")
    first = np.searchsorted(theirs[order], mine)
    counts = np.searchsorted(theirs[order], mine, side="right") - first
    return np.arange(len(one)).repeat(counts), order[runs(first, counts)]


def _best_parent(
    reached: FloatArray, parent: IntArray, child: IntArray, n: int
) -> tuple[FloatArray, IntArray]:
    """For each of n sets the parent with the largest least margin, -1 if it has none."""
    best, parents = np.full(n, -np.inf), np.full(n, -1)
    order = np.lexsort((parent, -reached[parent]))[::-1]  # the best is written last
    best[child[order]], parents[child[order]] = reached[parent[order]], parent[order]
    return best, parents


def _existing(cones: Cones, triples: IntArray) -> TorqueFunctions:
    functions = torque_functions(cones, triples[spanning(cones, triples)])
    return functions.take(np.flatnonzero(functions.exists()))


def _keys(cones: Cones, edges: IntArray) -> IntArray:
    n = cones.n_edges
    key = np.zeros(len(edges), dtype=np.int64)
    for column in edges.T:
        key = key * n + column
    return key


def _triples(cones: Cones, keys: IntArray) -> IntArray:
    n = cones.n_edges
    return np.stack((keys // n**2, keys // n % n, keys % n), axis=1)
