"""The whole robot with the files of `heel security init`: as the page of the guide starts it.

The rules alone are tested in `test_security.py`, in the normal run.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass

import pytest

from heel.services.runtime.router import RouterSettings, open_router
from heel.services.security.folder import SecurityFolder
from tests.support.network import free_port, wait_until
from tests.support.processes import Running, finished, running

pytest.importorskip("cryptography", reason="the extra `secure` is not installed")

SERVICES = {
    # A pace that a busy machine keeps, too.
    "capture": ("scene:demo", "--loop", "--fps", "5"),
    "detector": (),
    "tracker": (),
    "follower": ("--max-tracks-age-s", "2"),
    "drive": ("--driver", "log"),
}
START_S = 60.0


@dataclass
class Robot:
    """What runs, and how to reach it."""

    made: SecurityFolder
    endpoint: str
    runtime: str
    services: dict[str, Running]

    def said(self, name: str, *words: str) -> tuple[int, str, str]:
        """What a command of a member prints, with its exit code before."""
        return finished(
            "-m", "heel", *words, "--config-file", str(self.made.file_of(name)),
            "--connect", self.endpoint, deadline_s=START_S,
            # As from another host: on its own, the same user's stop goes past the router.
            HEEL_RUNTIME_DIR=f"{self.runtime}-{name}",
        )  # fmt: skip


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    root = tmp_path_factory.mktemp("robot")
    made = SecurityFolder.create(root / "keys")
    made.add("ben", "watch")
    runtime = root / "run"
    runtime.mkdir(0o700)
    endpoint = f"tls/127.0.0.1:{free_port()}"
    settings = RouterSettings(config_file=made.file_of("router"), listen=(endpoint,))
    with open_router(settings), ExitStack() as stack:
        services = {
            name: stack.enter_context(running(
                "-m", f"heel.services.{name}", *flags, "--config-file", str(made.file_of(name)),
                "--connect", endpoint, HEEL_RUNTIME_DIR=str(runtime),
            ))
            for name, flags in SERVICES.items()
        }  # fmt: skip
        yield Robot(made, endpoint, str(runtime), services)


def state(robot: Robot, name: str = "operator") -> dict[str, object]:
    # It listens for a moment only: on a busy machine nothing may come in that time.
    _, out, _ = robot.said(name, "status", "--json")
    found: dict[str, object] = json.loads(out or "{}")
    return found


@pytest.mark.slow
@pytest.mark.timeout(240)
def test_a_robot_with_certificates_sees_follows_and_stops(robot: Robot) -> None:
    def follows() -> bool:
        return robot.said("operator", "follow", "nearest")[0] == 0

    wait_until(follows, "somebody to follow", START_S)
    wait_until(lambda: '"following"' in json.dumps(state(robot)), "following", START_S)
    for name, service in robot.services.items():
        assert service.alive, (name, service.stderr())
    # Who only watches sees it, and can neither choose nor stop.
    wait_until(lambda: '"following"' in json.dumps(state(robot, "ben")), "the viewer", START_S)
    assert robot.said("ben", "follow", "nearest")[0] != 0
    robot.said("ben", "stop")
    assert '"estop": true' not in json.dumps(state(robot))
    code, out, err = robot.said("operator", "stop")
    assert code == 0, out + err
    wait_until(lambda: '"stopped"' in json.dumps(state(robot)), "the robot stands", START_S)
