"""The one exception family of Heel.

    HeelError                  any error that one line explains to the user
    ├── MessageError           bytes on the wire that are not the message they claim to be
    ├── KeyNameError           a name that may not stand in a key expression
    ├── SettingsError          a setting that is unknown, mistyped or out of range
    └── SourceError            a recording, camera or folder that cannot be read

Every message names the offending thing, its value and the remedy, so that the command line can
print it as it is.
"""

from __future__ import annotations


class HeelError(Exception):
    """An error that one line explains to the user, with its remedy."""


class MessageError(HeelError):
    """Bytes that are not a valid message of the expected type."""


class KeyNameError(HeelError):
    """A chunk that may not stand in a Zenoh key expression."""


class SettingsError(HeelError):
    """A setting that is unknown, of the wrong type or out of its range."""


class SourceError(HeelError):
    """A frame source that cannot be opened or read."""
