"""Text for people, JSON lines for machines, and no flood of either."""

from __future__ import annotations

import errno
import io
import json
import logging
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from heel.schemas.errors import SettingsError
from heel.services.runtime import logs
from heel.services.runtime.logs import OncePerSecond, printable, set_up_logging
from heel.services.runtime.settings import LogSettings


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        """As a terminal would."""
        return True


@pytest.fixture(autouse=True)
def untouched_root() -> Iterator[None]:
    root = logging.getLogger()
    handlers, level = list(root.handlers), root.level
    yield
    for handler in set(root.handlers) - set(handlers):
        handler.close()
    root.handlers[:], root.level = handlers, level


def written(
    monkeypatch: pytest.MonkeyPatch, settings: LogSettings, stream: io.StringIO
) -> tuple[logging.Logger, io.StringIO]:
    monkeypatch.setattr(sys, "stderr", stream)
    return set_up_logging(settings, "tracker"), stream


@pytest.mark.parametrize(
    ("form", "terminal", "is_json"),
    [("auto", True, False), ("auto", False, True), ("text", False, False), ("json", True, True)],
)
def test_the_format_follows_the_setting_and_auto_asks_the_terminal(
    form: str, terminal: bool, is_json: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = LogSettings.model_validate({"format": form})
    log, stream = written(monkeypatch, settings, Terminal() if terminal else io.StringIO())
    log.warning("stale %s", "tracks")
    assert stream.getvalue().startswith("{") == is_json
    assert "stale tracks" in stream.getvalue()


def test_json_lines_are_one_object_a_line_with_extras_and_traceback(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log, stream = written(monkeypatch, LogSettings(format="json"), io.StringIO())
    log.info("two\nlines", extra={"seq": 7, "odd": object()})
    try:
        raise ValueError("reason")
    except ValueError:
        log.exception("failed")
    first, second = (json.loads(line) for line in stream.getvalue().splitlines())
    assert (first["message"], first["level"], first["logger"]) == (
        "two\nlines", "info", "heel.tracker",
    )  # fmt: skip
    assert first["seq"] == 7
    assert first["t"].endswith("Z")
    assert "ValueError: reason" in second["traceback"]


def test_less_severe_lines_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    log, stream = written(monkeypatch, LogSettings(level="warning"), io.StringIO())
    log.info("quiet")
    assert stream.getvalue() == ""


def test_setting_up_twice_writes_once(monkeypatch: pytest.MonkeyPatch) -> None:
    written(monkeypatch, LogSettings(), io.StringIO())
    log, stream = written(monkeypatch, LogSettings(), io.StringIO())
    log.warning("once")
    assert len(stream.getvalue().splitlines()) == 1


def test_one_line_of_a_kind_per_second_and_the_rest_is_counted(
    caplog: pytest.LogCaptureFixture,
) -> None:
    warn = OncePerSecond(logging.getLogger("heel.test"))
    for step in range(25):
        warn.warning("size", "too large", 100.0 + step * 0.1)
    warn.warning("version", "too new", 100.0)
    assert caplog.messages == [
        "too large", "too large (9 more like it)", "too large (9 more like it)", "too new",
    ]  # fmt: skip


def test_endless_new_kinds_do_not_fill_the_memory() -> None:
    warn = OncePerSecond(logging.getLogger("heel.test"), max_kinds=8)
    for kind in range(1000):
        warn.warning(f"kind {kind}", "x", 0.0)
    assert len(warn._last_s) <= 8


HOSTILE = "svc/a\x1b[2J\n14:00:00 ERROR   heel.drive: on fire\r\u202e\ud800/health" + "k" * 50_000


def test_text_from_the_wire_is_one_bounded_line_that_no_terminal_obeys(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log, stream = written(monkeypatch, LogSettings(format="text"), io.StringIO())
    log.warning("%s: refused", HOSTILE)
    try:
        raise ValueError(HOSTILE)
    except ValueError:
        log.exception("failed")
    first, second, *traceback = stream.getvalue().splitlines()
    assert r"\x1b[2J\n14:00:00 ERROR" in first
    assert second.endswith("heel.tracker: failed")
    assert all(line.startswith("    ") for line in traceback)
    assert stream.getvalue().replace("\n", "").isprintable()
    assert len(stream.getvalue()) < 6000


def test_json_lines_are_bounded_too(monkeypatch: pytest.MonkeyPatch) -> None:
    log, stream = written(monkeypatch, LogSettings(format="json"), io.StringIO())
    log.warning("%s: refused", HOSTILE)
    assert len(stream.getvalue().splitlines()) == 1
    assert len(stream.getvalue()) < 2000


def test_a_plain_text_stays_as_it_is() -> None:
    assert printable("größer als 3 m: „nein“ [/foo]") == "größer als 3 m: „nein“ [/foo]"


def test_a_flood_of_one_kind_is_counted_and_other_kinds_get_through(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(time, "time", lambda: 1000.25)
    monkeypatch.setattr(time, "time_ns", lambda: 1_000_250_000_000)
    log, stream = written(monkeypatch, LogSettings(format="text"), io.StringIO())
    for number in range(10_000):
        log.warning("e-stop engaged by %s", f"flooder {number}")
    log.warning("another kind")
    assert len(stream.getvalue().splitlines()) == 6
    assert "another kind" in stream.getvalue()
    monkeypatch.setattr(time, "time", lambda: 1001.25)
    monkeypatch.setattr(time, "time_ns", lambda: 1_001_250_000_000)
    log.warning("e-stop engaged by %s", "a person")
    assert "by a person (9995 more like it)" in stream.getvalue()


def test_a_flood_of_ever_new_kinds_is_bounded_and_an_error_is_still_written(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(time, "time", lambda: 1000.25)
    monkeypatch.setattr(time, "time_ns", lambda: 1_000_250_000_000)
    log, stream = written(monkeypatch, LogSettings(format="text"), io.StringIO())
    for number in range(10_000):
        log.warning(f"kind {number}")
    log.error("why the service ends")
    assert len(stream.getvalue().splitlines()) <= 61
    assert "why the service ends" in stream.getvalue()


def test_a_service_writes_a_file_of_its_own_besides(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = LogSettings(format="text", folder=tmp_path / "new" / "logs")
    log, stream = written(monkeypatch, settings, io.StringIO())
    log.warning("stale %s\x1b", "tracks")
    for _ in range(100):
        log.info("flood")
    lines = (tmp_path / "new" / "logs" / "tracker.log").read_text().splitlines()
    assert json.loads(lines[0])["message"] == "stale tracks\x1b"
    assert len(lines) <= 11, "a flood is held back there, too"
    assert "stale tracks" in stream.getvalue()


def test_a_log_folder_that_cannot_be_written_to_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingsError, match=r"log folder .*file: .*name one that can be written"):
        set_up_logging(LogSettings(folder=tmp_path / "file"), "tracker")


def test_a_full_disk_costs_lines_of_the_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, stream = written(monkeypatch, LogSettings(folder=tmp_path), io.StringIO())
    handler = logging.getLogger().handlers[1]
    assert isinstance(handler, logging.FileHandler)

    class Full(io.StringIO):
        """A file on a disk without room."""

        def write(self, _text: str) -> int:
            """Fail."""
            raise OSError(errno.ENOSPC, "No space left on device")

    handler.stream.close()
    handler.stream = Full()  # type: ignore[assignment]
    log.warning("stale tracks")
    assert stream.getvalue().count("\n") == 1
    assert "Traceback" not in stream.getvalue()


def test_log_files_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logs, "_LOG_BYTES", 1000)
    log, _ = written(monkeypatch, LogSettings(folder=tmp_path), io.StringIO())
    for n in range(300):
        log.error("kind %d of many, each of them another one" % n)  # noqa: UP031
    files = {one.name: one.stat().st_size for one in tmp_path.iterdir()}
    assert set(files) == {"tracker.log", "tracker.log.1", "tracker.log.2"}
    assert max(files.values()) <= 1000
