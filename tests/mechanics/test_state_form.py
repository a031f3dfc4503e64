"""The state form against the transfer matrix of known beams, and its Hamiltonian structure."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from sympy import Function, Matrix, Piecewise, eye, simplify, symbols, zeros

from cra_sym.mechanics import HamiltonError, hamilton, state_form

x, t = symbols("x t")
L, m, B, T, k, k_t, k_r, m_e, J_e, m_b, G, c = symbols("L m B T k k_t k_r m_e J_e m_b G c")
v, psi = Function("v")(x, t), Function("psi")(x, t)
w = Function("w")(t)
BEAM = m * v.diff(t) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2
ROOT = -k_t * v**2 / 2 - k_r * v.diff(x) ** 2 / 2
TIP = m_e * v.diff(t) ** 2 / 2 + J_e * v.diff(x, t) ** 2 / 2


def derive(density, fields=(v,), **options):
    return hamilton(density, fields=fields, x=x, domain=(0, L), t=t, **options)


def determinant(form, values, z):
    """Return det of the dynamic stiffness on the free motions by the matrix exponential, poles included."""
    numbers = {**values, form.parameter: z}
    system, boundary, free = (np.array(M.subs(numbers), dtype=float) for M in (form.system, form.boundary, form.free))
    n, lumped = len(form.displacements), len(form.coordinates)
    size = n + lumped
    transfer = expm(system * float(form.length.subs(numbers)))
    # P(0) from q(L): columns q(0), w, q(L)
    inverse = np.linalg.inv(transfer[:n, size : size + n])
    start = np.hstack([-inverse @ transfer[:n, :size], inverse])
    states = np.vstack([np.eye(size, size + n), start, np.zeros((lumped, size + n))])
    end = transfer @ states
    stiffness = np.vstack([-start, end[size + n :], end[size : size + n]])
    reduced = free.T @ (stiffness + boundary) @ free
    assert np.allclose(reduced, reduced.T, rtol=1e-8, atol=1e-8 * abs(reduced).max())
    return np.linalg.det(reduced)


def paper(lam, kt, kr, mu):
    """Characteristic function of the arm, typed by hand as the independent reference."""
    co, s, C, S = np.cos(lam), np.sin(lam), np.cosh(lam), np.sinh(lam)
    odd = s * C - co * S
    return (
        -(lam**5) * mu * odd
        + 2 * lam**4 * kr * mu * co * C
        + lam**4 * (co * C - 1)
        + lam**3 * kr * (s * C + co * S)
        + 2 * lam**2 * kt * mu * s * S
        + lam * kr * kt * mu * odd
        + lam * kt * odd
        - kr * kt * (co * C + 1)
    )


@pytest.mark.parametrize("coupled", [False, True])
def test_the_arm_has_its_frequencies(coupled):
    values = {L: 1, m: 1, B: 1, k_t: 200, k_r: 30, m_e: 0.3, J_e: 0}
    roots = [brentq(paper, a, b, (200, 30, 0.3)) for a, b in ((0.5, 2), (2.5, 4.5), (4.5, 7))]
    if coupled:  # absolute displacement y = w + v with a base held by nothing but w = 0: a heavy base hardly moves
        density = m * (v.diff(t) + w.diff(t)) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2
        tip = m_e * (v.diff(t) + w.diff(t)) ** 2 / 2
        result = derive(density, coordinates=[w], left=ROOT + m_b * w.diff(t) ** 2 / 2, right=tip)
        values[m_b] = 1e9
    else:
        result = derive(BEAM, left=ROOT, right=TIP)
    form = state_form(result)
    for root in roots:
        below, above = (determinant(form, values, (root * factor) ** 4) for factor in (1 - 1e-6, 1 + 1e-6))
        assert below * above < 0


def test_a_tied_base_equals_a_relative_displacement():
    density = m * (v.diff(t) + w.diff(t)) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2
    base = m_b * w.diff(t) ** 2 / 2 - k * w**2 / 2
    clamped = [v.subs(x, 0), v.diff(x).subs(x, 0)]
    relative = state_form(derive(density, coordinates=[w], left=base, essential=clamped))
    absolute = state_form(derive(BEAM, coordinates=[w], left=base, essential=[clamped[0] - w, clamped[1]]))
    values = {L: 1.5, m: 2, B: 3, m_b: 0.7, k: 11}
    assert absolute.free.shape == relative.free.shape == (5, 3)
    for z in (0.5, 4.0, 40.0):
        assert determinant(relative, values, z) == pytest.approx(determinant(absolute, values, z), rel=1e-9)


TIMOSHENKO = (m * v.diff(t) ** 2 + J_e * psi.diff(t) ** 2 - B * psi.diff(x) ** 2 - G * (v.diff(x) - psi) ** 2) / 2


@pytest.mark.parametrize(
    ("density", "fields", "coordinates"),
    [
        (BEAM - T * v.diff(x) ** 2 / 2 - k * v**2 / 2 + J_e * v.diff(x, t) ** 2 / 2, [v], []),
        (BEAM - k * v * v.diff(x, 2), [v], []),
        (TIMOSHENKO, [v, psi], []),
        (m * (v.diff(t) + w.diff(t)) ** 2 / 2 - T * v.diff(x) ** 2 / 2 - x * k * v * w, [v], [w]),
        (m * v.diff(t) ** 2 / 2 - T * v.diff(x, 3) ** 2 / 2, [v], []),
    ],
)
def test_without_damping_the_system_is_hamiltonian(density, fields, coordinates):
    form = state_form(derive(density, fields, coordinates=coordinates))
    half = form.system.rows // 2
    symplectic = Matrix.vstack(
        zeros(half).row_join(eye(half)),
        (-eye(half)).row_join(zeros(half)),
    )
    product = symplectic * form.system
    assert (product - product.T).applyfunc(simplify) == zeros(2 * half)
    assert not form.damped
    assert form.boundary == form.boundary.T


def test_damping_makes_the_parameter_s():
    works = [(-c * v.diff(t), v, "left"), (-c * v.diff(x, 2, t), v.diff(x, 2), "domain")]
    form = state_form(derive(BEAM, left=ROOT, virtual_work=works))
    s = form.parameter
    assert form.damped
    assert form.boundary[0, 0] == k_t + c * s
    assert form.system[1, 3] == 1 / (B + c * s)
    assert form.system[2, 0] == m * s**2


@pytest.mark.parametrize("work", [(-c * v.diff(x, 2), v, "left"), (-c * v.diff(x, 4, t), v, "domain")])
def test_forces_that_depend_on_internal_forces_have_no_weak_form(work):
    result = derive(BEAM, virtual_work=[work])
    assert len(result.boundary_conditions) == 4
    with pytest.raises(HamiltonError, match="internal force"):
        state_form(result)


def test_the_parameter_gets_a_name_that_is_free():
    z = symbols("z")
    assert state_form(derive(z * v.diff(t) ** 2 / 2 - T * v.diff(x) ** 2 / 2)).parameter != z


def test_variable_coefficients_stay_in_the_system():
    form = state_form(derive(m * v.diff(t) ** 2 / 2 - T * (1 - x / L) * v.diff(x) ** 2 / 2))
    assert not form.uniform
    assert simplify(form.system[0, 1] - 1 / (T * (1 - x / L))) == 0


def test_prescribed_motion_and_forces_do_not_enter():
    forced = derive(
        m * (v.diff(t) + w.diff(t)) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2, left=ROOT, virtual_work=[(w, v, "right")]
    )
    assert state_form(forced) == state_form(derive(BEAM, left=ROOT))


def test_natural_forces_are_the_boundary_conditions():
    result = derive(TIMOSHENKO, [v, psi])
    form = state_form(result)
    left = [condition.lhs for condition in result.boundary_conditions if condition.end == "left"]
    assert [force.subs(x, 0).doit() for force in form.forces] == [side.doit() for side in left]


@pytest.mark.parametrize(
    ("density", "words"),
    [
        (BEAM - T * v.diff(x) ** 4 / 4, r"term -T\*Derivative\(v\(x, t\), x\)\*\*4/4.*nonlinear"),
        (BEAM - T * t * v.diff(x) ** 2, "depends on t"),
        (m * v.diff(t) ** 2 / 2 - B * v * v.diff(x), "singular, so the problem has no state form$"),
        (BEAM.subs(B, Piecewise((0, x < L / 2), (B, True))), r"the stiffness .* is 0 where x < L/2; every part"),
        (BEAM.subs(B, Piecewise((B, x < L / 2), (0, True))), r"the stiffness .* is 0 where .*L/2.*; every part"),
        (m * v.diff(t) ** 2 / 2 - B * v * v.diff(x, 4), r"by parts, to Derivative\(v\(x, t\), \(x, 2\)\)\*\*2"),
    ],
)
def test_problems_without_a_state_form(density, words):
    with pytest.raises(HamiltonError, match=words):
        state_form(derive(density))
