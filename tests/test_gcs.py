"""Least travel against gcsopt: never longer than its rounded path, never below its bound."""

from __future__ import annotations

import warnings

import pytest
from bench import gcs

pytest.importorskip("gcsopt", reason='gcsopt is not installed: pip install -e ".[bench]"')


def compare(instance: gcs.Instance) -> gcs.Compared:
    with warnings.catch_warnings():
        # cvxpy says so where the interior-point method ends early: costs are compared to 1e-5
        warnings.filterwarnings("ignore", "Solution may be inaccurate", UserWarning)
        found = gcs.compare(instance)
    assert found is not None
    return found


def check(found: gcs.Compared) -> None:
    slack = gcs.TOLERANCE * found.instance.graph.sets.sources[0].cones.size
    assert found.found.gap <= slack
    assert found.found.cost <= found.rounded + slack
    assert found.found.cost >= found.relaxed - slack


@pytest.mark.parametrize("number", [0, pytest.param(1, marks=pytest.mark.slow), 11])
def test_as_short_as_the_relaxation_allows(number: int) -> None:
    """Instances whose relaxation is exact: both bounds and both routes are one."""
    found = compare(gcs.instances(quick=False)[number])
    check(found)
    assert found.found.travel > 0
    slack = gcs.TOLERANCE * found.instance.graph.sets.sources[0].cones.size
    assert found.found.cost == pytest.approx(found.relaxed, abs=slack)
    assert found.found.cost == pytest.approx(found.rounded, abs=slack)


@pytest.mark.slow
def test_all_instances_of_the_benchmark() -> None:
    found = [compare(instance) for instance in gcs.instances(quick=False)]
    for one in found:
        check(one)
    assert sum(one.found.travel > 0 for one in found) > len(found) / 2
    text = gcs.table(found).text()
    assert all(one.instance.name in text for one in found)
