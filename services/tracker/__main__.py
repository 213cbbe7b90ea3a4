"""`python -m heel.services.tracker`: the tracker process."""

from __future__ import annotations

from heel.services.runtime import one_blas_thread  # noqa: F401
from heel.services.runtime.interrupts import interrupts_end

with interrupts_end():
    from heel.services.runtime.command_line import service_app
    from heel.services.tracker.settings import TrackerServiceSettings

if __name__ == "__main__":
    service_app("tracker", TrackerServiceSettings, "Run the tracker process.")
