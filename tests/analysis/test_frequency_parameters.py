"""Frequency parameters: every digit against mpmath, completeness against finite elements, limits and theorems."""

import importlib.util
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

from cra_sym import frequency_parameters
from cra_sym.codegen.arm_family import arm_family
from cra_sym.kernels import has_compiler

_spec = importlib.util.spec_from_file_location("reference", Path(__file__).with_name("reference.py"))
reference = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(reference)

EXTREMES = (0.0, 1e-9, 1.0, 1e3, 1e12, np.inf)


def random_arms(seed, size, stiffest=12.0, heaviest=6.0):
    """Arms log-uniform over the whole range, about a third of the values at its ends."""
    rng = np.random.default_rng(seed)

    def draw(high, ends):
        values = 10.0 ** rng.uniform(-9, high, size)
        return np.where(rng.random(size) < 0.3, rng.choice(ends, size), values)

    stiff = (0.0, np.inf, 1e-9, 10.0**stiffest)
    heavy = (0.0, 0.0, 10.0**heaviest)
    return draw(stiffest, stiff), draw(stiffest, stiff), draw(heaviest, heavy), draw(heaviest, heavy)


def test_every_digit_of_random_extreme_arms():
    arms = random_arms(1, 80)
    errors = reference.relative_errors(frequency_parameters(*arms, modes=5), *arms)
    assert errors.size > 350 and errors.max() < 1e-15


def test_every_digit_of_structured_extreme_arms():
    grid = np.meshgrid(EXTREMES, EXTREMES, (0.0, 1e6), (0.0, 1e6), indexing="ij")
    lam = frequency_parameters(*grid, modes=3)
    assert lam.shape == (6, 6, 2, 2, 3)
    assert reference.relative_errors(lam, *grid).max() < 1e-15


def test_every_digit_of_two_frequencies_next_to_each_other():
    """A tip that is hard to turn, and springs that make both slow modes meet: the determinant alone left 1e-12."""
    rng = np.random.default_rng(7)
    iota, mu, kappa_r = 10.0 ** rng.uniform([[3], [-3], [-3]], [[9], [3], [3]], (3, 60))
    kappa_r[:5] = np.inf
    with np.errstate(invalid="ignore"):
        turning = np.where(np.isinf(kappa_r), 1.0, kappa_r / (1 + kappa_r)) / iota
    arms = turning * (1 + mu) * (1 + 10.0 ** rng.uniform(-9, -2, 60)), kappa_r, mu, iota
    lam = frequency_parameters(*arms, modes=2)
    assert np.median(lam[:, 1] / lam[:, 0] - 1) < 1e-2
    assert reference.relative_errors(lam, *arms).max() < 1e-15
    whole = [np.repeat(x, 2600) for x in arms]  # many enough for the compiled path
    np.testing.assert_allclose(frequency_parameters(*whole, modes=2)[::2600], lam, rtol=1e-15)


@pytest.mark.parametrize("arm", [(np.inf, np.inf, 0.0, 0.0), (3e5, 20.0, 0.3, 0.01), (0.0, 1e-9, 1e6, 0.0)])
def test_every_digit_of_the_thousandth_mode(arm):
    lam = frequency_parameters(*arm, modes=1000)
    assert (np.diff(lam) > 0).all()
    chosen = [199, 499, 998, 999]
    assert reference.relative_errors(lam[chosen], *arm).max() < 1e-15


def tip_mass(b):
    return 1 + mp.cos(b) * mp.cosh(b) - mp.mpf(0.7) * b * (mp.sin(b) * mp.cosh(b) - mp.cos(b) * mp.sinh(b))


def classical(equation, guesses):
    with mp.workdps(30):
        return [float(mp.findroot(equation, guess)) for guess in guesses]


@pytest.mark.parametrize(
    ("arm", "zeros", "equation", "first"),
    [
        ((np.inf, np.inf, 0.0), 0, lambda b: mp.cos(b) * mp.cosh(b) + 1, [1.9, 4.7, 7.9]),
        ((0.0, 0.0, 0.0), 2, lambda b: mp.cos(b) * mp.cosh(b) - 1, [4.7, 7.9, 11.0]),
        ((np.inf, 0.0, 0.0), 1, lambda b: mp.tan(b) - mp.tanh(b), [3.9, 7.1, 10.2]),
        ((0.0, np.inf, 0.0), 1, lambda b: mp.tan(b) + mp.tanh(b), [2.4, 5.5, 8.6]),
        ((np.inf, np.inf, 0.7), 0, tip_mass, [1.3, 4.0, 7.2]),
    ],
    ids=["clamped", "free", "pinned", "sliding", "tip mass"],
)  # fmt: skip
def test_classical_beams(arm, zeros, equation, first):
    lam = frequency_parameters(*arm, modes=zeros + 3)
    assert (lam[:zeros] == 0).all()
    np.testing.assert_allclose(lam[zeros:], classical(equation, first), rtol=1e-15)


def finite_elements(kappa_t, kappa_r, mu, iota, elements=24):
    """Frequency parameters by cubic Hermite elements: lam^4 of a dense generalised eigenproblem, an upper bound."""
    h = 1 / elements
    stiffness = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h],
                          [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]) / h**3  # fmt: skip
    mass = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h],
                     [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]) * h / 420  # fmt: skip
    K, M = np.zeros((2, 2 * elements + 2, 2 * elements + 2))
    for e in range(elements):
        K[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += stiffness
        M[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += mass
    K[0, 0] += kappa_t
    K[1, 1] += kappa_r
    M[-2, -2] += mu
    M[-1, -1] += iota
    return np.maximum(eigh(K, M, eigvals_only=True), 0) ** 0.25


def test_none_is_missed_against_finite_elements():
    rng = np.random.default_rng(2)
    arms = 10 ** rng.uniform(-1, 4, 60), 10 ** rng.uniform(-1, 4, 60), rng.uniform(0, 2, 60), rng.uniform(0, 0.5, 60)
    lam = frequency_parameters(*arms, modes=8)
    for row, *arm in zip(lam, *arms, strict=True):
        np.testing.assert_allclose(row, finite_elements(*arm)[:8], rtol=2e-3)


def test_published_frequencies_of_the_rigid_arm():
    scale = 4.37399 / (2 * np.pi)
    np.testing.assert_allclose(scale * frequency_parameters(np.inf, np.inf, 0) ** 2, [2.448, 15.339, 42.95], atol=6e-4)


def test_rigid_body_zeros():
    for kappa_t, kappa_r, zeros in ((0, 0, 2), (0, 5, 1), (5, 0, 1), (0, np.inf, 1), (np.inf, 0, 1), (5, 5, 0)):
        lam = frequency_parameters(kappa_t, kappa_r, 1e6, 1e-6, modes=4)
        assert np.count_nonzero(lam == 0) == zeros and (np.diff(lam[zeros:]) > 0).all()


def test_nearly_rigid_modes_follow_the_rigid_arm_on_its_springs():
    """Two soft springs: the lowest two modes are those of a rigid bar with mass mu and inertia iota at the tip."""
    kappa_t, kappa_r, mu, iota = 3e-9, 1e-9, 4.0, 2.0
    K = np.diag([kappa_t, kappa_r])
    M = np.array([[1 + mu, 0.5 + mu], [0.5 + mu, 1 / 3 + mu + iota]])
    expected = eigh(K, M, eigvals_only=True) ** 0.25
    # what the bar bends is of the order of kappa / 3; the two squares are within a factor of 30
    np.testing.assert_allclose(frequency_parameters(kappa_t, kappa_r, mu, iota, modes=2), expected, rtol=1e-9)


@pytest.mark.parametrize("which", [0, 1])
def test_continuous_through_zero_and_infinite_stiffness(which):
    def at(kappa):
        pair = [7.0, 7.0]
        pair[which] = kappa
        return frequency_parameters(*pair, 0.2, modes=6)

    np.testing.assert_allclose(at(1e-14), at(0.0), atol=1e-3)  # the lowest is of the size of 1e-14 ** (1/4) = 3e-4
    np.testing.assert_allclose(at(1e14), at(np.inf), rtol=1e-9)
    assert (at(1e300) == at(np.inf)).all() or np.abs(at(1e300) / at(np.inf) - 1).max() < 1e-15


stiffnesses = st.one_of(st.sampled_from([0.0, np.inf]), st.floats(-9, 12).map(lambda x: 10.0**x))
inertias = st.one_of(st.just(0.0), st.floats(-9, 6).map(lambda x: 10.0**x))
arms = st.tuples(stiffnesses, stiffnesses, inertias, inertias)
ROUNDING = 1 + 1e-14


@settings(max_examples=60, deadline=None, derandomize=True)
@given(arms, st.integers(0, 3), st.floats(1.01, 1e3))
def test_monotonic_and_interlaced(arm, which, factor):
    """More stiffness raises, more inertia lowers, and by a change of rank one never beyond the neighbour."""
    changed = list(arm)
    changed[which] = changed[which] * factor + (changed[which] == 0) * factor
    low, high = frequency_parameters(*arm, modes=6), frequency_parameters(*changed, modes=6)
    if which > 1:
        low, high = high, low
    assert (low <= high * ROUNDING).all()
    assert (high[:-1] <= low[1:] * ROUNDING).all()


@settings(max_examples=40, deadline=None, derandomize=True)
@given(arms)
def test_distinct_whatever_the_arm(arm):
    lam = frequency_parameters(*arm, modes=12)
    zeros = (arm[0] == 0) + (arm[1] == 0)
    assert np.count_nonzero(lam == 0) == zeros and (np.diff(lam[zeros:]) > 0).all()


def test_more_modes_and_batches_change_nothing():
    arms = random_arms(3, 50)
    lam = frequency_parameters(*arms, modes=9)
    np.testing.assert_allclose(frequency_parameters(*arms, modes=2), lam[:, :2], rtol=1e-15)
    one_by_one = [frequency_parameters(*arm, modes=9) for arm in zip(*arms, strict=True)]
    np.testing.assert_allclose(one_by_one, lam, rtol=1e-15)  # each is right to two units in the last place


def test_broadcasting():
    lam = frequency_parameters([[1.0], [2.0]], [1.0, np.inf, 0.0], 0.1, modes=4)
    assert lam.shape == (2, 3, 4)
    np.testing.assert_allclose(lam[1, 2], frequency_parameters(2.0, 0.0, 0.1, modes=4), rtol=1e-15)
    assert frequency_parameters(np.ones((0, 2)), 1.0, 0.0).shape == (0, 2, 3)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((-0.05, 1.0, 0.0), ValueError, "kappa_t = -0.05"),
        ((1.0, np.nan, 0.0), ValueError, "kappa_r = nan"),
        ((1.0, 1.0, np.inf), ValueError, "mu = inf"),
        ((1.0, 1.0, 0.0, -0.05), ValueError, "iota = -0.05"),
        (("stiff", 1.0, 0.0), TypeError, "kappa_t = 'stiff'"),
        (([1.0, 2.0], [1.0, 2.0, 3.0], 0.0), ValueError, "do not broadcast"),
        ((1.0, 1.0, 0.0, 0.0, 0), ValueError, "modes = 0"),
        ((1.0, 1.0, 0.0, 0.0, 1001), ValueError, "modes = 1001"),
        ((1.0, 1.0, 0.0, 0.0, 1.5), ValueError, "modes = 1.5"),
        ((1.0, 1.0, 0.0, 0.0, "3"), TypeError, "modes = '3'"),
    ],
)
def test_bad_input(arguments, error, message):
    with pytest.raises(error, match=message):
        frequency_parameters(*arguments)


@pytest.mark.skipif(not has_compiler(), reason="llvmlite is an option")
@pytest.mark.parametrize("modes", [1, 3, 12])
def test_compiled_and_numpy_paths_agree(modes):
    arms = random_arms(4, 1500)
    one, two = (arm_family().frequency_parameters(*arms, modes=modes, compile=c, threads=2) for c in (True, False))
    assert ((one == 0) == (two == 0)).all()
    np.testing.assert_allclose(one, two, rtol=2e-15)


@pytest.mark.skipif(not has_compiler(), reason="llvmlite is an option")
def test_every_digit_of_the_compiled_path():
    arms = random_arms(6, 40)
    lam = arm_family().frequency_parameters(*arms, modes=4, compile=True)
    assert reference.relative_errors(lam, *arms).max() < 1e-15
    high = arm_family().frequency_parameters(*(x[:3] for x in arms), modes=1000, compile=True)[:, [300, 999]]
    assert reference.relative_errors(high, *(x[:3] for x in arms)).max() < 1e-15
