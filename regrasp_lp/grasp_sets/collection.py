"""All grasp sets of an object: stacked families, seen as one sequence of sets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray, IntArray
from regrasp_lp.grasp_sets.double_cones import double_cones
from regrasp_lp.grasp_sets.focus import focus_cell, independent_regions
from regrasp_lp.grasp_sets.parallel import common_cone_rays, outer_regions, subpolytopes
from regrasp_lp.grasp_sets.pieces import in_positions, order_rows, piece_sets
from regrasp_lp.grasp_sets.vertices import Family
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.margins import existing_pieces
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import TorqueFunctions


@dataclass(frozen=True, eq=False)
class GraspSet:
    """All force-closure grasps of one kind on one combination of edges.

    A vertex of the switching graph: connected, and the union of the convex `pieces`.

    Parameters
    ----------
    polygon : Polygon
    kind : str
        "two_finger" or "three_finger" of complete sets; "two_finger", "concurrent" or "parallel"
        of the chapter's.
    edges : tuple of int
        Ascending; an edge may occur twice.
    center : int or None
        Centre edge of a parallel set.
    margin : float
        The largest margin of a grasp in it, in the object's unit.
    witness : Grasp
        A grasp strictly inside that attains it (of a set within rounding: the nearest doubles).
    torque : TorqueFunctions
        Its torque functions, a stack of one.
    """

    polygon: Polygon
    kind: str
    edges: tuple[int, ...]
    center: int | None
    margin: float
    witness: Grasp
    torque: TorqueFunctions

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the contact positions: "u4" on edge 4, "u4'" for a second one there."""
        names = [f"u{edge}" for edge in self.edges]
        return tuple(f"{n}'" if n in names[:i] else n for i, n in enumerate(names))

    @cached_property
    def pieces(self) -> LinearSets:
        """The convex pieces ``{M_j < 0 < M_k}``, best first, over positions along the edges.

        Coordinates are named by `names`, rows have the unit of length, and a row's margin is that
        of the torque function. Two contacts on one edge are in order (a row of scale 0).
        """
        pieces = existing_pieces(self.torque)
        sets = piece_sets(self.torque, pieces, self.names)
        sets = in_positions(sets, self.torque.lengths[0])
        return _in_order(sets, self.edges)

    @cached_property
    def focus_cell(self) -> LinearSets | None:
        """The pieces of the focus cell, over "x" and "y", widest first.

        Of a concurrent or a two-finger set (chapter, sections 3.3.1.1 and 3.3.1.2); None of others.
        The margin of a point is its distance to the boundary of the piece.
        """
        if self.kind not in ("concurrent", "two_finger"):
            return None
        return focus_cell(self.torque.cones, np.array(self.edges))

    @cached_property
    def double_cones(self) -> LinearSets | None:
        """The pieces by sides over the contact positions and the focus point, widest first.

        Of a concurrent set: ``s_i (q - p_i)`` in the cone of each contact, over `names`, "x" and
        "y" (chapter, Propositions 3.4 and 3.6); None of others.
        """
        if self.kind != "concurrent":
            return None
        sets = double_cones(self.torque.cones, np.array(self.edges), self.names)
        return in_positions(sets, [*self.torque.lengths[0], 1.0, 1.0])

    @cached_property
    def common_cone(self) -> FloatArray | None:
        """The boundaries of the common cone of a parallel set, clockwise first, shape (2, 2).

        Unit vectors, as at the contacts that are not on the centre edge; None of other sets.
        """
        if self.center is None:
            return None
        return common_cone_rays(self.torque.cones, self.center, self._others)

    @cached_property
    def subpolytopes(self) -> LinearSets | None:
        """The chapter's six sub-polytopes K0 to K5 of a parallel set; None of other sets.

        Over `names`, closed; their margins fall to 0 at walls inside the set (see `pieces`).
        """
        if self.center is None:
            return None
        return in_positions(subpolytopes(self.torque, self.names), self.torque.lengths[0])

    def outer_regions(self, position: float | None = None) -> LinearSets:
        """Return the left and the right outer region of a parallel set, over "x" and "y".

        Parameters
        ----------
        position : float, optional
            Of a contact on the centre edge, at which the common cone is drawn; by default cones
            are drawn at all of the edge (the chapter's union volume).

        Raises
        ------
        OptionError
            If this is no parallel set, or the position is not on its centre edge.
        """
        if self.center is None:
            raise OptionError(f"outer regions are those of a parallel set; this one is {self.kind}")
        length = float(self.torque.cones.lengths[self.center])
        number = position is None or isinstance(position, (int, float, np.number))
        if not number or (position is not None and not 0 <= position <= length):
            raise OptionError(
                f"position {position!r} is not on the centre edge {self.center}, from 0 to "
                f"{length:g}"
            )
        span = (0.0, 1.0) if position is None else (position / length, position / length)
        return outer_regions(self.torque.cones, self.center, self._others, np.array(span))

    def independent_regions(self, point: ArrayLike) -> FloatArray:
        """Return the independent contact regions at a point of the focus cell.

        Contacts may be anywhere inside them, each on its own.

        Parameters
        ----------
        point : array_like, shape (2,)

        Returns
        -------
        numpy.ndarray, shape (m, 2)
            First and last position on each edge, in the order of `edges`.

        Raises
        ------
        OptionError
            If the set has no focus cell, or the point is not inside it.
        """
        if self.focus_cell is None:
            raise OptionError(
                f"a {self.kind} set has no focus cell: a concurrent or two-finger does"
            )
        try:
            q = np.array(point, dtype=np.float64)
        except (TypeError, ValueError):
            q = np.zeros(0)
        if q.shape != (2,) or not np.isfinite(q).all():
            raise OptionError(f"a focus point is a pair of coordinates, got {point!r}")
        return independent_regions(self.torque.cones, np.array(self.edges), self.focus_cell, q)

    @property
    def _others(self) -> list[int]:
        return [edge for edge in self.edges if edge != self.center]

    def __contains__(self, grasp: object) -> bool:
        """Whether a grasp on exactly these edges is strictly inside, decided exactly."""
        if not isinstance(grasp, Grasp):
            return False
        resolved = self.polygon.resolve(grasp)
        order = slot_order(resolved)
        if tuple(resolved.edges[order].tolist()) != self.edges:
            return False
        return bool(self.torque.contain(resolved.fractions[order][None, :])[0])

    def __repr__(self) -> str:
        center = "" if self.center is None else f", centre {self.center}"
        return f"<GraspSet {self.kind} on edges {self.edges}{center}, margin {self.margin:.4g}>"


def slot_order(grasp: Grasp) -> IntArray:
    """Return the order of a grasp's contacts by edge and then along it, as sets have them."""
    return np.lexsort((grasp.fractions, grasp.edges))


@dataclass(frozen=True, eq=False)
class GraspSets(Sequence[GraspSet]):
    """The grasp sets of an object, numbered through its families.

    Parameters
    ----------
    polygon : Polygon
    families : tuple of Family
        Stacked sets of one kind each.
    """

    polygon: Polygon
    families: tuple[Family, ...]

    @cached_property
    def offsets(self) -> IntArray:
        """Number of the first set of each family, and the number of all sets."""
        return np.cumsum([0, *(len(family) for family in self.families)])

    @cached_property
    def contacts(self) -> IntArray:
        """Number of contacts of each set, shape (N,)."""
        return np.concatenate([np.full(len(f), f.functions.m) for f in self.families])

    @cached_property
    def margins(self) -> FloatArray:
        """Largest margin of each set, shape (N,)."""
        return np.concatenate([family.margins for family in self.families])

    @property
    def sources(self) -> tuple[TorqueFunctions, ...]:
        """The torque functions of each family."""
        return tuple(family.functions for family in self.families)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """Kind of each set."""
        return tuple(family.kind for family in self.families for _ in range(len(family)))

    def place(self, index: int) -> tuple[int, int]:
        """Return the family of a set and its row there.

        Raises
        ------
        IndexError
            If there is no such set.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"no grasp set {index}: there are {len(self)}, numbered from 0")
        family = int(np.searchsorted(self.offsets, index, side="right")) - 1
        return family, int(index - self.offsets[family])

    def functions(self, index: int) -> TorqueFunctions:
        """Return the torque functions of one set, as a stack of one."""
        family, row = self.place(index)
        return self.families[family].functions.take(np.array([row]))

    def witness(self, index: int) -> Grasp:
        """Return a best grasp of a set."""
        family, row = self.place(index)
        return self.grasp(index, self.families[family].witnesses[row])

    def grasp(self, index: int, fractions: FloatArray) -> Grasp:
        """Return the grasp of a set at given fractions of its edges."""
        family, row = self.place(index)
        edges = self.families[family].functions.edges[row]
        pairs = zip(edges.tolist(), fractions[: len(edges)].tolist(), strict=True)
        return self.polygon.resolve(Grasp([Contact.at_fraction(e, f) for e, f in pairs]))

    @cached_property
    def _by_edges(self) -> dict[tuple[int, ...], list[int]]:
        table: dict[tuple[int, ...], list[int]] = {}
        for family, offset in zip(self.families, self.offsets, strict=False):
            for row, edges in enumerate(family.functions.edges.tolist()):
                table.setdefault(tuple(edges), []).append(int(offset) + row)
        return table

    def on_edges(self, edges: Sequence[int]) -> list[int]:
        """Return the numbers of all sets over a combination of edges."""
        return list(self._by_edges.get(tuple(sorted(edges)), ()))

    def holding(self, grasp: Grasp) -> list[tuple[int, tuple[int, ...]]]:
        """Return the sets that contain a grasp, or some of its contacts, strictly and exactly.

        Parameters
        ----------
        grasp : Grasp
            Resolved.

        Returns
        -------
        list of (int, tuple of int)
            A set, and which contacts of the grasp are its contacts, in its order. Ascending.
        """
        order = slot_order(grasp)
        found = []
        for count in range(2, len(grasp) + 1):
            for chosen in combinations(order.tolist(), count):
                fractions = grasp.fractions[list(chosen)][None, :]
                for index in self.on_edges(grasp.edges[list(chosen)].tolist()):
                    if self.functions(index).contain(fractions)[0]:
                        found.append((index, tuple(chosen)))
        return sorted(found)

    def __len__(self) -> int:
        return int(self.offsets[-1])

    @overload
    def __getitem__(self, index: int) -> GraspSet: ...

    @overload
    def __getitem__(self, index: slice) -> list[GraspSet]: ...

    def __getitem__(self, index: int | slice) -> GraspSet | list[GraspSet]:
        """Return one set, made on request from the arrays."""
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        index = index + len(self) if index < 0 else index
        family, row = self.place(index)
        stack = self.families[family]
        center = int(stack.centers[row])
        return GraspSet(
            self.polygon,
            stack.kind,
            tuple(stack.functions.edges[row].tolist()),
            None if center < 0 else center,
            float(stack.margins[row]),
            self.witness(index),
            self.functions(index),
        )

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(family)} {family.kind}" for family in self.families)
        return f"<{len(self)} GraspSets of {self.polygon.name!r}: {counts}>"

    def __iter__(self) -> Iterator[GraspSet]:
        return (self[i] for i in range(len(self)))


def _in_order(sets: LinearSets, edges: tuple[int, ...]) -> LinearSets:
    """Add ``u_i - u_{i+1} <= 0`` where two contacts are on one edge."""
    rows = order_rows(edges)
    if not len(rows):
        return sets
    zeros = np.zeros((len(sets), len(rows)))
    return LinearSets(
        sets.names,
        np.concatenate((sets.rows, np.tile(rows, (len(sets), 1, 1))), axis=1),
        np.concatenate((sets.scales, zeros), axis=1),
        np.concatenate((sets.bounds, zeros), axis=1),
        sets.lower,
        sets.upper,
    )
