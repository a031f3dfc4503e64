"""Claims on stability: zones by a second route, and verdicts that turn when the physics is perturbed."""

import numpy as np

import cra_sym as cra
from cra_sym.analysis.floquet import growth_rate
from cra_sym.arm.excitations import JointStiffness
from cra_sym.claims import claim
from cra_sym.solvers.hill import hill_exponents

ARM = cra.Arm.nominal()


def test_c14_tells_forced_from_parametric():
    verdict = claim("C14")
    np.testing.assert_array_equal(verdict["parametric"], [False, True, True])
    np.testing.assert_array_equal(verdict["forced"], [True, False, False])
    assert verdict.outcome == "contradicted" and r"k_t (1 + \epsilon" in verdict.remedy and "u_0" in verdict.remedy
    at_once, at_twice = verdict["envelope"]
    half = np.searchsorted(verdict["times"], verdict["times"][-1] / 2)
    assert 1.9 < at_once[-1] / at_once[half] < 2.1  # in proportion to time
    assert at_twice[-1] < 1.1 * at_twice[half]


def test_c14_growth_by_hill():
    """The rate of growth with a fluctuating joint at 2 omega_2, by Hill's determinant of 5 modes."""
    modal = cra.modal_parameters(ARM.replace(k_t=1e3), 5)
    found = hill_exponents(modal.omega, modal.stiffness_translation, 2 * modal.omega[1], 0.05, harmonics=16)
    np.testing.assert_allclose(claim("C14")["growth"], found.real.max(), rtol=3e-2)


def test_c15_boundaries_need_the_conjugate_amplitude():
    verdict = claim("C15")
    np.testing.assert_array_equal(verdict["bounded"], verdict["conjugate"])
    np.testing.assert_allclose(verdict["centre"], 2.0, rtol=1e-12)


def test_c15_floquet_confirms_the_derived_zones():
    verdict = claim("C15")
    detuning = np.abs(verdict["detuning"])
    assert (verdict["growth"][:, detuning < 0.9] > 0).all()
    assert (verdict["growth"][:, detuning > 1.1] < 1e-6).all()


def test_c16_widths_are_those_of_the_modal_matrices():
    """epsilon |P_nn| / omega_n from the give of the joint, apart from the derived kernels."""
    verdict = claim("C16")
    modal = cra.modal_parameters(ARM.replace(k_t=verdict["k_t"]))
    by_hand = 0.05 * verdict["k_t"][:, None] * modal.root_displacement**2 / modal.omega
    np.testing.assert_allclose(verdict["width"][1], by_hand, rtol=1e-9)
    forced = 0.05 * np.abs(modal.participation * modal.tip_displacement) * modal.omega * 1e-3 / 2
    np.testing.assert_allclose(verdict["width"][0], forced, rtol=1e-9)


def test_c16_holds_for_the_joint_in_absolute_width_only():
    verdict = claim("C16")
    assert (
        verdict.outcome in ("mostly holds", "rarely holds")
        and verdict["region"][1].any()
        and not verdict["region"][2].any()
    )
    assert not verdict["relative"].any()


def test_c17_holds_on_stiff_joints():
    verdict = claim("C17")
    assert verdict.outcome in ("mostly holds", "rarely holds")
    stiff = verdict["k_t"] > 2e3
    assert verdict["region"][1][stiff].all() and not verdict["region"][1].all()


def test_c19_powers_and_damping():
    verdict = claim("C19")
    np.testing.assert_allclose(verdict["powers"], [1.0, 2.0], atol=0.02)
    region = verdict["region"]
    assert region[0].all() and not region[-1].any() and verdict.outcome in ("mostly holds", "rarely holds")
    assert (np.diff(region.astype(int), axis=1) >= 0).all()  # more fluctuation never stabilises here


def test_c19_damping_takes_its_share_of_the_growth():
    """zeta omega_n is what a damping ratio takes from the growth of mode n."""
    arm = ARM.replace(k_t=1e3)
    omega = cra.modal_parameters(arm, 2).omega[1]
    free, damped = (
        growth_rate(arm.replace(zeta=zeta), JointStiffness(), 2 * omega, 0.1, residual=True) for zeta in (0.0, 1e-3)
    )
    np.testing.assert_allclose(free - damped, 1e-3 * omega, rtol=2e-2)
