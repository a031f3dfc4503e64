"""Arithmetic emitted with an LLVM builder: constants are Python numbers, all other operands LLVM values."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import errors, types
from numba.core.registry import cpu_target

__all__ = ["CONDITION", "DOUBLE", "INTEGER", "Arithmetic", "is_constant", "kind_named", "kind_of"]

DOUBLE, INTEGER, CONDITION = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
_KINDS = {bool: CONDITION, int: INTEGER, float: DOUBLE}
_WIDTHS = CONDITION, INTEGER, DOUBLE  # each type includes the preceding ones
_OPERATIONS: dict[type, tuple[Callable[..., Any], str | None, str | None]] = {  # of constants, doubles, integers
    ast.Add: (operator.add, "fadd", "add"),
    ast.Sub: (operator.sub, "fsub", "sub"),
    ast.Mult: (operator.mul, "fmul", "mul"),
    ast.Div: (operator.truediv, "fdiv", None),
    ast.FloorDiv: (operator.floordiv, None, "sdiv"),
    ast.Mod: (operator.mod, None, "srem"),
    ast.Pow: (operator.pow, None, None),
    ast.BitAnd: (operator.and_, None, "and_"),
    ast.BitOr: (operator.or_, None, "or_"),
    ast.LShift: (operator.lshift, None, "shl"),
    ast.RShift: (operator.rshift, None, "ashr"),
}
_COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_BY_CONSTANTS = {  # operators whose right side must be one of these constants; LLVM leaves others undefined
    ast.FloorDiv: range(1, 2**63),
    ast.Mod: range(1, 2**63),
    ast.LShift: range(64),
    ast.RShift: range(64),
}
_LARGEST_POWER = 64  # largest exponent that becomes products


def is_constant(value: Any) -> bool:
    """Return whether a number is known at compile time."""
    return isinstance(value, (bool, int, float))


def kind_of(value: Any) -> Any:
    """Return the LLVM type of a number."""
    if is_constant(value):
        return next(kind for of, kind in _KINDS.items() if isinstance(value, of))
    if getattr(value, "type", None) not in _WIDTHS:
        raise errors.TypingError(f"{value!r} is not a number")
    return value.type


def kind_named(name: Any) -> Any:
    """Return the LLVM type of ``np.float64`` or ``np.int64``."""
    if name not in (np.float64, np.int64):
        raise errors.TypingError(f"{name} is neither np.float64 nor np.int64")
    return DOUBLE if name is np.float64 else INTEGER


class Arithmetic:
    """Operations on numbers; operands are widened to a common type: condition, integer, double.

    Parameters
    ----------
    context, builder
        Numba's target context and LLVM's builder.
    """

    def __init__(self, context: Any, builder: Any) -> None:
        self.context, self.builder = context, builder

    def typed(self, value: Any, kind: Any = None) -> Any:
        """Return a number as an LLVM value, of its own type or of a wider one."""
        own = kind_of(value)
        kind = kind or own
        if _WIDTHS.index(own) > _WIDTHS.index(kind) or (kind == INTEGER and is_constant(value) and abs(value) >= 2**63):
            what = value if is_constant(value) else f"a value of type {own}"
            raise errors.TypingError(f"{what} where {kind} is expected")
        if is_constant(value):
            return ir.Constant(kind, float(value) if kind == DOUBLE else int(value))
        if own == kind:
            return value
        if kind == INTEGER:
            return self.builder.zext(value, kind)
        return self.builder.uitofp(value, kind) if own == CONDITION else self.builder.sitofp(value, kind)

    def negative(self, value: Any) -> Any:
        """Return -value."""
        if is_constant(value):
            return -value
        return self.builder.fneg(value) if kind_of(value) == DOUBLE else self.builder.neg(self.typed(value, INTEGER))

    def binary(self, op: ast.operator, left: Any, right: Any) -> Any:
        """Return the result of an operator."""
        constant, of_doubles, of_integers = _OPERATIONS[type(op)]
        if is_constant(left) and is_constant(right):
            return constant(left, right)
        if isinstance(op, ast.Pow):
            return self.power(left, right)
        if type(op) in _BY_CONSTANTS and (type(right) is not int or right not in _BY_CONSTANTS[type(op)]):
            raise errors.TypingError(f"{type(op).__name__} by anything but a constant in {_BY_CONSTANTS[type(op)]}")
        kind = DOUBLE if isinstance(op, ast.Div) else _widest(left, right)
        if kind == CONDITION and not isinstance(op, (ast.BitAnd, ast.BitOr)):
            kind = INTEGER
        name = of_doubles if kind == DOUBLE else of_integers
        if name is None:
            raise errors.TypingError(f"{type(op).__name__} of {kind}")
        if isinstance(op, (ast.FloorDiv, ast.Mod)):
            return self.divided(op, self.typed(left, kind), right)
        return getattr(self.builder, name)(self.typed(left, kind), self.typed(right, kind))

    def divided(self, op: ast.operator, left: Any, right: int) -> Any:
        """Return // or %, rounded down, by a positive constant."""
        rest = self.builder.srem(left, self.typed(right))
        rest = self.chosen(self.compared(ast.Lt(), rest, 0), self.binary(ast.Add(), rest, right), rest)
        return rest if isinstance(op, ast.Mod) else self.builder.sdiv(self.builder.sub(left, rest), self.typed(right))

    def power(self, base: Any, exponent: Any) -> Any:
        """Return a power; one with a small whole exponent by repeated squaring."""
        if not isinstance(exponent, int) or not 0 < abs(exponent) <= _LARGEST_POWER:
            return self.known_to_numba(operator.pow, (base, exponent))
        result, square, rest = None, base, abs(exponent)
        while rest:
            if rest & 1:
                result = square if result is None else self.binary(ast.Mult(), result, square)
            rest >>= 1
            square = self.binary(ast.Mult(), square, square) if rest else square
        return result if exponent > 0 else self.binary(ast.Div(), 1.0, result)

    def compared(self, op: ast.cmpop, left: Any, right: Any) -> Any:
        """Return a comparison; all but != are false where a number is nan."""
        kind, sign = _widest(left, right), _COMPARISONS[type(op)]
        values = self.typed(left, kind), self.typed(right, kind)
        if kind != DOUBLE:
            return (self.builder.icmp_signed if kind == INTEGER else self.builder.icmp_unsigned)(sign, *values)
        return (self.builder.fcmp_unordered if sign == "!=" else self.builder.fcmp_ordered)(sign, *values)

    def truth(self, value: Any) -> Any:
        """Return a number as a condition."""
        return self.typed(value) if kind_of(value) == CONDITION else self.compared(ast.NotEq(), value, 0)

    def chosen(self, test: Any, value: Any, otherwise: Any) -> Any:
        """Return one of two numbers, or of two tuples part by part."""
        if isinstance(value, tuple):
            return tuple(self.chosen(test, *pair) for pair in zip(value, otherwise, strict=True))
        kind = _widest(value, otherwise)
        return self.builder.select(self.truth(test), self.typed(value, kind), self.typed(otherwise, kind))

    def cast(self, kind: type, value: Any) -> Any:
        """Return ``np.float64(value)`` or ``np.int64(value)``."""
        if kind is np.int64 and kind_of(value) == DOUBLE:
            return self.builder.fptosi(self.typed(value), INTEGER)
        return self.typed(value, kind_named(kind))

    def viewed(self, value: Any, kind: type) -> Any:
        """Return the bits of a number reinterpreted as a double or an integer."""
        return self.builder.bitcast(self.typed(value), kind_named(kind))

    def known_to_numba(self, function: Any, arguments: Sequence[Any]) -> Any:
        """Return a function of doubles as Numba writes it."""
        typing = cpu_target.typing_context
        try:
            kind = typing.resolve_value_type(function)
        except ValueError as error:
            raise errors.TypingError(f"{function} is unknown to Numba") from error
        found = typing.resolve_function_type(kind, (types.float64,) * len(arguments), {})
        if found is None or found.return_type != types.float64:
            raise errors.TypingError(f"{function} is not a function of doubles")
        written = self.context.get_function(kind, found)
        self.context.add_linking_libs(getattr(written, "libs", ()))
        return written(self.builder, [self.typed(value, DOUBLE) for value in arguments])


def _widest(*values: Any) -> Any:
    kinds = [kind_of(value) for value in values]
    return next(kind for kind in (DOUBLE, INTEGER, CONDITION) if kind in kinds)
