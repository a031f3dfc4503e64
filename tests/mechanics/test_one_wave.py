"""The derived determinant and its forms against the boundary conditions evaluated by mpmath."""

import itertools

import mpmath as mp
import numpy as np
import pytest
import sympy as sp

from cra_sym.mechanics import one_wave as ow
from cra_sym.model.one_wave_family import family

STRUCTURE = ("k", "k"), ("m", "m")
ARM = (40.0, 1.0), (7.0, 1.0), (0.3, 1.0), (0.05, 1.0)
ARMS = family(STRUCTURE)


def exact(z, arm=ARM):
    """The determinant from its definition in cos, sin, cosh, sinh, 80 digits: a second difference of it costs 32."""
    with mp.workdps(80):
        b = mp.root(mp.mpf(z), 4)
        c, s, C, S = mp.cos(b), mp.sin(b), mp.cosh(b), mp.sinh(b)
        basis = (1, 1 - c * C, b * (s * C - c * S), b**2 * s * S, b**3 * (c * S + s * C))
        values = dict(zip(ow.BASIS[2], basis, strict=True))
        values |= dict(zip(ow.parameters(STRUCTURE), (mp.mpf(v) for pair in arm for v in pair), strict=True))
        return sp.lambdify([*values, ow.z], ow.determinant(STRUCTURE), "mpmath")(*values.values(), mp.mpf(z))


def test_published_form_of_the_frequency_equation():
    """physics: without rotary inertia, the determinant is the known expression in cos, sin, cosh and sinh."""
    kt, kr, mu, b = 40, 7, sp.Rational(3, 10), sp.Rational(17, 5)
    c, s, C, S = sp.cos(b), sp.sin(b), sp.cosh(b), sp.sinh(b)
    F = (
        -(b**5) * mu * (s * C - c * S) + 2 * b**4 * kr * mu * c * C + b**4 * (c * C - 1) + b**3 * kr * (s * C + c * S)
        + 2 * b**2 * kt * mu * s * S + b * kr * kt * mu * (s * C - c * S) + b * kt * (s * C - c * S)
        - kr * kt * (c * C + 1)
    )  # fmt: skip
    ours = exact(float(b) ** 4, (*ARM[:3], (0.0, 1.0)))
    assert float(-F) == pytest.approx(float(ours), rel=1e-13)


@pytest.mark.parametrize("z", [1e-6, 0.3, 4.9, 5.1, 80.0, 3e5])
def test_value_and_derivatives_in_floating_point(z):
    arm = ARMS.characteristic(*(np.array([value]) for value, _ in ARM))
    value, first, second = arm.evaluate(np.array([z]), np.array([0]))
    with mp.workdps(80):
        exact_ratios = [mp.diff(exact, mp.mpf(z), n, h=mp.mpf(z) * mp.mpf(10) ** -10) / exact(z) for n in (1, 2)]
    assert float(first[0] / value[0]) == pytest.approx(float(exact_ratios[0]), rel=1e-11)
    assert float(second[0] / value[0]) == pytest.approx(float(exact_ratios[1]), rel=1e-8)


def test_finite_at_any_frequency():
    arm = ARMS.characteristic(*(np.array([x]) for x in (np.inf, 0.0, 1e6, 1e6)))
    for lam in (1e3, 1e4, 1e5):
        assert np.isfinite(arm.evaluate(np.array([lam**4]), np.array([0]))).all()


ALL_ENDS = [
    (left, right)
    for n in (1, 2)
    for left, right in itertools.product(itertools.product(("", "h", "k", "m", "km"), repeat=n), repeat=2)
]
SOME_ENDS = [*ALL_ENDS[:25], *ALL_ENDS[25::13], (("km", "km"), ("km", "km"))]


@pytest.mark.sample(30, 1)
@pytest.mark.parametrize("structure", [STRUCTURE, *SOME_ENDS], ids=str)
def test_coefficients_do_not_cancel(structure):
    """Every coefficient is a sum of terms of one sign, for parameters that are not negative; so in the power series."""
    of_powers, names = ow.power_series(structure)
    expressions, _ = ow.coefficients(structure)
    known = dict(zip(names, expressions, strict=True))
    for expression in (*expressions, *(power.subs(known) for power in of_powers)):
        signs = {sp.sign(term.as_coeff_Mul()[0]) for term in sp.Add.make_args(sp.expand(expression))}
        assert len(signs) == 1


def test_theta_is_the_derivative():
    circular = {ow.cos_: sp.cos(ow.b), ow.sin_: sp.sin(ow.b), ow.cosh_: sp.cosh(ow.b), ow.sinh_: sp.sinh(ow.b)}
    for n in (1, 2):
        functions = {x: f.subs(circular) for x, f in zip(ow.BASIS[n][n - 1 :], ow.products(n)[0], strict=True)}
        functions |= {ow.BASIS[2][0]: sp.Integer(1), ow.z: ow.b ** (2 * n)}
        for x in (*ow.BASIS[n], ow.z):
            assert sp.expand(ow.b * sp.diff(functions[x], ow.b) - ow.theta(x, n).subs(functions)) == 0


def test_count_steps_by_one_at_every_zero():
    rng = np.random.default_rng(5)
    n = 300
    groups = [np.where(rng.random(n) < 0.3, rng.choice([0.0, end], n), 10 ** rng.uniform(-9, high, n))
              for end, high in ((np.inf, 12), (np.inf, 12), (0.0, 6), (0.0, 6))]  # fmt: skip
    arm = ARMS.characteristic(*groups)
    lam = ARMS.frequency_parameters(*groups, modes=8)
    for mode in range(8):
        positive = np.flatnonzero(lam[:, mode] > 0)
        for side, expected in ((1 - 1e-12, mode), (1 + 1e-12, mode + 1)):
            number, _ = arm.count((lam[positive, mode] * side) ** 4, positive)
            np.testing.assert_array_equal(number, expected)


def test_count_where_zeros_of_the_limits_are():
    """At multiples of pi / 4, where limiting arms have zeros or nearly so, the count is off by those at most."""
    lam = np.arange(1, 4000) * np.pi / 4
    pinned, clamped, free = (np.inf, 0.0), (np.inf, np.inf), (0.0, 0.0)
    for arm in (
        (*pinned, 0.0, 0.0),
        (*pinned, 1e6, 0.0),
        (*clamped, 0.0, 0.0),
        (*free, 0.0, 0.0),
        (*clamped, 0.0, 1e6),
    ):
        family = ARMS.characteristic(*(np.array([x]) for x in arm))
        number, _ = family.count(lam**4, np.zeros(lam.size, dtype=int))
        assert (np.abs(number - lam / np.pi) < 2.6).all() and (np.diff(number) >= 0).all()
