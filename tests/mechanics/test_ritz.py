"""Ritz matrices against textbook elements, closed-form frequencies, Bessel zeros and the characteristic function."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eig, eigh
from scipy.optimize import brentq
from scipy.special import iv, jn_zeros, jv
from sympy import Function, Matrix, Rational, exp, lambdify, symbols, zeros

from cra_sym.mechanics import HamiltonError, hamilton, ritz, separate

x, t = symbols("x t")
L, m, B, T, k, k_t, k_r, m_e, J_e, m_b, G, c = symbols("L m B T k k_t k_r m_e J_e m_b G c")
v, psi = Function("v")(x, t), Function("psi")(x, t)
w = Function("w")(t)
BEAM = m * v.diff(t) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2
STRING = m * v.diff(t) ** 2 / 2 - T * v.diff(x) ** 2 / 2
ROOT = -k_t * v**2 / 2 - k_r * v.diff(x) ** 2 / 2
TIP = m_e * v.diff(t) ** 2 / 2 + J_e * v.diff(x, t) ** 2 / 2
CLAMPED = [v.subs(x, 0), v.diff(x).subs(x, 0)]


def matrices(density, elements, fields=(v,), **options):
    return ritz(density, elements=elements, fields=fields, x=x, domain=(0, L), t=t, **options)


def numbers(matrix, values):
    return np.array(Matrix(matrix).subs(values), dtype=float)


def frequencies(found, values):
    """Largest mu = 1 / omega^2 of M against K, whose diagonal is scaled to ones: the lowest frequencies lose no digits.

    Rounding is eps times the condition of that K, the number of elements to the power 2 (string) or 4 (beam).
    """
    stiffness, mass = numbers(found.stiffness, values), numbers(found.mass, values)
    scale = np.diag(stiffness)[:, None] ** -0.5
    return eigh(scale * mass * scale.T, scale * stiffness * scale.T, eigvals_only=True)[::-1] ** -0.5


def test_the_beam_element_of_the_textbooks():
    found = matrices(BEAM, 1)
    h = found.element_length
    stiffness = Matrix([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]])
    mass = Matrix([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2]])
    assert (found.element_stiffness[:2, :] - B / h**3 * stiffness).expand() == zeros(2, 4)
    assert (found.element_mass[:2, :] - m * h / 420 * mass).expand() == zeros(2, 4)
    assert found.labels == (v, v.diff(x))
    assert found.damping == zeros(4, 4)


def test_end_terms_and_restraints():
    found = matrices(BEAM, 2, left=ROOT, right=J_e * v.diff(x, t) ** 2 / 2, essential=[v.subs(x, L)])
    assert found.end_stiffness == {(0, 0): k_t, (1, 1): k_r}
    assert found.end_mass == {(5, 5): J_e}
    assert found.free == 5
    assert found.restraint[4] == {}
    assert found.connectivity == ((0, 1, 2, 3), (2, 3, 4, 5))
    assert (found.stiffness - matrices(BEAM, 2, essential=[v.subs(x, L)]).stiffness)[0, 0] == k_t


@pytest.mark.parametrize(("density", "order", "exact"), [(STRING, 6, np.pi), (BEAM, 4, 3.516015268540862)])
def test_convergence_at_the_theoretical_rate(density, order, exact):
    essential = CLAMPED if density is BEAM else [v.subs(x, 0), v.subs(x, L)]
    values = {m: 1, B: 1, T: 1, L: 1}
    errors = [frequencies(matrices(density, n, essential=essential), values)[0] - exact for n in (3, 6)]
    assert errors[0] > errors[1] > 0
    # the next term of the error is h^2 of the first: it takes 0.35 from the order here, rounding 1e-6 at most
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.4)


def test_the_same_lagrangian_by_the_characteristic_function():
    result = hamilton(BEAM, fields=[v], x=x, domain=(0, L), t=t, left=ROOT, right=TIP)
    values = {L: 1, m: 1, B: 1, k_t: 90, k_r: 7, m_e: Rational(1, 5), J_e: Rational(1, 50)}
    modal = separate(result)
    function = lambdify(list(modal.basis.wave_numbers), modal.characteristic_function.subs(values))
    grid = np.linspace(0.3, 7, 200)
    signs = np.sign([function(value) for value in grid])
    roots = [brentq(function, grid[i], grid[i + 1]) ** 2 for i in np.flatnonzero(signs[:-1] != signs[1:])]
    found = frequencies(ritz(result, elements=12), values)[: len(roots)]
    assert len(roots) >= 3
    error = found / np.array(roots) - 1
    assert np.all(error > -1e-11)  # eps 12^4 = 5e-12 and what brentq leaves of a root
    assert np.all(error[:3] < np.array(roots[:3]) ** 2 / 12**4 / 1440)  # h^4 |v_xxxx|^2 / (1440 |v_xx|^2) at most


def test_hanging_chain_has_bessel_zeros():
    density = m * v.diff(t) ** 2 / 2 - m * G * (L - x) * v.diff(x) ** 2 / 2
    found = frequencies(matrices(density, 8, essential=[v.subs(x, 0)]), {m: 2, G: 9, L: Rational(3, 2)})
    assert np.allclose(found[:3], jn_zeros(0, 3) / 2 * np.sqrt(9 / 1.5), rtol=5e-5)


def test_wedge_has_its_bessel_frequencies():
    # Kirchhoff's wedge, clamped at its thick end
    s = 1 - x / L
    density = m * s * v.diff(t) ** 2 / 2 - B * s**3 * v.diff(x, 2) ** 2 / 2

    def equation(z):
        return jv(1, z) * iv(2, z) + jv(2, z) * iv(1, z)

    first = brentq(equation, 4, 5.5)
    found = frequencies(matrices(density, 8, essential=CLAMPED), {m: 1, B: 1, L: 1})
    assert found[0] == pytest.approx(first**2 / 4, rel=1e-5)


def test_other_coefficients_by_quadrature():
    # exponential rod: v = e^(-a x) u turns m e^(2 a x) (v_tt - v_xx) = ... into a string on a foundation a^2
    a = Rational(3, 4)
    density = exp(2 * a * x) * (v.diff(t) ** 2 - v.diff(x) ** 2) / 2
    found = frequencies(matrices(density, 3, essential=[v.subs(x, 0), v.subs(x, L)]), {L: 1})
    # the error of three cubics, of order (n pi / 3)^6, far above rounding
    assert np.allclose(found[:2] ** 2, np.pi**2 * np.array([1, 4]) + float(a) ** 2, rtol=2e-3)
    assert found[0] ** 2 == pytest.approx(np.pi**2 + 0.75**2, rel=3e-5)


def test_timoshenko_approaches_the_slender_beam():
    density = (m * v.diff(t) ** 2 + J_e * psi.diff(t) ** 2 - B * psi.diff(x) ** 2 - G * (v.diff(x) - psi) ** 2) / 2
    found = matrices(density, 8, [v, psi], essential=[v.subs(x, 0), psi.subs(x, 0)])
    slender = frequencies(found, {m: 1, B: 1, L: 1, G: 1e5, J_e: 1e-7})[0]
    stocky = frequencies(found, {m: 1, B: 1, L: 1, G: 100, J_e: 1e-2})[0]
    assert slender == pytest.approx(3.516015268540862, rel=1e-4)
    assert stocky < 0.97 * slender


def test_coordinates_in_the_density_and_at_the_ends():
    # relative displacement on a free base: the same as absolute displacement with the mass of the base at the root
    values = {m: 1, B: 1, L: 1, m_b: 2, m_e: Rational(1, 3), k: 5}
    relative = matrices(
        m * (v.diff(t) + w.diff(t)) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2,
        4,
        coordinates=[w],
        left=m_b * w.diff(t) ** 2 / 2 - k * w**2 / 2,
        right=m_e * (v.diff(t) + w.diff(t)) ** 2 / 2,
        essential=CLAMPED,
    )
    absolute = matrices(
        BEAM,
        4,
        left=m_b * v.diff(t) ** 2 / 2 - k * v**2 / 2,
        right=m_e * v.diff(t) ** 2 / 2,
        essential=[v.diff(x).subs(x, 0)],
    )
    tied = matrices(
        BEAM,
        4,
        coordinates=[w],
        left=m_b * w.diff(t) ** 2 / 2 - k * w**2 / 2,
        right=m_e * v.diff(t) ** 2 / 2,
        essential=[v.subs(x, 0) - w, v.diff(x).subs(x, 0)],
    )
    expected = frequencies(absolute, values)
    assert np.allclose(frequencies(relative, values), expected, rtol=1e-8)
    assert np.allclose(frequencies(tied, values), expected, rtol=1e-8)
    assert relative.labels[-1] == w


def test_damping_of_a_uniformly_damped_string():
    # viscous damping per length: s^2 + (c/m) s + omega^2 = 0
    found = matrices(STRING, 5, essential=[v.subs(x, 0), v.subs(x, L)], virtual_work=[(-c * v.diff(t), v, "domain")])
    values = {m: 2, T: 3, L: 1, c: Rational(4, 5)}
    M, C, K = (numbers(matrix, values) for matrix in (found.mass, found.damping, found.stiffness))
    size = len(M)
    companion = np.block([[np.zeros((size, size)), np.eye(size)], [-K, -C]])
    weight = np.block([[np.eye(size), np.zeros((size, size))], [np.zeros((size, size)), M]])
    s = eig(companion, weight, right=False)
    first = min(s[s.imag > 0], key=lambda value: value.imag)
    assert first.real == pytest.approx(-0.8 / 2 / 2, rel=1e-9)
    # error of cubics: h^6 |v_xxxx|^2 / (60480 |v_x|^2) at most, as Hermite interpolation leaves it, and the next term
    assert abs(first) == pytest.approx(np.pi * np.sqrt(1.5), rel=1.1 * (np.pi / 5) ** 6 / 60480)


def test_loads_of_a_prescribed_base_and_of_forces():
    # a uniform acceleration loads the beam as a uniform force; the static deflection of the tip is q L^4 / (8 B)
    F = Function("F")(t)
    found = matrices(
        m * (v.diff(t) + w.diff(t)) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2,
        2,
        essential=CLAMPED,
        virtual_work=[(F, v, "right"), (F * x, v, "domain")],
    )
    deflection = Matrix(found.stiffness).LUsolve(found.load)[-2].expand()
    assert deflection.coeff(w.diff(t, 2)) == -m * L**4 / (8 * B)
    assert deflection.coeff(F) == L**3 / (3 * B) + 11 * L**5 / (120 * B)


def test_gyroscopic_forces_are_skew():
    found = matrices(m * (v.diff(t) + 2 * v.diff(x)) ** 2 / 2 - T * v.diff(x) ** 2 / 2, 2, essential=[v.subs(x, 0)])
    damping = Matrix(found.damping)
    assert (damping + damping.T).expand() == zeros(*damping.shape)
    assert damping != zeros(*damping.shape)


def test_third_derivatives_take_quintic_elements():
    found = matrices(m * v.diff(t) ** 2 / 2 - B * v.diff(x, 3) ** 2 / 2, 1)
    assert found.labels == (v, v.diff(x), v.diff(x, 2))
    rank = np.linalg.matrix_rank(numbers(found.stiffness, {m: 1, B: 1, L: 1}))
    assert rank == 3  # quadratics are free of strain


def test_a_parameter_may_have_any_name():
    xi, h, x_e = symbols("xi h x_e")
    found = matrices(xi * v.diff(t) ** 2 / 2 - (h + x_e * x) * v.diff(x) ** 2 / 2, 1)
    values = {found.element_length: 2, found.element_start: 0, h: 3, x_e: 5, xi: 7}
    shape = Matrix([1, 0, 1, 0])  # rigid motion
    assert (shape.T * found.element_mass * shape)[0].subs(values) == 14
    ramp = Matrix([0, 1, found.element_length, 1])  # v = x
    assert (ramp.T * found.element_stiffness * ramp)[0].subs(values) == 16


def test_errors_name_what_is_wrong():
    with pytest.raises(HamiltonError, match="nonlinear"):
        matrices(STRING - v**4, 2)
    with pytest.raises(HamiltonError, match="two time derivatives"):
        matrices(STRING + m * v.diff(t, 2) ** 2, 2)
    with pytest.raises(HamiltonError, match="measure the displacement from there"):
        matrices(STRING, 2, essential=[v.subs(x, 0) - w])
    with pytest.raises(ValueError, match="elements"):
        matrices(STRING, 0)
    with pytest.raises(ValueError, match="elements"):
        matrices(STRING, 1.5)
