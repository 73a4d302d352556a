"""Aligning by repositioning: single moves, each between grasps in force closure."""

from __future__ import annotations

import numpy as np
import pytest
from geometry import ell, rectangle, unit_square
from regrasps import nut

import regrasp_lp as rl
from regrasp_lp.friction import Cones
from regrasp_lp.planning.regrip import regrip_moves
from regrasp_lp.torque import TorqueFunctions, torque_functions


def functions_on(polygon: rl.Polygon, friction: float, edges: list[int]) -> TorqueFunctions:
    return torque_functions(Cones.of(polygon, friction), np.array([edges]))


def play(
    functions: TorqueFunctions, start: np.ndarray, moves: list[tuple[int, float]]
) -> np.ndarray:
    now = np.array(start, dtype=float)
    for slot, fraction in moves:
        assert now[slot] != fraction
        now[slot] = fraction
        assert functions.contain(now[None, :])[0]
    return now


@pytest.mark.parametrize("polygon", [rectangle(), ell(), nut()])
def test_moves_between_grasps_of_one_piece(polygon: rl.Polygon) -> None:
    rng = np.random.default_rng(0)
    graph = rl.build_switching_graph(polygon, 0.3)
    tried = 0
    for index in rng.permutation(len(graph))[:15]:
        functions = graph.sets.functions(int(index))
        samples = rng.random((300, functions.m))
        samples.sort(axis=1)
        many = functions.take(np.zeros(300, dtype=np.intp))
        samples = samples[many.contain(samples)]
        witness = graph.sets[int(index)].witness.fractions
        values = functions.values(witness)[0]
        j, k = np.argmin(values), np.argmax(values)
        within = [f for f in samples if functions.values(f)[0, j] < 0 < functions.values(f)[0, k]]
        for f, g in zip(within[::2], within[1::2], strict=False):
            moves = regrip_moves(functions, [f, g], witness[None, :])
            assert play(functions, f, moves).tolist() == g.tolist()
            tried += 1
    assert tried > 30


def test_no_move_where_nothing_changes() -> None:
    functions = functions_on(rectangle(), 0.4, [0, 2])
    f = np.array([0.5, 0.5])
    assert regrip_moves(functions, [f, f], f[None, :]) == []
    assert regrip_moves(functions, [f, f, f], np.array([f, f])) == []


def test_a_way_of_several_pieces_may_be_cut_short() -> None:
    functions = functions_on(rectangle(), 0.4, [0, 2])
    f, g = np.array([0.5, 0.5]), np.array([0.55, 0.5])
    between = np.array([0.2, 0.8])
    assert regrip_moves(functions, [f, between, g], np.array([f, f])) == [(0, 0.55)]


def test_the_other_order_if_one_is_barred() -> None:
    """The upper of two contacts on an edge goes first where the lower takes its place."""
    functions = functions_on(rectangle(), 0.4, [0, 0, 2])
    f, g = np.array([0.25, 0.5, 0.6]), np.array([0.5, 0.75, 0.6])
    assert regrip_moves(functions, [f, g], f[None, :]) == [(1, 0.75), (0, 0.5)]


def test_no_two_fingers_on_one_vertex() -> None:
    functions = functions_on(unit_square(), 1.5, [0, 1, 2])
    f, g = np.array([0.5, 0.0, 0.5]), np.array([1.0, 0.5, 0.5])
    assert regrip_moves(functions, [f, g], f[None, :]) == [(1, 0.5), (0, 1.0)]


def test_from_a_grasp_that_is_none() -> None:
    functions = functions_on(rectangle(), 0.5, [0, 2])
    border = np.array([0.0, 0.75])
    middle = np.array([0.5, 0.5])
    assert not functions.contain(border[None, :])[0]
    with pytest.raises(rl.SolverError, match="within rounding of losing force closure"):
        regrip_moves(functions, [middle, border], middle[None, :])


def test_a_sliver_needs_too_many() -> None:
    functions = functions_on(rectangle(1, 1e-6), 0.5, [0, 2])
    f, g = np.array([0.1, 0.9]), np.array([0.9, 0.1])
    with pytest.raises(rl.NoPlanFound, match="more than 1000 placements"):
        regrip_moves(functions, [f, g], np.array([[0.5, 0.5]]))
