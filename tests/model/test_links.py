"""Lumped coordinates and linked ends in closed forms, against dynamic stiffness, extended precision and Ritz."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.kernels import compiled, has_compiler
from cra_sym.model.routes import GeneralRoute
from cra_sym.model.waves import Waves
from cra_sym.solvers.waves import determinant, lowest_waves, template
from tests.solvers.wave_problems import INF, distance, stiffness

x, t, L = sp.symbols("x t L")
v, u, phi, theta = (sp.Function(name)(x, t) for name in ("v", "u", "phi", "theta"))
w, p = (sp.Function(name)(t) for name in "wp")
EI, GJ, m, m_2, J, a, T, K, k, k_2, k_t, k_r, m_e, m_w, m_p, G, I = sp.symbols(
    "EI GJ m m_2 J a T K k k_2 k_t k_r m_e m_w m_p G I"
)
HALF = sp.Rational(1, 2)
BEAM = HALF * m * v.diff(t) ** 2 - HALF * EI * v.diff(x, 2) ** 2
OTHER = HALF * m_2 * u.diff(t) ** 2 - HALF * EI * u.diff(x, 2) ** 2
STRING = HALF * m * v.diff(t) ** 2 - HALF * T * v.diff(x) ** 2
THICK = HALF * m * v.diff(t) ** 2 + HALF * I * theta.diff(t) ** 2 - HALF * EI * theta.diff(x) ** 2
TWIST = HALF * m * (v.diff(t) + a * phi.diff(t)) ** 2 + HALF * J * phi.diff(t) ** 2 - HALF * GJ * phi.diff(x) ** 2
BASE, PAYLOAD = HALF * m_w * w.diff(t) ** 2 - HALF * k * w**2, HALF * m_p * p.diff(t) ** 2
JOINT, TURNING, TIP = -HALF * k_t * v**2, -HALF * k_r * v.diff(x) ** 2, HALF * m_e * v.diff(t) ** 2
GIVEN = {
    "EI": 1.3, "GJ": 0.4, "m": 1.1, "m_2": 0.7, "J": 0.05, "a": 0.2, "T": 3.0, "K": 20.0, "k": 30.0, "k_2": 7.0,
    "k_t": 50.0, "k_r": 9.0, "m_e": 0.4, "m_w": 0.8, "m_p": 0.3, "G": 40.0, "I": 0.01, "L": 1.2,
}  # fmt: skip
_CASES = 10  # of zero and infinite springs, for each model
SPRINGS, MASSES = ("k", "k_2", "k_t", "k_r"), ("m_e", "m_w", "m_p")
ROUNDING = 1e-13
"""Of a root: a hundred roundings of the determinant; neighbours that hardly know each other lose some more."""


def clamped(*fields):
    return [part.subs(x, 0) for field in fields for part in (field, field.diff(x))]


def model(density, fields, left, right, coordinates=(), essential=()):
    return cra.Model(
        density, fields=fields, x=x, domain=(0, L), t=t, left=left, right=right, coordinates=coordinates,
        essential=essential,
    )  # fmt: skip


@cache
def models():
    carried = HALF * m * (v + w).diff(t) ** 2 - HALF * EI * v.diff(x, 2) ** 2
    between = -HALF * k * (v.subs(x, 0) - v.subs(x, L)) ** 2
    slope = v.diff(x)
    return {
        "payload on a string": model(STRING, [v], -HALF * k * v**2, PAYLOAD - HALF * k_2 * (v - p) ** 2, [p]),
        "base that carries a beam": model(carried, [v], JOINT + TURNING + BASE, HALF * m_e * (v + w).diff(t) ** 2, [w]),
        "clamped to a base": model(BEAM, [v], BASE, None, [w], [v.subs(x, 0) - w, slope.subs(x, 0)]),
        "base and payload, tension": model(
            BEAM - HALF * T * slope**2, [v], BASE - HALF * k_t * (v - w) ** 2 + TURNING,
            TIP + PAYLOAD - HALF * k_2 * (v - p) ** 2, [w, p],
        ),
        "rotor on a foundation": model(
            BEAM - HALF * K * v**2, [v], JOINT + TURNING, PAYLOAD - HALF * k_2 * (slope - p) ** 2, [p]
        ),
        "springs between the ends": model(
            BEAM, [v], between - HALF * k_2 * (slope.subs(x, 0) - slope.subs(x, L)) ** 2 - HALF * k_t * v**2, None
        ),
        "ends that are one": model(
            BEAM, [v], -HALF * k * v**2, TIP, [], [f.subs(x, 0) - f.subs(x, L) for f in (v, slope)]
        ),
        "two beams and a spring": model(
            BEAM + OTHER, [v, u], JOINT + TURNING, TIP - HALF * k * (v - u) ** 2, [], clamped(u)
        ),
        "gantry": model(
            BEAM + OTHER, [v, u], None,
            PAYLOAD - HALF * k * (v - p) ** 2 - HALF * k_2 * (u - p) ** 2 - HALF * k_r * (slope - u.diff(x)) ** 2,
            [p], clamped(v, u),
        ),
        "bending and torsion": model(
            TWIST - HALF * EI * v.diff(x, 2) ** 2, [v, phi], JOINT - HALF * k_r * phi**2,
            PAYLOAD - HALF * k_2 * (v + 2 * a * phi - p) ** 2, [p], [slope.subs(x, 0)],
        ),
        "Timoshenko beam on carts": model(
            THICK - HALF * G * (slope - theta) ** 2, [v, theta],
            HALF * m_w * w.diff(t) ** 2 - HALF * k * (v - w) ** 2 - HALF * k_r * theta**2,
            PAYLOAD - HALF * k_2 * (v - p) ** 2, [w, p],
        ),
    }  # fmt: skip


def values_of(name, rows, decades, seed=0):
    """Return random values; springs and masses of ends and coordinates over so many decades either way."""
    rng = np.random.default_rng(seed)
    wide = {s.name: decades if s.name in (*SPRINGS, *MASSES) else 0.7 for s in models()[name].symbols}
    return {key: GIVEN[key] * 10 ** rng.uniform(-size, size, rows) for key, size in wide.items()}


def problem_of(system):
    parameters = [np.broadcast_to(np.asarray(value, dtype=float), system.shape).ravel() for value in system.parameters]
    return system._route._problem(np.array(parameters))[0]


def by_dynamic_stiffness(system, modes):
    return GeneralRoute(system.numerics("spatial")).angular_frequencies(system.parameters, system.shape, modes)


@pytest.mark.sample(6, 1)
@pytest.mark.parametrize("name", models())
def test_closed_forms_are_the_dynamic_stiffness(name):
    system = models()[name].at(values_of(name, 6, 1.0))
    assert isinstance(system._route, Waves)
    found, other = system.natural_frequencies(5), by_dynamic_stiffness(system, 5)
    # the polish of the dynamic stiffness is good to 1e-12 of a squared frequency, and of the last one for soft ones
    np.testing.assert_allclose(found**2, other**2, rtol=1e-10, atol=1e-12 * other.max() ** 2)


@pytest.mark.sample(5, 2)
@pytest.mark.parametrize("name", models())
def test_sixteen_decades_in_extended_precision(name):
    problem = problem_of(models()[name].at(values_of(name, 2, 8.0, seed=3)))
    z = lowest_waves(problem, 3)
    assert max(distance(problem, row, value) for row in range(2) for value in z[row] if value > 0.0) < ROUNDING


@pytest.mark.parametrize("name", models())
def test_counts_at_random_points(name):
    problem = problem_of(models()[name].at(values_of(name, 1, 1.0, seed=5)))
    z = 10 ** np.random.default_rng(5).uniform(-1, 6, 60)
    where = np.zeros(z.size, dtype=int)
    count, value = determinant(problem).take(where).count(z)
    np.testing.assert_array_equal(count, stiffness(problem).evaluate(z, where).count)
    np.testing.assert_array_equal(np.sign(value), (-1.0) ** count)


@pytest.mark.sample(5, 3)
@pytest.mark.parametrize("name", models())
def test_no_spring_and_infinite_ones(name):
    """Springs 0, finite or infinite, alone and together, with masses and without."""
    system = models()[name]
    names = [s.name for s in system.symbols if s.name in SPRINGS]
    worst = 0.0
    cases = list(product(product((0.0, None, INF), repeat=len(names)), (False, True)))
    for at in np.random.default_rng(2).permutation(len(cases))[:_CASES]:
        kinds, massless = cases[at]
        if massless and 0.0 in kinds:
            continue  # of a coordinate without mass and spring nothing is known
        given = {key: kind for key, kind in zip(names, kinds, strict=True) if kind is not None}
        given |= {s.name: 0.0 for s in system.symbols if massless and s.name in MASSES}
        bound = system.at({**{s.name: GIVEN[s.name] for s in system.symbols}, **given})
        _, simple = bound._route._covered(np.array(bound.parameters, dtype=float)[:, None])
        assert simple.all()
        found, other = bound.natural_frequencies(5), by_dynamic_stiffness(bound, 5)
        worst = max(worst, float(np.max(np.abs(found**2 - other**2)) / other[-1] ** 2))
    assert worst < 1e-12


@pytest.mark.parametrize("name", ["base and payload, tension", "gantry", "base that carries a beam"])
def test_what_is_known_of_the_coefficients_is_so(name):
    values = values_of(name, 3, 1.0) | {"k": np.array([0.0, 1.0, INF])}
    system = models()[name].at(values)
    coefficients = problem_of(system).all_coefficients()
    for value, row in zip(system._route.known, coefficients, strict=True):
        assert value is None or (row == value).all()


@pytest.mark.parametrize("name", models())
def test_modes_are_those_of_the_dynamic_stiffness(name):
    system = models()[name].at({s.name: GIVEN[s.name] for s in models()[name].symbols})
    omega = system.natural_frequencies(4)
    ours, general = system.modes(4), GeneralRoute(system.numerics("spatial"))
    theirs, spatial = general.modes(system.parameters, (), omega), general.spatial
    places = np.linspace(0.0, GIVEN["L"], 7)
    moving = omega > 0.0  # two rigid motions span the same
    found = [(modes.shape(field, 0, places)) for modes in (ours, theirs) for field in range(spatial.displacements)]
    for one, other in zip(found[: spatial.displacements], found[spatial.displacements :], strict=True):
        np.testing.assert_allclose(one[moving], other[moving], atol=1e-8 * np.abs(other).max())
    for number in range(spatial.coordinates):
        np.testing.assert_allclose(
            ours.coordinate(number)[moving], theirs.coordinate(number)[moving], atol=1e-8 * np.abs(found[0]).max()
        )
    for end, place in product((0, 1), range(spatial.displacements)):
        one, other = ours.force(end, place), theirs.force(end, place)
        np.testing.assert_allclose(one[moving], other[moving], atol=1e-7 * max(np.abs(other).max(), 1.0))


@pytest.mark.parametrize("name", models())
def test_modes_are_orthonormal_in_mass_and_stiffness(name):
    """By the forms derived from the Lagrangian, which know nothing of the closed forms."""
    system = models()[name].at(values_of(name, 3, 0.7, seed=8))
    forms = system.form("rates", 4)
    omega = system.natural_frequencies(4)
    np.testing.assert_allclose(forms["mass"], np.broadcast_to(np.eye(4), (3, 4, 4)), atol=1e-9)
    np.testing.assert_allclose(
        forms["stiffness"], omega[..., None] ** 2 * np.eye(4), atol=1e-9 * float(np.max(omega) ** 2)
    )


@pytest.mark.parametrize("name", ["base and payload, tension", "springs between the ends", "gantry"])
def test_ritz_converges_to_the_closed_forms(name):
    values = {s.name: GIVEN[s.name] for s in models()[name].symbols}
    exact = models()[name].natural_frequencies(values, modes=3)
    coarse, fine = (models()[name].ritz(elements=n).natural_frequencies(values, modes=3) for n in (6, 12))
    # from above; halving the elements divides the error of a square by 2^4
    assert (fine >= exact * (1 - 1e-9)).all()
    assert ((fine - exact) <= (coarse - exact) / 12.0 + 1e-9 * exact).all()


@pytest.mark.parametrize("name", ["payload on a string", "two beams and a spring"])
@pytest.mark.skipif(not has_compiler(), reason="needs llvmlite")
def test_compiled_twins_agree(name):
    system = models()[name].at(values_of(name, 300, 4.0))
    problem, route = problem_of(system), system._route
    search = compiled(template(route.structure, route.known), {}).lowest_waves
    np.testing.assert_allclose(lowest_waves(problem, 4, search), lowest_waves(problem, 4), rtol=1e-13)


@pytest.mark.parametrize("share", [1e-2, 1e-6, 1e-10, 1e-14])
def test_a_payload_tuned_to_the_string(share):
    """The payload's own frequency is a string's: both modes are there, as far apart as the payload is light."""
    string = models()["payload on a string"]
    own = np.pi / 2  # a string held at one end, with tension, mass and length of one
    values = {"m": 1.0, "T": 1.0, "L": 1.0, "k": INF, "m_p": share, "k_2": share * own**2}
    z = string.natural_frequencies(values, modes=3) ** 2 * 4 * np.pi**2
    # to first order in the root of the share both modes are half of own * sqrt(2 share) away from own
    gap = own * np.sqrt(2.0 * share)
    np.testing.assert_allclose(np.diff(np.sqrt(z))[0], gap, rtol=5.0 * np.sqrt(share) + 1e-15 * own / gap)
    problem = problem_of(string.at(values))
    assert max(distance(problem, 0, value) for value in lowest_waves(problem, 3)[0]) < ROUNDING


def test_equal_beams_that_hardly_know_each_other():
    """The determinant of each is a factor: what tells them apart is not lost in the rounding of the other."""
    twins = models()["two beams and a spring"]
    values = {"EI": 1.0, "m": 1.0, "m_2": 1.0, "L": 1.0, "k": 1e-7, "k_t": INF, "k_r": INF, "m_e": 0.0}
    problem = problem_of(twins.at(values))
    z = lowest_waves(problem, 4)[0]
    # the symmetric motion does not stretch the spring; the other has 2 k phi^2 more, with phi = 2 at the tip
    np.testing.assert_allclose(z[1::2] - z[::2], 2 * 1e-7 * 4.0, rtol=1e-3)
    assert max(distance(problem, 0, value) for value in z) < ROUNDING


def test_blocks_in_different_regimes():
    """Bending that is nearly rigid beside bending with many waves: each block has its own formulas."""
    gantry = models()["gantry"]
    values = {s.name: GIVEN[s.name] for s in gantry.symbols} | {"m": 1e-7, "m_2": 1e3, "m_p": 1e-9}
    problem = problem_of(gantry.at(values))
    z = lowest_waves(problem, 3)[0]
    assert max(distance(problem, 0, value) for value in z) < ROUNDING


def test_rigid_links_between_what_is_held():
    """A base on the ground and a beam on the base, all rigid: a clamped beam, however often it is held."""
    held = model(
        BEAM, [v], BASE + JOINT - HALF * k_2 * (v - w) ** 2 + TURNING, TIP - HALF * T * (v - p) ** 2 + PAYLOAD, [w, p]
    )  # fmt: skip
    free = {"EI": 1.0, "L": 1.0, "m": 1.0, "m_e": 0.0, "m_w": 0.3, "m_p": 0.1, "k_r": INF}
    at = held.at(free | {"k": [INF, INF, 0.0, 1.0], "k_t": [INF, 2.0, INF, INF], "k_2": INF, "T": INF})
    tip = cra.Model(BEAM, fields=[v], x=x, domain=(0, L), t=t, right=TIP, essential=clamped(v))
    clamp = tip.natural_frequencies({"EI": 1.0, "L": 1.0, "m": 1.0, "m_e": 0.1}, modes=4)
    np.testing.assert_allclose(cra.natural_frequencies(at, 4), np.broadcast_to(clamp, (4, 4)), rtol=1e-13)


def test_rigid_motions_are_exact_zeros():
    carts = models()["Timoshenko beam on carts"]
    values = {s.name: GIVEN[s.name] for s in carts.symbols} | {"k_r": 0.0}
    for given, zeros in (({}, 2), ({"k_r": 1.0}, 1), ({"k": 0.0}, 3), ({"k": 0.0, "k_2": 0.0}, 4)):
        omega = carts.at(values | given).natural_frequencies(6)
        assert ((omega == 0.0).sum(), (omega > 0.0).sum()) == (zeros, 6 - zeros)


def test_a_coordinate_without_mass_and_stiffness_is_refused():
    payload = models()["payload on a string"]
    values = {s.name: GIVEN[s.name] for s in payload.symbols} | {"m_p": 0.0, "k_2": 0.0}
    with pytest.raises(
        ValueError, match=r"^values: a motion of the lumped coordinates p\(t\) alone has neither mass nor"
    ):
        payload.natural_frequencies(values)


def test_unstable_links_are_refused():
    ends = models()["springs between the ends"]
    values = {s.name: GIVEN[s.name] for s in ends.symbols}
    with pytest.raises(ValueError, match="has buckled: 1 unstable mode"):
        ends.natural_frequencies(values | {"k": -3.0, "k_2": 0.0, "k_t": 1.0})


def test_what_keeps_the_dynamic_stiffness():
    """A foundation that moves, four waves that are coupled, three beams on two carriages: slower, and right."""
    moving = HALF * K * (v - w) ** 2
    base = model(BEAM - moving, [v], BASE, None, [w])
    layer = model(BEAM + OTHER - HALF * K * (v - u) ** 2, [v, u], JOINT, TIP)
    carriages = (
        HALF * m_w * w.diff(t) ** 2
        + PAYLOAD
        - sum(HALF * k * (f - w) ** 2 for f in (v, u))
        - HALF * k_2 * (theta - p) ** 2
    )
    third = HALF * m * theta.diff(t) ** 2 - HALF * EI * theta.diff(x, 2) ** 2
    many = model(BEAM + OTHER + third, [v, u, theta], JOINT, carriages, [w, p])
    for kind, rigid in ((base, 0), (layer, 1), (many, 4)):
        values = {s.name: GIVEN[s.name] for s in kind.symbols}
        system, modes = kind.at(values), rigid + 3
        assert isinstance(system._route, GeneralRoute)
        found = system.natural_frequencies(modes) / (2 * np.pi)
        expected = kind.ritz(elements=16).natural_frequencies(values, modes=modes)
        assert not found[:rigid].any()
        # elements of length h exceed frequencies by (beta h)^4 / 1440, where beta h is below 0.35 here
        np.testing.assert_allclose(found[rigid:], expected[rigid:], rtol=1e-5)
