"""Examine mutants: for each a fork of one warm process, in which only what depends on its module is made anew."""

from __future__ import annotations

import ast
import importlib
import importlib.abc
import importlib.util
import os
import re
import resource
import sys
from collections.abc import Callable, Iterable, Sequence
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any

from tests.mutation.mutants import Mutant, mutants
from tests.mutation.watch import PACKAGE, rounds

__all__ = ["Laboratory", "Verdict"]

SECONDS = 90  # of processor time; several times what all tests of a module need
BYTES = 8 << 30
_DERIVED = re.compile(r"cra_sym(\.\w+)+(?=:|$)")


class Verdict(Enum):
    """What became of a mutant; one that used up its share of time or memory counts as caught."""

    CAUGHT = 1
    EXHAUSTED = 2
    SURVIVED = 3


class Laboratory:
    """One process that has imported and derived everything; no file is changed, no store is written.

    Parameters
    ----------
    tests : bool
        Whether the rounds of tests follow the checks of the numbered equations.
    """

    def __init__(self, tests: bool = True) -> None:
        self._tests = tests

    def mutants(self, module: str) -> list[Mutant]:
        """Return every mutant of a module given as ``room/name``."""
        return mutants(_file(module).read_text(encoding="utf-8"))

    def control(self, modules: Iterable[str]) -> bool:
        """Return whether the package as it is passes all these tests; without that no verdict means anything.

        What the checks derive on the way stays in this process, ready for the mutants that do not change it.
        """
        affected = {name for module in modules for name in dependents(_dotted(module))}
        confirmed = all(check() for check in _checks(affected))
        wanted = {tuple(tests): list(tests) for module in modules for tests in rounds(module)} if self._tests else {}
        return confirmed and _in_a_fork(lambda: _pass(list(wanted.values()))) is Verdict.SURVIVED

    def examine(self, module: str, mutant: Mutant) -> Verdict:
        """Run what watches over the module upon one of its mutants."""
        affected = dependents(_dotted(module))

        def survives() -> bool:
            _replace(module, mutant.source, affected)
            first = sorted(_checks(affected), key=lambda check: check.__self__.source.split(":")[0] != _dotted(module))
            return all(check() for check in first) and (not self._tests or _pass(rounds(module)))

        return _in_a_fork(survives)


def _file(module: str) -> Path:
    return PACKAGE / f"{module}.py"


def _dotted(module: str) -> str:
    return "cra_sym." + module.replace("/", ".")


# what depends on what ---------------------------------------------------------------------------------------------


@cache
def _uses() -> dict[str, set[str]]:
    """Return what each module of the package names: modules it imports and those whose derivations it runs."""
    files = {_name(file): file for file in PACKAGE.rglob("*.py")}
    return {
        name: _named(name, ast.parse(file.read_text(encoding="utf-8"))) & set(files) for name, file in files.items()
    }


def _name(file: Path) -> str:
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _named(name: str, tree: ast.Module) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            room = name.rsplit(".", node.level)[0] + "." if node.level else ""
            source = room + (node.module or "")
            found |= {source, *(f"{source}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and (match := _DERIVED.match(node.value)):
            found.add(match[0])
    return found


@cache
def dependents(dotted: str) -> frozenset[str]:
    """Return the modules that are not the same after a change in one: itself and all that use it, however far."""
    affected, fresh = {dotted}, {dotted}
    while fresh:
        fresh = {name for name, uses in _uses().items() if uses & fresh} - affected
        affected |= fresh
    return frozenset(affected - {"cra_sym"})


# in the process of a mutant ---------------------------------------------------------------------------------------


def _in_a_fork(passes: Callable[[], bool]) -> Verdict:
    child = os.fork()
    if child == 0:
        try:
            _isolate()
            os._exit(0 if passes() else 1)
        except BaseException:
            os._exit(1)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return Verdict.EXHAUSTED
    return Verdict.CAUGHT if os.WEXITSTATUS(status) else Verdict.SURVIVED


def _isolate() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)


def _replace(module: str, source: str, affected: frozenset[str]) -> None:
    """Put the mutant in the module's place and forget all that was made with the original."""
    import cra_sym
    from cra_sym.arm import equations
    from cra_sym.kernels import derived, store

    sys.meta_path.insert(0, _Finder(_dotted(module), source, _file(module)))
    original, read_text = derived._source_of, Path.read_text

    def source_of(path: str) -> tuple[str, tuple[str, ...]]:  # of a kernel: never from the store, never into it
        if path.partition(":")[0] not in affected:
            return original(path)
        made = derived._derived(path)
        return made.source, tuple(made.arguments)

    def read(path: Path, *args: Any, **options: Any) -> str:  # templates are read, not imported
        return source if path == _file(module) else read_text(path, *args, **options)

    store.save = lambda key, content: False
    derived._source_of, Path.read_text = cache(source_of), read
    for number in [n for n, e in equations._EQUATIONS.items() if e.source.partition(":")[0] in affected]:
        del equations._EQUATIONS[number]
    for number in [n for n, (route, _) in equations._ROUTES.items() if route.__module__ in affected]:
        del equations._ROUTES[number]
    for name in affected:
        sys.modules.pop(name, None)
        room, _, last = name.rpartition(".")
        vars(sys.modules[room]).pop(last, None) if room in sys.modules else None
    for name in cra_sym._HOME:
        vars(cra_sym).pop(name, None)


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finds one module, whose text is given."""

    def __init__(self, name: str, source: str, file: Path) -> None:
        self._name, self._source, self._file = name, source, file

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> Any:
        """Return the spec of this one module."""
        if fullname == self._name:
            return importlib.util.spec_from_file_location(fullname, self._file, loader=self)
        return None

    def exec_module(self, module: Any) -> None:
        """Run the text."""
        exec(compile(self._source, str(self._file), "exec"), vars(module))


def _checks(affected: Iterable[str]) -> list[Callable[[], bool]]:
    """Return the checks of the equations that these modules build, in the paper's order."""
    from cra_sym.arm.equations import equations

    return [e.check for e in equations(companions=True) if e.source.partition(":")[0] in affected]


def _pass(tests: Sequence[Sequence[str]]) -> bool:
    """Run rounds of tests; return whether all pass."""
    import pytest

    os.chdir(PACKAGE.parent)
    options = ["-x", "-q", "-o", "addopts=--import-mode=importlib"]
    options += [f"-pno:{plugin}" for plugin in ("cacheprovider", "xdist", "nbval", "faulthandler")]
    return not any(pytest.main([*options, *part]) for part in tests)
