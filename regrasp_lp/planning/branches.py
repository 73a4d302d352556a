"""The best paths in order: each class of paths has its best one, the others split it (Lawler).

A class holds the paths that begin with some sets and do not go on to some others. Without its best
path it falls into one class for each set at which another path can leave that one; so the paths
come in order, none twice, and no class is looked at before it is needed.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Generic, TypeVar

END = -1
"""Among the closed ones: a path does not end here."""

T = TypeVar("T")


@dataclass(frozen=True)
class Branch:
    """A class of paths of sets.

    Parameters
    ----------
    prefix : tuple of int
        The sets that a path begins with. It does not return to them.
    closed : frozenset of int
        The sets that it does not go to next; `END` among them if it goes on.

    Examples
    --------
    >>> branch = Branch((4, 7), frozenset({9, END}))
    >>> branch.follows(4, 7), branch.follows(7, 9), branch.follows(7, 8), branch.follows(8, 4)
    (True, False, True, False)
    >>> branch.ends(7), branch.ends(8)
    (False, True)
    """

    prefix: tuple[int, ...] = ()
    closed: frozenset[int] = frozenset()

    def starts(self, index: int) -> bool:
        """Return whether a path may begin with a set."""
        return index == self.prefix[0] if self.prefix else index not in self.closed

    def follows(self, one: int, other: int) -> bool:
        """Return whether a path may go from one set to another; it may always stay in one."""
        if one == other:
            return True
        if one in self.prefix[:-1]:
            return self.prefix[self.prefix.index(one) + 1] == other
        shut = bool(self.prefix) and one == self.prefix[-1] and other in self.closed
        return not shut and other not in self.prefix

    def ends(self, index: int) -> bool:
        """Return whether a path may end with a set."""
        if index not in self.prefix:
            return True
        return index == self.prefix[-1] and END not in self.closed

    def holds(self, path: tuple[int, ...]) -> bool:
        """Return whether a path is in the class."""
        return (
            self.starts(path[0])
            and all(self.follows(one, other) for one, other in pairwise(path))
            and self.ends(path[-1])
        )

    def without(self, path: tuple[int, ...]) -> Iterator[Branch]:
        """Yield the classes into which this one falls without one of its paths.

        Paths that return to a set are not followed farther than there.
        """
        for length in range(len(self.prefix), len(path) + 1):
            prefix = path[:length]
            if len(set(prefix)) < length:
                return
            following = path[length] if length < len(path) else END
            here = self.closed if length == len(self.prefix) else frozenset[int]()
            if prefix or following != END:
                yield Branch(prefix, here | {following})


EVERYTHING = Branch()
"""All paths."""


@dataclass(frozen=True, eq=False)
class Best(Generic[T]):
    """The best path of a class, or a bound of it.

    Parameters
    ----------
    key : tuple
        Smaller is better: of the path, or no larger than that of any path of the class.
    path : tuple of int, optional
        None if it is not known yet.
    value : object, optional
        What comes with the path.
    """

    key: tuple[Any, ...]
    path: tuple[int, ...] | None = None
    value: T | None = None


Solve = Callable[[Branch, Best[T] | None], Best[T] | None]
"""The best path of a class that is not empty, or a bound of it.

The second argument is what is known: the best path of the class that it was split from, or the
bound that was returned last; None at first.
"""


def best_first(solve: Solve[T]) -> Iterator[Best[T]]:
    """Yield paths in order, the best one first.

    Parameters
    ----------
    solve : callable
        Called when the next path is asked for, and no sooner.

    Yields
    ------
    Best
        With its path.
    """
    queue: list[tuple[tuple[Any, ...], tuple[int, ...], int, Branch, Best[T]]] = []
    number = 0

    def look(branch: Branch, known: Best[T] | None) -> None:
        nonlocal number
        found = solve(branch, known)
        if found is not None:
            number += 1
            heapq.heappush(queue, (found.key, found.path or (), number, branch, found))

    look(EVERYTHING, None)
    while queue:
        _, _, _, branch, found = heapq.heappop(queue)
        if found.path is None:
            look(branch, found)
            continue
        yield found
        for part in branch.without(found.path):
            look(part, found)
