"""Two runs on this machine: commands without a name ask which one, and a name reaches that one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from typer.testing import CliRunner

from heel.services.cli import app
from heel.services.runtime.places import VARIABLE
from heel.services.runtime.registry import runs
from tests.support.network import wait_until
from tests.support.processes import Running, running

_RUN = """
import logging, sys, threading
from heel.schemas import Target, encode, keys
from heel.services.runtime.registry import registered
from heel.services.runtime.router import open_private_router

name = sys.argv[1]

def answer(query):
    with query:
        target = Target(seq=1, mode="nearest", track_id=7, reason=f"by robot {name}")
        query.reply(keys.FOLLOW_TARGET, encode(target), encoding=target.encoding())

with open_private_router() as (session, endpoint):
    queryable = session.declare_queryable(keys.FOLLOW_TARGET, answer)
    with registered("demo", "a world", endpoint, ("follower",), logging.getLogger(), robot=name):
        threading.Event().wait(120.0)
"""


def heel(line: str) -> tuple[int, str]:
    """Exit code and output of a command without a word of where the robot is."""
    done = CliRunner().invoke(app, line.split())
    said = done.output + (str(done.exception) if done.exception is not None else "")
    return done.exit_code, said


@pytest.fixture
def two(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, Running]]:
    """Two runs that are registered, each with a follower that answers."""
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    for name in ("HEEL_ZENOH__CONNECT", "HEEL_CONFIG"):
        monkeypatch.delenv(name, raising=False)
    with ExitStack() as resources:
        yield {
            name: resources.enter_context(running("-c", _RUN, name, HEEL_RUNTIME_DIR=str(tmp_path)))
            for name in ("red", "blue")
        }


def test_commands_ask_which_of_two_runs_and_reach_the_one_that_is_named(
    two: dict[str, Running],
) -> None:
    def known() -> set[str]:
        assert all(process.alive for process in two.values()), two["red"].stderr()
        return {run.robot for run in runs()}

    wait_until(lambda: known() == {"red", "blue"}, "both runs", 30.0)
    for line in ("status", "follow nearest", "stop", "top --count 1", "topics --for 0.1"):
        code, said = heel(line)
        assert code != 0, line
        assert "2 are possible, name one: " in said, line
        for name in two:
            assert f"--robot {name} (heel demo a world)" in said, line
    for name in two:
        assert heel(f"follow nearest --robot {name}") == (
            0, f"target: person 7 (nearest): by robot {name}\n",
        )  # fmt: skip
    two["red"].process.kill()
    two["red"].wait(10.0)
    assert heel("follow nearest") == (0, "target: person 7 (nearest): by robot blue\n")
    code, said = heel("follow nearest --robot red")
    assert code != 0
    assert "no run of that name; --robot blue" in said
