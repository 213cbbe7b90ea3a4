"""What ROS is told beside velocities: people and health, whatever makes the messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

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


Make = Callable[[str], Any]
"""An empty message of a type such as `geometry_msgs/msg/Twist`."""


def outputs_of(settings: Ros2Settings) -> dict[str, tuple[str, str]]:
    """What is told beside velocities: topic and type, by a name of our own."""
    wanted = {
        "target": (settings.target_topic, "geometry_msgs/msg/PoseStamped"),
        "people": (settings.people_topic, "visualization_msgs/msg/MarkerArray"),
        "detections": (settings.detections_topic, "vision_msgs/msg/Detection2DArray"),
        "diagnostics": (settings.diagnostics_topic, "diagnostic_msgs/msg/DiagnosticArray"),
    }
    return {name: (topic, kind) for name, (topic, kind) in wanted.items() if topic}


def markers(make: Make, people: Sequence[PersonThere], stamp: Any, frame: str) -> Any:
    """visualization_msgs/MarkerArray: a cylinder and an id where each person stands.

    Args:
        make: of messages.
        people: those whose distance is known are drawn.
        stamp: builtin_interfaces/Time of the picture.
        frame: of the robot.
    """
    made = make("visualization_msgs/msg/MarkerArray")
    for person in people:
        if person.x_m is None or person.y_m is None:
            continue
        body, words = (make("visualization_msgs/msg/Marker") for _ in range(2))
        for marker in (body, words):
            marker.header.stamp, marker.header.frame_id = stamp, frame
            marker.id, marker.action = person.id, marker.ADD
            marker.lifetime.sec, marker.lifetime.nanosec = 0, _LIFETIME_NS
            marker.pose.position.x, marker.pose.position.y = person.x_m, person.y_m
            marker.pose.orientation.w = 1.0
            marker.color.r, marker.color.g, marker.color.b = colour_of(person.id)
            marker.color.a = 1.0
        body.ns, body.type = "people", body.CYLINDER
        body.scale.x, body.scale.y, body.scale.z = _WIDE_M, _WIDE_M, _TALL_M
        body.pose.position.z = _TALL_M / 2
        body.color.a = _CHOSEN_ALPHA if person.chosen else _OTHERS_ALPHA
        words.ns, words.type = "ids", words.TEXT_VIEW_FACING
        words.scale.z, words.pose.position.z = _LETTERS_M, _TALL_M + _LETTERS_M
        words.text = f"{person.id} (target)" if person.chosen else f"{person.id}"
        made.markers += [body, words]
    return made


def detections(make: Make, people: Sequence[PersonThere], header: Any) -> Any:
    """vision_msgs/Detection2DArray (4.x): the boxes in the picture, by id.

    Args:
        make: of messages.
        people: of the frame.
        header: std_msgs/Header of its picture.
    """
    made = make("vision_msgs/msg/Detection2DArray")
    made.header = header
    for person in people:
        left, top, right, bottom = person.box_xyxy
        found = make("vision_msgs/msg/Detection2D")
        guess = make("vision_msgs/msg/ObjectHypothesisWithPose")
        found.header, found.id = header, str(person.id)
        found.bbox.center.position.x = (left + right) / 2
        found.bbox.center.position.y = (top + bottom) / 2
        found.bbox.size_x, found.bbox.size_y = right - left, bottom - top
        guess.hypothesis.class_id = "target" if person.chosen else "person"
        guess.hypothesis.score = person.confidence
        found.results = [guess]
        made.detections += [found]
    return made


def diagnostics(make: Make, parts: Sequence[PartStatus], stamp: Any, robot: str) -> Any:
    """diagnostic_msgs/DiagnosticArray of what every part says of itself.

    Args:
        make: of messages.
        parts: one entry each.
        stamp: builtin_interfaces/Time of now.
        robot: its name, as hardware id.
    """
    made = make("diagnostic_msgs/msg/DiagnosticArray")
    made.header.stamp = stamp
    for part in parts:
        status = make("diagnostic_msgs/msg/DiagnosticStatus")
        # A byte of ROS, which rclpy has as bytes and other libraries as a number.
        status.level = bytes([part.level]) if isinstance(status.level, bytes) else part.level
        status.name, status.message = part.name, part.message
        status.hardware_id = robot
        for key, value in part.values.items():
            pair = make("diagnostic_msgs/msg/KeyValue")
            pair.key, pair.value = key, value
            status.values.append(pair)
        made.status += [status]
    return made
