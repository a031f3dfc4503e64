"""Damped models that vary along x, with inertia of the highest derivative too: shooting, and limits in closed form."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import cra_sym as cra
from cra_sym.model.symmetry import vanishes

x, t = sp.symbols("x t")
HALF = sp.Rational(1, 2)
v, F = sp.Function("v")(x, t), sp.Function("F")(t)
SHOOTING = 2e-11
"""DOP853 at 1e-13 of each step of at most 1/40 of the domain, and a Newton step from a difference quotient."""


def rod(mass, lateral, stiffness, dampers, **options):
    """Love's rod: its lateral inertia moves with the strain."""
    density = (mass * v.diff(t) ** 2 + lateral * v.diff(x, t) ** 2 - stiffness * v.diff(x) ** 2) / 2
    options = {"essential": [v.subs(x, 0)], **options}
    return cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, virtual_work=dampers, **options)


def end_damper(constant):
    return (-constant * v.diff(t), v, "right")


def newton_step(s, rate, start, spans, end):
    """Return the relative Newton step from s by shooting.

    ``rate(s, place, span)`` is the matrix of y' = A y, ``start`` the states that the left end allows, ``end(s)`` the
    rows that vanish at the right one; the states jump by ``spans[k][2](s)`` at the end of a span.
    """

    def value(s):
        y = start(s)
        shape = y.shape
        for number, (left, right, jump) in enumerate(spans):

            def slope(place, z, number=number):
                return (rate(s, place, number) @ z.reshape(shape)).ravel()

            y = solve_ivp(
                slope, (left, right), y.ravel(), method="DOP853", rtol=1e-13, atol=1e-14, max_step=0.025
            ).y[:, -1].reshape(shape)  # fmt: skip
            y = jump(s) @ y
        return np.linalg.det(end(s) @ y)

    step = 1e-5 * abs(s)
    here, slope = value(s), (value(s + step) - value(s - step)) / (2 * step)
    return abs(here / slope) / abs(s)


def random_coefficients(rng, spans, kind):
    """Return a positive coefficient for each span, as an expression."""
    found = []
    for _ in range(spans):
        size, slope = sp.Rational(int(rng.integers(50, 200)), 100), sp.Rational(int(rng.integers(-40, 60)), 100)
        detail = {"jump": slope * x, "wavy": sp.sin(int(rng.integers(3, 12)) * x) / 3, "layer": 2 * sp.exp(-25 * x)}
        found.append(size * (1 + detail[kind]))
    return found


def joined(parts, edges):
    pairs = [(part, x < edge) for part, edge in zip(parts[:-1], edges[1:-1], strict=True)]
    return sp.Piecewise(*pairs, (parts[-1], True)) if pairs else parts[0]


@pytest.mark.sample(6, 3)
@pytest.mark.parametrize("seed", range(40))
def test_random_rods_and_beams_whose_highest_derivative_has_inertia(seed):
    """Rods with lateral inertia, beams whose curvature has inertia; dampers of every kind, a mass at a jump."""
    rng = np.random.default_rng(seed)
    order, kind = int(rng.integers(1, 3)), ("jump", "wavy", "layer")[int(rng.integers(3))]
    edges = [sp.S.Zero, *sp.sets.FiniteSet(*(sp.Rational(int(k), 20) for k in rng.integers(2, 19, 2))), sp.S.One]
    spans = len(edges) - 1
    small = sp.Rational(1, 10 ** (1 + order)) * int(rng.integers(1, 4 if order == 2 else 20))
    mass, stiffness, strain_mass = (random_coefficients(rng, spans, kind) for _ in range(3))
    along, inner = ([c * int(rng.integers(2)) for c in random_coefficients(rng, spans, kind)] for _ in range(2))
    constant, weight = float(rng.uniform(0.05, 2)), float(rng.uniform(0, 1))
    top = v.diff(x, order)
    work = [
        end_damper(constant), (-joined(along, edges) * v.diff(t) / 4, v, "domain"),
        (-joined(inner, edges) * top.diff(t) / 500, top, "domain"),
    ]  # fmt: skip
    density = (
        joined(mass, edges) * v.diff(t) ** 2
        + small * joined(strain_mass, edges) * top.diff(t) ** 2
        - joined(stiffness, edges) * top**2
    ) / 2
    clamped = [v.subs(x, 0), v.diff(x).subs(x, 0)][:order]
    model = cra.Model(
        density, fields=[v], x=x, domain=(0, 1), t=t, essential=clamped, virtual_work=work,
        inside=[(edges[1], weight * v.diff(t) ** 2 / 2)],
    )  # fmt: skip
    system = model.at({})
    found = cra.eigenvalues(system, 2)
    parts = [[sp.lambdify(x, part) for part in each] for each in (mass, stiffness, strain_mass, along, inner)]
    jumps = {1: lambda s: np.eye(2 * order) + weight * s**2 * np.eye(2 * order)[:, [order]] * np.eye(2 * order)[0]}

    def rate(s, place, span):
        m, w, h, c, d = (each[span](place) for each in parts)
        moment, load = 1 / (w + s * d / 500 + s**2 * float(small) * h), s**2 * m + s * c / 4
        if order == 1:
            return np.array([[0, moment], [load, 0]])
        return np.array([[0, 1, 0, 0], [0, 0, 0, moment], [load, 0, 0, 0], [0, 0, -1, 0]])

    def end(s):
        return np.array([[s * constant, 1]]) if order == 1 else np.array([[s * constant, 0, 1, 0], [0, 0, 0, 1]])

    places = [(float(a), float(b), jumps.get(k + 1, lambda s: np.eye(2 * order)))
              for k, (a, b) in enumerate(pairwise(edges))]  # fmt: skip
    for s in found:
        step = newton_step(s, rate, lambda s: np.eye(2 * order, dtype=complex)[:, order:], places, end)
        assert step < system.accuracy + SHOOTING
    assert system.accuracy <= 1e-10


def test_where_eigenvalues_accumulate_is_told():
    """Lateral inertia 1 + x over 100 outweighs a unit stiffness from |s|^2 = 50 to 100 on."""
    system = rod(1, (1 + x) / 100, 1, [end_damper(0.01)]).at({})
    few = cra.eigenvalues(system, 4)
    assert np.abs(few[-1]) < np.sqrt(50)
    with pytest.raises(ValueError, match=r"accumulate at \|s\| = 7\.0\d+ to 9\.9\d+ rad/s, .* only \d+ precede them"):
        cra.eigenvalues(system, 30)


def test_time_response_by_complex_modes_of_such_a_rod():
    """The inertia of the strain leaves motions beyond the first modes; the response converges to that of a polynomial
    basis, integrated by the matrix exponential."""
    model = rod(1 + x / 2, (1 + x) / 100, 2 - x, [end_damper(0.3)], right=v * F, prescribed=[F])
    times = np.linspace(0.0, 6.0, 7)
    force = {F: cra.Force(amplitude=1.0, angular_frequency=1.3)}
    found = cra.response(model.at({}), force, times, [1.0], modes=6)[0]
    points, weights = np.polynomial.legendre.leggauss(60)
    at, weights = (points + 1) / 2, weights / 2
    size = 20
    legendre = [np.polynomial.Legendre.basis(k, domain=[0, 1]) for k in range(size)]
    shape = np.array([at * p(at) for p in legendre])
    slope = np.array([p(at) + at * p.deriv()(at) for p in legendre])
    tip = np.array([p(1.0) for p in legendre])
    mass = (shape * weights * (1 + at / 2)) @ shape.T + (slope * weights * (1 + at) / 100) @ slope.T
    inverse = np.linalg.inv(mass)
    system = np.zeros((2 * size, 2 * size))
    system[:size, size:] = np.eye(size)
    system[size:, :size] = -inverse @ ((slope * weights * (2 - at)) @ slope.T)
    system[size:, size:] = -0.3 * inverse @ np.outer(tip, tip)
    steady = np.linalg.solve(1.3j * np.eye(2 * size) - system, np.concatenate([np.zeros(size), inverse @ tip]))
    exact = [tip @ (np.imag(steady * np.exp(1.3j * T)) - expm(system * T) @ steady.imag)[:size] for T in times]
    np.testing.assert_allclose(found, exact, atol=1e-6)


# narrow features ------------------------------------------------------------------------------------------------------

PLACE = sp.Rational(437, 1000)


@pytest.mark.parametrize("width", [1e-4, 1e-6])
@pytest.mark.parametrize("what", ["mass", "damper", "spring"])
def test_a_narrow_bump_is_what_acts_at_a_point(what, width):
    """Of unit integral, of mass, damping or stiffness: the difference falls with the square of the width."""
    small = sp.Rational(str(width))
    bump = sp.exp(-(((x - PLACE) / small) ** 2)) / small / sp.sqrt(sp.pi)
    plain = v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2
    options = {"fields": [v], "x": x, "domain": (0, 1), "t": t, "essential": [v.subs(x, 0), v.diff(x).subs(x, 0)]}
    energy = {"mass": v.diff(t) ** 2 / 2, "damper": 0, "spring": -10 * v**2 / 2}[what]
    along = [(-bump * v.diff(t), v, "domain")] * (what == "damper")
    narrow = cra.Model(plain + bump * energy, virtual_work=[end_damper(0.1), *along], **options)
    if what == "damper":  # a jump of the shear force: two spans
        found, expected = narrow.eigenvalues({}, 2), spans_with_a_damper()
    else:
        point = cra.Model(plain, virtual_work=[end_damper(0.1)], inside=[(PLACE, energy)], **options)
        found, expected = narrow.eigenvalues({}, 2), point.eigenvalues({}, 2)
    np.testing.assert_allclose(found, expected, rtol=10 * width**2 + 1e-10)


PULSES = {
    "at the right end": sp.Piecewise((1000, x > sp.Rational(95, 100)), (0, True)),
    "at the left end": sp.Piecewise((10**5, x < sp.Rational(1, 10)), (0, True)),
    "inside": 1000 * (sp.Heaviside(x - sp.Rational(45, 100)) - sp.Heaviside(x - sp.Rational(47, 100))),
    "boundary layer": 10**5 * sp.exp(-1000 * (1 - x)),
}


@pytest.mark.parametrize("kind", PULSES)
def test_a_force_on_a_short_part_is_not_lost(kind):
    """A foundation on it, as potential or as work; a follower force there; against Hermite elements."""
    pulse, beam = PULSES[kind], v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2
    options = {"fields": [v], "x": x, "domain": (0, 1), "t": t, "essential": [v.subs(x, 0), v.diff(x).subs(x, 0)]}
    founded = cra.Model(beam - pulse * v**2 / 2, **options)
    elements = np.array([founded.ritz(elements=n).natural_frequencies({}, 2) for n in (80, 160)])
    rough = 4 * np.abs(elements[1] - elements[0]) + 1e-6 * elements[1]  # of the uniform mesh that splits the pulse
    found = founded.natural_frequencies({}, 2)
    assert (np.abs(found - elements[1]) < rough).all() and found[0] > 0.56 > 1.0005 * WITHOUT
    worked = cra.Model(beam, virtual_work=[(-pulse * v, v, "domain")], **options)
    np.testing.assert_allclose(2j * np.pi * found, worked.eigenvalues({}, 2), rtol=1e-10)
    follower = cra.Model(beam, virtual_work=[(-pulse * v.diff(x) / 10, v, "domain")], **options)
    assert abs(follower.eigenvalues({}, 1)[0].imag) > 1.001 * 2 * np.pi * WITHOUT


WITHOUT = 3.5160152685001 / 2 / np.pi  # of the cantilever alone


def test_sums_that_cancel_on_every_part_and_those_that_do_not():
    a, b = sp.symbols("a b")
    step = sp.Piecewise((a, x < HALF), (b, True))
    assert vanishes(step * step / step - step, x)
    assert vanishes(sp.Piecewise((2 * a, x < HALF), (2 * b, True)) - 2 * step, x)
    pulse = sp.Piecewise((a, (x > HALF) & (x < HALF + sp.Rational(1, 1000))), (0, True))
    assert not vanishes(pulse, x)
    assert not vanishes(sp.Piecewise((2 * a, x < HALF), (2 * b, True)) - 2 * step + pulse, x)
    assert not vanishes(sp.exp(-((x - 1) ** 2) * 10**9) * (a + b * x), x)


def spans_with_a_damper():
    """Return the first two eigenvalues of the uniform cantilever with dampers 1 at PLACE and 1/10 at the tip."""

    def rate(s, place, span):
        return np.array([[0, 1, 0, 0], [0, 0, 0, 1], [s**2, 0, 0, 0], [0, 0, -1, 0]])

    def value(s):
        y = np.eye(4, dtype=complex)[:, 2:]
        y = expm(rate(s, 0, 0) * float(PLACE)) @ y
        y[2] += s * y[0]
        y = expm(rate(s, 0, 0) * (1 - float(PLACE))) @ y
        return np.linalg.det(np.array([y[2] + s * y[0] / 10, y[3]]))

    found = []
    for s in (-0.2 + 3.5j, -1.0 + 22.0j):
        for _ in range(30):
            slope = (value(s * (1 + 1e-6)) - value(s * (1 - 1e-6))) / (2e-6 * s)
            s -= value(s) / slope
        found.append(s)
    return found


@pytest.mark.parametrize("lever", [0, HALF, 1])
@pytest.mark.parametrize("soft", [1e-12, 1e-100, 1e-290])
def test_a_rigid_beam_on_a_soft_spring_and_a_damper(lever, soft):
    """Beside a free rotation about the spring: (m, J) s^2 + c b b' s + k a a' of levers a of the spring, b of the
    damper, with one eigenvalue 0 and no stiffness along x to see."""
    k, c = sp.symbols("k c")
    energy = -k * v**2 / 2
    options = {0: {"left": energy}, HALF: {"inside": [(HALF, energy)]}, 1: {"right": energy}}[lever]
    density = (1 + x / 2) * v.diff(t) ** 2 / 2 - (2 - x) * v.diff(x, 2) ** 2 / 2
    model = cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, virtual_work=[end_damper(c)], **options)
    damper = 1e-2 * np.sqrt(soft)
    found = model.eigenvalues({k: soft, c: damper}, 1)
    mass = np.array([[5 / 4, 2 / 3], [2 / 3, 11 / 24]])  # integrals of (1 + x / 2) (1, x; x, x^2)
    spring, pull = (np.outer(arm, arm) for arm in ([1.0, float(lever)], [1.0, 1.0]))
    zero, one = np.zeros((2, 2)), np.eye(2)
    inverse = np.linalg.inv(mass)
    rates = np.linalg.eigvals(np.block([[zero, one], [-inverse @ spring, -0.01 * inverse @ pull]]))
    expected = rates[rates.imag > 0.1] * np.sqrt(soft)
    np.testing.assert_allclose(found, expected, rtol=max(1e-10, 100 * soft))


# periodic cells -------------------------------------------------------------------------------------------------------

WAVE = sp.sin(2 * sp.pi * 30 * x)
CELLS = {
    "tension": (1 + 0.8 * WAVE, 1, 0, 0),
    "mass": (1, 1 + 0.8 * WAVE, 0, 0),
    "damper along": (1, 1, 1 + 0.8 * WAVE, 0),
    "every coefficient": (1 + 0.8 * WAVE, 1 + WAVE / 2, (1 + WAVE) / 5, 0),
    "Kelvin and Voigt": (1 + 0.8 * WAVE, 1 + WAVE / 2, 0, (2 + WAVE) / 1000),
    "steps": (1 + sp.Piecewise((1, sp.Mod(30 * x, 1) < HALF), (0, True)), 1, 0, 0),
}


@pytest.mark.parametrize("kind", CELLS)
def test_a_damped_string_of_thirty_cells(kind):
    """By the transfer matrix of a cell to the power 30: an element that holds many cells has their detail too."""
    coefficients = CELLS[kind]
    tension, mass, along, inner = map(sp.sympify, coefficients)
    work = [end_damper(0.3), (-along * v.diff(t), v, "domain"), (-inner * v.diff(x, t), v.diff(x), "domain")]
    density = mass * v.diff(t) ** 2 / 2 - tension * v.diff(x) ** 2 / 2
    string = cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=[v.subs(x, 0)],
                       virtual_work=[part for part in work if part[0] != 0])  # fmt: skip
    system = string.at({})
    w, m, c, d = (sp.lambdify(x, part) for part in (tension, mass, along, inner))

    def value(s):
        def slope(place, y):
            rate = np.array([[0, 1 / (w(place) + s * d(place))], [s**2 * m(place) + s * c(place), 0]])
            return (rate @ y.reshape(2, 2)).ravel()

        cell = np.eye(2, dtype=complex)
        for left, right in ((0.0, 0.5 - 1e-14), (0.5 + 1e-14, 1.0 - 1e-14)):
            cell = solve_ivp(
                slope, (left / 30, right / 30), cell.ravel(), method="DOP853", rtol=1e-13, atol=1e-15, max_step=1e-3
            ).y[:, -1].reshape(2, 2)  # fmt: skip
        y = np.linalg.matrix_power(cell, 30)[:, 1]
        return y[1] + 0.3 * s * y[0]

    for s in cra.eigenvalues(system, 3):
        step = 1e-5 * abs(s)
        error = abs(value(s) * 2 * step / (value(s + step) - value(s - step)) / s)
        assert error < 2 * system.accuracy + SHOOTING
    assert system.accuracy <= 1e-10
