"""The private folder in which the processes of one user on one machine find each other."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from schemas.errors import SettingsError

VARIABLE = "HEEL_RUNTIME_DIR"
"""Names another run folder: a container's volume, or one for every test."""


def run_folder() -> Path:
    """The run folder, made if it is not there: sockets and notes of what runs.

    `$HEEL_RUNTIME_DIR`, else `$XDG_RUNTIME_DIR/heel`, else `/tmp/heel-<uid>`. Only its owner may
    enter it: whoever may write here can stop the robot.

    Raises:
        SettingsError: it cannot be made, is a link, or somebody else owns it or may write to it.
    """
    folder = _wanted()
    try:
        folder.mkdir(mode=0o700, exist_ok=True, parents=VARIABLE in os.environ)
        found = folder.lstat()
    except OSError as error:
        raise SettingsError(
            f"run folder {folder}: {error.strerror}: name another with {VARIABLE}"
        ) from None
    if not stat.S_ISDIR(found.st_mode):
        raise SettingsError(f"run folder {folder} is a link: name the folder itself: {VARIABLE}")
    if found.st_uid != os.geteuid():
        raise SettingsError(
            f"run folder {folder} belongs to user {found.st_uid}: name another with {VARIABLE}"
        )
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise SettingsError(
            f"run folder {folder}: others may write to it: `chmod 700` it, or name another with "
            f"{VARIABLE}"
        )
    return folder


def _wanted() -> Path:
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named).absolute()
    session = os.environ.get("XDG_RUNTIME_DIR")
    # After `su` the variable may still name the folder of whoever logged in.
    if session and os.path.isdir(session) and os.stat(session).st_uid == os.geteuid():
        return Path(session) / "heel"
    return Path(f"/tmp/heel-{os.geteuid()}")
