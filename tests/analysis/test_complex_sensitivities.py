"""Sensitivities of complex eigenvalues and modes, against closed forms and central differences in 30 digits."""

from __future__ import annotations

import pickle

import mpmath
import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from tests.systems import system

x, t, length, rhoA, EI, m, U, c, T, k = sp.symbols("x t l rhoA EI m U c T k")
v, w = sp.Function("v")(x, t), sp.Function("w")(t)
DOMAIN = {"fields": [v], "x": x, "domain": (0, length), "t": t}
PIPE = cra.Model(  # clamped, with a damper at the end where the fluid leaves
    rhoA * v.diff(t) ** 2 / 2 + m * (v.diff(t) + U * v.diff(x)) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2
    + (rhoA + m) * v.diff(t) * w.diff(t),
    essential=[v.subs(x, 0), v.diff(x).subs(x, 0)], prescribed=[w],
    virtual_work=[(-m * U * (v.diff(t) + U * v.diff(x)) - c * v.diff(t), v, "right")], **DOMAIN,
)  # fmt: skip
VALUES = {"rhoA": 0.3, "m": 0.2, "EI": 5.0, "U": 4.0, "l": 1.2, "c": 0.4}


def conditions(s, values):
    """Return wave numbers of the pipe, the roots of its quartic, and the boundary conditions of these waves."""
    p = {name: mpmath.mpf(value) for name, value in values.items()}
    quartic = [p["EI"], 0, p["m"] * p["U"] ** 2, 2 * p["m"] * p["U"] * s, (p["m"] + p["rhoA"]) * s**2]
    waves = mpmath.polyroots(quartic, maxsteps=100, extraprec=60)
    ends = [mpmath.exp(w * p["l"]) for w in waves]
    rows = [[1] * 4, waves, [w**2 * e for w, e in zip(waves, ends, strict=True)],
            [(p["EI"] * w**3 - p["c"] * s) * e for w, e in zip(waves, ends, strict=True)]]  # fmt: skip
    return waves, mpmath.matrix(rows)


def pipe(s, values):
    """Return the determinant of the boundary conditions."""
    return mpmath.det(conditions(s, values)[1])


def pipe_mode(s, values, shares):
    """Return the mode at shares of the length, and its participation in a motion of the base."""
    waves, rows = conditions(s, values)
    length, mass = mpmath.mpf(values["l"]), mpmath.mpf(values["m"]) + mpmath.mpf(values["rhoA"])
    sizes = [*mpmath.lu_solve(rows[:3, :3], -rows[:3, 3]), mpmath.mpf(1)]
    parts = list(zip(sizes, waves, strict=True))

    def integral(wave):
        return (mpmath.exp(wave * length) - 1) / wave

    energy = mass * sum(a * mpmath.conj(b) * integral(w + mpmath.conj(u)) for a, w in parts for b, u in parts).real
    places = [sum(a * mpmath.exp(w * length * share) for a, w in parts) for share in (*shares, 1)]
    scale = abs(places[-1]) / places[-1] / mpmath.sqrt(energy)
    return [scale * place for place in places[:-1]] + [scale * mass * sum(a * integral(w) for a, w in parts)]


def test_pipe_against_30_digits():
    found = cra.sensitivities(PIPE.at(VALUES), 2)
    with mpmath.workdps(30):
        for mode, s in enumerate(found.eigenvalue):
            for name, value in VALUES.items():
                step = mpmath.mpf(10) ** -10 * value
                up, down = (
                    mpmath.findroot(lambda z, at=value + side * step, of=name: pipe(z, VALUES | {of: at}), complex(s))
                    for side in (1, -1)
                )
                slope = complex((up - down) / (2 * step))
                # eighth-order differences of eigenvalues that are known to about 1e-14
                assert abs(found.eigenvalue_rate[name][mode] - slope) < 1e-9 * abs(s) / value, (name, mode)
                assert found.rate[name][mode] == pytest.approx(slope.imag / (2 * np.pi), abs=1e-9 * abs(s) / value)
                assert found.log[name][mode] == pytest.approx(value * slope.imag / s.imag, abs=1e-9)
                ratio = float((-up.real / abs(up) + down.real / abs(down)) / (2 * step))
                assert found.damping_ratio_rate[name][mode] == pytest.approx(ratio, abs=1e-9 / value)


def test_modes_of_the_pipe_against_30_digits():
    system, shares = PIPE.at(VALUES), (0.3, 0.7, 1.0)
    found, places = cra.sensitivities(system, 2), np.multiply(shares, 1.2)
    size = np.abs(cra.mode_shapes(system, places, 2, damped=True)).max()
    with mpmath.workdps(30):
        for name in ("rhoA", "U", "l", "c"):
            value = VALUES[name]
            rates = np.column_stack([found.shapes(name, places), found.participation(name)])
            for s, rate in zip(found.eigenvalue, rates, strict=True):
                step, sides = mpmath.mpf(10) ** -10 * value, []
                for side in (1, -1):
                    at = VALUES | {name: mpmath.mpf(value) + side * step}
                    sides.append(pipe_mode(mpmath.findroot(lambda z, at=at: pipe(z, at), complex(s)), at, shares))
                exact = np.array([complex((up - down) / (2 * step)) for up, down in zip(*sides, strict=True)])
                np.testing.assert_allclose(rate, exact, atol=1e-9 * size / value)


TURNING = {
    "fields": (), "coordinates": [(p := sp.Function("p")(t)), (q := sp.Function("q")(t))], "x": x, "domain": (0, 1),
    "t": t, "left": m * (p.diff(t) ** 2 + q.diff(t) ** 2) / 2 + m * c * (p * q.diff(t) - q * p.diff(t))
    - k * (p**2 + 2 * q**2 - p * q) / 2,
}  # fmt: skip


@pytest.mark.parametrize("speed", [0.0, 0.4])
def test_modes_of_two_masses(speed):
    """Without a field they have no place; in a frame that turns they are complex."""
    values = {"m": 0.3, "k": 5.0} | ({"c": speed} if speed else {})
    terms = TURNING if speed else TURNING | {"left": TURNING["left"].subs(c, 0)}
    system = cra.Model(sp.S.Zero, **terms).at(values)

    def mode(number, part, **changed):
        at = {"c": 0.0} | values | changed
        mass, spring, turn = (mpmath.mpf(at[name]) for name in ("m", "k", "c"))
        whole = spring / mass
        middle = 3 * whole + 4 * turn**2
        square = (middle + (2 * number - 1) * mpmath.sqrt(middle**2 - 7 * whole**2)) / 2
        across = (whole - square) / (whole / 2 + 2j * turn * mpmath.sqrt(square))
        return (1, across)[part] / mpmath.sqrt(mass * (1 + abs(across) ** 2))

    found, shapes = cra.sensitivities(system, 2), cra.mode_shapes
    for part, one in enumerate((p, q)):
        exact = [complex(mode(number, part)) for number in range(2)]
        np.testing.assert_allclose(shapes(system, modes=2, field=one, damped=True), exact, atol=1e-12)
        for name, value in values.items():
            slope = [
                complex(mpmath.diff(lambda z, n=number, a=part, of=name: mode(n, a, **{of: z}), value))
                for number in range(2)
            ]
            np.testing.assert_allclose(found.shapes(name, field=one), slope, atol=1e-9 / value)
    with pytest.raises(ValueError, match="x: the model has coordinates alone, which have no place; leave it out"):
        found.shapes("k", 0.5)
    with pytest.raises(ValueError, match="x: the model has coordinates alone"):
        shapes(system, 0.5)


def test_moving_string_in_closed_form():
    """Between two eyes: omega_n = n pi (w^2 - U^2) / (l w) with w = sqrt(T / m); the spring of the eye is rigid."""
    string = cra.Model(
        m * (v.diff(t) + U * v.diff(x)) ** 2 / 2 - T * v.diff(x) ** 2 / 2,
        left=-k * v**2 / 2, essential=[v.subs(x, length)], **DOMAIN,
    )  # fmt: skip
    values = {"m": 0.3, "T": np.array([20.0, 45.0]), "U": 3.0, "l": 1.2}
    found = cra.sensitivities(string.at({**values, "k": np.inf}), 3)
    number = np.arange(1, 4)
    symbols = {name: sp.Symbol(name, positive=True) for name in values}
    wave = sp.sqrt(symbols["T"] / symbols["m"])
    first = (wave**2 - symbols["U"] ** 2) / (2 * symbols["l"] * wave)
    for name in values:
        slope = sp.lambdify(list(symbols.values()), first.diff(symbols[name]))(*values.values())
        np.testing.assert_allclose(found.rate[name], slope[:, None] * number, rtol=1e-9)
    assert not found.rate["k"].any() and not found.log["k"].any()
    # at rest the eye's compliance 1/k lengthens the string by T/k
    still = cra.sensitivities(string.at({**values, "U": 0.0, "k": np.inf}), 3)
    longer = -(symbols["T"] * sp.sqrt(symbols["T"] / symbols["m"])) / (2 * symbols["l"] ** 2)
    slope = sp.lambdify(list(symbols.values()), longer)(*values.values())
    np.testing.assert_allclose(still.compliance["k"], slope[:, None] * number, rtol=1e-8)
    assert not np.abs(still.rate["U"]).max() > 1e-8  # the speed enters by its square


#: Powers of (mass, length, time) in the units of the parameters.
UNITS = {"EI": (1, 3, -2), "k": (1, 0, -2), "l": (0, 1, 0), "m": (1, 0, 0), "rhoA": (1, -1, 0), "a": (0, 1, 0)}


def test_units_are_followed():
    """Eigenvalues change with the units of mass, length and time as one over a time: three sums are known."""
    # a spring is one per length on displacements and one times length on slopes: the pipe's is on slopes alone
    units = UNITS | {"m": (1, -1, 0), "U": (0, 1, -1), "k": (1, 2, -2)}
    found = cra.sensitivities(system("pipe on a support"), 3)
    for unit, total in enumerate((0.0, 0.0, -1.0)):
        whole = sum(
            units[name][unit] * value * found.eigenvalue_rate[name]
            for name, value in system("pipe on a support").values.items()
        )
        np.testing.assert_allclose(whole, total * found.eigenvalue, atol=1e-9 * np.abs(found.eigenvalue).max())
    shapes = cra.mode_shapes(system("pipe on a support"), [0.3, 1.2], 3, damped=True)
    rates = {name: found.shapes(name, [0.3, 1.2]) for name in system("pipe on a support").values}
    for unit, total in enumerate((-0.5, 0.0, 0.0)):  # one over the root of a mass
        whole = sum(
            units[name][unit] * value * rates[name] for name, value in system("pipe on a support").values.items()
        )
        np.testing.assert_allclose(whole, total * shapes, atol=1e-9 * np.abs(shapes).max())


def test_damped_and_tapered():
    """A damper of a beam whose stiffness varies: units again, and natural frequencies beside complex eigenvalues."""
    kappa = sp.Symbol("kappa")
    beam = cra.Model(
        rhoA * v.diff(t) ** 2 / 2 - EI * (1 - kappa * x / length) * v.diff(x, 2) ** 2 / 2,
        left=-k * v.diff(x) ** 2 / 2, essential=[v.subs(x, 0)],
        virtual_work=[(-c * v.diff(t), v, "right")], **DOMAIN,
    ).at({"rhoA": 0.3, "EI": 5.0, "kappa": 0.4, "l": 1.2, "k": 40.0, "c": 0.6})  # fmt: skip
    found = cra.sensitivities(beam, 3)
    units = {"rhoA": (1, -1, 0), "EI": (1, 3, -2), "kappa": (0, 0, 0), "l": (0, 1, 0), "k": (1, 2, -2), "c": (1, 0, -1)}
    for unit, total in enumerate((0.0, 0.0, -1.0)):
        whole = sum(units[name][unit] * value * found.eigenvalue_rate[name] for name, value in beam.values.items())
        np.testing.assert_allclose(whole, total * found.eigenvalue, atol=1e-9 * np.abs(found.eigenvalue).max())
    bare = beam.replace(c=0.0)
    natural = cra.sensitivities(bare, 3)
    for name in ("EI", "kappa", "k"):  # without damping the two routes agree
        other = natural.eigenvalue_rate[name].imag / (2 * np.pi)
        np.testing.assert_allclose(other, natural.rate[name], rtol=1e-8)
        np.testing.assert_allclose(found.rate[name], natural.rate[name], rtol=1e-12)
    # a small damper adds -c phi(l)^2 / 2 to every eigenvalue
    tip = cra.mode_shapes(bare, 1.2, 3)
    np.testing.assert_allclose(natural.eigenvalue_rate["c"].real, -(tip**2) / 2, rtol=1e-8)


def test_where_there_is_no_derivative():
    shaft = system("shaft")
    whole = cra.sensitivities(shaft.replace(U=0.0), 1)
    assert np.isnan(whole.rate["EI"]).all()  # the same in both planes
    assert pickle.loads(pickle.dumps(whole)) == whole
    assert np.isnan(whole.shapes("EI", 0.3)).all() and np.isnan(whole.participation("EI", "w")).all()
    with pytest.raises(ValueError, match="x = None: must be places in the domain; only lumped coordinates"):
        whole.shapes("EI")


def test_participation_needs_one_load():
    """A base that shakes a foundation as well acts by its displacement too."""
    w = sp.Function("w")(t)
    beam = cra.Model(
        rhoA * (v + w).diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2 - c * w * v, prescribed=[w],
        left=-k * (v**2 + v.diff(x) ** 2) / 2, **DOMAIN,
    ).at({"rhoA": 0.3, "EI": 5.0, "l": 1.2, "k": 800.0, "c": 3.0})  # fmt: skip
    with pytest.raises(ValueError, match="motion = w: acts by its displacement"):
        cra.sensitivities(beam).participation("EI", "w")
