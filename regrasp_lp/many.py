"""The switching graphs of many objects: here, in several processes, or on a cluster."""

from __future__ import annotations

import os
import pickle
import secrets
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sized
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from dataclasses import dataclass, replace
from itertools import repeat
from numbers import Real
from typing import Any

from numpy.typing import ArrayLike

from regrasp_lp.build import build_switching_graph, check_options
from regrasp_lp.errors import FrictionError, OptionError, RegraspError
from regrasp_lp.friction import per_edge_friction
from regrasp_lp.grasp_sets.vertices import Progress
from regrasp_lp.planning.hand import Hand
from regrasp_lp.polygon import Polygon
from regrasp_lp.switching_graph import SwitchingGraph

Apply = Callable[[SwitchingGraph], Any]

_LOST_TWICE = "the process that worked on it has ended abruptly, twice: killed, or out of memory"
_REFUSED = (
    "a process of the executor has ended abruptly (killed, or out of memory), and the executor "
    "takes no more work"
)


@dataclass(frozen=True, eq=False)
class Built:
    """What became of one of many objects.

    Parameters
    ----------
    index : int
        The place of the object in the input, from 0.
    polygon : Polygon
        The object, as it was given.
    value : object
        Its `SwitchingGraph`, or what `apply` returned for that; None if it failed.
    error : Exception or None
        Why there is no value.
    """

    index: int
    polygon: Polygon
    value: Any = None
    error: Exception | None = None

    @property
    def name(self) -> str:
        """The name of the polygon; of one without, its place in the input."""
        return _name(self.index, self.polygon)

    @property
    def graph(self) -> SwitchingGraph:
        """The value, which without `apply` is the graph; raises `error` if there is one."""
        if self.error is not None:
            raise self.error
        graph: SwitchingGraph = self.value
        return graph


def build_switching_graphs(
    polygons: Iterable[Polygon],
    friction: float | Iterable[ArrayLike],
    executor: Executor | None = None,
    *,
    hand: Hand | None = None,
    sets: str = "complete",
    switching: str = "contact",
    min_margin: float = 0.0,
    solver: str = "clarabel",
    presolve: bool = True,
    apply: Apply | None = None,
    ordered: bool = False,
    in_flight: int | None = None,
    progress: Progress | None = None,
) -> Generator[Built, None, None]:
    """Build the switching graphs of many objects; yield each as soon as it is there.

    The graphs are those that `build_switching_graph` returns, bit for bit, wherever they are built.
    What is wrong with one object is in its `Built.error`, and the others go on. If the process that
    an object was built in dies, all objects whose work is lost are tried once more, one at a time,
    if the executor still takes work (a plain pool of processes does not, and every further object
    has that error; `regrasp_lp.workers.WorkerProcesses` does).

    Memory is bounded: `polygons` is read no further than needed, at most `in_flight` objects are
    with the executor or wait to be yielded, and nothing is kept that was. Leave the loop early, or
    close the generator, and what has not begun is cancelled; the executor stays open.

    Parameters
    ----------
    polygons : iterable of Polygon
        Also one that makes them on the way.
    friction : float or iterable
        μ: one number for all edges of all objects, or an iterable with one entry for each object,
        each of them as `build_switching_graph` takes it (a number, or a sequence with one value
        per edge).
    executor : concurrent.futures.Executor, optional
        Where to build: a ``ProcessPoolExecutor``, ``dask.distributed.Client(...).get_executor()``,
        a `WorkerProcesses`...; in this process by default, one after the other.
    hand, sets, switching, min_margin, solver, presolve
        As for `build_switching_graph`, the same for all objects.
    apply : callable, optional
        Called with each graph where that was built, so that only what it returns has to travel:
        `SwitchingGraph.summary`, say. Other processes have to be able to import it.
    ordered : bool
        Yield in the order of the input. Until a slow object is done those after it wait, and no
        more than `in_flight` are looked at.
    in_flight : int, optional
        Most objects at a time: twice the workers of the executor if it tells how many, or else
        twice the processors of this machine (give twice the workers of a cluster).
    progress : callable, optional
        Called as ``progress(what, done, total)``. With an executor it counts objects (`total` is 0
        while nobody knows it); without one it tells the steps of each object, named.

    Yields
    ------
    Built

    Raises
    ------
    OptionError, HandError, FrictionError
        If an argument has no meaning for any object; before anything is built, except where an
        iterable turns out on the way to hold something that is no polygon, or to have too few or
        too many values of friction.

    Examples
    --------
    >>> square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)], name="square")
    >>> wedge = Polygon([(0, 0), (4, 0), (4, 3)], name="wedge")
    >>> for built in build_switching_graphs([square, wedge], 0.5, ordered=True):
    ...     print(built.index, built.name, len(built.graph))
    0 square 10
    1 wedge 4
    """
    options = {
        "hand": check_options(hand, sets, switching, min_margin, solver),
        "sets": sets,
        "switching": switching,
        "min_margin": min_margin,
        "solver": solver,
        "presolve": presolve,
    }
    if not isinstance(polygons, Iterable):
        raise OptionError(f"polygons must be an iterable of Polygon, got {polygons!r}")
    total = len(polygons) if isinstance(polygons, Sized) else 0
    tasks = _tasks(polygons, _frictions(friction, polygons))
    work = _Work(options, apply)
    if in_flight is None:
        in_flight = 2 * (getattr(executor, "_max_workers", None) or os.cpu_count() or 1)
    if isinstance(in_flight, bool) or not isinstance(in_flight, int) or in_flight < 1:
        raise OptionError(f"in_flight must be a whole number of at least 1, got {in_flight!r}")
    if executor is None:
        return _one_by_one(tasks, work, total, progress)
    if not isinstance(executor, Executor):
        raise OptionError(
            f"executor must be a concurrent.futures.Executor or None, got {executor!r}"
        )
    return _Crowd(tasks, work, executor, in_flight, ordered, total, progress).run()


# --- what is to be done -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Task:
    """One object; `again` if the process that worked on it has died before."""

    index: int
    polygon: Polygon
    friction: ArrayLike
    again: bool = False

    def built(self, value: Any = None, error: Exception | None = None) -> Built:
        return Built(self.index, self.polygon, value, error)


@dataclass(frozen=True)
class _Work:
    """What is done with every object."""

    options: dict[str, Any]
    apply: Apply | None

    def __call__(
        self, polygon: Polygon, friction: ArrayLike, progress: Progress | None = None
    ) -> Any:
        graph = build_switching_graph(polygon, friction, progress=progress, **self.options)
        if self.apply is None:
            return graph
        if progress is not None:
            progress("finishing", 0, 0)
        return self.apply(graph)


def _elsewhere(work: _Work, polygon: Polygon, friction: ArrayLike, _: str) -> Any:
    """Do the work in another process, and raise only what can be sent from there."""
    try:
        return work(polygon, friction)
    except Exception as error:
        if _can_travel(error):
            raise
        # what cannot be unpickled would end the pool, and with it the work on other objects
        raise RegraspError(f"{type(error).__name__}: {error}") from error


def _can_travel(error: Exception) -> bool:
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # whatever the class of the error does when it is pickled
        return False
    return True


def _name(index: int, polygon: Polygon) -> str:
    return polygon.name or f"polygon {index}"


def _frictions(friction: Any, polygons: Iterable[Polygon]) -> Iterator[ArrayLike]:
    """Return the friction of each object, after checking the one for all."""
    each = isinstance(friction, Iterable) and not isinstance(friction, (str, bytes))
    if isinstance(friction, Real) or not each or getattr(friction, "ndim", 1) == 0:
        per_edge_friction(friction, 1)
        return repeat(friction)
    entries, objects = (len(s) if isinstance(s, Sized) else None for s in (friction, polygons))
    if entries is not None and objects is not None and entries != objects:
        raise FrictionError(
            f"friction has {entries} entries for {objects} polygons: give one number for all, or "
            "one entry for each"
        )
    return iter(friction)


def _tasks(polygons: Iterable[Polygon], frictions: Iterator[ArrayLike]) -> Iterator[_Task]:
    index = -1
    for index, polygon in enumerate(polygons):
        if not isinstance(polygon, Polygon):
            raise OptionError(f"polygons must be Polygon, but number {index} is {polygon!r}")
        for friction in frictions:
            yield _Task(index, polygon, friction)
            break
        else:
            raise FrictionError(f"friction has only {index} entries: give one for each polygon")
    if not isinstance(frictions, repeat):
        for _ in frictions:
            raise FrictionError(
                f"friction has more entries than there are polygons ({index + 1}): give one for "
                "each polygon"
            )


# --- in this process ----------------------------------------------------------------------------


def _one_by_one(
    tasks: Iterator[_Task], work: _Work, total: int, progress: Progress | None
) -> Generator[Built, None, None]:
    for task in tasks:
        yield _built_here(task, work, total, progress)


def _built_here(task: _Task, work: _Work, total: int, progress: Progress | None) -> Built:
    head = f"{_name(task.index, task.polygon)} ({task.index + 1}"
    head += f" of {total})" if total else ")"

    def tell(what: str, done: int, steps: int) -> None:
        if progress is not None:
            progress(f"{head}: {what}", done, steps)

    tell("grasp sets", 0, 0)
    try:
        return task.built(work(task.polygon, task.friction, tell))
    except Exception as error:
        return task.built(error=error)


# --- elsewhere ----------------------------------------------------------------------------------


class _Crowd:
    """Objects on their way through an executor.

    Every object that was read is in exactly one of three places: `pending` (with the executor),
    `lost` (with a process that died; to be tried again) or `ready` (to be yielded).
    """

    def __init__(
        self,
        tasks: Iterator[_Task],
        work: _Work,
        executor: Executor,
        in_flight: int,
        ordered: bool,
        total: int,
        progress: Progress | None,
    ) -> None:
        self._tasks = tasks
        self._work = work
        self._executor = executor
        self._in_flight = in_flight
        self._ordered = ordered
        self._total = total
        self._progress = progress
        self._pending: dict[Future[Any], _Task] = {}
        self._lost: deque[_Task] = deque()
        self._ready: dict[int, Built] = {}
        self._done = 0  # objects whose outcome is known
        self._yielded = 0

    def run(self) -> Generator[Built, None, None]:
        """Yield all objects; however that ends, nothing that has not begun will."""
        self._tell()
        try:
            while self._advance():
                yield self._take()  # in no variable: nothing that was yielded is kept
        finally:
            for future in self._pending:
                future.cancel()

    def _advance(self) -> bool:
        """Go on until there is an object to yield; return whether there is one."""
        self._fill()
        while not self._due:
            if not self._pending:
                return False
            self._collect()
            self._fill()
        return True

    @property
    def _due(self) -> bool:
        return self._yielded in self._ready if self._ordered else bool(self._ready)

    def _take(self) -> Built:
        index = self._yielded if self._ordered else next(iter(self._ready))
        self._yielded += 1
        return self._ready.pop(index)

    def _fill(self) -> None:
        """Hand out work while there is room.

        What a dead process worked on is tried again alone: if one of them is the cause, it takes no
        others with it.
        """
        while True:
            if self._lost or any(task.again for task in self._pending.values()):
                if self._pending:
                    return
                self._submit(self._lost.popleft())
            elif len(self._pending) + len(self._ready) < self._in_flight:
                task = next(self._tasks, None)
                if task is None:
                    return
                self._submit(task)
            else:
                return

    def _submit(self, task: _Task) -> None:
        # Dask takes equal calls for one, whose result is lost to all if one of them is cancelled
        unique = secrets.token_hex(16)
        try:
            future = self._executor.submit(
                _elsewhere, self._work, task.polygon, task.friction, unique
            )
        except BrokenExecutor as error:
            self._finish(task.built(error=_death(_REFUSED, error)))
        else:
            self._pending[future] = task

    def _collect(self) -> None:
        for future in wait(self._pending, return_when=FIRST_COMPLETED).done:
            task = self._pending.pop(future)
            try:
                error = future.exception()
            except CancelledError as cancelled:  # by somebody else: an executor that is shut down
                error = cancelled
            if isinstance(error, BrokenExecutor):
                if task.again:
                    self._finish(task.built(error=_death(_LOST_TWICE, error)))
                else:
                    self._lost.append(replace(task, again=True))
            elif error is None:
                self._finish(task.built(future.result()))
            elif isinstance(error, Exception):
                self._finish(task.built(error=error))
            else:  # an interrupt that reached another process is one of the whole
                raise error

    def _finish(self, built: Built) -> None:
        self._ready[built.index] = built
        self._done += 1
        self._tell()

    def _tell(self) -> None:
        if self._progress is not None:
            of = f" of {self._total}" if self._total else ""
            self._progress(f"{self._done}{of} polygons", self._done, self._total)


def _death(message: str, error: BrokenExecutor) -> BrokenExecutor:
    """Return an error of one object's own; that of a pool is one for all its work."""
    death = BrokenExecutor(message)
    death.__cause__ = error
    return death
