"""Golden numbers: counts of sets, switches and components that were confirmed independently.

    python tests/golden.py            # writes tests/golden.json, which the tests compare with
    python tests/golden.py --missing  # keeps the entries whose polygons have not changed

The library computes them. What it says about a polygon is written only if all this confirms it:

- The chapter's sets, with the focus rule and with the contact rule: every set, every switch and the
  number of components are those of the geometric `reference`.
- Complete sets and contact rule: two-finger sets are those of the reference; every set has a
  witness in force closure; every grasp in force closure found at random is in a set; random
  contacts that both of two sets can complete make them adjacent; witnesses of adjacent pairs keep
  the contacts they should. Grasps are decided by force closure of given contacts, exactly, and a
  part of them again by the wrench oracle.

Polygons: those of `models`, and those of the corpus ($REGRASP_LP_CORPUS, see conftest), up to
`MOST_EDGES` edges.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from reference import Key, ReferenceGraph, reference_graph
from wrench_oracle import closed

import regrasp_lp as rl

GOLDEN = Path(__file__).with_name("golden.json")
THETA = 10
MU = math.tan(math.radians(THETA))
MOST_EDGES = 60
MODES = ("chapter/focus", "chapter/contact", "complete/contact")
KINDS = {
    "chapter": ("two_finger", "concurrent", "parallel"),
    "complete": ("two_finger", "three_finger"),
}
Counts = dict[str, int]

REPOSITORY = Path(__file__).resolve().parent.parent
MODELS = REPOSITORY / "models"


def corpus_folder() -> Path:
    default = REPOSITORY.parent / "shared" / "corpus"
    return Path(os.environ.get("REGRASP_LP_CORPUS", default))


def polygons_of(folder: Path) -> list[rl.Polygon]:
    """Those that are not too large."""
    found = [p for file in sorted(folder.glob("*.geojson")) for p in rl.read_polygons(file)]
    return [p for p in found if p.n_edges <= MOST_EDGES]


def key_of(polygon: rl.Polygon) -> str:
    """Name and coordinates."""
    digest = hashlib.sha256()
    for ring in polygon.rings:
        digest.update(np.ascontiguousarray(ring, dtype="<f8").tobytes())
    digest.update(np.array([len(ring) for ring in polygon.rings], dtype="<i8").tobytes())
    return f"{polygon.name} {digest.hexdigest()[:16]}"


def read_golden() -> dict[str, dict[str, Counts]]:
    polygons: dict[str, dict[str, Counts]] = json.loads(GOLDEN.read_text())["polygons"]
    return polygons


def write_golden(entries: dict[str, dict[str, Counts]]) -> None:
    """One line a mode, so that differences can be read."""
    lines = []
    for key in sorted(entries):
        modes = [f"      {json.dumps(m)}: {json.dumps(entries[key][m])}" for m in MODES]
        lines.append(f"    {json.dumps(key)}: {{\n" + ",\n".join(modes) + "\n    }")
    GOLDEN.write_text(
        f'{{\n  "theta_degrees": {THETA},\n  "polygons": {{\n' + ",\n".join(lines) + "\n  }\n}\n"
    )


# --- what is counted ----------------------------------------------------------------------------


def library_graph(polygon: rl.Polygon, mode: str) -> rl.SwitchingGraph:
    sets, switching = mode.split("/")
    return rl.build_switching_graph(polygon, MU, sets=sets, switching=switching)


def counts_of(graph: rl.SwitchingGraph) -> Counts:
    kinds = [s.kind for s in graph.sets]
    counts = {kind: kinds.count(kind) for kind in KINDS[graph.options.sets]}
    return {**counts, "switches": graph.n_switches, "components": len(graph.components())}


def counts_of_reference(graph: ReferenceGraph) -> Counts:
    return {**graph.counts, "switches": len(graph.pairs), "components": graph.n_components}


def keys_of(graph: rl.SwitchingGraph) -> list[Key]:
    return [(s.kind, tuple(s.edges), -1 if s.center is None else s.center) for s in graph.sets]


# --- confirmation -------------------------------------------------------------------------------


def differences(graph: rl.SwitchingGraph, reference: ReferenceGraph) -> list[str]:
    """Where a graph of the chapter's sets and the reference disagree, by name."""
    keys = keys_of(graph)
    found = [f"set {key}" for key in sorted(set(keys) ^ set(reference.vertices))]
    pairs = {frozenset((keys[i], keys[j])) for i in range(len(graph)) for j in graph.neighbors(i)}
    found += [f"switch {sorted(pair)}" for pair in pairs ^ reference.named()]
    if counts_of(graph) != counts_of_reference(reference):
        found.append(f"counts {counts_of(graph)}, reference {counts_of_reference(reference)}")
    return found


def positions(rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Fractions: random ones, eighths, and often an end of the edge."""
    eighths = rng.integers(0, 9, shape) / 8
    ends = rng.integers(0, 2, shape).astype(float)
    which = rng.random(shape)
    return np.where(which < 0.5, rng.random(shape), np.where(which < 0.75, eighths, ends))


def without(edges: tuple[int, ...], edge: int) -> tuple[int, ...]:
    """The others, one occurrence left out."""
    at = edges.index(edge)
    return edges[:at] + edges[at + 1 :]


class Sampler:
    """Random grasps of one object, decided by force closure, against what a graph says of them.

    Parameters
    ----------
    graph : SwitchingGraph
        Sets that hold all grasps of their edges: complete ones, or the chapter's without parallel
        ones (which are left alone).
    grasps : int
        How many grasps each of the three samples may decide, about.
    """

    def __init__(self, graph: rl.SwitchingGraph, *, grasps: int, seed: int = 0) -> None:
        self.graph, self.polygon, self.n = graph, graph.polygon, graph.polygon.n_edges
        self.grasps, self.rng = grasps, np.random.default_rng(seed)
        self.index = {tuple(s.edges): i for i, s in enumerate(graph.sets) if s.kind != "parallel"}
        self.all_triples = graph.options.sets == "complete"
        self.adjacent: dict[int, set[int]] = {}
        self.confirmed: set[tuple[int, int]] = set()
        self.checked = self.by_oracle = 0

    def hold(self, edges: NDArray[np.intp], at: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Force closure; a few of the answers again by the oracle."""
        shape = edges.shape[:-1]
        edges, at = edges.reshape(-1, edges.shape[-1]), at.reshape(-1, at.shape[-1])
        held = rl.is_force_closure(
            self.polygon, friction=self.graph.friction, edges=edges, fractions=at
        )
        yes, no = np.flatnonzero(held), np.flatnonzero(~held)
        for rows, answer in ((yes, True), (no, False)):
            for row in rows[: 1 if self.by_oracle < 40 else 0].tolist():
                self.by_oracle += 1
                contacts = list(zip(edges[row].tolist(), at[row].tolist(), strict=True))
                assert closed(self.polygon, MU, contacts) == answer, contacts
        self.checked += len(held)
        return np.asarray(held.reshape(shape))

    def adjacent_to(self, i: int) -> set[int]:
        if i not in self.adjacent:
            self.adjacent[i] = set(self.graph.neighbors(i))
        return self.adjacent[i]

    def confirm(self, i: int, j: int) -> Iterator[str]:
        """Two sets that were found to share contacts have to be adjacent."""
        if i == j:
            return
        self.confirmed.add((min(i, j), max(i, j)))
        if j not in self.adjacent_to(i):
            keys = [self.graph.sets[k].edges for k in (i, j)]
            yield f"a switch that is not in the graph: {keys}"

    def refutations(self) -> list[str]:
        """Everything found that contradicts the graph."""
        return [
            *self.wrong_witnesses(),
            *self.missing_sets(),
            *self.missing_switches_with_two_held(),
            *self.missing_switches_with_one_held(),
            *self.wrong_switches(),
        ]

    def wrong_witnesses(self) -> Iterator[str]:
        """Witnesses that are no grasps, or on other edges."""
        for m in (2, 3):
            sets = [s for s in self.graph.sets if len(s.edges) == m]
            edges = np.array([s.edges for s in sets], dtype=int).reshape(-1, m)
            grasps = [self.polygon.resolve(s.witness) for s in sets]
            at = np.array([g.fractions for g in grasps]).reshape(-1, m)
            on = np.array([g.edges for g in grasps], dtype=int).reshape(-1, m)
            for k in np.flatnonzero(~self.hold(on, at) | (on != edges).any(axis=1)).tolist():
                yield f"no grasp: the witness of {sets[k].edges}"

    def missing_sets(self) -> Iterator[str]:
        """Grasps in no set: complete sets only, the chapter's miss grasps by design."""
        if not self.all_triples:
            return
        for m in (2, 3):
            edges = np.sort(self.rng.integers(0, self.n, (self.grasps // 2, m)), axis=1)
            held = self.hold(edges, positions(self.rng, edges.shape))
            for found in np.unique(edges[held], axis=0).tolist():
                if tuple(found) not in self.index:
                    yield f"a grasp in no set: edges {found}"

    def missing_switches_with_two_held(self) -> Iterator[str]:
        """Hold two contacts, complete them by a third one in every way that a set allows."""
        places, tries = 60, 12
        groups: dict[tuple[int, ...], dict[int, int]] = {}
        for edges, i in self.index.items():
            for k in range(len(edges) if len(edges) == 3 else 0):
                groups.setdefault(edges[:k] + edges[k + 1 :], {})[edges[k]] = i
        groups = {held: sets for held, sets in groups.items() if len(sets) > 1}
        budget = self.grasps
        for pick in self.rng.permutation(len(groups)).tolist():
            held, sets = list(groups.items())[pick]
            shape = (places, len(sets), tries)
            budget -= math.prod(shape)
            if budget < 0:
                return
            edges = np.empty((*shape, 3), dtype=int)
            edges[..., :2], edges[..., 2] = held, np.array(list(sets))[:, None]
            at = np.empty(edges.shape)
            at[..., :2] = positions(self.rng, (places, 1, 1, 2))
            at[..., 2] = positions(self.rng, shape)
            found, numbers = self.hold(edges, at).any(axis=2).astype(int), list(sets.values())
            for k, other in np.argwhere(np.triu(found.T @ found)).tolist():
                yield from self.confirm(numbers[k], numbers[other])

    def missing_switches_with_one_held(self) -> Iterator[str]:
        """Hold one contact, complete it by one more, and by two more."""
        places, tries, most = 12, 8, 400
        triples = [edges for edges in self.index if len(edges) == 3]
        pairs = [edges for edges in self.index if len(edges) == 2]
        for _ in range(max(1, self.grasps // (places * tries * most))):
            if not pairs or not triples:
                return
            a = int(self.rng.choice(pairs[self.rng.integers(len(pairs))]))
            at_a = positions(self.rng, (places, 1, 1))
            found, sets = [], []
            for m, group in ((2, pairs), (3, triples)):
                group = [edges for edges in group if a in edges]
                chosen = self.rng.permutation(len(group))[:most]
                rest = np.array([without(group[k], a) for k in chosen.tolist()], dtype=int)
                rest = rest.reshape(len(chosen), m - 1)
                edges = np.empty((places, len(chosen), tries, m), dtype=int)
                edges[..., 0], edges[..., 1:] = a, rest[:, None]
                at = positions(self.rng, edges.shape)
                at[..., 0] = at_a
                found.append(self.hold(edges, at).any(axis=2).astype(int))
                sets.append([self.index[group[k]] for k in chosen.tolist()])
            for k, other in np.argwhere(found[0].T @ found[1]).tolist():
                yield from self.confirm(sets[0][k], sets[1][other])

    def wrong_switches(self, several: int = 15) -> Iterator[str]:
        """Witnesses of random adjacent pairs, contact by contact: exactly, by the oracle."""
        sets = self.graph.sets
        for i in self.rng.integers(0, max(1, len(sets)), several if len(sets) else 0).tolist():
            others = [j for j in self.graph.neighbors(i) if j != i]
            if not others:
                continue
            j = int(self.rng.choice(others))
            switch = self.graph.switch(i, j)
            least = max(0, len(sets[i].edges) + len(sets[j].edges) - 4)
            if switch is None or not switch.grasps:
                yield f"no switch for the adjacent pair {sets[i].edges}, {sets[j].edges}"
                continue
            for pair in switch.grasps:
                first, second = (
                    [(c.edge, float(f)) for c, f in zip(g, r.fractions, strict=True)]
                    for g in pair
                    for r in [self.polygon.resolve(g)]
                )
                good = (
                    tuple(sorted(e for e, _ in first)) == tuple(sets[i].edges)
                    and tuple(sorted(e for e, _ in second)) == tuple(sets[j].edges)
                    and len(set(first) & set(second)) >= least
                    and closed(self.polygon, MU, first)
                    and closed(self.polygon, MU, second)
                )
                if not good:
                    yield f"a wrong switch from {first} to {second}"


def confirmed_entry(polygon: rl.Polygon, grasps: int) -> tuple[dict[str, Counts], list[str]]:
    """The counts of the library, and all that speaks against them."""
    entry: dict[str, Counts] = {}
    against: list[str] = []
    two_finger: set[Key] = set()
    for mode in MODES:
        graph = library_graph(polygon, mode)
        entry[mode] = counts_of(graph)
        if mode.startswith("chapter"):
            reference = reference_graph(polygon, MU, mode.split("/")[1])
            against += [f"{mode}: {one}" for one in differences(graph, reference)]
            two_finger = {key for key in reference.vertices if key[0] == "two_finger"}
        else:
            mine = {key for key in keys_of(graph) if key[0] == "two_finger"}
            against += [f"{mode}: set {key}" for key in mine ^ two_finger]
        if mode.endswith("contact"):
            sampler = Sampler(graph, grasps=grasps)
            against += [f"{mode}: {one}" for one in sampler.refutations()]
    return entry, against


def main() -> int:
    parser = argparse.ArgumentParser(description="Write confirmed golden numbers.")
    parser.add_argument("--missing", action="store_true", help="keep entries that are there")
    parser.add_argument("--grasps", type=int, default=400_000, help="grasps of a sample")
    options = parser.parse_args()
    if not any(corpus_folder().glob("*.geojson")):
        print(f"no corpus in {corpus_folder()}: set REGRASP_LP_CORPUS", file=sys.stderr)
        return 1
    old = read_golden() if options.missing and GOLDEN.exists() else {}
    entries: dict[str, dict[str, Counts]] = {}
    refused = 0
    for polygon in polygons_of(MODELS) + polygons_of(corpus_folder()):
        key = key_of(polygon)
        if key in old:
            entries[key] = old[key]
            continue
        started = time.perf_counter()
        entry, against = confirmed_entry(polygon, options.grasps)
        seconds = time.perf_counter() - started
        print(f"{key}: {'refused' if against else 'confirmed'}, {seconds:.1f} s", flush=True)
        for one in against[:5]:
            print(f"    {one}", flush=True)
        if against:
            refused += 1
        else:
            entries[key] = entry
            write_golden(entries)
    write_golden(entries)
    print(f"{len(entries)} polygons written, {refused} refused")
    return 1 if refused else 0


if __name__ == "__main__":
    sys.exit(main())
