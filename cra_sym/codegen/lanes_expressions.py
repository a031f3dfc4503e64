"""Expressions in loops over lanes as C99, with types inferred from the operands and constants folded."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

__all__ = [
    "ATOM",
    "CONDITION",
    "DOUBLE",
    "HELPERS",
    "INTEGER",
    "Kind",
    "LaneExpressions",
    "Rows",
    "Value",
    "literal",
    "local",
    "named",
    "root_in",
]

DOUBLE, INTEGER, CONDITION = "double", "int64_t", "int"
_WIDTHS = (CONDITION, INTEGER, DOUBLE)
_TERNARY, _OR, _AND, _BITS, _EQUAL, _LESS, _ADD, _MULTIPLY, _UNARY, ATOM = range(1, 11)
_BINARY: dict[type, tuple[str, int]] = {
    ast.Add: ("+", _ADD), ast.Sub: ("-", _ADD), ast.Mult: ("*", _MULTIPLY), ast.Div: ("/", _MULTIPLY),
    ast.BitAnd: ("&", _BITS), ast.BitOr: ("|", _BITS), ast.LShift: ("<<", _BITS), ast.RShift: (">>", _BITS),
}  # fmt: skip
_COMPARISONS: dict[type, tuple[str, int]] = {
    ast.Lt: ("<", _LESS), ast.LtE: ("<=", _LESS), ast.Gt: (">", _LESS), ast.GtE: (">=", _LESS),
    ast.Eq: ("==", _EQUAL), ast.NotEq: ("!=", _EQUAL),
}  # fmt: skip
_CONSTANTS = {"pi": repr(math.pi), "nan": "(double)NAN", "inf": "HUGE_VAL"}
_EXTREMES = {"min": ("lanes_smaller", "lanes_least"), "max": ("lanes_larger", "lanes_largest")}  # of integers, doubles
HELPERS = {
    name: f"static inline {kind} {name}({kind} one, {kind} other)\n{{\n    return other {sign} one ? other : one;\n}}"
    for names, sign in zip(_EXTREMES.values(), "<>", strict=True)
    for name, kind in zip(names, (INTEGER, DOUBLE), strict=True)
} | {
    name: f"static inline {to} {name}({of} x)\n{{\n    {to} y;\n    memcpy(&y, &x, sizeof y);\n    return y;\n}}"
    for name, of, to in (("bits_of", DOUBLE, INTEGER), ("of_bits", INTEGER, DOUBLE))
}


@dataclass(frozen=True)
class Rows:
    """An array: the type of its entries, and its lengths as C text."""

    kind: str
    lengths: tuple[str, ...]

    def parameter(self, name: str) -> str:
        """Return the declaration as a parameter."""
        if len(self.lengths) == 1 or not self.fixed:
            return f"{self.kind} {name}[restrict]"
        return f"{self.kind} (*restrict {name})[{self.lengths[1]}]"

    @property
    def fixed(self) -> bool:
        """Whether the length of a row is known to the compiler."""
        return self.lengths[-1].isupper() or self.lengths[-1].isdigit()


Kind = str | Rows


@dataclass(frozen=True)
class Value:
    """An expression: text, precedence, type, and the number if it is a constant."""

    text: str
    strength: int
    kind: Kind
    number: float | int | None = None


class Surroundings(Protocol):
    """Interface of the printer of the surrounding module."""

    tree: dict[str, ast.FunctionDef]
    summaries: Mapping[str, str]
    most: Mapping[str, str]
    comments: dict[int, str]
    results: dict[str, Kind | tuple[str, ...] | None]
    helpers: set[str]

    def call(self, name: str, kinds: Sequence[Kind | None]) -> Kind | tuple[str, ...] | None:
        """Print a function if it is new; return the type of its result."""

    def lengths_of(self, name: str) -> list[tuple[str, int]]:
        """Return the lengths of its arguments that a function needs."""

    def constant(self, name: str) -> Value:
        """Return a constant of the text."""


class LaneExpressions:
    """Printer of the expressions of one function.

    Attributes
    ----------
    printer : Surroundings
    names : dict of str to str or Rows
        Names that have a value so far.
    fixed : dict of str to int
        Variables of unrolled loops.
    left_out : set of str
        Arguments that are not printed.
    """

    printer: Surroundings
    names: dict[str, Kind]
    fixed: dict[str, int]
    left_out: set[str]

    def typed(self, value: Value, kind: Kind | tuple[str, ...]) -> Value:
        """Return a value as one of a wider kind."""
        if value.kind == kind or not isinstance(kind, str):
            return value
        if value.number is not None:
            return literal(float(value.number) if kind == DOUBLE else value.number)
        if kind == DOUBLE:
            return Value(f"(double){_bracketed(value, _UNARY)}", _UNARY, DOUBLE)
        return Value(value.text, value.strength, kind)

    def value(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant(value=bool() as truth):
                return Value(str(int(truth)), ATOM, CONDITION)
            case ast.Constant(value=(int() | float()) as number):
                return literal(number)
            case ast.Name(id=name):
                if name in self.fixed:
                    return literal(self.fixed[name])
                if name in self.names:
                    return Value(local(name), ATOM, self.names[name])
                return self.printer.constant(name)
            case ast.Attribute(value=ast.Name(id="np"), attr=name):
                return Value(_CONSTANTS[name], ATOM, DOUBLE, math.pi if name == "pi" else None)
            case ast.Subscript(
                value=ast.Attribute(value=ast.Name(id=name), attr="shape"), slice=ast.Constant(value=int() as i)
            ):
                return Value(f"{name}_{i}", ATOM, INTEGER)
            case ast.Subscript(value=base, slice=index):
                return self.entry(self.value(base), index)
            case ast.UnaryOp(op=ast.USub(), operand=part):
                inner = self.value(part)
                if inner.number is not None:
                    return literal(-inner.number)
                return Value(f"-{_bracketed(inner, _UNARY + 1)}", _UNARY, inner.kind)
            case ast.UnaryOp(op=ast.Not(), operand=part):
                return Value(f"!{_bracketed(self.value(part), ATOM)}", _UNARY, CONDITION)
            case ast.BinOp(left=left, op=op, right=right):
                return self.operation(self.value(left), op, self.value(right))
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                one, two = self.widened(self.value(left), self.value(right))
                sign, strength = _COMPARISONS[type(op)]
                text = f"{_bracketed(one, _ADD)} {sign} {_bracketed(two, _ADD)}"
                return Value(text, strength, CONDITION)
            case ast.Compare(left=left, ops=ops, comparators=others):
                parts = [left, *others]
                pairs = [ast.Compare(a, [op], [b]) for a, op, b in zip(parts, ops, others, strict=False)]
                return self.value(ast.BoolOp(op=ast.And(), values=list(pairs)))
            case ast.BoolOp(op=op, values=parts):
                sign, strength = ("&&", _AND) if isinstance(op, ast.And) else ("||", _OR)
                text = f" {sign} ".join(_bracketed(self.value(part), _EQUAL) for part in parts)
                return Value(text, strength, CONDITION)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                one, two = self.widened(self.value(body), self.value(orelse))
                texts = _bracketed(self.value(test), _EQUAL), _bracketed(one, _OR), _bracketed(two, _OR)
                return Value("{} ? {} : {}".format(*texts), _TERNARY, one.kind)
            case ast.Call(func=ast.Attribute(value=base, attr="view"), args=[ast.Attribute(attr=kind)]):
                name, result = ("bits_of", INTEGER) if kind == "int64" else ("of_bits", DOUBLE)
                self.printer.helpers.add(name)
                return Value(f"{name}({self.value(base).text})", ATOM, result)
            case ast.Call(func=ast.Attribute(value=ast.Name(id="np"), attr=name), args=[argument]):
                return self.of_numpy(name, self.value(argument))
            case ast.Call(func=ast.Name(id=name)) if name in self.printer.tree:
                return self.called(name, node)
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return self.built_in(name, [self.value(a) for a in arguments])
        raise ValueError(f"loops over lanes hold nothing like: {ast.unparse(node)}")

    def widened(self, one: Value, two: Value) -> tuple[Value, Value]:
        kind = max((str(one.kind), str(two.kind)), key=_WIDTHS.index)
        return self.typed(one, kind), self.typed(two, kind)

    def operation(self, left: Value, op: ast.operator, right: Value) -> Value:
        if isinstance(op, ast.Pow):
            if right.number != 2:
                raise ValueError("powers are squares")
            return self.operation(left, ast.Mult(), left)
        if left.number is not None and right.number is not None:
            return literal(_folded(left.number, op, right.number))
        one, two = self.widened(left, right)
        if isinstance(op, ast.Div):
            one, two = self.typed(one, DOUBLE), self.typed(two, DOUBLE)
        if isinstance(op, ast.LShift):  # undefined for a negative number
            text = f"(int64_t)((uint64_t){_bracketed(one, _UNARY)} << {two.text})"
            return Value(text, _UNARY, INTEGER)
        sign, strength = _BINARY[type(op)]
        least = _UNARY if strength == _BITS else strength
        text = f"{_bracketed(one, least)} {sign} {_bracketed(two, least if strength == _BITS else least + 1)}"
        return Value(text, strength, one.kind)

    def entry(self, row: Value, index: ast.expr) -> Value:
        indices = [self.value(i) for i in (index.elts if isinstance(index, ast.Tuple) else [index])]
        assert isinstance(row.kind, Rows)
        rest = row.kind.lengths[len(indices) :]
        kind: Kind = Rows(row.kind.kind, rest) if rest else row.kind.kind.removeprefix("const ")
        if len(indices) == 2 and not row.kind.fixed:
            text = f"{_bracketed(indices[0], _MULTIPLY)} * {row.kind.lengths[1]} + {_bracketed(indices[1], _ADD)}"
            return Value(f"{row.text}[{text}]", ATOM, kind)
        return Value(row.text + "".join(f"[{i.text}]" for i in indices), ATOM, kind)

    def of_numpy(self, name: str, value: Value) -> Value:
        if name == "float64":
            return self.typed(value, DOUBLE)
        if name == "int64":
            if value.kind != DOUBLE:
                return value
            return Value(f"(int64_t){_bracketed(value, _UNARY)}", _UNARY, INTEGER)
        return Value(f"{name}({self.typed(value, DOUBLE).text})", ATOM, DOUBLE)

    def built_in(self, name: str, values: list[Value]) -> Value:
        if name == "abs":
            return Value(f"fabs({self.typed(values[0], DOUBLE).text})", ATOM, DOUBLE)
        found = values[0]
        for other in values[1:]:
            one, two = self.widened(found, other)
            helper = _EXTREMES[name][one.kind == DOUBLE]
            self.printer.helpers.add(helper)
            found = Value(f"{helper}({one.text}, {two.text})", ATOM, one.kind)
        return found

    def called(self, name: str, node: ast.Call) -> Value:
        """Return a call, with a placeholder for results returned through arguments."""
        given = [None if root_in(a, self.left_out) else self.value(a) for a in node.args]
        kinds = [None if v is None else v.kind for v in given]
        result = self.printer.call(name, kinds)
        parameters = [a.arg for a in self.printer.tree[name].args.args]
        texts = [v.text for v in given if v is not None]
        by_name = dict(zip(parameters, given, strict=True))
        for parameter, i in self.printer.lengths_of(name):
            value = by_name[parameter]
            assert value is not None and isinstance(value.kind, Rows)
            texts.append(value.kind.lengths[i])
        if isinstance(result, Rows):
            return Value(f"{named(name)}({', '.join([*texts, '@'])})", ATOM, result)
        if isinstance(result, tuple):
            return Value(f"{named(name)}({', '.join([*texts, '@'])})", ATOM, "void")
        return Value(f"{named(name)}({', '.join(texts)})", ATOM, result or "void")


def literal(number: float | int) -> Value:
    """Return a number."""
    return Value(repr(number), ATOM if number >= 0 else _UNARY, INTEGER if isinstance(number, int) else DOUBLE, number)


def _folded(one: float | int, op: ast.operator, two: float | int) -> float | int:
    match op:
        case ast.Add():
            return one + two
        case ast.Sub():
            return one - two
        case ast.Mult():
            return one * two
        case ast.Div():
            return one / two
    raise ValueError(f"{type(op).__name__} of constants")


def _bracketed(value: Value, least: int) -> str:
    return f"({value.text})" if value.strength < least else value.text


def named(name: str) -> str:
    """Return the name of a function in C."""
    return f"lanes_{name.strip('_')}"


def local(name: str) -> str:
    """Return the name of a variable in C."""
    return "unused" if name == "_" else name


def root_in(node: ast.expr, names: set[str]) -> bool:
    """Return whether an expression is one of the names, or an entry of one."""
    while isinstance(node, ast.Subscript):
        node = node.value
    return isinstance(node, ast.Name) and node.id in names
