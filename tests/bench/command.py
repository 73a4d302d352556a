"""The command: which parts to measure, how often, and where to write."""

from __future__ import annotations

import argparse
import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bench import (
    clocks,
    gcs,
    growth,
    imports,
    one_by_one,
    planning,
    queries,
    ratio,
    subjects,
    where,
)
from bench.growth import Growth
from bench.ratio import Meeting
from bench.report import Table, machine
from regrasp_lp.files import write_atomically

COMPLETE_GROWTH_UP_TO = 100
"""Edges of the largest complete graph that is grown without --all: larger ones take minutes."""

QUERIES = 100
"""Random pairs of grasps for each objective on a graph that is built."""

_INTRODUCTION = """\
# Benchmarks

Written by `python tests/bench --output docs`: what it measured, on the machine at the end, with
nothing else running. What is compared with what is told below each table, and in the modules of
`tests/bench`.
"""


@dataclass
class Results:
    """What has been measured so far, in the order of the parts."""

    tables: list[Table] = field(default_factory=list)
    meetings: list[Meeting] = field(default_factory=list)
    grown: dict[str, list[Growth]] = field(default_factory=dict)

    def add(self, table: Table) -> None:
        self.tables.append(table)
        print(table.text(), flush=True)


def run_ratio(options: argparse.Namespace, results: Results) -> None:
    for polygon in subjects.for_ratio(options.quick):
        results.meetings += ratio.meet(polygon, options.repeats)
    results.add(ratio.table(results.meetings))


def run_where(options: argparse.Namespace, results: Results) -> None:
    names = ["star_15"] if options.quick else ["star_40", "star_100"]
    polygons = [subjects.models()[name] for name in names]
    small = [polygon for polygon in polygons if polygon.n_edges <= ratio.COMPLETE_UP_TO]
    chapter, complete = where.measure(polygons), where.measure(small, ("complete",))
    results.add(
        Table(chapter.title, chapter.headings, [*chapter.rows, *complete.rows], chapter.notes)
    )


def run_growth(options: argparse.Namespace, results: Results) -> None:
    polygons = subjects.for_growth(options.quick)
    upper = polygons[0].n_edges if options.quick else growth.UPPER
    for sets in ("chapter", "complete"):
        few = polygons
        if sets == "complete" and not options.all:
            most = upper if options.quick else COMPLETE_GROWTH_UP_TO
            few = [polygon for polygon in polygons if polygon.n_edges <= most]
        results.grown[sets] = growth.measure(few, sets, min(options.repeats, 3))
        results.add(growth.table(results.grown[sets], upper))


def run_checks(options: argparse.Namespace, results: Results) -> None:
    names, count = (["star_15"], 20) if options.quick else (["star_40", "star_100"], 300)
    tables = [one_by_one.measure(subjects.models()[name], count, options.repeats) for name in names]
    for table in tables:
        results.add(table)


def run_imports(options: argparse.Namespace, results: Results) -> None:
    results.add(imports.measure(options.repeats))


def run_planning(options: argparse.Namespace, results: Results) -> None:
    pairs = 1 if options.quick else options.pairs
    large = planning.measure_large(subjects.large_outlines(options.quick), pairs)
    results.add(planning.large_table(large))
    small = subjects.small_objects(options.quick)
    results.add(planning.measure_small(small, pairs, min(options.repeats, 3)))


def run_queries(options: argparse.Namespace, results: Results) -> None:
    built, others = (3, 1) if options.quick else (QUERIES, options.pairs)
    results.add(queries.built_table(subjects.graphs_to_ask(options.quick), built))
    large = subjects.large_outlines(options.quick, least=230)
    results.add(queries.direct_table(large, others))
    small = subjects.small_outlines(options.quick)
    results.add(queries.corpus_table(small, min(others, 2)))


def run_gcs(options: argparse.Namespace, results: Results) -> None:
    if importlib.util.find_spec("gcsopt") is None:
        results.add(gcs.missing())
        return
    found = [gcs.compare(instance) for instance in gcs.instances(options.quick)]
    results.add(gcs.table([one for one in found if one is not None]))


PARTS: dict[str, Callable[[argparse.Namespace, Results], None]] = {
    "ratio": run_ratio,
    "where": run_where,
    "growth": run_growth,
    "checks": run_checks,
    "imports": run_imports,
    "planning": run_planning,
    "queries": run_queries,
    "gcs": run_gcs,
}


def parser() -> argparse.ArgumentParser:
    result = argparse.ArgumentParser(
        prog="python tests/bench",
        description="Measure the package: against the chapter's method on GEOS, where its time "
        "goes, growth, one LP at a time, importing, planning without the graph, queries, gcsopt.",
        epilog="Needs the extras of the tests (pip install -e '.[test]'). Takes about a quarter "
        "of an hour; leave the machine alone meanwhile. Outlines of a corpus are planned on if "
        "REGRASP_LP_CORPUS names its folder.",
    )
    result.add_argument(
        "parts", nargs="*", metavar="PART", help=f"any of {', '.join(PARTS)}; all by default"
    )
    result.add_argument("--repeats", type=_count, default=7, help="rounds of each pair (7)")
    result.add_argument("--pairs", type=_count, default=5, help="plans on each object (5)")
    result.add_argument("--quick", action="store_true", help="tiny polygons, to try the command")
    result.add_argument(
        "--cpu", action="store_true", help="processor time, for a machine that is in use"
    )
    result.add_argument("--all", action="store_true", help="complete graphs up to 200 edges too")
    result.add_argument(
        "--output", type=Path, metavar="DIR", help="write benchmarks.md and images/*.png there"
    )
    return result


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of 1 or more")
    return int(text)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""
    command = parser()
    options = command.parse_args(arguments)
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown:
        command.error(f"there is no part {unknown[0]!r}: choose from {', '.join(PARTS)}")
    results = Results()
    with clocks.by("cpu" if options.cpu else "wall"):
        for part in dict.fromkeys(options.parts or PARTS):
            PARTS[part](options, results)
    results.add(_machine_table(options.cpu))
    if options.output is not None:
        write(results, options.output)
    return 0


def _machine_table(cpu: bool) -> Table:
    clock = "processor time of the process" if cpu else "wall"
    rows = [[name, value] for name, value in {**machine(), "clock": clock}.items()]
    return Table("The machine", ["what", "version"], rows)


def write(results: Results, folder: Path) -> None:
    """Write the tables as Markdown, and the pictures of what was measured."""
    from bench.plots import draw_growth, draw_ratio

    images = folder / "images"
    images.mkdir(parents=True, exist_ok=True)
    pictures = []
    if results.meetings:
        draw_ratio(results.meetings, images / "benchmark_ratio.png")
        pictures.append("![Our time by the peer's](images/benchmark_ratio.png)")
    if results.grown:
        draw_growth(results.grown, images / "benchmark_growth.png")
        pictures.append("![Growth](images/benchmark_growth.png)")
    parts = [_INTRODUCTION, *pictures, *(table.markdown() for table in results.tables)]
    text = "\n\n".join(part.strip() for part in parts) + "\n"
    write_atomically(folder / "benchmarks.md", text)
