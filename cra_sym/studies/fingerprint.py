"""Fingerprints of everything that determines the values of a sweep, equal in all processes: numbers, objects, code.

The position and the layout of a function in its file do not matter, only its code and the user's own functions, classes
and values that it uses: those in its closure, those it takes by name from its module, and so on recursively. Installed
packages, and attributes of modules, are identified by name only.
"""

from __future__ import annotations

import dis
import hashlib
import inspect
import sys
import sysconfig
from collections.abc import Mapping
from functools import partial
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

__all__ = ["fingerprint"]

_INSTALLED = tuple({sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")})


def fingerprint(value: Any) -> str:
    """Return a short text that is equal for equal values: the value itself where that is short, a digest otherwise."""
    text = _text(value, (), {})
    return text if len(text) <= 60 else f"{type(value).__name__} {hashlib.sha256(text.encode()).hexdigest()[:16]}"


def _text(value: Any, above: tuple[int, ...], seen: dict[int, int]) -> str:
    if value is None or isinstance(value, (bool, int, float, complex, str, bytes)):
        return repr(value)
    if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind != "O":
        numbers = np.ascontiguousarray(value)
        return f"{numbers.dtype.str}{numbers.shape}{hashlib.sha256(numbers.tobytes()).hexdigest()}"
    if id(value) in above:  # it contains itself
        return f"<{above.index(id(value))}>"
    within = (*above, id(value))

    def inner(part: Any) -> str:
        return _text(part, within, seen)

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
    if isinstance(value, BuiltinFunctionType):
        return f"{value.__module__}.{value.__qualname__}"
    if isinstance(value, (type, FunctionType)):
        if id(value) in seen:
            return f"<<{seen[id(value)]}>>"
        seen[id(value)] = len(seen)
        parts = _class(value) if isinstance(value, type) else _function(value)
        named = value.__qualname__ if _is_own(value) else f"{value.__module__}.{value.__qualname__}"
        return f"{named}[{', '.join(f'{name} {_tried(part, within, seen)}' for name, part in parts)}]"
    if inspect.unwrap(value, stop=lambda one: isinstance(one, FunctionType)) is not value:  # of lru_cache and the like
        return f"{inner(type(value))}[{inner(inspect.unwrap(value))}]"
    return f"{inner(type(value))}[{inner(_state(value))}]"


def _tried(part: Any, above: tuple[int, ...], seen: dict[int, int]) -> str:
    """Return the text of an object that a function uses, or only its type if that fails."""
    try:
        return part.__name__ if isinstance(part, ModuleType) else _text(part, above, seen)
    except Exception:  # a lock, an open file
        return f"{type(part).__module__}.{type(part).__qualname__}"


def _is_own(value: Any) -> bool:
    """Tell whether a function or a class is the user's own, not of this package or an installed one."""
    module = value.__module__ or "builtins"  # of functions SymPy makes
    place = getattr(sys.modules.get(module), "__file__", None) or ""
    return not place.startswith(_INSTALLED) and module.partition(".")[0] not in ("cra_sym", "builtins")


def _class(value: type) -> list[tuple[str, Any]]:
    """Return the functions of a class of the user's, by name."""
    found = []
    for kind in filter(_is_own, value.__mro__):
        for name, entry in vars(kind).items():
            function = getattr(entry, "__func__", getattr(entry, "fget", entry))  # of methods of classes, properties
            if isinstance(function, FunctionType):
                found.append((f"{kind.__qualname__}.{name}", function))
    return sorted(found, key=lambda part: part[0])


def _function(value: FunctionType) -> list[tuple[str, Any]]:
    """Return the code of a user's function, and the names it uses from its closure and its module."""
    if not _is_own(value):
        return []
    held = inspect.getclosurevars(value).nonlocals
    names = sorted(_globals(value.__code__) & value.__globals__.keys())
    return [
        ("code", repr(_instructions(value.__code__))),
        ("defaults", (value.__defaults__, value.__kwdefaults__)),
        *held.items(),
        *((name, value.__globals__[name]) for name in names),
    ]


def _state(value: Any) -> Any:
    """Return the state of an object for pickling."""
    own = any("__reduce__" in vars(kind) or "__reduce_ex__" in vars(kind) for kind in type(value).__mro__[:-1])
    if not own:
        state = value.__getstate__()  # of classes that are not importable too
        return state if state is not None else ()
    found = value.__reduce_ex__(2)
    return found if isinstance(found, str) else tuple(found[1:3])


def _globals(code: CodeType) -> set[str]:
    found = {one.argval for one in dis.get_instructions(code) if one.opname in ("LOAD_GLOBAL", "LOAD_NAME")}
    return found.union(*(_globals(part) for part in code.co_consts if isinstance(part, CodeType)))


def _instructions(code: CodeType) -> tuple[Any, ...]:
    constants = [
        _instructions(c) if isinstance(c, CodeType) else sorted(map(repr, c)) if isinstance(c, frozenset) else repr(c)
        for c in code.co_consts
    ]
    return code.co_code, code.co_names, code.co_varnames, code.co_freevars, constants
