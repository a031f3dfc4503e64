"""The arm through the general model: the same equations and the same numbers by other code."""

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.arm.instance import arm_model, model_values
from cra_sym.paper.motion import dynamics

JOINTS = [(np.inf, np.inf), (1e3, 1e2), (1e2, np.inf), (np.inf, 1.0), (0.0, 50.0), (300.0, 0.0), (0.0, 0.0)]


@pytest.mark.parametrize(("k_t", "k_r"), JOINTS)
def test_frequencies_agree_with_the_arms_own(k_t, k_r):
    arm = cra.Arm.nominal().replace(k_t=k_t, k_r=k_r, m_e=0.02, J_e=2e-5)
    found = arm_model().natural_frequencies(model_values(arm), modes=5)
    np.testing.assert_allclose(found, cra.natural_frequencies(arm, modes=5), rtol=1e-9, atol=1e-9)


def test_equations_are_those_of_the_derivation():
    assert arm_model(driven=True).equations.equations == dynamics().equations


def test_a_free_base_moves_all_modes_and_adds_a_drift():
    arm = cra.Arm.nominal().replace(k_t=1e3, k_r=1e2)
    found = arm_model(driven=True).natural_frequencies(model_values(arm, driven=True), modes=4)
    held = cra.natural_frequencies(arm, modes=3)
    assert found[0] == 0.0
    assert np.all(found[1:] > held)  # releasing a constraint on a mass that moves against the arm raises them
    heavy = model_values(arm.replace(m_b=1e9), driven=True)
    np.testing.assert_allclose(arm_model(driven=True).natural_frequencies(heavy, modes=4)[1:], held, rtol=1e-6)


def test_ritz_of_the_model_bounds_from_above():
    arm = cra.Arm.nominal().replace(k_t=1e3, k_r=1e2)
    upper = arm_model().ritz(elements=8).natural_frequencies(model_values(arm), modes=3)
    exact = cra.natural_frequencies(arm)
    assert np.all(upper >= exact * (1 - 1e-12))
    np.testing.assert_allclose(upper, exact, rtol=1e-3)
