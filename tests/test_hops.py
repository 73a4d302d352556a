"""Hops over known grasps against brute force, and what they save."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from geometry import rectangle, star
from regrasps import random_grasps

import regrasp_lp as rl
from regrasp_lp.planning.hops import Stop, fewest_hops


def stop(*places: tuple[int, float]) -> Stop:
    contacts = tuple(rl.Contact.at_fraction(edge, fraction) for edge, fraction in places)
    return Stop(0, contacts, contacts)


def brute_force(fingers: int, stops: list[Stop]) -> int | None:
    """The least number of placements over all subsequences of the stops."""
    best = None
    middle = range(1, len(stops) - 1)
    for count in range(len(stops) - 1):
        for chosen in combinations(middle, count):
            path = [stops[i].contacts for i in (0, *chosen, len(stops) - 1)]
            if all(len({*a, *b}) <= fingers for a, b in pairwise(path)):
                cost = sum(len({*b} - {*a}) for a, b in pairwise(path))
                best = cost if best is None else min(best, cost)
    return best


@pytest.mark.parametrize("fingers", [3, 4, 5, 6])
def test_hops_equal_brute_force(fingers: int) -> None:
    rng = np.random.default_rng(fingers)
    found = 0
    for _ in range(60):
        stops = []
        for _ in range(7):
            edges = rng.choice(4, size=rng.integers(2, 4), replace=False)
            stops.append(stop(*((int(e), float(rng.choice([0.25, 0.5]))) for e in edges)))
        path = fewest_hops(rectangle(), rl.Hand(fingers), stops)
        expected = brute_force(fingers, stops)
        assert (path is None) == (expected is None)
        if path is None:
            continue
        found += 1
        assert path[0] == 0
        assert path[-1] == 6
        contacts = [stops[i].contacts for i in path]
        assert sum(len({*b} - {*a}) for a, b in pairwise(contacts)) == expected
    assert found > 5


def test_no_hop_puts_two_fingers_on_a_vertex() -> None:
    """The end of edge 0 is the start of edge 1: different contacts at one point."""
    stops = [stop((0, 1.0), (2, 0.5)), stop((1, 0.0), (2, 0.5))]
    assert fewest_hops(rectangle(), rl.Hand(4), stops) is None
    between = [stops[0], stop((0, 0.5), (2, 0.5)), stops[1]]
    assert fewest_hops(rectangle(), rl.Hand(4), between) == [0, 1, 2]


def test_one_stop() -> None:
    assert fewest_hops(rectangle(), rl.Hand(4), [stop((0, 0.5), (2, 0.5))]) == [0]


def test_a_thin_bar_is_regripped_with_both_free_fingers() -> None:
    for height in (0.1, 1e-6):
        plan = rl.plan_regrasp(
            rectangle(1, height),
            [(0, 0.1), (2, 0.9)],
            [(0, 0.9), (2, 0.1)],
            friction=0.2,
            aligning="regrip",
        )
        assert plan.placements == 2
        assert plan.verify().ok


def test_three_fingers_let_one_go_to_have_it_free() -> None:
    """With three fingers a grasp of three contacts cannot be repositioned, one of two can."""
    start, goal = [(0, 1.0), (2, 3.0), (1, 1.0)], [(0, 3.0), (2, 1.0), (1, 1.5)]
    plan = rl.plan_regrasp(
        rectangle(), start, goal, friction=0.5, hand=rl.Hand(3), aligning="regrip"
    )
    assert plan.verify().ok
    assert plan.margin > 0.1


@pytest.mark.parametrize("fingers", [4, 5])
def test_without_slides_on_stars(fingers: int) -> None:
    rng = np.random.default_rng(fingers)
    for seed in range(2):
        polygon = star(9, seed)
        grasps = random_grasps(polygon, 0.6, rng, 5, 3)
        for start, goal in pairwise(grasps):
            plan = rl.plan_regrasp(
                polygon, start, goal, 0.6, hand=rl.Hand(fingers), aligning="regrip"
            )
            assert plan.verify().ok
            assert not any(isinstance(step, rl.Slide) for step in plan.steps)
