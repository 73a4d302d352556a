"""The certificate checker: it accepts what is true and proved, and nothing else.

Files come from tests/certificate_writer.py, which shares no code with the checker. Each is then
corrupted, with the hash made right again: what is left out, changed or claimed falsely has to be
found by what the checker proves.
"""

from __future__ import annotations

import ast
import copy
import json
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import Any

import certificate_writer as writer
import pytest
from conftest import REPOSITORY
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import regrasp_lp as rl
from regrasp_lp import check_certificates
from regrasp_lp.check_certificates import Rejected, check, main

SCRIPT = REPOSITORY / "regrasp_lp" / "check_certificates.py"

TRIANGLE = [(0, 0), (4, 0), (0, 3)]
SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]
RECTANGLE = [(0, 0), (4, 0), (4, 2), (0, 2)]
PENTAGON = [(0, 0), (4, -1), (5, 2), (2, 4), (-1, 3)]
ELL = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
FRAME = [(0, 0), (4, 0), (4, 4), (0, 4)]
HOLE = [(1, 1), (1, 2), (2, 2), (2, 1)]
PARALLELOGRAM = [(0, 0), (1, 0), (4, 1), (3, 1)]
STEPS = [(0, 0), (3, 0), (3, 2), (5, 2), (5, 3), (2, 3), (2, 1), (0, 1)]

CASES: dict[str, dict[str, Any]] = {
    "triangle, 3 fingers": writer.description(TRIANGLE, 1.0, fingers=3),
    "triangle, slippery": writer.description(TRIANGLE, 0.2, fingers=4),
    "triangle, 5 fingers": writer.description(TRIANGLE, 0.5, fingers=5),
    "square, opposite rays": writer.description(SQUARE, 1.0),
    "square, rough": writer.description(SQUARE, 1.5, sets="chapter", fingers=5),
    "rectangle, opposite rays": writer.description(RECTANGLE, 1.0, fingers=3),
    "rectangle, chapter": writer.description(RECTANGLE, 1.0, sets="chapter"),
    "friction per edge": writer.description(RECTANGLE, [0.5, 1.0, 0.25, 2.0], fingers=3),
    "pentagon": writer.description(PENTAGON, 0.5, fingers=3),
    "pentagon, chapter": writer.description(PENTAGON, 1.5, sets="chapter"),
    "ell": writer.description(ELL, 1.0, fingers=4),
    "ell, chapter": writer.description(ELL, 1.5, sets="chapter"),
    "frame": writer.description(FRAME, 0.25, sets="chapter", holes=[HOLE]),
    "parallelogram": writer.description(PARALLELOGRAM, 0.25),
    "steps": writer.description(STEPS, 0.2, sets="chapter", fingers=5),
}
RICH = "ell, chapter"
"""All kinds of records with a proof but `empty`."""


@cache
def _lines(case: str) -> list[Any]:
    description = CASES[case]
    return [description, *writer.records(writer.Object(description))]


def lines(case: str) -> list[Any]:
    """Description and records of a valid file; a copy that a test may spoil."""
    return copy.deepcopy(_lines(case))


@pytest.fixture
def verdict(tmp_path: Path) -> Callable[[list[Any]], str]:
    """Write lines with the right hash; what the checker objects to, empty if to nothing."""

    def of(content: list[Any]) -> str:
        path = tmp_path / "spoilt.jsonl"
        path.write_bytes(writer.text(content))
        try:
            check(path)
        except Rejected as fault:
            return str(fault)
        return ""

    return of


def where(content: list[Any], *start: Any, skip: int = 0) -> int:
    """Index in the list of the first record that begins so; its line is two further."""
    found = [i for i, r in enumerate(content) if i and r[: len(start)] == list(start)]
    return found[skip]


def no_of(content: list[Any], held: int, parts: int = 1) -> int:
    """Index of a `no` with so many held contacts and so many intervals, at least."""
    return next(
        i
        for i, r in enumerate(content)
        if i and r[0] == "no" and len(r[3]) == held and (held == 3 or len(r[4]) >= parts)
    )


def line_of(index: int) -> str:
    return f"line {index + 2}: "


# --- accepted -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "case",
    [pytest.param(c, marks=[pytest.mark.slow] if c == "ell, chapter" else []) for c in CASES],
)
def test_accepts(case: str, tmp_path: Path) -> None:
    content = lines(case)
    path = tmp_path / "file.jsonl"
    path.write_bytes(writer.text(content))
    report = check(path)
    words = [record[0] for record in content[1:]]
    sets = sum(found for found, _ in report.kinds.values())
    candidates = sum(every for _, every in report.kinds.values())
    assert (sets, candidates - sets) == (words.count("set"), words.count("empty"))
    assert (report.yes, report.no) == (words.count("yes"), words.count("no"))
    assert report.switches == len({(r[1], r[2]) for r in content[1:] if r[0] == "yes"})
    assert (report.edges, report.fingers) == (len(content[0]["friction"]), content[0]["fingers"])


@pytest.mark.parametrize("case", CASES)
def test_writer_and_graph_agree(case: str) -> None:
    description, *records = lines(case)
    graph = rl.build_switching_graph(
        rl.Polygon(description["exterior"], holes=description["holes"]),
        description["friction"],
        hand=rl.Hand(description["fingers"]),
        sets=description["sets"],
    )
    found = [(r[1], tuple(r[2]), r[3]) for r in records if r[0] == "set"]
    sets = [(s.kind, s.edges, s.center) for s in graph.sets]
    assert sorted(map(str, found)) == sorted(map(str, sets))
    number = {key: i for i, key in enumerate(sets)}
    adjacent: dict[tuple[int, int], int] = {}
    for record in records:
        if record[0] == "yes":
            i, j = sorted(number[found[record[k]]] for k in (1, 2))
            adjacent[i, j] = max(adjacent.get((i, j), 0), len(record[3]))
    expected = {(i, j): graph.held(i, j) for i in range(len(sets)) for j in graph.neighbors(i)}
    assert adjacent == {(i, j): held for (i, j), held in expected.items() if held and i < j}


def test_cases_contain_every_sort_of_record() -> None:
    records = [r for case in CASES for r in lines(case)[1:]]
    decided = {(r[0], len(r[3])) for r in records if r[0] in ("yes", "no")}
    assert decided == {(word, h) for word in ("yes", "no") for h in (1, 2, 3)}
    assert {r[4] for r in records if r[0] == "empty"} == {"start", "end"}
    reasons = {part[0] for r in records if r[0] == "no" and r[4] for part in r[4]}
    assert reasons >= {"d0<=u1", "d1<=u0"}
    assert any(len(r[4]) > 1 for r in records if r[0] == "no" and r[4])
    fractions = [f for r in records if r[0] == "set" for f in r[4]]
    assert {type(f) for f in fractions} == {float, str}


def test_unit_square_at_the_critical_friction(tmp_path: Path) -> None:
    """At μ = 1 rays of adjacent edges are exactly opposite, and their pairs span nothing."""
    path = tmp_path / "square.jsonl"
    path.write_bytes(writer.text(lines("square, opposite rays")))
    assert check(path).kinds == {"two_finger": (2, 2), "three_finger": (8, 8)}


def test_order_of_independent_records_is_free(verdict: Callable[[list[Any]], str]) -> None:
    first, *records = lines(RICH)
    sets = [r for r in records if r[0] == "set"]
    others = [r for r in records if r[0] != "set"]
    # switches before the sets which they are about
    assert verdict([first, *others[::-1], *sets]) == ""


def test_values_may_be_written_in_other_ways(verdict: Callable[[list[Any]], str]) -> None:
    content = lines(RICH)
    content[0]["exterior"] = [[float(x), y] for x, y in content[0]["exterior"]]
    content[0]["exterior"][0] = [-0.0, 0]
    for record in content[1:]:
        if record[0] == "set":
            ratios = [Fraction(f).as_integer_ratio() for f in record[4]]
            record[4] = [f"{3 * p}/{3 * q}" for p, q in ratios]
    assert verdict(content) == ""


def test_report_in_words(tmp_path: Path) -> None:
    path = tmp_path / "file.jsonl"
    content = lines("friction per edge")
    content[0]["name"] = "blöck \ud800\n"
    path.write_bytes(writer.text(content))
    text = str(check(path))
    assert text.startswith(
        r"accepted: 'bl\xf6ck \ud800\n', 4 edges, friction 0.25 to 2, 3 fingers, complete sets"
    )
    assert "two_finger 2 of 2, three_finger 8 of 8" in text
    assert text.isascii()


# --- spoilt records -------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ["ell, chapter", "parallelogram", "pentagon"])
@pytest.mark.parametrize("word", ["set", "empty", "yes", "no"])
def test_nothing_may_be_left_out(case: str, word: str, verdict: Callable[[list[Any]], str]) -> None:
    content = lines(case)
    which = [i for i, r in enumerate(content) if i and r[0] == word]
    for i in which[:: max(1, len(which) // 6)]:
        fault = verdict(content[:i] + content[i + 1 :])
        if word in ("set", "empty"):
            # without a set the others have other numbers: either is noticed
            assert "nothing is said of the candidate" in fault or fault.startswith("line ")
        else:
            numbers = f"{content[i][1]} and {content[i][2]}"
            assert f"nothing is said of the sets {numbers} " in fault
            assert f"held on {content[i][3]}" in fault


def test_a_set_left_out_with_its_switches(verdict: Callable[[list[Any]], str]) -> None:
    content = lines("pentagon")
    last = sum(r[0] == "set" for r in content[1:]) - 1
    i = where(content, "set", skip=last)
    kept = [r for r in content[1:] if r is not content[i] and last not in r[1:3]]
    fault = verdict([content[0], *kept])
    assert fault == f"nothing is said of the candidate three_finger {content[i][2]}"


@pytest.mark.parametrize("word", ["set", "yes", "no"])
def test_nothing_may_come_twice(word: str, verdict: Callable[[list[Any]], str]) -> None:
    content = lines(RICH)
    i = where(content, word)
    fault = verdict([*content, content[i]])
    assert fault.startswith(line_of(len(content)))
    assert fault.endswith(f"decided before, in line {i + 2}")


def test_a_switch_cannot_be_yes_and_no(verdict: Callable[[list[Any]], str]) -> None:
    content = lines(RICH)
    i = no_of(content, 1)
    content.append(["yes", *content[i][1:4], [0.5, 0.5, 0.5], [0.5, 0.5, 0.5]])
    assert verdict(content).startswith(line_of(len(content) - 1))


def test_no_for_yes(verdict: Callable[[list[Any]], str]) -> None:
    """No reason holds where there are grasps; every one is tried on every kind of yes."""
    content = lines(RICH)
    for i in [j for j, r in enumerate(content) if j and r[0] == "yes"][::40]:
        _, one, other, held, *_ = content[i]
        proofs: list[Any] = [[[why]] for why in writer.WHYS]
        if len(held) == 2:
            proofs = [[[why, 0, 1]] for why in writer.WHYS]
        if len(held) == 3:
            proofs = [None]
        for proof in proofs:
            spoilt = [*content[:i], ["no", one, other, held, proof], *content[i + 1 :]]
            assert verdict(spoilt).startswith(line_of(i))


def test_no_for_yes_with_three_held(verdict: Callable[[list[Any]], str]) -> None:
    content = lines(RICH)
    for i, record in enumerate(content):
        if i and record[0] == "yes" and len(record[3]) == 3:
            spoilt = [*content[:i], ["no", *record[1:4], None], *content[i + 1 :]]
            fault = verdict(spoilt)
            assert fault.startswith(line_of(i))
            assert fault.endswith("the two sets have grasps in common")


@pytest.mark.parametrize("held", [1, 2, 3])
def test_yes_for_no(held: int, verdict: Callable[[list[Any]], str]) -> None:
    """Grasps of both sets, which do not agree in the held contacts, or agree and are none."""
    content = lines(RICH)
    i = no_of(content, held)
    _, one, other, edges, _ = content[i]
    sets = [r for r in content[1:] if r[0] == "set"]
    for change in (False, True):
        grasps = copy.deepcopy([sets[one][4], sets[other][4]])
        if change:
            slots = [writer.held_slots(sets[k][2], edges) for k in (one, other)]
            for a, b in zip(*slots, strict=True):
                grasps[1][b] = grasps[0][a]
        fault = verdict([*content[:i], ["yes", one, other, edges, *grasps], *content[i + 1 :]])
        assert fault.startswith(line_of(i))
        assert ("no torque function is" if change else "held on edge") in fault


def test_swapped_sets(verdict: Callable[[list[Any]], str]) -> None:
    content = lines(RICH)
    i, j = where(content, "set"), where(content, "set", skip=3)
    content[i], content[j] = content[j], content[i]
    assert verdict(content).startswith("line ")
    content = lines(RICH)
    i = where(content, "yes")
    content[i][1], content[i][2] = content[i][2], content[i][1]
    assert "I < J" in verdict(content)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.__setitem__(1, 5.0), "I is 5.0, no integer"),
        (lambda r: r.__setitem__(1, True), "I is True, no integer"),
        (lambda r: r.__setitem__(2, 10**9), "two sets I < J of the 45 sets"),
        (lambda r: r.__setitem__(1, -1), "two sets I < J"),
        (lambda r: r.__setitem__(2, r[1]), "two sets I < J"),
        (lambda r: r.__setitem__(2, "3"), "J is '3', no integer"),
        (lambda r: r.__setitem__(3, [*r[3][:-1], 99]), "HELD is not, in ascending order, part"),
        (lambda r: r.__setitem__(3, r[3][::-1]), "HELD is not, in ascending order, part"),
        (lambda r: r.__setitem__(3, r[3] * 2), "HELD is not, in ascending order, part"),
        (lambda r: r.__setitem__(3, []), "have to hold at least"),
        (lambda r: r.__setitem__(3, None), "HELD is None, no list of edges"),
        (lambda r: r.__setitem__(3, [[0]]), "an edge of HELD is [0], no integer"),
        (lambda r: r.append(None), "6 entries"),
        (lambda r: r.pop(), "6 entries"),
        (lambda r: r.__setitem__(0, "maybe"), "a record begins with set, empty, yes or no"),
        (lambda r: r.__setitem__(0, None), "no record, a list that begins with a word"),
        (lambda r: r.clear(), "no record, a list that begins with a word"),
        (lambda r: r[4].append(0.5), "FRACTIONS_I is [0."),
        (lambda r: r[5].pop(), "FRACTIONS_J is [0."),
        (lambda r: r.__setitem__(4, "half"), "FRACTIONS_I is 'half', no list of"),
    ],
)
def test_malformed_yes(
    change: Callable[[Any], Any], message: str, verdict: Callable[[list[Any]], str]
) -> None:
    content = lines(RICH)
    i = next(j for j, r in enumerate(content) if j and r[0] == "yes" and len(r[3]) == 2)
    change(content[i])
    fault = verdict(content)
    assert fault.startswith(line_of(i))
    assert message in fault


BAD_FRACTIONS = [
    True, None, "0.5", "1/0", "0/0", "1e5/3", "１/2", "1/2/3", "-1/2", "3/2", "1/-2", " 1/2",
    "1/2\n", "+1/2", "1_0/20", "", "/", "1/", "half", [0.5], {}, -1e-9,
    1.0000000000000002, 2, -1, 10**400,
    "1" * 5000 + "/" + "1" * 5001, "1/" + "9" * 4000 + "0/1", 1e308,
]  # fmt: skip


@pytest.mark.parametrize("value", BAD_FRACTIONS, ids=lambda v: ascii(v)[:16])
def test_fractions_are_doubles_or_ratios_within_the_edge(
    value: Any, verdict: Callable[[list[Any]], str]
) -> None:
    for word, place in (("set", 4), ("yes", 5), ("no", 4)):
        content = lines(RICH)
        i = no_of(content, 2) if word == "no" else where(content, word)
        entry = content[i][place][0] if word == "no" else content[i][place]
        entry[-1] = value
        fault = verdict(content)
        assert fault.startswith(line_of(i))
        assert fault.endswith(
            ("in [0, 1]", "no number", "range of a double", "LOW is more than HIGH")
        )


def test_other_fractions(verdict: Callable[[list[Any]], str]) -> None:
    """A grasp at a corner of its box is none, for a set that is neither everything nor nothing."""
    content = lines(RICH)
    for i in [j for j, r in enumerate(content) if j and r[0] == "set"][::5]:
        for corner in (0, 1):
            spoilt = copy.deepcopy(content)
            spoilt[i][4] = [corner] * len(spoilt[i][4])
            thing = writer.Object(content[0])
            functions = thing.functions((content[i][1], tuple(content[i][2]), content[i][3]))
            torques = [f[0] + corner * sum(f[1:]) for f in functions]
            if min(torques) < 0 < max(torques):
                assert verdict(spoilt) == ""
            else:
                assert verdict(spoilt).startswith(line_of(i))


def test_held_contacts_agree_exactly(verdict: Callable[[list[Any]], str]) -> None:
    content = lines(RICH)
    i = where(content, "yes")
    sets = [r for r in content[1:] if r[0] == "set"]
    slot = sets[content[i][2]][2].index(content[i][3][0])
    value = Fraction(content[i][5][slot]) + Fraction(1, 10**30)
    content[i][5][slot] = f"{value.numerator}/{value.denominator}"
    fault = verdict(content)
    assert fault.startswith(line_of(i))
    assert f"held on edge {content[i][3][0]} differ" in fault


def test_empty_for_set_and_set_for_empty(verdict: Callable[[list[Any]], str]) -> None:
    content = lines("parallelogram")
    for i, record in enumerate(content):
        if i and record[0] == "set":
            for corner in ("start", "end", "middle", None, 0):
                spoilt = copy.deepcopy(content)
                spoilt[i] = ["empty", *record[1:4], corner]
                assert verdict(spoilt).startswith(line_of(i))
        if i and record[0] == "empty":
            other = {"start": "end", "end": "start"}[record[4]]
            for proof in (["set", *record[1:4], [0.5] * len(record[2])], [*record[:4], other]):
                spoilt = copy.deepcopy(content)
                spoilt[i] = proof
                assert verdict(spoilt).startswith(line_of(i))


@pytest.mark.parametrize(
    "key",
    [
        ["two_finger", [1, 0], None],
        ["two_finger", [0, 0], None],
        ["two_finger", [0, 6], None],
        ["two_finger", [0, True], None],
        ["two_finger", [0, 2], 0],
        ["two_finger", [0, 1, 2], None],
        ["three_finger", [0, 1, 2], None],
        ["parallel", [0, 2, 4], None],
        ["parallel", [0, 2, 4], 3],
        ["parallel", [0, 2, 4], 0.0],
        ["parallel", [0, 2, 4], False],
        ["concurrent", [0, 1, 2], None],
        [None, [0, 1], None],
        [["two_finger"], [0, 1], None],
        ["two_finger", "01", None],
        ["two_finger", [0, -4], None],
    ],
)
def test_no_other_candidates(key: list[Any], verdict: Callable[[list[Any]], str]) -> None:
    for word, proof in (("set", [0.5] * 3), ("empty", "start")):
        content = [*lines(RICH), [word, *key, proof]]
        assert verdict(content).startswith(line_of(len(content) - 1))


# --- proofs of no ---------------------------------------------------------------------------------


def test_proof_of_one_held_contact(verdict: Callable[[list[Any]], str]) -> None:
    content = lines(RICH)
    i = no_of(content, 1)
    true = _true_reasons(content, i)
    assert [content[i][4][0][0]] == true[:1]
    for why in (*writer.WHYS, "d0<=u0", "D0<=U1", "", None, 3, ["d0<=0"], {}):
        spoilt = copy.deepcopy(content)
        spoilt[i][4] = [[why]]
        fault = verdict(spoilt)
        assert (fault == "") == (why in true)
        assert why in true or fault.startswith(line_of(i))
    for proof in ([], None, [[]], [true[:1], true[:1]], [[true[0], 0, 1]], true[0], [true[0]], {}):
        content[i][4] = proof
        assert verdict(content).startswith(line_of(i))


def _true_reasons(content: list[Any], i: int) -> list[str]:
    """All reasons that hold for a `no` with one held contact, by the writer's conditions."""
    thing = writer.Object(content[0])
    sets = [r for r in content[1:] if r[0] == "set"]
    shadows = []
    for k in content[i][1:3]:
        key = (sets[k][1], tuple(sets[k][2]), sets[k][3])
        slots = writer.held_slots(key[1], content[i][3])
        both = [writer.projected(thing.functions(key), slots, end) for end in (0, 1)]
        shadows.append([[(c, Fraction(0), y) for c, y in f] for f in both])
    return [w for w in writer.WHYS if writer.interval(writer.conditions(w, shadows))]


def test_intervals_have_to_cover(verdict: Callable[[list[Any]], str]) -> None:
    content = lines(RICH)
    i = no_of(content, 2, parts=2)
    intervals = content[i][4]
    for k in range(len(intervals)):
        spoilt = copy.deepcopy(content)
        del spoilt[i][4][k]
        fault = verdict(spoilt)
        assert fault.startswith(line_of(i))
        assert "the intervals leave (" in fault
    # a single point is enough of a gap
    tiny = Fraction(1, 10**40)
    for k, (_, low, high) in enumerate(intervals):
        for place, end in ((1, Fraction(low) + tiny), (2, Fraction(high) - tiny)):
            spoilt = copy.deepcopy(content)
            spoilt[i][4][k][place] = f"{end.numerator}/{end.denominator}"
            joint = spoilt[i][4]
            spans = sorted((Fraction(a), Fraction(b)) for _, a, b in joint)
            reached = Fraction(0)
            for a, b in spans:
                reached = max(reached, b) if a <= reached else reached
            fault = verdict(spoilt)
            assert (fault == "") == (reached == 1)
            assert reached == 1 or "uncovered" in fault
    content[i][4] = intervals[::-1]  # in any order
    assert verdict(content) == ""
    content[i][4] = []
    assert "the intervals leave (0, 1) uncovered" in verdict(content)


@pytest.mark.parametrize("case", ["ell, chapter", "pentagon, chapter"])
def test_intervals_where_their_reason_does_not_hold(
    case: str, verdict: Callable[[list[Any]], str]
) -> None:
    content = lines(case)
    for i, record in enumerate(content):
        if i == 0 or record[0] != "no" or len(record[3]) != 2:
            continue
        for k, (why, low, high) in enumerate(record[4]):
            for place, end in ((1, 0), (2, 1)):
                if record[4][k][place] == end:
                    continue
                # the writer's intervals are as long as the reason allows
                spoilt = copy.deepcopy(content)
                beyond = Fraction((low, high)[place - 1]) + Fraction(2 * end - 1, 10**40)
                spoilt[i][4][k][place] = f"{beyond.numerator}/{beyond.denominator}"
                fault = verdict(spoilt)
                assert fault.startswith(line_of(i))
                assert f"{why} does not hold at " in fault
        spoilt = copy.deepcopy(content)
        spoilt[i][4][0][1:] = [1, 0]
        assert verdict(spoilt).startswith(line_of(i))
        for entry in (["d0<=u1"], [], None, "d0<=u1", ["d0<=u1", 0, 1, 1], [None, 0, 1]):
            spoilt[i][4] = [entry, *record[4]]
            assert verdict(spoilt).startswith(line_of(i))


def test_proof_of_three_held_contacts_is_null(verdict: Callable[[list[Any]], str]) -> None:
    content = lines(RICH)
    i = no_of(content, 3)
    for proof in ([], [["d0<=0"]], False, 0, ""):
        content[i][4] = proof
        assert "is null" in verdict(content)


# --- the object -----------------------------------------------------------------------------------

VALID = lines("rectangle, chapter")[0]


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("exterior", [[0, 0], [4, 0]], "no list of at least 3 points"),
        ("exterior", {"a": 1}, "no list of at least 3 points"),
        ("exterior", [[0, 0], [4, 0], [4, 2], [0, "2"]], "'2', no number"),
        ("exterior", [[0, 0], [4, 0], [4, 2], [0, True]], "True, no number"),
        ("exterior", [[0, 0], [4, 0], [4, 2], [0, None]], "None, no number"),
        ("exterior", [[0, 0], [4, 0], [4, 2], [0, 2, 0]], "no list [x, y]"),
        ("exterior", [[0, 0], [4, 0], [4, 2], [0, float("nan")]], "NaN is no number"),
        ("exterior", [[0, 0], [4, 0], [4, 2], [0, float("inf")]], "Infinity is no number"),
        ("exterior", [[0, 0], [4, 0], [4, 2], [0, 10**400]], "beyond the range of a double"),
        ("exterior", [[0, 0], [0, 2], [4, 2], [4, 0]], "turns the wrong way"),
        ("exterior", [[0, 0], [4, 0], [4, 0], [0, 2]], "edge 1 has no length"),
        ("exterior", [[0, 0], [4, 0], [4, 2], [0, 0]], "edge 3 has no length"),
        ("exterior", [[0, 0], [4, 0], [2, 0], [0, 2]], "edge 1 folds back onto edge 0"),
        ("exterior", [[0, 0], [4, 2], [4, 0], [0, 3]], "edges 0 and 2 meet"),
        ("exterior", [[0, 0], [4, 0], [4, 2], [2, 0], [0, 2]], "edges 0 and 2 meet"),
        ("exterior", [[4, 2], [2, 0], [0, 2], [0, 0], [4, 0]], "edges 0 and 3 meet"),
        ("exterior", [[0, 0], [1, 1], [2, 2], [3, 3]], "no area"),
        ("holes", None, "no list of rings"),
        ("holes", [[]], "no list of at least 3 points"),
        ("friction", 1.0, "no list of 4 numbers"),
        ("friction", [1.0, 1.0, 1.0], "no list of 4 numbers"),
        ("friction", [1.0, 1.0, 1.0, 0.0], "a friction is 0; the theory needs"),
        ("friction", [1.0, 1.0, 1.0, -1.0], "a friction is -1"),
        ("friction", [1.0, 1.0, 1.0, "1/2"], "a friction is '1/2', no number"),
        ("fingers", 1, "a hand of 1 fingers"),
        ("fingers", 4.0, "fingers is 4.0, no integer"),
        ("fingers", True, "fingers is True, no integer"),
        ("sets", "all", 'neither "complete" nor "chapter"'),
        ("sets", ["complete"], 'neither "complete" nor "chapter"'),
        ("name", None, "the name is no string"),
        ("extra", 1, "should have the keys"),
    ],
)
def test_malformed_objects(
    key: str, value: Any, message: str, verdict: Callable[[list[Any]], str]
) -> None:
    content = lines("rectangle, chapter")
    content[0][key] = value
    fault = verdict(content)
    assert fault.startswith("line 2: ")
    assert message in fault


@pytest.mark.parametrize("key", VALID)
def test_no_key_may_be_missing(key: str, verdict: Callable[[list[Any]], str]) -> None:
    content = lines("rectangle, chapter")
    del content[0][key]
    assert "should have the keys" in verdict(content)


@pytest.mark.parametrize(
    ("holes", "message"),
    [
        ([HOLE[::-1]], "ring 1 has no area or turns the wrong way"),
        ([[(5, 1), (5, 2), (6, 2)]], "hole 0 is not inside the outline"),
        ([[(1, 1), (1, 5), (2, 2)]], "meet"),
        ([[(0, 1), (1, 2), (1, 1)]], "edges 3 and 4 meet"),
        ([HOLE, [(1.25, 1.25), (1.25, 1.5), (1.5, 1.5)]], "hole 1 is not inside the outline, or"),
        ([[(1, 1), (1, 3), (3, 3), (3, 1)], [(2, 2), (2, 5), (5, 2)]], "meet"),
    ],
)
def test_malformed_holes(
    holes: list[Any], message: str, verdict: Callable[[list[Any]], str]
) -> None:
    fault = verdict([writer.description(FRAME, 1.0, holes=holes)])
    assert fault.startswith("line 2: ")
    assert message in fault


def test_other_numbers_in_the_object(verdict: Callable[[list[Any]], str]) -> None:
    """The records prove nothing of another object, another hand or other kinds of sets."""
    for change in (
        lambda d: d["exterior"][2].__setitem__(0, 1.125),
        lambda d: d["exterior"][3].__setitem__(1, 1.5),
        lambda d: d.update(friction=[0.25] * 6),
        lambda d: d["friction"].__setitem__(0, 0.75),
        lambda d: d.update(fingers=3),
        lambda d: d.update(fingers=5),
        lambda d: d.update(sets="complete"),
        lambda d: d["exterior"].append(d["exterior"].pop(0)),
    ):
        content = lines(RICH)
        change(content[0])
        assert verdict(content)


def test_what_proves_another_object_too(verdict: Callable[[list[Any]], str]) -> None:
    """Scaled by a power of two or moved, with all fractions the same, everything stays true."""
    for scale, x, y in ((2.0**-40, 0.0, 0.0), (2.0**900, 0.0, 0.0), (1.0, 2.0**30, -(2.0**31))):
        content = lines("triangle, 3 fingers")
        content[0]["exterior"] = [[scale * a + x, scale * b + y] for a, b in TRIANGLE]
        assert verdict(content) == ""


# --- bytes ----------------------------------------------------------------------------------------

SMALL = "triangle, slippery"


@given(st.data())
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_changed_byte_is_seen(tmp_path: Path, data: st.DataObject) -> None:
    original = writer.text(lines(SMALL))
    i = data.draw(st.integers(0, len(original) - 1))
    byte = data.draw(st.integers(0, 255).filter(lambda b: b != original[i]))
    path = tmp_path / "changed.jsonl"
    path.write_bytes(original[:i] + bytes([byte]) + original[i + 1 :])
    with pytest.raises(Rejected, match=r"^line 1: "):
        check(path)


@given(st.data())
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_truncated_files(tmp_path: Path, data: st.DataObject) -> None:
    original = writer.text(lines(SMALL))
    size = data.draw(st.integers(0, len(original) - 1))
    path = tmp_path / "short.jsonl"
    path.write_bytes(original[:size])
    with pytest.raises(Rejected, match=r"^line 1: "):
        check(path)


@given(st.data())
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_lines_with_the_right_hash(tmp_path: Path, data: st.DataObject) -> None:
    """Whatever bytes stand there, there is a verdict and no other exception."""
    rest = writer.text(lines(SMALL)).partition(b"\n")[2]
    i = data.draw(st.integers(0, len(rest)))
    j = data.draw(st.integers(i, min(len(rest), i + 4)))
    rest = rest[:i] + data.draw(st.binary(max_size=4)) + rest[j:]
    path = tmp_path / "damaged.jsonl"
    path.write_bytes(writer.first_line(rest) + rest)
    try:
        check(path)
    except Rejected as fault:
        assert str(fault)


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"[" * 100_000,
        b"[" * 100_000 + b"]" * 100_000,
        b'["yes", 0, 1, ' + b"[" * 900 + b"]" * 900 + b", 1]",
        b"\xff\xfe\x00garbage\x00",
        b"\xef\xbb\xbf[]",
        b'["set"',
        b'["set", NaN]',
        b'{"a": 1, "a": 2}',
        b'["empty", {"a": 1, "a": 2}, [0, 1], null, "start"]',
        b"1" * 5000,
        b'["yes", ' + b"1" * 4000 + b", 2, [0], [], []]",
        b'["yes", 0]',
        b'["set"]',
        b'["set", "two_finger", [0, 1], null, [1e400, 0]]',
        b'"set"',
        b"null",
        b"[] []",
    ],
    ids=lambda line: ascii(line)[:20],
)
def test_lines_that_are_no_record(line: bytes, tmp_path: Path) -> None:
    content = writer.text(lines(SMALL))
    rest = content.partition(b"\n")[2] + line + b"\n"
    path = tmp_path / "file.jsonl"
    path.write_bytes(writer.first_line(rest) + rest)
    with pytest.raises(Rejected, match=rf"^line {len(lines(SMALL)) + 2}: "):
        check(path)


@pytest.mark.parametrize("rest", [b"", b"\n", b"[]\n", b"{}\n", b'{"name": 1, "name": 2}\n'])
def test_files_without_an_object(rest: bytes, tmp_path: Path) -> None:
    path = tmp_path / "file.jsonl"
    path.write_bytes(writer.first_line(rest) + rest)
    with pytest.raises(Rejected, match="^line 2: "):
        check(path)


@pytest.mark.parametrize(
    "first",
    [
        b"",
        b"{}",
        b'{"format": "regrasp-certificates", "version": 2, "sha256": "%s"}',
        b'{"format": "regrasp-certificates", "version": 1.0, "sha256": "%s"}',
        b'{"format": "regrasp-graph", "version": 1, "sha256": "%s"}',
        b'{"format": "regrasp-certificates", "version": 1, "sha256": "%s"} ',
        b'{"version": 1, "format": "regrasp-certificates", "sha256": "%s"}',
        b'{"format": "regrasp-certificates", "version": 1, "sha256": ""}',
    ],
)
def test_first_lines(first: bytes, tmp_path: Path) -> None:
    rest = writer.text(lines(SMALL)).partition(b"\n")[2]
    digest = json.loads(writer.first_line(rest))["sha256"].encode()
    path = tmp_path / "file.jsonl"
    path.write_bytes(first.replace(b"%s", digest) + b"\n" + rest)
    with pytest.raises(Rejected, match="^line 1: "):
        check(path)


def test_upper_case_hash_is_refused(tmp_path: Path) -> None:
    content = writer.text(lines(SMALL))
    first, _, rest = content.partition(b"\n")
    digest = json.loads(first)["sha256"].encode()
    path = tmp_path / "file.jsonl"
    path.write_bytes(first.replace(digest, digest.upper()) + b"\n" + rest)
    with pytest.raises(Rejected, match="^line 1: "):
        check(path)


# --- elimination ----------------------------------------------------------------------------------


@given(st.lists(st.tuples(*[st.integers(-3, 3)] * 4, st.booleans()), min_size=1, max_size=7))
@settings(max_examples=300)
def test_elimination(rows: list[tuple[Any, ...]]) -> None:
    """Against the writer's, which finds a point: the point is checked here."""
    box = [((0, *(-int(i == k) for i in range(3))), False) for k in range(3)]
    box += [((-1, *(int(i == k) for i in range(3))), False) for k in range(3)]
    system = {(row[:4], row[4]) for row in rows} | set(box)
    exact = [(tuple(map(Fraction, row)), strict) for row, strict in system]
    point = writer.solve(exact)
    assert check_certificates.solvable(system) == (point is not None)
    if point is not None:
        for row, strict in exact:
            value = row[0] + sum(a * x for a, x in zip(row[1:], point, strict=True))
            assert value < 0 or (value == 0 and not strict)


@given(st.permutations(range(4)), st.integers(0, 15))
@settings(max_examples=60)
def test_spanning(order: list[int], mask: int) -> None:
    """The rule of sides against the definition, on a body with exactly opposite rays."""
    body = check_certificates.Body(CASES["square, opposite rays"])
    thing = writer.Object(CASES["square, opposite rays"])
    edges = sorted(e for e in order if mask >> e & 1)
    if edges:
        assert check_certificates.spans(body, edges) == thing.positively_spans(edges)


# --- command line ---------------------------------------------------------------------------------


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    good, bad = tmp_path / "good.jsonl", tmp_path / "bäd.jsonl"
    content = lines(SMALL)
    good.write_bytes(writer.text(content))
    content[-1][0] = "sät"
    bad.write_bytes(writer.text(content))
    return {"good": good, "bad": bad, "none": tmp_path / "none.jsonl", "folder": tmp_path}


@pytest.mark.parametrize(
    ("names", "code"),
    [
        (["good"], 0),
        (["good", "good"], 0),
        (["bad"], 1),
        (["good", "bad", "good"], 1),
        (["none"], 2),
        (["folder"], 2),
        (["good", "none"], 2),
        (["none", "bad"], 1),
    ],
)
def test_exit_status(
    names: list[str], code: int, files: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(files[name]) for name in names]) == code
    out, err = capsys.readouterr()
    assert out.count(": accepted: ") == names.count("good")
    assert out.count(": rejected: line ") == names.count("bad")
    assert err.count(": cannot be read: ") == len({"none", "folder"} & set(names))
    assert out.isascii()
    assert main(["--quiet", *(str(files[name]) for name in names)]) == code
    out, err = capsys.readouterr()
    assert out.count("\n") == names.count("bad")
    assert out.count(": rejected: line ") == names.count("bad")


@pytest.mark.parametrize("arguments", [[], ["--loud", "x"]])
def test_usage(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert stopped.value.code == 2
    assert "usage:" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "code", "word"), [("good", 0, "accepted"), ("bad", 1, "rejected")]
)
def test_runs_alone(
    name: str, code: int, word: str, files: dict[str, Path], tmp_path: Path
) -> None:
    """Isolated, in another folder, as a copy beside no package, to a terminal of ASCII."""
    copied = tmp_path / "alone.py"
    copied.write_bytes(SCRIPT.read_bytes())
    ended = subprocess.run(
        [sys.executable, "-I", "-X", "utf8=0", str(copied), str(files[name])],
        capture_output=True,
        cwd=tmp_path,
        env={"LC_ALL": "C", "PYTHONIOENCODING": "ascii"},
        check=False,
    )
    assert ended.returncode == code
    assert ended.stderr == b""
    assert word.encode() in ended.stdout


def test_imports_the_standard_library_only() -> None:
    tree = ast.parse(SCRIPT.read_text(encoding="utf-8"))
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            names.add((node.module or "").split(".")[0])
    assert names <= sys.stdlib_module_names
    assert not {"importlib", "runpy", "subprocess", "regrasp_lp"} & names
    called = {
        n.func.id
        for n in ast.walk(tree)
        if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)
    }
    assert not {"__import__", "exec", "eval", "open"} & called


def test_progress_goes_to_terminals_only(
    files: dict[str, Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main([str(files["good"])]) == 0
    assert capsys.readouterr().err == ""
    told: list[tuple[int, int]] = []
    path = files["good"].with_name("long.jsonl")
    content = lines("ell, chapter")
    path.write_bytes(writer.text(content))
    check(path, lambda done, total: told.append((done, total)))
    assert told == [] or told[0] == (1000, len(content) + 1)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert main([str(path)]) == 0


def test_orders_of_candidates_do_not_matter_to_cones() -> None:
    """The common cone of a centre and two others is the same in either order."""
    body = check_certificates.Body(CASES[RICH])
    for o, s, t in permutations(range(body.n), 3):
        one = check_certificates.common_cone(body, o, (s, t))
        other = check_certificates.common_cone(body, o, (t, s))
        assert (one is None) == (other is None)
        if one is not None and other is not None:
            for d, e in zip(one, other, strict=True):
                assert check_certificates.cross(d, e) == 0
