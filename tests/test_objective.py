"""What a plan is best in: names, weights, values, bounds and gaps."""

import numpy as np
import pytest
from geometry import ell, rectangle
from hypothesis import given
from hypothesis import strategies as st
from regrasps import random_grasps

import regrasp_lp as rl
from regrasp_lp.errors import OptionError
from regrasp_lp.planning.objective import NAMES, PLACEMENTS, Objective

_weight = st.floats(0, 1e6)
_value = st.one_of(st.floats(-1e6, 1e6), st.just(np.inf))


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_a_weight_of_one(name: str) -> None:
    objective = Objective.of(name)
    assert objective == Objective.of({name: 1.0}) == Objective.of(objective)
    assert objective.name == name
    assert objective.maximised == (name in ("margin", "tolerance"))
    assert Objective() == PLACEMENTS == Objective.of("placements")


@given(st.dictionaries(st.sampled_from(NAMES), _weight, min_size=1))
def test_weights_are_kept_in_one_order_and_zeros_left_out(weights: dict[str, float]) -> None:
    if not any(weights.values()):
        with pytest.raises(OptionError, match="all weights of the objective are 0"):
            Objective.of(weights)
        return
    objective = Objective.of(weights)
    assert dict(objective.weights) == {name: w for name, w in weights.items() if w}
    assert [name for name, _ in objective.weights] == [n for n in NAMES if weights.get(n)]
    assert (objective.name == "weighted") == (len(objective.weights) > 1)


@pytest.mark.parametrize(
    ("objective", "message"),
    [
        ("speed", 'must be one of "placements", "margin", "tolerance", "travel", got \'speed\''),
        ({"margin": 1, "speed": 1}, "got 'speed'"),
        ({}, "all weights"),
        ({"margin": -1}, "the weight of 'margin' must be a number >= 0, got -1"),
        ({"margin": np.nan}, "must be a number >= 0, got nan"),
        ({"travel": np.inf}, "must be a number >= 0, got inf"),
        ({"travel": "1"}, "must be a number >= 0, got '1'"),
        ({"travel": True}, "must be a number >= 0, got True"),
        (3, "or weights by name, got 3"),
        (None, "or weights by name, got None"),
    ],
)
def test_bad_objectives_are_refused_by_what_is_wrong(objective: object, message: str) -> None:
    with pytest.raises(OptionError) as error:
        Objective.of(objective)  # type: ignore[arg-type]
    assert message in str(error.value)
    polygon = rectangle()
    graph = rl.build_switching_graph(polygon, 0.3)
    pinch = [(0, 1.0), (2, 1.0)]
    with pytest.raises(OptionError):
        graph.plan(pinch, pinch, objective=objective)  # type: ignore[arg-type]


@given(_value, _value)
def test_a_gap_is_a_distance_that_ignores_rounding(value: float, bound: float) -> None:
    for objective, sign in ((Objective.of("margin"), 1), (Objective.of("travel"), -1)):
        gap = objective.gap(value, bound)
        assert gap >= 0
        if value == bound or sign * (bound - value) <= 0:
            assert gap == 0
        elif np.isfinite(value) and np.isfinite(bound):
            far = abs(bound - value) > 1e-6 * max(abs(value), abs(bound))
            assert gap == (abs(bound - value) if far else 0)
        else:
            assert gap == np.inf


def test_a_combination_is_a_cost() -> None:
    weights = {"placements": 2.0, "margin": 3.0, "tolerance": 5.0, "travel": 7.0}
    quantities = {"placements": 4.0, "margin": 0.5, "tolerance": 0.25, "travel": 1.5}
    cost = Objective.of(weights).cost(quantities)
    assert cost == pytest.approx(2 * 4 - 3 * 0.5 - 5 * 0.25 + 7 * 1.5)


def test_the_value_of_a_plan_is_its_quantity() -> None:
    polygon = ell()
    graph = rl.build_switching_graph(polygon, 0.15)
    rng = np.random.default_rng(1)
    grasps = random_grasps(polygon, 0.15, rng, 8, 3)
    for start, goal in zip(grasps[::2], grasps[1::2], strict=True):
        for name in ("placements", "margin", "tolerance"):
            plan = graph.plan(start, goal, objective=name)
            quantities = {
                "placements": plan.placements,
                "margin": plan.chosen_margin,
                "tolerance": plan.chosen_tolerance,
            }
            assert plan.objective == Objective.of(name)
            assert plan.value == quantities[name]
            assert plan.bound is not None
            assert plan.gap == plan.objective.gap(plan.value, plan.bound)
            assert plan.gap == 0


def test_a_plan_that_was_read_has_no_bound(tmp_path) -> None:
    polygon = ell()
    graph = rl.build_switching_graph(polygon, 0.3)
    rng = np.random.default_rng(2)
    start, goal = random_grasps(polygon, 0.3, rng, 2, 3)
    plan = graph.plan(start, goal, objective="margin")
    plan.to_json(tmp_path / "plan.json")
    again = rl.read_plan(tmp_path / "plan.json")
    assert (again.bound, again.gap) == (None, None)
    assert again.chosen_margin == plan.chosen_margin


def test_travel_within_rounding_of_none_is_none() -> None:
    """A plan with a few placements and a slide of 1e-14 is better than one with many and none."""
    bracket = [(0, 0), (60, 0), (60, 10), (10, 10), (10, 50), (0, 50)]
    graph = rl.build_switching_graph(rl.Polygon(bracket), 0.3)
    grasps = [(0, 20), (0, 50), (2, 20)], [(3, 10), (5, 10), (5, 35)]
    plan = graph.plan(*grasps, objective="travel")
    assert plan.travel < 1e-9
    assert plan.gap == 0
    assert plan.placements == graph.plan(*grasps).placements == 3


@pytest.mark.parametrize(("name", "bound"), [("travel", -np.inf), ("margin", np.inf)])
def test_what_is_not_bounded_has_no_proof(name: str, bound: float) -> None:
    assert Objective.of(name).gap(1.0, bound) == np.inf


def test_failures_of_all_plans_are_no_proof_that_there_is_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from regrasp_lp.planning import planner

    def fail(*_: object, **__: object) -> None:
        raise rl.SolverError("not within its accuracy")

    graph = rl.build_switching_graph(rectangle(), 0.4)
    ends = [(0, 2.0), (2, 2.0)], [(1, 1.0), (3, 1.0)]
    monkeypatch.setattr(planner, "perform", fail)
    for objective in ("travel", {"placements": 1, "travel": 0.1}, "margin", "placements"):
        with pytest.raises(rl.SolverError, match="accuracy"):
            graph.plan(*ends, objective=objective)
