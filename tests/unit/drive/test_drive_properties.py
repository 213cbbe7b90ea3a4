"""Whatever happens in whatever order: limits hold, silence is zero, an emergency stop absorbs."""

from __future__ import annotations

import math

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from heel.schemas import DriveState, MotionCommand, decode, encode
from heel.services.drive.core import Drive
from heel.services.drive.settings import DriveSettings
from heel.services.runtime.streams import ProducerGate

_ROUNDING = 1e-9
_PRODUCERS = ("follower/main@00000001", "follower/main@00000002")
_SETTINGS = st.builds(
    DriveSettings,
    ttl_s=st.sampled_from([0.05, 0.5, 2.0]),
    max_linear_mps=st.sampled_from([0.0, 1.0, 5.0]),
    max_reverse_mps=st.sampled_from([0.0, 0.3, 5.0]),
    max_angular_radps=st.sampled_from([0.0, 1.5, 10.0]),
    max_linear_mps2=st.floats(0.1, 20.0),
    max_angular_radps2=st.floats(0.1, 50.0),
    braking_mps2=st.sampled_from([None, None, 0.5, 5.0]),
)
_SPEED = st.sampled_from([0.0, 1e-300, 0.4, -0.4]) | st.floats(-5.0, 5.0)
_TURN = st.sampled_from([0.0, 1.0, -1.0]) | st.floats(-10.0, 10.0)


class AnyOrder(RuleBasedStateMachine):
    """Drives a drive as its service would, with a model of what it is allowed to do."""

    @initialize(chosen=_SETTINGS)
    def start(self, chosen: DriveSettings) -> None:
        self.settings = chosen
        self.drive = Drive(chosen)
        self.now_s = 100.0
        self.estop = False
        self.gate = ProducerGate()
        """Says who is listened to, also while the drive takes nothing."""
        self.producer: str | None = None
        """Whose numbers count."""
        self.seqs = dict.fromkeys(_PRODUCERS, -1)
        self.proven: dict[str, int] = {}
        """Up to where commands of those who sent more than one are never obeyed again."""
        self.ends_s = -math.inf
        """Until when the newest command may move anything."""
        self.stepped_s: float | None = None
        self.deaf_until_s = -math.inf
        self.before = (0.0, 0.0)

    @rule(
        linear=_SPEED, angular=_TURN, ttl_s=st.sampled_from([0.01, 0.2, 0.5, 5.0]),
        producer=st.sampled_from([*_PRODUCERS[:1] * 3, _PRODUCERS[1]]),
        ahead=st.sampled_from([1, 1, 1, 1, 5, 0, -3]),
    )  # fmt: skip
    def command_comes(
        self, linear: float, angular: float, ttl_s: float, producer: str, ahead: int
    ) -> None:
        """The next command of a producer, now and then an old one."""
        seq = max(0, self.seqs[producer] + ahead)
        made = MotionCommand(
            seq=seq, linear_mps=linear, angular_radps=angular, ttl_s=ttl_s, state="following",
            reason="target in sight",
        )  # fmt: skip
        taken = self.drive.take(made, producer, self.now_s)
        new = seq > self.proven.get(producer, -1)
        if not self.gate.accepts(producer, self.now_s, new):
            assert not taken, "two producers at once"
            return
        if self._has_hung() or self.now_s < self.deaf_until_s:
            assert not taken, "what waited while the drive hung"
            return
        assert taken == (new and (producer != self.producer or seq > self.seqs[producer]))
        if taken:
            if producer == self.producer or producer in self.proven:
                self.proven[producer] = seq
            self.producer, self.seqs[producer] = producer, seq
            if not self.estop:
                self.ends_s = self.now_s + min(self.settings.ttl_s, ttl_s)

    @rule(ticks=st.integers(2, 12))
    def robot_drives(self, ticks: int) -> None:
        """A good while at 50 Hz, so that there is a speed to lose."""
        producer = self.producer or _PRODUCERS[0]
        for _ in range(ticks):
            self.command_comes(0.9, 0.7, 0.5, producer, 1)
            self.time_passes(0.02, 1)

    @rule(engaged=st.booleans())
    def estop_changes(self, engaged: bool) -> None:
        """Engaged or released by somebody."""
        self.drive.set_estop(engaged)
        self.estop = engaged
        if engaged:
            self.ends_s = -math.inf

    @rule()
    def commands_end(self) -> None:
        """The stream of commands ends."""
        self.drive.end()
        self.ends_s = -math.inf

    @rule(gap_s=st.sampled_from([0.02, 0.02, 0.02, 0.0, -0.5, 0.3, 10.0]), ticks=st.integers(1, 4))
    def time_passes(self, gap_s: float, ticks: int) -> None:
        """Rounds of the watchdog, also late ones and a clock that stands or steps back."""
        for _ in range(ticks):
            self.now_s += gap_s
            if gap_s < 0.0:
                # No such clock is used; what matters is that nothing moves because of it.
                self.ends_s = -math.inf
            self._check(self.drive.step(self.now_s))

    def _has_hung(self) -> bool:
        longest_s = max(self.settings.ttl_s, 0.2)
        return self.stepped_s is not None and self.now_s - self.stepped_s > longest_s

    def _check(self, told: DriveState) -> None:
        if self._has_hung():
            self.ends_s = -math.inf
            self.deaf_until_s = self.now_s + 0.1
            self.before = (0.0, 0.0)
        s, now = self.settings, (told.linear_mps, told.angular_radps)
        dt_s = 0.0 if self.stepped_s is None else max(0.0, self.now_s - self.stepped_s)
        self.stepped_s = self.now_s
        assert all(map(math.isfinite, now))
        assert -s.max_reverse_mps - _ROUNDING <= now[0] <= s.max_linear_mps + _ROUNDING
        assert abs(now[1]) <= s.max_angular_radps + _ROUNDING
        for value, old, limit in zip(
            now, self.before, (s.max_linear_mps2, s.max_angular_radps2), strict=True
        ):
            kept = old if value * old > 0 else 0.0
            assert abs(value) - abs(kept) <= limit * dt_s + _ROUNDING, "too fast too soon"
        if self.estop or self.now_s >= self.ends_s:
            self._stands(told, dt_s)
        assert told.estop == self.estop
        assert decode(DriveState, encode(told)) == told
        self.before = now

    def _stands(self, told: DriveState, dt_s: float) -> None:
        braking = self.settings.braking_mps2
        assert told.angular_radps == 0.0
        allowed = 0.0 if braking is None else max(0.0, abs(self.before[0]) - braking * dt_s)
        assert abs(told.linear_mps) <= allowed + _ROUNDING
        assert (told.state == "driving") == (told.linear_mps != 0.0)


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(
    max_examples=100, stateful_step_count=40, deadline=None, derandomize=True
)
