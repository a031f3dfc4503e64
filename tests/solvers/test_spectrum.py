"""The driver of complete spectra on products with known zeros: close ones, those at zero or on a point, and misfits."""

from __future__ import annotations

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.model.one_wave_family import family
from cra_sym.model.values import flat_columns
from cra_sym.solvers.spectrum import Characteristic, _quarters, spectrum

ARM = family((("k", "k"), ("m", "m")))


class Product:
    """F(z) = product of (1 - z / z_i), its zeros at 0 left out; lanes are rows of zeros."""

    def __init__(self, roots):
        roots = np.atleast_2d(roots)
        self.zeros = (roots == 0.0).sum(axis=1)
        self.roots = np.where(roots == 0.0, np.inf, roots)

    def count(self, z, lanes):
        roots = self.roots[lanes]
        z = np.broadcast_to(z, len(roots))
        value, _, _ = self.evaluate(z, lanes)
        return (roots < z[:, None]).sum(axis=1) + self.zeros[lanes], value

    def evaluate(self, z, lanes):
        """Factor by factor, each over 1 + z / z_i, so that nothing grows."""
        value, slope, curvature = (-1.0) ** self.zeros[lanes], np.zeros(z.shape), np.zeros(z.shape)
        for root in self.roots[lanes].T:
            factor, rate, size = 1.0 - z / root, -1.0 / root, 1.0 + z / root
            curvature = (curvature * factor + 2.0 * slope * rate) / size
            slope = (slope * factor + value * rate) / size
            value = value * factor / size
        return value, slope, curvature


def regular(shift, number=60):
    return (np.pi * (np.arange(number) + shift)) ** 4


def test_the_arm_and_the_products_speak_the_protocol():
    products: Characteristic = Product(regular(0.6))
    arm: Characteristic = ARM.characteristic(*np.ones((4, 1)))
    for pair in (products, arm):
        number, value = pair.count(np.array([50.0]), slice(None))
        same, _, _ = pair.evaluate(np.array([50.0]), np.zeros(1, dtype=int))
        assert np.sign(value) == np.sign(same) == (-1.0) ** number


@pytest.mark.parametrize("shift", [0.05, 0.3, 0.5625, 0.8])
def test_regular_zeros(shift):
    found = spectrum(Product(regular(shift)), 12)
    np.testing.assert_allclose(found[0], regular(shift)[:12], rtol=1e-12)


def test_lanes_keep_apart():
    shifts = np.random.default_rng(5).uniform(0.05, 0.95, 40)
    roots = np.array([regular(shift) for shift in shifts])
    np.testing.assert_allclose(spectrum(Product(roots), 7), roots[:, :7], rtol=1e-12)


@pytest.mark.parametrize("gap", [1e-2, 1e-5, 1e-9])
@pytest.mark.parametrize("where", [0, 1, 4])
def test_close_zeros_are_both_found(gap, where):
    roots = regular(0.4)
    roots[where + 1] = roots[where] * (1.0 + gap)
    found = spectrum(Product(roots), 8)
    np.testing.assert_allclose(found[0], roots[:8], rtol=1e-11)


@pytest.mark.parametrize("number", [1, 2])
def test_zeros_at_zero_are_exact(number):
    roots = np.r_[np.zeros(number), regular(0.7)]
    found = spectrum(Product(roots), 6)
    assert (found[0, :number] == 0.0).all()
    np.testing.assert_allclose(found[0, number:], roots[number:6], rtol=1e-12)


def test_a_tiny_zero_is_not_a_zero():
    roots = np.r_[1e-20, regular(0.7)]
    np.testing.assert_allclose(spectrum(Product(roots), 3)[0], roots[:3], rtol=1e-12)


def test_a_zero_on_a_point_where_zeros_are_counted():
    for point in (1, 2, 5):
        lam = np.pi * ((point - 1) / 2 + 1 / 16)
        roots = regular(0.45)
        roots[(point - 1) // 2] = lam**4
        np.testing.assert_allclose(spectrum(Product(np.sort(roots)), 6)[0], np.sort(roots)[:6], rtol=1e-12)


def test_too_few_zeros_are_an_error():
    """The third zero comes just before the last point at which they are counted."""
    last = np.pi * (49 / 2 + 1 / 16)
    roots = np.r_[regular(0.5, number=2), (last - 1.0) ** 4]
    with pytest.raises(ArithmeticError, match=rf"3 zeros lie below lambda = {last:g}, 5 are wanted"):
        spectrum(Product(roots), 5)


def test_zeros_in_any_disorder():
    """Anywhere, several between two points of the count, some double or nearly so, with and without zeros at 0."""
    rng = np.random.default_rng(8)
    for rigid in range(3):
        lam = np.sort(rng.uniform(0.05, 3.0 * np.pi, (150, 12)), axis=1)
        pair = rng.integers(0, 7, 150)[:, None]
        gap = np.append(np.zeros(50), 10.0 ** rng.uniform(-9, -1, 100))[:, None]
        close = np.take_along_axis(lam, pair, 1) * (1.0 + gap)
        np.put_along_axis(lam, pair + 1, close, 1)
        far = np.broadcast_to(np.pi * np.arange(4, 40), (150, 36))
        roots = np.sort(np.concatenate([np.zeros((150, rigid)), lam**4, far**4], axis=1), axis=1)
        np.testing.assert_allclose(spectrum(Product(roots), 8), roots[:, :8], rtol=1e-11)


def test_counts_of_the_arm_are_those_of_the_dynamic_stiffness():
    """The specialised pair against the generic one, at random places of random arms, rigid and absent springs too."""
    rng = np.random.default_rng(11)
    k_t, k_r = 10 ** rng.uniform(-2, 7, (2, 40))
    k_t[:6], k_r[3:9] = [0.0, np.inf, 0.0, np.inf, 0.0, np.inf], [0.0, np.inf, 0.0, np.inf, 0.0, np.inf]
    arm = cra.Arm.nominal().replace(
        k_t=k_t, k_r=k_r, m_e=10 ** rng.uniform(-4, 1, 40), J_e=10 ** rng.uniform(-6, 0, 40)
    )
    z = rng.uniform(0.2, 40.0, 40) ** 4
    special, _ = ARM.characteristic(arm.kappa_t, arm.kappa_r, arm.mu, arm.iota).count(z, slice(None))
    omega = np.sqrt(z * arm.EI / arm.rhoA) / arm.L**2
    for rows, _, problem in arm.numerics("spatial").problems(flat_columns(arm.parameters, arm.shape)):
        generic = problem.evaluate(omega[rows] ** 2, np.arange(len(rows))).count
        np.testing.assert_array_equal(generic, special[rows])


class Generic:
    """The dynamic stiffness of a structure behind the same protocol, z in units of the arm's own omega^2 scale."""

    def __init__(self, problem, unit):
        self.problem, self.unit = problem, unit
        self.zeros = problem.evaluate(1e-12 * unit, np.arange(len(unit))).count

    def count(self, z, lanes):
        lanes = np.arange(len(self.unit))[lanes]
        number = self.problem.evaluate(z * self.unit[lanes], lanes).count
        return number, (-1.0) ** number

    def evaluate(self, z, lanes):
        """F'/F is that of the entire function without poles; its derivative is taken along the imaginary axis."""
        lanes = np.arange(len(self.unit))[lanes]
        z = np.where(z == 0.0, 1e-9, z)  # the first step starts at 0, where F'/F is known in the limit only
        slope = self.problem.evaluate(z * self.unit[lanes], lanes).logarithmic_derivative * self.unit[lanes]
        aside = self.problem.evaluate(z * self.unit[lanes] * (1 + 1e-20j), lanes)
        change = aside.logarithmic_derivative.imag * self.unit[lanes] / (1e-20 * z)
        sign = (-1.0) ** self.problem.evaluate(z * self.unit[lanes], lanes).count
        return sign, sign * slope, sign * (slope**2 + change)


class Counted:
    """The same functions, and how many values were asked for."""

    def __init__(self, characteristic):
        self.zeros, self.count = characteristic.zeros, characteristic.count
        self.values, self._evaluate = 0, characteristic.evaluate

    def evaluate(self, z, lanes):
        self.values += z.size
        return self._evaluate(z, lanes)


@pytest.mark.parametrize(("iota", "budget"), [(0.0, 2.25), (1.0, 2.42)])
def test_a_zero_costs_little_more_than_two_evaluations(iota, budget):
    """Starts next to the zeros and steps of third order: what makes the driver fast, counted instead of timed."""
    rng = np.random.default_rng(0)
    groups = [10 ** rng.uniform(*ends, 300) for ends in ((-2, 6), (-2, 6), (-3, 3), (-3, 3))]
    arms: Characteristic = Counted(ARM.characteristic(*groups[:3], iota * groups[3]))
    assert (spectrum(arms, 10) > 0).all()
    assert arms.values < budget * 3000


def test_quarters_of_a_turn():
    angle = np.linspace(0.0, np.pi / 2, 2001)
    np.testing.assert_allclose(_quarters(np.sin(angle), np.cos(angle)), angle / (np.pi / 2), atol=2e-4)


def test_one_driver_finds_the_same_zeros_by_the_arms_pair_and_by_the_generic_one():
    rng = np.random.default_rng(12)
    sprung = {"k_t": 10 ** rng.uniform(1, 7, 12), "k_r": 10 ** rng.uniform(-1, 4, 12)}
    arm = cra.Arm.nominal().replace(m_e=10 ** rng.uniform(-4, 0, 12), J_e=10 ** rng.uniform(-6, -2, 12), **sprung)
    special = spectrum(ARM.characteristic(arm.kappa_t, arm.kappa_r, arm.mu, arm.iota), 6)
    unit = np.full(12, float(arm.EI / (arm.rhoA * arm.L**4)))
    for rows, _, problem in arm.numerics("spatial").problems(flat_columns(arm.parameters, arm.shape)):
        generic: Characteristic = Generic(problem, unit[rows])
        np.testing.assert_allclose(spectrum(generic, 6), special[rows], rtol=1e-8)
