"""Sensitivities of complex eigenvalues, against closed forms and central differences in 30 digits."""

from __future__ import annotations

import pickle

import mpmath
import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from tests.systems import system

x, t, length, rhoA, EI, m, U, c, T, k = sp.symbols("x t l rhoA EI m U c T k")
v = sp.Function("v")(x, t)
DOMAIN = {"fields": [v], "x": x, "domain": (0, length), "t": t}
PIPE = cra.Model(  # clamped, with a damper at the end where the fluid leaves
    rhoA * v.diff(t) ** 2 / 2 + m * (v.diff(t) + U * v.diff(x)) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2,
    essential=[v.subs(x, 0), v.diff(x).subs(x, 0)],
    virtual_work=[(-m * U * (v.diff(t) + U * v.diff(x)) - c * v.diff(t), v, "right")], **DOMAIN,
)  # fmt: skip
VALUES = {"rhoA": 0.3, "m": 0.2, "EI": 5.0, "U": 4.0, "l": 1.2, "c": 0.4}


def pipe(s, values):
    """Return the determinant of the boundary conditions of the pipe, from the roots of its quartic."""
    p = {name: mpmath.mpf(value) for name, value in values.items()}
    quartic = [p["EI"], 0, p["m"] * p["U"] ** 2, 2 * p["m"] * p["U"] * s, (p["m"] + p["rhoA"]) * s**2]
    waves = mpmath.polyroots(quartic, maxsteps=100, extraprec=60)
    ends = [mpmath.exp(w * p["l"]) for w in waves]
    rows = [[1] * 4, waves, [w**2 * e for w, e in zip(waves, ends, strict=True)],
            [(p["EI"] * w**3 - p["c"] * s) * e for w, e in zip(waves, ends, strict=True)]]  # fmt: skip
    return mpmath.det(mpmath.matrix(rows))


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
    whole = cra.sensitivities(shaft.replace(U=0.0), 2)
    assert np.isnan(whole.rate["EI"]).all()  # the same in both planes
    assert pickle.loads(pickle.dumps(whole)) == whole
    with pytest.raises(ValueError, match="no real mode shapes"):
        whole.shapes("EI", 0.3)
    with pytest.raises(ValueError, match="no real mode shapes"):
        whole.participation("EI")


def test_participation_needs_one_load():
    """A base that shakes a foundation as well acts by its displacement too."""
    w = sp.Function("w")(t)
    beam = cra.Model(
        rhoA * (v + w).diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2 - c * w * v, prescribed=[w],
        left=-k * (v**2 + v.diff(x) ** 2) / 2, **DOMAIN,
    ).at({"rhoA": 0.3, "EI": 5.0, "l": 1.2, "k": 800.0, "c": 3.0})  # fmt: skip
    with pytest.raises(ValueError, match="motion = w: acts by its displacement"):
        cra.sensitivities(beam).participation("EI", "w")
