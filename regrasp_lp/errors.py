"""Everything the package raises.

Every error of ours is a `RegraspError`; its message says what was wrong, where, and what to do.
Those that stand for a bad argument are a `ValueError` as well, so that generic callers work.
"""

from __future__ import annotations


class RegraspError(Exception):
    """Base class of all errors raised by `regrasp_lp`."""


class PolygonError(RegraspError, ValueError):
    """The outline or a hole is not a valid simple polygon; the message names the edges."""


class ContactError(RegraspError, ValueError):
    """A contact is not on the object, on no known edge, or where another contact is."""


class FrictionError(RegraspError, ValueError):
    """Friction coefficients that are not positive finite numbers, or too few or too many."""


class HandError(RegraspError, ValueError):
    """A hand that cannot hold or regrasp what is asked of it."""


class OptionError(RegraspError, ValueError):
    """A named option has a value that does not exist; the message lists those that do."""


class NotForceClosureError(RegraspError, ValueError):
    """A grasp that has to be in force closure is not; the message says what would help."""


class FileFormatError(RegraspError, ValueError):
    """A file is damaged, of another format or of another version; the message names the place."""


class SolverError(RegraspError, RuntimeError):
    """A solver stopped early or returned an answer that did not pass the re-check."""


class MissingExtraError(RegraspError, ImportError):
    """An optional dependency is not installed; the message names the extra that brings it."""

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        super().__init__(
            f'{purpose} needs {package}, which is not installed: pip install "regrasp_lp[{extra}]"'
        )
        self._arguments = (package, extra, purpose)

    def __reduce__(self) -> tuple[type[MissingExtraError], tuple[str, str, str]]:
        return MissingExtraError, self._arguments


class NoPlanFound(RegraspError):
    """No regrasp plan exists among the sets considered.

    This is an answer, not a failure.

    Attributes
    ----------
    explanation : str
        Why: the components that start and goal are in, or which of them is in no set.
    """

    def __init__(self, explanation: str) -> None:
        super().__init__(explanation)
        self.explanation = explanation
