"""Which monotonic clock this process reads."""

from __future__ import annotations

import functools
import os
import re
import secrets
from pathlib import Path

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_TIME_NAMESPACE = Path("/proc/self/ns/time")


@functools.cache
def monotonic_clock() -> str:
    """A name that two processes share exactly when their monotonic clocks show the same time.

    It is the boot of the host and the time namespace (a container may shift its clock). Where the
    system tells neither, no other process shares it.
    """
    try:
        boot = re.sub(r"[^0-9a-f-]", "", _BOOT_ID.read_text(encoding="ascii"))
    except (OSError, UnicodeDecodeError):
        return secrets.token_hex(16)
    try:
        namespace = re.sub(r"[^0-9]", "", os.readlink(_TIME_NAMESPACE))
    except OSError:
        # Before Linux 5.6 there are none.
        namespace = "0"
    return f"{boot[:40]}-{namespace[:20]}"
