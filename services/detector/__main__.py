"""`python -m services.detector`: the detector process."""

from __future__ import annotations

from services.detector.settings import DetectorServiceSettings
from services.runtime.command_line import service_app

if __name__ == "__main__":
    service_app("detector", DetectorServiceSettings, "Run the detector process.")
