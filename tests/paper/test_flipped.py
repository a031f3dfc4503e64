"""The sign-flipped rotational spring: it reproduces the opposite trend, and it is not a physical joint."""

import numpy as np
from scipy.linalg import eigh
from sympy import Rational

import cra_sym as cra
from cra_sym import symbols as s
from cra_sym.paper import frequency_equation
from cra_sym.paper.energy import potential, single_mode
from cra_sym.paper.flipped import characteristic, flipped, flipped_frequencies
from cra_sym.paper.motion import natural_conditions

ARM = cra.Arm.nominal()
K_R = np.logspace(2, 6, 41)


def test_only_the_sign_of_the_rotational_condition_differs():
    for ours, theirs in zip(natural_conditions(), flipped().boundary_conditions, strict=True):
        assert ours.lhs == theirs.lhs
        expected = -ours.rhs if ours.has(s.k_r) else ours.rhs
        assert (theirs.rhs - expected).expand() == 0


def test_flipping_the_sign_is_a_negative_stiffness():
    function, _ = characteristic()
    derived, _ = frequency_equation.frequency_function()
    negative = derived.subs(s.c_r, -s.c_r)
    assert 0 in ((function - negative).expand(), (function + negative).expand())


def test_frequencies_rise_as_the_joint_softens_where_the_true_ones_fall():
    rising, derived = flipped_frequencies(ARM.replace(k_r=K_R)), cra.natural_frequencies(ARM.replace(k_r=K_R))
    rigid = cra.natural_frequencies(ARM)
    assert np.all(np.diff(rising, axis=0) < 0) and np.all(np.diff(derived, axis=0) > 0)
    assert np.all(rising > rigid) and np.all(derived < rigid)
    kappa = ARM.replace(k_r=K_R[-1]).kappa_r
    np.testing.assert_allclose(1 - derived[-1] / rigid, 2 / kappa, rtol=0.02)
    np.testing.assert_allclose(rising[-1] / rigid - 1, 2 / kappa, rtol=0.02)


def test_rigid_limit_is_the_same():
    np.testing.assert_allclose(flipped_frequencies(ARM), cra.natural_frequencies(ARM, modes=3), rtol=1e-12)


def test_without_a_rotational_spring_there_is_no_sign_to_flip():
    """The mode that loses its oscillation is then the rigid-body mode."""
    arm = ARM.replace(k_t=300.0, k_r=0.0)
    np.testing.assert_allclose(flipped_frequencies(arm), cra.natural_frequencies(arm, 4)[1:], rtol=1e-12)


def test_its_potential_energy_can_be_negative():
    turn = single_mode(potential()[1].rhs, s.x * s.psi).doit()
    assert turn == Rational(1, 2) * s.k_r * s.psi**2  # so with the flipped sign a rotation releases energy


def test_against_polynomial_trial_functions():
    """Rayleigh-Ritz with a negative rotational spring: one negative square, the others as found."""
    arm = ARM.replace(k_t=300.0, k_r=200.0, m_e=0.02, J_e=1e-4)
    x, weights = np.polynomial.legendre.leggauss(40)
    x, weights = 0.5 * (x + 1.0) * arm.L, 0.5 * weights * arm.L
    basis = [np.polynomial.Chebyshev.basis(n, domain=[0.0, arm.L]) for n in range(16)]

    def at(place, order):
        return np.array([b.deriv(order)(place) if order else b(place) for b in basis])

    def outer(values):
        return np.multiply.outer(values, values)

    mass = arm.rhoA * (at(x, 0) * weights) @ at(x, 0).T
    mass += arm.m_e * outer(at(arm.L, 0)) + arm.J_e * outer(at(arm.L, 1))
    stiffness = arm.EI * (at(x, 2) * weights) @ at(x, 2).T + arm.k_t * outer(at(0.0, 0))
    squares = eigh(stiffness - arm.k_r * outer(at(0.0, 1)), mass, eigvals_only=True)
    assert squares[0] < 0 < squares[1]
    np.testing.assert_allclose(np.sqrt(squares[1:4]) / (2 * np.pi), flipped_frequencies(arm), rtol=1e-7)
