"""Seven models whose code is exported, with the ranges their parameters are drawn from."""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp

import cra_sym as cra
from cra_sym.symbols import L, t, v, x

__all__ = ["NAMES", "drawn", "model"]

rhoA, EI, T, k_f, m_e, kGA, I_r, k_t, k_r, GJ, J_p, d, a = sp.symbols("rhoA EI T k_f m_e kGA I_r k_t k_r GJ J_p d a")
k_b, k_p, m_b, m_p = sp.symbols("k_b k_p m_b m_p")
base, payload = sp.Function("base")(t), sp.Function("payload")(t)
phi, w = sp.Function("phi")(x, t), sp.Function("w")(t)
ROOT = -k_t * v**2 / 2 - k_r * v.diff(x) ** 2 / 2


def _model(density, **options):
    return cra.Model(density, x=x, domain=(0, L), t=t, **({"fields": [v], "prescribed": [w]} | options))


MOVED = rhoA * (v + w).diff(t) ** 2 / 2
BENT = MOVED - EI * v.diff(x, 2) ** 2 / 2
SHEARED = MOVED + I_r * phi.diff(t) ** 2 / 2 - EI * phi.diff(x) ** 2 / 2 - kGA * (v.diff(x) - phi) ** 2 / 2
TWISTED = (
    rhoA * (v + w + d * phi).diff(t) ** 2 / 2 + J_p * phi.diff(t) ** 2 / 2
    - EI * v.diff(x, 2) ** 2 / 2 - GJ * phi.diff(x) ** 2 / 2
)  # fmt: skip
CLAMPED = [v.subs(x, 0), v.diff(x).subs(x, 0)]
MODELS = {
    "tension": lambda: _model(BENT - T * v.diff(x) ** 2 / 2, left=ROOT),
    "foundation with end mass": lambda: _model(
        BENT - k_f * v**2 / 2, essential=CLAMPED, right=m_e * (v + w).diff(t) ** 2 / 2
    ),
    "Timoshenko with end mass and spring": lambda: _model(
        SHEARED, fields=[v, phi], left=-k_t * v**2 / 2 - k_r * phi**2 / 2, right=m_e * (v + w).diff(t) ** 2 / 2
    ),
    "bending and torsion": lambda: _model(
        TWISTED, fields=[v, phi], essential=[*CLAMPED, phi.subs(x, 0)],
        right=m_e * (v + w + a * phi).diff(t) ** 2 / 2,
    ),
    "string on a foundation": lambda: _model(
        MOVED - T * v.diff(x) ** 2 / 2 - k_f * v**2 / 2, left=-k_t * v**2 / 2, right=m_e * (v + w).diff(t) ** 2 / 2
    ),
    "string on a base with a payload": lambda: _model(
        rhoA * (v + base + w).diff(t) ** 2 / 2 - T * v.diff(x) ** 2 / 2, coordinates=[base, payload],
        left=m_b * (base + w).diff(t) ** 2 / 2 - k_b * base**2 / 2 - k_t * v**2 / 2,
        right=m_e * (v + base + w).diff(t) ** 2 / 2 + m_p * (payload + w).diff(t) ** 2 / 2
        - k_p * (v + a * base - payload) ** 2 / 2,
    ),
    "hinged-hinged beam": lambda: _model(BENT, essential=[v.subs(x, 0), v.subs(x, L)]),
}  # fmt: skip
NAMES = tuple(MODELS)


@cache
def model(name: str) -> cra.Model:
    """Return one of them, derived once."""
    return MODELS[name]()


def drawn(name: str, number: int) -> list[float]:
    """Return the parameters of a trial, in the order of the model's symbols: stiffnesses from 0 to infinity."""
    rng = np.random.default_rng([20, NAMES.index(name), number])
    found = []
    for symbol in model(name).symbols:
        wide = symbol in (k_t, k_r, k_b, k_p, T, k_f, m_e)
        value = 10.0 ** rng.uniform(-4, 8) if wide and rng.random() < 0.5 else 10.0 ** rng.uniform(-1, 1)
        if symbol in (k_t, k_r, k_p) and rng.random() < 0.3:
            value = float(rng.choice([0.0, 1e-9, 1e12, np.inf]))
        if symbol in (T, k_f, m_e) and rng.random() < 0.2:
            value = 0.0 if not name.startswith("string") or symbol != T else 1.0
        if symbol in (d, a):
            value *= 0.1 * float(rng.choice([-1.0, 1.0]))
        found.append(float(f"{value:.6g}"))
    return found
