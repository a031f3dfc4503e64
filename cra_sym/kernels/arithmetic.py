"""Arithmetic emitted with an LLVM builder: constants are Python numbers, all other operands LLVM values."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir

from cra_sym.kernels.generated import CompileError

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
_FUSED = ("contract",)  # a product and a sum may be rounded once; nothing else departs from IEEE 754
_INTRINSICS: dict[Any, str] = {abs: "fabs"}  # functions that LLVM knows, by their names there
for _name in ("ceil", "cos", "exp", "exp2", "floor", "log", "log2", "log10", "sin", "sqrt"):
    _INTRINSICS[getattr(np, _name)] = _name
_OF_THE_LIBRARY: dict[Any, str] = {np.arctan2: "atan2"}  # functions of the platform's mathematical library
for _name in ("acos", "acosh", "asin", "asinh", "atan", "atanh", "cbrt", "cosh", "expm1", "hypot", "log1p", "sinh"):
    _OF_THE_LIBRARY[getattr(np, _name)] = _name
_OF_THE_LIBRARY |= {np.tan: "tan", np.tanh: "tanh"}


def is_constant(value: Any) -> bool:
    """Return whether a number is known at compile time."""
    return isinstance(value, (bool, int, float))


def kind_of(value: Any) -> Any:
    """Return the LLVM type of a number."""
    if is_constant(value):
        return next(kind for of, kind in _KINDS.items() if isinstance(value, of))
    if getattr(value, "type", None) not in _WIDTHS:
        raise CompileError(f"{value!r} is not a number")
    return value.type


def kind_named(name: Any) -> Any:
    """Return the LLVM type of ``np.float64`` or ``np.int64``."""
    if name not in (np.float64, np.int64):
        raise CompileError(f"{name} is neither np.float64 nor np.int64")
    return DOUBLE if name is np.float64 else INTEGER


class Arithmetic:
    """Operations on numbers; operands are widened to a common type: condition, integer, double.

    Parameters
    ----------
    builder : llvmlite.ir.IRBuilder
    """

    def __init__(self, builder: Any) -> None:
        self.builder = builder

    def typed(self, value: Any, kind: Any = None) -> Any:
        """Return a number as an LLVM value, of its own type or of a wider one."""
        own = kind_of(value)
        kind = kind or own
        if _WIDTHS.index(own) > _WIDTHS.index(kind) or (kind == INTEGER and is_constant(value) and abs(value) >= 2**63):
            what = value if is_constant(value) else f"a value of type {own}"
            raise CompileError(f"{what} where {kind} is expected")
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
            raise CompileError(f"{type(op).__name__} by anything but a constant in {_BY_CONSTANTS[type(op)]}")
        kind = DOUBLE if isinstance(op, ast.Div) else _widest(left, right)
        if kind == CONDITION and not isinstance(op, (ast.BitAnd, ast.BitOr)):
            kind = INTEGER
        name = of_doubles if kind == DOUBLE else of_integers
        if name is None:
            raise CompileError(f"{type(op).__name__} of {kind}")
        if isinstance(op, (ast.FloorDiv, ast.Mod)):
            return self.divided(op, self.typed(left, kind), right)
        flags = _FUSED if kind == DOUBLE else ()
        return getattr(self.builder, name)(self.typed(left, kind), self.typed(right, kind), flags=flags)

    def divided(self, op: ast.operator, left: Any, right: int) -> Any:
        """Return // or %, rounded down, by a positive constant."""
        rest = self.builder.srem(left, self.typed(right))
        rest = self.chosen(self.compared(ast.Lt(), rest, 0), self.binary(ast.Add(), rest, right), rest)
        return rest if isinstance(op, ast.Mod) else self.builder.sdiv(self.builder.sub(left, rest), self.typed(right))

    def power(self, base: Any, exponent: Any) -> Any:
        """Return a power; one with a small whole exponent by repeated squaring."""
        if not isinstance(exponent, int) or not 0 < abs(exponent) <= _LARGEST_POWER:
            return self.intrinsic("pow", base, exponent)
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
        write = self.builder.fcmp_unordered if sign == "!=" else self.builder.fcmp_ordered
        return write(sign, *values, flags=_FUSED)

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

    def function(self, function: Any, arguments: Sequence[Any]) -> Any:
        """Return a function of doubles, given as Python or NumPy has it."""
        try:
            if function in _INTRINSICS:
                return self.intrinsic(_INTRINSICS[function], *arguments)
            if function in _OF_THE_LIBRARY:
                return self.from_library(_OF_THE_LIBRARY[function], *arguments)
            if function in _WRITTEN:
                return _WRITTEN[function](self, *(self.typed(value, DOUBLE) for value in arguments))
        except TypeError:  # not hashable, or as many arguments as it does not have
            pass
        raise CompileError(f"{getattr(function, '__name__', function)} is not a function that can be compiled")

    def intrinsic(self, name: str, *arguments: Any) -> Any:
        """Return an elementary function that LLVM knows."""
        shape = ir.FunctionType(DOUBLE, [DOUBLE] * len(arguments))
        called = self.builder.module.declare_intrinsic(f"llvm.{name}", [DOUBLE], shape)
        return self.builder.call(called, [self.typed(value, DOUBLE) for value in arguments], fastmath=_FUSED)

    def from_library(self, name: str, *arguments: Any) -> Any:
        """Return an elementary function of the platform's mathematical library."""
        called = self.builder.module.globals.get(name)
        if called is None:
            shape = ir.FunctionType(DOUBLE, [DOUBLE] * len(arguments))
            called = ir.Function(self.builder.module, shape, name)
            called.attributes.add("nounwind")
            called.attributes.add("readonly")
        return self.builder.call(called, [self.typed(value, DOUBLE) for value in arguments], fastmath=_FUSED)

    def extreme(self, op: ast.cmpop, one: Any, other: Any) -> Any:
        """Return the larger or the smaller of two numbers, or the one that is nan."""
        number = self.chosen(self.compared(op, one, other), one, other)
        return self._unless_nan(one, self._unless_nan(other, number))

    def _unless_nan(self, value: Any, otherwise: Any) -> Any:
        return self.chosen(self.compared(ast.NotEq(), value, value), value, otherwise)

    def sign(self, value: Any) -> Any:
        """Return -1, 0, 1 or nan."""
        flat = self._unless_nan(value, 0.0)
        below = self.chosen(self.compared(ast.Lt(), value, 0.0), -1.0, flat)
        return self.chosen(self.compared(ast.Gt(), value, 0.0), 1.0, below)

    def remainder(self, value: Any, divisor: Any) -> Any:
        """Return the rest of a division, of the sign of the divisor."""
        rest = self.builder.frem(value, divisor, flags=_FUSED)
        signs = [self.compared(ast.Lt(), number, 0.0) for number in (rest, divisor)]
        other = self.builder.and_(self.compared(ast.NotEq(), rest, 0.0), self.builder.xor(*signs))
        return self.binary(ast.Add(), rest, self.chosen(other, divisor, 0.0))


_WRITTEN: dict[Any, Callable[..., Any]] = {
    np.maximum: lambda own, one, other: own.extreme(ast.GtE(), one, other),
    np.minimum: lambda own, one, other: own.extreme(ast.LtE(), one, other),
    np.mod: Arithmetic.remainder,
    np.sign: Arithmetic.sign,
}


def _widest(*values: Any) -> Any:
    kinds = [kind_of(value) for value in values]
    return next(kind for kind in (DOUBLE, INTEGER, CONDITION) if kind in kinds)
