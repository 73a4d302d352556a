"""What goes to standard error: lines that say what is wrong, and a progress bar on a terminal."""

from __future__ import annotations

import os
import shutil
import sys
import threading
import time
from types import TracebackType
from typing import TextIO

_REDRAW = 0.2  # seconds
_WIDEST = 40  # characters of the bar itself


def complain(program: str, message: str) -> None:
    """Print a message to standard error, on one line that begins with the program's name."""
    if sys.stderr is not None:
        print(f"{program}: {' '.join(message.split())}", file=sys.stderr)


def tell(text: object) -> None:
    """Print a text of several lines to standard error, as it is."""
    if sys.stderr is not None:
        print(text, file=sys.stderr)


class ProgressBar:
    """Shows on standard error what is being done, if that is a terminal.

    A context manager; inside it, call it as ``bar(what, done, total)`` or hand it to
    `build_switching_graph` as `progress`. The bar appears once the work has taken `after` seconds
    and is wiped away at the end. It is drawn by a thread of its own, so that it also shows during
    long work that reports nothing.

    Parameters
    ----------
    stream : text stream, optional
        Standard error by default.
    after : float, optional
        In seconds.

    Attributes
    ----------
    subject : str
        Which of several objects the work is about, to be shown before what is done; none at first.
    """

    def __init__(self, stream: TextIO | None = None, after: float = 1.0) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._after = after
        self.subject = ""
        self._state = ("", 0, 0)
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self._started = time.monotonic()

    def __call__(self, what: str, done: int, total: int) -> None:
        """Tell what is being done, and how much of it is; a total of 0 is an unknown one."""
        # not other underscores, which may belong to the name of an object
        self._state = (what.replace("_finger", "-finger"), done, total)

    def __enter__(self) -> ProgressBar:
        if _is_terminal(self._stream):
            self._thread = threading.Thread(target=self._keep_drawing, daemon=True)
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ended.set()
        if self._thread is not None:
            self._thread.join()

    def _keep_drawing(self) -> None:
        wait = self._after
        width = 0
        try:
            while not self._ended.wait(wait):
                wait = _REDRAW
                if not self._state[0]:
                    continue  # nothing told yet
                line = self._line()
                self._stream.write("\r" + line.ljust(width))
                self._stream.flush()
                width = len(line)
            if width:
                self._stream.write("\r" + " " * width + "\r")
                self._stream.flush()
        except (OSError, ValueError):
            return  # the terminal is gone; the work goes on

    def _line(self) -> str:
        what, done, total = self._state
        if self.subject:
            what = f"{' '.join(self.subject.split())}: {what}"
        columns = _columns(self._stream)
        elapsed = f"{time.monotonic() - self._started:.0f} s"
        if total <= 0:
            return f"{what}  {elapsed}"[: columns - 1]
        part = min(max(done / total, 0.0), 1.0)
        tail = f"  {100 * part:3.0f} %  {elapsed}"
        room = min(columns - 1 - len(what) - len(tail) - 4, _WIDEST)
        if room < 5:
            return f"{what}{tail}"[: columns - 1]
        full = round(part * room)
        return f"{what}  [{'#' * full}{'.' * (room - full)}]{tail}"


def _is_terminal(stream: TextIO | None) -> bool:
    if stream is None or os.environ.get("TERM") == "dumb":
        return False
    try:
        return stream.isatty()
    except ValueError:  # closed
        return False


def _columns(stream: TextIO) -> int:
    try:
        columns = os.get_terminal_size(stream.fileno()).columns
    except (OSError, ValueError):  # no terminal behind it after all
        columns = 0
    return columns or shutil.get_terminal_size().columns
