"""The exact gradient of the residual vibration, against Richardson's extrapolated differences and its limits."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.symbols import L, t, v, x
from tests.systems import system

rhoA, EI, k = sp.symbols("rhoA EI k")

LIMITS = {"distance": 0.2, "v_max": 1.0, "a_max": 2.0, "j_max": 40.0}
MOVE = cra.BaseMotion.s_curve(**LIMITS, duration=1.234)
ARM = cra.Arm.nominal().replace(L=0.8, k_t=2e3, k_r=60.0, m_e=0.05, J_e=1e-3)
NAMES = ("k_t", "k_r", "c_t", "c_r", "m_e", "J_e", "duration")


def residual(arm, name, value, **options):
    if name == "duration":
        return cra.residual_vibration(arm, cra.BaseMotion.s_curve(**LIMITS, duration=value), **options)
    if name in ("c_t", "c_r"):
        name, value = f"k_{name[2]}", 1 / value
    return cra.residual_vibration(arm.replace(**{name: value}), MOVE, **options)


def slope(arm, name, at, step, **options):
    """Central differences with three steps, extrapolated twice: an error of order step^6."""
    step = step * at / 2.0 ** np.arange(3)
    rows = (residual(arm, name, at + step, **options) - residual(arm, name, at - step, **options)) / (2 * step)
    for order in (4, 16):
        rows = (order * rows[1:] - rows[:-1]) / (order - 1)
    return rows[0]


@pytest.mark.parametrize("zeta", [0.0, 0.005, 0.3])
def test_the_gradient_is_the_slope(zeta):
    arm = ARM.replace(zeta=zeta)
    value, gradient = cra.residual_vibration_gradient(arm, MOVE, NAMES)
    assert value == cra.residual_vibration(arm, MOVE)
    at = {"k_t": 2e3, "k_r": 60.0, "c_t": 1 / 2e3, "c_r": 1 / 60.0, "m_e": 0.05, "J_e": 1e-3, "duration": 1.234}
    expected = [slope(arm, name, at[name], 1e-4 if name == "duration" else 2e-3) for name in NAMES]
    np.testing.assert_allclose(gradient, expected, rtol=2e-8)


def test_a_mode_alone_with_its_own_damping_and_a_record_that_ends_moving():
    t = np.linspace(0.0, 1.0, 21)
    motion = cra.BaseMotion.sampled(t, np.sin(3 * t), exact=True) + 0.5 * MOVE
    options = {"modes": 2, "zeta": [0.02, 0.05]}
    _, gradient = cra.residual_vibration_gradient(ARM, motion, ("k_r",), **options)
    step = 60e-3 / 2.0 ** np.arange(2)
    up, down = (cra.residual_vibration(ARM.replace(k_r=60.0 + sign * step), motion, **options) for sign in (1, -1))
    rows = (up - down) / (2 * step)
    assert gradient[0] == pytest.approx((4 * rows[1] - rows[0]) / 3, rel=1e-8)


@pytest.mark.parametrize("name", ["t", "r"])
def test_a_rigid_joint_has_a_slope_by_the_compliance_only(name):
    """One-sided differences from the rigid joint on, extrapolated."""
    rigid = ARM.replace(**{f"k_{name}": np.inf})
    value, (by_stiffness, by_compliance) = cra.residual_vibration_gradient(rigid, MOVE, (f"k_{name}", f"c_{name}"))
    assert by_stiffness == 0
    step = {"t": 1e-7, "r": 1e-5}[name] / 2.0 ** np.arange(4)
    rows = (residual(rigid, f"c_{name}", step) - value) / step
    for order in (2, 4, 8):
        rows = (order * rows[1:] - rows[:-1]) / (order - 1)
    assert by_compliance == pytest.approx(rows[0], rel=1e-6)


def test_an_absent_spring_leaves_the_slopes_by_the_others():
    pinned = ARM.replace(k_r=0.0)
    _, gradient = cra.residual_vibration_gradient(pinned, MOVE, ("k_r", "c_r", "k_t", "duration"))
    assert np.isnan(gradient[:2]).all()
    assert gradient[2] == pytest.approx(slope(pinned, "k_t", 2e3, 2e-3), rel=1e-7)
    assert gradient[3] == pytest.approx(slope(pinned, "duration", 1.234, 1e-4), rel=1e-6)
    floating = ARM.replace(k_t=0.0)
    _, gradient = cra.residual_vibration_gradient(floating, MOVE, ("k_t", "duration"))
    assert np.isnan(gradient[0]) and abs(gradient[1]) < 1e-12  # the base moves nothing


def test_a_batch_has_the_gradients_of_its_arms():
    masses, by = [0.05, 0.1, 0.2], ("m_e", "c_r", "duration")
    value, gradient = cra.residual_vibration_gradient(ARM.replace(k_t=np.array([[2e3], [5e3]]), m_e=masses), MOVE, by)
    assert value.shape == (2, 3) and gradient.shape == (2, 3, 3)
    _, alone = cra.residual_vibration_gradient(ARM.replace(k_t=5e3, m_e=0.1), MOVE, by)
    np.testing.assert_allclose(gradient[1, 1], alone, rtol=1e-9)


def test_a_stretched_strike_stays_a_strike():
    """A base that starts at once has no duration to stretch."""
    _, gradient = cra.residual_vibration_gradient(ARM, cra.BaseMotion(velocity=0.1), ("k_t", "duration"))
    assert np.isfinite(gradient[0]) and not np.isfinite(gradient[1])


def test_unknown_names_are_named():
    for by in ("k_t", ("k_t", "A"), (3,), 5):
        with pytest.raises((TypeError, ValueError), match=r"must be (a sequence of names )?among L, b"):
            cra.residual_vibration_gradient(ARM, MOVE, by)


PULSE = cra.Force.sampled(np.linspace(0.0, 0.35, 36), 3.0 * np.sin(np.linspace(0.0, np.pi, 36)))
BOTH = {"w": cra.BaseMotion.trapezoid(0.1, 0.4, 2.0), "p": PULSE}


@pytest.mark.parametrize("zeta", [0.0, 0.02])
def test_forces_inside_the_span_and_a_move_leave_what_the_response_shows(zeta):
    """The peak of each mode after both have ended, from the response on a fine grid of times."""
    given = system("beam with an interior mass", zeta)
    stop = max(0.35, BOTH["w"].duration)
    t = stop + np.linspace(0.0, 0.8, 40001)
    cumulative = [cra.tip_response(given, BOTH, t, modes) for modes in (1, 2, 3)]
    peaks = [np.abs(v).max() for v in np.diff([np.zeros_like(t), *cumulative], axis=0)]
    for modes in (1, 2, 3):
        assert cra.residual_vibration(given, BOTH, modes) == pytest.approx(sum(peaks[:modes]), rel=1e-5)


def test_the_gradient_by_any_parameter_with_forces():
    """Against differences of fourth order of the residual vibration, by the place of the force too."""
    given = system("beam with an interior mass", 0.01)
    by = ("a", "m", "EI", "rhoA", "l", "k")
    value, gradient = cra.residual_vibration_gradient(given, BOTH, by, 3)
    assert value == pytest.approx(cra.residual_vibration(given, BOTH, 3), rel=1e-14)
    for name, found in zip(by, gradient, strict=True):
        step = 1e-3 * given.values[name]
        values = given.values[name] + step * np.array([-2, -1, 1, 2])
        around = [cra.residual_vibration(given.replace(**{name: one}), BOTH, 3) for one in values]
        # a step of a thousandth, of which the fourth power is left out, times what the phase turns meanwhile
        assert found == pytest.approx(np.dot(around, [1, -8, 8, -1]) / (12 * step), rel=1e-6), name
    with pytest.raises(ValueError, match=r"by = 'duration': must be among EI, a"):
        cra.residual_vibration_gradient(given, BOTH, ("duration",), 3)


def test_a_moving_support_and_other_displacements():
    """The slope of the sum over modes; the base of the spring moves, and what counts is an angle or a coordinate."""
    w = sp.Function("w")(t)
    beam = cra.Model(
        rhoA * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2, fields=[v], x=x, domain=(0, L), t=t, prescribed=[w],
        left=-k * (v - w) ** 2 / 2 - k * v.diff(x) ** 2 / 2,
    ).at({"rhoA": 0.3, "EI": 5.0, "L": 1.2, "k": 800.0})  # fmt: skip
    timoshenko = system("Timoshenko beam")
    angle = timoshenko.model.equations.fields[1]
    for given, options in ((beam, {}), (timoshenko, {"field": angle})):
        names = [name for name in ("k", "EI", "rhoA") if name in given.values]
        value, gradient = cra.residual_vibration_gradient(given, MOVE, names, 2, **options)
        assert value == cra.residual_vibration(given, MOVE, 2, **options)
        for name, found in zip(names, gradient, strict=True):
            steps = given.values[name] * (1 + 1e-5 * np.array([-1.0, 1.0]))
            before, after = cra.residual_vibration(given.replace(**{name: steps}), MOVE, 2, **options)
            assert found == pytest.approx((after - before) / np.ptp(steps), rel=1e-5), name
    _, (longer,) = cra.residual_vibration_gradient(beam, MOVE, ("duration",), 2)
    moves = cra.BaseMotion.s_curve(**LIMITS, duration=np.array([1.2339, 1.2341]))
    before, after = cra.residual_vibration(beam, moves, 2)  # of a batch, each after its own stop
    assert longer == pytest.approx((after - before) / 2e-4, rel=1e-4)


@pytest.mark.parametrize(("name", "of"), [("gantry", "q"), ("shaft", "u"), ("Timoshenko beam", "phi")])
def test_another_displacement_is_that_of_the_response(name, of):
    given = system(name)
    pulse = cra.Force.sampled([0, 0.1, 0.2], [0, 2.0, 0], exact=True)
    inputs = {"w": MOVE} | ({} if name == "Timoshenko beam" else {"p": pulse})
    form = given.model.state_form
    (field,) = [one for one in (*form.displacements, *form.coordinates) if one.func.__name__ == of]
    after = np.linspace(1.234, 3.0, 6001)
    peak = np.abs(cra.tip_response(given, inputs, after, modes=1, field=field)).max()
    assert cra.residual_vibration(given, inputs, 1, field=field) == pytest.approx(peak, rel=1e-5)
    with pytest.raises(ValueError, match=r"field = .*: must be one of"):
        cra.residual_vibration(given, inputs, 1, field=sp.Function("none")(t))


def test_all_modes_of_two_masses():
    """As many modes as there are coordinates, differentiated; beside central differences of the amplitude."""
    k, c = sp.symbols("k c")
    p, q, w = (sp.Function(name)(t) for name in "pqw")
    masses = cra.Model(
        0, fields=(), coordinates=[p, q], prescribed=[w], x=x, domain=(0, 1), t=t,
        left=(p + w).diff(t) ** 2 / 2 + (q + w).diff(t) ** 2 / 4 - k * p**2 / 2 - c * (q - p) ** 2 / 2,
    ).at({k: 40.0, c: 30.0})  # fmt: skip
    motion = cra.BaseMotion.trapezoid(distance=0.3, v_max=0.5, a_max=2.0)
    value, gradient = cra.residual_vibration_gradient(masses, motion, ["k", "c"], modes=2, field=q)
    pairs = [
        [cra.residual_vibration(masses.replace(**{name: at + h}), motion, modes=2, field=q) for h in (-1e-3, 1e-3)]
        for name, at in masses.values.items()
    ]
    slopes = dict(zip(masses.values, np.diff(pairs)[:, 0] / 2e-3, strict=True))
    np.testing.assert_allclose(gradient, [slopes["k"], slopes["c"]], rtol=1e-4)  # peaks are found to 1e-9 of 0.25
    assert value == cra.residual_vibration(masses, motion, modes=2, field=q)
    rate = cra.sensitivities(masses, 2, ["k"]).participation("k")
    moved = [cra.modal_parameters(masses.replace(k=40.0 + h), 2).participation for h in (-1e-3, 1e-3)]
    np.testing.assert_allclose(rate, np.subtract(*moved[::-1]) / 2e-3, rtol=1e-6)


def test_a_mode_in_tune_with_the_move_counts_as_zero():
    """Its rounding error had a slope of the size of the others, of either sign; a difference is symmetric about it."""
    arm = cra.Arm.nominal().replace(k_t=1e3, k_r=50.0)
    period = 1 / cra.natural_frequencies(arm, 1)[0]
    move = cra.BaseMotion.trapezoid(0.1, 0.1 / period, 0.3 / period**2)  # brakes three periods after the start
    alone, slope = cra.residual_vibration_gradient(arm, move, ("k_r", "m_e"), modes=1)
    assert alone < 1e-14 and (slope == 0.0).all()
    value, gradient = cra.residual_vibration_gradient(arm, move, ("k_r", "m_e"), modes=3)
    for name, found in zip(("k_r", "m_e"), gradient, strict=True):
        size = getattr(arm, name)
        step = 1e-6 * size
        beside = [cra.residual_vibration(arm.replace(**{name: size + s * step}), move, modes=3) for s in (-1, 1)]
        assert found == pytest.approx((beside[1] - beside[0]) / (2 * step), rel=1e-4)
    assert value > 1e-6


def test_what_drifts_away_has_no_gradient():
    """A force that leaves a free beam with a velocity: its value is inf, and a slope of the elastic modes was given."""
    force = sp.Function("F")(t)
    beam = cra.Model(
        v.diff(t) ** 2 / 2 - 2 * v.diff(x, 2) ** 2, fields=[v], x=x, domain=(0, L), t=t, right=force * v
    ).at({L: 1.0})  # fmt: skip
    value, gradient = cra.residual_vibration_gradient(beam, {force: cra.Force.sampled([0.0, 0.1, 0.2], [0.0, 1.0, 0.0],
                                                                                     exact=True)}, ("L",))  # fmt: skip
    assert np.isinf(value) and np.isnan(gradient).all()
