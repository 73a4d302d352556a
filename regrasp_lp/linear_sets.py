"""Convex sets given by linear rows with margins, stacked, with named coordinates.

A set is ``{x : rows x < bounds, lower <= x <= upper}``. Each row has a scale: shifted inwards by
ε it reads ``rows x + scales ε <= bounds``, and the *margin* of a point is the largest such ε. A
stack holds B sets over the same names. Nothing here knows what the coordinates mean, nor how a
linear program is solved.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from regrasp_lp.errors import OptionError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinearSets:
    """B convex sets over the same n named coordinates, with R rows each.

    Parameters
    ----------
    names : tuple of str
        Names of the n coordinates, all different.
    rows : numpy.ndarray, shape (B, R, n)
    scales : numpy.ndarray, shape (B, R)
        By how much a row moves per unit of margin, >= 0.
    bounds : numpy.ndarray, shape (B, R)
    lower, upper : numpy.ndarray, shape (B, n)
        The box.

    Examples
    --------
    The triangle ``x > 0, y > 0, x + y < 1`` as rows, in the box [-1, 1]²:

    >>> triangle = LinearSets(
    ...     ("x", "y"), np.array([[[-1.0, 0.0], [0.0, -1.0], [1.0, 1.0]]]), np.ones((1, 3)),
    ...     np.array([[0.0, 0.0, 1.0]]), -np.ones((1, 2)), np.ones((1, 2)))
    >>> triangle.margins(np.array([[0.25, 0.25]]))
    array([0.25])
    >>> triangle.restrict({"y": 0.5}).names
    ('x',)
    """

    names: tuple[str, ...]
    rows: FloatArray
    scales: FloatArray
    bounds: FloatArray
    lower: FloatArray
    upper: FloatArray

    def __post_init__(self) -> None:
        b, r, n = self.rows.shape
        shapes = {
            "names": (len(self.names), n),
            "scales": (self.scales.shape, (b, r)),
            "bounds": (self.bounds.shape, (b, r)),
            "lower": (self.lower.shape, (b, n)),
            "upper": (self.upper.shape, (b, n)),
        }
        for name, (got, expected) in shapes.items():
            if got != expected:
                raise OptionError(f"{name} has shape {got}; rows of {(b, r, n)} need {expected}")
        if len(set(self.names)) != n:
            raise OptionError(f"coordinate names must differ, got {self.names}")

    def __repr__(self) -> str:
        b, r, _ = self.rows.shape
        return f"<{b} LinearSets over {', '.join(self.names)}: {r} rows · x + scales ε <= bounds>"

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index: int) -> LinearSets:
        """Return one set, as a stack of one."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"set {index} of {len(self)}")
        return self.take(np.array([index]))

    def __iter__(self) -> Iterator[LinearSets]:
        return (self[i] for i in range(len(self)))

    def take(self, chosen: NDArray[np.intp]) -> LinearSets:
        """Return some of the sets (repetitions allowed)."""
        return LinearSets(
            self.names,
            self.rows[chosen],
            self.scales[chosen],
            self.bounds[chosen],
            self.lower[chosen],
            self.upper[chosen],
        )

    def rename(self, names: Sequence[str]) -> LinearSets:
        """Return the same sets over other names, in the same order."""
        return replace(self, names=tuple(names))

    def translate(self, offsets: Mapping[str, float]) -> LinearSets:
        """Return the sets moved along some of their coordinates."""
        by = np.array([float(offsets.get(name, 0.0)) for name in self.names])
        return replace(
            self, bounds=self.bounds + self.rows @ by, lower=self.lower + by, upper=self.upper + by
        )

    def in_unit_box(self) -> LinearSets:
        """Return the same sets over coordinates that run from 0 to 1; the box must be bounded."""
        width = self.upper - self.lower
        return replace(
            self,
            rows=self.rows * width[:, None, :],
            bounds=self.bounds - np.einsum("brn,bn->br", self.rows, self.lower),
            lower=np.zeros(width.shape),
            upper=np.ones(width.shape),
        )

    def margins(self, points: FloatArray) -> FloatArray:
        """Return the margin of one point per set; -inf outside the box.

        Parameters
        ----------
        points : numpy.ndarray, shape (B, n)

        Returns
        -------
        numpy.ndarray, shape (B,)
            The largest ε with ``rows x + scales ε <= bounds``; a row of scale 0 gives ±inf.
        """
        points = np.broadcast_to(points, self.lower.shape)
        slack = self.bounds - np.einsum("brn,bn->br", self.rows, points)
        free = np.where(slack >= 0, np.inf, -np.inf)
        scaled = np.divide(slack, self.scales, out=free, where=self.scales > 0)
        inside = ((points >= self.lower) & (points <= self.upper)).all(axis=1)
        return np.where(inside, scaled.min(axis=1, initial=np.inf), -np.inf)

    def restrict(self, values: Mapping[str, float]) -> LinearSets:
        """Return the sets with some coordinates fixed, over the remaining ones.

        Raises
        ------
        OptionError
            If a name is unknown, or its value is outside the box of a set.
        """
        unknown = sorted(set(values) - set(self.names))
        if unknown:
            raise OptionError(f"cannot fix {unknown}: the coordinates are {self.names}")
        fixed = np.array([name in values for name in self.names], dtype=bool)
        at = np.array([float(values.get(name, 0.0)) for name in self.names])
        outside = fixed & ((at < self.lower) | (at > self.upper)).any(axis=0)
        if outside.any():
            name = self.names[int(np.argmax(outside))]
            raise OptionError(f"cannot fix {name} = {values[name]}: it is outside the box")
        return LinearSets(
            tuple(name for name in self.names if name not in values),
            self.rows[:, :, ~fixed],
            self.scales,
            self.bounds - self.rows[:, :, fixed] @ at[fixed],
            self.lower[:, ~fixed],
            self.upper[:, ~fixed],
        )

    def join(self, other: LinearSets, on: Sequence[str]) -> LinearSets:
        """Return the pairwise joins: points of both sets that agree in the shared coordinates.

        Parameters
        ----------
        other : LinearSets
            A stack of the same length.
        on : sequence of str
            Exactly the names that the two have in common (possibly none).

        Returns
        -------
        LinearSets
            Over the names of `self`, then the remaining ones of `other`.

        Raises
        ------
        OptionError
            If `on` is not exactly the set of shared names, or the stacks differ in length.
        """
        shared = set(self.names) & set(other.names)
        if set(on) != shared:
            raise OptionError(
                f"join on {tuple(on)} but {self.names} and {other.names} share "
                f"{tuple(sorted(shared))}: rename the coordinates, or join on those"
            )
        if len(self) != len(other):
            raise OptionError(f"cannot join stacks of {len(self)} and {len(other)} sets")
        own = [name for name in other.names if name not in shared]
        names = self.names + tuple(own)
        place = [names.index(name) for name in other.names]
        b, n = len(self), len(names)
        theirs = np.zeros((b, other.rows.shape[1], n))
        theirs[:, :, place] = other.rows
        mine = np.pad(self.rows, ((0, 0), (0, 0), (0, n - len(self.names))))
        lower, upper = np.full((b, n), -np.inf), np.full((b, n), np.inf)
        lower[:, : len(self.names)], upper[:, : len(self.names)] = self.lower, self.upper
        lower[:, place] = np.maximum(lower[:, place], other.lower)
        upper[:, place] = np.minimum(upper[:, place], other.upper)
        return LinearSets(
            names,
            np.concatenate((mine, theirs), axis=1),
            np.concatenate((self.scales, other.scales), axis=1),
            np.concatenate((self.bounds, other.bounds), axis=1),
            lower,
            upper,
        )
