"""Which transport a bridge takes."""

from __future__ import annotations

from heel.services.ros2.node import RosNode
from heel.services.ros2.settings import Ros2Settings


def joined(settings: Ros2Settings) -> RosNode:
    """A node in the robot's ROS, over the transport of the settings.

    Raises:
        HeelError: it cannot be joined; says what to do.
    """
    # Each brings libraries that the other does without.
    if settings.rmw == "zenoh":
        from heel.services.ros2.over_zenoh import ZenohNode

        return ZenohNode(settings)
    from heel.services.ros2.over_dds import DdsNode

    return DdsNode(settings)
