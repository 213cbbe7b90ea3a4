"""Heel's cores as nodes of rclpy, one process each, or called one after the other in one process.

Every message carries the stamp of its picture, by which a listener tells how old results are.
Pictures are sensor_msgs/Image; blobs and tracks go as the bytes that Heel sends, in the data of a
sensor_msgs/CompressedImage, as ROS has no message of theirs; commands are TwistStamped.
"""

from __future__ import annotations

import array
import json
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated, Any

import cv2
import typer

from heel.schemas import Blobs, FrameId, HeelError, MotionCommand, Tracks, decode, encode
from heel.services.capture.sources import open_source
from heel.services.detector.core import Detector
from heel.services.detector.settings import DetectorServiceSettings
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerServiceSettings
from heel.services.geometry.ros_pictures import picture_of
from heel.services.pipeline import InProcessPipeline
from heel.services.runtime.command_line import run_app
from heel.services.runtime.pacing import Pacer
from heel.services.runtime.settings import ServiceSettings, load_settings
from heel.services.tracker.core import configured
from heel.services.tracker.settings import TrackerServiceSettings

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
STAGES = ("blobs", "tracks", "command")
ROLES = ("camera", "detector", "tracker", "follower", "listener")
_PRODUCER = "tracker/main@00000001"
_DISCOVERY_S = 3.0
"""Time for the nodes to find each other [s], before which no picture is sent; chosen by hand."""


class Ages:
    """How old frames were when a stage's result came, ms."""

    def __init__(self) -> None:
        self.ms: dict[str, list[float]] = {stage: [] for stage in STAGES}

    def note(self, stage: str, captured_ns: int) -> None:
        """A result came of a picture that was taken then, wall clock."""
        self.ms[stage].append((time.time_ns() - captured_ns) / 1e6)


class Node:
    """One node of rclpy with a reliable topic in, and one out, ten messages each."""

    def __init__(self, name: str) -> None:
        import rclpy

        rclpy.init(args=[], signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
        self._ros: Any = rclpy
        self._node: Any = rclpy.create_node(name)
        self._over = threading.Event()
        signal.signal(signal.SIGTERM, lambda *_: self._over.set())

    def publisher(self, topic: str, kind: type) -> Callable[[Any], None]:
        """Sends on a topic."""
        send: Callable[[Any], None] = self._node.create_publisher(kind, topic, 10).publish
        return send

    def hear(self, topic: str, kind: type, heard: Callable[[Any], None], depth: int = 10) -> None:
        """Calls a function with every message."""
        self._node.create_subscription(kind, topic, heard, depth)

    def spin(self) -> None:
        """Until SIGTERM."""
        executor = self._ros.executors.SingleThreadedExecutor()
        executor.add_node(self._node)
        while not self._over.is_set():
            executor.spin_once(timeout_sec=0.05)


def _packed(message: Blobs | Tracks, stamp: Any) -> Any:
    from sensor_msgs.msg import CompressedImage

    told = CompressedImage(format=message.encoding())
    told.header.stamp = stamp
    told.data = array.array("B", encode(message))
    return told


def _ns(stamp: Any) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _settings(name: str, kind: type[ServiceSettings]) -> Any:
    return load_settings(name, kind, {}, None).service


def camera(source: str, fps: float, frames: int) -> None:
    """Publish pictures at their times."""
    from sensor_msgs.msg import Image

    node = Node("camera")
    send = node.publisher("image", Image)
    time.sleep(_DISCOVERY_S)
    pictures, pacer = open_source(source, loop=True), Pacer(fps)
    for index in range(frames):
        frame = pictures.read()
        if frame is None:
            raise HeelError(f"{source} ends after {index} frames")
        time.sleep(max(0.0, pacer.delay_s(index, time.monotonic())))
        height, width = frame.image.shape[:2]
        image = Image(height=height, width=width, encoding="bgr8", step=3 * width)
        image.header.stamp.sec, image.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
        image.header.frame_id = str(index)
        image.data = array.array("B", frame.image.tobytes())
        send(image)


def detector() -> None:
    """Pictures to blobs; the newest tracks protect people."""
    from sensor_msgs.msg import CompressedImage, Image

    node, core = Node("detector"), Detector(_settings("detector", DetectorServiceSettings))
    send = node.publisher("blobs", CompressedImage)
    newest: list[Tracks] = []

    def protect(told: Any) -> None:
        newest[:] = [decode(Tracks, bytes(told.data), told.format)]

    def detect(image: Any) -> None:
        seq = int(image.header.frame_id)
        frame = FrameId(stream="front", epoch=1, seq=seq, index=seq,
                        t_capture_ns=_ns(image.header.stamp))  # fmt: skip
        pixels = picture_of(image)
        size = (pixels.shape[1], pixels.shape[0])
        blobs = core.detect(frame, pixels, size, newest[0] if newest else None, None)
        send(_packed(blobs, image.header.stamp))

    node.hear("tracks", CompressedImage, protect)
    node.hear("image", Image, detect, depth=1)
    node.spin()


def tracker() -> None:
    """Blobs to tracks."""
    from sensor_msgs.msg import CompressedImage

    node = Node("tracker")
    core = configured(_settings("tracker", TrackerServiceSettings), None)
    send = node.publisher("tracks", CompressedImage)

    def track(told: Any) -> None:
        send(_packed(core.update(decode(Blobs, bytes(told.data), told.format)), told.header.stamp))
        core.settle()

    node.hear("blobs", CompressedImage, track)
    node.spin()


def follower() -> None:
    """Tracks to a velocity, at once."""
    from geometry_msgs.msg import TwistStamped
    from sensor_msgs.msg import CompressedImage

    node, core = Node("follower"), Follower(_settings("follower", FollowerServiceSettings))
    send = node.publisher("command", TwistStamped)

    def follow(told: Any) -> None:
        core.observe(decode(Tracks, bytes(told.data), told.format), _PRODUCER)
        age_s = (time.time_ns() - _ns(told.header.stamp)) / 1e9
        send(_twist(core.step(time.monotonic(), age_s), told.header.stamp))

    node.hear("tracks", CompressedImage, follow)
    node.spin()


def _twist(command: MotionCommand, stamp: Any) -> Any:
    from geometry_msgs.msg import TwistStamped

    told = TwistStamped()
    told.header.stamp = stamp
    told.twist.linear.x, told.twist.angular.z = command.linear_mps, command.angular_radps
    return told


def listener() -> Ages:
    """Hear every stage."""
    from geometry_msgs.msg import TwistStamped
    from sensor_msgs.msg import CompressedImage

    node, ages = Node("listener"), Ages()

    def noting(stage: str) -> Callable[[Any], None]:
        return lambda told: ages.note(stage, _ns(told.header.stamp))

    for stage in STAGES:
        kind = TwistStamped if stage == "command" else CompressedImage
        node.hear(stage, kind, noting(stage))
    node.spin()
    return ages


def together(source: str, fps: float, frames: int) -> Ages:
    """The cores one after the other, without any message."""
    perception = InProcessPipeline(
        _settings("detector", DetectorServiceSettings), _settings("tracker", TrackerServiceSettings)
    )
    core = Follower(_settings("follower", FollowerServiceSettings))
    pictures, pacer, ages = open_source(source, loop=True), Pacer(fps), Ages()
    for index in range(frames):
        frame = pictures.read()
        if frame is None:
            raise HeelError(f"{source} ends after {index} frames")
        time.sleep(max(0.0, pacer.delay_s(index, time.monotonic())))
        now_ns = time.time_ns()
        name = FrameId(stream="front", epoch=1, seq=index, index=index, t_capture_ns=now_ns)
        size = (frame.image.shape[1], frame.image.shape[0])
        blobs = perception.detect(name, frame.image, size)
        ages.note("blobs", now_ns)
        tracks = perception.track(blobs)
        ages.note("tracks", now_ns)
        core.observe(tracks, _PRODUCER)
        core.step(time.monotonic(), (time.time_ns() - now_ns) / 1e9)
        ages.note("command", now_ns)
        perception.settle()
    return ages


@app.command()
def main(
    role: Annotated[str, typer.Argument(help="which node, or together")],
    source: Annotated[str, typer.Option(help="pictures")] = "scene:demo?width=768&height=576",
    fps: Annotated[float, typer.Option(help="pictures a second")] = 25.0,
    frames: Annotated[int, typer.Option(help="so many")] = 500,
) -> None:
    """Be one node; print what it measured and used as JSON."""
    cv2.setNumThreads(1)
    ages: Ages | None = None
    if role == "camera":
        camera(source, fps, frames)
    elif role == "together":
        ages = together(source, fps, frames)
    elif role == "listener":
        ages = listener()
    else:
        {"detector": detector, "tracker": tracker, "follower": follower}[role]()
    told = {} if ages is None else ages.ms
    with suppress(BrokenPipeError):
        print(json.dumps({"cpu_s": time.process_time(), "ages_ms": told}), flush=True)


if __name__ == "__main__":
    run_app(app)
