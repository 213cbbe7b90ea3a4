"""Every question on the bus goes to everybody, and hears every answer."""

from __future__ import annotations

import ast
from pathlib import Path

from tests.support.processes import REPOSITORY

_NEEDED = {"target": "EVERYBODY", "consolidation": "EVERY_ANSWER"}


def _asks(path: Path) -> list[ast.Call]:
    source = path.read_text(encoding="utf-8")
    if "zenoh" not in source:
        return []
    return [
        node for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        and node.func.attr == "get" and ast.unparse(node.func.value).endswith("session")
        and not isinstance(node.args[0], ast.Constant)  # of a dictionary
    ]  # fmt: skip


def test_no_question_is_asked_as_zenoh_would_by_default() -> None:
    asks = [(path, call) for path in (REPOSITORY / "services").rglob("*.py")
            for call in _asks(path)]  # fmt: skip
    assert len(asks) > 5, "the questions are not found any more"
    for path, call in asks:
        given = {word.arg: ast.unparse(word.value) for word in call.keywords}
        assert _NEEDED.items() <= given.items(), f"{path}:{call.lineno}"
