"""The follower as a process: tracks in, commands out from a timer, target and e-stop on the side.

In a lossless run the stream is the clock: one command per tracks message, so that the commands
of a recording are the same every time.
"""

from __future__ import annotations

import math
import secrets
import threading
import time
from contextlib import ExitStack
from dataclasses import replace
from typing import TypeVar

import zenoh

from heel.schemas import (
    CameraInfo,
    EndOfStream,
    FollowState,
    HeelError,
    Manual,
    ManualGrant,
    ManualRequest,
    Message,
    MessageError,
    MotionCommand,
    Odometry,
    Ranges,
    SettingsError,
    Target,
    TargetRequest,
    Tracks,
    decode,
    encode,
    keys,
)
from heel.services.follower.camera_info import implausible
from heel.services.follower.core import Follower
from heel.services.follower.eyes import Eye, of_camera, open_eye
from heel.services.follower.kept import TargetFile
from heel.services.follower.sensors import Sensor
from heel.services.follower.settings import FollowerServiceSettings
from heel.services.follower.sights import Sights
from heel.services.follower.standby import Heard, StandbyFollower
from heel.services.follower.target import TargetError
from heel.services.runtime import places, qos
from heel.services.runtime.inbox import Arrival, Inbox
from heel.services.runtime.latched import latched_values
from heel.services.runtime.logs import StateLog
from heel.services.runtime.publishing import Latched
from heel.services.runtime.service import LOOP_WAIT_S, ServiceContext, run_service
from heel.services.runtime.settings import Loaded
from heel.services.runtime.stop_keeper import StopKeeper
from heel.services.runtime.streams import Received, StreamJudge
from heel.services.runtime.succession import Succession

_STOP_REPEATS = 5
"""Zero commands sent on the way out, so that one lost message cannot keep a robot rolling."""
_TOLD_S = 5.0
"""How long health tells of a camera's description that is not used."""
_STATE_PERIOD_S = 0.2
"""Distances and bearings are told that often while the state stays the same."""


M = TypeVar("M", bound=Message)


class FollowerService:
    """Wires the follower core to its topics; the core is guarded by one lock."""

    def __init__(
        self, context: ServiceContext[FollowerServiceSettings], resources: ExitStack,
        heard: Heard | None = None, first_seq: int = 0,
    ) -> None:  # fmt: skip
        """Declare everything.

        Args:
            context: of the process.
            resources: end what is declared.
            heard: what the follower before has left, where this one takes over from it.
            first_seq: number of the first command: those of one process go up.
        """
        self._context = context
        self._follower = Follower(context.settings, first_seq)
        self._heard = heard
        self.over = False
        """Whether the stream has ended, and the process with it."""
        self._lock = threading.Lock()
        self._told: tuple[object, ...] = ()
        self._state_log = StateLog(context.log)
        self._told_s = -math.inf
        session, settings = context.session, context.settings
        self._live = settings.delivery == "live"
        self._eye = open_eye(context, settings.camera, first=True)
        """The camera that the robot follows by."""
        self._others = {name: open_eye(context, name, first=False) for name in settings.cameras}
        self._sights = Sights(settings, (settings.camera, *settings.cameras))
        if self._live:
            self._ranges = context.subscribe("ranges", keys.ROBOT_RANGE, qos.RANGES, primary=False)
            self._odometry = context.subscribe(
                "odometry", keys.ROBOT_ODOMETRY, qos.ODOMETRY, primary=False
            )
            self._wishes = context.subscribe(
                "manual", keys.FOLLOW_MANUAL, qos.MANUAL, primary=False
            )
        self._note = self._target_file()
        self._out = context.publisher(keys.FOLLOW_COMMAND, qos.COMMAND)
        context.watch_for_twin(keys.FOLLOW_COMMAND, resources)
        self._succession: Succession | None = None
        if self._live:
            self._succession = Succession(
                session, self._out, keys.FOLLOW_COMMAND,
                ("follower", settings.camera, context.producer), resources, context.log,
            )  # fmt: skip
            line = None if heard is None else heard.line
            self._succession.lead(line, state=False, yields=settings.standby and line is None)
        self._state = resources.enter_context(
            Latched(session, keys.FOLLOW_STATE, qos.STATE.for_delivery(context.settings.delivery))
        )
        self._stop = StopKeeper(context, resources, self._obey_stop)
        self._target_out = session.declare_publisher(
            keys.FOLLOW_TARGET, priority=qos.TARGET.priority,
            congestion_control=qos.TARGET.congestion,
        )  # fmt: skip
        self._pointed_out = session.declare_publisher(
            keys.FOLLOW_POINTED, priority=qos.POINTED.priority,
            congestion_control=qos.POINTED.congestion,
        )  # fmt: skip
        self._answer_requests(resources)

    def _answer_requests(self, resources: ExitStack) -> None:
        """Answer who asks for a target, and live who asks to drive by hand."""
        session = self._context.session
        queryable = session.declare_queryable(keys.FOLLOW_TARGET, self._answer)
        resources.callback(queryable.undeclare)
        if self._live:
            by_hand = session.declare_queryable(keys.FOLLOW_MANUAL, self._answer_hand)
            resources.callback(by_hand.undeclare)

    @property
    def next_seq(self) -> int:
        """Number of the next command of this process."""
        return self._follower.next_seq

    def run(self) -> None:
        """Publish commands until the stream ends, the service is stopped or another one sends.

        The last ones are zeros, unless another one sends already.
        """
        self._catch_up()
        self._context.announce()
        successor = None
        try:
            if self._live:
                successor = self._run_by_timer()
            else:
                self._run_by_stream()
        finally:
            if self._may_send():
                self._stop_robot(successor)

    def _may_send(self) -> bool:
        return self._succession is None or self._succession.may_send(self._context.stop.wait)

    def _run_by_stream(self) -> None:
        for arrival in self._context.arrivals(self._eye.tracks, self._out):
            self._drain("estop")
            if self._eye.newest is None:
                self._ask_camera()
            if self._observe(arrival) and self._eye.newest is not None:
                self._publish(self._eye.newest.message.t_capture_ns * 1e-9, 0.0)

    def _run_by_timer(self) -> str | None:
        """Until the end, or until a successor is named: that one."""
        period_s = 1.0 / self._context.settings.rate_hz
        due_s = time.monotonic()
        while self._context.running:
            now_s = time.monotonic()
            if now_s >= due_s:
                if not self._may_send():
                    return None
                if self._succession is not None and (named := self._succession.successor()):
                    return named
                now_s = time.monotonic()
                age_s = None if self._eye.newest is None else self._eye.newest.age_s(now_s)
                self._publish(now_s, age_s)
                self._stop.save()
                self._stop.poll(now_s)
                if self._note is not None:
                    self._note.renew(now_s)
                due_s = max(due_s + period_s, now_s)
                self._look_after(now_s)
                continue
            arrival = self._context.inbox.get(min(due_s - now_s, LOOP_WAIT_S))
            if arrival is not None and self._others:
                arrival = self._of_this_camera(arrival)
            if arrival is None:
                pass
            elif arrival.topic != "tracks":
                with self._context.surviving(f"taking {arrival.topic}"):
                    self._side_message(arrival)
            elif arrival.encoding != EndOfStream.encoding():
                self._observe(arrival)
            else:
                self._eye.tracks.ending(arrival)
            if (end := self._eye.tracks.ended(time.monotonic())) is not None:
                self._context.log.info("stream ended after %d frames: %s", end.frames, end.reason)
                if self._context.settings.exit_at_end:
                    self._out.end(end)
                    self._context.linger()
                    self.over = True
                    return None
        return None

    def _observe(self, arrival: Arrival) -> bool:
        received = self._eye.tracks.message(arrival, Tracks)
        if received is None:
            return False
        if self._live and (received := self._dated(received)) is None:
            return False
        self._context.statistics.input(arrival.arrived_s)
        self._use_camera_of(received.message.epoch)
        with self._context.surviving("taking tracks"), self._lock:
            self._follower.observe(received.message, received.stamp.origin)
            self._eye.newest = received
            self._compare(self._eye)
        return True

    def _of_this_camera(self, arrival: Arrival) -> Arrival | None:
        """The message, if no other camera's is; those are taken here."""
        found = of_camera(arrival.topic, self._context.settings.camera)
        if found is None:
            return arrival
        topic, camera = found
        if camera == self._eye.camera:
            return replace(arrival, topic=topic)
        eye = self._others[camera]
        with self._context.surviving(f"taking {arrival.topic}"):
            try:
                if topic != "tracks":
                    eye.hear(topic, arrival)
                elif arrival.encoding != EndOfStream.encoding() and eye.observe(arrival):
                    with self._lock:
                        self._compare(eye)
                        self._take_better(arrival.arrived_s)
            except MessageError as error:
                self._context.statistics.malformed += 1
                self._context.warn.warning(
                    arrival.topic, f"{arrival.key}: {error}", arrival.arrived_s
                )
        return None

    def _compare(self, eye: Eye) -> None:
        """Tell which people of several cameras are one; under the lock."""
        if not self._others or eye.newest is None:
            return
        now_s = time.monotonic()
        if (info := eye.news(now_s) if eye is not self._eye else None) is not None:
            self._sights.set_camera(eye.camera, info)
        taken_s = now_s - eye.newest.age_s(now_s)
        self._sights.follow(self._eye.camera, self._follower.target.track_id)
        self._sights.observe(
            eye.camera, eye.newest.message, eye.newest.stamp.origin, taken_s,
            self._follower.pose_at(taken_s),
        )  # fmt: skip
        self._context.statistics.detail("sights", self._sights.words)

    def _take_better(self, now_s: float) -> None:
        """Follow by another camera if it sees the same person, and better; under the lock."""
        over = self._sights.better(now_s)
        if over is None or not self._follower.decided:
            return
        newest = self._others[over.camera].newest
        assert newest is not None
        self._look_with(over.camera)
        self._follower.hand_over(newest.message, newest.stamp.origin, over.track_id, over.words)
        self._sights.handed_over(over)
        self._context.log.info("%s is followed by camera %s as id %d: %s", "the target",
                               over.camera, over.track_id, over.words)  # fmt: skip

    def _look_with(self, camera: str) -> None:
        """Make another camera the one that the robot follows by; under the lock."""
        eye = self._others.pop(camera)
        self._others[self._eye.camera], self._eye = self._eye, eye
        epoch = None if eye.newest is None else eye.newest.message.epoch
        info = None if epoch is None else eye.infos.of(epoch)
        if info is not None:
            self._follower.set_camera(info)

    def _dated(self, received: Received[Tracks]) -> Received[Tracks] | None:
        """The same with the time at which its frame was taken; None if it is no frame of now."""
        now_s = received.arrived_s
        taken_s, wrong = self._eye.times.taken_s(received.message, now_s)
        if wrong:
            reason = f"{keys.tracks(self._eye.camera)}: {wrong}"
            self._context.warn.warning("taken", reason, now_s)
            self._context.statistics.problem("taken", reason, now_s + 1.0)
            return None
        if taken_s is None:
            ages = f"transit not counted: no {keys.taken(self._eye.camera)}"
        else:
            ages = "from acquisition" if self._eye.times.same_clock else "since the camera told"
        self._context.statistics.detail("ages", ages)
        return replace(received, taken_s=taken_s)

    def _use_camera_of(self, epoch: int) -> None:
        """From the first frame of a start of the camera on its description counts."""
        if epoch == self._eye.info_epoch:
            return
        info = self._eye.infos.of(epoch)
        if info is not None:
            self._eye.info_epoch = epoch
            with self._lock:
                self._follower.set_camera(info)
                self._sights.set_camera(self._eye.camera, info)

    def _look_after(self, now_s: float) -> None:
        """What the loop does between messages: words for health, a description still missing."""
        with self._lock:
            trouble = self._follower.trouble(now_s)
        if self._context.statistics.problem("sensors", trouble or None, now_s + 1.0) and trouble:
            self._context.log.warning("%s", trouble)
        if self._eye.newest is None or self._eye.info_epoch == self._eye.newest.message.epoch:
            return
        try:
            info = self._eye.info_asked.poll(now_s)
        except MessageError as error:
            self._context.warn.warning("info-asked", f"{keys.info('*')}: {error}", now_s)
            return
        if info is not None:
            self._take_info(info, now_s)

    def _publish(self, now_s: float, judged_age_s: float | None) -> None:
        """Send the command of this moment.

        Args:
            now_s: monotonic time, or the stream's in a lossless run.
            judged_age_s: age of the tracks by that clock; the true age goes into the stamp.
        """
        started_s = time.monotonic()
        command, state = None, None
        with self._context.surviving("following"), self._lock:
            command = self._follower.step(now_s, judged_age_s)
            state = self._follower.state
            self._context.statistics.problem("rate", self._follower.too_slow)
            self._context.statistics.problem("swing", self._follower.swings)
        if command is None or state is None:
            # Nothing is sent, and the drive stops by itself: sooner told than late.
            command = self._follower.halt("the follower cannot compute a command")
            state = self._follower.state
        age_s = 0.0 if self._eye.newest is None else self._eye.newest.age_s(time.monotonic())
        self._out.send(command, age_s)
        self._context.statistics.output(started_s, time.monotonic() - started_s, age_s)
        self._tell(state, started_s)

    def _tell(self, state: FollowState, now_s: float) -> None:
        """Publish the state when it changes and now and then between; log changes only.

        A lossless run tells it with every command: its files are the same every time.
        """
        target = state.target.track_id or state.target.mode
        self._state_log.tell(f"{state.state}: {state.reason} (target {target})", now_s)
        news = (state.state, state.reason, state.target, state.estop, state.driven_by)
        if news == self._told:
            if not self._live or now_s - self._told_s >= _STATE_PERIOD_S:
                self._told_s = now_s
                self._state.set(state)
            return
        if not self._told or self._told[2] != state.target:
            self._target_out.put(encode(state.target), encoding=state.target.encoding())
        if not self._told or (self._told[2], self._told[4]) != (state.target, state.driven_by):
            self._keep_target()
        self._told, self._told_s = news, now_s
        self._state.set(state)

    def _drain(self, *topics: str) -> None:
        while (arrival := self._context.inbox.get(0, *topics)) is not None:
            self._side_message(arrival)

    def _side_message(self, arrival: Arrival) -> None:
        try:
            if arrival.topic == "estop":
                self._stop.hear(arrival)
            elif arrival.topic == "info":
                info = decode(CameraInfo, arrival.payload, arrival.encoding)
                self._take_info(info, arrival.arrived_s)
            elif arrival.topic == "taken":
                self._take_taken(arrival)
            elif arrival.topic == "ranges":
                self._take_ranges(arrival)
            elif arrival.topic == "manual":
                self._take_wish(arrival)
            else:
                self._take_odometry(arrival)
        except MessageError as error:
            self._context.statistics.malformed += 1
            self._context.warn.warning(arrival.topic, f"{arrival.key}: {error}", arrival.arrived_s)

    def _take_taken(self, arrival: Arrival) -> None:
        self._eye.hear("taken", arrival)

    def _take_ranges(self, arrival: Arrival) -> None:
        received = self._ranges.message(arrival, Ranges)
        with self._lock:
            if received is not None:
                self._follower.observe_ranges(received.message, _measured_s(received))
            else:
                self._refuse("ranges", self._ranges, arrival.arrived_s)

    def _take_odometry(self, arrival: Arrival) -> None:
        received = self._odometry.message(arrival, Odometry)
        with self._lock:
            if received is not None:
                self._follower.observe_odometry(received.message, _measured_s(received))
            else:
                self._refuse("odometry", self._odometry, arrival.arrived_s)

    def _take_wish(self, arrival: Arrival) -> None:
        received = self._wishes.message(arrival, Manual)
        if received is None:
            return
        with self._lock:
            refusal = self._follower.observe_wish(
                received.message, _measured_s(received), arrival.arrived_s
            )
        if refusal:
            words = f"{arrival.key}: {received.stamp.producer}: {refusal}"
            self._context.warn.warning("manual", words, arrival.arrived_s)

    def _refuse(self, sensor: Sensor, judge: StreamJudge, now_s: float) -> None:
        """A reading that cannot be read counts against its sensor."""
        if judge.unreadable:
            self._follower.refuse(sensor, judge.unreadable, now_s, judge.unreadable_known)

    def _obey_stop(self, engaged: bool) -> None:
        with self._lock:
            self._follower.set_estop(engaged)

    def _take_info(self, info: CameraInfo, now_s: float) -> None:
        if wrong := self._eye.infos.hear(info):
            reason = f"{keys.info(self._eye.camera)}: {wrong}"
            self._context.warn.warning("info", reason, now_s)
            self._context.statistics.problem("info", reason, now_s + _TOLD_S)
            epoch = None if self._eye.newest is None else self._eye.newest.message.epoch
            if implausible(info) and info.epoch == epoch != self._eye.info_epoch:
                # No other sender describes the camera in use: the standard lens would be a guess.
                with self._lock:
                    self._follower.refuse("camera", wrong, now_s)
        elif self._eye.newest is not None and info.epoch == self._eye.newest.message.epoch:
            self._eye.info_epoch = None
            self._use_camera_of(info.epoch)

    def _catch_up(self) -> None:
        """A follower that restarts must forget neither a stop nor the person chosen."""
        self._stop.catch_up(None if self._heard is None else self._heard.stop)
        self._ask_camera()
        if self._heard is not None:
            if self._heard.kept is not None:
                self._follower.restore(self._heard.kept)
        elif self._note is not None and (kept := self._note.load()) is not None:
            self._follower.restore(kept)

    def _target_file(self) -> TargetFile | None:
        context = self._context
        if not self._live:
            return None
        try:
            folder = places.run_folder()
        except SettingsError:
            # The emergency stop has warned of it.
            return None
        run = places.private_run()
        name = f"target-{context.robot}-{context.settings.instance}{run and f'-{run}'}"
        return TargetFile(folder / name, context.log)

    def _keep_target(self) -> None:
        if self._note is not None:
            with self._lock:
                kept = self._follower.kept
            self._note.save(kept)

    def _ask_camera(self) -> None:
        context = self._context
        key = keys.info(self._eye.camera)
        for info in latched_values(context.session, key, CameraInfo, context.log, context.stop):
            self._take_info(info, time.monotonic())

    def _answer(self, query: zenoh.Query) -> None:
        """Serve `follow/target`: no payload reads, a `TargetRequest` chooses."""
        with query:
            try:
                if query.payload is None:
                    target = self._follower.target
                else:
                    request = decode(TargetRequest, query.payload.to_bytes())
                    target = self._choose(request)
            except HeelError as error:
                query.reply_err(str(error), encoding=zenoh.Encoding.TEXT_PLAIN)
                return
            query.reply(keys.FOLLOW_TARGET, encode(target), encoding=target.encoding())

    def _answer_hand(self, query: zenoh.Query) -> None:
        """Serve `follow/manual`: take the robot, or hand it back."""
        with query:
            try:
                payload = b"" if query.payload is None else query.payload.to_bytes()
                request = decode(ManualRequest, payload)
                grant = secrets.token_hex(8) if request.take else None
                with self._lock:
                    if grant is None:
                        self._follower.hand_back(time.monotonic())
                    else:
                        self._follower.take_by_hand(grant, request.source, time.monotonic())
            except HeelError as error:
                query.reply_err(str(error), encoding=zenoh.Encoding.TEXT_PLAIN)
                return
            told = ManualGrant(grant=grant, source="" if grant is None else request.source)
            query.reply(keys.FOLLOW_MANUAL, encode(told), encoding=told.encoding())

    def _choose(self, request: TargetRequest) -> Target:
        """Choose; a point without a track is told to the detector besides."""
        with self._lock:
            if self._others:
                self._look_where_chosen(request)
            target = self._follower.choose(request)
            pointed = self._follower.pointed
        if pointed is not None and self._live:
            self._pointed_out.put(encode(pointed), encoding=pointed.encoding())
        return target

    def _look_where_chosen(self, request: TargetRequest) -> None:
        """Turn to the camera whose tracker gave out the id that is chosen.

        Raises:
            TargetError: a point, which says nothing of a camera.
        """
        if request.mode == "point":
            raise TargetError("in which of several cameras? choose a person that has a box")
        for camera, eye in self._others.items():
            newest = eye.newest
            if newest is not None and request.tracker == newest.stamp.origin:
                self._look_with(camera)
                self._follower.observe(newest.message, newest.stamp.origin)
                return

    def _stop_robot(self, successor: str | None) -> None:
        """Zero velocity on every way out; the robot's own watchdog covers the rest."""
        with self._lock:
            self._follower.set_estop(True)
            command = self._follower.step(time.monotonic(), None)
        command = command.model_copy(update={"reason": "the follower ends"})
        assert isinstance(command, MotionCommand)
        if self._live:
            for _ in range(_STOP_REPEATS):
                # In each: they are one command, of which a receiver takes the first that comes.
                self._out.send(command, 0.0, successor)


def _measured_s(received: Received[M]) -> float:
    """When the robot measured it, on this process's monotonic clock."""
    return received.arrived_s - received.stamp.age_ns * 1e-9


def serve(context: ServiceContext[FollowerServiceSettings]) -> None:
    """Follow, or stand by, until the stream ends or the service is stopped."""
    live = context.settings.delivery == "live"
    stands_by, heard, next_seq = context.settings.standby and live, None, 0
    while True:
        # Either part has subscriptions of its own.
        if stands_by:
            context.announce()
            with ExitStack() as resources, Inbox(context.session) as inbox:
                heard = StandbyFollower(context, inbox).wait(resources)
            if not context.running:
                return
        with ExitStack() as resources:
            own = replace(context, inbox=resources.enter_context(Inbox(context.session)))
            service = FollowerService(own, resources, heard, next_seq)
            service.run()
            next_seq, stands_by = service.next_seq, True
        if not live or service.over or not context.running:
            return


def run(loaded: Loaded[FollowerServiceSettings]) -> int:
    """Run the follower process; returns its exit code."""
    return run_service("follower", loaded, serve)
