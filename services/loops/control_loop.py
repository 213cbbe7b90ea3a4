"""Follower and drive on a simulated clock, as late as real processes: once for all loops."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from heel.schemas import DriveState, MotionCommand, Odometry, Ranges, Tracks
from heel.services.drive.core import Drive
from heel.services.follower.core import Follower

CONTROL_NS = 20_000_000
"""Follower and drive both run at 50 Hz, as their processes do."""
TRACKS_AGE_NS = 60_000_000
"""From acquisition to the follower's having the tracks, about what the processes take on two cores;
chosen by hand."""
_TRACKER = "tracker/main@00000000"
_FOLLOWER = "follower/main@00000000"

Seen = TypeVar("Seen")


@dataclass(frozen=True, slots=True)
class Body:
    """What the robot feels of itself.

    Attributes:
        odometry: how it moves.
        ranges: what its range sensors measured; None where they have nothing new.
    """

    odometry: Odometry
    ranges: Ranges | None = None


class ControlLoop(Generic[Seen]):
    """Calls follower and drive round by round; one round every `CONTROL_NS`.

    Args:
        follower: nobody chosen yet.
        drive: waiting.
        on_tracks: called with what was really to be seen in a picture, and its tracks, once the
            follower has those.
    """

    def __init__(
        self, follower: Follower, drive: Drive, on_tracks: Callable[[Tracks, Seen], None]
    ) -> None:
        self._follower, self._drive, self._on_tracks = follower, drive, on_tracks
        self._coming: deque[tuple[int, Tracks, Seen]] = deque()
        self._command: MotionCommand | None = None
        self._newest_ns: int | None = None

    def show(self, t_ns: int, tracks: Tracks, seen: Seen) -> None:
        """Send the tracks of a picture on their way to the follower.

        Args:
            t_ns: when the picture was taken.
            tracks: its tracks.
            seen: what was really to be seen in it.
        """
        self._coming.append((t_ns, tracks, seen))

    def round(self, now_ns: int, move: Callable[[DriveState], Body]) -> None:
        """Let the drive obey, and the follower decide.

        Args:
            now_ns: the time.
            move: lets the robot move as its wheels are told from now on; returns what it feels.
        """
        now_s = now_ns / 1e9
        # The drive's timer is not the follower's: it obeys the command of the round before.
        if self._command is not None:
            self._drive.take(self._command, _FOLLOWER, now_s)
        body = move(self._drive.step(now_s))
        self._follower.observe_odometry(body.odometry, now_s)
        if body.ranges is not None:
            self._follower.observe_ranges(body.ranges, now_s)
        while self._coming and self._coming[0][0] + TRACKS_AGE_NS <= now_ns:
            self._newest_ns, tracks, seen = self._coming.popleft()
            self._follower.observe(tracks, _TRACKER)
            self._on_tracks(tracks, seen)
        age_s = None if self._newest_ns is None else (now_ns - self._newest_ns) / 1e9
        self._command = self._follower.step(now_s, age_s)
