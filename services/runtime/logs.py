"""Logging set-up: text for people, JSON lines for machines, one formatter for everything."""

from __future__ import annotations

import json
import logging
import sys
import time

from services.runtime.settings import LogSettings

_STANDARD = frozenset(vars(logging.LogRecord("", 0, "", 0, "", None, None))) | {"message"}


class JsonLines(logging.Formatter):
    """One JSON object a line; fields given as `extra=` become keys."""

    def format(self, record: logging.LogRecord) -> str:
        """Render one record."""
        line = {
            "t": time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
            + f".{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        line |= {key: value for key, value in vars(record).items() if key not in _STANDARD}
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


def set_up_logging(settings: LogSettings, service: str) -> logging.Logger:
    """Send every logger to standard error and return the service's own."""
    handler = logging.StreamHandler(sys.stderr)
    as_text = settings.format == "text" or (settings.format == "auto" and sys.stderr.isatty())
    if as_text:
        handler.setFormatter(
            logging.Formatter("%(asctime)s %(levelname)-7s %(name)s: %(message)s", "%H:%M:%S")
        )
    else:
        handler.setFormatter(JsonLines())
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(settings.level.upper())
    logging.getLogger("asyncio").setLevel(logging.WARNING)
    return logging.getLogger(f"heel.{service}")


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
