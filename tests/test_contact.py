from __future__ import annotations

import dataclasses
import math
import pickle
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from regrasp_lp.contact import Contact, Grasp, snap_fraction
from regrasp_lp.errors import ContactError


@pytest.mark.parametrize("edge", [True, np.True_, 1.0, "1", None, np.float64(2), 1j, [1], np.nan])
def test_an_edge_that_is_no_integer_is_refused(edge: Any) -> None:
    with pytest.raises(ContactError, match="integer"):
        Contact(edge, 0.5)


def test_a_negative_edge_is_refused() -> None:
    with pytest.raises(ContactError, match="there is no edge -1"):
        Contact(-1, 0.5)


@pytest.mark.parametrize("what", ["position", "fraction"])
@pytest.mark.parametrize("value", [True, np.False_, "0.5", [0.5], 1j])
def test_a_place_that_is_no_number_is_refused(what: str, value: Any) -> None:
    with pytest.raises(ContactError, match=f"{what} of the contact on edge 3 is no number"):
        Contact(3, **{what: value})


@pytest.mark.parametrize("what", ["position", "fraction"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, np.nan, 10**400])
def test_a_place_that_is_not_finite_is_refused(what: str, value: Any) -> None:
    with pytest.raises(ContactError, match=f"{what} of the contact on edge 3 has to be finite"):
        Contact(3, **{what: value})


def test_a_contact_without_a_place_is_refused() -> None:
    with pytest.raises(ContactError, match="has no place"):
        Contact(0)


@pytest.mark.parametrize("fraction", [-1e-11, 1 + 1e-11, 2, -3.0])
def test_a_fraction_off_the_edge_is_refused(fraction: float) -> None:
    with pytest.raises(ContactError, match="between 0"):
        Contact.at_fraction(0, fraction)


def test_fractions_snap_to_the_ends() -> None:
    assert [snap_fraction(f) for f in (-1e-12, -0.0, 1e-12, 1 - 1e-13, 1 + 1e-13)] == [
        0,
        0,
        0,
        1,
        1,
    ]
    assert snap_fraction(2e-12) == 2e-12
    assert snap_fraction(math.nan) is None
    assert math.copysign(1, Contact.at_fraction(0, -0.0).fraction or 0.0) == 1


def test_numbers_of_other_types_become_plain_ones() -> None:
    contact = Contact(np.int32(2), position=np.float32(0.5), fraction=Fraction(1, 4))  # type: ignore[arg-type]
    assert contact == Contact(2, 0.5, 0.25)
    assert type(contact.edge) is int
    assert type(contact.position) is type(contact.fraction) is float


def test_values_are_frozen() -> None:
    contact, grasp = Contact(1, 0.5), Grasp([(1, 0.5)])
    with pytest.raises(dataclasses.FrozenInstanceError):
        contact.edge = 2  # type: ignore[misc]
    with pytest.raises(dataclasses.FrozenInstanceError):
        grasp.contacts = ()  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        grasp.edges[0] = 3


def test_grasp_is_a_sequence_of_contacts() -> None:
    grasp = Grasp([(4, 0.3), Contact(0, 1.2), np.array([7, 2], dtype=int)])
    assert len(grasp) == 3
    assert list(grasp) == [Contact(4, 0.3), Contact(0, 1.2), Contact(7, 2.0)]
    assert grasp[1] == Contact(0, 1.2)
    assert grasp.edges.tolist() == [4, 0, 7]
    assert grasp.positions.tolist() == [0.3, 1.2, 2.0]
    assert len(Grasp([])) == 0
    assert Grasp([]).edges.dtype == np.intp


def test_grasps_compare_in_order() -> None:
    a, b = Contact(1, 0.5), Contact(2, 0.5)
    assert Grasp([a, b]) == Grasp([a, b])
    assert hash(Grasp([a, b])) == hash(Grasp([a, b]))
    assert Grasp([a, b]) != Grasp([b, a])
    assert Grasp([a]) != (a,)
    assert pickle.loads(pickle.dumps(Grasp([a, b]))) == Grasp([a, b])


def test_missing_places_say_what_to_do() -> None:
    with pytest.raises(ContactError, match=r"contact 1 .* polygon\.resolve"):
        _ = Grasp([Contact(0, 1.0, 0.5), Contact(3, 0.5)]).fractions
    with pytest.raises(ContactError, match="has no position yet"):
        _ = Grasp.at_fractions([(0, 0.5)]).positions


@pytest.mark.parametrize(
    "grasp",
    [
        Grasp([]),
        Grasp([(4, 0.3), (0, 1.2)]),
        Grasp.at_fractions([(4, 0.25), (1, 1.0)]),
        Grasp([Contact(0, 1.0), Contact.at_fraction(1, 0.5)]),
    ],
)
def test_repr_reads_back(grasp: Grasp) -> None:
    assert eval(repr(grasp), {"Grasp": Grasp, "Contact": Contact}) == grasp


@pytest.mark.parametrize(
    "contacts", [3, None, Contact(0, 1.0), [3], ["ab"], [(1,)], [(1, 2, 3)], [(1, None)]]
)
def test_what_is_no_list_of_contacts_is_refused(contacts: Any) -> None:
    with pytest.raises(ContactError):
        Grasp(contacts)


def test_fractions_come_in_pairs() -> None:
    with pytest.raises(ContactError, match=r"pair \(edge, fraction\)"):
        Grasp.at_fractions([(1, 0.5, 0.5)])  # type: ignore[list-item]
