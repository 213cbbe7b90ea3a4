"""Runs on this machine leave a note while they live, and only then."""

from __future__ import annotations

import json
import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from heel.services.runtime.places import VARIABLE
from heel.services.runtime.registry import Run, registered, runs
from tests.support.network import wait_until

LOG = logging.getLogger("heel.test")
ENDPOINT = "tcp/127.0.0.1:40001"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "run"))
    return tmp_path / "run" / "runs"


def test_a_run_is_found_while_it_lives_and_its_page_once_it_is_served(folder: Path) -> None:
    assert runs() == []
    with registered("demo", "distractor-3", ENDPOINT, ("tracker",), LOG) as note:
        [run] = runs()
        assert (run.pid, run.kind, run.endpoint, run.page) == (os.getpid(), "demo", ENDPOINT, None)
        note.page_is("http://127.0.0.1:8470/")
        [run] = runs()
        assert run.page == "http://127.0.0.1:8470/"
        assert run.shown().startswith(f"--run {run.pid} (heel demo distractor-3, page http://")
        note.processes_are({"tracker": 7}, Path("logs"))
        [run] = runs()
        assert (run.pids, run.logs) == ({"tracker": 7}, str(Path.cwd() / "logs"))
    assert runs() == []
    assert list(folder.iterdir()) == []


def test_names_that_are_no_text_are_spelled_out() -> None:
    with registered("run", "caf\udce9.mp4", ENDPOINT, ("tracker",), LOG) as note:
        note.processes_are({"tracker": 7}, Path("/out\udce9/logs"))
        [run] = runs()
    assert (run.what, run.logs) == (r"caf\udce9.mp4", r"/out\udce9/logs")


def test_a_run_is_found_though_its_folder_was_deleted_or_is_another_one(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with registered("demo", "distractor-3", ENDPOINT, ("tracker",), LOG) as note:
        note.page_is("http://127.0.0.1:8470/")
        shutil.rmtree(folder.parent)
        wait_until(lambda: bool(runs()), "a note in the folder made anew")
        assert runs()[0].page == "http://127.0.0.1:8470/"
        # A session that ends takes its folder along, and the next one has another.
        monkeypatch.setenv(VARIABLE, str(tmp_path / "other"))
        wait_until(lambda: bool(runs()), "a note where commands look now")
    assert runs() == []
    assert list(tmp_path.rglob("*.json")) == []


def test_notes_of_processes_that_died_or_were_others_are_removed(folder: Path) -> None:
    folder.mkdir(parents=True, mode=0o700)
    dead = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"],
                          capture_output=True, text=True, check=True)  # fmt: skip
    pid = int(dead.stdout)
    another = Run(pid=os.getpid(), started="another boot 1", kind="run", endpoint=ENDPOINT)
    for name, text in (
        (pid, Run(pid=pid, started="x 1", kind="run", endpoint=ENDPOINT).model_dump_json()),
        (os.getpid(), another.model_dump_json()),
        (1, "{}"),
        (2, "[" * 100_000),
        (3, "\0\xff"),
    ):
        (folder / f"{name}.json").write_text(text)
    assert runs() == []
    assert list(folder.iterdir()) == []


def test_a_note_is_bounded_in_size(folder: Path) -> None:
    with registered("demo", "x", ENDPOINT, (), LOG):
        [note] = folder.glob("*.json")
        note.write_text(json.dumps(json.loads(note.read_text()) | {"what": "x" * 100_000}))
        assert runs() == []


def test_a_folder_that_cannot_be_used_keeps_no_run_from_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(VARIABLE, str(tmp_path / "file"))
    with registered("demo", "x", ENDPOINT, (), LOG) as note:
        note.page_is("http://127.0.0.1:1/")
    assert f"--connect {ENDPOINT}" in caplog.text
