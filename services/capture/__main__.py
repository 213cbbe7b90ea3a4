"""`python -m services.capture`: the capture process."""

from __future__ import annotations

from services.capture.settings import CaptureSettings
from services.runtime.command_line import service_app

if __name__ == "__main__":
    service_app("capture", CaptureSettings, "Run the capture process.")
