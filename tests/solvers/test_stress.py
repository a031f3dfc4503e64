"""Ritz's method on the stresses against transfer matrices in 30 digits and against shooting; its estimate."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.optimize import brentq

from cra_sym.solvers.continuum import Continuum
from cra_sym.solvers.stress import Columns
from cra_sym.solvers.stress_mesh import Mesh
from cra_sym.solvers.stress_refine import solved
from cra_sym.solvers.stress_spectrum import spectrum
from cra_sym.solvers.stress_tail import complete, tail

SEED = 20260714
TARGET = 2e-11  # relative error of squared frequencies


def continuum(coefficients, edges, springs, masses, order=2):
    """One parameter set; springs and masses of (v, v_x) left, then right."""
    size = 2 * order

    def entries(x, rows):
        found = {name: {} for name in "WBDRM"}
        for (name, i), function in coefficients.items():
            found[name][i, i] = function(x)
        return found

    directions, stiffness = np.eye(size)[None], np.array([springs], dtype=float)
    mass = np.diag(masses)[None]
    return Continuum((order,), 0, entries, np.array([edges], dtype=float), directions, stiffness, mass)


def frequencies(problem, modes, target=TARGET):
    (found,) = solved(problem, modes, 10 * TARGET, target)
    return np.sqrt(found.fields.z[0]), float(found.accuracy[0]), found


# stepped beams: transfer matrices -------------------------------------------------------------------------------------


def segment(length, bending, mass, omega):
    """Transfer matrix of (v, v', M, Q) with M = EI v'', Q = -EI v''' over a uniform piece."""
    b = mp.sqrt(mp.sqrt(mass * omega**2 / bending))
    z = b * length
    c1, c2 = (mp.cosh(z) + mp.cos(z)) / 2, (mp.cosh(z) - mp.cos(z)) / 2
    s1, s2 = (mp.sinh(z) + mp.sin(z)) / 2, (mp.sinh(z) - mp.sin(z)) / 2
    k = bending
    return mp.matrix(
        [
            [c1, s1 / b, c2 / (k * b**2), -s2 / (k * b**3)],
            [b * s2, c1, s1 / (k * b), -c2 / (k * b**2)],
            [k * b**2 * c2, k * b * s2, c1, -s1 / b],
            [-k * b**3 * s1, -k * b**2 * c2, -b * s2, c1],
        ]
    )


def stepped_condition(omega, lengths, bendings, masses, spring, tip):
    """Determinant of the end conditions: springs at the left end, a mass at the right."""
    state = mp.matrix([[1, 0], [0, 1], [0, spring[1]], [spring[0], 0]])
    for piece in zip(lengths, bendings, masses, strict=True):
        state = segment(*map(mpf, piece), omega) * state
    shear, moment = (state[3, k] - tip * omega**2 * state[0, k] for k in (0, 1)), (state[2, k] for k in (0, 1))
    (a, b), (c, d) = shear, moment
    return a * d - b * c


def stepped(generator):
    number = int(generator.integers(2, 10))
    lengths = generator.uniform(0.1, 1.0, number)
    lengths /= lengths.sum()
    bendings, masses = 10 ** generator.uniform(-1.5, 1.5, number), 10 ** generator.uniform(-1.0, 1.0, number)
    spring = 10 ** generator.uniform(-4, 8, 2)
    return lengths, bendings, masses, spring, float(10 ** generator.uniform(-2, 1))


@pytest.mark.parametrize("number", range(20))
def test_random_stepped_beams_against_transfer_matrices(number):
    lengths, bendings, masses, spring, tip = stepped(np.random.default_rng(SEED + number))
    edges = np.concatenate([[0.0], np.cumsum(lengths)])
    edges[-1] = 1.0

    def pick(values):
        return lambda x: values[np.clip(np.searchsorted(edges, x) - 1, 0, len(values) - 1)]

    problem = continuum({("W", 0): pick(bendings), ("M", 0): pick(masses)}, edges, [*spring, 0, 0], [0, 0, tip, 0])
    found, accuracy, _ = frequencies(problem, 3)
    with mp.workdps(30):
        data = (*map(list, (np.diff(edges), bendings, masses)), list(map(mpf, spring)), mpf(tip))
        roots = [mpf(float(w)) for w in found]
        for w in roots:
            h = w * mpf(10) ** -12
            values = [stepped_condition(w + d, *data) for d in (-h, 0, h)]
            error = abs(values[1] * 2 * h / (values[2] - values[0])) / w
            assert error < 1e-10
            assert error < max(10 * accuracy, 1e-12)
        signs = []
        for low, high in zip([mpf(10) ** -3 * roots[0], *roots], roots, strict=False):
            inner = [low + (high - low) * (mpf(k) + mpf(1) / 1000) / 10 for k in range(10)]
            signs += [int(mp.sign(stepped_condition(w, *data))) for w in inner]
    assert np.count_nonzero(np.diff(signs)) == 2  # across the first and the second root: no other lies below the third


# smooth profiles: shooting --------------------------------------------------------------------------------------------


def smooth(generator):
    """Bending stiffness, mass and tension: exponentials of a short Fourier series, so positive and smooth."""

    def profile(size):
        amplitude, phase = generator.normal(0.0, size, 3), generator.uniform(0.0, 2 * np.pi, 3)
        return lambda x: np.exp(sum(amplitude[k] * np.sin((k + 1) * np.pi * x + phase[k]) for k in range(3)))

    tension, load = profile(0.5), generator.uniform(-0.5, 20.0)
    return profile(0.7), profile(0.5), lambda x: load * tension(x)


def shot(omega, bending, mass, tension):
    """Determinant of the free end of a clamped beam, by DOP853 on (v, v', M, Q)."""

    def rate(x, state):
        v, slope, moment, shear = state.reshape(4, 2)
        # shear Q = M' - T v' of a beam pulled by T; Q' = rho A omega^2 v in this sign
        return np.concatenate([slope, moment / bending(x), shear + tension(x) * slope, mass(x) * omega**2 * v])

    start = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]).ravel()
    last = solve_ivp(rate, (0.0, 1.0), start, method="DOP853", rtol=3e-14, atol=1e-14).y[:, -1].reshape(4, 2)
    return last[2, 0] * last[3, 1] - last[2, 1] * last[3, 0]


@pytest.mark.parametrize("number", range(20))
def test_random_smooth_profiles_against_shooting(number):
    bending, mass, tension = smooth(np.random.default_rng(SEED + 100 + number))
    inf = np.inf
    problem = continuum({("W", 0): bending, ("M", 0): mass, ("R", 1): tension}, [0.0, 1.0], [inf, inf, 0, 0], [0.0] * 4)
    found, accuracy, _ = frequencies(problem, 3)
    assert accuracy < 1e-10
    grid = np.linspace(0.02 * found[0], found[2] * 1.001, 40)
    signs = np.sign([shot(w, bending, mass, tension) for w in grid])
    assert np.count_nonzero(np.diff(signs)) == 3
    for w in found:  # the reference has an error of some 1e-12 itself
        h = 1e-6 * w
        values = [shot(w + d, bending, mass, tension) for d in (-h, 0.0, h)]
        assert abs(values[1] * 2 * h / (values[2] - values[0])) / w < 2e-10


# the estimate ---------------------------------------------------------------------------------------------------------


def test_the_estimate_is_of_the_size_of_the_error():
    """On one element of few degrees, against the same with many."""
    from cra_sym.solvers.stress import Columns
    from cra_sym.solvers.stress_mesh import Mesh
    from cra_sym.solvers.stress_modes import ModeFields
    from cra_sym.solvers.stress_spectrum import spectrum

    generator = np.random.default_rng(SEED)
    ratios = []
    for _ in range(12):
        bending, mass, tension = smooth(generator)
        problem = continuum(
            {("W", 0): bending, ("M", 0): mass, ("R", 1): tension}, [0.0, 1.0], [np.inf, np.inf, 0, 0], [0.0] * 4
        )
        exact = frequencies(problem, 4, 1e-20)[0] ** 2
        for degree in (5, 6, 7, 8):
            pieces = np.linspace(0.0, 1.0, 9)
            columns = Columns(problem, Mesh(pieces, np.array([0.0, 1.0]), degree, np.zeros(1, dtype=bool)))
            found = spectrum(columns, 4)
            estimate = 2.0 * ModeFields(columns, found.z, found.vectors).residual.sum(axis=-1)[0]
            error = found.z[0] / exact - 1
            assert (error > -1e-12).all()  # from above
            ratios += list((estimate / error)[error > 1e-11])
    assert np.quantile(ratios, 0.01) > 0.5
    assert np.median(ratios) < 30


def test_compliances_far_apart_keep_their_digits():
    """A tip mass of a million on a spring of 1e-12, and stiff ends: against a root in 40 digits."""
    ones = {("W", 0): np.ones_like, ("M", 0): np.ones_like}
    for spring, tip in ((1e-12, 1e6), (1e14, 1e-6), (1e-6, 1e3)):
        found, _, _ = frequencies(continuum(ones, [0.0, 1.0], [spring, np.inf, 0, 0], [0, 0, tip, 0]), 3)
        with mp.workdps(40):
            for w in map(mpf, map(float, found)):

                def condition(omega, spring=spring, tip=tip):
                    last = segment(mpf(1), mpf(1), mpf(1), omega) * mp.matrix([[1, 0], [0, 0], [0, 1], [spring, 0]])
                    (a, b), (c, d) = (
                        [last[3, k] - tip * omega**2 * last[0, k] for k in (0, 1)],
                        [last[2, k] for k in (0, 1)],
                    )
                    return a * d - b * c

                h = w * mpf(10) ** -15
                error = abs(condition(w) * 2 * h / (condition(w + h) - condition(w - h))) / w
                assert error < 1e-11


# completeness ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [4, 6, 8, 11])
@pytest.mark.parametrize("order", [1, 2])
def test_compliances_lie_between_those_of_the_basis_and_what_it_leaves_out(order, degree):
    """A uniform string or beam, in up to three elements: exact ones are never more than the bound beyond the basis."""
    essential = [np.inf] * order + [0.0] * order
    problem = continuum(
        {("W", 0): np.ones_like, ("M", 0): np.ones_like}, [0.0, 1.0], essential, [0.0] * 2 * order, order
    )
    if order == 1:
        exact = 1.0 / (np.pi * (np.arange(40) + 0.5)) ** 2
    else:
        roots = [1.875104068711961, 4.694091132974175, 7.854757438237613, 10.995540734875467, 14.13716839104647]
        k = np.array([*roots, *(np.pi * (np.arange(5, 40) + 0.5))])
        exact = k**-4.0
    for elements in (np.array([0.0, 1.0]), np.array([0.0, 0.25, 0.5, 1.0])):
        mesh = Mesh(elements, elements, degree, np.zeros(len(elements) - 1, dtype=bool), 0)
        columns = Columns(problem, mesh)
        bound = float(tail(columns)[0].max())
        found = spectrum(columns, 1).compliances[0]
        assert (found <= exact[: len(found)] * (1 + 1e-6)).all()  # roots from the sixth on are asymptotic
        assert (exact[: len(found)] <= found + bound).all()
        if len(elements) == 2:
            assert bound < 12.0 * exact[degree]  # and it is not much larger than what is really left out


PULLED = {("W", 0): np.ones_like, ("M", 0): lambda x: 1 + x, ("R", 1): lambda x: 30 * (1 - x), ("R", 0): lambda x: -x}
SLACK = {("W", 0): lambda x: 1e-3 + 1 - x**2, ("M", 0): np.ones_like, ("R", 0): lambda x: 5 + x}


@pytest.mark.parametrize(("coefficients", "order"), [(PULLED, 2), (SLACK, 1)], ids=["tension", "vanishing stiffness"])
@pytest.mark.parametrize("degree", [4, 9])
def test_what_is_left_out_is_bounded_with_potentials_too(coefficients, order, degree):
    """In the motions of 26 further degrees that cost no strain energy together with the basis."""
    fixed = [np.inf] * order + [0.0] * order
    problem = continuum(coefficients, [0.0, 1.0], fixed, [0.0] * 2 * order, order)
    pieces = 1.0 - np.array([1.0, 0.1, 0.01, 1e-3, 1e-4, 0.0])
    for elements in (np.array([0.0, 1.0]), np.array([0.0, 0.9, 1.0])):
        strained = np.zeros(len(elements) - 1, dtype=bool)
        wide, narrow = (Columns(problem, Mesh(pieces, elements, p, strained, 31)) for p in (degree + 26, degree))
        inside, stiffness = narrow.size, wide.elastic_stiffness[0]
        basis, rest = np.arange(order, inside), np.arange(inside, wide.size)
        mixed = np.linalg.solve(stiffness[np.ix_(basis, basis)], stiffness[np.ix_(basis, rest)])
        motions = np.zeros((wide.size, len(rest)))
        motions[rest, np.arange(len(rest))] = 1.0
        motions[basis] = -mixed
        energy = motions.T @ stiffness @ motions
        for bound, matrix in zip(tail(narrow), (wide.mass[0], wide.potential_size[0]), strict=True):
            largest = eigh(motions.T @ matrix @ motions, energy, eigvals_only=True)[-1]
            assert largest <= bound.max() < 60.0 * largest


def test_completeness_is_proved_by_a_gap_or_is_open():
    compliances = np.array([[1.0, 0.5, 0.4999, 0.1], [1.0, 0.5, 0.4999, 0.1]])
    elastic, none = np.array([2, 3]), np.zeros(2)
    for left_out, proved in ((0.3, True), (0.45, False)):
        found = complete(compliances, elastic, np.full(2, left_out), none, none)
        np.testing.assert_array_equal(found, [proved, proved])
    assert complete(compliances[:1], np.array([0]), np.array([9.0]), none[:1], none[:1]).all()
    # a potential takes its share of the gap; one that is not known proves nothing
    for load, loading, proved in ((1.0, 1e-3, True), (1.0, 0.9, False), (1e3, 1e-3, False), (np.inf, 1e-9, False)):
        found = complete(compliances[:1], elastic[:1], np.array([0.1]), np.array([loading]), np.array([load]))
        assert found.all() == proved


def test_a_mode_that_a_count_does_not_find_is_not_silent():
    """On a foundation of 1e6 frequencies lie so close that they are counted: one more, and elements get finer.

    As fine as needed for the basis to prove by itself that none is missing.
    """
    stiff = {("W", 0): np.ones_like, ("M", 0): np.ones_like, ("R", 0): lambda x: np.full_like(x, 1e6)}
    problem = continuum(stiff, [0.0, 1.0], [np.inf] * 2 + [0.0] * 2, [0.0] * 4)
    asked = []

    def counted(rows, z):
        asked.append(z)
        return np.array([np.count_nonzero(np.append(exact, np.inf) < below) for below in z])

    k = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613, 10.995540734875467, 14.13716839104647])
    exact = np.append(k, np.pi * (np.arange(5, 20) + 0.5)) ** 4 + 1e6
    (found,) = solved(problem, 4, 2e-10, 2e-11, counted=counted)
    np.testing.assert_allclose(found.fields.z[0], exact[:4], rtol=1e-11)
    assert asked
    right, exact = exact, np.append(exact[0], exact)
    (other,) = solved(problem, 4, 2e-10, 2e-11, counted=counted)
    np.testing.assert_allclose(other.fields.z[0], right[:4], rtol=1e-11)
    assert other.fields.columns.size > found.fields.columns.size


def test_a_mode_that_the_first_basis_cannot_hold_is_found():
    """A soft heavy spot of the width 1e-4: its own modes are the lowest, and none of them is missed."""
    left, right, soft, heavy = 0.3, 0.3001, 1e-7, 1e6
    inside = {"W": lambda x: np.where((x > left) & (x < right), soft, 1.0)}
    inside["M"] = lambda x: np.where((x > left) & (x < right), heavy, 1.0)
    edges = [0.0, left, right, 1.0]
    problem = continuum({("W", 0): inside["W"], ("M", 0): inside["M"]}, edges, [np.inf, np.inf], [0.0, 0.0], 1)
    omega, _, _ = frequencies(problem, 4)

    def condition(w):
        state = np.array([0.0, 1.0])
        for width, tension, mass in ((left, 1.0, 1.0), (right - left, soft, heavy), (1.0 - right, 1.0, 1.0)):
            k = w * np.sqrt(mass / tension)
            c, s = np.cos(k * width), np.sin(k * width)
            state = np.array([c * state[0] + s * state[1] / (tension * k), -tension * k * s * state[0] + c * state[1]])
        return state[0]

    grid = np.linspace(1e-3, 1.05 * omega[-1], 40001)
    signs = np.sign([condition(w) for w in grid])
    assert np.count_nonzero(np.diff(signs)) == 4
    exact = [brentq(condition, *grid[k : k + 2], xtol=1e-16) for k in np.nonzero(np.diff(signs))[0]]
    np.testing.assert_allclose(omega, exact, rtol=1e-9)
