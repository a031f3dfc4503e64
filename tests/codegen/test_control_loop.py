"""A regulator and an observer at 1 kHz from exported C alone, beside the same loop in matrices; what is refused."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from functools import cache
from unittest.mock import patch

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.codegen import user_model
from cra_sym.codegen.controllers import of_blocks, sampled_matrices
from cra_sym.codegen.frozen import frozen_library, frozen_system
from cra_sym.codegen.operations import operations
from cra_sym.codegen.user_model import model_library
from cra_sym.kernels.form_parse import parse
from tests import systems
from tests.codegen import kit
from tests.codegen.test_user_model import executed

ARM = cra.Arm.nominal().replace(k_t=1e4, k_r=1e3, m_e=0.05, J_e=1e-4, zeta=0.002)
OUTPUTS = ["w", "root_moment", "v", "y"]
CONTROLLER = cra.Controller(
    1e-3, measured=["w", "root_moment"], noise=[1e-5, 1e-2], disturbance=1.0, weights={"y": 1e5, "v": 1e6}
)
STEPS = 2500
LOOP = r"""
#include "axis.h"
#include "plant.h"
#include <stdio.h>

static double feed_at(int k) /* accelerate, decelerate, stand still */
{
    return k < 300 ? 2.0 : k < 600 ? -2.0 : 0.0;
}

int main(void)
{
    for (int feedback = 0; feedback < 2; feedback++) {
        axis_sampled model;
        axis_state estimate, wanted;
        plant_sampled machine;
        plant_state plant;
        double u = 0.0, y[PLANT_SIGNALS];
        int bad = axis_discretise(AXIS_CONTROL_TIME, &model) || plant_discretise(AXIS_CONTROL_TIME, &machine);
        bad = bad || axis_rest(&estimate) || axis_rest(&wanted) || plant_rest(&plant);
        for (int k = 0; k < STEPS && !bad; k++) {
            bad = plant_outputs(&plant, u, y);
            const double measured[AXIS_SENSORS] = { y[0], y[1] }, feed = feed_at(k);
            bad = bad || axis_correct(measured, u, &estimate) || axis_control(&estimate, &wanted, feed, &u);
            u = feedback ? u : feed;
            bad = bad || axis_step(&model, u, &estimate) || axis_step(&model, feed, &wanted);
            for (int i = 1; i < AXIS_BLOCKS; i++) { /* the base on its way, the arm straight */
                wanted.position[i] = wanted.rate[i] = 0.0;
            }
            bad = bad || plant_step(&machine, u, &plant);
            printf("%.17g %.17g\n", y[0], y[2]);
        }
        if (bad) {
            return 1;
        }
    }
    return 0;
}
"""


def in_matrices(feedback: bool) -> np.ndarray:
    """The same loop by matrix exponentials, shape (steps, 2): w and v."""
    model, names, _ = frozen_system(ARM, 3, "base_acceleration", OUTPUTS)
    plant = frozen_system(ARM.replace(m_e=0.06), 6, "base_acceleration", OUTPUTS)[0]
    regulator, observer = CONTROLLER.gains(*of_blocks(model, 1e-3), names)
    (A, B), (Ap, Bp) = (sampled_matrices(blocks, 1e-3) for blocks in (model, plant))
    C, Cp = (np.hstack([blocks.on_position, blocks.on_rate]) for blocks in (model, plant))
    estimate, wanted, x = np.zeros(len(A)), np.zeros(len(A)), np.zeros(len(Ap))
    found = np.empty((STEPS, 2))
    for k in range(STEPS):
        feed = 2.0 if k < 300 else -2.0 if k < 600 else 0.0
        y = Cp @ x
        estimate = estimate + observer @ (y[:2] - C[:2] @ estimate)
        u = feed - regulator @ (estimate - wanted) if feedback else feed
        estimate, wanted, x = A @ estimate + B[:, 0] * u, A @ wanted + B[:, 0] * feed, Ap @ x + Bp[:, 0] * u
        wanted[np.arange(len(wanted)) % 4 > 0] = 0.0  # the base on its way, the arm straight
        found[k] = y[0], y[2]
    return found


def test_a_loop_of_exported_c_alone_damps_the_tip(tmp_path):
    if shutil.which("cc") is None:
        pytest.skip("needs cc")
    for name, system, modes, controller in (
        ("axis", ARM, 3, CONTROLLER),
        ("plant", ARM.replace(m_e=0.06), 6, None),
    ):
        library = frozen_library(system, name, modes, "float64", "base_acceleration", OUTPUTS, controller)[0]
        for file, text in library.texts("c").items():
            if file in (f"{name}.c", f"{name}.h"):
                (tmp_path / file).write_text(text)
    (tmp_path / "main.c").write_text(LOOP)
    flags = "-std=c99 -pedantic -Wall -Wextra -Wconversion -Werror -O2".split()
    build = ["cc", *flags, f"-DSTEPS={STEPS}", "main.c", "axis.c", "plant.c", "-lm", "-o", "main"]
    subprocess.run(build, cwd=tmp_path, check=True)
    printed = subprocess.run(["./main"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    without, with_feedback = np.array([line.split() for line in printed.splitlines()], float).reshape(2, STEPS, 2)
    for found, feedback in ((without, False), (with_feedback, True)):
        np.testing.assert_allclose(found, in_matrices(feedback), atol=1e-9 * np.abs(found).max())
    left = [np.abs(rows[1500:, 1]).max() for rows in (without, with_feedback)]
    assert left[1] < 0.1 * left[0], "the tip comes to rest although the model is 20 % off in the end-effector's mass"
    assert abs(with_feedback[-1, 0] - without[-1, 0]) < 1e-3, "the base arrives where it was to arrive"


def test_gains_make_the_loop_stable_and_optimal():
    blocks, names, _ = frozen_system(ARM, 3, "base_acceleration", OUTPUTS)
    regulator, observer = CONTROLLER.gains(*of_blocks(blocks, 1e-3), names)
    A, B = sampled_matrices(blocks, 1e-3)
    C = np.hstack([blocks.on_position, blocks.on_rate])
    assert np.abs(np.linalg.eigvals(A - B @ regulator[None])).max() < 1.0
    assert np.abs(np.linalg.eigvals(A - A @ observer @ C[:2])).max() < 1.0
    weight = C.T @ np.diag([0.0, 0.0, 1e6, 1e5]) @ C

    def cost(gain: np.ndarray) -> float:
        x, total = np.ones(len(A)) * 1e-3, 0.0
        for _ in range(40_000):
            u = -gain @ x
            total += x @ weight @ x + u * u
            x = A @ x + B[:, 0] * u
        return total

    best = cost(regulator)
    for change in (0.97, 1.03):
        assert cost(regulator * change) > best


@cache
def of_a_model():
    """The arm as a model with parameters, gains for ARM."""
    controller = replace(CONTROLLER, system=ARM, noise=[1e-5, 1e-3])
    with patch.object(user_model, "model_checks", lambda written, values: ()):
        return model_library(ARM.model, "axis", outputs=OUTPUTS, controller=controller)


@pytest.mark.parametrize("language", ["c", "rust", "javascript"])
def test_a_model_has_regulator_and_observer(language, tmp_path):
    """At the values of the gains and beside them, as in matrices of the state space."""
    kit.needs(language)
    assert len(of_a_model().checks) == 19
    kit.passes(of_a_model(), language, tmp_path)
    if language == "rust" and shutil.which("cargo-clippy"):
        kit.run(["cargo", "clippy", "--offline", "--quiet", "--tests", "--", "-D", "warnings"], tmp_path)


def test_the_error_of_the_observer_of_a_model_decays_as_designed():
    """From a wrong estimate, under any input: by the power of A (1 - K C), of state space and Riccati equation."""
    names = executed(of_a_model())
    parameters = names["Parameters"](*(float(ARM.values[symbol.name]) for symbol in ARM.model.symbols))
    plant = names["plant_of"](parameters, 3, names["modes_of"](parameters, 3), float(ARM.zeta))
    sampled, true, estimate = names["discretise"](plant, 1e-3), names["rest"](), names["rest"]()
    true.position[:3], true.rate[2] = [0.01, 1e-3, -1e-3], 0.05
    error = np.array([*true.position, *true.rate])
    for k in range(400):
        u = [np.sin(0.02 * k)]
        y = names["outputs"](plant, true, u)
        names["correct"](plant, [y[0], y[1]], u, estimate)
        for state in (true, estimate):
            names["step"](plant, sampled, u, state)
    held = cra.state_space(ARM, 3, "base_acceleration", OUTPUTS).discrete(1e-3)
    observer = replace(CONTROLLER, noise=[1e-5, 1e-3]).gains(held.A, held.B, held.C, held.D, OUTPUTS)[1]
    expected = np.linalg.matrix_power(held.A - held.A @ observer @ held.C[:2], 400) @ error
    found = np.array([*true.position, *true.rate]) - [*estimate.position, *estimate.rate]
    np.testing.assert_allclose(found, expected, atol=1e-10)  # of states of up to 20, in 400 steps
    plant.modes = 2
    with pytest.raises(ValueError, match="plant: must have as many modes"):
        names["correct"](plant, [0.0, 0.0], [0.0], estimate)


def test_a_model_needs_values_for_its_gains(tmp_path):
    for given, message in (
        ({"controller": CONTROLLER}, "controller: must have system="),
        ({"controller": replace(CONTROLLER, system=systems.system("string"))}, "must be one of the model"),
        (
            {"controller": replace(CONTROLLER, system=ARM), "input": ["drive_force", "v"]},
            "must have one input, it has 2",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            cra.export("c", tmp_path / "out", model=ARM.model, outputs=OUTPUTS, **given)
    assert not list(tmp_path.iterdir())


def test_what_is_refused(tmp_path):
    def export(**changes):
        controller = replace(CONTROLLER, **{k: v for k, v in changes.items() if k in CONTROLLER.__dict__})
        given = {"system": ARM, "outputs": OUTPUTS} | {k: v for k, v in changes.items() if k not in CONTROLLER.__dict__}
        cra.export("c", tmp_path / "out", controller=controller, **given)

    with pytest.raises(ValueError, match=r"time = 0\.0: must be in"):
        export(time=0.0)
    with pytest.raises(ValueError, match="noise: must have 2 numbers"):
        export(noise=[1.0])
    with pytest.raises(ValueError, match=r"noise = nan: must be in \(0, inf\)"):
        export(noise=[1.0, float("nan")])
    with pytest.raises(ValueError, match="measured: 'z' is not one of the outputs w, root_moment"):
        export(measured=["w", "z"])
    with pytest.raises(ValueError, match="measured: these outputs do not see every mode and the base"):
        export(measured=["v", "root_moment"])
    with pytest.raises(ValueError, match="weights: these outputs do not see every mode and the base"):
        export(weights={"v": 1.0})
    with pytest.raises(ValueError, match="give system="):
        cra.export("c", tmp_path / "out", controller=CONTROLLER)
    with pytest.raises(TypeError, match="controller"):
        cra.export("c", tmp_path / "out", system=ARM, controller=3)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_operations_are_counted():
    text = (
        "COUNT = 3\n\n\ndef twice(x: float) -> float:\n    return x + x\n\n\n"
        "def f(a: float, n: int, row: Mut[Row[float, COUNT]]) -> None:\n"
        "    for i in range(COUNT):\n        row[i] += a * twice(row[i])\n"  # 3 (1 + 1 + 1)
        "    if a > 0.0:\n        row[0] = sqrt(a) / 2.0\n    else:\n        row[0] = 0.0\n"  # 1 + 2
        "    for i in range(1, n):\n        row[0] = -row[0] - 1.0\n"  # at most 4 times 1
    )
    assert operations(parse(text), "f", {"n": 5}) == 9 + 3 + 4
    with pytest.raises(ValueError, match="n has no known end"):
        operations(parse(text), "f", {})
