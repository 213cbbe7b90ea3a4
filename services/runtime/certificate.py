"""How long the certificate of a process is still valid, as its file of `heel security` says."""

from __future__ import annotations

import datetime
import json
import ssl
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

SOON_DAYS = 30
"""Days before its end from which on a certificate is told of; chosen by hand."""
CERTIFICATES_REMEDY = (
    "give a member's Zenoh file with --config-file, such as operator.json5; `heel security init "
    "DIR` makes them"
)
_VERSION = 0xA0
"""Tag of a certificate's version, of DER (ITU-T X.690)."""
_TWO_DIGIT_YEAR = 0x17
"""Tag of a time with two digits for the year, of DER."""
_LONG = 0x80
"""Bit of a length that stands in bytes of its own, of DER."""


def valid_until(file: Path | None) -> datetime.datetime | None:
    """The end of the certificate in a Zenoh file of `heel security`; None: it has none."""
    import zenoh

    if file is None:
        return None
    with suppress(zenoh.ZError, ValueError, TypeError, KeyError):
        told = json.loads(zenoh.Config.from_file(str(file)).get_json("metadata"))
        return datetime.datetime.fromisoformat(told["heel"]["until"])
    return None


def end_of_pem(file: Path) -> datetime.datetime | None:
    """The end of the first certificate in a PEM file; None: there is none that can be read.

    Read from its bytes (X.509 in DER, RFC 5280 section 4.1): the standard library tells the end of
    other people's certificates alone.
    """
    begin, end = "-----BEGIN CERTIFICATE-----", "-----END CERTIFICATE-----"
    with suppress(OSError, ValueError, IndexError, StopIteration):
        _, _, after = file.read_text(encoding="ascii").partition(begin)
        der = ssl.PEM_cert_to_DER_cert(f"{begin}{after.partition(end)[0]}{end}")
        signed = next(_parts(der))[1]
        fields = [content for tag, content in _parts(next(_parts(signed))[1]) if tag != _VERSION]
        # Serial number, algorithm, issuer, validity: not before, not after.
        _, (tag, written) = _parts(fields[3])
        form = "%y%m%d%H%M%SZ" if tag == _TWO_DIGIT_YEAR else "%Y%m%d%H%M%SZ"
        until = datetime.datetime.strptime(written.decode("ascii"), form)
        return until.replace(tzinfo=datetime.UTC)
    return None


def _parts(der: bytes) -> Iterator[tuple[int, bytes]]:
    """Tag and content of each element that stands in a row."""
    at = 0
    while at < len(der):
        tag, size, at = der[at], der[at + 1], at + 2
        if size & _LONG:
            more = size & ~_LONG
            size, at = int.from_bytes(der[at : at + more]), at + more
        yield tag, der[at : at + size]
        at += size


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
