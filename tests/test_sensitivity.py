"""What limits a plan: regions, prices, friction; against exact checks and LPs solved again."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from itertools import pairwise, product

import numpy as np
import pytest
from geometry import ell, rectangle
from hypothesis import given, settings
from hypothesis import strategies as st
from regrasps import nut, plate, random_grasps, tee

import regrasp_lp as rl
from regrasp_lp.friction import Cones
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.lp import get_solver, maximise_margins, prices
from regrasp_lp.lp.prices import priced_optimum
from regrasp_lp.planning.along import instants, least_along
from regrasp_lp.planning.limits import ConeLimit, EndLimit, Limits, MeetLimit
from regrasp_lp.planning.plan import Plan, Support
from regrasp_lp.planning.plan_program import PlanProgram, limits_of, tight_limits
from regrasp_lp.planning.regions import Region, regions
from regrasp_lp.planning.verification import first_loss
from regrasp_lp.plotting import palette
from regrasp_lp.wrenches import exact_determinants

BLOCKED = 1e-9  # of the object's size, as documented


def still(polygon: rl.Polygon, grasp: rl.Grasp, friction: object, *steps: rl.Slide) -> Plan:
    """A plan that holds one grasp, or slides it about; nothing is planned."""
    mu = Cones.of(polygon, friction).friction
    start = dict(enumerate(polygon.resolve(grasp), start=1))
    kind = "two_finger" if len(start) == 2 else "three_finger"
    goal = {**start, **(steps[-1].moves if steps else {})}
    supports = (Support(kind, tuple(start)),) * (len(steps) + 1)
    return Plan(polygon, mu, rl.Hand(), start, rl.Grasp(goal.values()), steps, supports)


@cache
def planned() -> tuple[Plan, ...]:
    """Plans on several parts, with holes, per-edge friction, two fingers on an edge."""
    found = []
    for number, (polygon, friction, options) in enumerate(
        (
            (rectangle(), 0.4, {}),
            (rl.Polygon(ell().vertices, name="bracket"), [0.2, 0.3, 0.4, 0.5, 0.6, 0.7], {}),
            (nut(), 0.3, {"sets": "chapter"}),
            (plate(), 0.3, {"hand": rl.Hand(5)}),
            (tee(), 0.5, {}),
        )
    ):
        graph = rl.build_switching_graph(polygon, friction, **options)
        rng = np.random.default_rng(number)
        grasps = random_grasps(polygon, friction, rng, 4, 3, at_vertices=0.3)
        grasps += random_grasps(polygon, friction, rng, 2, 2)
        for n, (start, goal) in enumerate(pairwise(grasps)):
            try:
                found.append(graph.plan(start, goal, ("slide", "regrip")[n % 3 == 2]))
            except rl.NoPlanFound:
                continue
    assert len(found) > 15
    return tuple(found)


@cache
def slid() -> tuple[Plan, ...]:
    """Slides between random grasps, which need not be in one piece."""
    found = []
    for number, polygon in enumerate((nut(), tee(), plate())):
        rng = np.random.default_rng(number)
        grasps = random_grasps(polygon, 0.5, rng, 60, 3)
        places = {}
        for grasp in grasps:
            ordered = rl.Grasp(sorted(polygon.resolve(grasp), key=lambda c: (c.edge, c.fraction)))
            places.setdefault(tuple(ordered.edges), []).append(ordered)
        for same in places.values():
            for f, g in pairwise(same):
                moves = rl.Slide(dict(enumerate(polygon.resolve(g), start=1)))
                plan = still(polygon, f, 0.5, moves)
                if plan.margin > 1e-3 and plan.verify():
                    found.append(plan)
    assert len(found) > 20
    return tuple(found)


# --- regions ------------------------------------------------------------------------------------


def size_of(plan: Plan) -> float:
    return plan.cones.size


def holds_along(plan: Plan, before: rl.Grasp, after: rl.Grasp) -> bool:
    """Whether contacts that move straight are in force closure throughout, by their wrenches."""
    edges = np.stack([before.edges, after.edges])
    ends = np.stack([before.fractions, after.fractions])
    return (
        first_loss(2 * len(before), exact_determinants(plan.polygon, plan.friction, edges, ends))
        is None
    )


def corners(low: rl.Grasp, high: rl.Grasp) -> list[rl.Grasp]:
    return [rl.Grasp(choice) for choice in product(*zip(low, high, strict=True))]


def widened(plan: Plan, region: Region, i: int, side: int) -> list[rl.Grasp] | None:
    """The corner of the region with one side moved out; None where there is no room."""
    boxes = [box for box in (region.before, region.box) if box is not None]
    found = []
    for box in boxes:
        corner = list((box.lower, box.upper)[side > 0])
        contact = corner[i]
        by = 1.5 * BLOCKED * size_of(plan) / plan.polygon.edge_lengths[contact.edge]
        if not 0 <= contact.fraction + side * by <= 1:
            return None
        corner[i] = rl.Contact.at_fraction(contact.edge, contact.fraction + side * by)
        found.append(plan.polygon.resolve(rl.Grasp(corner)))
    return [found[0], found[-1]]


def shares_an_edge(plan: Plan, region: Region, i: int) -> bool:
    """Whether another touching finger is on the edge of a contact."""
    steps = (region.step - 1, region.step) if region.on_the_way else (region.step,)
    edge = region.grasp[i].edge
    return any(
        sum(c.edge == edge for c in plan.grasps[step].contacts.values()) > 1 for step in steps
    )


def check_region(plan: Plan, region: Region) -> int:
    """All corners hold, at each instant; no side can be moved out. Returns how many sides."""
    first = region.before or region.box
    for before, after in zip(
        corners(first.lower, first.upper),
        corners(region.box.lower, region.box.upper),
        strict=True,
    ):
        assert holds_along(plan, before, after), region
        if not region.on_the_way:
            assert rl.is_force_closure(plan.polygon, after, plan.friction)
    sides = 0
    for i, side in product(range(len(region.fingers)), (-1, 1)):
        wider = widened(plan, region, i, side)
        if wider is not None and not shares_an_edge(plan, region, i):
            assert not holds_along(plan, *wider), (region, i, side)
            sides += 1
    return sides


def test_regions_of_plans_hold_exactly_and_are_maximal() -> None:
    sides = slides = 0
    for plan in planned()[::2]:
        found = plan.regions()
        assert [r.step for r in found if not r.on_the_way] == list(range(len(plan.grasps)))
        at_rest = tuple(r for r in found if not r.on_the_way)
        assert at_rest == regions(plan, slides=False)
        for region in found:
            sides += check_region(plan, region)
            slides += region.on_the_way
            held = plan.grasps[region.step]
            if region.on_the_way:
                assert region.tolerance == plan.slide_tolerances[region.step - 1]
            else:
                assert region.fingers == held.support.fingers
                assert region.tolerance == held.tolerance
            for finger, (low, high) in region.intervals.items():
                at = held.contacts[finger]
                assert low.edge == high.edge == at.edge
                assert low.fraction <= at.fraction <= high.fraction
    assert sides > 150
    assert slides > 7


def test_regions_of_slides_beyond_one_piece() -> None:
    sides = sum(check_region(plan, r) for plan in slid() for r in plan.regions() if r.on_the_way)
    assert sides > 30


def test_a_region_contains_the_cube_of_the_tolerance() -> None:
    """As far as ends of edges and other fingers let it; and hardly a larger one is independent."""
    for plan in planned() + slid():
        for region in plan.regions():
            least = region.tolerance - 2 * BLOCKED * size_of(plan)
            for i, widths in enumerate(region.widths):
                if not shares_an_edge(plan, region, i):
                    assert (widths >= least).all()
            if region.on_the_way:
                continue
            more = 1.001 * region.tolerance / plan.polygon.edge_lengths[region.grasp.edges]
            low, high = region.grasp.fractions - more, region.grasp.fractions + more
            if (low > 0).all() and (high < 1).all():
                closed = rl.is_force_closure(
                    plan.polygon,
                    friction=plan.friction,
                    edges=np.stack([region.grasp.edges] * 2),
                    fractions=np.stack([low, high]),
                )
                assert not closed.all()


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.15, 0.4, 1.0, 2.0]), st.sampled_from([2, 3]))
def test_regions_of_random_grasps(seed: int, mu: float, m: int) -> None:
    rng = np.random.default_rng(seed)
    polygon = (nut(), tee(), plate(), rectangle())[seed % 4]
    for grasp in random_grasps(polygon, mu, rng, 2, m, at_vertices=0.4):
        plan = still(polygon, grasp, mu)
        (region,) = plan.regions()
        check_region(plan, region)
        inside = rng.random((20, m))
        low, high = region.box.lower.fractions, region.box.upper.fractions
        assert rl.is_force_closure(
            polygon,
            friction=mu,
            edges=np.tile(region.grasp.edges, (20, 1)),
            fractions=np.clip(low + inside * (high - low), low, high),
        ).all()


def test_growth_is_even() -> None:
    """On a square all four sides stop at once; if two are at ends the others go on."""
    square = rl.Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    (region,) = still(square, rl.Grasp([(0, 0.5), (2, 0.5)]), 0.5).regions()
    assert region.tolerance == pytest.approx(0.25)
    assert region.widths == pytest.approx(np.full((2, 2), 0.25), abs=1e-9)
    (region,) = still(square, rl.Grasp([(0, 0.9), (2, 0.1)]), 0.5).regions()
    assert region.tolerance == pytest.approx(0.1)
    assert region.widths == pytest.approx(np.array([[0.4, 0.1], [0.1, 0.4]]), abs=1e-8)
    assert region.box.upper[0].fraction == 1  # where the edge ends


def test_fingers_on_one_edge_share_what_is_between_them() -> None:
    bar = rl.Polygon([(0, 0), (10, 0), (10, 1), (0, 1)])
    grasp = rl.Grasp([(0, 3.0), (0, 7.0), (2, 5.0)])
    (region,) = still(bar, grasp, 0.8).regions()
    between = region.intervals[1][1].position, region.intervals[2][0].position
    assert between[0] <= 5.0 + 1e-9
    assert between[1] >= 5.0 - 1e-9
    assert min(region.widths[0, 1], region.widths[1, 0]) > 1


def test_regions_stay_within_what_a_hand_may_touch() -> None:
    bar = rl.Polygon([(0, 0), (10, 0), (10, 1), (0, 1)])
    hand = rl.Hand(edge_clearance=0.5, reachable={2: (4.5, 5.2)})
    plan = replace(still(bar, rl.Grasp([(0, 5.0), (2, 5.0)]), 0.8), hand=hand)
    low, high = plan.regions()[0].intervals[2]
    assert low.position >= 4.5 - 1e-12
    assert high.position <= 5.2 + 1e-12
    apart = replace(plan, hand=rl.Hand(max_span=1.1))
    assert (apart.regions()[0].widths <= 0.05 + 1e-12).all()
    assert "without the hand's limits to distances" in str(apart.sensitivity())


def test_no_region_where_the_supporting_fingers_do_not_hold() -> None:
    """In a plan from elsewhere others may hold the object; the account and picture still work."""
    plan = next(p for p in planned() if len(p.grasps[0].contacts) == 3)
    fingers = tuple(plan.start)[:2]
    wrong = replace(plan, supports=(Support("two_finger", fingers), *plan.supports[1:]))
    if wrong.margin > 0:
        fingers = tuple(plan.start)[1:]
        wrong = replace(plan, supports=(Support("two_finger", fingers), *plan.supports[1:]))
    assert wrong.margin <= 0
    assert wrong.verify()
    with pytest.raises(rl.NotForceClosureError, match="step 0 fingers .* alone do not hold"):
        wrong.regions()
    assert "least margin" in str(wrong)


# --- along slides -------------------------------------------------------------------------------


def test_least_tolerance_along_slides() -> None:
    """Never more than any sample, and hardly less than the least of many."""
    times = np.linspace(0, 1, 401)
    for plan in slid():
        f, g = (grasp.grasp.fractions for grasp in plan.grasps)
        sampled = rl.tolerance(
            plan.polygon,
            friction=plan.friction,
            edges=np.tile(plan.grasps[0].grasp.edges, (len(times), 1)),
            fractions=f + times[:, None] * (g - f),
        )
        least = plan.slide_tolerances[0]
        assert least <= sampled.min() + 1e-12
        assert least >= sampled.min() - 0.02


@settings(max_examples=100)
@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=6))
def test_least_along(lines: list[tuple[float, float]]) -> None:
    start, end = np.array(lines).T
    t = np.linspace(0, 1, 1001)
    sampled = (np.outer(1 - t, start) + np.outer(t, end)).max(axis=1).min()
    assert sampled - 0.02 <= least_along(start, end) <= sampled + 1e-9


def test_instants_are_the_ends_and_the_nearest_approaches() -> None:
    bar = rl.Polygon([(0, 0), (10, 0), (10, 1), (0, 1)])
    before = dict(enumerate(bar.resolve([(0, 1.0), (2, 1.0)]), start=1))
    after = dict(enumerate(bar.resolve([(0, 9.0), (2, 9.0)]), start=1))
    first, last, nearest = instants(bar, before, after)
    assert (first, last) == (before, after)
    assert nearest[1].position == pytest.approx(5.0)
    assert len(instants(bar, before, before)) == 2


# --- what limits --------------------------------------------------------------------------------


@pytest.mark.parametrize("measure", ["margin", "tolerance"])
def test_least_and_best(measure: str) -> None:
    """The rows leave what the plan has; its contacts can be chosen so that they leave the best."""
    moved = 0
    for plan in planned() + slid():
        limits = limits_of(plan, measure)
        least = plan.margin if measure == "margin" else min(plan.tolerance, *plan.slide_tolerances)
        unit = 1e-9 * size_of(plan)
        assert limits.least == pytest.approx(least, abs=unit)
        assert limits.least <= limits.chosen + unit
        assert (limits.least, limits.tight) == tight_limits(plan, measure)
        assert limits.tight
        if limits.chosen == np.inf:
            assert limits.best == np.inf
            assert not limits.limits
            continue
        assert limits.chosen <= limits.best + unit
        assert limits.limits
        dear = [limit.price for limit in limits.limits]
        assert dear == sorted(dear, reverse=True)
        if measure == "margin":
            total = sum(t.price for t in limits.limits if isinstance(t, ConeLimit))
            assert total == pytest.approx(1, abs=1e-7)
        program = PlanProgram.of(plan, measure)
        better = with_contacts(plan, program, priced_optimum(program.sets()).point)
        values = PlanProgram.of(better, measure).tight()[0]
        given_rows = set(range(len(program.rows))) - set(program.moving)
        fixed = min((program.values()[i] for i in given_rows), default=np.inf)
        assert values >= min(limits.best, fixed) - 1e-6 * size_of(plan)
        moved += better != plan
    assert moved > 10


def with_contacts(plan: Plan, program: PlanProgram, fractions: np.ndarray) -> Plan:
    """The same steps with other chosen contacts."""
    new = dict(zip(program.free, fractions.tolist(), strict=True))

    def contact(step: int, finger: int) -> rl.Contact:
        number = program.where[step][finger]
        old = program.stays[number].contact
        at = rl.Contact.at_fraction(old.edge, new.get(number, old.fraction))
        return plan.polygon.resolve_contact(at)

    steps: list[object] = []
    for i, step in enumerate(plan.steps, start=1):
        match step:
            case rl.Place(finger):
                steps.append(rl.Place(finger, contact(i, finger)))
            case rl.Release():
                steps.append(step)
            case rl.Slide(moves):
                steps.append(rl.Slide({finger: contact(i, finger) for finger in moves}))
    return replace(plan, steps=tuple(steps))


@pytest.mark.parametrize("measure", ["margin", "tolerance"])
def test_prices_against_bounds_that_are_changed(measure: str) -> None:
    """Never gained more than the price says; and as much where the optimum is smooth."""
    clarabel, by = get_solver("clarabel"), 1e-5
    smooth = rows = 0
    for plan in planned() + slid()[:5]:
        sets = PlanProgram.of(plan, measure).sets()
        if not sets.names:
            continue
        optimum = priced_optimum(sets)
        r, n = sets.rows.shape[1:]
        shifts = np.concatenate((np.eye(r + 2 * n), -np.eye(r + 2 * n))) * by
        lower, upper = sets.lower - shifts[:, r : r + n], sets.upper + shifts[:, r + n :]
        count = len(shifts)
        changed = replace(
            sets,
            rows=np.repeat(sets.rows, count, axis=0),
            scales=np.repeat(sets.scales, count, axis=0),
            bounds=sets.bounds + shifts[:, :r],
            lower=lower,
            upper=upper,
        )
        gains = (maximise_margins(changed, clarabel).margins - optimum.margin) / by
        price = np.concatenate((optimum.rows, optimum.lower, optimum.upper))
        more, less = gains[: r + 2 * n], -gains[r + 2 * n :]
        assert (more <= price + 1e-2).all()
        assert (less >= price - 1e-2).all()
        is_smooth = less - more <= 1e-3
        assert more[is_smooth] == pytest.approx(price[is_smooth], abs=5e-3)
        smooth += int((is_smooth & (price > 1e-6)).sum())
        rows += r
    assert smooth > 10
    assert rows > 60


def test_prices_that_prove_nothing_are_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Then those of rational numbers are; and if these were wrong, too, an error."""
    plan = next(p for p in planned() if len(PlanProgram.of(p, "margin").free) > 2)
    sets = PlanProgram.of(plan, "margin").sets()
    expected = priced_optimum(sets)

    def wrong(given: LinearSets) -> np.ndarray:
        return given.scales[0] / (given.scales[0] @ given.scales[0])

    monkeypatch.setattr(prices, "_multipliers", wrong)
    found = priced_optimum(sets)
    assert found.margin == expected.margin
    for one in (found, expected):  # each proves the optimum, even if they differ
        over = np.concatenate((one.rows, one.lower, one.upper))
        at = np.concatenate((sets.bounds[0], -sets.lower[0], sets.upper[0]))
        assert over @ at == pytest.approx(expected.margin, abs=1e-9)
    monkeypatch.setattr(prices, "_exact_multipliers", wrong)
    with pytest.raises(rl.SolverError, match="do not fit its optimum"):
        priced_optimum(sets)


def test_rows_are_the_torques_of_their_boundary_lines() -> None:
    """About any point: the shares weigh the signed distances of the lines from it."""
    checked = 0
    for plan in planned()[::3]:
        program = PlanProgram.of(plan, "margin")
        values = program.values()
        x = plan.polygon.bounds[2:] * [0.3, 0.8]
        for row, value in zip(program.rows, values, strict=True):
            limit = row.limit
            at_rest = [step for step, sliding in limit.moments if not sliding]
            if not isinstance(limit, ConeLimit) or not at_rest:
                continue
            contacts = plan.grasps[at_rest[0]].contacts
            total = 0.0
            for line in limit.lines:
                assert contacts[line.finger].edge == line.edge
                sign = 1 if line.side == "clockwise" else -1
                tangent, normal = plan.polygon.tangents[line.edge], plan.polygon.normals[line.edge]
                ray = normal + sign * plan.friction[line.edge] * tangent
                arm = plan.polygon.point(contacts[line.finger]) - x
                distance = (arm[0] * ray[1] - arm[1] * ray[0]) / np.hypot(*ray)
                total += line.share * distance
            assert sum(line.share for line in limit.lines) == pytest.approx(1)
            assert limit.needs * total == pytest.approx(value, abs=1e-9)
            checked += 1
    assert checked > 20


def test_the_price_of_an_end_is_what_a_longer_edge_brings() -> None:
    """The upper finger should be over the lower one, but its edge ends before that."""
    mu = 1.5
    cosine = 1 / np.sqrt(1 + mu**2)

    def limits(corner: float, hand: rl.Hand = rl.Hand()) -> Limits:  # noqa: B008 - a value
        part = rl.Polygon([(0, 0), (10, 0), (10, 2), (corner, 2), (corner, 4), (0, 4)])
        steps = [rl.Slide({2: part.resolve_contact(rl.Contact(2, u))}) for u in (3.0, 2.8)]
        plan = still(part, rl.Grasp([(0, 5.0), (2, 2.5)]), mu, *steps)
        return limits_of(replace(plan, hand=hand))

    found = limits(6.0)
    assert found.best == pytest.approx((2 * mu - 1) * cosine / 2)
    cone, end = found.limits
    assert isinstance(cone, ConeLimit)
    assert cone.price == pytest.approx(1)
    assert [(line.finger, line.edge) for line in cone.lines] == [(1, 0), (2, 2)]
    assert [line.share for line in cone.lines] == pytest.approx([0.5, 0.5])
    assert isinstance(end, EndLimit)
    assert (end.finger, end.edge, end.end, end.moments) == (2, 2, "end", ((1, False),))
    assert end.price == pytest.approx(cosine / 2)
    assert limits(5.9).best - found.best == pytest.approx(0.1 * end.price)
    kept = limits(3.0, rl.Hand(reachable={2: (0.0, 4.0)}))  # as if the edge ended there
    assert kept.best == pytest.approx(found.best)
    assert [type(limit) for limit in kept.limits] == [ConeLimit, EndLimit]
    assert kept.limits[1].price == pytest.approx(end.price)


def test_fingers_on_one_edge_may_limit_each_other() -> None:
    """Two contacts below a third one: the second is drawn to the other side of the first."""
    bar = rl.Polygon([(0, 0), (10, 0), (10, 1), (0, 1)])
    first = rl.Grasp([(0, 6.0), (0, 6.4), (2, 4.2)])
    steps = [rl.Slide({2: bar.resolve_contact(rl.Contact(0, u))}) for u in (6.3, 6.4)]
    plan = still(bar, first, 1.0, *steps)
    plan = replace(plan, supports=(Support("two_finger", (2, 3)),) * 3)
    found = limits_of(plan)
    (meeting,) = (limit for limit in found.limits if isinstance(limit, MeetLimit))
    assert (meeting.fingers, meeting.edge, meeting.moments) == ((1, 2), 0, ((1, False),))
    assert meeting.price == pytest.approx(np.sqrt(0.5) / 2)
    assert "fingers 1 and 2 meet on edge 0" in str(plan.sensitivity())


def test_nothing_chosen() -> None:
    plan = still(
        rectangle(), random_grasps(rectangle(), 0.4, np.random.default_rng(0), 1, 2)[0], 0.4
    )
    found = plan.sensitivity()
    assert found.margin.chosen == found.margin.best == np.inf
    assert found.margin.limits == ()
    assert "nothing was chosen" in str(found)


# --- friction -----------------------------------------------------------------------------------


def test_margins_under_other_friction() -> None:
    factors = np.array([[0.5, 0.9], [1.0, 1.7]])
    for plan in planned()[::3] + slid()[:3]:
        found = plan.margins_at(factors)
        assert found.shape == (2, 2)
        for factor, margin in zip(factors.ravel(), found.ravel(), strict=True):
            again = replace(plan, friction=factor * plan.friction)
            assert margin == pytest.approx(again.margin, abs=1e-12 * size_of(plan), rel=1e-9)
        same = plan.margins_at(friction=np.stack([plan.friction] * 2))
        assert same == pytest.approx([plan.margin] * 2, rel=1e-9)
        assert plan.margins_at(2.0).shape == ()
    with pytest.raises(rl.FrictionError, match="one value for each of"):
        plan.margins_at(friction=[0.1, 0.2])
    with pytest.raises(rl.FrictionError, match="not both"):
        plan.margins_at()
    with pytest.raises(rl.FrictionError):
        plan.margins_at([1.0, -1.0])


def test_slope_in_closed_form() -> None:
    """Two fingers opposite each other: the margin is ``w/2 · μ / sqrt(1 + μ²)``."""
    bar = rl.Polygon([(0, 0), (10, 0), (10, 4), (0, 4)])
    for mu in (0.1, 0.5, 1.5):
        found = still(bar, rl.Grasp([(0, 5.0), (2, 5.0)]), mu).sensitivity()
        expected = 2 * mu / (1 + mu**2) ** 1.5
        for slope in (found.slope_below, found.slope_above):
            assert slope.value == pytest.approx(expected, abs=1e-6)
            assert slope.error < 1e-6


def test_slopes_to_both_sides_of_a_kink() -> None:
    """Two squeezes of one plan, of widths w and offsets d: ``(w sin θ - d cos θ) / 2``, equal."""
    mu = 0.5
    part = rl.Polygon([(0, 0), (20, 0), (20, 2), (10, 2), (10, 4), (0, 4)])
    wide = part.resolve([(0, 4.0), (4, 10.0 - 4.0 - 2 * mu)])
    thin = part.resolve([(0, 15.0), (2, 5.0)])
    start, goal = dict(enumerate(wide, start=1)), dict(enumerate(thin, start=3))
    steps = (*(rl.Place(k, c) for k, c in goal.items()), rl.Release(1), rl.Release(2))
    supports = [Support("two_finger", fingers) for fingers in [(1, 2)] * 3 + [(3, 4)] * 2]
    plan = Plan(part, np.full(6, mu), rl.Hand(), start, thin, steps, tuple(supports))
    assert plan.verify()
    assert plan.margins == pytest.approx([1 / np.sqrt(1 + 1 / mu**2)] * 5)
    found, turn = plan.sensitivity(), mu / (1 + mu**2)
    sine, cosine = mu / np.sqrt(1 + mu**2), 1 / np.sqrt(1 + mu**2)
    assert found.slope_below.value == pytest.approx((2 * cosine + mu * sine) * turn, rel=1e-6)
    assert found.slope_above.value == pytest.approx(cosine * turn, rel=1e-6)
    assert max(found.slope_below.error, found.slope_above.error) < 1e-6


def test_slopes_against_differences() -> None:
    for plan in planned()[::3] + slid()[:3]:
        found = plan.sensitivity()
        h = 2.0**-20
        below, at, above = plan.margins_at([1 - h, 1.0, 1 + h])
        unit = 1e-4 * size_of(plan)
        assert found.slope_below.value == pytest.approx((at - below) / h, abs=unit)
        assert found.slope_above.value == pytest.approx((above - at) / h, abs=unit)


def test_least_friction() -> None:
    """It holds there and not just below; in between nothing else happens."""
    rng = np.random.default_rng(0)
    for plan in planned()[::3] + slid()[:3]:
        found = plan.least_friction()
        assert 0 < found.fails < found.holds <= 1
        assert found.holds - found.fails <= 1e-9 * found.holds
        assert found.fault
        for factor in (found.holds, *rng.uniform(found.holds, 2, 3)):
            assert replace(plan, friction=factor * plan.friction).verify(), factor
        for factor in (found.fails, *rng.uniform(0, found.fails, 3)):
            report = replace(plan, friction=factor * plan.friction).verify()
            assert not report
            assert "force closure" in report.fault
        # the supporting fingers need no less than all that touch
        assert plan.margins_at(0.999 * found.fails) <= 0


def test_least_friction_of_a_grasp_is_that_of_the_exact_test() -> None:
    rng = np.random.default_rng(3)
    for polygon in (nut(), tee(), rectangle()):
        for grasp in random_grasps(polygon, 0.7, rng, 3, 3):
            least = rl.force_closure.least_friction(polygon, grasp)
            found = still(polygon, grasp, 0.7).least_friction()
            assert 0.7 * found.holds == pytest.approx(least, rel=3e-9)


def test_four_contacts_hold_under_any_friction() -> None:
    """Forces along the normals alone hold it, so that no friction is the least."""
    square = rl.Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    places = [(0, 0.3), (1, 0.7), (2, 0.3), (3, 0.7)]
    start = dict(enumerate(square.resolve(places), start=1))
    plan = Plan(
        square,
        np.full(4, 2.0),
        rl.Hand(),
        start,
        rl.Grasp(start.values()),
        (),
        (Support("three_finger", (1, 2, 3)),),
    )
    found = plan.least_friction()
    assert (found.fails, found.fault) == (0.0, None)
    assert found.holds < 1e-40
    assert "under any friction" in str(plan.sensitivity())


def test_a_plan_that_does_not_hold_has_no_sensitivity() -> None:
    plan = planned()[0]
    faulty = replace(plan, friction=0.01 * plan.friction)
    assert not faulty.verify()
    for asked in (faulty.sensitivity, faulty.least_friction):
        with pytest.raises(rl.NotForceClosureError, match="does not hold as it is"):
            asked()
    assert "least margin" in str(faulty) or faulty.margin == -np.inf


# --- all together -------------------------------------------------------------------------------


def test_a_plan_that_was_read_has_the_same_sensitivity(tmp_path) -> None:
    for plan in planned()[::8]:
        plan.to_json(tmp_path / "plan.json")
        again = rl.read_plan(tmp_path / "plan.json")
        assert again.sensitivity() == plan.sensitivity()
        assert str(again.sensitivity()) == str(plan.sensitivity())


def test_units_do_not_matter() -> None:
    """Lengths scale, prices and factors stay; by a power of two, exactly so."""
    for plan in planned()[::8]:
        polygon = rl.Polygon(
            8 * plan.polygon.exterior, [8 * hole for hole in plan.polygon.holes], name="large"
        )
        large = rl.planning.plan_file.plan_from_document(
            {
                **plan.to_document(),
                "polygon": {
                    "exterior": polygon.exterior.tolist(),
                    "holes": [hole.tolist() for hole in polygon.holes],
                },
            }
        )
        small, big = plan.sensitivity(), large.sensitivity()
        assert big.least_friction == small.least_friction
        assert big.slope_above.value == pytest.approx(8 * small.slope_above.value, rel=1e-6)
        for measure in ("margin", "tolerance"):
            one, other = getattr(small, measure), getattr(big, measure)
            assert other.least == pytest.approx(8 * one.least)
            assert other.best == pytest.approx(8 * one.best, rel=1e-6)
        for one, other in zip(small.regions, big.regions, strict=True):
            assert other.widths == pytest.approx(8 * one.widths, rel=1e-6, abs=1e-7)


def test_the_account_of_the_sensitivity() -> None:
    for plan in planned()[::4]:
        text = str(plan.sensitivity())
        assert max(map(len, text.splitlines())) < 80
        assert text.startswith(f"What limits the regrasp of {plan.polygon.name}")
        for number in range(len(plan.grasps)):
            assert any(line.split()[:1] == [str(number)] for line in text.splitlines())
        _, table = text.split("back and ahead\n")
        head, *rows = table.splitlines()
        columns = [m.span() for m in re.finditer(r" *[^ ]+", head)][1:]
        cells = [[row[a:b].strip() for a, b in columns] for row in rows]
        # a value for each finger: what is empty looks like what is not known
        assert all(all(row) for row in cells)
        assert len(cells) == sum(len(region.fingers) for region in plan.regions())


def test_regions_of_fingers_that_are_all_at_an_end() -> None:
    """None can move on past its vertex, each can come back."""
    polygon = rl.Polygon([(0, 0), (4, 0), (1, 3)])
    start = [(0, 0.0), (1, 0.0), (2, 0.0)]
    plan = rl.plan_regrasp(polygon, start, [(0, 2.0), (1, 2.0), (2, 1.0)], friction=2.0)
    first = plan.regions()[0]
    assert plan.grasps[0].tolerance == 0
    assert (first.widths[:, 0] == 0).all()
    assert (first.widths[:, 1] > 0).any()


def test_the_account_of_a_plan_has_tolerances_and_limits() -> None:
    for plan in planned():
        lines = str(plan).splitlines()
        assert max(map(len, lines)) < 80
        for grasp in plan.grasps:
            assert any(f"{grasp.tolerance:.4g}" in line.split() for line in lines)
        assert any(
            line.startswith("least margin after") or "least margin at" in line for line in lines
        )
        assert any(line.startswith("least tolerance a") for line in lines)


def test_bands_of_the_filmstrip_are_the_regions() -> None:
    """In every panel, for the supporting fingers; no bands in a plan that does not hold."""
    plan = next(p for p in planned() if any(isinstance(s, rl.Slide) for s in p.steps))
    found = regions(plan, slides=False)
    figure = plan.plot()
    panels = [ax for ax in figure.axes if ax.get_label().startswith("panel")]
    assert len(panels) == len(found)
    for ax, region in zip(panels, found, strict=True):
        bands = [line for line in ax.lines if line.get_color() == palette.ORANGE]
        drawn = {tuple(band.get_xydata().ravel().round(9)) for band in bands}
        ends = [
            np.stack([plan.polygon.point(end) for end in interval])
            for interval in region.intervals.values()
        ]
        assert drawn == {tuple(points.ravel().round(9)) for points in ends}
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "where it may be" in words
    weak = replace(plan, friction=0.01 * plan.friction).plot()
    assert "where it may be" not in [text.get_text() for text in weak.legends[0].get_texts()]
