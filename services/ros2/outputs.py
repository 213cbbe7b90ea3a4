"""What ROS is told of people and of health, as messages of the robot's own installation.

The packages of these messages are asked for only where a topic is named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from heel.schemas.errors import HeelError
from heel.services.colours import colour_of
from heel.services.ros2.convert import PartStatus, PersonThere
from heel.services.ros2.settings import Ros2Settings

_LIFETIME_NS = 500_000_000
"""Markers of people who are told of no more vanish after this [ns]; chosen by hand: some frames."""
_TALL_M = 1.7
"""Height of the drawn cylinder: an adult's, as the follower assumes."""
_WIDE_M = 0.5
"""Its diameter: an adult's shoulders."""
_LETTERS_M = 0.25
"""Height of the letters above it; chosen by hand."""
_CHOSEN_ALPHA = 0.9
"""Opacity of the person to be followed; chosen by hand."""
_OTHERS_ALPHA = 0.4
"""Opacity of all others; chosen by hand."""


@dataclass(frozen=True)
class Output:
    """A topic that something is told on: its message, and whose package that is of."""

    topic: str
    package: str
    message: str

    def kind(self) -> Any:
        """The class of its messages.

        Raises:
            HeelError: the package is not installed.
        """
        return getattr(messages(self.package), self.message)


def outputs_of(settings: Ros2Settings) -> dict[str, Output]:
    """What is told beside velocities, by a name of our own."""
    wanted = {
        "target": Output(settings.target_topic, "geometry_msgs", "PoseStamped"),
        "people": Output(settings.people_topic, "visualization_msgs", "MarkerArray"),
        "detections": Output(settings.detections_topic, "vision_msgs", "Detection2DArray"),
        "diagnostics": Output(settings.diagnostics_topic, "diagnostic_msgs", "DiagnosticArray"),
    }
    return {name: output for name, output in wanted.items() if output.topic}


def messages(package: str) -> Any:
    """The messages of a ROS package.

    Raises:
        HeelError: it is not installed.
    """
    try:
        return import_module(f"{package}.msg")
    except ImportError as error:
        dashed = package.replace("_", "-")
        raise HeelError(
            f"{package} is not there ({error}): apt install ros-$ROS_DISTRO-{dashed}, or pip "
            f"install ros-{dashed}; or name no topic for it"
        ) from error


def markers(people: Sequence[PersonThere], stamp: Any, frame: str) -> Any:
    """visualization_msgs/MarkerArray: a cylinder and an id where each person stands.

    Args:
        people: those whose distance is known are drawn.
        stamp: builtin_interfaces/Time of the picture.
        frame: of the robot.
    """
    kinds = messages("visualization_msgs")
    made = kinds.MarkerArray()
    for person in people:
        if person.x_m is None or person.y_m is None:
            continue
        body, words = kinds.Marker(), kinds.Marker()
        for marker in (body, words):
            marker.header.stamp, marker.header.frame_id = stamp, frame
            marker.id, marker.action = person.id, kinds.Marker.ADD
            marker.lifetime.sec, marker.lifetime.nanosec = 0, _LIFETIME_NS
            marker.pose.position.x, marker.pose.position.y = person.x_m, person.y_m
            marker.pose.orientation.w = 1.0
            marker.color.r, marker.color.g, marker.color.b = colour_of(person.id)
            marker.color.a = 1.0
        body.ns, body.type = "people", kinds.Marker.CYLINDER
        body.scale.x, body.scale.y, body.scale.z = _WIDE_M, _WIDE_M, _TALL_M
        body.pose.position.z = _TALL_M / 2
        body.color.a = _CHOSEN_ALPHA if person.chosen else _OTHERS_ALPHA
        words.ns, words.type = "ids", kinds.Marker.TEXT_VIEW_FACING
        words.scale.z, words.pose.position.z = _LETTERS_M, _TALL_M + _LETTERS_M
        words.text = f"{person.id} (target)" if person.chosen else f"{person.id}"
        made.markers += [body, words]
    return made


def detections(people: Sequence[PersonThere], header: Any) -> Any:
    """vision_msgs/Detection2DArray (4.x): the boxes in the picture, by id.

    Args:
        people: of the frame.
        header: std_msgs/Header of its picture.
    """
    kinds = messages("vision_msgs")
    made = kinds.Detection2DArray()
    made.header = header
    for person in people:
        left, top, right, bottom = person.box_xyxy
        found, guess = kinds.Detection2D(), kinds.ObjectHypothesisWithPose()
        found.header, found.id = header, str(person.id)
        found.bbox.center.position.x = (left + right) / 2
        found.bbox.center.position.y = (top + bottom) / 2
        found.bbox.size_x, found.bbox.size_y = right - left, bottom - top
        guess.hypothesis.class_id = "target" if person.chosen else "person"
        guess.hypothesis.score = person.confidence
        found.results = [guess]
        made.detections += [found]
    return made


def diagnostics(parts: Sequence[PartStatus], stamp: Any, robot: str) -> Any:
    """diagnostic_msgs/DiagnosticArray of what every part says of itself.

    Args:
        parts: one entry each.
        stamp: builtin_interfaces/Time of now.
        robot: its name, as hardware id.
    """
    kinds = messages("diagnostic_msgs")
    made = kinds.DiagnosticArray()
    made.header.stamp = stamp
    for part in parts:
        status = kinds.DiagnosticStatus()
        status.level, status.name, status.message = bytes([part.level]), part.name, part.message
        status.hardware_id = robot
        status.values = [kinds.KeyValue(key=key, value=value) for key, value in part.values.items()]
        made.status += [status]
    return made
