"""The web page as a process: images and tracks in, pictures out to browsers."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

import cv2
import zenoh

from heel.schemas import (
    DriveState,
    EndOfStream,
    EStop,
    FollowState,
    Header,
    Health,
    MessageError,
    MotionCommand,
    Stamp,
    TrackEvent,
    Tracks,
    decode,
    keys,
)
from heel.services.runtime import qos
from heel.services.runtime.chain import Problem
from heel.services.runtime.chain import describe as describe_problems
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.latched import LatchedQuery
from heel.services.runtime.robots import ROBOTS_PAGE
from heel.services.runtime.service import LOOP_WAIT_S, ServiceContext, run_service
from heel.services.runtime.settings import Loaded
from heel.services.runtime.streams import StreamJudge
from heel.services.web.above import ViewFromAbove
from heel.services.web.control import Control
from heel.services.web.frames import ViewFrame, describe
from heel.services.web.handlers import Site
from heel.services.web.hub import Hub
from heel.services.web.joiner import FrameJoiner, HeldImage, Joined
from heel.services.web.picture import to_jpeg
from heel.services.web.rate import RateLimiter
from heel.services.web.robots_page import serve_robots
from heel.services.web.serving import serving
from heel.services.web.settings import WebServiceSettings
from heel.services.web.status import StatusBoard

_TRACKS_DEADLINE_S = 0.4
"""A picture waits so long for its tracks, then goes without: twice what a slow detector takes."""
_HELD_IMAGES = 32
"""Bound of the pictures that wait for their tracks: a second of a camera."""
_HELD_BYTES = 64_000_000
"""Bound of their memory: 32 pictures of 900 x 700 pixels."""
_STALE_AFTER_S = 1.0
"""The page warns when no picture came for so long: longer than any hiccup of a network."""

_STATUS_PERIOD_S = 0.2
"""Seconds between two messages of state to the page; chosen by hand."""
_ROUTER_PERIOD_S = 0.2
"""Seconds between two looks whether the router is there; chosen by hand."""
_RECONNECT_S = 2.0
"""Seconds after the router is back in which clients come back, too: they take less than one."""
# Deeper than for a detector, so that a burst after a pause still meets its tracks.
_IMAGE_QOS = replace(qos.IMAGE, capacity=8)
_TRACKS_QOS = replace(qos.TRACKS, capacity=16)


class WebService:
    """Wires joiner, status and viewers to their topics; runs in the service's loop."""

    def __init__(
        self, context: ServiceContext[WebServiceSettings], hub: Hub, control: Control
    ) -> None:
        self._context = context
        self._settings = context.settings
        self._hub = hub
        self._control = control
        settings = context.settings
        self._joiner = FrameJoiner(_TRACKS_DEADLINE_S, _HELD_IMAGES, _HELD_BYTES)
        self._rate = RateLimiter(settings.max_fps)
        self._board = StatusBoard(settings.camera, _STALE_AFTER_S, context.producer)
        self._capped = self._unreadable = 0
        self._router = True
        self._router_back_s = float("-inf")
        self._latched = LatchedQuery(context.session, keys.FOLLOW_STATE, FollowState)
        self._status_due_s = self._router_due_s = 0.0
        inbox = context.inbox
        # As viewers need them: live also where the pipeline runs lossless.
        self._images = context.subscribe_images(_IMAGE_QOS, "live")
        inbox.subscribe("tracks", keys.tracks(settings.camera), _TRACKS_QOS)
        self._tracks = StreamJudge(
            "tracks", _TRACKS_QOS, context.statistics, context.warn, primary=False
        )
        inbox.subscribe("state", keys.FOLLOW_STATE, qos.STATE)
        inbox.subscribe("command", keys.FOLLOW_COMMAND, qos.COMMAND)
        inbox.subscribe("estop", keys.FOLLOW_ESTOP, qos.ESTOP)
        inbox.subscribe("events", keys.events(settings.camera), qos.EVENTS)
        inbox.subscribe("health", keys.ALL_HEALTH, qos.HEALTH)
        inbox.subscribe("drive", keys.ROBOT_DRIVE, qos.DRIVE)
        inbox.subscribe_alive("alive", keys.ALL_ALIVE)
        self._above = ViewFromAbove(context, hub)

    def run(self) -> None:
        """Show what comes until the service is stopped."""
        while self._context.running and not self._is_over():
            arrival = self._context.inbox.get(self._wait_s(time.monotonic()))
            if arrival is not None:
                with self._context.surviving("showing"):
                    self._take(arrival)
            now_s = time.monotonic()
            if (end := self._images.ended(now_s)) is not None:
                self._board.end(end)
                self._context.log.info("stream ended after %d frames: %s", end.frames, end.reason)
            self._show(self._joiner.due(now_s))
            if now_s >= self._status_due_s:
                self.tick(now_s)

    def tick(self, now_s: float) -> None:
        """What is done a few times a second: status, router, latched state, pending stop."""
        self._status_due_s = now_s + _STATUS_PERIOD_S
        if not self._hub.watched and self._joiner.waiting:
            self._joiner.clear()
        if now_s >= self._router_due_s:
            self._router_due_s = now_s + _ROUTER_PERIOD_S
            self._check_router()
        self._report(now_s)
        self._catch_up(now_s)
        if self._router:
            self._above.catch_up(now_s)
        self._control.look_after_stop(now_s)
        self._hub.put_note("status", self._status(now_s))

    def _report(self, now_s: float) -> None:
        """Say in this service's own health, too, which parts are missing: it may be asked later."""
        words = "; ".join(one.words for one in self._problems(now_s))
        self._context.statistics.problem("chain", words[:400] or None)

    def _problems(self, now_s: float) -> list[Problem]:
        # While the router is away nothing is known of any part; clients are back within a second.
        known = self._router and now_s - self._router_back_s > _RECONNECT_S
        return self._board.problems(now_s) if known else []

    def _is_over(self) -> bool:
        # The last frames still wait for their tracks when the end of the images is announced.
        ended = self._board.has_ended and self._joiner.waiting == 0
        return ended and self._settings.exit_at_end

    def _wait_s(self, now_s: float) -> float:
        due_s = min(self._status_due_s, self._joiner.next_due_s() or self._status_due_s)
        return min(LOOP_WAIT_S, max(0.0, due_s - now_s))

    def _take(self, arrival: Arrival) -> None:
        try:
            match arrival.topic:
                case "image":
                    self._take_image(arrival)
                case "tracks":
                    self._take_tracks(arrival)
                case "state":
                    self._take_state(decode(FollowState, arrival.payload, arrival.encoding))
                case "estop":
                    self._control.hear(decode(EStop, arrival.payload, arrival.encoding))
                case "health":
                    health = decode(Health, arrival.payload, arrival.encoding)
                    self._board.health(health, arrival.arrived_s)
                case "events" if arrival.encoding != EndOfStream.encoding():
                    event = decode(TrackEvent, arrival.payload, arrival.encoding)
                    stamp = decode(Stamp, arrival.attachment or b"")
                    self._board.event(event, stamp.origin, arrival.arrived_s)
                case "drive":
                    drive = decode(DriveState, arrival.payload, arrival.encoding)
                    self._board.drive(drive, arrival.arrived_s)
                    self._control.robot_says("drive", drive.estop)
                case "alive":
                    _, service, instance = arrival.key.split("/")
                    self._board.watch.token(
                        service, instance, arrival.sample.kind == zenoh.SampleKind.PUT,
                        arrival.arrived_s,
                    )  # fmt: skip
                case "sim-world" | "sim-truth":
                    self._above.take(arrival)
                case "command" if arrival.encoding != EndOfStream.encoding():
                    command = decode(MotionCommand, arrival.payload, arrival.encoding)
                    self._board.command(command, arrival.arrived_s)
        except MessageError as error:
            self._refuse(arrival, error)

    def _refuse(self, arrival: Arrival, error: MessageError) -> None:
        self._context.statistics.malformed += 1
        self._context.warn.warning(arrival.topic, f"{arrival.key}: {error}", arrival.arrived_s)

    def _take_image(self, arrival: Arrival) -> None:
        if arrival.encoding == EndOfStream.encoding():
            self._images.ending(arrival)
            return
        header = self._images.header(arrival)
        if header is None:
            return
        statistics = self._context.statistics
        statistics.input(arrival.arrived_s)
        self._board.image(header, arrival.arrived_s)
        # Without a viewer the pixels are not even copied out.
        if self._hub.watched:
            image = HeldImage(header, arrival.payload, arrival.arrived_s)
            self._show(self._joiner.add_image(image))

    def _take_tracks(self, arrival: Arrival) -> None:
        if arrival.encoding == EndOfStream.encoding():
            return
        received = self._tracks.message(arrival, Tracks)
        if received is not None:
            self._board.tracks(arrival.arrived_s)
            self._show(self._joiner.add_tracks(received.message, received.stamp.origin))

    def _take_state(self, state: FollowState) -> None:
        self._board.follow(state, time.monotonic())
        self._control.robot_says("follower", state.estop)

    def _show(self, frames: list[Joined]) -> None:
        for joined in frames:
            started_s = time.monotonic()
            if not self._rate.admit(started_s):
                self._capped += 1
                continue
            try:
                jpeg = to_jpeg(
                    joined.image, self._settings.max_side_px, self._settings.jpeg_quality
                )
            except MessageError as error:
                self._unreadable += 1
                self._context.statistics.malformed += 1
                self._context.warn.warning("image-unreadable", str(error), started_s)
                continue
            now_s = time.monotonic()
            age_s = _age_s(joined.image.header, joined.image.arrived_s, now_s)
            self._hub.put_frame(ViewFrame(describe(joined, self._board.follower, age_s), jpeg))
            self._context.statistics.output(now_s, now_s - started_s, age_s)

    def _check_router(self) -> None:
        connected = self._control.connected
        if connected == self._router:
            return
        self._router = connected
        self._router_back_s = time.monotonic()
        if connected:
            self._context.log.info("the router is back")
        else:
            self._context.log.warning("the router is away")
            # What the follower does meanwhile is not known.
            self._board.follower = None

    def _catch_up(self, now_s: float) -> None:
        """Ask for the follower's latched state until it is known."""
        if self._board.follower is not None or not self._router:
            return
        try:
            state = self._latched.poll(now_s)
        except MessageError as error:
            self._context.statistics.malformed += 1
            self._context.warn.warning("state-reply", f"{keys.FOLLOW_STATE}: {error}", now_s)
            return
        if state is not None:
            self._take_state(state)

    def _status(self, now_s: float) -> dict[str, object]:
        rate_in_hz, rate_out_hz = self._context.statistics.rates_hz(now_s)
        statistics = self._context.statistics
        status = self._board.compose(now_s)
        status["router"] = self._router
        status["problems"] = describe_problems(self._problems(now_s))
        status["own"] = self._context.producer
        stop = self._control.stop_status(now_s)
        status["stop"] = stop | self._board.stop(stop["engaged"], now_s)
        status["web"] = {
            "rate_in_hz": round(rate_in_hz, 1),
            "rate_out_hz": round(rate_out_hz, 1),
            "missing": statistics.dropped,
            "passed_over": self._joiner.passed_over,
            "rate_capped": self._capped,
            "unreadable": self._unreadable,
            "malformed": statistics.malformed,
            "viewers": self._hub.viewer_count,
            "max_fps": self._settings.max_fps,
        }
        return status


def _age_s(header: Header, arrived_s: float, now_s: float) -> float:
    return header.age_ns * 1e-9 + max(0.0, now_s - arrived_s)


def serve(context: ServiceContext[WebServiceSettings]) -> None:
    """Serve the page until the service is stopped."""
    if context.settings.robots:
        serve_robots(context)
        return
    with ExitStack() as resources:
        hub = Hub(context.settings.max_viewers)
        control = Control(context, resources)
        service = WebService(context, hub, control)
        service.tick(time.monotonic())
        with serving(context, partial(Site, hub=hub, control=control)) as url:
            context.statistics.details["url"] = url
            context.announce()
            service.run()


def run(loaded: Loaded[WebServiceSettings]) -> int:
    """Run the web process; returns its exit code."""
    if loaded.service.robots and loaded.service.instance == "main":
        # Beside the page of a robot whose keys have no name before them either.
        own = loaded.service.model_copy(update={"instance": ROBOTS_PAGE})
        loaded = loaded.model_copy(update={"service": own})
    # Four processes share the cores already: threads inside OpenCV only take turns.
    cv2.setNumThreads(1)
    return run_service("web", loaded, serve)
