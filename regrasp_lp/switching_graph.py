"""The switching graph: all grasp sets of an object and the switches between them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from regrasp_lp.contact import Grasp
from regrasp_lp.display import graph_html
from regrasp_lp.friction import FloatArray
from regrasp_lp.graph_options import GraphOptions
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.handovers import Switch, every_handover, witnesses
from regrasp_lp.lp import Solver, get_solver
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.objective import ObjectiveLike
from regrasp_lp.planning.plan import Plan
from regrasp_lp.planning.planner import PlanningProblem
from regrasp_lp.planning.requests import GraspLike
from regrasp_lp.planning.steering import Weight
from regrasp_lp.polygon import Polygon
from regrasp_lp.queries import check_count, plans_in
from regrasp_lp.structure import Structure, structure
from regrasp_lp.summary import KindCounts, Summary
from regrasp_lp.switches import SWITCH_ARRAYS, StoredSwitches, Switches, SwitchesOnDemand

if TYPE_CHECKING:
    import networkx as nx

    from regrasp_lp.explanation import Explanation
    from regrasp_lp.planning.path_set import PathSet

Progress = Callable[[str, int, int], None]

_equal = partial(np.array_equal, equal_nan=True)


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

    def _repr_html_(self) -> str:
        return graph_html(self)

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
        return 0 if self.hand.adjacent[contacts[first], contacts[second]] else None

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
        least = self.hand.held(*self.sets.contacts[[first, second]].tolist())
        margin = self.options.min_margin
        return every_handover(self.sets, self._solver, first, second, (least, most), margin)

    def witness(self, first: int, second: int) -> tuple[Grasp, Grasp] | None:
        """Return two grasps that prove a switch, or None if there is none.

        No program is solved, unless the hand limits the distance between fingers.

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
        if self.sets.spacing is not None:
            switch = self.switch(first, second)
            return None if switch is None else switch.witnesses
        found = self.switches.witness(*sorted((first, second)))
        return witnesses(self.sets, first, second, found)

    def neighbors(self, index: int) -> list[int]:
        """Return the numbers of all sets adjacent to one, ascending; IndexError if it is none."""
        self.sets.place(index)
        adjacent = np.zeros(len(self), dtype=bool)
        adjacent[self.switches.neighbors(index)[0]] = True
        for m in (2, 3):
            if self.hand.adjacent[self.sets.contacts[index], m]:
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
        from regrasp_lp.networks import networkx_graph

        return networkx_graph(self)

    def save(self, path: str | Path) -> None:
        """Write the graph to one file, whole or not at all (`load_graph` reads it)."""
        from regrasp_lp.graph_file import save_graph

        save_graph(self, path)

    def to_html(self, path: str | Path | None = None) -> str:
        """Return a page to click in, and write it to `path` if given (`viewer.graph_page`)."""
        from regrasp_lp.viewer import graph_page

        return graph_page(self, path)

    def save_certificates(self, path: str | Path) -> None:
        """Write the proof of every decision to one file (`certificates.save_certificates`).

        ``python regrasp_lp/check_certificates.py FILE`` checks it without this package.
        """
        from regrasp_lp.certificates import save_certificates

        save_certificates(self, path)

    def plan(
        self,
        start: GraspLike,
        goal: GraspLike,
        aligning: str = "slide",
        objective: ObjectiveLike = "placements",
        weight: Weight | None = None,
        avoid_edges: Iterable[int] = (),
        avoid_sets: Iterable[int] = (),
    ) -> Plan:
        """Return the best verified plan from one grasp to another.

        Parameters
        ----------
        start, goal : Grasp or iterable of (edge, position)
            Any force-closure grasps of 2 or 3 contacts. Contact i of the start is finger i + 1,
            unless it names its fingers.
        aligning : {"slide", "regrip"}
            How fingers move inside a set: sliding along the edges, or by free fingers taking over.
            The latter places fingers too; of a path with the fewest placements for switching and
            one over two-finger sets, both without detours, the better plan is taken, which need
            not be the best of all.
        objective : {"placements", "margin", "tolerance", "travel"} or mapping of these to weights
            What the plan is best in: fewest placements (then largest least margin of its sets,
            then smaller set numbers); largest least margin or tolerance over all that can be
            chosen (then fewest placements, then the second least margin, and so on); least travel
            (then fewest placements). Weights make a cost: placements and travel, less margin and
            tolerance, each times its weight.
        weight : callable, optional
            Instead of an objective: ``weight(u, v, data)``, as in networkx, is what a switch from
            set u to set v counts, a number >= 0, or None to hide it. `data` has ``held`` of the
            switch and ``kind``, ``edges``, ``center``, ``margin`` of v, as `to_networkx` has them.
            The sum is least; then as for placements. It is no quantity of a plan: there is no
            bound.
        avoid_edges, avoid_sets : iterable of int
            No plan passes through these sets, or through any over these edges; it may only begin
            or end with those that hold the start or the goal. Bounds are of such plans.

        Returns
        -------
        Plan
            With `Plan.bound` and `Plan.gap`: how far from the best it can be.

        Raises
        ------
        NoPlanFound
            If no plan exists among these sets; ``explanation`` says why.
        NotForceClosureError, ContactError, HandError
            If start or goal is not a grasp that can be held.
        SolverError
            If a solver stopped early.
        """
        nearby = self._too_large_to_search
        steering = weight, avoid_edges, avoid_sets
        request = start, goal, aligning, objective, *steering
        return next(plans_in(self, self._problem, *request, nearby=nearby))

    def plans(
        self,
        start: GraspLike,
        goal: GraspLike,
        k: int = 5,
        aligning: str = "slide",
        objective: ObjectiveLike = "placements",
        weight: Weight | None = None,
        avoid_edges: Iterable[int] = (),
        avoid_sets: Iterable[int] = (),
    ) -> list[Plan]:
        """Return up to k verified plans along different paths of sets, the best first.

        The first is as good as that of `plan`, and the same where switches are stored. For fewest
        placements, or least weight, they follow the k shortest paths that pass through no set
        twice, in that order; with ``aligning="regrip"`` by the placements for switching alone. For
        margin or tolerance they are in the order of these, to the accuracy of linear programs.
        Each has the bound of the first. A path that no plan leads along within rounding, or only
        one with the steps of a better plan, is left out.

        Parameters
        ----------
        start, goal, aligning, weight, avoid_edges, avoid_sets
            As for `plan`.
        k : int
        objective : {"placements", "margin", "tolerance"}

        Returns
        -------
        list of Plan
            Fewer than k if there are no more.

        Raises
        ------
        NoPlanFound, NotForceClosureError, ContactError, HandError, OptionError, SolverError
            As for `plan`.
        """
        check_count(k, objective)
        steering = weight, avoid_edges, avoid_sets
        request = start, goal, aligning, objective, *steering
        return list(islice(plans_in(self, self._problem, *request), k))

    def path_set(
        self, nodes: Iterable[int], start: GraspLike | None = None, goal: GraspLike | None = None
    ) -> PathSet:
        """Return the best convex set of contact choices along a path: the first of `path_sets`."""
        return next(self.path_sets(nodes, start, goal))

    def path_sets(
        self, nodes: Iterable[int], start: GraspLike | None = None, goal: GraspLike | None = None
    ) -> Iterator[PathSet]:
        """Yield the convex sets whose union is all contact choices along a path of sets.

        Fewest placements first; then the largest least margin (`planning.path_sets`).

        Parameters
        ----------
        nodes : iterable of int
            Numbers of sets, each adjacent to the next one.
        start, goal : Grasp or iterable of (edge, position), optional
            Grasps in the first and in the last set; by default free to choose.
        """
        from regrasp_lp.planning.path_sets import path_sets

        return path_sets(self._problem, self.held, nodes, start, goal)

    def explain(
        self, start: GraspLike, goal: GraspLike, progress: Progress | None = None
    ) -> Explanation:
        """Tell why there is no plan between two grasps, and what would help (`why_not.explain`)."""
        from regrasp_lp.why_not import explain_in

        return explain_in(self, start, goal, progress)

    @cached_property
    def _problem(self) -> PlanningProblem:
        return PlanningProblem(self.sets, self.switches, self.hand, self.friction, self._solver)

    @property
    def _too_large_to_search(self) -> bool:
        """Whether switches are not stored and a search without them finds the same."""
        options = GraphOptions(solver=self.options.solver, presolve=self.options.presolve)
        on_demand = isinstance(self.switches, SwitchesOnDemand)
        return on_demand and self.hand == Hand(4) and self.options == options
