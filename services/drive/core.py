"""The drive: may the wheels turn, and how fast. No transport, no clock of its own."""

from __future__ import annotations

import math
from typing import Literal

from heel.schemas import DriveState, MotionCommand
from heel.services.drive.settings import DriveSettings
from heel.services.runtime.sequence import SequenceWatch
from heel.services.runtime.streams import ProducerGate

_MAX_STEP_S = 0.2
"""A step that comes late must not be a leap in speed."""
_SETTLE_S = 0.1
"""Commands that waited while the drive hung come within this time after it goes on. A follower that
is there sends five new ones meanwhile."""
_State = Literal["waiting", "driving", "stopped"]


class Drive:
    """Turns motion commands into what the wheels are told, within limits of its own.

    Call `take` for every command and `step` at a fixed rate. Wheels turn only while the newest
    command of one producer is younger than its time to live and no emergency stop holds. Limits
    on acceleration shape the start of a motion and never prolong it: zero comes at once, or with
    `braking_mps2` where that is set. Turning always stops at once.

    A drive that has hung for longer than `ttl_s`, so that its wheels have stopped by themselves,
    starts from standing and forgets what waited for it.

    Args:
        settings: limits and times.
        gate: the sender that is believed; another one takes over when the first has been silent.
    """

    def __init__(self, settings: DriveSettings, gate: ProducerGate | None = None) -> None:
        self.settings = settings
        self._gate = gate or ProducerGate()
        self._numbers = SequenceWatch()
        self.refusal = ""
        """Why the last command was not new; "" if it was, or another producer's."""
        self._command: MotionCommand | None = None
        self._taken_s = 0.0
        self._idle: tuple[_State, str] = ("waiting", "no command yet")
        self._estop = False
        self._stepped_s: float | None = None
        self._deaf_until_s = -math.inf
        self._linear_mps = self._angular_radps = 0.0
        self._seq = 0

    def take(
        self, command: MotionCommand, producer: str, now_s: float, line: str | None = None,
        turn: int = 0,
    ) -> bool:  # fmt: skip
        """Take a command that has just arrived; False if it is not to be obeyed.

        Args:
            command: as decoded, so all its numbers are finite.
            producer: its sender. One producer is obeyed until it has been silent.
            now_s: monotonic time of its arrival.
            line: the first of those that the sender has taken over from, if any.
            turn: how often that line has been taken over.
        """
        self.refusal = ""
        new = not self._numbers.was_there(producer, command.seq)
        if not self._gate.accepts(producer, now_s, new, line, turn):
            return False
        if self._has_hung(now_s) or now_s < self._deaf_until_s:
            return False
        if not self._numbers.fresh(producer, command.seq, now_s, replaced=True):
            self.refusal = f"{producer}: {self._numbers.refusal}"
            return False
        if not self._estop:
            self._command, self._taken_s = command, now_s
        return True

    def set_estop(self, engaged: bool) -> None:
        """Engage or release the emergency stop; after it only a new command moves anything."""
        self._estop = engaged
        if engaged:
            self._forget("no command since the emergency stop")

    def end(self) -> None:
        """The commands have ended by themselves: stop without waiting for the watchdog."""
        self._forget("the commands have ended")

    def halt(self, reason: str, now_s: float) -> DriveState:
        """Zero at once, whatever braking is set: the drive itself ends."""
        self._forget(reason)
        self._linear_mps = self._angular_radps = 0.0
        return self._told("stopped", reason, now_s)

    def step(self, now_s: float) -> DriveState:
        """What the wheels are told from this moment on.

        Args:
            now_s: monotonic time, not before that of the last step.
        """
        dt_s = 0.0 if self._stepped_s is None else max(0.0, now_s - self._stepped_s)
        if self._has_hung(now_s):
            self._forget(f"the drive hung for {dt_s:.1f} s")
            self._linear_mps = self._angular_radps = 0.0
            self._deaf_until_s = now_s + _SETTLE_S
        self._stepped_s = now_s
        self._watch(now_s)
        state, reason, linear_mps, angular_radps = self._wished()
        s = self.settings
        self._linear_mps = _slew(
            self._linear_mps, linear_mps, s.max_linear_mps2 * min(dt_s, _MAX_STEP_S),
            math.inf if s.braking_mps2 is None else s.braking_mps2 * dt_s,
        )  # fmt: skip
        self._angular_radps = _slew(
            self._angular_radps, angular_radps, s.max_angular_radps2 * min(dt_s, _MAX_STEP_S),
            math.inf,
        )  # fmt: skip
        if state != "driving" and self._linear_mps:
            state, reason = "driving", f"braking: {reason}"[:96]
        return self._told(state, reason, now_s)

    def _has_hung(self, now_s: float) -> bool:
        longest_s = max(self.settings.ttl_s, _MAX_STEP_S)
        return self._stepped_s is not None and now_s - self._stepped_s > longest_s

    def _forget(self, reason: str) -> None:
        self._command = None
        self._idle = "stopped", reason

    def _watch(self, now_s: float) -> None:
        """Forget the command when its time is over."""
        if self._command is None:
            return
        ttl_s = min(self.settings.ttl_s, self._command.ttl_s)
        if not 0.0 <= now_s - self._taken_s < ttl_s:
            self._forget(f"no command for {ttl_s:g} s")

    def _wished(self) -> tuple[_State, str, float, float]:
        """State, reason, linear and angular velocity before limits on acceleration."""
        if self._estop:
            return "stopped", "emergency stop", 0.0, 0.0
        if self._command is None:
            return *self._idle, 0.0, 0.0
        s, command = self.settings, self._command
        linear_mps = min(max(command.linear_mps, -s.max_reverse_mps), s.max_linear_mps)
        angular_radps = min(max(command.angular_radps, -s.max_angular_radps), s.max_angular_radps)
        if linear_mps or angular_radps:
            return "driving", command.reason, linear_mps, angular_radps
        return "stopped", f"told to: {command.reason}"[:96], 0.0, 0.0

    def _told(self, state: _State, reason: str, now_s: float) -> DriveState:
        self._seq += 1
        command = self._command
        return DriveState(
            seq=self._seq - 1,
            state=state,
            reason=reason,
            estop=self._estop,
            driver=self.settings.driver,
            linear_mps=self._linear_mps,
            angular_radps=self._angular_radps,
            command_seq=None if command is None else command.seq,
            command_age_s=None if command is None else now_s - self._taken_s,
        )


def _slew(present: float, wished: float, speed_up: float, slow_down: float) -> float:
    """The next velocity on the way from `present` to `wished`, steps given as magnitudes.

    A change of direction passes through zero.
    """
    kept = abs(wished) if present * wished > 0 else 0.0
    if kept < abs(present):
        return math.copysign(max(kept, abs(present) - slow_down), present)
    return math.copysign(min(abs(wished), abs(present) + speed_up), wished)
