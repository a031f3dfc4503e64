"""Complex mode shapes and responses by complex modes: closed forms, the differential equation, elements in time."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose
from scipy.linalg import eig, expm

import cra_sym as cra

x, t = sp.symbols("x t")
c, P, U, beta, q = sp.symbols("c P U beta q")
v, F, w = sp.Function("v")(x, t), sp.Function("F")(t), sp.Function("w")(t)
HALF = sp.Rational(1, 2)
BEAM = HALF * v.diff(t) ** 2 - HALF * v.diff(x, 2) ** 2
CLAMPED = [v.subs(x, 0), v.diff(x).subs(x, 0)]
END_DAMPER = [(-c * v.diff(t), v, "right")]
PULL = [(F, v, "right")]
PLACES = np.linspace(0.0, 1.0, 6)
TIMES = np.linspace(0.0, 1.2, 7)


def model(density=BEAM, essential=CLAMPED, **options):
    return cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=essential, **options)


PIPE = BEAM + HALF * U**2 * v.diff(x) ** 2 + beta * U * v.diff(t) * v.diff(x)
OUTLET = [(-(U**2) * v.diff(x) - beta * U * v.diff(t), v, "right")]
PRESSED, FOLLOWER = BEAM + HALF * P * v.diff(x) ** 2, [(-P * v.diff(x), v, "right")]
STEP = sp.Piecewise((1, x < HALF), (sp.Rational(1, 2), True))
HANGING = HALF * STEP * v.diff(t) ** 2 - HALF * STEP * v.diff(x, 2) ** 2 - q * (1 - x**2) / 4 * v.diff(x) ** 2
STRING = HALF * v.diff(t) ** 2 - HALF * v.diff(x) ** 2
SYSTEMS = {
    "pipe": (PIPE, OUTLET, {U: 6.0, beta: 0.5}, CLAMPED),
    "beck": (PRESSED, FOLLOWER, {P: 15.0}, CLAMPED),
    "flutter": (PRESSED, FOLLOWER, {P: 25.0}, CLAMPED),
    "both meet": (PRESSED, FOLLOWER, {P: 20.0509536187612}, CLAMPED),
    "damper": (BEAM, END_DAMPER, {c: 1.0}, CLAMPED),
    "critical": (BEAM, [(-c * v.diff(t), v, "domain")], {c: 7.0320305}, CLAMPED),
    "along x": (HANGING, END_DAMPER, {c: 0.5, q: 9.0}, CLAMPED),
    "rigid": (BEAM, [(-c * v.diff(t), v, "left")], {c: 0.3}, []),
    "hinge": (BEAM, [(-c * v.diff(x, t), v.diff(x), "left")], {c: 0.3}, [v.subs(x, 0)]),
}


def elements(density, work, values, essential, number=24):
    """K, C, M of Hermite elements of the same Lagrangian; the last unknowns but one are displacements of the end."""
    ritz = model(density, essential, virtual_work=work).ritz(number)
    ((_, stiffness, damping, mass),) = ritz._numbers(ritz._columns(values)[0])
    return stiffness, damping, mass


# shapes -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("damper", [0.0, 0.5, 3.0])
def test_shapes_of_a_string_with_an_end_damper(damper):
    """phi = sinh(s x), scaled to int |phi|^2 = 1 and real and positive at the end."""
    string = model(STRING, [v.subs(x, 0)], virtual_work=END_DAMPER)
    s = string.eigenvalues({c: damper}, 3)[:, None]
    found = string.mode_shapes({c: damper}, PLACES, 3, damped=True)
    a, b = s.real, s.imag
    size = np.where(a == 0.0, 0.5, (np.sinh(2 * a) / np.where(a == 0.0, 1.0, a) - np.sin(2 * b) / b) / 4)
    size = size - np.where(a == 0.0, np.sin(2 * b) / b / 4, 0.0)
    exact = np.sinh(s * PLACES) * np.abs(np.sinh(s)) / np.sinh(s) / np.sqrt(size)
    assert_allclose(found, exact, atol=1e-11)
    slope = string.mode_shapes({c: damper}, 1.0, 3, derivative=1, damped=True)
    assert_allclose(slope, -damper * s[:, 0] * found[:, -1], rtol=1e-10, atol=1e-11)  # the force of the damper


@pytest.mark.parametrize("name", ["pipe", "flutter", "damper", "along x", "hinge"])
def test_shapes_are_those_of_the_elements(name):
    """Complex eigenvectors of Hermite elements, with nodes at the places; the same normalisation by their mass."""
    density, work, values, essential = SYSTEMS[name]
    system = model(density, essential, virtual_work=work).at(values)
    s, number = cra.eigenvalues(system, 2), 32
    stiffness, damping, mass = elements(density, work, values, essential, number)
    size = len(mass)
    none, unit = np.zeros((size, size)), np.eye(size)
    roots, vectors = eig(np.block([[none, unit], [-stiffness, -damping]]), np.block([[unit, none], [none, mass]]))
    held = 2 * number + 2 - size
    slopes_first = 1 if held == 1 else 0
    for root, shape in zip(s, cra.mode_shapes(system, np.arange(1, number + 1) / number, 2, damped=True), strict=True):
        vector = vectors[:size, np.abs(roots - root).argmin()]
        vector = vector / np.sqrt((vector.conj() @ mass @ vector).real)
        vector = vector * np.abs(vector[-2]) / vector[-2]
        nodal = vector[slopes_first::2][-number:] if held < 2 else vector[0::2]
        assert_allclose(shape, nodal, atol=np.abs(root) ** 2 / number**4 * np.abs(nodal).max())  # cubics: h^4
        assert shape[-1].real > 0 and abs(shape[-1].imag) < 1e-12


def test_shapes_satisfy_the_equation_along_x():
    """(EI v'')'' - (T v')' + s^2 rho v = 0, integrated on both sides of the step; the shear at the end."""
    density, work, values, essential = SYSTEMS["along x"]
    system = model(density, essential, virtual_work=work).at(values)
    (s,) = cra.eigenvalues(system, 1)
    points, weights = np.polynomial.legendre.leggauss(16)
    for left, right, size in ((0.0, 0.5, 1.0), (0.5, 1.0, 0.5)):
        at = np.concatenate([[left + 1e-9], left + (right - left) * (1 + points) / 2, [right - 1e-9]])
        shape, slope, bent, shear = (
            cra.mode_shapes(system, at, 1, k, damped=True)[0] * (1.0 if k < 2 else size) for k in range(4)
        )
        pull = values[q] * (1 - at**2) / 2
        gain = (shear - pull * slope)[-1] - (shear - pull * slope)[0]
        inertia = s**2 * size * (shape[1:-1] @ weights) * (right - left) / 2
        assert abs(gain + inertia) < 1e-7 * np.abs(shear).max()  # third derivatives lose digits
        turn = bent[-1] - bent[0]
        assert abs(turn - shear[1:-1] @ weights * (right - left) / 2) < 1e-7 * np.abs(bent).max()
    assert abs(shear[-1] - values[c] * s * shape[-1]) < 1e-6


def test_shapes_without_dampers_are_the_natural_ones():
    plain = model()
    natural = plain.mode_shapes({}, PLACES, 3)
    assert_allclose(plain.mode_shapes({}, PLACES, 3, damped=True), natural, atol=1e-12)
    damped = model(virtual_work=END_DAMPER)
    assert_allclose(damped.mode_shapes({c: [0.0, 1e-9]}, PLACES, 3, damped=True)[0], natural, atol=1e-10)
    pair = model(PRESSED, virtual_work=FOLLOWER).mode_shapes({P: 30.0}, PLACES, 2, damped=True)
    assert_allclose(pair[0], pair[1].conj(), atol=1e-10)  # of +-a + i b
    real = damped.mode_shapes({c: 1e3}, PLACES, 1, damped=True, oscillating=False)
    assert np.abs(real.imag).max() < 1e-12


def test_shapes_with_a_support_and_with_fine_detail_come_from_the_basis():
    """A support as an immense spring; a tension of 200 cells: the force of the damper at the end, the tension is 1."""
    held = model(essential=[*CLAMPED, v.subs(x, HALF)], virtual_work=END_DAMPER)
    sprung = model(inside=[(HALF, -5e7 * v**2)], virtual_work=END_DAMPER)
    found, other = (
        held.mode_shapes({c: 0.4}, PLACES, 2, damped=True),
        sprung.mode_shapes({c: 0.4}, PLACES, 2, damped=True),
    )
    assert_allclose(found, other, atol=1e-5)  # of a spring 1e8 as stiff as the beam
    assert np.abs(held.mode_shapes({c: 0.4}, 0.5, 2, damped=True)).max() < 1e-12
    fine = model(HALF * v.diff(t) ** 2 - HALF * (1 + 0.9 * sp.sin(400 * sp.pi * x)) * v.diff(x) ** 2,
                 [v.subs(x, 0)], virtual_work=END_DAMPER)  # fmt: skip
    (s,), shape, slope = (
        fine.eigenvalues({c: 0.3}, 1),
        fine.mode_shapes({c: 0.3}, [0.0, 1.0], 1, damped=True)[0],
        fine.mode_shapes({c: 0.3}, 1.0, 1, derivative=1, damped=True)[0],
    )
    assert abs(shape[0]) < 1e-12 and abs(slope + 0.3 * s * shape[1]) < 1e-6 * abs(s)
    with pytest.raises(ValueError, match="derivative = 3: complex shapes with supports"):
        held.mode_shapes({c: 0.4}, 0.5, 2, derivative=3, damped=True)


# responses --------------------------------------------------------------------------------------------------------


def in_time(stiffness, damping, mass, times):
    """The end of the elements under 1/2 + sin(20 t + 0.3), by one exponential a time."""
    size = len(mass)
    inverse, none = np.linalg.inv(mass), np.zeros((size, size))
    system = np.zeros((2 * size + 3, 2 * size + 3))
    system[: 2 * size, : 2 * size] = np.block([[none, np.eye(size)], [-inverse @ stiffness, -inverse @ damping]])
    system[size : 2 * size, 2 * size :] = np.outer(inverse[:, -2], [0.5, 1.0, 0.0])
    system[-2:, -2:] = [[0.0, 20.0], [-20.0, 0.0]]
    start = np.concatenate([np.zeros(2 * size), [1.0, np.sin(0.3), np.cos(0.3)]])
    return np.array([(expm(system * time) @ start)[size - 2] for time in times])


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_force_at_the_end_against_elements_in_time(name):
    """Rigid-body motions, growing and coalescing modes included; what remains is the sum over the modes beyond."""
    density, work, values, essential = SYSTEMS[name]
    driven = model(density, essential, virtual_work=[*work, *PULL])
    push = {F: cra.Force(level=0.5, amplitude=1.0, angular_frequency=20.0, phase=0.3)}
    expected = in_time(*elements(density, work, values, essential), TIMES)
    errors = [
        np.abs(driven.tip_response(values, push, TIMES, modes=modes) - expected).max() / np.abs(expected).max()
        for modes in (4, 8, 16)
    ]
    # of a force at a free end the static share of the modes beyond N: about 4 / (pi N)^4 (1 / (3 EI) is one)
    assert errors[0] < 2e-2 and errors[1] < 3e-3 and errors[2] < 5e-4


HALF_OF_IT = sp.Piecewise((1, x < HALF), (0, True))
RESISTED = [(-c * HALF_OF_IT * v.diff(x, 2, t), v.diff(x, 2), "domain")]
WHOLE = [(-c * v.diff(x, 2, t), v.diff(x, 2), "domain")]
MATERIAL = {
    "half": (BEAM, RESISTED, {c: 0.01}, CLAMPED, {}),
    "half, strong": (BEAM, RESISTED, {c: 0.3}, CLAMPED, {}),
    "elastic root": (BEAM, WHOLE, {c: 0.01}, [], {"left": -5 * v**2 / 2 - v.diff(x) ** 2}),
    "and a damper": (BEAM, [*WHOLE, (-v.diff(t), v, "right")], {c: 0.01}, CLAMPED, {}),
}


@pytest.mark.parametrize("name", MATERIAL)
def test_damping_of_the_material_that_couples_the_modes(name):
    """Kelvin-Voigt: eigenvalues, response in time and at one frequency against 24 elements a span with nodes there."""
    density, work, values, essential, options = MATERIAL[name]
    driven = model(density, essential, virtual_work=[*work, *PULL], **options)
    ritz = driven.ritz(24, nodes=[HALF])
    ((_, stiffness, damping, mass),) = ritz._numbers(ritz._columns(values)[0])
    push = {F: cra.Force(level=0.5, amplitude=1.0, angular_frequency=20.0, phase=0.3)}
    expected = in_time(stiffness, damping, mass, TIMES)
    for modes in (3, 12):  # how many are asked for does not matter: nothing is left out
        found = driven.tip_response(values, push, TIMES, modes=modes)
        assert_allclose(found, expected, atol=2e-6 * np.abs(expected).max())  # h^4 of the elements
    size = len(mass)
    inverse = np.linalg.inv(mass)
    every = np.linalg.eigvals(np.block([[0 * mass, np.eye(size)], [-inverse @ stiffness, -inverse @ damping]]))
    s = driven.eigenvalues(values, 2)
    assert max(np.abs(every - one).min() / abs(one) for one in s) < 2e-6
    assert_allclose(driven.damping_ratios(values, 2), -s.real / np.abs(s))
    for Omega in (0.0, 3.0, 20.0):
        force = np.eye(size)[-2]
        moved = np.linalg.solve(stiffness + 1j * Omega * damping - Omega**2 * mass, force)[-2]
        assert_allclose(cra.frequency_response(driven.at(values), Omega, drive=F), moved, rtol=2e-6)


def test_damping_of_the_material_that_leaves_the_modes_alone():
    """In proportion to the stiffness: the sum over natural modes, each by itself."""
    omega = 2 * np.pi * model().natural_frequencies({}, 2)
    found = model(virtual_work=WHOLE).tip_response({c: 0.02}, None, TIMES, modes=2, initial={v: x**2})
    other = model().tip_response({}, None, TIMES, modes=2, initial={v: x**2}, zeta=0.01 * omega)  # c omega / 2
    assert_allclose(found, other, atol=1e-9)


def test_one_complex_mode_swings_and_decays_alone():
    """Let go in the shape of a complex mode with the velocity that belongs to it: Re phi exp(s t), in one mode."""
    string = model(STRING, [v.subs(x, 0)], virtual_work=END_DAMPER)
    (s,) = string.eigenvalues({c: 0.5}, 1)
    a, b = float(s.real), float(s.imag)
    shape = sp.sinh(a * x) * sp.cos(b * x) + sp.sinh(a * x) * 0  # Re sinh(s x)
    speed = a * sp.sinh(a * x) * sp.cos(b * x) - b * sp.cosh(a * x) * sp.sin(b * x)  # Re s sinh(s x)
    for modes in (1, 5):
        found = string.response({c: 0.5}, None, TIMES, PLACES, modes=modes, initial={v: shape, v.diff(t): speed})
        assert_allclose(found, (np.sinh(s * PLACES)[:, None] * np.exp(s * TIMES)).real, atol=1e-10)
        found = string.response(
            {c: 0.5}, {}, TIMES, PLACES, modes=modes, derivative=2, initial={v: shape, v.diff(t): speed}
        )
        assert_allclose(found, (s**2 * np.sinh(s * PLACES)[:, None] * np.exp(s * TIMES)).real, atol=1e-8)


def test_a_moving_base_strikes_and_a_batch_is_a_loop():
    """A hinged beam on a turning damper, carried by a base; time derivatives; axes of parameters and of motions."""
    moving = BEAM.subs(v.diff(t), v.diff(t) + w.diff(t))
    beam = model(moving, virtual_work=END_DAMPER, prescribed=[w])
    motion = cra.BaseMotion(velocity=[0.1, -0.2], amplitude=1e-3, angular_frequency=9.0)
    motion = motion + cra.BaseMotion.trapezoid(0.3, 0.5, 1.0)
    found = beam.response({c: [[0.2], [2.0]]}, motion, TIMES, PLACES, modes=4)
    assert found.shape == (2, 2, 6, 7)
    one = beam.response({c: 2.0}, motion[1], TIMES, PLACES, modes=4)
    assert_allclose(found[1, 1], one, atol=1e-12)
    # a damper that hardly acts: natural modes, the closed form
    little, none = (beam.tip_response({c: value}, motion[0], TIMES, modes=4) for value in (1e-10, 0.0))
    plain = model(moving, prescribed=[w]).tip_response({}, motion[0], TIMES, modes=4)
    assert_allclose(little, plain, atol=1e-10)
    assert_allclose(none, plain, atol=1e-11)
    ratio = beam.tip_response({c: 1e-10}, motion[0], TIMES, modes=4, zeta=0.03)
    assert_allclose(
        ratio, model(moving, prescribed=[w]).tip_response({}, motion[0], TIMES, modes=4, zeta=0.03), atol=1e-9
    )
    step = 1e-4
    for derivative, modes, digits in ((0, 16, 2e-4), (1, 4, 2.4e-5)):  # velocities are those of the modes
        around = 0.7 + step * np.array([-1.0, 1.0])
        low, high = beam.tip_response({c: 2.0}, motion[1], around, modes=modes, derivative=derivative)
        rate = beam.tip_response({c: 2.0}, motion[1], 0.7, modes=modes, derivative=derivative + 1)
        assert_allclose(rate, (high - low) / (2 * step), rtol=digits)  # (omega step)^2 / 6 of the fourth mode


def test_what_is_refused_in_time():
    pressed = model(PRESSED, virtual_work=[*FOLLOWER, *PULL])
    push = {F: cra.Force(1.0)}
    with pytest.raises(ValueError, match="zeta: a structure whose forces have no potential"):
        pressed.tip_response({P: 10.0}, push, TIMES, zeta=0.02)
    with pytest.raises(ValueError, match="no history for F"):
        pressed.tip_response({P: 10.0}, None, TIMES)


@pytest.mark.parametrize("name", ["pipe", "beck", "damper", "rigid"])
def test_frequency_responses_are_those_of_the_elements(name):
    density, work, values, essential = SYSTEMS[name]
    stiffness, damping, mass = elements(density, work, values, essential, 32)
    omega = np.array([1.0, 9.0, 40.0])
    dynamic = stiffness + 1j * omega[:, None, None] * damping - omega[:, None, None] ** 2 * mass
    expected = np.linalg.inv(dynamic)[:, -2, -2]
    system = model(density, essential, virtual_work=work)
    found = system.frequency_response(values, omega, 1.0, drive=v.subs(x, 1))
    assert_allclose(found, expected, rtol=3e-4)  # of 32 elements, beside an antiresonance
