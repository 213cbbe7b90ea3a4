"""`python -m services.simulator`: the simulator process."""

from __future__ import annotations

from services.runtime.command_line import service_app
from services.simulator.settings import SimulatorSettings

if __name__ == "__main__":
    service_app("simulator", SimulatorSettings, "Run the simulator process.")
