"""Exported C: strict compilation, self-test, sanitizers, and random arms against the package's own numbers."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import cra_sym as cra

pytestmark = pytest.mark.skipif(shutil.which("cc") is None or shutil.which("make") is None, reason="needs gcc and make")

MATHEMATICS = (
    "sqrt", "exp", "expm1", "sin", "cos", "sincos", "atan2", "fmax", "fmin", "memset", "memcpy", "memmove",
    "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail",
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
    assert wanted <= set(MATHEMATICS) | {f"cra_{name}" for name in ("pair", "groups_of", "frequency_parameters")}
    assert not [s for s in symbols if s[-2:-1] and s[-2] in "BDCbd"]  # no variable


class _Arm(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_double) for name in ("L", "b", "h", "E", "rho", "m_b", "m_e", "J_e", "k_t", "k_r", "zeta")
    ]


@pytest.fixture(scope="module")
def library(folder):
    flags = "-std=c99 -O2 -ffp-contract=off -shared -fPIC -o libcra_arm.so spectrum.c modes.c -lm".split()
    run("cc", *flags, cwd=folder)
    return ctypes.CDLL(str(folder / "libcra_arm.so"))


def test_random_groups_agree_with_the_package(library):
    rng = np.random.default_rng(7)
    count, modes = 3000, 6
    groups = 10 ** rng.uniform(-6, 9, (4, count))
    for row, special in zip(groups, ((0, np.inf), (0, np.inf), (0,), (0,)), strict=True):
        row[rng.random(count) < 0.2] = rng.choice(special)
    expected = cra.frequency_parameters(*groups, modes=modes)
    found = np.empty((count, modes))
    solve = library.cra_frequency_parameters
    solve.argtypes = [ctypes.c_double] * 4 + [ctypes.c_int, ctypes.POINTER(ctypes.c_double)]
    for i in range(count):
        row = found[i].ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        assert solve(*groups[:, i], modes, row) == 0
    assert np.max(np.abs(found - expected) / np.where(expected > 0, expected, 1)) < 1e-12


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
