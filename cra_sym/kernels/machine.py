"""Machine code of functions of numbers and arrays: made by LLVM, kept as bytes, called through ctypes."""

from __future__ import annotations

import ast
import ctypes
import struct
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
from llvmlite import binding, ir

from cra_sym.kernels import arithmetic, writer
from cra_sym.kernels.memory import Array

__all__ = ["Code", "made", "processor"]

_HEAD = b"cra_sym machine code\n"
_NUMBERS = {"d": arithmetic.DOUBLE, "q": arithmetic.INTEGER, "?": arithmetic.INTEGER}  # as they are passed
_RESULTS = {arithmetic.DOUBLE: "d", arithmetic.INTEGER: "q", arithmetic.CONDITION: "?"}
_SLOTS = {"d": "d", "q": "q", "?": "?7x"}  # of results, eight bytes each
_POINTER, _INT, _INDEX = ir.PointerType(), ir.IntType(32), ir.IntType(64)
# NumPy's PyArrayInterface: its mark, axes, kind of numbers, their size, flags, shape, strides, data, description
_INTERFACE = ir.LiteralStructType([_INT, _INT, ir.IntType(8), _INT, _INT, _POINTER, _POINTER, _POINTER, _POINTER])
_SHAPE, _DATA = 5, 7


@cache
def processor() -> tuple[str, str, str]:
    """Return the system, the processor and its features, for which machine code is made."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    if sys.platform == "linux":  # elsewhere every process has loaded it
        with suppress(RuntimeError):
            binding.load_library_permanently("libm.so.6")
    for name in ("PyCapsule_GetPointer", "PyEval_RestoreThread", "PyEval_SaveThread"):
        binding.add_symbol(name, ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value)
    try:
        features = binding.get_host_cpu_features().flatten()
    except RuntimeError:  # unknown on this system
        features = ""
    return binding.get_process_triple(), binding.get_host_cpu_name(), features


def _target_machine() -> Any:
    triple, name, features = processor()
    return binding.Target.from_triple(triple).create_target_machine(
        cpu=name, features=features, opt=3, codemodel="jitdefault", jit=True
    )


def made(function: ast.FunctionDef, types: Sequence[str], namespace: Mapping[str, Any]) -> bytes:
    """Return the machine code of a function for given types of its arguments.

    Parameters
    ----------
    function : ast.FunctionDef
        In the form of `cra_sym.kernels.writer.call`.
    types : sequence of str
        A double 'd', an integer 'q', a condition '?'; for an array 'd' or 'q', its number of axes, and 'w' if the
        function may write to it.
    namespace : dict
        Values of the names in it.

    Raises
    ------
    CompileError
        If the function holds what has no machine code.
    TypeError
        If it takes another number of arguments.
    """
    written, results = _written(function, types, namespace)
    machine = _target_machine()
    written.triple, written.data_layout = machine.triple, str(machine.target_data)
    module = binding.parse_assembly(str(written))
    module.verify()
    options = binding.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization, options.slp_vectorization = True, False
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    code: bytes = machine.emit_object(module)
    return _HEAD + results.encode() + b"\n" + code


def _written(function: ast.FunctionDef, types: Sequence[str], namespace: Mapping[str, Any]) -> tuple[Any, str]:
    """Return a module with the function, and the types of its results, in parentheses for a tuple.

    The function takes the address of the slots of its results; then for each argument the number, or the capsule with
    the description of an array. It releases the interpreter lock while it computes.
    """
    if len(types) != len(function.args.args):
        raise TypeError(f"{function.name}: {len(types)} arguments given, {len(function.args.args)} expected")
    module = ir.Module(function.name)
    shape = ir.FunctionType(ir.VoidType(), [_POINTER, *(_NUMBERS.get(of, _POINTER) for of in types)])
    entry = ir.Function(module, shape, _symbol(function.name))
    builder = ir.IRBuilder(entry.append_basic_block("entry"))
    slots, *given = entry.args
    arguments = [_argument(builder, of, one) for of, one in zip(types, given, strict=True)]
    thread = builder.call(_of_python(module, "PyEval_SaveThread", _POINTER), [])
    value = writer.call(builder, function, arguments, namespace)
    parts = value if isinstance(value, tuple) else () if value is None else (value,)
    kinds = ""
    for number, part in enumerate(map(arithmetic.Arithmetic(builder).typed, parts)):
        kinds += _RESULTS[part.type]
        slot = builder.gep(slots, [ir.Constant(arithmetic.INTEGER, number)], source_etype=arithmetic.INTEGER)
        builder.store(builder.zext(part, ir.IntType(8)) if part.type == arithmetic.CONDITION else part, slot)
    builder.call(_of_python(module, "PyEval_RestoreThread", ir.VoidType(), _POINTER), [thread])
    builder.ret_void()
    return module, f"({kinds})" if isinstance(value, tuple) else kinds


def _symbol(name: str) -> str:
    return f"entry.{name}"  # which is not a function of the platform


def _argument(builder: Any, of: str, given: Any) -> Any:
    if of in _NUMBERS:
        return builder.trunc(given, arithmetic.CONDITION) if of == "?" else given

    capsule = _of_python(builder.module, "PyCapsule_GetPointer", _POINTER, _POINTER, _POINTER)
    description = builder.call(capsule, [given, ir.Constant(_POINTER, None)])

    def part(number: int) -> Any:
        place = [ir.Constant(_INT, 0), ir.Constant(_INT, number)]
        return builder.load(builder.gep(description, place, source_etype=_INTERFACE), typ=_POINTER)

    def length(axis: int) -> Any:
        return builder.load(builder.gep(shape, [ir.Constant(_INDEX, axis)], source_etype=_INDEX), typ=_INDEX)

    shape = part(_SHAPE)
    lengths = tuple(map(length, range(int(of.strip("dqw")))))
    return Array(part(_DATA), _NUMBERS[of[0]], lengths, of.endswith("w"))


def _of_python(module: Any, name: str, result: Any, *arguments: Any) -> Any:
    """Return a function of Python's C interface."""
    return module.globals.get(name) or ir.Function(module, ir.FunctionType(result, arguments), name)


class Code:
    """Machine code in memory, which is called with arguments of the types it was made for.

    Parameters
    ----------
    content : bytes
        What `made` returned on this processor.
    name : str
        The name of the function.
    types : sequence of str
        The types of its arguments.

    Raises
    ------
    ValueError
        If the content is nothing of that kind.
    """

    def __init__(self, content: bytes, name: str, types: Sequence[str]) -> None:
        results, line, code = content.removeprefix(_HEAD).partition(b"\n")
        if not (content.startswith(_HEAD) and line):
            raise ValueError(f"{name}: no machine code")
        kinds = results.strip(b"()").decode()
        self._several, self._slots = results.startswith(b"("), ctypes.c_int64 * len(kinds)
        self._results = struct.Struct("=" + "".join(_SLOTS[kind] for kind in kinds))
        self._engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _target_machine())
        self._engine.add_object_file(binding.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        numbers: dict[str, Any] = {"d": ctypes.c_double, "q": ctypes.c_int64, "?": ctypes.c_int64}
        shape = ctypes.PYFUNCTYPE(None, ctypes.c_void_p, *(numbers.get(of, ctypes.py_object) for of in types))
        self._function = shape(self._engine.get_function_address(_symbol(name)))

    def __call__(self, *arguments: Any) -> Any:
        """Return None, a number or a tuple of numbers; the interpreter lock is released meanwhile."""
        slots = self._slots()
        self._function(ctypes.addressof(slots), *map(_passed, arguments))
        values = self._results.unpack(slots)
        return values if self._several else values[0] if values else None


def _passed(argument: Any) -> Any:
    if isinstance(argument, np.ndarray):
        return argument.__array_struct__
    return argument.item() if isinstance(argument, np.generic) else argument
