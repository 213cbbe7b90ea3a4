"""`python -m heel.services.simulator`: the simulator process."""

from __future__ import annotations

from heel.services.runtime import one_blas_thread  # noqa: F401
from heel.services.runtime.interrupts import interrupts_end

with interrupts_end():
    from heel.services.runtime.command_line import service_app
    from heel.services.simulator.settings import SimulatorSettings

if __name__ == "__main__":
    service_app("simulator", SimulatorSettings, "Run the simulator process.")
