"""Candidates from sorted normals against loops over all pairs and triples in rational numbers."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, combinations_with_replacement, product

import numpy as np
import pytest
from fourier_motzkin import row, solvable
from geometry import GENERAL, LATTICE, comb, cross, exact_ray, lattice_star, regular, star
from hypothesis import given, settings
from hypothesis import strategies as st

from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets import candidates
from regrasp_lp.grasp_sets.candidates import (
    common_cone,
    complete_candidates,
    concurrent_candidates,
    parallel_candidates,
    runs,
    two_finger_candidates,
)
from regrasp_lp.polygon import Polygon

SHAPES = {**LATTICE, **GENERAL, "comb3": comb(3), "regular8": regular(8), "regular12": regular(12)}
FRICTIONS = {"low": 0.125, "half": 0.5, "one": 1.0, "above one": 1.75, "per edge": None}


def cones_of(polygon: Polygon, friction: str) -> Cones:
    mu = FRICTIONS[friction]
    if mu is None:
        mu = np.random.default_rng(3).choice([0.125, 0.25, 0.5, 1.0, 2.0], polygon.n_edges)
    return Cones.of(polygon, mu)


class Brute:
    """The definitions of sections 3.2 and 3.3, one combination at a time, in rational numbers."""

    def __init__(self, cones: Cones) -> None:
        self.rays = [exact_ray(cones, r) for r in range(2 * cones.n_edges)]
        self.n = cones.n_edges

    def interiors_meet(self, signed: list[tuple[int, int]]) -> bool:
        """Whether open cones ``s C_i`` have a direction d in common: e_0 × d > 0, d × e_1 > 0."""
        rows = []
        for edge, s in signed:
            (ax, ay), (bx, by) = self.rays[2 * edge], self.rays[2 * edge + 1]
            rows.append(row([0, s * ay, -s * ax], strict=True))
            rows.append(row([0, -s * by, s * bx], strict=True))
        return solvable(rows)

    def spans(self, edges: tuple[int, ...]) -> bool:
        """No y ≠ 0 with y · e >= 0 for all rays."""
        rays = [self.rays[2 * e + side] for e in edges for side in (0, 1)]
        half_plane = [row([0, -x, -y], strict=False) for x, y in rays]
        return not any(
            solvable([*half_plane, row([0, *y], strict=True)])
            for y in ((1, 0), (-1, 0), (0, 1), (0, -1))
        )

    def follows(self, a: int, b: int) -> bool:
        return all(
            cross(self.rays[2 * a + s], self.rays[2 * b + t]) > 0
            for s, t in product((0, 1), (0, 1))
        )

    def two_finger(self) -> list[tuple[int, int]]:
        return [
            (a, b)
            for a, b in combinations(range(self.n), 2)
            if self.interiors_meet([(a, 1), (b, -1)])
        ]

    def concurrent(self) -> list[tuple[int, int, int]]:
        return [
            (a, b, c)
            for a, b, c in combinations(range(self.n), 3)
            if (self.follows(a, b) and self.follows(b, c) and self.follows(c, a))
            or (self.follows(a, c) and self.follows(c, b) and self.follows(b, a))
        ]

    def parallel(self) -> list[tuple[int, int, int, int]]:
        return [
            (*triple, center)
            for triple in combinations(range(self.n), 3)
            for center in triple
            if self.interiors_meet([(e, -1 if e == center else 1) for e in triple])
        ]

    def complete(self, m: int) -> list[tuple[int, ...]]:
        return [e for e in combinations_with_replacement(range(self.n), m) if self.spans(e)]


def as_tuples(rows: np.ndarray) -> list[tuple[int, ...]]:
    return [tuple(r) for r in rows.tolist()]


def assert_candidates(cones: Cones, complete: bool = True) -> None:
    brute = Brute(cones)
    assert as_tuples(two_finger_candidates(cones)) == brute.two_finger()
    assert as_tuples(concurrent_candidates(cones)) == brute.concurrent()
    edges, centers = parallel_candidates(cones)
    assert as_tuples(np.column_stack((edges, centers))) == brute.parallel()
    if complete:
        assert as_tuples(complete_candidates(cones, 2)) == brute.complete(2)
        assert as_tuples(complete_candidates(cones, 3)) == brute.complete(3)


@pytest.mark.parametrize("name", [n for n, p in SHAPES.items() if p.n_edges < 9])
@pytest.mark.parametrize("friction", FRICTIONS)
def test_candidates_equal_a_loop(name: str, friction: str) -> None:
    assert_candidates(cones_of(SHAPES[name], friction))


@pytest.mark.parametrize("name", [n for n, p in SHAPES.items() if p.n_edges >= 9])
@pytest.mark.parametrize("friction", ["half", "one", "per edge"])
def test_candidates_of_larger_shapes_equal_a_loop(name: str, friction: str) -> None:
    polygon = SHAPES[name]
    assert_candidates(cones_of(polygon, friction), complete=polygon.n_edges < 11)


@settings(max_examples=25)
@given(st.integers(4, 7), st.integers(0, 10**6), st.integers(0, 10**6))
def test_candidates_of_lattice_stars_equal_a_loop(n: int, seed: int, of_friction: int) -> None:
    mu = np.random.default_rng(of_friction).choice([0.25, 0.5, 1.0, 2.0, 3.0, 1e4], n)
    assert_candidates(Cones.of(lattice_star(n, seed, 3), mu), complete=n < 6)


@pytest.mark.parametrize("mu", [1e-6, 1e6])
def test_candidates_at_extreme_friction(mu: float) -> None:
    for polygon in (LATTICE["hexagon"], regular(6), star(7, 0)):
        assert_candidates(Cones.of(polygon, mu))


def test_known_candidates_of_a_rectangle() -> None:
    cones = Cones.of(LATTICE["rectangle"], 0.5)
    assert as_tuples(two_finger_candidates(cones)) == [(0, 2), (1, 3)]
    assert len(concurrent_candidates(cones)) == 0
    assert len(parallel_candidates(cones)[0]) == 0
    assert as_tuples(complete_candidates(cones, 2)) == [(0, 2), (1, 3)]


def test_above_one_a_triple_can_have_several_centres() -> None:
    edges, _ = parallel_candidates(Cones.of(regular(5), 3.0))
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() > 1
    edges, _ = parallel_candidates(Cones.of(regular(5), 0.99))
    assert len(edges) > 0
    assert np.unique(edges, axis=0, return_counts=True)[1].max() == 1


def test_angles_at_the_very_boundary_are_decided_exactly() -> None:
    """A regular 12-gon at tan 15°, off by one unit in the last place: no slack, no loss."""
    for mu in (np.tan(np.pi / 12), np.tan(np.pi / 6), np.tan(np.pi / 4)):
        for value in (mu, np.nextafter(mu, 0), np.nextafter(mu, 2)):
            assert_candidates(Cones.of(regular(12), value), complete=False)


def test_no_edge_occurs_three_times_and_rows_ascend() -> None:
    triples = complete_candidates(Cones.of(star(8, 2), 1.0), 3)
    assert (np.diff(triples, axis=1) >= 0).all()
    assert (triples[:, 0] < triples[:, 2]).all()
    assert as_tuples(triples) == sorted(as_tuples(triples))


def test_chunks_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    cones = Cones.of(star(9, 1), 0.5)
    expected = complete_candidates(cones, 3)
    monkeypatch.setattr(candidates, "_CHUNK", 20)
    np.testing.assert_array_equal(complete_candidates(cones, 3), expected)


def test_runs() -> None:
    assert runs(np.array([3, 7, 2]), np.array([2, 0, 3])).tolist() == [3, 4, 2, 3, 4]
    assert runs(np.zeros(0, dtype=int), np.zeros(0, dtype=int)).tolist() == []


@pytest.mark.parametrize("name", ["hexagon", "comb", "star9", "regular6", "collinear"])
def test_boundaries_of_common_cones(name: str) -> None:
    """Both boundaries are in all three closed cones, and the cone between them is not empty."""
    cones = cones_of(SHAPES[name], "per edge")
    rays = Brute(cones).rays
    edges, centers = parallel_candidates(cones)
    sides = [sorted(set(e) - {c}) for e, c in zip(edges.tolist(), centers.tolist(), strict=True)]
    triples = np.column_stack((centers, np.array(sides).reshape(-1, 2)))
    common = common_cone(cones, triples)
    assert common.exists.all()
    for n, triple in enumerate(triples.tolist()):
        boundaries = [
            tuple(Fraction(int(common.sign[n, i])) * v for v in rays[common.ray[n, i]])
            for i in (0, 1)
        ]
        assert cross(boundaries[0], boundaries[1]) > 0
        for slot, edge in enumerate(triple):
            s = -1 if slot == 0 else 1
            start, end = (tuple(s * v for v in rays[2 * edge + side]) for side in (0, 1))
            for d in boundaries:
                assert cross(start, d) >= 0
                assert cross(d, end) >= 0
