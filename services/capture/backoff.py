"""How long to wait before connecting again."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Backoff:
    """Exponential back-off: `first_s`, doubled with every attempt, at most `limit_s` seconds."""

    first_s: float = 0.2
    limit_s: float = 5.0

    def delay_s(self, attempt: int) -> float:
        """Seconds to wait before attempt number `attempt`, which counts from 1."""
        # The exponent is capped: a camera may be away for weeks, and 2.0**1024 overflows.
        return min(self.limit_s, self.first_s * 2.0 ** min(attempt - 1, 32))
