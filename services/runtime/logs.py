"""Logging set-up: text for people, JSON lines for machines, one formatter for everything.

Much of what is logged came over the wire from a sender that need not mean well. So no character
gets through that a terminal obeys, no line break that makes a second line, no text without end,
and no flood.
"""

from __future__ import annotations

import json
import logging
import math
import sys
import time
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import IO

from heel.schemas.errors import SettingsError
from heel.services.runtime.settings import LogSettings

_STANDARD = frozenset(vars(logging.LogRecord("", 0, "", 0, "", None, None))) | {"message"}
"""Attributes that every record has; others are a caller's own."""
LONGEST_TEXT = 1000
"""Characters of a message that are written; chosen by hand, longer than any of ours."""
_LINES_PER_KIND = 5
"""Lines of one kind that are written in one period; chosen by hand."""
_LINES_IN_ALL = 60
"""Lines of all kinds below an error that are written in one period; chosen by hand."""
_LOG_BYTES = 10_000_000
"""Of a log file, after which another is begun: some days of a robot; chosen by hand."""
_OLD_LOGS = 2
"""Log files that are kept beside it; chosen by hand."""
_MAX_KINDS = 256
"""Kinds that are counted apart: bounds the memory. Chosen by hand."""


def printable(text: str, longest: int = LONGEST_TEXT) -> str:
    r"""A text from elsewhere as one line that a terminal only shows: `\x1b` in place of an escape.

    Control characters, line breaks, direction marks and lone surrogates are spelled out; what is
    longer than `longest` characters is cut.
    """
    # Cut before, too: a text of megabytes is not spelled out first.
    shown = text[: longest + 1]
    if not shown.isprintable():
        shown = "".join(
            one if one.isprintable() else one.encode("unicode_escape").decode() for one in shown
        )
    return shown if len(shown) <= longest else shown[: longest - 3] + "..."


class TextLines(logging.Formatter):
    """One line a record for people; a traceback follows indented, so that it is no line itself."""

    def __init__(self, line: str = "%(asctime)s %(levelname)-7s %(name)s: %(message)s") -> None:
        super().__init__(line, "%H:%M:%S")

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802
        """Render the one line."""
        record.message = printable(record.message)
        return super().formatMessage(record)

    def formatException(self, ei: logging._SysExcInfoType) -> str:  # noqa: N802
        """Render the traceback."""
        lines = super().formatException(ei).splitlines()
        return "\n".join(f"    {printable(line)}" for line in lines)


class JsonLines(logging.Formatter):
    """One JSON object a line; fields given as `extra=` become keys."""

    def format(self, record: logging.LogRecord) -> str:
        """Render one record."""
        line = {
            "t": time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
            + f".{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage()[:LONGEST_TEXT],
        }
        line |= {key: value for key, value in vars(record).items() if key not in _STANDARD}
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


class FloodGuard(logging.Filter):
    """Lets five lines of a kind through per second and counts the rest.

    A kind is a logger and a message before its values are filled in: "e-stop %s by %s". Whoever
    sends ten thousand stops gets ten thousand stops obeyed, and not a megabyte written. All kinds
    together get 60 lines per second; an error is always written, as one of its kind.
    """

    def __init__(self) -> None:
        super().__init__()
        self._second = 0
        self._lines = 0
        self._kinds: dict[tuple[str, str], int] = {}
        self._held_back: dict[tuple[str, str], int] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether this record is to be written; may add to it how many were not."""
        second = int(record.created)
        if second != self._second:
            self._second, self._lines = second, 0
            self._kinds.clear()
        kind = (record.name, str(record.msg)[:LONGEST_TEXT])
        lines = self._kinds.get(kind, 0)
        full = self._lines >= _LINES_IN_ALL and record.levelno < logging.ERROR
        if full or lines >= _LINES_PER_KIND:
            if kind in self._held_back or len(self._held_back) < _MAX_KINDS:
                self._held_back[kind] = self._held_back.get(kind, 0) + 1
            return False
        self._lines += 1
        if len(self._kinds) < _MAX_KINDS:
            self._kinds[kind] = lines + 1
        if held_back := self._held_back.pop(kind, 0):
            record.msg, record.args = f"{record.getMessage()} ({held_back} more like it)", None
        return True


def set_up_logging(
    settings: LogSettings, service: str, stream: IO[str] | None = None
) -> logging.Logger:
    """Send every logger to standard error, or a stream in its place; returns the service's own.

    Raises:
        SettingsError: the folder of log files cannot be written to.
    """
    stream = stream or sys.stderr
    handler = logging.StreamHandler(stream)
    handler.addFilter(FloodGuard())
    as_text = settings.format == "text" or (settings.format == "auto" and stream.isatty())
    handler.setFormatter(TextLines() if as_text else JsonLines())
    root = logging.getLogger()
    root.handlers[:] = [handler]
    if settings.folder is not None:
        root.addHandler(_file_of(settings.folder, service))
    root.setLevel(settings.level.upper())
    logging.getLogger("asyncio").setLevel(logging.WARNING)
    return logging.getLogger(f"heel.{service}")


class _LogFile(RotatingFileHandler):
    """A log file that a full disk ends the writing of, and nothing else."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802
        """Leave the line out: it is on standard error as well."""


def _file_of(folder: Path, service: str) -> logging.Handler:
    """The handler that writes a service's log file.

    Raises:
        SettingsError: the file cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handler = _LogFile(
            folder / f"{service}.log", maxBytes=_LOG_BYTES, backupCount=_OLD_LOGS, encoding="utf-8",
            errors="backslashreplace",
        )  # fmt: skip
    except OSError as error:
        raise SettingsError(
            f"log folder {folder}: {error.strerror}: name one that can be written to"
        ) from None
    handler.addFilter(FloodGuard())
    handler.setFormatter(JsonLines())
    return handler


def set_up_command_logging() -> None:
    """Send warnings of every logger to standard error, as a command speaks to a person."""
    handler = logging.StreamHandler(sys.stderr)
    handler.addFilter(FloodGuard())
    handler.setFormatter(TextLines("heel: %(message)s"))
    logging.basicConfig(handlers=[handler], level=logging.WARNING)


class OncePerSecond:
    """Lets one message of each kind through per second, and counts those it holds back."""

    def __init__(self, log: logging.Logger, period_s: float = 1.0, max_kinds: int = 64) -> None:
        self._log = log
        self._period_s = period_s
        self._max_kinds = max_kinds
        self._last_s: dict[str, float] = {}
        self._held_back: dict[str, int] = {}

    def warning(self, kind: str, message: str, now_s: float) -> None:
        """Log `message` unless one of the same kind was logged within the period."""
        last_s = self._last_s.get(kind)
        if last_s is not None and now_s - last_s < self._period_s:
            self._held_back[kind] = self._held_back.get(kind, 0) + 1
            return
        if last_s is None and len(self._last_s) >= self._max_kinds:
            self._last_s.clear()
            self._held_back.clear()
        held_back = self._held_back.pop(kind, 0)
        self._last_s[kind] = now_s
        self._log.warning(message + (f" ({held_back} more like it)" if held_back else ""))


class StateLog:
    """Logs the state of a service whenever it changes; one that flickers, once a second."""

    def __init__(self, log: logging.Logger, burst: int = 5, period_s: float = 1.0) -> None:
        """Nothing was told yet.

        Args:
            log: of the service.
            burst: changes that are logged at once, however quickly they follow one another.
            period_s: after so long there is room for one more.
        """
        self._log = log
        self._burst, self._period_s = burst, period_s
        self._told = ""
        self._room, self._last_s = float(burst), -math.inf

    def tell(self, words: str, now_s: float) -> None:
        """Call with the present state, again and again: what lasts is logged in the end."""
        if words == self._told:
            return
        self._room = min(self._burst, self._room + (now_s - self._last_s) / self._period_s)
        self._last_s = now_s
        if self._room >= 1.0:
            self._room -= 1.0
            self._told = words
            self._log.info("%s", words)
