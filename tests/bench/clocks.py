"""Time in alternating pairs, and peak memory in processes of their own."""

from __future__ import annotations

import gc
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

TESTS = Path(__file__).resolve().parent.parent
_STATUS = Path("/proc/self/status")
_CLEAR = Path("/proc/self/clear_refs")
_START = """
import json, sys
sys.path.insert(0, sys.argv[1])
from bench import clocks
from bench.jobs import JOBS
job = json.load(sys.stdin)
with clocks.by(job["clock"]):
    print(json.dumps(JOBS[job["name"]](**job["arguments"])))
"""


_CLOCKS = {"wall": time.perf_counter, "cpu": time.process_time}
_chosen = "wall"


@contextmanager
def by(name: str) -> Iterator[None]:
    """Measure by the clock on the wall, or by the processor time of this process ("cpu").

    The latter is for machines that others use at the same time.
    """
    global _chosen
    _CLOCKS[name]  # an unknown one is seen here
    before, _chosen = _chosen, name
    try:
        yield
    finally:
        _chosen = before


def seconds_anew(code: str) -> float:
    """How long code takes in a process of its own, beyond starting it."""
    clock = f"time.{_CLOCKS[_chosen].__name__}()"
    timed = f"import time\nstarted = {clock}\n{code}\nprint({clock} - started)"
    run = subprocess.run([sys.executable, "-c", timed], capture_output=True, text=True, check=True)
    return float(run.stdout)


def now() -> float:
    """Seconds by the chosen clock."""
    return _CLOCKS[_chosen]()


def seconds_of(call: Callable[[], object]) -> float:
    """How long one call takes, the garbage of others collected before."""
    gc.collect()
    started = now()
    call()
    return now() - started


def alternating(calls: Sequence[Callable[[], object]], repeats: int) -> list[list[float]]:
    """Seconds of each call, made in turn `repeats` times after one round that is not counted.

    What slows the machine down for a while slows all of them down.
    """
    for call in calls:
        call()
    rounds = [[seconds_of(call) for call in calls] for _ in range(repeats)]
    return [list(column) for column in zip(*rounds, strict=True)]


def in_own_process(name: str, timeout: float | None = None, **arguments: Any) -> dict[str, Any]:
    """Run a job of `bench.jobs` in a fresh interpreter and return what it returns.

    Raises
    ------
    RuntimeError
        If the job fails; the message ends with what it wrote.
    subprocess.TimeoutExpired
    """
    done = subprocess.run(
        [sys.executable, "-c", _START, str(TESTS)],
        input=json.dumps({"name": name, "clock": _chosen, "arguments": arguments}),
        capture_output=True,
        text=True,
        timeout=timeout,
    )
    if done.returncode != 0:
        raise RuntimeError(f"the job {name} failed:\n{done.stderr.strip()}")
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


class Memory:
    """Peak memory of this process from now on, above what it has now, in MiB."""

    def __init__(self) -> None:
        gc.collect()
        if _CLEAR.exists():
            _CLEAR.write_text("5")  # the peak so far is forgotten
        self._before = _peak()

    def peak(self) -> float:
        """MiB above what the process had at the beginning."""
        return (_peak() - self._before) / 2**20


def _peak() -> int:
    """Largest resident size of this process, in bytes.

    On Linux that of `getrusage` starts with the parent's size, so that another one is read.
    """
    if _STATUS.exists():
        lines = _STATUS.read_text(encoding="ascii").splitlines()
        line = next(line for line in lines if line.startswith("VmHWM:"))
        return int(line.split()[1]) * 1024
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
