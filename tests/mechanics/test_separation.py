"""Separation against hand-derived frequency equations and against the exact dynamic stiffness of the state form."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from scipy.linalg import expm
from sympy import (
    Eq,
    Function,
    Matrix,
    cancel,
    cos,
    cosh,
    exp,
    expand,
    lambdify,
    pi,
    simplify,
    sin,
    sinh,
    symbols,
)

from cra_sym.mechanics import HamiltonError, hamilton, separate, state_form

x, t = symbols("x t")
L, m, B, T, k, k_t, k_r, m_e, J_e, m_b, G, c = symbols("L m B T k k_t k_r m_e J_e m_b G c")
s_t, c_t, s_r, c_r, mu, iota, kappa = symbols("s_t c_t s_r c_r mu iota kappa")
v, psi = Function("v")(x, t), Function("psi")(x, t)
w = Function("w")(t)
BEAM = m * v.diff(t) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2
STRING = m * v.diff(t) ** 2 / 2 - T * v.diff(x) ** 2 / 2
ROOT = -k_t * v**2 / 2 - k_r * v.diff(x) ** 2 / 2
TIP = m_e * v.diff(t) ** 2 / 2 + J_e * v.diff(x, t) ** 2 / 2
TIMOSHENKO = (m * v.diff(t) ** 2 + J_e * psi.diff(t) ** 2 - B * psi.diff(x) ** 2 - G * (v.diff(x) - psi) ** 2) / 2
GROUPS = {k_t: s_t / c_t * B / L**3, k_r: s_r / c_r * B / L, m_e: mu * m * L, J_e: iota * m * L**3}
CLAMPED = [v.subs(x, 0), v.diff(x).subs(x, 0)]


def derive(density, fields=(v,), domain=(0, L), **options):
    return hamilton(density, fields=fields, x=x, domain=domain, t=t, **options)


@cache
def arm(basis="hyperbolic"):
    return separate(derive(BEAM, left=ROOT, right=TIP), parameters=GROUPS, basis=basis)


def paper(lam):
    """Characteristic function of the arm with tip inertia, typed by hand, homogeneous in the joint's (s, c)."""
    P1, P2 = cos(lam) * cosh(lam), sin(lam) * sinh(lam)
    u = cos(lam) * sinh(lam) + sin(lam) * cosh(lam)
    o = sin(lam) * cosh(lam) - cos(lam) * sinh(lam)
    a_t, a_r = symbols("a_t a_r")
    D = 1 + P1 - (mu + a_r) * lam * o - 2 * a_r * mu * lam**2 * P2 - a_t * lam**3 * u - 2 * a_t * mu * lam**4 * P1
    D += a_t * a_r * (lam**4 * (1 - P1) + mu * lam**5 * o)
    inertia = -(lam**3) * u + mu * lam**4 * (1 - P1) + a_r * (-2 * lam**4 * P1 + mu * lam**5 * o)
    inertia += a_t * (2 * lam**6 * P2 + mu * lam**7 * u) + a_t * a_r * (lam**7 * u + mu * lam**8 * (1 + P1))
    return expand((D + iota * inertia) * s_t * s_r, deep=False).subs({a_t: c_t / s_t, a_r: c_r / s_r})


# ------------------------------------------------------------------------------------------------------------ the arm


def test_the_arm_has_the_frequency_equation_of_the_literature_at_any_stiffness():
    modal = arm()
    (lam,) = modal.basis.wave_numbers
    assert cancel(expand(modal.characteristic_function - paper(lam))) == 0
    assert cancel(modal.scale).free_symbols == set()


def test_limits_of_the_joint():
    modal = arm()
    (lam,) = modal.basis.wave_numbers
    rigid = modal.characteristic_function.subs({s_t: 1, c_t: 0, s_r: 1, c_r: 0, iota: 0})
    assert expand(rigid - 1 - cos(lam) * cosh(lam) - mu * lam * (cos(lam) * sinh(lam) - sin(lam) * cosh(lam))) == 0
    free = modal.characteristic_function.subs({s_t: 0, c_t: 1, s_r: 0, c_r: 1, iota: 0, mu: 0})
    assert expand(free - lam**4 * (1 - cos(lam) * cosh(lam))) == 0  # two rigid-body modes: lambda**8


def test_rigid_and_elastic_joints_agree_when_the_joint_is_made_rigid():
    elastic = arm().characteristic_function
    clamped = separate(derive(BEAM, right=TIP, essential=CLAMPED), parameters=GROUPS).characteristic_function
    assert expand(elastic.subs({s_t: 1, c_t: 0, s_r: 1, c_r: 0}) - clamped) in (0, expand(-2 * clamped))


@pytest.mark.parametrize("basis", ["hyperbolic", "decaying"])
@pytest.mark.parametrize("joint", [(200, 1, 30, 1), (1, 0, 5, 1), (3, 1, 1, 0), (1, 0, 1, 0), (1, 1e-9, 1, 1e9)])
def test_mode_shapes_satisfy_every_condition(basis, joint):
    modal = arm(basis)
    (lam,) = modal.basis.wave_numbers
    values = dict(zip((s_t, c_t, s_r, c_r), joint, strict=True)) | {mu: 0.3, iota: 0.02, L: 2}
    function = lambdify(lam, modal.characteristic_function.subs(values), "mpmath")
    with mpmath.workdps(40):
        grid = [mpmath.mpf(n) / 10 for n in range(12, 70)]
        bracket = next((a, b) for a, b in pairwise(grid) if function(a) * function(b) < 0)
        root = mpmath.findroot(function, bracket, solver="anderson", tol=1e-70)
        assert abs(function(root)) < 1e-30
        phi = lambdify([x, lam], [modal.mode_shapes[0].subs(values).diff(x, n) for n in range(5)], "mpmath")
        start, end = phi(mpmath.mpf(0), root), phi(mpmath.mpf(2), root)
        size = max(map(abs, end))
        st, ct, sr, cr = joint
        residuals = [
            ct * start[3] + st * start[0] / 8,
            cr * start[2] - sr * start[1] / 2,
            end[3] + 0.3 * root**4 * end[0] / 8,
            end[2] - 0.02 * root**4 * end[1] / 2,
            end[4] - root**4 * end[0] / 16,
        ]
        assert size > 1e-3
        assert max(map(abs, residuals)) < 1e-15 * size * max(1, *joint)


def test_decaying_basis_scales_the_same_function():
    plain, scaled = arm(), arm("decaying")
    (lam,) = plain.basis.wave_numbers
    values = {s_t: 0.3, c_t: 0.7, s_r: 0.9, c_r: 0.1, mu: 0.2, iota: 0.05}
    ratio = scaled.characteristic_function / plain.characteristic_function * exp(lam)
    ratios = [ratio.subs({**values, lam: pi * n / 7}).evalf(30) for n in range(3, 9)]
    assert all(abs(ratio - ratios[0]) < 1e-20 for ratio in ratios)
    huge = scaled.characteristic_function.subs({**values, lam: 1e4})
    assert abs(float(huge)) < 1e40
    assert float(huge) != 0


def test_prescribed_base_motion_is_reported_and_left_out():
    density = m * (w.diff(t) + v.diff(t)) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2
    forced = separate(derive(density, left=ROOT, right=TIP), parameters=GROUPS)
    assert forced.characteristic_polynomial == arm().characteristic_polynomial
    assert forced.spatial_problem.left_out == (-m * w.diff(t, 2),)
    omega, phi = forced.frequency, Function("phi")(x)
    assert forced.spatial_problem.field_equations == (Eq(-m * omega**2 * phi + B * phi.diff(x, 4), 0),)
    assert forced.spatial_problem.boundary_conditions[0] == Eq(B * phi.diff(x, 3).subs(x, 0), -k_t * phi.subs(x, 0))
    assert [condition.end for condition in forced.spatial_problem.boundary_conditions] == ["left"] * 2 + ["right"] * 2


# ------------------------------------------------------------------------------------------------------- strings, rods


def test_string_with_mass_and_spring():
    modal = separate(
        derive(STRING, essential=[v.subs(x, 0)], right=m_e * v.diff(t) ** 2 / 2 - k * v**2 / 2),
        parameters={m_e: mu * m * L, k: kappa * T / L},
    )
    (lam,) = modal.basis.wave_numbers
    expected = lam * cos(lam) + (kappa - mu * lam**2) * sin(lam)
    assert cancel(modal.characteristic_function * lam / expected) in (1, -1)
    assert modal.mode_shapes == (sin(lam * x / L),)


def test_free_rod_keeps_its_rigid_body_mode():
    modal = separate(derive(STRING))
    (lam,) = modal.basis.wave_numbers
    assert cancel(modal.characteristic_function / (lam * sin(lam))) in (1, -1)


def test_symmetric_interval_shifts_the_functions():
    modal = separate(derive(STRING, domain=(-L, L), essential=[v.subs(x, -L), v.subs(x, L)]))
    (lam,) = modal.basis.wave_numbers
    assert cancel(modal.characteristic_function * lam / sin(lam)) in (1, -1)
    assert simplify(modal.mode_shapes[0] - sin(lam * (x + L) / (2 * L))) == 0


def test_elastic_foundation_shifts_the_frequency_only():
    modal = separate(derive(BEAM - k * v**2 / 2, essential=CLAMPED))
    (lam,) = modal.basis.wave_numbers
    assert expand(modal.characteristic_function) in (
        expand(1 + cos(lam) * cosh(lam)),
        expand(-1 - cos(lam) * cosh(lam)),
    )
    beta4 = modal.basis.dispersion.rhs
    assert expand(beta4 - (m * modal.frequency**2 - k) / B) == 0


# -------------------------------------------------------------------------------- general problems: dynamic stiffness


def stiffness_determinant(form, values, z):
    """Return det of the conditions as a function of the initial state, by the matrix exponential."""
    numbers = {**values, form.parameter: z}
    system, boundary, free = (np.array(M.subs(numbers), dtype=complex) for M in (form.system, form.boundary, form.free))
    n, lumped = len(form.displacements), len(form.coordinates)
    size = n + lumped
    transfer = expm(system * complex(form.length.subs(numbers)))
    start = np.eye(2 * size)[:, : size + n]  # unknowns: q(0), w, P(0); r(0) = 0
    end = transfer @ start
    moves = np.vstack([start[:size], end[:n]])
    forces = np.vstack([-start[size : size + n], end[size + n :], end[size : size + n]]) + boundary @ moves
    fixed = np.linalg.svd(free.T)[2][free.shape[1] :]
    return np.linalg.det(np.vstack([free.T @ forces, fixed @ moves]))


VALUES = {L: 1.3, m: 1.1, B: 0.9, T: 2.0, k: 3.0, k_t: 20.0, k_r: 4.0, m_e: 0.4, J_e: 0.05, m_b: 2.0, G: 60.0, c: 0.3}
CASES = {
    "tension": (BEAM - T * v.diff(x) ** 2 / 2, {"left": ROOT, "right": TIP}),
    "compression": (BEAM + T * v.diff(x) ** 2 / 9, {"left": ROOT, "right": TIP}),
    "rayleigh": (BEAM + J_e * v.diff(x, t) ** 2 / 2, {"left": ROOT, "right": TIP}),
    "offset tip mass": (BEAM, {"left": ROOT, "right": m_e * (v.diff(t) + v.diff(x, t) / 5) ** 2 / 2}),
    "timoshenko": (
        TIMOSHENKO,
        {"fields": [v, psi], "left": -k_t * v**2 / 2 - k_r * psi**2 / 2, "right": m_e * v.diff(t) ** 2 / 2},
    ),
    "moving string": (m * (v.diff(t) + v.diff(x) / 2) ** 2 / 2 - T * v.diff(x) ** 2 / 2, {"left": -k * v**2 / 2}),
    "joint damper": (BEAM, {"left": ROOT, "virtual_work": [(-c * v.diff(t), v, "left")]}),
    "kelvin-voigt": (
        BEAM,
        {"left": ROOT, "right": TIP, "virtual_work": [(-c * v.diff(x, 2, t), v.diff(x, 2), "domain")]},
    ),
    "free base": (
        m * (v.diff(t) + w.diff(t)) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2,
        {
            "coordinates": [w],
            "left": ROOT + m_b * w.diff(t) ** 2 / 2 - k * w**2 / 2,
            "right": m_e * (v.diff(t) + w.diff(t)) ** 2 / 2,
        },
    ),
    "tied base": (
        BEAM,
        {
            "coordinates": [w],
            "left": m_b * w.diff(t) ** 2 / 2,
            "essential": [v.subs(x, 0) - w, v.diff(x).subs(x, 0)],
        },
    ),
    "rolling end": (BEAM, {"left": ROOT, "essential": [v.subs(x, L) + v.diff(x).subs(x, L) / 3]}),
    "third order": (m * v.diff(t) ** 2 / 2 - B * v.diff(x, 3) ** 2 / 50 - T * v.diff(x) ** 2 / 2, {"left": -k * v**2}),
}


@pytest.mark.parametrize("name", CASES)
def test_the_characteristic_function_is_the_dynamic_stiffness_of_the_state_form(name):
    """Both are entire with the same zeros, so their ratio does not depend on the frequency."""
    density, options = CASES[name]
    result = derive(density, **options)
    modal, form = separate(result), state_form(result)
    order = [*VALUES, modal.frequency, *modal.basis.wave_numbers]
    function = lambdify(order, modal.characteristic_function, "numpy")
    ratios = []
    for omega in (0.7, 2.3, 5.1):
        at = {**VALUES, modal.frequency: omega}
        given = {**at, **wave_numbers(modal, at)}
        value = function(*(complex(given[symbol]) for symbol in order))
        z = omega if form.damped else omega**2
        ratios.append(value / stiffness_determinant(form, VALUES, z))
    assert np.allclose(ratios, ratios[0], rtol=1e-6), ratios


def wave_numbers(modal, at):
    """Return the wave numbers times the length at a frequency."""
    given = {number: value for number, value in modal.basis.wave_numbers.items()}
    length = float(L.subs(at))
    if all(value is not None for value in given.values()):
        return {number: complex(value.subs(at)) for number, value in given.items()}
    dispersion = modal.basis.dispersion
    (r,) = dispersion.lhs.subs(at).free_symbols
    powers = [complex(a) for a in dispersion.lhs.subs(at).as_poly(r).all_coeffs()]
    roots = np.sqrt(np.roots(powers[::2])) if len(powers) > len(given) + 1 else np.roots(powers)
    return dict(zip(given, (length * complex(root) for root in roots), strict=True))


def test_mode_shape_of_a_free_base_moves_with_it():
    density, options = CASES["free base"]
    modal = separate(derive(density, **options))
    assert modal.still == Matrix([[-1]])
    assert len(modal.coefficients) == 5


# ------------------------------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("density", "words"),
    [
        (m * v.diff(t) ** 2 / 2 - B * (1 - x / L) * v.diff(x, 2) ** 2 / 2, "varies along x.*ritz"),
        (BEAM - T * v.diff(x) ** 4, r"T\*Derivative\(v\(x, t\), x\)\*\*4.*nonlinear"),
        (BEAM - T * cos(t) * v**2, "depends on t"),
    ],
)
def test_what_has_no_closed_form_says_so(density, words):
    with pytest.raises(HamiltonError, match=words):
        separate(derive(density))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"parameters": {k_t: "__import__('os')"}}, "parameters: k_t = .*must be a scalar"),
        ({"parameters": {k_t: ["k_t"]}}, "parameters: k_t = .*must be a scalar"),
        ({"parameters": {"k_t": 1}}, "'k_t': must be a Symbol"),
        ({"parameters": [1]}, "parameters = .*must be a mapping"),
        ({"basis": "exponential"}, "basis = 'exponential': must be 'hyperbolic' or 'decaying'"),
        ({"frequency": 3.0}, "3.0: must be a Symbol"),
    ],
)
def test_options_are_checked_and_no_text_is_read(options, message):
    with pytest.raises((TypeError, ValueError), match=message):
        separate(derive(BEAM, left=ROOT, right=TIP), **options)
    with pytest.raises(TypeError, match="result = 'text': must be a HamiltonResult"):
        separate("text")


def test_names_in_use_are_left_alone():
    lam, omega = symbols("lambda omega")
    modal = separate(derive(lam * v.diff(t) ** 2 / 2 - omega * v.diff(x) ** 2 / 2, essential=[v.subs(x, 0)]))
    assert not {lam, omega} & {modal.frequency, *modal.basis.wave_numbers}


def test_steps_read_from_the_equations_to_the_modes():
    modal = separate(derive(STRING, essential=[v.subs(x, 0)], right=-k * v**2 / 2))
    assert [step.name for step in modal.steps] == [
        "Spatial problem",
        "General solution",
        "Characteristic equation",
        "Modes",
    ]
    assert all(step._repr_latex_().startswith("$") for step in modal.steps)
    (lam,) = modal.basis.wave_numbers
    ratio = modal.characteristic_function / cos(lam)
    assert simplify(ratio.subs(k, 0)) in (1, -1, T, -T, T / L, -T / L)
