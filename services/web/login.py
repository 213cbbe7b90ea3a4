"""Logging in on the page: how many attempts there may be, and whom a cookie stands for."""

from __future__ import annotations

import ipaddress
import secrets
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path

from heel.services.security.accounts import Account, PageRole, hashed, matches, read_accounts

_BURST = 5
"""Wrong passwords in a row from one address or for one name without a wait; chosen by hand."""
_EVERY_S = 12.0
"""Seconds to each further one: five a minute, 7,200 a day, of 2^80 that a password made here may
be. Chosen by hand."""
_MOST_REMEMBERED = 4096
"""Addresses and names of which attempts are remembered, the latest; chosen by hand."""
_MOST_SESSIONS = 256
"""Browsers that are logged in at the same time; the one unused for longest gives way."""
IDLE_S = 12 * 3600.0
"""A session that is not used ends so late: longer than a working day. Chosen by hand."""
LONGEST_S = 7 * 86400.0
"""A session ends at the latest; chosen by hand."""


class Attempts:
    """How long an address, or anybody that tries one name, has to wait for the next attempt.

    Only failures cost: a bucket of `_BURST` that fills by one every `_EVERY_S`.
    """

    def __init__(self) -> None:
        self._full_s: OrderedDict[str, float] = OrderedDict()
        """When the bucket of each is full again."""

    def wait_s(self, address: str, user: str, now_s: float) -> float:
        """Seconds until the next attempt may be made; 0: now."""
        due_s = max(self._full_s.get(key, 0.0) for key in self._keys(address, user))
        return max(0.0, due_s - (_BURST - 1) * _EVERY_S - now_s)

    def failed(self, address: str, user: str, now_s: float) -> None:
        """A wrong name or password."""
        for key in self._keys(address, user):
            self._full_s[key] = max(self._full_s.get(key, 0.0), now_s) + _EVERY_S
            self._full_s.move_to_end(key)
            while len(self._full_s) > _MOST_REMEMBERED:
                self._full_s.popitem(last=False)

    def right(self, address: str, user: str) -> None:
        """The attempt that was noted last had the right password: it costs nothing."""
        for key in self._keys(address, user):
            if key in self._full_s:
                self._full_s[key] -= _EVERY_S

    @staticmethod
    def _keys(address: str, user: str) -> tuple[str, str]:
        # One host has a whole /64 of IPv6.
        try:
            whole = ipaddress.ip_address(address)
            network = ipaddress.ip_network((whole, 64 if whole.version == 6 else 32), strict=False)
            address = str(network)
        except ValueError:
            pass
        return f"from {address}", f"for {user[:64]}"


@dataclass(slots=True)
class Session:
    """A browser that is logged in."""

    user: str
    role: PageRole
    begun_s: float
    used_s: float


class Sessions:
    """Browsers that are logged in, by the secret in their cookie. Forgotten when the page ends."""

    def __init__(self) -> None:
        self._open: OrderedDict[str, Session] = OrderedDict()

    def begin(self, user: str, role: PageRole, now_s: float) -> str:
        """Log a browser in; the secret for its cookie."""
        token = secrets.token_urlsafe(32)
        self._open[token] = Session(user, role, now_s, now_s)
        while len(self._open) > _MOST_SESSIONS:
            self._open.popitem(last=False)
        return token

    def find(self, token: str | None, now_s: float) -> Session | None:
        """The session of a cookie, None if there is none or it is over."""
        session = self._open.get(token) if token else None
        if session is None or token is None:
            return None
        if now_s - session.used_s > IDLE_S or now_s - session.begun_s > LONGEST_S:
            del self._open[token]
            return None
        session.used_s = now_s
        self._open.move_to_end(token)
        return session

    def end(self, token: str | None) -> None:
        """Log a browser out."""
        if token is not None:
            self._open.pop(token, None)


class Login:
    """Accounts of a file, attempts and sessions.

    Args:
        file: of accounts; read again when it has changed.

    Raises:
        SettingsError: it cannot be used.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._read_ns = -1
        self._accounts: dict[str, Account] = {}
        # As long as for a known name, or the time would tell which are known.
        self._nobody = hashed(secrets.token_hex())
        self.attempts = Attempts()
        self.sessions = Sessions()
        self._renew()

    def role_of(self, user: str, password: str) -> PageRole | None:
        """The role of somebody with the right password, None for others. Takes a fifth of a second.

        Raises:
            SettingsError: the file has changed and cannot be used.
        """
        self._renew()
        account = self._accounts.get(user)
        kept = self._nobody if account is None else account.hashed
        right = matches(password, kept)
        return account.role if account is not None and right else None

    def _renew(self) -> None:
        changed_ns = self._file.stat().st_mtime_ns if self._file.exists() else 0
        if changed_ns != self._read_ns:
            self._accounts = read_accounts(self._file)
            self._read_ns = changed_ns
