"""`heel run` as a user runs it: real processes, real files, whatever happens to them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support.network import wait_until
from tests.support.processes import REPOSITORY

SCENE = "scene:crossing?frames=120&width=320&height=240"
HEEL = [sys.executable, "-m", "heel"]
DEADLINE_S = 60.0


def heel(*arguments: object, timeout_s: float = DEADLINE_S) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*HEEL, *map(str, arguments)], capture_output=True, text=True, timeout=timeout_s,
        stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip


def processes_using(folder: Path) -> list[int]:
    """Pids of all processes whose command line names the folder or one of its children's logs."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit() or int(entry.name) == os.getpid():
            continue
        try:
            environment = (entry / "environ").read_bytes()
        except OSError:
            continue
        if f"HEEL_TEST_RUN={folder}".encode() in environment:
            found.append(int(entry.name))
    return found


@pytest.fixture(scope="module")
def lossless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("lossless")
    trace = out / "trace.jsonl"
    done = heel("run", SCENE, "--out", out, "--lossless", "--annotate", "--trace", trace)
    assert done.returncode == 0, done.stderr
    return out


def test_lossless_run_loses_nothing(lossless: Path) -> None:
    summary = json.loads((lossless / "summary.json").read_text())
    assert summary["frames"] == {"captured": 120, "detected": 120, "tracked": 120}
    assert set(summary["dropped"].values()) == {0}
    assert set(summary["malformed"].values()) == {0}
    assert {"capture", "detector", "tracker", "follower"} <= set(summary["cpu_s"])


def test_lossless_run_equals_the_in_process_pipeline_byte_for_byte(
    lossless: Path, tmp_path: Path
) -> None:
    out = tmp_path / "new"
    done = heel("run", SCENE, "--out", out, "--in-process", "--trace", out / "trace.jsonl")
    assert done.returncode == 0, done.stderr
    tracks = (lossless / "tracks.txt").read_bytes()
    assert tracks, "the scene has people in it"
    for name in ("tracks.txt", "commands.csv", "states.csv", "trace.jsonl"):
        assert (out / name).read_bytes() == (lossless / name).read_bytes()
    assert (out / "trace.jsonl").read_text().count("\n") > 2


def test_lossless_run_equals_itself(lossless: Path, tmp_path: Path) -> None:
    done = heel("run", SCENE, "--out", tmp_path, "--lossless")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "tracks.txt").read_bytes() == (lossless / "tracks.txt").read_bytes()


def test_annotated_video_holds_every_frame(lossless: Path) -> None:
    video = cv2.VideoCapture(str(lossless / "annotated.mp4"))
    assert int(video.get(cv2.CAP_PROP_FRAME_COUNT)) == 120
    video.release()


def test_live_run_of_a_recording_reports_ages_by_hop(tmp_path: Path) -> None:
    done = heel("run", SCENE, "--out", tmp_path, "--live")
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert set(summary["age_ms"]) == {"blobs", "tracks", "command"}
    assert summary["frames"]["captured"] == 120
    assert summary["frames"]["tracked"] + sum(summary["dropped"].values()) >= 118


@contextmanager
def endless_run(out: Path, delivery: str = "--live") -> Iterator[subprocess.Popen[str]]:
    """A looped run that has written its first tracks; killed on the way out."""
    run = subprocess.Popen(
        [*HEEL, "run", SCENE, "--out", str(out), delivery, "--loop"],
        env={**os.environ, "HEEL_TEST_RUN": str(out)}, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        tracks = out / "tracks.txt"
        wait_until(lambda: tracks.is_file() and tracks.stat().st_size > 0, "tracks", 60.0)
        yield run
    finally:
        for pid in processes_using(out):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        run.communicate(timeout=10)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_process_outlives_a_run_however_it_ends(tmp_path: Path, number: signal.Signals) -> None:
    with endless_run(tmp_path) as run:
        assert len(processes_using(tmp_path)) >= 6, "guard, run and four services"
        run.send_signal(number)
        run.wait(timeout=15)
        if number is not signal.SIGKILL:
            assert run.returncode == 0
        wait_until(lambda: not processes_using(tmp_path), "all processes ended", 10.0)
        rows = (tmp_path / "tracks.txt").read_text()
        assert rows.endswith("\n"), "what was produced before is kept and readable"


def test_a_killed_service_ends_a_lossless_run_with_its_name(tmp_path: Path) -> None:
    with endless_run(tmp_path, "--lossless") as run:
        victim = next(
            pid
            for pid in processes_using(tmp_path)
            if b"heel.services.tracker" in Path(f"/proc/{pid}/cmdline").read_bytes()
        )
        os.kill(victim, signal.SIGKILL)
        _, errors = run.communicate(timeout=30)
        assert run.returncode == 1
        assert "tracker ended with code -9" in errors
        assert not processes_using(tmp_path)


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        pytest.param(lambda f: f / "absent.mp4", "no such file", id="missing"),
        pytest.param(lambda f: _file(f / "empty.mp4", b""), "empty", id="empty"),
        pytest.param(lambda f: _file(f / "text.mp4", b"not a video" * 50), "", id="not-a-video"),
        pytest.param(lambda f: _folder(f / "none"), "", id="folder-without-images"),
    ],
)
def test_bad_source_gets_one_line_and_exit_code_1(
    tmp_path: Path, make: object, complaint: str
) -> None:
    assert callable(make)
    done = heel("run", make(tmp_path), "--out", tmp_path / "out")
    assert done.returncode == 1
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    assert complaint in lines[0]
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "complaint"),
    [
        pytest.param(["nowhere.mp4"], 1, "nowhere.mp4", id="source"),
        pytest.param([SCENE, "--detector", "nosuch"], 2, "nosuch", id="detector"),
        pytest.param([SCENE, "--model", "nosuch.onnx"], 2, "nosuch.onnx", id="model"),
        pytest.param([f"pan:{SCENE}", "--lossless"], 2, "--lossless", id="window"),
    ],
)
def test_a_run_that_cannot_start_touches_nothing_of_an_earlier_one(
    tmp_path: Path, arguments: list[str], code: int, complaint: str
) -> None:
    old = {"tracks.txt": "1,1,1,1,1,1,1,-1,-1,-1\n", "summary.json": "{}", "logs/web.log": "old\n"}
    (tmp_path / "logs").mkdir()
    for name, text in old.items():
        (tmp_path / name).write_text(text)
    done = heel("run", *arguments, "--out", tmp_path)
    assert done.returncode == code
    assert complaint in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    found = {
        str(p.relative_to(tmp_path)): p.read_text() for p in tmp_path.rglob("*") if p.is_file()
    }
    assert found == old
    assert len(list(tmp_path.iterdir())) == 3


def test_a_service_of_the_same_name_in_the_working_directory_is_not_run(tmp_path: Path) -> None:
    for name in ("services", "schemas", "evaluation"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise SystemExit('a stranger ran')\n")
    (tmp_path / "heel.py").write_text("raise SystemExit('a stranger ran')\n")
    script = "import sys; from heel.services.cli import main; sys.argv[0] = 'heel'; main()"
    done = subprocess.run(
        [sys.executable, "-P", "-c", script, "run", SCENE, "--frames", "5", "--out", "out"],
        cwd=tmp_path, capture_output=True, text=True, timeout=DEADLINE_S, check=False,
        stdin=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": str(REPOSITORY / "src")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def _file(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def _folder(path: Path) -> Path:
    path.mkdir()
    return path


def test_sizes_from_1x1_to_8k_and_a_change_in_mid_stream_go_through(tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    folder.mkdir()
    rng = np.random.default_rng(1)
    sizes = [(1, 1), (1, 1), (96, 128), (96, 128), (4320, 7680), (96, 128)]
    for number, (height, width) in enumerate(sizes, 1):
        image = rng.integers(0, 255, (height, width, 3), dtype=np.uint8)
        if height > 1000:
            image[:] = 90
        cv2.imwrite(str(folder / f"{number:06d}.png"), image)
    done = heel("run", folder, "--out", tmp_path / "out", "--lossless")
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["frames"]["tracked"] == len(sizes)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["run", "scene:crossing"], "--out"),
        (["tracker", "--no-such-flag"], "--no-such-flag"),
        (["tracker", "--delivery", "sometimes"], "tracker.delivery"),
        (["follower", "--rate-hz", "fast"], "follower.rate_hz"),
        (["follow", "somebody"], "somebody"),
        (["run", "/dev/video0", "--out", "x", "--lossless"], "a camera does not wait"),
    ],
)
def test_wrong_usage_is_exit_code_2_and_names_the_culprit(
    arguments: list[str], complaint: str
) -> None:
    done = heel(*arguments)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert "Traceback" not in done.stderr


def test_settings_file_reaches_every_process(tmp_path: Path) -> None:
    settings = tmp_path / "heel.toml"
    settings.write_text("[follower]\nmax_linear_mps = 0.25\n[tracker]\n")
    done = heel("run", SCENE, "--out", tmp_path / "out", "--frames", 5, "--config", settings)
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["settings"]["follower"]["max_linear_mps"] == 0.25


def test_unknown_key_in_the_settings_file_ends_the_run_with_its_name(tmp_path: Path) -> None:
    settings = tmp_path / "heel.toml"
    settings.write_text("[tracker]\nmax_mised = 3\n")
    done = heel("run", SCENE, "--out", tmp_path / "out", "--config", settings)
    assert done.returncode in (1, 2)
    assert "max_mised" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
