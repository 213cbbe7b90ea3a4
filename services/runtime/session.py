"""Opening a Zenoh session from settings, with a deadline and a word to the user."""

from __future__ import annotations

import json
import logging
import os
import re
import secrets
import time
from collections.abc import Callable, Iterable

import zenoh
from zenoh.shm import JustAlloc, ShmProvider

from heel.schemas.errors import HeelError, SettingsError
from heel.services.runtime.certificate import CERTIFICATES_REMEDY
from heel.services.runtime.process import may_lock_memory
from heel.services.runtime.settings import ZenohSettings
from heel.services.runtime.shared_memory import OWN, SHARED_MEMORY, free_bytes, full_share

QUERY_TIMEOUT_S = 2.0
"""Seconds after which a query is over where it does not say; answers take milliseconds."""
_RETRY_PERIOD_S = 0.2
"""Seconds between two attempts to connect; chosen by hand."""
_SHORTEST_OPEN_S = 1.0
"""Least time for one attempt to connect [s]; a handshake takes milliseconds here and a few round
trips elsewhere. Chosen by hand."""
_LONGEST_OPEN_S = 10.0
"""Longest time for one [s]: Zenoh's own, which it waits for each address, also where nobody listens
on UDP or QUIC, or a TCP port is open and silent."""
# A bounded kernel send buffer keeps a stop message from queueing behind frames on a slow link
# (340 ms -> 32 ms at 20 Mbit/s) and costs nothing visible on a fast one.
_SEND_BUFFER = "so_sndbuf=32768"
LEASE_MS = 3000
_DATAGRAMS = {"udp": "mixed_rel=1;rel=1", "quic": "mixed_rel=1"}
"""What makes QUIC of an endpoint, with datagrams for what is sent as best effort (`TopicQos`) and
streams that repeat what is lost for the rest. Zenoh's plain UDP loses declarations and queries; its
`udp` with `rel=1` is QUIC without TLS."""
MAX_MESSAGE_BYTES = 16 << 20
"""What a process takes off the wire at most, whatever the topic: twice the largest image. Zenoh's
own bound is 1 GiB, which one message of 900 MB took of the router and of every receiver."""
LOG_FILTER = "error,zenoh_transport::unicast::establishment::open=off"
"""What Zenoh may log of itself, to standard output. A refused connection is ours to report: Zenoh
would do so at every attempt, five times a second."""
POOL_BYTES = (4 << 20) + 8 * secrets.randbelow(1 << 17)
"""Shared memory for results, 4 to 5 MiB: by its very size it is told from other processes' pools
(`shared_memory.Ledger`); frames have a pool of their own (`frame_memory`). Zenoh's 16 MiB are
locked in every process that sends and mapped by every one that receives, 20 ms each the first time
and 12 MB more of each (measured)."""
_LEAST_ROOM_BYTES = 2 << 20
"""Free shared memory below which none is used. Zenoh's index takes 1.3 MB of it, the greeting of
each session 12 kB; where there is less, Zenoh does not refuse but panics (measured)."""
_ZENOH_SOURCE = re.compile(r"\s+at /\S+\.rs:\d+\.?")
_SECURED = ("tls/", "quic/")
"""Endpoints at which both sides show certificates."""
_ENDPOINT = re.compile(
    r"(?:tcp|udp|tls|quic|ws)/[^\s?#]+:(?P<port>[0-9]{1,5})(?:[?#]\S*)?"
    r"|(?:serial|vsock|unixpipe|unixsock-stream)/\S+"
)
_MOST_PORT = 65535
"""Greatest number of a port."""


def zenoh_config(settings: ZenohSettings) -> zenoh.Config:
    """Build the Zenoh configuration of a service.

    Raises:
        SettingsError: Zenoh refuses the configuration file or an endpoint.
    """
    check_endpoints((*settings.connect, *settings.listen), "zenoh")
    try:
        if settings.config_file is not None:
            config = zenoh.Config.from_file(str(settings.config_file))
        else:
            config = zenoh.Config()
        for path, value in _entries(settings):
            config.insert_json5(path, json.dumps(value))
    except zenoh.ZError as error:
        raise SettingsError(f"zenoh: {one_line(error)}: check [zenoh] in the settings") from None
    return config


def _entries(settings: ZenohSettings) -> list[tuple[str, object]]:
    entries: list[tuple[str, object]] = [
        ("mode", settings.mode),
        ("connect/endpoints", [tuned(endpoint) for endpoint in settings.connect]),
        ("connect/timeout_ms", 0),
        ("transport/unicast/open_timeout", _open_timeout_ms(settings)),
        ("connect/retry", {"period_init_ms": 200, "period_max_ms": 300}),
        ("scouting/multicast/enabled", False),
        ("queries_default_timeout", int(QUERY_TIMEOUT_S * 1000)),
        ("transport/link/tx/lease", LEASE_MS),
        ("transport/link/rx/max_message_size", MAX_MESSAGE_BYTES),
        ("transport/shared_memory/enabled", settings.shared_memory and may_lock_memory()),
        # Large queries may hang on the shared memory path (zenoh issue 2628).
        ("transport/shared_memory/transport_optimization/messages", ["put"]),
        ("transport/shared_memory/transport_optimization/pool_size", POOL_BYTES),
    ]
    if settings.listen:
        entries.append(("listen/endpoints", [with_datagrams(one) for one in settings.listen]))
    elif settings.mode == "peer":
        # A peer that cannot be reached loses data silently; an ephemeral loopback port is the
        # least that works (measured).
        entries.append(("listen/endpoints", ["tcp/127.0.0.1:0"]))
    if settings.namespace:
        entries.append(("namespace", settings.namespace))
    if settings.user is not None:
        entries.append(("transport/auth/usrpwd/user", settings.user))
        entries.append(("transport/auth/usrpwd/password", settings.secret()))
    return entries


def _open_timeout_ms(settings: ZenohSettings) -> int:
    """Of one address: Zenoh tries them one after the other."""
    in_all_s = min(_LONGEST_OPEN_S, max(_SHORTEST_OPEN_S, settings.connect_timeout_s))
    return int(1e3 * in_all_s / max(1, len(settings.connect)))


def tuned(endpoint: str) -> str:
    """An endpoint that leads to other hosts, as it serves a robot; what it says itself is kept.

    Over TCP with little room in the kernel for what waits; over UDP and QUIC with datagrams.
    """
    if endpoint.startswith(("tcp/", "tls/")) and "#" not in endpoint:
        return f"{endpoint}#{_SEND_BUFFER}"
    return with_datagrams(endpoint)


def with_datagrams(endpoint: str) -> str:
    """An endpoint of UDP or QUIC with datagrams beside streams, unless it says something itself."""
    datagrams = _DATAGRAMS.get(endpoint.partition("/")[0])
    if datagrams is None or "?" in endpoint:
        return endpoint
    address, hash_sign, configuration = endpoint.partition("#")
    return f"{address}?{datagrams}{hash_sign}{configuration}"


def one_line(error: Exception) -> str:
    """What Zenoh says, without the places in its own source that it adds."""
    return " ".join(_ZENOH_SOURCE.sub("", str(error)).split())[:300]


def start_zenoh_log(default: str = LOG_FILTER) -> None:
    """Let Zenoh log what `RUST_LOG` asks for, or `default`; never its configuration.

    At level debug it writes that out whole, the password included.
    """
    if asked := os.environ.get("RUST_LOG"):
        os.environ["RUST_LOG"] = f"{asked},zenoh::api::session=info"
    zenoh.init_log_from_env_or(default)


def check_endpoints(endpoints: Iterable[str], table: str) -> None:
    """Refuse what is no endpoint: Zenoh finds out when it connects, again and again.

    Raises:
        SettingsError: names the first one that is none.
    """
    for endpoint in endpoints:
        found = _ENDPOINT.fullmatch(endpoint)
        if found is None or int(found["port"] or 0) > _MOST_PORT:
            raise SettingsError(
                f"{table}: {endpoint[:80]!r} is not an endpoint: write one like tcp/127.0.0.1:7447"
            )


def with_usable_shared_memory(settings: ZenohSettings, log: logging.Logger) -> ZenohSettings:
    """The settings, without shared memory where this process cannot have it; that is logged."""
    if not settings.shared_memory:
        return settings
    if not may_lock_memory():
        # The rule for ordinary users, and nothing is wrong with it.
        log.info("no shared memory: this user may lock too little (ulimit -l); using sockets")
    elif (reason := why_no_shared_memory()) is None:
        return settings
    else:
        log.warning("no shared memory: %s; using sockets", reason)
    return settings.model_copy(update={"shared_memory": False})


def why_no_shared_memory() -> str | None:
    """Why shared memory cannot be used, None if it can; makes Zenoh take its index of it.

    Zenoh takes the index with the first large message, in a thread of its own: where `/dev/shm` was
    full by then, the thread of a router panicked and no frame passed any more (measured).
    """
    if (reason := why_no_room()) is not None:
        return reason
    try:
        with OWN.claiming():
            ShmProvider.default_backend(8192).alloc(1, JustAlloc())
    except zenoh.ZError as error:
        share = full_share()
        full = "missing" if share is None else f"{share:.0%} full"
        return f"{SHARED_MEMORY} is {full}: make it larger ({one_line(error)})"
    return None


def why_no_room() -> str | None:
    """Why shared memory is not to be begun with, None if there is room; takes nothing of it."""
    room = free_bytes()
    if room is None or room >= _LEAST_ROOM_BYTES:
        return None
    return f"{SHARED_MEMORY} has {room >> 10} kB left: make it larger"


def open_session(
    settings: ZenohSettings, log: logging.Logger, stopping: Callable[[float], bool]
) -> zenoh.Session | None:
    """Open a session, waiting for the router up to `connect_timeout_s`.

    Args:
        settings: where and how to connect.
        log: told once that the router is awaited.
        stopping: waits so many seconds and says whether the process was told to stop.

    Returns:
        The session, or None if the process was told to stop meanwhile.

    Raises:
        HeelError: no router within the time, or it refuses us.
    """
    config = zenoh_config(settings)
    deadline_s = time.monotonic() + settings.connect_timeout_s
    told = False
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            missing = without_certificates(settings.connect, config)
            where = ", ".join(settings.connect)
            if time.monotonic() >= deadline_s:
                why = (
                    f"no session with {where}: {missing}: {CERTIFICATES_REMEDY}" if missing
                    else f"no Zenoh router at {where} within {settings.connect_timeout_s:g} s, or "
                    f"it {_refusal(settings.connect)}"
                )  # fmt: skip
                raise HeelError(f"{why} ({one_line(error)})") from None
            if not told:
                log.info("waiting for a router at %s%s", where, missing and f": {missing}")
                told = True
        if stopping(_RETRY_PERIOD_S):
            return None


def _refusal(endpoints: tuple[str, ...]) -> str:
    """What else it may be than a router that is not there, and what to do."""
    if any(one.startswith(_SECURED) for one in endpoints):
        return (
            "does not take this certificate: start one with `heel router`, name another with "
            "--connect, or look into the router's log"
        )
    return (
        "does not know the user: start one with `heel router`, name another with --connect, or "
        "check user and password; `heel doctor` tells which it is"
    )


def without_certificates(endpoints: Iterable[str], config: zenoh.Config) -> str:
    """That an endpoint of TLS or QUIC is without certificates, in words; "" where all have them.

    Zenoh says of it what it says where nobody listens. It may be right: a router whose certificate
    is a public authority's may ask for none.
    """
    forms = ("root_ca_certificate", "root_ca_certificate_base64")
    if any(json.loads(config.get_json(f"transport/link/tls/{form}")) for form in forms):
        return ""
    for endpoint in endpoints:
        if endpoint.startswith(_SECURED) and "certificate" not in endpoint.partition("#")[2]:
            return f"{endpoint.partition('/')[0]}/ needs certificates, and none are given"
    return ""
