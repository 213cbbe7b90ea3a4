"""A network comes whole and checked, or not at all, whatever server, archive and disk do."""

from __future__ import annotations

import hashlib
import io
import os
import subprocess
import sys
import tarfile
import threading
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from heel.schemas.errors import HeelError
from heel.services.models import archives
from heel.services.models import download as downloading
from heel.services.models import fetch as fetching
from heel.services.models.catalogue import KNOWN, Address, KnownModel
from heel.services.models.fetch import fetch, leftovers
from heel.services.models.store import VARIABLE, place_of
from tests.support.processes import REPOSITORY
from tests.unit.models.model_server import Behaviour, served

CONTENT = bytes(range(256)) * 2000
OTHER = b"x" * len(CONTENT)


@pytest.fixture
def model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> KnownModel:
    """A network of half a megabyte, and a folder of its own."""
    monkeypatch.setenv(VARIABLE, str(tmp_path / "models"))
    monkeypatch.setattr(downloading, "_PAUSE_S", 0.0)
    return replace(
        KNOWN["yolox-nano"], size_bytes=len(CONTENT), sha256=hashlib.sha256(CONTENT).hexdigest()
    )


def left(model: KnownModel) -> list[str]:
    """What is in the folder, without locks."""
    folder = place_of(model).parent
    return sorted(one.name for one in folder.iterdir() if not one.name.endswith(".lock"))


@pytest.mark.parametrize("length", [True, False])
@pytest.mark.parametrize("redirects", [0, 3])
def test_a_download_is_checked_and_kept(model: KnownModel, redirects: int, length: bool) -> None:
    told: list[tuple[int, int | None]] = []
    with served(Behaviour(CONTENT, redirects=redirects, length=length)) as url:
        file = fetch(model, url, lambda there, total: told.append((there, total)))
    assert file.read_bytes() == CONTENT
    assert left(model) == [model.file]
    assert file.stat().st_mode & 0o777 == 0o644
    assert told[0][0] == 0
    assert told[-1] == (len(CONTENT), len(CONTENT) if length else None)


def test_its_own_source_is_taken_where_no_other_is_named(model: KnownModel) -> None:
    with served(Behaviour(CONTENT)) as url:
        assert fetch(replace(model, source=Address(url))).read_bytes() == CONTENT


def test_a_broken_connection_goes_on_from_where_it_broke(model: KnownModel) -> None:
    server = Behaviour(CONTENT, break_after=100_000)
    with served(server) as url:
        assert fetch(model, url).read_bytes() == CONTENT
    assert server.asked == ["", *(f"bytes={n}00000-" for n in range(1, 6))]


def test_a_server_without_ranges_is_asked_from_the_start_again(model: KnownModel) -> None:
    server = Behaviour(CONTENT, ranges=False, break_after=100_000, breaks=2)
    with served(server) as url:
        assert fetch(model, url).read_bytes() == CONTENT
    assert len(server.asked) == 3


def test_what_came_before_the_server_died_is_taken_up_by_the_next_call(model: KnownModel) -> None:
    server = Behaviour(CONTENT, break_after=100_000)
    with served(server) as url:
        whole, server.content = server.content, server.content[:200_000]
        server.claimed_length, server.break_after = 400_000, None
        with pytest.raises(HeelError, match=r"after 200000 bytes.*--from FILE"):
            fetch(model, url)
        assert leftovers(model)
        server.content, server.claimed_length = whole, None
        server.asked.clear()
        assert fetch(model, url).read_bytes() == CONTENT
    assert server.asked == ["bytes=200000-"]
    assert left(model) == [model.file]


def test_a_beginning_of_another_file_costs_one_more_download(model: KnownModel) -> None:
    server = Behaviour(OTHER[:1000], claimed_length=2000)
    with served(server) as url:
        with pytest.raises(HeelError):
            fetch(model, url)
        server.content, server.claimed_length = CONTENT, None
        server.asked.clear()
        assert fetch(model, url).read_bytes() == CONTENT
    assert server.asked == ["bytes=1000-", ""]


def test_nothing_more_than_what_is_there_begins_anew(model: KnownModel) -> None:
    server = Behaviour(CONTENT, claimed_length=len(CONTENT) + 1)
    with served(server) as url:
        with pytest.raises(HeelError):
            fetch(model, url)
        server.claimed_length = None
        assert fetch(model, url).read_bytes() == CONTENT


@pytest.mark.parametrize(
    ("behaviour", "complaint"),
    [
        (Behaviour(OTHER), f"{len(OTHER)} bytes with sha256 .* this is another file"),
        (Behaviour(b""), "0 bytes with sha256"),
        (Behaviour(b"no", status=404), "the server says 404 .*--from FILE"),
        (Behaviour(b"no", status=500), "the server says 500"),
        (Behaviour(CONTENT, redirects=99), "more than 5 redirects"),
        (Behaviour(CONTENT, claimed_length=1 << 40), "at most .* are taken"),
        (Behaviour(CONTENT, break_after=0), "the connection broke after 0 bytes"),
    ],
)
def test_anything_else_is_refused_and_leaves_nothing(
    model: KnownModel, behaviour: Behaviour, complaint: str
) -> None:
    with served(behaviour) as url:
        with pytest.raises(HeelError, match=complaint):
            fetch(model, url)
    assert not place_of(model).exists()
    assert all(not one.stat().st_size for one in leftovers(model))


def test_a_stream_without_end_is_cut(
    model: KnownModel, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    monkeypatch.setattr(fetching, "ARCHIVE_BYTES", 100_000)
    with served(Behaviour(CONTENT, length=False)) as url:
        with pytest.raises(HeelError, match="at most 100000 are taken"):
            fetch(model, url)


def test_nobody_at_the_address_is_one_line_without_its_password(model: KnownModel) -> None:
    with pytest.raises(HeelError) as refused:
        fetch(model, "http://me:secret@127.0.0.1:1/model.onnx")
    assert "secret" not in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("origin", ["ftp://127.0.0.1/x", "http://", "file:///etc/passwd"])
def test_other_addresses_are_refused(model: KnownModel, origin: str) -> None:
    with pytest.raises(HeelError, match="http"):
        fetch(model, origin)


def zipped(members: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return out.getvalue()


def tarred(*members: tuple[tarfile.TarInfo, bytes]) -> bytes:
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w:gz") as archive:
        for info, content in members:
            archive.addfile(info, io.BytesIO(content))
    return out.getvalue()


def member(
    name: str, size: int = 0, kind: bytes = tarfile.REGTYPE, to: str = ""
) -> tarfile.TarInfo:
    info = tarfile.TarInfo(name)
    info.size, info.type, info.linkname = size, kind, to
    return info


WHEEL = zipped({"a/readme": b"hello", "../../a/model": OTHER, "/deep/model.onnx": CONTENT})
TARBALL = tarred(
    (member("package/link", kind=tarfile.SYMTYPE, to="/etc/passwd"), b""),
    (member("package/device", kind=tarfile.CHRTYPE), b""),
    (member("../../other", len(OTHER)), OTHER),
    (member("package/model.onnx", len(CONTENT)), CONTENT),
)


@pytest.mark.parametrize("archive", [WHEEL, TARBALL], ids=["wheel", "tarball"])
@pytest.mark.parametrize("over", ["http", "file"])
def test_a_member_of_an_archive_is_known_by_its_hash(
    model: KnownModel, archive: bytes, over: str, tmp_path: Path
) -> None:
    before = {one for one in tmp_path.rglob("*") if "models" not in one.parts}
    given = tmp_path / "given"
    given.write_bytes(archive)
    with served(Behaviour(archive)) as url:
        assert fetch(model, url if over == "http" else str(given)).read_bytes() == CONTENT
    assert left(model) == [model.file]
    outside = {one for one in tmp_path.rglob("*") if "models" not in one.parts}
    assert outside - before == {given}


def _spoilt(archive: bytes) -> bytes:
    middle = len(archive) // 2
    return archive[:middle] + bytes(64) + archive[middle + 64 :]


def _claims(size: int) -> bytes:
    """A wheel that says of a small member that it is as large as the network."""
    archive = bytearray(zipped({"model.onnx": b"small"}))
    for mark, at in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        where = archive.index(mark) + at
        archive[where : where + 4] = size.to_bytes(4, "little")
    return bytes(archive)


HOSTILE = {
    "no such member": zipped({"a": OTHER}),
    "no such member in a tarball": tarred((member("a", len(OTHER)), OTHER)),
    "an empty wheel": zipped({}) + b"PK\x03\x04",
    "a wheel cut off": WHEEL[: len(WHEEL) // 2],
    "a tarball cut off": TARBALL[: len(TARBALL) // 2],
    "a spoilt wheel": _spoilt(zipped({"model.onnx": CONTENT})),
    "a spoilt tarball": _spoilt(TARBALL),
    "a member that is smaller than it says": _claims(len(CONTENT)),
    "a link of the right name": tarred((member("model.onnx", 0, tarfile.SYMTYPE, "/etc"), b"")),
    "the magic of gzip alone": b"\x1f\x8b\x08\x00",
    "the magic of zip alone": b"PK\x03\x04",
}


@pytest.mark.parametrize("archive", HOSTILE.values(), ids=HOSTILE.keys())
def test_a_hostile_archive_is_one_line_and_leaves_nothing(
    model: KnownModel, archive: bytes, tmp_path: Path
) -> None:
    given = tmp_path / "given"
    given.write_bytes(archive)
    with pytest.raises(HeelError) as refused:
        fetch(model, str(given))
    assert "\n" not in str(refused.value)
    assert left(model) == []


def test_a_tarball_that_unpacks_without_end_is_cut(
    model: KnownModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archives, "_MOST_BYTES", 1 << 20)
    given = tmp_path / "bomb.tgz"
    with tarfile.open(given, "w:gz") as archive:
        archive.addfile(member("zeros", 1 << 22), _Zeros(1 << 22))  # type: ignore[arg-type]
    with pytest.raises(HeelError, match="damaged archive"):
        fetch(model, str(given))


class _Zeros(io.RawIOBase):
    def __init__(self, size: int) -> None:
        self._left = size

    def read(self, size: int = -1) -> bytes:
        size = min(size, self._left)
        self._left -= size
        return bytes(size)


def test_a_file_that_is_there_and_whole_is_not_brought_again(model: KnownModel) -> None:
    server = Behaviour(CONTENT)
    with served(server) as url:
        fetch(model, url)
        fetch(model, url)
        place_of(model).write_bytes(OTHER)
        fetch(model, url)
    assert len(server.asked) == 2, "once, and once more for the damaged one"


def test_what_a_killed_get_has_left_goes_with_the_next(model: KnownModel) -> None:
    left_over = place_of(model).parent / f".getting-{model.name}-xyz"
    left_over.mkdir(parents=True)
    (left_over / "half.whl").write_bytes(b"half")
    with served(Behaviour(CONTENT)) as url:
        fetch(model, url)
    assert left(model) == [model.file]


def test_two_gets_at_once_bring_one_file_once(model: KnownModel) -> None:
    server = Behaviour(CONTENT)
    failures: list[BaseException] = []

    def one(url: str) -> None:
        try:
            fetch(model, url)
        except BaseException as error:
            failures.append(error)

    with served(server) as url:
        threads = [threading.Thread(target=one, args=(url,)) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(20)
    assert not failures
    assert len(server.asked) == 1
    assert left(model) == [model.file]


def test_a_missing_file_is_named(model: KnownModel) -> None:
    with pytest.raises(HeelError, match=r"--from /nowhere/x\.onnx: no such file"):
        fetch(model, "/nowhere/x.onnx")


_MOUNTED = """
set -e
mount -t tmpfs -o {options} tmpfs {folder}
exec {python} -P -m heel models get person-mask --from {source}
"""


@pytest.mark.parametrize(
    ("options", "size", "complaint"),
    [("size=128k", 300_000, "No space left on device"), ("ro", 1000, "Read-only file system")],
)
def test_a_full_or_read_only_disk_is_one_line(
    options: str, size: int, complaint: str, tmp_path: Path
) -> None:
    folder = tmp_path / "disk"
    folder.mkdir()
    with served(Behaviour(b"y" * size)) as url:
        script = _MOUNTED.format(options=options, folder=folder, python=sys.executable, source=url)
        done = subprocess.run(
            ["unshare", "-m", "sh", "-c", script], capture_output=True, text=True, timeout=30,
            env=os.environ | {VARIABLE: str(folder)}, check=False, cwd=REPOSITORY,
        )  # fmt: skip
    if "unshare" in done.stderr or "mount" in done.stderr:
        pytest.skip("no right to mount a file system")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert complaint in line
    assert VARIABLE in line
