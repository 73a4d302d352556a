"""Random force-closure grasps: that they are, how they are spread, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import star_polygon

import regrasp_lp as rl


@pytest.mark.parametrize("proposal", ["uniform", "mixed"])
@pytest.mark.parametrize("contacts", [2, 3])
def test_all_hold_on_different_edges(proposal: str, contacts: int) -> None:
    polygon = star_polygon(9, 2)
    mu = np.linspace(0.2, 0.8, 9)
    edges, fractions = rl.sample_grasps(polygon, mu, 300, contacts=contacts, proposal=proposal)
    assert edges.shape == fractions.shape == (300, contacts)
    assert rl.is_force_closure(polygon, friction=mu, edges=edges, fractions=fractions).all()
    assert (np.diff(np.sort(edges, axis=1), axis=1) > 0).all()
    assert (rl.margin(polygon, friction=mu, edges=edges, fractions=fractions) > 0).all()


def test_the_seed_decides() -> None:
    polygon = star_polygon(9, 2)
    one, same, other = (rl.sample_grasps(polygon, 0.4, 50, seed=seed) for seed in (1, 1, 2))
    for a, b in zip(one, same, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(one[1], other[1])


def test_uniform_is_the_volume_of_contact_space() -> None:
    """Opposite sides of a square, f and 1 - g apart by d: they hold iff |d| < μ.

    The same for both pairs of sides, and neighbours hold for no μ < 1. So pairs are equally often
    of either kind, and |d| has the density of the trapezoid 1 - |d| on (-μ, μ).
    """
    square, mu, count = rl.Polygon([(0, 0), (1, 0), (1, 1), (0, 1)]), 0.5, 4000
    edges, fractions = rl.sample_grasps(square, mu, count, contacts=2, seed=3)
    assert (np.ptp(edges, axis=1) == 2).all()
    horizontal = (edges.min(axis=1) == 0).mean()
    apart = np.abs(fractions[:, 0] - (1 - fractions[:, 1]))
    near = (apart < mu / 2).mean()  # (1/4 - 1/32) / (1/2 - 1/8)
    error = 5 / np.sqrt(4 * count)  # five standard deviations
    assert abs(horizontal - 1 / 2) < error
    assert abs(near - 7 / 12) < error


def test_fewer_where_draws_do_not_suffice() -> None:
    needle = rl.Polygon([(0, 0), (100, 0), (100, 0.01)])
    edges, fractions = rl.sample_grasps(needle, 0.001, 10, contacts=3, max_draws=100)
    assert len(edges) == len(fractions) < 10
    assert edges.shape[1] == 3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"count": 0}, "count must be a whole number of at least 1"),
        ({"count": 2.5}, "count must be a whole number"),
        ({"count": 5, "contacts": 4}, "contacts must be 2 or 3"),
        ({"count": 5, "max_draws": 0}, "max_draws must be"),
        ({"count": 5, "proposal": "even"}, "proposal must be"),
    ],
)
def test_meaningless_arguments(options: dict[str, object], message: str) -> None:
    with pytest.raises(rl.OptionError, match=message):
        rl.sample_grasps(star_polygon(6, 1), 0.4, **options)


def test_friction_is_checked() -> None:
    with pytest.raises(rl.FrictionError):
        rl.sample_grasps(star_polygon(6, 1), -1.0, 5)
