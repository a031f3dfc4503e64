"""Complex eigenvalues, along x too: closed forms in 30 digits, shooting, other elements, and the argument principle."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from mpmath import mp, mpc, mpf
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import cra_sym as cra
from tests.model.roots import distance

x, t = sp.symbols("x t")
c, q, P, U, k, m, e, tau, kG, beta = sp.symbols("c q P U k m e tau kG beta")
v, phi = sp.Function("v")(x, t), sp.Function("phi")(x, t)
HALF = sp.Rational(1, 2)
BEAM = HALF * v.diff(t) ** 2 - HALF * v.diff(x, 2) ** 2
CLAMPED = [v.subs(x, 0), v.diff(x).subs(x, 0)]
END_DAMPER = [(-c * v.diff(t), v, "right")]
ROUNDING = 1e-12
"""Of the lowest eigenvalues: a few hundred units in the last place, of matrices with entries up to one."""


def model(density=BEAM, essential=CLAMPED, **options):
    return cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=essential, **options)


BECK = model(BEAM + HALF * P * v.diff(x) ** 2, virtual_work=[(-P * v.diff(x), v, "right")])
LEIPHOLZ = model(BEAM + HALF * P * (1 - x) * v.diff(x) ** 2, virtual_work=[(-P * v.diff(x), v, "domain")])
HANGING = model(BEAM - q * (1 - x**2) / 2 * v.diff(x) ** 2 / 2, virtual_work=END_DAMPER)
ALONG = model(virtual_work=[(-c * v.diff(t), v, "domain")])
STRING = model(HALF * v.diff(t) ** 2 - HALF * v.diff(x) ** 2, [v.subs(x, 0)], virtual_work=END_DAMPER)
WAVES = [brentq(lambda b: np.cos(b) + 1 / np.cosh(b), lo, lo + 2, xtol=1e-15, rtol=1e-15) for lo in (1, 4, 7)]
BEND = np.array(WAVES) ** 2


def assert_same(found, expected, rtol=ROUNDING):
    assert np.max(np.abs(found - expected) / np.abs(expected)) < rtol


# the rows of practice, and their neighbours -----------------------------------------------------------------------


@pytest.mark.parametrize(("tension", "damper"), [(9.0, 0.3), (9.0, 0.03), (40.0, 2.0), (-2.0, 0.3), (9.0, 300.0)])
def test_hanging_beam_with_an_end_damper(tension, damper):
    """Shooting with DOP853 at complex s: the residue of the end conditions, as a Newton step."""
    found = HANGING.eigenvalues({q: tension, c: damper}, 2)
    if (tension, damper) == (9.0, 0.3):
        assert_allclose(found, [-0.58949728 + 4.76894734j, -0.61614237 + 23.286729j], rtol=1e-8)

    def shot(s):
        def rate(place, y):
            pull = tension * (1 - place**2) / 2
            y = y.reshape(2, 4)
            return np.stack([y[:, 1], y[:, 2], y[:, 3] + pull * y[:, 1], -(s**2) * y[:, 0]], axis=1).ravel()

        start = np.array([[0, 0, 1, 0], [0, 0, 0, 1]], dtype=complex).ravel()
        end = solve_ivp(rate, (0, 1), start, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1].reshape(2, 4)
        # moment; shear v''' - T v' = c s v
        return np.linalg.det(np.stack([end[:, 2], end[:, 3] - damper * s * end[:, 0]], axis=1))

    for s in found:
        step = 1e-5 * s
        slope = (shot(s + step) - shot(s - step)) / (2 * step)
        assert abs(shot(s) / slope) < 1e-9 * abs(s)  # what the integrator leaves


@pytest.mark.parametrize("damper", [7.03, 7.032, 7.04, 0.5, 60.0])
def test_a_damper_along_the_beam_passes_critical_damping(damper):
    """s^2 + c s + omega^2 = 0 mode by mode; the first is critical at c = 7.0320305."""
    root = np.sqrt((damper**2 / 4 - BEND**2).astype(complex))
    every = np.concatenate([-damper / 2 + root, -damper / 2 - root])
    pairs = every[(every.imag > 0)]
    pairs = pairs[np.argsort(np.abs(pairs))]
    if len(pairs):
        found = ALONG.eigenvalues({c: damper}, len(pairs))
        assert_same(found, pairs)
    real = every[(every.imag == 0.0) & (np.abs(every) < BEND[1])]
    if len(real):
        found = ALONG.eigenvalues({c: damper}, len(real), oscillating=False)
        assert_same(found[:1], [real[np.abs(real).argmin()]], 1e-10)  # close to double: what the gap leaves


def test_at_the_double_eigenvalue_mean_and_product_are_known():
    critical = 2 * BEND[0]
    pair = ALONG.eigenvalues({c: critical * (1 - 1e-15 * np.arange(4))}, 1, oscillating=False)[:, 0]
    assert_allclose(pair.real, -BEND[0], rtol=1e-7)  # half the digits of each member
    exact = np.sqrt(BEND[0] ** 2 - 7.0320305**2 / 4)
    assert_allclose(ALONG.eigenvalues({c: 7.0320305}, 1)[0], -7.0320305 / 2 + 1j * exact, rtol=1e-7)


def beck_determinant(s, load):
    """v'''' + P v'' + s^2 v = 0, clamped; v'' = v''' = 0 at the end."""
    root = mp.sqrt(load**2 / 4 - s**2)
    rates = [sign * mp.sqrt(-load / 2 + one) for one in (root, -root) for sign in (1, -1)]
    rows = [[1] * 4, rates, [r**2 * mp.exp(r) for r in rates], [r**3 * mp.exp(r) for r in rates]]
    return mp.det(mp.matrix(rows))


@pytest.mark.parametrize("load", [30.0, 20.05, 20.051, 20.0509536, 16.0, 60.0])
def test_becks_column_has_both_members_of_every_pair(load):
    found = BECK.eigenvalues({P: load}, 3)
    if load == 30.0:
        assert_same(found[:2], np.array([7.10122144585 + 10.24915896084j, -7.10122144585 + 10.24915896084j]), 1e-11)
    assert len({complex(np.round(s, 6)) for s in found}) == 3
    with mp.workdps(30):
        exact = []
        for s in found:
            start = mpc(complex(s))
            exact.append(complex(mp.findroot(lambda z: beck_determinant(z, mpf(load)), start, tol=1e-35, maxsteps=60)))
    exact = np.array(exact)
    # two that meet within delta are known to eps / delta; their mean to all digits
    gap = np.abs(exact[0] - exact[1]) / np.abs(exact[0])
    assert (np.abs(found - exact) < (ROUNDING + 20 * np.finfo(float).eps / gap) * np.abs(exact)).all()
    assert_allclose((found[:2] ** 2).mean(), (exact[:2] ** 2).mean(), rtol=1e-11)


def test_both_sides_of_flutter():
    below, above = BECK.eigenvalues({P: [20.0509, 20.0510]}, 2)
    assert (below.real == 0.0).all() and (above.real[0] == -above.real[1]) and abs(above.real[0]) > 1e-3
    below, above = LEIPHOLZ.eigenvalues({P: [40.0, 40.1]}, 2)
    assert (below.real == 0.0).all() and abs(above.real[0]) > 1e-2
    # the same with the elements of Hermite, 16 of them: h^4 |s|^2 / 1440 of a static shape, more of these
    assert_same(LEIPHOLZ.ritz(16).eigenvalues({P: 30.0}, 2), LEIPHOLZ.eigenvalues({P: 30.0}, 2), 1e-4)


@pytest.mark.parametrize("damper", [0.0, 1e-9, 0.5, 0.99, 1.01, 2.0, 1e6])
def test_a_string_with_an_end_damper(damper):
    """coth s = -c: s = ln|(1 - c)/(1 + c)|/2 + i pi (n or n + 1/2)."""
    found = STRING.eigenvalues({c: damper}, 4)
    real = 0.5 * np.log(abs(1 - damper) / (1 + damper))
    turn = np.arange(4) + 0.5 if damper < 1 else np.arange(1, 5)
    assert_same(found, real + 1j * np.pi * turn)
    if 0 < damper < 1e3:
        assert (np.abs(found.real - real) <= 1e-12 * abs(real) + 1e-14 * np.abs(found)).all()


def test_a_matched_string_has_no_eigenvalue():
    with pytest.raises(ValueError, match=r"argument principle counts 0 eigenvalues, both of each pair, with \|s\| < 1"):
        STRING.eigenvalues({c: 1.0}, 1)
    assert cra.count_eigenvalues(STRING.at({c: 1.0}), [5.0, 12.0]).tolist() == [0, 0]
    near = STRING.eigenvalues({c: [1 - 1e-5, 1 + 1e-5]}, 1)[:, 0]
    assert_allclose(near.real, 0.5 * np.log(1e-5 / 2), rtol=1e-5)


def test_the_limits_of_no_damper_and_of_an_immense_one():
    bare = 2 * np.pi * model().natural_frequencies({}, 3)
    tip = model().mode_shapes({}, 1.0, 3)
    beam = model(virtual_work=END_DAMPER)
    none, little, much, more = beam.eigenvalues({c: [0.0, 1e-9, 1e9, 1e15]}, 3)
    assert_same(none, 1j * bare)
    assert_allclose(little.real, -0.5e-9 * tip**2, atol=1e-14 * bare.max())  # first order: c phi^2 / 2
    propped = 2 * np.pi * model(essential=[*CLAMPED, v.subs(x, 1)]).natural_frequencies({}, 3)
    assert_same(more, 1j * propped)
    assert_same(much, 1j * propped, 1e-8)  # c is 1e7 of c
    creep = beam.eigenvalues({c: [1e9, 1e15]}, 1, oscillating=False)[:, 0]
    # the damper carries the static deflection 1/3 of a unit force off: s = -3/c; inertia enters at s^2
    assert_same(creep, -3.0 / np.array([1e9, 1e15]), 1e-11)


# nothing is missing, nothing comes twice --------------------------------------------------------------------------

STEP = sp.Piecewise((1, x < HALF), (sp.Rational(1, 10), True))
KELVIN = model(
    HALF * v.diff(t) ** 2 - HALF * STEP * v.diff(x, 2) ** 2,
    virtual_work=[(-tau * STEP * v.diff(x, 2, t), v.diff(x, 2), "domain")],
)
PIPE = model(  # clamped pipe that discharges: mass beta of its own length flows with the speed U
    BEAM + HALF * U**2 * v.diff(x) ** 2 + beta * U * v.diff(t) * v.diff(x),
    virtual_work=[(-(U**2) * v.diff(x) - beta * U * v.diff(t), v, "right")],
)
SPRUNG = model(
    BEAM, [], left=-HALF * k * v**2 - 5 * v.diff(x) ** 2, right=HALF * m * v.diff(t) ** 2, virtual_work=END_DAMPER
)
CASES = {
    "hanging": (HANGING, {q: 9.0, c: 0.3}),
    "critical": (ALONG, {c: 7.0320305}),
    "beck": (BECK, {P: 30.0}),
    "flutter": (BECK, {P: 20.0509}),
    "leipholz": (LEIPHOLZ, {P: 50.0}),
    "string": (STRING, {c: 0.99}),
    "kelvin": (KELVIN, {tau: 1e-3}),
    "pipe": (PIPE, {U: 4.0, beta: 0.5}),
    "soft": (SPRUNG, {k: 1e-6, m: 3.0, c: 1e-4}),
    "rigid": (SPRUNG, {k: 0.0, m: 3.0, c: 0.1}),
}


@pytest.mark.parametrize("name", CASES)
def test_the_argument_principle_counts_as_many(name):
    """In a circle halfway between two of the list, every one counted: both of a pair, and rigid motions."""
    system = CASES[name][0].at(CASES[name][1])
    every = cra.eigenvalues(system, 5, oscillating=False)
    size = np.abs(every)
    cut = max(k for k in range(1, 5) if size[k] > 1.02 * size[k - 1])
    inside = every[:cut]
    number = 2 * cut - np.count_nonzero(inside.imag == 0.0)
    assert cra.count_eigenvalues(system, np.sqrt(size[cut - 1] * size[cut])) == number
    with pytest.raises((ValueError, TypeError), match="radius"):
        cra.count_eigenvalues(system, -1.0)


@pytest.mark.parametrize(("damper", "kind"), [(0.3, ALONG), (0.0, ALONG), (0.0, model())])
def test_a_count_beside_an_eigenvalue(damper, kind):
    """s^2 + c s + w^2 = 0 has a pair of modulus w; the members of a pair on the circle add up to one at any number."""
    system = kind.at({c: damper} if kind is ALONG else {})
    nearness = np.array([-1e-3, -1e-8, 1e-8, 1e-5, 1e-2])
    assert cra.count_eigenvalues(system, BEND[1] * (1 + nearness)).tolist() == [2, 2, 4, 4, 4]
    with pytest.raises(ValueError, match="an eigenvalue lies on the circle to rounding"):
        cra.count_eigenvalues(system, BEND[1])


@pytest.mark.parametrize("excess", [0.0, 1e-12, 1e-8, 1e-5])
def test_a_count_beside_a_double_eigenvalue(excess):
    """Critical damping c = 2 w (1 + d): the real roots w (1 + d +- sqrt(2 d + d^2)) beside any circle."""
    system = ALONG.at({c: 2.0 * BEND[0] * (1.0 + excess)})
    split = excess + np.sqrt(2.0 * excess + excess**2) * np.array([-1.0, 1.0])
    for nearness in (-1e-2, -3e-3, -1e-4, -1e-5, 1e-6, 1e-5, 1e-4, 3e-3, 1e-2):
        if np.abs(split - nearness).min() > 1e-7:
            found = cra.count_eigenvalues(system, BEND[0] * (1.0 + nearness))
            assert found == (split < nearness).sum()


@pytest.mark.parametrize("load", [20.0509536187612, 20.05095, 20.0509, 20.05])
def test_a_count_beside_two_that_flutter(load):
    """Of Beck's column just before flutter, and at it; pairs with the same imaginary part."""
    system = BECK.at({P: load})
    size = np.abs(system.model.eigenvalues({P: load}, 2))
    for nearness in (-1e-3, -1e-5, 1e-5, 1e-3, 4e-3):
        radius = np.sqrt(121.3425101405) * (1.0 + nearness)
        if np.abs(size / radius - 1.0).min() > 1e-6:
            assert cra.count_eigenvalues(system, radius) == 2 * (size < radius).sum()


INSIDE = {
    "support": (model(essential=[*CLAMPED, v.subs(x, HALF)], virtual_work=END_DAMPER), {c: 2.0}),
    "clamp": (
        model(
            essential=[v.subs(x, 0), v.subs(x, 1), v.subs(x, 0.3), v.diff(x).subs(x, 0.3)],
            virtual_work=[(-c * v.diff(t), v, HALF)],
        ),
        {c: 2.0},
    ),
    "damped turning": (
        model(
            inside=[(HALF, HALF * m * v.diff(t) ** 2)],
            virtual_work=[(-c * v.diff(x, t), v.diff(x), HALF), *END_DAMPER],
        ),
        {c: 0.5, m: 0.5},
    ),
    "no damper": (model(essential=[v.subs(x, 0), v.subs(x, 1), v.subs(x, sp.sqrt(2) / 3)]), {}),
}


@pytest.mark.parametrize("name", INSIDE)
def test_what_is_at_interior_places_is_counted(name):
    system = INSIDE[name][0].at(INSIDE[name][1])
    every = cra.eigenvalues(system, 3, oscillating=False)
    size = np.abs(every)
    number = 4 - np.count_nonzero(every[:2].imag == 0.0)
    assert cra.count_eigenvalues(system, np.sqrt(size[1] * size[2])) == number


def test_random_beams_against_the_elements():
    """Springs, masses, dampers at both ends and along x, tension, steps: Hermite elements with a node on the step."""
    g, T = sp.symbols("g T")
    stiff = 1 + g * sp.Heaviside(x - HALF)
    density = HALF * (1 + x) * v.diff(t) ** 2 - HALF * stiff * v.diff(x, 2) ** 2 - HALF * T * v.diff(x) ** 2
    work = [(-c * v.diff(t), v, "right"), (-e * v.diff(x, t), v.diff(x), "left"), (-tau * x * v.diff(t), v, "domain")]
    beam = model(density, [v.subs(x, 0)], right=HALF * m * v.diff(t) ** 2 - HALF * k * v**2, virtual_work=work)
    rng = np.random.default_rng(16)
    values = {name: 10.0 ** rng.uniform(-2, 1, 12) for name in (g, T, c, e, tau, m, k)}
    found = beam.eigenvalues(values, 3)
    other = beam.ritz(24).eigenvalues(values, 3)
    size = np.abs(found)
    # cubic elements: h^4 rho |s|^2 / (1440 EI) at most for undamped shapes; twice that for complex s; and rounding, eps
    # times the condition of the stiffness: the fourth power of the elements and about 30 for steps and springs
    rounding = 30 * np.finfo(float).eps * 24**4
    assert (np.abs(other / found - 1) < 2 * 3 * size**2 / 24**4 / 1440 + rounding).all()


def sprung_determinant(s, values):
    """Springs and a damper at the left end, a mass and a turning damper at the right."""
    turn, wheel, mass, slide, lift = (mpf(value) for value in values)
    rates = [factor * mp.sqrt(mp.sqrt(-(s**2))) for factor in (1, -1, 1j, -1j)]
    rows = [
        [r**3 + lift + slide * s for r in rates],
        [r**2 - turn * r for r in rates],
        [(r**2 + wheel * s * r) * mp.exp(r) for r in rates],
        [(r**3 - mass * s**2) * mp.exp(r) for r in rates],
    ]
    return mp.det(mp.matrix(rows))


def test_any_size_of_springs_masses_and_dampers():
    """Fifteen decades of each: the Newton step on the closed form in 50 digits."""
    beam = model(
        BEAM,
        [],
        left=-HALF * k * v**2 - HALF * tau * v.diff(x) ** 2,
        right=HALF * m * v.diff(t) ** 2,
        virtual_work=[(-c * v.diff(t), v, "left"), (-e * v.diff(x, t), v.diff(x), "right")],
    )
    rng = np.random.default_rng(5)
    ranges = {tau: (-5, 10), e: (-8, 8), m: (-6, 4), c: (-8, 8), k: (-5, 10)}
    values = {name: 10 ** rng.uniform(*ends, 10) for name, ends in ranges.items()}
    for row, found in enumerate(beam.eigenvalues(values, 3)):
        own = [values[name][row] for name in ranges]
        with mp.workdps(50):
            for value in found:
                assert distance(lambda s, own=own: sprung_determinant(s, own), value, 20) < 1e-10


def test_gyroscopic_and_coupled_fields():
    moving = model(HALF * (v.diff(t) + U * v.diff(x)) ** 2 - HALF * v.diff(x) ** 2, [v.subs(x, 0), v.subs(x, 1)])
    speed = np.array([0.0, 0.3, 0.99])
    found = moving.eigenvalues({U: speed}, 4)
    assert_same(found, 1j * np.pi * np.arange(1, 5) * (1 - speed[:, None] ** 2), 1e-11)
    timoshenko = cra.Model(
        HALF * v.diff(t) ** 2
        + HALF * phi.diff(t) ** 2 / 1200
        - HALF * phi.diff(x) ** 2
        - HALF * kG * (v.diff(x) - phi) ** 2,
        fields=[v, phi],
        x=x,
        domain=(0, 1),
        t=t,
        essential=[v.subs(x, 0), phi.subs(x, 0)],
        virtual_work=END_DAMPER,
    )
    found = timoshenko.eigenvalues({kG: 300.0, c: 0.4}, 3)
    assert_same(timoshenko.ritz(24).eigenvalues({kG: 300.0, c: 0.4}, 3), found, 1e-6)
    rigid = timoshenko.eigenvalues({kG: 1e10, c: 0.4}, 1)  # no shear; little rotary inertia
    assert_same(rigid, model(virtual_work=END_DAMPER).eigenvalues({c: 0.4}, 1), 4e-3)


def test_a_hinge_with_friction_inside():
    """A mass and a support at interior places beside an end damper, against two fields that are joined there."""
    propped = model(inside=[(HALF, HALF * m * v.diff(t) ** 2)], virtual_work=END_DAMPER)
    found = propped.eigenvalues({m: 0.7, c: 0.4}, 3)
    y, w = sp.Function("y")(x, t), sp.Function("w")(x, t)  # right half: y(x) = v(1/2 + x)
    joined = cra.Model(
        HALF * w.diff(t) ** 2 - HALF * w.diff(x, 2) ** 2 + HALF * y.diff(t) ** 2 - HALF * y.diff(x, 2) ** 2,
        fields=[w, y],
        x=x,
        domain=(0, HALF),
        t=t,
        left=HALF * m * y.diff(t) ** 2,
        essential=[
            w.subs(x, 0),
            w.diff(x).subs(x, 0),
            w.subs(x, HALF) - y.subs(x, 0),
            w.diff(x).subs(x, HALF) - y.diff(x).subs(x, 0),
        ],
        virtual_work=[(-c * y.diff(t), y, "right")],
    )
    assert_same(joined.eigenvalues({m: 0.7, c: 0.4}, 3), found)
    held = model(essential=[*CLAMPED, v.subs(x, HALF)], virtual_work=END_DAMPER)
    stiff = model(inside=[(HALF, -HALF * k * v**2)], virtual_work=END_DAMPER)
    assert_same(held.eigenvalues({c: 0.4}, 3), stiff.eigenvalues({c: 0.4, k: 1e14}, 3), 1e-10)


# bad input --------------------------------------------------------------------------------------------------------


def test_what_is_refused():
    with pytest.raises(ValueError, match=r"there are only 0 oscillating motions; eigenvalues.*False. gives real"):
        model(
            HALF * v.diff(t) ** 2 - HALF * v.diff(x) ** 2,
            [v.subs(x, 0)],
            virtual_work=[(-tau * v.diff(x, t), v.diff(x), "domain")],
        ).eigenvalues({tau: 1e3}, 3)
    with pytest.raises(ValueError, match="modes = 0"):
        BECK.eigenvalues({P: 1.0}, 0)
    with pytest.raises(TypeError, match="system"):
        cra.eigenvalues(3.0)
    with pytest.raises(ValueError, match="a stiffness is negative at x"):
        model(HALF * (v.diff(t) + U * v.diff(x)) ** 2 - HALF * v.diff(x) ** 2, [v.subs(x, 0)]).eigenvalues({U: 1.5})
