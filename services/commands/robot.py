"""The robot, or the run on this machine, that a command is meant for, and a session with it."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heel.schemas import HeelError, Message, SettingsError, decode, encode

if TYPE_CHECKING:
    import zenoh

    from heel.services.runtime.registry import Run
    from heel.services.runtime.settings import ZenohSettings

TIMEOUT_S = 2.0
"""Longest wait for the router, and for a reply [s]; answers take milliseconds. Chosen by hand."""
_LOOPBACK_TIMEOUT_S = 0.2
"""Longest wait for a connection within this machine [s], made or refused at once; chosen by
hand."""

Connect = Annotated[
    str | None,
    typer.Option(help="router to talk to, e.g. tcp/192.168.1.7:7447", metavar="ENDPOINT"),
]
RunOption = Annotated[
    int | None,
    typer.Option(
        "--run", help="one of several runs on this machine, by its process", metavar="PID"
    ),
]
Namespace = Annotated[str | None, typer.Option(help="robot's name before every key")]
Config = Annotated[Path | None, typer.Option(help="settings file (TOML)", metavar="FILE")]


@dataclass(frozen=True)
class Where:
    """The robot that a command talks to."""

    zenoh: ZenohSettings
    run: Run | None
    """The run on this machine, if it is one."""

    @property
    def router(self) -> str:
        """The router's address as text for a user."""
        return ", ".join(self.zenoh.connect)


def find(connect: str | None, run: int | None, namespace: str | None, config: Path | None) -> Where:
    """The robot that a command is meant for: the one named, else the one run on this machine.

    Without a name and without a run it is the default router. With several it is never guessed:
    a stop must not go to another robot than the one that is meant.

    Raises:
        SettingsError: several are possible, or the one named does not run.
    """
    from heel.services.runtime.registry import runs
    from heel.services.runtime.settings import StrictSettings, load_settings

    given = {"connect": connect, "namespace": namespace}
    flags: dict[str, dict[str, object]] = {
        "zenoh": {"connect_timeout_s": TIMEOUT_S} | {k: v for k, v in given.items() if v}
    }
    settings = load_settings("run", StrictSettings, flags, config).zenoh
    named = settings.model_fields_set & {"connect", "mode", "config_file"}
    try:
        found = runs()
    except HeelError:
        if run is not None or not named:
            raise
        found = []
    if run is not None:
        chosen = next((one for one in found if one.pid == run), None)
        if chosen is None:
            raise SettingsError(f"--run {run}: no run of that process; {_listed(found)}")
    elif named:
        chosen = next((one for one in found if (one.endpoint,) == settings.connect), None)
    else:
        # Runs in another network namespace cannot be meant: they are not reachable from here.
        found = [one for one in found if _listens(one.endpoint)]
        chosen = found[0] if found else None
        if len(found) > 1 or (found and _listens(settings.connect[0])):
            default = [f"--connect {settings.connect[0]} (a router)"]
            choices = [one.shown() for one in found]
            choices += default if _listens(settings.connect[0]) else []
            raise SettingsError(f"{len(choices)} are possible, name one: {'; '.join(choices)}")
    if chosen is None or named:
        return Where(settings, chosen)
    update: dict[str, object] = {"connect": (chosen.endpoint,)}
    if namespace is None and chosen.namespace:
        update["namespace"] = chosen.namespace
    return Where(settings.model_copy(update=update), chosen)


def _listed(found: list[Run]) -> str:
    return "; ".join(one.shown() for one in found) if found else "nothing runs here"


def _listens(endpoint: str) -> bool:
    """Whether a process listens at an endpoint of this machine."""
    host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
    try:
        with socket.create_connection((host.strip("[]"), int(port)), _LOOPBACK_TIMEOUT_S):
            return True
    except (OSError, ValueError):
        return False


@contextmanager
def session_with(where: Where) -> Iterator[zenoh.Session]:
    """A session with the robot's router.

    Raises:
        HeelError: it cannot be reached.
    """
    import logging

    from heel.services.runtime.session import open_session, start_zenoh_log

    start_zenoh_log()
    # Messages of commands are small, and a stop must get through when /dev/shm is full.
    settings = where.zenoh.model_copy(update={"shared_memory": False})
    session = open_session(settings, logging.getLogger("heel"), _pause)
    assert session is not None
    with session:
        yield session


def _pause(seconds: float) -> bool:
    return threading.Event().wait(seconds)


def ask(
    session: zenoh.Session, key: str, kind: type[Message], request: Message | None = None
) -> Message | None:
    """The first good reply on a key, None without a reply.

    Raises:
        HeelError: the process that answers refuses.
    """
    payload = None if request is None else encode(request)
    encoding = None if request is None else request.encoding()
    for reply in session.get(key, payload=payload, encoding=encoding, timeout=TIMEOUT_S):
        if reply.ok is not None:
            return decode(kind, reply.ok.payload.to_bytes(), str(reply.ok.encoding))
        if reply.err is not None:
            raise HeelError(reply.err.payload.to_bytes().decode(errors="replace"))
    return None
