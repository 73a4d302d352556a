"""Sets cut at a level: closed forms against linear programs, parts against all overlaps."""

from itertools import combinations, pairwise

import numpy as np
import pytest
from conftest import covering
from geometry import ell, rectangle, star, unit_square, you
from hypothesis import given, settings
from hypothesis import strategies as st
from routes import maximum
from scipy.optimize import linprog

import regrasp_lp as rl
from regrasp_lp.lp import get_solver, maximise_margins
from regrasp_lp.margins import largest_margins
from regrasp_lp.planning.levels import Cut, PieceRows
from regrasp_lp.planning.moves import common_contacts, joined, reach

MEASURES = ("margin", "tolerance")

SUBJECTS = {
    "rectangle": (rectangle, 0.3),
    "ell": (ell, 0.15),
    "square": (unit_square, 0.6),
    "turned square": (lambda: turned_square(0.3), 1.0),
    "star": (lambda: star(6, 1), 0.2),
    "you": (you, 0.3),
}


def turned_square(angle: float) -> rl.Polygon:
    """Its opposite sides are parallel but for rounding."""
    c, s = np.cos(angle), np.sin(angle)
    return rl.Polygon(unit_square().vertices @ np.array([[c, s], [-s, c]]))


def rows_of(name: str, measure: str, sets: str = "complete") -> PieceRows:
    make, friction = SUBJECTS[name]
    graph = rl.build_switching_graph(make(), friction, sets=sets)
    return PieceRows(graph.sets.sources, measure)


def by_program(
    rows: PieceRows,
    index: int,
    pieces: list[tuple[int, int]],
    given: dict[int, float] | None = None,
) -> float:
    """The largest level on some pieces of a set at once, some fractions given."""
    m = int(rows.contacts[index])
    eye, lengths = np.eye(m), rows.lengths[index, :m]
    program = []
    for j, k in pieces:
        for function, sign in ((j, 1.0), (k, -1.0)):
            row = sign * rows.slopes[index, function, :m]
            program.append((row, 1.0, -sign * rows.offsets[index, function]))
    for slot in range(m):
        if rows.measure == "tolerance":
            program += [
                (-lengths[slot] * eye[slot], 1.0, 0.0),
                (lengths[slot] * eye[slot], 1.0, lengths[slot]),
            ]
        if slot and rows.edges[index, slot] == rows.edges[index, slot - 1]:
            program.append((eye[slot - 1] - eye[slot], 0.0, 0.0))
    for slot, value in (given or {}).items():
        program += [(eye[slot], 0.0, value), (-eye[slot], 0.0, -value)]
    return maximum(program, np.ones(m))


# --- closed forms -------------------------------------------------------------------------------

_offset = st.integers(-8, 8).map(lambda n: n / 2)
_slope = st.integers(0, 8).map(lambda n: n / 2)
_end = st.sampled_from([0.0, 0.25, 0.5, 1.0, 2.0])


@st.composite
def two_rows(draw: st.DrawFn) -> tuple[np.ndarray, ...]:
    m = draw(st.integers(1, 3))

    def slopes(of: st.SearchStrategy[float]) -> np.ndarray:
        return np.array(draw(st.lists(of, min_size=m, max_size=m)))

    alpha, beta = np.array(draw(_offset)), np.array(draw(_offset))
    return alpha, slopes(_slope), beta, slopes(_slope), slopes(_end)


@settings(max_examples=150, deadline=None)
@given(two_rows())
def test_the_largest_margin_in_a_box_that_shrinks_is_the_linear_programs(rows) -> None:
    alpha, a, beta, b, ends = rows
    m = len(a)
    matrix = [[*b, 1.0], [*-a, 1.0]]
    bounds = [-beta, alpha]
    for i in range(m):
        unit = np.eye(m)[i]
        matrix += [[*-unit, ends[i]], [*unit, ends[i]]]
        bounds += [0.0, 1.0]
    found = linprog([0.0] * m + [-1.0], matrix, bounds, bounds=(None, None))
    assert found.status == 0
    assert float(largest_margins(alpha, a, beta, b, ends)) == pytest.approx(-found.fun, abs=1e-7)


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("name", SUBJECTS)
def test_levels_are_those_of_linear_programs(name: str, measure: str) -> None:
    """Of plain sets; of others they are upper bounds."""
    rows = rows_of(name, measure)
    rng = np.random.default_rng(1)
    for index in rng.choice(len(rows), min(6, len(rows)), replace=False).tolist():
        levels = rows.levels(np.array([index]))[0]
        pieces = np.argwhere(np.isfinite(levels))
        for j, k in rng.permutation(pieces)[:8].tolist():
            expected = by_program(rows, index, [(j, k)])
            if rows.plain(np.array([index]))[0]:
                assert max(levels[j, k], 0) == pytest.approx(max(expected, 0), abs=1e-7)
            else:
                assert levels[j, k] >= expected - 1e-7
        assert rows.best[index] == levels.max()


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("name", SUBJECTS)
def test_levels_from_a_least_one_on_are_the_same(name: str, measure: str) -> None:
    """All others are lower, or -inf."""
    rows = rows_of(name, measure)
    rng = np.random.default_rng(3)
    every = np.arange(len(rows))
    slots = np.zeros((len(rows), 1), dtype=np.intp)
    values = rng.choice([0.0, 1.0, *rng.random(4)], (len(rows), 1))
    left_out = 0
    for least in (0.0, 0.3 * float(rows.best.max()), float(np.median(rows.best))):
        for whole, part in (
            (rows.levels(every), rows.levels(every, least)),
            (rows.completed(every, slots, values), rows.completed(every, slots, values, least)),
        ):
            kept = np.isfinite(part)
            assert (part[kept] == whole[kept]).all()
            assert (whole[~kept] < least + 1e-12).all()
            left_out += int(np.isfinite(whole).sum() - kept.sum())
    assert left_out


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("name", ["ell", "square", "you"])
def test_levels_with_contacts_given_are_those_of_linear_programs(name: str, measure: str) -> None:
    rows = rows_of(name, measure)
    rng = np.random.default_rng(2)
    plain = np.flatnonzero(rows.plain(np.arange(len(rows))))
    for index in rng.choice(plain, 8).tolist():
        m = int(rows.contacts[index])
        held = int(rng.integers(1, m + 1))
        slots = np.sort(rng.choice(m, held, replace=False))
        values = rng.choice([0.0, 0.25, 1.0, *rng.random(3)], held)
        found = rows.completed(np.array([index]), slots[None], values[None])[0]
        pieces = np.argwhere(np.isfinite(rows.levels(np.array([index]))[0]))
        at = dict(zip(slots.tolist(), values.tolist(), strict=True))
        for j, k in rng.permutation(pieces)[:6].tolist():
            expected = max(by_program(rows, index, [(j, k)], at), 0)
            assert max(found[j, k], 0) == pytest.approx(expected, abs=1e-7)


# --- parts --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("of", "measure"),
    covering(
        [(name, "complete") for name in SUBJECTS] + [("star", "chapter"), ("you", "chapter")],
        MEASURES,
    ),
)
def test_parts_are_the_components_of_all_overlaps(of: tuple[str, str], measure: str) -> None:
    name, sets = of
    rows = rows_of(name, measure, sets)
    rng = np.random.default_rng(3)
    several = 0
    for index in rng.permutation(len(rows))[:8].tolist():
        every = np.argwhere(np.isfinite(rows.levels(np.array([index]))[0])).tolist()
        widths = {tuple(p): by_program(rows, index, [tuple(p)]) for p in every}
        for factor in (0.3, 0.6, 0.9):
            level = factor * float(rows.best[index])
            part = Cut(rows, level, get_solver("clarabel")).part(index)
            pieces = [tuple(p) for p in part.pieces.tolist()]
            if len(pieces) > 8:
                continue
            clear = 1e-7 * rows.cones.size
            assert {p for p, w in widths.items() if w > level + clear} <= set(pieces)
            assert set(pieces) <= {p for p, w in widths.items() if w > level - clear}
            pairs = list(combinations(range(len(pieces)), 2))
            shared = [by_program(rows, index, [pieces[p], pieces[q]]) for p, q in pairs]
            certain, possible = (
                components(
                    len(pieces),
                    [pair for pair, width in zip(pairs, shared, strict=True) if width >= least],
                )
                for least in (level + clear, level - clear)
            )
            labels = part.labels.tolist()
            # As many as there are, but where a program cannot tell.
            assert len(set(possible)) <= len(set(labels)) <= len(set(certain))
            for one, other in combinations(range(len(pieces)), 2):
                assert certain[one] != certain[other] or labels[one] == labels[other]
                assert labels[one] != labels[other] or possible[one] == possible[other]
            several += len(set(labels)) > 1
    if name == "you":
        assert several  # the test sees sets that fall apart


def components(count: int, pairs: list[tuple[int, int]]) -> list[int]:
    """Number of the component of each of `count` things, by repeated merging."""
    labels = list(range(count))
    for one, other in pairs:
        old, new = labels[one], labels[other]
        labels = [new if label == old else label for label in labels]
    return labels


@pytest.mark.parametrize("name", ["star", "square"])
def test_a_chain_leads_through_pieces_that_overlap(name: str) -> None:
    rows = rows_of(name, "margin")
    for index in range(0, len(rows), 4):
        level = 0.4 * float(rows.best[index])
        part = Cut(rows, level, get_solver("clarabel")).part(index)
        for last in np.flatnonzero(part.labels == part.labels[0]).tolist():
            chain = part.chain(0, last)
            assert (chain[0], chain[-1]) == (0, last)
            for one, other in pairwise(chain):
                both = [tuple(part.pieces[p].tolist()) for p in (one, other)]
                assert by_program(rows, index, both) >= level - 1e-7


def test_points_of_parts_reach_the_level() -> None:
    for measure in MEASURES:
        rows = rows_of("star", measure)
        for index in range(len(rows)):
            functions = rows.functions(index)
            level = 0.7 * float(rows.best[index])
            part = Cut(rows, level, get_solver("clarabel")).part(index)
            for point in part.points[:, : functions.m]:
                least = functions.margins if measure == "margin" else functions.tolerances
                assert least(point)[0] >= level - 1e-8


@pytest.mark.parametrize("solver", ["clarabel", "highs"])
def test_contacts_that_want_to_coincide_lose_no_piece(solver: str) -> None:
    """Best with both on one spot: a row of order with a small scale would say that it is empty."""
    rows = rows_of("rectangle", "margin")
    index = next(i for i in range(len(rows)) if rows.edges[i].tolist() == [0, 0, 2])
    pieces = np.argwhere(np.isfinite(rows.levels(np.array([index]))[0]))
    cell = rows.cell(index, pieces, ["f0", "f1", "f2"])
    found = maximise_margins(cell, get_solver(solver)).margins
    for (j, k), margin in zip(pieces.tolist(), found.tolist(), strict=True):
        assert margin == pytest.approx(by_program(rows, index, [(j, k)]), abs=1e-7)


# --- switches -----------------------------------------------------------------------------------


def test_common_contacts_are_all_ways_to_hold_contacts_of_equal_edges() -> None:
    """Against all pairs of choices; a set with itself as well."""
    edges = np.array([[0, 1, -1], [0, 0, 1], [0, 1, 1], [1, 2, 3], [0, 0, 2]])
    everyone = np.arange(len(edges))
    for index in everyone.tolist():
        for held in range(1, int((edges[index] >= 0).sum()) + 1):
            found = common_contacts(edges, edges[index], everyone, held)
            rows = zip(found.others, found.here.tolist(), found.there.tolist(), strict=True)
            got = sorted((int(o), tuple(here), tuple(there)) for o, here, there in rows)
            expected = sorted(
                (other, here, there)
                for other in everyone.tolist()
                for here in combinations(range(3), held)
                for there in combinations(range(3), held)
                if all(edges[index, a] >= 0 for a in here)
                and edges[index, list(here)].tolist() == edges[other, list(there)].tolist()
            )
            assert got == expected


@pytest.mark.parametrize("measure", MEASURES)
def test_what_is_reached_by_a_switch_is_what_programs_join(measure: str) -> None:
    """`reach` never says too much, and `joined` agrees with it."""
    rows = rows_of("star", measure)
    rng = np.random.default_rng(5)
    certain = 0
    for index in rng.permutation(len(rows))[:4].tolist():
        cut = Cut(rows, 0.3 * float(rows.best[index]), get_solver("clarabel"))
        part = cut.part(index)
        others = np.setdiff1d(np.arange(len(rows)), [index])
        contacts = common_contacts(rows.edges, rows.edges[index], others, 1)
        found = reach(cut, index, 0, contacts)
        for row in rng.permutation(len(contacts.others))[:6].tolist():
            other = int(contacts.others[row])
            slots = ((int(contacts.here[row, 0]), int(contacts.there[row, 0])),)
            target = cut.part(other)
            reached = {
                int(target.labels[target.number((j, k))])
                for j, k in np.argwhere(found.pieces[row]).tolist()
                if target.number((j, k)) >= 0
            }
            assert bool(reached) == (found.origin[row] >= 0)
            if reached:
                assert part.labels[found.origin[row]] == 0
            certain += bool(reached)
            for label in reached:
                assert joined(cut, index, 0, other, label, [slots]) is not None
    assert certain
