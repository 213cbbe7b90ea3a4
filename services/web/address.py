"""The address under which others reach the page, and as a QR code for a phone."""

from __future__ import annotations

import socket
from contextlib import suppress
from typing import TextIO

_WILDCARDS = {"0.0.0.0": "192.0.2.1", "[::]": "2001:db8::1"}
"""For every address to listen on all, one of documentation's (RFC 5737, RFC 3849): nothing is sent
there, but the system says from which of its own it would be."""


def reachable_host(host: str) -> str:
    """An address of this machine that others can type, where it listens on all of them."""
    if host not in _WILDCARDS:
        return host
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((_WILDCARDS[host], 9))
        found: str = probe.getsockname()[0]
        return f"[{found}]" if ":" in found else found
    return socket.gethostname()


def show_code(url: str, out: TextIO) -> None:
    """Draw an address as a QR code in the terminal, where the library for it is installed."""
    try:
        import segno
    except ImportError:
        return
    segno.make(url, micro=False).terminal(out=out, compact=True)
