"""Eight systems other than an arm: what every analysis and every figure is tried on; and two without natural modes."""

from __future__ import annotations

from functools import cache

import sympy as sp

import cra_sym as cra

__all__ = ["NAMES", "TURNING", "system"]

x, t, length, rhoA, EI, T, k, m, g, G, I_r, c, a, U = sp.symbols("x t l rhoA EI T k m g G I_r c a U")
v, u, phi = (sp.Function(name)(x, t) for name in ("v", "u", "phi"))
w, p, q = (sp.Function(name)(t) for name in ("w", "p", "q"))
VALUES = {"l": 1.2, "rhoA": 0.3, "EI": 5.0, "k": 800.0, "m": 0.1}


def _model(density, fields=(v,), **options):
    given = {"prescribed": [w], "left": -k * v**2 / 2 - k * v.diff(x) ** 2 / 2} | options
    return cra.Model(density, fields=list(fields), x=x, domain=(0, length), t=t, **given)


def _moved(field=v):
    return rhoA * (field + w).diff(t) ** 2 / 2


BENT = _moved() - EI * v.diff(x, 2) ** 2 / 2

MODELS = {
    "string": lambda: (_model(_moved() - T * v.diff(x) ** 2 / 2, left=-k * v**2 / 2), {"T": 20.0}),
    "Timoshenko beam": lambda: (
        _model(
            _moved() + I_r * phi.diff(t) ** 2 / 2 - EI * phi.diff(x) ** 2 / 2 - G * (v.diff(x) - phi) ** 2 / 2,
            fields=(v, phi),
            left=-k * v**2 / 2 - k * phi**2 / 2,
        ),
        {"I_r": 1e-3, "G": 2e3},
    ),
    "tensioned beam": lambda: (_model(BENT - T * v.diff(x) ** 2 / 2), {"T": 30.0}),
    "beam on a foundation with an end mass": lambda: (
        _model(BENT - c * v**2 / 2, right=m * (v + w).diff(t) ** 2 / 2),
        {"c": 60.0},
    ),
    "hanging beam": lambda: (_model(BENT - rhoA * g * (length - x) * v.diff(x) ** 2 / 2), {"g": 9.81}),
    "two planes": lambda: (
        _model(
            BENT + rhoA * u.diff(t) ** 2 / 2 - c * u.diff(x, 2) ** 2 / 2 - a * v * u,
            fields=(v, u),
            left=-k * (v**2 + u**2 + v.diff(x) ** 2 + u.diff(x) ** 2) / 2,
        ),
        {"c": 11.0, "a": 20.0},
    ),
    "beam with an interior mass": lambda: (
        _model(BENT, inside=[(a, m * (v + w).diff(t) ** 2 / 2 + p * v)]),
        {"a": 0.5},
    ),
    "gantry": lambda: (
        _model(
            rhoA * (v + q + w).diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2,
            coordinates=[q],
            right=m * (v + q + w).diff(t) ** 2 / 2 + m * (q + w).diff(t) ** 2 - c * q**2 / 2 + p * q,
        ),
        {"c": 900.0},
    ),
}
NAMES = tuple(MODELS)
MODELS |= {
    "pipe on a support": lambda: (  # of the mass m that flows with the speed U, discharged at the right end
        _model(
            BENT + m * (v.diff(t) + U * v.diff(x)) ** 2 / 2 + m * v.diff(t) * w.diff(t) + p * v,
            left=-k * v.diff(x) ** 2 / 2,
            essential=[v.subs(x, 0), v.subs(x, a)],
            virtual_work=[(-m * U * (v.diff(t) + U * v.diff(x)), v, "right")],
        ),
        {"a": 0.5, "U": 2.0},
    ),
    "shaft": lambda: (  # that rotates with the speed U and carries a disc
        _model(
            BENT + rhoA * u.diff(t) ** 2 / 2 - EI * u.diff(x, 2) ** 2 / 2,
            fields=(v, u),
            left=-k * (v**2 + u**2) / 2,
            right=-k * (v**2 + u**2) / 2,
            inside=[(a, m * ((v + w).diff(t) ** 2 + u.diff(t) ** 2) / 2 + I_r * U * v.diff(x) * u.diff(x, t) + p * v)],
        ),
        {"a": 0.5, "U": 30.0, "I_r": 2e-3},
    ),
}
TURNING = tuple(name for name in MODELS if name not in NAMES)


@cache
def _made(name):
    model, more = MODELS[name]()
    return model, VALUES | more


def system(name, zeta=0.0, **changes):
    """Return one of them; its model is derived once."""
    model, values = _made(name)
    known = {symbol.name for symbol in model.symbols}
    return model.at({key: value for key, value in (values | changes).items() if key in known}, zeta)
