"""What the command `table` goes through: many files, their polygons, and the graph of each."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

import regrasp_lp
from regrasp_lp import Polygon
from regrasp_lp.cli.progress import ProgressBar
from regrasp_lp.errors import FileFormatError, PolygonError, SolverError
from regrasp_lp.summary import Summary

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
        Messages of errors that concern one item only; others are raised.
    """
    results, failures = [], []
    for item in items:
        try:
            results.append(function(item))
        except (FileFormatError, PolygonError, SolverError) as error:
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
    """Build the graph of each polygon; return their summaries, and why there are none of some."""
    with ProgressBar() as bar:

        def summary(number: int) -> Summary:
            polygon = polygons[number]
            bar.subject = f"{polygon.name} ({number + 1} of {len(polygons)})"
            try:
                graph = regrasp_lp.build_switching_graph(
                    polygon,
                    options.friction,
                    sets=options.sets,
                    switching=options.switching or SWITCHING[options.sets],
                    progress=bar,
                )
                bar("counting", 0, 0)
                return graph.summary()
            except MemoryError as error:
                raise SolverError(f"{polygon.name}: not enough memory") from error
            except (PolygonError, SolverError) as error:
                raise type(error)(f"{polygon.name}: {error}") from error

        return attempt(summary, range(len(polygons)))
