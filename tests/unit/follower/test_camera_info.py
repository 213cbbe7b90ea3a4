"""One owner of what the camera says of itself: another lens is somebody else's word."""

from __future__ import annotations

import math

import pytest

from heel.schemas import CameraInfo
from heel.services.follower.camera_info import CameraInfos, implausible


def info(fov_rad: float | None = 1.0, epoch: int = 1, **rest: object) -> CameraInfo:
    given = {
        "stream": "front", "epoch": epoch, "width": 640, "height": 480, "source_width": 640,
        "source_height": 480, "fps": 20.0, "source": "a test", "horizontal_fov_rad": fov_rad,
    }  # fmt: skip
    return CameraInfo.model_validate(given | rest)


def test_the_description_of_the_frames_own_epoch_counts() -> None:
    infos = CameraInfos("front")
    assert infos.hear(info(1.0, epoch=1)) == ""
    assert infos.hear(info(0.2, epoch=9)) == ""
    assert infos.of(1) == info(1.0, epoch=1)
    assert infos.of(9) == info(0.2, epoch=9)
    assert infos.of(5) is None


def test_another_lens_of_the_same_start_is_not_used_and_said() -> None:
    infos = CameraInfos("front")
    infos.hear(info(1.0))
    infos.of(1)
    for forged in (0.2, 2.9, None):
        assert "two descriptions" in infos.hear(info(forged))
    assert "two descriptions" in infos.hear(info(1.0, mount_height_m=30.0, mount_pitch_rad=0.0))
    assert infos.of(1) == info(1.0)


def test_another_size_of_the_same_lens_is_used() -> None:
    infos = CameraInfos("front")
    infos.hear(info(1.0))
    infos.of(1)
    assert infos.hear(info(1.0, width=320, height=240)) == ""
    now = infos.of(1)
    assert now is not None
    assert now.width == 320


@pytest.mark.parametrize("order", [(1.0, 0.2), (0.2, 1.0)])
def test_before_any_frame_the_lens_by_which_people_are_nearest_counts(
    order: tuple[float, float],
) -> None:
    infos = CameraInfos("front")
    said = [infos.hear(info(fov_rad)) for fov_rad in order]
    assert said[0] == ""
    assert "two descriptions" in said[1]
    assert infos.of(1) == info(1.0)


def test_another_cameras_description_is_not_used() -> None:
    assert "of camera rear" in CameraInfos("front").hear(info(stream="rear"))


@pytest.mark.parametrize(
    "odd",
    [info(3.1415927410125732), info(5e-324), info(1e-310), info(1e-9),
     info(mount_height_m=1.0, mount_pitch_rad=math.pi / 2), info(mount_pitch_rad=-1e9)],
)  # fmt: skip
def test_what_no_camera_is_like_is_never_used(odd: CameraInfo) -> None:
    infos = CameraInfos("front")
    assert implausible(odd)
    assert infos.hear(odd).startswith("camera info cannot be used: ")
    assert infos.of(1) is None


def test_memory_is_bounded() -> None:
    infos = CameraInfos("front")
    infos.hear(info(epoch=0))
    infos.of(0)
    for epoch in range(1, 100):
        infos.hear(info(epoch=epoch))
    assert len(infos._infos) <= 8
    assert infos.of(0) is not None
