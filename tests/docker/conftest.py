"""One engine and one image for all Docker tests."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator

import pytest

from tests.docker.engine import DEMO_IMAGE, IMAGE, REPOSITORY, Project, missing_engine

BUILD_DEADLINE_S = 300.0


@pytest.fixture(scope="session")
def image() -> str:
    """The image built from the repository as it is."""
    reason = missing_engine()
    if reason is not None:
        pytest.skip(reason)
    _build("service", IMAGE)
    return IMAGE


@pytest.fixture(scope="session")
def demo_image(image: str) -> str:
    """The same with the renderer of the simulated world."""
    _build("demo", DEMO_IMAGE)
    return DEMO_IMAGE


def _build(target: str, tag: str) -> None:
    done = subprocess.run(
        ["docker", "build", "-q", "--target", target, "-t", tag, "."], cwd=REPOSITORY,
        # The older builder makes every stage, whether it is asked for or not.
        env=os.environ | {"DOCKER_BUILDKIT": "1"}, capture_output=True, text=True,
        timeout=BUILD_DEADLINE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def project(image: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Project]:
    """The containers of `docker compose up` with nothing configured."""
    project = Project(tmp_path_factory.mktemp("videos"))
    try:
        project.up()
        yield project
    finally:
        project.down()
