"""Every command of docs/guides/docker.md, typed as it stands there."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.common import data_folder
from heel.services.models.catalogue import KNOWN
from tests.docker.engine import REPOSITORY, Project

pytestmark = [pytest.mark.docker, pytest.mark.timeout(360)]

PAGE = (REPOSITORY / "docs" / "guides" / "docker.md").read_text(encoding="utf-8")
WIDTH_PX, HEIGHT_PX = 352, 288


def blocks(language: str) -> list[str]:
    """The fenced blocks of one language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def videos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the file that the page speaks of: a rectangle walks through noise."""
    folder = tmp_path_factory.mktemp("videos")
    # Docker's user is another one, and pytest's folders are private.
    folder.chmod(0o755)
    background = np.random.default_rng(1).integers(60, 120, (HEIGHT_PX, WIDTH_PX, 3), np.uint8)
    fourcc = cv2.VideoWriter.fourcc(*"MJPG")
    writer = cv2.VideoWriter(str(folder / "walk.avi"), fourcc, 25.0, (WIDTH_PX, HEIGHT_PX))
    for index in range(150):
        frame = background.copy()
        left = 20 + 2 * max(0, index - 20)
        cv2.rectangle(frame, (left, 90), (left + 40, 210), (200, 30, 30), -1)
        writer.write(frame)
    writer.release()
    return folder


def test_the_commands_do_what_the_page_says(image: str, videos: Path) -> None:
    project = Project(videos)
    first, _, second, _, _ = blocks("sh")
    try:
        said = _typed(project, first)
        assert "tracker/main" in said
        assert "health: starting -> ok" in said
        assert project.left_behind() == []
        up, logs, down = second.splitlines()
        project.run("bash", "-c", up)
        reading = project.read(seconds=4.0, tracks=60)
        assert reading.size == [WIDTH_PX, HEIGHT_PX]
        assert "walk.avi" in _typed(project, logs)
        _typed(project, down)
        assert project.left_behind() == []
    finally:
        project.down()


def test_a_network_in_the_folder_is_used(image: str, tmp_path: Path) -> None:
    known = KNOWN["yolox-nano"].file
    if not (data_folder() / "models" / known).is_file():
        pytest.skip("yolox-nano is not in the models of HEEL_DATA")
    _, _, _, network, _ = blocks("sh")
    get, up, logs, down = network.splitlines()
    assert get == "HEEL_MODELS=./models heel models get yolox-nano"
    tmp_path.chmod(0o755)
    shutil.copy(data_folder() / "models" / known, tmp_path)
    project = Project(tmp_path, HEEL_MODELS=str(tmp_path))
    try:
        project.run("bash", "-c", up)
        project.read(tracks=20)
        assert f"network /models/{known}" in project.run("bash", "-c", logs)
        project.run("bash", "-c", down)
    finally:
        project.down()


def _typed(project: Project, commands: str) -> str:
    """Output of a block, except that `status` and `logs` follow once the services are up."""
    before, marker, after = commands.partition("docker compose ps")
    said = project.run("bash", "-ec", before, deadline_s=240.0)
    if marker:
        project.read(tracks=20)
        said += project.run("bash", "-ec", marker + after)
    return said


def test_the_override_of_the_page_fits_the_file(image: str, tmp_path: Path) -> None:
    (override,) = blocks("yaml")
    extra = tmp_path / "docker-compose.override.yml"
    extra.write_text(override, encoding="utf-8")
    said = Project(tmp_path).compose(
        "-f", "docker-compose.yml", "-f", str(extra), "config", "--format", "json"
    )
    capture = json.loads(said)["services"]["capture"]
    assert capture["environment"] == {
        "HEEL_CAPTURE__HORIZONTAL_FOV_DEG": "69", "HEEL_ZENOH__CONNECT": "tcp/router:7447",
        "HEEL_RUNTIME_DIR": "/dev/shm/heel", "HEEL_STATE_DIR": "/var/lib/heel", "HEEL_PROFILE": "",
    }  # fmt: skip
    assert capture["read_only"] is True
