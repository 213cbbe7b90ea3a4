"""`python -m heel.services.runtime.probe ENDPOINT`: whether a router lets clients in, by exit code.

For health checks: a whole handshake, because a router that hangs still has its port open. Imports
nothing but Zenoh, which makes it 25 ms of processor time instead of 600 ms.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import zenoh


def main(endpoint: str) -> int:
    """Connect and leave again; 0 if that works."""
    config = zenoh.Config()
    entries: list[tuple[str, object]] = [
        ("mode", "client"),
        ("connect/endpoints", [endpoint]),
        ("scouting/multicast/enabled", False),
        ("transport/shared_memory/enabled", False),
    ]
    if (user := os.environ.get("HEEL_ZENOH__USER")) is not None:
        password = os.environ.get("HEEL_ZENOH__PASSWORD", "")
        if (file := os.environ.get("HEEL_ZENOH__PASSWORD_FILE")) is not None:
            password = Path(file).read_text(encoding="utf-8").strip()
        entries += [
            ("transport/auth/usrpwd/user", user),
            ("transport/auth/usrpwd/password", password),
        ]
    for path, value in entries:
        config.insert_json5(path, json.dumps(value))
    try:
        with zenoh.open(config):
            return 0
    except zenoh.ZError as error:
        sys.stderr.write(f"heel: {endpoint}: {' '.join(str(error).split())[:300]}\n")
        return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
