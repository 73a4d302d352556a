"""One grasp set of an object, as users see it: its grasps, pieces and the chapter's forms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.contact import Grasp
from regrasp_lp.display import Pictured
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.double_cones import double_cones
from regrasp_lp.grasp_sets.focus import focus_cell, independent_regions
from regrasp_lp.grasp_sets.parallel import common_cone_rays, outer_regions, subpolytopes
from regrasp_lp.grasp_sets.pieces import in_positions, order_rows, piece_sets
from regrasp_lp.grasp_sets.set_pieces import SetPieces
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.margins import existing_pieces
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import TorqueFunctions


@dataclass(frozen=True, eq=False)
class GraspSet(Pictured):
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
        Its torque functions, a stack of one; if the hand's limits shorten edges, over the segments
        that can be touched.
    limited : SetPieces, optional
        Its pieces, if the hand limits the distance between fingers.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])
    >>> pair = rl.build_switching_graph(block, friction=0.4).sets[0]
    >>> pair
    <GraspSet two_finger on edges (0, 2), margin 0.5571>
    >>> rl.Grasp([(0, 2), (2, 4)]) in pair, rl.Grasp([(0, 1), (2, 1)]) in pair
    (True, False)
    >>> pair.pieces
    <1 LinearSets over u0, u2: 2 rows · x + scales ε <= bounds>
    """

    polygon: Polygon
    kind: str
    edges: tuple[int, ...]
    center: int | None
    margin: float
    witness: Grasp
    torque: TorqueFunctions
    limited: SetPieces | None = None

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
        if self.limited is not None:
            sets = self.limited.linear(self.names)
        else:
            sets = piece_sets(self.torque, existing_pieces(self.torque), self.names)
        return _in_order(self._in_positions(sets), self.torque.edges[0].tolist())

    @cached_property
    def spans(self) -> FloatArray:
        """First and last position that each contact has in grasps of the set, shape (m, 2).

        All positions between them occur, each with some positions of the others: u_i does iff
        ``min_j M_j < 0`` where the others are 0 and ``max_k M_k > 0`` where they are at their
        ends. Limits to the distance between fingers are not counted.
        """
        m, spans = self.torque.m, np.empty((self.torque.m, 2))
        for i in range(m):
            unit = np.eye(m)[i]
            with np.errstate(divide="ignore", invalid="ignore"):
                first, then = (self.torque.values(1 - unit * t)[0] for t in (1, 0))
                lows = np.where(first > 0, 0.0, np.where(then > 0, first / (first - then), np.inf))
                first, then = (self.torque.values(unit * t)[0] for t in (0, 1))
                highs = np.where(
                    then < 0, 1.0, np.where(first < 0, first / (first - then), -np.inf)
                )
            spans[i] = lows.min(), highs.max()
        spans *= self.torque.lengths[0][:, None]
        return np.asarray(spans + self.torque.first_positions[0][:, None])

    def _in_positions(self, sets: LinearSets) -> LinearSets:
        """Sets over fractions of the contacts, and more, as sets over positions along edges."""
        m, cones, segments = self.torque.m, self.torque.cones, self.torque.edges[0]
        more = np.zeros(len(sets.names) - m)
        lengths, starts = self.torque.lengths[0], self.torque.first_positions[0]
        moved = in_positions(sets, np.append(lengths, more + 1), np.append(starts, more))
        if cones.whole is not cones:  # ends as the positions of contacts there are
            whole = cones.whole.lengths[cones.edge[segments]]
            moved.lower[:, :m] = cones.lower[segments] * whole
            moved.upper[:, :m] = cones.upper[segments] * whole
        return moved

    @cached_property
    def focus_cell(self) -> LinearSets | None:
        """The pieces of the focus cell, over "x" and "y", widest first.

        Of a concurrent or a two-finger set (chapter, sections 3.3.1.1 and 3.3.1.2); None of others.
        The margin of a point is its distance to the boundary of the piece.
        """
        if self.kind not in ("concurrent", "two_finger"):
            return None
        return focus_cell(self.torque.cones, self.torque.edges[0])

    @cached_property
    def double_cones(self) -> LinearSets | None:
        """The pieces by sides over the contact positions and the focus point, widest first.

        Of a concurrent set: ``s_i (q - p_i)`` in the cone of each contact, over `names`, "x" and
        "y" (chapter, Propositions 3.4 and 3.6); None of others.
        """
        if self.kind != "concurrent":
            return None
        sets = double_cones(self.torque.cones, self.torque.edges[0], self.names)
        return self._in_positions(sets)

    @cached_property
    def common_cone(self) -> FloatArray | None:
        """The boundaries of the common cone of a parallel set, clockwise first, shape (2, 2).

        Unit vectors, as at the contacts that are not on the centre edge; None of other sets.
        """
        if self.center is None:
            return None
        return common_cone_rays(self.torque.cones.whole, self.center, self._others)

    @cached_property
    def subpolytopes(self) -> LinearSets | None:
        """The chapter's six sub-polytopes K0 to K5 of a parallel set; None of other sets.

        Over `names`, closed; their margins fall to 0 at walls inside the set (see `pieces`).
        """
        if self.center is None:
            return None
        return self._in_positions(subpolytopes(self.torque, self.names))

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
        slot, cones = self.edges.index(self.center), self.torque.cones
        length = float(cones.whole.lengths[self.center])
        number = position is None or isinstance(position, (int, float, np.number))
        if not number or (position is not None and not 0 <= position <= length):
            raise OptionError(
                f"position {position!r} is not on the centre edge {self.center}, from 0 to "
                f"{length:g}"
            )
        segment = self.torque.edges[0, slot]
        span = cones.lower[segment], cones.upper[segment]
        if position is not None:
            span = position / length, position / length
        return outer_regions(cones.whole, self.center, self._others, np.array(span))

    def independent_regions(self, point: ArrayLike) -> FloatArray:
        """Return the independent contact regions at a point of the focus cell.

        Contacts may be anywhere inside them, each on its own.

        Parameters
        ----------
        point : array_like, shape (2,)

        Returns
        -------
        numpy.ndarray, shape (m, 2)
            First and last position on each edge that can be touched, in the order of `edges`.

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
        cones, segments = self.torque.cones, self.torque.edges[0]
        regions = independent_regions(cones, segments, self.focus_cell, q)
        return np.asarray(regions + self.torque.first_positions[0][:, None])

    @property
    def _others(self) -> list[int]:
        return [edge for edge in self.edges if edge != self.center]

    def plot(self, ax: Any = None) -> Any:
        """Draw the set on its object; see `regrasp_lp.plotting.plot_grasp_set`."""
        from regrasp_lp.plotting import plot_grasp_set

        return plot_grasp_set(self, ax)

    def __contains__(self, grasp: object) -> bool:
        """Whether a grasp on exactly these edges is strictly inside, decided exactly."""
        if not isinstance(grasp, Grasp):
            return False
        resolved = self.polygon.resolve(grasp)
        if len(resolved) != self.torque.m:
            return False
        return any(self._holds(resolved, order) for order in permutations(range(len(resolved))))

    def _holds(self, grasp: Grasp, order: tuple[int, ...]) -> bool:
        """Whether the contacts of a grasp, in some order, are inside."""
        cones, mine = self.torque.cones, self.torque.edges[0]
        edges, fractions = grasp.edges[list(order)], grasp.fractions[list(order)]
        segments, fractions = cones.places(edges, fractions, cones.group[mine])
        if segments.tolist() != mine.tolist():
            return False
        if self.limited is not None:
            return bool(self.limited.contain(fractions).any())
        return bool(self.torque.whole.contain(fractions[None, :])[0])

    def __repr__(self) -> str:
        center = "" if self.center is None else f", centre {self.center}"
        return f"<GraspSet {self.kind} on edges {self.edges}{center}, margin {self.margin:.4g}>"


def _in_order(sets: LinearSets, segments: Sequence[int]) -> LinearSets:
    """Add ``u_i - u_{i+1} <= 0`` where two contacts are on one edge (or segment)."""
    rows = order_rows(segments)
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
