"""One click in a drawn world: on somebody, and on what only looks like them."""

from __future__ import annotations

import pytest

from heel.services.loops.scenarios.clicks import Aim, click_in
from heel.services.loops.scenarios.episode import load_stack


@pytest.mark.parametrize(
    "aim",
    [
        "clothes",
        pytest.param("coat stand", marks=pytest.mark.slow),
        pytest.param("drawn person", marks=pytest.mark.slow),
        pytest.param("anything", marks=pytest.mark.slow),
    ],
)
def test_what_only_looks_like_a_person_is_not_driven_after(aim: Aim) -> None:
    outcome = click_in(load_stack("pixels", None), "straight", 3, aim)
    assert outcome is not None
    assert not outcome.driven
    assert not any(claim.proven for claim in outcome.claims if not claim.right)


def test_somebody_who_walks_off_is_proven_and_followed() -> None:
    outcome = click_in(load_stack("pixels", None), "straight", 3, "person")
    assert outcome is not None
    assert outcome.proven_s is not None
    assert outcome.proven_s < 5.0
    assert outcome.reason == "target in sight"
