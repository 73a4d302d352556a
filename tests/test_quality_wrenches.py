"""ε, wrench hulls, loads and required friction: closed forms, hulls and programs as oracles."""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np
import pytest
from geometry import LATTICE, rectangle, unit_square
from hypothesis import given, settings
from hypothesis import strategies as st
from polygons import frictions, stars
from regrasps import PARTS
from scipy.optimize import linprog, nnls
from scipy.spatial import ConvexHull, QhullError

import regrasp_lp as rl
from regrasp_lp import quality

FORCES = ("sum", "each")
SIGNED = {
    "margin": quality.margin,
    "epsilon": quality.epsilon,
    "epsilon each": partial(quality.epsilon, forces="each"),
    "epsilon distance": partial(quality.epsilon, torque_scale="distance"),
    "volume": quality.hull_volume,
    "volume each": partial(quality.hull_volume, forces="each"),
}


def batch(polygon: rl.Polygon, contacts: int, seed: int, count: int) -> dict[str, np.ndarray]:
    """Random contacts, many of them at quarters of edges, where much is aligned exactly."""
    rng = np.random.default_rng([seed, contacts])
    edges = rng.integers(0, polygon.n_edges, (count, contacts))
    fractions = rng.random(edges.shape)
    coarse = rng.random(edges.shape) < 0.4
    return {"edges": edges, "fractions": np.where(coarse, np.round(4 * fractions) / 4, fractions)}


def wrenches(
    polygon: rl.Polygon, mu: float, scale: float, edges: np.ndarray, fractions: np.ndarray
) -> np.ndarray:
    """Primitive wrenches of one grasp, ray by ray, from their definition."""
    found = []
    for edge, f in zip(edges, fractions, strict=True):
        a, b = polygon.edge_starts[edge], polygon.edge_ends[edge]
        t = (b - a) / np.hypot(*(b - a))
        n = np.array([-t[1], t[0]])
        arm = a + f * (b - a) - polygon.centroid
        for slide in (mu, -mu):
            x, y = n + slide * t
            found.append([x, y, (arm[0] * y - arm[1] * x) / scale])
    return np.array(found)


def hull_of(points: np.ndarray, forces: str) -> np.ndarray:
    """Points whose convex hull is the set of all wrenches."""
    if forces == "sum":
        return points
    corners = [np.vstack((np.zeros(3), pair)) for pair in points.reshape(-1, 2, 3)]
    return np.array([np.sum(choice, axis=0) for choice in product(*corners)])


def rows_of(polygon: rl.Polygon, mu: float, scale: float, grasps: dict[str, np.ndarray]) -> list:
    pairs = zip(grasps["edges"], grasps["fractions"], strict=True)
    return [wrenches(polygon, mu, scale, edges, fractions) for edges, fractions in pairs]


# --- oracles ------------------------------------------------------------------------------------


@pytest.mark.parametrize("forces", FORCES)
@pytest.mark.parametrize("name", ["ell", "nut", "star 8"])
@pytest.mark.parametrize("contacts", [2, 3, 4])
def test_hulls_are_those_of_qhull(name: str, contacts: int, forces: str) -> None:
    polygon, mu = PARTS[name](), 0.5
    grasps = batch(polygon, contacts, 1, 60)
    given = {"friction": mu, "forces": forces, "torque_scale": 1.5, **grasps}
    epsilons, volumes = quality.epsilon(polygon, **given), quality.hull_volume(polygon, **given)
    seen = 0
    for row, points in enumerate(rows_of(polygon, mu, 1.5, grasps)):
        try:
            hull = ConvexHull(hull_of(points, forces))
        except QhullError:  # flat: a marginal grasp at best
            assert epsilons[row] <= 0
            continue
        inradius = -hull.equations[:, 3].max()
        if epsilons[row] > 0:
            seen += 1
            assert epsilons[row] == pytest.approx(inradius, abs=1e-9)
            assert volumes[row] == pytest.approx(hull.volume, rel=1e-7)
        elif volumes[row] > -np.inf:
            primitive = hull if forces == "sum" else ConvexHull(points)
            with_origin = ConvexHull(np.vstack((points, np.zeros(3))))
            assert -volumes[row] == pytest.approx(
                with_origin.volume - primitive.volume, abs=1e-7 * max(1.0, with_origin.volume)
            )
    assert seen > 5


def test_outside_epsilon_is_the_distance_to_the_hull() -> None:
    """The least norm of a convex combination of wrenches (Lawson and Hanson, chapter 23)."""
    polygon, mu = PARTS["ell"](), 0.3
    grasps = batch(polygon, 3, 2, 60)
    given = {"friction": mu, "torque_scale": 2.0, **grasps}
    epsilons = quality.epsilon(polygon, **given)
    each = quality.epsilon(polygon, forces="each", **given)
    seen = 0
    for row, points in enumerate(rows_of(polygon, mu, 2.0, grasps)):
        if np.isfinite(epsilons[row]) and epsilons[row] < -1e-6:
            weights, _ = nnls(np.vstack((points.T, np.ones(len(points)))), np.array([0, 0, 0, 1.0]))
            nearest = weights @ points / weights.sum()
            assert -epsilons[row] == pytest.approx(np.linalg.norm(nearest), rel=1e-6)
            assert each[row] == epsilons[row]
            seen += 1
    assert seen > 5


@pytest.mark.parametrize("forces", FORCES)
@pytest.mark.parametrize("contacts", [1, 2, 3, 4])
def test_loads_are_those_of_the_program(contacts: int, forces: str) -> None:
    polygon, mu, load = PARTS["ell"](), 0.4, np.array([0.3, -1.0, 0.7])
    grasps = batch(polygon, contacts, 3, 60)
    for at in (load, np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        given = {"friction": mu, "load": at, "forces": forces, **grasps}
        factors = quality.load_factor(polygon, **given)
        squeezes = quality.squeezing_force(polygon, **given)
        for row, points in enumerate(rows_of(polygon, mu, 1.0, grasps)):
            n = len(points)
            limits = np.ones((1, n)) if forces == "sum" else np.kron(np.eye(n // 2), [1.0, 1.0])
            program = linprog(
                np.append(np.zeros(n), -1.0),
                A_ub=np.pad(limits, ((0, 0), (0, 1))),
                b_ub=np.ones(len(limits)),
                A_eq=np.column_stack((points.T, at)),
                b_eq=np.zeros(3),
            )
            assert factors[row] == pytest.approx(-program.fun, abs=1e-8)
            assert squeezes[row] == (np.inf if factors[row] == 0 else 1 / factors[row])
        assert (factors > 0).any() == (contacts > 1) or contacts == 1


def test_a_flat_hull_carries_what_is_in_its_plane() -> None:
    """Two contacts at one corner: wrenches through one point."""
    square = unit_square()
    corner = [rl.Contact.at_fraction(0, 1.0), rl.Contact.at_fraction(1, 0.0)]
    away = np.array([1.0, -1.0])  # from the centroid, presses towards the corner
    load = [*away, 0.0]
    assert quality.load_factor(square, corner, 0.5, load=load) == pytest.approx(0.75)
    assert quality.load_factor(square, corner, 0.5, load=load, forces="each") == pytest.approx(1.5)
    assert quality.load_factor(square, corner, 0.5, load=(1, -1, 0.1)) == 0
    assert quality.epsilon(square, corner, 0.5) == -np.inf
    assert quality.epsilon(square, corner, 1.5) == 0  # rays span, but only forces
    volume = quality.hull_volume(square, corner, 1.5, forces="each")
    assert volume == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("contacts", [2, 3, 4])
def test_required_friction_is_that_of_rational_numbers(contacts: int) -> None:
    for name in ("ell", "nut", "square"):
        polygon = PARTS[name]()
        grasps = batch(polygon, contacts, 4, 40)
        found = quality.required_friction(polygon, **grasps)
        for row, value in enumerate(found.tolist()):
            pairs = zip(grasps["edges"][row].tolist(), grasps["fractions"][row], strict=True)
            exact = rl.least_friction(polygon, rl.Grasp.at_fractions(pairs))
            if exact is None:
                assert value == np.inf
            else:
                assert value == pytest.approx(exact, rel=1e-8, abs=0)


def test_required_friction_is_a_factor() -> None:
    polygon = PARTS["ell"]()
    mu = np.linspace(0.1, 0.6, polygon.n_edges)
    grasps = batch(polygon, 3, 5, 300)
    factors = quality.required_friction(polygon, friction=mu, **grasps)
    assert np.allclose(quality.required_friction(polygon, friction=2 * mu, **grasps), factors / 2)
    closed = rl.is_force_closure(polygon, friction=mu, **grasps)
    assert ((factors < 1) == closed).all()
    rows = np.flatnonzero(np.isfinite(factors) & (factors > 0) & (factors < 10))[:40]
    for row in rows:
        one = {name: array[[row]] for name, array in grasps.items()}
        for slack, expected in ((1 + 1e-7, True), (1 - 1e-7, False)):
            held = rl.is_force_closure(polygon, friction=factors[row] * slack * mu, **one)
            assert held[0] == expected
    assert len(rows) > 20


def test_nearly_aligned_contacts_need_next_to_no_friction() -> None:
    """Below what floating point can tell, by bisection in rational numbers."""
    square = unit_square()
    off = 2.0**-40
    grasps = {"edges": [[0, 2], [0, 2]], "fractions": [[0.5, 0.5 + off], [0.5, 0.5]]}
    found = quality.required_friction(square, **grasps)
    assert found[0] == pytest.approx(off, rel=1e-8)
    assert found[1] == 0


# --- closed forms -------------------------------------------------------------------------------


@pytest.mark.parametrize("mu", [0.1, 0.5, 1.5])
@pytest.mark.parametrize(("sides", "scale"), [(4, 1.0), (6, 0.5), (12, 2.0)])
def test_opposite_edges_of_a_regular_polygon(sides: int, scale: float, mu: float) -> None:
    """Wrenches are alternate corners of a box 2 μ by 2 by 2 h, with h = μ a / ρ."""
    angles = 2 * np.pi * np.arange(sides) / sides
    polygon = rl.Polygon(np.stack((np.cos(angles), np.sin(angles)), axis=1))
    grasp = rl.Grasp.at_fractions([(0, 0.5), (sides // 2, 0.5)])
    h = mu * np.cos(np.pi / sides) / scale
    inradius = 1 / np.sqrt(1 / mu**2 + 1 + 1 / h**2)
    assert quality.epsilon(polygon, grasp, mu, torque_scale=scale) == pytest.approx(inradius)
    assert quality.hull_volume(polygon, grasp, mu, torque_scale=scale) == pytest.approx(
        8 * mu * h / 3
    )
    assert quality.focus_distance(polygon, grasp, mu) == pytest.approx(0, abs=1e-12)
    assert quality.required_friction(polygon, grasp) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("mu", [0.05, 0.3, 0.577, 1.0])
@pytest.mark.parametrize("scale", [0.2, 1.0, 5.0])
def test_equilateral_triangle_at_its_midpoints(mu: float, scale: float) -> None:
    """The hull is that of two triangles, turned against each other by 2 θ, at heights ± h."""
    triangle = rl.Polygon([(0, 0), (6, 0), (3, 3 * np.sqrt(3))])
    grasp = rl.Grasp.at_fractions([(0, 0.5), (1, 0.5), (2, 0.5)])
    h, radius = mu * np.sqrt(3) / scale, np.hypot(1, mu)
    beyond = np.cos(np.pi / 3 - 2 * np.arctan(mu))  # of a corner below, past the side above
    side = h * radius * (0.5 + beyond) / np.hypot(radius * (beyond - 0.5), 2 * h)
    expected = min(h, side)
    assert quality.epsilon(triangle, grasp, mu, torque_scale=scale) == pytest.approx(expected)
    assert quality.focus_distance(triangle, grasp, mu) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("mu", [0.1, 0.5, 2.0])
def test_two_fingers_beside_a_block(mu: float) -> None:
    """A weight is held by friction alone: μ of the sum of normal forces."""
    block, grasp = rectangle(8, 3), [(1, 1.5), (3, 1.5)]
    assert quality.load_factor(block, grasp, mu) == pytest.approx(mu)
    assert quality.load_factor(block, grasp, mu, forces="each") == pytest.approx(2 * mu)
    force = quality.squeezing_force(block, grasp, mu, load=(0, -7.0, 0))
    assert force == pytest.approx(7 / mu)
    turning = quality.squeezing_force(block, grasp, mu, load=(0, 0, 7.0))
    assert turning == pytest.approx(7 / (4 * mu))  # on arms of 4


def test_torque_scales() -> None:
    """Of a rectangle ρ² = (w² + h²) / 12; the farthest point is a corner."""
    block = rectangle(8, 3)
    assert quality.torque_scale(block) == pytest.approx(np.sqrt((64 + 9) / 12))
    assert quality.torque_scale(block, "distance") == pytest.approx(np.hypot(4, 1.5))
    ring = rl.Polygon([(0, 0), (4, 0), (4, 4), (0, 4)], holes=[[(1, 1), (1, 3), (3, 3), (3, 1)]])
    outer, inner = 16 * 32 / 12, 4 * 8 / 12
    assert quality.torque_scale(ring) == pytest.approx(np.sqrt((outer - inner) / 12))
    disc = rl.Polygon(1e120**0.5 * PARTS["hexagon"]().vertices)
    assert np.isfinite(quality.torque_scale(disc))


# --- laws ---------------------------------------------------------------------------------------


@settings(max_examples=50)
@given(stars(), st.integers(2, 4), st.integers(0, 10**6), st.data())
def test_signs_agree(polygon: rl.Polygon, contacts: int, seed: int, data: st.DataObject) -> None:
    """Positive iff in force closure, and -inf exactly where the rays do not span."""
    mu = data.draw(frictions(polygon.n_edges))
    grasps = batch(polygon, contacts, seed, 25)
    closed = rl.is_force_closure(polygon, friction=mu, **grasps)
    margins = rl.margin(polygon, friction=mu, **grasps)
    for name, measure in SIGNED.items():
        values = measure(polygon, friction=mu, **grasps)
        assert not np.isnan(values).any(), name
        assert ((values > 0) == closed).all(), name
        assert ((values == -np.inf) == (margins == -np.inf)).all(), name
    for load in ((0, -1, 0), (1, 2, -0.5)):
        factors = quality.load_factor(polygon, friction=mu, load=load, **grasps)
        assert (factors >= 0).all()
        assert (factors[closed] > 0).all()
    if contacts < 4:
        distances = quality.focus_distance(polygon, friction=mu, **grasps)
        assert (np.isfinite(distances) == closed).all()


@pytest.mark.parametrize("name", LATTICE)
def test_signs_agree_where_much_is_aligned(name: str) -> None:
    polygon = LATTICE[name]
    for mu, contacts in product((0.5, 1.0), (2, 3)):
        grasps = batch(polygon, contacts, 6, 150)
        closed = rl.is_force_closure(polygon, friction=mu, **grasps)
        for measure in SIGNED.values():
            assert ((measure(polygon, friction=mu, **grasps) > 0) == closed).all()
        distances = quality.focus_distance(polygon, friction=mu, **grasps)
        assert (np.isfinite(distances) == closed).all()
        # at the threshold itself rounding may decide
        needed = quality.required_friction(polygon, friction=mu, **grasps)
        sure = np.abs(needed - 1) > 1e-8
        assert ((needed < 1) == closed)[sure].all()


@pytest.mark.parametrize("forces", FORCES)
def test_epsilon_falls_by_no_more_than_contacts_move(forces: str) -> None:
    polygon, rng = PARTS["ell"](), np.random.default_rng(7)
    grasps = batch(polygon, 3, 7, 400)
    lengths = polygon.edge_lengths[grasps["edges"]]
    moved = np.clip(grasps["fractions"] + rng.uniform(-0.05, 0.05, (400, 3)), 0, 1)
    moves = np.abs(moved - grasps["fractions"]) * lengths
    given = {"friction": 0.5, "forces": forces, "torque_scale": 1.7}
    before = quality.epsilon(polygon, **given, **grasps)
    after = quality.epsilon(polygon, **given, **{**grasps, "fractions": moved})
    most = moves.max(axis=1) if forces == "sum" else moves.sum(axis=1)
    both = (before > 0) & (after > 0)
    assert both.sum() > 100
    assert (np.abs(before[both] - after[both]) <= most[both] / 1.7 + 1e-9).all()


def test_more_is_not_less() -> None:
    """More force, more contacts, more friction."""
    polygon = PARTS["star 8"]()
    grasps = batch(polygon, 3, 8, 300)
    pairs = {name: array[:, :2] for name, array in grasps.items()}
    for measure in (quality.epsilon, quality.hull_volume):
        values = measure(polygon, friction=0.5, **grasps)
        closed = values > 0
        assert (measure(polygon, friction=0.5, forces="each", **grasps) >= values - 1e-12).all()
        assert (measure(polygon, friction=0.7, **grasps) >= values - 1e-12)[closed].all()
        fewer = measure(polygon, friction=0.5, **pairs)
        assert (values >= fewer - 1e-12)[fewer > 0].all()
    least = quality.required_friction(polygon, **grasps)
    assert (least <= quality.required_friction(polygon, **pairs) * (1 + 1e-8)).all()


def test_turning_scaling_and_torque_scale() -> None:
    polygon = PARTS["ell"]()
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    other = rl.Polygon(polygon.vertices @ turn * 2.5 + [7, -3])
    grasps = batch(polygon, 3, 9, 300)
    for name, measure in SIGNED.items():
        here = measure(polygon, friction=0.4, **grasps)
        there = measure(other, friction=0.4, **grasps)
        both = np.isfinite(here) & np.isfinite(there) & (np.sign(here) == np.sign(there))
        factor = 2.5 if name == "margin" else 1.0
        assert both.sum() > 100, name
        assert np.allclose(there[both], factor * here[both], atol=1e-7), name
    load = np.array([0.3, -1.0, 0.4])
    moved = np.append(load[:2] @ turn, 2.5 * load[2])
    assert np.allclose(
        quality.load_factor(polygon, friction=0.4, load=load, **grasps),
        quality.load_factor(other, friction=0.4, load=moved, **grasps),
        atol=1e-9,
    )
    volumes = [
        quality.hull_volume(polygon, friction=0.4, torque_scale=rho, **grasps) for rho in (1, 4)
    ]
    closed = volumes[0] > 0
    assert np.allclose(volumes[0][closed], 4 * volumes[1][closed])


@pytest.mark.parametrize("forces", FORCES)
@pytest.mark.parametrize("factor", [1e-14, 1e-9, 1e9, 1e14])
def test_volumes_do_not_care_how_torques_are_scaled(factor: float, forces: str) -> None:
    polygon, mu = PARTS["nut"](), 0.4
    given = {"friction": mu, "forces": forces, **batch(polygon, 3, 13, 200)}
    here = quality.hull_volume(polygon, torque_scale=1.5, **given)
    there = quality.hull_volume(polygon, torque_scale=1.5 * factor, **given)
    closed = here > 0
    assert closed.sum() > 20
    assert np.allclose(there[closed] * factor, here[closed], rtol=1e-6, atol=0)


@pytest.mark.parametrize("factor", [1e-90, 1e90])
def test_no_size_of_an_object_is_too_small_or_too_large(factor: float) -> None:
    polygon, other = PARTS["ell"](), rl.Polygon(factor * PARTS["ell"]().vertices)
    grasps = {"friction": 0.4, **batch(polygon, 3, 11, 100)}
    for measure in (*SIGNED.values(), quality.required_friction, quality.load_factor):
        unit = factor if measure is quality.margin else 1.0
        here, there = measure(polygon, **grasps), measure(other, **grasps) / unit
        assert np.array_equal(np.isfinite(here), np.isfinite(there))
        assert np.allclose(here[np.isfinite(here)], there[np.isfinite(here)], atol=1e-7)


@pytest.mark.parametrize("mu", [1e-9, 1e-3, 1e3, 1e6])
def test_no_friction_is_too_small_or_too_large(mu: float) -> None:
    polygon = PARTS["ell"]()
    grasps = {"friction": mu, **batch(polygon, 3, 12, 150)}
    closed = rl.is_force_closure(polygon, **grasps)
    for measure in SIGNED.values():
        assert ((measure(polygon, **grasps) > 0) == closed).all()
    assert ((quality.required_friction(polygon, **grasps) < 1) == closed).all()
    assert (np.isfinite(quality.focus_distance(polygon, **grasps)) == closed).all()


def test_one_is_many() -> None:
    polygon = PARTS["ell"]()
    grasps = batch(polygon, 3, 10, 20)
    every = (
        *SIGNED.values(),
        quality.required_friction,
        quality.load_factor,
        quality.squeezing_force,
        quality.focus_distance,
    )
    for measure in every:
        values = measure(polygon, friction=0.4, **grasps)
        for row in range(20):
            pairs = zip(grasps["edges"][row].tolist(), grasps["fractions"][row], strict=True)
            one = measure(polygon, rl.Grasp.at_fractions(pairs), 0.4)
            assert isinstance(one, float)
            assert one == pytest.approx(values[row], rel=1e-9)
        none = np.zeros((0, 3), dtype=int)
        assert measure(polygon, friction=0.4, edges=none, fractions=none).shape == (0,)


def test_wrong_arguments() -> None:
    square, grasp = unit_square(), [(0, 0.5), (2, 0.5)]
    for scale in (0, -1, np.nan, np.inf, "size", None, True):
        with pytest.raises(rl.OptionError, match="torque_scale"):
            quality.epsilon(square, grasp, 0.5, torque_scale=scale)
    for forces in ("max", 1, None):
        for measure in (quality.epsilon, quality.hull_volume, quality.load_factor):
            with pytest.raises(rl.OptionError, match="forces"):
                measure(square, grasp, 0.5, forces=forces)
    for load in ((0, 0, 0), (1, 2), (1, np.nan, 0), "down", None):
        with pytest.raises(rl.OptionError, match="a load is three"):
            quality.squeezing_force(square, grasp, 0.5, load=load)
    with pytest.raises(rl.ContactError, match="2 or 3 contacts"):
        quality.focus_distance(square, [(0, 0.5), (1, 0.5), (2, 0.5), (3, 0.5)], 0.5)
    for measure in (quality.epsilon, quality.focus_distance, quality.load_factor):
        with pytest.raises(rl.FrictionError, match="friction is missing"):
            measure(square, grasp, None)
        with pytest.raises(rl.ContactError):
            measure(square, friction=0.5)
