"""Counts of a switching graph, to print."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Summary:
    """Counts of a switching graph; `str` gives a readable table.

    Parameters
    ----------
    name : str
    n_edges : int
        Edges of the polygon.
    kinds : dict of str to (int, int)
        Per kind the number of candidate combinations and of vertices.
    n_sets, n_switches : int
    components : list of int
        Sizes, largest first.
    seconds : dict of str to float
    """

    name: str
    n_edges: int
    kinds: dict[str, tuple[int, int]]
    n_sets: int
    n_switches: int
    components: list[int]
    seconds: dict[str, float]

    def __str__(self) -> str:
        lines = [f"{self.name or 'unnamed polygon'}: {self.n_edges} edges", ""]
        lines.append(f"{'kind':<14}{'candidates':>12}{'sets':>10}")
        for kind, (candidates, sets) in self.kinds.items():
            lines.append(f"{kind:<14}{candidates:>12}{sets:>10}")
        lines.append(f"{'all':<14}{'':>12}{self.n_sets:>10}")
        sizes = ", ".join(str(size) for size in self.components[:8])
        more = ", …" if len(self.components) > 8 else ""
        lines += [
            "",
            f"switches    {self.n_switches}",
            f"components  {len(self.components)}" + (f" (sizes {sizes}{more})" if sizes else ""),
            "seconds     " + ", ".join(f"{k} {v:.3f}" for k, v in self.seconds.items()),
        ]
        return "\n".join(lines)
