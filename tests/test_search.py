"""The search for fewest placements against networkx on every pair of sets of small graphs.

And all paths in order, with weights and sets to avoid, against a list of all paths.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from itertools import islice, pairwise

import networkx as nx
import numpy as np
import pytest
from geometry import ell, rectangle, right_triangle, star, unit_square
from hypothesis import given as given_
from hypothesis import settings
from hypothesis import strategies as st
from regrasps import directed

import regrasp_lp as rl
from regrasp_lp.errors import OptionError
from regrasp_lp.planning.branches import END, Branch
from regrasp_lp.planning.objective import Objective
from regrasp_lp.planning.search import PathSearch, fewest_placements, placements_from
from regrasp_lp.planning.steering import Steering, SwitchWeights

CASES = [
    (name, k, sets)
    for name in ("square", "triangle", "rectangle")
    for k in (3, 4, 5, 6)
    for sets in ("complete", "chapter")
] + [("ell", 3, "chapter"), ("ell", 4, "complete"), ("star", 4, "chapter"), ("star", 3, "complete")]

POLYGONS = {
    "square": (unit_square(), 0.5),
    "triangle": (right_triangle(), 0.6),
    "rectangle": (rectangle(), 0.3),
    "ell": (ell(), 0.3),
    "star": (star(6, 2), 0.35),
}


@cache
def graph_of(name: str, fingers: int, sets: str) -> rl.SwitchingGraph:
    polygon, friction = POLYGONS[name]
    return rl.build_switching_graph(polygon, friction, rl.Hand(fingers), sets)


def search(
    graph: rl.SwitchingGraph,
    sources: dict[int, int],
    targets: dict[int, int],
    given: dict[int, float] | None = None,
) -> list[int] | None:
    return fewest_placements(
        graph.sets.contacts, graph.sets.margins, graph.switches, graph.hand, sources, targets, given
    )


def cost_of(costs: nx.DiGraph, path: list[int]) -> int:
    return sum(costs[s][t]["cost"] for s, t in pairwise(path))


def least_of(graph: rl.SwitchingGraph, path: list[int]) -> float:
    return float(graph.sets.margins[path].min())


def distances(costs: nx.DiGraph) -> dict[int, dict[int, int]]:
    return dict(nx.all_pairs_dijkstra_path_length(costs, weight="cost"))


@pytest.mark.parametrize(("name", "fingers", "sets"), CASES)
def test_fewest_placements_and_largest_least_margin(name: str, fingers: int, sets: str) -> None:
    """For all pairs; the best margin by cutting the graph at every margin in turn."""
    graph = graph_of(name, fingers, sets)
    costs = directed(graph)
    fewest = distances(costs)
    margins = graph.sets.margins
    best: dict[tuple[int, int], float] = {}
    for level in sorted(set(margins.tolist())):
        kept = costs.subgraph(np.flatnonzero(margins >= level).tolist())
        for s, reached in distances(kept).items():
            for t, length in reached.items():
                if length == fewest[s][t]:
                    best[s, t] = level
    for s in range(len(graph)):
        for t in range(len(graph)):
            path = search(graph, {s: 0}, {t: 0})
            if t not in fewest[s]:
                assert path is None
                continue
            assert path is not None
            assert (path[0], path[-1]) == (s, t)
            assert len(set(path)) == len(path)
            assert cost_of(costs, path) == fewest[s][t]
            assert least_of(graph, path) == best[s, t]


def test_all_shortest_paths_are_no_better() -> None:
    """The tie rule once more, by listing every shortest path."""
    for name, k, sets in (("square", 4, "complete"), ("rectangle", 3, "complete")):
        graph = graph_of(name, k, sets)
        costs = directed(graph)
        for s in range(len(graph)):
            for t in range(len(graph)):
                if s == t or not nx.has_path(costs, s, t):
                    continue
                path = search(graph, {s: 0}, {t: 0})
                assert path is not None
                every = nx.all_shortest_paths(costs, s, t, weight="cost")
                assert least_of(graph, path) == max(least_of(graph, other) for other in every)


@pytest.mark.parametrize(("name", "fingers", "sets"), CASES)
def test_placements_from_some_sets(name: str, fingers: int, sets: str) -> None:
    graph = graph_of(name, fingers, sets)
    costs = directed(graph)
    costs.add_node("start")
    sources = {0: 1, len(graph) - 1: 0}
    for index, cost in sources.items():
        costs.add_edge("start", index, cost=cost)
    expected = nx.single_source_dijkstra_path_length(costs, "start", weight="cost")
    found = placements_from(
        graph.sets.contacts, graph.sets.margins, graph.switches, graph.hand, sources
    )
    assert found.tolist() == [expected.get(i, -1) for i in range(len(graph))]


@pytest.mark.parametrize("fingers", [3, 4, 5])
def test_several_sources_and_targets_with_costs(fingers: int) -> None:
    graph = graph_of("rectangle", fingers, "complete")
    rng = np.random.default_rng(fingers)
    plain = directed(graph)
    for _ in range(60):
        chosen = rng.choice(len(graph), 4, replace=True).tolist()
        sources = {i: int(rng.integers(2)) for i in chosen[:2]}
        targets = {i: int(rng.integers(3)) for i in chosen[2:]}
        costs = plain.copy()
        costs.add_nodes_from(("start", "goal"))
        for index, cost in sources.items():
            costs.add_edge("start", index, cost=cost)
        for index, cost in targets.items():
            costs.add_edge(index, "goal", cost=cost)
        path = search(graph, sources, targets)
        if not nx.has_path(costs, "start", "goal"):
            assert path is None
            continue
        assert path is not None
        total = sources[path[0]] + cost_of(plain, path) + targets[path[-1]]
        assert total == nx.shortest_path_length(costs, "start", "goal", weight="cost")


def test_given_margins_cap_ties() -> None:
    """What the start leaves of the margin makes no path better than another one."""
    graph = graph_of("rectangle", 4, "complete")
    costs, fewest = directed(graph), distances(directed(graph))
    rng = np.random.default_rng(0)
    for _ in range(40):
        s, other, t = rng.choice(len(graph), 3, replace=False).tolist()
        given = {s: 1e-3, other: float(graph.sets.margins[other]) / 2}
        path = search(graph, {s: 0, other: 0}, {t: 0}, given)
        assert path is not None
        assert cost_of(costs, path) == min(fewest[s][t], fewest[other][t])
        if fewest[s][t] == fewest[other][t]:
            assert path[0] == other


def test_nothing_to_search() -> None:
    graph = graph_of("square", 4, "complete")
    assert search(graph, {}, {0: 0}) is None
    assert search(graph, {0: 0}, {}) is None
    assert search(graph, {3: 0}, {3: 2}) == [3]


def test_the_same_path_again() -> None:
    graph = graph_of("square", 4, "complete")
    again = rl.build_switching_graph(*POLYGONS["square"])
    for s in range(len(graph)):
        for t in range(len(graph)):
            assert search(graph, {s: 0}, {t: 0}) == search(again, {s: 0}, {t: 0})


# --- all paths in order -------------------------------------------------------------------------

Weights = Callable[[int, int], float | None]
Key = tuple[float, int, float]

SMALL = [
    ("square", 4, "complete"),
    ("square", 3, "complete"),
    ("triangle", 4, "complete"),
    ("triangle", 5, "complete"),
    ("rectangle", 3, "complete"),
    ("rectangle", 6, "chapter"),
    ("ell", 4, "chapter"),
    ("star", 4, "chapter"),
]


def search_in(
    graph: rl.SwitchingGraph, sources: dict[int, int], targets: dict[int, int]
) -> PathSearch:
    sets = graph.sets
    return PathSearch(sets.contacts, sets.margins, graph.switches, graph.hand, sources, targets)


def every_path(
    search: PathSearch, costs: nx.DiGraph, most: int, weight: Weights | None = None
) -> Iterator[tuple[Key, tuple[int, ...]]]:
    """All simple paths with no more than so many placements, by depth-first search."""
    through = (
        np.ones(len(search.contacts), dtype=bool) if search.through is None else search.through
    )

    def onward(path: list[int], label: Key) -> Iterator[tuple[Key, tuple[int, ...]]]:
        here = path[-1]
        if here in search.targets:
            placements = label[1] + search.targets[here]
            negative = max(label[2], -search.given.get(here, np.inf))
            if placements <= most:
                yield (label[0], placements, negative), tuple(path)
        if not through[here] and len(path) > 1:
            return
        for other in costs[here]:
            w = 0.0 if weight is None else weight(here, other)
            placements = label[1] + costs[here][other]["cost"]
            allowed = through[other] or other in search.targets
            if other in path or w is None or not allowed or placements > most:
                continue
            margin = -float(search.margins[other])
            yield from onward([*path, other], (label[0] + w, placements, max(label[2], margin)))

    for index, cost in search.sources.items():
        least = min(float(search.margins[index]), search.given.get(index, np.inf))
        yield from onward([index], (0.0, cost, -least))


def assert_in_order(search: PathSearch, costs: nx.DiGraph, weight: Weights | None = None) -> int:
    """The paths are those of the list, in its order but for ties; return their number."""
    first = search.first
    if first is None:
        assert not list(every_path(search, costs, 12, weight))
        return 0
    # With weights any path may come next, with placements only those with few.
    most = 9 if weight is not None else first[0][1] + 1
    every = sorted(every_path(search, costs, most, weight))
    if weight is None:
        found = []
        for best in search.paths():
            if best.key[1] > most:
                break
            found.append((best.key, best.path))
        assert len(found) == len(every)
    else:
        found = [(b.key, b.path) for b in search.paths() if b.key[1] <= most]
        assert len(found) == len(every)
    assert [key for key, _ in found] == [key for key, _ in every]
    assert {path for _, path in found} == {path for _, path in every}
    return len(found)


@pytest.mark.parametrize(("name", "fingers", "sets"), SMALL)
def test_all_paths_come_in_order(name: str, fingers: int, sets: str) -> None:
    graph = graph_of(name, fingers, sets)
    costs = directed(graph)
    rng = np.random.default_rng(fingers)
    count = 0
    for _ in range(12):
        chosen = rng.choice(len(graph), 4).tolist()
        sources = {i: int(rng.integers(2)) for i in chosen[:2]}
        targets = {i: int(rng.integers(3)) for i in chosen[2:]}
        caps = {i: float(graph.sets.margins[i] * rng.uniform(0.2, 1)) for i in chosen[::2]}
        search = replace(search_in(graph, sources, targets), given=caps)
        count += assert_in_order(search, costs)
    assert count > 15


@pytest.mark.parametrize(("name", "fingers", "sets"), SMALL)
def test_paths_round_some_sets(name: str, fingers: int, sets: str) -> None:
    """A path may begin or end with a set that it may not pass through."""
    graph = graph_of(name, fingers, sets)
    costs = directed(graph)
    rng = np.random.default_rng(fingers)
    for _ in range(12):
        chosen = rng.choice(len(graph), 4).tolist()
        through = rng.random(len(graph)) < 0.6
        search = search_in(graph, dict.fromkeys(chosen[:2], 0), dict.fromkeys(chosen[2:], 0))
        assert_in_order(replace(search, through=through), costs)
        # The same as without these sets, if none of them is an end.
        through[chosen] = True
        margins = np.where(through, graph.sets.margins, -np.inf)
        kept, none = replace(search, through=through), replace(search, margins=margins)
        assert kept.first == none.first


@pytest.mark.parametrize("name", ["rectangle", "triangle"])
def test_paths_by_weight(name: str) -> None:
    graph = graph_of(name, 3, "complete")
    costs = directed(graph)
    rng = np.random.default_rng(1)
    for _ in range(15):
        table = rng.integers(0, 5, (len(graph), len(graph))) / 2
        table[rng.random(table.shape) < 0.15] = np.inf
        weigh = SwitchWeights(graph.sets, lambda u, v, _, t=table: None if t[u, v] > 9 else t[u, v])
        s, t = rng.choice(len(graph), 2, replace=False).tolist()
        search = replace(search_in(graph, {s: 0}, {t: 0}), weigh=weigh)
        weights = np.where(table > 9, np.nan, table)
        assert_in_order(
            search, costs, lambda u, v, w=weights: None if np.isnan(w[u, v]) else float(w[u, v])
        )


@pytest.mark.parametrize(("name", "fingers", "sets"), SMALL)
def test_paths_by_weight_against_networkx(name: str, fingers: int, sets: str) -> None:
    """The k lightest simple paths, for weights that are never 0, and which switches are asked."""
    graph = graph_of(name, fingers, sets)
    known = graph.to_networkx()
    rng = np.random.default_rng(3)
    table = rng.integers(1, 9, (len(graph), len(graph)))
    asked = set()

    def weight(u: int, v: int, data: dict[str, object]) -> float:
        assert (u, v) not in asked
        asked.add((u, v))
        assert data == {**known.edges[u, v], **known.nodes[v]}
        return int(table[u, v])

    weighted = nx.DiGraph()
    for u, v in known.edges:
        weighted.add_edge(u, v, weight=int(table[u, v]))
        weighted.add_edge(v, u, weight=int(table[v, u]))
    s, t = next((s, t) for s, t in known.edges if known.edges[s, t]["held"] < 3)
    search = replace(search_in(graph, {s: 0}, {t: 0}), weigh=SwitchWeights(graph.sets, weight))
    expected = islice(nx.shortest_simple_paths(weighted, s, t, weight="weight"), 25)
    lengths = [nx.path_weight(weighted, path, "weight") for path in expected]
    found = list(islice(search.paths(), 25))
    assert [best.key[0] for best in found] == lengths
    assert len({best.path for best in found}) == len(found)
    assert asked <= set(weighted.edges)


@pytest.mark.parametrize(("name", "fingers", "sets"), SMALL)
def test_placements_as_weight(name: str, fingers: int, sets: str) -> None:
    """If a switch counts its placements, the paths are those of the fewest placements."""
    graph = graph_of(name, fingers, sets)
    weigh = SwitchWeights(graph.sets, lambda u, v, data: len(data["edges"]) - data["held"])
    for s in range(0, len(graph), 3):
        for t in range(len(graph)):
            search = search_in(graph, {s: 0}, {t: 0})
            one, other = search.first, replace(search, weigh=weigh).first
            assert (one is None) == (other is None)
            if one is not None and other is not None:
                assert other == ((float(one[0][1]), *one[0][1:]), one[1])


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (-1, "got -1"),
        (float("nan"), "got nan"),
        (float("inf"), "None to hide"),
        ("2", "got '2'"),
        (True, "got True"),
        (1j, "got 1j"),
    ],
)
def test_weights_without_meaning(value: object, text: str) -> None:
    graph = graph_of("square", 4, "complete")
    weigh = SwitchWeights(graph.sets, lambda u, v, _: value if v == 3 else 1)
    search = replace(search_in(graph, {0: 0}, {7: 0}), weigh=weigh)
    edges = re_escape(str(graph.sets[3].edges))
    with pytest.raises(OptionError, match=rf"to set 3 \(edges {edges}\).*{text}"):
        list(search.paths())


def re_escape(text: str) -> str:
    return text.replace("(", r"\(").replace(")", r"\)")


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ({"weight": 3}, "a function of"),
        ({"avoid_edges": [9]}, "avoid_edges has 9, but the polygon has edges 0 to 3"),
        ({"avoid_edges": 3}, "avoid_edges must be numbers"),
        ({"avoid_sets": [-1]}, "avoid_sets has -1, but the graph has sets 0 to 9"),
        ({"avoid_sets": [True]}, "avoid_sets has True"),
        ({"avoid_sets": "3"}, "avoid_sets must be numbers"),
    ],
)
def test_what_cannot_steer(asked: dict[str, object], text: str) -> None:
    sets = graph_of("square", 4, "complete").sets
    with pytest.raises(OptionError, match=text):
        Steering.of(sets, Objective.of("placements"), **asked)
    with pytest.raises(OptionError, match="means nothing with"):
        Steering.of(sets, Objective.of("margin"), lambda u, v, data: 1)


# --- classes of paths ---------------------------------------------------------------------------


@st.composite
def paths(draw: st.DrawFn) -> list[tuple[int, ...]]:
    one = st.lists(st.integers(0, 5), min_size=1, max_size=5, unique=True).map(tuple)
    return draw(st.lists(one, min_size=2, max_size=30, unique=True))


@settings(max_examples=200, deadline=None)
@given_(paths())
def test_a_class_without_a_path_falls_into_classes(listed: list[tuple[int, ...]]) -> None:
    """Each other path is in exactly one of them, down to single paths."""

    def split(branch: Branch, members: list[tuple[int, ...]]) -> None:
        best, *others = members
        assert branch.holds(best)
        parts = list(branch.without(best))
        assert not any(part.holds(best) for part in parts)
        inside = [[path for path in others if part.holds(path)] for part in parts]
        assert sorted(path for group in inside for path in group) == sorted(others)
        for part, group in zip(parts, inside, strict=True):
            if group:
                split(part, group)

    split(Branch(), listed)


def test_what_a_class_allows() -> None:
    branch = Branch((1, 2), frozenset({3, END}))
    assert branch.holds((1, 2, 4))
    assert branch.holds((1, 2, 2, 4, 3))
    for path in ((1, 2), (1, 2, 3), (2, 4), (1, 4), (1, 2, 4, 1), (1, 2, 4, 2), (1,)):
        assert not branch.holds(path)
    assert list(Branch().without((1, 1))) == [
        Branch((), frozenset({1})),
        Branch((1,), frozenset({1})),
    ]
