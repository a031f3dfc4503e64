"""Mutants of a module: each differs from it in one sign, one exponent or one numeric constant."""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass

__all__ = ["Mutant", "mutants"]

_ANNOTATIONS = {"annotation", "returns", "decorator_list"}
_NEAR = 1e-5


@dataclass(frozen=True)
class Mutant:
    """One change; ``before`` and ``after`` are the smallest statement or clause around it."""

    function: str
    before: str
    after: str
    kind: str
    tree: ast.Module
    path: tuple

    @property
    def change(self) -> tuple[str, str, str]:
        """What was changed, whatever its line number."""
        return self.function, self.before, self.after

    @property
    def source(self) -> str:
        """The text of the changed module."""
        return ast.unparse(_changed(self.tree, self.path, self.kind))


def mutants(source: str) -> list[Mutant]:
    """Return every mutant of a module's source.

    A plus becomes a minus and the other way round, a leading minus is dropped, a constant (and so an exponent) goes up
    and down by one, a float by a tenth. An index of 0 only goes up: below it is the last item, and mostly the only one.
    Left alone are annotations, decorators, which hold the equations' numbers, functions that are checks themselves, and
    floats of 1e-5 or less, which say how near is near enough or stand in for zero.
    """
    tree = ast.parse(source)
    return [_mutant(tree, *place) for place in _places(tree, (), "", None)]


def _places(node: ast.AST, path: tuple, function: str, statement: tuple | None, index: bool = False) -> Iterator[tuple]:
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
        if any(ast.unparse(decorator).startswith(("proves(", "samples(")) for decorator in node.decorator_list):
            return
        function = f"{function}.{node.name}".lstrip(".")
    if isinstance(node, (ast.stmt, ast.ExceptHandler)) and path:
        statement = path
    for change in _changes(node, index):
        yield path, function, statement, change
    for name, value in ast.iter_fields(node):
        if name in _ANNOTATIONS:
            continue
        for place, child in enumerate(value if isinstance(value, list) else [value]):
            if isinstance(child, ast.AST):
                step = (name, place if isinstance(value, list) else None)
                inside = name == "slice" or (index and isinstance(node, ast.Tuple))
                yield from _places(child, (*path, step), function, statement, inside)


def _changes(node: ast.AST, index: bool) -> tuple[str, ...]:
    if isinstance(node, (ast.BinOp, ast.AugAssign)) and isinstance(node.op, (ast.Add, ast.Sub)):
        return ("flip",)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return ("drop",)
    if isinstance(node, ast.Constant) and type(node.value) is int:
        return ("+1",) if index and node.value == 0 else ("+1", "-1")
    if isinstance(node, ast.Constant) and type(node.value) is float and not 0 < node.value <= _NEAR:
        return ("*1.1", "*0.9")
    return ()


def _reach(tree: ast.AST, path: tuple) -> ast.AST:
    for name, index in path:
        child = getattr(tree, name)
        tree = child if index is None else child[index]
    return tree


def _mutant(tree: ast.Module, path: tuple, function: str, statement: tuple, change: str) -> Mutant:
    original = _reach(tree, statement)
    changed = _changed(original, path[len(statement) :], change)
    return Mutant(function, _shown(original), _shown(changed), change, tree, path)


def _changed(tree: ast.AST, path: tuple, change: str) -> ast.AST:
    """Return a copy in which the node at the path is changed."""
    changed = copy.deepcopy(tree)
    node = _reach(changed, path)
    if change == "flip":
        node.op = ast.Sub() if isinstance(node.op, ast.Add) else ast.Add()
    elif change == "drop":
        *head, (name, index) = path
        parent = _reach(changed, tuple(head))
        if index is None:
            setattr(parent, name, node.operand)
        else:
            getattr(parent, name)[index] = node.operand
    elif change.startswith("*"):
        node.value = node.value * float(change[1:]) or float(change[1:]) - 1.0  # zero becomes a tenth, up or down
    else:
        node.value += int(change)
    return changed


def _shown(node: ast.AST) -> str:
    """Return a statement without the block it heads."""
    return ast.unparse(node).partition(":\n")[0]
