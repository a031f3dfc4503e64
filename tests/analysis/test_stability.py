"""Stability of the arm: boundaries against Floquet theory, the excitations, warnings and refusals."""

from __future__ import annotations

import pickle
import subprocess
import sys
import warnings

import numpy as np
import pytest
from scipy.optimize import brentq

import cra_sym as cra
from cra_sym.analysis import floquet as growth
from cra_sym.analysis import floquet_boundary as edges
from cra_sym.analysis import static_corrections, zones
from cra_sym.analysis.floquet_boundary import floquet_boundary
from cra_sym.analysis.static_corrections import moments_of_other_modes
from cra_sym.kernels import has_compiler
from cra_sym.solvers import periodic
from cra_sym.solvers.floquet import Oscillation

SOFT = cra.Arm.nominal()
SOFT = SOFT.replace(k_t=1e3 * SOFT.EI / SOFT.L**3)  # kappa_t = 1000
UNIT = SOFT.angular_frequency_scale
JOINT, AXIAL = cra.JointStiffness(), cra.AxialBase(amplitude=0.01)


# numbers known from elsewhere -----------------------------------------------------------------------------------


def test_known_numbers_of_a_soft_joint():
    modal = cra.modal_parameters(SOFT)
    assert np.allclose(modal.omega / UNIT, [3.4744, 20.8543, 52.8408], rtol=0, atol=5e-5)  # half of the last digit
    assert np.allclose(np.diag(modal.stiffness_translation) / UNIT**2, [0.09056, 42.163, 856.99], rtol=1e-4)
    centre = 2 * modal.omega[1]
    first = np.array(cra.stability_boundary(SOFT, JOINT, 0.05, (2, 2)))
    assert np.allclose((first - centre) / UNIT, [-0.0505, 0.0505], atol=5e-5)
    three = np.array(floquet_boundary(SOFT, JOINT, 0.05, (2, 2), 3, residual=False))
    assert np.allclose((three - centre) / UNIT, [-0.0500, 0.0510], atol=5e-5)
    second = np.array(cra.stability_boundary(SOFT, JOINT, 0.05, (2, 2), order=2))
    assert np.allclose((second - centre) / UNIT, [-0.0520, 0.0491], atol=5e-5)


def test_what_is_asked_for_by_default():
    """The principal resonance of the first mode to first order, epsilon |P_11| / (2 omega_1) to both sides, in a system
    of three modes."""
    modal = cra.modal_parameters(SOFT)
    half = 0.1 * modal.stiffness_translation[0, 0] / (2 * modal.omega[0])
    sides = 2 * modal.omega[0] + half * np.array([-1.0, 1.0])
    assert np.allclose(cra.stability_boundary(SOFT, JOINT, 0.1), sides, rtol=1e-12)
    varpi = 2 * modal.omega[1] - 0.045 * UNIT
    assert cra.growth_rate(SOFT, JOINT, varpi, 0.05) == cra.growth_rate(SOFT, JOINT, varpi, 0.05, 3) > 0
    assert cra.floquet_exponents(SOFT, JOINT, varpi, 0.05).shape == (6,)
    assert cra.growth_rate(SOFT, JOINT, 2 * modal.omega[0], 0.1, modes=1) == pytest.approx(half / 2, rel=1e-2)


def test_the_search_finds_the_borders_of_what_grows(monkeypatch):
    """Of the first mode with five more, and the statics of the others where the joint fluctuates, unless told
    otherwise."""
    asked = []

    def growth(arm, excitation, grid, epsilon, modes, *, residual):
        asked.append((modes, residual))
        return 1.0 * ((borders[0] < grid) & (grid < borders[1]))

    monkeypatch.setattr(edges, "growth_rate", growth)
    for excitation, resonance in ((JOINT, ()), (AXIAL, ((2, 2),))):
        lower, upper = cra.stability_boundary(SOFT, excitation, 0.1, *resonance, order=2)
        size = upper - lower
        borders = lower - 0.1 * size, upper + 0.3 * size
        assert floquet_boundary(SOFT, excitation, 0.1, *resonance) == pytest.approx(borders, rel=0, abs=2e-6 * size)
    assert set(asked) == {(6, True), (7, False)}


def test_zones_scale_with_the_arm():
    """Thirty times longer, the arm is so slow that every frequency is below 1 rad/s; nothing else changes."""
    length = np.array([1.0, 30.0])
    arm = SOFT.replace(L=length, k_t=1e3 * SOFT.EI / length**3, m_e=0.0)
    for excitation in (JOINT, cra.AxialBase(0.01 * length)):
        for tongue, epsilon in ((1, 0.02), (2, 0.1)):
            sides = cra.stability_boundary(arm, excitation, epsilon, (2, 2), order=2, tongue=tongue)
            one, other = np.transpose(sides / arm.angular_frequency_scale)
            assert other == pytest.approx(one, rel=1e-9) and other[0] < other[1]
    with pytest.warns(cra.ResonanceWarning, match="resonance.*instability: epsilon is below the threshold"):
        cra.stability_boundary(arm.replace(zeta=0.01), JOINT, 1e-4, (2, 2))


def test_three_modes_shift_the_second_zone_the_wrong_way():
    """The statics of the modes left out put it right."""
    centre = 2 * cra.modal_parameters(SOFT).omega[1]
    given = SOFT, JOINT, 0.05, (2, 2), 3
    shift = [np.mean(floquet_boundary(*given, residual=residual)) - centre for residual in (False, True)]
    truth = np.mean(cra.stability_boundary(SOFT, JOINT, 0.05, (2, 2), order=2)) - centre
    assert shift[0] * truth < 0 < shift[1] * truth
    assert abs(shift[1] - truth) < 0.35 * abs(truth)


@pytest.mark.filterwarnings("ignore:resonance:cra_sym.AsymptoticWarning")
@pytest.mark.parametrize(("excitation", "modes"), [(JOINT, 5), (cra.AxialBase(0.1), 7)])
@pytest.mark.parametrize("resonance", [(2, 2), (1, 2)])
def test_order_of_accuracy(excitation, modes, resonance):
    """Halving epsilon divides the error of the boundary by 4 at first order and by 8 at second."""
    errors = {1: [], 2: []}
    for epsilon in (0.08, 0.04):
        truth = np.array(floquet_boundary(SOFT, excitation, epsilon, resonance, modes))
        for order, found in errors.items():
            sides = cra.stability_boundary(SOFT, excitation, epsilon, resonance, order=order)
            found.append(np.abs(np.array(sides) - truth).max())
    assert 3.4 < errors[1][0] / errors[1][1] < 4.6
    assert errors[2][0] / errors[2][1] > 6.0
    assert errors[2][1] < 0.2 * errors[1][1]


def test_tongue_at_the_natural_frequency_is_of_second_order():
    omega = cra.modal_parameters(SOFT).omega[1]
    lower, upper = cra.stability_boundary(SOFT, JOINT, np.array([0.1, 0.2]), (2, 2), order=2, tongue=2)
    assert (upper - lower)[1] / (upper - lower)[0] == pytest.approx(4.0)
    assert np.all(np.abs((lower + upper) / 2 - omega) < 0.01 * omega)
    inside, outside = (lower + upper) / 2, upper + (upper - lower)
    grown = cra.growth_rate(SOFT, JOINT, np.array([inside, outside]), [0.1, 0.2], 6, residual=True)
    assert np.all(grown[0] > 0.2 * (upper - lower)) and np.all(grown[1] < 1e-6)


def test_damped_zone():
    """Damping narrows a principal zone; of a sum it widens it, because it is unequal."""
    damped = SOFT.replace(zeta=0.001)
    for resonance, wider in (((2, 2), False), ((1, 2), True)):
        truth = np.array(floquet_boundary(damped, AXIAL, 0.3, resonance, 4))
        sides = np.array(cra.stability_boundary(damped, AXIAL, 0.3, resonance, order=2))
        assert np.abs(sides - truth).max() < 0.02 * np.ptp(truth)
        assert (np.ptp(sides) > np.ptp(cra.stability_boundary(SOFT, AXIAL, 0.3, resonance))) == wider
    truth = np.array(floquet_boundary(damped, AXIAL, 0.2, (1, 3), 4))
    sides = np.array(cra.stability_boundary(damped, AXIAL, 0.2, (1, 3), order=2))
    assert abs(np.mean(sides - truth)) < 0.005 * np.ptp(truth), "where it is unequal damping moves a sum too"


# statics of the modes left out ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arm",
    [
        SOFT,
        SOFT.replace(L=0.8, k_r=30.0, J_e=1e-4),
        SOFT.replace(k_t=40.0, k_r=3.0, m_e=0.1),
        SOFT.replace(L=3.0, k_t=0.9, k_r=0.8),
        SOFT.replace(L=1.3, k_r=0.0, m_e=0.1, J_e=0.01),
        SOFT.replace(L=0.7, k_t=0.0, k_r=3.0, m_e=0.1, J_e=0.01),
    ],
)
def test_sums_over_all_modes(arm):
    excitation = cra.JointStiffness(k_t=1.0, k_r=0.7)
    modal = cra.modal_parameters(arm, 400)
    springs = excitation.spring_displacements(arm, 400)
    b, omega = springs[:, 6:], modal.omega[6:]
    for power, found, rel in zip((2, 4), moments_of_other_modes(arm, excitation, 6), (3e-2, 1e-5), strict=True):
        scale = np.sqrt(np.outer(np.diag(found), np.diag(found)))  # the modes beyond 400 are that share of the sum
        np.testing.assert_allclose((b / omega**power) @ b.T, found, atol=rel * scale.max())
    assert np.allclose(springs[0][:, None] * springs[0], modal.stiffness_translation)
    assert np.allclose(springs[1][:, None] * springs[1], modal.stiffness_rotation)
    assert np.allclose(springs[0], np.sqrt(arm.k_t) * modal.root_displacement if np.isfinite(arm.k_t) else 0.0)
    assert np.allclose(springs[1], np.sqrt(arm.k_r) * modal.root_slope if np.isfinite(arm.k_r) else 0.0)


@pytest.mark.parametrize(
    ("free", "fluctuating"),
    [("k_r", cra.JointStiffness(k_t=1.0, k_r=0.5)), ("k_t", cra.JointStiffness(k_t=0.3, k_r=1.0))],
)
def test_the_zone_is_continuous_where_a_spring_vanishes(free, fluctuating):
    arms = [SOFT.replace(**{"k_t": 40.0, "k_r": 3.0, "m_e": 0.05, free: value}) for value in (0.0, 1e-9)]
    for resonance in ((2, 2), (2, 3)):
        none, hardly = (np.array(cra.stability_boundary(arm, fluctuating, 0.01, resonance, order=2)) for arm in arms)
        assert none == pytest.approx(hardly, rel=1e-10)  # a spring of 1e-9 beside others of 3 and 40
    varpi = 2.0 * cra.modal_parameters(arms[0]).omega[1]
    rates = [cra.growth_rate(arm, fluctuating, varpi, 0.3, 2, residual=True) for arm in arms]
    assert rates[0] > 0.1 and rates[0] == pytest.approx(rates[1], rel=1e-6)


def test_the_second_order_does_not_depend_on_how_many_modes_are_summed_one_by_one(monkeypatch):
    """With two terms of the others' statics the rest falls off with omega^-6, the number of modes to the power 11."""
    arm, shifts = SOFT.replace(k_t=40.0, k_r=3.0), []
    for spectators in (4, 8, 48):
        monkeypatch.setattr(zones, "_SPECTATORS", spectators)
        shifts.append(zones.zone_of(arm, cra.JointStiffness(1.0, 0.7), 0.1, 2, 2, 1, 3).shift)
    errors = np.abs(np.array(shifts[:2]) / shifts[2] - 1)
    assert errors[0] < 1e-5 and errors[0] / errors[1] > 2.0**10


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_rank_one_terms_make_up_springs_in_series_with_what_is_left_out(side, monkeypatch):
    """Whichever way the eigenvectors point."""
    arm, excitation, a, c = SOFT.replace(k_r=50.0), cra.JointStiffness(1.0, 0.5), np.diag([1.0, 0.5]), 0.7
    b, omega = excitation.spring_displacements(arm, 4), arm.natural_frequencies(4)
    left_out = np.eye(2) - (b / omega) @ (b / omega).T
    monkeypatch.setattr(static_corrections, "moments_of_other_modes", lambda *_: (left_out, None))
    expected = b.T @ (a * c) @ np.linalg.inv(np.eye(2) + left_out @ a * c) @ b
    values, vectors = np.linalg.eigh(np.sqrt(a) @ left_out @ np.sqrt(a))
    monkeypatch.setattr(np.linalg, "eigh", lambda _: (values, vectors * [1.0, side]))
    coupling, compliance = static_corrections.static_terms(arm, excitation, 4)
    assert np.allclose(np.tensordot(c / (1 + c * compliance), coupling, 1), expected, rtol=1e-10)


def test_the_statics_of_a_rigid_spring_do_not_mix_with_those_of_the_other():
    """It has nothing to fluctuate, and its fluctuation changes nothing."""
    arm = SOFT.replace(k_t=np.inf, k_r=50.0)
    system = 2.0 * cra.modal_parameters(arm).omega[0], 0.5, 2
    both, one = (cra.growth_rate(arm, cra.JointStiffness(k_t, 0.5), *system, residual=True) for k_t in (1.0, 0.0))
    assert both == pytest.approx(one, rel=1e-9) and one > 0.01


def test_residual_flexibility_is_the_limit_of_many_modes():
    excitation = cra.JointStiffness(k_t=1.0, k_r=0.5)
    arm, varpi = SOFT.replace(k_r=50.0), 2.0 * cra.modal_parameters(SOFT.replace(k_r=50.0)).omega[0]
    few, many = (
        cra.floquet_exponents(arm, excitation, varpi, 0.5, modes, residual=residual, tolerance=1e-6)
        for modes, residual in ((4, True), (16, False))
    )
    assert few[0].real == pytest.approx(many[0].real, rel=5e-3)
    assert abs(few[0].imag) == pytest.approx(abs(many[0].imag), rel=1e-3)


# shapes, limits, refusals ---------------------------------------------------------------------------------------


def test_broadcasting_equals_looping():
    masses, sizes = np.array([0.0, 0.001, 0.005]), np.array([[0.02], [0.1]])
    batch = SOFT.replace(k_r=50.0, m_e=masses)
    weights, varpi = np.array([1.0, 0.7, 0.0]), 2 * cra.modal_parameters(batch, 1).omega[1, 0]
    for excitation in (AXIAL, cra.AxialBase(np.array([0.01, 0.02, 0.03])), cra.JointStiffness(weights, 0.4)):
        joint = isinstance(excitation, cra.JointStiffness)
        together = np.array(cra.stability_boundary(batch, excitation, sizes, (1, 3), order=2))
        growth = cra.growth_rate(batch, excitation, varpi, sizes, residual=joint)
        assert together.shape == (2, 2, 3) and growth.shape == (2, 3) and growth.max() > 0.01 * joint
        for i, k in np.ndindex(2, 3):
            one = excitation
            if excitation.shape:
                one = cra.JointStiffness(weights[k], 0.4) if joint else cra.AxialBase(excitation.amplitude[k])
            alone = SOFT.replace(k_r=50.0, m_e=masses[k])
            assert np.allclose(
                cra.stability_boundary(alone, one, sizes[i, 0], (1, 3), order=2), together[:, i, k], rtol=1e-12
            )
            rate = cra.growth_rate(alone, one, varpi, sizes[i, 0], residual=joint)
            assert rate == pytest.approx(growth[i, k], abs=1e-9)


def test_without_excitation_nothing_grows():
    grid = np.linspace(5.0, 300.0, 12)
    assert np.all(cra.growth_rate(SOFT, JOINT, grid, 0.0) < 1e-12)
    assert np.all(cra.growth_rate(SOFT, cra.AxialBase(0.0), grid, 0.1) < 1e-12)
    exponents = cra.floquet_exponents(SOFT.replace(zeta=0.02), JOINT, grid, 0.0)
    assert np.allclose(exponents[:, 0].real, -0.02 * cra.modal_parameters(SOFT).omega[0], rtol=1e-10)
    lower, upper = cra.stability_boundary(SOFT, JOINT, 0.0, (1, 2), order=2)
    assert lower == upper == pytest.approx(cra.modal_parameters(SOFT).omega[:2].sum())


def test_growth_is_that_of_the_written_out_system():
    modal = cra.modal_parameters(SOFT, 4)
    varpi = 2.0 * modal.omega[1]
    coupling = 0.01 * varpi**2 * modal.axial
    drives = [(Oscillation(1, "cos", 0), (coupling, None, None, None))]
    direct = periodic.growth_rate(np.diag(modal.omega**2), np.zeros((4, 4)), drives, varpi, 0.4)
    assert cra.growth_rate(SOFT, AXIAL, varpi, 0.4, 4) == pytest.approx(direct, rel=1e-9) and direct > 0.1


def test_both_order_conventions_of_a_resonance():
    assert cra.stability_boundary(SOFT, JOINT, 0.1, (1, 3)) == pytest.approx(
        cra.stability_boundary(SOFT, JOINT, 0.1, (3, 1))
    )


@pytest.mark.parametrize("resonance", [(2, -1), (1, -2)])
def test_difference_resonance_of_a_symmetric_coupling_is_none(resonance):
    with pytest.warns(cra.ResonanceWarning, match=r"\(2, -1\).*P is symmetric") as caught:
        sides = cra.stability_boundary(SOFT, JOINT, [0.1, 0.2], resonance)
    assert np.isnan(sides).all() and caught[0].filename == __file__


def test_rigid_joint_has_nothing_to_fluctuate():
    with pytest.warns(cra.ResonanceWarning, match="does not couple"):
        assert np.isnan(cra.stability_boundary(cra.Arm.nominal(), JOINT, 0.1, (1, 1))).all()
    with pytest.raises(ValueError, match="k_t = inf cannot fluctuate"):
        cra.growth_rate(cra.Arm.nominal(), JOINT, 30.0, 0.3)
    # of a batch it is the limit of large values
    several = cra.Arm.nominal().replace(k_t=np.array([1e4, np.inf]))
    assert cra.growth_rate(several, JOINT, 187.15, 0.1)[1] == 0.0


def test_rigid_body_mode_does_not_resonate():
    with pytest.warns(cra.ResonanceWarning, match="rigid-body"):
        assert np.isnan(cra.stability_boundary(SOFT.replace(k_r=0.0), JOINT, 0.1, (1, 1))).all()


def test_damping_threshold_is_said():
    damped = SOFT.replace(zeta=0.01)
    with pytest.warns(cra.ResonanceWarning, match="1 of 2 parameter sets: epsilon is below the threshold"):
        lower, upper = cra.stability_boundary(damped, cra.AxialBase(0.05), [1e-4, 0.3], (2, 2), order=2)
    assert np.isnan(lower[0]) and lower[1] < upper[1]


@pytest.mark.filterwarnings("ignore:resonance:cra_sym.AsymptoticWarning")
def test_overlap_and_reach_are_said():
    with pytest.warns(cra.AsymptoticWarning, match=r"overlaps that of resonance \(1, 3\)"):
        cra.stability_boundary(SOFT, cra.AxialBase(0.05), 0.6, (2, 2))
    with pytest.warns(cra.AsymptoticWarning, match="beyond the reach"):
        cra.stability_boundary(SOFT, JOINT, 0.5, (1, 2))
    with pytest.warns(cra.AsymptoticWarning, match="negative in part") as caught:
        cra.stability_boundary(SOFT, JOINT, 1.1, (1, 1))
    assert {warning.filename for warning in caught} == {__file__}


def sides_and_words(arm, excitation, epsilon, resonance, order=2, tongue=1):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sides = cra.stability_boundary(arm, excitation, epsilon, resonance, order=order, tongue=tongue)
    assert all(warning.filename == __file__ for warning in caught), "they point at the call"
    return sides, " ".join(str(warning.message) for warning in caught)


def test_overlap_is_said_from_where_the_zones_touch():
    excitation = cra.AxialBase(0.05)

    def gap(epsilon):
        (lower, upper), _ = sides_and_words(SOFT, excitation, epsilon, (2, 2))
        (other_lower, other_upper), _ = sides_and_words(SOFT, excitation, epsilon, (1, 3), order=1)
        return max(lower, other_lower) - min(upper, other_upper)

    touch = brentq(gap, 0.1, 0.6, xtol=1e-4)
    for share, said in ((0.99, False), (1.01, True)):
        _, words = sides_and_words(SOFT, excitation, share * touch, (2, 2))
        assert ("overlaps that of resonance (1, 3)," in words) == said


def test_overlap_with_a_second_tongue_is_said():
    """Where the second frequency is twice the first, the second tongue of its zone lies at the first one's zone."""

    def arm(k_t):
        return cra.Arm.nominal().replace(k_t=k_t, k_r=0.05, m_e=0.0, J_e=0.5)

    def detuning(k_t):
        first, second = cra.modal_parameters(arm(k_t), 2).omega
        return second / first - 2

    def gap(k_t):
        lower, _ = sides_and_words(arm(k_t), JOINT, 0.1, (1, 1))[0]
        _, upper = sides_and_words(arm(k_t), JOINT, 0.1, (2, 2), tongue=2)[0]
        return lower - upper

    tuned = brentq(detuning, 1e-3, 1e-2)
    touch = brentq(gap, tuned, 1.2 * tuned, xtol=1e-9)
    for k_t, said in ((tuned, True), (0.9999 * touch, True), (1.0001 * touch, False), (1.2 * tuned, False)):
        _, words = sides_and_words(arm(k_t), JOINT, 0.1, (1, 1))
        assert ("resonance (2, 2), second tongue" in words) == said


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: cra.stability_boundary(SOFT, cra.TransverseBase(0.01), 0.1), ValueError, "forced_width"),
        (lambda: cra.growth_rate(SOFT, cra.TransverseBase(0.01), 3.0, 0.1), ValueError, "forced_width"),
        (lambda: cra.floquet_exponents(SOFT, cra.TransverseBase(0.01), 3.0, 0.1), ValueError, "forced_width"),
        (lambda: cra.forced_width(SOFT, JOINT), TypeError, "must be a TransverseBase"),
        (lambda: cra.stability_boundary(SOFT, "joint", 0.1), TypeError, "excitation = 'joint'"),
        (lambda: cra.stability_boundary(1.0, JOINT, 0.1), TypeError, "system = 1.0"),
        (lambda: cra.stability_boundary(SOFT, JOINT, -0.05), ValueError, "epsilon = -0.05"),
        (lambda: cra.growth_rate(SOFT, JOINT, 50.0, -0.05), ValueError, "epsilon = -0.05"),
        (lambda: cra.stability_boundary(SOFT, JOINT, np.nan), ValueError, "epsilon = nan"),
        (lambda: cra.stability_boundary(SOFT, JOINT, 0.1, (1, 4)), ValueError, r"resonance = \(1, 4\)"),
        (lambda: cra.stability_boundary(SOFT, JOINT, 0.1, (1, -1)), ValueError, "difference of a mode with itself"),
        (lambda: cra.stability_boundary(SOFT, JOINT, 0.1, (0, 1)), ValueError, "resonance ="),
        (lambda: cra.stability_boundary(SOFT, JOINT, 0.1, 2), ValueError, "resonance = 2"),
        (lambda: cra.stability_boundary(SOFT, JOINT, 0.1, (1, 1), order=3), ValueError, "order = 3"),
        (lambda: cra.stability_boundary(SOFT, JOINT, 0.1, (1, 1), tongue=2), ValueError, "appears at order 2"),
        (lambda: cra.stability_boundary(SOFT, JOINT, 0.1, (1, 1), order=2, tongue=3), ValueError, "tongue = 3"),
        (lambda: floquet_boundary(SOFT, JOINT, 0.05, (2, 2), 1), ValueError, "growth nowhere in the middle"),
        (lambda: floquet_boundary(SOFT, cra.AxialBase(0.1), 0.6, (2, 2), 3), ValueError, "merges with another"),
        (lambda: cra.growth_rate(SOFT, JOINT, 0.0, 0.1), ValueError, "angular_frequency = 0"),
        (lambda: cra.growth_rate(SOFT, AXIAL, 1.0, 0.1, residual=True), ValueError, "residual"),
        (lambda: cra.growth_rate(SOFT, JOINT, [1.0, 2.0], [0.1, 0.2, 0.3]), ValueError, "broadcast"),
        (lambda: cra.JointStiffness(k_t=-1.0), ValueError, "k_t = -1"),
        (lambda: cra.AxialBase("1"), TypeError, "amplitude = '1'"),
    ],
)
def test_bad_input_is_named(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_forced_width_is_the_growth_of_the_tip():
    modal = cra.modal_parameters(SOFT)
    width = cra.forced_width(SOFT, cra.TransverseBase(0.002))
    assert np.allclose(width, np.abs(modal.participation * modal.tip_displacement) * modal.omega * 0.002 / 2)
    assert cra.forced_width(SOFT.replace(m_e=[0.0, 0.01]), cra.TransverseBase([[0.1], [0.2]])).shape == (2, 2, 3)


def test_excitations_compare_hash_and_pickle():
    for excitation in (JOINT, AXIAL, cra.TransverseBase(np.array([1.0, 2.0]))):
        copy = pickle.loads(pickle.dumps(excitation))
        assert copy == excitation and hash(copy) == hash(excitation)
    assert JOINT == cra.JointStiffness(1.0, 0.0), "one spring, if not said otherwise"
    assert cra.AxialBase(1.0) != cra.TransverseBase(1.0) and cra.AxialBase(1.0) != cra.AxialBase(2.0)


def test_numbers_come_without_sympy_once_derived():
    code = (
        "import sys, cra_sym as cra\n"
        "arm = cra.Arm.nominal().replace(k_t=1e4)\n"
        "cra.stability_boundary(arm, cra.JointStiffness(), 0.1, (2, 2), order=2)\n"
        "cra.growth_rate(arm, cra.JointStiffness(), 50.0, 0.1)\n"
        "print('sympy' in sys.modules)\n"
    )
    for _ in range(2):
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "False\n"


@pytest.mark.skipif(not has_compiler(), reason="llvmlite is an option")
@pytest.mark.parametrize("decay", [0.0, 0.02])
@pytest.mark.parametrize("soft", [None, [0.1, 0.3]])
def test_the_compiled_loop_is_numpys(decay, soft):
    coupling = np.array([[[1.0, 0.5], [0.5, -0.7]], [[0.1, 0.0], [0.0, 0.2]]])
    drives = [(Oscillation(1, "cos", 0), (part, None, None, None)) for part in coupling]
    chart = np.linspace(0.7, 6.0, 70)[:, None], np.linspace(0.0, 0.6, 3)
    system, _ = periodic.PeriodicSystem.of(np.diag([1.0, 4.84]), decay * np.eye(2), drives, *chart, soft)
    maps = [periodic.monodromy(system, 1e-15, loop) for loop in (growth._template().propagate, None)]
    np.testing.assert_allclose(*maps, rtol=0.0, atol=1e-11 * np.abs(maps[0]).max())  # rounding of a thousand terms


def test_charts_are_compiled_where_it_pays(monkeypatch):
    asked = []
    monkeypatch.setattr(growth, "wants_compiler", lambda roots, parts: bool(asked.append(roots)))
    monkeypatch.setattr(growth, "_template", lambda: pytest.fail("nothing is to be compiled"))
    arm, chart = cra.Arm.nominal().replace(k_t=1e3), (np.linspace(20.0, 90.0, 7)[:, None], np.linspace(0.0, 0.3, 3))
    one = cra.growth_rate(arm, cra.JointStiffness(), *chart, modes=2)
    assert asked == [21 * growth._ROOTS]
    np.testing.assert_array_equal(one, cra.growth_rate(arm, cra.JointStiffness(), *chart, modes=2, backend="numpy"))
    monkeypatch.setattr(growth, "has_compiler", lambda: False)
    with pytest.raises(ValueError, match="backend = 'compiled': llvmlite is not installed"):
        cra.growth_rate(arm, cra.JointStiffness(), *chart, backend="compiled")
    with pytest.raises(ValueError, match="backend = 'fortran'"):
        cra.floquet_exponents(arm, cra.JointStiffness(), *chart, backend="fortran")
