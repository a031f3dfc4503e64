"""Floquet multipliers: against Hill's determinant, Mathieu's characteristic values and general integration."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import linear_sum_assignment
from scipy.special import mathieu_a, mathieu_b

from cra_sym.solvers import periodic
from cra_sym.solvers.floquet import Oscillation
from cra_sym.solvers.hill import hill_exponents


def random_system(seed: int):
    rng = np.random.default_rng(seed)
    modes = int(rng.integers(1, 5))
    coupling = 3.0 * rng.normal(size=(modes, modes))
    if seed % 2:
        coupling = coupling + coupling.T
    decay = rng.uniform(0.0, 0.1, modes) * (seed % 3 > 0)
    return np.sort(rng.uniform(1.0, 10.0, modes)), coupling, rng.uniform(1.5, 25.0), rng.uniform(0.0, 0.5), decay


def oscillators(omega, coupling, angular_frequency, epsilon, decay=0.0, compliance=None):
    """Return the arguments of the solver for modes with damping of their own, whose stiffness oscillates."""
    omega, coupling = np.asarray(omega), np.asarray(coupling)
    unit, decay = (
        np.eye(omega.shape[-1]),
        np.broadcast_to(decay, np.broadcast_shapes(np.shape(decay), omega.shape[-1:])),
    )
    drives = [(Oscillation(1, "cos", 0), (part, None, None, None)) for part in np.moveaxis(coupling, -3, 0)]
    return omega[..., None] ** 2 * unit, 2 * decay[..., None] * unit, drives, angular_frequency, epsilon, compliance


def exponents_of(*given, tolerance=1e-8, **more):
    return periodic.floquet_exponents(*oscillators(*given, **more), tolerance=tolerance)


def growth_of(*given, tolerance=1e-8):
    return periodic.growth_rate(*oscillators(*given), tolerance=tolerance)


def monodromy_of(*given, tolerance=1e-8, **more):
    """Return the maps of (q, p); without oscillating masses p is dq/dt."""
    system, shape = periodic.PeriodicSystem.of(*oscillators(*given, **more))
    maps = periodic.monodromy(system, tolerance)
    return maps.reshape(*shape, *maps.shape[1:])


def multipliers_apart(first, second):
    distance = np.abs(first[:, None] - second)
    return distance[linear_sum_assignment(distance)].max()


@pytest.mark.parametrize("seed", [*range(24), 1305])  # in the last, sines and cosines come in another order
def test_exponents_are_hills(seed):
    omega, coupling, varpi, epsilon, decay = random_system(seed)
    period = 2 * np.pi / varpi
    both = (
        exponents_of(omega, coupling[None], varpi, epsilon, decay, tolerance=1e-13),
        hill_exponents(omega, coupling, varpi, epsilon, decay, harmonics=16),
    )
    mine, hill = (np.exp(period * exponents) for exponents in both)
    assert multipliers_apart(mine, hill) < 1e-11 * np.abs(hill).max()
    for exponents in both:  # in one strip, the fastest growing first
        assert (np.abs(exponents.imag) <= varpi / 2 * (1 + 1e-12)).all()
        assert (np.diff(exponents.real) * period < 1e-8).all()


def test_mathieu_edges():
    """On Mathieu's characteristic curves a multiplier is +1 or -1: periodic solutions exist."""
    q = np.linspace(0.2, 3.0, 8)
    for order in range(1, 4):
        for curve in (mathieu_a, mathieu_b):
            a = curve(order, q)
            good = a > 0
            exponents = exponents_of(np.sqrt(a[good])[:, None], np.array([[[1.0]]]), 2.0, 2 * q[good], tolerance=1e-13)
            cosine = np.cosh(exponents * np.pi).real
            assert np.allclose(cosine, (-1) ** order, atol=1e-9)


def test_monodromy_is_that_of_a_general_integrator():
    omega, coupling, varpi, epsilon, decay = random_system(4)
    modes = omega.size

    def slope(t, y):
        q, p = y.reshape(2, modes, 2 * modes)
        stiffness = np.diag(omega**2) + epsilon * np.cos(varpi * t) * coupling
        return np.concatenate([p, -stiffness @ q - 2 * decay[:, None] * p]).ravel()

    end = solve_ivp(slope, (0, 2 * np.pi / varpi), np.eye(2 * modes).ravel(), method="DOP853", rtol=1e-12, atol=1e-13)
    assert np.allclose(
        monodromy_of(omega, coupling[None], varpi, epsilon, decay, tolerance=1e-12),
        end.y[:, -1].reshape(2 * modes, -1),
        atol=1e-9,
    )


def test_compliance_is_a_spring_in_series():
    """g = eps cos / (1 + lambda eps cos) against a general integrator, with two terms."""
    omega = np.array([1.0, 2.3])
    terms = np.array([[[0.5, 0.2], [0.2, 0.1]], [[0.3, -0.4], [-0.4, 0.9]]])
    soft, varpi, epsilon = np.array([0.6, 0.2]), 2.1, 0.4

    def slope(t, y):
        q, p = y.reshape(2, 2, 4)
        swing = epsilon * np.cos(varpi * t)
        stiffness = np.diag(omega**2) + np.tensordot(swing / (1 + soft * swing), terms, 1)
        return np.concatenate([p, -stiffness @ q]).ravel()

    end = solve_ivp(slope, (0, 2 * np.pi / varpi), np.eye(4).ravel(), method="DOP853", rtol=1e-12, atol=1e-13)
    mine = monodromy_of(omega, terms, varpi, epsilon, 0.0, soft, tolerance=1e-12)
    assert np.allclose(mine, end.y[:, -1].reshape(4, 4), atol=1e-9)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("soft", [None, [0.9]])
def test_error_is_what_was_asked_for(tolerance, soft):
    omega, coupling = np.array([3.47, 20.9, 52.8]), np.outer([0.3, 6.5, 29.3], [0.3, 6.5, 29.3])[None]
    given = omega, coupling, np.array([7.0, 41.7, 105.0])[:, None], np.array([0.05, 0.3]), 0.0, soft
    scale = np.r_[np.ones(3), omega]
    error = (monodromy_of(*given, tolerance=tolerance) - monodromy_of(*given, tolerance=1e-13)) / scale[:, None] * scale
    assert 1e-4 * tolerance < np.abs(error).max() < 2 * tolerance  # the last step may find more than it was asked for


def test_multipliers_come_in_reciprocal_pairs():
    omega, coupling = np.array([1.0, 2.2, 3.9]), np.array([[[1.0, 0.5, 0.2], [0.5, -0.7, 0.1], [0.2, 0.1, 1.3]]])
    exponents = exponents_of(omega, coupling, np.linspace(0.5, 9.0, 40), 0.6)
    assert np.allclose(np.sort(exponents.real), np.sort(-exponents.real), atol=1e-12)
    maps = monodromy_of(omega, coupling, np.linspace(0.5, 9.0, 40), 0.6)
    unit = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    assert np.allclose(maps.swapaxes(1, 2) @ unit @ maps, unit, atol=1e-9)


def test_damping_loses_phase_volume():
    """Liouville: the multipliers' product is exp(-2 sum c T)."""
    omega, coupling, varpi, epsilon, decay = random_system(5)
    exponents = exponents_of(omega, coupling[None], varpi, epsilon, decay, tolerance=1e-12)
    assert exponents.sum().real == pytest.approx(-2 * decay.sum(), rel=1e-9)


def test_no_excitation_no_growth():
    """Not even where a double multiplier 1 or -1 would lose half the digits: there are rigid and resonant modes."""
    omega = np.array([0.0, 1.0, 2.0])
    varpi = np.concatenate([np.linspace(0.3, 5.0, 30), [2.0, 1.0, 2 / 3, 0.5, 4.0, 3.0]])
    assert growth_of(omega, np.ones((1, 3, 3)), varpi, 0.0).max() < 1e-14
    varpi = np.linspace(0.5, 9.0, 40)
    double = exponents_of(np.outer(varpi, [0.5, 1.0, 3.0]), np.ones((1, 3, 3)), varpi, 0.0)
    np.testing.assert_allclose(np.exp(4 * np.pi / varpi[:, None] * double), 1.0, atol=1e-12)
    varpi, decay = np.linspace(0.3, 5.0, 36), np.array([0.01, 0.2])
    damped = exponents_of(omega[1:], np.ones((1, 2, 2)), varpi, 0.0, decay=decay)
    np.testing.assert_allclose(damped.real, np.broadcast_to(-decay.repeat(2), damped.shape), atol=1e-12)


def test_batch_equals_loop():
    rng = np.random.default_rng(7)
    omega = np.sort(rng.uniform(1, 5, (4, 1, 2)), axis=-1)
    coupling = rng.normal(size=(4, 1, 1, 2, 2))
    varpi, epsilon = rng.uniform(2, 8, 5), rng.uniform(0, 0.5, (4, 5))
    for function in (growth_of, exponents_of):
        batch = function(omega, coupling, varpi, epsilon, tolerance=1e-13)
        for i, j in np.ndindex(4, 5):
            one = function(omega[i, 0], coupling[i, 0], varpi[j], epsilon[i, j], tolerance=1e-13)
            assert np.allclose(batch[i, j], one, atol=1e-10)


@pytest.mark.parametrize("modes", [1, 2])
def test_any_argument_alone_may_be_the_batch(modes):
    rng, fixed = np.random.default_rng(9), {"tolerance": 1e-4}
    shapes = {"omega": (modes,), "coupling": (2, modes, modes), "angular_frequency": (), "epsilon": ()}
    shapes |= {"decay": (modes,), "compliance": (2,)}
    one = {name: rng.uniform(0.2, 0.9, shape) for name, shape in shapes.items()}
    for name, shape in shapes.items():
        several = rng.uniform(0.2, 0.9, (3, *shape))
        batch = monodromy_of(**(one | {name: several} | fixed))
        singles = [monodromy_of(**(one | {name: value} | fixed)) for value in several]
        np.testing.assert_allclose(batch, singles, rtol=0.0, atol=1e-3)


@pytest.mark.parametrize("decay", [0.0, 0.02])
@pytest.mark.parametrize("skew", [0.0, 0.3])
def test_growth_is_that_of_the_fastest_exponent(decay, skew):
    """Through zones of one mode, of a sum and (skew only) of a difference, and never negative between them."""
    coupling, varpi = np.array([[[1.0, 0.5 + skew], [0.5 - skew, -0.7]]]), np.linspace(0.9, 4.6, 60)
    system = (np.array([1.0, 2.2]), coupling, varpi, 0.4, decay)
    growth, exponents = growth_of(*system), exponents_of(*system)
    assert (growth == 0.0).any() or not decay
    assert growth.max() > 0.05
    np.testing.assert_allclose(growth, np.maximum(exponents[:, 0].real, 0.0), atol=1e-9)
    at = int(growth.argmax())
    hill = hill_exponents([1.0, 2.2], coupling[0], varpi[at], 0.4, decay, harmonics=12)
    assert growth[at] == pytest.approx(hill[0].real, rel=1e-6)


@pytest.mark.parametrize("parts", [5, 6, 8, 10, 12])
def test_exponents_of_free_modes_in_whole_ratios_to_the_excitation(parts):
    """The edges of a strip chosen without care would meet exponents, where rounding decides which of two counts."""
    for number in range(1, parts):
        omega = np.unique([3.0 * number / parts, 3.0 / parts])
        found = hill_exponents(omega, np.zeros((omega.size,) * 2), 3.0, 0.0, harmonics=4)
        turns = [np.exp(2 * np.pi / 3.0 * s) for s in (found, 1j * np.r_[omega, -omega])]
        assert multipliers_apart(*turns) < 1e-6  # double ones are known to half the digits


def test_many_exponents_leave_narrow_gaps():
    omega = 3.0 * (np.arange(6) + 0.5) / 13
    found = hill_exponents(omega, np.zeros((6, 6)), 3.0, 0.0, harmonics=3)
    np.testing.assert_allclose(np.sort(found.imag), np.sort(np.r_[omega, -omega]), atol=1e-12)


def test_too_few_harmonics_are_refused():
    with pytest.raises(ValueError, match="harmonics"):
        hill_exponents([1.0, 30.0], np.eye(2), 0.9, 0.1, harmonics=3)


@pytest.mark.parametrize("decay", [0.0, 0.1])
@pytest.mark.parametrize("epsilon", [1e6, 1e7])
def test_motions_beyond_all_numbers_are_refused(epsilon, decay):
    """The larger one in half a period already."""
    with pytest.raises(ValueError, match="epsilon: some motions grow beyond 1e308"):
        growth_of([1.0], [[[1.0]]], 3.0, epsilon, decay)
