"""A switching graph in one file.

A ``.npz`` archive of numpy arrays (no pickle) with a JSON header: format "regrasp-graph",
version 2, or 3 of a hand with limits. Torque functions are not stored but computed again from the
edges of the sets.
"""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from regrasp_lp.build import check_switching, switch_rule
from regrasp_lp.errors import FileFormatError, RegraspError
from regrasp_lp.files import write_atomically
from regrasp_lp.friction import Cones
from regrasp_lp.graph_options import GraphOptions
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.grasp_sets.families import parallel_functions
from regrasp_lp.grasp_sets.set_pieces import SetPieces
from regrasp_lp.grasp_sets.vertices import Family, kinds_of
from regrasp_lp.lp import get_solver
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.reach import hand_cones, spacing_of
from regrasp_lp.polygon import Polygon
from regrasp_lp.switches import SWITCH_ARRAYS, StoredSwitches, Switches, SwitchesOnDemand
from regrasp_lp.switching_graph import SwitchingGraph
from regrasp_lp.torque import TorqueFunctions, torque_functions

FORMAT, VERSION = "regrasp-graph", 2
LIMITED_VERSION = 3
"""Of graphs of a hand with limits: sets are over segments of edges, which follow from the hand."""

PIECE_ARRAYS = ("piece_pieces", "piece_rows", "piece_bounds", "piece_margins")
"""Of each kind of sets, if the hand limits the distance between fingers: see `SetPieces`."""

# What numpy, zipfile, zlib and json raise on a file that is none, or not whole.
_DAMAGED = (
    ValueError,
    KeyError,
    EOFError,
    OSError,
    RuntimeError,  # a method of compression or encryption that does not exist
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)


def save_graph(graph: SwitchingGraph, path: str | Path) -> None:
    """Write a graph to one file, whole or not at all.

    Parameters
    ----------
    graph : SwitchingGraph
    path : path-like
    """
    write_atomically(path, graph_to_bytes(graph))


def graph_to_bytes(graph: SwitchingGraph) -> bytes:
    """Return the content of a graph file."""
    polygon = graph.polygon
    header = {
        "format": FORMAT,
        "version": LIMITED_VERSION if graph.hand.limited else VERSION,
        "name": polygon.name,
        "hand": graph.hand.to_document(),
        "options": asdict(graph.options),
        "seconds": graph.seconds,
        "stored": isinstance(graph.switches, StoredSwitches),
        "candidates": [family.n_candidates for family in graph.sets.families],
    }
    arrays: dict[str, np.ndarray] = {
        "header": np.frombuffer(json.dumps(header).encode(), dtype=np.uint8),
        "ring_sizes": np.array([len(ring) for ring in polygon.rings]),
        "vertices": polygon.vertices,
        "friction": graph.friction,
    }
    for family in graph.sets.families:
        arrays[f"{family.kind}.edges"] = family.functions.edges
        arrays[f"{family.kind}.centers"] = family.centers
        arrays[f"{family.kind}.margins"] = family.margins
        arrays[f"{family.kind}.witnesses"] = family.witnesses
        if family.pieces is not None:
            for name in PIECE_ARRAYS:
                arrays[f"{family.kind}.{name}"] = getattr(family.pieces, name[len("piece_") :])
    if isinstance(graph.switches, StoredSwitches):
        for name in SWITCH_ARRAYS:
            arrays[f"switches.{name}"] = getattr(graph.switches, name)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def load_graph(path: str | Path) -> SwitchingGraph:
    """Read a graph that `SwitchingGraph.save` wrote.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    SwitchingGraph
        Equal to the one that was saved.

    Raises
    ------
    FileFormatError
        If the file cannot be read, is damaged, of another format or of another version.

    Examples
    --------
    >>> import tempfile
    >>> from regrasp_lp import build_switching_graph
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)], name="square")
    >>> graph = build_switching_graph(square, friction=0.5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     graph.save(Path(folder) / "square.npz")
    ...     load_graph(Path(folder) / "square.npz") == graph
    True
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read: {error}") from error
    return graph_from_bytes(content, path)


def graph_from_bytes(
    content: bytes, path: str | Path = "graph", polygon: Polygon | None = None
) -> SwitchingGraph:
    """Return the graph that `graph_to_bytes` made bytes of.

    Parameters
    ----------
    content : bytes
    path : path-like
        Where it is from, for messages.
    polygon : Polygon, optional
        The object, if it is at hand: it is not made again, and knows the edges of its input.

    Returns
    -------
    SwitchingGraph

    Raises
    ------
    FileFormatError
        As `load_graph`.
    """
    try:
        if not zipfile.is_zipfile(io.BytesIO(content)):
            raise ValueError("it is no .npz archive")
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        header = json.loads(arrays["header"].tobytes())
    except _DAMAGED as error:
        raise FileFormatError(f"{path}: not a graph file, or damaged: {error}") from error
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise FileFormatError(f"{path}: not a graph file: its header does not say {FORMAT!r}")
    if header.get("version") not in (VERSION, LIMITED_VERSION):
        raise FileFormatError(
            f"{path}: version {header.get('version')!r} of the format; this release reads "
            f"versions {VERSION} and {LIMITED_VERSION}: build the graph again"
        )
    try:
        return _graph(header, arrays, polygon)
    except (KeyError, ValueError, TypeError, IndexError, RegraspError) as error:
        raise FileFormatError(f"{path}: damaged: {error!r}") from error


def _graph(
    header: dict[str, Any], arrays: dict[str, np.ndarray], polygon: Polygon | None
) -> SwitchingGraph:
    hand = Hand.from_document(header["hand"])
    kinds = kinds_of(header["options"]["sets"])
    _check_names(set(arrays), kinds, header["stored"], PIECE_ARRAYS if hand.coupled else ())
    if polygon is None:
        rings = np.split(arrays["vertices"], np.cumsum(arrays["ring_sizes"])[:-1])
        polygon = Polygon(rings[0], rings[1:], header["name"])
    cones = hand_cones(polygon, arrays["friction"], hand)
    options = GraphOptions(**header["options"])
    get_solver(options.solver)
    if header["options"] != asdict(options) or not isinstance(header["seconds"], dict):
        raise ValueError("the header is not complete")
    families = tuple(
        _family(cones, kind, count, arrays)
        for kind, count in zip(kinds_of(options.sets), header["candidates"], strict=True)
    )
    sets = GraspSets(polygon, families, spacing_of(cones, hand))
    check_switching(options.switching, options.sets, hand)
    switches: Switches
    if header["stored"]:
        switches = _stored(
            len(sets),
            StoredSwitches(*(arrays[f"switches.{name}"] for name in SWITCH_ARRAYS)),
            0 if hand.coupled else 1,
        )
    else:
        rule = switch_rule(
            sets,
            hand,
            get_solver(options.solver),
            options.switching,
            presolve=options.presolve,
            min_margin=options.min_margin,
        )
        switches = SwitchesOnDemand(rule)
    return SwitchingGraph(sets, switches, cones.whole.friction, hand, options, header["seconds"])


def _check_names(
    names: set[str], kinds: tuple[str, ...], stored: bool, pieces: tuple[str, ...]
) -> None:
    expected = {"header", "ring_sizes", "vertices", "friction"}
    of_kinds = ("edges", "centers", "margins", "witnesses", *pieces)
    expected |= {f"{k}.{n}" for k in kinds for n in of_kinds}
    expected |= {f"switches.{n}" for n in SWITCH_ARRAYS if stored}
    if names != expected:
        raise ValueError(f"unknown or missing arrays: {sorted(names ^ expected)}")


def _family(cones: Cones, kind: str, candidates: int, arrays: dict[str, np.ndarray]) -> Family:
    edges, centers, margins, witnesses = (
        arrays[f"{kind}.{name}"] for name in ("edges", "centers", "margins", "witnesses")
    )
    m = 2 if kind == "two_finger" else 3
    if not (
        edges.shape == witnesses.shape == (len(edges), m)
        and centers.shape == margins.shape == (len(edges),)
        and edges.dtype.kind == centers.dtype.kind == "i"
        and ((centers >= -1) & (centers < cones.n_edges)).all()
        and np.isfinite(margins).all()
        and ((witnesses >= 0) & (witnesses <= 1)).all()
        and ((edges >= 0) & (edges < cones.n_edges)).all()
    ):
        raise ValueError(f"the arrays of the {kind} sets do not fit together")
    if kind == "parallel":
        functions = parallel_functions(cones, edges, centers)
    else:
        functions = torque_functions(cones, edges)
    pieces = _pieces(functions, kind, arrays)
    return Family(kind, functions, centers, margins, witnesses, int(candidates), pieces)


def _pieces(
    functions: TorqueFunctions, kind: str, arrays: dict[str, np.ndarray]
) -> SetPieces | None:
    if f"{kind}.{PIECE_ARRAYS[0]}" not in arrays:
        return None
    pieces, rows, bounds, margins = (arrays[f"{kind}.{name}"] for name in PIECE_ARRAYS)
    count = len(pieces)
    if not (
        pieces.shape == (count, 3)
        and pieces.dtype.kind == "i"
        and rows.shape == (*bounds.shape, functions.m)
        and len(bounds) == len(margins) == count
        and (np.diff(pieces[:, 0]) >= 0).all()
        and set(pieces[:, 0].tolist()) == set(range(len(functions)))
        and ((pieces[:, 1:] >= 0) & (pieces[:, 1:] < functions.valid.shape[1])).all()
        and np.isfinite(rows).all()
        and np.isfinite(bounds).all()
        and np.isfinite(margins).all()
    ):
        raise ValueError(f"the pieces of the {kind} sets do not fit together")
    return SetPieces(functions, pieces, rows, bounds, margins)


def _stored(n: int, stored: StoredSwitches, least: int) -> StoredSwitches:
    starts, others, held = stored.starts, stored.others, stored.held
    pairs, width = len(others) // 2, stored.slots.shape[1]
    if not (
        starts.shape == (n + 1,)
        and others.shape == held.shape == (int(starts[-1]),)
        and stored.slots.shape == stored.points.shape == (pairs, width)
        and 2 * pairs == len(others)
        and (np.diff(starts) >= 0).all()
        and starts[0] == 0
        and ((others >= 0) & (others < n)).all()
        and ((held >= least) & (held <= width)).all()
        and ((stored.slots >= -1) & (stored.slots < 3)).all()
        and np.array_equal(stored.slots < 0, np.isnan(stored.points))
        and not ((stored.points < 0) | (stored.points > 1)).any()
        and starts.dtype.kind == others.dtype.kind == held.dtype.kind == "i"
    ):
        raise ValueError("the arrays of the switches do not fit together")
    return stored
