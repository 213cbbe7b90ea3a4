"""Every kind of message that the bridge to ROS sends or hears, whatever its settings."""

from __future__ import annotations

from heel.services.ros2.node import publications, subscriptions
from heel.services.ros2.settings import Ros2Settings

KINDS = sorted({
    kind
    for image in ("image", "image/compressed")
    for stamped in (False, True)
    for s in [Ros2Settings(image_topic=image, estop_topic="estop", command_stamped=stamped,
                           target_topic="target", people_topic="people",
                           diagnostics_topic="diagnostics")]
    for kind in [*publications(s).values(), *(kind for _, kind in subscriptions(s).values())]
})  # fmt: skip
