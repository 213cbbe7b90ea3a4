"""A robot of other people's code in this process, bridge and drive in others: `make test-ros2`.

Needs rclpy, in an environment of its own; the conversions alone are tested without.
"""

from __future__ import annotations

import array
import math
import os
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest
import zenoh

from benchmarks.ros.robots import Robot, dds_robot, speed, zenoh_robot
from heel.schemas import (
    CameraInfo,
    EStop,
    Header,
    Odometry,
    Ranges,
    Stamp,
    Track,
    Tracks,
    decode,
    encode,
    keys,
)
from heel.schemas.image import decode_depth, decode_image
from tests.support import network
from tests.support.driving import drive_process
from tests.support.network import wait_until
from tests.support.processes import Running, finished, running

pytest.importorskip("rclpy", reason="no ROS 2 here: make test-ros2 brings it")
pytest.importorskip("zenoh_ros2_sdk", reason="make test-ros2 brings it")
DOMAIN = str(1 + os.getpid() % 99)
os.environ.update(ROS_DOMAIN_ID=DOMAIN, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST")
# ROS's own modules have some.
pytestmark = pytest.mark.filterwarnings("default::DeprecationWarning")
PERIOD_S = 0.02
"""Of the drive."""
ROBOTS = {"dds": dds_robot, "zenoh": zenoh_robot}


@pytest.fixture(scope="module", params=ROBOTS)
def base(request: pytest.FixtureRequest) -> Iterator[Robot]:
    with ROBOTS[request.param]() as robot:
        yield robot


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with network.router() as address:
        yield address


@pytest.fixture(scope="module")
def session(endpoint: str) -> Iterator[zenoh.Session]:
    with network.client(endpoint) as opened:
        yield opened


@pytest.fixture(scope="module")
def bridge(endpoint: str, base: Robot) -> Iterator[Running]:
    command = ("-P", "-m", "heel.services.ros2", "--connect", endpoint, "--estop-topic", "estop",
               "--depth-topic", "camera/depth",
               "--people-topic", "people", "--diagnostics-topic", "diagnostics",
               "--log-level", "info", *base.flags)  # fmt: skip
    with running(
        *command, ROS_DOMAIN_ID=DOMAIN, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST"
    ) as process:
        wait_until(lambda: "is up" in process.stderr(), "the bridge", 30.0)
        yield process


def test_camera_scan_and_odometry_arrive(base: Robot, bridge: Running, session: Any) -> None:
    from nav_msgs.msg import Odometry as RosOdometry
    from sensor_msgs.msg import CameraInfo as RosInfo
    from sensor_msgs.msg import Image, LaserScan

    pixels = np.random.default_rng(1).integers(0, 256, (48, 64, 3), np.uint8)
    image = Image(height=48, width=64, encoding="rgb8", step=192)
    image.data = array.array("B", pixels.tobytes())
    info = RosInfo(width=64, height=48, distortion_model="plumb_bob", d=[-0.1, 0.01, 0.0, 0.0, 0.0])
    info.k = [50.0, 0.0, 32.0, 0.0, 50.0, 24.0, 0.0, 0.0, 1.0]
    scan = LaserScan(angle_min=-1.0, angle_increment=0.5, range_min=0.1, range_max=9.0)
    scan.ranges = [1.0, 2.0, 3.0, 4.0, 5.0]
    odometry = RosOdometry()
    odometry.pose.pose.orientation.w = 1.0
    with ExitStack() as stack:
        images, scans, places, infos = (
            stack.enter_context(network.collected(session, key))
            for key in (keys.image("front"), keys.ROBOT_RANGE, keys.ROBOT_ODOMETRY,
                        keys.info("front"))
        )  # fmt: skip

        def arrived() -> bool:
            base.publish("camera/camera_info", info)
            image.header.stamp.sec, image.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
            base.publish("camera/image_raw", image)
            base.publish("scan", scan)
            base.publish("odom", odometry)
            time.sleep(0.05)
            return all(queue.qsize() > 2 for queue in (images, scans, places)) and infos.qsize() > 0

        wait_until(arrived, "camera, scan and odometry", 20.0)
        sample, ranges, place = images.get(), scans.get(), places.get()
        told = None
        while infos.qsize():
            told = decode(CameraInfo, infos.get().payload.to_bytes())
    header = decode(Header, sample.attachment.to_bytes())
    assert (
        decode_image(sample.payload.to_bytes(), header, str(sample.encoding)) == pixels[..., ::-1]
    ).all()
    assert 0 <= header.age_ns < 2_000_000_000
    sectors = decode(Ranges, ranges.payload.to_bytes()).sectors
    assert [sector.distance_m for sector in sectors] == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert decode(Odometry, place.payload.to_bytes()).x_m == 0.0
    assert told is not None
    assert told.lens is not None
    assert told.lens.focal_px == (50.0, 50.0)


def test_depth_arrives_under_the_header_of_its_picture(
    base: Robot, bridge: Running, session: Any
) -> None:
    from sensor_msgs.msg import Image

    image = Image(height=48, width=64, encoding="bgr8", step=192)
    image.data = array.array("B", bytes(48 * 192))
    metres = np.linspace(0.5, 4.0, 24 * 32, dtype=np.float32).reshape(24, 32)
    metres[0, 0] = np.nan
    depth = Image(height=24, width=32, encoding="32FC1", step=128)
    depth.data = array.array("B", metres.tobytes())
    with (
        network.collected(session, keys.depth("front")) as depths,
        network.collected(session, keys.image("front")) as images,
    ):

        def arrived() -> bool:
            for header in (image.header, depth.header):
                header.stamp.sec, header.stamp.nanosec = divmod(time.time_ns(), 10**9)
            base.publish("camera/image_raw", image)
            base.publish("camera/depth", depth)
            time.sleep(0.05)
            return depths.qsize() > 2

        wait_until(arrived, "depth", 20.0)
        sample, seen = depths.get(), set()
        while images.qsize():
            seen.add(decode(Header, images.get().attachment.to_bytes()).frame_id())
    header = decode(Header, sample.attachment.to_bytes())
    assert header.frame_id() in seen
    told = decode_depth(sample.payload.to_bytes(), header, str(sample.encoding))
    assert told[0, 0] == 0
    assert np.abs(told / 1000 - np.nan_to_num(metres)).max() <= 0.0005 + 1e-6


def test_velocities_come_at_the_drives_rate_and_are_zero_once_it_is_killed(
    base: Robot, bridge: Running, endpoint: str, session: Any
) -> None:
    with drive_process(endpoint, session) as drive, drive.commanded():
        wait_until(lambda: (speed(base) or 0.0) > 0.0, "a velocity", 20.0)
        base.heard.clear()
        time.sleep(1.0)
        steps = np.diff([t_s for t_s, _, _ in base.heard])
        assert np.median(steps) == pytest.approx(PERIOD_S, abs=PERIOD_S)
        drive.process.process.send_signal(signal.SIGKILL)
        killed_s = time.monotonic()
        wait_until(lambda: speed(base) == 0.0, "zero", 5.0)
        zero_s = next(t for t, linear, _ in base.heard if t > killed_s and linear == 0.0)
        assert zero_s - killed_s < 1.0
        time.sleep(0.3)
        assert all(linear == 0.0 for t, linear, _ in base.heard if t >= zero_s)


def test_people_are_drawn_where_they_stand_at_the_time_of_their_picture(
    base: Robot, bridge: Running, session: Any
) -> None:
    from sensor_msgs.msg import CameraInfo as RosInfo
    from sensor_msgs.msg import Image
    from visualization_msgs.msg import Marker, MarkerArray

    heard: list[Any] = []
    listener = base.listen("people", MarkerArray, heard.append)
    image = Image(height=48, width=64, encoding="bgr8", step=192)
    image.data = array.array("B", bytes(48 * 192))
    image.header.stamp.sec, image.header.stamp.nanosec = 1234, 5678
    told = Stamp(producer="tracker/main@00000001", t_sent_ns=0, age_ns=0)
    person = Track(
        id=7, state="tracked", box_xyxy=(30.0, 5.0, 34.0, 40.0), velocity_pxps=(0.0, 0.0),
        area_px=1.0, span_px=1.0, identity_confidence=0.9, shown=True, distance_m=2.0,
        bearing_rad=0.5,
    )  # fmt: skip
    with network.collected(session, keys.image("front")) as images:

        def arrived() -> bool:
            base.publish("camera/camera_info", RosInfo())
            base.publish("camera/image_raw", image)
            time.sleep(0.05)
            while images.qsize():
                header = decode(Header, images.get().attachment.to_bytes())
                tracks = Tracks(**header.frame_id().model_dump(), width=64, height=48,
                                source_width=64, source_height=48, tracks=(person,))  # fmt: skip
                session.put(keys.tracks("front"), encode(tracks), encoding=tracks.encoding(),
                            attachment=encode(told))  # fmt: skip
            return len(heard) > 0

        wait_until(arrived, "markers", 20.0)
    body, words = heard[-1].markers
    assert (body.type, words.type) == (Marker.CYLINDER, Marker.TEXT_VIEW_FACING)
    assert (body.id, words.text) == (7, "7")
    assert body.pose.position.x == pytest.approx(2.0 * math.cos(0.5))
    assert body.pose.position.y == pytest.approx(2.0 * math.sin(0.5))
    assert body.header.frame_id == "base_link"
    assert (body.header.stamp.sec, body.header.stamp.nanosec) == (1234, 5678)
    assert 0 < body.lifetime.nanosec < 10**9
    listener()


def test_health_of_every_part_comes_as_diagnostics(
    base: Robot, bridge: Running, endpoint: str, session: Any
) -> None:
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

    heard: list[Any] = []
    listener = base.listen("diagnostics", DiagnosticArray, heard.append)

    def latest() -> dict[str, Any]:
        return {one.name: one for one in heard[-1].status} if heard else {}

    def level(name: str) -> bytes:
        """As rclpy has it; to others a byte is a number."""
        return bytes([latest()[name].level]) if isinstance(latest()[name].level, int) else (
            latest()[name].level
        )  # fmt: skip

    with drive_process(endpoint, session) as drive:
        wait_until(lambda: len(latest()) >= 2, "two parts", 20.0)
        (name,) = (name for name in latest() if name.startswith("heel: drive/"))
        wait_until(lambda: level(name) == DiagnosticStatus.OK, "a drive that is well", 9.0)
        assert any(pair.key == "rate_out_hz" for pair in latest()[name].values)
        drive.process.process.send_signal(signal.SIGKILL)
        wait_until(lambda: level(name) == DiagnosticStatus.STALE, "it to be stale", 9.0)
    assert "heel: ros2/main" in latest()
    listener()


def test_the_check_says_what_is_there_and_what_does_not_fit(base: Robot, bridge: Running) -> None:
    from visualization_msgs.msg import Marker

    wrong = base.listen("people", Marker, lambda _: None)
    command = ("-P", "-m", "heel.services.ros2", "--check", "--node", "checking",
               "--people-topic", "people", "--diagnostics-topic", "diagnostics",
               *base.flags)  # fmt: skip
    code, out, _ = finished(
        *command, ROS_DOMAIN_ID=DOMAIN, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST", deadline_s=30.0
    )
    wrong()
    assert code == 1
    assert "ok     /cmd_vel: geometry_msgs/msg/Twist, 1 listener" in out
    assert "/diagnostics: diagnostic_msgs/msg/DiagnosticArray, no listeners" in out
    assert "wrong  /people: the robot wants visualization_msgs/msg/Marker, not" in out


def test_the_robots_stop_button_engages_the_emergency_stop(
    base: Robot, bridge: Running, session: Any
) -> None:
    """After all that drive: a drive that has heard of a stop keeps to it in the next run, too."""
    from std_msgs.msg import Bool

    with network.collected(session, keys.FOLLOW_ESTOP) as stops:

        def stopped() -> bool:
            base.publish("estop", Bool(data=True))
            time.sleep(0.05)
            return stops.qsize() > 0

        wait_until(stopped, "the stop", 10.0)
        told = decode(EStop, stops.get().payload.to_bytes())
    assert told.engaged
    assert "estop" in told.source


def test_the_last_velocities_of_a_bridge_that_ends_are_zero(
    base: Robot, bridge: Running, endpoint: str, session: Any
) -> None:
    """Last of all: it ends the bridge."""
    base.heard.clear()
    code, _ = bridge.stop(signal.SIGTERM, 10.0)
    assert code == 0
    wait_until(lambda: len(base.heard) > 0, "the last velocities", 5.0)
    assert speed(base) == 0.0
