"""A tracker that hears depth: the same bytes as its cores give, and boxes again without it."""

from __future__ import annotations

import threading
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import zenoh

from heel.schemas import Blobs, CameraInfo, Header, Health, Tracks, decode, encode, keys
from heel.schemas.image import DEPTH, encode_depth
from heel.services.geometry.camera import camera_from_info
from heel.services.runtime import qos
from heel.services.runtime.clock import monotonic_clock
from heel.services.runtime.publishing import Latched, StreamPublisher
from heel.services.tracker.depth_places import with_depth
from tests.support import network
from tests.support.network import wait_until
from tests.support.processes import running
from tests.unit.tracker import drawn_detections as drawn

_FPS = 15.0
_DETECTOR, _CAMERA = "detector/main@00000001", "capture/main@00000001"
_START_S = 40.0


def stands(seq: int) -> Blobs:
    return drawn.message([drawn.Person(drawn.RED, lambda t_s: (200 + 20 * t_s, 400.0))], seq, _FPS)


def depth_of(seq: int, blobs: Blobs) -> np.ndarray:
    return np.full((blobs.height // 2, blobs.width // 2), 2000 + seq, np.uint16)


class Robot(threading.Thread):
    """A camera with depth and a detector, until told to end."""

    def __init__(
        self, session: zenoh.Session, info: CameraInfo, delivery: qos.Delivery = "live"
    ) -> None:
        super().__init__(daemon=True)
        self.blobs: dict[int, Blobs] = {}
        self.over, self.measures = threading.Event(), threading.Event()
        self.measures.set()
        self._epoch = info.epoch
        self._out = StreamPublisher(session, keys.blobs("front"), qos.BLOBS, delivery, _DETECTOR)
        self._depth = StreamPublisher(session, keys.depth("front"), qos.DEPTH, delivery, _CAMERA)

    def run(self) -> None:
        for seq in range(10_000):
            if self.over.wait(1 / _FPS):
                return
            self.send_people(seq)
            # Later than the people: the tracker waits a moment.
            if self.measures.is_set():
                self.send_depth(seq)

    def send_people(self, seq: int) -> None:
        self.blobs[seq] = stands(seq)
        self._out.send(self.blobs[seq], 0.0)

    def send_depth(self, seq: int) -> None:
        blobs = self.blobs[seq]
        depth = depth_of(seq, blobs)
        header = Header(
            **blobs.frame_id().model_dump(), width=depth.shape[1], height=depth.shape[0],
            source_width=depth.shape[1], source_height=depth.shape[0], image_encoding=DEPTH,
            producer=_CAMERA,
        )  # fmt: skip
        self._depth.send_bytes(encode_depth(depth), DEPTH, encode(header))


def test_distances_are_those_of_the_cores_and_without_depth_boxes_count_again(
    tmp_path: Path,
) -> None:
    first = stands(0)
    info = CameraInfo(
        stream="front", epoch=first.epoch, width=first.width, height=first.height,
        source_width=first.width, source_height=first.height, fps=_FPS, source="test",
        horizontal_fov_rad=1.2, mount_height_m=0.8, mount_pitch_rad=0.0, host=monotonic_clock(),
    )  # fmt: skip
    heard: list[bytes] = []
    health: list[Health] = []

    def trouble() -> str:
        return health[-1].reason if health else ""

    with ExitStack() as stack:
        endpoint = stack.enter_context(network.router())
        session = stack.enter_context(network.client(endpoint))
        stack.enter_context(Latched(session, keys.info("front"), qos.INFO)).set(info)
        for key, take in (
            (keys.tracks("front"), lambda sample: heard.append(sample.payload.to_bytes())),
            (keys.ALL_HEALTH, lambda sample: health.append(
                decode(Health, sample.payload.to_bytes()))),
        ):  # fmt: skip
            stack.callback(session.declare_subscriber(key, take).undeclare)
        command = (
            "-P",
            "-m",
            "heel.services.tracker",
            "--connect",
            endpoint,
            "--log-level",
            "info",
        )
        process = stack.enter_context(running(*command, HEEL_RUNTIME_DIR=str(tmp_path)))
        wait_until(lambda: "is up" in process.stderr(), "the tracker", _START_S)
        robot = Robot(session, info)
        robot.start()
        stack.callback(robot.join)
        stack.callback(robot.over.set)

        def measured() -> list[Tracks]:
            told = [decode(Tracks, payload) for payload in list(heard)]
            return [one for one in told if any(t.distance_m is not None for t in one.tracks)]

        wait_until(lambda: len(measured()) > 8, "distances by depth")
        assert health[-1].details["distances"] == "by depth"
        robot.measures.clear()
        wait_until(lambda: "distances rest on boxes again" in trouble(), "the loss of depth")
        latest = decode(Tracks, heard[-1])
        assert latest.tracks
        assert all(track.distance_m is None for track in latest.tracks)
        robot.measures.set()
        wait_until(lambda: not trouble() and health[-1].state == "ok", "depth to be back")
        robot.over.set()
        time.sleep(0.2)
    camera = camera_from_info(info)
    assert camera is not None
    for tracks in measured():
        plain = without_places(tracks)
        depth = depth_of(tracks.seq, robot.blobs[tracks.seq])
        assert encode(with_depth(plain, depth, camera)) == encode(tracks)


def without_places(tracks: Tracks) -> Tracks:
    places = ("distance_m", "distance_sigma_m", "bearing_rad", "bearing_sigma_rad")
    none = dict.fromkeys(places)
    people = tuple(track.model_copy(update=none) for track in tracks.tracks)
    return tracks.model_copy(update={"tracks": people})


def test_a_lossless_tracker_waits_for_the_depth_that_a_camera_announces(tmp_path: Path) -> None:
    first = stands(0)
    info = CameraInfo(
        stream="front", epoch=first.epoch, width=first.width, height=first.height,
        source_width=first.width, source_height=first.height, fps=_FPS, source="test",
        horizontal_fov_rad=1.2, host=monotonic_clock(), depth=True,
    )  # fmt: skip
    heard: list[Tracks] = []

    def take(sample: zenoh.Sample) -> None:
        heard.append(decode(Tracks, sample.payload.to_bytes()))

    with ExitStack() as stack:
        endpoint = stack.enter_context(network.router())
        session = stack.enter_context(network.client(endpoint))
        stack.callback(session.declare_subscriber(keys.tracks("front"), take).undeclare)
        process = stack.enter_context(running(
            "-P", "-m", "heel.services.tracker", "--connect", endpoint, "--delivery", "lossless",
            "--log-level", "info", HEEL_RUNTIME_DIR=str(tmp_path),
        ))  # fmt: skip
        wait_until(lambda: "is up" in process.stderr(), "the tracker", _START_S)
        # Said before it listens as far as it knows: it asks.
        stack.enter_context(Latched(session, keys.info("front"), qos.INFO)).set(info)
        robot = Robot(session, info, "lossless")
        for seq in range(12):
            robot.send_people(seq)
            time.sleep(0.05)
            assert len(heard) == seq, "without its depth no frame is answered"
            robot.send_depth(seq)
            wait_until(lambda seq=seq: len(heard) == seq + 1, "the tracks")
    assert [tracks.seq for tracks in heard] == list(range(12))
    told = [track.distance_m for tracks in heard for track in tracks.tracks]
    assert all(one is not None for one in told)
    assert len(told) > 5
