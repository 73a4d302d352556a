"""The largest independent contact regions of an object, over all its grasps.

Contacts may be anywhere in a box ``[u⁻, u⁺]``, each on its own, iff ``max_k M_k(u⁻) > 0`` and
``min_j M_j(u⁺) < 0``, for no torque function decreases in any position. So the largest box with one
pair of functions (j, k) is a linear program of two rows. The equal widths of the best box of every
pair of every set come in closed form, which also bounds all other boxes; programs are solved for
those sets whose bound is above what has been found, best first.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.contact import Grasp
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import Cones, FloatArray, IntArray
from regrasp_lp.grasp_sets.candidates import complete_candidates
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver, maximise_margins
from regrasp_lp.margins import largest_margins
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import TorqueFunctions, torque_functions

Widths = Literal["least", "total"]

_CHUNK = 10_000
_BATCH = 20  # programs at a time, best bound first
_ROUNDING = 1e-12
_KEPT = 1e-7  # of the least width: what making the others wider may take from it


@dataclass(frozen=True, eq=False)
class LargestRegions:
    """The largest independent contact regions, and the proof that none are larger.

    Parameters
    ----------
    polygon : Polygon
    grasp : Grasp
        The contacts in the middle of the regions.
    regions : numpy.ndarray, shape (m, 2)
        First and last position on the edge of each contact. Contacts anywhere in them, ends
        included, are in force closure, decided exactly.
    width : float
        What was maximised: the least width of a region, or the sum of all widths.
    bound : float
        No regions of any grasp are wider: from the multipliers of the programs.

    Examples
    --------
    >>> block = Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])
    >>> found = largest_regions(block, friction=0.4)
    >>> found.grasp.edges.tolist(), (found.regions.round(6) + 0.0).tolist()
    ([0, 0, 2], [[0.0, 2.8], [3.2, 6.0], [1.6, 4.4]])
    >>> round(found.width, 6), found.gap < 1e-9
    (2.8, True)
    """

    polygon: Polygon
    grasp: Grasp
    regions: FloatArray
    width: float
    bound: float

    @property
    def widths(self) -> FloatArray:
        """The width of each region, shape (m,)."""
        return np.asarray(self.regions[:, 1] - self.regions[:, 0])

    @property
    def gap(self) -> float:
        """``bound - width``."""
        return self.bound - self.width

    def __repr__(self) -> str:
        edges = ", ".join(map(str, self.grasp.edges.tolist()))
        return f"<LargestRegions on edges {edges}: width {self.width:.6g}, gap {self.gap:.1e}>"


def largest_regions(
    polygon: Polygon,
    friction: ArrayLike,
    *,
    contacts: int | None = None,
    widths: Widths = "least",
    edges: Iterable[int] | None = None,
) -> LargestRegions | None:
    """Return the largest independent contact regions over all grasps of an object, proved.

    Parameters
    ----------
    polygon : Polygon
    friction : float or sequence of float
        μ, one value or one per edge.
    contacts : {2, 3}, optional
        How many contacts; by default whatever is better, two if they are as good.
    widths : {"least", "total"}
        What is to be as large as possible: the width of the narrowest region (and, that being so,
        the sum of all), or the sum of all widths, where some may be 0.
    edges : iterable of int, optional
        Only grasps on these edges: within one grasp set, as Ponce and Faverjon do.

    Returns
    -------
    LargestRegions or None
        None if the object has no grasp.

    Raises
    ------
    OptionError
        If `contacts` or `widths` is none of those, or `edges` are not two or three.
    ContactError
        If there is no such edge.

    Notes
    -----
    Regions of two contacts on one edge have no point in common. A region ends with its edge.

    J. Ponce and B. Faverjon (*On computing three-finger force-closure grasps of polygonal objects*,
    1995) maximise regions by a linear program within one convex set of concurrent grasps, all of
    which share a focus point; here no focus point is needed, and all sets are compared. J. King and
    others (*Fast estimation of globally optimal independent contact regions*, arXiv 2506.08856)
    look for the largest cube of valid grasps in the space of arc lengths by an incremental Delaunay
    triangulation, for any measure of grasps that can be evaluated, with bounded suboptimality.
    Their regions may go round a vertex of the object, those here not; in return the answer is the
    optimum, to the rounding that `LargestRegions.gap` tells.

    Examples
    --------
    >>> block = Polygon([(0, 0), (8, 0), (8, 3), (0, 3)])
    >>> found = largest_regions(block, friction=0.5, contacts=2)
    >>> found.grasp.edges.tolist(), round(found.width, 6), abs(found.gap) < 1e-6
    ([1, 3], 3.0, True)
    """
    if widths not in ("least", "total"):
        raise OptionError(f'widths must be "least" or "total", got {widths!r}')
    cones = Cones.of(polygon, friction)
    best: _Box | None = None
    bound = -np.inf
    for candidates in _candidates(polygon, cones, contacts, edges):
        for first in range(0, len(candidates), _CHUNK):
            best, above = _largest(cones, candidates[first : first + _CHUNK], widths, best)
            bound = max(bound, above)
    if best is None:
        return None
    return _in_polygon(polygon, best, bound, widths)


@dataclass(frozen=True, eq=False)
class _Box:
    """Fractions between which contacts are in force closure, exactly, and the measure of them."""

    functions: TorqueFunctions
    piece: IntArray
    lower: FloatArray
    upper: FloatArray
    width: float


def _candidates(
    polygon: Polygon, cones: Cones, contacts: int | None, edges: Iterable[int] | None
) -> Iterator[IntArray]:
    """Combinations of edges of either number of contacts, shape (N, m)."""
    if contacts not in (None, 2, 3):
        raise OptionError(f"contacts must be 2, 3 or None for either, got {contacts!r}")
    if edges is None:
        for m in (2, 3) if contacts is None else (contacts,):
            yield complete_candidates(cones, m)
        return
    if isinstance(edges, str) or not isinstance(edges, Iterable):
        raise OptionError(f"edges has to be a list of two or three edges, not {edges!r}")
    chosen = sorted(polygon.resolve([(edge, 0.0) for edge in edges]).edges.tolist())
    if len(chosen) not in (2, 3) or contacts not in (None, len(chosen)):
        raise OptionError(f"edges are those of 2 or 3 contacts, as `contacts` says, got {chosen}")
    yield np.array([chosen], dtype=np.intp)


# --- bounds, and programs best first ------------------------------------------------------------


def _largest(
    cones: Cones, edges: IntArray, widths: Widths, best: _Box | None
) -> tuple[_Box | None, float]:
    """The best box on any of these edges or before, and a bound of all on these edges."""
    functions = torque_functions(cones, edges)
    pieces, bounds = _pieces(functions, widths)
    proved = -np.inf
    for first in range(0, len(pieces), _BATCH):
        least = 0.0 if best is None else best.width
        if bounds[first] <= least:  # and so are all that follow
            return best, max(proved, float(bounds[first]))
        some = slice(first, first + _BATCH)
        found = maximise_margins(_programs(functions, pieces[some], widths), get_solver("highs"))
        proved = max(proved, float(np.minimum(found.bounds, bounds[some]).max()))
        for n in np.argsort(-found.margins).tolist():
            if best is None or found.margins[n] > best.width:
                box = _box(functions, pieces[first + n], found.points[n], widths)
                best = box if box is not None and (best is None or box.width > best.width) else best
    return best, proved


def _pieces(functions: TorqueFunctions, widths: Widths) -> tuple[IntArray, FloatArray]:
    """All pieces (set, j, k) that have a box, and bounds of its measure, the largest first."""
    rates, lengths = functions.rates, functions.lengths
    alpha, a = functions.offsets / rates, functions.slopes / rates[..., None]
    tolerances = largest_margins(
        alpha[:, None, :],
        a[:, None, :, :],
        alpha[:, :, None],
        a[:, :, None, :],
        ends=np.broadcast_to(1 / lengths[:, None, None, :], (*a.shape[:2], *a.shape[1:])),
    )
    different = ~np.eye(a.shape[1], dtype=bool)
    valid = functions.valid[:, :, None] & functions.valid[:, None, :] & different
    errors = 2 * functions.errors / rates
    tolerances = tolerances + errors[:, :, None] + errors[:, None, :]
    row, j, k = np.nonzero(valid & functions.spans[:, None, None] & (tolerances > 0))
    if widths == "least":
        bounds = 2 * tolerances[row, j, k]
    else:
        below = _least_sum(-alpha, a, lengths)
        above = _least_sum(alpha + a.sum(axis=2), a, lengths)
        bounds = (lengths.sum(axis=1)[row] - below[row, k] - above[row, j]) * (1 + _ROUNDING)
        bounds = bounds + 2 * (errors[row, j] + errors[row, k])
    order = np.argsort(-bounds, kind="stable")
    return np.stack((row, j, k), axis=1)[order].astype(np.intp), bounds[order]


def _least_sum(needed: FloatArray, slopes: FloatArray, lengths: FloatArray) -> FloatArray:
    """The least ``Σ l_i f_i`` with ``slopes · f >= needed`` and f in the unit box, shape (N, J).

    One row, one multiplier y: ``max over y >= 0 of y needed - Σ_i max(0, y slope_i - l_i)``, at 0
    or where a term starts.
    """
    best = np.zeros(needed.shape)
    for i in range(slopes.shape[2]):
        rise = slopes[:, :, i]
        y = np.divide(lengths[:, None, i], rise, out=np.zeros(rise.shape), where=rise > 0)
        excess = np.maximum(0.0, y[..., None] * slopes - lengths[:, None, :]).sum(axis=2)
        best = np.maximum(best, y * needed - excess)
    return best


def _programs(functions: TorqueFunctions, pieces: IntArray, widths: Widths) -> LinearSets:
    """The programs of pieces, over the fractions of both corners of the box."""
    row, j, k = pieces.T
    count, m = len(pieces), functions.m
    lengths = functions.lengths[row]
    signs = np.zeros((count, 2, 2 * m))
    signs[:, 0, :m], signs[:, 1, m:] = -functions.slopes[row, k], functions.slopes[row, j]
    limits = np.stack((functions.offsets[row, k], -functions.offsets[row, j]), axis=1)
    ends = np.eye(m) * lengths[:, None, :]
    spans = np.concatenate((ends, -ends), axis=2)
    rows, bounds, scales = [signs], [limits], [np.zeros((count, 2))]
    if widths == "total":
        rows.append(spans.sum(axis=1, keepdims=True))
        bounds.append(np.zeros((count, 1)))
        scales.append(np.ones((count, 1)))
    rows.append(spans)
    bounds.append(np.zeros((count, m)))
    scales.append(np.full((count, m), 1.0 if widths == "least" else 0.0))
    same = functions.edges[row][:, :-1] == functions.edges[row][:, 1:]
    apart = np.concatenate((-np.roll(ends, -1, axis=1), ends), axis=2)[:, :-1]
    rows.append(np.where(same[..., None], apart, 0.0))
    bounds.append(np.zeros(same.shape))
    scales.append(np.zeros(same.shape))
    names = tuple(f"{end}{i}" for end in ("first", "last") for i in range(m))
    box = np.zeros((count, 2 * m)), np.ones((count, 2 * m))
    joined = [np.concatenate(part, axis=1) for part in (rows, scales, bounds)]
    return LinearSets(names, joined[0], joined[1], joined[2], *box)


# --- boxes --------------------------------------------------------------------------------------


def _box(
    functions: TorqueFunctions, piece: IntArray, point: FloatArray, widths: Widths
) -> _Box | None:
    """The box of a solution, made smaller until it is in force closure by exact signs."""
    one = functions.take(piece[:1])
    low, high = point[: one.m], point[one.m :]
    middle = (low + high) / 2
    for shrink in (0.0, *(10.0**n for n in range(-15, -5))):
        lower = np.minimum(low + shrink * np.maximum(high - low, _ROUNDING), middle)
        upper = np.maximum(high - shrink * np.maximum(high - low, _ROUNDING), middle)
        if one.independent(lower[None], upper[None])[0]:
            spans = (upper - lower) * one.lengths[0]
            width = float(spans.min() if widths == "least" else spans.sum())
            return _Box(one, piece[1:], lower, upper, width)
    return None


def _widened(box: _Box) -> _Box:
    """The same least width, and the other regions as wide as they can be."""
    j, k = box.piece.tolist()
    functions, m = box.functions, box.functions.m
    programs = _programs(functions, np.array([[0, j, k]]), "total")
    bounds = programs.bounds.copy()
    bounds[:, 3 : 3 + m] = -box.width * (1 - _ROUNDING)
    found = maximise_margins(replace(programs, bounds=bounds), get_solver("highs"))
    wider = _box(functions, np.array([0, j, k]), found.points[0], "least")
    return wider if wider is not None and wider.width >= box.width * (1 - _KEPT) else box


def _in_polygon(polygon: Polygon, box: _Box, bound: float, widths: Widths) -> LargestRegions:
    box = _widened(box) if widths == "least" else box
    edges, lengths = box.functions.edges[0], box.functions.lengths[0]
    regions = np.stack((box.lower, box.upper), axis=1) * lengths[:, None]
    regions.setflags(write=False)
    middle = (box.lower + box.upper) / 2
    grasp = polygon.resolve(Grasp.at_fractions(zip(edges.tolist(), middle.tolist(), strict=True)))
    return LargestRegions(polygon, grasp, regions, box.width, max(bound, box.width))
