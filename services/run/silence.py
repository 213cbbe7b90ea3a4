"""Which services have fallen silent, judged by a process that may itself have been held up."""

from __future__ import annotations

HUNG_S = 10.0
"""A service speaks of its health once a second: one that is silent for so long hangs."""
_NAP_S = 1.0
"""A process that looks less often than this was held up: what came meanwhile is not read yet."""


class Silences:
    """When each of several was heard last; the time in which nobody listened does not count."""

    def __init__(self, longest_s: float, *names: str) -> None:
        """Nobody is expected yet: each is from when it was first heard.

        Args:
            longest_s: silence that is remarkable, seconds.
            names: the services listened to; messages of others count for nothing.
        """
        self._longest_s, self._names = longest_s, names
        self._heard_s: dict[str, float] = {}
        self._looked_s: float | None = None

    def heard(self, name: str, now_s: float) -> None:
        """A message of a service came."""
        if name in self._names:
            self._heard_s[name] = now_s

    def look(self, now_s: float) -> str | None:
        """The service that has been silent for longest, if for too long; call it often."""
        if self._looked_s is not None and (nap_s := now_s - self._looked_s) > _NAP_S:
            self._heard_s = {name: at_s + nap_s for name, at_s in self._heard_s.items()}
        self._looked_s = now_s
        name = min(self._heard_s, key=self._heard_s.__getitem__, default=None)
        return name if name and now_s - self._heard_s[name] > self._longest_s else None
