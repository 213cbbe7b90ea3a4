"""Which unit tests run which functions, and so which of them can notice a changed constant."""

from __future__ import annotations

import ast
import functools
import json
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType, FrameType

import pytest

PINNED = "_pinned"
"""In the name of every file of tests that compare with numbers kept beside them."""
Function = tuple[str, int]
"""A function: its file from the root of the repository, and its first line, decorators included."""


@dataclass
class Coverage:
    """What the tests ran that passed.

    Attributes:
        functions: by node id of a test; what a fixture of its file runs counts for it as well.
        seconds: by node id.
    """

    functions: dict[str, set[Function]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)

    def tests_of(self, functions: set[Function]) -> list[str]:
        """Tests that run one of these functions, the most specific first.

        Before all others those that pin numbers: they notice the most, and are quick.
        """
        hit = [test for test, ran in self.functions.items() if ran & functions]
        return sorted(hit, key=lambda test: (PINNED not in test, len(self.functions[test]), test))

    def within(self, tests: Sequence[str], seconds: float) -> tuple[list[str], float]:
        """As many of these tests, in order, as take so long in all, but one at least; and how long.

        One that is longer than what is left is passed over.
        """
        asked, taken_s = list(tests[:1]), sum(self.seconds[test] for test in tests[:1])
        for test in tests[1:]:
            if taken_s + self.seconds[test] <= seconds:
                asked.append(test)
                taken_s += self.seconds[test]
        return asked, taken_s

    def save(self, path: Path) -> None:
        """Write it as JSON."""
        functions = {test: sorted(ran) for test, ran in self.functions.items()}
        path.write_text(json.dumps({"functions": functions, "seconds": self.seconds}), "utf-8")

    @classmethod
    def load(cls, path: Path) -> Coverage:
        """Read what `save` wrote."""
        data = json.loads(path.read_text("utf-8"))
        functions = {
            test: {(file, line) for file, line in ran} for test, ran in data["functions"].items()
        }
        return cls(functions, data["seconds"])


class Recorder:
    """A pytest plugin that notes the functions below a folder which each test runs."""

    def __init__(self, root: Path, folder: str) -> None:
        self._root, self._below = root, str((root / folder).resolve())
        self._codes: set[CodeType] = set()
        self._shared: dict[str, set[Function]] = defaultdict(set)
        self.coverage = Coverage()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> Iterator[None]:
        """What fixtures run may be used by every test of the file."""
        _empty_caches()
        with_setup = self._recorded()
        next(with_setup)
        try:
            return (yield)
        finally:
            self._shared[item.nodeid.partition("::")[0]] |= next(with_setup)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        """What the test itself runs."""
        during, started_s = self._recorded(), time.perf_counter()
        next(during)
        try:
            result: None = yield
        except BaseException:
            next(during)
            raise
        self.coverage.seconds[item.nodeid] = time.perf_counter() - started_s
        self.coverage.functions[item.nodeid] = next(during)
        return result

    def pytest_sessionfinish(self) -> None:
        """Give every test what the fixtures of its file ran."""
        for test, functions in self.coverage.functions.items():
            functions |= self._shared[test.partition("::")[0]]

    def _recorded(self) -> Iterator[set[Function]]:
        self._codes = set()
        codes = self._codes

        def note(frame: FrameType, event: str, _: object) -> None:
            if event == "call":
                codes.add(frame.f_code)

        threading.setprofile(note)
        sys.setprofile(note)
        yield set()
        sys.setprofile(None)
        threading.setprofile(None)
        yield {place for code in codes if (place := self._place(code)) is not None}

    def _place(self, code: CodeType) -> Function | None:
        path = str(Path(code.co_filename).resolve())
        if not path.startswith(self._below):
            return None
        return str(Path(path).relative_to(self._root.resolve())), code.co_firstlineno


def _empty_caches() -> None:
    """Let every test run what an earlier one has left in a cache."""
    for name in [one for one in sys.modules if one.partition(".")[0] == "heel"]:
        for value in list(vars(sys.modules[name]).values()):
            if isinstance(value, functools._lru_cache_wrapper):
                value.cache_clear()


class Users:
    """Which functions of a room use a constant."""

    def __init__(self, root: Path, folder: str) -> None:
        self._uses: dict[str, set[Function]] = defaultdict(set)
        self._derived: dict[str, set[str]] = defaultdict(set)
        self._everything: dict[str, set[Function]] = defaultdict(set)
        for path in sorted((root / folder).rglob("*.py")):
            self._read(str(path.relative_to(root)), ast.parse(path.read_text("utf-8")))

    def of(self, path: str, name: str) -> set[Function]:
        """Functions that use a constant, or another constant made of it.

        All functions of the module where none is found: it is used at import, then.
        """
        names, new = {name}, {name}
        while new:
            new = set().union(*(self._derived[one] for one in new)) - names
            names |= new
        found = set().union(*(self._uses[one] for one in names))
        return found or self._everything[path]

    def _read(self, path: str, tree: ast.Module) -> None:
        functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
        inside = {node.name: set(_names(node)) for node in functions}
        for statement in tree.body:
            if isinstance(statement, ast.Assign | ast.AnnAssign):
                targets = (
                    statement.targets if isinstance(statement, ast.Assign) else [statement.target]
                )
                made = {one.id for each in targets for one in ast.walk(each)
                        if isinstance(one, ast.Name)}  # fmt: skip
                for name in _names(statement):
                    # What a function makes at import is made of the constants that it uses.
                    for used in {name} | inside.get(name, set()):
                        self._derived[used] |= made
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                first = min([node.lineno, *(one.lineno for one in node.decorator_list)])
                self._everything[path].add((path, first))
                for name in _names(node):
                    self._uses[name].add((path, first))


def _names(node: ast.AST) -> Iterator[str]:
    for part in ast.walk(node):
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Load):
            yield part.id
        elif isinstance(part, ast.Attribute):
            yield part.attr
