from __future__ import annotations

import pytest

from heel.services.web.rate import RateLimiter


@pytest.mark.parametrize(
    ("source_hz", "cap_hz", "admitted"),
    [(25, 15, 150), (30, 15, 150), (60, 15, 150), (10, 15, 100), (15, 15, 150), (16, 15, 150)],
)
def test_ten_seconds_give_the_cap_or_all(source_hz: int, cap_hz: int, admitted: int) -> None:
    limiter = RateLimiter(cap_hz)
    passed = sum(limiter.admit(n / source_hz + 1e-9 * n) for n in range(10 * source_hz))
    assert passed == pytest.approx(admitted, abs=2)


def test_nothing_is_caught_up_after_a_pause() -> None:
    limiter = RateLimiter(10)
    limiter.admit(0.0)
    assert sum(limiter.admit(60 + n * 0.001) for n in range(50)) <= 2
