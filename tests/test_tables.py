"""Tables of summaries: what is written can be read back, and columns stand below each other."""

from __future__ import annotations

import csv
import io
import re

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

import regrasp_lp as rl
from regrasp_lp.summary import KindCounts, Summary
from regrasp_lp.tables import csv_table, markdown_table, text_table

KINDS = {
    "complete": ("two_finger", "three_finger"),
    "chapter": ("two_finger", "concurrent", "parallel"),
}
COUNTS = ("sets", "candidates", "components")


@pytest.fixture(scope="module", params=KINDS)
def graphs(
    request: pytest.FixtureRequest, workpieces: dict[str, rl.Polygon], stars: dict[str, rl.Polygon]
) -> list[rl.SwitchingGraph]:
    polygons = [*workpieces.values(), stars["star_15"]]
    return [
        rl.build_switching_graph(polygon, 0.1763, sets=request.param)
        for polygon in polygons
        if polygon.n_edges < 20
    ]


@pytest.fixture(scope="module")
def summaries(graphs: list[rl.SwitchingGraph]) -> list[Summary]:
    return [graph.summary() for graph in graphs]


def named(*names: str) -> list[Summary]:
    kinds = {"two_finger": KindCounts(4, 2, 1)}
    return [Summary(name, 4, kinds, 2, 1, [2], {"sets": 0.25}) for name in names]


def expected_row(summary: Summary) -> dict[str, str]:
    """Return the cells of a row by the headings of the CSV table."""
    row = {"name": summary.name, "edges": summary.n_edges}
    for kind, counts in summary.kinds.items():
        row |= {f"{kind}_{name}": getattr(counts, name) for name in COUNTS}
    row |= {"sets": summary.n_sets, "components": len(summary.components)}
    row |= {"switches": summary.n_switches}
    row |= {"seconds": f"{summary.seconds['sets'] + summary.seconds['switches']:.3f}"}
    return {key: str(cell) for key, cell in row.items()}


def read_csv(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text, newline=""), strict=True))


def read_markdown(text: str) -> list[list[str]]:
    """Return the cells of a table as GitHub reads them: a backslash takes what comes next."""
    rows = []
    for line in text.splitlines():
        assert line.startswith("| ")
        assert line.endswith(" |")
        cells = re.findall(r"((?:\\.|[^\\|])*)\|", line[1:])
        rows.append([re.sub(r"\\(.)", r"\1", cell.strip(" ")) for cell in cells])
    return rows


# --- numbers ------------------------------------------------------------------------------------


def test_the_numbers_are_those_of_the_graphs(graphs: list[rl.SwitchingGraph]) -> None:
    rows = read_csv(csv_table([graph.summary() for graph in graphs]))
    for graph, row in zip(graphs, rows, strict=True):
        explicit = graph.to_networkx()
        assert row["name"] == graph.polygon.name
        assert int(row["edges"]) == graph.polygon.n_edges
        assert int(row["sets"]) == len(explicit)
        assert int(row["switches"]) == explicit.number_of_edges()
        assert int(row["components"]) == nx.number_connected_components(explicit)
        for family in graph.sets.families:
            of_kind = [i for i, kind in explicit.nodes(data="kind") if kind == family.kind]
            alone = nx.number_connected_components(explicit.subgraph(of_kind))
            assert int(row[f"{family.kind}_sets"]) == len(of_kind)
            assert int(row[f"{family.kind}_components"]) == alone
            assert int(row[f"{family.kind}_candidates"]) == family.n_candidates


def test_two_finger_sets_are_one_component(summaries: list[Summary]) -> None:
    """Four fingers hold any two of them at once."""
    for summary in summaries:
        counts = summary.kinds["two_finger"]
        assert counts.components == min(counts.sets, 1)


def test_components_alone_are_not_fewer_than_together(summaries: list[Summary]) -> None:
    for summary in summaries:
        assert sum(c.components for c in summary.kinds.values()) >= len(summary.components)


# --- CSV ----------------------------------------------------------------------------------------


def test_csv_is_read_back(summaries: list[Summary]) -> None:
    text = csv_table(summaries)
    assert read_csv(text) == [expected_row(summary) for summary in summaries]
    columns = [f"{kind}_{name}" for kind in summaries[0].kinds for name in COUNTS]
    assert text.splitlines()[0].split(",") == [
        *("name", "edges", *columns),
        *("sets", "components", "switches", "seconds"),
    ]


@given(st.lists(st.text(), min_size=1, max_size=4))
def test_any_name_is_read_back(names: list[str]) -> None:
    expected = [" ".join(name.split()) for name in names]
    assert [row["name"] for row in read_csv(csv_table(named(*names)))] == expected
    assert [row[0] for row in read_markdown(markdown_table(named(*names)))[2:]] == expected
    lines = text_table(named(*names)).splitlines()
    assert [line.split("      4      2      4")[0].strip() for line in lines[2:]] == expected


# --- Markdown -----------------------------------------------------------------------------------


def test_markdown_has_the_cells_of_csv(summaries: list[Summary]) -> None:
    head, rule, *rows = read_markdown(markdown_table(summaries))
    assert rule == [":---", *["---:"] * (len(head) - 1)]
    assert rows == [list(expected_row(summary).values()) for summary in summaries]
    kinds = [kind.replace("_", "-") for kind in summaries[0].kinds]
    assert head[2:-4] == [f"{kind} {name}" for kind in kinds for name in COUNTS]
    assert head[-4:-1] == ["combined sets", "combined components", "combined switches"]


def test_markdown_escapes_bars() -> None:
    row = markdown_table(named("a|b\\|c\nd")).splitlines()[2]
    assert row.startswith(r"| a\|b\\\|c d | 4 |")


# --- text ---------------------------------------------------------------------------------------


def ends(line: str) -> list[int]:
    return [match.end() for match in re.finditer(r"\S+", line)]


def test_text_is_aligned(summaries: list[Summary]) -> None:
    groups, head, *rows = text_table(summaries).splitlines()
    for summary, row in zip(summaries, rows, strict=True):
        assert ends(row)[1:] == ends(head)[1:]
        assert row.split() == list(expected_row(summary).values())
    titles = [kind.replace("_", "-") for kind in (*summaries[0].kinds, "combined")]
    assert re.findall(r"-+ (\S+) -+", groups) == titles
    # each title spans its three columns
    for number, match in enumerate(re.finditer(r"-+ \S+ -+", groups)):
        first = list(re.finditer(r"\S+", head))[2 + 3 * number : 5 + 3 * number]
        assert match.end() == first[-1].end()
        assert match.start() <= first[0].start()
    assert max(map(len, (groups, head, *rows))) <= 120


def test_long_numbers_make_columns_wider() -> None:
    large = Summary("x", 400, {"two_finger": KindCounts(10**9, 10**8, 1)}, 10**8, 1, [], {})
    _, head, *rows = text_table([large, *named("a_long_name")]).splitlines()
    assert ends(rows[0])[1:] == ends(rows[1])[1:] == ends(head)[1:]
    assert rows[0].split() == f"x 400 {10**8} {10**9} 1 {10**8} 0 1 0.000".split()


# --- both kinds of sets, and none ---------------------------------------------------------------


def test_what_a_graph_has_no_sets_of_is_left_empty() -> None:
    other = Summary("other", 3, {"parallel": KindCounts(9, 8, 7)}, 8, 6, [8], {"sets": 1.0})
    mixed = [*named("one"), other]
    first, second = read_csv(csv_table(mixed))
    assert (first["two_finger_sets"], first["parallel_sets"]) == ("2", "")
    assert (second["two_finger_sets"], second["parallel_sets"]) == ("", "8")
    _, head, *rows = text_table(mixed).splitlines()
    assert len(head.split()) == 12
    assert [len(row.split()) for row in rows] == [9, 9]
    assert set(ends(rows[1])[1:]) <= set(ends(head))
    _, _, *rows = read_markdown(markdown_table(mixed))
    assert rows == [list(first.values()), list(second.values())]


def test_tables_without_rows() -> None:
    assert csv_table([]) == "name,edges,sets,components,switches,seconds\n"
    assert text_table([]).splitlines()[1].split()[:2] == ["name", "edges"]
    assert len(markdown_table([]).splitlines()) == 2
