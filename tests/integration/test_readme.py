"""Every command in the README is run: here, in `.ci/run`, or in the Docker tests."""

from __future__ import annotations

import os
import shlex
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import cv2
import pytest

from heel.services.capture.sources import open_source
from heel.services.pipeline import scene_truth
from tests.support.documents import blocks
from tests.support.network import wait_until
from tests.support.processes import REPOSITORY

SCENE = "scene:crossing?frames=120&width=320&height=240"


def block_with(command: str) -> list[str]:
    """The commands of the README's first block with one that begins so."""
    found = (block.commands for block in blocks("sh", "README.md"))
    return next(lines for lines in found if any(line.startswith(command) for line in lines))


def run(line: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    words = shlex.split(line)
    assert words[0] == "heel"
    return subprocess.run(
        [sys.executable, "-m", "heel", *words[1:]], cwd=folder, text=True, timeout=90,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), **environment}, capture_output=True,
        stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip


@contextmanager
def started(line: str, folder: Path, **environment: str) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "heel", *shlex.split(line)[1:]], cwd=folder,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), **environment},
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=10)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def test_make_targets_are_what_ci_runs() -> None:
    ci = (REPOSITORY / ".ci" / "run").read_text()
    makefile = (REPOSITORY / "Makefile").read_text()
    for line in [*block_with("make demo"), *block_with("make results")]:
        assert f"\n{line.split()[1]}:" in makefile, line
    for line in block_with("make demo"):
        assert line in ci, f"{line} is not run by .ci/run"


@pytest.mark.parametrize("module", ["benchmarks.overhead", "benchmarks.accuracy"])
def test_what_make_results_and_make_bench_call_runs_on_a_drawn_scene(module: str) -> None:
    makefile = (REPOSITORY / "Makefile").read_text()
    assert f"-m {module}" in makefile
    extra = ["--runs", "1"] if module.endswith("overhead") else []
    done = subprocess.run(
        [sys.executable, "-m", module, "--recording", SCENE, *extra], cwd=REPOSITORY, text=True,
        capture_output=True, timeout=90, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "scene:crossing" in done.stdout


def test_docker_commands_are_those_of_the_docker_page_whose_commands_a_test_types() -> None:
    page = (REPOSITORY / "docs" / "guides" / "docker.md").read_text()
    for line in block_with("docker compose"):
        # In the background there, so that the test goes on.
        assert f"\n{line} -d\n" in page, line


def test_recording_commands(tmp_path: Path) -> None:
    with open_source(SCENE) as source:
        size = (source.width, source.height)
        writer = cv2.VideoWriter(
            str(tmp_path / "video.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), source.fps, size
        )
        while (frame := source.read()) is not None:
            writer.write(frame.image)
        writer.release()
    truth = tmp_path / "ground_truth" / "gt"
    truth.mkdir(parents=True)
    (truth / "gt.txt").write_text("".join(scene_truth(SCENE).rows))
    for line in block_with("heel run"):
        done = run(line, tmp_path)
        assert done.returncode == 0, f"{line}: {done.stderr}"
    for name in ("tracks.txt", "commands.csv", "summary.json", "annotated.mp4"):
        assert (tmp_path / "results" / name).stat().st_size > 0
    assert len(list((tmp_path / "plots").glob("*.png"))) == 2


def test_the_drawn_scene_is_played_once_and_scored(tmp_path: Path) -> None:
    for line in block_with("heel demo --scene"):
        done = run(f"{line} --port 0 --out {tmp_path}", tmp_path)
        assert done.returncode == 0, f"{line}: {done.stderr}"
        assert "live page: http://127.0.0.1:" in done.stdout
        assert "MOTA" in done.stdout


def test_one_service_each_and_the_commands_for_what_is_running(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    environment = {
        "HEEL_ROUTER__LISTEN": endpoint, "HEEL_ZENOH__CONNECT": endpoint,
        "HEEL_WEB__PORT": str(free_port()),
    }  # fmt: skip
    with ExitStack() as stack:
        for line in block_with("heel router"):
            stack.enter_context(started(line, tmp_path, **environment))

        def everything_flows() -> bool:
            shown = run("heel status", tmp_path, **environment).stdout
            rows = [line.split() for line in shown.splitlines()]
            # On a busy machine the follower complains of the frame rate: it sends all the same.
            sends = {row[0] for row in rows if len(row) > 3 and row[1] in ("ok", "degraded")
                     and row[3] != "0.0"}  # fmt: skip
            return sends >= {"capture/main", "detector/main", "tracker/main", "follower/main"}

        wait_until(everything_flows, "all services ok and sending", 60.0)
        for line in block_with("heel status"):
            done = run(line, tmp_path, **environment)
            while "choose again when the picture is live" in done.stderr:
                # As it says: a machine with other work holds up a picture now and then.
                done = run(line, tmp_path, **environment)
            assert done.returncode == 0, f"{line}: {done.stderr}"


def test_remote_host_recipe(tmp_path: Path) -> None:
    """As printed, but on loopback, with a scene in place of the camera."""
    port = free_port()
    users = tmp_path / "users.txt"
    users.write_text("robot:secret\nremote:secret2\n")
    for password in ("secret", "secret2"):
        (tmp_path / password).write_text(f"{password}\n")
    router, capture, detector = block_with("heel router --listen")
    router = router.replace("0.0.0.0:7447", f"127.0.0.1:{port}")
    capture = (
        capture.replace("/dev/video0", "scene:demo --loop") + f" --connect tcp/127.0.0.1:{port}"
    )
    detector = detector.replace("robot.local:7447", f"127.0.0.1:{port}")
    credentials = f"--connect tcp/127.0.0.1:{port} --user robot --password secret"
    login = {
        "HEEL_ZENOH__CONNECT": f"tcp/127.0.0.1:{port}", "HEEL_ZENOH__USER": "robot",
        "HEEL_ZENOH__PASSWORD": "secret",
    }  # fmt: skip
    with ExitStack() as stack:
        for line in (router, capture, detector, f"heel tracker {credentials}"):
            stack.enter_context(started(line, tmp_path))

        def tracks_flow() -> bool:
            shown = run("heel status", tmp_path, **login).stdout
            rows = [line.split() for line in shown.splitlines()]
            return any(row[0] == "tracker/main" and row[3] != "0.0" for row in rows if len(row) > 3)

        wait_until(tracks_flow, "tracks from the remote detector", 60.0)
        refused = run(
            f"heel status --connect tcp/127.0.0.1:{port}", tmp_path,
            HEEL_ZENOH__USER="robot", HEEL_ZENOH__PASSWORD="guess",
        )  # fmt: skip
        assert refused.returncode == 1
