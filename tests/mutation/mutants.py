"""Mutants of a module: each differs from it in one operator, constant, comparison, statement or order of arguments."""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass

__all__ = ["Mutant", "mutants"]

_ANNOTATIONS = {"annotation", "returns", "decorator_list"}
_NEAR = 1e-5
_SIZES = {"size", "ndim"}
_COMMUTATIVE = {
    "allclose",
    "and_",
    "gcd",
    "hypot",
    "isclose",
    "lcm",
    "max",
    "maximum",
    "min",
    "minimum",
    "or_",
    "set",
    "xor",
}
_CONTRARY: dict[type[ast.AST], type] = {
    ast.Add: ast.Sub,
    ast.Mult: ast.Div,
    ast.And: ast.Or,
    ast.Lt: ast.GtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.Is: ast.IsNot,
    ast.In: ast.NotIn,
}
_CONTRARY |= {contrary: kind for kind, contrary in _CONTRARY.items()}
_EDGE: dict[type[ast.AST], type] = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}


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

    - A plus becomes a minus, a product a quotient, and the other way round; a leading minus and a ``not`` are dropped;
      ``and`` becomes ``or`` and the other way round.
    - A constant (and so an exponent) goes up and down by one, a float by a tenth. An index of 0 only goes up: below it
      is the last item, and mostly the only one.
    - A comparison is turned into its contrary; one with a whole number or a length also takes in its edge or leaves it
      out. Of floats the edge is one value among 2**64.
    - A statement is dropped: a call whose value nobody uses, an assignment to an item or an attribute or with an
      operator, ``raise``, ``continue``, ``break``. Without any other assignment a name would be missing.
    - Two neighbouring arguments of a call change places, but for functions of which their order does not matter.

    Left alone are annotations, decorators, which hold the equations' numbers, functions that are checks themselves,
    what is raised, and floats of 1e-5 or less, which say how near is near enough or stand in for zero.
    """
    tree = ast.parse(source)
    return [_mutant(tree, *place) for place in _places(tree, (), "", None)]


def _places(node: ast.AST, path: tuple, function: str, statement: tuple | None, index: bool = False) -> Iterator[tuple]:
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
        if any(ast.unparse(decorator).startswith(("proves(", "samples(")) for decorator in node.decorator_list):
            return
        function = f"{function}.{node.name}".lstrip(".")
    if isinstance(node, (ast.stmt, ast.ExceptHandler, ast.match_case)) and path:
        statement = path
    for change in _changes(node, index):
        yield path, function, statement, change
    if isinstance(node, ast.Raise):
        return
    for name, value in ast.iter_fields(node):
        if name in _ANNOTATIONS:
            continue
        for place, child in enumerate(value if isinstance(value, list) else [value]):
            if isinstance(child, ast.AST):
                step = (name, place if isinstance(value, list) else None)
                inside = name == "slice" or (index and isinstance(node, ast.Tuple))
                yield from _places(child, (*path, step), function, statement, inside)


def _changes(node: ast.AST, index: bool) -> tuple[str, ...]:
    dropped = ("delete",) if _may_go(node) else ()
    if isinstance(node, (ast.BinOp, ast.AugAssign)) and type(node.op) in _CONTRARY:
        return ("flip", *dropped)
    if isinstance(node, ast.BoolOp):
        return ("flip",)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.Not)):
        return ("drop",)
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        return ("flip", "edge") if type(node.ops[0]) in _EDGE and any(map(_whole, _sides(node))) else ("flip",)
    if isinstance(node, ast.Constant) and type(node.value) is int:
        return ("+1",) if index and node.value == 0 else ("+1", "-1")
    if isinstance(node, ast.Constant) and type(node.value) is float and not 0 < node.value <= _NEAR:
        return ("*1.1", "*0.9")
    if isinstance(node, ast.Call):
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        pairs = [] if called in _COMMUTATIVE else zip(node.args, node.args[1:], strict=False)
        return tuple(f"swap {place}" for place, pair in enumerate(pairs) if _differ(*pair))
    return dropped


def _may_go(node: ast.AST) -> bool:
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Call)
    if isinstance(node, ast.Assign):
        return not any(isinstance(target, (ast.Name, ast.Tuple)) for target in node.targets)
    return isinstance(node, (ast.AugAssign, ast.Raise, ast.Continue, ast.Break))


def _sides(node: ast.Compare) -> tuple[ast.expr, ast.expr]:
    return node.left, node.comparators[0]


def _whole(node: ast.expr) -> bool:
    """Tell whether a side of a comparison is a whole number, or the length or size of something."""
    if isinstance(node, ast.Call):
        return isinstance(node.func, ast.Name) and node.func.id == "len"
    return (isinstance(node, ast.Attribute) and node.attr in _SIZES) or type(getattr(node, "value", None)) is int


def _differ(one: ast.expr, other: ast.expr) -> bool:
    starred = isinstance(one, ast.Starred) or isinstance(other, ast.Starred)
    return not starred and ast.dump(one) != ast.dump(other)


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
    kind, _, place = change.partition(" ")
    if kind == "flip" and isinstance(node, ast.Compare):
        node.ops = [_CONTRARY[type(node.ops[0])]()]
    elif kind == "flip":
        node.op = _CONTRARY[type(node.op)]()
    elif kind == "edge":
        node.ops = [_EDGE[type(node.ops[0])]()]
    elif kind == "drop":
        return _put(changed, path, node.operand)
    elif kind == "delete":
        return _put(changed, path, ast.Pass())
    elif kind == "swap":
        here = int(place)
        node.args[here : here + 2] = reversed(node.args[here : here + 2])
    elif kind.startswith("*"):
        node.value = node.value * float(kind[1:]) or float(kind[1:]) - 1.0  # zero becomes a tenth, up or down
    else:
        node.value += int(kind)
    return changed


def _put(tree: ast.AST, path: tuple, node: ast.AST) -> ast.AST:
    """Put a node in the place of another, or of the whole tree."""
    if not path:
        return node
    *head, (name, index) = path
    parent = _reach(tree, tuple(head))
    if index is None:
        setattr(parent, name, node)
    else:
        getattr(parent, name)[index] = node
    return tree


def _shown(node: ast.AST) -> str:
    """Return a statement without the block it heads."""
    return ast.unparse(node).partition(":\n")[0]
