"""Completeness, measured: which part of random force-closure grasps and switches a graph knows.

Grasps are drawn by `regrasp_lp.random_grasps` and judged by their contact wrenches, exactly:
neither has anything in common with the torque functions that sets and switches are made of. Then
they are looked up in the graph.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from regrasp_lp.build import build_switching_graph, check_options
from regrasp_lp.contact import Grasp
from regrasp_lp.errors import OptionError
from regrasp_lp.friction import Cones
from regrasp_lp.membership import CombinationSets, GraphSets, KnownSets
from regrasp_lp.planning.hand import Hand
from regrasp_lp.polygon import Polygon
from regrasp_lp.random_grasps import RandomGrasps
from regrasp_lp.sampling import Measurement
from regrasp_lp.switching_graph import SwitchingGraph

WHOLE_LIMIT = 40
"""Up to so many edges the whole graph is built, unless it is said otherwise."""

_DRAWS_EACH = 100


@dataclass(frozen=True)
class Share:
    """How many of some random samples were found.

    Parameters
    ----------
    found, of : int

    Notes
    -----
    The interval takes samples to be independent. Grasps of one class are. Those of several classes
    come in fixed parts, which makes a sum vary less than the interval allows for; switches start
    from the sampled grasps, of which some are used more than once.

    Examples
    --------
    >>> share = Share(found=4000, of=4000)
    >>> share.fraction, round(share.interval[0], 5), share.interval[1]
    (1.0, 0.99908, 1.0)
    """

    found: int
    of: int

    @property
    def fraction(self) -> float:
        """The part that was found; nan if there was no sample."""
        return self.found / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % confidence interval of the fraction, by Clopper and Pearson (exact)."""
        from scipy.stats import beta

        missed = self.of - self.found
        low = float(beta.ppf(0.025, self.found, missed + 1)) if self.found else 0.0
        high = float(beta.ppf(0.975, self.found + 1, missed)) if missed else 1.0
        return low, high

    def __add__(self, other: Share) -> Share:
        return Share(self.found + other.found, self.of + other.of)


@dataclass(frozen=True)
class Coverage:
    """What a graph knows of random force-closure grasps and switches; `str` gives a table.

    Made by `coverage`, which says how they are drawn.

    Parameters
    ----------
    name : str
        Of the object.
    n_edges : int
    friction : tuple of float
        μ: one value, or one per edge.
    sets : str
        "complete" or "chapter".
    proposal : str
    seed : int
    whole : bool
        Whether samples were looked up in a whole graph.
    by_contacts : mapping of str to Share
        Of grasps with 2 contacts, with 3 on different edges and with two of 3 on one edge: those
        strictly inside a set over exactly their edges.
    located_by_contacts : mapping of str to Share
        The same, counting those too of which two of three contacts are in a two-finger set: all
        that `SwitchingGraph.locate` finds.
    by_held : mapping of str to Share
        Of switches, by the numbers of contacts: those whose sets are adjacent.
    draws, false_members : int
        Random contacts that were tested, and how many of these are in a set although they are not
        in force closure.
    seen : int
        On how many different combinations of edges there are grasps among the samples.
    n_combinations : int or None
        On how many the whole graph has sets.
    missed : tuple of Grasp
        The first few grasps that are in no set over their edges.
    missed_switches : tuple of (Grasp, Grasp)
        The first few switches whose sets are not adjacent, or which have a grasp in no set.
    wrong : tuple of Grasp
        The first few false members.
    """

    name: str
    n_edges: int
    friction: tuple[float, ...]
    sets: str
    proposal: str
    seed: int
    whole: bool
    by_contacts: Mapping[str, Share]
    located_by_contacts: Mapping[str, Share]
    by_held: Mapping[str, Share]
    draws: int
    false_members: int
    seen: int
    n_combinations: int | None
    missed: tuple[Grasp, ...] = field(repr=False)
    missed_switches: tuple[tuple[Grasp, Grasp], ...] = field(repr=False)
    wrong: tuple[Grasp, ...] = field(repr=False)

    @property
    def grasps(self) -> Share:
        """Of all sampled grasps: those strictly inside a set over exactly their edges."""
        return sum(self.by_contacts.values(), Share(0, 0))

    @property
    def located(self) -> Share:
        """Of all sampled grasps: those that `SwitchingGraph.locate` finds."""
        return sum(self.located_by_contacts.values(), Share(0, 0))

    @property
    def switches(self) -> Share:
        """Of all sampled switches: those whose sets are adjacent."""
        return sum(self.by_held.values(), Share(0, 0))

    def __str__(self) -> str:
        def row(label: str, share: Share) -> str:
            text = f"{label:<34}{share.found:>8}{share.of:>8}"
            if not share.of:
                return text
            low, high = share.interval
            return f"{text}   {share.fraction:8.4f}   {low:.4f} to {high:.4f}"

        rows = [("grasps", self.grasps)]
        rows += [(f"  {label}", share) for label, share in self.by_contacts.items()]
        if self.located != self.grasps:
            rows.append(("grasps, also by two of 3 contacts", self.located))
            rows += [(f"  {label}", share) for label, share in self.located_by_contacts.items()]
        rows.append(("switches", self.switches))
        rows += [(f"  {label}", share) for label, share in self.by_held.items()]
        known = "" if self.n_combinations is None else f", sets on {self.n_combinations}"
        where = "whole graph" if self.whole else "sets of the sampled combinations of edges"
        least, most = min(self.friction), max(self.friction)
        mu = f"μ = {least:g}" + (f" to {most:g}" if most > least else "")
        return "\n".join(
            [
                f"{self.name or 'unnamed polygon'}: {self.n_edges} edges, {mu}",
                f"{self.sets} sets, {where}; {self.proposal} draws, seed {self.seed}",
                "",
                f"{'':<34}{'found':>8}{'of':>8}   {'fraction':>8}   95 % interval",
                *(row(label, share) for label, share in rows),
                "",
                f"combinations of edges with sampled grasps: {self.seen}{known}",
                f"false members: {self.false_members} of {self.draws} draws",
            ]
        )


def coverage(
    polygon: Polygon,
    friction: ArrayLike,
    samples: int = 4000,
    seed: int = 0,
    *,
    switches: int | None = None,
    sets: str = "complete",
    hand: Hand | None = None,
    proposal: str = "mixed",
    whole: bool | None = None,
    graph: SwitchingGraph | None = None,
    max_draws: int | None = None,
) -> Coverage:
    """Measure which part of all force-closure grasps and switches the sets of an object contain.

    Contacts are drawn at random, and those in force closure (exactly, by their wrenches) are looked
    up (exactly, by their torque functions). A switch is a sampled grasp of which some contacts are
    held while the others are drawn anew until there is another grasp over other edges; its sets
    have to be adjacent, holding at least as many contacts.

    Parameters
    ----------
    polygon : Polygon
    friction : float or sequence of float
        μ, one value or one per edge.
    samples : int
        How many force-closure grasps to look up: a quarter with 2 contacts, a quarter with two of
        3 on one edge, the rest with 3 on different edges. What one part lacks is left to the next.
    seed : int
        The same seed gives the same samples, whatever they are looked up in.
    switches : int, optional
        How many switches to look up, by default as many as grasps: in equal parts by the numbers
        of contacts, what one part lacks being left to the next.
    sets : {"complete", "chapter"}
    hand : Hand, optional
        Four fingers by default. It tells how many contacts a switch has to hold.
    proposal : {"mixed", "uniform"}
        The distribution that fractions refer to. With "mixed" many draws are aimed, so that low
        friction, short edges and narrow sets get their samples (`regrasp_lp.random_grasps`). With
        "uniform" all edges, and all places on an edge, are equally likely: the fraction is a share
        of the volume of contact space.
    whole : bool, optional
        Whether to build the whole graph, or only what it would have on the combinations of edges
        that are sampled. By default the whole graph up to `WHOLE_LIMIT` edges.
    graph : SwitchingGraph, optional
        The graph to measure, of this object under this friction: instead of `sets`, `hand` and
        `whole`, which are taken from it.
    max_draws : int, optional
        Draws for each number of contacts after which less than was asked for will do; by default
        100 times `samples`.

    Returns
    -------
    Coverage
        Its shares say how many samples there are: none where there is no such grasp.

    Raises
    ------
    PolygonError, FrictionError, OptionError
        If an argument has no meaning, or the graph is that of another object or friction.
    HandError
        If `hand` is no hand.

    Examples
    --------
    >>> wedge = Polygon([(0, 0), (4, 0), (4, 3)], name="wedge")
    >>> result = coverage(wedge, friction=0.5, samples=300)
    >>> result.grasps, result.switches.fraction, result.false_members
    (Share(found=300, of=300), 1.0, 0)
    """
    switches = samples if switches is None else switches
    max_draws = _DRAWS_EACH * samples if max_draws is None else max_draws
    for name, value in (("samples", samples), ("switches", switches), ("max_draws", max_draws)):
        least = 0 if name == "switches" else 1
        if not isinstance(value, (int, np.integer)) or value < least:
            raise OptionError(f"{name} must be a whole number of at least {least}, got {value!r}")
    cones = Cones.of(polygon, friction)
    hand = check_options(hand, sets, "contact", 0.0, "clarabel")
    if graph is not None:
        same = graph.polygon == polygon and np.array_equal(graph.friction, cones.friction)
        if not same:
            raise OptionError("graph is of another object or friction than those given")
    elif whole or (whole is None and polygon.n_edges <= WHOLE_LIMIT):
        graph = build_switching_graph(polygon, friction, hand, sets)
    if (hand if graph is None else graph.hand).limited:
        raise OptionError("coverage is not measured for a hand with limits: use Hand(fingers=k)")
    known: KnownSets = CombinationSets(cones, sets) if graph is None else GraphSets(graph)
    draws = RandomGrasps(polygon, cones.friction, proposal)
    run = Measurement(known, draws, np.random.default_rng(seed), int(max_draws))
    run.sample_grasps(int(samples))
    run.sample_switches(int(switches), hand if graph is None else graph.hand)
    return Coverage(
        polygon.name,
        polygon.n_edges,
        tuple(cones.friction[: 1 if np.ptp(cones.friction) == 0 else None].tolist()),
        sets if graph is None else graph.options.sets,
        proposal,
        seed,
        graph is not None,
        {label: Share(*run.found_of(label)) for label in run.grasps},
        {label: Share(*run.located_of(label)) for label in run.grasps},
        {label: Share(*counts) for label, counts in run.switches.items()},
        run.draws,
        run.false_members,
        run.n_combinations,
        known.n_combinations if isinstance(known, GraphSets) else None,
        tuple(run.missed),
        tuple(run.missed_switches),
        tuple(run.wrong),
    )
