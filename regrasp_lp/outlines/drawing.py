"""A drawing as pieces of curves, and the outlines that they make up.

Pieces whose ends meet are joined into loops; a loop inside another one is a hole in it, a loop
inside that hole another outline, and so on (the even-odd rule).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from regrasp_lp.errors import FileFormatError, OptionError, PolygonError
from regrasp_lp.outlines.curves import Curve
from regrasp_lp.ring_checks import check_rings, conflicts, nesting
from regrasp_lp.rings import format_point

__all__ = ["Outline", "Piece", "Reading", "outlines"]

_Floats: TypeAlias = npt.NDArray[np.float64]

FLATTENING = 1e-3
"""Default distance between curves and their chords, in diagonals of the drawing."""
JOINING = 1e-6
"""Default distance between ends that are joined, in diagonals of the drawing."""


class Reading(NamedTuple):
    """How a drawing is read; lengths in its own unit, None for the defaults."""

    flattening: float | None = None
    joining: float | None = None
    layers: tuple[str, ...] | None = None
    ignore: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        flattening: float | None,
        joining: float | None,
        layers: Iterable[str] | None,
        ignore: Iterable[str],
    ) -> Reading:
        """Check the options of `regrasp_lp.read_polygons`.

        Raises
        ------
        OptionError
            If `flattening` is no positive length, `joining` no length, or a name no string.
        """
        for name, value in (("flattening", flattening), ("joining", joining)):
            a_number = isinstance(value, Real) and not isinstance(value, bool)
            if value is not None and not (a_number and 0 <= value < np.inf):
                raise OptionError(f"{name} has to be a length, not {value!r}")
        if flattening == 0:
            raise OptionError("flattening has to be more than 0: curves are no polygons")
        chosen = None if layers is None else _names("layers", layers)
        return cls(flattening, joining, chosen, _names("ignore", ignore))


def _names(option: str, given: Iterable[str]) -> tuple[str, ...]:
    """Names as a tuple; a single one may be given as it is."""
    names = (given,) if isinstance(given, str) else tuple(given)
    for name in names:
        if not isinstance(name, str):
            raise OptionError(f"{option} has to be a list of names, and {name!r} is none")
    return names


@dataclass(frozen=True)
class Piece:
    """Curves of one entity, one after another.

    Parameters
    ----------
    entity : str
        What messages call it.
    name : str or None
        What a polygon with this outline is called.
    curves : tuple of Curve
    closed : bool
        Whether a segment leads from the last point back to the first.
    compound : int, optional
        Closed pieces of one compound path that is filled by the non-zero rule share a number.
    """

    entity: str
    name: str | None
    curves: tuple[Curve, ...]
    closed: bool
    compound: int | None = None


class Outline(NamedTuple):
    """One polygon of a drawing: what messages call it, its name, and its rings."""

    entity: str
    name: str | None
    rings: list[_Floats]


class _Chain(NamedTuple):
    piece: Piece
    points: _Floats


def outlines(pieces: Sequence[Piece], reading: Reading) -> list[Outline]:
    """Return the polygons of a drawing, in the order of their outlines.

    Curves are flattened, and points nearer to the one before than `joining` are left out, so that
    the rings are within `flattening` + `joining` of the curves.

    Raises
    ------
    FileFormatError
        If ends are left open, more than two of them meet, a ring is no ring or rings meet.
    """
    pieces = [piece for piece in pieces if piece.curves]
    if not pieces:
        return []
    boxes = np.stack([curve.bounds for piece in pieces for curve in piece.curves])
    size = float(np.hypot(*(boxes[:, 2:].max(axis=0) - boxes[:, :2].min(axis=0))))
    if not 0 < size < np.inf:
        raise FileFormatError(f"the drawing is {size:g} in size: there is nothing to grasp")
    flattening = FLATTENING * size if reading.flattening is None else reading.flattening
    joining = JOINING * size if reading.joining is None else reading.joining
    chains = [_chain(piece, flattening, joining) for piece in pieces]
    loops = _joined([chain for chain in chains if chain is not None], joining)
    _check(loops)
    inside = nesting([loop.points for loop in loops])
    return _nested(loops, inside)


def _chain(piece: Piece, flattening: float, joining: float) -> _Chain | None:
    """The points of a piece, or None if it is shorter than what is joined."""
    parts = [curve.flattened(flattening) for curve in piece.curves]
    points = np.concatenate([parts[0][:1], *(part[1:] for part in parts)])
    kept = [0]
    for k, point in enumerate(points):
        if np.hypot(*(point - points[kept[-1]])) > joining:
            kept.append(k)
    if len(kept) == 1 and not piece.closed:
        return None
    if kept[-1] != len(points) - 1:  # the last point stays, and what is too near to it goes
        kept[-1] = len(points) - 1
    chain = points[kept]
    ends_meet = np.hypot(*(chain[-1] - chain[0])) <= joining
    if ends_meet and len(chain) > 2:
        return _Chain(_closed(piece), chain[:-1])
    return _Chain(piece, chain)


def _closed(piece: Piece) -> Piece:
    return Piece(piece.entity, piece.name, piece.curves, True, piece.compound)


# --- joining ------------------------------------------------------------------------------------


def _joined(chains: Sequence[_Chain], joining: float) -> list[_Chain]:
    """Closed chains, and open ones joined end to end; in the order of the first of each."""
    loops = {k: chain for k, chain in enumerate(chains) if chain.piece.closed}
    pending = [k for k in range(len(chains)) if k not in loops]
    if pending:
        ends = np.stack([chains[k].points[side] for k in pending for side in (0, -1)])
        partner = _partners(ends, [chains[k].piece for k in pending], joining)
        left = set(range(len(pending)))
        while left:
            first = min(left)
            members, points, end = [], [], 2 * first
            while end // 2 in left:  # into a chain by one end, out by the other
                left.remove(end // 2)
                members.append(pending[end // 2])
                chain = chains[members[-1]].points
                points.append((chain if end % 2 == 0 else chain[::-1])[:-1])
                end = partner[end ^ 1]
            piece = chains[members[0]].piece
            entity = piece.entity + (f" and {len(members) - 1} more" if len(members) > 1 else "")
            whole = Piece(entity, piece.name, piece.curves, True)
            loops[members[0]] = _Chain(whole, np.concatenate(points))
    return [loops[k] for k in sorted(loops)]


def _partners(ends: _Floats, pieces: Sequence[Piece], joining: float) -> list[int]:
    """The end that each end is joined to; ends 2k and 2k + 1 are those of piece k."""
    from scipy.spatial import cKDTree

    near = [[e] for e in range(len(ends))]
    for a, b in cKDTree(ends).query_pairs(joining, output_type="ndarray").tolist():
        near[a].append(b)
        near[b].append(a)
    for e, found in enumerate(near):
        if len(found) > 2:
            names = "; ".join(pieces[k // 2].entity for k in found)
            raise FileFormatError(
                f"{len(found)} ends meet at {format_point(ends[e])}: {names}: outlines do not "
                f"branch (ends nearer than joining={joining:.3g} are taken for one point)"
            )
    if alone := [e for e, found in enumerate(near) if len(found) == 1]:
        raise _open_ends(alone, ends, pieces, joining)
    return [found[0] + found[1] - e for e, found in enumerate(near)]


def _open_ends(
    alone: list[int], ends: _Floats, pieces: Sequence[Piece], joining: float
) -> FileFormatError:
    """Name the two ends of the smallest gap."""
    gaps = np.hypot(*(ends[alone][:, None] - ends[alone]).transpose(2, 0, 1))
    np.fill_diagonal(gaps, np.inf)
    first, second = sorted(alone[k] for k in divmod(int(gaps.argmin()), len(alone)))
    return FileFormatError(
        f"{pieces[first // 2].entity} is open: it ends at {format_point(ends[first])}, "
        f"{gaps.min():.3g} from {format_point(ends[second])}, the nearest open end, of "
        f"{pieces[second // 2].entity}: close the outline, or join ends over larger gaps "
        f"(joining=...; it is {joining:.3g} now)"
    )


# --- nesting ------------------------------------------------------------------------------------


def _check(loops: Sequence[_Chain]) -> None:
    """Refuse rings that are none, or that meet; the message names the entities."""
    for loop in loops:
        if len(loop.points) < 3:
            raise FileFormatError(
                f"{loop.piece.entity} encloses nothing: it has {len(loop.points)} different "
                "points; flatten its curves more finely, or leave it out"
            )
        check_rings([loop.points], loop.piece.entity)
    pairs = conflicts([loop.points for loop in loops])
    if pairs:
        owner = np.repeat(np.arange(len(loops)), [len(loop.points) for loop in loops])
        first, second = (loops[owner[i]].piece.entity for i in pairs[0])
        starts = np.concatenate([loop.points for loop in loops])
        raise PolygonError(
            f"{first} meets {second} near {format_point(starts[pairs[0][0]])}: outlines and holes "
            "may not touch or cross; draw each of them once, and unite what overlaps"
        )


def _nested(loops: Sequence[_Chain], inside: npt.NDArray[np.bool_]) -> list[Outline]:
    """Outlines with the holes directly inside them."""
    counts = _bounding(loops, inside)
    depth = (inside & counts).sum(axis=1)
    found: dict[int, Outline] = {}
    for k, loop in enumerate(loops):
        if counts[k] and depth[k] % 2 == 0:
            found[k] = Outline(loop.piece.entity, loop.piece.name, [loop.points])
    for k, loop in enumerate(loops):
        if counts[k] and depth[k] % 2 == 1:
            (owner,) = (s for s in found if inside[k, s] and depth[s] == depth[k] - 1)
            found[owner].rings.append(loop.points)
    return list(found.values())


def _bounding(loops: Sequence[_Chain], inside: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Which loops bound something: in a path filled by the non-zero rule not all need to.

    Such a loop does if of the winding numbers on its two sides just one is 0.
    """
    signs = np.array([_orientation(loop.points) for loop in loops])
    number = np.array([-1 if lo.piece.compound is None else lo.piece.compound for lo in loops])
    same = inside & (number[:, None] == number)
    outer = same @ signs
    bounding: npt.NDArray[np.bool_] = (number < 0) | ((outer == 0) != (outer + signs == 0))
    return bounding


def _orientation(ring: _Floats) -> int:
    x, y = (ring - ring[0]).T
    return 1 if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) > 0 else -1
