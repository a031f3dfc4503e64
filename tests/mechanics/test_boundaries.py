"""The boundaries' kernels for systems of any kind: couplings with and without symmetry, damping equal and unequal."""

from __future__ import annotations

import numpy as np
import pytest

from cra_sym.kernels import derived_kernel
from cra_sym.mechanics.boundaries import general_resonance
from cra_sym.solvers.floquet import Oscillation
from cra_sym.solvers.periodic import floquet_exponents

LABELS = {"principal": {"n": 1}, "sum": {"m": 0, "n": 2}, "difference": {"m": 2, "n": 0}}


def boundary(kind, omega, coupling, epsilon, decay, power=0, tongue=1, order=2):
    """Both sides for three modes written out; P grows with the given power of the excitation frequency."""
    labels = LABELS[kind]
    first, *_, second = *labels.values(), labels["n"]
    centre = (omega[first] + (-1 if kind == "difference" else 1) * omega[second]) / tongue
    coupling = coupling * centre**power
    values = {"epsilon": epsilon}
    for a, i in labels.items():
        values |= {f"omega_{a}": omega[i], f"c_{a}": decay[i], f"S_{a}": 0.0}
        for b, k in labels.items():
            values |= {f"P_{a}{b}": coupling[i, k], f"dP_{a}{b}": power * coupling[i, k] / centre, f"W_{a}{b}": 0.0}
    sums = derived_kernel(f"cra_sym.mechanics.boundaries:sums_{kind}_{tongue}")
    for name in sums(*(1.0 for _ in sums.arguments)):
        row, target = labels[name[2]], labels[name[-1]]
        total = 0.0
        for j in set(range(3)) - set(labels.values()):
            at = values | {"omega_j": omega[j], "path": coupling[row, j] * coupling[j, target]}
            table = sums(*(at[argument] for argument in sums.arguments))[name]
            total += table["spectator"]
        values[name] = table["resonant"] + total
    damped = "damped_" if np.any(decay) else ""
    half_width, shift = (
        kernel(*(values[argument] for argument in kernel.arguments))
        for name in ("half_width", "shift")
        for kernel in [derived_kernel(f"cra_sym.mechanics.boundaries:{damped}{name}_{kind}_{tongue}")]
    )
    middle = centre + (shift if order == 2 else 0.0)
    return np.array([middle - half_width, middle + half_width])


def truth(sides, omega, coupling, epsilon, decay, power):
    """Both sides by Floquet theory, from the middle outwards."""
    middle, half = sides.mean(), np.ptp(sides) / 2
    inside, outside = np.full(2, middle), middle + 1.8 * half * np.array([-1.0, 1.0])
    for _ in range(6):
        grid = np.linspace(inside, outside, 17, axis=-1)
        matrices = coupling * grid[..., None, None, None] ** power
        stiffness, damping = np.diag(omega**2), np.diag(2.0 * np.broadcast_to(decay, omega.shape))
        waves = [(Oscillation(1, "cos", 0), (part, None, None, None)) for part in np.moveaxis(matrices, -3, 0)]
        exponents = floquet_exponents(stiffness, damping, waves, grid, epsilon, tolerance=1e-10)
        growing = exponents[..., 0].real > (0.0 if np.any(decay) else 1e-5 * half)
        assert growing[:, 0].all() and not growing[:, -1].any()
        still = np.argmin(growing, axis=-1)[:, None]
        inside, outside = (np.take_along_axis(grid, still - back, axis=-1)[:, 0] for back in (1, 0))
    return (inside + outside) / 2


def system(seed, kind, symmetric, damping):
    rng = np.random.default_rng(seed)
    omega = np.array([1.0, 2.37, 5.3]) * rng.uniform(0.97, 1.03, 3)
    coupling = rng.uniform(0.4, 1.2, (3, 3))
    if symmetric:
        coupling = (coupling + coupling.T) / 2
    if kind == "difference":
        coupling[0, 2] *= -1.0
    decay = {"none": np.zeros(3), "equal": np.full(3, 0.1), "unequal": np.array([0.06, 0.1, 0.16])}[damping]
    return omega, coupling, decay


@pytest.mark.parametrize("damping", ["none", "equal", "unequal"])
@pytest.mark.parametrize(
    ("kind", "symmetric", "power"),
    [("principal", True, 0), ("principal", False, 2), ("sum", True, 2), ("sum", False, 0), ("difference", False, 0)],
)
def test_against_floquet(kind, symmetric, power, damping):
    """With damping in proportion to epsilon, halving both divides the error by 4 at first order, by 8 at second."""
    omega, coupling, rate = system(3, kind, symmetric, damping)
    coupling = coupling / (2.0**power)
    errors = {1: [], 2: []}
    for epsilon in (0.06, 0.03):
        decay = rate * epsilon * (0.3 if kind != "principal" else 0.5)
        second = boundary(kind, omega, coupling, epsilon, decay, power)
        first = boundary(kind, omega, coupling, epsilon, decay, power, order=1)
        exact = truth(second, omega, coupling, epsilon, decay, power)
        for order, sides in ((1, first), (2, second)):
            errors[order].append(np.abs(sides - exact).max())
    assert 3.3 < errors[1][0] / errors[1][1] < 4.9
    assert errors[2][0] / errors[2][1] > 6.0
    assert errors[2][1] < 0.3 * errors[1][1]


def test_unequal_damping_widens_a_sum_zone_even_in_the_limit():
    """The half-width tends to (c_m + c_n) / (2 sqrt(c_m c_n)) times the undamped one."""
    omega, coupling, _ = system(1, "sum", True, "none")
    free = np.ptp(boundary("sum", omega, coupling, 0.05, np.zeros(3)))
    tiny = 1e-7 * np.array([1.0, 1.0, 9.0])
    damped = np.ptp(boundary("sum", omega, coupling, 0.05, tiny))
    assert damped / free == pytest.approx(10.0 / 6.0, rel=1e-4)
    assert np.ptp(boundary("sum", omega, coupling, 0.05, np.full(3, 1e-7))) == pytest.approx(free, rel=1e-4)


def test_a_difference_with_symmetric_coupling_has_no_border():
    omega, coupling, _ = system(1, "sum", True, "none")
    assert np.isnan(boundary("difference", omega, coupling, 0.05, np.zeros(3))).all()


@pytest.mark.parametrize("kind", ["principal", "sum"])
def test_second_tongue_against_floquet(kind):
    """Its width and place are of order epsilon^2; the error shrinks faster."""
    omega, coupling, _ = system(5, kind, True, "none")
    errors = []
    for epsilon in (0.2, 0.1):
        sides = boundary(kind, omega, coupling, epsilon, np.zeros(3), tongue=2)
        errors.append(np.abs(sides - truth(sides, omega, coupling, epsilon, np.zeros(3), 0)).max())
    assert errors[0] / errors[1] > 7.0


def test_steps_of_a_symbolic_number_of_modes_show_the_sum():
    shown = general_resonance("principal", 2, damped=False).step("sums over modes").expression
    assert [equation.lhs.name for equation in shown] == ["S_n"]
