"""The object: a validated polygon with numbered edges, and contacts on it.

Edges are numbered along the stored rings, the outline first, then the holes in the order given.
The outline is stored counter-clockwise and holes clockwise, so that material is always on the
left: edge i runs from a_i along the unit tangent t_i, and n_i = rot90(t_i) = (−t_y, t_x) points
inward.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from numbers import Real
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from regrasp_lp.contact import FRACTION_SNAP, Contact, Grasp, as_contact, as_points, snap_fraction
from regrasp_lp.display import Pictured
from regrasp_lp.errors import ContactError, PolygonError
from regrasp_lp.ring_checks import check_rings
from regrasp_lp.rings import RingLike, doubled_area, exact_integers, orient_rings, read_rings

__all__ = ["Contact", "Grasp", "Polygon"]

_Floats: TypeAlias = npt.NDArray[np.float64]
_Ints: TypeAlias = npt.NDArray[np.intp]

_TIE = 1e-12
"""Edges whose distances differ by less, in diameters of the polygon, are equally near to snap."""


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Polygon(Pictured):
    """A simple polygon, with holes or without: an immutable, validated value.

    Validation is exact for the doubles given. Rings may be closed or not and may run either
    way; a clockwise outline or counter-clockwise hole is reversed keeping its first vertex.
    Consecutive edges may be collinear.

    Parameters
    ----------
    exterior : array_like of shape (n, 2), or shapely Polygon
        The outline.
    holes : iterable of array_like, optional
        One ring per hole; empty if `exterior` is a shapely polygon, which brings its own.
    name : str, optional
        Used in messages, plots and files.

    Attributes
    ----------
    name : str
    rings : tuple of ndarray, each (n_r, 2)
        Stored rings, outline first, unclosed.
    vertices : ndarray (n, 2)
        The rings, concatenated. All arrays are read-only, in the polygon's unit of length.
    edge_starts, edge_ends, edge_vectors : ndarray (n, 2)
        Edge i runs from start a_i to end b_i; the vector is b_i − a_i.
    edge_lengths : ndarray (n,)
    tangents, normals : ndarray (n, 2)
        Unit vectors along the edge, and inward.
    next_edge, ring_of_edge : ndarray (n,) of int
        The edge that starts where edge i ends; the ring that edge i is on.
    input_edge : ndarray (n,) of int
        The edge of the input that edge i came from, the input numbered ring by ring in the
        order given, edge i of a ring running from its point i to the next one.

    Raises
    ------
    PolygonError
        If the input does not describe a simple polygon: wrong types or shapes, fewer than 3
        points, not finite, sizes outside [1e-100, 1e100], edges of no length, no area, rings
        that touch or cross themselves or each other, holes outside the outline or nested.

    Examples
    --------
    >>> wedge = Polygon([(0, 0), (4, 0), (4, 3)], name="wedge")
    >>> wedge
    <Polygon 'wedge': 3 edges>
    >>> wedge.edge_lengths
    array([4., 3., 5.])
    >>> Polygon([(0, 0), (4, 3), (4, 0)]).input_edge  # clockwise: stored the other way round
    array([2, 1, 0])
    >>> Polygon([(0, 0), (4, 0), (2, 0)])
    Traceback (most recent call last):
    ...
    regrasp_lp.errors.PolygonError: polygon: the outline has no area: all its points lie on one line
    """

    name: str
    rings: tuple[_Floats, ...]
    vertices: _Floats
    edge_starts: _Floats
    edge_ends: _Floats
    edge_vectors: _Floats
    edge_lengths: _Floats
    tangents: _Floats
    normals: _Floats
    next_edge: _Ints
    ring_of_edge: _Ints
    input_edge: _Ints

    def __init__(self, exterior: RingLike, holes: Iterable[RingLike] = (), name: str = "") -> None:
        if not isinstance(name, str):
            raise PolygonError(f"the name of a polygon has to be a string, not {name!r}")
        label = _label(name)
        given = read_rings(exterior, holes, label)
        check_rings(given, label)
        rings, numbers = orient_rings(given)

        sizes = [len(ring) for ring in rings]
        first = np.cumsum([0, *sizes[:-1]]).tolist()
        vertices = np.concatenate(rings)
        following = np.concatenate(
            [k + np.roll(np.arange(n), -1) for k, n in zip(first, sizes, strict=True)]
        )
        ends = vertices[following]
        vectors = ends - vertices
        # scaled first, so that neither squares nor reciprocals of tiny lengths underflow
        scaled = vectors / np.abs(vectors).max(axis=1, keepdims=True)
        tangents = scaled / np.hypot(scaled[:, 0], scaled[:, 1])[:, None]
        values = {
            "name": name,
            "vertices": vertices,
            "edge_starts": vertices,
            "edge_ends": ends,
            "edge_vectors": vectors,
            "edge_lengths": np.hypot(vectors[:, 0], vectors[:, 1]),
            "tangents": tangents,
            "normals": np.stack([-tangents[:, 1], tangents[:, 0]], axis=1),
            "next_edge": following,
            "ring_of_edge": np.repeat(np.arange(len(rings)), sizes),
            "input_edge": numbers,
            "rings": tuple(vertices[k : k + n] for k, n in zip(first, sizes, strict=True)),
        }
        self.__setstate__(values)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Set the fields, arrays read-only: also after unpickling, which forgets that."""
        for value in (*state.values(), *state["rings"]):
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        self.__dict__.update(state)

    # --- the whole ------------------------------------------------------------------------------

    @property
    def exterior(self) -> _Floats:
        """The outline, counter-clockwise, unclosed: array (n, 2)."""
        return self.rings[0]

    @property
    def holes(self) -> tuple[_Floats, ...]:
        """The holes, clockwise, unclosed: arrays (n, 2)."""
        return self.rings[1:]

    @property
    def n_edges(self) -> int:
        """Number of edges, those of the holes included."""
        return len(self.vertices)

    @cached_property
    def bounds(self) -> _Floats:
        """Bounding box (min x, min y, max x, max y): array (4,)."""
        bounds = np.concatenate([self.exterior.min(axis=0), self.exterior.max(axis=0)])
        bounds.setflags(write=False)
        return bounds

    @property
    def diameter(self) -> float:
        """Length of the diagonal of the bounding box."""
        return float(np.hypot(*(self.bounds[2:] - self.bounds[:2])))

    @cached_property
    def area(self) -> float:
        """Area without the holes, in the unit squared: the exact value, rounded once.

        Examples
        --------
        >>> Polygon([(0, 0), (4, 0), (4, 3)]).area
        6.0
        """
        doubled = Fraction(0)
        for ring in self.rings:
            integers, scale = exact_integers(ring)
            doubled += Fraction(doubled_area(integers), scale * scale)
        return float(doubled / 2)

    @cached_property
    def centroid(self) -> _Floats:
        """Centre of area, array (2,): the exact value, rounded once.

        Examples
        --------
        >>> Polygon([(0, 0), (3, 0), (3, 3)]).centroid
        array([2., 1.])
        """
        points, scale = exact_integers(self.vertices)
        doubled, moments = 0, [0, 0]
        for i, j in enumerate(self.next_edge.tolist()):
            (ax, ay), (bx, by) = points[i], points[j]
            cross = ax * by - ay * bx
            doubled += cross
            moments[0] += cross * (ax + bx)
            moments[1] += cross * (ay + by)
        centroid = np.array([float(Fraction(m, 3 * doubled * scale)) for m in moments])
        centroid.setflags(write=False)
        return centroid

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Polygon):
            return NotImplemented
        return self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @cached_property
    def _key(self) -> tuple[str, tuple[bytes, ...]]:
        return self.name, tuple(ring.tobytes() for ring in self.rings)

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        holes = f", {n} hole{'s' * (n > 1)}" if (n := len(self.holes)) else ""
        return f"<Polygon{name}: {self.n_edges} edges{holes}>"

    def plot(self, ax: Any = None) -> Any:
        """Draw the polygon with its edge numbers; see `regrasp_lp.plotting.plot_polygon`."""
        from regrasp_lp.plotting import plot_polygon

        return plot_polygon(self, ax)

    def simplified(self, tolerance: float) -> Polygon:
        """Return a polygon of fewer vertices within `tolerance` (`outlines.simplification`).

        Examples
        --------
        >>> Polygon([(0, 0), (2, 0.1), (4, 0), (4, 3)]).simplified(0.1)
        <Polygon: 3 edges>
        """
        from regrasp_lp.outlines.simplification import simplify

        return simplify(self, tolerance)

    # --- contacts -------------------------------------------------------------------------------

    def points(self, edges: npt.ArrayLike, fractions: npt.ArrayLike) -> _Floats:
        """Return the points a + f (b − a) on edges from a to b, correctly at both ends.

        Parameters
        ----------
        edges, fractions : array_like
            Edge numbers and fractions in [0, 1]; they are broadcast against each other.

        Returns
        -------
        ndarray
            Shape (..., 2).

        Raises
        ------
        ContactError
            If an edge does not exist or a fraction is outside [0, 1] by more than 1e-12.

        Examples
        --------
        >>> Polygon([(0, 0), (4, 0), (4, 3)]).points([0, 1], 0.5)
        array([[2. , 0. ],
               [4. , 1.5]])
        """
        numbers, f = np.asarray(edges), np.asarray(fractions, dtype=np.float64)
        if numbers.size and numbers.dtype.kind not in "iu":
            raise ContactError(f"edges are integers counted from 0, not {numbers.dtype}")
        numbers = numbers.astype(np.intp)
        for edge in numbers[(numbers < 0) | (numbers >= self.n_edges)]:
            raise self._no_edge(int(edge))
        for value in f[~((f >= -FRACTION_SNAP) & (f <= 1 + FRACTION_SNAP))]:
            raise ContactError(f"fractions have to be between 0 and 1, not {float(value)!r}")
        f = np.clip(f, 0.0, 1.0)[..., None]
        vectors = self.edge_vectors[numbers]
        # from the nearer end, so that both ends are met exactly
        points: _Floats = np.where(
            f <= 0.5,
            self.edge_starts[numbers] + f * vectors,
            self.edge_ends[numbers] - (1 - f) * vectors,
        )
        return points

    def point(self, contact: Contact | tuple[int, float]) -> _Floats:
        """Return the point of a contact, array (2,); raises as `resolve_contact` does."""
        resolved = self.resolve_contact(contact)
        assert resolved.fraction is not None
        return self.points(resolved.edge, resolved.fraction)

    def resolve(self, grasp: Grasp | Iterable[Contact | tuple[int, float]]) -> Grasp:
        """Return the grasp with both position and fraction in every contact.

        Raises
        ------
        ContactError
            As `resolve_contact`.

        Examples
        --------
        >>> wedge = Polygon([(0, 0), (4, 0), (4, 3)])
        >>> wedge.resolve(Grasp([(0, 1.0), (2, 2.5)])).fractions
        array([0.25, 0.5 ])
        """
        fingers = grasp.fingers if isinstance(grasp, Grasp) else None
        return Grasp(map(self.resolve_contact, Grasp(grasp)), fingers)

    def resolve_contact(self, contact: Contact | tuple[int, float]) -> Contact:
        """Return the contact with both position and fraction = position / length.

        The fraction decides where the contact has both.

        Raises
        ------
        ContactError
            If the edge does not exist, or the position is off it by more than 1e-12 of its
            length.

        Examples
        --------
        >>> Polygon([(0, 0), (4, 0), (4, 3)]).resolve_contact((0, 4.5))
        Traceback (most recent call last):
        ...
        regrasp_lp.errors.ContactError: position 4.5 is not on edge 0 of the polygon: \
the edge is 4.0 long, positions run from 0 to that
        """
        contact = as_contact(contact)
        if contact.edge >= self.n_edges:
            raise self._no_edge(contact.edge)
        length = float(self.edge_lengths[contact.edge])
        fraction = contact.fraction
        if fraction is None:
            assert contact.position is not None
            fraction = snap_fraction(contact.position / length)
        if fraction is None:
            raise ContactError(
                f"position {contact.position!r} is not on edge {contact.edge} of "
                f"{self._phrase}: the edge is {length!r} long, positions run from 0 to that"
            )
        return Contact(contact.edge, fraction * length, fraction)

    def snap(self, points: npt.ArrayLike, tolerance: float = 1e-6) -> Grasp:
        """Return the grasp whose contacts are the boundary points nearest to given points.

        Where several edges are equally near, to 1e-12 diameters of the polygon or what the
        points' coordinates resolve, the lowest edge number is taken: in particular at a
        vertex, where the outcome is the end of one edge or the start of the other.

        Parameters
        ----------
        points : array_like (m, 2)
        tolerance : float, optional
            Largest distance from the boundary, in the polygon's unit.

        Returns
        -------
        Grasp
            Resolved: contacts have position and fraction.

        Raises
        ------
        ContactError
            If a point is farther from the boundary than the tolerance, or the arguments are
            no finite numbers of the right shape.

        Examples
        --------
        >>> wedge = Polygon([(0, 0), (4, 0), (4, 3)])
        >>> wedge.snap([(1.0, 1e-9), (4.0, 0.0)])
        Grasp.at_fractions([(0, 0.25), (0, 1.0)])
        """
        given = as_points(points)
        a_number = isinstance(tolerance, Real) and not isinstance(tolerance, bool)
        if not a_number or not 0 <= tolerance < np.inf:
            raise ContactError(f"the tolerance has to be a length, not {tolerance!r}")
        fractions = np.einsum("mnd,nd->mn", given[:, None] - self.edge_starts, self.tangents)
        fractions = np.clip(fractions / self.edge_lengths, 0.0, 1.0)
        offsets = given[:, None] - self.points(np.arange(self.n_edges), fractions)
        distances = np.hypot(offsets[..., 0], offsets[..., 1])
        tie = max(_TIE * self.diameter, 4 * float(np.spacing(np.abs(self.bounds).max())))
        contacts = []
        for k, row in enumerate(distances):
            nearest = int(row.argmin())
            if row[nearest] > tolerance:
                raise ContactError(
                    f"point {k}, ({given[k, 0]:.12g}, {given[k, 1]:.12g}), is {row[nearest]:.6g} "
                    f"from the boundary of {self._phrase} (nearest is edge {nearest}); the "
                    f"tolerance is {tolerance:g} (pass tolerance=… to accept more)"
                )
            edge = int(np.argmax(row <= row[nearest] + tie))
            contacts.append(Contact.at_fraction(edge, float(fractions[k, edge])))
        return self.resolve(Grasp(contacts))

    @property
    def _phrase(self) -> str:
        return _label(self.name) if self.name else "the polygon"

    def _no_edge(self, edge: int) -> ContactError:
        return ContactError(
            f"there is no edge {edge} on {self._phrase}: "
            f"its {self.n_edges} edges are numbered 0 to {self.n_edges - 1}"
        )


def _label(name: str) -> str:
    return f"polygon {name!r}" if name else "polygon"
