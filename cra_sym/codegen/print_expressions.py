"""Expressions of the restricted form as text, with brackets that keep the tree, so that all languages round alike."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from cra_sym.kernels.form import INT, Constant, FunctionDefinition, Program, Type

__all__ = ["ALWAYS", "OPERATORS", "ExpressionPrinter"]

ALWAYS = 10  # precedence of expressions that never need brackets
_ADD, _MULTIPLY, _UNARY = 6, 7, 8
_COMPARE = 4
_LARGEST_SINGLE = 3e38
OPERATORS: dict[type, tuple[str, int]] = {
    ast.Add: ("+", _ADD),
    ast.Sub: ("-", _ADD),
    ast.Mult: ("*", _MULTIPLY),
    ast.Div: ("/", _MULTIPLY),
}
_COMPARISONS: dict[type, str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip


class ExpressionPrinter:
    """Printer of the expressions of the current function.

    Attributes
    ----------
    form : Program
    current : FunctionDefinition
    real : {'float64', 'float32'}
    """

    form: Program
    current: FunctionDefinition
    real: str
    true, false = "true", "false"
    both, either, negation = "&&", "||", "!"
    origin = 0
    functions: ClassVar[Mapping[str, str]] = {}
    choice_least = 1  # operands of lower precedence are bracketed inside a conditional expression

    def choice(self, condition: str, value: str, otherwise: str) -> tuple[str, int]:
        """Return a conditional expression and its precedence; the parts are bracketed as operands of comparisons."""
        return f"{condition} ? {value} : {otherwise}", 0

    @staticmethod
    def callee(call: ast.Call) -> str:
        """Return the name of the function called."""
        assert isinstance(call.func, ast.Name)
        return call.func.id

    def kind(self, node: ast.expr) -> Type:
        """Return the type of an expression."""
        return self.current.types[id(node)]

    def expression(self, node: ast.expr, least: int = 0) -> str:
        """Return an expression, in brackets if its precedence is below ``least``."""
        text, strength = self.printed(node)
        return f"({text})" if strength < least else text

    def printed(self, node: ast.expr) -> tuple[str, int]:
        """Return an expression and its precedence."""
        match node:
            case ast.Constant(value=bool() as value):
                return (self.true if value else self.false), ALWAYS
            case ast.Constant(value=float() as value):
                return self.number(value), ALWAYS
            case ast.Constant(value=value):
                return str(value), ALWAYS
            case ast.Name(id=name):
                return self.variable(name), ALWAYS
            case ast.Attribute(value=base, attr=name):
                return self.field(base, name), ALWAYS
            case ast.Subscript(value=base, slice=index):
                return self.entry(self.expression(base), self.index(index)), ALWAYS
            case ast.UnaryOp(op=ast.USub(), operand=part):
                text = self.expression(part, _UNARY)
                return f"-({text})" if text.startswith("-") else f"-{text}", _UNARY
            case ast.UnaryOp(operand=part):
                return f"{self.negation}{self.expression(part, ALWAYS)}", 3
            case ast.BinOp(left=left, op=op, right=right):
                return self.operation(left, op, right)
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                return self.compared(left, op, right)
            case ast.BoolOp(op=op, values=parts):
                word = self.both if isinstance(op, ast.And) else self.either
                return f" {word} ".join(self.expression(part, _COMPARE) for part in parts), 2
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return self.choice(*(self.expression(part, self.choice_least) for part in (test, body, orelse)))
            case ast.Call(args=args):
                return self.called(self.callee(node), args)
        raise AssertionError(ast.dump(node))

    def operation(self, left: ast.expr, op: ast.operator, right: ast.expr) -> tuple[str, int]:
        """Return an operation on two numbers."""
        if isinstance(op, ast.FloorDiv | ast.Mod):
            return self.divided(left, right, isinstance(op, ast.Mod))
        sign, strength = OPERATORS[type(op)]
        return f"{self.expression(left, strength)} {sign} {self.expression(right, strength + 1)}", strength

    def divided(self, left: ast.expr, right: ast.expr, rest: bool) -> tuple[str, int]:
        """Return the quotient or the remainder of integers that are not negative."""
        sign = "%" if rest else "/"
        return f"{self.expression(left, _MULTIPLY)} {sign} {self.expression(right, _UNARY)}", _MULTIPLY

    def compared(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> tuple[str, int]:
        """Return a comparison."""
        sign = self.comparison(_COMPARISONS[type(op)])
        return f"{self.expression(left, _COMPARE + 1)} {sign} {self.expression(right, _COMPARE + 1)}", _COMPARE

    def comparison(self, sign: str) -> str:
        """Return the language's sign of a comparison."""
        return sign

    def called(self, name: str, arguments: Sequence[ast.expr]) -> tuple[str, int]:
        """Return a call inside an expression."""
        if name in self.form.functions:
            given = ", ".join(self.argument(a) for a in arguments)
            return f"{self.function_name(self.form.functions[name])}({given})", ALWAYS
        if name == "float":
            return self.to_float(arguments[0])
        if name == "int":
            return self.to_int(arguments[0])
        return self.built_in(name, arguments)

    def built_in(self, name: str, arguments: Sequence[ast.expr]) -> tuple[str, int]:
        """Return a call of a function of the language."""
        integer = self.kind(arguments[0]) == INT
        word = self.integer_function(name) if integer else self.functions[name]
        return f"{word}({', '.join(self.expression(a) for a in arguments)})", ALWAYS

    def integer_function(self, name: str) -> str:
        """Return the word for abs, min or max of integers."""
        return name

    def argument(self, node: ast.expr, changed: bool = False) -> str:
        """Return an argument of a call of a function of the text."""
        return self.expression(node)

    def variable(self, name: str) -> str:
        """Return a variable or a constant."""
        return name

    def field(self, base: ast.expr, name: str) -> str:
        """Return a field of a record."""
        return f"{self.expression(base)}.{name}"

    def entry(self, row: str, index: str) -> str:
        """Return an entry of a row."""
        return f"{row}[{index}]"

    def index(self, node: ast.expr) -> str:
        """Return an index, with the base of the language."""
        if not self.origin:
            return self.expression(node)
        match node:
            case ast.Constant(value=int() as value):
                return str(value + 1)
            case ast.BinOp(left=left, op=ast.Sub(), right=ast.Constant(value=1)):
                return self.expression(left)
        return f"{self.expression(node, _ADD)} + 1"

    def last(self, stop: ast.expr, step: int) -> str:
        """Return the last number of a loop, for languages with inclusive loop bounds."""
        match stop:
            case ast.Constant(value=int() as value):
                return str(value - step)
            case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() as value)):
                return str(-value - step)
            case ast.BinOp(left=left, op=ast.Add(), right=ast.Constant(value=1)) if step == 1:
                return self.expression(left)
        return f"{self.expression(stop, _ADD)} {'-' if step == 1 else '+'} 1"

    def number(self, value: float) -> str:
        """Return a literal that reads back as exactly this number."""
        return self.digits(value)

    def digits(self, value: float) -> str:
        """Return the shortest digits that identify a number of this type."""
        return str(np.float32(value)) if self.real == "float32" else repr(float(value))

    def literal(self, constant: Constant) -> list[str]:
        """Return the values of a constant."""
        if self.real == "float32" and any(abs(v) > _LARGEST_SINGLE for v in constant.values):
            raise ValueError(f"real = 'float32': {constant.name} is out of its range; take float64 or fewer modes")
        return [str(v) if constant.type.name == "int" else self.number(v) for v in constant.values]

    def to_float(self, node: ast.expr) -> tuple[str, int]:
        """Return an integer as a double."""
        raise NotImplementedError

    def to_int(self, node: ast.expr) -> tuple[str, int]:
        """Return a double truncated toward zero."""
        raise NotImplementedError

    def function_name(self, function: FunctionDefinition) -> str:
        """Return the name of a function as it is printed."""
        return function.name.lstrip("_")

    def loops_length(self, kind: Type) -> str:
        """Return the length of a row as text."""
        return str(kind.length)
