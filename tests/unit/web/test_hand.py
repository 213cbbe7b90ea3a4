"""What a browser says of a hand is believed only if it is of this moment and of the right form."""

from __future__ import annotations

import math

import pytest

from heel.services.web.hand import Beats, Wish, read_wish
from heel.services.web.requests import BadRequestError


def test_a_wish_is_read() -> None:
    read = read_wish('{"beat": 12, "held": true, "forward": 0.5, "left": -1}')
    assert read == Wish(12, True, 0.5, -1.0)


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "null", "{", '{"beat": 1}', "[" * 5000,
        '{"beat": 1, "held": true, "forward": NaN, "left": 0}',
        '{"beat": 1, "held": true, "forward": Infinity, "left": 0}',
        '{"beat": 1, "held": true, "forward": 1.01, "left": 0}',
        '{"beat": 1, "held": true, "forward": true, "left": 0}',
        '{"beat": 1, "held": true, "forward": "1", "left": 0}',
        '{"beat": 1, "held": 1, "forward": 1, "left": 0}',
        '{"beat": true, "held": true, "forward": 1, "left": 0}',
        '{"beat": 1, "held": true, "forward": 1, "left": 0, "ttl_s": 9}',
    ],
)  # fmt: skip
def test_what_is_no_wish_is_refused(text: str) -> None:
    with pytest.raises(BadRequestError, match="forward"):
        read_wish(text)


def test_a_wish_is_as_old_as_the_number_that_it_repeats() -> None:
    beats = Beats()
    first, second = beats.next(10.0), beats.next(10.5)
    assert beats.age_s(first, 11.0) == 1.0
    assert beats.age_s(second, 11.0) == 0.5
    for unknown in (-1, 2, 10**30):
        assert beats.age_s(unknown, 11.0) == math.inf
    for number in range(100):
        beats.next(11.0 + number)
    assert beats.age_s(first, 200.0) == math.inf, "forgotten: nothing grows with a long drive"
