"""The private folder in which the processes of one user on one machine find each other."""

from __future__ import annotations

import hashlib
import os
import re
import socket
import stat
from contextlib import suppress
from pathlib import Path

from heel.schemas.errors import SettingsError
from heel.services.runtime.process import PARENT_VARIABLE
from heel.services.runtime.settings import ZenohSettings

VARIABLE = "HEEL_RUNTIME_DIR"
"""Names another run folder: a container's volume, or one for every test."""

KEPT_VARIABLE = "HEEL_STATE_DIR"
"""Names a folder on a disk for what has to outlive a restart of everything."""
_SO_NETNS_COOKIE = 71
"""Of Linux, asm-generic/socket.h; the socket module does not name it."""
_HOST_AND_PORT = re.compile(r"[a-z-]+/(.+):(\d+)")


def run_folder() -> Path:
    """The run folder, made if it is not there: sockets and notes of what runs.

    `$HEEL_RUNTIME_DIR`, else `$XDG_RUNTIME_DIR/heel`, else `/tmp/heel-<uid>`. Only its owner may
    enter it: a user that may write here can stop the robot.

    Raises:
        SettingsError: it cannot be made, is a link, or another user owns it or may write to it.
    """
    return _private("run folder", _wanted(), VARIABLE)


def kept_folder() -> Path:
    """Where the emergency stop is written down: `$HEEL_STATE_DIR`, else the run folder.

    Raises:
        SettingsError: as `run_folder`.
    """
    named = os.environ.get(KEPT_VARIABLE)
    if not named:
        return run_folder()
    return _private("state folder", Path(named).absolute(), KEPT_VARIABLE)


def _private(what: str, folder: Path, variable: str) -> Path:
    """A folder that only this user may write to, made if it is not there.

    Raises:
        SettingsError: it cannot be made, is a link, or another user owns it or may write to it.
    """
    try:
        folder.mkdir(mode=0o700, exist_ok=True, parents=variable in os.environ)
        found = folder.lstat()
    except OSError as error:
        raise SettingsError(
            f"{what} {folder}: {error.strerror}: name another with {variable}"
        ) from None
    if not stat.S_ISDIR(found.st_mode):
        raise SettingsError(f"{what} {folder} is a link: name the folder itself: {variable}")
    if found.st_uid != os.geteuid():
        raise SettingsError(
            f"{what} {folder} belongs to user {found.st_uid}: name another with {variable}"
        )
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise SettingsError(
            f"{what} {folder}: others may write to it: `chmod 700` it, or name another with "
            f"{variable}"
        )
    return folder


def _wanted() -> Path:
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named).absolute()
    session = os.environ.get("XDG_RUNTIME_DIR")
    # After `su` the variable may still name the folder of the user that logged in.
    if session and os.path.isdir(session) and os.stat(session).st_uid == os.geteuid():
        return Path(session) / "heel"
    return Path(f"/tmp/heel-{os.geteuid()}")


def robot_name(zenoh: ZenohSettings) -> str:
    """The robot that a process with these settings works for, as a name for files of this host.

    It is made of the robot's name and of its router. All addresses of this machine are one; but
    another network namespace's are others, unless the folder is named: a container's 127.0.0.1 is
    another robot's.
    """
    where = "" if VARIABLE in os.environ else _network()
    return _digest(where, zenoh.namespace, *sorted({_router(one) for one in zenoh.connect}))


def _router(endpoint: str) -> str:
    found = _HOST_AND_PORT.fullmatch(endpoint.partition("#")[0])
    if found is None:
        return endpoint
    host, port = found.groups()
    return f"{'' if _is_own(host.strip('[]')) else host}:{port}"


def _is_own(host: str) -> bool:
    """Whether an address is this machine's, without asking a name server."""
    if host == "localhost":
        return True
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        socket.inet_pton(family, host)
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.bind((host, 0))
    except OSError:
        return False
    return True


def private_run() -> str:
    """What tells the processes of one `heel run` or `heel demo` from those of the next.

    Their routers take any free port, so that one day another one has the same.
    """
    parent = os.environ.get(PARENT_VARIABLE)
    if parent is None:
        return ""
    with suppress(OSError, IndexError):
        started = Path(f"/proc/{parent}/stat").read_text().rpartition(")")[2].split()[19]
        return _digest(parent, started)
    return _digest(parent)


def _digest(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:12]


def _network() -> str:
    """This process's network namespace; its number in /proc is given away again."""
    with suppress(OSError), socket.socket(socket.AF_UNIX) as probe:
        return probe.getsockopt(socket.SOL_SOCKET, _SO_NETNS_COOKIE, 8).hex()
    with suppress(OSError):
        return os.readlink("/proc/self/ns/net")
    return ""
