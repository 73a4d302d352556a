"""The bottleneck over all pieces of all grasp sets, by linear programs of scipy: an oracle.

Torque functions are written down anew from the corners of a polygon, circuits found in rational
numbers, and the width of every overlap and of every switch is a program of its own. Positions are
lengths along edges.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import combinations, combinations_with_replacement, permutations, product

import numpy as np
from scipy.optimize import linprog

import regrasp_lp as rl
from regrasp_lp.lp import get_solver
from regrasp_lp.planning.ends import supports
from regrasp_lp.planning.levels import PieceRows
from regrasp_lp.planning.moves import KnownMoves
from regrasp_lp.planning.widest import WidestProblem

Vector = tuple[Fraction, Fraction]
Slots = tuple[tuple[int, int], ...]
Piece = tuple[int, int, int]
"""A set, and the functions j and k that are below and above 0."""

Given = tuple[int, np.ndarray, int]
"""A set that holds contacts of a given grasp, their positions, and how many others it has."""


def cross(a: Vector, b: Vector) -> Fraction:
    return a[0] * b[1] - a[1] * b[0]


@dataclass(frozen=True, eq=False)
class Functions:
    """Functions ``offsets + slopes · u`` of one set, scaled for margins; `rates` for tolerances."""

    edges: tuple[int, ...]
    lengths: np.ndarray
    offsets: np.ndarray
    slopes: np.ndarray

    @property
    def rates(self) -> np.ndarray:
        return self.slopes.sum(axis=1)

    def values(self, u: np.ndarray, measure: str) -> np.ndarray:
        values = self.offsets + self.slopes @ u
        return values / self.rates if measure == "tolerance" else values

    def level(self, u: np.ndarray, measure: str) -> float:
        """The margin or tolerance of a grasp in the set."""
        values = self.values(u, measure)
        level = min(values.max(), (-values).max())
        if measure == "tolerance":
            level = min(level, u.min(), (self.lengths - u).min())
        return float(level)


def complete_functions(
    polygon: rl.Polygon, friction: float | np.ndarray, edges: tuple[int, ...]
) -> Functions | None:
    """All circuits of the boundary rays of some edges, in rational numbers; None without span."""
    mu = np.broadcast_to(friction, polygon.n_edges)
    starts, tangents, rays = [], [], []
    for edge in edges:
        a, b = polygon.edge_starts[edge], polygon.edge_ends[edge]
        ax, ay, bx, by = (Fraction(float(v)) for v in (*a, *b))
        t = (bx - ax, by - ay)
        starts.append((ax, ay))
        tangents.append(t)
        for m in (Fraction(float(mu[edge])), -Fraction(float(mu[edge]))):
            rays.append((-t[1] + m * t[0], t[0] + m * t[1]))
    for x, y in rays:
        for side in ((-y, x), (y, -x)):
            if all(side[0] * ray[0] + side[1] * ray[1] >= 0 for ray in rays):
                return None
    circuits: list[tuple[tuple[int, Fraction], ...]] = []
    for i, j in combinations(range(len(rays)), 2):
        (a, b), (c, d) = rays[i], rays[j]
        if cross(rays[i], rays[j]) == 0 and a * c + b * d < 0:
            circuits.append(((i, abs(c) + abs(d)), (j, abs(a) + abs(b))))
    for i, j, k in combinations(range(len(rays)), 3):
        weights = cross(rays[j], rays[k]), cross(rays[k], rays[i]), cross(rays[i], rays[j])
        if all(w > 0 for w in weights) or all(w < 0 for w in weights):
            circuits.append(tuple(zip((i, j, k), map(abs, weights), strict=True)))
    lengths = polygon.edge_lengths[list(edges)]
    offsets = np.zeros(len(circuits))
    slopes = np.zeros((len(circuits), len(edges)))
    for row, circuit in enumerate(circuits):
        scale = sum(float(w) * float(np.hypot(*map(float, rays[r]))) for r, w in circuit)
        offsets[row] = float(sum(w * cross(starts[r // 2], rays[r]) for r, w in circuit)) / scale
        for r, w in circuit:
            turn = float(w * cross(tangents[r // 2], rays[r]))
            slopes[row, r // 2] += turn / scale / lengths[r // 2]
    return Functions(edges, lengths, offsets, slopes)


def all_sets(polygon: rl.Polygon, friction: float | np.ndarray) -> list[Functions]:
    """The functions of all combinations of two and three edges that may have a set."""
    every = range(polygon.n_edges)
    candidates = [*combinations(every, 2), *combinations_with_replacement(every, 3)]
    found = [complete_functions(polygon, friction, edges) for edges in candidates]
    return [f for f in found if f is not None]


def sets_of(graph: rl.SwitchingGraph) -> list[Functions]:
    """The sets of a graph, whatever they are, with the package's own functions."""
    found = []
    for index in range(len(graph)):
        f = graph.sets.functions(index)
        valid = f.valid[0]
        offsets, slopes = f.offsets[0, valid], f.slopes[0, valid] / f.lengths[0]
        found.append(Functions(tuple(f.edges[0].tolist()), f.lengths[0], offsets, slopes))
    return found


def maximum(rows: list[tuple[np.ndarray, float, float]], upper: np.ndarray) -> float:
    """``max ε`` with ``row · u + scale ε <= bound`` and ``0 <= u <= upper``; -inf if there is none.

    Rows are (row, scale, bound).
    """
    a = np.array([np.append(row, scale) for row, scale, _ in rows])
    b = np.array([bound for *_, bound in rows])
    box = [*((0.0, float(length)) for length in upper), (None, None)]
    cost = np.append(np.zeros(len(upper)), -1.0)
    found = linprog(cost, A_ub=a, b_ub=b, bounds=box, method="highs")
    if found.status == 2:
        return -np.inf
    assert found.status == 0, found.message
    return float(-found.fun)


@dataclass(eq=False)
class Oracle:
    """The bottleneck from one grasp to another over pieces of sets.

    Parameters
    ----------
    sets : list of Functions
    fingers : int
    measure : {"margin", "tolerance"}
    every : bool
        Whether there is a set for every grasp. If not, all of a given one may touch while a set
        holds the object that has some of its contacts.
    """

    sets: list[Functions]
    fingers: int
    measure: str
    every: bool = True
    programs: int = 0
    _widths: dict[object, float] = field(default_factory=dict)

    # --- widths ---------------------------------------------------------------------------------

    def rows(
        self, piece: Piece, columns: list[int], n: int
    ) -> list[tuple[np.ndarray, float, float]]:
        """The rows of a piece in a program of n contacts, its own in some columns."""
        index, j, k = piece
        f = self.sets[index]
        found = []
        for function, sign in ((j, 1.0), (k, -1.0)):  # M_j + ε <= 0 and -M_k + ε <= 0
            row = np.zeros(n)
            np.add.at(row, columns, sign * f.slopes[function])
            scale = float(f.rates[function]) if self.measure == "tolerance" else 1.0
            found.append((row, scale, float(-sign * f.offsets[function])))
        for slot, column in enumerate(columns):
            row = np.zeros(n)
            row[column] = 1.0
            if self.measure == "tolerance":
                found += [(-row, 1.0, 0.0), (row, 1.0, float(f.lengths[slot]))]
            if slot and f.edges[slot] == f.edges[slot - 1]:
                order = np.zeros(n)
                order[columns[slot - 1]], order[column] = 1.0, -1.0
                found.append((order, 0.0, 0.0))
        return found

    def width(self, piece: Piece) -> float:
        """The largest margin (tolerance) on a piece."""
        if piece not in self._widths:
            m = len(self.sets[piece[0]].edges)
            self._widths[piece] = self._solve([(piece, list(range(m)))])
        return self._widths[piece]

    def overlap(self, one: Piece, other: Piece) -> float:
        """The same on two pieces of one set at once."""
        key = (min(one, other), max(one, other))
        if key not in self._widths:
            columns = list(range(len(self.sets[one[0]].edges)))
            self._widths[key] = self._solve([(one, columns), (other, columns)])
        return self._widths[key]

    def join(self, one: Piece, other: Piece, slots: Slots) -> float:
        """The same on two pieces with some contacts in common."""
        if not slots:
            return min(self.width(one), self.width(other))
        back = tuple(sorted((there, here) for here, there in slots))
        key = min((one, other, slots), (other, one, back))
        if key not in self._widths:
            m, n = (len(self.sets[p[0]].edges) for p in (one, other))
            columns = list(range(m, m + n))
            for here, there in slots:
                columns[there] = here
            used = sorted({*range(m), *columns})
            columns = [used.index(c) for c in columns]
            self._widths[key] = self._solve([(one, list(range(m))), (other, columns)])
        return self._widths[key]

    def _solve(self, parts: list[tuple[Piece, list[int]]]) -> float:
        self.programs += 1
        n = 1 + max(c for _, columns in parts for c in columns)
        upper = np.zeros(n)
        for piece, columns in parts:
            upper[columns] = self.sets[piece[0]].lengths
        rows = [row for piece, columns in parts for row in self.rows(piece, columns, n)]
        return maximum(rows, upper)

    @cached_property
    def pieces(self) -> list[list[Piece]]:
        """The pieces of each set with a positive width."""
        return [
            [
                (i, j, k)
                for j, k in permutations(range(len(f.offsets)), 2)
                if self.width((i, j, k)) > 0
            ]
            for i, f in enumerate(self.sets)
        ]

    def need(self, one: int, other: int) -> int:
        return max(0, len(self.sets[one].edges) + len(self.sets[other].edges) - self.fingers)

    def choices(self, one: int, other: int, held: int) -> Iterator[Slots]:
        """All ways to hold so many contacts between two sets; contacts of an edge in order."""
        yield from matchings(self.sets[one].edges, self.sets[other].edges, held)

    # --- given grasps ---------------------------------------------------------------------------

    def supports(self, grasp: rl.Grasp) -> list[Given]:
        """Sets that hold a resolved grasp or two of its contacts: set, positions, others."""
        found = []
        for count in range(2, len(grasp) + 1):
            for chosen in permutations(grasp, count):
                edges = tuple(c.edge for c in chosen)
                u = np.array([c.position for c in chosen])
                if any(e > g or (e == g and a >= b) for e, g, a, b in _following(edges, u)):
                    continue
                for index, f in enumerate(self.sets):
                    if f.edges == edges and f.level(u, "margin") > 0:
                        found.append((index, u, len(grasp) - count))
        return found

    def given(self, support: Given, piece: Piece) -> float:
        """The largest level at which a piece of its set is reached from a given grasp.

        Part of a given grasp counts itself, so that a slide to where it is better gains nothing.
        """
        index, u, others = support
        f = self.sets[index]
        values = f.values(u, self.measure)
        level = f.level(u, self.measure)
        inside = float(min(level, -values[piece[1]], values[piece[2]]))
        return inside if others else max(inside, self.landing(f, u, level, piece))

    def landing(self, f: Functions, u: np.ndarray, level: float, piece: Piece) -> float:
        """The largest level on a piece where it is seen from u: at least as good, or -inf."""
        if self.width(piece) <= level:
            return -np.inf
        columns = list(range(len(u)))
        best = -np.inf
        for up, down in product(self.seen(f, u, level, 1.0), self.seen(f, u, level, -1.0)):
            rows = [*self.rows(piece, columns, len(u)), *((-s, 0.0, c) for c, s in (up, down))]
            self.programs += 1
            best = max(best, maximum(rows, f.lengths))
            if best >= self.width(piece) - 1e-12:
                break
        return best if best > level else -np.inf

    def seen(
        self, f: Functions, u: np.ndarray, level: float, sign: float
    ) -> list[tuple[float, np.ndarray]]:
        """Half-spaces; u sees their union and no more (tested by sampling)."""
        scale = f.rates if self.measure == "tolerance" else np.ones(len(f.offsets))
        constants = sign * f.offsets / scale - level
        slopes = sign * f.slopes / scale[:, None]
        at = constants + slopes @ u
        found = []
        for k in np.flatnonzero(at >= -1e-11).tolist():
            found.append((constants[k] + max(0.0, -at[k]), slopes[k]))
            for low in np.flatnonzero(at < -1e-11).tolist():
                a, b = max(at[k], 0.0), -at[low]
                found.append(
                    (b * constants[k] + a * constants[low], b * slopes[k] + a * slopes[low])
                )
        return found

    def onward(self, support: Given, piece: Piece, held: int) -> float:
        """The largest level on a piece with so many contacts as in a given grasp."""
        index, u, others = support
        limit = self.sets[index].level(u, self.measure) if others else np.inf
        return min(self.beside(self.sets[index].edges, u, piece, held), limit)

    def touching(self, grasp: rl.Grasp, piece: Piece) -> float:
        """The largest level on a piece next to all contacts of a given grasp."""
        n = len(self.sets[piece[0]].edges)
        contacts = sorted(grasp, key=lambda c: (c.edge, c.position))
        edges, u = tuple(c.edge for c in contacts), np.array([c.position for c in contacts])
        return self.beside(edges, u, piece, max(0, len(edges) + n - self.fingers))

    def beside(self, edges: tuple[int, ...], u: np.ndarray, piece: Piece, held: int) -> float:
        """The largest level on a piece with so many contacts among some others."""
        other = self.sets[piece[0]]
        best = -np.inf
        n = len(other.edges)
        for slots in matchings(edges, other.edges, held):
            rows = self.rows(piece, list(range(n)), n)
            for here, there in slots:
                row = np.zeros(n)
                row[there] = 1.0
                rows += [(row, 0.0, float(u[here])), (-row, 0.0, -float(u[here]))]
            self.programs += 1
            best = max(best, maximum(rows, other.lengths))
        return best

    def direct(self, start: rl.Grasp, goal: rl.Grasp) -> bool:
        """Whether one slide or one switch will do, so that nothing is chosen."""
        if len({*start, *goal}) <= self.fingers:
            return True
        for (i, u, a), (j, v, b) in product(self.supports(start), self.supports(goal)):
            if i == j and not (a or b):
                f = self.sets[i]
                least = min(f.level(u, self.measure), f.level(v, self.measure))
                if least_along(f, u, v, self.measure) >= least - 1e-9 * f.lengths.max():
                    return True
        return False

    # --- the search -----------------------------------------------------------------------------

    def ends(self, grasp: rl.Grasp, floor: float) -> dict[Piece, float]:
        """How widely each piece is reached from a given grasp at once, where above a floor."""
        found: dict[Piece, float] = {}
        for support in self.supports(grasp):
            for index in range(len(self.sets)):
                need = self.need(support[0], index)
                for piece in self.pieces[index]:
                    known = found.get(piece, floor)
                    if self.width(piece) > known:
                        known = max(known, self.onward(support, piece, need))
                    if self.width(piece) > known + 1e-12 and index == support[0]:
                        known = max(known, self.given(support, piece))
                    if support[2] and not self.every and self.width(piece) > known + 1e-12:
                        known = max(known, self.touching(grasp, piece))
                    if known > floor:
                        found[piece] = known
        return found

    def bottleneck(self, start: rl.Grasp, goal: rl.Grasp) -> float:
        """The largest level at which the goal is reached; inf if nothing needs to be chosen."""
        if self.direct(start, goal):
            return np.inf
        exits = self.ends(goal, 0.0)
        best = self.ends(start, 0.0)
        queue = [(-w, piece) for piece, w in best.items()]
        heapq.heapify(queue)
        done: set[Piece] = set()
        reached = 0.0
        while queue:
            negative, piece = heapq.heappop(queue)
            if piece in done:
                continue
            if -negative <= reached:
                break
            done.add(piece)
            reached = max(reached, min(-negative, exits.get(piece, 0.0)))
            for other in (p for of_set in self.pieces for p in of_set):
                most = min(-negative, self.width(other))
                if other in done or most <= max(best.get(other, 0.0), reached):
                    continue
                width = min(-negative, self._link(piece, other, best.get(other, 0.0), most))
                if width > best.get(other, 0.0):
                    best[other] = width
                    heapq.heappush(queue, (-width, other))
        return reached

    def _link(self, one: Piece, other: Piece, known: float, most: float) -> float:
        """The largest level between two pieces, by sliding or by one switch."""
        if one[0] == other[0]:
            known = max(known, self.overlap(one, other))
        for slots in self.choices(one[0], other[0], self.need(one[0], other[0])):
            if known >= most:
                break
            known = max(known, self.join(one, other, slots))
        return known

    def fewest(self, start: rl.Grasp, goal: rl.Grasp, level: float) -> int | None:
        """The fewest placements at a level, by Dijkstra's method over pieces."""
        entries, exits = self._costs(start, level, False), self._costs(goal, level, True)
        queue = [(cost, piece) for piece, cost in entries.items()]
        heapq.heapify(queue)
        best = dict(entries)
        answer: int | None = None
        alive = [p for of_set in self.pieces for p in of_set if self.width(p) >= level]
        done: set[Piece] = set()
        while queue:
            cost, piece = heapq.heappop(queue)
            if piece in done:
                continue
            if answer is not None and cost >= answer:
                break
            done.add(piece)
            if piece in exits and (answer is None or cost + exits[piece] < answer):
                answer = cost + exits[piece]
            m = len(self.sets[piece[0]].edges)
            for other in alive:
                n = len(self.sets[other[0]].edges)
                beside = piece[0] == other[0] and best.get(other, 99) > cost
                if beside and self.overlap(piece, other) >= level:
                    best[other] = cost
                    heapq.heappush(queue, (cost, other))
                for held in range(min(m, n), self.need(piece[0], other[0]) - 1, -1):
                    step = cost + n - held
                    if best.get(other, 99) <= step or (answer is not None and step >= answer):
                        break
                    slots = self.choices(piece[0], other[0], held)
                    if any(self.join(piece, other, s) >= level for s in slots):
                        best[other] = step
                        heapq.heappush(queue, (step, other))
                        break
        return answer

    def _costs(self, grasp: rl.Grasp, level: float, arriving: bool) -> dict[Piece, int]:
        """Placements between a given grasp and the pieces reached from it at a level."""
        found: dict[Piece, int] = {}
        for support in self.supports(grasp):
            m = len(self.sets[support[0]].edges)
            after = support[2] if arriving else 0
            for index, of_set in enumerate(self.pieces):
                n = len(self.sets[index].edges)
                for piece in of_set:
                    if self.width(piece) < level:
                        continue
                    if index == support[0] and self.given(support, piece) >= level:
                        found[piece] = min(found.get(piece, 99), after)
                    for held in range(min(m, n), self.need(support[0], index) - 1, -1):
                        cost = (m if arriving else n) - held + after
                        if found.get(piece, 99) <= cost:
                            break
                        if self.onward(support, piece, held) >= level:
                            found[piece] = cost
                            break
        return found


def matchings(one: tuple[int, ...], other: tuple[int, ...], held: int) -> Iterator[Slots]:
    """All ways to hold so many contacts on edges; contacts of an edge in order."""
    for here in combinations(range(len(one)), held):
        for there in combinations(range(len(other)), held):
            if all(one[a] == other[b] for a, b in zip(here, there, strict=True)):
                yield tuple(zip(here, there, strict=True))


def _following(edges: tuple[int, ...], u: np.ndarray) -> Iterator[tuple[int, int, float, float]]:
    return zip(edges, edges[1:], u.tolist(), u.tolist()[1:], strict=False)


def least_along(f: Functions, u: np.ndarray, v: np.ndarray, measure: str) -> float:
    """The least level along a straight slide, at its ends and wherever two functions cross."""
    at, end = f.values(u, measure), f.values(v, measure)
    times = [0.0, 1.0]
    for j, k in combinations(range(len(at)), 2):
        apart = (at[j] - at[k]) - (end[j] - end[k])
        if apart != 0:
            times.append((at[j] - at[k]) / apart)
    return min(f.level(u + t * (v - u), measure) for t in times if 0 <= t <= 1)


def widest_problem(
    graph: rl.SwitchingGraph, start: rl.Grasp, goal: rl.Grasp, measure: str = "margin"
) -> WidestProblem:
    """The search that a plan between two resolved grasps is made by."""
    rows = PieceRows(graph.sets.sources, measure)
    moves = KnownMoves(rows, graph.switches, graph.hand)
    every = graph.options.sets == "complete"
    ends = [
        supports(rows, graph.sets, grasp, graph.hand.fingers, every=every)
        for grasp in (start, goal)
    ]
    return WidestProblem(rows, moves, graph.hand, get_solver("highs"), *ends)


# --- random motions -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Held:
    """A grasp of a random motion: its contacts in order, and its own level."""

    edges: tuple[int, ...]
    fractions: tuple[float, ...]
    level: float

    @property
    def places(self) -> set[tuple[int, float]]:
        return set(zip(self.edges, self.fractions, strict=True))


@dataclass(eq=False)
class Wanderer:
    """Random motions all of whose chosen grasps and slides reach a level.

    Part of a given grasp is one of them only if it reaches the level, too. A tree grows from each
    of two given grasps, by slides and switches to random grasps; where one move joins the trees
    there is a plan of that level, whatever a search says. Force closure and margins are those of
    `rl.margin` and `rl.tolerance`.
    """

    polygon: rl.Polygon
    friction: float | np.ndarray
    fingers: int
    measure: str
    level: float
    rng: np.random.Generator

    def levels(self, edges: np.ndarray, fractions: np.ndarray) -> np.ndarray:
        measure = rl.margin if self.measure == "margin" else rl.tolerance
        found: np.ndarray = measure(
            self.polygon, friction=self.friction, edges=edges, fractions=fractions
        )
        return found

    def given(self, grasp: rl.Grasp) -> list[Held]:
        """The grasp itself and those of its pairs of contacts that reach the level."""
        found = []
        for count in range(2, len(grasp) + 1):
            for chosen in combinations(sorted(grasp, key=lambda c: (c.edge, c.position)), count):
                edges = tuple(c.edge for c in chosen)
                fractions = tuple(float(c.fraction or 0.0) for c in chosen)
                if rl.is_force_closure(self.polygon, rl.Grasp(chosen), self.friction):
                    level = float(self.levels(np.array([edges]), np.array([fractions]))[0])
                    if len(chosen) == len(grasp) or level >= self.level:
                        found.append(Held(edges, fractions, level))
        return sorted(found, key=lambda held: -len(held.edges))

    def tree(self, grasp: rl.Grasp, rounds: int, batch: int = 60) -> list[Held]:
        """Grasps that are reached, the given one first."""
        nodes = self.given(grasp)
        first = len(nodes)
        for number in range(rounds):
            early = number < 2 * first + 4
            node = nodes[int(self.rng.integers(first if early else len(nodes)))]
            slide = bool(self.rng.random() < 0.4)
            edges, fractions = self.drawn(node, slide, batch)
            order = np.argsort(edges + fractions / 2, axis=1, kind="stable")
            edges = np.take_along_axis(edges, order, 1)
            fractions = np.take_along_axis(fractions, order, 1)
            levels = self.levels(edges, fractions)
            for row in self.rng.permutation(np.flatnonzero(levels >= self.level))[:5].tolist():
                new = Held(
                    tuple(edges[row].tolist()), tuple(fractions[row].tolist()), float(levels[row])
                )
                apart = len(new.places) == len(new.edges)
                if apart and (not slide or self.slides(node, new)):
                    nodes.append(new)
        return nodes

    def drawn(self, node: Held, slide: bool, batch: int) -> tuple[np.ndarray, np.ndarray]:
        """Random grasps that one move may lead to; some contacts at ends of edges."""
        m = len(node.edges)
        n = m if slide else int(self.rng.integers(2, 4))
        fractions = self.rng.random((batch, n))
        fractions = np.where(self.rng.random((batch, n)) < 0.1, np.round(fractions), fractions)
        if slide:
            near = np.clip(node.fractions + 0.1 * self.rng.standard_normal((batch, n)), 0, 1)
            fractions = np.where(self.rng.random((batch, 1)) < 0.5, near, fractions)
            stay = self.rng.random((batch, n)) < 0.3
            return np.tile(node.edges, (batch, 1)), np.where(stay, node.fractions, fractions)
        edges = self.rng.integers(0, self.polygon.n_edges, (batch, n))
        held = int(self.rng.integers(max(0, m + n - self.fingers), min(m, n) + 1))
        for row in range(batch):
            kept = self.rng.choice(m, held, replace=False)
            edges[row, :held] = np.array(node.edges)[kept]
            fractions[row, :held] = np.array(node.fractions)[kept]
        return edges, fractions

    def slides(self, one: Held, other: Held) -> bool:
        """Whether the straight slide counts for nothing, or reaches the level."""
        if one.edges != other.edges or any(
            e == f
            and (one.fractions[n] - one.fractions[n + 1])
            * (other.fractions[n] - other.fractions[n + 1])
            <= 0
            for n, (e, f) in enumerate(zip(one.edges, one.edges[1:], strict=False))
        ):
            return False
        f = complete_functions(self.polygon, self.friction, one.edges)
        assert f is not None
        u, v = (np.array(held.fractions) * f.lengths for held in (one, other))
        least = min(self.level, one.level, other.level)
        return least_along(f, u, v, self.measure) >= least - 1e-12

    def arrives(self, start: rl.Grasp, goal: rl.Grasp, rounds: int) -> bool:
        """Whether random motions from start and goal meet."""
        ones, others = self.tree(start, rounds), self.tree(goal, rounds)
        for i, one in enumerate(ones):
            for j, other in enumerate(others):
                if i == j == 0:  # nothing would be chosen
                    continue
                if len(one.places | other.places) <= self.fingers:
                    return True
                if one.edges == other.edges and self.slides(one, other):
                    return True
        return False
