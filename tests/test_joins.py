"""The best way to switch between two sets, by linear programs on joined pieces."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from conftest import covering
from geometry import comb, lattice_star, rectangle, regular, star

from regrasp_lp import joins as module
from regrasp_lp.force_closure import is_force_closure
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.pieces import piece_sets
from regrasp_lp.grasp_sets.vertices import candidate_functions, kinds_of
from regrasp_lp.joins import Joins, best_joins
from regrasp_lp.lp import get_solver, maximise_margins
from regrasp_lp.margins import best_pieces, existing_pieces
from regrasp_lp.polygon import Polygon
from regrasp_lp.shadows import Shadows, shadows
from regrasp_lp.switching import meet

CLARABEL, HIGHS = get_solver("clarabel"), get_solver("highs")
CASES = {
    "star": (star(8, 1), 0.4),
    "comb": (comb(2), 0.25),
    "lattice star": (lattice_star(8, 3), 0.5),
    "rectangle": (rectangle(), 1.0),
    "regular": (regular(7), 0.3),
    "rough": (star(7, 0), 2.0),
}


def pairs(case: str, sets: str, held: int, most: int = 60) -> tuple[Shadows, Shadows]:
    polygon, mu = CASES[case]
    cones = Cones.of(polygon, mu)
    stacks = []
    for kind in kinds_of(sets):
        functions, _ = candidate_functions(cones, kind)
        stacks.append(functions.take(functions.exists()))
    stack = shadows(stacks, held)
    edges = stack.edges
    found = [
        (i, j)
        for i, j in combinations(range(len(stack)), 2)
        if (edges[i] == edges[j]).all()
        and (stack.source[i], stack.row[i]) != (stack.source[j], stack.row[j])
    ]
    chosen = np.random.default_rng(held).permutation(len(found))[:most]
    rows = np.array(found, dtype=np.intp).reshape(-1, 2)[np.sort(chosen)]
    return stack.take(rows[:, 0]), stack.take(rows[:, 1])


def edges_of(shadow: Shadows, index: int) -> np.ndarray:
    return shadow.sources[shadow.source[index]].edges[shadow.row[index]]


def assert_grasps(polygon: Polygon, mu: float, first: Shadows, second: Shadows, joins: Joins):
    """Equal in the held contacts, both in force closure, with the margin that is stated."""
    size = polygon.diameter
    for n in np.flatnonzero(joins.exist):
        worst = np.inf
        for shadow, fractions in ((first, joins.first), (second, joins.second)):
            edges = edges_of(shadow, n)
            m = len(edges)
            at = fractions[n, :m]
            assert np.isnan(fractions[n, m:]).all()
            assert ((at >= 0) & (at <= 1)).all()
            assert is_force_closure(polygon, friction=mu, edges=edges[None], fractions=at[None])[0]
            functions = shadow.sources[shadow.source[n]].take(shadow.row[n : n + 1])
            worst = min(worst, functions.margins(at[None])[0])
        np.testing.assert_array_equal(
            joins.first[n, first.slots[n]], joins.second[n, second.slots[n]]
        )
        assert worst >= joins.margins[n] - 1e-12 * size
        assert joins.margins[n] > 0


@pytest.mark.parametrize(("case", "sets", "held"), covering(CASES, ["complete", "chapter"], [1, 2]))
def test_joins_are_grasps_and_solvers_agree(case: str, sets: str, held: int) -> None:
    polygon, mu = CASES[case]
    first, second = pairs(case, sets, held)
    results = [best_joins(first, second, solver) for solver in (CLARABEL, HIGHS)]
    for joins in results:
        assert_grasps(polygon, mu, first, second, joins)
        np.testing.assert_array_equal(joins.exist, meet(first, second).exist)
    np.testing.assert_allclose(results[0].margins, results[1].margins, atol=1e-8 * polygon.diameter)


@pytest.mark.parametrize(
    ("case", "apart"), covering(["star", "lattice star", "rectangle"], [0.0, 2.0])
)
def test_pruning_by_bounds_equals_all_pairs_of_pieces(case: str, apart: float) -> None:
    polygon, _ = CASES[case]
    first, second = pairs(case, "complete", 2, most=12)
    joins = best_joins(first, second, HIGHS, apart=apart)
    for n in range(len(first)):
        one, other = (s.sources[s.source[n]].take(s.row[n : n + 1]) for s in (first, second))
        best = -np.inf
        rows = [(p, q) for p in existing_pieces(one) for q in existing_pieces(other)]
        mine = [f"a{i}" for i in range(one.m)]
        theirs = [f"b{i}" for i in range(other.m)]
        for i, j in zip(first.slots[n], second.slots[n], strict=True):
            theirs[j] = mine[i]
        left = piece_sets(one, np.array([p for p, _ in rows]), mine, apart=apart)
        right = piece_sets(other, np.array([q for _, q in rows]), theirs, apart=apart)
        joined = left.join(right, [mine[i] for i in first.slots[n]])
        best = maximise_margins(joined, CLARABEL).margins.max()
        assert joins.margins[n] == pytest.approx(best, abs=1e-8 * polygon.diameter)
        if joins.margins[n] > 0:
            points = np.concatenate((joins.first[n, : one.m], joins.second[n, : other.m]))
            names = mine + theirs
            at = np.array([points[names.index(name)] for name in joined.names])
            attained = joined.margins(at).max()
            assert attained == pytest.approx(best, abs=1e-8 * polygon.diameter)


def test_rounds_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = pairs("star", "complete", 2, most=20)
    expected = best_joins(first, second, HIGHS)
    for size in (1, 1000):
        monkeypatch.setattr(module, "_ROUND", size)
        np.testing.assert_allclose(
            best_joins(first, second, HIGHS).margins, expected.margins, atol=1e-9
        )


@pytest.mark.parametrize("case", ["star", "comb"])
def test_margins_do_not_exceed_those_of_the_sets(case: str) -> None:
    first, second = pairs(case, "complete", 1)
    joins = best_joins(first, second, CLARABEL)
    for shadow in (first, second):
        for n in range(len(shadow)):
            functions = shadow.sources[shadow.source[n]].take(shadow.row[n : n + 1])
            assert joins.margins[n] <= best_pieces(functions)[0][0] + 1e-9


def test_holding_more_does_not_help() -> None:
    polygon, mu = CASES["lattice star"]
    cones = Cones.of(polygon, mu)
    functions, _ = candidate_functions(cones, "three_finger")
    functions = functions.take(functions.exists())
    two = shadows([functions], 2)
    for i, j in list(combinations(range(len(two)), 2))[:400]:
        if two.row[i] == two.row[j] or (two.edges[i] != two.edges[j]).any():
            continue
        pair = two.take(np.array([i])), two.take(np.array([j]))
        both = best_joins(*pair, HIGHS).margins[0]
        for slot in (0, 1):
            fewer = [
                Shadows(
                    s.sources,
                    s.source,
                    s.row,
                    s.slots[:, [slot]],
                    s.low,
                    s.high,
                    s.slopes[:, :, [slot]],
                    s.errors,
                    s.valid,
                )
                for s in pair
            ]
            assert best_joins(*fewer, HIGHS).margins[0] >= both - 1e-8


def test_two_contacts_on_one_edge_can_be_kept_apart() -> None:
    polygon = rectangle()
    functions, _ = candidate_functions(Cones.of(polygon, 0.5), "three_finger")
    functions = functions.take(functions.exists())
    stack = shadows([functions], 2, ordered=True)
    repeated = (np.diff(functions.edges, axis=1) == 0).any(axis=1)
    rows = [
        (i, j)
        for i, j in combinations(range(len(stack)), 2)
        if stack.row[i] != stack.row[j]
        and (stack.edges[i] == stack.edges[j]).all()
        and (repeated[stack.row[i]] or repeated[stack.row[j]])
    ]
    first, second = (stack.take(np.array(r)) for r in zip(*rows, strict=True))
    joins = best_joins(first, second, CLARABEL, apart=2.0)
    together = best_joins(first, second, CLARABEL)
    assert (joins.margins <= together.margins + 1e-9).all()
    assert (joins.margins < together.margins - 1e-6).any()
    assert joins.exist.any()
    assert_grasps(polygon, 0.5, first, second, joins)
    checked = 0
    for n in np.flatnonzero(joins.exist):
        for shadow, fractions in ((first, joins.first), (second, joins.second)):
            edges = edges_of(shadow, n)
            for i in range(len(edges) - 1):
                if edges[i] == edges[i + 1]:
                    gap = (fractions[n, i + 1] - fractions[n, i]) * polygon.edge_lengths[edges[i]]
                    assert gap >= 2 * joins.margins[n] - 1e-9
                    checked += 1
    assert checked > 0


def test_nothing_to_join() -> None:
    first, second = pairs("star", "complete", 1)
    none = np.zeros(0, dtype=np.intp)
    joins = best_joins(first.take(none), second.take(none), CLARABEL)
    assert joins.margins.shape == (0,)
    assert joins.first.shape == (0, 3)


def test_sets_without_pieces_are_not_joined() -> None:
    """Candidates that do not exist: no piece of theirs has a margin."""
    cones = Cones.of(star(13, 3), 0.6)
    functions, _ = candidate_functions(cones, "two_finger")
    empty = functions.take(~functions.exists())
    full = functions.take(functions.exists())
    assert len(empty) > 0
    stack = shadows([empty, full], 1)
    first = stack.take(np.flatnonzero(stack.source == 0))
    joins = best_joins(first, first, CLARABEL)
    assert np.isneginf(joins.margins).all()
    assert not joins.exist.any()
    assert np.isnan(joins.first).all()
