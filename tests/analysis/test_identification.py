"""Identification: recovery, exact gradients, covariance against repeated noisy measurements, and honest warnings."""

import re
import warnings

import numpy as np
import pytest

import cra_sym as cra
from cra_sym import Arm
from cra_sym.analysis import identification
from cra_sym.analysis.identification import IdentifiabilityWarning, _gradient

NOMINAL = Arm.nominal()


def number_after(words, text):
    return float(re.search(re.escape(words) + r" ?([-+.e\d]+)", text)[1])


@pytest.mark.parametrize(
    ("k_t", "k_r", "length"), [(2e3, 40.0, 1.0), (50.0, 1e3, 1.0), (1e4, 5.0, 1.0), (20.0, 0.3, 1.0), (1.0, 4.0, 5.0)]
)
def test_exact_frequencies_give_the_joint_back(k_t, k_r, length, monkeypatch):
    """After some steps, as with exact gradients; with others, of twice the size say, it takes 80 and more."""
    steps, counted = [], identification.sensitivities
    monkeypatch.setattr(identification, "sensitivities", lambda *a, **b: steps.append(1) or counted(*a, **b))
    arm = NOMINAL.replace(L=length)
    estimate = cra.identify_joint(arm, cra.natural_frequencies(arm.replace(k_t=k_t, k_r=k_r), 4), 1e-3)
    assert (estimate.k_t, estimate.k_r) == (pytest.approx(k_t, rel=1e-9), pytest.approx(k_r, rel=1e-9))
    assert estimate.identifiable and np.abs(estimate.residuals).max() < 1e-6
    deviation = [number_after(f"{name} to", estimate.message) for name in ("k_t", "k_r")]
    assert deviation == pytest.approx(estimate.log_standard_deviation, rel=0.06)  # printed with two digits
    assert len(steps) < 30


def test_the_search_starts_from_the_joint_of_the_grid_that_fits_best():
    arm = NOMINAL.replace(L=0.3)
    units = identification._units(arm)
    kappa = identification._STARTS[[4, 7]]
    measured = cra.natural_frequencies(arm.replace(k_t=kappa[0] * units[0], k_r=kappa[1] * units[1]), 4)
    best, _ = identification._starts(arm, units, measured, np.full(4, 0.1))
    np.testing.assert_allclose(best, np.log1p(1 / kappa))


def test_the_gradient_is_exact():
    arm = NOMINAL.replace(L=0.8)
    units = identification._units(arm)

    def at(place):
        k_t, k_r = units / np.expm1(place)
        return arm.replace(k_t=k_t, k_r=k_r)

    for place in (np.array([2e-3, 0.1]), np.array([1.5, 3.0])):
        found = _gradient(units / np.expm1(place), cra.sensitivities(at(place), 4), units)
        for i, direction in enumerate(np.eye(2) * 1e-6 * place):
            slope = cra.natural_frequencies(at(place + direction), 4) - cra.natural_frequencies(
                at(place - direction), 4
            )
            assert found[:, i] == pytest.approx(slope / (2 * direction[i]), rel=1e-6)


def test_the_covariance_is_that_of_repeated_measurements():
    true = NOMINAL.replace(k_t=2e3, k_r=40.0)
    exact, sigma = cra.natural_frequencies(true, 4), np.array([0.002, 0.01, 0.02, 0.05])
    rng = np.random.default_rng(11)
    estimates = [cra.identify_joint(NOMINAL, exact + sigma * rng.normal(size=4), sigma) for _ in range(24)]
    found = np.array([(e.k_t, e.k_r) for e in estimates])
    covariance = cra.identify_joint(NOMINAL, exact, sigma).covariance
    # of 24: a deviation scatters by 1 / sqrt(48), the mean of chi-squared with 2 freedoms by sqrt(4 / 24) of 2
    assert np.std(found, axis=0) == pytest.approx(np.sqrt(np.diag(covariance)), rel=0.4)
    assert np.mean([np.sum(e.residuals**2) for e in estimates]) == pytest.approx(2.0, rel=0.6)  # 4 data, 2 unknowns


def test_the_covariance_is_the_inverse_of_what_the_shapes_tell():
    """Fisher information from the forces the joint carries: a give in the joint costs each mode their square."""
    true, sigma = NOMINAL.replace(L=0.8, k_t=2e3, k_r=40.0), np.array([0.002, 0.01, 0.02])
    estimate = cra.identify_joint(NOMINAL.replace(L=0.8), cra.natural_frequencies(true), sigma)
    modal = cra.modal_parameters(true)
    slopes = np.stack([modal.root_shear**2, modal.root_moment**2], -1) / (4 * np.pi * modal.omega * sigma)[:, None]
    expected = np.linalg.inv(slopes.T @ slopes)
    assert estimate.compliance_covariance == pytest.approx(expected, rel=1e-6)
    square = np.array([2e3, 40.0]) ** 2
    assert estimate.covariance == pytest.approx(expected * np.outer(square, square), rel=1e-6)
    relative = np.sqrt(np.diag(expected)) * [2e3, 40.0]
    assert estimate.log_standard_deviation == pytest.approx(relative, rel=1e-6)


def test_one_frequency_tells_only_a_combination():
    with pytest.warns(IdentifiabilityWarning, match="do not tell k_t and k_r apart: what they tell is 1/k_t"):
        estimate = cra.identify_joint(NOMINAL, [2.3], 0.01)
    assert not estimate.identifiable
    assert np.isinf(estimate.covariance).all()
    assert estimate.frequencies == pytest.approx([2.3])


def test_a_stiff_joint_measured_roughly_is_only_bounded():
    true = NOMINAL.replace(k_t=1e4, k_r=1e4)
    with pytest.warns(IdentifiabilityWarning, match="k_t is told to .*; k_r is only known to exceed"):
        estimate = cra.identify_joint(NOMINAL, cra.natural_frequencies(true), 0.05)
    assert estimate.log_standard_deviation[0] < 0.2 < np.log(2) < estimate.log_standard_deviation[1]


def test_a_rigid_joint_is_found_rigid_with_finite_compliance_covariance():
    with pytest.warns(IdentifiabilityWarning, match="only known to exceed"):
        estimate = cra.identify_joint(NOMINAL, cra.natural_frequencies(NOMINAL), 0.01)
    assert estimate.k_t > 1e9 and estimate.k_r > 1e9
    assert np.isfinite(estimate.compliance_covariance).all()


def test_enough_precise_data_do_not_warn():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cra.identify_joint(NOMINAL, cra.natural_frequencies(NOMINAL.replace(k_t=1e4, k_r=1e3), 5), 1e-3)


@pytest.mark.filterwarnings("ignore::cra_sym.analysis.identification.IdentifiabilityWarning")
def test_two_frequencies_tell_two_stiffnesses_until_a_factor_of_two():
    true = NOMINAL.replace(k_t=2e3, k_r=40.0)
    measured, sigma = cra.natural_frequencies(true, 2), 1e-4
    estimate = cra.identify_joint(NOMINAL, measured, sigma)
    assert (estimate.k_t, estimate.k_r) == (pytest.approx(2e3, rel=1e-6), pytest.approx(40.0, rel=1e-6))
    limit = sigma * np.log(2) / estimate.log_standard_deviation.max()
    for share, told in ((0.99, True), (1.01, False)):
        assert cra.identify_joint(NOMINAL, measured, share * limit).identifiable == told


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"measured_frequencies": [15.0, 2.4]}, ValueError, "must ascend"),
        ({"measured_frequencies": [0.0, 2.4]}, ValueError, "measured_frequencies = 0"),
        ({"measured_frequencies": 2.4}, ValueError, "one axis"),
        ({"measured_frequencies": []}, ValueError, "one axis of frequencies"),
        ({"measured_frequencies": ["f"]}, TypeError, "measured_frequencies"),
        ({"uncertainty": 0.0}, ValueError, "uncertainty = 0"),
        ({"uncertainty": [0.1, 0.1, 0.1]}, ValueError, "broadcast"),
        ({"system": NOMINAL.replace(L=[1.0, 2.0])}, ValueError, "single set of values"),
    ],
)
def test_bad_input_is_named(arguments, error, words):
    with pytest.raises(error, match=words):
        cra.identify_joint(**({"system": NOMINAL, "measured_frequencies": [2.4, 15.0], "uncertainty": 0.1} | arguments))


@pytest.mark.parametrize("sigma", [[0.01], [0.01, 1e3, 1e3], [0.01, 1e20]])
def test_the_combination_one_frequency_tells_is_the_one_the_shapes_say(sigma):
    """By Rayleigh's principle a give of the joint costs half the square of the force it carries, over the energy."""
    measured = cra.natural_frequencies(NOMINAL.replace(L=0.8, k_t=500.0, k_r=20.0), len(sigma))
    with pytest.warns(IdentifiabilityWarning) as caught:
        estimate = cra.identify_joint(NOMINAL.replace(L=0.8), measured, sigma)
    told = str(caught[0].message)
    assert caught[0].filename == __file__, "it points at the call"
    assert estimate.covariance.shape == estimate.compliance_covariance.shape == (2, 2)
    fitted = NOMINAL.replace(L=0.8, k_t=estimate.k_t, k_r=estimate.k_r)
    modal = cra.modal_parameters(fitted, 1)
    shear, moment, omega = modal.root_shear[0], modal.root_moment[0], modal.omega[0]
    ratio = (moment / shear) ** 2
    assert number_after("1/k_t +", told) == pytest.approx(ratio, rel=6e-3)
    assert number_after("= (", told) == pytest.approx(1 / estimate.k_t + ratio / estimate.k_r, rel=6e-3)
    slope = shear**2 / (2 * omega) / (2 * np.pi)  # Hz lost by a give in translation of 1 m/N
    assert number_after("+-", told) == pytest.approx(0.01 / slope, rel=6e-2)


def test_a_bound_is_two_standard_deviations_of_the_compliance_away():
    with pytest.warns(IdentifiabilityWarning) as caught:
        estimate = cra.identify_joint(NOMINAL, cra.natural_frequencies(NOMINAL.replace(k_t=1e4, k_r=1e4)), 0.05)
    least = number_after("k_r is only known to exceed", str(caught[0].message))
    deviation = np.sqrt(estimate.compliance_covariance[1, 1])
    assert (1 / least - 1 / estimate.k_r) / deviation == pytest.approx(2.0, rel=0.02)
    assert estimate.log_standard_deviation[1] == pytest.approx(deviation * estimate.k_r)
