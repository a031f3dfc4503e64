"""Exported C: strict compilation, self-test, sanitizers, and random arms against the package's own numbers.

`tests.codegen.test_readme` does what the README says: the whole self-test, under the sanitizers too, and CMake.
"""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.codegen.arm_library import arm_library
from tests.codegen import kit
from tests.codegen.kit import arm_without_vectors

pytestmark = pytest.mark.skipif(shutil.which("cc") is None or shutil.which("make") is None, reason="needs gcc and make")

MATHEMATICS = (
    "sqrt", "exp", "expm1", "sin", "cos", "sincos", "atan2", "fmax", "fmin", "memset", "memcpy", "memmove",
    "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail",
)  # fmt: skip
FLAGS = "-std=c99 -pedantic -Wall -Wextra -Wconversion -Wdouble-promotion -Wshadow -Werror -ffp-contract=off".split()


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The arm, with its library and its self-test, built under the strict flags of its Makefile."""
    target = tmp_path_factory.mktemp("export") / "c"
    cra.export("c", target)
    kit.run(["make", "self_test", "SIMD="], target)
    return target


def test_self_test_can_fail(folder, tmp_path):
    *numbers, last = (folder / "reference.txt").read_text().splitlines()[0].split()
    (tmp_path / "wrong.txt").write_text(" ".join([*numbers, repr(float(last) * (1 + 1e-9))]) + "\n")
    done = subprocess.run([folder / "self_test", tmp_path / "wrong.txt"], capture_output=True, text=True)
    assert done.returncode == 1 and f"quantity {numbers[0]}" in done.stderr


def test_valgrind_finds_nothing(folder):
    if shutil.which("valgrind") is None:
        pytest.skip("needs valgrind")
    lines = (folder / "reference.txt").read_text().splitlines()
    (folder / "few.txt").write_text("\n".join(lines[::80]) + "\n")
    kit.run(["valgrind", "-q", "--error-exitcode=9", "--track-origins=no", "./self_test", "few.txt"], folder)


def test_strict_compilers_say_nothing(tmp_path):
    kit.write(arm_without_vectors("crane").texts("c"), tmp_path)
    both = ["-c", "crane.c", "crane_batch.c"]
    if shutil.which("gcc"):
        kit.run(["gcc", *FLAGS, "-O2", "-fstack-usage", *both], tmp_path)
        # what the README says of the stack, less what functions called have
        lines = [line for file in tmp_path.glob("*.su") for line in file.read_text().splitlines()]
        of = [[int(x.split()[1]) for x in lines if x.startswith(name)] for name in ("crane.c:", "crane_batch.c:")]
        assert max(of[0]) < 9.5e3 and sum(of[1]) < 1.6e5
    less = ["-DCRANE_MOST_MODES=20", "-DCRANE_MOST_LANES=8", "-DCRANE_MOST_MODES_TOGETHER=4"]
    for compiler in filter(shutil.which, ("gcc", "clang")):
        for more in ([], less):
            kit.run([compiler, *FLAGS, "-fsyntax-only", *more, *both], tmp_path)
        fast = [compiler, "-std=c99", "-ffast-math", "-fsyntax-only", "crane.c"]
        done = subprocess.run(fast, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode and "do not compile with -ffast-math" in done.stderr


def test_no_memory_no_input_no_output(folder):
    if shutil.which("nm") is None:
        pytest.skip("needs nm")
    symbols = [line.split() for line in kit.run(["nm", "libcra.a"], folder).splitlines()]
    wanted = {s[-1] for s in symbols if s[-2:-1] == ["U"]}
    assert wanted <= {*MATHEMATICS, "cra_groups_of", "cra_frequency_parameters"}
    assert not [s for s in symbols if s[-2:-1] and s[-2] in "BDCbd"]  # no variable


def test_bits_are_those_of_plain_python(folder):
    """Of everything that the self-test asks for, with the one mathematical library that both have here."""
    checks = kit.bits(arm_library("cra"))
    (folder / "bits.txt").write_text("".join(f"{check.line()}\n" for check in checks))
    printed = kit.run(["./self_test", "bits.txt"], folder)
    assert f"{len(checks)} checks, 0 failures" in printed and len(checks) > 500


@pytest.mark.parametrize("language", ["c", "fortran", "rust"])
def test_single_precision_is_as_exact_as_it_says(language, tmp_path):
    """All reference vectors: 1e-5 for frequencies, 5e-4 for everything else."""
    kit.needs(language)
    library = arm_library("single", "float32")
    kit.passes(library, language, tmp_path)
    texts = library.texts(language)
    text = "".join(text for file, text in texts.items() if file != "README.md" and "test" not in file)
    assert not re.search(r"\bdouble \w|\bf64\b", re.sub(r"//.*|/\*.*|.*real64.*", "", text))
    assert "right to 1e-05 and all else to 0.0005" in texts["README.md"]


class _Arm(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_double) for name in ("L", "b", "h", "E", "rho", "m_b", "m_e", "J_e", "k_t", "k_r", "zeta")
    ]


@pytest.fixture(scope="module")
def library(folder):
    kit.run(["cc", "-shared", "-o", "libcra.so", "cra.o", "cra_batch.o", "-lm"], folder)
    return ctypes.CDLL(str(folder / "libcra.so"))


@pytest.mark.parametrize("modes", [1, 6, 40])
def test_random_groups_agree_with_the_package(library, modes):
    rng = np.random.default_rng(7)
    count = 6000 // modes
    groups = 10 ** rng.uniform(-6, 9, (4, count))
    for row, special in zip(groups, ((0, np.inf), (0, np.inf), (0,), (0,)), strict=True):
        row[rng.random(count) < 0.2] = rng.choice(special)
    expected = cra.frequency_parameters(*groups, modes=modes)
    pointer, rows = np.ctypeslib.ndpointer(np.float64, flags="C"), np.ctypeslib.ndpointer(np.float64)
    one, batch = library.cra_frequency_parameters, library.cra_frequency_parameters_batch
    one.argtypes = [ctypes.c_double] * 4 + [ctypes.c_int, rows]
    batch.argtypes = [ctypes.c_size_t, *[pointer] * 4, ctypes.c_int, pointer]
    alone, together = np.empty((count, modes)), np.empty((count, modes))
    assert not any(one(*groups[:, i], modes, alone[i]) for i in range(count))
    assert batch(count, *groups, modes, together) == 0
    for found in (alone, together):
        assert np.max(np.abs(found - expected) / np.where(expected > 0, expected, 1)) < 1e-12


def test_groups_of_any_size_converge(library):
    """As far as the header says."""
    groups = 10 ** np.random.default_rng(8).uniform(-12, 12, (4, 20000))
    found = np.empty((20000, 4))
    pointer = np.ctypeslib.ndpointer(np.float64, flags="C")
    batch = library.cra_frequency_parameters_batch
    batch.argtypes = [ctypes.c_size_t, *[pointer] * 4, ctypes.c_int, pointer]
    one = library.cra_frequency_parameters
    one.argtypes = [ctypes.c_double] * 4 + [ctypes.c_int, np.ctypeslib.ndpointer(np.float64)]
    assert not any(one(*groups[:, i], 4, found[i]) for i in range(20000))
    assert (np.diff(found, axis=1) > 0.0).all()
    assert batch(20000, *groups, 4, found) == 0


def test_the_most_modes_and_no_more(library):
    one = library.cra_frequency_parameters
    one.argtypes = [ctypes.c_double] * 4 + [ctypes.c_int, np.ctypeslib.ndpointer(np.float64)]
    found = np.zeros(1001)
    assert one(3.0, 0.0, 0.1, 0.0, 1001, found) == ARGUMENT and not found.any()
    assert one(3.0, 0.0, 0.1, 0.0, 1000, found) == 0
    np.testing.assert_allclose(found[:1000], cra.frequency_parameters(3.0, 0.0, 0.1, modes=1000), rtol=1e-12)


BAD = [("L", 0.0), ("L", np.nan), ("k_t", -1.0), ("zeta", 1.0), ("m_e", np.inf), ("J_e", -1.0), ("E", np.nan)]
NULL, ARGUMENT, ARM, OVERFLOW, STABLE = 1, 2, 4, 5, 6


def test_numbers_of_the_statuses(folder):
    header = (folder / "cra.h").read_text()
    names = ("NULL_POINTER", "INVALID_ARGUMENT", "INVALID_ARM", "OVERFLOW", "NO_INSTABILITY")
    for name, number in zip(names, (NULL, ARGUMENT, ARM, OVERFLOW, STABLE), strict=True):
        assert f"CRA_{name} = {number}" in header


@pytest.mark.parametrize(
    "change, status",
    [
        ({"L": 0.0}, ARM),
        ({"L": np.nan}, ARM),
        ({"k_t": -1.0}, ARM),
        ({"zeta": 1.0}, ARM),
        ({"m_e": np.inf}, ARM),
        ({}, 0),
    ],
)
def test_status_of_bad_input(library, change, status):
    arm = cra.Arm.nominal()
    values = {name: float(getattr(arm, name)) for name, _ in _Arm._fields_} | change
    frequencies = (ctypes.c_double * 3)()
    assert library.cra_natural_frequencies(ctypes.byref(_Arm(**values)), 3, frequencies) == status
    assert library.cra_natural_frequencies(ctypes.byref(_Arm(**values)), 0, frequencies) != 0
    assert library.cra_natural_frequencies(None, 3, frequencies) == NULL
    assert library.cra_natural_frequencies(ctypes.byref(_Arm(**values)), 3, None) == NULL


def _fields(folder: Path) -> int:
    """How many doubles a mode has."""
    header = (folder / "cra.h").read_text()
    record = header[header.index("// One mode") : header.index("} cra_mode;")]
    return sum(int(size or 1) for size in re.findall(r"double \w+(?:\[(\d+)\])?;", record))


def test_modes_of_another_arm_are_refused(library, folder):
    size, number = _fields(folder), ctypes.c_double
    nominal = np.array([float(getattr(cra.Arm.nominal().replace(k_t=1e4, k_r=1e3), name)) for name, _ in _Arm._fields_])
    pointer = lambda array: array.ctypes.data_as(ctypes.c_void_p)  # noqa: E731
    modes, out = np.zeros((3, size)), np.zeros(64)
    motion = np.array([0.1, 0.0, 0.0, 0.0, 0.0])
    assert library.cra_modes_of(pointer(nominal), 3, pointer(modes)) == 0
    respond = library.cra_tip_response
    assert respond(pointer(nominal), 3, pointer(modes), pointer(motion), number(0.1), pointer(out)) == 0
    for field in (0, 1, 2, 3, 4, 6, 7, 8, 9):  # all but the base's mass and the damping, which modes have not
        other = nominal.copy()
        other[field] = other[field] * 1.01 + (1e-6 if field == 7 else 0.0)
        assert respond(pointer(other), 3, pointer(modes), pointer(motion), number(0.1), pointer(out)) == ARGUMENT
    other = nominal.copy()
    other[[5, 10]] = 7.0, 0.02
    assert respond(pointer(other), 3, pointer(modes), pointer(motion), number(0.1), pointer(out)) == 0
    rng = np.random.default_rng(3)
    for foreign in (np.zeros(size), np.full(size, np.nan), rng.normal(size=size), np.full(size, 1e300)):
        assert library.cra_mode_shape(pointer(foreign), number(0.0), 0, pointer(out)) == ARGUMENT
        assert library.cra_sensitivity(pointer(foreign), pointer(out)) == ARGUMENT


def test_no_silent_infinity_or_nan(library, folder):
    """Whatever is put in, a function that says all is well has given finite numbers."""
    rng = np.random.default_rng(5)
    special = np.array([0.0, 1e-300, 1e-30, 1e-6, 1e3, 1e12, 1e100, 1e300, np.inf, -1.0, np.nan])
    fields = _fields(folder)
    seen = set()

    def drawn(count, share):
        usual = 10 ** rng.uniform(-3, 3, count)
        return np.where(rng.random(count) < share, rng.choice(special, count), usual)

    def checked(name, outputs, *arguments):
        pointers = [a.ctypes.data_as(ctypes.c_void_p) if isinstance(a, np.ndarray) else a for a in arguments]
        status = getattr(library, f"cra_{name}")(*pointers)
        seen.add(status)
        assert status or all(np.isfinite(output).all() for output in outputs), (name, arguments)
        return status

    nominal = cra.Arm.nominal().replace(k_t=1e4, k_r=1e3, zeta=0.01)
    for _ in range(2000):
        arm = np.array([float(getattr(nominal, name)) for name, _ in _Arm._fields_])
        arm = np.where(rng.random(11) < 0.2, drawn(11, 0.3), arm)
        modes, out = np.zeros((4, fields)), np.zeros(64)
        checked("natural_frequencies", [out[:4]], arm, 4, out)
        if checked("modes_of", [np.zeros(0)], arm, 4, modes):
            continue
        assert np.isfinite(np.delete(modes, [fields - 5, fields - 4], axis=1)).all()  # all but stiffnesses of the arm
        checked("sensitivity", [out[:4]], modes[1], out)
        checked("tip_response", [out[:1]], arm, 4, modes, drawn(5, 0.3), ctypes.c_double(drawn(1, 0.3)[0]), out)
        checked("mode_shape", [out[:1]], modes[3], ctypes.c_double(arm[0] / 2), 3, out)
        A, B, C = np.zeros(100), np.zeros(10), np.zeros(10)
        checked("state_space_acceleration", [A, B, C], arm, 4, modes, 8, 64, A, B, C)
        checked("state_space_force", [A, B, C], arm, 4, modes, 10, 100, A, B, C)
        excitation, ratio = drawn(3, 0.3), ctypes.c_double(drawn(1, 0.3)[0])
        checked("coupling", [out[:1]], arm, excitation, modes[1], modes[2], ratio, out)
        checked("stability_boundary", [out[:2]], arm, excitation, ratio, modes[0], modes[1], 0, out)
    assert seen >= {0, ARGUMENT, ARM, OVERFLOW, STABLE}
