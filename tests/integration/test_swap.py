"""A service moves to another host while the robot runs: JPEG over TCP, users known by password."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.integration.remote import (
    Link,
    Recipe,
    StreamWatch,
    elsewhere,
    other_network,
    robot,
    watching,
)
from tests.support.network import wait_until
from tests.support.processes import Running, finished

pytestmark = pytest.mark.timeout(180)

LONGEST_GAP_S = 1.0
WARM_FRAMES = 50
AFTER_FRAMES = 75
DEADLINE_S = 40.0


@pytest.fixture(scope="module")
def link() -> Iterator[Link]:
    if os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("network namespaces need root and iproute2")
    network = other_network()
    try:
        made = network.__enter__()
    except PermissionError as error:
        pytest.skip(f"no network namespaces here: {error}")
    yield made
    network.__exit__(None, None, None)


@pytest.fixture
def port(link: Link) -> int:
    with socket.socket() as probe:
        probe.bind((link.address, 0))
        free: int = probe.getsockname()[1]
    return free


@pytest.fixture
def recipe(link: Link, port: int, tmp_path: Path) -> Recipe:
    return Recipe(link, port, tmp_path / "users.txt")


@pytest.mark.parametrize(
    ("service", "end"), [("detector", signal.SIGTERM), ("tracker", signal.SIGKILL)]
)
def test_tracks_go_on_when_a_service_moves_to_another_host(
    service: str, end: signal.Signals, link: Link, recipe: Recipe, port: int
) -> None:
    with robot(recipe, port) as processes, watching(recipe, port) as (blobs, tracks):
        moved = blobs if service == "detector" else tracks
        wait_until(lambda: tracks.count("tracker/main") > WARM_FRAMES, "tracks", DEADLINE_S)
        with elsewhere(link, recipe, service) as remote:
            _await_warm(moved, f"{service}/remote", remote)
            _assert_the_second_is_told_of(service, processes)
            if service == "detector":
                assert "frames come as JPEG" in remote.stderr()
                assert "frames come as JPEG" not in processes["detector"].stderr()
            stopped_s = time.monotonic()
            processes[service].stop(end, 5.0)
            wait_until(
                lambda: len(tracks.used_since(stopped_s)) > AFTER_FRAMES, "tracks", DEADLINE_S
            )
            # From before, because the last message of the old one begins the pause.
            gap_s = tracks.longest_gap_s(stopped_s - LONGEST_GAP_S)
            print(f"{service} moved ({end.name}): tracks paused for {gap_s:.2f} s")
            users = {heard.producer for heard in moved.used_since(stopped_s + LONGEST_GAP_S)}
            assert users == {f"{service}/remote"}
            assert gap_s <= LONGEST_GAP_S


def _await_warm(moved: StreamWatch, producer: str, remote: Running) -> None:
    """Wait until the newcomer has seen enough frames to know the background."""

    def is_warm() -> bool:
        assert remote.alive, remote.stderr()
        return moved.count(producer) > WARM_FRAMES

    wait_until(is_warm, f"messages of {producer}", DEADLINE_S)


def _assert_the_second_is_told_of(service: str, processes: dict[str, Running]) -> None:
    consumer = processes["tracker" if service == "detector" else "follower"]
    wanted = ("two producers on", f"{service}/remote")
    wait_until(
        lambda: all(part in consumer.stderr() for part in wanted), "a warning of two producers", 5.0
    )


def test_page_and_drive_run_elsewhere(link: Link, recipe: Recipe, port: int) -> None:
    """The drive obeys the robot's follower, and the page gets JPEGs."""
    with (
        robot(recipe, port, "router", "capture", "follower") as processes,
        elsewhere(link, recipe, "web") as page, elsewhere(link, recipe, "drive") as drive,
    ):  # fmt: skip
        wait_until(lambda: "is up" in page.stderr(), "the page", DEADLINE_S)
        wait_until(lambda: "is up" in drive.stderr(), "the drive", DEADLINE_S)
        assert "frames come as JPEG" in page.stderr()
        wait_until(lambda: "told to: " in drive.stderr(), "commands at the drive", DEADLINE_S)
        processes["follower"].stop(signal.SIGKILL, 5.0)
        wait_until(lambda: "no command for" in drive.stderr(), "the watchdog", DEADLINE_S)


def test_only_users_of_the_file_get_in(link: Link, recipe: Recipe, port: int) -> None:
    known = recipe.environment(recipe.robot)
    strangers: tuple[dict[str, str], ...] = (
        {"HEEL_ZENOH__USER": known["HEEL_ZENOH__USER"], "HEEL_ZENOH__PASSWORD": "guessed"},
        known | {"HEEL_ZENOH__USER": "somebody"}, {},
    )  # fmt: skip
    knock = ("-m", "heel.services.runtime.probe", recipe.wide)
    with robot(recipe, port, "router"):
        assert finished(*knock, **known)[0] == 0
        assert [finished(*knock, **stranger)[0] for stranger in strangers] == [1, 1, 1]
        status = ("-m", "heel", "status", "--connect", recipe.wide)
        code, said, complaint = finished(*status, **strangers[0])
        assert (code, said) == (1, "")
        assert "check user and password" in complaint
        assert len(complaint.splitlines()) == 1


def test_a_router_without_users_does_not_listen_beyond_loopback(link: Link, port: int) -> None:
    code, _, complaint = finished("-m", "heel", "router", "--listen", f"tcp/{link.address}:{port}")
    assert code == 2
    assert "open to the network without authentication" in complaint
