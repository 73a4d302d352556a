"""Contacts and grasps: where fingers touch, said as edges and places along them.

Both are frozen values that know no polygon; `Polygon.resolve` ties them to one.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TypeVar, cast

import numpy as np
import numpy.typing as npt

from regrasp_lp.display import grasp_html
from regrasp_lp.errors import ContactError

__all__ = ["FRACTION_SNAP", "Contact", "Grasp", "as_contact", "snap_fraction"]

_Scalar = TypeVar("_Scalar", bound=np.generic)

FRACTION_SNAP = 1e-12
"""Fractions this close to 0 or 1, on either side, are taken to be 0 or 1."""


@dataclass(frozen=True)
class Contact:
    """A contact point on an edge of a polygon.

    It is exactly the point a + f (b − a) of the edge from a to b, with the fraction f a double
    read as the rational number it is; position = f · length is for people. Where both are
    given the fraction decides. At a vertex of the polygon the cone of the named edge counts.

    Parameters
    ----------
    edge : int
        Number of the edge, from 0, in the stored order of the polygon.
    position : float, optional
        Distance from the start of the edge, in the polygon's unit.
    fraction : float, optional
        The same divided by the length of the edge, in [0, 1]. Values within 1e-12 of 0 or 1
        snap to them.

    Raises
    ------
    ContactError
        If the edge is no non-negative integer, a place is not a finite number, neither place
        is given, or the fraction is outside [0, 1].

    Examples
    --------
    >>> Contact(edge=4, position=0.3)
    Contact(edge=4, position=0.3, fraction=None)
    >>> Contact.at_fraction(4, 1 + 1e-14)
    Contact(edge=4, position=None, fraction=1.0)
    """

    edge: int
    position: float | None = None
    fraction: float | None = None

    def __post_init__(self) -> None:
        edge = _edge_number(self.edge)
        object.__setattr__(self, "edge", edge)
        if self.position is None and self.fraction is None:
            raise ContactError(
                f"the contact on edge {edge} has no place: give position (a distance along the "
                f"edge) or fraction (0 at its start, 1 at its end)"
            )
        if self.position is not None:
            position = _finite_number(self.position, "position", edge)
            object.__setattr__(self, "position", position)
        if self.fraction is not None:
            fraction = snap_fraction(_finite_number(self.fraction, "fraction", edge))
            if fraction is None:
                raise ContactError(
                    f"the contact on edge {edge} has fraction {self.fraction!r}: it has to be "
                    f"between 0 (start of the edge) and 1 (its end)"
                )
            object.__setattr__(self, "fraction", fraction)

    @classmethod
    def at_fraction(cls, edge: int, fraction: float) -> Contact:
        """Return the contact at a fraction in [0, 1] of the edge's length."""
        return cls(edge, fraction=fraction)


@dataclass(frozen=True, init=False, repr=False)
class Grasp:
    """Contacts that hold an object together, in a fixed order.

    Equality compares contact by contact, in order; a resolved grasp differs from the same
    grasp before `Polygon.resolve` filled in its fractions or positions.

    Parameters
    ----------
    contacts : iterable of Contact or (edge, position)
        The contacts; pairs give distances along the edges in the polygon's unit.
    fingers : sequence of int, optional
        Which finger is at each contact, numbered from 1; only the start of a plan asks for it, and
        takes fingers 1, 2, ... by default. Grasps are equal if their contacts are.

    Attributes
    ----------
    contacts : tuple of Contact
    fingers : tuple of int or None

    Raises
    ------
    ContactError
        If an entry is neither a `Contact` nor a valid pair, or there are not as many different
        fingers as contacts.

    Examples
    --------
    >>> grasp = Grasp([(4, 0.3), (0, 1.2)])
    >>> grasp.edges
    array([4, 0])
    >>> grasp.positions
    array([0.3, 1.2])
    >>> Grasp.at_fractions([(4, 0.5)])
    Grasp.at_fractions([(4, 0.5)])
    """

    contacts: tuple[Contact, ...]
    fingers: tuple[int, ...] | None = field(default=None, compare=False)

    def __init__(
        self,
        contacts: Iterable[Contact | tuple[int, float]],
        fingers: Iterable[int] | None = None,
    ) -> None:
        if isinstance(contacts, Contact) or not isinstance(contacts, Iterable):
            raise ContactError(
                f"a grasp is made from an iterable of contacts or (edge, position) pairs, "
                f"not from {contacts!r}"
            )
        if fingers is None and isinstance(contacts, Grasp):
            fingers = contacts.fingers
        object.__setattr__(self, "contacts", tuple(as_contact(c) for c in contacts))
        named = None if fingers is None else _different_fingers(fingers, len(self.contacts))
        object.__setattr__(self, "fingers", named)

    @classmethod
    def at_fractions(
        cls, pairs: Iterable[tuple[int, float]], fingers: Iterable[int] | None = None
    ) -> Grasp:
        """Return the grasp with contacts at (edge, fraction), fractions in [0, 1]."""
        return cls([Contact.at_fraction(*_pair(pair, "fraction")) for pair in pairs], fingers)

    @property
    def edges(self) -> npt.NDArray[np.intp]:
        """Edge numbers, shape (m,)."""
        return _frozen(np.array([c.edge for c in self.contacts], dtype=np.intp))

    @property
    def fractions(self) -> npt.NDArray[np.float64]:
        """Fractions of the edges' lengths, shape (m,).

        Raises
        ------
        ContactError
            If a contact has only a position: its fraction depends on the polygon.
        """
        return self._places([c.fraction for c in self.contacts], "fraction")

    @property
    def positions(self) -> npt.NDArray[np.float64]:
        """Distances along the edges in the polygon's unit, shape (m,).

        Raises
        ------
        ContactError
            If a contact has only a fraction: its position depends on the polygon.
        """
        return self._places([c.position for c in self.contacts], "position")

    def _places(self, values: list[float | None], what: str) -> npt.NDArray[np.float64]:
        if None in values:
            k = values.index(None)
            raise ContactError(
                f"contact {k} of the grasp (on edge {self.contacts[k].edge}) has no {what} yet: "
                f"resolve it with polygon.resolve first"
            )
        return _frozen(np.array(values, dtype=np.float64))

    def __len__(self) -> int:
        return len(self.contacts)

    def __iter__(self) -> Iterator[Contact]:
        return iter(self.contacts)

    def __getitem__(self, index: int) -> Contact:
        return self.contacts[index]

    def __repr__(self) -> str:
        named = "" if self.fingers is None else f", fingers={self.fingers}"
        if self.contacts and all(c.fraction is not None for c in self.contacts):
            return f"Grasp.at_fractions({[(c.edge, c.fraction) for c in self.contacts]}{named})"
        if all(c.fraction is None for c in self.contacts):
            return f"Grasp({[(c.edge, c.position) for c in self.contacts]}{named})"
        return f"Grasp({list(self.contacts)}{named})"

    def _repr_html_(self) -> str:
        return grasp_html(self)


def as_contact(value: object) -> Contact:
    """Return a `Contact` from one, or from a pair (edge, position).

    Raises
    ------
    ContactError
        If the value is neither.
    """
    if isinstance(value, Contact):
        return value
    return Contact(*_pair(value, "position"))


def snap_fraction(fraction: float) -> float | None:
    """Return the fraction, with values within 1e-12 of 0 or 1 replaced by them.

    None if it is farther outside [0, 1] than that (or NaN).

    Examples
    --------
    >>> snap_fraction(-1e-13), snap_fraction(0.25), snap_fraction(1.1)
    (0.0, 0.25, None)
    """
    if abs(fraction) <= FRACTION_SNAP:
        return 0.0
    if abs(fraction - 1.0) <= FRACTION_SNAP:
        return 1.0
    return fraction if 0.0 < fraction < 1.0 else None


def as_points(points: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return points to snap as an array (m, 2).

    Raises
    ------
    ContactError
        If they are no finite numbers of that shape.
    """
    expected = "points to snap have to be finite numbers of shape (m, 2), one (x, y) a row"
    try:
        array = np.asarray(points)
    except ValueError:
        raise ContactError(f"{expected}; they are ragged") from None
    if array.dtype.kind not in "fiu" or array.ndim != 2 or array.shape[1] != 2:
        raise ContactError(f"{expected}; got {array.dtype} of shape {array.shape}")
    array = array.astype(np.float64)
    if not np.isfinite(array).all():
        raise ContactError(f"{expected}; got {array[~np.isfinite(array).all(axis=1)][0].tolist()}")
    return array


def _pair(value: object, what: str) -> tuple[int, float]:
    """Take (edge, number) apart; the entries are checked by `Contact`."""
    if isinstance(value, Iterable) and not isinstance(value, (str, bytes)):
        entries = list(value)
        if len(entries) == 2 and None not in entries:
            return cast("tuple[int, float]", (entries[0], entries[1]))
    raise ContactError(f"expected a Contact or a pair (edge, {what}), got {value!r}")


def _different_fingers(fingers: Iterable[int], count: int) -> tuple[int, ...]:
    named = tuple(fingers)
    whole = all(isinstance(k, numbers.Integral) and not isinstance(k, bool) for k in named)
    if not whole or len(named) != count or len(set(named)) < count or min(named, default=1) < 1:
        raise ContactError(
            f"the fingers of a grasp are {count} different numbers from 1, one for each contact, "
            f"not {list(named)}"
        )
    return tuple(int(k) for k in named)


def _edge_number(edge: object) -> int:
    if isinstance(edge, (bool, np.bool_)) or not isinstance(edge, numbers.Integral):
        raise ContactError(
            f"the edge of a contact is its number, an integer counted from 0, not {edge!r}"
        )
    if edge < 0:
        raise ContactError(f"edges are numbered from 0: there is no edge {int(edge)}")
    return int(edge)


def _finite_number(value: object, what: str, edge: int) -> float:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        raise ContactError(f"the {what} of the contact on edge {edge} is no number: {value!r}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ContactError(
            f"the {what} of the contact on edge {edge} has to be finite, not {number!r}"
        )
    return number + 0.0  # turns -0.0 into 0.0, so that equal contacts look alike


def _frozen(array: npt.NDArray[_Scalar]) -> npt.NDArray[_Scalar]:
    array.setflags(write=False)
    return array
