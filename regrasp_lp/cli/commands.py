"""The commands: each takes the options read from the command line and returns an exit code."""

from __future__ import annotations

import contextlib
import difflib
import io
import re
from argparse import Namespace
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import regrasp_lp
from regrasp_lp import Grasp, Hand, Plan, Polygon, SwitchingGraph
from regrasp_lp.certification import check_provable
from regrasp_lp.check_certificates import is_certificates
from regrasp_lp.check_certificates import main as check_certificates
from regrasp_lp.cli.alternatives import alternatives_text
from regrasp_lp.cli.arguments import PROGRAM
from regrasp_lp.cli.far_apart import far_apart
from regrasp_lp.cli.hand_options import hand_of
from regrasp_lp.cli.object_options import polygons_of
from regrasp_lp.cli.progress import ProgressBar, complain
from regrasp_lp.cli.tables import attempt, polygon_files, summaries_of
from regrasp_lp.cli.values import ANIMATION, PICTURES, grasp_text
from regrasp_lp.cli.wording import in_options
from regrasp_lp.errors import (
    ContactError,
    FileFormatError,
    FrictionError,
    NoPlanFound,
    OptionError,
    RegraspError,
)
from regrasp_lp.files import write_atomically
from regrasp_lp.friction import FloatArray, per_edge_friction
from regrasp_lp.planning.requests import checked_grasp
from regrasp_lp.refusals import in_no_set
from regrasp_lp.switches import SwitchesOnDemand
from regrasp_lp.tables import csv_table, markdown_table, text_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_NAMES = 12  # listed in a message
_SNAP = 1e-3  # of the diagonal of the object's bounding box: what a reader of a drawing can do
_ROLES = ("start", "goal")
_TABLES = {"text": text_table, "csv": csv_table, "markdown": markdown_table}


def plan(options: Namespace) -> int:
    """Plan from one grasp to another."""
    _check_outputs(options.file, options.json, options.plot, options.gif, options.html)
    polygon = _one_polygon(options)
    friction = _friction(polygon, options.friction)
    hand = hand_of(options)
    given: dict[str, Grasp | None] = {}
    for role in _ROLES:
        asked = _asked_grasp(polygon, role, options)
        if asked is not None:
            asked = checked_grasp(polygon, asked, friction, hand, role)
        given[role] = asked
    found, *others = _found_plans(polygon, friction, hand, given, options)
    print(found)
    print("It has passed an exact check.", flush=True)
    if options.alternatives > 1:
        print(f"\n{alternatives_text([found, *others], options.alternatives)}", flush=True)
    if options.sensitivity:
        print(f"\n{found.sensitivity()}", flush=True)
    if options.json:
        for number, one in enumerate([found, *others], 1):
            stem = options.json.stem if number == 1 else f"{options.json.stem}-{number}"
            with _writing(options.json.with_stem(stem)) as path:
                one.to_json(path)
    if options.plot:
        _save_picture(found.plot, options.plot)
    if options.gif:
        with _writing(options.gif):
            found.to_gif(options.gif)
    if options.html:
        with _writing(options.html):
            found.to_html(options.html)
    return 0


def _found_plans(
    polygon: Polygon,
    friction: FloatArray,
    hand: Hand,
    given: dict[str, Grasp | None],
    options: Namespace,
) -> list[Plan]:
    start, goal = given["start"], given["goal"]
    how = options.aligning, options.objective
    built = None
    several = options.alternatives > 1
    if start is None or goal is None or options.solver != "clarabel" or several:
        with ProgressBar() as bar:
            built = _built(polygon, friction, hand, options, bar)
            bar("choosing grasps", 0, 0)
            start, goal = _complete(built, given, bar)
        if None in given.values():
            print(_choice_text(given, {"start": start, "goal": goal}), end="\n\n", flush=True)
        on_demand = isinstance(built.switches, SwitchesOnDemand)
        if options.solver == "clarabel" and on_demand and not several:
            built = None  # faster without it
    with ProgressBar() as bar:
        bar("planning", 0, 0)
        if built is not None:
            return built.plans(start, goal, options.alternatives, *how)
        plan = regrasp_lp.plan_regrasp(polygon, start, goal, friction, hand, options.sets, *how)
        return [plan]


def _built(
    polygon: Polygon, friction: FloatArray, hand: Hand, options: Namespace, bar: ProgressBar
) -> SwitchingGraph:
    return regrasp_lp.build_switching_graph(
        polygon,
        friction,
        hand,
        sets=options.sets,
        switching=getattr(options, "switching", "contact"),
        min_margin=getattr(options, "min_margin", 0.0),
        solver=options.solver,
        progress=bar,
    )


def graph(options: Namespace) -> int:
    """Print the summary of one or several graphs."""
    _check_outputs(options.file, options.save, options.certificates, options.html)
    polygons = _polygons(options)
    if options.certificates:
        check_provable(options.switching, options.min_margin, hand_of(options))
    for option in ("save", "certificates", "html"):
        if getattr(options, option) and len(polygons) > 1:
            several = _several(options.file, polygons)
            raise OptionError(f"--{option} takes one graph, but {several}")
    for number, polygon in enumerate(polygons):
        friction = _friction(polygon, options.friction)
        with ProgressBar() as bar:
            built = _built(polygon, friction, hand_of(options), options, bar)
            bar("counting", 0, 0)
            summary = built.summary()
        if number:
            print()
        print(summary, flush=True)
        if options.save:
            with _writing(options.save):
                built.save(options.save)
        if options.certificates:
            with _writing(options.certificates):
                built.save_certificates(options.certificates)
        if options.html:
            with _writing(options.html):
                built.to_html(options.html)
    return 0


def table(options: Namespace) -> int:
    """Print one table of the graphs of many polygons."""
    folders, missing = attempt(polygon_files, options.paths)
    files = list(chain.from_iterable(folders))
    for file in files:
        _check_outputs(file, options.output)
    contents, damaged = attempt(regrasp_lp.read_polygons, files)
    _complain(options, missing + damaged)
    polygons = _small_ones(list(chain.from_iterable(contents)), options)
    summaries, failed = summaries_of(polygons, options)
    _complain(options, failed)
    if summaries:
        text = _TABLES[_table_format(options)](summaries)
        if options.output is None:
            print(text, end="", flush=True)
        else:
            with _writing(options.output):
                write_atomically(options.output, text)
    return 2 if missing or damaged or failed else 0


def _small_ones(polygons: list[Polygon], options: Namespace) -> list[Polygon]:
    small = [polygon for polygon in polygons if polygon.n_edges <= options.max_edges]
    larger = len(polygons) - len(small)
    if larger and not small:
        raise OptionError(f"no polygon has {options.max_edges} edges or fewer: raise --max-edges")
    if larger:
        what = f"{_count(larger, 'polygon')} with more than {options.max_edges} edges"
        complain(f"{PROGRAM} {options.command}", f"{what} left out")
    return small


def _complain(options: Namespace, failures: list[str]) -> None:
    for failure in failures:
        complain(f"{PROGRAM} {options.command}", f"error: {in_options(failure)}")


def _table_format(options: Namespace) -> str:
    by_suffix = {".csv": "csv", ".md": "markdown"}
    suffix = "" if options.output is None else options.output.suffix.lower()
    return options.format or by_suffix.get(suffix, "text")


def show(options: Namespace) -> int:
    """Draw an object with its edge numbers, or list them."""
    _check_outputs(options.file, options.plot)
    polygon = _one_polygon(options)
    print(_description(polygon))
    if options.list:
        print()
        print(_edge_table(polygon), flush=True)
        if not options.plot:
            return 0
    path = options.plot or Path(_file_stem(polygon.name) + ".png")
    _save_picture(lambda: polygon.plot().figure, path)
    return 0


def check(options: Namespace) -> int:
    """Verify a plan file, or a file of certificates."""
    try:
        if is_certificates(options.file):
            return check_certificates([options.file])
        report = regrasp_lp.check_plan(options.file)
    except RegraspError as error:
        text = str(error)
        where = "" if text.startswith(options.file) else f"{options.file}: "
        raise FileFormatError(where + text) from error
    except OSError as error:
        reason = error.strerror or error
        raise FileFormatError(f"{options.file}: cannot be read: {reason}") from error
    counts = (
        f"{_count(report.grasps_checked, 'grasp')} and {_count(report.slides_checked, 'slide')}"
    )
    if report.ok:
        print(f"{options.file}: ok, {counts} checked exactly")
        return 0
    print(f"{options.file}: faulty, {report.fault} ({counts} before that passed)")
    return 1


# --- objects ------------------------------------------------------------------------------------


def _polygons(options: Namespace) -> list[Polygon]:
    polygons, name = polygons_of(options), options.name
    if name is None:
        return polygons
    chosen = [polygon for polygon in polygons if polygon.name == name]
    if chosen:
        return chosen
    names = [polygon.name for polygon in polygons]
    folded = {one.casefold(): one for one in reversed(names)}
    near = difflib.get_close_matches(name.casefold(), folded, n=5, cutoff=0.5)
    close = [folded[one] for one in near]
    listed = _listed([*close, *(one for one in names if one not in close)])
    raise OptionError(f"{options.file} has no polygon named {name!r}; it has {listed}")


def _one_polygon(options: Namespace) -> Polygon:
    polygons = _polygons(options)
    if len(polygons) > 1:
        raise OptionError(_several(options.file, polygons))
    return polygons[0]


def _several(file: str, polygons: list[Polygon]) -> str:
    listed = _listed([polygon.name for polygon in polygons])
    return f"{file} holds {len(polygons)} polygons: choose one with --name, of {listed}"


def _listed(names: list[str]) -> str:
    more = len(names) - _MOST_NAMES
    return ", ".join(names[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def _friction(polygon: Polygon, asked: float | list[float]) -> FloatArray:
    if isinstance(asked, list) and len(asked) != polygon.n_edges:
        raise FrictionError(
            f"--friction has {len(asked)} values, but {polygon.name!r} has {polygon.n_edges} "
            "edges: give one value, or one for each edge"
        )
    return per_edge_friction(asked, polygon.n_edges)


def _description(polygon: Polygon) -> str:
    width, height = polygon.bounds[2:] - polygon.bounds[:2]
    holes = f", {_count(len(polygon.holes), 'hole')}" if polygon.holes else ""
    return (
        f"{polygon.name}: {polygon.n_edges} edges{holes}, {width:.4g} wide, {height:.4g} high, "
        f"area {polygon.area:.4g}"
    )


def _edge_table(polygon: Polygon) -> str:
    rows = [("edge", "from", "to", "length", "")]
    for edge in range(polygon.n_edges):
        start, end = (
            f"({x:.6g}, {y:.6g})" for x, y in (polygon.edge_starts[edge], polygon.edge_ends[edge])
        )
        ring = int(polygon.ring_of_edge[edge])
        where = f"hole {ring}" if ring else ""
        rows.append((str(edge), start, end, f"{polygon.edge_lengths[edge]:.6g}", where))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    # the last column, with nothing to its right, is aligned to the left
    return "\n".join(
        "  ".join(
            [*(cell.rjust(width) for cell, width in zip(row[:-1], widths, strict=False)), row[-1]]
        ).rstrip()
        for row in rows
    )


# --- grasps -------------------------------------------------------------------------------------


def _asked_grasp(polygon: Polygon, role: str, options: Namespace) -> Grasp | None:
    contacts: Grasp | None = getattr(options, role)
    points = getattr(options, f"{role}_xy")
    if points is None:
        return contacts
    tolerance = _SNAP * polygon.diameter if options.tolerance is None else options.tolerance
    try:
        return polygon.snap(points, tolerance)
    except ContactError as error:
        raise ContactError(f"--{role}-xy: {error}") from error


def _complete(
    graph: SwitchingGraph, given: dict[str, Grasp | None], bar: ProgressBar
) -> tuple[Grasp, Grasp]:
    """Return start and goal; what is not given is chosen far from the other."""
    for role in _ROLES:
        one = given[role]
        if one is not None and None in given.values() and not graph.locate(one):
            raise NoPlanFound(in_no_set(graph, role))
    return far_apart(graph, given["start"], given["goal"], bar)


def _choice_text(given: dict[str, Grasp | None], chosen: dict[str, Grasp]) -> str:
    missing = [role for role in _ROLES if given[role] is None]
    if len(missing) == 2:
        head = "No start and no goal given; these two grasps are far apart in the graph:"
    else:
        other = "goal" if missing == ["start"] else "start"
        head = f"No {missing[0]} given; this one is far from the {other} in the graph:"
    width = max(len(role) for role in missing)
    return "\n".join([head, *(f"  --{r:<{width}} {grasp_text(chosen[r])}" for r in missing)])


# --- files --------------------------------------------------------------------------------------


def _check_outputs(source: str | Path, *outputs: Path | None) -> None:
    """Find out before any work whether the files can be written."""
    paths = [path for path in outputs if path is not None]
    for number, path in enumerate(paths):
        if path.exists() and Path(source).exists() and path.samefile(source):
            raise OptionError(f"{path} is the file that is read; write to another one")
        if path.resolve() in [other.resolve() for other in paths[:number]]:
            raise OptionError(f"{path} cannot be written twice")
        if path.suffix.lower() in (*PICTURES, ANIMATION):
            import regrasp_lp.plotting  # noqa: F401  (says what to install if it cannot draw)


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[Path]:
    """Say which file could not be written, or that it was."""
    try:
        yield path
    except OSError as error:
        raise OptionError(f"{path}: cannot be written: {error.strerror or error}") from error
    print(f"wrote {path}", flush=True)


def _save_picture(draw: Callable[[], Figure], path: Path) -> None:
    """Draw a picture and write it in one step; the same picture gives the same bytes."""
    kind = path.suffix.lower().lstrip(".")
    dates: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    data = io.BytesIO()
    with ProgressBar() as bar:
        bar("drawing", 0, 0)
        figure = draw()
        import matplotlib

        with matplotlib.rc_context({"svg.hashsalt": "regrasp_lp"}):
            figure.savefig(data, format=kind, dpi=150, metadata=dates.get(kind))
    with _writing(path):
        write_atomically(path, data.getvalue())


def _file_stem(name: str) -> str:
    """Return a name of a file for an object, whatever the object is called."""
    return re.sub(r"[^\w.-]+", "_", name).strip("._") or "polygon"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"
