"""Both kinds of robot that the bridge speaks with: none of their ROS is Heel's code.

Needs rclpy and zenoh-ros2-sdk, which `make test-ros2` puts into an environment of its own.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol

from heel.services.runtime.router import open_private_router

SHARE = Path(sys.prefix) / "share"
"""Where the wheels keep the definitions of their messages."""


class Robot(Protocol):
    """A robot whose base listens to `cmd_vel`.

    Attributes:
        heard: monotonic time, m/s and rad/s of every velocity.
        flags: what the bridge is to be started with.
    """

    heard: list[tuple[float, float, float]]
    flags: tuple[str, ...]

    def publish(self, topic: str, message: Any) -> None:
        """Send one of rclpy's messages."""

    def listen(self, topic: str, kind: type, heard: Callable[[Any], None]) -> Callable[[], None]:
        """Hear a topic of one of rclpy's types; what is returned ends that."""


def speed(robot: Robot) -> float | None:
    """The newest velocity ahead, m/s."""
    return robot.heard[-1][1] if robot.heard else None


def kind_of(cls: type) -> str:
    """Such as `geometry_msgs/msg/Twist`."""
    return f"{cls.__module__.split('.')[0]}/msg/{cls.__name__}"


class DdsRobot:
    """A node of rclpy."""

    flags: tuple[str, ...] = ()

    def __init__(self, node: Any) -> None:
        from geometry_msgs.msg import Twist

        self.heard: list[tuple[float, float, float]] = []
        self._node = node
        self._publishers: dict[str, Any] = {}
        node.create_subscription(Twist, "cmd_vel", self._hear, 50)

    def publish(self, topic: str, message: Any) -> None:
        if topic not in self._publishers:
            from rclpy.qos import qos_profile_sensor_data

            self._publishers[topic] = self._node.create_publisher(
                type(message), topic, qos_profile_sensor_data
            )
        self._publishers[topic].publish(message)

    def listen(self, topic: str, kind: type, heard: Callable[[Any], None]) -> Callable[[], None]:
        listener = self._node.create_subscription(kind, topic, heard, 10)
        return lambda: self._node.destroy_subscription(listener)

    def _hear(self, message: Any) -> None:
        self.heard.append((time.monotonic(), message.linear.x, message.angular.z))


class ZenohRobot:
    """Keys, tokens, attachments and hashes of zenoh-ros2-sdk; bytes of Fast CDR, by rclpy."""

    def __init__(self, endpoint: str) -> None:
        import zenoh_ros2_sdk

        self._sdk: Any = zenoh_ros2_sdk
        host, port = endpoint.removeprefix("tcp/").split(":")
        self.flags: tuple[str, ...] = ("--rmw", "zenoh", "--ros-router", endpoint)
        self.heard: list[tuple[float, float, float]] = []
        self._where = {"router_ip": host, "router_port": int(port)}
        self._sdk.message_registry.get_registry().messages_dir = SHARE
        self._sdk.session.ZenohSession.get_instance(host, int(port))
        self._publishers: dict[str, Any] = {}
        self._ears = self._sdk.ROS2Subscriber(
            "cmd_vel", "geometry_msgs/msg/Twist", self._hear, **self._where
        )

    def publish(self, topic: str, message: Any) -> None:
        from rclpy.serialization import serialize_message

        if topic not in self._publishers:
            kind = kind_of(type(message))
            self._publishers[topic] = self._sdk.ROS2Publisher(topic, kind, **self._where)
        told = self._publishers[topic]
        told.sequence_number += 1
        beside = told._create_attachment(told.sequence_number, time.time_ns())
        told.pub.put(serialize_message(message), attachment=beside)

    def listen(self, topic: str, kind: type, heard: Callable[[Any], None]) -> Callable[[], None]:
        listener = self._sdk.ROS2Subscriber(topic, kind_of(kind), heard, **self._where)
        return lambda: listener.close()

    def close(self) -> None:
        for end in (self._ears, *self._publishers.values()):
            end.close()
        self._sdk.session.ZenohSession.get_instance().close()

    def _hear(self, message: Any) -> None:
        self.heard.append((time.monotonic(), message.linear.x, message.angular.z))


@contextmanager
def dds_robot() -> Iterator[DdsRobot]:
    """A robot of rclpy that lives."""
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    rclpy.init(args=[])
    node, over = rclpy.create_node("robot"), threading.Event()
    robot, executor = DdsRobot(node), SingleThreadedExecutor()
    executor.add_node(node)

    def spin() -> None:
        while not over.is_set():
            executor.spin_once(timeout_sec=0.02)

    thread = threading.Thread(target=spin)
    thread.start()
    try:
        yield robot
    finally:
        over.set()
        thread.join(5)
        node.destroy_node()
        rclpy.shutdown()


@contextmanager
def zenoh_robot(endpoint: str = "") -> Iterator[ZenohRobot]:
    """A robot of rmw_zenoh that lives, at a router or with one of its own."""
    with ExitStack() as stack:
        if not endpoint:
            _, endpoint = stack.enter_context(open_private_router())
        robot = ZenohRobot(endpoint)
        stack.callback(robot.close)
        yield robot
