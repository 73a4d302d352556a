"""Counts of a switching graph, to print."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class KindCounts:
    """Counts of the grasp sets of one kind.

    Parameters
    ----------
    candidates : int
        Combinations of edges that were considered.
    sets : int
        Those that have a grasp: vertices of the graph.
    components : int
        Connected components of the graph without the sets of other kinds.
    """

    candidates: int
    sets: int
    components: int


@dataclass(frozen=True)
class Summary:
    """Counts of a switching graph; `str` gives a readable table.

    `regrasp_lp.tables` puts several into one table.

    Parameters
    ----------
    name : str
    n_edges : int
        Edges of the polygon.
    kinds : mapping of str to KindCounts
        Counts of each kind of grasp sets.
    n_sets, n_switches : int
    components : list of int
        Sizes, largest first.
    seconds : mapping of str to float
        How long each part of the construction took.
    """

    name: str
    n_edges: int
    kinds: Mapping[str, KindCounts]
    n_sets: int
    n_switches: int
    components: list[int]
    seconds: Mapping[str, float]

    def __str__(self) -> str:
        def row(kind: str, candidates: object, sets: object, components: object) -> str:
            return f"{kind:<14}{candidates:>12}{sets:>10}{components:>12}"

        sizes = ", ".join(str(size) for size in self.components[:8])
        more = ", …" if len(self.components) > 8 else ""
        return "\n".join(
            [
                f"{self.name or 'unnamed polygon'}: {self.n_edges} edges",
                "",
                row("kind", "candidates", "sets", "components"),
                *(row(k, c.candidates, c.sets, c.components) for k, c in self.kinds.items()),
                row("all", "", self.n_sets, len(self.components)),
                "",
                f"switches    {self.n_switches}",
                f"components  {len(self.components)}" + (f" (sizes {sizes}{more})" * bool(sizes)),
                "seconds     " + ", ".join(f"{k} {v:.3f}" for k, v in self.seconds.items()),
            ]
        )
