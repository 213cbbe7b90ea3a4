"""One question to the robot: an answer, a refusal in one line, or nobody."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from heel.schemas import HeelError, MessageError, Target, encode, keys
from heel.services.commands.robot import ask
from heel.services.runtime.command_line import run_app


def session(*replies: object) -> Any:
    """A session whose every question is answered so."""
    return cast(Any, SimpleNamespace(get=lambda *_, **__: list(replies)))


def payload(content: bytes) -> Any:
    return SimpleNamespace(to_bytes=lambda: content)


def refused(content: bytes) -> Any:
    return SimpleNamespace(ok=None, err=SimpleNamespace(payload=payload(content)))


def answered(content: bytes, encoding: str) -> Any:
    sample = SimpleNamespace(payload=payload(content), encoding=encoding)
    return SimpleNamespace(ok=sample, err=None)


def test_nobody_answers() -> None:
    assert ask(session(), keys.FOLLOW_TARGET, Target) is None


def test_the_first_good_answer_counts() -> None:
    target = Target(seq=3, mode="none")
    reply = answered(encode(target), Target.encoding())
    assert ask(session(reply), keys.FOLLOW_TARGET, Target) == target


def test_an_answer_that_is_no_target_is_an_error_that_says_so() -> None:
    with pytest.raises(MessageError):
        ask(session(answered(b"\xff\xfe", "text/plain")), keys.FOLLOW_TARGET, Target)


def test_a_refusal_that_is_no_text_is_one_line_on_the_terminal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def app() -> None:
        ask(session(refused(b"\xff\xfe\x1b[2J\nheel: on fire")), keys.FOLLOW_TARGET, Target)

    with pytest.raises(SystemExit) as ended:
        run_app(cast(Any, app))
    assert ended.value.code == 1
    told = capsys.readouterr().err
    assert told.startswith("heel: ")
    assert len(told.splitlines()) == 1
    assert told.rstrip("\n").isprintable()
    with pytest.raises(HeelError):
        app()
