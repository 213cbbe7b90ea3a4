"""Ctrl-C while a process still imports: it ends at once, without a traceback."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_end() -> Iterator[None]:
    """Around a process's imports, which take a second: Ctrl-C ends it as it would any other.

    Python's own handler would show a traceback through somebody's imports. Where Ctrl-C is ignored,
    as in what a shell starts in the background, it stays ignored.
    """
    own = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if own:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    yield
    if own:
        signal.signal(signal.SIGINT, signal.default_int_handler)
