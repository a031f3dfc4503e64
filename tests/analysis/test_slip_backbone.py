"""Frequency and damping over amplitude with elastic-slip elements: closed forms, integration by events, resonances."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.analysis.slip_states import elements_of
from cra_sym.solvers.slip_modes import MotionsAtAmplitude
from cra_sym.symbols import L, t, v, x
from tests.nonlinear_models import oscillator, q
from tests.slip_reference import Structure, integrated

F = sp.Function("F")(t)
k, alpha = sp.symbols("k alpha")
JENKINS = cra.Jenkins(0.5, 0.2)
FREE = q.diff(t) ** 2 / 2 - k * q**2 / 2


def mass(element, lagrangian=FREE, zeta=0.0, **values):
    return oscillator(lagrangian, hysteresis=[(element, q, None)]).at({"k": 1.0, **values}, zeta=zeta)


@pytest.mark.parametrize("element", [JENKINS, cra.Iwan(0.5, 0.2, -0.4, 0.3, number=24)], ids=["jenkins", "iwan"])
def test_one_mass_in_one_harmonic_is_the_closed_form(element):
    amplitudes = np.geomspace(0.02, 30.0, 50)
    curve = cra.backbone(mass(element), amplitude=amplitudes, modes=1, harmonics=1)
    each = cra.Jenkins(*(element.elements(24) if isinstance(element, cra.Iwan) else element.elements()))
    stiffness = each.equivalent_stiffness(amplitudes[:, None]).sum(axis=1)
    loss = each.loss(amplitudes[:, None]).sum(axis=1)
    np.testing.assert_allclose(curve.angular_frequency**2, 1.0 + stiffness, rtol=1e-10)
    np.testing.assert_allclose(curve.damping_ratio, loss / (2 * np.pi * (1 + stiffness) * amplitudes**2), atol=1e-12)
    np.testing.assert_allclose(curve.loss, loss, rtol=1e-9, atol=1e-12)
    assert curve.stable.all()


def test_stuck_it_is_the_linear_mode():
    system = mass(JENKINS, zeta=0.03)
    curve = cra.backbone(system, amplitude=[0.1, 0.39], modes=1)
    np.testing.assert_allclose(curve.angular_frequency, np.sqrt(1.5), rtol=1e-12)
    np.testing.assert_allclose(curve.damping_ratio, 0.03 / np.sqrt(1.5), rtol=1e-12)  # 2 zeta omega of the free mass
    np.testing.assert_allclose(curve.energy, 0.5 * 1.5 * np.array([0.1, 0.39]) ** 2, rtol=1e-10)
    assert curve.error_harmonics.max() < 1e-12


def two_masses(zeta):
    one, two = sp.Function("q_1")(t), sp.Function("q_2")(t)
    lagrangian = (one.diff(t) ** 2 + 2 * two.diff(t) ** 2 - one**2 - 3 * (two - one) ** 2) / 2
    elements = [(cra.Jenkins(2.0, 0.3), two, None)]
    model = cra.Model(
        0, fields=(), coordinates=[one, two], x=x, domain=(0, 1), t=t, left=lagrangian, hysteresis=elements
    )
    return model.at({}, zeta=zeta), two


@pytest.mark.parametrize("mode", [1, 2])
def test_motions_close_under_integration_with_the_negative_damping(mode):
    zeta = 0.004
    system, second = two_masses(zeta)
    curve = cra.backbone(system, mode, amplitude=[0.2, 0.4, 1.0], modes=2, field=second)
    masses, stiffness = np.diag([1.0, 2.0]), np.array([[4.0, -3.0], [-3.0, 3.0]])
    squares, shapes = np.linalg.eigh(np.linalg.inv(np.sqrt(masses)) @ stiffness @ np.linalg.inv(np.sqrt(masses)))
    shapes = np.linalg.inv(np.sqrt(masses)) @ shapes
    shapes = shapes * np.sign(shapes[1])
    own = masses @ shapes @ np.diag(2 * zeta * np.sqrt(squares)) @ shapes.T @ masses
    known = system.without_hysteresis.modes(2)
    signs = np.sign(np.stack([known.coordinate(0), known.coordinate(1)])[1])
    for omega, ratio, coefficients, amplitude in zip(
        curve.angular_frequency, curve.damping_ratio, curve.coefficients, (0.2, 0.4, 1.0), strict=True
    ):
        order = np.arange(coefficients.shape[1] // 2 + 1)
        cosines, sines = np.split(coefficients * signs[:, None], [order.size], axis=1)
        start = np.concatenate([shapes @ cosines.sum(axis=1), omega * shapes @ (sines * order[1:]).sum(axis=1)])
        damping = own - 2 * ratio * omega * masses
        referee = Structure(masses, damping, stiffness, np.array([0.0, 1.0]), 2.0, 0.3, np.zeros(2), float(omega))
        phase = 2 * np.pi * np.linspace(0, 2, 8001)[:, None]
        along = shapes[1] @ (cosines @ np.cos(phase * order).T + sines @ np.sin(phase * order[1:]).T)
        slider = 0.0
        for u in along:
            slider = min(max(slider, u - 0.15), u + 0.15)
        end, _, largest = referee.run(start, slider, 0.0, 2 * np.pi / omega)
        # negative damping multiplies what is wrong at the start by up to nine in a period
        np.testing.assert_allclose(end, start, atol=1e-4 * amplitude)
        np.testing.assert_allclose(largest, amplitude, rtol=1e-4)
    assert (curve.damping_ratio > 0).all() and (np.diff(curve.angular_frequency) < 0).all()
    assert (curve.error_harmonics < 1e-6).all() and (curve.error_modes < 1e-12).all() and curve.stable.all()


def test_polynomial_terms_and_friction_together():
    system = mass(JENKINS, FREE - alpha * q**4 / 4, alpha=0.8)
    amplitudes = np.array([1.0, 3.0])
    curve = cra.backbone(system, amplitude=amplitudes, modes=1, harmonics=31)
    for omega, ratio, coefficients, amplitude in zip(
        curve.angular_frequency, curve.damping_ratio, curve.coefficients, amplitudes, strict=True
    ):
        order = np.arange(32)
        start = coefficients[0, :32].sum(), omega * (order[1:] * coefficients[0, 32:]).sum()

        def acceleration(_, place, speed, pull=2 * ratio * omega):
            return pull * speed - place - 0.8 * place**3

        phase = 2 * np.pi * np.linspace(0, 2, 8001)[:, None]
        places, slider = np.cos(phase * order) @ coefficients[0, :32], 0.0
        for u in places + np.sin(phase * order[1:]) @ coefficients[0, 32:]:
            slider = min(max(slider, u - 0.4), u + 0.4)
        end, _, largest = integrated(acceleration, 0.5, 0.2, np.array(start), slider, 2 * np.pi / omega)
        np.testing.assert_allclose(end, start, atol=2e-5 * amplitude)
        np.testing.assert_allclose(largest, amplitude, rtol=1e-5)
    duffing = cra.backbone(oscillator(FREE - alpha * q**4 / 4).at({"k": 1.0, "alpha": 0.8}), amplitude=30.0, modes=1)
    far = cra.backbone(system, amplitude=30.0, modes=1, harmonics=9)
    np.testing.assert_allclose(far.angular_frequency, duffing.angular_frequency, rtol=1e-3)  # friction is little there
    assert duffing.damping_ratio == 0 and duffing.loss == 0


def test_both_ways_of_a_step_are_one(monkeypatch):
    """Modes eliminated, as linear ones are, and all modes unknown, as with polynomial terms."""
    system = two_masses(0.002)[0]
    options = {"amplitude": [0.3, 0.8], "modes": 2, "harmonics": 7}
    eliminated = cra.backbone(system, 1, **options)
    monkeypatch.setattr(MotionsAtAmplitude, "_linear", False)
    whole = cra.backbone(system, 1, **options)
    for name in ("angular_frequency", "damping_ratio", "loss", "coefficients"):
        np.testing.assert_allclose(getattr(whole, name), getattr(eliminated, name), rtol=1e-8, atol=1e-10)


def test_beam_on_a_slipping_joint_resonates_where_its_damped_mode_says():
    """The peak under a harmonic force at the tip, at its amplitude, lies within 0.3 per cent."""
    beam = cra.Model(
        v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2, fields=[v], x=x, domain=(0, L), t=t, left=-20 * v**2 / 2,
        essential=[v.diff(x).subs(x, 0)], virtual_work=[(F, v, "right")],
        hysteresis=[(cra.Jenkins(60.0, 0.5), v, "left")],
    ).at({"L": 1.0})  # fmt: skip
    middle = 3.125
    for reach, number in ((0.225, 10), (0.04, 5)):
        frequencies = middle + np.linspace(-reach, reach, number)
        states = cra.steady_states(beam, frequencies, drive={F: 0.12}, modes=3, harmonics=15)
        sizes = np.array([answers[0].amplitude for answers in states])
        top = int(np.argmax(sizes))
        middle = frequencies[top]
    bend = np.polyfit(frequencies[top - 1 : top + 2], sizes[top - 1 : top + 2], 2)
    resonance = -bend[1] / (2 * bend[0])
    curve = cra.backbone(beam, amplitude=float(np.polyval(bend, resonance)), modes=3)
    np.testing.assert_allclose(curve.angular_frequency, resonance, rtol=3e-3)
    assert 0.001 < curve.damping_ratio < 0.2 and curve.error_modes < 1e-4


def test_stiff_joint_is_answered_with_fewer_harmonics_and_says_so():
    """One mode closes upon itself; three meet each other, and the motion keeps the harmonics that converge."""
    system, amplitude = cra.BoltedJoint().on(cra.Arm.nominal().replace(zeta=0.005), 1.0), 0.03
    one = cra.backbone(system, amplitude=amplitude, modes=1, harmonics=31)
    elements = elements_of(system, 1)
    (spring,), (slip,) = elements.groups[0]
    omega, ratio = float(system.without_hysteresis.natural_frequencies(1)[0]), float(one.damping_ratio)
    frequency, order = float(one.angular_frequency), np.arange(32)
    cosines, sines = one.coefficients[0, :32], one.coefficients[0, 32:]
    referee = Structure.one_mass(omega, 0.005, spring, slip, 0.0, frequency)
    referee.damping = referee.damping - 2 * ratio * frequency
    referee.row = elements.rows[0]
    phase, slider = 2 * np.pi * np.linspace(0, 2, 8001)[:, None], 0.0
    for q_ in np.cos(phase * order) @ cosines + np.sin(phase * order[1:]) @ sines:
        u = q_ * elements.rows[0, 0]
        slider = min(max(slider, u - slip / spring), u + slip / spring)
    start = np.array([cosines.sum(), frequency * (order[1:] * sines).sum()])
    end, _, _ = referee.run(start, slider, 0.0, 2 * np.pi / frequency)
    np.testing.assert_allclose(end, start, atol=1e-3 * abs(start[0]))  # corners of the force, 31 harmonics
    with pytest.warns(cra.ConvergenceWarning, match="more harmonics do not converge"):
        three = cra.backbone(system, amplitude=amplitude, modes=3)
    assert 0 < three.error_harmonics < 0.05
    np.testing.assert_allclose(three.angular_frequency, frequency, rtol=three.error_harmonics + 0.01)  # of the mode
    np.testing.assert_allclose(three.damping_ratio, ratio, atol=three.error_harmonics)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"energy": 1.0}, "energy = 1.0: must be None and amplitude given"),
        ({}, "energy = None: must be None and amplitude given"),
        ({"amplitude": -1.0}, "amplitude = -1.0: must be"),
        ({"amplitude": 1.0, "harmonics": 0}, "harmonics = 0"),
        ({"amplitude": 1.0, "mode": 2}, "mode = 2"),
    ],
)
def test_bad_arguments_are_refused_by_name(options, words):
    with pytest.raises((TypeError, ValueError), match=words):
        cra.backbone(mass(JENKINS), modes=1, **options)
