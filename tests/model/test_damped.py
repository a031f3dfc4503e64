"""Complex eigenvalues of damped models against closed forms and high precision, and against Ritz matrices."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from mpmath import mp, mpc, mpf

import cra_sym as cra
from tests.model.roots import distance

x, t = sp.symbols("x t")
L, EI, rhoA, m_e, k_t, k_r, c, tau = sp.symbols("L EI rhoA m_e k_t k_r c tau")
v = sp.Function("v")(x, t)
HALF = sp.Rational(1, 2)
BEAM = HALF * rhoA * v.diff(t) ** 2 - HALF * EI * v.diff(x, 2) ** 2
VALUES = {EI: 4.6, rhoA: 0.24, L: 1.1, m_e: 0.05, k_t: 900.0, k_r: 40.0}


def arm(density=BEAM, **options):
    joint = -HALF * k_t * v**2 - HALF * k_r * v.diff(x) ** 2
    options = {"left": joint, "right": HALF * m_e * v.diff(t) ** 2, **options}
    return cra.Model(density, fields=[v], x=x, domain=(0, L), t=t, **options)


@pytest.fixture(scope="module")
def damped_joint():
    return arm(virtual_work=[(-c * v.diff(t), v, "left")])


def joint_determinant(s, damper):
    """Four exponentials with EI r^4 = -rhoA s^2; the joint has the stiffness k_t + c s."""
    bending, mass, length = mpf(4.6), mpf(0.24), mpf(1.1)
    first = mp.sqrt(mp.sqrt(mpc(-mass * s**2 / bending)))
    matrix = mp.matrix(4)
    for column, r in enumerate((first, -first, 1j * first, -1j * first)):
        far = mp.exp(r * length)
        matrix[0, column] = bending * r**3 + 900 + damper * s
        matrix[1, column] = bending * r**2 - 40 * r
        matrix[2, column] = bending * r**2 * far
        matrix[3, column] = (bending * r**3 - mpf(0.05) * s**2) * far
    return mp.det(matrix)


@pytest.mark.parametrize("damper", [0.05, 2.0, 30.0, 1000.0])
def test_viscous_joint_damper(damped_joint, damper):
    found = damped_joint.eigenvalues({**VALUES, c: damper}, modes=4)
    assert found.shape == (4,) and (found.imag > 0).all() and (found.real < 0).all()
    with mp.workdps(40):
        for value in found:
            assert distance(lambda s: joint_determinant(s, damper), value, 12) < 1e-11
    second = damped_joint.ritz(elements=16).eigenvalues({**VALUES, c: damper}, 4)
    # cubic elements: h^4 |v_xxxx|^2 / (1440 |v_xx|^2) = h^4 rhoA |s|^2 / (1440 EI) at most; twice that for complex s
    assert (np.abs(second / found - 1) < 2 * np.abs(found) ** 2 * (0.24 * 1.1**4 / 4.6) / 16**4 / 1440 + 1e-10).all()


def test_damper_between_its_limits(damped_joint):
    """No damper: the elastic joint. An immense one: a joint that cannot move. Between them is a maximum."""
    dampers = np.logspace(-4, 6, 11)
    ratio = damped_joint.damping_ratios({**VALUES, c: dampers}, modes=2)
    assert ((ratio > 0) & (ratio < 1)).all()
    top = ratio.argmax(axis=0)
    assert ((top > 0) & (top < 10)).all()
    free, held = damped_joint.eigenvalues({**VALUES, c: [1e-9, 1e9]})
    np.testing.assert_allclose(free.imag / 2 / np.pi, arm().natural_frequencies(VALUES), rtol=1e-9)
    np.testing.assert_allclose(held.imag / 2 / np.pi, arm().natural_frequencies({**VALUES, k_t: np.inf}), rtol=1e-6)


def test_small_damping_is_the_power_the_damper_takes(damped_joint):
    """First order: 2 zeta omega = c phi(0)^2 with the mass-normalised undamped shape."""
    modes = damped_joint.modal_parameters(VALUES | {c: 0.0}, modes=4)
    ratio = damped_joint.damping_ratios({**VALUES, c: 1e-4}, modes=4)
    np.testing.assert_allclose(ratio, 1e-4 * modes.left[:, 0] ** 2 / (2 * modes.omega), rtol=1e-5)


def test_kelvin_voigt_beam():
    """All elastic forces have the same retardation time: s^2 + tau omega^2 s + omega^2 = 0 mode by mode."""
    clamped = {"left": None, "right": None, "essential": [v.subs(x, 0), v.diff(x).subs(x, 0)]}
    beam = arm(virtual_work=[(-EI * tau * v.diff(x, 2, t), v.diff(x, 2), "domain")], **clamped)
    values = {EI: 4.6, rhoA: 0.24, L: 1.1}
    omega = 2 * np.pi * arm(**clamped).natural_frequencies(values, modes=3)
    np.testing.assert_allclose(2 * np.pi * beam.natural_frequencies({**values, tau: 0.3}), omega, rtol=1e-12)
    for retardation in (1e-4, 4e-3):
        exact = -retardation * omega**2 / 2 + 1j * omega * np.sqrt(1 - (retardation * omega / 2) ** 2)
        np.testing.assert_allclose(beam.eigenvalues({**values, tau: retardation}), exact, rtol=1e-10)
        ratio = beam.damping_ratios({**values, tau: retardation})
        np.testing.assert_allclose(ratio, retardation * omega / 2, rtol=1e-10)


def test_strong_damping_leaves_no_oscillation(damped_joint):
    real = damped_joint.eigenvalues({**VALUES, c: 1000.0}, modes=3, oscillating=False)
    assert real[0].real == pytest.approx(-0.9, rel=0.2) and abs(real[0].imag) < 1e-12
    with pytest.raises(ValueError, match="oscillating motions"):
        arm(virtual_work=[(-EI * tau * v.diff(x, 2, t), v.diff(x, 2), "domain")]).eigenvalues({**VALUES, tau: 10.0})


def test_without_dampers_the_eigenvalues_are_the_frequencies():
    model = arm()
    expected = 2j * np.pi * model.natural_frequencies(VALUES)
    np.testing.assert_allclose(model.eigenvalues(VALUES), expected, rtol=4 * np.finfo(float).eps)  # 2 pi comes and goes
    np.testing.assert_array_equal(model.damping_ratios(VALUES), 0.0)


def test_follower_force_has_eigenvalues_but_no_natural_frequencies():
    """Beck's column: flutter at P L^2 / EI = 20.05, found on the exact characteristic function."""
    P = sp.symbols("P")
    column = arm(
        BEAM + HALF * P * v.diff(x) ** 2,
        left=None,
        right=None,
        essential=[v.subs(x, 0), v.diff(x).subs(x, 0)],
        virtual_work=[(-P * v.diff(x), v, "right")],
    )
    values = {EI: 1.0, rhoA: 1.0, L: 1.0}
    with pytest.raises(ValueError, match="follow the motion; use eigenvalues"):
        column.natural_frequencies({**values, P: 1.0})
    below, above = column.eigenvalues({**values, P: [20.04, 20.06]}, modes=2)
    np.testing.assert_allclose(below.real, 0.0, atol=1e-9)
    assert above.real.max() > 0.1


def test_gyroscopic_lagrangian_is_sent_to_eigenvalues():
    """A string moving at speed U between two eyes: omega_n = n pi (1 - U^2) c / L, no real part."""
    U = sp.symbols("U")
    moving = cra.Model(
        HALF * (v.diff(t) + U * v.diff(x)) ** 2 - HALF * v.diff(x) ** 2,
        fields=[v],
        x=x,
        domain=(0, 1),
        t=t,
        essential=[v.subs(x, 0), v.subs(x, 1)],
    )
    with pytest.raises(ValueError, match="gyroscopic terms, of first order in time; use eigenvalues"):
        moving.natural_frequencies({U: 0.3})
    found = moving.eigenvalues({U: 0.3}, modes=4)
    np.testing.assert_allclose(found, 1j * np.pi * np.arange(1, 5) * (1 - 0.3**2), rtol=1e-10)


# steady vibration -----------------------------------------------------------------------------------------------------


def test_receptance_of_a_cantilever():
    """Bishop and Johnson: (sin cosh - cos sinh) / (EI beta^3 (1 + cos cosh)) at the tip."""
    beam = arm(left=None, right=None, essential=[v.subs(x, 0), v.diff(x).subs(x, 0)])
    lam = np.array([0.01, 1.0, 3.0, 12.0])
    found = beam.frequency_response({EI: 1.0, rhoA: 1.0, L: 1.0}, lam**2, 1.0, drive=v.subs(x, L))
    s, co, S, C = np.sin(lam), np.cos(lam), np.sinh(lam), np.cosh(lam)
    exact = (s * C - co * S) / (lam**3 * (1 + co * C))
    np.testing.assert_allclose(found[1:], exact[1:], rtol=1e-10)
    np.testing.assert_allclose(found[0], 1 / 3, rtol=1e-8)


def test_response_is_reciprocal_and_peaks_where_the_eigenvalues_say(damped_joint):
    values = {**VALUES, c: 3.0}
    omega = np.array([5.0, 40.0, 111.0])
    there = damped_joint.frequency_response(values, omega, [1.1], drive=v.subs(x, 0))
    back = damped_joint.frequency_response(values, omega, [0.0], drive=v.subs(x, L))
    np.testing.assert_allclose(there, back, rtol=1e-9)
    s = damped_joint.eigenvalues(values, modes=1)[0]
    near = s.imag + s.real * np.array([-3.0, -1.0, 0.0, 1.0, 3.0])
    size = np.abs(damped_joint.frequency_response(values, near, 1.1, drive=v.subs(x, L)))
    assert size.argmax() == 2
    np.testing.assert_allclose(size[[1, 3]] / size[2], np.sqrt(0.5), rtol=0.02)


def test_prescribed_base_motion():
    """Moving the base as a coordinate: v per unit w far below resonance is the quasi-static give of joint and beam."""
    w = sp.Function("w")(t)
    moving = {v.diff(t): v.diff(t) + w.diff(t)}
    model = arm(BEAM.subs(moving), right=(HALF * m_e * v.diff(t) ** 2).subs(moving), coordinates=[w])
    omega = 1e-2
    found = model.frequency_response(VALUES, omega, [0.0, 1.1], drive=w, kind="motion")
    mass = 0.24 * 1.1 + 0.05
    moment = 0.24 * 1.1**2 / 2 + 0.05 * 1.1
    tip = mass / 900 + moment * 1.1 / 40 + 0.24 * 1.1**4 / (8 * 4.6) + 0.05 * 1.1**3 / (3 * 4.6)
    np.testing.assert_allclose(found / omega**2, [mass / 900, tip], rtol=1e-5)
    with pytest.raises(ValueError, match="drive"):
        model.frequency_response(VALUES, [1.0], [0.0], drive=v.diff(x, 2).subs(x, 0))
    with pytest.raises(ValueError, match="kind"):
        model.frequency_response(VALUES, [1.0], [0.0], drive=w, kind="push")
