"""Whether a Zenoh router answers at an address at all, whoever it lets in.

Zenoh says the same of a port that nobody listens on, of another server and of a wrong password. So
the first message of a handshake is sent by hand, and its answer looked at.
"""

from __future__ import annotations

import json
import socket
import struct
import threading
from contextlib import suppress
from typing import Literal

Answer = Literal["zenoh", "other", "silent", "refused", "unreachable", "unknown host"]
"""What was found: a Zenoh node; another server; one that says nothing; nobody on that port; no way
to the host, or none within the time; a name that is not known."""

_HELLO_S = 2.0
"""Longest wait for this machine's own Zenoh to greet [s]; it takes 20 ms. Chosen by hand."""
# Of Zenoh's transport protocol: the messages that a node answers a greeting with, and the bits of a
# message's first byte that name it.
_INIT = 0x01
_CLOSE = 0x03
_ID_BITS = 0x1F
_MOST_BYTES = 4096
"""Of a greeting or its answer; they have less than 200."""


def knock(host: str, port: int, timeout_s: float) -> Answer:
    """Greet what listens at an address, and go away again."""
    hello = _hello()
    try:
        with socket.create_connection((host, port), timeout_s) as line:
            line.settimeout(timeout_s)
            line.sendall(hello)
            answer = line.recv(_MOST_BYTES)
    except socket.gaierror:
        return "unknown host"
    except ConnectionRefusedError:
        return "refused"
    except ConnectionResetError:
        return "other"
    except TimeoutError:
        # Of the connection, or of the answer: told apart by trying the first alone.
        return "silent" if _opens(host, port, timeout_s) else "unreachable"
    except OSError:
        return "unreachable"
    return "zenoh" if is_zenoh(answer) else "other"


def is_zenoh(answer: bytes) -> bool:
    """Whether bytes are a Zenoh node's answer to a greeting: it goes on, or closes the session."""
    if len(answer) < 3:
        return False
    (length,) = struct.unpack_from("<H", answer)
    return length == len(answer) - 2 and answer[2] & _ID_BITS in (_INIT, _CLOSE)


def _opens(host: str, port: int, timeout_s: float) -> bool:
    with suppress(OSError), socket.create_connection((host, port), timeout_s):
        return True
    return False


def _hello() -> bytes:
    """The greeting of this machine's own version of Zenoh, as it is sent to a listener here."""
    import zenoh

    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(_HELLO_S)
        config = zenoh.Config()
        for path, value in (
            ("mode", "client"),
            ("connect/endpoints", [f"tcp/127.0.0.1:{listener.getsockname()[1]}"]),
            ("connect/timeout_ms", 0),
            ("scouting/multicast/enabled", False),
            ("transport/shared_memory/enabled", False),
        ):
            config.insert_json5(path, json.dumps(value))

        def greet() -> None:
            with suppress(zenoh.ZError):
                zenoh.open(config)

        threading.Thread(target=greet, name="greeting", daemon=True).start()
        line, _ = listener.accept()
        with line:
            line.settimeout(_HELLO_S)
            return line.recv(_MOST_BYTES)
