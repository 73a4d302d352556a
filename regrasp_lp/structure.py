"""How a switching graph hangs together: components and the number of its edges."""

from __future__ import annotations

from itertools import chain
from typing import NamedTuple

import numpy as np

from regrasp_lp.friction import IntArray
from regrasp_lp.grasp_sets.collection import GraspSets
from regrasp_lp.planning.hand import Hand
from regrasp_lp.switches import Switches


class Structure(NamedTuple):
    """Components of a graph, and how many switches it has.

    Parameters
    ----------
    component : numpy.ndarray of int, shape (N,)
        Of each set.
    within_kind : numpy.ndarray of int, shape (N,)
        Component among the sets of its own kind.
    n_switches : int
        Adjacent pairs, those that need to hold nothing included.
    """

    component: IntArray
    within_kind: IntArray
    n_switches: int


def structure(sets: GraspSets, switches: Switches, hand: Hand) -> Structure:
    """Return the components of a graph and the number of its switches.

    Parameters
    ----------
    sets : GraspSets
    switches : Switches
        Pairs may come again. Those that need to hold nothing are adjacent without being listed.
    hand : Hand

    Returns
    -------
    Structure
    """
    from scipy import sparse
    from scipy.sparse import csgraph

    n, contacts = len(sets), sets.contacts
    kinds = np.arange(len(sets.families)).repeat(np.diff(sets.offsets))

    def united(labels: IntArray, i: IntArray, j: IntArray) -> IntArray:
        one, other = labels[i], labels[j]
        apart = one != other
        pairs = (np.ones(apart.sum()), (one[apart], other[apart]))
        graph = sparse.coo_matrix(pairs, shape=(n, n))
        return np.asarray(csgraph.connected_components(graph, directed=False)[1][labels])

    count, joins = _implicit(contacts, hand)
    component: IntArray = np.arange(n)
    within: IntArray = np.arange(n)
    listed = [np.zeros(0, dtype=np.int64)]
    for i, j in chain(joins, ((p.first, p.second) for p in switches.pairs())):
        component = united(component, i, j)
        same = kinds[i] == kinds[j]
        within = united(within, i[same], j[same])
        counted = ~hand.adjacent[contacts[i], contacts[j]]
        listed.append(i[counted].astype(np.int64) * n + j[counted])
    keys = np.concatenate(listed)
    keys.sort()  # a pair may come again
    count += len(keys) - int(np.count_nonzero(keys[1:] == keys[:-1]))
    return Structure(component, within, count)


def _implicit(contacts: IntArray, hand: Hand) -> tuple[int, list[tuple[IntArray, IntArray]]]:
    """How many pairs need to hold nothing, and some of them that join as much as all do."""
    count = 0
    joins: list[tuple[IntArray, IntArray]] = []
    for a, b in ((2, 2), (2, 3), (3, 3)):
        one, other = np.flatnonzero(contacts == a), np.flatnonzero(contacts == b)
        if not hand.adjacent[a, b] or not one.size or not other.size:
            continue
        if a == b:
            count += len(one) * (len(one) - 1) // 2
            joins.append((one[:-1], one[1:]))
        else:  # two-finger sets are all adjacent to each other, too
            count += len(one) * len(other)
            joins.append((one[:1].repeat(len(other)), other))
    return count, joins
