"""Nonlinear models that several tests share."""

from __future__ import annotations

from functools import cache

import sympy as sp

import cra_sym as cra
from cra_sym.symbols import L, t, v, x

EI, mass, k_3 = sp.symbols("EI mass k_3", positive=True)
shortening = sp.Function("s")(x, t)
CLAMPED = [v.subs(x, 0), v.diff(x).subs(x, 0)]
BEAM = mass * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2


def beam(density=BEAM, **options):
    return cra.Model(density, fields=[v], x=x, domain=(0, L), t=t, **{"essential": CLAMPED, **options})


@cache
def inextensible(modes_of_arm: None = None) -> cra.System:
    """Return a clamped arm that does not stretch, to third order, with E I = rho A = L = 1."""
    density = BEAM - EI * v.diff(x, 2) ** 2 * v.diff(x) ** 2 / 2 + mass * shortening.diff(t) ** 2 / 2
    return beam(density, quadratures={shortening: v.diff(x) ** 2 / 2}).at({EI: 1.0, mass: 1.0, L: 1.0})


@cache
def sprung() -> cra.System:
    """Return the benchmark of Thouverez (2003): a cantilever with a cubic spring at its tip."""
    side, length, young, density = 0.014, 0.7, 2.05e11, 7800.0
    values = {EI: young * side**4 / 12, mass: density * side**2, L: length, k_3: 6e9}
    return beam(right=-k_3 * v**4 / 4).at(values)


q = sp.Function("q")(t)


def oscillator(lagrangian, **options) -> cra.Model:
    """Return a model of the coordinate q alone."""
    return cra.Model(0, fields=(), coordinates=[q], x=x, domain=(0, 1), t=t, left=lagrangian, **options)
