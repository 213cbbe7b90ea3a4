"""`import heel` from a program of one's own: what the guide shows, and what `heel run` writes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

from heel.services.capture.sources import open_source
from heel.services.detector.settings import NO_NETWORK
from tests.support.documents import blocks
from tests.support.processes import REPOSITORY

SCENE = "scene:crossing?frames=112&width=320&height=240"
_BLOCKS = [
    (Path(page).name, number, block.text)
    for page in ("docs/guides/python.md", "README.md")
    for number, block in enumerate(blocks("python", page))
]


def _run(arguments: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """A user's Python: without the settings of these tests, above all the threads of BLAS."""
    environment = {
        name: value for name, value in os.environ.items()
        if not name.startswith(("OPENBLAS", "HEEL", "PYTHON"))
    }  # fmt: skip
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, timeout=90,
        stdin=subprocess.DEVNULL, check=False,
        env={**environment, "PYTHONPATH": str(REPOSITORY / "src")},
    )  # fmt: skip


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `walk.mp4`, in which people walk."""
    folder = tmp_path_factory.mktemp("walk")
    code = cv2.VideoWriter.fourcc(*"mp4v")
    with open_source(SCENE) as source:
        size = (source.width, source.height)
        film = cv2.VideoWriter(str(folder / "walk.mp4"), code, source.fps, size)
        while (frame := source.read()) is not None:
            film.write(frame.image)
        film.release()
    return folder


@pytest.mark.parametrize(("page", "number", "block"), _BLOCKS, ids=lambda value: str(value)[:9])
def test_what_the_guide_shows_runs(page: str, number: int, block: str, walk: Path) -> None:
    done = _run(["-W", "error", "-c", block], walk)
    assert done.returncode == 0, done.stderr
    assert done.stderr in ("", f"{NO_NETWORK}\n")


_ROWS = """
import csv, sys
import heel

tracks, commands = open(sys.argv[2], "w"), csv.writer(open(sys.argv[3], "w"), lineterminator="\\n")
commands.writerow(["seq", "frame", "linear_mps", "angular_radps", "state", "reason"])
for frame in heel.open(sys.argv[1]):
    for person in frame.people:
        left, top, right, bottom = person.box_xyxy
        tracks.write(f"{frame.index + 1},{person.id},{left + 1:.2f},{top + 1:.2f},"
                     f"{right - left:.2f},{bottom - top:.2f},"
                     f"{person.identity_confidence:.3f},-1,-1,-1\\n")
    c = frame.command
    commands.writerow([c.seq, frame.index + 1, f"{c.linear_mps:.4f}", f"{c.angular_radps:.4f}",
                       c.state, c.reason])
"""


def test_rows_are_those_of_heel_run(tmp_path: Path) -> None:
    done = _run(["-m", "heel", "run", SCENE, "--out", "run"], tmp_path)
    assert done.returncode == 0, done.stderr
    done = _run(["-c", _ROWS, SCENE, "tracks.txt", "commands.csv"], tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("tracks.txt", "commands.csv"):
        written = (tmp_path / "run" / name).read_text()
        assert written.count("\n") > 60
        assert (tmp_path / name).read_text() == written
