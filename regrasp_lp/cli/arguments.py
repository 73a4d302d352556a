"""What the command line takes, and its help texts."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import regrasp_lp
from regrasp_lp.cli import values
from regrasp_lp.cli.hand_options import add_hand
from regrasp_lp.cli.object_options import add_object
from regrasp_lp.errors import OptionError

PROGRAM = "regrasp-lp"

_POINT_OPTIONS = ("--start-xy", "--goal-xy")

_OVERVIEW = """\
Plan how a hand of free-flying fingers regrasps a planar polygonal object, with
the object in force closure at every instant.

A contact is written edge:position: the number of an edge, and the distance
from where that edge starts, in the object's unit. `show` draws the numbers."""

_OVERVIEW_EXAMPLES = """\
examples:
  regrasp-lp show parts.geojson --name l_bracket
  regrasp-lp plan parts.geojson --name l_bracket --friction 0.3
  regrasp-lp graph parts.geojson --friction 0.2
  regrasp-lp table parts.geojson

exit codes:
  0  done
  1  there is no plan, or the plan that was checked is faulty
  2  an error: one line on standard error says what is wrong"""

_PLAN = """\
Find a plan that leads from one grasp to another without ever letting go of the
object, with the fewest placements of fingers or the best in what --objective
asks for, and print an account of it: how good it is, and whether any plan can
be better.

Give start and goal as contacts (--start 4:0.3,0:1.2) or as points on the
boundary (--start-xy "0.5,0 2,1.5"). What is not given is chosen far from the
other in the switching graph, and printed in the form that the options take."""

_PLAN_EXAMPLES = """\
examples:
  regrasp-lp plan parts.geojson --name hex_nut --friction 0.3
  regrasp-lp plan parts.geojson --name rectangle --friction 0.4 \\
      --start 0:30,2:30 --goal-xy "60,10 0,10" --json plan.json --plot plan.pdf
  regrasp-lp plan parts.geojson --name wedge --friction 0.5,0.5,0.7 \\
      --start 0:10,1:15,2:30 --goal 0:20,1:10,2:25 --objective margin

exit codes:
  0  a plan was found; it has passed an exact check
  1  there is no plan: standard error says why, and what would help
  2  an error: one line on standard error says what is wrong"""

_GRAPH = """\
Compute all grasp sets of an object and the switches between them, and print
how many there are of each kind, how they hang together, and how long it took.
Without --name all polygons of the file are taken, one after the other."""

_GRAPH_EXAMPLES = """\
examples:
  regrasp-lp graph parts.geojson --friction 0.2
  regrasp-lp graph parts.geojson --name hex_nut --friction 0.2 --sets chapter
  regrasp-lp graph parts.geojson --name hex_nut --friction 0.2 --save nut.npz
  regrasp-lp graph parts.geojson --name hex_nut --friction 0.2 \\
    --certificates nut.proof"""

_TABLE = """\
Compute the graphs of many polygons and put their numbers into one table: for
each kind of grasp sets how many there are, of how many candidates (cand.), and
in how many connected components (comp.) by themselves; then of all combined
the sets, their components and the switches; and how long it took. The columns
are those of the chapter's tables 3.1 and 3.2, and so are, by default, the sets
and the rule for switches. The hand has four fingers."""

_TABLE_EXAMPLES = """\
examples:
  regrasp-lp table parts.geojson
  regrasp-lp table . --max-edges 40 --jobs 2 -o table.csv
  regrasp-lp table parts.geojson --sets complete --friction 0.2 -o table.md

exit codes:
  0  the table is complete
  2  an error: standard error names each file that could not be read and each
     polygon that could not be computed; the table is without them"""

_SHOW = """\
Draw an object with the numbers of its edges, or list them. Edges are numbered
counter-clockwise along the outline, from the first vertex (marked by a small
circle), then clockwise along the holes. Only drawing needs matplotlib."""

_SHOW_EXAMPLES = """\
examples:
  regrasp-lp show parts.geojson --name hex_nut
  regrasp-lp show parts.geojson --name hex_nut --plot hex_nut.svg
  regrasp-lp show parts.geojson --name hex_nut --list"""

_CHECK = """\
Verify a plan file, written by `plan --json` or by any other program. In exact
rational arithmetic, and with no code of the planner, its steps are carried out
one by one: the fingers that touch have to hold the object in force closure
before and after each step and at every instant of a slide, no two fingers may
meet, and the goal has to be reached.

Or verify the certificates that `graph --certificates` wrote: every candidate
and every pair of grasp sets is found anew, and its proof looked at."""

_CHECK_EXAMPLES = """\
examples:
  regrasp-lp check plan.json
  regrasp-lp check nut.proof

exit codes:
  0  the plan is good, the certificates are accepted
  1  the plan is faulty, the certificates are rejected: the fault is printed
  2  an error: the file cannot be read, or is neither"""


class UsageError(OptionError):
    """A command line that cannot be understood.

    Attributes
    ----------
    program : str
        Program and command whose help text would help.
    """

    def __init__(self, program: str, message: str) -> None:
        super().__init__(message)
        self.program = program

    def __reduce__(self) -> tuple[type[UsageError], tuple[str, str]]:
        return UsageError, (self.program, str(self))


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Texts as written, and room for long options beside their explanations."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=26)


class _Parser(argparse.ArgumentParser):
    """Says what is wrong by an exception instead of printing its whole usage."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(formatter_class=_Formatter, allow_abbrev=False, **kwargs)

    def error(self, message: str) -> NoReturn:
        raise UsageError(self.prog, message)


def read_command_line(parser: argparse.ArgumentParser, arguments: Sequence[str]) -> Any:
    """Return the options of a command line, as a namespace.

    Raises
    ------
    UsageError
        If it cannot be understood.
    """
    joined: list[str] = []
    for argument in arguments:
        # argparse would take a negative coordinate for another option
        if joined and joined[-1] in _POINT_OPTIONS and re.match(r"-[\d.]", argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return parser.parse_args(joined)


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    parser = _Parser(prog=PROGRAM, description=_OVERVIEW, epilog=_OVERVIEW_EXAMPLES)
    version = f"{PROGRAM} {regrasp_lp.__version__}"
    parser.add_argument("--version", action="version", version=version)
    commands = parser.add_subparsers(
        title="commands", dest="command", metavar="COMMAND", required=True
    )

    def command(name: str, brief: str, description: str, epilog: str) -> argparse.ArgumentParser:
        added = commands.add_parser(name, help=brief, description=description, epilog=epilog)
        added.set_defaults(run=_late(name))
        return added

    _add_plan(command("plan", "plan from one grasp to another", _PLAN, _PLAN_EXAMPLES))
    _add_graph(command("graph", "summarise all grasps and switches", _GRAPH, _GRAPH_EXAMPLES))
    _add_table(command("table", "tabulate the graphs of many polygons", _TABLE, _TABLE_EXAMPLES))
    _add_show(command("show", "draw an object with its edge numbers", _SHOW, _SHOW_EXAMPLES))
    check = command("check", "verify a plan or a proof exactly", _CHECK, _CHECK_EXAMPLES)
    check.add_argument("file", metavar="FILE", help="the plan file, or the certificates")
    return parser


def _late(name: str) -> Callable[[argparse.Namespace], int]:
    def run(options: argparse.Namespace) -> int:
        # so late that a help text does not wait for what only the commands need
        from regrasp_lp.cli import commands

        code: int = getattr(commands, name)(options)
        return code

    return run


def _add_plan(parser: argparse.ArgumentParser) -> None:
    add_object(parser, "needed if the file holds several")
    _add_grasps(parser)
    _add_model(parser)
    parser.add_argument(
        "--objective",
        type=values.objective,
        default="placements",
        metavar="WHAT",
        help="what the plan is best in: placements (default), margin, tolerance or travel; or "
        "weights of these, as in placements=1,travel=0.2",
    )
    parser.add_argument(
        "--aligning",
        choices=("slide", "regrip"),
        default="slide",
        help="how fingers move inside a grasp set: sliding along the edges (default), or by free "
        "fingers taking over",
    )
    parser.add_argument(
        "--alternatives",
        type=values.plans,
        default=1,
        metavar="K",
        help="up to K different plans: the best one in full, then a table of all (default: 1)",
    )
    parser.add_argument(
        "--sensitivity",
        action="store_true",
        help="also print what limits the plan and at which price, what friction does to it, and "
        "how far each finger may be off at each step",
    )
    files = parser.add_argument_group("files to write")
    _add_output(files, "--json", values.output_file, "the plan, for `check`; others as OUT-2, ...")
    _add_output(files, "--plot", values.picture_file, "a filmstrip of it: .png, .svg or .pdf")
    _add_output(files, "--gif", values.animation_file, "an animation of it")
    _add_output(files, "--html", values.output_file, "a page to step through it in a browser")


def _add_graph(parser: argparse.ArgumentParser) -> None:
    add_object(parser, "all of them by default")
    _add_switching(_add_model(parser), "contact")
    parser.add_argument(
        "--min-margin",
        type=values.length,
        default=0.0,
        metavar="LENGTH",
        help="drop grasp sets and switches whose best margin is not larger, in the object's unit "
        "(default: 0)",
    )
    files = parser.add_argument_group("files to write")
    _add_output(files, "--save", values.output_file, "the graph, for regrasp_lp.load_graph")
    _add_output(files, "--certificates", values.output_file, "a proof of it, for `check`")
    _add_output(files, "--html", values.output_file, "a page to click in, for a browser")


def _add_table(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "paths",
        nargs="+",
        metavar="PATH",
        help="polygons, as GeoJSON or as WKT, or a folder: all its files *.geojson and *.wkt, by "
        "name",
    )
    _add_sets(parser, "chapter")
    _add_switching(parser, None)
    parser.add_argument(
        "--friction",
        type=values.one_friction,
        default=math.tan(math.radians(10)),
        metavar="MU",
        help="coefficient of friction of all edges (default: the tangent of 10°, about "
        "0.1763; the chapter gives no angle for its tables, but their numbers fit about this one)",
    )
    parser.add_argument(
        "--max-edges",
        type=values.edges,
        default=math.inf,
        metavar="N",
        help="leave out polygons of more edges",
    )
    parser.add_argument(
        "--jobs",
        type=values.jobs,
        default=1,
        metavar="N",
        help="compute N polygons at a time, in as many processes; the table is the same "
        "(default: 1)",
    )
    parser.add_argument(
        "--format",
        choices=("text", "csv", "markdown"),
        help="how the table is written (default: by the suffix of OUT, .csv or .md, else text)",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=values.output_file,
        metavar="OUT",
        help="where to write the table (default: standard output)",
    )


def _add_show(parser: argparse.ArgumentParser) -> None:
    add_object(parser, "needed if the file holds several")
    parser.add_argument(
        "-o",
        "--plot",
        type=values.picture_file,
        metavar="OUT",
        help="the picture to write: .png, .svg or .pdf (default: NAME.png in the current folder)",
    )
    parser.add_argument(
        "--list",
        action="store_true",
        help="print where each edge starts and ends, and its length; draw only with --plot",
    )


def _add_grasps(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("start and goal (2 or 3 contacts each)")
    whose_of = {"start": "of fingers 1, 2, ... or as in 3@4:0.3,1@0:1.2", "goal": "of any fingers"}
    for role, whose in whose_of.items():
        either = group.add_mutually_exclusive_group()
        either.add_argument(
            f"--{role}",
            type=values.grasp,
            metavar="CONTACTS",
            help=f"edge:position pairs separated by commas, {whose}",
        )
        either.add_argument(
            f"--{role}-xy",
            type=values.points,
            metavar="POINTS",
            help="x,y pairs separated by spaces or semicolons, near the boundary (--tolerance)",
        )
    group.add_argument(
        "--tolerance",
        type=values.length,
        metavar="LENGTH",
        help="how far points may be from the boundary, in the object's unit; they are moved to "
        "its nearest place (default: a thousandth of the diagonal of the object's bounding box; "
        "Polygon.snap in Python takes 1e-6 only)",
    )


def _add_model(parser: argparse.ArgumentParser) -> Any:
    group = parser.add_argument_group("friction, hand and grasps")
    group.add_argument(
        "--friction",
        type=values.friction,
        required=True,
        metavar="MU",
        help="coefficient of friction: one value, or one for each edge separated by commas",
    )
    add_hand(group)
    _add_sets(group, "complete")
    group.add_argument(
        "--solver",
        choices=("clarabel", "highs"),
        default="clarabel",
        help="solver of the linear programs (default: clarabel)",
    )
    return group


def _add_output(group: Any, option: str, reader: Callable[[str], Any], what: str) -> None:
    group.add_argument(option, type=reader, metavar="OUT", help=what)


def _add_sets(group: Any, default: str) -> None:
    group.add_argument(
        "--sets",
        choices=("complete", "chapter"),
        default=default,
        help="complete: all force-closure grasps of 2 and 3 fingers; chapter: the two-finger, "
        f"concurrent and parallel grasps only (default: {default})",
    )


def _add_switching(group: Any, default: str | None) -> None:
    described = default or "focus for chapter, contact for complete sets"
    group.add_argument(
        "--switching",
        choices=("contact", "focus"),
        default=default,
        help="which sets are adjacent. contact: those whose grasps can hold enough contacts in "
        "common; focus: those whose focus cells meet, the chapter's rule for chapter sets and "
        f"four fingers (default: {described})",
    )
