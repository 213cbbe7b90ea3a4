"""Which services have fallen silent, judged by a process that may itself have been paused."""

from __future__ import annotations

HUNG_S = 10.0
"""Silence [s] after which a service hangs: ten times the longest period of health; chosen by
hand."""
_NAP_S = 1.0
"""Time between two looks [s] above which this process was paused itself, and messages of that time
are not read yet; chosen by hand."""


class Silences:
    """Time of the last message of each service; time in which this process was paused does not
    count."""

    def __init__(self, longest_s: float, *names: str) -> None:
        """No service is expected before its first message.

        Args:
            longest_s: longest silence that is none, seconds.
            names: of the services; messages of others are ignored.
        """
        self._longest_s, self._names = longest_s, names
        self._heard_s: dict[str, float] = {}
        self._looked_s: float | None = None

    def heard(self, name: str, now_s: float) -> None:
        """A message of a service came."""
        if name in self._names:
            self._heard_s[name] = now_s

    def forget(self, name: str) -> None:
        """A service begins anew: nothing is expected before its first message."""
        self._heard_s.pop(name, None)

    def look(self, now_s: float) -> str | None:
        """The service that has been silent for longest, if for too long; call it often."""
        if self._looked_s is not None and (nap_s := now_s - self._looked_s) > _NAP_S:
            self._heard_s = {name: at_s + nap_s for name, at_s in self._heard_s.items()}
        self._looked_s = now_s
        name = min(self._heard_s, key=self._heard_s.__getitem__, default=None)
        return name if name and now_s - self._heard_s[name] > self._longest_s else None
