"""Ritz values on Hermite elements against the exact solver, closed forms, and sums that every spectrum has."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose

import cra_sym as cra

x, t = sp.symbols("x t")
L, EI, rhoA, m_e, k_t, k_r, c, P, e = sp.symbols("L EI rhoA m_e k_t k_r c P e")
v = sp.Function("v")(x, t)
w = sp.Function("w")(t)
HALF = sp.Rational(1, 2)
BEAM = HALF * rhoA * v.diff(t) ** 2 - HALF * EI * v.diff(x, 2) ** 2
JOINT = -HALF * k_t * v**2 - HALF * k_r * v.diff(x) ** 2
TIP = HALF * m_e * v.diff(t) ** 2
OFFSET = HALF * m_e * (v.diff(t) + e * v.diff(x, t)) ** 2
VALUES = {EI: 4.6, rhoA: 0.24, L: 1.1, m_e: 0.05, k_t: 900.0, k_r: 40.0}
UNIT = {EI: 1.0, rhoA: 1.0, L: 1.0}
CLAMPED = [v.subs(x, 0), v.diff(x).subs(x, 0)]
HINGED = [v.subs(x, 0), v.subs(x, L)]


def beam(density=BEAM, **options):
    return cra.Model(density, fields=[v], x=x, domain=(0, L), t=t, **options)


def arm(density=BEAM, **options):
    return beam(density, **{"left": JOINT, "right": TIP, **options})


def rounding(elements):
    """What double precision leaves of a squared frequency of a beam on springs that are not soft: eps times the
    condition of the stiffness with ones on its diagonal, which is the fourth power of the number of elements."""
    return np.finfo(float).eps * np.asarray(elements, dtype=float) ** 4


def cubic_error(hertz, elements, slenderness=1.0):
    """Leading term of the relative error: h^4 / 1440 times |v_xxxx|^2 / |v_xx|^2, with the bending energy for |.|^2.

    With EI v_xxxx = rhoA omega^2 v it is at most this: springs and tip masses have no such error. ``slenderness`` is
    the largest rhoA L^4 / EI.
    """
    return (2 * np.pi * hertz) ** 2 * slenderness / elements**4 / 1440


def assert_order(error, order, blurred):
    """Check the order of three errors, each on half the element length of the one before.

    The next term is two orders higher, so what is missing to the order falls to a quarter: here it must to a half.
    """
    coarse, fine = np.abs(np.log2(error[:-1] / error[1:]) - order)
    assert (error > 0).all() and coarse < 0.5
    assert fine < coarse / 2 + blurred / error[-1] / np.log(2.0)


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_ritz_converges_from_above_at_the_theoretical_rate(mode):
    """Cubic elements, second derivatives in the energy: the eigenvalue error falls as h^4."""
    model = arm()
    exact = model.natural_frequencies(VALUES)[mode]
    elements = np.array([4, 8, 16])
    error = np.array([model.ritz(elements=int(n)).natural_frequencies(VALUES)[mode] for n in elements]) / exact - 1
    assert_order(error, 4, rounding(16))


@pytest.mark.parametrize("stiffness", [1e2, 1e4, 1e6, 1e8, 1e10, 1e14, np.inf])
def test_a_stiff_joint_takes_no_digits_from_the_lowest_frequencies(stiffness):
    """An offset tip mass on springs; the right values are the exact solver's."""
    model, elements = arm(right=OFFSET), 40
    values = {**UNIT, m_e: 0.3, e: 0.2, k_t: stiffness, k_r: stiffness}
    exact = model.natural_frequencies(values, modes=4)
    error = model.ritz(elements).natural_frequencies(values, modes=4) / exact - 1
    assert (error > -rounding(elements)).all()
    assert (error < cubic_error(exact, elements) + rounding(elements)).all()
    assert abs(error[0]) < 1.1e-9  # both together for the first mode, omega = 1.34


@pytest.mark.parametrize("stiffness", [1.0, 1e4, 1e10])
def test_all_values_together_have_the_sums_of_the_matrices(stiffness):
    """Sum of omega^2 = tr(M^-1 K), which the highest make, and of omega^-2 = tr(K^-1 M), which the lowest make."""
    numbers = arm(right=OFFSET).ritz(4)
    values = {**UNIT, m_e: 0.3, e: 0.2, k_t: stiffness, k_r: stiffness}
    ((_, stiff, _, mass),) = numbers._numbers(numbers._columns(values)[0])
    squares = (2 * np.pi * numbers.natural_frequencies(values, modes=numbers.matrices.free)) ** 2
    # singular values round relative to the largest, their squares twice that; the solutions by the condition of K and M
    scale = np.diag(stiff)[:, None] ** -0.5
    lost = 8 * np.finfo(float).eps * np.array([np.linalg.cond(mass), np.linalg.cond(scale * stiff * scale.T)])
    blurred = 8 * np.finfo(float).eps * np.sqrt(squares[-1] / squares[0])
    assert_allclose(squares.sum(), np.trace(np.linalg.solve(mass, stiff)), rtol=lost[0] + blurred)
    assert_allclose((1 / squares).sum(), np.trace(np.linalg.solve(stiff, mass)), rtol=lost[1])


def test_rigid_motions_are_exact_zeros():
    """Free in two ways, turning about a hinge, sliding, carried by a free mass; the elastic ones are unharmed."""
    base = arm(
        BEAM.subs(v.diff(t), v.diff(t) + w.diff(t)),
        left=HALF * m_e * w.diff(t) ** 2 + JOINT,
        right=None,
        coordinates=[w],
    )
    cases = [
        (arm(), {k_t: 0.0, k_r: 0.0}, 2),
        (arm(), {k_t: np.inf, k_r: 0.0}, 1),
        (arm(), {k_t: 1e8, k_r: 0.0}, 1),
        (arm(), {k_t: 0.0, k_r: np.inf}, 1),
        (base, {k_t: 1e6, k_r: 1e6}, 1),
        (base, {k_t: 0.0, k_r: 0.0}, 3),
    ]
    for elements in (1, 12):
        for model, springs, rigid in cases:
            values = {**UNIT, m_e: 3.0, **springs}
            found = model.ritz(elements).natural_frequencies(values, modes=rigid + 1)
            assert (found[:rigid] == 0.0).all() and found[rigid] > 0.1
            exact = model.natural_frequencies(values, modes=rigid + 1)[rigid]
            # one element is far from the leading term: it only has to be above
            bound = cubic_error(exact, elements) + rounding(elements) if elements > 1 else 1.0
            assert -rounding(elements) < found[rigid] / exact - 1 < bound


def test_rigid_motions_among_complex_eigenvalues():
    """A damper on the left end of a free beam: two zeros, and the end that comes to rest with s = -4 c / m."""
    free = beam(virtual_work=[(-c * v.diff(t), v, "left")])
    values = {**UNIT, c: 1e-3}
    s = free.ritz(12).eigenvalues(values, 4, oscillating=False)
    assert (s[:2] == 0.0).all()
    assert s[2] == pytest.approx(-4e-3, rel=1e-6)  # what bends the beam is of second order in the damper
    assert_allclose(s[3], free.ritz(12).eigenvalues(values, 1)[0], rtol=1e-12)
    # mass-normalised displacement 2 of a free end, first order in the damper; twelve elements: 22.4^2 / 12^4 / 1440
    assert s[3] == pytest.approx(-4e-3 / 2 + 22.3732854480j, rel=1.8e-5)


@pytest.mark.parametrize("load", [1.0, np.pi**2 * (1 - 1e-4), np.pi**2 * (1 + 1e-4), 39.0, 40.0, 89.0])
def test_a_buckled_column_is_refused(load):
    """Euler: n^2 pi^2, hinged at both ends; omega^2 = n^2 pi^2 (n^2 pi^2 - P) before."""
    column = beam(BEAM + HALF * P * v.diff(x) ** 2, essential=HINGED)
    number = int(np.sqrt(load) / np.pi)
    if number:
        modes = f"{number} unstable mode{'s' * (number > 1)}"
        with pytest.raises(ValueError, match=rf"the structure has buckled: {modes} \(omega\^2 < 0\)"):
            column.ritz(20).natural_frequencies({**UNIT, P: load})
    else:
        found = column.ritz(20).natural_frequencies({**UNIT, P: load})
        n = np.pi * np.arange(1, 4)
        error = (2 * np.pi * found) ** 2 - n**2 * (n**2 - load)
        # of the elastic energy h^4 n^4 / 720, of the load's even less (its sign helps): relative to the unloaded n^4
        assert (np.abs(error) < 1.1 * n**8 / 20**4 / 720 + rounding(20) * n**4).all()


def test_follower_force_on_elements():
    """Beck's column: closed form in 30 digits at P = 30, both pairs; also where the symmetric part is singular."""
    options = {"essential": CLAMPED, "virtual_work": [(-P * v.diff(x), v, "right")]}
    column = beam(BEAM + HALF * P * v.diff(x) ** 2, **options)
    found = column.ritz(20).eigenvalues({**UNIT, P: 30.0}, 2)
    pair = np.array([-7.10122144585 + 10.24915896084j, 7.10122144585 + 10.24915896084j])
    # 20 elements are 8e-6 off, however they round
    assert_allclose(found[np.argsort(found.real)], pair, rtol=2e-5)
    refined = column.eigenvalues({**UNIT, P: 30.0}, 2)
    assert_allclose(refined[np.argsort(refined.real)], pair, rtol=1e-11)  # the closed form's digits, to 4e-13
    euler = column.ritz(20).eigenvalues({**UNIT, P: np.pi**2 / 4}, 2)
    assert_allclose(euler, column.eigenvalues({**UNIT, P: np.pi**2 / 4}, 2), rtol=5e-5)
    stiff = arm(BEAM + HALF * P * v.diff(x) ** 2, virtual_work=options["virtual_work"]).ritz(4)
    with pytest.raises(ValueError, match="symmetric"):
        stiff.natural_frequencies({**VALUES, k_t: 1e16, P: 1.0})


@pytest.mark.parametrize("stiffness", [1.0, 1e6, 1e10])
def test_a_damped_stiff_joint(stiffness):
    """Complex eigenvalues keep the same digits: the error of the elements and the rounding of the frequencies."""
    model, elements = arm(right=OFFSET, virtual_work=[(-c * v.diff(t), v, "right")]), 30
    values = {**UNIT, m_e: 0.3, e: 0.2, c: 0.1, k_t: stiffness, k_r: stiffness}
    exact = model.eigenvalues(values, 2)
    # a spring softer than the beam adds to the condition number; complex roots are not bounds: twice the error
    bound = 2 * cubic_error(np.abs(exact) / (2 * np.pi), elements) + rounding(elements) * max(1.0, 16 / stiffness)
    assert (np.abs(model.ritz(elements).eigenvalues(values, 2) / exact - 1) < bound).all()


def test_ritz_of_a_string_converges_faster():
    """The same cubics for a first derivative: h^6."""
    T, rho = sp.symbols("T rho")
    y = sp.Function("y")(x, t)
    string = cra.Model(
        HALF * rho * y.diff(t) ** 2 - HALF * T * y.diff(x) ** 2,
        fields=[y],
        x=x,
        domain=(0, L),
        t=t,
        left=-HALF * k_t * y**2,
        right=HALF * m_e * y.diff(t) ** 2,
    )
    values = {T: 3.0, rho: 0.5, L: 1.0, k_t: 7.0, m_e: 0.2}
    exact = string.natural_frequencies(values)[2]
    error = np.array([string.ritz(elements=n).natural_frequencies(values)[2] / exact - 1 for n in (8, 16, 32)])
    assert_order(error, 6, np.finfo(float).eps * 32**2)  # the condition of a string grows with the square


def test_ritz_bounds_the_exact_solver_for_varying_coefficients():
    """A hanging, tapered arm with a tip mass: no closed form, two routes."""
    g, a = sp.symbols("g a")
    thickness = 1 - a * x / L
    area = rhoA * thickness
    below = sp.integrate(area, (x, x, L)) + m_e
    density = (
        HALF * area * v.diff(t) ** 2
        - HALF * EI * thickness**3 * v.diff(x, 2) ** 2
        - HALF * g * sp.expand(below) * v.diff(x) ** 2
    )
    model = arm(density)
    values = {**VALUES, g: 9.81, a: 0.6}
    exact = model.natural_frequencies(values, modes=4)
    bound = model.ritz(elements=40).natural_frequencies(values, modes=4)
    assert (bound > exact * (1 - rounding(40))).all()
    # thinnest at the tip; what the slowly varying coefficients add to v_xxxx is less than what that makes too much
    assert (bound / exact - 1 < cubic_error(exact, 40, 0.24 * 1.1**4 / (4.6 * 0.4**2)) + rounding(40)).all()


def test_ritz_treats_infinite_stiffness_like_the_exact_solver():
    model = arm()
    values = {**VALUES, k_t: [np.inf, np.inf, 900.0], k_r: [np.inf, 40.0, np.inf]}
    exact = model.natural_frequencies(values)
    error = model.ritz(elements=30).natural_frequencies(values) / exact - 1
    assert (error > -rounding(30)).all()
    assert (error < cubic_error(exact, 30, 0.24 * 1.1**4 / 4.6) + rounding(30)).all()
    with pytest.raises(ValueError, match="EI = inf"):
        model.ritz(elements=2).natural_frequencies({**VALUES, EI: np.inf})
