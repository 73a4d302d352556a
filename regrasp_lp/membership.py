"""Which sets of a graph hold many given grasps, and whether they are adjacent: all at once.

`SwitchingGraph.locate` and `held` answer for one grasp and for one pair. Here thousands are looked
up by the numbers of their edges, in the graph itself or, where that would be too large to build,
among the sets of the combinations of edges that are asked for, made by the same functions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from regrasp_lp.contact_rule import meet_held
from regrasp_lp.friction import BoolArray, Cones, FloatArray, IntArray, spanning
from regrasp_lp.grasp_sets.candidates import (
    concurrent_candidates,
    parallel_candidates,
    runs,
    two_finger_candidates,
)
from regrasp_lp.grasp_sets.families import parallel_functions
from regrasp_lp.grasp_sets.vertices import kinds_of
from regrasp_lp.lp import get_solver
from regrasp_lp.shadows import Shadows, shadows
from regrasp_lp.switches import Decide, StoredSwitches, SwitchesOnDemand
from regrasp_lp.switching import Meeting
from regrasp_lp.switching_graph import SwitchingGraph
from regrasp_lp.torque import TorqueFunctions, torque_functions

_CHUNK = 20_000


@dataclass(frozen=True, eq=False)
class SetTable:
    """Stacks of grasp sets of one object, to be looked up by their edges.

    Parameters
    ----------
    sources : tuple of TorqueFunctions
        Set numbers run through them.
    """

    sources: tuple[TorqueFunctions, ...]

    @cached_property
    def offsets(self) -> IntArray:
        """Number of the first set of each source, and the number of all sets."""
        return np.cumsum([0, *(len(source) for source in self.sources)])

    @cached_property
    def _sorted(self) -> list[tuple[IntArray, IntArray]]:
        """Keys of the edges of each source, ascending, and the rows that they belong to."""
        tables: list[tuple[IntArray, IntArray]] = []
        for source in self.sources:
            keys = edge_keys(source.edges, source.cones.n_edges)
            order = np.argsort(keys, kind="stable")
            tables.append((keys[order], order))
        return tables

    def holding(self, edges: IntArray, fractions: FloatArray) -> tuple[IntArray, IntArray]:
        """Return the sets that contain grasps strictly, on exactly their edges, decided exactly.

        Parameters
        ----------
        edges, fractions : numpy.ndarray, shape (N, m)
            Contacts in any order.

        Returns
        -------
        grasp, number : numpy.ndarray of int
            Pairs of a row and the number of a set that holds it, rows ascending.
        """
        order = np.lexsort((fractions, edges))
        edges = np.take_along_axis(edges, order, axis=1)
        fractions = np.take_along_axis(fractions, order, axis=1)
        found = [np.zeros((0, 2), dtype=np.intp)]
        for source, (keys, rows), low in zip(
            self.sources, self._sorted, self.offsets, strict=False
        ):
            if source.m != edges.shape[1] or not len(source):
                continue
            wanted = edge_keys(edges, source.cones.n_edges)
            first, last = (np.searchsorted(keys, wanted, side) for side in ("left", "right"))
            grasp = np.arange(len(edges)).repeat(last - first)
            row = rows[runs(first, last - first)]
            for start in range(0, len(grasp), _CHUNK):
                here = slice(start, start + _CHUNK)
                inside = source.take(row[here]).contain(fractions[grasp[here]])
                found.append(np.stack((grasp[here], low + row[here]), axis=1)[inside])
        pairs = np.concatenate(found)
        pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
        return pairs[:, 0], pairs[:, 1]

    def joined(
        self, first: IntArray, second: IntArray, held: IntArray, decide: Decide
    ) -> BoolArray:
        """Whether pairs of sets can be switched between while contacts on given edges are held.

        Parameters
        ----------
        first, second : numpy.ndarray of int, shape (P,)
            Numbers of sets.
        held : numpy.ndarray of int, shape (P, h)
            Edges of the held contacts, which both sets have.
        decide : callable
            Whether aligned projections have a common point.

        Returns
        -------
        numpy.ndarray of bool, shape (P,)
        """
        if not len(first):
            return np.zeros(0, dtype=bool)
        used = np.unique(np.concatenate((first, second)))
        low, high = self.offsets[:-1], self.offsets[1:]
        rows = [used[(used >= a) & (used < b)] - a for a, b in zip(low, high, strict=True)]
        stack = shadows(self.sources, held.shape[1], rows)
        n, ascending = self.sources[0].cones.n_edges, np.sort(held, axis=1)
        # Two contacts on one edge are interchangeable: the edges tell which projection it is.
        numbers = self.offsets[stack.source] + stack.row
        keys = edge_keys(np.column_stack((numbers, np.sort(stack.edges, axis=1))), n)
        order = np.argsort(keys)
        one, other = (
            order[np.searchsorted(keys[order], edge_keys(np.column_stack((number, ascending)), n))]
            for number in (first, second)
        )
        return decide(stack, stack, one, other).exist


class KnownSets(Protocol):
    """The sets of an object that a measurement asks for."""

    def over(self, *edges: IntArray) -> SetTable:
        """Return a table that has all sets on given combinations of edges, of shape (N, m) each."""

    def adjacent(
        self, table: SetTable, first: IntArray, second: IntArray, held: IntArray
    ) -> BoolArray:
        """Whether pairs of sets of a table are adjacent, and can hold as many contacts as `held`.

        The parameters are those of `SetTable.joined`.
        """


@dataclass(frozen=True, eq=False)
class GraphSets:
    """The sets and switches of a graph.

    Parameters
    ----------
    graph : SwitchingGraph
    """

    graph: SwitchingGraph

    @cached_property
    def _table(self) -> SetTable:
        return SetTable(self.graph.sets.sources)

    def over(self, *edges: IntArray) -> SetTable:
        """Return the table of all sets of the graph."""
        return self._table

    @cached_property
    def n_combinations(self) -> int:
        """On how many combinations of edges there are sets."""
        n = self.graph.polygon.n_edges
        keys = [np.unique(edge_keys(s.edges, n)) for s in self._table.sources]
        contacts = [s.m for s in self._table.sources]
        return sum(
            len(
                np.unique(
                    np.concatenate([k for k, c in zip(keys, contacts, strict=True) if c == m])
                )
            )
            for m in set(contacts)
        )

    @cached_property
    def _stored(self) -> tuple[IntArray, IntArray]:
        """Keys of all stored pairs, ascending, and the most contacts that each can hold."""
        switches = self.graph.switches
        assert isinstance(switches, StoredSwitches)
        rows = np.arange(len(switches.starts) - 1).repeat(np.diff(switches.starts))
        keys = edge_keys(np.column_stack((rows, switches.others)), len(self.graph))
        return np.append(keys, -1), np.append(switches.held, 0)

    def adjacent(
        self, table: SetTable, first: IntArray, second: IntArray, held: IntArray
    ) -> BoolArray:
        """Whether pairs of sets are adjacent in the graph, holding at least as many contacts."""
        switches = self.graph.switches
        if isinstance(switches, SwitchesOnDemand):
            return table.joined(first, second, held, switches.rule.decide)
        keys, most = self._stored
        wanted = edge_keys(np.column_stack((first, second)), len(self.graph))
        place = np.searchsorted(keys[:-1], wanted)
        return np.asarray((keys[place] == wanted) & (most[place] >= held.shape[1]))


@dataclass(frozen=True, eq=False)
class CombinationSets:
    """The sets that a graph would have on given combinations of edges, without the graph.

    Candidates, existence and switches are decided by the functions that build the graph.

    Parameters
    ----------
    cones : Cones
    sets : {"complete", "chapter"}
    """

    cones: Cones
    sets: str

    @cached_property
    def _candidates(self) -> dict[str, tuple[IntArray, IntArray]]:
        """Edges and centres of the candidates of the chapter's kinds."""
        pairs, triples = two_finger_candidates(self.cones), concurrent_candidates(self.cones)
        return {
            "two_finger": (pairs, np.full(len(pairs), -1)),
            "concurrent": (triples, np.full(len(triples), -1)),
            "parallel": parallel_candidates(self.cones),
        }

    def over(self, *edges: IntArray) -> SetTable:
        """Return the table of all sets on given combinations of edges, of shape (N, m) each."""
        found = []
        for m in (2, 3):
            asked = [np.sort(rows, axis=1) for rows in edges if rows.shape[1] == m]
            if asked:
                combinations = np.unique(np.concatenate(asked), axis=0)
                kinds = [k for k in kinds_of(self.sets) if (k == "two_finger") == (m == 2)]
                found += [self._existing(kind, combinations) for kind in kinds]
        return SetTable(tuple(found))

    def _existing(self, kind: str, combinations: IntArray) -> TorqueFunctions:
        if self.sets == "complete":
            functions = torque_functions(
                self.cones, combinations[spanning(self.cones, combinations)]
            )
        else:
            edges, centers = self._candidates[kind]
            n = self.cones.n_edges
            wanted = np.isin(edge_keys(edges, n), edge_keys(combinations, n))
            edges, centers = edges[wanted], centers[wanted]
            functions = (
                parallel_functions(self.cones, edges, centers)
                if kind == "parallel"
                else torque_functions(self.cones, edges)
            )
        return functions.take(np.flatnonzero(functions.exists()))

    def adjacent(
        self, table: SetTable, first: IntArray, second: IntArray, held: IntArray
    ) -> BoolArray:
        """Whether pairs of sets are adjacent by the contact rule."""
        solver = get_solver("clarabel")

        def decide(one: Shadows, other: Shadows, i: IntArray, j: IntArray) -> Meeting:
            return meet_held(one, other, i, j, solver=solver)

        return table.joined(first, second, held, decide)


def edge_keys(edges: IntArray, n_edges: int) -> IntArray:
    """Return one number for each row: equal iff all but the first column are edges and rows are.

    Examples
    --------
    >>> edge_keys(np.array([[0, 2, 3], [1, 0, 0]]), 10).tolist()
    [23, 100]
    """
    keys = edges[:, 0].astype(np.int64)
    for column in range(1, edges.shape[1]):
        keys = keys * n_edges + edges[:, column]
    return keys
