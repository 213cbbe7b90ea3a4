"""Trackers that take over from each other: with the same ids, planned and after a kill."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import zenoh

from heel.schemas import Blobs, Health, Stamp, Tracks, decode, keys
from heel.services.runtime import qos
from heel.services.runtime.chain import STANDBY
from heel.services.runtime.publishing import StreamPublisher
from tests.support import network
from tests.support.processes import Running, finished, running
from tests.unit.tracker import drawn_detections as drawn

_FPS = 12.0
_START_S = 40.0


def walking(seq: int) -> Blobs:
    """Two people that walk to and fro, for ever."""

    def to_and_fro(first: float, speed: float) -> drawn.Person:
        def where(t_s: float) -> tuple[float, float]:
            way = (first + speed * t_s) % 800.0
            return 120.0 + min(way, 800.0 - way), 400.0

        return drawn.Person(drawn.RED if first else drawn.GREEN, where)

    return drawn.message([to_and_fro(0.0, 40.0), to_and_fro(500.0, 25.0)], seq, _FPS)


class Camera(threading.Thread):
    """A detector that sends what it is told, and all that trackers answer."""

    def __init__(self, session: zenoh.Session, resources: ExitStack) -> None:
        super().__init__(daemon=True)
        self._out = StreamPublisher(
            session, keys.blobs("front"), qos.BLOBS, "live", "detector/main@00000001"
        )
        self.heard: list[tuple[Stamp, Tracks, float]] = []
        self.health: dict[str, Health] = {}
        for key, take in ((keys.tracks("front"), self._hear), (keys.ALL_HEALTH, self._note)):
            resources.callback(session.declare_subscriber(key, take).undeclare)
        self.over = threading.Event()
        self.start()
        resources.callback(self.join)
        resources.callback(self.over.set)

    def run(self) -> None:
        seq = 0
        while not self.over.wait(1 / _FPS):
            self._out.send(walking(seq), 0.0)
            seq += 1

    def _hear(self, sample: zenoh.Sample) -> None:
        assert sample.attachment is not None
        stamp = decode(Stamp, sample.attachment.to_bytes())
        self.heard.append((stamp, decode(Tracks, sample.payload.to_bytes()), time.monotonic()))

    def _note(self, sample: zenoh.Sample) -> None:
        health = decode(Health, sample.payload.to_bytes())
        self.health[f"{health.service}/{health.instance}"] = health

    def is_ready(self, name: str) -> bool:
        health = self.health.get(name)
        return health is not None and health.details.get(STANDBY, "").startswith("ready")

    def sent_by(self, name: str, since: int = 0) -> list[Tracks]:
        return [
            tracks for stamp, tracks, _ in self.heard[since:]
            if stamp.producer.startswith(f"{name}@")
        ]  # fmt: skip


def people(tracks: Tracks) -> set[int]:
    return {track.id for track in tracks.tracks if track.shown}


@pytest.fixture
def endpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setenv("HEEL_RUNTIME_DIR", str(tmp_path))
    with network.router() as address:
        yield address


def tracker(resources: ExitStack, endpoint: str, instance: str, *flags: str) -> Running:
    return resources.enter_context(
        running("-m", "heel.services.tracker", "--connect", endpoint, "--instance", instance,
                *flags, HEEL_RUNTIME_DIR=os.environ["HEEL_RUNTIME_DIR"])
    )  # fmt: skip


def test_trackers_take_over_from_each_other_with_the_same_ids(
    endpoint: str, tmp_path: Path
) -> None:
    with network.client(endpoint) as session, ExitStack() as resources:
        first = tracker(resources, endpoint, "a")
        second = tracker(resources, endpoint, "b", "--standby")
        camera = Camera(session, resources)
        network.wait_until(lambda: camera.is_ready("tracker/b"), "a tracker in step", _START_S)
        assert not camera.sent_by("tracker/b"), "it sends nothing while it stands by"
        network.wait_until(lambda: len(people(camera.heard[-1][1])) == 2, "two people", _START_S)
        ids = people(camera.heard[-1][1])

        code, said, complaint = finished(
            "-m", "heel", "swap", "tracker", "--connect", endpoint, deadline_s=_START_S
        )
        assert code == 0, complaint
        assert said.startswith("tracker: tracker/a has handed over to tracker/b in ")
        network.wait_until(lambda: len(camera.sent_by("tracker/b")) > 5, "its tracks")
        seqs = [tracks.seq for _, tracks, _ in camera.heard]
        before = camera.sent_by("tracker/a")[-1].seq
        assert min(seq for seq in seqs if seq > before) <= before + 3
        assert people(camera.heard[-1][1]) == ids

        network.wait_until(lambda: camera.is_ready("tracker/a"), "the old one in step", _START_S)
        second.stop(signal.SIGKILL, 5.0)
        killed = len(camera.heard)
        network.wait_until(lambda: len(camera.sent_by("tracker/a", killed)) > 5, "its tracks")
        assert people(camera.heard[-1][1]) == ids
        assert {stamp.origin for stamp, _, _ in camera.heard} == {camera.heard[0][0].producer}
        assert [stamp.turn for stamp, _, _ in camera.heard] == sorted(
            stamp.turn for stamp, _, _ in camera.heard
        )

        first.stop(signal.SIGKILL, 5.0)
        killed = len(camera.heard)
        tracker(resources, endpoint, "a")

        def same_people() -> bool:
            for state in tmp_path.glob("tracker-*-a"):
                os.utime(state)  # However long the start takes on a busy machine.
            return killed < len(camera.heard) and people(camera.heard[-1][1]) == ids

        network.wait_until(same_people, "the same people, from the state that was left", _START_S)
        assert camera.heard[-1][0].origin == camera.heard[0][0].producer
