"""The switching graph: all grasp sets of an object and the switches between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from regrasp_lp.completion import complete
from regrasp_lp.contact import Grasp
from regrasp_lp.errors import NoPlanFound
from regrasp_lp.friction import Cones, FloatArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.handovers import Switch, handovers
from regrasp_lp.lp import Solver, get_solver
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.on_demand import problem_on_demand
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.planner import (
    GraspLike,
    PlanningProblem,
    check_aligning,
    checked_grasp,
)
from regrasp_lp.polygon import Polygon
from regrasp_lp.shadows import places_of
from regrasp_lp.structure import Structure, structure
from regrasp_lp.summary import KindCounts, Summary
from regrasp_lp.switches import (
    SWITCH_ARRAYS,
    StoredSwitches,
    Switches,
    SwitchesOnDemand,
)

if TYPE_CHECKING:
    import networkx as nx

Progress = Callable[[str, int, int], None]

_equal = partial(np.array_equal, equal_nan=True)


@dataclass(frozen=True)
class GraphOptions:
    """How a graph was built; see `build_switching_graph`."""

    sets: str = "complete"
    switching: str = "contact"
    min_margin: float = 0.0
    solver: str = "clarabel"
    presolve: bool = True


@dataclass(frozen=True, eq=False)
class SwitchingGraph:
    """Grasp sets (vertices) and the switches between them (edges) of one object.

    Made by `build_switching_graph` or `load_graph`.

    Parameters
    ----------
    sets : GraspSets
        A sequence of `GraspSet`, stacked inside.
    switches : Switches
        Pairs that can hold contacts in common. Pairs that need to hold none are adjacent without
        being listed.
    friction : numpy.ndarray, shape (n_edges,)
    hand : Hand
    options : GraphOptions
        As given to `build_switching_graph`.
    seconds : dict of str to float
        How long the parts of the construction took.
    """

    sets: GraspSets
    switches: Switches
    friction: FloatArray
    hand: Hand
    options: GraphOptions
    seconds: dict[str, float]

    @property
    def polygon(self) -> Polygon:
        """The object."""
        return self.sets.polygon

    @cached_property
    def _solver(self) -> Solver:
        return get_solver(self.options.solver)

    def __len__(self) -> int:
        return len(self.sets)

    def __eq__(self, other: object) -> bool:
        """Whether two graphs have the same object, options, sets and switches, bit for bit."""
        if not isinstance(other, SwitchingGraph):
            return NotImplemented
        same = (
            self.polygon == other.polygon
            and self.hand == other.hand
            and self.options == other.options
            and [f.kind for f in self.sets.families] == [f.kind for f in other.sets.families]
        )
        mine, theirs = self._arrays(), other._arrays()
        return same and len(mine) == len(theirs) and all(map(_equal, mine, theirs))

    __hash__ = None  # type: ignore[assignment]

    def _arrays(self) -> list[np.ndarray]:
        arrays: list[np.ndarray] = [self.friction]
        for family in self.sets.families:
            arrays += [family.functions.edges, family.centers, family.margins, family.witnesses]
        if isinstance(self.switches, StoredSwitches):
            arrays += [getattr(self.switches, name) for name in SWITCH_ARRAYS]
        return arrays

    def __reduce__(self) -> tuple[Callable[..., SwitchingGraph], tuple[object, ...]]:
        """Pickle what a file holds: small, and also if switches are found on demand."""
        from regrasp_lp.graph_file import graph_from_bytes, graph_to_bytes

        return graph_from_bytes, (graph_to_bytes(self), "pickle", self.polygon)

    def __repr__(self) -> str:
        return f"<SwitchingGraph of {self.polygon.name!r}: {len(self)} {self.options.sets} sets>"

    def locate(self, grasp: GraspLike) -> tuple[int, ...]:
        """Return the sets that contain a grasp strictly, decided exactly.

        Also two-finger sets that contain two of three contacts.

        Parameters
        ----------
        grasp : Grasp or iterable of (edge, position)

        Returns
        -------
        tuple of int
            Ascending; empty if the grasp is in no set.
        """
        return tuple(dict.fromkeys(i for i, _ in self.sets.holding(self.polygon.resolve(grasp))))

    def held(self, first: int, second: int) -> int | None:
        """Return how many contacts a switch can hold, or None if the sets are not adjacent."""
        self.sets.place(first)
        self.sets.place(second)
        if first == second:
            return None
        others, held = self.switches.neighbors(first)
        found = held[others == second]
        if found.size:
            return int(found[0])
        contacts = self.sets.contacts
        return 0 if self.hand.held(contacts[first], contacts[second]) == 0 else None

    def switch(self, first: int, second: int) -> Switch | None:
        """Return all ways to switch between two sets, or None if there is none.

        Parameters
        ----------
        first, second : int
            Numbers of sets.

        Returns
        -------
        Switch or None

        Raises
        ------
        IndexError
            If there is no such set.
        """
        most = self.held(first, second)
        if most is None:
            return None
        contacts = self.sets.contacts
        least = self.hand.held(contacts[first], contacts[second])
        every = [
            handover
            for held in range(most, least - 1, -1)
            for handover in handovers(self.sets, self._solver, first, second, held)
        ]
        found = [h for h in every if h.margin > self.options.min_margin] or every[:1]
        edges = self.sets[first].edges
        return Switch(
            first,
            second,
            tuple(tuple(edges[here] for here, _ in h.slots) for h in found),
            tuple(
                (self.sets.grasp(first, h.first), self.sets.grasp(second, h.second)) for h in found
            ),
            tuple(found),
        )

    def witness(self, first: int, second: int) -> tuple[Grasp, Grasp] | None:
        """Return two grasps that prove a switch, or None if there is none. No program is solved.

        Parameters
        ----------
        first, second : int
            Numbers of sets.

        Returns
        -------
        tuple of Grasp or None
            One in each set, equal in as many contacts as the switch can hold. `switch` finds
            those with the largest margin.

        Raises
        ------
        IndexError
            If there is no such set.
        """
        if self.held(first, second) is None:
            return None
        low, high = sorted((first, second))
        found = self.switches.witness(low, high)
        slots, points = found or (np.zeros(0, dtype=np.int8), np.zeros(0))
        edges = np.array(self.sets[low].edges)[slots]
        grasps = {}
        for index in (low, high):
            family, row = self.sets.place(index)
            functions = self.sets.families[family].functions.take(np.array([row]))
            there = places_of(edges[None, :], functions.edges)
            fractions = complete(functions, there, points[None, :])
            grasps[index] = self.sets.grasp(index, fractions[0])
        return grasps[first], grasps[second]

    def neighbors(self, index: int) -> list[int]:
        """Return the numbers of all adjacent sets, ascending.

        Parameters
        ----------
        index : int

        Raises
        ------
        IndexError
            If there is no such set.
        """
        self.sets.place(index)
        adjacent = np.zeros(len(self), dtype=bool)
        adjacent[self.switches.neighbors(index)[0]] = True
        for m in (2, 3):
            if self.hand.held(int(self.sets.contacts[index]), m) == 0:
                adjacent |= self.sets.contacts == m
        adjacent[index] = False
        found: list[int] = np.flatnonzero(adjacent).tolist()
        return found

    @cached_property
    def _structure(self) -> Structure:
        return structure(self.sets, self.switches, self.hand)

    @property
    def n_switches(self) -> int:
        """Number of adjacent pairs, those that need to hold nothing included."""
        return self._structure.n_switches

    def components(self) -> list[set[int]]:
        """Return the connected components, as sets of set numbers, largest first."""
        labels = self._structure.component
        order = np.argsort(labels, kind="stable")
        groups = np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)
        return sorted((set(g.tolist()) for g in groups if g.size), key=lambda c: (-len(c), min(c)))

    def summary(self) -> Summary:
        """Return counts per kind, components and times; printable."""
        within = self._structure.within_kind
        kinds = {
            family.kind: KindCounts(
                family.n_candidates, len(family), len(np.unique(within[low : low + len(family)]))
            )
            for family, low in zip(self.sets.families, self.sets.offsets, strict=False)
        }
        return Summary(
            self.polygon.name,
            self.polygon.n_edges,
            kinds,
            len(self),
            self.n_switches,
            [len(component) for component in self.components()],
            dict(self.seconds),
        )

    def to_networkx(self) -> nx.Graph[int]:
        """Return the graph as a `networkx.Graph`, all edges explicit.

        Nodes carry ``kind``, ``edges``, ``center`` and ``margin``; edges carry ``held``, the
        largest number of contacts that the switch can hold.
        """
        import networkx as nx

        graph: nx.Graph[int] = nx.Graph(name=self.polygon.name)
        for index, grasp_set in enumerate(self.sets):
            graph.add_node(
                index,
                kind=grasp_set.kind,
                edges=grasp_set.edges,
                center=grasp_set.center,
                margin=grasp_set.margin,
            )
        for index in range(len(self)):
            others, held = self.switches.neighbors(index)
            listed = dict(zip(others.tolist(), held.tolist(), strict=True))
            graph.add_edges_from(
                (index, other, {"held": listed.get(other, 0)})
                for other in self.neighbors(index)
                if other > index
            )
        return graph

    def save(self, path: str | Path) -> None:
        """Write the graph to one file, whole or not at all (`load_graph` reads it)."""
        from regrasp_lp.graph_file import save_graph

        save_graph(self, path)

    def save_certificates(self, path: str | Path) -> None:
        """Write the proof of every decision to one file (`certificates.save_certificates`).

        ``python regrasp_lp/check_certificates.py FILE`` checks it without this package.
        """
        from regrasp_lp.certificates import save_certificates

        save_certificates(self, path)

    def plan(self, start: GraspLike, goal: GraspLike, aligning: str = "slide") -> Plan:
        """Return a verified plan with the fewest placements from one grasp to another.

        Parameters
        ----------
        start, goal : Grasp or iterable of (edge, position)
            Any force-closure grasps of 2 or 3 contacts. Contact i of the start is finger i + 1.
        aligning : {"slide", "regrip"}
            How fingers move inside a set: sliding along the edges, or by free fingers taking over.
            The latter places fingers too; of a path with the fewest placements for switching and
            one over two-finger sets, both without detours, the better plan is taken, which need
            not be the best of all.

        Returns
        -------
        Plan

        Raises
        ------
        NoPlanFound
            If no plan exists among these sets; ``explanation`` says why.
        NotForceClosureError, ContactError, HandError
            If start or goal is not a grasp that can be held.
        SolverError
            If a solver stopped early.
        """
        check_aligning(aligning)
        grasps = {
            role: checked_grasp(self.polygon, grasp, self.friction, self.hand, role)
            for role, grasp in (("start", start), ("goal", goal))
        }
        where = {role: self.locate(grasp) for role, grasp in grasps.items()}
        for role, found in where.items():
            if not found:
                raise NoPlanFound(
                    f"no plan exists among these sets: the {role} is in none of the "
                    f"{len(self)} {self.options.sets} sets" + self._why_in_no_set()
                )
        problem = PlanningProblem(self.sets, self.switches, self.hand, self.friction, self._solver)
        if self._too_large_to_search:
            nearer = problem_on_demand(
                self.polygon,
                self._cones,
                self._solver,
                grasps["start"],
                grasps["goal"],
                all_pairs=aligning == "regrip",
            )
            problem = problem if nearer is None else nearer
        plan = problem.plan(grasps["start"], grasps["goal"], aligning)
        if plan is None:
            raise NoPlanFound(
                f"no plan exists among these sets: {self._component_text('start', where['start'])}"
                f", {self._component_text('goal', where['goal'])}, of "
                f"{len(self.components())} components"
            )
        return plan

    @property
    def _cones(self) -> Cones:
        return self.sets.families[0].functions.cones

    @property
    def _too_large_to_search(self) -> bool:
        """Whether switches are not stored and a search without them finds the same."""
        options = GraphOptions(solver=self.options.solver, presolve=self.options.presolve)
        on_demand = isinstance(self.switches, SwitchesOnDemand)
        return on_demand and self.hand == Hand(4) and self.options == options

    def _why_in_no_set(self) -> str:
        if self.options.min_margin:
            return f" with a margin above {self.options.min_margin:g}"
        return ', which do not cover all force-closure grasps: use sets="complete"'

    def _component_text(self, role: str, found: tuple[int, ...]) -> str:
        components = self.components()
        inside = [
            f"component {number} ({len(component)} sets)"
            for number, component in enumerate(components)
            if component & set(found)
        ]
        return f"the {role} is in {' and '.join(inside)}"
