"""Runs unit tests in forked processes: once to see what they run, once for every mutant."""

from __future__ import annotations

import contextlib
import importlib
import importlib.machinery
import multiprocessing
import os
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import CodeType, ModuleType
from typing import Literal

import cv2
import hypothesis
import pytest
import scipy.optimize  # noqa: F401  # loaded once in each worker, rather than in every fork

from benchmarks.mutants.changes import Mutant, changed
from benchmarks.mutants.coverage import Coverage, Recorder
from heel.schemas.errors import HeelError
from heel.services.runtime.process import PARENT_VARIABLE, die_with_parent

Outcome = Literal["caught", "too slow", "survived", "no test runs it"]
_STOP_S = 5.0
"""Between a polite and a hard end of a run that takes too long; chosen by hand."""
_BELOW = ("heel.schemas", "heel.services.geometry", "heel.services.runtime")
"""Layers that import no room: they stay as they are while constants of rooms change."""
_NO_RESULT = (pytest.ExitCode.INTERNAL_ERROR, pytest.ExitCode.USAGE_ERROR,
              pytest.ExitCode.NO_TESTS_COLLECTED)  # fmt: skip
_PATIENCE, _START_S = 5.0, 30.0


@dataclass(frozen=True)
class Result:
    """What became of a mutant, and how many tests could have noticed it."""

    mutant: Mutant
    outcome: Outcome
    tests: int


def prepare_worker() -> None:
    """First in each process that runs mutants: several of them share the processor.

    What lies below all rooms is imported here rather than in every fork.
    """
    cv2.setNumThreads(1)
    for package in _BELOW:
        importlib.import_module(package)
    importlib.import_module("heel.services.runtime.service")


class Runner:
    """Runs unit tests of a repository, each time in a fork of this process.

    The fork imports the services anew, with one module changed in memory: nothing is written to the
    tree.
    """

    def __init__(self, root: Path, folders: Sequence[str]) -> None:
        """Make it.

        Args:
            root: of the repository.
            folders: of the unit tests, from the root.
        """
        self._root, self._folders = root, list(folders)

    def coverage(self, room: str, timeout_s: float) -> Coverage:
        """What every test runs below a folder; tests that fail unchanged say nothing later on.

        Raises:
            HeelError: none passes, or not in time.
        """
        with tempfile.TemporaryDirectory(prefix="heel-mutants-") as scratch:
            file = Path(scratch) / "coverage.json"

            def record() -> int:
                recorder = Recorder(self._root, room)
                code = int(pytest.main(self._arguments(self._folders), [recorder, _Repeatable()]))
                recorder.coverage.save(file)
                return code

            code = _forked(record, timeout_s, Path(scratch))
            if code not in (0, 1) or not file.exists():
                lines = (Path(scratch) / "output.txt").read_text("utf-8").splitlines()
                raise HeelError(
                    f"the unit tests of {room} do not run, mend them first: "
                    f"{lines[-1] if lines else 'no output'}"
                )
            return Coverage.load(file)

    def outcome(self, mutant: Mutant, tests: Sequence[str], seconds: float) -> Result:
        """Run the tests that could notice a mutant, until one does.

        Args:
            mutant: the change.
            tests: node ids, in the order in which they are tried.
            seconds: that they take unchanged.
        """
        if not tests:
            return Result(mutant, "no test runs it", 0)
        files = list(dict.fromkeys(test.partition("::")[0] for test in tests))

        def run() -> int:
            sys.meta_path.insert(0, _Changed(mutant, self._root))
            plugins = [_Only(tests), _Repeatable()]
            return int(pytest.main([*self._arguments(files), "-x"], plugins))

        with tempfile.TemporaryDirectory(prefix="heel-mutants-") as scratch:
            code = _forked(run, _PATIENCE * seconds + _START_S, Path(scratch))
        if code in _NO_RESULT:
            raise HeelError(f"{mutant}: pytest ended with {code}, which says nothing of the change")
        outcome: Outcome = "survived" if code == 0 else "too slow" if code is None else "caught"
        return Result(mutant, outcome, len(tests))

    def _arguments(self, paths: Sequence[str]) -> list[str]:
        return [
            "--rootdir", str(self._root), "-q", "-p", "no:cacheprovider", "--assert=plain", "-m",
            "not docker and not slow and not browser", *(str(self._root / path) for path in paths),
        ]  # fmt: skip


class _Repeatable:
    """The same examples of property tests in every run, and no memory of those that failed."""

    def pytest_configure(self) -> None:
        hypothesis.settings.register_profile("mutants", derandomize=True, database=None)
        hypothesis.settings.load_profile("mutants")


class _Only:
    """Keeps some tests, in their order."""

    def __init__(self, tests: Sequence[str]) -> None:
        self._place = {test: place for place, test in enumerate(tests)}

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = sorted(
            (item for item in items if item.nodeid in self._place),
            key=lambda item: self._place[item.nodeid],
        )


class _Changed(importlib.machinery.PathFinder):
    """Finds one module with one constant changed."""

    def __init__(self, mutant: Mutant, root: Path) -> None:
        self._mutant, self._source = mutant, (root / mutant.path).read_text(encoding="utf-8")
        self._module = ".".join(("heel", *Path(mutant.path).with_suffix("").parts))
        self._module = self._module.removesuffix(".__init__")

    def find_spec(  # type: ignore[override]
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if name != self._module:
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path, target)
        assert spec is not None
        assert spec.origin is not None
        code = compile(changed(self._source, self._mutant), spec.origin, "exec")
        spec.loader = _Loader(name, spec.origin, code)
        return spec


class _Loader(importlib.machinery.SourceFileLoader):
    """Runs code that was compiled elsewhere in place of a file's."""

    def __init__(self, name: str, path: str, code: CodeType) -> None:
        super().__init__(name, path)
        self._code = code

    def get_code(self, fullname: str) -> CodeType:
        return self._code


def _forked(work: Callable[[], int], timeout_s: float, scratch: Path) -> int | None:
    """Exit code of work in a forked process, None if it had to be ended."""
    sys.stdout.flush()
    sys.stderr.flush()
    process = multiprocessing.get_context("fork").Process(target=_alone, args=(work, scratch))
    process.start()
    try:
        process.join(timeout_s)
        return process.exitcode
    finally:
        _end(process)


def _is_anew(name: str) -> bool:
    """Whether a module is imported again in a fork: what may be changed, or imports what may be."""
    if name.partition(".")[0] == "tests":
        return True
    return name.startswith("heel.") and not name.startswith(_BELOW)


def _alone(work: Callable[[], int], scratch: Path) -> None:
    """Never returns: a process group of its own, silent, with its temporary files in one place."""
    code = 1
    try:
        os.environ[PARENT_VARIABLE] = str(os.getppid())
        die_with_parent()
        del os.environ[PARENT_VARIABLE]  # what the tests start has other parents
        os.setsid()
        os.environ["TMPDIR"] = tempfile.tempdir = str(scratch)
        for stream in (1, 2):
            os.dup2(os.open(scratch / "output.txt", os.O_WRONLY | os.O_CREAT | os.O_APPEND), stream)
        for name in [one for one in sys.modules if _is_anew(one)]:
            del sys.modules[name]
        code = work()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _end(process: BaseProcess) -> None:
    """Ends the process if it still runs, and with it whatever its tests have started."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        if process.is_alive():
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid or 0, number)
            process.join(_STOP_S)
