"""What should change nothing changes nothing: numbering, place, size, order, batches, solvers.

Counts and switches are decided exactly and have to be equal exactly, for degenerate objects too;
margins are values and have to be equal to rounding.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from random import Random

import numpy as np
import pytest
from conftest import covering
from geometry import GENERAL, LATTICE, comb, ell, lattice_star, rectangle, staircase
from hypothesis import given, settings
from hypothesis import strategies as st
from polygons import FAMILIES, FRICTIONS, Moved, frictions, moved, regular
from reference import reference_graph

import regrasp_lp as rl
from regrasp_lp.errors import PolygonError
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets import vertices
from regrasp_lp.handovers import handovers
from regrasp_lp.lp import GAP, get_solver
from regrasp_lp.polygon import Polygon
from regrasp_lp.switching_graph import SwitchingGraph
from regrasp_lp.torque import TorqueFunctions

Friction = float | list[float]

MARGIN = 1e-9
"""Margins are equal to this, relative to themselves."""

NOTHING, LITTLE, MUCH = 1e-15, 1e-2, 1.0
"""Margins smaller than this, in sizes of the object, are compared in that unit: those of sets,
of grasps (which can be near 0), and those that an LP finds without help."""


@dataclass(frozen=True)
class Choice:
    """The options of a graph."""

    sets: str = "complete"
    switching: str = "contact"
    fingers: int = 4

    def build(self, polygon: Polygon, friction: Friction, **options: object) -> SwitchingGraph:
        return rl.build_switching_graph(
            polygon, friction, rl.Hand(self.fingers), self.sets, self.switching, **options
        )


Law = Callable[[Polygon, Friction, Choice, Random], None]

CHOICES = [
    *[Choice("complete", "contact", fingers) for fingers in (3, 4, 5)],
    *[Choice("chapter", "contact", fingers) for fingers in (3, 4, 5)],
    Choice("chapter", "focus", 4),
]
FOUR = [c for c in CHOICES if c.fingers == 4]


# --- comparing two graphs -----------------------------------------------------------------------


def keys(graph: SwitchingGraph, edge: np.ndarray | None = None) -> list[tuple[object, ...]]:
    """What each set is: its kind, its edges and its centre, in other numbers if these are given."""
    number = np.arange(graph.polygon.n_edges) if edge is None else edge
    found: list[tuple[object, ...]] = []
    for family in graph.sets.families:
        edges = np.sort(number[family.functions.edges], axis=1).tolist()
        centers = np.where(family.centers >= 0, number[family.centers], -1).tolist()
        found += [(family.kind, *e, c) for e, c in zip(edges, centers, strict=True)]
    assert len(set(found)) == len(found)
    return found


def switches(graph: SwitchingGraph, number: np.ndarray) -> np.ndarray:
    """Rows (i, j, held) of all listed switches, seen from both sides, in given set numbers."""
    rows = [np.zeros((0, 3), dtype=np.intp)]
    for index in range(len(graph)):
        others, held = graph.switches.neighbors(index)
        one = np.full(len(others), number[index])
        rows.append(np.stack((one, number[np.asarray(others)], np.asarray(held)), axis=1))
    found = np.concatenate(rows)
    return found[np.lexsort(found.T[::-1])]


def numbers_in(one: SwitchingGraph, other: SwitchingGraph, edge: np.ndarray | None) -> np.ndarray:
    """For each set of one graph the number of the same set in the other; all have to be there."""
    mine, theirs = keys(one, edge), keys(other)
    assert set(mine) == set(theirs), (
        f"only in the one: {sorted(set(mine) - set(theirs), key=str)}; "
        f"only in the other: {sorted(set(theirs) - set(mine), key=str)}"
    )
    place = {key: number for number, key in enumerate(theirs)}
    return np.array([place[key] for key in mine], dtype=np.intp)


def check_same(
    one: SwitchingGraph,
    other: SwitchingGraph,
    edge: np.ndarray | None = None,
    scale: float = 1.0,
) -> float:
    """The same sets, switches, components and, to rounding, margins; returns how far these are."""
    number = numbers_in(one, other, edge)
    counts = [
        [(kind, c.candidates, c.sets, c.components) for kind, c in graph.summary().kinds.items()]
        for graph in (one, other)
    ]
    assert counts[0] == counts[1]
    np.testing.assert_array_equal(switches(one, number), switches(other, np.arange(len(other))))
    assert one.n_switches == other.n_switches
    components = [{frozenset(number[sorted(c)].tolist()) for c in one.components()}]
    components.append({frozenset(c) for c in other.components()})
    assert components[0] == components[1]
    return check_margins(one.sets.margins, other.sets.margins[number] / scale, one.polygon)


def check_margins(
    one: np.ndarray, other: np.ndarray, polygon: Polygon, least: float = NOTHING
) -> float:
    """Equal to `MARGIN`; returns by how much they differ at worst."""
    far = np.abs(one - other) / np.maximum(np.abs(one), least * polygon.diameter)
    worst = float(far.max(initial=0.0))
    assert worst <= MARGIN
    return worst


def check_moved(
    polygon: Polygon, friction: Friction, choice: Choice, every: list[Moved]
) -> SwitchingGraph:
    graph = choice.build(polygon, friction)
    for move in every:
        other = choice.build(move.polygon, move.friction(friction))
        check_same(graph, other, move.edge, move.scale)
    return graph


def check_every_bit(polygon: Polygon, friction: Friction, choice: Choice, move: Moved) -> None:
    """Powers of 2 and offsets without rounding: exact, and so is everything after them."""
    graph, other = choice.build(polygon, friction), choice.build(move.polygon, friction)
    assert keys(other) == keys(graph)
    number = np.arange(len(graph))
    np.testing.assert_array_equal(switches(other, number), switches(graph, number))
    np.testing.assert_array_equal(other.sets.margins, move.scale * graph.sets.margins)
    for mine, theirs in zip(graph.sets.families, other.sets.families, strict=True):
        np.testing.assert_array_equal(mine.functions.edges, theirs.functions.edges)
        np.testing.assert_array_equal(mine.witnesses, theirs.witnesses)


QUARTER = ((0.0, -1.0), (1.0, 0.0))
HALF = ((-1.0, 0.0), (0.0, -1.0))
MIRROR = ((-1.0, 0.0), (0.0, 1.0))
DIAGONAL = ((0.0, 1.0), (1.0, 0.0))


def of_size(k: int) -> tuple[tuple[float, float], tuple[float, float]]:
    return ((2.0**k, 0.0), (0.0, 2.0**k))


# --- the laws -----------------------------------------------------------------------------------
#
# Each takes a polygon, its friction and the options, and draws the rest.


def first_vertex(polygon: Polygon, friction: Friction, choice: Choice, rng: Random) -> None:
    first = rng.randrange(1, polygon.n_edges)
    every = [moved(polygon, first=first), moved(polygon, first=first, turn_rings=True)]
    check_moved(polygon, friction, choice, every)


def mirrored(polygon: Polygon, friction: Friction, choice: Choice, rng: Random) -> None:
    every = [moved(polygon, MIRROR), moved(polygon, DIAGONAL, turn_rings=True)]
    assert all(m.turned for m in every)
    check_moved(polygon, friction, choice, every)


def turned(polygon: Polygon, friction: Friction, choice: Choice, rng: Random) -> None:
    every = [moved(polygon, QUARTER), moved(polygon, HALF)]
    check_moved(polygon, friction, choice, every)


def membership(polygon: Polygon, friction: Friction, choice: Choice, rng: Random) -> None:
    """Grasps at eighths of the edges, corners among them: inside here iff inside there."""
    graph = choice.build(polygon, friction)
    eighths = np.random.default_rng(rng.randrange(100))
    for move in (moved(polygon, MIRROR, first=1), moved(polygon, QUARTER, first=1)):
        other = choice.build(move.polygon, move.friction(friction))
        number = numbers_in(graph, other, move.edge)
        for k, (family, image) in enumerate(
            zip(graph.sets.families, other.sets.families, strict=True)
        ):
            low, high = graph.sets.offsets[k : k + 2]
            there = image.functions.take(number[low:high] - other.sets.offsets[k])
            f = eighths.integers(0, 9, family.functions.edges.shape) / 8
            g = 1 - f if move.turned else f
            order = np.argsort(move.edge[family.functions.edges], axis=1, kind="stable")
            g = np.take_along_axis(g, order, axis=1)
            np.testing.assert_array_equal(family.functions.contain(f), there.contain(g))
            check_margins(family.functions.margins(f), there.margins(g), polygon, LITTLE)


def size(polygon: Polygon, friction: Friction, choice: Choice, rng: Random) -> None:
    power = rng.choice([-30, -17, -1, 1, 13, 30])
    check_every_bit(polygon, friction, choice, moved(polygon, of_size(power)))


def place(polygon: Polygon, friction: Friction, choice: Choice, rng: Random) -> None:
    shift = rng.choice([(2.0**30, -(2.0**30)), (2.0**20, 3.0), (-0.5, 2.0**24)])
    check_every_bit(polygon, friction, choice, moved(polygon, shift=shift))


def candidates(polygon: Polygon, friction: Friction, choice: Choice, rng: Random) -> None:
    original, graph = vertices.candidate_functions, choice.build(polygon, friction)
    shuffle = np.random.default_rng(rng.randrange(100))

    def shuffled(cones: Cones, kind: str) -> tuple[TorqueFunctions, np.ndarray]:
        functions, centers = original(cones, kind)
        order = shuffle.permutation(len(functions))
        return functions.take(order), centers[order]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(vertices, "candidate_functions", shuffled)
        check_same(graph, choice.build(polygon, friction))


def solver(polygon: Polygon, friction: Friction, choice: Choice, rng: Random) -> None:
    check_same(*(choice.build(polygon, friction, solver=s) for s in ("clarabel", "highs")))


def batches(polygon: Polygon, friction: Friction, choice: Choice, rng: Random) -> None:
    graph = choice.build(polygon, friction)
    with batches_of(rng.choice([1, 7])) as changed:
        assert changed >= 5
        check_same(graph, choice.build(polygon, friction))


BATCHES = ("_CHUNK", "_STACK", "_ROUND", "_CHUNK_ENTRIES")


@contextmanager
def batches_of(size: int) -> Iterator[int]:
    """All constants that say how much is done at a time, set to a small number."""
    with pytest.MonkeyPatch.context() as patch:
        changed = 0
        for name, module in list(sys.modules.items()):
            for constant in BATCHES:
                if name.startswith("regrasp_lp") and isinstance(vars(module).get(constant), int):
                    patch.setattr(module, constant, size)
                    changed += 1
        yield changed


# --- presolve -----------------------------------------------------------------------------------


def check_presolve(polygon: Polygon, friction: Friction, choice: Choice, solver: str) -> int:
    """Signs and LPs agree but for margins that an LP cannot tell from nothing; counts these."""
    exact = choice.build(polygon, friction, solver=solver)
    by_lp = choice.build(polygon, friction, solver=solver, presolve=False)
    mine, theirs = keys(exact), keys(by_lp)
    assert set(theirs) <= set(mine)
    barely = GAP * polygon.diameter
    where = {key: number for number, key in enumerate(mine)}
    number = np.array([where[key] for key in theirs], dtype=np.intp)
    missing = np.setdiff1d(np.arange(len(mine)), number)
    assert (exact.sets.margins[missing] <= barely).all()
    check_margins(exact.sets.margins[number], by_lp.sets.margins, polygon, MUCH)
    here = switches(exact, np.arange(len(exact)))
    here = here[np.isin(here[:, 0], number) & np.isin(here[:, 1], number)]
    there = {tuple(row) for row in switches(by_lp, number).tolist()}
    both = {tuple(row) for row in here.tolist()}
    less = {(i, j): held for i, j, held in there}
    for i, j, held in both ^ there:
        # more contacts are held by exact decisions, where the last of them makes no margin
        assert (i, j, held) in both or any((i, j, more) in both for more in range(held + 1, 4))
        if (i, j, held) in both and i < j:
            assert held > less.get((i, j), -1)
            assert switch_margin(exact, i, j, held) <= barely
    return len(missing) + len(both ^ there)


def check_presolve_of_sets(
    polygon: Polygon, friction: Friction, choice: Choice, solver: str
) -> None:
    cones, backend = Cones.of(polygon, friction), get_solver(solver)
    for kind in vertices.kinds_of(choice.sets):
        margins = []
        for presolve in (True, False):
            family = vertices.build_family(cones, kind, backend, presolve=presolve)
            of_sets = np.column_stack((family.functions.edges, family.centers)).tolist()
            margins.append(dict(zip(map(tuple, of_sets), family.margins, strict=True)))
        exact, by_lp = margins
        assert set(by_lp) <= set(exact)
        both = [np.array([found[key] for key in by_lp]) for found in margins]
        check_margins(*both, polygon, MUCH)
        left_out = [margin for key, margin in exact.items() if key not in by_lp]
        assert max(left_out, default=0.0) <= GAP * polygon.diameter


def switch_margin(graph: SwitchingGraph, i: int, j: int, held: int) -> float:
    """The best margin of a switch, of the right rule."""
    found = handovers(graph.sets, get_solver("highs"), i, j, held)
    return max((h.margin for h in found), default=-np.inf)


def presolve(polygon: Polygon, friction: Friction, choice: Choice, rng: Random) -> None:
    """Switches of small objects only: they take an LP for each pair of pieces."""
    check = check_presolve if polygon.n_edges <= 8 else check_presolve_of_sets
    check(polygon, friction, choice, rng.choice(["clarabel", "highs"]))


def reference(polygon: Polygon, friction: Friction, choice: Choice, rng: Random) -> None:
    """The chapter's graph by plane geometry in whole numbers, which shares no code with this."""
    switching = "focus" if choice.switching == "focus" else "contact"
    graph = Choice("chapter", switching, 4).build(polygon, friction)
    expected = reference_graph(polygon, friction, switching)
    found = [(k[0], tuple(k[1:-1]), k[-1]) for k in keys(graph)]
    assert sorted(found) == sorted(expected.vertices)
    pairs = {frozenset((found[i], found[j])) for i in range(len(graph)) for j in graph.neighbors(i)}
    assert pairs == expected.named()
    assert graph.n_switches == len(expected.pairs)


LAWS = [first_vertex, mirrored, turned, membership, size, place, candidates, solver]


# --- random polygons of all families ------------------------------------------------------------


@st.composite
def problems(draw: st.DrawFn, family: str) -> tuple[Polygon, Friction, Choice, Random]:
    polygon = draw(FAMILIES[family])
    rng = Random(draw(st.integers(0, 1000)))
    return polygon, draw(frictions(polygon.n_edges)), draw(st.sampled_from(CHOICES)), rng


@pytest.mark.parametrize(
    ("law", "family"), covering(LAWS, FAMILIES), ids=lambda value: getattr(value, "__name__", None)
)
@settings(max_examples=3)
@given(data=st.data())
def test_what_changes_nothing_for_random_polygons(
    law: Law, family: str, data: st.DataObject
) -> None:
    law(*data.draw(problems(family)))


@pytest.mark.parametrize(
    ("law", "family"),
    covering([batches, presolve, reference], FAMILIES),
    ids=lambda value: getattr(value, "__name__", None),
)
@settings(max_examples=1)
@given(data=st.data())
def test_what_takes_long_and_changes_nothing(law: Law, family: str, data: st.DataObject) -> None:
    law(*data.draw(problems(family)))


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("law", [*LAWS, batches, presolve, reference], ids=lambda law: law.__name__)
@settings(max_examples=40)
@given(data=st.data())
def test_much_more_of_the_same(law: Law, family: str, data: st.DataObject) -> None:
    law(*data.draw(problems(family)))


# --- exactly critical objects -------------------------------------------------------------------


CRITICAL_CASES: dict[str, tuple[Polygon, Friction]] = {
    "square, opposite rays": (rectangle(1, 1), 1.0),
    "rectangle, opposite rays": (rectangle(), 1.0),
    "rectangle, rays through corners": (rectangle(), 0.5),
    "rectangle, two frictions": (rectangle(), [1.0, 0.5, 2.0, 1.0]),
    "ell": (ell(), 1.0),
    "comb": (comb(2), 0.5),
    "staircase": (staircase(1, 4), 1.0),
    "frame": (LATTICE["frame"], 1.0),
    "collinear runs": (LATTICE["collinear"], 0.5),
    "octagon": (LATTICE["hexagon"], 1.0),
    "lattice star": (lattice_star(8, 3), 1.0),
    "lattice star, chapter's limit": (lattice_star(7, 1), 0.5),
    "nearly parallel": (GENERAL["nearly_parallel"], 1.0),
    "needle": (GENERAL["needle"], 0.1),
    "thin": (GENERAL["thin"], 3.0),
    **{
        f"regular {n}-gon, {k}/{n} of a half turn": (regular(n), float(np.tan(k * np.pi / n / 2)))
        for n, k in ((3, 1), (3, 2), (4, 1), (5, 1), (5, 2), (6, 1), (6, 2), (6, 3), (8, 2), (8, 4))
    },
}


@pytest.mark.parametrize("case", CRITICAL_CASES)
def test_what_changes_nothing_for_critical_objects(case: str) -> None:
    polygon, friction = CRITICAL_CASES[case]
    for choice in FOUR:
        every = [
            moved(polygon, first=1),
            moved(polygon, QUARTER, first=polygon.n_edges - 1, turn_rings=True),
            moved(polygon, DIAGONAL, first=1),
        ]
        check_moved(polygon, friction, choice, every)


@pytest.mark.slow
@pytest.mark.parametrize("case", CRITICAL_CASES)
def test_more_that_changes_nothing_for_critical_objects(case: str) -> None:
    for choice in CHOICES:
        for law in (mirrored, membership, size, candidates, solver, batches, reference):
            law(*CRITICAL_CASES[case], choice, Random(0))


@pytest.mark.slow
@pytest.mark.parametrize("case", CRITICAL_CASES)
def test_presolve_and_solver_agree_on_critical_objects(case: str) -> None:
    for choice in CHOICES:
        for name in ("clarabel", "highs"):
            check_presolve(*CRITICAL_CASES[case], choice, name)


def test_a_square_is_a_square_in_any_unit() -> None:
    """Also where the unit is no power of 2: its coordinates are still exact."""
    graph = Choice().build(rectangle(1, 1), 1.0)
    for side in (2.0**-30, 0.1, 3.0, 1e9 / 3, 2.0**30):
        other = Choice().build(rectangle(side, side), 1.0)
        check_same(graph, other, scale=side)


# --- the tests themselves -----------------------------------------------------------------------


def test_a_wrong_numbering_would_be_seen() -> None:
    polygon, friction = lattice_star(8, 3), [1.0, 0.5, 1.0, 0.25, 1.0, 2.0, 1.0, 1.0]
    graph = Choice().build(polygon, friction)
    move = moved(polygon, first=1)
    other = Choice().build(move.polygon, move.friction(friction))
    check_same(graph, other, move.edge)
    with pytest.raises(AssertionError, match="only in the one"):
        check_same(graph, other)
    with pytest.raises(AssertionError):
        check_same(graph, Choice().build(move.polygon, friction), move.edge)


def test_a_missing_switch_and_a_wrong_margin_would_be_seen() -> None:
    polygon = lattice_star(7, 1)
    graph, other = (Choice().build(polygon, 0.5) for _ in range(2))
    assert check_same(graph, other) == 0
    other.switches.held[other.switches.held == 2] = 1
    with pytest.raises(AssertionError):
        check_same(graph, other)
    other = Choice().build(polygon, 0.5)
    other.sets.families[1].margins[0] *= 1 + 2 * MARGIN
    with pytest.raises(AssertionError):
        check_same(graph, other)
    with pytest.raises(AssertionError):
        check_same(graph, Choice(fingers=5).build(polygon, 0.5))


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=20)
@given(data=st.data())
def test_families_can_be_moved_without_rounding(family: str, data: st.DataObject) -> None:
    polygon = data.draw(FAMILIES[family])
    far = moved(moved(polygon, shift=(2.0**30, -(2.0**30))).polygon, shift=(-(2.0**30), 2.0**30))
    np.testing.assert_array_equal(far.polygon.vertices, polygon.vertices)


# --- the corpus ---------------------------------------------------------------------------------


def problem_of(polygon: Polygon) -> tuple[Friction, Choice]:
    """Friction and options by the name: all of them occur, and large objects have small graphs."""
    rng = Random(polygon.name)
    if polygon.n_edges > 80:
        return 0.02, Choice("chapter", "contact")
    if polygon.n_edges > 25:
        return 0.1, rng.choice([Choice("chapter", "focus"), Choice("complete")])
    frictions = [[rng.choice(FRICTIONS) for _ in range(polygon.n_edges)], *FRICTIONS]
    return rng.choice(frictions), rng.choice(CHOICES)


def check_kinds(polygon: Polygon, friction: Friction, kinds: tuple[str, ...]) -> None:
    """Sets alone, of an object whose graph would take minutes."""
    for move in (moved(polygon), moved(polygon, MIRROR), moved(polygon, of_size(-30))):
        for kind in kinds:
            found = []
            for one, number in ((polygon, move.edge), (move.polygon, np.arange(polygon.n_edges))):
                cones = Cones.of(one, friction)
                family = vertices.build_family(cones, kind, get_solver("clarabel"))
                edges = np.sort(number[family.functions.edges], axis=1)
                order = np.lexsort((number[family.centers], *edges.T[::-1]))
                found.append((edges[order], family.margins[order]))
            np.testing.assert_array_equal(found[0][0], found[1][0])
            check_margins(found[0][1], found[1][1] / move.scale, polygon)


def check_corpus_polygon(polygon: Polygon) -> None:
    friction, choice = problem_of(polygon)
    rng = Random(polygon.name)
    if polygon.n_edges > 160:
        check_kinds(polygon, friction, ("two_finger", "parallel"))
        return
    few, others = (mirrored, size), (first_vertex, turned, membership, candidates, solver)
    for law in few if polygon.n_edges > 40 else few + others:
        law(polygon, friction, choice, rng)
    rounded = on_a_grid(polygon)
    if rounded is not None:
        place(rounded, friction, choice, rng)


def on_a_grid(polygon: Polygon) -> Polygon | None:
    """The polygon with coordinates of few bits, from 0 to 2; None if that makes it none."""
    unit = 2.0 ** (np.ceil(np.log2(polygon.diameter)) - 21)
    corner = polygon.bounds[:2]
    rings = [np.round((ring - corner) / unit) * 2.0**-20 for ring in polygon.rings]
    try:
        return Polygon(rings[0], holes=rings[1:], name=polygon.name)
    except PolygonError:
        return None


def test_what_changes_nothing_for_some_real_outlines(corpus: list[Polygon]) -> None:
    some = [p for p in corpus if p.n_edges <= 12][::12]
    assert len(some) >= 4
    for polygon in some:
        check_corpus_polygon(polygon)


@pytest.mark.slow
def test_what_changes_nothing_for_all_real_outlines(corpus: list[Polygon]) -> None:
    for polygon in corpus:
        check_corpus_polygon(polygon)
    assert sum(on_a_grid(p) is None for p in corpus) <= len(corpus) // 20


@pytest.mark.slow
def test_presolve_and_solver_agree_on_real_outlines(corpus: list[Polygon]) -> None:
    for polygon in (p for p in corpus if p.n_edges <= 160):
        friction, choice = problem_of(polygon)
        check = check_presolve if polygon.n_edges <= 10 else check_presolve_of_sets
        check(polygon, friction, choice, "clarabel")
