"""Vibration in time of any model: against d'Alembert, statics, the arm's own responses and the elements in time."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.signal import lsim

import cra_sym as cra
from cra_sym.model.modal_matrices import modal_matrices
from cra_sym.symbols import symbol

x, t = sp.symbols("x t")
L, EI, EA, rhoA, m_e, k_t, k_r, c, g = sp.symbols("L EI EA rhoA m_e k_t k_r c g")
v, w, F = sp.Function("v")(x, t), sp.Function("w")(t), sp.Function("F")(t)
HALF = sp.Rational(1, 2)
BEAM = HALF * rhoA * v.diff(t) ** 2 - HALF * EI * v.diff(x, 2) ** 2
VALUES = {EI: 4.6, rhoA: 0.24, L: 1.1, m_e: 0.05, k_t: 900.0, k_r: 40.0}
TIMES = np.linspace(0.0, 1.5, 301)


def rod(**options):
    density = HALF * rhoA * v.diff(t) ** 2 - HALF * EA * v.diff(x) ** 2
    return cra.Model(density, fields=[v], x=x, domain=(0, L), t=t, **options)


def arm(density=BEAM, **options):
    joint = -HALF * k_t * v**2 - HALF * k_r * v.diff(x) ** 2
    options = {"left": joint, "right": HALF * m_e * v.diff(t) ** 2, **options}
    return cra.Model(density, fields=[v], x=x, domain=(0, L), t=t, **options)


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_the_arm_is_an_instance_in_time_too(derivative):
    """Its own Lagrangian with the base prescribed, batch, joint rigid and free to slide, all kinds of motion."""
    own = cra.Arm.nominal().replace(k_t=[1e3, np.inf, 0.0], k_r=[1e2, np.inf, 50.0], J_e=1e-4)
    motion = cra.BaseMotion(velocity=0.1, acceleration=0.2, amplitude=1e-3, angular_frequency=10.0)
    motion = motion + cra.BaseMotion.trapezoid(0.3, 0.5, 1.0)
    options = {"derivative": derivative, "zeta": 0.01}
    found = own.model.response(own.values, {symbol("w"): motion}, TIMES, [0.0, 0.4, 1.0], **options)
    expected = cra.response(own, motion, TIMES, [0.0, 0.4, 1.0], **options)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-11 * np.abs(expected).max())


def test_plucked_string_is_dalemberts():
    """Let go from a smooth shape: two halves that travel and turn at the ends."""
    string = rod(essential=[v.subs(x, 0), v.subs(x, L)])
    values = {EA: 4.0, rhoA: 1.0, L: 1.0}
    shape = sp.sin(sp.pi * x / L) ** 3
    places = np.linspace(0.0, 1.0, 9)
    found = string.response(values, None, TIMES, places, modes=5, initial={v: shape})

    def odd(y):
        return np.sin(np.pi * y) ** 3

    expected = 0.5 * (odd(places[:, None] - 2.0 * TIMES) + odd(places[:, None] + 2.0 * TIMES))
    np.testing.assert_allclose(found, expected, atol=1e-12)
    speed = string.response(values, {}, TIMES, places, modes=5, derivative=1, initial={v.diff(t): shape})
    np.testing.assert_allclose(speed, expected, atol=1e-11)


def test_rod_under_a_sudden_pull():
    """Fixed-free rod, step force at the end: the tip climbs straight to twice its static stretch and back."""
    pulled = rod(essential=[v.subs(x, 0)], right=F * v)
    values = {EA: 2.0, rhoA: 0.5, L: 1.0}
    period = 4.0 / np.sqrt(2.0 / 0.5)
    static = 3.0 * 1.0 / 2.0
    modes = 60
    found = pulled.tip_response(values, {F: cra.Force(3.0)}, TIMES, modes=modes)
    expected = static * 2.0 * (1.0 - np.abs(1.0 - np.mod(2.0 * TIMES / period, 2.0)))
    tail = static * 8 / np.pi**2 * sum(1.0 / (2 * n + 1) ** 2 for n in range(modes, 100_000))
    assert np.abs(found - expected).max() < 2.1 * tail
    work = rod(essential=[v.subs(x, 0)], virtual_work=[(F, v, "right")])
    np.testing.assert_array_equal(work.tip_response(values, {F: cra.Force(3.0)}, TIMES, modes=modes), found)


def test_rod_under_its_weight_and_a_sampled_force():
    """Constant loads act from t = 0; a slow ramp leaves the static stretch."""
    hanging = rod(essential=[v.subs(x, 0)], right=F * v)
    density = HALF * rhoA * v.diff(t) ** 2 - HALF * EA * v.diff(x) ** 2 + rhoA * g * v
    heavy = cra.Model(density, fields=[v], x=x, domain=(0, L), t=t, essential=[v.subs(x, 0)])
    values = {EA: 200.0, rhoA: 0.5, L: 1.0}
    mean = heavy.tip_response({**values, g: 9.81}, None, np.linspace(0, 8, 4001), modes=40).mean()
    assert mean == pytest.approx(0.5 * 9.81 / (2 * 200.0), rel=1e-3)
    knots = np.array([0.0, 1000.0])
    ramp = cra.Force.sampled(knots, [0.0, 7.0], exact=True)
    found = hanging.tip_response(values, {F: ramp}, 1000.0 - 1e-9, modes=200, zeta=0.02)
    rest = 2 / (np.pi**2 * 200)  # of the sum of 8 / (pi (2 n - 1))^2 over the modes, from the 201st on
    assert found == pytest.approx(7.0 / 200.0 * (1 - rest), rel=1e-4)


def by_elements(free, values, push, times, elements=8):
    """The tip driven, on element matrices of the same Lagrangian, its force linear between many samples."""
    numbers = free.ritz(elements)
    ((_, stiffness, damping, mass),) = numbers._numbers(numbers._columns(values)[0])
    size = len(mass)
    inverse, none = np.linalg.inv(mass), np.zeros((size, size))
    system = np.block([[none, np.eye(size)], [-inverse @ stiffness, -inverse @ damping]])
    load = np.r_[np.zeros(size), inverse[:, size - 2]][:, None]
    ends = np.eye(2 * size)[[0, size - 2]]
    return lsim((system, load, ends, np.zeros((2, 1))), push(times), times)[1].T


@pytest.mark.parametrize("damper", [0.5, 20.0])
def test_a_damped_joint_against_elements_in_time(damper):
    """Dampers couple the modes, up to motions that do not oscillate: a harmonic tip force, elements by Radau."""
    model = arm(virtual_work=[(-c * v.diff(t), v, "left"), (F, v, "right")])
    values = {**VALUES, c: damper}
    times = np.linspace(0.0, 0.6, 1201)
    push = cra.Force(level=0.5, amplitude=1.0, angular_frequency=20.0, phase=0.3)
    found = model.response(values, {F: push}, times, [0.0, 1.1], modes=24)
    free = arm(virtual_work=[(-c * v.diff(t), v, "left")])
    reference = by_elements(free, values, push, times, elements=10)
    np.testing.assert_allclose(found, reference, atol=5e-4 * np.abs(found).max())


def test_kelvin_voigt_modes_stay_apart():
    """2 zeta omega = tau omega^2 mode by mode: the coupled exponentials give what modal damping ratios give."""
    tau = sp.Symbol("tau")
    clamped = {"left": None, "right": None, "essential": [v.subs(x, 0), v.diff(x).subs(x, 0)], "prescribed": [w]}
    moving = BEAM.subs(v.diff(t), v.diff(t) + w.diff(t))
    damped = arm(moving, virtual_work=[(-EI * tau * v.diff(x, 2, t), v.diff(x, 2), "domain")], **clamped)
    plain, values = arm(moving, **clamped), {EI: 4.6, rhoA: 0.24, L: 1.1}
    omega = 2 * np.pi * plain.natural_frequencies(values, modes=4)
    motion = cra.BaseMotion(velocity=0.1, amplitude=2e-3, angular_frequency=omega[0])
    motion = motion + cra.BaseMotion.sampled([0.2, 0.4, 0.6], [0.0, 2.0, 1.0], exact=True)
    for derivative in (0, 1, 2):
        options = {"modes": 4, "derivative": derivative, "initial": {v: x**2 / 100}}
        found = damped.tip_response({**values, tau: 1e-3}, {w: motion}, TIMES, **options)
        expected = plain.tip_response(values, {w: motion}, TIMES, zeta=1e-3 * omega / 2, **options)
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-9 * np.abs(expected).max())


def test_initial_state_of_fields_and_coordinates():
    """A free base is a coordinate: with all at the same speed nothing bends, and the frame carries the motion."""
    m_b = sp.Symbol("m_b")
    moving = BEAM.subs(v.diff(t), v.diff(t) + w.diff(t))
    tip = HALF * m_e * (v.diff(t) + w.diff(t)) ** 2
    free = arm(
        moving,
        left=HALF * m_b * w.diff(t) ** 2 - HALF * k_t * v**2 - HALF * k_r * v.diff(x) ** 2,
        right=tip,
        coordinates=[w],
    )
    values = {**VALUES, m_b: 2.0}
    found = free.response(values, None, TIMES, [0.0, 1.1], initial={w.diff(t): 0.3})
    assert np.abs(found).max() < 1e-10
    bent = free.response(values, None, TIMES, [0.0, 1.1], initial={v.diff(t): sp.Integer(1), w.diff(t): -1})
    assert np.abs(bent).max() > 1e-3


@pytest.mark.parametrize(
    ("motion", "options", "message"),
    [
        ({}, {}, "no history for F"),
        ({F: 3.0}, {}, "F = 3.0: must be a Force or a BaseMotion"),
        ({w: cra.Force(1.0), F: cra.Force(1.0)}, {}, "w does not drive the model; what drives it is F"),
        ({F: cra.BaseMotion(velocity=1.0)}, {}, "F drives the model by itself; give a Force"),
        ({F: cra.Force(1.0)}, {"zeta": 1.5}, "zeta"),
        ({F: cra.Force(1.0)}, {"zeta": [0.1, 0.2]}, "zeta has shape"),
        ({F: cra.Force(1.0)}, {"initial": {v.diff(x): x}}, "initial: Derivative.*must be one of v"),
        ({F: cra.Force(1.0)}, {"initial": {v: t}}, r"initial: v\(x, t\) = t"),
        ({F: cra.Force(1.0)}, {"x": 1.2}, "x = 1.2 must be in the domain"),
        ({F: cra.Force(1.0)}, {"derivative": 3}, "derivative"),
        ({F: cra.Force(1.0)}, {"start": "rest"}, "start"),
    ],
)
def test_what_is_refused(motion, options, message):
    model = arm(right=F * v + HALF * m_e * v.diff(t) ** 2)
    options = {"x": 1.0, **options}
    with pytest.raises((ValueError, TypeError), match=message):
        model.response(VALUES, motion, TIMES, **options)


def test_axes_follow_the_arguments():
    model = arm(virtual_work=[(F, v, "right")])
    push = {F: cra.Force(amplitude=1.0, angular_frequency=[3.0, 30.0])}
    values = {**VALUES, k_t: [[900.0], [9.0]]}
    assert model.response(values, push, TIMES, [0.0, 0.5, 1.0]).shape == (2, 2, 3, 301)
    assert model.response(VALUES, {F: cra.Force(1.0)}, TIMES, 0.5).shape == (301,)
    assert model.response(VALUES, {F: cra.Force(1.0)}, 0.3, [0.5]).shape == (1,)
    assert np.shape(model.tip_response(VALUES, {F: cra.Force(1.0)}, 0.3)) == ()


def test_loads_dampers_and_excitations_of_a_part_of_a_uniform_span():
    """Integrals along the span went across the ends of that part: percents of the force on a mode were wrong."""
    x, t, EI, m, a, c, k, epsilon, varpi = sp.symbols("x t EI m a c k epsilon varpi")
    v, F = sp.Function("v")(x, t), sp.Function("F")(t)
    part = sp.Piecewise((1, x < a), (0, True))
    pulsating = k * epsilon * sp.cos(varpi * t) * part * v**2 / 2
    model = cra.Model(
        m * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2 + F * part * v - pulsating, fields=[v], x=x, domain=(0, 1),
        t=t, essential=[v.subs(x, 0), v.subs(x, 1)], small=(epsilon, varpi),
        virtual_work=[(-c * part * v.diff(t), v, "domain")],
    )  # fmt: skip
    place = np.array([0.37, 0.5])
    system = model.at({EI: 1.0, m: 1.0, c: 0.7, k: 3.0, a: place})
    number = np.arange(1, 5)
    # sqrt(2) sin(n pi x), of which the sign is that of the modes
    sign = np.sign(cra.mode_shapes(system, 0.99, 4)[0] * np.sin(number * np.pi * 0.99))
    force = sign * np.sqrt(2) * (1 - np.cos(number * np.pi * place[:, None])) / (number * np.pi)
    np.testing.assert_allclose(system.project(system.numerics("load", "F"), 4), force, rtol=0, atol=1e-13)
    i, j, at = number[:, None], number, place[:, None, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        overlap = np.sin((i - j) * np.pi * at) / ((i - j) * np.pi) - np.sin((i + j) * np.pi * at) / ((i + j) * np.pi)
    overlap = np.where(i == j, at - np.sin(2 * i * np.pi * at) / (2 * i * np.pi), overlap) * np.outer(sign, sign)
    (drive,) = model.excitation.drives(system, 4)
    np.testing.assert_allclose(drive.stiffness, 3.0 * overlap, rtol=0, atol=1e-12)
    np.testing.assert_allclose(modal_matrices(system, 4).damping, 0.7 * overlap, rtol=0, atol=1e-12)
