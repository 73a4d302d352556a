"""Curves and the chords in their place: the stated distance holds, and is not wasted."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from regrasp_lp.outlines.curves import Bezier, Curve, EllipticArc, b_spline, bulge
from regrasp_lp.outlines.svg_shapes import elliptic_arc

coordinates = st.floats(-10, 10).map(lambda x: round(x, 3))
points = st.tuples(coordinates, coordinates)
tolerances = st.sampled_from([2e-3, 0.05, 1.0])


def evaluate(curve: Curve, t: np.ndarray) -> np.ndarray:
    """Points of a curve for parameters in [0, 1], from Bernstein polynomials and cosines."""
    if isinstance(curve, EllipticArc):
        angle = curve.start + curve.sweep * t
        return curve.center + np.outer(np.cos(angle), curve.u) + np.outer(np.sin(angle), curve.v)
    degree = len(curve.points) - 1
    k = np.arange(degree + 1)
    weight = np.ones(degree + 1) if curve.weights is None else curve.weights
    shares = np.array([math.comb(degree, i) for i in k]) * weight
    shares = shares * t[:, None] ** k * (1 - t[:, None]) ** (degree - k)
    return shares @ curve.points / shares.sum(axis=1, keepdims=True)


def distances(samples: np.ndarray, chain: np.ndarray) -> np.ndarray:
    """Distance of each sample from the nearest segment of a chain."""
    a, edge = chain[:-1], np.diff(chain, axis=0)
    length = (edge**2).sum(axis=1)
    offset = samples[:, None] - a
    share = (offset * edge).sum(axis=2) / np.where(length > 0, length, 1)
    away = offset - np.clip(share, 0, 1)[..., None] * edge
    return np.hypot(away[..., 0], away[..., 1]).min(axis=1)


def check(curve: Curve, tolerance: float) -> np.ndarray:
    """The law of flattening, both ways, against dense sampling."""
    chain = curve.flattened(tolerance)
    samples = evaluate(curve, np.linspace(0, 1, 301))
    assert distances(samples, chain).max() <= tolerance * (1 + 1e-9) + 1e-12
    middles = np.concatenate(
        [chain, *(chain[:-1] + s * np.diff(chain, axis=0) for s in (0.3, 0.5))]
    )
    step = np.hypot(*np.diff(samples, axis=0).T).max()
    assert distances(middles, samples).max() <= tolerance * (1 + 1e-9) + step
    assert chain[[0, -1]] == pytest.approx(samples[[0, -1]], abs=1e-9)
    return chain


@settings(max_examples=50)
@given(st.lists(points, min_size=2, max_size=6), tolerances)
def test_bezier_curves_stay_within_the_tolerance(controls: list, tolerance: float) -> None:
    check(Bezier(np.array(controls)), tolerance)


@settings(max_examples=50)
@given(
    st.lists(st.tuples(coordinates, coordinates, st.floats(0.05, 20)), min_size=3, max_size=5),
    tolerances,
)
def test_rational_curves_stay_within_the_tolerance(rows: list, tolerance: float) -> None:
    array = np.array(rows)
    check(Bezier(array[:, :2], array[:, 2]), tolerance)


@settings(max_examples=50)
@given(points, points, points, st.floats(-7, 7), st.floats(-2 * math.pi, 2 * math.pi), tolerances)
def test_elliptic_arcs_stay_within_the_tolerance(
    center: tuple, u: tuple, v: tuple, start: float, sweep: float, tolerance: float
) -> None:
    check(EllipticArc(np.array(center), np.array(u), np.array(v), start, sweep), tolerance)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-3, 0.1])
def test_circles_have_no_chord_too_many(tolerance: float) -> None:
    circle = EllipticArc(np.zeros(2), np.array([5.0, 0]), np.array([0, 5.0]), 0.3, 2 * math.pi)
    chain = check(circle, tolerance)
    n = len(chain) - 1
    assert (chain[0] == chain[-1]).all()
    assert 5 * (1 - math.cos(math.pi / n)) <= tolerance < 5 * (1 - math.cos(math.pi / (n - 1)))


def test_a_coarse_tolerance_leaves_quarter_turns() -> None:
    circle = EllipticArc(np.zeros(2), np.array([1.0, 0]), np.array([0, 1.0]), 0, 2 * math.pi)
    assert len(circle.flattened(100.0)) == 5
    assert len(Bezier(np.array([[0.0, 0], [1, 1], [2, 0]])).flattened(100.0)) == 2


@given(st.integers(1, 4), st.integers(0, 3), st.booleans(), st.booleans(), st.integers(0, 10**6))
def test_b_splines_are_their_bezier_curves(
    degree: int, extra: int, clamped: bool, rational: bool, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    n = degree + 1 + extra
    knots = np.sort(rng.uniform(0, 5, n + degree + 1))
    if clamped:
        knots[: degree + 1], knots[n:] = 0, 5
    controls = rng.uniform(-3, 3, (n, 2))
    weights = rng.uniform(0.2, 3, n) if rational else np.ones(n)
    curves = b_spline(knots, controls, weights if rational else None, degree)
    homogeneous = BSpline(knots, np.column_stack([controls * weights[:, None], weights]), degree)
    t = np.linspace(0, 1, 7)
    spans = [(a, b) for a, b in zip(knots[degree:n], knots[degree + 1 :], strict=False) if a < b]
    assert len(curves) == len(spans)
    for curve, (a, b) in zip(curves, spans, strict=True):
        values = homogeneous(a + (b - a) * t)
        assert evaluate(curve, t) == pytest.approx(values[:, :2] / values[:, 2:], abs=1e-8)


@given(points, points, st.floats(-5, 5).filter(lambda b: abs(b) > 1e-3))
def test_bulges_are_tangents_of_quarter_angles(start: tuple, end: tuple, value: float) -> None:
    a, b = np.array(start), np.array(end)
    arc = bulge(a, b, value)
    if (a == b).all():
        assert isinstance(arc, Bezier)
        return
    assert isinstance(arc, EllipticArc)
    samples = evaluate(arc, np.array([0, 0.5, 1]))
    size = np.hypot(*arc.u) + np.hypot(*arc.center)
    assert samples[[0, 2]] == pytest.approx(np.stack([a, b]), abs=1e-9 * size)
    # of all definitions of the bulge this is the shortest: twice the sagitta over the chord
    chord = b - a
    left = np.array([-chord[1], chord[0]])
    sagitta = (samples[1] - (a + b) / 2) @ left / (left @ left)
    assert -2 * sagitta == pytest.approx(value, abs=1e-6)


@given(
    st.complex_numbers(max_magnitude=5),
    st.complex_numbers(max_magnitude=5),
    st.floats(0.1, 4),
    st.floats(0.1, 4),
    st.floats(-math.pi, math.pi),
    st.booleans(),
    st.booleans(),
)
def test_svg_arcs_meet_their_ends_flags_and_radii(
    start: complex, end: complex, rx: float, ry: float, rotation: float, large: bool, sweep: bool
) -> None:
    if abs(start - end) < 1e-3:
        return
    arc = elliptic_arc(start, complex(rx, ry), rotation, large, sweep, end)
    ends = evaluate(arc, np.array([0.0, 1.0]))
    size = np.hypot(*arc.u) + np.hypot(*arc.v) + 10
    assert ends == pytest.approx(arc.ends, abs=1e-7 * size)
    assert (arc.sweep > 0) == sweep
    radii = np.array([np.hypot(*arc.u), np.hypot(*arc.v)])
    enlarged = radii / np.array([rx, ry])
    assert enlarged[0] == pytest.approx(enlarged[1])
    assert arc.u @ arc.v == pytest.approx(0, abs=1e-9 * size**2)
    assert cmath.phase(complex(*arc.u) / cmath.exp(1j * rotation)) == pytest.approx(0, abs=1e-9)
    if enlarged[0] > 1 + 1e-9:
        assert abs(arc.sweep) == pytest.approx(math.pi)
    elif abs(abs(arc.sweep) - math.pi) > 1e-6:
        assert (abs(arc.sweep) > math.pi) == large


@given(st.lists(points, min_size=3, max_size=4), tolerances, st.integers(0, 1000))
def test_curves_commute_with_affine_maps(controls: list, tolerance: float, seed: int) -> None:
    matrix = np.random.default_rng(seed).uniform(-2, 2, (2, 3))
    array = np.array(controls)
    t = np.linspace(0, 1, 5)
    for curve in (
        Bezier(array),
        EllipticArc(array[0], array[1], array[2], 0.4, 3.0),
    ):
        image = evaluate(curve, t) @ matrix[:, :2].T + matrix[:, 2]
        assert evaluate(curve.transformed(matrix), t) == pytest.approx(image, abs=1e-9)
        low, high = np.split(curve.transformed(matrix).bounds, 2)
        assert (image >= low - 1e-9).all()
        assert (image <= high + 1e-9).all()
