"""Polynomial Lagrangians: equations, linearisation, quadratures, and the tensors of their modal equations."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad

import cra_sym as cra
from cra_sym.mechanics import hamilton, separate
from cra_sym.symbols import L, t, v, x
from tests.nonlinear_models import BEAM, EI, beam, inextensible, k_3, mass, oscillator, q, shortening, sprung

P, g, a, k, F = sp.symbols("P g a k F", positive=True)
ONES = {EI: 1.0, mass: 1.0, L: 1.0}


def test_linear_functions_are_those_of_the_linearisation():
    stretched = BEAM - k * v.diff(x) ** 4 / 8 + k * v * v.diff(t) ** 2
    curved = beam(stretched, right=-k_3 * v**4 / 4 + k * v**3, inside=[(a, -k * v**2 / 2 - k * v**4)])
    straight = beam(BEAM, inside=[(a, -k * v**2 / 2)])
    values = {**ONES, k: 3.0, a: 0.4}
    found, wanted = curved.at({**values, k_3: 2.0}), straight.at(values)
    for function in (cra.natural_frequencies, lambda s: cra.mode_shapes(s, [0.3, 1.0])):
        np.testing.assert_array_equal(function(found), function(wanted))
    assert straight.linearised is straight.equations and not straight.nonlinear
    assert curved.nonlinear and curved.equations.field_equations != curved.linearised.field_equations


def test_linear_dampers_stay_and_nonlinear_forces_do_not():
    c = sp.Symbol("c", positive=True)
    work = [(-c * v.diff(t) - c * v**2 * v.diff(t), v, "right")]
    values = {**ONES, c: 0.1}
    found = beam(virtual_work=work).eigenvalues(values)
    np.testing.assert_array_equal(found, beam(virtual_work=[(-c * v.diff(t), v, "right")]).eigenvalues(values))


def test_forces_inside_push_the_section_there_and_their_nonlinear_part_is_left_out():
    """A spring as a force is the spring of an energy; with a cube added the principle is no longer linear."""
    values = {**ONES, k: 3.0}
    as_energy = beam(inside=[(L / 3, -k * v**2 / 2)])
    spring, hardening = (beam(virtual_work=[(force, v, L / 3)]) for force in (-k * v, -k * v - k * v**3))
    assert not spring.nonlinear and hardening.nonlinear
    wanted = cra.natural_frequencies(as_energy.at(values))
    for model in (spring, hardening):
        np.testing.assert_allclose(cra.natural_frequencies(model.at(values)), wanted, rtol=1e-12)
    free = cra.natural_frequencies(beam().at({name: value for name, value in ONES.items()}))
    assert wanted[0] > 1.01 * free[0]


def test_separation_of_a_nonlinear_principle_is_still_refused():
    principle = hamilton(BEAM - v**4, fields=[v], x=x, domain=(0, L), t=t)
    with pytest.raises(ValueError, match="nonlinear"):
        separate(principle)


def test_a_term_is_added_to_the_arm():
    arm = cra.Arm.nominal().replace(k_t=1e4, k_r=1e3)
    _, left, _ = cra.paper_lagrangian()
    v_arm = arm.model.equations.fields[0]
    harder = arm.model.replace(left=left - k_3 * v_arm**4 / 4).at({**arm.values, "k_3": 1e9}, zeta=arm.zeta)
    np.testing.assert_allclose(cra.natural_frequencies(harder), cra.natural_frequencies(arm), rtol=1e-12)
    force = next(c for c in harder.model.equations.boundary_conditions if c.end == "left")
    assert force.has(v_arm.subs(x, 0) ** 3)


# quadratures --------------------------------------------------------------------------------------------------------


def test_field_equations_and_conditions_with_a_quadrature():
    """Balance of forces, written by hand: the tension N(x) carries the inertia along x of all that lies beyond."""
    end = sp.Symbol("m", positive=True)
    density = BEAM + mass * shortening.diff(t) ** 2 / 2
    model = beam(density, right=end * shortening.diff(t) ** 2 / 2, quadratures={shortening: v.diff(x) ** 2 / 2})
    tension = sp.Function("N_s")(x, t)
    across, along, slope = (e.lhs - e.rhs for e in model.equations.field_equations)
    wanted = mass * v.diff(t, 2) + EI * v.diff(x, 4) - (tension * v.diff(x)).diff(x)
    assert sp.expand(across - wanted) == 0
    assert sp.expand(along - (tension.diff(x) + mass * shortening.diff(t, 2))) == 0
    assert sp.expand(slope - (v.diff(x) ** 2 / 2 - shortening.diff(x))) == 0
    last = model.equations.boundary_conditions[-1]
    assert sp.expand(last.lhs - last.rhs + tension.subs(x, L) - end * shortening.diff(t, 2).subs(x, L)) == 0
    assert model.equations.steps[-1].expression == model.equations.equations
    assert "N_s" not in repr(model) and pickle.loads(pickle.dumps(model)) == model


@pytest.mark.parametrize(
    ("load", "options", "tension"),
    [
        (0, {"right": P * shortening}, -P),
        (P * shortening, {}, -P * (L - x)),
        (P * x * shortening, {}, -P * (L**2 - x**2) / 2),
        (0, {"inside": [(L / 3, P * shortening)]}, -P * sp.Heaviside(L / 3 - x)),
    ],
)
def test_loads_on_a_shortening_are_tensions(load, options, tension):
    model = beam(BEAM + load, quadratures={shortening: v.diff(x) ** 2 / 2}, **options)
    wanted = beam(BEAM - tension * v.diff(x) ** 2 / 2)
    values = {**ONES, P: 0.7}
    np.testing.assert_allclose(model.natural_frequencies(values), wanted.natural_frequencies(values), rtol=1e-11)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"quadratures": {shortening: v.diff(x, t) ** 2}}, "quadratures: .* free of time derivatives"),
        ({"quadratures": {shortening: v.diff(x)}}, "quadratures: .* second degree"),
        ({"quadratures": {v: v.diff(x) ** 2}}, r"quadratures: v\(x, t\) must be a function"),
        ({"quadratures": [1]}, "quadratures"),
    ],
)
def test_bad_quadratures_are_named(change, message):
    with pytest.raises((TypeError, ValueError), match=message):
        beam(**change)


@pytest.mark.parametrize("term", [sp.sin(v), sp.sqrt(1 + v.diff(x) ** 2), 1 / (1 + v), v ** sp.Rational(5, 2)])
def test_terms_that_are_not_polynomial_have_equations_but_no_numbers(term):
    model = beam(BEAM - v**3 - term)
    assert model.equations.field_equations
    with pytest.raises(ValueError, match=r"density, term .* must be polynomial in the unknowns"):
        model.natural_frequencies(ONES)


def test_second_time_derivatives_in_a_nonlinear_term_are_named():
    system = beam(BEAM + v**2 * v.diff(t, 2)).at(ONES)
    with pytest.raises(ValueError, match=r"density, term .* first time derivatives only"):
        cra.nonlinear_modal_equations(system)


# coordinates alone --------------------------------------------------------------------------------------------------


def test_coordinates_alone_are_a_model():
    r = sp.Function("r")(t)
    chain = cra.Model(
        0,
        fields=(),
        coordinates=[q, r],
        x=x,
        domain=(0, 1),
        t=t,
        left=mass * q.diff(t) ** 2 / 2 + mass * r.diff(t) ** 2 / 2 - k * q**2 / 2 - k * (q - r) ** 2 / 2 - q**4,
        virtual_work=[(sp.Function("F")(t), q, None)],
    )
    system = chain.at({mass: 2.0, k: 3.0})
    squares, shapes = np.linalg.eigh(np.array([[6.0, -3.0], [-3.0, 3.0]]) / 2.0)
    np.testing.assert_allclose((2 * np.pi * cra.natural_frequencies(system, 2)) ** 2, squares, rtol=1e-12)
    found = np.stack([system.modes(2).coordinate(place) for place in range(2)])
    np.testing.assert_allclose(found, shapes * np.sign(shapes[0]) / np.sqrt(2.0), rtol=1e-12)
    np.testing.assert_allclose(chain.eigenvalues({mass: 2.0, k: 3.0}, 2).imag, np.sqrt(squares), rtol=1e-9)
    rate = cra.sensitivities(system, 2).log["k"]
    np.testing.assert_allclose(rate, 0.5, rtol=1e-9)
    frequency = np.array([1.0, 2.0, 5.0])
    dynamic = [np.array([[6.0, -3.0], [-3.0, 3.0]]) - 2.0 * w**2 * np.eye(2) for w in frequency]
    receptance = [np.linalg.inv(matrix)[0, 0] for matrix in dynamic]
    np.testing.assert_allclose(cra.frequency_response(system, frequency, drive=q), receptance, rtol=1e-9)
    linear = chain.replace(left=chain.linearised.left).at({mass: 2.0, k: 3.0})
    pushed = cra.tip_response(linear, {sp.Function("F")(t): cra.Force(1.0)}, 1.7, modes=2)
    omega = np.sqrt(squares)
    weights = found[0] ** 2 / omega**2
    np.testing.assert_allclose(pushed, (weights * (1 - np.cos(1.7 * omega))).sum(), rtol=1e-10)
    lower, upper = cra.stability_boundary(system, cra.Fluctuation(k=1.0), 0.1, modes=2)
    growth = cra.growth_rate(system, cra.Fluctuation(k=1.0), [lower - 0.01, (lower + upper) / 2, upper + 0.01], 0.1, 2)
    assert growth[1] > 0.01 and growth[0] < 1e-12 and growth[2] < 1e-12


# tensors ------------------------------------------------------------------------------------------------------------


def test_tensors_of_the_inextensible_arm():
    """Closed forms of one mode, 3 K/(4 omega) - J omega/4, and every entry by adaptive quadrature."""
    equations = cra.nonlinear_modal_equations(inextensible(), 3)
    assert equations.error < 1e-13
    inertia, bending = (next(e for e in equations.polynomials.energies if e.velocities == n) for n in (2, 0))
    omega = equations.polynomials.omega
    one = [
        3 * -2 * bending.tensor[(i,) * 4] / (4 * w) - 2 * inertia.tensor[(i,) * 4] * w / 4 for i, w in enumerate(omega)
    ]
    np.testing.assert_allclose(one, [0.272611, -568.8790, -13814.81], rtol=2e-6)  # the digits that are published

    def slope(n):
        return lambda at: cra.mode_shapes(inextensible(), at, 3, derivative=1)[n]

    def bent(n):
        return lambda at: cra.mode_shapes(inextensible(), at, 3, derivative=2)[n]

    def short(i, j):
        return lambda at: quad(lambda s: slope(i)(s) * slope(j)(s), 0, at, epsabs=1e-6)[0]

    def integral(f):
        return quad(f, 0, 1, epsabs=1e-4, epsrel=1e-6, limit=20)[0]

    i, j, m, n = 0, 1, 0, 1
    entry = integral(lambda s: (bent(i)(s) * slope(j)(s)) ** 2)
    mixed = integral(lambda s: bent(i)(s) * bent(j)(s) * slope(i)(s) * slope(j)(s))
    rows = [entry, integral(lambda s: (bent(j)(s) * slope(i)(s)) ** 2), *[mixed] * 4]
    np.testing.assert_allclose(bending.tensor[i, i, j, j], -0.5 * sum(rows) / 6, rtol=1e-6)
    np.testing.assert_allclose(
        inertia.tensor[i, j, m, n],
        0.25 * sum(integral(lambda s, p=p: short(*p)(s) ** 2) for p in ((0, 1),))
        + 0.25 * integral(lambda s: short(0, 0)(s) * short(1, 1)(s)),
        rtol=1e-5,
    )


def test_tensors_are_symmetric_and_energy_is_conserved():
    polynomials = cra.nonlinear_modal_equations(inextensible(), 3).polynomials
    for term in polynomials.energies:
        turned = term.tensor.transpose(1, 0, *range(2, term.tensor.ndim))
        np.testing.assert_allclose(term.tensor, turned, rtol=1e-12)
    from scipy.integrate import solve_ivp

    def rate(_, state):
        place, speed = state[None, :3], state[None, 3:]
        found = polynomials.derivatives(place, speed)
        # d/dt (v + momentum) = -omega^2 q + force
        inertia = np.eye(3) + found.momentum_v[0]
        force = -(polynomials.omega**2) * state[:3] + found.force[0] - found.momentum_q[0] @ state[3:]
        return np.append(state[3:], np.linalg.solve(inertia, force))

    start = np.array([0.2, 0.01, 0.002, 0.0, 0.3, 0.0])
    run = solve_ivp(rate, (0, 5), start, method="DOP853", rtol=1e-11, atol=1e-13)
    energy = polynomials.energy(run.y[:3].T, run.y[3:].T)
    assert np.ptp(energy) < 1e-8 * energy[0]  # a thousand times the tolerance of a step: they add up
    still = polynomials.energy(start[:3], np.zeros(3))
    np.testing.assert_allclose(still, polynomials.potential(start[:3]), rtol=1e-14)


def test_terms_at_ends_inside_and_of_third_degree():
    at = 0.37
    model = beam(BEAM - P * v**3, right=-k_3 * v.diff(x) ** 4, inside=[(a, g * v**2 * v.diff(t))])
    system = model.at({**ONES, P: 2.0, k_3: 3.0, g: 5.0, a: at})
    terms = {
        (e.positions, e.velocities): e.tensor for e in cra.nonlinear_modal_equations(system, 2).polynomials.energies
    }
    shape = [lambda s, n=n: cra.mode_shapes(system, s, 2)[n] for n in range(2)]
    wanted = -2.0 * quad(lambda s: shape[0](s) ** 2 * shape[1](s), 0, 1)[0]
    np.testing.assert_allclose(terms[3, 0][0, 1, 0], wanted, rtol=1e-9)
    tip = cra.modal_parameters(system, 2).tip_slope
    np.testing.assert_allclose(terms[4, 0], -3.0 * np.einsum("i,j,k,l", *[tip] * 4), rtol=1e-12)
    there = cra.mode_shapes(system, at, 2)
    np.testing.assert_allclose(terms[2, 1], 5.0 * np.einsum("i,j,k", *[there] * 3), rtol=1e-10)


def test_modal_equations_of_a_batch_and_of_too_many_modes_are_refused():
    with pytest.raises(ValueError, match="batch shape"):
        cra.nonlinear_modal_equations(sprung().replace(k_3=[1.0, 2.0]))
    with pytest.raises(ValueError, match=r"modes = 40: .* too many coefficients"):
        cra.nonlinear_modal_equations(beam(BEAM - v**6).at(ONES), 40)


def test_a_force_in_nonlinear_terms_alone_is_refused_by_linear_results():
    F = sp.Function("F")(t)
    system = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 + F * q**3 / 3).at({})
    pulse = cra.Force.sampled([0.0, 0.5, 1.0], [0.0, 1.0, 0.0])
    assert np.isfinite(cra.tip_response(system, {F: pulse}, [0.0, 2.0], modes=1, initial={q: 1.0})).all()
    with pytest.raises(ValueError, match="F acts in nonlinear terms alone"):
        cra.residual_vibration(system, {F: pulse}, modes=1)
