"""`python -m heel.services.follower`: the follower process."""

from __future__ import annotations

from heel.services.runtime import one_blas_thread  # noqa: F401
from heel.services.runtime.interrupts import interrupts_end

with interrupts_end():
    from heel.services.follower.settings import FollowerServiceSettings
    from heel.services.runtime.command_line import service_app

if __name__ == "__main__":
    service_app("follower", FollowerServiceSettings, "Run the follower process.")
