"""Models of several fields and lumped coordinates that vary along x: stresses against the dynamic stiffness."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import eigh

import cra_sym as cra
from cra_sym.model.energies import stress_route
from cra_sym.model.routes import GeneralRoute
from cra_sym.model.stress_route import StressRoute

x, t, L = sp.symbols("x t L")
GA, c, k, m = sp.symbols("GA c k m")
v, theta, u = (sp.Function(name)(x, t) for name in ("v", "theta", "u"))
w = sp.Function("w")(t)
HALF = sp.Rational(1, 2)


def step(left, right, place=HALF):
    return sp.Piecewise((left, x < place), (right, True))


def energies(kinetic, potential):
    return sum(kinetic) / 2 - sum(potential) / 2


def timoshenko(bending, shear, mass, inertia):
    return energies(
        (mass * v.diff(t) ** 2, inertia * theta.diff(t) ** 2),
        (bending * theta.diff(x) ** 2, shear * (v.diff(x) - theta) ** 2),
    )


MODELS = {
    "stepped Timoshenko": dict(
        density=timoshenko(step(1, c), GA * step(1, c), step(1, HALF), step(HALF, 1) / 100),
        fields=[v, theta],
        essential=[v.subs(x, 0), theta.subs(x, 0)],
        right=m * v.diff(t) ** 2 / 2,
    ),
    "tapered Timoshenko on springs": dict(
        density=timoshenko((1 - x / 2) ** 3, GA * (1 - x / 2), 1 - x / 2, (1 - x / 2) ** 3 / 50),
        fields=[v, theta],
        left=-k * v**2 / 2 - c * theta**2,
        right=m * theta.diff(t) ** 2 / 2,
    ),
    "two strings joined along x": dict(
        density=energies(
            (v.diff(t) ** 2, step(1, 2) * u.diff(t) ** 2),
            (step(1, 3) * v.diff(x) ** 2, GA * u.diff(x) ** 2, k * (1 + x) * (v - u) ** 2),
        ),
        fields=[v, u],
        essential=[v.subs(x, 0), u.subs(x, 1)],
        right=m * v.diff(t) ** 2 / 2,
    ),
    "bending coupled to stretching": dict(
        density=energies(
            (v.diff(t) ** 2, u.diff(t) ** 2),
            (step(1, HALF) * v.diff(x, 2) ** 2, GA * u.diff(x) ** 2, 2 * c * x * v.diff(x, 2) * u.diff(x)),
        ),
        fields=[v, u],
        essential=[v.subs(x, 0), v.diff(x).subs(x, 0), u.subs(x, 0)],
        right=m * v.diff(t) ** 2 / 2,
    ),
    "beam on a moving base": dict(
        density=energies(((1 + x) * (v.diff(t) + w.diff(t)) ** 2,), (step(1, c) * v.diff(x, 2) ** 2, v.diff(x) ** 2)),
        fields=[v],
        coordinates=[w],
        left=-k * v**2 / 2 - 5 * v.diff(x) ** 2 + m * w.diff(t) ** 2 / 2,
    ),
    "column under a load": dict(
        density=energies((v.diff(t) ** 2,), (step(1, HALF) * v.diff(x, 2) ** 2, -(1 + x) * c * v.diff(x) ** 2)),
        fields=[v],
        essential=[v.subs(x, 0), v.subs(x, 1)],
        right=-k * v.diff(x) ** 2 + m * v.diff(x, t) ** 2 / 2,
    ),
}


class _Aligned:
    """Modes with the signs of others: where an end is held, those of the dynamic stiffness hang on its rounding."""

    def __init__(self, modes, others):
        self.modes = modes
        places = np.linspace(0.0, 1.0, 7)
        product = (modes.shape(0, 0, places) * others.shape(0, 0, places)).sum(axis=-1)
        self.sign = np.where(product < 0.0, -1.0, 1.0)

    def shape(self, *arguments):
        return self.sign[..., None] * self.modes.shape(*arguments)

    def force(self, *arguments):
        return self.sign * self.modes.force(*arguments)

    def coordinate(self, *arguments):
        return self.sign * self.modes.coordinate(*arguments)


@pytest.mark.parametrize("name", MODELS)
def test_two_routes_agree(name):
    """Frequencies, shapes and forces; the dynamic stiffness has eight digits of the latter."""
    model = cra.Model(x=x, domain=(0, 1), t=t, **MODELS[name])
    values = {GA: [20.0, 3e3], c: 0.3, k: [[5.0], [4e3]], m: 0.2}
    system = model.at({s: values[s] for s in model.symbols})
    route, general = model.numerics("route"), GeneralRoute(model.numerics("spatial"))
    assert isinstance(route, StressRoute)
    found = system.natural_frequencies(4)
    squares = general.angular_frequencies(system.parameters, system.shape, 4)
    np.testing.assert_allclose(found, squares, rtol=1e-9, atol=1e-12)
    assert (system.accuracy < 1e-10).all()
    one, other = system.modes(4), _Aligned(general.modes(system.parameters, system.shape, squares), system.modes(4))
    places = np.linspace(0.0, 1.0, 6)
    for place in range(len(model.state_form.displacements)):
        expected = other.shape(place, 0, places)
        np.testing.assert_allclose(one.shape(place, 0, places), expected, atol=1e-6 * np.abs(expected).max())
        for end in (0, 1):
            expected = other.force(end, place)
            size = max(np.abs(other.force(e, place)).max() for e in (0, 1))
            np.testing.assert_allclose(one.force(end, place), expected, atol=1e-6 * size)
    for number in range(len(model.state_form.coordinates)):
        # the sign of a motion of the base alone is a convention
        np.testing.assert_allclose(np.abs(one.coordinate(number)), np.abs(other.coordinate(number)), atol=1e-7)


@pytest.mark.parametrize("stiff", [1e2, 1e7, 1e12, 1e16])
def test_shear_may_be_as_stiff_as_it_likes(stiff):
    """Timoshenko's beam without rotary inertia goes over into Euler's: 1.8751^2, with an error of the order 1 / GA."""
    model = cra.Model(
        timoshenko(1 + sp.Rational(1, 10**15) * x, GA, 1, 0),
        fields=[v, theta],
        x=x,
        domain=(0, 1),
        t=t,
        essential=[v.subs(x, 0), theta.subs(x, 0)],
    )
    found = model.at({GA: stiff}).natural_frequencies(2)
    exact = np.array([1.87510406871196, 4.69409113297417]) ** 2
    np.testing.assert_allclose(found, exact, rtol=max(30.0 / stiff, 1e-11))


@pytest.mark.parametrize("share", [0.9, 0.999999, 1.000001, 5.0])
def test_buckling_of_a_tapered_column(share):
    """EI = (1 + x)^2, pinned: P = EI v'' / v gives v = sqrt(s) sin(b ln s), s = 1 + x, b^2 = P - 1/4, b ln 2 = pi."""
    critical = sp.Float(np.pi**2 / np.log(2.0) ** 2 + 0.25)
    load = sp.Symbol("load")
    density = energies((v.diff(t) ** 2,), ((1 + x) ** 2 * v.diff(x, 2) ** 2, -load * v.diff(x) ** 2))
    model = cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=[v.subs(x, 0), v.subs(x, 1)])
    system = model.at({load: float(critical) * share})
    if share < 1.0:
        assert 0.0 < system.natural_frequencies(1)[0] < 15.0 * np.sqrt(1.0 - share) * 1.5
    else:
        with pytest.raises(ValueError, match=r"the structure has buckled: [12] unstable mode"):
            system.natural_frequencies(1)


def test_rigid_motions_are_zero_and_massless_parts_have_no_modes():
    free = cra.Model(
        step(1, 3) * v.diff(t) ** 2 / 2 - step(1, HALF) * v.diff(x, 2) ** 2 / 2, fields=[v], x=x, domain=(0, 1), t=t
    )
    found = free.at({}).natural_frequencies(4)
    assert (found[:2] == 0.0).all() and found[2] > 1.0
    modes = free.at({}).modes(4)
    points, weights = modes.stations()
    shapes = modes.shape(0, 0, points)
    mass = np.where(points < 0.5, 1.0, 3.0) * weights
    np.testing.assert_allclose((shapes * mass) @ shapes.T, np.eye(4), atol=1e-11)
    clamped = dict(fields=[v], x=x, domain=(0, 1), t=t, essential=[v.subs(x, 0), v.diff(x).subs(x, 0)])
    half = cra.Model(step(1, 0) * v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2, **clamped)
    np.testing.assert_allclose(half.at({}).natural_frequencies(1), 4 * 1.87510406871196**2, rtol=1e-10)
    tip = cra.Model(-step(1, 2) * v.diff(x, 2) ** 2 / 2, right=v.diff(t) ** 2 / 2, **clamped)
    compliance = 1 / 3 - 0.5**3 / 3 / 2
    np.testing.assert_allclose(tip.at({}).natural_frequencies(1), compliance**-0.5, rtol=1e-12)
    with pytest.raises(ValueError, match="only 1 natural frequencies"):
        tip.at({}).natural_frequencies(2)
    assert stress_route(tip, tip.numerics("spatial")) is not None


@pytest.mark.parametrize("soft", [1e-8, 1e-12, 1e-20, 1e-100])
@pytest.mark.parametrize("stiff", [0.0, 1e3, 1e12, np.inf])
def test_a_spring_of_next_to_nothing_beside_a_stiff_one(soft, stiff):
    """A stepped beam that turns or slides as a rigid body, but for the spring, whose higher modes do not notice it."""
    mass = 1 / 2 + 3 / 2
    inertia = (1 / 8 + 3 * 7 / 8) / 3
    springs = -k * v**2 / 2 - c * v.diff(x) ** 2 / 2
    beam = step(1, 3) * v.diff(t) ** 2 / 2 - step(1, HALF) * v.diff(x, 2) ** 2 / 2
    model = cra.Model(beam, fields=[v], x=x, domain=(0, 1), t=t, left=springs)
    sliding = model.at({k: soft, c: stiff})
    turning = model.at({k: stiff, c: soft})
    if stiff > 0.0:
        np.testing.assert_allclose(sliding.natural_frequencies(1)[0], np.sqrt(soft / mass), rtol=max(1e-11, 2 * soft))
        limit = np.sqrt(soft / inertia)
        known = 1e-11 if np.isinf(stiff) else max(1e-11, 20 * soft / stiff)
        np.testing.assert_allclose(turning.natural_frequencies(1)[0], limit, rtol=max(known, 2 * soft))
    for system, symbol in ((sliding, "k"), (turning, "c")):
        free = system.replace(**{symbol: 0.0}).natural_frequencies(4)
        higher = free > 1e-3
        found = system.natural_frequencies(4)
        np.testing.assert_allclose(found[higher], free[higher], rtol=max(1e-11, 20 * soft))
        assert (system.accuracy < 1e-10).all()


@pytest.mark.parametrize("place", ["left", "right", "inside", "foundation"])
@pytest.mark.parametrize("soft", [1e-30, 1e-100, 1e-290])
def test_any_spring_however_soft_beside_a_free_rotation(place, soft):
    """A rigid beam on one spring: 1 / k = 1 / m + a^2 / J of its distance a from the centre, and the free beam."""
    mass, first, second = 2.0, 1 / 8 + 9 / 8, (1 / 8 + 21 / 8) / 3
    centre, energy = first / mass, -k * v**2 / 2
    inertia = second - mass * centre**2
    beam = step(1, 3) * v.diff(t) ** 2 / 2 - step(1, HALF) * v.diff(x, 2) ** 2 / 2
    options = {"foundation": {}, "inside": {"inside": [(HALF, energy)]}}.get(place, {place: energy})
    if place == "foundation":
        beam = beam + energy
    model = cra.Model(beam, fields=[v], x=x, domain=(0, 1), t=t, **options)
    system = model.at({k: soft})
    found = system.natural_frequencies(4)
    lever = {"left": 0.0, "inside": 0.5, "right": 1.0}.get(place)
    if lever is None:  # stiffness 1 along the length, of translation and of rotation about the centre
        stiffness = np.array([[1.0, 0.5 - centre], [0.5 - centre, 1 / 3 - centre + centre**2]])
        expected = np.sqrt(soft) * np.sqrt(eigh(stiffness, np.diag([mass, inertia]), eigvals_only=True))
    else:
        expected = np.array([0.0, np.sqrt(soft) * np.sqrt(1 / mass + (lever - centre) ** 2 / inertia)])
    np.testing.assert_allclose(found[:2], expected, rtol=1e-11)
    np.testing.assert_allclose(found[2:], model.at({k: 0.0}).natural_frequencies(4)[2:], rtol=1e-11)
    assert 0.0 < system.accuracy < 1e-10


PUBLISHED = {
    (0.0036, 0.25, 1.0, 0.8): (3.0066, 9.6678, 33.5711, 72.3926, 126.1107),
    (0.0036, 0.25, 0.8, 0.8): (3.2454, 9.6354, 33.8621, 72.6068, 125.6169),
    (0.0036, 0.25, 0.8, 0.6): (3.3812, 8.1031, 28.3643, 59.8385, 100.2447),
    (0.0036, 0.50, 1.0, 0.8): (2.9462, 9.9192, 33.2046, 71.4693, 116.7245),
    (0.0036, 0.50, 0.8, 0.8): (3.1120, 10.0304, 32.9259, 71.7415, 116.3618),
    (0.0036, 0.50, 0.8, 0.6): (3.2721, 9.3908, 27.4490, 64.0200, 102.6966),
    (0.01, 0.25, 1.0, 0.8): (3.0009, 9.6192, 32.8407, 69.2292, 117.2380),
    (0.01, 0.25, 0.8, 0.8): (3.2390, 9.5858, 33.1092, 69.4435, 116.7981),
    (0.01, 0.25, 0.8, 0.6): (3.3744, 8.0784, 27.9139, 57.9705, 95.3698),
    (0.01, 0.50, 1.0, 0.8): (2.9255, 9.7104, 30.7111, 61.7680, 95.6230),
    (0.01, 0.50, 0.8, 0.8): (3.0908, 9.8086, 30.4643, 61.9117, 95.3257),
}


def test_published_stepped_timoshenko_beams():
    """Table 1 of El-Sayed and Farghaly (Shock and Vibration 2017, 8186976), all digits.

    The square of the radius of gyration over the length of the first span, place of the step, ratios of width and
    height there; no end turns, the left one has a spring of 10 E I / L^3; shear factor 5/6, Poisson's ratio 0.3.
    """
    slenderness, place, width, height = sp.symbols("slenderness place width height")
    area, bending = step(1, width * height, place), step(1, width * height**3, place)
    gyration = slenderness * place**2
    model = cra.Model(
        timoshenko(bending, area / gyration / sp.Rational(312, 100), area, gyration * bending),
        fields=[v, theta],
        x=x,
        domain=(0, 1),
        t=t,
        left=-5 * v**2,
        essential=[theta.subs(x, 0), theta.subs(x, 1)],
    )
    values = dict(zip((slenderness, place, width, height), np.array(list(PUBLISHED)).T, strict=True))
    found = model.at(values).natural_frequencies(5)
    np.testing.assert_allclose(found, list(PUBLISHED.values()), rtol=0, atol=6e-5)
