"""Folders of a run: a result folder, filled once there are results, and scratch folders."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path

from heel.schemas import HeelError

STAGING_PREFIX = ".heel-run-"
DEMO_PREFIX = "heel-demo-"


class ScratchFolder:
    """A folder of this process and its forks, removed at the end.

    A lock says that a run is at work in it; what a killed run left behind is removed by `sweep`.
    """

    def __init__(self, parent: Path, prefix: str) -> None:
        """Make it.

        Raises:
            OSError: `parent` is missing or cannot be written to.
        """
        self.path = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
        self._lock = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        fcntl.flock(self._lock, fcntl.LOCK_SH)

    def remove(self) -> None:
        """Delete it with all that is in it; harmless when repeated."""
        if self._lock < 0:
            return
        shutil.rmtree(self.path, ignore_errors=True)
        os.close(self._lock)
        self._lock = -1


def sweep(parent: Path, prefix: str) -> None:
    """Remove the user's own scratch folders that no process holds a lock on."""
    with suppress(OSError):
        for path in parent.glob(f"{prefix}*"):
            with suppress(OSError):
                _remove_if_left(path)


def _remove_if_left(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        if os.fstat(descriptor).st_uid == os.geteuid():
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(path, ignore_errors=True)
    finally:
        os.close(descriptor)


class ResultFolder:
    """The folder of a run: what an earlier run left there stays until this one has results.

    Until `begin` all files are in a scratch folder inside it, so that a run that cannot start
    changes nothing. Files take their names by renaming: no reader finds half of one, and a link
    in the way is replaced, not followed.
    """

    def __init__(self, folder: Path, names: tuple[str, ...], logs: str = "logs") -> None:
        """Make the folder and a scratch folder in it.

        Args:
            folder: made if it is not there.
            names: files that a run may leave there.
            logs: name of the folder of its logs.

        Raises:
            HeelError: it cannot be made or written to, or something is in the way of a result.
        """
        self.folder, self._names, self._logs = folder, names, logs
        self._made: list[Path] = []
        self.begun = False
        try:
            self._made = _make(folder)
            for name in names:
                if (folder / name).is_dir() and not (folder / name).is_symlink():
                    raise IsADirectoryError(21, f"{name} is a folder")
            old = folder / logs
            if os.path.lexists(old) and not (old.is_dir() or old.is_symlink()):
                raise FileExistsError(17, f"{logs} is not a folder")
            sweep(folder, STAGING_PREFIX)
            self._staging = ScratchFolder(folder, STAGING_PREFIX)
            (self._staging.path / logs).mkdir()
        except OSError as error:
            _unmake(self._made)
            raise self.cannot_write(error) from None

    def cannot_write(self, error: OSError) -> HeelError:
        """The one-line error for a file that cannot be written."""
        return HeelError(
            f"--out {self.folder}: {error.strerror}: give a folder that can be written to, on a "
            "disk with room"
        )

    @property
    def staging(self) -> Path:
        """Where files are written before they take their place."""
        return self._staging.path

    @property
    def log_folder(self) -> Path:
        """Where the logs are at this moment."""
        return (self.folder if self.begun else self.staging) / self._logs

    def begin(self, *names: str) -> None:
        """There are results: these files and the logs take their place, older results go.

        Files that are open stay open.

        Raises:
            HeelError: something is in the way.
        """
        try:
            for name in self._names:
                if name in names:
                    (self.staging / name).replace(self.folder / name)
                else:
                    (self.folder / name).unlink(missing_ok=True)
            self._place_logs()
        except OSError as error:
            raise self.cannot_write(error) from None
        self.begun = True

    def place(self, name: str) -> None:
        """Give a finished file its name.

        Raises:
            HeelError: something is in the way.
        """
        try:
            (self.staging / name).replace(self.folder / name)
        except OSError as error:
            raise self.cannot_write(error) from None

    def close(self) -> None:
        """Remove the scratch folder, and the folder too if this run made it for nothing."""
        self._staging.remove()
        if not self.begun:
            _unmake(self._made)

    def _place_logs(self) -> None:
        target, source = self.folder / self._logs, self.staging / self._logs
        if target.is_symlink():
            target.unlink()
        target.mkdir(exist_ok=True)
        for log in source.iterdir():
            log.replace(target / log.name)


def _make(folder: Path) -> list[Path]:
    """Make a folder and those above it; returns the ones that were not there, deepest first."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def _unmake(made: list[Path]) -> None:
    with suppress(OSError):
        for path in made:
            path.rmdir()
