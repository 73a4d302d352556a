"""What the command `table` goes through: many files, their polygons, and the graph of each."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import nullcontext
from pathlib import Path
from typing import TypeVar

import regrasp_lp
from regrasp_lp import Polygon, SwitchingGraph
from regrasp_lp.cli.progress import ProgressBar
from regrasp_lp.errors import FileFormatError, RegraspError
from regrasp_lp.summary import Summary
from regrasp_lp.workers import WorkerProcesses

SWITCHING = {"chapter": "focus", "complete": "contact"}
"""The rule for switches that goes with each kind of sets, if none is asked for."""

_SUFFIXES = (".geojson", ".wkt")

Item = TypeVar("Item")
Result = TypeVar("Result")


def attempt(
    function: Callable[[Item], Result], items: Iterable[Item]
) -> tuple[list[Result], list[str]]:
    """Call a function with each of several items, and go on where it fails.

    Parameters
    ----------
    function : callable
    items : iterable

    Returns
    -------
    results : list
        Those of the items that did not fail.
    failures : list of str
        Messages of files that cannot be read; other errors are raised.
    """
    results, failures = [], []
    for item in items:
        try:
            results.append(function(item))
        except FileFormatError as error:
            failures.append(str(error))
    return results, failures


def polygon_files(path: str) -> list[Path]:
    """Return the polygon files of a folder by name, or else the one file.

    Raises
    ------
    FileFormatError
        If the folder cannot be read or holds none.
    """
    folder = Path(path)
    if not folder.is_dir():
        return [folder]
    try:
        files = sorted(file for file in folder.iterdir() if file.suffix.lower() in _SUFFIXES)
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read: {error.strerror or error}") from error
    if not files:
        raise FileFormatError(f"{path}: holds no file *.geojson or *.wkt")
    return files


def summaries_of(
    polygons: Sequence[Polygon], options: Namespace
) -> tuple[list[Summary], list[str]]:
    """Build the graph of each polygon; return their summaries, and why there are none of some.

    Both in the order of the polygons, however many are built at a time.
    """
    jobs = min(options.jobs, len(polygons))
    order = list(range(len(polygons)))
    if jobs > 1:  # the largest first, so that no process is left alone with it at the end
        order.sort(key=lambda place: -polygons[place].n_edges)
    with WorkerProcesses(jobs) if jobs > 1 else nullcontext() as workers, ProgressBar() as bar:
        outcomes = regrasp_lp.build_switching_graphs(
            [polygons[place] for place in order],
            options.friction,
            workers,
            sets=options.sets,
            switching=options.switching or SWITCHING[options.sets],
            apply=SwitchingGraph.summary,
            progress=bar,
        )
        # graphs stay where they are built: only their summaries come, and are all kept
        built = sorted(outcomes, key=lambda one: order[one.index])
    failures = [f"{one.name}: {_reason(one.error)}" for one in built if one.error is not None]
    return [one.value for one in built if one.error is None], failures


def _reason(error: Exception) -> str:
    if isinstance(error, MemoryError):
        return "not enough memory"
    if isinstance(error, (RegraspError, BrokenExecutor)):
        return str(error)
    return f"{type(error).__name__}: {error}"  # nobody has written it to be read alone
