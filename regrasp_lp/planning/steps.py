"""The three things a hand does: place a finger, release one, slide some."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from regrasp_lp.contact import Contact


@dataclass(frozen=True)
class Place:
    """A free finger is placed on a contact.

    Parameters
    ----------
    finger : int
        1 to k.
    contact : Contact

    Examples
    --------
    >>> Place(finger=4, contact=Contact(edge=5, position=0.2)).contact.edge
    5
    """

    finger: int
    contact: Contact


@dataclass(frozen=True)
class Release:
    """A touching finger is taken off.

    Parameters
    ----------
    finger : int
        1 to k.
    """

    finger: int


@dataclass(frozen=True)
class Slide:
    """Some touching fingers move along their edges, together, each at constant speed.

    Parameters
    ----------
    moves : mapping of int to Contact
        Where each moving finger arrives, on the edge that it is on.

    Examples
    --------
    >>> sorted(Slide({2: Contact(0, 1.0), 1: Contact(3, 0.5)}).moves)
    [1, 2]
    """

    moves: Mapping[int, Contact]

    def __post_init__(self) -> None:
        ordered = {finger: self.moves[finger] for finger in sorted(self.moves)}
        object.__setattr__(self, "moves", MappingProxyType(ordered))

    def __hash__(self) -> int:
        return hash(tuple(self.moves.items()))


Step = Place | Release | Slide
