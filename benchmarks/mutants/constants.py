"""Named numbers of a module: where each stands and whether a reason stands beside it."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass

_NAME = re.compile(r"_?[A-Z][A-Z0-9_]*")
_NO_REASON = re.compile(r"#\s*(fmt|noqa|type|mypy|pragma)\b")
"""Comments to tools: they give no reason."""


@dataclass(frozen=True)
class Constant:
    """A named number, or a named table of numbers, of a module.

    Attributes:
        name: as assigned, upper case.
        line: of the assignment, counted from 1.
        value: the expression assigned; the part of it that is this name's.
        explained: a docstring follows, or a comment stands on its lines or above its block.
            Names that share one assignment (`A, B = 1, 2`) are not explained: one text cannot
            give the unit and reason of each. It can for an enumeration (`A, B = range(2)`).
    """

    name: str
    line: int
    value: ast.expr
    explained: bool


def constants(source: str) -> list[Constant]:
    """Constants of a module's source that hold numbers, in order.

    Args:
        source: Python text.

    Raises:
        SyntaxError: it is not Python.
    """
    body = ast.parse(source).body
    comments = _comment_lines(source)
    above = {line for line, alone in comments.items() if alone}
    found = []
    covered_to = -1
    """Last line of the block of assignments that a comment above explains."""
    for statement, following in zip(body, [*body[1:], None], strict=True):
        if not isinstance(statement, ast.Assign | ast.AnnAssign) or statement.value is None:
            continue
        first, last = statement.lineno, statement.end_lineno or statement.lineno
        if first - 1 in above or first - 1 == covered_to:
            covered_to = last
        named = list(_named(statement))
        if not named or not _holds_number(statement.value):
            continue
        beside = covered_to == last or any(line in comments for line in range(first, last + 1))
        one_meaning = len(named) == 1 or isinstance(statement.value, ast.Call)
        explained = one_meaning and (beside or _is_text(following))
        found += [Constant(name, first, value, explained) for name, value in named]
    return found


def _comment_lines(source: str) -> dict[int, bool]:
    """Lines with a comment, and whether nothing else stands on them."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    return {
        token.start[0]: token.line.lstrip().startswith("#")
        for token in tokens
        if token.type == tokenize.COMMENT and not _NO_REASON.match(token.string)
    }


def _named(statement: ast.Assign | ast.AnnAssign) -> Iterator[tuple[str, ast.expr]]:
    """Names that are assigned and the expression of each, as far as it stands there."""
    assert statement.value is not None
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    for target in targets:
        names = target.elts if isinstance(target, ast.Tuple | ast.List) else [target]
        values = [statement.value] * len(names)
        if len(names) > 1 and isinstance(statement.value, ast.Tuple | ast.List):
            values = statement.value.elts
        for name, value in zip(names, values, strict=False):
            if isinstance(name, ast.Name) and _NAME.fullmatch(name.id):
                yield name.id, value


def _holds_number(node: ast.AST) -> bool:
    """Whether a number is written in an expression; indices (`SIZES[0]`) do not count."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.Subscript):
        return _holds_number(node.value)
    return any(_holds_number(part) for part in ast.iter_child_nodes(node))


def _is_text(statement: ast.stmt | None) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )
