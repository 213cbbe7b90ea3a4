"""The ROS side: a node that keeps the newest of what the robot says, and sends velocities.

What it says is here, once; how it travels is a transport's: `over_dds.py`, `over_zenoh.py`.
Nothing is latched: velocities go out volatile, and the last ones of a process are zero.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Self

from heel.services.ros2 import outputs
from heel.services.ros2.convert import PartStatus, PersonThere
from heel.services.ros2.settings import Ros2Settings

_GOODBYES = 3
"""Zero velocities that are sent at the end, as one may be lost."""
_GOODBYE_S = 0.02
"""Time between them [s]: a period of 50 Hz."""


@dataclass
class Heard:
    """The newest of each kind since it was taken; emergency stops are counted.

    Attributes:
        picture_ns: when the picture came, by the monotonic clock.
        unread: why a message could not be read, by what it should have been.
    """

    picture: Any = None
    picture_ns: int = 0
    depth: Any = None
    info: Any = None
    scan: Any = None
    odometry: Any = None
    stops: int = 0
    unread: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class End:
    """One publisher or subscriber of the robot.

    Attributes:
        kind: type, like `sensor_msgs/msg/Image`.
        latched: whether it gets nothing of those that keep no old messages for it.
        type_hash: of the type's definition, where the transport goes by it, else "".
    """

    kind: str
    latched: bool = False
    type_hash: str = ""


class RosNode(ABC):
    """A node in the robot's ROS; as a context it is there, and leaves with zero velocities.

    Attributes:
        settings: the topics.
        arrived: set whenever something came.
        failure: why it hears nothing any more, None while it does.
        discovery_s: time for the transport to find the robot's nodes [s].
    """

    discovery_s = 0.0

    def __init__(self, settings: Ros2Settings) -> None:
        """Nothing is joined yet."""
        self.settings = settings
        self._outputs = outputs.outputs_of(settings)
        self.arrived = threading.Event()
        self.failure: Exception | None = None
        self._driven = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        """Send zero velocities, whatever happened, and leave ROS.

        None where none was sent before: the robot is somebody else's then.
        """
        pause = threading.Event()
        for _ in range(_GOODBYES if self._driven else 0):
            with suppress(Exception):
                self.send(0.0, 0.0)
            pause.wait(_GOODBYE_S)
        self.leave()

    def send(self, linear_mps: float, angular_radps: float) -> None:
        """Send a velocity."""
        self._driven = True
        stamped = self.settings.command_stamped
        message = self.message(velocity_kind(self.settings))
        twist = message.twist if stamped else message
        twist.linear.x, twist.angular.z = linear_mps, angular_radps
        if stamped:
            self._stamp(message.header)
        self.publish(self.settings.command_topic, message)

    def send_target(self, x_m: float, y_m: float) -> None:
        """Say where the target is, from the robot: x ahead, y left."""
        if "target" not in self._outputs:
            return
        message = self.message("geometry_msgs/msg/PoseStamped")
        self._stamp(message.header)
        message.pose.position.x, message.pose.position.y = x_m, y_m
        message.pose.orientation.w = 1.0
        self._tell("target", message)

    def send_people(self, people: Sequence[PersonThere], picture: Any) -> None:
        """Say where people are.

        Args:
            people: of a frame.
            picture: std_msgs/Header of the frame's picture; None: it did not come from ROS.
        """
        header = picture
        if header is None:
            header = self.message("std_msgs/msg/Header")
            header.stamp.sec, header.stamp.nanosec = divmod(self.now_ns(), 10**9)
        if "people" in self._outputs:
            frame = self.settings.command_frame
            self._tell("people", outputs.markers(self.message, people, header.stamp, frame))
        if "detections" in self._outputs:
            self._tell("detections", outputs.detections(self.message, people, header))

    def send_diagnostics(self, parts: Sequence[PartStatus], robot: str) -> None:
        """Say how every part is; `robot` is its name."""
        stamp = self.message("std_msgs/msg/Header").stamp
        stamp.sec, stamp.nanosec = divmod(self.now_ns(), 10**9)
        self._tell("diagnostics", outputs.diagnostics(self.message, parts, stamp, robot))

    def _tell(self, name: str, message: Any) -> None:
        topic, _ = self._outputs[name]
        self.publish(topic, message)

    def _stamp(self, header: Any) -> None:
        header.stamp.sec, header.stamp.nanosec = divmod(self.now_ns(), 10**9)
        header.frame_id = self.settings.command_frame

    @abstractmethod
    def take(self) -> Heard:
        """What came since the last call."""

    @abstractmethod
    def now_ns(self) -> int:
        """Time of the robot's clock, which its stamps are of."""

    @abstractmethod
    def message(self, kind: str) -> Any:
        """An empty message of a type that `publications` names, or a part of one."""

    @abstractmethod
    def publish(self, topic: str, message: Any) -> None:
        """Send a message on a topic of `publications`."""

    @abstractmethod
    def full_name(self, topic: str) -> str:
        """The topic with its namespace."""

    @abstractmethod
    def type_hash(self, kind: str) -> str:
        """Hash of a type's definition; "" where the transport does not go by it."""

    @abstractmethod
    def topics(self) -> dict[str, Sequence[str]]:
        """Types of every topic that is known, by its full name."""

    @abstractmethod
    def publishers(self, name: str) -> list[End]:
        """Who publishes on a topic, by its full name."""

    @abstractmethod
    def subscribers(self, name: str) -> list[End]:
        """Who listens to a topic, by its full name."""

    @abstractmethod
    def leave(self) -> None:
        """Leave ROS; never raises."""


def velocity_kind(settings: Ros2Settings) -> str:
    """Type of the velocities that go out."""
    return f"geometry_msgs/msg/Twist{'Stamped' if settings.command_stamped else ''}"


def publications(settings: Ros2Settings) -> dict[str, str]:
    """What is published: type by topic."""
    told = dict(outputs.outputs_of(settings).values())
    return {settings.command_topic: velocity_kind(settings)} | told


def subscriptions(settings: Ros2Settings) -> dict[str, tuple[str, str]]:
    """What is listened to: topic and type, by the field of `Heard`."""
    compressed = settings.image_topic.rstrip("/").endswith("/compressed")
    picture = f"sensor_msgs/msg/{'CompressedImage' if compressed else 'Image'}"
    wanted = {
        "picture": (settings.image_topic, picture),
        "depth": (settings.depth_topic, "sensor_msgs/msg/Image"),
        "info": (settings.camera_info_topic, "sensor_msgs/msg/CameraInfo"),
        "scan": (settings.scan_topic, "sensor_msgs/msg/LaserScan"),
        "odometry": (settings.odometry_topic, "nav_msgs/msg/Odometry"),
        "stops": (settings.estop_topic, "std_msgs/msg/Bool"),
    }
    return {name: (topic, kind) for name, (topic, kind) in wanted.items() if topic}
