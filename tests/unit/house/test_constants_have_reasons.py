"""Every number of the product says why it is what it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.mutants.constants import constants

_ROOT = Path(__file__).resolve().parents[3]
ROOMS = [
    "schemas",
    "evaluation",
    *sorted(f"services/{path.parent.name}" for path in (_ROOT / "services").glob("*/__init__.py")),
]


@pytest.mark.parametrize("room", ROOMS)
def test_every_number_has_a_reason(room: str) -> None:
    """`NAME = 1.0` needs a docstring below it, or a comment beside it or above its block, that
    gives the unit and the reason, or says "chosen by hand"; one name an assignment."""
    found = [
        f"{path.relative_to(_ROOT)}:{constant.line} {constant.name}"
        for path in sorted((_ROOT / room).rglob("*.py"))
        for constant in constants(path.read_text(encoding="utf-8"))
        if not constant.explained
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("source", "explained"),
    [
        ("A = 1", False),
        ('A = 1\n"""Pixels: chosen by hand."""', True),
        ("A = 1  # chosen by hand", True),
        ("A = (  # fmt: skip\n    1, 2,\n)", False),
        ("# Seconds, chosen by hand.\nA = 1", True),
        ("# Of another block.\n\nA = 1", False),
        ("B = 2  # of another line\nA = 1", False),
        ('A, B = 1, 2\n"""One text for two."""', False),
        ('A, B = range(2)\n"""Columns of a table."""', True),
        ("A: float = -1.5e3", False),
        ("A = np.array([1.0, 2.0])", False),
        ("A = f(2 * OTHER)", False),
    ],
)
def test_what_explains_a_number(source: str, explained: bool) -> None:
    found = {constant.name: constant.explained for constant in constants(source)}
    assert found["A"] is explained


def test_a_comment_explains_its_whole_block_and_no_more() -> None:
    found = constants("# Grey levels, chosen by hand.\nA = 1\nB = 2\n\nC = 3\n")
    assert [(c.name, c.line, c.explained) for c in found] == [
        ("A", 2, True), ("B", 3, True), ("C", 5, False),
    ]  # fmt: skip


@pytest.mark.parametrize("source", ['A = "text"', "A = True", "A = B[0] + C", "a = 1", "A = B + C"])
def test_what_is_no_number(source: str) -> None:
    assert constants(source) == []
