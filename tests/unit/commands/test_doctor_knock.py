"""A router is told from another server, and a wrong password from no router."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from heel.schemas import SettingsError
from heel.services.commands.doctor import gather
from heel.services.commands.doctor.knock import is_zenoh, knock
from heel.services.commands.robot import RobotFlags
from heel.services.runtime.places import VARIABLE
from heel.services.runtime.router import RouterSettings, open_router


@contextmanager
def server(answer: bytes | None) -> Iterator[int]:
    """Something that listens, and answers so; None: never."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        kept: list[socket.socket] = []

        def serve() -> None:
            line, _ = listener.accept()
            kept.append(line)
            line.recv(4096)
            if answer is not None:
                line.sendall(answer)

        threading.Thread(target=serve, daemon=True).start()
        yield listener.getsockname()[1]
        for line in kept:
            line.close()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        found: int = probe.getsockname()[1]
    return found


def test_who_listens_at_an_address() -> None:
    assert knock("127.0.0.1", free_port(), 1.0) == "refused"
    assert knock("nowhere.invalid", 7447, 1.0) == "unknown host"
    with server(b"HTTP/1.1 400 Bad Request\r\n\r\n") as port:
        assert knock("127.0.0.1", port, 1.0) == "other"
    with server(None) as port:
        assert knock("127.0.0.1", port, 0.2) == "silent"


@pytest.mark.parametrize(
    ("answer", "zenoh"),
    [
        (b"\x02\x00\x03\x00", True),
        (b"\x03\x00\xe1\x09\xf0", True),
        (b"\x02\x00\x04\x00", False),
        (b"\x09\x00\x03\x00", False),
        (b"", False),
        (b"\x02\x00", False),
    ],
)
def test_the_answer_of_a_zenoh_node_is_known_by_its_first_bytes(answer: bytes, zenoh: bool) -> None:
    assert is_zenoh(answer) == zenoh


def test_a_wrong_password_is_told_from_no_router(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "run"))
    monkeypatch.setattr(gather, "_LISTEN_S", 0.1)
    users, right, wrong = (tmp_path / name for name in ("users", "right", "wrong"))
    users.write_text("heel:secret\n")
    users.chmod(0o600)
    right.write_text("secret\n")
    wrong.write_text("guessed\n")
    endpoint = f"tcp/127.0.0.1:{free_port()}"

    def asked(user: str | None, password: Path | None) -> tuple[str | None, bool]:
        flags = RobotFlags(connect=endpoint, user=user, password_file=password)
        router, _ = gather.ask_robot(flags.find())
        if router.entered:
            assert set(router.versions) == {"heel", "zenoh"}
        return router.answer, router.entered

    assert asked(None, None) == ("refused", False)
    with open_router(RouterSettings(listen=(endpoint,), users_file=users)):
        assert asked(None, None) == ("zenoh", False)
        assert asked("heel", wrong) == ("zenoh", False)
        assert asked("heel", right) == ("zenoh", True)


def test_a_run_folder_of_somebody_else_is_a_finding_and_no_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    monkeypatch.setenv(VARIABLE, str(tmp_path / "link"))
    with pytest.raises(SettingsError, match="is a link"):
        RobotFlags().find()
    where = gather.find(RobotFlags(connect=f"tcp/127.0.0.1:{free_port()}"))
    assert "is a link" in str(gather.look_at_machine(where).run_folder)
    assert gather.find(RobotFlags()).run is None
    monkeypatch.setenv(VARIABLE, str(tmp_path / "real"))
    with pytest.raises(SettingsError, match="no run of that process"):
        gather.find(RobotFlags(run=1))
