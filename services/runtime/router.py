"""A Zenoh router in this process: for a machine that has no zenohd, and for `heel run`."""

from __future__ import annotations

import ipaddress
import json
import logging
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import zenoh
from pydantic import Field

from schemas.errors import HeelError, SettingsError
from services.runtime.logs import set_up_logging
from services.runtime.process import die_with_parent, may_lock_memory
from services.runtime.service import stop_signals
from services.runtime.session import LEASE_MS, QUERY_TIMEOUT_S
from services.runtime.settings import Endpoints, Loaded, StrictSettings

_LOOPBACK_NAMES = {"localhost", "ip6-localhost"}
_PORT_ATTEMPTS = 5


class RouterSettings(StrictSettings):
    """Where the router listens and whom it lets in."""

    listen: Endpoints = Field(
        ("tcp/127.0.0.1:7447",), description="endpoints to listen on, comma separated"
    )
    insecure: bool = Field(
        False, description="allow listening beyond this machine without authentication"
    )
    users_file: Path | None = Field(
        None, description="file of `user:password` lines; only these users may connect"
    )
    shared_memory: bool = Field(True, description="take part in shared memory transport")
    config_file: Path | None = Field(
        None, description="Zenoh JSON5 file loaded first, e.g. for TLS and access control"
    )


def router_config(settings: RouterSettings) -> zenoh.Config:
    """Build the configuration of a router session.

    Raises:
        SettingsError: it would listen beyond loopback unauthenticated, or Zenoh refuses it.
    """
    authenticated = settings.users_file is not None or settings.config_file is not None
    for endpoint in settings.listen:
        if not (authenticated or settings.insecure or is_loopback(endpoint)):
            raise SettingsError(
                f"router: {endpoint} is open to the network without authentication: give "
                "--users-file or --config-file (TLS), or say --insecure if that is meant"
            )
    entries: list[tuple[str, object]] = [
        ("mode", "router"),
        ("listen/endpoints", list(settings.listen)),
        ("scouting/multicast/enabled", False),
        ("queries_default_timeout", int(QUERY_TIMEOUT_S * 1000)),
        ("transport/link/tx/lease", LEASE_MS),
        ("transport/shared_memory/enabled", settings.shared_memory and may_lock_memory()),
        ("transport/shared_memory/transport_optimization/messages", ["put"]),
    ]
    if settings.users_file is not None:
        if not settings.users_file.is_file():
            raise SettingsError(f"router: users file {settings.users_file} does not exist")
        entries.append(("transport/auth/usrpwd/dictionary_file", str(settings.users_file)))
    try:
        config = (
            zenoh.Config()
            if settings.config_file is None
            else zenoh.Config.from_file(str(settings.config_file))
        )
        for path, value in entries:
            config.insert_json5(path, json.dumps(value))
    except zenoh.ZError as error:
        raise SettingsError(f"router: {' '.join(str(error).split())[:300]}") from None
    return config


def is_loopback(endpoint: str) -> bool:
    """Whether a Zenoh endpoint such as `tcp/127.0.0.1:7447` stays on this machine."""
    protocol, _, address = endpoint.partition("/")
    if protocol in ("unixsock-stream", "unixpipe"):
        return True
    host = address.partition("#")[0].partition("?")[0].rpartition(":")[0].strip("[]")
    if host in _LOOPBACK_NAMES:
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


@contextmanager
def open_router(settings: RouterSettings) -> Iterator[zenoh.Session]:
    """A running router; other processes connect to its endpoints, this one can use it directly.

    Raises:
        HeelError: an endpoint is taken or cannot be listened on.
    """
    config = router_config(settings)
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise HeelError(
            f"router: cannot listen on {', '.join(settings.listen)}: the address is in use or not "
            f"this machine's; choose another with --listen ({' '.join(str(error).split())[:200]})"
        ) from None
    with session:
        yield session


@contextmanager
def open_private_router(shared_memory: bool = True) -> Iterator[tuple[zenoh.Session, str]]:
    """A router on a free loopback port, and its endpoint."""
    for attempt in range(_PORT_ATTEMPTS):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
        settings = RouterSettings(listen=(endpoint,), shared_memory=shared_memory)
        try:
            session = zenoh.open(router_config(settings))
        except zenoh.ZError:
            # Somebody took the port between the probe and the router.
            if attempt == _PORT_ATTEMPTS - 1:
                raise HeelError("router: no free loopback port in five attempts") from None
            continue
        with session:
            yield session, endpoint
        return


def run(loaded: Loaded[RouterSettings]) -> int:
    """Run a router until a signal; returns the exit code."""
    log = set_up_logging(loaded.log, "router")
    zenoh.init_log_from_env_or("error")
    with stop_signals() as stop:
        die_with_parent()
        try:
            with open_router(loaded.service):
                log.info("router listens on %s", ", ".join(loaded.service.listen))
                if loaded.service.insecure:
                    _warn_if_open(loaded.service, log)
                stop.wait()
        except HeelError as error:
            log.error("%s", error)
            return 2 if isinstance(error, SettingsError) else 1
    return 0


def _warn_if_open(settings: RouterSettings, log: logging.Logger) -> None:
    wide = [endpoint for endpoint in settings.listen if not is_loopback(endpoint)]
    if wide and settings.users_file is None and settings.config_file is None:
        log.warning("anybody who reaches %s can read the camera and drive", ", ".join(wide))
