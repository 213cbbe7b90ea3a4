"""Where the window of a virtual pan lies, and what moves it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import Track, Tracks
from heel.schemas.errors import SourceError
from heel.services.capture.pan_window import PanSettings, PanWindow
from heel.services.capture.steering import STALE_S, Steering

SIZE = (768, 576)


def window(**settings: float) -> PanWindow:
    return PanWindow(SIZE, PanSettings.model_validate(settings))


def gradient() -> NDArray[np.uint8]:
    """A picture whose blue tells the column and whose green tells the row, in quarters."""
    rows, columns = np.indices(SIZE[::-1])
    return np.dstack([columns // 4, rows // 4, rows * 0]).astype(np.uint8)


def tracks(index: int, box: tuple[float, float, float, float], track_id: int = 1) -> Tracks:
    track = Track(
        id=track_id, state="tracked", box_xyxy=box, velocity_pxps=(0.0, 0.0), area_px=1.0,
        span_px=1.0, identity_confidence=1.0, shown=True,
    )  # fmt: skip
    return Tracks(
        stream="front", epoch=1, seq=index, index=index, t_capture_ns=0, width=384, height=288,
        source_width=384, source_height=288, tracks=(track,),
    )  # fmt: skip


def test_the_window_is_half_the_recording_in_its_middle_unless_told_otherwise() -> None:
    middle = window()
    assert (middle.width, middle.height) == (384, 288)
    assert middle.offset_px == (192.0, 144.0)
    assert middle.focal_px == pytest.approx(192.0 / math.tan(math.radians(30.0)))


@pytest.mark.parametrize(
    ("angular_radps", "seconds", "left_px"),
    [(0.1, 1.0, -33.37), (-0.1, 1.0, 33.37), (0.2, 0.5, -33.37), (0.4, 1.0, -140.59)],
)
def test_a_turn_to_the_left_moves_the_window_left_by_the_focal_length_times_the_tangent(
    angular_radps: float, seconds: float, left_px: float
) -> None:
    pan = window()
    pan.turn(angular_radps, seconds)
    assert pan.offset_px[0] - 192.0 == pytest.approx(left_px, abs=1 / 32)
    assert pan.offset_px[0] - 192.0 == pytest.approx(
        -pan.focal_px * math.tan(angular_radps * seconds), abs=1 / 32
    )


@pytest.mark.parametrize(("angular_radps", "left_px"), [(2.0, 0.0), (-2.0, 384.0)])
def test_the_window_ends_at_the_border_and_comes_back_at_once(
    angular_radps: float, left_px: float
) -> None:
    pan = window()
    pan.turn(angular_radps, 5.0)
    assert pan.offset_px[0] == left_px
    pan.turn(-angular_radps, 0.05)
    assert abs(pan.offset_px[0] - left_px) > 30.0


@pytest.mark.parametrize(
    ("x", "y", "offset"),
    [(384, 288, (192, 144)), (300, 200, (108, 56)), (0, 0, (0, 0)), (768, 576, (384, 288))],
)
def test_it_starts_with_the_named_place_in_the_middle_as_far_as_borders_allow(
    x: float, y: float, offset: tuple[float, float]
) -> None:
    assert window(x=x, y=y).offset_px == pytest.approx(offset, abs=1 / 32)


@pytest.mark.parametrize(
    ("settings", "words"),
    [({"width": 800}, "800x288"), ({"height": 577}, "384x577"), ({"x": 769}, "x=769")],
)
def test_a_window_that_does_not_fit_is_refused(settings: dict[str, float], words: str) -> None:
    with pytest.raises(SourceError, match=words):
        window(**settings)


def test_the_picture_is_what_lies_at_the_offset() -> None:
    pan = window()
    assert (pan.view(gradient(), 0) == gradient()[144:432, 192:576]).all()
    pan.turn(0.1, 1.0)
    left, top = pan.offset_px
    assert left != int(left)
    seen = pan.view(gradient(), 1).astype(float)
    assert seen.shape == (288, 384, 3)
    columns = (np.arange(384) + left - 1.5) / 4
    assert np.abs(seen[100, :, 0] - columns).max() < 1.0
    assert pan.offset_of(1) == (left, top)
    assert pan.offset_of(2) is None


def test_offsets_of_long_ago_are_forgotten() -> None:
    pan = PanWindow((40, 40), PanSettings(width=16, height=16))
    picture = np.zeros((40, 40, 3), np.uint8)
    for index in range(300):
        pan.view(picture, index)
    assert pan.offset_of(0) is None
    assert pan.offset_of(299) is not None


def test_the_same_turns_give_the_same_pictures() -> None:
    def played() -> list[bytes]:
        pan, pictures = window(), []
        for index in range(5):
            pan.turn(0.3 * math.sin(index), 0.1)
            pan.tilt_towards(300.0 + 20.0 * index, 0.1)
            pictures.append(pan.view(gradient(), index).tobytes())
        return pictures

    assert played() == played()


def test_the_tilt_comes_to_the_row_without_overshooting_and_no_faster_than_it_may() -> None:
    pan = window(tilt_radps=0.5)
    middles = []
    for _ in range(100):
        before = pan.pitch_rad
        pan.tilt_towards(380.0, 0.1)
        assert 0.0 <= pan.pitch_rad - before <= 0.05 + 1e-9
        middles.append(pan.offset_px[1] + 144.0)
    assert 360.0 < middles[-1] <= 380.0


def test_no_tilt_means_none() -> None:
    pan = window(tilt_radps=0.0)
    pan.tilt_towards(500.0, 1.0)
    assert pan.offset_px == (192.0, 144.0)


def test_the_window_turns_as_long_as_the_drive_speaks() -> None:
    pan = window()
    steering = Steering(pan)
    steering.advance(10.0)
    for tick in range(10):
        steering.hear_drive(0.2, 10.0 + 0.02 * tick)
    steering.advance(10.2)
    assert pan.yaw_rad == pytest.approx(0.04)
    steering.advance(60.0)
    assert pan.yaw_rad == pytest.approx(0.2 * (0.18 + STALE_S))


def test_time_that_runs_backwards_turns_nothing() -> None:
    pan = window()
    steering = Steering(pan)
    steering.hear_drive(0.2, 1.0)
    steering.advance(1.1)
    steering.advance(0.9)
    assert pan.yaw_rad == pytest.approx(0.02)
    steering.advance(1.1)
    assert pan.yaw_rad == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("target", "seen", "moves"), [(1, 1, True), (1, 2, False), (None, 1, False)]
)
def test_the_tilt_follows_the_target_and_nobody_else(
    target: int | None, seen: int, moves: bool
) -> None:
    pan = window()
    steering = Steering(pan)
    pan.view(gradient(), 7)
    steering.advance(0.0)
    steering.hear_target(target)
    steering.hear_tracks(tracks(7, (100.0, 230.0, 130.0, 288.0), seen))
    steering.advance(0.5)
    assert (pan.offset_px[1] > 150.0) is moves


def test_a_row_counts_from_where_the_window_lay_in_the_frame_it_was_seen_in() -> None:
    pan = window()
    steering = Steering(pan)
    pan.view(gradient(), 7)
    steering.hear_target(1)
    for _ in range(3):
        steering.hear_tracks(tracks(7, (100.0, 160.0, 130.0, 220.0)))
        steering.advance(0.0)
        steering.advance(30.0)
    # The row is 334 in the recording, whenever that is heard; 0.03 rad are left alone.
    assert pan.offset_px[1] + 144.0 == pytest.approx(334.0 - 0.03 * pan.focal_px, abs=2.0)


def test_odometry_tells_the_turn_that_was_made_and_none_beyond_the_border() -> None:
    pan = window()
    steering = Steering(pan)
    steering.hear_drive(0.5, 0.0)
    assert steering.odometry(0).angular_radps == 0.0
    steering.advance(0.1)
    told = steering.odometry(1)
    assert told.angular_radps == pytest.approx(0.5)
    assert told.heading_rad == pytest.approx(0.05)
    assert steering.odometry(2).angular_radps == 0.0
    for tick in range(2, 40):
        steering.hear_drive(0.5, 0.1 * tick)
    assert pan.offset_px[0] == 0.0
    steering.odometry(3)
    steering.hear_drive(0.5, 4.0)
    assert steering.odometry(4).angular_radps == 0.0
