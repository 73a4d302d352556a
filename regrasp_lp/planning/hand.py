"""The hand: how many fingers it has."""

from __future__ import annotations

import operator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.errors import HandError


@dataclass(frozen=True)
class Hand:
    """A hand of free-flying point fingers, numbered 1 to `fingers`.

    Parameters
    ----------
    fingers : int
        k >= 3. The chapter's hand has four (section 3.3).

    Raises
    ------
    HandError
        If `fingers` is not an integer of at least 3.

    Examples
    --------
    >>> Hand().held(3, 3), Hand(fingers=5).held(3, 3), Hand().held(2, 2)
    (2, 1, 0)
    """

    fingers: int = 4

    def __post_init__(self) -> None:
        try:
            fingers = operator.index(self.fingers)
        except TypeError as error:
            raise HandError(f"fingers must be an integer, got {self.fingers!r}") from error
        if isinstance(self.fingers, bool) or fingers < 3:
            raise HandError(
                f"a hand needs at least 3 fingers to regrasp, got {self.fingers!r}: "
                "use Hand(fingers=k) with k >= 3"
            )
        object.__setattr__(self, "fingers", fingers)

    def held(self, contacts: int, others: int) -> int:
        """Return how many contacts two grasps must share for a switch between them.

        ``max(0, n_S + n_T - k)``: while it switches, the hand touches both grasps at once.
        """
        return max(0, contacts + others - self.fingers)

    @property
    def needs(self) -> NDArray[np.intp]:
        """``needs[n, m]``: the same for grasps of up to three contacts, shape (4, 4)."""
        touching = np.add.outer(np.arange(4), np.arange(4))
        return np.asarray(np.maximum(0, touching - self.fingers))
