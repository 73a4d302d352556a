"""Margin and tolerance: closed forms, what they promise, and signs."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from conftest import covering
from geometry import GENERAL, LATTICE, exact_ray, rectangle, unit_square
from regrasps import PARTS, random_grasps

import regrasp_lp as rl
from regrasp_lp.friction import Cones

POLYGONS = {**LATTICE, **GENERAL}


def batch(polygon: rl.Polygon, contacts: int, seed: int, count: int = 300) -> tuple:
    rng = np.random.default_rng([seed, contacts])
    edges = rng.integers(0, polygon.n_edges, (count, contacts))
    fractions = rng.random(edges.shape)
    coarse = rng.random(edges.shape) < 0.4
    return edges, np.where(coarse, np.round(4 * fractions) / 4, fractions)


@pytest.mark.parametrize(("name", "friction"), covering(POLYGONS, [0.125, 0.5, 1.5]))
def test_batch_is_loop_and_sign_is_force_closure(name: str, friction: float) -> None:
    polygon = POLYGONS[name]
    for contacts in (2, 3, 4):
        edges, fractions = batch(polygon, contacts, 1)
        margins = rl.margin(polygon, friction=friction, edges=edges, fractions=fractions)
        tolerances = rl.tolerance(polygon, friction=friction, edges=edges, fractions=fractions)
        closed = rl.is_force_closure(polygon, friction=friction, edges=edges, fractions=fractions)
        sure = np.abs(margins) > 1e-12 * polygon.diameter
        assert ((margins > 0) == closed)[sure].all()
        inner = ((fractions > 0) & (fractions < 1)).all(axis=1)
        assert ((tolerances > 0) == closed)[sure & inner].all()
        assert (tolerances[~inner] <= 0).all()
        for row in range(0, len(edges), 23):
            grasp = rl.Grasp.at_fractions(zip(edges[row].tolist(), fractions[row], strict=True))
            assert rl.margin(polygon, grasp, friction) == pytest.approx(margins[row], rel=1e-12)
            assert rl.tolerance(polygon, grasp, friction) == pytest.approx(
                tolerances[row], rel=1e-12
            )
        positions = fractions * polygon.edge_lengths[edges]
        again = rl.margin(polygon, friction=friction, edges=edges, positions=positions)
        finite = np.isfinite(margins)
        assert np.allclose(again[finite], margins[finite], atol=1e-9 * polygon.diameter)


@pytest.mark.parametrize("name", LATTICE)
def test_infinite_exactly_where_the_rays_do_not_span(name: str) -> None:
    """Rays do not positively span the plane iff all are on one side of some line."""
    polygon = LATTICE[name]
    for friction in (0.5, 1.0, 2.0):
        cones = Cones.of(polygon, friction)
        for contacts in (1, 2, 3):
            edges, fractions = batch(polygon, contacts, 2, 120)
            margins = rl.margin(polygon, friction=friction, edges=edges, fractions=fractions)
            tolerances = rl.tolerance(polygon, friction=friction, edges=edges, fractions=fractions)
            expected = [not spans(cones, row) for row in edges.tolist()]
            assert (margins == -np.inf).tolist() == expected
            assert (tolerances == -np.inf).tolist() == expected


def spans(cones: Cones, edges: list[int]) -> bool:
    rays = [exact_ray(cones, 2 * edge + side) for edge in edges for side in (0, 1)]
    sides = [(-y, x) for x, y in rays] + [(y, -x) for x, y in rays]
    return not any(all(nx * x + ny * y >= Fraction(0) for x, y in rays) for nx, ny in sides)


@pytest.mark.parametrize("friction", [0.1, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("offset", [0.0, 0.1, -0.35, 1.2])
def test_two_parallel_edges(friction: float, offset: float) -> None:
    """Distance h, contacts x apart along the edges: (h sin θ - |x| cos θ) / 2."""
    block = rectangle(8, 3)
    grasp = [(0, 4.0), (2, 4.0 + offset)]
    theta = np.arctan(friction)
    margin = (3 * np.sin(theta) - abs(offset) * np.cos(theta)) / 2
    assert rl.margin(block, grasp, friction) == pytest.approx(margin, abs=1e-12)
    tolerance = min((3 * friction - abs(offset)) / 2, 4.0, 4.0 - abs(offset))
    if margin > 0:
        assert rl.tolerance(block, grasp, friction) == pytest.approx(tolerance, abs=1e-12)


def test_two_parallel_edges_of_unlike_friction() -> None:
    """The cone that counts is the smaller one of the two."""
    block = rectangle(8, 3)
    friction = [0.2, 0.5, 0.7, 0.5]
    grasp = [(0, 4.0), (2, 4.1)]
    assert rl.tolerance(block, grasp, friction) == pytest.approx((3 * 0.2 - 0.1) / 2)


@pytest.mark.parametrize("friction", [0.05, 0.3, 0.577, 1.0, 2.5])
@pytest.mark.parametrize("side", [1.0, 6.0])
def test_equilateral_triangle_at_its_midpoints(side: float, friction: float) -> None:
    """Three equal forces, each turned by θ: r sin θ, and r tan θ up to half a side."""
    triangle = rl.Polygon([(0, 0), (side, 0), (side / 2, side * np.sqrt(3) / 2)])
    grasp = rl.Grasp.at_fractions([(0, 0.5), (1, 0.5), (2, 0.5)])
    r = side / (2 * np.sqrt(3))
    margin = r * friction / np.hypot(1, friction)
    assert rl.margin(triangle, grasp, friction) == pytest.approx(margin, rel=1e-9)
    tolerance = min(r * friction, side / 2)
    assert rl.tolerance(triangle, grasp, friction) == pytest.approx(tolerance, rel=1e-9)


@pytest.mark.parametrize("name", PARTS)
def test_contacts_within_the_tolerance_stay_in_force_closure(name: str) -> None:
    polygon = PARTS[name]()
    rng = np.random.default_rng(0)
    for grasp in random_grasps(polygon, 0.4, rng, 15, 3):
        tolerance = rl.tolerance(polygon, grasp, 0.4)
        resolved = polygon.resolve(grasp)
        shifts = rng.choice([-1.0, 1.0], (16, 3)) * tolerance * (1 - 1e-9)
        positions = resolved.positions + shifts
        lengths = polygon.edge_lengths[resolved.edges]
        edges = np.tile(resolved.edges, (16, 1))
        inside = ((positions >= 0) & (positions <= lengths)).all()
        assert inside
        assert rl.is_force_closure(polygon, friction=0.4, edges=edges, positions=positions).all()
        # and some shift a little farther leaves force closure, or an edge
        far = resolved.positions + shifts * (1 + 1e-6)
        off = ((far < 0) | (far > lengths)).any()
        if not off:
            corners = [
                resolved.positions + tolerance * (1 + 1e-6) * sign * np.ones(3) for sign in (-1, 1)
            ]
            on = [c for c in corners if ((c >= 0) & (c <= lengths)).all()]
            closed = [
                rl.is_force_closure(
                    polygon, rl.Grasp(zip(resolved.edges.tolist(), c, strict=True)), 0.4
                )
                for c in on
            ]
            assert len(on) < 2 or not all(closed)


def test_scaling_and_turning() -> None:
    """Both are lengths; neither depends on where the object lies."""
    polygon = PARTS["ell"]()
    turned = polygon.vertices @ np.array([[0.6, 0.8], [-0.8, 0.6]]) * 2.5 + [7, -3]
    edges, fractions = batch(polygon, 3, 3)
    for measure in (rl.margin, rl.tolerance):
        here = measure(polygon, friction=0.4, edges=edges, fractions=fractions)
        there = measure(rl.Polygon(turned), friction=0.4, edges=edges, fractions=fractions)
        finite = np.isfinite(here) & np.isfinite(there)
        assert finite.sum() > 100
        assert np.allclose(there[finite], 2.5 * here[finite], atol=1e-9)


def test_more_contacts_and_more_friction_take_nothing() -> None:
    polygon = PARTS["ell"]()
    edges, fractions = batch(polygon, 3, 4)
    low, high = (
        rl.margin(polygon, friction=mu, edges=edges, fractions=fractions) for mu in (0.3, 0.4)
    )
    closed = low > 0
    assert (high[closed] > 0).all()
    pair = rl.margin(polygon, friction=0.4, edges=edges[:, :2], fractions=fractions[:, :2])
    assert (high >= pair - 1e-12).all()


def test_empty_and_large_batches() -> None:
    square = unit_square()
    none = np.zeros((0, 2), dtype=int)
    assert rl.margin(square, friction=0.5, edges=none, fractions=none).shape == (0,)
    edges = np.tile([0, 2], (45_000, 1))
    fractions = np.full(edges.shape, 0.5)
    margins = rl.margin(square, friction=0.5, edges=edges, fractions=fractions)
    assert margins.shape == (45_000,)
    assert set(margins.tolist()) == {rl.margin(square, [(0, 0.5), (2, 0.5)], 0.5)}


@pytest.mark.parametrize("measure", [rl.margin, rl.tolerance])
def test_wrong_arguments(measure) -> None:
    square, grasp = unit_square(), [(0, 0.5), (2, 0.5)]
    with pytest.raises(rl.FrictionError, match="friction is missing"):
        measure(square, grasp, None)
    for friction in (0.0, -1.0, np.nan, [0.5] * 3):
        with pytest.raises(rl.FrictionError):
            measure(square, grasp, friction)
    with pytest.raises(rl.ContactError):
        measure(square, [(9, 0.5), (2, 0.5)], 0.5)
    with pytest.raises(rl.ContactError):
        measure(square, friction=0.5)
    with pytest.raises(rl.ContactError):
        measure(square, friction=0.5, edges=[[0, 9]], fractions=[[0.5, 0.5]])
    with pytest.raises(rl.ContactError):
        measure(square, grasp, 0.5, edges=[[0, 2]], fractions=[[0.5, 0.5]])
