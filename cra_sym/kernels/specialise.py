"""Numba templates specialised with generated functions, compiled once and then loaded from the user's cache.

Numba's own file cache misses changes of inlined helpers, relies on time stamps and unpickles any file next to the
source. Here the compiled text is a single module whose hash is the key, and machine code is kept in the private cache.
No other module of the package compiles.
"""

from __future__ import annotations

import ast
import hashlib
import os
import pickle
import re
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any
from warnings import warn

from cra_sym.kernels import store
from cra_sym.kernels.generated import Generated

__all__ = ["compiled", "has_compiler", "is_compiled", "written_out"]

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}, "no_cfunc_wrapper": True}
_UNKNOWN = (0, 69)  # the first version of Numba that was not tested
_ELEMENTARY = Path(__file__).with_name("elementary.py")
_COMPILER = [
    Path(__file__).with_name(f"{name}.py").read_text(encoding="utf-8") for name in ("arithmetic", "inlined", "writer")
]
_TURN = Lock()  # one thread specialises for all; Python 3.11 cannot parse in two threads at once
_WHERE = "def where(condition, value, otherwise):\n    return value if condition else otherwise\n"


def has_compiler() -> bool:
    """Return whether Numba is installed and not disabled by NUMBA_DISABLE_JIT."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return False
    if "numba" in sys.modules:
        return sys.modules["numba"] is not None
    return find_spec("numba") is not None


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
        If Numba is missing; see :func:`has_compiler`.
    ValueError
        If a kernel uses functions that Numba cannot compile.

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
        raise ImportError("compiling needs numba: pip install numba")
    head = _prelude(kernels, elementary)
    with _TURN:
        return (_entries if _is_known() else _tried)(head, template)


def is_compiled(template: str, kernels: Mapping[str, Generated]) -> bool:
    """Return whether machine code of the specialised template exists, from this or an earlier process.

    Numba is not imported for this; a different processor may have to compile again.
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
            raise ValueError(f"{name} needs {'; '.join(lines)}: Numba compiles NumPy's functions only")
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
    return hashlib.sha256(repr((head, template, _OPTIONS, _COMPILER)).encode()).hexdigest()


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
def _versions() -> list[str]:
    from importlib.metadata import version

    return [version(package) for package in ("numba", "llvmlite", "numpy")]


@cache
def _entries(head: str, template: str) -> SimpleNamespace:
    import numba

    from cra_sym.kernels.inlined import inlined

    digest = _digest(head, template)
    module = ModuleType(f"cra_sym_compiled_{digest[:32]}")
    sys.modules[module.__name__] = module  # module in which stored machine code finds its constants
    namespace = module.__dict__
    exec(head + template, namespace)
    functions = {node.name: node for node in ast.parse(head + template).body if isinstance(node, ast.FunctionDef)}
    entries, meanings = _names(template), namespace | functions
    for name in entries:
        written, arguments = f"{name}_written", ", ".join(a.arg for a in functions[name].args.args)
        namespace[written] = inlined(functions[name], meanings)
        exec(f"def {name}({arguments}):\n    return {written}({arguments})\n", namespace)
        namespace[name] = numba.njit(**_OPTIONS)(namespace[name])
        namespace[name]._cache = _StoredCode(digest, name)
    return SimpleNamespace(**{name: namespace[name] for name in entries})


def _names(template: str) -> list[str]:
    """Return the names of the entries of a template."""
    names = (node.name for node in ast.parse(template).body if isinstance(node, ast.FunctionDef))
    return [name for name in names if not name.startswith("_")]


def _is_known() -> bool:
    """Return whether Numba is a tested version, since compiling and storing depend on its internals."""
    return tuple(map(int, re.findall(r"\d+", _versions()[0])[:2])) < _UNKNOWN


@cache
def _tried(head: str, template: str) -> SimpleNamespace:
    """Return the entries for an untested version of Numba: compiled as usual, or by Numba itself if that fails."""
    made = None
    with suppress(ImportError, AttributeError):
        made = _entries(head, template)

    def entry(name: str) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            nonlocal made
            tried = made
            try:
                return getattr(tried, name)(*arguments)
            except Exception:  # compiled code raises nothing
                with _TURN:
                    made = _plain(head, template)
                if made is tried:
                    raise
            return getattr(made, name)(*arguments)

        return call

    return SimpleNamespace(**{name: entry(name) for name in _names(template)})


@cache
def _plain(head: str, template: str) -> SimpleNamespace:
    """Return the entries compiled by Numba alone, which takes seconds and is not stored."""
    import numba

    warn(
        f"Numba {_versions()[0]} is newer than cra_sym knows: it compiles by its own means, anew in each process",
        RuntimeWarning,
        stacklevel=3,
    )
    module = ModuleType("cra_sym_compiled_by_numba")
    exec(head + template, module.__dict__)
    for name, value in list(vars(module).items()):
        if isinstance(value, FunctionType):
            setattr(module, name, numba.njit(nogil=True, error_model="numpy", fastmath={"contract"})(value))
    return SimpleNamespace(**vars(module))


class _StoredCode:
    """Cache object of a Numba dispatcher, backed by the private cache with a checksum of every entry."""

    cache_path = None

    def __init__(self, digest: str, name: str) -> None:
        self._digest, self._name, self._bar = digest, name, None

    def load_overload(self, signature: Any, target: Any) -> Any:
        from numba.core.compiler import CompileResult
        from tqdm import tqdm

        target.refresh()
        content = store.load(self._key(signature, target.codegen()))
        if content is not None:
            try:
                found = CompileResult._rebuild(target, *pickle.loads(content))
                _remember(self._digest)
                return found
            except Exception:  # a damaged entry of another process is compiled again
                pass
        self._bar = tqdm(total=0, desc=f"compiling {self._name}, once", bar_format="{desc}", leave=False, disable=None)
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        from numba.core.serialize import dumps

        if self._bar is not None:
            self._bar.close()
        if not result.lifted and not result.library.has_dynamic_globals:
            store.save(self._key(signature, result.library.codegen), dumps(result._reduce()))
        _remember(self._digest)

    def _key(self, signature: Any, codegen: Any) -> str:
        return repr((self._digest, self._name, str(signature), codegen.magic_tuple(), sys.version, _versions()))

    def enable(self) -> None:
        """Do nothing: the cache is always used."""

    def disable(self) -> None:
        """Do nothing: the cache is always used."""

    def flush(self) -> None:
        """Do nothing: a changed text has another key."""
