"""Everything the package raises.

Every error of ours is a `RegraspError`; its message says what was wrong, where, and what to do.
Those that stand for a bad argument are a `ValueError` as well, so that generic callers work.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from regrasp_lp.explanation import Explanation


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

    Parameters
    ----------
    explanation : str
        Why, in one line: the components that start and goal are in, or which of them is in no set.
    question : mapping of str to object, optional
        What was asked: the arguments of `regrasp_lp.explain`.
    """

    def __init__(self, explanation: str, question: Mapping[str, Any] | None = None) -> None:
        super().__init__(explanation)
        self.explanation = explanation
        self.question = question

    def __reduce__(self) -> tuple[type[NoPlanFound], tuple[str, Mapping[str, Any] | None]]:
        return NoPlanFound, (self.explanation, self.question)

    def about(self, question: Mapping[str, Any]) -> NoPlanFound:
        """Return the same answer to a question; the one it has already stays."""
        return NoPlanFound(self.explanation, self.question or question)

    def explain(self, progress: Callable[[str, int, int], None] | None = None) -> Explanation:
        """Tell in full why there is no plan, and what would help; this may take some seconds.

        Parameters
        ----------
        progress : callable, optional
            Called as ``progress(what, done, total)`` now and then.

        Raises
        ------
        OptionError
            If this answer is not about two grasps of an object.
        """
        if self.question is None:
            raise OptionError(
                f"nothing more can be said about this answer ({self.explanation}): "
                "use regrasp_lp.explain with a start and a goal"
            )
        from regrasp_lp.why_not import explain

        return explain(**self.question, progress=progress)
