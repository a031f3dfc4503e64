"""Kernels of the package's own derivations: derived once, then read from the user's cache without SymPy."""

from __future__ import annotations

import hashlib
import json
import pickle
import platform
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import cra_sym
from cra_sym.checks import shown
from cra_sym.kernels import store
from cra_sym.kernels.callables import Kernel, kernel

__all__ = ["derived", "derived_kernel"]

_PACKAGE = Path(__file__).resolve().parent.parent
_DERIVING = ("symbols.py", "checks.py", "mechanics", "model", "kernels", "solvers", "arm", "analysis", "paper")


class _DerivedKernel(Kernel):
    """A kernel given by the path of its derivation, which is run on first use."""

    def __init__(self, path: str, given: tuple[Any, ...], backend: str | None) -> None:
        super().__init__("", (), backend)
        self.path, self.given = path, given

    @property
    def source(self) -> str:
        if not self._source:
            self._source, self._arguments = _source_of(self.path, self.given)
        return self._source

    @property
    def arguments(self) -> tuple[str, ...]:
        return self._arguments if self.source else ()

    def __repr__(self) -> str:
        return f"<Kernel of {_called(self.path, self.given)}>"


def derived_kernel(path: str, *arguments: Any, backend: str | None = None) -> Kernel:
    """Return the kernel of a derivation of this package; the derivation runs on first use.

    On first use its source is read from the user's cache, or else derived and cached for other processes. The key is a
    hash of the package's sources that derive and the versions of SymPy, NumPy, SciPy and Python: a change in any
    of them leads to a new derivation.

    Parameters
    ----------
    path : str
        ``"cra_sym.room.module:function"``. The function takes the arguments and returns ``(expression, arguments)``
        as :func:`cra_sym.kernels.kernel` takes them.
    arguments : literals
        Numbers, strings and tuples of them, which are part of the key.
    backend : {None, 'numpy', 'compiled'}
        As in :func:`cra_sym.kernels.kernel`.

    Raises
    ------
    ValueError
        If the path is not of that form or leads out of the package, or an argument is not a literal.
    """
    module, colon, function = path.partition(":") if isinstance(path, str) else ("", "", "")
    if not (colon and function.isidentifier() and module.startswith("cra_sym.")):
        raise ValueError(f"path = {shown(path)}: must be 'cra_sym.room.module:function'")
    if not _are_literals(arguments):
        raise ValueError(f"arguments = {shown(arguments)}: must be numbers, texts and tuples of them")
    return _DerivedKernel(path, arguments, backend)


def _are_literals(value: Any) -> bool:
    """Return whether a value is determined by its repr."""
    return all(map(_are_literals, value)) if type(value) is tuple else type(value) in (str, int, float, bool)


def _called(path: str, given: tuple[Any, ...]) -> str:
    return f"{path}({', '.join(map(repr, given))})" if given else path


@cache
def _source_of(path: str, given: tuple[Any, ...] = ()) -> tuple[str, tuple[str, ...]]:
    key = _key(path, given)
    content = store.load(key) if key else None
    if content is None:
        made = _derived(path, given)
        content = json.dumps([made.source, made.arguments]).encode()
        if key and _sources_are_what_runs():
            store.save(key, content)
    source, arguments = json.loads(content)
    return source, tuple(arguments)


def derived(path: str, *arguments: str) -> Any:
    """Return the result of a derivation of this package, read from the user's cache if it was derived before.

    Parameters
    ----------
    path : str
        ``"cra_sym.room.module:function"``. What the function returns is stored, so it must pickle.
    *arguments : str
        Passed on to the function, and part of the key.
    """
    key = _key(path, arguments)
    content = store.load(key) if key else None
    if content is not None:
        with suppress(Exception):  # a damaged entry of another process is derived again
            return pickle.loads(content)
    made = _narrated(path, arguments, lambda result: result)
    if key and _sources_are_what_runs():
        store.save(key, pickle.dumps(made))
    return made


def _derived(path: str, given: tuple[Any, ...]) -> Kernel:
    made: Kernel = _narrated(path, given, lambda result: kernel(*result))
    return made


def _narrated(path: str, given: tuple[Any, ...], finish: Callable[[Any], Any]) -> Any:
    """Return the finished result of a derivation, with a note on a terminal while it runs."""
    from tqdm import tqdm

    module, _, function = path.partition(":")
    with tqdm(total=0, desc=f"deriving {_called(path, given)}, once", bar_format="{desc}", leave=False, disable=None):
        return finish(getattr(import_module(module), function)(*given))


def _sources() -> list[Path]:
    paths = [_PACKAGE / name for name in _DERIVING]
    return [
        file for path in paths for file in (sorted(path.rglob("*.py")) if path.is_dir() else [path]) if file.is_file()
    ]


def _sources_are_what_runs() -> bool:
    """Return whether the files on disk are the code in memory: they exist, and none is newer than the process.

    Otherwise the result of old code could be stored under the hash of new files.
    """
    files = _sources()
    return bool(files) and all(file.stat().st_mtime <= cra_sym._LOADED for file in files)


def _key(path: str, given: tuple[Any, ...]) -> str | None:
    """Return the key of a stored derivation, None if it cannot be stored."""
    return f"{_called(path, given)} {fingerprint()}" if _hash_is_of_what_runs() else None


@cache
def _hash_is_of_what_runs() -> bool:
    """Return whether the fingerprint is that of the code in memory; asked once, since the fingerprint is kept."""
    before = _sources_are_what_runs()
    fingerprint()
    return before and _sources_are_what_runs()


@cache
def fingerprint() -> str:
    """Return the hash of all sources and versions that a derivation depends on, without importing them."""
    digest = hashlib.sha256()
    for file in _sources():
        content = file.read_bytes()
        digest.update(f"{file.relative_to(_PACKAGE).as_posix()} {len(content)}\n".encode() + content)
    digest.update(platform.python_implementation().encode() + platform.python_version().encode())
    for package in ("sympy", "numpy", "scipy"):
        digest.update(f"{package} {_version(package)}\n".encode())
    return digest.hexdigest()


def _version(package: str) -> Any:
    from importlib import metadata  # importing it takes longer than importing this package

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
