"""A switching graph to click in: sets as points, the torque functions of each, all switches.

The page holds no pictures of sets: a set is ``{min_j M_j < 0 < max_k M_k}`` of a few linear
functions, so that its margin, its intervals and whole grasps around held contacts are a few
additions each, whichever set is asked for. Pairs of sets that need to hold nothing are adjacent
without being listed, as in the graph itself.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from regrasp_lp.colors import KIND_MARKERS, KIND_NAMES
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import Cones, FloatArray, IntArray
from regrasp_lp.graph_layout import lay_out
from regrasp_lp.grasp_sets.candidates import common_cone
from regrasp_lp.margins import existing_pieces
from regrasp_lp.shadows import places_of
from regrasp_lp.switches import SwitchesOnDemand, SwitchPairs
from regrasp_lp.viewer.page import build_page, object_of, packed, save_page

if TYPE_CHECKING:
    from regrasp_lp.grasp_sets.vertices import Family
    from regrasp_lp.switching_graph import SwitchingGraph

MOST_SWITCHES = 1_000_000
"""Listed switches of the largest graph that is made a page of: some 30 MB."""

_MOST_CONTACTS = 3


def graph_page(graph: SwitchingGraph, path: str | Path | None = None) -> str:
    """Return a graph as a page, and write it if there is a path.

    A graph of 2,800 sets and 88,000 switches makes a page of 3 MB.

    Parameters
    ----------
    graph : SwitchingGraph
    path : path-like, optional
        Written whole or not at all.

    Returns
    -------
    str
        HTML with all that it needs.

    Raises
    ------
    OptionError
        If the graph has more than a million switches to list.

    Examples
    --------
    >>> import regrasp_lp as rl
    >>> block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], name="block")
    >>> page = graph_page(rl.build_switching_graph(block, friction=0.4))    # or graph.to_html(path)
    >>> page[:15], len(page) < 100_000
    ('<!doctype html>', True)
    """
    document = graph_document(graph)
    page = build_page("graph", document["title"], document, {"summary": str(graph.summary())})
    return save_page(page, path)


def graph_document(graph: SwitchingGraph) -> dict[str, Any]:
    """Return what the page of a graph draws and computes with.

    Arrays over N sets are padded to three contacts and flat; `page.packed` made them text.

    Parameters
    ----------
    graph : SwitchingGraph

    Returns
    -------
    dict
        Of sets: ``kinds`` (counts), ``edges`` (-1 for none), ``centers``, ``margins``,
        ``witnesses``, ``functions`` (N, J, 4) with ``M(0)/s`` and the slopes of each, NaN for
        none, ``limits`` (N, 3, 2) of fractions or None, ``rays`` (N, 4) of common cones,
        ``pieces``, ``positions``, ``components``. Of switches: ``starts`` (N + 1) and ``others``
        of the pairs i < j, ``slots`` (which contacts of i and j are held, three bits each) and
        ``points`` (where, NaN for none); ``free``: which numbers of contacts need nothing held.

    Raises
    ------
    OptionError
        If the graph has more than a million switches to list.
    """
    pairs = _listed(graph)
    layout = lay_out(graph)
    component = np.zeros(len(graph), dtype=np.intp)
    for number, members in enumerate(layout.components):
        component[members] = number
    return {
        "title": f"Switching graph of {graph.polygon.name or 'unnamed polygon'}",
        "object": object_of(graph.polygon, graph.friction.tolist()),
        "fingers": graph.hand.fingers,
        "n_switches": graph.n_switches,
        "spaced": graph.sets.spacing is not None,
        "positions": packed(layout.positions, "f4"),
        "components": packed(component, "u4"),
        **_sets(graph),
        **_switches(graph, pairs),
    }


def _listed(graph: SwitchingGraph) -> SwitchPairs:
    """All pairs that can hold contacts in common, each once; OptionError if they are too many."""
    pairs = None
    if not isinstance(graph.switches, SwitchesOnDemand):
        pairs = SwitchPairs.join(graph.switches.pairs())
    if pairs is None or len(pairs) > MOST_SWITCHES:
        count = "too many switches to be stored" if pairs is None else f"{len(pairs):,} switches"
        raise OptionError(
            f"the graph of {graph.polygon.name or 'unnamed polygon'} has {len(graph):,} sets and "
            f"{count}, more than the {MOST_SWITCHES:,} that a page can take: build it with a "
            'min_margin that leaves out the smallest sets, or with sets="chapter"'
        )
    return pairs


# --- sets ---------------------------------------------------------------------------------------


def _sets(graph: SwitchingGraph) -> dict[str, Any]:
    """The sets: their kinds, and arrays over all of them."""
    sets = graph.sets
    width = max((family.functions.valid.shape[1] for family in sets.families), default=0)
    edges = _stacked(sets.families, lambda f: sets.cones.edge[f.functions.edges], -1)
    return {
        "kinds": [
            {
                "name": KIND_NAMES[family.kind],
                "count": len(family),
                "contacts": family.functions.m,
                "marker": KIND_MARKERS[family.kind],
                "parallel": family.kind == "parallel",
                "cell": family.kind in ("concurrent", "two_finger"),
            }
            for family in sets.families
        ],
        "edges": packed(edges, "i2"),
        "centers": packed(_centers(graph), "i2"),
        "margins": packed(sets.margins, "f8"),
        "witnesses": packed(_witnesses(graph), "f8"),
        "width": width,
        "functions": packed(_functions(graph, width), "f8"),
        "limits": _limits(graph),
        "rays": packed(_rays(graph, edges), "f4"),
        "pieces": _pieces(graph),
    }


def _stacked(families: tuple[Family, ...], of: Any, fill: float) -> Any:
    """Arrays (n, m, ...) of all families as one, padded to three contacts."""
    padded = [np.zeros((0, _MOST_CONTACTS))]
    for family in families:
        array = np.asarray(of(family))
        pad = ((0, 0), (0, _MOST_CONTACTS - array.shape[1]))
        padded.append(np.pad(array, pad, constant_values=fill))
    return np.concatenate(padded)


def _centers(graph: SwitchingGraph) -> IntArray:
    numbers = np.concatenate([np.zeros(0, np.intp), *(f.centers for f in graph.sets.families)])
    return np.where(numbers < 0, -1, graph.sets.cones.edge[numbers])


def _witnesses(graph: SwitchingGraph) -> FloatArray:
    """Fractions of whole edges, shape (N, 3)."""
    cones = graph.sets.cones
    of = _stacked(
        graph.sets.families, lambda f: cones.along(f.functions.edges, f.witnesses), np.nan
    )
    return np.asarray(of, dtype=np.float64)


def _functions(graph: SwitchingGraph, width: int) -> FloatArray:
    """``M(0)/s`` and slopes over fractions of whole edges, shape (N, J, 4); NaN for none."""
    found = [np.zeros((0, width, 1 + _MOST_CONTACTS))]
    for family in graph.sets.families:
        functions = family.functions.whole
        n, j = functions.valid.shape
        rows = np.full((n, width, 1 + _MOST_CONTACTS), np.nan)
        valid = functions.valid[..., None]
        rows[:, :j, :1] = np.where(valid, functions.offsets[..., None], np.nan)
        rows[:, :j, 1 : 1 + functions.m] = np.where(valid, functions.slopes, np.nan)
        rows[:, :j, 1 + functions.m :] = np.where(valid, 0.0, np.nan)
        found.append(rows)
    return np.concatenate(found)


def _limits(graph: SwitchingGraph) -> dict[str, str] | None:
    """First and last fraction of each contact, if the hand cannot touch all of every edge."""
    cones, families = graph.sets.cones, graph.sets.families
    if cones.whole is cones:
        return None
    lower = _stacked(families, lambda f: cones.lower[f.functions.edges], 0.0)
    upper = _stacked(families, lambda f: cones.upper[f.functions.edges], 1.0)
    return packed(np.stack((lower, upper), axis=2), "f8")


def _rays(graph: SwitchingGraph, edges: IntArray) -> FloatArray:
    """Common cones of two-finger and parallel sets, shape (N, 2, 2); NaN for others.

    As they are seen from the contacts that are not the first one, or the centre.
    """
    cones: Cones = graph.sets.cones.whole
    centers = _centers(graph)
    edges = edges.astype(np.intp)
    has = (edges[:, 2] < 0) | (centers >= 0)
    middle = np.where(centers >= 0, centers, edges[:, 0])
    outer = np.sort(np.where(edges == middle[:, None], -1, edges), axis=1)[:, 1:]
    outer = np.where(outer < 0, outer.max(axis=1, initial=0)[:, None], outer)
    rays = np.full((len(edges), 2, 2), np.nan)
    if has.any():
        common = common_cone(cones, np.column_stack((middle, outer))[has])
        rays[has] = common.boundaries(cones)
    return rays


def _pieces(graph: SwitchingGraph) -> dict[str, Any] | None:
    """Columns (j, k) of the pieces of all sets, best first; None where distances limit them too."""
    if graph.sets.spacing is not None:
        return None
    counts, columns = [np.zeros(0, np.intp)], [np.zeros((0, 2), np.intp)]
    for family in graph.sets.families:
        found = existing_pieces(family.functions)
        counts.append(np.bincount(found[:, 0], minlength=len(family)))
        columns.append(found[:, 1:])
    starts = np.concatenate(([0], np.cumsum(np.concatenate(counts))))
    return {"starts": packed(starts, "u4"), "columns": packed(np.concatenate(columns), "u1")}


# --- switches -----------------------------------------------------------------------------------


def _switches(graph: SwitchingGraph, pairs: SwitchPairs) -> dict[str, Any]:
    """The listed switches in compressed rows, and which pairs need not be listed."""
    n = len(graph)
    segments = _stacked(graph.sets.families, lambda f: f.functions.edges, -1).astype(np.intp)
    slots = pairs.slots.astype(np.intp)
    rows = np.arange(len(pairs))[:, None]
    held = np.where(slots >= 0, segments[pairs.first][rows, slots], -1)
    places = places_of(held, segments[pairs.second])
    bits = np.where(slots >= 0, 1 << np.maximum(slots, 0), 0).sum(axis=1)
    bits += 8 * np.where(places >= 0, 1 << np.maximum(places, 0), 0).sum(axis=1)
    most = int(pairs.held.max(initial=1))
    cones = graph.sets.cones
    along = cones.along(np.maximum(held, 0), np.nan_to_num(pairs.points))
    points = np.where(slots >= 0, along, np.nan)[:, :most]
    adjacent = graph.hand.adjacent
    return {
        "starts": packed(np.searchsorted(pairs.first, np.arange(n + 1)), "u4"),
        "others": packed(pairs.second, "u2" if n < 1 << 16 else "u4"),
        "slots": packed(bits, "u1"),
        "most_held": most,
        "points": packed(points, "f4"),
        "free": [[a, b] for a in (2, 3) for b in (2, 3) if adjacent[a, b]],
    }
