"""Drawings that are damaged, or made to use up time and memory: polygons, or an error of ours.

What would take minutes here where a guard is missing is a text of some thousand characters, or a
number without bound; each of these tests is a matter of milliseconds with it.
"""

from __future__ import annotations

import logging
import math
import random
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from ezdxf.layouts import Modelspace

import regrasp_lp as rl
from regrasp_lp.outlines.curves import MOST_POINTS, Bezier, EllipticArc, polyline
from regrasp_lp.outlines.drawing import MOST_PIECES, Expansion, Piece, Reading, outlines
from regrasp_lp.outlines.svg_elements import parse_elements
from regrasp_lp.outlines.svg_shapes import numbers_in
from regrasp_lp.ring_checks import conflicts, first_conflict, nesting

HEAD = '<svg xmlns="http://www.w3.org/2000/svg">'


def refusal(path: Path, data: str | bytes, **options: object) -> str:
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    with pytest.raises(rl.FileFormatError) as caught:
        rl.read_polygons(path, **options)
    return str(caught.value).removeprefix(f"{path}: ")


def read(path: Path, data: str | bytes, **options: object) -> list[rl.Polygon]:
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return rl.read_polygons(path, **options)


# --- SVG ----------------------------------------------------------------------------------------


def test_no_list_of_numbers_however_long_it_is(tmp_path: Path) -> None:
    element = parse_elements(f"{HEAD}</svg>".encode())
    for text in ("1" * 10_000 + "x", "1 2 3 " * 10_000 + "y", "1e" * 10_000, "," * 10_000 + "z"):
        with pytest.raises(rl.FileFormatError, match="no list of numbers") as caught:
            numbers_in(text, element, "points")
        assert len(str(caught.value)) < 120
    assert numbers_in("1-2.5.5e1,+3 ,4.\n-.5E-1", element, "points") == [1, -2.5, 5, 3, 4, -0.05]
    assert numbers_in(" , ", element, "points") == []
    for text in ("1 e 2", "1 - 2", "1 2;3", "1e400 2", "nan", "1\N{NO-BREAK SPACE}2"):
        with pytest.raises(rl.FileFormatError, match="no list of numbers"):
            numbers_in(text, element, "points")


@pytest.mark.parametrize("text", ["1" * 10_000 + "!", "1" + " " * 10_000 + "!", "1e999", "1 %%"])
def test_no_length_however_long_it_is(tmp_path: Path, text: str) -> None:
    message = refusal(tmp_path / "a.svg", f'{HEAD}<circle r="{text}"/></svg>')
    assert "is no length in px, pt" in message
    assert len(message) < 150


def test_long_texts_are_read_at_once(tmp_path: Path) -> None:
    lines = "a line\n<b/>" * 40_000
    texts = f"<desc>{lines}</desc><style>{'a line ' * 40_000}</style>"
    (disc,) = read(tmp_path / "a.svg", f'{HEAD}{texts}<circle r="1"/></svg>')
    assert disc.n_edges > 4
    # a style sheet in many parts is still one text
    split = "<style>.a { dis<![CDATA[play]]>: none }</style>"
    assert "sets 'display'" in refusal(tmp_path / "a.svg", f"{HEAD}{split}</svg>")


def test_entities_that_could_blow_up_are_refused(tmp_path: Path) -> None:
    def declared(entities: str) -> str:
        return f'<!DOCTYPE svg [{entities}]>{HEAD}<desc>&b;</desc><circle r="1"/></svg>'

    laughs = '<!ENTITY a "ha">' + '<!ENTITY b "' + "&a;" * 10 + '">'
    for entities in (
        laughs,
        laughs.replace("&", "&#38;"),
        f'<!ENTITY b "{"x" * 1000}">',
        '<!ENTITY b SYSTEM "elsewhere.txt">',
        '<!ENTITY % b "x">',
    ):
        message = refusal(tmp_path / "a.svg", declared(entities))
        assert message.startswith("declares the entity 'b' in line 1")
    assert len(read(tmp_path / "a.svg", declared('<!ENTITY b "a short name">'))) == 1


def test_uses_of_uses_have_an_end(tmp_path: Path) -> None:
    for leaf in ('<circle id="n0" r="1"/>', '<g id="n0"/>'):  # the second draws nothing at all
        doubled = "".join(
            f'<g id="n{k + 1}"><use href="#n{k}"/><use href="#n{k}"/></g>' for k in range(40)
        )
        data = f'{HEAD}<defs>{leaf}{doubled}</defs><use href="#n40"/></svg>'
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("regrasp_lp.outlines.drawing.MOST_PIECES", 2000)
            message = refusal(tmp_path / "a.svg", data)
        assert message.startswith("is a drawing of more than 2,000 entities")
        assert "draw the object alone" in message


def test_entities_are_counted() -> None:
    count = Expansion()
    count.add("one", MOST_PIECES)
    with pytest.raises(rl.FileFormatError, match=r"100,000 entities.* \(this one is in two\)"):
        count.add("two")


def test_arcs_of_hardly_any_radius(tmp_path: Path) -> None:
    for radii in ("5e-324 5e-324", "1e-310 3", "3 1e-320"):
        data = f'{HEAD}<path id="p" d="M0 0 A {radii} 0 0 1 4 0 V 9 z"/></svg>'
        message = refusal(tmp_path / "a.svg", data)
        assert message.startswith("<path> (id 'p', line 1)")
        assert "the radii of an arc are too small" in message


@pytest.mark.parametrize(
    "shape",
    [
        '<path id="p" d="M0 0 L1e400 0 1 1z"/>',
        '<path id="p" d="M0 0 L1e200 0 1 1z"/>',
        '<circle id="p" r="1" transform="scale(1e300) scale(1e300)"/>',
    ],
)
def test_coordinates_without_bound_are_named(tmp_path: Path, shape: str) -> None:
    message = refusal(tmp_path / "a.svg", f"{HEAD}{shape}</svg>")
    assert "(id 'p', line 1) has coordinates that are no numbers" in message


# --- curves and joining -------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [1e-13, 1e-200, 5e-324])
def test_no_curve_gets_points_without_end(tolerance: float) -> None:
    bend = np.array([[0.0, 0], [1, 2], [2, 0], [5, 5]])
    whole = EllipticArc(np.zeros(2), np.array([1.0, 0]), np.array([0, 1.0]), 0, 2 * math.pi)
    for curve in (Bezier(bend), Bezier(bend, np.array([1.0, 2, 1, 3])), whole):
        with pytest.raises(rl.FileFormatError, match=r"100,000 edges .*\(flattening=\.\.\.\)"):
            curve.flattened(tolerance)


def test_no_drawing_gets_points_without_end(tmp_path: Path) -> None:
    discs = "".join(f'<circle r="1" cx="{3 * k}"/>' for k in range(40))
    message = refusal(tmp_path / "a.svg", f"{HEAD}{discs}</svg>", flattening=1e-7)
    n = math.pi / math.acos(1 - 1e-7)
    assert n < MOST_POINTS < 40 * n
    assert "has too many curves or points" in message


def test_many_ends_in_one_place_are_counted_and_some_named() -> None:
    star = [
        Piece(f"ray {k}", None, tuple(polyline([(0, 0), (math.cos(k), math.sin(k))])), False)
        for k in range(3000)
    ]
    with pytest.raises(rl.FileFormatError, match=r"3000 ends meet at \(0, 0\)") as caught:
        outlines(star, Reading())
    assert "ray 7; and more: outlines do not branch" in str(caught.value)


def test_the_smallest_of_many_gaps_is_named() -> None:
    rng = np.random.default_rng(3)
    starts, step = rng.uniform(0, 100, (1500, 2)), np.array([0.2, 0.1])
    sticks = [
        Piece(f"stick {k}", None, tuple(polyline([p, p + step])), False)
        for k, p in enumerate(starts)
    ]
    ends = np.concatenate([starts, starts + step])
    gaps = np.hypot(*(ends[:, None] - ends).transpose(2, 0, 1))
    np.fill_diagonal(gaps, np.inf)
    with pytest.raises(rl.FileFormatError, match=rf", {gaps.min():.3g} from \("):
        outlines(sticks, Reading())


# --- DXF ----------------------------------------------------------------------------------------


def draw(space: Modelspace) -> None:
    part = space.doc.blocks.new("PART")
    part.add_lwpolyline([(0, 0, 0.3), (4, 0, 0), (4, 3, 0)], "xyb", close=True)
    space.doc.blocks.new("OUTER").add_blockref("PART", (1, 1), {"rotation": 30})
    space.add_circle((20, 0), 1)
    space.add_ellipse((30, 0), (3, 1, 0), 0.5)
    space.add_arc((50, 0), 2, -90, 90)
    space.add_line((50, 2), (50, -2))
    space.add_polyline2d([(60, 0), (64, 0), (60, 3)], close=True)
    corners = [(71, 0), (71, 1), (69, 1), (69, -1), (71, -1), (71, 0)]
    space.add_spline().apply_construction_tool(ezdxf.math.BSpline(corners, 4))
    space.add_blockref("OUTER", (80, 0))
    grid = {"row_count": 2, "column_count": 2, "row_spacing": 9, "column_spacing": 9}
    space.add_blockref("PART", (100, 0), grid)


def drawing(folder: Path, version: str = "R2000", form: str = "asc") -> bytes:
    document = ezdxf.new(version)
    draw(document.modelspace())
    path = folder / "sample.dxf"
    document.saveas(path, fmt=form)
    return path.read_bytes()


JUNK = b"nan inf -1 0 1e400 99999999999999999999 x AcDb ENDSEC EOF INSERT 1000000 1e-320".split()


def mutated(rng: random.Random, lines: list[bytes], first: int) -> bytes:
    """Replace, remove or repeat pairs of lines, a code and its value, and flip bytes."""
    lines = list(lines)
    for _ in range(rng.randint(1, 3)):
        k, how = rng.randrange(first, len(lines) - 2) // 2 * 2, rng.randrange(8)
        if how < 4:
            lines[k + 1] = rng.choice(JUNK)
        elif how == 4:
            del lines[k : k + 2]
        elif how == 5:
            other = rng.randrange(len(lines) - 2) // 2 * 2
            lines[k:k] = lines[other : other + 2]
        elif how == 6:
            del lines[k : k + 2 * rng.randint(1, 20)]
        else:
            raw = bytearray(lines[k + 1] or b"0")
            raw[rng.randrange(len(raw))] = rng.randrange(256)
            lines[k + 1] = bytes(raw)
    return b"\n".join(lines)


@pytest.mark.parametrize(
    ("count", "seed"), [(150, 1), pytest.param(5000, 2, marks=pytest.mark.slow)]
)
def test_whatever_is_done_to_a_file_it_is_read_or_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], count: int, seed: int
) -> None:
    lines = drawing(tmp_path).replace(b"\r", b"").split(b"\n")
    first = lines.index(b"BLOCKS")  # what is before is mostly of no use to us
    rng, seen = random.Random(seed), {"read": 0, "refused": 0, "an entity is named": 0}
    path = tmp_path / "part.dxf"
    for k in range(count):
        path.write_bytes(mutated(rng, lines, rng.choice([0, first, first])))
        try:
            seen["read"] += len(rl.read_polygons(path, flattening=0.1)) > 0
        except rl.FileFormatError as error:
            seen["refused"] += 1
            seen["an entity is named"] += "handle" in str(error)
        except Exception as error:
            raise AssertionError(f"mutation {k}") from error
    assert min(seen.values()) > 0.01 * count, seen
    assert "".join(capfd.readouterr()) == ""


@pytest.mark.parametrize("count", [60, pytest.param(2000, marks=pytest.mark.slow)])
def test_whatever_is_done_to_a_binary_file(tmp_path: Path, count: int) -> None:
    data, rng, read = drawing(tmp_path, form="bin"), random.Random(3), 0
    path = tmp_path / "part.dxf"
    for k in range(count):
        raw = bytearray(data)
        for _ in range(rng.randint(1, 4)):
            raw[rng.randrange(22, len(raw))] = rng.randrange(256)
        path.write_bytes(raw)
        try:
            read += len(rl.read_polygons(path, flattening=0.1)) > 0
        except rl.FileFormatError:
            pass
        except Exception as error:
            raise AssertionError(f"mutation {k}") from error
    assert 0 < read < count


def entity(kind: str, *pairs: tuple[int, object]) -> str:
    body = [(0, "SECTION"), (2, "ENTITIES"), (0, kind), (8, "0"), *pairs, (0, "ENDSEC"), (0, "EOF")]
    return "".join(f"{code:3}\n{value}\n" for code, value in body)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (entity("CIRCLE", (10, 0), (20, 0), (40, "nan")), "coordinates that are no numbers"),
        (entity("CIRCLE", (10, 0), (20, 0)), "is damaged: it has no radius"),
        (entity("ARC", (10, 0), (20, 0), (40, 1), (50, 0)), "is damaged: it has no end angle"),
        (entity("ARC", (10, 0), (20, 0), (40, 1), (50, 0), (51, "inf")), "angles are no numbers"),
        (entity("LINE", (10, 0), (20, 0)), "is damaged: it has no end"),
        (entity("LINE", (10, 0), (20, 0), (11, "1e999"), (21, 0)), "coordinates that are no"),
    ],
)
def test_entities_that_say_nonsense_are_named(tmp_path: Path, data: str, message: str) -> None:
    found = refusal(tmp_path / "a.dxf", data)
    assert found.startswith(f"{data.split()[5]} (")
    assert message in found


def test_kinds_that_nobody_knows_have_their_layer(tmp_path: Path) -> None:
    text = drawing(tmp_path).decode().replace("\r", "")
    unknown = text.replace("\nELLIPSE\n", "\nWIDGET\n")
    message = refusal(tmp_path / "a.dxf", unknown)
    assert message.startswith("WIDGET (handle")
    assert "layer '0') is no outline" in message
    assert len(read(tmp_path / "a.dxf", unknown, ignore=["WIDGET"])) == 9


def test_arrays_of_blocks_have_an_end(tmp_path: Path) -> None:
    document = ezdxf.new()
    document.blocks.new("EMPTY")
    grid = {"row_count": 3000, "column_count": 3000, "row_spacing": 9, "column_spacing": 9}
    document.modelspace().add_blockref("EMPTY", (0, 0), grid)
    document.saveas(tmp_path / "a.dxf")
    message = refusal(tmp_path / "a.dxf", (tmp_path / "a.dxf").read_bytes())
    assert "more than 100,000 entities" in message
    assert "INSERT (handle" in message


def test_the_log_of_ezdxf_goes_where_somebody_wants_it(tmp_path: Path) -> None:
    log = logging.getLogger("ezdxf")
    before = list(log.handlers)
    read(tmp_path / "a.dxf", drawing(tmp_path))
    assert log.handlers == before


# --- rings --------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(20))
def test_rings_are_compared_in_blocks_of_any_size(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(seed)
    centers = rng.permutation(np.stack(np.meshgrid(range(4), range(4)), axis=-1).reshape(-1, 2))
    turn = np.arange(9) * 2 * np.pi / 9
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    apart = [c + size * ring for c in centers for size in (0.1, 0.2, 0.4)]
    mixed = [c + rng.uniform(0.2, 0.7) * ring for c in centers]
    rounded = [np.round(r * 8) / 8 for r in mixed]  # with common points, and edges on one line
    whole = [conflicts(apart), conflicts(mixed), conflicts(rounded)]
    inside = nesting(apart)
    assert whole[0] == []
    assert inside.sum() == 3 * 16
    assert min(map(len, whole[1:])) > 0
    monkeypatch.setattr("regrasp_lp.ring_checks._ROWS", 1 + seed)
    monkeypatch.setattr("regrasp_lp.ring_checks._BLOCK", 300 * (1 + seed))
    assert [conflicts(apart), conflicts(mixed), conflicts(rounded)] == whole
    assert (nesting(apart) == inside).all()
    assert first_conflict(apart) is None
    assert first_conflict(mixed) == whole[1][0]
