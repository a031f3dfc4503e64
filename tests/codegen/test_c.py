"""Exported C: strict compilation, self-test, sanitizers, and random arms against the package's own numbers."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.kernels import elementary

pytestmark = pytest.mark.skipif(shutil.which("cc") is None or shutil.which("make") is None, reason="needs gcc and make")

MATHEMATICS = (
    "sqrt", "exp", "expm1", "sin", "cos", "sincos", "atan2", "fmax", "fmin", "memset", "memcpy", "memmove",
    "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail",
)  # fmt: skip
INTERNAL = (
    "all_finite", "pair", "groups_of", "valid_groups", "frequency_parameters", "frequency_parameters_batch",
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    target = tmp_path_factory.mktemp("export") / "c"
    cra.export("c", target)
    return target


def run(*command: str, cwd: Path) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    return done.stdout


def test_self_test_passes(folder):
    assert ", 0 failures" in run("make", "test", cwd=folder)


def test_self_test_can_fail(folder, tmp_path):
    run("make", "self_test", cwd=folder)
    lines = (folder / "reference.txt").read_text().splitlines()
    name, *numbers = lines[4].split()
    numbers[-1] = repr(float(numbers[-1]) * (1 + 1e-9))
    (tmp_path / "wrong.txt").write_text("\n".join([" ".join([name, *numbers])]) + "\n")
    done = subprocess.run([folder / "self_test", tmp_path / "wrong.txt"], capture_output=True, text=True)
    assert done.returncode == 1 and name in done.stderr


def test_sanitizers_find_nothing(folder):
    assert ", 0 failures" in run("make", "sanitize", cwd=folder)


def test_no_memory_no_input_no_output(folder):
    run("make", "libcra_arm.a", cwd=folder)
    if shutil.which("nm") is None:
        pytest.skip("needs nm")
    symbols = [line.split() for line in run("nm", "libcra_arm.a", cwd=folder).splitlines()]
    wanted = {s[-1] for s in symbols if s[-2:-1] == ["U"]}
    assert wanted <= {*MATHEMATICS, *(f"cra_{name}" for name in INTERNAL)}
    assert not [s for s in symbols if s[-2:-1] and s[-2] in "BDCbd"]  # no variable


class _Arm(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_double) for name in ("L", "b", "h", "E", "rho", "m_b", "m_e", "J_e", "k_t", "k_r", "zeta")
    ]


@pytest.fixture(scope="module")
def library(folder):
    command = (
        "cc -std=c99 -pedantic -Wall -Wextra -Werror -O2 -shared -fPIC -o libcra_arm.so spectrum.c batch.c modes.c -lm"
    )
    run(*command.split(), cwd=folder)
    return ctypes.CDLL(str(folder / "libcra_arm.so"))


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
    assert one(3.0, 0.0, 0.1, 0.0, 1001, found) == 2 and not found.any()
    assert one(3.0, 0.0, 0.1, 0.0, 1000, found) == 0
    np.testing.assert_allclose(found[:1000], cra.frequency_parameters(3.0, 0.0, 0.1, modes=1000), rtol=1e-12)


def test_branch_free_functions_are_those_of_the_kernels(folder):
    """The constants of sine, cosine and exponential in batch.c are those of the package, digit for digit."""
    text = (folder / "batch.c").read_text()
    function = text[text.index("static inline void circle_at") : text.index("/* The steps of spectrum.c")]
    digits = re.compile(r"\d\.\d{8,}(?:e-\d+)?")
    kernels = Path(elementary.__file__).read_text()
    assert set(digits.findall(function)) == set(digits.findall(kernels))


@pytest.mark.parametrize(
    "change, status",
    [({"L": 0.0}, 1), ({"L": np.nan}, 1), ({"k_t": -1.0}, 1), ({"zeta": 1.0}, 1), ({"m_e": np.inf}, 1), ({}, 0)],
)
def test_status_of_bad_input(library, change, status):
    arm = cra.Arm.nominal()
    values = {name: float(getattr(arm, name)) for name, _ in _Arm._fields_} | change
    frequencies = (ctypes.c_double * 3)()
    assert library.cra_natural_frequencies(ctypes.byref(_Arm(**values)), 3, frequencies) == status
    assert library.cra_natural_frequencies(ctypes.byref(_Arm(**values)), 0, frequencies) != 0


def test_no_silent_infinity_or_nan(library):
    """Whatever is put in, a function that says all is well has given finite numbers."""
    rng = np.random.default_rng(5)
    special = np.array([0.0, 1e-300, 1e-30, 1e-6, 1e3, 1e12, 1e100, 1e300, np.inf, -1.0, np.nan])
    fields = 25  # of a mode, all numbers
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
        if checked("modes", [modes], arm, 4, modes):
            continue
        if (modes[:, 1] > 0.0).all():
            checked("sensitivities", [out[:16]], arm, 4, modes, out)
        checked("tip_response", [out[:1]], arm, 4, modes, drawn(5, 0.3), ctypes.c_double(drawn(1, 0.3)[0]), out)
        checked("mode_shape", [out[:1]], modes[3], ctypes.c_double(arm[0] / 2), 3, out)
        A, B, C = np.zeros(100), np.zeros(10), np.zeros(10)
        checked("state_space_acceleration", [A, B, C], arm, 4, modes, A, B, C)
        checked("state_space_force", [A, B, C], arm, 4, modes, A, B, C)
        excitation, ratio = drawn(3, 0.3), ctypes.c_double(drawn(1, 0.3)[0])
        checked("excitation_matrix", [out[:16]], arm, 4, modes, excitation, ratio, out)
        checked("stability_boundary", [A[:1], B[:1]], arm, 4, modes, excitation, ratio, 1, 2, A, B)
    assert seen >= {0, 1, 2, 4, 5}
