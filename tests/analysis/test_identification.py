"""Identification: recovery, exact gradients, covariance against repeated noisy measurements, and honest warnings."""

import copy
import itertools
import pickle
import re
import warnings

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym import Arm
from cra_sym.analysis.fit_search import Data, Search
from cra_sym.analysis.fit_unknowns import unknowns
from cra_sym.analysis.identification import AmbiguityWarning, IdentifiabilityWarning, MisfitWarning
from tests.campaigns import joints

NOMINAL = Arm.nominal()


def number_after(words, text):
    return float(re.search(re.escape(words) + r" ?([-+.e\d]+)", text)[1])


@pytest.mark.parametrize(
    ("k_t", "k_r", "length"), [(2e3, 40.0, 1.0), (50.0, 1e3, 1.0), (1e4, 5.0, 1.0), (20.0, 0.3, 1.0), (1.0, 4.0, 5.0)]
)
def test_exact_frequencies_give_the_joint_back(k_t, k_r, length):
    arm = NOMINAL.replace(L=length)
    estimate = cra.identify_joint(arm, cra.natural_frequencies(arm.replace(k_t=k_t, k_r=k_r), 4), 1e-3)
    # the search ends where the residuals are rounding: 1e-13 of the frequencies, times what a stiffness costs them
    assert (estimate.k_t, estimate.k_r) == (pytest.approx(k_t, rel=1e-9), pytest.approx(k_r, rel=1e-9))
    assert estimate.identifiable and estimate.fits and np.abs(estimate.residuals).max() < 1e-6
    deviation = [number_after(f"{name} is known to", estimate.message) for name in ("k_t", "k_r")]
    assert deviation == pytest.approx(estimate.log_standard_deviation, rel=0.06)  # printed with two digits


@pytest.mark.parametrize("place", [(2e-3, 0.1, 0.0), (1.5, 3.0, 0.2), (12.0, 0.7, -1.0)])
def test_the_gradient_is_exact(place):
    arm = NOMINAL.replace(L=0.8)
    parameters = unknowns(arm, ("k_t", "k_r", "E"), {"E": (7e10, 1e9)})
    search, place = Search(arm, parameters, 4), np.array(place)
    data = Data(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]), np.array([0, 1, 3]))
    found = search.gradient(place, data)
    assert found.shape == (4, 3)
    for i, direction in enumerate(np.eye(3) * 1e-5):
        slope = (search.residuals(place + direction, data) - search.residuals(place - direction, data)) / 2e-5
        # central differences of step h: h^2 / 6 times the third derivative, and rounding over h
        np.testing.assert_allclose(found[:, i], slope, rtol=1e-6, atol=1e-6 * np.abs(found).max())


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
    with pytest.warns(IdentifiabilityWarning, match="k_t is known to .*; k_r is only known to exceed"):
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
        ({"measured_frequencies": [15.0, 2.4]}, ValueError, r"measured_frequencies\[1\] = 2.4: must ascend"),
        ({"measured_frequencies": [0.0, 2.4]}, ValueError, r"measured_frequencies\[0\] = 0"),
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


@pytest.mark.parametrize(
    ("options", "number"), [({}, 3), ({"unknown": ("E", "rho", "k_t", "k_r")}, 4), ({"unknown": ("L", "E", "rho")}, 5)]
)
def test_a_valley_of_values_that_fit_alike_is_walked_once(options, number, monkeypatch):
    """Two dozen starts end in it; each was followed to its own end and linked to the others one by one."""
    calls, found = [], Search.found
    monkeypatch.setattr(Search, "found", lambda self, place: (calls.append(place.shape), found(self, place))[1])
    measured = cra.natural_frequencies(NOMINAL.replace(k_t=500.0, k_r=20.0), number)
    with pytest.warns(IdentifiabilityWarning):
        fit = cra.identify(NOMINAL, measured, [0.01, *[1e3] * (number - 1)], **options)
    assert fit.fits and len(fit.solutions) == 1
    assert len(calls) < 1000  # it took more than 10 000


def test_a_bound_is_two_standard_deviations_of_the_compliance_away():
    with pytest.warns(IdentifiabilityWarning) as caught:
        estimate = cra.identify_joint(NOMINAL, cra.natural_frequencies(NOMINAL.replace(k_t=1e4, k_r=1e4)), 0.05)
    least = number_after("k_r is only known to exceed", str(caught[0].message))
    deviation = np.sqrt(estimate.compliance_covariance[1, 1])
    assert (1 / least - 1 / estimate.k_r) / deviation == pytest.approx(2.0, rel=0.02)
    assert estimate.log_standard_deviation[1] == pytest.approx(deviation * estimate.k_r)


# Every fit, and none ----------------------------------------------------------------------------------------------

JOINT = NOMINAL.replace(k_t=2e3, k_r=40.0)
FREQUENCIES = cra.natural_frequencies(JOINT, 6)


def test_the_search_is_global():
    """A local search from the two best joints of a grid ends at 1.173 and 56.37 here, 200 sigma away."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit = cra.identify_joint(NOMINAL, cra.natural_frequencies(NOMINAL.replace(k_t=50.0, k_r=0.4)), 0.01)
    assert (fit.k_t, fit.k_r) == (pytest.approx(50.0, rel=1e-9), pytest.approx(0.4, rel=1e-9))
    assert fit.fits and len(fit.solutions) == 1 and fit.degrees_of_freedom == 1 and fit.p_value > 0.99


def test_two_joints_of_the_same_two_frequencies_are_both_returned():
    pairs = [(2.57, 8.28), (15.196, 0.9234)]
    first, second = (cra.natural_frequencies(NOMINAL.replace(k_t=k_t, k_r=k_r), 2) for k_t, k_r in pairs)
    np.testing.assert_allclose(first, second, rtol=5e-5)  # the second pair is known to four digits
    with pytest.warns(AmbiguityWarning, match=r"2 sets of values fit(?=.*k_t = 15\.19)(?=.*k_t = 2\.57)"):
        fit = cra.identify_joint(NOMINAL, first, 1e-3)
    found = sorted((solution.k_t, solution.k_r) for solution in fit.solutions)
    np.testing.assert_allclose(found, pairs, rtol=1e-3)
    assert np.isnan(fit.p_value) and fit.fits and fit.solutions[0].values == fit.values
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        third = cra.natural_frequencies(NOMINAL.replace(k_t=2.57, k_r=8.28), 3)
        assert cra.identify_joint(NOMINAL, third, 1e-3).k_t == pytest.approx(2.57, rel=1e-9)


@pytest.mark.parametrize("skipped", [2, 3])
def test_a_missed_mode_is_named(skipped):
    modes = [mode for mode in (1, 2, 3, 4, 5) if mode != skipped][:4]
    measured = cra.natural_frequencies(JOINT, 5)[np.array(modes) - 1]
    given = re.escape(f"give modes={tuple(modes)}")
    with pytest.warns(MisfitWarning, match=given), warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)
        assert not cra.identify_joint(NOMINAL, measured, 0.01).fits
    fit = cra.identify_joint(NOMINAL, measured, 0.01, modes=modes)
    assert fit.fits and fit.k_t == pytest.approx(2e3, rel=1e-9)


@pytest.mark.parametrize(
    ("measured", "said"),
    [
        (FREQUENCIES[[0, 2, 4, 5]], "give modes=(1, 3, 5, 6)"),  # the second and the fourth were missed
        (np.insert(FREQUENCIES[:4], 2, 30.0), "without measured_frequencies[2] = 30 Hz the others fit"),
    ],
)
def test_two_missed_modes_and_a_frequency_of_no_mode_are_named(measured, said):
    with pytest.warns(MisfitWarning, match=re.escape(said)) as caught, warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)
        assert not cra.identify_joint(NOMINAL, measured, 0.01).fits
    text = str(caught[0].message)
    assert text.count("give modes") + text.count("without") == 1, "nothing else explains them"


def test_either_of_two_frequencies_of_one_mode_may_be_left_out():
    measured = np.insert(FREQUENCIES[:4], 2, FREQUENCIES[1] + 1e-3)  # a tenth of the deviation apart
    words = r"without measured_frequencies\[1\] = .* or measured_frequencies\[2\] = .* the others fit"
    with pytest.warns(MisfitWarning, match=words), warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)
        cra.identify_joint(NOMINAL, measured, 0.01)


def test_a_wrong_model_does_not_fit_and_its_covariance_says_so():
    stiffer = JOINT.replace(E=1.05 * NOMINAL.E, m_e=0.05)
    measured = cra.natural_frequencies(stiffer, 4)
    with pytest.warns(MisfitWarning, match="no values of the unknown parameters fit: chi2 = 12[23]"):
        fit = cra.identify_joint(NOMINAL.replace(m_e=0.05), measured, 0.01)
    assert not fit.fits and not fit.identifiable and fit.p_value < 1e-20
    assert fit.log_standard_deviation[0] > 0.008  # 0.0012 if the model were right: sqrt(chi2 / 2) = 7.8 times that
    with_prior = cra.identify_joint(
        NOMINAL.replace(m_e=0.05), measured, 0.01, prior={"E": (NOMINAL.E, 0.05 * NOMINAL.E)}
    )
    assert with_prior.fits and with_prior.degrees_of_freedom == 2
    assert with_prior.values["E"] == pytest.approx(stiffer.E, rel=5e-3)
    assert with_prior.k_t == pytest.approx(2e3, rel=5e-3)


@pytest.mark.parametrize("frequencies", [[100.0, 200.0, 300.0], [1.0, 1.1, 1.2], [2.0, 1000.0]])
def test_what_no_joint_explains_is_said(frequencies):
    with pytest.warns(MisfitWarning, match="no values of the unknown parameters fit"), warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)
        fit = cra.identify_joint(NOMINAL, frequencies, 0.1)
    assert not fit.fits and not fit.identifiable and len(fit.solutions) == 1
    if fit.degrees_of_freedom == 0:
        assert np.isinf(fit.covariance).all()


@pytest.mark.parametrize(
    ("measured", "uncertainty", "said"),
    [
        (cra.natural_frequencies(JOINT, 4)[1:], 0.01, "give modes=(2, 3, 4)"),  # the first was missed
        (2 * np.pi * cra.natural_frequencies(JOINT, 2), 0.01, "no values"),  # rad/s taken for Hz
        (cra.natural_frequencies(NOMINAL, 2) * 1.05, 0.01, "fit: mode 2 is off by"),  # above those of a rigid joint
        ([1e6, 2e6], 1.0, "mode 2 is off by 2e+06 sigma"),
    ],
)
def test_neighbours_of_what_does_not_fit(measured, uncertainty, said):
    with pytest.warns(MisfitWarning, match=re.escape(said)), warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)
        fit = cra.identify_joint(NOMINAL, measured, uncertainty)
    assert not fit.fits and not fit.identifiable and len(fit.solutions) == 1


@pytest.mark.parametrize(("k_t", "k_r", "number"), [(0.5, 0.05, 3), (1e5, 0.05, 3), (0.5, 1e4, 3), (300.0, 1e4, 2)])
def test_neighbours_of_a_joint_that_a_local_search_misses(k_t, k_r, number):
    exact = cra.natural_frequencies(NOMINAL.replace(k_t=k_t, k_r=k_r), number)
    fit = cra.identify_joint(NOMINAL, exact, 1e-5 * exact)
    # what the frequencies tell of the stiffer spring: a hundredth of its deviation, and rounding of the search
    assert len(fit.solutions) == 1
    np.testing.assert_allclose([fit.k_t, fit.k_r], [k_t, k_r], rtol=1e-6, atol=0)


def test_extreme_sizes_make_no_warnings_of_numpy():
    """The square of the force at the root of a beam of E = 1e300 Pa overflowed."""
    with pytest.warns(UserWarning) as said:
        cra.identify_joint(NOMINAL.replace(E=1e300), [32.22], 0.1)
    assert {type(warning.message) for warning in said} <= {MisfitWarning, IdentifiabilityWarning}


def test_the_frequency_in_the_way_is_named():
    measured = cra.natural_frequencies(JOINT, 5)
    measured[1] *= 1.1
    with pytest.warns(MisfitWarning, match="without mode 2 they fit"), warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)
        cra.identify_joint(NOMINAL, measured, 0.01)


def test_any_parameters_of_any_system():
    """A string of unknown tension and end mass, against its own transcendental equation."""
    from scipy.optimize import brentq

    x, t, tension, mass, spring = sp.symbols("x t tension mass spring")
    y = sp.Function("y")(x, t)
    string = cra.Model(
        y.diff(t) ** 2 / 2 - tension * y.diff(x) ** 2 / 2, fields=[y], x=x, domain=(0, 1), t=t,
        left=-spring * y**2 / 2, right=mass * y.diff(t) ** 2 / 2,
    )  # fmt: skip
    # y = T b cos(b x) + k sin(b x) over T b, omega^2 = T b^2: T y'(1) = m omega^2 y(1)
    T, m, k = 4.0, 0.3, 25.0

    def end(b):
        value, slope = T * b * np.cos(b) + k * np.sin(b), b * (k * np.cos(b) - T * b * np.sin(b))
        return T * slope - m * T * b**2 * value

    grid = np.linspace(0.1, 12.0, 400)
    waves = [brentq(end, a, b, xtol=1e-15) for a, b in itertools.pairwise(grid) if end(a) * end(b) < 0][:4]
    measured = np.sqrt(T) * np.array(waves) / (2 * np.pi)
    start = string.at({"tension": 1.0, "mass": 0.0, "spring": 1.0})
    with pytest.warns(AmbiguityWarning, match="2 sets of values"):  # k b T and m swap their roles: (m, k), (T/k, T/m)
        both = cra.identify(start, measured, 1e-4, unknown=("tension", "mass", "spring"))
    found = sorted((list(solution.values.values()) for solution in both.solutions), key=lambda row: row[1])
    np.testing.assert_allclose(found, [[T, T / k, T / m], [T, m, k]], rtol=1e-6)
    fit = cra.identify(start, measured, 1e-4, unknown=("tension", "spring"), prior={"mass": (m, 0.01 * m)})
    assert list(fit.values) == ["tension", "spring", "mass"] and fit.fits
    np.testing.assert_allclose(list(fit.values.values()), [T, k, m], rtol=1e-6)
    assert fit.covariance.shape == (3, 3) and fit.degrees_of_freedom == 2


def test_a_prior_of_what_is_known_better_than_the_data_stays():
    fit = cra.identify(
        NOMINAL, cra.natural_frequencies(JOINT, 3), 0.01, unknown=("k_t", "k_r"), prior={"m_e": (0.001, 1e-9)}
    )
    assert fit.values["m_e"] == pytest.approx(0.001, rel=1e-5)
    assert np.sqrt(fit.covariance[2, 2]) == pytest.approx(1e-9, rel=1e-3)


@pytest.mark.sample(12, 1)
@pytest.mark.parametrize("trial", range(25))
def test_the_true_joint_is_among_the_solutions(trial):
    assert joints.good(joints.tried(trial))


def test_a_parameter_the_frequencies_do_not_depend_on_is_named():
    with pytest.warns(IdentifiabilityWarning, match="the frequencies do not depend on m_b"):
        cra.identify(NOMINAL, cra.natural_frequencies(NOMINAL, 1), 0.1, unknown=("m_b",))


def test_measured_and_uncertainty_are_paired_by_label():
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    measured, sigma = FREQUENCIES[:3], [0.01, 0.02, 0.03]
    expected = cra.identify_joint(NOMINAL, measured, sigma)
    series = pandas.Series(measured, index=[1, 2, 3])
    found = cra.identify_joint(NOMINAL, series, pandas.Series(sigma, index=[1, 2, 3]), modes=series.index)
    assert found == expected
    label = xarray.DataArray(measured, dims="mode", coords={"mode": [1, 2, 3]})
    for other, message in (
        (pandas.Series(sigma, index=[3, 2, 1]), "uncertainty: its index is not that of measured_frequencies"),
        (label[::-1], "dimension 'mode': its coordinate in measured_frequencies is not that in uncertainty"),
        (label.rename(mode="m"), r"uncertainty has the dimensions \('m',\): must have those of measured_frequencies"),
    ):
        with pytest.raises(ValueError, match=message):
            cra.identify_joint(NOMINAL, series if "index" in message else label, other)


def test_a_fit_is_a_value():
    measured = cra.natural_frequencies(JOINT)
    one, two = (cra.identify_joint(NOMINAL, measured, 0.01) for _ in range(2))
    assert one == two and pickle.loads(pickle.dumps(one)) == one and copy.deepcopy(one) == one
    assert one != cra.identify_joint(NOMINAL, measured, 0.02)


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"unknown": "k_t"}, TypeError, "unknown = 'k_t': must be a sequence"),
        ({"unknown": ("k_x",)}, ValueError, "unknown = 'k_x': must be among L, b"),
        ({"unknown": ()}, ValueError, "must be 1 to 6 names"),
        ({"modes": (1, 1)}, ValueError, r"modes = \(1, 1\): must be 2 different modes"),
        ({"modes": (2, 1)}, ValueError, "ascending"),
        ({"modes": (0, 1)}, ValueError, "modes = 0"),
        ({"modes": 2}, TypeError, "modes = 2: must be a sequence"),
        ({"modes": (1, 2, 3)}, ValueError, "must be 2 different modes"),
        ({"prior": {"E": 7e10}}, ValueError, "prior: E = .*its positive uncertainty"),
        ({"prior": {"E": (7e10, 0.0)}}, ValueError, "prior: E = .*its positive uncertainty"),
        ({"prior": {"Q": (1.0, 1.0)}}, ValueError, "prior: 'Q' must be among"),
        ({"prior": [("E", 1.0)]}, TypeError, "prior = .*must be a mapping"),
    ],
)
def test_bad_options_are_named(options, error, words):
    with pytest.raises(error, match=words):
        cra.identify(NOMINAL, [2.4, 15.0], 0.1, **options)


def test_an_estimate_reads_as_values_and_uncertainties():
    arm = cra.Arm.nominal().replace(k_t=1e4, k_r=100.0)
    text = repr(cra.identify_joint(arm, cra.natural_frequencies(arm), 0.01))
    assert text.startswith("<JointEstimate: k_t = 10000 +- ") and "k_r = 100 +- " in text and "; fits, p = " in text


def test_costly_frequencies_have_fewer_starts():
    """Two beams on a layer took minutes: two hundred lowest points of the grid were followed beside its minima."""
    x, t, EI, B, k = sp.symbols("x t EI B k")
    v, u = (sp.Function(name)(x, t) for name in ("v", "u"))
    density = v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2 + u.diff(t) ** 2 / 4 - B * u.diff(x, 2) ** 2 / 2
    held = [one.subs(x, 0) for f in (v, u) for one in (f, f.diff(x))]
    pair = cra.Model(density - k * (v - u) ** 2 / 2, fields=[v, u], x=x, domain=(0, 1), t=t, essential=held)
    given = pair.at({"EI": 2.0, "B": 0.7, "k": 40.0})
    counts = []
    for one in (given, NOMINAL):
        search = Search(one, unknowns(one, ("EI", "k") if one is given else ("k_t", "k_r"), {}), 3)
        data = Data(cra.natural_frequencies(one, 3), np.full(3, 1e-4), np.arange(3))
        _, known, shape = search._grid()
        starts = search._starts(data)
        weighted = np.sum(((known - data.measured) / data.sigma) ** 2, axis=-1).reshape(shape)
        least = np.unravel_index(weighted.argmin(), shape)  # the lowest minimum is a start of every search
        assert (starts == search._grid()[0].reshape(*shape, -1)[least]).all(axis=-1).any()
        counts.append(len(starts))
    assert counts[0] < 60 < 200 <= counts[1]
