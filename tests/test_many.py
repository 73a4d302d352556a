"""Many objects: the graphs of one at a time, from any executor, and what goes wrong on the way."""

from __future__ import annotations

import csv
import gc
import io
import multiprocessing
import os
import pickle
import re
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Iterator
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import contextmanager, suppress
from functools import partial
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY, star_polygon
from geometry import ell, rectangle, unit_square
from hypothesis import given, settings
from hypothesis import strategies as st
from regrasps import nut

import regrasp_lp as rl
from regrasp_lp import build, errors
from regrasp_lp.cli import main
from regrasp_lp.cli.arguments import UsageError, build_parser
from regrasp_lp.cli.progress import ProgressBar
from regrasp_lp.cli.tables import summaries_of
from regrasp_lp.workers import WorkerProcesses

ELL = rl.Polygon(ell().vertices, name="ell")
BLOCK = rl.Polygon(rectangle().vertices, name="block")
SQUARE = rl.Polygon(unit_square().vertices, name="square")
CLOCKWISE = rl.Polygon([(0, 0), (0, 3), (2, 3), (6, 0)], name="clockwise")
OBJECTS = [ELL, BLOCK, nut(), star_polygon(12, 3), CLOCKWISE, star_polygon(9, 1)]
FRICTION = 0.3

posix = pytest.mark.skipif(os.name != "posix", reason="about signals")


@pytest.fixture(scope="module")
def serial() -> list[rl.SwitchingGraph]:
    return [rl.build_switching_graph(polygon, FRICTION) for polygon in OBJECTS]


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessPoolExecutor]:
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as executor:
        yield executor


@pytest.fixture(scope="module")
def workers() -> Iterator[WorkerProcesses]:
    with WorkerProcesses(2) as executor:
        yield executor


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Executor]:
    """Two worker processes of a local Dask cluster."""
    distributed = pytest.importorskip("distributed", reason='needs the extra "dask"')
    import dask

    # workers are started afresh, and import this module to find the functions that it hands out
    here = os.pathsep.join([str(REPOSITORY / "tests"), str(REPOSITORY)])
    settings = {
        "temporary-directory": str(tmp_path_factory.mktemp("dask")),
        "distributed.nanny.pre-spawn-environ.PYTHONPATH": here,
    }
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client.get_executor()


@pytest.fixture(params=["threads", "pool", "workers", "cluster"])
def executor(request: pytest.FixtureRequest) -> Iterator[Executor]:
    if request.param == "threads":
        with ThreadPoolExecutor(2) as threads:
            yield threads
    else:
        yield request.getfixturevalue(request.param)


class Inline(Executor):
    """Calls at once, in this process; counts what has been handed in."""

    def __init__(self) -> None:
        self.calls = 0

    def submit(self, function, /, *arguments, **keywords):  # type: ignore[no-untyped-def]
        self.calls += 1
        future: Future[object] = Future()
        try:
            future.set_result(function(*arguments, **keywords))
        except BaseException as error:
            future.set_exception(error)
        return future


class Patient(Executor):
    """Hands work out, and does of it what and when it is told to."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Future[object], partial[object]]] = []
        self.most = 0

    def submit(self, function, /, *arguments, **keywords):  # type: ignore[no-untyped-def]
        future: Future[object] = Future()
        self.waiting.append((future, partial(function, *arguments, **keywords)))
        self.most = max(self.most, len(self.waiting))
        return future

    def work(self, place: int = 0) -> None:
        future, call = self.waiting.pop(place)
        future.set_result(call())


# --- what the functions of workers do; they have to be found by name ----------------------------


def counted(graph: rl.SwitchingGraph) -> int:
    return len(graph)


class Stubborn(Exception):
    """Cannot be made again from its message."""

    def __init__(self, one: str, other: str) -> None:
        super().__init__(one + other)


def failing(graph: rl.SwitchingGraph) -> int:
    name = graph.polygon.name
    if name == "ell":
        raise rl.NoPlanFound("no way")
    if name == "nut":
        raise Stubborn("cannot ", "travel")
    return len(graph)


def deadly(graph: rl.SwitchingGraph) -> tuple[str, int]:
    if graph.polygon.name == "nut":
        os.kill(os.getpid(), signal.SIGKILL)
    return graph.polygon.name, os.getpid()


def deadly_once(folder: str, graph: rl.SwitchingGraph) -> int:
    mark = Path(folder) / "has died"
    if graph.polygon.name == "nut" and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return len(graph)


def hidden(graph: rl.SwitchingGraph) -> object:
    return lambda: graph


# --- the same graphs, however they are built ----------------------------------------------------


def assert_same(graph: rl.SwitchingGraph, other: rl.SwitchingGraph) -> None:
    assert graph == other
    assert graph.polygon.input_edge.tolist() == other.polygon.input_edge.tolist()
    for one, again in zip(graph.sets.families, other.sets.families, strict=True):
        for name in ("slot", "ray", "weight", "scale"):
            first, second = getattr(one.functions, name), getattr(again.functions, name)
            assert np.array_equal(first, second)
            assert first.dtype == second.dtype
    start, goal = graph.sets[0].witness, graph.sets[len(graph) - 1].witness
    assert graph.plan(start, goal).to_json() == other.plan(start, goal).to_json()


def test_here(serial: list[rl.SwitchingGraph]) -> None:
    built = list(rl.build_switching_graphs(OBJECTS, FRICTION))
    assert [one.index for one in built] == list(range(len(OBJECTS)))
    for one, polygon, graph in zip(built, OBJECTS, serial, strict=True):
        assert one.polygon is polygon
        assert (one.name, one.error) == (polygon.name, None)
        assert one.graph is one.value
        assert_same(graph, one.graph)


def test_everywhere(executor: Executor, serial: list[rl.SwitchingGraph]) -> None:
    built = {one.index: one for one in rl.build_switching_graphs(OBJECTS, FRICTION, executor)}
    assert sorted(built) == list(range(len(OBJECTS)))
    for index, graph in enumerate(serial):
        assert built[index].polygon is OBJECTS[index]
        assert_same(graph, built[index].graph)


def test_options_arrive(workers: WorkerProcesses) -> None:
    options = {
        "hand": rl.Hand(5),
        "sets": "chapter",
        "min_margin": 0.01,
        "solver": "highs",
        "presolve": False,
    }
    polygons = [SQUARE, star_polygon(7, 2)]
    mu = [[0.2, 0.3, 0.4, 0.5], 0.25]
    for executor in (None, workers):
        for one in rl.build_switching_graphs(polygons, mu, executor, **options):
            expected = rl.build_switching_graph(one.polygon, mu[one.index], **options)
            assert one.graph == expected
            assert one.graph.options == expected.options
    chapter = {"sets": "chapter", "switching": "focus"}
    (one,) = rl.build_switching_graphs([ELL], FRICTION, workers, **chapter)
    assert one.graph == rl.build_switching_graph(ELL, FRICTION, **chapter)


def test_apply(executor: Executor, serial: list[rl.SwitchingGraph]) -> None:
    found = rl.build_switching_graphs(
        OBJECTS, FRICTION, executor, apply=rl.SwitchingGraph.summary, ordered=True
    )
    for one, graph in zip(found, serial, strict=True):
        mine, theirs = graph.summary(), one.value
        assert (mine.kinds, mine.n_switches) == (theirs.kinds, theirs.n_switches)
        assert (mine.components, mine.name) == (theirs.components, theirs.name)


def test_switches_on_demand_travel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their rule is a function inside a function, which cannot be pickled."""
    monkeypatch.setattr(build, "STORE_LIMIT", 0)
    for graph in (
        rl.build_switching_graph(ELL, FRICTION),
        rl.build_switching_graph(ELL, FRICTION, sets="chapter", switching="focus"),
    ):
        again = pickle.loads(pickle.dumps(graph))
        assert_same(graph, again)
        assert again.to_networkx().edges == graph.to_networkx().edges
        assert again.seconds == graph.seconds


def test_graphs_are_small_to_send(stars: dict[str, rl.Polygon]) -> None:
    graph = rl.build_switching_graph(stars["star_25"], 0.1763)
    graph.components()  # what has been found out since is not sent
    weights = sum(family.functions.weight.nbytes for family in graph.sets.families)
    assert len(pickle.dumps(graph)) < weights


def test_nothing_to_build(workers: WorkerProcesses) -> None:
    for executor in (None, workers):
        assert list(rl.build_switching_graphs([], FRICTION, executor)) == []
        assert list(rl.build_switching_graphs(iter(()), [], executor, ordered=True)) == []


def test_names() -> None:
    polygons = [rl.Polygon([(0, 0), (1, 0), (0, 1)]), ELL]
    names = [one.name for one in rl.build_switching_graphs(polygons, FRICTION)]
    assert names == ["polygon 0", ELL.name]


# --- order and memory ---------------------------------------------------------------------------


@given(st.permutations(range(5)), st.integers(1, 7), st.booleans(), st.data())
@settings(max_examples=60)
def test_any_order_of_completion(
    order: list[int], in_flight: int, ordered: bool, data: st.DataObject
) -> None:
    """Whatever is done first, all come once, in order if asked, and never too many are out."""
    polygons = [TRIANGLES[k] for k in order]
    executor = Patient()
    taken = []

    def source() -> Iterator[rl.Polygon]:
        for polygon in polygons:
            taken.append(polygon)
            yield polygon

    class Waited:
        """Stands for `wait`: one of the pending is done now, whichever."""

        def __call__(self, pending: dict[Future[object], object], return_when: str) -> Waited:
            executor.work(data.draw(st.integers(0, len(executor.waiting) - 1)))
            self.done = {future for future in pending if future.done()}
            return self

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("regrasp_lp.many.wait", Waited())
        patch.setattr("regrasp_lp.many.build_switching_graph", lambda polygon, *_, **__: polygon)
        found = []
        for one in rl.build_switching_graphs(
            source(), FRICTION, executor, ordered=ordered, in_flight=in_flight
        ):
            found.append(one.index)
            assert one.value is polygons[one.index]
            assert len(taken) - len(found) <= in_flight
    assert executor.most <= in_flight
    assert sorted(found) == list(range(5))
    if ordered:
        assert found == sorted(found)


TRIANGLES = [rl.Polygon([(0, 0), (k + 1, 0), (0, 1)], name=f"t{k}") for k in range(5)]


def endless() -> Iterator[rl.Polygon]:
    return (rl.Polygon([(0, 0), (k, 0), (0, 1)], name=f"t{k}") for k in count(1))


@pytest.mark.parametrize("ordered", [False, True])
def test_polygons_are_taken_as_needed(executor: Executor, ordered: bool) -> None:
    taken: list[str] = []

    def source() -> Iterator[rl.Polygon]:
        for polygon in endless():
            taken.append(polygon.name)
            yield polygon

    results = rl.build_switching_graphs(
        source(), FRICTION, executor, apply=counted, ordered=ordered, in_flight=3
    )
    assert taken == []
    for number in range(1, 8):
        assert next(results).value >= 1
        assert len(taken) <= number + 3
    results.close()
    assert len(taken) <= 7 + 3


def test_here_polygons_are_taken_one_at_a_time() -> None:
    source = endless()
    results = rl.build_switching_graphs(source, FRICTION)
    next(results)
    next(results)
    assert next(source).name == "t3"


@pytest.mark.parametrize("ordered", [False, True])
def test_nothing_that_was_yielded_is_kept(ordered: bool) -> None:
    for executor in (None, Inline()):
        results = rl.build_switching_graphs(endless(), FRICTION, executor, ordered=ordered)
        one = next(results)
        graph = weakref.ref(one.graph)
        assert graph() is not None
        del one
        gc.collect()
        assert graph() is None
        results.close()


def test_twice_the_workers_are_in_flight() -> None:
    executor = Inline()
    assert next(rl.build_switching_graphs(endless(), FRICTION, executor)).graph
    assert executor.calls in (2 * (os.cpu_count() or 1), 2 * (os.cpu_count() or 1) + 1)
    with ThreadPoolExecutor(3) as threads:
        source = endless()
        results = rl.build_switching_graphs(source, FRICTION, threads, apply=counted)
        next(results)
        results.close()
    assert next(source).name in ("t7", "t8")


# --- what goes wrong ----------------------------------------------------------------------------


def test_an_error_is_one_object_s_own(executor: Executor) -> None:
    found = rl.build_switching_graphs(OBJECTS, FRICTION, executor, apply=failing, ordered=True)
    for one in found:
        if one.name == OBJECTS[0].name:
            assert isinstance(one.error, rl.NoPlanFound)
            assert one.error.explanation == "no way"
        elif one.name == OBJECTS[2].name:
            assert "cannot travel" in str(one.error)
            if isinstance(executor, (ProcessPoolExecutor, WorkerProcesses)):
                # Dask teaches pickle to send any error, but these have never heard of it
                assert type(one.error) is rl.RegraspError
                assert str(one.error) == "Stubborn: cannot travel"
        else:
            assert one.error is None
            assert one.value > 0
            continue
        assert one.value is None
        with pytest.raises(type(one.error)):
            _ = one.graph


def test_an_error_here() -> None:
    found = list(rl.build_switching_graphs(OBJECTS, FRICTION, apply=failing))
    assert [type(one.error).__name__ for one in found] == [
        *("NoPlanFound", "NoneType", "Stubborn", "NoneType", "NoneType", "NoneType")
    ]


def test_bad_friction_of_one_object(workers: WorkerProcesses) -> None:
    for executor in (None, workers):
        found = rl.build_switching_graphs(
            [ELL, ELL, SQUARE], [0.3, [0.3, 0.4], 0.4], executor, ordered=True
        )
        assert [type(one.error) for one in found] == [type(None), rl.FrictionError, type(None)]


def test_what_cannot_be_sent_is_an_error(workers: WorkerProcesses, pool: Executor) -> None:
    for executor in (workers, pool):
        for one in rl.build_switching_graphs(OBJECTS[:2], FRICTION, executor, apply=hidden):
            assert one.error is not None
            # what Python says differs between its versions
            assert re.search("pickle|local object", str(one.error))


def test_all_our_errors_can_be_pickled() -> None:
    made = [errors.MissingExtraError("matplotlib", "plot", "drawing"), UsageError("prog", "what")]
    for name in dir(errors):
        kind = getattr(errors, name)
        if isinstance(kind, type) and issubclass(kind, rl.RegraspError):
            made += [kind("why")] if kind is not errors.MissingExtraError else []
    assert len(made) >= 12
    for error in made:
        error.add_note("while it was built")
        again = pickle.loads(pickle.dumps(error))
        assert type(again) is type(error)
        assert (str(again), again.args, vars(again)) == (str(error), error.args, vars(error))


@posix
def test_a_dead_process_takes_no_others_with_it(workers: WorkerProcesses) -> None:
    found = list(rl.build_switching_graphs(OBJECTS, FRICTION, workers, apply=deadly))
    assert sorted(one.index for one in found) == list(range(len(OBJECTS)))
    for one in found:
        if one.name == "nut":
            assert isinstance(one.error, BrokenExecutor)
            assert "abruptly, twice" in str(one.error)
        else:
            assert one.value[0] == one.name
            assert one.value[1] != os.getpid()


@posix
def test_a_process_that_dies_once_costs_nothing(workers: WorkerProcesses, tmp_path: Path) -> None:
    apply = partial(deadly_once, str(tmp_path))
    found = rl.build_switching_graphs(OBJECTS, FRICTION, workers, apply=apply, ordered=True)
    expected = [len(rl.build_switching_graph(polygon, FRICTION)) for polygon in OBJECTS]
    assert [one.value for one in found] == expected
    assert (tmp_path / "has died").exists()


@posix
def test_a_pool_that_is_broken_for_good() -> None:
    """Every object is named, also those that could not be handed in any more."""
    with WorkerProcesses(1) as inner:
        plain = inner._pool
        polygons = [nut(), *OBJECTS[3:], nut()]
        found = list(
            rl.build_switching_graphs(polygons, FRICTION, plain, apply=deadly, in_flight=2)
        )
    assert sorted(one.index for one in found) == list(range(len(polygons)))
    assert all(isinstance(one.error, BrokenExecutor) for one in found)
    assert len({id(one.error) for one in found}) == len(found)
    assert all("takes no more work" in str(one.error) for one in found)


@posix
def test_a_cluster_replaces_its_dead(cluster: Executor, tmp_path: Path) -> None:
    apply = partial(deadly_once, str(tmp_path))
    found = rl.build_switching_graphs(OBJECTS, FRICTION, cluster, apply=apply, ordered=True)
    assert [one.error for one in found] == [None] * len(OBJECTS)
    assert (tmp_path / "has died").exists()


# --- stopping -----------------------------------------------------------------------------------


def test_leaving_early_cancels() -> None:
    executor = Patient()
    results = rl.build_switching_graphs(endless(), FRICTION, executor, in_flight=4)
    futures = []

    def wait(pending: dict[Future[object], object], return_when: str) -> object:
        futures.extend(pending)
        executor.work()
        return type("Waited", (), {"done": [future for future in pending if future.done()]})

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("regrasp_lp.many.wait", wait)
        next(results)
    results.close()
    futures += [future for future, _ in executor.waiting]
    assert len(set(futures)) == 4
    assert [future.cancelled() for future in futures[1:4]] == [True] * 3
    assert executor.submit(len, "open").cancel()  # and the executor still takes work


@pytest.mark.parametrize("stop", [KeyboardInterrupt, ZeroDivisionError])
def test_what_polygons_raise_is_raised_and_cancels(stop: type[BaseException]) -> None:
    executor = Patient()

    def source() -> Iterator[rl.Polygon]:
        yield from OBJECTS[:2]
        raise stop

    with pytest.raises(stop):
        list(rl.build_switching_graphs(source(), FRICTION, executor))
    assert [future.cancelled() for future, _ in executor.waiting] == [True, True]


def test_an_interrupt_elsewhere_is_one_here() -> None:
    """As when Ctrl-C reaches the processes of a pool, too."""

    class Interrupted(Inline):
        def submit(self, *arguments, **keywords):  # type: ignore[no-untyped-def]
            future = super().submit(int)
            if self.calls == 2:
                future = Future()
                future.set_exception(KeyboardInterrupt())
            return future

    with pytest.raises(KeyboardInterrupt):
        list(rl.build_switching_graphs(OBJECTS, FRICTION, Interrupted()))


def test_an_executor_that_somebody_shuts_down() -> None:
    class Closed(Patient):
        def submit(self, *arguments, **keywords):  # type: ignore[no-untyped-def]
            future = super().submit(*arguments, **keywords)
            future.cancel()
            future.set_running_or_notify_cancel()
            return future

    found = list(rl.build_switching_graphs(OBJECTS[:2], FRICTION, Closed()))
    assert [type(one.error) for one in found] == [CancelledError] * 2
    threads = ThreadPoolExecutor(1)
    threads.shutdown()
    with pytest.raises(RuntimeError, match="after shutdown"):
        next(rl.build_switching_graphs(OBJECTS, FRICTION, threads))


# --- arguments that mean nothing ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"sets": "all"}, rl.OptionError, 'sets must be "complete"'),
        ({"solver": "glpk"}, rl.OptionError, "solver must be"),
        ({"switching": "focus"}, rl.OptionError, "is defined for the chapter's sets"),
        ({"min_margin": -1}, rl.OptionError, "min_margin must be"),
        ({"hand": 4}, rl.HandError, "hand must be a Hand"),
        ({"friction": -1}, rl.FrictionError, "friction must be a positive"),
        ({"friction": "high"}, rl.FrictionError, "a number or a sequence of numbers"),
        ({"friction": None}, rl.FrictionError, "friction must be"),
        ({"friction": np.array(-0.5)}, rl.FrictionError, "friction must be"),
        ({"friction": [0.3] * 5}, rl.FrictionError, "5 entries for 6 polygons"),
        ({"polygons": ELL}, rl.OptionError, "must be an iterable of Polygon"),
        ({"executor": 4}, rl.OptionError, "executor must be a concurrent.futures.Executor"),
        ({"in_flight": 0}, rl.OptionError, "in_flight must be"),
        ({"in_flight": True}, rl.OptionError, "in_flight must be"),
        ({"in_flight": 2.0}, rl.OptionError, "in_flight must be"),
    ],
    ids=str,
)
def test_bad_arguments(changes: dict[str, object], error: type[Exception], message: str) -> None:
    arguments = {"polygons": OBJECTS, "friction": FRICTION, "executor": Inline(), **changes}
    with pytest.raises(error, match=message):
        rl.build_switching_graphs(**arguments)
    assert getattr(arguments["executor"], "calls", 0) == 0


@pytest.mark.parametrize("executor", [None, Inline()])
@pytest.mark.parametrize(
    ("polygons", "friction", "message"),
    [
        ([ELL, 3], FRICTION, "number 1 is 3"),
        ([ELL, ELL], [0.3], "friction has only 1 entries"),
        ([ELL], [0.3, 0.3], r"more entries than there are polygons \(1\)"),
        ([], [0.3], r"more entries than there are polygons \(0\)"),
    ],
    ids=str,
)
def test_bad_items(
    executor: Executor | None, polygons: list[object], friction: object, message: str
) -> None:
    with pytest.raises(rl.RegraspError, match=message):
        list(rl.build_switching_graphs(iter(polygons), friction, executor))


@pytest.mark.parametrize("number", [0, -1, 2.0, True, "2"])
def test_bad_numbers_of_workers(number: object) -> None:
    with pytest.raises(rl.OptionError, match="workers must be a whole number"):
        WorkerProcesses(number)


@pytest.mark.parametrize("mu", [0.3, np.float64(0.3), np.float32(0.25), 1, np.array(0.3)])
def test_one_friction_for_all(mu: object) -> None:
    for one in rl.build_switching_graphs(OBJECTS[:2], mu, Inline()):
        assert one.graph == rl.build_switching_graph(one.polygon, mu)


# --- progress -----------------------------------------------------------------------------------


def test_progress_counts_objects() -> None:
    told: list[tuple[str, int, int]] = []
    for polygons, total in ((OBJECTS[:3], 3), (iter(OBJECTS[:3]), 0)):
        told.clear()
        list(
            rl.build_switching_graphs(
                polygons, FRICTION, Inline(), progress=lambda *what: told.append(what)
            )
        )
        of = " of 3" if total else ""
        assert told == [(f"{k}{of} polygons", k, total) for k in range(4)]


def test_progress_here_names_the_object() -> None:
    told: list[str] = []
    list(
        rl.build_switching_graphs(
            [ELL, SQUARE],
            FRICTION,
            apply=counted,
            progress=lambda what, *_: told.append(what),
        )
    )
    assert {what.split(": ")[0] for what in told} == {"ell (1 of 2)", "square (2 of 2)"}
    steps = {what.split(": ")[1] for what in told}
    assert {"grasp sets", "three_finger margins", "switches", "finishing"} <= steps


# --- the command line ---------------------------------------------------------------------------

PARTS = str(REPOSITORY / "models" / "workpieces.geojson")
LONG = [str(REPOSITORY / "models"), "--sets", "complete", "--friction", "0.7"]


@contextmanager
def started(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A table in a session of its own, of which nothing is left behind if a test fails."""
    # a shell has what it starts in the background ignore interrupts, and so what these start
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    process = subprocess.Popen(
        [sys.executable, "-m", "regrasp_lp", "table", *arguments, "--jobs", "2"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        start_new_session=True,
    )
    signal.signal(signal.SIGINT, before)
    try:
        yield process
    finally:
        for one in running(process.pid):
            with suppress(ProcessLookupError):  # has just ended
                os.kill(one, signal.SIGKILL)
        process.communicate()


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(text.splitlines()))


def test_table_with_two_jobs_is_the_same() -> None:
    polygons = [p for p in rl.read_polygons(PARTS) if p.n_edges < 10]
    for some, jobs in ((polygons, "2"), (polygons[:2], "1000"), (polygons[:1], "2")):
        found = []
        for number in ("1", jobs):
            options = build_parser().parse_args(["table", PARTS, "--jobs", number])
            summaries, failures = summaries_of(some, options)
            assert failures == []
            found.append([(s.name, s.kinds, s.n_switches, s.components) for s in summaries])
        assert found[0] == found[1]
        assert [row[0] for row in found[0]] == [p.name for p in some]


def running(session: int) -> list[int]:
    """The processes of a session that are not yet dead."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, of = path.read_text().rsplit(")", 1)[1].split()[:4]
        except OSError:  # has just ended
            continue
        if int(of) == session and state not in "ZX":
            found.append(int(path.parent.name))
    return found


def wait_until(condition: object, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:  # type: ignore[operator]
        time.sleep(0.01)
    assert condition()  # type: ignore[operator]


needs_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks into /proc")


@needs_proc
@pytest.mark.parametrize(("everybody", "later"), [(True, 0.0), (False, 0.8)])
def test_an_interrupt_ends_all_at_once(everybody: bool, later: float) -> None:
    """While processes start, and while they work; of one process, or, as Ctrl-C, of all."""
    with started(*LONG) as process:
        wait_until(lambda: len(running(process.pid)) >= 3)  # one of them keeps semaphores in order
        time.sleep(later)
        sent = time.monotonic()
        (os.killpg if everybody else os.kill)(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=30)
        assert time.monotonic() - sent < 5
        assert (process.returncode, out) == (130, "")
        # a thread of the pool may complain of the futures that were cancelled under it
        assert err.endswith("regrasp-lp: interrupted\n")
        wait_until(lambda: not running(process.pid), 5)


@needs_proc
def test_no_process_outlives_one_that_is_killed() -> None:
    with started(*LONG) as process:
        wait_until(lambda: len(running(process.pid)) == 4)
        time.sleep(0.5)
        process.kill()
        process.communicate(timeout=30)
        wait_until(lambda: not running(process.pid))


@needs_proc
def test_table_names_what_a_dead_process_took(tmp_path: Path) -> None:
    """A worker that is killed twice over one polygon costs that one only."""
    script = tmp_path / "deadly.py"
    script.write_text(
        "import os, signal, sys\n"
        "import regrasp_lp.many\n"
        "from regrasp_lp.cli import main\n"
        "original = regrasp_lp.many.build_switching_graph\n"
        "def build(polygon, *rest, **options):\n"
        "    if polygon.name == 'push_t':\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    if polygon.name == 'wedge':\n"
        "        raise ZeroDivisionError('no wedges')\n"
        "    return original(polygon, *rest, **options)\n"
        "regrasp_lp.many.build_switching_graph = build\n"
        "if __name__ == '__main__':\n"
        "    sys.exit(main())\n"
    )
    command = [sys.executable, str(script), "table", PARTS, "--jobs=2", "--format=csv"]
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    done = subprocess.run(
        [*command, "--max-edges=10"],
        capture_output=True,
        text=True,
        env=environment,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    _, push_t, wedge = done.stderr.splitlines()
    assert re.search("error: push_t: the process .* abruptly, twice", push_t)
    assert wedge.endswith("error: wedge: ZeroDivisionError: no wedges")
    names = [p.name for p in rl.read_polygons(PARTS) if p.n_edges <= 10]
    left = [name for name in names if name not in ("push_t", "wedge")]
    assert [row["name"] for row in rows(done.stdout)] == left


def test_the_bar_counts_polygons(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True, raising=False)
    original = ProgressBar.__init__
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("regrasp_lp.cli.progress._REDRAW", 0.001)
    monkeypatch.setattr(ProgressBar, "__init__", lambda bar: original(bar, terminal, after=0.0))
    assert main(["table", PARTS, "--jobs", "2", "--max-edges", "10"]) == 0
    drawn = terminal.getvalue().split("\r")
    assert any(re.match(r"[1-5] of 6 polygons  \[#+\.+\]  ", line) for line in drawn)
    assert max(map(len, drawn)) < 80
    assert drawn[-2].strip() == drawn[-1] == ""


def test_permutations_of_the_input_change_nothing(serial: list[rl.SwitchingGraph]) -> None:
    for order in [(1, 2, 0), (2, 1, 0)]:
        polygons = [OBJECTS[k] for k in order]
        found = rl.build_switching_graphs(polygons, FRICTION, Inline(), ordered=True)
        assert [one.graph == serial[k] for one, k in zip(found, order, strict=True)] == [True] * 3
