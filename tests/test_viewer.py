"""Pages for a browser: what they hold is what plans and graphs say, and nothing else is needed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY
from hypothesis import given
from hypothesis import strategies as st

import regrasp_lp as rl
from regrasp_lp import colors
from regrasp_lp.cli import main
from regrasp_lp.planning.account import describe
from regrasp_lp.planning.regions import regions
from regrasp_lp.planning.steps import Slide
from regrasp_lp.switching_graph import SwitchingGraph
from regrasp_lp.viewer import graph_document, graphs, plan_document
from regrasp_lp.viewer.page import build_page, data_text, packed, unpacked

NASTY = "</script><b onclick=alert(1)>\u2028 & \"'<!--\n\nof two paragraphs"


@pytest.fixture(scope="module")
def plan(workpieces) -> rl.Plan:
    """With slides of several fingers, two- and three-finger grasps."""
    bracket = workpieces["l_bracket"]
    start = rl.Grasp([(1, 2.0), (3, 36.0), (5, 39.0)])
    goal = rl.Grasp([(0, 34.0), (2, 0.6), (4, 19.8)])
    found = rl.plan_regrasp(bracket, start, goal, 0.3)
    assert {type(step) for step in found.steps} == {rl.Place, rl.Release, rl.Slide}
    return found


@pytest.fixture(scope="module")
def graph(stars) -> SwitchingGraph:
    return rl.build_switching_graph(stars["star_15"], 0.25, sets="chapter")


def data_of(page: str) -> dict:
    """The document of a page, as its script reads it."""
    text = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)[1]
    return json.loads(text)


# --- plans --------------------------------------------------------------------------------------


class TestPlanDocument:
    def test_is_what_the_page_holds(self, plan):
        assert data_of(plan.to_html()) == json.loads(json.dumps(plan_document(plan)))

    def test_head_and_end_are_those_of_the_account(self, plan):
        document = plan_document(plan)
        head, _, end = str(plan).split("\n\n")
        assert (document["head"], document["end"]) == (head.splitlines()[1:], end)

    def test_moments_are_the_held_grasps(self, plan):
        moments = plan_document(plan)["moments"]
        assert len(moments) == len(plan.grasps)
        for moment, held in zip(moments, plan.grasps, strict=True):
            places = {k: (c.edge, c.fraction) for k, c in held.contacts.items()}
            assert moment["contacts"] == places
            assert moment["support"] == held.support.fingers
            assert (moment["margin"], moment["tolerance"]) == (held.margin, held.tolerance)

    def test_regions_are_those_of_the_plan(self, plan):
        document = plan_document(plan)
        for region in regions(plan):
            ends = {k: tuple(c.fraction for c in pair) for k, pair in region.intervals.items()}
            if region.on_the_way:
                found = document["transitions"][region.step - 1]["regions"]
                assert {k: pair[1] for k, pair in found.items()} == ends
            else:
                assert document["moments"][region.step]["regions"] == ends

    def test_slides_have_the_torque_functions_of_both_ends(self, plan):
        document = plan_document(plan)
        for i, (step, entry) in enumerate(zip(plan.steps, document["transitions"], strict=True)):
            assert entry["text"] == describe(step)
            assert (entry["values"] is not None) == isinstance(step, Slide)
            if entry["values"] is None:
                continue
            for values, held in zip(entry["values"], plan.grasps[i : i + 2], strict=True):
                margin = min(max(values), -min(values))
                grasp = rl.Grasp([held.contacts[k] for k in plan.supports[i].fingers])
                assert margin == pytest.approx(rl.margin(plan.polygon, grasp, plan.friction))
            assert entry["margin"] == plan.slide_margins[i]

    def test_common_cones_hold_the_line_of_two_fingers(self, plan):
        for moment in plan_document(plan)["moments"]:
            if len(moment["support"]) != 2:
                continue
            a, b = (plan.polygon.points(*moment["contacts"][k]) for k in moment["support"])
            for k, towards in zip(moment["support"], (b - a, a - b), strict=True):
                right, left = np.array(moment["rays"][k])
                sides = np.linalg.det([right, towards]), np.linalg.det([towards, left])
                inside = min(sides) > 0
                outside = max(sides) < 0  # an expanding grasp sees the other side
                assert inside or outside

    def test_parallel_grasps_have_a_common_cone(self, graph):
        found = [s for s in graph.sets if s.kind == "parallel"]
        parallel = max(found, key=lambda s: s.margin)
        plan = graph.plan(parallel.witness, parallel.witness)
        (moment,) = plan_document(plan)["moments"]
        assert moment["parallel"]
        outer = next(e for e in parallel.edges if e != parallel.center)
        seen = moment["rays"][1 + list(plan.grasps[0].grasp.edges).index(outer)]
        assert np.allclose(seen, parallel.common_cone)

    def test_a_plan_without_steps(self, workpieces):
        graph = rl.build_switching_graph(workpieces["rectangle"], 0.3)
        witness = graph.sets[0].witness
        document = data_of(graph.plan(witness, witness).to_html())
        assert (len(document["moments"]), document["transitions"]) == (1, [])

    def test_a_plan_that_does_not_hold_is_drawn_without_regions(self, plan, tmp_path):
        file = tmp_path / "plan.json"
        document = plan.to_document() | {"friction": [0.01]}
        file.write_text(json.dumps(document))
        broken = rl.read_plan(file)
        assert broken.margin <= 0
        found = data_of(broken.to_html())
        assert all(moment["regions"] == {} for moment in found["moments"])

    def test_limits_of_a_hand(self, workpieces):
        bracket = workpieces["l_bracket"]
        hand = rl.Hand(edge_clearance=3.0, max_span=100.0)
        start, goal = [(0, 30.0), (4, 10.0)], [(1, 8.0), (5, 12.0)]
        plan = rl.plan_regrasp(bracket, start, goal, 0.5, hand)
        document = plan_document(plan)
        assert document["span"] == 100.0
        for moment in document["moments"]:
            for k, (low, high) in moment["reach"].items():
                length = bracket.edge_lengths[moment["contacts"][k][0]]
                assert (low * length, (1 - high) * length) == pytest.approx((3.0, 3.0))


# --- graphs -------------------------------------------------------------------------------------


def hands() -> Iterator[tuple[str, rl.Hand]]:
    yield "free", rl.Hand()
    yield "three", rl.Hand(3)
    yield "limited", rl.Hand(edge_clearance=0.02, reachable={3: (0.05, 0.2)})
    yield "spaced", rl.Hand(max_span=1.4)


class TestGraphDocument:
    @pytest.mark.parametrize("hand", [pytest.param(hand, id=name) for name, hand in hands()])
    def test_sets_and_switches_are_those_of_the_graph(self, stars, hand):
        graph = rl.build_switching_graph(stars["star_15"], 0.3, hand, sets="chapter")
        document = graph_document(graph)
        n = len(graph)
        assert (unpacked(document["margins"]) == graph.sets.margins).all()
        edges = unpacked(document["edges"]).reshape(n, 3)
        witnesses = unpacked(document["witnesses"]).reshape(n, 3)
        for i in range(0, n, 7):
            grasp_set = graph.sets[i]
            m = len(grasp_set.edges)
            assert tuple(edges[i, :m]) == grasp_set.edges
            assert (witnesses[i, :m] == grasp_set.witness.fractions).all()
        assert sum(kind["count"] for kind in document["kinds"]) == n

        starts, others = unpacked(document["starts"]), unpacked(document["others"])
        slots = unpacked(document["slots"])
        points = unpacked(document["points"]).reshape(-1, document["most_held"])
        pairs = {}
        for i in range(n):
            for entry in range(starts[i], starts[i + 1]):
                pairs[i, int(others[entry])] = entry
        for i in range(n):
            listed = {j for pair in pairs for j in pair if i in pair} - {i}
            free = [k for k in range(n) if k != i and self.free(document, graph, i, k)]
            assert listed | set(free) == set(graph.neighbors(i))
        for (i, j), entry in list(pairs.items())[::37]:
            mine, theirs = int(slots[entry]) & 7, int(slots[entry]) >> 3
            assert mine.bit_count() == theirs.bit_count() == graph.held(i, j)
            if hand.spaced:
                continue
            for index, mask, grasp in zip((i, j), (mine, theirs), graph.witness(i, j), strict=True):
                held = [c for c in range(graph.sets.contacts[index]) if mask >> c & 1]
                at = points[entry, : len(held)]
                assert np.allclose(grasp.fractions[held], at, atol=1e-6)

    @staticmethod
    def free(document: dict, graph: SwitchingGraph, i: int, j: int) -> bool:
        return [graph.sets.contacts[i], graph.sets.contacts[j]] in document["free"]

    def test_functions_give_the_margin(self, graph):
        document = graph_document(graph)
        n, width = len(graph), document["width"]
        functions = unpacked(document["functions"]).reshape(n, width, 4)
        for i in range(n):
            f = np.append(1.0, graph.sets[i].witness.fractions)
            values = functions[i, :, : len(f)] @ f
            margin = min(np.nanmax(values), -np.nanmin(values))
            assert margin == pytest.approx(graph.sets[i].margin, abs=1e-7)

    def test_pieces_are_those_of_the_sets(self, graph):
        found = graph_document(graph)["pieces"]
        starts = unpacked(found["starts"])
        assert [len(s.pieces) for s in graph.sets] == np.diff(starts).tolist()

    def test_a_graph_without_sets(self, workpieces):
        empty = rl.build_switching_graph(workpieces["wedge"], 0.3, min_margin=1e9)
        assert unpacked(data_of(empty.to_html())["margins"]).size == 0

    def test_too_many_switches(self, graph, monkeypatch):
        monkeypatch.setattr(graphs, "MOST_SWITCHES", 10)
        with pytest.raises(rl.OptionError, match="more than the 10 that a page can take.*min_marg"):
            graph.to_html()

    def test_switches_on_demand(self, stars, monkeypatch):
        monkeypatch.setattr("regrasp_lp.build.STORE_LIMIT", 0)
        large = rl.build_switching_graph(stars["star_15"], 0.3)
        with pytest.raises(rl.OptionError, match="too many switches to be stored"):
            large.to_html()


# --- pages --------------------------------------------------------------------------------------


def pages_of(plan: rl.Plan, graph: SwitchingGraph) -> list[str]:
    return [plan.to_html(), graph.to_html()]


class TestPages:
    def test_nothing_is_fetched(self, plan, graph):
        for page in pages_of(plan, graph):
            code = re.sub(r'<script type="application/json".*?</script>', "", page, flags=re.S)
            addresses = set(re.findall(r"[a-z]+://[^\s\"'`)]+", code))
            assert addresses <= {"http://www.w3.org/2000/svg"}
            assert not re.search(r"@import|\bsrc=|\bhref=|fetch\(|XMLHttp|\bimport\b", code)
            assert all(url.startswith("#${") for url in re.findall(r"url\(([^)]*)\)", code))
            assert "default-src 'none'" in code

    def test_colors_are_those_of_pictures(self, plan):
        page = plan.to_html()
        for name in ("BLUE", "VERMILLION", "SKY", "ORANGE", "INK"):
            assert f"--{name.lower()}:{getattr(colors, name)};" in page

    def test_the_account_is_there_without_scripts(self, plan):
        shown = re.search(r"<pre>(.*?)</pre>", plan.to_html(), re.S)[1]
        assert shown == str(plan)  # it has nothing to escape

    def test_written_whole(self, plan, graph, tmp_path):
        for what in (plan, graph):
            text = what.to_html(tmp_path / "page.html")
            assert (tmp_path / "page.html").read_text(encoding="utf-8") == text
        with pytest.raises(OSError, match="no such folder"):
            plan.to_html(tmp_path / "missing" / "page.html")

    def test_deterministic(self, plan, graph):
        assert pages_of(plan, graph) == pages_of(plan, graph)

    def test_names_are_no_markup(self, workpieces):
        ring = workpieces["rectangle"].exterior
        graph = rl.build_switching_graph(rl.Polygon(ring, name=NASTY), 0.3)
        plan = graph.plan(graph.sets[0].witness, graph.sets[1].witness)
        for page in (plan.to_html(), graph.to_html()):
            assert "<b onclick" not in page
            assert page.count("</script>") == 2
            assert data_of(page)["object"]["name"] == NASTY

    @given(st.text())
    def test_any_text_survives_and_ends_no_script(self, text):
        written = data_text({"name": text})
        assert json.loads(written)["name"] == text
        assert not set(written) & set("<>&\u2028\u2029")

    def test_placeholders_in_texts_are_left_alone(self):
        page = build_page("plan", "{{data}}", {"name": "{{title}}"}, {"account": "{{script}}"})
        assert "<title>{{data}}</title>" in page
        assert "<pre>{{script}}</pre>" in page
        assert data_of(page) == {"name": "{{title}}"}

    def test_no_number_that_json_does_not_have(self):
        with pytest.raises(ValueError, match="not JSON compliant"):
            data_text({"margin": float("inf")})

    @pytest.mark.parametrize("dtype", ["u1", "u2", "u4", "i2", "f4", "f8"])
    def test_packed_arrays(self, dtype):
        values = np.array([0, 1, 2, 100], dtype=dtype)
        assert (unpacked(packed(values, dtype)) == values).all()

    def test_no_drawing_package_is_needed(self):
        code = (
            "import sys; sys.modules['matplotlib'] = None\n"
            "import regrasp_lp as rl\n"
            "part = rl.Polygon([(0, 0), (6, 0), (6, 3), (0, 3)])\n"
            "graph = rl.build_switching_graph(part, 0.4)\n"
            "plan = graph.plan([(0, 3.0), (2, 3.0)], [(1, 1.5), (3, 1.5)])\n"
            "print(len(plan.to_html()) > 20000, len(graph.to_html()) > 20000)"
        )
        found = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, cwd=REPOSITORY, check=True
        )
        assert found.stdout.split() == ["True", "True"]


def test_command_line(tmp_path, capsys):
    file = REPOSITORY / "models" / "workpieces.geojson"
    common = [str(file), "--name", "rectangle", "--friction", "0.4"]
    for command in ("plan", "graph"):
        out = tmp_path / f"{command}.html"
        assert main([command, *common, "--html", str(out)]) == 0
        assert f"wrote {out}" in capsys.readouterr().out
        assert Path(out).read_text(encoding="utf-8").startswith("<!doctype html>")
    assert (
        main(["graph", str(file), "--friction", "0.4", "--html", str(tmp_path / "all.html")]) == 2
    )
    assert "--html takes one graph" in capsys.readouterr().err
