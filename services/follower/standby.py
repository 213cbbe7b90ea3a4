"""A follower that stands by: it hears whom the other one follows, and sends nothing."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass

from heel.schemas import EndOfStream, EStop, FollowState, MotionCommand, Tracks, decode, keys
from heel.services.follower.kept import KeptTarget, Scene
from heel.services.follower.settings import FollowerServiceSettings
from heel.services.runtime import qos
from heel.services.runtime.chain import STANDBY
from heel.services.runtime.inbox import Arrival, Inbox
from heel.services.runtime.latched import latched_values
from heel.services.runtime.service import ServiceContext
from heel.services.runtime.stop_keeper import stop_of
from heel.services.runtime.stop_latch import StopLatch
from heel.services.runtime.streams import StreamJudge
from heel.services.runtime.succession import Line, StandingBy

_TURN_S = 0.05
"""Longest wait [s] before it looks whether to take over."""


@dataclass
class Heard:
    """What the follower before has left to the one that takes over.

    Attributes:
        line: of its commands; None: none were heard.
        kept: the person that it followed, if it did.
        stop: the emergency stop that holds; None: none does.
    """

    line: Line | None = None
    kept: KeptTarget | None = None
    stop: EStop | None = None


class StandbyFollower:
    """Waits for the other follower to end, to hang, or to hand over.

    The robot's motion is the business of the one that sends; this one starts at rest, and moves
    only after it has made sure of the same person, by the same tracker's id.
    """

    def __init__(self, context: ServiceContext[FollowerServiceSettings], inbox: Inbox) -> None:
        self._context = context
        camera = context.settings.camera
        self._inbox = inbox
        self._commands = self._judge("commands", keys.FOLLOW_COMMAND, qos.COMMAND)
        self._tracks = self._judge("tracks", keys.tracks(camera), qos.TRACKS)
        inbox.subscribe("state", keys.FOLLOW_STATE, qos.STATE)
        inbox.subscribe("estop", keys.FOLLOW_ESTOP, qos.ESTOP)
        # The one that hands over, or is gone, does not answer for the stop that it held.
        self._stop = StopLatch()
        self._state: FollowState | None = None
        self._scene: Scene | None = None
        self._tracker: str | None = None

    def wait(self, resources: ExitStack) -> Heard:
        """Until it is time to take over, or the process is to end."""
        context = self._context
        for state in latched_values(
            context.session, keys.FOLLOW_STATE, FollowState, context.log, context.stop
        ):
            self._state = state
        asked_s = time.monotonic()
        stops = latched_values(context.session, keys.FOLLOW_ESTOP, EStop, context.log, context.stop)
        self._stop.hear_answers(stops, asked_s)
        begun_s = time.monotonic()
        standing = StandingBy(context.session, context.producer, resources)
        while context.running and not standing.is_due(begun_s, self._scene is not None):
            with context.surviving("standing by"):
                for arrival in self._inbox.all_of(_TURN_S):
                    if arrival.encoding != EndOfStream.encoding():
                        self._hear(arrival, standing)
            context.statistics.detail(STANDBY, standing.told(self._scene is not None,
                                                             "it hears no tracks"))  # fmt: skip
        context.statistics.detail(STANDBY, None)
        kept = self._kept()
        if context.running:
            whom = "nobody" if kept is None else kept.target.track_id
            context.log.warning("%s: taking over; followed: %s", standing.why, whom)
        return Heard(standing.line, kept, self._stop.current)

    def _judge(self, topic: str, key: str, how: qos.TopicQos) -> StreamJudge:
        self._inbox.subscribe(topic, key, how)
        context = self._context
        return StreamJudge(topic, how, context.statistics, context.warn, primary=False)

    def _hear(self, arrival: Arrival, standing: StandingBy) -> None:
        if arrival.topic == "commands":
            command = self._commands.message(arrival, MotionCommand)
            if command is not None:
                standing.hear(command.stamp, command.arrived_s)
        elif arrival.topic == "estop":
            self._stop.hear(stop_of(arrival, self._context), arrival.arrived_s)
        elif arrival.topic == "state":
            self._state = decode(FollowState, arrival.payload, arrival.encoding)
        else:
            tracks = self._tracks.message(arrival, Tracks)
            if tracks is not None:
                told = tracks.message
                self._scene = (told.stream, told.epoch, told.width, told.height)
                self._tracker = tracks.stamp.origin

    def _kept(self) -> KeptTarget | None:
        """The person followed, if the ids are still those of the tracker that gave that one."""
        state = self._state
        if state is None or self._scene is None or state.target.track_id is None:
            return None
        if state.driven_by:
            # By hand: it was not following, and following is for somebody to choose.
            return None
        if state.target.tracker != self._tracker:
            return None
        return KeptTarget(target=state.target, scene=self._scene)
