"""Pictures of the simulated camera: one of each moment, for the stack and for the film."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from heel.schemas import FollowState, FrameId, Target, Tracks
from heel.services.detector.settings import DetectorSettings
from heel.services.loops.scenarios.pixels import Camera, Film, RenderedPixels
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.state import CameraMount
from heel.services.tracker.settings import TrackerSettings

MOUNT = CameraMount(width_px=320, height_px=240)


def frame(seq: int) -> FrameId:
    return FrameId(stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=seq * 50_000_000)


def idle() -> FollowState:
    return FollowState(
        seq=0, state="idle", reason="no target", estop=False, target=Target(seq=0, mode="none"),
        linear_mps=0.0, angular_radps=0.0,
    )  # fmt: skip


def test_stack_and_film_get_the_same_picture_of_a_moment(tmp_path: Path) -> None:
    world = scenario("straight", 0)
    path = tmp_path / "film.mp4"
    with Camera(world, MOUNT) as camera:
        perception = RenderedPixels(camera, DetectorSettings(), TrackerSettings())
        with Film(camera, path, MOUNT.fps) as film:
            for seq in range(3):
                tracks = perception.see(frame(seq))
                seen = camera.picture()
                film.add(tracks, idle())
                assert camera.picture() is seen
                world.step(0.05, 0.5, 0.0)
        assert camera.picture() is not seen

    assert isinstance(tracks, Tracks)
    assert (tracks.seq, tracks.width, tracks.height) == (2, MOUNT.width_px, MOUNT.height_px)
    film_read = cv2.VideoCapture(str(path))
    assert int(film_read.get(cv2.CAP_PROP_FRAME_COUNT)) == 3
    assert film_read.get(cv2.CAP_PROP_FPS) == pytest.approx(MOUNT.fps)
