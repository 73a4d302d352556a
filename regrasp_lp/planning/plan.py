"""A regrasp plan: steps, the grasps held between them, and their margins."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.files import write_atomically
from regrasp_lp.friction import Cones, FloatArray
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.steps import Place, Release, Slide, Step
from regrasp_lp.planning.verification import Report, verify_document
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import TorqueFunctions, torque_functions

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Support:
    """The grasp set that holds the object at some moment, and with which fingers.

    Parameters
    ----------
    kind : str
        "two_finger", "three_finger", "concurrent" or "parallel".
    fingers : tuple of int
        The fingers whose contacts are the grasp in the set; others may touch as well.
    center : int, optional
        Centre edge of a parallel set.
    """

    kind: str
    fingers: tuple[int, ...]
    center: int | None = None


@dataclass(frozen=True)
class HeldGrasp:
    """All contacts between two steps.

    Parameters
    ----------
    after_step : int
        Number of steps done; 0 is the start.
    contacts : mapping of int to Contact
        Where each touching finger is.
    support : Support
        The set that the planner counts on, and its fingers.
    margin, tolerance : float
        Of the supporting fingers alone, in the object's unit (``docs/theory.md``); the other
        touching fingers can only add to the margin.
    """

    after_step: int
    contacts: Mapping[int, Contact]
    support: Support
    margin: float
    tolerance: float

    @property
    def grasp(self) -> Grasp:
        """The contacts of the supporting fingers."""
        return Grasp([self.contacts[finger] for finger in self.support.fingers])


@dataclass(frozen=True, eq=False)
class Plan:
    """A sequence of steps from one grasp to another that never drops the object.

    Parameters
    ----------
    polygon : Polygon
    friction : numpy.ndarray, shape (n_edges,)
        μ of each edge.
    hand : Hand
    start : mapping of int to Contact
        Contact of each finger that touches at the start (resolved).
    goal : Grasp
        The contacts to reach, by whichever fingers.
    steps : tuple of Place, Release or Slide
    supports : tuple of Support
        One for the start and one after each step.

    Notes
    -----
    Margins and tolerances are computed from the steps when asked for.
    """

    polygon: Polygon
    friction: FloatArray
    hand: Hand
    start: Mapping[int, Contact]
    goal: Grasp
    steps: tuple[Step, ...]
    supports: tuple[Support, ...]

    @cached_property
    def _touching(self) -> tuple[Mapping[int, Contact], ...]:
        """Contacts of the touching fingers at the start and after each step."""
        now = dict(self.start)
        states = [now]
        for step in self.steps:
            now = dict(now)
            match step:
                case Place(finger, contact):
                    now[finger] = contact
                case Release(finger):
                    del now[finger]
                case Slide(moves):
                    now.update(moves)
            states.append(now)
        return tuple(MappingProxyType(dict(sorted(state.items()))) for state in states)

    @cached_property
    def _cones(self) -> Cones:
        return Cones.of(self.polygon, self.friction)

    def _functions(self, contacts: list[Contact]) -> tuple[TorqueFunctions, FloatArray]:
        grasp = Grasp(contacts)
        return torque_functions(self._cones, grasp.edges[None, :]), grasp.fractions

    @cached_property
    def grasps(self) -> tuple[HeldGrasp, ...]:
        """The grasps held: at the start and after each step."""
        held = []
        for i, (contacts, support) in enumerate(zip(self._touching, self.supports, strict=True)):
            functions, f = self._functions([contacts[k] for k in support.fingers])
            margin, tolerance = float(functions.margins(f)[0]), float(functions.tolerances(f)[0])
            held.append(HeldGrasp(i, contacts, support, margin, tolerance))
        return tuple(held)

    @cached_property
    def slide_margins(self) -> tuple[float, ...]:
        """The least margin along each step that is a slide; inf for the other steps."""
        least = []
        for i, step in enumerate(self.steps):
            if not isinstance(step, Slide):
                least.append(np.inf)
                continue
            fingers = self.supports[i].fingers
            functions, f = self._functions([self._touching[i][k] for k in fingers])
            _, g = self._functions([self._touching[i + 1][k] for k in fingers])
            least.append(least_margin_along(functions, f, g))
        return tuple(least)

    @property
    def margins(self) -> tuple[float, ...]:
        """Margin of each held grasp, in the object's unit."""
        return tuple(grasp.margin for grasp in self.grasps)

    @property
    def margin(self) -> float:
        """The least margin of all held grasps and along all slides."""
        return min(*self.margins, *self.slide_margins, np.inf)

    @property
    def tolerance(self) -> float:
        """The least tolerance of all held grasps."""
        return min(grasp.tolerance for grasp in self.grasps)

    @cached_property
    def _chosen(self) -> tuple[HeldGrasp, ...]:
        given = (set(self.start.values()), set(self.goal))
        return tuple(g for g in self.grasps if not any(set(g.grasp) <= part for part in given))

    @property
    def chosen_margin(self) -> float:
        """The least margin over the grasps that were free to choose; inf if none was."""
        return min((g.margin for g in self._chosen), default=np.inf)

    @property
    def chosen_tolerance(self) -> float:
        """The least tolerance over the grasps that were free to choose; inf if none was."""
        return min((g.tolerance for g in self._chosen), default=np.inf)

    @property
    def placements(self) -> int:
        """Number of times that a finger is placed."""
        return sum(isinstance(step, Place) for step in self.steps)

    @property
    def path(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """The grasp sets passed through: kind and edges, without immediate repetitions."""
        path: list[tuple[str, tuple[int, ...]]] = []
        for grasp in self.grasps:
            label = grasp.support.kind, tuple(sorted(c.edge for c in grasp.grasp))
            if not path or path[-1] != label:
                path.append(label)
        return tuple(path)

    def verify(self) -> Report:
        """Check every held grasp, and every slide at every instant, exactly.

        Decided by contact wrenches in rational arithmetic from `to_document` alone; shares
        nothing with the planner.

        Returns
        -------
        Report
            With ``ok`` and, if not, the first ``fault``.
        """
        return verify_document(self.to_document())

    def plot(self) -> Figure:
        """Draw the plan as a filmstrip (needs the extra "plot")."""
        from regrasp_lp.plotting import plot_plan

        return plot_plan(self)

    def to_document(self) -> dict[str, Any]:
        """Return the plan in the form of its file, as plain dicts, lists and numbers."""
        from regrasp_lp.planning.plan_file import document_of

        return document_of(self)

    def to_json(self, path: str | Path | None = None) -> str:
        """Return the plan's file as text, and write it to `path` if given.

        Parameters
        ----------
        path : path-like, optional
            Written whole or not at all.

        Returns
        -------
        str
        """
        text = json.dumps(self.to_document(), indent=1)
        if path is not None:
            write_atomically(path, text)
        return text

    def __eq__(self, other: object) -> bool:
        """Whether two plans have the same file."""
        return self.to_document() == other.to_document() if isinstance(other, Plan) else False

    def __hash__(self) -> int:
        return hash((self.polygon, self.steps))

    def __str__(self) -> str:
        from regrasp_lp.planning.account import account

        return account(self)

    def __repr__(self) -> str:
        return (
            f"<Plan {self.polygon.name!r}: {len(self.steps)} steps, "
            f"{self.placements} placements, margin {self.margin:.4g}>"
        )


def least_margin_along(functions: TorqueFunctions, f: FloatArray, g: FloatArray) -> float:
    """Return the least margin along the straight slide from fractions f to g.

    ``max_k M_k/s_k`` and ``max_j -M_j/s_j`` are convex and piecewise linear along it, so each is
    least at an end or where two of its functions cross.

    Parameters
    ----------
    functions : TorqueFunctions
        Of one combination.
    f, g : numpy.ndarray, shape (m,)

    Returns
    -------
    float
    """
    if not functions.spans[0]:
        return -np.inf
    start, end = (functions.certain_values(x)[0][functions.valid[0]] for x in (f, g))
    change = end - start
    apart = change[:, None] - change[None, :]
    crossing = np.divide(
        start[None, :] - start[:, None], apart, out=np.zeros(apart.shape), where=apart != 0
    )
    t = np.concatenate(([0.0], crossing[(crossing > 0) & (crossing < 1)]))
    values = np.column_stack((start[:, None] + change[:, None] * t, end))
    return float(min(values.max(axis=0).min(), (-values).max(axis=0).min()))
