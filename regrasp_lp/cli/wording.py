"""What the library says, in the words of the command line: arguments of Python as options.

Messages of the library name its arguments, as in ``ignore=["TEXT"]``; whoever types a command line
has ``--ignore TEXT`` instead.
"""

from __future__ import annotations

import re

_OPTIONS = {
    "flattening": "--flattening",
    "joining": "--joining",
    "layers": "--layer",
    "ignore": "--ignore",
    "tolerance": "--tolerance",
    "fingers": "--fingers",
    "max_span": "--max-span",
    "edge_clearance": "--edge-clearance",
    "fingertip_separation": "--fingertip-separation",
    "finger_reachable": "--finger-avoids",
    "reachable": "--avoid-edges",
    "only_place": "--only-place",
    "only_slide": "--only-slide",
    "min_margin": "--min-margin",
    "sets": "--sets",
    "switching": "--switching",
    "aligning": "--aligning",
    "objective": "--objective",
    "solver": "--solver",
    "k": "--alternatives",
}
"""The option that stands for each argument."""

_NO_WORDS = ("reachable", *(name for name in _OPTIONS if "_" in name))
"""Arguments that are no words of English, so that they may stand without a value."""

_VALUE = r"""(?:\s?=\s?(?P<value>\[[^\]]*\]|"[^"]*"|'[^']*'|\.\.\.|…|[-+\w.]*\w))"""
_QUOTES = "\"'"
_QUOTED = re.compile(r"""["']([^"']*)["']""")
_PLAIN_HAND = re.compile(r"\bHand\((\d+)\)")
# not inside other words, names of files or what somebody has typed
_ARGUMENT = re.compile(
    rf"""(?<![\w./\\'"-])(?:(?P<name>{"|".join(_OPTIONS)}){_VALUE}"""
    rf"""|(?P<alone>{"|".join(_NO_WORDS)})(?![\w./\\'"-]))"""
)


def in_options(text: str) -> str:
    """Return a message of the library with options in place of arguments.

    Examples
    --------
    >>> in_options('leave them out with ignore=["TEXT", "POINT"]')
    'leave them out with --ignore TEXT --ignore POINT'
    >>> in_options("70 apart, more than max_span=5 of the hand; or name the layers=[...]")
    '70 apart, more than --max-span 5 of the hand; or name the --layer'
    """
    return _ARGUMENT.sub(_option, _PLAIN_HAND.sub(r"--fingers \1 without limits", text))


def _option(match: re.Match[str]) -> str:
    option = _OPTIONS[match["name"] or match["alone"]]
    value = match["value"]
    if value is None or value.strip("[]") in ("...", "…"):
        return option
    if value.startswith("["):
        return " ".join(f"{option} {name}" for name in _QUOTED.findall(value))
    return f"{option} {value.strip(_QUOTES)}"
