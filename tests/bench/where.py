"""Where the time of a graph goes, by entry functions of the package.

While the parts are measured, every function of `ENTRIES` is replaced, wherever the package refers
to it, by one that times it. The time of a call is its own: what runs inside another entry counts
there, and what is in none counts as "graph". So the parts add up to the total, and a function
that is called thousands of times costs no more than that.
"""

from __future__ import annotations

import importlib
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property, wraps
from typing import Any

import regrasp_lp as rl
from bench.clocks import now, seconds_of
from bench.report import Table, ms
from bench.settings import MU

PARTS = ("candidates", "functions", "presolve", "solver", "exact", "graph")

# Which part begins where: "module:function", or "module:Class.method". Keep it at the functions
# between parts; what they call belongs to them.
ENTRIES = {
    "friction:Cones.of": "candidates",
    "grasp_sets.candidates:complete_candidates": "candidates",
    "grasp_sets.candidates:two_finger_candidates": "candidates",
    "grasp_sets.candidates:concurrent_candidates": "candidates",
    "grasp_sets.candidates:parallel_candidates": "candidates",
    "torque:torque_functions": "functions",
    "torque:TorqueFunctions._terms": "functions",
    "torque:TorqueFunctions.take": "functions",
    "grasp_sets.families:parallel_functions": "functions",
    "shadows:shadows": "functions",
    "torque:TorqueFunctions.exists": "presolve",
    "torque:TorqueFunctions.contain": "presolve",
    "margins:best_pieces": "presolve",
    "margins:best_points": "presolve",
    "switching:meet": "presolve",
    "grasp_sets.pieces:piece_sets": "solver",
    "lp.margin_lp:maximise_margins": "solver",
    "exact_margins:certain_margins": "exact",
    "torque:TorqueFunctions.exact_signs": "exact",
    "torque:TorqueFunctions.exact_coefficients": "exact",
    "shadows:Shadows.exact": "exact",
    "switching:exact_one_held": "exact",
    "switching:exact_two_held": "exact",
}


class Clock:
    """Attributes time to the innermost of the parts that are being timed."""

    def __init__(self, rest: str) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._stack = [rest]
        self.start()

    def start(self) -> None:
        """Begin anew."""
        self.seconds.clear()
        self._since = now()

    def enter(self, part: str) -> None:
        self._charge()
        self._stack.append(part)

    def leave(self) -> None:
        self._charge()
        self._stack.pop()

    def _charge(self) -> None:
        moment = now()
        self.seconds[self._stack[-1]] += moment - self._since
        self._since = moment

    def timed(self, function: Callable[..., Any], part: str) -> Callable[..., Any]:
        """The same function, with its time charged to a part."""

        @wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            self.enter(part)
            try:
                return function(*args, **kwargs)
            finally:
                self.leave()

        return call


@contextmanager
def timed_entries(clock: Clock, entries: Mapping[str, str]) -> Iterator[None]:
    """Time entries, as in `ENTRIES`, while inside.

    Raises
    ------
    LookupError
        If an entry does not exist (any more): the table has to follow the package.
    """
    undo: list[tuple[object, str, object]] = []

    def put(owner: object, name: str, value: object) -> None:
        undo.append((owner, name, vars(owner)[name]))
        setattr(owner, name, value)

    try:
        for entry, part in entries.items():
            module, _, path = entry.partition(":")
            owner, name = _found(module, path)
            old = vars(owner)[name]
            new = _replaced(old, clock, part)
            if isinstance(owner, type):
                put(owner, name, new)
            else:
                for user in _modules():
                    for alias in [a for a, value in vars(user).items() if value is old]:
                        put(user, alias, new)
        yield
    finally:
        for owner, name, value in reversed(undo):
            setattr(owner, name, value)


def _found(module: str, path: str) -> tuple[Any, str]:
    """The module or class that defines an entry, and its name there."""
    *classes, name = path.split(".")
    try:
        owner: Any = importlib.import_module(f"regrasp_lp.{module}")
        for part in classes:
            owner = vars(owner)[part]
        vars(owner)[name]
    except (ImportError, KeyError) as error:
        raise LookupError(
            f"regrasp_lp.{module} has no {path}: bring the entries of tests/bench up to date "
            "(ENTRIES in where.py)"
        ) from error
    return owner, name


def _replaced(old: Any, clock: Clock, part: str) -> Any:
    if isinstance(old, cached_property):
        new = cached_property(clock.timed(old.func, part))
        new.attrname = old.attrname
        return new
    if isinstance(old, (classmethod, staticmethod)):
        return type(old)(clock.timed(old.__func__, part))
    return clock.timed(old, part)


def _modules() -> list[Any]:
    return [m for name, m in list(sys.modules.items()) if name.split(".")[0] == "regrasp_lp"]


def parts_of(
    call: Callable[[], object],
    entries: Mapping[str, str] = ENTRIES,
    parts: Sequence[str] = PARTS,
) -> tuple[dict[str, float], float]:
    """Seconds of one call by parts, and in all; the parts add up to it.

    What is in no entry counts as the last part.
    """
    clock = Clock(parts[-1])
    with timed_entries(clock, entries):
        total = seconds_of(lambda: (clock.start(), clock.timed(call, parts[-1])()))
    return {part: clock.seconds[part] for part in parts}, total


def measure(polygons: list[rl.Polygon], kinds: tuple[str, ...] = ("chapter",)) -> Table:
    """One line for each polygon and kind of sets: seconds by parts, of the second of two runs."""
    rows = []
    for polygon in polygons:
        for sets in kinds:

            def build() -> rl.SwitchingGraph:
                return rl.build_switching_graph(polygon, MU, sets=sets)  # noqa: B023

            plain = min(seconds_of(build) for _ in range(2))
            seconds, total = parts_of(build)
            shares = [f"{ms(s)} ({100 * s / total:.0f} %)" for s in seconds.values()]
            rows.append([f"{polygon.name} {sets}", ms(plain), ms(total), *shares])
    headings = ["polygon, sets", "unmeasured, ms", "in parts, ms", *PARTS]
    notes = [
        "Candidates: cones and combinations of edges. Functions: circuits, torque functions, "
        "projections. Presolve: existence, best pieces and switching by floats. Solver: margin "
        "LPs. Exact: integers and rationals. Graph: assembly, storing, and what is left."
    ]
    return Table("Where the time goes", headings, rows, notes)
