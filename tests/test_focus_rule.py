"""The chapter's rule for switching: interiors of focus cells that meet."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from itertools import combinations, pairwise, product
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY, covering
from fourier_motzkin import Row, row, solvable
from geometry import (
    GENERAL,
    LATTICE,
    cross,
    exact_point,
    exact_ray,
    lattice_star,
    regular,
    staircase,
    star,
)
from hypothesis import given, settings
from hypothesis import strategies as st

import regrasp_lp as rl
from regrasp_lp import build
from regrasp_lp.errors import HandError, OptionError
from regrasp_lp.friction import Cones
from regrasp_lp.polygon import Polygon
from regrasp_lp.switches import StoredSwitches, SwitchesOnDemand
from regrasp_lp.switching_graph import SwitchingGraph

Edges = dict[tuple[int, int], int]

MODELS = {
    f"{path.stem} {p.name}": p
    for path in sorted((REPOSITORY / "models").glob("*.geojson"))
    for p in rl.read_polygons(path)
    if p.n_edges <= 40
}
PART = {name.split()[1]: p for name, p in MODELS.items()}
SHAPES = {
    **LATTICE,
    **GENERAL,
    "regular 12": regular(12),
    "lattice star 10": lattice_star(10, 2),
    "staircase 5": staircase(2, 5),
    **{n: PART[n] for n in ("star_15", "star_25", "hex_nut")},
}


def spread_friction(n: int, seed: int, most: int = 16) -> np.ndarray:
    return np.random.default_rng(seed).integers(1, most + 1, n) / 16


def graph_of(
    polygon: Polygon, friction: object, switching: str = "focus", **options: object
) -> SwitchingGraph:
    return rl.build_switching_graph(
        polygon, friction, sets="chapter", switching=switching, **options
    )


def edges_of(graph: SwitchingGraph) -> Edges:
    """All adjacent pairs and how many contacts they hold, from the stored switches."""
    nx = graph.to_networkx()
    return {(min(i, j), max(i, j)): held for i, j, held in nx.edges(data="held")}


def kinds_of(graph: SwitchingGraph, pair: tuple[int, int]) -> set[str]:
    return {graph.sets.kinds[i] for i in pair}


# --- laws on many objects -----------------------------------------------------------------------


def assert_part_of_the_contact_rule(focus: SwitchingGraph, contact: SwitchingGraph) -> int:
    """Return how many edges are only those of the contact rule."""
    assert [repr(s) for s in focus.sets] == [repr(s) for s in contact.sets]
    ours, all_ = edges_of(focus), edges_of(contact)
    assert set(ours) <= set(all_)
    for pair, held in ours.items():
        kinds = kinds_of(focus, pair)
        assert held == all_[pair]
        assert kinds != {"concurrent", "parallel"}
    for pair, held in all_.items():
        if "parallel" in kinds_of(focus, pair) or kinds_of(focus, pair) == {"two_finger"}:
            assert ours[pair] == held
    pairs = [i for i, kind in enumerate(focus.sets.kinds) if kind == "two_finger"]
    assert all(p in ours for p in combinations(pairs, 2))
    return len(all_) - len(ours)


MUS = (0.05, 0.176327, 0.4, 1.0, "per edge")


@pytest.mark.parametrize(("name", "mu"), covering(SHAPES, [0.176327, 0.4, "per edge", 0.05, 1.0]))
def test_edges_are_some_of_the_contact_rule(name: str, mu: float | str) -> None:
    polygon = SHAPES[name]
    friction = spread_friction(polygon.n_edges, 0) if isinstance(mu, str) else mu
    assert_part_of_the_contact_rule(
        graph_of(polygon, friction), graph_of(polygon, friction, "contact")
    )


@pytest.mark.parametrize(
    ("name", "mu"),
    [
        pytest.param(name, mu, marks=[pytest.mark.slow] if p.n_edges > 20 or mu != 0.176327 else [])
        for name, p in MODELS.items()
        for mu in MUS
    ],
)
def test_edges_of_all_models(name: str, mu: float | str) -> None:
    polygon = MODELS[name]
    friction = spread_friction(polygon.n_edges, 0) if isinstance(mu, str) else mu
    assert_part_of_the_contact_rule(
        graph_of(polygon, friction), graph_of(polygon, friction, "contact")
    )


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), of_friction=st.integers(0, 10**6))
def test_edges_on_random_lattice_polygons(seed: int, of_friction: int) -> None:
    polygon = lattice_star(9, seed)
    friction = spread_friction(9, of_friction, 10)
    assert_part_of_the_contact_rule(
        graph_of(polygon, friction), graph_of(polygon, friction, "contact")
    )


def test_some_switches_are_lost() -> None:
    """The same contacts can be held by focus on different points."""
    lost = {
        name: assert_part_of_the_contact_rule(
            graph_of(PART[name], 0.176327), graph_of(PART[name], 0.176327, "contact")
        )
        for name in ("star_15", "star_25", "hex_nut")
    }
    assert min(lost.values()) > 10


@pytest.mark.parametrize("name", ["star_15", "lattice star 10", "hexagon"])
def test_symmetric(name: str) -> None:
    graph = graph_of(SHAPES[name], 0.25)
    neighbors = [graph.neighbors(i) for i in range(len(graph))]
    for i, found in enumerate(neighbors):
        assert i not in found
        assert all(i in neighbors[j] for j in found)
    for (i, j), held in list(edges_of(graph).items())[::9]:
        assert graph.held(i, j) == graph.held(j, i) == held
        switch, back = graph.switch(i, j), graph.switch(j, i)
        assert switch is not None
        assert back is not None
        assert switch.margin == pytest.approx(back.margin, abs=1e-7)
        for one, other in switch.grasps:
            assert rl.is_force_closure(graph.polygon, one, graph.friction)
            assert rl.is_force_closure(graph.polygon, other, graph.friction)


# --- an oracle: both cells by their definition, exactly -----------------------------------------


@cache
def seen_from(
    cones: Cones, edge: int, ray_edge: int, sign: int
) -> tuple[tuple[Fraction, ...], ...]:
    """Rows over ``(x, y)`` and a contact f: ``sign (q - p(f))`` in the cone of `ray_edge`."""
    a, b = exact_point(cones, edge, Fraction(0)), exact_point(cones, edge, Fraction(1))
    t = b[0] - a[0], b[1] - a[1]
    rows = []
    for ray, s in ((2 * ray_edge, -sign), (2 * ray_edge + 1, sign)):
        d = exact_ray(cones, ray)
        rows.append((s * cross(a, d), -s * d[1], s * d[0], s * cross(t, d)))
    return tuple(rows)


@cache
def cell(cones: Cones, edges: tuple[int, ...]) -> list[list[tuple]]:
    """Non-empty pieces of a focus cell, as rows over (x, y, f) for each contact."""
    found = []
    if len(edges) == 3:
        for sides in product((1, -1), repeat=3):
            found.append([seen_from(cones, e, e, s) for e, s in zip(edges, sides, strict=True)])
    else:
        a, b = edges
        for s in (1, -1):
            # C = C_a ∩ -C_b on side s of a and on side -s of b
            found.append(
                [
                    seen_from(cones, a, a, s) + seen_from(cones, a, b, -s),
                    seen_from(cones, b, a, -s) + seen_from(cones, b, b, s),
                ]
            )
    return [piece for piece in found if meet(piece)]


def meet(contacts: list[tuple]) -> bool:
    """Whether one q is seen by some contact of each, every contact with a place of its own."""
    n = len(contacts)
    rows: list[Row] = []
    for place, functions in enumerate(contacts):
        for constant, x, y, f in functions:
            wide = [constant, x, y, *[0] * n]
            wide[3 + place] = f
            rows.append(row(wide, strict=True))
        unit = [0] * (3 + n)
        unit[3 + place] = 1
        rows.append((tuple(-v for v in unit), False))
        rows.append(((-1, *unit[1:]), False))
    return solvable(rows)


@pytest.mark.parametrize(
    ("polygon", "mu"),
    [
        (star(7, 0), 0.4),
        (star(8, 1), 0.2),
        (lattice_star(7, 3), 0.25),
        (lattice_star(9, 4), 0.25),
        (LATTICE["hexagon"], 0.25),
        (LATTICE["hexagon"], 0.375),
        (regular(9), 0.25),
        (star(9, 1), "per edge"),
    ],
    ids=repr,
)
def test_adjacent_cells_have_a_point_in_common_and_only_these(
    polygon: Polygon, mu: float | str
) -> None:
    friction = spread_friction(polygon.n_edges, 3, 8) if isinstance(mu, str) else mu
    graph = graph_of(polygon, friction)
    cones = Cones.of(polygon, friction)
    ours = edges_of(graph)
    sets = list(graph.sets)
    decided = 0
    for i, j in combinations(range(len(sets)), 2):
        kinds = {sets[i].kind, sets[j].kind}
        common = len(set(sets[i].edges) & set(sets[j].edges))
        if "parallel" in kinds or "concurrent" not in kinds:
            continue
        if common < (2 if kinds == {"concurrent"} else 1):
            assert (i, j) not in ours
            continue
        if decided > 120:
            break
        decided += 1
        pieces = product(cell(cones, sets[i].edges), cell(cones, sets[j].edges))
        expected = any(meet(p + q) for p, q in pieces)
        assert ((i, j) in ours) == expected, (sets[i], sets[j])
    assert decided > 0


# --- solvers ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "mu"),
    [
        ("star9", 0.2),
        ("star7", 0.5),
        ("regular7", 0.3),
        ("hexagon", 0.25),
        pytest.param("star_15", 0.176327, marks=pytest.mark.slow),
    ],
)
def test_presolve_and_both_solvers_agree(name: str, mu: float) -> None:
    expected = edges_of(graph_of(SHAPES[name], mu))
    assert expected
    for solver, presolve in product(("clarabel", "highs"), (True, False)):
        assert edges_of(graph_of(SHAPES[name], mu, solver=solver, presolve=presolve)) == expected


MOVES = {
    "translation": lambda v: v + np.array([1024.0, -512.0]),
    "far translation": lambda v: v + np.array([2.0**30, -(2.0**30)]),
    "smaller": lambda v: v * 2.0**-10,
    "tiny": lambda v: v * 2.0**-30,
    "huge": lambda v: v * 2.0**30,
    "quarter turn": lambda v: np.stack([-v[:, 1], v[:, 0]], axis=1),
}


@pytest.mark.parametrize(
    ("move", "solver", "presolve"),
    covering(MOVES, ["clarabel", "highs"], [False, True]),
)
def test_moving_and_scaling_the_object_changes_nothing(
    move: str, solver: str, presolve: bool
) -> None:
    vertices = np.round(star(9, 1).vertices * 2**10) / 2**10
    expected = edges_of(graph_of(Polygon(vertices), 0.2))
    moved = graph_of(Polygon(MOVES[move](vertices)), 0.2, solver=solver, presolve=presolve)
    assert edges_of(moved) == expected


# --- options ------------------------------------------------------------------------------------


def test_errors_name_the_remedy() -> None:
    polygon = LATTICE["hexagon"]
    with pytest.raises(OptionError, match='sets="chapter"'):
        rl.build_switching_graph(polygon, 0.25, switching="focus")
    with pytest.raises(OptionError, match='sets="chapter"'):
        rl.build_switching_graph(polygon, 0.25, sets="complete", switching="focus")
    for fingers in (3, 5, 6):
        with pytest.raises(HandError, match=f"not for {fingers}"):
            graph_of(polygon, 0.25, hand=rl.Hand(fingers))
    for switching in ("x", "Focus", "", None):
        with pytest.raises(OptionError, match="contact.*focus"):
            graph_of(polygon, 0.25, switching)  # type: ignore[arg-type]
    assert graph_of(polygon, 0.25, hand=rl.Hand(4)) == graph_of(polygon, 0.25)


def test_no_concurrent_or_no_sets_at_all() -> None:
    rubber = graph_of(star(9, 1), 0.9)  # the chapter has no concurrent set above 30°
    assert "concurrent" not in rubber.sets.kinds
    assert edges_of(rubber) == edges_of(graph_of(star(9, 1), 0.9, "contact"))
    # no two edges of an equilateral triangle are opposed: no two-finger set
    lone = graph_of(regular(3), 0.25)
    assert set(lone.sets.kinds) == {"concurrent"}
    assert edges_of(lone) == {}
    empty = graph_of(LATTICE["square"], 0.25, min_margin=9.0)
    assert len(empty) == 0
    assert empty.n_switches == 0


@pytest.mark.parametrize("presolve", [True, False])
@pytest.mark.parametrize(("name", "mu"), [("star9", 0.3), ("hexagon", 0.25), ("regular7", 0.3)])
def test_min_margin_keeps_what_has_more(name: str, mu: float, presolve: bool) -> None:
    polygon = SHAPES[name]
    everything = graph_of(polygon, mu)
    switches = {p: everything.switch(*p) for p in edges_of(everything)}
    margins = sorted(s.margin for s in switches.values())
    least = (margins[len(margins) // 3] + margins[len(margins) // 3 + 1]) / 2 + 1e-6
    some = graph_of(polygon, mu, min_margin=least, presolve=presolve)
    kept = [i for i, s in enumerate(everything.sets) if s.margin > least]
    assert [s.edges for s in some.sets] == [everything.sets[i].edges for i in kept]
    expected = {p for p, s in switches.items() if s.margin > least and set(p) <= set(kept)}
    # `switch` gives up a thousandth of the margin to keep contacts apart
    doubtful = {p for p, s in switches.items() if abs(s.margin - least) < 2e-3 * least}
    found = {(kept[i], kept[j]) for i, j in edges_of(some)}
    assert found - doubtful == expected - doubtful
    assert len(found) < len(switches)
    assert found or name == "regular7"


@pytest.mark.parametrize(
    "name",
    [
        "star9",
        "hexagon",
        *(pytest.param(n, marks=pytest.mark.slow) for n in ("star_15", "hex_nut")),
    ],
)
def test_on_demand_as_stored(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    stored = graph_of(SHAPES[name], 0.25)
    assert isinstance(stored.switches, StoredSwitches)
    monkeypatch.setattr(build, "STORE_LIMIT", 0)
    found = graph_of(SHAPES[name], 0.25)
    assert isinstance(found.switches, SwitchesOnDemand)
    for i in range(len(stored)):
        for one, other in zip(
            stored.switches.neighbors(i), found.switches.neighbors(i), strict=True
        ):
            np.testing.assert_array_equal(one, other)
    assert found.n_switches == stored.n_switches
    assert found.components() == stored.components()
    found.save(tmp_path / "graph.npz")
    again = rl.load_graph(tmp_path / "graph.npz")
    assert isinstance(again.switches, SwitchesOnDemand)
    assert again.options.switching == "focus"
    assert again == found
    for i in range(0, len(again), 4):
        assert again.neighbors(i) == stored.neighbors(i)


@pytest.mark.parametrize(("name", "mu"), [("star9", 0.25), ("hex_nut", 0.25), ("ell", 0.5)])
def test_round_trip(name: str, mu: float, tmp_path: Path) -> None:
    graph = graph_of(SHAPES[name], mu)
    graph.save(tmp_path / "graph.npz")
    again = rl.load_graph(tmp_path / "graph.npz")
    assert graph == again
    assert again.options.switching == "focus"
    assert edges_of(again) == edges_of(graph)
    assert str(graph.summary()) == str(again.summary())
    contact = graph_of(SHAPES[name], mu, "contact")
    assert graph != contact


@pytest.mark.parametrize(("name", "mu"), [("star9", 0.3), ("hex_nut", 0.25), ("star_15", 0.3)])
def test_plans_in_a_focus_graph_verify(name: str, mu: float) -> None:
    graph = graph_of(SHAPES[name], mu)
    component, explicit = sorted(graph.components()[0]), edges_of(graph)
    numbers: dict[tuple[str, tuple[int, ...]], list[int]] = {}
    for number, grasp_set in enumerate(graph.sets):
        numbers.setdefault((grasp_set.kind, grasp_set.edges), []).append(number)
    rng = np.random.default_rng(0)
    longest = 0
    for _ in range(4):
        i, j = rng.choice(component, 2, replace=False)
        plan = graph.plan(graph.sets[i].witness, graph.sets[j].witness)
        assert plan.verify().ok
        assert rl.check_plan(plan).ok
        longest = max(longest, len(plan.steps))
        for one, other in pairwise(plan.path):
            assert any(
                (min(i, j), max(i, j)) in explicit for i in numbers[one] for j in numbers[other]
            )
    assert longest >= 2


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_edges_on_more_random_polygons(seed: int) -> None:
    for polygon in (star(20, seed), lattice_star(14, seed), staircase(seed, 9)):
        for mu in (0.02, 0.25, 0.5, 1.0):
            friction = np.clip(mu * 2 * spread_friction(polygon.n_edges, seed), 0.01, None)
            assert_part_of_the_contact_rule(
                graph_of(polygon, friction), graph_of(polygon, friction, "contact")
            )
