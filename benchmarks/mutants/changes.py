"""Mutants: a module with one of its named numbers halved or doubled, the rest as it is."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from benchmarks.mutants.constants import constants

Factor = Literal["halved", "doubled"]


@dataclass(frozen=True, order=True)
class Mutant:
    """One change.

    Attributes:
        path: of the module, from the root of the repository.
        name: of the constant; all numbers of a table change at once.
        factor: what happens to it.
    """

    path: str
    name: str
    factor: Factor

    def __str__(self) -> str:
        return f"{self.path} {self.name} {self.factor}"


def mutants(root: Path, folder: str) -> list[Mutant]:
    """All mutants of the modules in a folder, in order of path and name.

    Args:
        root: of the repository.
        folder: below it.
    """
    found = []
    for path in sorted((root / folder).rglob("*.py")):
        for constant in constants(path.read_text(encoding="utf-8")):
            for factor in get_args(Factor):
                if ast.dump(scaled(constant.value, factor)) != ast.dump(constant.value):
                    found.append(Mutant(str(path.relative_to(root)), constant.name, factor))
    return found


def changed(source: str, mutant: Mutant) -> ast.Module:
    """The syntax tree of a module with one constant changed.

    Args:
        source: of the unchanged module.
        mutant: which constant, and how.
    """
    tree = ast.parse(source)
    for statement in tree.body:
        if isinstance(statement, ast.AnnAssign | ast.Assign) and statement.value is not None:
            _change(statement, mutant)
    return ast.fix_missing_locations(tree)


def _change(statement: ast.Assign | ast.AnnAssign, mutant: Mutant) -> None:
    assert statement.value is not None
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    for target in targets:
        if isinstance(target, ast.Name) and target.id == mutant.name:
            statement.value = scaled(statement.value, mutant.factor)
        elif isinstance(target, ast.Tuple) and isinstance(statement.value, ast.Tuple):
            parts = zip(target.elts, statement.value.elts, strict=True)
            statement.value.elts = [
                scaled(value, mutant.factor)
                if isinstance(name, ast.Name) and name.id == mutant.name
                else value
                for name, value in parts
            ]


def scaled(node: ast.expr, factor: Factor) -> ast.expr:
    """An expression whose numbers are halved or doubled; whole numbers stay whole."""
    if isinstance(node, ast.Constant):
        return ast.Constant(_scaled_number(node.value, factor)) if _is_number(node) else node
    if isinstance(node, ast.UnaryOp):
        return ast.UnaryOp(node.op, scaled(node.operand, factor))
    if isinstance(node, ast.Tuple | ast.List):
        return type(node)([scaled(part, factor) for part in node.elts], ast.Load())
    if isinstance(node, ast.Set):
        return ast.Set([scaled(part, factor) for part in node.elts])
    if isinstance(node, ast.Dict):
        return ast.Dict(node.keys, [scaled(part, factor) for part in node.values])
    if isinstance(node, ast.BinOp) or _is_arithmetic(node):
        whole = all(isinstance(part.value, int) for part in _numbers(node))
        if factor == "doubled":
            return ast.BinOp(ast.Constant(2), ast.Mult(), node)
        return ast.BinOp(node, ast.FloorDiv() if whole else ast.Div(), ast.Constant(2))
    if isinstance(node, ast.Call):
        return ast.Call(
            node.func,
            [scaled(part, factor) for part in node.args],
            [ast.keyword(part.arg, scaled(part.value, factor)) for part in node.keywords],
        )
    return node


def _scaled_number(value: object, factor: Factor) -> int | float:
    assert isinstance(value, int | float)
    if factor == "doubled":
        return value * 2
    return value // 2 if isinstance(value, int) else value / 2


def _is_number(node: ast.expr) -> bool:
    return (
        isinstance(node, ast.Constant)
        and isinstance(node.value, int | float)
        and not isinstance(node.value, bool)
    )


def _numbers(node: ast.expr) -> Iterator[ast.Constant]:
    for part in ast.walk(node):
        if isinstance(part, ast.Constant) and _is_number(part):
            yield part


def _is_arithmetic(node: ast.expr) -> bool:
    """Whether a call gives a number or an array: `math.radians(2)`, `np.array([1.0])`."""
    if not isinstance(node, ast.Call):
        return False
    function = node.func
    while isinstance(function, ast.Attribute):
        function = function.value
    return isinstance(function, ast.Name) and function.id in ("np", "math", "float", "int")
