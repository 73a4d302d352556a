"""Coverage: what random grasps and switches, judged by wrenches, say of a graph.

A measurement that cannot fail is worth nothing: most tests here take something away from a graph,
or add what is wrong, and look whether it is noticed.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import permutations, product
from math import comb as binomial
from math import isnan

import numpy as np
import pytest
from conftest import star_polygon
from geometry import GENERAL, LATTICE, comb, needle, rectangle, regular, unit_square, with_hole
from hypothesis import given
from hypothesis import strategies as st
from test_package import reached

import regrasp_lp as rl
from regrasp_lp.completeness import WHOLE_LIMIT, Share
from regrasp_lp.errors import HandError, OptionError
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.grasp_sets.vertices import Family
from regrasp_lp.membership import CombinationSets, GraphSets, KnownSets, edge_keys
from regrasp_lp.random_grasps import RandomGrasps
from regrasp_lp.sampling import Measurement, Samples
from regrasp_lp.switches import StoredSwitches, SwitchesOnDemand
from regrasp_lp.switching_graph import SwitchingGraph

FRICTIONS = (0.02, 0.1, 0.3, 0.5, 0.7, 1.0, 1.5, 3.0)


# --- shares -------------------------------------------------------------------------------------


def tail(found: int, of: int, p: Fraction) -> Fraction:
    """The probability of at least so many successes."""
    return sum(
        (binomial(of, k) * p**k * (1 - p) ** (of - k) for k in range(found, of + 1)), Fraction(0)
    )


@given(st.data())
def test_interval_is_where_binomial_tails_are_a_fortieth(data: st.DataObject) -> None:
    of = data.draw(st.integers(1, 40))
    found = data.draw(st.integers(0, of))
    share = Share(found, of)
    low, high = share.interval
    assert 0 <= low <= share.fraction <= high <= 1
    if found:
        assert float(tail(found, of, Fraction(low))) == pytest.approx(0.025, rel=1e-6)
    else:
        assert low == 0
    if found < of:
        assert 1 - float(tail(found + 1, of, Fraction(high))) == pytest.approx(0.025, rel=1e-6)
    else:
        assert high == 1


def test_share_of_nothing() -> None:
    share = Share(0, 0)
    assert isnan(share.fraction)
    assert share.interval == (0.0, 1.0)
    assert share + Share(2, 3) == Share(2, 3)


# --- drawing ------------------------------------------------------------------------------------


def draws(polygon: rl.Polygon, mu: float, proposal: str = "mixed") -> RandomGrasps:
    return RandomGrasps(polygon, np.full(polygon.n_edges, mu), proposal)


@pytest.mark.parametrize("proposal", ["mixed", "uniform"])
@pytest.mark.parametrize("name", ["square", "frame", "star7", "needle", "regular5"])
@pytest.mark.parametrize(("contacts", "twice"), [(2, False), (3, False), (3, True)])
def test_draws_are_contacts_of_the_class(
    name: str, proposal: str, contacts: int, twice: bool
) -> None:
    polygon = {**LATTICE, **GENERAL}[name]
    rng = np.random.default_rng(1)
    edges, fractions = draws(polygon, 0.3, proposal).draw(rng, 3000, contacts, twice=twice)
    assert len(edges) > 2000
    assert edges.min() >= 0
    assert edges.max() < polygon.n_edges
    assert fractions.min() >= 0
    assert fractions.max() <= 1
    assert {len(set(row)) for row in edges.tolist()} == {2 if twice else contacts}
    points = [
        {tuple(polygon.points(e, f).tolist()) for e, f in zip(*row, strict=True)}
        for row in zip(edges[:500].tolist(), fractions[:500].tolist(), strict=True)
    ]
    assert {len(row) for row in points} == {contacts}
    # every combination of edges, and every order of them, has its share
    orders = list(permutations(range(polygon.n_edges), contacts))
    if twice:
        orders = [p for p in product(range(polygon.n_edges), repeat=3) if len(set(p)) == 2]
    drawn = {tuple(row) for row in edges.tolist()}
    assert drawn <= set(orders)
    assert len(drawn) > 0.9 * len(orders)


def test_uniform_draws_are_uniform() -> None:
    polygon = star_polygon(6, 0)
    edges, fractions = draws(polygon, 0.3, "uniform").draw(np.random.default_rng(0), 60_000, 3)
    counts = np.unique(edge_keys(edges, 6), return_counts=True)[1]
    assert len(counts) == 6 * 5 * 4
    expected = len(edges) / len(counts)
    assert np.abs(counts - expected).max() < 5 * np.sqrt(expected)
    histogram = np.histogram(fractions.ravel(), 10, (0, 1))[0]
    assert np.abs(histogram - fractions.size / 10).max() < 5 * np.sqrt(fractions.size / 10)


@given(st.integers(0, 10**6), st.sampled_from([(1, 2), (1, 3), (2, 2), (2, 3), (3, 3)]))
def test_extended_draws_keep_the_given_contacts(seed: int, numbers: tuple[int, int]) -> None:
    given_, contacts = numbers
    polygon = with_hole()
    random, rng = draws(polygon, 0.4), np.random.default_rng(seed)
    edges = rng.integers(0, polygon.n_edges, (50, given_))
    fractions = rng.uniform(0.1, 0.9, edges.shape)
    more, places, kept = random.extend(rng, edges.copy(), fractions.copy(), contacts)
    assert len(more) == np.count_nonzero(kept) > 30
    assert np.array_equal(more[:, :given_], edges[kept])
    assert np.array_equal(places[:, :given_], fractions[kept])
    assert places.min() >= 0
    assert places.max() <= 1


def test_aimed_draws_find_what_uniform_ones_do_not() -> None:
    """Two edges opposed at nearly twice the half-angle, and low friction."""
    angle = 2 * np.arctan(0.02) * 0.99
    wedge = rl.Polygon([(0, 0), (1, 0), (1, 0.2 + np.tan(angle)), (0, 0.2)])
    found = {}
    for proposal in ("mixed", "uniform"):
        edges, fractions = draws(wedge, 0.02, proposal).draw(np.random.default_rng(0), 20_000, 2)
        holds = rl.is_force_closure(wedge, friction=0.02, edges=edges, fractions=fractions)
        found[proposal] = np.count_nonzero(holds & (np.sort(edges, axis=1) == [0, 2]).all(axis=1))
    assert found["uniform"] == 0
    assert found["mixed"] > 100


def test_drawing_and_judging_share_nothing_with_torque_functions() -> None:
    geometry = {
        "errors",
        "display",
        "contact",
        "rings",
        "ring_checks",
        "polygon",
        "directions",
        "friction",
    }
    geometry |= {"wrenches"}
    assert reached("random_grasps") <= geometry


# --- complete sets ------------------------------------------------------------------------------


CASES = [
    (name, mu)
    for name, mu in product(
        ("square", "rectangle", "triangle", "hexagon", "comb", "collinear", "frame", "staircase"),
        (0.1, 0.5, 1.0),
    )
]
CASES += [("star7", 0.02), ("star9", 3.0), ("regular5", 0.7), ("thin", 0.3), ("lattice_star", 1.5)]
CASES += [("nearly_parallel", 0.02), ("nearly_parallel", 1.0), ("needle", 0.3)]


@pytest.mark.parametrize(("name", "mu"), CASES)
def test_complete_sets_miss_nothing(name: str, mu: float) -> None:
    polygon = {**LATTICE, **GENERAL}[name]
    result = rl.coverage(polygon, mu, samples=200)
    assert result.whole
    assert result.grasps == Share(200, 200)
    assert result.switches.found == result.switches.of
    assert result.located == result.grasps
    assert result.false_members == 0
    assert not result.missed
    assert not result.missed_switches
    assert not result.wrong
    assert result.n_combinations is not None
    assert result.seen <= result.n_combinations


@pytest.mark.parametrize("name", ["square", "star7", "hexagon"])
def test_every_set_of_a_small_object_is_seen(name: str) -> None:
    for mu in (0.1, 1.0):
        result = rl.coverage({**LATTICE, **GENERAL}[name], mu, samples=3000)
        assert result.n_combinations is not None
        assert result.seen >= 0.95 * result.n_combinations


def test_switches_are_counted_on_their_own() -> None:
    grasps, both = (rl.coverage(comb(2), 0.3, 200, switches=n) for n in (0, 120))
    assert grasps.grasps == both.grasps == Share(200, 200)
    assert grasps.switches == Share(0, 0)
    assert both.switches == Share(120, 120)
    assert grasps.by_contacts == both.by_contacts


def test_friction_per_edge() -> None:
    polygon = star_polygon(8, 2)
    mu = np.linspace(0.05, 1.2, 8)
    result = rl.coverage(polygon, mu, samples=400)
    assert result.grasps == result.located == Share(400, 400)
    assert result.switches == Share(400, 400)


def test_low_friction_has_few_kinds() -> None:
    """A triangle that no two fingers can hold: what one class lacks is left to the next."""
    result = rl.coverage(regular(3), 0.02, samples=100)
    of = {label: share.of for label, share in result.by_contacts.items()}
    assert of == {"2 contacts": 0, "3, two on one edge": 0, "3 on different edges": 100}
    assert result.switches == Share(0, 0)  # there is one set only


def test_bound_on_draws() -> None:
    assert rl.coverage(regular(3), 0.02, samples=100, max_draws=1).grasps.of <= 1
    result = rl.coverage(star_polygon(12, 0), 0.1, samples=10**6, max_draws=2000)
    assert 0 < result.grasps.of < 6000
    assert result.draws <= 6000


@pytest.mark.parametrize(
    ("fingers", "kinds"),
    [
        (3, ["2 to 2 contacts, 1 held", "2 to 3 contacts, 2 held"]),
        (
            4,
            [
                "2 to 2 contacts, 1 held",
                "2 to 3 contacts, 1 held",
                "2 to 3 contacts, 2 held",
                "3 to 3 contacts, 2 held",
            ],
        ),
        (
            5,
            [
                "2 to 2 contacts, 1 held",
                "2 to 3 contacts, 1 held",
                "2 to 3 contacts, 2 held",
                "3 to 3 contacts, 1 held",
                "3 to 3 contacts, 2 held",
            ],
        ),
    ],
)
def test_switches_that_a_hand_can_do(fingers: int, kinds: list[str]) -> None:
    result = rl.coverage(comb(2), 0.4, samples=500, hand=rl.Hand(fingers))
    assert list(result.by_held) == kinds
    assert all(share.found == share.of >= 80 for share in result.by_held.values())


# --- the same answers, however they are looked up -----------------------------------------------


def sampled(known: KnownSets, polygon: rl.Polygon, mu: float, hand: rl.Hand) -> Measurement:
    run = Measurement(known, draws(polygon, mu), np.random.default_rng(3), 20_000)
    run.sample_grasps(300)
    run.sample_switches(300, hand)
    return run


@pytest.mark.parametrize("sets", ["complete", "chapter"])
@pytest.mark.parametrize("mu", [0.2, 1.0])
def test_grasps_are_looked_up_as_the_graph_locates_them(sets: str, mu: float) -> None:
    polygon = star_polygon(9, 4)
    graph = rl.build_switching_graph(polygon, mu, sets=sets)
    run = sampled(GraphSets(graph), polygon, mu, rl.Hand())
    for label, samples in run.grasps.items():
        grasps = [samples.grasp(row) for row in range(len(samples.edges))]
        located = [graph.locate(grasp) for grasp in grasps]
        assert run.located_of(label) == (sum(map(bool, located)), len(grasps))
        exactly = [
            any(len(graph.sets[i].edges) == len(grasp) for i in found)
            for grasp, found in zip(grasps, located, strict=True)
        ]
        assert samples.found.tolist() == exactly


def by_graph(graph: SwitchingGraph, first: Samples, second: Samples, held: int) -> list[bool]:
    """Whether some sets of two grasps are adjacent with so many held contacts, one by one."""
    answers = []
    for row in range(len(first.edges)):
        one, other = (
            [i for i in graph.locate(s.grasp(row)) if len(graph.sets[i].edges) == s.edges.shape[1]]
            for s in (first, second)
        )
        most = [graph.held(i, j) for i, j in product(one, other)]
        answers.append(any(m is not None and m >= held for m in most))
    return answers


@pytest.mark.parametrize("sets", ["complete", "chapter"])
@pytest.mark.parametrize(("m", "n", "held"), [(2, 2, 1), (2, 3, 1), (2, 3, 2), (3, 3, 2)])
def test_switches_are_looked_up_as_the_graph_has_them(sets: str, m: int, n: int, held: int) -> None:
    polygon, mu = star_polygon(9, 4), 0.7
    graph = rl.build_switching_graph(polygon, mu, sets=sets)
    run = sampled(GraphSets(graph), polygon, mu, graph.hand)
    first, second = run._draw_switches(60, m, n, held)
    assert len(first.edges) == 60
    assert np.array_equal(first.edges[:, :held], second.edges[:, :held])
    assert np.array_equal(first.fractions[:, :held], second.fractions[:, :held])
    expected = by_graph(graph, first, second, held)
    assert run._look_up(first, second, held).tolist() == expected
    assert all(expected) == (sets == "complete" or n == 2)  # the chapter has all pairs


@pytest.mark.parametrize("sets", ["complete", "chapter"])
@pytest.mark.parametrize(("name", "mu"), [("comb", 0.5), ("frame", 1.0), ("star9", 0.3)])
def test_graph_and_sampled_combinations_give_the_same(name: str, mu: float, sets: str) -> None:
    polygon = {**LATTICE, **GENERAL}[name]
    results = [rl.coverage(polygon, mu, 300, sets=sets, whole=whole) for whole in (True, False)]
    stored = rl.build_switching_graph(polygon, mu, sets=sets)
    on_demand = replace(stored, switches=SwitchesOnDemand(rule(stored)))
    results += [rl.coverage(polygon, mu, 300, graph=graph) for graph in (stored, on_demand)]
    assert [r.whole for r in results] == [True, False, True, True]
    first, *others = (
        replace(r, whole=True, n_combinations=None, missed_switches=()) for r in results
    )
    assert others == [first] * 3
    assert first.grasps.of == 300


def rule(graph: SwitchingGraph):  # type: ignore[no-untyped-def]
    from regrasp_lp.build import switch_rule
    from regrasp_lp.lp import get_solver

    return switch_rule(graph.sets, graph.hand, get_solver("clarabel"))


def test_large_objects_are_looked_up_by_combination() -> None:
    polygon = star_polygon(WHOLE_LIMIT + 1, 0)
    result = rl.coverage(polygon, 0.3, samples=300)
    assert not result.whole
    assert result.n_combinations is None
    assert result.grasps == result.switches == Share(300, 300)


def test_same_seed_same_samples() -> None:
    one, other, third = (rl.coverage(comb(2), 0.3, 200, seed) for seed in (5, 5, 6))
    assert one == other
    assert one.draws != third.draws or one.seen != third.seen


# --- what is missing or wrong is noticed --------------------------------------------------------


def with_families(graph: SwitchingGraph, families: list[Family]) -> SwitchingGraph:
    sets = GraspSets(graph.polygon, tuple(families))
    return replace(graph, sets=sets)


def rows_of(family: Family, kept: np.ndarray) -> Family:
    return replace(
        family,
        functions=family.functions.take(kept),
        centers=family.centers[kept],
        margins=family.margins[kept],
        witnesses=family.witnesses[kept],
    )


def test_a_set_that_is_missing_is_noticed() -> None:
    polygon = star_polygon(7, 1)
    graph = rl.build_switching_graph(polygon, 0.6)
    triples = graph.sets.families[1]
    lost = int(triples.margins.argmax())
    kept = np.delete(np.arange(len(triples)), lost)
    poorer = with_families(graph, [graph.sets.families[0], rows_of(triples, kept)])
    result = rl.coverage(polygon, 0.6, 2000, graph=poorer)
    assert result.grasps.found < result.grasps.of == 2000
    assert result.grasps.interval[1] < 1
    edges = triples.functions.edges[lost].tolist()
    assert {tuple(sorted(grasp.edges.tolist())) for grasp in result.missed} == {tuple(edges)}
    assert all(rl.is_force_closure(polygon, grasp, 0.6) for grasp in result.missed)
    assert not any(poorer.sets.on_edges(edges))


def test_sets_of_less_friction_miss_some() -> None:
    """The sets are those of μ = 0.4; the contacts are said to have μ = 0.5."""
    polygon = star_polygon(7, 1)
    graph = replace(rl.build_switching_graph(polygon, 0.4), friction=np.full(polygon.n_edges, 0.5))
    result = rl.coverage(polygon, 0.5, 1000, graph=graph)
    assert result.grasps.fraction < 0.99
    assert result.false_members == 0
    for grasp in result.missed:
        assert rl.is_force_closure(polygon, grasp, 0.5)
        assert not rl.is_force_closure(polygon, grasp, 0.4)


def test_members_that_are_no_grasps_are_noticed() -> None:
    """The sets are those of μ = 0.6; the contacts are said to have μ = 0.5."""
    polygon = star_polygon(7, 1)
    graph = replace(rl.build_switching_graph(polygon, 0.6), friction=np.full(polygon.n_edges, 0.5))
    result = rl.coverage(polygon, 0.5, 1000, graph=graph)
    assert result.grasps == Share(1000, 1000)
    assert result.false_members > 100
    assert len(result.wrong) == 10
    for grasp in result.wrong:
        assert not rl.is_force_closure(polygon, grasp, 0.5)
        assert graph.locate(grasp)


def test_a_switch_that_is_missing_is_noticed() -> None:
    polygon = comb(2)
    graph = rl.build_switching_graph(polygon, 0.5)
    whole = rl.coverage(polygon, 0.5, 600, graph=graph)
    assert whole.switches == Share(600, 600)
    stored = graph.switches
    assert isinstance(stored, StoredSwitches)
    # No switch may hold two contacts any more: they may hold one.
    less = replace(graph, switches=replace(stored, held=np.minimum(stored.held, 1)))
    result = rl.coverage(polygon, 0.5, 600, graph=less)
    assert result.grasps == Share(600, 600)
    for label, share in result.by_held.items():
        assert share.found == (0 if label.endswith("2 held") else share.of)
    for first, second in result.missed_switches:
        common = set(first.contacts) & set(second.contacts)
        assert len(common) == 2
        assert all(rl.is_force_closure(polygon, grasp, 0.5) for grasp in (first, second))
        edges = [tuple(sorted(grasp.edges.tolist())) for grasp in (first, second)]
        (i,), (j,) = map(graph.sets.on_edges, edges)
        assert (graph.held(i, j), less.held(i, j)) == (2, 1)
    # None at all.
    none = np.zeros(0, dtype=np.int32)
    bare = replace(
        stored, starts=np.zeros_like(stored.starts), others=none, held=none.astype(np.int8)
    )
    assert rl.coverage(polygon, 0.5, 100, graph=replace(graph, switches=bare)).switches.found == 0


def test_narrow_sets_are_left_out_by_a_margin() -> None:
    polygon = star_polygon(8, 3)
    graph = rl.build_switching_graph(polygon, 0.3, min_margin=0.1)
    result = rl.coverage(polygon, 0.3, 500, graph=graph)
    assert 0 < result.grasps.fraction < 1


# --- the chapter's sets -------------------------------------------------------------------------


def test_chapter_sets_miss_what_the_theory_says() -> None:
    """The grasp (1, 0), (2, 2), (0, 1) of a right triangle at μ = 0.45 is in none of them."""
    triangle = rl.Polygon([(0, 0), (4, 0), (0, 4)])
    known = CombinationSets(
        rl.build_switching_graph(triangle, 0.45).sets.sources[0].cones, "chapter"
    )
    edges, fractions = np.array([[0, 1, 2]]), np.array([[0.25, 0.5, 0.75]])
    assert rl.is_force_closure(triangle, friction=0.45, edges=edges, fractions=fractions)[0]
    assert not known.over(edges).holding(edges, fractions)[0].size
    result = rl.coverage(triangle, 0.45, 500, sets="chapter")
    assert result.by_contacts["2 contacts"].fraction == 1
    assert result.by_contacts["3, two on one edge"].found == 0
    assert result.by_contacts["3 on different edges"].fraction < 1
    assert result.false_members == 0


@pytest.mark.parametrize("mu", [0.1, 0.7])
def test_chapter_shares_against_volumes(mu: float) -> None:
    """Uniform draws measure volumes: of the chapter's sets in that of the complete ones."""
    polygon = star_polygon(8, 5)
    result = rl.coverage(polygon, mu, 3000, sets="chapter", proposal="uniform", max_draws=200_000)
    rng = np.random.default_rng(0)
    edges = np.sort(rng.permuted(np.tile(np.arange(8), (40_000, 1)), axis=1)[:, :3], axis=1)
    fractions = rng.random(edges.shape)
    closed = rl.is_force_closure(polygon, friction=mu, edges=edges, fractions=fractions)
    inside = np.zeros(len(edges), dtype=bool)
    graph = rl.build_switching_graph(polygon, mu, sets="chapter")
    for family in graph.sets.families[1:]:
        for row, combination in enumerate(family.functions.edges):
            mine = np.flatnonzero((edges == combination).all(axis=1))
            stack = family.functions.take(np.full(len(mine), row))
            inside[mine] |= stack.contain(fractions[mine])
    expected = np.count_nonzero(inside) / np.count_nonzero(closed)
    share = result.by_contacts["3 on different edges"]
    deviation = np.sqrt(expected * (1 - expected) * (1 / share.of + 1 / closed.sum()))
    assert share.of >= 1500
    assert abs(share.fraction - expected) < 4.5 * deviation
    assert 0.05 < expected < 0.95


# --- the result ---------------------------------------------------------------------------------


def test_table() -> None:
    text = str(rl.coverage(rectangle(), 0.3, 400, sets="chapter"))
    lines = text.splitlines()
    assert lines[0] == "unnamed polygon: 4 edges, μ = 0.3"
    assert lines[1] == "chapter sets, whole graph; mixed draws, seed 0"
    assert lines[3].split() == ["found", "of", "fraction", "95", "%", "interval"]
    pairs = next(line for line in lines if line.startswith("  2 contacts"))
    assert pairs.split() == ["2", "contacts", "100", "100", "1.0000", "0.9638", "to", "1.0000"]
    assert lines[-1].startswith("false members: 0 of ")
    nothing = str(rl.coverage(regular(3), [0.02, 0.02, 0.03], 50, whole=False))
    assert nothing.startswith("unnamed polygon: 3 edges, μ = 0.02 to 0.03\n")
    assert "sets of the sampled combinations of edges" in nothing
    (empty,) = (line for line in nothing.splitlines() if line.startswith("  2 contacts"))
    assert empty.split() == ["2", "contacts", "0", "0"]


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"samples": 0}, OptionError, "samples must be a whole number of at least 1, got 0"),
        ({"samples": 2.5}, OptionError, "samples must be a whole number"),
        ({"switches": -1}, OptionError, "switches must be a whole number of at least 0, got -1"),
        ({"max_draws": 0}, OptionError, "max_draws must be a whole number of at least 1"),
        ({"proposal": "clever"}, OptionError, 'proposal must be "mixed" or "uniform"'),
        ({"sets": "all"}, OptionError, 'sets must be "complete" or "chapter"'),
        ({"hand": 4}, HandError, "hand must be a Hand"),
        ({"friction": -1}, rl.FrictionError, "positive"),
    ],
)
def test_bad_arguments(arguments: dict, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        rl.coverage(unit_square(), **{"friction": 0.3, **arguments})


def test_graph_of_another_object() -> None:
    graph = rl.build_switching_graph(unit_square(), 0.3)
    for polygon, mu in ((rectangle(), 0.3), (unit_square(), 0.4)):
        with pytest.raises(OptionError, match="another object or friction"):
            rl.coverage(polygon, mu, graph=graph)


# --- real outlines ------------------------------------------------------------------------------


def test_corpus_in_short(corpus: list[rl.Polygon]) -> None:
    """The smallest, a middling and the largest outline of every tenth of the corpus."""
    ordered = sorted(corpus, key=lambda p: (p.n_edges, p.name))
    for number, polygon in enumerate(ordered[::13]):
        mu = FRICTIONS[number % len(FRICTIONS)]
        result = rl.coverage(polygon, mu, samples=200, max_draws=20_000)
        assert result.grasps.found == result.grasps.of, (polygon.name, result.missed)
        assert result.switches.found == result.switches.of, (polygon.name, result.missed_switches)
        assert result.false_members == 0, (polygon.name, result.wrong)
        assert result.grasps.of == 200, polygon.name


@pytest.mark.slow
@pytest.mark.parametrize("mu", FRICTIONS)
def test_corpus(corpus: list[rl.Polygon], mu: float) -> None:
    """All outlines with 4,000 grasps and as many switches each, looked up in whole graphs."""
    total = 0
    for polygon in corpus:
        result = rl.coverage(polygon, mu)
        assert result.grasps.found == result.grasps.of, (polygon.name, result.missed)
        assert result.switches.found == result.switches.of, (polygon.name, result.missed_switches)
        assert result.false_members == 0, (polygon.name, result.wrong)
        assert result.grasps.of == 4000, polygon.name
        total += result.draws
    assert total > 1_000_000


@pytest.mark.slow
@pytest.mark.parametrize("mu", FRICTIONS)
def test_chapter_sets_of_the_corpus_have_no_false_member(
    corpus: list[rl.Polygon], mu: float
) -> None:
    total = 0
    for polygon in corpus:
        if polygon.n_edges <= WHOLE_LIMIT:
            result = rl.coverage(polygon, mu, 1000, sets="chapter")
            assert result.false_members == 0, (polygon.name, result.wrong)
            assert result.by_contacts["2 contacts"].found == result.by_contacts["2 contacts"].of
            total += result.draws
    assert total > 300_000


def test_needle_has_grasps() -> None:
    """Edges that differ by six orders of magnitude in length."""
    result = rl.coverage(needle(), 0.3, samples=300)
    assert result.grasps == Share(300, 300)
    assert result.draws < 60_000
