"""From `docker compose up` to the first person on the page, with the images built.

    docker compose --profile robot --profile demo build
    python -m benchmarks.compose_start --profile robot,demo --runs 3

Each run is a project of its own on a free port of loopback, and all of it goes away again.
"""

from __future__ import annotations

import asyncio
import json
import os
import secrets
import shutil
import socket
import subprocess
import time
from typing import Annotated

import aiohttp
import typer

from benchmarks.common import REPOSITORY
from heel.schemas.errors import HeelError
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)

_DEADLINE_S = 120.0
_RETRY_S = 0.1


def first_person_s(url: str, deadline_s: float = _DEADLINE_S) -> float:
    """Seconds until a picture with a person in it came by the page's WebSocket.

    Raises:
        HeelError: none did.
    """
    started_s = time.monotonic()
    try:
        asyncio.run(asyncio.wait_for(_first_person(url), deadline_s))
    except TimeoutError:
        raise HeelError(f"{url}: nobody on the page within {deadline_s:.0f} s") from None
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
    """Seconds from the typed command to the first person, in a project of its own.

    Raises:
        HeelError: there is no engine or no image, or nobody comes on the page.
    """
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    environment = os.environ | {
        "COMPOSE_PROJECT_NAME": f"heelstart{secrets.token_hex(4)}", "HEEL_PORT": str(port),
    }  # fmt: skip
    compose = ["docker", "compose", "--profile", profile]
    started_s = time.monotonic()
    try:
        up = subprocess.run(
            [*compose, "up", "-d", "--pull", "never", "--no-build", "--quiet-pull"],
            cwd=REPOSITORY, env=environment, check=False, capture_output=True, text=True,
            timeout=_DEADLINE_S,
        )  # fmt: skip
        if up.returncode:
            raise HeelError(
                f"docker compose up: {up.stderr.strip()[-300:]}; build the images first: "
                "docker compose --profile robot --profile demo build"
            )
        first_person_s(f"http://127.0.0.1:{port}")
        return time.monotonic() - started_s
    finally:
        subprocess.run([*compose, "down", "-v"], cwd=REPOSITORY, env=environment, check=False,
                       capture_output=True, timeout=_DEADLINE_S)  # fmt: skip


@app.command()
def main(
    profile: Annotated[str, typer.Option(help="comma separated")] = "robot,demo",
    runs: Annotated[int, typer.Option(min=1, help="of each profile")] = 3,
) -> None:
    """Print one line a profile."""
    if shutil.which("docker") is None:
        raise HeelError("no docker here: install the engine and its compose plugin")
    for name in profile.split(","):
        took_s = ", ".join(f"{run(name):.1f}" for _ in range(runs))
        typer.echo(f"{name}: first person on the page after {took_s} s")


if __name__ == "__main__":
    run_app(app)
