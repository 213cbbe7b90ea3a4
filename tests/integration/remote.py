"""A robot with an authenticated router, and another host in a network namespace of its own."""

from __future__ import annotations

import atexit
import functools
import json
import os
import re
import secrets
import shlex
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import zenoh

from heel.schemas import EndOfStream, Stamp, decode, keys
from heel.services.runtime.streams import ProducerGate
from tests.support.network import wait_until
from tests.support.processes import REPOSITORY, Running, running

PAGE = (REPOSITORY / "docs" / "guides" / "remote.md").read_text(encoding="utf-8")
SCENE = "scene:demo?width=480&height=360"
UP_S = 40.0
_BOOT_ID = "/proc/sys/kernel/random/boot_id"


@dataclass(frozen=True)
class Link:
    """A network of two hosts: this one, and the one inside the namespace."""

    namespace: str
    address: str
    """This host's address on it."""


@contextmanager
def other_network() -> Iterator[Link]:
    """A namespace joined to this one by a pair of virtual interfaces.

    Raises:
        PermissionError: this process may not make one.
    """
    tag = secrets.token_hex(3)
    name, here, there = f"heel{tag}", f"heel{tag}a", f"heel{tag}b"
    subnet = f"10.213.{secrets.randbelow(256)}"
    if not _ip("netns", "add", name):
        raise PermissionError("ip netns add")
    try:
        assert _ip("link", "add", here, "type", "veth", "peer", "name", there, "netns", name)
        assert _ip("addr", "add", f"{subnet}.1/30", "dev", here)
        assert _ip("link", "set", here, "up")
        assert _ip("-n", name, "addr", "add", f"{subnet}.2/30", "dev", there)
        assert _ip("-n", name, "link", "set", there, "up")
        assert _ip("-n", name, "link", "set", "lo", "up")
        yield Link(name, f"{subnet}.1")
    finally:
        # The pair goes with the namespace; by hand, in case it never got that far.
        _ip("link", "del", here)
        _ip("netns", "del", name)


def _ip(*arguments: str) -> bool:
    done = subprocess.run(["ip", *arguments], capture_output=True, timeout=10, check=False)
    return done.returncode == 0


class Recipe:
    """The commands of docs/guides/remote.md, with the test's own addresses in them."""

    def __init__(self, link: Link, port: int, users: Path) -> None:
        self.wide = f"tcp/{link.address}:{port}"
        text = PAGE.replace("192.168.1.7", link.address).replace("7447", str(port))
        text = text.replace("/dev/video0", f"'{SCENE}' --loop").replace("users.txt", str(users))
        password = str(users.with_name("password"))
        text = text.replace("$PWD/password", password).replace("> password", f"> {password}")
        text = text.replace("cat password", f"cat {password}")
        self.robot, self.other, _, self.more, *_ = re.findall(
            r"^```sh\n(.*?)^```$", text, re.DOTALL | re.MULTILINE
        )

    @staticmethod
    def environment(block: str) -> dict[str, str]:
        """What a block exports."""
        words = [word for line in block.splitlines() for word in shlex.split(line)
                 if line.startswith("export ")]  # fmt: skip
        return dict(word.split("=", 1) for word in words if "=" in word)

    @staticmethod
    def commands(block: str) -> dict[str, list[str]]:
        """The arguments of each `heel` command, by service."""
        lines = [shlex.split(line.removesuffix("&")) for line in block.splitlines()]
        return {words[1]: words[1:] for words in lines if words[:1] == ["heel"]}


@contextmanager
def robot(recipe: Recipe, port: int, *only: str) -> Iterator[dict[str, Running]]:
    """Every process of the robot's block, or some, started as the page says; all of them up."""
    environment = recipe.environment(recipe.robot)
    lines = [line for line in recipe.robot.splitlines() if line.startswith(("umask ", "echo "))]
    subprocess.run(
        ["sh", "-ec", "\n".join(lines)], env=os.environ | environment, check=True, timeout=5
    )
    # The page's robot has the usual port; the test has to say which one it got.
    environment["HEEL_ZENOH__CONNECT"] = f"tcp/127.0.0.1:{port}"
    with ExitStack() as stack:
        started = {
            service: stack.enter_context(running("-m", "heel", *words, **environment))
            for service, words in recipe.commands(recipe.robot).items()
            if not only or service in only
        }
        for service, process in started.items():
            wait_until(lambda process=process: _is_up(process), f"{service} is up", UP_S)
        yield started


def _is_up(process: Running) -> bool:
    assert process.alive, process.stderr()
    return " is up" in process.stderr() or "router listens" in process.stderr()


@contextmanager
def elsewhere(link: Link, recipe: Recipe, service: str) -> Iterator[Running]:
    """The other host's block for a service, run inside the namespace."""
    usual = [service, *recipe.commands(recipe.other)["detector"][1:]]
    words = recipe.commands(recipe.more).get(service, usual)
    # A host of its own: another boot, and shared memory that nobody else sees.
    disguise = (f"mount -t tmpfs tmpfs /dev/shm && mount --bind {_boot_id()} {_BOOT_ID} && "
                'exec "$@"')  # fmt: skip
    command = ["ip", "netns", "exec", link.namespace, "sh", "-c", disguise, "sh",
               sys.executable, "-m", "heel", *words]  # fmt: skip
    replaced_by_it = f"import os; os.execvp('ip', {command!r})"
    with running("-c", replaced_by_it, **recipe.environment(recipe.other)) as process:
        yield process


@functools.cache
def _boot_id() -> Path:
    """A file with the boot of the other host."""
    file = Path(tempfile.mkdtemp(prefix="heel-boot-")) / "boot_id"
    atexit.register(shutil.rmtree, file.parent)
    file.write_text("00000000-0000-4000-8000-000000000002\n", encoding="ascii")
    return file


@dataclass(frozen=True)
class Heard:
    """A message that came."""

    arrived_s: float
    """Monotonic seconds."""
    producer: str
    """`service/instance`."""
    used: bool
    """Whether a consumer would have used it, or stayed with another producer."""


class StreamWatch:
    """When messages of one stream arrived, from whom, and which of them a consumer would use."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self._heard: list[Heard] = []
        self._lock = threading.Lock()
        self._gate = ProducerGate()
        self._subscriber = session.declare_subscriber(key, self._take)

    def _take(self, sample: zenoh.Sample) -> None:
        if str(sample.encoding) == EndOfStream.encoding() or sample.attachment is None:
            return
        producer = decode(Stamp, sample.attachment.to_bytes()).producer
        now_s = time.monotonic()
        with self._lock:
            used = self._gate.accepts(producer, now_s)
            self._heard.append(Heard(now_s, producer.partition("@")[0], used))

    def count(self, producer: str) -> int:
        """Messages of one producer up to now."""
        with self._lock:
            return sum(heard.producer == producer for heard in self._heard)

    def used_since(self, start_s: float) -> list[Heard]:
        """What a consumer would have used from a time on."""
        with self._lock:
            return [heard for heard in self._heard if heard.used and heard.arrived_s >= start_s]

    def longest_gap_s(self, start_s: float) -> float:
        """Longest time without a message that a consumer would use, from a time on."""
        times_s = [start_s, *(heard.arrived_s for heard in self.used_since(start_s))]
        return max(late - early for early, late in pairwise(times_s))


@contextmanager
def watching(recipe: Recipe, port: int) -> Iterator[tuple[StreamWatch, StreamWatch]]:
    """Blobs and tracks as the robot's own services get them."""
    environment = recipe.environment(recipe.robot)
    password = Path(environment["HEEL_ZENOH__PASSWORD_FILE"]).read_text().strip()
    config = zenoh.Config()
    for path, value in (
        ("mode", "client"),
        ("connect/endpoints", [f"tcp/127.0.0.1:{port}"]),
        ("scouting/multicast/enabled", False),
        ("transport/auth/usrpwd/user", environment["HEEL_ZENOH__USER"]),
        ("transport/auth/usrpwd/password", password),
    ):
        config.insert_json5(path, json.dumps(value))
    with zenoh.open(config) as session:
        yield StreamWatch(session, keys.blobs("front")), StreamWatch(session, keys.tracks("front"))
