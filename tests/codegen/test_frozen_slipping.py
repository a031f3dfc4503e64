"""Systems with elastic-slip elements frozen as numbers: stepped as the package integrates them, from event to event."""

from __future__ import annotations

import ctypes
import shutil
import zipfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.codegen.frozen import frozen_system, stepped
from cra_sym.codegen.frozen_slipping import slipping_library, slipping_numbers
from cra_sym.solvers.slip_statics import stuck_tangent
from cra_sym.symbols import t, v, x
from tests import slip_reference
from tests.codegen import kit

K_D, F_S = sp.symbols("k_d f_s")
ARM = cra.Arm.nominal().replace(k_t=1e3, k_r=50.0, zeta=0.005)
ONE = [(cra.Jenkins(K_D, F_S), v, "left")]
TWO = [*ONE, (cra.Jenkins(K_D / 100, F_S / 5), v.diff(x), "left")]
VALUES = {"k_d": 5e3, "f_s": 0.3}
OUTPUTS = ["v", "root_force", "root_moment"]
MAIN = """
#include "crane.h"
int run(double time, int count, const double *inputs, double *found)
{
    crane_sampled sampled;
    crane_state state = { { 0 } };
    int status = crane_discretise(time, &sampled);
    for (int n = 0; n < count && status == CRANE_OK; n++) {
        status = crane_step_between(&sampled, inputs[2 * n], inputs[2 * n + 1], &state);
        crane_outputs(&state, inputs[2 * n + 1], found);
        found += CRANE_SIGNALS;
        for (int e = 0; e < CRANE_ELEMENTS; e++) {
            *found++ = state.force[e];
            *found++ = state.dissipated[e];
        }
    }
    return status;
}
"""


@cache
def slipping(several: bool = False) -> cra.System:
    model = ARM.model.replace(hysteresis=TWO if several else ONE)
    return model.at({**ARM.values, **VALUES}, zeta=ARM.zeta)


@cache
def chain(hysteresis: bool = True) -> cra.System:
    """Two masses, the elements or springs in their place on the first and between both, and a damper that couples."""
    p, q, force = (sp.Function(name)(t) for name in ("p", "q", "force"))
    pairs = [(K_D, F_S, p), (K_D / 2, F_S / 3, q - p)]
    energy = p.diff(t) ** 2 / 2 + q.diff(t) ** 2 - p**2 - 3 * (p - q) ** 2 / 2
    parts = {"hysteresis": [(cra.Jenkins(k, f), u, None) for k, f, u in pairs]} if hysteresis else {}
    springs = 0 if hysteresis else sum(k * u**2 / 2 for k, _, u in pairs)
    drag = sp.Rational(1, 50)
    model = cra.Model(
        sp.S.Zero, fields=[], coordinates=[p, q], x=x, domain=(0, 1), t=t, left=energy - springs,
        virtual_work=[(force - drag * (q - p).diff(t), q, None), (drag * (q - p).diff(t), p, None)], **parts,
    )  # fmt: skip
    return model.at({"k_d": 2.0, **({"f_s": 0.3} if hysteresis else {})})


@cache
def library():
    return slipping_library(chain(), "crane", 2, "float64", "force", ["p", "q"])[0]


def compiled(folder: Path, system: cra.System, **options):
    """Return what steps a system in C: of inputs (steps, 2) to rows of outputs, and of (force, dissipated)."""
    if shutil.which("cc") is None:
        pytest.skip("needs gcc")
    cra.export("c", folder, system=system, name="crane", **options)
    header = (folder / "crane.h").read_text()
    (folder / "run.c").write_text(MAIN)
    kit.run("cc -std=c99 -O2 -Wall -Werror -shared -fPIC run.c crane.c -lm -o run.so".split(), folder)
    run = ctypes.CDLL(str(folder / "run.so")).run
    row = ctypes.POINTER(ctypes.c_double)
    run.argtypes = [ctypes.c_double, ctypes.c_int, row, row]
    signals, elements = (
        int(header.split(f"CRANE_{name}")[1].strip(" =(").split()[0].rstrip(",);")) for name in ("SIGNALS", "ELEMENTS")
    )

    def step(time, inputs):
        inputs = np.ascontiguousarray(inputs, dtype=float)
        found = np.zeros((len(inputs), signals + 2 * elements))
        assert run(time, len(inputs), inputs.ctypes.data_as(row), found.ctypes.data_as(row)) == 0
        return found[:, :signals], found[:, signals::2], found[:, signals + 1 :: 2]

    return step


@pytest.fixture(scope="module", params=[False, True], ids=["one element", "two elements"])
def arm(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("c") / "out"
    return slipping(request.param), compiled(folder, slipping(request.param), modes=3, outputs=OUTPUTS)


def agree(found, expected, tolerance=1e-9):
    assert np.abs(found - expected).max() <= tolerance * np.abs(expected).max() > 0.0


def compare(system, step, motion, time, inputs):
    """Compare a motion in C with the package's, and return the latter."""
    times = time * np.arange(1, len(inputs) + 1)
    right = cra.slip_response(system, motion, times, modes=3)
    outputs, force, dissipated = step(time, inputs)
    agree(outputs[:, 0], right.tip)
    agree(force.T, right.force)
    agree(dissipated.T, right.dissipated)
    assert (np.diff(dissipated, axis=0) >= 0.0).all() and (dissipated[-1] > 0.0).all()
    assert (np.abs(force) <= system.slip_elements(3).slip).all()
    return right


def test_a_move_is_the_slip_response(arm):
    """A point-to-point move of trapezoidal velocity, whose acceleration is held: 0.5 m/s in 0.25 s at 2 m/s2."""
    times = 0.0125 * np.arange(120)
    held = np.where(times < 0.25, 2.0, np.where((times >= 0.5) & (times < 0.75), -2.0, 0.0))
    motion = cra.BaseMotion.trapezoid(0.25, 0.5, 2.0)
    right = compare(*arm, motion, 0.0125, np.column_stack([held, held]))
    assert motion.duration == 0.75 and len(right.events[()]) > 10


def test_a_harmonic_base_is_the_slip_response(arm):
    """Its samples, which the acceleration goes between straight, at less and more than the fastest mode's rate."""
    gaps = []
    for time in (0.02, 0.01, 0.005):
        record = 3.0 * np.sin(23.0 * time * np.arange(1 + round(1.0 / time)))
        motion = cra.BaseMotion.sampled(time * np.arange(len(record)), record, exact=True)
        compare(*arm, motion, time, np.column_stack([record[:-1], record[1:]]))
        outputs, _, _ = arm[1](time, np.column_stack([record[:-1], record[1:]]))
        whole = cra.BaseMotion(amplitude=-3.0 / 23.0**2, angular_frequency=23.0)
        right = cra.tip_response(arm[0], whole, time * np.arange(1, len(record)), modes=3, start="base")
        gaps.append(np.abs(outputs[:, 0] - right).max())
    assert gaps[0] / gaps[1] == pytest.approx(4, rel=0.2) and gaps[1] / gaps[2] == pytest.approx(4, rel=0.2)


def test_forces_of_ends_hold_their_elements(arm):
    """At rest, all stuck, under a constant acceleration: what holds arm and tip mass."""
    numbers = slipping_numbers(arm[0].replace(f_s=1e6), 12, "base_acceleration", OUTPUTS)
    rows, resistance = numbers.modes.rows[..., 0], stuck_tangent(numbers.modes)[..., 0]
    z = np.linalg.solve(np.diag(numbers.modes.omega[:, 0] ** 2) + rows.T @ resistance @ rows, numbers.drive)
    _, force, moment = numbers.on_position @ z + numbers.on_force @ (resistance @ rows @ z)
    mass, length = float(ARM.rhoA) * float(ARM.L), float(ARM.L)
    assert force == pytest.approx(-(mass + ARM.m_e), rel=1e-5)
    if len(rows) == 2:
        assert moment == pytest.approx(-(mass / 2 + ARM.m_e) * length, rel=1e-5)


@pytest.mark.parametrize("language", kit.COMMANDS)
def test_self_test_passes_and_bits_agree(language, tmp_path):
    """By the package's own integration; and every language computes what plain Python does, to the last bit."""
    kit.needs(language)
    made, points = library(), [(k, (0.4, u, 6.0), False) for k in (0, 1) for u in (0.5, 3.0)]
    bits = kit.reference(made, points, {0: 4, 1: 4})
    checks = (*made.checks[:: 8 if language == "octave" else 1], *bits)
    kit.passes(replace(made, checks=checks), language, tmp_path)


@pytest.mark.parametrize("language", ["c", "fortran", "rust"])
@pytest.mark.parametrize("kind", ["one element", "two elements", "an Iwan"])
def test_single_precision(kind, language, tmp_path):
    """Forces, energies and outputs after 24 steps with events, beside the package's own integration."""
    kit.needs(language)
    iwan = ARM.model.replace(hysteresis=[(cra.Iwan(K_D, F_S, number=8), v, "left")])
    system = {
        "one element": slipping(), "two elements": slipping(True),
        "an Iwan": iwan.at({**ARM.values, **VALUES}, zeta=ARM.zeta),
    }[kind]  # fmt: skip
    made, *_ = slipping_library(system, "crane", 4, "float32", "base_acceleration", OUTPUTS)
    kit.passes(made, language, tmp_path)
    if language == "rust" and shutil.which("cargo-clippy"):
        kit.run(["cargo", "clippy", "--offline", "--quiet", "--", "-D", "warnings"], tmp_path)


def test_stuck_it_is_the_linear_system_with_springs(tmp_path):
    """Below the slip force, where no mode is left out, by SciPy's matrix exponential of the other system."""
    step = compiled(tmp_path / "out", chain(), modes=2, input="force", outputs=["p", "q"])
    blocks, _, _ = frozen_system(chain(False), 2, "force", ["p", "q"])
    for time in (0.05, 0.9, 20.0):
        u = np.where(np.arange(40) % 3 == 0, 0.05, -0.025)
        outputs, force, dissipated = step(time, np.column_stack([u, u]))
        expected, _ = stepped(blocks, time, 0.05, 40)
        assert (np.abs(force) < [0.3, 0.1]).all() and not dissipated.any()
        agree(outputs[-1], expected)


def test_one_mass_is_an_integration_with_events(tmp_path):
    """By DOP853 with events of SciPy, under a held force; a single step and many reach the same."""
    q, force = sp.Function("q")(t), sp.Function("force")(t)
    model = cra.Model(
        sp.S.Zero, fields=[], coordinates=[q], x=x, domain=(0, 1), t=t, left=q.diff(t) ** 2 / 2 - 2 * q**2,
        hysteresis=[(cra.Jenkins(K_D, F_S), q, None)], virtual_work=[(force, q, None)],
    )  # fmt: skip
    system = model.at({"k_d": 3.0, "f_s": 0.4}, zeta=0.01)
    state, slider, _ = slip_reference.integrated(
        lambda _, y, rate: 2.0 - 4 * y - 0.04 * rate, 3.0, 0.4, [0.0, 0.0], 0.0, 12.0
    )
    step = compiled(tmp_path / "out", system, modes=1, input="force", outputs={"q": q, "rate": q.diff(t)})
    for steps in (1, 7, 400):
        outputs, held, _ = step(12.0 / steps, np.full((steps, 2), 2.0))
        agree(outputs[-1], state, 1e-7)
        assert held[-1, 0] == pytest.approx(np.clip(3.0 * (state[0] - slider), -0.4, 0.4), rel=1e-6)


def test_too_many_events_leave_the_state(tmp_path):
    names: dict = {}
    exec(compile(library().texts("python")["crane.py"], "crane", "exec"), names)
    sampled, state = names["discretise"](3.0), names["rest"]()
    names["step"](sampled, 3.0, state)
    kept = {name: list(values) for name, values in vars(state).items()}
    names["MOST_PIECES"] = 2
    with pytest.raises(names["TooManyEvents"], match="shorter sampling time"):
        names["step"](sampled, -3.0, state)
    assert {name: list(values) for name, values in vars(state).items()} == kept
    with pytest.raises(ValueError, match="must be finite"):
        names["step_between"](sampled, 0.0, float("nan"), state)


@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_units_for_simulators_slip(version, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="needs FMPy")
    from fmpy.validation import validate_fmu

    if shutil.which("cc") is None:
        pytest.skip("needs a C compiler")
    cra.export("fmu", tmp_path / "out", system=slipping(), name="crane", version=version)
    unit = str(tmp_path / "out" / "crane.fmu")
    assert validate_fmu(unit) == [] and fmpy.read_model_description(unit).modelExchange is None
    found = fmpy.simulate_fmu(
        unit, start_values={"base_acceleration": 2.0}, stop_time=0.5, output_interval=0.01,
        output=["v", "element_force[1]", "element_dissipated[1]"],
    )  # fmt: skip
    right = cra.slip_response(slipping(), cra.BaseMotion(acceleration=2.0), found["time"], modes=3)
    agree(found["v"], right.tip)
    agree(found["element_force[1]"], right.force[0])
    agree(found["element_dissipated[1]"], right.dissipated[0])
    sources = tmp_path / "unit" / "sources"
    zipfile.ZipFile(unit).extractall(tmp_path / "unit")
    kit.run(f"cc -std=c99 -Wall -Wextra -Werror -shared -fPIC crane.c fmi{version[0]}.c -lm -o a.so".split(), sources)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"input": "drive_force"}, "a coordinate of the model"),
        ({"controller": cra.Controller(0.01, ["v"], [1e-3], 0.1, {"v": 1.0})}, "without_hysteresis"),
        ({"modes": 100}, "at most 64"),
        ({"outputs": ["v"] * 65}, "outputs"), ({"input": ["base_acceleration", v.subs(x, 1.0)]}, "must be one"),
    ],
)  # fmt: skip
def test_what_has_no_steps_is_refused(options, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        cra.export("c", tmp_path / "out", system=slipping(), **options)
    assert not list(tmp_path.iterdir())


def test_a_model_with_elements_has_no_frequencies_to_export(tmp_path):
    with pytest.raises(ValueError, match="give model"):
        cra.export("c", tmp_path / "out", model=slipping().model)


def test_the_force_of_a_mass_and_an_element_is_refused(tmp_path):
    tip = ARM.model.replace(hysteresis=[(cra.Jenkins(K_D, F_S), v, "right")]).at({**ARM.values, **VALUES})
    with pytest.raises(ValueError, match="tip_force is of an end with a mass"):
        cra.export("c", tmp_path / "out", system=tip, outputs=["tip_force"])
    assert "root_force" in slipping_numbers(tip, 2, "base_acceleration", None).names
