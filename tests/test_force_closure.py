"""Force closure by wrenches, against a linear program, exact definitions and invariances."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from wrench_oracle import closed, contact_wrenches, exact_point

from regrasp_lp import wrenches
from regrasp_lp.errors import ContactError, FrictionError
from regrasp_lp.force_closure import is_force_closure, least_friction
from regrasp_lp.polygon import Grasp, Polygon

RECTANGLE = Polygon([(0, 0), (4, 0), (4, 2), (0, 2)])
LATTICE_SHAPES = [
    RECTANGLE,
    Polygon([(0, 0), (4, 0), (0, 4)]),
    Polygon([(0, 0), (4, 0), (4, 2), (2, 2), (2, 4), (0, 4)]),
    Polygon([(0, 0), (4, 0), (4, 4), (0, 4)], holes=[[(1, 1), (1, 2), (2, 2), (2, 1)]]),
]
FRICTIONS = [0.25, 0.5, 0.75, 1.0, 2.0]


def star(rng: np.random.Generator, n: int = 9) -> Polygon:
    angles = (np.arange(n) + rng.uniform(0.1, 0.9, n)) * 2 * np.pi / n
    radii = rng.uniform(0.5, 1.5, n)
    return Polygon(np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1))


def random_grasps(
    rng: np.random.Generator, polygon: Polygon, count: int, m: int
) -> tuple[np.ndarray, np.ndarray]:
    return rng.integers(0, polygon.n_edges, (count, m)), rng.random((count, m))


def lattice_grasps(min_size: int = 2, max_size: int = 6) -> st.SearchStrategy:
    """A shape of small integers, a friction and contacts at multiples of 1/8 (often equal)."""
    return st.sampled_from(LATTICE_SHAPES).flatmap(
        lambda shape: st.tuples(
            st.just(shape),
            st.sampled_from(FRICTIONS),
            st.lists(
                st.tuples(
                    st.integers(0, shape.n_edges - 1), st.integers(0, 8).map(lambda k: k / 8)
                ),
                min_size=min_size,
                max_size=max_size,
            ),
        )
    )


# --- against other definitions ------------------------------------------------------------------


@pytest.mark.parametrize("m", [2, 3, 4])
def test_agrees_with_a_linear_program_away_from_the_boundary(m: int) -> None:
    """Wrenches positively span iff some strictly positive combination of them vanishes."""
    rng = np.random.default_rng(m)
    counts = {True: 0, False: 0}
    for _ in range(60):
        polygon = star(rng)
        mu = float(rng.uniform(0.1, 1.5))
        edges, fractions = random_grasps(rng, polygon, 3, m)
        verdicts = is_force_closure(polygon, friction=mu, edges=edges, fractions=fractions)
        for edge, fraction, verdict in zip(edges, fractions, verdicts, strict=True):
            w = np.array(
                contact_wrenches(
                    polygon, mu, list(zip(edge.tolist(), fraction.tolist(), strict=True))
                ),
                dtype=float,
            )
            w /= np.linalg.norm(w, axis=1)[:, None]
            n = len(w)
            # maximise d subject to c >= d, W c = 0, sum c = 1
            result = linprog(
                c=np.r_[np.zeros(n), -1.0],
                A_eq=np.vstack([np.c_[w.T, np.zeros(3)], np.r_[np.ones(n), 0.0]]),
                b_eq=[0, 0, 0, 1],
                A_ub=np.c_[-np.eye(n), np.ones(n)],
                b_ub=np.zeros(n),
                bounds=[(None, None)] * (n + 1),
            )
            if result.status == 0 and abs(result.fun) > 1e-6 and np.linalg.svd(w)[1][2] > 1e-6:
                assert verdict == (result.fun < 0)
                counts[bool(verdict)] += 1
    assert min(counts.values()) > 5


@settings(max_examples=250, deadline=None)
@given(lattice_grasps(max_size=4))
def test_agrees_with_the_definition_in_fractions(case: tuple) -> None:
    shape, mu, contacts = case
    assert is_force_closure(shape, Grasp.at_fractions(contacts), mu) == closed(shape, mu, contacts)


@settings(max_examples=40, deadline=None)
@given(lattice_grasps(min_size=5))
def test_agrees_with_the_definition_for_many_contacts(case: tuple) -> None:
    shape, mu, contacts = case
    assert is_force_closure(shape, Grasp.at_fractions(contacts), mu) == closed(shape, mu, contacts)


def strictly_in_cone(polygon: Polygon, mu: float, edge: int, d: tuple[Fraction, Fraction]) -> bool:
    a, b = exact_point(polygon, edge, Fraction(0)), exact_point(polygon, edge, Fraction(1))
    tx, ty = b[0] - a[0], b[1] - a[1]
    along, inward = d[0] * tx + d[1] * ty, -d[0] * ty + d[1] * tx
    return inward > 0 and abs(along) < Fraction(mu) * inward


def nguyen(polygon: Polygon, mu: float, contacts: list[tuple[int, float]]) -> bool:
    """Two contacts: the line through them lies strictly inside both cones, on opposite sides."""
    (i, f), (j, g) = contacts
    p, q = exact_point(polygon, i, Fraction(f)), exact_point(polygon, j, Fraction(g))
    d, back = (q[0] - p[0], q[1] - p[1]), (p[0] - q[0], p[1] - q[1])
    return any(
        strictly_in_cone(polygon, mu, i, u) and strictly_in_cone(polygon, mu, j, v)
        for u, v in ((d, back), (back, d))
    )


@settings(max_examples=300, deadline=None)
@given(lattice_grasps(max_size=2))
def test_two_fingers_on_lattice_shapes_follow_nguyen(case: tuple) -> None:
    shape, mu, contacts = case
    assert is_force_closure(shape, Grasp.at_fractions(contacts), mu) == nguyen(shape, mu, contacts)


def test_two_fingers_on_random_shapes_follow_nguyen() -> None:
    rng = np.random.default_rng(5)
    found = 0
    for _ in range(20):
        polygon, mu = star(rng), float(rng.uniform(0.1, 2))
        edges, fractions = random_grasps(rng, polygon, 40, 2)
        verdicts = is_force_closure(polygon, friction=mu, edges=edges, fractions=fractions)
        found += verdicts.sum()
        expected = [
            nguyen(polygon, mu, list(zip(e, f, strict=True)))
            for e, f in zip(edges.tolist(), fractions.tolist(), strict=True)
        ]
        np.testing.assert_array_equal(verdicts, expected)
    assert found > 50


def test_fewer_than_two_contacts_never_hold() -> None:
    assert not is_force_closure(RECTANGLE, [(0, 1.0)], 1.0)
    assert not is_force_closure(RECTANGLE, [], 1.0)
    empty = is_force_closure(
        RECTANGLE, friction=1.0, edges=np.zeros((0, 3), int), fractions=np.zeros((0, 3))
    )
    assert empty.shape == (0,)


def test_the_boundary_is_no_force_closure_to_the_last_bit() -> None:
    """The line from (2, 0) to (1, 2) has slope 1/2 against the normals."""
    on, inside = 0.75, np.nextafter(0.75, 0)
    assert not is_force_closure(RECTANGLE, Grasp.at_fractions([(0, 0.5), (2, on)]), 0.5)
    assert is_force_closure(RECTANGLE, Grasp.at_fractions([(0, 0.5), (2, inside)]), 0.5)
    assert is_force_closure(
        RECTANGLE, Grasp.at_fractions([(0, 0.5), (2, on)]), np.nextafter(0.5, 1)
    )


# --- the filter ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "move", [lambda v: v, lambda v: v + 1e6, lambda v: v * 2.0**-300, lambda v: v * 2.0**300]
)
def test_signs_that_the_filter_accepts_are_right(move: object) -> None:
    """Near-degenerate grasps: lattice contacts moved by a few units in the last place."""
    rng = np.random.default_rng(11)
    polygon = Polygon(move(RECTANGLE.vertices / 3))
    edges = rng.integers(0, 4, (400, 3))
    fractions = rng.integers(1, 8, (400, 3)) / 8 * (1 + rng.integers(-3, 4, (400, 3)) * 2.0**-52)
    mu = np.full(4, 0.5)
    value, bound = wrenches.float_determinants(polygon, mu, edges, fractions)
    exact = wrenches.exact_determinants(polygon, mu, edges, fractions)
    known = np.abs(value) > bound
    assert 0.5 < known.mean() < 1
    np.testing.assert_array_equal(
        np.sign(value)[known], ((exact > 0).astype(int) - (exact < 0).astype(int))[known]
    )
    np.testing.assert_array_equal(
        wrenches.decide(polygon, mu, edges, fractions),
        wrenches.decide_exactly(polygon, mu, edges, fractions),
    )


def test_the_filter_bounds_its_error() -> None:
    """Compare with the determinants of the very rays that the filter scales to."""
    rng = np.random.default_rng(12)
    worst = 0.0
    for _ in range(20):
        polygon, mu = star(rng), rng.uniform(0.05, 3, 9)
        edges, fractions = random_grasps(rng, polygon, 20, 3)
        value, bound = wrenches.float_determinants(polygon, mu, edges, fractions)
        exact = wrenches.exact_determinants(polygon, mu, edges, fractions)
        for column in range(20):
            # Both are positive multiples of the same numbers: 2 m rays, factors by edge.
            pivot = int(np.abs(value[:, column]).argmax())
            same = [t for t, rays in enumerate(triples(6)) if contacts(rays) == contacts_of(pivot)]
            factor = Fraction(float(value[pivot, column])) / exact[pivot, column]
            for t in same:
                error = abs(Fraction(float(value[t, column])) - factor * exact[t, column])
                worst = max(worst, float(error) / bound[column])
    assert worst < 1


def triples(n_rays: int) -> list[tuple[int, int, int]]:
    return [
        (i, j, k) for i in range(n_rays) for j in range(i + 1, n_rays) for k in range(j + 1, n_rays)
    ]


def contacts(rays: tuple[int, int, int]) -> list[int]:
    return sorted(ray % 3 for ray in rays)


def contacts_of(triple: int) -> list[int]:
    return contacts(triples(6)[triple])


def test_a_range_beyond_the_doubles_is_decided_in_integers() -> None:
    tiny = 5e-324
    polygon = Polygon([(tiny, 0), (4e99, 0), (4e99, 4e99), (0, 4e99)])
    edges, fractions = np.array([[0, 2]]), np.array([[0.5, 0.5]])
    _, bound = wrenches.float_determinants(polygon, np.full(4, 0.5), edges, fractions)
    assert np.isinf(bound).all()
    assert is_force_closure(polygon, Grasp.at_fractions([(0, 0.5), (2, 0.5)]), 0.5)


# --- laws ---------------------------------------------------------------------------------------


def test_batch_is_the_loop_in_positions_and_fractions() -> None:
    rng = np.random.default_rng(3)
    polygon, mu = star(rng), rng.uniform(0.2, 1.0, 9)
    edges, fractions = random_grasps(rng, polygon, 200, 3)
    fractions[:20] = rng.choice([0.0, 1.0, 1e-13, 1 - 1e-13, -1e-13, 1 + 1e-13], (20, 3))
    positions = fractions * polygon.edge_lengths[edges]
    by_position = is_force_closure(polygon, friction=mu, edges=edges, positions=positions)
    by_fraction = is_force_closure(polygon, friction=mu, edges=edges, fractions=fractions)
    loop = [
        is_force_closure(polygon, list(zip(e, u, strict=True)), mu)
        for e, u in zip(edges.tolist(), positions.tolist(), strict=True)
    ]
    np.testing.assert_array_equal(by_position, loop)
    np.testing.assert_array_equal(by_fraction, loop)
    assert 0 < by_position.sum() < 200


def test_chunks_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    polygon = star(rng)
    edges, fractions = random_grasps(rng, polygon, 101, 3)
    whole = is_force_closure(polygon, friction=0.5, edges=edges, fractions=fractions)
    monkeypatch.setattr("regrasp_lp.force_closure._CHUNK_ENTRIES", 140)
    np.testing.assert_array_equal(
        whole, is_force_closure(polygon, friction=0.5, edges=edges, fractions=fractions)
    )


@settings(max_examples=100, deadline=None)
@given(lattice_grasps(max_size=4), st.sampled_from(FRICTIONS), st.randoms())
def test_more_friction_more_contacts_and_another_order(
    case: tuple, more: float, random: object
) -> None:
    shape, mu, contacts = case
    verdict = is_force_closure(shape, Grasp.at_fractions(contacts), mu)
    if verdict:
        assert is_force_closure(shape, Grasp.at_fractions(contacts), mu + more)
        assert is_force_closure(shape, Grasp.at_fractions([*contacts, (0, 0.375)]), mu)
    shuffled = list(contacts)
    random.shuffle(shuffled)
    assert is_force_closure(shape, Grasp.at_fractions(shuffled), mu) == verdict


@settings(max_examples=100, deadline=None)
@given(
    lattice_grasps(max_size=4),
    st.tuples(st.integers(-(2**20), 2**20), st.integers(-(2**20), 2**20)),
    st.integers(-60, 60),
    st.integers(0, 3),
)
def test_invariant_under_exact_motions_and_scalings(
    case: tuple, offset: tuple[int, int], power: int, quarter_turns: int
) -> None:
    shape, mu, contacts = case
    turn = np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), quarter_turns)

    def moved(ring: np.ndarray) -> np.ndarray:
        return (ring @ turn.T + np.array(offset) / 4) * 2.0**power

    other = Polygon(moved(shape.exterior), holes=[moved(hole) for hole in shape.holes])
    grasp = Grasp.at_fractions(contacts)
    assert is_force_closure(shape, grasp, mu) == is_force_closure(other, grasp, mu)


def test_friction_of_each_edge_counts() -> None:
    grasp = Grasp.at_fractions([(0, 0.5), (2, 0.625)])
    assert is_force_closure(RECTANGLE, grasp, [0.3, 0.01, 0.3, 0.01])
    assert not is_force_closure(RECTANGLE, grasp, [0.3, 0.3, 0.2, 0.3])


# --- least friction -----------------------------------------------------------------------------


def test_least_friction_of_two_opposite_fingers_is_the_slope() -> None:
    for k in range(1, 5):
        mu = least_friction(RECTANGLE, Grasp.at_fractions([(0, 0.5), (2, 0.5 + k / 8)]))
        assert mu is not None
        assert k / 4 < mu <= k / 4 * (1 + 1e-9)


def test_least_friction_is_a_threshold() -> None:
    rng = np.random.default_rng(8)
    none = 0
    for _ in range(60):
        polygon = star(rng)
        m = int(rng.integers(2, 5))
        edges, fractions = random_grasps(rng, polygon, 1, m)
        grasp = Grasp.at_fractions(zip(edges[0].tolist(), fractions[0].tolist(), strict=True))
        mu = least_friction(polygon, grasp)
        if mu is None:
            none += 1
            assert not is_force_closure(polygon, grasp, 1e6)
        elif mu == 0.0:
            assert is_force_closure(polygon, grasp, 1e-100)
        else:
            assert is_force_closure(polygon, grasp, mu)
            assert not is_force_closure(polygon, grasp, mu / (1 + 1e-9))
    assert 0 < none < 50


@settings(max_examples=60, deadline=None)
@given(lattice_grasps(max_size=4))
def test_no_friction_helps_iff_the_largest_does_not(case: tuple) -> None:
    """On these shapes a threshold is a ratio of small numbers, far below 1e6."""
    shape, _, contacts = case
    grasp = Grasp.at_fractions(contacts)
    assert (least_friction(shape, grasp) is None) == (not closed(shape, 1e6, contacts))


def test_least_friction_of_special_grasps() -> None:
    triangle = LATTICE_SHAPES[1]
    concurrent = Grasp.at_fractions([(0, 0.25), (1, 0.5), (2, 0.75)])
    assert least_friction(triangle, concurrent) == 0.0
    one_edge = Grasp.at_fractions([(0, 0.25), (0, 0.5), (0, 1.0)])
    assert least_friction(triangle, one_edge) is None
    at_one_corner = Grasp.at_fractions([(0, 0.0), (2, 1.0)])
    assert least_friction(triangle, at_one_corner) is None
    along_an_edge = Grasp.at_fractions([(0, 0.25), (2, 1.0)])
    assert least_friction(triangle, along_an_edge) is None
    assert least_friction(triangle, [(0, 1.0)]) is None
    about_a_corner = Grasp.at_fractions([(0, 0.5), (2, 0.5)])
    assert least_friction(triangle, about_a_corner) == pytest.approx(1.0, rel=1e-9)


def test_a_threshold_beyond_the_doubles_is_none() -> None:
    """The second finger is 2^-1073 above the line of the first one's edge."""
    notched = Polygon([(0, 0), (3, 0), (3, -1), (4.25, -1), (4, 1e-323), (4, 2), (0, 2)])
    assert least_friction(notched, Grasp.at_fractions([(0, 0.5), (4, 0.0)])) is None
    assert least_friction(notched, Grasp.at_fractions([(0, 0.5), (4, 0.5)])) is not None


# --- misuse -------------------------------------------------------------------------------------


def test_misuse_is_refused_with_the_place() -> None:
    good = {"edges": [[0, 2]], "fractions": [[0.5, 0.5]]}
    with pytest.raises(FrictionError, match="missing"):
        is_force_closure(RECTANGLE, [(0, 1.0)])
    with pytest.raises(FrictionError):
        is_force_closure(RECTANGLE, friction=-1.0, **good)
    with pytest.raises(ContactError, match="not both"):
        is_force_closure(RECTANGLE, [(0, 1.0)], 0.5, **good)
    with pytest.raises(ContactError, match="either positions"):
        is_force_closure(RECTANGLE, friction=0.5, edges=[[0, 2]])
    with pytest.raises(ContactError, match="either positions"):
        is_force_closure(RECTANGLE, friction=0.5, positions=[[1, 1]], **good)
    with pytest.raises(ContactError, match="shape"):
        is_force_closure(RECTANGLE, friction=0.5, edges=[0, 2], fractions=[0.5, 0.5])
    with pytest.raises(ContactError, match="integers"):
        is_force_closure(RECTANGLE, friction=0.5, edges=[[0.0, 2.0]], fractions=[[0.5, 0.5]])
    with pytest.raises(ContactError, match="grasp 0, contact 1: there is no edge 4"):
        is_force_closure(RECTANGLE, friction=0.5, edges=[[0, 4]], fractions=[[0.5, 0.5]])
    with pytest.raises(ContactError, match="fractions run from 0 to 1"):
        is_force_closure(RECTANGLE, friction=0.5, edges=[[0, 2]], fractions=[[0.5, np.nan]])
    with pytest.raises(ContactError, match=r"positions run from 0 to 4\.0"):
        is_force_closure(RECTANGLE, friction=0.5, edges=[[0, 2]], positions=[[1.0, 4.5]])
