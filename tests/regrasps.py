"""Random grasps, a replay of plan documents, and shortest paths by networkx: shared oracles.

The replay reads nothing but the document of a plan, and computes in rational numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import combinations
from math import lcm
from typing import Any

import networkx as nx
import numpy as np
from geometry import comb, ell, hexagon, rectangle, regular, star, unit_square, with_hole, you
from wrench_oracle import Wrench, positively_spans

import regrasp_lp as rl

Document = dict[str, Any]
Point = tuple[Fraction, Fraction]
Place = tuple[int, Fraction]


def tee() -> rl.Polygon:
    return rl.Polygon([(2, 0), (4, 0), (4, 3), (6, 3), (6, 5), (0, 5), (0, 3), (2, 3)], name="tee")


def nut() -> rl.Polygon:
    """A hexagon with a hexagonal hole, turned against each other."""
    outer = 3 * regular(6).vertices
    angles = -2 * np.pi * np.arange(6) / 6
    inner = 1.2 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return rl.Polygon(outer, holes=[inner], name="nut")


def plate() -> rl.Polygon:
    """A rectangle with a square and a triangular hole."""
    square = [(1, 1), (1, 2), (2, 2), (2, 1)]
    triangle = [(4, 1), (4.5, 2), (5, 1)]
    return rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], holes=[square, triangle], name="plate")


PARTS: dict[str, Callable[[], rl.Polygon]] = {
    "rectangle": rectangle,
    "ell": ell,
    "tee": tee,
    "you": you,
    "comb": lambda: comb(2),
    "hexagon": hexagon,
    "frame": with_hole,
    "nut": nut,
    "plate": plate,
    "square": unit_square,
    "star 8": lambda: star(8, 3),
    "star 12": lambda: star(12, 1),
}


def random_grasps(
    polygon: rl.Polygon,
    friction: float | np.ndarray,
    rng: np.random.Generator,
    count: int,
    contacts: int,
    *,
    at_vertices: float = 0.0,
) -> list[rl.Grasp]:
    """Grasps in exact force closure; a part of the contacts at vertices or simple fractions."""
    found: list[rl.Grasp] = []
    for _ in range(20):
        edges = rng.integers(0, polygon.n_edges, (2000, contacts))
        fractions = rng.random(edges.shape)
        coarse = rng.random(edges.shape) < at_vertices
        fractions = np.where(coarse, np.round(4 * fractions) / 4, fractions)
        closed = rl.is_force_closure(polygon, friction=friction, edges=edges, fractions=fractions)
        for row in np.flatnonzero(closed):
            pairs = list(zip(edges[row].tolist(), fractions[row].tolist(), strict=True))
            if len(set(_places(polygon, pairs))) == contacts:
                found.append(rl.Grasp.at_fractions(pairs))
            if len(found) == count:
                return found
    return found


def _places(polygon: rl.Polygon, pairs: list[tuple[int, float]]) -> list[object]:
    ends = {0.0: polygon.edge_starts, 1.0: polygon.edge_ends}
    return [tuple(ends[f][e].tolist()) if f in ends else (e, f) for e, f in pairs]


# --- shortest paths -----------------------------------------------------------------------------


def directed(graph: rl.SwitchingGraph) -> nx.DiGraph:
    """The graph with the cost ``n_T - held`` of each switch from S to T."""
    result = nx.DiGraph()
    undirected = graph.to_networkx()
    result.add_nodes_from(undirected.nodes(data=True))
    for i, j, held in undirected.edges(data="held"):
        for s, t in ((i, j), (j, i)):
            result.add_edge(s, t, cost=len(undirected.nodes[t]["edges"]) - held)
    return result


def optimal_placements(
    graph: rl.SwitchingGraph, start: rl.Grasp, goal: rl.Grasp, costs: nx.DiGraph | None = None
) -> int | None:
    """The fewest placements from start to goal by sliding, by networkx alone."""
    contacts = [
        {(c.edge, c.fraction) for c in graph.polygon.resolve(grasp)} for grasp in (start, goal)
    ]
    if contacts[0] == contacts[1] and graph.locate(start):
        return 0  # there is nothing to do
    costs = (directed(graph) if costs is None else costs).copy()
    costs.add_nodes_from(("start", "goal"))
    for index in graph.locate(start):
        costs.add_edge("start", index, cost=0)
    for index in graph.locate(goal):
        missing = len(goal) - len(costs.nodes[index]["edges"])
        costs.add_edge(index, "goal", cost=missing)
    try:
        length: int = nx.shortest_path_length(costs, "start", "goal", weight="cost")
    except nx.NetworkXNoPath:
        return None
    return length


# --- replay of a document -----------------------------------------------------------------------


class Replay:
    """Plays the document of a plan, and raises AssertionError where a rule is broken.

    Slides are looked at in a few instants between their ends.
    """

    def __init__(self, document: Document, instants: int = 5) -> None:
        rings = [document["polygon"]["exterior"], *document["polygon"]["holes"]]
        self.edges: list[tuple[Point, Point]] = []
        for ring in rings:
            points = [(Fraction(x), Fraction(y)) for x, y in ring]
            self.edges += zip(points, points[1:] + points[:1], strict=True)
        friction = [Fraction(mu) for mu in document["friction"]]
        assert len(friction) in (1, len(self.edges))
        self.friction = friction * len(self.edges) if len(friction) == 1 else friction
        self.fingers = range(1, document["hand"]["fingers"] + 1)
        self.now: dict[int, Place] = {}
        self.placements = 0
        for i, entry in enumerate(document["start"], start=1):
            self.now[entry.get("finger", i)] = self.place(entry)
        self.check(self.now)
        for step in document["steps"]:
            self.do(step, instants)
            self.check(self.now)
        goal = {self.place(entry) for entry in document["goal"]}
        assert set(self.now.values()) == goal
        assert len(self.now) == len(document["goal"])

    def place(self, entry: Document) -> Place:
        assert type(entry["edge"]) is int
        assert 0 <= entry["edge"] < len(self.edges)
        assert 0 <= entry["fraction"] <= 1
        return entry["edge"], Fraction(entry["fraction"])

    def do(self, step: Document, instants: int) -> None:
        if step["action"] == "place":
            assert step["finger"] in self.fingers
            assert step["finger"] not in self.now
            self.now[step["finger"]] = self.place(step)
            self.placements += 1
        elif step["action"] == "release":
            del self.now[step["finger"]]
        else:
            assert step["action"] == "slide"
            before, after = dict(self.now), dict(self.now)
            for move in step["moves"]:
                here = self.place({"edge": move["edge"], **move["from"]})
                assert self.now[move["finger"]] == here
                after[move["finger"]] = self.place({"edge": move["edge"], **move["to"]})
            assert len({move["finger"] for move in step["moves"]}) == len(step["moves"]) > 0
            self.check_order(before, after)
            for i in range(1, instants):
                t = Fraction(i, instants)
                between = {
                    finger: (edge, f + t * (after[finger][1] - f))
                    for finger, (edge, f) in before.items()
                }
                self.check(between)
            self.now = after

    @staticmethod
    def check_order(before: dict[int, Place], after: dict[int, Place]) -> None:
        for one, other in combinations(before, 2):
            if before[one][0] == before[other][0]:
                assert before[one] != before[other]
                was, now = before[one] < before[other], after[one] < after[other]
                assert was == now, "two fingers passed each other"

    def point(self, place: Place) -> Point:
        (ax, ay), (bx, by) = self.edges[place[0]]
        return ax + place[1] * (bx - ax), ay + place[1] * (by - ay)

    def wrenches(self, place: Place) -> list[Wrench]:
        (ax, ay), (bx, by) = self.edges[place[0]]
        tx, ty = bx - ax, by - ay
        x, y = self.point(place)
        found = []
        for mu in (self.friction[place[0]], -self.friction[place[0]]):
            ex, ey = -ty + mu * tx, tx + mu * ty
            entries = (ex, ey, x * ey - y * ex)
            unit = lcm(*(entry.denominator for entry in entries))
            found.append(tuple(int(entry * unit) for entry in entries))
        return found

    def check(self, touching: dict[int, Place]) -> None:
        points = [self.point(place) for place in touching.values()]
        assert len(set(points)) == len(points), "two fingers at one point"
        places = list(touching.values())
        assert positively_spans([w for place in places for w in self.wrenches(place)])
