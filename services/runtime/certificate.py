"""How long the certificate of a process is still valid, as its file of `heel security` says."""

from __future__ import annotations

import datetime
import json
from contextlib import suppress
from pathlib import Path

SOON_DAYS = 30
"""Days before its end from which on a certificate is told of; chosen by hand."""


def valid_until(file: Path | None) -> datetime.datetime | None:
    """The end of the certificate in a Zenoh file of `heel security`; None: it has none."""
    import zenoh

    if file is None:
        return None
    with suppress(zenoh.ZError, ValueError, TypeError, KeyError):
        told = json.loads(zenoh.Config.from_file(str(file)).get_json("metadata"))
        return datetime.datetime.fromisoformat(told["heel"]["until"])
    return None


def days_left(until: datetime.datetime) -> float:
    """Days from now; by the wall clock, by which routers judge it as well."""
    return (until - datetime.datetime.now(datetime.UTC)) / datetime.timedelta(days=1)


def ends_soon(days: float) -> str | None:
    """That a certificate ends soon or has ended, in words; None: it does not."""
    if days <= 0:
        return f"certificate ended {-days:.0f} days ago: nothing connects with it any more"
    if days < SOON_DAYS:
        return f"certificate ends in {days:.0f} days: nothing connects from then on"
    return None
