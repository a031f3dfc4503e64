"""Whatever the arm can do, any system can do: every public function that takes one, with ten other than an arm."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.analysis.eigenvalues import oscillating_frequencies
from cra_sym.figures.identification import figure_fit
from cra_sym.figures.subject import default_excitation, leading_parameter
from tests.systems import NAMES, TURNING, system

GRID = np.linspace(0.0, 0.3, 4)
MOVE = cra.BaseMotion.trapezoid(0.1, 0.2, 1.0)
PULSE = cra.Force.sampled([0.0, 0.1, 0.2], [0.0, 2.0, 0.0], exact=True)


def driven(given):
    """Return a history that ends for everything that drives a system."""
    return {name: MOVE if kind == "motion" else PULSE for name, kind in given.numerics("causes")}


def second(given):
    return oscillating_frequencies(given, 2)[-1]


def principal(given):
    return 2.01 * oscillating_frequencies(given, 1)[0]


def density(given):
    return "rho" if "rho" in given.values else "rhoA"


def measured(given):
    heavier = given.replace(**{density(given): 1.02 * given.values[density(given)]})
    return oscillating_frequencies(heavier, 1) / (2 * np.pi)


def fitted(given):
    """Return what is identified: the prior spares the search."""
    value = given.values[density(given)]
    return {
        "measured": measured(given), "uncertainty": 1e-4, "unknown": (density(given),),
        "prior": {density(given): (value, 0.1 * value)},
    }  # fmt: skip


#: What each function is called with beside the system.
CALLS = {
    "natural_frequencies": lambda s: {"modes": 4},
    "mode_shapes": lambda s: {"x": [0.0, 0.7, 1.2], "modes": 2, "derivative": 1},
    "modal_parameters": lambda s: {"modes": 3},
    "response": lambda s: {"motion": driven(s), "t": GRID, "x": [0.3, 1.2], "modes": 4, "derivative": 1},
    "tip_response": lambda s: {"motion": driven(s), "t": GRID, "modes": 4},
    "residual_vibration": lambda s: {"motion": driven(s), "modes": 3},
    "residual_vibration_gradient": lambda s: {
        "motion": driven(s), "by": (leading_parameter(s), list(s.values)[-1]), "modes": 2},
    "state_space": lambda s: {"modes": 3, "input": "w", "outputs": ["v", "y", ("v", 0.4), "tip_acceleration"]},
    "frequency_response": lambda s: {"angular_frequency": [0.7, 3.0], "x": [0.5, 1.2], "damping": "structural"},
    "sensitivities": lambda s: {"modes": 3},
    "identify": fitted,
    "certify": lambda s: {"modes": 2},
    "certify_eigenvalues": lambda s: {"modes": 2},
    "floquet_exponents": lambda s: {
        "excitation": default_excitation(s), "angular_frequency": principal(s), "epsilon": 0.2},
    "growth_rate": lambda s: {
        "excitation": default_excitation(s), "angular_frequency": principal(s), "epsilon": [0.1, 0.6]},
    "stability_boundary": lambda s: {"excitation": default_excitation(s), "epsilon": [1e-3], "order": 2, "modes": 1},
    "forced_width": lambda s: {"excitation": cra.TransverseBase(1e-3), "modes": 2},
    "eigenvalues": lambda s: {"modes": 2},
    "damping_ratios": lambda s: {"modes": 2},
    "count_eigenvalues": lambda s: {"radius": 0.6 * principal(s)},
    "critical_value": lambda s: {"parameter": density(s), "between": (s.values[density(s)], 2 * s.values[density(s)])},
    "certify_stability": lambda s: {
        "excitation": default_excitation(s), "angular_frequency": principal(s), "epsilon": [0.1, 0.6], "modes": 2},
    "backbone": lambda s: {"amplitude": [1e-3, 2e-3], "modes": 2, "harmonics": 3},
    "steady_states": lambda s: {
        "angular_frequency": [0.9 * second(s)], "drive": {"w": 1e-3}, "modes": 2, "harmonics": 2},
    "response_curves": lambda s: {
        "between": (0.9 * second(s), 0.95 * second(s)), "drive": {"w": 1e-3},
        "modes": 2, "harmonics": 2},
    "nonlinear_modal_equations": lambda s: {"modes": 2},
    "slow_flow_values": lambda s: {"flow": s.model.slow_flow(("free", 1))},
    "identify_joint": lambda s: {"measured_frequencies": oscillating_frequencies(s, 2) / 6, "uncertainty": 1e-3},
    "export": lambda s: {"language": "python", "modes": 2},
    "explore": lambda s: {},
    "identify_slip": lambda s: {
        "amplitude": [1e-3, 2e-3], "frequency": [1.0, 1.0], "damping_ratio": [0.01, 0.01], "uncertainty": (0.01, 0.01),
        "unknown": (density(s),)},
    "slip_response": lambda s: {"motion": driven(s), "t": GRID},
    "sweep": lambda s: {
        "quantity": "natural_frequencies", leading_parameter(s): s.values[leading_parameter(s)] * np.array([1, 1.1])},
}  # fmt: skip
VARIES = ("hanging beam", "beam with an interior mass")
REFUSED = {(of, "hanging beam"): "constant along x" for of in ("certify", "certify_eigenvalues")}
# more mass buckles nothing: where stability is lost is tested in tests/analysis/test_critical.py
REFUSED |= {("critical_value", name): "between: the system is stable at all" for name in (*NAMES, *TURNING, "the arm")}
# what slips: tests/analysis/test_slip_response.py
SLIPPING = ("slip_response", "identify_slip")
REFUSED |= {(of, name): "system: .*elastic-slip" for of in SLIPPING for name in (*NAMES, *TURNING, "the arm")}
# the case of the arm, its joint: of other systems 'identify'
REFUSED |= {("identify_joint", name): "system: k_t must be the stiffness of an end" for name in (*NAMES, *TURNING)}
# what is said of natural modes: 'eigenvalues' and the like tell of complex ones
NATURAL = ("natural_frequencies", "mode_shapes", "modal_parameters", "sweep")
REFUSED |= {(of, name): "no natural modes, .*system.conservative_part" for of in NATURAL for name in TURNING}
PIPE, SHAFT = TURNING
REFUSED |= {("backbone", PIPE): "forces that follow the motion are neither"}
# without dampers no ratio; the slow flow of a free mode has a decay alone; what leaves the pipe takes energy along
ZERO = {("damping_ratios", name) for name in (*NAMES, SHAFT)} | {("slow_flow_values", name) for name in NAMES}
ZERO |= {("growth_rate", PIPE), ("slow_flow_values", SHAFT)}
# and a shaft that is as stiff across as upright couples no mode with itself: zones that the message says are none
NO_ZONE = {("stability_boundary", PIPE): "below the threshold", ("stability_boundary", SHAFT): "does not couple"}


def numbers(result):
    """Return all arrays of a result."""
    if isinstance(result, (int, float, complex, np.ndarray, np.number)):
        array = np.asarray(result)
        return [np.where(array == "stable", 1.0, 2.0) if array.dtype.kind == "U" else array]
    if isinstance(result, Mapping) and not hasattr(result, "data_vars"):
        return [np.asarray(result[name], dtype=float) for name in sorted(result, key=str)]
    if hasattr(result, "sliders"):
        return [oscillating_frequencies(result.system, 3)]
    if hasattr(result, "digest"):
        lines = (result.directory / "reference.txt").read_text().splitlines()
        # of the steps, the last of the outputs: an arm names its position besides, and first
        return [np.array([list(map(float, line.split()[-4:])) for line in lines if line.startswith("0 0 ")])]
    if isinstance(result, (tuple, list)):
        return [array for part in result for array in numbers(part)]
    if hasattr(result, "data_vars"):
        return [variable.values for variable in result.data_vars.values()]
    kinds = (("A", "B", "C", "D"), ("rate", "log"), ("lower", "upper"), ("values",),
             ("omega", "participation", "left"), ("angular_frequency", "energy"), ("amplitude",), ("polynomials",),
             ("omega", "damping"))  # fmt: skip
    for names in kinds:
        if all(hasattr(result, name) for name in names):
            return [array for name in names for array in numbers(getattr(result, name))]
    raise AssertionError(type(result))


def call(function, given, folder, **changes):
    called = getattr(cra, function)
    (name,) = {"system", "arm"} & inspect.signature(called).parameters.keys()
    more = {"directory": folder / f"{len(list(folder.iterdir()))}"} if function == "export" else {}
    return called(**{name: given} | CALLS[function](given) | more | changes)


def test_every_function_that_takes_a_system_is_called():
    """None is left out: a new one fails here until it is called."""
    public = {name for name in cra._HOME if not isinstance(getattr(cra, name), type)}
    takes = {name for name in public if {"system", "arm"} & inspect.signature(getattr(cra, name)).parameters.keys()}
    assert takes == CALLS.keys()


@pytest.mark.parametrize("name", [*NAMES, *TURNING])
@pytest.mark.parametrize("function", CALLS)
def test_a_function_takes_any_system(function, name, tmp_path, monkeypatch):
    given = system(name)
    if name in VARIES:  # in a sum over 24 modes, each costs a tenth of a second
        monkeypatch.setattr("cra_sym.analysis.zones._SPECTATORS", 4)
    if (function, name) in REFUSED:
        with pytest.raises(ValueError, match=REFUSED[function, name]):
            call(function, given, tmp_path)
        return
    if (function, name) in NO_ZONE:
        with pytest.warns(cra.ResonanceWarning, match=NO_ZONE[function, name]):
            assert np.isnan(call(function, given, tmp_path)).all()
        return
    result = call(function, given, tmp_path)
    if function == "identify" and name == "string":  # the figure is the same of any fit
        residuals = figure_fit(result).axes[1].lines[-1].get_ydata()
        np.testing.assert_array_equal(residuals, result.residuals)
    found = numbers(result)
    assert found and all(array.size and np.isfinite(array).all() for array in found)
    # what is zero is so to rounding
    assert any(np.abs(array).max() > 1e-13 for array in found) == ((function, name) not in ZERO)


def frequencies_over(given, **options):
    parameter = density(given)
    values = given.values[parameter] * np.array([1.0, 1.1, 1.3])
    return cra.sweep(given, "natural_frequencies", **{parameter: values}, modes=2, **options).natural_frequencies


@pytest.mark.parametrize("name", ["string", "two planes", *VARIES])
def test_any_sweep_goes_past_memory_and_machine(name, tmp_path):
    pytest.importorskip("zarr")
    dask = pytest.importorskip("dask")
    whole = frequencies_over(system(name)).values
    with dask.config.set(scheduler="synchronous"):
        lazy = frequencies_over(system(name), chunks=2)
        assert lazy.chunks is not None
        np.testing.assert_array_equal(lazy.values, whole)
        np.testing.assert_array_equal(frequencies_over(system(name), store=tmp_path / "all.zarr").values, whole)


@pytest.mark.parametrize("name", ["string", "two planes", "gantry"])
@pytest.mark.parametrize("humps", [1, 3])
def test_extra_insensitive_shapers_keep_to_their_tolerance(name, humps):
    """At the frequency of the mode a hump is at its top, or the residual vanishes between two."""
    given = system(name)
    moves = {cause: one for cause, one in driven(given).items() if isinstance(one, cra.BaseMotion)}
    still = {cause: cra.Force(0.0) for cause in driven(given).keys() - moves}
    number = int(np.flatnonzero(given.natural_frequencies(3) > 0)[0]) + 1
    shaper = cra.input_shaper(given.natural_frequencies(3)[number - 1], humps=humps, tolerance=0.05)
    shaped = {cause: move.shaped(*shaper) for cause, move in moves.items()}
    before, after = (cra.residual_vibration(given, one | still, number) for one in (moves, shaped))
    assert after == pytest.approx(0.05 * before, rel=1e-6)


def test_a_fit_is_swept():
    given = system("tensioned beam")
    unknown, options = density(given), fitted(given)
    found = cra.sweep(given, "identified", l=given.values["l"] * np.array([1.0]), **options).identified
    assert found.values.ravel() == pytest.approx([1.02 * given.values[unknown]], rel=1e-5)


@pytest.mark.parametrize("name", ["string", "Timoshenko beam", "gantry", *VARIES])
def test_stability_with_a_mass_that_oscillates_is_proved(name):
    given = system(name)
    heavier = {"excitation": cra.Fluctuation({density(given): 1.0}), "angular_frequency": principal(given)}
    small, large = (cra.certify_stability(given, epsilon=size, modes=1, **heavier) for size in (1e-3, 0.3))
    assert small == "stable" and large == "unstable"  # beside the principal zone, and in it
    grown = [cra.growth_rate(given, epsilon=size, modes=1, **heavier) / principal(given) for size in (1e-3, 0.3)]
    assert grown[0] < 1e-6 < 1e-3 < grown[1]  # the rounding of multipliers on the unit circle is below 1e-8


def test_the_table_names_every_function_and_tests_that_exist():
    """Each row of the table of the README: functions, what they take, tests by name in files that call them."""
    root = Path(__file__).parents[1]
    part = (root / "README.md").read_text().split("## What any system can do")[1].split("\n## ")[0]
    rows = [line.strip("|").split(" | ") for line in part.splitlines() if line.startswith("| `")]
    named = []
    for first, _, last in rows:
        functions = re.findall(r"`(\w+)`", first.split(":")[0])
        named += [function for function in functions if hasattr(cra, function)]
        tests = re.findall(r"\[(test_\w+)\]\(([\w/.]+)\)", last)
        assert tests and len(tests) == last.count("]("), first
        texts = {file: (root / file).read_text() for _, file in tests}
        assert all(re.search(rf"^def {test}\(", texts[file], re.MULTILINE) for test, file in tests), first
        text = "".join(texts.values())
        assert all(re.search(rf"\b{function}\b", text) for function in functions), first
    assert CALLS.keys() - {"identify_joint"} <= set(named)
    assert len(named) == len(set(named))


L, b, h, E, rho, m_b, m_e, J_e, k_t, k_r, x, t = sp.symbols("L b h E rho m_b m_e J_e k_t k_r x t")
y, base = sp.Function("y")(x, t), sp.Function("w")(t)
BY_HAND = cra.Model(
    rho * b * h * (y + base).diff(t) ** 2 / 2 - E * b * h**3 / 12 * y.diff(x, 2) ** 2 / 2,
    fields=[y], prescribed=[base], x=x, domain=(0, L), t=t,
    left=m_b * base.diff(t) ** 2 / 2 - k_t * y**2 / 2 - k_r * y.diff(x) ** 2 / 2,
    right=m_e * (y + base).diff(t) ** 2 / 2 + J_e * y.diff(x).diff(t) ** 2 / 2,
)  # fmt: skip
ARM = cra.Arm.nominal().replace(L=1.2, k_t=1e3, k_r=50.0, m_e=0.05, J_e=1e-4)
WRITTEN = {"state_space": {"outputs": ["y", "tip_acceleration"]}}


@pytest.mark.parametrize("function", CALLS)
def test_the_arm_written_by_hand_gives_the_arms_numbers(function, tmp_path):
    known = {symbol.name for symbol in BY_HAND.symbols}
    hand = BY_HAND.at({name: value for name, value in ARM.values.items() if name in known}, ARM.zeta)
    options = CALLS[function](ARM)
    if (function, "the arm") in REFUSED:
        for one in (ARM, hand):
            with pytest.raises(ValueError, match=REFUSED[function, "the arm"]):
                call(function, one, tmp_path, **options)
        return
    if function == "state_space":
        options["outputs"] = ["tip_acceleration", "tip_velocity", "root_force"]
    if function == "residual_vibration_gradient":
        options["by"] = ("k_t", "k_r", "m_e", "J_e", "L", "E")
    if function == "sensitivities":
        options["by"] = sorted(known - {"m_b"})
    if function == "slow_flow_values":
        options = {}
    pairs = zip(*(numbers(call(function, one, tmp_path, **options)) for one in (ARM, hand)), strict=True)
    for of_arm, by_hand in pairs:
        np.testing.assert_allclose(by_hand, of_arm, rtol=0, atol=1e-12 * np.abs(of_arm).max())
