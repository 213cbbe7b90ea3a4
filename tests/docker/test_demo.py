"""`docker compose --profile demo up`: a simulated robot on the page, and no camera."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from benchmarks.compose_start import first_person_s
from tests.docker.engine import Project
from tests.docker.test_docs import blocks

pytestmark = [pytest.mark.docker, pytest.mark.timeout(360)]

START_S = 60.0


def test_the_profile_shows_a_robot_in_a_world_of_its_own(demo_image: str, tmp_path: Path) -> None:
    _, demo, *_ = blocks("sh")
    build, up, down = demo.splitlines()
    assert build == "docker compose --profile demo build"
    project = Project(tmp_path)
    try:
        started_s = time.monotonic()
        project.run("bash", "-c", up)
        first_person_s(f"http://127.0.0.1:{project.port}", START_S)
        print(f"first person {time.monotonic() - started_s:.1f} s after {up}")
        running = project.compose("--profile", "demo", "ps", "--services").split()
        assert {"world", "world-drive"} <= set(running)
        assert not {"capture", "drive"} & set(running), "there is one camera and one drive"
        state = json.loads(project.page("/api/state"))
        assert not state["problems"]
        project.run("bash", "-c", down)
        assert project.left_behind() == []
    finally:
        project.compose("--profile", "demo", "down", "-v")
