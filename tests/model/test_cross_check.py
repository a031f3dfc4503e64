"""A system checks its own frequencies by Ritz's method, and says what a difference is owed to."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.model.routes import GeneralRoute
from cra_sym.model.stress_route import StressRoute

x, t = sp.symbols("x t")
a, b, m, k = sp.symbols("a b m k")
v = sp.Function("v")(x, t)
HALF = sp.Rational(1, 2)


def beam(bending, mass=1, **options):
    density = mass * v.diff(t) ** 2 / 2 - bending * v.diff(x, 2) ** 2 / 2
    options = {"essential": [v.subs(x, 0), v.diff(x).subs(x, 0)]} | options
    return cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, **options)


def string(tension, mass=1, **options):
    density = mass * v.diff(t) ** 2 / 2 - tension * v.diff(x) ** 2 / 2
    return cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=[v.subs(x, 0), v.subs(x, 1)], **options)


def step(left, right, place):
    return sp.Piecewise((left, x < place), (right, True))


@pytest.mark.parametrize(
    ("model", "values"),
    [
        (beam(step(1, b, a), step(1, 2, a)), {a: [0.2, 0.7, 1.5], b: [[0.1], [30.0]]}),
        (beam(1, inside=[(a, m * v.diff(t) ** 2 / 2)]), {a: [0.3, 0.6], m: 2.0}),
        (beam(step(1, b, a), inside=[(HALF, -k * v**2 / 2)]), {a: [0.3, 0.6], b: 3.0, k: [20.0, np.inf][:1]}),
        (string(1 + x, step(1, 4, a)), {a: 0.37}),
        (string(1 - x / 2), {}),
        (beam(1, left=-k * v**2 / 2, essential=()), {k: [0.0, 1.0]}),
    ],
    ids=["step", "mass", "step and spring", "string", "smooth", "rigid motions"],
)
def test_two_routes_agree_and_say_why_they_differ(model, values):
    system = model.at(values)
    check = system.check(3)
    assert check.agree.all() and check.difference.shape == check.mode.shape == system.shape
    assert (np.abs(check.difference) < 1e-5).all() and (np.abs(check.difference) <= check.expected).all()
    assert "halving its elements" in check.cause or "error estimate" in check.cause


def test_the_papers_arm_checks_itself():
    check = cra.Arm.nominal().replace(k_t=[1e3, np.inf], k_r=50.0).check()
    assert check.agree.all() and check.mode.shape == (2,)


@pytest.mark.parametrize(("factor", "words"), [(1 + 1e-4, "is wrong"), (1 - 1e-4, "one misses a mode")])
def test_a_route_that_errs_is_told(monkeypatch, factor, words):
    model = beam(1 + x)
    for route in (StressRoute, GeneralRoute):
        right = route.estimated
        monkeypatch.setattr(route, "estimated", lambda *args, right=right: (right(*args)[0] * factor, right(*args)[1]))
    check = model.at({}).check()
    assert not check.agree and words in check.cause and f"mode {check.mode}" in check.cause
    np.testing.assert_allclose(check.difference, 1 / factor - 1, rtol=0.1)
