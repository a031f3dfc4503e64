"""The frequency equation, its limits and its special joints against mechanics and against literature."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq
from sympy import cos, cosh, lambdify, limit, oo, pi, sin, sinh, sqrt, tan, tanh

from cra_sym import symbols as s
from cra_sym.mechanics import ritz
from cra_sym.paper import frequency_equation, modes
from cra_sym.paper.equations import equation
from cra_sym.paper.motion import dynamics

RIGID_T, RIGID_R = {s.s_t: 1, s.c_t: 0}, {s.s_r: 1, s.c_r: 0}
FREE_T, FREE_R = {s.s_t: 0, s.c_t: 1}, {s.s_r: 0, s.c_r: 1}
BARE = {s.mu: 0, s.iota: 0}


def frequency(*conditions):
    function, _ = frequency_equation.frequency_function()
    for condition in conditions:
        function = function.subs(condition)
    return function.expand()


def reference(lamda, kt, kr, mu):
    """The determinant as it is known for an arm without rotary inertia at the tip, written by hand."""
    c, S, C, sn = cos(lamda), sinh(lamda), cosh(lamda), sin(lamda)
    a, b = sn * C - c * S, sn * C + c * S
    return (
        -(lamda**5) * mu * a + 2 * lamda**4 * kr * mu * c * C + lamda**4 * (c * C - 1) + lamda**3 * kr * b
        + 2 * lamda**2 * kt * mu * sn * S + lamda * kr * kt * mu * a + lamda * kt * a - kr * kt * (c * C + 1)
    )  # fmt: skip


def test_frequency_equation_is_the_known_determinant():
    finite = frequency({s.s_t: s.kappa_t, s.c_t: 1, s.s_r: s.kappa_r, s.c_r: 1}, {s.iota: 0})
    assert (finite + reference(s.lamda, s.kappa_t, s.kappa_r, s.mu)).expand() == 0


def test_the_equation_shown_is_the_function_used():
    assert (equation(23).expression.lhs - frequency_equation.frequency_function()[0]).expand() == 0


@pytest.mark.parametrize(
    ("joint", "expected"),
    [
        ((RIGID_T, RIGID_R), 1 + cos(s.lamda) * cosh(s.lamda)),
        ((RIGID_T, FREE_R), s.lamda * (cos(s.lamda) * sinh(s.lamda) - sin(s.lamda) * cosh(s.lamda))),
        ((FREE_T, RIGID_R), -(s.lamda**3) * (cos(s.lamda) * sinh(s.lamda) + sin(s.lamda) * cosh(s.lamda))),
        ((FREE_T, FREE_R), s.lamda**4 * (1 - cos(s.lamda) * cosh(s.lamda))),
    ],
    ids=["clamped-free", "pinned-free", "sliding-free", "free-free"],
)
def test_textbook_joints(joint, expected):
    assert (frequency(*joint, BARE) - expected).expand() == 0


def test_rigid_body_modes_are_powers_of_lambda():
    multiplicity = {}
    for name, joint in {"none": (FREE_T, FREE_R), "pinned": (RIGID_T, FREE_R), "sliding": (FREE_T, RIGID_R)}.items():
        series = frequency(*joint, BARE).series(s.lamda, 0, 10).removeO()
        multiplicity[name] = min(int(term.as_coeff_exponent(s.lamda)[1]) for term in series.as_ordered_terms()) / 4
    assert multiplicity == {"none": 2, "pinned": 1, "sliding": 1}


def test_a_heavy_tip_becomes_a_support():
    clamped_pinned = limit(frequency(RIGID_T, RIGID_R, {s.iota: 0}) / s.mu, s.mu, oo)
    assert (clamped_pinned - s.lamda * (cos(s.lamda) * sinh(s.lamda) - sin(s.lamda) * cosh(s.lamda))).expand() == 0
    root = brentq(lambdify(s.lamda, tan(s.lamda) - tanh(s.lamda)), 3.8, 4.0)
    assert abs(float(clamped_pinned.subs(s.lamda, root))) < 1e-9


def test_a_short_stiff_pinned_arm_is_a_pendulum_on_its_spring():
    """A slow arm turns as one body: omega^2 = k_r / (rho A L^3 / 3 + m_e L^2 + J_e)."""
    kappa, mass, turn = 1e-7, 0.3, 0.02
    numbers = {s.s_r: kappa, s.c_r: 1, s.mu: mass, s.iota: turn}
    function = lambdify(s.lamda, frequency(RIGID_T).subs(numbers))
    root = brentq(function, 1e-3, 0.5, xtol=1e-14)
    assert root**4 == pytest.approx(kappa / (1 / 3 + mass + turn), rel=1e-5)


def test_natural_frequency_formula():
    length, line, bending = 1.2, 0.7, 2.5
    numbers = {s.L: length, s.rho: line, s.A: 1, s.E: bending, s.I_z: 1, s.lamda: 2}
    found = float(equation(30).expression.rhs.subs(numbers))
    assert found == pytest.approx(4 / length**2 * float(sqrt(bending / line)) / (2 * float(pi)), rel=1e-14)


def test_coefficients_where_the_elimination_is_empty():
    root = modes.root_matrix()
    assert root[:, 2:].det().subs(RIGID_T | FREE_R) == 0
    assert root[:, 2:].det().subs(FREE_T | RIGID_R) == 0
    kernel = root.subs(RIGID_T | FREE_R).subs(s.lamda, 1).nullspace()
    assert {tuple(vector) for vector in kernel} == {(0, 1, 0, 0), (0, 0, 0, 1)}


def test_mode_shape_satisfies_all_four_conditions_for_random_parameters():
    rng = np.random.default_rng(30)
    function, arguments = frequency_equation.frequency_function()
    for _ in range(5):
        numbers = dict(zip(arguments[1:], rng.uniform(0.1, 1.0, 6), strict=True))
        numeric = lambdify(s.lamda, function.subs(numbers))
        grid = np.linspace(0.2, 8.0, 200)
        signs = np.sign([numeric(place) for place in grid])
        for k in np.flatnonzero(np.diff(signs)):
            root = brentq(numeric, grid[k], grid[k + 1], xtol=1e-14)
            values = numbers | {s.lamda: root}
            weights = np.array([1.0, float(equation(26).expression.rhs.subs(values))])
            pair = dict(zip((s.C_1, s.C_2), weights, strict=True))
            hyperbolic = [float(e.rhs.subs(values).subs(pair)) for e in equation(24).expression]
            vector = np.array([*weights, *hyperbolic])
            matrix = np.array(modes.root_matrix().col_join(modes.tip_matrix()).subs(values), dtype=float)
            assert np.max(np.abs(matrix @ vector) / (np.abs(matrix) @ np.abs(vector))) < 1e-9


def test_ritz_on_finite_elements_gives_the_same_frequencies():
    """The same Lagrangian, no determinant and no mode form: Hermite elements."""
    values = {s.L: 0.9, s.E: 1.3, s.I_z: 1.1, s.rho: 0.8, s.A: 0.7, s.m_e: 0.1, s.J_e: 0.004, s.k_t: 60.0, s.k_r: 4.0}
    matrices = ritz(dynamics(driven=False), elements=10)
    stiffness, mass = (np.array(m.subs(values), dtype=float) for m in (matrices.stiffness, matrices.mass))
    upper = np.sqrt(eigh(stiffness, mass, eigvals_only=True)[:3]) / (2 * np.pi)
    groups = {s.iota: values[s.J_e], s.mu: values[s.m_e], s.kappa_t: values[s.k_t], s.kappa_r: values[s.k_r]}
    line, bending, length = values[s.rho] * values[s.A], values[s.E] * values[s.I_z], values[s.L]
    scale = {s.iota: line * length**3, s.mu: line * length, s.kappa_t: bending / length**3, s.kappa_r: bending / length}
    groups = {name: value / scale[name] for name, value in groups.items()}
    finite = {s.s_t: groups[s.kappa_t], s.c_t: 1, s.s_r: groups[s.kappa_r], s.c_r: 1}
    function = lambdify(s.lamda, frequency(finite, groups))
    hertz = lambdify(s.lamda, equation(30).expression.rhs.subs(values))
    for found in upper:
        near = brentq(lambda place, found=found: hertz(place) - found, 0.1, 20.0)
        root = brentq(function, near * (1 - 1e-3), near * (1 + 1e-6))
        assert hertz(root) == pytest.approx(found, rel=2e-5)
