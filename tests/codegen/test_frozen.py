"""Systems frozen as numbers: every language steps them alike, and as the package and SciPy say."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import StateSpace
from sympy import Symbol

import cra_sym as cra
from cra_sym.codegen.blocks import blocks_of
from cra_sym.codegen.frozen import frozen_library, frozen_system
from cra_sym.codegen.statement import stated
from cra_sym.symbols import L, k_t, t, v, x
from tests.codegen import kit

ARM = cra.Arm.nominal().replace(k_t=1e4, k_r=1e3, zeta=0.01)
STRICT = "-std=c99 -pedantic -Wall -Wextra -Wconversion -Wdouble-promotion -Wshadow -Werror -ffp-contract=off -O2"


@cache
def library(real: str = "float64"):
    return frozen_library(ARM, "crane", 3, real, "base_acceleration", None)[0]


@pytest.fixture(scope="module")
def c(tmp_path_factory) -> Path:
    if shutil.which("cc") is None:
        pytest.skip("needs gcc")
    return kit.write(library().texts("c"), tmp_path_factory.mktemp("c"))


@pytest.mark.parametrize("language", kit.COMMANDS)
def test_self_test_passes(language, tmp_path):
    """Outputs after many steps, by SciPy's matrix exponential; and what is refused."""
    kit.needs(language)
    kit.passes(library(), language, tmp_path)
    if language == "rust" and shutil.which("cargo-clippy"):
        kit.run(["cargo", "clippy", "--offline", "--quiet", "--", "-D", "warnings"], tmp_path)
        kit.run(["cargo", "build", "--offline", "--quiet", "--no-default-features"], tmp_path)


def test_a_wrong_number_fails_the_self_test(c):
    lines = library().checks
    wrong = replace(lines[1], expected=tuple(1.001 * value for value in lines[1].expected))
    (c / "wrong.txt").write_text(f"{wrong.line()}\n")
    kit.run(["make", "self_test"], c)
    assert subprocess.run([c / "self_test", c / "wrong.txt"], capture_output=True).returncode == 1


@pytest.mark.parametrize("language", ["c", "fortran"])
def test_single_precision_is_a_whole_path(language, tmp_path):
    """To 2e-3 of the largest output after 40 steps: 40 steps of phase errors of 6e-8 times the angles passed."""
    kit.needs(language)
    kit.passes(library("float32"), language, tmp_path)
    source = next(path.read_text() for path in tmp_path.rglob("crane.*") if path.suffix in (".c", ".f90"))
    assert not re.search(r"\bdouble\b", source) and "real64" not in source


@pytest.mark.parametrize("language", ["python", "javascript", "octave"])
def test_single_precision_is_refused_where_there_is_none(language, tmp_path):
    with pytest.raises(ValueError, match="real = 'float32'"):
        cra.export(language, tmp_path / "out", system=ARM, real="float32")
    assert not list(tmp_path.iterdir())


def test_strict_flags_of_both_compilers_and_c_plus_plus(c):
    for compiler in filter(shutil.which, ("gcc", "clang")):
        kit.run([compiler, *STRICT.split(), "-c", "crane.c", "-o", f"{compiler}.o"], c)
    bad = subprocess.run(["cc", "-ffast-math", "-c", "crane.c"], cwd=c, capture_output=True, text=True)
    assert bad.returncode and "ffast-math" in bad.stderr
    if shutil.which("nm"):
        listed = [line.split() for line in kit.run(["nm", "gcc.o"], c).splitlines()]
        assert {s[-1] for s in listed if s[-2] == "U"} <= {
            "sqrt",
            "exp",
            "memmove",
            "memcpy",
            "memset",
            "_GLOBAL_OFFSET_TABLE_",
            "__stack_chk_fail",
        }
        assert not [s for s in listed if s[-2] in "BDCbd"]
        assert all(s[-1].startswith("crane_") for s in listed if s[-2] == "T")


def test_sanitizers_and_valgrind_find_nothing(c):
    assert ", 0 failures" in kit.run(["make", "sanitize"], c)
    if shutil.which("valgrind"):
        kit.run(["make", "self_test"], c)
        kit.run(["valgrind", "--error-exitcode=9", "-q", "./self_test", "reference.txt"], c)


def test_the_longest_step_is_measured_and_called_so(c):
    printed = kit.run(["make", "timing"], c)
    found = re.search(r"longest measured time of step: (.+) us; mean of 1000000: (.+) us, ", printed)
    assert found and float(found[1]) >= float(found[2]) > 0


def test_null_gives_a_status(c):
    main = """
    #include "crane.h"
    #include <stddef.h>
    int main(void) {
        crane_state state = { { 0 } }; crane_sampled sampled; double y[CRANE_SIGNALS];
        return !(crane_discretise(1e-3, NULL) == CRANE_NULL_POINTER && crane_discretise(1e-3, &sampled) == CRANE_OK
            && crane_step(NULL, 0, &state) == CRANE_NULL_POINTER && crane_step(&sampled, 0, NULL) == CRANE_NULL_POINTER
            && crane_outputs(&state, 0, NULL) == CRANE_NULL_POINTER && crane_outputs(&state, 0, y) == CRANE_OK
            && crane_input_shaper(1, 0, 2, NULL, y) == CRANE_NULL_POINTER
            && crane_angular_frequency(1, NULL) == CRANE_NULL_POINTER);
    }
    """
    (c / "null.c").write_text(main)
    kit.run(["cc", "-std=c99", "null.c", "crane.c", "-lm", "-o", "null"], c)
    kit.run(["./null"], c)


def test_two_systems_and_an_arm_link_into_one_program(c, tmp_path):
    if shutil.which("g++") is None or shutil.which("cmake") is None:
        pytest.skip("needs g++ and cmake")
    one = kit.write(library().texts("c"), tmp_path / "one")
    other = replace(library(), name="gantry")
    two = kit.write(other.texts("c"), tmp_path / "two")
    for folder in (one, two):
        kit.run(["cmake", "-B", "build", f"-DCMAKE_INSTALL_PREFIX={tmp_path / 'usr'}"], folder)
        kit.run(["cmake", "--build", "build", "--target", "install"], folder)
    (tmp_path / "main.cpp").write_text(
        '#include "crane.h"\n#include "gantry.h"\n#include <cstring>\n'
        "int main() { crane_state a; gantry_state b; crane_rest(&a); gantry_rest(&b);\n"
        f'  return std::strcmp(CRANE_VERSION, "{cra.__version__}") + std::strcmp(GANTRY_VERSION, CRANE_VERSION); }}\n'
    )
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(both CXX)\nfind_package(crane CONFIG REQUIRED)\n"
        "find_package(gantry CONFIG REQUIRED)\nadd_executable(both main.cpp)\n"
        "target_link_libraries(both PRIVATE crane::crane gantry::gantry)\n"
    )
    kit.run(["cmake", "-B", "build", f"-DCMAKE_PREFIX_PATH={tmp_path / 'usr'}"], tmp_path)
    kit.run(["cmake", "--build", "build"], tmp_path)
    kit.run(["build/both"], tmp_path)


def test_different_models_never_look_alike():
    lagrangian = cra.paper_lagrangian()
    heads = set()
    for left in (lagrangian[1], lagrangian[1] - k_t * v**4 * 0 - 3 * v**2 / 2 * k_t):
        model = ARM.model.replace(left=left)
        made, _, _ = frozen_library(model.at(ARM.values), "m", 1, "float64", "base_acceleration", ["v"])
        text = made.texts("c")["m.h"]
        assert "SPDX-License-Identifier: BSD-3-Clause" in text and "Lagrangian density" in text
        heads.add(re.search(r"SHA-256 of the above: ([0-9a-f]{64})", text)[1])
    assert len(heads) == 2


def test_what_is_linearised_says_so():
    cubic = ARM.model.replace(left=ARM.model.pieces["left"] - Symbol("k_3") * v**4 / 4)
    assert "linearised about zero" in stated(cubic)[-1] and "linearised" not in "".join(stated(ARM.model))


def test_steps_are_the_tip_response():
    """The frozen modes under a held acceleration are Duhamel's integral in closed form."""
    blocks, names, _ = frozen_system(ARM, 3, "base_acceleration", ["v"])
    times = np.array([0.003, 0.11, 1.7])
    expected = cra.tip_response(ARM, cra.BaseMotion(acceleration=0.2), times, modes=3)
    names_of: dict = {}
    exec(compile(library().texts("python")["crane.py"], "crane", "exec"), names_of)
    for time, value in zip(times, expected, strict=True):
        state = names_of["rest"]()
        names_of["step"](names_of["discretise"](float(time)), 0.2, state)
        assert names_of["outputs"](state, 0.2)[1] == pytest.approx(value, rel=1e-11, abs=1e-14)
    assert names == ("v",) and len(blocks.stiffness) == 3


def damped() -> cra.System:
    import sympy as sp

    c_end, mass, tension = sp.symbols("c_end mass_ tension_", positive=True)
    w = sp.Function("w")(t)
    model = cra.Model(
        mass * (v.diff(t) + w.diff(t)) ** 2 / 2 - tension * v.diff(x) ** 2 / 2, fields=[v], x=x, domain=(0, L), t=t,
        left=-k_t * v**2 / 2, prescribed=[w], virtual_work=[(-c_end * v.diff(t), v, "right")],
    )  # fmt: skip
    return model.at({c_end: 0.3, mass: 1.0, tension: 4.0, L: 1.0, "k_t": 20.0}, zeta=0.01)


SYSTEMS = {
    "free base": lambda: (ARM, "drive_force"),
    "dampers": lambda: (damped(), "base_acceleration"),
    "overdamped": lambda: (damped().replace(c_end=9.0), "base_acceleration"),
    "rigid-body mode": lambda: (ARM.replace(k_t=0.0), "base_acceleration"),
    "two rigid-body modes": lambda: (ARM.replace(k_t=0.0, k_r=0.0, zeta=0.0), "base_acceleration"),
}  # fmt: skip


@pytest.mark.parametrize("name", SYSTEMS)
def test_blocks_are_the_state_space(name):
    """The frequency response, and the response to a step by SciPy's own exponential of the whole matrix."""
    system, drive = SYSTEMS[name]()
    whole = cra.state_space(system, 3, drive, ["v", "w"])
    blocks, _, _ = frozen_system(system, 3, drive, ["v", "w"])
    omega, unit = np.geomspace(0.7, 900.0, 31), np.eye(len(whole.A))
    expected = whole.C @ np.stack([np.linalg.solve(1j * w * unit - whole.A, whole.B)[:, 0] for w in omega], 1)
    found = blocks.frequency_response(omega)
    assert np.max(np.abs(found - expected - whole.D)) <= 1e-9 * np.abs(expected).max()


def test_poles_that_cannot_be_told_apart_are_refused():
    A = np.array([[-1.0, 1.0, 0, 0], [0, -1.0, 1.0, 0], [0, 0, -1.0, 1.0], [0, 0, 0, -1.0]])
    system = StateSpace(A, np.eye(4)[:, 3:], np.eye(4)[:1], np.zeros((1, 1)))
    with pytest.raises(ValueError, match="poles lie too close"):
        blocks_of(system.A, system.B, system.C, system.D)


@pytest.mark.parametrize(
    "options, error",
    [
        ({"system": "arm"}, TypeError), ({"system": ARM, "model": ARM.model}, TypeError),
        ({"system": ARM, "modes": 0}, ValueError),
        ({"system": ARM, "name": "2crane"}, ValueError), ({"system": ARM, "name": "while"}, ValueError),
        ({"system": ARM, "name": 3}, TypeError), ({"system": ARM, "real": "float16"}, ValueError),
        ({"system": ARM.replace(L=[1.0, 2.0])}, ValueError), ({"system": ARM, "outputs": ["nothing"]}, ValueError),
        ({"system": ARM, "input": ["base_acceleration", v.subs(x, L)]}, ValueError),
    ],
)  # fmt: skip
def test_bad_input_writes_nothing(options, error, tmp_path):
    with pytest.raises(error) as caught:
        cra.export("c", tmp_path / "out", **options)
    assert "\n" not in str(caught.value) and not list(tmp_path.iterdir())
