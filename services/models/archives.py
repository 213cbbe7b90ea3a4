"""One member of a wheel (zip) or of a tarball (gzip), known by its size and its hash.

The member's name does not matter, so an archive may be made by anybody; and nothing is unpacked but
the bytes of that member, so names that lead out of a folder, links and devices do no harm.
"""

from __future__ import annotations

import gzip
import itertools
import shutil
import tarfile
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, cast

from heel.schemas.errors import HeelError
from heel.services.models.store import sha256_of

_MOST_BYTES = 256 << 20
"""Of a tarball, unpacked, as far as it is read; chosen by hand."""
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""How wheels are packed."""
_MOST_MEMBERS = 100_000
"""Of an archive; a package has a few thousand at most; chosen by hand."""


def is_archive(file: Path) -> bool:
    """Whether it begins as a wheel or a tarball does."""
    with file.open("rb") as stream:
        return stream.read(4).startswith((b"PK\x03\x04", b"\x1f\x8b"))


def take_member(archive: Path, size_bytes: int, sha256: str, out: Path) -> None:
    """Write the member of this size and hash to `out`.

    Raises:
        HeelError: there is none, or the archive is damaged, or made to fill memory or disk.
        OSError: it cannot be read, or `out` cannot be written.
    """
    try:
        for stream in _members(archive, size_bytes):
            if _digest(stream, size_bytes, out) == sha256:
                return
    except (zipfile.BadZipFile, tarfile.TarError, zlib.error, gzip.BadGzipFile,
            EOFError, RuntimeError) as error:  # fmt: skip
        out.unlink(missing_ok=True)
        raise HeelError(f"{archive}: a damaged archive ({error}): get it anew") from None
    out.unlink(missing_ok=True)
    raise HeelError(
        f"{archive}: no member of it has {size_bytes} bytes and sha256 {sha256[:12]}...: this is "
        "another package, or another version of it"
    )


def _members(archive: Path, size_bytes: int) -> Iterator[IO[bytes]]:
    """Those of the right size that are files, one after the other."""
    if zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as zipped:
            for one in zipped.infolist()[:_MOST_MEMBERS]:
                if one.file_size == size_bytes and one.compress_type in _PACKED:
                    with zipped.open(one) as stream:
                        yield stream
        return
    # Bounded before it is read as a tarball: a header may claim to be larger than memory.
    with gzip.open(archive) as unpacked:
        bounded = cast(IO[bytes], _Bounded(cast(IO[bytes], unpacked), _MOST_BYTES))
        with tarfile.open(fileobj=bounded, mode="r|") as tarred:
            for member in itertools.islice(tarred, _MOST_MEMBERS):
                if member.isfile() and member.size == size_bytes:
                    content = tarred.extractfile(member)
                    assert content is not None, "a file has content"
                    with content as stream:
                        yield stream


def _digest(stream: IO[bytes], size_bytes: int, out: Path) -> str:
    """Copy so many bytes at most, whatever the archive says of itself; returns their sha256."""
    with out.open("wb") as file:
        shutil.copyfileobj(_Bounded(stream, size_bytes + 1), file)
    return sha256_of(out)


class _Bounded:
    """The first bytes of a stream."""

    def __init__(self, stream: IO[bytes], most_bytes: int) -> None:
        self._stream, self._left = stream, most_bytes

    def read(self, size: int = -1) -> bytes:
        wanted = self._left if size < 0 else min(size, self._left)
        data = self._stream.read(wanted)
        self._left -= len(data)
        return data
