"""Examine mutants: a copy of the package, and for each mutant a process that runs the tests watching its module."""

from __future__ import annotations

import compileall
import os
import resource
import shutil
import sys
import tempfile
from collections.abc import Iterable
from enum import Enum
from pathlib import Path
from typing import Self

from tests.mutation.mutants import Mutant, mutants

__all__ = ["SUITE", "Laboratory", "Verdict"]

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 300  # of one core; many times what all tests of a module need
BYTES = 6 << 30

_CONFIRMS = "tests/arm/test_equations.py::test_the_independent_route_confirms"
_LAMBDA, _MODAL = "tests/arm/test_frequency_parameters.py", "tests/arm/test_modal_parameters.py"
_FREQUENCIES = [
    f"{_LAMBDA}::test_{name}"
    for name in ("classical_beams", "rigid_body_zeros", "none_is_missed_against_finite_elements")
]
_DIGITS = [f"{_LAMBDA}::test_{name}" for name in ("every_digit_of_random_extreme_arms", "monotonic_and_interlaced")]
_MODES = [
    f"{_MODAL}::test_{name}"
    for name in (
        "orthonormal_with_the_end_effector",
        "modal_stiffness_is_the_squared_frequency",
        "participation",
        "boundary_conditions",
        "end_values_are_those_of_the_shapes",
    )
]


def _section(*numbers: int | str) -> list[list[str]]:
    """Return the tests of a section of the paper: its own checks, then the physics, then every equation's check."""
    return [[f"{_CONFIRMS}[{number}]" for number in numbers], _FREQUENCIES, _MODES, [_CONFIRMS]]


#: Tests of each module in rounds; the first round that fails decides.
SUITE: dict[str, list[list[str]]] = {
    "arm/energy": _section(*range(1, 8)),
    "arm/motion": _section(8, 9, 10, "10a", "10b", "10c"),
    "arm/modal_dynamics": _section(11, 12, 13),
    "arm/joint": _section(14, 15, 16, "16a"),
    "arm/orthogonality": _section("16b", "16c", "16d", 5),
    "arm/modes": _section(*range(17, 27)),
    "arm/limits": _section(*range(27, 31)),
    "arm/characteristic": [_FREQUENCIES, _MODES, _DIGITS, ["tests/arm/test_characteristic.py"]],
    "arm/shapes": [_MODES, [_MODAL]],
    "solvers/spectrum": [_FREQUENCIES, _DIGITS, [_LAMBDA]],
    "solvers/shapes": [_MODES, [_MODAL]],
    "solvers/stiffness": [["tests/solvers/test_stiffness.py"], ["tests/model"]],
    "solvers/eigenvalues": [["tests/solvers/test_stiffness.py"], ["tests/model"]],
    "solvers/rayleigh": [["tests/solvers/test_stiffness.py"], ["tests/model"]],
    "solvers/modal_response": [
        ["tests/arm/test_response.py", "tests/arm/test_duhamel.py", "tests/arm/test_shaping.py"]
    ],
    "solvers/floquet": [["tests/solvers/test_floquet.py"]],
    "solvers/hill": [["tests/solvers/test_floquet.py"]],
    "solvers/certificates": [["tests/arm/test_certification.py"]],
}


class Verdict(Enum):
    """What became of a mutant; one that used up its share of time or memory counts as caught."""

    CAUGHT = 1
    EXHAUSTED = 2
    SURVIVED = 3


class Laboratory:
    """A copy of package and tests in which one module at a time is replaced."""

    def __enter__(self) -> Self:
        self._folder = tempfile.TemporaryDirectory()
        self.root = Path(self._folder.name) / "copy"
        for name in ("cra_sym", "tests"):
            shutil.copytree(ROOT / name, self.root / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", self.root)
        compileall.compile_dir(self.root / "cra_sym", quiet=1)
        for library in ("sympy", "numpy", "scipy.linalg", "mpmath", "pytest"):  # once for all mutants
            __import__(library)
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    def mutants(self, module: str) -> list[Mutant]:
        """Return every mutant of a module given as in `SUITE`."""
        return mutants((ROOT / "cra_sym" / f"{module}.py").read_text(encoding="utf-8"))

    def control(self, modules: Iterable[str]) -> bool:
        """Return whether the package as it is passes all these tests; without that no verdict means anything."""
        rounds = {tuple(tests): list(tests) for module in modules for tests in SUITE[module]}
        return self._verdict(list(rounds.values())) is Verdict.SURVIVED

    def examine(self, module: str, mutant: Mutant) -> Verdict:
        """Run the module's tests upon the mutant."""
        file = self.root / "cra_sym" / f"{module}.py"
        original = file.read_text(encoding="utf-8")
        for stale in (file.parent / "__pycache__").glob(f"{file.stem}.*.pyc"):
            stale.unlink()
        file.write_text(mutant.source, encoding="utf-8")
        try:
            return self._verdict(SUITE[module])
        finally:
            file.write_text(original, encoding="utf-8")

    def _verdict(self, rounds: list[list[str]]) -> Verdict:
        child = os.fork()
        if child == 0:
            try:
                self._run(rounds)
            finally:
                os._exit(1)
        _, status = os.waitpid(child, 0)
        if os.WIFSIGNALED(status):
            return Verdict.EXHAUSTED
        return Verdict.CAUGHT if os.WEXITSTATUS(status) else Verdict.SURVIVED

    def _run(self, rounds: list[list[str]]) -> None:
        """Run the rounds of tests, in the process of the mutant; leave with 1 at the first that fails."""
        import pytest

        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
        os.chdir(self.root)
        os.environ["XDG_CACHE_HOME"] = str(self.root.parent / "cache")
        os.environ["PYTHONPATH"] = str(self.root)
        sys.dont_write_bytecode = True
        sys.path[:] = [str(self.root), *(p for p in sys.path if Path(p or ".").resolve() != ROOT)]
        for name in [name for name in sys.modules if name.split(".")[0] in ("cra_sym", "tests")]:
            del sys.modules[name]
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        for tests in rounds:
            if pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests]):
                os._exit(1)
        os._exit(0)
