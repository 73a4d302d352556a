"""Options for the object: its file, its name there, and how drawings are read."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from regrasp_lp.cli import values
from regrasp_lp.files import read_polygons
from regrasp_lp.polygon import Polygon


def add_object(parser: ArgumentParser, which: str) -> None:
    """Add the options to a parser; `which` says what happens without a name."""
    parser.add_argument("file", metavar="FILE", help="polygons, as GeoJSON, WKT, DXF or SVG")
    parser.add_argument("--name", help=f"the polygon to take; {which}")
    group = parser.add_argument_group("drawings (DXF and SVG)")
    for option, default, what in (
        ("--flattening", "thousandth", "largest distance between curves and the edges instead"),
        ("--joining", "millionth", "largest gap between ends that are joined"),
    ):
        group.add_argument(
            option,
            type=values.length,
            metavar="LENGTH",
            help=f"{what}, in the unit of the drawing (default: a {default} of its diagonal)",
        )
    group.add_argument(
        "--layer",
        action="append",
        metavar="NAME",
        help="a layer of DXF, or a group of SVG, to read; may be repeated (default: all shown)",
    )
    group.add_argument(
        "--ignore",
        action="append",
        default=[],
        metavar="KIND",
        help="a type of entities or elements to leave out, as TEXT; may be repeated",
    )


def polygons_of(options: Namespace) -> list[Polygon]:
    """Return the polygons of the file that is asked for.

    Raises
    ------
    FileFormatError, MissingExtraError, OptionError
        As `read_polygons` does.
    """
    return read_polygons(
        options.file,
        flattening=options.flattening,
        joining=options.joining,
        layers=options.layer,
        ignore=options.ignore,
    )
