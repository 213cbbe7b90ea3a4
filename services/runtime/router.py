"""A Zenoh router in this process: for a machine that has no zenohd, and for `heel run`."""

from __future__ import annotations

import ipaddress
import json
import logging
import os
import socket
import stat
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

import zenoh
from pydantic import Field, model_validator

from heel.schemas import keys
from heel.schemas.errors import HeelError, SettingsError
from heel.services.runtime.certificate import days_left, ends_soon, valid_until
from heel.services.runtime.clock import monotonic_clock
from heel.services.runtime.logs import set_up_logging
from heel.services.runtime.notify import Notifier
from heel.services.runtime.process import (
    die_with_parent,
    may_lock_memory,
    software_version,
    use_all_file_descriptors,
)
from heel.services.runtime.qos import ROUTER_QUEUES, ROUTER_RULES, ROUTER_WAIT_BEFORE_CLOSE_US
from heel.services.runtime.router_log import ZENOH_FILTER, RouterLog, reading_output, standard_error
from heel.services.runtime.session import (
    LEASE_MS,
    MAX_MESSAGE_BYTES,
    POOL_BYTES,
    QUERY_TIMEOUT_S,
    check_endpoints,
    one_line,
    start_zenoh_log,
    tuned,
    why_no_room,
    why_no_shared_memory,
    with_datagrams,
)
from heel.services.runtime.settings import (
    Endpoints,
    Loaded,
    StrictSettings,
    with_addresses_of_file,
)
from heel.services.runtime.shared_memory import OWN, Sweeper
from heel.services.runtime.stop_signals import stop_signals

_LOOPBACK_NAMES = {"localhost", "ip6-localhost"}
_PORT_ATTEMPTS = 5
"""Free ports that are tried, as another process may take one first; chosen by hand."""
_GREETING_MS = 2000
"""Connections that say nothing are closed after so long: with Zenoh's 10 s, thousands of idle ones
keep a known user out."""
_MOST_GREETINGS = 1000
"""Connections that are greeted at once; Zenoh's 100 are filled by idle ones."""
_SMALL_QUERIES = {
    "id": "small-queries", "messages": ["query"], "flows": ["ingress"], "key_exprs": ["**"],
    "size_limit": 1 << 16,
}  # fmt: skip
"""Zenoh keeps up to 256 queries for the one that answers them; ours have less than 4 kB."""
_SWEEP_PERIOD_S = 0.5
"""Seconds between two looks for memory that dead processes left, and two signs of life; a quarter
of the time that `heel systemd` gives the watchdog."""


class RouterSettings(StrictSettings):
    """Where the router listens and which users it lets in."""

    listen: Endpoints = Field(
        ("tcp/127.0.0.1:7447",), description="endpoints to listen on, comma separated"
    )
    connect: Endpoints = Field(
        (),
        description="further routers to link with, comma separated: robots of one are then seen "
        "and stopped from the other",
    )
    insecure: bool = Field(
        False, description="allow listening beyond this machine without authentication"
    )
    users_file: Path | None = Field(
        None, description="file of `user:password` lines; only these users may connect"
    )
    shared_memory: bool = Field(True, description="take part in shared memory transport")
    config_file: Path | None = Field(
        None, description="Zenoh JSON5 file loaded first, e.g. router.json5 of `heel security`"
    )

    @model_validator(mode="before")
    @classmethod
    def _take_addresses(cls, data: Any) -> Any:
        return with_addresses_of_file(
            data, {"listen": "listen/endpoints", "connect": "connect/endpoints"}
        )


def router_config(settings: RouterSettings, lossless: bool = False) -> zenoh.Config:
    """Build the configuration of a router session.

    Args:
        settings: where it listens and which users it lets in.
        lossless: whether it serves a run in which nothing may be dropped, and no robot.

    Raises:
        SettingsError: it would listen beyond loopback unauthenticated, or Zenoh refuses it.
    """
    check_endpoints((*settings.listen, *settings.connect), "router")
    if settings.users_file is not None:
        check_users_file(settings.users_file)
    base = _base_config(settings.config_file)
    authenticated = settings.users_file is not None or _authenticates(base)
    for endpoint in settings.listen:
        if not (authenticated or settings.insecure or is_loopback(endpoint)):
            raise SettingsError(f"router: {endpoint} is open to the network without authentication"
                                f"{_remedy(settings)}")  # fmt: skip
    entries: list[tuple[str, object]] = [
        ("mode", "router"),
        ("listen/endpoints", [_tuned(endpoint) for endpoint in settings.listen]),
        ("connect/endpoints", [_tuned(endpoint) for endpoint in settings.connect]),
        # One that is away is no reason not to start: it is linked with once it is there.
        ("connect/timeout_ms", -1),
        ("connect/exit_on_failure", False),
        ("connect/retry", {"period_init_ms": 200, "period_max_ms": 2000}),
        ("scouting/multicast/enabled", False),
        ("queries_default_timeout", int(QUERY_TIMEOUT_S * 1000)),
        ("transport/link/tx/lease", LEASE_MS),
        ("transport/link/rx/max_message_size", MAX_MESSAGE_BYTES),
        ("low_pass_filter", [*json.loads(base.get_json("low_pass_filter")), _SMALL_QUERIES]),
        ("transport/unicast/accept_timeout", _GREETING_MS),
        ("transport/unicast/accept_pending", _MOST_GREETINGS),
        ("transport/shared_memory/enabled", settings.shared_memory and may_lock_memory()),
        ("transport/shared_memory/transport_optimization/messages", ["put"]),
        ("transport/shared_memory/transport_optimization/pool_size", POOL_BYTES),
    ]
    if settings.users_file is not None:
        entries.append(("transport/auth/usrpwd/dictionary_file", str(settings.users_file)))
    try:
        if not lossless and not json.loads(base.get_json("qos/network")):
            # A file that has rules of its own keeps them.
            entries += [
                ("qos/network", ROUTER_RULES),
                (
                    "transport/link/tx/queue/congestion_control/block/wait_before_close",
                    ROUTER_WAIT_BEFORE_CLOSE_US,
                ),
                *(
                    (f"transport/link/tx/queue/size/{priority}", batches)
                    for priority, batches in ROUTER_QUEUES.items()
                ),
            ]
        for path, value in entries:
            base.insert_json5(path, json.dumps(value))
    except zenoh.ZError as error:
        raise SettingsError(f"router: {one_line(error)}") from None
    return base


def _tuned(endpoint: str) -> str:
    """An endpoint as it serves a robot: on loopback nothing waits in the kernel."""
    return with_datagrams(endpoint) if is_loopback(endpoint) else tuned(endpoint)


def check_users_file(file: Path) -> None:
    """Refuse a users file that lets in all, or users that were not meant.

    Zenoh asks for no password if the file names no user.

    Raises:
        SettingsError: it cannot be read, others may write it, a line is not `user:password`, or
            there is none.
    """
    try:
        mode = file.stat().st_mode
        lines = file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"router: users file {file}: {error}") from None
    if mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise SettingsError(f"router: others may write users file {file}: chmod 600 {file}")
    if not any(line.strip() for line in lines):
        raise SettingsError(
            f"router: users file {file} names nobody, and would let in everybody: write a line "
            "`user:password`"
        )
    for number, line in enumerate(lines, start=1):
        user, _, password = line.strip().partition(":")
        if line.strip() and not (user.strip() and password.strip()):
            raise SettingsError(
                f"router: users file {file}, line {number}: write `user:password`, nothing else"
            )


def _base_config(file: Path | None) -> zenoh.Config:
    try:
        return zenoh.Config() if file is None else zenoh.Config.from_file(str(file))
    except zenoh.ZError as error:
        raise SettingsError(f"router: config file {file}: {one_line(error)}") from None


def _authenticates(config: zenoh.Config) -> bool:
    """Whether a configuration tells clients apart: users, certificates of clients, or rules."""
    users = json.loads(config.get_json("transport/auth/usrpwd"))["dictionary_file"]
    if users:
        check_users_file(Path(users))
    keys = json.loads(config.get_json("transport/auth/pubkey"))
    rules = json.loads(config.get_json("access_control"))
    certificates = json.loads(config.get_json("transport/link/tls"))["enable_mtls"]
    ruled = rules["enabled"] and rules["default_permission"] == "deny" and rules["subjects"]
    return bool(users or keys["known_keys_file"] or certificates or ruled)


def _remedy(settings: RouterSettings) -> str:
    if settings.config_file is None:
        return ": give --users-file or --config-file (TLS), or say --insecure if that is meant"
    return (
        f": {settings.config_file} has neither users, nor certificates of clients (enable_mtls), "
        "nor access rules that deny by default; or say --insecure if that is meant"
    )


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
        said = one_line(error)
        why = "the address is in use or not this machine's; choose another with --listen"
        if "Missing TLS" in said:
            why = "TLS needs certificates; `heel security init DIR` makes them for --config-file"
        raise HeelError(
            f"router: cannot listen on {', '.join(settings.listen)}: {why} ({said})"
        ) from None
    with session, _telling_version(session):
        yield session


@contextmanager
def _telling_version(session: zenoh.Session) -> Iterator[None]:
    told = json.dumps({
        "heel": software_version(), "zenoh": metadata.version("eclipse-zenoh"),
        "host": monotonic_clock(),
    })  # fmt: skip

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(query.key_expr, told, encoding=zenoh.Encoding.APPLICATION_JSON)

    # For every robot's name before the key.
    queryable = session.declare_queryable(f"**/{keys.ROUTER_VERSION}", answer)
    yield
    queryable.undeclare()  # type: ignore[no-untyped-call]


@contextmanager
def open_private_router(
    shared_memory: bool = True, lossless: bool = False
) -> Iterator[tuple[zenoh.Session, str]]:
    """A router on a free loopback port, and its endpoint."""
    shared_memory = shared_memory and why_no_room() is None
    for attempt in range(_PORT_ATTEMPTS):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
        settings = RouterSettings(listen=(endpoint,), shared_memory=shared_memory)
        try:
            session = zenoh.open(router_config(settings, lossless))
        except zenoh.ZError:
            # Another process took the port between the probe and the router.
            if attempt == _PORT_ATTEMPTS - 1:
                raise HeelError("router: no free loopback port in five attempts") from None
            continue
        with session, _telling_version(session):
            yield session, endpoint
        return


def run(loaded: Loaded[RouterSettings]) -> int:
    """Run a router until a signal; returns the exit code."""
    log = set_up_logging(loaded.log, "router", standard_error())
    use_all_file_descriptors()
    died = threading.Event()
    with stop_signals() as stop:
        die_with_parent()

        def end_for_a_restart() -> None:
            died.set()
            stop.set()

        with reading_output(RouterLog(log, end_for_a_restart)):
            start_zenoh_log(ZENOH_FILTER)
            try:
                _serve(loaded.service, log, stop)
            except HeelError as error:
                log.error("%s", error)
                return 2 if isinstance(error, SettingsError) else 1
    return 1 if died.is_set() else 0


def _serve(settings: RouterSettings, log: logging.Logger, stop: threading.Event) -> None:
    if settings.shared_memory and may_lock_memory() and (reason := why_no_shared_memory()):
        log.warning("no shared memory: %s; using sockets", reason)
        settings = settings.model_copy(update={"shared_memory": False})
    sweeper, notifier = Sweeper(), Notifier(os.environ, log, "router")
    with open_router(settings):
        log.info("router listens on %s", ", ".join(settings.listen))
        notifier.ready()
        until = valid_until(settings.config_file)
        if until is not None and (words := ends_soon(days_left(until))) is not None:
            log.warning("%s: `heel security renew`", words)
        if settings.insecure:
            _warn_if_open(settings, log)
        while not stop.wait(_SWEEP_PERIOD_S):
            OWN.claim_by_size(POOL_BYTES)
            sweeper.sweep(time.monotonic())
            notifier.alive(time.monotonic())


def _warn_if_open(settings: RouterSettings, log: logging.Logger) -> None:
    wide = [endpoint for endpoint in settings.listen if not is_loopback(endpoint)]
    if wide and settings.users_file is None and settings.config_file is None:
        log.warning("anybody who reaches %s can read the camera and drive", ", ".join(wide))
