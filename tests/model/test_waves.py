"""Models with one to three wave numbers beside those of the arm: closed forms against dynamic stiffness and Ritz."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scipy.linalg
import sympy as sp
from scipy.optimize import brentq

import cra_sym as cra
from cra_sym.kernels import compiled, has_compiler
from cra_sym.model.routes import GeneralRoute
from cra_sym.model.waves import Waves
from cra_sym.solvers.waves import lowest_waves, template
from tests.solvers.wave_problems import INF
from tests.systems import system as named

x, t, L = sp.Symbol("x"), sp.Symbol("t"), sp.Symbol("L")
v, w, phi, theta = (sp.Function(name)(x, t) for name in ("v", "w", "phi", "theta"))
EI, GJ, m, m_2, J, y, T, T_2, K, k, k_2, m_e, G, I = sp.symbols("EI GJ m m_2 J y T T_2 K k k_2 m_e G I")
HALF = sp.Rational(1, 2)
BEAM = HALF * m * v.diff(t) ** 2 - HALF * EI * v.diff(x, 2) ** 2
STRING = HALF * m_2 * w.diff(t) ** 2 - HALF * T_2 * w.diff(x) ** 2
TWIST = HALF * m * (v.diff(t) + y * phi.diff(t)) ** 2 + HALF * J * phi.diff(t) ** 2 - HALF * GJ * phi.diff(x) ** 2
THICK = HALF * m * v.diff(t) ** 2 + HALF * I * theta.diff(t) ** 2 - HALF * EI * theta.diff(x) ** 2
GIVEN = {
    "EI": 1.3, "GJ": 0.4, "m": 1.1, "m_2": 0.7, "J": 0.05, "y": 0.2, "T": 3.0, "T_2": 5.0, "K": 20.0, "k": 30.0,
    "k_2": 7.0, "m_e": 0.4, "L": 1.2, "G": 40.0, "I": 0.01,
}  # fmt: skip


def model(density, fields, left, right, *essential):
    return cra.Model(density, fields=fields, x=x, domain=(0, L), t=t, left=left, right=right, essential=list(essential))


@cache
def models():
    tip, joint = HALF * m_e * v.diff(t) ** 2, -HALF * k * v**2
    lever = HALF * m_e * (v.diff(t) + 2 * y * phi.diff(t)) ** 2
    return {
        "string on a foundation": model(
            HALF * m * v.diff(t) ** 2 - HALF * T * v.diff(x) ** 2 - HALF * K * v**2, [v], joint, tip
        ),
        "bending and torsion": model(
            TWIST - HALF * EI * v.diff(x, 2) ** 2, [v, phi], joint - HALF * k_2 * phi**2, lever, v.diff(x).subs(x, 0)
        ),
        "bending and torsion on a foundation": model(
            TWIST - HALF * EI * v.diff(x, 2) ** 2 - HALF * K * v**2 - HALF * T * v.diff(x) ** 2,
            [v, phi], joint - HALF * k_2 * phi**2, tip, v.diff(x).subs(x, 0),
        ),
        "beam tied to a string": model(
            BEAM + STRING, [v, w], joint, tip, v.diff(x).subs(x, 0), w.subs(x, 0), (v - w).subs(x, L)
        ),
        "beam and string with a spring between the ends": model(
            BEAM + STRING, [v, w], joint, tip - HALF * k_2 * (v - w) ** 2, w.subs(x, 0)
        ),
        "beam and string on an elastic layer": model(
            BEAM + STRING - HALF * K * (v - w) ** 2, [v, w], joint, tip - HALF * k_2 * (v - w) ** 2, w.subs(x, 0)
        ),
        "Timoshenko beam beside a string": model(
            THICK - HALF * G * (v.diff(x) - theta) ** 2, [v, theta], joint, tip, theta.subs(x, 0)
        ),
    }  # fmt: skip


def random_values(name, rows, decades=1.0):
    rng = np.random.default_rng(len(name))
    return {s.name: GIVEN[s.name] * 10 ** rng.uniform(-decades, decades, rows) for s in models()[name].symbols}


def both(system, modes):
    general = GeneralRoute(system.numerics("spatial"))
    return system.natural_frequencies(modes), general.angular_frequencies(system.parameters, system.shape, modes)


@pytest.mark.parametrize("name", models())
def test_closed_forms_are_the_dynamic_stiffness(name):
    system = models()[name].at(random_values(name, 12))
    assert isinstance(system._route, Waves)
    found, other = both(system, 5)
    # the polish of the dynamic stiffness is good to 1e-12 of a squared frequency, and of the last one for soft ones
    np.testing.assert_allclose(found, other, rtol=1e-10, atol=1e-6 * 1e-6 * other[:, -1].max())


@pytest.mark.parametrize("name", models())
def test_ritz_converges_to_the_closed_forms(name):
    values = {s.name: GIVEN[s.name] for s in models()[name].symbols}
    exact = models()[name].natural_frequencies(values, modes=3)
    coarse, fine = (models()[name].ritz(elements=n).natural_frequencies(values, modes=3) for n in (8, 16))
    # from above; halving the elements divides the error of the square by 2^4 for slopes linear in an element, or more
    assert (fine >= exact * (1 - 1e-9)).all()
    assert ((fine - exact) <= (coarse - exact) / 3.5 + 1e-9 * exact).all()
    np.testing.assert_allclose(fine, exact, rtol=2e-2)


@pytest.mark.parametrize("name", models())
def test_modes_are_those_of_the_dynamic_stiffness(name):
    system = models()[name].at({s.name: GIVEN[s.name] for s in models()[name].symbols})
    ours = system.modes(4)
    theirs = GeneralRoute(system.numerics("spatial")).modes(system.parameters, (), system.natural_frequencies(4))
    places = np.linspace(0.0, GIVEN["L"], 7)
    for field in range(system.numerics("spatial").displacements):
        size = np.abs(theirs.shape(field, 0, places)).max()
        np.testing.assert_allclose(
            ours.shape(field, 0, places), theirs.shape(field, 0, places), atol=1e-8 * size
        )  # roots to 1e-12, shapes to that over the distance of neighbours


def test_modes_of_a_batch_are_found_block_by_block(monkeypatch):
    monkeypatch.setattr("cra_sym.model.waves._SHAPES_BLOCK", 2)
    tension, x = np.linspace(1.0, 60.0, 5), [0.0, 0.3, 1.2]
    many = cra.mode_shapes(named("tensioned beam", T=tension), x, 2)
    for one, shape in zip(tension, many, strict=True):
        np.testing.assert_allclose(shape, cra.mode_shapes(named("tensioned beam", T=one), x, 2), rtol=1e-12, atol=1e-12)
    assert cra.mode_shapes(named("tensioned beam", T=np.empty(0)), x, 2).shape == (0, 2, 3)


@pytest.mark.parametrize("name", models())
def test_what_is_known_of_the_coefficients_is_so(name):
    """For infinite stiffness of the ends too."""
    model = models()[name]
    values = random_values(name, 3) | {"k": np.array([0.0, 1.0, INF])}
    if name in ("bending and torsion", "bending and torsion on a foundation"):
        values["k_2"] = np.array([INF, 0.0, 2.0])
    system = model.at(values)
    route = system._route
    problem = route._problem(np.array([np.broadcast_to(value, 3) for value in system.parameters]))[0]
    coefficients = problem.all_coefficients()
    for value, row in zip(route.known, coefficients, strict=True):
        assert value is None or (row == value).all()
    found, other = both(system, 4)
    np.testing.assert_allclose(found, other, rtol=1e-9, atol=1e-9 * other.max())


@pytest.mark.skipif(not has_compiler(), reason="needs llvmlite")
@pytest.mark.parametrize(
    "name", ["string on a foundation", "bending and torsion on a foundation", "beam tied to a string"]
)
def test_compiled_twins_agree(name):
    system = models()[name].at(random_values(name, 300))
    route = system._route
    problem = route._problem(np.array([np.broadcast_to(value, 300) for value in system.parameters]))[0]
    search = compiled(template(route.structure, route.known), {}).lowest_waves
    # three waves that are coupled: roundings of the split, over the distance of the waves
    np.testing.assert_allclose(lowest_waves(problem, 4, search), lowest_waves(problem, 4), rtol=1e-11)


def test_a_string_below_its_cut_off():
    """A heavy end moves at a frequency below that of the foundation, where no wave runs along the string."""
    system = models()["string on a foundation"].at({"m": 1.0, "T": 1.0, "K": 100.0, "L": 1.0, "k": INF, "m_e": 5.0})
    omega = system.natural_frequencies(3)
    kappa = np.sqrt(100.0 - omega[0] ** 2)
    assert omega[0] < 10.0
    np.testing.assert_allclose(kappa, 5.0 * omega[0] ** 2 * np.tanh(kappa), rtol=1e-12)
    wave = np.sqrt(omega[1:] ** 2 - 100.0)
    # cos - m_e omega^2 sin / wave of both, over its slope
    np.testing.assert_allclose(wave / np.tan(wave), 5.0 * omega[1:] ** 2, rtol=1e-9)


def test_rigid_motions_of_tied_fields_are_exact_zeros():
    system = models()["beam and string with a spring between the ends"].at(
        {**{s.name: GIVEN[s.name] for s in models()["beam and string with a spring between the ends"].symbols},
         "k": 0.0, "k_2": 0.0}
    )  # fmt: skip
    omega = system.natural_frequencies(4)
    assert (omega[:2] == 0.0).all() and omega[2] > 0.0


def test_a_star_of_strings_and_two_planes_with_a_carriage_have_double_frequencies():
    """Of three equal strings joined by springs, two motions leave the centre at rest: N q cos q + 3 k L sin q = 0."""
    strings = [sp.Function(f"v_{i}")(x, t) for i in range(3)]
    pairs = list(zip(strings, strings[1:] + strings[:1], strict=True))
    star = model(
        sum(m * one.diff(t) ** 2 / 2 - T * one.diff(x) ** 2 / 2 for one in strings),
        strings, None, -k * sum((one - other) ** 2 for one, other in pairs) / 2, *(one.subs(x, 0) for one in strings),
    ).at({name: GIVEN[name] for name in ("m", "T", "k", "L")})  # fmt: skip
    squares = star.natural_frequencies(6) ** 2
    wave = np.sqrt(squares * GIVEN["m"] / GIVEN["T"]) * GIVEN["L"]
    residue = GIVEN["T"] * wave * np.cos(wave) + 3 * GIVEN["k"] * GIVEN["L"] * np.sin(wave)
    np.testing.assert_allclose(wave[[0, 3]], [np.pi / 2, 3 * np.pi / 2], rtol=1e-14)
    # the slope of the residue is about 3 k L = 108, beside which 1e-12 of the frequencies count
    np.testing.assert_allclose(residue[[1, 2, 4, 5]], 0.0, atol=1e-10)
    p, q = (sp.Function(name)(t) for name in "pq")

    def carriage(planes):
        return cra.Model(
            sum(m * one.diff(t) ** 2 / 2 - EI * one.diff(x, 2) ** 2 / 2 for one, _ in planes),
            fields=[one for one, _ in planes], coordinates=[moved for _, moved in planes], x=x, domain=(0, L), t=t,
            right=sum(m_e * moved.diff(t) ** 2 / 2 - k * (one - moved) ** 2 / 2 for one, moved in planes),
            essential=[part.subs(x, 0) for one, _ in planes for part in (one, one.diff(x))],
        ).at({name: GIVEN[name] for name in ("m", "EI", "k", "m_e", "L")})  # fmt: skip

    alone, both_planes = carriage([(v, p)]), carriage([(v, p), (w, q)])
    for number in (1, 6):
        expected = np.repeat(alone.natural_frequencies(3), 2)[:number]
        np.testing.assert_allclose(both_planes.natural_frequencies(number), expected, rtol=1e-12)
    for system in (star, both_planes):
        np.testing.assert_allclose(system.form("rates", 6)["mass"], np.eye(6), atol=1e-10)


@pytest.mark.parametrize("number", [2, 3])
def test_equal_strings_in_a_layer_have_equal_waves(number):
    """T q^2 = m w^2 - number K for all motions but the common one; of two strings without a layer both are the same."""
    strings = [sp.Function(f"v_{i}")(x, t) for i in range(number)]
    pairs = [(one, other) for i, one in enumerate(strings) for other in strings[:i]]
    layered = model(
        sum(m * one.diff(t) ** 2 / 2 - T * one.diff(x) ** 2 / 2 for one in strings)
        - K * sum((one - other) ** 2 for one, other in pairs) / 2,
        strings, None, -k * sum(one**2 for one in strings) / 2, *(one.subs(x, 0) for one in strings),
    )  # fmt: skip
    layers = [0.0, 1e-6, 2.0] if number == 2 else [3.0, 20.0]
    system = layered.at({name: GIVEN[name] for name in ("m", "T", "k", "L")} | {"K": layers})
    wave = [
        brentq(lambda q: GIVEN["T"] * q * np.cos(q) + GIVEN["k"] * GIVEN["L"] * np.sin(q), (j - 0.5) * np.pi, j * np.pi,
               xtol=1e-14) for j in (1, 2, 3, 4)
    ]  # fmt: skip
    common = GIVEN["T"] / GIVEN["m"] * (np.array(wave) / GIVEN["L"]) ** 2
    for layer, omega in zip(layers, system.natural_frequencies(5), strict=True):
        apart = np.repeat(common + number * layer / GIVEN["m"], number - 1)
        expected = np.sort(np.concatenate([common, apart]))[:5]
        np.testing.assert_allclose(omega**2, expected, rtol=1e-12)
    for layer in layers:
        alone = system.replace(K=layer)
        assert alone.check(4).agree
        # shapes of frequencies at a distance are known to rounding over that distance
        np.testing.assert_allclose(alone.form("rates", 5)["mass"], np.eye(5), atol=1e-6)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_free_strings_on_foundations_move_in_cosines(number):
    """Coupled ones too, K u = z M u with T (j pi)^2 added: at j = 0 a section moves without any force along it."""
    names = [sp.symbols(f"{name}:{number}") for name in ("m", "N", "k")] + [sp.symbols(f"c:{number}")[1:]]
    fields = [sp.Function(f"v_{i}")(x, t) for i in range(number)]
    density = sum(
        m * q.diff(t) ** 2 / 2 - N * q.diff(x) ** 2 / 2 - k * q**2 / 2
        for m, N, k, q in zip(*names[:3], fields, strict=True)
    ) - sum(c * (p - q) ** 2 / 2 for c, p, q in zip(names[3], fields, fields[1:], strict=False))
    model = cra.Model(density, fields=fields, x=x, domain=(0, 1), t=t)
    rng, places, tried = np.random.default_rng(number), np.linspace(0.0, 1.0, 7), 0
    while tried < 12:
        masses, tensions, springs, links = (10 ** rng.uniform(-2, 2, len(part)) for part in names)
        stiffness = np.diag(springs)
        for i, link in enumerate(links):
            stiffness[i : i + 2, i : i + 2] += link * np.array([[1, -1], [-1, 1]])
        exact = []
        for j in range(6):
            z, shape = scipy.linalg.eigh(stiffness + np.diag(tensions * (j * np.pi) ** 2), np.diag(masses))
            shape = shape * (np.sqrt(2.0) if j else 1.0)
            exact += [(z[i], np.outer(shape[:, i], np.cos(j * np.pi * places))) for i in range(number)]
        exact.sort(key=lambda pair: pair[0])
        z = np.array([pair[0] for pair in exact])
        if (np.diff(z[:5]) < 1e-2 * z[4]).any():  # close ones turn by the error of the root over their distance
            continue
        tried += 1
        values = np.concatenate([masses, tensions, springs, links])
        flat = [symbol.name for part in names for symbol in part]
        system = model.at(dict(zip(flat, values.tolist(), strict=True)))
        np.testing.assert_allclose(system.natural_frequencies(4) ** 2, z[:4], rtol=1e-11)  # as tests of three waves
        found = np.stack([cra.mode_shapes(system, places, 4, field=q) for q in fields], axis=1)
        for ours, (_, shape) in zip(found, exact[:4], strict=True):
            sign = np.sign((ours * shape).sum())
            np.testing.assert_allclose(sign * ours, shape, atol=1e-9 * np.abs(shape).max())
