"""Numbers and arrays in memory, as LLVM has them: variables on the stack, arrays on the heap, elements of arrays."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

from llvmlite import ir

from cra_sym.kernels.arithmetic import INTEGER, Arithmetic, is_constant, kind_named, kind_of
from cra_sym.kernels.generated import CompileError

__all__ = ["Array", "Memory", "Variable"]

_POINTER = ir.PointerType()


@dataclass(frozen=True)
class Array:
    """A contiguous array, or the part of one selected by leading indices."""

    data: Any
    kind: Any
    shape: tuple[Any, ...]
    writable: bool = True


@dataclass(frozen=True)
class Variable:
    """A number in memory: where it is, and its type."""

    pointer: Any
    kind: Any


class Memory(Arithmetic):
    """Arithmetic with variables and arrays."""

    def __init__(self, builder: Any) -> None:
        super().__init__(builder)
        self.owned: list[Variable] = []  # pointers to the arrays made here

    def variable(self, kind: Any, name: str = "") -> Variable:
        """Return a variable on the stack, which starts as zero; LLVM turns it into a register."""
        with self.builder.goto_entry_block():
            pointer = self.builder.alloca(kind, name=name)
            self.builder.store(ir.Constant(kind, None), pointer)
        return Variable(pointer, kind)

    def put(self, value: Any, variable: Variable) -> None:
        """Assign a number, converted to the type of the variable."""
        self.builder.store(self.typed(value, variable.kind), variable.pointer)

    def read(self, variable: Variable) -> Any:
        """Return the value of a variable."""
        return self.builder.load(variable.pointer, typ=variable.kind)

    def pointer(self, array: Array, indices: Sequence[Any]) -> Any:
        """Return a pointer to the start of a part of an array in C order."""
        offset: Any = 0
        for length, index in zip(array.shape, [*indices, *[0] * (len(array.shape) - len(indices))], strict=True):
            if kind_of(index) != INTEGER or (is_constant(index) and index < 0):
                raise CompileError("indices are integers that count from the start")
            rows = 0 if offset == 0 else self.binary(ast.Mult(), offset, length)
            offset = index if rows == 0 else self.binary(ast.Add(), rows, index)
        return self.builder.gep(array.data, [self.typed(offset, INTEGER)], inbounds=True, source_etype=array.kind)

    def element(self, array: Array, indices: Sequence[Any]) -> Any:
        """Return an element, or the part that leading indices select."""
        place, rest = self.pointer(array, indices), array.shape[len(indices) :]
        return Array(place, array.kind, rest, array.writable) if rest else self.read(Variable(place, array.kind))

    def product(self, numbers: Sequence[Any]) -> Any:
        """Return the product of integers."""
        return reduce(lambda one, two: self.binary(ast.Mult(), one, two), numbers)

    def allocated(self, zeros: bool, shape: Any, kind: type) -> Array:
        """Return a new array of doubles or integers, to be freed by `free_all`."""
        shape = shape if isinstance(shape, tuple) else (shape,)
        size = self.typed(self.binary(ast.Mult(), self.product(shape), 8), INTEGER)
        name, sizes = ("calloc", (size, self.typed(1))) if zeros else ("malloc", (size,))
        memory = self.builder.call(self.of_platform(name, _POINTER, *[INTEGER] * len(sizes)), sizes)
        self.owned.append(self.variable(_POINTER))
        self.builder.store(memory, self.owned[-1].pointer)
        return Array(memory, kind_named(kind), shape)

    def free_all(self) -> None:
        """Free the arrays made here."""
        for memory in self.owned:
            self.builder.call(self.of_platform("free", ir.VoidType(), _POINTER), [self.read(memory)])
            self.builder.store(ir.Constant(_POINTER, None), memory.pointer)  # the next call may not allocate this array

    def of_platform(self, name: str, result: Any, *arguments: Any) -> Any:
        """Return a function of the platform's C library."""
        module = self.builder.module
        return module.globals.get(name) or ir.Function(module, ir.FunctionType(result, arguments), name)
