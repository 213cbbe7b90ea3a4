"""`python -m heel.services.drive`: the robot's end as a process."""

from __future__ import annotations

from heel.services.runtime import one_blas_thread  # noqa: F401
from heel.services.runtime.interrupts import interrupts_end

with interrupts_end():
    from heel.services.drive.settings import DriveServiceSettings
    from heel.services.runtime.command_line import service_app

if __name__ == "__main__":
    service_app("drive", DriveServiceSettings, "Run the robot's end: commands to wheels.")
