"""Formulas of the solvers as functions of the restricted form, with their derivatives.

A function of arrays is run with :class:`Term` arguments, which record its operations. Results used once are inlined,
others get a name. With :class:`Dual` numbers the derivatives are recorded too.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Sequence
from typing import Any

from cra_sym.solvers.straight import Exact, Term, wanted_lines

__all__ = ["Dual", "Traced", "parts"]

_LONGEST = 12  # largest number of operations in an expression
_CALLED = re.compile(r"(\w+)\(k, i, ([\w\[\]]+)\)")
_NO_RATE = {"exp", "log"}
"""Functions whose rates do not matter: exponentials, which are only positive scale factors, and a first guess."""


def parts(value: Any) -> tuple[Any, Any]:
    """Return a number and its rate."""
    return (value.value, value.rate) if isinstance(value, Dual) else (value, Exact(0))


class Dual(Term):
    """A dual number: a number and its rate, with the rules of differentiation."""

    __slots__ = ("rate",)

    def __init__(self, value: Term, rate: Any) -> None:
        super().__init__(value.name, value.lines)
        self.rate = rate

    @property
    def value(self) -> Term:
        """The number alone."""
        return Term(self.name, self.lines)

    def called(self, function: str, results: int) -> tuple[Term, ...]:
        """Return cosh(sqrt m) and sinh(sqrt m) / sqrt m, whose rates by m are s/2 and a third result."""
        found: tuple[Any, ...] = self.value.called(f"{function}_rate", 3)
        c, s, rate = found
        return Dual(c, s * 0.5 * self.rate), Dual(s, rate * self.rate)

    def __array_ufunc__(self, function: Any, method: str, *given: Any) -> Any:
        name = function.__name__
        if name not in _NO_RATE | {"sqrt"}:
            return super().__array_ufunc__(function, method, *given)
        value = self.value.__array_ufunc__(function, method, self.value)
        return value if name in _NO_RATE else Dual(value, _over(0.5 * self.rate, value))

    def __array_function__(self, function: Any, types: Any, given: Any, options: Any) -> Any:
        condition, *choices = given
        (one, first), (other, second) = map(parts, choices)
        if not isinstance(condition, Term):
            return choices[0] if condition else choices[1]
        value = super().__array_function__(function, types, (condition, one, other), options)
        if isinstance(first, Exact) and isinstance(second, Exact):
            return value
        return Dual(value, super().__array_function__(function, types, (condition, first, second), options))

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.rate)

    def _with(self, other: Any, operation: str, *, turned: bool = False) -> Any:
        if isinstance(other, Exact) and not turned:
            return NotImplemented  # Exact simplifies trivial operations
        (a, first), (b, second) = map(parts, (other, self) if turned else (self, other))
        if operation == "+":
            return _dual(a + b, first + second)
        if operation == "-":
            return _dual(a - b, first - second)
        if operation == "*":
            return _dual(a * b, first * b + a * second)
        value = a / b
        return _dual(value, _over(first - value * second, b))

    def __add__(self, other: Any) -> Any:
        return self._with(other, "+")

    def __radd__(self, other: Any) -> Any:
        return self._with(other, "+", turned=True)

    def __sub__(self, other: Any) -> Any:
        return self._with(other, "-")

    def __rsub__(self, other: Any) -> Any:
        return self._with(other, "-", turned=True)

    def __mul__(self, other: Any) -> Any:
        return self._with(other, "*")

    def __rmul__(self, other: Any) -> Any:
        return self._with(other, "*", turned=True)

    def __truediv__(self, other: Any) -> Any:
        return self._with(other, "/")

    def __rtruediv__(self, other: Any) -> Any:
        return self._with(other, "/", turned=True)


def _dual(value: Any, rate: Any) -> Any:
    return value if isinstance(rate, Exact) and not rate.value else Dual(value, rate)


def _over(value: Any, divisor: Any) -> Any:
    """Return a quotient of rates; for a divisor 0, where it is discarded, 0."""
    return divisor.quotient(value) if isinstance(divisor, Term) and not isinstance(value, Exact) else value / divisor


class Traced:
    """The text of one function of rows and numbers, all of type float.

    Parameters
    ----------
    name, doc : str
    rows : sequence of (name, length)
        Arguments that are rows.
    numbers : sequence of str
        Arguments that are numbers.
    guarded : bool
        Whether divisors may be 0, where the quotient does not matter.
    """

    def __init__(
        self,
        name: str,
        doc: str,
        rows: Sequence[tuple[str, str]],
        numbers: Sequence[str] = (),
        *,
        guarded: bool = False,
    ) -> None:
        self._name, self._doc, self._guarded = name, doc, guarded
        self._given = [*(f"{row}: Row[float, {length}]" for row, length in rows), *(f"{one}: float" for one in numbers)]
        self._lines: dict[str, str] = {}

    def number(self, name: str) -> Term:
        """Return a number argument."""
        return Term(name, self._lines)

    def entry(self, row: str, place: int) -> Term:
        """Return an entry of a row argument."""
        return Term(f"{row}[{place}]", self._lines)

    def text(self, results: Iterable[Any], out: Sequence[tuple[str, str, int]] = ()) -> str:
        """Return the function: of one number, or one that fills rows given by name, length and number of entries."""
        found = list(results)
        names = [f"{row}[{i}]" for row, _, size in out for i in range(size)]
        kept = wanted_lines(self._lines, [_name(value) for value in found])
        body = _StatementMerger(kept, [_name(value) for value in found], guarded=self._guarded)
        steps, values = body.written()
        if not out and steps and steps[-1].startswith(f"{values[0]} = "):
            values[0] = steps.pop().partition(" = ")[2]
        filled = [f"{row}: Out[Row[float, {length}]]" for row, length, _ in out]
        head = f"def {self._name}({', '.join([*self._given, *filled])}) -> {'None' if out else 'float'}:"
        last = (
            [f"{name} = {value}" for name, value in zip(names, values, strict=True)] if out else [f"return {values[0]}"]
        )
        return "\n    ".join([head, f'"""{self._doc}"""', *steps, *last]) + "\n"


def _name(value: Any) -> str:
    return value.name if isinstance(value, Term) else repr(float(value.value if isinstance(value, Exact) else value))


class _StatementMerger:
    """Merger of lines of one operation each into few statements."""

    def __init__(self, lines: Sequence[tuple[list[str], str]], results: Sequence[str], *, guarded: bool) -> None:
        self._lines, self._results, self._guarded = lines, results, guarded
        texts = [*(text for _, text in lines), *results]
        found = [name for text in texts for name in re.findall(r"\bt\d+\w*", text)]
        self._uses = {name: found.count(name) for name in set(found)}
        self._known: dict[str, ast.expr] = {}

    def written(self) -> tuple[list[str], list[str]]:
        """Return the statements and the results."""
        steps, number = [], 0
        for names, text in self._lines:
            call = _CALLED.fullmatch(text)
            if call:
                row = f"w{number}"
                argument = ast.unparse(self._expression(call[2]))
                steps += [f"{row} = zeros({len(names)})", f"{call[1]}({argument}, {row})"]
                self._known |= {name: _parsed(f"{row}[{i}]") for i, name in enumerate(names)}
                number += 1
                continue
            expression = self._expression(text)
            if self._uses[names[0]] == 1 and self._inlined(expression):
                self._known[names[0]] = expression
            elif isinstance(expression, ast.Constant | ast.Name | ast.Subscript):
                self._known[names[0]] = expression
            else:
                steps.append(f"x{number} = {ast.unparse(expression)}")
                self._known[names[0]] = ast.Name(f"x{number}")
                number += 1
        return steps, [ast.unparse(self._expression(result)) for result in self._results]

    def _inlined(self, expression: ast.expr) -> bool:
        size = sum(isinstance(node, ast.BinOp | ast.Call | ast.Compare) for node in ast.walk(expression))
        return size < _LONGEST and not isinstance(expression, ast.IfExp)

    def _expression(self, text: str) -> ast.expr:
        return _Written(self._known, guarded=self._guarded).visit(_parsed(text))  # type: ignore[no-any-return]


def _parsed(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


class _Written(ast.NodeTransformer):
    """One operation in the restricted form, with its operands inlined."""

    def __init__(self, known: dict[str, ast.expr], *, guarded: bool) -> None:
        self._known, self._guarded = known, guarded

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return self._known.get(node.id, node)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        arguments = [self.visit(argument) for argument in node.args]
        word = node.func.attr if isinstance(node.func, ast.Attribute) else ast.unparse(node.func)
        if word == "where" and ast.unparse(arguments[1]) == ast.unparse(arguments[2]):
            return arguments[1]  # type: ignore[no-any-return]
        if word == "where":
            return ast.IfExp(*arguments)
        return ast.Call(ast.Name({"absolute": "abs"}.get(word, word)), arguments, [])

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        operand = self.visit(node.operand)
        if isinstance(node.op, ast.USub) and isinstance(operand, ast.UnaryOp):
            return operand.operand
        return ast.UnaryOp(node.op, operand)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        left, right = self.visit(node.left), self.visit(node.right)
        if isinstance(node.op, ast.BitAnd | ast.BitOr):
            return ast.BoolOp(ast.And() if isinstance(node.op, ast.BitAnd) else ast.Or(), [left, right])
        if isinstance(node.op, ast.Mult) and (_is(left, 0.0) or _is(right, 0.0)):
            return ast.Constant(0.0)
        if isinstance(node.op, ast.Add | ast.Sub) and _is(right, 0.0):
            return left  # type: ignore[no-any-return]
        if isinstance(node.op, ast.Add) and _is(left, 0.0):
            return right  # type: ignore[no-any-return]
        if isinstance(node.op, ast.Sub) and _factors(left) == _factors(right):
            return ast.Constant(0.0)
        if isinstance(node.op, ast.Div) and self._guarded and not isinstance(right, ast.Constant):
            return ast.Call(ast.Name("_quotient"), [left, right], [])
        return ast.BinOp(left, node.op, right)


def _factors(node: ast.expr) -> list[str]:
    """Return both factors of a product, whose rounding does not depend on their order, or one expression."""
    match node:
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return sorted([ast.unparse(left), ast.unparse(right)])
    return [ast.unparse(node)]


def _is(node: ast.expr, value: float) -> bool:
    return isinstance(node, ast.Constant) and node.value == value
