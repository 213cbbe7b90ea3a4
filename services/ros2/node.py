"""The ROS side: one rclpy node that keeps the newest of what the robot says, and sends velocities.

Nothing is latched: velocities go out volatile, and the last ones of a process are zero.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Self

from heel.schemas.errors import HeelError
from heel.services.ros2 import outputs
from heel.services.ros2.convert import PartStatus, PersonThere
from heel.services.ros2.settings import Ros2Settings

_SPIN_S = 0.05
"""Longest wait of the node's thread for a message [s], after which it looks whether to end."""
_JOIN_S = 2.0
"""Longest wait for that thread to end [s]; chosen by hand."""
_GOODBYES = 3
"""Zero velocities that are sent at the end, as one may be lost."""
_GOODBYE_S = 0.02
"""Time between them [s]: a period of 50 Hz."""


@dataclass
class Heard:
    """The newest of each kind since it was taken; emergency stops are kept until they are."""

    picture: Any = None
    picture_ns: int = 0
    depth: Any = None
    info: Any = None
    scan: Any = None
    odometry: Any = None
    stops: int = 0
    counts: dict[str, int] = field(default_factory=dict)


class RosNode:
    """Subscriptions and publishers of a robot's topics.

    Raises:
        HeelError: ROS is not there, or its middleware does not start.
    """

    def __init__(self, settings: Ros2Settings, clock_ns: Callable[[], int]) -> None:
        """Join the robot's ROS.

        Args:
            settings: the topics.
            clock_ns: monotonic, notes when a picture came.
        """
        self._ros = ros = _import()
        self._settings, self._clock_ns = settings, clock_ns
        self._context = ros.context.Context()
        self._stop, self.arrived = threading.Event(), threading.Event()
        self._lock, self._heard = threading.Lock(), Heard()
        self.failure: Exception | None = None
        try:
            ros.init(
                args=[], context=self._context, domain_id=settings.domain_id,
                signal_handler_options=ros.signals.SignalHandlerOptions.NO,
            )  # fmt: skip
            self.node = ros.create_node(settings.node, context=self._context)
        except Exception as error:
            # rclpy's errors have no common base beside this one.
            raise HeelError(
                f"ROS 2 does not start ({error}): check RMW_IMPLEMENTATION and ROS_DOMAIN_ID"
            ) from error
        self._executor = ros.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._subscribe()
        self._command = self._publisher(settings.command_topic, self._command_type())
        self._outputs = {
            name: self._publisher(output.topic, output.kind())
            for name, output in outputs.outputs_of(settings).items()
        }
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        """Send zero velocities, whatever happened, and leave ROS."""
        for _ in range(_GOODBYES):
            with suppress(Exception):
                self.send(0.0, 0.0)
            self._stop.wait(_GOODBYE_S)
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(_JOIN_S)
        with suppress(Exception):
            self.node.destroy_node()
        with suppress(Exception):
            self._ros.shutdown(context=self._context)

    def take(self) -> Heard:
        """What came since the last call."""
        with self._lock:
            heard, self._heard = self._heard, Heard()
            self.arrived.clear()
        return heard

    def now_ns(self) -> int:
        """Time of the robot's clock, which its stamps are of."""
        return int(self.node.get_clock().now().nanoseconds)

    def send(self, linear_mps: float, angular_radps: float) -> None:
        """Send a velocity."""
        message = self._command_type()()
        twist = message.twist if self._settings.command_stamped else message
        twist.linear.x, twist.angular.z = linear_mps, angular_radps
        if self._settings.command_stamped:
            message.header.stamp = self.node.get_clock().now().to_msg()
            message.header.frame_id = self._settings.command_frame
        self._command.publish(message)

    def send_target(self, x_m: float, y_m: float) -> None:
        """Say where the target is, from the robot: x ahead, y left."""
        if "target" not in self._outputs:
            return
        from geometry_msgs.msg import PoseStamped

        message = PoseStamped()
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.header.frame_id = self._settings.command_frame
        message.pose.position.x, message.pose.position.y = x_m, y_m
        message.pose.orientation.w = 1.0
        self._outputs["target"].publish(message)

    def send_people(self, people: Sequence[PersonThere], picture: Any) -> None:
        """Say where people are.

        Args:
            people: of a frame.
            picture: std_msgs/Header of the frame's picture; None: it did not come from ROS.
        """
        from std_msgs.msg import Header

        header = picture or Header(stamp=self.node.get_clock().now().to_msg())
        if "people" in self._outputs:
            told = outputs.markers(people, header.stamp, self._settings.command_frame)
            self._outputs["people"].publish(told)
        if "detections" in self._outputs:
            self._outputs["detections"].publish(outputs.detections(people, header))

    def send_diagnostics(self, parts: Sequence[PartStatus], robot: str) -> None:
        """Say how every part is; `robot` is its name."""
        stamp = self.node.get_clock().now().to_msg()
        self._outputs["diagnostics"].publish(outputs.diagnostics(parts, stamp, robot))

    def _command_type(self) -> Any:
        from geometry_msgs.msg import Twist, TwistStamped

        return TwistStamped if self._settings.command_stamped else Twist

    def _publisher(self, topic: str, kind: Any) -> Any:
        qos = self._ros.qos
        volatile = qos.QoSProfile(
            depth=1, reliability=qos.ReliabilityPolicy.RELIABLE,
            durability=qos.DurabilityPolicy.VOLATILE,
        )  # fmt: skip
        return self.node.create_publisher(kind, topic, volatile)

    def _subscribe(self) -> None:
        for name, (topic, kind) in topics_of(self._settings).items():
            self.node.create_subscription(
                kind, topic, self._taker(name), self._ros.qos.qos_profile_sensor_data
            )

    def _taker(self, name: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            with self._lock:
                if name == "stops":
                    self._heard.stops += int(bool(message.data))
                else:
                    setattr(self._heard, name, message)
                if name == "picture":
                    self._heard.picture_ns = self._clock_ns()
                self._heard.counts[name] = self._heard.counts.get(name, 0) + 1
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


def topics_of(settings: Ros2Settings) -> dict[str, tuple[str, Any]]:
    """What is subscribed: topic and type, by the field of `Heard`."""
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import CameraInfo, CompressedImage, Image, LaserScan
    from std_msgs.msg import Bool

    compressed = settings.image_topic.rstrip("/").endswith("/compressed")
    wanted = {
        "picture": (settings.image_topic, CompressedImage if compressed else Image),
        "depth": (settings.depth_topic, Image),
        "info": (settings.camera_info_topic, CameraInfo),
        "scan": (settings.scan_topic, LaserScan),
        "odometry": (settings.odometry_topic, Odometry),
        "stops": (settings.estop_topic, Bool),
    }
    return {name: (topic, kind) for name, (topic, kind) in wanted.items() if topic}


def _import() -> Any:
    try:
        import rclpy
        import rclpy.context
        import rclpy.executors
        import rclpy.qos
        import rclpy.signals
        from geometry_msgs.msg import Twist
        from nav_msgs.msg import Odometry
        from sensor_msgs.msg import Image
        from std_msgs.msg import Bool
    except ImportError as error:
        raise HeelError(
            f"ROS 2 is not there ({error}): source the robot's installation "
            "(`. /opt/ros/*/setup.sh`), or pip install ros-rclpy ros-geometry-msgs ros-nav-msgs "
            "ros-sensor-msgs ros-rmw-fastrtps-cpp"
        ) from error
    del Twist, Odometry, Image, Bool
    return rclpy
