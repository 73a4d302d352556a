"""All grasp sets of an object: stacked families, seen as one sequence of sets."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import overload

import numpy as np

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.friction import Cones, FloatArray, IntArray
from regrasp_lp.grasp_sets.grasp_set import GraspSet as GraspSet
from regrasp_lp.grasp_sets.set_pieces import SetPieces
from regrasp_lp.grasp_sets.spacing import Alternatives, Spacing, assignments
from regrasp_lp.grasp_sets.vertices import Family
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import TorqueFunctions

_EQUAL = 1e-12  # of an edge: contacts that are the same but for rounding


@dataclass(frozen=True, eq=False)
class GraspSets(Sequence[GraspSet]):
    """The grasp sets of an object, numbered through its families.

    Parameters
    ----------
    polygon : Polygon
    families : tuple of Family
        Stacked sets of one kind each.
    spacing : Spacing, optional
        Limits to the distance between fingers, if there are any.
    """

    polygon: Polygon
    families: tuple[Family, ...]
    spacing: Spacing | None = None

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
        """Return the torque functions of one set, as a stack of one.

        Over the segments of edges that can be touched: `fractions` and `grasp` lead there and back.
        """
        family, row = self.place(index)
        return self.families[family].functions.take(np.array([row]))

    def pieces(self, index: int) -> SetPieces:
        """Return the convex pieces of one set, best first, over the fractions of `functions`."""
        family, row = self.place(index)
        return self.families[family].pieces_of(row)

    def coupled(
        self, first: int, second: int, slots: Sequence[tuple[int, int]]
    ) -> Alternatives | None:
        """Return what limits the distances between the fingers of two grasps that touch at once.

        Parameters
        ----------
        first, second : int
            Numbers of two sets.
        slots : sequence of (int, int)
            The contacts that both grasps have, as places in the first and in the second set.

        Returns
        -------
        Alternatives or None
            Convex sets of which one has to hold, over the fractions of the contacts of the first
            set and then of those of the second that are not held; None without such limits.
        """
        if self.spacing is None:
            return None
        one, other = (self.functions(i).edges[0] for i in (first, second))
        mine = [i for i in range(len(one)) if i not in [here for here, _ in slots]]
        theirs = [i for i in range(len(other)) if i not in [there for _, there in slots]]
        pairs = [(i, len(one) + n) for i in mine for n in range(len(theirs))]
        return self.spacing.alternatives(np.concatenate((one, other[theirs])), pairs)

    def witness(self, index: int) -> Grasp:
        """Return a best grasp of a set."""
        family, row = self.place(index)
        return self.grasp(index, self.families[family].witnesses[row])

    @property
    def cones(self) -> Cones:
        """The friction cones of all that can be touched: edges, or segments of them."""
        return self.families[0].functions.cones

    def grasp(self, index: int, fractions: FloatArray, near: Iterable[Contact] = ()) -> Grasp:
        """Return the grasp of a set at given fractions of its edges, or of segments of them.

        Parameters
        ----------
        index : int
        fractions : numpy.ndarray, shape (m,) or longer
            As the set's functions take them.
        near : iterable of Contact, optional
            Given contacts (resolved), to be hit exactly: a contact that is one of them but for
            the rounding between fractions of segments and of edges is that one.

        Returns
        -------
        Grasp
            Resolved; no contact is beyond the end of its segment.
        """
        family, row = self.place(index)
        segments = self.families[family].functions.edges[row]
        found = self.cones.along(segments, fractions[: len(segments)]).tolist()
        edges = self.cones.edge[segments].tolist()
        if self.cones.whole is not self.cones:
            given = [(contact.edge, contact.fraction) for contact in near]
            for n, (edge, f) in enumerate(zip(edges, found, strict=True)):
                there = [g for e, g in given if e == edge and g is not None]
                apart, nearest = min(((abs(g - f), g) for g in there), default=(0.0, f))
                found[n] = nearest if apart < _EQUAL else f
        pairs = zip(edges, found, strict=True)
        return self.polygon.resolve(Grasp([Contact.at_fraction(e, f) for e, f in pairs]))

    def fractions(self, index: int, fractions: FloatArray) -> FloatArray:
        """Return fractions of whole edges as those that a set's functions take, shape (m,).

        Parameters
        ----------
        index : int
        fractions : numpy.ndarray, shape (m,)
            Of a grasp in the set, contacts in its order.
        """
        family, row = self.place(index)
        return self.cones.within(self.families[family].functions.edges[row], fractions)

    @cached_property
    def _by_segments(self) -> dict[tuple[int, ...], list[int]]:
        table: dict[tuple[int, ...], list[int]] = {}
        for family, offset in zip(self.families, self.offsets, strict=False):
            for row, segments in enumerate(family.functions.edges.tolist()):
                table.setdefault(tuple(segments), []).append(int(offset) + row)
        return table

    @cached_property
    def _by_edges(self) -> dict[tuple[int, ...], list[int]]:
        table: dict[tuple[int, ...], list[int]] = {}
        for segments, indices in self._by_segments.items():
            table.setdefault(tuple(self.cones.edge[list(segments)].tolist()), []).extend(indices)
        return table

    def on_edges(self, edges: Sequence[int]) -> list[int]:
        """Return the numbers of all sets over a combination of edges, ascending."""
        return sorted(self._by_edges.get(tuple(sorted(edges)), ()))

    def holding(
        self, grasp: Grasp, group: IntArray | None = None
    ) -> list[tuple[int, tuple[int, ...]]]:
        """Return the sets that contain a grasp, or some of its contacts, strictly and exactly.

        Parameters
        ----------
        grasp : Grasp
            Resolved.
        group : numpy.ndarray of int, optional
            Of which group the finger of each contact is (`Cones.group`); by default, all different
            fingers that may touch there are tried.

        Returns
        -------
        list of (int, tuple of int)
            A set, and which contacts of the grasp are its contacts, in its order. Ascending.
        """
        sizes = () if self.spacing is None else self.spacing.sizes
        found = set()
        for count in range(2, len(grasp) + 1):
            for some in map(list, combinations(range(len(grasp)), count)):
                places = grasp.edges[some], grasp.fractions[some]
                of = None if group is None else group[some]
                for segments, fractions in assignments(self.cones, sizes, *places, of):
                    order = np.lexsort((fractions, segments))
                    for index in self._by_segments.get(tuple(segments[order].tolist()), ()):
                        if self._contain(index, fractions[order]):
                            found.add((index, tuple(some[n] for n in order)))
        return sorted(found)

    def _contain(self, index: int, fractions: FloatArray) -> bool:
        if self.spacing is not None:
            return bool(self.pieces(index).contain(fractions).any())
        return bool(self.functions(index).whole.contain(fractions[None, :])[0])

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
            tuple(self.cones.edge[stack.functions.edges[row]].tolist()),
            None if center < 0 else int(self.cones.edge[center]),
            float(stack.margins[row]),
            self.witness(index),
            self.functions(index),
            None if self.spacing is None else self.pieces(index),
        )

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(family)} {family.kind}" for family in self.families)
        return f"<{len(self)} GraspSets of {self.polygon.name!r}: {counts}>"

    def __iter__(self) -> Iterator[GraspSet]:
        return (self[i] for i in range(len(self)))
