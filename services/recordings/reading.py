"""Reading a recording from its beginning, as far as it is whole: one that was cut off, too.

The library's own readers take a record that is cut short for a whole one; here a record counts only
when all of it is there and its checksum is right.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from heel.schemas.errors import SourceError
from heel.schemas.image import MAX_IMAGE_BYTES
from heel.services.recordings.wire import ATTACHMENT_OF, ENCODING, KEY, SESSION, WireMessage
from heel.services.recordings.writing import mcap

if TYPE_CHECKING:
    from mcap.records import Channel, Schema

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")
"""Opcode and length of a record."""
_MAX_RECORD_BYTES = 16 * MAX_IMAGE_BYTES
"""Largest record that is read, 128 MB: chunks of other writers have some MB, and one with an image
in it no more than a few images. Chosen by hand."""


@dataclass(frozen=True, slots=True)
class RecordedMessage:
    """One message of any MCAP file.

    Attributes:
        channel: with the topic, the encoding and the metadata.
        schema: of the payload, None without one.
        data: payload.
        sequence: number within the recording; pairs attachments with payloads.
        logged_ns: when it was recorded.
    """

    channel: Channel
    schema: Schema | None
    data: bytes
    sequence: int
    logged_ns: int


@dataclass
class Recording:
    """An MCAP file that is read once, from its beginning.

    Attributes:
        path: of the file.
        profile: `heel`, `ros2`, or what else its writer says.
        library: the software that wrote it.
        session: what the recorder says of the recording; empty in files of others.
        metadata: further records of text, by name.
        complete: whether the file was closed by its writer; known once it is read to its end.
        whole_bytes: up to the end of the last whole record that was read.
        damage: what stands where reading ended, empty if that is the end of the file.
    """

    path: Path
    profile: str = ""
    library: str = ""
    session: dict[str, str] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    complete: bool = False
    whole_bytes: int = 0
    damage: str = ""

    def messages(self) -> Iterator[RecordedMessage]:
        """Every message that is whole, in the order of the file.

        Raises:
            SourceError: the file cannot be opened, or is no MCAP file at all.
        """
        self.complete, self.whole_bytes, self.damage = False, 0, ""
        channels: dict[int, Channel] = {}
        schemas: dict[int, Schema] = {}
        records = mcap().records
        for record in self._records():
            match record:
                case records.Schema():
                    schemas[record.id] = record
                case records.Channel():
                    channels[record.id] = record
                case records.Message() if record.channel_id in channels:
                    channel = channels[record.channel_id]
                    yield RecordedMessage(
                        channel, schemas.get(channel.schema_id), record.data, record.sequence,
                        record.log_time,
                    )  # fmt: skip
                case records.Header():
                    self.profile, self.library = record.profile, record.library
                case records.Metadata() if record.name == SESSION:
                    self.session = record.metadata
                case records.Metadata():
                    self.metadata[record.name] = record.metadata
                case records.DataEnd():
                    self.complete = True
                    return

    def _records(self) -> Iterator[Any]:
        try:
            with self.path.open("rb") as file:
                if file.read(len(_MAGIC)) != _MAGIC:
                    raise SourceError(
                        f"{self.path}: no MCAP file: record one with `heel record --out DIR`"
                    )
                self.whole_bytes = file.tell()
                while (whole := self._record(file)) is not None:
                    yield from whole
                    self.whole_bytes = file.tell()
        except OSError as error:
            raise SourceError(f"{self.path}: cannot be read ({error.strerror})") from None

    def _record(self, file: IO[bytes]) -> list[Any] | None:
        """What the next record holds; None where the file is over or damaged."""
        head = file.read(_HEAD.size)
        if len(head) < _HEAD.size:
            self.damage = "a record is cut off" if head else ""
            return None
        opcode, length = _HEAD.unpack(head)
        if length > _MAX_RECORD_BYTES:
            self.damage = f"a record of {length} bytes"
            return None
        body = file.read(length)
        if len(body) < length:
            self.damage = "a record is cut off"
            return None
        try:
            return _parsed(opcode, body)
        # Of damaged bytes the library, its decompressors and struct raise whatever they meet.
        except Exception as error:
            self.damage = f"a damaged record ({type(error).__name__})"
            return None


def _parsed(opcode: int, body: bytes) -> list[Any]:
    """The records that matter, of a record as it stands in the file.

    Raises:
        Exception: of any kind, for bytes that are damaged.
    """
    from io import BytesIO

    from mcap import records
    from mcap.data_stream import ReadDataStream
    from mcap.opcode import Opcode
    from mcap.stream_reader import breakup_chunk

    stream = ReadDataStream(BytesIO(body))
    match opcode:
        case Opcode.CHUNK:
            chunk = records.Chunk.read(stream)
            if chunk.uncompressed_size > _MAX_RECORD_BYTES:
                raise ValueError("a chunk that unpacks to too much")
            return list(breakup_chunk(chunk, validate_crc=True))
        case Opcode.MESSAGE:
            return [records.Message.read(stream, len(body))]
        case Opcode.HEADER:
            return [records.Header.read(stream)]
        case Opcode.SCHEMA:
            return [records.Schema.read(stream)]
        case Opcode.CHANNEL:
            return [records.Channel.read(stream)]
        case Opcode.METADATA:
            return [records.Metadata.read(stream)]
        case Opcode.DATA_END:
            return [records.DataEnd.read(stream)]
    return []


def wire_messages(recording: Recording) -> Iterator[WireMessage]:
    """The messages of a recording of Heel's as they went over the bus; others are left out.

    Raises:
        SourceError: as `Recording.messages`.
    """
    attachments: dict[tuple[str, str], tuple[int, bytes]] = {}
    for one in recording.messages():
        fields = one.channel.metadata
        key, encoding = fields.get(KEY), fields.get(ENCODING)
        if key is None or encoding is None:
            continue
        if ATTACHMENT_OF in fields:
            attachments[key, encoding] = one.sequence, one.data
            continue
        number, attachment = attachments.pop((key, encoding), (None, None))
        yield WireMessage(
            key, encoding, one.data, attachment if number == one.sequence else None, one.logged_ns
        )
