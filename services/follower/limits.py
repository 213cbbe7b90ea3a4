"""One velocity with limits on itself, on its change, and on the change of that."""

from __future__ import annotations

import math

_NEGLIGIBLE = 1e-9
"""Difference of speeds that is rounding, m/s or rad/s."""
_RATE_PER_S = 10.0
"""Of the filter: a small change of the wish is followed within 0.2 s."""


class LimitedVelocity:
    """Brings a velocity to a wished one, fast where it is far off and softly where it is near.

    Near it is a critically damped second-order filter, so that the jitter of estimates does not
    become jerk (with the limits alone, 95 % of the changes of a steady walk ran at the jerk limit).
    Far off, acceleration is bounded so that the jerk limit can take it back before the wished
    velocity is passed: by the greatest `a` with `a * dt + a^2 / (2 * jerk) <= wished - present`. As
    that holds in every step, whatever the steps are, a limit on the velocity is never passed.

    Args:
        acceleration: away from standstill, units per second squared.
        braking: towards standstill.
        jerk: change of acceleration, units per second cubed.
    """

    def __init__(self, acceleration: float, braking: float, jerk: float) -> None:
        self._acceleration = acceleration
        self._braking = braking
        self._jerk = jerk
        self.velocity = 0.0
        self._change = 0.0

    def stop(self) -> None:
        """Zero at once: limits shape motion, they never prolong it."""
        self.velocity = self._change = 0.0

    def towards(self, wished: float, dt_s: float) -> float:
        """The velocity for the next `dt_s` seconds."""
        if dt_s <= 0:
            return self.velocity
        error = wished - self.velocity
        step = self._jerk * dt_s
        root = math.sqrt(step * step + 2 * self._jerk * abs(error))
        greatest = 2 * self._jerk * error / (root + step)
        rate = _RATE_PER_S * dt_s
        soft = (self._change + _RATE_PER_S * rate * error) / (1 + 2 * rate + rate * rate)
        change = min(max(soft, min(0.0, greatest)), max(0.0, greatest))
        upper = self._acceleration if self.velocity >= 0 else self._braking
        lower = self._braking if self.velocity > 0 else self._acceleration
        change = min(max(change, -lower), upper)
        self._change = min(max(change, self._change - step), self._change + step)
        self.velocity += self._change * dt_s
        if abs(self.velocity - wished) < _NEGLIGIBLE:
            self.velocity = wished
        return self.velocity
