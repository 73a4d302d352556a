"""How objects show themselves in notebooks, and the animation of a plan."""

from __future__ import annotations

import io
import itertools
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import nbformat
import numpy as np
import pytest
from conftest import REPOSITORY, star_polygon
from IPython.core.formatters import DisplayFormatter
from nbclient import NotebookClient
from PIL import Image
from scipy.optimize import linprog

import regrasp_lp as rl
from regrasp_lp.plotting import palette, plan_gif

FRICTION = 0.3


@pytest.fixture(scope="module")
def bracket() -> rl.SwitchingGraph:
    polygons = {p.name: p for p in rl.read_polygons(REPOSITORY / "models" / "workpieces.geojson")}
    return rl.build_switching_graph(polygons["l_bracket"], FRICTION)


@pytest.fixture(scope="module")
def plan(bracket: rl.SwitchingGraph) -> rl.Plan:
    """A plan with a slide."""
    found = bracket.plan(bracket.sets[0].witness, bracket.sets[len(bracket) - 1].witness)
    assert any(isinstance(step, rl.Slide) for step in found.steps)
    return found


def test_pictures_are_svg_and_always_the_same(bracket: rl.SwitchingGraph) -> None:
    for thing in (bracket.polygon, bracket.sets[3]):
        text = thing._repr_svg_()
        assert text is not None
        assert ElementTree.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
        assert text == thing._repr_svg_()


def test_a_grasp_is_a_table_of_its_contacts(bracket: rl.SwitchingGraph) -> None:
    resolved = bracket.sets[0].witness
    rows = ElementTree.fromstring(resolved._repr_html_()).findall(".//tbody/tr")
    cells = [[cell.text for cell in row] for row in rows]
    for (number, edge, position, fraction), (k, contact) in zip(
        cells, enumerate(resolved, 1), strict=True
    ):
        assert (number, edge) == (str(k), str(contact.edge))
        assert float(position or "nan") == pytest.approx(contact.position, rel=1e-5)
        assert float(fraction or "nan") == pytest.approx(contact.fraction, rel=1e-5)
    assert "<td" in rl.Grasp([(4, 0.5)])._repr_html_()


def test_a_plan_shows_its_steps_account_and_page(plan: rl.Plan) -> None:
    shown = plan._repr_html_()
    assert shown.count("<svg") == 1
    assert "Regrasp of l_bracket" in shown
    assert re.search(r"<iframe[^>]* srcdoc=\"&lt;!doctype html", shown, re.IGNORECASE)
    # the page runs its script, and can reach nothing of the notebook around it
    assert re.search(r"<iframe[^>]* sandbox='allow-scripts' ", shown)


def test_names_cannot_break_out_of_the_page() -> None:
    name = "</pre><script>alert(1)</script>"
    block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], name=name)
    graph = rl.build_switching_graph(block, 0.4)
    found = graph.plan([(0, 3.0), (2, 3.0)], [(1, 1.5), (3, 1.5)])
    for shown in (found._repr_html_(), graph._repr_html_(), block._repr_svg_()):
        assert shown is not None
        assert "<script>alert" not in shown


def test_a_graph_shows_its_counts_and_a_picture(bracket: rl.SwitchingGraph) -> None:
    shown, summary = bracket._repr_html_(), bracket.summary()
    for counts in summary.kinds.values():
        assert f">{counts.sets}</td>" in shown
    assert f"{summary.n_switches} switches" in shown
    assert 'src="data:image/png;base64,' in shown
    assert len(shown) < 200_000


def test_without_matplotlib_there_is_text() -> None:
    code = (
        "import sys; sys.modules['matplotlib'] = None\n"
        "import regrasp_lp as rl\n"
        "p = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])\n"
        "g = rl.build_switching_graph(p, 0.4)\n"
        "plan = g.plan(g.sets[0].witness, g.sets[1].witness)\n"
        "print(p._repr_svg_(), g.sets[0]._repr_svg_())\n"
        "print('<table' in g._repr_html_(), '<img' in g._repr_html_())\n"
        "print('<pre>Regrasp' in plan._repr_html_(), '<svg style' in plan._repr_html_())\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["None", "None", "True", "False", "True", "False"]


def test_ipython_takes_the_richest(bracket: rl.SwitchingGraph, plan: rl.Plan) -> None:
    formats = DisplayFormatter().format
    things = (bracket.polygon, bracket, bracket.sets[0], bracket.sets[0].witness, plan)
    kinds = [set(formats(thing)[0]) - {"text/plain"} for thing in things]
    svg, html = {"image/svg+xml"}, {"text/html"}
    assert kinds == [svg, html, svg, html, html]


@pytest.mark.slow
def test_notebooks_show_all_of_it() -> None:
    cells = [
        "import regrasp_lp as rl\n"
        "block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)], name='block')\nblock",
        "graph = rl.build_switching_graph(block, 0.4)\ngraph",
        "graph.sets[0]",
        "graph.sets[0].witness",
        "graph.plan([(0, 3.0), (2, 3.0)], [(1, 1.5), (3, 1.5)])",
    ]
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    NotebookClient(book, timeout=60, kernel_name="python3").execute()
    kinds = [set(cell.outputs[-1]["data"]) - {"text/plain"} for cell in book.cells]
    svg, html = {"image/svg+xml"}, {"text/html"}
    assert kinds == [svg, html, svg, html, html]


# --- the set on its object ----------------------------------------------------------------------


@pytest.mark.parametrize("sets", ["complete", "chapter"])
def test_spans_are_the_shadows_of_the_pieces(sets: str) -> None:
    for polygon in (star_polygon(7, 1), star_polygon(9, 5)):
        graph = rl.build_switching_graph(polygon, 0.5, sets=sets)
        for grasp_set in list(graph.sets)[::29]:
            # each piece is closed here: its own shadow is that of its LP, if it has an inside
            pieces, m = grasp_set.pieces, len(grasp_set.edges)
            for i in range(m):
                ends = []
                for sign in (1, -1):
                    values = [
                        linprog(
                            sign * np.eye(m)[i],
                            pieces.rows[k],
                            pieces.bounds[k],
                            bounds=list(zip(pieces.lower[k], pieces.upper[k], strict=True)),
                        ).fun
                        for k in range(len(pieces))
                    ]
                    # of a piece thinner than its tolerance the solver sees nothing
                    ends.append(sign * min(value for value in values if value is not None))
                if len(set(grasp_set.edges)) == m:
                    assert grasp_set.spans[i] == pytest.approx(ends, abs=1e-6)
                else:  # two on one edge: the pieces order them, the spans do not
                    assert grasp_set.spans[i][0] <= ends[0] + 1e-6
                    assert grasp_set.spans[i][1] >= ends[1] - 1e-6


def test_the_picture_of_a_set_has_its_spans_and_its_witness(bracket: rl.SwitchingGraph) -> None:
    for grasp_set in list(bracket.sets)[::5]:
        drawn = grasp_set.plot()
        assert len(drawn.fingers) == len(drawn.bands) == len(grasp_set.edges)
        for k, edge in enumerate(grasp_set.edges):
            ends = np.stack(drawn.bands[k + 1].get_data(), axis=1)
            lengths = np.hypot(*(ends - grasp_set.polygon.edge_starts[edge]).T)
            assert lengths == pytest.approx(grasp_set.spans[k])


# --- animation ----------------------------------------------------------------------------------


def frames(data: bytes) -> list[tuple[Image.Image, int]]:
    found = []
    with Image.open(io.BytesIO(data)) as image:
        assert image.format == "GIF"
        assert image.info["loop"] == 0
        for k in range(image.n_frames):
            image.seek(k)
            found.append((image.convert("RGB"), image.info["duration"]))
    return found


def test_an_animation_shows_every_state_and_slides_between(plan: rl.Plan, tmp_path: Path) -> None:
    path = tmp_path / "plan.gif"
    data = plan.to_gif(path)
    assert path.read_bytes() == data
    assert len(data) < 300_000
    shown = frames(data)
    slides = sum(isinstance(step, rl.Slide) for step in plan.steps)
    assert len(shown) == len(plan.steps) + 1 + 11 * slides
    assert sum(duration == 80 for _, duration in shown) == 11 * slides
    assert {duration for _, duration in shown} == {80, 1500, 2250}
    for (one, _), (other, _) in itertools.pairwise(shown):
        assert one.size == other.size
        assert one.tobytes() != other.tobytes()
    # exact colours: paper, material, and the bar at the bottom, full at the end
    last = np.asarray(shown[-1][0])
    assert last[0, 0].tolist() == [255, 255, 255]
    blue = [int(palette.BLUE[k : k + 2], 16) for k in (1, 3, 5)]
    assert (last[-2] == blue).all()
    assert not (np.asarray(shown[0][0])[-2] == blue).all(axis=1).any()


def test_fingers_move_evenly_in_a_slide() -> None:
    block = rl.Polygon([(0, 0), (8, 0), (8, 3), (0, 3)])
    found = rl.plan_regrasp(block, [(0, 1.0), (2, 7.0)], [(0, 7.0), (2, 1.0)], friction=0.4)
    assert [type(step) for step in found.steps] == [rl.Slide]
    centers = []
    vermillion = np.array([int(palette.VERMILLION[k : k + 2], 16) for k in (1, 3, 5)])
    for image, _ in frames(plan_gif(found))[1:-1]:
        columns = np.nonzero((np.asarray(image) == vermillion).all(axis=2))[1]
        centers.append(columns.mean())
    steps = np.diff(centers)
    assert len(steps) == 10
    assert steps.min() > 0
    assert steps == pytest.approx(np.full(10, steps.mean()), abs=2)


@pytest.mark.parametrize("options", [{"seconds": 0}, {"seconds": "1"}, {"dpi": float("nan")}])
def test_bad_options_of_animations(plan: rl.Plan, options: dict[str, object]) -> None:
    with pytest.raises(rl.OptionError, match="has to be a positive number"):
        plan.to_gif(**options)  # type: ignore[arg-type]


@pytest.mark.parametrize("seconds", [0.001, 437, 1e9])
def test_times_that_a_gif_cannot_say(plan: rl.Plan, seconds: float) -> None:
    with pytest.raises(rl.OptionError, match=r"seconds has to be from 0\.01 to 436"):
        plan.to_gif(seconds=seconds)


@pytest.mark.parametrize("seconds", [0.01, 436])
def test_times_that_a_gif_can_just_say(seconds: float) -> None:
    block = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])
    grasp = [(0, 3.0), (2, 3.0)]
    found = rl.plan_regrasp(block, grasp, grasp, friction=0.4)
    data = found.to_gif(seconds=seconds, dpi=20)
    with Image.open(io.BytesIO(data)) as image:
        assert image.info["duration"] == pytest.approx(1500 * seconds, abs=10)


def test_the_command_line_writes_an_animation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from regrasp_lp.cli import main

    (tmp_path / "block.wkt").write_text("POLYGON ((0 0, 6 0, 6 3, 0 3, 0 0))")
    arguments = ["plan", str(tmp_path / "block.wkt"), "--friction", "0.4", "--start", "0:3,2:3"]
    arguments += ["--goal", "1:1.5,3:1.5", "--gif"]
    assert main([*arguments, str(tmp_path / "plan.gif")]) == 0
    assert frames((tmp_path / "plan.gif").read_bytes())
    assert main([*arguments, str(tmp_path / "plan.png")]) == 2
    assert "has to end in .gif" in capsys.readouterr().err
