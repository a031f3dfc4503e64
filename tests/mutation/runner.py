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
from contextlib import redirect_stdout
from enum import Enum
from functools import cache
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.mutation.mutants import Mutant, mutants
from tests.mutation.watch import PACKAGE, rounds

if TYPE_CHECKING:
    from cra_sym.paper.equations import Equation

__all__ = ["Laboratory", "Verdict"]

LIKELY = 3
SECONDS = 90  # of processor time, beside three times what the module's tests need
BYTES = 8 << 30
_LIBRARIES = ("mpmath", "scipy.integrate", "scipy.linalg", "scipy.optimize", "scipy.special", "scipy.stats")
_REGISTRY = "cra_sym.paper.equations"  # names the homes of the equations, and is the same whatever they hold
_DERIVED = re.compile(r"cra_sym(\.\w+)+(?=:|$)")
_KEYED = re.compile(r"\bcra_sym(?:\.\w+)+(?=:)")  # the modules that the key of a stored derivation names


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
        Whether the rounds of tests follow the checks of the numbered equations; if not, the checks are those of the
        equations that the module itself builds.
    """

    def __init__(self, tests: bool = True) -> None:
        self._tests = tests
        self._noticed: dict[str, list[tuple[str, str]]] = {}  # of a module: function and what noticed, latest first
        self._sound: set[str] = set()  # checks that pass without a mutant
        self._needed: dict[str, float] = {}  # s of processor time of a module's tests without a mutant
        _warm_up()

    def mutants(self, module: str) -> tuple[str, list[Mutant]]:
        """Return the code of a module given as ``room/name``, and every mutant of it."""
        source = _file(module).read_text(encoding="utf-8")
        return source, mutants(source)

    def examine(self, module: str, mutant: Mutant) -> tuple[Verdict, str]:
        """Run what watches over the module upon one of its mutants; return the verdict and what noticed it."""
        self._prepare(module)
        affected = dependents(_dotted(module))
        likely = self._likely(module, mutant.function)

        def noticed() -> str:
            _replace(module, mutant.source, affected)
            found = self._checked(module)
            suspects = [e for name in likely for e in found if _title(e) == name]
            own = [e for e in found if e.source.partition(":")[0] == _dotted(module)]
            tests = [[name] for name in likely if name.startswith("tests/")]
            return (
                _first_failing_check([*suspects, *own])
                or (self._tests and _first_failing_test(tests))
                or _first_failing_check(e for e in found if e not in own and e not in suspects)
                or (self._tests and _first_failing_test(rounds(module)))
                or ""
            )

        verdict, by = _in_a_fork(noticed, SECONDS + round(3.0 * self._needed[module]))
        if by:
            self._confirm(by)
            self._noticed.setdefault(module, []).insert(0, (mutant.function, by))
        return verdict, by

    def _prepare(self, module: str) -> None:
        """Run the tests on the package as it is; what they derive goes to the store, from which mutants read it."""
        if module in self._needed:
            return
        start, tests = _spent(), {name for part in rounds(module) for name in part} if self._tests else set()
        if tests and (failing := _in_a_fork(lambda: _first_failing_test([sorted(tests)]))[1]):
            raise RuntimeError(f"{failing} fails without a mutant")
        self._needed[module] = _spent() - start

    def _confirm(self, check: str) -> None:
        """Run a check that noticed a mutant, here; what it derives stays, ready for mutants that do not change it."""
        if check not in self._sound:
            if _first_failing_check(e for e in _equations() if _title(e) == check):
                raise RuntimeError(f"{check} fails without a mutant")
            self._sound.add(check)

    def _checked(self, module: str) -> list[Equation]:
        """Return the equations whose checks watch over a module: the arm's, for the solvers know of none."""
        builders = dependents(_dotted(module)) if self._tests else {_dotted(module)}
        return [] if module.startswith("solvers/") else _built_by(builders)

    def _likely(self, module: str, function: str) -> list[str]:
        """Return what noticed the latest mutants of the same function, or else of the same module."""
        latest = sorted(self._noticed.get(module, []), key=lambda entry: entry[0] != function)
        return list(dict.fromkeys(by for _, by in latest))[:LIKELY]


def _file(module: str) -> Path:
    return PACKAGE / f"{module}.py"


def _dotted(module: str) -> str:
    return "cra_sym." + module.replace("/", ".")


def _warm_up() -> None:
    """Import here what every mutant would import in a process of its own: the package, pytest and what tests use."""
    import cra_sym

    for name in (*(f"cra_sym.{home}" for home in cra_sym._HOME.values()), *_LIBRARIES):
        importlib.import_module(name)
    with redirect_stdout(StringIO()):
        _first_failing_test([["tests/mutation/test_mutants.py", "--collect-only"]])


# what depends on what ---------------------------------------------------------------------------------------------


@cache
def _uses() -> dict[str, set[str]]:
    """Return what each module of the package names: modules it imports and those whose derivations it runs."""
    files = {_name(file): file for file in PACKAGE.rglob("*.py")}
    uses = {
        name: _named(name, ast.parse(file.read_text(encoding="utf-8"))) & set(files) for name, file in files.items()
    }
    return uses | {_REGISTRY: set()}


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


def _in_a_fork(noticed: Callable[[], str], seconds: int = resource.RLIM_INFINITY) -> tuple[Verdict, str]:
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            _isolate(seconds)
            by = noticed()
        except BaseException as error:
            by = type(error).__name__
        os.write(writer, by.encode()[:1000])
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        by = pipe.read()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return Verdict.EXHAUSTED, ""
    return (Verdict.CAUGHT if by else Verdict.SURVIVED), by


def _spent() -> float:
    """Return the processor time of ended child processes, in s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


def _isolate(seconds: int) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)


def _replace(module: str, source: str, affected: frozenset[str]) -> None:
    """Put the mutant in the module's place and forget all that was made with the original."""
    import cra_sym
    from cra_sym.kernels import derived, store
    from cra_sym.paper import equations

    sys.meta_path.insert(0, _Finder(_dotted(module), source, _file(module)))
    kept, read_text, load = derived._source_of, Path.read_text, store.load
    anew = kept.__wrapped__

    def source_of(path: str, given: tuple[Any, ...] = ()) -> tuple[str, tuple[str, ...]]:
        return (anew if path.partition(":")[0] in affected else kept)(path, given)

    def unaffected(key: str) -> bytes | None:
        return load(key) if affected.isdisjoint(_KEYED.findall(key)) else None

    def read(path: Path, *args: Any, **options: Any) -> str:  # templates are read, not imported
        return source if path == _file(module) else read_text(path, *args, **options)

    store.load, store.save = unaffected, lambda key, content: False
    derived._source_of, Path.read_text = cache(source_of), read
    for number in [n for n, e in equations._EQUATIONS.items() if e.source.partition(":")[0] in affected]:
        del equations._EQUATIONS[number]
    for routes in (equations._PROOFS, equations._SAMPLES):
        for number in [n for n, route in routes.items() if route.__module__ in affected]:
            del routes[number]
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


def _equations() -> tuple[Equation, ...]:
    from cra_sym.paper.equations import equations

    return equations(companions=True)


def _built_by(affected: Iterable[str]) -> list[Equation]:
    """Return the equations that these modules build, in the paper's order."""
    return [e for e in _equations() if e.source.partition(":")[0] in affected]


def _first_failing_check(found: Iterable[Equation]) -> str:
    for equation in found:
        try:
            if equation.check():
                continue
        except Exception:
            pass
        return _title(equation)
    return ""


def _title(equation: Equation) -> str:
    return f"equation ({equation.number})"


def _first_failing_test(parts: Sequence[Sequence[str]]) -> str:
    """Run rounds of tests; return the name of the first that fails, or nothing."""
    import pytest

    os.chdir(PACKAGE.parent)
    options = ["-x", "-q", "--assert=plain", "-o", "addopts=--import-mode=importlib"]
    options += ["-k", "not sanitizers"]  # these reserve more than BYTES of addresses
    options += [
        f"-pno:{plugin}" for plugin in ("cacheprovider", "xdist", "nbval", "faulthandler", "unraisableexception")
    ]
    passing = pytest.ExitCode.OK, pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.NO_TESTS_COLLECTED  # the name has gone
    witness = _Witness()
    for part in parts:
        if pytest.main([*options, *part], plugins=[witness]) not in passing or witness.failed:
            return witness.failed or "pytest"
    return ""


class _Witness:
    """Remembers which test failed first; a failure is enough, its smallest example is not wanted."""

    failed = ""

    def pytest_configure(self) -> None:
        """Let Hypothesis neither shrink nor store."""
        from hypothesis import Phase, settings

        settings.register_profile("mutants", phases=(Phase.explicit, Phase.generate), database=None)
        settings.load_profile("mutants")

    def pytest_collectreport(self, report: Any) -> None:
        """A module that cannot be imported fails as a whole."""
        self.failed = self.failed or (report.nodeid if report.failed else "")

    def pytest_runtest_logreport(self, report: Any) -> None:
        """A test or its fixture."""
        self.failed = self.failed or (report.nodeid if report.failed else "")
