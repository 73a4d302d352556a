"""Limits of the hand that shorten edges: the same sets and switches on shorter edges, exactly."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from itertools import combinations, combinations_with_replacement, pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry import ell, rectangle, star, unit_square
from hypothesis import given, settings
from hypothesis import strategies as st
from polygons import FRICTIONS, stars
from regrasps import plate

import regrasp_lp as rl
from regrasp_lp.contact import FRACTION_SNAP, snap_fraction
from regrasp_lp.planning.reach import hand_cones, room, within_reach
from regrasp_lp.planning.verification import verify_document

BRACKET = rl.Polygon([(0, 0), (64, 0), (64, 16), (16, 16), (16, 32), (0, 32)], name="bracket")
RHOMB = rl.Polygon([(0, 0), (8, -6), (16, 0), (8, 6)], name="rhomb")
WEDGE = rl.Polygon([(0, 0), (7, 1), (5, 6)], name="wedge")


def square_of(polygon: rl.Polygon, edge: int) -> Fraction:
    """Squared length of an edge."""
    a, b = polygon.edge_starts[edge].tolist(), polygon.edge_ends[edge].tolist()
    return sum(((Fraction(y) - Fraction(x)) ** 2 for x, y in zip(a, b, strict=True)), Fraction(0))


def allowed(polygon: rl.Polygon, hand: rl.Hand, edge: int, fraction: float) -> bool:
    """Whether a hand may touch an edge at a fraction, by squares of lengths."""
    f, square = Fraction(fraction), square_of(polygon, edge)
    clear = Fraction(hand.edge_clearance) ** 2
    intervals = hand.intervals.get(edge, ((0.0, 1e9),))
    return min(f, 1 - f) ** 2 * square >= clear and any(
        Fraction(low) ** 2 <= f**2 * square <= Fraction(high) ** 2 for low, high in intervals
    )


# --- segments -----------------------------------------------------------------------------------


def segments(polygon: rl.Polygon, hand: rl.Hand) -> list[tuple[int, float, float]]:
    cones = hand_cones(polygon, 0.5, hand)
    ends = zip(cones.edge.tolist(), cones.lower.tolist(), cones.upper.tolist(), strict=True)
    return list(ends)


def test_segments() -> None:
    assert segments(BRACKET, rl.Hand(edge_clearance=4))[:2] == [
        (0, 1 / 16, 15 / 16),
        (1, 0.25, 0.75),
    ]
    hand = rl.Hand(reachable={1: None, 0: [(8, 16), (48, 99)], 3: (0, 16), 5: (0, 4)})
    assert segments(BRACKET, hand) == [
        (0, 0.125, 0.25),
        (0, 0.75, 1.0),
        (2, 0.0, 1.0),
        (3, 0.0, 1.0),
        (4, 0.0, 1.0),
        (5, 0.0, 0.125),
    ]
    both = rl.Hand(edge_clearance=4, reachable={0: [(1, 8), (60, 64)], 1: (0, 4), 2: None})
    assert segments(BRACKET, both)[:2] == [(0, 1 / 16, 0.125), (3, 0.25, 0.75)]
    assert segments(unit_square(), rl.Hand(edge_clearance=0.5)) == []
    assert segments(unit_square(), rl.Hand(edge_clearance=7)) == []


def test_vacuous_limits_are_none() -> None:
    cones = hand_cones(BRACKET, 0.5, rl.Hand(reachable={0: (0, 64), 3: [(0, 10), (9, 99)]}))
    assert cones.whole is cones


@given(
    st.tuples(st.integers(-40, 40), st.integers(1, 40)),
    st.floats(0, 60, exclude_min=True),
    st.floats(0, 60),
    st.floats(0, 60),
)
@settings(max_examples=300)
def test_segments_end_at_the_last_doubles_within(
    vertex: tuple[int, int], clearance: float, first: float, length: float
) -> None:
    polygon = rl.Polygon([(0, 0), (50, -1), vertex])
    hand = rl.Hand(edge_clearance=clearance, reachable={2: (first, first + length + 1e-3)})
    cones = hand_cones(polygon, 0.5, hand)
    for edge, lower, upper in segments(polygon, hand):
        assert lower < upper
        for end, beyond in ((lower, np.nextafter(lower, -1)), (upper, np.nextafter(upper, 2))):
            assert allowed(polygon, hand, edge, end)
            assert snap_fraction(end) == end
            if 2.1 * FRACTION_SNAP < end < 1 - 2.1 * FRACTION_SNAP:
                assert not allowed(polygon, hand, edge, float(beyond))
    for edge in set(range(3)) - set(cones.edge.tolist()):
        inside = [f for f in np.linspace(0, 1, 41) if allowed(polygon, hand, edge, float(f))]
        assert len(inside) <= 1


def test_places_snap_to_limits_within_rounding() -> None:
    cones = hand_cones(WEDGE, 0.5, rl.Hand(edge_clearance=1.0, reachable={2: None}))
    lower, upper = cones.lower[0], cones.upper[0]
    edges = np.array([0, 0, 0, 0, 0, 2])
    at = np.array([lower, lower - 1e-13, upper + 1e-13, lower - 1e-11, 0.5, 0.5])
    found, fractions = cones.places(edges, at)
    assert found.tolist() == [0, 0, 0, -1, 0, -1]
    assert fractions.tolist() == [lower, lower, upper, at[3], 0.5, 0.5]


def test_there_and_back_never_leaves_a_segment() -> None:
    cones = hand_cones(star(9, 3), 0.5, rl.Hand(edge_clearance=0.0123))
    rng = np.random.default_rng(0)
    number = rng.integers(0, cones.n_edges, 2000)
    inner = np.concatenate(([0.0, 1.0, 1e-17, 1 - 2**-53], rng.random(1996)))
    outer = cones.along(number, inner)
    assert ((outer >= cones.lower[number]) & (outer <= cones.upper[number])).all()
    assert (outer[inner == 1] == cones.upper[number[inner == 1]]).all()
    np.testing.assert_allclose(cones.within(number, outer), inner, atol=1e-14)


# --- the whole graph, against shorter edges -------------------------------------------------------


def cut(polygon: rl.Polygon, at: Mapping[int, list[float]]) -> tuple[rl.Polygon, list[int]]:
    """The polygon with more vertices, at fractions of edges; and on which edge each edge is."""
    points, edges = [], []
    for edge in range(polygon.n_edges):
        a, b = polygon.edge_starts[edge], polygon.edge_ends[edge]
        for f in [0.0, *at.get(edge, [])]:
            points.append(tuple(a + f * (b - a)))
            edges.append(edge)
    return rl.Polygon(points), edges


def names_of(graph: rl.SwitchingGraph, label: list[int | None]) -> list[tuple[object, ...]]:
    """Kind, segments of the contacts and segment of the centre of every set."""
    names = []
    for index in range(len(graph)):
        family, row = graph.sets.place(index)
        center = int(graph.sets.families[family].centers[row])
        at = [label[segment] for segment in graph.sets.functions(index).edges[0].tolist()]
        names.append((graph.sets.kinds[index], *at, -1 if center < 0 else label[center]))
    return names


def relation(graph: rl.SwitchingGraph, names: list[tuple[object, ...]]) -> set[object]:
    """Pairs of sets that hold contacts in common, and how many."""
    return {
        (names[i], names[j], held)
        for pairs in graph.switches.pairs()
        for i, j, held in zip(
            pairs.first.tolist(), pairs.second.tolist(), pairs.held.tolist(), strict=True
        )
    }


CUTS = {
    "clearance": (BRACKET, rl.Hand(edge_clearance=2)),
    "one interval": (BRACKET, rl.Hand(reachable={0: (8, 24), 2: (0, 30), 5: (16, 24)})),
    "two intervals": (BRACKET, rl.Hand(reachable={0: [(8, 24), (40, 56)], 4: (8, 12)})),
    "edges avoided": (BRACKET, rl.Hand(reachable={1: None, 3: None})),
    "everything": (
        BRACKET,
        rl.Hand(edge_clearance=1, reachable={0: [(0, 8), (16, 32), (60, 99)], 2: None, 4: (2, 8)}),
    ),
    "three fingers": (BRACKET, rl.Hand(3, edge_clearance=2, reachable={0: [(4, 8), (32, 48)]})),
    "slanted": (RHOMB, rl.Hand(reachable={0: (2.5, 7.5), 1: [(0, 2.5), (5, 7.5)]})),
}


@pytest.mark.parametrize("name", CUTS)
@pytest.mark.parametrize("sets", ["complete", "chapter"])
@pytest.mark.parametrize("friction", [0.25, 0.7])
def test_the_graph_is_that_of_shorter_edges(name: str, sets: str, friction: float) -> None:
    polygon, hand = CUTS[name]
    limited = rl.build_switching_graph(polygon, friction, hand, sets)
    kept = segments(polygon, hand)
    at: dict[int, list[float]] = {}
    for edge, lower, upper in kept:
        at.setdefault(edge, []).extend(f for f in (lower, upper) if 0 < f < 1)
    finer, edges = cut(polygon, at)
    first = {(edge, lower): number for number, (edge, lower, _) in enumerate(kept)}
    cuts = {edge: iter([0.0, *at.get(edge, [])]) for edge in set(edges)}
    label = [first.get((edge, next(cuts[edge]))) for edge in edges]
    whole = rl.build_switching_graph(finer, friction, rl.Hand(hand.fingers), sets)
    mine, theirs = names_of(limited, list(range(len(kept)))), names_of(whole, label)

    def possible(name: tuple[object, ...]) -> bool:
        """Whether the hand may touch there; the chapter takes parts of one edge for two edges."""
        at = [kept[s][0] for s in name[1:-1] if isinstance(s, int)]
        return None not in name and (sets == "complete" or len(set(at)) == len(at))

    known = dict(zip(theirs, whole.sets.margins.tolist(), strict=True))
    assert mine == [name for name in theirs if possible(name)]
    margins = [known[name] for name in mine]
    np.testing.assert_allclose(limited.sets.margins, margins, rtol=1e-9, atol=1e-12)
    pairs = {p for p in relation(whole, theirs) if possible(p[0]) and possible(p[1])}
    assert relation(limited, mine) == pairs


def test_chapter_sets_have_contacts_on_different_edges() -> None:
    hand = rl.Hand(reachable={0: [(0, 16), (48, 64)], 2: [(0, 12), (36, 48)]})
    graph = rl.build_switching_graph(BRACKET, 0.7, hand, sets="chapter")
    assert len(graph) > 5
    assert all(len(set(s.edges)) == len(s.edges) for s in graph.sets)


# --- brute force --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("polygon", "friction", "hand"),
    [
        (BRACKET, 0.3, rl.Hand(edge_clearance=3, reachable={0: [(5, 20), (30, 50)], 3: None})),
        (WEDGE, 0.6, rl.Hand(edge_clearance=0.7)),
        (ell(), 0.5, rl.Hand(reachable={0: (0.1, 1.5), 2: [(0, 0.2), (0.4, 0.45)]})),
    ],
    ids=["bracket", "wedge", "ell"],
)
def test_no_grasp_within_the_limits_is_missed_and_none_beyond_is_in(
    polygon: rl.Polygon, friction: float, hand: rl.Hand
) -> None:
    graph = rl.build_switching_graph(polygon, friction, hand)
    inside = outside = 0
    for m in (2, 3):
        grid = np.linspace(0, 1, 10 if m == 2 else 7)
        for edges in combinations_with_replacement(range(polygon.n_edges), m):
            places = [f for f in product(grid, repeat=m) if list(f) == sorted(f) or m == 2]
            closed = rl.is_force_closure(
                polygon, friction=friction, edges=[edges] * len(places), fractions=places
            )
            for fractions, holds in zip(places, closed, strict=True):
                pairs = list(zip(edges, map(float, fractions), strict=True))
                if len(set(pairs)) < m:
                    continue
                grasp = rl.Grasp.at_fractions(pairs)
                free = all(allowed(polygon, hand, e, f) for e, f in pairs)
                of_size = [i for i in graph.locate(grasp) if graph.sets.contacts[i] == m]
                assert len(of_size) == (holds and free)
                assert all(grasp in graph.sets[i] for i in of_size)
                inside, outside = inside + bool(of_size), outside + bool(holds and not free)
    assert inside > 30
    assert outside > 30


def test_switches_against_brute_force() -> None:
    hand = rl.Hand(edge_clearance=4, reachable={0: [(8, 20), (40, 50)]})
    graph = rl.build_switching_graph(BRACKET, 0.3, hand)
    grid = np.linspace(0, 1, 13)
    completed: list[set[tuple[tuple[int, float], ...]]] = []
    for index in range(len(graph)):
        functions = graph.sets.functions(index)
        points = np.array(list(product(grid, repeat=functions.m)))
        every = functions.take(np.zeros(len(points), dtype=int))
        edges = functions.edges[0].tolist()
        held = set()
        for point in points[every.contain(points)].tolist():
            pairs = list(zip(edges, point, strict=True))
            for count in range(1, functions.m + 1):
                held |= set(combinations(pairs, count))
        completed.append(held)
    seen = 0
    for i, j in combinations(range(len(graph)), 2):
        common = completed[i] & completed[j]
        most = max((len(h) for h in common if len({*h}) == len(h)), default=0)
        need = hand.held(int(graph.sets.contacts[i]), int(graph.sets.contacts[j]))
        found = graph.held(i, j)
        if most >= need:
            assert found is not None
            assert found >= min(most, 2)
            seen += 1
        if found:
            one, other = graph.witness(i, j) or pytest.fail("no witness")
            assert len(set(one) & set(other)) >= found
            assert i in graph.locate(one)
            assert j in graph.locate(other)
    assert seen > 40


# --- laws ---------------------------------------------------------------------------------------


@given(stars(), st.sampled_from(FRICTIONS), st.floats(0, 0.4), st.floats(0, 0.4))
@settings(max_examples=10)
def test_tighter_limits_leave_less(
    polygon: rl.Polygon, friction: float, one: float, other: float
) -> None:
    loose, tight = sorted((one, other))
    graphs = [
        rl.build_switching_graph(polygon, friction, rl.Hand(edge_clearance=c))
        for c in (0.0, loose, tight)
    ]
    for more, less in pairwise(graphs):
        known = {s.edges: s for s in more.sets}
        for grasp_set in less.sets:
            assert grasp_set.edges in known
            largest = known[grasp_set.edges].margin
            assert grasp_set.margin <= largest + 1e-9 * polygon.diameter
            if grasp_set.witness in grasp_set:  # but for sets within rounding
                assert grasp_set.witness in known[grasp_set.edges]
        links = [
            {tuple(sorted((g.sets[i].edges, g.sets[j].edges))) for i, j in g.to_networkx().edges}
            for g in (less, more)
        ]
        assert links[0] <= links[1]


@pytest.mark.parametrize("sets", ["complete", "chapter"])
def test_a_graph_with_vacuous_limits_is_the_same(sets: str) -> None:
    polygon = plate()
    hand = rl.Hand(max_span=None, edge_clearance=0.0, reachable={0: (0, 1e6)})
    free, limited = (rl.build_switching_graph(polygon, 0.2, h, sets) for h in (None, hand))
    assert free.hand != limited.hand
    for one, other in zip(free._arrays(), limited._arrays(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_units_do_not_matter() -> None:
    hand = rl.Hand(edge_clearance=2, reachable={0: [(8, 24), (40, 56)]})
    again = rl.Hand(edge_clearance=1 / 64, reachable={0: [(1 / 16, 3 / 16), (5 / 16, 7 / 16)]})
    small = rl.Polygon(BRACKET.vertices / 128)
    one, other = (rl.build_switching_graph(p, 0.3, h) for p, h in ((BRACKET, hand), (small, again)))
    assert [s.edges for s in one.sets] == [s.edges for s in other.sets]
    np.testing.assert_array_equal(one.sets.margins, 128 * other.sets.margins)
    assert one.to_networkx().edges == other.to_networkx().edges


def test_far_from_the_origin() -> None:
    """Ends of segments are exact however large the coordinates are."""
    moved = rl.Polygon(BRACKET.vertices + np.array([2.0**30, -(2.0**31)]))
    hand = rl.Hand(edge_clearance=3, reachable={0: [(5, 20), (30, 50)]})
    one, other = (rl.build_switching_graph(p, 0.3, hand) for p in (BRACKET, moved))
    assert [s.edges for s in one.sets] == [s.edges for s in other.sets]
    np.testing.assert_allclose(one.sets.margins, other.sets.margins, rtol=1e-12)
    assert one.to_networkx().edges == other.to_networkx().edges


def test_without_presolve() -> None:
    hand = rl.Hand(edge_clearance=2, reachable={0: [(8, 24), (40, 56)], 3: None})
    exact = rl.build_switching_graph(BRACKET, 0.3, hand)
    solved = rl.build_switching_graph(BRACKET, 0.3, hand, presolve=False)
    assert [s.edges for s in exact.sets] == [s.edges for s in solved.sets]
    np.testing.assert_allclose(exact.sets.margins, solved.sets.margins, rtol=1e-6)
    assert exact.to_networkx().edges == solved.to_networkx().edges


def test_ends_of_intervals_belong_to_them() -> None:
    hand = rl.Hand(reachable={0: (16, 48), 2: (8, 40)})
    graph = rl.build_switching_graph(rectangle(64, 32), 0.5, hand)
    assert graph.locate([(0, 16.0), (2, 40.0)])  # x = 16 and x = 24
    assert graph.locate([(0, 48.0), (2, 16.0)])
    assert not graph.locate([(0, np.nextafter(16.0, 0) - 1e-9), (2, 40.0)])
    assert not graph.locate([(0, 48.001), (2, 16.0)])


def test_nothing_may_be_touched() -> None:
    graph = rl.build_switching_graph(unit_square(), 0.5, rl.Hand(edge_clearance=3))
    assert (len(graph), graph.n_switches, graph.components()) == (0, 0, [])
    assert graph.locate([(0, 0.5), (2, 0.5)]) == ()
    chapter = rl.build_switching_graph(unit_square(), 0.5, rl.Hand(edge_clearance=3), "chapter")
    assert len(chapter) == 0
    assert "0" in str(graph.summary())


# --- what sets show -----------------------------------------------------------------------------


def test_pieces_and_forms_are_over_positions_along_whole_edges() -> None:
    hand = rl.Hand(edge_clearance=0.1, reachable={0: [(0.3, 0.6), (1.5, 1.9)]})
    graph = rl.build_switching_graph(rectangle(), 0.5, hand, sets="chapter")
    free = rl.build_switching_graph(rectangle(), 0.5, sets="chapter")
    whole = {(s.kind, s.edges, s.center): s for s in free.sets}
    for grasp_set in graph.sets:
        other = whole[grasp_set.kind, grasp_set.edges, grasp_set.center]
        assert grasp_set.names == other.names
        positions = grasp_set.witness.positions
        margins = grasp_set.pieces.margins(positions)
        assert margins.max() == pytest.approx(grasp_set.margin, abs=1e-6)
        for low, high, edge in zip(
            grasp_set.pieces.lower[0], grasp_set.pieces.upper[0], grasp_set.edges, strict=True
        ):
            assert 0.1 - 1e-12 <= low < high <= rectangle().edge_lengths[edge] - 0.1 + 1e-12
        if grasp_set.kind == "parallel":
            assert grasp_set.subpolytopes is not None
            assert (grasp_set.subpolytopes.margins(positions) > 0).any()
            assert len(grasp_set.outer_regions()) == 2
            np.testing.assert_allclose(
                grasp_set.common_cone, other.common_cone
            )  # shortening an edge turns nothing
        else:
            assert grasp_set.focus_cell is not None
            box = grasp_set.focus_cell
            assert len(box) <= len(other.focus_cell)


def test_room() -> None:
    hand = rl.Hand(edge_clearance=2, reachable={0: [(8, 24), (40, 56)]})
    cones = hand_cones(BRACKET, 0.3, hand)
    at = {1: BRACKET.resolve_contact((0, 10.0)), 2: BRACKET.resolve_contact((1, 8.0))}
    assert room(cones, hand, at) == 2.0
    assert room(cones, hand, {2: at[2]}) == 6.0
    assert room(cones, hand, {1: BRACKET.resolve_contact((0, 30.0))}) == -6.0
    free = hand_cones(BRACKET, 0.3, rl.Hand())
    assert room(free, rl.Hand(), at) == np.inf


# --- start and goal -----------------------------------------------------------------------------


def test_starts_outside_the_limits_are_refused() -> None:
    hand = rl.Hand(edge_clearance=2, reachable={0: [(8, 24), (40, 56)], 3: None})

    def refusal(contact: tuple[int, float]) -> str:
        grasp = BRACKET.resolve([contact, (2, 20.0)])
        with pytest.raises(rl.HandError) as caught:
            within_reach(BRACKET, hand, grasp, "start")
        return str(caught.value)

    assert refusal((0, 30.0)) == (
        "the start has a contact on edge 0 at 30, where the hand may not touch: from 8 to 24 and "
        "from 40 to 56 on this edge (edge_clearance=2 and reachable of the hand)"
    )
    assert "nowhere on this edge" in refusal((3, 8.0))
    assert "from 2 to 14 on this edge (edge_clearance=2 of the hand)" in refusal((1, 15.0))


def test_starts_within_rounding_of_a_limit_are_moved_onto_it() -> None:
    hand = rl.Hand(edge_clearance=0.3)
    polygon = WEDGE
    grasp = polygon.resolve([(0, 0.3), (1, 0.3)])
    moved = within_reach(polygon, hand, grasp, "goal")
    assert all(allowed(polygon, hand, c.edge, c.fraction) for c in moved)
    np.testing.assert_allclose(moved.positions, grasp.positions, rtol=1e-14)
    assert within_reach(polygon, rl.Hand(), grasp, "goal") == grasp


# --- files and other places -----------------------------------------------------------------------


def test_graph_files(tmp_path: Path) -> None:
    hand = rl.Hand(5, edge_clearance=2, reachable={0: [(8, 24), (40, 56)], 3: None})
    graph = rl.build_switching_graph(BRACKET, 0.3, hand)
    graph.save(tmp_path / "graph.npz")
    again = rl.load_graph(tmp_path / "graph.npz")
    assert again == graph
    assert again.hand == hand
    assert [s.witness for s in again.sets] == [s.witness for s in graph.sets]


@pytest.mark.parametrize("hand", [rl.Hand(edge_clearance=1), rl.Hand(5, reachable={0: None})])
def test_what_is_not_for_limited_hands(hand: rl.Hand, tmp_path: Path) -> None:
    graph = rl.build_switching_graph(BRACKET, 0.3, hand)
    for refused in (
        lambda: rl.certify(graph),
        lambda: graph.save_certificates(tmp_path / "proof"),
        lambda: rl.coverage(BRACKET, 0.3, hand=hand),
        lambda: rl.coverage(BRACKET, 0.3, graph=graph),
    ):
        with pytest.raises(rl.OptionError, match="hand with limits"):
            refused()
    with pytest.raises(rl.HandError, match="four fingers"):
        rl.build_switching_graph(BRACKET, 0.3, hand, "chapter", "focus")


def test_edges_that_do_not_exist() -> None:
    with pytest.raises(rl.HandError, match="names edge 6; bracket has edges 0 to 5"):
        rl.build_switching_graph(BRACKET, 0.3, rl.Hand(reachable={6: None}))
    with pytest.raises(rl.HandError, match="^finger_reachable names edge 6; bracket has edges"):
        rl.build_switching_graph(BRACKET, 0.3, rl.Hand(finger_reachable={1: {6: None}}))


@pytest.mark.parametrize(
    ("limits", "role", "message"),
    [
        (
            {"reachable": {0: (0, 30)}, "finger_reachable": {1: {0: (0, 10)}}},
            "start",
            "finger 1 may not touch: from 0 to 10 on this edge (reachable and finger_reachable of",
        ),
        (
            {"edge_clearance": 25, "finger_reachable": {1: {3: None}}},
            "start",
            "finger 1 may not touch: from 25 to 39 on this edge (edge_clearance=25 of",
        ),
        (
            {"finger_reachable": {1: {0: (0, 8)}, 2: {0: (4, 12)}, 3: {0: None}, 4: {0: None}}},
            "goal",
            "the hand may not touch: from 0 to 12 on this edge (finger_reachable of",
        ),
    ],
)
def test_limits_that_forbid_a_contact_are_named(
    limits: dict[str, Any], role: str, message: str
) -> None:
    grasp = BRACKET.resolve([(0, 20.0), (2, 6.0)])
    with pytest.raises(rl.HandError, match=re.escape(message)):
        within_reach(BRACKET, rl.Hand(**limits), grasp, role)


# --- plans --------------------------------------------------------------------------------------


@pytest.mark.parametrize("aligning", ["slide", "regrip"])
def test_plans_stay_within_the_limits_and_their_files_say_so(aligning: str, tmp_path: Path) -> None:
    hand = rl.Hand(edge_clearance=2, reachable={0: [(8, 24), (40, 56)], 3: None})
    graph = rl.build_switching_graph(BRACKET, 0.3, hand)
    rng, narrow = np.random.default_rng(1), 0
    for _ in range(8):
        start, goal = (graph.sets[i].witness for i in rng.integers(0, len(graph), 2))
        plan = graph.plan(start, goal, aligning=aligning)
        assert plan.verify().ok
        for held in plan.grasps:
            for contact in held.contacts.values():
                assert contact.fraction is not None
                assert allowed(BRACKET, hand, contact.edge, contact.fraction)
        assert set(plan.grasps[-1].contacts.values()) == set(goal)
        plan.to_json(tmp_path / "plan.json")
        again = rl.read_plan(tmp_path / "plan.json")
        assert again == plan
        assert again.hand == hand
        document = plan.to_document()
        document["hand"]["edge_clearance"] = 7.0
        fault = verify_document(document).fault
        if fault is not None:
            narrow += "edge_clearance = 7.0" in fault
    assert narrow > 3


def test_tolerances_of_plans_end_at_the_limits() -> None:
    """Between two edges that may be touched in the middle only."""
    polygon = rectangle(64, 32)
    hand = rl.Hand(reachable={0: (30, 34), 2: (30, 34)})
    start, goal = [(0, 31.0), (2, 33.0)], [(0, 33.0), (2, 31.0)]
    plan = rl.plan_regrasp(polygon, start, goal, 0.5, hand)
    free = rl.plan_regrasp(polygon, start, goal, 0.5)
    assert plan.grasps[0].tolerance == 1.0 < free.grasps[0].tolerance
    assert plan.verify().ok


def test_plans_are_refused_beyond_the_limits() -> None:
    hand = rl.Hand(reachable={0: (16, 48)})
    polygon = rectangle(64, 32)
    inside, outside = [(0, 32.0), (2, 32.0)], [(0, 12.0), (2, 52.0)]
    for pair, role in (((outside, inside), "start"), ((inside, outside), "goal")):
        with pytest.raises(rl.HandError, match=f"the {role} has a contact on edge 0 at 12"):
            rl.plan_regrasp(polygon, *pair, 0.5, hand)
