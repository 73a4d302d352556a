"""Fingers: numbered circles beside the object, each joined to a dot at its contact."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.text import Text

from regrasp_lp.contact import Contact
from regrasp_lp.friction import FloatArray
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.frame import Frame, draw_line, shifted
from regrasp_lp.plotting.outline import paper_of
from regrasp_lp.plotting.placement import Label, Placed, Search, place
from regrasp_lp.polygon import Polygon

# less than a quarter turn: a finger comes from where there is no material
_TURNS = (0, 12, -12, 24, -24, 36, -36, 48, -48, 60, -60, 72, -72, 84, -84)
_FARTHER = (0, 4, 8, 13, 18, 27, 38, 52, 68, 88, 112)
_EASY = 40.0  # cost of a place near its contact, off the object and off other labels
_MOST_ORDERS = 6
_SEARCH = Search(palette.FINGER_GAP, _FARTHER, _TURNS, sweeps=3)


@dataclass(frozen=True, eq=False)
class FingerArtists:
    """How one finger is drawn.

    Parameters
    ----------
    contact : matplotlib.lines.Line2D
        A dot at the exact contact.
    leader : matplotlib.lines.Line2D
        From the contact to the circle.
    circle : matplotlib.lines.Line2D
        The finger, beside the object.
    number : matplotlib.text.Text
        Its number, in the circle.
    """

    contact: Line2D
    leader: Line2D
    circle: Line2D
    number: Text


def point_of(polygon: Polygon, contact: Contact) -> FloatArray:
    """Return where a contact with a fraction is."""
    assert contact.fraction is not None
    return polygon.points(contact.edge, contact.fraction)


@dataclass(frozen=True)
class FingerStyle:
    """Colours of circle, ring, number and contact; width of the ring; line of the leader."""

    face: str
    ring: str
    number: str
    contact: str
    width: float = 1.0
    line: str = "-"


_SUPPORTING = FingerStyle(palette.BLUE, palette.BLUE, "white", palette.BLUE)
_TOUCHING = FingerStyle("white", palette.BLUE, palette.BLUE, palette.BLUE)
_MOVED = FingerStyle(palette.VERMILLION, palette.INK, "white", palette.INK, 1.5)
RELEASED = FingerStyle("white", palette.GREY, palette.GREY, "white", 1.0, ":")


def style_of(finger: int, holding: Collection[int], highlight: Collection[int]) -> FingerStyle:
    """Return how a touching finger looks."""
    if finger in highlight:
        return _MOVED
    return _SUPPORTING if finger in holding else _TOUCHING


def place_fingers(
    polygon: Polygon, frame: Frame, contacts: list[Contact], avoid: list[FloatArray]
) -> list[Placed]:
    """Return places of the circles of fingers at the contacts.

    Where they are crowded each in its turn is the first one to choose, for in a hole there may be
    room for one alone.
    """
    half = np.full(2, palette.FINGER_RADIUS)
    labels = [
        Label(
            frame.points(point_of(polygon, contact)),
            -frame.directions(polygon.normals[contact.edge]),
            half,
            np.zeros(2),
        )
        for contact in contacts
    ]
    points = frame.points(np.reshape(avoid, (-1, 2)))
    paper, best, n = paper_of(polygon, frame), np.inf, len(labels)
    chosen: list[Placed] = []
    for first in range(min(n, _MOST_ORDERS)):
        found = place(paper, labels[first:] + labels[:first], _SEARCH, avoid=points)
        placed = [p for p in found if p is not None]  # all: the search has no limit
        cost = sum(p.cost for p in placed)
        if cost < best:
            best, chosen = cost, placed[n - first :] + placed[: n - first]
        if max(p.cost for p in chosen) < _EASY:
            break
    return chosen


def draw_finger(
    ax: Axes, frame: Frame, finger: int, placed: Placed, style: FingerStyle
) -> FingerArtists:
    """Draw one finger at its place."""
    at, to = frame.coordinates(placed.anchor), frame.coordinates(placed.center)
    beside = shifted(ax, placed.center - placed.anchor)
    ring: dict[str, Any] = {"markeredgecolor": style.ring, "linestyle": "none", "marker": "o"}
    small = {"markersize": 3.6, "markerfacecolor": style.contact, "markeredgewidth": 0.8}
    dot = draw_line(ax, at[None], zorder=palette.CONTACT_LAYER, **ring, **small)
    thin: dict[str, Any] = {"color": style.ring, "linewidth": 0.9, "linestyle": style.line}
    leader = draw_line(ax, np.stack((at, to)), zorder=palette.LEADER_LAYER, **thin)
    large = {
        "markersize": 2 * palette.FINGER_RADIUS,
        "markerfacecolor": style.face,
        "markeredgewidth": style.width,
    }
    circle = draw_line(ax, at[None], transform=beside, zorder=palette.FINGER_LAYER, **ring, **large)
    size = palette.FINGER_FONT if finger < 10 else palette.FINGER_FONT - 2
    number = ax.text(
        at[0],
        at[1],
        str(finger),
        transform=beside,
        ha="center",
        va="center_baseline",
        fontsize=size,
        fontweight="bold",
        color=style.number,
        zorder=palette.TEXT_LAYER,
    )
    return FingerArtists(dot, leader, circle, number)
