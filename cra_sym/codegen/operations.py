"""Floating-point operations of a function of a checked text, counted for the worst case."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping

from cra_sym.kernels.form import FLOAT, FunctionDefinition, Program

__all__ = ["operations"]


def operations(form: Program, name: str, most: Mapping[str, int]) -> int:
    """Return the largest number of floating-point operations of a call.

    An operation is a sum, a difference, a product, a quotient, a comparison or a function of the language.

    Parameters
    ----------
    form : Program
    name : str
        Of the function.
    most : mapping of str to int
        Largest value of the end of a loop, by its text, where it is not a constant.

    Raises
    ------
    ValueError
        If a loop has no known end.
    """
    return _Counter(form, form.functions[name], most).block(form.functions[name].body)


class _Counter:
    def __init__(self, form: Program, function: FunctionDefinition, most: Mapping[str, int]) -> None:
        self.form, self.function, self.most = form, function, most

    def block(self, statements: Iterable[ast.stmt]) -> int:
        return sum(map(self.statement, statements))

    def statement(self, node: ast.stmt) -> int:
        match node:
            case ast.For(iter=ast.Call(args=args), body=body):
                ends = [self.whole(end) for end in args]
                rounds = abs(ends[1] - ends[0]) if len(ends) > 1 else ends[0]
                return rounds * self.block(body)
            case ast.If(test=test, body=body, orelse=orelse):
                return self.expression(test) + max(self.block(body), self.block(orelse))
            case ast.While():
                raise ValueError(f"{self.function.name}: a loop without a known end")
            case ast.AugAssign(target=target, value=value):
                return self.expression(value) + (self.function.types.get(id(target)) == FLOAT)
        return sum(self.expression(part) for part in ast.iter_child_nodes(node) if isinstance(part, ast.expr))

    def expression(self, node: ast.expr) -> int:
        inside = sum(self.expression(part) for part in ast.iter_child_nodes(node) if isinstance(part, ast.expr))
        match node:
            case ast.BinOp(left=one) | ast.Compare(left=one):
                return inside + (self.function.types.get(id(one)) == FLOAT)
            case ast.Call(func=ast.Name(id=name)) if name in self.form.functions:
                return inside + operations(self.form, name, self.most)
            case ast.Call(func=ast.Name(id=name)) if name not in ("zeros", "records", "float", "int"):
                return inside + (name not in self.form.records)
        return inside

    def whole(self, node: ast.expr) -> int:
        text = ast.unparse(node)
        if text in self.most:
            return self.most[text]
        if text in self.form.constants:
            return int(self.form.constants[text].values[0])
        match node:
            case ast.Constant(value=int() as number):
                return number
        raise ValueError(f"{self.function.name}: {text} has no known end")
