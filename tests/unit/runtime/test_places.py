from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from heel.schemas.errors import SettingsError
from heel.services.runtime.places import kept_folder, private_run, robot_name, run_folder
from heel.services.runtime.process import PARENT_VARIABLE
from heel.services.runtime.settings import ZenohSettings


def test_the_named_folder_is_made_for_its_owner_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HEEL_RUNTIME_DIR", str(tmp_path / "a" / "run"))
    folder = run_folder()
    assert folder == tmp_path / "a" / "run"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert run_folder() == folder


def test_without_a_name_it_lies_in_the_session_s_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("HEEL_RUNTIME_DIR", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert run_folder() == tmp_path / "heel"


def test_a_session_folder_that_is_not_there_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("HEEL_RUNTIME_DIR", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "missing"))
    assert run_folder() == Path(f"/tmp/heel-{os.geteuid()}")


def test_a_link_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "real").mkdir(mode=0o700)
    (tmp_path / "link").symlink_to(tmp_path / "real")
    monkeypatch.setenv("HEEL_RUNTIME_DIR", str(tmp_path / "link"))
    with pytest.raises(SettingsError, match="is a link"):
        run_folder()


def test_a_folder_that_others_may_write_to_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o770)
    monkeypatch.setenv("HEEL_RUNTIME_DIR", str(tmp_path / "open"))
    with pytest.raises(SettingsError, match="others may write"):
        run_folder()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_somebody_else_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "theirs").mkdir(mode=0o700)
    os.chown(tmp_path / "theirs", 12345, 12345)
    monkeypatch.setenv("HEEL_RUNTIME_DIR", str(tmp_path / "theirs"))
    with pytest.raises(SettingsError, match="belongs to user 12345"):
        run_folder()


def test_what_cannot_be_made_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("HEEL_RUNTIME_DIR", str(tmp_path / "file" / "run"))
    with pytest.raises(SettingsError, match=r"run folder .*name another"):
        run_folder()


def test_what_has_to_outlive_everything_may_have_a_folder_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HEEL_RUNTIME_DIR", str(tmp_path / "run"))
    monkeypatch.delenv("HEEL_STATE_DIR", raising=False)
    assert kept_folder() == run_folder()
    monkeypatch.setenv("HEEL_STATE_DIR", str(tmp_path / "lib" / "heel"))
    assert kept_folder() == tmp_path / "lib" / "heel"
    assert stat.S_IMODE(kept_folder().stat().st_mode) == 0o700
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("HEEL_STATE_DIR", str(tmp_path / "file" / "state"))
    with pytest.raises(SettingsError, match=r"state folder .*HEEL_STATE_DIR"):
        kept_folder()


def name_of(connect: str, namespace: str = "") -> str:
    return robot_name(ZenohSettings(connect=(connect,), namespace=namespace))


@pytest.mark.parametrize(
    "other", ["tcp/localhost:7447", "tcp/[::1]:7447", "tcp/0.0.0.0:7447#so_sndbuf=9"]
)
def test_every_address_of_this_machine_is_the_same_robot(other: str) -> None:
    assert name_of(other) == name_of("tcp/127.0.0.1:7447")


@pytest.mark.parametrize(
    ("other", "namespace"),
    [
        ("tcp/127.0.0.1:7448", ""),
        ("tcp/192.0.2.1:7447", ""),
        ("tcp/robot:7447", ""),
        ("tcp/127.0.0.1:7447", "r2"),
    ],
)
def test_another_router_or_name_is_another_robot(other: str, namespace: str) -> None:
    assert name_of(other, namespace) != name_of("tcp/127.0.0.1:7447")


def test_a_run_is_told_from_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(PARENT_VARIABLE, raising=False)
    assert private_run() == ""
    monkeypatch.setenv(PARENT_VARIABLE, str(os.getpid()))
    mine = private_run()
    assert mine == private_run() != ""
    monkeypatch.setenv(PARENT_VARIABLE, "1")
    assert private_run() != mine
