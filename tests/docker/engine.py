"""A Docker engine and one compose project on it: every call has a deadline, all of it goes away."""

from __future__ import annotations

import json
import os
import secrets
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
ENGINE_SCRIPT = REPOSITORY.parent / "shared" / "tools" / "docker_up.sh"
IMAGE = "heel-follow:test"
DEMO_IMAGE = "heel-follow-demo:test"
SERVICES = ("router", "capture", "detector", "tracker", "follower", "drive", "web")
READER = Path(__file__).with_name("reader.py")


def missing_engine() -> str | None:
    """Why there is no engine, after trying to start one where that is allowed; None if it is up."""
    if _answers():
        return None
    if not (ENGINE_SCRIPT.is_file() and os.geteuid() == 0):
        return "no Docker engine answers"
    # It outlives these tests, and so must not keep its files in their folder.
    kept = {name: value for name, value in os.environ.items() if name != "XDG_RUNTIME_DIR"}
    done = subprocess.run(
        [str(ENGINE_SCRIPT), "up"], capture_output=True, text=True, timeout=240, env=kept
    )
    return None if _answers() else f"no Docker engine, and none could be started: {done.stderr}"


def _answers() -> bool:
    try:
        done = subprocess.run(["docker", "compose", "version"], capture_output=True, timeout=20)
        info = subprocess.run(["docker", "info"], capture_output=True, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0 and info.returncode == 0


class Project:
    """One `docker compose` project with a name, a port and a folder of videos of its own."""

    def __init__(self, videos: Path, **environment: str) -> None:
        self.name = f"heeltest{secrets.token_hex(4)}"
        self.port = free_port()
        self.asked_s = 0.0
        """When `docker compose up` was typed, monotonic seconds."""
        inherited = {key: value for key, value in os.environ.items() if not key.startswith("HEEL_")}
        self.environment = inherited | {"HEEL_MODELS": str(videos)} | environment | {
            "COMPOSE_PROJECT_NAME": self.name, "HEEL_PORT": str(self.port), "HEEL_IMAGE": IMAGE,
            "HEEL_DEMO_IMAGE": DEMO_IMAGE, "HEEL_VIDEOS": str(videos),
        }  # fmt: skip

    def run(self, *command: str, deadline_s: float = 60.0, stdin: str = "") -> str:
        """Standard output of a command that has to succeed."""
        done = subprocess.run(
            command, cwd=REPOSITORY, env=self.environment, capture_output=True, text=True,
            input=stdin, timeout=deadline_s, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{' '.join(command)}:\n{done.stdout}\n{done.stderr}"
        return done.stdout

    def compose(self, *arguments: str, deadline_s: float = 60.0, stdin: str = "") -> str:
        """`docker compose ARGUMENTS`."""
        return self.run("docker", "compose", *arguments, deadline_s=deadline_s, stdin=stdin)

    def up(self) -> None:
        """Start everything; nothing is fetched and nothing built."""
        self.asked_s = time.monotonic()
        self.compose("up", "-d", "--pull", "never", "--no-build")

    def down(self) -> float:
        """Stop and remove everything; seconds that took."""
        started_s = time.monotonic()
        self.compose("down", "-v")
        return time.monotonic() - started_s

    def container(self, service: str) -> str:
        """Id of a service's container."""
        return self.compose("ps", "-a", "-q", service).strip()

    def inspect(self, service: str) -> dict[str, Any]:
        """What the engine knows of a service's container."""
        found: list[dict[str, Any]] = json.loads(
            self.run("docker", "inspect", self.container(service))
        )
        return found[0]

    def health(self, service: str) -> str:
        """`starting`, `healthy` or `unhealthy`."""
        return str(self.inspect(service)["State"]["Health"]["Status"])

    def read(self, seconds: float = 2.0, tracks: int = 20, deadline_s: float = 20.0) -> Reading:
        """Listen inside the tracker's container until so many tracks messages came."""
        said = self.compose(
            "exec", "-T", "tracker", "python3", "-", str(seconds), str(tracks), str(deadline_s),
            deadline_s=deadline_s + 10.0, stdin=READER.read_text(encoding="utf-8"),
        )  # fmt: skip
        return Reading(json.loads(said))

    def page(self, path: str) -> bytes:
        """GET from the published port."""
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}{path}", timeout=5) as answer:
            content: bytes = answer.read()
        return content

    def status(self, *flags: str) -> tuple[int, str]:
        """Exit code and output of `heel status` on this machine."""
        done = subprocess.run(
            [sys.executable, "-m", "heel", "status", *flags], cwd=REPOSITORY,
            env=self.environment, capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        return done.returncode, done.stdout + done.stderr

    def left_behind(self) -> list[str]:
        """Containers, volumes and networks of this project that still exist."""
        label = f"label=com.docker.compose.project={self.name}"
        kinds = (("ps", "-a", "-q"), ("volume", "ls", "-q"), ("network", "ls", "-q"))
        return [
            line
            for kind in kinds
            for line in self.run("docker", *kind, "--filter", label).split()
        ]  # fmt: skip


class Reading:
    """What a reader in a container saw."""

    def __init__(self, said: dict[str, Any]) -> None:
        self.tracks: int = said["tracks"]
        self.people: int = said["people"]
        self.size: list[int] = said["size"]
        self.producer: str = said["producer"]
        self.waited_s: float = said["waited_s"]
        self.health: dict[str, dict[str, Any]] = said["health"]

    def by_shared_memory(self) -> dict[str, bool | None]:
        """For every service that receives large messages, whether they came by shared memory."""
        receivers = ("detector", "tracker", "web")
        return {name: self.health.get(name, {}).get("shared_memory") for name in receivers}


def free_port() -> int:
    """A loopback port at which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port
