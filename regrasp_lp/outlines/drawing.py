"""A drawing as pieces of curves, and the outlines that they make up.

Pieces whose ends meet are joined into loops; a loop inside another one is a hole in it, a loop
inside that hole another outline, and so on (the even-odd rule).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from numbers import Real
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from regrasp_lp.errors import FileFormatError, OptionError, PolygonError
from regrasp_lp.outlines.curves import Curve, check_number
from regrasp_lp.ring_checks import MAX_EXTENT, check_rings, first_conflict, nesting
from regrasp_lp.rings import format_point

__all__ = ["Expansion", "Outline", "Piece", "Reading", "outlines"]

_Floats: TypeAlias = npt.NDArray[np.float64]
_Exact: TypeAlias = tuple[Fraction, ...]

FLATTENING = 1e-3
"""Default distance between curves and their chords, in diagonals of the drawing."""
JOINING = 1e-6
"""Default distance between ends that are joined, in diagonals of the drawing."""
_NAMED = 8
"""How many entities a message names at most."""


MOST_PIECES = 100_000
"""Entities of a drawing, those of blocks and uses as often as they are placed."""


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
            raise OptionError("flattening=0 would need edges without end: give a small length")
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


class Expansion:
    """Counts what a drawing consists of: blocks within blocks can be without end."""

    def __init__(self) -> None:
        self._count = 0

    def add(self, where: object, count: int = 1) -> None:
        """Count one more entity, or several.

        Raises
        ------
        FileFormatError
            If there are more than `MOST_PIECES`.
        """
        self._count += count
        if self._count > MOST_PIECES:
            raise FileFormatError(
                f"is a drawing of more than {MOST_PIECES:,} entities, those of repeated blocks "
                f"counted as often as they are placed (this one is in {where}): draw the object "
                "alone, or read a part of the drawing"
            )


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
    boxes = np.stack([_box(piece) for piece in pieces])
    size = float(np.hypot(*(boxes[:, 2:].max(axis=0) - boxes[:, :2].min(axis=0))))
    if size == 0:
        raise FileFormatError(f"the drawing is {size:g} in size: there is nothing to grasp")
    flattening = FLATTENING * size if reading.flattening is None else reading.flattening
    joining = JOINING * size if reading.joining is None else reading.joining
    chains: list[_Chain] = []
    n = 0
    for piece in pieces:
        chain = _chain(piece, flattening, joining)
        if chain is not None:
            chains.append(chain)
            n += len(chain.points)
            check_number(n, flattening)
    loops = _joined(chains, joining)
    _check(loops)
    inside = nesting([loop.points for loop in loops])
    return _nested(loops, inside)


def _box(piece: Piece) -> _Floats:
    """The box of a piece: (min x, min y, max x, max y)."""
    boxes = np.stack([curve.bounds for curve in piece.curves])
    if not (np.abs(boxes) <= MAX_EXTENT).all():
        raise FileFormatError(
            f"{piece.entity} has coordinates that are no numbers, or larger than {MAX_EXTENT:g}"
        )
    return np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])


def _chain(piece: Piece, flattening: float, joining: float) -> _Chain | None:
    """The points of a piece, or None if it is shorter than what is joined."""
    parts = [curve.flattened(flattening) for curve in piece.curves]
    points = np.concatenate([parts[0][:1], *(part[1:] for part in parts)])
    kept = [0]
    if (np.hypot(*np.diff(points, axis=0).T) > joining).all():
        kept = list(range(len(points)))
    else:
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
    distance, nearest = _nearest(ends, 3)  # an end itself, its partner, and one too many
    branches = np.flatnonzero(distance[:, 2] <= joining)
    if len(branches):
        away = np.hypot(*(ends - ends[branches[0]]).T)
        meeting = np.flatnonzero(away <= joining).tolist()
        names = [pieces[k // 2].entity for k in meeting[:_NAMED]]
        names += ["and more"] * (len(meeting) > _NAMED)
        raise FileFormatError(
            f"{len(meeting)} ends meet at {format_point(ends[branches[0]])}: {'; '.join(names)}: "
            f"outlines do not branch (with joining={joining:.3g}, nearer ends are one point)"
        )
    alone = np.flatnonzero(distance[:, 1] > joining)
    if len(alone):
        raise _open_ends(alone, ends, pieces, joining)
    partners: list[int] = (nearest[:, 0] + nearest[:, 1] - np.arange(len(ends))).tolist()
    return partners


def _nearest(points: _Floats, k: int) -> tuple[_Floats, npt.NDArray[np.intp]]:
    """Distances to the k nearest of the points, itself among them, and which these are; (n, k)."""
    from scipy.spatial import cKDTree

    distances, found = cKDTree(points).query(points, k=k)
    return np.asarray(distances, dtype=np.float64), np.asarray(found, dtype=np.intp)


def _open_ends(
    alone: npt.NDArray[np.intp], ends: _Floats, pieces: Sequence[Piece], joining: float
) -> FileFormatError:
    """Name the two ends of the smallest gap."""
    gaps, nearest = _nearest(ends[alone], 2)
    k = int(gaps[:, 1].argmin())
    first, second = sorted(alone[nearest[k]].tolist())
    return FileFormatError(
        f"{pieces[first // 2].entity} is open: it ends at {format_point(ends[first])}, "
        f"{gaps[k, 1]:.3g} from {format_point(ends[second])}, the nearest open end, of "
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
    pair = first_conflict([loop.points for loop in loops])
    if pair is not None:
        owner = np.repeat(np.arange(len(loops)), [len(loop.points) for loop in loops])
        first, second = (loops[owner[i]].piece.entity for i in pair)
        starts = np.concatenate([loop.points for loop in loops])
        ends = np.concatenate([np.roll(loop.points, -1, axis=0) for loop in loops])
        edges = [np.stack([starts[i], ends[i]]) for i in pair]
        raise PolygonError(
            f"{first} meets {second} at {format_point(_common_point(*edges))}: outlines and holes "
            "may not touch or cross; draw each of them once, and unite what overlaps"
        )


def _common_point(one: _Floats, other: _Floats) -> _Floats:
    """A point of two edges that meet: an end that is on the other one, or where they cross.

    Edges from a to b and from c to d, which cross, share a + (b − a) A / (A − B), where A and B are
    the signed areas of the triangles c, d, a and c, d, b. Found exactly, then rounded.
    """
    (a, b), (c, d) = ends = [[tuple(map(Fraction, p)) for p in e.tolist()] for e in (one, other)]
    for point, (p, q) in ((a, ends[1]), (b, ends[1]), (c, ends[0]), (d, ends[0])):
        between = all(min(x, y) <= z <= max(x, y) for x, y, z in zip(p, q, point, strict=True))
        if between and _turn(p, q, point) == 0:
            return np.array(point, dtype=np.float64)
    before, after = _turn(c, d, a), _turn(c, d, b)
    share = before / (before - after)
    return np.array([x + (y - x) * share for x, y in zip(a, b, strict=True)], dtype=np.float64)


def _turn(p: _Exact, q: _Exact, r: _Exact) -> Fraction:
    """(q − p) × (r − p)."""
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])


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
