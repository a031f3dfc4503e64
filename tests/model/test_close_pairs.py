"""Two almost equal frequencies: no digit is lost, however closely the two motions of a soft, heavy arm are tuned."""

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.codegen.arm_family import arm_family
from cra_sym.model.close_pairs import CLOSE, resolve_close_pairs


def tuned(inertia, detuning=0.0, **others):
    """Arms whose end-effector would move along and about itself at the same frequency, were the two not coupled."""
    arm = cra.Arm.nominal().replace(**{"k_r": 1.0, "m_e": 0.0, "J_e": inertia, **others})
    about_the_root = arm.J_e + arm.m_e * arm.L**2 + arm.rhoA * arm.L**3 / 3
    in_series = 1 / (1 / arm.k_r + arm.L / arm.EI)
    return arm.replace(k_t=in_series / about_the_root * (arm.m_e + arm.rhoA * arm.L) * (1 + detuning))


def outside(arm):
    frequency, proved = cra.natural_frequencies(arm, modes=3), cra.certify(arm, modes=3)
    assert proved.complete.all()
    return np.maximum(frequency - proved.upper, proved.lower - frequency) / frequency


def gap(arm):
    frequency = cra.natural_frequencies(arm, modes=2)
    return 1 - frequency[..., 0] / frequency[..., 1]


def test_tuned_arms_keep_their_digits():
    arm = tuned(np.array([1.0, 1e3, 1e6, 1e9]))
    assert (np.diff(np.log10(gap(arm))) < -1.4).all(), "as the root of the inertia"
    assert gap(arm)[-1] < 1e-5
    assert outside(arm).max() < 1e-15


def test_random_soft_arms_keep_their_digits():
    rng = np.random.default_rng(11)
    n = 60
    arm = tuned(
        10 ** rng.uniform(-2, 8, n),
        10 ** rng.uniform(-6, -1, n) * rng.choice([-1, 1], n),
        k_r=10 ** rng.uniform(-6, 3, n),
        m_e=10 ** rng.uniform(-3, 4, n) * (rng.random(n) < 0.6),
        L=10 ** rng.uniform(-1, 1, n),
    )
    assert (gap(arm) < CLOSE).sum() > 15, "what this is about"
    assert outside(arm).max() < 2e-15


@pytest.mark.parametrize(
    "k_t, k_r, inertia", [(9.07e-7, 0.0349, 1e6), (1.1287e-6, 10954.0, 1e6), (8.37e-7, 63.35, 1e6)]
)
def test_arms_that_lost_digits(k_t, k_r, inertia):
    arm = cra.Arm.nominal().replace(k_t=k_t, k_r=k_r, m_e=[0.0, 26.0], J_e=inertia, L=[[0.134], [0.206], [0.669]])
    assert outside(arm).max() < 1e-15


def test_pairs_apart_and_rigid_bodies_are_left_alone():
    lam = np.array([[0.0, 0.0, 4.73], [0.5, 0.6, 4.0], [3.0, 3.11, 6.0]])
    before = lam.copy()
    resolve_close_pairs(arm_family(), lam, *np.zeros((4, 3)))
    np.testing.assert_array_equal(lam, before)
    resolve_close_pairs(arm_family(), lam[:, :1].copy(), *np.zeros((4, 3)))


def test_shapes_of_a_close_pair_stay_orthonormal():
    arm = tuned(1e6)
    xi, weights = np.polynomial.legendre.leggauss(30)
    shape = cra.mode_shapes(arm, (1 + xi) / 2 * float(arm.L), modes=2)
    slope = cra.mode_shapes(arm, float(arm.L), modes=2, derivative=1)
    mass = float(arm.rhoA * arm.L) / 2 * (shape * weights) @ shape.T + float(arm.J_e) * np.outer(slope, slope)
    np.testing.assert_allclose(mass, np.eye(2), atol=1e-9)
