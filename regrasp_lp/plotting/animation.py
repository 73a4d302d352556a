"""A plan as an animated GIF: a picture of each state, and slides frame by frame."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg

from regrasp_lp.contact import Contact
from regrasp_lp.errors import OptionError
from regrasp_lp.planning.steps import Slide
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.filmstrip import draw_panel, fit_text, step_in_words, support_in_words
from regrasp_lp.plotting.frame import POINTS_PER_INCH, OwnFigure
from regrasp_lp.plotting.grasps import plot_grasp

if TYPE_CHECKING:
    from regrasp_lp.planning.plan import Plan

__all__ = ["plan_gif"]

Pixels: TypeAlias = npt.NDArray[np.uint8]
"""Red, green and blue of each pixel, shape (rows, columns, 3), or a number of each."""

_LONGEST = 4.0  # side of the picture of the object, in inches
_NARROWEST = 3.6  # for the words
_HEAD, _BAR = 0.62, 0.07
_FRAMES = 12  # of a slide
_SLIDE_FRAME = 0.08  # seconds that each of them shows
_AT_ENDS = 1.5  # times as long start and goal stay
_LEAST, _MOST = 0.01, 436.0  # seconds: a file counts hundredths, up to 65,535 for start and goal


class _State(NamedTuple):
    """What one frame shows: after so many steps, or a part of the way through the next one."""

    done: int
    part: float
    seconds: float


def plan_gif(plan: Plan, *, seconds: float = 1.5, dpi: float = 80.0) -> bytes:
    """Return a plan as an animated GIF, which repeats for ever.

    Each state is shown as in the filmstrip (`plot_plan`), without regions; between the two states
    of a slide the fingers move, all linearly in the same time. A bar at the bottom says how much
    of the plan is done.

    Parameters
    ----------
    plan : Plan
    seconds : float, optional
        How long each state stays, from 0.01 to 436; start and goal stay half as long again.
    dpi : float, optional
        Pixels per inch; the longer side of the object is about 4 inches long.

    Raises
    ------
    OptionError
        If `seconds` or `dpi` is not a positive number, or `seconds` beyond what a GIF can say.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])
    >>> plan = rl.plan_regrasp(block, [(0, 3), (2, 3)], [(1, 1.5), (3, 1.5)], friction=0.4)
    >>> plan_gif(plan, dpi=20)[:6]
    b'GIF89a'
    """
    for name, value in (("seconds", seconds), ("dpi", dpi)):
        a_number = isinstance(value, Real) and not isinstance(value, bool)
        if not (a_number and 0 < value < math.inf):
            raise OptionError(f"{name} has to be a positive number, not {value!r}")
    if not _LEAST <= seconds <= _MOST:
        raise OptionError(f"seconds has to be from {_LEAST} to {_MOST:g} in a GIF, not {seconds!r}")
    from PIL import Image  # matplotlib brings it

    states = list(_states(plan, seconds))
    numbers, colours = _in_colours([_frame(plan, state, dpi) for state in states])
    flat = [Image.fromarray(frame) for frame in numbers]
    for frame in flat:
        frame.putpalette(colours)
    data = io.BytesIO()
    flat[0].save(
        data,
        format="GIF",
        save_all=True,
        append_images=flat[1:],
        duration=[round(1000 * state.seconds) for state in states],
        loop=0,
        optimize=False,
    )
    return data.getvalue()


def _states(plan: Plan, seconds: float) -> Iterator[_State]:
    last = len(plan.steps)
    for index in range(last + 1):
        if index and isinstance(plan.steps[index - 1], Slide):
            for k in range(1, _FRAMES):
                yield _State(index - 1, k / _FRAMES, _SLIDE_FRAME)
        yield _State(index, 0.0, seconds * (_AT_ENDS if index in (0, last) else 1.0))


def _frame(plan: Plan, state: _State, dpi: float) -> Pixels:
    figure = OwnFigure(_size(plan), dpi)
    height = figure.get_size_inches()[1]
    box = (0.0, _BAR / height, 1.0, 1 - (_HEAD + _BAR) / height)
    ax = figure.add_axes(box, label="object")
    ax.set_axis_off()
    if state.part:
        _draw_slide(plan, state, ax)
    else:
        draw_panel(plan, state.done, ax, None)
    index = state.done + (state.part > 0)
    _write_head(figure, plan, index)
    _draw_bar(figure, (state.done + state.part) / max(len(plan.steps), 1))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _size(plan: Plan) -> tuple[float, float]:
    """Width and height of a frame in inches."""
    extent = plan.polygon.bounds[2:] - plan.polygon.bounds[:2]
    width, height = _LONGEST * extent / extent.max() + 2 * palette.MARGIN / POINTS_PER_INCH
    return max(float(width), _NARROWEST), float(height) + _HEAD + _BAR


def _draw_slide(plan: Plan, state: _State, ax: Any) -> None:
    """Draw the fingers on their way."""
    before, after = plan.grasps[state.done], plan.grasps[state.done + 1]
    step = plan.steps[state.done]
    assert isinstance(step, Slide)
    contacts = dict(before.contacts)
    for finger in step.moves:
        start, end = before.contacts[finger], after.contacts[finger]
        assert start.fraction is not None
        assert end.fraction is not None
        fraction = (1 - state.part) * start.fraction + state.part * end.fraction
        contacts[finger] = Contact.at_fraction(start.edge, fraction)
    plot_grasp(
        plan.polygon,
        contacts,
        plan.friction,
        ax,
        support=after.support.fingers,
        center=after.support.center,
        highlight=tuple(step.moves),
    )


def _write_head(figure: OwnFigure, plan: Plan, index: int) -> None:
    """Write which step it is, and what holds the object."""
    height = figure.get_size_inches()[1]
    number = f"{index}/{len(plan.steps)}  "
    style: dict[str, Any] = {"color": palette.INK, "va": "top", "ha": "left"}
    words = number + step_in_words(plan, index)
    head = figure.text(0.03, 1 - 0.12 / height, words, fontsize=12, **style)
    held = support_in_words(plan, index)
    line = figure.text(0.03, 1 - 0.38 / height, held, fontsize=9.5, **style)
    fit_text(figure, [head, line], 0.94 * figure.get_size_inches()[0])


def _draw_bar(figure: OwnFigure, done: float) -> None:
    from matplotlib.patches import Rectangle

    high = _BAR / figure.get_size_inches()[1]
    for share, colour in ((1.0, palette.MATERIAL), (done, palette.BLUE)):
        bar = Rectangle(
            (0, 0), share, high, transform=figure.transFigure, color=colour, linewidth=0
        )
        figure.add_artist(bar)


def _in_colours(frames: Sequence[Pixels]) -> tuple[list[Pixels], list[int]]:
    """Frames as numbers of at most 256 colours, the same for all, and these colours.

    They are those that occur most often, so that surfaces and lines keep theirs and nothing
    flickers; what is in none of them gets the nearest one.
    """
    shifts = np.array([16, 8, 0], dtype=np.int32)
    packed = [(frame.astype(np.int32) << shifts).sum(axis=2) for frame in frames]
    values, counts = zip(*(np.unique(one, return_counts=True) for one in packed), strict=True)
    found, places = np.unique(np.concatenate(values), return_inverse=True)
    often = np.bincount(places, np.concatenate(counts))
    colours = (found[:, None] >> shifts) & 255
    chosen = colours[np.argsort(-often, kind="stable")[:256]]
    offsets = colours[:, None] - chosen
    nearest = (offsets * offsets).sum(axis=2).argmin(axis=1).astype(np.uint8)
    return [nearest[np.searchsorted(found, one)] for one in packed], chosen.reshape(-1).tolist()
