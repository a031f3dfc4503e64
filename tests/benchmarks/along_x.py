"""Frequencies of models that vary along x: a batch by the stresses over a few sets by the dynamic stiffness."""

from __future__ import annotations

import statistics
from time import perf_counter

import numpy as np
import sympy as sp

import cra_sym as cra
from cra_sym.model.routes import GeneralRoute

SETS, MODES, FEW = 1000, 5, 3

x, t, L, EI, rhoA, g, Omega, a = sp.symbols("x t L EI rhoA g Omega a")
v = sp.Function("v")(x, t)
PLAIN = rhoA * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2
TAPERED = rhoA * (1 - a * x / L) * v.diff(t) ** 2 / 2 - EI * (1 - a * x / L) ** 3 * v.diff(x, 2) ** 2 / 2
CASES = {
    "hanging": (PLAIN - rhoA * g * (L - x) * v.diff(x) ** 2 / 2, "g", np.linspace(0.0, 10.0, SETS)),
    "rotating": (PLAIN - rhoA * Omega**2 * (L**2 - x**2) / 4 * v.diff(x) ** 2, "Omega", np.linspace(0.0, 10.0, SETS)),
    "tapered": (TAPERED, "a", np.linspace(0.0, 0.7, SETS)),
}


def measured(rounds: int = 5) -> dict[str, dict[str, float]]:
    """Return, for each beam, us a set, times the dynamic stiffness, and the largest relative difference of the two."""
    return {name: _case(*CASES[name], rounds) for name in CASES}


def _case(density: sp.Expr, name: str, batch: np.ndarray, rounds: int) -> dict[str, float]:
    essential = [v.subs(x, 0), v.diff(x).subs(x, 0)]
    model = cra.Model(density, fields=[v], x=x, domain=(0, L), t=t, essential=essential)
    values = {symbol.name: 1.0 for symbol in model.symbols}
    system = model.at({**values, name: batch})
    route, general = model.numerics("route"), GeneralRoute(model.numerics("spatial"))
    few = np.linspace(0, SETS - 1, FEW).astype(int)
    picked = [p[few] if np.ndim(p) else p for p in system.parameters]
    ours, theirs = [], []
    for _ in range(rounds):
        start = perf_counter()
        found = route.angular_frequencies(system.parameters, system.shape, MODES)
        middle = perf_counter()
        other = general.angular_frequencies(picked, (FEW,), MODES)
        ours.append((middle - start) / SETS)
        theirs.append((perf_counter() - middle) / FEW)
    return {
        "us a set": 1e6 * statistics.median(ours),
        "times": statistics.median(theirs) / statistics.median(ours),
        "differs by": float(np.abs(other / found[few] - 1).max()),
    }


if __name__ == "__main__":
    for beam, row in measured().items():
        print(beam, row)
