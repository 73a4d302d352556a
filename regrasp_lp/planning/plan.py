"""A regrasp plan: steps, the grasps held between them, and their margins."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.contact import Contact, Grasp
from regrasp_lp.display import plan_html
from regrasp_lp.files import write_atomically
from regrasp_lp.friction import Cones, FloatArray
from regrasp_lp.planning.along import instants, least_margin_along, least_tolerance_along
from regrasp_lp.planning.hand import Hand
from regrasp_lp.planning.objective import PLACEMENTS, Objective
from regrasp_lp.planning.reach import hand_cones, room
from regrasp_lp.planning.steps import Place, Release, Slide, Step
from regrasp_lp.planning.verification import Report, verify_document
from regrasp_lp.polygon import Polygon
from regrasp_lp.torque import TorqueFunctions, torque_functions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from regrasp_lp.planning.friction_change import LeastFriction
    from regrasp_lp.planning.regions import Region
    from regrasp_lp.planning.sensitivity import Sensitivity


_ROUNDING = 1e-9
"""Of the object's size: margins that differ by less are equal."""


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
        touching fingers can only add to the margin. The tolerance is no more than what the hand's
        limits leave to any touching finger.
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
    objective : Objective
        What the plan was made best in.
    bound : float, optional
        What no plan can do better in the objective; None if that is not known, as of a plan that
        was read from a file.

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
    objective: Objective = PLACEMENTS
    bound: float | None = None

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
    def cones(self) -> Cones:
        """The friction cones of the edges."""
        return Cones.of(self.polygon, self.friction)

    @cached_property
    def touchable(self) -> Cones:
        """The same of what the hand may touch of them."""
        return hand_cones(self.polygon, self.friction, self.hand)

    def torques(
        self, contacts: Mapping[int, Contact], support: Support
    ) -> tuple[TorqueFunctions, FloatArray]:
        """Return the torque functions of supporting fingers, and the fractions where they are."""
        grasp = Grasp([contacts[finger] for finger in support.fingers])
        return torque_functions(self.cones, grasp.edges[None, :]), grasp.fractions

    @cached_property
    def grasps(self) -> tuple[HeldGrasp, ...]:
        """The grasps held: at the start and after each step."""
        held = []
        for i, (contacts, support) in enumerate(zip(self._touching, self.supports, strict=True)):
            functions, f = self.torques(contacts, support)
            margin, tolerance = float(functions.margins(f)[0]), float(functions.tolerances(f)[0])
            tolerance = min(tolerance, room(self.touchable, self.hand, contacts))
            held.append(HeldGrasp(i, contacts, support, margin, tolerance))
        return tuple(held)

    @cached_property
    def slides(self) -> tuple[tuple[TorqueFunctions, FloatArray, FloatArray] | None, ...]:
        """Of each step that is a slide the torque functions, and the fractions at both ends."""
        found: list[tuple[TorqueFunctions, FloatArray, FloatArray] | None] = []
        for i, step in enumerate(self.steps):
            if isinstance(step, Slide):
                before, after = self._touching[i : i + 2]
                functions, f = self.torques(before, self.supports[i])
                found.append((functions, f, self.torques(after, self.supports[i])[1]))
            else:
                found.append(None)
        return tuple(found)

    @cached_property
    def slide_margins(self) -> tuple[float, ...]:
        """The least margin along each step that is a slide; inf for the other steps."""
        return tuple(np.inf if s is None else least_margin_along(*s) for s in self.slides)

    @cached_property
    def slide_tolerances(self) -> tuple[float, ...]:
        """The least tolerance along each step that is a slide; inf for the other steps."""
        least = []
        for i, slide in enumerate(self.slides):
            if slide is None:
                least.append(np.inf)
                continue
            passed = instants(self.polygon, *self._touching[i : i + 2])
            left = (room(self.touchable, self.hand, contacts) for contacts in passed)
            least.append(min(least_tolerance_along(*slide), *left))
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
    def _given(self) -> tuple[bool, ...]:
        """Of each held grasp, whether it is the start or the goal.

        A part of these is, too, while all of their contacts touch and no finger slides to or away.
        """
        ends = (set(self.start.values()), set(self.goal))
        slides = [False, *(isinstance(step, Slide) for step in self.steps), False]
        given = []
        for held, moved in zip(self.grasps, map(any, pairwise(slides)), strict=True):
            part, touching = set(held.grasp), set(held.contacts.values())
            at_rest = (not moved and part <= end <= touching for end in ends)
            given.append(part in ends or any(at_rest))
        return tuple(given)

    def _least_chosen(self, held: Sequence[float], slides: Sequence[float]) -> float:
        """The least over grasps that were chosen and over slides.

        A slide from or to a given grasp counts where it falls below that grasp, beyond rounding;
        where other fingers take over there, it counts in any case.
        """
        least = min(
            (v for v, given in zip(held, self._given, strict=True) if not given), default=np.inf
        )
        rounding = _ROUNDING * self.polygon.diameter
        for i, value in enumerate(slides):
            mine = self.supports[i].fingers
            ends = [
                held[n] for n in (i, i + 1) if self._given[n] and self.supports[n].fingers == mine
            ]
            if value < min(ends, default=np.inf) - rounding:
                least = min(least, value)
        return least

    @cached_property
    def chosen_margin(self) -> float:
        """The least margin over what was chosen; inf if nothing was.

        Start and goal are given, each as a whole: with some of its contacts released, or not placed
        yet, it is a choice. A slide from or to them counts only where it falls below them.
        """
        return self._least_chosen(self.margins, self.slide_margins)

    @cached_property
    def chosen_tolerance(self) -> float:
        """The least tolerance over what was chosen; inf if nothing was."""
        held = [grasp.tolerance for grasp in self.grasps]
        return self._least_chosen(held, self.slide_tolerances)

    @cached_property
    def travel(self) -> float:
        """How far fingers slide, all together, in the object's unit."""
        total = 0.0
        for before, step in zip(self._touching[:-1], self.steps, strict=True):
            if isinstance(step, Slide):
                first, last = Grasp([before[k] for k in step.moves]), Grasp(step.moves.values())
                moved = np.abs(last.fractions - first.fractions)
                total += float(moved @ self.polygon.edge_lengths[last.edges])
        return total

    @property
    def value(self) -> float:
        """How good the plan is in its objective (`Objective.value`)."""
        return self.objective.value(self)

    @property
    def gap(self) -> float | None:
        """How far from the best plan it can be: the distance of `value` and `bound`.

        0 proves that no plan is better, to the accuracy of linear programs (a millionth of the
        value); None if no bound is known.
        """
        return None if self.bound is None else self.objective.gap(self.value, self.bound)

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

    def sensitivity(self) -> Sensitivity:
        """Return what limits margin and tolerance, what friction does, how far fingers may be off.

        Raises
        ------
        NotForceClosureError
            If the plan does not hold the object as it is.
        """
        from regrasp_lp.planning.sensitivity import sensitivity_of

        return sensitivity_of(self)

    def margins_at(
        self, factors: ArrayLike | None = None, *, friction: ArrayLike | None = None
    ) -> FloatArray:
        """Return the plan's margin under other friction: see `friction_change.margins_at`."""
        from regrasp_lp.planning.friction_change import margins_at

        return margins_at(self, factors, friction=friction)

    def least_friction(self) -> LeastFriction:
        """Return the least factor of all friction under which the plan holds, exactly."""
        from regrasp_lp.planning.friction_change import least_friction_of

        return least_friction_of(self)

    def regions(self) -> tuple[Region, ...]:
        """Return the independent contact regions: how far each finger may be off at each step."""
        from regrasp_lp.planning.regions import regions

        return regions(self)

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

    def to_html(self, path: str | Path | None = None) -> str:
        """Return a page to step through, and write it to `path` if given (`viewer.plan_page`)."""
        from regrasp_lp.viewer import plan_page

        return plan_page(self, path)

    def to_gif(self, path: str | Path | None = None, **options: float) -> bytes:
        """Return an animation, and write it to `path` if given (`plotting.plan_gif`)."""
        from regrasp_lp.plotting import plan_gif

        data = plan_gif(self, **options)
        if path is not None:
            write_atomically(path, data)
        return data

    def __eq__(self, other: object) -> bool:
        """Whether two plans have the same file."""
        return self.to_document() == other.to_document() if isinstance(other, Plan) else False

    def __hash__(self) -> int:
        return hash((self.polygon, self.steps))

    def __str__(self) -> str:
        from regrasp_lp.planning.account import account

        return account(self)

    def _repr_html_(self) -> str:
        return plan_html(self)

    def __repr__(self) -> str:
        return (
            f"<Plan {self.polygon.name!r}: {len(self.steps)} steps, "
            f"{self.placements} placements, margin {self.margin:.4g}>"
        )
