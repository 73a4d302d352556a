"""Routes of least cost against gcsopt: shortest paths in graphs of convex sets.

The same instance is given to both: all routes with at most so many placements from a start to a
goal. For gcsopt it is a graph of convex sets. A vertex is a convex piece of a grasp set, at a
number of placements so far, with the two ends of a slide inside the piece as variables and its
length as cost. Edges are overlaps of pieces. Switches, at a price per placement, are vertices
whose variables are the held contacts, with edges from and to all pieces of the two sets. Its
answer is a lower bound, from the convex relaxation, and a path that is rounded from it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from statistics import median
from typing import Any

import cvxpy as cp
import numpy as np
from regrasps import PARTS, random_grasps

import regrasp_lp as rl
from bench.report import Table, ms
from regrasp_lp.friction import FloatArray
from regrasp_lp.planning.costs import Shortest
from regrasp_lp.planning.objective import Objective
from regrasp_lp.planning.route_lp import RoutePrograms, Slots, Terminal
from regrasp_lp.planning.route_search import Ground
from regrasp_lp.planning.shortest import FLOOR, shortest_route

FRICTION = 0.4
TOLERANCE = 1e-5
"""Of costs in the object's size: the relaxation is solved by an interior-point method."""

_PATHS, _TRIALS = 10, 100  # of the rounding
_MOST_EDGES = 600


@dataclass(frozen=True, eq=False)
class Instance:
    """A start and a goal on an object, and the price of a placement in the object's unit."""

    name: str
    graph: rl.SwitchingGraph
    start: rl.Grasp
    goal: rl.Grasp
    price: float

    def terminals(self, grasp: rl.Grasp) -> tuple[Terminal, ...]:
        """The sets that hold a grasp or some of its contacts."""
        last = grasp is self.goal
        return tuple(
            Terminal(i, grasp.fractions[list(chosen)], len(grasp) - len(chosen) if last else 0)
            for i, chosen in self.graph.sets.holding(grasp)
        )

    def ours(self) -> Shortest | None:
        """Our route."""
        weights = {"placements": self.price, "travel": 1.0}
        ends = self.terminals(self.start), self.terminals(self.goal)
        graph = self.graph
        objective = Objective.of(weights)
        return shortest_route(graph.sets, graph.switches, graph.hand, *ends, objective)


@dataclass(eq=False)
class Convex:
    """The graph of convex sets of an instance with at most so many placements."""

    instance: Instance
    most: int
    gcs: Any = None
    pieces: dict[tuple[int, int], list[Any]] = field(default_factory=dict)  # set, placements

    def __post_init__(self) -> None:
        from gcsopt import GraphOfConvexSets

        self.gcs = GraphOfConvexSets()
        graph, sets = self.instance.graph, self.instance.graph.sets
        self.size = sets.sources[0].cones.size
        least = np.array([FLOOR, 0.0])
        self.starts = self.instance.terminals(self.instance.start)
        self.goals = self.instance.terminals(self.instance.goal)
        self.programs = RoutePrograms(sets, self.starts, self.goals, np.zeros(3), least, least)
        allowed = sets.margins > FLOOR * self.size
        self.ground = Ground(sets, graph.switches, graph.hand, allowed)
        ends = np.full((2, len(sets)), np.inf)
        for side, terminals in enumerate((self.starts, self.goals)):
            for terminal in terminals:
                ends[side, terminal.index] = min(ends[side, terminal.index], terminal.placed)
        self.before = self.ground.least_cost(ends[0], 1.0, onwards=False)
        self.after = self.ground.least_cost(ends[1], 1.0, onwards=True)

    def build(self) -> None:
        """Add all vertices and edges."""
        layers = [
            (index, placed)
            for index in range(len(self.ground.sets))
            for placed in range(self.most + 1)
            if self.before[index] <= placed <= self.most - self.after[index]
        ]
        for index, placed in layers:
            self._add_pieces(index, placed)
        for index, placed in layers:
            for other, cost, slots in self._moves(index):
                if (other, placed + cost) in self.pieces:
                    self._add_switch(index, other, placed, cost, slots)
        self._add_ends()

    def _moves(self, index: int) -> Iterator[tuple[int, int, Slots]]:
        """Sets that can follow, the placements that takes, and the contacts held."""
        for other, held in zip(*(a.tolist() for a in self.ground.beside(index)), strict=True):
            for slots in self.ground.matchings(index, other, held):
                yield other, int(self.ground.sets.contacts[other]) - held, slots

    def _add_pieces(self, index: int, placed: int) -> None:
        rows = self.programs.set_rows(index)
        m = len(rows.lengths)
        members = []
        for chosen in product(*(range(len(choice.bounds)) for choice in rows.choices)):
            pairs = list(zip(rows.choices, chosen, strict=True))
            matrix = np.array([*rows.rows, *(c.rows[i] for c, i in pairs)]).reshape(-1, m)
            bounds = np.array([*rows.bounds, *(c.bounds[i] - FLOOR for c, i in pairs)])
            vertex = self.gcs.add_vertex(f"{index}/{placed}/{chosen}")
            ends = vertex.add_variable(2 * m)
            for grasp in (ends[:m], ends[m:]):
                vertex.add_constraints([grasp >= 0, grasp <= 1])
                if len(matrix):
                    vertex.add_constraint(matrix @ grasp <= bounds)
            vertex.add_cost(cp.norm1(cp.multiply(rows.lengths, ends[m:] - ends[:m])))
            vertex.inside = lambda f, a=matrix, b=bounds: bool((a @ f <= b).all())
            members.append(vertex)
        self.pieces[index, placed] = members
        for one in members:
            for other in members:
                if one is not other:
                    edge = self.gcs.add_edge(one, other)
                    edge.add_constraint(one.variables[0][m:] == other.variables[0][:m])

    def _add_switch(self, index: int, other: int, placed: int, cost: int, slots: Slots) -> None:
        vertex = self.gcs.add_vertex(f"{index}-{other}/{placed}/{slots}")
        contacts = vertex.add_variable(max(1, len(slots)))
        vertex.add_constraints([contacts >= 0, contacts <= 1])
        vertex.add_cost(self.instance.price / self.size * cost)
        n = int(self.ground.sets.contacts[index])
        for piece in self.pieces[index, placed]:
            edge = self.gcs.add_edge(piece, vertex)
            for place, (here, _) in enumerate(slots):
                edge.add_constraint(piece.variables[0][n + here] == contacts[place])
        for piece in self.pieces[other, placed + cost]:
            edge = self.gcs.add_edge(vertex, piece)
            for place, (_, there) in enumerate(slots):
                edge.add_constraint(contacts[place] == piece.variables[0][there])

    def _add_ends(self) -> None:
        self.source, self.target = (self._point(n, np.zeros(1)) for n in ("start", "goal"))
        for number, terminal in enumerate(self.starts):
            f = terminal.fractions
            point = self._point(f"start {number}", f)
            self.gcs.add_edge(self.source, point)
            for piece in self.pieces.get((terminal.index, 0), []):
                if piece.inside(f):
                    edge = self.gcs.add_edge(point, piece)
                    edge.add_constraint(piece.variables[0][: len(f)] == point.variables[0])
        for number, terminal in enumerate(self.goals):
            f = terminal.fractions
            point = self._point(f"goal {number}", f)
            point.add_cost(self.instance.price / self.size * terminal.placed)
            self.gcs.add_edge(point, self.target)
            for placed in range(self.most - terminal.placed + 1):
                for piece in self.pieces.get((terminal.index, placed), []):
                    if piece.inside(f):
                        edge = self.gcs.add_edge(piece, point)
                        edge.add_constraint(piece.variables[0][len(f) :] == point.variables[0])

    def _point(self, name: str, at: FloatArray) -> Any:
        vertex = self.gcs.add_vertex(name)
        vertex.add_constraint(vertex.add_variable(len(at)) == at)
        return vertex


@dataclass(frozen=True)
class Compared:
    """One instance, costs and times; costs in the object's unit."""

    instance: Instance
    found: Shortest
    vertices: int
    edges: int
    relaxed: float
    rounded: float
    ours_seconds: float
    gcs_seconds: float
    solver_seconds: float  # of these, for the relaxation


def compare(instance: Instance) -> Compared | None:
    """Solve an instance both ways; None if there is no route or the graph is too large."""
    started = time.perf_counter()
    found = instance.ours()
    seconds = time.perf_counter() - started
    if found is None:
        return None
    convex = Convex(instance, int(found.cost / instance.price + 1e-9))
    started = time.perf_counter()
    convex.build()
    if convex.gcs.num_edges() > _MOST_EDGES:
        return None
    relaxed, rounded, solver = solve(convex)
    return Compared(
        instance,
        found,
        convex.gcs.num_vertices(),
        convex.gcs.num_edges(),
        relaxed * convex.size,
        rounded * convex.size,
        seconds,
        time.perf_counter() - started,
        solver,
    )


def solve(convex: Convex) -> tuple[float, float, float]:
    """The relaxation's bound, the cost of the best rounded path, and the relaxation's seconds."""
    from gcsopt.graph_problems.rounding.shortest_path import randomized_dfs

    gcs, ends = convex.gcs, (convex.source, convex.target)
    gcs.solve_shortest_path(*ends, binary=False, solver=cp.CLARABEL)
    relaxed, seconds = float(gcs.value), float(gcs.solver_stats.solve_time)
    np.random.seed(0)  # noqa: NPY002, it draws from the global generator
    randomized_dfs(gcs, *ends, num_paths=_PATHS, max_trials=_TRIALS)
    return relaxed, float(gcs.value), seconds


def instances(quick: bool) -> list[Instance]:
    """Instances of which most need some travel; of few edges, for graphs that cvxpy can take."""
    cases = [
        ("ell", 3, 2.0, (1, 4)),
        ("ell", 3, 2.0, (0, 1)),
        ("comb", 3, 2.0, (4, 1)),
        ("comb", 3, 2.0, (2, 5)),
        ("comb", 3, 2.0, (0, 1)),
        ("rectangle", 4, 2.0, (4, 1)),
        ("rectangle", 4, 0.3, (4, 1)),
        ("ell", 4, 2.0, (0, 3)),
        ("ell", 4, 0.3, (0, 1)),
        ("hexagon", 4, 2.0, (0, 3)),
        ("star 8", 4, 2.0, (2, 5)),
        ("star 8", 4, 2.0, (0, 1)),
        ("star 8", 4, 2.0, (4, 1)),
    ]
    return [_instance(*case) for case in (cases[:1] if quick else cases)]


def _instance(name: str, fingers: int, price: float, ends: tuple[int, int]) -> Instance:
    polygon = PARTS[name]()
    graph = rl.build_switching_graph(polygon, FRICTION, rl.Hand(fingers))
    rng = np.random.default_rng(3)
    grasps = [g for m in (3, 2) for g in random_grasps(polygon, FRICTION, rng, 3, m)]
    start, goal = (polygon.resolve(grasps[i]) for i in ends)
    size = graph.sets.sources[0].cones.size
    return Instance(f"{name}, {fingers} fingers", graph, start, goal, price * size)


def table(found: list[Compared]) -> Table:
    """One line for each instance."""
    rows = []
    for c in found:
        costs = [c.found.cost, c.found.bound, c.relaxed, c.rounded]
        rows.append(
            [
                c.instance.name,
                f"{c.vertices}, {c.edges}",
                f"{c.instance.price:.3g}",
                str(c.found.placements),
                *(f"{cost - c.instance.price * c.found.placements:.4f}" for cost in costs),
                ms(c.ours_seconds),
                ms(c.gcs_seconds),
                ms(c.solver_seconds),
            ]
        )
    faster = median(c.gcs_seconds / c.ours_seconds for c in found)
    headings = [
        "object, hand",
        "vertices, edges",
        "placement",
        "placed",
        "our travel",
        "our bound",
        "its bound",
        "its travel",
        "ours, ms",
        "gcsopt, ms",
        "its solver",
    ]
    notes = [
        f"Least travel plus the price of placements, μ = {FRICTION:g}. The columns from our travel "
        "on have the price of our placements taken off. Vertices and edges are those of the graph "
        "of convex sets; its bound is that of the convex relaxation, solved by Clarabel, its "
        f"travel the best of {_PATHS} rounded paths. Its time includes building the graph; "
        "the last column is that of the solver alone, for the relaxation.",
        f"Median of its time by ours {faster:.0f}.",
    ]
    return Table("Least travel against graphs of convex sets", headings, rows, notes)


def missing() -> Table:
    """What is said where gcsopt is not installed."""
    notes = ['gcsopt is not installed: pip install -e ".[bench]"']
    return Table("Least travel against graphs of convex sets", ["object, hand"], [], notes)
