"""`python -m heel.services.ros2`: the bridge to ROS 2 as a process."""

from __future__ import annotations

from heel.services.runtime import one_blas_thread  # noqa: F401
from heel.services.runtime.interrupts import interrupts_end

with interrupts_end():
    from heel.services.ros2.settings import Ros2Settings
    from heel.services.runtime.command_line import service_app

if __name__ == "__main__":
    service_app("ros2", Ros2Settings, "Bridge a robot's ROS 2 topics to Heel.")
