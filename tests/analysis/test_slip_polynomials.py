"""Polynomial terms beside elastic-slip elements in time: integration with events, harmonic balance, limits."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.symbols import t, v, x
from tests.nonlinear_models import inextensible, oscillator, q
from tests.slip_reference import integrated

F = sp.Function("F")(t)
alpha, c_3, k_d, slip = sp.symbols("alpha c_3 k_d slip")
ZETA, LEVEL, VARPI = 0.15, 0.6, 1.3
LOAD = {F: cra.Force(amplitude=LEVEL, angular_frequency=VARPI, phase=np.pi / 2)}  # LEVEL cos(VARPI t)


@pytest.fixture(scope="module")
def mass():
    """A mass on a spring, a cubic one and a Jenkins element, with a cubic damper."""
    model = oscillator(
        q.diff(t) ** 2 / 2 - q**2 / 2 - alpha * q**4 / 4,
        virtual_work=[(F - c_3 * q.diff(t) ** 3, q, None)],
        hysteresis=[(cra.Jenkins(k_d, slip), q, None)],
    )
    return model.at({"alpha": [0.8, -0.05], "c_3": 0.1, "k_d": 0.5, "slip": 0.2}, zeta=ZETA)


def test_agrees_with_integration_with_events(mass):
    """DOP853 restarts at each event, which it locates; its tolerance of 1e-10 adds up over some hundred steps."""
    times = np.array([4.0, 9.0, 16.0])
    found = cra.slip_response(mass, LOAD, times, modes=1)
    assert (found.imbalance < 1e-13).all() and (found.dampers[:, -1] > 0).all()
    for member, one in enumerate(mass.parameter_sets):
        hardening = float(one.values["alpha"])

        def acceleration(time, place, speed, hardening=hardening):
            drag = 2 * ZETA * speed + 0.1 * speed**3
            return LEVEL * np.cos(VARPI * time) - drag - place - hardening * place**3

        for k, end in enumerate(times):
            state, _, _ = integrated(acceleration, 0.5, 0.2, np.zeros(2), 0.0, end)
            assert found.displacement[member, 0, k] == pytest.approx(state[0], rel=0, abs=1e-8)
        assert len(found.events[member]) > 5
    alone = cra.slip_response(mass.parameter_sets[1], LOAD, times, modes=1)
    np.testing.assert_allclose(alone.tip, found.tip[1], rtol=0, atol=1e-12)


def test_settles_on_the_answer_of_harmonic_balance(mass):
    one = mass.parameter_sets[0]
    (state,) = cra.steady_states(one, VARPI, drive={F: LEVEL}, modes=1, harmonics=31)
    period = 2 * np.pi / VARPI
    last = period * np.linspace(18.0, 19.0, 41)  # transients fall below exp(-0.15 * 87) = 2e-6, and friction helps
    found = cra.tip_response(one, LOAD, last, modes=1)
    order = np.arange(32)
    cosines, sines = np.split(state.coefficients[0], [32])
    phase = np.multiply.outer(VARPI * last, order)
    wanted = np.cos(phase) @ cosines + np.sin(phase[:, 1:]) @ sines
    # 31 harmonics leave out those of the corners of the force, of the order of 32^-4
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-5 * state.amplitude)


def test_stuck_for_ever_it_is_the_nonlinear_system_with_a_spring():
    """Two coordinates, elements at both that never slip: a spring of the Lagrangian takes their place."""
    one, two = sp.Function("q_1")(t), sp.Function("q_2")(t)
    beside = alpha * (two - one) ** 4 / 4 + alpha * one**3 / 3
    lagrangian = (one.diff(t) ** 2 + 2 * two.diff(t) ** 2 - one**2 - 3 * (two - one) ** 2) / 2 - beside
    elements = [(cra.Jenkins(0.7, slip), two, None), (cra.Jenkins(0.4, slip), one - two, None)]
    model = cra.Model(
        0, fields=(), coordinates=[one, two], x=x, domain=(0, 1), t=t, left=lagrangian, virtual_work=[(F, one, None)],
        hysteresis=elements,
    )  # fmt: skip
    springs = model.replace(left=lagrangian - 0.35 * two**2 - 0.2 * (one - two) ** 2, hysteresis=())
    times = np.linspace(0.0, 12.0, 25)
    right = cra.tip_response(springs.at({"alpha": 0.5}, zeta=0.0), LOAD, times, modes=2)
    stuck, free = (model.at({"alpha": 0.5, "slip": f}, zeta=0.0) for f in (1e9, 0.05))
    found = cra.tip_response(stuck, LOAD, times, modes=2)
    # the right one is integrated to a relative error of about 1e-9
    np.testing.assert_allclose(found, right, rtol=0, atol=1e-8 * np.abs(right).max())
    slid = cra.slip_response(free, LOAD, times, modes=2)
    assert slid.imbalance < 1e-13 and (slid.dissipated[:, -1] > 0).all()


def test_a_beam_with_a_cubic_spring_and_a_slipping_root():
    arm = cra.Arm.nominal().replace(k_t=1e3)
    cubic = arm.model.replace(
        right=arm.model.pieces["right"] - alpha * v**4 / 4, hysteresis=[(cra.Jenkins(5e3, slip), v, "left")]
    )
    system = cubic.at({**arm.values, "slip": 0.3, "alpha": [0.0, 3e4]})
    move, times = cra.BaseMotion.trapezoid(0.3, 0.5, 2.0), np.linspace(0.0, 0.8, 17)
    found = cra.slip_response(system, move, times, modes=2)
    assert (found.imbalance < 1e-12).all() and (found.dissipated[..., -1] > 0).all()
    linear = arm.model.replace(hysteresis=[(cra.Jenkins(5e3, 0.3), v, "left")]).at(arm.values)
    wanted = cra.tip_response(linear, move, times, modes=2)
    np.testing.assert_allclose(found.tip[0], wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    assert np.abs(found.tip[1] - wanted).max() > 0.01 * np.abs(wanted).max()
    with pytest.raises(ValueError, match="no bound of its residual vibration"):
        cra.residual_vibration(system, move)


def test_what_is_refused(mass):
    with pytest.raises(ValueError, match=r"the motion diverges at t = \d"):
        cra.slip_response(mass.parameter_sets[0].replace(alpha=-30.0, c_3=0.0), LOAD, [20.0], modes=1)
    long = inextensible()
    with pytest.raises(ValueError, match="its inertia must be linear beside elastic-slip elements"):
        element = (cra.Jenkins(1.0, 0.1), v, "right")
        cra.slip_response(long.model.replace(hysteresis=[element]).at(long.values), None, [1.0], modes=1)
    by_force = oscillator(
        q.diff(t) ** 2 / 2 - q**2 / 2, virtual_work=[(F * q**2, q, None)], hysteresis=[(cra.Jenkins(1.0, 0.1), q, None)]
    )
    with pytest.raises(ValueError, match="no motion or force may multiply its displacements"):
        cra.slip_response(by_force.at({}), LOAD, [1.0], modes=1)
