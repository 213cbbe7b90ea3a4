"""`python -m services.tracker`: the tracker process."""

from __future__ import annotations

from services.runtime.command_line import service_app
from services.tracker.settings import TrackerServiceSettings

if __name__ == "__main__":
    service_app("tracker", TrackerServiceSettings, "Run the tracker process.")
