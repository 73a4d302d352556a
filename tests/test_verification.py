"""Verification of plan documents: valid plans, every fault, and slides against dense sampling."""

from __future__ import annotations

import copy
import json
import re
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from wrench_oracle import closed

from regrasp_lp.errors import FileFormatError, FrictionError, PolygonError
from regrasp_lp.force_closure import is_force_closure
from regrasp_lp.planning.verification import Report, read_plan_document, verify_document
from regrasp_lp.polygon import Polygon

Document = dict[str, Any]
CORNERS = [[0, 0], [4, 0], [4, 2], [0, 2]]


def contact(edge: int, fraction: float, **more: Any) -> Document:
    return {"edge": edge, "fraction": fraction, **more}


def place(finger: int, edge: int, fraction: float) -> Document:
    return {"action": "place", "finger": finger, "edge": edge, "fraction": fraction}


def release(finger: int) -> Document:
    return {"action": "release", "finger": finger}


def slide(*moves: tuple[int, int, float, float]) -> Document:
    return {
        "action": "slide",
        "moves": [
            {"finger": finger, "edge": edge, "from": {"fraction": a}, "to": {"fraction": b}}
            for finger, edge, a, b in moves
        ],
    }


def document(
    start: list[Document],
    steps: list[Document],
    goal: list[Document],
    *,
    friction: Any = (0.75,),
    fingers: int = 4,
    exterior: Any = CORNERS,
) -> Document:
    return {
        "format": "regrasp-plan",
        "version": 1,
        "name": "test",
        "polygon": {"exterior": exterior, "holes": []},
        "friction": list(friction),
        "hand": {"fingers": fingers},
        "start": start,
        "goal": goal,
        "steps": steps,
    }


def valid() -> Document:
    """Bottom and top slide left together, right and left take over; finger 4 ends below."""
    return document(
        start=[contact(0, 0.5, finger=1, position=2.0), contact(2, 0.5, finger=3)],
        steps=[
            slide((1, 0, 0.5, 0.25), (3, 2, 0.5, 0.75)),
            place(2, 1, 0.5),
            place(4, 3, 0.5),
            release(1),
            release(3),
            slide((2, 1, 0.5, 0.625)),
            place(1, 0, 0.0),
        ],
        goal=[contact(3, 0.5), contact(0, 0), contact(1, 0.625)],
    )


def edited(*path_and_value: Any) -> Document:
    """Return the valid document with the entry at a path replaced."""
    *path, key, value = path_and_value
    result = copy.deepcopy(valid())
    item: Any = result
    for step in path:
        item = item[step]
    item[key] = value
    return result


def fault_of(doc: Document) -> str:
    report = verify_document(doc)
    assert not report
    assert report.fault is not None
    return report.fault


# --- valid plans --------------------------------------------------------------------------------


def test_a_valid_plan() -> None:
    report = verify_document(valid())
    assert report == Report(ok=True, fault=None, grasps_checked=8, slides_checked=2)
    assert bool(report)
    assert str(report) == "The plan is valid: 8 grasps and 2 slides checked, exactly."


def test_a_plan_without_steps_and_fingers_by_order() -> None:
    ends = [contact(0, 0.5), contact(2, 0.5)]
    assert verify_document(document(ends, [], ends[::-1]))
    moved = document(ends, [slide((2, 2, 0.5, 0.625))], [contact(2, 0.625), contact(0, 0.5)])
    assert verify_document(moved)


def test_positions_and_margins_are_not_looked_at() -> None:
    doc = edited("start", 0, "position", 77.0)
    doc["grasps"] = "nonsense"
    doc["margin"] = -1
    assert verify_document(doc)


def test_friction_of_each_edge() -> None:
    assert verify_document(edited("friction", [0.75, 0.1, 0.75, 0.1]))
    assert "step 6" in fault_of(edited("friction", [0.75, 0.01, 0.75, 0.01]))


def test_holes_count_on() -> None:
    """Edges of a hole follow those of the outline; two fingers spread against its walls."""
    doc = document(
        [contact(5, 0.5), contact(7, 0.5)],
        [slide((1, 5, 0.5, 0.25))],
        [contact(5, 0.25), contact(7, 0.5)],
    )
    doc["polygon"]["holes"] = [[[1, 0.5], [1, 1.5], [3, 1.5], [3, 0.5]]]
    assert verify_document(doc)


# --- faults -------------------------------------------------------------------------------------

FAULTS: list[tuple[Document, str]] = [
    (edited("friction", [0.05]), r"step 6 .* time t = 0\.8, .*edge 1 at fraction 0\.6"),
    (edited("start", 1, "fraction", 0.9), "start: no force closure with finger 1 on edge 0"),
    (edited("start", []), "start: no force closure with no finger"),
    (edited("start", 1, "finger", 1), "start: finger 1 on edge 0 at fraction 0.5 touches already"),
    (edited("start", 1, "finger", 5), "start: there is no finger 5; .* 1 to 4"),
    (edited("start", 1, "finger", 0), "there is no finger 0"),
    (edited("start", 1, contact(0, 0.5, finger=2)), "finger 2 would be at the same point"),
    (edited("start", 1, "edge", 4), "start: finger 3 on edge 4, but .* edges 0 to 3"),
    (edited("start", 1, "edge", -1), "edge -1"),
    (edited("start", 1, "fraction", 1.0000000000000002), r"off edge 2.*not in \[0, 1\]"),
    (edited("start", 1, "fraction", -5e-324), "off edge 2"),
    (edited("hand", "fingers", 1), "start: 2 contacts, more than the hand has"),
    (edited("hand", "fingers", 3), r"step 3 \(place finger 4\): there is no finger 4"),
    (edited("steps", 1, "finger", 3), r"step 2 \(place finger 3\): finger 3 on edge 2 .* already"),
    (edited("steps", 1, place(2, 0, 0.25)), "step 2 .* same point as finger 1 on edge 0"),
    (edited("steps", 1, place(2, 1, 1.5)), "step 2 .* off edge 1"),
    (edited("steps", 6, place(1, 9, 0.5)), "step 7 .* on edge 9"),
    (edited("steps", 3, release(7)), "step 4 .* no finger 7"),
    (edited("steps", 4, release(1)), r"step 5 \(release finger 1\): finger 1 is free already"),
    (edited("steps", 2, release(3)), "step 3 .*: no force closure with finger 1 .*, finger 2 on"),
    (edited("steps", 0, slide((2, 0, 0.5, 0.25))), "finger 2 is free and cannot slide"),
    (edited("steps", 0, slide((9, 0, 0.5, 0.25))), "no finger 9"),
    (edited("steps", 0, slide((1, 0, 0.5, 0.4), (1, 0, 0.5, 0.4))), "moved twice"),
    (edited("steps", 0, slide((1, 1, 0.5, 0.25))), "from edge 1 to edge 1; a slide stays"),
    (edited("steps", 0, "moves", 0, "to", contact(1, 0.5)), "from edge 0 to edge 1; a slide"),
    (edited("steps", 0, "moves", 0, "from", contact(1, 0.5)), "from edge 1 to edge 0; a slide"),
    (
        edited("steps", 0, slide((1, 0, 0.5000000000000001, 0.25))),
        "from fraction 0.5000000000000001, where it is not",
    ),
    (edited("steps", 0, slide((1, 0, 0.5, -0.25))), "step 1 .* finger 1 off edge 0"),
    (
        edited("steps", 0, slide((1, 0, 0.5, 0.0))),
        r"step 1 \(slide finger 1\): force closure is lost at slide time t = 0\.75, with finger 1 "
        r"on edge 0 at fraction 0\.125, finger 3 on edge 2 at fraction 0\.5",
    ),
    (edited("goal", 0, "fraction", 0.25), "no finger on edge 3 at fraction 0.25, finger 4 on edge"),
    (edited("goal", 0, "edge", 7), "goal: a contact on edge 7"),
    (edited("goal", 0, "fraction", 2), "goal: a contact off edge 3"),
    (
        edited("goal", [contact(3, 0.5), contact(1, 0.625)]),
        "reached: finger 1 .* is not in the goa",
    ),
    (edited("goal", [*valid()["goal"], contact(2, 0.5)]), "reached: no finger on edge 2"),
    (edited("goal", [*valid()["goal"], contact(3, 0.5)]), "reached: no finger on edge 3"),
]


@pytest.mark.parametrize(("doc", "message"), FAULTS, ids=range(len(FAULTS)))
def test_every_fault_is_found(doc: Document, message: str) -> None:
    assert re.search(message, fault_of(doc)), fault_of(doc)


def test_a_report_tells_what_was_checked_before() -> None:
    report = verify_document(edited("steps", 4, release(1)))
    assert (report.ok, report.grasps_checked, report.slides_checked) == (False, 5, 1)
    assert str(report).startswith("The plan is not valid: step 5 (release finger 1)")
    assert str(report).endswith("(5 grasps and 1 slide checked before.)")


PAIR = [contact(0, 0.5), contact(2, 0.5)]


@pytest.mark.parametrize(
    ("third", "moves", "message"),
    [
        (contact(0, 0.75), [(1, 0, 0.5, 0.75)], "1 and 3 come to one point at slide time t = 1"),
        (contact(0, 0.625), [(1, 0, 0.5, 0.75)], "1 and 3 pass each other .* t = 0.5, on edge 0"),
        (
            contact(0, 0.75),
            [(1, 0, 0.5, 0.75), (3, 0, 0.75, 0.5)],
            "1 and 3 pass each other at slide time t = 0.5",
        ),
        (contact(1, 0.0), [(1, 0, 0.5, 1.0)], "come to one point .* two edges that meet there"),
        (
            contact(1, 0.25),
            [(1, 0, 0.5, 1.0), (3, 1, 0.25, 0.0)],
            "fingers 1 and 3 come to one point at slide time t = 1, on two edges",
        ),
    ],
)
def test_meeting_fingers(third: Document, moves: list, message: str) -> None:
    doc = document([*PAIR, third], [slide(*moves)], [], friction=[3.0])
    assert re.search(message, fault_of(doc)), fault_of(doc)


def test_fingers_at_one_vertex_on_two_edges() -> None:
    doc = document([*PAIR, contact(1, 0.0)], [place(4, 0, 1.0)], [])
    assert "step 1 (place finger 4): finger 4 would be at the same point as finger 3" in fault_of(
        doc
    )
    assert "finger 2 would be at the same point" in fault_of(
        document([contact(0, 1.0), contact(1, 0.0)], [], [])
    )


def test_following_fingers_do_not_meet() -> None:
    moves = [(1, 0, 0.5, 0.625), (3, 0, 0.625, 0.75)]
    goal = [contact(2, 0.5), contact(0, 0.625), contact(0, 0.75)]
    assert verify_document(document([*PAIR, contact(0, 0.625)], [slide(*moves)], goal))


# --- slides -------------------------------------------------------------------------------------


def sampled_times(lost: Fraction | None) -> list[Fraction]:
    times = {Fraction(k, 32) for k in range(33)}
    if lost is not None:
        times |= {lost, lost - Fraction(1, 2**40), lost * (1 - Fraction(1, 2**20))}
    return sorted(t for t in times if 0 <= t <= 1)


def loss_time(monkeypatch: pytest.MonkeyPatch) -> list[Fraction | None]:
    """Record what the verification finds, exactly; reports round it."""
    from regrasp_lp.planning import verification

    found: list[Fraction | None] = []
    original = verification.first_loss

    def recording(*args: Any) -> Fraction | None:
        found.append(original(*args))
        return found[-1]

    monkeypatch.setattr(verification, "first_loss", recording)
    return found


def random_slides(
    rng: np.random.Generator, polygon: Polygon, mu: float, m: int, count: int, lattice: bool
) -> list[tuple[list[int], list[float], list[float]]]:
    """Return slides between grasps on distinct edges, both of them in force closure."""
    slides: list[tuple[list[int], list[float], list[float]]] = []
    while len(slides) < count:
        edges = np.array([rng.permutation(polygon.n_edges)[:m] for _ in range(400)])
        ends = [rng.integers(1, 8, (400, m)) / 8 if lattice else rng.random((400, m)) for _ in "ab"]
        good = np.logical_and(
            *(is_force_closure(polygon, friction=mu, edges=edges, fractions=f) for f in ends)
        )
        for row in np.flatnonzero(good)[: count - len(slides)]:
            slides.append((edges[row].tolist(), ends[0][row].tolist(), ends[1][row].tolist()))
    return slides


def slide_document(
    polygon: Polygon, mu: float, edges: list[int], a: list[float], b: list[float]
) -> Document:
    return document(
        [contact(*item) for item in zip(edges, a, strict=True)],
        [slide(*zip(range(1, len(edges) + 1), edges, a, b, strict=True))],
        [contact(*item) for item in zip(edges, b, strict=True)],
        friction=[mu],
        fingers=6,
        exterior=polygon.exterior.tolist(),
    )


HEXAGON = Polygon([(0, 0), (3, -1), (6, 0), (5, 4), (2, 5), (-1, 3)])


@pytest.mark.parametrize(("m", "lattice"), [(2, True), (3, True), (3, False), (4, False)])
def test_slides_agree_with_dense_exact_sampling(
    m: int, lattice: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = loss_time(monkeypatch)
    rng = np.random.default_rng(m + lattice)
    for edges, a, b in random_slides(rng, HEXAGON, 0.25, m, 16 - 3 * m, lattice):
        report = verify_document(slide_document(HEXAGON, 0.25, edges, a, b))
        lost = found.pop()
        assert report.ok == (lost is None)
        for t in sampled_times(lost):
            at = [(1 - t) * Fraction(x) + t * Fraction(y) for x, y in zip(a, b, strict=True)]
            holds = closed(HEXAGON, 0.25, list(zip(edges, at, strict=True)))
            if lost is None or t < lost:
                assert holds
            elif t == lost:
                assert not holds


def touching_slides() -> list[tuple[list[int], list[float], list[float]]]:
    """Slides on a lattice that lose force closure at t = 1/2 and, as sampled, nowhere else."""
    rng = np.random.default_rng(1)
    n = 60_000
    edges = rng.integers(0, 4, (n, 3))
    middle = rng.integers(2, 7, (n, 3)) / 8
    step = rng.integers(-2, 3, (n, 3)) / 8
    good = np.array([len(set(row)) == 3 for row in edges.tolist()])
    rectangle = Polygon(CORNERS)
    for part in (-1.0, -0.5, -(2.0**-12), 0.0, 2.0**-12, 0.5, 1.0):
        verdict = is_force_closure(
            rectangle, friction=0.5, edges=edges, fractions=middle + part * step
        )
        good &= verdict == (part != 0)
    rows = np.flatnonzero(good)
    return [
        (edges[r].tolist(), (middle - step)[r].tolist(), (middle + step)[r].tolist()) for r in rows
    ]


def test_a_loss_at_one_instant_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    found = loss_time(monkeypatch)
    slides = touching_slides()
    assert len(slides) > 10
    for edges, a, b in slides[:25]:
        fault = fault_of(slide_document(Polygon(CORNERS), 0.5, edges, a, b))
        assert "force closure is lost at slide time t = 0.5" in fault
        assert found.pop() == Fraction(1, 2)


def test_a_loss_for_a_tiny_while_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """Moving one end by 2^-45 turns the instant into a tiny interval, or into none at all."""
    found = loss_time(monkeypatch)
    outcomes = []
    inside = [item for item in touching_slides() if 0 < item[1][0] < 1]
    for edges, a, b in inside[:12]:
        for sign in (-1, 1):
            moved = [a[0] + sign * 2.0**-45, *a[1:]]
            verify_document(slide_document(Polygon(CORNERS), 0.5, edges, moved, b))
            lost = found.pop()
            outcomes.append(lost is None)
            if lost is not None:
                assert abs(lost - Fraction(1, 2)) < Fraction(1, 2**35)
                for t in (lost, lost + Fraction(1, 2**30)):
                    at = [
                        (edge, (1 - t) * Fraction(x) + t * Fraction(y))
                        for edge, x, y in zip(edges, moved, b, strict=True)
                    ]
                    assert closed(Polygon(CORNERS), 0.5, at) == (t > lost)
    assert len(set(outcomes)) == 2


def test_slides_are_decided_fast() -> None:
    """Milliseconds, with room for a busy machine."""
    rng = np.random.default_rng(9)
    for m, most in ((3, 0.1), (6, 0.5)):
        edges, a, b = random_slides(rng, HEXAGON, 0.5, m, 1, lattice=False)[0]
        doc = slide_document(HEXAGON, 0.5, edges, a, b)
        seconds = []
        for _ in range(3):
            started = time.process_time()
            verify_document(doc)
            seconds.append(time.process_time() - started)
        assert min(seconds) < most


# --- the document -------------------------------------------------------------------------------

MALFORMED: list[tuple[Any, str]] = [
    ([], "the document: expected an object"),
    (edited("format", "regrasp-graph"), "found format 'regrasp-graph' version 1"),
    (edited("version", 2), "version 1, found .* version 2"),
    (edited("version", True), "found .* version True"),
    (edited("polygon", None), "polygon: expected an object, found None"),
    (edited("polygon", {}), r"polygon\.exterior is missing"),
    (edited("polygon", "exterior", 0, [0, 0, 0]), r"exterior\[0\]: expected two coordinates"),
    (edited("polygon", "exterior", 0, [0, "x"]), r"exterior\[0\]\[1\]: expected a finite number"),
    (edited("polygon", "holes", [3]), r"polygon\.holes\[0\]: expected a list"),
    (edited("polygon", "exterior", CORNERS[::-1]), r"polygon\.exterior: rings have to be"),
    (edited("friction", 0.75), "friction: expected a list"),
    (edited("friction", [True]), r"friction\[0\]: expected a finite number, found True"),
    (edited("hand", {}), r"hand\.fingers is missing"),
    (edited("hand", "fingers", 4.0), r"hand\.fingers: expected an integer, found 4\.0"),
    (edited("start", "abc"), "start: expected a list, found 'abc'"),
    (edited("start", 0, {"fraction": 0.5}), r"start\[0\]\.edge is missing"),
    (edited("start", 0, "finger", None), r"start\[0\]\.finger: expected an integer"),
    (edited("start", 0, "fraction", float("nan")), r"start\[0\]\.fraction: .* found nan"),
    (edited("start", 0, "fraction", 10**400), r"fraction: .* an integer of 1329 bits"),
    (edited("start", 0, "edge", True), r"start\[0\]\.edge: expected an integer, found True"),
    (edited("goal", 1, "fraction", "0.5" * 50), r"goal\[1\]\.fraction: .*\.\.\."),
    (edited("steps", 3, {}), r"steps\[3\]\.action is missing"),
    (edited("steps", 3, {"action": "jump"}), r"steps\[3\]\.action: .* found 'jump'"),
    (edited("steps", 3, {"action": "release"}), r"steps\[3\]\.finger is missing"),
    (edited("steps", 0, "moves", []), r"steps\[0\]\.moves: a slide moves at least one"),
    (edited("steps", 0, "moves", 0, "from", 0.5), r"steps\[0\]\.moves\[0\]\.from: expected an o"),
    (edited("steps", 0, "moves", 0, "to", {}), r"moves\[0\]\.to\.fraction is missing"),
]


@pytest.mark.parametrize(("doc", "message"), MALFORMED, ids=range(len(MALFORMED)))
def test_a_malformed_document_is_refused_with_the_place(doc: Any, message: str) -> None:
    with pytest.raises(FileFormatError, match=message):
        verify_document(doc)


def test_impossible_polygons_and_friction_are_refused() -> None:
    with pytest.raises(PolygonError):
        verify_document(edited("polygon", "exterior", [[0, 0], [4, 2], [4, 0], [0, 2]]))
    with pytest.raises(FrictionError):
        verify_document(edited("friction", [0.5, 0.5]))
    with pytest.raises(FrictionError):
        verify_document(edited("friction", [-0.5]))
    closed_ring = edited("polygon", "exterior", [*CORNERS, CORNERS[0]])
    with pytest.raises((FileFormatError, PolygonError)):
        verify_document(closed_ring)


def test_reading_a_file(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(valid()), encoding="utf-8")
    assert read_plan_document(path) == valid()
    assert verify_document(read_plan_document(str(path)))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is no JSON text"),
        (b'{"format": "regrasp-plan", "vers', "is no JSON text"),
        (b"\xff\xfe", "is no JSON text"),
        (b"[" * 100_000, "is no JSON text"),
        (b"[]", "plan.json: the document: expected an object"),
        (b"{}", 'has "format": "regrasp-plan", but other JSON'),
        (b'{"format": "regrasp-plan", "version": 3}', "version 3"),
        (b'{"format": "regrasp-plan", "version": 1}', "polygon is missing"),
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "plan.json"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=message):
        read_plan_document(path)
