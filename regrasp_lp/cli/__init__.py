"""The command line ``regrasp-lp``: plan, graph, table, show and check.

Results go to standard output. To standard error go errors, one line each, why there is no plan, a
line and what would help, and the progress bar. Nothing else in the package prints.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Sequence

from regrasp_lp.cli.arguments import PROGRAM, UsageError, build_parser, read_command_line
from regrasp_lp.cli.progress import ProgressBar, complain, tell
from regrasp_lp.cli.wording import in_options
from regrasp_lp.errors import NoPlanFound, RegraspError

__all__ = ["main"]

# As shells report a program that a signal ended: 128 + SIGINT, 128 + SIGPIPE.
_INTERRUPTED, _READER_GONE = 130, 141


def main(arguments: Sequence[str] | None = None) -> int:
    """Carry out a command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the name of the program; by default those of this process.

    Returns
    -------
    int
        0: done. 1: there is no plan, or the plan that was checked is faulty. 2: an error.
        130: interrupted. 141: whoever read the output has stopped reading.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        # a name that the terminal cannot write is no reason to stop
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        code = _run(sys.argv[1:] if arguments is None else arguments)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        _discard_output()
        return _READER_GONE
    except KeyboardInterrupt:
        return _fail(PROGRAM, "interrupted", _INTERRUPTED)
    except OSError as error:
        _discard_output()
        return _fail(PROGRAM, f"error: {_os_error_text(error)}", 2)
    return code


def _run(arguments: Sequence[str]) -> int:
    program = PROGRAM
    say: Callable[[str], str] = in_options
    try:
        options = read_command_line(build_parser(), arguments)
        program = f"{PROGRAM} {options.command}"
        if options.command == "check":
            say = str  # what files say is called as it is there
        # known only now: what a command needs is not loaded to print a help text
        code: int = options.run(options)
    except SystemExit as stop:  # argparse has printed a help text or the version
        return int(stop.code or 0)
    except NoPlanFound as answer:
        return _refused(program, answer)
    except UsageError as error:
        return _fail(error.program, f"error: {error} (see {error.program} --help)", 2)
    except RegraspError as error:
        return _fail(program, f"error: {say(str(error))}", 2)
    except MemoryError:
        return _fail(program, "error: not enough memory; try an object with fewer edges", 2)
    return code


def _refused(program: str, answer: NoPlanFound) -> int:
    """Say why there is no plan; in full, with what would help, if start and goal are known."""
    complain(program, in_options(answer.explanation))
    if answer.question is None:
        return 1
    try:
        with ProgressBar() as bar:
            bar("looking for what would help", 0, 0)
            explanation = answer.explain(bar)
    except RegraspError as error:
        return _fail(program, f"what would help is not known: {in_options(str(error))}", 1)
    tell(in_options(str(explanation)))
    return 1


def _fail(program: str, message: str, code: int) -> int:
    complain(program, message)
    return code


def _os_error_text(error: OSError) -> str:
    what = error.strerror or str(error)
    return f"{error.filename}: {what}" if error.filename is not None else what


def _discard_output() -> None:
    """Let what is still buffered go nowhere, or Python complains about it at its end."""
    try:
        descriptor = sys.stdout.fileno()
    except (OSError, ValueError, AttributeError):  # closed, or no file
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)
