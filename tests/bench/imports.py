"""How long importing the package takes, beyond numpy, and what its first answers add to that."""

from __future__ import annotations

from bench import clocks
from bench.report import Table

_BLOCK = "rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])"
_USES = {
    "import regrasp_lp": "import regrasp_lp as rl",
    "and make a polygon": f"import regrasp_lp as rl; {_BLOCK}",
    "and build its graph": f"import regrasp_lp as rl; rl.build_switching_graph({_BLOCK}, 0.4)",
}


def measure(repeats: int) -> Table:
    """Least time of fresh processes."""
    numpy = min(clocks.seconds_anew("import numpy") for _ in range(repeats))
    rows = [["import numpy", f"{1000 * numpy:.0f}", ""]]
    for what, code in _USES.items():
        seconds = min(clocks.seconds_anew(f"import numpy\n{code}") for _ in range(repeats))
        rows.append([what, f"{1000 * seconds:.0f}", f"{1000 * (seconds - numpy):.0f}"])
    note = (
        "In a new process each, after numpy, the least of several. Modules are loaded when "
        "something of them is first used."
    )
    return Table("Importing", ["what", "ms", "beyond numpy, ms"], rows, [note])
