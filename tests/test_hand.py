"""The hand and its limits: as values, in files, in their verification, on the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry import rectangle
from hypothesis import given
from hypothesis import strategies as st
from test_verification import contact, document, place, release, slide

import regrasp_lp as rl
from regrasp_lp.cli import main
from regrasp_lp.errors import FileFormatError
from regrasp_lp.planning.verification import verify_document

FULL = rl.Hand(5, 30.0, 2.5, 0.5, {3: None, 0: [(20, 40), (2, 10)]})


# --- values -------------------------------------------------------------------------------------


def test_equal_limits_are_equal_hands() -> None:
    assert rl.Hand(4) == rl.Hand() == rl.Hand(4, None, 0, 0.0, {}) == rl.Hand(reachable=())
    assert rl.Hand(reachable={0: (1, 2)}) == rl.Hand(reachable=[(0, [(1.0, 2.0)])])
    assert rl.Hand(reachable={0: [(1, 2), (2, 3)]}) == rl.Hand(reachable={0: (1, 3)})
    assert rl.Hand(reachable={0: [(5, 6), (1, 4), (2, 3)]}) == rl.Hand(
        reachable={0: [(1, 4), (5, 6)]}
    )
    assert rl.Hand(reachable={3: None}) == rl.Hand(reachable={3: []}) != rl.Hand()
    assert len({rl.Hand(reachable={3: None}), rl.Hand(reachable={3: ()}), rl.Hand()}) == 2
    assert rl.Hand(edge_clearance=1) != rl.Hand(edge_clearance=2)


def test_what_is_kept() -> None:
    assert FULL.reachable == ((0, ((2.0, 10.0), (20.0, 40.0))), (3, ()))
    assert FULL.intervals == {0: ((2.0, 10.0), (20.0, 40.0)), 3: ()}
    assert (FULL.limited, FULL.spaced) == (True, True)
    assert [h.limited for h in (rl.Hand(), rl.Hand(7), rl.Hand(edge_clearance=1))] == [0, 0, 1]
    assert [rl.Hand(max_span=9).spaced, rl.Hand(reachable={1: None}).spaced] == [True, False]
    assert type(rl.Hand(edge_clearance=np.float32(0.5)).edge_clearance) is float


def test_repr() -> None:
    assert repr(rl.Hand()) == "Hand(fingers=4)"
    assert repr(rl.Hand(max_span=3)) == "Hand(fingers=4, max_span=3.0)"
    assert eval(repr(FULL), {"Hand": rl.Hand}) == FULL


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"max_span": 0}, "max_span must be a finite length larger than 0, got 0"),
        ({"max_span": "3"}, "max_span must be a finite length larger than 0, got '3'"),
        ({"edge_clearance": -1}, "edge_clearance must be a finite length of at least 0, got -1"),
        ({"edge_clearance": np.inf}, "edge_clearance must be a finite length"),
        ({"edge_clearance": True}, "edge_clearance must be a finite length"),
        ({"edge_clearance": None}, "edge_clearance must be a finite length"),
        ({"fingertip_separation": np.nan}, "fingertip_separation must be a finite length"),
        ({"max_span": 2, "fingertip_separation": 2}, "no two fingers could touch at once"),
        ({"reachable": 3}, "reachable must be a mapping from edges"),
        ({"reachable": [1, 2]}, "reachable must be a mapping from edges"),
        ({"reachable": {-1: None}}, "names edges by their numbers, from 0, not -1"),
        ({"reachable": {"a": None}}, "names edges by their numbers, from 0, not 'a'"),
        ({"reachable": {True: None}}, "names edges by their numbers"),
        ({"reachable": [(1, None), (1, None)]}, "names edge 1 twice"),
        ({"reachable": {0: (2, 1)}}, r"0 <= first < last, or several of them; got \[2, 1\]"),
        ({"reachable": {0: (1, 1)}}, "0 <= first < last"),
        ({"reachable": {0: (-1, 1)}}, "0 <= first < last"),
        ({"reachable": {0: [(0, 1), (2, np.inf)]}}, r"reachable\[0\] must be None, an interval"),
        ({"reachable": {0: 5}}, r"reachable\[0\] must be None, an interval"),
        ({"reachable": {0: (1, 2, 3)}}, r"reachable\[0\] must be None, an interval"),
    ],
)
def test_senseless_limits(limits: dict[str, Any], message: str) -> None:
    with pytest.raises(rl.HandError, match=message):
        rl.Hand(**limits)


lengths = st.floats(0, 100, allow_subnormal=False)


@given(
    st.integers(3, 9),
    st.none() | st.floats(101, 200),
    lengths,
    lengths,
    st.dictionaries(
        st.integers(0, 9),
        st.lists(st.tuples(lengths, st.floats(0.01, 9)).map(lambda p: (p[0], p[0] + p[1]))),
    ),
)
def test_documents_give_the_hand_again(
    fingers: int, span: float | None, clearance: float, separation: float, reachable: Any
) -> None:
    hand = rl.Hand(fingers, span, clearance, separation, reachable)
    text = json.dumps(hand.to_document())
    again = rl.Hand.from_document(json.loads(text))
    assert again == hand
    assert hash(again) == hash(hand)
    assert json.dumps(again.to_document()) == text
    for intervals in hand.intervals.values():
        ends = [end for interval in intervals for end in interval]
        assert ends == sorted(set(ends))


def test_documents_say_what_is_not_usual() -> None:
    assert rl.Hand(4).to_document() == {"fingers": 4}
    assert FULL.to_document() == {
        "fingers": 5,
        "max_span": 30.0,
        "edge_clearance": 2.5,
        "fingertip_separation": 0.5,
        "reachable": [
            {"edge": 0, "intervals": [[2.0, 10.0], [20.0, 40.0]]},
            {"edge": 3, "intervals": []},
        ],
    }
    with pytest.raises(rl.HandError, match="a hand has no reach"):
        rl.Hand.from_document({"fingers": 4, "reach": 3})


# --- verification, from the file alone ------------------------------------------------------------


def regrasp(**limits: Any) -> dict[str, Any]:
    """On a 4 by 2 block: slide down-left, place on the right, and take the first finger off."""
    plan = document(
        start=[contact(0, 0.5), contact(2, 0.5)],
        steps=[
            slide((1, 0, 0.5, 0.25), (2, 2, 0.5, 0.75)),
            place(3, 0, 0.75),
            release(1),
            slide((3, 0, 0.75, 0.375)),
        ],
        goal=[contact(0, 0.375), contact(2, 0.75)],
        friction=(1.5,),
    )
    plan["hand"].update(limits)
    return plan


def fault(**limits: Any) -> str:
    report = verify_document(regrasp(**limits))
    assert not report.ok
    return str(report.fault)


def only(edge: int, *intervals: list[float]) -> list[dict[str, Any]]:
    return [{"edge": edge, "intervals": list(intervals)}]


@pytest.mark.parametrize(
    "limits",
    [
        {},
        {"edge_clearance": 1.0},
        {"reachable": only(0, [1.0, 3.0])},
        {"reachable": only(1) + only(3)},
        {"max_span": 8.0**0.5 + 1e-15},  # the second place is 2 along and 2 across
        {"max_span": 100.0},
        {"fingertip_separation": 2.0},
        {"fingertip_separation": 2.0, "max_span": 2.9, "edge_clearance": 0.5},
    ],
)
def test_limits_that_hold(limits: dict[str, Any]) -> None:
    report = verify_document(regrasp(**limits))
    assert report.ok, report.fault
    assert report.slides_checked == 2


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        (
            {"edge_clearance": float(np.nextafter(1.0, 2))},
            "step 1 (slide fingers 1, 2): finger 1 at fraction 0.25 is nearer than edge_clearance "
            "= 1.0000000000000002 of the hand to an end of edge 0",
        ),
        ({"edge_clearance": 2.5}, "start: finger 1 at fraction 0.5 is nearer than edge_clearance"),
        (
            {"reachable": only(0)},
            "start: finger 1 at fraction 0.5 is on edge 0, which the hand may not touch",
        ),
        (
            {"reachable": only(0, [0.0, 2.5])},
            "step 2 (place finger 3): finger 3 at fraction 0.75 is on a part of edge 0 that the "
            "hand may not touch (reachable)",
        ),
        (
            {"reachable": only(0, [0.0, 2.125], [2.25, 4.0])},
            "step 4 (slide finger 3): finger 3 on edge 0 at fraction 0.75 passes over a part of "
            "edge 0 that the hand may not touch (reachable)",
        ),
        (
            {"max_span": 2.5},
            "step 2 (place finger 3): fingers 2 and 3 are 2.82842712 apart, more than max_span = "
            "2.5 of the hand",
        ),
        ({"max_span": 1.5}, "start: fingers 1 and 2 are 2 apart, more than max_span"),
        (
            {"fingertip_separation": 2.25},
            "start: fingers 1 and 2 are 2 apart, less than fingertip_separation = 2.25 of the hand",
        ),
    ],
)
def test_faults(limits: dict[str, Any], expected: str) -> None:
    assert fault(**limits).startswith(expected)


def test_limits_are_decided_exactly() -> None:
    """Beside the square root of 8, which is no double."""
    root = 8.0**0.5
    below, above = sorted((root, np.nextafter(root, 9 * (-1) ** (root**2 > 8))))
    assert below**2 < 8 < above**2 or root**2 != 8
    assert verify_document(regrasp(max_span=float(max(above, np.nextafter(root, 9))))).ok
    assert "more than max_span" in fault(max_span=float(min(below, np.nextafter(root, 0))))


def test_fingers_may_come_too_near_in_the_middle_of_a_slide() -> None:
    """Two fingers pass each other on opposite edges: far apart at both ends."""
    plan = document(
        start=[contact(0, 0.25), contact(2, 0.25)],  # x = 1 and x = 3
        steps=[slide((1, 0, 0.25, 0.75), (2, 2, 0.25, 0.75))],
        goal=[contact(0, 0.75), contact(2, 0.75)],
        friction=(2.0,),
    )
    plan["hand"]["fingertip_separation"] = 2.0
    assert verify_document(plan).ok
    plan["hand"]["fingertip_separation"] = 2.5
    report = verify_document(plan)
    assert report.fault == (
        "step 1 (slide fingers 1, 2): fingers 1 and 2 are 2 apart, less than fingertip_separation "
        "= 2.5 of the hand, at slide time t = 0.5"
    )


def test_a_goal_beyond_the_limits() -> None:
    plan = regrasp(reachable=only(0, [1.0, 3.0]))
    plan["goal"] = [contact(0, 0.125), contact(2, 0.75)]
    report = verify_document(plan)
    assert report.fault is not None
    assert report.fault.startswith("goal: a contact at fraction 0.125 is on a part of edge 0")


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"reach": 2}, "hand.reach: no limit of a hand"),
        ({"max_span": "far"}, "hand.max_span: expected a finite number"),
        ({"max_span": None}, "hand.max_span: expected a finite number"),
        ({"edge_clearance": -1.0}, "hand.edge_clearance: expected a length"),
        ({"reachable": {"0": []}}, "hand.reachable: expected a list"),
        ({"reachable": [{"edge": 0}]}, r"hand.reachable\[0\].intervals is missing"),
        ({"reachable": [{"intervals": []}]}, r"hand.reachable\[0\].edge is missing"),
        ({"reachable": only(0) + only(0)}, r"hand.reachable\[1\].edge: edge 0 is named twice"),
        ({"reachable": only(0, [1.0])}, r"hand.reachable\[0\].intervals\[0\]"),
        ({"reachable": only(0, [2.0, 1.0])}, "expected 0 <= first <= last"),
        ({"reachable": only(0, [-1.0, 1.0])}, "expected 0 <= first <= last"),
    ],
)
def test_damaged_limits(limits: dict[str, Any], message: str) -> None:
    with pytest.raises(FileFormatError, match=message):
        verify_document(regrasp(**limits))


# --- the command line ---------------------------------------------------------------------------


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "block.geojson"
    ring = [*rectangle().vertices.tolist(), rectangle().vertices[0].tolist()]
    file.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}), encoding="utf-8")
    graph = ["graph", str(file), "--friction", "0.5"]
    assert main(graph) == 0
    free = capsys.readouterr().out
    assert main([*graph, "--edge-clearance", "0.25", "--avoid-edges", "1,3"]) == 0
    limited = capsys.readouterr().out
    assert "two_finger" in limited
    expected = rl.build_switching_graph(
        rl.Polygon(rectangle().vertices),
        0.5,
        rl.Hand(edge_clearance=0.25, reachable={1: None, 3: None}),
    )
    assert str(expected.summary()).splitlines()[3:9] == limited.splitlines()[3:9]
    assert free.splitlines()[3:9] != limited.splitlines()[3:9]
    proof = str(tmp_path / "proof")
    assert main([*graph, "--edge-clearance", "1", "--certificates", proof]) == 2
    assert "not for a hand with limits" in capsys.readouterr().err
    assert main([*graph, "--avoid-edges", "9"]) == 2
    assert "names edge 9" in capsys.readouterr().err
    assert main([*graph, "--avoid-edges", "a"]) == 2
    assert "does not name edges" in capsys.readouterr().err
    assert main([*graph, "--max-span", "0"]) == 2
    assert "--max-span must be a finite length larger than 0" in capsys.readouterr().err
