"""Observation of a simulated world: which person the robot acts upon, frame by frame."""

from __future__ import annotations

from collections import OrderedDict
from typing import Protocol

from heel.schemas import FollowState, SimTruth, Tracks
from heel.services.loops.judge import people_by_track
from heel.services.loops.user import Choose, User, View

_KEPT_TRUTHS = 128
"""Frames that tracks may be late by: 4 s at 30 frames/s; chosen by hand."""


class Recorder(Protocol):
    """Records what an `Onlooker` observes."""

    def episode(self) -> None:
        """A new world begins."""

    def record(self, truth: SimTruth, state: FollowState | None, people: dict[int, int]) -> None:
        """The world in one frame.

        Args:
            truth: of this frame.
            state: the follower's newest; None before its first.
            people: index of the person by track id, of the newest tracks.
        """


class Onlooker:
    """Puts truth, tracks and the follower's state together as they come, and clicks as a user does.

    Args:
        recorder: gets every frame of the world.
        click: sends a request to the follower, without waiting for the reply.
    """

    def __init__(self, recorder: Recorder, click: Choose) -> None:
        self._recorder, self._click = recorder, click
        self._state: FollowState | None = None
        self._user = User()
        self._truths: OrderedDict[int, SimTruth] = OrderedDict()
        self._people: dict[int, int] = {}

    def episode(self) -> None:
        """A new world begins."""
        self._user = User()
        self._truths.clear()
        self._people = {}
        self._recorder.episode()

    def state(self, state: FollowState) -> None:
        """The follower's newest state."""
        self._state = state

    def truth(self, truth: SimTruth) -> None:
        """The world in one frame."""
        self._truths[truth.seq] = truth
        while len(self._truths) > _KEPT_TRUTHS:
            self._truths.popitem(last=False)
        self._recorder.record(truth, self._state, self._people)

    def tracks(self, tracks: Tracks) -> None:
        """The tracks of one frame; those of a frame that is not known are left out."""
        truth = self._truths.get(tracks.seq)
        if truth is None:
            return
        self._people = people_by_track(truth, tracks)
        if self._state is not None:
            view = View(truth.t_s, self._state.target, truth, self._people)
            self._user.act(view, self._click)
