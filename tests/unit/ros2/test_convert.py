"""ROS messages to Heel's: pictures, lenses, scans and odometry, and what is refused."""

from __future__ import annotations

import math
from types import SimpleNamespace as Fields

import cv2
import numpy as np
import pytest

from heel.schemas import HeelError, Ranges
from heel.services.geometry.ros_pictures import compressed_picture_of, depth_of, picture_of
from heel.services.ros2.check import judged_input, judged_output
from heel.services.ros2.convert import (
    OdometryReader,
    lens_of,
    sectors_of,
)
from heel.services.ros2.node import End

BGR = np.dstack([np.full((4, 6), value, np.uint8) for value in (10, 120, 240)])


def image(pixels: np.ndarray, encoding: str, padding: int = 0) -> Fields:
    rows = np.pad(pixels.reshape(len(pixels), -1), ((0, 0), (0, padding)))
    return Fields(
        encoding=encoding, height=len(pixels), width=6, step=rows.shape[1], data=rows.tobytes()
    )


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [
        ("bgr8", BGR),
        ("rgb8", BGR[..., ::-1]),
        ("bgra8", np.dstack([BGR, np.zeros((4, 6), np.uint8)])),
        ("rgba8", np.dstack([BGR[..., ::-1], np.zeros((4, 6), np.uint8)])),
    ],
)
def test_colours_come_out_as_they_were(encoding: str, pixels: np.ndarray, padding: int) -> None:
    assert (picture_of(image(np.ascontiguousarray(pixels), encoding, padding)) == BGR).all()


def test_grey_and_yuv_become_colours() -> None:
    grey = picture_of(image(np.full((4, 6), 77, np.uint8), "mono8"))
    assert (grey == 77).all()
    assert grey.shape == (4, 6, 3)
    yuyv = np.zeros((4, 6, 2), np.uint8)
    yuyv[..., 0], yuyv[..., 1] = 100, 128
    assert np.ptp(picture_of(image(yuyv, "yuv422_yuy2")).reshape(-1, 3), axis=1).max() <= 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"encoding": "bayer_rggb8"}, "bayer_rggb8' is not read"),
        ({"data": b"\x00" * 10}, "it is cut"),
        ({"width": 0}, "it is cut"),
        ({"step": 3}, "it is cut"),
        ({"height": 2**31}, "it is cut"),
    ],
)
def test_a_picture_that_cannot_be_is_refused(change: dict[str, object], words: str) -> None:
    message = image(BGR, "bgr8")
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(HeelError, match=words):
        picture_of(message)


def test_a_compressed_picture_is_read_or_refused() -> None:
    coded = cv2.imencode(".png", BGR)[1].tobytes()
    assert (compressed_picture_of(Fields(data=coded, format="png")) == BGR).all()
    for data in (b"", b"no picture"):
        with pytest.raises(HeelError, match="is no JPEG or PNG"):
            compressed_picture_of(Fields(data=data, format="jpeg"))


def camera(**changes: object) -> Fields:
    told = {"width": 640, "height": 480, "k": [500.0, 0, 320, 0, 501, 240, 0, 0, 1],
            "d": [-0.1, 0.01, 0.0, 0.0, 0.0], "distortion_model": "plumb_bob"}  # fmt: skip
    return Fields(**{**told, **changes})


def test_the_lens_scales_with_the_picture_and_is_none_uncalibrated() -> None:
    lens = lens_of(camera(), 320, 240)
    assert lens is not None
    assert (lens.model, lens.focal_px, lens.centre_px) == ("plumb_bob", (250, 250.5), (160, 120))
    fisheye = lens_of(camera(distortion_model="equidistant", d=[0.1, 0, 0, 0]), 640, 480)
    assert fisheye is not None
    assert fisheye.model == "equidistant"
    assert lens_of(camera(k=[0.0] * 9), 640, 480) is None
    assert lens_of(camera(width=0), 640, 480) is None
    with pytest.raises(HeelError, match="thin_prism"):
        lens_of(camera(distortion_model="thin_prism"), 640, 480)
    with pytest.raises(HeelError, match="finite"):
        lens_of(camera(d=[math.nan]), 640, 480)


def scan(ranges: list[float], start: float = -math.pi / 2, step: float = 0.01) -> Fields:
    return Fields(
        angle_min=start, angle_increment=step, range_min=0.1, range_max=10.0, ranges=ranges
    )


def test_rays_become_sectors_by_what_they_mean() -> None:
    told = sectors_of(scan([3.0, 12.0, 0.05, math.nan, math.inf]), yaw_rad=math.pi / 2)
    assert [s.distance_m for s in told[:3]] == [3.0, math.inf, -math.inf]
    assert math.isnan(told[3].distance_m)
    assert told[4].distance_m == math.inf
    assert told[0].bearing_rad == pytest.approx(0.0)
    assert told[1].bearing_rad == pytest.approx(0.01)


def test_a_fine_scan_is_grouped_by_the_nearest_ray() -> None:
    ranges = [5.0] * 4000
    ranges[1234] = 1.0
    told = sectors_of(scan(ranges, -math.pi, 2 * math.pi / 4000))
    Ranges(seq=0, sectors=told)
    near = [sector for sector in told if sector.distance_m == 1.0]
    assert len(near) == 1
    ray = math.remainder(-math.pi + 2 * math.pi / 4000 * 1234, 2 * math.pi)
    assert abs(near[0].bearing_rad - ray) <= near[0].width_rad / 2 + 1e-9


@pytest.mark.parametrize("step", [0.0, math.nan, 4.0])
def test_a_scanner_that_does_not_turn_is_refused(step: float) -> None:
    with pytest.raises(HeelError, match="no scanner"):
        sectors_of(scan([1.0], step=step))
    assert sectors_of(scan([])) == ()


def pose(x: float, y: float, heading: float, speed: float = 0.5) -> Fields:
    turn = Fields(x=0.0, y=0.0, z=math.sin(heading / 2), w=math.cos(heading / 2))
    place = Fields(position=Fields(x=x, y=y), orientation=turn)
    twist = Fields(linear=Fields(x=speed), angular=Fields(z=0.1))
    return Fields(pose=Fields(pose=place), twist=Fields(twist=twist))


def test_odometry_starts_at_zero_and_goes_on_where_the_robot_sets_its_frame_anew() -> None:
    reader = OdometryReader()
    first = reader.read(pose(5.0, 5.0, math.pi / 2))
    assert first is not None
    assert (first.seq, first.x_m, first.y_m, first.heading_rad) == (0, 0.0, 0.0, 0.0)
    second = reader.read(pose(5.0, 6.0, math.pi / 2))
    assert second is not None
    assert (second.x_m, second.y_m) == pytest.approx((1.0, 0.0))
    reset = reader.read(pose(0.0, 0.0, 0.0))
    assert reset is not None
    assert (reset.x_m, reset.y_m, reset.heading_rad) == pytest.approx((1.0, 0.0, 0.0))
    on = reader.read(pose(0.5, 0.0, 0.0))
    assert on is not None
    assert (on.seq, on.x_m) == (3, pytest.approx(1.5))
    assert reader.read(pose(math.nan, 0.0, 0.0)) is None


def test_the_check_says_what_does_not_fit_and_what_next() -> None:
    wanted = End("sensor_msgs/msg/Image")
    assert not judged_input("/image", wanted, [wanted], []).remedy
    assert "/cam" in judged_input("/image", wanted, [], ["/cam"]).remedy
    assert "driver" in judged_input("/image", wanted, [], []).remedy
    assert judged_input("/image", wanted, [End("std_msgs/msg/Bool")], []).remedy
    twist = End("geometry_msgs/msg/Twist")
    stamped = End("geometry_msgs/msg/TwistStamped")
    assert judged_output("/cmd_vel", twist, [stamped]).remedy == "--command-stamped"
    assert judged_output("/cmd_vel", stamped, [twist]).remedy == "--no-command-stamped"
    assert judged_output("/cmd_vel", twist, []).remedy
    assert not judged_output("/cmd_vel", twist, [twist]).remedy


def test_the_check_says_of_a_listener_that_hears_nothing_of_a_type_of_its_name() -> None:
    ours, theirs = End("geometry_msgs/msg/Twist", False, "RIHS01_ab"), End(
        "geometry_msgs/msg/Twist", False, "TypeHashNotSupported"
    )  # fmt: skip
    assert "TypeHashNotSuppo" in judged_output("/cmd_vel", ours, [ours, theirs]).words
    assert judged_input("/image", ours, [theirs], []).remedy
    latched = End(ours.kind, True, ours.type_hash)
    assert "volatile" in judged_output("/cmd_vel", ours, [latched]).remedy


def depth(values: np.ndarray, encoding: str, big: bool = False, padding: int = 0) -> Fields:
    stored = values.astype(values.dtype.newbyteorder(">" if big else "<"))
    rows = np.frombuffer(stored.tobytes(), np.uint8).reshape(len(values), -1)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    return Fields(
        encoding=encoding, height=len(values), width=values.shape[1], step=rows.shape[1],
        data=rows.tobytes(), is_bigendian=int(big),
    )  # fmt: skip


@pytest.mark.parametrize("padding", [0, 4])
@pytest.mark.parametrize("big", [False, True])
def test_depth_in_millimetres_and_metres_comes_out_the_same(big: bool, padding: int) -> None:
    told = np.array([[0, 1500, 65535], [1, 300, 2]], np.uint16)
    assert (depth_of(depth(told, "16UC1", big, padding)) == told).all()
    metres = np.array([[np.nan, 1.5, 65.534], [-1.0, np.inf, 70.0]], np.float32)
    expected = [[0, 1500, 65534], [0, 0, 0]]
    assert depth_of(depth(metres, "32FC1", big, padding)).tolist() == expected


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"encoding": "8UC1"}, "8UC1' is not read"), ({"data": b"12"}, "it is cut"),
        ({"step": 2}, "it is cut"), ({"width": 0}, "it is cut"), ({"height": 2**31}, "it is cut"),
    ],
)  # fmt: skip
def test_depth_that_cannot_be_is_refused(change: dict[str, object], words: str) -> None:
    message = depth(np.ones((2, 3), np.uint16), "16UC1")
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(HeelError, match=words):
        depth_of(message)
