"""Projections, the exact switching test and the pairs of sets, against three other deciders.

The oracles: samples of grasps in exact force closure (wrenches), elimination in integers
(Fourier and Motzkin) and margin LPs on joined pieces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, partial
from itertools import combinations, permutations

import numpy as np
import pytest
from conftest import covering
from fourier_motzkin import box, intersect, pieces, row, solvable, widen
from geometry import (
    LATTICE,
    comb,
    lattice_star,
    rectangle,
    regular,
    staircase,
    star,
    unit_square,
    with_collinear_runs,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from regrasp_lp import switching
from regrasp_lp.completion import complete
from regrasp_lp.contact_rule import meet_by_lp, meet_held
from regrasp_lp.force_closure import is_force_closure
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.vertices import candidate_functions, kinds_of
from regrasp_lp.joins import best_joins
from regrasp_lp.lp import get_solver
from regrasp_lp.planning.hand import Hand
from regrasp_lp.polygon import Polygon
from regrasp_lp.shadows import Shadows, places_of, shadows
from regrasp_lp.switches import StoredSwitches, SwitchesOnDemand, SwitchPairs, SwitchRule
from regrasp_lp.switching import Meeting, meet
from regrasp_lp.torque import TorqueFunctions

CASES = {
    "comb, touching": (comb(3), 0.5),
    "comb, slippery": (comb(2), 0.125),
    "staircase, touching": (staircase(1, 6), 0.5),
    "staircase, slippery": (staircase(4, 6), 0.25),
    "lattice star": (lattice_star(10, 2), 0.125),
    "lattice star, touching": (lattice_star(8, 3), 1.0),
    "collinear runs, touching": (with_collinear_runs(), 0.5),
    "frame": (LATTICE["frame"], 1.0),
    "square, opposite rays": (unit_square(), 1.0),
    "rectangle, opposite rays": (rectangle(), 1.0),
    "regular hexagon": (regular(6), 1.0),
    "regular 12-gon": (regular(12), 1.0),
    "star": (star(14, 3), 0.125),
    "star, rough": (star(7, 0), 1.0),
    "friction per edge": (star(8, 2), (0.125, 2.0, 0.25, 0.5, 1.0, 0.125, 0.5, 0.75)),
}
GRID = 9


def can_meet(first: Shadows, second: Shadows) -> np.ndarray:
    return meet(first, second).exist


@dataclass(frozen=True)
class Pairs:
    """All pairs of projections of different sets on the same edges."""

    first: Shadows
    second: Shadows
    answer: np.ndarray


@cache
def sources(case: str, sets: str) -> tuple[TorqueFunctions, ...]:
    polygon, friction = CASES[case]
    return existing(Cones.of(polygon, friction), sets)


def existing(cones: Cones, sets: str) -> tuple[TorqueFunctions, ...]:
    stacks = []
    for kind in kinds_of(sets):
        functions, _ = candidate_functions(cones, kind)
        stacks.append(functions.take(functions.exists()))
    return tuple(stacks)


def pairs_within(stack: Shadows, seed: int = 0, most: int = 4000) -> Pairs:
    """Pairs of projections of different sets on equal edges, found by a dictionary."""
    groups: dict[tuple[int, ...], list[int]] = {}
    for number, edges in enumerate(stack.edges.tolist()):
        groups.setdefault(tuple(edges), []).append(number)
    found = [pair for group in groups.values() for pair in combinations(group, 2)]
    rows = np.array(found, dtype=np.intp).reshape(-1, 2)
    same_set = (stack.source[rows[:, 0]] == stack.source[rows[:, 1]]) & (
        stack.row[rows[:, 0]] == stack.row[rows[:, 1]]
    )
    rows = rows[~same_set]
    answer = can_meet(stack.take(rows[:, 0]), stack.take(rows[:, 1]))
    # Most answers are yes: keep all the others, and some of these.
    keep = np.flatnonzero(answer)
    keep = np.random.default_rng(seed).permutation(keep)[: max(0, most - (~answer).sum())]
    rows = rows[np.sort(np.concatenate((keep, np.flatnonzero(~answer)[:most])))]
    first, second = stack.take(rows[:, 0]), stack.take(rows[:, 1])
    return Pairs(first, second, can_meet(first, second))


@cache
def pairs_of(case: str, sets: str, held: int) -> Pairs:
    return pairs_within(shadows(sources(case, sets), held))


def functions_of(shadow: Shadows, index: int) -> list[list[Fraction]]:
    """The exact functions of the set behind a projection."""
    constant, slopes = shadow.sources[shadow.source[index]].exact_coefficients(
        int(shadow.row[index])
    )
    return [[c, *s] for c, s in zip(constant, slopes, strict=True)]


def joined_exactly(first: Shadows, second: Shadows, index: int) -> bool:
    """Whether two sets have grasps that agree in the held contacts: full coordinates, integers."""
    m, others = (s.sources[s.source[index]].m for s in (first, second))
    places = list(range(m, m + others))
    for one, other in zip(first.slots[index], second.slots[index], strict=True):
        places[other] = int(one)
    order = sorted(set(range(m)) | set(places))
    n = len(order)
    one = pieces(widen(functions_of(first, index), [order.index(i) for i in range(m)], n))
    other = pieces(widen(functions_of(second, index), [order.index(i) for i in places], n))
    return intersect(one, other, n)


# --- projections --------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ["comb, slippery", "star", "friction per edge", "lattice star"])
@pytest.mark.parametrize("held", [1, 2, 3])
def test_a_point_is_in_a_projection_iff_the_others_can_complete_it(case: str, held: int) -> None:
    rng = np.random.default_rng(held)
    stack = shadows(sources(case, "complete"), held)
    chosen = rng.choice(len(stack), 40)
    seen = set()
    for index in chosen:
        x = [Fraction(int(k), 8) for k in rng.integers(0, 9, held)]
        below, above = stack.exact(int(index))
        value_below = [c + sum(a * v for a, v in zip(s, x, strict=True)) for c, *s in below]
        value_above = [c + sum(a * v for a, v in zip(s, x, strict=True)) for c, *s in above]
        inside = min(value_below) < 0 < max(value_above)
        functions = functions_of(stack, int(index))
        m = len(functions[0]) - 1
        fixed = []
        for slot, v in zip(stack.slots[index], x, strict=True):
            unit = [0] * m
            unit[slot] = 1
            fixed.append(row([-v, *unit], strict=False))
            fixed.append(row([v, *(-u for u in unit)], strict=False))
        completed = any(solvable(p + fixed + box(m)) for p in pieces(functions))
        assert inside == completed
        seen.add(inside)
    assert seen == {True, False}


@pytest.mark.parametrize("case", ["comb, touching", "regular hexagon", "friction per edge"])
@pytest.mark.parametrize("sets", ["complete", "chapter"])
@pytest.mark.parametrize("held", [1, 2])
def test_projections_in_floating_point_are_within_their_error_bounds(
    case: str, sets: str, held: int
) -> None:
    """The exact functions are known up to a factor: compare after scaling by the largest slope."""
    stack = shadows(sources(case, sets), held)
    rng = np.random.default_rng(0)
    compared = 0
    for index in rng.choice(len(stack), 30):
        below, above = stack.exact(int(index))
        valid = np.flatnonzero(stack.valid[index])
        assert len(below) == len(above) == len(valid)
        for j, low, high in zip(valid, below, above, strict=True):
            of_all = functions_of(stack, int(index))[list(valid).index(j)]
            source = stack.sources[stack.source[index]]
            factor = sum(source.slopes[stack.row[index], j]) / float(sum(of_all[1:]))
            error = 2 * stack.errors[index, j]
            assert abs(float(low[0]) * factor - stack.low[index, j]) <= error
            assert abs(float(high[0]) * factor - stack.high[index, j]) <= error
            slopes = np.array([float(a) * factor for a in low[1:]])
            assert np.abs(slopes - stack.slopes[index, j]).max() <= error
            assert low[1:] == high[1:]
            compared += 1
    assert compared > 50


def test_choices_that_differ_by_exchanging_contacts_on_one_edge_are_one() -> None:
    functions = sources("square, opposite rays", "complete")[1]
    twice = (functions.edges[:, 0] == functions.edges[:, 1]).sum()
    twice += (functions.edges[:, 1] == functions.edges[:, 2]).sum()
    assert 0 < twice < len(functions)
    for held in (1, 2):
        assert len(shadows([functions], held, ordered=True)) == 3 * len(functions)
        assert len(shadows([functions], held)) == 3 * len(functions) - twice
        stack = shadows([functions], held)
        key = np.column_stack((stack.row, stack.edges))
        assert len(np.unique(key, axis=0)) == len(stack)
    assert len(shadows([functions], 3)) == len(functions)


def test_projections_of_chosen_sets_and_of_none() -> None:
    stacks = sources("frame", "complete")
    everything = shadows(stacks, 2)
    some = shadows(stacks, 2, rows=[np.array([3]), np.array([5, 2])])
    wanted = [(0, 3), (1, 5), (1, 2)]
    keys = list(zip(everything.source.tolist(), everything.row.tolist(), strict=True))
    assert len(some) == sum(keys.count(key) for key in wanted)
    for index in range(len(some)):
        same = [
            i
            for i, key in enumerate(keys)
            if key == (some.source[index], some.row[index])
            and (everything.slots[i] == some.slots[index]).all()
        ]
        assert len(same) == 1
        np.testing.assert_array_equal(some.low[index], everything.low[same[0]])
        np.testing.assert_array_equal(some.high[index], everything.high[same[0]])
    nothing = shadows(stacks, 2, rows=[np.zeros(0, dtype=np.intp)] * 2)
    assert len(nothing) == 0
    assert nothing.edges.shape == (0, 2)
    assert can_meet(nothing, nothing).shape == (0,)


def test_sets_with_fewer_contacts_than_held_have_no_projection() -> None:
    stacks = sources("frame", "complete")
    assert (shadows(stacks, 3).source == 1).all()


# --- the decision on synthetic projections: every degeneracy ------------------------------------


@dataclass(frozen=True, eq=False)
class Synthetic(Shadows):
    """Projections given by their functions, with exact values of the doubles themselves."""

    def take(self, rows: np.ndarray) -> Synthetic:
        return Synthetic(**{**vars(Shadows.take(self, rows))})

    def exact(self, index: int) -> tuple[list[list[Fraction]], list[list[Fraction]]]:
        def rows(constant: np.ndarray) -> list[list[Fraction]]:
            return [
                [Fraction(float(c)), *(Fraction(float(a)) for a in slopes)]
                for c, slopes, valid in zip(
                    constant[index], self.slopes[index], self.valid[index], strict=True
                )
                if valid
            ]

        return rows(self.low), rows(self.high)


def synthetic(low: np.ndarray, lift: np.ndarray, slopes: np.ndarray) -> Synthetic:
    n, j, held = slopes.shape
    high = low + lift
    size = np.abs(low) + lift + slopes.sum(axis=2)
    return Synthetic(
        (),
        np.zeros(n, dtype=np.intp),
        np.arange(n),
        np.tile(np.arange(held), (n, 1)),
        low,
        high,
        slopes,
        64 * 2.0**-53 * size,
        np.ones((n, j), dtype=bool),
    )


def synthetic_pairs(seed: int, n: int, held: int) -> tuple[Synthetic, Synthetic]:
    """Small integers, so that ends meet; some values are off by one unit in the last place.

    As with grasp sets, nowhere do all functions vanish at once: the first one has a lift.
    """
    rng = np.random.default_rng([seed, held])
    result = []
    for _ in range(2):
        low = rng.integers(-4, 3, (n, 2)).astype(float)
        lift = rng.integers([1, 0], 3, (n, 2)).astype(float)
        slopes = rng.integers(0, 4, (n, 2, held)).astype(float)
        shaken = rng.random(n) < 0.3
        direction = rng.choice([-1, 1], (n, 2))
        low = np.where(shaken[:, None], np.nextafter(low, low + direction), low)
        slopes = np.where(shaken[:, None, None] & (slopes > 0), np.nextafter(slopes, 0.0), slopes)
        result.append(synthetic(low, lift, slopes))
    return result[0], result[1]


def projections_meet(first: Shadows, second: Shadows, index: int) -> bool:
    """Whether two projections have a common point, by elimination."""

    def rows_of(shadow: Shadows) -> Iterator[list[tuple[tuple[int, ...], bool]]]:
        below, above = shadow.exact(index)
        for low in below:
            for high in above:
                yield [row(low, strict=True), row([-v for v in high], strict=True)]

    return intersect(list(rows_of(first)), list(rows_of(second)), first.held)


@pytest.mark.parametrize("held", [1, 2])
def test_synthetic_projections_against_elimination(held: int) -> None:
    first, second = synthetic_pairs(1, 700, held)
    answer = can_meet(first, second)
    expected = [projections_meet(first, second, i) for i in range(len(first))]
    np.testing.assert_array_equal(answer, expected)
    assert 0.2 < np.mean(expected) < 0.9


@pytest.mark.slow
@pytest.mark.parametrize("held", [1, 2])
def test_many_synthetic_projections_against_elimination(held: int) -> None:
    first, second = synthetic_pairs(2, 20_000, held)
    expected = [projections_meet(first, second, i) for i in range(len(first))]
    np.testing.assert_array_equal(can_meet(first, second), expected)


@pytest.mark.parametrize("held", [1, 2])
def test_the_filter_agrees_with_rational_numbers_on_synthetic_projections(held: int) -> None:
    first, second = synthetic_pairs(3, 3_000, held)
    exact = switching.exact_one_held if held == 1 else switching.exact_two_held
    points = [exact(first.exact(i), second.exact(i)) for i in range(len(first))]
    expected = [point is not None for point in points]
    found = meet(first, second)
    np.testing.assert_array_equal(found.exist, expected)
    np.testing.assert_array_equal(can_meet(second, first), expected)
    for i in np.flatnonzero(expected).tolist():
        assert all(0 <= x <= 1 and completes(first, second, i, points[i]) for x in points[i])
        inside = completes(first, second, i, [Fraction(x) for x in found.points[i]])
        assert inside or found.exactly[i]  # some are too thin for doubles
    assert np.isnan(found.points[~found.exist]).all()


def completes(first: Shadows, second: Shadows, index: int, point: Sequence[Fraction]) -> bool:
    """Whether held positions can be completed in both sets, in rational numbers."""

    def value(function: list[Fraction]) -> Fraction:
        return function[0] + sum(s * x for s, x in zip(function[1:], point, strict=True))

    return all(
        min(map(value, below)) < 0 < max(map(value, above))
        for below, above in (first.exact(index), second.exact(index))
    )


small = st.integers(-4, 4)
rising = st.integers(0, 3)


def exact_shadows(held: int) -> st.SearchStrategy:
    """Up to three functions, not all of them without a lift."""
    function = st.tuples(small, rising, st.tuples(*[rising] * held))
    functions = st.lists(function, min_size=1, max_size=3)
    return functions.map(
        lambda given: (
            [[Fraction(c), *map(Fraction, s)] for c, _, s in given],
            [
                [Fraction(c + lift + (number == 0)), *map(Fraction, s)]
                for number, (c, lift, s) in enumerate(given)
            ],
        )
    )


@settings(max_examples=150)
@given(exact_shadows(1), exact_shadows(1))
def test_one_held_contact_in_rational_numbers(first: tuple, second: tuple) -> None:
    assert (switching.exact_one_held(first, second) is not None) == meets(first, second, 1)


@settings(max_examples=150)
@given(exact_shadows(2), exact_shadows(2))
def test_two_held_contacts_in_rational_numbers(first: tuple, second: tuple) -> None:
    assert (switching.exact_two_held(first, second) is not None) == meets(first, second, 2)


def meets(first: tuple, second: tuple, held: int) -> bool:
    def of(shadow: tuple) -> list:
        below, above = shadow
        return [
            [row(low, strict=True), row([-v for v in high], strict=True)]
            for low in below
            for high in above
        ]

    return intersect(of(first), of(second), held)


def interval(low: float, high: float) -> Synthetic:
    """One projection that is the open interval (low, high): functions x - low and x - high."""
    return synthetic(np.array([[-high, -low]]), np.zeros((1, 2)), np.ones((1, 2, 1)))


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ((0.0, 0.5), (0.5, 1.0), False),
        ((0.0, np.nextafter(0.5, 1)), (0.5, 1.0), True),
        ((0.0, 0.5), (np.nextafter(0.5, 0), 1.0), True),
        ((-1.0, 0.0), (-1.0, 1.0), False),  # ends where the edge begins
        ((-1.0, 5e-324), (-1.0, 1.0), True),
        ((1.0, 2.0), (0.0, 2.0), False),  # begins where the edge ends
        ((np.nextafter(1.0, 0), 2.0), (0.0, 2.0), True),
        ((-1.0, 2.0), (-1.0, 2.0), True),
    ],
)
def test_touching_intervals_do_not_meet(first: tuple, second: tuple, expected: bool) -> None:
    assert can_meet(interval(*first), interval(*second))[0] == expected
    assert can_meet(interval(*second), interval(*first))[0] == expected


# --- the decision on grasp sets -----------------------------------------------------------------


@pytest.mark.parametrize(("case", "sets", "held"), covering(CASES, ["complete", "chapter"], [1, 2]))
def test_the_filter_agrees_with_rational_numbers(case: str, sets: str, held: int) -> None:
    found = pairs_of(case, sets, held)
    rng = np.random.default_rng(0)
    no = np.flatnonzero(~found.answer)[:200]
    chosen = np.concatenate((no, rng.permutation(np.flatnonzero(found.answer))[:200]))
    exact = switching.exact_one_held if held == 1 else switching.exact_two_held
    for i in chosen:
        assert (exact(found.first.exact(i), found.second.exact(i)) is not None) == found.answer[i]


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("held", [1, 2])
def test_the_filter_agrees_with_rational_numbers_on_all_pairs(case: str, held: int) -> None:
    found = pairs_within(shadows(sources(case, "complete"), held), most=10**9)
    exact = switching.exact_one_held if held == 1 else switching.exact_two_held
    points = [exact(found.first.exact(i), found.second.exact(i)) for i in range(len(found.first))]
    np.testing.assert_array_equal(found.answer, [point is not None for point in points])


@pytest.mark.parametrize(
    ("case", "held"),
    [("comb, touching", 1), ("lattice star, touching", 1), ("staircase, touching", 2)],
)
def test_touching_projections_reach_the_rational_numbers(
    case: str, held: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = pairs_of(case, "complete", held)
    name = "exact_one_held" if held == 1 else "exact_two_held"
    original, answers = getattr(switching, name), []

    def counting(*both: tuple) -> tuple | None:
        answers.append(original(*both))
        return answers[-1]

    monkeypatch.setattr(switching, name, counting)
    np.testing.assert_array_equal(can_meet(found.first, found.second), found.answer)
    assert answers.count(None) > 3


@pytest.mark.parametrize(("case", "held"), covering(CASES, [1, 2]))
def test_switches_against_samples_and_linear_programs(case: str, held: int) -> None:
    """No sampled common contacts where the answer is no; where it is yes and no sample shows it,
    a linear program finds two grasps, exactly in force closure.
    """
    polygon, friction = CASES[case]
    found = pairs_of(case, "complete", held)
    shown = sampled(polygon, friction, found.first) & sampled(polygon, friction, found.second)
    shown = shown.any(axis=1)
    assert not (shown & ~found.answer).any()
    assert shown.any()
    unseen = np.flatnonzero(~shown)[:250]
    first, second = found.first.take(unseen), found.second.take(unseen)
    joins = best_joins(first, second, get_solver("clarabel"))
    yes, size = found.answer[unseen], polygon.diameter
    np.testing.assert_array_less(joins.margins[~yes], 1e-9 * size)
    assert (~joins.exist[~yes]).all()
    np.testing.assert_array_less(-1e-9 * size, joins.margins[yes])
    for shadow, fractions in ((first, joins.first), (second, joins.second)):
        for i in np.flatnonzero(yes & joins.exist):
            source = shadow.sources[shadow.source[i]]
            edges = source.edges[shadow.row[i]]
            assert is_force_closure(
                polygon,
                friction=friction,
                edges=edges[None],
                fractions=fractions[i, : source.m][None],
            )[0]
    for i in unseen[yes & ~joins.exist]:  # less than a solver can tell from nothing
        assert joined_exactly(found.first, found.second, int(i))


def sampled(polygon: Polygon, friction: float | tuple, shadow: Shadows) -> np.ndarray:
    """At which held positions of a grid some sampled grasp of the set is in force closure."""
    result = np.zeros((len(shadow), GRID**shadow.held), dtype=bool)
    for number, functions in enumerate(shadow.sources):
        mine = np.flatnonzero(shadow.source == number)
        if not mine.size:
            continue
        m = functions.m
        rows, place = np.unique(shadow.row[mine], return_inverse=True)
        grid = np.stack(np.meshgrid(*[np.linspace(0, 1, GRID)] * m, indexing="ij"), axis=-1)
        grid = grid.reshape(-1, m)
        edges = functions.edges[rows].repeat(len(grid), axis=0)
        inside = is_force_closure(
            polygon, friction=friction, edges=edges, fractions=np.tile(grid, (len(rows), 1))
        ).reshape(len(rows), *[GRID] * m)
        for index, one in zip(mine, place, strict=True):
            others = tuple(i for i in range(m) if i not in shadow.slots[index])
            result[index] = inside[one].any(axis=others).ravel()
    return result


@pytest.mark.parametrize(
    ("case", "sets"),
    covering(
        ["comb, slippery", "lattice star", "lattice star, touching", "star"],
        ["complete", "chapter"],
    ),
)
def test_switches_against_elimination_in_full_coordinates(case: str, sets: str) -> None:
    for held in (1, 2):
        found = pairs_of(case, sets, held)
        rng = np.random.default_rng(0)
        no = rng.permutation(np.flatnonzero(~found.answer))[:3]
        yes = rng.permutation(np.flatnonzero(found.answer))[:12]
        for i in np.concatenate((no, yes)):
            assert joined_exactly(found.first, found.second, int(i)) == found.answer[i]


@pytest.mark.parametrize("case", ["comb, touching", "regular 12-gon", "star"])
@pytest.mark.parametrize("held", [1, 2])
def test_exchanging_the_two_sets_changes_nothing(case: str, held: int) -> None:
    found = pairs_of(case, "complete", held)
    np.testing.assert_array_equal(can_meet(found.second, found.first), found.answer)


@pytest.mark.parametrize("held", [1, 2])
def test_a_set_can_switch_to_itself(held: int) -> None:
    stack = shadows(sources("star", "complete"), held)
    assert can_meet(stack, stack).all()


def test_many_pairs_in_chunks_are_decided_as_in_one(monkeypatch: pytest.MonkeyPatch) -> None:
    found = pairs_of("star", "complete", 1)
    monkeypatch.setattr(switching, "_CHUNK", 97)
    np.testing.assert_array_equal(can_meet(found.first, found.second), found.answer)


def test_with_friction_above_one_and_two_centres() -> None:
    """Two parallel sets of one triple: they share edges, and are a pair like any other."""
    polygon = star(7, 0)
    cones = Cones.of(polygon, 2.0)
    functions, centers = candidate_functions(cones, "parallel")
    exist = functions.exists()
    functions, centers = functions.take(exist), centers[exist]
    _, count = np.unique(functions.edges, axis=0, return_counts=True)
    assert count.max() > 1
    for held in (1, 2):
        found = pairs_within(shadows([functions], held), most=1500)
        same = (functions.edges[found.first.row] == functions.edges[found.second.row]).all(axis=1)
        assert same.any()
        joins = best_joins(
            found.first.take(np.flatnonzero(same)),
            found.second.take(np.flatnonzero(same)),
            get_solver("clarabel"),
        )
        np.testing.assert_array_equal(joins.exist, found.answer[same])


def test_all_three_contacts_held_between_two_centres() -> None:
    polygon = star(7, 0)
    stacks = existing(Cones.of(polygon, 2.0), "chapter")

    rule = SwitchRule(stacks, Hand(), partial(meet_held, solver=get_solver("highs")))
    first, second, held = relation(rule.pairs())
    edges = np.concatenate(
        [np.pad(f.edges, ((0, 0), (0, 3 - f.m)), constant_values=-1) for f in stacks]
    )
    same = (edges[first] == edges[second]).all(axis=1)
    assert same.any()
    assert (held[same] >= 2).all()
    assert (same | (held < 3)).all()
    family = stacks[2]
    exact = {}
    for index in np.unique(np.concatenate((first[same], second[same]))):
        constant, slopes = family.exact_coefficients(int(index - rule.offsets[2]))
        exact[index] = pieces([[c, *s] for c, s in zip(constant, slopes, strict=True)])
    for i, j, number in zip(first[same], second[same], held[same], strict=True):
        assert (number == 3) == intersect(exact[i], exact[j], 3)


def relation(pairs: SwitchPairs) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return pairs.first, pairs.second, pairs.held


# --- all pairs of sets --------------------------------------------------------------------------

RULES = {
    "comb": (comb(2), 0.125, "complete"),
    "lattice star": (lattice_star(8, 3), 0.125, "complete"),
    "lattice star, chapter": (lattice_star(10, 2), 0.125, "chapter"),
    "star": (star(7, 0), 0.25, "complete"),
    "square": (unit_square(), 1.0, "complete"),
}


def rule_of(name: str, fingers: int) -> SwitchRule:
    polygon, friction, sets = RULES[name]
    return SwitchRule(existing(Cones.of(polygon, friction), sets), Hand(fingers), meet)


def brute_switches(rule: SwitchRule) -> dict[tuple[int, int], int]:
    """All pairs of sets and every matching of their contacts, one after the other, by integers."""
    sets: list[tuple[list[int], list[list[Fraction]]]] = []
    for functions in rule.sources:
        for index in range(len(functions)):
            constant, slopes = functions.exact_coefficients(index)
            exact = [[c, *s] for c, s in zip(constant, slopes, strict=True)]
            sets.append((functions.edges[index].tolist(), exact))
    result = {}
    for (i, (edges, exact)), (j, (others, theirs)) in combinations(enumerate(sets), 2):
        m, n = len(edges), len(others)
        least = max(1, m + n - rule.hand.fingers)
        for held in range(min(m, n), least - 1, -1):
            if any(
                [edges[p] for p in mine] == [others[q] for q in yours]
                and meets_projected(exact, theirs, mine, yours)
                for mine in combinations(range(m), held)
                for yours in permutations(range(n), held)
            ):
                result[i, j] = held
                break
    return result


def meets_projected(
    exact: list, theirs: list, mine: tuple[int, ...], yours: tuple[int, ...]
) -> bool:
    """The projections on the held contacts have a common point (pieces need not exist)."""

    def of(functions: list, held: tuple[int, ...]) -> list:
        others = [i for i in range(len(functions[0]) - 1) if i not in held]
        rows = []
        for c, *s in functions:
            rows.append(row([c, *(s[i] for i in held)], strict=True))
        top = []
        for c, *s in functions:
            high = c + sum(s[i] for i in others)
            top.append(row([-high, *(-s[i] for i in held)], strict=True))
        return [[low, high] for low in rows for high in top]

    return intersect(of(exact, mine), of(theirs, yours), len(mine))


@pytest.mark.parametrize("name", RULES)
@pytest.mark.parametrize("fingers", [3, 4, 5, 6])
def test_pairs_and_neighbours_are_two_views_of_one_relation(name: str, fingers: int) -> None:
    rule = rule_of(name, fingers)
    n = sum(len(f) for f in rule.sources)
    first, second, held = relation(rule.pairs())
    assert (first < second).all()
    stored = StoredSwitches.of_pairs(n, rule.pairs())
    on_demand = SwitchesOnDemand(rule)
    from_sets = {}
    for index in range(n):
        others, numbers = on_demand.neighbors(index)
        assert (np.diff(others) > 0).all()
        np.testing.assert_array_equal(stored.neighbors(index)[0], others)
        np.testing.assert_array_equal(stored.neighbors(index)[1], numbers)
        from_sets.update({(index, int(o)): int(h) for o, h in zip(others, numbers, strict=True)})
    both = dict(zip(zip(first.tolist(), second.tolist(), strict=True), held.tolist(), strict=True))
    assert from_sets == {**both, **{(j, i): h for (i, j), h in both.items()}}
    # Once as stored and, with the largest number among repetitions, as found on demand.
    assert as_mapping(stored.pairs()) == both
    assert as_mapping(on_demand.pairs()) == both
    needed = rule.hand.needs[rule.contacts[first], rule.contacts[second]]
    assert (held >= np.maximum(needed, 1)).all()


def as_mapping(chunks: Iterator[SwitchPairs]) -> dict[tuple[int, int], int]:
    result: dict[tuple[int, int], int] = {}
    for chunk in chunks:
        for i, j, held in zip(*(c.tolist() for c in relation(chunk)), strict=True):
            assert i < j
            result[i, j] = max(held, result.get((i, j), 0))
    return result


@pytest.mark.parametrize("name", RULES)
def test_pairs_equal_a_loop_over_all_matchings(name: str) -> None:
    for fingers in (3, 4, 5, 6):
        rule = rule_of(name, fingers)
        rule = SwitchRule(
            tuple(f.take(np.arange(min(len(f), 12))) for f in rule.sources), rule.hand, meet
        )
        first, second, held = relation(rule.pairs())
        found = zip(zip(first.tolist(), second.tolist(), strict=True), held.tolist(), strict=True)
        assert dict(found) == brute_switches(rule)


def test_more_fingers_allow_more_switches() -> None:
    allowed = []
    for fingers in (3, 4, 5, 6):
        first, second, _ = relation(rule_of("comb", fingers).pairs())
        allowed.append(set(zip(first.tolist(), second.tolist(), strict=True)))
    assert allowed[0] < allowed[1] < allowed[2] <= allowed[3]


def test_progress_reaches_the_number_of_pairs() -> None:
    rule, told = rule_of("star", 5), []
    rule.pairs(lambda what, done, total: told.append((what, done, total)))
    assert told[-1] == ("switches", rule.n_pairs, rule.n_pairs)
    assert [done for _, done, _ in told] == sorted(done for _, done, _ in told)


def test_chunks_of_pairs_do_not_change_the_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = rule_of("comb", 4).pairs()
    monkeypatch.setattr("regrasp_lp.switches._CHUNK", 50)
    told = []
    found = rule_of("comb", 4).pairs(lambda what, done, total: told.append(done))
    assert len(told) > 10
    for name in ("first", "second", "held", "slots", "points"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


def test_an_object_without_sets_has_no_switches() -> None:
    stacks = existing(Cones.of(regular(5), 1e-3), "complete")
    nothing = tuple(f.take(np.zeros(0, dtype=np.intp)) for f in stacks)
    rule = SwitchRule(nothing, Hand(), meet)
    assert rule.n_pairs == 0
    assert len(rule.pairs()) == 0
    stored = StoredSwitches.of_pairs(0, rule.pairs())
    assert [len(chunk) for chunk in stored.pairs()] == [0]


def test_linear_programs_as_the_decider_find_the_same_pairs() -> None:
    polygon, friction = lattice_star(8, 3), 0.125
    stacks = existing(Cones.of(polygon, friction), "complete")

    def by_programs(first: Shadows, second: Shadows, i: np.ndarray, j: np.ndarray) -> Meeting:
        return meet_by_lp(first.take(i), second.take(j), get_solver("highs"), exact=False)

    for one, other in zip(
        relation(SwitchRule(stacks, Hand(), by_programs).pairs()),
        relation(SwitchRule(stacks, Hand(), meet).pairs()),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", RULES)
@pytest.mark.parametrize("fingers", [3, 4, 5])
def test_every_stored_switch_has_a_witness_in_both_sets(name: str, fingers: int) -> None:
    rule = rule_of(name, fingers)
    pairs = rule.pairs()
    for n in range(0, len(pairs), max(1, len(pairs) // 300)):
        held = pairs.held[n]
        slots, points = pairs.slots[n, :held], pairs.points[n, :held]
        assert (pairs.slots[n, held:] == -1).all()
        sides = []
        for index in (pairs.first[n], pairs.second[n]):
            source = np.searchsorted(rule.offsets, index, side="right") - 1
            functions = rule.sources[source].take(np.array([index - rule.offsets[source]]))
            if not sides:
                edges = functions.edges[:, slots]
            there = places_of(edges, functions.edges)[0].tolist()
            fractions = complete(functions, np.array([there]), points[None])
            assert functions.contain(fractions)[0]
            np.testing.assert_array_equal(fractions[0, there], points)
            sides.append(there)
        assert sides[0] == slots.tolist()
