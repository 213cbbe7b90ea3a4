"""From `docker compose up` to the first person on the page, with the images built.

    docker compose --profile robot --profile demo build
    python -m benchmarks.compose_start --profile robot,demo --runs 3

Each run is a project of its own on a free port of loopback, and all of it goes away again.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import secrets
import socket
import subprocess
import time
from pathlib import Path

import aiohttp

_REPOSITORY = Path(__file__).resolve().parents[1]
_DEADLINE_S = 120.0
_RETRY_S = 0.1


def first_person_s(url: str, deadline_s: float = _DEADLINE_S) -> float:
    """Seconds until a picture with a person in it came by the page's WebSocket.

    Raises:
        TimeoutError: none did.
    """
    started_s = time.monotonic()
    asyncio.run(asyncio.wait_for(_first_person(url), deadline_s))
    return time.monotonic() - started_s


async def _first_person(url: str) -> None:
    async with aiohttp.ClientSession() as session:
        while True:
            try:
                async with session.ws_connect(f"{url}/ws") as viewer:
                    if await _shows_person(viewer):
                        return
            except aiohttp.ClientError:
                pass  # The page is not served yet.
            await asyncio.sleep(_RETRY_S)


async def _shows_person(viewer: aiohttp.ClientWebSocketResponse) -> bool:
    """Look at pictures until one has a person in it; False if the connection ends first."""
    async for message in viewer:
        if message.type is aiohttp.WSMsgType.BINARY:
            length = int.from_bytes(message.data[:4], "big")
            header = json.loads(message.data[4 : 4 + length])
            await viewer.send_str(json.dumps({"ack": header["number"]}))
            if header["tracks"]:
                return True
    return False


def run(profile: str) -> float:
    """Seconds from the typed command to the first person, in a project of its own."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    environment = os.environ | {
        "COMPOSE_PROJECT_NAME": f"heelstart{secrets.token_hex(4)}", "HEEL_PORT": str(port),
    }  # fmt: skip
    compose = ["docker", "compose", "--profile", profile]
    started_s = time.monotonic()
    try:
        subprocess.run(
            [*compose, "up", "-d", "--pull", "never", "--no-build", "--quiet-pull"],
            cwd=_REPOSITORY, env=environment, check=True, capture_output=True,
            timeout=_DEADLINE_S,
        )  # fmt: skip
        first_person_s(f"http://127.0.0.1:{port}")
        return time.monotonic() - started_s
    finally:
        subprocess.run([*compose, "down", "-v"], cwd=_REPOSITORY, env=environment, check=False,
                       capture_output=True, timeout=_DEADLINE_S)  # fmt: skip


def main() -> None:
    """Print one line a profile."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--profile", default="robot,demo", help="comma separated")
    parser.add_argument("--runs", type=int, default=3)
    arguments = parser.parse_args()
    for profile in arguments.profile.split(","):
        took_s = [run(profile) for _ in range(arguments.runs)]
        print(f"{profile}: first person on the page after "
              f"{', '.join(f'{one:.1f}' for one in took_s)} s", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
