"""Margins in closed form against solvers and against all vertices of the linear program."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from geometry import GENERAL, LATTICE, comb, lattice_star, star

from regrasp_lp import margins as module
from regrasp_lp.friction import Cones
from regrasp_lp.grasp_sets.candidates import complete_candidates, parallel_candidates
from regrasp_lp.grasp_sets.families import parallel_functions
from regrasp_lp.grasp_sets.pieces import piece_sets
from regrasp_lp.lp import get_solver, maximise_margins
from regrasp_lp.margins import best_pieces, existing_pieces, piece_margins
from regrasp_lp.torque import TorqueFunctions, torque_functions

SHAPES = {**LATTICE, **GENERAL}


def functions_of(name: str, mu: float, m: int) -> TorqueFunctions:
    cones = Cones.of(SHAPES[name], mu)
    edges = complete_candidates(cones, m)
    chosen = np.random.default_rng(0).permutation(len(edges))[:25]
    return torque_functions(cones, edges[np.sort(chosen)])


def all_pieces(functions: TorqueFunctions) -> np.ndarray:
    return np.argwhere(np.isfinite(piece_margins(functions)))


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("m", [2, 3])
def test_closed_form_equals_both_solvers(name: str, m: int) -> None:
    functions = functions_of(name, 0.75, m)
    pieces = all_pieces(functions)
    expected = piece_margins(functions)[tuple(pieces.T)]
    sets = piece_sets(functions, pieces, [f"f{i}" for i in range(m)])
    size = functions.cones.size
    for solver in ("clarabel", "highs"):
        found = maximise_margins(sets, get_solver(solver))
        np.testing.assert_allclose(found.margins, expected, rtol=1e-8, atol=1e-8 * size)
        assert (found.bounds >= expected - 1e-9 * size).all()
    assert (expected > 0).any()


def by_vertices(alpha: float, a: np.ndarray, beta: float, b: np.ndarray) -> float:
    """``max ε`` over all vertices of the two rows and the box, in coordinates (f, ε)."""
    m = len(a)
    rows = [np.append(b, 1.0), np.append(-a, 1.0)]
    limits = [-beta, alpha]
    for i in range(m):
        unit = np.zeros(m + 1)
        unit[i] = 1
        rows += [unit, -unit]
        limits += [1.0, 0.0]
    matrix, limit = np.array(rows), np.array(limits)
    best = -np.inf
    for chosen in combinations(range(len(rows)), m + 1):
        square = matrix[list(chosen)]
        if abs(np.linalg.det(square)) < 1e-12:
            continue
        x = np.linalg.solve(square, limit[list(chosen)])
        if (matrix @ x <= limit + 1e-9).all():
            best = max(best, x[-1])
    return best


@pytest.mark.parametrize("name", ["star7", "ell", "frame", "regular5", "lattice_star"])
@pytest.mark.parametrize("m", [2, 3])
def test_closed_form_equals_the_best_vertex(name: str, m: int) -> None:
    functions = functions_of(name, 0.5, m)
    values = piece_margins(functions)
    pieces = all_pieces(functions)
    for row, j, k in np.random.default_rng(1).permutation(pieces)[:25]:
        vertex = by_vertices(
            functions.offsets[row, k],
            functions.slopes[row, k],
            functions.offsets[row, j],
            functions.slopes[row, j],
        )
        assert values[row, j, k] == pytest.approx(vertex, abs=1e-9)


def test_no_piece_has_margin_minus_infinity() -> None:
    functions = torque_functions(
        Cones.of(LATTICE["square"], 1.0), np.array([[0, 1], [0, 2], [0, 0]])
    )
    values = piece_margins(functions)
    assert np.isneginf(values[0]).all()
    assert np.isneginf(values[2]).all()
    assert np.isneginf(np.diagonal(values, axis1=1, axis2=2)).all()
    margins, pieces = best_pieces(functions)
    assert np.isneginf(margins[[0, 2]]).all()
    assert margins[1] == pytest.approx(np.sqrt(0.5) / 2)
    assert values[1, pieces[1, 0], pieces[1, 1]] == margins[1]


def test_best_pieces_in_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    functions = functions_of("star9", 0.5, 3)
    margins, pieces = best_pieces(functions)
    monkeypatch.setattr(module, "_CHUNK", 4)
    again, chosen = best_pieces(functions)
    np.testing.assert_allclose(again, margins, rtol=1e-15)
    values = piece_margins(functions)
    for some in (pieces, chosen):
        np.testing.assert_array_equal(values[np.arange(len(values)), *some.T], margins)
    margins, pieces = best_pieces(functions.take(np.zeros(0, dtype=int)))
    assert margins.shape == (0,)
    assert pieces.shape == (0, 2)


@pytest.mark.parametrize("polygon", [star(9, 2), comb(2), lattice_star(8, 3)], ids=repr)
def test_existing_pieces_are_those_of_positive_margin_best_first(polygon) -> None:
    cones = Cones.of(polygon, 0.5)
    edges, centers = parallel_candidates(cones)
    for functions in (
        torque_functions(cones, complete_candidates(cones, 3)),
        parallel_functions(cones, edges, centers),
    ):
        values = piece_margins(functions)
        rows = existing_pieces(functions)
        assert {tuple(r) for r in rows.tolist()} == set(
            zip(*(v.tolist() for v in np.nonzero(values > 0)), strict=True)
        )
        of_rows = values[tuple(rows.T)]
        assert (np.diff(rows[:, 0]) >= 0).all()
        assert (np.diff(of_rows)[np.diff(rows[:, 0]) == 0] <= 0).all()
        first = np.flatnonzero(np.diff(rows[:, 0], prepend=-1))
        np.testing.assert_array_equal(of_rows[first], best_pieces(functions)[0][rows[first, 0]])


def test_a_parallel_set_has_twelve_pieces_at_most() -> None:
    cones = Cones.of(comb(3), 0.5)
    functions = parallel_functions(cones, *parallel_candidates(cones))
    assert np.isfinite(piece_margins(functions)).sum(axis=(1, 2)).max() == 12


def test_existence_and_margin_agree_in_sign() -> None:
    functions = functions_of("star9", 0.25, 3)
    margins, _ = best_pieces(functions)
    np.testing.assert_array_equal(margins > 0, functions.exists())
