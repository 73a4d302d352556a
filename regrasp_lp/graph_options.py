"""How a switching graph was built."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GraphOptions:
    """How a graph was built; see `build_switching_graph`."""

    sets: str = "complete"
    switching: str = "contact"
    min_margin: float = 0.0
    solver: str = "clarabel"
    presolve: bool = True

    @property
    def everything(self) -> bool:
        """Whether all force-closure grasps and all switches between them are considered."""
        return (self.sets, self.switching, self.min_margin) == ("complete", "contact", 0)
