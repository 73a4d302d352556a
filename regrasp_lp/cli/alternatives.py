"""Other plans beside the best one, as a table."""

from __future__ import annotations

from collections.abc import Sequence

from regrasp_lp.planning.plan import Plan

_HEAD = ("plan", "placements", "margin", "tolerance", "travel", "steps")


def alternatives_text(plans: Sequence[Plan], asked: int) -> str:
    """Return the plans as a table, a line for each, and under it the edges it goes over.

    Parameters
    ----------
    plans : sequence of Plan
        The best one first.
    asked : int
        How many were asked for.

    Returns
    -------
    str
    """
    rows: list[tuple[str, ...]] = [_HEAD]
    for number, plan in enumerate(plans, 1):
        sizes = (f"{value:.4g}" for value in (plan.margin, plan.tolerance, plan.travel))
        rows.append((str(number), str(plan.placements), *sizes, str(len(plan.steps))))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    table = [
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        for row in rows
    ]
    ways = [" > ".join(",".join(map(str, edges)) for _, edges in plan.path) for plan in plans]
    width = max(map(len, table))
    lines = [
        table[0] + "  on edges",
        *(f"{r:<{width}}  {w}" for r, w in zip(table[1:], ways, strict=True)),
    ]
    if len(plans) == 1 < asked:
        return "There is no other plan."
    count = "all there are" if len(plans) < asked else "the best"
    return "\n".join([f"{len(plans)} plans, {count}:", *lines])
