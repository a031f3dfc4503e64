"""Models stepped by exported code: any input and output, each language, beside responses in closed form."""

from __future__ import annotations

import re
import shutil
import sys
from dataclasses import replace
from functools import cache
from itertools import islice
from unittest.mock import patch

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.codegen import arm_library, model_checks, user_model
from cra_sym.codegen.user_model import model_library
from cra_sym.symbols import L, t, v, x
from tests import exported_models
from tests.codegen import kit
from tests.codegen.test_user_model import executed

EI, rhoA, m_e, m_b, k_t, k_r = (exported_models.__dict__[name] for name in "EI rhoA m_e m_b k_t k_r".split())
F, w = sp.Function("F")(t), exported_models.w
PUSHED = cra.Model(
    exported_models.BENT, fields=[v], prescribed=[w], x=x, domain=(0, L), t=t,
    left=exported_models.ROOT + m_b * w.diff(t) ** 2 / 2, right=m_e * (v + w).diff(t) ** 2 / 2 + F * (v + w),
)  # fmt: skip
VALUES = {"EI": 1.2, "L": 0.8, "k_r": 30.0, "k_t": 2e3, "m_b": 0.7, "m_e": 0.05, "rhoA": 0.4}
FREE = ["drive_force", v.subs(x, L / 3)], ["w", "y", "tip_acceleration", "root_force", ("v", 0.05), "tip_velocity"]
HELD = ["base_acceleration", "F"], ["w", "y", "tip_acceleration", "root_moment", EI * v.diff(x, 2).subs(x, L / 2)]


CONTROLLER = cra.Controller(1e-3, measured=["w"], noise=[1e-5], disturbance=1.0, weights={"y": 1.0})


@cache
def library(inputs: str, real: str = "float64"):
    """Return one with reference vectors in time alone."""

    def checks(written, values):
        for point in islice(model_checks._around(written, values), 2, None, 2):
            system = PUSHED.at(dict(zip(written.names, point, strict=True)))
            yield from model_checks.in_time_checks(written, system, point, model_checks.ERRORS[real])

    drive, outputs = {"free": FREE, "held": HELD}[inputs]
    with patch.object(user_model, "model_checks", checks):
        return model_library(PUSHED, "span", real, 5, drive, outputs)


@cache
def python(inputs: str) -> dict:
    return executed(library(inputs))


@pytest.mark.parametrize("inputs", ["free", "held"])
@pytest.mark.parametrize("language", ["python", "c", "fortran", "rust", "javascript", "octave"])
def test_self_test_passes(language, inputs, tmp_path):
    kit.needs(language)
    made = library(inputs)
    assert sum(not check.refused for check in made.checks) > 10
    kit.passes(replace(made, checks=made.checks[::20]) if language == "octave" else made, language, tmp_path)
    if language == "c":
        sources = ["self_test.c", "span.c", "-lm"]
        if shutil.which("clang"):
            strict = "-std=c99 -pedantic -Wall -Wextra -Wconversion -Wdouble-promotion -Wshadow -Werror".split()
            kit.run(["clang", *strict, "-ffp-contract=off", *sources, "-o", "other"], tmp_path)
            assert " 0 failures" in kit.run(["./other", "reference.txt"], tmp_path)
        if inputs == "free":
            assert " 0 failures" in kit.run(["make", "sanitize"], tmp_path)
        if shutil.which("valgrind"):
            few = (tmp_path / "reference.txt").read_text().splitlines()[::9]
            (tmp_path / "few.txt").write_text("\n".join(few) + "\n")
            kit.run(["valgrind", "-q", "--error-exitcode=9", "./self_test", "few.txt"], tmp_path)
    if language == "rust" and shutil.which("cargo-clippy"):
        kit.run(["cargo", "clippy", "--offline", "--quiet", "--tests", "--", "-D", "warnings"], tmp_path)


@pytest.mark.parametrize("inputs", ["free", "held"])
def test_single_precision(inputs, tmp_path):
    kit.needs("c")
    kit.passes(library(inputs, "float32"), "c", tmp_path)


@pytest.mark.parametrize("language", ["c", "rust", "javascript"])
def test_the_arm_takes_any_input_and_output(language, tmp_path):
    """A force on the base and one at mid-span; forces of both ends, strain, acceleration: in all random arms."""
    kit.needs(language)
    outputs = ["w", "tip_acceleration", "root_force", "tip_force", "tip_moment", ("strain", 0.1), v.subs(x, L / 3)]
    with patch.object(arm_library, "arm_checks", lambda everything: ()):
        made = arm_library.arm_library("crane", "float64", 5, ["drive_force", v.subs(x, L / 2)], outputs)
    assert sum(check.quantity == 27 for check in made.checks) > 20
    kit.passes(made, language, tmp_path)
    if language == "rust" and shutil.which("cargo-clippy"):
        kit.run(["cargo", "clippy", "--offline", "--quiet", "--tests", "--", "-D", "warnings"], tmp_path)


@pytest.mark.parametrize("model", [PUSHED, None])
def test_places_in_metres_are_those_of_the_user(model, tmp_path):
    """Reference vectors are of structures long enough; a shorter one is refused by the code."""
    outputs = ["w", ("v", 7.0)] if model is None else ["w", ("v", 7.0), v.subs(x, 9)]
    cra.export("python", tmp_path / "out", model=model, name="far", input="base_acceleration", outputs=outputs)
    kit.run([sys.executable, "self_test.py"], tmp_path / "out")
    if model:
        lines = [line.split() for line in (tmp_path / "out" / "reference.txt").read_text().splitlines()]
        assert {line[1] for line in lines if line[0] == "9"} == {"0", "1"}


@pytest.mark.parametrize("inputs", ["free", "held"])
def test_the_stack_is_what_the_readme_says(inputs, tmp_path):
    """20 kB, with what functions called have, and that of `discretise` where all modes are coupled."""
    kit.needs("c")
    texts = library(inputs).texts("c")
    kit.write(texts, tmp_path)
    kit.run(["gcc", "-std=c99", "-O2", "-fstack-usage", "-c", "span.c"], tmp_path)
    rows = [line.split() for line in (tmp_path / "span.su").read_text().splitlines()]
    used = {row[0].split(":")[-1]: int(row[1]) for row in rows}
    assert "the stack is at most 20 kB" in texts["README.md"]
    of_step = used.pop("span_discretise")
    assert sum(sorted(used.values())[-3:]) < 20e3
    said = re.search(r"`discretise` takes (\d+) kB", texts["README.md"])
    assert of_step < (1.1e3 * float(said[1]) if said else 1e3) and (said is not None) == (inputs == "free")


def test_steps_are_the_response_in_closed_form():
    """Steps under a force and an acceleration that are held, as Duhamel's integrals of constants."""
    names, system = python("held"), PUSHED.at(VALUES, zeta=0.03)
    parameters = names["Parameters"](**VALUES)
    plant = names["plant_of"](parameters, 5, names["modes_of"](parameters, 5), 0.03)
    sampled, state = names["discretise"](plant, 0.01), names["rest"]()
    seen = []
    for _ in range(60):
        state = names["step"](plant, sampled, [0.3, -2.0], state) or state
        seen.append(names["outputs"](plant, state, [0.3, -2.0]))
    times, seen = 0.01 * np.arange(1, 61), np.array(seen)
    histories = {"w": cra.BaseMotion(acceleration=0.3), "F": cra.Force(-2.0)}
    base = 0.15 * times**2
    tip = cra.response(system, histories, times, VALUES["L"], 5)
    moved = cra.response(system, histories, times, VALUES["L"], 5, derivative=2)
    assert np.abs(tip).max() > 0.1
    np.testing.assert_allclose(seen[:, 0], base, rtol=1e-13)
    np.testing.assert_allclose(seen[:, 1], base + tip, atol=1e-12 * np.abs(tip).max())  # the sums of five modes
    np.testing.assert_allclose(seen[:, 2], 0.3 + moved, atol=1e-11 * np.abs(moved).max())


def test_a_free_base_keeps_its_momentum():
    """Without damping: the momentum is the impulse of the force, and the energy the work done by it."""
    names = python("free")
    parameters = names["Parameters"](**VALUES)
    mode = names["modes_of"](parameters, 5)
    plant = names["plant_of"](parameters, 5, mode, 0.0)
    sampled, state, u = names["discretise"](plant, 0.02), names["rest"](), [1.5, 0.0]
    for _ in range(50):
        names["step"](plant, sampled, u, state)
    gamma = np.array([one.participation[0] for one in mode])
    whole = VALUES["m_b"] + VALUES["m_e"] + VALUES["rhoA"] * VALUES["L"]
    q, rate = np.array(state.position), np.array(state.rate)
    assert whole * rate[0] + gamma @ rate[1:6] == pytest.approx(1.5, rel=1e-12)
    kinetic = (whole * rate[0] ** 2 + 2 * rate[0] * (gamma @ rate[1:6]) + rate[1:6] @ rate[1:6]) / 2
    elastic = sum((one.omega * z) ** 2 for one, z in zip(mode, q[1:6], strict=True)) / 2
    assert kinetic + elastic == pytest.approx(1.5 * q[0], rel=1e-11)


def test_bad_input_is_refused():
    names = python("free")
    parameters = names["Parameters"](**VALUES)
    mode = names["modes_of"](parameters, 5)
    good = names["plant_of"](parameters, 5, mode, 0.0)
    for zeta in (-0.1, 1.0, float("nan")):
        with pytest.raises(ValueError, match="zeta: must be in"):
            names["plant_of"](parameters, 5, mode, zeta)
    with pytest.raises(ValueError, match="modes: must be 1 to"):
        names["plant_of"](parameters, 6, [*mode, mode[0]], 0.0)
    for time in (0.0, float("nan"), -1.0, 2e9):
        with pytest.raises(ValueError, match="time"):
            names["discretise"](good, time)


@pytest.mark.parametrize(
    "given, message",
    [
        ({"input": "torque"}, "input = 'torque': must be one of base_acceleration, drive_force"),
        ({"input": ["drive_force", "F"]}, "must be displacements"),
        ({"input": "drive_force", "modes": 65}, "modes = 65: must be at most 64 with 'drive_force'"),
        ({"outputs": ["z"]}, "outputs = 'z': must be one of"),
        ({"outputs": [("v", float("nan"))]}, "outputs: place"),
        ({"outputs": [("v", -0.1)]}, r"outputs: place = -0.1: must be real numbers in \[0, inf\)"),
        ({"outputs": [v.subs(x, -1)]}, "all places of inputs and outputs are in the domain"),
        ({"input": []}, r"input = \[\]: must have 1 to 1000 entries"),
        ({"modes": 0}, "modes = 0"),
        ({"model": None, "outputs": [v.diff(x, 4).subs(x, L)]}, "order 4 by x must be at most 3"),
        ({"model": None, "input": "F"}, "input = 'F': must be one of"),
        ({"model": None, "controller": CONTROLLER}, "controller: is that of a system or a model"),
    ],
)
def test_what_is_refused(given, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        cra.export("c", tmp_path / "out", **({"model": PUSHED} | given))
    assert not list(tmp_path.iterdir())


def test_a_model_without_inputs_is_not_stepped():
    span = cra.Model(
        rhoA * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2, fields=[v], x=x, domain=(0, L), t=t,
        essential=[v.subs(x, 0), v.subs(x, L)],
    )  # fmt: skip
    with patch.object(user_model, "model_checks", lambda written, values: ()):
        assert "def step" not in model_library(span, "span").text
        assert "def step" in model_library(span, "span", drive=v.subs(x, L / 2), outputs=["v"]).text
    with pytest.raises(ValueError, match="outputs: give input= too"):
        model_library(span, "span", outputs=["v"])
