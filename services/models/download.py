"""A file from an address into a folder: bounded in size and time, and taken up where it broke off.

pooch, which keeps files of known hashes as well, begins anew whenever a connection breaks; over a
robot's wireless link that may never end. So this asks for the rest itself.
"""

from __future__ import annotations

import asyncio
import errno
from collections.abc import Callable
from pathlib import Path

import aiohttp

from heel.schemas.errors import HeelError
from heel.services.runtime.passwords import without_passwords

Progress = Callable[[int, int | None], None]
"""Told the bytes that are there, and of how many; None where the server does not say."""

_CHUNK_BYTES = 1 << 16
"""Most that is written at once; chosen by hand."""
_CONNECT_S = 20.0
"""Longest wait for a connection [s], also over a satellite; chosen by hand."""
_SILENCE_S = 30.0
"""Longest wait for the next bytes [s]; chosen by hand."""
_IN_ALL_S = 3600.0
"""Longest download [s]: the largest file at 0.6 Mbit/s; chosen by hand."""
_TRIES = 4
"""Connections that may break without one new byte from each; chosen by hand."""
_PAUSE_S = 0.5
"""Before the next connection [s], so that a server that is starting again is not hammered; chosen
by hand."""
_REDIRECTS = 5
"""Longest chain of redirects that is followed; two lead to any file of a public site."""


class _BrokenError(Exception):
    """The connection broke; what came so far is kept."""


def download(url: str, part: Path, limit_bytes: int, progress: Progress) -> bool:
    """Bring the file at an address whole into `part`; what `part` holds already is its beginning.

    A break is mended by asking for the rest. Once that has failed, too, `part` stays for the next
    call.

    Args:
        url: http or https.
        part: file to append to.
        limit_bytes: largest file that is taken.
        progress: told as bytes come.

    Returns:
        Whether the beginning was that of an earlier call.

    Raises:
        HeelError: the server cannot be reached, says no, or sends too much or too slowly; the disk
            is full.
    """
    resumed = part.exists() and part.stat().st_size > 0
    try:
        asyncio.run(asyncio.wait_for(_whole(url, part, limit_bytes, progress), _IN_ALL_S))
    except TimeoutError:
        raise HeelError(
            f"{_shown(url)}: not whole within {_IN_ALL_S / 60:.0f} minutes: call it again to go on "
            "from there, or bring the file with --from FILE"
        ) from None
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            part.unlink(missing_ok=True)
        raise
    return resumed


async def _whole(url: str, part: Path, limit_bytes: int, progress: Progress) -> None:
    # `trust_env`: proxies and the file of certificates are named by the usual variables.
    timeout = aiohttp.ClientTimeout(
        total=None, sock_connect=_CONNECT_S, connect=_CONNECT_S, sock_read=_SILENCE_S
    )
    failures, most = 0, 0
    async with aiohttp.ClientSession(timeout=timeout, trust_env=True) as session:
        while True:
            most = max(most, _size(part))
            try:
                return await _rest(session, url, part, limit_bytes, progress)
            except _BrokenError as broken:
                failures = failures + 1 if _size(part) <= most else 0
                if failures >= _TRIES:
                    raise HeelError(
                        f"{_shown(url)}: {broken} after {_size(part)} bytes: check the network; "
                        "the same command goes on from there, and --from FILE needs no network"
                    ) from None
            await asyncio.sleep(_PAUSE_S)


async def _rest(
    session: aiohttp.ClientSession, url: str, part: Path, limit_bytes: int, progress: Progress
) -> None:
    """Append what is missing.

    Raises:
        _BrokenError: another try may help.
    """
    there = _size(part)
    headers = {"Accept-Encoding": "identity"}
    if there:
        headers["Range"] = f"bytes={there}-"
    try:
        async with session.get(url, headers=headers, max_redirects=_REDIRECTS) as answer:
            if answer.status == 416 and there:
                # Nothing is missing, or the file has become another one: begin anew to find out.
                part.unlink()
                raise _BrokenError("the server has no more of it")
            if answer.status not in (200, 206):
                raise HeelError(
                    f"{_shown(url)}: the server says {answer.status} {answer.reason}: check the "
                    "address, or bring the file with --from FILE"
                )
            if answer.status == 200 or not _continues(answer, there):
                there = 0
            total = None if answer.content_length is None else there + answer.content_length
            if total is not None and total > limit_bytes:
                raise _too_large(url, total, limit_bytes)
            with part.open("r+b" if part.exists() else "w+b") as file:
                file.truncate(there)
                file.seek(there)
                progress(there, total)
                async for chunk in answer.content.iter_chunked(_CHUNK_BYTES):
                    there += len(chunk)
                    if there > limit_bytes:
                        raise _too_large(url, there, limit_bytes)
                    file.write(chunk)
                    progress(there, total)
            if total is not None and there < total:
                raise _BrokenError("the connection broke")
    except aiohttp.InvalidURL:
        raise HeelError(f"{_shown(url)}: no address: write http://... or https://...") from None
    except aiohttp.TooManyRedirects:
        raise HeelError(f"{_shown(url)}: more than {_REDIRECTS} redirects: check it") from None
    except aiohttp.ClientConnectorCertificateError as error:
        raise HeelError(
            f"{_shown(url)}: its certificate is not accepted ({error.certificate_error}): name "
            "your own authority's file in SSL_CERT_FILE"
        ) from None
    except aiohttp.ClientPayloadError:
        raise _BrokenError("the connection broke") from None
    except (aiohttp.ClientError, TimeoutError) as error:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise
        raise _BrokenError(str(error) or "no answer") from None


def _continues(answer: aiohttp.ClientResponse, there: int) -> bool:
    """Whether what comes is the rest that was asked for."""
    return answer.headers.get("Content-Range", "").startswith(f"bytes {there}-")


def _too_large(url: str, size: int, limit_bytes: int) -> HeelError:
    return HeelError(
        f"{_shown(url)}: {size} bytes or more, and at most {limit_bytes} are taken: this is "
        "another file, check the address"
    )


def _size(part: Path) -> int:
    return part.stat().st_size if part.exists() else 0


def _shown(url: str) -> str:
    return without_passwords(url)
