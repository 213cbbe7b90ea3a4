"""From messages to the bytes of an MCAP file. Pure: where the bytes go is for others to say."""

from __future__ import annotations

import functools
import json
from typing import TYPE_CHECKING, Any, cast

from heel.schemas.errors import HeelError
from heel.schemas.export import json_schemas
from heel.services.recordings.wire import (
    ATTACHMENT_OF,
    BY_ENCODING,
    ENCODING,
    KEY,
    PROFILE,
    SESSION,
    WireMessage,
    attachment_kind,
    message_encoding,
)

if TYPE_CHECKING:
    from mcap.writer import Writer

_CHUNK_BYTES = 1 << 20
"""After which a chunk is closed: small, so that a reader that wants few messages reads little."""
_MOST_CHANNELS = 1024
"""Keys and encodings told apart; bounds the memory, MCAP's own bound is 65,535. Chosen by hand."""


def mcap() -> Any:
    """The library.

    Raises:
        HeelError: it is not installed.
    """
    try:
        import mcap.writer
    except ImportError:
        raise HeelError("recordings need a library: pip install mcap") from None
    return mcap


@functools.cache
def _schemas() -> dict[str, bytes]:
    """The JSON Schema of every message, by its name."""
    return {name: json.dumps(one["schema"]).encode() for name, one in json_schemas().items()}


class _Staged:
    """What the library has written and the file has not, as a file to the library."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self._written = 0

    def write(self, data: bytes) -> int:
        """Keep the next bytes."""
        self.parts.append(data)
        self._written += len(data)
        return len(data)

    def tell(self) -> int:
        """Bytes so far."""
        return self._written

    def flush(self) -> None:
        """Nothing: it is for the caller to take them."""


class RecordingBytes:
    """The bytes of one file, in pieces that end with a whole record.

    Args:
        session: what is known of the recording itself, as text.
        library: the software that writes it, with its version.

    Raises:
        HeelError: the library is not installed.
    """

    def __init__(self, session: dict[str, str], library: str) -> None:
        writing = mcap().writer
        self._staged = _Staged()
        # Not compressed: pictures would cost more than 20 % of a core and hardly shrink.
        self._writer: Writer = writing.Writer(
            cast(Any, self._staged),
            chunk_size=_CHUNK_BYTES,
            compression=writing.CompressionType.NONE,
        )
        self._writer.start(profile=PROFILE, library=library)
        self._writer.add_metadata(SESSION, session)
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str, bool], int] = {}
        self._beside: dict[str, int] = {}
        self._number = 0
        self.left_out = 0
        """Messages on more keys than are told apart."""

    def add(self, message: WireMessage) -> None:
        """Take one message: its attachment first, then its payload."""
        channel = self._channel(message.key, message.encoding, False)
        beside = channel and message.attachment is not None
        attachments = self._channel(message.key, message.encoding, True) if beside else None
        if channel is None or (beside and attachments is None):
            self.left_out += 1
            return
        self._number = (self._number + 1) & 0xFFFFFFFF
        if attachments is not None:
            self._put(attachments, message.attachment or b"", message.logged_ns)
        self._put(channel, message.payload, message.logged_ns)

    def add_beside(
        self, topic: str, encoding: str, schema: tuple[str, str, bytes], data: bytes, logged_ns: int
    ) -> None:
        """Take a message that did not go over the bus, for viewers: it is never replayed.

        Args:
            topic: as viewers list it.
            encoding: of the data.
            schema: name, encoding and content.
            data: the message.
            logged_ns: wall clock.
        """
        channel = self._beside.get(topic)
        if channel is None:
            if len(self._channels) + len(self._beside) >= _MOST_CHANNELS:
                self.left_out += 1
                return
            if schema[0] not in self._schemas:
                self._schemas[schema[0]] = self._writer.register_schema(*schema)
            channel = self._writer.register_channel(topic, encoding, self._schemas[schema[0]])
            self._beside[topic] = channel
        self._number = (self._number + 1) & 0xFFFFFFFF
        self._put(channel, data, logged_ns)

    def add_metadata(self, name: str, fields: dict[str, str]) -> None:
        """Take a record of text."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._writer.add_metadata(name, fields)

    def flush(self) -> list[bytes]:
        """All that is there by now, as the next bytes of the file."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        return self.taken()

    def taken(self) -> list[bytes]:
        """What is finished by itself, as the next bytes of the file."""
        parts, self._staged.parts = self._staged.parts, []
        return parts

    def finish(self) -> list[bytes]:
        """The last bytes of the file, with the index by which readers find their way."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        return self.taken()

    def _put(self, channel: int, data: bytes, logged_ns: int) -> None:
        self._writer.add_message(
            channel, log_time=logged_ns, data=data, publish_time=logged_ns, sequence=self._number
        )

    def _channel(self, key: str, encoding: str, attachment: bool) -> int | None:
        known = self._channels.get((key, encoding, attachment))
        if known is not None or len(self._channels) >= _MOST_CHANNELS:
            return known
        fields = {KEY: key, ENCODING: encoding}
        if attachment:
            kind = attachment_kind(encoding)
            fields[ATTACHMENT_OF] = key
            made = self._register(f"{key}/attachment", "msgpack", kind.encoding(), fields)
        else:
            made = self._register(key, message_encoding(encoding), encoding, fields)
        self._channels[key, encoding, attachment] = made
        return made

    def _register(self, topic: str, encoding: str, schema: str, fields: dict[str, str]) -> int:
        made: int = self._writer.register_channel(topic, encoding, self._schema(schema), fields)
        return made

    def _schema(self, encoding: str) -> int:
        kind = BY_ENCODING.get(encoding)
        if kind is None:
            return 0
        if encoding not in self._schemas:
            name = f"heel.{kind.schema_name}.v{kind.version}"
            self._schemas[encoding] = self._writer.register_schema(
                name, "jsonschema", _schemas()[kind.schema_name]
            )
        return self._schemas[encoding]
