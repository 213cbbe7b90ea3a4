"""Who may log in on the page: names, roles and hashed passwords in one file.

scrypt of the standard library, with the least work that OWASP's Password Storage Cheat Sheet names
for 16 MiB (N = 2^14, r = 8, p = 5): a fifth of a second of one core for each attempt here.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import secrets
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from heel.schemas.errors import HeelError, SettingsError
from heel.schemas.keys import chunk

PageRole = Literal["watch", "operate"]
"""Looking only; or choosing, stopping and releasing, too."""
# scrypt's costs, as that page names them.
_N = 1 << 14
_R = 8
_P = 5
_MOST_MEMORY_BYTES = 64 << 20
"""That scrypt may use: four times what it needs."""
_SALT_BYTES = 16
"""128 random bits, as the same page asks for."""
_HASH_BYTES = 32
"""256 bits: more than a password of a person holds."""
LEAST_PASSWORD = 10
"""Characters of a password: with as few attempts as the page takes, enough. Chosen by hand."""
_MOST_PASSWORD = 256
"""Characters of a password that are looked at; a longer one is refused unhashed."""


@dataclass(frozen=True, slots=True)
class Account:
    """One that may log in."""

    role: PageRole
    hashed: str


def hashed(password: str) -> str:
    """A password in the form that is kept: `scrypt$N$r$p$salt$hash`."""
    salt = secrets.token_bytes(_SALT_BYTES)
    derived = _derived(password, salt, _N, _R, _P)
    return "$".join(("scrypt", str(_N), str(_R), str(_P), _text(salt), _text(derived)))


def matches(password: str, kept: str) -> bool:
    """Whether a password is the one that was kept; takes as long for any."""
    _, n, r, p, salt, derived = kept.split("$")
    if len(password) > _MOST_PASSWORD:
        return False
    found = _derived(password, base64.b64decode(salt), int(n), int(r), int(p))
    return hmac.compare_digest(found, base64.b64decode(derived))


def new_password() -> str:
    """A random one of 80 bits, in groups that can be typed."""
    letters = base64.b32encode(secrets.token_bytes(10)).decode().lower()
    return "-".join(letters[start : start + 4] for start in range(0, 16, 4))


def checked_password(password: str) -> str:
    """The password, if it may be one.

    Raises:
        SettingsError: it is too short or too long.
    """
    if not LEAST_PASSWORD <= len(password) <= _MOST_PASSWORD:
        raise SettingsError(f"a password has {LEAST_PASSWORD} to {_MOST_PASSWORD} characters")
    return password


def read_accounts(file: Path) -> dict[str, Account]:
    """The accounts of a file.

    Raises:
        SettingsError: it cannot be read, others may read or write it, or a line is none.
    """
    try:
        mode = file.stat().st_mode
        lines = file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"users file {file}: {error}") from None
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise SettingsError(f"users file {file}: others may read or write it: chmod 600 {file}")
    accounts = {}
    for number, line in enumerate(lines, start=1):
        name, _, rest = line.partition(":")
        role, _, kept = rest.partition(":")
        if not line.strip():
            continue
        if not _is_account(name, role, kept):
            raise SettingsError(
                f"users file {file}, line {number}: not an account: make one with "
                "`heel security login`"
            )
        accounts[name] = Account("operate" if role == "operate" else "watch", kept)
    if not accounts:
        raise SettingsError(f"users file {file} names nobody: make one with `heel security login`")
    return accounts


def as_text(accounts: dict[str, Account]) -> str:
    """Accounts as they stand in a file, one a line."""
    return "".join(f"{name}:{one.role}:{one.hashed}\n" for name, one in accounts.items())


def _is_account(name: str, role: str, kept: str) -> bool:
    try:
        chunk(name)
        kind, n, r, p, salt, derived = kept.split("$")
        fine = (int(n), int(r), int(p)) == (_N, _R, _P)
        sizes = len(base64.b64decode(salt)), len(base64.b64decode(derived))
    except (ValueError, HeelError):
        return False
    return (
        kind == "scrypt" and fine and sizes == (_SALT_BYTES, _HASH_BYTES)
        and role in get_args(PageRole)
    )  # fmt: skip


def _derived(password: str, salt: bytes, n: int, r: int, p: int) -> bytes:
    return hashlib.scrypt(
        password.encode(), salt=salt, n=n, r=r, p=p, maxmem=_MOST_MEMORY_BYTES, dklen=_HASH_BYTES
    )


def _text(content: bytes) -> str:
    return base64.b64encode(content).decode()
