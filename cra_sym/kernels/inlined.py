"""Functions for Numba's compiled code that `cra_sym.kernels.writer` translates instead of Numba."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from llvmlite import ir
from numba.core import cgutils, errors, types
from numba.core.registry import cpu_target
from numba.core.typing import signature
from numba.extending import intrinsic

from cra_sym.kernels import arithmetic, writer

__all__ = ["inlined"]

_TYPES = {arithmetic.DOUBLE: types.float64, arithmetic.INTEGER: types.int64, arithmetic.CONDITION: types.boolean}


def inlined(function: ast.FunctionDef, namespace: Mapping[str, Any]) -> Any:
    """Return a function for compiled code, which is inlined at every call.

    Parameters
    ----------
    function : ast.FunctionDef
        In the form of `cra_sym.kernels.writer.call`; its arguments are numbers and contiguous arrays.
    namespace : dict
        Values of the names in it.
    """

    def value(context: Any, builder: Any, kinds: Sequence[Any], given: Sequence[Any]) -> Any:
        arguments = [_argument(context, builder, *pair) for pair in zip(kinds, given, strict=True)]
        return writer.call(context, builder, function, arguments, namespace)

    def write(context: Any, builder: Any, found: Any, given: Sequence[Any]) -> Any:
        result = value(context, builder, found.args, given)
        if result is None:
            return context.get_dummy_value()
        typed = arithmetic.Arithmetic(context, builder).typed
        if isinstance(result, tuple):
            return context.make_tuple(builder, found.return_type, [typed(part) for part in result])
        return typed(result)

    @cache
    def found(*given: Any) -> Any:
        """Write the function to a scratch module, to find the type of its result."""
        context = cpu_target.target_context.subtarget(enable_nrt=True)
        kinds = [_plain(kind) for kind in given]
        library = context.codegen().create_library("trial")
        shape = context.call_conv.get_function_type(types.none, kinds)
        trial = ir.Function(library.create_ir_module("trial"), shape, "trial")
        builder = ir.IRBuilder(trial.append_basic_block())
        arguments = context.call_conv.decode_arguments(builder, kinds, trial)
        with context.push_code_library(library):
            return signature(_type_of(value(context, builder, kinds, arguments)), *kinds)

    names = ", ".join(argument.arg for argument in function.args.args)
    scope = {"typing": lambda *given: (found(*given), write)}
    exec(f"def {function.name}(context, {names}):\n    return typing({names})\n", scope)
    return intrinsic(scope[function.name])


def _plain(kind: Any) -> Any:
    """Return the type that an argument is converted to."""
    kind = types.unliteral(kind)
    if isinstance(kind, types.Array) and kind.layout == "C" and kind.dtype in (types.float64, types.int64):
        return kind
    if isinstance(kind, types.Boolean):
        return kind
    if isinstance(kind, (types.Integer, types.Float)):
        return types.int64 if isinstance(kind, types.Integer) else types.float64
    raise errors.TypingError(f"{kind}: arguments must be numbers or contiguous arrays of doubles and integers")


def _argument(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if not isinstance(kind, types.Array):
        return value
    array = context.make_array(kind)(context, builder, value)
    return writer.Array(array.data, tuple(cgutils.unpack_tuple(builder, array.shape)), kind.mutable)


def _type_of(value: Any) -> Any:
    if value is None:
        return types.none
    if isinstance(value, tuple):
        return types.BaseTuple.from_types([_type_of(part) for part in value])
    return _TYPES[arithmetic.kind_of(value)]
