"""Streams of valid and extreme messages: cores live, and what they answer can be sent."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from contextlib import suppress

import cv2
import numpy as np
import pytest

from heel.schemas import (
    Blob,
    Blobs,
    CameraMotion,
    FrameId,
    HeelError,
    MessageError,
    Patch,
    Tracks,
    decode,
    encode,
)
from heel.schemas.errors import SettingsError
from heel.services.detector.core import Detector
from heel.services.detector.settings import DetectorSettings
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from tests.support.extremes import Extremes

_TRACKER = "tracker/main@00000001"


@pytest.fixture(autouse=True)
def numbers_may_overflow() -> Iterator[None]:
    """What becomes infinite is dropped; NumPy's words about it go unread."""
    cv2.setNumThreads(1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        yield


@pytest.mark.parametrize("seed", range(6))
def test_the_tracker_lives(seed: int) -> None:
    odd = Extremes(seed)
    odd.kind = "people" if seed % 2 else "regions"
    tracker = Tracker(TrackerSettings(preset="paper" if seed == 0 else "default"))
    for _ in range(120):
        with suppress(MessageError, SettingsError):
            encode(tracker.update(decode(Blobs, encode(odd.blobs()))))
            tracker.settle()


@pytest.mark.parametrize("seed", range(6))
def test_the_follower_lives_within_its_limits(seed: int) -> None:
    odd, now_s = Extremes(seed), 0.0
    settings = FollowerSettings(target=("none", "nearest", "imprint")[seed % 3])
    follower = Follower(settings)
    for _ in range(500):
        now_s += odd.random.choice([0.0, 0.02, 0.02, 0.3, 5.0])
        match odd.random.randrange(8):
            case 0:
                follower.set_camera(odd.info())
            case 1:
                follower.observe_odometry(odd.odometry(), now_s)
            case 2:
                follower.observe_ranges(odd.ranges(), now_s)
            case 3:
                with suppress(HeelError):
                    follower.choose(odd.request())
            case _:
                follower.observe(decode(Tracks, encode(odd.tracks())), _TRACKER)
        command = follower.step(now_s, odd.random.choice([None, 0.0, 0.05, 0.05, 0.05, 1e9]))
        encode(command)
        encode(follower.state)
        assert abs(command.linear_mps) <= settings.max_linear_mps
        assert abs(command.angular_radps) <= settings.max_angular_radps


def test_the_detector_lives() -> None:
    odd, detector = Extremes(1), Detector(DetectorSettings())
    for _ in range(25):
        frame, pixels, source_size = odd.picture()
        pointed = odd.pointed(frame) if odd.random.random() < 0.3 else None
        with suppress(MessageError, SettingsError):
            encode(detector.detect(frame, pixels, source_size, None, pointed))


def seen(seq: int, motion: CameraMotion | None, person: bool) -> Blobs:
    patch = Patch(width=8, height=20, bgr=bytes(480))
    box = Blob(
        box_xyxy=(300.0, 150.0, 360.0, 330.0), area_px=9000.0, centroid=(330.0, 240.0), patch=patch,
        score=0.95,
    )  # fmt: skip
    return Blobs(
        stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=10**9 + seq * 40_000_000,
        width=640, height=480, source_width=640, source_height=480,
        blobs=(box,) if person else (), kind="people", detector="odd", camera_motion=motion,
    )  # fmt: skip


@pytest.mark.parametrize(
    "affine",
    [(1.0, 0.0, 1e9, 0.0, 1.0, 0.0), (-1e9, 0.0, 0.0, 0.0, -1e9, 0.0), (0.0,) * 6,
     *((z, 0.0, 320 * (1 - z), 0.0, z, 240 * (1 - z)) for z in (1.1, 1.2, 2.0, 0.5))],
)  # fmt: skip
def test_no_camera_motion_ends_the_tracker_of_people(affine: tuple[float, ...]) -> None:
    """A zoom of a fifth a frame, believable each time, once ended it after 50 frames."""
    tracker = Tracker(TrackerSettings())
    motion = CameraMotion.model_validate({"affine": affine, "quality": 0.9})
    for seq in range(300):
        unseen = seq >= 12
        encode(tracker.update(seen(seq, motion if unseen else None, not unseen)))
    for seq in range(300, 330):
        tracks = tracker.update(seen(seq, None, True))
    assert any(track.shown for track in tracks.tracks)


def test_a_motion_that_no_camera_makes_is_not_told_on() -> None:
    tracker = Tracker(TrackerSettings())
    turned = CameraMotion(affine=(1.0, 0.0, -200.0, 0.0, 1.0, 3.0), quality=0.9)
    thrown = CameraMotion(affine=(1.0, 0.0, -700.0, 0.0, 1.0, 3.0), quality=0.9)
    assert tracker.update(seen(0, turned, True)).camera_motion == turned
    assert tracker.update(seen(1, thrown, True)).camera_motion is None


@pytest.mark.parametrize("shape", [(4000, 1), (3000, 12), (1, 4000), (1, 1)])
def test_a_click_on_a_very_narrow_picture_ends_no_detector(shape: tuple[int, int]) -> None:
    odd, detector = Extremes(0), Detector(DetectorSettings())
    pixels = np.random.default_rng(0).integers(0, 255, (*shape, 3)).astype(np.uint8)
    odd.size = shape[1], shape[0]
    for seq in range(4):
        fields = odd.frame() | {"seq": seq, "epoch": 1}
        frame = FrameId.model_validate({key: fields[key] for key in FrameId.model_fields})
        pointed = odd.pointed(frame).model_copy(
            update={
                "frame": frame, "width": shape[1], "height": shape[0], "x_px": shape[1] / 2,
                "y_px": shape[0] / 2,
            }
        )  # fmt: skip
        encode(detector.detect(frame, pixels, (shape[1], shape[0]), None, pointed if seq else None))


@pytest.mark.parametrize("height_px", [1, 2, 4])
def test_a_box_of_no_height_ends_no_follower(height_px: int) -> None:
    odd, follower = Extremes(0), Follower(FollowerSettings(target="nearest"))
    made = odd.tracks()
    while not made.tracks:
        made = odd.tracks()
    for bottom in (1e-300, 1e-9, 0.5):
        track = made.tracks[0].model_copy(
            update={
                "id": 1, "state": "tracked", "box_xyxy": (1.0, 0.0, 30.0, bottom), "shown": True,
                "distance_m": None, "bearing_rad": None, "identity_confidence": 1.0,
            }
        )  # fmt: skip
        follower.observe(
            made.model_copy(update={"width": 640, "height": height_px, "tracks": (track,)}),
            _TRACKER,
        )
        for step in range(30):
            command = follower.step(1.0 + 0.02 * step, 0.01)
            assert math.isfinite(command.linear_mps)
