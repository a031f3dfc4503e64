"""Numba templates specialised with generated functions: one module of text, compiled once on a machine and then loaded.

Numba's own file cache overlooks changes of inlined helpers, trusts time stamps and unpickles whatever lies beside the
source. Here everything that is compiled is one text, its hash is the key, and machine code goes through the private
store.
"""

from __future__ import annotations

import hashlib
import linecache
import os
import pickle
import sys
from collections.abc import Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

from cra_sym.kernels import store
from cra_sym.kernels.generated import Generated

__all__ = ["compiled", "has_compiler", "is_compiled"]

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
_INLINED = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True, **_OPTIONS}
_ELEMENTARY = Path(__file__).with_name("elementary.py")
_WHERE = "def where(condition, value, otherwise):\n    return value if condition else otherwise\n"


def has_compiler() -> bool:
    """Return whether Numba is there and not switched off by NUMBA_DISABLE_JIT."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return False
    if "numba" in sys.modules:
        return sys.modules["numba"] is not None
    return find_spec("numba") is not None


def compiled(template: str, kernels: Mapping[str, Generated], *, elementary: bool = True) -> SimpleNamespace:
    """Specialise the text of a module with kernels, and compile its functions.

    The template is plain Python that Numba understands, without decorators. It calls each kernel by its name in
    ``kernels`` with scalars (the result is a scalar for one expression, else a flat tuple), and may call ``sin``,
    ``cos`` and ``exp``, the branch-free functions of :mod:`cra_sym.kernels.elementary`. Everything is inlined, so that
    a simple loop over the lanes of contiguous arrays becomes SIMD code. Functions with a leading underscore are
    helpers, all others are entries: an entry is compiled, or loaded from the store, when it is first called with new
    types. It releases the interpreter lock, so threads scale.

    Parameters
    ----------
    template : str
        Module text.
    kernels : dict of str to Kernel
        The functions the template takes as given.
    elementary : bool
        Whether sin, cos and exp are the branch-free ones (sin and cos are nan beyond 1e6) or the platform's.

    Returns
    -------
    SimpleNamespace
        The entries by name.

    Raises
    ------
    ImportError
        If Numba is missing; :func:`has_compiler` tells.
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
    return _entries(_prelude(kernels, elementary), template)


def is_compiled(template: str, kernels: Mapping[str, Generated]) -> bool:
    """Return whether machine code of the specialised template was made before, here or by an earlier process.

    The answer costs no import of Numba; another processor than the one that compiled may need to do it again.
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
    return "\n\n".join(["\n".join(sorted(imports)), own, _WHERE, *bodies])


_MADE: set[str] = set()  # digests of what this process compiled or loaded


def _digest(prelude: str, template: str) -> str:
    return hashlib.sha256(repr((prelude, template, _OPTIONS)).encode()).hexdigest()


def _remember(digest: str) -> None:
    """Note that machine code is there, for this process and for others."""
    if digest not in _MADE:
        _MADE.add(digest)
        if store.load(_mark(digest)) is None:
            store.save(_mark(digest), b"")


def _mark(digest: str) -> str:
    """Return the key of an entry that says that machine code is there, without asking Numba for the processor."""
    return repr((digest, sys.version, _versions()))


@cache
def _versions() -> list[str]:
    from importlib.metadata import version

    return [version(package) for package in ("numba", "llvmlite", "numpy")]


@cache
def _entries(prelude: str, template: str) -> SimpleNamespace:
    if not has_compiler():
        raise ImportError("compiling needs numba: pip install numba")
    import numba

    digest = _digest(prelude, template)
    module = ModuleType(f"cra_sym_compiled_{digest[:32]}")
    sys.modules[module.__name__] = module  # where stored machine code looks for its constants
    namespace = module.__dict__
    helpers = _functions(prelude, f"<prelude {digest[:16]}>", namespace)
    entries = _functions(template, f"<template {digest[:16]}>", namespace)
    for name, function in (helpers | entries).items():
        if name in entries and not name.startswith("_"):
            namespace[name] = numba.njit(**_OPTIONS)(function)
            namespace[name]._cache = _StoredCode(digest, name)
        else:
            namespace[name] = numba.njit(pipeline_class=_helper_pipeline(), **_INLINED)(function)
    return SimpleNamespace(**{name: namespace[name] for name in entries if not name.startswith("_")})


def _functions(text: str, filename: str, namespace: dict[str, Any]) -> dict[str, FunctionType]:
    """Run the text in the namespace and return the functions it defines."""
    linecache.cache[filename] = (len(text), None, text.splitlines(True), filename)
    exec(compile(text, filename, "exec"), namespace)
    return {
        name: value
        for name, value in namespace.items()
        if isinstance(value, FunctionType) and value.__code__.co_filename == filename
    }


@cache
def _helper_pipeline() -> Any:
    """Return the compiler of helpers: what is inlined is optimised once, where it ends up, and nowhere else."""
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import CompilerBase, DefaultPassBuilder
    from numba.core.compiler_machinery import register_pass
    from numba.core.typed_passes import NativeLowering

    class Linked(JITCodeLibrary):
        """Code to be linked into other code, never to be run on its own."""

        def _optimize_final_module(self) -> None: ...

        def _finalize_final_module(self) -> None:
            self._finalized = True

    @register_pass(mutates_CFG=True, analysis_only=False)
    class Lowering(NativeLowering):
        _name = "cra_sym_helper_lowering"

        def run_pass(self, state: Any) -> bool:
            state.library = Linked(state.targetctx.codegen(), state.func_id.func_qualname)
            state.flags.no_compile = True
            super().run_pass(state)
            key: Any = [].append  # stands for the function that is never made: any built-in one, unlike all others
            state.targetctx.insert_user_function(key, state["cr"].fndesc, [state.library])
            state["cr"] = state["cr"]._replace(cfunc=key)
            return True

    class Pipeline(CompilerBase):
        def define_pipelines(self) -> list[Any]:
            manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
            manager.passes = [(Lowering if p is NativeLowering else p, why) for p, why in manager.passes]
            manager.finalize()
            return [manager]

    return Pipeline


class _StoredCode:
    """What a Numba dispatcher asks for machine code; the answers come from the private store, checked byte for byte."""

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
            except Exception:  # whatever is wrong with code this process did not make: make it anew
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
        """Do nothing: the store is always asked."""

    def disable(self) -> None:
        """Do nothing: the store is always asked."""

    def flush(self) -> None:
        """Do nothing: a changed text has another key."""
