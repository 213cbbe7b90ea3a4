"""`python -m heel.services.runtime.probe ENDPOINT`: whether a router lets clients in, by exit code.

For health checks: a whole handshake, because a router that hangs still has its port open. Imports
nothing but Zenoh, which makes it 25 ms of processor time instead of 600 ms. Of a router that asks
for certificates it is the handshake of TLS alone: the check is no member and needs no key.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import zenoh

_GREETING_S = 2.0
"""Longest wait for the router's part of the handshake [s]; it takes milliseconds."""


def main(endpoint: str) -> int:
    """Connect and leave again; 0 if that works."""
    if endpoint.startswith("tls/"):
        return _greet(endpoint)
    config = zenoh.Config()
    entries: list[tuple[str, object]] = [
        ("mode", "client"),
        ("connect/endpoints", [endpoint]),
        ("scouting/multicast/enabled", False),
        ("transport/unicast/open_timeout", int(1e3 * _GREETING_S)),
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


def _greet(endpoint: str) -> int:
    import socket
    import ssl

    host, _, port = endpoint.removeprefix("tls/").rpartition(":")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    # Whether it answers is asked, not who it is: nothing is sent.
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    try:
        with socket.create_connection((host.strip("[]"), int(port)), _GREETING_S) as line:
            with context.wrap_socket(line):
                return 0
    except OSError as error:
        sys.stderr.write(f"heel: {endpoint}: {error}\n")
        return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
