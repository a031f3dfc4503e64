"""Templates specialised with generated functions, compiled once by LLVM and then loaded from the user's cache.

The compiled text is a single module whose hash, with the processor, is the key of its machine code in the private
cache. No other module of the package compiles.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from types import SimpleNamespace
from typing import Any

import numpy as np

from cra_sym.cached import cached_property, released_in_children
from cra_sym.checks import shown
from cra_sym.kernels import store
from cra_sym.kernels.generated import CompileError, Generated

__all__ = ["Entry", "compiled", "has_compiler", "is_compiled", "written_out"]

_ELEMENTARY = Path(__file__).with_name("elementary.py")
_COMPILER = [
    Path(__file__).with_name(f"{name}.py").read_text(encoding="utf-8") for name in ("arithmetic", "machine", "writer")
]
_ARRAYS = {  # names of the types of arrays that can be written to or not, by numbers of axes
    np.dtype(kind): [[f"{name}{axes}{end}" for axes in range(65)] for end in ("", "w")]
    for kind, name in ((np.float64, "d"), (np.int64, "q"))
}
_TURN = released_in_children(Lock())  # one thread specialises for all; Python 3.11 cannot parse in two threads at once
_WHERE = "def where(condition, value, otherwise):\n    return value if condition else otherwise\n"


def has_compiler() -> bool:
    """Return whether llvmlite is installed."""
    if "llvmlite" in sys.modules:
        return sys.modules["llvmlite"] is not None
    return find_spec("llvmlite") is not None


def compiled(template: str, kernels: Mapping[str, Generated], *, elementary: bool = True) -> SimpleNamespace:
    """Specialise the text of a module with kernels, and compile its functions.

    The template is plain Python without decorators: loops, arithmetic and arrays, as
    :func:`cra_sym.kernels.writer.call` has it. It calls each kernel by its name in ``kernels`` with scalars (the result
    is a scalar for one expression, else a flat tuple), and may call ``sin``, ``cos``, ``tan``, ``exp``, ``sinh``,
    ``cosh``, ``tanh`` and ``log``, the branch-free functions of :mod:`cra_sym.kernels.elementary`. Everything is
    inlined, so that a simple loop over the lanes of contiguous arrays becomes SIMD code. Functions with a leading
    underscore are helpers, all others are entries: an entry is compiled, or loaded from the store, when it is first
    called with new types. It releases the interpreter lock, so threads scale.

    Parameters
    ----------
    template : str
        Module text.
    kernels : dict of str to Kernel
        Functions that the template calls.
    elementary : bool
        Whether these functions are the branch-free ones (sin, cos and tan are nan beyond 1e6) or the platform's.

    Returns
    -------
    SimpleNamespace
        The entries by name.

    Raises
    ------
    ImportError
        If llvmlite is missing; see :func:`has_compiler`.
    CompileError
        If a kernel uses functions that have no machine code; at the first call of an entry, if its text does or an
        argument is neither a number nor a contiguous array of numbers.

    Examples
    --------
    >>> import numpy as np, sympy as sp
    >>> from cra_sym.kernels import compiled, kernel
    >>> x, a = sp.symbols("x a")
    >>> template = '''
    ... def fill(out, x, a):
    ...     for lane in range(out.size):
    ...         out[lane] = wave(x[lane], a)
    ... '''
    >>> entries = compiled(template, {"wave": kernel(a * sp.sin(x) + sp.cos(x), (x, a))})
    >>> out = np.empty(3)
    >>> entries.fill(out, np.zeros(3), 2.0)
    >>> out
    array([1., 1., 1.])
    """
    if not has_compiler():
        raise ImportError("compiling needs llvmlite: pip install llvmlite")
    head = _prelude(kernels, elementary)
    with _TURN:
        return _entries(head, template)


def is_compiled(template: str, kernels: Mapping[str, Generated]) -> bool:
    """Return whether machine code of the specialised template exists, from this or an earlier process.

    LLVM is not loaded for this; a different processor may have to compile again.
    """
    digest = _digest(_prelude(kernels, True), template)
    return digest in _MADE or store.load(_mark(digest)) is not None


def _prelude(kernels: Mapping[str, Generated], elementary: bool) -> str:
    """Return the text that goes before a template: imports, elementary functions, kernels."""
    imports, bodies = set(), []
    for name, kernel in kernels.items():
        head, _, body = kernel.source.partition("\n\n\ndef evaluate(")
        lines = [line for line in head.splitlines() if line.startswith("from ")]
        if not all(line.startswith("from numpy import ") for line in lines):
            raise CompileError(f"{name} needs {'; '.join(lines)}: NumPy's functions only are compiled")
        imports.update(lines)
        bodies.append(f"def {name}({body}")
    own = _ELEMENTARY.read_text(encoding="utf-8") if elementary else ""
    return "\n\n".join(["\n".join(sorted(imports)), own, _WHERE, *bodies, ""])


def written_out(template: str, kernels: Mapping[str, Generated]) -> tuple[str, dict[str, float | int]]:
    """Return a specialised template as text, for printing in another language, and its constants by name."""
    text = _prelude(kernels, True) + template
    names: dict[str, Any] = {}
    exec(text, names)
    return text, {name: value for name, value in names.items() if isinstance(value, (int, float))}


_MADE: set[str] = set()  # digests of the code that this process compiled or loaded


def _digest(head: str, template: str) -> str:
    return hashlib.sha256(repr((head, template, _COMPILER)).encode()).hexdigest()


def _remember(digest: str) -> None:
    """Record that machine code exists, for this process and for others."""
    if digest not in _MADE:
        _MADE.add(digest)
        if store.load(_mark(digest)) is None:
            store.save(_mark(digest), b"")


def _mark(digest: str) -> str:
    """Return the key of the entry that records that machine code exists, independent of the processor."""
    return repr((digest, sys.version, _versions()))


@cache
def _versions() -> tuple[str, ...]:
    from importlib.metadata import version

    return version("llvmlite"), version("numpy")


@cache
def _entries(head: str, template: str) -> SimpleNamespace:
    module = _Module(head, template)
    names = (node.name for node in ast.parse(template).body if isinstance(node, ast.FunctionDef))
    return SimpleNamespace(**{name: Entry(module, name) for name in names if not name.startswith("_")})


class _Module:
    """The text of a module, which is parsed and run when the first of its entries is compiled."""

    def __init__(self, head: str, template: str) -> None:
        self.digest, self._text = _digest(head, template), head + template

    @cached_property
    def functions(self) -> dict[str, ast.FunctionDef]:
        return {node.name: node for node in ast.parse(self._text).body if isinstance(node, ast.FunctionDef)}

    @cached_property
    def names(self) -> dict[str, Any]:
        names: dict[str, Any] = {}
        exec(self._text, names)
        return names | self.functions


class Entry:
    """A function that is compiled, or loaded from the store, when it is first called with new types of arguments."""

    def __init__(self, module: _Module, name: str) -> None:
        self._module, self._name = module, name
        self._codes: dict[tuple[str, ...], Callable[..., Any]] = {}
        self.origins: dict[tuple[str, ...], str] = {}
        """Whether the machine code for some types was 'compiled' or 'loaded'."""

    def __call__(self, *arguments: Any) -> Any:
        types = tuple(map(_type_of, arguments))
        code = self._codes.get(types)
        if code is None:
            with _TURN:
                code = self._codes.get(types) or self._made(types)
        return code(*arguments)

    def _made(self, types: tuple[str, ...]) -> Callable[..., Any]:
        from cra_sym.kernels import machine

        key = repr((self._module.digest, self._name, types, machine.processor(), sys.version, _versions()))
        content, origin = store.load(key), "loaded"
        code = None
        if content is not None:
            with suppress(ValueError):  # of something else: it is compiled again
                code = machine.Code(content, self._name, types)
        if code is None:
            content, origin = self._compiled(types), "compiled"
            code = machine.Code(content, self._name, types)
            store.save(key, content)
        _remember(self._module.digest)
        self.origins[types] = origin
        self._codes[types] = code
        return code

    def _compiled(self, types: tuple[str, ...]) -> bytes:
        from tqdm import tqdm

        from cra_sym.kernels import machine

        with tqdm(total=0, desc=f"compiling {self._name}, once", bar_format="{desc}", leave=False, disable=None):
            return machine.made(self._module.functions[self._name], types, self._module.names)


def _type_of(value: Any) -> str:
    """Return the type of an argument, as `cra_sym.kernels.machine.made` has it."""
    if isinstance(value, np.ndarray):
        kind, flags = _ARRAYS.get(value.dtype), value.flags
        if kind and flags.c_contiguous and flags.aligned:
            return kind[flags.writeable][value.ndim]
    elif isinstance(value, (float, np.floating)):
        return "d"
    elif isinstance(value, (bool, np.bool_)):
        return "?"
    elif isinstance(value, (int, np.integer)) and -(2**63) <= value < 2**63:
        return "q"
    raise CompileError(
        f"{shown(value)}: arguments of compiled functions must be numbers of 64 bits or contiguous arrays of them"
    )
