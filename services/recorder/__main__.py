"""`python -m heel.services.recorder`: the recorder process."""

from __future__ import annotations

from heel.services.runtime import one_blas_thread  # noqa: F401
from heel.services.runtime.interrupts import interrupts_end

with interrupts_end():
    from heel.services.recorder.settings import RecorderSettings
    from heel.services.runtime.command_line import service_app

if __name__ == "__main__":
    service_app("recorder", RecorderSettings, "Run the recorder process.")
