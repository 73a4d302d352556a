"""Writes the public names and signatures: `python tests/public_api.py > tests/public_api.txt`."""

from __future__ import annotations

import inspect
from collections.abc import Iterator

import regrasp_lp as rl
from regrasp_lp import plotting


def signature(value: object) -> str:
    """Names, kinds and defaults of the parameters, without their types."""
    found = inspect.signature(value)  # type: ignore[arg-type]
    bare = [p.replace(annotation=inspect.Parameter.empty) for p in found.parameters.values()]
    return str(inspect.Signature([p for p in bare if p.name not in ("self", "cls")]))


def members(owner: type) -> Iterator[str]:
    """What a class offers beside what every object does, its own and what it inherits from us."""
    ours = [c for c in owner.__mro__ if c.__module__.startswith("regrasp_lp")]
    names = {name for c in ours for name in (*vars(c), *vars(c).get("__annotations__", ()))}
    for name in sorted(name for name in names if not name.startswith("_")):
        value = inspect.getattr_static(owner, name, None)
        if isinstance(value, (staticmethod, classmethod)):
            value = value.__func__
        yield f"    .{name}{signature(value) if inspect.isfunction(value) else ''}"


def public_api() -> str:
    """Return one line a name: functions and constructors with parameters, members indented."""
    lines = []
    for prefix, module in (("rl", rl), ("rl.quality", rl.quality), ("rl.plotting", plotting)):
        for name in sorted(module.__all__):
            value = getattr(module, name)
            if inspect.ismodule(value):
                continue
            if inspect.isfunction(value) or inspect.isclass(value):
                error = inspect.isclass(value) and issubclass(value, Exception)
                lines.append(f"{prefix}.{name}" + ("" if error else signature(value)))
            else:
                lines.append(f"{prefix}.{name}")
            if inspect.isclass(value):
                lines += members(value)
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(public_api(), end="")
