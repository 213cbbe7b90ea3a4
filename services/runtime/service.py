"""Running a service: signals, session, presence, health, and an exit that always comes.

A service is a function of a `ServiceContext` that returns when its work is done or when
`context.stopping` is set. SIGTERM and Ctrl-C take the same path and end in exit code 0.
"""

from __future__ import annotations

import json
import logging
import os
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import zenoh

from heel.schemas import EndOfStream, keys
from heel.schemas.errors import HeelError, SettingsError
from heel.services.runtime import process
from heel.services.runtime.certificate import valid_until
from heel.services.runtime.chain import CAMERA
from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.health import HealthReporter
from heel.services.runtime.health_file import HealthFile
from heel.services.runtime.image_route import IMAGE_TOPIC, ImageRoute
from heel.services.runtime.inbox import Arrival, Inbox
from heel.services.runtime.logs import OncePerSecond, set_up_logging
from heel.services.runtime.metrics import serving_metrics
from heel.services.runtime.notify import Notifier
from heel.services.runtime.places import robot_name
from heel.services.runtime.presence import Presence
from heel.services.runtime.publishing import StreamPublisher
from heel.services.runtime.qos import Delivery, TopicQos
from heel.services.runtime.session import (
    POOL_BYTES,
    open_session,
    start_zenoh_log,
    with_usable_shared_memory,
)
from heel.services.runtime.settings import Loaded, ServiceSettings
from heel.services.runtime.shared_memory import SharedMemoryWatch
from heel.services.runtime.stop_signals import stop_signals
from heel.services.runtime.streams import StreamJudge
from heel.services.runtime.twins import TwinWatch

LINGER_S = 1.0
"""How long a service stays after the end of its stream, so that its last messages are taken."""
LOOP_WAIT_S = 0.2
"""Longest wait inside a service loop, so that it comes round and sees a stop."""
_FAILED_S = 5.0
"""How long health tells of one message that could not be worked on."""

S = TypeVar("S", bound=ServiceSettings)


@dataclass
class ServiceContext(Generic[S]):
    """What a running service works with."""

    name: str
    settings: S
    session: zenoh.Session
    inbox: Inbox
    statistics: ServiceStatistics
    log: logging.Logger
    producer: str
    shared_memory: bool
    """Whether large messages are to go through shared memory."""
    stop: threading.Event
    announce: Callable[[], None]
    """Call once subscriptions are declared: from then on the service counts as present. More calls
    change nothing."""
    robot: str
    """Name of the robot in files of this host."""
    notifier: Notifier
    """Tells systemd, where it is there, that the service loop lives."""
    warn: OncePerSecond = field(init=False)

    def __post_init__(self) -> None:
        self.warn = OncePerSecond(self.log)

    @property
    def running(self) -> bool:
        """Ask once per turn of the service loop: notes that the loop lives."""
        now_s = time.monotonic()
        self.statistics.loop(now_s)
        self.notifier.alive(now_s)
        return not self.stop.is_set()

    def subscribe(self, topic: str, key: str, qos: TopicQos, primary: bool = True) -> StreamJudge:
        """Receive a stream in this service's delivery mode."""
        qos = qos.for_delivery(self.settings.delivery)
        self.inbox.subscribe(topic, key, qos)
        live = self.settings.delivery == "live"
        if primary and live:
            # Where nothing may be lost the sender waits, too, however long the work takes.
            self.statistics.input_topic = topic
        return StreamJudge(topic, qos, self.statistics, self.warn, primary, live)

    def subscribe_images(self, qos: TopicQos, delivery: Delivery | None = None) -> StreamJudge:
        """Receive the camera's frames: raw on its own host, as JPEG on another.

        Args:
            qos: of the topic.
            delivery: None is this service's. Lossless they are raw, wherever the camera is.
        """
        camera = self.settings.camera
        if (delivery or self.settings.delivery) == "lossless":
            return self.subscribe(IMAGE_TOPIC, keys.image(camera), qos)
        receiver = f"{self.name}-{self.settings.instance}"[:64]  # as long as a name may be
        route = ImageRoute(
            self.session, self.inbox, camera, receiver, qos, self.statistics, self.log
        )
        route.start(self.stop)
        if delivery is None:
            self.statistics.input_topic = IMAGE_TOPIC
        return StreamJudge(IMAGE_TOPIC, qos, self.statistics, self.warn)

    def arrivals(
        self, judge: StreamJudge, out: StreamPublisher | None = None,
        goes_on: Callable[[], bool] | None = None,
    ) -> Iterator[Arrival]:  # fmt: skip
        """Messages of one stream until the service is to end.

        The end of the stream is passed on to `out`, after everything that came before it.

        Args:
            judge: of the stream.
            out: the service's own stream.
            goes_on: asked in every turn, whether there is a message or not; False ends it.
        """
        while self.running and (goes_on is None or goes_on()):
            arrival = self.inbox.get(LOOP_WAIT_S, judge.topic)
            if arrival is not None and arrival.encoding != EndOfStream.encoding():
                yield arrival
            elif arrival is not None:
                judge.ending(arrival)
            if (end := judge.ended(time.monotonic())) is not None:
                self.log.info("stream %s ended after %d frames: %s", end.stream, end.frames,
                              end.reason)  # fmt: skip
                if out is not None:
                    out.end(end)
                if self.settings.exit_at_end:
                    self.linger()
                    return

    @contextmanager
    def surviving(self, what: str) -> Iterator[None]:
        """Around the work on one message: whatever it raises costs that message, not the service.

        A core is meant to bound what it computes from accepted input; where it does not, one
        odd message must not stop all frames. It is said in health, and in the log with
        the place in the code.
        """
        try:
            yield
        except Exception as error:
            now_s = time.monotonic()
            words = " ".join(str(error).split())[:160]
            reason = f"{what} failed: {type(error).__name__}: {words}: please report it"
            self.statistics.failed += 1
            if self.statistics.problem(f"failed-{what}", reason, now_s + _FAILED_S):
                self.log.error("%s", reason, exc_info=True)

    def linger(self) -> None:
        """Stay a moment after the last message, or until told to end.

        Shared memory goes with the process that owns it: receivers that had not opened the last
        messages yet lost them (1 run of 6 on a busy machine).
        """
        self.stop.wait(LINGER_S)

    def watch_for_twin(self, key: str, resources: ExitStack) -> None:
        """Say in health if another process sends on a key that is this service's own."""
        TwinWatch(self.session, key, self.producer, self.statistics, self.log, resources)

    def publisher(self, key: str, qos: TopicQos) -> StreamPublisher:
        """Send a stream in this service's delivery mode."""
        return StreamPublisher(self.session, key, qos, self.settings.delivery, self.producer)


def run_service(name: str, loaded: Loaded[S], main: Callable[[ServiceContext[S]], None]) -> int:
    """Run `main` with everything around it; returns the exit code.

    0 done or told to stop, 1 failed, 2 wrong settings: with a one-line reason on standard error.
    """
    log = set_up_logging(loaded.log, name)
    process.keep_freed_memory()
    process.use_all_file_descriptors()
    start_zenoh_log()
    with stop_signals() as stop:
        process.die_with_parent()
        try:
            joining = with_usable_shared_memory(loaded.zenoh, log)
            loaded = loaded.model_copy(update={"zenoh": joining})
            session = open_session(joining, log, stop.wait)
            if session is not None:
                with session:
                    _serve(name, loaded, session, stop, log, main)
        except HeelError as error:
            log.error("%s", error)
            return 2 if isinstance(error, SettingsError) else 1
    return 0


def _serve(
    name: str,
    loaded: Loaded[S],
    session: zenoh.Session,
    stop: threading.Event,
    log: logging.Logger,
    main: Callable[[ServiceContext[S]], None],
) -> None:
    settings = loaded.service
    statistics = ServiceStatistics()
    notifier = Notifier(os.environ, log, name)
    producer = f"{name}/{settings.instance}@{secrets.token_hex(4)}"
    with ExitStack() as stack:
        answer_config(stack, session, name, settings.instance, loaded)
        file = None if settings.health_file is None else HealthFile(settings.health_file)
        presence = Presence(session)
        stack.callback(presence.close)
        statistics.details[CAMERA] = settings.camera
        memory = SharedMemoryWatch(POOL_BYTES, statistics) if loaded.zenoh.shared_memory else None
        health = HealthReporter(
            session, name, settings.instance, producer, statistics, log, file, presence, memory,
            notifier, valid_until(loaded.zenoh.config_file),
        )  # fmt: skip
        stack.callback(health.finish)
        if settings.metrics_port is not None:
            stack.enter_context(serving_metrics(settings.metrics_port, lambda: health.newest))
        inbox = stack.enter_context(Inbox(session))

        announced = threading.Event()

        def announce() -> None:
            if announced.is_set():
                return
            announced.set()
            process.spare_from_collection()
            token = session.liveliness().declare_token(keys.alive(name, settings.instance))
            stack.callback(token.undeclare)
            notifier.ready()
            log.info("%s is up", producer)

        health.start()
        context = ServiceContext(
            name, settings, session, inbox, statistics, log, producer,
            loaded.zenoh.shared_memory, stop, announce,
            robot_name(loaded.zenoh), notifier,
        )  # fmt: skip
        main(context)
        notifier.stopping()
        log.info("%s ends: received %d, sent %d, dropped %d, malformed %d", producer,
                 statistics.received, statistics.sent, statistics.dropped,
                 statistics.malformed)  # fmt: skip


def answer_config(
    stack: ExitStack, session: zenoh.Session, name: str, instance: str, loaded: Loaded[S]
) -> None:
    """Answer queries on the service's config key with the settings in force."""
    key = keys.config(name, instance)
    shown = json.dumps(loaded.shown(name))

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(key, shown, encoding=zenoh.Encoding.APPLICATION_JSON)

    stack.callback(session.declare_queryable(key, answer).undeclare)
