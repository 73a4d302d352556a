"""What the commands of the program take, read off the parsers that read it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from regrasp_lp.cli.arguments import build_parser


def parsers() -> dict[str, argparse.ArgumentParser]:
    """Return the parsers of all commands by name, that of the program itself as ``""``."""
    parser = build_parser()
    found = {"": parser}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found |= action.choices
    return found


def described(
    parser: argparse.ArgumentParser,
) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Yield the title of each group of arguments, and how each is written and what it says."""
    for group in parser._action_groups:
        rows: list[tuple[str, str]] = []
        for action in group._group_actions:
            if isinstance(action, argparse._SubParsersAction):
                rows += [(choice.dest, choice.help or "") for choice in action._choices_actions]
            elif action.help is not argparse.SUPPRESS and action.dest != "help":
                rows.append((_written(action), _explained(action)))
        if rows:
            yield (group.title or "").replace("positional arguments", "arguments"), rows


def _written(action: argparse.Action) -> str:
    value = action.metavar or (
        "{" + ",".join(map(str, action.choices)) + "}" if action.choices else action.dest.upper()
    )
    if not action.option_strings:
        return f"{value} ..." if action.nargs == "+" else str(value)
    return ", ".join(action.option_strings) + ("" if action.nargs == 0 else f" {value}")


def _explained(action: argparse.Action) -> str:
    needed = " (required)" if action.required and action.option_strings else ""
    return (action.help or "").replace("%%", "%") + needed
