"""Where an object lies on the paper: its figure, its axes and their scale in points."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation, Transform

from regrasp_lp.errors import OptionError
from regrasp_lp.friction import FloatArray
from regrasp_lp.grasp_sets.grasp_set import GraspSet
from regrasp_lp.plotting.palette import MARGIN

POINTS_PER_INCH = 72.0


class OwnFigure(Figure):
    """A figure that notebooks show as it is, without pyplot."""

    def __init__(self, size: tuple[float, float], dpi: float) -> None:
        super().__init__(figsize=size, dpi=dpi, facecolor="white")
        FigureCanvasAgg(self)

    def _repr_png_(self) -> bytes:
        data = io.BytesIO()
        self.savefig(data, format="png")
        return data.getvalue()


def check_drawable(grasp_set: GraspSet) -> None:
    """Raise OptionError for a set that limits of a hand cut: its pictures know whole edges only."""
    cones = grasp_set.torque.cones
    if grasp_set.limited is not None or cones.whole is not cones:
        raise OptionError(
            "pictures of grasp sets are for hands without limits: draw the set of the same edges "
            f"{grasp_set.edges} in a graph that was built without them"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Drawing:
    """What a plot function drew on one axes.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        The axes, given or new.
    """

    ax: Axes

    @property
    def figure(self) -> Any:
        """The figure of the axes."""
        return self.ax.figure

    def __repr__(self) -> str:
        return f"<{type(self).__name__} on {self.ax!r}>"

    def _repr_png_(self) -> bytes | None:
        # an axes that was given belongs to a figure that its owner shows
        figure = self.ax.figure
        return figure._repr_png_() if isinstance(figure, OwnFigure) else None


@dataclass(frozen=True, eq=False)
class Frame:
    """The affine map from an object's coordinates to points from the axes' lower left corner.

    Parameters
    ----------
    origin : numpy.ndarray, shape (2,)
        Coordinates of the lower left corner.
    scale : numpy.ndarray, shape (2,)
        Points per unit of length; negative along an inverted axis.
    size : numpy.ndarray, shape (2,)
        Width and height of the axes in points.
    """

    origin: FloatArray
    scale: FloatArray
    size: FloatArray

    @classmethod
    def of(cls, ax: Axes) -> Frame:
        """Return the frame of the axes as their limits are."""
        (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
        size = _paper_size(ax)
        origin = np.array([left, bottom])
        return cls(origin, size / (np.array([right, top]) - origin), size)

    def points(self, xy: FloatArray) -> FloatArray:
        """Return coordinates (..., 2) as points on the paper."""
        return (xy - self.origin) * self.scale

    def coordinates(self, points: FloatArray) -> FloatArray:
        """Return points (..., 2) on the paper as coordinates of the object."""
        return self.origin + points / self.scale

    def directions(self, xy: FloatArray) -> FloatArray:
        """Return unit vectors (..., 2) of the object as unit vectors on the paper."""
        return xy * np.sign(self.scale)

    def lengths(self, points: FloatArray) -> FloatArray:
        """Return vectors on the paper, in points, as vectors of the object."""
        return points / self.scale


def fit(ax: Axes, bounds: FloatArray, margin: float = MARGIN) -> Frame:
    """Set limits that show `bounds` with `margin` points around it, at equal aspect.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    bounds : numpy.ndarray, shape (4,)
        min x, min y, max x, max y.
    margin : float, optional
        At most a quarter of the width and of the height is used for it on a side.

    Returns
    -------
    Frame
    """
    inverted = np.array([ax.xaxis_inverted(), ax.yaxis_inverted()])
    size = _paper_size(ax)
    room = size - 2 * np.minimum(margin, size / 4)
    extent = bounds[2:] - bounds[:2]
    unit = float((extent / room).max())  # length of the object per point
    center, half = bounds[:2] + extent / 2, np.where(inverted, -1, 1) * size * unit / 2
    low, high = center - half, center + half
    # matplotlib reckons smaller ranges as 1e-30; with these limits the aspect is equal anyhow
    ax.set_aspect("equal" if extent.max() > 1e-28 else "auto", adjustable="box")
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    return Frame.of(ax)


def draw_line(ax: Axes, points: FloatArray, **style: Any) -> Line2D:
    """Draw points, shape (K, 2), joined by a line."""
    line = Line2D(*points.T, **style)
    ax.add_line(line)
    return line


def shifted(ax: Axes, offset: FloatArray) -> Transform:
    """Return the transform of the axes' coordinates, shifted on the paper by points."""
    inches = offset / POINTS_PER_INCH
    return ax.transData + ScaledTranslation(inches[0], inches[1], ax.figure.dpi_scale_trans)


def own_axes(bounds: FloatArray, longest: float) -> Axes:
    """Return new axes with coordinates along their sides, sized for an object.

    Parameters
    ----------
    bounds : numpy.ndarray, shape (4,)
    longest : float
        Length of the longer side of the axes, in inches.

    Returns
    -------
    matplotlib.axes.Axes
    """
    extent = bounds[2:] - bounds[:2]
    margins = 2 * MARGIN / POINTS_PER_INCH
    width, height = np.maximum(extent / extent.max() * (longest - margins) + margins, 1.8)
    left, right, bottom, top = 0.65, 0.15, 0.4, 0.4
    figure = OwnFigure((width + left + right, height + bottom + top), dpi=110)
    total = figure.get_size_inches()
    ax = figure.add_axes((left / total[0], bottom / total[1], width / total[0], height / total[1]))
    ax.tick_params(labelsize=7, length=2.5, width=0.6)
    ax.xaxis.offsetText.set_fontsize(7)
    ax.yaxis.offsetText.set_fontsize(7)
    for spine in ax.spines.values():
        spine.set_linewidth(0.6)
    return ax


def _paper_size(ax: Axes) -> FloatArray:
    """Width and height of the place of the axes, in points."""
    figure = ax.figure
    whole = figure
    while isinstance(whole, SubFigure):
        whole = whole.figure
    if whole.get_layout_engine() is not None:
        whole.draw_without_rendering()  # until then the layout has not given the axes their place
    box = ax.get_position(original=True).transformed(figure.transSubfigure)
    return np.array([box.width, box.height]) * (POINTS_PER_INCH / figure.dpi)
