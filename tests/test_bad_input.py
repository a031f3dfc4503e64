"""Whatever is thrown at the public functions and the command line: documented errors only, and nothing is executed."""

import contextlib
import inspect
import os
import subprocess
import sys
import warnings
from functools import cache

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym import symbols as s
from cra_sym.__main__ import COMMANDS, main
from cra_sym.mechanics import multiple_scales, ritz
from tests.campaigns import attacks

TRAP = "CRA_SYM_TRAP"
ATTACKS = (
    f"__import__('os').environ.__setitem__('{TRAP}', 'sprung')",
    f"exec(\"import os; os.environ['{TRAP}'] = 'sprung'\")",
    f"lambda: __import__('os').putenv('{TRAP}', '1')",
    "$(touch sprung)",
    "`touch sprung`",
    "; touch sprung",
    "{0.__class__.__mro__}",
    "%s%n",
    "../../sprung",
    "\0",
    "λ\u202e\ud800",
)
NUMBERS = (0.0, -0.0, -1.0, 1.0, 1e300, -1e300, 1e-300, 5e-324, np.nan, np.inf, -np.inf, 2**70, 10**400, 1 + 2j)
SHAPES = ((), [], [[]], [1.0, 2.0], [[1.0], [2.0]], [1.0, [2.0]], np.ones((0, 3)), np.zeros((2, 1, 2)))
OBJECTS = (None, True, "1", b"1", {}, {"k_t": 1}, object(), int, len, np.array(["a"]), np.datetime64("now"), ...)


class Hostile:
    """An object that refuses to be an array in its own way."""

    def __array__(self, *_, **__):
        raise RuntimeError("not me")


STRANGERS = (
    np.ma.masked_array([1.0, 2.0], mask=[False, True]),
    np.longdouble("1e400"),
    np.array([None, 1.0]),
    np.array([1.0, 2.0, 3.0]),
    Hostile(),
    10**9,
    "x" * 10**5,
)
ANYTHING = (*ATTACKS, *NUMBERS, *SHAPES, *OBJECTS, *STRANGERS)

TENSION, MASS = sp.symbols("T mass")
WIRE = cra.Model(
    MASS * (s.v + s.w).diff(s.t) ** 2 / 2 - TENSION * s.v.diff(s.x) ** 2 / 2, fields=[s.v], prescribed=[s.w], x=s.x,
    domain=(0, s.L), t=s.t, left=-s.k_t * s.v**2 / 2, right=s.m_e * (s.v + s.w).diff(s.t) ** 2 / 2,
)  # fmt: skip
COLUMN = cra.Model(
    s.v.diff(s.t) ** 2 / 2 - s.v.diff(s.x, 2) ** 2 / 2 + sp.Symbol("P") * s.v.diff(s.x) ** 2 / 2, fields=[s.v], x=s.x,
    domain=(0, 1), t=s.t, essential=[s.v.subs(s.x, 0), s.v.diff(s.x).subs(s.x, 0)],
)  # fmt: skip
ARM = cra.Arm.nominal().replace(k_t=1e3, k_r=50.0, zeta=0.01)
SPRING = cra.JointStiffness(k_t=1.0)
MOTION = cra.BaseMotion(velocity=0.1)
OF_WIRE = {"T": 4.0, "L": 1.0, "mass": 1.0, "k_t": 1e3, "m_e": 0.1}
GOOD = {
    "System": dict(model=WIRE, values=OF_WIRE, zeta=0.01, tolerance=1e-8),
    "Arm": dict(L=1.0, b=0.03, h=0.003, E=7e10, rho=2700.0, m_b=5.0, m_e=0.1, J_e=0.0, k_t=1e3, k_r=1e2, zeta=0.0),
    "equation": dict(number=1),
    "equations": {},
    "natural_frequencies": dict(system=ARM, modes=2),
    "frequency_parameters": dict(kappa_t=1.0, kappa_r=2.0, mu=0.1, iota=0.0, modes=2),
    "mode_shapes": dict(system=ARM, x=0.5, modes=2, derivative=1),
    "modal_parameters": dict(system=ARM, modes=2),
    "eigenvalues": dict(system=ARM, modes=2, oscillating=True),
    "damping_ratios": dict(system=ARM, modes=2),
    "count_eigenvalues": dict(system=ARM, radius=40.0),
    "critical_value": dict(system=COLUMN.at({"P": 0.0}), parameter="P", between=(0.0, 5.0), modes=2, points=9),
    "BaseMotion": dict(velocity=0.1, acceleration=0.1, amplitude=1e-3, angular_frequency=10.0, phase=0.0),
    "Force": dict(level=1.0, amplitude=0.5, angular_frequency=10.0, phase=0.0),
    "response": dict(system=ARM, motion=MOTION, t=[0.0, 0.1], x=0.5, modes=2, derivative=0, zeta=0.01, start="base"),
    "tip_response": dict(system=ARM, motion=MOTION, t=0.1, modes=2, derivative=0, zeta=0.01, start="inertial"),
    "residual_vibration": dict(system=ARM, motion=cra.BaseMotion.trapezoid(0.1, 0.2, 1.0), modes=2, zeta=0.0),
    "residual_vibration_gradient": dict(
        system=ARM, motion=cra.BaseMotion.trapezoid(0.1, 0.2, 1.0), by=("k_r", "duration"), modes=2, zeta=0.0
    ),
    "state_space": dict(system=ARM, modes=2, input="base_acceleration", outputs=("v", "y")),
    "frequency_response": dict(system=ARM, angular_frequency=[5.0, 9.0], x=0.5, damping="structural"),
    "sensitivities": dict(system=ARM, modes=2, by=("k_t", "m_e")),
    "identify_joint": dict(system=ARM, measured_frequencies=[2.3, 14.0], uncertainty=0.01),
    "identify": dict(
        system=ARM,
        measured=cra.natural_frequencies(ARM, 2),
        uncertainty=0.01,
        unknown=("k_t",),
        modes=(1, 2),
        prior={"E": (6.9e10, 1e9)},
    ),
    "input_shaper": dict(angular_frequency=10.0, zeta=0.01, order=1),
    "certify": dict(system=ARM, modes=1),
    "certify_eigenvalues": dict(system=ARM, modes=1, oscillating=True),
    "certify_stability": dict(system=ARM, excitation=SPRING, angular_frequency=28.0, epsilon=0.05, modes=1),
    "AxialBase": dict(amplitude=0.01),
    "JointStiffness": dict(k_t=1.0, k_r=0.5),
    "Fluctuation": dict(weights={"k_t": 1.0}),
    "TransverseBase": dict(amplitude=0.01),
    "floquet_exponents": dict(system=ARM, excitation=SPRING, angular_frequency=28.0, epsilon=0.05, modes=2),
    "forced_width": dict(system=ARM, excitation=cra.TransverseBase(amplitude=0.01), modes=2),
    "growth_rate": dict(system=ARM, excitation=SPRING, angular_frequency=28.0, epsilon=0.05, modes=2),
    "stability_boundary": dict(
        system=ARM.replace(zeta=0.0), excitation=SPRING, epsilon=0.01, resonance=(1, 1), order=1, modes=2
    ),
    "nonlinear_modal_equations": dict(system=ARM, modes=2, zeta=0.01),
    "backbone": dict(system=ARM, mode=1, amplitude=1e-3, modes=2, harmonics=3, points=20, place=0.9),
    "response_curves": dict(
        system=ARM,
        between=(27.0, 29.0),
        excitation=SPRING,
        epsilon=0.05,
        drive={"w": 1e-4},
        modes=2,
        harmonics=2,
        period=1,
        zeta=0.01,
        points=50,
        place=0.9,
    ),
    "steady_states": dict(
        system=ARM,
        angular_frequency=[28.0],
        excitation=SPRING,
        epsilon=0.05,
        drive={"w": 1e-4},
        modes=2,
        harmonics=2,
        period=1,
        zeta=0.01,
        place=0.9,
    ),
    "slow_flow_values": dict(flow=ARM.model.slow_flow(("free", 1)), system=ARM),
    "sweep": dict(system=ARM, quantity="natural_frequencies", k_t=[1e3, 1e4]),
}
ELSEWHERE = {
    "paper_lagrangian", "ResponseCurve",  # take no values
    "AmbiguityWarning", "AsymptoticWarning", "MisfitWarning",  # nothing to call with values
    "ResonanceWarning", "UndersamplingWarning", "ConvergenceWarning", "Backbone", "SteadyState",  # likewise
    "Model", "Member", "joined", "kernel", "stations",  # take SymPy expressions: their own tests
    "export",  # writes a folder: below
    "explore",  # shows sliders: its own tests
    "BoltedJoint", "Iwan", "Jenkins", "SlipEvent", "SlipResponse", "identify_slip", "slip_response",  # of joints that
    "Controller", "basins",  # slip, of nonlinear systems: their own tests
}  # fmt: skip
PLACES = [(name, argument) for name, arguments in GOOD.items() for argument in arguments]


def call(name, **changes):
    return getattr(cra, name)(**{**GOOD[name], **changes})


def test_every_public_function_is_attacked():
    assert set(GOOD) | ELSEWHERE == set(cra._HOME)
    for name, arguments in GOOD.items():
        assert set(arguments) <= set(inspect.signature(getattr(cra, name)).parameters) | {"k_t"}, name


@pytest.mark.parametrize("name", GOOD)
def test_the_good_values_are_good(name):
    call(name)


@pytest.mark.parametrize("name", [name for name, arguments in GOOD.items() if "system" in arguments])
def test_what_is_good_for_an_arm_is_good_for_any_system(name):
    changes = {"by": ("k_t", "m_e")} if "by" in GOOD[name] else {}
    if GOOD[name].get("excitation") == SPRING:
        changes["excitation"] = cra.Fluctuation(k_t=1.0, T=0.5)
    if name == "sweep":
        assert call(name, system=WIRE.at(OF_WIRE)).sizes["k_t"] == 2
    elif name == "identify":
        measured = cra.natural_frequencies(WIRE.at({**OF_WIRE, "T": 5.0}), modes=2)
        fit = call(name, system=WIRE.at(OF_WIRE), measured=measured, unknown=("T",), prior={"mass": (1.0, 0.1)})
        np.testing.assert_allclose(fit.values["T"], 5.0, rtol=1e-6)
    elif name == "critical_value":
        with pytest.raises(ValueError, match="parameter = 'P': must be one of"):
            call(name, system=WIRE.at(OF_WIRE))
    elif name == "identify_joint":
        with pytest.raises(ValueError, match="k_r must be the stiffness of an end"):
            call(name, system=WIRE.at(OF_WIRE))
    else:
        call(name, system=WIRE.at(OF_WIRE, GOOD[name]["system"].zeta), **changes)


def refused_or_done(name, argument, value):
    """Call with one bad value; only documented errors and warnings may come out."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", UserWarning)  # ours derive from it, NumPy's RuntimeWarning does not
        try:
            return call(name, **{argument: value})
        except (TypeError, ValueError) as error:
            text = str(error)
            assert text and len(text) < 600, text
    return None


@pytest.mark.parametrize(("name", "argument"), PLACES, ids=lambda x: str(x))
def test_only_documented_errors(name, argument, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(TRAP, raising=False)
    for value in ANYTHING:
        result = refused_or_done(name, argument, value)
        assert result is None or not isinstance(value, str) or value == "1", value
    assert TRAP not in os.environ and not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("function", "argument", "value"),
    [("growth_rate", "angular_frequency", 1e-9), ("growth_rate", "epsilon", 1e20)],
)
def test_work_without_end_is_refused(function, argument, value):
    with pytest.raises(ValueError, match="steps, must be at most"):
        call(function, **{argument: value})


def test_times_without_a_phase_and_moves_without_an_end_are_refused():
    """They came back as nan, one in silence, the other with a warning of NumPy's."""
    with pytest.raises(ValueError, match=r"t\[1\] = 1e\+308: must be real numbers in \[0, 1e\+15\]"):
        call("tip_response", t=[0.1, 1e308])
    with pytest.raises(ValueError, match="the move never ends"):
        cra.BaseMotion.s_curve(0.1, 5e-324, 1.0, 5.0)


@pytest.mark.parametrize("text", [*ATTACKS[:-2], "1e999", "nan", "-inf", "", "0x10", "1_0", "\u0661"])
@pytest.mark.parametrize("option", ["--k-t", "--modes", "--L"])
def test_the_command_line_refuses_or_computes(option, text, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    try:
        code = main(["frequencies", f"{option}={text}"])
    except SystemExit as end:
        code = end.code
    out, err = capsys.readouterr()
    assert code in (0, 2) and (err.count("\n") == 1 and not out if code else out and not err)
    assert TRAP not in os.environ and not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", sorted(COMMANDS))
@pytest.mark.parametrize("attack", ATTACKS[:6])
def test_no_command_takes_a_stray_word(command, attack, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main([command, "--no-such-option", attack])
    assert end.value.code == 2 and capsys.readouterr().err.count("\n") == 1
    assert TRAP not in os.environ and not list(tmp_path.iterdir())


def test_an_export_to_an_odd_name_stays_where_it_was_sent(tmp_path):
    folder = tmp_path / "; touch sprung $(id) λ"
    cra.export("octave", folder)
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]


@pytest.mark.parametrize("language", [*ATTACKS[:8], None, 1, "C", ""])
def test_an_export_in_no_language_leaves_nothing(language, tmp_path):
    with pytest.raises((TypeError, ValueError)):
        cra.export(language, tmp_path / "out")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("attack", ATTACKS)
def test_no_text_becomes_an_expression(attack):
    """Texts where expressions belong are refused before anything reads them."""
    with pytest.raises((TypeError, ValueError)):
        cra.kernel(attack, ["x"])
    with pytest.raises((TypeError, ValueError)):
        cra.kernel("x", [attack])
    with pytest.raises((TypeError, ValueError)):
        cra.Model(attack, fields=[attack], x=attack, domain=(0, attack), t=attack)
    assert TRAP not in os.environ


X, T, LENGTH, RHO, PULL, K = sp.symbols("x t L rho T k")
Y, PUSH = sp.Function("y")(X, T), sp.Function("F")(T)
STRING = dict(
    density=RHO * Y.diff(T) ** 2 / 2 - PULL * Y.diff(X) ** 2 / 2,
    fields=[Y],
    x=X,
    domain=(0, LENGTH),
    t=T,
    right=PUSH * Y - K * Y**2 / 2,
    essential=[Y.subs(X, 0)],
    virtual_work=[(-K * Y.diff(T), Y, "right")],
)
OMEGA, P = sp.symbols("omega P", positive=True)
VALUES = dict(values={RHO: 1.0, PULL: 2.0, LENGTH: 1.0, K: 3.0}, modes=1)


@cache
def plain_string():
    return cra.Model(**{**STRING, "virtual_work": None})


SYMBOLIC = {
    "Model": (lambda **given: cra.Model(**given), {**STRING, "units": {K: "N/m"}}),
    "kernel": (cra.kernel, dict(expression={"u": [X, sp.Matrix([[X, T]])]}, arguments=[X, T], backend="numpy")),
    "separate": (
        lambda **given: plain_string().separate(**given),
        dict(parameters={K: 2 * PULL / LENGTH}, basis="hyperbolic", frequency=OMEGA),
    ),
    "ritz": (lambda problem, elements, **given: ritz(problem, elements=elements, **given), {"elements": 1}),
    "multiple_scales": (
        multiple_scales,
        dict(frequencies=[OMEGA], coupling=sp.Matrix([[P]]), resonance=(1, 1), damping=[P], cubic={1: P}, size=None),
    ),
    "response": (
        lambda **given: plain_string().response(**given),
        dict(**VALUES, motion={PUSH: cra.Force(1.0)}, t=0.1, x=0.5, initial={Y: X}, field=Y, start="base"),
    ),
    "mode_shapes": (lambda **given: plain_string().mode_shapes(**given), dict(**VALUES, x_values=[0.5], field=Y)),
    "frequency_response": (
        lambda **given: plain_string().frequency_response(**given),
        dict(values=VALUES["values"], angular_frequency=1.0, x_values=0.5, drive=Y.subs(X, LENGTH), field=Y),
    ),
}
SYMBOLIC["ritz"][1].update(problem=STRING["density"], **{name: STRING[name] for name in ("fields", "x", "domain", "t")})


def with_text_in_each_place(value, text):
    """Yield copies of a nested value, each with a text in the place of one thing, or of one key, in it."""
    yield text
    if isinstance(value, dict):
        for key, part in value.items():
            others = {k: v for k, v in value.items() if k is not key}
            yield from ({**others, key: changed} for changed in with_text_in_each_place(part, text))
            yield {**others, text: part}
    elif isinstance(value, list | tuple):
        for k, part in enumerate(value):
            for changed in with_text_in_each_place(part, text):
                yield type(value)([*value[:k], changed, *value[k + 1 :]])


@pytest.mark.parametrize("name", SYMBOLIC)
def test_no_text_is_parsed_wherever_it_is_put(name, monkeypatch):
    """SymPy's parser, which evaluates what it reads, is not reached from any place in any argument."""
    function, good = SYMBOLIC[name]
    function(**good)

    def parser(text, *_, **__):
        pytest.fail(f"{text!r} is parsed")

    monkeypatch.setattr("sympy.parsing.sympy_parser.parse_expr", parser)
    for argument, value in good.items():
        for changed in with_text_in_each_place(value, "sin(1)"):
            with contextlib.suppress(TypeError, ValueError):
                function(**{**good, argument: changed})


def test_a_store_in_an_odd_or_closed_place_changes_nothing(tmp_path):
    """A cache path with spaces and quotes, and one that is a file."""
    (tmp_path / "file").write_text("mine")
    code = "import cra_sym as cra; print(cra.frequency_parameters(1.0, 2.0, 0.1).tolist())"
    expected = str(cra.frequency_parameters(1.0, 2.0, 0.1).tolist())
    for place in (tmp_path / "a b'; touch sprung", tmp_path / "file"):
        environment = {**os.environ, "XDG_CACHE_HOME": str(place)}
        run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
        assert run.stdout.strip() == expected, run.stderr
    assert (tmp_path / "file").read_text() == "mine" and not (tmp_path / "sprung").exists()


@pytest.mark.parametrize("name", attacks.systems())
def test_a_sample_of_the_attacks_on_every_kind_of_system(name, monkeypatch, tmp_path):
    """``python -m tests.campaigns.attacks`` tries them all."""
    monkeypatch.chdir(tmp_path)  # a text is a path where a store is asked for
    every = [attack for attack in attacks.attacks() if attack[0] == name]
    for index in np.random.default_rng(17).choice(len(every), 200, replace=False):
        *place, value, inside = every[index]
        assert attacks.attacked(*place, value, inside=inside) is None, every[index]
