"""A run through the real processes: own router, own children, nothing left behind."""

from __future__ import annotations

import json
import logging
import threading
import time
from contextlib import ExitStack
from typing import Any

import zenoh

from heel.schemas import HeelError, keys
from heel.services.pipeline import REPEATABLE_EPOCH
from heel.services.run.children import Child, Children, await_present
from heel.services.run.collector import CONSUMER, Collector
from heel.services.run.options import RunOptions
from heel.services.run.outputs import RunOutputs
from heel.services.run.progress import RunProgress
from heel.services.run.revival import Revival
from heel.services.run.silence import HUNG_S, Silences
from heel.services.run.summary import RunSummary
from heel.services.runtime import process
from heel.services.runtime.asking import EVERY_ANSWER, EVERYBODY
from heel.services.runtime.inbox import Inbox
from heel.services.runtime.logs import OncePerSecond
from heel.services.runtime.registry import Registration, registered
from heel.services.runtime.router import open_private_router

_STALL_TIMEOUT_S = 60.0
"""Longest time without a tracked frame [s]: far more than a detector needs for one, also on a slow
processor; chosen by hand."""
_DRAIN_S = 8.0
"""Seconds in which the services end and their last messages are taken; above the time that
`Children.end` takes at most, chosen by hand."""
_LAST_WORDS_S = 1.0
"""Seconds for which messages of a service that failed may still come; chosen by hand."""
_EARLY_S = 3.0
"""Longest time [s] from capture's announcement that the stream has ended to the end of its process;
chosen by hand."""
_POLL_S = 0.1
"""Longest wait for a message [s] before processes and deadlines are looked at; chosen by hand."""


class DistributedRun:
    """Starts the services of one run, collects their messages, and ends them."""

    def __init__(self, options: RunOptions, stop: threading.Event, log: logging.Logger) -> None:
        self._options = options
        self._stop = stop
        self._log = log
        self._failure: HeelError | None = None
        self._capture: Child | None = None
        self._note: Registration | None = None
        lossless = options.delivery == "lossless"
        # A recording cannot be gone on with from where a capture that died was.
        revived = () if lossless else tuple(one for one in self._parts() if one != "capture")
        self._silences = Silences(HUNG_S, *set(self._parts()).difference(revived, ("web",)))
        self._revival = Revival(revived, log)
        self.summary = RunSummary(mode=options.delivery)

    def run(self) -> RunSummary:
        """Run to the end of the stream or of the wanted time, or until `stop` is set.

        Raises:
            HeelError: a service failed or hung; the files written so far are kept.
        """
        process.keep_freed_memory()
        with ExitStack() as stack:
            outputs = stack.enter_context(
                RunOutputs(self._options.out, self.summary, self._options.annotate)
            )
            session, endpoint = stack.enter_context(
                open_private_router(lossless=self._options.delivery == "lossless")
            )
            inbox = stack.enter_context(Inbox(session))
            warn = OncePerSecond(self._log)
            self._note = note = stack.enter_context(
                registered(
                    "run", self._played(), endpoint, self._parts(), self._log, self._options.robot
                )
            )
            collector = Collector(session, inbox, self._options, outputs, self.summary, warn, note)
            children = stack.enter_context(Children(lambda: outputs.log_folder))
            self._start(session, endpoint, children)
            note.processes_are(children.pids(), children.logs)
            progress = stack.enter_context(RunProgress(self._options.progress))
            process.spare_from_collection()
            self._collect(inbox, collector, children, progress)
        return self.summary

    def _played(self) -> str:
        """The source as text for a user; what stands in an address may be a password."""
        scheme, separator, _ = self._options.source.partition("://")
        return f"{scheme}://..." if separator else scheme

    def _parts(self) -> tuple[str, ...]:
        parts = ("capture", "detector", "tracker", "follower")
        return parts if self._options.web_port is None else (*parts, "web")

    def _start(self, session: zenoh.Session, endpoint: str, children: Children) -> None:
        o = self._options
        common = ["--connect", endpoint, "--exit-at-end", "--delivery", o.delivery]
        common += ["--config", str(o.config)] if o.config is not None else []
        children.start("detector", *common, *o.detector_flags())
        children.start("tracker", *common, *o.tracker_flags())
        children.start("follower", *common, "--target", o.target)
        wanted = {"detector", "tracker", "follower"}
        if o.web_port is not None:
            children.start("web", "--connect", endpoint, "--port", str(o.web_port))
            wanted.add("web")
        await_present(session, children, wanted, self._stop)
        self.summary.in_force(_settings_in_force(session))
        credit = ["--await-consumers", CONSUMER, "--epoch", str(REPEATABLE_EPOCH)]
        self._capture = children.start(
            "capture", *o.capture_flags(), *common, *(credit if o.delivery == "lossless" else [])
        )

    def _collect(
        self, inbox: Inbox, collector: Collector, children: Children, progress: RunProgress
    ) -> None:
        tracked = 0
        until_s = time.monotonic() + (self._options.seconds or float("inf"))
        stall = Silences(_STALL_TIMEOUT_S, "stream")
        stall.heard("stream", time.monotonic())
        while not self._over(collector) and not self._stop.is_set() and time.monotonic() < until_s:
            arrival = inbox.get(_POLL_S)
            if arrival is not None:
                collector.take(arrival)
            now_s = time.monotonic()
            if self.summary.tracked != tracked:
                tracked = self.summary.tracked
                stall.heard("stream", now_s)
                progress.update(tracked, collector.info.frame_count if collector.info else None)
            if stall.look(now_s) is not None:
                raise HeelError(
                    f"nothing tracked for {_STALL_TIMEOUT_S:g} s by the detector and the tracker"
                    f"{children.last_words('detector') or children.last_words('tracker')}"
                )
            failure = children.failure()
            if self._revive(collector, children, now_s):
                continue
            if (hung := self._silences.look(now_s)) is not None and not children.over(hung):
                raise HeelError(f"{hung} is silent for {HUNG_S:g} s: it hangs or was stopped")
            if failure is not None:
                # What it had sent may still be on its way through the others.
                until_s = min(until_s, now_s + _LAST_WORDS_S)
            self._check_order(children, now_s)
        if collector.first_frame_s is not None:
            self.summary.wall_s = collector.last_frame_s - collector.first_frame_s
        if not collector.ended:
            self.summary.ended = self.summary.ended or "stopped before the end of the stream"
        self._drain(inbox, collector, children)
        if self._failure is not None and not self._stop.is_set():
            raise self._failure
        if collector.ended:
            self._check_nothing_lost()

    def _revive(self, collector: Collector, children: Children, now_s: float) -> bool:
        """Start again what died or hangs, while there is a stream; True if anything did."""
        while collector.health:
            health, arrived_s = collector.health.popleft()
            self._silences.heard(health.service, arrived_s)
            self._revival.heard(health, arrived_s)
        if self._capture is None or self._capture.over or not self._revival.look(children, now_s):
            return False
        self.summary.restarts = dict(self._revival.counts)
        if self._note is not None:
            self._note.processes_are(children.pids(), children.logs)
        return True

    def _over(self, collector: Collector) -> bool:
        """Whether the stream has ended: tracks and commands announce it, and capture is gone."""
        return collector.ended and self._capture is not None and self._capture.over

    def _check_order(self, children: Children, now_s: float) -> None:
        """A service that ends while capture goes on was ended from outside."""
        early = None if self._capture is None or self._capture.over else children.ended()
        if early is None:
            self._early_s = now_s
        elif now_s - self._early_s > _EARLY_S:
            raise HeelError(f"{early} ended before the stream did{children.last_words(early)}")

    def _check_nothing_lost(self) -> None:
        """A lossless run that lost a frame reports that instead of looking complete."""
        s = self.summary
        if self._options.delivery == "lossless" and not s.captured == s.detected == s.tracked:
            raise HeelError(
                f"lossless: {s.captured} frames were captured, {s.detected} detected and "
                f"{s.tracked} tracked: see {self._options.out}/logs and run it again"
            )

    def _drain(self, inbox: Inbox, collector: Collector, children: Children) -> None:
        """Let the services end and take their last messages: the final health of each."""
        ending = threading.Thread(target=self._end_children, args=(children,), daemon=True)
        ending.start()
        deadline_s = time.monotonic() + _DRAIN_S
        while time.monotonic() < deadline_s:
            arrival = inbox.get(_POLL_S)
            if arrival is not None:
                collector.take(arrival)
            elif not ending.is_alive():
                break
        ending.join(timeout=1.0)
        self.summary.captured = max(self.summary.captured, self.summary.detected)
        self.summary.cpu_s["run"] = process.cpu_s()
        self.summary.peak_rss_mb["run"] = process.memory_mb()[1]

    def _end_children(self, children: Children) -> None:
        # Asked before they are ended: an exit code after SIGTERM is no failure of the run. But
        # capture announces the end of the stream before it fails.
        failure = children.failure()
        children.end()
        self._failure = failure or children.failure_of("capture")


def _settings_in_force(session: zenoh.Session) -> dict[str, Any]:
    """What every service answers on its config key."""
    found: dict[str, Any] = {}
    for reply in session.get(
        keys.ALL_CONFIG, target=EVERYBODY, consolidation=EVERY_ANSWER, timeout=2.0
    ):
        if reply.ok is not None:
            found |= json.loads(reply.ok.payload.to_bytes())
    return found
