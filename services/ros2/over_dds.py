"""A node by rclpy, over the middleware that the robot's ROS was set up with."""

from __future__ import annotations

import importlib
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from heel.schemas.errors import HeelError
from heel.services.ros2.node import End, Heard, RosNode, publications, subscriptions
from heel.services.ros2.settings import Ros2Settings

_SPIN_S = 0.05
"""Longest wait of the node's thread for a message [s], after which it looks whether to end."""
_BESIDE = ("visualization_msgs", "vision_msgs", "diagnostic_msgs")
"""Packages that are needed only where a topic is named for them."""
_JOIN_S = 2.0
"""Longest wait for that thread to end [s]; chosen by hand."""


class DdsNode(RosNode):
    """Subscriptions and publishers of a robot's topics.

    Raises:
        HeelError: ROS is not there, or its middleware does not start.
    """

    discovery_s = 3.0  # it takes one; chosen by hand

    def __init__(self, settings: Ros2Settings) -> None:
        """Join the robot's ROS."""
        super().__init__(settings)
        wanted = {kind for _, kind in subscriptions(settings).values()}
        self._kinds = {
            kind: _import(kind) for kind in wanted | set(publications(settings).values())
        }
        self._ros = ros = _ros()
        self._context = ros.context.Context()
        self._stop, self._lock, self._heard = threading.Event(), threading.Lock(), Heard()
        try:
            ros.init(
                args=[], context=self._context, domain_id=settings.domain_id,
                signal_handler_options=ros.signals.SignalHandlerOptions.NO,
            )  # fmt: skip
            self._node = ros.create_node(settings.node, context=self._context)
        except Exception as error:
            # rclpy's errors have no common base beside this one.
            raise HeelError(
                f"ROS 2 does not start ({error}): check RMW_IMPLEMENTATION and ROS_DOMAIN_ID"
            ) from error
        self._executor = ros.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        for name, (topic, kind) in subscriptions(settings).items():
            self._node.create_subscription(
                self._kinds[kind], topic, self._taker(name), ros.qos.qos_profile_sensor_data
            )
        volatile = ros.qos.QoSProfile(
            depth=1, reliability=ros.qos.ReliabilityPolicy.RELIABLE,
            durability=ros.qos.DurabilityPolicy.VOLATILE,
        )  # fmt: skip
        self._publishers = {
            topic: self._node.create_publisher(self._kinds[kind], topic, volatile)
            for topic, kind in publications(settings).items()
        }
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)
        self._thread.start()

    def take(self) -> Heard:
        """As `RosNode.take`."""
        with self._lock:
            heard, self._heard = self._heard, Heard()
            self.arrived.clear()
        return heard

    def now_ns(self) -> int:
        """As `RosNode.now_ns`."""
        return int(self._node.get_clock().now().nanoseconds)

    def message(self, kind: str) -> Any:
        """As `RosNode.message`."""
        if kind not in self._kinds:
            self._kinds[kind] = _import(kind)
        return self._kinds[kind]()

    def publish(self, topic: str, message: Any) -> None:
        """As `RosNode.publish`."""
        self._publishers[topic].publish(message)

    def full_name(self, topic: str) -> str:
        """As `RosNode.full_name`."""
        return str(self._node.resolve_topic_name(topic))

    def type_hash(self, kind: str) -> str:
        """As `RosNode.type_hash`: names alone have to be the same."""
        return ""

    def topics(self) -> dict[str, Sequence[str]]:
        """As `RosNode.topics`."""
        return dict(self._node.get_topic_names_and_types())

    def publishers(self, name: str) -> list[End]:
        """As `RosNode.publishers`."""
        return [_end(one) for one in self._node.get_publishers_info_by_topic(name)]

    def subscribers(self, name: str) -> list[End]:
        """As `RosNode.subscribers`."""
        return [_end(one) for one in self._node.get_subscriptions_info_by_topic(name)]

    def leave(self) -> None:
        """As `RosNode.leave`."""
        self._stop.set()
        self._thread.join(_JOIN_S)
        with suppress(Exception):
            self._node.destroy_node()
        with suppress(Exception):
            self._ros.shutdown(context=self._context)

    def _taker(self, name: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            with self._lock:
                if name == "stops":
                    self._heard.stops += int(bool(message.data))
                else:
                    setattr(self._heard, name, message)
                if name == "picture":
                    self._heard.picture_ns = time.monotonic_ns()
            self.arrived.set()

        return take

    def _spin(self) -> None:
        try:
            while not self._stop.is_set():
                self._executor.spin_once(timeout_sec=_SPIN_S)
        except Exception as error:
            # The bridge ends by it: a robot is not driven by somebody that hears nothing of it.
            self.failure = error
            self.arrived.set()


def _end(info: Any) -> End:
    return End(str(info.topic_type), "TRANSIENT_LOCAL" in str(info.qos_profile.durability))


def _ros() -> Any:
    try:
        for part in ("context", "executors", "qos", "signals"):
            importlib.import_module(f"rclpy.{part}")
        return importlib.import_module("rclpy")
    except ImportError as error:
        raise _missing(error) from error


def _import(kind: str) -> Any:
    """The class of a type such as `geometry_msgs/msg/Twist`."""
    package, _, name = kind.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except ImportError as error:
        raise _missing(error) from error


def _missing(error: ImportError) -> HeelError:
    package = str(error.name).partition(".")[0]
    if package in _BESIDE:
        dashed = package.replace("_", "-")
        return HeelError(
            f"{package} is not there ({error}): apt install ros-$ROS_DISTRO-{dashed}, or pip "
            f"install ros-{dashed}; or name no topic for it"
        )
    return HeelError(
        f"ROS 2 is not there ({error}): source the robot's installation "
        "(`. /opt/ros/*/setup.sh`), or pip install ros-rclpy ros-geometry-msgs ros-nav-msgs "
        "ros-sensor-msgs ros-rmw-fastrtps-cpp; a robot of rmw_zenoh needs none: --rmw zenoh"
    )
