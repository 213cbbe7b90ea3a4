"""`python -m services.follower`: the follower process."""

from __future__ import annotations

from services.follower.settings import FollowerServiceSettings
from services.runtime.command_line import service_app

if __name__ == "__main__":
    service_app("follower", FollowerServiceSettings, "Run the follower process.")
