"""Write the pictures of the README to docs/images.

    python docs/gallery.py [FOLDER]

Needs the extra "plot". The plan at the top of the README is that of its first command.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import regrasp_lp as rl
from regrasp_lp import plotting

REPOSITORY = Path(__file__).resolve().parent.parent
MU = math.tan(math.radians(10))


def model(file: str, name: str) -> rl.Polygon:
    """Return a polygon of `models`."""
    polygons = rl.read_polygons(REPOSITORY / "models" / f"{file}.geojson")
    return next(polygon for polygon in polygons if polygon.name == name)


def widest(graph: rl.SwitchingGraph, kind: str) -> list[int]:
    """Return the numbers of the sets of a kind, that with the largest margin first."""
    numbers = (i for i, grasp_set in enumerate(graph.sets) if grasp_set.kind == kind)
    return sorted(numbers, key=lambda i: -graph.sets[i].margin)


def pictures() -> dict[str, plotting.Drawing]:
    """Return the pictures by the names of their files."""
    gusset = model("machine_parts", "gusset")
    graph = rl.build_switching_graph(gusset, MU, sets="chapter", switching="focus")
    star = rl.build_switching_graph(
        model("stars", "star_25"), MU, sets="chapter", switching="focus"
    )
    concurrent = widest(graph, "concurrent")[0]
    sets = graph.sets
    (leave,), (come,) = sets.on_edges((0, 2, 6)), sets.on_edges((0, 3))
    return {
        "focus_cell": plotting.plot_focus_cell(sets[concurrent]),
        "focus_switch": plotting.plot_focus_switch(graph, leave, come),
        "common_cone": plotting.plot_common_cone(sets[widest(graph, "parallel")[0]]),
        "candidates": plotting.plot_candidates(
            gusset, MU, "concurrent", sets[concurrent].edges[:2]
        ),
        "contact_space": plotting.plot_contact_space(sets[concurrent]),
        "graph": plotting.plot_graph(star),
    }


def main(folder: Path = REPOSITORY / "docs" / "images") -> None:
    """Write all pictures to a folder."""
    for name, picture in pictures().items():
        picture.figure.savefig(folder / f"{name}.png", dpi=110)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
