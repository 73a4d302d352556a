"""Linear sets: laws of restricting and joining, on random, flat and empty stacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regrasp_lp.errors import OptionError
from regrasp_lp.linear_sets import LinearSets

NAMES = ("u", "v", "w", "x", "y")


def random_sets(names: tuple[str, ...], seed: int, count: int = 3, rows: int = 4) -> LinearSets:
    rng = np.random.default_rng([seed, len(names), count])
    n = len(names)
    return LinearSets(
        names,
        rng.integers(-3, 4, (count, rows, n)).astype(float),
        rng.integers(0, 3, (count, rows)).astype(float),
        rng.integers(-2, 5, (count, rows)).astype(float),
        -rng.integers(0, 3, (count, n)).astype(float),
        rng.integers(0, 3, (count, n)).astype(float),
    )


def with_point(names: tuple[str, ...], seed: int) -> tuple[LinearSets, np.ndarray]:
    """Sets that contain a chosen point with margin at least 1: bounds made from it."""
    sets = random_sets(names, seed)
    point = np.random.default_rng(seed).integers(-4, 5, sets.lower.shape) / 4
    bounds = np.einsum("brn,bn->br", sets.rows, point) + sets.scales
    return replace(sets, bounds=bounds, lower=point - 1, upper=point + 1), point


def ordered(sets: LinearSets, names: tuple[str, ...], points: np.ndarray) -> np.ndarray:
    """Points given in the order of `names`, in that of the sets."""
    return points[:, [names.index(name) for name in sets.names]]


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.lists(st.sampled_from(NAMES), max_size=4, unique=True))
def test_joins_commute_up_to_the_order_of_coordinates(seed: int, mine: list[str]) -> None:
    other = tuple(n for i, n in enumerate(NAMES) if (seed >> i) & 1)
    one, two = random_sets(tuple(mine), seed), random_sets(other, seed + 1)
    on = [n for n in mine if n in other]
    joined, swapped = one.join(two, on), two.join(one, on)
    assert joined.names == (*mine, *(n for n in other if n not in mine))
    assert set(swapped.names) == set(joined.names)
    points = np.random.default_rng(seed).integers(-3, 4, (3, len(joined.names))) / 2
    expected = np.minimum(
        one.margins(ordered(one, joined.names, points)),
        two.margins(ordered(two, joined.names, points)),
    )
    np.testing.assert_array_equal(joined.margins(points), expected)
    np.testing.assert_array_equal(swapped.margins(ordered(swapped, joined.names, points)), expected)


@settings(max_examples=40)
@given(st.integers(0, 10**6))
def test_joins_associate(seed: int) -> None:
    one = random_sets(("u", "v"), seed)
    two = random_sets(("v", "w"), seed + 1)
    three = random_sets(("w", "u", "x"), seed + 2)
    left = one.join(two, ["v"]).join(three, ["u", "w"])
    right = one.join(two.join(three, ["w"]), ["u", "v"])
    points = np.random.default_rng(seed).integers(-3, 4, (3, 4)) / 2
    np.testing.assert_array_equal(
        left.margins(ordered(left, ("u", "v", "w", "x"), points)),
        right.margins(ordered(right, ("u", "v", "w", "x"), points)),
    )


@settings(max_examples=40)
@given(st.integers(0, 10**6))
def test_restricting_and_joining_in_either_order(seed: int) -> None:
    one, at = with_point(("u", "v"), seed)
    two, _ = with_point(("v", "w", "x"), seed)
    two = replace(two, lower=two.lower - 9, upper=two.upper + 9)
    u, v = (float(np.median(at[:, i])) for i in (0, 1))
    wide = replace(one, lower=one.lower - 9, upper=one.upper + 9)
    first = wide.join(two, ["v"]).restrict({"u": u, "v": v})
    second = wide.restrict({"u": u, "v": v}).join(two.restrict({"v": v}), [])
    assert first.names == second.names == ("w", "x")
    points = np.random.default_rng(seed).integers(-3, 4, (3, 2)) / 2
    np.testing.assert_allclose(first.margins(points), second.margins(points))


@settings(max_examples=40)
@given(st.integers(0, 10**6))
def test_sets_made_around_a_point_contain_it(seed: int) -> None:
    sets, point = with_point(("u", "v", "w"), seed)
    assert (sets.margins(point) >= 1).all()
    other, _ = with_point(("x",), seed)
    both = sets.join(other, [])
    assert (both.margins(np.column_stack((point, other.lower + 1))) >= 1).all()
    for b in range(len(sets)):
        fixed = sets[b].restrict({"v": point[b, 1]})
        assert fixed.names == ("u", "w")
        assert fixed.margins(point[b : b + 1, [0, 2]])[0] >= 1


def test_margins_of_a_point() -> None:
    sets = LinearSets(
        ("x",),
        np.array([[[1.0], [-2.0]]]),
        np.array([[1.0, 2.0]]),
        np.array([[1.0, 0.0]]),
        np.array([[-1.0]]),
        np.array([[2.0]]),
    )
    assert sets.margins(np.array([[0.25]]))[0] == 0.25
    assert sets.margins(np.array([[0.75]]))[0] == 0.25
    assert sets.margins(np.array([[-0.5]]))[0] == -0.5
    assert sets.margins(np.array([[2.5]]))[0] == -np.inf  # outside the box
    assert sets.margins(np.array([0.5]))[0] == 0.5  # one point for all sets


def test_rows_without_scale_hold_or_do_not() -> None:
    sets = LinearSets(
        ("x",),
        np.array([[[1.0]]]),
        np.zeros((1, 1)),
        np.zeros((1, 1)),
        np.array([[-1.0]]),
        np.array([[1.0]]),
    )
    assert sets.margins(np.array([[0.0]]))[0] == np.inf
    assert sets.margins(np.array([[0.5]]))[0] == -np.inf


def test_flat_sets_and_sets_without_rows_or_coordinates() -> None:
    flat = LinearSets(
        ("x", "y"),
        np.array([[[1.0, 1.0], [-1.0, -1.0]]]),
        np.ones((1, 2)),
        np.array([[1.0, -1.0]]),
        np.array([[0.0, 0.5]]),
        np.array([[1.0, 0.5]]),
    )
    assert flat.margins(np.array([[0.5, 0.5]]))[0] == 0
    assert flat.margins(np.array([[0.25, 0.5]]))[0] == -0.25
    assert flat.restrict({"y": 0.5}).margins(np.array([[0.5]]))[0] == 0
    point = flat.restrict({"x": 0.5, "y": 0.5})
    assert point.names == ()
    assert point.margins(np.zeros((1, 0)))[0] == 0
    free = LinearSets(
        ("x",), np.zeros((2, 0, 1)), np.zeros((2, 0)), np.zeros((2, 0)), *np.zeros((2, 2, 1))
    )
    assert np.isposinf(free.margins(np.zeros((2, 1)))).all()


def test_a_stack_is_a_sequence() -> None:
    sets = random_sets(("u", "v"), 1, count=4)
    assert len(sets) == len(list(sets)) == 4
    points = np.zeros((4, 2))
    np.testing.assert_array_equal(
        [one.margins(points[:1])[0] for one in sets], sets.margins(points)
    )
    np.testing.assert_array_equal(sets[-1].rows, sets.rows[3:])
    np.testing.assert_array_equal(sets.take(np.array([2, 2, 0])).bounds, sets.bounds[[2, 2, 0]])
    with pytest.raises(IndexError, match="set 4 of 4"):
        sets[4]
    with pytest.raises(IndexError, match="set -5 of 4"):
        sets[-5]
    assert sets.rename(["a", "b"]).rename(["u", "v"]).names == sets.names


def test_mismatches_name_both_sides() -> None:
    one, two = random_sets(("u", "v"), 1), random_sets(("v", "w"), 2)
    with pytest.raises(OptionError, match=r"join on \('u',\) but \('u', 'v'\) and \('v', 'w'\)"):
        one.join(two, ["u"])
    with pytest.raises(OptionError, match=r"share \('v',\): rename"):
        one.join(two, [])
    with pytest.raises(OptionError, match="stacks of 3 and 1 sets"):
        one.join(two[0], ["v"])
    with pytest.raises(OptionError, match=r"cannot fix \['z'\]: the coordinates are"):
        one.restrict({"z": 0.0})
    with pytest.raises(OptionError, match=r"cannot fix v = 99.0: it is outside the box"):
        one.restrict({"u": 0.0, "v": 99.0})
    with pytest.raises(OptionError, match="names must differ"):
        one.rename(["a", "a"])
    with pytest.raises(OptionError, match=r"names has shape 1"):
        one.rename(["a"])
    with pytest.raises(OptionError, match=r"bounds has shape \(3, 3\)"):
        replace(one, bounds=np.zeros((3, 3)))
