"""Each mechanism that `benchmarks.mechanisms` switches off is one of the tracker's."""

from __future__ import annotations

import pytest

from benchmarks.mechanisms import OFF, without
from heel.services.tracker.people import tracker as people
from heel.services.tracker.people.contacts import Contacts


@pytest.mark.parametrize("name", OFF)
def test_what_is_switched_off_is_there(name: str) -> None:
    with without(name):
        pass


def test_a_mechanism_is_off_within_its_context_alone() -> None:
    before = Contacts.touch, people._GIVE_UP
    with without("contacts"), without("give-up of doubtful ids"):
        assert Contacts.touch is not before[0]
        assert people._GIVE_UP < 0 < before[1]
    assert (Contacts.touch, people._GIVE_UP) == before
