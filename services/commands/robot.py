"""The robot, or the run on this machine, that a command is meant for, and a session with it."""

from __future__ import annotations

import inspect
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Concatenate, ParamSpec, cast, get_type_hints

import typer

from heel.schemas import HeelError, Message, SettingsError, decode, encode

if TYPE_CHECKING:
    import zenoh

    from heel.services.runtime.registry import Run
    from heel.services.runtime.settings import RobotSettings, ZenohSettings

TIMEOUT_S = 2.0
"""Longest wait for the router, and for a reply [s]; answers take milliseconds. Chosen by hand."""
_LOOPBACK_TIMEOUT_S = 0.2
"""Longest wait for a connection within this machine [s], made or refused at once; chosen by
hand."""

_Connect = Annotated[
    str | None,
    typer.Option(help="router to talk to, e.g. tcp/192.168.1.7:7447", metavar="ENDPOINT"),
]
_Run = Annotated[
    int | None,
    typer.Option(
        "--run", help="one of several runs on this machine, by its process", metavar="PID"
    ),
]
_Robot = Annotated[
    str | None,
    typer.Option(
        "--robot", help="one of several runs on this machine, by its name", metavar="NAME"
    ),
]
_Namespace = Annotated[str | None, typer.Option(help="robot's name before every key")]
_User = Annotated[
    str | None, typer.Option(help="user name, where the router asks for one", metavar="NAME")
]
_PasswordFile = Annotated[
    Path | None, typer.Option(help="file that holds the password of that user", metavar="FILE")
]
_ConfigFile = Annotated[
    Path | None,
    typer.Option(help="Zenoh file, e.g. the operator's of `heel security`", metavar="FILE"),
]
_Config = Annotated[Path | None, typer.Option(help="settings file (TOML)", metavar="FILE")]
P = ParamSpec("P")


@dataclass(frozen=True)
class Where:
    """The robot that a command talks to."""

    zenoh: ZenohSettings
    run: Run | None
    """The run on this machine, if it is one."""
    stack: tuple[str, ...] = ()
    """Services that have to run, as the settings say."""

    @property
    def expected(self) -> tuple[str, ...]:
        """Services that have to run: those that the run has started, else those of the settings."""
        return self.stack if self.run is None else self.run.parts

    @property
    def router(self) -> str:
        """The router's address as text for a user."""
        return ", ".join(self.zenoh.connect)


@dataclass(frozen=True)
class RobotFlags:
    """What a user says of the robot that a command is meant for; None is a flag not given."""

    connect: _Connect = None
    run: _Run = None
    robot: _Robot = None
    namespace: _Namespace = None
    user: _User = None
    password_file: _PasswordFile = None
    config_file: _ConfigFile = None
    config: _Config = None

    def find(self) -> Where:
        """The robot that is meant: the one named, else the one run on this machine.

        Without a name and without a run it is the default router. With several it is never
        guessed: a stop must not go to another robot than the one that is meant.

        Raises:
            SettingsError: several are possible, or the one named does not run.
        """
        from heel.services.runtime.registry import runs

        settings, own = self._settings()
        named = settings.model_fields_set & {"connect", "mode", "config_file"}
        asked = self.run is not None or self.robot is not None
        try:
            found = runs()
        except HeelError:
            if asked or not named:
                raise
            found = []
        chosen: Run | None
        if asked:
            chosen = self._asked(found)
        elif named:
            chosen = next((one for one in found if (one.endpoint,) == settings.connect), None)
        else:
            chosen = _only(found, settings.connect[0])
        if chosen is not None and not named:
            settings = settings.model_copy(update={"connect": (chosen.endpoint,)})
        return Where(settings, chosen, own.stack)

    def find_all(self) -> list[tuple[Where, tuple[str, ...]]]:
        """Every router that may have robots, with the names of those that have to be there.

        The one that is named; else every run on this machine, and the default router if it is here.

        Raises:
            SettingsError: one robot is named, or nothing runs here.
        """
        from heel.services.runtime.registry import runs

        if self.run is not None or self.robot is not None:
            raise SettingsError("--all is every robot: leave out --robot and --run")
        settings, robot = self._settings()
        found: list[tuple[Where, tuple[str, ...]]] = []
        named = settings.model_fields_set & {"connect", "mode", "config_file"}
        if not named:
            found += [
                (Where(settings.model_copy(update={"connect": (run.endpoint,), "namespace": ""}),
                       run), ())
                for run in runs() if _listens(run.endpoint)
            ]  # fmt: skip
        if named or robot.robots or _listens(settings.connect[0]):
            found.append((Where(settings, None, robot.stack), robot.robots))
        if not found:
            raise SettingsError(
                "nothing runs here: no heel demo, no heel run, no router at "
                f"{settings.connect[0]}: name the router of the robots with --connect"
            )
        return found

    def _asked(self, found: list[Run]) -> Run:
        """The run that is named by its process or its robot.

        Raises:
            SettingsError: it does not run, or several have the name.
        """
        fitting = [
            one for one in found
            if self.run in (None, one.pid) and self.robot in (None, one.robot)
        ]  # fmt: skip
        if len(fitting) == 1:
            return fitting[0]
        if not fitting and self.run is not None:
            raise SettingsError(f"--run {self.run}: no run of that process; {_listed(found)}")
        if not fitting:
            raise SettingsError(f"--robot {self.robot}: no run of that name; {_listed(found)}")
        processes = ", ".join(f"--run {one.pid}" for one in fitting)
        raise SettingsError(f"--robot {self.robot}: several have that name: {processes}")

    def _settings(self) -> tuple[ZenohSettings, RobotSettings]:
        from heel.services.runtime.settings import RobotSettings, load_settings

        given = {
            "connect": self.connect, "namespace": self.namespace, "user": self.user,
            "password_file": self.password_file, "config_file": self.config_file,
        }  # fmt: skip
        flags: dict[str, dict[str, object]] = {
            "zenoh": {"connect_timeout_s": TIMEOUT_S} | {k: v for k, v in given.items() if v}
        }
        loaded = load_settings("robot", RobotSettings, flags, self.config)
        return loaded.zenoh, loaded.service


def for_robot(command: Callable[Concatenate[RobotFlags, P], None]) -> Callable[..., None]:
    """A command with the flags of `RobotFlags` in place of its first parameter."""
    hints = get_type_hints(RobotFlags, include_extras=True)
    _, *own = inspect.signature(command).parameters.values()
    own_hints = get_type_hints(command, include_extras=True)
    # Behind the command's own: `--help` begins with what the command is about.
    parameters = [
        *(parameter.replace(annotation=own_hints[parameter.name]) for parameter in own),
        *(
            inspect.Parameter(
                one.name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=hints[one.name]
            )
            for one in fields(RobotFlags)
        ),
    ]

    def with_flags(**values: Any) -> None:
        flags = RobotFlags(**{one.name: values.pop(one.name) for one in fields(RobotFlags)})
        # Checked by typer against the signature below, which mypy does not see.
        cast(Any, command)(flags, **values)

    with_flags.__doc__ = command.__doc__
    with_flags.__name__ = command.__name__
    with_flags.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    with_flags.__annotations__ = {one.name: one.annotation for one in parameters}
    return with_flags


def _only(found: list[Run], default: str) -> Run | None:
    """The one run that can be meant, None if it is the default router.

    Raises:
        SettingsError: several are possible.
    """
    # Runs in another network namespace cannot be meant: they are not reachable from here.
    found = [one for one in found if _listens(one.endpoint)]
    if len(found) > 1 or (found and _listens(default)):
        choices = [one.shown() for one in found]
        choices += [f"--connect {default} (a router)"] if _listens(default) else []
        raise SettingsError(f"{len(choices)} are possible, name one: {'; '.join(choices)}")
    return found[0] if found else None


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

    from heel.services.runtime.session import (
        open_session,
        start_zenoh_log,
        without_certificates,
        zenoh_config,
    )

    start_zenoh_log()
    # Messages of commands are small, and a stop must get through when /dev/shm is full.
    changes: dict[str, object] = {"shared_memory": False}
    if without_certificates(where.zenoh.connect, zenoh_config(where.zenoh)):
        # Waiting mends nothing, and a stop that fails is to say so at once.
        changes["connect_timeout_s"] = 0.0
    settings = where.zenoh.model_copy(update=changes)
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
    from heel.services.runtime.asking import EVERY_ANSWER, EVERYBODY, refusal

    payload = None if request is None else encode(request)
    encoding = None if request is None else request.encoding()
    for reply in session.get(
        key,
        target=EVERYBODY,
        consolidation=EVERY_ANSWER,
        payload=payload,
        encoding=encoding,
        timeout=TIMEOUT_S,
    ):
        if reply.ok is not None:
            return decode(kind, reply.ok.payload.to_bytes(), str(reply.ok.encoding))
        if (refused := refusal(reply)) is not None:
            raise HeelError(refused)
    return None
