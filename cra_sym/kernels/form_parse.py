"""Parser of the restricted form; see :mod:`cra_sym.kernels.form`."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Mapping

from cra_sym.kernels.form import Constant, FormError, FunctionDefinition, Program, Record, Type, refused
from cra_sym.kernels.form_check import Checker, literal, type_of

__all__ = ["comments_of", "parse"]


def parse(text: str) -> Program:
    """Parse and check a text.

    Raises
    ------
    FormError
        Names the line and what is not allowed there.

    Examples
    --------
    >>> form = parse("def twice(x: float) -> float:\\n    return x + x  # exact\\n")
    >>> form.functions["twice"].result
    Type(name='float', length=None, access='in')
    """
    tree = ast.parse(text)
    comments, alone = comments_of(text)
    constants: dict[str, Constant] = {}
    records: dict[str, Record] = {}
    functions: dict[str, FunctionDefinition] = {}
    for node in tree.body:
        match node:
            case ast.Expr(value=ast.Constant(value=str())) | ast.ImportFrom():
                continue
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                constants[name] = _constant(name, value, comments.get(node.lineno, ""), constants)
            case ast.ClassDef():
                records[node.name] = _record(node, comments, records, constants)
            case ast.FunctionDef():
                functions[node.name] = Checker(node, constants, records, functions).function
            case _:
                raise refused(node)
    names = [*constants, *records, *functions]
    plain = [name.lower().strip("_") for name in names]
    clashes = sorted({name for name in plain if plain.count(name) > 1})
    if clashes:
        raise FormError(f"names at the top must differ by more than case and underscores: {', '.join(clashes)}")
    return Program(ast.get_docstring(tree) or "", constants, records, functions, comments, alone)


def comments_of(text: str) -> tuple[dict[int, str], frozenset[int]]:
    """Return the comment of each line that has one, and the lines that contain only a comment."""
    found: dict[int, str] = {}
    alone = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            line = token.start[0]
            found[line] = token.string.lstrip("#").strip().removesuffix("# fmt: skip").strip()
            if token.line[: token.start[1]].strip() == "":
                alone.add(line)
    return found, frozenset(alone)


def _constant(name: str, node: ast.expr, comment: str, known: Mapping[str, Constant]) -> Constant:
    parts = node.elts if isinstance(node, ast.Tuple) else [node]
    values = [literal(part) for part in parts]
    if not values or None in values or len({type(value) for value in values}) > 1:
        raise refused(node, "a constant is a number, or numbers of one kind")
    if name in known:
        raise refused(node, f"{name} has a value already")
    numbers = tuple(value for value in values if value is not None)
    kind = "int" if isinstance(numbers[0], int) else "float"
    return Constant(name, Type(kind, len(parts) if isinstance(node, ast.Tuple) else None), numbers, comment)


def _record(
    node: ast.ClassDef, comments: Mapping[int, str], records: Mapping[str, Record], constants: Mapping[str, Constant]
) -> Record:
    fields, words = {}, {}
    infinite: set[str] = set()
    for part in node.body:
        match part:
            case ast.Expr(value=ast.Constant(value=str())):
                continue
            case ast.AnnAssign(target=ast.Name(id=name), annotation=annotation, value=None | ast.Name(id="inf")):
                fields[name] = type_of(annotation, records, constants)
                infinite |= {name} if part.value is not None else set()
                words[name] = comments.get(part.lineno, "")
                if fields[name].changed or fields[name].name in records:
                    raise refused(part, "a field is a number, a condition or a row of them")
            case _:
                raise refused(part)
    return Record(node.name, ast.get_docstring(node) or "", fields, words, frozenset(infinite))
