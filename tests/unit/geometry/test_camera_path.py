"""The path of the camera: from which frame what was seen there can be warped to the newest."""

from __future__ import annotations

import numpy as np
import pytest

from heel.services.geometry.picture_motion import Affine, CameraPath


def step(x_px: float) -> Affine:
    return np.array([[1.0, 0.0, x_px], [0.0, 1.0, 0.0]])


def path(**steps_px: float) -> CameraPath:
    camera = CameraPath()
    for frame, x_px in steps_px.items():
        camera.add(int(frame.removeprefix("frame_")), step(x_px))
    return camera


@pytest.mark.parametrize(
    ("seq", "x_px"),
    [
        pytest.param(14, 0.0, id="the newest"),
        pytest.param(12, 8.0, id="one since"),
        pytest.param(11, 13.0, id="two since"),
        pytest.param(13, 8.0, id="not placed: as the last that was"),
        pytest.param(7, 16.0, id="before the first: the camera stood still"),
    ],
)
def test_the_steps_since_a_frame_add_up(seq: int, x_px: float) -> None:
    # Frame 13 could not be placed: the step to frame 14 begins at frame 12.
    since = path(frame_10=3.0, frame_11=0.0, frame_12=5.0, frame_14=8.0).since(seq)

    assert since is not None
    assert since.tolist() == step(x_px).tolist()


def test_what_lies_farther_back_than_the_path_goes_cannot_be_warped() -> None:
    camera = CameraPath()
    for seq in range(200):
        camera.add(seq, step(1.0))

    assert camera.since(100) is None
    assert camera.since(150) is not None
