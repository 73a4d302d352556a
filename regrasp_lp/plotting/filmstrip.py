"""A plan as a filmstrip: one panel for the start and one after each step."""

from __future__ import annotations

import math
import operator
import string
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

from regrasp_lp.contact import Contact
from regrasp_lp.errors import OptionError
from regrasp_lp.planning.regions import Region, regions
from regrasp_lp.planning.steps import Place, Release, Slide
from regrasp_lp.plotting import palette
from regrasp_lp.plotting.frame import POINTS_PER_INCH, OwnFigure
from regrasp_lp.plotting.grasps import BAND, COMMON_CONE, GraspArtists, plot_grasp

if TYPE_CHECKING:
    from regrasp_lp.planning.plan import Plan
    from regrasp_lp.polygon import Polygon

_WIDEST = 12.0  # width of the figure up to which panels are put side by side; all in inches
_NARROWEST = 2.75  # a panel, for the words over it
_BORDER, _GUTTER = 0.12, 0.16
_TITLE = 0.40  # two lines over each panel
_HEAD, _KEY_LINE = 0.44, 0.20
_KEY_ENTRY = 1.75  # width of an entry of the key
_COMMON_CONE = {name: COMMON_CONE[name] for name in ("facecolor", "edgecolor")}


@dataclass(frozen=True)
class _Grid:
    """Rows and columns of equal panels; lengths in inches."""

    rows: int
    columns: int
    width: float
    height: float
    key_lines: int

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the figure."""
        across = self.columns * (self.width + _GUTTER) - _GUTTER + 2 * _BORDER
        down = self.rows * (self.height + _TITLE) + _HEAD + self.key_lines * _KEY_LINE + _BORDER
        return across, down + _BORDER

    def panel(self, index: int) -> tuple[float, float, float, float]:
        """Left, bottom, width and height of a panel's axes, as fractions of the figure."""
        row, column = divmod(index, self.columns)
        across, down = self.size
        left = _BORDER + column * (self.width + _GUTTER)
        bottom = down - _BORDER - _HEAD - (row + 1) * (self.height + _TITLE)
        return left / across, bottom / down, self.width / across, self.height / down


def plot_plan(plan: Plan, *, columns: int | None = None, dpi: float = 110.0) -> Figure:
    """Draw a plan as a filmstrip: the start, and what is held after each step.

    Fingers that support the object are blue, with their friction cones (for parallel grasps the
    common cone) or, if they are two, joined by a dashed line; fingers that only touch are white.
    A finger that was placed or has slid is vermillion, a released one grey and hollow, and an
    arrow leads from where a finger slid. Bands along the edges show where the supporting fingers
    may be, each on its own: the independent contact regions of `Plan.regions`. Over each panel
    stand the step, the supporting fingers and their margin; of a slide also the least margin on
    the way, where that is less.

    Parameters
    ----------
    plan : Plan
    columns : int, optional
        Panels side by side; by default as many as make the figure 12 inches wide at most, in
        rows of equal length as far as possible.
    dpi : float, optional
        Pixels per inch, for notebooks and for files of pixels.

    Returns
    -------
    matplotlib.figure.Figure
        Not known to pyplot; notebooks show it, and ``figure.savefig`` writes PNG, SVG or PDF.

    Raises
    ------
    OptionError
        If `columns` is not a positive integer.
    """
    held = plan.grasps
    # A plan that does not hold has none; its margins say so.
    found = regions(plan, slides=False) if min(plan.margins) > 0 else ()
    key = _key(plan, bands=bool(found))
    grid = _layout(plan.polygon, len(held), len(key), columns)
    figure = OwnFigure(grid.size, dpi)
    _write_head(figure, plan)
    for i in range(len(held)):
        ax = figure.add_axes(grid.panel(i), label=f"panel {i}")
        ax.set_axis_off()
        draw_panel(plan, i, ax, found[i] if found else None)
        _write_title(figure, ax, plan, i)
    columns_of_key = math.ceil(len(key) / grid.key_lines)
    figure.legend(
        handles=key,
        loc="lower center",
        ncols=columns_of_key,
        frameon=False,
        fontsize=7.5,
        handlelength=1.8,
        columnspacing=1.4,
        borderaxespad=0.3,
    )
    return figure


def _layout(polygon: Polygon, panels: int, entries: int, columns: int | None) -> _Grid:
    """Panels with the object's own shape, in rows of equal length as far as possible."""
    extent = polygon.bounds[2:] - polygon.bounds[:2]
    shape = extent / extent.max()
    longest = (2.2 if polygon.n_edges <= 100 else 2.7) * (1.5 if shape[1] < 0.3 else 1.0)
    margins = 2 * palette.MARGIN / POINTS_PER_INCH
    width, height = max(longest * shape[0] + margins, _NARROWEST), longest * shape[1] + margins
    if columns is None:
        most = max(1, int((_WIDEST - 2 * _BORDER + _GUTTER) / (width + _GUTTER)))
        columns = math.ceil(panels / math.ceil(panels / most))
    else:
        try:
            columns = operator.index(columns)
        except TypeError:
            raise OptionError(f"columns must be an integer, got {columns!r}") from None
        if columns < 1:
            raise OptionError(f"columns must be at least 1, got {columns}")
    columns = min(columns, panels)
    across = columns * (width + _GUTTER)
    key_lines = math.ceil(entries / max(1, int(across / _KEY_ENTRY)))
    return _Grid(math.ceil(panels / columns), columns, width, height, key_lines)


def draw_panel(plan: Plan, index: int, ax: Axes, region: Region | None) -> GraspArtists:
    """Draw what is held after `index` steps, and what the last of them changed."""
    grasp = plan.grasps[index]
    moved = _moved(plan, index)
    released: dict[int, Contact] = {}
    slid_from: dict[int, Contact] = {}
    if index:
        before = plan.grasps[index - 1].contacts
        slid_from = {finger: before[finger] for finger in moved if finger in before}
        released = {k: before[k] for k in before if k not in grasp.contacts}
    return plot_grasp(
        plan.polygon,
        grasp.contacts,
        plan.friction,
        ax,
        support=grasp.support.fingers,
        center=grasp.support.center,
        highlight=moved,
        released=released,
        slid_from=slid_from,
        regions=region.intervals if region else {},
    )


def _moved(plan: Plan, index: int) -> tuple[int, ...]:
    """Return the fingers that step number `index`, counted from 1, has placed or slid."""
    match plan.steps[index - 1] if index else None:
        case Place(finger):
            return (finger,)
        case Slide(moves):
            return tuple(moves)
    return ()


# --- words --------------------------------------------------------------------------------------


def _letter(index: int) -> str:
    """Return (a), (b), ..., (z), (aa), (ab), ..."""
    letters = ""
    index += 1
    while index:
        index, digit = divmod(index - 1, 26)
        letters = string.ascii_lowercase[digit] + letters
    return f"({letters})"


def step_in_words(plan: Plan, index: int) -> str:
    """Return what step number `index`, counted from 1, does; 0 is the start."""
    last = index == len(plan.steps)
    if index == 0:
        return "start and goal" if last else "start"
    step = plan.steps[index - 1]
    match step:
        case Place(finger, contact):
            words = f"place {finger} on edge {contact.edge}"
        case Slide(moves):
            words = "slide " + ", ".join(map(str, moves))
        case _:
            words = f"release {step.finger}"
    return words + ": goal" if last else words


def support_in_words(plan: Plan, index: int) -> str:
    """Return which fingers hold the object after `index` steps, and how well."""
    grasp = plan.grasps[index]
    fingers = ", ".join(map(str, sorted(grasp.support.fingers)))
    text = f"held by {fingers}: margin {grasp.margin:.3g}"
    least = plan.slide_margins[index - 1] if index else np.inf
    return text + (f" (on the way {least:.3g})" if least < grasp.margin else "")


def _write_head(figure: Figure, plan: Plan) -> None:
    """Write the object's name, cut to the width of the figure, and what the plan amounts to."""
    width, height = figure.get_size_inches()
    room = width - 2 * _BORDER
    steps, placements = len(plan.steps), plan.placements
    amount = (
        f"{steps} step{'s' * (steps != 1)}, {placements} placement{'s' * (placements != 1)}, "
        f"margin {plan.margin:.4g}"
    )
    style: dict[str, Any] = {"ha": "left", "va": "top", "color": palette.INK}
    left, top = _BORDER / width, 1 - _BORDER / height
    name = plan.polygon.name or "unnamed polygon"
    head = figure.text(left, top, name, fontsize=10, fontweight="bold", parse_math=False, **style)
    while _width(figure, head) > room:
        name = name[:-1]
        head.set_text(name + "…")
    words = figure.text(left, top - 0.2 / height, amount, fontsize=8.5, **style)
    fit_text(figure, [words], room)


def _write_title(figure: Figure, ax: Axes, plan: Plan, index: int) -> None:
    """Two lines over a panel, made smaller where they are too wide."""
    box = ax.get_position()
    width, height = figure.get_size_inches()
    style: dict[str, Any] = {"ha": "left", "va": "baseline", "color": palette.INK}
    letter = figure.text(
        box.x0, box.y1 + 0.19 / height, _letter(index), fontsize=9, fontweight="bold", **style
    )
    indent = (0.08 + 0.08 * len(letter.get_text())) / width
    step = figure.text(
        box.x0 + indent, box.y1 + 0.19 / height, step_in_words(plan, index), fontsize=9, **style
    )
    held = figure.text(
        box.x0 + indent,
        box.y1 + 0.04 / height,
        support_in_words(plan, index),
        fontsize=7.5,
        **style,
    )
    fit_text(figure, [step, held], (box.x1 - box.x0 - indent) * width)


def _width(figure: Figure, text: Text) -> float:
    """Return the width of a text in inches."""
    renderer = RendererAgg(1, 1, figure.dpi)
    return float(text.get_window_extent(renderer).width / figure.dpi)


def fit_text(figure: Figure, texts: list[Text], width: float) -> None:
    """Make texts smaller until each is at most `width` inches wide."""
    for text in texts:
        while (wide := _width(figure, text)) > width:  # again, as glyphs are fitted to pixels
            text.set_fontsize(float(text.get_fontsize()) * 0.98 * width / wide)


def _key(plan: Plan, *, bands: bool) -> list[Line2D | Patch]:
    """Return what the signs mean, as far as they occur in the plan."""
    sizes = {len(grasp.support.fingers) for grasp in plan.grasps}
    actions = {type(step) for step in plan.steps}
    only_touching = any(
        set(grasp.contacts) - set(grasp.support.fingers) - set(_moved(plan, grasp.after_step))
        for grasp in plan.grasps
    )
    centers = [g.support.center for g in plan.grasps if len(g.support.fingers) > 2]
    fill = (palette.SKY, 0.3)
    line: dict[str, Any] = {"color": palette.GREEN, "linestyle": palette.DASHES}
    signs: list[tuple[bool, Line2D | Patch]] = [
        (True, _circle(palette.BLUE, palette.BLUE, "supports the object")),
        (only_touching, _circle("white", palette.BLUE, "only touches")),
        (bool(actions & {Place, Slide}), _circle(palette.VERMILLION, palette.INK, "just moved")),
        (Release in actions, _circle("white", palette.GREY, "just released")),
        (None in centers, Patch(facecolor=fill, edgecolor=palette.SKY, label="friction cone")),
        (any(c is not None for c in centers), Patch(label="common cone", **_COMMON_CONE)),
        (2 in sizes, Line2D([], [], linewidth=1.4, label="two-finger grasp", **line)),
        (bands, Line2D([], [], label="where it may be", **BAND)),
    ]
    return [sign for occurs, sign in signs if occurs]


def _circle(face: str, ring: str, label: str) -> Line2D:
    width = 1.5 if ring == palette.INK else 1.0
    style: dict[str, Any] = {"marker": "o", "markersize": 8, "linestyle": "none", "label": label}
    style |= {"markerfacecolor": face, "markeredgecolor": ring, "markeredgewidth": width}
    return Line2D([], [], **style)
