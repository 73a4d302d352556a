"""Processes to build graphs in, which never outlive the one that started them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from types import TracebackType
from typing import Any, TypeVar

from regrasp_lp.errors import OptionError

Result = TypeVar("Result")


class WorkerProcesses(Executor):
    """A pool of processes that replaces those that die and leaves none behind.

    As a ``ProcessPoolExecutor``, except that

    * after the death of a process (killed, out of memory) it takes work again;
    * an interrupt (Ctrl-C) reaches only the process that started it; leaving the ``with`` block by
      an interrupt, or any other exception, ends all processes at once, whatever they do;
    * the processes end when the one that started them does, however that ends.

    They are started afresh ("spawn"), not forked: solvers and numpy have threads, of which a fork
    may inherit the locks. A script therefore keeps what it does under
    ``if __name__ == "__main__":``, as for any such pool.

    Parameters
    ----------
    workers : int
        How many processes; they are started when there is work for them.

    Raises
    ------
    OptionError
        If that is not at least 1.

    Examples
    --------
    >>> with WorkerProcesses(1) as workers:
    ...     workers.submit(pow, 2, 10).result()
    1024
    """

    def __init__(self, workers: int) -> None:
        if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
            raise OptionError(f"workers must be a whole number of at least 1, got {workers!r}")
        self._max_workers = workers  # as in other executors
        self._pool = self._new_pool()

    def _new_pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            self._max_workers, multiprocessing.get_context("spawn"), initializer=_begin
        )

    def submit(
        self, function: Callable[..., Result], /, *arguments: Any, **keywords: Any
    ) -> Future[Result]:
        """Have a function called in one of the processes; see `concurrent.futures.Executor`."""
        # here processes are started, and they inherit what is held back
        with _interrupts_held_back():
            try:
                return self._pool.submit(function, *arguments, **keywords)
            except BrokenProcessPool:
                self._pool.shutdown()
                self._pool = self._new_pool()
                return self._pool.submit(function, *arguments, **keywords)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more work, and end the processes when they have done what they have."""
        self._pool.shutdown(wait, cancel_futures=cancel_futures)

    def stop(self) -> None:
        """End the processes at once."""
        # from Python 3.14 on: terminate_workers
        for process in list((self._pool._processes or {}).values()):
            process.terminate()
        self._pool.shutdown(cancel_futures=True)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.shutdown()
        else:
            self.stop()


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Let an interrupt wait, in this thread and for good in processes that it starts."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    """Prepare a process: it ignores interrupts, and ends with the one that started it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None, "only a process of a pool begins here"
    parent.join()
    os._exit(1)
