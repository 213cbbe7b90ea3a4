"""The recorder as a process: all topics in, files out; it sends nothing and nobody waits for it."""

from __future__ import annotations

import json
import platform
import time
from collections import defaultdict, deque
from contextlib import ExitStack
from dataclasses import dataclass, replace

import zenoh

from heel.schemas import keys
from heel.services.foxglove_messages import FoxgloveMessages
from heel.services.recorder.disk import DiskThread, Saving
from heel.services.recorder.events import EventWatch
from heel.services.recorder.files import Limits, RecordingFiles
from heel.services.recorder.ring import Ring
from heel.services.recorder.settings import RecorderSettings
from heel.services.recordings.numbers import Gaps, own_number
from heel.services.recordings.wire import FLUSH_PERIOD_S, WireMessage
from heel.services.recordings.writing import mcap
from heel.services.runtime import qos
from heel.services.runtime.frame_memory import MOST_LIVE_FRAMES
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.latched import latched_samples
from heel.services.runtime.process import software_version
from heel.services.runtime.service import LOOP_WAIT_S, ServiceContext, run_service
from heel.services.runtime.settings import Loaded

_IMAGES = ("image", "jpeg", "depth")
_RING = 64
"""Messages of a topic that may wait for the loop: one second of commands. A recorder wants all of
them where others want the newest. Chosen by hand."""
_FRAMES_RING = MOST_LIVE_FRAMES
"""The same of frames, which sit in the camera's shared memory until the loop has copied them: as
many as the camera has room for. What comes on top goes through sockets, and gives way there."""
_QUEUE_BYTES = 64 << 20
"""Memory for what the disk is not done with: two seconds of raw frames. What comes on top is lost,
counted and said. Chosen by hand."""
AFTER_S = 5.0
"""Seconds behind an event that belong to its file; chosen by hand."""
_REPORT_S = 0.5
"""Seconds between two looks at how the disk does; chosen by hand."""
_MOST_ASKED = 8
"""Questions that wait for a file at once."""
_LATCHED = (keys.TOPICS["info"], keys.FOLLOW_STATE, keys.FOLLOW_TARGET, keys.FOLLOW_ESTOP,
            keys.SIM_WORLD)  # fmt: skip


@dataclass
class _Due:
    """A file of the last seconds that is to be written."""

    reason: str
    at_s: float


class Recorder:
    """Takes what comes, and passes it to the disk or keeps it for a while."""

    def __init__(self, context: ServiceContext[RecorderSettings], resources: ExitStack) -> None:
        s = context.settings
        self._context = context
        # Of one clock for the whole recording, which a wall clock that is set does not shake.
        self._wall_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
        limits = Limits(s.file_mb * 10**6, s.file_s, s.spare_mb * 10**6)
        version = software_version()
        session = {
            "robot": context.robot, "host": platform.node(), "software": f"heel {version}",
            "flush_period_s": f"{FLUSH_PERIOD_S:g}", "frames": s.frames,
            "begun_ns": str(time.time_ns()),
        }  # fmt: skip
        self._files = RecordingFiles(
            s.out, limits, session, f"heel {version}",
            foxglove=FoxgloveMessages() if s.foxglove else None,
        )  # fmt: skip
        self._disk = DiskThread(self._files, _QUEUE_BYTES, context.log)
        self._ring = None if s.last_s is None else Ring(s.last_s + AFTER_S, s.last_mb * 10**6)
        self._events = EventWatch()
        self._due: _Due | None = None
        self._saving: Saving | None = None
        self._asked: deque[zenoh.Query] = deque(maxlen=_MOST_ASKED)
        self._answering: list[zenoh.Query] = []
        self._report_due_s = 0.0
        self._gaps: defaultdict[str, Gaps] = defaultdict(Gaps)
        self._lost = 0
        self._subscribe()
        key = keys.save(s.instance)
        resources.callback(context.session.declare_queryable(key, self._ask).undeclare)

    def run(self) -> None:
        """Record until the service is stopped."""
        context = self._context
        self._remember_settings()
        self._disk.start()
        try:
            for sample in latched_samples(context.session, _LATCHED, context.stop):
                self._take(Arrival("latched", str(sample.key_expr), sample, time.monotonic()))
            context.announce()
            while context.running:
                arrival = context.inbox.get(LOOP_WAIT_S if self._due is None else 0.05)
                if arrival is not None:
                    with context.surviving("recording"):
                        self._take(arrival)
                now_s = time.monotonic()
                self._look_after_saving(now_s)
                if now_s >= self._report_due_s:
                    self._report_due_s = now_s + _REPORT_S
                    self._report()
        finally:
            if self._due is not None:
                self._save(self._due.reason)
            self._disk.close()
            self._answer_all()
            self._report()

    def _subscribe(self) -> None:
        inbox = self._context.inbox
        for name, topic in qos.BY_TOPIC.items():
            if name not in _IMAGES:
                inbox.subscribe(name, keys.TOPICS[name], replace(topic, capacity=_RING))
        match self._context.settings.frames:
            case "raw":
                images = keys.TOPICS["image"]
                inbox.subscribe("depth", keys.TOPICS["depth"],
                                replace(qos.DEPTH, capacity=_FRAMES_RING))  # fmt: skip
            case "jpeg":
                images = keys.TOPICS["jpeg"]
            case "none":
                return
        inbox.subscribe("image", images, replace(qos.IMAGE, capacity=_FRAMES_RING))

    def _remember_settings(self) -> None:
        """Keep the settings that are in force, as every service tells them."""
        session, stop = self._context.session, self._context.stop
        for sample in latched_samples(session, (keys.ALL_CONFIG,), stop):
            _, service, instance, _ = str(sample.key_expr).split("/")
            text = sample.payload.to_bytes().decode(errors="replace")
            self._files.settings[f"heel.settings.{service}.{instance}"] = {"json": text}

    def _take(self, arrival: Arrival) -> None:
        started_s = time.monotonic()
        logged_ns = round(arrival.arrived_s * 1e9) + self._wall_minus_monotonic_ns
        message = WireMessage(
            arrival.key, arrival.encoding, arrival.payload, arrival.attachment, logged_ns
        )
        statistics = self._context.statistics
        statistics.input(arrival.arrived_s)
        if (number := own_number(message)) is not None:
            self._gaps[arrival.topic].take(number)
        if self._ring is None:
            self._disk.put(message)
        else:
            self._ring.add(message)
            if (reason := self._events.take(message)) is not None:
                self._happened(reason, arrival.arrived_s)
        now_s = time.monotonic()
        statistics.output(now_s, now_s - started_s, now_s - arrival.arrived_s)

    def _happened(self, reason: str, now_s: float) -> None:
        if self._due is None:
            self._context.log.info("%s: the last seconds will be kept", reason)
            self._due = _Due(reason, now_s + AFTER_S)

    def _ask(self, query: zenoh.Query) -> None:
        # Of a thread of Zenoh's: answered by the loop, once the file is there.
        self._asked.append(query)
        self._context.inbox.interrupt()

    def _look_after_saving(self, now_s: float) -> None:
        while self._asked:
            self._answering.append(self._asked.popleft())
            self._due = _Due("asked", now_s)
        if self._saving is not None and self._saving.done.is_set():
            if self._saving.path is not None:
                self._context.log.info("wrote %s", self._saving.path)
            self._saving = None
            self._answer_all()
        if self._due is not None and now_s >= self._due.at_s:
            self._save(self._due.reason)

    def _save(self, reason: str) -> None:
        if self._ring is None:
            self._due = None
            self._answer_all()
        elif self._saving is None:
            self._due = None
            self._saving = Saving(reason, self._ring.take_all())
            self._disk.save(self._saving)

    def _answer_all(self) -> None:
        """Tell those who asked for a file which one it is."""
        asked, self._answering = self._answering, []
        path = self._files.path
        for query in asked:
            with query:
                if path is None:
                    query.reply_err(self._files.problem or "nothing has come so far")
                else:
                    said = json.dumps({"file": str(path.absolute())})
                    key = keys.save(self._context.settings.instance)
                    query.reply(key, said, encoding=zenoh.Encoding.APPLICATION_JSON)

    def _never_came(self) -> dict[str, int]:
        """Messages of each topic that were sent and did not reach the loop.

        What gave way to newer ones in a ring of Zenoh's, or on a link, nobody counts but by the
        senders' numbers; what gave way in the inbox is missing by those, too.
        """
        counts = {
            topic: max(overflowed, self._gaps[topic].missing)
            for topic, overflowed in self._context.inbox.overflowed.items()
        }
        return {topic: count for topic, count in counts.items() if count}

    def _report(self) -> None:
        context, files, disk = self._context, self._files, self._disk
        statistics = context.statistics
        never_came = self._never_came()
        lost = sum(never_came.values()) + disk.too_slow + files.lost
        statistics.dropped = lost
        for kind, problem in (("disk", files.problem), ("recording", disk.failure)):
            if statistics.problem(kind, problem) and problem is not None:
                context.log.warning("%s", problem)
        if lost > self._lost and files.problem is None:
            context.warn.warning("lost", f"{lost - self._lost} messages were not recorded: the "
                                 "disk or the processor is behind", time.monotonic())  # fmt: skip
        self._lost = lost
        told = ", ".join(f"{topic} {count}" for topic, count in never_came.items())
        statistics.detail("never came", told or None)
        statistics.detail("file", None if files.path is None else str(files.path))
        if self._ring is not None:
            held = f"{self._ring.seconds:.0f} s, {self._ring.bytes / 1e6:.0f} MB"
            crowded = "; last_mb bounds it" if self._ring.crowded else ""
            statistics.detail("held", held + crowded)


def serve(context: ServiceContext[RecorderSettings]) -> None:
    """Record until told to end."""
    mcap()
    with ExitStack() as resources:
        Recorder(context, resources).run()


def run(loaded: Loaded[RecorderSettings]) -> int:
    """Run the recorder process; returns its exit code."""
    return run_service("recorder", loaded, serve)
