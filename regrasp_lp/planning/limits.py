"""What may limit a plan: boundary lines of friction cones, ends of edges, other fingers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from regrasp_lp.grasp_sets.pieces import Measure

Moments: TypeAlias = tuple[tuple[int, bool], ...]
"""Step numbers; False for the grasp after the step, True for the way of a slide."""


@dataclass(frozen=True)
class Line:
    """A boundary line of a friction cone, in a row.

    Parameters
    ----------
    finger, edge : int
    side : {"clockwise", "counter-clockwise"}
        Which boundary of the cone it is, seen from the inward normal.
    share : float
        By how much the row changes per shift of this line alone; those of a row add up to 1. Times
        the price of the row it is the price of the line.
    """

    finger: int
    edge: int
    side: str
    share: float


@dataclass(frozen=True)
class ConeLimit:
    """A torque function that has to stay positive, or negative.

    Parameters
    ----------
    moments : tuple of (int, bool)
        Step numbers, with False for the grasp after a step (0 is the start) and True for the way
        of a slide.
    needs : {1, -1}
        The sign. Shifting a boundary line forward along its edge raises the torque.
    lines : tuple of Line
        The two or three boundary lines whose torque it is.
    price : float
        d(best)/d(shift) when all these lines are shifted alike in favour of the needed sign, both
        in the object's unit. Of the margin all prices of torque functions add up to 1.
    """

    moments: Moments
    needs: int
    lines: tuple[Line, ...]
    price: float = 0.0


@dataclass(frozen=True)
class EndLimit:
    """An end of an edge, or of what the hand may touch of it, that a finger would pass.

    Parameters
    ----------
    moments : tuple of (int, bool)
    finger, edge : int
    end : {"start", "end"}
    price : float
        d(best)/d(shift) when this end of the edge moves outwards.
    """

    moments: Moments
    finger: int
    edge: int
    end: str
    price: float = 0.0


@dataclass(frozen=True)
class MeetLimit:
    """Two fingers on one edge that would pass each other.

    Parameters
    ----------
    moments : tuple of (int, bool)
    fingers : tuple of int
    edge : int
    price : float
        d(best)/d(shift) per length by which they might.
    """

    moments: Moments
    fingers: tuple[int, int]
    edge: int
    price: float = 0.0


Limit: TypeAlias = ConeLimit | EndLimit | MeetLimit


@dataclass(frozen=True)
class Limits:
    """What limits the margin, or the tolerance, of a plan.

    Parameters
    ----------
    measure : {"margin", "tolerance"}
    least : float
        Of the plan as it is; of all grasps at rest, and along all slides.
    tight : tuple of ConeLimit or EndLimit
        What attains it.
    chosen : float
        The least over all that depends on a chosen contact; inf if nothing was chosen.
    best : float
        The largest that this can become: the optimum of the linear program.
    limits : tuple of ConeLimit, EndLimit or MeetLimit
        What limits `best`, with its price, the dearest first. Where the optimum has several sets of
        prices it is one of them: shifts cannot raise it by more than their prices say.
    """

    measure: Measure
    least: float
    tight: tuple[Limit, ...]
    chosen: float
    best: float
    limits: tuple[Limit, ...]


# --- in words -----------------------------------------------------------------------------------


def moments_in_words(moments: Moments) -> str:
    """Return when: the steps after which, and those on the way of which.

    Examples
    --------
    >>> moments_in_words(((0, False), (3, False), (4, False), (5, False), (5, True)))
    'at the start, after steps 3 to 5, on the way of step 5'
    """
    after = sorted({step for step, sliding in moments if not sliding and step})
    during = sorted({step for step, sliding in moments if sliding})
    words = ["at the start"] if (0, False) in moments else []
    words += [f"after {_steps(after)}"] if after else []
    words += [f"on the way of {_steps(during)}"] if during else []
    return ", ".join(words)


def _steps(numbers: list[int]) -> str:
    """Numbers in ascending order, runs of them drawn together."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    texts = []
    for run in runs:
        texts += [f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(number) for number in run]
    *most, last = texts
    joined = f"{', '.join(most)} and {last}" if most else last
    return f"step{'s' if len(numbers) > 1 else ''} {joined}"


def limit_in_words(limit: Limit) -> str:
    """Return what limits.

    Examples
    --------
    >>> limit_in_words(MeetLimit(((2, False),), (1, 3), 7))
    'fingers 1 and 3 meet on edge 7'
    >>> lines = (Line(1, 0, "clockwise", 0.5), Line(3, 2, "clockwise", 0.5))
    >>> limit_in_words(ConeLimit(((2, False),), 1, lines))
    'cone boundaries clockwise of 1 and 3 (edges 0, 2)'
    """
    match limit:
        case ConeLimit(lines=lines):
            sides: dict[str, list[str]] = {}
            for line in lines:
                sides.setdefault(line.side, []).append(str(line.finger))
            named = (f"{side} of {' and '.join(fingers)}" for side, fingers in sides.items())
            edges = ", ".join(dict.fromkeys(str(line.edge) for line in lines))
            return f"cone boundaries {', '.join(named)} (edges {edges})"
        case EndLimit(finger=finger, edge=edge, end=end):
            return f"finger {finger} at the {end} of edge {edge}"
        case MeetLimit(fingers=(one, other), edge=edge):
            return f"fingers {one} and {other} meet on edge {edge}"
