"""What decides the values of a sweep, as text two processes agree upon: numbers, objects, the code of functions.

Neither where a function stands in its file nor how it is laid out matters, only what it does.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import textwrap
from collections.abc import Mapping
from functools import partial
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType
from typing import Any

import numpy as np

__all__ = ["fingerprint"]


def fingerprint(value: Any) -> str:
    """Return a short text that is equal for equal values: the value itself where that is short, a digest otherwise."""
    text = _text(value, ())
    return text if len(text) <= 60 else f"{type(value).__name__} {hashlib.sha256(text.encode()).hexdigest()[:16]}"


def _text(value: Any, above: tuple[int, ...]) -> str:
    if value is None or isinstance(value, (bool, int, float, complex, str, bytes)):
        return repr(value)
    if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind != "O":
        numbers = np.ascontiguousarray(value)
        return f"{numbers.dtype.str}{numbers.shape}{hashlib.sha256(numbers.tobytes()).hexdigest()}"
    if id(value) in above:  # it holds itself
        return f"<{above.index(id(value))}>"
    within = (*above, id(value))

    def inner(part: Any) -> str:
        return _text(part, within)

    if isinstance(value, Mapping):
        return "{" + ", ".join(sorted(f"{inner(key)}: {inner(entry)}" for key, entry in value.items())) + "}"
    if isinstance(value, (list, tuple)):
        return f"{type(value).__name__}[{', '.join(map(inner, value))}]"
    if isinstance(value, (set, frozenset)):
        return f"{type(value).__name__}[{', '.join(sorted(map(inner, value)))}]"
    if isinstance(value, partial):
        return f"partial[{inner(value.func)}, {inner(value.args)}, {inner(value.keywords)}]"
    if isinstance(value, MethodType):
        return f"method[{inner(value.__func__)}, {inner(value.__self__)}]"
    if isinstance(value, FunctionType):
        held = inspect.getclosurevars(value).nonlocals
        given = (value.__defaults__, value.__kwdefaults__)
        return f"{value.__qualname__}[{_code(value)}, {inner(given)}, {inner(held)}]"
    if isinstance(value, (type, BuiltinFunctionType)):
        return f"{value.__module__}.{value.__qualname__}"
    call = inspect.getattr_static(type(value), "__call__", None)
    code = _code(call) if isinstance(call, FunctionType) else ""
    return f"{type(value).__module__}.{type(value).__qualname__}[{code}{inner(_state(value))}]"


def _state(value: Any) -> Any:
    """Return what an object is rebuilt from when it is pickled."""
    own = any("__reduce__" in vars(kind) or "__reduce_ex__" in vars(kind) for kind in type(value).__mro__[:-1])
    if not own:
        state = value.__getstate__()  # of classes that are not importable too
        return state if state is not None else ()
    return tuple(value.__reduce_ex__(2)[1:3])


def _code(function: FunctionType) -> str:
    try:
        return hashlib.sha256(ast.dump(ast.parse(textwrap.dedent(inspect.getsource(function)))).encode()).hexdigest()
    except (OSError, TypeError, SyntaxError):  # written at a prompt, or part of an expression
        return hashlib.sha256(repr(_instructions(function.__code__)).encode()).hexdigest()


def _instructions(code: CodeType) -> tuple[Any, ...]:
    constants = [_instructions(c) if isinstance(c, CodeType) else repr(c) for c in code.co_consts]
    return code.co_code, code.co_names, code.co_varnames, constants
