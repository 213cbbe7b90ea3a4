"""Two robots on one router: `heel status --all` and the page that lists them."""

from __future__ import annotations

import json
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh
from typer.testing import CliRunner

from heel.schemas import DriveState, Message, decode, encode, keys
from heel.services.cli import app
from heel.services.runtime.router import RouterSettings, open_router
from heel.services.security.accounts import Account, as_text, hashed
from tests.support.network import client, collected, free_port, router, wait_until
from tests.support.processes import finished, running
from tests.support.web_client import DEADLINE_S
from tests.support.web_page import web_process
from tests.unit.runtime.test_robots import STACK, health

_START_S = 40.0


@contextmanager
def robot(session: zenoh.Session, name: str) -> Iterator[None]:
    """The tokens and the health of a whole robot, without its work."""
    over = threading.Event()

    def put(key: str, message: Message) -> None:
        session.put(f"{name}/{key}", encode(message), encoding=message.encoding())

    def speak() -> None:
        while not over.wait(0.25):
            for service in STACK:
                put(keys.health(service, "main"), health(service))

    speaking = threading.Thread(target=speak, daemon=True)
    with ExitStack() as stack:
        for service in STACK:
            token = session.liveliness().declare_token(f"{name}/{keys.alive(service, 'main')}")
            stack.callback(token.undeclare)
        speaking.start()
        yield
        over.set()
        speaking.join(5.0)


def asked(url: str, path: str) -> Any:
    with urllib.request.urlopen(f"{url}{path}", timeout=DEADLINE_S) as answer:
        return json.loads(answer.read())


def listed(url: str) -> dict[str, bool]:
    """Every robot on the page, and whether it lacks something."""
    return {one["name"]: bool(one["problems"]) for one in asked(url, "/api/robots")["robots"]}


def test_two_robots_are_listed_and_one_that_ends_is_missed(tmp_path: Path) -> None:
    with router() as endpoint, client(endpoint) as session, ExitStack() as second:
        pictures = session.declare_publisher(f"r1/{keys.image('front')}")
        tracks = session.declare_publisher(f"r1/{keys.tracks('front')}")
        with robot(session, "r1"), web_process(endpoint, "--robots", "all") as (url, _):
            second.enter_context(robot(session, "r2"))
            both = {"r1": False, "r2": False}
            wait_until(lambda: listed(url) == both, "two whole robots", _START_S)
            assert not pictures.matching_status.matching, "a list of robots takes no pictures"
            assert not tracks.matching_status.matching

            done = CliRunner().invoke(app, ["status", "--all", "--connect", endpoint])
            assert done.exit_code == 0, done.output
            told = [line.split()[0] for line in done.output.splitlines()]
            assert told == ["robot", "r1", "r2"]

            second.close()
            wait_until(lambda: listed(url) == both | {"r2": True}, "r2 is missed", DEADLINE_S)
            assert b"robots.js" in urllib.request.urlopen(url, timeout=DEADLINE_S).read()
            for path in ("/api/state", "/snapshot.jpg", "/ws", "/app.js", "/index.html"):
                with pytest.raises(urllib.error.HTTPError, match="404"):
                    urllib.request.urlopen(url + path, timeout=DEADLINE_S)


def test_a_stop_reaches_a_robot_on_another_router_that_is_linked(tmp_path: Path) -> None:
    far, near = (f"tcp/127.0.0.1:{free_port()}" for _ in range(2))
    off = {"shared_memory": False}
    linked = RouterSettings.model_validate({"listen": near, "connect": far} | off)
    drive = ("-m", "heel.services.drive", "--driver", "log", "--namespace", "far")
    # The first one comes later: a building's routers do not start in order.
    with open_router(linked), ExitStack() as stack:
        stack.enter_context(open_router(RouterSettings.model_validate({"listen": far} | off)))
        stack.enter_context(running(*drive, "--connect", far, HEEL_RUNTIME_DIR=str(tmp_path)))
        session = stack.enter_context(client(near))
        states = stack.enter_context(collected(session, f"far/{keys.ROBOT_DRIVE}"))

        def stopped() -> bool:
            sample = states.get(timeout=_START_S)
            while not states.empty():
                sample = states.get()
            return decode(DriveState, sample.payload.to_bytes(), str(sample.encoding)).estop

        assert not stopped()
        flags = ["--connect", near, "--namespace", "far"]
        done = CliRunner().invoke(app, ["stop", *flags])
        assert (done.exit_code, "the wheels stand" in done.output) == (0, True), done.output
        wait_until(stopped, "the drive stands", DEADLINE_S)
        # A process of its own: what was pressed after a resume was typed stays.
        code, _, error = finished("-m", "heel", "resume", "--without-follower", *flags)
        assert code == 0, error
        wait_until(lambda: not stopped(), "the drive is released", DEADLINE_S)


def test_the_list_wants_a_login_where_the_page_does(tmp_path: Path) -> None:
    users = tmp_path / "users"
    users.write_text(as_text({"ben": Account("watch", hashed("correct horse"))}))
    users.chmod(0o600)
    flags = ("--robots", "r1", "--users-file", str(users))
    with router() as endpoint, web_process(endpoint, *flags) as (url, _):
        for path in ("/api/robots", "/robots.js"):
            with pytest.raises(urllib.error.HTTPError, match="401"):
                urllib.request.urlopen(url + path, timeout=DEADLINE_S)
        assert b'id="password"' in urllib.request.urlopen(url, timeout=DEADLINE_S).read()
        body = json.dumps({"user": "ben", "password": "correct horse"}).encode()
        logging_in = urllib.request.Request(
            f"{url}/api/login", body, {"Content-Type": "application/json"}
        )
        with urllib.request.urlopen(logging_in, timeout=DEADLINE_S) as answer:
            cookie = answer.headers["Set-Cookie"].partition(";")[0]
        begun_s = time.monotonic()
        while time.monotonic() - begun_s < DEADLINE_S:
            asking = urllib.request.Request(f"{url}/api/robots", headers={"Cookie": cookie})
            with urllib.request.urlopen(asking, timeout=DEADLINE_S) as answer:
                (row,) = json.loads(answer.read())["robots"]
            if row["problems"]:
                break
        assert row["problems"][0]["words"] == "nothing is heard of it"
