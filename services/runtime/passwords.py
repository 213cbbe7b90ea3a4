"""Addresses of cameras without the passwords in them, fit for logs, errors and messages."""

from __future__ import annotations

import re

ESCAPES = "write @ / ? # in a password as %40 %2F %3F %23"
"""What helps where an address with a user in it is misread."""

# As far as the last @ of the word: where a / ? # or @ was not escaped, the password is there.
# Better a path with an @ that is shown too short than half a password.
_USER = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*:/{1,3})[^\s'\"]*@")
_BARE_USER = re.compile(r"(?<![^\s'\"(=,])[A-Za-z0-9_.+-]+:[^\s'\"/][^\s'\"]*@(?=[^\s'\"]+)")
# Names that cameras give it: ?pwd= ?passwd= ?loginpas= ?p=, and XMeye's user=admin&password=X&...
# or user=admin_password=X_... in the path.
_VALUE = re.compile(
    r"((?:^|(?<=[?&;/_,]))"
    r"(?:[a-z0-9.-]*(?:pass?|passwd|password|passphrase|pwd|psw|pswd|secret|token|auth)"
    r"|pw|p|key|(?:api|stream|access)[_-]?key|sig|signature))=[^&;\s'\"]*",
    re.IGNORECASE,
)


def without_passwords(text: str) -> str:
    """A text with `***` for every password that stands in an address in it.

    Hidden are user and password before a host, whatever characters are in them, and the values of
    what cameras name a password in path or query: `?user=admin&pwd=***`.
    """
    text = _USER.sub(r"\1***@", text)
    text = _BARE_USER.sub("***@", text)
    return _VALUE.sub(r"\1=***", text)


def may_hold_unescaped(address: str) -> bool:
    """Whether characters that end a host stand before an @: part of a password, most likely."""
    before, at, _ = address.partition("://")[2].rpartition("@")
    return bool(at) and any(character in before for character in "/?#@")
